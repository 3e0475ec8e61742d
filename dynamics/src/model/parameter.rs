//! Names, defaults and valid ranges of model parameters.

use std::borrow::Cow;

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
    pub fn requirement(self) -> Cow<'static, str> {
        Cow::Borrowed(match self {
            Range::Positive => "finite and greater than 0",
            Range::NonNegative => "finite and at least 0",
            Range::Unit => "between 0 and 1",
            Range::Finite => "a finite number",
        })
    }
}

/// What a parameter shapes: cells that differ in parameters of the law alone share their flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shapes {
    /// The oscillator, and nothing of the contact law.
    Oscillator,
    /// The contact law, and nothing of the oscillator.
    Law,
    /// Both of them.
    Both,
}

impl Shapes {
    /// Whether the oscillator depends on the parameter.
    pub fn oscillator(self) -> bool {
        self != Shapes::Law
    }

    /// Whether the contact law depends on the parameter.
    pub fn law(self) -> bool {
        self != Shapes::Oscillator
    }
}

/// One parameter of a model: a line of its table.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The name in scenes, on the command line and in column headers.
    pub name: Cow<'static, str>,
    /// One phrase for `--help` and axis labels.
    pub meaning: Cow<'static, str>,
    /// The value where nothing is said; none where a choice is required.
    pub default: Option<f64>,
    /// The values it may take.
    pub range: Range,
    /// What depends on it.
    pub shapes: Shapes,
}

impl Parameter {
    /// A value, if it is one that the parameter may take.
    ///
    /// # Errors
    /// [`ParameterError::OutOfRange`] if it is not.
    pub fn check(&self, value: f64) -> Result<f64, ParameterError> {
        if self.range.contains(value) {
            return Ok(value);
        }
        let (name, requirement) = (self.name.to_string(), self.range.requirement());
        Err(ParameterError::OutOfRange { name, value, requirement })
    }
}

/// A model that is a struct of numbers: its table of parameters, and how each is reached.
macro_rules! parameters {
    ($model:ident: $($name:literal $field:ident $default:expr, $range:ident, $shapes:ident, $meaning:literal;)*) => {
        const TABLE: &[Parameter] = &[$(Parameter {
            name: std::borrow::Cow::Borrowed($name),
            meaning: std::borrow::Cow::Borrowed($meaning),
            default: $default,
            range: Range::$range,
            shapes: Shapes::$shapes,
        }),*];
        const ACCESSORS: &[fn(&mut $model) -> &mut f64] = &[$(|model| &mut model.$field),*];
    };
}
pub(super) use parameters;

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
        name: String,
        /// The rejected value.
        value: f64,
        /// What it must be.
        requirement: Cow<'static, str>,
    },
}
