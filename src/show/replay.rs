//! The command that replays one cell of a map.

use crate::map::scene::{Scene, Start};
pub use crate::model_file::MODEL_FILE as MODEL;
use crate::model_file::{DEFAULT, FileModel};
use crate::show::cells::Cells;
use rattlemap_dynamics::model::{Model, Parameter, State};
use rattlemap_dynamics::orbit::Settings;

/// Returns the arguments that are the same for all cells: the model, values that differ from the defaults of `orbit`, the
/// start with its phase, and the transient. `orbit` analyses as many periods as the class needs.
pub(crate) fn arguments(scene: &Scene) -> String {
    let mut words = Vec::new();
    let base = scene.base();
    if let Some(model) = base.downcast_ref::<FileModel>().and_then(model) {
        words.push(format!(" --model {model}"));
    }
    for (Parameter { name, default, .. }, value) in scene.fixed() {
        if *default != Some(value) {
            words.push(format!(" --set {name}={value:?}"));
        }
    }
    if base.start_phase() != 0.0 {
        words.push(format!(" --set start.phase={:?}", base.start_phase()));
    }
    if let Start::State(state) = scene.start() {
        words.push(start(base, state));
    }
    let (settings, default) = (scene.orbit_settings(), Settings::default());
    if settings.transient_periods != default.transient_periods {
        words.push(format!(" --transient {}", settings.transient_periods));
    }
    words.concat()
}

/// Returns the argument of `--model`: the name of a built-in model or the file in the map's folder. The default model needs
/// none.
fn model(file: &FileModel) -> Option<&str> {
    match (file.is_built_in(), file.name()) {
        (true, DEFAULT) => None,
        (true, name) => Some(name),
        (false, _) => Some(MODEL),
    }
}

fn start(model: &dyn Model, state: State) -> String {
    let values = state[..model.state_names().len()].iter().map(|x| format!("{x:?}"));
    format!(" --start {}", values.collect::<Vec<_>>().join(","))
}

/// Returns the command that replays the run `id`.
pub fn command(cells: &Cells<'_>, id: usize) -> String {
    let scene = cells.scene();
    let targets = scene.points().targets();
    let swept = targets.zip(scene.swept().map(|parameter| &*parameter.name).zip(cells.values(id)));
    let swept = swept.filter(|(target, _)| !target.is_start()).map(|(_, named)| named);
    let sets = swept.chain(cells.derived(id)).map(|(name, value)| format!(" --set {name}={value:?}"));
    let sets: String = sets.collect();
    // The last of several arguments counts, so the cell's own start comes last.
    let own = if cells.has_own_start(id) { start(scene.base(), cells.start(id)) } else { String::new() };
    format!("rattlemap orbit{sets}{}{own}", arguments(scene))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_of_a_cell_sets_the_start_phase() {
        let builder = Scene::builder(FileModel::built_in("gear-pair").unwrap()).start_phase(1.0);
        let scene = builder.axis("e", 0.1..=0.9, 2).axis("omega", 1.0..=2.0, 2).build().unwrap();
        assert_eq!(arguments(&scene), " --set start.phase=1.0");
    }
}
