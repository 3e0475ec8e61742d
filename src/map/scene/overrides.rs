//! `--set NAME=VALUE`: arguments that override the scene's text.

use std::sync::Arc;

use super::TOP_LEVEL;
use super::document::{Node, Table, Value, read_argument};
use super::error::{Fault, Place, Problem, SceneError};
use crate::text::error::shorten;

/// Largest number of names in a path: more than any setting has, and few enough for recursion.
const DEEPEST: usize = 8;

/// Writes the value of one `NAME=VALUE` argument into the tree.
///
/// `e=0.6` means `parameters.e`. Other settings need their full path; axes are numbered from 0. Names are checked
/// later, when the tree is read.
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
        let (field, value) = (shorten(&path.join(".")), node.excerpt.clone());
        fail(Problem::value(Fault::UnknownField, field, value, remedy))
    };
    if path.len() > DEEPEST {
        return Err(unknown(
            "no setting has so many names; the longest paths are such as axis.0.count".to_owned(),
        ));
    }
    insert(document, &path, &node).map_err(unknown)
}

/// Puts `leaf` at `path` below `parent` and creates missing tables. The error is the remedy for the message.
fn insert(parent: &mut Node, path: &[&str], leaf: &Node) -> Result<(), String> {
    let (name, rest) = match path {
        [] => {
            // The node gets the place of the argument, not of the value that it replaces.
            *parent = leaf.clone();
            return Ok(());
        }
        [name, rest @ ..] => (*name, rest),
    };
    match &mut parent.value {
        Value::Table(table) => {
            let empty =
                || Node { value: Value::Table(Table::new()), excerpt: "{ ... }".into(), ..leaf.clone() };
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
        _ => Err(format!("`{}` has no fields; remove `.{}`", parent.excerpt, shorten(name))),
    }
}
