//! What does a large map cost beside its motions: time, memory, disk?
//!
//! Nothing of it is integrated but a small map of the same plane. Its records are stretched over the large one, and their
//! numbers changed a little from cell to cell, so that they compress no better than those of lanes do.

mod memory;
mod stretched;

pub use memory::Memory;
pub use stretched::Stretched;
