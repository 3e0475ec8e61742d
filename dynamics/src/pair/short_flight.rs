//! Short flights from a wall and back to it: chatter, and contact onsets. They are half of all flights if impacts are
//! dense.

use super::{Crossing, Mode, PairMotion};
use crate::model::Side;
use crate::motion::{Observer, Stop};
use crate::pair::flow::{LONGEST_SHORT_FLIGHT, LinearFlow, turned};

/// Longest expected flight for which the short-flight series is tried, as a share of the longest short flight.
const TRIED_SHARE: f64 = 0.9;

/// Least change of speed by the pressing acceleration in a Taylor step, relative to the scale of length times the rate of free motion.
/// Below it the acceleration may be rounding error, and the certificate is used instead.
const LEAST_PRESSING: f64 = 1e-6;

impl<const N: usize> PairMotion<'_, N> {
    /// Whether a flight that leaves a wall at the speed `leaving` under the acceleration `pressing` back to it is
    /// probably a short flight.
    #[inline(always)]
    pub(super) fn expects_short_flight(&self, linear: &LinearFlow, leaving: f64, pressing: f64) -> bool {
        let speed_change = pressing * linear.unit;
        2.0 * leaving < TRIED_SHARE * LONGEST_SHORT_FLIGHT * speed_change
            && speed_change > LEAST_PRESSING * self.flow.speed
            && leaving > 0.0
    }

    /// Advances the motion until the gap returns to the wall that it has just left, if the series proves this return. Returns whether it
    /// does.
    #[inline(always)]
    pub(super) fn fly_back(
        &mut self,
        linear: &LinearFlow,
        until: f64,
        observer: &mut impl Observer,
    ) -> Result<bool, Stop> {
        let (side, crossing): (Side, Crossing) = match (self.mode, self.from_wall) {
            (Mode::Free, Some((side, 1))) => (side, Crossing::Contact(side)),
            (Mode::Onset(side), Some((_, 1))) => (side, Crossing::OnsetEnds(side)),
            _ => return Ok(false),
        };
        let series = linear.short_flight.from(&self.q, &self.phasor);
        let [right, left] = self.flow.walls;
        let Some(u) = series.first_return(right - left) else { return Ok(false) };
        let s = u * linear.unit;
        if s >= self.clock.remaining(until) {
            return Ok(false);
        }
        self.work.steps += 1;
        self.work.root_iterations += 1;
        self.steps_in_period += 1;
        let [w, x, v] = series.changes(u, linear.per_unit);
        self.q = [self.flow.wall(side), self.q[1] + w, self.q[2] + x, self.q[3] + v];
        self.phasor = turned(&self.phasor, linear.turn * u);
        if N > 0 {
            self.tangents = linear.grid.carry(u, self.tangents);
        }
        self.clock.advance(s);
        self.count_meshing(s);
        self.from_wall = None;
        self.act(crossing, observer);
        self.check_events()?;
        Ok(true)
    }
}
