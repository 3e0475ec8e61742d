//! The program: see `rattlemap --help`.

use std::io::{Write, stderr};
use std::process::ExitCode;

use rattlemap::cli;
use rattlemap::job::{environment, processor};

fn main() -> ExitCode {
    if !processor::is_fit() {
        let _ = stderr().write_all(processor::MISFIT.as_bytes());
        return ExitCode::FAILURE;
    }
    if let Some((name, value)) = environment::missing_variable() {
        #[allow(unsafe_code, reason = "a library of the system reads its settings from the environment")]
        // SAFETY: no other thread exists that could read the environment at the same time.
        unsafe {
            std::env::set_var(name, value);
        }
    }
    cli::run()
}
