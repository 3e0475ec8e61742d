//! Dependence of a map on the meshing speed.
//!
//! The meshing speed ends a series of ever smaller impacts. The modeller chooses its value. Results that change when it is halved depend on
//! this choice.

use super::cell::Cell;
use super::compare::Answer;
use super::rate::Rate;
use crate::record::classify::classify;
use rattlemap_dynamics::orbit::Class;

/// Rates at which cells that mesh change if the meshing speed is halved. Periods, words and patterns are compared if the motion is periodic
/// with both speeds.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfMesh {
    /// The meshing speed, if it is the same at all walls of all compared cells.
    pub mesh_speed: Option<f64>,
    /// Cells whose class changes.
    pub classes: Rate,
    /// Cycles whose period changes.
    pub periods: Rate,
    /// Cycles whose word changes, up to mirror image.
    pub words: Rate,
    /// Cycles whose pattern changes, up to mirror image.
    pub patterns: Rate,
}

impl HalfMesh {
    /// Whether the map depends on the meshing speed: a class, period or pattern changes. Words do not count, because they contain the
    /// bounces before meshing.
    pub fn matters(&self) -> bool {
        [self.classes, self.periods, self.patterns].iter().any(|rate| rate.count > 0)
    }
}

/// What changes in one cell if the meshing speed is halved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Changes {
    /// The meshing speed, if it is the same at all walls.
    mesh_speed: Option<f64>,
    class: bool,
    /// Whether period, word and pattern of a cycle change.
    cycle: Option<[bool; 3]>,
}

/// Compares a cell's answer `truth` with the answer for half the meshing speed. None if the motion does not mesh, or if the meshing speed
/// is zero.
pub(super) fn changes(cell: &Cell<'_>, truth: &Answer) -> Option<Changes> {
    let speeds = cell.mesh_speeds();
    if truth.record.mesh_fraction <= 0.0 || speeds.iter().all(|&speed| speed <= 0.0) {
        return None;
    }
    let halved = cell.with_mesh_speeds(0.5);
    let [before, after] = [truth, &halved].map(|answer| classify(&answer.record));
    let cycle = match (before, after) {
        (Class::Periodic { period: before }, Class::Periodic { period: after }) => {
            let [word, pattern] = truth.is_spelled_as(&halved);
            Some([before != after, !word, !pattern])
        }
        _ => None,
    };
    let mesh_speed = speeds.first().copied().filter(|first| speeds.iter().all(|speed| speed == first));
    Some(Changes { mesh_speed, class: before.index() != after.index(), cycle })
}

/// Computes the rates over all meshing cells; none without meshing cells.
pub(super) fn rates(changes: &[Changes]) -> Option<HalfMesh> {
    let cycles: Vec<[bool; 3]> = changes.iter().filter_map(|changes| changes.cycle).collect();
    let of = |k: usize| Rate::new(cycles.iter().filter(|cycle| cycle[k]).count(), cycles.len());
    let first = changes.first()?.mesh_speed;
    let is_common = changes.iter().all(|changes| changes.mesh_speed == first);
    Some(HalfMesh {
        mesh_speed: first.filter(|_| is_common),
        classes: Rate::new(changes.iter().filter(|changes| changes.class).count(), changes.len()),
        periods: of(0),
        words: of(1),
        patterns: of(2),
    })
}
