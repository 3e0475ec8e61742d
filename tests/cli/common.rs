//! Helpers of all tests of the program.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use predicates::prelude::*;
use tempfile::TempDir;

/// The program, run inside a folder.
pub(crate) fn rattlemap(folder: &TempDir) -> Command {
    let mut command = Command::cargo_bin("rattlemap").unwrap();
    command.current_dir(folder.path());
    command
}

/// Runs the program in a folder with a line of arguments.
pub(crate) fn run(folder: &TempDir, line: &str) -> Assert {
    rattlemap(folder).args(line.split_whitespace()).assert()
}

/// What a command that succeeds prints.
pub(crate) fn stdout(folder: &TempDir, line: &str) -> String {
    String::from_utf8(run(folder, line).success().get_output().stdout.clone()).unwrap()
}

/// The object that a command prints.
pub(crate) fn printed(folder: &TempDir, line: &str) -> serde_json::Value {
    serde_json::from_str(&stdout(folder, line)).expect("one JSON object and nothing else")
}

/// The sorted names of an object's fields.
pub(crate) fn keys(object: &serde_json::Value) -> String {
    let mut keys: Vec<&str> = object.as_object().expect("an object").keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys.join(" ")
}

/// A new folder.
pub(crate) fn empty() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// A new folder with a scene `s.toml`.
pub(crate) fn with_scene(text: &str) -> TempDir {
    let folder = empty();
    fs::write(folder.path().join("s.toml"), text).unwrap();
    folder
}

/// Sorted names of the files in a folder.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// The JSON object in a file.
pub(crate) fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// A predicate: a text contains all of these parts.
pub(crate) fn says(parts: &[&str]) -> impl Predicate<str> + use<> {
    let parts: Vec<String> = parts.iter().map(ToString::to_string).collect();
    predicate::function(move |text: &str| parts.iter().all(|part| text.contains(part.as_str())))
}

/// The header of a CSV table as a line, and its rows.
pub(crate) fn rows(path: &Path) -> (String, Vec<Vec<String>>) {
    let mut table = csv::Reader::from_path(path).unwrap();
    let header = table.headers().unwrap().iter().collect::<Vec<_>>().join(",");
    (header, table.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect())
}
