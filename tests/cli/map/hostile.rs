//! Files that no run writes: pipes and devices in a folder, forged shards and records. And limits of the shell.

use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::process::Output;
use std::time::{Duration, Instant};

use rattlemap::map::shard::Shard;
use rattlemap::store::inventory;
use rattlemap::store::record_file::{Extent, Identity, Order, RecordFile};

use super::*;

/// Time limit of a command.
const LONGEST: Duration = Duration::from_secs(60);

fn path(folder: &TempDir, name: &str) -> PathBuf {
    folder.path().join(name)
}

/// Runs a command, which must end by itself. Returns its exit code and the text of stderr.
fn ends(folder: &TempDir, line: &str) -> (i32, String) {
    ended(&command(folder, line).timeout(LONGEST).output().unwrap(), line)
}

fn ended(output: &Output, line: &str) -> (i32, String) {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!text.contains("panicked"), "{line}: {text}");
    (output.status.code().unwrap_or_else(|| panic!("{line}: {}: {text}", output.status)), text)
}

/// Runs the program in a shell after this line, which sets limits.
fn limited(folder: &TempDir, limits: &str, line: &str) -> (i32, String) {
    let program = assert_cmd::cargo::cargo_bin("rattlemap");
    let script = format!("{limits}; exec '{}' {line}", program.display());
    let run = Process::new("bash").args(["-c", &script]).current_dir(folder.path()).output().unwrap();
    ended(&run, line)
}

/// Every command that reads a folder refuses or ignores such a file at once.
#[test]
fn pipes_and_devices_in_a_folder_block_no_command() {
    let folder = with("[cells]\nfile = 'l.csv'\n[outputs]\nfiles = ['csv']\n");
    fs::write(path(&folder, "l.csv"), "e,omega\n0.1,5\n0.2,6\n0.3,7\n").unwrap();
    for out in ["whole", "other", "good --shard 2/2", "shard --shard 1/2"] {
        map(&folder, &format!("--quiet --out {out}")).success();
    }
    assert!(Process::new("mkfifo").arg(path(&folder, "pipe")).status().unwrap().success());
    let shard = "map s.toml --engine cpu --quiet --out shard --shard 1/2 --resume";
    let resume = "map s.toml --engine cpu --quiet --out whole --resume";
    let dry = "map s.toml --engine cpu --quiet --out whole --resume --dry-run";
    let compare = "compare whole other --out differences --force --quiet";
    for (dir, lines) in [
        ("shard", vec!["check shard", "merge merged shard good --force --quiet", shard]),
        ("whole", vec!["check whole", "check whole --repair", compare, "validate whole", resume, dry]),
    ] {
        let good = contents(&path(&folder, dir));
        for name in ["records.bin", "manifest.json", "list.csv", "unfinished.json", ".rattlemap.lock"] {
            for target in [None, Some(path(&folder, "pipe")), Some("/dev/zero".into())] {
                for line in &lines {
                    let file = path(&folder, dir).join(name);
                    fs::remove_file(&file).ok();
                    match &target {
                        None => assert!(Process::new("mkfifo").arg(&file).status().unwrap().success()),
                        Some(target) => symlink(target, &file).unwrap(),
                    }
                    let (code, text) = ends(&folder, line);
                    let is_read = words("records.bin manifest.json list.csv").contains(&name);
                    let is_refused = code > 0 || !is_read || line.starts_with("map");
                    assert!(
                        (0..=2).contains(&code) && is_refused,
                        "{line}: {name} {target:?}: {code} {text}"
                    );
                    fs::remove_dir_all(path(&folder, dir)).unwrap();
                    fs::create_dir(path(&folder, dir)).unwrap();
                    for (name, bytes) in &good {
                        fs::write(path(&folder, dir).join(name), bytes).unwrap();
                    }
                }
            }
        }
    }
}

#[test]
fn a_list_that_the_manifest_does_not_name_is_not_read() {
    let folder = with("[cells]\nfile = 'l.csv'\n");
    fs::write(path(&folder, "l.csv"), "e,omega\n0.1,5\n0.2,6\n").unwrap();
    map(&folder, "--quiet --out part --shard 1/1").success();
    let file = path(&folder, "part/manifest.json");
    let mut manifest = json(&file);
    manifest["files"].as_array_mut().unwrap().retain(|file| file["name"] != "list.csv");
    fs::write(&file, inventory::sealed(manifest).unwrap()).unwrap();
    fails(&folder, "merge merged part", 2, &["manifest.json lists no list.csv", "--force"]);
}

/// A sparse file takes no space on the disk.
#[test]
fn a_manifest_larger_than_any_is_refused_unread() {
    let folder = folder();
    map(&folder, &format!("{FEW} --quiet")).success();
    fs::File::options()
        .write(true)
        .open(path(&folder, "out/s/manifest.json"))
        .unwrap()
        .set_len(1 << 40)
        .unwrap();
    fails(&folder, "check out/s", 1, &["manifest.json is damaged (it has 1", "at most 256.0 MB are read"]);
    fails(&folder, "validate out/s", 2, &["at most 256.0 MB are read"]);
}

#[test]
fn a_merge_compares_the_number_of_shards_with_the_map() {
    let folder = folder();
    let few = format!("{FEW} --quiet");
    map(&folder, &format!("{few} --shard 2/12 --out part")).success();
    let missing = "11 of 12 shards are missing: 1/12 (`rattlemap map SCENE --engine cpu --shard 1/12 ";
    let (code, text) = ends(&folder, "merge merged part");
    assert!(code == 2 && text.contains(missing) && text.trim_end().ends_with(" and 1 more"), "{text}");
    assert!(!text.contains("12/12"), "ten are named: {text}");
    // All checksums of the forged shard are right.
    let (records, file) = (path(&folder, "part/records.bin"), path(&folder, "part/manifest.json"));
    let (all, shard) = (records::stored(&records).0, Shard::new(2, u32::MAX).unwrap());
    let identity = Identity::read(&records).unwrap().unwrap().of_shard(Some(shard));
    RecordFile::create(&records, &identity).unwrap().append(&all).unwrap();
    let mut manifest = json(&file);
    manifest["shard"] = serde_json::to_value(shard).unwrap();
    fs::write(&file, inventory::sealed(manifest).unwrap()).unwrap();
    let impossible = "part: 2/4294967295 is one of 4294967295 shards, but the map has only 12 cells";
    fails(&folder, "merge merged part", 2, &[impossible]);
}

/// Each of the forged heads claims all bytes up to the last batch, which is good.
#[test]
fn records_behind_nested_heads_are_read_in_linear_time() {
    let folder = folder();
    map(&folder, &format!("{FEW} --quiet")).success();
    let file = path(&folder, "out/s/records.bin");
    let identity = Identity::read(&file).unwrap().unwrap();
    let good = fs::read(&file).unwrap();
    let begin = 16 + u32::from_le_bytes(good[8..12].try_into().unwrap()) as usize;
    let heads = 1 << 17;
    let mut forged = good[..begin].to_vec();
    for left in (0..heads).rev() {
        let mut head = good[begin..begin + 28].to_vec();
        head[8..12].fill(0);
        head[20..24].copy_from_slice(&(32 * left as u32).to_le_bytes());
        let sum = crc32fast::hash(&head);
        forged.extend_from_slice(&[&head[..], &sum.to_le_bytes()].concat());
    }
    forged.extend_from_slice(&good[begin..]);
    fs::write(&file, &forged).unwrap();
    let clock = Instant::now();
    let Extent { count, damage, .. } = RecordFile::read(&file, &identity, Order::Any, |_| true).unwrap();
    assert_eq!((count, damage.map(|damage| damage.bytes)), (12, Some(32 * heads)));
    // Reading each claimed byte would take minutes.
    assert!(clock.elapsed() < Duration::from_secs(20), "{:?}", clock.elapsed());
}

#[test]
fn a_check_recommends_only_what_helps() {
    let folder = folder();
    map(&folder, &format!("{FEW} --quiet")).success();
    let check = |name: &str, helps: &str| {
        let file = path(&folder, "out/s").join(name);
        let good = fs::read(&file).unwrap();
        damage(&file, 40);
        let (code, text) = ends(&folder, "check out/s --quiet");
        assert!(code == 1 && text.contains(helps), "{name}: {text}");
        assert_eq!(text.contains("--repair"), helps.contains("--repair"), "{name}: {text}");
        fs::write(&file, good).unwrap();
    };
    check("cells.csv", "`rattlemap check out/s --repair` recreates tables");
    check(
        "records.bin",
        "records.bin cannot be recreated from other files; `rattlemap map SCENE --out out/s",
    );
    check("manifest.json", "manifest.json cannot be trusted; `rattlemap map SCENE --out out/s");
    // No map has such a file.
    let file = path(&folder, "out/s/manifest.json");
    let text = fs::read_to_string(&file).unwrap().replace("\"cells.csv\"", "\"sells.csv\"");
    fs::write(&file, inventory::sealed(serde_json::from_str(&text).unwrap()).unwrap()).unwrap();
    let (code, text) = ends(&folder, "check out/s --quiet");
    assert!(
        code == 1 && text.contains("a map has no file sells.csv") && !text.contains("--repair"),
        "{text}"
    );
}

/// A kill can leave incomplete files under temporary names.
#[test]
fn a_later_run_removes_the_incomplete_files_of_a_killed_one() {
    let folder = with(&format!("{SCENE}files = ['csv']\n"));
    map(&folder, &format!("{FEW} --quiet")).success();
    let files = names(&path(&folder, "out/s"));
    let incomplete =
        words("unfinished.json records.bin partial-records.bin list.csv cells.csv manifest.json");
    for run in ["--resume", "--force"] {
        for name in &incomplete {
            fs::write(path(&folder, "out/s").join(format!("partial-{name}")), "{").unwrap();
        }
        fs::write(path(&folder, "out/s/partial-notes.txt"), "the user's own").unwrap();
        map(&folder, &format!("{FEW} --quiet {run}")).success();
        fs::remove_file(path(&folder, "out/s/partial-notes.txt")).unwrap();
        assert_eq!(names(&path(&folder, "out/s")), files, "{run}");
    }
}

#[test]
fn a_limit_for_the_size_of_files_causes_a_message() {
    let folder = folder();
    let run = format!("map s.toml --engine cpu {FEW} --quiet");
    // The records are refused before the first cell, the figures after the motion.
    for (line, exit) in [(run.as_str(), 2), ("orbit --out o", 1)] {
        let (code, text) = limited(&folder, "ulimit -f 1", line);
        let is_said = text.contains("File too large") && text.contains("`ulimit -f`");
        assert!(code == exit && is_said, "{line}: {code} {text}");
    }
    succeeds(&folder, &format!("{run} --resume"));
}

#[test]
fn a_scene_named_dots_is_not_computed_into_the_folder_above() {
    let folder = folder();
    for name in ["...toml", "..toml"] {
        fs::copy(path(&folder, "s.toml"), path(&folder, name)).unwrap();
        succeeds(&folder, &format!("map ./{name} --engine cpu {FEW} --quiet --force"));
        assert!(path(&folder, "out").join(name).join("manifest.json").exists(), "{name}");
    }
    assert_eq!(names(folder.path()), ["...toml", "..toml", "out", "s.toml"]);
    assert_eq!(names(&path(&folder, "out")), ["...toml", "..toml"]);
}

/// A thread needs address space for its stack, whose size the variable sets.
#[cfg(target_os = "linux")]
#[test]
fn a_machine_that_starts_no_thread_causes_a_message() {
    let folder = folder();
    for line in ["map s.toml --engine cpu", "orbit", "check out/s"] {
        let (code, text) = limited(&folder, "export RUST_MIN_STACK=70368744177664", line);
        assert!(code == 1 && text.contains("error: cannot start a thread"), "{line}: {text}");
    }
    let (code, text) = limited(&folder, "export RUST_MIN_STACK=70368744177664", "models");
    assert!(code == 0 && text.is_empty(), "{text}");
    let (code, text) = limited(&folder, "export RAYON_NUM_THREADS=2000", "orbit");
    assert!(code == 1 && text.contains("RAYON_NUM_THREADS=2000: it must be at most 1024"), "{text}");
}

/// All cells share twenty oscillators and have no contact, so that each takes little time.
#[cfg(target_os = "linux")]
#[test]
fn further_cells_of_a_map_of_classes_take_little_memory() {
    let folder = folder();
    let line = "map s.toml --engine cpu --force --quiet --set outputs.quantities=['class'] --set outputs.files=['npy'] \
                --set parameters.F=1e-4 --set axis.1.count=20 --set integration.transient_periods=1 \
                --set integration.observed_periods=2 --set integration.max_period=1";
    let peak = |columns: usize| {
        let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"))
            .args(format!("{line} --set axis.0.count={columns}").split_whitespace())
            .env("RAYON_NUM_THREADS", "2")
            .current_dir(folder.path())
            .spawn()
            .unwrap();
        let status = format!("/proc/{}/status", run.id());
        let mut peak = 0;
        while run.try_wait().unwrap().is_none() {
            let text = fs::read_to_string(&status).unwrap_or_default();
            let size = text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.strip_suffix("kB"));
            peak = size.map_or(peak, |size| 1024 * size.trim().parse::<usize>().unwrap());
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(run.wait().unwrap().success());
        peak
    };
    let [few, many] = [4_000, 12_000];
    let bytes = (peak(many) - peak(few)) / (20 * (many - few));
    assert!(bytes < 64, "{bytes} bytes per cell");
}

#[cfg(target_os = "linux")]
#[test]
fn a_limit_for_memory_causes_a_message() {
    let folder = folder();
    let limit = "export RAYON_NUM_THREADS=1; ulimit -v 150000";
    let large = "map s.toml --engine cpu --set axis.0.count=2000 --set axis.1.count=2000";
    let (code, text) = limited(&folder, limit, large);
    assert!(
        code == 2 && text.contains("of memory, and") && text.contains("raise the limit (`ulimit -v`)"),
        "{text}"
    );
    let (code, text) = limited(&folder, "ulimit -v 1000000", "map s.toml --engine gpu");
    assert!(code == 2 && text.contains("graphics drivers need about 2.0 GB of address space"), "{text}");
    // Memory that no estimate contains: the text of a scene.
    fs::File::create(path(&folder, "s.toml")).unwrap().set_len(60_000_000).unwrap();
    let (code, text) =
        limited(&folder, "export RAYON_NUM_THREADS=1; ulimit -v 60000", "map s.toml --engine cpu");
    assert!(
        code == 1 && text.contains("error: the system refuses") && text.contains("`ulimit -v`"),
        "{text}"
    );
}

#[test]
fn explore_writes_only_plain_files() {
    let folder = folder();
    let explore = format!("explore s.toml {FEW} --no-open --quiet --out new/page.html");
    fs::create_dir(path(&folder, "new")).unwrap();
    for name in ["page.html", "partial-page.html"] {
        let place = path(&folder, "new").join(name);
        std::os::unix::fs::symlink("../s.toml", &place).unwrap();
        fails(
            &folder,
            &format!("{explore} --force"),
            2,
            &[&format!("{name} is a symbolic link"), "remove it"],
        );
        fs::remove_file(&place).unwrap();
        assert!(Process::new("mkfifo").arg(&place).status().unwrap().success());
        fails(&folder, &format!("{explore} --force"), 2, &[&format!("{name} is no plain file"), "remove it"]);
        fs::remove_file(place).unwrap();
    }
    assert_eq!(fs::read_to_string(path(&folder, "s.toml")).unwrap(), SCENE);
    fs::remove_dir(path(&folder, "new")).unwrap();
    succeeds(&folder, &explore);
    fails(&folder, "explore new --out x.html --no-open", 2, &["--set and --out are for a scene"]);
}

#[test]
fn the_message_about_a_failed_write_says_what_a_resumed_run_finds() {
    let folder = folder();
    let run = "map s.toml --engine cpu --set axis.0.count=60 --set axis.1.count=60 --quiet";
    let (code, text) = limited(&folder, "ulimit -f 20", run);
    let done = printed(&folder, &format!("{run} --resume --json"));
    let kept = done["resumed"]["runs"].as_u64().unwrap();
    assert!(
        code == 1 && kept < 3600 && text.contains(&format!("; {kept} of 3600 cells are kept; go on with")),
        "{kept}: {text}"
    );
}
