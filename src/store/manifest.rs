//! `manifest.json`: what those of all commands have in common.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::map::scene::{Axis, Scale, Scene, Start};
use crate::model_file::FileModel;
use rattlemap_dynamics::model::Model;

/// The manifest's name. It is the last file that a run writes: a folder that has one is complete.
pub const MANIFEST: &str = "manifest.json";

/// Raised whenever a field changes its meaning.
/// 2: `files` are objects of name, size and hash.
pub const FORMAT: u32 = 2;

/// What a run's JSON begins with: what it is, and which program wrote it.
#[derive(Serialize)]
pub struct Head {
    format: u32,
    command: &'static str,
    crate_version: &'static str,
    /// Commit that the program was built from, with `-modified` added if its sources had changed; `unknown` in
    /// development builds.
    commit: &'static str,
}

impl Head {
    /// The head of what `command` writes.
    pub fn of(command: &'static str) -> Head {
        Head {
            format: FORMAT,
            command,
            crate_version: env!("CARGO_PKG_VERSION"),
            commit: env!("RATTLEMAP_COMMIT"),
        }
    }
}

/// What moves. With its text a folder is enough to make its files again.
#[derive(Serialize)]
pub(crate) struct ModelObject {
    name: String,
    title: String,
    source: Option<String>,
    /// The model's file; null where the model is none.
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

#[derive(Serialize)]
pub(crate) struct AxisObject {
    /// Its name, and that of the columns in tables.
    parameter: String,
    /// What it sweeps is a component of the start.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    is_start: bool,
    min: f64,
    max: f64,
    count: usize,
    /// linear, log or values.
    scale: &'static str,
    /// Where they are listed.
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

/// A parameter that follows others.
#[derive(Serialize)]
pub(crate) struct DerivedObject {
    expression: String,
    /// Its least and its greatest value over all cells.
    min: f64,
    max: f64,
}

/// The derived parameters of a scene, by name.
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
    // A scene without any has no cell looked at.
    for cell in (0..columns * rows).take(if rules.is_empty() { 0 } else { usize::MAX }) {
        let model = points.model(cell);
        for (rule, object) in rules.iter().zip(&mut objects) {
            let value = model.value(rule.index());
            (object.min, object.max) = (object.min.min(value), object.max.max(value));
        }
    }
    rules.iter().map(|rule| rule.parameter().name.to_string()).zip(objects).collect()
}

#[derive(Serialize)]
pub(crate) struct StartObject {
    policy: &'static str,
    state: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    count: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u32>,
}

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

/// Seconds by phase.
#[derive(Serialize)]
pub(crate) struct TimingsObject {
    pub(crate) integrate: f64,
    pub(crate) write: f64,
}
