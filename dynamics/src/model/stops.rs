//! An oscillator of one degree of freedom between stops, which can be solved by hand.

use nalgebra::{DMatrix, DVector};

use super::parameter::{model, model_methods};
use super::{
    Contact, Drive, Forces, GapRow, Law, Model, ModelError, Oscillator, Parameter, Range, Restitution,
    Shapes, Spring, Timing, Wall,
};

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
    /// Implements [`Model::oscillator`].
    ///
    /// # Errors
    /// [`ModelError`] if a parameter is out of its range, or a matrix entry overflows.
    pub fn oscillator(&self) -> Result<Oscillator, ModelError> {
        self.check()?;
        let spring = Spring { stiffness: self.stop_stiffness, damping: self.stop_damping, preload: None };
        let wall = |at: f64| Wall {
            at,
            contact: Contact::Impact,
            restitution: Restitution::Constant(self.e),
            mesh_speed: self.mesh_speed,
            springs: vec![spring],
        };
        let (row, matrix) = (|x: f64| DVector::from_element(1, x), |x: f64| DMatrix::from_element(1, 1, x));
        let oscillator = Oscillator {
            omega: self.omega,
            mass: matrix(self.m),
            stages: vec![Forces { damping: matrix(self.r), stiffness: matrix(self.k), load: row(0.0) }],
            schedule: Vec::new(),
            drives: vec![Drive { order: 1, cos: row(self.force), sin: row(0.0) }],
            gaps: vec![GapRow { row: row(1.0), walls: [vec![wall(self.b)], vec![wall(-self.b)]] }],
            friction: Vec::new(),
            springs: Vec::new(),
            signals: Vec::new(),
            timing: Timing::Forced,
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
