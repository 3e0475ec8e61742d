//! The command that replays one cell of a map.

use super::Cells;
use crate::model::{GearPair, State};
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
    if let Start::State(state) = scene.start() {
        words.push(start(state));
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

fn start([x1, v1, x2, v2]: State) -> String {
    format!(" --start {x1:?},{v1:?},{x2:?},{v2:?}")
}

/// The whole command for the run `id`.
pub(super) fn command(cells: &Cells<'_>, id: usize) -> String {
    let scene = cells.scene();
    let set = |(axis, i): (&crate::scene::Axis, usize)| {
        format!(" --set {}={:?}", axis.parameter().name, axis.value(i))
    };
    let sets: String = scene.axes().iter().zip(cells.row(id).indices).map(set).collect();
    // A later argument wins over the scene's own.
    let own = if cells.has_own_start(id) { start(cells.start(id)) } else { String::new() };
    format!("rattlemap orbit{sets}{}{own}", arguments(scene))
}
