//! Maps of another model than the gear pair.

use rattlemap::job;
use rattlemap::job::Processor;
use rattlemap::map::scene::{Quantity, Scene, Start};
use rattlemap::record::valid;
use rattlemap_dynamics::model::{Stops, state};
use rattlemap_dynamics::orbit::Class;

fn stops(e: f64) -> Stops {
    Stops {
        m: 1.5,
        r: 0.0,
        k: 0.0,
        stop_damping: 1.0,
        stop_stiffness: 1000.0,
        force: 0.0,
        omega: 1.0,
        b: 0.5,
        e,
        mesh_speed: 0.0,
    }
}

/// Between elastic impacts, a free particle of speed `v` reaches a wall every `2 b / v`: `2 pi v / (2 b omega)` impacts
/// per forcing period.
#[test]
fn impacts_between_stops_agree_with_the_closed_form() {
    let speed = 0.7;
    let scene = Scene::builder(stops(1.0))
        .axis("b", 0.25..=1.0, 4)
        .axis("omega", 0.05..=0.2, 4)
        .start(Start::State(state(&[0.0, speed])))
        .quantities(&[Quantity::Impacts])
        .build()
        .unwrap();
    assert_eq!(scene.title(), "Oscillator between stops: half distance of the stops x excitation frequency");
    let map = job::run(&scene, Processor::Cpu).unwrap();
    assert_eq!((map.counts(), map.cells().len()), ([4, 4], 16));
    for cell in map.cells() {
        let (b, omega) = (cell.values[0], cell.values[1]);
        let model = map.model(&cell);
        assert_eq!(*model, Stops { b, omega, ..stops(1.0) });
        assert!(cell.record.valid & valid::IMPACTS != 0 && cell.class != Class::Failed, "{cell:?}");
        let expected = std::f64::consts::PI * speed / (b * omega);
        // The count may be off by one impact over all observed periods.
        let periods = f64::from(scene.integration().observed_periods.min(cell.record.periods_run));
        let apart = (cell.record.impacts_per_period - expected).abs();
        assert!(apart <= 1.0 / periods, "b = {b}, omega = {omega}: {apart} from {expected}");
        assert_eq!(cell, map.cell(cell.indices));
    }
}

/// Cells that differ only in the law share one flow.
#[test]
fn cells_of_stops_share_flows_and_laws() {
    let builder = || Scene::builder(stops(1.0));
    let law = builder().axis("e", 0.0..=1.0, 3).axis("mesh_speed", 0.0..=1.0, 5).build().unwrap();
    let plan = rattlemap::map::plan::Plan::new(&law);
    assert_eq!((plan.flow_count(), plan.law_count()), (1, 15));
    let both = builder().axis("e", 0.0..=1.0, 3).axis("m", 1.0..=2.0, 5).build().unwrap();
    let plan = rattlemap::map::plan::Plan::new(&both);
    assert_eq!((plan.flow_count(), plan.law_count(), plan.check()), (5, 3, Ok(())));
}
