//! `rattlemap bench engines` at tiny sizes. It needs a graphics adapter, which `scripts/test.sh` installs.

use std::collections::HashMap;
use std::fs;

use assert_cmd::Command;

type Row = HashMap<String, String>;

fn rows(path: &std::path::Path) -> Vec<Row> {
    csv::Reader::from_path(path).unwrap().deserialize().map(|row| row.unwrap()).collect()
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn every_engine_is_measured_and_agrees() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::cargo_bin("rattlemap").unwrap();
        command.current_dir(folder.path()).args(["bench", "engines", "--quick"]).args(arguments).assert()
    };
    let said = run(&[]).success().stdout("").get_output().stderr.clone();
    let said = String::from_utf8(said).unwrap();
    assert!(said.contains("largest map on each engine") && said.contains(" 0 unexplained"), "{said}");
    let out = folder.path().join("out/bench/engines");
    let mut names: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["engines.csv", "engines.png", "manifest.json"]);

    let table = rows(&out.join("engines.csv"));
    let number = |row: &Row, name: &str| row[name].parse::<f64>().unwrap_or(f64::NAN);
    for (engine, precision) in [("cpu", "f64"), ("gpu", "f32"), ("gpu", "f64")] {
        let of = |row: &&Row| row["engine"] == engine && row["precision"] == precision;
        let sizes: Vec<&str> = table.iter().filter(of).map(|row| row["lanes"].as_str()).take(2).collect();
        assert_eq!(sizes, ["36", "81"], "{engine} {precision}");
    }
    for row in &table {
        let classes: f64 =
            ["periodic", "chaotic", "undecided", "failed"].map(|name| number(row, name)).iter().sum();
        assert_eq!(classes, number(row, "lanes"), "{row:?}");
        let [low, median, high] = ["lane_periods_per_s_low", "lane_periods_per_s", "lane_periods_per_s_high"]
            .map(|name| number(row, name));
        assert!(0.0 < low && low <= median && median <= high, "{row:?}");
        let is_gpu = row["engine"] == "gpu";
        assert!(number(row, "integrate_s") > 0.0, "{row:?}");
        // No class differs on so few cells; the first series is what others are compared with.
        assert!(row["cells_differing"].is_empty() || row["cells_differing"] == "0", "{row:?}");
        assert!(is_gpu || row["device_share"].is_empty(), "the processor has no device clock: {row:?}");
        if !row["device_share"].is_empty() {
            assert!((0.01..1.01).contains(&number(row, "device_share")), "{row:?}");
            let [busy, dispatch, idle, gap] =
                ["device_s", "longest_dispatch_s", "idle_s", "longest_gap_s"].map(|name| number(row, name));
            // Medians of few runs each: a dispatch is a part of what the device does, a gap of its idle time.
            assert!(0.0 < dispatch && dispatch < 1.5 * busy, "{row:?}");
            assert!(0.0 <= gap && gap <= 1.5 * idle + 1e-9, "{row:?}");
        }
    }
    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(manifest["command"], "bench engines");
    let series = manifest["series"].as_array().unwrap();
    assert!(series.iter().filter(|series| series["check"]["faults"] == serde_json::json!([])).count() >= 3);
    let picture = image::open(out.join("engines.png")).unwrap().to_rgb8();
    let colors: std::collections::HashSet<_> = picture.pixels().collect();
    assert!(picture.width() == 1700 && colors.len() > 30);
    run(&[]).code(2);
}
