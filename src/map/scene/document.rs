//! A scene's text as a tree in which every value knows where it came from.
//!
//! Serde would lose that knowledge as soon as a range is checked after parsing, and
//! `--set` would have none to give.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Place, Problem, SceneError};

/// The fields of a table by name.
pub(super) type Table = BTreeMap<String, Node>;

/// One value of the tree.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Where its name stands; the value itself where it has none.
    pub(super) name_place: Place,
    /// Where the value stands.
    pub(super) place: Place,
    /// The value as it was written, shortened for messages.
    pub(super) shown: String,
    /// The value.
    pub(super) value: Value,
}

/// TOML's types, as far as scenes use them.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Integer(i64),
    Float(f64),
    Text(String),
    Flag(bool),
    List(Vec<Node>),
    Table(Table),
    /// A date, or an integer too large for its type.
    Other,
}

/// Reads TOML text; `file` is the name that messages give it.
pub(super) fn read(text: &str, file: &str) -> Result<Node, SceneError> {
    let source = Source { text, file: file.into() };
    let table = DeTable::parse(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        let (line, _) = source.line_and_column(at);
        let line = shorten(text.lines().nth(line - 1).unwrap_or_default());
        source.error(at, Problem::Syntax { message: error.message().replace('\n', ", "), line })
    })?;
    Ok(Node {
        name_place: source.place(0),
        place: source.place(0),
        shown: "the scene".into(),
        value: Value::Table(source.table(table.into_inner())),
    })
}

/// Reads the value of a `--set` argument. Bare words are text, so that shells need no
/// second layer of quotes.
pub(super) fn read_argument(value: &str, argument: &Arc<str>) -> Node {
    let parsed = match DeValue::parse(value) {
        Ok(parsed) => Source { text: value, file: "".into() }.value(parsed.into_inner()),
        Err(_) => value.parse().map_or_else(|_| Value::Text(value.to_owned()), Value::Float),
    };
    let place = Place::Set { argument: argument.clone() };
    let mut node = Node { name_place: place.clone(), place, shown: shorten(value), value: parsed };
    node.relocate();
    node
}

impl Node {
    /// The same tree with everything in one place.
    pub(super) fn placed(mut self, place: Place) -> Node {
        (self.place, self.name_place) = (place.clone(), place);
        self.relocate();
        self
    }

    /// Gives list elements the place of the whole: a `--set` argument has no lines.
    fn relocate(&mut self) {
        let place = self.place.clone();
        let children: Box<dyn Iterator<Item = &mut Node>> = match &mut self.value {
            Value::List(items) => Box::new(items.iter_mut()),
            Value::Table(table) => Box::new(table.values_mut()),
            _ => return,
        };
        for child in children {
            child.place = place.clone();
            child.name_place = place.clone();
            child.relocate();
        }
    }
}

/// The text that spans point into.
struct Source<'a> {
    text: &'a str,
    file: Arc<str>,
}

impl Source<'_> {
    fn table(&self, table: DeTable<'_>) -> Table {
        let entry = |(key, value): (Spanned<_>, Spanned<DeValue<'_>>)| {
            let name_place = self.place(key.span().start);
            let name: std::borrow::Cow<'_, str> = key.into_inner();
            (name.into_owned(), Node { name_place, ..self.node(value) })
        };
        table.into_iter().map(entry).collect()
    }

    fn node(&self, value: Spanned<DeValue<'_>>) -> Node {
        let span = value.span();
        let place = self.place(span.start);
        let shown = self.shown(span, value.get_ref());
        Node { name_place: place.clone(), place, shown, value: self.value(value.into_inner()) }
    }

    fn value(&self, value: DeValue<'_>) -> Value {
        match value {
            DeValue::Integer(i) => {
                i64::from_str_radix(i.as_str(), i.radix()).map_or(Value::Other, Value::Integer)
            }
            DeValue::Float(x) => x.as_str().parse().map_or(Value::Other, Value::Float),
            DeValue::String(s) => Value::Text(s.into_owned()),
            DeValue::Boolean(b) => Value::Flag(b),
            DeValue::Array(items) => Value::List(items.into_iter().map(|item| self.node(item)).collect()),
            DeValue::Table(table) => Value::Table(self.table(table)),
            DeValue::Datetime(_) => Value::Other,
        }
    }

    fn shown(&self, span: Range<usize>, value: &DeValue<'_>) -> String {
        match value {
            // The span of a table is its header, which says nothing as a value.
            DeValue::Table(_) => "{ ... }".to_owned(),
            _ => shorten(self.text.get(span).unwrap_or_default()),
        }
    }

    fn place(&self, offset: usize) -> Place {
        let (line, column) = self.line_and_column(offset);
        Place::Text { file: self.file.clone(), line, column }
    }

    fn error(&self, offset: usize, problem: Problem) -> SceneError {
        SceneError { place: self.place(offset), problem }
    }

    fn line_and_column(&self, offset: usize) -> (usize, usize) {
        let before = self.text.get(..offset).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// One line of at most 60 characters.
fn shorten(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let line = words.join(" ");
    match line.char_indices().nth(60) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}
