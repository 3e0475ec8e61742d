//! The gear pair with backlash: Table 1 and equations (11) to (13), (22) of the paper.

use super::parameter::{model, model_methods};
use super::{Contact, Domain, Law, Model, ModelError, Oscillator, Parameter, Range, Shapes};

model! {
    /// A pair of gears on damped elastic supports, meshing through a backlash `2b`.
    ///
    /// Free motion, `|z| < b` with `z = x1 - x2` (11):
    ///
    /// ```text
    /// m1 x1'' + r1 x1' + k1 x1 = F cos(omega t)
    /// m2 x2'' + r2 x2' + k2 x2 = 0
    /// ```
    ///
    /// Meshing on side `s` (12), (13) adds the contact force `r w + k (z - s b)`, `w = v1 - v2`, with opposite signs
    /// to both. All quantities are dimensionless.
    GearPair,
    /// Returns the values of Table 1 with restitution `e`, `0 <= e <= 1`.
    paper:
    "m1" m1 Some(2.0), Positive, Oscillator, "equivalent mass of gear 1";
    "m2" m2 Some(1.0), Positive, Oscillator, "equivalent mass of gear 2";
    "r1" r1 Some(0.6), NonNegative, Oscillator, "support damping of gear 1";
    "r2" r2 Some(0.6), NonNegative, Oscillator, "support damping of gear 2";
    "k1" k1 Some(30.0), NonNegative, Oscillator, "support stiffness of gear 1";
    "k2" k2 Some(20.0), NonNegative, Oscillator, "support stiffness of gear 2";
    "r" r Some(1.0), NonNegative, Oscillator, "meshing damping";
    "k" k Some(1000.0), NonNegative, Oscillator, "meshing stiffness";
    "F" force Some(50.0), Finite, Oscillator, "force amplitude on gear 1";
    "omega" omega Some(5.6), Positive, Oscillator, "excitation frequency";
    "b" b Some(0.5), Positive, Oscillator, "half backlash";
    "e" e None, Unit, Law, "coefficient of restitution";
    "mesh_speed" mesh_speed Some(0.01), NonNegative, Law, "leaving speed at which a pressed contact becomes meshing";
}

impl GearPair {
    /// Implements [`Model::oscillator`].
    ///
    /// # Errors
    /// [`ModelError`] if a parameter is out of its range, or a matrix entry overflows.
    pub fn oscillator(&self) -> Result<Oscillator, ModelError> {
        self.check()?;
        let free = Domain {
            damping: [[self.r1, 0.0], [0.0, self.r2]],
            stiffness: [[self.k1, 0.0], [0.0, self.k2]],
            load: [0.0, 0.0],
            preload: 0.0,
        };
        let meshing = |sign: f64| Domain {
            damping: [[self.r1 + self.r, -self.r], [-self.r, self.r2 + self.r]],
            stiffness: [[self.k1 + self.k, -self.k], [-self.k, self.k2 + self.k]],
            load: [sign * self.k * self.b, -sign * self.k * self.b],
            preload: 0.0,
        };
        let oscillator = Oscillator {
            degrees: 2,
            mass: [[self.m1, 0.0], [0.0, self.m2]],
            gap: [1.0, -1.0],
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
            free,
            meshing: [meshing(1.0), meshing(-1.0)],
        };
        oscillator.validate()?;
        Ok(oscillator)
    }
}

impl Model for GearPair {
    model_methods!();

    fn name(&self) -> &str {
        "gear-pair"
    }

    fn title(&self) -> &str {
        "Gear pair"
    }

    fn source(&self) -> Option<&str> {
        Some("Study on the Nonlinear Dynamic Behavior of Rattling Vibration in Gear Systems")
    }

    fn state_names(&self) -> Vec<&str> {
        vec!["x1", "v1", "x2", "v2"]
    }

    fn bodies(&self) -> Vec<&str> {
        vec!["gear 1", "gear 2"]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ParameterError;

    #[test]
    fn setting_out_of_range_changes_nothing() {
        let mut pair = GearPair::paper(0.5);
        let before = pair;
        for (name, value) in
            [("e", 1.01), ("m1", 0.0), ("b", 0.0), ("omega", -1.0), ("F", f64::NAN), ("k", f64::INFINITY)]
        {
            assert!(matches!(pair.set(name, value), Err(ParameterError::OutOfRange { .. })), "{name}");
        }
        assert_eq!(pair, before);
        assert!(matches!(pair.set("mass", 1.0), Err(ParameterError::Unknown { .. })));
    }
}
