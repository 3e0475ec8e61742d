//! Models as files: names, parameters and matrices in TOML, read into a [`Model`].
//!
//! `M x'' + C x' + K x = force cos(frequency t) + load` in one or two coordinates, a gap `z = g . x`, and one or two
//! walls. Entries are numbers or [expressions](crate::text::expression) in the parameters, computed in f64; nothing is
//! compiled. Reading is pure, and looks at everything: `docs/models.md` has each key.

mod builtin;
mod contact;
mod definition;
mod entry;
mod equations;
mod motion;
mod parameters;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use rattlemap_dynamics::model::{Law, Model, ModelError, Oscillator, Parameter};

pub use builtin::{BUILT_IN, DEFAULT};
pub use contact::{Wall, WallLaw, WallSpring};
pub use definition::Definition;
#[cfg(feature = "cli")]
pub(crate) use equations::factor;

use crate::text::error::SceneError;

/// A model from a file, with values of its parameters. A clone shares all but the values.
#[derive(Clone, Debug)]
pub struct FileModel {
    definition: Arc<Definition>,
    values: Vec<f64>,
}

impl FileModel {
    /// Reads a model; messages call its text `file`. Its parameters have their defaults.
    ///
    /// # Errors
    /// [`SceneError`] for the first thing that is wrong.
    pub fn parse(text: &str, file: &str) -> Result<FileModel, SceneError> {
        definition::read(text, file)
    }

    /// A model that is built into the program; none of that name.
    pub fn built_in(name: &str) -> Option<FileModel> {
        builtin::find(name).cloned()
    }

    /// All that are built in.
    pub fn all_built_in() -> Vec<FileModel> {
        BUILT_IN.iter().filter_map(|(name, _)| FileModel::built_in(name)).collect()
    }

    /// Whether it is the model that is built in under its name.
    pub fn is_built_in(&self) -> bool {
        builtin::find(self.name()).is_some_and(|own| own.definition == self.definition)
    }

    /// What the file says.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// Its equations, a line each: free motion, then what lies behind each wall.
    pub fn equations(&self) -> Vec<String> {
        equations::lines(&self.definition)
    }

    fn new(definition: Definition) -> FileModel {
        FileModel { values: definition.defaults.clone(), definition: Arc::new(definition) }
    }
}

/// Models of the same text with the same values.
impl PartialEq for FileModel {
    fn eq(&self, other: &FileModel) -> bool {
        self.values == other.values && self.definition == other.definition
    }
}

impl Model for FileModel {
    fn name(&self) -> &str {
        &self.definition.name
    }

    fn title(&self) -> &str {
        &self.definition.title
    }

    fn source(&self) -> Option<&str> {
        self.definition.source.as_deref()
    }

    fn frequency(&self) -> Vec<usize> {
        self.definition.motion.frequency.uses().to_vec()
    }

    fn parameters(&self) -> &[Parameter] {
        &self.definition.parameters
    }

    fn value(&self, index: usize) -> f64 {
        self.values[index]
    }

    fn assign(&mut self, index: usize, value: f64) {
        self.values[index] = value;
    }

    fn oscillator(&self) -> Result<Oscillator, ModelError> {
        self.check()?;
        let oscillator = self.definition.oscillator(&self.values)?;
        oscillator.validate()?;
        Ok(oscillator)
    }

    fn law(&self) -> Law {
        self.definition.law(&self.values)
    }

    fn state_names(&self) -> Vec<&str> {
        self.definition.motion.state_names().collect()
    }

    fn bodies(&self) -> Vec<&str> {
        self.definition.motion.bodies.iter().map(String::as_str).collect()
    }
}
