//! The folder of a bifurcation diagram: tables, figure and manifest.

use std::sync::LazyLock;
use std::time::{Duration, Instant};

use crate::map::bifurcation::{Column, fixed};
use crate::map::branches::Branches;
use crate::map::scene::{Along, Format, Scene};
use crate::model_file::several_gaps;
use crate::show::drawing::write_figure;
use crate::show::figure;
use crate::show::figure::bifurcation::Panels;
use crate::show::numbers::Number;
use crate::show::symbols::{axis_label, symbol};
use crate::show::table::{bifurcation_tables, branch_tables};
use crate::show::{caption, names};
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory;
use crate::store::manifest::MANIFEST;
pub use crate::store::manifest::bifurcation::DiagramArguments;
use crate::store::manifest::bifurcation::bifurcation;

const POINTS: &str = "bifurcation.csv";
const COLUMNS_CSV: &str = "bifurcation_columns.csv";
/// Strobe states, for models with walls that fix a displacement.
const STROBE_CSV: &str = "bifurcation_strobe.csv";
/// Tables of branches.
const BRANCHES_CSV: &str = "branches.csv";
const SPECIAL_POINTS_CSV: &str = "special_points.csv";
/// Names of the figures, by format.
static FIGURES: LazyLock<Vec<[(Format, String); 3]>> = LazyLock::new(|| {
    let numbered = (2..=MOST_FIGURES).map(|number| names::figures(&format!("bifurcation_{number}")));
    std::iter::once(names::figures("bifurcation")).chain(numbered).collect()
});
/// More than the panels that a model with all quantities has.
const MOST_FIGURES: usize = 256;

/// Names of all files that a bifurcation diagram may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    [MANIFEST, POINTS, COLUMNS_CSV, STROBE_CSV, BRANCHES_CSV, SPECIAL_POINTS_CSV]
        .into_iter()
        .chain(FIGURES.iter().flatten().map(|(_, name)| name.as_str()))
}

/// Writes the files that the scene asks for, and the manifest last. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    scene: &Scene,
    arguments: DiagramArguments<'_>,
    (columns, branches): (&[Column], Option<&Branches>),
    elapsed: Duration,
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Instant::now();
    // The manifest does not list files of an earlier run.
    inventory::clear_for(folder, names())?;
    let parameter = scene.axes()[0].parameter();
    let wanted = &scene.outputs().files;
    let mut files = Vec::new();
    let numbers = Number::of(scene.base(), &scene.outputs().quantities);
    let (names, fixed) = (scene.base().state_names(), fixed(&scene.line()));
    if wanted.contains(&Format::Csv) {
        let axis = &parameter.name;
        let gaps = several_gaps(scene.base());
        folder.replace(POINTS, |out| {
            bifurcation_tables::write_points(out, axis, &names, gaps.as_deref(), columns)
        })?;
        folder.replace(COLUMNS_CSV, |out| bifurcation_tables::write_columns(out, axis, &numbers, columns))?;
        files.extend([POINTS, COLUMNS_CSV]);
        if fixed.is_some() {
            folder
                .replace(STROBE_CSV, |out| bifurcation_tables::write_strobes(out, axis, &names, columns))?;
            files.push(STROBE_CSV);
        }
        if let Some(branches) = branches {
            folder.replace(BRANCHES_CSV, |out| {
                branch_tables::write_branches(out, axis, &names, &numbers, branches)
            })?;
            folder.replace(SPECIAL_POINTS_CSV, |out| {
                branch_tables::write_special_points(out, axis, &names, &numbers, branches)
            })?;
            files.extend([BRANCHES_CSV, SPECIAL_POINTS_CSV]);
        }
    }
    let panels = Panels::of(scene.base(), fixed, &numbers);
    for (panels, names) in panels.figures(scene.figure_style(), scene.diagram_style()).iter().zip(&*FIGURES) {
        let label = axis_label(parameter);
        let title = format!("{}{}", scene.title(), line(arguments.along));
        let subtitle = format!("{}; {}", scene.start().in_words(), caption::of_scene(scene));
        let (texts, axis) = ([&*title, &*subtitle], (&*label, scene.axes()[0].scale()));
        let figure =
            figure::bifurcation::draw(scene.figure_style(), texts, axis, panels, (columns, branches));
        for (format, name) in names.iter().filter(|(format, _)| wanted.contains(format)) {
            folder.replace(name, |out| write_figure(out, *format, &figure))?;
            files.push(name);
        }
    }
    let listed = inventory::entries(folder, &files)?;
    let times = [elapsed, clock.elapsed()];
    inventory::write_manifest(folder, &bifurcation(scene, arguments, columns, times, &listed))?;
    files.push(MANIFEST);
    Ok(files)
}

/// Describes a line through a plane, to complete a title that describes the plane.
fn line(along: Option<&Along>) -> String {
    let Some(Along { parameter, at }) = along.filter(|along| !along.at.is_empty()) else {
        return String::new();
    };
    let at: Vec<String> = at
        .iter()
        .filter_map(|at| at.split_once('='))
        .map(|(name, value)| format!("{} = {}", symbol(name.trim()), value.trim()))
        .collect();
    format!(", along {} at {}", symbol(parameter), at.join(", "))
}
