//! Chaotic cells continue if the scene sets `confirm_chaos`, on the reference and on lanes.

use crate::common::gpu;
use rattlemap::gpu::Precision;
use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::{Cell, Plan};
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap_dynamics::orbit::Class;

const SCENE: &str = include_str!("../../scenes/gallery/impact_oscillator.toml");
const SIDE: u32 = 32;

/// Most periods of a cell that is not chaotic.
const USUAL: u32 = 528;

/// Further periods of chaotic cells. They are enough for the chaos of [`ENDING`] on every engine.
const FURTHER: u32 = 4000;

/// Indices of cells whose chaos ends, and the periods of their cycles.
const ENDING: [([u32; 2], u32); 5] = [([19, 2], 6), ([30, 6], 6), ([22, 11], 3), ([19, 12], 1), ([8, 19], 1)];

/// Computes [`ENDING`] and every seventh cell of the map, with this number of further periods for chaos.
fn records(precision: Option<Precision>, further: u32) -> Vec<Record> {
    let sets = ["axis.0.count=32", "axis.1.count=32", &format!("integration.confirm_chaos={further}")];
    let plan = Plan::new(&Scene::parse(SCENE, "s", &sets.map(str::to_owned), Purpose::Map).unwrap());
    let ending = ENDING.iter().map(|([i, j], _)| j * SIDE + i);
    let cells: Vec<Cell> = ending.chain((0..SIDE * SIDE).step_by(7)).map(|id| plan.cell(id)).collect();
    let mut engine = match precision {
        None => Engine::Cpu(Cpu::new(&plan)),
        Some(precision) => gpu::engine(&plan, precision),
    };
    pollster::block_on(engine.run(&cells)).unwrap()
}

/// Checks that the chaos of [`ENDING`] ends, and that cells without chaos keep every bit.
fn check(precision: Option<Precision>) {
    let [before, after] = [0, FURTHER].map(|further| records(precision, further));
    for ((before, after), (cell, period)) in before.iter().zip(&after).zip(ENDING) {
        assert_eq!(classify(before), Class::Chaotic, "{precision:?} {cell:?}");
        assert_eq!(classify(after), Class::Periodic { period }, "{precision:?} {cell:?}: {after:?}");
    }
    let mut lasting = 0;
    for (before, after) in before.iter().zip(&after) {
        match classify(before) {
            Class::Chaotic if classify(after) == Class::Chaotic => {
                assert_eq!(after.periods_run, USUAL + FURTHER, "{precision:?}: {after:?}");
                lasting += 1;
            }
            Class::Chaotic => {}
            _ => assert_eq!(before.to_bytes(), after.to_bytes(), "{precision:?}"),
        }
    }
    assert!(lasting > 5, "{precision:?}: chaos lasts in {lasting} cells");
}

#[test]
fn chaos_that_ends_gets_a_new_class_on_the_reference() {
    check(None);
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn chaos_that_ends_gets_a_new_class_on_lanes() {
    Precision::ALL.into_iter().for_each(|precision| check(Some(precision)));
}
