//! Placeholder until the figures are merged.

use std::path::Path;

use crate::bifurcation::Column;

/// Draws a bifurcation diagram.
pub fn write(_path: &Path, _title: &str, _axis_label: &str, _columns: &[Column]) -> anyhow::Result<()> {
    todo!()
}
