//! Reading one table of a scene: known names only, typed fields, errors with paths.

use std::ops::RangeInclusive;

use super::document::{Node, Table, Value, shorten};
use super::error::{Place, Problem, SceneError, suggest};
use rattlemap_dynamics::model::ModelError;

/// A table whose field names have been checked; an absent one has no fields.
pub(super) struct Section<'a> {
    path: String,
    place: Place,
    table: Option<&'a Table>,
}

impl<'a> Section<'a> {
    /// Opens the table `node` that stands at `path` and may have the fields `known`.
    pub(super) fn open(node: &'a Node, path: &str, known: &[&str]) -> Result<Self, SceneError> {
        Section::open_among(node, path, known, &known.join(", "))
    }

    /// The same where `all` says what the known names mean.
    fn open_among(node: &'a Node, path: &str, known: &[&str], all: &str) -> Result<Self, SceneError> {
        let Value::Table(table) = &node.value else {
            return Err(Field { path: path.to_owned(), node }.wrong_type(&format!("a table, [{path}]")));
        };
        let section = Section { path: path.to_owned(), place: node.name_place.clone(), table: Some(table) };
        let mut unknown = table.iter().filter(|(name, _)| !known.contains(&name.as_str()));
        let Some((name, node)) = unknown.next() else { return Ok(section) };
        // One is shown; a list of thousands would help nobody.
        let remedy = match unknown.count() {
            0 => suggest(name, known, all),
            1 => format!("{}; 1 more field beside it is unknown", suggest(name, known, all)),
            more => format!("{}; {more} more fields beside it are unknown", suggest(name, known, all)),
        };
        let problem = Problem::UnknownField {
            field: section.path_of(&shorten(name)),
            value: node.shown.clone(),
            remedy,
        };
        Err(SceneError { place: node.name_place.clone(), problem })
    }

    /// Opens the table `name` inside this one; if it is absent every field has its default.
    pub(super) fn section(&self, name: &str, known: &[&str]) -> Result<Section<'a>, SceneError> {
        self.section_among(name, known, &known.join(", "))
    }

    /// The same where `all` says what the known names mean.
    pub(super) fn section_among(
        &self,
        name: &str,
        known: &[&str],
        all: &str,
    ) -> Result<Section<'a>, SceneError> {
        match self.get(name) {
            Some(field) => Section::open_among(field.node, &field.path, known, all),
            None => Ok(Section { path: self.path_of(name), place: self.place.clone(), table: None }),
        }
    }

    /// The path that names the table.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// The fields that were given, in the order of their names.
    pub(super) fn fields(&self) -> impl Iterator<Item = (&'a str, Field<'a>)> {
        let given = self.table.into_iter().flatten();
        given.map(|(name, node)| (name.as_str(), Field { path: self.path_of(name), node }))
    }

    /// Whether the table was written at all.
    pub(super) fn is_present(&self) -> bool {
        self.table.is_some()
    }

    /// The field `name`, if it was given.
    pub(super) fn get(&self, name: &str) -> Option<Field<'a>> {
        let node = self.table?.get(name)?;
        Some(Field { path: self.path_of(name), node })
    }

    /// The field `name`, which must be given; `remedy` says what to write.
    pub(super) fn require(&self, name: &str, remedy: &str) -> Result<Field<'a>, SceneError> {
        self.get(name).ok_or_else(|| self.missing(name, remedy))
    }

    /// The error for a field that should be here.
    pub(super) fn missing(&self, name: &str, remedy: &str) -> SceneError {
        let problem = Problem::Missing { field: self.path_of(name), remedy: remedy.to_owned() };
        SceneError { place: self.place.clone(), problem }
    }

    /// The error for a cell in which the model has no motion; `cell` is empty where there is one alone.
    pub(super) fn no_motion(&self, cell: &str, reason: &ModelError) -> SceneError {
        let problem = Problem::NoMotion { cell: cell.to_owned(), reason: Box::new(reason.clone()) };
        SceneError { place: self.place.clone(), problem }
    }

    fn path_of(&self, name: &str) -> String {
        match self.path.is_empty() {
            true => name.to_owned(),
            false => format!("{}.{name}", self.path),
        }
    }
}

/// A value together with the path that names it.
pub(super) struct Field<'a> {
    pub(super) path: String,
    pub(super) node: &'a Node,
}

impl<'a> Field<'a> {
    /// Whether a `--set` argument says it: that wins over the text.
    pub(super) fn is_argument(&self) -> bool {
        matches!(self.node.place, Place::Set { .. })
    }

    /// Any number, also NaN and infinities, which TOML can write: ranges are checked after.
    pub(super) fn number(&self) -> Result<f64, SceneError> {
        match self.node.value {
            Value::Integer(i) => Ok(i as f64),
            Value::Float(x) => Ok(x),
            _ => Err(self.wrong_type("a number")),
        }
    }

    /// A whole number within `range`.
    pub(super) fn whole(&self, range: RangeInclusive<u32>) -> Result<u32, SceneError> {
        let requirement = format!("a whole number from {} to {}", range.start(), range.end());
        match self.node.value {
            Value::Integer(i) => u32::try_from(i)
                .ok()
                .filter(|count| range.contains(count))
                .ok_or_else(|| self.out_of_range(&requirement)),
            _ => Err(self.wrong_type(&requirement)),
        }
    }

    /// Text.
    pub(super) fn text(&self) -> Result<&'a str, SceneError> {
        match &self.node.value {
            Value::Text(text) => Ok(text),
            _ => Err(self.wrong_type("text in quotes")),
        }
    }

    /// `true` or `false`.
    pub(super) fn flag(&self) -> Result<bool, SceneError> {
        match self.node.value {
            Value::Flag(flag) => Ok(flag),
            _ => Err(self.wrong_type("true or false")),
        }
    }

    /// One of the names in `choices`.
    pub(super) fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Result<T, SceneError> {
        let names: Vec<&str> = choices.iter().map(|&(name, _)| name).collect();
        let Value::Text(name) = &self.node.value else {
            return Err(self.wrong_type(&format!("one of {}", names.join(", "))));
        };
        match choices.iter().find(|(known, _)| known == name) {
            Some(&(_, choice)) => Ok(choice),
            None => Err(self.unknown_name(name, &names)),
        }
    }

    /// The elements of a list, each with the path `field.index`.
    pub(super) fn list(&self, expected: &str) -> Result<Vec<Field<'a>>, SceneError> {
        let Value::List(items) = &self.node.value else { return Err(self.wrong_type(expected)) };
        let element = |(i, node)| Field { path: format!("{}.{i}", self.path), node };
        Ok(items.iter().enumerate().map(element).collect())
    }

    /// A list of names from `choices` without repetition, at least one of them.
    pub(super) fn choices<T: Copy + PartialEq>(&self, choices: &[(&str, T)]) -> Result<Vec<T>, SceneError> {
        let names = choices.iter().map(|&(name, _)| name).collect::<Vec<_>>().join(", ");
        let mut chosen = Vec::new();
        for item in self.list(&format!("a list of {names}"))? {
            let choice = item.choice(choices)?;
            if !chosen.contains(&choice) {
                chosen.push(choice);
            }
        }
        match chosen.is_empty() {
            true => Err(self.out_of_range(&format!("at least one of {names}"))),
            false => Ok(chosen),
        }
    }

    pub(super) fn wrong_type(&self, expected: &str) -> SceneError {
        let (field, value) = self.named();
        self.error(Problem::WrongType { field, value, expected: expected.to_owned() })
    }

    pub(super) fn out_of_range(&self, requirement: &str) -> SceneError {
        let (field, value) = self.named();
        self.error(Problem::OutOfRange { field, value, requirement: requirement.to_owned() })
    }

    pub(super) fn conflict(&self, remedy: String) -> SceneError {
        let (field, value) = self.named();
        self.error(Problem::Conflict { field, value, remedy })
    }

    pub(super) fn unknown_name(&self, name: &str, known: &[&str]) -> SceneError {
        self.unknown_among(name, known, &known.join(", "))
    }

    /// The same where `all` says what the known names mean.
    pub(super) fn unknown_among(&self, name: &str, known: &[&str], all: &str) -> SceneError {
        let (field, value) = self.named();
        self.error(Problem::UnknownName { field, value, remedy: suggest(name, known, all) })
    }

    /// The error for a cell in which the field's value leaves no motion.
    pub(super) fn no_motion(&self, cell: &str, reason: &ModelError) -> SceneError {
        self.error(Problem::NoMotion { cell: cell.to_owned(), reason: Box::new(reason.clone()) })
    }

    /// The error for text that cannot be read as what it should be; `reason` says why, and how to mend it.
    pub(super) fn unreadable(&self, reason: &str) -> SceneError {
        let (field, value) = self.named();
        self.error(Problem::UnreadableValue { field, value, reason: reason.to_owned() })
    }

    /// The error for a name within text that is none of the known ones.
    pub(super) fn unknown_in(&self, name: &str, known: &[&str], all: &str) -> SceneError {
        let (field, value) = self.named();
        let remedy = format!("`{}`: {}", shorten(name), suggest(name, known, all));
        self.error(Problem::UnknownWithin { field, value, remedy })
    }

    fn named(&self) -> (String, String) {
        (self.path.clone(), self.node.shown.clone())
    }

    fn error(&self, problem: Problem) -> SceneError {
        SceneError { place: self.node.place.clone(), problem }
    }
}
