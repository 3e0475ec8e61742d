//! The program: see `rattlemap --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    rattlemap::cli::run()
}
