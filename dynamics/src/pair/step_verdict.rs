//! The verdict on a step: clear, exactly one crossing, or undecided at this length.

use super::{Mode, PairMotion};
use crate::model::{LEAST_LENGTH, Side};
use crate::pair::certificate::{Bernstein, Bracket, ROOMY, Verdict, judge};
use crate::pair::flow::{DomainKind, Gap, LinearFlow, Phasor, Step};

/// Distance from a wall that is rounding error, relative to the wall's position or the scale of length.
const WALL_ROUNDING: f64 = 32.0 * f64::EPSILON;

/// An empty interval of gaps: no step is known to lie within it, so every step is checked for crossings.
const UNREACHABLE: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

/// The end of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Crossing {
    /// Free motion reaches a wall.
    Contact(Side),
    /// The contact onset reaches its wall; this is not an event.
    OnsetEnds(Side),
    /// The pressing acceleration vanishes in the contact onset, or at rest on a rigid wall.
    PressingEnds(Side),
    /// The contact onset reaches the opposite wall.
    Through(Side),
    /// Sustained contact ends at its wall.
    MeshEnds(Side),
}

/// The verdict on a step.
pub(super) enum StepVerdict {
    /// No crossing; `roomy` if a step twice as long would probably be clear, too.
    Clear { roomy: bool },
    /// The gap stays within rounding of a wall.
    OnWall,
    /// Exactly one crossing.
    Crossing(Crossing, Bracket),
    /// Undecided.
    Unclear,
}

impl<const N: usize> PairMotion<'_, N> {
    /// Checks everything that could end the flight within one step.
    #[inline(always)]
    pub(super) fn step_verdict(&self, linear: &LinearFlow, step: &Step) -> StepVerdict {
        let gap = step.gap(&self.q, &self.phasor);
        let remainder = step.u6 * linear.gap_bound.remainder(&self.q, &self.phasor, step.u);
        let order = self.from_wall.map_or(0, |(_, order)| order);
        let [right, left] = self.flow.walls;
        let (floor, ceiling) = match self.mode {
            Mode::Free => (left, right),
            Mode::Sustained(side) => match side {
                Side::Right => (right, f64::INFINITY),
                Side::Left => (f64::NEG_INFINITY, left),
            },
            _ => UNREACHABLE,
        };
        let [above, below] = gap.between(order, remainder, floor, ceiling);
        if above & below {
            let room = ROOMY * remainder;
            let roomy = gap.between(order, remainder, floor + room, ceiling - room) == [true; 2];
            return StepVerdict::Clear { roomy };
        }
        if self.stays_on_wall(&gap, order, remainder) {
            return StepVerdict::OnWall;
        }
        match self.mode {
            Mode::Free if below => self.wall_ahead(&gap, Side::Left, remainder),
            Mode::Free if above => self.wall_ahead(&gap, Side::Right, remainder),
            Mode::Free => first_of(
                self.wall_ahead(&gap, Side::Right, remainder),
                self.wall_ahead(&gap, Side::Left, remainder),
            ),
            Mode::Sustained(side) => self.judge(&gap, side, 1.0, remainder, Crossing::MeshEnds(side)),
            // `step_at_rest` decides.
            Mode::Stuck(_) => StepVerdict::Unclear,
            Mode::Onset(side) => {
                let ends = first_of(
                    self.judge(&gap, side, -1.0, remainder, Crossing::OnsetEnds(side)),
                    self.pressing_ahead(linear, step, side),
                );
                let opposite = side.mirrored();
                let room = (self.q[0] - self.flow.wall(opposite)).abs();
                // Pressed in the other direction, the gap only slows down on its way to the opposite wall.
                if self.q[1].abs() * step.h < room {
                    return ends;
                }
                first_of(ends, self.judge(&gap, opposite, -1.0, remainder, Crossing::Through(side)))
            }
        }
    }

    /// Whether the gap stays within rounding of a wall. Then no step is short enough to find out on which side of the
    /// wall it is.
    #[inline(always)]
    fn stays_on_wall(&self, gap: &Bernstein, order: usize, remainder: f64) -> bool {
        let mut length = self.flow.length;
        if length == LEAST_LENGTH {
            // There is no scale of length: rounding is relative to the other displacement.
            let rate = self.flow.domain(DomainKind::Free).rate;
            length = length.max(self.q[2].abs()).max(self.q[3].abs() / rate);
        }
        let rounding = |wall: f64| WALL_ROUNDING * wall.abs().max(length);
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

    /// Checks the distance of the gap from a wall; `inwards` is -1 on the free side of the wall and 1 behind it.
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

    /// Checks whether the pressing acceleration vanishes.
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

/// Returns the earlier of two crossings on a step, if that is certain.
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
