//! The command that replays one cell of a map.

use crate::model::GearPair;
use crate::orbit::Settings;
use crate::scene::{Scene, Start};

/// What follows the two `--set` of the axes: parameters that differ from `orbit`'s own
/// defaults, the start, and how long to integrate.
pub(super) fn arguments(scene: &Scene) -> String {
    let mut words = Vec::new();
    let base = scene.base();
    for parameter in GearPair::PARAMETERS {
        let swept = scene.axes().iter().any(|axis| axis.parameter().name == parameter.name);
        match base.get(parameter.name) {
            Ok(value) if !swept && parameter.default != Some(value) => {
                words.push(format!(" --set {}={value:?}", parameter.name));
            }
            _ => {}
        }
    }
    if let Start::State([x1, v1, x2, v2]) = scene.start() {
        words.push(format!(" --start {x1:?},{v1:?},{x2:?},{v2:?}"));
    }
    let (settings, default) = (scene.orbit_settings(), Settings::default());
    if settings.transient_periods != default.transient_periods {
        words.push(format!(" --transient {}", settings.transient_periods));
    }
    if settings.observed_periods != default.observed_periods {
        words.push(format!(" --periods {}", settings.observed_periods));
    }
    words.concat()
}

/// The whole command for the cell with these indices on the axes.
pub(super) fn command(scene: &Scene, indices: [usize; 2]) -> String {
    let set = |(axis, i): (&crate::scene::Axis, usize)| {
        format!(" --set {}={:?}", axis.parameter().name, axis.value(i))
    };
    let sets: String = scene.axes().iter().zip(indices).map(set).collect();
    format!("rattlemap orbit{sets}{}", arguments(scene))
}
