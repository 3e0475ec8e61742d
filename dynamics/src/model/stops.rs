//! An oscillator of one degree of freedom between stops, which can be solved by hand.

use super::parameter::{model, model_methods};
use super::{Contact, Domain, Law, Model, ModelError, Oscillator, Parameter, Range, Shapes};

model! {
    /// `m x'' + r x' + k x = F cos(omega t)` between elastic stops at `x = +b` and `x = -b`.
    ///
    /// With `r = k = F = 0` flights are straight lines and every event is known in closed form. Tests use that.
    Stops,
    /// Returns the model with all parameters at their defaults and restitution `e`, `0 <= e <= 1`.
    with_restitution:
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
            preload: 0.0,
        };
        let oscillator = Oscillator {
            degrees: 1,
            mass: [[self.m, 0.0], [0.0, 1.0]],
            gap: [1.0, 0.0],
            walls: [self.b, -self.b],
            contacts: [Contact::Impact; 2],
            omega: self.omega,
            force: [self.force, 0.0],
            force_sin: [0.0; 2],
            harmonics: Vec::new(),
            stages: Vec::new(),
            schedule: Vec::new(),
            outer_walls: Default::default(),
            friction: Vec::new(),
            machine: None,
            free: Domain { damping: first(self.r), stiffness: first(self.k), load: [0.0, 0.0], preload: 0.0 },
            meshing: [stop(1.0), stop(-1.0)],
        };
        oscillator.validate()?;
        Ok(oscillator)
    }
}

impl Model for Stops {
    model_methods!();

    fn name(&self) -> &str {
        "stops"
    }

    fn title(&self) -> &str {
        "Oscillator between stops"
    }

    fn state_names(&self) -> Vec<&str> {
        vec!["x", "v"]
    }
}
