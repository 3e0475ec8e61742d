//! The trait of all models.

use std::any::Any;
use std::fmt::Debug;

use thiserror::Error;

use super::{Law, Oscillator, OscillatorError, Parameter, ParameterError, Units};

/// An error in a model's parameters or in the oscillator that they give.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ModelError {
    /// A parameter is unknown or out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The parameters do not give a valid oscillator or contact law.
    #[error(transparent)]
    Oscillator(#[from] OscillatorError),
}

/// A model with the values of its parameters: one cell of a map.
///
/// Scenes set parameters by name; engines use the oscillator and the law. [`Parameter::shapes`] says which of the two depends on a
/// parameter, so that a map computes one flow per distinct oscillator. An implementation must be `Clone` and `PartialEq`; then `Box<dyn
/// Model>` also is.
pub trait Model: CloneModel + Debug + Send + Sync + Any {
    /// Returns the name in scenes.
    fn name(&self) -> &str;

    /// Returns the name in headings.
    fn title(&self) -> &str;

    /// Returns the publication that the model comes from, if it is known.
    fn source(&self) -> Option<&str> {
        None
    }

    /// Returns the indices of the parameters that the excitation frequency depends on.
    fn frequency(&self) -> Vec<usize> {
        self.index("omega").into_iter().collect()
    }

    /// Returns all parameters, in the order of their indices. They do not depend on the values.
    fn parameters(&self) -> &[Parameter];

    /// Returns the value of the parameter with this index.
    ///
    /// # Panics
    /// If the index is out of range.
    fn value(&self, index: usize) -> f64;

    /// Sets a value without checking the parameter's range. [`Model::set_at`] checks it.
    ///
    /// # Panics
    /// If the index is out of range.
    fn assign(&mut self, index: usize, value: f64);

    /// Returns the oscillator. It is valid as defined by [`Oscillator::validate`].
    ///
    /// # Errors
    /// [`ModelError`] if a parameter is out of its range, or the oscillator is not valid.
    fn oscillator(&self) -> Result<Oscillator, ModelError>;

    /// Returns [`Oscillator::law`] of a pair without building the oscillator, because millions of cells may have different laws. It is 0
    /// for a machine, which has a law for each wall.
    fn law(&self) -> Law;

    /// Returns the start phase: the phase of the forcing, in radians, that the oscillator has as phase 0.
    fn start_phase(&self) -> f64 {
        0.0
    }

    /// Sets the start phase. Returns false if the model has no other than 0.
    fn set_start_phase(&mut self, phase: f64) -> bool {
        phase == 0.0
    }

    /// Sets the time of a cycle without force, which is then the [period](Oscillator::on_cycle) of the oscillator. Models with a force
    /// ignore it.
    fn set_cycle_time(&mut self, _time: f64) {}

    /// Returns the names of the state's components: displacement and velocity of each degree of freedom. A model of
    /// one degree of freedom uses the first half of a [`State`](super::State); the other half is 0.
    fn state_names(&self) -> Vec<&str>;

    /// Returns the name of the moving body of each degree of freedom. The default is the displacement's name.
    fn bodies(&self) -> Vec<&str> {
        self.state_names().into_iter().step_by(2).collect()
    }

    /// Returns the units of state and time. The default has none.
    fn units(&self) -> Units {
        Units::default()
    }

    /// Returns the index of the parameter called `name`.
    ///
    /// # Errors
    /// [`ParameterError::Unknown`] if the model has no such parameter.
    fn index(&self, name: &str) -> Result<usize, ParameterError> {
        let names = || self.parameters().iter().map(|parameter| &*parameter.name);
        names().position(|known| known == name).ok_or_else(|| ParameterError::Unknown {
            name: name.to_owned(),
            known: names().collect::<Vec<_>>().join(", "),
        })
    }

    /// Returns the value of the parameter called `name`.
    ///
    /// # Errors
    /// [`ParameterError::Unknown`] if the model has no such parameter.
    fn get(&self, name: &str) -> Result<f64, ParameterError> {
        self.index(name).map(|index| self.value(index))
    }

    /// Sets the parameter called `name`.
    ///
    /// # Errors
    /// [`ParameterError::Unknown`], or [`ParameterError::OutOfRange`] with nothing changed.
    fn set(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.set_at(self.index(name)?, value)
    }

    /// Sets the parameter with this index.
    ///
    /// # Errors
    /// [`ParameterError::OutOfRange`] with nothing changed.
    ///
    /// # Panics
    /// If the index is out of range.
    fn set_at(&mut self, index: usize, value: f64) -> Result<(), ParameterError> {
        let value = self.parameters()[index].check(value)?;
        self.assign(index, value);
        Ok(())
    }

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// [`ParameterError::OutOfRange`] for the first one that fails.
    fn check(&self) -> Result<(), ParameterError> {
        let mut all = self.parameters().iter().enumerate();
        all.try_for_each(|(index, parameter)| parameter.check(self.value(index)).map(|_| ()))
    }
}

/// Clones and compares models behind a pointer. Every [`Model`] that is `Clone` and `PartialEq` implements it.
pub trait CloneModel {
    /// Clones the model into a box.
    fn clone_model(&self) -> Box<dyn Model>;

    /// Whether the other model has the same type and the same values.
    fn equals(&self, other: &dyn Model) -> bool;
}

impl<M: Model + Clone + PartialEq> CloneModel for M {
    fn clone_model(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn equals(&self, other: &dyn Model) -> bool {
        other.downcast_ref::<M>() == Some(self)
    }
}

impl dyn Model {
    /// Returns the model with the period of one of its cycles without force, or the same model without a time.
    pub fn on_cycle(&self, time: Option<f64>) -> Box<dyn Model> {
        let mut model = self.clone_model();
        time.into_iter().for_each(|time| model.set_cycle_time(time));
        model
    }

    /// Returns the model as an `M`, if it is one.
    pub fn downcast_ref<M: Model>(&self) -> Option<&M> {
        let any: &dyn Any = self;
        any.downcast_ref()
    }
}

impl Clone for Box<dyn Model> {
    fn clone(&self) -> Self {
        (**self).clone_model()
    }
}

impl PartialEq for dyn Model {
    fn eq(&self, other: &dyn Model) -> bool {
        self.equals(other)
    }
}

impl<M: Model> PartialEq<M> for dyn Model {
    fn eq(&self, other: &M) -> bool {
        self.equals(other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{GearPair, Pair, Stops};

    #[test]
    fn models_behind_pointers_are_cloned_and_compared() {
        let pair: Box<dyn Model> = Box::new(GearPair::paper(0.5));
        let mut other = pair.clone();
        assert_eq!(&pair, &other);
        other.set("k", 900.0).unwrap();
        assert_ne!(&pair, &other);
        assert_eq!(*other, GearPair { k: 900.0, ..GearPair::paper(0.5) });
        assert_eq!((other.get("k"), pair.get("k")), (Ok(900.0), Ok(1000.0)));
        let stops: Box<dyn Model> = Box::new(Stops::with_restitution(0.5));
        assert_ne!(&pair, &stops);
        assert!(stops.downcast_ref::<GearPair>().is_none());
        assert_eq!(stops.bodies(), ["x"]);
    }

    #[test]
    fn parameters_are_found_by_name_and_checked() {
        let mut stops = Stops::with_restitution(0.5);
        let unknown = stops.set("mass", 1.0).unwrap_err().to_string();
        assert!(unknown.starts_with("unknown parameter `mass`; the model has m, r, k"), "{unknown}");
        let outside = stops.set("m", 0.0).unwrap_err().to_string();
        assert_eq!(outside, "`m = 0` is out of range: it must be finite and greater than 0");
        stops.assign(0, f64::NAN);
        assert!(matches!(stops.oscillator(), Err(ModelError::Parameter(_))));
    }

    #[test]
    fn oscillator_and_law_change_with_the_parameters_that_shape_them() {
        let models: [Box<dyn Model>; 2] =
            [Box::new(GearPair::paper(0.5)), Box::new(Stops::with_restitution(0.5))];
        for model in models {
            for (index, parameter) in model.parameters().iter().enumerate() {
                let mut moved = model.clone();
                moved.set_at(index, 0.75 * model.value(index) + 0.1).unwrap();
                let name = &parameter.name;
                let [before, after] = [&model, &moved].map(|model| model.oscillator().unwrap());
                let flow = Pair::of(&before) != Pair::of(&after);
                assert_eq!(flow, parameter.shapes.oscillator(), "{name}");
                assert_eq!(moved.law() != model.law(), parameter.shapes.law(), "{name}");
                assert_eq!(after.law(), moved.law(), "{name}");
            }
        }
    }
}
