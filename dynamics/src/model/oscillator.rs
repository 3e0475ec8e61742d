//! What every model returns: masses, domains, walls.

use thiserror::Error;

/// How far rounding may take a semidefinite matrix from being one, relative to its entries.
const ROUNDING: f64 = 1e-12;

/// Why a description is no oscillator, or no contact law.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum OscillatorError {
    /// A number that is not among those allowed.
    #[error("{quantity} = {value}: it must be {requirement}")]
    OutOfRange {
        /// What the number is.
        quantity: String,
        /// The number.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// Walls that leave no room between them.
    #[error("walls at {} and {}: the right one must lie above the left one", .walls[0], .walls[1])]
    Walls {
        /// Positions of the right and the left wall.
        walls: [f64; 2],
    },
    /// A damping or stiffness matrix that is not its own transpose.
    #[error("{quantity} = {matrix:?}: the matrix must be symmetric")]
    NotSymmetric {
        /// Which matrix it is.
        quantity: String,
        /// The matrix.
        matrix: [[f64; 2]; 2],
    },
    /// A mass matrix by which some motion has no inertia.
    #[error("mass = {matrix:?}: the matrix must be positive definite")]
    NotDefinite {
        /// The matrix.
        matrix: [[f64; 2]; 2],
    },
    /// A damping or stiffness matrix by which motion gains energy.
    #[error("{quantity} = {matrix:?}: the matrix must be positive semidefinite")]
    NotSemidefinite {
        /// Which matrix it is.
        quantity: String,
        /// The matrix.
        matrix: [[f64; 2]; 2],
    },
}

/// One linear domain: `M x'' + damping x' + stiffness x = force cos(omega t) + load`.
///
/// Damping and stiffness are symmetric and positive semidefinite: the energy bounds of
/// the event certificate rest on that (see [`crate::flow`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// Damping matrix.
    pub damping: [[f64; 2]; 2],
    /// Stiffness matrix.
    pub stiffness: [[f64; 2]; 2],
    /// Constant load.
    pub load: [f64; 2],
}

/// The least scale of length: what acts on nothing and reaches nowhere still gets one above zero.
const LEAST_LENGTH: f64 = 1e-150;

/// What a wall is to a motion that reaches it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// An impact, `w+ = -e w-`; a pressed contact that leaves slowly enough lasts, and moves on a
    /// spring and a damper behind the wall.
    Impact,
    /// An impact on a wall that does not yield: a pressed contact that has come to rest sticks to it
    /// until the load pulls it off. The motion behind it is not asked for.
    Rigid,
    /// No impact: the motion goes on behind the wall at once, its state continuous.
    Elastic,
}

/// A forced piecewise-linear oscillator of up to two degrees of freedom between two walls, of which
/// either may be missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillator {
    /// Degrees of freedom: 2, or 1 where the second displacement does not exist. Then it has a mass of 1,
    /// nothing acts on it, no gap sees it, and its state is 0.
    pub degrees: usize,
    /// Mass matrix, symmetric and positive definite.
    pub mass: [[f64; 2]; 2],
    /// Row `g` of the gap `z = g . x`; its first entry is not zero.
    pub gap: [f64; 2],
    /// Positions `z` of the right (upper) and left (lower) wall; `+inf` or `-inf` where there is none,
    /// and then nothing asks for the motion behind it.
    pub walls: [f64; 2],
    /// What the right and the left wall are; of no meaning where there is none.
    pub contacts: [Contact; 2],
    /// Excitation frequency, > 0.
    pub omega: f64,
    /// Amplitude of the harmonic force `force cos(omega t)`, the same in every domain.
    pub force: [f64; 2],
    /// Motion between the walls.
    pub free: Domain,
    /// Motion in lasting contact with the right and with the left wall; of no meaning behind a rigid one.
    pub meshing: [Domain; 2],
}

impl Oscillator {
    /// The forcing period `2 pi / omega`.
    pub fn period(&self) -> f64 {
        std::f64::consts::TAU / self.omega
    }

    /// The diagonal of the mass matrix.
    pub fn masses(&self) -> [f64; 2] {
        [self.mass[0][0], self.mass[1][1]]
    }

    /// Checks everything that flow and reference rest on.
    ///
    /// # Errors
    /// [`OscillatorError`] for the first thing that is wrong.
    pub fn validate(&self) -> Result<(), OscillatorError> {
        let [[m1, m], [other, m2]] = self.mass;
        for (i, mass) in [m1, m2].into_iter().enumerate() {
            positive(|| format!("mass {}", i + 1), mass)?;
        }
        if m != other {
            return Err(OscillatorError::NotSymmetric { quantity: "mass".to_owned(), matrix: self.mass });
        }
        if m != 0.0 && !(m1 * m2 > m * m) {
            return Err(OscillatorError::NotDefinite { matrix: self.mass });
        }
        positive(|| "omega".to_owned(), self.omega)?;
        for (i, entry) in self.gap.into_iter().enumerate() {
            let is_allowed = entry.is_finite() && (i > 0 || entry != 0.0);
            let requirement = if i == 0 { "finite and not 0" } else { "a finite number" };
            require(is_allowed, || format!("entry {} of the gap row", i + 1), entry, requirement)?;
        }
        for (i, force) in self.force.into_iter().enumerate() {
            finite(|| format!("force {}", i + 1), force)?;
        }
        // A wall at infinity is none.
        let [right, left] = self.walls;
        let are_apart = right > left && right > f64::NEG_INFINITY && left < f64::INFINITY;
        if !are_apart {
            return Err(OscillatorError::Walls { walls: self.walls });
        }
        self.free.validate("free motion")?;
        self.meshing[0].validate("contact with the right wall")?;
        self.meshing[1].validate("contact with the left wall")
    }

    /// What distances are measured by, > 0: half the walls' distance, or where a wall is missing or
    /// both coincide
    ///
    /// ```text
    /// max(|wall|, |D force|, |D load|),   D = (K + omega^2 M)^-1
    /// ```
    ///
    /// over the walls there are and both displacements, with `K` and `load` of free motion. `D force`
    /// is the size of the forced deflection without what resonance or damping make of it, and `D load`
    /// that of the static deflection, or of how far the load moves a soft spring or none in a radian of
    /// the forcing. So it is finite for any oscillator.
    ///
    /// It follows every change of units: `walls`, `force` and `load` times a power of two multiply it
    /// by that number to the bit, and a change of the unit of time leaves it alone.
    pub fn length_scale(&self) -> f64 {
        let [right, left] = self.walls;
        let half = 0.5 * (right - left);
        if half.is_finite() && half > 0.0 {
            return half;
        }
        let deflections = [self.force, self.free.load].map(|force| self.deflection(force));
        let walls = self.walls.map(f64::abs).into_iter().filter(|wall| wall.is_finite());
        walls.chain(deflections).fold(LEAST_LENGTH, f64::max)
    }

    /// The largest displacement of `(K + omega^2 M)^-1 force`.
    fn deflection(&self, force: [f64; 2]) -> f64 {
        let [[k1, k], [_, k2]] = self.free.stiffness;
        let [a, b] = self.masses().map(|m| m * self.omega * self.omega);
        let (a, b) = (a + k1, b + k2);
        let determinant = a * b - k * k;
        let [f1, f2] = force;
        ((b * f1 - k * f2) / determinant).abs().max(((a * f2 - k * f1) / determinant).abs())
    }

    /// Whether the walls and what lies behind them are mirror images of each other, so that
    /// `(y, t) -> (-y, t + T/2)` takes solutions to solutions.
    pub fn mirror_symmetric(&self) -> bool {
        let mirrored = |domain: &Domain| Domain { load: domain.load.map(|value| -value), ..*domain };
        self.walls[0] == -self.walls[1]
            && self.contacts[0] == self.contacts[1]
            && self.free == mirrored(&self.free)
            && self.meshing[0] == mirrored(&self.meshing[1])
    }
}

impl Domain {
    fn validate(&self, place: &str) -> Result<(), OscillatorError> {
        for (name, matrix) in [("damping", self.damping), ("stiffness", self.stiffness)] {
            let quantity = || format!("{name} in {place}");
            matrix.as_flattened().iter().try_for_each(|&entry| finite(quantity, entry))?;
            let [[a, b], [c, d]] = matrix;
            if b != c {
                return Err(OscillatorError::NotSymmetric { quantity: quantity(), matrix });
            }
            // Products may overflow, which is no harm.
            if !(a >= 0.0 && d >= 0.0 && a * d * (1.0 + ROUNDING) >= b * b) {
                return Err(OscillatorError::NotSemidefinite { quantity: quantity(), matrix });
            }
        }
        self.load.into_iter().try_for_each(|load| finite(|| format!("load in {place}"), load))
    }
}

fn finite(quantity: impl Fn() -> String, value: f64) -> Result<(), OscillatorError> {
    require(value.is_finite(), quantity, value, "a finite number")
}

fn positive(quantity: impl Fn() -> String, value: f64) -> Result<(), OscillatorError> {
    require(value.is_finite() && value > 0.0, quantity, value, "finite and greater than 0")
}

fn require(
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

/// What happens at a wall: all that a cell needs beside its flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Coefficient of restitution `e`, 0 to 1, of the right and of the left wall: `w+ = -e w-`.
    /// Elastic contact has none.
    pub restitution: [f64; 2],
    /// Leaving speed `e |w-|` at or below which a pressed contact lasts, >= 0, likewise.
    pub mesh_speed: [f64; 2],
}

impl Law {
    /// The same law at both walls.
    pub fn both(restitution: f64, mesh_speed: f64) -> Law {
        Law { restitution: [restitution; 2], mesh_speed: [mesh_speed; 2] }
    }

    /// Whether both walls have the same.
    pub fn is_symmetric(&self) -> bool {
        self.restitution[0] == self.restitution[1] && self.mesh_speed[0] == self.mesh_speed[1]
    }

    /// Checks both numbers.
    ///
    /// # Errors
    /// [`OscillatorError::OutOfRange`] for the first that is wrong.
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

    /// Each of these is one slip away from a valid description.
    #[test]
    fn what_is_wrong_is_named_with_its_value() {
        let good = GearPair::paper(0.5).oscillator().unwrap();
        assert_eq!(good.validate(), Ok(()));
        let one_wall = Oscillator { walls: [0.5, f64::NEG_INFINITY], ..good };
        assert_eq!(one_wall.validate(), Ok(()));
        let slip = |change: fn(&mut Oscillator)| {
            let mut oscillator = good;
            change(&mut oscillator);
            oscillator.validate().unwrap_err().to_string()
        };
        assert_eq!(slip(|o| o.mass[1][1] = 0.0), "mass 2 = 0: it must be finite and greater than 0");
        assert_eq!(slip(|o| o.omega = f64::NAN), "omega = NaN: it must be finite and greater than 0");
        assert_eq!(slip(|o| o.gap[0] = 0.0), "entry 1 of the gap row = 0: it must be finite and not 0");
        assert_eq!(slip(|o| o.force[0] = f64::INFINITY), "force 1 = inf: it must be a finite number");
        assert_eq!(
            slip(|o| o.walls = [-0.5, 0.5]),
            "walls at -0.5 and 0.5: the right one must lie above the left one"
        );
        assert_eq!(
            slip(|o| o.free.damping[0][1] = 0.1),
            "damping in free motion = [[0.6, 0.1], [0.0, 0.6]]: the matrix must be symmetric"
        );
        assert_eq!(
            slip(|o| o.meshing[1].stiffness = [[1.0, 2.0], [2.0, 1.0]]),
            "stiffness in contact with the left wall = [[1.0, 2.0], [2.0, 1.0]]: the matrix must be positive \
             semidefinite"
        );
        assert_eq!(
            slip(|o| o.meshing[0].load[0] = f64::INFINITY),
            "load in contact with the right wall = inf: it must be a finite number"
        );
    }

    /// Matrices without support are singular, and rounding must not make them wrong.
    #[test]
    fn singular_matrices_are_allowed_at_every_size() {
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
    fn laws_are_checked() {
        let law = GearPair::paper(0.5).law();
        assert_eq!(law.validate(), Ok(()));
        let error = Law { restitution: [0.5, 1.5], ..law }.validate().unwrap_err();
        assert_eq!(error.to_string(), "restitution = 1.5: it must be between 0 and 1");
        assert!(Law { mesh_speed: [-1.0, 0.0], ..law }.validate().is_err());
    }

    #[test]
    fn a_gap_is_measured_by_half_its_width() {
        let pair = GearPair::paper(0.5).oscillator().unwrap();
        assert_eq!(pair.length_scale(), 0.5);
        assert_eq!(Oscillator { walls: [0.7, 0.2], ..pair }.length_scale(), 0.5 * (0.7 - 0.2));
    }

    /// Supports of 30 and 20 on masses of 2 and 1: with `omega = 1`, 32 and 21.
    #[test]
    fn one_wall_is_measured_by_where_it_is_and_what_acts() {
        let pair = Oscillator { omega: 1.0, ..GearPair::paper(0.5).oscillator().unwrap() };
        let with = |walls: [f64; 2], force: [f64; 2], load: [f64; 2]| {
            Oscillator { walls, force, free: Domain { load, ..pair.free }, ..pair }.length_scale()
        };
        let one = [-0.25, f64::NEG_INFINITY];
        assert_eq!(with(one, [0.0; 2], [0.0; 2]), 0.25);
        assert_eq!(with(one, [-16.0, 0.0], [0.0; 2]), 0.5);
        assert_eq!(with(one, [16.0, 0.0], [0.0, 63.0]), 3.0);
        assert_eq!(with([0.0, 0.0], [16.0, 0.0], [0.0; 2]), 0.5);
        assert_eq!(with([f64::INFINITY, f64::NEG_INFINITY], [0.0; 2], [0.0; 2]), LEAST_LENGTH);
    }
}
