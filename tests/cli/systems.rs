//! What the program makes of the machine that it is on.

use std::io::Write;
use std::process::Command;

fn rattlemap() -> &'static str {
    env!("CARGO_BIN_EXE_rattlemap")
}

/// Mesa's drivers look for a screen; where there is none nobody is told.
#[test]
fn nothing_is_said_of_screens_where_there_are_none() {
    let mut command = Command::new(rattlemap());
    command.env_remove("XDG_RUNTIME_DIR").env_remove("WAYLAND_DISPLAY").arg("devices");
    let run = command.output().unwrap();
    let [told, said] = [run.stdout, run.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(run.status.success() && told.contains("gpu: "), "{told}{said}");
    assert_eq!(said, "");
}

/// A processor of 2010, on which the first instruction that it lacks would end the process without a word.
#[cfg(all(target_os = "linux", target_feature = "avx2"))]
#[test]
fn a_processor_without_the_instructions_is_told_of() {
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
