//! Names, defaults and valid ranges of model parameters.

use thiserror::Error;

/// The values that a parameter may take. All of them are finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// `value > 0`
    Positive,
    /// `value >= 0`
    NonNegative,
    /// `0 <= value <= 1`
    Unit,
    /// any finite number
    Finite,
}

impl Range {
    /// Whether `value` lies in the range; NaN and infinities never do.
    pub fn contains(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Range::Positive => value > 0.0,
                Range::NonNegative => value >= 0.0,
                Range::Unit => (0.0..=1.0).contains(&value),
                Range::Finite => true,
            }
    }

    /// The range in words, to end the sentence "it must be ...".
    pub fn requirement(self) -> &'static str {
        match self {
            Range::Positive => "finite and greater than 0",
            Range::NonNegative => "finite and at least 0",
            Range::Unit => "between 0 and 1",
            Range::Finite => "a finite number",
        }
    }
}

/// One parameter of a model: a line of its table.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// The name in scenes, on the command line and in column headers.
    pub name: &'static str,
    /// One phrase for `--help` and axis labels.
    pub meaning: &'static str,
    /// The value where nothing is said; none where a choice is required.
    pub default: Option<f64>,
    /// The values it may take.
    pub range: Range,
}

/// Why a parameter could not be set.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ParameterError {
    /// No parameter of this name.
    #[error("unknown parameter `{name}`; the model has {known}")]
    Unknown {
        /// The name that was asked for.
        name: String,
        /// All the names there are, comma-separated.
        known: String,
    },
    /// The value lies outside the parameter's range.
    #[error("`{name} = {value}` is out of range: it must be {requirement}")]
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// The rejected value.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
}
