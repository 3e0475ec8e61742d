//! Run time against error of this project's engines and of alternatives.
//!
//! Every method integrates the same [`cells`] over [`PERIODS`] forcing periods, from states that are exact in f32. Two errors
//! are measured against the event-driven reference in f64: the largest difference of the components of the last strobe
//! state, and that of the times of the last [`EVENTS`] events. The cost is the wall time per forcing period of one lane.
//! Devices run many copies of the cells at once; methods on a core run one lane after the other. Methods run alternately, so
//! that changes of the machine's speed affect all of them.
//!
//! | method | steps, or tolerance | where | event times |
//! | --- | --- | --- | --- |
//! | lane, f32 and f64 ([`rattlemap::gpu`]) | 16 to 1024 per period, never fewer than one per radian of the fastest free mode | device | from a variant of the shader |
//! | classical Runge-Kutta, f32 and f64, in WGSL: in one loop as in papers, and in the two phases of lanes | 64 to 8192 per period | device | from a variant of the shader |
//! | classical Runge-Kutta ([`fixed_step`]) | 64 to 8192 per period | one core | yes |
//! | DOP853 of `ode_solvers` ([`adaptive`]) | tolerance 1e-4 to 1e-12 | one core | yes |
//! | reference ([`mod@rattlemap_dynamics::motion`]) | none | one core | its errors are zero by definition |
//!
//! The baselines are implemented with care: Newton's method on the integrator itself locates events, a start on a wall
//! divides out the root there, turning points inside a step are checked, and strobes stay on the grid. In WGSL they share the
//! model, contact law, phase and dispatches of lanes (`benches/shaders`).
//!
//! Results of other programs are read from a table with the columns of [`points::Point`]; see `benches/peers`.

pub mod adaptive;
pub mod cells;
pub mod field;
mod figure;
pub mod fixed_step;
pub mod flight;
pub mod lanes;
pub mod measure;
pub mod outcome;
pub mod output;
pub mod points;
pub mod ratio;
mod shaders;

/// Forcing periods of every lane, few enough to predict chaos.
pub const PERIODS: u32 = 8;

/// Number of last events whose times are compared.
pub const EVENTS: usize = 2;
