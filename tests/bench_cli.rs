//! The instruments in tiny sizes, as `rattlemap bench ... --quick` runs them.

use assert_cmd::Command;

/// Runs `bench <what> --quick` and returns what it says, and the folder it wrote.
fn quick(what: &str) -> (String, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = Command::cargo_bin("rattlemap").unwrap();
    let done = command.args(["bench", what, "--quick", "--out"]).arg(&out).assert().success();
    (String::from_utf8_lossy(&done.get_output().stderr).into_owned(), folder)
}

#[test]
fn stability_judges_every_part_and_writes_its_folder() {
    let (said, folder) = quick("stability");
    for part in ["long_runs", "impacts", "grazing", "chatter", "stiffness", "grid", "fuzz"] {
        let line = said.lines().find(|line| line.starts_with(part));
        assert!(line.is_some_and(|line| line.contains("holds: ")), "{part}: {said}");
    }
    let out = folder.path().join("out");
    let manifest = std::fs::read_to_string(out.join("manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(manifest["command"], "bench stability");
    for file in manifest["files"].as_array().unwrap() {
        let size = out.join(file.as_str().unwrap()).metadata().unwrap().len();
        assert!(size > 0, "{file} is empty");
    }
}
