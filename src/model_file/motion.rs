//! `[motion]`: coordinates, matrices, forcing and the gaps.

use super::entry::{Entry, Names, Staged, entries};
use super::harmonic::{self, HarmonicForce};
use super::parameters::{check_name, read_unit};
use crate::text::document::Value;
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};
use rattlemap_dynamics::model::{MOST_CHANGES, MOST_COORDINATES, MOST_GAPS, MOST_STAGES, Units};

/// Keys of `[motion]`.
#[rustfmt::skip]
const MOTION_KEYS: [&str; 19] = [
    "coordinates", "velocities", "bodies", "mass", "damping", "stiffness", "force", "force_sin", "load", "frequency",
    "time_scale", "stages", "repeat", "tolerance", "gap", "units", "gap_unit", "time_unit", "force_unit",
];

/// Limits of all models, for messages.
const LIMITS: &str = "a model has one to eight coordinates and up to six gap rows; further harmonics of the force are tables, [[harmonic]]";

/// Names of several rows, for messages.
const NAMED_ROWS: &str = "gap = { a = [1, -1, 0], b = [0, 1, -1] }";

/// Default of `tolerance`.
const TOLERANCE: f64 = 1e-3;

/// Largest number of characters of a body's name.
const LONGEST_BODY: usize = 40;

/// A row of displacements that walls limit.
#[derive(Clone, Debug)]
pub struct Gap {
    /// Name in contacts; none if the model has one row without a name.
    pub name: Option<String>,
    /// Factors of the displacements.
    pub row: Vec<Expression>,
}

/// What sets the forcing period.
#[derive(Clone, Debug)]
pub enum Clock {
    /// Excitation frequency.
    Frequency(Expression),
    /// Period of the clock of a model without force.
    TimeScale(Expression),
    /// The slowest natural period of a model without force.
    Natural,
}

impl Clock {
    /// Returns the entry of the file.
    pub fn entry(&self) -> Option<&Expression> {
        match self {
            Clock::Frequency(entry) | Clock::TimeScale(entry) => Some(entry),
            Clock::Natural => None,
        }
    }
}

/// Free motion and its gaps.
#[derive(Clone, Debug)]
pub struct MotionTable {
    /// Names of the displacements, one to eight.
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
    /// The unit of time of budgets: the forcing period, or a time that a model without force chooses.
    pub clock: Clock,
    /// Phases at which the stages begin, in turns; empty without stages.
    pub stages: Vec<Expression>,
    /// How often the stages recur in a forcing period.
    pub repeat: u32,
    /// The different entries that contain the phase. Stages of equal length replace them.
    pub by_phase: Vec<Expression>,
    /// Largest error of these stages.
    pub tolerance: f64,
    /// Gaps in the order of the file, one to three.
    pub gaps: Vec<Gap>,
    /// Units of coordinates, gap, time and contact forces.
    pub units: Units,
    /// Whether the file states no force, harmonics or stages.
    pub is_unforced: bool,
}

impl MotionTable {
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
        let vectors = [&self.force, &self.force_sin, &self.stages].into_iter();
        let rows = self.gaps.iter().map(|gap| &gap.row);
        let constant = vectors.chain(rows).chain(&self.mass).chain(harmonics).flatten();
        staged.flat_map(Entry::values).chain(constant).chain(self.clock.entry())
    }
}

/// Reads `[motion]`.
pub(super) fn read(root: &Section<'_>, names: Names<'_>) -> Result<MotionTable, SceneError> {
    root.require("motion", "write [motion] with coordinates, mass, frequency and gap")?;
    let section =
        root.section_among("motion", &MOTION_KEYS, &format!("{}; {LIMITS}", MOTION_KEYS.join(", ")))?;
    let field = section.require("coordinates", "name one to eight, such as coordinates = [\"x\"]")?;
    let some =
        format!("1 to {MOST_COORDINATES} names: a model has at most {MOST_COORDINATES} degrees of freedom");
    let coordinates = read_names(&field, &some)?;
    if !(1..=MOST_COORDINATES).contains(&coordinates.len()) {
        return Err(field.out_of_range(&some));
    }
    let count = coordinates.len();
    let each = "a list of names, one for each coordinate";
    let velocities = match section.get("velocities") {
        Some(field) => {
            let velocities = read_names(&field, each)?;
            field.list_with(count, each)?;
            velocities
        }
        None if count == 1 => vec!["v".to_owned()],
        None => (1..=count).map(|i| format!("v{i}")).collect(),
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
            let items = field.list_with(count, each)?;
            items.iter().map(|item| item.line(LONGEST_BODY)).collect::<Result<_, _>>()?
        }
        None => coordinates.clone(),
    };
    let names = Names { states: &states, ..names };
    let (stages, repeat) = read_stages(&section, names)?;
    let names = Names { stages: stages.len(), ..names };
    let mass = section.require("mass", "write the matrix, such as mass = [[\"m\"]]")?;
    let gaps = read_gaps(&section, names, count)?;
    let harmonics = harmonic::read(root, names, count)?;
    let is_unforced = section.get("force").or_else(|| section.get("force_sin")).is_none()
        && harmonics.is_empty()
        && stages.is_empty();
    Ok(MotionTable {
        is_unforced,
        units: read_units(&section, count, &gaps)?,
        mass: names.matrix(&mass, count)?,
        damping: names.matrix_or_zeros(&section, "damping", count)?,
        stiffness: names.matrix_or_zeros(&section, "stiffness", count)?,
        force: names.vector_or_zeros(&section, "force", count)?,
        force_sin: names.vector_or_zeros(&section, "force_sin", count)?,
        harmonics,
        load: names.vector_or_zeros(&section, "load", count)?,
        clock: read_clock(&section, names, is_unforced)?,
        stages,
        repeat,
        by_phase: Vec::new(),
        tolerance: section.get("tolerance").map_or(Ok(TOLERANCE), |field| read_tolerance(&field))?,
        gaps,
        coordinates,
        velocities,
        bodies,
    })
}

/// Reads the gap row, or the table of named rows.
fn read_gaps(section: &Section<'_>, names: Names<'_>, count: usize) -> Result<Vec<Gap>, SceneError> {
    let field = section.require("gap", "write the gap row, such as gap = [\"1\"]: z = gap . x")?;
    let what = "one gap row";
    let Some(table) = Section::open_any(field.node, &field.path) else {
        if let Value::List(items) = &field.node.value
            && items.iter().any(|item| matches!(item.value, Value::List(_)))
        {
            return Err(field.out_of_range(&format!(
                "{what}: a list of {}; several rows have names, such as {NAMED_ROWS}",
                entries(count)
            )));
        }
        return Ok(vec![Gap { name: None, row: names.vector(&field, count, what)? }]);
    };
    let rows = table.fields_as_written();
    if !(1..=MOST_GAPS).contains(&rows.len()) {
        let remedy = format!("1 to {MOST_GAPS} rows with names, such as {NAMED_ROWS}");
        return Err(field.wrong_count(rows.len(), "rows", &remedy));
    }
    let read_one = |(name, field): (&str, Field<'_>)| {
        check_name(name, &field)?;
        if names.parameters.contains(&name) || names.states.contains(&name) {
            return Err(field.conflict(format!(
                "`{name}` is already the name of a parameter, a coordinate or a velocity; rename the gap or the other"
            )));
        }
        Ok(Gap { name: Some(name.to_owned()), row: names.vector(&field, count, what)? })
    };
    rows.into_iter().map(read_one).collect()
}

/// Returns the field of a gap's row.
pub(super) fn gap_field<'a>(root: &Section<'a>, gap: &Gap) -> Option<Field<'a>> {
    let motion = root.get("motion")?;
    let field = Section::open_any(motion.node, &motion.path)?.get("gap")?;
    match &gap.name {
        Some(name) => Section::open_any(field.node, &field.path)?.get(name),
        None => Some(field),
    }
}

/// Reads the units. A gap has the unit of the coordinates in its row, if they have the same one and plain numbers as
/// factors. The unit of all gaps is theirs if it is the same, unless the file gives another.
fn read_units(section: &Section<'_>, count: usize, gaps: &[Gap]) -> Result<Units, SceneError> {
    let each = "a list of units, one for each coordinate, such as [\"mm\"]";
    let coordinates = match section.get("units") {
        Some(field) => {
            let items = field.list_with(count, each)?;
            items.iter().map(|item| read_unit(item).map(Some)).collect::<Result<_, _>>()?
        }
        None => vec![None; count],
    };
    let unit = |key| section.get(key).map(|field| read_unit(&field)).transpose();
    let (given, time, force) = (unit("gap_unit")?, unit("time_unit")?, unit("force_unit")?);
    let entries = gaps.iter().flat_map(|gap| gap.row.iter().zip(&coordinates));
    let used = entries.filter(|(entry, _)| entry.as_number() != Some(0.0));
    let mut used = used.map(|(entry, unit)| entry.as_number().and(unit.clone()));
    let common = used.next().flatten().filter(|first| used.all(|unit| unit.as_ref() == Some(first)));
    Ok(Units { coordinates, gap: given.or(common), time, force, signals: Vec::new() })
}

fn read_clock(section: &Section<'_>, names: Names<'_>, is_unforced: bool) -> Result<Clock, SceneError> {
    let (scale, frequency) = (section.get("time_scale"), section.get("frequency"));
    if let Some(field) = scale {
        let other = match (is_unforced, frequency) {
            (false, _) => "with a force or stages, the forcing period is the clock; remove it",
            (true, Some(_)) => "`frequency` sets the same clock; remove one of them",
            (true, None) => return Ok(Clock::TimeScale(names.entry(&field)?)),
        };
        return Err(field.conflict(other.to_owned()));
    }
    if is_unforced && frequency.is_none() {
        return Ok(Clock::Natural);
    }
    let field = section.require("frequency", "name it, such as frequency = \"omega\"")?;
    let entry = match field.node.value {
        Value::List(_) => Err(field.wrong_type(
            "one entry, the frequency of the first harmonic, force cos(frequency t) + force_sin sin(frequency t); write \
             multiples of it as [[harmonic]]",
        )),
        _ => names.entry(&field),
    };
    entry.map(Clock::Frequency)
}

/// Reads the phases at which stages begin, and how often these recur.
fn read_stages(section: &Section<'_>, names: Names<'_>) -> Result<(Vec<Expression>, u32), SceneError> {
    let repeat = section.get("repeat");
    let Some(field) = section.get("stages") else {
        let most = MOST_CHANGES as u32 / 2;
        return Ok((Vec::new(), repeat.map_or(Ok(1), |field| field.whole(1..=most))?));
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

fn read_tolerance(field: &Field<'_>) -> Result<f64, SceneError> {
    let tolerance = field.number()?;
    match tolerance > 0.0 && tolerance < 1.0 {
        true => Ok(tolerance),
        false => Err(field.out_of_range("above 0 and below 1, relative to the largest value of an entry")),
    }
}

/// Adds the entries that contain the phase. They are like stages: the model is forced, and needs a frequency.
pub(super) fn add_phase<'e>(
    root: &Section<'_>,
    motion: &mut MotionTable,
    of_walls: impl Iterator<Item = &'e Staged>,
) -> Result<(), SceneError> {
    let own = [&motion.damping, &motion.stiffness].into_iter().flatten().flatten().chain(&motion.load);
    let mut found: Vec<Expression> = own.filter_map(Staged::by_phase).cloned().collect();
    found.extend(of_walls.filter_map(Staged::by_phase).cloned());
    found.sort_by(|a, b| a.text().cmp(b.text()));
    found.dedup_by(|a, b| a.text() == b.text());
    let Some(section) = root.get("motion").and_then(|field| Section::open_any(field.node, &field.path))
    else {
        return Ok(());
    };
    if let Some(entry) = found.first() {
        let stays = matches!(motion.clock, Clock::Frequency(_));
        let remedy = format!("name it, such as frequency = \"omega\": `{}` contains the phase", entry.text());
        return match section.get("time_scale") {
            Some(field) => Err(field.conflict(
                "with an entry that contains the phase, the forcing period is the clock; write `frequency`",
            )),
            None if stays => {
                (motion.by_phase, motion.is_unforced) = (found, false);
                Ok(())
            }
            None => Err(section.missing("frequency", &remedy)),
        };
    }
    for (key, is_idle, what) in [
        (
            "repeat",
            motion.stages.is_empty(),
            "it repeats the stages, but the model has none; write `stages` or remove it",
        ),
        ("tolerance", true, "it is that of entries with `phase`, but the model has none; remove it"),
    ] {
        if let Some(field) = section.get(key).filter(|_| is_idle) {
            return Err(field.conflict(what));
        }
    }
    Ok(())
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
