//! Names, defaults and valid ranges of model parameters.

use std::borrow::Cow;

use thiserror::Error;

/// The values that a parameter may take. All of them are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// `value > 0`
    Positive,
    /// `value >= 0`
    NonNegative,
    /// `0 <= value <= 1`
    Unit,
    /// any finite number
    Finite,
    /// `min <= value <= max`; an infinite end is no bound
    Between {
        /// The least value, below `max`.
        min: f64,
        /// The greatest value.
        max: f64,
        /// Whether `min` itself is excluded.
        open: bool,
    },
}

impl Range {
    /// Builds the range with these ends. An infinite end is no bound; `open` excludes `min` itself.
    pub fn new(min: f64, max: f64, open: bool) -> Range {
        match (min, max, open) {
            (0.0, f64::INFINITY, true) => Range::Positive,
            (0.0, f64::INFINITY, false) => Range::NonNegative,
            (0.0, 1.0, false) => Range::Unit,
            (f64::NEG_INFINITY, f64::INFINITY, _) => Range::Finite,
            _ => Range::Between { min, max, open },
        }
    }

    /// Whether `value` lies in the range; NaN and infinities never do.
    pub fn contains(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Range::Positive => value > 0.0,
                Range::NonNegative => value >= 0.0,
                Range::Unit => (0.0..=1.0).contains(&value),
                Range::Finite => true,
                Range::Between { min, max, open } => (min..=max).contains(&value) && !(open && value == min),
            }
    }

    /// Returns the least and the greatest value; infinite where there is no bound.
    pub fn ends(self) -> [f64; 2] {
        match self {
            Range::Positive | Range::NonNegative => [0.0, f64::INFINITY],
            Range::Unit => [0.0, 1.0],
            Range::Finite => [f64::NEG_INFINITY, f64::INFINITY],
            Range::Between { min, max, .. } => [min, max],
        }
    }

    /// Returns the range in words that complete the sentence "it must be ...".
    pub fn requirement(self) -> Cow<'static, str> {
        Cow::Borrowed(match self {
            Range::Positive => "finite and greater than 0",
            Range::NonNegative => "finite and at least 0",
            Range::Unit => "between 0 and 1",
            Range::Finite => "a finite number",
            Range::Between { min, max, open } => {
                let lower = if open { "greater than" } else { "at least" };
                return Cow::Owned(match (min == f64::NEG_INFINITY, max == f64::INFINITY, open) {
                    (true, _, _) => format!("finite and at most {max}"),
                    (_, true, _) => format!("finite and {lower} {min}"),
                    (_, _, false) => format!("between {min} and {max}"),
                    (_, _, true) => format!("greater than {min} and at most {max}"),
                });
            }
        })
    }
}

/// The parts of a model that depend on a parameter. Cells that differ only in parameters of the law share one flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shapes {
    /// The oscillator, and not the contact law.
    Oscillator,
    /// The contact law, and not the oscillator.
    Law,
    /// The oscillator and the contact law.
    Both,
    /// Neither directly; parameters derived from it may.
    Neither,
}

impl Shapes {
    /// Returns the variant for these two dependencies.
    pub fn new(oscillator: bool, law: bool) -> Shapes {
        match (oscillator, law) {
            (true, true) => Shapes::Both,
            (true, false) => Shapes::Oscillator,
            (false, true) => Shapes::Law,
            (false, false) => Shapes::Neither,
        }
    }

    /// Whether the oscillator depends on the parameter.
    pub fn oscillator(self) -> bool {
        matches!(self, Shapes::Oscillator | Shapes::Both)
    }

    /// Whether the contact law depends on the parameter.
    pub fn law(self) -> bool {
        matches!(self, Shapes::Law | Shapes::Both)
    }
}

/// One parameter of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The name in scenes, on the command line and in column headers.
    pub name: Cow<'static, str>,
    /// One phrase for `--help` and axis labels.
    pub meaning: Cow<'static, str>,
    /// Its unit; none if it is dimensionless or not given.
    pub unit: Option<Cow<'static, str>>,
    /// The default value; none if the user must choose one.
    pub default: Option<f64>,
    /// The values it may take.
    pub range: Range,
    /// The parts of the model that depend on it.
    pub shapes: Shapes,
}

impl Parameter {
    /// Returns the value if it lies in the parameter's range.
    ///
    /// # Errors
    /// [`ParameterError::OutOfRange`] if it does not.
    pub fn check(&self, value: f64) -> Result<f64, ParameterError> {
        if self.range.contains(value) {
            return Ok(value);
        }
        let (name, requirement) = (self.name.to_string(), self.range.requirement());
        Err(ParameterError::OutOfRange { name, value, requirement })
    }
}

/// Units of a model's state, time and forces; none where the model does not give them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Units {
    /// Unit of each coordinate; empty without units.
    pub coordinates: Vec<Option<String>>,
    /// Unit of the gap.
    pub gap: Option<String>,
    /// Unit of time.
    pub time: Option<String>,
    /// Unit of contact forces.
    pub force: Option<String>,
    /// Unit of each signal.
    pub signals: Vec<Option<String>>,
}

impl Units {
    /// Returns the unit of a component of the state.
    pub fn component(&self, index: usize) -> Option<String> {
        let unit = self.coordinates.get(index / 2)?.as_deref()?;
        if index.is_multiple_of(2) { Some(unit.to_owned()) } else { self.rate(unit) }
    }

    /// Returns the unit of the gap's velocity.
    pub fn gap_velocity(&self) -> Option<String> {
        self.rate(self.gap.as_deref()?)
    }

    /// Returns the unit of power: the unit of a contact force times the unit of the gap's velocity.
    pub fn power(&self) -> Option<String> {
        let [force, velocity] = [self.force.as_deref()?, &self.gap_velocity()?];
        match (force, velocity) {
            ("N", "m/s") | ("N m", "rad/s") => Some("W".to_owned()),
            _ => Some(format!("{force} {velocity}")),
        }
    }

    /// Returns `unit` per unit of time.
    pub fn rate(&self, unit: &str) -> Option<String> {
        self.time.as_ref().map(|time| format!("{unit}/{time}"))
    }
}

/// Defines a model that is a struct of numbers: the struct, its table `PARAMETERS`, its contact law, and a
/// constructor that takes the restitution `e` and uses the defaults of all other parameters.
macro_rules! model {
    ($(#[$doc:meta])* $model:ident, $(#[$new_doc:meta])* $new:ident:
     $($name:literal $field:ident $default:expr, $range:ident, $shapes:ident, $meaning:literal;)*) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $model {
            $(#[doc = $meaning] pub $field: f64,)*
        }

        impl $model {
            /// All parameters.
            pub const PARAMETERS: &'static [Parameter] = &[$(Parameter {
                name: std::borrow::Cow::Borrowed($name),
                meaning: std::borrow::Cow::Borrowed($meaning),
                unit: None,
                default: $default,
                range: Range::$range,
                shapes: Shapes::$shapes,
            }),*];

            $(#[$new_doc])*
            pub fn $new(e: f64) -> $model {
                $(let $field = Option::<f64>::unwrap_or($default, e);)*
                $model { $($field),* }
            }

            /// Implements [`Model::law`].
            pub fn law(&self) -> Law {
                Law::both(self.e, self.mesh_speed)
            }

            fn field(&mut self, index: usize) -> &mut f64 {
                [$(&mut self.$field),*].into_iter().nth(index).expect("the index of a parameter")
            }
        }
    };
}
pub(super) use model;

/// The methods of [`Model`](super::Model) that are the same for all models which [`model`] defines.
macro_rules! model_methods {
    () => {
        fn parameters(&self) -> &[Parameter] {
            Self::PARAMETERS
        }

        fn value(&self, index: usize) -> f64 {
            *{ *self }.field(index)
        }

        fn assign(&mut self, index: usize, value: f64) {
            *self.field(index) = value;
        }

        fn oscillator(&self) -> Result<Oscillator, ModelError> {
            self.oscillator()
        }

        fn law(&self) -> Law {
            self.law()
        }
    };
}
pub(super) use model_methods;

/// An error in setting a parameter.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ParameterError {
    /// The model has no parameter of this name.
    #[error("unknown parameter `{name}`; the model has {known}")]
    Unknown {
        /// The unknown name.
        name: String,
        /// The names of all parameters, comma-separated.
        known: String,
    },
    /// The value lies outside the parameter's range.
    #[error("`{name} = {value}` is out of range: it must be {requirement}")]
    OutOfRange {
        /// The parameter.
        name: String,
        /// The rejected value.
        value: f64,
        /// The range, as returned by [`Range::requirement`].
        requirement: Cow<'static, str>,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_contain_what_their_requirement_says() {
        let (none, least) = (f64::INFINITY, f64::NEG_INFINITY);
        for (range, inside, outside, words) in [
            (Range::new(0.0, none, true), 1e-300, 0.0, "finite and greater than 0"),
            (Range::new(0.0, none, false), 0.0, -1e-300, "finite and at least 0"),
            (Range::new(0.0, 1.0, false), 1.0, 1.5, "between 0 and 1"),
            (Range::new(least, none, false), -1e300, f64::NAN, "a finite number"),
            (Range::new(-2.0, 0.5, false), -2.0, 0.75, "between -2 and 0.5"),
            (Range::new(-2.0, 0.5, true), 0.5, -2.0, "greater than -2 and at most 0.5"),
            (Range::new(3.0, none, true), 4.0, 3.0, "finite and greater than 3"),
            (Range::new(3.0, none, false), 3.0, none, "finite and at least 3"),
            (Range::new(least, 3.0, false), -1e300, least, "finite and at most 3"),
        ] {
            assert_eq!(range.requirement(), words);
            assert!(range.contains(inside) && !range.contains(outside), "{words}");
        }
        assert_eq!(Range::new(0.0, none, true), Range::Positive);
        assert_eq!(Range::new(0.0, 1.0, false), Range::Unit);
    }
}
