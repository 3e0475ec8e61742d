//! The engine, device and program that computed a map.

/// Names of the engine, precision and device that computed a map, and the commit of the program.
#[derive(Clone, Copy, Debug)]
pub struct Provenance<'a> {
    /// Engine.
    pub engine: &'a str,
    /// Precision.
    pub precision: &'a str,
    /// Device.
    pub device: &'a str,
    /// Commit of the program.
    pub commit: &'a str,
}
