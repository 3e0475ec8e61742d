//! `[parameters]`: the parameters of a model.

use std::borrow::Cow;

use rattlemap_dynamics::model::{Parameter, Range, Shapes};

use crate::text::document::Value;
use crate::text::error::SceneError;
use crate::text::expression;
use crate::text::section::{Field, Section};

/// Keys of a parameter's own table.
const PARAMETER_KEYS: [&str; 7] = ["default", "min", "max", "open", "meaning", "unit", "required"];

/// Largest number of characters of a parameter's name, which occurs in tables and figures.
const LONGEST_PARAMETER_NAME: usize = 32;

/// Largest number of characters of a meaning, which labels an axis.
const LONGEST_MEANING: usize = 120;

/// Largest number of characters of a unit.
const LONGEST_UNIT: usize = 20;

/// Names of columns that stand beside parameters or states in tables. They cannot be names in models. `docs/models.md`
/// lists them.
#[rustfmt::skip]
pub(super) const COLUMNS: [&str; 49] = [
    "i", "j", "t", "phase", "class", "period", "lyapunov", "lyapunov_error", "impacts_per_period", "mesh_fraction",
    "symmetric", "word", "pattern", "status", "periods_run", "source", "finished", "attractor", "attractors", "label",
    "exponent", "largest_multiplier", "cells", "share", "direction", "domain", "event", "side", "kind", "moment",
    "t_mod_period", "impact_speed", "impact_speed_max", "impact_energy", "impact_rate", "contact_force_max",
    "contact_force_rms", "dissipated", "stick_fraction", "friction_energy", "release_energy", "cycle_time", "multiplier", "multiplier_argument", "amplitude_gap", "mean_gap", "rms_gap",
    "harmonic_gap", "harmonic_phase_gap",
];

/// A parameter as written in the file. Its use in the model is found later.
pub(super) struct ParameterEntry {
    pub(super) name: String,
    meaning: String,
    unit: Option<String>,
    pub(super) default: f64,
    /// Whether a scene must set the parameter.
    is_required: bool,
    range: Range,
}

impl ParameterEntry {
    /// Converts the entry to a parameter that affects `shapes`.
    pub(super) fn into_parameter(self, shapes: Shapes) -> Parameter {
        Parameter {
            name: Cow::Owned(self.name),
            meaning: Cow::Owned(self.meaning),
            unit: self.unit.map(Cow::Owned),
            default: (!self.is_required).then_some(self.default),
            range: self.range,
            shapes,
        }
    }
}

/// Reads `[parameters]` in the order of the text.
pub(super) fn read(root: &Section<'_>) -> Result<Vec<ParameterEntry>, SceneError> {
    let Some(field) = root.get("parameters") else { return Ok(Vec::new()) };
    let Value::Table(table) = &field.node.value else {
        return Err(field.wrong_type("a table, [parameters]"));
    };
    let known: Vec<&str> = table.keys().map(String::as_str).collect();
    let section = Section::open(field.node, "parameters", &known)?;
    section.fields_as_written().into_iter().map(|(name, field)| read_one(name, &field)).collect()
}

fn read_one(name: &str, field: &Field<'_>) -> Result<ParameterEntry, SceneError> {
    check_name(name, field)?;
    let Value::Table(_) = &field.node.value else {
        let expected = "a number, its default, or a table such as { default = 1.0, min = 0.0 }";
        let default = field.number_or(expected)?;
        if !default.is_finite() {
            return Err(field.out_of_range("a finite number"));
        }
        let (name, meaning) = (name.to_owned(), name.to_owned());
        let (unit, range) = (None, Range::Finite);
        return Ok(ParameterEntry { name, meaning, unit, default, is_required: false, range });
    };
    let section = Section::open(field.node, &field.path, &PARAMETER_KEYS)?;
    let given = section.require("default", "a parameter needs a default: write default = 1.0")?;
    let flag = |name| section.get(name).map_or(Ok(false), |field| field.flag());
    let open = section.get("open");
    let is_open = flag("open")?;
    if let (Some(field), None) = (open, section.get("min")) {
        return Err(
            field.conflict("it excludes the value `min`, but `min` is missing; add min or remove open")
        );
    }
    let end = |name, none| match section.get(name) {
        None => Ok(none),
        Some(field) => match field.number()? {
            end if end.is_finite() => Ok(end),
            _ => Err(field.out_of_range("a finite number; leave it out where there is no bound")),
        },
    };
    let (min, max) = (end("min", f64::NEG_INFINITY)?, end("max", f64::INFINITY)?);
    if let (Some(field), false) = (section.get("max"), min < max) {
        return Err(field.out_of_range(&format!("greater than min = {min}")));
    }
    let range = Range::new(min, max, is_open);
    let default = given.number()?;
    if !range.contains(default) {
        return Err(given.out_of_range(&range.requirement()));
    }
    let meaning = match section.get("meaning") {
        Some(field) => field.line(LONGEST_MEANING)?,
        None => name.to_owned(),
    };
    let unit = section.get("unit").map(|field| read_unit(&field)).transpose()?;
    let is_required = flag("required")?;
    Ok(ParameterEntry { name: name.to_owned(), meaning, unit, default, is_required, range })
}

/// Reads a unit.
pub(super) fn read_unit(field: &Field<'_>) -> Result<String, SceneError> {
    field.line(LONGEST_UNIT)
}

/// Checks a name of a parameter, a coordinate or a velocity.
pub(super) fn check_name(name: &str, field: &Field<'_>) -> Result<(), SceneError> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let is_name = name.chars().all(is_word) && name.starts_with(|c: char| c.is_ascii_alphabetic());
    if !is_name || name.len() > LONGEST_PARAMETER_NAME {
        return Err(field.conflict(format!(
            "a name begins with a letter and has at most {LONGEST_PARAMETER_NAME} letters, digits and underscores"
        )));
    }
    if name == "t" || expression::is_reserved(name) {
        let meaning = match name {
            "t" => "is the time",
            "pi" => "is a number",
            _ => "is a function",
        };
        return Err(field.conflict(format!("`{name}` {meaning} and cannot be used; choose another name")));
    }
    if COLUMNS.contains(&name) {
        return Err(field.conflict(format!(
            "`{name}` is a column of tables and cannot be used; choose another name, and none of {}",
            COLUMNS.join(", ")
        )));
    }
    Ok(())
}
