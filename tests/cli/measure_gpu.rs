//! `scripts/measure_gpu.sh` on whatever adapter there is, at a tiny size: it keeps its time, and leaves a table.

use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use tempfile::TempDir;

/// Steps of the script for so many seconds, on the software driver where there is one.
fn measure(out: &TempDir, seconds: u32, steps: &[&str]) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/measure_gpu.sh");
    let mut run = Command::new(script);
    run.arg(assert_cmd::cargo::cargo_bin("rattlemap")).arg(out.path()).arg("8").args(steps);
    run.env("WGPU_ADAPTER_NAME", "vulkan").env("PRECISIONS", "f32");
    run.env("MEASURE_SECONDS", seconds.to_string());
    let output = run.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}\n{}", String::from_utf8_lossy(&output.stdout));
    fs::read_to_string(out.path().join("summary.md")).unwrap()
}

/// The first table's rows: what was measured, by column.
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
fn a_card_is_measured_and_told_in_a_table() {
    let out = tempfile::tempdir().unwrap();
    let summary = measure(&out, 90, &["classes"]);
    let rows = rows(&summary);
    assert_eq!(rows.len(), 1, "{summary}");
    let row = &rows[0];
    assert_eq!(["what", "precision", "runs", "cells"].map(|name| row[name]), ["classes", "f32", "1", "64"]);
    let number = |name: &str| row[name].parse::<f64>().unwrap_or_else(|_| panic!("{name}: {summary}"));
    // The wall time holds everything else.
    assert!(
        number("start to files, s") > number("integration, s") && number("integration, s") > 0.0,
        "{row:?}"
    );
    assert!(number("lane-periods/s") > number("cells/s"), "{row:?}");
    for part in ["- disk: ", " MB/s", "processor: ", "precision   f32"] {
        assert!(summary.contains(part), "no {part}: {summary}");
    }
}

#[test]
fn a_card_that_is_too_slow_is_cut_and_still_told() {
    let out = tempfile::tempdir().unwrap();
    let clock = Instant::now();
    let summary = measure(&out, 10, &[]);
    // It has these seconds, and those in which a run that is cut writes what it has.
    assert!(clock.elapsed().as_secs() <= 20, "it took {:?}", clock.elapsed());
    let told: Vec<(&str, &str)> = rows(&summary).iter().map(|row| (row["what"], row["cells"])).collect();
    let names: Vec<&str> = told.iter().map(|&(what, _)| what).collect();
    let all = ["main", "classes", "brute", "own_flow", "adaptive", "latency", "compile_cold", "compile_warm"];
    assert_eq!(names, all, "{summary}");
    let is_told = |&(_, cells): &(&str, &str)| {
        cells.parse::<u32>().is_ok() || cells.starts_with("cut after ") || cells == "no time was left"
    };
    assert!(told.iter().all(is_told) && told[7].1 == "no time was left", "{summary}");
    assert!(summary.contains("- missing: engines: no time was left"), "{summary}");
}
