//! Tangent vectors against central differences of the strobe map.
//!
//! The differences limit the agreement: with steps of `1e-6` their rounding error is `1e-10` times the ratio of the scales of state and
//! derivative.

use crate::common::{REST, flow_of, paper, strobe};
use nalgebra::Matrix4;
use rattlemap_dynamics::model::{GearPair, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{EventKind, GapEvent, Trajectory};
use rattlemap_dynamics::stability::UNIT;

fn matrix(columns: [State; 4]) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| columns[j][i])
}

/// Returns the derivative of the strobe map over some periods by tangent vectors, and the events.
fn derivative(flow: &Flow, pair: &GearPair, y: State, periods: u64) -> (Matrix4<f64>, Vec<GapEvent>) {
    let mut trajectory = Trajectory::with_tangents(flow, pair.law(), y, UNIT);
    let mut events = Vec::new();
    for _ in 0..periods {
        trajectory.advance_period(&mut events).expect("an ordinary cell");
    }
    (matrix(trajectory.tangents()), events)
}

struct Cell {
    what: &'static str,
    pair: GearPair,
    periods: u64,
    /// Largest difference, relative to the norm of the matrix: four or five times the measured one, because the
    /// rounding of the differences depends on the processor. The worst measured one is 1.8e-8.
    agreement: f64,
}

fn cell(what: &'static str, e: f64, omega: f64, periods: u64, agreement: f64) -> Cell {
    Cell { what, pair: paper(e, omega), periods, agreement }
}

fn check(cell: &Cell) {
    let Cell { what, pair, periods, agreement } = cell;
    let flow = flow_of(pair);
    let y = strobe(&flow, pair, REST, 60).expect("an ordinary cell");
    let (ours, events) = derivative(&flow, pair, y, *periods);
    let map = |y: State| strobe(&flow, pair, y, *periods).expect("an ordinary cell");
    let differences = matrix(crate::common::differences(map, y, 1e-6));
    let off = (ours - differences).norm() / differences.norm();
    let count = |kind: EventKind| events.iter().filter(|event| event.kind == kind).count();
    println!(
        "{what} (e = {}, omega = {}): {} impacts, {} starts of meshing, |M| = {:.1e}, off by {off:.1e}",
        pair.e,
        pair.omega,
        count(EventKind::Impact),
        count(EventKind::MeshStart),
        differences.norm()
    );
    assert!(off < *agreement, "{what}: off by {off:.2e}:{ours}{differences}");
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

/// The jump over an infinite series of impacts lasts up to `1e-4` Taylor steps, and its tangents are of second order
/// in that. The measured difference is at most 2e-7; tangents of first order would differ by 1e-4.
#[test]
fn tangents_are_derivatives_through_infinite_chatter() {
    for (e, omega) in [(0.2, 1.5), (0.5, 1.5), (0.2, 2.5), (0.5, 1.0)] {
        let pair = GearPair { mesh_speed: 0.0, ..paper(e, omega) };
        check(&Cell { what: "infinite chatter", pair, periods: 1, agreement: 1e-6 });
    }
}

#[test]
fn the_derivative_over_five_periods_is_the_product_of_five() {
    // The measured differences are 3.8e-16, 3.5e-16 and 2.4e-14.
    for (e, omega, agreement) in [(0.56, 5.6, 2e-15), (0.0, 5.6, 2e-15), (0.2, 2.5, 1e-13)] {
        let pair = paper(e, omega);
        let flow = flow_of(&pair);
        let y = strobe(&flow, &pair, REST, 60).expect("an ordinary cell");
        let mut product = Matrix4::identity();
        let mut trajectory = Trajectory::with_tangents(&flow, pair.law(), y, UNIT);
        for _ in 0..5 {
            trajectory.advance_period(&mut ()).expect("an ordinary cell");
            product = matrix(trajectory.tangents()) * product;
            trajectory.set_tangents(UNIT);
        }
        let (whole, _) = derivative(&flow, &pair, y, 5);
        let off = (product - whole).norm() / whole.norm();
        assert!(off < agreement, "e = {e}, omega = {omega}: off by {off:.1e}");
    }
}

#[test]
fn tangents_do_not_change_the_motion() {
    for (e, omega) in [(0.72, 5.6), (0.0, 4.2), (0.56, 1.5)] {
        let pair = paper(e, omega);
        let flow = flow_of(&pair);
        let mut with = Trajectory::with_tangents(&flow, pair.law(), REST, UNIT);
        let mut without = Trajectory::new(&flow, pair.law(), REST);
        for _ in 0..100 {
            with.set_tangents(UNIT);
            with.advance_period(&mut ()).expect("an ordinary cell");
            without.advance_period(&mut ()).expect("an ordinary cell");
        }
        assert_eq!(with.state(), without.state(), "e = {e}, omega = {omega}");
    }
}
