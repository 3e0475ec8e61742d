//! Modes of dry friction.

use crate::model::MOST_FRICTION;

/// The mode of an element with dry friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Slip {
    /// The sliding rate stays 0.
    #[default]
    Stick,
    /// The sliding rate is positive.
    Forward,
    /// The sliding rate is negative.
    Backward,
}

/// The modes of all elements. Unused entries are [`Slip::Stick`].
pub type Slips = [Slip; MOST_FRICTION];

impl Slip {
    /// All modes, in the order in which they are tried.
    pub(crate) const ALL: [Slip; 3] = [Slip::Stick, Slip::Forward, Slip::Backward];

    /// Returns the direction of sliding, 0 for sticking.
    pub(crate) fn sign(self) -> f64 {
        match self {
            Slip::Stick => 0.0,
            Slip::Forward => 1.0,
            Slip::Backward => -1.0,
        }
    }

    /// Returns the opposite direction of sliding.
    pub fn reversed(self) -> Slip {
        match self {
            Slip::Stick => Slip::Stick,
            Slip::Forward => Slip::Backward,
            Slip::Backward => Slip::Forward,
        }
    }

    /// Returns the direction of a rate that is not 0.
    pub fn of(rate: f64) -> Slip {
        if rate > 0.0 { Slip::Forward } else { Slip::Backward }
    }
}
