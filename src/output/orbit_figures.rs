//! Placeholder until the figures are merged.

use std::path::{Path, PathBuf};

use crate::model::GearPair;
use crate::orbit::{Orbit, Sample};

/// Draws one orbit.
pub fn write(
    _dir: &Path,
    _pair: &GearPair,
    _orbit: &Orbit,
    _trace: &[Sample],
) -> anyhow::Result<Vec<PathBuf>> {
    todo!()
}
