//! Several cards: numbers and names, and a map of which each card computes a shard.
//!
//! Mesa's software driver is given to the loader twice: two adapters of one name.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Output};
use std::time::Duration;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{json, says};
use crate::faults::{SCENE, build_layer};

/// Folders with lists of Vulkan drivers.
const DRIVERS: [&str; 3] = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"];

/// A machine with two cards.
struct Machine {
    folder: TempDir,
    drivers: String,
}

impl Machine {
    /// Returns none and prints a line if there is no software driver.
    fn new() -> Option<Machine> {
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
        Some(Machine { folder, drivers })
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

    /// A map on lanes in the folder `out`.
    fn map(&self, out: &str, arguments: &[&str]) -> Command {
        let lanes = ["map", "s.toml", "--quiet", "--engine", "gpu", "--out", out];
        self.command(&[&lanes, arguments].concat())
    }

    /// Runs the job file of docs/clusters.md. With a fault, each process loses its card.
    fn job(&self, fault: Option<&str>) -> Output {
        let path = self.folder.path();
        let document = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/clusters.md");
        let document = fs::read_to_string(document).unwrap();
        let (_, job) = document.split_once("```sh\n#!/bin/sh\n").unwrap();
        let job = job.split_once("```").unwrap().0.replace("scenes/e_omega.toml", "s.toml");
        let program = assert_cmd::cargo::cargo_bin("rattlemap");
        let mut run = Process::new("sh");
        run.current_dir(path).envs(self.environment()).args(["-c", &job]);
        run.env(
            "PATH",
            format!("{}:{}", program.parent().unwrap().display(), std::env::var("PATH").unwrap()),
        );
        if let Some(fault) = fault {
            run.env("VK_LAYER_PATH", path).env("VK_INSTANCE_LAYERS", "VK_LAYER_RATTLEMAP_faults");
            run.env("RATTLEMAP_FAULT", fault);
        }
        run.output().unwrap()
    }

    fn file(&self, out: &str, name: &str) -> PathBuf {
        self.folder.path().join(out).join(name)
    }

    fn manifest(&self, out: &str) -> Value {
        json(&self.file(out, "manifest.json"))
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
    let Some(machine) = Machine::new() else { return };
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
    refused(&["--adapter", " "], &["a number or part of a name that `rattlemap devices` lists"]);
    refused(&["--adapter", "all"], &["one process computes on one adapter", "--shard 1/2 --adapter 0"]);
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
        assert!(!object["device"].as_str().unwrap().contains("adapter"));
    }
}

/// A lost card costs its shard: the job ends with an error, and the same job finishes the map.
#[test]
fn each_card_computes_a_shard_and_a_lost_card_loses_nothing_else() {
    let Some(machine) = Machine::new() else { return };
    if build_layer(machine.folder.path()) {
        let lost = machine.job(Some("vkQueueSubmit:2:-4"));
        let said = String::from_utf8_lossy(&lost.stderr);
        assert!(!lost.status.success() && !said.contains("panicked"), "{said}");
        for (shard, adapter) in [(1, 0), (2, 1)] {
            let go_on = format!(
                "--out out/e_omega.shard-{shard}-of-2 --engine gpu --shard {shard}/2 --adapter {adapter} --resume"
            );
            assert!(said.contains(&go_on), "{said}");
        }
        assert!(!machine.file("out/e_omega", "").exists());
    }
    let whole = machine.job(None);
    assert!(whole.status.success(), "{whole:?}");
    machine.map("one", &["--adapter", "1"]).assert().success();
    let table = |out: &str| fs::read(machine.file(out, "cells.csv")).unwrap();
    assert!(table("out/e_omega") == table("one"));
    for (shard, adapter) in [(1, 0), (2, 1)] {
        let manifest = machine.manifest(&format!("out/e_omega.shard-{shard}-of-2"));
        assert_eq!(manifest["adapter"]["number"], adapter);
    }
}
