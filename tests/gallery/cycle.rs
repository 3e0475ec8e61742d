//! Motions computed by the reference and by the judge of maps.

use nalgebra::{Complex, DMatrix, Matrix4};

use rattlemap::validate::independent::machine::Flight;
use rattlemap_dynamics::model::{Form, Law, Pair, State};
use rattlemap_dynamics::motion::{Flow, GapEvent, Trajectory};
use rattlemap_dynamics::stability::UNIT;

use crate::common::apart;
use crate::common::pairs::described;

/// A motion over some periods.
pub(crate) struct Followed {
    /// Last state.
    pub(crate) end: State,
    pub(crate) events: Vec<GapEvent>,
    /// Monodromy matrix.
    pub(crate) monodromy: Matrix4<f64>,
    pub(crate) meshing_time: f64,
}

/// Computes the reference's motion from a start at phase 0.
pub(crate) fn followed(oscillator: impl Into<Form>, law: Law, start: State, periods: u32) -> Followed {
    let flow = Flow::new(oscillator);
    let mut trajectory = Trajectory::with_tangents(&flow, law, start, UNIT);
    let mut events = Vec::new();
    for _ in 0..periods {
        trajectory.advance_period(&mut events).expect("an ordinary motion");
    }
    let columns = trajectory.tangents();
    Followed {
        end: trajectory.state(),
        events,
        monodromy: Matrix4::from_fn(|i, j| columns[j][i]) * trajectory.log_scale().exp(),
        meshing_time: trajectory.meshing_time(),
    }
}

/// Returns the distance of the last states of the reference and of the judge of maps. Both must find the same number of
/// events.
pub(crate) fn off_the_judge(oscillator: &Pair, law: Law, start: State, periods: u32) -> f64 {
    let mut flight = Flight::new(&described(oscillator, law), &start);
    (0..periods).for_each(|_| flight.advance(0.0, std::f64::consts::TAU).expect("an ordinary motion"));
    let ours = followed(oscillator, law, start, periods);
    assert_eq!(flight.events.len(), ours.events.len(), "{:?} {:?}", flight.events, ours.events);
    apart(flight.state(), ours.end)
}

/// Returns the eigenvalues of a 2 x 2 matrix, the larger first.
pub(crate) fn eigenvalues([[a, b], [c, d]]: [[f64; 2]; 2]) -> [Complex<f64>; 2] {
    let (trace, det) = (a + d, a * d - b * c);
    let root = Complex::new(0.25 * trace * trace - det, 0.0).sqrt();
    let [first, second] = [0.5 * trace + root, 0.5 * trace - root];
    if first.norm() >= second.norm() { [first, second] } else { [second, first] }
}

/// Returns the multipliers of a monodromy matrix.
pub(crate) fn multipliers(m: &Matrix4<f64>) -> Option<Vec<[f64; 2]>> {
    rattlemap_dynamics::stability::multipliers(&DMatrix::from_column_slice(4, 4, m.as_slice()))
}

/// Returns the block of the first displacement and its velocity.
pub(crate) fn first_block(m: &Matrix4<f64>) -> [[f64; 2]; 2] {
    [[m[(0, 0)], m[(0, 1)]], [m[(1, 0)], m[(1, 1)]]]
}

/// Returns the difference of two pairs of multipliers in trace and determinant, which needs no roots.
pub(crate) fn multipliers_apart(ours: [[f64; 2]; 2], theirs: [[f64; 2]; 2]) -> f64 {
    let trace = |m: [[f64; 2]; 2]| m[0][0] + m[1][1];
    let det = |m: [[f64; 2]; 2]| m[0][0] * m[1][1] - m[0][1] * m[1][0];
    (trace(ours) - trace(theirs)).abs().max((det(ours) - det(theirs)).abs())
}
