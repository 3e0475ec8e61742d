//! `[[contact]]`: the walls and their contact laws.

use rattlemap_dynamics::model::{Contact, MOST_WALLS, Side};

use super::entry::{Entry, Names, Staged};
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Keys of `[[contact]]`.
const CONTACT_KEYS: [&str; 9] =
    ["side", "at", "law", "restitution", "mesh_speed", "stiffness", "damping", "preload", "pull"];

/// A wall.
#[derive(Clone, Debug)]
pub struct Wall {
    /// Position, as a value of the gap.
    pub at: Expression,
    /// Contact law.
    pub law: WallLaw,
    /// Spring and damper behind the wall; none for a rigid wall.
    pub spring: Option<WallSpring>,
}

/// The law of contact with a wall.
#[derive(Clone, Debug)]
pub enum WallLaw {
    /// An impact.
    Impact {
        /// Coefficient of restitution.
        restitution: Expression,
        /// Largest leaving speed at which contact is sustained.
        mesh_speed: Expression,
    },
    /// The motion continues behind the wall without a jump.
    Elastic {
        /// Whether the contact force may pull towards the wall.
        pulls: bool,
    },
}

/// A spring, a damper and a preload along the gap row.
#[derive(Clone, Debug)]
pub struct WallSpring {
    /// Stiffness.
    pub stiffness: Staged,
    /// Damping.
    pub damping: Staged,
    /// Force at the wall, positive away from it.
    pub preload: Staged,
}

#[derive(Clone, Copy)]
enum LawKind {
    Impact,
    Elastic,
}

impl Wall {
    /// Returns the kind of contact.
    pub fn contact(&self) -> Contact {
        match (&self.law, &self.spring) {
            (WallLaw::Elastic { pulls: true }, _) => Contact::Elastic,
            (WallLaw::Elastic { pulls: false }, _) => Contact::Pushing,
            (WallLaw::Impact { .. }, Some(_)) => Contact::Impact,
            (WallLaw::Impact { .. }, None) => Contact::Rigid,
        }
    }

    /// Returns the entries on which the oscillator depends.
    pub(super) fn shaping_oscillator(&self) -> impl Iterator<Item = &Expression> {
        let spring =
            self.spring.iter().flat_map(|spring| [&spring.stiffness, &spring.damping, &spring.preload]);
        spring.flat_map(Entry::values).chain([&self.at])
    }

    /// Returns the entries on which the contact law depends.
    pub(super) fn shaping_law(&self) -> impl Iterator<Item = &Expression> {
        let both = match &self.law {
            WallLaw::Impact { restitution, mesh_speed } => Some([restitution, mesh_speed]),
            WallLaw::Elastic { .. } => None,
        };
        both.into_iter().flatten()
    }
}

/// Reads the walls of the right and of the left side, from the inside to the outside. A model may have none if it has friction.
pub(super) fn read(
    root: &Section<'_>,
    names: Names<'_>,
    has_friction: bool,
) -> Result<[Vec<Wall>; 2], SceneError> {
    let remedy = "write [[contact]] with side, at and law; only a model with [[friction]] may have no wall";
    let field = match root.get("contact") {
        None if has_friction => return Ok(Default::default()),
        None => return Err(root.missing("contact", remedy)),
        Some(field) => field,
    };
    let some = "1 to 8 tables, [[contact]]: a model has up to 4 walls on each side";
    let items = field.list(some)?;
    if !(1..=2 * MOST_WALLS).contains(&items.len()) {
        return Err(field.wrong_count(items.len(), "tables", some));
    }
    let mut walls = [Vec::new(), Vec::new()];
    for item in &items {
        let (side, field, wall) = read_one(item, names)?;
        let own: &mut Vec<Wall> = &mut walls[side.index()];
        if own.last().is_some_and(|inner| matches!(inner.law, WallLaw::Impact { .. })) {
            return Err(field.conflict(
                "the wall before it on this side has impacts, so that no motion reaches this one; write the walls of a side from \
                 the inside to the outside, elastic ones first",
            ));
        }
        if own.last().is_some_and(|inner| matches!(inner.law, WallLaw::Elastic { pulls: false })) {
            return Err(field.conflict(
                "the wall before it on this side has `pull = false`, which only the last wall of a side may have",
            ));
        }
        if own.len() == MOST_WALLS {
            return Err(
                field.conflict("there are already 4 walls on this side; a model has up to 4 on each side")
            );
        }
        own.push(wall);
    }
    Ok(walls)
}

fn read_one<'a>(item: &Field<'a>, names: Names<'_>) -> Result<(Side, Field<'a>, Wall), SceneError> {
    let section = Section::open(item.node, &item.path, &CONTACT_KEYS)?;
    let side = section.require("side", "write side = \"right\" (z <= at) or side = \"left\" (z >= at)")?;
    let which = side.choice(&[("right", Side::Right), ("left", Side::Left)])?;
    let at = section.require("at", "write where the wall is, such as at = \"b\"")?;
    let at = names.entry(&at)?;
    let law = section.require("law", "write law = \"impact\" or law = \"elastic\"")?;
    let entry = |name: &str| section.get(name).map(|field| names.entry(&field)).transpose();
    let staged = |name: &str| section.get(name).map(|field| Staged::read(&field, names)).transpose();
    let (stiffness, damping, preload) = (staged("stiffness")?, staged("damping")?, staged("preload")?);
    let law = match law.choice(&[("impact", LawKind::Impact), ("elastic", LawKind::Elastic)])? {
        LawKind::Impact => {
            for name in ["preload", "pull"] {
                if let Some(field) = section.get(name) {
                    return Err(field.conflict("it needs law = \"elastic\"; remove it, or change the law"));
                }
            }
            let restitution = section.require("restitution", "an impact needs one: w+ = -restitution w-")?;
            let restitution = names.entry(&restitution)?;
            WallLaw::Impact { restitution, mesh_speed: entry("mesh_speed")?.unwrap_or_else(Entry::zero) }
        }
        LawKind::Elastic => {
            for name in ["restitution", "mesh_speed"] {
                if let Some(field) = section.get(name) {
                    return Err(field.conflict(
                        "it needs law = \"impact\", because elastic contact has no jump; remove it, or change the law",
                    ));
                }
            }
            section.require("stiffness", "an elastic wall needs the stiffness behind it")?;
            WallLaw::Elastic { pulls: section.get("pull").map_or(Ok(true), |field| field.flag())? }
        }
    };
    let spring = (stiffness.is_some() || damping.is_some()).then(|| WallSpring {
        stiffness: stiffness.unwrap_or_else(Entry::zero),
        damping: damping.unwrap_or_else(Entry::zero),
        preload: preload.unwrap_or_else(Entry::zero),
    });
    Ok((which, side, Wall { at, law, spring }))
}
