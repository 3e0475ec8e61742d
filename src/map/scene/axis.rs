//! Axes: which parameter is swept, or which component of the start, and its values.

use std::sync::Arc;

use super::document::{Node, Value};
use super::error::SceneError;
use super::keys;
use super::limits::MAX_COUNT;
use super::section::{Field, Section};
use rattlemap_dynamics::model::{Model, Parameter, Range, Shapes, State};

const EXAMPLE: &str = "write [[axis]] with parameter, min, max and count, or with parameter and values";

const NEITHER: &str = "name one of the model's parameters, or with `start` a component of the start";

/// What an axis, or a column of a list, sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The parameter with this index in the model's table.
    Parameter(usize),
    /// The component of the start with this place among the model's [state names](Model::state_names).
    Start(usize),
}

impl Target {
    /// The parameter's index, if it is one.
    pub(crate) fn parameter(self) -> Option<usize> {
        match self {
            Target::Parameter(index) => Some(index),
            Target::Start(_) => None,
        }
    }

    /// Whether it is a component of the start.
    pub fn is_start(self) -> bool {
        matches!(self, Target::Start(_))
    }

    /// Gives a model the value, if it has it.
    pub(super) fn set(self, model: &mut dyn Model, value: f64) {
        if let Target::Parameter(index) = self {
            model.assign(index, value);
        }
    }

    /// Gives a start the value, if it has it.
    pub(super) fn begin(self, start: &mut State, value: f64) {
        if let Target::Start(component) = self {
            start[component] = value;
        }
    }
}

/// How the values of an axis follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// By equal differences.
    Linear,
    /// By equal ratios.
    Log,
    /// As they were listed.
    Values,
}

impl Scale {
    /// The name in scenes and manifests.
    pub fn name(self) -> &'static str {
        match self {
            Scale::Linear => "linear",
            Scale::Log => "log",
            Scale::Values => "values",
        }
    }
}

/// The values of one parameter, or of one component of the start, strictly increasing.
#[derive(Clone, Debug)]
pub struct Axis {
    parameter: Parameter,
    target: Target,
    min: f64,
    max: f64,
    count: usize,
    scale: Scale,
    /// All values, computed once for all engines; none on a linear axis, which has a formula.
    table: Arc<[f64]>,
}

impl Axis {
    /// The swept parameter; of a component of the start its name, its meaning and its range.
    pub fn parameter(&self) -> &Parameter {
        &self.parameter
    }

    /// What the axis sets.
    pub fn target(&self) -> Target {
        self.target
    }

    /// Gives a model the axis' value `i`.
    pub(crate) fn set(&self, model: &mut dyn Model, i: usize) {
        // Between two ends in the parameter's range, which is an interval.
        self.target.set(model, self.value(i));
    }

    /// Gives a start the axis' value `i`.
    pub(crate) fn begin(&self, start: &mut State, i: usize) {
        self.target.begin(start, self.value(i));
    }

    /// The first value.
    pub fn min(&self) -> f64 {
        self.min
    }

    /// The last value, greater than the first.
    pub fn max(&self) -> f64 {
        self.max
    }

    /// How many values, 2 to [`MAX_COUNT`].
    pub fn count(&self) -> usize {
        self.count
    }

    /// How the values follow each other.
    pub fn scale(&self) -> Scale {
        self.scale
    }

    /// Value `i`, counted from 0. With `n = count - 1` it is on a linear axis
    ///
    /// ```text
    /// min + (max - min) * i / n
    /// ```
    ///
    /// and on a logarithmic one, with the functions of the crate `libm`, which are the same on every machine,
    ///
    /// ```text
    /// exp10((log10(min) * (n - i) + log10(max) * i) / n)
    /// ```
    ///
    /// The first one is `min`, the last one `max` itself, and none lies outside, whatever the rounding, so that
    /// no value leaves the parameter's range.
    pub fn value(&self, i: usize) -> f64 {
        let last = self.count - 1;
        if i >= last {
            return self.max;
        }
        match self.scale {
            Scale::Linear => (self.min + (self.max - self.min) * i as f64 / last as f64).min(self.max),
            Scale::Log | Scale::Values => self.table[i],
        }
    }

    /// All values, ascending.
    pub fn values(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.count).map(|i| self.value(i))
    }
}

/// The values of a logarithmic axis, as [`Axis::value`] says.
fn geometric(min: f64, max: f64, count: usize) -> Arc<[f64]> {
    let last = count - 1;
    let [from, to] = [min, max].map(libm::log10);
    let value = |i: usize| match i {
        0 => min,
        i if i == last => max,
        i => libm::exp10((from * (last - i) as f64 + to * i as f64) / last as f64).clamp(min, max),
    };
    (0..count).map(value).collect()
}

/// Reads `[[axis]]`, of which there must be `wanted`; `command` is who wants them.
pub(super) fn read(
    root: &Section<'_>,
    model: &dyn Model,
    wanted: usize,
    command: &str,
) -> Result<Vec<Axis>, SceneError> {
    let list = root.require("axis", EXAMPLE)?;
    let tables = list.list("a list of tables, [[axis]]")?;
    let mut axes = Vec::with_capacity(tables.len());
    for table in &tables {
        axes.push(read_one(table, model, &axes)?);
    }
    if axes.len() != wanted {
        let excess = tables.get(wanted).unwrap_or(&list);
        let plural = if wanted == 1 { "axis" } else { "axes" };
        return Err(Field { path: "axis".into(), node: &count_node(excess.node, axes.len()) }.conflict(
            format!("`{command}` needs {wanted} {plural}; add or remove [[axis]] tables to have as many"),
        ));
    }
    Ok(axes)
}

/// Refuses axes of the start where `command` has no use for them.
pub(super) fn refuse_starts(root: &Section<'_>, axes: &[Axis], command: &str) -> Result<(), SceneError> {
    match axes.iter().position(|axis| axis.target.is_start()) {
        Some(i) => Err(named(root, i)?.conflict(format!(
            "`{command}` follows one motion along a parameter; starts are for `map`, which shows their basins"
        ))),
        None => Ok(()),
    }
}

/// The place of the axis too many, with the number of axes as the value shown.
fn count_node(at: &Node, count: usize) -> Node {
    let shown = format!("{count} {}", if count == 1 { "table" } else { "tables" });
    Node { place: at.name_place.clone(), shown, value: Value::Other, ..at.clone() }
}

fn read_one(table: &Field<'_>, model: &dyn Model, before: &[Axis]) -> Result<Axis, SceneError> {
    let section = Section::open(table.node, &table.path, &keys::names("axis"))?;
    let (field, is_start) = told_name(&section)?;
    let name = field.text()?;
    let (target, parameter) = if is_start {
        let names = model.state_names();
        let place = names.iter().position(|known| *known == name);
        let place = place.ok_or_else(|| field.unknown_name(name, &names, &names.join(", ")))?;
        (Target::Start(place), component(model, place))
    } else {
        let index =
            model.index(name).map_err(|_| field.unknown_name(name, &names(model), &meanings(model)))?;
        (Target::Parameter(index), model.parameters()[index].clone())
    };
    if let Some(i) = before.iter().position(|axis| axis.target == target) {
        let what = if is_start { "component of the start" } else { "parameter" };
        return Err(field.conflict(format!("axis {i} sweeps it already; name another {what}")));
    }
    match told_values(&section)? {
        Some(values) => read_values(&values, parameter, target),
        None => read_range(&section, parameter, target),
    }
}

/// The name of what an axis sweeps, and whether that is a component of the start: an argument wins over the text.
fn told_name<'a>(section: &Section<'a>) -> Result<(Field<'a>, bool), SceneError> {
    match (section.get("parameter"), section.get("start")) {
        (Some(parameter), Some(start)) if parameter.is_argument() == start.is_argument() => Err(start
            .conflict(format!(
                "`{}` is given, too, and an axis sweeps one thing; drop either",
                parameter.path
            ))),
        (Some(parameter), Some(_)) if parameter.is_argument() => Ok((parameter, false)),
        (_, Some(start)) => Ok((start, true)),
        (Some(parameter), None) => Ok((parameter, false)),
        (None, None) => Err(section.missing("parameter", NEITHER)),
    }
}

/// A component of the start, as it is told where parameters are.
pub(super) fn component(model: &dyn Model, place: usize) -> Parameter {
    let name = model.state_names()[place].to_owned();
    let meaning = if place.is_multiple_of(2) { "displacement at the start" } else { "velocity at the start" };
    Parameter {
        name: name.into(),
        meaning: meaning.into(),
        default: None,
        range: Range::Finite,
        // Neither: nothing asks.
        shapes: Shapes::Both,
    }
}

/// `values`, if they are what tells the axis: an argument wins over the text, for them or for what they replace.
fn told_values<'a>(section: &Section<'a>) -> Result<Option<Field<'a>>, SceneError> {
    let Some(values) = section.get("values") else { return Ok(None) };
    let others = ["min", "max", "count", "scale"].map(|name| section.get(name));
    let mut others = others.iter().flatten();
    let is_argument = values.is_argument();
    if let Some(other) = others.clone().find(|other| other.is_argument() == is_argument) {
        return Err(values.conflict(format!(
            "values stand in the place of min, max, count and scale, and `{}` is given, too; drop either",
            other.path
        )));
    }
    Ok((is_argument || others.next().is_none()).then_some(values))
}

fn read_values(field: &Field<'_>, parameter: Parameter, target: Target) -> Result<Axis, SceneError> {
    let wanted = format!("a list of 2 to {MAX_COUNT} numbers, each greater than the one before it");
    let items = field.list(&wanted)?;
    if !(2..=MAX_COUNT as usize).contains(&items.len()) {
        return Err(field.out_of_range(&wanted));
    }
    let mut table: Vec<f64> = Vec::with_capacity(items.len());
    for item in &items {
        let value = in_range(item, &parameter)?;
        if let Some(before) = table.last().filter(|before| value <= **before) {
            return Err(item.out_of_range(&format!("greater than the value before it, {before:?}")));
        }
        table.push(value);
    }
    let (min, max, count) = (table[0], table[items.len() - 1], items.len());
    Ok(Axis { parameter, target, min, max, count, scale: Scale::Values, table: table.into() })
}

fn read_range(section: &Section<'_>, parameter: Parameter, target: Target) -> Result<Axis, SceneError> {
    let scale = match section.get("scale") {
        Some(field) => field.choice(&[Scale::Linear, Scale::Log].map(|scale| (scale.name(), scale)))?,
        None => Scale::Linear,
    };
    let end = |which: &str| {
        let remedy = format!("give a number, {}", parameter.range.requirement());
        let field = section.require(which, &remedy)?;
        in_range(&field, &parameter).map(|value| (value, field))
    };
    let (min, min_field) = end("min")?;
    if scale == Scale::Log && min <= 0.0 {
        return Err(
            min_field.out_of_range("greater than 0 where `scale = \"log\"`; raise it, or drop the scale")
        );
    }
    let (max, max_field) = end("max")?;
    if min >= max {
        return Err(max_field.out_of_range(&format!("greater than `{}.min = {min}`", section.path())));
    }
    let count_field = section.require("count", "say how many values, 2 or more")?;
    let count = count_field.whole(2..=MAX_COUNT)? as usize;
    if scale == Scale::Linear && !((max - min) * count as f64).is_finite() {
        return Err(max_field.out_of_range("near enough to `min` for the difference to be a finite number"));
    }
    let table = match scale {
        Scale::Log => geometric(min, max, count),
        _ => Arc::new([]),
    };
    let axis = Axis { parameter, target, min, max, count, scale, table };
    if axis.values().zip(axis.values().skip(1)).any(|(value, next)| value >= next) {
        return Err(count_field.out_of_range("so small that no two values are the same number"));
    }
    Ok(axis)
}

/// A number that the parameter may take.
fn in_range(field: &Field<'_>, parameter: &Parameter) -> Result<f64, SceneError> {
    let value = field.number()?;
    match parameter.range.contains(value) {
        true => Ok(value),
        false => {
            let requirement = parameter.range.requirement();
            Err(field.out_of_range(&format!("{requirement}, as `{}` is", parameter.name)))
        }
    }
}

/// The name of what axis `i` sweeps.
pub(super) fn named<'a>(root: &Section<'a>, i: usize) -> Result<Field<'a>, SceneError> {
    let tables = root.require("axis", EXAMPLE)?.list("a list of tables, [[axis]]")?;
    let section = Section::open(tables[i].node, &tables[i].path, &keys::names("axis"))?;
    told_name(&section).map(|(field, _)| field)
}

pub(super) fn names(model: &dyn Model) -> Vec<&str> {
    model.parameters().iter().map(|parameter| &*parameter.name).collect()
}

/// The parameters with what they mean, as a list within a sentence.
pub(super) fn meanings(model: &dyn Model) -> String {
    let of = |parameter: &Parameter| format!("{} ({})", parameter.name, parameter.meaning);
    model.parameters().iter().map(of).collect::<Vec<_>>().join(", ")
}
