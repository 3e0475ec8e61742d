//! `map --json`: one object on stdout, its fields a contract.

use super::*;

fn keys(object: &serde_json::Value) -> String {
    let mut keys: Vec<&str> = object.as_object().expect("an object").keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys.join(" ")
}

fn printed(folder: &TempDir, arguments: &[&str]) -> serde_json::Value {
    let few = ["--set", "axis.0.count=4", "--set", "axis.1.count=3", "--json"];
    let run = map(folder, &[&few[..], arguments].concat()).success();
    serde_json::from_slice(&run.get_output().stdout).expect("one JSON object and nothing else")
}

#[test]
fn json_says_what_a_map_came_to() {
    let folder = folder();
    let summary = printed(&folder, &["--engine", "cpu"]);
    let fields = "cells classes device engine files folder periods precision refinement resumed runs seconds statuses \
         without_effect";
    assert_eq!(keys(&summary), fields);
    let manifest: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("out/s/manifest.json")).unwrap())
            .unwrap();
    for field in
        ["cells", "classes", "device", "engine", "periods", "precision", "statuses", "without_effect"]
    {
        assert_eq!(summary[field], manifest[field], "{field}");
    }
    assert_eq!((&summary["folder"], &summary["runs"]), (&"out/s".into(), &12.into()));
    let count: u64 =
        summary["classes"].as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(count, 12);
    for file in summary["files"].as_array().unwrap() {
        assert!(folder.path().join("out/s").join(file.as_str().unwrap()).is_file(), "{file}");
    }
    assert_eq!(summary["resumed"], serde_json::json!({ "runs": 0, "seconds": 0.0 }));
    assert_eq!(keys(&summary["seconds"]), "integrate open write");
    let again = printed(&folder, &["--resume", "--quiet"]);
    assert_eq!(again["resumed"]["runs"], 12);
    assert_eq!(again["resumed"]["seconds"], summary["seconds"]["integrate"]);
    assert_eq!(again["classes"], summary["classes"]);
}

/// Each cell of which says why.
#[test]
fn a_map_that_failed_is_summed_up_too() {
    let folder = folder();
    let stiff = ["--set", "parameters.m1=2e-6", "--set", "axis.1.min=0.003", "--set", "axis.1.max=0.004"];
    let few = ["--set", "integration.transient_periods=2", "--set", "integration.observed_periods=4"];
    let small = ["--set", "axis.0.count=2", "--set", "axis.1.count=2", "--set", "integration.max_period=1"];
    let run = map(&folder, &[&stiff[..], &few, &small, &["--json", "--quiet"]].concat()).code(1);
    let summary: serde_json::Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(summary["classes"]["failed"], 4);
    assert_eq!(summary["statuses"]["too_stiff"], 4);
}
