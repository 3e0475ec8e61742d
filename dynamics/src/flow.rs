//! The exact flow of a piecewise-linear oscillator.
//!
//! # Coordinates
//!
//! Each domain is `M x'' + C x' + K x = force cos(omega t) + load`. The flow works on
//! `q = (z, w, x, v)`: the gap `z = g . x`, its rate `w`, and the displacement that the gap row
//! weighs less, the second if both weigh alike, with its velocity. The gap is a coordinate, so a contact puts it on the wall exactly
//! and no small difference of large numbers decides an event. Together with the forcing
//! phasor and a constant it obeys an autonomous linear system
//!
//! ```text
//! a = (z, w, x, v, cos, sin, 1),     a' = G a
//! ```
//!
//! whose exponential is the whole flow, forced response included. No steady-state
//! response is ever subtracted, so resonance (damped or not) is no special case, and
//! neither are critically damped, overdamped or rigid-body modes.
//!
//! # How it is evaluated
//!
//! [`LinearFlow`] makes propagators from one Taylor table `(G h)^n / n!` for a step `h` with
//! `|G| h <= 1.6`; at order 22 the remainder is below `2e-18`. They are kept less the identity,
//! so that a short flight keeps its relative accuracy: those of `h, h/2, h/4, ...`, a few longer
//! ones made by squaring, and a fine grid from which a short series leads to any instant between.
//!
//! # Bounds on derivatives
//!
//! Every derivative `y^(n)` of a solution solves the same equations with the force
//! amplitude multiplied by `omega^n` and no load. Its energy
//! `2 E = v M v + x K x` never grows by itself, because damping only takes:
//!
//! ```text
//! sqrt(2 E_n(t + s)) <= sqrt(2 E_n(t)) + s omega^n sqrt(force M^-1 force)
//! |z^(n+1)(t + s)|   <= sqrt(g M^-1 g) sqrt(2 E_n(t + s))        (Cauchy-Schwarz)
//! ```
//!
//! That holds at resonance and without damping, costs one square root, and is tight where
//! motion is slow: a stiff meshing spring that is not excited does not shorten the step.

mod columns;
mod constrained;
mod energy;
mod expansion;
mod gap_polynomial;
mod generator;
mod linear;
mod short_flight;

use nalgebra::Matrix2;

pub(crate) use expansion::{Expansion, REACH, TERMS, turned};
pub use linear::LinearFlow;
pub(crate) use linear::{RADIUS, Step};
pub(crate) use short_flight::SHORT;

use crate::model::{Contact, Law, Model, ModelError, NonImpacting, Oscillator, Side, State};

/// Gap coordinates `(z, w, x, v)`, the last two of the displacement [`Oscillator::other`].
pub type Gap = [f64; 4];

/// Forcing phasor `(cos, sin)` of the phase `omega t`.
pub type Phasor = [f64; 2];

/// Which linear system governs the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DomainKind {
    /// Between the walls.
    Free,
    /// In lasting contact with a wall; at rest on a rigid one.
    Meshing(Side),
}

/// The exact flow of one oscillator in all three domains.
///
/// It depends on everything but the contact law, so one flow serves all cells of a map
/// that differ in restitution or meshing speed only.
#[derive(Clone, Debug)]
pub struct Flow {
    /// Forcing period `2 pi / omega`.
    pub period: f64,
    /// Excitation frequency.
    pub omega: f64,
    /// Positions of the right and the left wall, infinite where there is none.
    pub walls: [f64; 2],
    /// What distances are measured by: [`Oscillator::length_scale`].
    pub length: f64,
    /// That times the rate of free motion: what speeds are measured by.
    pub(crate) speed: f64,
    /// The largest power of two up to `omega`: velocities over it compare with displacements, and lose no bit.
    pub(crate) rate: f64,
    /// What the walls are.
    pub(crate) contacts: [Contact; 2],
    /// Change of `v` per unit of approach speed removed by the contact impulse.
    pub(crate) kick: f64,
    /// What the damper behind an elastic wall takes from `w'` and `v'` per unit of `w`.
    pub(crate) dampers: [[f64; 2]; 2],
    gap: [f64; 2],
    /// Index of the displacement beside the gap.
    other: usize,
    /// Degrees of freedom.
    pub(crate) degrees: usize,
    mass: [[f64; 2]; 2],
    symmetric: bool,
    non_impacting: Option<NonImpacting>,
    free: LinearFlow,
    meshing: [LinearFlow; 2],
}

impl Flow {
    /// Solves the oscillator of a model.
    ///
    /// # Errors
    /// As [`Flow::validate`].
    pub fn of(model: &dyn Model) -> Result<Flow, ModelError> {
        Flow::validate(model).map(|oscillator| Flow::new(&oscillator))
    }

    /// The oscillator of a model that has a flow.
    ///
    /// # Errors
    /// [`ModelError`] if the model has none, or if it or the contact law is not valid.
    pub fn validate(model: &dyn Model) -> Result<Oscillator, ModelError> {
        let oscillator = model.oscillator()?;
        oscillator.validate()?;
        model.law().validate()?;
        Ok(oscillator)
    }

    /// Solves an oscillator, which must be valid as [`Oscillator::validate`] says.
    pub fn new(oscillator: &Oscillator) -> Flow {
        let other = oscillator.other();
        let free = LinearFlow::new(oscillator, &oscillator.free);
        let compliance = oscillator.mobility(oscillator.gap);
        let pushed = oscillator.accelerations(oscillator.gap)[other];
        let kick = -pushed / compliance;
        let behind = |side: Side| match oscillator.contacts[side.index()] {
            _ if oscillator.wall(side).is_infinite() => free.clone(),
            Contact::Rigid => LinearFlow::on_rigid_wall(oscillator, kick),
            Contact::Impact | Contact::Elastic => {
                LinearFlow::new(oscillator, &oscillator.meshing[side.index()])
            }
        };
        let damper = |side: Side| {
            let damping = if oscillator.is_elastic(side) { oscillator.added(side)[1] } else { 0.0 };
            [damping * compliance, damping * pushed]
        };
        let meshing = Side::BOTH.map(behind);
        let length = oscillator.length_scale();
        Flow {
            period: oscillator.period(),
            omega: oscillator.omega,
            walls: oscillator.walls,
            length,
            speed: length * free.rate,
            rate: power_of_two(oscillator.omega),
            contacts: oscillator.contacts,
            kick,
            dampers: Side::BOTH.map(damper),
            gap: oscillator.gap,
            other,
            degrees: oscillator.degrees,
            mass: oscillator.mass,
            symmetric: oscillator.mirror_symmetric(),
            non_impacting: NonImpacting::new(oscillator).or_else(|| NonImpacting::beside_rest(oscillator)),
            free,
            meshing,
        }
    }

    /// Bytes of memory that it takes.
    pub fn bytes(&self) -> usize {
        let domains = [&self.free, &self.meshing[0], &self.meshing[1]];
        size_of::<Flow>() + domains.map(LinearFlow::heap_bytes).iter().sum::<usize>()
    }

    /// Whether `(y, t) -> (-y, t + T/2)` takes solutions to solutions: both walls are alike, and so is their law.
    pub fn mirror_symmetric(&self, law: &Law) -> bool {
        self.symmetric && law.is_symmetric()
    }

    /// The motion that never touches a wall, if there is a stable one, or does so as long as one
    /// degree of freedom is at rest.
    pub fn non_impacting(&self) -> Option<&NonImpacting> {
        self.non_impacting.as_ref()
    }

    /// The linear flow of one domain.
    #[inline]
    pub fn domain(&self, kind: DomainKind) -> &LinearFlow {
        match kind {
            DomainKind::Free => &self.free,
            DomainKind::Meshing(Side::Right) => &self.meshing[0],
            DomainKind::Meshing(Side::Left) => &self.meshing[1],
        }
    }

    /// Position of a wall.
    #[inline]
    pub fn wall(&self, side: Side) -> f64 {
        match side {
            Side::Right => self.walls[0],
            Side::Left => self.walls[1],
        }
    }

    /// Gap coordinates of a state.
    pub fn to_gap(&self, y: State) -> Gap {
        let ([g0, g1], o) = (self.gap, 2 * self.other);
        [g0 * y[0] + g1 * y[2], g0 * y[1] + g1 * y[3], y[o], y[o + 1]]
    }

    /// Gap coordinates of a tangent vector: the second displacement of one degree of freedom has none.
    pub(crate) fn tangent_to_gap(&self, [x1, v1, x2, v2]: State) -> Gap {
        self.to_gap(if self.degrees == 1 { [x1, v1, 0.0, 0.0] } else { [x1, v1, x2, v2] })
    }

    /// State from gap coordinates.
    pub fn to_state(&self, q: Gap) -> State {
        let [g0, g1] = self.gap;
        if self.other == 1 {
            [(q[0] - g1 * q[2]) / g0, (q[1] - g1 * q[3]) / g0, q[2], q[3]]
        } else {
            [q[2], q[3], (q[0] - g0 * q[2]) / g1, (q[1] - g0 * q[3]) / g1]
        }
    }

    /// Kinetic energy of a state.
    pub fn kinetic_energy(&self, y: State) -> f64 {
        let [[m1, m], [_, m2]] = self.mass;
        0.5 * (m1 * y[1] * y[1] + m2 * y[3] * y[3] + 2.0 * m * y[1] * y[3])
    }

    /// The momentum across the gap row, `M v . (-g_2, g_1)`, which an impulse along the row keeps: for two
    /// bodies that meet, `z = x1 - x2`, the sum of theirs.
    pub fn momentum(&self, y: State) -> f64 {
        let ([[m1, m], [_, m2]], [g0, g1]) = (self.mass, self.gap);
        g0 * (m2 * y[3] + m * y[1]) - g1 * (m1 * y[1] + m * y[3])
    }

    /// State after a time `tau >= 0` in one domain, starting at forcing phase `phase`
    /// (radians), whatever walls are in the way.
    pub fn propagate(&self, kind: DomainKind, y: State, phase: f64, tau: f64) -> State {
        let (sin, cos) = phase.sin_cos();
        let q = self.domain(kind).propagate(self.to_gap(y), [cos, sin], tau);
        self.to_state(q)
    }
}

/// The largest power of two up to `x > 0`: its exponent alone.
fn power_of_two(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & f64::INFINITY.to_bits())
}

/// The matrix that takes displacements to the gap and the other displacement.
fn displacement_matrix(oscillator: &Oscillator) -> Matrix2<f64> {
    let second = oscillator.other() as f64;
    Matrix2::new(oscillator.gap[0], oscillator.gap[1], 1.0 - second, second)
}
