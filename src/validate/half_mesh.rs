//! How much of a map rests on the leaving speed at which bouncing ends?
//!
//! It cuts off a series of ever smaller impacts, and models leave it open. What changes when it is halved says where
//! bouncing is taken to end, not what the motion is.

use super::cell::Cell;
use super::compare::Answer;
use super::rate::Rate;
use crate::record::classify::classify;
use rattlemap_dynamics::model::Law;
use rattlemap_dynamics::orbit::Class;

/// What changes with half the meshing speed, in cells that mesh. Periods, words and patterns are compared where the motion is
/// periodic with both.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfMesh {
    /// Cells whose class changes.
    pub classes: Rate,
    /// Cycles whose period changes.
    pub periods: Rate,
    /// Cycles whose word changes, up to mirror image.
    pub words: Rate,
    /// Cycles whose pattern does.
    pub patterns: Rate,
}

/// What changed in one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Changes {
    class: bool,
    /// Period, word and pattern of a cycle.
    cycle: Option<[bool; 3]>,
}

/// What changes in a cell whose start reaches `truth`; none if that does not mesh, or at no speed.
pub(super) fn changes(cell: &Cell<'_>, truth: &Answer) -> Option<Changes> {
    if truth.record.mesh_fraction <= 0.0 || cell.law.mesh_speed.iter().all(|&speed| speed <= 0.0) {
        return None;
    }
    let halved = cell.obeying(Law { mesh_speed: cell.law.mesh_speed.map(|speed| 0.5 * speed), ..cell.law });
    let [before, after] = [truth, &halved].map(|answer| classify(&answer.record));
    let cycle = match (before, after) {
        (Class::Periodic { period: before }, Class::Periodic { period: after }) => {
            let [word, pattern] = truth.is_spelled_as(&halved);
            Some([before != after, !word, !pattern])
        }
        _ => None,
    };
    Some(Changes { class: before.index() != after.index(), cycle })
}

/// What all of them say; none if no cell meshes.
pub(super) fn told(changes: &[Changes]) -> Option<HalfMesh> {
    let cycles: Vec<[bool; 3]> = changes.iter().filter_map(|changes| changes.cycle).collect();
    let of = |k: usize| Rate::new(cycles.iter().filter(|cycle| cycle[k]).count(), cycles.len());
    (!changes.is_empty()).then(|| HalfMesh {
        classes: Rate::new(changes.iter().filter(|changes| changes.class).count(), changes.len()),
        periods: of(0),
        words: of(1),
        patterns: of(2),
    })
}
