//! A 1-DOF oscillator between stops: the second model, small enough to solve by hand.

use super::{Domain, Law, Oscillator, ParameterError, Range};

/// `m x'' + r x' + k x = F cos(omega t)` between elastic stops at `x = +b` and `x = -b`.
///
/// With `r = k = F = 0` flights are straight lines and every event is known in closed
/// form, which is what the tests use it for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// Mass, > 0.
    pub m: f64,
    /// Damping, >= 0.
    pub r: f64,
    /// Stiffness, >= 0.
    pub k: f64,
    /// Damping of a stop in lasting contact, >= 0.
    pub stop_damping: f64,
    /// Stiffness of a stop in lasting contact, >= 0.
    pub stop_stiffness: f64,
    /// Force amplitude.
    pub force: f64,
    /// Excitation frequency, > 0.
    pub omega: f64,
    /// Half distance of the stops, > 0.
    pub b: f64,
    /// Coefficient of restitution, 0 to 1.
    pub e: f64,
    /// Leaving speed at or below which a pressed contact lasts, >= 0.
    pub mesh_speed: f64,
}

impl Stops {
    /// The description that flow and reference work from; its second degree of freedom
    /// is a unit mass that nothing acts on.
    ///
    /// # Errors
    /// [`ParameterError::OutOfRange`] if a parameter is not valid.
    pub fn oscillator(&self) -> Result<Oscillator, ParameterError> {
        let checks = [
            ("m", self.m, Range::Positive),
            ("r", self.r, Range::NonNegative),
            ("k", self.k, Range::NonNegative),
            ("stop_damping", self.stop_damping, Range::NonNegative),
            ("stop_stiffness", self.stop_stiffness, Range::NonNegative),
            ("F", self.force, Range::Finite),
            ("omega", self.omega, Range::Positive),
            ("b", self.b, Range::Positive),
            ("e", self.e, Range::Unit),
            ("mesh_speed", self.mesh_speed, Range::NonNegative),
        ];
        for (name, value, range) in checks {
            if !range.contains(value) {
                return Err(ParameterError::OutOfRange { name, value, requirement: range.requirement() });
            }
        }
        let first = |value: f64| [[value, 0.0], [0.0, 0.0]];
        let stop = |sign: f64| Domain {
            damping: first(self.r + self.stop_damping),
            stiffness: first(self.k + self.stop_stiffness),
            load: [sign * self.stop_stiffness * self.b, 0.0],
        };
        Ok(Oscillator {
            masses: [self.m, 1.0],
            gap: [1.0, 0.0],
            walls: [self.b, -self.b],
            omega: self.omega,
            force: [self.force, 0.0],
            free: Domain { damping: first(self.r), stiffness: first(self.k), load: [0.0, 0.0] },
            meshing: [stop(1.0), stop(-1.0)],
        })
    }

    /// The contact law of this cell.
    pub fn law(&self) -> Law {
        Law { restitution: self.e, mesh_speed: self.mesh_speed }
    }
}
