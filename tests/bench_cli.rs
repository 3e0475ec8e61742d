//! The instruments, in their tiny sizes: that they run, and what they write.

use std::fs;
use std::path::Path;

use assert_cmd::Command;

fn rattlemap(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("rattlemap").unwrap();
    command.current_dir(folder).env("NO_COLOR", "1");
    command
}

/// Rows of a table as maps from column to text.
fn rows(path: &Path) -> Vec<std::collections::HashMap<String, String>> {
    csv::Reader::from_path(path).unwrap().deserialize().collect::<Result<_, _>>().unwrap()
}

#[test]
fn work_precision_measures_every_method() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        rattlemap(folder.path()).args(["bench", "work-precision", "--quick"]).args(arguments).assert()
    };
    let output = run(&[]).success().get_output().clone();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    for part in ["lane-f32", "rk4-wgsl-f64", "dop853-core", "times less time than", "smallest error"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let out = folder.path().join("out/bench/work-precision");
    let points = rows(&out.join("work_precision.csv"));
    let methods =
        ["lane-f32", "lane-f64", "rk4-wgsl-f32", "rk4-wgsl-f64", "rk4-core", "euler-core", "dop853-core"];
    for method in methods {
        let own: Vec<_> = points.iter().filter(|row| row["method"] == method).collect();
        assert_eq!(own.len(), 2, "{method}");
        for row in own {
            let number = |name: &str| row[name].parse::<f64>().unwrap();
            assert!(number("seconds_per_lane_period") > 0.0, "{row:?}");
            assert!(number("state_error_median") > 0.0, "{row:?}");
            assert!(number("state_error_worst") >= number("state_error_median"), "{row:?}");
            assert!(number("fastest") <= number("slowest"), "{row:?}");
        }
    }
    let lane = points.iter().find(|row| row["method"] == "lane-f64").unwrap();
    assert!(lane["state_error_worst"].parse::<f64>().unwrap() < 1e-11, "{lane:?}");
    assert_eq!(points.iter().filter(|row| row["method"] == "reference").count(), 1);

    let json = |name: &str| -> serde_json::Value {
        serde_json::from_str(&fs::read_to_string(out.join(name)).unwrap()).unwrap()
    };
    let manifest = json("manifest.json");
    assert_eq!(manifest["quick"], true);
    for file in manifest["files"].as_array().unwrap() {
        assert!(fs::metadata(out.join(file.as_str().unwrap())).unwrap().len() > 100, "{file}");
    }
    let cells = json("cells.json");
    assert_eq!(cells.as_array().unwrap().len(), 5 * 8);
    assert_eq!(cells[0]["parameters"]["omega"], 5.6);

    // A table of points, such as this one, joins as peers.
    let peers = folder.path().join("peers.csv");
    let foreign =
        fs::read_to_string(out.join("work_precision.csv")).unwrap().replace("rk4-core", "rk4-numba");
    fs::write(&peers, foreign).unwrap();
    run(&["--methods", "reference", "--peers", "peers.csv", "--out", "joined", "--quiet"]).success();
    let joined = rows(&folder.path().join("joined/work_precision.csv"));
    assert_eq!(joined.iter().filter(|row| row["method"] == "rk4-numba").count(), 2);

    let refused = run(&["--methods", "rk5"]).code(2).get_output().clone();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("rk4-core"), "{refused:?}");
    fs::write(&peers, "not,a,table\n1,2,3\n").unwrap();
    let refused = run(&["--peers", "peers.csv", "--out", "elsewhere"]).code(2).get_output().clone();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("peers.csv"), "{refused:?}");
    assert!(!folder.path().join("elsewhere").exists(), "nothing was written");
}
