//! Events of a machine.

use super::Numbers;
use super::slip::Slips;
use crate::model::Side;
use crate::reference::EventKind;

/// An event at a wall.
#[derive(Clone, Copy, Debug)]
pub struct MachineEvent {
    /// Index of the gap.
    pub gap: usize,
    /// What happened.
    pub kind: EventKind,
    /// The side of the wall.
    pub side: Side,
    /// Number of the wall on its side, from 0 on the inside.
    pub wall: usize,
    /// Symbol of the flight of this gap that ends here: `b'1'..=b'6'` if there is one gap, else [`of_gap`](crate::word::of_gap). None for
    /// the first flight.
    pub symbol: Option<u8>,
    /// Number of completed forcing periods.
    pub period: u64,
    /// Time since the last phase 0, in `[0, T]`.
    pub t: f64,
    /// State just before the event, `(x1, v1, x2, v2, ...)`.
    pub before: Numbers,
    /// State just after the event.
    pub after: Numbers,
    /// Whether the gap was on the wall.
    pub(crate) is_on_wall: bool,
    /// Rate of the gap just before and just after the event.
    pub rates: [f64; 2],
    /// The side of the contact of this gap that lasts after the event, if one does.
    pub meshing: Option<Side>,
}

/// A change of the mode of dry friction.
#[derive(Clone, Copy, Debug)]
pub struct SlipEvent {
    /// Modes after the event.
    pub slips: Slips,
    /// Symbol `b'7'` if a phase of sticking ends, and `b'0'` if sliding reverses without sticking.
    pub symbol: Option<u8>,
    /// Number of completed forcing periods.
    pub period: u64,
    /// Time since the last phase 0, in `[0, T]`.
    pub t: f64,
    /// State, `(x1, v1, x2, v2, ...)`.
    pub at: Numbers,
}
