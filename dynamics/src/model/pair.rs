//! Pairs: the oscillators for which the fast engine has closed forms. Up to two coordinates move one gap.
//!
//! A pair is an [`Oscillator`] in another form, with one matrix for each domain. The law of restitution is not part of a pair, so that
//! cells that differ only in restitution share a flow.

use nalgebra::{Complex, DMatrix, DVector, Matrix2, Vector2};

use super::oscillator::{ESCAPE, ESCAPE_WITHOUT_SCALE, LEAST_LENGTH, MATRIX_TOLERANCE};
use super::schedule::{recurs_after_half_a_period, schedule_at, turn};
use super::{Contact, Drive, Forces, Oscillator, Side, Spring, Wall};

/// One linear domain: `M x'' + damping x' + stiffness x = force cos(omega t) + force_sin sin(omega t) + load`.
///
/// Stiffness is symmetric. Damping may have a skew-symmetric part, as gyroscopic forces do, which does no work. Negative
/// eigenvalues are allowed: energy then grows, at a rate that [`crate::pair::flow`] bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// Damping matrix.
    pub damping: [[f64; 2]; 2],
    /// Stiffness matrix.
    pub stiffness: [[f64; 2]; 2],
    /// Constant load.
    pub load: [f64; 2],
}

/// One harmonic of the force: `cos cos(order omega t) + sin sin(order omega t)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Order, 2 to [`HIGHEST_ORDER`](super::HIGHEST_ORDER).
    pub order: u32,
    /// Factor of the cosine.
    pub cos: [f64; 2],
    /// Factor of the sine.
    pub sin: [f64; 2],
}

/// The linear domains of a part of the forcing period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// Motion between the walls.
    pub free: Domain,
    /// Motion in lasting contact with the right and the left wall; ignored for rigid and missing walls.
    pub meshing: [Domain; 2],
}

/// A forced piecewise-linear oscillator of one or two degrees of freedom between two walls. Each wall may be missing.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
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
    /// Changes of the stage in a forcing period: the phase in turns, in `[0, 1)` and increasing, and the stage that begins there. The last
    /// stage lasts until the first change. Empty if there is only stage 0.
    pub schedule: Vec<(f64, usize)>,
}

impl Pair {
    /// Returns an oscillator as a pair, or nothing if only a machine can describe it ([`Oscillator::needs_machine`]).
    ///
    /// The oscillator must be valid, except that infinite numbers are allowed.
    pub fn of(oscillator: &Oscillator) -> Option<Pair> {
        if oscillator.needs_machine().is_some() {
            return None;
        }
        let (degrees, walls) = (oscillator.degrees(), &oscillator.gaps[0].walls);
        let gap = vector(&oscillator.gaps[0].row);
        let mass = mass(&oscillator.mass);
        let stage = |stage: usize| {
            let Forces { damping, stiffness, load } = &oscillator.stages[stage];
            let free = Domain { damping: matrix(damping), stiffness: matrix(stiffness), load: vector(load) };
            let meshing = walls
                .each_ref()
                .map(|walls| walls.first().map_or(free, |wall| behind(free, gap, wall, stage)));
            Stage { free, meshing }
        };
        let Stage { free, meshing } = stage(0);
        let stages = (1..oscillator.stages.len()).map(stage).collect();
        let harmonic =
            |drive: &Drive| Harmonic { order: drive.order, cos: vector(&drive.cos), sin: vector(&drive.sin) };
        let (first, further): (Vec<_>, Vec<_>) =
            oscillator.drives.iter().map(harmonic).partition(|harmonic| harmonic.order == 1);
        let first = first.first();
        Some(Pair {
            degrees,
            mass,
            gap,
            walls: Side::BOTH
                .map(|side| walls[side.index()].first().map_or(side.sign() * f64::INFINITY, |wall| wall.at)),
            contacts: walls.each_ref().map(|walls| walls.first().map_or(Contact::Rigid, |wall| wall.contact)),
            omega: oscillator.omega,
            force: first.map_or([0.0; 2], |harmonic| harmonic.cos),
            force_sin: first.map_or([0.0; 2], |harmonic| harmonic.sin),
            free,
            meshing,
            harmonics: further,
            stages,
            schedule: oscillator.schedule.clone(),
        })
    }

    /// Returns the forcing period `2 pi / omega`.
    pub fn period(&self) -> f64 {
        std::f64::consts::TAU / self.omega
    }

    /// Returns the oscillator whose phase 0 is this phase of the forcing, in radians.
    pub fn at_phase(&self, phase: f64) -> Pair {
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
        Pair { force, force_sin, harmonics, schedule, ..self.clone() }
    }

    /// Returns the number of stages, 1 or more.
    pub fn stage_count(&self) -> usize {
        1 + self.stages.len()
    }

    /// Returns the domains of a stage.
    pub fn stage(&self, stage: usize) -> Stage {
        match stage {
            0 => Stage { free: self.free, meshing: self.meshing },
            _ => self.stages[stage - 1],
        }
    }

    /// Returns the oscillator that has one of the stages at all phases.
    pub fn in_stage(&self, stage: usize) -> Pair {
        let Stage { free, meshing } = self.stage(stage);
        Pair { free, meshing, stages: Vec::new(), schedule: Vec::new(), ..self.clone() }
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
        mobility(self.mass, row)
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

    /// Whether a wall exists and motion can continue behind it.
    fn has_motion_behind(&self, side: Side) -> bool {
        self.wall(side).is_finite() && self.contacts[side.index()] != Contact::Rigid
    }

    /// Whether a wall exists and is elastic.
    pub(crate) fn is_elastic(&self, side: Side) -> bool {
        self.wall(side).is_finite() && self.contacts[side.index()].is_elastic()
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

    /// Returns the displacement beyond which the motion counts as escaped. It is infinite if only the force can increase the energy.
    pub fn escape(&self) -> f64 {
        let mut domains = self.domains();
        // Changes of the stage can do work: parametric resonance.
        let grows = !self.stages.is_empty() || domains.any(|domain| self.growth_rate(domain) > 0.0);
        // The distance between walls may be much smaller than their positions or than the motion of other coordinates.
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
        behind.map(|side| &self.meshing[side.index()]).chain([&self.free])
    }

    /// Returns the length, > 0, that tolerances on distances are relative to.
    ///
    /// It is half the distance of the walls. If a wall is missing or both coincide, it is
    ///
    /// ```text
    /// max(|wall|, |D force|, |D load|),   D = (|K| + omega^2 M)^-1
    /// ```
    ///
    /// over the existing walls and both displacements, with [`|K|`](Self::energy_stiffness) and `load` of free motion. `|D force|` is the
    /// amplitude of the forced deflection without the effects of resonance and damping. `D load` is the static deflection; if the spring is
    /// soft or missing, it is the distance by which the load moves a mass in one radian of the forcing. The scale is finite for every
    /// oscillator.
    ///
    /// A factor on `walls`, the force and `load` that is a power of two multiplies the scale exactly. A change of the
    /// unit of time does not change it.
    pub fn length_scale(&self) -> f64 {
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
        walls.chain(deflections).fold(LEAST_LENGTH, f64::max)
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
        // `i` and `j` are stages half a period apart.
        let is_mirrored = |i: usize, j: usize| {
            let (a, b) = (self.stage(i), self.stage(j));
            a.free == mirrored(&b.free)
                && (!self.has_motion_behind(Side::Right) || a.meshing[0] == mirrored(&b.meshing[1]))
        };
        self.walls[0] == -self.walls[1]
            && self.contacts[0] == self.contacts[1]
            && self.harmonics.iter().all(|harmonic| harmonic.order % 2 == 1)
            && recurs_after_half_a_period(&self.schedule, is_mirrored)
    }
}

/// Returns the domain behind a wall, given free motion.
fn behind(free: Domain, gap: [f64; 2], wall: &Wall, stage: usize) -> Domain {
    if wall.contact == Contact::Rigid {
        return free;
    }
    let Spring { stiffness, damping, .. } = wall.springs[stage];
    let constant = stiffness * wall.at;
    let along = |matrix: [[f64; 2]; 2], k: f64| {
        // The product of the gap entries comes first, so that the matrix is exactly symmetric.
        let entry = |i: usize, j: usize| plus(matrix[i][j], k * (gap[i] * gap[j]));
        [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
    };
    Domain {
        damping: along(free.damping, damping),
        stiffness: along(free.stiffness, stiffness),
        load: [plus(free.load[0], constant * gap[0]), plus(free.load[1], constant * gap[1])],
    }
}

/// Returns `row M^-1 row`.
pub(super) fn mobility([[m1, m], [_, m2]]: [[f64; 2]; 2], [r1, r2]: [f64; 2]) -> f64 {
    if m == 0.0 {
        return r1 * r1 / m1 + r2 * r2 / m2;
    }
    let share = m / m1;
    let rest = r2 - share * r1;
    r1 * r1 / m1 + rest * rest / (m2 - share * m)
}

/// Adds two numbers. If `a` is 0, `b` keeps its sign, even if it is 0.
fn plus(a: f64, b: f64) -> f64 {
    if a == 0.0 { b } else { a + b }
}

/// Returns the mass matrix of one or two coordinates. A missing second coordinate gets the mass 1, so that the matrix has an inverse.
pub(super) fn mass(of: &DMatrix<f64>) -> [[f64; 2]; 2] {
    let mut mass = matrix(of);
    if of.nrows() == 1 {
        mass[1][1] = 1.0;
    }
    mass
}

/// Returns a matrix of one or two rows; entries that do not exist are 0.
fn matrix(of: &DMatrix<f64>) -> [[f64; 2]; 2] {
    let entry = |i: usize, j: usize| of.get((i, j)).copied().unwrap_or(0.0);
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

/// Returns a vector of one or two entries; a missing entry is 0.
pub(super) fn vector(of: &DVector<f64>) -> [f64; 2] {
    [0, 1].map(|i| of.get(i).copied().unwrap_or(0.0))
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

/// An oscillator in the form that its engine takes.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "short-lived; pairs must stay cheap to make")]
pub enum Form {
    /// For the fast engine, [`crate::pair`].
    Pair(Pair),
    /// For the general engine, [`crate::machine`].
    Machine(Oscillator),
}

impl Form {
    /// Returns the form whose period is the [time of a cycle](Oscillator::on_cycle).
    #[must_use]
    pub fn on_cycle(self, time: Option<f64>) -> Form {
        match self {
            Form::Machine(machine) => Form::Machine(machine.on_cycle(time)),
            pair @ Form::Pair(_) => pair,
        }
    }
}

impl From<&Oscillator> for Form {
    fn from(oscillator: &Oscillator) -> Form {
        Pair::of(oscillator).map_or_else(|| Form::Machine(oscillator.clone()), Form::Pair)
    }
}

impl From<&Pair> for Form {
    fn from(pair: &Pair) -> Form {
        Form::Pair(pair.clone())
    }
}

impl From<&Form> for Form {
    fn from(form: &Form) -> Form {
        form.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{DryFriction, GearPair, Restitution};

    /// The structure that a model's file states decides the engine; values do not.
    #[test]
    fn structure_decides_between_pair_and_machine() {
        let pair = GearPair::paper(0.5).oscillator().unwrap();
        assert!(pair.needs_machine().is_none());
        let row = pair.gaps[0].row.clone();
        let friction = vec![DryFriction::new(row, 0.0, 0.0)];
        let mut rubbing = Oscillator { friction, ..pair.clone() };
        assert_eq!((Pair::of(&rubbing), rubbing.needs_machine()), (None, Some("dry friction")));
        rubbing.friction.clear();
        assert_eq!(Pair::of(&rubbing), Pair::of(&pair));
        let mut by_speed = pair.clone();
        by_speed.gaps[0].walls[1][0].restitution =
            Restitution::BySpeed { constant: 0.5, factor: 0.0, power: 1.0 };
        assert_eq!(by_speed.needs_machine(), Some("restitution that depends on the approach speed"));
        assert!(matches!(Form::from(&by_speed), Form::Machine(_)));
    }

    #[test]
    fn length_scale_of_two_walls_is_half_their_distance() {
        let pair = GearPair::paper(0.5).pair();
        assert_eq!(pair.length_scale(), 0.5);
        assert_eq!(Pair { walls: [0.7, 0.2], ..pair.clone() }.length_scale(), 0.5 * (0.7 - 0.2));
    }

    /// With `omega = 1` the supports of 30 and 20 on masses of 2 and 1 give `K + omega^2 M` of 32 and 21.
    #[test]
    fn length_scale_of_one_wall_is_the_largest_of_position_and_deflections() {
        let pair = Pair { omega: 1.0, ..GearPair::paper(0.5).pair() };
        let with = |walls: [f64; 2], force: [f64; 2], load: [f64; 2]| {
            Pair { walls, force, free: Domain { load, ..pair.free }, ..pair.clone() }.length_scale()
        };
        let one = [-0.25, f64::NEG_INFINITY];
        assert_eq!(with(one, [0.0; 2], [0.0; 2]), 0.25);
        assert_eq!(with(one, [-16.0, 0.0], [0.0; 2]), 0.5);
        assert_eq!(with(one, [16.0, 0.0], [0.0, 63.0]), 3.0);
        assert_eq!(with([0.0, 0.0], [16.0, 0.0], [0.0; 2]), 0.5);
        let sine = Pair { walls: one, force: [12.0, 0.0], force_sin: [16.0, 0.0], ..pair.clone() };
        assert_eq!(sine.length_scale(), 0.625, "the amplitude is 20");
        assert_eq!(with([f64::INFINITY, f64::NEG_INFINITY], [0.0; 2], [0.0; 2]), LEAST_LENGTH);
    }
}
