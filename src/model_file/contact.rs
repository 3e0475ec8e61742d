//! `[[contact]]`: the walls and their contact laws.

use rattlemap_dynamics::model::{Contact, MOST_WALLS, Side};

use super::curve::ForceLaw;
use super::entry::{Entry, Names, Staged};
use super::motion::{self, Gap};
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Keys of `[[contact]]`.
const CONTACT_KEYS: [&str; 13] = [
    "gap",
    "side",
    "at",
    "law",
    "restitution",
    "mesh_speed",
    "stiffness",
    "damping",
    "preload",
    "pull",
    "force",
    "depth_max",
    "tolerance",
];

/// Name of the approach speed in restitution.
const SPEED: &str = "speed";

/// A wall.
#[derive(Clone, Debug)]
pub struct Wall {
    /// Position, as a value of the gap.
    pub at: Expression,
    /// Contact law.
    pub law: WallLaw,
    /// Spring and damper behind the wall; none for a rigid wall.
    pub spring: Option<WallSpring>,
    /// Force as a function of the depth behind the wall, in place of a stiffness.
    pub curve: Option<ForceLaw>,
}

/// The law of contact with a wall.
#[derive(Clone, Debug)]
pub enum WallLaw {
    /// An impact.
    Impact {
        /// Coefficient of restitution. With `by_speed` it contains the approach speed, a name with the index after those of all parameters.
        restitution: Expression,
        /// Whether restitution depends on the approach speed.
        by_speed: bool,
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
    pub preload: Option<Staged>,
}

#[derive(Clone, Copy)]
enum LawKind {
    Impact,
    Elastic,
    Curve,
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

    /// Whether restitution depends on the approach speed.
    pub fn is_by_speed(&self) -> bool {
        matches!(self.law, WallLaw::Impact { by_speed: true, .. })
    }

    /// Returns the entries on which the oscillator depends.
    pub(super) fn shaping_oscillator(&self) -> impl Iterator<Item = &Expression> {
        let curve = self.curve.iter().flat_map(ForceLaw::entries);
        self.staged().flat_map(Entry::values).chain([&self.at]).chain(curve)
    }

    /// Returns the entries that may change with time.
    pub(super) fn staged(&self) -> impl Iterator<Item = &Staged> {
        self.spring
            .iter()
            .flat_map(|spring| [&spring.stiffness, &spring.damping].into_iter().chain(&spring.preload))
    }

    /// Returns the entries on which the contact law depends.
    pub(super) fn shaping_law(&self) -> impl Iterator<Item = &Expression> {
        let both = match &self.law {
            WallLaw::Impact { restitution, mesh_speed, .. } => Some([restitution, mesh_speed]),
            WallLaw::Elastic { .. } => None,
        };
        both.into_iter().flatten()
    }
}

/// Reads the walls of each gap on the right and on the left, from the inside to the outside. A model with one gap may have none if
/// it has friction or nonlinear springs, and so `may_lack_walls`. `defaults` are those of the parameters.
pub(super) fn read(
    root: &Section<'_>,
    names: Names<'_>,
    gaps: &[Gap],
    defaults: &[f64],
    may_lack_walls: bool,
) -> Result<Vec<[Vec<Wall>; 2]>, SceneError> {
    let mut walls: Vec<[Vec<Wall>; 2]> = gaps.iter().map(|_| Default::default()).collect();
    let remedy = "write [[contact]] with side, at and law; only a model with [[friction]] or [[spring]] may have no wall";
    let field = match (root.get("contact"), gaps) {
        (None, [_]) if may_lack_walls => return Ok(walls),
        (None, _) => return Err(root.missing("contact", remedy)),
        (Some(field), _) => field,
    };
    let most = 2 * MOST_WALLS * gaps.len();
    let owner = if gaps.len() == 1 { "a model" } else { "a gap" };
    let some = format!("1 to {most} tables, [[contact]]: {owner} has up to 4 walls on each side");
    for item in &field.list_of(1..=most, "tables", &some)? {
        let section = Section::open(item.node, &item.path, &CONTACT_KEYS)?;
        let gap = read_gap(&section, gaps)?;
        let (side, field, wall) = read_one(&section, names, defaults)?;
        let own: &mut Vec<Wall> = &mut walls[gap][side.index()];
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
        if own.last().is_some_and(|inner| inner.curve.is_some()) {
            return Err(field.conflict(
                "the wall before it on this side has law = \"curve\", which only the last wall of a side may have",
            ));
        }
        if own.len() == MOST_WALLS {
            return Err(field.conflict(format!(
                "there are already 4 walls on this side; {owner} has up to 4 on each side"
            )));
        }
        own.push(wall);
    }
    let is_bare = |(_, walls): &(&Gap, &[Vec<Wall>; 2])| walls.iter().all(Vec::is_empty);
    if let Some((gap, _)) = gaps.iter().zip(&walls).find(is_bare)
        && let (Some(name), Some(field)) = (&gap.name, motion::gap_field(root, gap))
    {
        return Err(field.conflict(format!(
            "no wall limits this gap; write a [[contact]] with gap = \"{name}\", or remove the row"
        )));
    }
    Ok(walls)
}

/// Returns the index of a contact's gap.
fn read_gap(section: &Section<'_>, gaps: &[Gap]) -> Result<usize, SceneError> {
    let names: Vec<(&str, usize)> =
        gaps.iter().zip(0..).filter_map(|(gap, i)| Some((gap.name.as_deref()?, i))).collect();
    match (section.get("gap"), names.first()) {
        (Some(field), Some(_)) => field.choice(&names),
        (None, None) => Ok(0),
        (None, Some(_)) => {
            let list: Vec<String> = names.iter().map(|(name, _)| format!("gap = \"{name}\"")).collect();
            let remedy = format!("the gaps in [motion] have names: write {}", list.join(" or "));
            Err(section.missing("gap", &remedy))
        }
        (Some(field), None) => Err(field.conflict(
            "the gap row in [motion] has no name; remove it, or name the rows, such as gap = { a = [1, -1] }",
        )),
    }
}

/// Reads restitution, and whether it depends on the approach speed.
fn read_restitution(
    field: &Field<'_>,
    names: Names<'_>,
    defaults: &[f64],
) -> Result<(Expression, bool), SceneError> {
    let speed = names.parameters.len();
    let known: Vec<&str> = names.parameters.iter().copied().chain([SPEED]).collect();
    let restitution = Names { parameters: &known, ..names }.entry(field)?;
    let is_used = |index: usize| restitution.uses().contains(&index);
    let of_model = names.parameters.iter().position(|name| *name == SPEED);
    if of_model.is_some_and(is_used) || is_used(speed) && names.states.contains(&SPEED) {
        return Err(field.conflict(format!(
            "in a restitution `{SPEED}` is the approach speed, and the model has a parameter, a coordinate or a velocity of this name; rename it"
        )));
    }
    if is_used(speed) && restitution.power_law(speed, &|index| defaults[index]).is_none() {
        return Err(field.conflict(format!(
            "a restitution that depends on the approach speed has the form c + f*{SPEED}^p, where c, f and p do not contain `{SPEED}`, such as \
             \"0.9 - 0.1*{SPEED}^0.2\"; values below 0 and above 1 count as 0 and 1"
        )));
    }
    let by_speed = is_used(speed);
    Ok((restitution, by_speed))
}

fn read_one<'a>(
    section: &Section<'a>,
    names: Names<'_>,
    defaults: &[f64],
) -> Result<(Side, Field<'a>, Wall), SceneError> {
    let side = section.require("side", "write side = \"right\" (z <= at) or side = \"left\" (z >= at)")?;
    let which = side.choice(&[("right", Side::Right), ("left", Side::Left)])?;
    let at = section.require("at", "write where the wall is, such as at = \"b\"")?;
    let at = names.entry(&at)?;
    let law = section.require("law", "write law = \"impact\", law = \"elastic\" or law = \"curve\"")?;
    let entry = |name: &str| section.get(name).map(|field| names.entry(&field)).transpose();
    let staged = |name: &str| section.get(name).map(|field| Staged::read(&field, names)).transpose();
    let (stiffness, damping, preload) = (staged("stiffness")?, staged("damping")?, staged("preload")?);
    let kinds = [("impact", LawKind::Impact), ("elastic", LawKind::Elastic), ("curve", LawKind::Curve)];
    let kind = law.choice(&kinds)?;
    let others: &[&str] = match kind {
        LawKind::Curve => &["stiffness", "preload", "restitution", "mesh_speed"],
        _ => &["force", "depth_max", "tolerance"],
    };
    if let Some(field) = others.iter().find_map(|key| section.get(key)) {
        return Err(field.conflict(match kind {
            LawKind::Curve => {
                "it does not belong to law = \"curve\", whose force is given by `force`; remove it"
            }
            _ => "it needs law = \"curve\"; remove it, or change the law",
        }));
    }
    let mut curve = None;
    let pulls = || section.get("pull").map_or(Ok(true), |field| field.flag());
    // A spring alone never pulls.
    let may_pull = damping.is_some() || preload.is_some();
    let law = match kind {
        LawKind::Impact => {
            for name in ["preload", "pull"] {
                if let Some(field) = section.get(name) {
                    return Err(field.conflict("it needs law = \"elastic\"; remove it, or change the law"));
                }
            }
            let restitution = section.require("restitution", "an impact needs one: w+ = -restitution w-")?;
            let (restitution, by_speed) = read_restitution(&restitution, names, defaults)?;
            let mesh_speed = entry("mesh_speed")?.unwrap_or_else(Entry::zero);
            WallLaw::Impact { restitution, by_speed, mesh_speed }
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
            WallLaw::Elastic { pulls: pulls()? || !may_pull }
        }
        LawKind::Curve => {
            curve = Some(ForceLaw::of_wall(section, names)?);
            WallLaw::Elastic { pulls: pulls()? }
        }
    };
    let spring = (stiffness.is_some() || damping.is_some() || curve.is_some()).then(|| WallSpring {
        stiffness: stiffness.unwrap_or_else(Entry::zero),
        damping: damping.unwrap_or_else(Entry::zero),
        preload,
    });
    Ok((which, side, Wall { at, law, spring, curve }))
}
