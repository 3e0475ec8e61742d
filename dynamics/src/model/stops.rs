//! An oscillator of one degree of freedom between stops, which can be solved by hand.

use super::parameter::parameters;
use super::{Contact, Domain, Law, Model, ModelError, Oscillator, Parameter, Range, Shapes};

/// `m x'' + r x' + k x = F cos(omega t)` between elastic stops at `x = +b` and `x = -b`.
///
/// With `r = k = F = 0` flights are straight lines and every event is known in closed form. Tests use that.
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

parameters! { Stops:
    "m" m Some(1.0), Positive, Oscillator, "mass";
    "r" r Some(0.0), NonNegative, Oscillator, "damping";
    "k" k Some(0.0), NonNegative, Oscillator, "stiffness";
    "stop_damping" stop_damping Some(1.0), NonNegative, Oscillator, "damping of a stop";
    "stop_stiffness" stop_stiffness Some(1000.0), NonNegative, Oscillator, "stiffness of a stop";
    "F" force Some(1.0), Finite, Oscillator, "force amplitude";
    "omega" omega Some(1.0), Positive, Oscillator, "excitation frequency";
    "b" b Some(0.5), Positive, Oscillator, "half distance of the stops";
    "e" e None, Unit, Law, "coefficient of restitution";
    "mesh_speed" mesh_speed Some(0.01), NonNegative, Law, "leaving speed at which a pressed contact lasts";
}

impl Stops {
    /// All parameters.
    pub const PARAMETERS: &'static [Parameter] = TABLE;

    /// Returns the model with all parameters at their defaults and restitution `e`, `0 <= e <= 1`.
    pub fn with_restitution(e: f64) -> Stops {
        Stops {
            m: 1.0,
            r: 0.0,
            k: 0.0,
            stop_damping: 1.0,
            stop_stiffness: 1000.0,
            force: 1.0,
            omega: 1.0,
            b: 0.5,
            e,
            mesh_speed: 0.01,
        }
    }

    /// Implements [`Model::oscillator`]. The second degree of freedom is a unit mass without forces.
    ///
    /// # Errors
    /// [`ModelError`] if a parameter is out of its range, or a matrix entry overflows.
    pub fn oscillator(&self) -> Result<Oscillator, ModelError> {
        self.check()?;
        let first = |value: f64| [[value, 0.0], [0.0, 0.0]];
        let stop = |sign: f64| Domain {
            damping: first(self.r + self.stop_damping),
            stiffness: first(self.k + self.stop_stiffness),
            load: [sign * self.stop_stiffness * self.b, 0.0],
        };
        let oscillator = Oscillator {
            degrees: 1,
            mass: [[self.m, 0.0], [0.0, 1.0]],
            gap: [1.0, 0.0],
            walls: [self.b, -self.b],
            contacts: [Contact::Impact; 2],
            omega: self.omega,
            force: [self.force, 0.0],
            free: Domain { damping: first(self.r), stiffness: first(self.k), load: [0.0, 0.0] },
            meshing: [stop(1.0), stop(-1.0)],
        };
        oscillator.validate()?;
        Ok(oscillator)
    }

    /// Implements [`Model::law`].
    pub fn law(&self) -> Law {
        Law::both(self.e, self.mesh_speed)
    }
}

impl Model for Stops {
    fn name(&self) -> &str {
        "stops"
    }

    fn title(&self) -> &str {
        "Oscillator between stops"
    }

    fn parameters(&self) -> &[Parameter] {
        TABLE
    }

    fn value(&self, index: usize) -> f64 {
        *ACCESSORS[index](&mut { *self })
    }

    fn assign(&mut self, index: usize, value: f64) {
        *ACCESSORS[index](self) = value;
    }

    fn oscillator(&self) -> Result<Oscillator, ModelError> {
        self.oscillator()
    }

    fn law(&self) -> Law {
        self.law()
    }

    fn state_names(&self) -> Vec<&str> {
        vec!["x", "v"]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn with_restitution_uses_the_defaults_of_the_table() {
        let stops = Stops::with_restitution(0.5);
        for (i, parameter) in TABLE.iter().enumerate() {
            assert_eq!(stops.value(i), parameter.default.unwrap_or(0.5), "{}", parameter.name);
        }
    }
}
