//! Text from outside is escaped before it reaches the terminal.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use rattlemap::text::printable::is_printable;
use tempfile::TempDir;

/// Control characters: colour, window title, bell, direction of text, deletion.
const EVIL: &str = "a\u{1b}[31m\u{1b}]0;b\u{7}\u{9b}2J\u{202e}c\u{7f}\u{85}d";

/// Control characters that all systems allow in names of files.
const EVIL_NAME: &str = "a\u{1b}[31m\u{202e}\nfake line";

const SCENE: &str = "[[axis]]\nparameter = 'e'\nmin = 0.5\nmax = 0.6\ncount = 2\n\n[[axis]]\nparameter = 'omega'\n\
                     min = 11\nmax = 12\ncount = 2\n\n[outputs]\nfiles = ['csv', 'html']\n";

struct Folder(TempDir);

impl Folder {
    fn new() -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        folder.write("s.toml", SCENE);
        folder
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path().join(name), text).unwrap();
    }

    /// Runs the program, checks that it prints no control characters, and returns its output.
    #[track_caller]
    fn says(&self, code: i32, environment: &[(&str, &str)], arguments: &[&str]) -> String {
        let mut command = Command::cargo_bin("rattlemap").unwrap();
        command.envs(environment.iter().copied());
        let run = command.current_dir(self.path()).args(arguments).assert().code(code);
        let output = run.get_output();
        let said = [&output.stdout[..], &output.stderr[..]].concat();
        let said = String::from_utf8(said).unwrap();
        let raw: Vec<char> = said.chars().filter(|&c| c != '\n' && !is_printable(c)).collect();
        assert!(raw.is_empty(), "{arguments:?}: {raw:?} in {said:?}");
        assert!(!said.lines().any(|line| line.starts_with("fake line")), "{arguments:?}: {said}");
        said
    }
}

/// Checks that an output is one line, an error that quotes the control characters escaped.
#[track_caller]
fn quotes(said: &str) {
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("error: ") && said.contains("a\\u{1b}[31m"), "{said}");
}

#[test]
fn scenes_and_sets_are_escaped() {
    let folder = Folder::new();
    let in_toml: String = EVIL.chars().map(|c| format!("\\U{:08X}", u32::from(c))).collect();
    for text in [
        format!("\"{in_toml}\" = 1\n{SCENE}"),
        format!("model = \"{in_toml}\"\n{SCENE}"),
        format!("{SCENE}\n[start]\npolicy = {EVIL}"),
    ] {
        folder.write("bad.toml", &text);
        let said = folder.says(2, &[], &["map", "bad.toml"]);
        assert!(said.starts_with("error: bad.toml:") && said.lines().count() == 1, "{said}");
    }
    for set in [format!("{EVIL}=1"), format!("F={EVIL}"), EVIL.to_owned(), format!("{EVIL}\nfake line=1")] {
        quotes(&folder.says(2, &[], &["map", "s.toml", "--set", &set]));
        quotes(&folder.says(2, &[], &["orbit", "--set", &set]));
    }
}

#[cfg(unix)]
#[test]
fn names_of_files_and_folders_are_escaped() {
    let folder = Folder::new();
    quotes(&folder.says(2, &[], &["map", EVIL_NAME]));
    quotes(&folder.says(2, &[], &["validate", EVIL_NAME]));
    // A folder that exists.
    let map = ["map", "s.toml", "--engine", "cpu", "--out", EVIL_NAME];
    let done = folder.says(0, &[], &map);
    let last = done.lines().last().unwrap();
    assert!(last.starts_with("a\\u{1b}[31m\\u{202e}\\nfake line: ") && last.contains("cells.csv"), "{done}");
    quotes(&folder.says(2, &[], &map));
    // A file in the place of a folder.
    folder.write("b\u{1b}", "");
    let said = folder.says(2, &[], &["map", "s.toml", "--engine", "cpu", "--out", "b\u{1b}"]);
    assert!(said.contains("b\\u{1b}") && said.lines().count() == 1, "{said}");
}

#[test]
fn manifests_are_escaped() {
    let folder = Folder::new();
    folder.says(0, &[], &["map", "s.toml", "--engine", "cpu", "--out", "o", "--quiet"]);
    let manifest = fs::read_to_string(folder.path().join("o/manifest.json")).unwrap();
    let evil = serde_json::to_string(&format!("{EVIL}\nfake line")).unwrap();
    for (field, code) in
        [("command", 2), ("crate_version", 2), ("engine", 2), ("precision", 2), ("device", 2), ("scene", 2)]
    {
        let mut object: serde_json::Value = serde_json::from_str(&manifest).unwrap();
        object[field] = serde_json::from_str(&evil).unwrap();
        folder.write("o/manifest.json", &object.to_string());
        let said = folder.says(code, &[], &["validate", "o"]);
        // A warning that the manifest is damaged comes first.
        let error = said.lines().last().unwrap_or_default();
        assert!(error.starts_with("error: ") && said.lines().count() <= 2, "{field}: {said}");
    }
    folder.write("o/manifest.json", &format!("{{\"command\": {EVIL}"));
    folder.says(2, &[], &["validate", "o"]);
}

#[test]
fn arguments_and_the_environment_are_escaped() {
    let folder = Folder::new();
    let evil = format!("{EVIL}\nfake line");
    for arguments in [
        &[&*evil][..],
        &["map", "s.toml", "--engine", &evil],
        &["map", "s.toml", "--precision", &evil],
        &["map", "s.toml", &format!("--{evil}")],
        &["orbit", "--start", &evil],
        &["orbit", "--periods", &evil],
        &["validate", "o", "--samples", &evil],
    ] {
        let said = folder.says(2, &[], arguments);
        assert!(
            said.starts_with("error: ") && said.contains("a\\u{1b}[31m") && said.contains("\\nfake line"),
            "{said}"
        );
    }
    // If the environment names a missing adapter, `auto` fails.
    for (name, code) in [("WGPU_ADAPTER_NAME", 2), ("WGPU_BACKEND", 0)] {
        let said = folder.says(2, &[(name, &evil)], &["map", "s.toml", "--engine", "gpu"]);
        quotes(&said);
        folder.says(code, &[(name, &evil)], &["devices"]);
    }
    assert!(folder.says(0, &[], &["--help"]).contains("Usage: rattlemap"), "no help");
    let version = folder.says(0, &[], &["--version"]);
    assert!(version.starts_with(concat!("rattlemap ", env!("CARGO_PKG_VERSION"), " (")), "{version}");
}
