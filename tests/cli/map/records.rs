//! `records.bin`: incomplete and damaged files, and those of another run.

use rattlemap::record::Record;
use rattlemap::store::record_file::{Extent, Identity, Order, RecordFile};

use super::*;

/// Contents of the files of `SAME` in a folder.
pub(super) fn bytes(out: &Path) -> Vec<Vec<u8>> {
    let read = |name| fs::read(out.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    words(SAME).into_iter().map(read).collect()
}

/// All records of a file, in their order.
pub(super) fn stored(path: &Path) -> (Vec<(u32, Record)>, Extent) {
    let identity = Identity::read(path).unwrap().unwrap();
    let mut all = Vec::new();
    let take = |batch: &[(u32, Record)]| {
        all.extend_from_slice(batch);
        true
    };
    let extent = RecordFile::read(path, &identity, Order::Any, take).unwrap();
    (all, extent)
}

/// A map in the folder `whole`, its records in five batches as a longer run writes them: the map's files, the bytes of
/// the records, and the offsets at which batches begin and the last one ends.
fn in_batches(folder: &TempDir, sets: &str) -> (Vec<Vec<u8>>, Vec<u8>, Vec<usize>) {
    map(folder, &format!("{sets} --quiet --out whole")).success();
    fs::create_dir(folder.path().join("cut")).unwrap();
    let path = folder.path().join("whole/records.bin");
    let (identity, all) = (Identity::read(&path).unwrap().unwrap(), stored(&path).0);
    let mut file = RecordFile::create(&path, &identity).unwrap();
    all.chunks(all.len().div_ceil(5)).for_each(|batch| file.append(batch).unwrap());
    let records = fs::read(path).unwrap();
    let ends = ends(&records);
    (bytes(&folder.path().join("whole")), records, ends)
}

fn ends(records: &[u8]) -> Vec<usize> {
    let u32_at = |at: usize| u32::from_le_bytes(records[at..at + 4].try_into().unwrap()) as usize;
    let mut ends = vec![16 + u32_at(8)];
    while ends.last().is_some_and(|&end| end < records.len()) {
        let at = ends[ends.len() - 1];
        ends.push(at + 32 + u32_at(at + 20));
    }
    ends
}

#[test]
fn records_of_another_run_are_refused() {
    let folder = folder();
    map(&folder, &format!("{FEW} --quiet")).success();
    let records = folder.path().join("out/s/records.bin");
    let before = fs::read(&records).unwrap();
    let refused = |sets: &str, parts: &[&str]| {
        let run = format!("map s.toml --engine cpu {FEW} --quiet --resume {sets}");
        fails(&folder, &run, 2, &[&["out/s/records.bin", "--force"], parts].concat());
    };
    refused("--set axis.0.max=0.9", &["`axis.0.max` was 1.0, now 0.9"]);
    refused(
        "--set F=51 --set start.policy=state --set start.state=[0,0,0,1]",
        &["`parameters.F` was 50.0, now 51.0", "`start` was rest, now state [0.0, 0.0, 0.0, 1.0]"],
    );
    refused("--set outputs.quantities=[\"class\"]", &["`outputs.quantities` was [class, lyapunov,"]);
    assert!(String::from_utf8_lossy(&before).contains(env!("CARGO_PKG_VERSION")));
    assert!(fs::read(&records).unwrap() == before, "the records were changed");
    // The deciding sources and the target are compared, too.
    let own = Identity::read(&records).unwrap().unwrap();
    for (identity, part) in [
        (own.clone().built_from("0123", Identity::own_target()), "`sources` was 0123, now "),
        (own.built_from(Identity::own_sources(), "z80"), "`target` was z80, now "),
    ] {
        RecordFile::create(&records, &identity).unwrap();
        refused("", &[part]);
    }
    fs::write(&records, before).unwrap();
    // Title and kinds of file may change.
    map(&folder, &format!("{FEW} --quiet --set title=Other --resume")).success();
}

#[test]
fn only_damaged_batches_are_computed_again() {
    let folder = folder();
    let (expected, records, ends) = in_batches(&folder, "");
    assert_eq!((ends.len(), ends[5]), (6, records.len()));
    let flipped = |at: usize| {
        let mut bad = records.clone();
        bad[at] ^= 0x10;
        bad
    };
    let noise: Vec<u8> = (0..1000u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let with_tail = |batches: usize, tail: &[u8]| [&records[..ends[batches]], tail].concat();
    let cut = folder.path().join("cut");
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
        let at = format!("from byte {} on", ends[first]);
        let left = format!("{} cells are kept", 64 * batches);
        let run = map(&folder, "--out cut --resume").success();
        run.stderr(says(&["warning: cut/records.bin", part, &at, &left]));
        assert!(bytes(&cut) == expected, "{part}, {batches} batches");
        let (cells, extent) = stored(&cut.join("records.bin"));
        assert_eq!((cells.len(), extent.damage), (320, None), "{part}");
    }
}

/// A row that follows another cannot be used without it.
#[test]
fn records_that_depend_on_damaged_ones_are_computed_again() {
    let folder = folder();
    let up = "--set start.policy=up --set axis.1.count=5";
    let (expected, mut records, ends) = in_batches(&folder, up);
    let whole = folder.path().join("whole");
    let path = whole.join("records.bin");
    let sorted = || {
        let mut cells = stored(&path).0;
        cells.sort_by_key(|&(id, _)| id);
        cells
    };
    let cells = sorted();
    records[ends[2] + 50] ^= 1;
    fs::write(&path, records).unwrap();
    let run = map(&folder, &format!("{up} --out whole --resume")).success();
    run.stderr(says(&["a batch does not match its checksum", "40 cells are kept"]));
    assert!(bytes(&whole) == expected && sorted() == cells);
}

#[test]
fn validating_a_map_with_a_damaged_record_says_how_to_repair_it() {
    let folder = folder();
    map(&folder, "--quiet").success();
    let path = folder.path().join("out/s/records.bin");
    let good = fs::read(&path).unwrap();
    damage(&path, 50);
    let validate = "validate out/s --samples 8 --quiet";
    fails(&folder, validate, 1, &["a batch does not match its checksum", "--resume"]);
    map(&folder, "--resume --quiet").success();
    succeeds(&folder, validate).stderr("");
    // Damage behind the last record is reported, and the map is validated.
    fs::write(&path, [&good[..], &[0; 100]].concat()).unwrap();
    let parts =
        ["warning", "100 bytes from byte", "all 320 cells are there", "records.bin is damaged: it has"];
    fails(&folder, validate, 1, &parts);
}

#[test]
fn a_file_without_a_readable_header_is_refused() {
    let folder = folder();
    map(&folder, &format!("{FEW} --quiet")).success();
    let path = folder.path().join("out/s/records.bin");
    let good = fs::read(&path).unwrap();
    let header = ends(&good)[0];
    let flipped = |at: usize| {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        bad
    };
    let checksum = "its header does not match its checksum";
    for (bad, part) in [
        (flipped(9), checksum),
        (flipped(40), checksum),
        (flipped(header - 1), checksum),
        (flipped(3), "it is no record file"),
        (b"something else".to_vec(), "it is no record file"),
    ] {
        fs::write(&path, &bad).unwrap();
        let parts = ["records.bin is damaged", part, "start anew with --force"];
        fails(&folder, &format!("map s.toml --engine cpu {FEW} --resume"), 2, &parts);
        assert!(fs::read(&path).unwrap() == bad, "the file was changed");
    }
    map(&folder, &format!("{FEW} --quiet --force")).success();
    assert!(fs::read(&path).unwrap() == good);
}

/// A run may be killed before it has stored anything, or may not have begun.
#[test]
fn resuming_without_records_begins_the_map() {
    let folder = folder();
    let resume = || {
        let run = map(&folder, &format!("{FEW} --resume")).success();
        let begins = "out/s: the folder has no records; the map starts from its first cell";
        run.stderr(says(&[begins, "12 of 12 cells"]));
    };
    resume();
    let out = folder.path().join("out/s");
    let (expected, good) = (bytes(&out), fs::read(out.join("records.bin")).unwrap());
    let begun = |name: &str, contents: &[u8]| {
        fs::remove_dir_all(&out).unwrap();
        fs::create_dir(&out).unwrap();
        fs::write(out.join(name), contents).unwrap();
        resume();
        assert!(bytes(&out) == expected, "{name}, {} bytes", contents.len());
    };
    for length in [0, 1, 10, ends(&good)[0] - 1] {
        begun("records.bin", &good[..length]);
    }
    begun("records.bin", &[0; 4096]);
    begun("partial-records.bin", &good[..20]);
}

#[test]
fn elapsed_time_is_the_sum_over_all_runs() {
    let folder = folder();
    let run = |how: &str| map(&folder, &format!("{FEW} --quiet {how}")).success();
    let out = folder.path().join("out/s");
    let manifest = out.join("manifest.json");
    let elapsed = || json(&manifest)["elapsed_seconds"].as_f64().unwrap();
    run("");
    let first = elapsed();
    run("--resume");
    assert!(first > 0.0 && elapsed() >= first, "{first} {}", elapsed());
    // An unfinished run has no manifest and stores the time in another file.
    fs::remove_file(&manifest).unwrap();
    fs::write(out.join("unfinished.json"), "{\"elapsed_seconds\": 1000.0}").unwrap();
    run("--resume");
    assert!((1000.0..1100.0).contains(&elapsed()), "{}", elapsed());
    assert!(!out.join("unfinished.json").exists());
    run("--force");
    assert!(elapsed() < 100.0, "{}", elapsed());
}
