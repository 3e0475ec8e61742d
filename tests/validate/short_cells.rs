//! Cells of random parameters, which run for 64 periods: the rows of `data/short_cells.csv`.

use crate::common::gpu::{map, open};
use crate::validate::fixtures::EVERYTHING;
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Integration, Scene, Start};
use rattlemap::record::Record;
use rattlemap_dynamics::model::{GearPair, Model, State, state};

const TABLE: &str = include_str!("data/short_cells.csv");

/// Returns the plans of a group of `count` cells.
#[track_caller]
pub(crate) fn plans(group: &str, count: usize) -> Vec<Plan> {
    let mut lines = TABLE.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert!(GearPair::PARAMETERS.iter().map(|parameter| &*parameter.name).eq(names[1..14].iter().copied()));
    let of_group = lines.filter_map(|line| line.split_once(',').filter(|(name, _)| *name == group));
    let plans: Vec<Plan> = of_group
        .map(|(_, row)| {
            let numbers: Vec<f64> = row.split(',').map(|number| number.parse().unwrap()).collect();
            let mut pair = GearPair::paper(0.0);
            numbers[..13].iter().enumerate().for_each(|(index, &value)| pair.assign(index, value));
            plan(pair, state(&numbers[13..]))
        })
        .collect();
    assert_eq!(plans.len(), count, "{group}");
    plans
}

/// Returns the plan of a group of one cell.
#[track_caller]
pub(crate) fn first_plan(group: &str) -> Plan {
    plans(group, 1).remove(0)
}

/// Returns a plan of 64 periods whose first cell is this one. The swept parameters have no upper bound.
pub(crate) fn plan(pair: GearPair, start: State) -> Plan {
    let integration =
        Integration { transient_periods: 32, observed_periods: 32, max_period: 16, ..Integration::default() };
    let scene = Scene::builder(pair)
        .axis("omega", pair.omega..=2.0 * pair.omega + 1.0, 2)
        .axis("mesh_speed", pair.mesh_speed..=2.0 * pair.mesh_speed + 1.0, 2)
        .integration(integration)
        .start(Start::State(start))
        .quantities(&EVERYTHING);
    Plan::new(&scene.build().unwrap())
}

/// Returns the lane's record of a plan's first cell.
pub(crate) fn lane(plan: &Plan, precision: Precision) -> Record {
    map(plan, &mut open(precision)).swap_remove(0)
}
