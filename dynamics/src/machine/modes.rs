//! Modes of walls and friction, and which of them are consistent with a state.

use super::domain::{Domain, DomainKey, Row};
use super::system::System;
use super::{Numbers, Point};
use crate::model::{MOST_FRICTION, MOST_GAPS, Side};
use crate::motion::{Slip, Slips};

/// Rounding error of a sum, relative to the size of its terms.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Derivatives that are compared with zero. A force on one end of a chain of eight masses appears in the 16th derivative of the other end.
const DERIVATIVES: usize = 16;

/// Order of the root of a function that stays zero: all derivatives are zero within rounding.
pub(super) const STAYS_ZERO: usize = usize::MAX;

/// The mode of a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GapMode {
    /// Beyond a number of walls whose springs act: 0 between the first walls, positive on the right, negative on the left.
    Beyond(i8),
    /// Lasting contact with the last wall of a side, which has begun with an impact; the gap is still in front of the wall.
    Onset(Side),
    /// Lasting contact with the last wall of a side, which has begun with an impact; the gap is behind the wall.
    Pressed(Side),
    /// Behind the last wall of a side, which only pushes, while its spring and damper would pull.
    Open(Side),
    /// At rest on the rigid last wall of a side.
    Stuck(Side),
}

impl GapMode {
    /// Returns the side of a mode, if it has one.
    pub(super) fn contact(self) -> Option<Side> {
        match self {
            GapMode::Beyond(0) => None,
            GapMode::Beyond(1..) => Some(Side::Right),
            GapMode::Beyond(_) => Some(Side::Left),
            GapMode::Onset(side) | GapMode::Pressed(side) | GapMode::Stuck(side) | GapMode::Open(side) => {
                Some(side)
            }
        }
    }
}

/// All modes of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Modes {
    pub(super) stage: usize,
    pub(super) gaps: [GapMode; MOST_GAPS],
    pub(super) slips: Slips,
}

impl Modes {
    pub(super) fn key(&self, system: &System) -> DomainKey {
        let mut key = DomainKey {
            stage: self.stage,
            engaged: [0; MOST_GAPS],
            held: [None; MOST_GAPS],
            slips: self.slips,
        };
        for gap in 0..system.gaps() {
            let count = |side: Side| system.walls(gap, side).len() as i8;
            let signed = |side: Side, count: i8| if side == Side::Right { count } else { -count };
            key.engaged[gap] = match self.gaps[gap] {
                GapMode::Beyond(count) => count,
                GapMode::Onset(side) | GapMode::Pressed(side) => signed(side, count(side)),
                GapMode::Open(side) | GapMode::Stuck(side) => signed(side, count(side) - 1),
            };
            if let GapMode::Stuck(side) = self.gaps[gap] {
                key.held[gap] = Some(side);
            }
        }
        key
    }
}

/// What may change in a decision on elements at rest: gaps that rest on rigid walls, with their sides, and elements without a rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct AtRest {
    pub(super) gaps: [Option<Side>; MOST_GAPS],
    pub(super) elements: [bool; MOST_FRICTION],
}

/// Returns the lowest order, at least `first`, of a derivative of a row that is not 0 within rounding, and its value; [`STAYS_ZERO`] and 0 if
/// there is none.
pub(super) fn first_derivative(domain: &Domain, row: &Row, point: &Point, first: usize) -> (usize, f64) {
    let mut rate = row.clone();
    for order in 0..first + DERIVATIVES {
        if order >= first {
            let value = rate.dot(point);
            if value.abs() > ROUNDING * rate.size(point) {
                return (order, value);
            }
        }
        rate = domain.rate_of(&rate);
    }
    (STAYS_ZERO, 0.0)
}

impl System {
    /// Returns the row of an element's sliding rate.
    pub(super) fn rate_row(&self, i: usize, domain: &Domain) -> Row {
        let mut row = domain.unit_row(0).scaled(0.0);
        (0..self.n).for_each(|j| row.0[self.n + j] = self.elements[i].row[j]);
        row.plus(-self.elements[i].speed, self.width())
    }

    /// Whether the modes of the elements at rest fit the forces at a point.
    pub(super) fn is_consistent(&self, modes: &Modes, at_rest: &AtRest, point: &Point) -> bool {
        if *at_rest == AtRest::default() {
            return true;
        }
        let domain = self.domain(modes.key(self));
        let gaps = (0..self.gaps()).all(|gap| {
            let Some(side) = at_rest.gaps[gap] else { return true };
            match &domain.pushes[gap] {
                Some(push) => first_derivative(&domain, push, point, 0).1 > 0.0,
                // The gap leaves the wall, or friction holds it there.
                None => side.sign() * first_derivative(&domain, &domain.unit_row(gap), point, 2).1 <= 0.0,
            }
        });
        gaps && (0..self.elements.len()).filter(|&i| at_rest.elements[i]).all(|i| match modes.slips[i] {
            Slip::Stick => domain.holds[i].as_ref().is_none_or(|hold| {
                hold.dot(point).abs() <= self.elements[i].force + ROUNDING * hold.size(point)
            }),
            slip => slip.sign() * first_derivative(&domain, &self.rate_row(i, &domain), point, 1).1 > 0.0,
        })
    }

    /// Returns the first consistent combination of modes: walls hold before they let go, elements stick before they slide.
    pub(super) fn consistent(&self, modes: &Modes, at_rest: &AtRest, point: &Point) -> Option<Modes> {
        let resting: Vec<usize> = (0..self.gaps()).filter(|&gap| at_rest.gaps[gap].is_some()).collect();
        let sticking: Vec<usize> = (0..self.elements.len()).filter(|&i| at_rest.elements[i]).collect();
        let slips = 3usize.pow(sticking.len() as u32);
        let all = (0..1 << resting.len()).flat_map(|gaps| (0..slips).map(move |slips| (gaps, slips)));
        all.map(|(gaps, mut slips)| {
            let mut tried = *modes;
            for (bit, &gap) in resting.iter().enumerate() {
                let side = at_rest.gaps[gap].expect("it is at rest");
                let before = self.passable(gap, side) as i8;
                let is_held = gaps >> bit & 1 == 0;
                let free = GapMode::Beyond(if side == Side::Right { before } else { -before });
                tried.gaps[gap] = if is_held { GapMode::Stuck(side) } else { free };
            }
            for &i in sticking.iter().rev() {
                tried.slips[i] = Slip::ALL[slips % 3];
                slips /= 3;
            }
            tried
        })
        .find(|tried| self.is_consistent(tried, at_rest, point))
    }

    /// Sets the rates of sticking elements, and of gaps at rest, to their values without rounding errors.
    pub(super) fn hold(&self, modes: &Modes, y: &mut Numbers, is_tangent: bool) {
        let n = self.n;
        let is_stuck = |j: usize| j < self.gaps() && matches!(modes.gaps[j], GapMode::Stuck(_));
        (0..n).filter(|&j| is_stuck(j)).for_each(|j| y[n + j] = 0.0);
        let mut pivots = Vec::new();
        // The second pass completes the first where rows share coordinates.
        for pass in 0..2 {
            let sticking = self.elements.iter().zip(modes.slips).filter(|(_, slip)| *slip == Slip::Stick);
            for (nth, (element, _)) in sticking.enumerate() {
                if pass == 0 {
                    let free = (0..n)
                        .filter(|&j| !is_stuck(j) && element.row[j] != 0.0 && !pivots.contains(&Some(j)));
                    pivots.push(free.max_by(|&a, &b| element.row[a].abs().total_cmp(&element.row[b].abs())));
                }
                let Some(j) = pivots[nth] else { continue };
                let others: f64 = (0..n).filter(|&k| k != j).map(|k| element.row[k] * y[n + k]).sum();
                let speed = if is_tangent { 0.0 } else { element.speed };
                y[n + j] = (speed - others) / element.row[j];
            }
        }
    }
}
