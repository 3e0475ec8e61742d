//! Cycles of random machines, against the integrator by matrix exponentials: class, period, strobe state, multipliers and word.

use nalgebra::DVector;
use rattlemap_dynamics::model::Form;
use rattlemap_dynamics::model::{Contact, GapRow, Law, Oscillator, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, EVENT_PERIODS, Orbit, Status, analyse_flow};
use rattlemap_dynamics::word::Word;
use rayon::prelude::*;

use super::motion::Motion;
use super::random::{Case, any_case, apart};
use super::system::{ANGLE, System};
use crate::common::BUDGET;

/// Largest difference of strobe states, relative to the size of the motion.
const STROBE_OFF: f64 = 1e-10;

/// Largest difference of the moduli of largest multipliers, per forcing period of the cycle.
const MULTIPLIER_OFF: f64 = 1e-7;

/// Rounding errors may have this multiple of the effect of known errors.
const NOISES: f64 = 20.0;

/// Cycles on which known errors have a larger effect are not compared.
const MOST_NOISE: f64 = 1e-9;

/// Distance from a stable cycle, relative to the size of the motion, at which a motion counts as settled.
const SETTLED: f64 = 1e-4;

/// Cycles after which the modes at phase 0 must be those of the cycle.
const MOST_CYCLES: u32 = 50;

/// Forcing periods within which a motion must settle to be compared.
const MOST_PERIODS: usize = 250;

/// Distance in forcing periods at which events of two gaps count as simultaneous: their order is arbitrary then.
const AT_ONCE: f64 = 1e-9;

/// How a cycle of the program compares.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Agreement {
    /// It is a cycle with the same multiplier and word, and the other motion settles on it.
    Cycle,
    /// It is a cycle with the same multiplier and word, but the other motion does not settle on it in time.
    Unsettled,
    /// The program finds no cycle, or errors decide it.
    NotCompared,
}

/// Returns the word of a motion, or none if events of two gaps are simultaneous.
fn word(motion: &Motion, period: f64) -> Option<Word> {
    let several = motion.system.machine.gaps.len() > 1;
    let of_gap = |gap: usize| if several { 8 * (gap as u8 + 1) } else { 0 };
    let flights = motion.events.iter().filter_map(|e| Some((e.t, e.gap, e.symbol? + of_gap(e.gap))));
    let mut all: Vec<_> =
        flights.chain(motion.slips.iter().map(|&(symbol, t)| (t, usize::MAX, symbol))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let are_apart =
        all.windows(2).all(|pair| pair[0].1 == pair[1].1 || pair[1].0 - pair[0].0 > AT_ONCE * period);
    are_apart.then(|| Word::cyclic(&all.iter().map(|one| one.2).collect::<Vec<_>>()))
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

fn compare(case: &Case) -> Result<Agreement, String> {
    let machine = &case.machine;
    let flow = Flow::new(Form::Machine(machine.clone()));
    let orbit = analyse_flow(&flow, Law::both(0.0, 0.0), state(&case.start), &BUDGET.settings, EVENT_PERIODS);
    let (Class::Periodic { period }, Status::Ok | Status::Slow) = (orbit.class, orbit.status) else {
        return Ok(Agreement::NotCompared);
    };
    let system = System::new(machine, ANGLE);
    match follow(&system, &orbit, period) {
        None => Ok(Agreement::NotCompared),
        Some(followed) => {
            followed?;
            let settles = settles(&system, case, &orbit);
            Ok(if settles { Agreement::Cycle } else { Agreement::Unsettled })
        }
    }
}

/// Follows a cycle of the program from its strobe state; none if errors have too much effect on it.
fn follow(system: &System, orbit: &Orbit, period: u32) -> Option<Result<(), String>> {
    let machine = &system.machine;
    let strobe = &orbit.strobe[..2 * machine.degrees()];
    let mut motion = Motion::new(system, strobe);
    // The modes at phase 0, and the symbol of the first flight, depend on the past.
    for _ in 0..MOST_CYCLES {
        for _ in 0..period {
            motion.advance_period()?;
        }
        if apart(&motion.state(), strobe, machine.omega) < SETTLED {
            break;
        }
    }
    motion.set_state(strobe);
    (motion.events, motion.slips) = (Vec::new(), Vec::new());
    let mut shaken = motion.shaken();
    motion.carry_tangents();
    let (mut noise, mut nearest) = (0.0f64, f64::INFINITY);
    for n in 1..=period {
        motion.advance_period()?;
        for other in &mut shaken {
            other.advance_period()?;
            noise = noise.max(apart(&motion.state(), &other.state(), machine.omega));
        }
        if n < period && period.is_multiple_of(n) {
            nearest = nearest.min(apart(&motion.state(), strobe, machine.omega));
        }
    }
    if noise > MOST_NOISE || motion.is_crowded {
        return None;
    }
    let off = apart(&motion.state(), strobe, machine.omega);
    let moduli = motion.derivative().complex_eigenvalues().map(|multiplier| multiplier.norm());
    let radius = moduli.iter().copied().fold(0.0, f64::max);
    let theirs = orbit.floquet.as_ref()?.first().map_or(0.0, |[re, im]| re.hypot(*im));
    // The program leaves the multiplier 1 of an element that sticks for ever out.
    let sticks = !machine.friction.is_empty() && (radius - 1.0).abs() < MULTIPLIER_OFF;
    let by = if sticks { 0.0 } else { (radius - theirs).abs() };
    let error = match word(&motion, machine.period()) {
        _ if off > STROBE_OFF + NOISES * noise => {
            format!("the cycle does not close by {off:e} with noise {noise:e}")
        }
        _ if nearest < 10.0 * STROBE_OFF => "a divisor of the period is a period".to_owned(),
        _ if by > f64::from(period) * (MULTIPLIER_OFF + NOISES * noise) => {
            format!("multipliers {radius} and {theirs}")
        }
        Some(word) if word != orbit.word && !has_friction_at_wall(machine) => {
            format!("words {} and {}", word.time_order(), orbit.word.time_order())
        }
        _ => return Some(Ok(())),
    };
    Some(Err(format!("period {period}: {error}")))
}

/// Whether the motion from the start of a case comes near a strobe state of the program's cycle.
fn settles(system: &System, case: &Case, orbit: &Orbit) -> bool {
    let strobe = &orbit.strobe[..case.start.len()];
    let mut motion = Motion::new(system, &case.start);
    (0..MOST_PERIODS).any(|_| {
        let ends = motion.advance_period().is_none();
        (motion.events, motion.slips) = (Vec::new(), Vec::new());
        !ends && apart(&motion.state(), strobe, case.machine.omega) < SETTLED
    })
}

fn check(seeds: std::ops::Range<u64>) {
    let all: Vec<_> = seeds.into_par_iter().map(|seed| (seed, compare(&any_case(seed)))).collect();
    let failures: Vec<_> = all.iter().filter_map(|(seed, one)| Some((seed, one.as_ref().err()?))).collect();
    let count = |agreement| all.iter().filter(|one| one.1 == Ok(agreement)).count();
    let [cycles, unsettled] = [Agreement::Cycle, Agreement::Unsettled].map(count);
    println!("{cycles} cycles, {unsettled} not settled on, of {}; {} fail", all.len(), failures.len());
    assert!(failures.is_empty(), "{failures:?}");
    assert!(2 * cycles > all.len() && 10 * unsettled < cycles, "{cycles} cycles, {unsettled} not settled on");
}

#[test]
fn cycles_of_machines_agree_with_matrix_exponentials() {
    check(0..200);
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn cycles_of_two_hundred_machines_of_each_shape_agree_with_matrix_exponentials() {
    check(0..2_000);
}
