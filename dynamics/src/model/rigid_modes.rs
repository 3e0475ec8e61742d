//! Rigid-body modes: directions along which a position does not matter.

use nalgebra::{DMatrix, DVector};

use super::oscillator::MATRIX_TOLERANCE;
use super::{Forces, GapRow, Oscillator, Pair, Signal, State};
use crate::motion::{place_of_displacement, place_of_gap, place_of_signal};

/// A direction `n` along which the oscillator can be shifted without changing a force: `K n = 0` in every stage, and `g . n = 0` for the row
/// of every gap with walls. Examples are a capsule that moves over the ground, and a driveline without a spring to its housing.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidMode {
    /// The coordinate that measures the shift. Its entry in the direction is 1, and 0 in those of the other modes.
    pub coordinate: usize,
    /// One entry for each coordinate.
    pub direction: DVector<f64>,
    /// Change of each gap by a shift by 1: 0 for gaps with walls.
    pub gaps: Vec<f64>,
}

impl RigidMode {
    /// Returns the change of a displacement, a gap or a signal if the oscillator is shifted by 1, by its place in
    /// [`Quantities::displacements`](crate::orbit::Quantities::displacements).
    pub fn along(&self, place: usize, signals: &[Signal]) -> f64 {
        let of_signal = |(i, signal): (usize, &Signal)| {
            (place_of_signal(i) == place).then(|| signal.displacement.dot(&self.direction))
        };
        let displacement = (0..self.direction.len()).find(|&i| place_of_displacement(i) == place);
        let signal = || signals.iter().enumerate().find_map(of_signal);
        let gap = || (0..self.gaps.len()).find(|&i| place_of_gap(i) == place).map(|i| self.gaps[i]);
        displacement.map(|i| self.direction[i]).or_else(signal).or_else(gap).unwrap_or(0.0)
    }
}

/// The rigid-body modes of an oscillator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigidModes {
    /// A basis.
    pub modes: Vec<RigidMode>,
    /// Number of independent modes along which neither dampers nor friction act. Only the force and the load change the momentum along them.
    pub conserved: usize,
    /// Whether dampers do not act along a mode, and the load over a forcing period exceeds all friction there, so that the motion
    /// accelerates for ever.
    pub accelerates: bool,
}

/// What decides about rigid-body modes.
struct Description<'a> {
    /// Stiffness and damping of each stage.
    stages: Vec<[DMatrix<f64>; 2]>,
    /// Rows of all gaps, and of those that a force may hold, with nonlinear springs.
    gaps: Vec<&'a DVector<f64>>,
    held: Vec<&'a DVector<f64>>,
    /// Rows of friction with the largest forces.
    friction: Vec<(&'a DVector<f64>, f64)>,
    /// Load of each stage.
    loads: Vec<DVector<f64>>,
    schedule: &'a [(f64, usize)],
}

impl Description<'_> {
    /// Returns the average of the load over a forcing period.
    fn load(&self) -> DVector<f64> {
        let Some(first) = self.schedule.first() else { return self.loads[0].clone() };
        let ends = self.schedule.iter().skip(1).map(|change| change.0).chain([1.0 + first.0]);
        self.schedule.iter().zip(ends).map(|(&(begin, stage), end)| &self.loads[stage] * (end - begin)).sum()
    }
}

impl RigidModes {
    fn of(description: &Description<'_>, n: usize) -> RigidModes {
        let Description { stages, gaps, held, friction, .. } = description;
        let as_matrix = |row: &DVector<f64>| DMatrix::from_rows(&[row.transpose()]);
        let held = || {
            let rows = held.iter().map(|row| as_matrix(row));
            stages.iter().map(|[stiffness, _]| stiffness.clone()).chain(rows)
        };
        let found = null_space(n, held());
        if found.is_empty() {
            return RigidModes::default();
        }
        let product_and_size = |a: &DVector<f64>, b: &DVector<f64>| {
            let products = a.component_mul(b);
            [products.sum().abs(), products.lp_norm(1)]
        };
        let mode = |(coordinate, direction): (usize, DVector<f64>)| {
            let change = |row: &&DVector<f64>| {
                let [product, size] = product_and_size(row, &direction);
                if product > MATRIX_TOLERANCE * size { row.dot(&direction) } else { 0.0 }
            };
            let gaps = gaps.iter().map(change).collect();
            RigidMode { coordinate, direction, gaps }
        };
        // Directions along which neither dampers nor the chosen elements with friction act.
        let undamped = |chosen: usize| {
            let damped = stages.iter().flat_map(|[_, damping]| [damping.clone(), damping.transpose()]);
            let chosen = (0..friction.len()).filter(move |i| chosen >> i & 1 == 1);
            null_space(n, held().chain(damped).chain(chosen.map(|i| as_matrix(friction[i].0))))
        };
        let load = description.load();
        let exceeds = |(_, direction): &(usize, DVector<f64>)| {
            let [load, size] = product_and_size(&load, direction);
            let opposing = friction.iter().map(|(row, force)| row.dot(direction).abs() * force).sum::<f64>();
            load - opposing > MATRIX_TOLERANCE * (size + opposing)
        };
        let choices = 1 << friction.len();
        RigidModes {
            modes: found.into_iter().map(mode).collect(),
            conserved: undamped(choices - 1).len(),
            // If the load exceeds friction along any direction, it does so along one of these, at which some sliding rates are 0: the forces
            // that friction can balance are the combinations of its rows with limited factors, a convex polytope with these normals.
            accelerates: (0..choices).any(|chosen| undamped(chosen).iter().any(exceeds)),
        }
    }

    /// Shifts a state along the modes.
    pub(crate) fn shifted(&self, mut y: State, by: &[f64]) -> State {
        for (mode, by) in self.modes.iter().zip(by) {
            mode.direction.iter().enumerate().for_each(|(i, direction)| y[2 * i] += by * direction);
        }
        y
    }

    /// Shifts a state back along the modes, so that the coordinate that measures each mode is 0.
    pub fn shifted_back(&self, mut y: State) -> State {
        for mode in &self.modes {
            let by = y[2 * mode.coordinate];
            mode.direction.iter().enumerate().for_each(|(i, direction)| y[2 * i] -= by * direction);
        }
        y
    }
}

impl Oscillator {
    /// Returns the rigid-body modes.
    pub fn rigid_modes(&self) -> RigidModes {
        let of_stage = |forces: &Forces| [forces.stiffness.clone(), forces.damping.clone()];
        // Nothing happens at a gap without walls. A pair has no coordinate but its gap that it could shift.
        let is_held =
            |gap: &&GapRow| self.needs_machine().is_none() || gap.walls.iter().any(|walls| !walls.is_empty());
        let held = self.gaps.iter().filter(is_held).map(|gap| &gap.row);
        let acting = self.friction.iter().filter(|friction| friction.acts());
        let description = Description {
            stages: self.stages.iter().map(of_stage).collect(),
            gaps: self.gaps.iter().map(|gap| &gap.row).collect(),
            held: held.chain(self.springs.iter().map(|spring| &spring.row)).collect(),
            friction: acting.map(|friction| (&friction.row, friction.largest_force())).collect(),
            loads: self.stages.iter().map(|forces| forces.load.clone()).collect(),
            schedule: &self.schedule,
        };
        RigidModes::of(&description, self.degrees())
    }
}

impl Pair {
    /// Returns the rigid-body modes: none, or one that [`Pair::other`] measures.
    pub fn rigid_modes(&self) -> RigidModes {
        if self.degrees == 1 {
            return RigidModes::default();
        }
        let matrix = |of: [[f64; 2]; 2]| DMatrix::from_fn(2, 2, |i, j| of[i][j]);
        let vector = |of: [f64; 2]| DVector::from_column_slice(&of);
        let gap = vector(self.gap);
        let free = || (0..self.stage_count()).map(|stage| self.stage(stage).free);
        let description = Description {
            stages: free().map(|free| [matrix(free.stiffness), matrix(free.damping)]).collect(),
            gaps: vec![&gap],
            held: vec![&gap],
            friction: Vec::new(),
            loads: free().map(|free| vector(free.load)).collect(),
            schedule: &self.schedule,
        };
        let mut found = RigidModes::of(&description, 2);
        for mode in &mut found.modes {
            mode.coordinate = self.other();
            mode.direction /= mode.direction[mode.coordinate];
        }
        found
    }
}

/// Returns a basis of the vectors that all matrices map to 0, each with the place of an entry that is 1, and 0 in the others, by Gauss-Jordan
/// elimination with full pivoting. The entries of each matrix are compared with its largest one.
fn null_space(n: usize, matrices: impl Iterator<Item = DMatrix<f64>>) -> Vec<(usize, DVector<f64>)> {
    let mut rows: Vec<DVector<f64>> = Vec::new();
    for matrix in matrices.filter(|matrix| matrix.amax() > 0.0) {
        rows.extend((&matrix / matrix.amax()).row_iter().map(|row| row.transpose()));
    }
    let mut pivots: Vec<usize> = Vec::new();
    while pivots.len() < n {
        let done = pivots.len();
        let entries = (done..rows.len()).flat_map(|i| (0..n).map(move |j| (i, j)));
        let left = entries.filter(|(_, j)| !pivots.contains(j));
        let Some((i, j)) = left.max_by(|a, b| rows[a.0][a.1].abs().total_cmp(&rows[b.0][b.1].abs())) else {
            break;
        };
        if rows[i][j].abs() <= MATRIX_TOLERANCE {
            break;
        }
        rows.swap(done, i);
        let pivot = &rows[done] / rows[done][j];
        for (k, row) in rows.iter_mut().enumerate() {
            let factor = row[j];
            if k == done { *row = pivot.clone() } else { *row -= &pivot * factor }
        }
        pivots.push(j);
    }
    let free = (0..n).filter(|j| !pivots.contains(j));
    let mode = |coordinate: usize| {
        let mut direction = DVector::zeros(n);
        direction[coordinate] = 1.0;
        for (row, &pivot) in rows.iter().zip(&pivots) {
            direction[pivot] = if row[coordinate].abs() > MATRIX_TOLERANCE { -row[coordinate] } else { 0.0 };
        }
        (coordinate, direction)
    };
    free.map(mode).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_those_that_no_matrix_sees() {
        let chain = DMatrix::from_row_slice(3, 3, &[2.0, -2.0, 0.0, -2.0, 3.0, -1.0, 0.0, -1.0, 1.0]);
        let [(_, mode)] = &null_space(3, [chain.clone()].into_iter())[..] else { panic!() };
        assert!((mode - DVector::from_element(3, 1.0)).amax() < 1e-15, "{mode:?}");
        let ratio = DMatrix::from_row_slice(1, 3, &[1.0, -2.0, 0.0]);
        let modes = null_space(3, [ratio.clone()].into_iter());
        assert_eq!(modes.len(), 2);
        assert!(modes.iter().all(|(_, mode)| (&ratio * mode).amax() == 0.0));
        assert_eq!(null_space(3, [chain, ratio].into_iter()).len(), 0);
        assert_eq!(null_space(2, [DMatrix::zeros(2, 2)].into_iter()).len(), 2);
    }
}
