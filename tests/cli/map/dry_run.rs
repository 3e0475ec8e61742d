//! `map --dry-run`: predicts memory, disk and time, and writes nothing.

use super::*;

fn predicted(folder: &TempDir, arguments: &str) -> serde_json::Value {
    printed(folder, &format!("map s.toml --engine cpu --dry-run --json {arguments}"))
}

#[test]
fn a_dry_run_predicts_and_writes_nothing() {
    let folder = folder();
    let object = predicted(&folder, "");
    let contract = "cells device disk_bytes engine folder is_upper_bound kept memory_bytes needs_resume_or_force precision \
                    runs sampled seconds shard why";
    assert_eq!(crate::common::keys(&object), contract);
    assert_eq!((&object["cells"], &object["runs"], &object["kept"]), (&320.into(), &320.into(), &0.into()));
    assert_eq!((&object["engine"], &object["is_upper_bound"]), (&"cpu".into(), &false.into()));
    let number = |path: &str| object.pointer(path).and_then(serde_json::Value::as_f64).expect(path);
    let [seconds, low, high] =
        ["integrate", "interval/0", "interval/1"].map(|at| number(&format!("/seconds/{at}")));
    assert!(0.0 < low && low <= seconds && seconds <= high, "{object}");
    assert!((1.0..=320.0).contains(&number("/sampled")), "{object}");
    assert!(number("/memory_bytes/host") < number("/memory_bytes/free"), "{object}");
    assert!(number("/disk_bytes/needed") < number("/disk_bytes/free"), "{object}");
    let text = map(&folder, "--dry-run --set refine.minimum_grid=4").success();
    let parts = [
        "cells    20 x 16 = 320\n",
        "model    pair, for up to",
        "time     at most about ",
        "nothing was written",
    ];
    text.stderr("").stdout(says(&parts));
    assert_eq!(names(folder.path()), ["s.toml"]);
}

#[test]
fn a_dry_run_refuses_what_a_run_refuses() {
    let folder = folder();
    let refused = |arguments: &str, parts: &[&str]| {
        fails(&folder, &format!("map s.toml --engine cpu --dry-run {arguments}"), 2, parts);
    };
    refused("--set axis.0.count=65000 --set axis.1.count=65000", &["GB of memory, and"]);
    refused("--out s.toml", &["there is a file of this name"]);
    map(&folder, &format!("{FEW} --quiet")).success();
    let before = names(&folder.path().join("out/s"));
    refused(&format!("{FEW} --resume --set k=900"), &["holds another run"]);
    map(&folder, &format!("{FEW} --quiet --dry-run --force")).success();
    let resumed = predicted(&folder, &format!("{FEW} --resume"));
    assert_eq!((&resumed["kept"], &resumed["seconds"]["integrate"]), (&12.into(), &0.0.into()));
    assert_eq!(resumed["needs_resume_or_force"], false);
    // A folder with files is no reason to refuse: nothing is written.
    assert_eq!(predicted(&folder, FEW)["needs_resume_or_force"], true);
    let text = map(&folder, &format!("{FEW} --dry-run")).success();
    text.stdout(says(&["folder   not empty: the run needs --resume or --force; nothing was written\n"]));
    assert_eq!(names(&folder.path().join("out/s")), before);
}

/// The warning comes before the work, which would take an hour and is ended.
#[test]
fn cells_that_take_long_cause_a_warning() {
    let folder = folder();
    let long = format!("s.toml {FEW} --set integration.confirm_chaos=100000000");
    for line in [format!("map {long} --engine cpu --dry-run"), format!("explore {long} --no-open")] {
        let run = command(&folder, &line).timeout(std::time::Duration::from_secs(5)).assert().failure();
        run.stderr(says(&[
            "warning: a cell can take about ",
            "100000528 forcing periods ([integration]) of ",
        ]));
    }
    map(&folder, &format!("{FEW} --dry-run --quiet")).success().stderr("");
}
