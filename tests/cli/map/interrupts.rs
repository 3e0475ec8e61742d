//! Interrupted runs: killed, asked to stop, before there is anything to keep.

use std::path::PathBuf;
use std::time::Duration;

use super::*;

/// Starts a run that takes a while, and gives it `delay` milliseconds once its records have
/// begun.
fn interrupted(folder: &TempDir, arguments: &[&str], delay: u64, signal: &str) -> (Option<i32>, String) {
    let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"))
        .current_dir(folder.path())
        .args(["map", "s.toml", "--out", "cut"])
        .args(arguments)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let records: PathBuf = folder.path().join("cut/records.bin");
    while !records.exists() {
        std::thread::sleep(Duration::from_millis(2));
    }
    std::thread::sleep(Duration::from_millis(delay));
    Process::new("kill").args([signal, &run.id().to_string()]).status().unwrap();
    let mut said = String::new();
    std::io::Read::read_to_string(run.stderr.as_mut().unwrap(), &mut said).unwrap();
    (run.wait().unwrap().code(), said)
}

#[cfg(unix)]
#[test]
fn killed_runs_are_resumed_to_the_same_bytes() {
    let slow = ["--set", "integration.early_stop=false"];
    for (engine, longest) in
        [(&["--engine", "cpu"][..], 300), (&["--engine", "gpu", "--precision", "f64"], 2500)]
    {
        let folder = folder();
        let arguments = [engine, &slow].concat();
        map(&folder, &[&arguments[..], &["--quiet", "--out", "whole"]].concat()).success();
        let expected = records::bytes(&folder.path().join("whole"));
        for signal in ["-KILL", "-INT", "-KILL"] {
            let delay = moment() % longest;
            let (code, said) = interrupted(&folder, &arguments, delay, signal);
            if signal == "-INT" && code != Some(0) {
                assert_eq!(code, Some(130), "{said}");
                let go_on = format!(
                    "of 320 cells are kept; go on with: rattlemap map s.toml --out cut {} \
                     --set integration.early_stop=false --resume",
                    engine.join(" ")
                );
                assert!(said.trim_end().ends_with(&go_on), "{said}");
            }
            // Without an engine it goes on with the one that it began with.
            let go_on = [&["map", "s.toml"], &slow[..], &["--quiet", "--out", "cut", "--resume"]].concat();
            command(&folder, &go_on).assert().success();
            let cut = folder.path().join("cut");
            assert!(records::bytes(&cut) == expected, "{engine:?}: {signal} after {delay} ms");
            fs::remove_dir_all(cut).unwrap();
        }
    }
}

/// A number that no two runs share.
pub(super) fn moment() -> u64 {
    u64::from(std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().subsec_micros())
}

/// Before there is a device, too: opening one takes seconds in software, and nobody waits for it.
#[cfg(unix)]
#[test]
fn a_run_that_is_stopped_early_says_how_to_go_on() {
    let folder = folder();
    let title = "title=it's <b>";
    let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"))
        .current_dir(folder.path())
        .args(["map", "s.toml", "--engine", "gpu", "--set", title])
        // What the driver has compiled before makes no difference.
        .env("MESA_SHADER_CACHE_DISABLE", "true")
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while !folder.path().join("out/s").exists() {
        std::thread::sleep(Duration::from_millis(2));
    }
    // The shader is being compiled.
    std::thread::sleep(Duration::from_millis(500));
    let clock = std::time::Instant::now();
    Process::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap();
    let mut said = String::new();
    std::io::Read::read_to_string(run.stderr.as_mut().unwrap(), &mut said).unwrap();
    assert_eq!(run.wait().unwrap().code(), Some(130), "{said}");
    assert!(clock.elapsed() < Duration::from_secs(1), "{:?}: {said}", clock.elapsed());
    assert!(!folder.path().join("out").exists(), "an empty folder is left");
    let go_on = said.trim_end().rsplit_once("of 320 cells are kept; go on with: rattlemap ").expect(&said).1;
    assert_eq!(go_on, r"map s.toml --engine gpu --set 'title=it'\''s <b>' --resume");
    let resume = format!("'{}' {go_on}", assert_cmd::cargo::cargo_bin("rattlemap").display());
    assert!(Process::new("sh").args(["-c", &resume]).current_dir(folder.path()).status().unwrap().success());
    let manifest = fs::read_to_string(folder.path().join("out/s/manifest.json")).unwrap();
    assert!(manifest.contains("\"title\": \"it's <b>\""), "{manifest}");
}

/// Cells that would take minutes each: whoever waits for them can stop.
#[cfg(unix)]
#[test]
fn a_run_of_slow_cells_stops_within_a_second_or_two() {
    let folder = folder();
    let slow = ["parameters.r1=0", "parameters.r2=0", "integration.transient_periods=1000000"];
    let mut arguments = vec!["--engine", "cpu"];
    slow.iter().for_each(|set| arguments.extend(["--set", set]));
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"))
            .current_dir(folder.path())
            .args(["map", "s.toml", "--out", "cut", "--force"])
            .args(&arguments)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(1500));
        let clock = std::time::Instant::now();
        Process::new("kill").args([signal, &run.id().to_string()]).status().unwrap();
        let ended = run.wait().unwrap();
        let waited = clock.elapsed();
        let mut said = String::new();
        std::io::Read::read_to_string(run.stderr.as_mut().unwrap(), &mut said).unwrap();
        assert_eq!(ended.code(), Some(code), "{said}");
        assert!(waited < Duration::from_secs(2), "{waited:?}: {said}");
        assert!(said.contains("are kept; go on with: rattlemap map s.toml --out cut"), "{said}");
    }
}

/// What the first cells end in, all of them, is told before the others are computed.
#[test]
fn a_map_whose_cells_all_fail_says_so_at_once() {
    let folder = folder();
    let stiff = ["--set", "parameters.m1=2e-6", "--set", "axis.1.min=0.003", "--set", "axis.1.max=0.004"];
    let few = ["--set", "integration.transient_periods=20", "--set", "integration.observed_periods=4"];
    let small = ["--set", "axis.0.count=4", "--set", "axis.1.count=2", "--set", "integration.max_period=1"];
    let arguments = [&["--engine", "cpu", "--out", "stiff"], &stiff[..], &few, &small].concat();
    let said = map(&folder, &arguments).code(1).get_output().stderr.clone();
    let said = String::from_utf8(said).unwrap();
    assert!(said.contains("warning: all of the first 8 cells failed (8 too_stiff)"), "{said}");
    assert!(said.contains("error: every cell failed; the status column says why"), "{said}");
}
