//! A machine in the coordinates of its flow.

use nalgebra::{DMatrix, DVector};

use super::domain::RADIUS;
use super::{Numbers, PhasePoint, ROUNDING, SIZE};
use crate::model::{
    Contact, Curve, MOST_FRICTION, NonlinearSpring, Oscillator, RigidMode, RigidModes, Side, Wall,
};

/// Linear forces in the coordinates of the flow.
#[derive(Clone, Debug)]
pub(super) struct StageForces {
    pub(super) stiffness: DMatrix<f64>,
    pub(super) damping: DMatrix<f64>,
    pub(super) load: DVector<f64>,
}

/// An element with dry friction: its place in the model, factors of `w` in the sliding rate, force as a function of the modulus of this
/// rate, largest force while it sticks, and speed.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) index: usize,
    pub(super) row: DVector<f64>,
    pub(super) curve: Curve,
    pub(super) static_force: f64,
    pub(super) speed: f64,
}

/// A nonlinear spring: factors of `d` in its elongation, its force, and the wall with which it acts.
#[derive(Clone, Debug)]
pub(super) struct SpringElement {
    pub(super) row: DVector<f64>,
    pub(super) curve: Curve,
    pub(super) wall: Option<(usize, Side)>,
    /// Whether the force is negative somewhere from the first point on.
    may_pull: bool,
}

impl Element {
    /// Whether the force falls when sliding begins, so that accelerations jump.
    pub(super) fn falls(&self) -> bool {
        self.static_force > self.curve.at(0.0)
    }

    /// Returns the sliding rate for given rates of the coordinates, and the sum of the moduli of its terms. Rounding errors are relative to
    /// this sum.
    pub(super) fn rate_and_size(&self, rates: &[f64]) -> [f64; 2] {
        let terms = self.row.iter().zip(rates).map(|(row, rate)| row * rate);
        terms.fold([-self.speed, self.speed.abs()], |[sum, size], x| [sum + x, size + x.abs()])
    }
}

/// A rigid-body mode: the factors of `d` in the coordinate that measures the shift, and the shift of all `d` by 1.
#[derive(Clone, Debug)]
pub(super) struct Shift {
    pub(super) measure: Numbers,
    pub(super) direction: Numbers,
}

/// A machine in the coordinates of its flow.
#[derive(Clone, Debug)]
pub struct Frame {
    pub(super) machine: Oscillator,
    /// Number of coordinates of the flow: of the model, and one more for each gap whose row depends on those of earlier gaps.
    pub(super) n: usize,
    /// For each such gap, a row of `d` that is 0, so that the gap is the sum of multiples of others. Rows of `w` are the same.
    pub(super) ties: Vec<Numbers>,
    /// Forcing period.
    pub(super) period: f64,
    /// Scales of length and speed.
    pub(super) length: f64,
    pub(super) speed: f64,
    /// Displacement beyond which the motion has escaped.
    pub(super) escape: f64,
    /// Longest step in any stage and domain.
    pub(crate) longest_step: f64,
    /// `d = to_flow x`, and `x = from_flow d`, which does not read dependent gaps. Nor do mass, stiffness and damping of free motion.
    pub(super) to_flow: DMatrix<f64>,
    pub(super) from_flow: DMatrix<f64>,
    pub(super) mass: DMatrix<f64>,
    /// Changes of `w` by unit impulses, and the factor that scales the forces on independent coordinates to mass 1.
    pub(super) mobility: DMatrix<f64>,
    mass_scale: DMatrix<f64>,
    /// For each gap, the changes of all rates by an impulse that changes the gap's rate by 1.
    pub(super) kicks: Vec<Numbers>,
    pub(super) stages: Vec<StageForces>,
    /// Orders of the harmonics, and their cosines and sines as columns.
    pub(super) orders: Vec<f64>,
    pub(super) drives: Vec<[DVector<f64>; 2]>,
    pub(super) elements: Vec<Element>,
    pub(super) springs: Vec<SpringElement>,
    /// Changes of the stage: time since phase 0, and stage.
    pub(super) schedule: Vec<(f64, usize)>,
    /// Rigid-body modes, and in the coordinates of the flow.
    pub(super) rigid_modes: RigidModes,
    pub(super) shifts: Vec<Shift>,
}

impl Frame {
    /// Prepares a machine that [`Oscillator::validate`] accepts.
    pub(super) fn new(machine: &Oscillator) -> Frame {
        let (machine, degrees) = (machine.clone(), machine.degrees());
        let (to_flow, leading) = coordinates(&machine);
        let n = to_flow.nrows();
        let inverted = to_flow.select_rows(&leading).try_inverse().expect("the rows are independent");
        let mut from_flow = DMatrix::zeros(degrees, n);
        leading.iter().zip(inverted.column_iter()).for_each(|(&i, column)| from_flow.set_column(i, &column));
        // The coordinates as sums of multiples of the leading ones.
        let mut spread = &to_flow * &inverted;
        for (j, &i) in leading.iter().enumerate() {
            spread.set_row(i, &DMatrix::identity(degrees, degrees).row(j));
        }
        let tie = |gap: usize| {
            let mut row = [0.0; SIZE];
            row[gap] = 1.0;
            // Entries that are zero without rounding are set to zero.
            let entry = |x: f64| if x.abs() > ROUNDING * spread.row(gap).amax() { x } else { 0.0 };
            leading.iter().zip(&spread.row(gap)).for_each(|(&i, x)| row[i] = -entry(*x));
            row
        };
        let ties = (0..n).filter(|i| !leading.contains(i)).map(tie).collect();
        let back = from_flow.transpose();
        let mobility = &to_flow * inverse(&machine.mass) * to_flow.transpose();
        let mobility = 0.5 * (&mobility + mobility.transpose());
        let mass = &back * &machine.mass * &from_flow;
        let mass = 0.5 * (&mass + mass.transpose());
        let factor = mass.select_rows(&leading).select_columns(&leading).cholesky();
        let factor = factor.expect("the mass matrix is positive definite").l();
        let mass_scale = factor.try_inverse().expect("the factor is regular") * spread.transpose();
        let stages: Vec<StageForces> = machine
            .stages
            .iter()
            .map(|forces| StageForces {
                stiffness: &back * &forces.stiffness * &from_flow,
                damping: &back * &forces.damping * &from_flow,
                load: &back * &forces.load,
            })
            .collect();
        let with_force = machine.friction.iter().enumerate().filter(|(_, friction)| friction.acts());
        // Entries that are zero without rounding are set to zero, so that a row along a gap has no other entries.
        let in_flow = |row: &DVector<f64>| {
            let row = &back * row;
            let least = ROUNDING * row.amax();
            row.map(|x| if x.abs() > least { x } else { 0.0 })
        };
        let elements = with_force
            .map(|(index, friction)| {
                let row = in_flow(&friction.row);
                let (curve, static_force) = (friction.curve(), friction.static_force);
                Element { index, row, curve, static_force, speed: friction.speed }
            })
            .collect();
        let spring = |spring: &NonlinearSpring| SpringElement {
            row: in_flow(&spring.row),
            curve: spring.curve(),
            wall: spring.wall,
            may_pull: spring.may_pull(),
        };
        let springs = machine.springs.iter().map(spring).collect();
        let period = machine.period();
        let length = machine.length_scale();
        let kick = |gap: usize| {
            let mut kick = [0.0; SIZE];
            (0..n).for_each(|i| kick[i] = mobility[(i, gap)] / mobility[(gap, gap)]);
            kick
        };
        let entries = |of: &mut dyn Iterator<Item = f64>| {
            let mut all = [0.0; SIZE];
            all.iter_mut().zip(of).for_each(|(entry, value)| *entry = value);
            all
        };
        let shift = |mode: &RigidMode| {
            let mut direction = &to_flow * &mode.direction;
            direction.rows_mut(0, mode.gaps.len()).copy_from_slice(&mode.gaps);
            Shift {
                measure: entries(&mut from_flow.row(mode.coordinate).iter().copied()),
                direction: entries(&mut direction.iter().copied()),
            }
        };
        let rigid_modes = machine.rigid_modes();
        let shifts = rigid_modes.modes.iter().map(shift).collect();
        let mut frame = Frame {
            n,
            ties,
            rigid_modes,
            shifts,
            period,
            length,
            speed: 0.0,
            escape: f64::INFINITY,
            longest_step: 0.0,
            orders: machine.drives.iter().map(|drive| f64::from(drive.order)).collect(),
            drives: machine.drives.iter().map(|drive| [&back * &drive.cos, &back * &drive.sin]).collect(),
            kicks: (0..machine.gaps.len()).map(kick).collect(),
            schedule: machine.schedule.iter().map(|&(turns, stage)| (turns * period, stage)).collect(),
            to_flow,
            from_flow,
            mass,
            mobility,
            mass_scale,
            stages,
            elements,
            springs,
            machine,
        };
        let at_rest = |stage: usize| &back * frame.machine.stiffness_at_rest(stage) * &frame.from_flow;
        let rate = |stage: usize| frame.rate(&at_rest(stage), &frame.stages[stage].damping);
        let rates: Vec<f64> = (0..frame.stages.len()).map(rate).collect();
        frame.speed = length * rates.iter().copied().fold(0.0, f64::max);
        frame.longest_step = RADIUS / rates.into_iter().fold(f64::INFINITY, f64::min);
        if frame.can_grow() {
            frame.escape = frame.machine.escape();
        }
        frame
    }

    /// Whether energy can grow without the force.
    fn can_grow(&self) -> bool {
        let is_negative = |matrix: &DMatrix<f64>| {
            let scaled = self.mass_scaled(&(0.5 * (matrix + matrix.transpose()))).symmetric_eigenvalues();
            scaled.min() < -1e-12 * scaled.amax()
        };
        let falls = |spring: &SpringElement| spring.curve.pieces.iter().any(|[slope, _]| *slope < 0.0);
        self.stages.len() > 1
            || self.springs.iter().any(falls)
            || self.stages.iter().any(|forces| is_negative(&forces.stiffness) || is_negative(&forces.damping))
    }

    /// Transforms a matrix to coordinates with mass 1.
    fn mass_scaled(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        &self.mass_scale * matrix * self.mass_scale.transpose()
    }

    /// Returns a bound on the rates of the forcing and of free motion, for a given stiffness and damping. Norms of the mass-scaled matrices
    /// bound free motion.
    pub(super) fn rate(&self, stiffness: &DMatrix<f64>, damping: &DMatrix<f64>) -> f64 {
        let norm = |matrix: DMatrix<f64>| matrix.singular_values().max();
        let own = norm(self.mass_scaled(damping)) + norm(self.mass_scaled(stiffness)).sqrt();
        own.max(self.machine.omega * f64::from(self.machine.highest_order()))
    }

    /// Returns the machine.
    pub fn machine(&self) -> &Oscillator {
        &self.machine
    }

    pub(crate) fn rigid_modes(&self) -> &RigidModes {
        &self.rigid_modes
    }

    /// Returns the forcing period.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Returns the scales of length and speed, and the displacement beyond which the motion has escaped.
    pub fn units(&self) -> (f64, f64, f64) {
        (self.length, self.speed, self.escape)
    }

    /// Returns the number of coordinates of the model.
    pub(crate) fn degrees(&self) -> usize {
        self.from_flow.nrows()
    }

    pub(crate) fn gaps(&self) -> usize {
        self.machine.gaps.len()
    }

    pub(super) fn walls(&self, gap: usize, side: Side) -> &[Wall] {
        &self.machine.gaps[gap].walls[side.index()]
    }

    /// Returns the last wall of a side, which must have walls.
    pub(super) fn last_wall(&self, gap: usize, side: Side) -> &Wall {
        self.walls(gap, side).last().expect("there is a wall on this side")
    }

    /// Returns the number of the curve of a side's last wall, if this wall has a nonlinear spring.
    pub(super) fn curve_of_wall(&self, gap: usize, side: Side) -> Option<usize> {
        let spring = self.springs.iter().position(|spring| spring.wall == Some((gap, side)));
        spring.map(|spring| MOST_FRICTION + spring)
    }

    /// Returns the last wall of a side if it only pushes and has a damper, a preload or a force law that may pull. Without these it never
    /// pulls, like any elastic wall.
    pub(super) fn pushing(&self, gap: usize, side: Side) -> Option<&Wall> {
        let last = self.walls(gap, side).last()?;
        let differs =
            last.springs.iter().any(|spring| spring.damping != 0.0 || spring.force_at_wall() != 0.0);
        let may_pull =
            || self.curve_of_wall(gap, side).is_some_and(|i| self.springs[i - MOST_FRICTION].may_pull);
        (last.contact == Contact::Pushing && (differs || may_pull())).then_some(last)
    }

    /// Converts a state `(x1, v1, ...)` to `(d1 .. dn, w1 .. wn)`.
    pub(super) fn to_flow(&self, state: &[f64]) -> Numbers {
        let n = self.n;
        let mut y = [0.0; SIZE];
        for i in 0..n {
            for j in 0..self.degrees() {
                y[i] += self.to_flow[(i, j)] * state[2 * j];
                y[n + i] += self.to_flow[(i, j)] * state[2 * j + 1];
            }
        }
        y
    }

    /// Converts `(d1 .. dn, w1 .. wn)` to a state `(x1, v1, ...)`.
    pub(super) fn to_state(&self, y: &[f64]) -> Numbers {
        let n = self.n;
        let mut state = [0.0; SIZE];
        for i in 0..self.degrees() {
            for j in 0..n {
                state[2 * i] += self.from_flow[(i, j)] * y[j];
                state[2 * i + 1] += self.from_flow[(i, j)] * y[n + j];
            }
        }
        state
    }

    /// Returns all displacements, given the [leading gaps](Oscillator::leading_gaps) and the displacements that complete them to coordinates.
    pub fn displacements(&self, gaps_and_others: &[f64]) -> Vec<f64> {
        let leading = (0..self.n).filter(|&i| self.ties.iter().all(|tie| tie[i] != 1.0));
        let mut d = DVector::zeros(self.n);
        leading.zip(gaps_and_others).for_each(|(i, value)| d[i] = *value);
        (&self.from_flow * d).iter().copied().collect()
    }

    /// Returns the number of entries of [`PhasePoint`] that are in use.
    pub(super) fn width(&self) -> usize {
        2 * self.n + 2 * self.orders.len() + 1
    }

    /// Completes a state to a point, at a time since phase 0.
    pub(super) fn point(&self, y: &[f64], t: f64) -> PhasePoint {
        let mut point = [0.0; super::WIDTH];
        point[..2 * self.n].copy_from_slice(&y[..2 * self.n]);
        point[self.width() - 1] = 1.0;
        self.set_phasors(&mut point, t);
        point
    }

    /// Sets cosine and sine of all harmonics of a point, at a time since phase 0. Those of consecutive orders follow from products, whose
    /// rounding errors are not larger than those of large angles.
    pub(super) fn set_phasors(&self, point: &mut PhasePoint, t: f64) {
        let (phasors, _) = point[2 * self.n..].as_chunks_mut::<2>();
        let first = turned(self.machine.omega * t);
        let mut last = (0.0, [1.0, 0.0]);
        for (phasor, &order) in phasors.iter_mut().zip(&self.orders) {
            let ([a, b], [c, d]) = (first, last.1);
            *phasor = if order == last.0 + 1.0 {
                [a * c - b * d, a * d + b * c]
            } else {
                turned(order * self.machine.omega * t)
            };
            last = (order, *phasor);
        }
    }
}

/// Returns cosine and sine. It is a function of its own, because the compiler would compute them where they are not needed.
#[inline(never)]
fn turned(angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [cos, sin]
}

/// Returns the inverse of a symmetric positive definite matrix.
fn inverse(mass: &DMatrix<f64>) -> DMatrix<f64> {
    let is_diagonal = mass.iter().enumerate().all(|(k, x)| *x == 0.0 || k % (mass.nrows() + 1) == 0);
    if is_diagonal {
        return DMatrix::from_diagonal(&mass.diagonal().map(f64::recip));
    }
    mass.clone().cholesky().expect("the mass matrix is positive definite").inverse()
}

/// Returns the rows of the flow's coordinates: the gaps, and displacements that complete them. Also returns the places of independent ones:
/// all but the gaps that depend on earlier gaps. Among displacements with equal factors in a gap, the lightest body's is left out. If a
/// heavy body's were left out, the force on this body would be a small difference of large numbers.
fn coordinates(machine: &Oscillator) -> (DMatrix<f64>, Vec<usize>) {
    let (n, gaps) = (machine.degrees(), machine.gaps.len());
    let mass = |i: usize| machine.mass[(i, i)];
    let all: Vec<usize> = (0..gaps).collect();
    let left_out = machine.displacements_of_gaps(&all, |a, b| mass(a).total_cmp(&mass(b)).then(a.cmp(&b)));
    let mut rows: Vec<DVector<f64>> = machine.gaps.iter().map(|gap| gap.row.clone()).collect();
    rows.extend(
        (0..n)
            .filter(|j| left_out.iter().all(|(_, pivot)| pivot != j))
            .map(|j| DVector::from_fn(n, |i, _| f64::from(u8::from(i == j)))),
    );
    let leading = left_out.iter().map(|&(gap, _)| gap).chain(gaps..rows.len()).collect();
    (DMatrix::from_fn(rows.len(), n, |i, j| rows[i][j]), leading)
}
