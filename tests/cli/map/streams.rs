//! Closed and full stderr and stdout.

use super::*;

/// Runs a line of shell commands, in which `R` is the program, and returns the exit code.
fn in_shell(folder: &TempDir, line: &str) -> Option<i32> {
    let program = assert_cmd::cargo::cargo_bin("rattlemap");
    let status = Process::new("bash")
        .args(["-c", &format!("set -o pipefail; R() {{ '{}' \"$@\"; }}; {line}", program.display())])
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    status.unwrap().code()
}

#[cfg(target_os = "linux")]
#[test]
fn messages_that_cannot_be_written_are_dropped() {
    let folder = folder();
    let map = "R map s.toml --engine cpu --force";
    for line in [
        format!("{map} 2> >(head -1 >/dev/null)"),
        format!("{map} 2>/dev/full"),
        format!("{map} 2>&-"),
        "R validate out/s --samples 20 2>/dev/full".to_owned(),
        "R validate out/s --samples 20 2> >(true)".to_owned(),
    ] {
        let made = folder.path().join("out/s").join(if line.contains(" map ") {
            "map.png"
        } else {
            "validation.json"
        });
        // Otherwise a validation would report its own file as damaged.
        fs::remove_file(&made).ok();
        assert_eq!(in_shell(&folder, &line), Some(0), "{line}");
        assert!(made.is_file(), "{line}");
    }
    assert_eq!(in_shell(&folder, "R map none.toml 2>/dev/full"), Some(2));
}

#[cfg(target_os = "linux")]
#[test]
fn a_closed_stdout_is_no_failure_and_a_full_disk_is_one() {
    let folder = folder();
    for command in ["R devices", "R orbit"] {
        assert_eq!(in_shell(&folder, &format!("{command} | true")), Some(0), "{command}");
        assert_eq!(in_shell(&folder, &format!("{command} >/dev/full")), Some(1), "{command}");
    }
}
