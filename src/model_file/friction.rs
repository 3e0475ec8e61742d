//! `[[friction]]`: dry friction.

use nalgebra::DVector;
use rattlemap_dynamics::model::{self, MOST_FRICTION};

use super::entry::{Entry, Names};
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Keys of `[[friction]]`.
const FRICTION_KEYS: [&str; 3] = ["row", "force", "speed"];

/// Dry friction along a row of velocities: the surfaces slide at the rate `row . v - speed`.
#[derive(Clone, Debug)]
pub struct DryFriction {
    /// Factors of the velocities in the sliding rate.
    pub row: Vec<Expression>,
    /// Friction force while the surfaces slide, and the largest one while they stick.
    pub force: Expression,
    /// Speed of the other surface.
    pub speed: Expression,
}

impl DryFriction {
    /// Returns all entries.
    pub(super) fn entries(&self) -> impl Iterator<Item = &Expression> {
        self.row.iter().chain([&self.force, &self.speed])
    }

    /// Returns the friction for values of the parameters, which `of` inserts.
    pub(super) fn evaluated(&self, of: impl Fn(&Expression) -> f64) -> model::DryFriction {
        let row = DVector::from_iterator(self.row.len(), self.row.iter().map(&of));
        model::DryFriction { row, force: of(&self.force), speed: of(&self.speed) }
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
        let force = section.require("force", "write the friction force of sliding, such as force = \"f\"")?;
        let speed = section.get("speed").map(|field| names.entry(&field)).transpose()?;
        let force = names.entry(&force)?;
        Ok(DryFriction { row, force, speed: speed.unwrap_or_else(Entry::zero) })
    };
    items.iter().map(read_one).collect()
}
