//! Motions with closed forms, computed by the reference and by lanes in f32 and f64.

use std::f64::consts::TAU;

use crate::common::pairs::{AsPair, omega_of};
use rattlemap_dynamics::model::Form;
use std::sync::LazyLock;

use nalgebra::Matrix4;

use crate::common::BUDGET;
use crate::common::closed_form::Walled;
use crate::common::gpu::open;
use crate::gallery::ball::{ball, bounce, window};
use crate::gallery::clearance;
use crate::gallery::clutch;
use crate::gallery::cycle::{eigenvalues, followed, multipliers};
use crate::gallery::elastic::{backlash, bilinear, soft};
use crate::gallery::loose_gear::gear;
use crate::gallery::machines;
use crate::gallery::meissner;
use crate::gallery::models;
use crate::gallery::single_impact::stable;
use rattlemap::gpu::{Features, Gpu, Lane, LaneSettings, Precision};
use rattlemap::map::engine::measured_record;
use rattlemap::map::plan::Needs;
use rattlemap::record::Record;
use rattlemap_dynamics::machine::{MachineMotion, System};
use rattlemap_dynamics::model::{Contact, Law, Model, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Budget, Settings, measure};

/// A stable cycle with a closed form.
struct Known {
    what: String,
    oscillator: Form,
    law: Law,
    period: u32,
    /// State at phase 0.
    strobe: State,
    /// Modulus of the largest multiplier.
    radius: f64,
    impacts: f64,
    /// Whether it is in contact all the time.
    stays: bool,
    /// Speed that counts as much as a displacement of 1: 1, or the excitation frequency of models with units.
    unit: f64,
}

/// All cycles. Computing them takes longer than following one on all engines.
static KNOWN: LazyLock<Vec<Known>> = LazyLock::new(known_cycles);

fn known_cycles() -> Vec<Known> {
    let mut list = Vec::new();
    let without_rest = |what, (oscillator, law), period, strobe, radius, impacts| {
        let oscillator = Form::Pair(oscillator);
        Known { what, oscillator, law, period, strobe, radius, impacts, stays: false, unit: 1.0 }
    };
    for (stop, period) in stable() {
        let orbit = stop.orbits(period)[0];
        let radius = eigenvalues(orbit.monodromy)[0].norm();
        let what = format!("one stop, omega = {}, n = {period}", stop.omega);
        list.push(without_rest(what, stop.walled().oscillator(), period, orbit.strobe, radius, 1.0));
    }
    for e in [0.3, 0.5, 0.8] {
        let [born, doubles] = window(e);
        for share in [0.2, 0.5, 0.8] {
            let shaking = born + share * (doubles - born);
            // Below G = 1 a ball that sticks is never released.
            let (strobe, matrix) = bounce(shaking, e);
            let (radius, what) = (eigenvalues(matrix)[0].norm(), format!("ball, e = {e}, G = {shaking:.3}"));
            list.push(without_rest(what, ball(shaking, e).oscillator(), 1, strobe, radius, 1.0));
        }
    }
    for (what, model) in clearance::clearances() {
        for orbit in clearance::symmetric(&model) {
            let monodromy: Matrix4<f64> = orbit.half * orbit.half;
            let [re, im] = multipliers(&monodromy).unwrap()[0];
            let radius = re.hypot(im);
            if orbit.is_free_between && radius < 1.0 {
                list.push(without_rest(what.clone(), model.clone(), 1, orbit.strobe, radius, 2.0));
            }
        }
    }
    let of_clutch = clutch::cycles().into_iter().map(|cycle| (cycle, true));
    for (cycle, is_bare) in models::cycles().into_iter().map(|cycle| (cycle, false)).chain(of_clutch) {
        let models::Cycle { what, oscillator, law, period, strobe, radius, impacts, stays } = cycle;
        let unit = if is_bare { 1.0 } else { omega_of(&oscillator) };
        let (strobe, impacts) = (state(&strobe), f64::from(impacts));
        list.push(Known { what, oscillator, law, period, strobe, radius, impacts, stays, unit });
    }
    for cycle in machines::cycles() {
        let machines::Cycle { what, machine, strobe, radius, impacts } = cycle;
        let (oscillator, law) = (Form::Machine(machine), Law::both(0.0, 0.0));
        let unit = omega_of(&oscillator);
        list.push(Known { what, oscillator, law, period: 1, strobe, radius, impacts, stays: false, unit });
    }
    let settling = [
        ("bilinear", bilinear(1.7, 1.0), [0.0, 0.0], 0),
        ("soft impacts", soft(0.85, 0.7), [0.0, 0.0], 0),
        // Between the folds there are two cycles, with and without separation.
        ("backlash, together", backlash(0.78), [1.1, 0.0], 0),
        ("backlash, parting", backlash(0.78), [0.8, 0.0], 0),
        ("backlash", backlash(1.1), [0.8, 0.0], 0),
        ("loose gear, two impacts", gear(3.0, 5e-3, 0.6), [0.0, 0.0], 2),
        ("loose gear, three impacts", gear(5.0, 2e-3, 0.8), [0.0, 0.0], 3),
        ("loose gear, in contact", gear(0.99, 1e-4, 0.6), [0.0, 0.0], 0),
    ];
    for (what, walled, start, impacts) in settling {
        let ([x, v], period) = settled(&walled, start);
        let (oscillator, law) = walled.oscillator();
        let stays = ["together", "in contact"].iter().any(|end| what.ends_with(end));
        let is_stuck = stays && oscillator.contacts[0] == Contact::Rigid;
        // The multipliers are a complex pair, except on a rigid wall, where they are 0. The product of a pair is the change of the
        // phase volume, which the damper and the impacts determine.
        let damped = (-0.5 * walled.free.c / walled.free.m * f64::from(period) * walled.free.period()).exp();
        let radius = if is_stuck { 0.0 } else { damped * law.restitution[0].powi(impacts) };
        let (what, strobe, impacts) = (what.to_owned(), state(&[x, v]), f64::from(impacts));
        let oscillator = Form::Pair(oscillator);
        list.push(Known { what, oscillator, law, period, strobe, radius, impacts, stays, unit: 1.0 });
    }
    list
}

/// Returns a state and a period of a cycle of the closed forms, near the last state of the reference.
fn settled(walled: &Walled, [x, v]: [f64; 2]) -> ([f64; 2], u32) {
    let (oscillator, law) = walled.oscillator();
    let [x, v, ..] = followed(&oscillator, law, state(&[x, v]), 1200).end;
    let back = |period: u32| walled.run([x, v], period).0;
    let closes = |period: &u32| (x - back(*period)[0]).hypot(v - back(*period)[1]) < 1e-13;
    let period = (1..=8).find(closes).expect("a cycle");
    (back(period), period)
}

const SETTINGS: Settings = Settings { transient_periods: 400, observed_periods: 128, max_period: 16 };

fn budget() -> Budget {
    Budget { settings: SETTINGS, undecided_periods: 0, ..BUDGET }
}

/// Returns a start near the cycle.
fn start(known: &Known) -> State {
    known.strobe.map(|x| 1.001 * x)
}

/// Returns the largest difference of displacements, and of velocities over a unit.
fn distance(a: &State, b: &State, unit: f64) -> f64 {
    let unit = |i: usize| if i.is_multiple_of(2) { 1.0 } else { unit };
    (0..a.len()).map(|i| (a[i] - b[i]).abs() / unit(i)).fold(0.0, f64::max)
}

/// Returns the states of a cycle at phase 0.
fn images(known: &Known) -> Vec<State> {
    let Form::Machine(machine) = &known.oscillator else {
        let at = |n: u32| followed(&known.oscillator, known.law, known.strobe, n).end;
        return (0..known.period).map(at).collect();
    };
    let system = System::new(machine);
    let mut motion = MachineMotion::new(&system, &known.strobe);
    let next = |_| {
        let state = motion.state();
        motion.advance_period(&mut ()).expect("an ordinary motion");
        state
    };
    (0..known.period).map(next).collect()
}

/// Returns the errors of a record: that of the state, relative to the motion, and that of the logarithm of the
/// multiplier.
fn off(known: &Known, record: &Record) -> [f64; 2] {
    assert_eq!(record.period, known.period, "{}: {record:?}", known.what);
    let impacts = known.impacts / f64::from(known.period);
    assert!((record.impacts_per_period - impacts).abs() < 1e-9, "{}: {record:?}", known.what);
    assert_eq!(record.is_always_in_contact(), known.stays, "{}: {record:?}", known.what);
    let apart = |at: State| distance(&record.strobe(), &at, known.unit);
    let near = images(known).into_iter().map(apart).fold(f64::INFINITY, f64::min);
    let size = distance(&known.strobe, &state(&[]), known.unit);
    let span = f64::from(known.period) * TAU / omega_of(&known.oscillator);
    // A cycle at rest has no size.
    let error = if near == 0.0 { 0.0 } else { near / size };
    if known.radius == 0.0 {
        assert_eq!(record.lyapunov, f64::NEG_INFINITY, "{}: {record:?}", known.what);
        return [error, 0.0];
    }
    [error, (record.lyapunov * span - known.radius.ln()).abs()]
}

/// Returns the largest errors of states, of those of models with units, and of multipliers.
fn worst(known_cycles: &[&Known], records: &[Record], engine: &str) -> [f64; 3] {
    let mut worst = [0.0f64; 3];
    for (known, record) in known_cycles.iter().zip(records) {
        let off = off(known, record);
        println!("{engine}, {}: state {:.1e}, ln |mu| {:.1e}", known.what, off[0], off[1]);
        let place = usize::from(known.unit != 1.0);
        worst[place] = worst[place].max(off[0]);
        worst[2] = worst[2].max(off[1]);
    }
    worst
}

#[test]
fn the_reference_finds_known_cycles() {
    let record = |known: &&Known| {
        let flow = Flow::new(&known.oscillator);
        measured_record(&measure(&flow, known.law, start(known), &budget()), &Needs::EVERYTHING)
    };
    let all: Vec<&Known> = KNOWN.iter().collect();
    let records: Vec<Record> = all.iter().map(record).collect();
    let off = worst(&all, &records, "reference");
    assert!(off.iter().all(|&off| off < 1e-12), "{off:?}");
}

/// Runs a lane for each oscillator with its law and start.
fn run(gpu: &mut Gpu, cells: &[(Form, Law, State)], settings: &LaneSettings) -> Vec<Record> {
    let flows: Vec<Form> = cells.iter().map(|cell| cell.0.clone()).collect();
    let laws: Vec<Law> = cells.iter().map(|cell| cell.1).collect();
    let lanes: Vec<Lane> =
        (0..).zip(cells).map(|(i, cell)| Lane { flow: i, law: i, start: cell.2 }).collect();
    pollster::block_on(gpu.run(&flows, &laws, &lanes, settings)).unwrap()
}

/// Returns settings with the features of all these oscillators.
fn settings<'o>(oscillators: impl Iterator<Item = &'o Form>, settings: LaneSettings) -> LaneSettings {
    LaneSettings {
        features: oscillators.map(Features::of).fold(settings.features, Features::and),
        ..settings
    }
}

/// Limits of [`worst`] for lanes.
fn bars(precision: Precision) -> [f64; 3] {
    match precision {
        Precision::F32 => [1e-6, 2e-6, 1e-5],
        Precision::F64 => [1e-10; 3],
    }
}

/// Which closed forms lanes are compared with: each group needs a shader of its own.
#[derive(Clone, Copy, PartialEq)]
enum Group {
    /// Pairs with a force of one harmonic, without stages.
    Plain,
    Pairs,
    Machines,
}

impl Group {
    fn has(self, known: &Known) -> bool {
        let Features { machine, harmonics, stages, .. } = Features::of(&known.oscillator);
        match self {
            Group::Plain => machine.is_none() && harmonics == 0 && !stages,
            Group::Pairs => machine.is_none(),
            Group::Machines => machine.is_some(),
        }
    }
}

/// Compares lanes with the closed forms of a group. Returns these.
fn check_lanes(gpu: &mut Gpu, group: Group) -> Vec<&'static Known> {
    let group: Vec<&Known> = KNOWN.iter().filter(|known| group.has(known)).collect();
    let cells: Vec<_> =
        group.iter().map(|known| (known.oscillator.clone(), known.law, start(known))).collect();
    let settings = settings(cells.iter().map(|cell| &cell.0), LaneSettings::within(&budget()));
    let records = run(gpu, &cells, &settings);
    let off = worst(&group, &records, gpu.precision().name());
    assert!(off.iter().zip(bars(gpu.precision())).all(|(off, bar)| *off < bar), "{off:?}");
    group
}

/// Small motion of Meissner's equation meets the stops where rest is unstable, and nowhere else. The shader is that of the `plain` cycles.
fn check_borders(gpu: &mut Gpu, plain: &[&Known]) {
    let points = meissner::points();
    let small = state(&[0.01]);
    let cells: Vec<_> =
        points.iter().map(|point| (Form::Pair(point.model.pair()), point.model.law(), small)).collect();
    let all = plain.iter().map(|known| &known.oscillator).chain(cells.iter().map(|cell| &cell.0));
    let records = run(gpu, &cells, &settings(all, LaneSettings::within(&budget())));
    for (point, record) in points.iter().zip(&records) {
        let stays = record.period == 1 && record.is_contact_free();
        assert_eq!(stays, point.is_stable, "{}: {record:?}", point.what);
    }
}

/// Forcing periods over which lanes follow the chain.
const CHAIN_PERIODS: u32 = 8;

/// Compares the chain of masses with its closed form between impacts.
fn check_chain(gpu: &mut Gpu, bar: f64) {
    let (machine, start, end, impacts) = machines::chain(CHAIN_PERIODS);
    let (omega, flow) = (machine.omega, Form::Machine(machine));
    let settings = settings([&flow].into_iter(), LaneSettings::only(CHAIN_PERIODS));
    let [record] = &run(gpu, &[(flow, Law::both(0.0, 0.0), start)], &settings)[..] else {
        unreachable!("one lane has one record")
    };
    let off = distance(&record.strobe(), &end, omega) / distance(&end, &state(&[]), omega);
    println!("chain: state {off:.1e} after {impacts} impacts");
    let found = (record.impacts_per_period * f64::from(CHAIN_PERIODS)).round();
    assert_eq!((record.status, found), (0, f64::from(impacts)));
    assert!(impacts > 3 && off < bar, "{impacts} {off:e}");
}

#[test]
fn lanes_find_known_cycles() {
    check_lanes(&mut open(Precision::F32), Group::Plain);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn lanes_find_known_cycles_of_all_pairs() {
    for precision in Precision::ALL {
        let mut gpu = open(precision);
        let pairs = check_lanes(&mut gpu, Group::Pairs);
        check_borders(&mut gpu, &pairs);
    }
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn lanes_find_known_cycles_of_machines() {
    check_lanes(&mut open(Precision::F32), Group::Machines);
    let mut gpu = open(Precision::F64);
    check_lanes(&mut gpu, Group::Machines);
    // Impacts amplify errors of the chain by more than 1e4, so that single precision would show nothing.
    check_chain(&mut gpu, bars(Precision::F64)[0]);
}
