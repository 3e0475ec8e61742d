//! The general engine: the motion of an [`Oscillator`](crate::model::Oscillator) with several coordinates and gaps, and dry friction.
//!
//! # Elements and domains
//!
//! Each wall and each element with dry friction has a few modes. A combination of all modes and a stage is a *domain*, in which the
//! equations of motion are linear. Domains are built on first use. The gaps are coordinates, completed by displacements, so that a contact
//! puts its gap exactly on the wall. A gap whose row depends on those of earlier gaps is one coordinate more. The mobility matrix is then
//! singular, and accelerations keep the relation of the gaps. Rounding breaks it slowly, so each event and each phase 0 restore it.
//!
//! ```text
//! a = (d, w, cos and sin of each harmonic, 1),   d' = w,   w' = row of accelerations . a
//! ```
//!
//! # Steps and events
//!
//! A step is a Taylor polynomial from the present state, of order 23 over at most 1.6 radians of the fastest rate and of lower order on
//! shorter steps, so that its remainder is below rounding. Overdamped modes that have decayed do not count as the fastest rate. A mode ends at a root of a linear function of `a`, called a *watch*. Over one step, a watch is a polynomial of time. Its
//! Bernstein coefficients show that it has no root, or isolate the first one. So no event is missed, at any step length.
//!
//! # Tangents
//!
//! An event multiplies tangent vectors by `S = R + (f+ - R f-) n^T / (n . f-)`, with the derivative `R` of the jump, the vector fields `f-`
//! and `f+` before and after all mode changes of the instant, and the gradient `n` of the watch.

mod constraints;
mod domain;
mod domains;
mod flight;
mod frame;
mod impact;
mod modes;
mod motion;
mod outputs;
mod passages;
mod polynomial;
mod slow;
mod table;
mod watch;

pub use domains::System;
pub use frame::Frame;
pub use impact::LOWEST_FLIGHT;
pub(crate) use motion::CarriedModes;
pub use motion::{MachineMotion, TIE};
pub use outputs::{Outputs, Situation};
pub(crate) use passages::Limit;
pub use passages::{Passage, Touched};
pub use table::{Equations, StartModes};

use crate::model::{MOST_COORDINATES_AND_HARMONICS, STATE, State};

/// Number of entries of a state.
pub(crate) const SIZE: usize = STATE;

/// Length of `a`: the state, cosine and sine of each harmonic, and 1, rounded up to a multiple of four for SIMD registers.
pub(crate) const WIDTH: usize = (2 * MOST_COORDINATES_AND_HARMONICS + 1).next_multiple_of(4);

/// Rounding error of a sum, relative to the size of its terms.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// A state in the coordinates of the model, `(x1, v1, x2, v2, ...)`, or in those of the flow, `(d1 .. dn, w1 .. wn)`; unused entries are 0.
pub(crate) type Numbers = State;

/// A point `a` of the extended phase space: the state in the coordinates of the flow, the phasors, and 1.
pub(crate) type PhasePoint = [f64; WIDTH];
