//! `map --dry-run`: what a map would take, and not a file more.

use super::*;

fn foreseen(folder: &TempDir, arguments: &[&str]) -> serde_json::Value {
    let run = map(folder, &[&["--dry-run", "--json"], arguments].concat()).success();
    serde_json::from_slice(&run.get_output().stdout).expect("one JSON object and nothing else")
}

#[test]
fn a_dry_run_tells_and_writes_nothing() {
    let folder = folder();
    let told = foreseen(&folder, &[]);
    let mut fields: Vec<&String> = told.as_object().unwrap().keys().collect();
    fields.sort();
    let contract = "cells device disk_bytes engine folder is_upper_bound kept memory_bytes precision runs sampled seconds shard why";
    assert_eq!(fields, contract.split(' ').collect::<Vec<_>>());
    assert_eq!((&told["cells"], &told["runs"], &told["kept"]), (&320.into(), &320.into(), &0.into()));
    assert_eq!((&told["engine"], &told["is_upper_bound"]), (&"cpu".into(), &false.into()));
    let number = |path: &str| told.pointer(path).and_then(serde_json::Value::as_f64).expect(path);
    let [seconds, low, high] =
        ["integrate", "interval/0", "interval/1"].map(|at| number(&format!("/seconds/{at}")));
    assert!(0.0 < low && low <= seconds && seconds <= high, "{told}");
    assert!((1.0..=320.0).contains(&number("/sampled")), "{told}");
    assert!(number("/memory_bytes/host") < number("/memory_bytes/free"), "{told}");
    assert!(number("/disk_bytes/needed") < number("/disk_bytes/free"), "{told}");
    let text = map(&folder, &["--dry-run", "--set", "refine.minimum_grid=4"]).success();
    text.stderr("").stdout(says(&[
        "cells    20 x 16 = 320\n",
        "time     at most about ",
        "nothing was written",
    ]));
    assert_eq!(names(folder.path()), ["s.toml"]);
}

#[test]
fn a_dry_run_refuses_what_a_run_refuses() {
    let folder = folder();
    let huge = ["--dry-run", "--set", "axis.0.count=65000", "--set", "axis.1.count=65000"];
    map(&folder, &huge).code(2).stdout("").stderr(says(&["GB of memory, and"]));
    map(&folder, &["--dry-run", "--out", "s.toml"]).code(2).stderr(says(&["there is a file of this name"]));
    let few = ["--quiet", "--set", "axis.0.count=4", "--set", "axis.1.count=3"];
    map(&folder, &few).success();
    let before = names(&folder.path().join("out/s"));
    let again = |more: &[&str]| map(&folder, &[&few[..], &["--dry-run"], more].concat());
    again(&[]).code(2).stdout("").stderr(says(&["out/s: the folder is not empty"]));
    again(&["--resume", "--set", "k=900"]).code(2).stderr(says(&["holds another run"]));
    again(&["--force"]).success();
    let kept = foreseen(&folder, &[&few[..], &["--resume"]].concat());
    assert_eq!((&kept["kept"], &kept["seconds"]["integrate"]), (&12.into(), &0.0.into()));
    assert_eq!(names(&folder.path().join("out/s")), before);
}
