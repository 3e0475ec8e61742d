//! Cycles of random machines, against the integrator by matrix exponentials: class, period, strobe state, multipliers and word.

use nalgebra::DVector;
use rattlemap_dynamics::model::Form;
use rattlemap_dynamics::model::{Contact, GapRow, Oscillator, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, EVENT_PERIODS, Orbit, Status, analyse_flow, place_of_displacement};
use rayon::prelude::*;

use super::cycle::{Cycle, SETTLED, follow, settle};
use super::motion::Motion;
use super::random::{Case, any_case, apart, bent_case, bent_structured_case, structured_case};
use super::system::{ANGLE, System};
use crate::common::BUDGET;

/// Largest difference of strobe states, relative to the size of the motion.
const STROBE_OFF: f64 = 1e-10;

/// Largest difference of the moduli of largest multipliers, per forcing period of the cycle.
const MULTIPLIER_OFF: f64 = 1e-7;

/// Allowed effect of rounding errors, as a multiple of the effect of the known errors.
const NOISES: f64 = 20.0;

/// Cycles on which known errors have a larger effect are not compared.
const MOST_NOISE: f64 = 1e-9;

/// Forcing periods within which a motion must settle to be compared.
const MOST_PERIODS: usize = 250;

/// Result of the comparison for a cycle of the program.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Agreement {
    /// It is a cycle with the same multiplier and word, and the other motion settles on it.
    Cycle,
    /// It is a cycle with the same multiplier and word, but the other motion does not settle on it in time.
    Unsettled,
    /// The program finds no cycle, or the effect of errors is too large.
    NotCompared,
}

/// Whether an element with dry friction acts along a gap with a rigid wall: at rest, their forces are statically indeterminate, and whether the
/// gap counts as in contact is a convention.
fn has_friction_at_wall(machine: &Oscillator) -> bool {
    let is_parallel =
        |a: &DVector<f64>, b: &DVector<f64>| (a.normalize().dot(&b.normalize()).abs() - 1.0).abs() < 1e-9;
    let is_rigid = |gap: &GapRow| gap.walls.iter().flatten().any(|wall| wall.contact == Contact::Rigid);
    machine
        .gaps
        .iter()
        .filter(|gap| is_rigid(gap))
        .any(|gap| machine.friction.iter().any(|one| is_parallel(&gap.row, &one.row)))
}

fn compare(case: &Case, form: Form) -> Result<Agreement, String> {
    // Relative distances have no meaning when everything comes to rest.
    if case.machine.drives.is_empty() {
        return Ok(Agreement::NotCompared);
    }
    let (machine, flow) = (&case.machine, Flow::new(form));
    let orbit = analyse_flow(&flow, machine.law(), state(&case.start), &BUDGET.settings, EVENT_PERIODS);
    let system = System::new(machine, ANGLE);
    let (Class::Periodic { period }, Status::Ok | Status::Slow | Status::OutOfRange) =
        (orbit.class, orbit.status)
    else {
        let is_open = matches!(orbit.class, Class::Chaotic | Class::QuasiPeriodic)
            || orbit.class == Class::Undecided && orbit.status == Status::Ok;
        return match settle(&system, &case.start, MOST_PERIODS).filter(|cycle| is_open && cycle.radius < 0.99)
        {
            Some(cycle) => Err(format!("{:?}, but a cycle: {cycle:?}", orbit.class)),
            None => Ok(Agreement::NotCompared),
        };
    };
    let strobe = &orbit.strobe[..2 * machine.degrees()];
    let Some(cycle) = follow(&Motion::new(&system, strobe), period as usize) else {
        return Ok(Agreement::NotCompared);
    };
    let noise = cycle.noise;
    if noise > MOST_NOISE {
        return Ok(Agreement::NotCompared);
    }
    let theirs = match orbit.floquet.as_ref() {
        None => return Ok(Agreement::NotCompared),
        Some(all) => all.first().map_or(0.0, |[re, im]| re.hypot(*im)),
    };
    let error = match &cycle.word {
        _ if cycle.off > STROBE_OFF + NOISES * noise => {
            format!("the cycle does not close by {:e} with noise {noise:e}", cycle.off)
        }
        _ if cycle.first_return(10.0 * STROBE_OFF, machine.omega) < period as usize => {
            "a divisor of the period is a period".to_owned()
        }
        _ if (cycle.radius - theirs).abs()
            > f64::from(period) * (MULTIPLIER_OFF + NOISES * noise) + NOISES * cycle.radius_noise =>
        {
            format!("multipliers {} and {theirs}", cycle.radius)
        }
        _ if drifts_apart(&cycle, &orbit, machine) => {
            format!("a drift of {} but {:?}", cycle.drift, orbit.quantities)
        }
        Some(word) if *word != orbit.word && !has_friction_at_wall(machine) => {
            format!("words {} and {}", word.time_order(), orbit.word.time_order())
        }
        _ => match settled(&system, case, &orbit) {
            None => return Ok(Agreement::Unsettled),
            Some(motion) => {
                let is_out = motion.is_out_of_range || cycle.is_out_of_range;
                if is_out == (orbit.status == Status::OutOfRange) {
                    return Ok(Agreement::Cycle);
                }
                format!("out of range: {is_out}, but {:?}", orbit.status)
            }
        },
    };
    Err(format!("period {period}: {error}"))
}

/// Whether mean rates of coordinates that drift differ.
fn drifts_apart(cycle: &Cycle, orbit: &Orbit, machine: &Oscillator) -> bool {
    let Some(quantities) = &orbit.quantities else { return orbit.floquet.is_some() };
    let size = orbit.strobe.iter().fold(machine.length_scale() * machine.omega, |size, x| size.max(x.abs()));
    cycle.drift.iter().enumerate().any(|(i, drift)| {
        let theirs = quantities.displacements[place_of_displacement(i)].drift.unwrap_or(0.0);
        (drift - theirs).abs() > 1e-8 * size
    })
}

/// Returns the motion from the start of a case when it has come near a strobe state of the program's cycle.
fn settled<'a>(system: &'a System, case: &Case, orbit: &Orbit) -> Option<Motion<'a>> {
    let strobe = &Motion::new(system, &orbit.strobe[..case.start.len()]).state();
    let mut motion = Motion::new(system, &case.start);
    let is_near = (0..MOST_PERIODS).any(|_| {
        let ends = motion.advance_period().is_none();
        motion.clear();
        !ends && apart(&motion.state(), strobe, case.machine.omega) < SETTLED
    });
    is_near.then_some(motion)
}

fn check(seeds: std::ops::Range<u64>, result: impl Fn(u64) -> Result<Agreement, String> + Sync) {
    let all: Vec<_> = seeds.into_par_iter().map(|seed| (seed, result(seed))).collect();
    let failures: Vec<_> = all.iter().filter_map(|(seed, one)| Some((seed, one.as_ref().err()?))).collect();
    let count = |agreement| all.iter().filter(|one| one.1 == Ok(agreement)).count();
    let [cycles, unsettled] = [Agreement::Cycle, Agreement::Unsettled].map(count);
    println!("{cycles} cycles, {unsettled} not settled on, of {}; {} fail", all.len(), failures.len());
    assert!(failures.is_empty(), "{failures:?}");
    assert!(2 * cycles > all.len() && 10 * unsettled < cycles, "{cycles} cycles, {unsettled} not settled on");
}

fn any(seed: u64) -> Result<Agreement, String> {
    let case = any_case(seed);
    compare(&case, Form::Machine(case.machine.clone()))
}

/// Compares a machine that drifts, a symmetric one, or any, by the engine that the program chooses.
fn structured(seed: u64) -> Result<Agreement, String> {
    let case = structured_case(seed);
    compare(&case, Form::from(&case.machine))
}

#[test]
fn cycles_of_machines_agree_with_matrix_exponentials() {
    check(0..30, any);
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn cycles_of_two_hundred_machines_of_each_shape_agree_with_matrix_exponentials() {
    check(0..2_000, any);
}

fn bent(seed: u64) -> Result<Agreement, String> {
    let case = if seed.is_multiple_of(2) { bent_case(seed / 2) } else { bent_structured_case(seed / 2) };
    compare(&case, Form::from(&case.machine))
}

#[test]
fn cycles_of_machines_with_curves_agree_with_matrix_exponentials() {
    check(0..30, bent);
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn cycles_of_two_thousand_machines_with_curves_agree_with_matrix_exponentials() {
    check(0..2_000, bent);
}

#[test]
fn drifting_and_symmetric_machines_agree_with_matrix_exponentials() {
    check(0..24, structured);
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn two_thousand_drifting_and_symmetric_machines_agree_with_matrix_exponentials() {
    check(0..2_000, structured);
}
