//! `[motion]`: coordinates, matrices, forcing and the gap.

use super::entry::{Entry, Names, Staged};
use super::harmonic::{self, HarmonicForce};
use super::parameters::{check_name, read_unit};
use crate::text::document::Value;
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};
use rattlemap_dynamics::model::{MOST_CHANGES, MOST_STAGES, Units};

/// Keys of `[motion]`.
#[rustfmt::skip]
const MOTION_KEYS: [&str; 17] = [
    "coordinates", "velocities", "bodies", "mass", "damping", "stiffness", "force", "force_sin", "load", "frequency",
    "stages", "repeat", "gap", "units", "gap_unit", "time_unit", "force_unit",
];

/// Limits of all models, for messages.
const LIMITS: &str = "a model has one or two coordinates and one gap row; further harmonics of the force are tables, [[harmonic]]";

/// Largest number of characters of a body's name.
const LONGEST_BODY: usize = 40;

/// Free motion and its gap.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Names of the displacements, one or two.
    pub coordinates: Vec<String>,
    /// Names of their rates.
    pub velocities: Vec<String>,
    /// Names of the moving bodies, one for each coordinate.
    pub bodies: Vec<String>,
    /// Mass matrix, row by row.
    pub mass: Vec<Vec<Expression>>,
    /// Damping matrix.
    pub damping: Vec<Vec<Staged>>,
    /// Stiffness matrix.
    pub stiffness: Vec<Vec<Staged>>,
    /// Factors of the cosine in the first harmonic of the force.
    pub force: Vec<Expression>,
    /// Factors of the sine.
    pub force_sin: Vec<Expression>,
    /// Further harmonics, in increasing order.
    pub harmonics: Vec<HarmonicForce>,
    /// Constant load.
    pub load: Vec<Staged>,
    /// Excitation frequency.
    pub frequency: Expression,
    /// Phases at which the stages begin, in turns; empty without stages.
    pub stages: Vec<Expression>,
    /// How often the stages recur in a forcing period.
    pub repeat: u32,
    /// Gap row: the gap is `gap . x`.
    pub gap: Vec<Expression>,
    /// Units of coordinates, gap, time and contact forces.
    pub units: Units,
}

impl Motion {
    /// Returns the number of degrees of freedom.
    pub fn degrees(&self) -> usize {
        self.coordinates.len()
    }

    /// Returns the names of the state's components.
    pub fn state_names(&self) -> impl Iterator<Item = &str> {
        self.coordinates.iter().zip(&self.velocities).flat_map(|(x, v)| [x.as_str(), v.as_str()])
    }

    /// Returns all entries.
    pub(super) fn entries(&self) -> impl Iterator<Item = &Expression> {
        let staged = [&self.damping, &self.stiffness].into_iter().flatten().flatten().chain(&self.load);
        let harmonics = self.harmonics.iter().flat_map(|harmonic| [&harmonic.cos, &harmonic.sin]);
        let vectors = [&self.force, &self.force_sin, &self.stages, &self.gap].into_iter();
        let constant = vectors.chain(&self.mass).chain(harmonics).flatten();
        staged.flat_map(Entry::values).chain(constant).chain([&self.frequency])
    }
}

/// Reads `[motion]`.
pub(super) fn read(root: &Section<'_>, names: Names<'_>) -> Result<Motion, SceneError> {
    root.require("motion", "write [motion] with coordinates, mass, frequency and gap")?;
    let section =
        root.section_among("motion", &MOTION_KEYS, &format!("{}; {LIMITS}", MOTION_KEYS.join(", ")))?;
    let field = section.require("coordinates", "name one or two, such as coordinates = [\"x\"]")?;
    let two = "one or two names: a model has at most two degrees of freedom";
    let coordinates = read_names(&field, two)?;
    if !(1..=2).contains(&coordinates.len()) {
        return Err(field.out_of_range(two));
    }
    let count = coordinates.len();
    let each = "a list of names, one for each coordinate";
    let velocities = match section.get("velocities") {
        Some(field) => {
            let velocities = read_names(&field, each)?;
            if velocities.len() != count {
                return Err(field.out_of_range(each));
            }
            velocities
        }
        None if count == 1 => vec!["v".to_owned()],
        None => vec!["v1".to_owned(), "v2".to_owned()],
    };
    let pairs = coordinates.iter().zip(&velocities);
    let states: Vec<&str> = pairs.flat_map(|(x, v)| [x.as_str(), v.as_str()]).collect();
    for (i, name) in states.iter().enumerate() {
        if names.parameters.contains(name) || states[..i].contains(name) {
            return Err(field.conflict(format!(
                "`{name}` is already the name of a parameter, a coordinate or a velocity; rename one of them (`motion.velocities` names the \
                 velocities)"
            )));
        }
    }
    let bodies = match section.get("bodies") {
        Some(field) => {
            let items = field.list(each)?;
            if items.len() != count {
                return Err(field.out_of_range(each));
            }
            items.iter().map(|item| item.line(LONGEST_BODY)).collect::<Result<_, _>>()?
        }
        None => coordinates.clone(),
    };
    let names = Names { states: &states, ..names };
    let (stages, repeat) = read_stages(&section, names)?;
    let names = Names { stages: stages.len(), ..names };
    let mass = section.require("mass", "write the matrix, such as mass = [[\"m\"]]")?;
    let gap = section.require("gap", "write the gap row, such as gap = [\"1\"]: z = gap . x")?;
    let gap = names.vector(&gap, count, "one gap row")?;
    Ok(Motion {
        units: read_units(&section, &gap)?,
        mass: names.matrix(&mass, count)?,
        damping: names.matrix_or_zeros(&section, "damping", count)?,
        stiffness: names.matrix_or_zeros(&section, "stiffness", count)?,
        force: names.vector_or_zeros(&section, "force", count)?,
        force_sin: names.vector_or_zeros(&section, "force_sin", count)?,
        harmonics: harmonic::read(root, names, count)?,
        load: names.vector_or_zeros(&section, "load", count)?,
        frequency: read_frequency(&section, names)?,
        stages,
        repeat,
        gap,
        coordinates,
        velocities,
        bodies,
    })
}

/// Reads the units. The gap has the unit of the coordinates in its row, if they have the same one and plain numbers as
/// factors, unless the file gives another.
fn read_units(section: &Section<'_>, gap: &[Expression]) -> Result<Units, SceneError> {
    let each = "a list of units, one for each coordinate, such as [\"mm\"]";
    let coordinates = match section.get("units") {
        Some(field) => {
            let items = field.list(each)?;
            if items.len() != gap.len() {
                return Err(field.out_of_range(each));
            }
            items.iter().map(|item| read_unit(item).map(Some)).collect::<Result<_, _>>()?
        }
        None => vec![None; gap.len()],
    };
    let unit = |key| section.get(key).map(|field| read_unit(&field)).transpose();
    let (given, time, force) = (unit("gap_unit")?, unit("time_unit")?, unit("force_unit")?);
    let used = gap.iter().zip(&coordinates).filter(|(entry, _)| entry.as_number() != Some(0.0));
    let mut used = used.map(|(entry, unit)| entry.as_number().and(unit.clone()));
    let common = used.next().flatten().filter(|first| used.all(|unit| unit.as_ref() == Some(first)));
    Ok(Units { coordinates, gap: given.or(common), time, force })
}

fn read_frequency(section: &Section<'_>, names: Names<'_>) -> Result<Expression, SceneError> {
    let field = section.require(
        "frequency",
        "name it, such as frequency = \"omega\"; without a force any value works, such as 1",
    )?;
    match field.node.value {
        Value::List(_) => Err(field.wrong_type(
            "one entry, the frequency of the first harmonic, force cos(frequency t) + force_sin sin(frequency t); write \
             multiples of it as [[harmonic]]",
        )),
        _ => names.entry(&field),
    }
}

/// Reads the phases at which stages begin, and how often these recur.
fn read_stages(section: &Section<'_>, names: Names<'_>) -> Result<(Vec<Expression>, u32), SceneError> {
    let repeat = section.get("repeat");
    let Some(field) = section.get("stages") else {
        return match repeat {
            Some(field) => {
                Err(field
                    .conflict("it repeats the stages, but the model has none; write `stages` or remove it"))
            }
            None => Ok((Vec::new(), 1)),
        };
    };
    let phases = format!(
        "a list of 2 to {MOST_STAGES} phases at which stages begin, from 0 to 1, such as [\"0\", \"0.5\"]"
    );
    let items = field.list(&phases)?;
    if !(2..=MOST_STAGES).contains(&items.len()) {
        return Err(field.out_of_range(&phases));
    }
    let most = (MOST_CHANGES / items.len()) as u32;
    let repeat = repeat.map_or(Ok(1), |field| field.whole(1..=most))?;
    Ok((items.iter().map(|item| names.entry(item)).collect::<Result<_, _>>()?, repeat))
}

fn read_names(field: &Field<'_>, expected: &str) -> Result<Vec<String>, SceneError> {
    let mut names = Vec::new();
    for item in field.list(expected)? {
        let name = item.text()?;
        check_name(name, &item)?;
        names.push(name.to_owned());
    }
    Ok(names)
}
