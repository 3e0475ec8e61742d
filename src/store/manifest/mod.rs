//! `manifest.json`: the fields that the manifests of several commands share.

pub mod bifurcation;
pub mod map;

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};

use crate::map::scene::{Axis, Scale, Scene, Start};
use crate::model_file::FileModel;
use crate::show::numbers::Number;
use crate::show::parameters;
use rattlemap_dynamics::model::Model;

pub use crate::store::file_names::MANIFEST;

/// Version of the manifest. It is raised when a field changes its meaning.
pub const FORMAT: u32 = 2;

/// Commit of this program.
pub const OWN_COMMIT: &str = env!("RATTLEMAP_COMMIT");

/// First fields of a manifest: its format, the command, and the program that wrote it.
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
    /// Returns the first fields of a manifest that `command` writes.
    pub fn of(command: &'static str) -> Head {
        Head { format: FORMAT, command, crate_version: env!("CARGO_PKG_VERSION"), commit: OWN_COMMIT }
    }
}

/// Joins the fields of several objects into one.
pub fn joined<const N: usize>(objects: [Value; N]) -> Value {
    let fields = |object| if let Value::Object(fields) = object { fields } else { Default::default() };
    Value::Object(objects.into_iter().flat_map(fields).collect())
}

/// Removes the fields of an object that are null.
pub(crate) fn without_nulls(mut object: Value) -> Value {
    if let Value::Object(fields) = &mut object {
        fields.retain(|_, value| !value.is_null());
    }
    object
}

/// Describes a model. `text` is the text of its file, which makes the folder independent of that file; it is null for a
/// model in code. `meanings` and `units` are those of its parameters and of the state's components, by name.
pub(crate) fn model(model: &dyn Model) -> Value {
    let text = model.downcast_ref().map(|file: &FileModel| &file.definition().text);
    joined([
        json!({
            "name": model.name(),
            "title": model.title(),
            "source": model.source(),
            "text": text,
            "meanings": parameters::meanings(model),
        }),
        without_nulls(json!({ "units": parameters::units(model) })),
    ])
}

/// Describes the columns of measured quantities; none if the scene requests none.
pub(crate) fn measured(scene: &Scene) -> Option<Value> {
    let numbers = Number::of(scene.base(), &scene.outputs().quantities);
    let described = |number: &Number| {
        let described = json!({ "long_name": number.title, "units": number.unit });
        (number.name.clone(), without_nulls(described))
    };
    let all: BTreeMap<String, Value> = numbers.iter().map(described).collect();
    (!all.is_empty()).then(|| json!(all))
}

/// Describes an axis. `is_start` marks the axis of a component of the initial state, `scale` is `linear`, `log` or
/// `values`, and `values` are those that the scene lists.
pub(crate) fn axis(axis: &Axis) -> Value {
    without_nulls(json!({
        "parameter": axis.parameter().name,
        "is_start": axis.target().is_start().then_some(true),
        "min": axis.min(),
        "max": axis.max(),
        "count": axis.count(),
        "scale": axis.scale().name(),
        "values": (axis.scale() == Scale::Values).then(|| axis.values().collect::<Vec<_>>()),
    }))
}

/// Describes the derived parameters of a scene, each with its smallest and largest value over all cells; none if there
/// are no such parameters.
pub(crate) fn derived(scene: &Scene) -> Option<BTreeMap<String, Value>> {
    let points = scene.points();
    let rules = points.derived().rules();
    if rules.is_empty() {
        return None;
    }
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; rules.len()];
    let [columns, rows] = points.counts();
    for cell in 0..columns * rows {
        let model = points.model(cell);
        for (rule, [min, max]) in rules.iter().zip(&mut ranges) {
            let value = model.value(rule.index());
            (*min, *max) = (min.min(value), max.max(value));
        }
    }
    let described = rules.iter().zip(ranges).map(|(rule, [min, max])| {
        let name = rule.parameter().name.to_string();
        (name, json!({ "expression": rule.text(), "min": min, "max": max }))
    });
    Some(described.collect())
}

/// Describes the initial states of a scene and their phase; `count` and `seed` belong to random states.
pub(crate) fn start(scene: &Scene) -> Value {
    let state = match scene.start() {
        Start::State(state) => Some(state[..scene.base().state_names().len()].to_vec()),
        _ => None,
    };
    let drawn = scene.draw().map(|draw| json!({ "count": draw.count, "seed": draw.seed }));
    let phase = scene.base().start_phase();
    joined([
        json!({ "policy": scene.start().policy(), "state": state, "phase": phase }),
        drawn.unwrap_or_default(),
    ])
}
