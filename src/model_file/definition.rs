//! The contents of a model file, and the oscillator and contact law that it defines.

use rattlemap_dynamics::model::{
    Contact, Domain, Harmonic, Law, MOST_FRICTION, ModelError, Oscillator, OscillatorError, OuterWall,
    Parameter, Shapes, Side, Stage,
};

use super::contact::{self, Wall, WallLaw};
use super::entry::{Names, Staged};
use super::friction::{self, DryFriction};
use super::harmonic::HarmonicForce;
use super::motion::{self, Motion};
use super::{FileModel, parameters};
use crate::text::document::{self, Node, Value};
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Keys outside of any table, and the names of the tables.
#[rustfmt::skip]
const MODEL_KEYS: [&str; 10] = [
    "name", "title", "summary", "source", "notes", "parameters", "motion", "harmonic", "contact", "friction",
];

/// Largest number of characters of a model's name, which occurs in scenes and file names.
const LONGEST_MODEL_NAME: usize = 40;

/// Largest number of characters of title, summary and source, which are one line each.
const LONGEST_LINE: usize = 200;

/// Largest number of characters of the notes.
const LONGEST_NOTES: usize = 4000;

/// The contents of a model file.
#[derive(Clone, Debug)]
pub struct Definition {
    /// The text of the file.
    pub text: String,
    /// Name in scenes.
    pub name: String,
    /// Name in headings.
    pub title: String,
    /// Description in one line.
    pub summary: Option<String>,
    /// Publication or other source.
    pub source: Option<String>,
    /// Further notes for users.
    pub notes: Option<String>,
    /// Parameters, in the order of the file.
    pub parameters: Vec<Parameter>,
    /// Default of each parameter, also of those that a scene must set.
    pub defaults: Vec<f64>,
    /// Free motion.
    pub motion: Motion,
    /// Right and left walls of each gap, from the inside to the outside.
    pub walls: Vec<[Vec<Wall>; 2]>,
    /// Dry friction.
    pub friction: Vec<DryFriction>,
}

/// Definitions are equal if their texts are.
impl PartialEq for Definition {
    fn eq(&self, other: &Definition) -> bool {
        self.text == other.text
    }
}

/// Reads a model file and checks that the model has a motion at its defaults.
pub(super) fn read(text: &str, file: &str) -> Result<FileModel, SceneError> {
    let document = document::read(text, file)?;
    refuse_scene(&document)?;
    let root = Section::open(&document, "", &MODEL_KEYS)?;
    let name = root.require("name", "name the model, such as name = \"my-model\"")?;
    let name = read_name(&name)?;
    let line = |key| root.get(key).map(|field| field.line(LONGEST_LINE)).transpose();
    let notes = root.get("notes").map(|field| field.lines(LONGEST_NOTES)).transpose()?;
    let written = parameters::read(&root)?;
    let names: Vec<&str> = written.iter().map(|parameter| parameter.name.as_str()).collect();
    let names = Names { parameters: &names, states: &[], stages: 0 };
    let motion = motion::read(&root, names)?;
    let states: Vec<&str> = motion.state_names().collect();
    let names = Names { states: &states, stages: motion.stages.len(), ..names };
    let friction = friction::read(&root, names, motion.degrees())?;
    let defaults: Vec<f64> = written.iter().map(|parameter| parameter.default).collect();
    let walls = contact::read(&root, names, &motion.gaps, &defaults, !friction.is_empty())?;
    let mut definition = Definition {
        text: text.to_owned(),
        title: line("title")?.unwrap_or_else(|| name.clone()),
        name,
        summary: line("summary")?,
        source: line("source")?,
        notes,
        defaults,
        parameters: Vec::new(),
        motion,
        walls,
        friction,
    };
    let shapes: Vec<Shapes> = (0..written.len()).map(|index| definition.shaped_by(index)).collect();
    definition.parameters =
        written.into_iter().zip(shapes).map(|(written, shapes)| written.into_parameter(shapes)).collect();
    let model = FileModel::new(definition);
    match rattlemap_dynamics::flow::Flow::validate(&model) {
        Ok(_) => Ok(model),
        Err(error) => Err(no_motion(&root, &model.definition, &error)),
    }
}

/// Refuses the text of a scene.
fn refuse_scene(document: &Node) -> Result<(), SceneError> {
    let Some(root) = Section::open_any(document, "") else { return Ok(()) };
    match ["axis", "cells"].into_iter().find_map(|key| root.get(key)) {
        Some(field) if root.get("motion").is_none() => Err(field.misplaced(
            "this file is a scene, but a model is needed: give the model's name or file, as the scene does under `model`",
        )),
        _ => Ok(()),
    }
}

fn read_name(field: &Field<'_>) -> Result<String, SceneError> {
    let name = field.text()?;
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let is_name = name.chars().all(is_word) && name.starts_with(|c: char| c.is_ascii_alphanumeric());
    match is_name && name.len() <= LONGEST_MODEL_NAME {
        true => Ok(name.to_owned()),
        false => Err(field.out_of_range(&format!(
            "1 to {LONGEST_MODEL_NAME} letters, digits and hyphens, such as my-model"
        ))),
    }
}

/// Builds the error for a model without motion at its defaults, at the place of the field with the error.
fn no_motion(root: &Section<'_>, definition: &Definition, error: &ModelError) -> SceneError {
    let (table, key) = blame(error, definition);
    let refuse =
        |field: &Field<'_>| field.conflict(format!("at the defaults of {}, {error}", definition.name));
    if let Table::Gap(nth) = table
        && let Some(field) = definition.motion.gaps.get(nth).and_then(|gap| motion::gap_field(root, gap))
    {
        return refuse(&field);
    }
    let mut before = 0;
    let mut is_meant = |of: &Field<'_>| {
        let Value::Table(fields) = &of.node.value else { return false };
        let is_of = |gap: usize| {
            let written = fields.get("gap").map(|node| &node.value);
            let name = definition.motion.gaps[gap].name.as_deref();
            matches!((written, name), (Some(Value::Text(written)), Some(name)) if written == name)
                || name.is_none()
        };
        let is = match (table, fields.get("side").or(fields.get("order")).map(|node| &node.value)) {
            (Table::Wall(gap, None), _) => is_of(gap),
            (Table::Wall(gap, Some((side, nth))), Some(Value::Text(name))) => {
                let is_on_side = (name == "right") == (side == Side::Right) && is_of(gap);
                before += usize::from(is_on_side);
                is_on_side && before == nth
            }
            (Table::Harmonic(order), Some(Value::Integer(own))) => *own == order,
            (Table::Friction(nth), _) => {
                before += 1;
                before == nth
            }
            _ => false,
        };
        is && fields.contains_key(key)
    };
    let list = match table {
        Table::Harmonic(_) => "harmonic",
        Table::Friction(_) => "friction",
        Table::Motion | Table::Gap(_) | Table::Wall(..) => "contact",
    };
    let items = root.get(list).and_then(|field| field.list("").ok()).unwrap_or_default();
    let opened = match items.iter().find(|item| is_meant(item)) {
        Some(item) => Section::open_any(item.node, &item.path),
        None => root.get("motion").and_then(|motion| Section::open_any(motion.node, &motion.path)),
    };
    match opened.and_then(|section| section.get(key)) {
        Some(field) => refuse(&field),
        None => root.no_motion("the defaults", error),
    }
}

#[derive(Clone, Copy)]
enum Table {
    Motion,
    /// The row of a gap, counted from 0.
    Gap(usize),
    /// A wall: the gap, counted from 0, and the side and the wall on it, counted from 1.
    Wall(usize, Option<(Side, usize)>),
    /// The harmonic of an order.
    Harmonic(i64),
    /// An element with dry friction, counted from 1.
    Friction(usize),
}

/// Returns the table and the key of the quantity that an error names.
fn blame<'e>(error: &'e ModelError, definition: &Definition) -> (Table, &'e str) {
    let ModelError::Oscillator(error) = error else { return (Table::Motion, "") };
    let quantity = match error {
        OscillatorError::OutOfRange { quantity, .. }
        | OscillatorError::NotSymmetric { quantity, .. }
        | OscillatorError::NotAlongGap { quantity, .. } => quantity.as_str(),
        OscillatorError::NotDefinite { .. } => "mass",
        OscillatorError::Walls { walls } => return (Table::Wall(definition.gap_between(*walls), None), "at"),
    };
    if let Some((what, nth)) = quantity.rsplit_once("of friction") {
        let key = ["force", "speed"].into_iter().find(|key| what.starts_with(key));
        // The determinant is that of both rows.
        let last = definition.friction.len();
        return (Table::Friction(nth.trim().parse().unwrap_or(last)), key.unwrap_or("row"));
    }
    if quantity == "rigid walls" {
        return (Table::Friction(MOST_FRICTION), "force");
    }
    let side = match (quantity.contains("right wall"), quantity.contains("left wall")) {
        (true, _) => Some(Side::Right),
        (_, true) => Some(Side::Left),
        _ => None,
    };
    let nth = quantity.split_once(" wall ").and_then(|(_, nth)| nth.split(' ').next()?.parse().ok());
    let side = side.map(|side| (side, nth.unwrap_or(1)));
    let of_gap = quantity.rsplit_once(" gap ").and_then(|(_, nth)| nth.parse().ok());
    let gap = of_gap.map_or(0, |nth: usize| nth - 1);
    match quantity.split(' ').next().unwrap_or_default() {
        "entry" | "the" => (Table::Motion, "gap"),
        "row" => (Table::Gap(gap), "gap"),
        "independence" => (Table::Motion, "gap"),
        "lowest" => (Table::Motion, "mass"),
        "difference" => (Table::Motion, if quantity.contains("mass") { "mass" } else { "stiffness" }),
        "excitation" => (Table::Motion, "frequency"),
        "phase" => (Table::Motion, "stages"),
        name @ ("cosine" | "sine") => {
            let order = quantity.rsplit(' ').next().and_then(|order| order.parse().ok());
            if order == Some(1) {
                return (Table::Motion, if name == "sine" { "force_sin" } else { "force" });
            }
            (Table::Harmonic(order.unwrap_or_default()), if name == "sine" { "sin" } else { "cos" })
        }
        "position" => (Table::Wall(gap, side), "at"),
        "load" if side.is_some() => (Table::Wall(gap, side), "at"),
        "mesh" | "mesh_speed" => (Table::Wall(gap, side), "mesh_speed"),
        "restitution" | "slope" | "exponent" => (Table::Wall(gap, side), "restitution"),
        key @ ("damping" | "stiffness" | "preload") if side.is_some() => (Table::Wall(gap, side), key),
        key => (Table::Motion, key),
    }
}

impl Definition {
    /// Returns the first wall on a side of the first gap.
    pub fn wall(&self, side: Side) -> Option<&Wall> {
        self.walls[0][side.index()].first()
    }

    /// Returns what depends on the parameter with this index.
    fn shaped_by(&self, index: usize) -> Shapes {
        let uses = |entry: &Expression| entry.uses().contains(&index);
        let walls = || self.walls.iter().flatten().flatten();
        let oscillator = self.motion.entries().any(uses)
            || walls().flat_map(Wall::shaping_oscillator).any(uses)
            || self.friction.iter().flat_map(DryFriction::entries).any(uses);
        let law = walls().flat_map(Wall::shaping_law).any(uses);
        // A machine has its own contact laws.
        if self.is_machine() { Shapes::new(oscillator || law, false) } else { Shapes::new(oscillator, law) }
    }

    /// Returns the index of the gap whose first walls have these positions at the defaults; 0 if there is none.
    fn gap_between(&self, walls: [f64; 2]) -> usize {
        let at = |wall: &Wall| wall.at.evaluate(&|index| self.defaults[index]);
        let found = |own: &[Vec<Wall>; 2]| own.each_ref().map(|side| side.first().map(at)) == walls.map(Some);
        self.walls.iter().position(found).unwrap_or(0)
    }

    /// Builds the oscillator for values of the parameters. The caller validates it.
    pub(super) fn oscillator(&self, values: &[f64]) -> Result<Oscillator, OscillatorError> {
        if self.is_machine() {
            return self.machine(values).map(Oscillator::of_machine);
        }
        let of = |entry: &Expression| entry.evaluate(&|index| values[index]);
        let motion = &self.motion;
        let gap = vector(&motion.gaps[0].row, of);
        let mut mass = matrix(&motion.mass, of);
        if motion.degrees() == 1 {
            // The second displacement does not exist; its mass must not be 0.
            mass[1][1] = 1.0;
        }
        let (mut walls, mut contacts) = ([f64::INFINITY, f64::NEG_INFINITY], [Contact::Rigid; 2]);
        for side in Side::BOTH {
            let Some(wall) = self.wall(side) else { continue };
            let at = of(&wall.at);
            // An infinite position means that there is no wall.
            if !at.is_finite() {
                let name = if side == Side::Right { "right" } else { "left" };
                let quantity = format!("position of the {name} wall");
                return Err(OscillatorError::OutOfRange {
                    quantity,
                    value: at,
                    requirement: "a finite number",
                });
            }
            walls[side.index()] = at;
            contacts[side.index()] = wall.contact();
        }
        let outer = |side: Side| {
            let further = self.walls[0][side.index()].iter().skip(1);
            further
                .map(|wall| OuterWall { at: of(&wall.at), contact: wall.contact(), meshing: Vec::new() })
                .collect()
        };
        let mut outer_walls: [Vec<OuterWall>; 2] = Side::BOTH.map(outer);
        let mut stage = |stage: usize| {
            let of = |entry: &Staged| of(entry.in_stage(stage));
            let free = Domain {
                damping: matrix(&motion.damping, of),
                stiffness: matrix(&motion.stiffness, of),
                load: vector(&motion.load, of),
                preload: 0.0,
            };
            let behind = |before: Domain, wall: &Wall, side: Side, at: f64| match &wall.spring {
                Some(spring) => {
                    let (stiffness, preload) = (of(&spring.stiffness), of(&spring.preload));
                    // A missing preload must not change the sign of a zero.
                    let push = if preload == 0.0 { 0.0 } else { side.sign() * preload };
                    let constant = stiffness * at - push;
                    with_spring(before, gap, [stiffness, of(&spring.damping), constant], preload)
                }
                None => before,
            };
            let meshing = Side::BOTH.map(|side| {
                let mut domain = free;
                let own = &self.walls[0][side.index()];
                if let Some(wall) = own.first() {
                    domain = behind(free, wall, side, walls[side.index()]);
                }
                let first = domain;
                for (wall, outer) in own.iter().skip(1).zip(&mut outer_walls[side.index()]) {
                    domain = behind(domain, wall, side, outer.at);
                    outer.meshing.push(domain);
                }
                first
            });
            Stage { free, meshing }
        };
        let harmonic = |harmonic: &HarmonicForce| Harmonic {
            order: harmonic.order,
            cos: vector(&harmonic.cos, of),
            sin: vector(&harmonic.sin, of),
        };
        let phases: Vec<f64> = motion.stages.iter().map(of).collect();
        let Stage { free, meshing } = stage(0);
        let stages = (1..motion.stages.len()).map(stage).collect();
        Ok(Oscillator {
            degrees: motion.degrees(),
            mass,
            gap,
            walls,
            contacts,
            omega: of(&motion.frequency),
            force: vector(&motion.force, of),
            force_sin: vector(&motion.force_sin, of),
            free,
            meshing,
            harmonics: motion.harmonics.iter().map(harmonic).collect(),
            stages,
            schedule: Oscillator::repeated(&phases, motion.repeat)?,
            outer_walls,
            friction: self.friction.iter().map(|friction| friction.evaluated(of)).collect(),
            machine: None,
        })
    }

    /// Builds the contact law for values of the parameters. A machine has laws of its own.
    pub(super) fn law(&self, values: &[f64]) -> Law {
        let of = |entry: &Expression| entry.evaluate(&|index| values[index]);
        let mut law = Law::both(0.0, 0.0);
        if self.is_machine() {
            return law;
        }
        for (i, wall) in self.walls[0].iter().enumerate() {
            // Only the last wall of a side may have impacts.
            if let Some(Wall { law: WallLaw::Impact { restitution, mesh_speed, .. }, .. }) = wall.last() {
                law.restitution[i] = of(restitution);
                law.mesh_speed[i] = of(mesh_speed);
            }
        }
        law
    }
}

/// Adds the force `stiffness z + damping w - constant` along the gap row.
fn with_spring(
    free: Domain,
    gap: [f64; 2],
    [stiffness, damping, constant]: [f64; 3],
    preload: f64,
) -> Domain {
    let along = |matrix: [[f64; 2]; 2], k: f64| {
        // The product of the gap entries comes first, so that the matrix is exactly symmetric.
        let entry = |i: usize, j: usize| plus(matrix[i][j], k * (gap[i] * gap[j]));
        [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
    };
    Domain {
        damping: along(free.damping, damping),
        stiffness: along(free.stiffness, stiffness),
        load: [plus(free.load[0], constant * gap[0]), plus(free.load[1], constant * gap[1])],
        preload,
    }
}

/// Adds two numbers. If `a` is 0, `b` keeps its sign, even if it is 0.
fn plus(a: f64, b: f64) -> f64 {
    if a == 0.0 { b } else { a + b }
}

fn matrix<T>(rows: &[Vec<T>], of: impl Fn(&T) -> f64) -> [[f64; 2]; 2] {
    let mut matrix = [[0.0; 2]; 2];
    for (row, entries) in matrix.iter_mut().zip(rows) {
        *row = vector(entries, &of);
    }
    matrix
}

fn vector<T>(entries: &[T], of: impl Fn(&T) -> f64) -> [f64; 2] {
    let mut vector = [0.0; 2];
    for (number, entry) in vector.iter_mut().zip(entries) {
        *number = of(entry);
    }
    vector
}
