//! Why a scene or a model is refused, with the place, the value and the remedy.

use std::fmt;
use std::sync::Arc;

use super::document::shorten;
use super::printable;
use rattlemap_dynamics::model::ModelError;
use thiserror::Error;

/// Where the text that has to change stands.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// A spot in a scene file; line and column count from 1, columns in characters.
    Text {
        /// The file as it was named by the caller.
        file: Arc<str>,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
    },
    /// A `--set` argument, which wins over the file.
    Set {
        /// `NAME=VALUE` as it was given.
        argument: Arc<str>,
    },
    /// Another argument: `--along` or `--at`.
    Option {
        /// The option's name, dashes included.
        option: &'static str,
        /// What was given with it.
        argument: Arc<str>,
    },
    /// A file that could not be read at all.
    File {
        /// The file as it was named by the caller.
        file: Arc<str>,
    },
    /// A scene that was built without a file.
    Builder,
}

impl Place {
    /// Where it stands in its text; none where it is in none.
    pub(crate) fn line_and_column(&self) -> Option<(usize, usize)> {
        match self {
            Place::Text { line, column, .. } => Some((*line, *column)),
            _ => None,
        }
    }
}

/// Characters of a name or a value that a message shows.
pub(crate) const SHOWN: usize = 60;

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Text { file, line, column } => write!(f, "{file}:{line}:{column}"),
            Place::Set { argument } => write!(f, "--set {}", shorten(argument)),
            Place::Option { option, argument } => write!(f, "{option} {}", shorten(argument)),
            Place::File { file } => write!(f, "{file}"),
            Place::Builder => write!(f, "scene"),
        }
    }
}

/// A scene, or a model beside it, that cannot be run; its text is one line that says how to mend it, fit for a terminal.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{}", printable::line(&format!("{place}: {problem}")))]
pub struct SceneError {
    /// Where it stands.
    pub place: Place,
    /// What is wrong there.
    pub problem: Problem,
}

/// What can be wrong with a scene. Fields are full paths as `--set` takes them.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Problem {
    /// The file could not be read.
    #[error("cannot read the scene ({reason}); give the path of a TOML file such as scenes/smoke.toml")]
    Unreadable {
        /// The operating system's words.
        reason: String,
    },
    /// The text is not TOML.
    #[error("not valid TOML: {message}; the line reads `{line}`")]
    Syntax {
        /// The parser's words.
        message: String,
        /// The offending line.
        line: String,
    },
    /// A `--set` argument without a name, a value, or the equals sign between them.
    #[error("expected NAME=VALUE, such as e=0.6 or integration.max_period=32")]
    NotAnAssignment,
    /// A field that scenes do not have.
    #[error("unknown field `{field} = {value}`; {remedy}")]
    UnknownField {
        /// The field.
        field: String,
        /// Its value as written.
        value: String,
        /// The nearest known name, and all of them.
        remedy: String,
    },
    /// A value that must be one of a list of names and is not.
    #[error("`{field} = {value}` is not known; {remedy}")]
    UnknownName {
        /// The field.
        field: String,
        /// Its value as written.
        value: String,
        /// The nearest known name, and all of them.
        remedy: String,
    },
    /// A name within a value that is not known.
    #[error("`{field} = {value}` has an unknown name, {remedy}")]
    UnknownWithin {
        /// The field.
        field: String,
        /// Its value as written.
        value: String,
        /// The name, the nearest known one, and all of them.
        remedy: String,
    },
    /// Text, or a file that a field names, that cannot be read as what it should be.
    #[error("`{field} = {value}` {reason}")]
    UnreadableValue {
        /// The field.
        field: String,
        /// Its value as written.
        value: String,
        /// Why not, and what to write.
        reason: String,
    },
    /// A table of cells that is none.
    #[error("{message}")]
    Table {
        /// What is wrong there.
        message: String,
    },
    /// A value of the wrong type.
    #[error("`{field} = {value}` has the wrong type: it must be {expected}")]
    WrongType {
        /// The field.
        field: String,
        /// Its value as written.
        value: String,
        /// What it must be.
        expected: String,
    },
    /// A value outside its range.
    #[error("`{field} = {value}` is out of range: it must be {requirement}")]
    OutOfRange {
        /// The field.
        field: String,
        /// Its value as written.
        value: String,
        /// What it must be.
        requirement: String,
    },
    /// A required field that is not there.
    #[error("`{field}` is missing; {remedy}")]
    Missing {
        /// The field.
        field: String,
        /// What to write.
        remedy: String,
    },
    /// Parameters that are fine one by one, and together make no oscillator.
    #[error("{}{reason}; change the parameters", if .cell.is_empty() { String::new() } else { format!("at {cell}: ") })]
    NoMotion {
        /// The axes' values there; empty where there are no axes.
        cell: String,
        /// Why there is no motion.
        reason: Box<ModelError>,
    },
    /// A value that is fine by itself but not beside another.
    #[error("`{field} = {value}` does not fit: {remedy}")]
    Conflict {
        /// The field.
        field: String,
        /// Its value as written.
        value: String,
        /// The other value, and which one to change.
        remedy: String,
    },
}

/// The sentence for an unknown name: the nearest known one, if any is near, and `all` of them, listed.
pub(crate) fn suggest(name: &str, known: &[&str], all: &str) -> String {
    let length = name.chars().count();
    // One slip per three letters; a name that is all slips resembles nothing.
    let most = (length / 3).max(1).min(length.saturating_sub(1));
    // As many as lengths differ by, at least: a name of a million letters is compared with nothing.
    let may_be_near = |candidate: &&&str| candidate.chars().count().abs_diff(length) <= most;
    let slips =
        |candidate: &str| strsim::damerau_levenshtein(&candidate.to_lowercase(), &name.to_lowercase());
    let candidates = known.iter().filter(may_be_near).map(|candidate| (slips(candidate), candidate));
    match candidates.min_by_key(|(slips, _)| *slips) {
        Some((slips, nearest)) if slips <= most => {
            format!("did you mean `{nearest}`? valid names: {all}")
        }
        _ => format!("valid names: {all}"),
    }
}
