//! Motion from the start: samples and events of a window of forcing periods.

use std::sync::atomic::AtomicBool;

use super::analysis::ALLOWANCE;
use super::reading::EventLog;
use super::trace::{sample, sample_period};
use super::{Event, Sample, SlipPoint, status_of};
use crate::model::{Law, Side, State};
use crate::motion::Flow;
use crate::motion::{Allowance, Stop, Trajectory};

/// Largest number of events in a window. They take about 200 MB.
pub(super) const MOST_EVENTS: u64 = 1_000_000;

/// Samples and events of a motion over consecutive forcing periods.
#[derive(Clone, Debug)]
pub struct History {
    /// The wall of the lasting contact at the beginning, if there is one.
    pub meshing: Option<Side>,
    /// Samples at equal intervals, including both ends.
    pub samples: Vec<Sample>,
    /// Events at walls in order of time.
    pub events: Vec<Event>,
    /// Events of friction in order of time.
    pub slips: Vec<SlipPoint>,
    /// Number of samples per forcing period.
    pub samples_per_period: usize,
    /// The forcing period `T`.
    pub forcing_period: f64,
}

/// The reason why a motion cannot be followed to the end of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the integration stops in forcing period {period} ({}); end before this period", status_of(*stop).name())]
pub struct Stopped {
    /// Number of the period, from 1.
    pub period: u64,
    /// The reason.
    pub stop: Stop,
}

/// Follows the motion that starts from `start` at phase 0 and time 0, and returns its `periods` forcing periods after
/// the first `skipped` ones, or none if `halt` was raised. Times count from the start. Events do not depend on the
/// number of samples.
///
/// # Errors
/// [`Stopped`] if the motion cannot be continued, needs more than about a minute, or has more than a million events in
/// the window.
pub fn history(
    flow: &Flow,
    law: Law,
    start: State,
    (skipped, periods): (u64, u32),
    samples_per_period: usize,
    halt: &AtomicBool,
) -> Result<Option<History>, Stopped> {
    let allowance = ALLOWANCE.until(halt);
    let mut trajectory = Trajectory::<0>::new(flow, law, start).allowing(allowance);
    let stopped = |stop, period: u64| match allowance.is_halted() {
        true => Ok(None),
        false => Err(Stopped { period: period + 1, stop }),
    };
    for period in 0..skipped {
        if let Err(stop) = trajectory.advance_period(&mut ()) {
            return stopped(stop, period);
        }
    }
    let mut trajectory = trajectory.allowing(Allowance { events: MOST_EVENTS, ..allowance });
    let start = skipped as f64 * flow.period;
    let (meshing, mut samples) = (trajectory.meshing(), vec![sample(&trajectory, start)]);
    let mut log = EventLog::new(flow, 0);
    for period in skipped..skipped + u64::from(periods) {
        // A step ends at each sample, which changes the last digits of the motion. So a copy is sampled.
        let sampled = sample_period(&mut trajectory.clone(), samples_per_period, &mut samples);
        if let Err(stop) = sampled.and(trajectory.advance_period(&mut log)) {
            return stopped(stop, period);
        }
    }
    Ok(Some(History {
        meshing,
        samples,
        events: log.events,
        slips: log.slips,
        samples_per_period,
        forcing_period: flow.period,
    }))
}
