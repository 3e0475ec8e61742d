//! One orbit on the terminal and in its folder: `orbit.json` and figures.

use std::fs;

use super::orbit_json::to_json;
use super::orbit_summary::summary;
use super::{Folder, OutputError, orbit_figures};
use rattlemap_dynamics::model::{Model, Oscillator};
use rattlemap_dynamics::orbit::{Class, Orbit, trace};

/// Samples per forcing period that figures need: 400, or 20 to a turn of the relative motion
/// in meshing where that is more.
fn samples_per_period(oscillator: &Oscillator) -> usize {
    let Oscillator { masses: [m1, m2], gap: [g1, g2], free, meshing, omega, .. } = oscillator;
    // What a wall adds to the stiffness matrix is its own stiffness times g g'.
    let (i, square) = if *g2 == 0.0 { (0, g1 * g1) } else { (1, g1 * g2) };
    let added = |side: usize| (meshing[side].stiffness[0][i] - free.stiffness[0][i]) / square;
    let ringing = (added(0).max(added(1)) * (g1 * g1 / m1 + g2 * g2 / m2)).sqrt() / omega;
    (20.0 * ringing).clamp(400.0, 50_000.0) as usize
}

const JSON: &str = "orbit.json";

/// Every file that an orbit may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    [JSON].into_iter().chain(orbit_figures::NAMES)
}

/// Prints the orbit to stdout, as JSON or as a summary for the eye.
///
/// # Errors
/// [`OutputError`] if stdout cannot be written, unless its reader has closed it.
pub fn print(model: &dyn Model, orbit: &Orbit, json: bool) -> Result<(), OutputError> {
    let text = if json { to_json(model, orbit)? } else { summary(model, orbit) };
    super::print(&text)
}

/// Writes the orbit and, unless it failed, its figures. Returns the number of files.
///
/// # Errors
/// [`OutputError`] if a file cannot be written.
pub fn write(folder: &Folder, model: &dyn Model, orbit: &Orbit) -> Result<usize, OutputError> {
    // Figures of an earlier orbit must not stand beside this one.
    folder.remove(&[JSON])?;
    folder.remove(&orbit_figures::NAMES)?;
    let json = to_json(model, orbit)?;
    folder.replace(JSON, |path| Ok(fs::write(path, json + "\n")?))?;
    if orbit.class == Class::Failed {
        return Ok(1);
    }
    let samples = samples_per_period(&model.oscillator()?);
    let trace = trace(model, orbit.strobe, orbit.strobe_meshing, orbit.cycle_periods, samples)?;
    orbit_figures::write_each(model, orbit, &trace, |name, save| {
        folder.replace(name, |path| Ok(save(path)?))
    })?;
    Ok(1 + orbit_figures::NAMES.len())
}
