//! Bifurcation diagrams: both ways, and one axis out of two.

use std::fs;
use std::path::Path;

use tempfile::TempDir;

use crate::common::{rattlemap, rows, says};

/// The fall of period 4 back to period 2.
const HYSTERESIS: &str =
    "parameters = { omega = 5.6 }\naxis = [{ parameter = 'e', min = 0.915, max = 0.935, count = 21 }]\n";

/// What a diagram's folder holds.
const DIAGRAM: [&str; 4] = ["bifurcation.csv", "bifurcation.png", "bifurcation_columns.csv", "manifest.json"];

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// The rows of `bifurcation_columns.csv` in a folder.
fn columns(folder: &Path) -> Vec<Vec<String>> {
    rows(&folder.join("bifurcation_columns.csv")).1
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn manifest(folder: &Path) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(folder.join("manifest.json")).unwrap()).unwrap()
}

/// Between 0.92 and 0.927 the attractor depends on the way that it is followed.
#[test]
fn both_ways_are_in_one_diagram_and_where_they_differ_is_told() {
    let folder = folder();
    fs::write(folder.path().join("h.toml"), HYSTERESIS).unwrap();
    let run = rattlemap(&folder).args(["bifurcation", "h.toml", "--set", "start.policy=both"]).assert();
    run.success().stderr(says(&[
        "42 of 42 columns",
        "up and down differ by class or period in ",
        " of 21 columns, at e = 0.92",
    ]));
    let out = folder.path().join("out/h");
    assert_eq!(names(&out), DIAGRAM);
    let both = columns(&out);
    assert_eq!(both.len(), 42);
    let mut differing = 0;
    for (policy, rows) in ["up", "down"].into_iter().zip(both.chunks(21)) {
        let set = format!("start.policy={policy}");
        rattlemap(&folder)
            .args(["bifurcation", "h.toml", "--quiet", "--out", policy, "--set", &set])
            .assert()
            .success();
        let alone = columns(&folder.path().join(policy));
        for (row, alone) in rows.iter().zip(&alone) {
            assert_eq!(row[1], policy);
            assert_eq!([&row[..1], &row[2..]].concat(), *alone, "the pass alone");
        }
        differing = alone.iter().zip(&both).filter(|(a, b)| a[1..3] != b[2..4]).count();
    }
    let manifest = manifest(&out);
    assert_eq!(manifest["start"]["policy"], "both");
    assert_eq!(manifest["hysteresis"]["differing"], differing);
    assert!(differing > 3, "{differing}");
    let points = fs::read_to_string(out.join("bifurcation.csv")).unwrap();
    assert!(points.starts_with("e,direction,class,"), "{}", points.lines().next().unwrap());
    assert!(points.contains(",up,") && points.contains(",down,"));
}

#[test]
fn a_map_does_not_go_both_ways_and_says_what_does() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/e_omega.toml");
    let run = rattlemap(&folder()).args(["map", scene, "--set", "start.policy=both"]).assert();
    run.code(2).stderr(says(&["`start.policy = both` does not fit: a map shows one", "`rattlemap compare`"]));
}

#[test]
fn one_axis_of_a_plane_at_exactly_a_value_of_the_other() {
    let folder = folder();
    let plane = "title = 'A plane'\n[[axis]]\nparameter = 'e'\nmin = 0.3\nmax = 0.5\ncount = 3\n\
                 [[axis]]\nparameter = 'omega'\nmin = 5.0\nmax = 6.0\ncount = 2\n[refine]\n\
                 [outputs]\nfiles = ['html', 'npy', 'csv']\n";
    let line = "parameters = { omega = 5.65 }\n[[axis]]\nparameter = 'e'\nmin = 0.3\nmax = 0.5\ncount = 3\n";
    fs::write(folder.path().join("plane.toml"), plane).unwrap();
    fs::write(folder.path().join("line.toml"), line).unwrap();
    let of_plane = ["bifurcation", "plane.toml", "--along", "e"];
    let run = rattlemap(&folder).args(["bifurcation", "plane.toml"]).assert();
    run.code(2).stderr(says(&["needs 1 axis", "--along e --at omega=VALUE"]));
    let run = rattlemap(&folder).args(of_plane).assert();
    run.code(2).stderr(says(&["--along e: `--at omega=VALUE` is missing"]));
    assert!(!folder.path().join("out").exists(), "an output folder was made");
    rattlemap(&folder).args(of_plane).args(["--at", "omega=5.65"]).assert().success();
    rattlemap(&folder).args(["bifurcation", "line.toml"]).assert().success();
    let [out, alone] = ["out/plane.e.omega=5.65", "out/line"].map(|name| folder.path().join(name));
    assert_eq!(names(&out), ["bifurcation.csv", "bifurcation_columns.csv", "manifest.json"]);
    assert_eq!(columns(&out), columns(&alone));
    let manifest = manifest(&out);
    assert_eq!((&manifest["along"], &manifest["at"]), (&"e".into(), &serde_json::json!(["omega=5.65"])));
    assert_eq!((&manifest["scene"], &manifest["parameters"]["omega"]), (&plane.into(), &5.65.into()));
    rattlemap(&folder).args(["bifurcation", "line.toml", "--at", "omega=5"]).assert().code(2);
}
