//! Cycles without force. Their period is their own: it is the time between two returns to a section.
//!
//! The section is the state after one kind of event. Piecewise linear motion without events has no isolated cycles. Where the states on the
//! section recur, Newton's method finds the state and the time of the cycle: `P_T(y) - y = 0` has one unknown more than equations, because
//! phase 0 may lie anywhere on the cycle, and the smallest correction is taken. The flow is then prepared again with the clock of the
//! cycle, so that its readings and multipliers are those of a cycle of period 1.

use super::analysis::{Analysis, ON_CYCLE};
use super::reading::EventLog;
use super::recurrence::{Metric, RECURRENCE_DISTANCE, candidates};
use super::{Class, Orbit, Status};
use crate::model::{Form, State, difference, sum};
use crate::motion::Flow;
use crate::motion::{Stop, Trajectory};
use crate::stability::{Newton, StrobeMap, step_and_time};

/// Largest number of Newton's steps.
const MOST_STEPS: usize = 12;

/// Largest distance of an image from its state that counts as rounding, relative to the motion.
const CLOSED: f64 = 1e-10;

/// Intervals between events that are longer than this share of the longest one count as equally long.
const EQUALLY_LONG: f64 = 0.99;

/// Number of last returns at which a slow approach must come closer each time.
const LEAST_RETURNS: usize = 4;

/// An event: its kind, its time, and the state after it without the shift along rigid-body modes.
struct Mark {
    kind: [usize; 4],
    time: f64,
    state: State,
}

/// A cycle near the present motion.
pub(super) struct FreeOrbit {
    /// The orbit, which is `undecided` if the cycle is unstable.
    pub(super) orbit: Orbit,
    /// Whether the motion is on the cycle.
    pub(super) is_on_cycle: bool,
    /// Whether the motion approaches the cycle.
    pub(super) approaches: bool,
}

impl FreeOrbit {
    /// Whether the motion has the cycle's class, when its budget ends or before.
    pub(super) fn is_reached(&self, is_last: bool) -> bool {
        let is_periodic = matches!(self.orbit.class, Class::Periodic { .. });
        if is_periodic { self.is_on_cycle || is_last && self.approaches } else { is_last && self.is_on_cycle }
    }
}

impl Analysis<'_> {
    /// Returns the cycle without force that the states on a section approach over the following `periods` of the clock.
    pub(super) fn free_orbit(&self, trajectory: &Trajectory<'_>, periods: u32) -> Option<FreeOrbit> {
        let marks = self.marks(trajectory, periods).ok()?;
        if marks.is_empty() {
            return self.undamped_orbit(trajectory);
        }
        let late = &marks[marks.len() / 2..];
        let count = |kind: &[usize; 4]| late.iter().filter(|mark| mark.kind == *kind).count();
        let rarest = late.iter().map(|mark| mark.kind).min_by_key(|kind| (count(kind), *kind))?;
        let returns: Vec<&Mark> = marks.iter().filter(|mark| mark.kind == rarest).collect();
        let states: Vec<State> = returns.iter().map(|mark| mark.state).collect();
        let metric = Metric::of(&states, self.flow);
        let found = candidates(&states, &metric, self.settings.max_period);
        found.into_iter().find_map(|candidate| {
            let (lag, last) = (candidate.period as usize, states.len() - 1);
            let apart =
                |back: usize| metric.distance(&states[last - back * lag], &states[last - (back + 1) * lag]);
            let approaches = (last / lag).min(LEAST_RETURNS + 1);
            let approaches = approaches > 2 && (1..approaches - 1).all(|back| apart(back - 1) < apart(back));
            let (to, time) = (returns[last].time, returns[last].time - returns[last - lag].time);
            let from = middle_of_flight(&marks, to - time, to)?;
            // At a flip, half the lag has the same cycle.
            let divisors = (1..=lag).filter(|part| lag.is_multiple_of(*part));
            divisors.into_iter().find_map(|part| {
                let time = to - returns[last - part].time;
                let (orbit, distance) = self.closed(trajectory, from, time, &metric)?;
                let is_on_cycle = distance < ON_CYCLE;
                Some(FreeOrbit { orbit, is_on_cycle, approaches })
            })
        })
    }

    /// Returns the undamped oscillation that has no event, if its period is the slowest natural one.
    fn undamped_orbit(&self, trajectory: &Trajectory<'_>) -> Option<FreeOrbit> {
        let Form::Machine(machine) = self.flow.form() else { return None };
        let time = std::f64::consts::TAU / machine.slowest_natural_frequency()?;
        let metric = Metric::of(&[trajectory.state()], self.flow);
        let (orbit, distance) = self.closed(trajectory, 0.0, time, &metric)?;
        Some(FreeOrbit { orbit, is_on_cycle: distance < ON_CYCLE, approaches: false })
    }

    /// Collects the events of the following periods, in order of time since the present phase 0.
    fn marks(&self, trajectory: &Trajectory<'_>, periods: u32) -> Result<Vec<Mark>, Stop> {
        let mut ahead = trajectory.clone();
        let mut log = EventLog::new(self.flow, ahead.period());
        (0..periods).try_for_each(|_| ahead.advance_period(&mut log))?;
        let back = |state: State| self.flow.rigid_modes.shifted_back(state);
        let events = log.events.iter().map(|event| Mark {
            kind: [0, event.gap, event.side.index(), event.kind as usize],
            time: event.t,
            state: back(event.after),
        });
        let slips = log.slips.iter().map(|slip| Mark {
            kind: [1, slip.element, slip.kind as usize, 0],
            time: slip.t,
            state: back(slip.state),
        });
        let mut marks: Vec<Mark> = events.chain(slips).collect();
        marks.sort_by(|a, b| a.time.total_cmp(&b.time));
        Ok(marks)
    }

    /// Finds the cycle of about this `time` through the state of a trajectory after the time `from`. Returns its orbit, and the distance of
    /// the state from the cycle.
    fn closed(
        &self,
        trajectory: &Trajectory<'_>,
        from: f64,
        mut time: f64,
        metric: &Metric,
    ) -> Option<(Orbit, f64)> {
        let (mut ahead, period) = (trajectory.clone(), self.flow.period);
        (0..(from / period) as u64).try_for_each(|_| ahead.advance_period(&mut ())).ok()?;
        ahead.advance_to(from % period, &mut ()).ok()?;
        let (newton, start) = (&mut Newton::default(), self.flow.rigid_modes.shifted_back(ahead.state()));
        let (mut y, mut least) = (start, f64::INFINITY);
        for _ in 0..MOST_STEPS {
            let flow = self.flow.on_cycle(time)?;
            let seed = ahead.in_flow(&flow)?;
            let image = newton.apply(StrobeMap::Periods(1), &seed, y)?;
            let residual = difference(&image.state, &y);
            let size = metric.size(&residual);
            if size >= 0.5 * least && size < CLOSED {
                break;
            }
            least = size.min(least);
            let velocity = seed.at(y, []).velocity();
            let (step, later) = step_and_time(&image, &residual, &velocity, self.flow.omega)?;
            (y, time) = (sum(&y, &step, 1.0), time + later);
            if time <= 0.0 || metric.distance(&y, &start) > RECURRENCE_DISTANCE {
                return None;
            }
        }
        let flow = self.flow.on_cycle(time)?;
        let seed = ahead.in_flow(&flow)?.at(y, []);
        // Every state returns within rounding after a time in which the motion moves less than this.
        let is_short = metric.size(&seed.velocity().map(|rate| rate * time)) < ON_CYCLE;
        if least > CLOSED || is_short {
            return None;
        }
        self.of_cycle(&flow, &seed, newton, metric, &start)
    }

    /// Returns the orbit of the cycle through the state of `seed`, and the distance of a state from it.
    fn of_cycle(
        &self,
        flow: &Flow,
        seed: &Trajectory<'_>,
        newton: &mut Newton,
        metric: &Metric,
        state: &State,
    ) -> Option<(Orbit, f64)> {
        let analysis = Analysis { flow, ..*self };
        let cycle = newton.refine(seed, StrobeMap::Periods(1))?;
        let cycle = analysis.smallest(newton, seed, cycle, metric)?;
        let reading = analysis.read(seed, &cycle).ok().filter(|reading| reading.closes)?;
        let distance = metric.distance(state, &cycle.state);
        let orbit = analysis.periodic(seed, &reading, &cycle, distance).ok()?;
        // At rest any time closes.
        orbit.cycle_time?;
        let is_unstable = !cycle.is_stable() && !cycle.is_neutral();
        Some(match is_unstable {
            true => (Orbit { class: Class::Undecided, status: Status::UnstableCycle, ..orbit }, distance),
            false => (orbit, distance),
        })
    }
}

/// Returns the middle of the longest interval between neighbouring events of a cycle. Of equally long ones, the first kind of event
/// decides, so that all motions on the cycle find the same state.
fn middle_of_flight(marks: &[Mark], from: f64, to: f64) -> Option<f64> {
    let pairs = marks.iter().zip(&marks[1..]).filter(|(begin, end)| begin.time >= from && end.time <= to);
    let lengths: Vec<(f64, &Mark)> = pairs.map(|(begin, end)| (end.time - begin.time, begin)).collect();
    let longest = lengths.iter().map(|(length, _)| *length).fold(0.0, f64::max);
    let long = lengths.into_iter().filter(|(length, _)| *length > EQUALLY_LONG * longest);
    let (length, begin) = long.min_by_key(|(_, begin)| begin.kind)?;
    Some(begin.time + 0.5 * length)
}
