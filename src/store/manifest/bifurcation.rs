//! `manifest.json` of a bifurcation diagram: everything that its folder can be made from.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use crate::findings::hysteresis::{self, Hysteresis};
use crate::map::bifurcation::Column;
use crate::map::plan::count_classes;
use crate::map::scene::{Along, Scene};
use crate::show::names;
use crate::show::parameters::Parameters;
use crate::store::inventory::FileEntry;
use crate::store::manifest::{
    AxisObject, DerivedObject, Head, ModelObject, StartObject, TimingsObject, derived, start,
};

/// Arguments of the command, apart from its scene.
#[derive(Clone, Copy, Debug)]
pub struct DiagramArguments<'a> {
    /// The `--set` arguments.
    pub sets: &'a [String],
    /// The line through a scene of several axes.
    pub along: Option<&'a Along>,
}

/// The manifest of a diagram. It contains neither paths nor names of machines.
#[derive(Serialize)]
pub(crate) struct BifurcationManifest<'a> {
    #[serde(flatten)]
    head: Head,
    engine: &'static str,
    title: &'a str,
    scene: &'a str,
    set: &'a [String],
    /// Arguments of a line through a plane: the swept axis and the value of the other one.
    #[serde(skip_serializing_if = "Option::is_none")]
    along: Option<&'a str>,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    at: &'a [String],
    model: ModelObject,
    axis: AxisObject,
    parameters: Parameters,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    derived: BTreeMap<String, DerivedObject>,
    start: StartObject,
    integration: IntegrationObject,
    /// Number of columns by class; those of two passes are added.
    classes: BTreeMap<&'static str, usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    hysteresis: Option<HysteresisObject>,
    elapsed_seconds: f64,
    timings: TimingsObject,
    files: &'a [FileEntry],
}

/// Values at which class or period depend on the direction of the sweep.
#[derive(Serialize)]
struct HysteresisObject {
    columns: usize,
    differing: usize,
    /// First and last value of each group of neighbours.
    ranges: Vec<[f64; 2]>,
    /// Number of values at which only patterns differ.
    by_pattern: usize,
    pattern_ranges: Vec<[f64; 2]>,
}

impl From<Hysteresis> for HysteresisObject {
    fn from(found: Hysteresis) -> Self {
        let Hysteresis { columns, differing, ranges, by_pattern, pattern_ranges } = found;
        HysteresisObject { columns, differing, ranges, by_pattern, pattern_ranges }
    }
}

#[derive(Serialize)]
struct IntegrationObject {
    transient_periods: u32,
    observed_periods: u32,
    max_period: u32,
}

impl<'a> BifurcationManifest<'a> {
    /// Returns the manifest of a diagram that was computed in `elapsed` and written in `writing`.
    pub(crate) fn new(
        scene: &'a Scene,
        arguments: DiagramArguments<'a>,
        columns: &[Column],
        [elapsed, writing]: [Duration; 2],
        files: &'a [FileEntry],
    ) -> BifurcationManifest<'a> {
        let axis = &scene.axes()[0];
        let settings = scene.orbit_settings();
        let classes = count_classes(columns.iter().map(|column| column.class));
        BifurcationManifest {
            head: Head::of("bifurcation"),
            engine: "reference f64",
            title: scene.title(),
            scene: scene.text(),
            set: arguments.sets,
            along: arguments.along.map(|along| along.parameter.as_str()),
            at: arguments.along.map_or(&[], |along| &along.at),
            model: ModelObject::of(scene.base()),
            axis: axis.into(),
            parameters: Parameters::of_scene(scene),
            derived: derived(scene),
            start: start(scene),
            integration: IntegrationObject {
                transient_periods: settings.transient_periods,
                observed_periods: settings.observed_periods,
                max_period: settings.max_period,
            },
            classes: names::CLASSES.into_iter().zip(classes).collect(),
            hysteresis: hysteresis::hysteresis(columns).map(HysteresisObject::from),
            elapsed_seconds: elapsed.as_secs_f64(),
            timings: TimingsObject { integrate: elapsed.as_secs_f64(), write: writing.as_secs_f64() },
            files,
        }
    }
}
