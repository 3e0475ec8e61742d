//! Stable cycles of a motion by matrix exponentials: recurrence of strobe states, then Newton's method.

use nalgebra::DVector;
use rattlemap_dynamics::word::Word;

use super::motion::{Mode, Motion, What};
use super::random::apart;
use super::system::{ANGLE, Grip, Matrix, System, Vector};

/// Longest cycle that is searched, in forcing periods.
const LONGEST: usize = 12;

/// Relative distance of recurring states from which Newton's method begins.
const RECURS: f64 = 1e-5;

/// Largest error of a cycle, relative to the size of the motion.
const CLOSES: f64 = 1e-12;

/// Distance from a cycle, relative to the size of the motion, at which a motion has the modes of the cycle.
pub(crate) const SETTLED: f64 = 1e-4;

/// Number of cycles after which the modes at phase 0 must agree with the modes of the cycle.
const MOST_CYCLES: u32 = 50;

/// Distance in forcing periods at which events of two gaps count as simultaneous: their order is arbitrary then.
const AT_ONCE: f64 = 1e-9;

/// State and modes at phase 0.
type Strobe = (Vec<f64>, Vec<Mode>, Vec<Grip>);

/// Properties of a cycle.
#[derive(Clone, Debug)]
pub(crate) struct Cycle {
    pub(crate) strobes: Vec<Strobe>,
    /// Largest modulus of the multipliers, except multipliers of elements that stick for ever and of conserved momenta.
    pub(crate) radius: f64,
    /// Difference of this modulus with other steps.
    pub(crate) radius_noise: f64,
    /// Mean rates of the coordinates along directions in which nothing holds the machine.
    pub(crate) drift: Vector,
    /// None if events of two gaps are simultaneous.
    pub(crate) word: Option<Word>,
    pub(crate) impacts: usize,
    /// Share of the time in contact.
    pub(crate) meshes: f64,
    /// Whether a nonlinear spring is beyond its points somewhere.
    pub(crate) is_out_of_range: bool,
    /// Distance of the end from the start, relative to the size of the motion.
    pub(crate) off: f64,
    /// Largest distance at phase 0 of a motion with larger rounding errors.
    pub(crate) noise: f64,
}

impl Cycle {
    /// Returns the first number of periods after which the state recurs.
    pub(crate) fn first_return(&self, within: f64, rate: f64) -> usize {
        let count = self.strobes.len();
        let recurs = |n: &usize| apart(&self.strobes[*n].0, &self.strobes[0].0, rate) < within;
        (1..count).filter(|n| count.is_multiple_of(*n)).find(recurs).unwrap_or(count)
    }
}

fn strobe(motion: &Motion) -> Strobe {
    (motion.state(), motion.modes(), motion.grips.clone())
}

fn word(motion: &Motion) -> Option<Word> {
    let machine = &motion.system.machine;
    let events = motion.events.iter().map(|event| (event.t, event.gap));
    let mut all: Vec<_> = events.chain(motion.slips.iter().map(|&(_, t)| (t, usize::MAX))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_apart =
        |pair: &[(f64, usize)]| pair[0].1 == pair[1].1 || pair[1].0 - pair[0].0 > AT_ONCE * machine.period();
    let are_apart = machine.gaps.len() == 1 || all.windows(2).all(is_apart);
    are_apart.then(|| Word::cyclic(&motion.symbols))
}

fn image(motion: &mut Motion, periods: usize) -> Option<(Vector, Matrix)> {
    motion.carry_tangents();
    for _ in 0..periods {
        motion.advance_period()?;
    }
    Some((DVector::from_vec(motion.state()), motion.derivative()))
}

/// Follows a cycle from its state at phase 0; none if the motion does not end or impacts of several gaps follow each other at one time.
pub(crate) fn follow(start: &Motion, period: usize) -> Option<Cycle> {
    let (system, at, rate) = (start.system, start.state(), start.system.machine.omega);
    let mut motion = start.clone();
    // The modes at phase 0, and the symbol of the first flight, depend on the past.
    for _ in 0..MOST_CYCLES {
        motion.clear();
        for _ in 0..period {
            motion.advance_period()?;
        }
        if apart(&motion.state(), &at, rate) < SETTLED {
            break;
        }
    }
    motion.set_state(&at);
    motion.for_good = motion.slid.iter().map(|slid| *slid == 0.0).collect();
    motion.clear();
    let mut shaken = motion.shaken();
    let (mut strobes, mut noise) = (Vec::new(), 0.0f64);
    let finer = System::new(&system.machine, 0.6 * ANGLE);
    let mut other = motion.in_system(&finer);
    motion.carry_tangents();
    other.carry_tangents();
    for _ in 0..period {
        strobes.push(strobe(&motion));
        motion.advance_period()?;
        other.advance_period()?;
        noise = noise.max(motion.noise(&mut shaken)?);
    }
    let radius = |motion: &Motion| {
        let mut multipliers: Vec<_> = motion.derivative().complex_eigenvalues().iter().copied().collect();
        multipliers.sort_by(|a, b| (a - 1.0).norm().total_cmp(&(b - 1.0).norm()));
        multipliers[system.conserved..].iter().map(|m| m.norm()).fold(0.0, f64::max)
    };
    Some(Cycle {
        radius: radius(&motion),
        radius_noise: (radius(&motion) - radius(&other)).abs(),
        drift: &motion.travelled / (period as f64 * system.period),
        word: word(&motion),
        impacts: motion.events.iter().filter(|event| event.what == What::Impact).count(),
        meshes: motion.meshing_time / (period as f64 * system.period),
        is_out_of_range: motion.is_out_of_range,
        off: apart(&motion.state(), &at, rate),
        noise,
        strobes,
    })
    .filter(|_| !motion.is_crowded)
}

/// Searches a stable cycle near the present state.
fn newton(near: &Motion, period: usize) -> Option<Cycle> {
    let rate = near.system.machine.omega;
    let mut at = near.clone();
    at.clear();
    let mut moved = at.clone();
    image(&mut moved, period)?;
    at.for_good = moved.slid.iter().map(|slid| *slid == 0.0).collect();
    for _ in 0..12 {
        let from = at.state();
        let (to, derivative) = image(&mut at.clone(), period)?;
        // A conserved momentum stays as it is.
        let step = (Matrix::identity(to.len(), to.len()) - derivative)
            .svd(true, true)
            .solve(&(to - DVector::from_vec(from.clone())), 1e-9)
            .ok()?;
        let next: Vec<f64> = from.iter().zip(&step).map(|(from, step)| from + step).collect();
        at.set_state(&next);
        if apart(&next, &from, rate) < 1e-14 {
            break;
        }
    }
    let mut cycle = follow(&at, period)?;
    let first = cycle.first_return(1e-9, rate);
    if first < period {
        cycle = follow(&at, first)?;
    }
    let is_near = apart(&at.state(), &near.state(), rate) < 0.01;
    (is_near && cycle.off < CLOSES && cycle.radius < 1.0).then_some(cycle)
}

/// Follows a motion until it is near a stable cycle; none if that does not happen.
pub(crate) fn settle(system: &System, start: &[f64], most_periods: usize) -> Option<Cycle> {
    let mut motion = Motion::new(system, start);
    let mut strobes = vec![strobe(&motion)];
    for n in 1..=most_periods {
        motion.advance_period()?;
        motion.clear();
        strobes.push(strobe(&motion));
        if n < 30 || n % 10 > 0 {
            continue;
        }
        let recurs = |lag: usize| {
            (n + 1 - 2 * lag..=n).all(|i| {
                let ((a, modes, grips), (b, before, grips_before)) = (&strobes[i], &strobes[i - lag]);
                (modes, grips) == (before, grips_before) && apart(a, b, system.machine.omega) < RECURS
            })
        };
        let found = (1..=LONGEST.min(n / 3)).find(|&lag| recurs(lag));
        if let Some(cycle) = found.and_then(|lag| newton(&motion, lag)) {
            return Some(cycle);
        }
    }
    None
}
