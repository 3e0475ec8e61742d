//! `scripts/measure_gpu.sh` at a tiny size, on any adapter: it writes a table and ends in time.

use std::collections::HashMap;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use rattlemap::gpu;
use tempfile::TempDir;

/// Returns the software adapter, which is known to be slow, if there is one.
fn software() -> Option<String> {
    let adapters = pollster::block_on(gpu::adapters());
    adapters.iter().find(|adapter| !gpu::is_hardware(&adapter.info)).map(|found| gpu::describe(&found.info))
}

/// Runs steps of the script in f32 on this adapter, for at most `seconds`. Returns the summary.
fn measure(adapter: &str, out: &TempDir, seconds: u32, side: u32, steps: &[&str]) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/measure_gpu.sh");
    let mut run = Command::new(script);
    run.arg(assert_cmd::cargo::cargo_bin("rattlemap")).arg(out.path()).arg(side.to_string()).args(steps);
    run.env("WGPU_ADAPTER_NAME", adapter).env("PRECISIONS", "f32");
    run.env("MEASURE_SECONDS", seconds.to_string());
    let output = run.output().unwrap();
    assert!(output.status.success(), "{output:?}");
    fs::read_to_string(out.path().join("summary.md")).unwrap()
}

/// Returns the rows of the first table, by column.
fn rows(summary: &str) -> Vec<HashMap<&str, &str>> {
    let mut table = summary.lines().skip_while(|line| !line.starts_with("| what |"));
    let header: Vec<&str> = table.next().unwrap().split('|').map(str::trim).collect();
    table
        .skip(1)
        .take_while(|line| line.starts_with('|'))
        .map(|line| header.iter().copied().zip(line.split('|').map(str::trim)).collect())
        .collect()
}

#[test]
#[ignore = "takes half a minute; scripts/test.sh --all"]
fn a_measurement_writes_a_table() {
    let out = tempfile::tempdir().unwrap();
    let summary = measure(&software().unwrap_or_else(|| "vulkan".to_owned()), &out, 240, 8, &["classes"]);
    let rows = rows(&summary);
    assert_eq!(rows.len(), 1, "{summary}");
    let row = &rows[0];
    assert_eq!(["what", "precision", "runs", "cells"].map(|name| row[name]), ["classes", "f32", "1", "64"]);
    let number = |name: &str| row[name].parse::<f64>().unwrap_or_else(|_| panic!("{name}: {summary}"));
    // The time from start to files includes the integration.
    assert!(
        number("start to files, s") > number("integration, s") && number("integration, s") > 0.0,
        "{row:?}"
    );
    assert!(number("lane-periods/s") > number("cells/s"), "{row:?}");
    for part in ["- disk: ", "processor: ", "precision   f32"] {
        assert!(summary.contains(part), "no {part}: {summary}");
    }
}

#[test]
#[ignore = "takes half a minute; scripts/test.sh --all"]
fn runs_on_a_slow_card_are_stopped_and_reported() {
    let Some(adapter) = software() else {
        // The test harness hides the output of `println!` in passing tests.
        let mut stderr = std::io::stderr();
        writeln!(stderr, "SKIPPED: there is no software adapter, which is certainly too slow").unwrap();
        return;
    };
    let out = tempfile::tempdir().unwrap();
    let clock = Instant::now();
    // It needs minutes for 2 * 10^8 periods of lanes.
    let summary = measure(&adapter, &out, 18, 640, &["brute", "classes", "compile", "engines"]);
    // A run that is stopped has five seconds to write its results.
    assert!(clock.elapsed().as_secs() <= 18 + 8, "it took {:?}", clock.elapsed());
    let rows = rows(&summary);
    let reported: Vec<[&str; 2]> = rows.iter().map(|row| ["what", "cells"].map(|name| row[name])).collect();
    assert!(reported[0][0] == "brute" && reported[0][1].starts_with("stopped after "), "{summary}");
    let late = ["classes", "compile_cold", "compile_warm"].map(|what| [what, "no time was left"]);
    assert_eq!(reported[1..], late, "{summary}");
    assert!(summary.contains("- missing: engines: no time was left"), "{summary}");
}
