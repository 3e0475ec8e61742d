//! `manifest.json`: the parts that the manifests of all commands share.

pub mod bifurcation;
pub mod map;

use std::collections::BTreeMap;

use serde::Serialize;

use crate::map::scene::{Axis, Scale, Scene, Start};
use crate::model_file::FileModel;
use rattlemap_dynamics::model::Model;

pub use crate::store::file_names::MANIFEST;

/// Version of the manifest. It is raised when a field changes its meaning.
pub const FORMAT: u32 = 2;

/// First fields of a manifest: its format, the command, and the program that wrote it.
#[derive(Serialize)]
pub struct Head {
    format: u32,
    command: &'static str,
    crate_version: &'static str,
    /// Commit of the program; `unknown` if it was built outside of its repository or without release settings.
    commit: &'static str,
}

impl Head {
    /// Returns the first fields of a manifest that `command` writes.
    pub fn of(command: &'static str) -> Head {
        Head {
            format: FORMAT,
            command,
            crate_version: env!("CARGO_PKG_VERSION"),
            commit: env!("RATTLEMAP_COMMIT"),
        }
    }
}

/// The model. Its text makes the folder independent of the model's file.
#[derive(Serialize)]
pub(crate) struct ModelObject {
    name: String,
    title: String,
    source: Option<String>,
    /// Text of the model's file; null for a model in code.
    text: Option<String>,
}

impl ModelObject {
    pub(crate) fn of(model: &dyn Model) -> ModelObject {
        ModelObject {
            name: model.name().to_owned(),
            title: model.title().to_owned(),
            source: model.source().map(str::to_owned),
            text: model.downcast_ref().map(|file: &FileModel| file.definition().text.clone()),
        }
    }
}

/// An axis.
#[derive(Serialize)]
pub(crate) struct AxisObject {
    /// Name of the swept parameter, and of its column in tables.
    parameter: String,
    /// Whether the axis sweeps a component of the initial state.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    is_start: bool,
    min: f64,
    max: f64,
    count: usize,
    /// `linear`, `log` or `values`.
    scale: &'static str,
    /// The values, if the scene lists them.
    #[serde(skip_serializing_if = "Option::is_none")]
    values: Option<Vec<f64>>,
}

impl From<&Axis> for AxisObject {
    fn from(axis: &Axis) -> Self {
        AxisObject {
            parameter: axis.parameter().name.to_string(),
            is_start: axis.target().is_start(),
            min: axis.min(),
            max: axis.max(),
            count: axis.count(),
            scale: axis.scale().name(),
            values: (axis.scale() == Scale::Values).then(|| axis.values().collect()),
        }
    }
}

/// A parameter that is computed from others.
#[derive(Serialize)]
pub(crate) struct DerivedObject {
    expression: String,
    /// Smallest and largest value over all cells.
    min: f64,
    max: f64,
}

/// Returns the derived parameters of a scene, by name.
pub(crate) fn derived(scene: &Scene) -> BTreeMap<String, DerivedObject> {
    let points = scene.points();
    let rules = points.derived().rules();
    let mut objects: Vec<DerivedObject> = rules
        .iter()
        .map(|rule| {
            let expression = rule.text().to_owned();
            DerivedObject { expression, min: f64::INFINITY, max: f64::NEG_INFINITY }
        })
        .collect();
    let [columns, rows] = points.counts();
    // Without derived parameters no cell needs a look.
    for cell in (0..columns * rows).take(if rules.is_empty() { 0 } else { usize::MAX }) {
        let model = points.model(cell);
        for (rule, object) in rules.iter().zip(&mut objects) {
            let value = model.value(rule.index());
            (object.min, object.max) = (object.min.min(value), object.max.max(value));
        }
    }
    rules.iter().map(|rule| rule.parameter().name.to_string()).zip(objects).collect()
}

/// The initial states.
#[derive(Serialize)]
pub(crate) struct StartObject {
    policy: &'static str,
    state: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    count: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u32>,
}

/// Returns the initial states of a scene.
pub(crate) fn start(scene: &Scene) -> StartObject {
    let (policy, state) = match scene.start() {
        Start::Rest => ("rest", None),
        Start::State(state) => ("state", Some(state[..scene.base().state_names().len()].to_vec())),
        Start::Up => ("up", None),
        Start::Down => ("down", None),
        Start::Both => ("both", None),
    };
    let (count, seed) = scene.draw().map(|draw| (draw.count, draw.seed)).unzip();
    StartObject { policy, state, count, seed }
}

/// Seconds that each phase took.
#[derive(Serialize)]
pub(crate) struct TimingsObject {
    pub(crate) integrate: f64,
    pub(crate) write: f64,
}
