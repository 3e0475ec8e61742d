//! Numbers that are not finite pass no comparison, whatever they stand in.

use std::fs;

use crate::computed::computed;
use crate::judged::{only, unexplained, validated};
use assert_cmd::Command;
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::{Record, valid};
use rattlemap::store::record_file::{Identity, Order, RECORDS, RecordFile};
use rattlemap::validate::{Lanes, Subject, replay};

const SCENE: &str = r#"[[axis]]
parameter = "e"
min = 0.3
max = 0.9
count = 6

[[axis]]
parameter = "omega"
min = 2.0
max = 6.0
count = 6

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

/// The three values in each field of cycles and of everything else, one record at a time: of a map of lanes and of the
/// reference, without a device that could tell that the record is not its own.
#[test]
fn one_number_that_is_not_finite_is_found_in_every_field() {
    let plan = Plan::new(&scene());
    let right = computed(&plan);
    let all = valid::LYAPUNOV | valid::IMPACTS | valid::MESH | valid::STROBE;
    let of = |is_cycle: bool| {
        let fits = |record: &&Record| record.valid & all == all && (record.period > 0) == is_cycle;
        right.iter().position(|record| fits(&record)).unwrap()
    };
    for (id, is_cycle) in [true, false].map(|is_cycle| (of(is_cycle), is_cycle)) {
        for (name, field) in FIELDS {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                // Minus infinity is the exponent of a superstable cycle, which this one is not: it differs.
                let is_answer = is_cycle && name == "lyapunov" && value == f64::NEG_INFINITY;
                let mut records = right.clone();
                *field(&mut records[id]) = value;
                for (precision, is_lane) in
                    [(Precision::F32, true), (Precision::F64, true), (Precision::F64, false)]
                {
                    let subject = Subject { plan: &plan, records: &records, precision, is_lane };
                    let found = replay(&subject, &only(vec![id as u32]), &Lanes::default(), &|_| {});
                    let at = format!("{name} = {value}, cycle {is_cycle}, {precision:?}, lane {is_lane}");
                    assert_eq!(unexplained(&found), [id as u32], "{at}: {:?}", found.mismatches);
                    assert!(!found.faults().is_empty(), "{at}");
                    assert_eq!(found.not_finite.is_empty(), is_answer, "{at}");
                    let said = |d: &rattlemap::validate::Difference| format!("{:?}", d.record);
                    let differences: Vec<String> = found.mismatches[0].differences.iter().map(said).collect();
                    let words = if is_answer { "-inf".to_owned() } else { format!("{name} = {value}") };
                    assert!(differences.iter().any(|d| d.contains(&words)), "{at}: {differences:?}");
                }
            }
        }
    }
}

/// One cell of a map that no sample has to meet.
#[test]
fn what_is_not_finite_is_found_beside_the_sample() {
    let plan = Plan::new(&scene());
    let mut records = computed(&plan);
    let faults = |records: &[Record]| {
        let subject = Subject { plan: &plan, records, precision: Precision::F64, is_lane: true };
        replay(&subject, &only(vec![0, 1]), &Lanes::default(), &|_| {}).faults()
    };
    assert_eq!(faults(&records), Vec::<String>::new());
    assert!(validated(&plan, &records, Precision::F64, true).not_finite.is_empty());
    records[35].strobe[2] = f64::NAN;
    assert_eq!(faults(&records), ["1 of 36 cells hold numbers that are not finite"]);
    records[35].valid &= !valid::STROBE;
    assert_eq!(faults(&records), Vec::<String>::new(), "nothing is claimed");
}

/// The command, of a map whose every record has lost its state: no engine gives one of them again, and none is called
/// the same.
#[test]
fn a_map_of_states_that_are_not_numbers_fails() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SCENE).unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::cargo_bin("rattlemap").unwrap();
        // Without a device: what would take most of the time is the compilation for it.
        command.env("WGPU_ADAPTER_NAME", "no such thing");
        command.current_dir(folder.path()).args(arguments).assert()
    };
    run(&["map", "s.toml", "--engine", "cpu", "--out", "o", "--quiet"]).success();
    let identity = Identity::new("cpu", "f64", "event-driven reference", scene().identity());
    let path = folder.path().join("o").join(RECORDS);
    let mut records: Vec<(u32, Record)> = Vec::new();
    let take = |batch: &[(u32, Record)]| {
        records.extend_from_slice(batch);
        true
    };
    RecordFile::read(&path, &identity, Order::Any, take).unwrap();
    records.iter_mut().for_each(|(_, record)| record.strobe = [f64::NAN; 4]);
    RecordFile::create(&path, &identity).unwrap().append(&records).unwrap();
    let failed = run(&["validate", "o", "--samples", "4", "--quiet"]).code(1).stdout("");
    let said = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
    assert!(said.contains("36 of 36 cells hold numbers that are not finite"), "{said}");
    assert!(said.contains("cells (0, 0) (1, 0)"), "{said}");
    let written = fs::read(folder.path().join("o/validation.json")).unwrap();
    let found: serde_json::Value = serde_json::from_slice(&written).unwrap();
    assert_eq!(found["not_finite"].as_array().unwrap().len(), 36);
    assert_eq!(found["identical"], 0);
}
