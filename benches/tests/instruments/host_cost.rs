//! Tests of `host-cost` with a tiny map.

use assert_cmd::Command;

use super::cli::rows;

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
        assert_eq!(names, ["plan", "open", "begin", "integrate", "survey", "write"]);
        for row in &phases {
            let [wall, thread] = ["seconds", "thread_seconds"].map(|name| row[name].parse::<f64>().unwrap());
            assert!(0.0 <= thread && thread <= 1.01 * wall + 0.1, "{row:?}");
        }
    }
}

#[test]
fn scaling_is_measured_and_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::cargo_bin("rattlemap-bench").unwrap();
    command.current_dir(folder.path()).args(["host-cost", "--quick", "--scaling"]).assert().success();
    let maps = rows(&folder.path().join("out/bench/host-cost/scaling.csv"));
    assert_eq!(maps.iter().map(|row| &*row["map"]).collect::<Vec<_>>(), ["cheap", "expensive"]);
    for row in &maps {
        let [one, serial, busy, simulated] =
            ["one", "serial", "busy", "simulated"].map(|name| row[name].parse::<f64>().unwrap());
        assert!(0.0 < simulated && serial <= one && 0.0 < busy && busy <= 1.0, "{row:?}");
    }
}
