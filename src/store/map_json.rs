//! The object that `map --json` prints. Scripts depend on its fields.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use serde::Serialize;
use serde_json::Value;

use crate::map::plan::count_classes;
use crate::show::cells::Cells;
use crate::show::names;
use crate::store::error::OutputError;
use crate::store::manifest::map::{
    BasinObject, MadeObject, RefinementObject, ResumedObject, Run, attractor_counts, basins, statuses,
};

#[derive(Serialize)]
struct MapObject<'a> {
    /// The folder as the user named it.
    folder: String,
    files: &'a [String],
    #[serde(flatten)]
    made: MadeObject<'a>,
    /// Number of shards of a merged map.
    #[serde(skip_serializing_if = "Option::is_none")]
    shards: Option<u32>,
    cells: usize,
    /// Number of runs: one per cell and start.
    runs: usize,
    classes: BTreeMap<&'static str, usize>,
    statuses: BTreeMap<&'static str, usize>,
    /// Number of cells by the number of attractors that their starts reach.
    #[serde(skip_serializing_if = "Option::is_none")]
    attractors: Option<BTreeMap<u8, usize>>,
    /// Attractors of a map of basins, by label.
    #[serde(skip_serializing_if = "Option::is_none")]
    basins: Option<Vec<BasinObject>>,
    refinement: Option<RefinementObject>,
    /// Forcing periods integrated.
    periods: u64,
    /// Swept parameters that changed nothing that was measured.
    without_effect: &'a [String],
    resumed: ResumedObject,
    seconds: SecondsObject,
}

/// Seconds that each phase of this run took.
#[derive(Serialize)]
struct SecondsObject {
    open: f64,
    integrate: f64,
    write: f64,
}

/// Returns the object for a map whose files were written to a folder in `writing`.
///
/// # Errors
/// [`OutputError`] if a result cannot be put into JSON.
pub fn object(
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
        shards: run.shards.map(|shards| shards.count),
        cells: cells.counts().iter().product(),
        runs: cells.runs(),
        classes: names::CLASSES.into_iter().zip(count_classes(cells.classes())).collect(),
        statuses: statuses(cells),
        attractors: cells.attractors().map(attractor_counts),
        basins: basins(cells),
        refinement: cells.refinement().map(RefinementObject::from),
        periods: cells.periods(),
        without_effect: &run.without_effect,
        resumed: ResumedObject::of(run),
        seconds: SecondsObject {
            open: run.opening.as_secs_f64(),
            integrate: run.elapsed.as_secs_f64(),
            write: writing.as_secs_f64(),
        },
    };
    Ok(serde_json::to_value(object)?)
}
