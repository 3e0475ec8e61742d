//! `manifest.json` of a bifurcation diagram: everything needed to make its folder again.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use crate::findings::hysteresis::{self, Hysteresis};
use crate::map::bifurcation::Column;
use crate::map::plan::count_classes;
use crate::map::scene::Scene;
use crate::show::parameters::Parameters;
use crate::store::bifurcation::Asked;
use crate::store::inventory::FileEntry;
use crate::store::manifest::{
    AxisObject, DerivedObject, Head, ModelObject, StartObject, TimingsObject, derived, start,
};
use rattlemap_dynamics::orbit::Class;

/// It names neither the machine nor where on it the run took place.
#[derive(Serialize)]
pub(crate) struct Manifest<'a> {
    #[serde(flatten)]
    head: Head,
    engine: &'static str,
    title: &'a str,
    scene: &'a str,
    set: &'a [String],
    /// Of a line of a plane: the swept axis and where the other one stays, as the arguments say it.
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
    /// Columns by class, of both passes together where there are two.
    classes: BTreeMap<&'static str, usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    hysteresis: Option<HysteresisObject>,
    elapsed_seconds: f64,
    timings: TimingsObject,
    files: &'a [FileEntry],
}

/// Values at which class or period depend on the direction.
#[derive(Serialize)]
struct HysteresisObject {
    columns: usize,
    differing: usize,
    /// First and last value of each run of neighbours.
    ranges: Vec<[f64; 2]>,
    /// Values at which patterns alone differ.
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

impl<'a> Manifest<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        asked: Asked<'a>,
        columns: &[Column],
        [elapsed, writing]: [Duration; 2],
        files: &'a [FileEntry],
    ) -> Manifest<'a> {
        let axis = &scene.axes()[0];
        let settings = scene.orbit_settings();
        let classes = count_classes(columns.iter().map(|column| column.class));
        Manifest {
            head: Head::of("bifurcation"),
            engine: "reference f64",
            title: scene.title(),
            scene: scene.text(),
            set: asked.sets,
            along: asked.along.map(|along| along.parameter.as_str()),
            at: asked.along.map_or(&[], |along| &along.at),
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
            classes: Class::NAMES.into_iter().zip(classes).collect(),
            hysteresis: hysteresis::hysteresis(columns).map(HysteresisObject::from),
            elapsed_seconds: elapsed.as_secs_f64(),
            timings: TimingsObject { integrate: elapsed.as_secs_f64(), write: writing.as_secs_f64() },
            files,
        }
    }
}
