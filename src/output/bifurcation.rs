//! The folder of a bifurcation diagram: tables, figure and manifest.

use std::time::{Duration, Instant};

use super::bifurcation_manifest::Manifest;
use super::manifest::MANIFEST;
use super::{Folder, OutputError, bifurcation_columns_csv, bifurcation_csv, bifurcation_figure, inventory};
use crate::map::bifurcation::Column;
use crate::map::scene::{Along, Format, Scene};

const CSV: &str = "bifurcation.csv";
const COLUMNS_CSV: &str = "bifurcation_columns.csv";
const PNG: &str = "bifurcation.png";

/// Every file that a bifurcation diagram may write.
pub const NAMES: [&str; 4] = [MANIFEST, CSV, COLUMNS_CSV, PNG];

/// How a diagram was asked for, beside its scene.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The `--set` arguments.
    pub sets: &'a [String],
    /// The line of a scene of several axes.
    pub along: Option<&'a Along>,
}

/// Writes the files that the scene asks for, and the manifest last: a folder that has one
/// is complete. Returns the files' names.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    scene: &Scene,
    asked: Asked<'_>,
    columns: &[Column],
    elapsed: Duration,
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Instant::now();
    // Files of an earlier run must not stand beside a manifest that does not know them.
    folder.remove(&NAMES)?;
    let parameter = scene.axes()[0].parameter();
    let wanted = &scene.outputs().files;
    let mut files = Vec::new();
    if wanted.contains(&Format::Csv) {
        folder.replace(CSV, |path| {
            bifurcation_csv::write(path, &parameter.name, &scene.base().state_names(), columns)
        })?;
        folder.replace(COLUMNS_CSV, |path| bifurcation_columns_csv::write(path, &parameter.name, columns))?;
        files.extend([CSV, COLUMNS_CSV]);
    }
    if wanted.contains(&Format::Png) {
        let label = format!("{} {}", parameter.meaning, parameter.name);
        let title = format!("{}, {}", title(scene, asked.along), scene.start().in_words());
        folder.replace(PNG, |path| Ok(bifurcation_figure::write(path, &title, &label, columns)?))?;
        files.push(PNG);
    }
    let listed = inventory::entries(folder, &files)?;
    let times = [elapsed, clock.elapsed()];
    inventory::write_manifest(folder, &Manifest::new(scene, asked, columns, times, &listed))?;
    files.push(MANIFEST);
    Ok(files)
}

/// The scene's title, and of a line of a plane which one it is: the title is that of a map.
fn title(scene: &Scene, along: Option<&Along>) -> String {
    let Some(Along { parameter, at }) = along.filter(|along| !along.at.is_empty()) else {
        return scene.title().to_owned();
    };
    let at = at.iter().map(|at| at.replacen('=', " = ", 1)).collect::<Vec<_>>().join(", ");
    format!("{}: {parameter} at {at}", scene.title())
}
