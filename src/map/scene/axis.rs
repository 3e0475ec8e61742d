//! Axes: which parameter is swept, from where to where, in how many values.

use super::document::{Node, Value};
use super::error::{Place, SceneError};
use super::keys;
use super::section::{Field, Section};
use rattlemap_dynamics::model::{Model, Parameter};

/// The most values that one axis may have.
pub const MAX_COUNT: u32 = 1_000_000;

const EXAMPLE: &str = "write [[axis]] with parameter, min, max and count";

/// An inclusive linear range of one parameter.
#[derive(Clone, Debug)]
pub struct Axis {
    parameter: Parameter,
    /// Of the parameter in the model's table.
    index: usize,
    min: f64,
    max: f64,
    count: usize,
}

impl Axis {
    /// The swept parameter.
    pub fn parameter(&self) -> &Parameter {
        &self.parameter
    }

    /// The parameter's place in the model's table.
    pub(crate) fn index(&self) -> usize {
        self.index
    }

    /// Gives a model the axis' value `i`.
    pub(crate) fn set(&self, model: &mut dyn Model, i: usize) {
        // Between two ends in the parameter's range, which is an interval.
        model.assign(self.index, self.value(i));
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

    /// Value `i`, counted from 0: `min + (max - min) * i / (count - 1)`.
    ///
    /// The last one is `max` itself and none exceeds it, whatever the rounding, so that
    /// no value leaves the parameter's range.
    pub fn value(&self, i: usize) -> f64 {
        let last = self.count - 1;
        if i >= last {
            return self.max;
        }
        (self.min + (self.max - self.min) * i as f64 / last as f64).min(self.max)
    }

    /// All values, ascending.
    pub fn values(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.count).map(|i| self.value(i))
    }
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

/// The place of the axis too many, with the number of axes as the value shown.
fn count_node(at: &Node, count: usize) -> Node {
    let shown = format!("{count} {}", if count == 1 { "table" } else { "tables" });
    Node { place: at.name_place.clone(), shown, value: Value::Other, ..at.clone() }
}

fn read_one(table: &Field<'_>, model: &dyn Model, before: &[Axis]) -> Result<Axis, SceneError> {
    let section = Section::open(table.node, &table.path, &keys::names("axis"))?;
    let field = section.require("parameter", "name one of the model's parameters")?;
    let name = field.text()?;
    let index = model.index(name).map_err(|_| field.unknown_among(name, &names(model), &meanings(model)))?;
    let parameter = model.parameters()[index].clone();
    if let Some(i) = before.iter().position(|axis| axis.index == index) {
        return Err(field.conflict(format!("axis {i} sweeps it already; name another parameter")));
    }
    let requirement = parameter.range.requirement();
    let end = |which: &str| {
        let field = section.require(which, &format!("give a number, {requirement}"))?;
        let value = field.number()?;
        if parameter.range.contains(value) {
            Ok((value, field))
        } else {
            Err(field.out_of_range(&format!("{requirement}, as `{name}` is")))
        }
    };
    let (min, _) = end("min")?;
    let (max, max_field) = end("max")?;
    if min >= max {
        return Err(max_field.out_of_range(&format!("greater than `{}.min = {min}`", table.path)));
    }
    let count = section.require("count", "say how many values, 2 or more")?.whole(2..=MAX_COUNT)?;
    if !((max - min) * f64::from(count)).is_finite() {
        return Err(max_field.out_of_range("near enough to `min` for the difference to be a finite number"));
    }
    Ok(Axis { parameter, index, min, max, count: count as usize })
}

/// Reads `[parameters]` beside the axes: the base from which every cell is made.
///
/// A parameter that is an axis must not be set as well, except that an axis named by a `--set`
/// argument replaces the value in the scene's text: arguments win over the text.
pub(super) fn read_parameters(
    root: &Section<'_>,
    model: &dyn Model,
    axes: &[Axis],
) -> Result<Box<dyn Model>, SceneError> {
    let section = root.section_among("parameters", &names(model), &meanings(model))?;
    let mut base = model.boxed();
    for (index, parameter) in model.parameters().iter().enumerate() {
        let name = &*parameter.name;
        let swept = axes.iter().position(|axis| axis.index == index);
        let value = match (section.get(name), swept) {
            (Some(field), Some(i)) if is_argument(&field) || !is_argument(&named(root, i)?) => {
                return Err(field.conflict(format!(
                    "axis {i} sweeps `{name}`; set `axis.{i}.min` and `axis.{i}.max`, or drop one of the two"
                )));
            }
            (Some(field), None) => given(&field, parameter)?,
            (_, Some(i)) => axes[i].min,
            (None, None) => parameter.default.ok_or_else(|| {
                let remedy = format!(
                    "{} has no default: set it under [parameters] or make it an axis",
                    parameter.meaning
                );
                section.missing(name, &remedy)
            })?,
        };
        // In range: checked above, or the table's own default.
        base.assign(index, value);
    }
    Ok(base)
}

fn names(model: &dyn Model) -> Vec<&str> {
    model.parameters().iter().map(|parameter| &*parameter.name).collect()
}

/// The parameters with what they mean, as a list within a sentence.
fn meanings(model: &dyn Model) -> String {
    let of = |parameter: &Parameter| format!("{} ({})", parameter.name, parameter.meaning);
    model.parameters().iter().map(of).collect::<Vec<_>>().join(", ")
}

/// The name of axis `i`'s parameter.
fn named<'a>(root: &Section<'a>, i: usize) -> Result<Field<'a>, SceneError> {
    let tables = root.require("axis", EXAMPLE)?.list("a list of tables, [[axis]]")?;
    Section::open(tables[i].node, &tables[i].path, &keys::names("axis"))?.require("parameter", EXAMPLE)
}

fn is_argument(field: &Field<'_>) -> bool {
    matches!(field.node.place, Place::Set { .. })
}

fn given(field: &Field<'_>, parameter: &Parameter) -> Result<f64, SceneError> {
    let value = field.number()?;
    match parameter.range.contains(value) {
        true => Ok(value),
        false => Err(field.out_of_range(&parameter.range.requirement())),
    }
}
