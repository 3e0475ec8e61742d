//! `--set NAME=VALUE`: values that win over the scene's own.

use std::sync::Arc;

use super::TOP_LEVEL;
use super::document::{Node, Table, Value, read_argument, shorten};
use super::error::{Fault, Place, Problem, SceneError};

/// Names in a path: more than any setting has, and few enough to go down by recursion.
const DEEPEST: usize = 8;

/// Writes the value of one `NAME=VALUE` argument into the tree.
///
/// `e=0.6` means `parameters.e`; other settings go by full path, axes by number from 0.
/// Names are not checked here: whoever reads the tree does that for every origin alike.
pub(super) fn apply(document: &mut Node, argument: &str) -> Result<(), SceneError> {
    let argument: Arc<str> = argument.into();
    let fail = |problem| SceneError { place: Place::Set { argument: argument.clone() }, problem };
    let (name, value) = match argument.split_once('=') {
        Some((name, value)) => (name.trim(), value.trim()),
        None => return Err(fail(Problem::NotAnAssignment)),
    };
    let mut path: Vec<&str> = name.split('.').map(str::trim).collect();
    if value.is_empty() || path.iter().any(|part| part.is_empty()) {
        return Err(fail(Problem::NotAnAssignment));
    }
    if path.len() == 1 && !TOP_LEVEL.contains(&path[0]) {
        path.insert(0, "parameters");
    }
    let node = read_argument(value, &argument);
    let unknown = |remedy| {
        let (field, value) = (shorten(&path.join(".")), node.shown.clone());
        fail(Problem::value(Fault::UnknownField, field, value, remedy))
    };
    if path.len() > DEEPEST {
        return Err(unknown("no setting lies as deep; the deepest are such as axis.0.count".to_owned()));
    }
    insert(document, &path, &node).map_err(unknown)
}

/// Puts `leaf` at `path` below `parent`, making tables on the way; the error is the remedy.
fn insert(parent: &mut Node, path: &[&str], leaf: &Node) -> Result<(), String> {
    let (name, rest) = match path {
        [] => {
            // Keep the place of the argument, not of the value that it replaces.
            *parent = leaf.clone();
            return Ok(());
        }
        [name, rest @ ..] => (*name, rest),
    };
    match &mut parent.value {
        Value::Table(table) => {
            let empty =
                || Node { value: Value::Table(Table::new()), shown: "{ ... }".into(), ..leaf.clone() };
            insert(table.entry(name.to_owned()).or_insert_with(empty), rest, leaf)
        }
        Value::List(items) => {
            let count = items.len();
            match name.parse().ok().and_then(|i: usize| items.get_mut(i)) {
                Some(item) => insert(item, rest, leaf),
                None => Err(format!(
                    "`{}` must be a number below {count}: the list has that many entries, counted from 0",
                    shorten(name)
                )),
            }
        }
        _ => Err(format!("`{}` has no fields; drop `.{}`", parent.shown, shorten(name))),
    }
}
