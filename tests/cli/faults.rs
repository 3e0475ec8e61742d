//! Failing drivers: the message says what happened, what is stored and how to continue; the exit code is 1; nothing panics.
//!
//! A Vulkan layer between the loader and the driver makes the Nth call of a function fail, see `faults/layer.c`.
//! `RATTLEMAP_TORTURE=N` tries N faults, spread over all calls of a run.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command as Process, Output};
use std::time::Duration;

use assert_cmd::Command;
use tempfile::TempDir;

/// A scene without exponents, whose shader Mesa compiles in half a second.
pub(crate) const SCENE: &str = r#"
axis = [
    { parameter = "e", min = 0.0, max = 1.0, count = 24 },
    { parameter = "omega", min = 4.0, max = 12.0, count = 24 },
]
[outputs]
quantities = ["impacts"]
files = ["csv"]
"#;

const RUN: [&str; 5] = ["map", "s.toml", "--quiet", "--engine", "gpu"];

/// Time limit of a run. One that exceeds it fails the test.
const LONGEST: Duration = Duration::from_secs(120);

// Values of `VkResult`.
const NO_HOST_MEMORY: i32 = -1;
const NO_MEMORY: i32 = -2;
const NOT_INITIALIZED: i32 = -3;
const LOST: i32 = -4;
const NOT_MAPPED: i32 = -5;

/// A function, the number of the first call that fails, and the result of failing calls.
type Fault<'a> = (&'a str, u32, i32);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Done,
    Failed,
}

/// Compiles the layer into a folder. Returns false and prints a line if there is no C compiler.
pub(crate) fn build_layer(path: &Path) -> bool {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/faults/layer.c");
    let mut compiler = Process::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-fvisibility=hidden", "-pthread", "-o"]);
    match compiler.arg(path.join("layer.so")).arg(source).status() {
        Ok(status) => assert!(status.success(), "the layer does not compile"),
        Err(_) => {
            // `eprintln!` would be captured.
            let mut stderr = std::io::stderr();
            writeln!(stderr, "SKIPPED: no C compiler to build the layer of faults with").unwrap();
            return false;
        }
    }
    let layer = serde_json::json!({
        "name": "VK_LAYER_RATTLEMAP_faults", "type": "GLOBAL", "library_path": path.join("layer.so"),
        "api_version": "1.3.0", "implementation_version": "1", "description": "calls that fail",
    });
    let manifest = serde_json::json!({ "file_format_version": "1.0.0", "layer": layer });
    fs::write(path.join("layer.json"), manifest.to_string()).unwrap();
    true
}

struct Bench {
    folder: TempDir,
}

impl Bench {
    /// Returns none if there is no C compiler.
    fn new() -> Option<Bench> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        if !build_layer(path) {
            return None;
        }
        fs::write(path.join("s.toml"), SCENE).unwrap();
        Some(Bench { folder })
    }

    /// Runs the program with the layer, which makes a call fail if there is a fault.
    fn run(&self, arguments: &[&str], fault: Option<Fault<'_>>) -> Output {
        self.run_with(&[], arguments, fault)
    }

    /// Like [`Bench::run`], with more environment variables.
    fn run_with(&self, more: &[(&str, &str)], arguments: &[&str], fault: Option<Fault<'_>>) -> Output {
        let path = self.folder.path();
        let mut command = Command::cargo_bin("rattlemap").unwrap();
        command.current_dir(path).args(arguments).timeout(LONGEST);
        command.env("VK_LAYER_PATH", path).env("VK_INSTANCE_LAYERS", "VK_LAYER_RATTLEMAP_faults");
        command.env("RATTLEMAP_CALLS", path.join("calls")).envs(more.iter().copied());
        if let Some((call, from, result)) = fault {
            command.env("RATTLEMAP_FAULT", format!("{call}:{from}:{result}"));
        }
        command.output().unwrap()
    }

    fn table(&self, out: &str) -> Vec<u8> {
        fs::read(self.folder.path().join(out).join("cells.csv")).unwrap()
    }

    /// Number of calls of each function in the last run.
    fn calls(&self) -> BTreeMap<String, u32> {
        let text = fs::read_to_string(self.folder.path().join("calls")).unwrap();
        let of = |line: &str| line.split_once(' ').map(|(name, n)| (name.to_owned(), n.parse().unwrap()));
        text.lines().filter_map(of).filter(|&(_, count)| count > 0).collect()
    }

    /// Runs a map with one fault after another, resuming it, and at last without a fault. Returns how each run ended, or the
    /// text of a panic.
    fn map(&self, faults: &[Fault<'_>], whole: &[u8]) -> Result<Vec<End>, String> {
        let run = [&RUN[..], &["--out", "cut", "--resume"]].concat();
        let mut ends = Vec::new();
        for fault in faults {
            let output = self.run(&run, Some(*fault));
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            let go_on =
                "of 576 cells are kept; go on with: rattlemap map s.toml --out cut --engine gpu --resume";
            match output.status.code() {
                _ if text.contains("panicked") => return Err(format!("{fault:?}: {text}")),
                Some(0) => ends.push(End::Done),
                Some(1) => {
                    assert!(text.starts_with("error: ") && text.contains(go_on), "{fault:?}: {text}");
                    ends.push(End::Failed);
                }
                // A signal, or the time limit.
                other => return Err(format!("{fault:?}: {other:?}: {text}")),
            }
        }
        if !ends.ends_with(&[End::Done]) {
            let rest = self.run(&run, None);
            assert!(rest.status.success(), "{faults:?}: {}", String::from_utf8_lossy(&rest.stderr));
        }
        assert!(self.table("cut") == whole, "{faults:?}: the table differs");
        fs::remove_dir_all(self.folder.path().join("cut")).unwrap();
        Ok(ends)
    }
}

/// Returns the text on stderr, and checks that it reports no panic.
fn said(output: &Output, fault: Fault<'_>) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!text.contains("panicked"), "{fault:?}: {text}");
    text
}

/// Returns faults spread over all calls of a run: each function in turn, at new calls in each round, with every result.
fn spread(calls: &BTreeMap<String, u32>, count: usize) -> Vec<Fault<'_>> {
    let results = [LOST, NO_MEMORY, NOT_INITIALIZED, NO_HOST_MEMORY, NOT_MAPPED];
    let names: Vec<_> = calls.iter().collect();
    let fault = |n: usize| {
        let (name, &calls) = names[n % names.len()];
        let round = n / names.len();
        // Multiples of the golden section are spread evenly.
        let place = (round as f64 * 0.618_033_988_75).fract();
        (name.as_str(), 1 + (place * f64::from(calls)) as u32, results[round % results.len()])
    };
    (0..count).map(fault).collect()
}

#[test]
#[ignore = "takes half a minute; scripts/test.sh --all"]
fn a_failing_driver_loses_no_cell_and_causes_no_panic() {
    let Some(bench) = Bench::new() else { return };
    let whole = bench.run(&[&RUN[..], &["--out", "whole"]].concat(), None);
    assert!(whole.status.success(), "{}", String::from_utf8_lossy(&whole.stderr));
    let (whole, calls) = (bench.table("whole"), bench.calls());
    let late = |call: &str| calls[call] * 4 / 5;
    // While a device is opened, while the first shader is compiled, and while lanes run.
    let chains = [
        vec![
            ("vkCreateDevice", 1, NOT_INITIALIZED),
            ("vkCreateComputePipelines", 1, NOT_INITIALIZED),
            ("vkCreateComputePipelines", 3, LOST),
            ("vkAllocateMemory", 1, NO_MEMORY),
            ("vkMapMemory", 1, NOT_MAPPED),
            ("vkAllocateCommandBuffers", calls["vkAllocateCommandBuffers"] / 2, NO_HOST_MEMORY),
            ("vkQueueSubmit", 2, LOST),
            ("vkQueueSubmit", late("vkQueueSubmit"), LOST),
        ],
        vec![("vkWaitSemaphores", late("vkWaitSemaphores"), LOST)],
        vec![("vkGetSemaphoreCounterValue", late("vkGetSemaphoreCounterValue"), LOST)],
    ];
    for faults in &chains {
        assert_eq!(bench.map(faults, &whole), Ok(vec![End::Failed; faults.len()]), "{faults:?}");
    }
    // A failure while the device is closed has no effect.
    assert_eq!(bench.map(&[("vkQueueWaitIdle", 1, NO_MEMORY)], &whole), Ok(vec![End::Done]));
    let more = std::env::var("RATTLEMAP_TORTURE").ok().and_then(|n| n.parse().ok()).unwrap_or(0);
    let panics: Vec<String> =
        spread(&calls, more).into_iter().filter_map(|fault| bench.map(&[fault], &whole).err()).collect();
    // A script reads this line; `println!` would be captured.
    let faults = chains.iter().map(Vec::len).sum::<usize>() + 1 + more;
    let mut stdout = std::io::stdout();
    writeln!(stdout, "torture: faults {faults}, panics {}", panics.len()).unwrap();
    assert!(panics.is_empty(), "{}", panics.join("\n"));
}

#[test]
fn every_command_survives_a_lost_device() {
    let Some(bench) = Bench::new() else { return };
    let made = bench.run(&[&RUN[..], &["--set", "axis.1.count=4"]].concat(), None);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    // If the request leaves the engine open, the message gives the command for the CPU engine. An adapter selects lanes.
    let fault = ("vkQueueSubmit", bench.calls()["vkQueueSubmit"] * 4 / 5, LOST);
    let auto = ["map", "s.toml", "--out", "auto", "--set", "axis.1.count=4", "--adapter", "0"];
    let lost = bench.run(&auto, Some(fault));
    let text = said(&lost, fault);
    let anew = "the CPU engine can compute the map, too, from its first cell: rattlemap map s.toml --out auto \
                --engine cpu --set axis.1.count=4 --force";
    assert!(lost.status.code() == Some(1) && text.contains("was lost") && text.contains(anew), "{text}");
    let fault = ("vkQueueSubmit", 2, LOST);
    let validated = bench.run(&["validate", "out/s", "--samples", "8"], Some(fault));
    let text = said(&validated, fault);
    assert!(validated.status.code() == Some(1) && text.contains("lost"), "{text}");
    let devices = bench.run(&["devices"], Some(("vkCreateDevice", 1, NOT_INITIALIZED)));
    assert!(devices.status.success(), "{}", said(&devices, fault));
    let fault = ("vkCreateComputePipelines", 3, LOST);
    let measured = bench.run(&["bench", "engines", "--quick"], Some(fault));
    let text = said(&measured, fault);
    assert!(measured.status.success() && text.contains("is left out: ") && text.contains("lost"), "{text}");
}

/// Without its cache the driver compiles shaders in a thread of its own while the next submit fails.
#[test]
fn the_process_ends_after_the_work_of_a_device_whose_submit_fails() {
    let Some(bench) = Bench::new() else { return };
    let slow = [("MESA_SHADER_CACHE_DISABLE", "true"), ("RATTLEMAP_LINGER", "1")];
    for submit in [2, 3] {
        let fault = ("vkQueueSubmit", submit, NO_MEMORY);
        let failed = bench.run_with(&slow, &RUN, Some(fault));
        let text = said(&failed, fault);
        assert!(failed.status.code() == Some(1) && text.contains("was lost"), "{:?}: {text}", failed.status);
    }
}
