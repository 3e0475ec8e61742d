//! Modes of walls and friction.

use super::constraints::NO_MOBILITY;
use super::domain::{DomainKey, Functional};
use super::frame::Frame;
use super::{Numbers, PhasePoint, SIZE};
use crate::model::{Curve, MOST_FRICTION, MOST_GAPS, MOST_SPRINGS, Side};
use crate::motion::{Slip, Slips};

/// The mode of a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GapMode {
    /// The gap has passed this number of walls, whose springs act: positive on the right, negative on the left, 0 between the first walls.
    Beyond(i8),
    /// Lasting contact with the last wall of a side, which has begun with an impact; the gap is still in front of the wall.
    Onset(Side),
    /// Lasting contact with the last wall of a side, which has begun with an impact; the gap is behind the wall.
    Pressed(Side),
    /// Behind the last wall of a side without contact: the wall only pushes, and its spring and damper would pull.
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

    /// Returns the side of the rigid wall on which the gap rests.
    pub(super) fn rest(self) -> Option<Side> {
        if let GapMode::Stuck(side) = self { Some(side) } else { None }
    }
}

/// All modes of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Modes {
    pub(super) stage: usize,
    pub(super) gaps: [GapMode; MOST_GAPS],
    pub(super) slips: Slips,
    pub(super) pieces: Pieces,
}

/// Numbers of the pieces of all curves: those of friction forces, then those of nonlinear springs.
pub(super) type Pieces = [u8; MOST_CURVES];

/// Largest number of curves.
pub(super) const MOST_CURVES: usize = MOST_FRICTION + MOST_SPRINGS;

impl Modes {
    /// Whether the modes are equal to others. Only the first `gaps` gaps are in use.
    pub(super) fn are(&self, other: &Modes, gaps: usize) -> bool {
        self.gaps[..gaps] == other.gaps[..gaps]
            && (self.stage, self.slips, self.pieces) == (other.stage, other.slips, other.pieces)
    }

    pub(super) fn key(&self, system: &Frame) -> DomainKey {
        let mut key = DomainKey {
            stage: self.stage,
            engaged: [0; MOST_GAPS],
            held: [None; MOST_GAPS],
            slips: self.slips,
            pieces: self.pieces,
        };
        for gap in 0..system.gaps() {
            let count = |side: Side| system.walls(gap, side).len();
            key.engaged[gap] = match self.gaps[gap] {
                GapMode::Beyond(count) => count,
                GapMode::Onset(side) | GapMode::Pressed(side) => signed(side, count(side)),
                GapMode::Open(side) | GapMode::Stuck(side) => signed(side, count(side) - 1),
            };
            key.held[gap] = self.gaps[gap].rest();
        }
        key
    }
}

/// Returns the number of passed walls with the sign of their side.
pub(super) fn signed(side: Side, count: usize) -> i8 {
    if side == Side::Right { count as i8 } else { -(count as i8) }
}

/// Elements at rest, whose modes depend on forces: gaps on rigid walls, with their sides, and friction elements without a sliding rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct AtRest {
    pub(super) gaps: [Option<Side>; MOST_GAPS],
    pub(super) elements: [bool; MOST_FRICTION],
}

impl Frame {
    /// Returns the mode of a gap in front of the last wall of a side.
    pub(super) fn before_last(&self, gap: usize, side: Side) -> GapMode {
        GapMode::Beyond(signed(side, self.walls(gap, side).len() - 1))
    }

    /// Returns the side of a gap's lasting contact, if there is one. A wall that only pushes has none while its force is 0.
    pub(super) fn contact(&self, modes: &Modes, gap: usize) -> Option<Side> {
        match modes.gaps[gap] {
            GapMode::Open(side) => self.before_last(gap, side).contact(),
            mode => mode.contact(),
        }
    }

    /// Returns side and index of the next wall in a direction from a gap.
    #[inline]
    pub(super) fn wall_ahead(&self, modes: &Modes, gap: usize, direction: Side) -> Option<(Side, usize)> {
        let GapMode::Beyond(passed) = modes.gaps[gap] else { return None };
        let number = usize::from(passed.unsigned_abs());
        if passed == 0 || (passed > 0) == (direction == Side::Right) {
            (number < self.walls(gap, direction).len()).then_some((direction, number))
        } else {
            Some((direction.mirrored(), number - 1))
        }
    }

    /// Returns the side on which a gap has passed the last wall, if there is one and this wall only pushes.
    pub(super) fn pushed(&self, modes: &Modes, gap: usize) -> Option<Side> {
        let GapMode::Beyond(passed) = modes.gaps[gap] else { return None };
        let side = if passed > 0 { Side::Right } else { Side::Left };
        let is_last = passed != 0 && self.walls(gap, side).len() == usize::from(passed.unsigned_abs());
        (is_last && self.pushing(gap, side).is_some()).then_some(side)
    }

    /// Whether the force of a side's last wall, on its present piece, is 0 only at the wall. There the gap leaves the wall.
    pub(super) fn vanishes_at_wall(&self, modes: &Modes, gap: usize, side: Side) -> bool {
        let spring = self.last_wall(gap, side).springs[modes.stage];
        let is_first = self.curve_of_wall(gap, side).is_none_or(|i| modes.pieces[i] == 0);
        is_first && spring.damping == 0.0 && spring.force_at_wall() == 0.0
    }

    /// Returns the row of the force of a side's last wall, positive where it pushes.
    pub(super) fn force(&self, stage: usize, pieces: &Pieces, gap: usize, side: Side) -> Functional {
        let (wall, sign) = (self.last_wall(gap, side), side.sign());
        let mut spring = wall.springs[stage];
        if let Some(i) = self.curve_of_wall(gap, side) {
            // The elongation is `sign` times the gap.
            let [slope, force] = self.springs[i - MOST_FRICTION].curve.pieces[usize::from(pieces[i])];
            spring.preload = Some(spring.force_at_wall() + force + sign * slope * wall.at);
            spring.stiffness += slope;
        }
        let mut row = Functional::zero(self.width());
        row.0[gap] = sign * spring.stiffness;
        row.0[self.n + gap] = sign * spring.damping;
        row.plus(spring.force_at_wall() - sign * spring.stiffness * wall.at, self.width())
    }

    /// Returns the row of an element's sliding rate.
    pub(super) fn rate_row(&self, i: usize) -> Functional {
        let mut row = Functional::zero(self.width());
        (0..self.n).for_each(|j| row.0[self.n + j] = self.elements[i].row[j]);
        row.plus(-self.elements[i].speed, self.width())
    }

    /// Returns a curve by its number in [`Pieces`], if it has several pieces and its piece matters.
    pub(super) fn curve(&self, i: usize, slips: &Slips) -> Option<&Curve> {
        let curve = match i.checked_sub(MOST_FRICTION) {
            None => self.elements.get(i).filter(|_| slips[i] != Slip::Stick).map(|element| &element.curve),
            Some(spring) => self.springs.get(spring).map(|spring| &spring.curve),
        };
        curve.filter(|curve| !curve.borders.is_empty())
    }

    /// Whether a gap is behind the last wall of a side, whose force may be 0 because it only pushes.
    pub(super) fn is_behind_last(&self, modes: &Modes, gap: usize, side: Side) -> bool {
        let all = GapMode::Beyond(signed(side, self.walls(gap, side).len()));
        [all, GapMode::Open(side)].contains(&modes.gaps[gap])
    }

    /// Returns the row of a curve's argument: the modulus of a sliding rate, or an elongation.
    pub(super) fn argument(&self, i: usize, slips: &Slips) -> Functional {
        let Some(spring) = i.checked_sub(MOST_FRICTION) else {
            return self.rate_row(i).scaled(slips[i].sign());
        };
        let mut row = Functional::zero(self.width());
        row.0[..self.n].copy_from_slice(self.springs[spring].row.as_slice());
        row
    }

    /// Returns the pieces of all curves at a point. The piece of friction that sticks is 0.
    pub(super) fn pieces_at(&self, slips: &Slips, point: &PhasePoint) -> Pieces {
        std::array::from_fn(|i| {
            let piece = |curve: &Curve| curve.piece(self.argument(i, slips).dot(point)) as u8;
            self.curve(i, slips).map_or(0, piece)
        })
    }

    /// Removes rounding errors from the rates of sticking elements and of gaps at rest, and from dependent gaps.
    pub(super) fn hold(&self, modes: &Modes, y: &mut [f64], is_tangent: bool) {
        let (n, elements) = (self.n, self.elements.len());
        let nothing_rests = modes.gaps[..self.gaps()].iter().all(|mode| mode.rest().is_none())
            && modes.slips[..elements].iter().all(|slip| *slip != Slip::Stick);
        if nothing_rests && self.ties.is_empty() {
            return;
        }
        let is_stuck = |j: usize| modes.gaps.get(j).is_some_and(|mode| mode.rest().is_some());
        (0..n).filter(|&j| is_stuck(j)).for_each(|j| y[n + j] = 0.0);
        if !self.ties.is_empty() {
            let lies = |j: usize, y: f64| {
                let mut walls = (j < self.gaps())
                    .then(|| self.machine.gaps[j].walls.iter().flatten())
                    .into_iter()
                    .flatten();
                is_stuck(j) || !is_tangent && walls.any(|wall| wall.at == y)
            };
            let fixed: [bool; SIZE] = std::array::from_fn(|j| j < n && lies(j, y[j]));
            project(&mut y[..n], self.ties.iter().map(|tie| (*tie, 0.0)), |j, _| fixed[j]);
            let sticking = self.elements.iter().zip(modes.slips).filter(|(_, slip)| *slip == Slip::Stick);
            let sticking = sticking.map(|(element, _)| {
                let row = std::array::from_fn(|j| if j < n { element.row[j] } else { 0.0 });
                (row, if is_tangent { 0.0 } else { element.speed })
            });
            let rows = self.ties.iter().map(|tie| (*tie, 0.0)).chain(sticking);
            return project(&mut y[n..2 * n], rows, |j, w| is_stuck(j) || fixed[j] && w == 0.0);
        }
        // Gaussian elimination: each row loses the pivots of the rows before it.
        let mut reduced: [Option<(usize, Numbers, f64)>; MOST_FRICTION] = [None; MOST_FRICTION];
        let sticking = self.elements.iter().zip(modes.slips).filter(|(_, slip)| *slip == Slip::Stick);
        for (nth, (element, _)) in sticking.enumerate() {
            let mut row: Numbers = std::array::from_fn(|j| if j < n { element.row[j] } else { 0.0 });
            let mut speed = if is_tangent { 0.0 } else { element.speed };
            let least = NO_MOBILITY * element.row.amax();
            for (pivot, earlier, of_earlier) in reduced.iter().flatten() {
                let factor = row[*pivot] / earlier[*pivot];
                row.iter_mut().zip(earlier).for_each(|(x, earlier)| *x -= factor * earlier);
                (row[*pivot], speed) = (0.0, speed - factor * of_earlier);
            }
            let free = (0..n).filter(|&j| !is_stuck(j) && row[j].abs() > least);
            let pivot = free.max_by(|&a, &b| row[a].abs().total_cmp(&row[b].abs()));
            reduced[nth] = pivot.map(|pivot| (pivot, row, speed));
        }
        for (j, row, speed) in reduced.into_iter().flatten().rev() {
            let others: f64 = (0..n).filter(|&k| k != j).map(|k| row[k] * y[n + k]).sum();
            y[n + j] = (speed - others) / row[j];
        }
    }
}

/// Moves entries as little as possible so that the products with rows have given values. Fixed entries stay; a row is left out if earlier
/// rows and fixed entries determine its product.
fn project(y: &mut [f64], rows: impl Iterator<Item = (Numbers, f64)>, is_fixed: impl Fn(usize, f64) -> bool) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut directions: Vec<Numbers> = Vec::new();
    let fixed: [bool; SIZE] = std::array::from_fn(|j| y.get(j).is_none_or(|&y| is_fixed(j, y)));
    for (row, value) in rows {
        let mut direction: Numbers = std::array::from_fn(|j| if fixed[j] { 0.0 } else { row[j] });
        for earlier in &directions {
            let along = dot(earlier, &direction);
            direction.iter_mut().zip(earlier).for_each(|(x, earlier)| *x -= along * earlier);
        }
        let size = dot(&direction, &direction).sqrt();
        if size > NO_MOBILITY * dot(&row, &row).sqrt() {
            direction = direction.map(|x| x / size);
            let by = (value - dot(&row, y)) / dot(&row, &direction);
            y.iter_mut().zip(&direction).for_each(|(y, x)| *y += by * x);
            directions.push(direction);
        }
    }
}
