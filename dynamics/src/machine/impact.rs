//! The result of an impact: the jump of all rates, and the modes after the impact.

use super::constraints::NO_MOBILITY;
use super::domain::LinearDomain;
use super::domains::System;
use super::modes::{AtRest, GapMode, Modes};
use super::passages::{Bounce, Impulse};
use super::{Numbers, PhasePoint, ROUNDING, SIZE};
use crate::model::{Contact, MOST_COORDINATES, MOST_GAPS, Side, Wall};
use crate::motion::Slip;

/// Height, relative to the scale of length, below which flights of a series of impacts are not computed: the gap comes to rest.
pub const LOWEST_FLIGHT: f64 = 1e-13;

/// An impact of a gap on the last wall of a side.
pub(super) struct Impact<'a> {
    pub(super) system: &'a System,
    /// Modes and point before the impact.
    pub(super) modes: &'a Modes,
    pub(super) point: &'a PhasePoint,
    pub(super) gap: usize,
    pub(super) side: Side,
    pub(super) wall: &'a Wall,
    /// Speed towards the wall.
    pub(super) approach: f64,
}

/// The result of an impact.
pub(super) struct Outcome {
    /// Modes and rates after the impact.
    pub(super) modes: Modes,
    pub(super) rates: [f64; MOST_COORDINATES],
    pub(super) lasts: bool,
    /// Acceleration towards the wall, in free motion after the impact, or its first derivative that is not 0.
    pub(super) pressing: f64,
    /// Derivatives of the jumps of all rates with respect to the gap's rate before the impact.
    pub(super) jump: Numbers,
    pub(super) impulse: Impulse,
}

/// Changes of all rates by an impulse that changes the gap's rate by 1, and for each gap whether it leaves the rigid wall on which it
/// rests.
type Kick = (Numbers, [bool; MOST_GAPS]);

impl Impact<'_> {
    /// Returns the leaving speed of a flight of the height [`LOWEST_FLIGHT`].
    pub(super) fn lowest_speed(&self, domain: &LinearDomain, gap: usize, point: &PhasePoint) -> f64 {
        let pressing = domain.accelerations[gap].dot(point).abs();
        (2.0 * LOWEST_FLIGHT * self.system.length * pressing).sqrt()
    }

    /// Returns the result of the impact. Gaps whose flight would be too low stay at rest; otherwise impacts of two gaps could alternate for
    /// ever.
    pub(super) fn outcome(&self) -> Outcome {
        let (system, n) = (self.system, self.system.n);
        let mut kept = [false; MOST_GAPS];
        loop {
            let kick = self.joint_impact(kept);
            let outcome = self.outcome_of(&kick);
            let low = (0..system.gaps()).filter(|&other| kick.1[other]).find(|&other| {
                let GapMode::Stuck(side) = self.modes.gaps[other] else { return false };
                let (domain, mut point) = (system.domain(&outcome.modes), *self.point);
                point[n..2 * n].copy_from_slice(&outcome.rates[..n]);
                side.sign() * domain.departure(other, &point).1 > 0.0
                    && -side.sign() * point[n + other] <= self.lowest_speed(domain, other, &point)
            });
            match low {
                Some(other) => kept[other] = true,
                None => return outcome,
            }
        }
    }

    /// Returns the result of the impact for a given kick.
    fn outcome_of(&self, (kick, let_go): &Kick) -> Outcome {
        let (system, n, gap, side) = (self.system, self.system.n, self.gap, self.side);
        let [e, slope] = self.wall.restitution.at(self.approach);
        let leaving = e * self.approach;
        let after = |change: f64, rate: f64| {
            let mut point = *self.point;
            (0..n).for_each(|i| point[n + i] += kick[i] * change);
            point[n + gap] = rate;
            point
        };
        let mut modes = *self.modes;
        for other in (0..system.gaps()).filter(|&other| let_go[other]) {
            let GapMode::Stuck(side) = modes.gaps[other] else { continue };
            modes.gaps[other] = system.before_last(other, side);
        }
        let bounced = after(-side.sign() * (1.0 + e) * self.approach, -side.sign() * leaving);
        let (free, _) = self.slide_after_jump(&modes, kick, &bounced, None);
        let domain = system.domain(&free);
        let pressing = side.sign() * domain.departure(gap, &bounced).1;
        let is_slow = leaving <= self.wall.mesh_speed.max(self.lowest_speed(domain, gap, &bounced));
        let is_held = |other: usize| self.modes.gaps[other].rest().is_some() && !let_go[other];
        let held = std::array::from_fn(|other| other != gap && is_held(other));
        let outcome = |modes, point: &PhasePoint, lasts, factor: f64, bounce| Outcome {
            modes,
            rates: std::array::from_fn(|i| if i < n { point[n + i] } else { 0.0 }),
            lasts,
            pressing,
            jump: kick.map(|kick| kick * factor),
            impulse: Impulse { gap, side, held, bounce },
        };
        let factor = 1.0 + e + slope * self.approach;
        if is_slow && self.wall.contact == Contact::Rigid {
            let stopped = after(-side.sign() * self.approach, 0.0);
            modes.gaps[gap] = GapMode::Stuck(side);
            let (held, fits) = self.slide_after_jump(&modes, kick, &stopped, Some(side));
            if fits && held.gaps[gap] == GapMode::Stuck(side) {
                return outcome(held, &stopped, true, 1.0, Bounce::Stops);
            }
        } else if is_slow && pressing > 0.0 {
            let mut meshing = free;
            meshing.gaps[gap] = if leaving > 0.0 { GapMode::Onset(side) } else { GapMode::Pressed(side) };
            if side.sign() * system.domain(&meshing).departure(gap, &bounced).1 > 0.0 {
                if leaving <= self.wall.mesh_speed || e >= 1.0 {
                    return outcome(meshing, &bounced, true, factor, Bounce::Leaves);
                }
                // The rest of the series lasts `2 u / (G (1 - e))` for the leaving speed u and the pressing acceleration G. A flight with
                // the speed `2 u / (1 - e)` ends at the same time, with the same momentum.
                let longer = 2.0 / (1.0 - e);
                let whole =
                    after(-side.sign() * (1.0 + longer * e) * self.approach, -side.sign() * longer * leaving);
                return outcome(
                    meshing,
                    &whole,
                    true,
                    1.0 + longer * (e + slope * self.approach),
                    Bounce::Ends,
                );
            }
        }
        outcome(free, &bounced, false, factor, Bounce::Leaves)
    }

    /// Returns the kick while other gaps rest on rigid walls. A gap stays at rest if its wall pushes, or if it is in `kept`.
    pub(super) fn joint_impact(&self, kept: [bool; MOST_GAPS]) -> Kick {
        let none = [false; MOST_GAPS];
        let mut resting = self.modes.gaps.map(GapMode::rest);
        resting[self.gap] = None;
        if resting == [None; MOST_GAPS] {
            return (self.system.kicks[self.gap], none);
        }
        let own = |gap: usize| self.system.mobility[(gap, gap)];
        let choices = (0..1 << MOST_GAPS).map(|bits| std::array::from_fn(|other| bits >> other & 1 == 1));
        let is_possible = |let_go: &[bool; MOST_GAPS]| {
            resting.iter().zip(let_go).all(|(side, &let_go)| side.is_some() || !let_go)
        };
        for let_go in choices.filter(is_possible) {
            let held = |other: usize| resting[other].is_some() && !let_go[other];
            let Some((kick, pushes)) = self.kick(held) else { continue };
            let fits = |other: usize| {
                let Some(at) = resting[other] else { return true };
                let sign = -self.side.sign() * at.sign();
                let least = -ROUNDING * (own(self.gap) / own(other)).sqrt();
                match let_go[other] {
                    true => !kept[other] && sign * kick[other] <= 0.0,
                    false => kept[other] || sign * pushes[other] >= least,
                }
            };
            if (0..self.system.gaps()).all(fits) {
                return (kick, let_go);
            }
        }
        (
            self.kick(|other| resting[other].is_some()).map_or(self.system.kicks[self.gap], |(kick, _)| kick),
            none,
        )
    }

    /// Returns the changes of all rates by an impulse that changes the gap's rate by 1 while walls hold other gaps. Also returns the impulses
    /// of these walls, divided by the impulse on the gap. The impulse of a wall is 0 if earlier ones hold its gap. None if the walls hold the
    /// gap itself.
    pub(super) fn kick(&self, is_held: impl Fn(usize) -> bool) -> Option<(Numbers, [f64; MOST_GAPS])> {
        let (gap, gaps, m) = (self.gap, self.system.gaps(), |i, j| self.system.mobility[(i, j)]);
        // Gaussian elimination. The last entry of a row is the right-hand side.
        let mut rows: Vec<(usize, [f64; MOST_GAPS + 1])> = Vec::new();
        for held in (0..gaps).filter(|&other| is_held(other)) {
            let mut row = [0.0; MOST_GAPS + 1];
            (0..gaps).for_each(|other| row[other] = m(held, other));
            row[MOST_GAPS] = m(held, gap);
            for (earlier, of_earlier) in &rows {
                let factor = row[*earlier];
                row.iter_mut().zip(of_earlier).for_each(|(x, earlier)| *x -= factor * earlier);
            }
            let pivot = row[held];
            if pivot > NO_MOBILITY * m(held, held) {
                rows.push((held, row.map(|x| x / pivot)));
            }
        }
        let mut pushes = [0.0; MOST_GAPS];
        for (nth, (held, row)) in rows.iter().enumerate().rev() {
            let later = rows[nth + 1..].iter().map(|&(other, _)| row[other] * pushes[other]);
            pushes[*held] = row[MOST_GAPS] - later.sum::<f64>();
        }
        let mut kick = [0.0; SIZE];
        for i in (0..self.system.n).filter(|&i| i >= MOST_GAPS || !is_held(i)) {
            let held = (0..gaps).filter(|&other| is_held(other));
            kick[i] = m(i, gap) - held.map(|other| m(i, other) * pushes[other]).sum::<f64>();
        }
        (kick[gap] > NO_MOBILITY * m(gap, gap)).then(|| (kick.map(|change| change / kick[gap]), pushes))
    }

    /// Chooses the modes of friction and of other gaps at rest after a jump of the rates. `point` has the rates after the jump; `stopped`
    /// is the side of the gap if it stops. Returns whether a consistent choice exists.
    fn slide_after_jump(
        &self,
        modes: &Modes,
        kick: &Numbers,
        point: &PhasePoint,
        stopped: Option<Side>,
    ) -> (Modes, bool) {
        let (system, n) = (self.system, self.system.n);
        let (mut modes, jumps) = (*modes, point != self.point);
        let mut at_rest = AtRest { gaps: modes.gaps.map(GapMode::rest), ..AtRest::default() };
        at_rest.gaps[self.gap] = stopped.or(at_rest.gaps[self.gap]);
        for (i, element) in system.elements.iter().enumerate() {
            let moves = element.row.iter().zip(kick).map(|(row, kick)| row * kick);
            let (moved, size) = moves.fold((0.0, 0.0), |(sum, size), x: f64| (sum + x, size + x.abs()));
            if jumps && moved.abs() > 1e-12 * size {
                let [rate, mut size] = element.rate_and_size(&point[n..]);
                if !system.ties.is_empty() {
                    // A rate along a dependent gap is a sum of rates that may cancel.
                    size += element.rate_and_size(&self.point[n..])[1];
                }
                at_rest.elements[i] = rate.abs() <= ROUNDING * size;
                modes.slips[i] = if at_rest.elements[i] { Slip::Stick } else { Slip::of(rate) };
            } else {
                at_rest.elements[i] = modes.slips[i] == Slip::Stick;
            }
        }
        if at_rest == AtRest::default() && system.elements.is_empty() && system.springs.is_empty() {
            return (modes, true);
        }
        modes.pieces = system.pieces_at(&modes.slips, point);
        match system.consistent(&modes, &at_rest, point) {
            Some(chosen) => (chosen, true),
            None => (modes, false),
        }
    }
}
