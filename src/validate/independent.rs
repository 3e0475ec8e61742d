//! Independent judge: an adaptive ODE solver with event location that shares only the description of the oscillator with
//! the reference.
//!
//! The motion is integrated over the whole budget. It is periodic if its strobe states recur and the cycle is stable;
//! multipliers come from finite differences of neighbouring motions. It is chaotic if a neighbouring motion separates from
//! it. Otherwise, for instance while a motion approaches its cycle slowly, the judge gives no answer.

pub mod dop853;
pub mod field;
pub mod flight;
#[cfg(test)]
mod tests;

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{DMatrix, Matrix4};

use crate::map::plan::Plan;
use crate::record::classify::CHAOS_ERRORS;
use crate::record::distance::{self, farther};
use crate::record::{Record, Records, valid};
use dop853::Solver;
use flight::{Ended, Flight, Slip};
use rattlemap_dynamics::model::{Law, MOST_FRICTION, Oscillator, Side, State};
use rattlemap_dynamics::orbit::{Budget, Status};
use rattlemap_dynamics::reference::EventKind;
use rattlemap_dynamics::stability::{multipliers, standard_error};
use rattlemap_dynamics::word::Word;

/// Relative and absolute tolerance of one step.
const TOLERANCE: f64 = 1e-12;

/// Relative distance below which two strobe states are the same.
const RECURS: f64 = 1e-7;

/// Relative distance below which two strobe states may still converge.
const NEARLY_RECURS: f64 = 1e-4;

/// Largest distance from phase 0, in turns, of an event that rounding may put before or after the strobe. Then states at
/// another phase are compared.
const ON_STROBE: f64 = 1e-7;

/// Relative displacement of a neighbouring motion.
const DISPLACEMENT: f64 = 1e-7;

/// Smallest multiplier that these finite differences resolve.
const LEAST_MULTIPLIER: f64 = 1e-4;

/// A motion that advances from strobe to strobe.
#[derive(Clone)]
struct Strobed<'a> {
    solver: Solver,
    period: f64,
    /// Time since phase 0 at which states are compared.
    from: f64,
    flight: Flight,
    /// The last event before the current period.
    before: Option<Ended>,
    tally: Tally,
    /// Once set, the integration stops.
    halt: &'a AtomicBool,
}

/// Events and meshing time since the tally began.
#[derive(Clone, Debug, Default)]
struct Tally {
    impacts: usize,
    /// Whether an infinite series of impacts was cut off, so that `impacts` is too small.
    series: bool,
    meshing_time: f64,
    symbols: Vec<u8>,
    /// Phases of events, in turns.
    phases: Vec<f64>,
    /// Elements with dry friction that changed their mode.
    slipped: [bool; MOST_FRICTION],
}

impl Tally {
    /// Counts changes of friction.
    fn count(&mut self, slips: impl Iterator<Item = Slip>, period: f64) {
        for slip in slips {
            self.symbols.extend(slip.symbol);
            self.phases.push((slip.t / period).fract());
            self.slipped[slip.element] = true;
        }
    }
}

impl Strobed<'_> {
    fn new<'a>(oscillator: &Oscillator, law: Law, start: State, halt: &'a AtomicBool) -> Strobed<'a> {
        Strobed {
            solver: Solver { omega: oscillator.omega, tolerance: TOLERANCE },
            period: oscillator.period(),
            from: 0.0,
            flight: Flight::new(oscillator, law, start),
            before: None,
            tally: Tally::default(),
            halt,
        }
    }

    /// Advances by one forcing period; none if the solver fails or is halted.
    fn advance(&mut self) -> Option<()> {
        if self.halt.load(Ordering::Relaxed) {
            return None;
        }
        let meshed = self.flight.meshing().is_some();
        let until = self.from + self.period;
        self.solver.advance(&mut self.flight, self.from, until)?;
        let mut meshing_since = meshed.then_some(self.from);
        let mut slips = std::mem::take(&mut self.flight.slips).into_iter().peekable();
        for (n, ended) in std::mem::take(&mut self.flight.events).into_iter().enumerate() {
            self.tally.count(std::iter::from_fn(|| slips.next_if(|slip| slip.after <= n)), self.period);
            self.tally.series |= ended.after_series;
            self.tally.phases.push((ended.t / self.period).fract());
            if ended.kind == EventKind::Impact {
                self.tally.impacts += 1;
            }
            match (meshing_since, ended.meshing) {
                (None, Some(_)) => meshing_since = Some(ended.t),
                (Some(since), None) => {
                    self.tally.meshing_time += ended.t - since;
                    meshing_since = None;
                }
                _ => {}
            }
            self.tally.symbols.extend(self.before.map(|before| symbol(before, ended.side)));
            self.before = Some(ended);
        }
        self.tally.count(slips, self.period);
        self.tally.meshing_time += meshing_since.map_or(0.0, |since| until - since);
        Some(())
    }

    /// Returns the elements with dry friction that stuck all the time. Neighbouring motions keep their distance along these rows.
    fn stuck_for_good(&self) -> [bool; MOST_FRICTION] {
        let sticks = self.flight.sticks();
        std::array::from_fn(|i| sticks[i] && !self.tally.slipped[i])
    }

    /// Returns the state at the next phase 0, after an event there.
    fn strobe(&self) -> Option<State> {
        let mut flight = self.flight.clone();
        if self.from > 0.0 {
            self.solver.advance(&mut flight, self.from, self.period * (1.0 + ON_STROBE))?;
        }
        Some(flight.state())
    }

    /// Compares states in the middle of the longest flight from here on. Returns false if they are compared there already
    /// or no event lies at phase 0.
    fn leave_strobe(&mut self) -> Option<bool> {
        let mut phases = std::mem::take(&mut self.tally.phases);
        if self.from > 0.0 || !phases.iter().any(|phase| (phase - phase.round()).abs() < ON_STROBE) {
            return Some(false);
        }
        phases.extend([0.0, 1.0]);
        phases.extend(self.flight.change_phases());
        phases.sort_by(f64::total_cmp);
        let longest = phases.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
        let from = 0.5 * (longest[0] + longest[1]) * self.period;
        self.solver.advance(&mut self.flight, 0.0, from)?;
        self.from = from;
        Some(true)
    }
}

/// Returns the symbol of a flight between two events.
fn symbol(before: Ended, side: Side) -> u8 {
    match (before.meshing, before.side, side) {
        (Some(Side::Right), ..) => b'1',
        (Some(Side::Left), ..) => b'4',
        (_, Side::Right, Side::Right) => b'2',
        (_, Side::Right, Side::Left) => b'3',
        (_, Side::Left, Side::Left) => b'5',
        (_, Side::Left, Side::Right) => b'6',
    }
}

/// Computes the record of a run; none if the judge gives no answer.
pub fn record(plan: &Plan, id: u32, records: &dyn Records) -> Option<Record> {
    record_until(plan, id, records, &super::NEVER)
}

/// Like [`record`], but returns `None` once `halt` is set.
pub(super) fn record_until(plan: &Plan, id: u32, records: &dyn Records, halt: &AtomicBool) -> Option<Record> {
    let cell = plan.cell(id);
    let (oscillator, start) = (plan.oscillator(cell.flow), plan.start(id, records));
    follow(Strobed::new(&oscillator, plan.law(cell.law), start, halt), &oscillator, plan.budget())
}

fn follow(mut motion: Strobed<'_>, oscillator: &Oscillator, budget: &Budget) -> Option<Record> {
    let stored = 2 * budget.settings.max_period as usize + 1;
    let mut strobes = Vec::new();
    for n in 0..budget.periods() as usize {
        if n + stored == budget.periods() as usize {
            motion.tally = Tally::default();
        }
        motion.advance()?;
        strobes.push(motion.flight.q);
    }
    if motion.leave_strobe()? {
        return follow(motion, oscillator, budget);
    }
    let window = &strobes[strobes.len().saturating_sub(stored)..];
    let largest = |i: usize| window.iter().map(|q| q[i].abs().max(q[i + 2].abs())).fold(0.0, f64::max);
    let position = largest(0).max(oscillator.length_scale());
    let units = [position, largest(1).max(oscillator.omega * position)];
    let apart = |a: &[f64; 4], b: &[f64; 4]| {
        (0..4).map(|i| distance::apart(a[i], b[i]) / units[i % 2]).fold(0.0, farther)
    };
    let recurs = |lag: usize, within: f64| {
        (lag..window.len()).rev().take(lag).all(|n| apart(&window[n], &window[n - lag]) < within)
    };
    let lags = 1..=window.len() / 2;
    let record = match lags.clone().find(|&lag| recurs(lag, RECURS)) {
        // The motion may still converge to a cycle of a shorter period.
        Some(lag)
            if lags.clone().any(|part| part < lag && lag % part == 0 && recurs(part, NEARLY_RECURS)) =>
        {
            return None;
        }
        Some(lag) => cycle(&motion, lag as u32, oscillator.degrees, units)?,
        None => chaos(motion, budget.settings.observed_periods, units)?,
    };
    Some(Record { periods_run: budget.periods(), ..record })
}

/// Computes the derivative of the strobe map over one period by central differences.
fn derivative(
    on: &Strobed,
    degrees: usize,
    units: [f64; 2],
    for_good: [bool; MOST_FRICTION],
) -> Option<Matrix4<f64>> {
    let image = |j: usize, by: f64| {
        let mut direction = [0.0; 4];
        direction[j] = by;
        let mut other = Strobed { flight: on.flight.displaced(&direction, for_good), ..on.clone() };
        other.advance()?;
        Some(other.flight.q)
    };
    let mut derivative = Matrix4::zeros();
    let held = if on.flight.is_stuck() { 2 } else { 0 };
    for j in held..2 * degrees {
        let by = DISPLACEMENT * units[j % 2];
        let (ahead, behind) = (image(j, by)?, image(j, -by)?);
        (0..4).for_each(|i| derivative[(i, j)] = (ahead[i] - behind[i]) / (2.0 * by));
    }
    Some(derivative)
}

/// Builds the record of a cycle; none if it is unstable.
fn cycle(on: &Strobed, period: u32, degrees: usize, units: [f64; 2]) -> Option<Record> {
    let span = f64::from(period) * on.period;
    let for_good = on.stuck_for_good();
    let mut motion = on.clone();
    motion.tally = Tally::default();
    let mut monodromy = Matrix4::identity();
    for _ in 0..period {
        monodromy = derivative(&motion, degrees, units, for_good)? * monodromy;
        motion.advance()?;
    }
    let [re, im] = *multipliers(&DMatrix::from_column_slice(4, 4, monodromy.as_slice()))?.first()?;
    let (radius, tally) = (re.hypot(im), &motion.tally);
    let mut record = Record {
        period,
        lyapunov: radius.ln() / span,
        impacts_per_period: tally.impacts as f64 / f64::from(period),
        mesh_fraction: tally.meshing_time / span,
        strobe: on.strobe()?,
        status: Status::Ok.code(),
        valid: valid::PERIOD | valid::IMPACTS | valid::MESH | valid::STROBE,
        ..Record::default()
    };
    let word = Word::cyclic(&tally.symbols);
    record.set_pattern(&word.pattern());
    // After an infinite series the number of impacts is unknown.
    if tally.series {
        record.valid &= !valid::IMPACTS;
    } else {
        record.set_word(&word);
    }
    if radius > LEAST_MULTIPLIER {
        record.valid |= valid::LYAPUNOV;
    }
    (radius < 1.0).then_some(record)
}

/// Builds the record of a chaotic motion; none unless a neighbouring motion separates from it on average.
fn chaos(mut motion: Strobed, periods: u32, units: [f64; 2]) -> Option<Record> {
    let for_good = motion.stuck_for_good();
    motion.tally = Tally::default();
    let mut other = motion.clone();
    let mut aside = [0.0; 4];
    aside[if motion.flight.is_stuck() { 2 } else { 0 }] = DISPLACEMENT * units[0];
    other.flight = motion.flight.displaced(&aside, for_good);
    let mut growth = Vec::new();
    for _ in 0..periods {
        motion.advance()?;
        other.advance()?;
        let difference: [f64; 4] =
            std::array::from_fn(|i| (other.flight.q[i] - motion.flight.q[i]) / units[i % 2]);
        let length = difference.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        growth.push((length / DISPLACEMENT).ln());
        // The neighbour starts again in the same direction, at the initial distance.
        other = motion.clone();
        aside = std::array::from_fn(|i| DISPLACEMENT * units[i % 2] * difference[i] / length);
        other.flight = motion.flight.displaced(&aside, for_good);
    }
    let mean = growth.iter().sum::<f64>() / growth.len().max(1) as f64;
    let error = standard_error(&growth);
    let span = f64::from(periods);
    let mut record = Record {
        lyapunov: mean / motion.period,
        lyapunov_error: error / motion.period,
        impacts_per_period: motion.tally.impacts as f64 / span,
        mesh_fraction: motion.tally.meshing_time / (span * motion.period),
        status: Status::Ok.code(),
        valid: valid::PERIOD | valid::LYAPUNOV | valid::IMPACTS | valid::MESH,
        ..Record::default()
    };
    if motion.tally.series {
        record.valid &= !valid::IMPACTS;
    }
    (mean > CHAOS_ERRORS * error).then_some(record)
}
