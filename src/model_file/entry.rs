//! Entries of vectors and matrices: numbers or expressions in parameters.

use crate::text::document::Value;
use crate::text::error::SceneError;
use crate::text::expression::{Expression, ExpressionError};
use crate::text::section::{Field, Section};

/// What entries are, for messages.
const CONSTANT: &str =
    "entries are constants of a cell; time enters only through `frequency`, coordinates do not enter";

/// Names in entries.
#[derive(Clone, Copy)]
pub(super) struct Names<'a> {
    /// Names of the parameters in the order of their values.
    pub(super) parameters: &'a [&'a str],
    /// Names of the state's components, each displacement before its velocity. Entries must not contain them.
    pub(super) states: &'a [&'a str],
    /// Number of stages; 1 if the model has none.
    pub(super) stages: usize,
}

/// An entry that may have one value per stage.
#[derive(Clone, Debug)]
pub struct Staged(Vec<Expression>);

impl Staged {
    /// Returns an entry that is a number in every stage.
    pub(super) fn number(number: f64) -> Staged {
        Staged(vec![Expression::number(number)])
    }

    /// Returns the value of a stage.
    pub(super) fn in_stage(&self, stage: usize) -> &Expression {
        &self.0[if self.0.len() == 1 { 0 } else { stage }]
    }

    /// Returns all values.
    pub(super) fn values(&self) -> &[Expression] {
        &self.0
    }
}

impl Names<'_> {
    /// Reads an entry that may be a list with one value per stage.
    pub(super) fn staged(self, field: &Field<'_>) -> Result<Staged, SceneError> {
        let Value::List(_) = &field.node.value else { return Ok(Staged(vec![self.entry(field)?])) };
        let values = field.list("")?;
        match self.stages {
            1 => Err(field.conflict(
                "a list has one value per stage, but the model has no stages; write `motion.stages`",
            )),
            count if values.len() != count => {
                let requirement = format!("one entry, or a list of {count}, one for each stage");
                Err(field.wrong_count(values.len(), "entries", &requirement))
            }
            _ => values.iter().map(|value| self.entry(value)).collect::<Result<_, _>>().map(Staged),
        }
    }

    /// Reads one entry.
    pub(super) fn entry(self, field: &Field<'_>) -> Result<Expression, SceneError> {
        if let (Value::List(_), 2..) = (&field.node.value, self.stages) {
            return Err(field.wrong_type(
                "one entry: only stiffness, damping and load may be lists with one value per stage",
            ));
        }
        if let Value::Text(text) = &field.node.value
            && let Err(ExpressionError::Unknown { name }) = Expression::parse(text, self.parameters)
            && let Some(remedy) = self.remedy(&name)
        {
            return Err(field.conflict(remedy));
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
            Some(_) => ("a velocity", format!("write the factor of {name} in `damping`")),
            None if name == "t" || name == "time" => {
                ("the time", "write the amplitude of the harmonic force in `force`".to_owned())
            }
            None => return None,
        };
        Some(format!("`{name}` is {what}, and {CONSTANT}; {remedy}"))
    }

    /// Reads a list of one entry per coordinate with `read`. `what` names it in messages.
    pub(super) fn vector<T>(
        self,
        field: &Field<'_>,
        count: usize,
        what: &str,
        read: impl Fn(Self, &Field<'_>) -> Result<T, SceneError>,
    ) -> Result<Vec<T>, SceneError> {
        let requirement = format!("{what}: a list of {}, one for each coordinate", entries(count));
        let items = field.list(&requirement)?;
        if items.len() != count {
            return Err(field.out_of_range(&requirement));
        }
        items.iter().map(|item| read(self, item)).collect()
    }

    /// Reads a square matrix, row by row, with `read`.
    pub(super) fn matrix<T>(
        self,
        field: &Field<'_>,
        count: usize,
        read: impl Fn(Self, &Field<'_>) -> Result<T, SceneError> + Copy,
    ) -> Result<Vec<Vec<T>>, SceneError> {
        let requirement = match count {
            1 => "a matrix of one row, such as [[\"1\"]]",
            _ => "a matrix of two rows, such as [[\"m1\", \"0\"], [\"0\", \"m2\"]]",
        };
        let rows = field.list(requirement)?;
        if rows.len() != count {
            return Err(field.out_of_range(requirement));
        }
        rows.iter().map(|row| self.vector(row, count, "a row", read)).collect()
    }

    /// Reads a list of one entry per coordinate; zeros if it is missing.
    pub(super) fn vector_or_zeros(
        self,
        section: &Section<'_>,
        name: &str,
        count: usize,
    ) -> Result<Vec<Expression>, SceneError> {
        match section.get(name) {
            Some(field) => self.vector(&field, count, "amplitudes of one harmonic", Self::entry),
            None => Ok(vec![Expression::number(0.0); count]),
        }
    }

    /// Reads a square matrix whose entries may differ between stages; zeros if it is missing.
    pub(super) fn matrix_or_zeros(
        self,
        section: &Section<'_>,
        name: &str,
        count: usize,
    ) -> Result<Vec<Vec<Staged>>, SceneError> {
        match section.get(name) {
            Some(field) => self.matrix(&field, count, Self::staged),
            None => Ok(vec![vec![Staged::number(0.0); count]; count]),
        }
    }
}

fn entries(count: usize) -> &'static str {
    if count == 1 { "one entry" } else { "two entries" }
}
