//! Machines: piecewise-linear oscillators of up to eight coordinates, with several gaps and dry friction.
//!
//! ```text
//! M x'' + C x' + K x = load + sum over harmonics (cos_k cos(k omega t) + sin_k sin(k omega t)) + contact forces + friction forces
//! ```
//!
//! A gap is a row of displacements `z = row . x` with walls on one side or on both. The force of a contact acts along this row.

use std::cmp::Ordering;

use nalgebra::{DMatrix, DVector};

use super::oscillator::{
    ESCAPE, ESCAPE_WITHOUT_SCALE, MATRIX_TOLERANCE, check_phases, finite, positive,
    recurs_after_half_a_period, require, schedule_at, turn,
};
use super::{
    Contact, HIGHEST_ORDER, Law, MOST_CHANGES, MOST_FRICTION, MOST_STAGES, MOST_WALLS, Oscillator,
    OscillatorError, Side, State, state,
};

/// Largest number of coordinates.
pub const MOST_COORDINATES: usize = 8;

/// Largest number of gaps.
pub const MOST_GAPS: usize = 3;

/// Linear forces that act always, in one stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Forces {
    /// Damping matrix. Its skew-symmetric part, as of gyroscopic forces, does no work.
    pub damping: DMatrix<f64>,
    /// Stiffness matrix, symmetric.
    pub stiffness: DMatrix<f64>,
    /// Constant load.
    pub load: DVector<f64>,
}

/// One harmonic of the force: `cos cos(order omega t) + sin sin(order omega t)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Order, 1 to [`HIGHEST_ORDER`].
    pub order: u32,
    /// Factor of the cosine.
    pub cos: DVector<f64>,
    /// Factor of the sine.
    pub sin: DVector<f64>,
}

/// Spring, damper and preload behind a wall, in one stage.
///
/// Contact pushes the gap off its wall by `stiffness s (z - at) + damping s w + preload`, where `s` is +1 on the right and -1 on the left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spring {
    /// Stiffness, >= 0.
    pub stiffness: f64,
    /// Damping, >= 0.
    pub damping: f64,
    /// Force that begins at the wall. It is 0 where the law is [`Contact::Impact`].
    pub preload: f64,
}

/// Coefficient of restitution as a function of the approach speed: `constant + factor speed^power`, limited to `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Restitution {
    /// Value at zero speed, before it is limited.
    pub constant: f64,
    /// Factor of the power; 0 for a constant coefficient.
    pub factor: f64,
    /// Exponent of the speed, > 0.
    pub power: f64,
}

impl Restitution {
    /// Returns a coefficient that does not depend on the speed.
    pub fn constant(constant: f64) -> Restitution {
        Restitution { constant, factor: 0.0, power: 1.0 }
    }

    /// Returns the coefficient `e` and its derivative at an approach speed >= 0.
    pub fn at(&self, speed: f64) -> [f64; 2] {
        if self.factor == 0.0 {
            return [self.constant.clamp(0.0, 1.0), 0.0];
        }
        let value = self.constant + self.factor * speed.powf(self.power);
        let slope = self.factor * self.power * speed.powf(self.power - 1.0);
        if (0.0..=1.0).contains(&value) && slope.is_finite() {
            [value, slope]
        } else {
            [value.clamp(0.0, 1.0), 0.0]
        }
    }
}

/// A wall of a gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// Position `z`.
    pub at: f64,
    /// Contact law. All walls on a side but the outermost one are [`Contact::Elastic`].
    pub contact: Contact,
    /// Coefficient of restitution; of no effect where the law is elastic.
    pub restitution: Restitution,
    /// Leaving speed, >= 0, up to which a pressed contact lasts.
    pub mesh_speed: f64,
    /// Spring, damper and preload in each stage; of no effect on a rigid wall.
    pub springs: Vec<Spring>,
}

/// A gap and its walls.
#[derive(Clone, Debug, PartialEq)]
pub struct GapRow {
    /// Row of displacements; not zero, and independent of the rows of the other gaps.
    pub row: DVector<f64>,
    /// Walls on the right, at increasing positions, and on the left, at decreasing positions.
    pub walls: [Vec<Wall>; 2],
}

/// An element with dry friction along a row of velocities, as [`super::Friction`].
#[derive(Clone, Debug, PartialEq)]
pub struct DryFriction {
    /// Row of the sliding rate; not zero.
    pub row: DVector<f64>,
    /// Friction force, >= 0.
    pub force: f64,
    /// Speed of the other surface along the row.
    pub speed: f64,
}

/// A machine. All vectors have one entry per coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// Excitation frequency, > 0.
    pub omega: f64,
    /// Mass matrix, symmetric and positive definite.
    pub mass: DMatrix<f64>,
    /// Linear forces of each stage, at least one.
    pub stages: Vec<Forces>,
    /// Changes of the stage in a forcing period, as [`Oscillator::schedule`](super::Oscillator::schedule). Empty if stage 0 holds always.
    pub schedule: Vec<(f64, usize)>,
    /// Harmonics of the force, in increasing order.
    pub drives: Vec<Drive>,
    /// Gaps, up to [`MOST_GAPS`].
    pub gaps: Vec<GapRow>,
    /// Elements with dry friction, up to [`MOST_FRICTION`].
    pub friction: Vec<DryFriction>,
}

/// Lower bound of [`Machine::length_scale`], which must not be zero.
const LEAST_LENGTH: f64 = 1e-150;

/// Checks that all entries of a vector or matrix are finite.
fn all_finite<'a>(
    name: impl Fn() -> String,
    values: impl IntoIterator<Item = &'a f64>,
) -> Result<(), OscillatorError> {
    values.into_iter().try_for_each(|&value| finite(&name, value))
}

impl Machine {
    /// Returns an oscillator of at most two coordinates as a machine.
    pub fn of(oscillator: &Oscillator, law: Law) -> Machine {
        let o = oscillator;
        let n = o.degrees;
        let matrix = |m: [[f64; 2]; 2]| DMatrix::from_fn(n, n, |i, j| m[i][j]);
        let vector = |v: [f64; 2]| DVector::from_fn(n, |i, _| v[i]);
        let stages: Vec<_> = (0..o.stage_count()).map(|stage| o.in_stage(stage)).collect();
        let walls = |side: Side| {
            let i = side.index();
            let count = o.wall_count(side);
            let spring = |stage: &Oscillator, nth: usize| {
                // The spring of a wall belongs to the interval in front of it.
                let interval = if nth == 0 { stage.clone() } else { stage.behind(side, nth) };
                let [stiffness, damping] = interval.wall_stiffness_and_damping(side);
                let has_damper = interval.meshing[i].damping != interval.free.damping;
                Spring {
                    stiffness,
                    damping: if has_damper { damping } else { 0.0 },
                    preload: interval.preload(side),
                }
            };
            let wall = |nth: usize| {
                let (at, contact) = match nth {
                    0 => (o.walls[i], o.contacts[i]),
                    _ => (o.outer_walls[i][nth - 1].at, o.outer_walls[i][nth - 1].contact),
                };
                Wall {
                    at,
                    contact,
                    restitution: Restitution::constant(law.restitution[i]),
                    mesh_speed: law.mesh_speed[i],
                    springs: stages.iter().map(|stage| spring(stage, nth)).collect(),
                }
            };
            (0..count).map(wall).collect()
        };
        Machine {
            omega: o.omega,
            mass: matrix(o.mass),
            stages: stages
                .iter()
                .map(|stage| Forces {
                    damping: matrix(stage.free.damping),
                    stiffness: matrix(stage.free.stiffness),
                    load: vector(stage.free.load),
                })
                .collect(),
            schedule: o.schedule.clone(),
            drives: o
                .all_harmonics()
                .map(|harmonic| Drive {
                    order: harmonic.order,
                    cos: vector(harmonic.cos),
                    sin: vector(harmonic.sin),
                })
                .collect(),
            gaps: vec![GapRow { row: vector(o.gap), walls: Side::BOTH.map(walls) }],
            friction: o
                .friction
                .iter()
                .map(|friction| DryFriction {
                    row: vector(friction.row),
                    force: friction.force,
                    speed: friction.speed,
                })
                .collect(),
        }
    }

    /// Returns the number of coordinates.
    pub fn degrees(&self) -> usize {
        self.mass.nrows()
    }

    /// Returns the forcing period `2 pi / omega`.
    pub fn period(&self) -> f64 {
        std::f64::consts::TAU / self.omega
    }

    /// Returns the highest order of a harmonic; 1 without a force.
    pub fn highest_order(&self) -> u32 {
        self.drives.iter().map(|drive| drive.order).max().unwrap_or(1)
    }

    /// Returns the machine whose phase 0 is this phase of the forcing, in radians.
    pub fn at_phase(&self, phase: f64) -> Machine {
        if phase == 0.0 {
            return self.clone();
        }
        let first = turn(phase);
        let drive = |Drive { order, cos, sin }: &Drive| {
            let turn = first.powu(*order);
            Drive { order: *order, cos: cos * turn.re + sin * turn.im, sin: sin * turn.re - cos * turn.im }
        };
        let drives = self.drives.iter().map(drive).collect();
        Machine { drives, schedule: schedule_at(&self.schedule, phase), ..self.clone() }
    }

    /// Returns `row M^-1 row` for a gap, the change of its rate by a unit impulse along its row.
    pub fn mobility(&self, gap: usize) -> f64 {
        let row = &self.gaps[gap].row;
        self.mass.clone().cholesky().map_or(f64::NAN, |factors| row.dot(&factors.solve(row)))
    }

    /// Returns the impulses along the rows of all gaps that change the gaps' rates by given jumps; NaN if there are none.
    pub(crate) fn impulses(&self, jump: impl Fn(usize) -> f64) -> DVector<f64> {
        let count = self.gaps.len();
        let Some(mass) = self.mass.clone().cholesky() else { return DVector::from_element(count, f64::NAN) };
        let mobility =
            DMatrix::from_fn(count, count, |i, j| self.gaps[i].row.dot(&mass.solve(&self.gaps[j].row)));
        let jumps = DVector::from_fn(count, |gap, _| jump(gap));
        mobility.cholesky().map_or(DVector::from_element(count, f64::NAN), |factors| factors.solve(&jumps))
    }

    /// Returns the stage that holds at phase 0.
    pub fn first_stage(&self) -> usize {
        match self.schedule.first() {
            Some(&(0.0, stage)) => stage,
            _ => self.schedule.last().map_or(0, |&(_, stage)| stage),
        }
    }

    /// Chooses one displacement for each gap, by Gaussian elimination: the one with the largest remaining factor in the gap's row, and of equal
    /// ones the first by `order`.
    pub(crate) fn displacements_of_gaps(&self, order: impl Fn(usize, usize) -> Ordering) -> Vec<usize> {
        let mut rows: Vec<DVector<f64>> = self.gaps.iter().map(|gap| gap.row.clone()).collect();
        let mut chosen = Vec::new();
        for i in 0..rows.len() {
            let row = rows[i].clone();
            let others = (0..self.degrees()).filter(|j| !chosen.contains(j));
            let largest = others.min_by(|&a, &b| row[b].abs().total_cmp(&row[a].abs()).then(order(a, b)));
            let pivot = largest.expect("there are not more gaps than coordinates");
            for other in &mut rows[i + 1..] {
                let share = other[pivot] / row[pivot];
                *other -= &row * share;
            }
            chosen.push(pivot);
        }
        chosen
    }

    /// Moves each gap that is beyond a rigid wall onto this wall, and returns the state. For each gap, one displacement
    /// changes, which `displacements_of_gaps` chooses. All velocities stay.
    pub fn put_on_walls(&self, start: &[f64]) -> State {
        let limit = |gap: &GapRow, side: Side| match gap.walls[side.index()].last() {
            Some(wall) if wall.contact == Contact::Rigid => wall.at,
            _ => side.sign() * f64::INFINITY,
        };
        let moves = DVector::from_iterator(
            self.gaps.len(),
            self.gaps.iter().map(|gap| {
                let value = gap.row.iter().zip(start.iter().step_by(2)).map(|(a, x)| a * x).sum::<f64>();
                value.min(limit(gap, Side::Right)).max(limit(gap, Side::Left)) - value
            }),
        );
        let mut moved = state(start);
        if moves.iter().any(|&by| by != 0.0) {
            let pivots = self.displacements_of_gaps(|a, b| a.cmp(&b));
            let rows = DMatrix::from_fn(pivots.len(), pivots.len(), |i, k| self.gaps[i].row[pivots[k]]);
            let by = rows.lu().solve(&moves).expect("the rows of the gaps are independent");
            pivots.iter().zip(&by).for_each(|(pivot, by)| moved[2 * pivot] += by);
        }
        moved
    }

    /// Whether `(y, t) -> (-y, t + T/2)` maps motions to motions: the walls of each gap are mirror images with equal laws, the force has odd
    /// harmonics only, no surface moves, and the stages recur, mirrored, after half a period.
    pub fn mirror_symmetric(&self) -> bool {
        let pairs = || self.gaps.iter().flat_map(|gap| gap.walls[0].iter().zip(&gap.walls[1]));
        let is_alike = |(right, left): (&Wall, &Wall)| {
            right.at == -left.at
                && right.contact == left.contact
                && right.restitution == left.restitution
                && right.mesh_speed == left.mesh_speed
        };
        // `i` and `j` are stages half a period apart.
        let is_mirrored = |i: usize, j: usize| {
            let (a, b) = (&self.stages[i], &self.stages[j]);
            let springs = |(right, left): (&Wall, &Wall)| {
                right.contact == Contact::Rigid || right.springs[i] == left.springs[j]
            };
            a.damping == b.damping && a.stiffness == b.stiffness && a.load == -&b.load && pairs().all(springs)
        };
        self.gaps.iter().all(|gap| gap.walls[0].len() == gap.walls[1].len())
            && pairs().all(is_alike)
            && self.drives.iter().all(|drive| drive.order % 2 == 1)
            && self.friction.iter().all(|friction| friction.speed == 0.0)
            && recurs_after_half_a_period(&self.schedule, is_mirrored)
    }

    /// Checks all ranges.
    ///
    /// # Errors
    /// [`OscillatorError`] for the first quantity that is not valid.
    ///
    /// # Panics
    /// If the sizes of vectors and matrices differ.
    pub fn validate(&self) -> Result<(), OscillatorError> {
        let (n, stages) = (self.degrees(), self.stages.len());
        let count = |what: &'static str, count: usize, most: usize, range: &'static str| {
            require((1..=most).contains(&count), || what.to_owned(), count as f64, range)
        };
        count("coordinates", n, MOST_COORDINATES, "1 to 8")?;
        count("gaps", self.gaps.len(), MOST_GAPS.min(n), "1 to 3, and not more than coordinates")?;
        count("the number of stages", stages, MOST_STAGES, "1 to 8")?;
        let elements = self.friction.len();
        require(
            elements <= MOST_FRICTION.min(n),
            || "elements with dry friction".to_owned(),
            elements as f64,
            "at most 2, and not more than coordinates",
        )?;
        positive(|| "excitation frequency".to_owned(), self.omega)?;
        all_finite(|| "mass".to_owned(), &self.mass)?;
        symmetric("mass", &self.mass)?;
        if self.mass.clone().cholesky().is_none() {
            // The size is divided out, so that nothing overflows.
            let size = self.mass.amax().max(f64::MIN_POSITIVE);
            let least = size * (&self.mass / size).symmetric_eigenvalues().min();
            require(false, || "lowest eigenvalue of the mass matrix".to_owned(), least, POSITIVE)?;
        }
        let changes = self.schedule.len();
        let few = "at most 1024";
        require(changes <= MOST_CHANGES, || "changes of the stage".to_owned(), changes as f64, few)?;
        check_phases(&self.schedule)?;
        for &(_, stage) in &self.schedule {
            require(stage < stages, || "index of a stage".to_owned(), stage as f64, "that of a stage")?;
        }
        for (stage, forces) in (1..).zip(&self.stages) {
            let name = |what: &'static str| {
                move || if stages == 1 { what.to_owned() } else { format!("{what} in stage {stage}") }
            };
            all_finite(name("damping"), &forces.damping)?;
            all_finite(name("stiffness"), &forces.stiffness)?;
            all_finite(name("load"), &forces.load)?;
            symmetric("stiffness", &forces.stiffness)?;
        }
        for Drive { order, cos, sin } in &self.drives {
            let is_known = (1..=HIGHEST_ORDER).contains(order);
            require(is_known, || "order of a harmonic".to_owned(), f64::from(*order), "1 to 64")?;
            all_finite(|| format!("cosine of harmonic {order}"), cos)?;
            all_finite(|| format!("sine of harmonic {order}"), sin)?;
        }
        for (i, gap) in (1..).zip(&self.gaps) {
            all_finite(|| format!("row of gap {i}"), &gap.row)?;
            Side::BOTH.into_iter().try_for_each(|side| self.validate_walls(i, gap, side))?;
            if let [Some(right), Some(left)] = gap.walls.each_ref().map(|walls| walls.first())
                && (right.at < left.at
                    || right.at == left.at && !(right.contact.is_elastic() && left.contact.is_elastic()))
            {
                return Err(OscillatorError::Walls { walls: [right.at, left.at] });
            }
        }
        let rows = |rows: Vec<&DVector<f64>>, what: &'static str, range: &'static str| {
            (1..=rows.len()).try_for_each(|count| {
                let independent = self.independence(&rows[..count]).max(0.0);
                require(independent > MATRIX_TOLERANCE, || format!("{what} 1 to {count}"), independent, range)
            })
        };
        rows(
            self.gaps.iter().map(|gap| &gap.row).collect(),
            "independence of the rows of the gaps",
            "above 1e-12: no row may be 0 or a sum of multiples of the others, and all walls along one row belong to one gap",
        )?;
        for (i, DryFriction { row, force, speed }) in (1..).zip(&self.friction) {
            let name = |what: &'static str| move || format!("{what} of friction {i}");
            all_finite(name("row"), row)?;
            require(force.is_finite() && *force >= 0.0, name("force"), *force, "finite and at least 0")?;
            finite(name("speed"), *speed)?;
        }
        if elements > 0 {
            rows(
                self.friction.iter().map(|friction| &friction.row).collect(),
                "independence of the rows of friction",
                "above 1e-12: no row may be 0 or a multiple of the other; one element with the sum of both forces describes \
                 friction along equal rows",
            )?;
        }
        Ok(())
    }

    fn validate_walls(
        &self,
        gap: usize,
        GapRow { walls, .. }: &GapRow,
        side: Side,
    ) -> Result<(), OscillatorError> {
        let (walls, word) = (&walls[side.index()], ["right", "left"][side.index()]);
        let count = walls.len();
        let name = |nth: usize| format!("{word} wall {nth} of gap {gap}");
        require(
            count <= MOST_WALLS,
            || format!("walls on the {word} side of gap {gap}"),
            count as f64,
            "at most 4",
        )?;
        for (i, wall) in walls.iter().enumerate() {
            let quantity =
                |what: &'static str| move || format!("{what} of {word} wall {} of gap {gap}", i + 1);
            finite(quantity("position"), wall.at)?;
            if let Some(inner) = i.checked_sub(1).map(|i| &walls[i]) {
                let beyond = side.sign() * (wall.at - inner.at) > 0.0;
                require(beyond, quantity("position"), wall.at, "farther out than the wall before it")?;
                let elastic = "elastic, with a force that may pull, because another wall lies behind it";
                require(inner.contact == Contact::Elastic, || name(i), inner.at, elastic)?;
            }
            let Restitution { constant, factor, power } = wall.restitution;
            let allowed = factor != 0.0 && constant.is_finite() || (0.0..=1.0).contains(&constant);
            require(allowed, quantity("restitution"), constant, "between 0 and 1")?;
            finite(quantity("slope of restitution"), factor)?;
            require(power > 0.0, quantity("exponent of restitution"), power, POSITIVE)?;
            let speed = wall.mesh_speed;
            require(
                speed.is_finite() && speed >= 0.0,
                quantity("mesh_speed"),
                speed,
                "finite and at least 0",
            )?;
            for Spring { stiffness, damping, preload } in &wall.springs {
                for (what, value) in [("stiffness", *stiffness), ("damping", *damping)] {
                    require(
                        value.is_finite() && value >= 0.0,
                        quantity(what),
                        value,
                        "finite and at least 0",
                    )?;
                }
                finite(quantity("preload"), *preload)?;
            }
        }
        Ok(())
    }

    /// Returns a measure of the independence of rows: the least eigenvalue of the Gram matrix of the rows, each divided by its length.
    fn independence(&self, rows: &[&DVector<f64>]) -> f64 {
        let unit: Vec<DVector<f64>> = rows.iter().map(|row| (*row).clone().normalize()).collect();
        let gram = DMatrix::from_fn(rows.len(), rows.len(), |i, j| unit[i].dot(&unit[j]));
        if gram.iter().all(|x| x.is_finite()) { gram.symmetric_eigenvalues().min() } else { 0.0 }
    }

    /// Returns the scale, > 0, of tolerances on distances: half the smallest distance between a gap's first walls. Without a gap with two
    /// walls, it is the largest of the walls' positions and of the deflections `D f` under forces of order k, and under loads,
    /// preloads and friction (k = 1), with `D = (|K| + (k omega)^2 M)^-1`.
    pub fn length_scale(&self) -> f64 {
        let half = |gap: &GapRow| {
            let [right, left] = gap.walls.each_ref().map(|walls| walls.first());
            Some(0.5 * (right?.at - left?.at)).filter(|&half| half > 0.0)
        };
        self.gaps.iter().filter_map(half).min_by(f64::total_cmp).unwrap_or_else(|| self.largest_length())
    }

    /// Returns the displacement from which no motion is expected to return if energy can grow.
    pub(crate) fn escape(&self) -> f64 {
        // Walls may be near each other and far from rest, or much nearer than the motion of other coordinates.
        match self.length_scale().max(self.largest_length()) {
            LEAST_LENGTH => ESCAPE_WITHOUT_SCALE,
            length => ESCAPE * length,
        }
    }

    /// Returns the largest of the walls' positions and of the deflections by forces.
    fn largest_length(&self) -> f64 {
        let walls = self.gaps.iter().flat_map(|gap| gap.walls.iter().flatten()).map(|wall| wall.at.abs());
        self.deflections().into_iter().chain(walls).fold(LEAST_LENGTH, f64::max)
    }

    /// Returns the largest deflection by each force, in all stages.
    fn deflections(&self) -> Vec<f64> {
        let mut found = Vec::new();
        for Forces { stiffness, load, .. } in &self.stages {
            let eigen = stiffness.clone().symmetric_eigen();
            let size = &eigen.eigenvectors
                * DMatrix::from_diagonal(&eigen.eigenvalues.abs())
                * eigen.eigenvectors.transpose();
            let mut under = |force: DVector<f64>, order: u32| {
                let rate = self.omega * f64::from(order);
                let dynamic = &size + &self.mass * (rate * rate);
                found.extend(dynamic.cholesky().map(|factors| factors.solve(&force).amax()));
            };
            under(load.clone(), 1);
            self.drives.iter().for_each(|drive| {
                under(drive.cos.clone(), drive.order);
                under(drive.sin.clone(), drive.order);
            });
            self.friction.iter().for_each(|friction| under(&friction.row * friction.force, 1));
            for gap in &self.gaps {
                let springs = gap.walls.iter().flatten().flat_map(|wall| &wall.springs);
                springs
                    .filter(|spring| spring.preload != 0.0)
                    .for_each(|spring| under(&gap.row * spring.preload, 1));
            }
        }
        found
    }
}

const POSITIVE: &str = "greater than 0";

fn symmetric(name: &'static str, matrix: &DMatrix<f64>) -> Result<(), OscillatorError> {
    let size = matrix.amax();
    let difference = (matrix - matrix.transpose()).amax();
    let quantity = || format!("difference of opposite entries of {name}");
    require(difference <= MATRIX_TOLERANCE * size, quantity, difference, "0: the matrix must be symmetric")
}
