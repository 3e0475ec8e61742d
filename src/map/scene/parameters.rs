//! `[parameters]`: values of the parameters that are neither swept nor derived.

use super::axis::{self, Axis, Target, meanings, names};
use super::derived::Derived;
use super::error::SceneError;
use super::list::List;
use super::section::{Field, Section};
use rattlemap_dynamics::model::{Model, Parameter};

/// The parts of a scene, other than `[parameters]`, that set parameters.
#[derive(Clone, Copy)]
pub(super) struct ParameterSources<'a> {
    pub(super) axes: &'a [Axis],
    pub(super) list: Option<&'a List>,
    pub(super) derived: &'a Derived,
}

impl ParameterSources<'_> {
    fn axis(&self, index: usize) -> Option<usize> {
        self.axes.iter().position(|axis| axis.target() == Target::Parameter(index))
    }

    fn column(&self, index: usize) -> Option<&List> {
        self.list.filter(|list| list.targets().any(|column| column == Target::Parameter(index)))
    }
}

/// Reads `[parameters]`. Swept parameters get their first value; derived ones are computed later.
///
/// A parameter must not be both set here and swept by an axis or a column. One exception: if a `--set` argument names
/// the axis' parameter, it overrides the value in the text.
pub(super) fn read(
    root: &Section<'_>,
    model: &dyn Model,
    sources: ParameterSources<'_>,
) -> Result<Box<dyn Model>, SceneError> {
    let section = root.section_among("parameters", &names(model), &meanings(model))?;
    let mut base = model.clone_model();
    for (index, parameter) in model.parameters().iter().enumerate() {
        let name = &*parameter.name;
        let field = section.get(name);
        if let (Some(field), Some(list)) = (&field, sources.column(index)) {
            let file = list.file();
            return Err(field.conflict(format!("a column of `{file}` sets it; remove one of the two")));
        }
        if sources.column(index).is_some() || sources.derived.has(index) {
            continue;
        }
        let value = match (field, sources.axis(index)) {
            (Some(field), Some(i)) if field.is_argument() || !axis::named(root, i)?.is_argument() => {
                return Err(field.conflict(format!(
                    "axis {i} sweeps `{name}`; set `axis.{i}.min` and `axis.{i}.max`, or remove one of the two"
                )));
            }
            (Some(field), None) => read_value(&field, parameter)?,
            (_, Some(i)) => sources.axes[i].min(),
            (None, None) => parameter.default.ok_or_else(|| {
                let remedy = format!(
                    "{} has no default: set it under [parameters] or make it an axis",
                    parameter.meaning
                );
                section.missing(name, &remedy)
            })?,
        };
        // The value is in range: it was checked above, or it is the model's default.
        base.assign(index, value);
    }
    Ok(base)
}

fn read_value(field: &Field<'_>, parameter: &Parameter) -> Result<f64, SceneError> {
    let value = field.number()?;
    match parameter.range.contains(value) {
        true => Ok(value),
        false => Err(field.out_of_range(&parameter.range.requirement())),
    }
}
