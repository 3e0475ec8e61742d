//! `map --json`: what a map came to, as one object; its fields are a contract.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use serde::Serialize;
use serde_json::Value;

use crate::map::plan::count_classes;
use crate::show::cells::Cells;
use crate::show::refinement;
use crate::store::error::OutputError;
use crate::store::map_manifest::{BasinObject, MadeObject, Run, basins, statuses, tally};
use rattlemap_dynamics::orbit::Class;

#[derive(Serialize)]
struct MapObject<'a> {
    /// As it was named.
    folder: String,
    files: &'a [String],
    #[serde(flatten)]
    made: MadeObject<'a>,
    /// Of so many it was merged.
    #[serde(skip_serializing_if = "Option::is_none")]
    shards: Option<u32>,
    cells: usize,
    /// One per cell and start.
    runs: usize,
    classes: BTreeMap<&'static str, usize>,
    statuses: BTreeMap<&'static str, usize>,
    /// Cells by the number of attractors that their starts found.
    #[serde(skip_serializing_if = "Option::is_none")]
    attractors: Option<BTreeMap<u8, usize>>,
    /// Attractors of a map of basins, by label.
    #[serde(skip_serializing_if = "Option::is_none")]
    basins: Option<Vec<BasinObject>>,
    refinement: Option<Value>,
    /// Forcing periods integrated.
    periods: u64,
    /// Swept parameters that changed nothing that was measured.
    without_effect: &'a [String],
    resumed: ResumedObject,
    seconds: SecondsObject,
}

/// What an earlier run had done; zero where there was none.
#[derive(Serialize)]
struct ResumedObject {
    runs: usize,
    seconds: f64,
}

/// Of this run alone.
#[derive(Serialize)]
struct SecondsObject {
    open: f64,
    integrate: f64,
    write: f64,
}

/// Prints to stdout what `run` has made of a map in a folder: `files` by name, written in so long.
///
/// # Errors
/// [`OutputError`] if stdout cannot be written, unless its reader has closed it.
pub fn print(
    folder: &Path,
    files: &[String],
    cells: &Cells<'_>,
    run: &Run<'_>,
    writing: Duration,
) -> Result<(), OutputError> {
    crate::store::stdout::print(&serde_json::to_string_pretty(&object(folder, files, cells, run, writing)?)?)
}

/// The same as an object.
pub(crate) fn object(
    folder: &Path,
    files: &[String],
    cells: &Cells<'_>,
    run: &Run<'_>,
    writing: Duration,
) -> Result<Value, OutputError> {
    let object = MapObject {
        folder: folder.to_string_lossy().into_owned(),
        files,
        made: MadeObject::of(run),
        shards: run.merged.map(|merged| merged.shards),
        cells: cells.count(),
        runs: cells.runs(),
        classes: Class::NAMES.into_iter().zip(count_classes(cells.classes())).collect(),
        statuses: statuses(cells),
        attractors: cells.attractors().map(tally),
        basins: basins(cells),
        refinement: cells.refinement().map(refinement::object),
        periods: cells.periods(),
        without_effect: &run.without_effect,
        resumed: ResumedObject { runs: run.resumed_cells, seconds: run.elapsed_before.as_secs_f64() },
        seconds: SecondsObject {
            open: run.opening.as_secs_f64(),
            integrate: run.elapsed.as_secs_f64(),
            write: writing.as_secs_f64(),
        },
    };
    Ok(serde_json::to_value(object)?)
}
