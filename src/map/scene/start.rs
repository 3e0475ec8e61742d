//! `[start]`: the states in which cells begin.

use std::mem::discriminant;

use super::error::SceneError;
use super::keys;
use super::limits::MAX_STARTS;
use super::section::{Field, Section};
use super::{Purpose, Scene};
use rattlemap_dynamics::model::{Model, REST, State};

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

/// Refuses starts that contradict each other, the axes, or `[refine]`.
pub(super) fn check(root: &Section<'_>, scene: &Scene) -> Result<(), SceneError> {
    let (follows, is_drawn) = (scene.start.follows(), scene.draw.is_some());
    let section = root.section("start", &keys::names("start"))?;
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
