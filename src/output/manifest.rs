//! `manifest.json`: everything needed to make a folder again.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use super::names;
use super::orbit_json::Parameters;
use crate::bifurcation::Column;
use crate::model::State;
use crate::scene::{Axis, Scene, Start};

/// Raised whenever a field changes its meaning.
pub(super) const FORMAT: u32 = 1;

#[derive(Serialize)]
struct Manifest<'a> {
    format: u32,
    command: &'static str,
    crate_version: &'static str,
    commit: &'static str,
    engine: &'static str,
    title: &'a str,
    scene: &'a str,
    set: &'a [String],
    axis: AxisObject,
    parameters: Parameters<'a>,
    start: StartObject,
    integration: IntegrationObject,
    classes: BTreeMap<&'static str, usize>,
    elapsed_seconds: f64,
    files: &'a [&'static str],
}

#[derive(Serialize)]
pub(super) struct AxisObject {
    parameter: &'static str,
    min: f64,
    max: f64,
    count: usize,
}

impl From<&Axis> for AxisObject {
    fn from(axis: &Axis) -> Self {
        AxisObject { parameter: axis.parameter().name, min: axis.min(), max: axis.max(), count: axis.count() }
    }
}

#[derive(Serialize)]
pub(super) struct StartObject {
    policy: &'static str,
    state: Option<State>,
    #[serde(skip_serializing_if = "Option::is_none")]
    count: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u32>,
}

#[derive(Serialize)]
struct IntegrationObject {
    transient_periods: u32,
    observed_periods: u32,
    max_period: u32,
}

/// The manifest of a bifurcation diagram as JSON. It names neither the machine nor where on
/// it the run took place.
///
/// # Errors
/// None that a run can cause; serialisation is fallible by signature.
pub(super) fn bifurcation(
    scene: &Scene,
    sets: &[String],
    columns: &[Column],
    elapsed: Duration,
    files: &[&'static str],
) -> serde_json::Result<String> {
    let axis = &scene.axes()[0];
    let settings = scene.orbit_settings();
    serde_json::to_string_pretty(&Manifest {
        format: FORMAT,
        command: "bifurcation",
        crate_version: env!("CARGO_PKG_VERSION"),
        commit: env!("RATTLEMAP_COMMIT"),
        engine: "reference f64",
        title: scene.title(),
        scene: scene.text(),
        set: sets,
        axis: axis.into(),
        parameters: Parameters { pair: &scene.base(), except: &[axis.parameter().name] },
        start: start(scene),
        integration: IntegrationObject {
            transient_periods: settings.transient_periods,
            observed_periods: settings.observed_periods,
            max_period: settings.max_period,
        },
        classes: count(columns),
        elapsed_seconds: elapsed.as_secs_f64(),
        files,
    })
}

pub(super) fn start(scene: &Scene) -> StartObject {
    let (policy, state) = match scene.start() {
        Start::Rest => ("rest", None),
        Start::State(state) => ("state", Some(state)),
        Start::Up => ("up", None),
        Start::Down => ("down", None),
    };
    let (count, seed) = scene.draw().map(|draw| (draw.count, draw.seed)).unzip();
    StartObject { policy, state, count, seed }
}

fn count(columns: &[Column]) -> BTreeMap<&'static str, usize> {
    let mut counts: BTreeMap<_, _> = names::CLASSES.iter().map(|&name| (name, 0)).collect();
    for column in columns {
        *counts.entry(names::class(column.class)).or_default() += 1;
    }
    counts
}
