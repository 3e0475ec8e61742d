//! `--along`: one line of a plane, read from a scene with two axes as a bifurcation diagram.
//!
//! The tree is changed before it is read: the other axis becomes a parameter, and settings that only maps have are
//! removed. So all checks of diagrams apply, and every error has its place.

use std::sync::Arc;

use super::axis::{self, Axis};
use super::document::{Node, Table, Value, read_argument};
use super::error::{Fault, Place, Problem, SceneError};
use super::section::Section;
use super::settings::Format;
use super::{Purpose, TOP_LEVEL};
use rattlemap_dynamics::model::Model;

/// The axis along which a diagram runs, and the values of the other axes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Along {
    /// The swept parameter.
    pub parameter: String,
    /// `NAME=VALUE` for each other axis. The value may be any in the parameter's range.
    pub at: Vec<String>,
}

/// Reduces a scene of several axes to the axis that `along` names.
///
/// # Errors
/// [`SceneError`] if the names do not fit the axes, or if the scene has several axes and `along` is none.
pub(super) fn reduce(
    document: &mut Node,
    model: &dyn Model,
    along: Option<&Along>,
) -> Result<(), SceneError> {
    let (command, _) = Purpose::Bifurcation.needs();
    let (axes, are_arguments) = {
        let root = Section::open(document, "", &TOP_LEVEL)?;
        let Some(field) = root.get("axis") else { return Ok(()) };
        let tables = field.list("a list of tables, [[axis]]")?;
        let axes = match (along, &tables[..]) {
            (None, [_, second, ..]) => {
                let axes = axis::read(&root, model, tables.len(), command)?;
                return Err(unnamed(&second.node.name_place, &axes));
            }
            (None, _) | (Some(_), []) => return Ok(()),
            (Some(_), _) => axis::read(&root, model, tables.len(), command)?,
        };
        axis::refuse_starts(&root, &axes, command)?;
        let is_argument = |i| axis::named(&root, i).map(|field| field.is_argument());
        let are_arguments = (0..axes.len()).map(is_argument).collect::<Result<Vec<bool>, _>>()?;
        (axes, are_arguments)
    };
    let Some(along) = along else { return Ok(()) };
    let fixed = fixed(&axes, along)?;
    let Value::Table(root) = &mut document.value else { return Ok(()) };
    keep_one(root, axes.iter().position(|axis| *axis.parameter().name == *along.parameter));
    for (axis, value) in fixed {
        let place = axes.iter().position(|other| other.target() == axis.target());
        let is_argument = place.is_some_and(|i| are_arguments[i]);
        fix(root, &axis.parameter().name, value, is_argument)?;
    }
    remove_map_settings(root);
    Ok(())
}

/// Builds the error for a scene of several axes without `--along`.
fn unnamed(place: &Place, axes: &[Axis]) -> SceneError {
    let names: Vec<&str> = axes.iter().map(|axis| &*axis.parameter().name).collect();
    let at: String = names[1..].iter().map(|name| format!(" --at {name}=VALUE")).collect();
    let remedy = format!(
        "one table for `bifurcation`; choose a line of the plane with --along {}{at}, or remove an [[axis]] table",
        names[0]
    );
    let problem = Problem::value(Fault::OutOfRange, "axis", format!("{} tables", axes.len()), remedy);
    SceneError { place: place.clone(), problem }
}

/// Returns the axes that are fixed by `--at`, each with its value.
fn fixed<'a>(axes: &'a [Axis], along: &Along) -> Result<Vec<(&'a Axis, Node)>, SceneError> {
    let name = |axis: &Axis| axis.parameter().name.to_string();
    let names = axes.iter().map(name).collect::<Vec<_>>().join(", ");
    let place = |option, argument: &str| Place::Option { option, argument: argument.into() };
    let along_place = || place("--along", &along.parameter);
    if !axes.iter().any(|axis| *axis.parameter().name == *along.parameter) {
        let remedy = format!("the scene does not sweep it; its axes: {names}");
        let problem = Problem::value(Fault::Conflict, "along", &along.parameter, remedy);
        return Err(SceneError { place: along_place(), problem });
    }
    let mut fixed: Vec<(&Axis, Node)> = Vec::new();
    for argument in &along.at {
        let fail = |problem| SceneError { place: place("--at", argument), problem };
        let assigned = argument.split_once('=').map(|(name, value)| (name.trim(), value.trim()));
        let Some((name, value)) = assigned.filter(|(name, value)| !name.is_empty() && !value.is_empty())
        else {
            return Err(fail(Problem::NotAnAssignment));
        };
        let conflict = |remedy: &str| fail(Problem::value(Fault::Conflict, name, value, remedy));
        if name == along.parameter {
            return Err(conflict("--along sweeps it; --at is for the other axis"));
        }
        let Some(axis) = axes.iter().find(|axis| *axis.parameter().name == *name) else {
            return Err(conflict(&format!(
                "the scene does not sweep it, so there is no axis to fix; its axes: {names}; set a parameter with \
                 --set {name}={value}"
            )));
        };
        if fixed.iter().any(|(other, _)| other.target() == axis.target()) {
            return Err(conflict("--at names it twice; remove one of the two"));
        }
        let argument: Arc<str> = argument.as_str().into();
        let node = read_argument(value, &argument).placed(place("--at", &argument));
        fixed.push((axis, node));
    }
    let is_open = |axis: &&Axis| {
        *axis.parameter().name != *along.parameter
            && !fixed.iter().any(|(other, _)| other.target() == axis.target())
    };
    if let Some(axis) = axes.iter().find(is_open) {
        let name = &axis.parameter().name;
        let problem = Problem::Missing {
            field: format!("--at {name}=VALUE"),
            remedy: format!("the scene sweeps {names}: give the value of {name} on the line"),
        };
        return Err(SceneError { place: along_place(), problem });
    }
    Ok(fixed)
}

/// Removes all axes but one.
fn keep_one(root: &mut Table, place: Option<usize>) {
    let Some(Node { value: Value::List(tables), .. }) = root.get_mut("axis") else { return };
    if let Some(place) = place {
        let only = tables.swap_remove(place);
        *tables = vec![only];
    }
}

/// Sets a parameter whose axis was removed. It is an error if the scene sets the parameter to another value. As in a
/// map, an axis that is named by an argument overrides a value in the text.
fn fix(root: &mut Table, name: &str, value: Node, is_argument: bool) -> Result<(), SceneError> {
    let place = value.place.clone();
    let empty = || Node {
        name_place: place.clone(),
        place: place.clone(),
        excerpt: "{ ... }".into(),
        value: Value::Table(Table::new()),
    };
    let parameters = root.entry("parameters".to_owned()).or_insert_with(empty);
    // Anything but a table is refused later, when it is read.
    let Value::Table(table) = &mut parameters.value else { return Ok(()) };
    match table.insert(name.to_owned(), value) {
        Some(other) if !is_argument || !is_from_text(&other) => Err(SceneError {
            place: other.place,
            problem: Problem::value(
                Fault::Conflict,
                format!("parameters.{name}"),
                other.excerpt,
                format!("--at gives `{name}` its value; remove one of the two"),
            ),
        }),
        _ => Ok(()),
    }
}

/// Removes settings in the text that only maps have. Those in arguments are refused later, when they are read.
fn remove_map_settings(root: &mut Table) {
    root.retain(|name, node| name != "refine" || !is_from_text(node));
    if let Some(Node { value: Value::Table(start), .. }) = root.get_mut("start") {
        start.retain(|name, node| !["count", "seed"].contains(&name.as_str()) || !is_from_text(node));
    }
    let Some(Node { value: Value::Table(outputs), .. }) = root.get_mut("outputs") else { return };
    let Some(Node { value: Value::List(files), .. }) = outputs.get_mut("files") else { return };
    let is_map_file = |node: &Node| match &node.value {
        Value::Text(name) => [Format::Html, Format::Npy].iter().any(|format| format.name() == name),
        _ => false,
    };
    files.retain(|node| !is_map_file(node) || !is_from_text(node));
    // An empty list is an error; without the field the default applies.
    if files.is_empty() {
        outputs.remove("files");
    }
}

/// Whether all parts of a value come from the scene's text.
fn is_from_text(node: &Node) -> bool {
    let of_children = match &node.value {
        Value::Table(table) => table.values().all(is_from_text),
        Value::List(items) => items.iter().all(is_from_text),
        _ => true,
    };
    of_children && !matches!(node.place, Place::Set { .. })
}
