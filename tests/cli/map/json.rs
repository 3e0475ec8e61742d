//! `map --json`: one object on stdout. Scripts depend on its fields.

use super::*;
use crate::common::keys;

#[test]
fn json_describes_a_map() {
    let folder = folder();
    let summary = printed(&folder, &format!("map s.toml --engine cpu {FEW} --json"));
    let fields = "cells classes device engine files folder periods precision refinement resumed runs seconds statuses \
         without_effect";
    assert_eq!(keys(&summary), fields);
    let out = folder.path().join("out/s");
    let manifest = json(&out.join("manifest.json"));
    for field in words("cells classes device engine periods precision statuses without_effect") {
        assert_eq!(summary[field], manifest[field], "{field}");
    }
    assert_eq!((&summary["folder"], &summary["runs"]), (&"out/s".into(), &12.into()));
    let classes = summary["classes"].as_object().unwrap();
    assert_eq!(classes.values().map(|count| count.as_u64().unwrap()).sum::<u64>(), 12);
    for file in summary["files"].as_array().unwrap() {
        assert!(out.join(file.as_str().unwrap()).is_file(), "{file}");
    }
    assert_eq!(summary["resumed"], serde_json::json!({ "runs": 0, "seconds": 0.0 }));
    assert_eq!(keys(&summary["seconds"]), "integrate open write");
    let again = printed(&folder, &format!("map s.toml --engine cpu {FEW} --json --resume --quiet"));
    assert_eq!(again["resumed"]["runs"], 12);
    assert_eq!(again["resumed"]["seconds"], summary["seconds"]["integrate"]);
    assert_eq!(again["classes"], summary["classes"]);
}

#[test]
fn json_describes_a_map_whose_cells_all_failed() {
    let folder = folder();
    let run = map(&folder, &format!("{STIFF} --set axis.0.count=2 --json --quiet")).code(1);
    let summary: serde_json::Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!((&summary["classes"]["failed"], &summary["statuses"]["too_stiff"]), (&4.into(), &4.into()));
}
