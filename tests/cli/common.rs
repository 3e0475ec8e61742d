//! What tests of the program share.

use std::path::Path;

use assert_cmd::Command;
use predicates::prelude::*;
use tempfile::TempDir;

/// The program, run inside a folder.
pub(crate) fn rattlemap(folder: &TempDir) -> Command {
    let mut command = Command::cargo_bin("rattlemap").unwrap();
    command.current_dir(folder.path());
    command
}

/// Whether a text has all of these parts.
pub(crate) fn says(parts: &[&str]) -> impl Predicate<str> + use<> {
    let parts: Vec<String> = parts.iter().map(ToString::to_string).collect();
    predicate::function(move |text: &str| parts.iter().all(|part| text.contains(part.as_str())))
}

/// The header of a table in one line, and its rows.
pub(crate) fn rows(path: &Path) -> (String, Vec<Vec<String>>) {
    let mut table = csv::Reader::from_path(path).unwrap();
    let header = table.headers().unwrap().iter().collect::<Vec<_>>().join(",");
    (header, table.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect())
}
