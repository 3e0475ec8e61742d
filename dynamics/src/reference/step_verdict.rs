//! What a step ahead holds: nothing, one crossing, or not decided at this length.

use super::{Mode, Trajectory};
use crate::certificate::{Bernstein, Bracket, ROOMY, Verdict, judge};
use crate::flow::{Gap, LinearFlow, Phasor, Step};
use crate::model::Side;

/// Distances from a wall that are rounding, relative to its position or the scale of length.
const REST: f64 = 32.0 * f64::EPSILON;

/// What ends a flight, as seen by the certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Crossing {
    /// Free motion reaches a wall.
    Contact(Side),
    /// The contact onset is over; no event.
    OnsetEnds(Side),
    /// Pressing ceases inside the contact onset.
    PressingEnds(Side),
    /// The dip goes all the way to the opposite wall.
    Through(Side),
    /// Meshing falls back through the wall.
    MeshEnds(Side),
}

/// What a step holds, over all that is watched.
pub(super) enum StepVerdict {
    Clear { roomy: bool },
    Rests,
    Crossing(Crossing, Bracket),
    Unclear,
}

impl<const N: usize> Trajectory<'_, N> {
    /// Judges everything that could end the flight within one step.
    #[inline(always)]
    pub(super) fn step_verdict(&self, linear: &LinearFlow, step: &Step) -> StepVerdict {
        let gap = step.gap_polynomial.from(&self.q, &self.phasor);
        let remainder = step.u6 * linear.gap_bound.remainder(&self.q, &self.phasor, step.u);
        let order = self.from_wall.map_or(0, |(_, order)| order);
        let [right, left] = self.flow.walls;
        let (floor, ceiling) = match self.mode {
            Mode::Free => (left, right),
            Mode::Sustained(Side::Right) => (right, f64::INFINITY),
            Mode::Sustained(Side::Left) => (f64::NEG_INFINITY, left),
            Mode::Onset(_) | Mode::Stuck(_) => (f64::INFINITY, f64::NEG_INFINITY),
        };
        let [above, below] = gap.between(order, remainder, floor, ceiling);
        if above && below {
            let room = ROOMY * remainder;
            let roomy = gap.between(order, remainder, floor + room, ceiling - room) == [true; 2];
            return StepVerdict::Clear { roomy };
        }
        if self.rests(&gap, order, remainder) {
            return StepVerdict::Rests;
        }
        match self.mode {
            Mode::Free if below => self.wall_ahead(&gap, Side::Left, remainder),
            Mode::Free if above => self.wall_ahead(&gap, Side::Right, remainder),
            Mode::Free => first_of(
                self.wall_ahead(&gap, Side::Right, remainder),
                self.wall_ahead(&gap, Side::Left, remainder),
            ),
            Mode::Sustained(side) => self.judge(&gap, side, 1.0, remainder, Crossing::MeshEnds(side)),
            // What presses tells, see `step_at_rest`.
            Mode::Stuck(_) => StepVerdict::Unclear,
            Mode::Onset(side) => {
                let ends = first_of(
                    self.judge(&gap, side, -1.0, remainder, Crossing::OnsetEnds(side)),
                    self.pressing_ahead(linear, step, side),
                );
                let opposite = side.mirrored();
                let room = (self.q[0] - self.flow.wall(opposite)).abs();
                // Sustained, it only slows down on its way.
                if self.q[1].abs() * step.h < room {
                    return ends;
                }
                first_of(ends, self.judge(&gap, opposite, -1.0, remainder, Crossing::Through(side)))
            }
        }
    }

    /// Whether the gap stays within rounding of a wall: teeth that rest there neither part
    /// nor press, and no step is short enough to tell which.
    #[inline(always)]
    fn rests(&self, gap: &Bernstein, order: usize, remainder: f64) -> bool {
        let rounding = |wall: f64| REST * wall.abs().max(self.flow.length);
        let ends_on = |wall: f64| (gap.end() - wall).abs() < rounding(wall);
        let within = |wall: f64| {
            let rounding = rounding(wall);
            let [lowest, highest] = gap.range(order, remainder);
            highest - wall < rounding && wall - lowest < rounding
        };
        self.flow.walls.into_iter().any(|wall| ends_on(wall) && within(wall))
    }

    #[inline(always)]
    fn wall_ahead(&self, gap: &Bernstein, side: Side, remainder: f64) -> StepVerdict {
        self.judge(gap, side, -1.0, remainder, Crossing::Contact(side))
    }

    /// Judges the distance of the gap from a wall; `inwards` is -1 on the free side of it.
    #[inline(always)]
    fn judge(
        &self,
        gap: &Bernstein,
        side: Side,
        inwards: f64,
        remainder: f64,
        crossing: Crossing,
    ) -> StepVerdict {
        let order = self.from_wall.map_or(0, |(from, order)| if from == side { order } else { 0 });
        match judge(gap, self.flow.wall(side), inwards * side.sign(), order, remainder) {
            Verdict::Clear { roomy } => StepVerdict::Clear { roomy },
            Verdict::Crossing(bracket) => StepVerdict::Crossing(crossing, bracket),
            Verdict::Unclear => StepVerdict::Unclear,
        }
    }

    /// Judges whether pressing ceases inside the contact onset.
    pub(super) fn pressing_ahead(&self, linear: &LinearFlow, step: &Step, side: Side) -> StepVerdict {
        let rates = |q: &Gap, p: &Phasor| linear.acceleration_rates(q, p);
        let (q, phasor) = step.end(&self.q, &self.phasor);
        let pressing = Bernstein::new(rates(&self.q, &self.phasor), rates(&q, &phasor), step.h);
        let remainder = step.u6 * linear.pressing_bound.remainder(&self.q, &self.phasor, step.u);
        match judge(&pressing, 0.0, side.sign(), 0, remainder) {
            Verdict::Clear { roomy } => StepVerdict::Clear { roomy },
            Verdict::Crossing(bracket) => StepVerdict::Crossing(Crossing::PressingEnds(side), bracket),
            Verdict::Unclear => StepVerdict::Unclear,
        }
    }
}

/// The earlier of two things that may happen on a step.
#[inline(always)]
fn first_of(a: StepVerdict, b: StepVerdict) -> StepVerdict {
    match (a, b) {
        (StepVerdict::Clear { roomy: a }, StepVerdict::Clear { roomy: b }) => {
            StepVerdict::Clear { roomy: a && b }
        }
        (crossing @ StepVerdict::Crossing(..), StepVerdict::Clear { .. })
        | (StepVerdict::Clear { .. }, crossing @ StepVerdict::Crossing(..)) => crossing,
        (StepVerdict::Crossing(what, a), StepVerdict::Crossing(_, b)) if a.hi < b.lo => {
            StepVerdict::Crossing(what, a)
        }
        (StepVerdict::Crossing(_, a), StepVerdict::Crossing(what, b)) if b.hi < a.lo => {
            StepVerdict::Crossing(what, b)
        }
        _ => StepVerdict::Unclear,
    }
}
