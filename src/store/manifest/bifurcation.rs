//! `manifest.json` of a bifurcation diagram: everything that its folder can be made from.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};

use crate::findings::hysteresis::hysteresis;
use crate::map::bifurcation::Column;
use crate::map::plan::count_classes;
use crate::map::scene::{Along, Scene};
use crate::show::parameters::Parameters;
use crate::store::inventory::FileEntry;
use crate::store::manifest::{self, Head, joined, without_nulls};
use rattlemap_dynamics::orbit::Class;

/// Arguments of the command, apart from its scene.
#[derive(Clone, Copy, Debug)]
pub struct DiagramArguments<'a> {
    /// The `--set` arguments.
    pub sets: &'a [String],
    /// The line through a scene of several axes.
    pub along: Option<&'a Along>,
}

/// Returns the manifest of a diagram that was computed in `elapsed` and written in `writing`. It contains neither paths nor
/// names of machines.
pub(crate) fn bifurcation(
    scene: &Scene,
    arguments: DiagramArguments<'_>,
    columns: &[Column],
    [elapsed, writing]: [Duration; 2],
    files: &[FileEntry],
) -> Value {
    let settings = scene.orbit_settings();
    let elapsed = elapsed.as_secs_f64();
    let (along, at) = (arguments.along.map(|along| &along.parameter), arguments.along.map(|along| &along.at));
    // The columns of two passes are added.
    let classes = Class::NAMES.into_iter().zip(count_classes(columns.iter().map(|column| column.class)));
    joined([
        json!(Head::of("bifurcation")),
        json!({
            "engine": "reference f64",
            "title": scene.title(),
            "scene": scene.text(),
            "set": arguments.sets,
        }),
        without_nulls(json!({ "along": along, "at": at.filter(|at| !at.is_empty()) })),
        json!({
            "model": manifest::model(scene.base()),
            "axis": manifest::axis(&scene.axes()[0]),
            "parameters": Parameters::of_scene(scene),
        }),
        without_nulls(json!({ "derived": manifest::derived(scene), "measured": manifest::measured(scene) })),
        json!({
            "start": manifest::start(scene),
            "integration": {
                "transient_periods": settings.transient_periods,
                "observed_periods": settings.observed_periods,
                "max_period": settings.max_period,
            },
            "classes": classes.collect::<BTreeMap<_, _>>(),
        }),
        without_nulls(json!({ "hysteresis": hysteresis(columns) })),
        json!({
            "elapsed_seconds": elapsed,
            "timings": { "integrate": elapsed, "write": writing.as_secs_f64() },
            "files": files,
        }),
    ])
}
