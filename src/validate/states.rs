//! Comparison of lanes' states with the reference after a few periods.
//!
//! A lane that misses one impact in thousands still reaches the same attractor, so its record is correct. But its state a few periods after
//! the start is wrong. Therefore many lanes are compared over a few periods. The effect of rounding is measured on the reference:
//! parameters, start, and the state after each period are perturbed within the engine's resolution.

use super::Subject;
use super::cell::{Cell, ROUNDING_FACTOR, resolution};
use super::rate::Rate;
use crate::record::distance::farther;
use rattlemap_dynamics::model::State;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

/// Number of forcing periods after which states are compared, small enough that chaotic motion is still predictable.
pub const HORIZON: u32 = 4;

/// Number of perturbed motions for every lane, and for a lane that seems wrong.
const FEW: u64 = 6;
const MANY: u64 = 200;

/// Largest relative deviation by rounding for which states are compared.
const PREDICTABLE: f64 = 0.05;

/// A compared lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Off {
    /// The run, as in [`Plan::cell`](crate::map::plan::Plan::cell).
    pub id: u32,
    /// Distance from the reference, relative to the size of the motion.
    pub distance: f64,
    /// Largest distance that rounding explains.
    pub bar: f64,
}

/// Result of the comparison of states.
#[derive(Clone, Debug, PartialEq)]
pub struct StateCheck {
    /// Number of compared lanes. Lanes are compared if neither side failed and the motion is predictable.
    pub compared: usize,
    /// Lanes with a wrong state.
    pub off: Vec<Off>,
    /// Median and largest distance of the other lanes.
    pub distances: [f64; 2],
}

impl StateCheck {
    /// Returns the rate of lanes with a wrong state.
    pub fn rate(&self) -> Rate {
        Rate::new(self.off.len(), self.compared)
    }
}

/// Compares the states of lanes after [`HORIZON`] periods. A lane without a state has failed and is skipped.
pub(super) fn check(subject: &Subject<'_>, lanes: &[(u32, Option<State>)], halt: &AtomicBool) -> StateCheck {
    let compared: Vec<Off> = lanes
        .par_iter()
        .filter_map(|&(id, state)| compare(&Cell::new(subject, id, halt), id, state?, subject))
        .collect();
    let (off, right): (Vec<Off>, Vec<Off>) = compared.into_iter().partition(|lane| lane.distance > lane.bar);
    let mut distances: Vec<f64> = right.iter().map(|lane| lane.distance).collect();
    distances.sort_by(f64::total_cmp);
    let at = |i: usize| distances.get(i).copied().unwrap_or(0.0);
    let last = distances.len().saturating_sub(1);
    StateCheck { compared: off.len() + right.len(), off, distances: [at(last / 2), at(last)] }
}

fn compare(cell: &Cell<'_>, id: u32, state: State, subject: &Subject<'_>) -> Option<Off> {
    let compare = |count: u64| {
        let (end, moved) = cell.states(count, HORIZON)?;
        let spread = moved.iter().map(|other| cell.apart(&end, other)).fold(0.0, farther);
        let bar = ROUNDING_FACTOR * spread.max(resolution(subject.precision));
        (bar < PREDICTABLE).then(|| Off { id, distance: cell.apart(&end, &state), bar })
    };
    let few = compare(FEW)?;
    // A nearly grazing event moves only a few of the perturbed motions, but moves them far.
    if few.distance > few.bar { compare(MANY) } else { Some(few) }
}
