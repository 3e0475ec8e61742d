//! The gear pair with backlash: Table 1 and equations (11) to (13), (22) of the paper.

use nalgebra::{DMatrix, DVector};

use super::parameter::{model, model_methods};
use super::{
    Contact, Drive, Forces, GapRow, Law, Model, ModelError, Oscillator, Parameter, Range, Restitution,
    Shapes, Spring, Timing, Wall,
};

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
        let spring = Spring { stiffness: self.k, damping: self.r, preload: None };
        let wall = |at: f64| Wall {
            at,
            contact: Contact::Impact,
            restitution: Restitution::Constant(self.e),
            mesh_speed: self.mesh_speed,
            springs: vec![spring],
        };
        let of = |first: f64, second: f64| DVector::from_vec(vec![first, second]);
        let diagonal = |first: f64, second: f64| DMatrix::from_diagonal(&of(first, second));
        let oscillator = Oscillator {
            omega: self.omega,
            mass: diagonal(self.m1, self.m2),
            stages: vec![Forces {
                damping: diagonal(self.r1, self.r2),
                stiffness: diagonal(self.k1, self.k2),
                load: of(0.0, 0.0),
            }],
            schedule: Vec::new(),
            drives: vec![Drive { order: 1, cos: of(self.force, 0.0), sin: of(0.0, 0.0) }],
            gaps: vec![GapRow { row: of(1.0, -1.0), walls: [vec![wall(self.b)], vec![wall(-self.b)]] }],
            friction: Vec::new(),
            springs: Vec::new(),
            signals: Vec::new(),
            timing: Timing::Forced,
        };
        oscillator.validate()?;
        Ok(oscillator)
    }

    /// Returns the form for the fast engine.
    #[cfg(test)]
    pub(crate) fn pair(&self) -> super::Pair {
        super::Pair::of(&self.oscillator().unwrap()).unwrap()
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
