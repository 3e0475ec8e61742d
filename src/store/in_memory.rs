//! Builds the manifest and the tables of a map, diagram or comparison in memory, for callers that write no folder (Python).

use std::collections::BTreeMap;
use std::time::Duration;

use crate::map::bifurcation::Column;
use crate::map::curves::Curves;
use crate::map::scene::Scene;
use crate::model_file::several_gaps;
use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::map_pair::MapPair;
use crate::show::numbers::Number;
use crate::show::orbit_spectrum::Spectrum;
use crate::show::table::cell_columns::{self, Values};
use crate::show::table::words_csv::WordRows;
use crate::show::table::{attractors_csv, bifurcation_tables, compare_csv, curve_tables, orbit_tables};
use crate::show::words;
use crate::store::compare;
use crate::store::error::OutputError;
use crate::store::manifest::bifurcation::{DiagramArguments, bifurcation};
use crate::store::manifest::map::{self, Run};
use crate::store::orbit::moments;
use rattlemap_dynamics::model::Model;
use rattlemap_dynamics::orbit::{Class, History, Orbit};

/// A map in memory.
#[derive(Clone, Debug)]
pub struct Map {
    /// `manifest.json` without its list of files.
    pub manifest: String,
    /// The columns of `cells.npy`.
    pub columns: Vec<(String, Values)>,
    /// The texts of `words.csv`, by row.
    pub texts: Vec<String>,
    /// `attractors.csv`, if the map shows basins.
    pub attractors: Option<String>,
}

/// Builds the manifest and the tables of a map.
///
/// # Errors
/// [`OutputError`] if a result cannot be formatted.
pub fn map(cells: &Cells<'_>, run: &Run<'_>) -> Result<Map, OutputError> {
    let words = words::read(cells);
    let rows = WordRows::new(&words);
    let attractors =
        cells.basins().map(|basins| text(|to| attractors_csv::write(to, cells, basins))).transpose()?;
    Ok(Map {
        manifest: map::map(cells, run, map::timings(run, Duration::ZERO, BTreeMap::new()), &[]).to_string(),
        columns: cell_columns::read(cells, &rows),
        texts: rows.texts().to_vec(),
        attractors,
    })
}

/// Returns the manifest of a diagram without its list of files, `bifurcation_columns.csv` and `bifurcation.csv`.
///
/// # Errors
/// [`OutputError`] if a result cannot be formatted.
pub fn diagram(
    scene: &Scene,
    arguments: DiagramArguments<'_>,
    columns: &[Column],
    elapsed: Duration,
) -> Result<(String, String, String), OutputError> {
    let (axis, names) = (&*scene.axes()[0].parameter().name, scene.base().state_names());
    let numbers = Number::of(scene.base(), &scene.outputs().quantities);
    let gaps = several_gaps(scene.base());
    let manifest = bifurcation(scene, arguments, columns, [elapsed, Duration::ZERO], &[]);
    let of_columns = text(|to| bifurcation_tables::write_columns(to, axis, &numbers, columns))?;
    let of_points = text(|to| bifurcation_tables::write_points(to, axis, &names, gaps.as_deref(), columns))?;
    Ok((manifest.to_string(), of_columns, of_points))
}

/// Returns `curves.csv`, `curve_points.csv` and `unexplained.csv` of the curves of a map.
///
/// # Errors
/// [`OutputError`] if a result cannot be formatted.
pub fn curves(scene: &Scene, found: &Curves) -> Result<[String; 3], OutputError> {
    let axes = [0, 1].map(|i| &*scene.axes()[i].parameter().name);
    let states = scene.base().state_names();
    Ok([
        text(|to| curve_tables::write_curves(to, axes, &states, found))?,
        text(|to| curve_tables::write_meetings(to, axes, &states, found))?,
        text(|to| curve_tables::write_unexplained(to, axes, found))?,
    ])
}

/// Returns `trajectory.csv` of an orbit, with this number of samples per forcing period. It has no rows if the motion failed.
///
/// # Errors
/// [`OutputError`] if the model is not valid.
pub fn trajectory(
    model: &dyn Model,
    orbit: &Orbit,
    samples_per_period: usize,
) -> Result<String, OutputError> {
    let moments = match orbit.class {
        Class::Failed => Vec::new(),
        _ => moments(model, orbit, samples_per_period)?,
    };
    text(|to| orbit_tables::write_trajectory(to, model, &moments))
}

/// Returns `trajectory.csv` of a motion from the start.
///
/// # Errors
/// [`OutputError`] if the model is not valid.
pub fn history(model: &dyn Model, history: &History) -> Result<String, OutputError> {
    let moments = orbit_tables::moments(model, history)?;
    text(|to| orbit_tables::write_trajectory(to, model, &moments))
}

/// Returns `spectrum.csv` of an orbit; none if the motion cannot be followed for the required time.
///
/// # Errors
/// [`OutputError`] if the model is not valid.
pub fn spectrum(model: &dyn Model, orbit: &Orbit) -> Result<Option<String>, OutputError> {
    let spectrum = Spectrum::of(model, orbit)?;
    spectrum.map(|spectrum| text(|to| orbit_tables::write_spectrum(to, model, &spectrum))).transpose()
}

/// Returns a comparison as JSON, without a folder and its files, and its table `compare.csv`.
///
/// # Errors
/// [`OutputError`] if the table cannot be formatted.
pub fn comparison(pair: &MapPair<'_>) -> Result<(String, String), OutputError> {
    Ok((compare::result(pair).to_string(), text(|to| compare_csv::write(to, pair))?))
}

/// Returns a table as text.
fn text(write: impl FnOnce(&mut Vec<u8>) -> Result<(), WriteError>) -> Result<String, OutputError> {
    let mut bytes = Vec::new();
    let written = write(&mut bytes).map(|()| String::from_utf8_lossy(&bytes).into_owned());
    written.map_err(|reason| OutputError::Write { path: "memory".into(), reason })
}
