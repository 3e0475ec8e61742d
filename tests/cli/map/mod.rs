//! `rattlemap map` as scripts see it: files of the contract, refusals, resumption.

mod adaptive;
mod axes;
mod basins;
mod check;
mod dry_run;
mod engines;
mod figures;
mod folders;
#[cfg(unix)]
mod hostile;
mod interrupts;
mod json;
mod quantities;
mod records;
mod shards;
mod shares;
mod streams;
mod torture;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command as Process, Stdio};

use assert_cmd::Command;
use predicates::prelude::*;
use rattlemap_dynamics::word::Word;
use tempfile::TempDir;

use crate::common::{json, printed, rattlemap, rows, says, with_scene as with};

const SCENE: &str = r#"title = "A <small> map"
axis = [
    { parameter = "e", min = 0.0, max = 1.0, count = 20 },
    { parameter = "omega", min = 1.0, max = 12.0, count = 16 },
]

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"]
"#;

/// Settings of a map of 12 cells.
const FEW: &str = "--set axis.0.count=4 --set axis.1.count=3";

/// Settings of a map with two rows whose cells all fail.
const STIFF: &str = "--set parameters.m1=2e-6 --set axis.1.min=0.003 --set axis.1.max=0.004 --set axis.1.count=2 \
     --set integration.transient_periods=20 --set integration.observed_periods=4 --set integration.max_period=1";

/// Files that a resumed run must write byte for byte.
const SAME: &str = "cells.csv cells.npy words.csv map.png lyapunov.png impacts.png mesh.png pattern.png word.png report.html";

fn folder() -> TempDir {
    with(SCENE)
}

/// The words of a line of arguments.
fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

fn command(folder: &TempDir, arguments: &str) -> Command {
    let mut command = rattlemap(folder);
    command.args(words(arguments));
    command
}

/// Runs a map on the CPU, unless the arguments say otherwise.
fn map(folder: &TempDir, arguments: &str) -> assert_cmd::assert::Assert {
    let engine = if arguments.contains("--engine") { "" } else { "--engine cpu " };
    command(folder, &format!("map s.toml {engine}{arguments}")).assert()
}

/// Runs a command that must succeed.
fn succeeds(folder: &TempDir, arguments: &str) -> assert_cmd::assert::Assert {
    command(folder, arguments).assert().success()
}

/// Runs a command that must fail with an exit code and these parts of a message.
fn fails(folder: &TempDir, arguments: &str, code: i32, parts: &[&str]) {
    command(folder, arguments).assert().code(code).stdout("").stderr(says(parts));
}

/// Starts the program in a folder.
fn begin(folder: &TempDir, arguments: &str) -> std::process::Child {
    let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"));
    run.current_dir(folder.path()).args(words(arguments)).stderr(Stdio::piped()).spawn().unwrap()
}

/// Sends a signal to a run and waits for its end; returns the exit code and the text of stderr.
#[cfg(unix)]
fn stop(mut run: std::process::Child, signal: &str) -> (Option<i32>, String) {
    Process::new("kill").args([signal, &run.id().to_string()]).status().unwrap();
    let mut text = String::new();
    std::io::Read::read_to_string(run.stderr.as_mut().unwrap(), &mut text).unwrap();
    (run.wait().unwrap().code(), text)
}

/// Waits until a condition holds.
fn wait_until(holds: impl Fn() -> bool) {
    let clock = std::time::Instant::now();
    while !holds() {
        assert!(clock.elapsed().as_secs() < 60, "the condition does not hold after a minute");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
}

/// Flips a bit of the byte that lies `from_end` bytes before the end of a file.
fn damage(path: &Path, from_end: usize) {
    let mut bytes = fs::read(path).unwrap();
    let at = bytes.len() - from_end;
    bytes[at] ^= 1;
    fs::write(path, bytes).unwrap();
}

/// Names and contents of the files in a folder.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    names(folder).into_iter().map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let names = folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.collect::<BTreeSet<_>>().into_iter().collect()
}

#[test]
fn a_map_writes_the_files_of_the_contract() {
    let folder = folder();
    map(&folder, "--engine cpu").success().stdout("").stderr(says(&[
        "320 cells in ",
        " s on cpu (f64): ",
        "cells/s",
        "periods/s",
        "periodic",
        "out/s: cells.csv, cells.npy, words.csv, map.png, lyapunov.png, impacts.png, mesh.png, pattern.png, word.png, \
         report.html",
    ]));
    let out = folder.path().join("out/s");
    let (header, rows) = rows(&out.join("cells.csv"));
    assert_eq!(
        header,
        "i,j,e,omega,class,period,lyapunov,lyapunov_error,impacts_per_period,mesh_fraction,symmetric,word,\
         pattern,status,periods_run,source"
    );
    assert_eq!(rows.len(), 320);
    rows.iter().enumerate().for_each(|(id, row)| check_row(id, row));
    let texts = check_words(&out.join("words.csv"), &rows);
    check_npy(&fs::read(out.join("cells.npy")).unwrap(), &rows, &texts);
    check_manifest(&out, &rows);
    for name in words(SAME).into_iter().filter(|name| name.ends_with("png")) {
        let picture = image::open(out.join(name)).unwrap().to_rgb8();
        let colors: std::collections::HashSet<_> = picture.pixels().collect();
        assert!(picture.width() > 1400 && colors.len() > 30, "{name}");
    }
}

fn check_row(id: usize, row: &[String]) {
    let (i, j) = (id % 20, id / 20);
    assert_eq!((row[0].parse(), row[1].parse()), (Ok(i), Ok(j)));
    assert_eq!(row[2].parse::<f64>().unwrap(), if i == 19 { 1.0 } else { i as f64 / 19.0 });
    assert_eq!(row[3].parse::<f64>().unwrap(), if j == 15 { 12.0 } else { 1.0 + 11.0 * j as f64 / 15.0 });
    let is_periodic = row[4] == "periodic";
    assert!(is_periodic || row[4] == "chaotic" || row[4] == "undecided", "{row:?}");
    assert_eq!(row[5].parse::<u32>().is_ok_and(|period| (1..=64).contains(&period)), is_periodic, "{row:?}");
    let lyapunov: f64 = row[6].parse().unwrap();
    assert_eq!(row[7].is_empty(), is_periodic, "{row:?}");
    if row[4] == "chaotic" {
        assert!(lyapunov > 3.0 * row[7].parse::<f64>().unwrap(), "{row:?}");
    }
    let (impacts, mesh): (f64, f64) = (row[8].parse().unwrap(), row[9].parse().unwrap());
    assert!(impacts >= 0.0 && (0.0..=1.0).contains(&mesh), "{row:?}");
    // Lanes on a slow approach do not know the symmetry yet.
    let is_known = row[10] == "true" || row[10] == "false";
    assert!(is_known == is_periodic || row[13] != "ok" && row[10].is_empty(), "{row:?}");
    assert_eq!([11, 12].map(|field| row[field].is_empty()), [!is_periodic; 2], "{row:?}");
    if let (Some(word), Some(pattern)) = (row[11].strip_prefix('w'), row[12].strip_prefix('w')) {
        // More than 64 symbols are shown by their hash and their number.
        let is_spelled = |text: &str| {
            let hashed = text.strip_prefix('#').map(|text| text.rsplit('/').next().unwrap().parse::<usize>());
            assert!(hashed.is_none_or(|number| number.unwrap() > 64), "{row:?}");
            text.chars().all(|c| ('1'..='6').contains(&c))
        };
        if is_spelled(word) && is_spelled(pattern) {
            assert_eq!(Word::cyclic(word.as_bytes()).pattern().time_order(), pattern, "{row:?}");
        }
    } else {
        assert!(!is_periodic, "{row:?}");
    }
    let statuses = ["ok", "slow", "near_grazing", "strobe_on_event", "below_resolution"];
    assert!(statuses.contains(&row[13].as_str()), "{row:?}");
    assert!((1..=528).contains(&row[14].parse::<u32>().unwrap()), "{row:?}");
    assert_eq!(row[15], "integrated");
}

/// The texts of `words.csv` by row: those of the cells, each once.
fn check_words(path: &Path, cells: &[Vec<String>]) -> Vec<String> {
    let (header, rows) = rows(path);
    assert_eq!((&*header, &rows[0][..]), ("row,text", &["0".to_owned(), String::new()][..]));
    assert!(rows.iter().enumerate().all(|(n, row)| row[0] == n.to_string()), "{rows:?}");
    let texts: Vec<String> = rows.into_iter().map(|row| row[1].clone()).collect();
    let listed: BTreeSet<&String> = texts.iter().collect();
    assert_eq!(listed.len(), texts.len(), "a text has two rows");
    assert_eq!(listed, cells.iter().flat_map(|row| &row[11..13]).collect());
    texts
}

/// The array's bytes against the table's rows.
fn check_npy(bytes: &[u8], rows: &[Vec<String>], texts: &[String]) {
    assert!(bytes.starts_with(b"\x93NUMPY"));
    let header_end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = String::from_utf8_lossy(&bytes[10..header_end]);
    for part in ["('omega', '<f8')", "('class', '|i1')", "('word', '<u4')", "('pattern', '<u4')", "(320, )"] {
        assert!(header.contains(part), "{header}");
    }
    let size = (bytes.len() - header_end) / rows.len();
    assert_eq!(size, 4 + 4 + 8 + 8 + 1 + 2 + 4 * 8 + 1 + 4 + 4 + 1 + 4 + 1);
    for (row, packed) in rows.iter().zip(bytes[header_end..].chunks(size)) {
        let float = |at: usize| f64::from_le_bytes(packed[at..at + 8].try_into().unwrap());
        assert_eq!(format!("{:?}", float(8)), row[2]);
        assert_eq!(format!("{:?}", float(16)), row[3]);
        let classes = ["periodic", "chaotic", "undecided", "failed"];
        assert_eq!(classes[usize::from(packed[24])], row[4]);
        let period = u16::from_le_bytes([packed[25], packed[26]]);
        assert_eq!(period, row[5].parse().unwrap_or(0));
        for (at, field) in [(27, 6), (35, 7), (43, 8), (51, 9)] {
            let (value, text) = (float(at), &row[field]);
            assert!(if text.is_empty() { value.is_nan() } else { format!("{value:?}") == *text }, "{row:?}");
        }
        assert_eq!(
            i8::from_le_bytes([packed[59]]),
            match row[10].as_str() {
                "true" => 1,
                "false" => 0,
                _ => -1,
            }
        );
        let number = |at: usize| u32::from_le_bytes(packed[at..at + 4].try_into().unwrap());
        assert_eq!([60, 64].map(|at| &texts[number(at) as usize]), [&row[11], &row[12]]);
        assert_eq!(number(69), row[14].parse::<u32>().unwrap());
    }
}

fn check_manifest(out: &Path, rows: &[Vec<String>]) {
    let manifest = json(&out.join("manifest.json"));
    assert!(!manifest.to_string().contains(env!("CARGO_MANIFEST_DIR")), "a path of this machine: {manifest}");
    assert_eq!(manifest["command"], "map");
    assert_eq!(manifest["scene"], SCENE);
    assert_eq!((&manifest["engine"], &manifest["precision"]), (&"cpu".into(), &"f64".into()));
    assert_eq!(manifest["cells"], 320);
    let commit = manifest["commit"].as_str().unwrap();
    let of = commit.strip_suffix("-modified").unwrap_or(commit);
    let is_hash = of.len() == 40 && of.chars().all(|c| c.is_ascii_hexdigit());
    assert!(is_hash || commit == "unknown", "{commit}");
    assert_eq!(manifest["codes"]["class"]["chaotic"], 1);
    assert_eq!(manifest["codes"]["status"]["slow"], 1);
    assert_eq!(manifest["codes"]["source"]["integrated"], 0);
    assert_eq!(manifest["start"]["policy"], "rest");
    assert_eq!(manifest["axes"][1]["parameter"], "omega");
    for class in ["periodic", "chaotic", "undecided", "failed"] {
        let count = rows.iter().filter(|row| row[4] == class).count();
        assert_eq!(manifest["classes"][class], count);
    }
    assert_eq!(manifest["format"], 2);
    for phase in words("plan open device flows compile integrate records write") {
        assert!(manifest["timings"][phase].as_f64().unwrap() >= 0.0, "{phase}");
    }
    let files = manifest["files"].as_array().unwrap();
    let mut files: Vec<&str> = files.iter().map(|file| file["name"].as_str().unwrap()).collect();
    files.push("manifest.json");
    files.sort_unstable();
    assert_eq!(files, names(out));
}

#[test]
fn quantities_that_are_not_requested_are_empty_and_have_no_files() {
    let folder = folder();
    let mesh = format!("{FEW} --quiet --set outputs.quantities=[\"mesh\"]");
    map(&folder, &format!("{mesh} --set outputs.files=[\"csv\",\"png\"]")).success().stderr("");
    let out = folder.path().join("out/s");
    assert_eq!(names(&out), ["cells.csv", "manifest.json", "mesh.png", "records.bin"]);
    for row in rows(&out.join("cells.csv")).1 {
        assert!([4, 5, 6, 7, 8, 10, 11].iter().all(|&field| row[field].is_empty()), "{row:?}");
        assert!(!row[9].is_empty() && row[14] == "integrated", "{row:?}");
    }
    // The array has no column for them, and there is no table of words.
    map(&folder, &format!("{mesh} --set outputs.files=[\"npy\"] --force")).success();
    assert_eq!(names(&out), ["cells.npy", "manifest.json", "records.bin"]);
    let array = fs::read(out.join("cells.npy")).unwrap();
    let header =
        String::from_utf8_lossy(&array[10..10 + usize::from(u16::from_le_bytes([array[8], array[9]]))]);
    let names: Vec<&str> = header.split("('").skip(1).map(|part| part.split('\'').next().unwrap()).collect();
    assert_eq!(names, ["i", "j", "e", "omega", "mesh_fraction", "status", "periods_run", "source"]);
}

#[test]
fn patterns_need_no_words() {
    let folder = folder();
    let sets = r#"--set outputs.quantities=["pattern"] --set outputs.files=["csv","npy","png"]"#;
    let out = folder.path().join("out/s");
    for engine in ["cpu", "gpu"] {
        map(&folder, &format!("{FEW} {sets} --quiet --engine {engine} --force")).success();
        let files = ["cells.csv", "cells.npy", "manifest.json", "pattern.png", "records.bin", "words.csv"];
        assert_eq!(names(&out), files);
        let rows = rows(&out.join("cells.csv")).1;
        assert!(rows.iter().all(|row| row[11].is_empty()), "{rows:?}");
        assert!(rows.iter().filter(|row| row[12].starts_with('w')).count() > 6, "{rows:?}");
    }
}

#[test]
fn files_of_another_run_are_overwritten_only_with_force() {
    let folder = folder();
    // Scripts may always give --resume: without a folder it begins a map.
    map(&folder, &format!("{FEW} --quiet --resume")).success();
    fails(&folder, &format!("map s.toml {FEW} --quiet"), 2, &["out/s: the folder is not empty", "--force"]);
    fails(&folder, "map s.toml --resume --force", 2, &["cannot be used with"]);
    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    fs::write(other.join("notes.txt"), "precious").unwrap();
    let resume = format!("map s.toml {FEW} --quiet --out other --resume");
    fails(&folder, &resume, 2, &["there is no records.bin in other", "leave --resume out"]);
    map(&folder, &format!("{FEW} --quiet --out other --force")).success();
    assert_eq!(fs::read_to_string(other.join("notes.txt")).unwrap(), "precious");
}

#[test]
fn maps_that_do_not_fit_are_refused_with_figures() {
    let folder = folder();
    let refused = |count: &str, parts: &[&str]| {
        let map = format!("map s.toml --engine cpu --set axis.0.count={count} --set axis.1.count={count}");
        fails(&folder, &map, 2, parts);
    };
    refused("1000000", &["1000000 x 1000000 = 1000000000000 cells is too large"]);
    refused("65000", &["4225000000 cells needs about 371.9 GB of memory, and", "are free"]);
    assert!(!folder.path().join("out").exists(), "an output folder was made");
}

#[test]
fn scenes_that_maps_cannot_do_are_refused() {
    let folder = folder();
    for (set, part) in [
        ("start.count=300", "`start.count = 300` is out of range: it must be a whole number from 1 to 255"),
        ("refine.max_error=0", "`refine.max_error = 0` is out of range"),
        ("e=0.5", "`parameters.e = 0.5` does not fit: axis 0 sweeps `e`"),
    ] {
        fails(&folder, &format!("map s.toml --set {set}"), 2, &[&format!("--set {set}: "), part]);
    }
    assert!(!folder.path().join("out").exists());
}
