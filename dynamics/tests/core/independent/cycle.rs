//! Stable cycles of a motion by matrix exponentials: recurrence of strobe states, then Newton's method.

use nalgebra::{Matrix4, Vector4};
use rattlemap_dynamics::model::{Law, State, state};
use rattlemap_dynamics::word::Word;

use super::motion::{Grip, Mode, Motion, System, What, distance};

/// Longest cycle that is searched, in forcing periods.
pub(crate) const LONGEST: usize = 12;

/// Relative distance of recurring states from which Newton's method begins.
const RECURS: f64 = 1e-5;

/// Largest error of a cycle, relative to the size of the motion.
const CLOSES: f64 = 1e-12;

/// What is known of a cycle.
#[derive(Clone, Debug)]
pub(crate) struct Cycle {
    /// State and modes at each phase 0.
    pub(crate) strobes: Vec<(State, Mode, [Grip; 2])>,
    /// Largest modulus of a multiplier, without those of elements that stick for ever.
    pub(crate) radius: f64,
    pub(crate) word: Word,
    pub(crate) impacts: usize,
    /// Share of the time in contact.
    pub(crate) meshes: f64,
    /// Distance of the end from the start, relative to the size of the motion.
    pub(crate) off: f64,
    /// Largest distance of a motion with larger rounding errors at phase 0.
    pub(crate) noise: f64,
}

fn image(motion: &mut Motion, periods: usize) -> Option<(Vector4<f64>, Matrix4<f64>)> {
    motion.carry_tangents();
    for _ in 0..periods {
        motion.advance_period()?;
    }
    Some((motion.vector(), derivative(motion)?))
}

/// Returns the derivative of a state. The second displacement of a single oscillator counts as constant.
fn derivative(motion: &Motion) -> Option<Matrix4<f64>> {
    let mut derivative = motion.tangents?;
    if motion.system.degrees == 1 {
        derivative.fixed_view_mut::<2, 2>(2, 2).fill(0.0);
    }
    Some(derivative)
}

/// Follows a cycle from its state at phase 0.
pub(crate) fn follow(start: &Motion, period: usize) -> Option<Cycle> {
    let (system, rate) = (start.system, start.rate());
    let mut motion = start.clone();
    motion.clear();
    // The first flight has a symbol only if the last event is known.
    for _ in 0..period {
        motion.advance_period()?;
    }
    motion.set_state(start.state());
    motion.for_good = motion.slid.map(|slid| slid == 0.0);
    motion.clear();
    let mut shaken = motion.shaken();
    let mut strobes = Vec::new();
    motion.carry_tangents();
    let mut noise = 0.0f64;
    for _ in 0..period {
        strobes.push((motion.state(), motion.mode, motion.grips));
        motion.advance_period()?;
        noise = noise.max(motion.noise(&mut shaken)?);
    }
    Some(Cycle {
        radius: derivative(&motion)?.complex_eigenvalues().iter().map(|m| m.norm()).fold(0.0, f64::max),
        word: Word::cyclic(&motion.symbols),
        impacts: motion.events.iter().filter(|event| event.0 == What::Impact).count(),
        meshes: motion.meshing_time / (period as f64 * system.period),
        off: distance(motion.state(), start.state(), rate),
        noise,
        strobes,
    })
}

/// Searches a stable cycle near the present state.
fn newton(near: &Motion, period: usize) -> Option<Cycle> {
    let rate = near.rate();
    let mut at = near.clone();
    at.clear();
    let mut moved = at.clone();
    image(&mut moved, period)?;
    at.for_good = moved.slid.map(|slid| slid == 0.0);
    for _ in 0..12 {
        let from = at.vector();
        let mut moved = at.clone();
        let (to, derivative) = image(&mut moved, period)?;
        let step = (Matrix4::identity() - derivative).lu().solve(&(to - from))?;
        let next = state((from + step).as_slice());
        let length = distance(next, at.state(), rate);
        at.set_state(next);
        if length < 1e-14 {
            break;
        }
    }
    let mut cycle = follow(&at, period)?;
    let closes = |part: &usize| distance(cycle.strobes[*part].0, cycle.strobes[0].0, rate) < 1e-9;
    if let Some(part) = (1..period).filter(|part| period.is_multiple_of(*part)).find(closes) {
        cycle = follow(&at, part)?;
    }
    let is_near = distance(at.state(), near.state(), rate) < 0.01;
    (is_near && cycle.off < CLOSES && cycle.radius < 1.0).then_some(cycle)
}

/// Follows a motion until it is near a stable cycle; none if that does not happen.
pub(crate) fn settle(system: &System, law: Law, start: State, most_periods: usize) -> Option<Cycle> {
    let mut motion = Motion::new(system, law, start, Mode::Free);
    let rate = motion.rate();
    let mut strobes = vec![(start, motion.mode, motion.grips)];
    for n in 1..=most_periods {
        motion.advance_period()?;
        motion.clear();
        strobes.push((motion.state(), motion.mode, motion.grips));
        if n < 30 || n % 10 > 0 {
            continue;
        }
        let recurs = |lag: usize| {
            (n + 1 - 2 * lag..=n).all(|i| {
                let ((a, mode, grips), (b, before, grips_before)) = (strobes[i], strobes[i - lag]);
                (mode, grips) == (before, grips_before) && distance(a, b, rate) < RECURS
            })
        };
        let found = (1..=LONGEST.min(n / 3)).find(|&lag| recurs(lag));
        if let Some(cycle) = found.and_then(|lag| newton(&motion, lag)) {
            return Some(cycle);
        }
    }
    None
}
