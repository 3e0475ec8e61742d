//! Interrupted runs: killed, asked to stop, or stopped before the first record.

use std::time::{Duration, Instant};

use super::*;

/// Signals a run `delay` milliseconds after its record file exists.
#[cfg(unix)]
fn interrupted(folder: &TempDir, arguments: &str, delay: u64, signal: &str) -> (Option<i32>, String) {
    let run = begin(folder, &format!("map s.toml --out cut {arguments}"));
    wait_until(|| folder.path().join("cut/records.bin").exists());
    std::thread::sleep(Duration::from_millis(delay));
    stop(run, signal)
}

#[cfg(unix)]
#[test]
fn killed_runs_are_resumed_to_the_same_bytes() {
    check_killed_runs("--engine cpu", 300);
}

#[cfg(unix)]
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn killed_runs_of_lanes_are_resumed_to_the_same_bytes() {
    for precision in ["f32", "f64"] {
        check_killed_runs(&format!("--engine gpu --precision {precision}"), 2500);
    }
}

/// Ends runs of an engine after at most `longest` milliseconds, and resumes them.
#[cfg(unix)]
fn check_killed_runs(engine: &str, longest: u64) {
    let slow = "--set integration.early_stop=false";
    let folder = folder();
    let arguments = format!("{engine} {slow}");
    map(&folder, &format!("{arguments} --quiet --out whole")).success();
    let expected = records::bytes(&folder.path().join("whole"));
    for signal in ["-KILL", "-INT", "-KILL"] {
        let delay = moment() % longest;
        let (code, text) = interrupted(&folder, &arguments, delay, signal);
        if signal == "-INT" && code != Some(0) {
            assert_eq!(code, Some(130), "{text}");
            let resume = format!(
                "of 320 cells are kept; go on with: rattlemap map s.toml --out cut {arguments} --resume"
            );
            assert!(text.trim_end().ends_with(&resume), "{text}");
        }
        // Without --engine a run resumes with the engine of its records.
        succeeds(&folder, &format!("map s.toml {slow} --quiet --out cut --resume"));
        let cut = folder.path().join("cut");
        assert!(records::bytes(&cut) == expected, "{engine}: {signal} after {delay} ms");
        fs::remove_dir_all(cut).unwrap();
    }
}

/// A number that differs from run to run.
pub(super) fn moment() -> u64 {
    u64::from(std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().subsec_micros())
}

/// A run can stop while the device is being opened, which takes seconds in software.
#[cfg(unix)]
#[test]
fn a_run_that_is_stopped_early_says_how_to_resume() {
    let folder = folder();
    let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"));
    run.current_dir(folder.path()).args(words("map s.toml --engine gpu --set")).arg("title=it's <b>");
    // A shader in the driver's cache would be compiled too fast.
    let run = run.env("MESA_SHADER_CACHE_DISABLE", "true").stderr(Stdio::piped()).spawn().unwrap();
    wait_until(|| folder.path().join("out/s").exists());
    // By now the shader is being compiled.
    std::thread::sleep(Duration::from_millis(500));
    let clock = Instant::now();
    let (code, text) = stop(run, "-INT");
    assert_eq!(code, Some(130), "{text}");
    assert!(clock.elapsed() < Duration::from_secs(1), "{:?}: {text}", clock.elapsed());
    assert!(!folder.path().join("out").exists(), "an empty folder is left");
    let resume = text.trim_end().rsplit_once("of 320 cells are kept; go on with: rattlemap ").expect(&text).1;
    assert_eq!(resume, r"map s.toml --engine gpu --set 'title=it'\''s <b>' --resume");
    let line = format!("'{}' {resume}", assert_cmd::cargo::cargo_bin("rattlemap").display());
    assert!(Process::new("sh").args(["-c", &line]).current_dir(folder.path()).status().unwrap().success());
    assert_eq!(json(&folder.path().join("out/s/manifest.json"))["title"], "it's <b>");
}

/// Each cell would take minutes.
#[cfg(unix)]
#[test]
fn a_run_of_slow_cells_stops_within_two_seconds() {
    let folder = folder();
    let slow = "--engine cpu --set parameters.r1=0 --set parameters.r2=0 --set integration.transient_periods=1000000";
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let run = begin(&folder, &format!("map s.toml --out cut --force {slow}"));
        std::thread::sleep(Duration::from_millis(1500));
        let clock = Instant::now();
        let (ended, text) = stop(run, signal);
        let waited = clock.elapsed();
        assert_eq!(ended, Some(code), "{text}");
        assert!(waited < Duration::from_secs(2), "{waited:?}: {text}");
        assert!(text.contains("are kept; go on with: rattlemap map s.toml --out cut"), "{text}");
    }
}

#[test]
fn a_map_whose_cells_all_fail_says_so_at_once() {
    let folder = folder();
    let run = map(&folder, &format!("--out stiff {STIFF} --set axis.0.count=4")).code(1);
    run.stderr(says(&[
        "warning: all of the first 8 cells failed (8 too_stiff)",
        "error: every cell failed; the status column says why",
    ]));
}
