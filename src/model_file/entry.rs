//! Entries of vectors and matrices: numbers or expressions in parameters, one of these for each stage, or a function of the phase.

use rattlemap_dynamics::model::MOST_COORDINATES;

use super::steps::PHASE;
use crate::text::document::Value;
use crate::text::error::SceneError;
use crate::text::expression::{Expression, ExpressionError};
use crate::text::section::{Field, Section};

/// What entries are, for messages.
const CONSTANT: &str = "entries are constants of a cell; time enters only through `frequency`, `stages` and `phase`, coordinates do not enter";

/// Lists with one value for each stage, for messages.
const LISTS: &str = "a list with one value for each stage belongs to stiffness, damping, load and preload";

/// An entry of stiffness, damping or load: one value, or one for each stage, or a function of the phase.
#[derive(Clone, Debug)]
pub struct Staged {
    values: Vec<Expression>,
    /// Whether the only value contains the phase, a name with the index after those of all parameters.
    is_by_phase: bool,
}

impl Staged {
    /// Returns the value in a stage.
    pub fn in_stage(&self, stage: usize) -> &Expression {
        match &self.values[..] {
            [one] => one,
            each => &each[stage],
        }
    }

    /// Returns the function of the phase, if the entry is one.
    pub fn by_phase(&self) -> Option<&Expression> {
        self.values.first().filter(|_| self.is_by_phase)
    }
}

/// An entry of a vector or a matrix.
pub(super) trait Entry: Clone {
    /// Whether the entry may be a list with one value for each stage.
    const MAY_CHANGE: bool;

    /// Reads an entry.
    fn read(field: &Field<'_>, names: Names<'_>) -> Result<Self, SceneError>;

    /// Returns the entry 0.
    fn zero() -> Self;

    /// Returns the value, or those of all stages.
    fn values(&self) -> &[Expression];
}

impl Entry for Expression {
    const MAY_CHANGE: bool = false;

    fn read(field: &Field<'_>, names: Names<'_>) -> Result<Expression, SceneError> {
        names.entry(field)
    }

    fn zero() -> Expression {
        Expression::number(0.0)
    }

    fn values(&self) -> &[Expression] {
        std::slice::from_ref(self)
    }
}

impl Entry for Staged {
    const MAY_CHANGE: bool = true;

    fn read(field: &Field<'_>, names: Names<'_>) -> Result<Staged, SceneError> {
        let staged = |values| Staged { values, is_by_phase: false };
        if let Some(value) = names.by_phase(field)? {
            return Ok(Staged { values: vec![value], is_by_phase: true });
        }
        let Value::List(items) = &field.node.value else { return Ok(staged(vec![names.entry(field)?])) };
        if names.stages == 0 {
            return Err(field.conflict(
                "a list has one value for each stage, but the model has no stages; write `stages` in [motion], or one value",
            ));
        }
        if items.len() != names.stages {
            return Err(field.out_of_range(&format!(
                "one value, or a list of {} values, one for each stage",
                names.stages
            )));
        }
        field.list("")?.iter().map(|item| names.entry(item)).collect::<Result<_, _>>().map(staged)
    }

    fn zero() -> Staged {
        Staged { values: vec![Expression::zero()], is_by_phase: false }
    }

    fn values(&self) -> &[Expression] {
        &self.values
    }
}

/// Names in entries.
#[derive(Clone, Copy)]
pub(super) struct Names<'a> {
    /// Names of the parameters in the order of their values.
    pub(super) parameters: &'a [&'a str],
    /// Names of the state's components, each displacement before its velocity. Entries must not contain them.
    pub(super) states: &'a [&'a str],
    /// Number of stages; 0 if the model has none.
    pub(super) stages: usize,
}

impl Names<'_> {
    /// Reads an entry that contains the phase; none if it does not.
    fn by_phase(self, field: &Field<'_>) -> Result<Option<Expression>, SceneError> {
        let Value::Text(text) = &field.node.value else { return Ok(None) };
        let known: Vec<&str> = self.parameters.iter().copied().chain([PHASE]).collect();
        let read = Expression::parse(text, &known).ok();
        let found = read.filter(|entry| entry.uses().contains(&self.parameters.len()));
        match found {
            Some(_) if self.stages > 0 => Err(field.conflict(
                "the program chooses the stages of an entry with `phase`, and the model has `stages`; remove `stages`, or write a list with \
                 one value for each",
            )),
            found => Ok(found),
        }
    }

    /// Reads one entry.
    pub(super) fn entry(self, field: &Field<'_>) -> Result<Expression, SceneError> {
        if let Value::Text(text) = &field.node.value
            && let Err(ExpressionError::Unknown { name }) = Expression::parse(text, self.parameters)
            && let Some(remedy) = self.remedy(&name)
        {
            return Err(field.conflict(remedy));
        }
        if let Value::List(_) = field.node.value {
            return Err(field.wrong_type(&format!("one number or expression; {LISTS}")));
        }
        let all = match self.parameters {
            [] => "the model has no parameters".to_owned(),
            names => names.join(", "),
        };
        field.expression(self.parameters, &all, "\"2*zeta\"")
    }

    /// Returns the remedy for a name that is the time, a coordinate or a velocity; none for any other name.
    fn remedy(self, name: &str) -> Option<String> {
        let (what, remedy) = match self.states.iter().position(|state| *state == name) {
            Some(i) if i % 2 == 0 => ("a coordinate", format!("write the factor of {name} in `stiffness`")),
            Some(_) => (
                "a velocity",
                format!("write the factor of {name} in `damping`, and an approach speed as `speed`"),
            ),
            None if name == "t" || name == "time" => {
                let force = "write the amplitude of the harmonic force in `force`, and a stiffness that changes with time \
                             with `phase` or in `stages`";
                ("the time", force.to_owned())
            }
            None if name == PHASE => {
                let where_it_may = "only a whole entry of stiffness, damping, load or preload may contain it";
                ("the phase of the forcing", where_it_may.to_owned())
            }
            None => return None,
        };
        Some(format!("`{name}` is {what}, and {CONSTANT}; {remedy}"))
    }

    /// Reads a list of one entry per coordinate. `what` names it in messages.
    pub(super) fn vector<T: Entry>(
        self,
        field: &Field<'_>,
        count: usize,
        what: &str,
    ) -> Result<Vec<T>, SceneError> {
        let mut requirement = format!("{what}: a list of {}, one for each coordinate", entries(count));
        if T::MAY_CHANGE && self.stages > 0 {
            requirement += "; an entry may be a list with one value for each stage";
        }
        field.list_with(count, &requirement)?.iter().map(|item| T::read(item, self)).collect()
    }

    /// Reads a square matrix, row by row.
    pub(super) fn matrix<T: Entry>(self, field: &Field<'_>, count: usize) -> Result<Vec<Vec<T>>, SceneError> {
        let requirement = match count {
            1 => "a matrix of one row, such as [[\"1\"]]".to_owned(),
            2 => "a matrix of two rows, such as [[\"m1\", \"0\"], [\"0\", \"m2\"]]".to_owned(),
            _ => format!("a matrix of {} rows with {} each", NUMBERS[count - 1], entries(count)),
        };
        let rows = field.list_with(count, &requirement)?;
        rows.iter().map(|row| self.vector(row, count, "a row")).collect()
    }

    /// Reads a list of one entry per coordinate; zeros if it is missing.
    pub(super) fn vector_or_zeros<T: Entry>(
        self,
        section: &Section<'_>,
        name: &str,
        count: usize,
    ) -> Result<Vec<T>, SceneError> {
        match section.get(name) {
            Some(field) => self.vector(&field, count, "amplitudes of one harmonic, or constant loads"),
            None => Ok(vec![T::zero(); count]),
        }
    }

    /// Reads a square matrix; zeros if it is missing.
    pub(super) fn matrix_or_zeros<T: Entry>(
        self,
        section: &Section<'_>,
        name: &str,
        count: usize,
    ) -> Result<Vec<Vec<T>>, SceneError> {
        match section.get(name) {
            Some(field) => self.matrix(&field, count),
            None => Ok(vec![vec![T::zero(); count]; count]),
        }
    }
}

/// Numbers of coordinates in words, from 1.
const NUMBERS: [&str; MOST_COORDINATES] = ["one", "two", "three", "four", "five", "six", "seven", "eight"];

pub(super) fn entries(count: usize) -> String {
    format!("{} {}", NUMBERS[count - 1], if count == 1 { "entry" } else { "entries" })
}
