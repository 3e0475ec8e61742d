//! Engines write the same files, and `auto` chooses one.

use super::*;

#[test]
fn lanes_give_the_same_files_and_classes() {
    check_lanes(&["f32"]);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn lanes_in_double_precision_give_the_same_files_and_classes() {
    check_lanes(&["f32", "f64"]);
}

fn check_lanes(precisions: &[&str]) {
    let folder = folder();
    map(&folder, "--quiet --out cpu").success();
    let (header, expected) = rows(&folder.path().join("cpu/cells.csv"));
    for precision in precisions {
        let out = folder.path().join(precision);
        let run = map(&folder, &format!("--engine gpu --precision {precision} --out {precision}"));
        run.success().stdout("").stderr(says(&[
            "320 cells in ",
            &format!(" s on gpu ({precision}): "),
            "forcing periods/s",
            "ns per step",
        ]));
        assert_eq!(names(&out), names(&folder.path().join("cpu")));
        let (lanes_header, lanes) = rows(&out.join("cells.csv"));
        assert_eq!(lanes_header, format!("{header},finished"));
        lanes.iter().enumerate().for_each(|(id, row)| check_row(id, row));
        // Class and period; the few that differ are explained elsewhere, cell by cell.
        let differing = lanes.iter().zip(&expected).filter(|(a, b)| a[4..6] != b[4..6]).count();
        assert!(differing <= 6, "{precision}: {differing} cells differ");
        let manifest = json(&out.join("manifest.json"));
        assert_eq!((&manifest["engine"], &manifest["precision"]), (&"gpu".into(), &(*precision).into()));
        let integration = &manifest["integration"];
        let [least, most] =
            ["least_steps_used", "most_steps_used"].map(|name| integration[name].as_u64().unwrap());
        assert!(integration["steps_per_period"].is_null() && least >= 8 && most > least, "{integration}");
        let device = manifest["device"].as_str().unwrap();
        assert!(device.contains('(') && device.contains(';'), "no driver in {device}");
    }
    // A run does not resume with another engine or precision.
    let other = |engine: &str, parts: &[&str]| {
        fails(&folder, &format!("map s.toml --engine {engine} --out f32 --resume"), 2, parts);
    };
    other("gpu --precision f64", &["`precision` was f32, now f64", "--force"]);
    other("cpu", &["`engine` was gpu, now cpu"]);
}

#[test]
fn engines_that_are_not_there_are_refused() {
    let folder = folder();
    let parts = ["--precision f32", "the CPU engine computes in f64", "--engine gpu"];
    fails(&folder, "map s.toml --engine cpu --precision f32", 2, &parts);
    let parts = ["--precision", "it must be f32 or f64"];
    fails(&folder, "map s.toml --engine gpu --precision f16", 2, &parts);
    for precision in ["f32", "f64"] {
        let mut run = command(&folder, &format!("map s.toml --engine gpu --precision {precision}"));
        let run = run.env("WGPU_ADAPTER_NAME", "no such thing").assert();
        let list = "Found: ";
        run.code(2).stdout("").stderr(says(&["no graphics adapter called no such thing", "(f32", list]));
    }
}

#[test]
fn devices_says_what_there_is_and_what_auto_takes() {
    let folder = folder();
    succeeds(&folder, "devices").stdout(says(&[
        "cpu: event-driven reference",
        "gpu: ",
        "interface   ",
        "precision   f32",
        "batch       up to",
        "auto chooses ",
    ]));
    let hardware = || says(&["the processor is faster"]);
    let run = map(&folder, "--engine auto --out few");
    run.success().stderr(says(&["cpu (f64): no hardware GPU; using the processor"]).or(hardware()));
}

/// The manifest has both the requested number and the numbers in use.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn too_few_steps_are_raised_with_a_message() {
    let folder = folder();
    let steps = |engine: &str, steps: u32, out: &str| {
        let sets = format!("{FEW} --set integration.steps_per_period={steps}");
        let run = map(&folder, &format!("--engine {engine} --out {out} {sets}")).success();
        let manifest = json(&folder.path().join(out).join("manifest.json"));
        (String::from_utf8_lossy(&run.get_output().stderr).into_owned(), manifest["integration"].clone())
    };
    let (said, integration) = steps("gpu", 1, "few");
    let [least, most] =
        ["least_steps_used", "most_steps_used"].map(|name| integration[name].as_u64().unwrap());
    assert_eq!(integration["steps_per_period"], 1);
    assert!(8 <= least && least < most, "{integration}");
    let raised = format!("integration.steps_per_period = 1 is raised to {least} to {most}: ");
    assert!(said.contains(&raised), "{said}");
    let (said, integration) = steps("gpu", 400, "many");
    assert_eq!(
        (&integration["least_steps_used"], &integration["most_steps_used"]),
        (&400.into(), &400.into())
    );
    assert!(!said.contains("raised"), "{said}");
    let (said, integration) = steps("cpu", 1, "cpu");
    assert!(integration["most_steps_used"].is_null() && !said.contains("raised"), "{integration} {said}");
}

#[test]
fn an_environment_that_leaves_no_adapter_is_named() {
    let folder = folder();
    let refused = |variable: &str, value: &str, remedy: &str| {
        let mut run = command(&folder, "map s.toml --engine gpu");
        let set = format!("the environment has {variable}={value}: unset it, or give {remedy}");
        run.env(variable, value).assert().code(2).stderr(says(&[&set]));
    };
    refused("WGPU_BACKEND", "foo", "vulkan, metal or dx12");
    refused("WGPU_BACKEND", "gl", "vulkan, metal or dx12");
    refused("WGPU_ADAPTER_NAME", "no such thing", "part of a name");
    let mut devices = command(&folder, "devices");
    devices
        .env("WGPU_BACKEND", "foo")
        .assert()
        .success()
        .stdout(says(&["WGPU_BACKEND=foo", "auto chooses cpu"]));
}
