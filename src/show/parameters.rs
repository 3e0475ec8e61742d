//! Parameters in JSON: an object with a field per parameter.

use serde::{Serialize, Serializer};

use crate::map::scene::Scene;
use rattlemap_dynamics::model::Model;

/// Names and values of parameters, in the order of the model's table.
pub struct Parameters(Vec<(String, f64)>);

impl Parameters {
    /// Returns all parameters of a model.
    pub fn of(model: &dyn Model) -> Parameters {
        let all = model.parameters().iter().enumerate();
        Parameters(all.map(|(index, p)| (p.name.to_string(), model.value(index))).collect())
    }

    /// Returns the fixed parameters of a scene.
    pub fn of_scene(scene: &Scene) -> Parameters {
        Parameters(scene.fixed().map(|(name, value)| (name.to_owned(), value)).collect())
    }
}

impl Serialize for Parameters {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}
