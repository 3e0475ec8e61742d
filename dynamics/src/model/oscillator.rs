//! The description of an oscillator: coordinates, gaps with walls, dry friction, stages and harmonics of the force.
//!
//! Models build it, and all code above the engines reads it. [`Pair::of`](super::Pair::of) decides which engine computes it.
//!
//! ```text
//! M x'' + C x' + K x = load + sum over harmonics (cos_k cos(k omega t) + sin_k sin(k omega t)) + contact forces + friction forces
//! ```
//!
//! A gap is a row of displacements `z = row . x` with walls on one side or on both. The force of a contact acts along this row.

use std::cmp::Ordering;
use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::error::{finite, positive, require};
use super::schedule::{
    MOST_CHANGES, MOST_STAGES, check_phases, recurs_after_half_a_period, schedule_at, turn,
};
use super::{Contact, Law, OscillatorError, Side, State, pair, state};

/// Highest order of a harmonic.
pub const HIGHEST_ORDER: u32 = 64;

/// Largest number of harmonics beside the first.
pub const MOST_HARMONICS: usize = 15;

/// Largest number of coordinates and harmonics together. It bounds the points of the general engine.
pub const MOST_COORDINATES_AND_HARMONICS: usize = 17;

/// Largest number of elements with dry friction.
pub const MOST_FRICTION: usize = 2;

/// Largest number of nonlinear springs.
pub const MOST_SPRINGS: usize = 8;

/// Largest number of pieces of a nonlinear spring, and of a friction force that depends on the sliding rate.
pub const MOST_PIECES: usize = 66;

/// Largest number of walls on a side.
pub const MOST_WALLS: usize = 4;

/// Displacement, in scales of length, from which no motion is expected to return if energy can grow.
pub(super) const ESCAPE: f64 = 1e6;

/// Displacement from which no motion is expected to return if there is no scale of length: no force, no load, and no wall except at 0.
pub(super) const ESCAPE_WITHOUT_SCALE: f64 = 1e100;

/// Rounding error that checks of a matrix allow, relative to its entries.
pub(super) const MATRIX_TOLERANCE: f64 = 1e-12;

/// Lower bound of [`Oscillator::length_scale`], which must not be zero.
pub(crate) const LEAST_LENGTH: f64 = 1e-150;

/// Largest distance of a gap from its wall that counts as rounding, relative to the wall's position and to the scale of length.
pub(crate) const ON_WALL: f64 = 1e-9;

/// Largest number of coordinates.
pub const MOST_COORDINATES: usize = 8;

/// Largest number of gaps.
pub const MOST_GAPS: usize = 6;

/// Largest number of signals.
pub const MOST_SIGNALS: usize = 4;

/// Linear forces that act always, in one stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Forces {
    /// Damping matrix. Its skew-symmetric part describes gyroscopic forces, which do no work.
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
    /// Constant force behind the wall, of a model that states one, even if it is 0. It is 0 where the law is [`Contact::Impact`].
    pub preload: Option<f64>,
}

impl Spring {
    /// Returns the contact force of a gap at rest on the wall: the preload, or 0 without one.
    pub fn force_at_wall(&self) -> f64 {
        self.preload.unwrap_or(0.0)
    }
}

/// Coefficient of restitution, limited to `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Restitution {
    /// It does not depend on the approach speed.
    Constant(f64),
    /// A function of the approach speed: `constant + factor speed^power`.
    BySpeed {
        /// Value at zero speed, before it is limited.
        constant: f64,
        /// Factor of the power.
        factor: f64,
        /// Exponent of the speed, > 0.
        power: f64,
    },
}

impl Restitution {
    /// Returns constant, factor and exponent; factor 0 and exponent 1 of a constant.
    pub fn terms(&self) -> [f64; 3] {
        match *self {
            Restitution::Constant(constant) => [constant, 0.0, 1.0],
            Restitution::BySpeed { constant, factor, power } => [constant, factor, power],
        }
    }

    /// Returns the coefficient `e` and its derivative at an approach speed >= 0.
    pub fn at(&self, speed: f64) -> [f64; 2] {
        match *self {
            Restitution::BySpeed { constant, factor, power } if factor != 0.0 => {
                by_speed([constant, factor, power], speed)
            }
            Restitution::Constant(constant) | Restitution::BySpeed { constant, .. } => {
                [constant.clamp(0.0, 1.0), 0.0]
            }
        }
    }
}

/// Returns a coefficient of restitution and its derivative. It is a function of its own, because the compiler would compute the powers for
/// constants, too.
#[inline(never)]
fn by_speed([constant, factor, power]: [f64; 3], speed: f64) -> [f64; 2] {
    let value = constant + factor * speed.powf(power);
    let slope = factor * power * speed.powf(power - 1.0);
    if (0.0..=1.0).contains(&value) && slope.is_finite() {
        [value, slope]
    } else {
        [value.clamp(0.0, 1.0), 0.0]
    }
}

/// A wall of a gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// Position `z`.
    pub at: f64,
    /// Contact law. All walls on a side but the outermost one are [`Contact::Elastic`].
    pub contact: Contact,
    /// Coefficient of restitution; ignored by elastic walls.
    pub restitution: Restitution,
    /// Leaving speed, >= 0, up to which a pressed contact lasts.
    pub mesh_speed: f64,
    /// Spring, damper and preload in each stage; ignored by a rigid wall.
    pub springs: Vec<Spring>,
}

impl Wall {
    /// Returns the energy that spring and preload hold in a stage, for a gap `z` behind the wall.
    pub(crate) fn stored(&self, stage: usize, side: Side, z: f64) -> f64 {
        let (spring, depth) = (self.springs[stage], z - self.at);
        0.5 * spring.stiffness * depth * depth + spring.force_at_wall() * side.sign() * depth
    }
}

/// A gap and its walls.
#[derive(Clone, Debug, PartialEq)]
pub struct GapRow {
    /// Row of displacements; not zero. It may depend on the rows of other gaps, such as `x2 - x1` on `x1` and `x2`.
    pub row: DVector<f64>,
    /// Walls on the right, at increasing positions, and on the left, at decreasing positions.
    pub walls: [Vec<Wall>; 2],
}

/// An element with dry friction along a row of velocities, by Coulomb's law.
///
/// With the sliding rate `rate = row . v - speed`, the oscillator is subject to the generalised force `-row F`, where `F = force(|rate|)` for
/// `rate > 0`, `F = -force(|rate|)` for `rate < 0`, and `|F| <= static_force` while the surfaces stick at `rate = 0`.
#[derive(Clone, Debug, PartialEq)]
pub struct DryFriction {
    /// Row of the sliding rate; not zero.
    pub row: DVector<f64>,
    /// Friction force just after sliding begins, >= 0.
    pub force: f64,
    /// Further points of the friction force, at most [`MOST_PIECES`]` - 1`: sliding rates, positive and increasing, and forces, >= 0. The
    /// force is linear between the points and constant beyond the last one.
    pub at_speed: Vec<[f64; 2]>,
    /// Largest force while the surfaces stick, at least `force`.
    pub static_force: f64,
    /// Speed of the other surface along the row, for example of a moving belt.
    pub speed: f64,
}

impl DryFriction {
    /// Returns friction by Coulomb's law: the same force at all sliding rates and at rest.
    pub fn new(row: DVector<f64>, force: f64, speed: f64) -> DryFriction {
        DryFriction { row, force, at_speed: Vec::new(), static_force: force, speed }
    }

    /// Whether the force is the same at all sliding rates and at rest.
    pub fn is_constant(&self) -> bool {
        self.at_speed.is_empty() && self.static_force == self.force
    }

    /// Returns the largest force at any sliding rate.
    pub fn largest_force(&self) -> f64 {
        self.at_speed.iter().fold(self.static_force, |most, point| most.max(point[1]))
    }

    /// Whether the friction ever has a force.
    pub fn acts(&self) -> bool {
        self.largest_force() > 0.0
    }

    /// Returns the force as a function of the modulus of the sliding rate.
    pub fn curve(&self) -> Curve {
        let last = self.at_speed.last().map_or(self.force, |point| point[1]);
        Curve::new([0.0, self.force], &self.at_speed, [0.0, last])
    }
}

/// A nonlinear spring along a row of displacements: the oscillator is subject to the generalised force `-row force(row . x)`. The force is
/// linear between the points. Beyond them the first and the last piece go on, and the status is `out_of_range`.
#[derive(Clone, Debug, PartialEq)]
pub struct NonlinearSpring {
    /// Row of the elongation; not zero.
    pub row: DVector<f64>,
    /// Elongations, increasing, and forces; 2 to [`MOST_PIECES`]` - 1` points.
    pub points: Vec<[f64; 2]>,
    /// The gap and side whose last wall the spring belongs to: it acts only while this wall does, from the first point on.
    pub wall: Option<(usize, Side)>,
}

impl NonlinearSpring {
    /// Whether the opposite elongation has the opposite force.
    pub fn is_odd(&self) -> bool {
        let opposite = |(a, b): (&[f64; 2], &[f64; 2])| a[0] == -b[0] && a[1] == -b[1];
        self.points.iter().zip(self.points.iter().rev()).all(opposite)
    }

    /// Whether the force is negative somewhere from the first point on.
    pub fn may_pull(&self) -> bool {
        self.curve().pieces.last().is_some_and(|piece| piece[0] < 0.0)
            || self.points.iter().any(|point| point[1] < 0.0)
    }

    /// Returns the force as a function of the elongation. Its last border is the end of the range, and its first one, without a wall.
    pub fn curve(&self) -> Curve {
        let slope = |[a, b]: [[f64; 2]; 2]| (b[1] - a[1]) / (b[0] - a[0]);
        let (first, last) = (self.points[0], self.points[self.points.len() - 1]);
        let [below, above] =
            [slope([first, self.points[1]]), slope([self.points[self.points.len() - 2], last])];
        let mut curve = Curve::new(first, &self.points[1..], [above, last[1] - above * last[0]]);
        if self.wall.is_none() {
            curve.borders.insert(0, first[0]);
            curve.pieces.insert(0, [below, first[1] - below * first[0]]);
        }
        curve
    }
}

/// A continuous, piecewise linear function.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Arguments at which a piece ends and the next one begins, increasing.
    pub borders: Vec<f64>,
    /// For each piece, the slope and the value that its line has at the argument 0.
    pub pieces: Vec<[f64; 2]>,
}

impl Curve {
    /// Returns the function through a first point and further points, with the line `last` beyond them.
    fn new(first: [f64; 2], further: &[[f64; 2]], last: [f64; 2]) -> Curve {
        let mut before = first;
        let piece = |&[at, value]: &[f64; 2]| {
            let ([from, start], slope) = (before, (value - before[1]) / (at - before[0]));
            before = [at, value];
            // Exact where `from` is 0: friction must not fall by a rounding error when sliding begins.
            [slope, start - slope * from]
        };
        let pieces = further.iter().map(piece).chain([last]).collect();
        Curve { borders: further.iter().map(|point| point[0]).collect(), pieces }
    }

    /// Returns the number of the piece at an argument.
    pub fn piece(&self, argument: f64) -> usize {
        self.borders.iter().filter(|border| **border < argument).count()
    }

    /// Returns the integral from one argument to another.
    pub fn integral(&self, from: f64, to: f64) -> f64 {
        let between = self.borders.iter().copied().filter(|border| (from..to).contains(border));
        let ends: Vec<f64> = [from].into_iter().chain(between).chain([to]).collect();
        ends.windows(2).map(|ends| (ends[1] - ends[0]) * self.at(0.5 * (ends[0] + ends[1]))).sum()
    }

    /// Returns the value at an argument.
    pub fn at(&self, argument: f64) -> f64 {
        let [slope, value] = self.pieces[self.piece(argument)];
        value + slope * argument
    }
}

/// A linear function of the motion that is measured, such as the acceleration of a seat on a moving support:
/// `displacement . x + velocity . x' + acceleration . x'' + constant + cos cos(omega t) + sin sin(omega t)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Factors of the displacements.
    pub displacement: DVector<f64>,
    /// Factors of the velocities.
    pub velocity: DVector<f64>,
    /// Factors of the accelerations.
    pub acceleration: DVector<f64>,
    /// Constant part.
    pub constant: f64,
    /// Factors of the cosine and the sine of the forcing phase. If one is not 0, the force needs a first harmonic, which may be 0.
    pub waves: [f64; 2],
}

/// What the period `2 pi / omega` is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timing {
    /// The period of the force, or of the stages.
    Forced,
    /// A unit of time in which budgets count: no parameter can give the model a force, harmonics or stages.
    Free,
    /// The time of a cycle without force. Phase 0 may lie anywhere on the cycle.
    Cycle,
}

impl Timing {
    /// Returns the names of one period and of several.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            Timing::Forced => ["forcing period", "forcing periods"],
            Timing::Free => ["clock period", "clock periods"],
            Timing::Cycle => ["cycle", "cycles"],
        }
    }
}

/// A forced piecewise-linear oscillator. All vectors have one entry per coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Oscillator {
    /// Excitation frequency, > 0.
    pub omega: f64,
    /// Mass matrix, symmetric and positive definite.
    pub mass: DMatrix<f64>,
    /// Linear forces of each stage, at least one.
    pub stages: Vec<Forces>,
    /// Changes of the stage in a forcing period: the phase in turns, in `[0, 1)` and increasing, and the stage that begins there. The last
    /// stage lasts until the first change. Empty if there is only stage 0.
    pub schedule: Vec<(f64, usize)>,
    /// Harmonics of the force, in increasing order, up to [`MOST_HARMONICS`] beside the first.
    pub drives: Vec<Drive>,
    /// Gaps, up to [`MOST_GAPS`].
    pub gaps: Vec<GapRow>,
    /// Elements with dry friction, up to [`MOST_FRICTION`].
    pub friction: Vec<DryFriction>,
    /// Nonlinear springs, up to [`MOST_SPRINGS`].
    pub springs: Vec<NonlinearSpring>,
    /// Signals, up to [`MOST_SIGNALS`].
    pub signals: Vec<Signal>,
    /// What `omega` means.
    pub timing: Timing,
}

/// Checks that all entries of a vector or matrix are finite.
fn all_finite<'a>(
    name: impl Fn() -> String,
    values: impl IntoIterator<Item = &'a f64>,
) -> Result<(), OscillatorError> {
    values.into_iter().try_for_each(|&value| finite(&name, value))
}

impl Oscillator {
    /// Returns the number of coordinates.
    pub fn degrees(&self) -> usize {
        self.mass.nrows()
    }

    /// Returns the reason why the oscillator needs the general engine, or none if it is a [`Pair`](super::Pair). The reason does not depend
    /// on values.
    pub fn needs_machine(&self) -> Option<&'static str> {
        let has_wall =
            |what: fn(&Wall) -> bool| self.gaps.iter().flat_map(|gap| gap.walls.iter().flatten()).any(what);
        [
            (self.degrees() > 2, "more than two coordinates"),
            (self.gaps.len() > 1, "several gaps"),
            (!self.friction.is_empty(), "dry friction"),
            (!self.springs.is_empty(), "nonlinear springs"),
            (!self.signals.is_empty(), "signals"),
            (self.timing != Timing::Forced, "no force, harmonics or stages"),
            (
                has_wall(|wall| matches!(wall.restitution, Restitution::BySpeed { .. })),
                "restitution that depends on the approach speed",
            ),
            (
                self.gaps.iter().flat_map(|gap| &gap.walls).any(|walls| walls.len() > 1),
                "several walls on a side",
            ),
            (has_wall(|wall| wall.contact == Contact::Pushing), "walls that only push"),
            (has_wall(|wall| wall.springs.iter().any(|spring| spring.preload.is_some())), "preloads"),
        ]
        .into_iter()
        .find_map(|(is_so, what)| is_so.then_some(what))
    }

    /// Whether the start state determines the contact of the first gap. A machine decides the contact of a gap at rest only when it begins
    /// to move.
    pub fn tells_contact_at_start(&self) -> bool {
        self.needs_machine().is_none()
    }

    /// Returns the law of the outermost walls of the first gap. Restitution that depends on the speed is evaluated at speed 0.
    pub fn law(&self) -> Law {
        let mut law = Law::both(0.0, 0.0);
        for (i, walls) in self.gaps[0].walls.iter().enumerate() {
            if let Some(wall) = walls.last().filter(|wall| !wall.contact.is_elastic()) {
                law.restitution[i] = wall.restitution.at(0.0)[0];
                law.mesh_speed[i] = wall.mesh_speed;
            }
        }
        law
    }

    /// Returns the forcing period `2 pi / omega`.
    pub fn period(&self) -> f64 {
        TAU / self.omega
    }

    /// Returns the oscillator without force whose period is the time of a cycle, or the same oscillator without a time.
    pub fn on_cycle(self, time: Option<f64>) -> Oscillator {
        match time {
            Some(time) => Oscillator { omega: TAU / time, timing: Timing::Cycle, ..self },
            None => self,
        }
    }

    /// Whether the springs of each gap's walls are alike on both sides.
    fn has_odd_wall_springs(&self) -> bool {
        let of = |gap: usize, side: Side| {
            self.springs.iter().find(move |spring| spring.wall == Some((gap, side))).map(|one| &one.points)
        };
        (0..self.gaps.len()).all(|gap| of(gap, Side::Right) == of(gap, Side::Left))
    }

    /// Returns the stiffness in a stage, with that of nonlinear springs at rest.
    pub(crate) fn stiffness_at_rest(&self, stage: usize) -> DMatrix<f64> {
        let free = self.springs.iter().filter(|spring| spring.wall.is_none());
        free.fold(self.stages[stage].stiffness.clone(), |sum, spring| {
            let curve = spring.curve();
            sum + &spring.row * spring.row.transpose() * curve.pieces[curve.piece(0.0)][0]
        })
    }

    /// Returns the lowest frequency of undamped free motion in the first stage, without rigid-body modes; none if no stiffness acts.
    pub fn slowest_natural_frequency(&self) -> Option<f64> {
        let root = self.mass.clone().cholesky()?.l().try_inverse()?;
        let squares = (&root * self.stiffness_at_rest(0) * root.transpose()).symmetric_eigenvalues();
        let least = MATRIX_TOLERANCE * squares.amax();
        squares.iter().filter(|&&square| square > least).map(|square| square.sqrt()).reduce(f64::min)
    }

    /// Returns the highest order of a harmonic; 1 without a force.
    pub fn highest_order(&self) -> u32 {
        self.drives.iter().map(|drive| drive.order).max().unwrap_or(1)
    }

    /// Returns the machine whose phase 0 is this phase of the forcing, in radians.
    pub fn at_phase(&self, phase: f64) -> Oscillator {
        if phase == 0.0 {
            return self.clone();
        }
        let first = turn(phase);
        let drive = |Drive { order, cos, sin }: &Drive| {
            let turn = first.powu(*order);
            Drive { order: *order, cos: cos * turn.re + sin * turn.im, sin: sin * turn.re - cos * turn.im }
        };
        let signal = |signal: &Signal| {
            let [cos, sin] = signal.waves;
            let waves = [cos * first.re + sin * first.im, sin * first.re - cos * first.im];
            Signal { waves, ..signal.clone() }
        };
        Oscillator {
            drives: self.drives.iter().map(drive).collect(),
            signals: self.signals.iter().map(signal).collect(),
            schedule: schedule_at(&self.schedule, phase),
            ..self.clone()
        }
    }

    /// Returns the [`schedule`](Self::schedule) of stages that begin at these phases, in order, and recur `repeat` times in a forcing
    /// period.
    ///
    /// # Errors
    /// [`OscillatorError::OutOfRange`] for the first phase that is not in `[0, 1)`, or not above the one before it.
    pub fn repeated(phases: &[f64], repeat: u32) -> Result<Vec<(f64, usize)>, OscillatorError> {
        let once: Vec<(f64, usize)> = phases.iter().copied().zip(0..).collect();
        check_phases(&once)?;
        let nth = |i: u32| {
            let later =
                move |&(phase, stage): &(f64, usize)| ((phase + f64::from(i)) / f64::from(repeat), stage);
            once.iter().map(later)
        };
        Ok((0..repeat).flat_map(nth).collect())
    }

    /// Returns the row of a gap, one entry for each coordinate; entries without a coordinate are 0.
    pub fn gap_row(&self, gap: usize) -> [f64; MOST_COORDINATES] {
        let mut row = [0.0; MOST_COORDINATES];
        self.gaps[gap].row.iter().zip(&mut row).for_each(|(x, entry)| *entry = *x);
        row
    }

    /// Returns a gap in a state if `velocity` is 0, and its rate if `velocity` is 1.
    pub fn gap_value(&self, gap: usize, state: &State, velocity: usize) -> f64 {
        let terms = self.gaps[gap].row.iter().enumerate();
        terms.map(|(i, factor)| factor * state[2 * i + velocity]).sum()
    }

    /// Returns the impulse `p` of a wall on a gap in an event, from the states before and after. `M (v+ - v-)` is the sum of `p g` over all
    /// gaps, because walls on which other gaps rest also push.
    pub fn gap_impulse(&self, gap: usize, [before, after]: [&State; 2]) -> f64 {
        let jump = |gap: usize| self.gap_value(gap, after, 1) - self.gap_value(gap, before, 1);
        if self.gaps.len() == 1 {
            return jump(0) / self.mobility(0);
        }
        let all: Vec<usize> = (0..self.gaps.len()).collect();
        if self.independent_gaps(&all).len() == all.len() {
            return self.impulses(&all, jump)[gap];
        }
        // The jumps do not determine the impulses of dependent gaps, but only walls on which gaps lie push.
        let length = self.length_scale();
        let lies = |&other: &usize| {
            let z = self.gap_value(other, before, 0);
            let near = |wall: &Wall| (z - wall.at).abs() <= ON_WALL * wall.at.abs().max(length);
            other != gap && self.gaps[other].walls.iter().flatten().any(near)
        };
        let pushing: Vec<usize> = [gap].into_iter().chain(all.into_iter().filter(lies)).collect();
        self.impulses(&self.independent_gaps(&pushing), jump)[0]
    }

    /// Returns `row M^-1 row` for a gap, the change of its rate by a unit impulse along its row.
    pub fn mobility(&self, gap: usize) -> f64 {
        let row = &self.gaps[gap].row;
        if self.degrees() <= 2 {
            return pair::mobility(pair::mass(&self.mass), pair::vector(row));
        }
        self.mass.clone().cholesky().map_or(f64::NAN, |factors| row.dot(&factors.solve(row)))
    }

    /// Returns the impulses along the rows of independent gaps that change the gaps' rates by given jumps; NaN if there are none.
    fn impulses(&self, gaps: &[usize], jump: impl Fn(usize) -> f64) -> DVector<f64> {
        let count = gaps.len();
        let Some(mass) = self.mass.clone().cholesky() else { return DVector::from_element(count, f64::NAN) };
        let row = |i: usize| &self.gaps[gaps[i]].row;
        let mobility = DMatrix::from_fn(count, count, |i, j| row(i).dot(&mass.solve(row(j))));
        let jumps = DVector::from_fn(count, |i, _| jump(gaps[i]));
        mobility.cholesky().map_or(DVector::from_element(count, f64::NAN), |factors| factors.solve(&jumps))
    }

    /// Returns the stage at phase 0: the stage that begins there, or else the last stage of the schedule.
    pub fn first_stage(&self) -> usize {
        match self.schedule.first() {
            Some(&(0.0, stage)) => stage,
            _ => self.schedule.last().map_or(0, |&(_, stage)| stage),
        }
    }

    /// Chooses one displacement for each gap, by Gaussian elimination: the one with the largest remaining factor in the gap's row, and
    /// among equal factors the first by `order`. Leaves out gaps whose rows depend on those before them. Returns gaps and displacements.
    pub(crate) fn displacements_of_gaps(
        &self,
        gaps: &[usize],
        order: impl Fn(usize, usize) -> Ordering,
    ) -> Vec<(usize, usize)> {
        let mut rows: Vec<DVector<f64>> = gaps.iter().map(|&gap| self.gaps[gap].row.clone()).collect();
        let mut chosen: Vec<(usize, usize)> = Vec::new();
        for (i, &gap) in gaps.iter().enumerate() {
            let row = rows[i].clone();
            let others = (0..self.degrees()).filter(|j| chosen.iter().all(|&(_, pivot)| pivot != *j));
            let largest = others.min_by(|&a, &b| row[b].abs().total_cmp(&row[a].abs()).then(order(a, b)));
            let least = MATRIX_TOLERANCE * self.gaps[gap].row.amax();
            let Some(pivot) = largest.filter(|&j| row[j].abs() > least) else { continue };
            for other in &mut rows[i + 1..] {
                let share = other[pivot] / row[pivot];
                *other -= &row * share;
            }
            chosen.push((gap, pivot));
        }
        chosen
    }

    /// Returns those of the gaps, in their order, whose rows do not depend on the rows before them.
    pub(crate) fn independent_gaps(&self, gaps: &[usize]) -> Vec<usize> {
        self.displacements_of_gaps(gaps, |a, b| a.cmp(&b)).into_iter().map(|(gap, _)| gap).collect()
    }

    /// Returns the gaps whose rows do not depend on the rows of earlier gaps.
    pub fn leading_gaps(&self) -> Vec<usize> {
        self.independent_gaps(&(0..self.gaps.len()).collect::<Vec<_>>())
    }

    /// Moves each gap that is beyond a rigid wall onto this wall, and returns the state. For each gap, one displacement
    /// changes, which `displacements_of_gaps` chooses. Gaps that depend on moved gaps change, too, and are moved next if they are then
    /// beyond a wall. All velocities stay.
    pub fn put_on_walls(&self, start: &[f64]) -> State {
        let limit = |gap: &GapRow, side: Side| match gap.walls[side.index()].last() {
            Some(wall) if wall.contact == Contact::Rigid => wall.at,
            _ => side.sign() * f64::INFINITY,
        };
        let (mut moved, mut order): (State, Vec<usize>) = (state(start), (0..self.gaps.len()).collect());
        let (dependent, mut placed) = (order.len() - self.independent_gaps(&order).len(), Vec::new());
        for _ in 0..=dependent {
            let move_of = |gap: &GapRow| {
                let value = gap.row.iter().zip(moved.iter().step_by(2)).map(|(a, x)| a * x).sum::<f64>();
                value.min(limit(gap, Side::Right)).max(limit(gap, Side::Left)) - value
            };
            let moves: Vec<f64> = self.gaps.iter().map(move_of).collect();
            let beyond = |&gap: &usize| moves[gap] != 0.0 && !placed.contains(&gap);
            let beyond: Vec<usize> = (0..self.gaps.len()).filter(beyond).collect();
            if beyond.is_empty() {
                break;
            }
            placed.extend(beyond);
            if dependent > 0 {
                order.sort_by_key(|gap| placed.iter().position(|other| other == gap).unwrap_or(usize::MAX));
            }
            let pivots = self.displacements_of_gaps(&order, |a, b| a.cmp(&b));
            let count = pivots.len();
            let rows = DMatrix::from_fn(count, count, |i, k| self.gaps[pivots[i].0].row[pivots[k].1]);
            let by = DVector::from_fn(count, |i, _| moves[pivots[i].0]);
            let by = rows.lu().solve(&by).expect("the rows are independent");
            pivots.iter().zip(&by).for_each(|((_, pivot), by)| moved[2 * pivot] += by);
        }
        moved
    }

    /// Whether `(y, t) -> (-y, t + T/2)` maps motions to motions: the walls of each gap are mirror images with equal laws, the force has odd
    /// harmonics only, no surface moves, no signal has a constant part, and the stages recur, mirrored, after half a period.
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
            && self.springs.iter().all(|spring| spring.wall.is_some() || spring.is_odd())
            && self.has_odd_wall_springs()
            && self.signals.iter().all(|signal| signal.constant == 0.0)
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
        count("gaps", self.gaps.len(), MOST_GAPS, "1 to 6")?;
        count("the number of stages", stages, MOST_STAGES, "1 to 64")?;
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
        if n == 1 {
            positive(|| "mass".to_owned(), self.mass[(0, 0)])?;
        }
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
        let count = self.drives.len();
        let most = (MOST_HARMONICS + 1).min(MOST_COORDINATES_AND_HARMONICS - n);
        let few = "at most 16 with the first, and at most 17 together with the number of coordinates";
        require(count <= most, || "harmonics".to_owned(), count as f64, few)?;
        for pair in self.drives.windows(2) {
            let (order, increasing) = (f64::from(pair[1].order), "above those before it");
            require(pair[0].order < pair[1].order, || "order of a harmonic".to_owned(), order, increasing)?;
        }
        for Drive { order, cos, sin } in &self.drives {
            let is_known = (1..=HIGHEST_ORDER).contains(order);
            require(is_known, || "order of a harmonic".to_owned(), f64::from(*order), "1 to 64")?;
            all_finite(|| format!("cosine of harmonic {order}"), cos)?;
            all_finite(|| format!("sine of harmonic {order}"), sin)?;
        }
        let count = self.signals.len();
        require(count <= MOST_SIGNALS, || "the number of signals".to_owned(), count as f64, "at most 4")?;
        let has_first = self.drives.first().is_some_and(|drive| drive.order == 1);
        for (i, signal) in (1..).zip(&self.signals) {
            let rows = [&signal.displacement, &signal.velocity, &signal.acceleration];
            let rows = rows.into_iter().flat_map(DVector::iter);
            let all = rows.chain(&signal.waves).chain([&signal.constant]);
            all_finite(|| format!("entry of signal {i}"), all)?;
            let needs_first = signal.waves != [0.0; 2];
            let range = "that of a signal without cosine and sine, unless the force has a first harmonic";
            require(!needs_first || has_first, || format!("cosine of signal {i}"), signal.waves[0], range)?;
        }
        for (i, gap) in self.gaps.iter().enumerate() {
            let of_gap = match self.gaps.len() {
                1 => String::new(),
                _ => format!(" of gap {}", i + 1),
            };
            all_finite(|| format!("row of gap {}", i + 1), &gap.row)?;
            let largest = gap.row.amax();
            let name = || format!("the largest entry of the gap row{of_gap}");
            require(largest > 0.0, name, largest, "different from 0")?;
            Side::BOTH.into_iter().try_for_each(|side| self.validate_walls(&of_gap, gap, side))?;
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
        let leading = self.leading_gaps();
        let numbers = n + self.gaps.len() - leading.len();
        require(
            numbers <= MOST_COORDINATES,
            || "coordinates and gaps whose rows depend on those of other gaps".to_owned(),
            numbers as f64,
            "at most 8 together",
        )?;
        rows(
            leading.iter().map(|&gap| &self.gaps[gap].row).collect(),
            "independence of the rows of the gaps",
            "above 1e-12, or else exactly a sum of multiples of the rows before it",
        )?;
        for (i, DryFriction { row, force, at_speed, static_force, speed }) in (1..).zip(&self.friction) {
            let name = |what: &'static str| move || format!("{what} of friction {i}");
            all_finite(name("row"), row)?;
            let forces = [*force].into_iter().chain(at_speed.iter().map(|point| point[1]));
            for force in forces {
                require(force.is_finite() && force >= 0.0, name("force"), force, "finite and at least 0")?;
            }
            let range = "finite and at least the force while sliding begins";
            require(static_force.is_finite() && static_force >= force, name("static"), *static_force, range)?;
            increasing(name("sliding rate"), [0.0].into_iter().chain(at_speed.iter().map(|point| point[0])))?;
            finite(name("speed"), *speed)?;
        }
        let springs = self.springs.len();
        let most = "at most 8, with those of walls";
        require(springs <= MOST_SPRINGS, || "nonlinear springs".to_owned(), springs as f64, most)?;
        for (i, NonlinearSpring { row, points, .. }) in (1..).zip(&self.springs) {
            let name = |what: &'static str| move || format!("{what} of nonlinear spring {i}");
            all_finite(name("row"), row)?;
            require(row.amax() > 0.0, name("row"), 0.0, "not 0")?;
            all_finite(name("force"), points.iter().map(|point| &point[1]))?;
            increasing(name("elongation"), points.iter().map(|point| point[0]))?;
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
        of_gap: &str,
        GapRow { row, walls }: &GapRow,
        side: Side,
    ) -> Result<(), OscillatorError> {
        let (walls, word) = (&walls[side.index()], ["right", "left"][side.index()]);
        let count = walls.len();
        let name = |nth: usize| format!("{word} wall {nth}{of_gap}");
        require(
            count <= MOST_WALLS,
            || format!("walls on the {word} side{of_gap}"),
            count as f64,
            "at most 4",
        )?;
        for (i, wall) in walls.iter().enumerate() {
            let quantity = |what: &'static str| move || format!("{what} of {word} wall {}{of_gap}", i + 1);
            finite(quantity("position"), wall.at)?;
            if let Some(inner) = i.checked_sub(1).map(|i| &walls[i]) {
                let beyond = side.sign() * (wall.at - inner.at) > 0.0;
                require(beyond, quantity("position"), wall.at, "farther out than the wall before it")?;
                let elastic = "elastic, with a force that may pull, because another wall lies behind it";
                require(inner.contact == Contact::Elastic, || name(i), inner.at, elastic)?;
            }
            let [constant, factor, power] = wall.restitution.terms();
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
            let springs = "one for each stage";
            let count = wall.springs.len();
            require(count == self.stages.len(), quantity("springs"), count as f64, springs)?;
            for (Spring { stiffness, damping, preload }, forces) in wall.springs.iter().zip(&self.stages) {
                for (what, value) in [("stiffness", *stiffness), ("damping", *damping)] {
                    require(
                        value.is_finite() && value >= 0.0,
                        quantity(what),
                        value,
                        "finite and at least 0",
                    )?;
                }
                let square = row.amax() * row.amax();
                for (what, value, matrix) in
                    [("stiffness", stiffness, &forces.stiffness), ("damping", damping, &forces.damping)]
                {
                    let sum = matrix.amax() + value * square;
                    let small = "so small that its sum with that of free motion is finite";
                    require(sum.is_finite(), quantity(what), *value, small)?;
                }
                require(
                    (stiffness * wall.at * row.amax()).is_finite(),
                    quantity("position"),
                    wall.at,
                    "so small that the force of its spring is finite",
                )?;
                let preload = preload.unwrap_or(0.0);
                finite(quantity("preload"), preload)?;
                let none = wall.contact != Contact::Impact || preload == 0.0;
                require(none, quantity("preload"), preload, "0, because the wall is not elastic")?;
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

    /// Returns the scale, > 0, of tolerances on distances: half the smallest distance between a gap's first walls. If no gap has two walls,
    /// it is the largest position of a wall or deflection `D f`, with `D = (|K| + (k omega)^2 M)^-1`, where `f` is a harmonic of order k, a
    /// load, a preload or a friction force (k = 1).
    pub fn length_scale(&self) -> f64 {
        let half = |gap: &GapRow| {
            let [right, left] = gap.walls.each_ref().map(|walls| walls.first());
            Some(0.5 * (right?.at - left?.at)).filter(|&half| half > 0.0)
        };
        self.gaps.iter().filter_map(half).min_by(f64::total_cmp).unwrap_or_else(|| self.largest_length())
    }

    /// Returns the displacement from which no motion is expected to return if energy can grow.
    pub(crate) fn escape(&self) -> f64 {
        // The distance between walls may be much smaller than their positions or than the motion of other coordinates.
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
        for (stage, Forces { load, .. }) in self.stages.iter().enumerate() {
            let eigen = self.stiffness_at_rest(stage).symmetric_eigen();
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
            self.friction.iter().for_each(|friction| under(&friction.row * friction.static_force, 1));
            for gap in &self.gaps {
                let springs = gap.walls.iter().flatten().flat_map(|wall| &wall.springs);
                springs
                    .filter(|spring| spring.force_at_wall() != 0.0)
                    .for_each(|spring| under(&gap.row * spring.force_at_wall(), 1));
            }
        }
        found
    }
}

/// Checks that values are finite and increase.
fn increasing(
    name: impl Fn() -> String,
    values: impl IntoIterator<Item = f64>,
) -> Result<(), OscillatorError> {
    let mut before = f64::NEG_INFINITY;
    values.into_iter().try_for_each(|value| {
        let is_above = value.is_finite() && value > before;
        before = value;
        require(is_above, &name, value, "finite and above the one before it")
    })
}

const POSITIVE: &str = "greater than 0";

fn symmetric(name: &'static str, matrix: &DMatrix<f64>) -> Result<(), OscillatorError> {
    let size = matrix.amax();
    let difference = (matrix - matrix.transpose()).amax();
    let quantity = || format!("difference of opposite entries of {name}");
    // Pairs need symmetry to the bit.
    let rounding = if matrix.nrows() > 2 { MATRIX_TOLERANCE * size } else { 0.0 };
    require(difference <= rounding, quantity, difference, "0: the matrix must be symmetric")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::GearPair;

    /// Each oscillator differs from a valid one in one entry.
    #[test]
    fn errors_name_the_quantity_and_its_value() {
        let good = GearPair::paper(0.5).oscillator().unwrap();
        let mut one_wall = good.clone();
        one_wall.gaps[0].walls[1].clear();
        assert_eq!(one_wall.validate(), Ok(()));
        let slip = |change: fn(&mut Oscillator)| {
            let mut oscillator = good.clone();
            change(&mut oscillator);
            oscillator.validate().unwrap_err().to_string()
        };
        for (message, wrong) in [
            (
                slip(|o| o.mass[(1, 1)] = 0.0),
                "lowest eigenvalue of the mass matrix = 0: it must be greater than 0",
            ),
            (
                slip(|o| o.omega = f64::NAN),
                "excitation frequency = NaN: it must be finite and greater than 0",
            ),
            (
                slip(|o| o.gaps[0].row.fill(0.0)),
                "the largest entry of the gap row = 0: it must be different from 0",
            ),
            (slip(|o| o.gaps[0].row[1] = f64::NAN), "row of gap 1 = NaN: it must be a finite number"),
            (slip(|o| o.drives[0].cos[0] = f64::INFINITY), "cosine of harmonic 1 = inf: it must be"),
            (slip(|o| o.drives[0].sin[1] = f64::NAN), "sine of harmonic 1 = NaN: it must be a finite"),
            (slip(|o| o.drives.push(o.drives[0].clone())), "order of a harmonic = 1: it must be above"),
            (
                slip(|o| o.gaps[0].walls.swap(0, 1)),
                "walls at -0.5 and 0.5: the right one must lie above the left one",
            ),
            (
                slip(|o| o.stages[0].stiffness[(0, 1)] = 0.1),
                "difference of opposite entries of stiffness = 0.1: it must be 0: the matrix must be symmetric",
            ),
            (slip(|o| o.stages[0].damping[(0, 1)] = f64::NAN), "damping = NaN: it must be a finite number"),
            (
                slip(|o| {
                    (o.stages[0].damping[(0, 0)], o.gaps[0].walls[0][0].springs[0].damping) = (1e308, 1e308)
                }),
                "damping of right wall 1 = 1e308: it must be so small that its sum",
            ),
            (
                slip(|o| o.gaps[0].walls[1][0].restitution = Restitution::Constant(1.5)),
                "restitution of left wall 1 = 1.5: it must be between 0 and 1",
            ),
            (
                slip(|o| o.gaps[0].walls[0][0].mesh_speed = -1.0),
                "mesh_speed of right wall 1 = -1: it must be",
            ),
        ] {
            assert!(message.starts_with(wrong), "{message}");
        }
    }

    /// Without supports the meshing matrices are singular, and rounding may make a determinant negative.
    #[test]
    fn singular_matrices_are_valid_at_every_size() {
        for scale in [1e-300, 1e-160, 1.0, 1e160, 1e300] {
            let pair = GearPair {
                r1: 0.0,
                r2: 0.3 * scale,
                k1: 0.1,
                k2: 0.0,
                r: scale,
                k: scale / 3.0,
                ..GearPair::paper(0.5)
            };
            pair.oscillator().unwrap();
        }
    }
}
