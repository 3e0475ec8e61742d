//! Maps of the shares of attractors.

use super::*;
use crate::common::{names, run, with_scene};

const SCENE: &str = "
[[axis]]
parameter = 'e'
min = 0.7
max = 0.9
count = 4
[[axis]]
parameter = 'omega'
min = 8.0
max = 10.0
count = 4
[start]
sample = 'box'
low = [-0.4, -3, 0, -3]
high = [0.4, 3, 0, 3]
count = 72
[outputs]
quantities = ['class', 'impact_energy']
files = ['csv', 'png']
";

const TABLES: [&str; 3] = ["shares.csv", "share_cells.csv", "share_attractors.csv"];

#[test]
fn shares_are_the_same_for_any_threads_and_after_an_interruption() {
    let folder = with_scene(SCENE);
    let dir = folder.path();
    run(&folder, "map s.toml --engine cpu --out whole").success().stderr(says(&[
        "16 cells, 1152 starts in ",
        "cells have several attractors",
        "% of all starts: period 1, word 36",
    ]));
    assert_eq!(names(&dir.join("whole")).iter().filter(|name| name.ends_with(".csv")).count(), TABLES.len());
    rattlemap(&folder)
        .env("RAYON_NUM_THREADS", "1")
        .args(["map", "s.toml", "--engine", "cpu", "--out", "one", "--quiet"])
        .assert()
        .success();
    // A run that was killed has some of the cells, and a part of a line.
    let done = fs::read_to_string(dir.join("whole/shares.jsonl")).unwrap();
    let some: Vec<&str> = done.lines().take(6).collect();
    fs::create_dir(dir.join("rest")).unwrap();
    fs::write(dir.join("rest/shares.jsonl"), format!("{}\n{{\"cell\":", some.join("\n"))).unwrap();
    run(&folder, "map s.toml --engine cpu --out rest --resume --quiet").success();
    for other in ["one", "rest"] {
        for name in TABLES {
            let [a, b] = ["whole", other].map(|out| fs::read_to_string(dir.join(out).join(name)).unwrap());
            assert!(a == b, "{other}/{name}");
        }
    }
    fails(&folder, "map s.toml --engine cpu --out rest --resume --set start.count=64", 1, &["another map"]);
}

#[test]
fn bad_samples_are_refused_before_work_starts() {
    let folder = with_scene(SCENE);
    for (set, part) in [
        ("start.count=0", "from 8 to 10000"),
        ("start.count=100", "use a multiple of 8, such as 104"),
        ("start.high=[-1,3,0,3]", "x1 must be at least -0.4"),
        ("start.high=[0.9,3,0,3]", "behind its wall at 0.5"),
        ("start.width=1.5", "between 0 and 1"),
        ("start.policy=rest", "start.sample gives all starts"),
        ("start.mean=[0,0,0,0]", "start.low and start.high"),
    ] {
        fails(&folder, &format!("map s.toml --set {set}"), 2, &[part]);
    }
    assert!(!folder.path().join("out").exists());
    fails(&folder, "map s.toml --shard 1/2 --engine cpu", 2, &["--shard"]);
    fails(&folder, "explore s.toml", 2, &["start.sample"]);
}
