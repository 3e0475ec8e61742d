//! The command that replays one cell of a map.

use super::Cells;
use crate::map::scene::{Scene, Start};
use rattlemap_dynamics::model::{Model, State};
use rattlemap_dynamics::orbit::Settings;

/// What follows the two `--set` of the axes: parameters that differ from `orbit`'s own
/// defaults, the start, and how long to integrate.
pub(super) fn arguments(scene: &Scene) -> String {
    let mut words = Vec::new();
    let base = scene.base();
    for (index, parameter) in base.parameters().iter().enumerate() {
        let value = base.value(index);
        if !scene.sweeps(parameter) && parameter.default != Some(value) {
            words.push(format!(" --set {}={value:?}", parameter.name));
        }
    }
    if let Start::State(state) = scene.start() {
        words.push(start(base, state));
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

fn start(model: &dyn Model, state: State) -> String {
    let shown = state[..model.state_names().len()].iter().map(|x| format!("{x:?}"));
    format!(" --start {}", shown.collect::<Vec<_>>().join(","))
}

/// The whole command for the run `id`.
pub(super) fn command(cells: &Cells<'_>, id: usize) -> String {
    let scene = cells.scene();
    let set = |(axis, i): (&crate::map::scene::Axis, usize)| {
        format!(" --set {}={:?}", axis.parameter().name, axis.value(i))
    };
    let sets: String = scene.axes().iter().zip(cells.row(id).indices).map(set).collect();
    // A later argument wins over the scene's own.
    let own = if cells.has_own_start(id) { start(scene.base(), cells.start(id)) } else { String::new() };
    format!("rattlemap orbit{sets}{}{own}", arguments(scene))
}
