//! The contents of a model file, and the oscillator and contact law that it defines.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    self, Drive, Forces, GapRow, Law, Model, ModelError, Oscillator, OscillatorError, Parameter, Restitution,
    Shapes, Side, Spring, Timing,
};

use super::contact::{self, Wall, WallLaw, WallSpring};
use super::curve::{self, BentSpring, ForceLaw, wall_spring};
use super::entry::{Names, Staged};
use super::friction::{self, DryFriction};
use super::motion::{self, Clock, MotionTable};
use super::signal::{self, Signal};
use super::steps::Steps;
use super::{FileModel, parameters};
use crate::text::document::{self, Node, Value};
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Keys outside of any table, and the names of the tables.
#[rustfmt::skip]
const MODEL_KEYS: [&str; 12] = [
    "name", "title", "summary", "source", "notes", "parameters", "motion", "harmonic", "contact", "friction",
    "spring", "signal",
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
    pub motion: MotionTable,
    /// Right and left walls of each gap, from the inside to the outside.
    pub walls: Vec<[Vec<Wall>; 2]>,
    /// Dry friction.
    pub friction: Vec<DryFriction>,
    /// Nonlinear springs.
    pub springs: Vec<BentSpring>,
    /// Signals.
    pub signals: Vec<Signal>,
    /// Whether the oscillator is a pair, whose law is not part of it.
    is_pair: bool,
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
    let mut motion = motion::read(&root, names)?;
    let states: Vec<String> = motion.state_names().map(str::to_owned).collect();
    let states: Vec<&str> = states.iter().map(String::as_str).collect();
    let names = Names { states: &states, stages: motion.stages.len(), ..names };
    let friction = friction::read(&root, names, motion.degrees())?;
    let springs = curve::read(&root, names, motion.degrees())?;
    let gaps: Vec<&str> = motion.gaps.iter().filter_map(|gap| gap.name.as_deref()).collect();
    let signals = signal::read(&root, names, &gaps, motion.degrees())?;
    let defaults: Vec<f64> = written.iter().map(|parameter| parameter.default).collect();
    let walls =
        contact::read(&root, names, &motion.gaps, &defaults, !friction.is_empty() || !springs.is_empty())?;
    motion::add_phase(&root, &mut motion, walls.iter().flatten().flatten().flat_map(Wall::staged))?;
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
        springs,
        signals,
        is_pair: false,
    };
    definition.is_pair = definition.is_pair();
    let shapes: Vec<Shapes> = (0..written.len()).map(|index| definition.shaped_by(index)).collect();
    definition.parameters =
        written.into_iter().zip(shapes).map(|(written, shapes)| written.into_parameter(shapes)).collect();
    let model = FileModel::new(definition);
    if let Err(error) = model.oscillator() {
        return Err(no_motion(&root, &model.definition, &error));
    }
    match super::repeated_column(&model).zip(root.get("signal").or_else(|| root.get("motion"))) {
        Some((column, field)) => Err(field.conflict(format!(
            "two columns of a table would have the name `{column}`; rename a signal, a gap or a coordinate"
        ))),
        None => Ok(model),
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
                let is_on_side = name == super::side(side) && is_of(gap);
                before += usize::from(is_on_side);
                is_on_side && before == nth
            }
            (Table::Harmonic(order), Some(Value::Integer(own))) => *own == order,
            (Table::Friction(nth) | Table::Spring(nth) | Table::Signal(nth), _) => {
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
        Table::Spring(_) => "spring",
        Table::Signal(_) => "signal",
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
    /// A nonlinear spring, counted from 1.
    Spring(usize),
    /// A signal, counted from 1.
    Signal(usize),
}

/// Returns the table and the key of the quantity that an error names.
fn blame<'e>(error: &'e ModelError, definition: &Definition) -> (Table, &'e str) {
    let ModelError::Oscillator(error) = error else { return (Table::Motion, "") };
    let quantity = match error {
        OscillatorError::OutOfRange { quantity, .. } => quantity.as_str(),
        OscillatorError::Walls { walls } => return (Table::Wall(definition.gap_between(*walls), None), "at"),
    };
    if let Some((what, nth)) = quantity.rsplit_once("of friction") {
        let key = ["force", "speed", "static", "sliding rate"].into_iter().find(|key| what.starts_with(key));
        // The determinant is that of both rows.
        let nth = nth.trim().parse().unwrap_or(definition.friction.len());
        let is_by_speed =
            nth > 0 && definition.friction.get(nth - 1).is_some_and(|own| !own.at_speed.is_empty());
        let key = match key {
            Some("force" | "sliding rate") if is_by_speed => "force_at_speed",
            key => key.unwrap_or("row"),
        };
        return (Table::Friction(nth), key);
    }
    if let Some((what, nth)) = quantity.rsplit_once("of nonlinear spring ") {
        let key = ["row", "range", "tolerance"].into_iter().find(|key| what.starts_with(key));
        return (Table::Spring(nth.parse().unwrap_or(1)), key.unwrap_or("force"));
    }
    if let Some((_, nth)) = quantity.rsplit_once("of signal ") {
        return (Table::Signal(nth.parse().unwrap_or(1)), "name");
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
        "entry" => (Table::Motion, "gap"),
        "row" | "the" => (Table::Gap(gap), "gap"),
        "independence" => (Table::Motion, "gap"),
        "lowest" => (Table::Motion, "mass"),
        "difference" => (Table::Motion, if quantity.contains("mass") { "mass" } else { "stiffness" }),
        "excitation" => (Table::Motion, "frequency"),
        "phase" => (Table::Motion, "stages"),
        "number" => (Table::Motion, "tolerance"),
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
        "range" if side.is_some() => (Table::Wall(gap, side), "depth_max"),
        key @ ("damping" | "stiffness" | "preload" | "force" | "tolerance") if side.is_some() => {
            (Table::Wall(gap, side), key)
        }
        key => (Table::Motion, key),
    }
}

/// Returns how messages name a wall, which is counted from 1.
fn wall_name(motion: &MotionTable, (gap, side): (usize, Side), nth: usize) -> String {
    let of_gap = if motion.gaps.len() == 1 { String::new() } else { format!(" of gap {}", gap + 1) };
    format!("{} wall {nth}{of_gap}", super::side(side))
}

impl Definition {
    /// Returns what depends on the parameter with this index.
    fn shaped_by(&self, index: usize) -> Shapes {
        let uses = |entry: &Expression| entry.uses().contains(&index);
        let walls = || self.walls.iter().flatten().flatten();
        let oscillator = self.motion.entries().any(uses)
            || walls().flat_map(Wall::shaping_oscillator).any(uses)
            || self.friction.iter().flat_map(DryFriction::entries).any(uses)
            || self.springs.iter().flat_map(BentSpring::entries).any(uses)
            || self.signals.iter().flat_map(Signal::entries).any(uses);
        let law = walls().flat_map(Wall::shaping_law).any(uses);
        // The laws of a machine are part of it.
        if self.is_pair { Shapes::new(oscillator, law) } else { Shapes::new(oscillator || law, false) }
    }

    /// Whether the oscillator is a pair, which no value decides.
    fn is_pair(&self) -> bool {
        self.oscillator(&self.defaults).is_ok_and(|oscillator| oscillator.needs_machine().is_none())
    }

    /// Whether the file states no force, harmonics or stages. Waves of signals have the period of a forcing, too.
    pub(super) fn is_unforced(&self) -> bool {
        let mut waves = self.signals.iter().flat_map(|signal| &signal.constants[1..]);
        self.motion.is_unforced && waves.all(|wave| wave.as_number() == Some(0.0))
    }

    /// Returns the walls whose force is a function of the depth: gap and side, number from 1, and force.
    pub fn curves(&self) -> impl Iterator<Item = ((usize, Side), usize, &ForceLaw)> {
        let gaps = self.walls.iter().enumerate();
        let sides = gaps.flat_map(|(gap, walls)| Side::BOTH.map(|side| ((gap, side), &walls[side.index()])));
        sides.filter_map(|(place, walls)| Some((place, walls.len(), walls.last()?.curve.as_ref()?)))
    }

    /// Returns the index of the gap whose first walls have these positions at the defaults; 0 if there is none.
    fn gap_between(&self, walls: [f64; 2]) -> usize {
        let at = |wall: &Wall| wall.at.evaluate(&|index| self.defaults[index]);
        let found = |own: &[Vec<Wall>; 2]| own.each_ref().map(|side| side.first().map(at)) == walls.map(Some);
        self.walls.iter().position(found).unwrap_or(0)
    }

    /// Builds the oscillator for values of the parameters. The caller validates it.
    pub(super) fn oscillator(&self, values: &[f64]) -> Result<Oscillator, OscillatorError> {
        let motion = &self.motion;
        let values = &Values { parameters: values, steps: self.steps(values)?, by_phase: &motion.by_phase };
        let phases: Vec<f64> = match values.steps.count {
            0 => motion.stages.iter().map(|phase| values.of(phase)).collect(),
            count => (0..count).map(|stage| stage as f64 / count as f64).collect(),
        };
        let stages = phases.len().max(1);
        let forces = |stage: usize| Forces {
            damping: values.matrix(&motion.damping, |entry| values.in_stage(entry, stage)),
            stiffness: values.matrix(&motion.stiffness, |entry| values.in_stage(entry, stage)),
            load: values.vector(&motion.load, |entry| values.in_stage(entry, stage)),
        };
        let vector = |entries: &[Expression]| values.vector(entries, |entry| values.of(entry));
        let drive = |order: u32, cos: &[Expression], sin: &[Expression]| Drive {
            order,
            cos: vector(cos),
            sin: vector(sin),
        };
        let first = drive(1, &motion.force, &motion.force_sin);
        let signals = self.signals.iter().map(|signal| signal.evaluated(|entry| values.of(entry)));
        let signals: Vec<_> = signals.collect();
        // A signal with a wave needs the first harmonic, even where no force acts.
        let acts = first.cos.iter().chain(&first.sin).any(|&factor| factor != 0.0)
            || signals.iter().any(|signal| signal.waves != [0.0; 2]);
        let further = motion.harmonics.iter().map(|h| drive(h.order, &h.cos, &h.sin));
        let gap = |nth: usize| {
            let side = |side: Side| {
                let walls = (1..).zip(&self.walls[nth][side.index()]);
                let built =
                    walls.map(|(i, wall)| values.wall(wall, stages, &wall_name(motion, (nth, side), i)));
                built.collect::<Result<Vec<_>, _>>()
            };
            Ok(GapRow { row: vector(&motion.gaps[nth].row), walls: [side(Side::Right)?, side(Side::Left)?] })
        };
        let gaps: Vec<GapRow> = (0..motion.gaps.len()).map(gap).collect::<Result<_, OscillatorError>>()?;
        let springs = (1..).zip(&self.springs).map(|(nth, spring)| spring.evaluated(values.parameters, nth));
        let mut springs = springs.collect::<Result<Vec<_>, _>>()?;
        for (place, nth, law) in self.curves() {
            let (gap, side) = place;
            let pieces = law.pieces(values.parameters, &wall_name(motion, place, nth))?;
            springs.push(wall_spring(
                &gaps[gap].row,
                place,
                gaps[gap].walls[side.index()][nth - 1].at,
                pieces,
            ));
        }
        let oscillator = Oscillator {
            omega: 1.0,
            mass: values.matrix(&motion.mass, |entry| values.of(entry)),
            stages: (0..stages).map(forces).collect(),
            schedule: Oscillator::repeated(&phases, motion.repeat)?,
            drives: acts.then_some(first).into_iter().chain(further).collect(),
            gaps,
            friction: self.friction.iter().map(|own| own.evaluated(|entry| values.of(entry))).collect(),
            springs,
            signals,
            timing: if self.is_unforced() { Timing::Free } else { Timing::Forced },
        };
        let omega = match &motion.clock {
            Clock::Frequency(frequency) => values.of(frequency),
            Clock::TimeScale(time) => TAU / values.of(time),
            Clock::Natural => oscillator.slowest_natural_frequency().unwrap_or(TAU),
        };
        Ok(Oscillator { omega, ..oscillator })
    }

    /// Returns the stages that replace entries with the phase, for values of the parameters; no stage if there are none.
    pub(super) fn steps(&self, values: &[f64]) -> Result<Steps, OscillatorError> {
        if self.motion.by_phase.is_empty() { Ok(Steps::default()) } else { Steps::new(&self.motion, values) }
    }

    /// Returns the law of a pair for values of the parameters, and 0 for a machine. It may be asked for millions of cells, so that it does
    /// not build the oscillator.
    pub(super) fn law(&self, values: &[f64]) -> Law {
        let of = |entry: &Expression| entry.evaluate(&|index| values[index]);
        let mut law = Law::both(0.0, 0.0);
        if !self.is_pair {
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

/// Values of the parameters, and the stages that replace entries with the phase.
struct Values<'a> {
    parameters: &'a [f64],
    steps: Steps,
    by_phase: &'a [Expression],
}

impl Values<'_> {
    fn of(&self, entry: &Expression) -> f64 {
        entry.evaluate(&|index| self.parameters[index])
    }

    fn in_stage(&self, entry: &Staged, stage: usize) -> f64 {
        let place =
            |by_phase: &Expression| self.by_phase.iter().position(|own| own.text() == by_phase.text());
        match entry.by_phase().and_then(place) {
            Some(place) => self.steps.mean(place, stage),
            None => self.of(entry.in_stage(stage)),
        }
    }

    fn vector<T>(&self, entries: &[T], value: impl Fn(&T) -> f64) -> DVector<f64> {
        DVector::from_iterator(entries.len(), entries.iter().map(value))
    }

    fn matrix<T>(&self, rows: &[Vec<T>], value: impl Fn(&T) -> f64) -> DMatrix<f64> {
        DMatrix::from_row_iterator(rows.len(), rows.len(), rows.iter().flatten().map(value))
    }

    fn spring(&self, spring: &WallSpring, stage: usize) -> Spring {
        let of = |entry: &Staged| self.in_stage(entry, stage);
        Spring {
            stiffness: of(&spring.stiffness),
            damping: of(&spring.damping),
            preload: spring.preload.as_ref().map(of),
        }
    }

    /// Returns restitution; none if it has not the form of [`Restitution`].
    fn restitution(&self, law: &WallLaw) -> Option<Restitution> {
        match law {
            WallLaw::Elastic { .. } => Some(Restitution::Constant(0.0)),
            WallLaw::Impact { restitution, by_speed: false, .. } => {
                Some(Restitution::Constant(self.of(restitution)))
            }
            WallLaw::Impact { restitution, by_speed: true, .. } => {
                let law = restitution.power_law(self.parameters.len(), &|index| self.parameters[index])?;
                Some(Restitution::BySpeed { constant: law.constant, factor: law.factor, power: law.power })
            }
        }
    }

    /// Builds a wall. `place` names it in messages.
    fn wall(&self, wall: &Wall, stages: usize, place: &str) -> Result<model::Wall, OscillatorError> {
        let restitution = self.restitution(&wall.law).ok_or_else(|| OscillatorError::OutOfRange {
            quantity: format!("restitution of {place}"),
            value: f64::NAN,
            requirement: "c + f*speed^p, where c, f and p do not contain speed",
        })?;
        let spring = |stage| wall.spring.as_ref().map_or(Spring::default(), |own| self.spring(own, stage));
        Ok(model::Wall {
            at: self.of(&wall.at),
            contact: wall.contact(),
            restitution,
            mesh_speed: match &wall.law {
                WallLaw::Impact { mesh_speed, .. } => self.of(mesh_speed),
                WallLaw::Elastic { .. } => 0.0,
            },
            springs: (0..stages).map(spring).collect(),
        })
    }
}
