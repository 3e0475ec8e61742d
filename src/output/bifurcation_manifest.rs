//! `manifest.json` of a bifurcation diagram: everything needed to make its folder again.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use super::inventory::FileEntry;
use super::manifest::{AxisObject, DerivedObject, Head, StartObject, TimingsObject, derived, start};
use super::names;
use super::parameters::Parameters;
use crate::map::bifurcation::Column;
use crate::map::plan::count_classes;
use crate::map::scene::Scene;

/// It names neither the machine nor where on it the run took place.
#[derive(Serialize)]
pub(super) struct Manifest<'a> {
    #[serde(flatten)]
    head: Head,
    engine: &'static str,
    title: &'a str,
    scene: &'a str,
    set: &'a [String],
    axis: AxisObject,
    parameters: Parameters,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    derived: BTreeMap<String, DerivedObject>,
    start: StartObject,
    integration: IntegrationObject,
    classes: BTreeMap<&'static str, usize>,
    elapsed_seconds: f64,
    timings: TimingsObject,
    files: &'a [FileEntry],
}

#[derive(Serialize)]
struct IntegrationObject {
    transient_periods: u32,
    observed_periods: u32,
    max_period: u32,
}

impl<'a> Manifest<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        sets: &'a [String],
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
            set: sets,
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
            elapsed_seconds: elapsed.as_secs_f64(),
            timings: TimingsObject { integrate: elapsed.as_secs_f64(), write: writing.as_secs_f64() },
            files,
        }
    }
}
