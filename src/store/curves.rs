//! The folder of the curves of a map: tables, figure and manifest.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::map::curves::{Curves, Kind};
use crate::map::scene::Format;
use crate::show::cells::Cells;
use crate::show::drawing::write_figure;
use crate::show::layers::Layer;
use crate::show::table::curve_tables;
use crate::show::{figure, names, report};
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory;
use crate::store::manifest::{Head, MANIFEST, joined};
use crate::store::map::REPORT;

const CURVES: &str = "curves.csv";
const POINTS: &str = "curve_points.csv";
const UNEXPLAINED: &str = "unexplained.csv";
/// What a search has found that is not finished.
const SEARCH: &str = "search.json";
/// Names of the figure, by format.
static FIGURES: LazyLock<[(Format, String); 3]> = LazyLock::new(|| names::figures("curves"));

/// Names of all files that the command may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    [MANIFEST, CURVES, POINTS, UNEXPLAINED, SEARCH, REPORT]
        .into_iter()
        .chain(FIGURES.iter().map(|(_, name)| name.as_str()))
}

/// Stores what a search has found so far. `of`: what is searched, and in which map.
///
/// # Errors
/// If the file cannot be written.
pub fn save(folder: &Folder, of: &Value, found: &Curves) -> Result<(), OutputError> {
    folder.replace(SEARCH, |out| Ok(serde_json::to_writer(out, &json!({ "search": of, "found": found }))?))
}

/// Removes what a finished search has stored.
///
/// # Errors
/// If the file cannot be removed.
pub fn forget(folder: &Folder) -> Result<(), OutputError> {
    folder.remove(&[SEARCH])
}

/// Returns what an interrupted search has found; none if the folder has no such search.
pub fn saved(folder: &Path, of: &Value) -> Option<Curves> {
    let mut saved: Value = serde_json::from_slice(&std::fs::read(folder.join(SEARCH)).ok()?).ok()?;
    let is_same = saved["search"] == *of;
    is_same.then(|| serde_json::from_value(saved["found"].take()).ok())?
}

/// Writes the tables, the figure in these formats, the page with these data, and the manifest last. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    (cells, layers): (&Cells<'_>, &[Layer]),
    (found, page): (&Curves, &Value),
    formats: &[Format],
    elapsed: Duration,
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Instant::now();
    // An interrupted search keeps what it has stored.
    inventory::clear_for(folder, names().filter(|name| *name != SEARCH))?;
    let scene = cells.scene();
    let axes = [0, 1].map(|i| &*scene.axes()[i].parameter().name);
    let states = scene.base().state_names();
    folder.replace(CURVES, |out| curve_tables::write_curves(out, axes, &states, found))?;
    folder.replace(POINTS, |out| curve_tables::write_meetings(out, axes, &states, found))?;
    folder.replace(UNEXPLAINED, |out| curve_tables::write_unexplained(out, axes, found))?;
    let mut files = vec![CURVES, POINTS, UNEXPLAINED];
    for (format, name) in FIGURES.iter().filter(|(format, _)| formats.contains(format)) {
        let drawn = figure::map::draw_with(cells, layers, &layers[0], Some(found));
        folder.replace(name, |out| write_figure(out, *format, &drawn))?;
        files.push(name);
    }
    folder.replace(REPORT, |out| report::write(out, page))?;
    files.push(REPORT);
    let listed = inventory::entries(folder, &files)?;
    let mut kinds = BTreeMap::new();
    for curve in &found.curves {
        *kinds.entry(curve.kind.name()).or_insert(0) += 1;
    }
    let ends: Vec<_> = found.curves.iter().map(|curve| &curve.ends).collect();
    let failures: Vec<_> = found
        .failures
        .iter()
        .map(|(kind, place, reason)| json!({ "kind": kind.name(), "at": place, "reason": reason }))
        .collect();
    let manifest = joined([
        json!(Head::of("curves")),
        json!({
            "title": scene.title(),
            "scene": scene.text(),
            "axes": axes,
            "kinds": Kind::ALL.map(Kind::name),
            "curves": kinds,
            "ends": ends,
            "failures": failures,
            // Null if only some curves were searched.
            "pairs": found.pairs.map(|pairs| json!({
                "explained": pairs.explained,
                "basins": pairs.basins,
                "unexplained": pairs.unexplained,
            })),
            "timings": { "find": elapsed.as_secs_f64(), "write": clock.elapsed().as_secs_f64() },
            "files": listed,
        }),
    ]);
    inventory::write_manifest(folder, &manifest)?;
    files.push(MANIFEST);
    Ok(files)
}
