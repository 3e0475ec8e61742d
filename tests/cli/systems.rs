//! Machines without a display, or without the instructions that the program needs.

use std::io::Write;
use std::process::Command;

fn rattlemap() -> &'static str {
    env!("CARGO_BIN_EXE_rattlemap")
}

/// Mesa's drivers look for a display. The program keeps them from printing an error.
#[test]
fn a_missing_display_causes_no_message() {
    let mut command = Command::new(rattlemap());
    command.env_remove("XDG_RUNTIME_DIR").env_remove("WAYLAND_DISPLAY").arg("devices");
    let run = command.output().unwrap();
    let [stdout, stderr] = [run.stdout, run.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(run.status.success() && stdout.contains("gpu: "), "{stdout}{stderr}");
    assert_eq!(stderr, "");
}

/// Emulates a processor of 2010. A missing instruction would end the process without a message.
#[cfg(all(target_os = "linux", target_feature = "avx2"))]
#[test]
fn a_processor_without_the_instructions_gets_a_message() {
    let mut command = Command::new("qemu-x86_64");
    let Ok(run) = command.args(["-cpu", "Nehalem", rattlemap(), "models"]).output() else {
        let mut stderr = std::io::stderr();
        writeln!(stderr, "SKIPPED: no qemu-x86_64 (qemu-user) to emulate a processor without AVX2").unwrap();
        return;
    };
    let said = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(1), "{said}");
    assert!(
        said.contains(
            "error: this program was built for processors with AVX2 and FMA, and this one lacks them"
        ),
        "{said}"
    );
    assert!(run.stdout.is_empty());
}
