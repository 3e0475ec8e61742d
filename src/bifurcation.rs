//! Section points against one parameter, as in Fig. 5 of the paper.

use crate::model::{GearPair, Side, State};
use crate::orbit::{Class, EventKind, Settings, Status};

/// The attractor's section points at one value of the axis.
#[derive(Clone, Debug)]
pub struct Column {
    /// Value of the axis parameter.
    pub value: f64,
    /// What the motion is.
    pub class: Class,
    /// How the integration ended.
    pub status: Status,
    /// Every crossing of a wall: contacts and ends of meshing.
    pub points: Vec<SectionPoint>,
}

/// One event seen as a point of the section `|z| = b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionPoint {
    /// The wall.
    pub side: Side,
    /// What happened there.
    pub kind: EventKind,
    /// Time since the last phase 0, in `[0, T)`.
    pub t_mod_period: f64,
    /// State just before the event.
    pub before: State,
    /// State just after the event.
    pub after: State,
}

/// Where each column starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Policy {
    /// Every column from the same state.
    From(State),
    /// Each column from the end of the one before, from the first to the last.
    Up,
    /// Each column from the end of the one after, from the last to the first.
    Down,
}

/// Integrates every cell; `progress` is told how many columns are done so far.
pub fn run(
    _cells: &[(f64, GearPair)],
    _policy: &Policy,
    _settings: &Settings,
    _progress: &(dyn Fn(usize) + Sync),
) -> Vec<Column> {
    todo!()
}
