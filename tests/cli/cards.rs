//! Several cards: numbers and names, a map by all of them, and a card that is lost.
//!
//! Mesa's software driver is given to the loader twice: two adapters of one name.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use assert_cmd::Command;
use rattlemap::store::record_file::{Identity, Order, RecordFile};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::says;
use crate::faults::{SCENE, build_layer};

/// Folders with lists of Vulkan drivers.
const DRIVERS: [&str; 3] = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"];

const GPU: [&str; 5] = ["map", "s.toml", "--quiet", "--engine", "gpu"];

/// The processor, on which both cards compute. Tests with a limit of time fail if another test with cards runs beside them.
static PROCESSOR: Mutex<()> = Mutex::new(());

/// A machine with two cards.
struct Oscillator {
    folder: TempDir,
    drivers: String,
    _processor: MutexGuard<'static, ()>,
}

impl Oscillator {
    /// Returns none and prints a line if there is no software driver.
    fn new() -> Option<Oscillator> {
        let Some(driver) = software_driver() else {
            // `eprintln!` would be captured.
            let mut stderr = std::io::stderr();
            writeln!(stderr, "SKIPPED: no lavapipe").unwrap();
            return None;
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        fs::write(path.join("s.toml"), SCENE).unwrap();
        let copy = |name: &str| {
            let copy = path.join(name);
            fs::copy(&driver, &copy).unwrap();
            copy.display().to_string()
        };
        let drivers = ["one.json", "two.json"].map(copy).join(":");
        let processor = PROCESSOR.lock().unwrap_or_else(PoisonError::into_inner);
        Some(Oscillator { folder, drivers, _processor: processor })
    }

    fn environment(&self) -> [(&'static str, &str); 2] {
        [("VK_DRIVER_FILES", &self.drivers), ("VK_ICD_FILENAMES", &self.drivers)]
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::cargo_bin("rattlemap").unwrap();
        command.current_dir(self.folder.path()).args(arguments).timeout(Duration::from_secs(120));
        command.envs(self.environment()).env_remove("WGPU_ADAPTER_NAME").env_remove("WGPU_BACKEND");
        command
    }

    /// A map in the folder `out`.
    fn map(&self, out: &str, arguments: &[&str]) -> Command {
        self.command(&[&GPU, arguments, &["--out", out]].concat())
    }

    /// A map with a layer that makes calls fail. The layer writes the number of calls of each function to `calls`.
    fn failing_map(&self, out: &str, arguments: &[&str], fault: &str) -> Command {
        let path = self.folder.path();
        let mut command = self.map(out, arguments);
        command.env("VK_LAYER_PATH", path).env("VK_INSTANCE_LAYERS", "VK_LAYER_RATTLEMAP_faults");
        command.env("RATTLEMAP_CALLS", path.join("calls")).env("RATTLEMAP_FAULT", fault);
        command
    }

    fn submissions(&self) -> u32 {
        let text = fs::read_to_string(self.folder.path().join("calls")).unwrap();
        text.lines().find_map(|line| line.strip_prefix("vkQueueSubmit ")?.parse().ok()).unwrap()
    }

    fn file(&self, out: &str, name: &str) -> PathBuf {
        self.folder.path().join(out).join(name)
    }

    fn manifest(&self, out: &str) -> Value {
        serde_json::from_str(&fs::read_to_string(self.file(out, "manifest.json")).unwrap()).unwrap()
    }

    fn table(&self, out: &str) -> Vec<u8> {
        fs::read(self.file(out, "cells.csv")).unwrap()
    }

    /// Records by cell.
    fn records(&self, out: &str) -> BTreeMap<u32, String> {
        let path = self.file(out, "records.bin");
        let identity = Identity::read(&path).unwrap().unwrap();
        let mut all = BTreeMap::new();
        RecordFile::read(&path, &identity, Order::Any, |batch| {
            all.extend(batch.iter().map(|(id, record)| (*id, format!("{record:?}"))));
            true
        })
        .unwrap();
        all
    }

    /// Number of cells that each card computed, and why it was lost.
    fn cards(&self, out: &str) -> Vec<(u64, Option<String>)> {
        let manifest = self.manifest(out);
        let cards = manifest["cards"].as_array().unwrap();
        for (number, card) in cards.iter().enumerate() {
            assert!(card["number"] == number && card["pci"].is_null(), "{card}");
            assert!(card["name"].as_str().unwrap().contains("llvmpipe"), "{card}");
        }
        let of = |card: &Value| (card["cells"].as_u64().unwrap(), card["lost"].as_str().map(str::to_owned));
        cards.iter().map(of).collect()
    }
}

fn software_driver() -> Option<PathBuf> {
    let files = DRIVERS.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let is_software =
        |path: &Path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("lvp_"));
    files.map(|entry| entry.path()).find(|path| is_software(path))
}

#[test]
fn equal_cards_are_selected_by_number() {
    let Some(machine) = Oscillator::new() else { return };
    machine
        .command(&["devices"])
        .assert()
        .success()
        .stdout(says(&["number      0 (--adapter 0)\n", "number      1 (--adapter 1)\n"]));
    let refused = |arguments: &[&str], parts: &[&str]| {
        machine.map("no", arguments).assert().code(2).stdout("").stderr(says(parts));
        assert!(!machine.file("no", "records.bin").exists());
    };
    refused(
        &["--adapter", "2"],
        &["no adapter has this number; the adapters are: 0 (llvmpipe", ", 1 (llvmpipe"],
    );
    refused(
        &["--adapter", "llvm"],
        &["more than one adapter", "give a number: 0 (llvmpipe", ", 1 (llvmpipe"],
    );
    refused(
        &["--adapter", "radeon"],
        &["--adapter radeon: no adapter's name", "the adapters are: 0 (llvmpipe"],
    );
    refused(&["--adapter", " "], &["a number or part of a name that `rattlemap devices` lists, or all"]);
    let cpu = machine.command(&["map", "s.toml", "--engine", "cpu", "--adapter", "0"]).assert();
    cpu.code(2).stderr(says(&["--adapter 0: the CPU engine uses no graphics adapter"]));
    // `auto` uses no software driver, and the CPU engine has no f32.
    let auto = machine.command(&["map", "s.toml", "--precision", "f32"]).assert();
    auto.code(2).stderr(says(&["--precision f32: there is no hardware GPU", "--engine gpu"]));
    // The option takes precedence over the environment.
    let few = ["--set", "axis.0.count=4", "--set", "axis.1.count=3", "--json", "--adapter", "1"];
    let run = machine.map("one", &few).env("WGPU_ADAPTER_NAME", "no such thing").assert().success();
    let summary: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let manifest = machine.manifest("one");
    for object in [&summary, &manifest] {
        assert_eq!(object["adapter"], serde_json::json!({ "number": 1, "pci": null }));
        assert!(object.get("cards").is_none() && !object["device"].as_str().unwrap().contains("adapter"));
    }
}

#[test]
fn all_cards_compute_the_same_map_as_one() {
    let Some(machine) = Oscillator::new() else { return };
    machine.map("one", &["--adapter", "1"]).assert().success();
    // `auto` takes an adapter that is named.
    let auto = ["map", "s.toml", "--adapter", "all", "--out", "all", "--json"];
    let run = machine.command(&auto).assert().success();
    let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    assert!(
        said.contains("gpu (f32): --adapter names it") && said.contains("\n  adapter 1 (llvmpipe"),
        "{said}"
    );
    assert!(machine.table("all") == machine.table("one"));
    assert_eq!(machine.records("all"), machine.records("one"));
    let cards = machine.cards("all");
    assert_eq!(cards.iter().map(|(cells, _)| cells).sum::<u64>(), 576);
    assert!(cards.len() == 2 && cards.iter().all(|(cells, lost)| *cells > 50 && lost.is_none()), "{cards:?}");
    let summary: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let manifest = machine.manifest("all");
    assert_eq!(summary["cards"], manifest["cards"]);
    assert!(manifest.get("adapter").is_none() && manifest["device"] == machine.manifest("one")["device"]);
}

#[test]
fn the_cells_of_a_lost_card_go_to_the_other() {
    let Some(machine) = Oscillator::new() else { return };
    if !build_layer(machine.folder.path()) {
        return;
    }
    let all = ["--adapter", "all"];
    machine.failing_map("whole", &all, "").assert().success();
    let (whole, calls) = (machine.table("whole"), machine.submissions());
    // Half of the submissions of one card.
    let lost =
        machine.failing_map("cut", &all, &format!("vkQueueSubmit:{}:-4:2", calls / 4)).assert().success();
    let said = String::from_utf8_lossy(&lost.get_output().stderr).into_owned();
    let warnings = said.lines().filter(|line| line.starts_with("warning: adapter ")).count();
    assert!(
        warnings == 1 && said.contains(" was lost (") && said.contains(" cells go back to the queue"),
        "{said}"
    );
    assert!(machine.table("cut") == whole && !said.contains("panicked"), "{said}");
    let cards = machine.cards("cut");
    assert_eq!(cards.iter().map(|(cells, _)| cells).sum::<u64>(), 576);
    assert_eq!(cards.iter().filter(|(_, lost)| lost.is_some()).count(), 1, "{cards:?}");
    // If both cards are lost the run ends, and another card can resume it.
    let fault = format!("vkQueueSubmit:{}:-4", calls / 2);
    let gone = machine.failing_map("gone", &all, &fault).assert().code(1);
    let said = String::from_utf8_lossy(&gone.get_output().stderr).into_owned();
    let go_on = "of 576 cells are kept; go on with: rattlemap map s.toml --out gone --engine gpu --adapter all --resume";
    assert!(said.contains("error: ") && said.contains(go_on) && !said.contains("panicked"), "{said}");
    machine.map("gone", &["--adapter", "0", "--resume"]).assert().success();
    assert!(machine.table("gone") == whole);
    // If one card cannot be opened, the other one computes the map.
    let alone = machine.failing_map("alone", &all, "vkCreateDevice:2:-3").assert().success();
    let said = String::from_utf8_lossy(&alone.get_output().stderr).into_owned();
    assert!(said.contains("warning: adapter ") && said.contains(" is left out: "), "{said}");
    assert!(machine.manifest("alone").get("cards").is_none() && machine.table("alone") == whole);
}

/// The script measures several cards only where there are some.
#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn all_cards_are_measured_against_one() {
    let Some(machine) = Oscillator::new() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/measure_gpu.sh");
    let mut run = Process::new(script);
    run.arg(assert_cmd::cargo::cargo_bin("rattlemap")).arg(machine.folder.path().join("measured"));
    run.args(["8", "cards"]).envs(machine.environment());
    run.env("WGPU_ADAPTER_NAME", "llvmpipe").env("PRECISIONS", "f32").env("MEASURE_SECONDS", "800");
    let output = run.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = fs::read_to_string(machine.file("measured", "speed.csv")).unwrap();
    let row =
        table.lines().find(|line| line.starts_with("cards,f32,1,")).unwrap_or_else(|| panic!("{table}"));
    assert_eq!(row.split(',').nth(4), Some("64"), "{row}");
}

#[test]
fn an_interrupted_map_of_several_cards_can_be_resumed() {
    let Some(machine) = Oscillator::new() else { return };
    let slow = ["--set", "integration.early_stop=false"];
    let mut run = Process::new(assert_cmd::cargo::cargo_bin("rattlemap"));
    run.current_dir(machine.folder.path()).envs(machine.environment()).env_remove("WGPU_ADAPTER_NAME");
    run.args(GPU).args(slow).args(["--adapter", "all", "--out", "cut"]).stderr(Stdio::piped());
    let run = run.spawn().unwrap();
    let clock = Instant::now();
    let stored = || fs::metadata(machine.file("cut", "records.bin")).map_or(0, |data| data.len());
    // The file grows beyond its header.
    let mut header = 0;
    while (header == 0 || stored() <= header) && clock.elapsed() < Duration::from_secs(60) {
        header = if header == 0 { stored() } else { header };
        std::thread::sleep(Duration::from_millis(20));
    }
    let clock = Instant::now();
    Process::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap();
    let ended = run.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(130), "{said}");
    assert!(clock.elapsed() < Duration::from_secs(3), "{:?}: {said}", clock.elapsed());
    assert!(!machine.records("cut").is_empty());
    machine.map("cut", &[&slow[..], &["--adapter", "1", "--resume"]].concat()).assert().success();
    machine.map("one", &slow).assert().success();
    assert!(machine.table("cut") == machine.table("one"));
    assert_eq!(machine.records("cut"), machine.records("one"));
}
