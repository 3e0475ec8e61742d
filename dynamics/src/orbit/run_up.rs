//! Motion while parameters change from one forcing period to the next.

use std::sync::atomic::AtomicBool;

use super::analysis::ALLOWANCE;
use super::history::MOST_EVENTS;
use super::reading::EventLog;
use super::trace::{sample, sample_period};
use super::{History, Stopped};
use crate::model::{Law, State};
use crate::motion::{Allowance, Flow, Trajectory};

/// Follows the motion that starts from `start` at phase 0 and time 0 through segments of whole forcing periods, each with its own values of the
/// parameters of one model. Returns a history of each segment, whose times count from the start, or none if `halt` was raised.
///
/// Parameters change at phase 0. There the state is continuous, a gap at rest on a rigid wall follows the wall, and contact that depends on a
/// force is decided again. `report` is called with the number of periods that are done.
///
/// # Errors
/// [`Stopped`] if the motion cannot be continued, needs more than about a minute, or has more than a million events.
pub fn run_up(
    start: State,
    segments: impl IntoIterator<Item = (Flow, Law, u32)>,
    samples_per_period: usize,
    halt: &AtomicBool,
    report: &mut dyn FnMut(u64),
) -> Result<Option<Vec<History>>, Stopped> {
    let mut left = Allowance { events: MOST_EVENTS, ..ALLOWANCE.until(halt) };
    let (mut carried, mut begins, mut done) = (None, 0.0, 0);
    let mut histories = Vec::new();
    for (flow, law, periods) in segments {
        let mut log = EventLog::new(&flow, 0);
        let started = match &carried {
            None => Trajectory::new(&flow, law, start),
            Some(carried) => Trajectory::continued(&flow, law, carried, &mut log),
        };
        let mut trajectory = started.allowing(left);
        let (meshing, mut samples) = (trajectory.meshing(), vec![sample(&trajectory, 0.0)]);
        for _ in 0..periods {
            // A step ends at each sample, which changes the last digits of the motion. So a copy is sampled.
            let sampled = sample_period(&mut trajectory.clone(), samples_per_period, &mut samples);
            if let Err(stop) = sampled.and(trajectory.advance_period(&mut log)) {
                return if left.is_halted() { Ok(None) } else { Err(Stopped { period: done + 1, stop }) };
            }
            done += 1;
            report(done);
        }
        (left, carried) = (left.after(trajectory.work()), Some(trajectory.carried()));
        samples.iter_mut().for_each(|sample| sample.t += begins);
        log.events.iter_mut().for_each(|event| event.t += begins);
        log.slips.iter_mut().for_each(|slip| slip.t += begins);
        begins += f64::from(periods) * flow.period;
        histories.push(History {
            meshing,
            samples,
            events: log.events,
            slips: log.slips,
            samples_per_period,
            forcing_period: flow.period,
        });
    }
    Ok(Some(histories))
}
