//! Models of piecewise-linear oscillators between walls.
//!
//! A [`Model`] has named parameters. Two models are built in: [`GearPair`], and [`Stops`], which can be solved by hand. From its parameters
//! a model derives an [`Oscillator`], the only description of the moving system: coordinates, gaps with walls and their laws, dry friction,
//! stages and harmonics of the force. [`Pair::of`] converts it for the fast engine, if that engine supports it.

mod error;
mod gear_pair;
mod law;
mod non_impacting;
mod oscillator;
mod pair;
mod parameter;
mod rigid_modes;
mod schedule;
mod state;
mod stops;
mod traits;

pub use error::OscillatorError;
pub use gear_pair::GearPair;
pub use law::{Contact, Law};
pub use non_impacting::NonImpacting;
pub use oscillator::{
    Curve, Drive, DryFriction, Forces, GapRow, HIGHEST_ORDER, MOST_COORDINATES,
    MOST_COORDINATES_AND_HARMONICS, MOST_FRICTION, MOST_GAPS, MOST_HARMONICS, MOST_PIECES, MOST_SIGNALS,
    MOST_SPRINGS, MOST_WALLS, NonlinearSpring, Oscillator, Restitution, Signal, Spring, Timing, Wall,
};
pub(crate) use oscillator::{LEAST_LENGTH, ON_WALL};
pub(crate) use pair::is_semidefinite;
pub use pair::{Domain, Form, Harmonic, Pair, Stage};
pub use parameter::{Parameter, ParameterError, Range, Shapes, Units};
pub use rigid_modes::{RigidMode, RigidModes};
pub use schedule::{MOST_CHANGES, MOST_STAGES};
pub use state::{REST, STATE, State, state};
pub(crate) use state::{difference, dot, first_four, sum};
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
