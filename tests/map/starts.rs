//! Starts of cells: following the attractor along the last axis, and several starts per cell.
//!
//! The lanes need an adapter; without one the tests fail: see `scripts/test.sh`.

use rattlemap_dynamics::model::{State, state};
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::common::{REST, apart, gpu, pair_at};
use crate::map::swept;
use assert_cmd::Command;
use rattlemap::findings::coexistence::attractors;
use rattlemap::gpu::Precision;
use rattlemap::map::bifurcation;
use rattlemap::map::engine::{Cpu, Engine, Fake};
use rattlemap::map::plan::{Cell, Plan};
use rattlemap::map::scene::{Purpose, Scene, Start};
use rattlemap::record::classify::classify;
use rattlemap::record::{Record, valid};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::orbit::{Class, Status, analyse};

/// A map over frequency and restitution; restitution increases through a range in which periods 2 and 3 coexist.
const SCENE: &str = r#"title = "Hysteresis"
axis = [
    { parameter = "omega", min = 5.6, max = 5.61, count = 2 },
    { parameter = "e", min = 0.9, max = 0.94, count = 41 },
]

[start]
policy = "up"

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"]
"#;

fn plan(sets: &[&str]) -> Plan {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    Plan::new(&Scene::parse(SCENE, "s", &sets, Purpose::Map).unwrap())
}

/// Computes all records, by run.
fn records(plan: &Plan, engine: &mut Engine<'_>) -> Vec<Record> {
    let swept = swept(plan, engine, &[]);
    assert!(swept.end.unwrap());
    assert_eq!(swept.schedule.expected(), plan.run_count());
    swept.records
}

fn on_cpu(plan: &Plan) -> Vec<Record> {
    records(plan, &mut Engine::Cpu(Cpu::new(plan)))
}

fn on_lanes(plan: &Plan, precision: Precision) -> Vec<Record> {
    records(plan, &mut gpu::engine(plan, precision))
}

/// Returns the period of a cell; 0 without one.
fn period(record: &Record) -> u32 {
    if let Class::Periodic { period } = classify(record) { period } else { 0 }
}

/// Computes a record whose strobe state shows the start of the cell.
fn record_of_start(cell: &Cell) -> Record {
    let [x1, _, x2, _, ..] = cell.start;
    let strobe = state(&[x1 + 1.0, 0.0, x2 + f64::from(cell.id), 0.5]);
    Record {
        strobe: strobe.into(),
        periods_run: 1,
        valid: valid::STROBE | valid::PERIOD,
        ..Record::default()
    }
}

#[test]
fn cells_start_in_the_last_state_of_their_neighbour() {
    for (policy, order) in [("up", [0, 1, 2, 3, 4]), ("down", [4, 3, 2, 1, 0])] {
        let plan = plan(&[&format!("start.policy={policy}"), "axis.0.count=3", "axis.1.count=5"]);
        let records = records(&plan, &mut Engine::Fake(Fake::new(record_of_start)));
        for i in 0..3 {
            let mut sum = 0.0;
            for (nth, j) in order.into_iter().enumerate() {
                let id = j * 3 + i;
                sum += f64::from(id);
                let strobe = records[id as usize].strobe();
                assert_eq!((strobe[0], strobe[2]), (nth as f64 + 1.0, sum), "{policy}: cell {id}");
                let start = plan.start(id, &records);
                assert_eq!((start[0], start[2]), (nth as f64, sum - f64::from(id)), "{policy}: cell {id}");
            }
        }
    }
}

#[test]
fn a_cell_after_a_failed_neighbour_starts_at_rest() {
    let fails = |cell: &Cell| {
        let failed = Record { status: Status::CapEvents.code(), ..record_of_start(cell) };
        if cell.id / 2 == 3 { failed } else { record_of_start(cell) }
    };
    let plan = plan(&[]);
    let records = records(&plan, &mut Engine::Fake(Fake::new(fails)));
    assert_eq!((records[8].strobe[0], records[10].strobe[0]), (1.0, 2.0));
    assert_eq!(plan.start(8, &records), REST);
}

#[test]
fn the_direction_decides_between_coexisting_attractors() {
    check_directions(&[None, Some(Precision::F32)]);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn the_direction_decides_between_coexisting_attractors_in_double_precision() {
    check_directions(&[Some(Precision::F64)]);
}

fn check_directions(engines: &[Option<Precision>]) {
    // Between 0.922 and 0.927 period 2, reached from below, and period 3, reached from above, coexist.
    let between = |plan: &Plan, records: &[Record]| {
        let ids = (0..plan.cell_count() as u32).filter(|&id| {
            let pair = pair_at(plan, id);
            pair.omega == 5.6 && (0.9215..0.9275).contains(&pair.e)
        });
        ids.map(|id| period(&records[id as usize])).collect::<Vec<_>>()
    };
    for (policy, expected) in [("up", 2), ("down", 3)] {
        let plan = plan(&[&format!("start.policy={policy}")]);
        for &precision in engines {
            let records = precision.map_or_else(|| on_cpu(&plan), |precision| on_lanes(&plan, precision));
            assert_eq!(between(&plan, &records), [expected; 6], "{policy}, {precision:?}");
        }
    }
}

#[test]
fn a_column_agrees_with_a_bifurcation_diagram() {
    for (policy, start) in [("up", Start::Up), ("down", Start::Down)] {
        let sets = ["axis.1.min=0.855", "axis.1.max=0.945", "axis.1.count=91"];
        let plan = plan(&[&sets[..], &[&format!("start.policy={policy}")]].concat());
        let records = on_cpu(&plan);
        let line: Vec<_> = (0..91).map(|j| 2 * j).map(|id| (pair_at(&plan, id).e, plan.model(id))).collect();
        let columns =
            bifurcation::run_until(&line, start, &plan.budget().settings, &|_| {}, &AtomicBool::new(false));
        let columns = columns.unwrap().unwrap();
        let mut compared = 0;
        for (j, column) in columns.iter().enumerate() {
            let class = classify(&records[2 * j]);
            // A map's cell has a limited budget, a diagram's column has not.
            if class != Class::Undecided {
                assert_eq!(class, column.class, "{policy} at e = {}", column.value);
                compared += 1;
            }
        }
        assert!(compared > 80, "{policy}: {compared} of 91 compared");
    }
}

#[test]
fn cells_agree_with_single_orbits_from_their_starts() {
    let plan = plan(&["start.policy=down"]);
    let records = on_cpu(&plan);
    let mut periodic = 0;
    for id in 0..plan.cell_count() as u32 {
        let record = &records[id as usize];
        if let class @ Class::Periodic { .. } = classify(record) {
            let orbit = analyse(&*plan.model(id), plan.start(id, &records), &plan.budget().settings).unwrap();
            assert_eq!(orbit.class, class, "cell {id}");
            periodic += 1;
        }
    }
    assert!(periodic > 60, "{periodic}");
}

#[test]
fn further_starts_find_coexisting_attractors() {
    let range = ["start.policy=rest", "axis.1.min=0.915", "axis.1.max=0.928", "axis.1.count=14"];
    let plan = plan(&[&range[..], &["start.count=24"]].concat());
    assert_eq!((plan.cell_count(), plan.run_count()), (28, 28 * 24));
    let records = on_cpu(&plan);
    let found = attractors(&plan, &records).unwrap();
    for (id, &count) in found.iter().enumerate() {
        let pair = pair_at(&plan, id as u32);
        let mut periods: Vec<u32> = records[id..].iter().step_by(28).map(period).filter(|&p| p > 0).collect();
        periods.sort_unstable();
        periods.dedup();
        if pair.omega == 5.6 && (0.9235..0.9275).contains(&pair.e) {
            assert_eq!((periods, count), (vec![2, 3], 2), "e = {}", pair.e);
        } else if pair.omega == 5.6 && pair.e < 0.9185 {
            assert_eq!((periods, count), (vec![2], 1), "e = {}", pair.e);
        }
    }
    // The first runs are the map with one start.
    let alone = self::plan(&range);
    let one = on_cpu(&alone);
    assert_eq!(records[..28], one);
    assert_eq!(attractors(&alone, &one), None);
}

/// Counts the attractors of one cell from the records of its runs.
fn counted(omega: f64, e: f64, runs: &[Record]) -> u8 {
    let sets = [
        "start.policy=rest".to_owned(),
        format!("start.count={}", runs.len()),
        format!("axis.0.min={omega}"),
        "axis.0.max=12".to_owned(),
        format!("axis.1.min={e}"),
        "axis.1.max=0.99".to_owned(),
        "axis.1.count=2".to_owned(),
    ];
    let plan = plan(&sets.each_ref().map(String::as_str));
    let mut records = vec![Record::default(); plan.run_count()];
    runs.iter().enumerate().for_each(|(k, run)| records[k * plan.cell_count()] = run.clone());
    let found = attractors(&plan, &records).unwrap();
    assert_eq!(found[1..], [0, 0, 0]);
    found[0]
}

fn cycle(period: u32, strobe: State) -> Record {
    Record { period, strobe: strobe.into(), valid: valid::PERIOD | valid::STROBE, ..Record::default() }
}

/// Returns the state of a motion after `periods` periods and `turns` of the next.
fn later(omega: f64, e: f64, from: State, periods: u32, turns: f64) -> State {
    let pair = rattlemap_dynamics::model::GearPair { omega, ..rattlemap_dynamics::model::GearPair::paper(e) };
    let flow = Flow::new(&pair.oscillator().unwrap());
    let mut trajectory = Trajectory::new(&flow, pair.law(), from);
    for _ in 0..periods {
        trajectory.advance_period(&mut ()).unwrap();
    }
    trajectory.advance_to(turns * flow.period, &mut ()).unwrap();
    trajectory.state()
}

/// The ends of two slow approaches may be twice as far apart as each is from the cycle.
#[test]
fn runs_that_approach_one_cycle_count_once() {
    let plan = plan(&[
        "m1=1.30072638416532",
        "m2=4.370754723550304",
        "r1=0.001309637638311873",
        "r2=0.07709545638674745",
        "k1=4.204001903728689",
        "k2=7.0251062646692635",
        "r=3.0416397939701008",
        "k=65.82612236208861",
        "F=12.56571991827156",
        "b=0.10655138843791885",
        "axis.0.min=5.6680510494800656",
        "axis.1.min=0.34823049693762054",
        "axis.1.max=0.5857070179215647",
        "axis.0.max=5.7",
        "axis.1.count=2",
        "start.policy=rest",
        "start.count=8",
    ]);
    let found = attractors(&plan, &on_cpu(&plan)).unwrap();
    assert_eq!([found[0], found[2]], [1, 1]);
}

#[test]
fn attractors_are_distinguished_by_their_states() {
    let (omega, e) = (5.6, 0.925);
    let settled = |start, periods| {
        let pair =
            rattlemap_dynamics::model::GearPair { omega, ..rattlemap_dynamics::model::GearPair::paper(e) };
        let orbit = analyse(&pair, start, &Default::default()).unwrap();
        assert_eq!(orbit.class, Class::Periodic { period: periods });
        orbit.strobe
    };
    let two = settled(REST, 2);
    // Period 3, reached from above.
    let plan = plan(&["start.policy=down"]);
    let records = on_cpu(&plan);
    let three = settled(records[2 * 25].strobe(), 3);
    let chaos = Record {
        lyapunov: 0.3,
        lyapunov_error: 0.01,
        valid: valid::PERIOD | valid::LYAPUNOV,
        ..Record::default()
    };
    let failed = Record { status: Status::CapEvents.code(), ..chaos.clone() };
    let mirrored = |from| later(omega, e, from, 1, 0.5).map(|x| -x);
    let perturbed = |y: State| {
        let mut moved = y;
        moved[..4].iter_mut().for_each(|x| *x = 1.001 * *x + 1e-3);
        moved
    };
    for (expected, runs) in [
        (2, vec![cycle(2, two), cycle(3, three)]),
        // Other states of the same cycles.
        (
            1,
            vec![
                cycle(3, three),
                cycle(3, later(omega, e, three, 1, 0.0)),
                cycle(3, later(omega, e, three, 2, 0.0)),
            ],
        ),
        (1, vec![cycle(2, two), cycle(2, later(omega, e, two, 1, 0.0))]),
        // The symmetry-conjugate orbit, and an unsettled run.
        (1, vec![cycle(3, three), cycle(3, mirrored(three))]),
        (1, vec![cycle(3, three), cycle(3, perturbed(three))]),
        // A multiple of the period, as near a period doubling.
        (1, vec![cycle(3, three), cycle(6, perturbed(three))]),
        (1, vec![chaos.clone(), chaos.clone(), failed.clone()]),
        (3, vec![chaos.clone(), cycle(2, two), chaos, cycle(3, three)]),
        (0, vec![failed, Record::default()]),
    ] {
        assert_eq!(counted(omega, e, &runs), expected, "{runs:?}");
    }
    // Contact-free motion is one attractor, even if a run has not reached it.
    let far = later(11.0, 0.5, REST, 6, 0.0);
    let near = later(11.0, 0.5, REST, 200, 0.0);
    assert!(apart(far, near) > 0.1, "{far:?} {near:?}");
    assert_eq!(counted(11.0, 0.5, &[cycle(1, far), cycle(1, near)]), 1);
}

fn run(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("rattlemap").unwrap().current_dir(folder).args(arguments).assert()
}

fn bytes(out: &Path, names: &[&str]) -> Vec<Vec<u8>> {
    names.iter().map(|name| fs::read(out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))).collect()
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn files_describe_the_starts_and_resume_to_equal_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("s.toml"), SCENE).unwrap();
    let files = ["cells.csv", "cells.npy", "words.csv", "map.png", "pattern.png", "word.png", "report.html"];
    for (engine, sets, description) in [
        (&["--engine", "cpu"][..], &[][..], "every cell from the attractor at the next lower e"),
        (&["--engine", "gpu", "--precision", "f32"], &["--set", "start.policy=down"], "at the next higher e"),
        (
            &["--engine", "cpu"],
            &["--set", "start.policy=rest", "--set", "start.count=3", "--set", "axis.1.count=9"],
            "every cell from rest, attractors counted with 2 random states more",
        ),
    ] {
        let request = [&["map", "s.toml", "--quiet", "--force", "--out", "whole"], engine, sets].concat();
        run(at, &request).success();
        let whole = at.join("whole");
        let (expected, records) = (bytes(&whole, &files), fs::read(whole.join("records.bin")).unwrap());
        assert!(String::from_utf8_lossy(&expected[6]).contains(description), "{description}");
        let head = 16 + u32::from_le_bytes(records[8..12].try_into().unwrap()) as usize;
        let lengths = [records.len() / 2, records.len() - 1, head + 400];
        // Lanes are cut only once, because each run compiles the shader.
        for &length in &lengths[..if engine.contains(&"gpu") { 1 } else { 3 }] {
            let cut = at.join("cut");
            fs::create_dir_all(&cut).unwrap();
            fs::write(cut.join("records.bin"), &records[..length]).unwrap();
            let request = [&["map", "s.toml", "--quiet", "--resume", "--out", "cut"], engine, sets].concat();
            run(at, &request).success();
            assert!(bytes(&cut, &files) == expected, "{sets:?}: cut to {length} bytes");
        }
        run(at, &["validate", "whole", "--quiet", "--samples", "40"]).success();
        let report = String::from_utf8_lossy(&fs::read(whole.join("report.html")).unwrap()).into_owned();
        assert_eq!(report.contains("\"name\":\"attractors\""), sets.contains(&"start.count=3"));
        let other = ["map", "s.toml", "--resume", "--out", "cut", "--set", "start.policy=rest"];
        run(at, &[&other[..], engine, &["--set", "start.count=2"]].concat()).code(2);
    }
    let manifest = fs::read_to_string(at.join("whole/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(
        manifest["start"],
        serde_json::json!({ "policy": "rest", "state": null, "phase": 0.0, "count": 3, "seed": 1 })
    );
    let table = fs::read_to_string(at.join("whole/cells.csv")).unwrap();
    let mut lines = table.lines();
    assert!(lines.next().unwrap().ends_with(",periods_run,source,attractors"));
    let counts: Vec<u64> = lines.map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect();
    for (count, cells) in manifest["attractors"].as_object().unwrap() {
        let found = counts.iter().filter(|&&c| c.to_string() == *count).count();
        assert_eq!(*cells, found, "{count}");
    }
    assert!(counts.len() == 18 && counts.contains(&2), "{counts:?}");
    let array = fs::read(at.join("whole/cells.npy")).unwrap();
    let packed: Vec<u64> = array[array.len() - 18 * 75..].chunks(75).map(|row| row[74].into()).collect();
    assert_eq!(packed, counts);
    assert!(at.join("whole/attractors.png").is_file());
}
