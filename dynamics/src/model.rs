//! Models of piecewise-linear oscillators between two walls.
//!
//! A [`Model`] has named parameters. Two models are built in: [`GearPair`], and [`Stops`], which can be solved by
//! hand. From its parameters a model derives an [`Oscillator`] and a contact [`Law`]. An oscillator is a mass matrix,
//! three linear domains with harmonic forcing, a gap that is linear in the displacements, and two walls. Flow,
//! reference and stability use only the oscillator and the law; scenes, maps and files use only the trait.

mod gear_pair;
mod machine;
mod non_impacting;
mod oscillator;
mod parameter;
mod state;
mod stops;
mod traits;

pub use gear_pair::GearPair;
pub use machine::{
    Drive, DryFriction, Forces, GapRow, MOST_COORDINATES, MOST_GAPS, Machine, Restitution, Spring, Wall,
};
pub use non_impacting::NonImpacting;
pub(crate) use oscillator::is_semidefinite;
pub use oscillator::{
    Contact, Domain, Friction, HIGHEST_ORDER, Harmonic, Law, MOST_CHANGES, MOST_FRICTION, MOST_HARMONICS,
    MOST_STAGES, MOST_WALLS, Oscillator, OscillatorError, OuterWall, Stage,
};
pub use parameter::{Parameter, ParameterError, Range, Shapes, Units};
pub use state::{REST, STATE, State, state};
pub(crate) use state::{difference, dot, sum};
pub use stops::Stops;
pub use traits::{CloneModel, Model, ModelError};

/// One of the two walls that bound the free gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// The upper wall, `z = +b`; the tooth surface of the gear pair.
    Right,
    /// The lower wall, `z = -b`; the tooth back of the gear pair.
    Left,
}

impl Side {
    /// Both walls.
    pub const BOTH: [Side; 2] = [Side::Right, Side::Left];

    /// Returns the direction from the gap to the wall: `+1` right, `-1` left.
    #[inline]
    pub fn sign(self) -> f64 {
        match self {
            Side::Right => 1.0,
            Side::Left => -1.0,
        }
    }

    /// Returns the index in arrays over both walls: 0 right, 1 left.
    #[inline]
    pub fn index(self) -> usize {
        match self {
            Side::Right => 0,
            Side::Left => 1,
        }
    }

    /// Returns the opposite wall.
    #[inline]
    pub fn mirrored(self) -> Side {
        match self {
            Side::Right => Side::Left,
            Side::Left => Side::Right,
        }
    }
}
