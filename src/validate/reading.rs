//! A cycle as it is read off a motion, settled or not: what lanes do.

use nalgebra::Matrix4;

use super::answer::Answer;
use super::case::Case;
use crate::model::State;
use crate::orbit::Class;
use crate::reference::{Happening, Trajectory};
use crate::stability::{StrobeMap, UNIT, multipliers};
use crate::word::Word;

/// What was met along one cycle.
pub(super) struct Met {
    /// Forcing periods.
    pub(super) period: u32,
    /// Impacts and meshing time so far, at its start and at its end.
    pub(super) counts: [[f64; 2]; 2],
    pub(super) events: Vec<Happening>,
}

impl Met {
    /// The cycle, whose largest multiplier has this logarithm and which is otherwise as `truth` says.
    pub(super) fn answer(&self, case: &Case<'_>, truth: &Answer, log_radius: f64) -> Answer {
        let span = f64::from(self.period) * case.flow.period;
        let [impacts, meshing_time] = [0, 1].map(|i| self.counts[1][i] - self.counts[0][i]);
        let is_unsymmetric = impacts % 2.0 == 1.0 || self.period.is_multiple_of(2);
        let symbols: Vec<u8> = self.events.iter().filter_map(|happening| happening.symbol).collect();
        Answer {
            class: Class::Periodic { period: self.period },
            exponent: Some([log_radius / span, 0.0]),
            impacts_per_period: Some(impacts / f64::from(self.period)),
            mesh_fraction: Some(meshing_time / span),
            // A cycle that is its own mirror image has an odd period, and every impact a twin.
            symmetric: if is_unsymmetric { Some(false) } else { truth.symmetric },
            word: Some(Word::cyclic(&symbols)),
            ..truth.clone()
        }
    }
}

/// The logarithm of the spectral radius of the matrix whose columns these are.
pub(super) fn log_radius(columns: [State; 4]) -> Option<f64> {
    let [re, im] = *multipliers(&Matrix4::from_fn(|i, j| columns[j][i]))?.first()?;
    Some(re.hypot(im).ln())
}

impl Case<'_> {
    /// One cycle of `period` from where a motion is: multipliers of the first time around, events and
    /// averages of the second, so that the first flight has its symbol.
    pub(super) fn read_as_is(&self, motion: &Trajectory<'_>, period: u32) -> Option<Answer> {
        let image = StrobeMap::Periods(period).apply(motion, motion.state()).ok()?;
        let [re, im] = *multipliers(&image.scaled)?.first()?;
        let mut cycle = motion.clone();
        (0..period).try_for_each(|_| cycle.advance_period(&mut ())).ok()?;
        let (before, mut events) = (counts(&cycle), Vec::new());
        (0..period).try_for_each(|_| cycle.advance_period(&mut events)).ok()?;
        let met = Met { period, counts: [before, counts(&cycle)], events };
        Some(met.answer(self, &self.truth, re.hypot(im).ln() + image.log_scale))
    }

    /// The same of a motion that has come from somewhere: all of it the first time around.
    pub(super) fn read_along(&self, motion: &Trajectory<'_>, period: u32) -> Option<Answer> {
        let mut cycle = motion.carrying(UNIT);
        let mut events = Vec::new();
        (0..period).try_for_each(|_| cycle.advance_period(&mut events)).ok()?;
        let met = Met { period, counts: [counts(motion), counts(&cycle)], events };
        Some(met.answer(self, &self.truth, log_radius(cycle.tangents())? + cycle.log_scale()))
    }

    /// The cycle of `period` as a lane would have read it that took so many of Newton's steps: they, too, set
    /// out from where the motion was, each after one reading, and the last reading ended where the record does.
    pub(super) fn read_like_a_lane(&self, period: u32, steps: u32) -> Option<Answer> {
        let began = self.record.periods_run.checked_sub((steps + 1) * period)?;
        let mut motion = self.after(self.start, began).ok()?;
        for _ in 0..steps {
            let to = self.limit(&motion, period)?;
            (0..period).try_for_each(|_| motion.advance_period(&mut ())).ok()?;
            motion = motion.at(to, []);
        }
        self.read_along(&motion, period)
    }
}

/// Impacts and meshing time of a motion so far.
pub(super) fn counts<const N: usize>(trajectory: &Trajectory<'_, N>) -> [f64; 2] {
    [trajectory.work().impacts as f64, trajectory.meshing_time()]
}
