//! Machines on lanes and on the reference.
//!
//! The lanes need an adapter; without one the tests fail (see `scripts/test.sh`).

use crate::common::gpu::{all_records, map, open};
use crate::common::{REST, paper};
use crate::reference_tests::machines::random::{Shape, case};
use rattlemap::gpu::{Features, Lane, LaneSettings, MachineShape, Precision};
use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::{Cell, Plan};
use rattlemap::map::scene::{FileText, Purpose, Scene};
use rattlemap::record::classify::{classify, status};
use rattlemap::record::measures::GROUPS;
use rattlemap::record::{Record, Spelling, valid};
use rattlemap::validate::{Field, differences};
use rattlemap_dynamics::machine::{MachineMotion, System};
use rattlemap_dynamics::model::{
    Contact, Form, GearPair, Law, NonImpacting, Oscillator, Restitution, State, state,
};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, EVENT_PERIODS, Settings, Status, analyse_flow};
use rayon::prelude::*;

/// Forcing periods that are compared.
const PERIODS: u32 = 4;

/// Relative change of starts that shows how much the motion amplifies errors.
const CHANGE: f64 = 1e-10;

/// Motions that amplify errors more are not compared.
const MOST_AMPLIFICATION: f64 = 1e4;

struct End {
    state: State,
    impacts: u64,
    /// Largest change of the final state per change of the start, and size of the motion.
    amplification: f64,
    size: f64,
}

fn run(system: &System, start: &State, periods: u32) -> Option<(State, u64)> {
    let mut motion = MachineMotion::new(system, start);
    for _ in 0..periods {
        motion.advance_period(&mut ()).ok()?;
    }
    (!motion.near_grazing()).then(|| (motion.state(), motion.work().impacts))
}

/// Returns the largest difference of displacements and of rates divided by the forcing frequency.
fn distance(a: &State, b: &State, omega: f64) -> f64 {
    let unit = |i: usize| if i.is_multiple_of(2) { 1.0 } else { omega };
    (0..a.len()).map(|i| (a[i] - b[i]).abs() / unit(i)).fold(0.0, f64::max)
}

/// Returns the reference's motion, if it does not depend on rounding.
fn reference(machine: &Oscillator, start: &State) -> Option<End> {
    let system = System::new(machine);
    let (end, impacts) = run(&system, start, PERIODS)?;
    let size = distance(&end, &state(&[]), machine.omega).max(distance(start, &state(&[]), machine.omega));
    let mut amplification = 1.0f64;
    for i in 0..2 * machine.degrees() {
        for sign in [-1.0, 1.0] {
            let unit = if i % 2 == 0 { size } else { size * machine.omega };
            let mut changed = *start;
            changed[i] += sign * CHANGE * unit;
            let (other, count) = run(&system, &changed, PERIODS)?;
            if count != impacts {
                return None;
            }
            amplification = amplification.max(distance(&other, &end, machine.omega) / (CHANGE * size));
        }
    }
    (amplification < MOST_AMPLIFICATION).then_some(End { state: end, impacts, amplification, size })
}

/// Compares lanes with the reference on random machines of a shape. At least so many machines and impacts must be compared.
fn compare(shape: Shape, seeds: u64, least: [u64; 2]) {
    let cases: Vec<_> = (0..seeds).map(|seed| case(seed, shape)).collect();
    let oscillators: Vec<_> = cases.iter().map(|case| Form::Machine(case.machine.clone())).collect();
    let starts: Vec<State> = cases.iter().map(|case| state(&case.start)).collect();
    let sizes =
        oscillators.iter().map(|o| Features::of(o).machine.unwrap()).reduce(MachineShape::and).unwrap();
    let features = Features { machine: Some(sizes), ..Features::default() };
    let settings = LaneSettings { features, ..LaneSettings::only(PERIODS) };
    let lanes: Vec<_> = (0..).zip(&starts).map(|(flow, &start)| Lane { flow, law: 0, start }).collect();
    let exact: Vec<_> =
        cases.par_iter().zip(&starts).map(|(case, start)| reference(&case.machine, start)).collect();
    for precision in Precision::ALL {
        let mut gpu = open(precision);
        let records =
            pollster::block_on(gpu.run(&oscillators, &[Law::both(0.0, 0.0)], &lanes, &settings)).unwrap();
        let rounding = if precision == Precision::F32 { 1e-5 } else { 1e-13 };
        for (seed, (record, exact)) in records.iter().zip(&exact).enumerate() {
            let Some(exact) = exact else { continue };
            assert_eq!(record.status, 0, "{precision:?}, seed {seed}");
            let error = distance(&record.strobe(), &exact.state, cases[seed].machine.omega) / exact.size;
            let allowed = rounding * exact.amplification;
            assert!(error < allowed, "{precision:?}, seed {seed}: error {error:.1e}, allowed {allowed:.1e}");
            // Single precision ends a series of impacts a few impacts earlier.
            if precision == Precision::F64 {
                let impacts = record.impacts_per_period * f64::from(PERIODS);
                assert_eq!(impacts.round() as u64, exact.impacts, "seed {seed}");
            }
        }
    }
    let compared = exact.iter().flatten();
    let [count, impacts] = compared.fold([0, 0], |[count, impacts], end| [count + 1, impacts + end.impacts]);
    assert!(count >= least[0] && impacts >= least[1], "{count} machines and {impacts} impacts were compared");
}

/// Cells with gears at rest, two periods, and chaos.
const SCENE: &str = r#"
model = "two-loose-gears"
axis = [
    { parameter = "omega", min = 80.0, max = 400.0, count = 4 },
    { parameter = "A", min = 1e-5, max = 8e-4, count = 3 },
]
"#;

#[test]
fn lanes_decide_classes_of_machines_as_the_reference_does() {
    let plan = Plan::new(&Scene::parse(SCENE, "s", &[], Purpose::Map).unwrap());
    let expected = all_records(&plan, &mut Engine::Cpu(Cpu::new(&plan)));
    let found = map(&plan, &mut open(Precision::F32));
    for (id, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert_eq!((classify(found), found.period), (classify(expected), expected.period), "cell {id}");
        if expected.period > 0 {
            let off = (found.lyapunov - expected.lyapunov).abs() / expected.lyapunov.abs();
            assert!(off < 0.02, "cell {id}: {} for {}", found.lyapunov, expected.lyapunov);
        }
    }
}

/// A mass between mirrored walls. A cycle is its own mirror image, or one of a pair.
const MIRRORED: &str = r#"
name = "mirrored"
title = "Mass between walls"
summary = "a mass between two walls that return less of faster impacts"
[parameters]
F = { default = 1.0, meaning = "force" }
omega = { default = 1.0, meaning = "frequency" }
[motion]
coordinates = ["x"]
mass = [["1"]]
damping = [["0.4"]]
stiffness = [["0.2"]]
force = ["F"]
frequency = "omega"
gap = ["1"]
[[contact]]
side = "right"
at = "0.5"
law = "impact"
restitution = "0.8 - 0.05*speed"
[[contact]]
side = "left"
at = "-0.5"
law = "impact"
restitution = "0.8 - 0.05*speed"
"#;

const SCENE_OF_MIRRORED: &str = r#"
model = "mirrored.toml"
axis = [
    { parameter = "F", values = [1.0, 2.0] },
    { parameter = "omega", values = [1.4, 1.7, 2.0, 2.3, 2.6, 4.0] },
]
"#;

/// The processor measures the motion in which lanes end.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn maps_of_machines_have_the_symmetry_and_the_quantities_of_the_reference() {
    let quantities: Vec<String> = GROUPS.iter().map(|group| format!("{:?}", group.name)).collect();
    let outputs = format!("[outputs]\nquantities = [\"symmetric\", {}]\n", quantities.join(", "));
    let model = |_, _: &str| Ok(FileText { name: "mirrored".into(), text: MIRRORED.into() });
    let (mut measured, mut symmetric) = (0, [0, 0]);
    for scene in [SCENE, SCENE_OF_MIRRORED] {
        let scene = format!("{scene}{outputs}");
        let scene = Scene::parse_with_files(&scene, "s", &[], Purpose::Map, None, &model).unwrap();
        let plan = Plan::new(&scene);
        let expected = all_records(&plan, &mut Engine::Cpu(Cpu::new(&plan)));
        let found = map(&plan, &mut open(Precision::F32));
        for (id, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let is_certain = expected.status == 0 && expected.period > 0;
            if !is_certain || classify(found) != classify(expected) {
                continue;
            }
            for group in &GROUPS {
                assert_eq!(found.valid & group.bit, expected.valid & group.bit, "cell {id}: {}", group.name);
            }
            let period = plan.oscillator(plan.cell(id as u32).flow).period();
            let mut differences = differences(found, expected, Precision::F32, period, plan.budget());
            // Lanes may settle in another time.
            differences.retain(|one| one.field != Field::STATUS);
            assert!(differences.is_empty(), "cell {id}: {differences:?}");
            if found.valid & valid::SYMMETRIC != 0 {
                symmetric[found.symmetric as usize] += 1;
            }
            measured += 1;
        }
    }
    assert!(
        measured >= 17 && symmetric[0] >= 2 && symmetric[1] >= 5,
        "{measured} measured, symmetric: {symmetric:?}"
    );
}

/// Lanes decide motion without contact as soon as its energy is too low for one.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn contact_free_motion_of_machines_ends_early() {
    let slow = |omega: f64| GearPair { omega, r1: 0.02, r2: 0.02, ..GearPair::paper(0.8) };
    let oscillators = [9.0, 11.0].map(|omega| slow(omega).oscillator().unwrap());
    let forms = oscillators.clone().map(Form::Machine);
    let settings = LaneSettings { features: Features::of(&forms[0]), ..LaneSettings::default() };
    let steady = |oscillator: &Oscillator| NonImpacting::of_machine(oscillator).unwrap();
    // From rest, the gears would rattle.
    let lanes = [0, 1].map(|flow| {
        let mut start = steady(&oscillators[flow as usize]).steady();
        start[0] += 0.05;
        Lane { flow, law: 0, start }
    });
    let (mut gpu, laws) = (open(Precision::F32), [Law::both(0.0, 0.0)]);
    let records = pollster::block_on(gpu.run(&forms, &laws, &lanes, &settings)).unwrap();
    for (record, oscillator) in records.iter().zip(&oscillators) {
        let motion = steady(oscillator);
        assert_eq!((record.period, record.status, record.impacts_per_period), (1, 0, 0.0));
        assert!(record.periods_run < 100, "{} periods", record.periods_run);
        assert!((record.lyapunov / motion.exponent() - 1.0).abs() < 1e-5, "{}", record.lyapunov);
    }
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn random_machines_move_as_on_the_reference() {
    compare(Shape { coordinates: 3, gaps: 2, harmonics: 2, stages: 2, friction: 1, walls: 2 }, 64, [30, 200]);
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn large_machines_move_as_on_the_reference() {
    compare(Shape { coordinates: 2, gaps: 1, harmonics: 3, stages: 1, friction: 2, walls: 3 }, 64, [12, 30]);
    compare(Shape { coordinates: 8, gaps: 3, harmonics: 8, stages: 1, friction: 0, walls: 1 }, 32, [25, 500]);
}

/// Lanes replace the rest of a series of impacts by its limit as the reference does: classes, words, impacts and exponents agree.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn series_of_impacts_of_machines_end_as_on_the_reference() {
    let by_speed = Restitution::BySpeed { constant: 0.8, factor: -0.1, power: 0.5 };
    let laws = |e: f64| [(e, 0.0, None), (e, 1e-6, None), (e, 0.0, Some(by_speed))];
    let plane = [(0.3, 1.3), (0.5, 1.0), (0.56, 1.5), (0.2, 2.0), (0.8, 1.2)];
    let contacts = [Contact::Impact, Contact::Rigid];
    let mut cells = Vec::new();
    for (own, omega) in plane {
        for ((e, mesh_speed, restitution), contact) in
            laws(own).into_iter().flat_map(|law| contacts.map(|contact| (law, contact)))
        {
            let pair = GearPair { mesh_speed, ..paper(e, omega) };
            let mut machine = pair.oscillator().unwrap();
            for wall in machine.gaps.iter_mut().flat_map(|gap| gap.walls.iter_mut().flatten()) {
                wall.contact = contact;
                wall.restitution = restitution.unwrap_or(wall.restitution);
            }
            cells.push((machine, pair.law()));
        }
    }
    let forms: Vec<_> = cells.iter().map(|(machine, _)| Form::Machine(machine.clone())).collect();
    let lanes: Vec<_> = (0..cells.len() as u32).map(|flow| Lane { flow, law: 0, start: REST }).collect();
    let orbit = |form: &Form| {
        let flow = Flow::new(form);
        analyse_flow(&flow, cells[0].1, REST, &Settings::default(), EVENT_PERIODS)
    };
    let expected: Vec<_> = forms.par_iter().map(orbit).collect();
    let settings = LaneSettings { features: Features::of(&forms[0]), ..LaneSettings::default() };
    for (precision, bar) in [(Precision::F32, 1e-5), (Precision::F64, 1e-9)] {
        let records =
            pollster::block_on(open(precision).run(&forms, &[cells[0].1], &lanes, &settings)).unwrap();
        for ((record, orbit), (machine, _)) in records.iter().zip(&expected).zip(&cells) {
            let wall = &machine.gaps[0].walls[0][0];
            let at = format!("{precision:?}, omega = {}: {wall:?}", machine.omega);
            assert_eq!(classify(record), orbit.class, "{at}");
            if orbit.class == Class::Chaotic {
                continue;
            }
            let apart = (record.lyapunov - orbit.lyapunov).abs();
            assert!(apart < bar, "{at}: {} {}", record.lyapunov, orbit.lyapunov);
            assert_eq!(record.spelling(), Some(Spelling::new(&orbit.word)), "{at}");
            assert!((record.impacts_per_period - orbit.impacts_per_period).abs() < 1e-9, "{at}");
        }
    }
}

/// A bar on two shaken supports. With `J = 1`, an impact at one end does not move the other end.
const BAR: &str = r#"
name = "bar"
title = "Bar on two supports"
summary = "a bar that falls on two supports at its ends"
[parameters]
J = { default = 1.0, meaning = "moment of inertia" }
A = { default = 2.0, meaning = "force" }
omega = { default = 20.0, meaning = "frequency" }
[motion]
coordinates = ["y", "theta"]
mass = [["1", "0"], ["0", "J"]]
damping = [["0", "0"], ["0", "0"]]
stiffness = [["0", "0"], ["0", "0"]]
force = ["A", "0"]
load = ["-9.81", "0"]
frequency = "omega"
gap = { left = [1, -1], right = [1, 1] }
[[contact]]
gap = "left"
side = "left"
at = "0"
law = "impact"
restitution = "0.7"
[[contact]]
gap = "right"
side = "left"
at = "0"
law = "impact"
restitution = "0.7"
"#;

const SCENE_OF_BAR: &str = r#"
model = "bar.toml"
axis = [
    { parameter = "J", values = [0.3333333333333333, 1.0] },
    { start = "theta", min = 0.0, max = 0.01, count = 2 },
]
[start]
policy = "state"
state = [0.1, 0.0, 0.0, 0.0]
"#;

/// A bar that falls flat has two impacts at once. The gap that comes first in the model has its impact first.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn lanes_see_impacts_at_the_same_time_as_the_reference_does() {
    let model = |_, _: &str| Ok(FileText { name: "bar".into(), text: BAR.into() });
    let scene = Scene::parse_with_files(SCENE_OF_BAR, "s", &[], Purpose::Map, None, &model).unwrap();
    let plan = Plan::new(&scene);
    let expected = all_records(&plan, &mut Engine::Cpu(Cpu::new(&plan)));
    let is_tied = |records: &[Record]| -> Vec<bool> {
        records.iter().map(|record| status(record) == Status::Simultaneous).collect()
    };
    assert_eq!(is_tied(&expected), [true, false, false, false]);
    let cells = plan.cells(0..plan.cell_count());
    let forms: Vec<_> = cells.iter().map(|cell| plan.form(cell.flow)).collect();
    let lane = |(flow, cell): (u32, &Cell)| Lane { flow, law: 0, start: cell.start };
    let lanes: Vec<_> = (0..).zip(&cells).map(lane).collect();
    let settings = LaneSettings { features: Features::of(&forms[0]), ..LaneSettings::only(1) };
    for (precision, rounding) in [(Precision::F32, 1e-7), (Precision::F64, 1e-15)] {
        let mut gpu = open(precision);
        assert_eq!(is_tied(&map(&plan, &mut gpu)), is_tied(&expected), "{precision:?}");
        // The bar falls in the first period.
        let law = plan.law(cells[0].law);
        let records = pollster::block_on(gpu.run(&forms, &[law], &lanes, &settings)).unwrap();
        assert_eq!(is_tied(&records), is_tied(&expected), "{precision:?}");
        for ((record, form), cell) in records.iter().zip(&forms).zip(&cells) {
            let Form::Machine(machine) = form else { panic!("a machine has two gaps") };
            let (end, _) = run(&System::new(machine), &cell.start, 1).unwrap();
            let error = distance(&record.strobe(), &end, machine.omega);
            assert!(error < rounding, "{precision:?}, cell {}: error {error:.1e}", cell.id);
        }
    }
}
