//! Tests of `host-cost` with a tiny map.

use assert_cmd::Command;

use super::cli::{Row, rows};

#[test]
fn every_phase_of_a_map_has_its_cost() {
    for engine in [&[][..], &["--gpu"]] {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::cargo_bin("rattlemap-bench").unwrap();
        command.current_dir(folder.path()).args(["host-cost", "--quick", "--all"]).args(engine);
        let text = String::from_utf8(command.assert().success().get_output().stderr.clone()).unwrap();
        assert_eq!(text.contains(" submissions, "), !engine.is_empty(), "{text}");
        let phases = rows(&folder.path().join("out/bench/host-cost/host_cost.csv"));
        let names: Vec<&str> = phases.iter().map(|row| &*row["phase"]).collect();
        let number = |row: &Row, name: &str| row[name].parse::<f64>().unwrap();
        let phases_alone = ["plan", "open", "begin", "integrate", "survey", "write"];
        assert_eq!(names[..6], phases_alone);
        for row in &phases[..6] {
            let [wall, thread] = ["seconds", "thread_seconds"].map(|name| number(row, name));
            assert!(0.0 <= thread && thread <= 1.01 * wall + 0.1, "{row:?}");
        }
        // The processor's engine alone, and what is left for the host.
        let more: &[&str] = if engine.is_empty() { &["lanes", "host"] } else { &[] };
        assert_eq!(&names[6..], more);
        if let [lanes, host] = &phases[6..] {
            let sum: f64 = phases[..6].iter().map(|row| number(row, "seconds")).sum();
            assert!(number(lanes, "seconds") > 0.0);
            assert!((sum - number(lanes, "seconds") - number(host, "seconds")).abs() < 1e-9 * sum);
        }
    }
}
