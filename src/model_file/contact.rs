//! `[[contact]]`: the walls, one or two, and what they do.

use rattlemap_dynamics::model::{Contact, Side};

use super::entry::Names;
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Its keys.
const CONTACT_KEYS: [&str; 7] = ["side", "at", "law", "restitution", "mesh_speed", "stiffness", "damping"];

/// A wall.
#[derive(Clone, Debug)]
pub struct Wall {
    /// Where it is, on the scale of the gap.
    pub at: Expression,
    /// What happens there.
    pub law: WallLaw,
    /// What lies behind it; none where it does not yield.
    pub spring: Option<WallSpring>,
}

/// What happens at a wall.
#[derive(Clone, Debug)]
pub enum WallLaw {
    /// An impact.
    Impact {
        /// Coefficient of restitution.
        restitution: Expression,
        /// Leaving speed at or below which a pressed contact lasts.
        mesh_speed: Expression,
    },
    /// The motion goes on behind the wall.
    Elastic,
}

/// A spring and a damper along the gap row.
#[derive(Clone, Debug)]
pub struct WallSpring {
    /// Stiffness.
    pub stiffness: Expression,
    /// Damping.
    pub damping: Expression,
}

#[derive(Clone, Copy)]
enum LawKind {
    Impact,
    Elastic,
}

impl Wall {
    /// What it is to the oscillator.
    pub fn contact(&self) -> Contact {
        match (&self.law, &self.spring) {
            (WallLaw::Elastic, _) => Contact::Elastic,
            (WallLaw::Impact { .. }, Some(_)) => Contact::Impact,
            (WallLaw::Impact { .. }, None) => Contact::Rigid,
        }
    }

    /// Entries that the oscillator depends on.
    pub(super) fn shaping_oscillator(&self) -> impl Iterator<Item = &Expression> {
        let spring = self.spring.iter().flat_map(|spring| [&spring.stiffness, &spring.damping]);
        spring.chain([&self.at])
    }

    /// Entries that the law depends on.
    pub(super) fn shaping_law(&self) -> impl Iterator<Item = &Expression> {
        let both = match &self.law {
            WallLaw::Impact { restitution, mesh_speed } => Some([restitution, mesh_speed]),
            WallLaw::Elastic => None,
        };
        both.into_iter().flatten()
    }
}

/// Reads the walls: right, left.
pub(super) fn read(root: &Section<'_>, names: Names<'_>) -> Result<[Option<Wall>; 2], SceneError> {
    let field = root.require("contact", "write [[contact]] with side, at and law; a model has one or two")?;
    let two = "one or two tables, [[contact]]: a model has at most two walls, one on each side";
    let items = field.list(two)?;
    if !(1..=2).contains(&items.len()) {
        return Err(field.wrong_count(items.len(), "tables", two));
    }
    let mut walls = [None, None];
    for item in &items {
        let (side, field, wall) = read_one(item, names)?;
        if walls[side.index()].is_some() {
            return Err(
                field.conflict("there is a wall on this side already; a model has one on each side at most")
            );
        }
        walls[side.index()] = Some(wall);
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
    let zero = || Expression::number(0.0);
    let (stiffness, damping) = (entry("stiffness")?, entry("damping")?);
    let law = match law.choice(&[("impact", LawKind::Impact), ("elastic", LawKind::Elastic)])? {
        LawKind::Impact => {
            let restitution = section.require("restitution", "an impact needs one: w+ = -restitution w-")?;
            let restitution = names.entry(&restitution)?;
            WallLaw::Impact { restitution, mesh_speed: entry("mesh_speed")?.unwrap_or_else(zero) }
        }
        LawKind::Elastic => {
            for name in ["restitution", "mesh_speed"] {
                if let Some(field) = section.get(name) {
                    return Err(field.conflict(
                        "it belongs to law = \"impact\" alone: elastic contact has no jump; drop it, or change the law",
                    ));
                }
            }
            section.require("stiffness", "an elastic wall needs the stiffness behind it")?;
            WallLaw::Elastic
        }
    };
    let spring = (stiffness.is_some() || damping.is_some()).then(|| WallSpring {
        stiffness: stiffness.unwrap_or_else(zero),
        damping: damping.unwrap_or_else(zero),
    });
    Ok((which, side, Wall { at, law, spring }))
}
