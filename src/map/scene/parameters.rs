//! `[parameters]`: the base from which every cell is made.

use super::axis::{self, Axis, Target, meanings, names};
use super::derived::Derived;
use super::error::SceneError;
use super::list::List;
use super::section::{Field, Section};
use rattlemap_dynamics::model::{Model, Parameter};

/// What sets a cell's parameters beside `[parameters]`.
#[derive(Clone, Copy)]
pub(super) struct Beside<'a> {
    pub(super) axes: &'a [Axis],
    pub(super) list: Option<&'a List>,
    pub(super) derived: &'a Derived,
}

impl Beside<'_> {
    fn axis(&self, index: usize) -> Option<usize> {
        self.axes.iter().position(|axis| axis.target() == Target::Parameter(index))
    }

    fn column(&self, index: usize) -> Option<&List> {
        self.list.filter(|list| list.targets().any(|column| column == Target::Parameter(index)))
    }
}

/// Reads `[parameters]`; what is set beside it comes later.
///
/// A parameter that is an axis or a column must not be set as well, except that an axis named by a `--set`
/// argument replaces the value in the scene's text: arguments win over the text.
pub(super) fn read(
    root: &Section<'_>,
    model: &dyn Model,
    beside: Beside<'_>,
) -> Result<Box<dyn Model>, SceneError> {
    let section = root.section_among("parameters", &names(model), &meanings(model))?;
    let mut base = model.clone_model();
    for (index, parameter) in model.parameters().iter().enumerate() {
        let name = &*parameter.name;
        let field = section.get(name);
        if let (Some(field), Some(list)) = (&field, beside.column(index)) {
            let file = list.file();
            return Err(field.conflict(format!("a column of `{file}` sets it; drop either")));
        }
        if beside.column(index).is_some() || beside.derived.has(index) {
            continue;
        }
        let value = match (field, beside.axis(index)) {
            (Some(field), Some(i)) if field.is_argument() || !axis::named(root, i)?.is_argument() => {
                return Err(field.conflict(format!(
                    "axis {i} sweeps `{name}`; set `axis.{i}.min` and `axis.{i}.max`, or drop one of the two"
                )));
            }
            (Some(field), None) => given(&field, parameter)?,
            (_, Some(i)) => beside.axes[i].min(),
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

fn given(field: &Field<'_>, parameter: &Parameter) -> Result<f64, SceneError> {
    let value = field.number()?;
    match parameter.range.contains(value) {
        true => Ok(value),
        false => Err(field.out_of_range(&parameter.range.requirement())),
    }
}
