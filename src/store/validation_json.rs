//! `validation.json`: the result of validating a map. The report shows the same object.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::show::cells::Cells;
use crate::show::replay;
use crate::show::validation::Validated;
use crate::store::manifest::{Head, joined};
use crate::validate::{
    ChaosEnd, ChaosEnds, ChaosTest, HORIZON, HalfMesh, Kind, Mismatch, Off, Rate, StateCheck, StratumResult,
};
use rattlemap_dynamics::orbit::Class;

/// Describes a validation.
///
/// `counted` is the unit of all numbers but `cells`, `integrated` the number of runs from which the sample was drawn, and
/// `identical` the number of records that the same engine reproduced bit for bit. All must be if `must_be_identical`.
pub(crate) fn object(cells: &Cells<'_>, validated: &Validated<'_>) -> Value {
    let Validated { validation, made, processors, double_lanes, .. } = *validated;
    let agreement = validation
        .agreement
        .iter()
        .map(|field| (field.field.name(), json!({ "compared": field.compared, "agreeing": field.agreeing })));
    let kinds = Kind::ALL.into_iter().map(|kind| (kind.name(), meaning(kind)));
    joined([
        json!(Head::of("validate")),
        json!({
            "engine": made.engine,
            "precision": made.precision,
            "device": made.device,
            "processor": processors[0],
            "again_on": validated.again_on(),
            "same_device": validated.is_same_device(),
            "lanes_f64_on": double_lanes,
            "judge": validation.judge.name(),
            "seed": validation.seed,
            "cells": cells.count(),
            "counted": validation.counted(),
            "runs": validation.runs,
            "integrated": validation.runs - validation.filled,
            "filled": validation.filled,
            "requested": validation.requested,
            "samples": validation.replayed,
            "verdict": validated.verdict(),
            "remarks": validated.remarks(),
            "faults": validation.faults(),
            "strata": validation.strata.iter().map(|result| stratum(result, validation.counted())).collect::<Vec<_>>(),
            "kinds": kinds.collect::<BTreeMap<_, _>>(),
            "agreement": agreement.collect::<BTreeMap<_, _>>(),
            "identical": validation.again[0],
            "computed_again": validation.again[1],
            "must_be_identical": validation.is_exact,
            "chaos": validation.chaos.iter().map(chaos).collect::<Vec<_>>(),
            "chaos_ends": validation.chaos_ends.as_ref().map(|ends| chaos_ends(cells, ends)),
            "half_mesh_speed": validation.half_mesh.as_ref().map(half_mesh),
            "states": validation.states.as_ref().map(states),
            "not_finite": validation.not_finite,
            "mismatches": validation.mismatches.iter().map(|m| mismatch(cells, m)).collect::<Vec<_>>(),
        }),
    ])
}

/// A rate with its 95 % interval.
fn rate(rate: Rate) -> Value {
    json!({ "count": rate.count, "interval": rate.interval, "text": rate.text() })
}

fn stratum(result: &StratumResult, counted: &str) -> Value {
    let kinds = Kind::ALL.into_iter().map(|kind| (kind.name(), rate(result.rate(kind))));
    json!({
        "name": result.stratum.name(),
        "text": result.stratum.describe(counted),
        "runs": result.runs,
        "sampled": result.sampled,
        "differing": rate(result.differing()),
        "kinds": kinds.collect::<BTreeMap<_, _>>(),
    })
}

fn chaos(test: &ChaosTest) -> Value {
    let &ChaosTest { name, cells, distance, bar, means } = test;
    json!({
        "name": name,
        "cells": cells,
        "distance": distance,
        "bar": bar,
        "means": means,
        "fails": test.fails(),
    })
}

/// Chaotic cells that were followed, and those whose chaos ended.
fn chaos_ends(cells: &Cells<'_>, ends: &ChaosEnds) -> Value {
    let ended = |end: &ChaosEnd| {
        let period = match end.class {
            Class::Periodic { period } => Some(period),
            _ => None,
        };
        let own = json!({ "class": end.class.name(), "period": period, "periods_run": end.periods_run });
        joined([place(cells, end.id), own])
    };
    json!({
        "further_periods": ends.periods,
        "chaotic": ends.runs,
        "followed": ends.rate.among,
        "ended": rate(ends.rate),
        "cells": ends.ended.iter().map(ended).collect::<Vec<_>>(),
    })
}

/// Changes at half the meshing speed. Words and patterns of mirror images count as equal.
fn half_mesh(half: &HalfMesh) -> Value {
    let changed = |rate: Rate| {
        let text = rate.text();
        json!({ "compared": rate.among, "changed": rate.count, "interval": rate.interval, "text": text })
    };
    json!({
        "mesh_speed": half.mesh_speed,
        "class": changed(half.classes),
        "period": changed(half.periods),
        "word": changed(half.words),
        "pattern": changed(half.patterns),
    })
}

/// Distances of final states. An infinite distance is null.
fn states(states: &StateCheck) -> Value {
    let lane = |&Off { id, distance, bar }: &Off| json!({ "id": id, "distance": distance, "bar": bar });
    json!({
        "horizon_periods": HORIZON,
        "compared": states.compared,
        "off": rate(states.rate()),
        "median": states.distances[0],
        "worst": states.distances[1],
        "lanes": states.off.iter().map(lane).collect::<Vec<_>>(),
    })
}

fn mismatch(cells: &Cells<'_>, mismatch: &Mismatch) -> Value {
    let differences = mismatch.differences.iter().map(|difference| {
        json!({
            "field": difference.field.name(),
            "map": difference.record,
            "judge": difference.judge,
        })
    });
    let own = json!({ "differences": differences.collect::<Vec<_>>(), "kind": mismatch.kind.name() });
    joined([place(cells, mismatch.id), own])
}

/// Names a run: its id, indices and swept values, and the command that replays it.
fn place(cells: &Cells<'_>, id: u32) -> Value {
    let [i, j] = cells.row(id as usize).indices;
    let swept = cells.scene().swept().map(|parameter| parameter.name.to_string());
    json!({
        "id": id,
        "i": i,
        "j": j,
        "values": swept.zip(cells.values(id as usize)).collect::<BTreeMap<_, _>>(),
        "replay": replay::command(cells, id as usize),
    })
}

/// Explains a kind of mismatch.
fn meaning(kind: Kind) -> &'static str {
    match kind {
        Kind::Attractor => {
            "another attractor of the same cell: the start reaches it when it moves within the engine's resolution, and \
             the reference stays on it from the map's last state"
        }
        Kind::Border => {
            "a border within rounding: the reference gives the map's answer when parameters and start move within the \
             engine's resolution, lanes in double precision give the reference's, or a status says that rounding \
             decides the period"
        }
        Kind::Budget => {
            "a budget too short: one side gives the other's answer with fewer or with more periods, or the motion \
             settles or separates too slowly to be told, or the second judge or the reference is undecided"
        }
        Kind::Cap => "a cap ended the lane, as its status says, and does so again",
        Kind::Unexplained => "no computation gives a reason",
    }
}
