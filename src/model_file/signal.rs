//! `[[signal]]`: linear functions of the motion that are measured.

use nalgebra::DVector;
use rattlemap_dynamics::model::{self, MOST_SIGNALS};

use super::entry::{Entry, Names};
use super::parameters::{check_name, read_unit};
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Keys of `[[signal]]`.
const SIGNAL_KEYS: [&str; 8] =
    ["name", "displacement", "velocity", "acceleration", "constant", "cos", "sin", "unit"];

/// A linear function of the motion: rows of displacements, velocities and accelerations, a constant, and a wave of the forcing frequency.
#[derive(Clone, Debug)]
pub struct Signal {
    /// Name in columns and figures.
    pub name: String,
    /// Unit, if the file gives one.
    pub unit: Option<String>,
    /// Factors of the displacements, velocities and accelerations.
    pub rows: [Vec<Expression>; 3],
    /// Constant part, and factors of the cosine and the sine.
    pub constants: [Expression; 3],
}

impl Signal {
    /// Returns all entries.
    pub(super) fn entries(&self) -> impl Iterator<Item = &Expression> {
        self.rows.iter().flatten().chain(&self.constants)
    }

    /// Returns the signal for values of the parameters, which `of` inserts.
    pub(super) fn evaluated(&self, of: impl Fn(&Expression) -> f64) -> model::Signal {
        let [displacement, velocity, acceleration] =
            self.rows.each_ref().map(|row| DVector::from_iterator(row.len(), row.iter().map(&of)));
        let [constant, cos, sin] = self.constants.each_ref().map(of);
        model::Signal { displacement, velocity, acceleration, constant, waves: [cos, sin] }
    }
}

/// Reads the signals of a model with `count` coordinates, in the order of the file. `gaps` are the names of its gaps.
pub(super) fn read(
    root: &Section<'_>,
    names: Names<'_>,
    gaps: &[&str],
    count: usize,
) -> Result<Vec<Signal>, SceneError> {
    let Some(field) = root.get("signal") else { return Ok(Vec::new()) };
    let tables = format!("at most {MOST_SIGNALS} tables, [[signal]], each with a name and a row");
    let mut signals: Vec<Signal> = Vec::new();
    for item in &field.list_of(0..=MOST_SIGNALS, "tables", &tables)? {
        let signal = read_one(item, names, count)?;
        let taken = signals.iter().map(|other| other.name.as_str()).chain(gaps.iter().copied());
        let mut taken = taken.chain(names.parameters.iter().chain(names.states).copied());
        if taken.any(|name| name == signal.name) {
            let field = Section::open(item.node, &item.path, &SIGNAL_KEYS)?.require("name", "")?;
            return Err(field.conflict(format!(
                "`{}` is already the name of a parameter, a coordinate, a velocity, a gap or a signal; rename one of them",
                signal.name
            )));
        }
        signals.push(signal);
    }
    Ok(signals)
}

fn read_one(item: &Field<'_>, names: Names<'_>, count: usize) -> Result<Signal, SceneError> {
    let section = Section::open(item.node, &item.path, &SIGNAL_KEYS)?;
    let name = section.require("name", "name the signal, such as name = \"travel\"")?;
    check_name(name.text()?, &name)?;
    let keys = ["displacement", "velocity", "acceleration"];
    if keys.iter().all(|key| section.get(key).is_none()) {
        let remedy = "write the factors of the displacements, such as displacement = [1, -1], of the velocities, `velocity`, \
                      or of the accelerations, `acceleration`";
        return Err(section.missing("displacement", remedy));
    }
    let row = |key: &str| match section.get(key) {
        Some(field) => names.vector(&field, count, "a row of the signal"),
        None => Ok(vec![Expression::zero(); count]),
    };
    let constant = |key: &str| section.get(key).map_or(Ok(Expression::zero()), |field| names.entry(&field));
    let rows = [row(keys[0])?, row(keys[1])?, row(keys[2])?];
    if rows.iter().flatten().all(|entry| entry.as_number() == Some(0.0)) {
        return Err(name.conflict("all factors of the signal are 0; write at least one that is not"));
    }
    Ok(Signal {
        name: name.text()?.to_owned(),
        unit: section.get("unit").map(|field| read_unit(&field)).transpose()?,
        rows,
        constants: [constant("constant")?, constant("cos")?, constant("sin")?],
    })
}
