//! A machine in the coordinates of its flow, with the domains that motions have met.

use std::collections::BTreeMap;
use std::sync::{Arc, RwLock};

use nalgebra::{DMatrix, DVector};

use super::domain::{Domain, DomainKey};
use super::modes::ROUNDING;
use super::{Numbers, Point, SIZE};
use crate::model::{Contact, MOST_HARMONICS, Oscillator, Side, Wall};

/// Linear forces in the coordinates of the flow.
#[derive(Clone, Debug)]
pub(super) struct StageForces {
    pub(super) stiffness: DMatrix<f64>,
    pub(super) damping: DMatrix<f64>,
    pub(super) load: DVector<f64>,
}

/// An element with dry friction: factors of `w` in the sliding rate, force and speed.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) row: DVector<f64>,
    pub(super) force: f64,
    pub(super) speed: f64,
}

/// Cosine and sine of each harmonic.
pub(super) type Phasors = [[f64; 2]; MOST_HARMONICS + 1];

/// A machine, prepared for its motions. Domains are shared by all motions.
#[derive(Clone, Debug)]
pub struct System {
    pub(super) machine: Oscillator,
    /// Number of coordinates.
    pub(super) n: usize,
    /// Forcing period.
    pub(super) period: f64,
    /// Scales of length and speed.
    pub(super) length: f64,
    pub(super) speed: f64,
    /// Displacement beyond which the motion has escaped.
    pub(super) escape: f64,
    /// `d = to_flow x`, and its inverse.
    to_flow: DMatrix<f64>,
    pub(super) from_flow: DMatrix<f64>,
    pub(super) mass: DMatrix<f64>,
    /// Inverse of the mass matrix, and the inverse of its Cholesky factor.
    pub(super) mobility: DMatrix<f64>,
    pub(super) mass_scale: DMatrix<f64>,
    pub(super) stages: Vec<StageForces>,
    /// Orders of the harmonics, and their cosines and sines as columns.
    pub(super) orders: Vec<f64>,
    pub(super) drives: Vec<[DVector<f64>; 2]>,
    pub(super) elements: Vec<Element>,
    /// Changes of the stage: time since phase 0, and stage.
    pub(super) schedule: Vec<(f64, usize)>,
    domains: Arc<RwLock<BTreeMap<u32, Arc<Domain>>>>,
}

impl System {
    /// Prepares a machine that [`Oscillator::validate`] accepts.
    pub fn new(machine: &Oscillator) -> System {
        let (machine, n) = (machine.clone(), machine.degrees());
        let to_flow = coordinates(&machine);
        let from_flow = to_flow.clone().try_inverse().expect("the rows are independent");
        let back = from_flow.transpose();
        let mobility = &to_flow * inverse(&machine.mass) * to_flow.transpose();
        let mobility = 0.5 * (&mobility + mobility.transpose());
        let mass = &back * &machine.mass * &from_flow;
        let mass = 0.5 * (&mass + mass.transpose());
        let factor = mass.clone().cholesky().expect("the mass matrix is positive definite").l();
        let mass_scale = factor.try_inverse().expect("the factor is regular");
        let stages: Vec<StageForces> = machine
            .stages
            .iter()
            .map(|forces| StageForces {
                stiffness: &back * &forces.stiffness * &from_flow,
                damping: &back * &forces.damping * &from_flow,
                load: &back * &forces.load,
            })
            .collect();
        let with_force = machine.friction.iter().filter(|friction| friction.force > 0.0);
        let elements = with_force
            .map(|friction| {
                let row = &back * &friction.row;
                // A row along a gap must not have rounding errors in other entries.
                let least = ROUNDING * row.amax();
                let row = row.map(|x| if x.abs() > least { x } else { 0.0 });
                Element { row, force: friction.force, speed: friction.speed }
            })
            .collect();
        let period = machine.period();
        let length = machine.length_scale();
        let mut system = System {
            n,
            period,
            length,
            speed: 0.0,
            escape: f64::INFINITY,
            orders: machine.drives.iter().map(|drive| f64::from(drive.order)).collect(),
            drives: machine.drives.iter().map(|drive| [&back * &drive.cos, &back * &drive.sin]).collect(),
            schedule: machine.schedule.iter().map(|&(turns, stage)| (turns * period, stage)).collect(),
            to_flow,
            from_flow,
            mass,
            mobility,
            mass_scale,
            stages,
            elements,
            domains: Arc::default(),
            machine,
        };
        let rates = system.stages.iter().map(|forces| system.rate(&forces.stiffness, &forces.damping));
        system.speed = length * rates.fold(0.0, f64::max);
        if system.can_grow() {
            system.escape = system.machine.escape();
        }
        system
    }

    /// Whether energy can grow without the force.
    fn can_grow(&self) -> bool {
        let is_negative = |matrix: &DMatrix<f64>| {
            let scaled = self.mass_scaled(&(0.5 * (matrix + matrix.transpose()))).symmetric_eigenvalues();
            scaled.min() < -1e-12 * scaled.amax()
        };
        self.stages.len() > 1
            || self.stages.iter().any(|forces| is_negative(&forces.stiffness) || is_negative(&forces.damping))
    }

    /// Transforms a matrix to coordinates with mass 1.
    fn mass_scaled(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        &self.mass_scale * matrix * self.mass_scale.transpose()
    }

    /// Returns a bound on all rates under given stiffness and damping: of the forcing, and of the mass-scaled system by its norm.
    pub(super) fn rate(&self, stiffness: &DMatrix<f64>, damping: &DMatrix<f64>) -> f64 {
        let norm = |matrix: DMatrix<f64>| matrix.singular_values().max();
        let own = norm(self.mass_scaled(damping)) + norm(self.mass_scaled(stiffness)).sqrt();
        own.max(self.machine.omega * f64::from(self.machine.highest_order()))
    }

    /// Returns the machine.
    pub fn machine(&self) -> &Oscillator {
        &self.machine
    }

    /// Returns the forcing period.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Returns the scales of length and speed, and the displacement beyond which the motion has escaped.
    pub(crate) fn units(&self) -> (f64, f64, f64) {
        (self.length, self.speed, self.escape)
    }

    pub(super) fn gaps(&self) -> usize {
        self.machine.gaps.len()
    }

    pub(super) fn walls(&self, gap: usize, side: Side) -> &[Wall] {
        &self.machine.gaps[gap].walls[side.index()]
    }

    /// Returns the number of walls of a side behind which motion continues.
    pub(super) fn passable(&self, gap: usize, side: Side) -> usize {
        let walls = self.walls(gap, side);
        walls.iter().filter(|wall| wall.contact.is_elastic()).count()
    }

    /// Returns the last wall of a side if it only pushes, and its force differs from that of a wall that may pull.
    pub(super) fn pushing(&self, gap: usize, side: Side) -> Option<&Wall> {
        let last = self.walls(gap, side).last()?;
        let differs = last.springs.iter().any(|spring| spring.damping != 0.0 || spring.preload != 0.0);
        (last.contact == Contact::Pushing && differs).then_some(last)
    }

    /// Returns the domain of a combination of modes, and builds it if it is the first time.
    pub(super) fn domain(&self, key: DomainKey) -> Arc<Domain> {
        if let Some(domain) = self.domains.read().expect("no builder panics").get(&key.code()) {
            return Arc::clone(domain);
        }
        let domain = Arc::new(Domain::new(self, key));
        self.domains.write().expect("no builder panics").entry(key.code()).or_insert(domain).clone()
    }

    /// Converts a state `(x1, v1, ...)` to `(d1 .. dn, w1 .. wn)`.
    pub(super) fn to_flow(&self, state: &[f64]) -> Numbers {
        let n = self.n;
        let mut y = [0.0; SIZE];
        for i in 0..n {
            for j in 0..n {
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
        for i in 0..n {
            for j in 0..n {
                state[2 * i] += self.from_flow[(i, j)] * y[j];
                state[2 * i + 1] += self.from_flow[(i, j)] * y[n + j];
            }
        }
        state
    }

    /// Returns displacements at which the gaps have given values. Further values are those of the displacements that complete the gaps to
    /// coordinates.
    pub fn displacements(&self, gaps_and_others: &[f64]) -> Vec<f64> {
        let d = DVector::from_fn(self.n, |i, _| gaps_and_others[i]);
        (&self.from_flow * d).iter().copied().collect()
    }

    /// Returns the number of entries of [`Point`] that are in use.
    pub(super) fn width(&self) -> usize {
        2 * self.n + 2 * self.orders.len() + 1
    }

    /// Returns cosine and sine of all harmonics at a time since phase 0.
    pub(super) fn phasors(&self, t: f64) -> Phasors {
        let mut phasors = [[0.0; 2]; MOST_HARMONICS + 1];
        for (phasor, order) in phasors.iter_mut().zip(&self.orders) {
            let (sin, cos) = (order * self.machine.omega * t).sin_cos();
            *phasor = [cos, sin];
        }
        phasors
    }

    /// Completes a state to a point.
    pub(super) fn point(&self, y: &[f64], phasors: &Phasors) -> Point {
        let mut point = [0.0; super::WIDTH];
        let states = 2 * self.n;
        point[..states].copy_from_slice(&y[..states]);
        let (phases, _) = point[states..].as_chunks_mut();
        phases.iter_mut().zip(phasors).take(self.orders.len()).for_each(|(phase, phasor)| *phase = *phasor);
        point[self.width() - 1] = 1.0;
        point
    }
}

/// Returns the inverse of a symmetric positive definite matrix.
fn inverse(mass: &DMatrix<f64>) -> DMatrix<f64> {
    let is_diagonal = mass.iter().enumerate().all(|(k, x)| *x == 0.0 || k % (mass.nrows() + 1) == 0);
    if is_diagonal {
        return DMatrix::from_diagonal(&mass.diagonal().map(f64::recip));
    }
    mass.clone().cholesky().expect("the mass matrix is positive definite").inverse()
}

/// Returns the rows of the flow's coordinates: the gaps, and displacements that complete them. Of displacements with equal factors in a gap,
/// the lightest is left out: a force on a heavy body that is left out would be computed as a small difference.
fn coordinates(machine: &Oscillator) -> DMatrix<f64> {
    let n = machine.degrees();
    let mass = |i: usize| machine.mass[(i, i)];
    let left_out = machine.displacements_of_gaps(|a, b| mass(a).total_cmp(&mass(b)).then(a.cmp(&b)));
    let mut rows: Vec<DVector<f64>> = machine.gaps.iter().map(|gap| gap.row.clone()).collect();
    rows.extend(
        (0..n)
            .filter(|j| !left_out.contains(j))
            .map(|j| DVector::from_fn(n, |i, _| f64::from(u8::from(i == j)))),
    );
    DMatrix::from_fn(n, n, |i, j| rows[i][j])
}
