//! Engines: the same files from each, and which one is taken.

use super::*;

#[test]
fn lanes_give_the_same_files_and_classes() {
    let folder = folder();
    map(&folder, &["--quiet", "--out", "cpu"]).success();
    let (header, expected) = rows(&folder.path().join("cpu/cells.csv"));
    for precision in ["f32", "f64"] {
        let out = folder.path().join(precision);
        let run = map(&folder, &["--engine", "gpu", "--precision", precision, "--out", precision]);
        run.success().stdout("").stderr(says(&[
            &format!("320 cells on gpu ({precision})"),
            "lane-periods/s",
            "ns per lane-step",
        ]));
        assert_eq!(names(&out), names(&folder.path().join("cpu")));
        let (lanes_header, lanes) = rows(&out.join("cells.csv"));
        assert_eq!(lanes_header, header);
        lanes.iter().enumerate().for_each(|(id, row)| check_row(id, row));
        // Class and period; the few that differ are explained elsewhere, cell by cell.
        let differing = lanes.iter().zip(&expected).filter(|(a, b)| a[4..6] != b[4..6]).count();
        assert!(differing <= 6, "{precision}: {differing} cells differ");
        let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
        let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
        assert_eq!(manifest["engine"], "gpu");
        assert_eq!(manifest["precision"], precision);
        let device = manifest["device"].as_str().unwrap();
        assert!(device.contains('(') && device.contains(';'), "no driver in {device}");
    }
    // Records of one precision are not continued in another.
    let run = map(&folder, &["--engine", "gpu", "--precision", "f64", "--out", "f32", "--resume"]);
    run.code(2).stderr(says(&["`precision` was f32, now f64", "--force"]));
    let run = map(&folder, &["--engine", "cpu", "--out", "f32", "--resume"]);
    run.code(2).stderr(says(&["`engine` was gpu, now cpu"]));
}

#[test]
fn engines_that_are_not_there_are_refused() {
    let folder = folder();
    let run = map(&folder, &["--engine", "cpu", "--precision", "f32"]);
    run.code(2).stdout("").stderr(says(&[
        "--precision f32",
        "the CPU engine computes in f64",
        "--engine gpu",
    ]));
    let run = map(&folder, &["--engine", "gpu", "--precision", "f16"]);
    run.code(2).stdout("").stderr(says(&["--precision", "it must be f32 or f64"]));
    for precision in ["f32", "f64"] {
        let mut run = command(&folder, &["map", "s.toml", "--engine", "gpu", "--precision", precision]);
        let run = run.env("WGPU_ADAPTER_NAME", "no such thing").assert();
        let list = "Found: ";
        run.code(2).stdout("").stderr(says(&["no graphics adapter called no such thing", "(f32", list]));
    }
}

#[test]
fn devices_says_what_there_is_and_what_auto_takes() {
    let folder = folder();
    let run = command(&folder, &["devices"]).assert().success();
    run.stdout(says(&[
        "cpu: event-driven reference",
        "gpu: ",
        "interface   ",
        "precision   f32",
        "batch       up to",
        "auto takes ",
    ]));
    let hardware = || says(&["a hardware GPU"]);
    let run = map(&folder, &["--engine", "auto", "--out", "few"]);
    run.success().stderr(says(&["cpu (f64): no hardware GPU, and soon done: "]).or(hardware()));
}
