//! States of lanes after a few periods against the reference's.
//!
//! A lane that misses one impact in thousands comes to the same attractor, and its record is right. Its state a few
//! periods after the start is not. Many lanes are compared, a few periods each. How far rounding alone may lead is
//! measured: on the reference from starts and parameters that are the same within the engine's resolution, with the
//! state moved as much at every period.

use super::Subject;
use super::cell::{Cell, resolution};
use super::rate::Rate;
use crate::record::distance::farther;
use rattlemap_dynamics::model::State;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

/// Forcing periods after which states are compared: few enough for chaos to be foreseen.
pub const HORIZON: u32 = 4;

/// Starts that are the same within the resolution: for every lane, and for one that seems off.
const FEW: u64 = 6;
const MANY: u64 = 200;

/// A lane may be farther off than the farthest of these by this factor: it rounds at every step.
const FACTOR: f64 = 8.0;

/// Where rounding may lead farther than this share of the motion, nothing is foreseen.
const FORESEEN: f64 = 0.05;

/// A lane whose state is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Off {
    /// The run, as in [`Plan::cell`](crate::map::plan::Plan::cell).
    pub id: u32,
    /// How far it is from the reference, relative to the motion.
    pub distance: f64,
    /// How far rounding may lead.
    pub bar: f64,
}

/// What the comparison of states came to.
#[derive(Clone, Debug, PartialEq)]
pub struct StateCheck {
    /// Lanes that were compared: neither side failed, and rounding leads nowhere else.
    pub compared: usize,
    /// Those that are off.
    pub off: Vec<Off>,
    /// The median and the largest distance of the others.
    pub distances: [f64; 2],
}

impl StateCheck {
    /// The rate of lanes that are off.
    pub fn rate(&self) -> Rate {
        Rate::new(self.off.len(), self.compared)
    }
}

/// Compares the states of lanes after [`HORIZON`] periods; none for a lane that failed.
pub(super) fn check(subject: &Subject<'_>, lanes: &[(u32, Option<State>)], halt: &AtomicBool) -> StateCheck {
    let told: Vec<Off> = lanes
        .par_iter()
        .filter_map(|&(id, state)| compare(&Cell::new(subject, id, halt), id, state?, subject))
        .collect();
    let (off, right): (Vec<Off>, Vec<Off>) = told.into_iter().partition(|lane| lane.distance > lane.bar);
    let mut distances: Vec<f64> = right.iter().map(|lane| lane.distance).collect();
    distances.sort_by(f64::total_cmp);
    let at = |i: usize| distances.get(i).copied().unwrap_or(0.0);
    let last = distances.len().saturating_sub(1);
    StateCheck { compared: off.len() + right.len(), off, distances: [at(last / 2), at(last)] }
}

fn compare(cell: &Cell<'_>, id: u32, state: State, subject: &Subject<'_>) -> Option<Off> {
    let told = |count: u64| {
        let (end, moved) = cell.states(count, HORIZON)?;
        let spread = moved.iter().map(|other| cell.apart(&end, other)).fold(0.0, farther);
        let bar = FACTOR * spread.max(resolution(subject.precision));
        (bar < FORESEEN).then(|| Off { id, distance: cell.apart(&end, &state), bar })
    };
    let few = told(FEW)?;
    // An event near to grazing moves few of the starts, and those far.
    if few.distance > few.bar { told(MANY) } else { Some(few) }
}
