//! Axes of every kind, derived parameters and lists, as scripts meet them.

use super::*;

const COUPLED: &str = r#"[parameters]
e = 0.3

[derived]
k2 = "2/3*k1"

[[axis]]
parameter = "k1"
min = 10.0
max = 90.0
count = 4
scale = "log"

[[axis]]
parameter = "F"
values = [3.0, 12.5, 40.0]

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word"]
"#;

/// Cells 5, 11 and 0 of that map, and one that it does not have.
const LIST: &str = r#"[parameters]
e = 0.3

[derived]
k2 = "2/3*k1"

[cells]
file = "tables/points.csv"

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word"]
"#;

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn with(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), scene).unwrap();
    folder
}

/// A folder with the coupled map made, and a list of some of its cells beside it.
fn with_list() -> TempDir {
    let folder = with(COUPLED);
    map(&folder, &["--quiet"]).success();
    let grid = rows(&folder.path().join("out/s/cells.csv")).1;
    let line = |id: usize| format!("{},{}\n", grid[id][3], grid[id][2]);
    fs::create_dir(folder.path().join("tables")).unwrap();
    let table = format!("F,k1\n{}{}{}41,20\n", line(5), line(11), line(0));
    fs::write(folder.path().join("tables/points.csv"), table).unwrap();
    fs::write(folder.path().join("l.toml"), LIST).unwrap();
    folder
}

fn list(folder: &TempDir, arguments: &[&str]) -> assert_cmd::assert::Assert {
    command(folder, &[&["map", "l.toml", "--engine", "cpu"], arguments].concat()).assert()
}

#[test]
fn a_map_of_unequal_steps_says_how_its_cells_lie() {
    let folder = with(COUPLED);
    map(&folder, &["--quiet"]).success();
    let out = folder.path().join("out/s");
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(
        manifest["axes"],
        serde_json::json!([
            { "parameter": "k1", "min": 10.0, "max": 90.0, "count": 4, "scale": "log" },
            { "parameter": "F", "min": 3.0, "max": 40.0, "count": 3, "scale": "values", "values": [3.0, 12.5, 40.0] },
        ])
    );
    let k2 = &manifest["derived"]["k2"];
    assert_eq!((&k2["expression"], &k2["max"]), (&"2/3*k1".into(), &60.0.into()));
    assert!(
        manifest["parameters"].get("k2").is_none() && manifest["without_effect"] == serde_json::json!([])
    );
    let cells = rows(&out.join("cells.csv")).1;
    let forces: Vec<&str> = cells.iter().step_by(4).map(|row| row[3].as_str()).collect();
    assert_eq!((forces, &*cells[3][2]), (vec!["3.0", "12.5", "40.0"], "90.0"));
    // It can be gone on with, mended and judged.
    fs::remove_file(out.join("map.png")).unwrap();
    command(&folder, &["check", "out/s", "--repair", "--quiet"]).assert().success();
    assert!(out.join("map.png").is_file());
    map(&folder, &["--quiet", "--resume", "--set", "axis.0.scale=linear"])
        .code(2)
        .stderr(says(&["`axis.0.scale` was log, now absent"]));
    map(&folder, &["--quiet", "--resume", "--set", "derived.k2=0.5*k1"])
        .code(2)
        .stderr(says(&["`derived.k2` was 2/3*k1, now 0.5*k1"]));
}

#[test]
fn a_map_names_what_changed_nothing() {
    let folder = with(COUPLED);
    let few =
        ["--set", "axis.0.parameter=k", "--set", "axis.1.values=[1,3]", "--set", "derived.k2=20", "--json"];
    let run = map(&folder, &few).success();
    let summary: serde_json::Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(summary["without_effect"], serde_json::json!(["k", "F"]));
    run.stderr(says(&["k changed nothing that was measured: along it every cell is like the others"]));
    assert_eq!(json(&folder.path().join("out/s/manifest.json"))["without_effect"], summary["without_effect"]);
    // What was filled was not measured.
    let adaptive = [&few[..], &["--force", "--set", "refine.minimum_grid=1"]].concat();
    map(&folder, &adaptive)
        .success()
        .stderr(says(&["along it every cell that was integrated is like the others"]));
}

/// Along a logarithmic axis of the same scene, with what follows others; a value out of range is named by its column.
#[test]
fn a_line_of_such_a_plane_is_a_diagram() {
    let folder = with(COUPLED);
    let line = |more: &[&str]| {
        let line = ["bifurcation", "s.toml", "--along", "k1", "--at", "F=12.5", "--quiet"];
        command(&folder, &[&line[..], more].concat()).assert()
    };
    line(&["--set", "outputs.files=[\"csv\"]", "--out", "d"]).success();
    let manifest = json(&folder.path().join("d/manifest.json"));
    assert_eq!(
        manifest["axis"],
        serde_json::json!(
            { "parameter": "k1", "min": 10.0, "max": 90.0, "count": 4, "scale": "log" }
        )
    );
    assert_eq!(manifest["derived"]["k2"]["max"], 60.0);
    line(&["--set", "derived.k2=(k1-20)*(k1-50)", "--out", "x"]).code(2).stderr(says(&[
        "error: at k1 = ",
        ": `k2 = -",
        "is out of range: it must be finite and at least 0",
    ]));
    assert!(!folder.path().join("x").exists());
    let list = with_list();
    let list = command(&list, &["bifurcation", "l.toml", "--quiet"]).assert().code(2);
    list.stderr(says(&["l.toml:7:1: `cells = { ... }` does not fit: `bifurcation` needs an axis"]));
}

#[test]
fn a_list_gives_its_cells_in_its_order() {
    let folder = with_list();
    let dry = command(&folder, &["map", "l.toml", "--engine", "cpu", "--dry-run"]).assert().success();
    assert!(String::from_utf8_lossy(&dry.get_output().stdout).contains("cells    4\n"));
    list(&folder, &[])
        .success()
        .stderr(says(&["4 cells in ", "out/l: cells.csv, cells.npy, words.csv, list.csv"]));
    let out = folder.path().join("out/l");
    let (header, cells) = rows(&out.join("cells.csv"));
    assert!(header.starts_with("F,k1,class,period,"), "{header}");
    let grid = rows(&folder.path().join("out/s/cells.csv")).1;
    for (row, id) in [(0, 5), (1, 11), (2, 0)] {
        assert_eq!(cells[row][..2], [grid[id][3].clone(), grid[id][2].clone()]);
        assert_eq!(cells[row][2..], grid[id][4..], "{row}");
    }
    assert_eq!((cells.len(), &*cells[3][0], &*cells[3][1]), (4, "41.0", "20.0"));
    let npy = fs::read(out.join("cells.npy")).unwrap();
    let head = String::from_utf8_lossy(&npy[..200]);
    assert!(head.contains("[('F', '<f8'), ('k1', '<f8'), ('class', '|i1')"), "{head}");
    let manifest = json(&out.join("manifest.json"));
    assert_eq!((&manifest["axes"], &manifest["cells"]), (&serde_json::json!([]), &4.into()));
    assert_eq!(manifest["list"]["columns"], serde_json::json!(["F", "k1"]));
    assert_eq!((&manifest["list"]["file"], &manifest["list"]["cells"]), (&"list.csv".into(), &4.into()));
}

/// The folder has all that it needs, wherever the table has gone; another table is another map.
#[test]
fn the_folder_of_a_list_can_be_resumed_checked_and_judged() {
    let folder = with_list();
    list(&folder, &["--quiet"]).success();
    let out = folder.path().join("out/l");
    let good = fs::read(out.join("cells.csv")).unwrap();
    // Resumed from nothing but the records.
    for name in ["cells.csv", "cells.npy", "list.csv", "manifest.json"] {
        fs::remove_file(out.join(name)).unwrap();
    }
    let run = list(&folder, &["--resume", "--json"]).success();
    let summary: serde_json::Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(summary["resumed"]["runs"], 4);
    assert_eq!(fs::read(out.join("cells.csv")).unwrap(), good);
    let table = folder.path().join("tables/points.csv");
    let text = fs::read_to_string(&table).unwrap();
    fs::write(&table, text.replace("41,20", "41,21")).unwrap();
    list(&folder, &["--quiet", "--resume"]).code(2).stderr(says(&["`cells.hash` was"]));
    // The folder's own copy stands in for a table that is gone.
    fs::remove_file(&table).unwrap();
    list(&folder, &["--quiet", "--resume", "--format", "png"]).code(2).stderr(says(&["drop \"png\""]));
    list(&folder, &["--quiet", "--resume"]).success();
    assert_eq!(fs::read(out.join("cells.csv")).unwrap(), good);
    list(&folder, &["--quiet", "--force"]).code(2).stderr(says(&[
        "l.toml:8:8: `cells.file = \"tables/points.csv\"` cannot be read at tables/points.csv",
    ]));
    command(&folder, &["validate", "out/l", "--quiet"]).assert().success();
    let validation = json(&out.join("validation.json"));
    assert_eq!((&validation["cells"], &validation["faults"]), (&4.into(), &serde_json::json!([])));
    fs::remove_file(out.join("cells.csv")).unwrap();
    command(&folder, &["check", "out/l", "--repair", "--quiet"]).assert().success();
    assert_eq!(fs::read(out.join("cells.csv")).unwrap(), good);
    fs::write(out.join("list.csv"), "F,k1\n41,20\n").unwrap();
    command(&folder, &["validate", "out/l", "--quiet"])
        .assert()
        .code(2)
        .stderr(says(&["`cells.rows` was 4, now 1"]));
    command(&folder, &["check", "out/l", "--repair", "--quiet"]).assert().code(1).stderr(says(&[
        "list.csv is damaged",
        "with the scene's own table `rattlemap map SCENE --out out/l --resume`",
    ]));
}

/// A scene may name the copy itself: whoever is killed finds it again.
#[test]
fn the_list_of_a_run_under_way_is_in_its_folder() {
    let folder = with(COUPLED);
    let out = folder.path().join("out/l");
    fs::create_dir_all(&out).unwrap();
    let slow = "cells = { file = 'out/l/list.csv' }\n\
                integration = { transient_periods = 2_000_000, early_stop = false }\n";
    fs::write(folder.path().join("l.toml"), slow).unwrap();
    let table = "e,omega\n".to_owned() + &"0.6,5.6\n".repeat(40);
    fs::write(out.join("list.csv"), &table).unwrap();
    fs::write(out.join("cells.csv"), "of an earlier run").unwrap();
    let mut run = std::process::Command::new(assert_cmd::cargo::cargo_bin("rattlemap"))
        .current_dir(folder.path())
        .args(["map", "l.toml", "--engine", "cpu", "--quiet", "--force"])
        .spawn()
        .unwrap();
    let clock = std::time::Instant::now();
    while out.join("cells.csv").exists() {
        assert!(clock.elapsed().as_secs() < 20 && run.try_wait().unwrap().is_none(), "it did not begin");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    run.kill().unwrap();
    run.wait().unwrap();
    assert_eq!(fs::read_to_string(out.join("list.csv")).unwrap(), table);
    assert!(!out.join("manifest.json").exists());
}

/// A map over axes has no list: one that no map wrote is somebody's own.
#[test]
fn a_list_goes_with_its_map_alone() {
    let folder = with_list();
    let own = folder.path().join("out/s/list.csv");
    fs::write(&own, "mine").unwrap();
    map(&folder, &["--quiet", "--resume"]).success();
    map(&folder, &["--quiet", "--force"]).success();
    assert_eq!(fs::read_to_string(&own).unwrap(), "mine");
    list(&folder, &["--quiet"]).success();
    map(&folder, &["--quiet", "--force", "--out", "out/l"]).success();
    assert!(!folder.path().join("out/l/list.csv").exists());
}

#[test]
fn tables_that_cannot_be_read_whole_are_refused() {
    let folder = with_list();
    let large = fs::File::create(folder.path().join("large.csv")).unwrap();
    large.set_len(300_000_000).unwrap();
    let mut refused =
        vec![("large.csv", "(it has 300.0 MB, and at most 256.0 MB are read: list fewer cells)")];
    if cfg!(unix) {
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(pipe).status().unwrap().success());
        refused.extend([("pipe", "(it is no regular file)"), ("/dev/zero", "(it is no regular file)")]);
    }
    for (file, why) in refused {
        let said = format!("cannot be read at {file} {why}");
        list(&folder, &["--set", &format!("cells.file={file}")]).code(2).stderr(says(&[&said]));
    }
    large.set_len(1_100_000_000).unwrap();
    list(&folder, &["--quiet"]).success();
    fs::rename(folder.path().join("large.csv"), folder.path().join("out/l/list.csv")).unwrap();
    command(&folder, &["validate", "out/l", "--quiet"]).assert().code(2).stderr(says(&["it has 1.1 GB"]));
}
