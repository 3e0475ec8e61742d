//! Oscillators and contact laws: masses, linear domains, walls.

use nalgebra::{Complex, Matrix2, Vector2};
use thiserror::Error;

use super::{MOST_COORDINATES, Machine, Side, State};
use crate::number::significant;

/// Rounding error that checks of a matrix allow, relative to its entries.
pub(super) const MATRIX_TOLERANCE: f64 = 1e-12;

/// An error in an oscillator or a contact law.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum OscillatorError {
    /// A number that is out of its range.
    #[error("{quantity} = {}: it must be {requirement}", significant(*.value))]
    OutOfRange {
        /// The quantity.
        quantity: String,
        /// The rejected value.
        value: f64,
        /// The range in words.
        requirement: &'static str,
    },
    /// Walls that leave no room between them.
    #[error("walls at {} and {}: the right one must lie above the left one", significant(.walls[0]), significant(.walls[1]))]
    Walls {
        /// Positions of the right and the left wall.
        walls: [f64; 2],
    },
    /// A mass, damping or stiffness matrix that is not symmetric.
    #[error("{quantity} = {}: the matrix must be symmetric", written(.matrix))]
    NotSymmetric {
        /// Name of the matrix.
        quantity: String,
        /// The matrix.
        matrix: [[f64; 2]; 2],
    },
    /// A matrix behind an elastic wall that differs from that of free motion by more than `c g g^T`.
    #[error(
        "{quantity} = {}: behind an elastic wall it must be that of free motion and a part along the gap row",
        written(.matrix)
    )]
    NotAlongGap {
        /// Name of the matrix.
        quantity: String,
        /// The matrix.
        matrix: [[f64; 2]; 2],
    },
    /// A mass matrix that is not positive definite.
    #[error("mass = {}: the matrix must be positive definite", written(.matrix))]
    NotDefinite {
        /// The matrix.
        matrix: [[f64; 2]; 2],
    },
}

impl OscillatorError {
    /// Adds the stage, counted from 1, to the quantity.
    fn in_stage(mut self, stage: usize) -> OscillatorError {
        if let OscillatorError::OutOfRange { quantity, .. }
        | OscillatorError::NotSymmetric { quantity, .. }
        | OscillatorError::NotAlongGap { quantity, .. } = &mut self
        {
            *quantity += &format!(" in stage {stage}");
        }
        self
    }
}

/// Writes a matrix for a message.
fn written(matrix: &[[f64; 2]; 2]) -> String {
    let row = |row: &[f64; 2]| format!("[{}, {}]", significant(row[0]), significant(row[1]));
    format!("[{}, {}]", row(&matrix[0]), row(&matrix[1]))
}

/// One linear domain: `M x'' + damping x' + stiffness x = force cos(omega t) + force_sin sin(omega t) + load`.
///
/// Stiffness is symmetric. Damping may have a skew-symmetric part, as gyroscopic forces do, which does no work. Negative
/// eigenvalues are allowed: energy then grows, at a rate that [`crate::flow`] bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// Damping matrix.
    pub damping: [[f64; 2]; 2],
    /// Stiffness matrix.
    pub stiffness: [[f64; 2]; 2],
    /// Constant load.
    pub load: [f64; 2],
    /// In contact with an elastic wall: the part of the contact force that begins at the wall, positive away from the wall.
    /// [`load`](Self::load) includes it. Otherwise 0.
    pub preload: f64,
}

/// Lower bound of [`Oscillator::length_scale`], which must not be zero.
const LEAST_LENGTH: f64 = 1e-150;

/// Distance of phases, in turns, that is rounding.
const SAME_PHASE: f64 = 1e-12;

/// Displacement, in scales of length, from which no motion is expected to return if energy can grow.
pub(super) const ESCAPE: f64 = 1e6;

/// Displacement from which no motion is expected to return if nothing gives a scale of length: no force, no load, and no wall but at 0.
pub(super) const ESCAPE_WITHOUT_SCALE: f64 = 1e100;

/// The contact type of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// An impact, `w+ = -e w-`. A pressed contact with a low leaving speed lasts, and then moves on a spring and a
    /// damper behind the wall.
    Impact,
    /// An impact on a rigid wall. A pressed contact that has come to rest sticks to the wall until the load pulls it
    /// off.
    Rigid,
    /// No impact: the motion continues behind the wall, and the state is continuous.
    Elastic,
    /// An elastic wall that only pushes: behind the wall, its force is the larger of 0 and that of spring, damper and preload.
    Pushing,
}

impl Contact {
    /// Whether the motion continues behind the wall without an impact.
    pub fn is_elastic(self) -> bool {
        matches!(self, Contact::Elastic | Contact::Pushing)
    }
}

/// One harmonic of the force: `cos cos(order omega t) + sin sin(order omega t)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Order, 2 to [`HIGHEST_ORDER`].
    pub order: u32,
    /// Factor of the cosine.
    pub cos: [f64; 2],
    /// Factor of the sine.
    pub sin: [f64; 2],
}

/// Highest order of a harmonic.
pub const HIGHEST_ORDER: u32 = 64;

/// Largest number of harmonics beside the first.
pub const MOST_HARMONICS: usize = 7;

/// The linear domains of a part of the forcing period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// Motion between the walls.
    pub free: Domain,
    /// Motion in lasting contact with the right and the left wall; ignored for rigid and missing walls.
    pub meshing: [Domain; 2],
}

/// A further wall behind an elastic one, such as the second stage of a clutch spring or the stop behind a soft buffer.
#[derive(Clone, Debug, PartialEq)]
pub struct OuterWall {
    /// Position `z`, farther from the opposite side than the walls before it.
    pub at: f64,
    /// Contact type; all walls on a side but the outermost are elastic.
    pub contact: Contact,
    /// Motion in lasting contact, in each stage; ignored for a rigid wall.
    pub meshing: Vec<Domain>,
}

/// Dry friction along a row of velocities, Coulomb's law.
///
/// With the sliding rate `rate = row . v - speed`, the oscillator is subject to the generalised force `-row F`, where `F = force` for `rate > 0`,
/// `F = -force` for `rate < 0`, and `|F| <= force` while the surfaces stick at `rate = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// The row of the sliding rate; not zero.
    pub row: [f64; 2],
    /// The friction force, >= 0: when sliding, and the largest one that holds.
    pub force: f64,
    /// Speed of the other surface, as of a moving belt, along the row.
    pub speed: f64,
}

/// Largest number of elements with dry friction.
pub const MOST_FRICTION: usize = 2;

/// Largest number of walls on a side.
pub const MOST_WALLS: usize = 4;

/// Largest number of stages.
pub const MOST_STAGES: usize = 8;

/// Largest number of changes of the stage in a forcing period.
pub const MOST_CHANGES: usize = 1024;

/// A forced piecewise-linear oscillator of one or two degrees of freedom between two walls. Each wall may be missing, and further
/// walls may lie behind an elastic one.
#[derive(Clone, Debug, PartialEq)]
pub struct Oscillator {
    /// Degrees of freedom: 1 or 2. With 1, the second displacement has a mass of 1, no forces and no part in the gap,
    /// and its state is 0.
    pub degrees: usize,
    /// Mass matrix, symmetric and positive definite.
    pub mass: [[f64; 2]; 2],
    /// Row `g` of the gap `z = g . x`; not zero.
    pub gap: [f64; 2],
    /// Positions `z` of the right (upper) and left (lower) wall; `+inf` or `-inf` for a missing wall.
    pub walls: [f64; 2],
    /// Contact types of the right and the left wall; ignored for a missing wall.
    pub contacts: [Contact; 2],
    /// Excitation frequency, > 0.
    pub omega: f64,
    /// Factor of `cos(omega t)` in the harmonic force, which is the same in every domain.
    pub force: [f64; 2],
    /// Factor of `sin(omega t)` in the harmonic force.
    pub force_sin: [f64; 2],
    /// Motion between the walls.
    pub free: Domain,
    /// Motion in lasting contact with the right and the left wall; ignored for rigid and missing walls.
    pub meshing: [Domain; 2],
    /// Further harmonics of the force, in increasing order.
    pub harmonics: Vec<Harmonic>,
    /// Further stages. Stage 0 is `free` and `meshing`, stage `i` is `stages[i - 1]`.
    pub stages: Vec<Stage>,
    /// Changes of the stage in a forcing period: the phase in turns, in `[0, 1)` and increasing, and the stage that begins
    /// there. The last one holds up to the first. Empty if stage 0 holds always.
    pub schedule: Vec<(f64, usize)>,
    /// Further walls behind the right and the left one, from the inside to the outside.
    pub outer_walls: [Vec<OuterWall>; 2],
    /// Dry friction, in all stages and behind all walls: at most [`MOST_FRICTION`] elements with independent rows, and one where a wall is
    /// rigid.
    pub friction: Vec<Friction>,
    /// The whole oscillator, if the fields above cannot describe it. It then has its own contact laws, and those fields have no meaning,
    /// except `degrees`, `omega`, and for figures the first walls of the first gap. See [`Oscillator::of_machine`].
    pub machine: Option<Box<Machine>>,
}

impl Oscillator {
    /// Wraps a machine.
    pub fn of_machine(machine: Machine) -> Oscillator {
        let first = Side::BOTH.map(|side| machine.gaps[0].walls[side.index()].first().cloned());
        let far = [f64::INFINITY, f64::NEG_INFINITY];
        let none = Domain { damping: [[0.0; 2]; 2], stiffness: [[0.0; 2]; 2], load: [0.0; 2], preload: 0.0 };
        Oscillator {
            degrees: machine.degrees(),
            mass: [[1.0, 0.0], [0.0, 1.0]],
            gap: [1.0, 0.0],
            walls: [0, 1].map(|i| first[i].as_ref().map_or(far[i], |wall| wall.at)),
            contacts: [0, 1].map(|i| first[i].as_ref().map_or(Contact::Rigid, |wall| wall.contact)),
            omega: machine.omega,
            force: [0.0; 2],
            force_sin: [0.0; 2],
            free: none,
            meshing: [none; 2],
            harmonics: Vec::new(),
            stages: Vec::new(),
            schedule: Vec::new(),
            outer_walls: Default::default(),
            friction: Vec::new(),
            machine: Some(Box::new(machine)),
        }
    }

    /// Returns the forcing period `2 pi / omega`.
    pub fn period(&self) -> f64 {
        std::f64::consts::TAU / self.omega
    }

    /// Returns the number of gaps.
    pub fn gap_count(&self) -> usize {
        self.machine.as_ref().map_or(1, |machine| machine.gaps.len())
    }

    /// Returns the row of a gap, one entry for each coordinate; 0 for those that it does not have.
    pub fn gap_row(&self, gap: usize) -> [f64; MOST_COORDINATES] {
        let mut row = [0.0; MOST_COORDINATES];
        match &self.machine {
            Some(machine) => machine.gaps[gap].row.iter().zip(&mut row).for_each(|(x, entry)| *entry = *x),
            None => row[..2].copy_from_slice(&self.gap),
        }
        row
    }

    /// Returns a gap in a state, or with `velocity` 1 its rate.
    pub fn gap_value(&self, gap: usize, state: &State, velocity: usize) -> f64 {
        if self.machine.is_none() {
            return self.gap[0] * state[velocity] + self.gap[1] * state[2 + velocity];
        }
        self.gap_row(gap).iter().enumerate().map(|(i, factor)| factor * state[2 * i + velocity]).sum()
    }

    /// Returns the impulse `p` of a wall on a gap that changes the velocities between two states: `M (v+ - v-)` is the sum of `p g` over all
    /// gaps, because walls on which other gaps rest push, too.
    pub fn gap_impulse(&self, gap: usize, [before, after]: [&State; 2]) -> f64 {
        let jump = |gap: usize| self.gap_value(gap, after, 1) - self.gap_value(gap, before, 1);
        match &self.machine {
            Some(machine) => machine.impulses(jump)[gap],
            None => jump(0) / self.mobility(self.gap),
        }
    }

    /// Returns the oscillator whose phase 0 is this phase of the forcing, in radians.
    pub fn at_phase(&self, phase: f64) -> Oscillator {
        if phase == 0.0 {
            return self.clone();
        }
        let Complex { re: cos, im: sin } = turn(phase);
        let turned = |force: [f64; 2], force_sin: [f64; 2], [cos, sin]: [f64; 2]| {
            let pairs = [0, 1].map(|i| {
                let (f, g) = (force[i], force_sin[i]);
                [cos * f + sin * g, cos * g - sin * f]
            });
            [0, 1].map(|part| pairs.map(|pair| pair[part]))
        };
        let [force, force_sin] = turned(self.force, self.force_sin, [cos, sin]);
        let harmonic = |harmonic: &Harmonic| {
            let power = Complex::new(cos, sin).powu(harmonic.order);
            let [cos, sin] = turned(harmonic.cos, harmonic.sin, [power.re, power.im]);
            Harmonic { cos, sin, ..*harmonic }
        };
        let schedule = schedule_at(&self.schedule, phase);
        let harmonics = self.harmonics.iter().map(harmonic).collect();
        let machine = self.machine.as_ref().map(|machine| Box::new(machine.at_phase(phase)));
        Oscillator { force, force_sin, harmonics, schedule, machine, ..self.clone() }
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

    /// Returns the number of stages, 1 or more.
    pub fn stage_count(&self) -> usize {
        1 + self.stages.len()
    }

    /// Returns the stage that holds at phase 0: the one that begins there, or the last one of the schedule.
    pub fn first_stage(&self) -> usize {
        match self.schedule.first() {
            Some(&(0.0, stage)) => stage,
            _ => self.schedule.last().map_or(0, |&(_, stage)| stage),
        }
    }

    /// Returns the domains of a stage.
    pub fn stage(&self, stage: usize) -> Stage {
        match stage {
            0 => Stage { free: self.free, meshing: self.meshing },
            _ => self.stages[stage - 1],
        }
    }

    /// Returns the oscillator in which a stage holds always.
    pub fn in_stage(&self, stage: usize) -> Oscillator {
        let Stage { free, meshing } = self.stage(stage);
        let mut alone =
            Oscillator { free, meshing, stages: Vec::new(), schedule: Vec::new(), ..self.clone() };
        for wall in alone.outer_walls.iter_mut().flatten() {
            wall.meshing = wall.meshing.get(stage).copied().into_iter().collect();
        }
        alone
    }

    /// Returns the oscillator between two neighbouring walls of a side, in one stage: between the `nth` wall of the side,
    /// from 1, and the next one. Its free motion is contact with the first `nth` walls.
    ///
    /// On the inner wall the motion continues in the interval before.
    ///
    /// # Panics
    /// If the side has no further wall behind the `nth` one.
    pub fn behind(&self, side: Side, nth: usize) -> Oscillator {
        let (i, outer) = (side.index(), &self.outer_walls[side.index()]);
        let domain = |wall: usize| match wall {
            0 => self.free,
            1 => self.meshing[i],
            _ => outer[wall - 2].meshing[0],
        };
        let next = &outer[nth - 1];
        let free = Domain { preload: 0.0, ..domain(nth) };
        let mut interval = Oscillator { free, outer_walls: Default::default(), ..self.clone() };
        interval.walls[i] = next.at;
        interval.walls[1 - i] = if nth == 1 { self.walls[i] } else { outer[nth - 2].at };
        interval.contacts[i] = next.contact;
        interval.contacts[1 - i] = Contact::Elastic;
        interval.meshing[i] = next.meshing[0];
        interval.meshing[1 - i] = Domain { preload: domain(nth).preload, ..domain(nth - 1) };
        interval
    }

    /// Returns stiffness, damping and constant of the force along the gap that free motion of this interval has and `centre` lacks.
    pub fn force_against(&self, centre: &Domain) -> [f64; 3] {
        let g = self.gap;
        let square = g[0] * g[0] + g[1] * g[1];
        let load = [0, 1].map(|i| self.free.load[i] - centre.load[i]);
        [
            along(g, self.free.stiffness, centre.stiffness),
            along(g, self.free.damping, centre.damping),
            -(g[0] * load[0] + g[1] * load[1]) / square,
        ]
    }

    /// Whether a side has several walls.
    pub fn has_outer_walls(&self) -> bool {
        self.outer_walls.iter().any(|walls| !walls.is_empty())
    }

    /// Whether the last wall of a side only pushes, or any of its walls has a preload in any stage.
    pub fn is_pushing_or_preloaded(&self, side: Side) -> bool {
        self.last_wall(side).1 == Contact::Pushing && self.wall(side).is_finite()
            || self.preloads(side).any(|preload| preload != 0.0)
    }

    /// Returns the preloads of the walls of a side, in all stages.
    pub fn preloads(&self, side: Side) -> impl Iterator<Item = f64> + '_ {
        let outer = self.outer_walls[side.index()].iter().flat_map(|wall| &wall.meshing);
        let stages =
            (0..self.stage_count()).map(move |stage| self.stage(stage).meshing[side.index()].preload);
        let exists = self.wall(side).is_finite();
        stages.chain(outer.map(|domain| domain.preload)).filter(move |_| exists)
    }

    /// Returns position and law of the last wall of a side, from the inside to the outside. A missing wall is infinitely far.
    pub fn last_wall(&self, side: Side) -> (f64, Contact) {
        match self.outer_walls[side.index()].last() {
            Some(wall) => (wall.at, wall.contact),
            None => (self.wall(side), self.contacts[side.index()]),
        }
    }

    /// Returns the number of walls on a side.
    pub fn wall_count(&self, side: Side) -> usize {
        usize::from(self.wall(side).is_finite()) + self.outer_walls[side.index()].len()
    }

    /// Returns the highest order of the force's harmonics, 1 or more.
    pub fn highest_order(&self) -> u32 {
        self.harmonics.iter().map(|harmonic| harmonic.order).max().unwrap_or(1)
    }

    /// Returns all harmonics of the force, the first one too.
    pub fn all_harmonics(&self) -> impl Iterator<Item = Harmonic> + '_ {
        let first = Harmonic { order: 1, cos: self.force, sin: self.force_sin };
        std::iter::once(first).chain(self.harmonics.iter().copied())
    }

    pub(crate) fn wall(&self, side: Side) -> f64 {
        self.walls[side.index()]
    }

    /// Returns the index of the displacement that is a coordinate together with the gap: the one with the smaller
    /// entry in the gap row, the second if both are equal.
    pub fn other(&self) -> usize {
        usize::from(self.gap[0].abs() >= self.gap[1].abs())
    }

    /// Returns `M^-1 force`, the accelerations due to a force.
    pub fn accelerations(&self, force: [f64; 2]) -> [f64; 2] {
        let ([[m1, m], [_, m2]], [f1, f2]) = (self.mass, force);
        if m == 0.0 {
            return [f1 / m1, f2 / m2];
        }
        let share = m / m1;
        let second = (f2 - share * f1) / (m2 - share * m);
        [(f1 - m * second) / m1, second]
    }

    /// Returns the inverse of the mass matrix.
    pub fn inverse_mass(&self) -> [[f64; 2]; 2] {
        let [[m1, m], [_, m2]] = self.mass;
        if m == 0.0 {
            return [[m1.recip(), 0.0], [0.0, m2.recip()]];
        }
        let [[a, c], [_, d]] = [self.accelerations([1.0, 0.0]), self.accelerations([0.0, 1.0])];
        [[a, c], [c, d]]
    }

    /// Returns `row M^-1 row`, the change of the velocity `row . v` by a unit impulse along the row.
    pub fn mobility(&self, row: [f64; 2]) -> f64 {
        let ([[m1, m], [_, m2]], [r1, r2]) = (self.mass, row);
        if m == 0.0 {
            return r1 * r1 / m1 + r2 * r2 / m2;
        }
        let share = m / m1;
        let rest = r2 - share * r1;
        r1 * r1 / m1 + rest * rest / (m2 - share * m)
    }

    /// Returns the lower factor `L` of the mass matrix `L L^T`.
    pub(crate) fn mass_root(&self) -> [[f64; 2]; 2] {
        let [[m1, m], [_, m2]] = self.mass;
        let first = m1.sqrt();
        [[first, 0.0], [m / first, (m2 - m / m1 * m).sqrt()]]
    }

    /// Returns `L^-1 A L^-T` for a symmetric matrix `A`, with the mass matrix `L L^T`.
    pub(crate) fn mass_scaled(&self, m: [[f64; 2]; 2]) -> Matrix2<f64> {
        let [[first, _], [below, second]] = self.mass_root();
        let root = Vector2::new(first.recip(), second.recip());
        let m = Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]);
        if below == 0.0 {
            return m.component_mul(&(root * root.transpose()));
        }
        let inverse = Matrix2::new(root[0], 0.0, -below * root[0] * root[1], root[1]);
        inverse * m * inverse.transpose()
    }

    /// Returns a bound on the rate at which the root of the energy `2 E = v M v + x |K| x` of free motion in a domain grows without a
    /// force.
    ///
    /// In mass-scaled coordinates, `C = L^-1 damping L^-T` and `K = L^-1 stiffness L^-T`, and `|K|` has the eigenvectors of `K` and
    /// the moduli of its eigenvalues. Then
    ///
    /// ```text
    /// E' = v f - v C v + v (|K| - K) x <= |f| sqrt(2 E) + (c + sqrt(k)) 2 E
    /// ```
    ///
    /// where `-c` and `-k` are the lowest eigenvalues of the symmetric part of `C` and of `K`, or 0 if these are positive. The bound is
    /// sharp for motion that leaves the top of a hill. It is 0 without negative damping and stiffness.
    pub fn growth_rate(&self, domain: &Domain) -> f64 {
        let below_zero = |m: [[f64; 2]; 2]| match is_semidefinite(m) {
            true => 0.0,
            false => (-self.mass_scaled(m).symmetric_eigenvalues().min()).max(0.0),
        };
        below_zero(domain.dissipation()) + below_zero(domain.stiffness).sqrt()
    }

    /// Returns `|K|` of [`growth_rate`](Self::growth_rate): the stiffness, with the moduli of its eigenvalues relative to the mass.
    pub fn energy_stiffness(&self, domain: &Domain) -> [[f64; 2]; 2] {
        if is_semidefinite(domain.stiffness) {
            return domain.stiffness;
        }
        let mut eigen = self.mass_scaled(domain.stiffness).symmetric_eigen();
        eigen.eigenvalues.apply(|l| *l = l.abs());
        let [[first, _], [below, second]] = self.mass_root();
        let root = Matrix2::new(first, 0.0, below, second);
        let k = root * eigen.recompose() * root.transpose();
        [[k[(0, 0)], k[(0, 1)]], [k[(0, 1)], k[(1, 1)]]]
    }

    /// Checks everything that [`crate::flow`] and [`mod@crate::reference`] assume.
    ///
    /// # Errors
    /// [`OscillatorError`] for the first check that fails.
    pub fn validate(&self) -> Result<(), OscillatorError> {
        if let Some(machine) = &self.machine {
            return machine.validate();
        }
        let is_known = matches!(self.degrees, 1 | 2);
        require(is_known, || "degrees of freedom".to_owned(), self.degrees as f64, "1 or 2")?;
        let [[m1, m], [other, m2]] = self.mass;
        for (i, mass) in [m1, m2].into_iter().enumerate() {
            let quantity = || if self.degrees == 1 { "mass".to_owned() } else { format!("mass {}", i + 1) };
            positive(quantity, mass)?;
        }
        if m != other {
            return Err(OscillatorError::NotSymmetric { quantity: "mass".to_owned(), matrix: self.mass });
        }
        let is_definite = m == 0.0 || m1 * m2 > m * m;
        if !is_definite {
            return Err(OscillatorError::NotDefinite { matrix: self.mass });
        }
        positive(|| "excitation frequency".to_owned(), self.omega)?;
        for (i, entry) in self.gap.into_iter().enumerate() {
            finite(|| format!("entry {} of the gap row", i + 1), entry)?;
        }
        let largest = self.gap[1 - self.other()];
        require(
            largest != 0.0,
            || "the largest entry of the gap row".to_owned(),
            largest,
            "different from 0",
        )?;
        for (name, force) in [("force", self.force), ("force_sin", self.force_sin)] {
            for (i, force) in force.into_iter().enumerate() {
                finite(|| format!("{name} {}", i + 1), force)?;
            }
        }
        let [right, left] = self.walls;
        let are_apart = right > left && right > f64::NEG_INFINITY && left < f64::INFINITY;
        if !are_apart {
            return Err(OscillatorError::Walls { walls: self.walls });
        }
        self.free.validate(self.degrees, "free motion")?;
        for (side, place) in
            [(Side::Right, "contact with the right wall"), (Side::Left, "contact with the left wall")]
        {
            if self.has_motion_behind(side) {
                self.meshing[side.index()].validate(self.degrees, place)?;
                self.validate_wall(side, place)?;
            }
        }
        self.validate_outer_walls()?;
        self.validate_harmonics()?;
        self.validate_friction()?;
        if self.degrees == 1 {
            self.validate_single()?;
        }
        self.validate_stages()
    }

    fn validate_outer_walls(&self) -> Result<(), OscillatorError> {
        for side in Side::BOTH {
            let outer = &self.outer_walls[side.index()];
            let (count, word) = (self.wall_count(side), ["right", "left"][side.index()]);
            let name = |nth: usize| format!("{word} wall {nth}");
            require(
                count <= MOST_WALLS,
                || format!("walls on the {} side", word),
                count as f64,
                "at most 4",
            )?;
            let mut inner =
                (self.wall(side), self.is_elastic(side) && self.contacts[side.index()] == Contact::Elastic);
            for (nth, wall) in (2..).zip(outer) {
                let beyond = side.sign() * (wall.at - inner.0);
                finite(|| format!("position of {}", name(nth)), wall.at)?;
                require(
                    beyond > 0.0,
                    || format!("position of {}", name(nth)),
                    wall.at,
                    "farther out than the wall before it",
                )?;
                let elastic = "elastic, with a force that may pull, because another wall lies behind it";
                require(inner.1, || name(nth - 1), inner.0, elastic)?;
                inner = (wall.at, wall.contact == Contact::Elastic);
                let stages = "one for each stage";
                let domains = wall.meshing.len();
                require(
                    domains == self.stage_count(),
                    || format!("domains behind {}", name(nth)),
                    domains as f64,
                    stages,
                )?;
            }
            for nth in 1..=outer.len() {
                let interval = self.behind(side, nth);
                if interval.has_motion_behind(side) {
                    let place = format!("contact with {}", name(nth + 1));
                    interval.meshing[side.index()].validate(self.degrees, &place)?;
                    interval.validate_wall(side, &place)?;
                }
            }
        }
        Ok(())
    }

    fn validate_harmonics(&self) -> Result<(), OscillatorError> {
        let count = self.harmonics.len();
        let few = "at most 7, beside the first";
        require(count <= MOST_HARMONICS, || "the number of harmonics".to_owned(), count as f64, few)?;
        for (i, Harmonic { order, cos, sin }) in self.harmonics.iter().enumerate() {
            let is_known = (2..=HIGHEST_ORDER).contains(order);
            require(is_known, || "order of a harmonic".to_owned(), f64::from(*order), "2 to 64")?;
            let is_new = self.harmonics[..i].iter().all(|other| other.order < *order);
            let increasing = "above those before it";
            require(is_new, || "order of a harmonic".to_owned(), f64::from(*order), increasing)?;
            for (name, factors) in [("cosine", cos), ("sine", sin)] {
                let quantity = || format!("{name} of harmonic {order}");
                factors.iter().try_for_each(|&factor| finite(quantity, factor))?;
                let single = "0, since one degree of freedom has no second displacement";
                require(self.degrees == 2 || factors[1] == 0.0, quantity, factors[1], single)?;
            }
        }
        Ok(())
    }

    fn validate_friction(&self) -> Result<(), OscillatorError> {
        let count = self.friction.len();
        let most = self.degrees.min(MOST_FRICTION);
        let few = "at most 2, and at most 1 for one degree of freedom";
        require(count <= most, || "elements with dry friction".to_owned(), count as f64, few)?;
        for (i, Friction { row, force, speed }) in self.friction.iter().enumerate() {
            let name = |what: &'static str| move || format!("{what} of friction {}", i + 1);
            row.iter().try_for_each(|&entry| finite(name("an entry of the row"), entry))?;
            let largest = row[0].abs().max(row[1].abs());
            require(largest > 0.0, name("the largest entry of the row"), largest, "different from 0")?;
            let single = "0, since one degree of freedom has no second displacement";
            require(self.degrees == 2 || row[1] == 0.0, name("entry 2 of the row"), row[1], single)?;
            let is_force = force.is_finite() && *force >= 0.0;
            require(is_force, name("force"), *force, "finite and at least 0")?;
            finite(name("speed"), *speed)?;
        }
        if let [Friction { row: [a, b], .. }, Friction { row: [c, d], .. }] = self.friction[..] {
            let is_rigid = |side: Side| {
                let (at, contact) = self.last_wall(side);
                at.is_finite() && contact == Contact::Rigid
            };
            let rigid = Side::BOTH.into_iter().filter(|&side| is_rigid(side)).count();
            let undetermined = "0 with two elements of dry friction, because the forces of both and of the wall are not determined at rest";
            require(rigid == 0, || "rigid walls".to_owned(), rigid as f64, undetermined)?;
            let determinant = a * d - b * c;
            let size = a.hypot(b) * c.hypot(d);
            require(
                determinant.abs() > MATRIX_TOLERANCE * size,
                || "determinant of the two rows of friction".to_owned(),
                determinant,
                "different from 0; one element with the sum of both forces describes friction along equal rows",
            )?;
        }
        Ok(())
    }

    fn validate_stages(&self) -> Result<(), OscillatorError> {
        let (count, changes) = (self.stage_count(), self.schedule.len());
        require(count <= MOST_STAGES, || "the number of stages".to_owned(), count as f64, "1 to 8")?;
        let few = "at most 1024";
        require(
            changes <= MOST_CHANGES,
            || "the number of changes of the stage".to_owned(),
            changes as f64,
            few,
        )?;
        check_phases(&self.schedule)?;
        for &(_, stage) in &self.schedule {
            require(stage < count, || "index of a stage".to_owned(), stage as f64, "that of a stage")?;
        }
        (1..count)
            .try_for_each(|stage| self.in_stage(stage).validate().map_err(|error| error.in_stage(stage + 1)))
    }

    /// Whether a wall exists and motion can continue behind it.
    fn has_motion_behind(&self, side: Side) -> bool {
        self.wall(side).is_finite() && self.contacts[side.index()] != Contact::Rigid
    }

    /// Whether a wall exists and is elastic.
    pub(crate) fn is_elastic(&self, side: Side) -> bool {
        self.wall(side).is_finite() && self.contacts[side.index()].is_elastic()
    }

    /// Returns the preload of an elastic wall; 0 for other walls.
    pub fn preload(&self, side: Side) -> f64 {
        if self.is_elastic(side) { self.meshing[side.index()].preload } else { 0.0 }
    }

    /// Returns the stiffness and damping that a wall adds along the gap row; 0 if no motion continues behind it.
    pub fn wall_stiffness_and_damping(&self, side: Side) -> [f64; 2] {
        if !self.has_motion_behind(side) {
            return [0.0; 2];
        }
        let behind = &self.meshing[side.index()];
        [
            along(self.gap, behind.stiffness, self.free.stiffness),
            along(self.gap, behind.damping, self.free.damping),
        ]
    }

    /// Returns the displacement beyond which the motion counts as escaped. It is infinite if energy grows by the force alone.
    pub fn escape(&self) -> f64 {
        let mut domains = self.domains();
        // Stages can do work: parametric resonance.
        let grows = !self.stages.is_empty() || domains.any(|domain| self.growth_rate(domain) > 0.0);
        // Walls may be near each other and far from rest, or much nearer than the motion of other coordinates.
        let of_stages = (0..self.stage_count()).map(|stage| self.in_stage(stage).deflection_scale());
        match of_stages.fold(self.length_scale(), f64::max) {
            _ if !grows => f64::INFINITY,
            LEAST_LENGTH => ESCAPE_WITHOUT_SCALE,
            length => ESCAPE * length,
        }
    }

    /// Returns the domains of the first stage in which there is motion.
    fn domains(&self) -> impl Iterator<Item = &Domain> {
        let behind = Side::BOTH.into_iter().filter(|&side| self.has_motion_behind(side));
        let outer = self.outer_walls.iter().flatten().filter(|wall| wall.contact != Contact::Rigid);
        behind
            .map(|side| &self.meshing[side.index()])
            .chain([&self.free])
            .chain(outer.flat_map(|wall| wall.meshing.first()))
    }

    /// Checks that spring and damper behind a wall are not negative. An elastic wall must act along the gap row only, and the
    /// force must be continuous at the wall, but for the preload.
    fn validate_wall(&self, side: Side, place: &str) -> Result<(), OscillatorError> {
        let (behind, free, g) = (&self.meshing[side.index()], &self.free, self.gap);
        let [stiffness, damping] = self.wall_stiffness_and_damping(side);
        let matrices = [
            ("stiffness", behind.stiffness, free.stiffness, stiffness),
            ("damping", behind.damping, free.damping, damping),
        ];
        for (name, matrix, before, added) in matrices {
            let size = matrix.iter().chain(&before).flatten().fold(0.0f64, |size, x| size.max(x.abs()));
            let pairs = [(0, 0), (0, 1), (1, 0), (1, 1)];
            let is_along = |(i, j): (usize, usize)| {
                (matrix[i][j] - before[i][j] - added * g[i] * g[j]).abs() <= MATRIX_TOLERANCE * size
            };
            let quantity = || format!("{name} added in {place}");
            let least = -MATRIX_TOLERANCE * size / (g[0] * g[0] + g[1] * g[1]);
            require(added >= least, quantity, added, "at least 0")?;
            if self.is_elastic(side) && !(added >= 0.0 && pairs.into_iter().all(is_along)) {
                let quantity = format!("{name} in {place}");
                return Err(OscillatorError::NotAlongGap { quantity, matrix });
            }
        }
        if !self.is_elastic(side) {
            let requirement = "0, because the wall is not elastic";
            return require(
                behind.preload == 0.0,
                || format!("preload in {place}"),
                behind.preload,
                requirement,
            );
        }
        let wall = self.wall(side);
        // The stiffness is a difference of matrices, and has the rounding error of their largest entry.
        let largest = behind.stiffness.as_flattened().iter().fold(0.0f64, |size, x| size.max(x.abs()));
        let least = largest / (g[0] * g[0] + g[1] * g[1]);
        for (i, g) in g.into_iter().enumerate() {
            let push = side.sign() * behind.preload * g;
            let expected = free.load[i] + stiffness * wall * g - push;
            let size = free.load[i].abs() + (stiffness.max(least) * wall * g).abs() + push.abs();
            let is_continuous = (behind.load[i] - expected).abs() <= MATRIX_TOLERANCE * size;
            let requirement = "the load of free motion, the spring's at the wall and the preload";
            require(is_continuous, || format!("load {} in {place}", i + 1), behind.load[i], requirement)?;
        }
        Ok(())
    }

    /// Checks that the unused second displacement of one degree of freedom has no coupling and no forces.
    fn validate_single(&self) -> Result<(), OscillatorError> {
        let none = |what: &str, value: f64| {
            let requirement = "0, since one degree of freedom has no second displacement";
            require(value == 0.0, || what.to_owned(), value, requirement)
        };
        none("entry 2 of the gap row", self.gap[1])?;
        none("force 2", self.force[1])?;
        none("force_sin 2", self.force_sin[1])?;
        none("mass 1, 2", self.mass[0][1])?;
        let mass = self.mass[1][1];
        require(mass == 1.0, || "mass 2".to_owned(), mass, "1 where there is one degree of freedom")?;
        for domain in self.domains() {
            none("load 2", domain.load[1])?;
            for (name, matrix) in [("damping", domain.damping), ("stiffness", domain.stiffness)] {
                none(&format!("{name} 1, 2"), matrix[0][1])?;
                none(&format!("{name} 2, 1"), matrix[1][0])?;
                none(&format!("{name} 2, 2"), matrix[1][1])?;
            }
        }
        Ok(())
    }

    /// Returns the length, > 0, that tolerances on distances are relative to.
    ///
    /// It is half the distance of the walls. If a wall is missing or both coincide, it is
    ///
    /// ```text
    /// max(|wall|, |D force|, |D load|, |D preload g|, |D friction row|),   D = (|K| + omega^2 M)^-1
    /// ```
    ///
    /// over the existing walls and both displacements, with [`|K|`](Self::energy_stiffness) and `load` of free motion. `|D force|` is the amplitude
    /// of the forced deflection without the effects of resonance and damping. `D load` is the static deflection; for a soft spring
    /// or none it is the distance that the load moves a mass in a radian of the forcing. The scale is finite for
    /// every oscillator.
    ///
    /// A factor on `walls`, the force and `load` that is a power of two multiplies the scale exactly. A change of the
    /// unit of time does not change it.
    pub fn length_scale(&self) -> f64 {
        if let Some(machine) = &self.machine {
            return machine.length_scale();
        }
        let [right, left] = self.walls;
        let half = 0.5 * (right - left);
        if half.is_finite() && half > 0.0 {
            return half;
        }
        let of_stages = (1..self.stage_count()).map(|stage| self.in_stage(stage).deflection_scale());
        of_stages.fold(self.deflection_scale(), f64::max)
    }

    /// Returns the largest of the walls' positions and of the deflections of [`length_scale`](Self::length_scale), in the
    /// first stage.
    fn deflection_scale(&self) -> f64 {
        let [cos, sin, load] =
            [self.force, self.force_sin, self.free.load].map(|f| self.deflections(f, self.omega));
        let mut swings = [0, 1].map(|i| cos[i].hypot(sin[i]));
        for Harmonic { order, cos, sin } in &self.harmonics {
            let [cos, sin] = [cos, sin].map(|f| self.deflections(*f, self.omega * f64::from(*order)));
            swings = [0, 1].map(|i| swings[i] + cos[i].hypot(sin[i]));
        }
        let deflections = [0, 1].map(|i| swings[i].max(load[i].abs()));
        let walls = self.walls.map(f64::abs).into_iter().filter(|wall| wall.is_finite());
        let preloads = self.domains().filter(|domain| domain.preload != 0.0);
        let preloads = preloads.flat_map(|domain| {
            self.deflections(self.gap.map(|g| domain.preload * g), self.omega).map(f64::abs)
        });
        let friction = self.friction.iter().flat_map(|Friction { row, force, .. }| {
            self.deflections(row.map(|r| force * r), self.omega).map(f64::abs)
        });
        walls.chain(deflections).chain(preloads).chain(friction).fold(LEAST_LENGTH, f64::max)
    }

    fn deflections(&self, force: [f64; 2], omega: f64) -> [f64; 2] {
        let [[k1, k], [_, k2]] = self.energy_stiffness(&self.free);
        let [[m1, m], [_, m2]] = self.mass;
        let [a, b, m] = [m1, m2, m].map(|m| m * omega * omega);
        let (a, b, k) = (a + k1, b + k2, m + k);
        let determinant = a * b - k * k;
        let [f1, f2] = force;
        [(b * f1 - k * f2) / determinant, (a * f2 - k * f1) / determinant]
    }

    /// Whether the walls and the domains behind them are mirror images, so that `(y, t) -> (-y, t + T/2)` maps
    /// solutions to solutions. The force must then have odd harmonics only, and stages must recur, mirrored, after half a
    /// period.
    pub fn mirror_symmetric(&self) -> bool {
        if let Some(machine) = &self.machine {
            return machine.mirror_symmetric();
        }
        let [right, left] = &self.outer_walls;
        // `i` and `j` are stages half a period apart.
        let is_mirrored = |i: usize, j: usize| {
            let (a, b) = (self.stage(i), self.stage(j));
            let behind = |(right, left): (&OuterWall, &OuterWall)| {
                right.contact == Contact::Rigid || right.meshing[i] == mirrored(&left.meshing[j])
            };
            a.free == mirrored(&b.free)
                && (!self.has_motion_behind(Side::Right) || a.meshing[0] == mirrored(&b.meshing[1]))
                && right.iter().zip(left).all(behind)
        };
        self.walls[0] == -self.walls[1]
            && self.contacts[0] == self.contacts[1]
            && right.len() == left.len()
            && right
                .iter()
                .zip(left)
                .all(|(right, left)| right.at == -left.at && right.contact == left.contact)
            && self.harmonics.iter().all(|harmonic| harmonic.order % 2 == 1)
            && self.friction.iter().all(|friction| friction.speed == 0.0)
            && recurs_after_half_a_period(&self.schedule, is_mirrored)
    }
}

/// Whether the stage half a period after each stage of a schedule is its mirror image, in both orders.
pub(super) fn recurs_after_half_a_period(
    schedule: &[(f64, usize)],
    is_mirrored: impl Fn(usize, usize) -> bool,
) -> bool {
    let half = schedule.len() / 2;
    let recurs = |(&(begins, stage), &(later, mirror)): (&(f64, usize), &(f64, usize))| {
        (later - begins - 0.5).abs() < SAME_PHASE && is_mirrored(stage, mirror) && is_mirrored(mirror, stage)
    };
    match schedule.len() {
        0 => is_mirrored(0, 0),
        changes => changes % 2 == 0 && schedule.iter().zip(&schedule[half..]).all(recurs),
    }
}

/// Returns `exp(i phase)`.
pub(super) fn turn(phase: f64) -> Complex<f64> {
    // Half a turn changes the sign only: no rounding error adds a sine to the force.
    let (sin, cos) = if phase == std::f64::consts::PI { (0.0, -1.0) } else { phase.sin_cos() };
    Complex::new(cos, sin)
}

/// Returns a schedule of stages whose phase 0 is `phase`, in radians.
pub(super) fn schedule_at(schedule: &[(f64, usize)], phase: f64) -> Vec<(f64, usize)> {
    let turns = phase / std::f64::consts::TAU;
    // Rounding may give a whole turn.
    let later =
        |begins: f64| Some((begins - turns).rem_euclid(1.0)).filter(|&phase| phase < 1.0).unwrap_or(0.0);
    let mut schedule: Vec<_> = schedule.iter().map(|&(begins, stage)| (later(begins), stage)).collect();
    schedule.sort_by(|a, b| a.0.total_cmp(&b.0));
    schedule
}

/// Checks that phases at which stages begin are in `[0, 1)` and increase.
pub(super) fn check_phases(schedule: &[(f64, usize)]) -> Result<(), OscillatorError> {
    let mut before = f64::NEG_INFINITY;
    schedule.iter().try_for_each(|&(begins, stage)| {
        let is_allowed = (0.0..1.0).contains(&begins) && begins > before;
        before = begins;
        let quantity = || format!("phase at which stage {} begins", stage + 1);
        require(is_allowed, quantity, begins, "at least 0, less than 1, and greater than the phase before it")
    })
}

/// Returns the mirror image of a domain: the load has the opposite sign.
fn mirrored(domain: &Domain) -> Domain {
    Domain { load: domain.load.map(|value| -value), ..*domain }
}

impl Domain {
    /// Returns the symmetric part of the damping matrix, the part that does work.
    pub fn dissipation(&self) -> [[f64; 2]; 2] {
        let [[a, b], [c, d]] = self.damping;
        let mixed = if b == c { b } else { 0.5 * (b + c) };
        [[a, mixed], [mixed, d]]
    }

    /// Checks the domain of an oscillator of `degrees` degrees of freedom. `place` names it in messages.
    fn validate(&self, degrees: usize, place: &str) -> Result<(), OscillatorError> {
        for (name, matrix) in [("damping", self.damping), ("stiffness", self.stiffness)] {
            let quantity = || format!("{name} in {place}");
            matrix.as_flattened().iter().try_for_each(|&entry| finite(quantity, entry))?;
        }
        let matrix = self.stiffness;
        // The second coordinate of a single oscillator has checks of its own.
        if degrees == 2 && matrix[0][1] != matrix[1][0] {
            let quantity = format!("stiffness in {place}");
            return Err(OscillatorError::NotSymmetric { quantity, matrix });
        }
        finite(|| format!("preload in {place}"), self.preload)?;
        self.load.into_iter().try_for_each(|load| finite(|| format!("load in {place}"), load))
    }
}

/// Whether a symmetric matrix has no negative eigenvalue, except for rounding.
pub(crate) fn is_semidefinite([[a, b], [_, d]]: [[f64; 2]; 2]) -> bool {
    // Products of very large or very small entries would leave the range.
    a >= 0.0 && d >= 0.0 && a.sqrt() * d.sqrt() * (1.0 + 0.5 * MATRIX_TOLERANCE) >= b.abs()
}

/// Returns `c` if the difference of two matrices is `c row row^T`.
fn along(row: [f64; 2], matrix: [[f64; 2]; 2], less: [[f64; 2]; 2]) -> f64 {
    let square = row[0] * row[0] + row[1] * row[1];
    let product = |i: usize, j: usize| row[i] * (matrix[i][j] - less[i][j]) * row[j];
    (product(0, 0) + product(0, 1) + product(1, 0) + product(1, 1)) / (square * square)
}

pub(super) fn finite(quantity: impl Fn() -> String, value: f64) -> Result<(), OscillatorError> {
    require(value.is_finite(), quantity, value, "a finite number")
}

pub(super) fn positive(quantity: impl Fn() -> String, value: f64) -> Result<(), OscillatorError> {
    require(value.is_finite() && value > 0.0, quantity, value, "finite and greater than 0")
}

pub(super) fn require(
    is_allowed: bool,
    quantity: impl Fn() -> String,
    value: f64,
    requirement: &'static str,
) -> Result<(), OscillatorError> {
    match is_allowed {
        true => Ok(()),
        false => Err(OscillatorError::OutOfRange { quantity: quantity(), value, requirement }),
    }
}

/// The contact law: the parameters of a cell that its flow does not depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Coefficient of restitution `e`, 0 to 1, of the right and the left wall: `w+ = -e w-`. Elastic walls ignore it.
    pub restitution: [f64; 2],
    /// Leaving speed `e |w-|`, >= 0, at or below which a pressed contact with the right or left wall lasts.
    pub mesh_speed: [f64; 2],
}

impl Law {
    /// Builds a law that is the same at both walls.
    pub fn both(restitution: f64, mesh_speed: f64) -> Law {
        Law { restitution: [restitution; 2], mesh_speed: [mesh_speed; 2] }
    }

    /// Whether both walls have the same law.
    pub fn is_symmetric(&self) -> bool {
        self.restitution[0] == self.restitution[1] && self.mesh_speed[0] == self.mesh_speed[1]
    }

    /// Checks the ranges of restitution and mesh speed.
    ///
    /// # Errors
    /// [`OscillatorError::OutOfRange`] for the first check that fails.
    pub fn validate(&self) -> Result<(), OscillatorError> {
        for restitution in self.restitution {
            let is_allowed = (0.0..=1.0).contains(&restitution);
            require(is_allowed, || "restitution".to_owned(), restitution, "between 0 and 1")?;
        }
        self.mesh_speed.into_iter().try_for_each(|speed| {
            let is_allowed = speed.is_finite() && speed >= 0.0;
            require(is_allowed, || "mesh speed".to_owned(), speed, "finite and at least 0")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::GearPair;

    /// Each oscillator differs from a valid one in one entry.
    #[test]
    fn errors_name_the_quantity_and_its_value() {
        let good = GearPair::paper(0.5).oscillator().unwrap();
        assert_eq!(good.validate(), Ok(()));
        let one_wall = Oscillator { walls: [0.5, f64::NEG_INFINITY], ..good.clone() };
        assert_eq!(one_wall.validate(), Ok(()));
        let slip = |change: fn(&mut Oscillator)| {
            let mut oscillator = good.clone();
            change(&mut oscillator);
            oscillator.validate().unwrap_err().to_string()
        };
        assert_eq!(slip(|o| o.mass[1][1] = 0.0), "mass 2 = 0: it must be finite and greater than 0");
        assert_eq!(
            slip(|o| o.omega = f64::NAN),
            "excitation frequency = NaN: it must be finite and greater than 0"
        );
        assert_eq!(
            slip(|o| o.gap = [0.0; 2]),
            "the largest entry of the gap row = 0: it must be different from 0"
        );
        assert_eq!(slip(|o| o.gap[1] = f64::NAN), "entry 2 of the gap row = NaN: it must be a finite number");
        assert_eq!(slip(|o| o.degrees = 3), "degrees of freedom = 3: it must be 1 or 2");
        assert_eq!(
            slip(|o| o.degrees = 1),
            "entry 2 of the gap row = -1: it must be 0, since one degree of freedom has no second displacement"
        );
        assert_eq!(slip(|o| o.force[0] = f64::INFINITY), "force 1 = inf: it must be a finite number");
        assert_eq!(slip(|o| o.force_sin[1] = f64::NAN), "force_sin 2 = NaN: it must be a finite number");
        assert_eq!(
            slip(|o| o.walls = [-0.5, 0.5]),
            "walls at -0.5 and 0.5: the right one must lie above the left one"
        );
        assert_eq!(
            slip(|o| o.free.stiffness[0][1] = 0.1),
            "stiffness in free motion = [[30, 0.1], [0, 20]]: the matrix must be symmetric"
        );
        assert_eq!(
            slip(|o| o.free.damping[0][1] = f64::NAN),
            "damping in free motion = NaN: it must be a finite number"
        );
        assert_eq!(
            slip(|o| o.meshing[0].load[0] = f64::INFINITY),
            "load in contact with the right wall = inf: it must be a finite number"
        );
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

    #[test]
    fn law_checks_its_ranges() {
        let law = GearPair::paper(0.5).law();
        assert_eq!(law.validate(), Ok(()));
        let error = Law { restitution: [0.5, 1.5], ..law }.validate().unwrap_err();
        assert_eq!(error.to_string(), "restitution = 1.5: it must be between 0 and 1");
        assert!(Law { mesh_speed: [-1.0, 0.0], ..law }.validate().is_err());
    }

    #[test]
    fn length_scale_of_two_walls_is_half_their_distance() {
        let pair = GearPair::paper(0.5).oscillator().unwrap();
        assert_eq!(pair.length_scale(), 0.5);
        assert_eq!(Oscillator { walls: [0.7, 0.2], ..pair.clone() }.length_scale(), 0.5 * (0.7 - 0.2));
    }

    /// With `omega = 1` the supports of 30 and 20 on masses of 2 and 1 give `K + omega^2 M` of 32 and 21.
    #[test]
    fn length_scale_of_one_wall_is_the_largest_of_position_and_deflections() {
        let pair = Oscillator { omega: 1.0, ..GearPair::paper(0.5).oscillator().unwrap() };
        let with = |walls: [f64; 2], force: [f64; 2], load: [f64; 2]| {
            Oscillator { walls, force, free: Domain { load, ..pair.free }, ..pair.clone() }.length_scale()
        };
        let one = [-0.25, f64::NEG_INFINITY];
        assert_eq!(with(one, [0.0; 2], [0.0; 2]), 0.25);
        assert_eq!(with(one, [-16.0, 0.0], [0.0; 2]), 0.5);
        assert_eq!(with(one, [16.0, 0.0], [0.0, 63.0]), 3.0);
        assert_eq!(with([0.0, 0.0], [16.0, 0.0], [0.0; 2]), 0.5);
        let sine = Oscillator { walls: one, force: [12.0, 0.0], force_sin: [16.0, 0.0], ..pair.clone() };
        assert_eq!(sine.length_scale(), 0.625, "the amplitude is 20");
        assert_eq!(with([f64::INFINITY, f64::NEG_INFINITY], [0.0; 2], [0.0; 2]), LEAST_LENGTH);
    }
}
