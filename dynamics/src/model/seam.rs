//! What every model can be asked.

use std::any::Any;
use std::fmt::Debug;

use thiserror::Error;

use super::{Law, Oscillator, OscillatorError, Parameter, ParameterError};

/// Why a model has no motion.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ModelError {
    /// A parameter is not one that the model can have.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The parameters do not make an oscillator.
    #[error(transparent)]
    Oscillator(#[from] OscillatorError),
}

/// A model with the values of its parameters: one cell of a map.
///
/// Scenes set parameters by name; the engine gets an oscillator and a law. Each parameter says
/// which of the two it [shapes](super::Shapes): a map derives one flow per distinct oscillator.
/// What implements it must be `Clone` and `PartialEq`, and is `Clone` and `PartialEq` behind a
/// `Box<dyn Model>`, too.
pub trait Model: Boxed + Debug + Send + Sync + Any {
    /// The name in scenes.
    fn name(&self) -> &str;

    /// The name in headings.
    fn title(&self) -> &str;

    /// What the model is taken from; none where nothing is said.
    fn source(&self) -> Option<&str> {
        None
    }

    /// The parameters that the excitation frequency depends on, by index: without them a time has no scale.
    fn frequency(&self) -> Vec<usize> {
        self.index("omega").into_iter().collect()
    }

    /// Every parameter, in the order of files and of indices; the same for all values.
    fn parameters(&self) -> &[Parameter];

    /// The value of the parameter with this index.
    ///
    /// # Panics
    /// If there is none of this index.
    fn value(&self, index: usize) -> f64;

    /// Takes a value whatever the parameter's range; [`Model::set_at`] looks at that.
    ///
    /// # Panics
    /// If there is none of this index.
    fn assign(&mut self, index: usize, value: f64);

    /// The description that flow and reference work from, valid as [`Oscillator::validate`] says.
    ///
    /// # Errors
    /// [`ModelError`] if a parameter is out of its range, or what they make together is no oscillator.
    fn oscillator(&self) -> Result<Oscillator, ModelError>;

    /// The contact law: what an oscillator does not fix.
    fn law(&self) -> Law;

    /// Names of the state's components: displacement and velocity of each degree of freedom, one or two.
    /// A model of one has the first half of a [`State`](super::State); the other half stays 0.
    fn state_names(&self) -> Vec<&str>;

    /// What moves, one name per degree of freedom; the displacements' names unless told.
    fn bodies(&self) -> Vec<&str> {
        self.state_names().into_iter().step_by(2).collect()
    }

    /// The index of the parameter called `name`.
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

    /// The value of the parameter called `name`.
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
    /// If there is none of this index.
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

/// Models behind a pointer, cloned and compared. Every [`Model`] that is `Clone` and `PartialEq` has it.
pub trait Boxed {
    /// The same model in a box of its own.
    fn boxed(&self) -> Box<dyn Model>;

    /// Whether the other is of the same kind and has the same values.
    fn equals(&self, other: &dyn Model) -> bool;
}

impl<M: Model + Clone + PartialEq> Boxed for M {
    fn boxed(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn equals(&self, other: &dyn Model) -> bool {
        other.downcast_ref::<M>() == Some(self)
    }
}

impl dyn Model {
    /// The model as what it is, if it is an `M`.
    pub fn downcast_ref<M: Model>(&self) -> Option<&M> {
        let any: &dyn Any = self;
        any.downcast_ref()
    }
}

impl Clone for Box<dyn Model> {
    fn clone(&self) -> Self {
        (**self).boxed()
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
    use crate::model::{GearPair, Stops};

    #[test]
    fn boxes_are_cloned_and_compared() {
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

    /// The parameters that shape the law are those that leave the oscillator alone, and the other way round.
    #[test]
    fn the_table_says_what_each_parameter_shapes() {
        let models: [Box<dyn Model>; 2] =
            [Box::new(GearPair::paper(0.5)), Box::new(Stops::with_restitution(0.5))];
        for model in models {
            for (index, parameter) in model.parameters().iter().enumerate() {
                let mut moved = model.clone();
                moved.set_at(index, 0.75 * model.value(index) + 0.1).unwrap();
                let name = &parameter.name;
                let oscillator = moved.oscillator().unwrap() != model.oscillator().unwrap();
                assert_eq!(oscillator, parameter.shapes.oscillator(), "{name}");
                assert_eq!(moved.law() != model.law(), parameter.shapes.law(), "{name}");
            }
        }
    }
}
