//! `[start]`: the states in which cells begin.

use std::mem::discriminant;

use super::error::SceneError;
use super::keys;
use super::limits::{MAX_STARTS, MOST_SAMPLED, REPLICATES};
use super::section::{Field, Section};
use super::{Purpose, Scene};
use rattlemap_dynamics::model::{Model, Oscillator, REST, STATE, Side, State};

/// The state in which cells start, at phase 0 of the oscillator: at the start phase of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// At rest.
    Rest,
    /// In one state, which is equal for all cells.
    State(State),
    /// In the last state of the preceding cell along the last axis, from `min` to `max`. The first cell starts at rest.
    Up,
    /// In the last state of the following cell along the last axis, from `max` to `min`. The last cell starts at rest.
    Down,
    /// [`Start::Up`] and [`Start::Down`] in one bifurcation diagram.
    Both,
}

/// Names of the policies in scenes. The state of `"state"` is read from a field of its own.
const POLICIES: [(&str, Start); 5] = [
    ("rest", Start::Rest),
    ("state", Start::State(REST)),
    ("up", Start::Up),
    ("down", Start::Down),
    ("both", Start::Both),
];

impl Start {
    /// Returns the name of the policy in scenes.
    pub(crate) fn policy(&self) -> &'static str {
        let is_own = |(_, other): &&(&str, Start)| discriminant(self) == discriminant(other);
        POLICIES.iter().find(is_own).map_or("", |&(name, _)| name)
    }

    /// Describes the start for the end of a title: it decides which attractor is shown.
    pub fn in_words(&self) -> &'static str {
        match self {
            Start::Rest => "from rest",
            Start::State(_) => "from one given state",
            Start::Up => "attractor followed upwards",
            Start::Down => "attractor followed downwards",
            Start::Both => "attractor followed upwards and downwards",
        }
    }

    /// Whether cells start from the last states of their neighbours.
    pub fn follows(&self) -> bool {
        matches!(self, Start::Up | Start::Down | Start::Both)
    }
}

/// Several starts per cell: the start of the policy, then random states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw {
    /// Number of starts per cell, including the one of the policy; at least 2.
    pub count: u32,
    /// Seed of the random states.
    pub seed: u32,
}

/// Random starts for the shares of attractors: the same in all cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Distribution of the components of the state, which are independent.
    pub spread: Spread,
    /// Largest number of starts per cell, a multiple of [`REPLICATES`].
    pub count: u32,
    /// Seed of the random states.
    pub seed: u32,
    /// Width of the intervals of all shares at which a cell stops; none runs all starts.
    pub width: Option<f64>,
}

/// A distribution of states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spread {
    /// Uniform between these states.
    Box([State; 2]),
    /// Normal, with this mean and this standard deviation.
    Normal([State; 2]),
}

impl Spread {
    /// Returns the name in scenes, and both states.
    pub fn parts(&self) -> (&'static str, &[State; 2]) {
        match self {
            Spread::Box(states) => ("box", states),
            Spread::Normal(states) => ("normal", states),
        }
    }
}

pub(super) fn read(root: &Section<'_>, model: &dyn Model, purpose: Purpose) -> Result<Start, SceneError> {
    let section = root.section("start", &keys::names("start"))?;
    let field = section.get("policy");
    let policy = field.as_ref().map_or(Ok(Start::Rest), |field| field.choice(&POLICIES))?;
    if let (Start::Both, Purpose::Map, Some(field)) = (policy, purpose, field) {
        return Err(field.conflict(
            "a map shows one attractor per cell; make two maps, with \"up\" and with \"down\", and let \
             `rattlemap compare` show where they differ",
        ));
    }
    match (policy, section.get("state")) {
        (Start::State(_), Some(field)) => read_state(&field, model).map(Start::State),
        (Start::State(_), None) => {
            let names = model.state_names().join(", ");
            Err(section.missing("state", &format!("policy = \"state\" needs state = [{names}]")))
        }
        (_, Some(field)) => {
            Err(field.conflict("it needs start.policy = \"state\"; set that policy or remove the state"))
        }
        (policy, None) => Ok(policy),
    }
}

/// Reads `phase`, if it is there, into the model.
pub(super) fn read_phase(section: &Section<'_>, model: &mut dyn Model) -> Result<(), SceneError> {
    let Some(field) = section.get("phase") else { return Ok(()) };
    let takes = "a number of radians, or an expression of numbers and pi";
    let phase = field.expression(&[], takes, "\"pi/2\"")?.evaluate(&|_| f64::NAN);
    if !phase.is_finite() {
        return Err(field.out_of_range("finite, in radians"));
    }
    match model.set_start_phase(phase) {
        true => Ok(()),
        false => Err(field
            .conflict("a model in Rust starts at phase 0; write it as a model file, or remove the phase")),
    }
}

fn read_state(field: &Field<'_>, model: &dyn Model) -> Result<State, SceneError> {
    let names = model.state_names();
    let count = match names.len() {
        2 => "two".to_owned(),
        4 => "four".to_owned(),
        more => more.to_string(),
    };
    let expected = &format!("{count} finite numbers, [{}]", names.join(", "));
    let mut numbers = Vec::new();
    for item in field.list(expected)? {
        let number = item.number()?;
        if !number.is_finite() {
            return Err(item.out_of_range("a finite number"));
        }
        numbers.push(number);
    }
    if numbers.len() != names.len() {
        return Err(field.out_of_range(expected));
    }
    let mut state = REST;
    state[..numbers.len()].copy_from_slice(&numbers);
    Ok(state)
}

/// Reads `count` and `seed`; returns none where each cell has one start.
pub(super) fn read_draw(root: &Section<'_>, purpose: Purpose) -> Result<Option<Draw>, SceneError> {
    let section = root.section("start", &keys::names("start"))?;
    if section.get("sample").is_some() {
        return Ok(None);
    }
    let seed = section.get("seed").map(|field| field.whole(0..=u32::MAX)).transpose()?;
    let count = section.get("count").map_or(Ok(1), |field| field.whole(1..=MAX_STARTS))?;
    match (section.get("count").filter(|_| count > 1), section.get("seed")) {
        (Some(field), _) if purpose == Purpose::Bifurcation => {
            Err(field.conflict("`bifurcation` follows one motion per column; remove it, or compute a `map`"))
        }
        (None, Some(field)) => Err(field.conflict("a seed needs start.count above 1; remove the seed")),
        (None, None) => Ok(None),
        (Some(_), _) => Ok(Some(Draw { count, seed: seed.unwrap_or(1) })),
    }
}

/// Reads `sample` and what belongs to it; none without it.
pub(super) fn read_sample(
    root: &Section<'_>,
    model: &dyn Model,
    purpose: Purpose,
) -> Result<Option<Sample>, SceneError> {
    let section = root.section("start", &keys::names("start"))?;
    let states = ["low", "high", "mean", "deviation"];
    let Some(field) = section.get("sample") else {
        let alone = states.into_iter().chain(["width"]).find_map(|name| section.get(name));
        return match alone {
            Some(field) => Err(field.conflict("it needs start.sample; set sample = \"box\" or \"normal\"")),
            None => Ok(None),
        };
    };
    if purpose == Purpose::Bifurcation {
        return Err(field.conflict("shares need a map; compute a `map`"));
    }
    if let Some(other) = ["policy", "state"].into_iter().find_map(|name| section.get(name)) {
        return Err(other.conflict("start.sample gives all starts; remove one of the two"));
    }
    let is_box = field.choice(&[("box", true), ("normal", false)])?;
    let (own, others) = if is_box { states.split_at(2) } else { (&states[2..], &states[..2]) };
    if let Some(other) = others.iter().find_map(|name| section.get(name)) {
        return Err(
            other.conflict(format!("this sample is described by start.{} and start.{}", own[0], own[1]))
        );
    }
    let names = model.state_names().join(", ");
    let read = |name: &str| match section.get(name) {
        Some(field) => Ok((read_state(&field, model)?, field)),
        None => Err(section.missing(name, &format!("this sample needs {name} = [{names}]"))),
    };
    let ((first, _), (second, last)) = (read(own[0])?, read(own[1])?);
    let bad =
        (0..model.state_names().len()).find(|&i| if is_box { second[i] < first[i] } else { second[i] < 0.0 });
    if let Some(i) = bad {
        let name = &model.state_names()[i];
        return Err(last.conflict(match is_box {
            true => format!("{name} must be at least {} there, as in start.low", first[i]),
            false => format!("the deviation of {name} must not be negative"),
        }));
    }
    let is_point = (0..STATE).all(|i| if is_box { second[i] == first[i] } else { second[i] == 0.0 });
    if is_point {
        return Err(last.conflict("all starts would be equal; widen at least one component"));
    }
    let Some(count) = section.get("count") else {
        return Err(section.missing("count", "a sample needs a number of starts, such as count = 256"));
    };
    let number = count.whole(REPLICATES..=MOST_SAMPLED)?;
    if !number.is_multiple_of(REPLICATES) {
        let nearest = number.next_multiple_of(REPLICATES);
        return Err(
            count.conflict(format!("a sample has eight equal parts; use a multiple of 8, such as {nearest}"))
        );
    }
    let seed = section.get("seed").map_or(Ok(1), |field| field.whole(0..=u32::MAX))?;
    let width = match section.get("width") {
        Some(field) => match field.number()? {
            width if width > 0.0 && width < 1.0 => Some(width),
            _ => return Err(field.out_of_range("a number between 0 and 1, ends excluded")),
        },
        None => None,
    };
    let spread = if is_box { Spread::Box([first, second]) } else { Spread::Normal([first, second]) };
    Ok(Some(Sample { spread, count: number, seed, width }))
}

/// Refuses a box that reaches behind a rigid wall of an oscillator. `cell` names the oscillator's parameters.
pub(super) fn check_box(
    section: &Section<'_>,
    spread: &Spread,
    oscillator: &Oscillator,
    cell: &str,
) -> Result<(), SceneError> {
    let Spread::Box([low, high]) = spread else { return Ok(()) };
    for (gap, row) in oscillator.gaps.iter().enumerate() {
        // The gap is linear in the displacements, so its ends lie at corners of the box.
        let end = |side: Side| {
            let of = |(i, factor): (usize, &f64)| {
                factor * if factor * side.sign() > 0.0 { high[2 * i] } else { low[2 * i] }
            };
            row.row.iter().enumerate().map(of).sum::<f64>()
        };
        for side in Side::BOTH {
            let wall = row.walls[side.index()].first().filter(|wall| !wall.contact.is_elastic());
            if let (Some(wall), Some(field)) = (wall, section.get("high"))
                && (end(side) - wall.at) * side.sign() > 0.0
            {
                let remedy = format!(
                    "the gap {} reaches {} there, behind its wall at {} ({cell}); make the box smaller",
                    gap + 1,
                    end(side),
                    wall.at
                );
                return Err(field.conflict(remedy));
            }
        }
    }
    Ok(())
}

/// Refuses starts that contradict each other, the axes, or `[refine]`.
pub(super) fn check(root: &Section<'_>, scene: &Scene) -> Result<(), SceneError> {
    let (follows, is_drawn) = (scene.start.follows(), scene.draw.is_some());
    let section = root.section("start", &keys::names("start"))?;
    if let Some(sample) = section.get("sample") {
        let remedy = if scene.sweeps_start() {
            "the axes give each cell its start; remove the sample"
        } else if root.get("refine").is_some() {
            "shares are not interpolated; remove [refine] or the sample"
        } else if scene.list().is_some() {
            "shares need two axes; remove the list of cells or the sample"
        } else {
            return Ok(());
        };
        return Err(sample.conflict(remedy));
    }
    let is_refined = root.get("refine").is_some();
    let sweeps_start = scene.sweeps_start();
    let sweeps_both = scene.is_basin() && !scene.axes().iter().all(|axis| axis.target().is_start());
    if let Some(refine) = root.get("refine").filter(|_| sweeps_both) {
        return Err(refine.conflict(
            "attractors at different parameters can be matched only after all cells are known; sweep two components \
             of the start, or remove [refine]",
        ));
    }
    let conflict = match (section.get("policy"), section.get("count")) {
        (Some(policy), _) if sweeps_start && follows => {
            (policy, "the axes or columns give each cell its start; use \"rest\" or \"state\"")
        }
        (_, Some(count)) if sweeps_start && is_drawn => {
            (count, "the axes or columns give each cell its start; remove the count")
        }
        (_, Some(count)) if is_drawn && follows => (
            count,
            "cells that follow their neighbours have one start each; use policy \"rest\" or \"state\"",
        ),
        (Some(policy), _) if is_refined && follows => {
            (policy, "filled cells have no last state for their neighbours to start from; remove [refine]")
        }
        (_, Some(count)) if is_refined && is_drawn => {
            (count, "attractors are not counted in filled cells; remove [refine] or the count")
        }
        _ => return Ok(()),
    };
    Err(conflict.0.conflict(conflict.1))
}
