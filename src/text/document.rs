//! The text of a scene or a model as a tree in which every value knows its place in the text.
//!
//! Serde would lose the places before ranges are checked, and `--set` arguments have none.

use std::collections::BTreeMap;
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Place, Problem, SceneError, shorten};

/// The fields of a table by name.
pub(crate) type Table = BTreeMap<String, Node>;

/// One value of the tree.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    /// Place of the name; that of the value if it has no name.
    pub(crate) name_place: Place,
    /// Place of the value.
    pub(crate) place: Place,
    /// The value as written, shortened for messages.
    pub(crate) excerpt: String,
    /// The value.
    pub(crate) value: Value,
}

/// The types of TOML that scenes use.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Integer(i64),
    Float(f64),
    Text(String),
    Flag(bool),
    List(Vec<Node>),
    Table(Table),
    /// A date, or an integer that is too large.
    Other,
}

/// Reads TOML text. Messages call it `file`.
pub(crate) fn read(text: &str, file: &str) -> Result<Node, SceneError> {
    let source = Source::new(text, file);
    let table = DeTable::parse(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        let line = shorten(source.line_of(at));
        let problem = Problem::Syntax { message: error.message().replace('\n', ", "), line };
        SceneError { place: source.place(at), problem }
    })?;
    Ok(Node {
        name_place: source.place(0),
        place: source.place(0),
        excerpt: "the file".into(),
        value: Value::Table(source.table(table.into_inner())),
    })
}

/// Reads the value of a `--set` argument. Bare words are text, so that shells need no additional quotes.
pub(crate) fn read_argument(value: &str, argument: &Arc<str>) -> Node {
    let parsed = match DeValue::parse(value) {
        Ok(parsed) => Source::new(value, "").value(parsed.into_inner()),
        Err(_) => value.parse().map_or_else(|_| Value::Text(value.to_owned()), Value::Float),
    };
    let place = Place::Set { argument: argument.clone() };
    let mut node = Node { name_place: place.clone(), place, excerpt: shorten(value), value: parsed };
    node.relocate();
    node
}

impl Node {
    /// Returns the value for writing it as TOML; none for a type that scenes do not use.
    pub(crate) fn to_toml(&self) -> Option<toml::Value> {
        Some(match &self.value {
            Value::Integer(i) => (*i).into(),
            Value::Float(x) => (*x).into(),
            Value::Text(text) => text.as_str().into(),
            Value::Flag(flag) => (*flag).into(),
            Value::List(items) => toml::Value::Array(items.iter().filter_map(Node::to_toml).collect()),
            Value::Table(table) => {
                let fields = table.iter().filter_map(|(name, node)| Some((name.clone(), node.to_toml()?)));
                toml::Value::Table(fields.collect())
            }
            Value::Other => return None,
        })
    }

    /// Returns the tree with all values at one place.
    pub(crate) fn placed(mut self, place: Place) -> Node {
        (self.place, self.name_place) = (place.clone(), place);
        self.relocate();
        self
    }

    /// Gives all values below this one its place: a `--set` argument has no lines.
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

/// A text, prepared to convert byte offsets to lines and columns.
struct Source<'a> {
    text: &'a str,
    file: Arc<str>,
    /// Byte offsets at which lines begin.
    line_starts: Vec<usize>,
    /// Number of characters before every [`STRIDE`]th byte, so that columns of long lines are found quickly.
    characters: Vec<usize>,
}

/// Distance of the bytes up to which characters are counted in advance.
const STRIDE: usize = 64;

impl<'a> Source<'a> {
    /// Prepares a text in one pass.
    fn new(text: &'a str, file: &str) -> Source<'a> {
        let newlines = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let line_starts = std::iter::once(0).chain(newlines.map(|(at, _)| at + 1)).collect();
        let mut characters = vec![0];
        for chunk in text.as_bytes().chunks(STRIDE) {
            characters.push(characters[characters.len() - 1] + begun(chunk));
        }
        Source { text, file: file.into(), line_starts, characters }
    }

    /// Returns the number of characters that begin before a byte.
    fn characters_before(&self, offset: usize) -> usize {
        let chunk = offset / STRIDE;
        self.characters[chunk] + begun(&self.text.as_bytes()[chunk * STRIDE..offset])
    }

    /// Returns the number of the line, from 0, that contains a byte.
    fn line(&self, offset: usize) -> usize {
        self.line_starts.partition_point(|&start| start <= offset) - 1
    }

    /// Returns the line that contains a byte.
    fn line_of(&self, offset: usize) -> &'a str {
        let from = self.line_starts[self.line(offset.min(self.text.len()))];
        self.text[from..].lines().next().unwrap_or_default()
    }

    fn table(&self, table: DeTable<'_>) -> Table {
        let entry = |(key, value): (Spanned<std::borrow::Cow<'_, str>>, Spanned<DeValue<'_>>)| {
            let name_place = self.place(key.span().start);
            (key.into_inner().into_owned(), Node { name_place, ..self.node(value) })
        };
        table.into_iter().map(entry).collect()
    }

    fn node(&self, value: Spanned<DeValue<'_>>) -> Node {
        let span = value.span();
        let place = self.place(span.start);
        let excerpt = match value.get_ref() {
            // The span of a table is only its header.
            DeValue::Table(_) => "{ ... }".to_owned(),
            _ => shorten(self.text.get(span).unwrap_or_default()),
        };
        Node { name_place: place.clone(), place, excerpt, value: self.value(value.into_inner()) }
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

    fn place(&self, offset: usize) -> Place {
        let offset = offset.min(self.text.len());
        let line = self.line(offset);
        let column = self.characters_before(offset) - self.characters_before(self.line_starts[line]);
        Place::Text { file: self.file.clone(), line: line + 1, column: column + 1 }
    }
}

/// Counts the UTF-8 characters that begin in `bytes`.
fn begun(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&byte| byte & 0xc0 != 0x80).count()
}
