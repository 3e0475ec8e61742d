//! `rattlemap validate`: what agrees, what is explained, and that wrong records are found.
//!
//! The lanes need an adapter; none is a failure: see `scripts/test.sh`.

mod common;
#[path = "common/computed.rs"]
mod computed;

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use common::gpu::open;
use computed::computed;
use rattlemap::gpu::{LaneSettings, Precision};
use rattlemap::orbit::Status;
use rattlemap::output::{Identity, RECORDS, RecordFile};
use rattlemap::plan::Plan;
use rattlemap::record::{Record, valid};
use rattlemap::scene::{Purpose, Scene};
use rattlemap::validate::states::{HORIZON, lane_states, run_lanes};
use rattlemap::validate::{
    Explanation, Pick, Sample, StateCheck, StateSource, Stratum, Subject, Validation, replay, sample,
};
use rattlemap::word::Word;

fn scene_text(columns: usize, rows: usize) -> String {
    format!(
        "[[axis]]\nparameter = \"e\"\nmin = 0.0\nmax = 1.0\ncount = {columns}\n\n\
         [[axis]]\nparameter = \"omega\"\nmin = 1.0\nmax = 12.0\ncount = {rows}\n\n\
         [outputs]\nquantities = [\"class\", \"lyapunov\", \"impacts\", \"mesh\", \"symmetric\", \"word\"]\n\
         files = [\"html\"]\n"
    )
}

fn scene(columns: usize, rows: usize) -> Scene {
    Scene::parse(&scene_text(columns, rows), "s", &[], Purpose::Map).unwrap()
}

fn replayed(subject: &Subject<'_>, drawn: &Sample, source: StateSource) -> Validation {
    replay(subject, drawn, source, &|_| {})
}

fn unexplained(validation: &Validation) -> Vec<u32> {
    let without = validation.mismatches.iter().filter(|mismatch| mismatch.explanation.is_none());
    without.map(|mismatch| mismatch.id).collect()
}

/// Lanes over the plane in both precisions: whatever differs has a reason.
#[test]
fn every_mismatch_of_the_lanes_is_explained() {
    let plan = Plan::new(&scene(15, 14));
    let ids: Vec<u32> = (0..plan.cell_count() as u32).collect();
    for precision in Precision::ALL {
        let mut gpu = open(precision);
        let settings = LaneSettings::default();
        let records = pollster::block_on(run_lanes(&mut gpu, &plan, &[], &ids, &settings)).unwrap();
        let subject = Subject { plan: &plan, records: &records, precision, is_lane: true };
        let drawn = sample(&plan, &records, usize::MAX, 1);
        let ids: Vec<u32> = drawn.picks.iter().map(|pick| pick.id).collect();
        let lanes = pollster::block_on(lane_states(&mut gpu, &plan, &records, &ids, None)).unwrap();
        let validation = replayed(&subject, &drawn, StateSource::Lanes(lanes));
        println!("{precision:?}: {:?}", validation.agreement);
        println!("{precision:?}: {:?}", validation.states);
        for mismatch in &validation.mismatches {
            let pair = plan.gear_pair(mismatch.id);
            println!("{precision:?}: e = {}, omega = {}: {mismatch:?}", pair.e, pair.omega);
        }
        assert_eq!(unexplained(&validation), [0u32; 0], "{precision:?}");
        assert!(validation.mismatches.len() * 10 < records.len(), "{precision:?}: many differ");
        let StateCheck::Lanes { cells, units: Some(units), .. } = validation.states else { panic!() };
        // An estimate that no error comes near would find nothing.
        assert!(cells > 190 && units.worst > 1e-3, "{precision:?}: {units:?}");
    }
}

/// Wrong records of a map that is right otherwise.
struct Planted {
    what: &'static str,
    /// Whether a record can be made wrong in this way.
    fits: fn(&Record) -> bool,
    spoil: fn(&mut Record),
}

const PLANTED: [Planted; 13] = [
    Planted { what: "period", fits: settled, spoil: |record| record.period += 1 },
    Planted {
        what: "class",
        fits: settled,
        spoil: |record| {
            (record.period, record.lyapunov, record.lyapunov_error) = (0, 0.4, 0.01);
        },
    },
    Planted { what: "word", fits: settled, spoil: |record| record.set_word(&Word::cyclic(b"1435")) },
    Planted { what: "lyapunov", fits: settled, spoil: |record| record.lyapunov *= 1.3 },
    Planted { what: "impacts_per_period", fits: settled, spoil: |record| record.impacts_per_period += 1.0 },
    Planted { what: "symmetric", fits: settled, spoil: |record| record.symmetric ^= 1 },
    Planted { what: "lyapunov", fits: chaotic, spoil: |record| record.lyapunov *= 3.0 },
    Planted { what: "impacts_per_period", fits: chaotic, spoil: |record| record.impacts_per_period *= 3.0 },
    Planted { what: "mesh_fraction", fits: chaotic, spoil: |record| record.mesh_fraction += 0.5 },
    // What a record says of itself excuses nothing.
    Planted {
        what: "period",
        fits: settled,
        spoil: |record| (record.period, record.status) = (2, Status::NearGrazing.code()),
    },
    Planted {
        what: "lyapunov",
        fits: settled,
        spoil: |record| (record.lyapunov, record.status) = (-5.0, Status::NearGrazing.code()),
    },
    Planted {
        what: "class",
        fits: settled,
        spoil: |record| {
            (record.period, record.periods_run, record.status) = (0, 40, Status::Slow.code());
        },
    },
    Planted {
        what: "class",
        fits: settled,
        spoil: |record| {
            (record.period, record.lyapunov, record.lyapunov_error) = (0, 0.4, 0.01);
            (record.periods_run, record.strobe) = (400, [0.0; 4]);
        },
    },
];

fn settled(record: &Record) -> bool {
    record.period == 1 && record.status == Status::Ok.code() && record.lyapunov.abs() > 0.1
}

fn chaotic(record: &Record) -> bool {
    record.period == 0 && record.status == Status::Ok.code() && record.lyapunov > 0.2
}

/// Spoils one record in each way; the ids, and what is wrong there.
fn plant(records: &mut [Record]) -> Vec<(u32, &'static str)> {
    let mut wrong: Vec<(u32, &'static str)> = Vec::new();
    for (k, planted) in PLANTED.iter().enumerate() {
        let from = k * records.len() / PLANTED.len();
        let ids = (0..records.len()).map(|n| (from + n) % records.len());
        let taken = |id: usize| wrong.iter().any(|&(other, _)| other as usize == id);
        let id = ids.into_iter().find(|&id| !taken(id) && (planted.fits)(&records[id])).unwrap();
        (planted.spoil)(&mut records[id]);
        wrong.push((id as u32, planted.what));
    }
    wrong.sort_unstable();
    wrong
}

#[test]
fn wrong_records_are_unexplained_whatever_the_engine() {
    let plan = Plan::new(&scene(12, 12));
    let mut records = computed(&plan);
    let drawn = sample(&plan, &records, usize::MAX, 1);
    for is_lane in [false, true] {
        let subject = Subject { plan: &plan, records: &records, precision: Precision::F64, is_lane };
        let right = replayed(&subject, &drawn, StateSource::Replay);
        assert!(right.mismatches.is_empty(), "{:?}", right.mismatches);
    }
    let wrong = plant(&mut records);
    let ids: Vec<u32> = wrong.iter().map(|&(id, _)| id).collect();
    for precision in Precision::ALL {
        let subject = Subject { plan: &plan, records: &records, precision, is_lane: true };
        let found = replayed(&subject, &drawn, StateSource::None("no lanes".to_owned()));
        assert_eq!(unexplained(&found), ids, "{precision:?}: {wrong:?} {:?}", found.mismatches);
    }
}

#[test]
fn samples_have_their_strata_and_repeat() {
    let plan = Plan::new(&scene(40, 40));
    // Three stripes of period 1, 2, 1; one column is slow, three cells lie on the strobe.
    let record = |id: usize| {
        let (i, j) = (id % 40, id / 40);
        let status = match (i, j) {
            (5, _) => Status::Slow,
            (20, 0..3) => Status::StrobeOnEvent,
            _ => Status::Ok,
        };
        let period = if (10..25).contains(&i) { 2 } else { 1 };
        Record { status: status.code(), period, valid: valid::PERIOD, ..Record::default() }
    };
    let records: Vec<Record> = (0..1600).map(record).collect();
    let drawn = sample(&plan, &records, 400, 7);
    assert_eq!(drawn, sample(&plan, &records, 400, 7));
    assert_ne!(drawn.picks, sample(&plan, &records, 400, 8).picks);
    let mut ids: Vec<u32> = drawn.picks.iter().map(|pick| pick.id).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), 400, "a cell was drawn twice");
    let count =
        |wanted| drawn.strata.iter().find(|s| s.stratum == wanted).map(|s| (s.runs, s.sampled)).unwrap();
    let borders = drawn.picks.iter().filter(|pick| pick.stratum == Stratum::Border);
    assert!(borders.clone().all(|pick| [9, 10, 24, 25].contains(&(pick.id % 40))));
    assert_eq!(count(Stratum::Border), (160, 100));
    let (slow_cells, slow) = count(Stratum::Status(Status::Slow));
    assert!(slow_cells == 40 && (15..=40).contains(&slow), "{slow}");
    let (strobe_cells, strobe) = count(Stratum::Status(Status::StrobeOnEvent));
    assert!(strobe_cells == 3 && strobe <= 3);
    // What the statuses are short of is drawn from all cells.
    assert_eq!(count(Stratum::Uniform), (1600, 300 - slow - strobe));
    assert_eq!(sample(&plan, &records, 5000, 7).picks.len(), 1600);
}

// ---- the command

fn rattlemap(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("rattlemap").unwrap().current_dir(folder).args(arguments).assert()
}

/// A folder with a finished map `o` of 24 x 24 cells.
fn finished() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), scene_text(24, 24)).unwrap();
    rattlemap(folder.path(), &["map", "s.toml", "--engine", "cpu", "--out", "o", "--quiet"]).success();
    let out = folder.path().join("o");
    (folder, out)
}

fn said(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
}

fn json(out: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(out.join("validation.json")).unwrap()).unwrap()
}

#[test]
fn a_map_is_validated_and_its_report_says_so() {
    let (folder, out) = finished();
    let run = |arguments: &[&str]| rattlemap(folder.path(), &[&["validate", "o"], arguments].concat());
    let text = said(&run(&["--samples", "150", "--seed", "3"]).success().stdout(""));
    assert!(text.contains("150 cells replayed: 0 mismatches, 0 unexplained"), "{text}");
    assert!(text.contains("states of 150 of 150 cells the same to the bit"), "{text}");
    assert!(text.contains("o: validation.json, report.html"), "{text}");
    let found = json(&out);
    assert_eq!((&found["samples"], &found["seed"], &found["cells"]), (&150.into(), &3.into(), &576.into()));
    assert_eq!(found["unexplained"], 0);
    assert_eq!(found["states"]["check"], "replay");
    assert_eq!(found["agreement"]["class"], serde_json::json!({ "compared": 150, "agreeing": 150 }));
    assert_eq!(found["strata"][0]["name"], "uniform");
    let sampled: u64 =
        found["strata"].as_array().unwrap().iter().map(|s| s["sampled"].as_u64().unwrap()).sum();
    assert_eq!(sampled, 150);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("\"validation\":{\"format\":1,\"command\":\"validate\""), "no section");
    // The same seed, the same bytes.
    let first = fs::read(out.join("validation.json")).unwrap();
    run(&["--samples", "150", "--seed", "3", "--quiet"]).success().stderr("");
    assert!(fs::read(out.join("validation.json")).unwrap() == first);
    run(&["--samples", "150", "--seed", "4", "--quiet"]).success();
    assert!(fs::read(out.join("validation.json")).unwrap() != first);
    // A map that is written again has not been validated.
    rattlemap(folder.path(), &["map", "s.toml", "--out", "o", "--quiet", "--resume"]).success();
    assert!(!out.join("validation.json").exists());
    assert!(fs::read_to_string(out.join("report.html")).unwrap().contains("\"validation\":null"));
}

#[test]
fn planted_records_fail_the_validation_by_name() {
    let (folder, out) = finished();
    let plan = Plan::new(&scene(24, 24));
    let scene = scene(24, 24);
    let identity = Identity::new("cpu", "f64", "event-driven reference", scene.identity());
    let path = out.join(RECORDS);
    let mut records = vec![Record::default(); plan.cell_count()];
    let count = RecordFile::read(&path, &identity, |batch| {
        batch.iter().for_each(|&(id, record)| records[id as usize] = record);
        true
    });
    assert_eq!(count.unwrap().count, 576);
    let wrong = plant(&mut records);
    let spoilt: Vec<(u32, Record)> = (0..).zip(records).collect();
    RecordFile::create(&path, &identity).unwrap().append(&spoilt).unwrap();

    let run = rattlemap(folder.path(), &["validate", "o", "--samples", "576", "--quiet"]).code(1).stdout("");
    let text = said(&run);
    let count = format!("{} of 576 cells differ from the reference without an explanation", PLANTED.len());
    assert!(text.contains(&count), "{text}");
    // The message names the first ones.
    for &(id, _) in &wrong[..8] {
        let [i, j] = plan.indices(id);
        assert!(text.contains(&format!("({i}, {j})")), "{text}");
    }
    assert!(text.contains("o/validation.json"), "{text}");
    let found = json(&out);
    let planted = &PLANTED.len().into();
    assert_eq!((&found["unexplained"], &found["mismatched"]), (planted, planted));
    for (mismatch, &(id, what)) in found["mismatches"].as_array().unwrap().iter().zip(&wrong) {
        assert_eq!((&mismatch["id"], &mismatch["explanation"]), (&id.into(), &serde_json::Value::Null));
        assert_eq!(mismatch["differences"][0]["field"], what, "{mismatch}");
        let command = mismatch["replay"].as_str().unwrap();
        let arguments: Vec<&str> = command.split(' ').skip(1).chain(["--json"]).collect();
        rattlemap(folder.path(), &arguments).success();
    }
}

/// Another device than the map's may round differently: whoever reads the result is told.
#[test]
fn lanes_of_another_device_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("o");
    fs::write(folder.path().join("s.toml"), scene_text(4, 3)).unwrap();
    let map = ["map", "s.toml", "--out", "o", "--engine", "gpu", "--quiet"];
    rattlemap(folder.path(), &map).success();
    let validated = || said(&rattlemap(folder.path(), &["validate", "o"]).success());
    let text = validated();
    assert!(!text.contains("device"), "{text}");
    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    let made: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let states = &json(&out)["states"];
    assert_eq!((&states["same_device"], &states["device"]), (&true.into(), &made["device"]));
    // The same map, as if it came from elsewhere.
    let device = made["device"].as_str().unwrap();
    let scene = scene(4, 3);
    let identity = |device| Identity::new("gpu", "f32", device, scene.identity());
    let mut records = Vec::new();
    let take = |batch: &[(u32, Record)]| {
        records.extend_from_slice(batch);
        true
    };
    RecordFile::read(&out.join(RECORDS), &identity(device), take).unwrap();
    RecordFile::create(&out.join(RECORDS), &identity("Faraway card")).unwrap().append(&records).unwrap();
    fs::write(out.join("manifest.json"), manifest.replace(device, "Faraway card")).unwrap();
    let text = validated();
    assert!(
        text.contains(&format!("lanes ran again on {device}, not on the map's own device: no")),
        "{text}"
    );
    assert!(text.contains("called Faraway card"), "{text}");
    let found = json(&out);
    assert_eq!((&found["device"], &found["states"]["same_device"]), (&"Faraway card".into(), &false.into()));
    assert_eq!(found["states"]["device"], device);
}

#[test]
fn what_is_no_finished_map_is_refused() {
    let (folder, out) = finished();
    let refused = |arguments: &[&str], parts: &[&str]| {
        let run = rattlemap(folder.path(), &[&["validate"], arguments].concat()).code(2).stdout("");
        parts.iter().for_each(|part| assert!(said(&run).contains(part), "{part}: {}", said(&run)));
    };
    refused(&["nowhere"], &["nowhere: there is no such folder"]);
    refused(&["."], &["there is no manifest.json", "not the folder of a map"]);
    refused(&["o", "--samples", "0"], &["--samples"]);
    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    let with = |from: &str, to: &str| {
        assert!(manifest.contains(from), "{from}");
        fs::write(out.join("manifest.json"), manifest.replace(from, to)).unwrap();
    };
    let version = format!("\"crate_version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    with(&version, "\"crate_version\": \"0.0.1\"");
    refused(&["o"], &["made by rattlemap 0.0.1", "--force"]);
    with("\"command\": \"map\"", "\"command\": \"bifurcation\"");
    refused(&["o"], &["not the manifest of a map, but of `bifurcation`"]);
    with("max = 12.0", "max = 11.0");
    refused(&["o"], &["records.bin does not belong to the manifest.json", "`axis.1.max` was 12.0, now 11.0"]);
    with("\"precision\": \"f64\"", "\"precision\": \"f16\"");
    refused(&["o"], &["f16"]);
    with("{", "");
    refused(&["o"], &["not the manifest of a map"]);
    fs::remove_file(out.join("manifest.json")).unwrap();
    refused(&["o"], &["the run is unfinished", "--resume"]);
    fs::write(out.join("manifest.json"), &manifest).unwrap();
    let records = fs::read(out.join(RECORDS)).unwrap();
    fs::write(out.join(RECORDS), &records[..records.len() - 1]).unwrap();
    refused(&["o"], &["of 576 cells"]);
    let mut bad = records.clone();
    bad[20] ^= 0x10;
    fs::write(out.join(RECORDS), bad).unwrap();
    refused(&["o"], &["is damaged at byte 16", "--force"]);
    fs::remove_file(out.join(RECORDS)).unwrap();
    refused(&["o"], &["there is no records.bin"]);
}

#[test]
fn explanations_have_distinct_names() {
    let names: std::collections::HashSet<_> = Explanation::ALL.iter().map(|e| e.name()).collect();
    assert_eq!(names.len(), Explanation::ALL.len());
}

/// An impact within rounding of the fourth strobe: in single precision a lane stands on the other side of it.
#[test]
fn an_event_on_the_strobe_may_be_on_its_other_side() {
    let text = "[parameters]\nomega = 4.2\ne = 0.7\n\
                [[axis]]\nparameter = 'm1'\nmin = 1.2204724409448817\nmax = 2.0\ncount = 2\n\
                [[axis]]\nparameter = 'm2'\nmin = 1.447244094488189\nmax = 2.0\ncount = 2\n";
    let plan = Plan::new(&Scene::parse(text, "cell", &[], Purpose::Map).unwrap());
    let mut records = vec![Record::default(); plan.cell_count()];
    records[0] = Record {
        lyapunov: 1.0269397510210885,
        lyapunov_error: 0.04305312626565277,
        impacts_per_period: 739.0 / 104.0,
        strobe: [3.9971641302108765, 30.14419069304812, 3.51179838180542, 31.10382907262965],
        periods_run: 204,
        valid: valid::PERIOD | valid::LYAPUNOV | valid::IMPACTS | valid::MESH | valid::STROBE,
        ..Record::default()
    };
    let subject = Subject { plan: &plan, records: &records, precision: Precision::F32, is_lane: true };
    let picks = vec![Pick { id: 0, stratum: Stratum::Uniform }];
    let drawn = Sample { seed: 0, picks, strata: Vec::new(), among: 1 };
    let found = |strobe: [f64; 4]| {
        let lane = Record { strobe, periods_run: HORIZON, ..records[0] };
        replayed(&subject, &drawn, StateSource::Lanes(vec![lane])).mismatches
    };
    let there = [2.2326167821884155, 28.587222012810955, 1.7326555252075195, 25.76218473812631];
    let mismatches = found(there);
    assert_eq!(mismatches[0].explanation, Some(Explanation::BelowResolution), "{mismatches:?}");
    // Nothing that rounds is elsewhere.
    for off in [[0.0, 3.0, 0.0, 3.0], [1.0, 0.0, 1.0, 0.0], [0.0, -6.0, 0.0, 0.0]] {
        let mismatches = found(std::array::from_fn(|i| there[i] + off[i]));
        assert_eq!(mismatches[0].explanation, None, "{off:?}: {mismatches:?}");
    }
}
