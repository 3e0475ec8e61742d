//! `map --shard` and `merge`: shards give the map of one run, and other folders are refused.

use std::path::PathBuf;

use rattlemap::store::folder::Folder;
use rattlemap::store::inventory;
use rattlemap::store::merge::{MergeError, Parts};
use rattlemap::store::record_file::{Identity, RecordFile};
use serde_json::{Value, json};

use super::*;

/// Settings of a map of 24 cells.
const SMALL: &str = "--set axis.0.count=6 --set axis.1.count=4";

/// Computes a map in shards, in folders `part-I`, and merges them from the last to the first into `merged`.
fn merged(folder: &TempDir, shards: u32, sets: &str) {
    for index in 1..=shards {
        map(folder, &format!("{sets} --quiet --shard {index}/{shards} --out part-{index}"))
            .success()
            .stderr("");
    }
    let parts: String = (1..=shards).rev().map(|index| format!(" part-{index}")).collect();
    succeeds(folder, &format!("merge merged --quiet{parts}")).stderr("");
}

/// Fields of a manifest that do not depend on the commit, on times, on resuming, on the card's number and on the shards.
fn lasting(out: &Path) -> Value {
    let mut manifest = json(&out.join("manifest.json"));
    let fields = manifest.as_object_mut().unwrap();
    for name in words("commit elapsed_seconds timings manifest_sha256 resumed_cells adapter shards") {
        assert!(fields.remove(name).is_some() || ["adapter", "shards"].contains(&name), "{name}");
    }
    let files = manifest["files"].as_array_mut().unwrap().iter_mut();
    files.filter(|file| file["name"] == "records.bin").for_each(|file| *file = "records.bin".into());
    manifest
}

/// Compares the maps `whole` and `merged` as the contract defines "the same map".
fn assert_same(folder: &TempDir) {
    let [whole, merged] = [path(folder, "whole"), path(folder, "merged")];
    let files = |out: &Path| {
        let mut files = contents(out);
        files.retain(|(name, _)| !["manifest.json", "records.bin"].contains(&name.as_str()));
        files
    };
    assert_eq!(names(&whole), names(&merged));
    for (a, b) in files(&whole).iter().zip(&files(&merged)) {
        assert!(a == b, "{}", a.0);
    }
    let [a, b] = [&whole, &merged].map(|out| lasting(out));
    let fields = a.as_object().unwrap().iter();
    let differing: Vec<_> = fields.filter(|(name, value)| b[name.as_str()] != **value).collect();
    assert!(a == b, "manifests differ in {differing:?}");
    let records = |out: &Path| {
        let (mut all, extent) = records::stored(&out.join("records.bin"));
        assert_eq!(extent.damage, None);
        all.sort_by_key(|&(id, _)| id);
        all
    };
    assert!(records(&whole) == records(&merged));
}

fn path(folder: &TempDir, name: &str) -> PathBuf {
    folder.path().join(name)
}

#[test]
fn shards_make_the_map_of_one_run() {
    let folder = folder();
    map(&folder, "--quiet --out whole").success();
    merged(&folder, 3, "");
    assert_same(&folder);
    // Other commands take it as any map.
    succeeds(&folder, "check merged");
    succeeds(&folder, "compare whole merged --fail --quiet");
    map(&folder, "--out merged --resume").success().stderr(says(&["320 cells, all by earlier runs"]));
    assert_same(&folder);
    succeeds(&folder, "validate merged --samples 8 --quiet");
}

/// One shard is the whole map, and each cell can be a shard.
#[test]
fn any_number_of_shards_makes_the_same_map() {
    for shards in [1, 12] {
        let folder = folder();
        let few = format!("{FEW} --set outputs.files=[\"csv\"]");
        map(&folder, &format!("{few} --quiet --out whole")).success();
        merged(&folder, shards, &few);
        assert_same(&folder);
    }
}

/// Rows that follow their neighbours, several starts, basins.
#[test]
fn cells_that_depend_on_each_other_stay_together() {
    let basin = "[parameters]\ne = 0.98\nomega = 9.2\n[[axis]]\nstart = 'x1'\nmin = -0.6\nmax = 0.4\ncount = 9\n\
                 [[axis]]\nstart = 'v1'\nmin = -2.0\nmax = 2.0\ncount = 7\n";
    let few = "[[axis]]\nparameter = 'omega'\nmin = 5.6\nmax = 5.61\ncount = 5\n\
               [[axis]]\nparameter = 'e'\nmin = 0.9\nmax = 0.94\ncount = 6\n\
               [outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word', 'pattern']\n";
    for (scene, sets) in [
        (few, "--set start.policy=up"),
        (few, "--set start.policy=down"),
        (few, "--set start.count=3"),
        (basin, ""),
    ] {
        let folder = with(scene);
        map(&folder, &format!("{sets} --quiet --out whole")).success();
        merged(&folder, 2, sets);
        assert_same(&folder);
        // Stored rows are in the order of work, so that the map can resume.
        map(&folder, &format!("{sets} --quiet --out merged --resume")).success();
        assert_same(&folder);
    }
}

/// The scene's own files are not needed.
#[test]
fn folders_of_shards_contain_the_list_and_the_model() {
    let folder = with("model = 'm.toml'\n[cells]\nfile = 'l.csv'\n");
    let model = succeeds(&folder, "models impact-oscillator --file").get_output().stdout.clone();
    fs::write(path(&folder, "m.toml"), [b"# My own.\n", &model[..]].concat()).unwrap();
    let rows: String = (0..20).map(|n| format!("{}\n", 2.5 + 0.05 * f64::from(n))).collect();
    fs::write(path(&folder, "l.csv"), format!("omega\n{rows}")).unwrap();
    map(&folder, "--quiet --out whole").success();
    for index in ["1", "2"] {
        map(&folder, &format!("--quiet --shard {index}/2 --out {index}")).success();
        let files = ["list.csv", "manifest.json", "model.toml", "records.bin"];
        assert_eq!(names(&path(&folder, index)), files);
    }
    for name in ["l.csv", "m.toml", "s.toml"] {
        fs::remove_file(path(&folder, name)).unwrap();
    }
    succeeds(&folder, "merge merged 1 2 --quiet");
    assert_same(&folder);
}

#[test]
fn impossible_shards_are_refused() {
    let folder = folder();
    let refused = |arguments: &str, parts: &[&str]| {
        fails(&folder, &format!("map s.toml {arguments}"), 2, parts);
        assert!(!path(&folder, "out").exists(), "{arguments}");
    };
    refused("--shard 1/4", &["--shard 1/4: --engine auto may choose different engines", "--engine cpu"]);
    let cpu = |shard, parts: &[&str]| refused(&format!("--engine cpu --shard {shard}"), parts);
    cpu("0/4", &["'0/4'", "--shard <I/N>", "counted from 1", "1/4"]);
    cpu("5/4", &["'5/4'", "the last 4/4"]);
    cpu("3", &["'3'", "such as 3/16"]);
    cpu("1/321", &["--shard 1/321", "the map has only 320 cells", "at most 320 shards"]);
    cpu(
        "1/4 --set refine.max_error=0.01",
        &["--shard 1/4: an adaptive map needs the records of all cells", "remove [refine]"],
    );
    cpu("1/21 --set start.policy=up", &["20 columns of cells that follow each other", "at most 20 shards"]);
}

#[test]
fn parts_that_make_no_map_are_refused_and_named() {
    let folder = folder();
    let part = |out: &str, shard: &str| {
        map(&folder, &format!("{SMALL} --quiet --out {out} --shard {shard}")).success();
    };
    part("1", "1/3");
    part("2", "2/3");
    part("3", "3/3 --set title=Another");
    let refused = |code: i32, parts: &str, says_so: &[&str]| {
        fails(&folder, &format!("merge new/map {parts}"), code, says_so);
        assert!(!path(&folder, "new").exists(), "{parts}");
    };
    let command = |shard| format!("rattlemap map SCENE --engine cpu --shard {shard} {SMALL} --resume");
    let missing = format!("2 of 3 shards are missing: 2/3 (`{}`), 3/3 (`", command("2/3"));
    refused(2, "1", &[&missing]);
    refused(2, "2 3", &[&format!("1 of 3 shards is missing: 1/3 (`{}`)", command("1/3"))]);
    refused(2, "1 2 1", &["1 and 1 are both shard 1/3; name one of them"]);
    fs::create_dir(path(&folder, "copy")).unwrap();
    for (name, bytes) in contents(&path(&folder, "1")) {
        fs::write(path(&folder, "copy").join(name), bytes).unwrap();
    }
    refused(2, "1 2 copy", &["1 and copy are both shard 1/3"]);
    refused(2, "1 2 nowhere", &["nowhere: there is no such folder"]);
    fs::create_dir(path(&folder, "empty")).unwrap();
    refused(2, "1 2 empty", &["empty: this is not the folder of a shard", "--shard I/N"]);
    map(&folder, &format!("{SMALL} --quiet --out whole")).success();
    refused(2, "1 2 whole", &["whole: this is a whole map"]);
    part("of2", "1/2");
    refused(2, "1 2 of2", &["1 is shard 1/3, and of2 is shard 1/2"]);
    part("other", "3/3 --set F=51");
    let two_runs =
        ["1 and other are of two runs", "`parameters.F` is 50.0 in the first and 51.0 in the other"];
    refused(2, "1 2 other", &two_runs);
    fails(&folder, "merge ./2 1 2 3", 2, &["2: this is the folder of a shard; name another one"]);
    // A byte of the records is damaged, then one of the manifest.
    let command = format!("`rattlemap map SCENE --out copy --engine cpu --shard 1/3 {SMALL} --resume`");
    for name in ["records.bin", "manifest.json"] {
        let file = path(&folder, "copy").join(name);
        damage(&file, 40);
        refused(1, "copy 2 3", &["copy: ", &format!("{command} keeps what is good")]);
        damage(&file, 40);
    }
    // The manifest is written last: a part without one is unfinished.
    fs::remove_file(path(&folder, "copy/manifest.json")).unwrap();
    let resume = "`rattlemap map SCENE --out copy --engine cpu --shard 1/3 --resume`";
    refused(
        2,
        "copy 2 3",
        &[&format!("copy: there is no manifest.json; shard 1/3 is unfinished: resume it with {resume}")],
    );
    fs::write(path(&folder, "copy/records.bin"), b"").unwrap();
    refused(2, "copy 2 3", &["copy: there is no manifest.json; the run is unfinished"]);
    // Titles may differ; that of the first part is taken. A map in the folder is replaced only with --force.
    fails(&folder, "merge whole 3 2 1", 2, &["--force"]);
    succeeds(&folder, "merge whole 3 2 1 --force --quiet");
    let manifest = json(&path(&folder, "whole/manifest.json"));
    assert_eq!((&manifest["title"], &manifest["shards"]), (&"Another".into(), &3.into()));
}

/// Commit, processor and card's number may differ; the deciding sources may not.
#[test]
fn merging_compares_what_decides_records() {
    let folder = folder();
    for shard in ["1", "2"] {
        map(&folder, &format!("{SMALL} --quiet --shard {shard}/2 --out {shard}")).success();
    }
    let (manifest, records) = (path(&folder, "2/manifest.json"), path(&folder, "2/records.bin"));
    let change = |fields: Value| {
        let mut changed = json(&manifest);
        let fields = fields.as_object().unwrap().iter();
        fields.for_each(|(name, value)| changed[name] = value.clone());
        fs::write(&manifest, inventory::sealed(changed).unwrap()).unwrap();
    };
    let adapter = json!({ "number": 3, "pci": null });
    change(json!({ "commit": "another", "processor": "Z80, 1 cores", "adapter": adapter }));
    let merge = "merge merged 1 2 --force --quiet";
    succeeds(&folder, merge);
    let text = json(&path(&folder, "merged/manifest.json"))["processor"].to_string();
    assert!(text.contains("cores; Z80, 1 cores\""), "{text}");
    let (all, _) = records::stored(&records);
    let other = Identity::read(&records).unwrap().unwrap().built_from("0123", Identity::own_target());
    RecordFile::create(&records, &other).unwrap().append(&all).unwrap();
    fails(&folder, merge, 1, &["2: records.bin does not belong to the manifest in its folder"]);
    change(json!({ "sources": "0123" }));
    fails(&folder, merge, 2, &["1 and 2 are of two runs", "`sources` is ", "and 0123 in the other"]);
}

#[test]
fn a_failed_merge_changes_nothing() {
    let folder = folder();
    map(&folder, &format!("{SMALL} --out whole --quiet")).success();
    merged(&folder, 2, SMALL);
    let whole = path(&folder, "whole");
    let before = contents(&whole);
    // The caller can stop a merge.
    let parts = Parts::open(&["part-1", "part-2"].map(|part| path(&folder, part))).unwrap();
    let stopped = parts.gather(&Folder::open(&whole, true).unwrap(), |_| false);
    assert!(matches!(stopped, Err(MergeError::Stopped)), "{stopped:?}");
    assert!(contents(&whole) == before);
    damage(&path(&folder, "part-2/records.bin"), 40);
    let merge = "merge whole part-1 part-2 --force";
    fails(&folder, merge, 1, &["part-2: ", "0 of 12 runs are there"]);
    assert!(contents(&whole) == before);
    map(&folder, &format!("{SMALL} --shard 2/2 --out part-2 --resume")).success();
    succeeds(&folder, merge);
}

/// An array job always gives --resume, and may run a task again.
#[test]
fn resuming_a_finished_shard_changes_nothing() {
    let folder = folder();
    let resume = format!("{SMALL} --shard 2/3 --resume");
    let again = |parts: &[&str]| map(&folder, &resume).success().stderr(says(parts));
    again(&["the folder has no records", "shard 2/3: 8 of 24 cells in "]);
    let dir = "out/s.shard-2-of-3";
    let out = path(&folder, dir);
    let (file, records) = (out.join("manifest.json"), out.join("records.bin"));
    let manifest = fs::read(&file).unwrap();
    again(&[]).stderr("out/s.shard-2-of-3: shard 2/3 is finished: all 8 cells are there\n");
    assert!(fs::read(&file).unwrap() == manifest);
    // Another shard, or the whole map, is another run.
    let other = |shard: &str, part: &str| {
        fails(&folder, &format!("map s.toml --engine cpu {SMALL}{shard} --out {dir} --resume"), 2, &[part]);
    };
    other(" --shard 1/3", "holds another run: `shard` was 2/3, now 1/3");
    other("", "`shard` was 2/3, now absent");
    // Resuming repairs damage.
    damage(&records, 40);
    let check = format!("check {dir}");
    fails(&folder, &check, 1, &["records.bin is damaged"]);
    let repair = ["no file of shard 2/3 can be recreated from the others", "--shard 2/3"];
    fails(&folder, &format!("{check} --repair"), 1, &repair);
    again(&["0 cells are kept", "shard 2/3: 8 of 24 cells"]);
    succeeds(&folder, &check).stderr(says(&["as manifest.json says"]));
    // So does it if the manifest lists the damaged file.
    let bytes = fs::read(&records).unwrap();
    fs::write(&records, &bytes[..bytes.len() - 40]).unwrap();
    let entries = inventory::entries(&Folder::open(&out, true).unwrap(), &["records.bin"]).unwrap();
    let mut changed: Value = serde_json::from_slice(&manifest).unwrap();
    changed["files"] = serde_json::to_value(entries).unwrap();
    fs::write(&file, inventory::sealed(changed).unwrap()).unwrap();
    succeeds(&folder, &check).stderr(says(&["as manifest.json says"]));
    again(&["0 cells are kept", "shard 2/3: 8 of 24 cells"]);
    again(&["shard 2/3 is finished"]);
    for line in [format!("validate {dir}"), format!("compare {dir} {dir}")] {
        fails(&folder, &line, 2, &["this is shard 2/3 of a map", "rattlemap merge"]);
    }
    // Another title is written to the manifest.
    map(&folder, &format!("{resume} --set title=B --quiet")).success();
    assert_eq!(json(&file)["title"], "B");
}

#[test]
fn shards_print_objects_and_predictions() {
    let folder = folder();
    let shard =
        |more: &str| printed(&folder, &format!("map s.toml --engine cpu {SMALL} --json --quiet {more}"));
    let predicted = shard("--shard 1/2 --dry-run");
    assert_eq!((&predicted["cells"], &predicted["runs"]), (&24.into(), &12.into()));
    assert_eq!(predicted["shard"], json!({ "index": 1, "count": 2 }));
    assert!(!path(&folder, "out").exists());
    let whole = shard("--out whole");
    let parts = ["1/2", "2/2"].map(|index| shard(&format!("--shard {index}")));
    assert_eq!(parts[1]["shard"], json!({ "index": 2, "count": 2 }));
    assert_eq!((&parts[1]["runs"], &parts[1]["cells"]), (&12.into(), &24.into()));
    for class in ["periodic", "chaotic", "undecided", "failed"] {
        let count = |object: &Value| object["classes"][class].as_u64().unwrap();
        assert_eq!(count(&parts[0]) + count(&parts[1]), count(&whole), "{class}");
    }
    let merged = printed(&folder, "merge merged out/s.shard-1-of-2 out/s.shard-2-of-2 --json --quiet");
    assert_eq!((&merged["shards"], &merged["classes"]), (&2.into(), &whole["classes"]));
}

#[cfg(unix)]
#[test]
fn an_interrupted_shard_can_resume() {
    let folder = folder();
    let slow = "--set integration.early_stop=false --set integration.observed_periods=2000";
    let shard = format!("map s.toml --engine cpu --shard 1/2 {slow}");
    let run = begin(&folder, &shard);
    wait_until(|| path(&folder, "out/s.shard-1-of-2/records.bin").exists());
    let (code, text) = stop(run, "-TERM");
    assert_eq!(code, Some(143), "{text}");
    let resume = format!("of 160 cells are kept; go on with: rattlemap {shard} --resume");
    assert!(text.trim_end().ends_with(&resume), "{text}");
    let merge = "merge merged out/s.shard-1-of-2 out/s.shard-2-of-2";
    map(&folder, &format!("{slow} --shard 2/2 --quiet")).success();
    let resume = "shard 1/2 is unfinished: resume it with `rattlemap map SCENE --out out/s.shard-1-of-2 --engine cpu \
                  --shard 1/2 --resume`";
    fails(&folder, merge, 2, &[resume]);
    fails(&folder, "check out/s.shard-1-of-2", 2, &[resume]);
    succeeds(&folder, &format!("{shard} --resume --quiet"));
    succeeds(&folder, &format!("{merge} --quiet"));
    map(&folder, &format!("{slow} --quiet --out whole")).success();
    assert_same(&folder);
}
