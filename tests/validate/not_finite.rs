//! A validation must report every number of a record that is not finite.

use std::fs;

use crate::validate::fixtures::{
    cpu_identity, cpu_records, read_records, unexplained, validate_all, validate_runs,
};
use assert_cmd::Command;
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::{Record, valid};
use rattlemap::store::record_file::{RECORDS, RecordFile};
use rattlemap::validate::{Difference, Subject};

const SCENE: &str = r#"axis = [
    { parameter = "e", min = 0.3, max = 0.9, count = 6 },
    { parameter = "omega", min = 2.0, max = 6.0, count = 6 },
]
[integration]
transient_periods = 120

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"]
files = ["csv"]
"#;

type Field = fn(&mut Record) -> &mut f64;

const FIELDS: [(&str, Field); 8] = [
    ("lyapunov", |record| &mut record.lyapunov),
    ("lyapunov_error", |record| &mut record.lyapunov_error),
    ("impacts_per_period", |record| &mut record.impacts_per_period),
    ("mesh_fraction", |record| &mut record.mesh_fraction),
    ("x1", |record| &mut record.strobe[0]),
    ("v1", |record| &mut record.strobe[1]),
    ("x2", |record| &mut record.strobe[2]),
    ("v2", |record| &mut record.strobe[3]),
];

fn scene() -> Scene {
    Scene::parse(SCENE, "s", &[], Purpose::Map).unwrap()
}

/// Puts each such value into each field of one cycle and one other motion. No device recomputes the record.
#[test]
fn a_number_that_is_not_finite_is_found_in_every_field() {
    let plan = Plan::new(&scene());
    let right = cpu_records(&plan);
    let all = valid::LYAPUNOV | valid::IMPACTS | valid::MESH | valid::STROBE;
    let of = |is_cycle: bool| {
        let fits = |record: &&Record| record.valid & all == all && (record.period > 0) == is_cycle;
        right.iter().position(|record| fits(&record)).unwrap()
    };
    for (id, is_cycle) in [true, false].map(|is_cycle| (of(is_cycle), is_cycle)) {
        for (name, field) in FIELDS {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                // Minus infinity is the exponent of a superstable cycle. This cycle is not superstable, so it differs.
                let is_answer = is_cycle && name == "lyapunov" && value == f64::NEG_INFINITY;
                let mut records = right.clone();
                *field(&mut records[id]) = value;
                for (precision, is_lane) in
                    [(Precision::F32, true), (Precision::F64, true), (Precision::F64, false)]
                {
                    let subject = Subject { plan: &plan, records: &records, precision, is_lane };
                    let found = validate_runs(&subject, vec![id as u32]);
                    let at = format!("{name} = {value}, cycle {is_cycle}, {precision:?}, lane {is_lane}");
                    assert_eq!(unexplained(&found), [id as u32], "{at}: {:?}", found.mismatches);
                    assert!(!found.faults().is_empty(), "{at}");
                    assert_eq!(found.not_finite.is_empty(), is_answer, "{at}");
                    let record = |difference: &Difference| format!("{:?}", difference.record);
                    let differences: Vec<_> = found.mismatches[0].differences.iter().map(record).collect();
                    let text = if is_answer { "-inf".to_owned() } else { format!("{name} = {value}") };
                    assert!(differences.iter().any(|d| d.contains(&text)), "{at}: {differences:?}");
                }
            }
        }
    }
}

#[test]
fn a_number_that_is_not_finite_is_found_outside_the_sample() {
    let plan = Plan::new(&scene());
    let mut records = cpu_records(&plan);
    let faults = |records: &[Record]| {
        let subject = Subject { plan: &plan, records: &records, precision: Precision::F64, is_lane: true };
        validate_runs(&subject, vec![0, 1]).faults()
    };
    assert_eq!(faults(&records), Vec::<String>::new());
    assert!(validate_all(&plan, &records, Precision::F64, true).not_finite.is_empty());
    records[35].strobe[2] = f64::NAN;
    assert_eq!(faults(&records), ["1 of 36 cells hold numbers that are not finite"]);
    records[35].valid &= !valid::STROBE;
    assert_eq!(faults(&records), Vec::<String>::new(), "the record has no valid state");
}

/// All states of the map are NaN. The command reports them and counts no record as reproduced.
#[test]
fn the_command_fails_for_a_map_of_states_that_are_not_numbers() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SCENE).unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::cargo_bin("rattlemap").unwrap();
        // A device would only cost time, for compiling its shaders.
        command.env("WGPU_ADAPTER_NAME", "no such thing");
        command.current_dir(folder.path()).args(arguments).assert()
    };
    run(&["map", "s.toml", "--engine", "cpu", "--out", "o", "--quiet"]).success();
    let (path, identity) = (folder.path().join("o").join(RECORDS), cpu_identity(&scene()));
    let mut records = read_records(&path, &identity);
    records.iter_mut().for_each(|(_, record)| record.strobe = [f64::NAN; 4].into());
    RecordFile::create(&path, &identity).unwrap().append(&records).unwrap();
    let failed = run(&["validate", "o", "--samples", "4", "--quiet"]).code(1).stdout("");
    let message = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
    assert!(message.contains("36 of 36 cells hold numbers that are not finite"), "{message}");
    assert!(message.contains("all such cells: (0, 0) (1, 0)"), "{message}");
    let written = fs::read(folder.path().join("o/validation.json")).unwrap();
    let found: serde_json::Value = serde_json::from_slice(&written).unwrap();
    assert_eq!(found["not_finite"].as_array().unwrap().len(), 36);
    assert_eq!(found["identical"], 0);
}
