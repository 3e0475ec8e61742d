//! Tests of the instruments' commands at tiny sizes.

use std::collections::HashMap;
use std::fs;

use assert_cmd::Command;

pub(super) type Row = HashMap<String, String>;

pub(super) fn rows(path: &std::path::Path) -> Vec<Row> {
    csv::Reader::from_path(path).unwrap().deserialize().map(|row| row.unwrap()).collect()
}

#[test]
#[ignore = "takes half a minute; scripts/test.sh --all"]
fn work_precision_measures_every_method() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        Command::cargo_bin("rattlemap-bench")
            .unwrap()
            .current_dir(folder.path())
            .args(["work-precision", "--quick"])
            .args(arguments)
            .assert()
    };
    let output = run(&[]).success().get_output().clone();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    for part in ["lane-f32", "rk4-wgsl-f64", "dop853-core", "times less time than", "smallest error"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    let out = folder.path().join("out/bench/work-precision");
    let points = rows(&out.join("work_precision.csv"));
    let methods =
        "lane-f32 lane-f64 rk4-wgsl-f32 rk4-wgsl-f64 rk4-phased-f32 rk4-phased-f64 rk4-core dop853-core";
    for method in methods.split(' ') {
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
        assert!(fs::metadata(out.join(file["name"].as_str().unwrap())).unwrap().len() > 100, "{file}");
    }
    let cells = json("cells.json");
    assert_eq!(cells.as_array().unwrap().len(), 5 * 8);
    assert_eq!(cells[0]["parameters"]["omega"], 5.6);

    // A table of points, such as this one, can be read as peers.
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
