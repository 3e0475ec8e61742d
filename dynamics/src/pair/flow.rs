//! The exact flow of a piecewise-linear oscillator.
//!
//! # Coordinates
//!
//! Each domain is `M x'' + C x' + K x = force cos(omega t) + force_sin sin(omega t) + load`. The flow uses the
//! coordinates `q = (z, w, x, v)`: the gap `z = g . x`, its rate `w`, and the displacement [`Pair::other`] with
//! its velocity. Because the gap is a coordinate, a contact puts it on the wall exactly, and no event depends on a
//! small difference of large numbers. Together with the forcing phasor and a constant, `q` obeys an autonomous linear
//! system
//!
//! ```text
//! a = (z, w, x, v, cos, sin, 1),     a' = G a
//! ```
//!
//! whose exponential is the whole flow, including the forced response. No steady-state response is subtracted, so
//! resonance needs no special case, and neither do critically damped, overdamped or rigid-body modes.
//!
//! # Evaluation
//!
//! [`LinearFlow`] computes propagators from one Taylor table `(G h)^n / n!` for a step `h` with `|G| h <= 1.6`; at
//! order 22 the remainder is below `2e-18`. Every propagator is stored minus the identity, so that short flights keep
//! their relative accuracy. Stored are the propagators of `h, h/2, h/4, ...`, of a few longer steps, and of a fine
//! grid of instants. From the grid a short series reaches any instant.
//!
//! # Bounds on derivatives
//!
//! Every derivative `y^(n)` of a solution solves the equations without load and with the force amplitude multiplied by `omega^n`. Damping
//! cannot increase its energy `2 E = v M v + x K x`, so
//!
//! ```text
//! sqrt(2 E_n(t + s)) <= sqrt(2 E_n(t)) + s omega^n sqrt(force M^-1 force + force_sin M^-1 force_sin)
//! |z^(n+1)(t + s)|   <= sqrt(g M^-1 g) sqrt(2 E_n(t + s))        (Cauchy-Schwarz)
//! ```
//!
//! Negative damping and negative stiffness multiply the right side by an exponential (`energy.rs`), and a skew-symmetric, gyroscopic
//! part of damping does no work. The bound holds at resonance and without damping, and costs one square root. It is tight for slow motion: a stiff
//! meshing spring that is not excited does not shorten the step.

mod columns;
mod constrained;
mod energy;
mod expansion;
mod few;
mod functional;
mod gap_polynomial;
mod generator;
mod linear;
mod short_flight;
mod taylor;

use nalgebra::Matrix2;

pub(crate) use expansion::{EXPANSION_REACH, Expansion, TERMS, turned};
pub(crate) use functional::PairFunctional;
pub use linear::LinearFlow;
pub(crate) use linear::Step;
pub(crate) use short_flight::LONGEST_SHORT_FLIGHT;
pub(crate) use taylor::RADIUS;

use super::PairState;
use crate::model::{Contact, Pair, RigidMode, Side};

/// Gap coordinates `(z, w, x, v)`, the last two of the displacement [`Pair::other`].
pub type Gap = [f64; 4];

/// Forcing phasor `(cos, sin)` of the phase `omega t`.
pub type Phasor = [f64; 2];

/// The linear domains of an oscillator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DomainKind {
    /// Between the walls.
    Free,
    /// In lasting contact with a wall; at rest if the wall is rigid.
    Meshing(Side),
}

/// Largest rounding error of a gap in f32, relative to the wall's position or the scale of length.
const BEHIND_WALL: f64 = 1e-5;

/// Distance of a gap that [`PairFlow::in_front`] has moved from its wall, about a rounding error of f64, in the same unit.
const IN_FRONT: f64 = 1e-15;

/// The exact flow of one pair in all three domains.
///
/// It does not depend on the contact law, so cells that differ only in restitution or meshing speed share one flow.
#[derive(Clone, Debug)]
pub struct PairFlow {
    /// Forcing period `2 pi / omega`.
    pub period: f64,
    /// Excitation frequency.
    pub omega: f64,
    /// Positions of the right and the left wall, infinite if missing.
    pub walls: [f64; 2],
    /// Scale of length, [`Pair::length_scale`].
    pub length: f64,
    /// Displacement beyond which the motion has escaped: infinite if only the force can increase the energy.
    pub escape: f64,
    pub(crate) oscillator: Pair,
    /// Scale of speed: the scale of length times the rate of free motion.
    pub(crate) speed: f64,
    /// The largest power of two up to `omega`. Velocities divided by it are comparable with displacements, and the
    /// division is exact.
    pub(crate) rate: f64,
    pub(crate) contacts: [Contact; 2],
    /// Change of `v` per unit of approach speed that the contact impulse removes.
    pub(crate) kick: f64,
    /// Decrease of `w'` and `v'` per unit of `w` by the damper behind each elastic wall.
    pub(crate) dampers: [[f64; 2]; 2],
    gap: [f64; 2],
    other: usize,
    pub(crate) degrees: usize,
    mass: [[f64; 2]; 2],
    /// Symmetric parts of the damping matrices of free motion and of contact with the right and the left wall.
    dissipation: [[[f64; 2]; 2]; 3],
    /// Stiffness and damping along the gap that each wall adds in contact.
    wall_forces: [[f64; 2]; 2],
    compliance: f64,
    free: LinearFlow,
    meshing: [LinearFlow; 2],
    /// Flows of the further stages, and the changes of the stage: time since phase 0, and the stage that begins there.
    stages: Vec<PairFlow>,
    schedule: Vec<(f64, usize)>,
    /// Changes of both displacements along the rigid-body mode, which the second displacement of the gap coordinates measures.
    pub(crate) rigid_mode: Option<[f64; 2]>,
}

impl PairFlow {
    /// Computes the flow of a pair.
    pub(crate) fn new(oscillator: &Pair) -> PairFlow {
        let mut flow = PairFlow::in_one_stage(oscillator);
        let direction = |mode: &RigidMode| [0, 1].map(|i| mode.direction[i]);
        flow.rigid_mode = oscillator.rigid_modes().modes.first().map(direction);
        if oscillator.schedule.is_empty() {
            return flow;
        }
        flow.schedule =
            oscillator.schedule.iter().map(|&(turns, stage)| (turns * flow.period, stage)).collect();
        flow.stages =
            (1..oscillator.stage_count()).map(|i| PairFlow::in_one_stage(&oscillator.in_stage(i))).collect();
        // Units are the same in all stages.
        let speed =
            flow.stages.iter().map(|stage| stage.free.rate).fold(flow.free.rate, f64::max) * flow.length;
        flow.speed = speed;
        let units = (flow.length, speed, flow.escape);
        for stage in &mut flow.stages {
            (stage.length, stage.speed, stage.escape) = units;
        }
        flow
    }

    /// Computes the flow of the first stage.
    fn in_one_stage(oscillator: &Pair) -> PairFlow {
        let other = oscillator.other();
        let free = LinearFlow::new(oscillator, &oscillator.free);
        let compliance = oscillator.mobility(oscillator.gap);
        let pushed = oscillator.accelerations(oscillator.gap)[other];
        let kick = -pushed / compliance;
        let behind = |side: Side| match oscillator.contacts[side.index()] {
            _ if oscillator.wall(side).is_infinite() => free.clone(),
            Contact::Rigid => LinearFlow::on_rigid_wall(oscillator, kick),
            _ => LinearFlow::new(oscillator, &oscillator.meshing[side.index()]),
        };
        let damper = |side: Side| {
            let damping = if oscillator.is_elastic(side) {
                oscillator.wall_stiffness_and_damping(side)[1]
            } else {
                0.0
            };
            [damping * compliance, damping * pushed]
        };
        let dissipation = |side: Side| match oscillator.contacts[side.index()] {
            Contact::Rigid => oscillator.free.dissipation(),
            _ => oscillator.meshing[side.index()].dissipation(),
        };
        let meshing = Side::BOTH.map(behind);
        let length = oscillator.length_scale();
        PairFlow {
            period: oscillator.period(),
            omega: oscillator.omega,
            walls: oscillator.walls,
            length,
            escape: oscillator.escape(),
            oscillator: oscillator.clone(),
            speed: length * free.rate,
            rate: power_of_two(oscillator.omega),
            contacts: oscillator.contacts,
            kick,
            dampers: Side::BOTH.map(damper),
            gap: oscillator.gap,
            other,
            degrees: oscillator.degrees,
            mass: oscillator.mass,
            dissipation: [oscillator.free.dissipation(), dissipation(Side::Right), dissipation(Side::Left)],
            wall_forces: Side::BOTH.map(|side| oscillator.wall_stiffness_and_damping(side)),
            compliance,
            free,
            meshing,
            stages: Vec::new(),
            schedule: Vec::new(),
            rigid_mode: None,
        }
    }

    /// Returns the longest step between the first walls and behind them, in any stage.
    pub(crate) fn longest_step(&self) -> f64 {
        let of = |flow: &PairFlow| {
            let domains = [&flow.free, &flow.meshing[0], &flow.meshing[1]];
            domains
                .map(|linear| linear.unit * 2f64.powi(linear.taylor_level as i32))
                .into_iter()
                .fold(0.0, f64::max)
        };
        self.stages.iter().map(of).fold(of(self), f64::max)
    }

    fn stage(&self, stage: usize) -> &PairFlow {
        if stage == 0 { self } else { &self.stages[stage - 1] }
    }

    /// Returns the memory that the flow occupies, in bytes.
    pub fn bytes(&self) -> usize {
        let domains = [&self.free, &self.meshing[0], &self.meshing[1]];
        let of_stages = self.stages.iter().map(PairFlow::bytes).sum::<usize>();
        size_of::<PairFlow>() + domains.map(LinearFlow::heap_bytes).iter().sum::<usize>() + of_stages
    }

    /// Returns the linear flow of one domain in the first stage.
    #[inline]
    pub fn domain(&self, kind: DomainKind) -> &LinearFlow {
        match kind {
            DomainKind::Free => &self.free,
            DomainKind::Meshing(Side::Right) => &self.meshing[0],
            DomainKind::Meshing(Side::Left) => &self.meshing[1],
        }
    }

    /// Returns the position of a wall.
    #[inline]
    pub fn wall(&self, side: Side) -> f64 {
        match side {
            Side::Right => self.walls[0],
            Side::Left => self.walls[1],
        }
    }

    /// Returns the symmetric part of the damping matrix of a domain.
    pub(crate) fn dissipation(&self, kind: DomainKind) -> [[f64; 2]; 2] {
        match kind {
            DomainKind::Free => self.dissipation[0],
            DomainKind::Meshing(side) => self.dissipation[1 + side.index()],
        }
    }

    /// Returns the stiffness and the damping, along the gap, of the contact with a wall; 0 for a rigid wall.
    pub(crate) fn wall_force(&self, side: Side) -> [f64; 2] {
        self.wall_forces[side.index()]
    }

    /// Whether motion can continue behind a wall.
    pub(crate) fn is_compliant(&self, side: Side) -> bool {
        self.contacts[side.index()] != Contact::Rigid
    }

    /// Returns `g M^-1 g`, the change of the gap's rate by a unit impulse of a contact.
    pub fn compliance(&self) -> f64 {
        self.compliance
    }

    /// Converts a state to gap coordinates.
    #[inline]
    pub fn to_gap(&self, y: PairState) -> Gap {
        let ([g0, g1], o) = (self.gap, 2 * self.other);
        [g0 * y[0] + g1 * y[2], g0 * y[1] + g1 * y[3], y[o], y[o + 1]]
    }

    /// Converts a tangent vector to gap coordinates. In one degree of freedom the second displacement is set to 0.
    pub(crate) fn tangent_to_gap(&self, u: PairState) -> Gap {
        self.to_gap(if self.degrees == 1 { [u[0], u[1], 0.0, 0.0] } else { u })
    }

    /// Converts gap coordinates to a state.
    #[inline]
    pub fn to_state(&self, q: Gap) -> PairState {
        self.displacements(q)
    }

    /// Returns both displacements and their velocities, `(x1, v1, x2, v2)`.
    #[inline]
    pub(crate) fn displacements(&self, q: Gap) -> [f64; 4] {
        let [g0, g1] = self.gap;
        if self.other == 1 {
            [(q[0] - g1 * q[2]) / g0, (q[1] - g1 * q[3]) / g0, q[2], q[3]]
        } else {
            [q[2], q[3], (q[0] - g0 * q[2]) / g1, (q[1] - g0 * q[3]) / g1]
        }
    }

    /// Moves a gap that lies behind a wall by a rounding error of f32 to the front of the wall.
    pub(crate) fn in_front(&self, y: PairState) -> PairState {
        let mut q = self.to_gap(y);
        for side in Side::BOTH {
            let (wall, sign) = (self.wall(side), side.sign());
            let unit = wall.abs().max(self.length);
            if (0.0..BEHIND_WALL * unit).contains(&(sign * (q[0] - wall))) {
                q[0] = wall - sign * IN_FRONT * unit;
                return self.to_state(q);
            }
        }
        y
    }

    /// Returns the kinetic energy of a state.
    pub fn kinetic_energy(&self, y: PairState) -> f64 {
        let [[m1, m], [_, m2]] = self.mass;
        0.5 * (m1 * y[1] * y[1] + m2 * y[3] * y[3] + 2.0 * m * y[1] * y[3])
    }

    /// Returns the momentum `M v . (-g_2, g_1)`, which impacts conserve. For two colliding bodies, `z = x1 - x2`, it
    /// is the sum of their momenta.
    pub fn momentum(&self, y: PairState) -> f64 {
        let ([[m1, m], [_, m2]], [g0, g1]) = (self.mass, self.gap);
        g0 * (m2 * y[3] + m * y[1]) - g1 * (m1 * y[1] + m * y[3])
    }

    /// Returns the state after a time `tau >= 0` in one domain of the first stage, starting at forcing phase `phase` in
    /// radians. Walls are ignored.
    pub fn propagate(&self, kind: DomainKind, y: PairState, phase: f64, tau: f64) -> PairState {
        let (sin, cos) = phase.sin_cos();
        let q = self.domain(kind).propagate(self.to_gap(y), [cos, sin], tau);
        self.to_state(q)
    }
}

/// The place of a motion in the schedule of stages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Schedule<'f> {
    /// The flow with all stages.
    pub(crate) whole: &'f PairFlow,
    /// Index of the next change.
    next: usize,
}

impl<'f> Schedule<'f> {
    /// Begins at phase 0. Also returns the flow of the stage at phase 0.
    pub(crate) fn new(whole: &'f PairFlow) -> (Schedule<'f>, &'f PairFlow) {
        let mut schedule = Schedule { whole, next: 0 };
        let flow = schedule.restart();
        (schedule, flow)
    }

    /// Resets to phase 0. Returns the flow of the stage that begins there, or else of the last stage.
    #[inline]
    pub(crate) fn restart(&mut self) -> &'f PairFlow {
        self.next = 0;
        let Some(&(_, last)) = self.whole.schedule.last() else { return self.whole };
        if self.whole.schedule[0].0 == 0.0 { self.change() } else { self.whole.stage(last) }
    }

    /// Returns the time of the next change since phase 0, if one is left in this period.
    #[inline]
    pub(crate) fn next_change(&self) -> Option<f64> {
        self.whole.schedule.get(self.next).map(|&(time, _)| time)
    }

    /// Passes the next change, and returns the flow of the stage that begins.
    pub(crate) fn change(&mut self) -> &'f PairFlow {
        self.next += 1;
        self.whole.stage(self.whole.schedule[self.next - 1].1)
    }
}

/// Returns the largest power of two up to `x > 0`.
pub(crate) fn power_of_two(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & f64::INFINITY.to_bits())
}

/// Returns the matrix that maps the displacements to the gap and [`Pair::other`].
fn displacement_matrix(oscillator: &Pair) -> Matrix2<f64> {
    let second = oscillator.other() as f64;
    Matrix2::new(oscillator.gap[0], oscillator.gap[1], 1.0 - second, second)
}

#[cfg(test)]
pub(crate) mod tests {
    use crate::model::Harmonic;

    /// Returns harmonics of order 2 and 5.
    pub(crate) fn two_harmonics() -> Vec<Harmonic> {
        let second = Harmonic { order: 2, cos: [7.0, -3.0], sin: [2.0, 1.0] };
        vec![second, Harmonic { order: 5, cos: [0.5, 2.0], sin: [-4.0, 0.3] }]
    }
}
