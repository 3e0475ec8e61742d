//! The engine and device that computed a map.

/// Names of the engine, precision and device that computed a map.
#[derive(Clone, Copy, Debug)]
pub struct Provenance<'a> {
    /// Engine.
    pub engine: &'a str,
    /// Precision.
    pub precision: &'a str,
    /// Device.
    pub device: &'a str,
}
