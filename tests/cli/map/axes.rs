//! Axes of every kind, derived parameters and lists of cells.

use super::*;

const COUPLED: &str = r#"axis = [
    { parameter = "k1", min = 10.0, max = 90.0, count = 4, scale = "log" },
    { parameter = "F", values = [3.0, 12.5, 40.0] },
]
[parameters]
e = 0.3

[derived]
k2 = "2/3*k1"

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word"]
"#;

/// A list of cells 5, 11 and 0 of that map and of another cell.
const LIST: &str = r#"[parameters]
e = 0.3

[derived]
k2 = "2/3*k1"

[cells]
file = "tables/points.csv"

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word"]
"#;

/// A folder with the map of `COUPLED`, and a list of some of its cells.
fn with_list() -> TempDir {
    let folder = with(COUPLED);
    map(&folder, "--quiet").success();
    let grid = rows(&folder.path().join("out/s/cells.csv")).1;
    let line = |id: usize| format!("{},{}\n", grid[id][3], grid[id][2]);
    fs::create_dir(folder.path().join("tables")).unwrap();
    let table = format!("F,k1\n{}{}{}41,20\n", line(5), line(11), line(0));
    fs::write(folder.path().join("tables/points.csv"), table).unwrap();
    fs::write(folder.path().join("l.toml"), LIST).unwrap();
    folder
}

/// Runs the map of the list.
fn list(folder: &TempDir, arguments: &str) -> assert_cmd::assert::Assert {
    command(folder, &format!("map l.toml --engine cpu {arguments}")).assert()
}

#[test]
fn logarithmic_axes_listed_values_and_derived_parameters_are_in_the_files() {
    let folder = with(COUPLED);
    map(&folder, "--quiet").success();
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
    fs::remove_file(out.join("map.png")).unwrap();
    succeeds(&folder, "check out/s --repair --quiet");
    assert!(out.join("map.png").is_file());
    let other = |set: &str, part: &str| {
        fails(&folder, &format!("map s.toml --engine cpu --quiet --resume --set {set}"), 2, &[part]);
    };
    other("axis.0.scale=linear", "`axis.0.scale` was log, now absent");
    other("derived.k2=0.5*k1", "`derived.k2` was 2/3*k1, now 0.5*k1");
}

#[test]
fn a_map_names_parameters_without_effect() {
    let folder = with(COUPLED);
    let idle = "--set axis.0.parameter=k --set axis.1.values=[1,3] --set derived.k2=20 --json";
    let run = map(&folder, idle).success();
    let summary: serde_json::Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(summary["without_effect"], serde_json::json!(["k", "F"]));
    run.stderr(says(&["k has no effect: along this axis every cell has the same result"]));
    assert_eq!(json(&folder.path().join("out/s/manifest.json"))["without_effect"], summary["without_effect"]);
    // In an adaptive map only integrated cells are compared.
    let run = map(&folder, &format!("{idle} --force --set refine.minimum_grid=1")).success();
    run.stderr(says(&["along this axis every integrated cell has the same result"]));
}

/// The line follows a logarithmic axis, and derived parameters vary along it.
#[test]
fn a_line_through_a_plane_is_a_diagram() {
    let folder = with(COUPLED);
    let line = "bifurcation s.toml --along k1 --at F=12.5 --quiet";
    succeeds(&folder, &format!("{line} --set outputs.files=[\"csv\"] --out d"));
    let manifest = json(&folder.path().join("d/manifest.json"));
    let axis = serde_json::json!({ "parameter": "k1", "min": 10.0, "max": 90.0, "count": 4, "scale": "log" });
    assert_eq!((&manifest["axis"], &manifest["derived"]["k2"]["max"]), (&axis, &60.0.into()));
    let parts = ["error: at k1 = ", ": `k2 = -", "is out of range: it must be finite and at least 0"];
    fails(&folder, &format!("{line} --set derived.k2=(k1-20)*(k1-50) --out x"), 2, &parts);
    assert!(!folder.path().join("x").exists());
    let list = "l.toml:7:1: `cells = { ... }` does not fit: `bifurcation` needs an axis";
    fails(&with_list(), "bifurcation l.toml --quiet", 2, &[list]);
}

#[test]
fn a_list_gives_its_cells_in_its_order() {
    let folder = with_list();
    succeeds(&folder, "map l.toml --engine cpu --dry-run").stdout(says(&["cells    4\n"]));
    let run = list(&folder, "").success();
    run.stderr(says(&["4 cells in ", "out/l: cells.csv, cells.npy, words.csv, list.csv"]));
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

/// The folder has a copy of the list; another list is another map.
#[test]
fn the_folder_of_a_list_can_be_resumed_checked_and_validated() {
    let folder = with_list();
    list(&folder, "--quiet").success();
    let out = folder.path().join("out/l");
    let cells = || fs::read(out.join("cells.csv")).unwrap();
    let good = cells();
    // The records are enough to resume.
    for name in ["cells.csv", "cells.npy", "list.csv", "manifest.json"] {
        fs::remove_file(out.join(name)).unwrap();
    }
    let summary = printed(&folder, "map l.toml --engine cpu --resume --json");
    assert_eq!(summary["resumed"]["runs"], 4);
    assert!(cells() == good);
    let table = folder.path().join("tables/points.csv");
    let text = fs::read_to_string(&table).unwrap();
    fs::write(&table, text.replace("41,20", "41,21")).unwrap();
    let refused = |arguments: &str, part: &str| {
        fails(&folder, &format!("map l.toml --engine cpu --quiet {arguments}"), 2, &[part]);
    };
    refused("--resume", "`cells.hash` was");
    // Without the table the folder's copy is used.
    fs::remove_file(&table).unwrap();
    refused("--resume --format png", "remove \"png\"");
    list(&folder, "--quiet --resume").success();
    assert!(cells() == good);
    let table = "l.toml:8:8: `cells.file = \"tables/points.csv\"` cannot be read at tables/points.csv";
    refused("--force", table);
    succeeds(&folder, "validate out/l --quiet");
    let validation = json(&out.join("validation.json"));
    assert_eq!((&validation["cells"], &validation["faults"]), (&4.into(), &serde_json::json!([])));
    fs::remove_file(out.join("cells.csv")).unwrap();
    succeeds(&folder, "check out/l --repair --quiet");
    assert!(cells() == good);
    fs::write(out.join("list.csv"), "F,k1\n41,20\n").unwrap();
    fails(&folder, "validate out/l --quiet", 2, &["`cells.rows` was 4, now 1"]);
    let again = "`rattlemap map SCENE --out out/l --resume` recreates every file from the scene's own table";
    fails(&folder, "check out/l --repair --quiet", 1, &["list.csv is damaged", again]);
}

/// The scene may name the copy in the folder. It survives a kill.
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
    let mut run = begin(&folder, "map l.toml --engine cpu --quiet --force");
    wait_until(|| !out.join("cells.csv").exists());
    run.kill().unwrap();
    run.wait().unwrap();
    assert_eq!(fs::read_to_string(out.join("list.csv")).unwrap(), table);
    assert!(!out.join("manifest.json").exists());
}

/// A list that no map wrote is the user's own.
#[test]
fn only_lists_in_the_manifest_are_removed() {
    let folder = with_list();
    let own = folder.path().join("out/s/list.csv");
    fs::write(&own, "mine").unwrap();
    map(&folder, "--quiet --resume").success();
    map(&folder, "--quiet --force").success();
    assert_eq!(fs::read_to_string(&own).unwrap(), "mine");
    list(&folder, "--quiet").success();
    map(&folder, "--quiet --force --out out/l").success();
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
        assert!(Process::new("mkfifo").arg(pipe).status().unwrap().success());
        refused.extend([("pipe", "(it is no regular file)"), ("/dev/zero", "(it is no regular file)")]);
    }
    for (file, why) in refused {
        let text = format!("cannot be read at {file} {why}");
        fails(&folder, &format!("map l.toml --engine cpu --set cells.file={file}"), 2, &[&text]);
    }
    large.set_len(1_100_000_000).unwrap();
    list(&folder, "--quiet").success();
    fs::rename(folder.path().join("large.csv"), folder.path().join("out/l/list.csv")).unwrap();
    fails(&folder, "validate out/l --quiet", 2, &["it has 1.1 GB"]);
}
