//! Run time against error, for this project's engines and for what one would use instead.
//!
//! Every method integrates the same [`cells`] over [`PERIODS`] forcing periods, from states
//! that are exact in f32. Its error is the largest difference of the four numbers of the last
//! strobe state, and of the times of the last [`EVENTS`] events, from the event-driven f64
//! reference; its cost is wall time per forcing period of one lane. Lanes on a device run
//! many copies of the cells at once, methods on a core one lane after the other; methods take
//! turns, so that a change of the machine's speed meets all of them alike.
//!
//! | method | steps, or tolerance | where | event times |
//! | --- | --- | --- | --- |
//! | lane, f32 and f64 ([`rattlemap::gpu`]) | 16 to 1024 per period, never fewer than one per radian of the fastest free mode | device | reported by a variant of the shader |
//! | classical Runge-Kutta, f32 and f64, in WGSL: in one loop as papers write it, and in the lane's two phases | 64 to 8192 per period | device | the same |
//! | classical Runge-Kutta ([`fixed_step`]) | 64 to 8192 per period | one core | yes |
//! | semi-implicit Euler ([`fixed_step`]) | 64 to 8192 per period | one core | yes |
//! | DOP853 of `ode_solvers` ([`adaptive`]) | tolerance 1e-4 to 1e-12 | one core | yes |
//! | reference ([`mod@rattlemap_dynamics::reference`]) | none | one core | it is the measure |
//!
//! The baselines are written as a careful author would: events are located by Newton's method
//! on the integrator itself, restarts on a wall divide out the root there, turning points
//! inside a step are checked, strobes stay on the grid. In WGSL they share the lane's model,
//! contact law, phase and dispatches (`benches/shaders`).
//!
//! Programs outside of this crate join by a table in the same columns
//! ([`points::Point`]); see `benches/peers`.

pub mod adaptive;
pub mod cells;
mod figure;
pub mod fixed_step;
pub mod lanes;
pub mod measure;
pub mod outcome;
pub mod output;
pub mod points;
pub mod ratio;
mod shaders;

/// Forcing periods that every lane integrates: few enough for chaos to keep its digits.
pub const PERIODS: u32 = 8;

/// Events at the end of the horizon whose times are compared.
pub const EVENTS: usize = 2;
