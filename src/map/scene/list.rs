//! `[cells]`: a table of cells instead of axes.

use std::fmt::Write;

use sha2::{Digest, Sha256};

use super::Purpose;
use super::axis::{Target, component, meanings, names};
use super::error::{Fault, Place, Problem, SceneError, suggest};
use super::keys;
use super::section::Section;
use crate::text::error::shorten;
use rattlemap_dynamics::model::{Model, Parameter};

/// A file that a scene names, as the caller has read it.
#[derive(Clone, Debug)]
pub struct FileText {
    /// Name of the file in messages.
    pub name: String,
    /// Contents of the file.
    pub text: String,
}

/// Purposes for which a scene names a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompanionFile {
    /// A table of cells.
    Cells,
    /// A model.
    Model,
}

/// Reads a file that a scene names. The error says why it cannot be read.
pub type FindFile<'f> = &'f dyn Fn(CompanionFile, &str) -> Result<FileText, String>;

/// A list of cells: columns set parameters or components of the start, rows are cells.
#[derive(Clone, Debug)]
pub struct List {
    file: String,
    columns: Vec<ListColumn>,
    /// All rows, one after the other.
    values: Vec<f64>,
    hash: String,
}

/// The quantity that one column sets.
#[derive(Clone, Debug)]
struct ListColumn {
    parameter: Parameter,
    target: Target,
}

impl List {
    /// Returns the file's name in the scene.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Returns the parameters or components of the start that the columns set.
    pub fn parameters(&self) -> impl ExactSizeIterator<Item = &Parameter> {
        self.columns.iter().map(|column| &column.parameter)
    }

    /// Returns the number of cells, at least 1.
    pub fn len(&self) -> usize {
        self.values.len() / self.columns.len()
    }

    /// Whether the list has no cells; always false.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns the values of a cell, one per column.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn row(&self, cell: usize) -> &[f64] {
        let columns = self.columns.len();
        &self.values[cell * columns..(cell + 1) * columns]
    }

    /// Returns the SHA-256 hash of the columns' names and the values.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// Writes the list as CSV that reads back as an equal list: names, then numbers as shortest decimals.
    pub fn to_csv(&self) -> String {
        let names: Vec<&str> = self.parameters().map(|parameter| &*parameter.name).collect();
        let mut text = names.join(",") + "\n";
        for cell in 0..self.len() {
            for (i, value) in self.row(cell).iter().enumerate() {
                // Writing to a String cannot fail.
                let _ = write!(text, "{}{value:?}", if i > 0 { "," } else { "" });
            }
            text.push('\n');
        }
        text
    }

    /// Returns the quantities that the columns set.
    pub(crate) fn targets(&self) -> impl ExactSizeIterator<Item = Target> {
        self.columns.iter().map(|column| column.target)
    }
}

/// Reads `[cells]` and the file that it names; returns none if the scene has no such table.
pub(super) fn read(
    root: &Section<'_>,
    model: &dyn Model,
    purpose: Purpose,
    find: FindFile<'_>,
) -> Result<Option<List>, SceneError> {
    let section = root.section("cells", &keys::names("cells"))?;
    let Some(cells) = root.get("cells") else { return Ok(None) };
    if purpose == Purpose::Bifurcation {
        return Err(cells.conflict("`bifurcation` needs an axis; a list of cells is for `map`"));
    }
    if let Some(axis) = root.get("axis") {
        return Err(axis.conflict("[cells] lists the cells instead of axes; remove [[axis]] or [cells]"));
    }
    let field = section.require("file", "name a table, such as file = \"points.csv\"")?;
    let file = field.text()?.to_owned();
    let found = find(CompanionFile::Cells, &file).map_err(|reason| field.unreadable(&reason))?;
    let (columns, values) = table(&found, model)?;
    let names: Vec<&str> = columns.iter().map(|column| &*column.parameter.name).collect();
    let hash = hash(&names, values.iter().copied());
    Ok(Some(List { file, columns, values, hash }))
}

/// Computes the SHA-256 hash of names and of the bits of numbers.
pub(super) fn hash(names: &[&str], values: impl Iterator<Item = f64>) -> String {
    let mut hasher = Sha256::new();
    for name in names {
        hasher.update(name.as_bytes());
        hasher.update([0]);
    }
    values.for_each(|value| hasher.update(value.to_le_bytes()));
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Reads the columns and values of a table.
fn table(file: &FileText, model: &dyn Model) -> Result<(Vec<ListColumn>, Vec<f64>), SceneError> {
    // Spreadsheets write a byte-order mark at the beginning.
    let text = file.text.strip_prefix('\u{feff}').unwrap_or(&file.text);
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let damaged = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        let message = match error.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                format!("the line has {} and the first line {expected_len}", fields(*len))
            }
            _ => error.to_string(),
        };
        wrong(file, line, 1, Problem::Table { message })
    };
    let header = reader.headers().map_err(damaged)?.clone();
    let columns = columns(file, &header, model)?;
    let mut values = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(damaged)? {
        let line = record.position().map_or(0, csv::Position::line);
        for (i, (column, text)) in columns.iter().zip(&record).enumerate() {
            let (field, value) = (column.parameter.name.to_string(), shorten(text));
            let at = |problem| wrong(file, line, i + 1, problem);
            let number: f64 =
                text.parse().map_err(|_| at(Problem::value(Fault::WrongType, &field, &value, "a number")))?;
            if !column.parameter.range.contains(number) {
                let requirement = column.parameter.range.requirement();
                return Err(at(Problem::value(Fault::OutOfRange, field, value, requirement)));
            }
            values.push(number);
        }
    }
    if values.is_empty() {
        let message = "it has no cells; write a line of numbers for each cell".to_owned();
        return Err(wrong(file, 1, 1, Problem::Table { message }));
    }
    Ok((columns, values))
}

fn columns(
    file: &FileText,
    header: &csv::StringRecord,
    model: &dyn Model,
) -> Result<Vec<ListColumn>, SceneError> {
    let mut columns: Vec<ListColumn> = Vec::new();
    for (i, name) in header.iter().enumerate() {
        let (field, value) = (format!("column {}", i + 1), shorten(name));
        let at = |problem| wrong(file, 1, i + 1, problem);
        let components = model.state_names();
        let (target, parameter) =
            match (model.index(name), components.iter().position(|known| *known == name)) {
                (Ok(index), _) => (Target::Parameter(index), model.parameters()[index].clone()),
                (Err(_), Some(place)) => (Target::Start(place), component(model, place)),
                (Err(_), None) => {
                    let all =
                        format!("{}; components of the start: {}", meanings(model), components.join(", "));
                    let remedy = suggest(name, &[names(model), components].concat(), &all);
                    return Err(at(Problem::value(Fault::UnknownName, field, value, remedy)));
                }
            };
        if columns.iter().any(|before| before.target == target) {
            let remedy = "another column sets it; remove one of the two";
            return Err(at(Problem::value(Fault::Conflict, field, value, remedy)));
        }
        columns.push(ListColumn { parameter, target });
    }
    match columns.is_empty() {
        false => Ok(columns),
        true => {
            let message =
                "it is empty; write a line with parameter names, then a line of numbers for each cell";
            Err(wrong(file, 1, 1, Problem::Table { message: message.to_owned() }))
        }
    }
}

fn fields(count: u64) -> String {
    if count == 1 { "1 field".to_owned() } else { format!("{count} fields") }
}

/// Builds an error at a place in a table. `column` counts fields, not characters.
fn wrong(file: &FileText, line: u64, column: usize, problem: Problem) -> SceneError {
    let place = Place::Text { file: file.name.as_str().into(), line: line as usize, column };
    SceneError { place, problem }
}

/// Refuses settings that need neighbouring cells.
pub(super) fn check(root: &Section<'_>, follows: bool) -> Result<(), SceneError> {
    if let Some(refine) = root.get("refine") {
        return Err(refine.conflict("cells of a list have no neighbours to be filled from; remove [refine]"));
    }
    let policy = root.section("start", &keys::names("start"))?.get("policy");
    policy.filter(|_| follows).map_or(Ok(()), |policy| {
        Err(policy.conflict("cells of a list have no neighbours to start from; use \"rest\" or \"state\""))
    })
}
