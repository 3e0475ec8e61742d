//! What a finished folder tells, without a folder: for who computes in a process of his own.

use std::time::Duration;

use crate::map::bifurcation::Column;
use crate::map::scene::Scene;
use crate::show::cells::Cells;
use crate::show::error::WriteError;
pub use crate::show::layers::SharedColors;
use crate::show::table::cell_columns::{self, Values};
use crate::show::table::words_csv::WordRows;
use crate::show::table::{attractors_csv, bifurcation_tables};
use crate::show::{layers, words};
use crate::store::bifurcation::Asked;
use crate::store::bifurcation_manifest::Manifest;
use crate::store::error::OutputError;
use crate::store::map_manifest::{self, Run};

/// A map as its folder would have it.
#[derive(Clone, Debug)]
pub struct Map {
    /// `manifest.json`, less its files.
    pub manifest: String,
    /// The columns of `cells.npy`.
    pub columns: Vec<(String, Values)>,
    /// The texts of `words.csv`, by row.
    pub texts: Vec<String>,
    /// `attractors.csv` of a map of basins.
    pub attractors: Option<String>,
}

/// A finished map.
///
/// # Errors
/// [`OutputError`] if something cannot be put into its form.
pub fn map(cells: &Cells<'_>, run: &Run<'_>) -> Result<Map, OutputError> {
    let words = words::read(cells);
    let rows = WordRows::new(&words);
    let attractors =
        cells.basins().map(|basins| text(|to| attractors_csv::write(to, cells, basins))).transpose()?;
    Ok(Map {
        manifest: serde_json::to_string(&map_manifest::map(cells, run, Duration::ZERO, &[]))?,
        columns: cell_columns::read(cells, &rows),
        texts: rows.texts(),
        attractors,
    })
}

/// The colours of the program's figures.
pub fn colors() -> SharedColors {
    layers::shared_colors()
}

/// A bifurcation diagram as its folder would have it.
#[derive(Clone, Debug)]
pub struct Diagram {
    /// `manifest.json`, less its files.
    pub manifest: String,
    /// `bifurcation_columns.csv`.
    pub columns: String,
    /// The columns of `bifurcation.csv` but for class, period and status; rows without a point are left out. Kinds and
    /// directions are places in the next two.
    pub points: Vec<(String, Values)>,
    /// The names of kinds.
    pub kinds: Vec<&'static str>,
    /// The names of directions.
    pub directions: Vec<&'static str>,
}

/// A finished diagram.
///
/// # Errors
/// [`OutputError`] if something cannot be put into its form.
pub fn diagram(
    scene: &Scene,
    asked: Asked<'_>,
    columns: &[Column],
    elapsed: Duration,
) -> Result<Diagram, OutputError> {
    let (axis, names) = (&*scene.axes()[0].parameter().name, scene.base().state_names());
    let manifest = Manifest::new(scene, asked, columns, [elapsed, Duration::ZERO], &[]);
    let [kinds, directions] = bifurcation_tables::point_codes();
    Ok(Diagram {
        manifest: serde_json::to_string(&manifest)?,
        columns: text(|to| bifurcation_tables::write_columns(to, axis, columns))?,
        points: bifurcation_tables::points(axis, &names, columns),
        kinds,
        directions,
    })
}

/// A table as text.
fn text(write: impl FnOnce(&mut Vec<u8>) -> Result<(), WriteError>) -> Result<String, OutputError> {
    let mut bytes = Vec::new();
    let written = write(&mut bytes).map(|()| String::from_utf8_lossy(&bytes).into_owned());
    written.map_err(|reason| OutputError::Write { path: "memory".into(), reason })
}
