//! A gear pair's parameters in JSON: one object, a field per parameter.

use serde::{Serialize, Serializer};

use crate::model::GearPair;
use crate::scene::Scene;

/// Every parameter by name, in the order of Table 1.
pub(crate) struct Parameters {
    pair: GearPair,
    /// Parameters to leave out because they are swept.
    except: Vec<&'static str>,
}

impl Parameters {
    /// All parameters of a gear pair.
    pub(crate) fn of(pair: &GearPair) -> Parameters {
        Parameters { pair: *pair, except: Vec::new() }
    }

    /// Those of a scene that no axis sweeps.
    pub(super) fn of_scene(scene: &Scene) -> Parameters {
        let swept = scene.axes().iter().map(|axis| axis.parameter().name);
        Parameters { pair: scene.base(), except: swept.collect() }
    }
}

impl Serialize for Parameters {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let named = GearPair::PARAMETERS.iter().filter(|p| !self.except.contains(&p.name));
        serializer.collect_map(named.map(|p| (p.name, self.pair.get(p.name).ok())))
    }
}
