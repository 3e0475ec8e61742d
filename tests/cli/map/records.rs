//! `records.bin`: torn, damaged and foreign ones, and what is kept of them.

use rattlemap::record::Record;
use rattlemap::store::record_file::{Extent, Identity, Order, RecordFile};

use super::*;

/// Every file of `SAME` in a folder.
pub(super) fn bytes(out: &Path) -> Vec<Vec<u8>> {
    SAME.iter().map(|name| fs::read(out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))).collect()
}

/// All that a file holds, in the order in which it was kept.
pub(super) fn kept(path: &Path) -> (Vec<(u32, Record)>, Extent) {
    let identity = Identity::read(path).unwrap().unwrap();
    let mut all = Vec::new();
    let take = |batch: &[(u32, Record)]| {
        all.extend_from_slice(batch);
        true
    };
    let extent = RecordFile::read(path, &identity, Order::Any, take).unwrap();
    (all, extent)
}

/// Cuts the one batch of a short run's record file into five, as a longer run would have left them.
fn cut_into_batches(path: &Path) {
    let identity = Identity::read(path).unwrap().unwrap();
    let (all, _) = kept(path);
    let mut file = RecordFile::create(path, &identity).unwrap();
    all.chunks(all.len().div_ceil(5)).for_each(|batch| file.append(batch).unwrap());
}

/// Where batches begin, and where the last one ends.
fn ends(records: &[u8]) -> Vec<usize> {
    let u32_at = |at: usize| u32::from_le_bytes(records[at..at + 4].try_into().unwrap()) as usize;
    let mut ends = vec![2 * (16 + u32_at(8))];
    while ends.last().is_some_and(|&end| end < records.len()) {
        let at = ends[ends.len() - 1];
        ends.push(at + 32 + u32_at(at + 20));
    }
    ends
}

#[test]
fn torn_files_are_resumed_to_the_same_bytes() {
    let folder = folder();
    map(&folder, &["--quiet", "--out", "whole"]).success();
    let whole = folder.path().join("whole");
    cut_into_batches(&whole.join("records.bin"));
    let (expected, records) = (bytes(&whole), fs::read(whole.join("records.bin")).unwrap());
    let cut = folder.path().join("cut");
    fs::create_dir(&cut).unwrap();
    // From inside the last batch back to the header's end.
    let head = ends(&records)[0];
    for length in [records.len() - 1, records.len() / 2, head + 100, head + 3, head] {
        fs::write(cut.join("records.bin"), &records[..length]).unwrap();
        map(&folder, &["--quiet", "--out", "cut", "--resume"]).success();
        assert!(bytes(&cut) == expected, "cut to {length} of {} bytes", records.len());
    }
    // A finished run only writes its files again.
    fs::remove_file(cut.join("map.png")).unwrap();
    map(&folder, &["--out", "cut", "--resume"])
        .success()
        .stderr(says(&["320 cells, 320 of them kept before, in "]));
    assert!(bytes(&cut) == expected);
}

#[test]
fn records_of_another_run_are_refused() {
    let folder = folder();
    let few = ["--quiet", "--set", "axis.0.count=4", "--set", "axis.1.count=3"];
    map(&folder, &few).success();
    let records = folder.path().join("out/s/records.bin");
    let before = fs::read(&records).unwrap();
    let cases: [(&[&str], &[&str]); 3] = [
        (&["--set", "axis.0.max=0.9"], &["`axis.0.max` was 1.0, now 0.9"]),
        (
            &["--set", "F=51", "--set", "start.policy=state", "--set", "start.state=[0,0,0,1]"],
            &["`parameters.F` was 50.0, now 51.0", "`start` was rest, now state [0.0, 0.0, 0.0, 1.0]"],
        ),
        (&["--set", "outputs.quantities=[\"class\"]"], &["`outputs.quantities` was [class, lyapunov,"]),
    ];
    for (sets, parts) in cases {
        let run = map(&folder, &[&few[..], sets, &["--resume"]].concat());
        run.code(2).stdout("").stderr(says(parts).and(says(&["out/s/records.bin", "--force"])));
    }
    let other_version = String::from_utf8_lossy(&before).contains(env!("CARGO_PKG_VERSION"));
    assert!(other_version && fs::read(&records).unwrap() == before, "the records were touched");
    // Nor are those of a program of other deciding sources, or for another processor.
    let own = Identity::read(&records).unwrap().unwrap();
    for (identity, part) in [
        (own.clone().built_from("0123", Identity::own_target()), "`sources` was 0123, now "),
        (own.built_from(Identity::own_sources(), "z80"), "`target` was z80, now "),
    ] {
        RecordFile::create(&records, &identity).unwrap();
        map(&folder, &[&few[..], &["--resume"]].concat()).code(2).stderr(says(&[part, "--force"]));
    }
    fs::write(&records, before).unwrap();
    // Title and kinds of file may change.
    map(&folder, &[&few[..], &["--set", "title=Other", "--resume"]].concat()).success();
}

/// A damaged batch costs its own cells, and a torn end what was not kept yet.
#[test]
fn good_batches_beside_damage_are_kept() {
    let folder = folder();
    map(&folder, &["--quiet", "--out", "whole"]).success();
    let whole = folder.path().join("whole");
    cut_into_batches(&whole.join("records.bin"));
    let (expected, records) = (bytes(&whole), fs::read(whole.join("records.bin")).unwrap());
    let ends = ends(&records);
    assert_eq!((ends.len(), ends[5]), (6, records.len()));
    let flipped = |at: usize| {
        let mut bad = records.clone();
        bad[at] ^= 0x10;
        bad
    };
    let noise: Vec<u8> = (0..1000u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let with_tail = |batches: usize, tail: &[u8]| [&records[..ends[batches]], tail].concat();
    let cut = folder.path().join("cut");
    fs::create_dir(&cut).unwrap();
    let cases = [
        (with_tail(3, &[0; 1000]), 3, 3, "1000 bytes from"),
        (with_tail(3, &noise), 3, 3, "1000 bytes from"),
        (with_tail(5, &[0; 7]), 5, 5, "7 bytes from"),
        (with_tail(2, &records[ends[2]..ends[3] - 1]), 2, 2, "a batch is cut short"),
        (with_tail(2, &records[ends[1]..]), 2, 5, "a batch is out of place"),
        (flipped(ends[0] + 200), 0, 4, "a batch does not match its checksum"),
        (flipped(ends[3]), 3, 4, "the head of a batch is damaged"),
        (flipped(ends[4] + 11), 4, 4, "the head of a batch is damaged"),
    ];
    for (bad, first, batches, part) in cases {
        fs::write(cut.join("records.bin"), bad).unwrap();
        let (at, left) =
            (format!("from byte {} on", ends[first]), format!("{} cells are kept", 64 * batches));
        let run = map(&folder, &["--out", "cut", "--resume"]).success();
        run.stderr(says(&["warning: cut/records.bin", part, &at, &left]));
        assert!(bytes(&cut) == expected, "{part}, {batches} batches");
        let (cells, extent) = kept(&cut.join("records.bin"));
        assert_eq!((cells.len(), extent.damage), (320, None), "{part}");
    }
}

/// Where rows follow each other nothing behind damage can be taken up.
#[test]
fn what_depends_on_lost_records_is_computed_again() {
    let folder = folder();
    let up = ["--set", "start.policy=up", "--set", "axis.1.count=5"];
    map(&folder, &[&up[..], &["--quiet", "--out", "whole"]].concat()).success();
    let path = folder.path().join("whole/records.bin");
    cut_into_batches(&path);
    let (expected, mut records) = (bytes(&folder.path().join("whole")), fs::read(&path).unwrap());
    let (ends, (cells, _)) = (ends(&records), kept(&path));
    records[ends[2] + 50] ^= 1;
    fs::write(&path, records).unwrap();
    let run = map(&folder, &[&up[..], &["--out", "whole", "--resume"]].concat()).success();
    run.stderr(says(&["a batch does not match its checksum", "40 cells are kept"]));
    assert!(bytes(&folder.path().join("whole")) == expected);
    let sorted = |mut cells: Vec<(u32, Record)>| {
        cells.sort_by_key(|&(id, _)| id);
        cells
    };
    assert!(sorted(kept(&path).0) == sorted(cells));
}

#[test]
fn a_finished_map_with_a_damaged_record_says_how_to_mend_it() {
    let folder = folder();
    map(&folder, &["--quiet"]).success();
    let path = folder.path().join("out/s/records.bin");
    let good = fs::read(&path).unwrap();
    let mut bad = good.clone();
    bad[good.len() - 50] ^= 1;
    fs::write(&path, bad).unwrap();
    let validate = |quiet: &[&str]| {
        let arguments = [&["validate", "out/s", "--samples", "8"], quiet].concat();
        command(&folder, &arguments).assert()
    };
    validate(&[]).code(1).stderr(says(&["a batch does not match its checksum", "--resume"]));
    map(&folder, &["--resume", "--quiet"]).success();
    validate(&["--quiet"]).success().stderr("");
    // What stands behind the last cell is no reason to refuse.
    fs::write(&path, [&good[..], &[0; 100]].concat()).unwrap();
    validate(&["--quiet"]).code(1).stderr(says(&[
        "warning",
        "100 bytes from byte",
        "all 320 cells are there",
        "records.bin is damaged: it has",
    ]));
}

#[test]
fn a_header_is_there_twice_and_once_is_enough() {
    let folder = folder();
    let few = ["--set", "axis.0.count=4", "--set", "axis.1.count=3"];
    let resume = || map(&folder, &[&few[..], &["--resume"]].concat());
    map(&folder, &[&few[..], &["--quiet"]].concat()).success();
    let path = folder.path().join("out/s/records.bin");
    let good = fs::read(&path).unwrap();
    let head = ends(&good)[0];
    let flipped = |places: &[usize]| {
        let mut bad = good.clone();
        places.iter().for_each(|&at| bad[at] ^= 0x10);
        bad
    };
    for at in [3, 9, 40, head / 2 + 3, head / 2 + 9, head - 1] {
        fs::write(&path, flipped(&[at])).unwrap();
        resume()
            .success()
            .stderr(says(&["one of the two copies of its header is damaged", "12 cells are kept"]));
        assert!(fs::read(&path).unwrap() == good, "byte {at} was not mended");
    }
    for (bad, part) in [
        (flipped(&[40, head - 1]), "neither copy of its header matches its checksum"),
        (b"something else".to_vec(), "it is no record file of this version"),
    ] {
        fs::write(&path, &bad).unwrap();
        resume().code(2).stdout("").stderr(says(&[
            "records.bin is damaged",
            part,
            "start anew with --force",
        ]));
        assert!(fs::read(&path).unwrap() == bad, "the file was touched");
    }
    fs::write(&path, [&b"RTLMAP\0\x02"[..], &good[8..head / 2]].concat()).unwrap();
    resume().code(2).stderr(says(&["format 1", "this version does not read", "--force"]));
    map(&folder, &[&few[..], &["--quiet", "--force"]].concat()).success();
    assert!(fs::read(&path).unwrap() == good);
}

/// A run that was killed before it kept anything is no reason to refuse.
#[test]
fn nothing_kept_is_begun_anew() {
    let folder = folder();
    let few = ["--set", "axis.0.count=4", "--set", "axis.1.count=3"];
    map(&folder, &[&few[..], &["--quiet"]].concat()).success();
    let out = folder.path().join("out/s");
    let (expected, good) = (bytes(&out), fs::read(out.join("records.bin")).unwrap());
    let begun = |name: &str, contents: &[u8]| {
        fs::remove_dir_all(&out).unwrap();
        fs::create_dir(&out).unwrap();
        fs::write(out.join(name), contents).unwrap();
        let run = map(&folder, &[&few[..], &["--resume"]].concat()).success();
        run.stderr(says(&["out/s: nothing was kept there yet; the map is begun anew"]));
        assert!(bytes(&out) == expected, "{name}, {} bytes", contents.len());
    };
    let half = ends(&good)[0] / 2;
    for length in [0, 1, 10, half - 1] {
        begun("records.bin", &good[..length]);
    }
    begun("records.bin", &[0; 4096]);
    begun("partial-records.bin", &good[..20]);
    begun(".rattlemap-probe", b"");
}

#[test]
fn a_folder_that_is_not_there_is_begun_anew_and_says_so() {
    let folder = folder();
    let run = map(&folder, &["--set", "axis.0.count=4", "--set", "axis.1.count=3", "--resume"]).success();
    run.stderr(says(&["out/s: nothing was kept there yet; the map is begun anew", "12 of 12 cells"]));
}

/// The time that a map took is that of all its runs.
#[test]
fn elapsed_time_adds_up() {
    let folder = folder();
    let few = ["--quiet", "--set", "axis.0.count=4", "--set", "axis.1.count=3"];
    map(&folder, &few).success();
    let out = folder.path().join("out/s");
    let manifest = out.join("manifest.json");
    let elapsed = || {
        let text = fs::read_to_string(&manifest).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["elapsed_seconds"].as_f64().unwrap()
    };
    let resume = || map(&folder, &[&few[..], &["--resume"]].concat()).success();
    let first = elapsed();
    resume();
    assert!(first > 0.0 && elapsed() >= first, "{first} {}", elapsed());
    // An unfinished run has no manifest, and says it elsewhere.
    fs::remove_file(&manifest).unwrap();
    fs::write(out.join("unfinished.json"), "{\"elapsed_seconds\": 1000.0}").unwrap();
    resume();
    assert!((1000.0..1100.0).contains(&elapsed()), "{}", elapsed());
    assert!(!out.join("unfinished.json").exists());
    map(&folder, &[&few[..], &["--force"]].concat()).success();
    assert!(elapsed() < 100.0, "{}", elapsed());
}
