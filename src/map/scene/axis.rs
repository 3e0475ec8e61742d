//! Axes: each sweeps a parameter or a component of the start over increasing values.

use std::sync::Arc;

use super::document::{Node, Value};
use super::error::SceneError;
use super::keys;
use super::limits::MAX_COUNT;
use super::section::{Field, Section};
use rattlemap_dynamics::model::{Model, Parameter, Range, Shapes, State};
use rattlemap_dynamics::named;

const EXAMPLE: &str = "write [[axis]] with parameter, min, max and count, or with parameter and values";

const NEITHER: &str = "name one of the model's parameters, or a component of the start with `start`";

/// The quantity that an axis, or a column of a list, sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The parameter with this index in the model's table.
    Parameter(usize),
    /// The component of the start with this index among the model's [state names](Model::state_names).
    Start(usize),
}

impl Target {
    /// Returns the index of the parameter; none for a component of the start.
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

    /// Sets the parameter in `model`; does nothing for a component of the start.
    pub(super) fn set(self, model: &mut dyn Model, value: f64) {
        if let Target::Parameter(index) = self {
            model.assign(index, value);
        }
    }

    /// Sets the component in `start`; does nothing for a parameter.
    pub(super) fn begin(self, start: &mut State, value: f64) {
        if let Target::Start(component) = self {
            start[component] = value;
        }
    }
}

named! {
    /// Spacing of the values of an axis.
    pub enum Scale {
        /// Equal differences.
        Linear = "linear",
        /// Equal ratios.
        Log = "log",
        /// Listed one by one.
        Values = "values",
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
    /// All values, computed once for all engines. Empty for a linear axis, which has a formula.
    table: Arc<[f64]>,
}

impl Axis {
    /// Returns the swept parameter. A component of the start is described in the same form.
    pub fn parameter(&self) -> &Parameter {
        &self.parameter
    }

    /// Returns the quantity that the axis sets.
    pub fn target(&self) -> Target {
        self.target
    }

    /// Returns the first value.
    pub fn min(&self) -> f64 {
        self.min
    }

    /// Returns the last value, which is greater than the first.
    pub fn max(&self) -> f64 {
        self.max
    }

    /// Returns the number of values, 2 to [`MAX_COUNT`].
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the spacing of the values.
    pub fn scale(&self) -> Scale {
        self.scale
    }

    /// Returns value `i`, counted from 0. With `n = count - 1`, a value of a linear axis is
    ///
    /// ```text
    /// min + (max - min) * i / n
    /// ```
    ///
    /// A value of a logarithmic axis, computed by the crate `libm` so that it has the same bits on every machine, is
    ///
    /// ```text
    /// exp10((log10(min) * (n - i) + log10(max) * i) / n)
    /// ```
    ///
    /// The first value is exactly `min` and the last exactly `max`. No value is outside, whatever the rounding, so each
    /// is in the parameter's range.
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

    /// Returns all values in increasing order.
    pub fn values(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.count).map(|i| self.value(i))
    }
}

/// Computes the values of a logarithmic axis by the formula in [`Axis::value`].
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

/// Reads the `[[axis]]` tables. `command`, which messages name, needs `required` of them.
pub(super) fn read(
    root: &Section<'_>,
    model: &dyn Model,
    required: usize,
    command: &str,
) -> Result<Vec<Axis>, SceneError> {
    let list = root.require("axis", EXAMPLE)?;
    let tables = list.list("a list of tables, [[axis]]")?;
    let mut axes = Vec::with_capacity(tables.len());
    for table in &tables {
        axes.push(read_one(table, model, &axes)?);
    }
    if axes.len() != required {
        let excess = tables.get(required).unwrap_or(&list);
        let one = if required == 1 { "one table" } else { "two tables" };
        let remedy = match (axes.len() < required, required) {
            (true, 1) => "add an [[axis]] table",
            (true, _) => "add an [[axis]] table, or make a diagram over one parameter with `bifurcation`",
            (false, _) => "remove an [[axis]] table",
        };
        return Err(Field { path: "axis".into(), node: &count_node(excess.node, axes.len()) }
            .out_of_range(&format!("{one} for `{command}`; {remedy}")));
    }
    Ok(axes)
}

/// Refuses axes that sweep the start, which `command` cannot use.
pub(super) fn refuse_starts(root: &Section<'_>, axes: &[Axis], command: &str) -> Result<(), SceneError> {
    match axes.iter().position(|axis| axis.target.is_start()) {
        Some(i) => Err(named(root, i)?.conflict(format!(
            "`{command}` follows one motion along a parameter; a map (`map`) can sweep the start"
        ))),
        None => Ok(()),
    }
}

/// Builds the node that an error about the number of axes shows: the place of the first superfluous axis, and the
/// number.
fn count_node(at: &Node, count: usize) -> Node {
    let excerpt = format!("{count} {}", if count == 1 { "table" } else { "tables" });
    Node { place: at.name_place.clone(), excerpt, value: Value::Other, ..at.clone() }
}

fn read_one(table: &Field<'_>, model: &dyn Model, before: &[Axis]) -> Result<Axis, SceneError> {
    let section = Section::open(table.node, &table.path, &keys::names("axis"))?;
    let (field, is_start) = swept_name(&section)?;
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
    match listed_values(&section)? {
        Some(values) => read_values(&values, parameter, target),
        None => read_range(&section, parameter, target),
    }
}

/// Returns the field that names the swept quantity, and whether it is a component of the start. An argument overrides
/// the text.
fn swept_name<'a>(section: &Section<'a>) -> Result<(Field<'a>, bool), SceneError> {
    match (section.get("parameter"), section.get("start")) {
        (Some(parameter), Some(start)) if parameter.is_argument() == start.is_argument() => Err(start
            .conflict(format!(
                "`{}` is given, too, but an axis sweeps one quantity; remove one of the two",
                parameter.path
            ))),
        (Some(parameter), Some(_)) if parameter.is_argument() => Ok((parameter, false)),
        (_, Some(start)) => Ok((start, true)),
        (Some(parameter), None) => Ok((parameter, false)),
        (None, None) => Err(section.missing("parameter", NEITHER)),
    }
}

/// Describes a component of the start in the form of a parameter.
pub(super) fn component(model: &dyn Model, place: usize) -> Parameter {
    let name = model.state_names()[place].to_owned();
    let meaning = if place.is_multiple_of(2) { "displacement at the start" } else { "velocity at the start" };
    Parameter {
        name: name.into(),
        meaning: meaning.into(),
        unit: model.units().component(place).map(Into::into),
        default: None,
        range: Range::Finite,
        // Never read for a component of the start.
        shapes: Shapes::Both,
    }
}

/// Returns the field `values` if it defines the axis. Both `values` and a range may be given if one of them is an
/// argument, which overrides the text.
fn listed_values<'a>(section: &Section<'a>) -> Result<Option<Field<'a>>, SceneError> {
    let Some(values) = section.get("values") else { return Ok(None) };
    let others = ["min", "max", "count", "scale"].map(|name| section.get(name));
    let mut others = others.iter().flatten();
    let is_argument = values.is_argument();
    if let Some(other) = others.clone().find(|other| other.is_argument() == is_argument) {
        return Err(values.conflict(format!(
            "values replace min, max, count and scale, but `{}` is given, too; remove one of the two",
            other.path
        )));
    }
    Ok((is_argument || others.next().is_none()).then_some(values))
}

fn read_values(field: &Field<'_>, parameter: Parameter, target: Target) -> Result<Axis, SceneError> {
    let requirement = format!("a list of 2 to {MAX_COUNT} numbers, each greater than the one before it");
    let items = field.list(&requirement)?;
    if !(2..=MAX_COUNT as usize).contains(&items.len()) {
        return Err(field.out_of_range(&requirement));
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
            min_field.out_of_range("greater than 0 for `scale = \"log\"`; raise it, or remove the scale")
        );
    }
    let (max, max_field) = end("max")?;
    if min >= max {
        return Err(max_field.out_of_range(&format!("greater than `{}.min = {min}`", section.path())));
    }
    let count_field = section.require("count", "say how many values, 2 or more")?;
    let count = count_field.whole(2..=MAX_COUNT)? as usize;
    if scale == Scale::Linear && !((max - min) * count as f64).is_finite() {
        return Err(max_field.out_of_range("so close to `min` that their difference is a finite number"));
    }
    let table = match scale {
        Scale::Log => geometric(min, max, count),
        _ => Arc::new([]),
    };
    let axis = Axis { parameter, target, min, max, count, scale, table };
    if axis.values().zip(axis.values().skip(1)).any(|(value, next)| value >= next) {
        return Err(count_field.out_of_range("so small that neighbouring values differ after rounding"));
    }
    Ok(axis)
}

/// Reads a number within the parameter's range.
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

/// Returns the field that names the quantity swept by axis `i`.
pub(super) fn named<'a>(root: &Section<'a>, i: usize) -> Result<Field<'a>, SceneError> {
    let tables = root.require("axis", EXAMPLE)?.list("a list of tables, [[axis]]")?;
    let section = Section::open(tables[i].node, &tables[i].path, &keys::names("axis"))?;
    swept_name(&section).map(|(field, _)| field)
}

/// Returns the names of the model's parameters.
pub(super) fn names(model: &dyn Model) -> Vec<&str> {
    model.parameters().iter().map(|parameter| &*parameter.name).collect()
}

/// Lists the model's parameters with their meanings, for messages.
pub(super) fn meanings(model: &dyn Model) -> String {
    let of = |parameter: &Parameter| format!("{} ({})", parameter.name, parameter.meaning);
    model.parameters().iter().map(of).collect::<Vec<_>>().join(", ")
}
