//! The folder of a bifurcation diagram: table, figure and manifest.

use std::time::{Duration, Instant};

use super::bifurcation_manifest::Manifest;
use super::manifest::MANIFEST;
use super::symbols::axis_label;
use super::{Folder, OutputError, bifurcation_csv, bifurcation_figure, caption, inventory};
use crate::map::bifurcation::Column;
use crate::map::scene::{Format, Scene};

const CSV: &str = "bifurcation.csv";
/// The figure, by format.
const FIGURES: [(Format, &str); 3] =
    [(Format::Png, "bifurcation.png"), (Format::Svg, "bifurcation.svg"), (Format::Pdf, "bifurcation.pdf")];

/// Every file that a bifurcation diagram may write.
pub const NAMES: [&str; 5] = [MANIFEST, CSV, FIGURES[0].1, FIGURES[1].1, FIGURES[2].1];

/// Writes the files that the scene asks for, and the manifest last: a folder that has one
/// is complete. Returns the files' names.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    scene: &Scene,
    sets: &[String],
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
        files.push(CSV);
    }
    for (_, name) in FIGURES.into_iter().filter(|(format, _)| wanted.contains(format)) {
        let label = axis_label(parameter);
        let subtitle = format!("{}; {}", scene.start().in_words(), caption::of_scene(scene));
        folder.replace(name, |path| {
            Ok(bifurcation_figure::write(path, [scene.title(), &subtitle], &label, columns)?)
        })?;
        files.push(name);
    }
    let listed = inventory::entries(folder, &files)?;
    let times = [elapsed, clock.elapsed()];
    inventory::write_manifest(folder, &Manifest::new(scene, sets, columns, times, &listed))?;
    files.push(MANIFEST);
    Ok(files)
}
