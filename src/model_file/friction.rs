//! `[[friction]]`: dry friction.

use nalgebra::DVector;
use rattlemap_dynamics::model::{self, MOST_FRICTION, MOST_PIECES};

use super::entry::{Entry, Names};
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Keys of `[[friction]]`.
const FRICTION_KEYS: [&str; 5] = ["row", "force", "static", "force_at_speed", "speed"];

/// Dry friction along a row of velocities: the surfaces slide at the rate `row . v - speed`.
#[derive(Clone, Debug)]
pub struct DryFriction {
    /// Factors of the velocities in the sliding rate.
    pub row: Vec<Expression>,
    /// Friction force when sliding begins.
    pub force: Expression,
    /// Further sliding rates and the forces there.
    pub at_speed: Vec<[Expression; 2]>,
    /// Largest force while the surfaces stick, if it differs from `force`.
    pub static_force: Option<Expression>,
    /// Speed of the other surface.
    pub speed: Expression,
}

impl DryFriction {
    /// Returns the entries of the forces.
    pub(super) fn entries_of_force(&self) -> impl Iterator<Item = &Expression> {
        self.at_speed.iter().map(|point| &point[1]).chain(&self.static_force).chain([&self.force])
    }

    /// Returns all entries.
    pub(super) fn entries(&self) -> impl Iterator<Item = &Expression> {
        let rates = self.at_speed.iter().map(|point| &point[0]);
        self.row.iter().chain([&self.speed]).chain(rates).chain(self.entries_of_force())
    }

    /// Returns the friction for values of the parameters, which `of` inserts.
    pub(super) fn evaluated(&self, of: impl Fn(&Expression) -> f64) -> model::DryFriction {
        let row = DVector::from_iterator(self.row.len(), self.row.iter().map(&of));
        let force = of(&self.force);
        model::DryFriction {
            row,
            force,
            at_speed: self.at_speed.iter().map(|point| point.each_ref().map(&of)).collect(),
            static_force: self.static_force.as_ref().map_or(force, &of),
            speed: of(&self.speed),
        }
    }
}

/// Reads the friction of a model with `count` coordinates, in the order of the file.
pub(super) fn read(
    root: &Section<'_>,
    names: Names<'_>,
    count: usize,
) -> Result<Vec<DryFriction>, SceneError> {
    let Some(field) = root.get("friction") else { return Ok(Vec::new()) };
    let tables = match count {
        1 => "at most 1 table, [[friction]], for one coordinate: friction forces on it add to one".to_owned(),
        _ => format!("at most {MOST_FRICTION} tables, [[friction]], each with row and force"),
    };
    let items = field.list_of(0..=count.min(MOST_FRICTION), "tables", &tables)?;
    let read_one = |item: &Field<'_>| {
        let section = Section::open(item.node, &item.path, &FRICTION_KEYS)?;
        let row = match section.get("row") {
            Some(field) => names.vector(&field, count, "the row of the sliding rate, row . v - speed")?,
            None if count == 1 => vec![Expression::number(1.0)],
            None => {
                let remedy = "write the factors of the velocities in the sliding rate, such as row = [1, -1]";
                return Err(section.missing("row", remedy));
            }
        };
        let entry = |key: &str| section.get(key).map(|field| names.entry(&field)).transpose();
        let (force, at_speed) = match (section.get("force_at_speed"), section.get("force")) {
            (Some(field), None) => by_speed(&field, names)?,
            (Some(field), Some(_)) => {
                return Err(field.conflict("it says what `force` says; remove one of them"));
            }
            (None, _) => {
                let remedy = "write the friction force of sliding, such as force = \"f\"";
                (names.entry(&section.require("force", remedy)?)?, Vec::new())
            }
        };
        let (static_force, speed) = (entry("static")?, entry("speed")?.unwrap_or_else(Entry::zero));
        Ok(DryFriction { row, force, at_speed, static_force, speed })
    };
    items.iter().map(read_one).collect()
}

/// Reads the friction force as a function of the modulus of the sliding rate: the force at rate 0, and further points.
fn by_speed(field: &Field<'_>, names: Names<'_>) -> Result<(Expression, Vec<[Expression; 2]>), SceneError> {
    let pairs = "pairs of a sliding rate and a force, the first one at rate 0, such as [[0, 0.3], [1, 0.2]]";
    let read_pair = |item: &Field<'_>| match &item.list_with(2, pairs)?[..] {
        [rate, force] => Ok([names.entry(rate)?, names.entry(force)?]),
        _ => unreachable!("the list has two entries"),
    };
    let items = field.list_of(1..=MOST_PIECES, "pairs", pairs)?;
    let mut points = items.iter().map(read_pair).collect::<Result<Vec<_>, _>>()?;
    let [rate, force] = points.remove(0);
    if rate.as_number() != Some(0.0) {
        return Err(field.conflict("the first pair must have the sliding rate 0"));
    }
    Ok((force, points))
}
