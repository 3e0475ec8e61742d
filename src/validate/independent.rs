//! Independent judge: an adaptive ODE solver with event location. It shares only the description of the oscillator with the reference. It
//! treats all oscillators as machines.
//!
//! The motion is integrated over the whole budget. It is periodic if its strobe states recur and the cycle is stable;
//! multipliers come from finite differences of neighbouring motions. It is chaotic if a neighbouring motion separates from
//! it. Otherwise, for instance while a motion approaches its cycle slowly, the judge gives no answer.

pub mod dop853;
pub mod machine;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::DMatrix;

use crate::map::plan::Plan;
use crate::record::classify::CHAOS_ERRORS;
use crate::record::distance::{self, farther};
use crate::record::{Record, Records, valid};
use machine::Flight;
use rattlemap_dynamics::model::{MOST_FRICTION, Oscillator, RigidModes, State, Timing};
use rattlemap_dynamics::orbit::{Budget, Status};
use rattlemap_dynamics::stability::{multipliers, standard_error};
use rattlemap_dynamics::word::Word;

/// Relative distance below which two strobe states count as equal.
const RECURS: f64 = 1e-7;

/// Relative distance below which two strobe states may converge to each other.
const NEARLY_RECURS: f64 = 1e-4;

/// Distance from phase 0, in turns, within which rounding may put an event before or after the strobe.
const ON_STROBE: f64 = 1e-7;

/// Distance from phase 0, in turns, within which the displacement of a neighbouring motion may put an event on the other side of the strobe.
/// If there is such an event, states at another phase are compared.
const NEAR_STROBE: f64 = 1e-4;

/// Relative displacement of a neighbouring motion.
const DISPLACEMENT: f64 = 1e-7;

/// Smallest multiplier that these finite differences resolve.
const LEAST_MULTIPLIER: f64 = 1e-4;

/// A motion that advances from strobe to strobe.
#[derive(Clone)]
struct Strobed<'a> {
    flight: Flight,
    /// Forcing period.
    period: f64,
    /// Directions along which a position does not matter. The motion is shifted back along them at each strobe.
    rigid_modes: RigidModes,
    /// Number of multipliers that are 1 for every cycle: of conserved momenta, and of a shift in time without force.
    ones: usize,
    /// Phase at which states are compared, in radians.
    from: f64,
    /// Once set, the integration stops.
    halt: &'a AtomicBool,
}

/// Events and time in contact since the tally began.
#[derive(Clone, Debug, Default)]
struct Tally {
    impacts: usize,
    /// Time in contact, in radians of the forcing.
    meshing_time: f64,
    symbols: Vec<u8>,
    /// Phases of events, in turns.
    phases: Vec<f64>,
    /// Elements with dry friction that changed their mode.
    slipped: [bool; MOST_FRICTION],
}

impl Strobed<'_> {
    fn new<'a>(oscillator: &Oscillator, start: State, halt: &'a AtomicBool) -> Strobed<'a> {
        let (flight, rigid_modes) = (Flight::new(oscillator, &start), oscillator.rigid_modes());
        let ones = rigid_modes.conserved + usize::from(oscillator.timing == Timing::Cycle);
        Strobed { flight, period: oscillator.period(), rigid_modes, ones, from: 0.0, halt }
    }

    /// Advances by one forcing period. None if the solver fails or is halted.
    fn advance(&mut self) -> Option<()> {
        if self.halt.load(Ordering::Relaxed) {
            return None;
        }
        self.flight.events.clear();
        self.flight.slips.clear();
        self.flight.advance(self.from, self.from + TAU)?;
        let state = self.flight.state();
        for mode in &self.rigid_modes.modes {
            self.flight.shift(mode, -state[2 * mode.coordinate]);
        }
        Some(())
    }

    /// Returns the elements with dry friction that never slid. Along their rows, neighbouring motions keep their distance.
    fn stuck_for_good(&self) -> [bool; MOST_FRICTION] {
        let sticks = self.flight.sticks();
        std::array::from_fn(|i| sticks[i] && !self.flight.tally.slipped[i])
    }

    /// Returns the state at the next phase 0, after an event there.
    fn strobe(&self) -> Option<State> {
        let mut flight = self.flight.clone();
        if self.from > 0.0 {
            flight.advance(self.from, TAU * (1.0 + ON_STROBE))?;
        }
        Some(self.rigid_modes.shifted_back(flight.state()))
    }

    /// Moves the phase at which states are compared to the middle of the longest flight. Returns false, and moves nothing, if the phase was
    /// moved before or if no event lies at phase 0.
    fn leave_strobe(&mut self) -> Option<bool> {
        let mut phases = std::mem::take(&mut self.flight.tally.phases);
        if self.from > 0.0 || !phases.iter().any(|phase| (phase - phase.round()).abs() < NEAR_STROBE) {
            return Some(false);
        }
        phases.extend([0.0, 1.0]);
        phases.extend(self.flight.change_phases());
        phases.sort_by(f64::total_cmp);
        let longest = phases.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
        let from = 0.5 * (longest[0] + longest[1]) * TAU;
        self.flight.advance(0.0, from)?;
        self.from = from;
        Some(true)
    }
}

/// Computes the record of a run; none if the judge gives no answer.
pub fn record(plan: &Plan, id: u32, records: &dyn Records) -> Option<Record> {
    record_until(plan, id, records, plan.budget(), &super::NEVER)
}

/// Like [`record`], within another budget, but returns `None` once `halt` is set.
pub(super) fn record_until(
    plan: &Plan,
    id: u32,
    records: &dyn Records,
    budget: &Budget,
    halt: &AtomicBool,
) -> Option<Record> {
    let (oscillator, start) = (
        plan.model(id).oscillator().ok()?.on_cycle(records.record(id as usize).cycle_time()),
        plan.start(id, records),
    );
    follow(Strobed::new(&oscillator, start, halt), budget)
}

fn follow(mut motion: Strobed<'_>, budget: &Budget) -> Option<Record> {
    let stored = 2 * budget.settings.max_period as usize + 1;
    let mut strobes = Vec::new();
    for n in 0..budget.periods() as usize {
        if n + stored == budget.periods() as usize {
            motion.flight.tally = Tally::default();
        }
        motion.advance()?;
        strobes.push(motion.flight.coordinates());
    }
    if motion.leave_strobe()? {
        return follow(motion, budget);
    }
    let window = &strobes[strobes.len().saturating_sub(stored)..];
    // Displacements are in scales of length, and rates are per radian. So the size of the motion counts as at least 1.
    let largest = |kind: usize| {
        window.iter().flat_map(|q| q[kind..].iter().step_by(2)).fold(0.0f64, |most, x| most.max(x.abs()))
    };
    let position = largest(0).max(1.0);
    let units = [position, largest(1).max(position)];
    let apart = |a: &[f64], b: &[f64]| {
        let pairs = a.iter().zip(b).enumerate();
        pairs.map(|(i, (a, b))| distance::apart(*a, *b) / units[i % 2]).fold(0.0, farther)
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
        Some(lag) => cycle(&motion, lag as u32, units)?,
        // Where nothing bounds a motion, its neighbours separate without chaos.
        None if grows(&strobes) => return None,
        None => chaos(motion, budget.settings.observed_periods, units)?,
    };
    Some(Record { periods_run: budget.periods(), ..record })
}

/// Whether a motion grows without bound: its displacements become larger in each quarter of the strobes, and a hundred times in all.
fn grows(strobes: &[Vec<f64>]) -> bool {
    let largest = |part: &[Vec<f64>]| {
        part.iter().flat_map(|q| q.iter().step_by(2)).fold(0.0f64, |most, x| most.max(x.abs()))
    };
    let sizes: Vec<f64> = strobes.chunks(strobes.len().div_ceil(4).max(1)).map(largest).collect();
    sizes.is_sorted() && sizes.last().zip(sizes.first()).is_some_and(|(last, first)| *last > 100.0 * first)
}

/// Returns the motion displaced along a coordinate. None if elements or gaps at rest allow no displacement.
fn displaced(flight: &Flight, coordinate: usize, by: f64, for_good: [bool; MOST_FRICTION]) -> Option<Flight> {
    let own = flight.coordinates();
    let mut direction = vec![0.0; own.len()];
    direction[coordinate] = by;
    Some(flight.displaced(&direction, for_good)).filter(|other| other.coordinates() != own)
}

/// Computes the derivative of the strobe map over one period by central differences.
fn derivative(on: &Strobed, units: [f64; 2], for_good: [bool; MOST_FRICTION]) -> Option<DMatrix<f64>> {
    let size = on.flight.coordinates().len();
    let mut derivative = DMatrix::zeros(size, size);
    for j in 0..size {
        let by = DISPLACEMENT * units[j % 2];
        let [ahead, behind] = [by, -by].map(|by| displaced(&on.flight, j, by, for_good));
        let (Some(ahead), Some(behind)) = (ahead, behind) else { continue };
        let image = |flight: Flight| {
            let mut other = Strobed { flight, ..on.clone() };
            other.advance()?;
            Some(other.flight.coordinates())
        };
        let (ahead, behind) = (image(ahead)?, image(behind)?);
        (0..size).for_each(|i| derivative[(i, j)] = (ahead[i] - behind[i]) / (2.0 * by));
    }
    Some(derivative)
}

/// Builds the record of a cycle; none if it is unstable.
fn cycle(on: &Strobed, period: u32, units: [f64; 2]) -> Option<Record> {
    let for_good = on.stuck_for_good();
    let mut motion = on.clone();
    motion.flight.tally = Tally::default();
    let size = on.flight.coordinates().len();
    let mut monodromy = DMatrix::identity(size, size);
    for _ in 0..period {
        monodromy = derivative(&motion, units, for_good)? * monodromy;
        motion.advance()?;
    }
    let mut multipliers = multipliers(&monodromy)?;
    for _ in 0..on.ones {
        let off = |[re, im]: &[f64; 2]| (re - 1.0).hypot(*im);
        let nearest =
            (0..multipliers.len()).min_by(|&a, &b| off(&multipliers[a]).total_cmp(&off(&multipliers[b])))?;
        multipliers.remove(nearest);
    }
    let [re, im] = multipliers.first().copied().unwrap_or_default();
    let (radius, tally) = (re.hypot(im), &motion.flight.tally);
    let mut record = Record {
        period,
        lyapunov: radius.ln() / (f64::from(period) * on.period),
        impacts_per_period: tally.impacts as f64 / f64::from(period),
        mesh_fraction: tally.meshing_time / (f64::from(period) * TAU),
        strobe: on.strobe()?.into(),
        status: Status::Ok.code(),
        valid: valid::PERIOD | valid::IMPACTS | valid::MESH | valid::STROBE,
        ..Record::default()
    };
    let word = Word::cyclic(&tally.symbols);
    record.set_pattern(&word.pattern());
    record.set_word(&word);
    if radius > LEAST_MULTIPLIER {
        record.valid |= valid::LYAPUNOV;
    }
    (radius < 1.0).then_some(record)
}

/// Builds the record of a chaotic motion. None if neighbouring motions do not separate from it on average.
fn chaos(mut motion: Strobed, periods: u32, units: [f64; 2]) -> Option<Record> {
    let for_good = motion.stuck_for_good();
    motion.flight.tally = Tally::default();
    let size = motion.flight.coordinates().len();
    let by = DISPLACEMENT * units[0];
    let mut other = motion.clone();
    other.flight = (0..size).step_by(2).find_map(|j| displaced(&motion.flight, j, by, for_good))?;
    let mut growth = Vec::new();
    for _ in 0..periods {
        motion.advance()?;
        other.advance()?;
        let (own, others) = (motion.flight.coordinates(), other.flight.coordinates());
        let difference: Vec<f64> = (0..size).map(|i| (others[i] - own[i]) / units[i % 2]).collect();
        let length = difference.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        growth.push((length / DISPLACEMENT).ln());
        // The neighbour starts again in the same direction, at the initial distance.
        let aside: Vec<f64> =
            (0..size).map(|i| DISPLACEMENT * units[i % 2] * difference[i] / length).collect();
        other.flight = motion.flight.displaced(&aside, for_good);
    }
    let mean = growth.iter().sum::<f64>() / growth.len().max(1) as f64;
    let error = standard_error(&growth);
    let (span, tally) = (f64::from(periods), &motion.flight.tally);
    let record = Record {
        lyapunov: mean / motion.period,
        lyapunov_error: error / motion.period,
        impacts_per_period: tally.impacts as f64 / span,
        mesh_fraction: tally.meshing_time / (span * TAU),
        status: Status::Ok.code(),
        valid: valid::PERIOD | valid::LYAPUNOV | valid::IMPACTS | valid::MESH,
        ..Record::default()
    };
    (mean > CHAOS_ERRORS * error).then_some(record)
}
