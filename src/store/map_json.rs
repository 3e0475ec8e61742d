//! The object that `map --json` prints. Scripts depend on its fields.

use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};

use crate::show::cells::Cells;
use crate::show::refinement;
use crate::store::manifest::map::{Run, counts, described_engine};
use crate::store::manifest::{joined, without_nulls};

/// Describes a map whose files were written to a folder in `writing`. `folder` is the path that the user named; `seconds`
/// are those of this run.
pub fn object(folder: &Path, files: &[String], cells: &Cells<'_>, run: &Run<'_>, writing: Duration) -> Value {
    joined([
        json!({ "folder": folder.to_string_lossy(), "files": files }),
        described_engine(run),
        without_nulls(json!({ "shards": run.shards.map(|shards| shards.count) })),
        json!({ "cells": cells.count(), "runs": cells.runs() }),
        counts(cells),
        json!({
            "refinement": refinement::object(cells),
            "periods": cells.periods(),
            "without_effect": run.without_effect,
            "resumed": resumed(run),
            "seconds": {
                "open": run.opening.as_secs_f64(),
                "integrate": run.elapsed.as_secs_f64(),
                "write": writing.as_secs_f64(),
            },
        }),
    ])
}

/// Describes the records and the time of earlier runs.
pub(crate) fn resumed(run: &Run<'_>) -> Value {
    json!({ "runs": run.resumed_cells, "seconds": run.elapsed_before.as_secs_f64() })
}
