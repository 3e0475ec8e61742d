//! Signals to commands that store nothing before their end: no folder is left, and the message says how they ended.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{names, with_scene};

/// A line whose cells take a quarter of an hour each.
const SLOW: &str = "parameters = { r1 = 0, r2 = 0 }\n\
    axis = [{ parameter = 'e', min = 0.4, max = 0.8, count = 5 }]\n\
    integration = { transient_periods = 1_000_000_000 }\n";

/// A map whose cells are decided at once; the whole budget of each takes seconds. More periods would need gigabytes.
const LONG: &str = "axis = [{ parameter = 'e', min = 0.6, max = 0.606, count = 4 }, \
                    { parameter = 'omega', min = 5.7, max = 5.71, count = 2 }]\n\
    integration = { transient_periods = 4_000_000 }\n";

fn rattlemap(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("rattlemap"));
    command.current_dir(folder).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    // Without a driver: while one is opened, which takes seconds, nothing can be stopped.
    command.env("VK_DRIVER_FILES", "none").env("VK_ICD_FILENAMES", "none");
    command
}

/// Sends a signal to a running command. Expects that it ends soon, with a message and nothing on stdout.
#[track_caller]
fn stops(folder: &Path, arguments: &[&str], says: &str) {
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let run = rattlemap(folder, arguments).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(1000));
        let clock = Instant::now();
        Command::new("kill").args([signal, &run.id().to_string()]).status().unwrap();
        let ended = run.wait_with_output().unwrap();
        let (waited, said) = (clock.elapsed(), String::from_utf8(ended.stderr).unwrap());
        assert_eq!(ended.status.code(), Some(code), "{said}");
        assert!(waited < Duration::from_secs(2), "{waited:?}: {said}");
        assert!(said.contains(says) && ended.stdout.is_empty(), "{said}");
    }
}

#[test]
fn an_interrupted_diagram_leaves_no_folder() {
    let folder = with_scene(SLOW);
    for start in ["rest", "up"] {
        let start = format!("start.policy={start}");
        let says = "error: interrupted after 0 of 5 columns; nothing was written to out/s";
        stops(folder.path(), &["bifurcation", "s.toml", "--set", &start], says);
        assert!(!folder.path().join("out").exists());
    }
}

#[test]
fn an_interrupted_orbit_leaves_no_folder() {
    let folder = with_scene(SLOW);
    let says = "error: interrupted before the class was decided; nothing was written";
    stops(folder.path(), &["orbit", "--transient", "1000000000", "--out", "a/b"], says);
    assert!(!folder.path().join("a").exists());
}

#[test]
fn an_interrupted_validation_does_not_change_the_map() {
    let folder = with_scene(LONG);
    let made = rattlemap(folder.path(), &["map", "s.toml", "--engine", "cpu", "--quiet"]).output().unwrap();
    assert!(made.status.success(), "{made:?}");
    let out = folder.path().join("out/s");
    let before = names(&out);
    let says = " of 8 cells, and nothing was written to out/s";
    stops(folder.path(), &["validate", "out/s"], says);
    assert_eq!(names(&out), before);
}
