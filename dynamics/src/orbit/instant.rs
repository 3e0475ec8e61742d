//! The state of a motion at one instant.

use std::sync::atomic::AtomicBool;

use super::analysis::ALLOWANCE;
use super::reading::EventLog;
use crate::model::{Law, Side, State};
use crate::motion::Flow;
use crate::motion::{Stop, Trajectory};

/// Forcing periods that take about a minute if the motion is not stiff.
pub const LONGEST_TIME: f64 = 3e7;

/// Times within this distance of an event count as the time of the event, in roundings of the time. Events are located to a few roundings.
const EVENT_ROUNDINGS: f64 = 16.0;

/// Returns the state at `time` of the motion that starts from `start` at phase 0 and time 0, or none if `halt` was
/// raised. Whole periods are integrated one by one, so that the phase has no rounding error. At the time of an event,
/// within 16 roundings (3.6e-15 of the time), it is the state after the event.
///
/// # Errors
/// A [`Stop`] if the motion cannot be continued up to `time`, or needs more than about a minute.
///
/// # Panics
/// If `time` is negative or not finite.
pub fn state_at(
    flow: &Flow,
    law: Law,
    start: State,
    time: f64,
    halt: &AtomicBool,
) -> Result<Option<State>, Stop> {
    assert!(time.is_finite() && time >= 0.0, "time = {time}: it must be finite and at least 0");
    let (periods, rest) = split(time, flow.period);
    let allowance = ALLOWANCE.until(halt);
    let mut trajectory = Trajectory::<0>::new(flow, law, start).allowing(allowance);
    let mut advance = || {
        for _ in 0..periods {
            trajectory.advance_period(&mut ())?;
        }
        trajectory.advance_to(rest, &mut ())?;
        Ok(at_present(&trajectory, time).0)
    };
    let state = advance();
    if allowance.is_halted() { Ok(None) } else { state.map(Some) }
}

/// Whether `time` is at or after the time of an event, within rounding.
pub fn is_reached(event: f64, time: f64) -> bool {
    event - time <= EVENT_ROUNDINGS * f64::EPSILON * time.abs()
}

/// Returns the state of a trajectory at the present time, and the wall of the lasting contact. `time` is the time since its start. If
/// rounding has put an event just behind this time, it is the state after the event.
pub(super) fn at_present(trajectory: &Trajectory<'_, 0>, time: f64) -> (State, Option<Side>) {
    after_events(trajectory, EVENT_ROUNDINGS * f64::EPSILON * time)
}

/// Returns the state of a trajectory at the present time, and the wall of the lasting contact. If an event follows within the time
/// `tolerance`, it is the state after the event.
pub(super) fn after_events(trajectory: &Trajectory<'_, 0>, tolerance: f64) -> (State, Option<Side>) {
    let (flow, mut ahead) = (trajectory.flow(), trajectory.clone());
    let mut log = EventLog::new(flow, 0);
    let until = trajectory.time_in_period() + tolerance;
    let advanced = if until <= flow.period {
        ahead.advance_to(until, &mut log)
    } else {
        let next = ahead.advance_period(&mut log);
        next.and_then(|()| ahead.advance_to(until - flow.period, &mut log))
    };
    match (advanced, log.events.last()) {
        (Ok(()), Some(event)) => (event.after, ahead.meshing()),
        _ => (trajectory.unshifted_state(), trajectory.meshing()),
    }
}

/// Splits a time into whole periods and a remainder, to one rounding.
fn split(time: f64, period: f64) -> (u64, f64) {
    let whole = (time / period).floor();
    let rest = (-whole).mul_add(period, time);
    // The quotient may be rounded up to the next integer.
    if rest < 0.0 {
        ((whole - 1.0).max(0.0) as u64, (rest + period).max(0.0))
    } else if rest >= period {
        (whole as u64 + 1, rest - period)
    } else {
        (whole as u64, rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{GearPair, REST};

    #[test]
    fn state_at_agrees_with_a_trajectory() {
        let pair = GearPair::paper(0.06);
        let flow = Flow::of(&pair).unwrap();
        let at = |time| state_at(&flow, pair.law(), REST, time, &AtomicBool::new(false)).unwrap().unwrap();
        assert_eq!(at(0.0), REST);
        let mut trajectory = Trajectory::<0>::new(&flow, pair.law(), REST);
        (0..1000).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
        let distance = |a: State, b: State| (0..4).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
        assert!(distance(at(1000.0 * flow.period), trajectory.state()) < 1e-10);
        trajectory.advance_to(0.25 * flow.period, &mut ()).unwrap();
        assert!(distance(at(1000.25 * flow.period), trajectory.state()) < 1e-10);
        assert_eq!(state_at(&flow, pair.law(), REST, 1.0, &AtomicBool::new(true)), Ok(None));
    }

    #[test]
    fn periods_and_remainder_add_up_to_the_time() {
        for period in [std::f64::consts::TAU / 5.6, 0.1, 3.0, std::f64::consts::TAU] {
            for n in [0_u32, 1, 2, 3, 7, 10, 49, 1000, 12_345_678] {
                let time = f64::from(n) * period;
                for time in [time, time.next_up(), time.next_down().max(0.0), time + 0.3 * period] {
                    let (periods, rest) = split(time, period);
                    assert!((0.0..period).contains(&rest), "{time} {period}: {periods} {rest}");
                    let sum = (periods as f64).mul_add(period, rest);
                    assert!((sum - time).abs() <= f64::EPSILON * time, "{time} {period}: {periods} {rest}");
                }
            }
        }
    }
}
