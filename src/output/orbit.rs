//! One orbit on the terminal and in its folder: `orbit.json` and figures.

use std::fs;

use super::orbit_json::to_json;
use super::orbit_summary::summary;
use super::{Folder, orbit_figures};
use crate::model::GearPair;
use crate::orbit::{Class, Orbit, trace};

/// Samples per forcing period that figures need: 400, or 20 to a turn of the relative motion
/// in meshing where that is more.
fn samples_per_period(pair: &GearPair) -> usize {
    let ringing = (pair.k * (1.0 / pair.m1 + 1.0 / pair.m2)).sqrt() / pair.omega;
    (20.0 * ringing).clamp(400.0, 50_000.0) as usize
}

const JSON: &str = "orbit.json";

/// Prints the orbit to stdout, as JSON or as a summary for the eye.
///
/// # Errors
/// If stdout cannot be written, unless its reader has closed it.
pub fn print(pair: &GearPair, orbit: &Orbit, json: bool) -> anyhow::Result<()> {
    let text = if json { to_json(pair, orbit)? } else { summary(pair, orbit) };
    super::print(&text)
}

/// Writes the orbit and, unless it failed, its figures. Returns the number of files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, pair: &GearPair, orbit: &Orbit) -> anyhow::Result<usize> {
    // Figures of an earlier orbit must not stand beside this one.
    folder.remove(&[JSON])?;
    folder.remove(&orbit_figures::NAMES)?;
    let json = to_json(pair, orbit)?;
    folder.replace(JSON, |path| Ok(fs::write(path, json + "\n")?))?;
    if orbit.class == Class::Failed {
        return Ok(1);
    }
    let samples = samples_per_period(pair);
    let trace = trace(pair, orbit.strobe, orbit.strobe_meshing, orbit.cycle_periods, samples);
    let figures = orbit_figures::write(folder.path(), pair, orbit, &trace)?;
    Ok(1 + figures.len())
}
