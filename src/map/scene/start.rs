//! `[start]`: the states in which cells begin.

use super::error::SceneError;
use super::keys;
use super::section::{Field, Section};
use super::{Purpose, Scene};
use rattlemap_dynamics::model::{Model, REST, State};

/// The most states that one cell may start from: attractors are counted in a byte.
pub(super) const MAX_STARTS: u32 = 255;

/// The state in which cells start at phase 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// At rest.
    Rest,
    /// The same given state in every cell.
    State(State),
    /// The last state of the cell before, along the last axis from `min` to `max`; the first
    /// one starts at rest.
    Up,
    /// The last state of the cell after, along the last axis from `max` to `min`; the last one
    /// starts at rest.
    Down,
    /// Both of these, one beside the other; for a bifurcation diagram alone.
    Both,
}

impl Start {
    /// How cells start, to end a title with: which attractor is shown depends on it.
    pub fn in_words(&self) -> &'static str {
        match self {
            Start::Rest => "from rest",
            Start::State(_) => "from one given state",
            Start::Up => "attractor followed upwards",
            Start::Down => "attractor followed downwards",
            Start::Both => "attractor followed upwards and downwards",
        }
    }

    /// Whether cells start from their neighbours.
    pub fn follows(&self) -> bool {
        matches!(self, Start::Up | Start::Down | Start::Both)
    }
}

/// Several starts per cell: the policy's own, then states drawn at random.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw {
    /// Starts per cell, the policy's own included; at least 2.
    pub count: u32,
    /// What decides the draw.
    pub seed: u32,
}

/// `start.policy` as written, before its state is known.
#[derive(Clone, Copy, PartialEq)]
enum Policy {
    Rest,
    State,
    Up,
    Down,
    Both,
}

const POLICIES: [(&str, Policy); 5] = [
    ("rest", Policy::Rest),
    ("state", Policy::State),
    ("up", Policy::Up),
    ("down", Policy::Down),
    ("both", Policy::Both),
];

pub(super) fn read(root: &Section<'_>, model: &dyn Model, purpose: Purpose) -> Result<Start, SceneError> {
    let section = root.section("start", &keys::names("start"))?;
    let policy = section.get("policy").map_or(Ok(Policy::Rest), |field| field.choice(&POLICIES))?;
    if let (Policy::Both, Purpose::Map, Some(field)) = (policy, purpose, section.get("policy")) {
        return Err(field.conflict(
            "a map shows one attractor per cell; make two maps, with \"up\" and with \"down\", and let \
             `rattlemap compare` show where they differ"
                .to_owned(),
        ));
    }
    match (policy, section.get("state")) {
        (Policy::State, Some(field)) => read_state(&field, model).map(Start::State),
        (Policy::State, None) => {
            let names = model.state_names().join(", ");
            Err(section.missing("state", &format!("policy = \"state\" needs state = [{names}]")))
        }
        (_, Some(field)) => Err(field.conflict(
            "it is read with start.policy = \"state\" alone; set that or drop the state".to_owned(),
        )),
        (Policy::Rest, None) => Ok(Start::Rest),
        (Policy::Up, None) => Ok(Start::Up),
        (Policy::Down, None) => Ok(Start::Down),
        (Policy::Both, None) => Ok(Start::Both),
    }
}

fn read_state(field: &Field<'_>, model: &dyn Model) -> Result<State, SceneError> {
    let names = model.state_names();
    let count = if names.len() == 4 { "four" } else { "two" };
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

/// `count` and `seed`; none for one start per cell.
pub(super) fn read_draw(root: &Section<'_>, purpose: Purpose) -> Result<Option<Draw>, SceneError> {
    let section = root.section("start", &keys::names("start"))?;
    let seed = section.get("seed").map(|field| field.whole(0..=u32::MAX)).transpose()?;
    let count = match section.get("count") {
        Some(field) => field.whole(1..=MAX_STARTS)?,
        None => 1,
    };
    match (section.get("count").filter(|_| count > 1), section.get("seed")) {
        (Some(field), _) if purpose == Purpose::Bifurcation => {
            Err(field
                .conflict("`bifurcation` follows one motion per column; drop it, or draw a `map`".into()))
        }
        (None, Some(field)) => Err(field.conflict("it draws nothing without start.count above 1".into())),
        (None, None) => Ok(None),
        (Some(_), _) => Ok(Some(Draw { count, seed: seed.unwrap_or(1) })),
    }
}

/// Refuses starts that do not fit each other, the axes, or a map that is refined.
pub(super) fn check(root: &Section<'_>, scene: &Scene) -> Result<(), SceneError> {
    let (start, draw) = (scene.start, scene.draw);
    let section = root.section("start", &keys::names("start"))?;
    let is_refined = root.get("refine").is_some();
    let sweeps_start = scene.sweeps_start();
    let is_one_of_two = scene.is_basin() && !scene.axes().iter().all(|axis| axis.target().is_start());
    if let Some(refine) = root.get("refine").filter(|_| is_one_of_two) {
        return Err(refine.conflict(
            "attractors at different parameters are told the same only once all are known; sweep two components of \
             the start, or drop [refine]"
                .into(),
        ));
    }
    match (section.get("policy"), section.get("count")) {
        (Some(policy), _) if sweeps_start && start.follows() => Err(policy.conflict(
            "cells have starts of their own here and follow none; use \"rest\" or \"state\"".into(),
        )),
        (_, Some(count)) if sweeps_start && draw.is_some() => {
            Err(count.conflict("cells have starts of their own here; drop the count".into()))
        }
        (_, Some(count)) if draw.is_some() && start.follows() => Err(count.conflict(
            "cells that follow their neighbours have one start each; use policy \"rest\" or \"state\"".into(),
        )),
        (Some(policy), _) if is_refined && start.follows() => Err(policy.conflict(
            "filled cells have no motion for their neighbours to start from; drop [refine]".into(),
        )),
        (_, Some(count)) if is_refined && draw.is_some() => Err(count.conflict(
            "where the map is filled, attractors are not counted; drop [refine] or the count".into(),
        )),
        _ => Ok(()),
    }
}
