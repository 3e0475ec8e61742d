//! Maps over logarithmic and listed axes, with derived parameters, and of lists of cells.

use rattlemap::findings::effect;
use rattlemap::job;
use rattlemap::job::Processor;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Quantity, Scene, SceneBuilder};
use rattlemap_dynamics::model::{GearPair, REST};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, Settings, analyse};

const EVERYTHING: [Quantity; 6] = [
    Quantity::Class,
    Quantity::Lyapunov,
    Quantity::Impacts,
    Quantity::Mesh,
    Quantity::Symmetric,
    Quantity::Word,
];

fn built() -> SceneBuilder {
    Scene::builder(GearPair::paper(0.3)).quantities(&EVERYTHING)
}

/// The stiffness and damping of the second support are derived from those of the first.
fn coupled() -> SceneBuilder {
    let forces = [3.0, 11.0, 12.5, 40.0, 41.0];
    built()
        .derived("k2", "2/3*k1")
        .derived("r2", "0.02*k2 + max(r1, 0.1)")
        .log_axis("k1", 10.0..=90.0, 6)
        .values_axis("F", &forces)
}

#[test]
fn cells_of_uneven_axes_agree_with_single_orbits() {
    let scene = coupled().build().unwrap();
    let map = job::run(&scene, Processor::Cpu).unwrap();
    let mut decided = 0;
    for cell in map.cells() {
        let (k1, force) = (cell.values[0], cell.values[1]);
        let k2 = 2.0 / 3.0 * k1;
        let pair = GearPair { k1, force, k2, r2: 0.02 * k2 + 0.6, ..GearPair::paper(0.3) };
        assert_eq!(*map.model(&cell), pair);
        let orbit = analyse(&pair, REST, &Settings::default()).unwrap();
        if cell.class == Class::Undecided {
            continue;
        }
        decided += 1;
        assert_eq!(cell.class, orbit.class, "k1 = {k1}, F = {force}");
        if let Class::Periodic { .. } = cell.class {
            assert_eq!(cell.record.impacts_per_period, orbit.impacts_per_period, "k1 = {k1}, F = {force}");
            let apart = (cell.record.lyapunov - orbit.lyapunov).abs();
            assert!(apart < 1e-6 * (1.0 + orbit.lyapunov.abs()), "k1 = {k1}, F = {force}: {apart}");
        }
    }
    assert!(decided >= 28, "{decided} of 30 cells");
    let firsts: Vec<f64> = (0..6).map(|i| map.cell([i, 0]).values[0]).collect();
    assert!(firsts.windows(2).all(|pair| (pair[1] / pair[0] - 9f64.powf(0.2)).abs() < 1e-12), "{firsts:?}");
}

/// A record does not depend on other cells: cells of a grid are listed in another order, one of them twice.
#[test]
fn cells_of_a_list_equal_those_of_the_grid_bit_by_bit() {
    let grid = job::run(&coupled().build().unwrap(), Processor::Cpu).unwrap();
    let mut order: Vec<usize> = (0..30).map(|n| n * 7 % 30).collect();
    order.push(4);
    let values: Vec<[f64; 2]> = order
        .iter()
        .map(|&id| {
            let cell = grid.cell([id % 6, id / 6]);
            [cell.values[1], cell.values[0]]
        })
        .collect();
    let scene = built()
        .derived("k2", "2/3*k1")
        .derived("r2", "0.02*k2 + max(r1, 0.1)")
        .cells(["F", "k1"], &values)
        .build()
        .unwrap();
    let list = job::run(&scene, Processor::Cpu).unwrap();
    assert_eq!(list.counts(), [31, 1]);
    assert!(
        order.iter().enumerate().all(|(row, &id)| list.records().record(row) == grid.records().record(id))
    );
    assert!(list.cells().zip(&values).all(|(cell, values)| cell.values == values));
    // F and k1 are parameters of the oscillator, not of the law.
    assert_eq!((list.plan().flow_count(), list.plan().law_count()), (30, 1));
}

/// The meshing stiffness has no effect if the force is too small for contact, or if contact does not lead to meshing.
#[test]
fn parameters_of_teeth_that_do_not_meet_have_no_effect() {
    let map_of = |e: f64, forces: std::ops::RangeInclusive<f64>| {
        let scene =
            built().parameter("e", e).log_axis("k", 100.0..=10000.0, 4).axis("F", forces, 5).build().unwrap();
        let map = job::run(&scene, Processor::Cpu).unwrap();
        effect::names(map.plan(), map.records(), "f64")
    };
    let plan = Plan::new(&built().axis("k", 100.0..=200.0, 2).axis("F", 1.0..=2.0, 2).build().unwrap());
    assert!(Flow::new(&plan.oscillator(0)).non_impacting().is_some());
    // All cells have the contact-free cycle and one exponent, so the force has no effect either.
    assert_eq!(map_of(0.3, 1.0..=4.0), ["k", "F"]);
    // Impacts without meshing.
    assert_eq!(map_of(0.3, 1.0..=50.0), ["k"]);
    assert_eq!(map_of(0.06, 1.0..=50.0), [""; 0]);
}
