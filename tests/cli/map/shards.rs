//! `map --shard` and `merge`: the same map as of one run, and what is refused.

use std::path::PathBuf;

use rattlemap::store::folder::Folder;
use rattlemap::store::inventory;
use rattlemap::store::merge::{MergeError, Parts};
use rattlemap::store::record_file::{Identity, RecordFile};

use super::*;

/// A map in so many shards, in folders `part-I`, and merged from the last to the first.
fn merged(folder: &TempDir, shards: u32, arguments: &[&str]) {
    for index in 1..=shards {
        let (shard, out) = (format!("{index}/{shards}"), format!("part-{index}"));
        map(folder, &[arguments, &["--quiet", "--shard", &shard, "--out", &out]].concat())
            .success()
            .stderr("");
    }
    let parts: Vec<String> = (1..=shards).rev().map(|index| format!("part-{index}")).collect();
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    command(folder, &[&["merge", "merged", "--quiet"], &parts[..]].concat()).assert().success().stderr("");
}

/// All of a manifest but commit, times, what was resumed, the records' hash, the adapter's number and the number of shards.
fn lasting(out: &Path) -> serde_json::Value {
    let mut manifest: serde_json::Value =
        serde_json::from_slice(&fs::read(out.join("manifest.json")).unwrap()).unwrap();
    let fields = manifest.as_object_mut().unwrap();
    for name in
        ["commit", "elapsed_seconds", "timings", "manifest_sha256", "resumed_cells", "adapter", "shards"]
    {
        assert!(fields.remove(name).is_some() || ["adapter", "shards"].contains(&name), "{name}");
    }
    for file in manifest["files"].as_array_mut().unwrap() {
        if file["name"] == "records.bin" {
            *file = "records.bin".into();
        }
    }
    manifest
}

/// What "the same map" means.
fn assert_same(whole: &Path, merged: &Path) {
    assert_eq!(names(whole), names(merged));
    for name in names(whole).iter().filter(|name| !["manifest.json", "records.bin"].contains(&name.as_str()))
    {
        assert!(fs::read(whole.join(name)).unwrap() == fs::read(merged.join(name)).unwrap(), "{name}");
    }
    let [a, b] = [whole, merged].map(lasting);
    let differing: Vec<&String> = a
        .as_object()
        .unwrap()
        .iter()
        .filter(|(name, value)| b[name.as_str()] != **value)
        .map(|(name, _)| name)
        .collect();
    assert!(a == b, "manifests differ in {differing:?}");
    let records = |out: &Path| {
        let (mut all, extent) = records::kept(&out.join("records.bin"));
        assert_eq!(extent.damage, None);
        all.sort_by_key(|&(id, _)| id);
        all
    };
    assert!(records(whole) == records(merged));
}

fn path(folder: &TempDir, name: &str) -> PathBuf {
    folder.path().join(name)
}

#[test]
fn shards_make_the_map_of_one_run() {
    let folder = folder();
    map(&folder, &["--quiet", "--out", "whole"]).success();
    merged(&folder, 3, &[]);
    assert_same(&path(&folder, "whole"), &path(&folder, "merged"));
    // It is as any other map to whoever comes after.
    command(&folder, &["check", "merged"]).assert().success();
    command(&folder, &["compare", "whole", "merged", "--fail", "--quiet"]).assert().success();
    command(&folder, &["validate", "merged", "--samples", "8", "--quiet"]).assert().success();
    map(&folder, &["--out", "merged", "--resume"])
        .success()
        .stderr(says(&["320 cells, 320 of them kept before"]));
    assert_same(&path(&folder, "whole"), &path(&folder, "merged"));
}

/// One shard is the whole, and each cell may be a shard of its own.
#[test]
fn any_number_of_shards_makes_the_same_map() {
    for shards in [1, 12] {
        let folder = folder();
        let few = ["--set", "axis.0.count=4", "--set", "axis.1.count=3", "--set", "outputs.files=[\"csv\"]"];
        map(&folder, &[&few[..], &["--quiet", "--out", "whole"]].concat()).success();
        merged(&folder, shards, &few);
        assert_same(&path(&folder, "whole"), &path(&folder, "merged"));
    }
}

#[test]
fn shards_of_lanes_make_the_map_of_one_run() {
    let folder = folder();
    let arguments = ["--engine", "gpu", "--set", "axis.0.count=9", "--set", "axis.1.count=7"];
    map(&folder, &[&arguments[..], &["--quiet", "--out", "whole"]].concat()).success();
    merged(&folder, 2, &[&arguments[..], &["--precision", "f32"]].concat());
    assert_same(&path(&folder, "whole"), &path(&folder, "merged"));
}

/// Rows that follow their neighbours, several starts, basins: what depends on other cells.
#[test]
fn cells_that_belong_together_stay_together() {
    let basin = "[parameters]\ne = 0.98\nomega = 9.2\n[[axis]]\nstart = 'x1'\nmin = -0.6\nmax = 0.4\ncount = 9\n\
                 [[axis]]\nstart = 'v1'\nmin = -2.0\nmax = 2.0\ncount = 7\n";
    let few = "[[axis]]\nparameter = 'omega'\nmin = 5.6\nmax = 5.61\ncount = 5\n\
               [[axis]]\nparameter = 'e'\nmin = 0.9\nmax = 0.94\ncount = 6\n\
               [outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word', 'pattern']\n";
    for (scene, sets) in [
        (few, &["--set", "start.policy=up"][..]),
        (few, &["--set", "start.policy=down"]),
        (few, &["--set", "start.count=3"]),
        (basin, &[]),
    ] {
        let folder = folder();
        fs::write(path(&folder, "s.toml"), scene).unwrap();
        map(&folder, &[sets, &["--quiet", "--out", "whole"]].concat()).success();
        merged(&folder, 2, sets);
        assert_same(&path(&folder, "whole"), &path(&folder, "merged"));
        // Rows are taken up again in the order of work.
        map(&folder, &[sets, &["--quiet", "--out", "merged", "--resume"]].concat()).success();
        assert_same(&path(&folder, "whole"), &path(&folder, "merged"));
    }
}

/// A shard's folder has what its scene names: the scene's own list and model are not looked for.
#[test]
fn shards_of_a_list_and_an_own_model_need_nothing_else() {
    let folder = folder();
    let model = rattlemap(&folder).args(["models", "impact-oscillator", "--file"]).output().unwrap().stdout;
    fs::write(path(&folder, "m.toml"), [b"# My own.\n", &model[..]].concat()).unwrap();
    fs::write(path(&folder, "s.toml"), "model = 'm.toml'\n[cells]\nfile = 'l.csv'\n").unwrap();
    let rows: String = (0..20).map(|n| format!("{}\n", 2.5 + 0.05 * f64::from(n))).collect();
    fs::write(path(&folder, "l.csv"), format!("omega\n{rows}")).unwrap();
    map(&folder, &["--quiet", "--out", "whole"]).success();
    for index in ["1", "2"] {
        map(&folder, &["--quiet", "--shard", &format!("{index}/2"), "--out", index]).success();
        let files = ["list.csv", "manifest.json", "model.toml", "records.bin"];
        assert_eq!(names(&path(&folder, index)), files);
    }
    for name in ["l.csv", "m.toml", "s.toml"] {
        fs::remove_file(path(&folder, name)).unwrap();
    }
    command(&folder, &["merge", "merged", "1", "2", "--quiet"]).assert().success();
    assert_same(&path(&folder, "whole"), &path(&folder, "merged"));
}

#[test]
fn what_no_shard_can_be_is_refused() {
    let folder = folder();
    let refused = |arguments: &[&str], parts: &[&str]| {
        let run = command(&folder, &[&["map", "s.toml"], arguments].concat()).assert();
        run.code(2).stdout("").stderr(says(parts));
        assert!(!path(&folder, "out").exists(), "{arguments:?}");
    };
    refused(&["--shard", "1/4"], &["--shard 1/4: --engine auto may choose otherwise", "--engine cpu"]);
    let cpu = |shard, parts: &[&str]| refused(&["--engine", "cpu", "--shard", shard], parts);
    cpu("0/4", &["'0/4'", "--shard <I/N>", "counted from 1", "1/4"]);
    cpu("5/4", &["'5/4'", "the last 4/4"]);
    cpu("3", &["'3'", "such as 3/16"]);
    cpu("1/321", &["--shard 1/321", "the map has only 320 cells", "at most 320 shards"]);
    let refined = ["--engine", "cpu", "--shard", "1/4", "--set", "refine.max_error=0.01"];
    refused(&refined, &["--shard 1/4: an adaptive map needs the records of all cells", "remove [refine]"]);
    let rows = ["--engine", "cpu", "--shard", "1/21", "--set", "start.policy=up"];
    refused(&rows, &["20 columns of cells that follow each other", "at most 20 shards"]);
}

#[test]
fn parts_that_make_no_map_are_refused_and_named() {
    let folder = folder();
    let few = ["--quiet", "--set", "axis.0.count=6", "--set", "axis.1.count=4"];
    let part = |out: &str, shard: &str, more: &[&str]| {
        map(&folder, &[&few[..], &["--out", out, "--shard", shard], more].concat()).success();
    };
    part("1", "1/3", &[]);
    part("2", "2/3", &[]);
    part("3", "3/3", &["--set", "title=It's another"]);
    let refused = |code: i32, parts: &[&str], says_so: &[&str]| {
        let run = command(&folder, &[&["merge", "new/map"], parts].concat()).assert();
        run.code(code).stdout("").stderr(says(says_so));
        assert!(!path(&folder, "new").exists(), "{parts:?}");
    };
    refused(
        2,
        &["1"],
        &[
            "2 of 3 shards are missing: 2/3 (`rattlemap map SCENE --engine cpu --shard 2/3 --set axis.0.count=6",
            "--set axis.1.count=4 --resume`), 3/3 (`",
        ],
    );
    refused(2, &["1", "2", "1"], &["1 and 1 are both shard 1/3; name one of them"]);
    fs::create_dir(path(&folder, "copy")).unwrap();
    for name in names(&path(&folder, "1")) {
        fs::copy(path(&folder, "1").join(&name), path(&folder, "copy").join(&name)).unwrap();
    }
    refused(2, &["1", "2", "copy"], &["1 and copy are both shard 1/3"]);
    refused(2, &["1", "2", "nowhere"], &["nowhere: there is no such folder"]);
    fs::create_dir(path(&folder, "empty")).unwrap();
    refused(2, &["1", "2", "empty"], &["empty: this is no shard of a map", "there is no records.bin"]);
    map(&folder, &[&few[..], &["--out", "whole"]].concat()).success();
    refused(2, &["1", "2", "whole"], &["whole: this is a whole map"]);
    part("of2", "1/2", &[]);
    refused(2, &["1", "2", "of2"], &["1 is shard 1/3, and of2 is shard 1/2"]);
    part("other", "3/3", &["--set", "F=51"]);
    refused(
        2,
        &["1", "2", "other"],
        &["1 and other are of two runs", "`parameters.F` is 50.0 in the first and 51.0 in the other"],
    );
    let run = command(&folder, &["merge", "./2", "1", "2", "3"]).assert();
    run.code(2).stderr(says(&["2: this is the folder of a shard; name another one"]));
    // Damaged: a byte of its records, then of its manifest.
    for name in ["records.bin", "manifest.json"] {
        let file = path(&folder, "copy").join(name);
        let good = fs::read(&file).unwrap();
        let mut bad = good.clone();
        let at = bad.len() - 40;
        bad[at] ^= 1;
        fs::write(&file, bad).unwrap();
        refused(
            1,
            &["copy", "2", "3"],
            &[
                "copy: ",
                "`rattlemap map SCENE --out copy --engine cpu --shard 1/3 --set axis.0.count=6",
                "--resume` keeps what is good",
            ],
        );
        fs::write(&file, good).unwrap();
    }
    // A part that was not finished: a manifest is written last.
    fs::remove_file(path(&folder, "copy").join("manifest.json")).unwrap();
    refused(
        2,
        &["copy", "2", "3"],
        &["shard 1/3 in copy is unfinished: 8 of 8 runs are there (`rattlemap map SCENE \
                                       --out copy --engine cpu --shard 1/3"],
    );
    fs::write(path(&folder, "copy/records.bin"), b"").unwrap();
    refused(
        2,
        &["copy", "2", "3"],
        &["1 of 3 shards is missing: 1/3", "copy is an unfinished run: 0 runs are there"],
    );
    // Titles may differ, and the first part's is taken; what is there already is kept without --force.
    command(&folder, &["merge", "whole", "3", "2", "1"]).assert().code(2).stderr(says(&["--force"]));
    command(&folder, &["merge", "whole", "3", "2", "1", "--force", "--quiet"]).assert().success();
    let manifest = fs::read_to_string(path(&folder, "whole/manifest.json")).unwrap();
    assert!(manifest.contains("\"title\": \"It's another\"") && manifest.contains("\"shards\": 3"));
}

/// Other commits, processors and numbers of cards make the same records; other deciding sources may not.
#[test]
fn what_decides_records_is_compared_and_nothing_else() {
    let folder = folder();
    let few = ["--quiet", "--set", "axis.0.count=6", "--set", "axis.1.count=4"];
    for shard in ["1/2", "2/2"] {
        map(&folder, &[&few[..], &["--shard", shard, "--out", &shard[..1]]].concat()).success();
    }
    let (manifest, records) = (path(&folder, "2/manifest.json"), path(&folder, "2/records.bin"));
    let tell = |fields: &[(&str, serde_json::Value)]| {
        let mut told: serde_json::Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
        fields.iter().for_each(|(name, value)| told[*name] = value.clone());
        fs::write(&manifest, inventory::sealed(told).unwrap()).unwrap();
    };
    tell(&[
        ("commit", "another".into()),
        ("processor", "Z80, 1 cores".into()),
        ("adapter", serde_json::json!({ "number": 3, "pci": null })),
    ]);
    let merge = || command(&folder, &["merge", "merged", "1", "2", "--force", "--quiet"]).assert();
    merge().success();
    let text = fs::read_to_string(path(&folder, "merged/manifest.json")).unwrap();
    assert!(text.contains("cores; Z80, 1 cores\","), "{text}");
    let (all, _) = records::kept(&records);
    let other = Identity::read(&records).unwrap().unwrap().built_from("0123", Identity::own_target());
    RecordFile::create(&records, &other).unwrap().append(&all).unwrap();
    merge().code(1).stderr(says(&["2: records.bin does not belong to the manifest.json beside it"]));
    tell(&[("sources", "0123".into())]);
    merge().code(2).stderr(says(&["1 and 2 are of two runs", "`sources` is ", "and 0123 in the other"]));
}

/// A map that is to be replaced stays as it is until all records are there.
#[test]
fn a_merge_that_fails_leaves_what_was_there() {
    let folder = folder();
    let few = ["--set", "axis.0.count=6", "--set", "axis.1.count=4"];
    map(&folder, &[&few[..], &["--out", "whole", "--quiet"]].concat()).success();
    merged(&folder, 2, &few);
    let whole = path(&folder, "whole");
    let all = || {
        names(&whole).into_iter().map(|name| (fs::read(whole.join(&name)).unwrap(), name)).collect::<Vec<_>>()
    };
    let before = all();
    // Whoever is told of progress may stop it.
    let parts = Parts::open(&["part-1", "part-2"].map(|part| path(&folder, part))).unwrap();
    let stopped = parts.gather(&Folder::open(&whole, true).unwrap(), |_| false);
    assert!(matches!(stopped, Err(MergeError::Stopped)), "{stopped:?}");
    assert!(all() == before);
    let file = path(&folder, "part-2/records.bin");
    let mut bad = fs::read(&file).unwrap();
    let at = bad.len() - 40;
    bad[at] ^= 1;
    fs::write(&file, bad).unwrap();
    let merge = ["merge", "whole", "part-1", "part-2", "--force"];
    command(&folder, &merge).assert().code(1).stderr(says(&["part-2: ", "0 of 12 runs are there"]));
    assert!(all() == before);
    map(&folder, &[&few[..], &["--shard", "2/2", "--out", "part-2", "--resume"]].concat()).success();
    command(&folder, &merge).assert().success();
}

/// An array job always asks to go on, and may run a task again.
#[test]
fn a_finished_shard_is_left_as_it_is() {
    let folder = folder();
    let go_on = ["--set", "axis.0.count=6", "--set", "axis.1.count=4", "--shard", "2/3", "--resume"];
    map(&folder, &go_on)
        .success()
        .stderr(says(&["nothing was kept there yet", "shard 2/3: 8 of 24 cells in "]));
    let out = path(&folder, "out/s.shard-2-of-3");
    let manifest = fs::read(out.join("manifest.json")).unwrap();
    let again = || map(&folder, &go_on);
    again().success().stderr("out/s.shard-2-of-3: shard 2/3 is finished: all 8 cells are there\n");
    assert!(fs::read(out.join("manifest.json")).unwrap() == manifest);
    // Another one is not taken for it.
    let other = [&go_on[..4], &["--shard", "1/3", "--out", "out/s.shard-2-of-3", "--resume"]].concat();
    map(&folder, &other).code(2).stderr(says(&["holds another run: `shard` was 2/3, now 1/3"]));
    let whole = [&go_on[..4], &["--out", "out/s.shard-2-of-3", "--resume"]].concat();
    map(&folder, &whole).code(2).stderr(says(&["`shard` was 2/3, now absent"]));
    // Damage is mended, and another title is written down.
    let mut bad = fs::read(out.join("records.bin")).unwrap();
    let at = bad.len() - 40;
    bad[at] ^= 1;
    fs::write(out.join("records.bin"), bad).unwrap();
    let of_shard = |command_line: &[&str], code: i32, parts: &[&str]| {
        command(&folder, command_line).assert().code(code).stdout("").stderr(says(parts));
    };
    let dir = "out/s.shard-2-of-3";
    of_shard(&["check", dir], 1, &["records.bin is damaged"]);
    of_shard(
        &["check", dir, "--repair"],
        1,
        &["nothing of shard 2/3 can be made of the rest", "--shard 2/3"],
    );
    again().success().stderr(says(&["0 cells are kept", "shard 2/3: 8 of 24 cells"]));
    of_shard(&["check", dir], 0, &["as manifest.json says"]);
    // So is damage that the manifest was written after.
    let records = fs::read(out.join("records.bin")).unwrap();
    fs::write(out.join("records.bin"), &records[..records.len() - 40]).unwrap();
    let entries = inventory::entries(&Folder::open(&out, true).unwrap(), &["records.bin"]).unwrap();
    let mut told: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    told["files"] = serde_json::to_value(entries).unwrap();
    fs::write(out.join("manifest.json"), inventory::sealed(told).unwrap()).unwrap();
    of_shard(&["check", dir], 0, &["as manifest.json says"]);
    again().success().stderr(says(&["0 cells are kept", "shard 2/3: 8 of 24 cells"]));
    again().success().stderr(says(&["shard 2/3 is finished"]));
    of_shard(&["validate", dir], 2, &["this is shard 2/3 of a map", "rattlemap merge"]);
    of_shard(&["compare", dir, dir], 2, &["this is shard 2/3 of a map", "rattlemap merge"]);
    map(&folder, &[&go_on[..], &["--set", "title=B", "--quiet"]].concat()).success();
    assert!(fs::read_to_string(out.join("manifest.json")).unwrap().contains("\"title\": \"B\""));
}

#[test]
fn shards_are_told_as_objects_and_foreseen() {
    let folder = folder();
    let few = ["--set", "axis.0.count=6", "--set", "axis.1.count=4", "--json", "--quiet"];
    let object = |arguments: &[&str]| {
        let run = command(&folder, arguments).assert().success();
        serde_json::from_slice::<serde_json::Value>(&run.get_output().stdout).unwrap()
    };
    let shard =
        |arguments: &[&str]| object(&[&["map", "s.toml", "--engine", "cpu"], &few[..], arguments].concat());
    let foreseen = shard(&["--shard", "1/2", "--dry-run"]);
    assert_eq!((&foreseen["cells"], &foreseen["runs"]), (&24.into(), &12.into()));
    assert_eq!(foreseen["shard"], serde_json::json!({ "index": 1, "count": 2 }));
    assert!(!path(&folder, "out").exists());
    let whole = shard(&["--out", "whole"]);
    let parts = ["1/2", "2/2"].map(|index| shard(&["--shard", index]));
    assert_eq!(parts[1]["shard"], serde_json::json!({ "index": 2, "count": 2 }));
    assert_eq!((&parts[1]["runs"], &parts[1]["cells"]), (&12.into(), &24.into()));
    for class in ["periodic", "chaotic", "undecided", "failed"] {
        let count = |object: &serde_json::Value| object["classes"][class].as_u64().unwrap();
        assert_eq!(count(&parts[0]) + count(&parts[1]), count(&whole), "{class}");
    }
    let merged =
        object(&["merge", "merged", "out/s.shard-1-of-2", "out/s.shard-2-of-2", "--json", "--quiet"]);
    assert_eq!((&merged["shards"], &merged["classes"]), (&2.into(), &whole["classes"]));
}

/// Its records are kept, and the command that goes on names the shard.
#[cfg(unix)]
#[test]
fn a_shard_that_is_stopped_is_gone_on_with() {
    let folder = folder();
    let slow = ["--set", "integration.early_stop=false", "--set", "integration.observed_periods=2000"];
    let shard = [&["map", "s.toml", "--engine", "cpu", "--shard", "1/2"], &slow[..]].concat();
    let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"))
        .current_dir(folder.path())
        .args(&shard)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let out = path(&folder, "out/s.shard-1-of-2");
    while !out.join("records.bin").exists() {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    Process::new("kill").args(["-TERM", &run.id().to_string()]).status().unwrap();
    let mut said = String::new();
    std::io::Read::read_to_string(run.stderr.as_mut().unwrap(), &mut said).unwrap();
    assert_eq!(run.wait().unwrap().code(), Some(143), "{said}");
    let go_on = "of 160 cells are kept; go on with: rattlemap map s.toml --engine cpu --shard 1/2 \
                 --set integration.early_stop=false --set integration.observed_periods=2000 --resume";
    assert!(said.trim_end().ends_with(go_on), "{said}");
    let merge = ["merge", "merged", "out/s.shard-1-of-2", "out/s.shard-2-of-2"];
    map(&folder, &[&slow[..], &["--shard", "2/2", "--quiet"]].concat()).success();
    command(&folder, &merge)
        .assert()
        .code(2)
        .stderr(says(&["shard 1/2 in out/s.shard-1-of-2 is unfinished", "of 160 runs"]));
    let check = command(&folder, &["check", "out/s.shard-1-of-2"]).assert();
    check.code(2).stderr(says(&[
        "shard 1/2 is unfinished: go on with `rattlemap map SCENE --engine E --shard 1/2 --resume`",
    ]));
    command(&folder, &[&shard[..], &["--resume", "--quiet"]].concat()).assert().success();
    command(&folder, &[&merge[..], &["--quiet"]].concat()).assert().success();
    map(&folder, &[&slow[..], &["--quiet", "--out", "whole"]].concat()).success();
    assert_same(&path(&folder, "whole"), &path(&folder, "merged"));
}
