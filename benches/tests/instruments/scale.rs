//! Tests of `scale` with a tiny map.

use std::fs;

use assert_cmd::Command;

use super::cli::rows;

#[test]
fn scale_merges_its_shards_and_writes_costs() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::cargo_bin("rattlemap-bench").unwrap();
    command.current_dir(folder.path()).args(["scale", "--quick", "--all", "--rounds", "2"]);
    command.assert().success().stdout("");
    let out = folder.path().join("out/bench/scale");
    let phases: Vec<String> = rows(&out.join("scale.csv")).iter().map(|row| row["phase"].clone()).collect();
    assert!(
        phases.ends_with(&["look at shards", "gather records", "write files"].map(str::to_owned)),
        "{phases:?}"
    );
    let files = rows(&out.join("files.csv"));
    let bytes =
        |name: &str| files.iter().find(|row| row["file"] == name).unwrap()["bytes"].parse::<u64>().unwrap();
    assert_eq!(bytes("cells.csv"), out.join("map/cells.csv").metadata().unwrap().len());
    // The map has every cell.
    let table = fs::read_to_string(out.join("map/cells.csv")).unwrap();
    assert!(table.lines().count() == 1 + 50 * 40 && table.contains("periodic"), "{table}");
}
