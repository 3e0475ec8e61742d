//! `rattlemap check`: damaged files are named, and repaired from the records.

use std::path::PathBuf;

use rattlemap::record::{Record, valid};
use rattlemap::store::inventory;
use rattlemap::store::record_file::{Identity, RecordFile};

use super::*;

/// Contents of the files in a folder whose manifest may contain other times.
fn files(out: &Path) -> Vec<(String, Vec<u8>)> {
    contents(out).into_iter().filter(|(name, _)| name != "manifest.json").collect()
}

/// A folder with a map of 12 cells in `out/s`.
fn mapped() -> (TempDir, PathBuf) {
    let folder = folder();
    map(&folder, &format!("{FEW} --quiet")).success();
    let out = folder.path().join("out/s");
    (folder, out)
}

/// Runs `check --quiet`, which must say nothing.
fn is_good(folder: &TempDir, dir: &str) {
    succeeds(folder, &format!("check {dir} --quiet")).stderr("");
}

/// Damages a file in each way, and expects each to be named.
fn is_named(folder: &TempDir, dir: &str, name: &str) {
    let path = folder.path().join(dir).join(name);
    let good = fs::read(&path).unwrap();
    let mut flipped = good.clone();
    flipped[good.len() / 2] ^= 1;
    let cut = &good[..good.len() - 1];
    let sizes = format!("{name} is damaged: it has {} bytes, and had {}", cut.len(), good.len());
    for (bad, part) in [
        (Some(&flipped[..]), format!("{name} is damaged: its contents are not what they were")),
        (Some(cut), sizes),
        (None, format!("{name} is missing")),
    ] {
        match bad {
            Some(bad) => fs::write(&path, bad).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        let parts = [&*format!("{dir}: {part}"), &format!("damaged or missing: {name}")];
        fails(folder, &format!("check {dir} --quiet"), 1, &parts);
        assert_eq!(fs::read(&path).ok().as_deref(), bad, "{name} was changed");
    }
    fs::write(&path, good).unwrap();
}

#[test]
fn every_damaged_file_of_a_map_is_named_and_repaired() {
    let (folder, out) = mapped();
    let good = files(&out);
    succeeds(&folder, "check out/s").stderr(says(&["out/s: all 11 files are as manifest.json says"]));
    for (name, bytes) in &good {
        is_named(&folder, "out/s", name);
        if name == "records.bin" {
            continue;
        }
        fs::write(out.join(name), &bytes[1..]).unwrap();
        succeeds(&folder, "check out/s --repair").stderr(says(&[&format!("{name} was recreated")]));
        assert!(files(&out) == good, "{name}");
        is_good(&folder, "out/s");
    }
    // An unknown file is named and not changed.
    fs::write(out.join("notes.txt"), "precious").unwrap();
    for line in ["check out/s", "check out/s --repair"] {
        let unknown = "notes.txt is unknown: manifest.json does not list it";
        succeeds(&folder, line).stderr(says(&[unknown]));
    }
    assert_eq!(fs::read_to_string(out.join("notes.txt")).unwrap(), "precious");
}

#[test]
fn damaged_records_are_repaired_by_resuming() {
    let (folder, out) = mapped();
    let (good, records) = (files(&out), out.join("records.bin"));
    damage(&records, 1);
    let bad = fs::read(&records).unwrap();
    fs::remove_file(out.join("cells.csv")).unwrap();
    let resume = format!("`rattlemap map SCENE --out out/s {FEW} --resume`");
    let nothing = "records.bin cannot be recreated from other files";
    fails(&folder, "check out/s --repair", 1, &["cells.csv is missing", nothing, &resume]);
    assert!(!out.join("cells.csv").exists() && fs::read(&records).unwrap() == bad);
    map(&folder, &format!("{FEW} --quiet --out out/s --resume")).success();
    assert!(files(&out) == good);
    is_good(&folder, "out/s");
}

#[cfg(target_os = "linux")]
#[test]
fn sha256sum_checks_the_hashes() {
    let (folder, out) = mapped();
    let manifest = json(&out.join("manifest.json"));
    let line = |file: &serde_json::Value| {
        format!("{}  {}\n", file["sha256"].as_str().unwrap(), file["name"].as_str().unwrap())
    };
    let lines: String = manifest["files"].as_array().unwrap().iter().map(line).collect();
    assert!(lines.lines().count() == 11 && lines.contains("  records.bin\n"), "{lines}");
    fs::write(folder.path().join("sums"), lines).unwrap();
    let sums = Process::new("sha256sum").args(["-c", "../../sums"]).current_dir(&out).output().unwrap();
    assert!(sums.status.success(), "{sums:?}");
}

/// The manifest lists the files of a validation, and its section of the report can be repaired.
#[test]
fn the_files_of_a_validation_are_checked() {
    let (folder, out) = mapped();
    let validate = "validate out/s --samples 4 --quiet";
    succeeds(&folder, validate);
    is_good(&folder, "out/s");
    let told = crate::common::run(&folder, "validate out/s --samples 4 --judge solver").success();
    told.stderr(crate::common::says(&["replaying 4 cells without early stops", "DOP853"]));
    let good = files(&out);
    is_named(&folder, "out/s", "validation.json");
    fs::remove_file(out.join("report.html")).unwrap();
    succeeds(&folder, "check out/s --repair --quiet");
    assert!(files(&out) == good);
    fs::remove_file(out.join("validation.json")).unwrap();
    let anew = "`rattlemap validate` recreates validation.json and its section of the report";
    fails(&folder, "check out/s --repair", 1, &[anew]);
    // A validation reports damage to other files.
    fs::write(out.join("cells.npy"), "").unwrap();
    fails(&folder, validate, 1, &["cells.npy is damaged: it has 0 bytes", "check out/s --repair"]);
    succeeds(&folder, "check out/s --repair --quiet");
    assert!(files(&out) == good);
}

#[test]
fn diagrams_and_orbits_are_checked_too() {
    let folder = folder();
    let line = "[[axis]]\nparameter = 'e'\nmin = 0.4\nmax = 0.5\ncount = 2\n";
    fs::write(folder.path().join("line.toml"), line).unwrap();
    succeeds(&folder, "bifurcation line.toml --out b --quiet");
    succeeds(&folder, "orbit --out o");
    for (dir, file) in
        [("b", "bifurcation.csv"), ("b", "bifurcation.png"), ("o", "orbit.json"), ("o", "gap.png")]
    {
        is_good(&folder, dir);
        is_named(&folder, dir, file);
        let path = folder.path().join(dir).join(file);
        let good = fs::read(&path).unwrap();
        fs::remove_file(&path).unwrap();
        fails(&folder, &format!("check {dir} --repair"), 1, &[file, "again with --force"]);
        assert!(!path.exists());
        fs::write(path, good).unwrap();
    }
}

#[test]
fn damaged_manifests_are_refused() {
    let (folder, out) = mapped();
    let path = out.join("manifest.json");
    let good = fs::read_to_string(&path).unwrap();
    let with = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        fs::write(&path, good.replacen(from, to, 1)).unwrap();
    };
    let check = |code, parts: &[&str]| fails(&folder, "check out/s", code, parts);
    with("{", "");
    check(1, &["manifest.json is damaged"]);
    with("\"format\": 2", "\"format\": 1");
    check(2, &["of format 1", "reads format 2", "--force"]);
    with("\"cells\": 12", "\"cells\": 13");
    let changed = "manifest.json is damaged: its contents are not what they were";
    check(1, &[changed]);
    fails(&folder, "check out/s --repair", 1, &[changed]);
    let sealed = || fs::write(&path, inventory::sealed(json(&path)).unwrap()).unwrap();
    with("\"name\": \"cells.csv\"", "\"name\": \"../../s.toml\"");
    sealed();
    check(1, &["../../s.toml is damaged: this is no name of a file"]);
    // A map that no machine can hold is refused before memory is allocated.
    with("axis.0.count=4", "axis.0.count=60000");
    let count = fs::read_to_string(&path).unwrap().replace("axis.1.count=3", "axis.1.count=60000");
    fs::write(&path, count).unwrap();
    sealed();
    for line in ["validate out/s", "check out/s --repair"] {
        fs::remove_file(out.join("map.png")).ok();
        let large = "60000 x 60000 = 3600000000 cells needs about";
        fails(&folder, line, 2, &[large, "use a larger machine"]);
    }
    fs::remove_file(&path).unwrap();
    check(2, &["the run is unfinished", "--resume"]);
    let written = "name a folder that `map`, `bifurcation`, `orbit`, `compare` or `bench` has written";
    fails(&folder, "check nowhere", 2, &["nowhere: there is no such folder; ", written]);
    fails(&folder, "check .", 2, &["there is no manifest.json; ", written]);
}

/// No run stores filled records, or periods that take hours to integrate.
#[test]
fn records_that_no_run_writes_are_refused() {
    let (folder, out) = mapped();
    let path = out.join("records.bin");
    let (cells, _) = records::stored(&path);
    let identity = Identity::read(&path).unwrap().unwrap();
    let filled = |record: &mut Record| record.valid |= valid::FILLED;
    let endless = |record: &mut Record| record.period = 4_000_000_000;
    for (change, why) in [
        (&filled as &dyn Fn(&mut Record), "it has a filled record, and only integrated records are stored"),
        (&endless, "it has records of cells that the run does not ask for"),
    ] {
        let mut cells = cells.clone();
        cells.iter_mut().for_each(|(_, record)| change(record));
        RecordFile::create(&path, &identity).unwrap().append(&cells).unwrap();
        fails(&folder, "validate out/s --quiet", 1, &[why, "--force"]);
        let resume = format!("map s.toml --engine cpu {FEW} --quiet --resume");
        fails(&folder, &resume, 2, &[why, "--force"]);
    }
}
