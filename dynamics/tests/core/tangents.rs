//! Tangent vectors, saltation included, against central differences of the strobe map.
//!
//! The differences are what limits the agreement: with steps of `1e-6` their truncation is
//! `1e-12` times the third derivative of the map, their rounding `1e-10` times the scale of
//! the state over that of the derivative.

use crate::common::{REST, flow_of, paper, strobe};
use nalgebra::Matrix4;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{GearPair, State};
use rattlemap_dynamics::reference::{EventKind, GapEvent, Trajectory};

/// Half the width of the central differences.
const STEP: f64 = 1e-6;

const UNITS: [State; 4] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

fn matrix(columns: [State; 4]) -> Matrix4<f64> {
    Matrix4::from_columns(&columns.map(nalgebra::Vector4::from))
}

/// The derivative of the strobe map over some periods, carried along, with its events.
fn carried(flow: &Flow, pair: &GearPair, y: State, periods: u64) -> (Matrix4<f64>, Vec<GapEvent>) {
    let mut trajectory = Trajectory::with_tangents(flow, pair.law(), y, UNITS);
    let mut events = Vec::new();
    for _ in 0..periods {
        trajectory.advance_period(&mut events).expect("an ordinary cell");
    }
    (matrix(trajectory.tangents()), events)
}

/// The same by central differences of fourth order.
fn differences(flow: &Flow, pair: &GearPair, y: State, periods: u64) -> Matrix4<f64> {
    let at = |unit: State, step: f64| {
        let from = std::array::from_fn(|i| y[i] + step * unit[i]);
        nalgebra::Vector4::from(strobe(flow, pair, from, periods).expect("an ordinary cell"))
    };
    let column = |unit: State| {
        let central = |h: f64| (at(unit, h) - at(unit, -h)) / (2.0 * h);
        (central(STEP) * 4.0 - central(2.0 * STEP)) / 3.0
    };
    Matrix4::from_columns(&UNITS.map(column))
}

struct Cell {
    what: &'static str,
    pair: GearPair,
    periods: u64,
    /// Agreement asked, relative to the norm of the matrix: four or five times what was measured, since the
    /// differences' rounding, which limits it, is another on another processor. The worst came to 1.8e-8.
    agreement: f64,
}

fn cell(what: &'static str, e: f64, omega: f64, periods: u64, agreement: f64) -> Cell {
    Cell { what, pair: paper(e, omega), periods, agreement }
}

fn check(cell: &Cell) {
    let Cell { what, pair, periods, agreement } = cell;
    let flow = flow_of(pair);
    let y = strobe(&flow, pair, REST, 60).expect("an ordinary cell");
    let (carried, events) = carried(&flow, pair, y, *periods);
    let differences = differences(&flow, pair, y, *periods);
    let off = (carried - differences).norm() / differences.norm();
    let count = |kind: EventKind| events.iter().filter(|event| event.kind == kind).count();
    println!(
        "{what} (e = {}, omega = {}): {} impacts, {} starts of meshing, |M| = {:.1e}, off by {off:.1e}",
        pair.e,
        pair.omega,
        count(EventKind::Impact),
        count(EventKind::MeshStart),
        differences.norm()
    );
    assert!(off < *agreement, "{what}: off by {off:.2e}:{carried}{differences}");
}

#[test]
fn tangents_are_derivatives_of_the_strobe_map() {
    for cell in [
        cell("contact-free", 0.5, 11.0, 3, 1.5e-9),
        cell("one impact per side", 0.56, 5.6, 1, 5e-9),
        cell("one impact per side, two periods", 0.56, 5.6, 2, 1.5e-8),
        cell("one impact per side", 0.2, 7.5, 1, 5e-9),
        cell("elastic impacts", 1.0, 5.6, 1, 4e-9),
        cell("eight impacts", 0.56, 3.4, 1, 2.5e-9),
        cell("meshing on both sides", 0.0, 5.6, 1, 9e-9),
        cell("meshing on both sides, two periods", 0.0, 5.6, 2, 3e-8),
        cell("meshing on both sides", 0.0, 1.5, 1, 2.5e-8),
        cell("meshing and impacts", 0.06, 5.6, 1, 7e-9),
        cell("meshing near resonance", 0.0, 4.2, 1, 6e-8),
        cell("chatter into meshing", 0.2, 2.5, 1, 1e-8),
        cell("chatter into meshing", 0.56, 1.5, 1, 3.5e-8),
        cell("chaos, one period", 0.72, 4.2, 1, 6e-8),
        cell("chaos, one period", 0.72, 5.6, 1, 5e-9),
    ] {
        check(&cell);
    }
}

/// An infinite series of impacts, closed in one jump that lasts up to `1e-4` in units of the fastest
/// rate: tangents are right up to its square. (2e-7 at most, which is the differences' own; 1e-4 if they
/// are right in the first order alone.)
#[test]
fn tangents_survive_the_closing_of_a_chatter_series() {
    for (e, omega) in [(0.2, 1.5), (0.5, 1.5), (0.2, 2.5), (0.5, 1.0)] {
        let pair = GearPair { mesh_speed: 0.0, ..paper(e, omega) };
        check(&Cell { what: "infinite chatter", pair, periods: 1, agreement: 1e-6 });
    }
}

/// Period by period or all at once, the monodromy matrix is the same product.
#[test]
fn tangents_compose() {
    // Measurement 3.8e-16, 3.5e-16 and 2.4e-14.
    for (e, omega, agreement) in [(0.56, 5.6, 2e-15), (0.0, 5.6, 2e-15), (0.2, 2.5, 1e-13)] {
        let pair = paper(e, omega);
        let flow = flow_of(&pair);
        let y = strobe(&flow, &pair, REST, 60).expect("an ordinary cell");
        let mut product = Matrix4::identity();
        let mut trajectory = Trajectory::with_tangents(&flow, pair.law(), y, UNITS);
        for _ in 0..5 {
            trajectory.advance_period(&mut ()).expect("an ordinary cell");
            product = matrix(trajectory.tangents()) * product;
            trajectory.set_tangents(UNITS);
        }
        let (whole, _) = carried(&flow, &pair, y, 5);
        let off = (product - whole).norm() / whole.norm();
        assert!(off < agreement, "e = {e}, omega = {omega}: off by {off:.1e}");
    }
}

/// Carrying tangent vectors along changes nothing in the motion.
#[test]
fn tangents_do_not_disturb_the_motion() {
    for (e, omega) in [(0.72, 5.6), (0.0, 4.2), (0.56, 1.5)] {
        let pair = paper(e, omega);
        let flow = flow_of(&pair);
        let mut with = Trajectory::with_tangents(&flow, pair.law(), REST, UNITS);
        let mut without = Trajectory::new(&flow, pair.law(), REST);
        for _ in 0..100 {
            with.set_tangents(UNITS);
            with.advance_period(&mut ()).expect("an ordinary cell");
            without.advance_period(&mut ()).expect("an ordinary cell");
        }
        assert_eq!(with.state(), without.state(), "e = {e}, omega = {omega}");
    }
}
