//! Power cuts: what a command promises to keep is on the disk when it ends.

use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::process::Command as Process;

use crate::common::{rattlemap, run, says, with_scene};

/// What a power cut leaves of a file behind its synced part.
#[derive(Clone, Copy, Debug)]
enum Tail {
    /// Nothing: the length was not written either.
    Lost,
    /// Zeros: the length was written before the data.
    Zeros,
    /// Every other block of 512 bytes: the data were written in another order.
    Torn,
}

/// Makes the folder `cut` from the folder `out` and the first calls of `faults/journal.c`. Of files the synced part is left, with this tail.
/// Names that were not synced are lost, unless `early`: then they were written before the data. Returns whether the folder itself is left.
fn cut(calls: &[Vec<&str>], out: &Path, cut: &Path, tail: Tail, early: bool) -> bool {
    let is_synced = |calls: &[Vec<&str>], folder| {
        calls.iter().any(|call| call[0] == "sync" && Path::new(call[2]) == folder)
    };
    let is_left =
        |(nth, call): &(usize, &Vec<&str>)| call[0] == "rename" && (early || is_synced(&calls[*nth..], out));
    let names = calls.iter().enumerate().filter(is_left);
    let names: HashMap<&str, &str> = names.map(|(_, call)| (call[3], call[1])).collect();
    fs::remove_dir_all(cut).ok();
    fs::create_dir(cut).unwrap();
    for (path, inode) in names.into_iter().filter(|(path, _)| Path::new(path).exists()) {
        let synced = calls.iter().rfind(|call| call[0] == "sync" && call[1] == inode);
        let mut bytes = fs::read(path).unwrap();
        let size = synced.map_or(0, |call| call[3].parse().unwrap());
        match tail {
            Tail::Lost => bytes.truncate(size),
            Tail::Zeros => bytes[size..].fill(0),
            Tail::Torn => bytes[size..].chunks_mut(512).step_by(2).for_each(|block| block.fill(0)),
        }
        fs::write(cut.join(Path::new(path).file_name().unwrap()), &bytes).unwrap();
    }
    is_synced(calls, out.parent().unwrap())
}

/// A power cut at the end of a command loses nothing, and one before it only work that a resumed run does again.
#[test]
fn what_a_command_has_written_survives_a_power_cut() {
    let folder = with_scene(crate::faults::SCENE);
    let root = folder.path().canonicalize().unwrap();
    let [library, journal] = ["journal.so", "journal"].map(|name| root.join(name));
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cli/faults/journal.c");
    let mut compiler = Process::new("cc");
    let Ok(status) = compiler.args(["-shared", "-fPIC", source, "-o"]).arg(&library).status() else { return };
    assert!(status.success());
    let map = "map s.toml --engine cpu --quiet --out";
    run(&folder, &format!("{map} part-1 --shard 1/2")).success();
    run(&folder, &format!("{map} part-2 --shard 2/2")).success();
    for line in [format!("{map} OUT"), "merge OUT part-1 part-2 --quiet".to_owned()] {
        let out = root.join("out");
        drop((fs::remove_dir_all(&out), fs::remove_file(&journal)));
        let mut recorded = rattlemap(&folder);
        recorded.env("LD_PRELOAD", &library).env("RATTLEMAP_JOURNAL", &journal);
        recorded.args(line.replace("OUT", out.to_str().unwrap()).split(' ')).assert().success();
        let text = fs::read_to_string(&journal).unwrap();
        let calls: Vec<Vec<&str>> = text.lines().map(|line| line.split('\t').collect()).collect();
        assert!(cut(&calls, &out, &root.join("cut"), Tail::Lost, false), "the folder is lost");
        run(&folder, "check cut").success().stderr(says(&["all 2 files are as manifest.json says"]));
        if line.starts_with("merge") {
            continue;
        }
        let cells = fs::read(out.join("cells.csv")).unwrap();
        for count in 0..calls.len() {
            let tails = [Tail::Lost, Tail::Zeros, Tail::Torn];
            for (tail, early) in tails.into_iter().flat_map(|tail| [(tail, false), (tail, true)]) {
                cut(&calls[..count], &out, &root.join("cut"), tail, early);
                run(&folder, &format!("{map} cut --resume")).success();
                let resumed = fs::read(root.join("cut/cells.csv")).unwrap();
                assert!(resumed == cells, "after {count} calls, {tail:?}, names early: {early}");
            }
        }
    }
}
