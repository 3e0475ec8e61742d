//! Which oscillator is it that a lane's numbers describe, each of them rounded once?

use nalgebra::{Matrix2, Vector2};

use super::case::Case;
use crate::flow::Flow;
use crate::gpu::{Constants, Precision, constants};
use crate::model::{Domain, Law, Oscillator, State};

/// A cell as a lane has it.
pub(super) struct LaneModel {
    pub(super) constants: Constants,
    pub(super) precision: Precision,
    /// The flow of its careful passes, which make the motion from the accelerations.
    pub(super) flow: Flow,
    pub(super) law: Law,
    /// What the propagators of its whole steps are more than the flow's, row by row.
    pub(super) excess: [[f64; 28]; 3],
}

/// A number as a lane has it.
pub(super) fn in_precision(precision: Precision, x: f64) -> f64 {
    match precision {
        Precision::F32 => f64::from(x as f32),
        Precision::F64 => x,
    }
}

impl LaneModel {
    /// That of a cell's lane; none where lanes refuse it.
    pub(super) fn new(case: &Case<'_>) -> Option<LaneModel> {
        let rounded = |x: f64| in_precision(case.precision, x);
        let oscillator = case.pair.oscillator().ok()?;
        let constants = Constants::new(&oscillator, None)?;
        let law =
            Law { restitution: rounded(case.law.restitution), mesh_speed: rounded(case.law.mesh_speed) };
        let excess = constants.flow.domains.map(|domain| {
            let rows = [domain.gap_row, domain.x_row].map(|row| row.map(rounded));
            let step = constants::step(&rows[0], &rows[1], domain.angle);
            std::array::from_fn(|i| rounded(domain.step[i]) - step[i])
        });
        let flow = Flow::new(&as_rounded(&oscillator, &constants, law.restitution, &rounded));
        Some(LaneModel { constants, precision: case.precision, flow, law, excess })
    }

    /// The same without rounding of what the state depends on: for tangent vectors alone.
    pub(super) fn of_tangents(case: &Case<'_>) -> Option<LaneModel> {
        let rounded = |x: f64| in_precision(case.precision, x);
        let oscillator = case.pair.oscillator().ok()?;
        let constants = Constants::new(&oscillator, None)?;
        let excess = constants.flow.domains.map(|domain| domain.step.map(|x| rounded(x) - x));
        let flow = Flow::new(&oscillator);
        Some(LaneModel { constants, precision: case.precision, flow, law: case.law, excess })
    }

    /// Where a lane starts that is told to start at `y`.
    pub(super) fn start(&self, y: State) -> State {
        let q = self.constants.to_lane(y);
        self.constants.to_state(q.map(|x| in_precision(self.precision, x)))
    }
}

/// The oscillator whose accelerations, per square of a lane's step, are the lane's rounded ones, with walls and
/// a kick as the lane has them.
fn as_rounded(
    exact: &Oscillator,
    constants: &Constants,
    restitution: f64,
    rounded: &impl Fn(f64) -> f64,
) -> Oscillator {
    let lane = &constants.flow;
    let [g0, g1] = exact.gap;
    let walls = exact.walls.map(rounded);
    // The impulse of a contact takes `kick (1 + e)` of the gap's rate: two numbers that are rounded.
    let one_more = rounded(1.0 + restitution);
    let kick = rounded(lane.kick) * one_more / (1.0 + restitution);
    let m2 = exact.masses[0] * (-g1 - kick * g1 * g1) / (kick * g0 * g0);
    let is_mass = m2.is_finite() && m2 > 0.5 * exact.masses[1] && m2 < 2.0 * exact.masses[1];
    let masses = [exact.masses[0], if is_mass { m2 } else { exact.masses[1] }];
    let to_gap = Matrix2::new(g0, g1, 0.0, 1.0);
    let by_mass = Matrix2::from_diagonal(&Vector2::from(masses)) * Matrix2::new(1.0 / g0, -g1 / g0, 0.0, 1.0);
    let domain = |i: usize, wall: f64| {
        let of = &lane.domains[i];
        let h = lane.h * of.share;
        let rows = [of.gap_row, of.x_row].map(|row| row.map(rounded));
        let matrix = |column: usize, unit: f64| {
            let entry = |i: usize, j: usize| -rows[i][2 * j + column] / unit;
            let whole = by_mass * Matrix2::new(entry(0, 0), entry(0, 1), entry(1, 0), entry(1, 1)) * to_gap;
            [[whole[(0, 0)], whole[(0, 1)]], [whole[(1, 0)], whole[(1, 1)]]]
        };
        let vector = |of: [f64; 2]| <[f64; 2]>::from(by_mass * Vector2::from(of));
        // Meshing measures the gap from its wall.
        let load = rows.map(|row| (row[5] - row[0] * wall) / (h * h));
        let force = rows.map(|row| row[4] / (h * h));
        let domain = Domain { damping: matrix(1, h), stiffness: matrix(0, h * h), load: vector(load) };
        (domain, vector(force))
    };
    let (free, force) = domain(0, 0.0);
    let meshing = [domain(1, walls[0]).0, domain(2, walls[1]).0];
    Oscillator { masses, gap: exact.gap, walls, omega: exact.omega, force, free, meshing }
}
