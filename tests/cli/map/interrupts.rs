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
                assert_eq!(code, Some(1), "{said}");
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

/// Before there is a device, too: opening one takes seconds in software.
#[cfg(unix)]
#[test]
fn a_run_that_is_stopped_early_says_how_to_go_on() {
    let folder = folder();
    let title = "title=it's <b>";
    let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"))
        .current_dir(folder.path())
        .args(["map", "s.toml", "--engine", "gpu", "--set", title])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while !folder.path().join("out/s").exists() {
        std::thread::sleep(Duration::from_millis(2));
    }
    Process::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap();
    let mut said = String::new();
    std::io::Read::read_to_string(run.stderr.as_mut().unwrap(), &mut said).unwrap();
    assert_eq!(run.wait().unwrap().code(), Some(1), "{said}");
    let go_on = said.trim_end().rsplit_once("of 320 cells are kept; go on with: rattlemap ").expect(&said).1;
    assert_eq!(go_on, r"map s.toml --engine gpu --set 'title=it'\''s <b>' --resume");
    let resume = format!("'{}' {go_on}", assert_cmd::cargo::cargo_bin("rattlemap").display());
    assert!(Process::new("sh").args(["-c", &resume]).current_dir(folder.path()).status().unwrap().success());
    let manifest = fs::read_to_string(folder.path().join("out/s/manifest.json")).unwrap();
    assert!(manifest.contains("\"title\": \"it's <b>\""), "{manifest}");
}
