//! Constraints on the rates of a machine: gaps at rest on rigid walls, and sticking elements.

use nalgebra::{DMatrix, DVector};

use super::frame::{Element, Frame};
use crate::model::{MOST_GAPS, Side};
use crate::motion::{Slip, Slips};

/// A constraint is redundant if the mobility along its row is below this share of the unconstrained mobility.
pub(super) const NO_MOBILITY: f64 = 1e-12;

/// The element that a constraint holds at rest.
#[derive(Clone, Copy, Debug)]
pub(super) enum Constraint {
    /// A gap on a rigid wall.
    Wall(usize, Side),
    /// A sticking element.
    Element(usize),
}

/// Linear constraints on the rates `w`: each keeps the product of a row and `w` constant.
pub(super) struct Constraints {
    pub(super) kinds: Vec<Constraint>,
    /// The rows, and their products with the mobility.
    pub(super) rows: DMatrix<f64>,
    pub(super) moves: DMatrix<f64>,
    /// Inverse of `rows mobility rows^T`.
    pub(super) inverse: DMatrix<f64>,
    /// Changes of `w` by unit impulses, in the directions that are still free.
    pub(super) mobility: DMatrix<f64>,
}

impl Constraints {
    /// Collects the constraints of gaps on rigid walls and of sticking elements. A row that depends on earlier rows is left out.
    pub(super) fn new(system: &Frame, held: &[Option<Side>; MOST_GAPS], slips: &Slips) -> Constraints {
        let (n, mobility) = (system.n, &system.mobility);
        let unit = |gap: usize| DVector::from_fn(n, |i, _| f64::from(u8::from(i == gap)));
        let on_wall = |gap: usize| Some((Constraint::Wall(gap, held[gap]?), unit(gap)));
        let sticks = |&(i, _): &(usize, &Element)| slips[i] == Slip::Stick;
        let of_element = |(i, element): (usize, &Element)| (Constraint::Element(i), element.row.clone());
        let of_elements = system.elements.iter().enumerate().filter(sticks).map(of_element);
        let (mut left, mut kinds, mut kept) = (mobility.clone(), Vec::new(), Vec::new());
        for (kind, row) in (0..system.gaps()).filter_map(on_wall).chain(of_elements) {
            let along = &left * &row;
            let free = along.dot(&row);
            if free > NO_MOBILITY * (mobility * &row).dot(&row) {
                left -= &along * along.transpose() / free;
                kinds.push(kind);
                kept.push(row);
            }
        }
        let rows = DMatrix::from_fn(kept.len(), n, |i, j| kept[i][j]);
        let moves = mobility * rows.transpose();
        let inverse =
            (&rows * &moves).try_inverse().unwrap_or_else(|| DMatrix::zeros(kept.len(), kept.len()));
        Constraints { kinds, rows, moves, inverse, mobility: left }
    }
}
