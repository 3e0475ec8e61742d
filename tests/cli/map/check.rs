//! `rattlemap check`: what was damaged is named, and made anew where records allow.

use rattlemap::record::{Record, valid};
use rattlemap::store::inventory;
use rattlemap::store::record_file::{Identity, Order, RecordFile};

use super::*;

const FEW: [&str; 5] = ["--quiet", "--set", "axis.0.count=4", "--set", "axis.1.count=3"];

/// What stays, in an order, but for the manifest, in which times change.
fn contents(out: &Path) -> Vec<(String, Vec<u8>)> {
    let names = names(out).into_iter().filter(|name| name != "manifest.json");
    names.map(|name| (name.clone(), fs::read(out.join(name)).unwrap())).collect()
}

fn check(folder: &TempDir, arguments: &[&str]) -> assert_cmd::assert::Assert {
    command(folder, &[&["check"], arguments].concat()).assert()
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
        let run = check(folder, &[dir, "--quiet"]).code(1).stdout("");
        run.stderr(says(&[&format!("{dir}: {part}"), &format!("damaged or missing: {name}")]));
        assert_eq!(fs::read(&path).ok().as_deref(), bad, "{name} was touched");
    }
    fs::write(&path, good).unwrap();
}

#[test]
fn every_damaged_file_of_a_map_is_named_and_mended() {
    let folder = folder();
    map(&folder, &FEW).success();
    let out = folder.path().join("out/s");
    let good = contents(&out);
    check(&folder, &["out/s"]).success().stderr(says(&["out/s: all 11 files are as manifest.json says"]));
    for (name, bytes) in &good {
        is_named(&folder, "out/s", name);
        if name == "records.bin" {
            continue;
        }
        fs::write(out.join(name), &bytes[1..]).unwrap();
        check(&folder, &["out/s", "--repair"]).success().stderr(says(&[&format!("{name} is made anew")]));
        assert!(contents(&out) == good, "{name}");
        check(&folder, &["out/s", "--quiet"]).success().stderr("");
    }
    // What is nobody's is named and left alone.
    fs::write(out.join("notes.txt"), "precious").unwrap();
    for repair in [&[][..], &["--repair"]] {
        let run = check(&folder, &[&["out/s"], repair].concat()).success();
        run.stderr(says(&["notes.txt is unknown: manifest.json does not list it"]));
    }
    assert_eq!(fs::read_to_string(out.join("notes.txt")).unwrap(), "precious");
}

#[test]
fn records_are_mended_by_resuming_alone() {
    let folder = folder();
    map(&folder, &FEW).success();
    let out = folder.path().join("out/s");
    let good = contents(&out);
    let mut bad = fs::read(out.join("records.bin")).unwrap();
    let last = bad.len() - 1;
    bad[last] ^= 1;
    fs::write(out.join("records.bin"), &bad).unwrap();
    fs::remove_file(out.join("cells.csv")).unwrap();
    let run = check(&folder, &["out/s", "--repair"]).code(1);
    run.stderr(says(&[
        "cells.csv is missing",
        "records.bin is damaged or missing, and nothing can be made of it",
        "`rattlemap map SCENE --out out/s --set axis.0.count=4 --set axis.1.count=3 --resume`",
    ]));
    assert!(!out.join("cells.csv").exists() && fs::read(out.join("records.bin")).unwrap() == bad);
    map(&folder, &[&FEW[..], &["--out", "out/s", "--resume"]].concat()).success();
    assert!(contents(&out) == good);
    check(&folder, &["out/s", "--quiet"]).success();
}

#[cfg(target_os = "linux")]
#[test]
fn sha256sum_checks_the_hashes() {
    let folder = folder();
    map(&folder, &FEW).success();
    let out = folder.path().join("out/s");
    let text = fs::read_to_string(out.join("manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
    let line = |file: &serde_json::Value| {
        format!("{}  {}\n", file["sha256"].as_str().unwrap(), file["name"].as_str().unwrap())
    };
    let lines: String = manifest["files"].as_array().unwrap().iter().map(line).collect();
    assert!(lines.lines().count() == 11 && lines.contains("  records.bin\n"), "{lines}");
    fs::write(folder.path().join("sums"), lines).unwrap();
    let sums = Process::new("sha256sum").args(["-c", "../../sums"]).current_dir(&out).output().unwrap();
    assert!(sums.status.success(), "{sums:?}");
}

/// A validation lists what it writes, and its section of the report can be made again.
#[test]
fn a_validation_is_part_of_what_is_checked() {
    let folder = folder();
    map(&folder, &FEW).success();
    let validate = || command(&folder, &["validate", "out/s", "--samples", "4", "--quiet"]).assert();
    validate().success();
    check(&folder, &["out/s", "--quiet"]).success();
    let out = folder.path().join("out/s");
    let good = contents(&out);
    is_named(&folder, "out/s", "validation.json");
    fs::remove_file(out.join("report.html")).unwrap();
    check(&folder, &["out/s", "--repair", "--quiet"]).success();
    assert!(contents(&out) == good);
    fs::remove_file(out.join("validation.json")).unwrap();
    let run = check(&folder, &["out/s", "--repair"]).code(1);
    run.stderr(says(&["`rattlemap validate` makes validation.json and its section of the report anew"]));
    // Damage elsewhere is told of by a validation, which does not vouch for it.
    fs::write(out.join("cells.npy"), "").unwrap();
    validate().code(1).stderr(says(&["cells.npy is damaged: it has 0 bytes", "check out/s --repair"]));
    check(&folder, &["out/s", "--repair", "--quiet"]).success();
    assert!(contents(&out) == good);
}

#[test]
fn diagrams_and_orbits_are_checked_too() {
    let folder = folder();
    let line = "[[axis]]\nparameter = 'e'\nmin = 0.4\nmax = 0.5\ncount = 2\n";
    fs::write(folder.path().join("line.toml"), line).unwrap();
    command(&folder, &["bifurcation", "line.toml", "--out", "b", "--quiet"]).assert().success();
    command(&folder, &["orbit", "--out", "o"]).assert().success();
    for (dir, file) in
        [("b", "bifurcation.csv"), ("b", "bifurcation.png"), ("o", "orbit.json"), ("o", "gap.png")]
    {
        check(&folder, &[dir, "--quiet"]).success().stderr("");
        is_named(&folder, dir, file);
        let path = folder.path().join(dir).join(file);
        let good = fs::read(&path).unwrap();
        fs::remove_file(&path).unwrap();
        check(&folder, &[dir, "--repair"]).code(1).stderr(says(&[file, "again with --force"]));
        assert!(!path.exists());
        fs::write(path, good).unwrap();
    }
}

#[test]
fn manifests_that_cannot_be_believed_are_refused() {
    let folder = folder();
    map(&folder, &FEW).success();
    let path = folder.path().join("out/s/manifest.json");
    let good = fs::read_to_string(&path).unwrap();
    let with = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        fs::write(&path, good.replacen(from, to, 1)).unwrap();
    };
    with("{", "");
    check(&folder, &["out/s"]).code(1).stderr(says(&["manifest.json is damaged"]));
    with("\"format\": 2", "\"format\": 1");
    check(&folder, &["out/s"]).code(2).stderr(says(&["of format 1", "reads format 2", "--force"]));
    // A figure that nobody looks at.
    with("\"cells\": 12", "\"cells\": 13");
    for repair in [&[][..], &["--repair"]] {
        let run = check(&folder, &[&["out/s"], repair].concat()).code(1);
        run.stderr(says(&["manifest.json is damaged: its contents are not what they were"]));
    }
    let sealed = || {
        let manifest = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
        fs::write(&path, inventory::sealed(manifest).unwrap()).unwrap();
    };
    with("\"name\": \"cells.csv\"", "\"name\": \"../../s.toml\"");
    sealed();
    check(&folder, &["out/s"]).code(1).stderr(says(&["../../s.toml is damaged: this is no name of a file"]));
    // A map that no machine holds is refused before its memory is asked for.
    with("axis.0.count=4", "axis.0.count=60000");
    let count = fs::read_to_string(&path).unwrap().replace("axis.1.count=3", "axis.1.count=60000");
    fs::write(&path, count).unwrap();
    sealed();
    for arguments in [&["validate", "out/s"][..], &["check", "out/s", "--repair"]] {
        fs::remove_file(folder.path().join("out/s/map.png")).ok();
        let run = command(&folder, arguments).assert().code(2);
        run.stderr(says(&["60000 x 60000 = 3600000000 cells needs about", "use a machine that has as much"]));
    }
    fs::remove_file(&path).unwrap();
    check(&folder, &["out/s"]).code(2).stderr(says(&["the run is unfinished", "--resume"]));
    check(&folder, &["nowhere"]).code(2).stderr(says(&["there is no such folder"]));
}

/// Only integrated records are ever kept.
#[test]
fn records_that_no_run_makes_are_refused() {
    let folder = folder();
    map(&folder, &FEW).success();
    let path = folder.path().join("out/s/records.bin");
    let identity = Identity::read(&path).unwrap().unwrap();
    let mut cells = Vec::new();
    let take = |batch: &[(u32, Record)]| {
        cells.extend_from_slice(batch);
        true
    };
    RecordFile::read(&path, &identity, Order::Any, take).unwrap();
    let filled = |record: &mut Record| record.valid |= valid::FILLED;
    // A cycle that would take hours to integrate.
    let endless = |record: &mut Record| record.period = 4_000_000_000;
    for (spoil, why) in [
        (&filled as &dyn Fn(&mut Record), "a record that was filled, where only integrated ones are kept"),
        (&endless, "a batch of cells that nobody asked for"),
    ] {
        let mut cells = cells.clone();
        cells.iter_mut().for_each(|(_, record)| spoil(record));
        RecordFile::create(&path, &identity).unwrap().append(&cells).unwrap();
        let run = command(&folder, &["validate", "out/s", "--quiet"]).assert().code(1);
        run.stderr(says(&[why, "--force"]));
        map(&folder, &[&FEW[..], &["--resume"]].concat()).code(2).stderr(says(&[why, "--force"]));
    }
}
