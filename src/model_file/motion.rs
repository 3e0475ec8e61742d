//! `[motion]`: coordinates, matrices, forcing and the gap.

use super::entry::{Names, Staged};
use super::parameters::{check_name, read_unit};
use crate::text::document::Value;
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};
use rattlemap_dynamics::model::{HIGHEST_ORDER, MOST_CHANGES, MOST_HARMONICS, MOST_STAGES, Units};

/// Keys of `[motion]`.
#[rustfmt::skip]
const MOTION_KEYS: [&str; 16] = [
    "coordinates", "velocities", "bodies", "mass", "damping", "stiffness", "force", "force_sin", "load", "frequency",
    "gap", "stages", "repeat", "units", "gap_unit", "time_unit",
];

/// Keys of `[[harmonic]]`.
const HARMONIC_KEYS: [&str; 3] = ["order", "cos", "sin"];

/// Limits of all models, for messages.
const LIMITS: &str = "a model has one or two coordinates and one gap row";

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
    /// Harmonics of the force in increasing order; the first one has the order 1.
    pub harmonics: Vec<ForceHarmonic>,
    /// Constant load.
    pub load: Vec<Staged>,
    /// Phases in turns at which the stages begin; empty without stages.
    pub stages: Vec<Expression>,
    /// Number of times that the stages follow each other in a forcing period.
    pub repeat: u32,
    /// Excitation frequency.
    pub frequency: Expression,
    /// Gap row: the gap is `gap . x`.
    pub gap: Vec<Expression>,
    /// Units of coordinates, gap and time.
    pub units: Units,
}

/// A harmonic of the force.
#[derive(Clone, Debug)]
pub struct ForceHarmonic {
    /// Order.
    pub order: u32,
    /// Factors of the cosine.
    pub cos: Vec<Expression>,
    /// Factors of the sine.
    pub sin: Vec<Expression>,
}

impl Motion {
    /// Returns the number of stages; 1 if there are none.
    pub fn stage_count(&self) -> usize {
        self.stages.len().max(1)
    }

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
        let harmonics = self.harmonics.iter().flat_map(|harmonic| harmonic.cos.iter().chain(&harmonic.sin));
        let plain = self.mass.iter().flatten().chain(harmonics).chain(&self.gap).chain(&self.stages);
        plain.chain(staged.flat_map(Staged::values)).chain([&self.frequency])
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
    let mass = section.require("mass", "write the matrix, such as mass = [[\"m\"]]")?;
    let gap = section.require("gap", "write the gap row, such as gap = [\"1\"]: z = gap . x")?;
    let gap = names.vector(&gap, count, "one gap row", Names::entry)?;
    let (stages, repeat) = read_stages(&section, names)?;
    let names = Names { stages: stages.len().max(1), ..names };
    let load = match section.get("load") {
        Some(field) => names.vector(&field, count, "constant loads", Names::staged)?,
        None => vec![Staged::number(0.0); count],
    };
    Ok(Motion {
        units: read_units(&section, &gap)?,
        mass: names.matrix(&mass, count, Names::entry)?,
        damping: names.matrix_or_zeros(&section, "damping", count)?,
        stiffness: names.matrix_or_zeros(&section, "stiffness", count)?,
        harmonics: read_harmonics(root, &section, names, count)?,
        load,
        stages,
        repeat,
        frequency: read_frequency(&section, names)?,
        gap,
        coordinates,
        velocities,
        bodies,
    })
}

/// Reads the phases at which stages begin, and how often they repeat in a period.
fn read_stages(section: &Section<'_>, names: Names<'_>) -> Result<(Vec<Expression>, u32), SceneError> {
    let repeat = section.get("repeat");
    let Some(field) = section.get("stages") else {
        return match repeat {
            Some(repeat) => {
                Err(repeat.conflict("it repeats stages, but the model has none; write `motion.stages`"))
            }
            None => Ok((Vec::new(), 1)),
        };
    };
    let requirement = format!(
        "a list of 2 to {MOST_STAGES} phases in [0, 1) at which the stages begin, such as [\"0\", \"0.6\"]"
    );
    let items = field.list(&requirement)?;
    if !(2..=MOST_STAGES).contains(&items.len()) {
        return Err(field.wrong_count(items.len(), "phases", &requirement));
    }
    let most = (MOST_CHANGES / items.len()) as u32;
    let repeat = repeat.map_or(Ok(1), |repeat| repeat.whole(1..=most))?;
    Ok((items.iter().map(|item| names.entry(item)).collect::<Result<_, _>>()?, repeat))
}

/// Reads the harmonics of the force: `force` and `force_sin`, which have the order 1, and `[[harmonic]]`.
fn read_harmonics(
    root: &Section<'_>,
    motion: &Section<'_>,
    names: Names<'_>,
    count: usize,
) -> Result<Vec<ForceHarmonic>, SceneError> {
    let first = ForceHarmonic {
        order: 1,
        cos: names.vector_or_zeros(motion, "force", count)?,
        sin: names.vector_or_zeros(motion, "force_sin", count)?,
    };
    let mut harmonics = vec![first];
    let Some(field) = root.get("harmonic") else { return Ok(harmonics) };
    let tables = format!("at most {MOST_HARMONICS} tables, [[harmonic]]");
    let items = field.list(&tables)?;
    if items.len() > MOST_HARMONICS {
        return Err(field.wrong_count(items.len(), "tables", &tables));
    }
    for item in &items {
        let section = Section::open(item.node, &item.path, &HARMONIC_KEYS)?;
        let order = section.require("order", "a harmonic needs one, such as order = 2")?;
        let number = order.whole(2..=HIGHEST_ORDER)?;
        if harmonics.iter().any(|harmonic| harmonic.order == number) {
            return Err(
                order.conflict("there is already a harmonic of this order; write one table for each order")
            );
        }
        if section.get("cos").is_none() && section.get("sin").is_none() {
            return Err(section.missing("cos", "write the amplitudes of the cosine, or of the sine as `sin`"));
        }
        harmonics.push(ForceHarmonic {
            order: number,
            cos: names.vector_or_zeros(&section, "cos", count)?,
            sin: names.vector_or_zeros(&section, "sin", count)?,
        });
    }
    harmonics.sort_by_key(|harmonic| harmonic.order);
    Ok(harmonics)
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
    let (given, time) = (unit("gap_unit")?, unit("time_unit")?);
    let used = gap.iter().zip(&coordinates).filter(|(entry, _)| entry.as_number() != Some(0.0));
    let mut used = used.map(|(entry, unit)| entry.as_number().and(unit.clone()));
    let common = used.next().flatten().filter(|first| used.all(|unit| unit.as_ref() == Some(first)));
    Ok(Units { coordinates, gap: given.or(common), time })
}

fn read_frequency(section: &Section<'_>, names: Names<'_>) -> Result<Expression, SceneError> {
    let field = section.require(
        "frequency",
        "name it, such as frequency = \"omega\"; without a force any value works, such as 1",
    )?;
    match field.node.value {
        Value::List(_) => Err(field.wrong_type(
            "one entry, the frequency of the forcing period; write further harmonics of the force as [[harmonic]]",
        )),
        _ => names.entry(&field),
    }
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
