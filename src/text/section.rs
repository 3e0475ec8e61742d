//! Reads one table of a scene or a model: checks the names of fields and their types, and builds errors with paths.

use std::ops::RangeInclusive;

use super::document::{Node, Table, Value};
use super::error::shorten;
use super::error::{Fault, Place, Problem, SceneError, suggest};
use super::expression::{Expression, ExpressionError};
use rattlemap_dynamics::model::ModelError;

/// A table whose field names have been checked. A missing table has no fields.
pub(crate) struct Section<'a> {
    path: String,
    place: Place,
    table: Option<&'a Table>,
}

impl<'a> Section<'a> {
    /// Opens the table `node` at `path`, which may have the fields `known`.
    pub(crate) fn open(node: &'a Node, path: &str, known: &[&str]) -> Result<Self, SceneError> {
        Section::open_among(node, path, known, &known.join(", "))
    }

    /// Opens the table `node` at `path`; messages list the known names as `all`.
    pub(crate) fn open_among(
        node: &'a Node,
        path: &str,
        known: &[&str],
        all: &str,
    ) -> Result<Self, SceneError> {
        let Value::Table(table) = &node.value else {
            return Err(Field { path: path.to_owned(), node }.wrong_type(&format!("a table, [{path}]")));
        };
        let section = Section { path: path.to_owned(), place: node.name_place.clone(), table: Some(table) };
        let mut unknown = table.iter().filter(|(name, _)| !known.contains(&name.as_str()));
        let Some((name, node)) = unknown.next() else { return Ok(section) };
        // The message shows one of them, because there may be thousands.
        let remedy = match unknown.count() {
            0 => suggest(name, known, all),
            1 => format!("{}; 1 more field is unknown", suggest(name, known, all)),
            more => format!("{}; {more} more fields are unknown", suggest(name, known, all)),
        };
        let (field, value) = (section.path_of(&shorten(name)), node.excerpt.clone());
        let problem = Problem::value(Fault::UnknownField, field, value, remedy);
        Err(SceneError { place: node.name_place.clone(), problem })
    }

    /// Opens a table whose field names were checked before; returns none if the value is not a table.
    pub(crate) fn open_any(node: &'a Node, path: &str) -> Option<Self> {
        let Value::Table(table) = &node.value else { return None };
        Some(Section { path: path.to_owned(), place: node.name_place.clone(), table: Some(table) })
    }

    /// Opens the table `name` inside this one. A missing table has no fields.
    pub(crate) fn section(&self, name: &str, known: &[&str]) -> Result<Section<'a>, SceneError> {
        self.section_among(name, known, &known.join(", "))
    }

    /// Opens the table `name` inside this one; messages list the known names as `all`.
    pub(crate) fn section_among(
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

    /// Returns the path of the table.
    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// Returns the given fields in the order of their names.
    pub(crate) fn fields(&self) -> impl Iterator<Item = (&'a str, Field<'a>)> {
        let fields = self.table.into_iter().flatten();
        fields.map(|(name, node)| (name.as_str(), Field { path: self.path_of(name), node }))
    }

    /// Returns the given fields in the order of the text.
    pub(crate) fn fields_as_written(&self) -> Vec<(&'a str, Field<'a>)> {
        let mut fields: Vec<_> = self.fields().collect();
        fields.sort_by_key(|(_, field)| field.node.name_place.line_and_column());
        fields
    }

    /// Whether the table is present.
    pub(crate) fn is_present(&self) -> bool {
        self.table.is_some()
    }

    /// Returns the field `name`, if it is given.
    pub(crate) fn get(&self, name: &str) -> Option<Field<'a>> {
        let node = self.table?.get(name)?;
        Some(Field { path: self.path_of(name), node })
    }

    /// Returns the field `name`, which must be given. `remedy` says what to write.
    pub(crate) fn require(&self, name: &str, remedy: &str) -> Result<Field<'a>, SceneError> {
        self.get(name).ok_or_else(|| self.missing(name, remedy))
    }

    /// Builds the error for a missing field.
    pub(crate) fn missing(&self, name: &str, remedy: &str) -> SceneError {
        let problem = Problem::Missing { field: self.path_of(name), remedy: remedy.to_owned() };
        SceneError { place: self.place.clone(), problem }
    }

    /// Builds the error for a cell in which the model has no motion. `cell` is empty if there is only one.
    pub(crate) fn no_motion(&self, cell: &str, reason: &ModelError) -> SceneError {
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

/// A value with its path.
pub(crate) struct Field<'a> {
    pub(crate) path: String,
    pub(crate) node: &'a Node,
}

impl<'a> Field<'a> {
    /// Whether the value comes from a `--set` argument, which overrides the text.
    pub(crate) fn is_argument(&self) -> bool {
        matches!(self.node.place, Place::Set { .. })
    }

    /// Reads a number, which may be NaN or infinite.
    pub(crate) fn number(&self) -> Result<f64, SceneError> {
        match self.node.value {
            Value::Integer(i) => Ok(i as f64),
            Value::Float(x) => Ok(x),
            _ => Err(self.no_number("a number")),
        }
    }

    /// Reads a number. The error for another type says `expected`.
    pub(crate) fn number_or(&self, expected: &str) -> Result<f64, SceneError> {
        match self.node.value {
            Value::Integer(_) | Value::Float(_) => self.number(),
            _ => Err(self.no_number(expected)),
        }
    }

    /// Builds the error for a value that must be a number and may have a decimal comma.
    fn no_number(&self, expected: &str) -> SceneError {
        let pointed = self.node.excerpt.replacen(',', ".", 1);
        match pointed.parse::<f64>() {
            Ok(_) => self.wrong_type(&format!("{expected}, with a decimal point: {pointed}")),
            Err(_) => self.wrong_type(expected),
        }
    }

    /// Reads a whole number within `range`.
    pub(crate) fn whole(&self, range: RangeInclusive<u32>) -> Result<u32, SceneError> {
        let requirement = format!("a whole number from {} to {}", range.start(), range.end());
        match self.node.value {
            Value::Integer(i) => u32::try_from(i)
                .ok()
                .filter(|count| range.contains(count))
                .ok_or_else(|| self.out_of_range(&requirement)),
            _ => Err(self.wrong_type(&requirement)),
        }
    }

    /// Reads text.
    pub(crate) fn text(&self) -> Result<&'a str, SceneError> {
        match &self.node.value {
            Value::Text(text) => Ok(text),
            _ => Err(self.wrong_type("text in quotes")),
        }
    }

    /// Reads one line of text with at most `most` characters.
    pub(crate) fn line(&self, most: usize) -> Result<String, SceneError> {
        self.text_without(char::is_control, "one line of text", most)
    }

    /// Reads lines of text with at most `most` characters.
    pub(crate) fn lines(&self, most: usize) -> Result<String, SceneError> {
        self.text_without(|c| c.is_control() && c != '\n', "lines of text", most)
    }

    fn text_without(
        &self,
        is_refused: impl Fn(char) -> bool,
        what: &str,
        most: usize,
    ) -> Result<String, SceneError> {
        let text = self.text()?;
        match text.chars().count() {
            0 => {
                Err(self
                    .out_of_range(&format!("{what}; it must not be empty; write some text, or remove it")))
            }
            count if count > most => {
                Err(self.out_of_range(&format!("at most {most} characters long; it has {count}, shorten it")))
            }
            _ if text.contains(is_refused) => {
                Err(self.out_of_range(&format!("{what}, without control characters")))
            }
            _ => Ok(text.to_owned()),
        }
    }

    /// Reads a number or an expression in `names`. Messages show `example`, and list the names as `all`.
    pub(crate) fn expression(
        &self,
        names: &[&str],
        all: &str,
        example: &str,
    ) -> Result<Expression, SceneError> {
        let text = match &self.node.value {
            Value::Text(text) => text.clone(),
            // A number is also an expression.
            Value::Integer(_) | Value::Float(_) => format!("{:?}", self.number()?),
            _ => return Err(self.wrong_type(&format!("an expression in quotes, such as {example}"))),
        };
        Expression::parse(&text, names).map_err(|error| match &error {
            ExpressionError::Unknown { name } => {
                let remedy = format!("`{}`: {}", shorten(name), suggest(name, names, all));
                self.refuse(Fault::UnknownWithin, remedy)
            }
            _ => self.unreadable(&error.to_string()),
        })
    }

    /// Reads `true` or `false`.
    pub(crate) fn flag(&self) -> Result<bool, SceneError> {
        match self.node.value {
            Value::Flag(flag) => Ok(flag),
            _ => Err(self.wrong_type("true or false")),
        }
    }

    /// Reads one of the names in `choices`.
    pub(crate) fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Result<T, SceneError> {
        let names: Vec<&str> = choices.iter().map(|&(name, _)| name).collect();
        let Value::Text(name) = &self.node.value else {
            return Err(self.wrong_type(&format!("one of {}", names.join(", "))));
        };
        match choices.iter().find(|(known, _)| known == name) {
            Some(&(_, choice)) => Ok(choice),
            None => Err(self.unknown_name(name, &names, &names.join(", "))),
        }
    }

    /// Returns the elements of a list, each with the path `field.index`.
    pub(crate) fn list(&self, expected: &str) -> Result<Vec<Field<'a>>, SceneError> {
        let Value::List(items) = &self.node.value else { return Err(self.wrong_type(expected)) };
        let element = |(i, node)| Field { path: format!("{}.{i}", self.path), node };
        Ok(items.iter().enumerate().map(element).collect())
    }

    /// Returns the elements of a list whose number is within `range`. `things` are the elements in messages.
    pub(crate) fn list_of(
        &self,
        range: RangeInclusive<usize>,
        things: &str,
        expected: &str,
    ) -> Result<Vec<Field<'a>>, SceneError> {
        let items = self.list(expected)?;
        if range.contains(&items.len()) {
            Ok(items)
        } else {
            Err(self.wrong_count(items.len(), things, expected))
        }
    }

    /// Returns the elements of a list that must have `count` of them.
    pub(crate) fn list_with(&self, count: usize, expected: &str) -> Result<Vec<Field<'a>>, SceneError> {
        let items = self.list(expected)?;
        if items.len() == count { Ok(items) } else { Err(self.out_of_range(expected)) }
    }

    /// Reads a list of one or more names from `choices`. Repeated names are ignored.
    pub(crate) fn choices<T: Copy + PartialEq>(&self, choices: &[(&str, T)]) -> Result<Vec<T>, SceneError> {
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

    /// Builds the error for a value of the wrong type.
    pub(crate) fn wrong_type(&self, expected: &str) -> SceneError {
        self.refuse(Fault::WrongType, expected.to_owned())
    }

    /// Builds the error for a value outside its range.
    pub(crate) fn out_of_range(&self, requirement: &str) -> SceneError {
        self.refuse(Fault::OutOfRange, requirement.to_owned())
    }

    /// Builds the error for a list with `count` elements, such as `tables`, where another number is required.
    pub(crate) fn wrong_count(&self, count: usize, things: &str, requirement: &str) -> SceneError {
        self.error(Problem::value(Fault::OutOfRange, &self.path, format!("{count} {things}"), requirement))
    }

    /// Builds the error for a value that contradicts another field.
    pub(crate) fn conflict(&self, remedy: impl Into<String>) -> SceneError {
        self.refuse(Fault::Conflict, remedy.into())
    }

    /// Builds the error for a field that belongs to another kind of file.
    pub(crate) fn misplaced(&self, remedy: &str) -> SceneError {
        let problem = Problem::value(Fault::Conflict, &self.path, &self.node.excerpt, remedy);
        SceneError { place: self.node.name_place.clone(), problem }
    }

    /// Builds the error for a value that is none of the `known` names; the message lists them as `list`.
    pub(crate) fn unknown_name(&self, name: &str, known: &[&str], list: &str) -> SceneError {
        self.refuse(Fault::UnknownName, suggest(name, known, list))
    }

    /// Builds the error for a cell in which this field's value leaves no motion.
    pub(crate) fn no_motion(&self, cell: &str, reason: &ModelError) -> SceneError {
        self.error(Problem::NoMotion { cell: cell.to_owned(), reason: Box::new(reason.clone()) })
    }

    /// Builds the error for text that cannot be read; `reason` says why and names the remedy.
    pub(crate) fn unreadable(&self, reason: &str) -> SceneError {
        self.refuse(Fault::Unreadable, reason.to_owned())
    }

    fn refuse(&self, fault: Fault, detail: String) -> SceneError {
        self.error(Problem::value(fault, &self.path, &self.node.excerpt, detail))
    }

    fn error(&self, problem: Problem) -> SceneError {
        SceneError { place: self.node.place.clone(), problem }
    }
}
