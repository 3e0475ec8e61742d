//! Errors in scenes and models, with place, value and remedy.

use std::fmt;
use std::sync::Arc;

use super::printable;
use rattlemap_dynamics::model::ModelError;
use thiserror::Error;

/// Place of the text that must be changed.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// A place in a file. Lines and columns count from 1, columns in characters.
    Text {
        /// The file as it was named by the caller.
        file: Arc<str>,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
    },
    /// A `--set` argument.
    Set {
        /// `NAME=VALUE` as given.
        argument: Arc<str>,
    },
    /// Another argument: `--along` or `--at`.
    Option {
        /// Name of the option, including dashes.
        option: &'static str,
        /// Argument of the option.
        argument: Arc<str>,
    },
    /// A file that cannot be read.
    File {
        /// The file as it was named by the caller.
        file: Arc<str>,
    },
    /// A scene without a file.
    Builder,
}

impl Place {
    /// Returns line and column; none for a place outside of a file.
    pub(crate) fn line_and_column(&self) -> Option<(usize, usize)> {
        match self {
            Place::Text { line, column, .. } => Some((*line, *column)),
            _ => None,
        }
    }
}

/// Largest number of characters of a name or a value in a message.
pub(crate) const LONGEST_EXCERPT: usize = 60;

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

/// An error in a scene or a model. Its message is one line, safe for a terminal.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{}", printable::line(&format!("{place}: {problem}")))]
pub struct SceneError {
    /// Place of the error.
    pub place: Place,
    /// The error.
    pub problem: Problem,
}

/// What can be wrong with a scene or a model. Fields are named by their full path, as `--set` takes it.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Problem {
    /// The file cannot be read.
    #[error("cannot read the scene ({reason}); give the path of a TOML file such as {example}")]
    Unreadable {
        /// The operating system's message.
        reason: String,
        /// A scene that the command can compute.
        example: &'static str,
    },
    /// The text is not TOML.
    #[error("not valid TOML: {message}; the line reads `{line}`")]
    Syntax {
        /// The parser's message.
        message: String,
        /// The line with the error.
        line: String,
    },
    /// A `--set` argument lacks a name, a value, or the equals sign between them.
    #[error("expected NAME=VALUE, such as e=0.6 or integration.max_period=32")]
    NotAnAssignment,
    /// A table of cells is empty or malformed.
    #[error("{message}")]
    Table {
        /// The fault and its remedy.
        message: String,
    },
    /// A required field is missing.
    #[error("`{field}` is missing; {remedy}")]
    Missing {
        /// Path of the field.
        field: String,
        /// What to write.
        remedy: String,
    },
    /// Each parameter is in its range, but together they do not make an oscillator.
    #[error("{}{reason}; change the parameters", if .cell.is_empty() { String::new() } else { format!("at {cell}: ") })]
    NoMotion {
        /// Values of the swept parameters; empty without axes.
        cell: String,
        /// Why there is no motion.
        reason: Box<ModelError>,
    },
    /// A field has a value that cannot be used.
    #[error("{}`{field} = {value}`{}{detail}", .fault.before(), .fault.after())]
    Value {
        /// Kind of the fault.
        fault: Fault,
        /// Path of the field.
        field: String,
        /// The value as written, shortened.
        value: String,
        /// The requirement that is not met, or the remedy.
        detail: String,
    },
}

impl Problem {
    /// Builds [`Problem::Value`].
    pub(crate) fn value(
        fault: Fault,
        field: impl Into<String>,
        value: impl Into<String>,
        detail: impl Into<String>,
    ) -> Problem {
        Problem::Value { fault, field: field.into(), value: value.into(), detail: detail.into() }
    }
}

/// Kinds of values that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Scenes have no field of this name.
    UnknownField,
    /// The value must be one of a list of names, and is not.
    UnknownName,
    /// An expression contains an unknown name.
    UnknownWithin,
    /// An expression, or the file that the field names, cannot be read.
    Unreadable,
    /// The value has the wrong type.
    WrongType,
    /// The value is outside its range.
    OutOfRange,
    /// The value contradicts another field.
    Conflict,
}

impl Fault {
    /// Returns the text in front of the field.
    fn before(self) -> &'static str {
        if self == Fault::UnknownField { "unknown field " } else { "" }
    }

    /// Returns the text between the value and the detail.
    fn after(self) -> &'static str {
        match self {
            Fault::UnknownField => "; ",
            Fault::UnknownName => " is not known; ",
            Fault::UnknownWithin => " has an unknown name, ",
            Fault::Unreadable => " ",
            Fault::WrongType => " has the wrong type: it must be ",
            Fault::OutOfRange => " is out of range: it must be ",
            Fault::Conflict => " does not fit: ",
        }
    }
}

/// Least number of characters of a part by which a longer name is suggested.
const LEAST_PART: usize = 4;

/// Returns the remedy for an unknown name: the most similar known one, or those that contain it, and `all`, the list of known
/// names.
pub(crate) fn suggest(name: &str, known: &[&str], all: &str) -> String {
    let length = name.chars().count();
    // One typing error per three letters, but fewer errors than letters.
    let most = (length / 3).max(1).min(length.saturating_sub(1));
    // Names of very different length are not compared, which would take long for a name of a million letters.
    let may_be_near = |candidate: &&&str| candidate.chars().count().abs_diff(length) <= most;
    let typos =
        |candidate: &str| strsim::damerau_levenshtein(&candidate.to_lowercase(), &name.to_lowercase());
    let candidates = known.iter().filter(may_be_near).map(|candidate| (typos(candidate), candidate));
    match candidates.min_by_key(|(typos, _)| *typos) {
        Some((typos, nearest)) if typos <= most => {
            format!("did you mean `{nearest}`? valid names: {all}")
        }
        _ => {
            let contain = |known: &&&str| length >= LEAST_PART && known.contains(name);
            let longer: Vec<String> =
                known.iter().filter(contain).take(3).map(|known| format!("`{known}`")).collect();
            let meant = longer.join(" or ");
            if meant.is_empty() {
                format!("valid names: {all}")
            } else {
                format!("did you mean {meant}? valid names: {all}")
            }
        }
    }
}

/// Returns the beginning of a text as one line of at most [`LONGEST_EXCERPT`] characters. The rest is not read.
pub(crate) fn shorten(text: &str) -> String {
    let mut line = String::new();
    let mut left = LONGEST_EXCERPT;
    for word in text.split_whitespace() {
        let space = if line.is_empty() { "" } else { " " };
        for c in space.chars().chain(word.chars()) {
            if left == 0 {
                return line + "...";
            }
            left -= 1;
            line.push(c);
        }
    }
    line
}
