//! Descriptions of parameters, starts and integration in figures and the report.

use crate::map::scene::{Scene, Start};
use crate::model_file::{FileModel, is_unforced};
use crate::show::symbols::{equation, number, symbol};
use rattlemap_dynamics::model::{Model, Parameter, State, Timing};

/// Describes an oscillator: values of parameters without a default, the frequency, values that differ from the defaults, and
/// whether all others have their defaults; then the start phase if it is not 0. For a user's model it lists all values, because
/// readers cannot look up its defaults. Parameters for which `is_swept` is true are not mentioned.
pub(crate) fn parameters(model: &dyn Model, is_swept: impl Fn(&Parameter) -> bool) -> String {
    parameters_and(model, is_swept, Vec::new())
}

fn parameters_and(model: &dyn Model, is_swept: impl Fn(&Parameter) -> bool, derived: Vec<String>) -> String {
    let scales = model.frequency();
    let all = model.parameters().iter().enumerate().map(|(i, p)| (p, model.value(i), scales.contains(&i)));
    let fixed: Vec<(&Parameter, f64, bool)> = all.filter(|(parameter, ..)| !is_swept(parameter)).collect();
    let is_own = model.downcast_ref().is_some_and(|model: &FileModel| !model.is_built_in());
    let rank = |(parameter, value, scales): &(&Parameter, f64, bool)| match parameter.default {
        None => Some(0),
        Some(_) if *scales => Some(1),
        Some(default) if is_own || default != *value => Some(2),
        Some(_) => None,
    };
    let of_rank = |wanted| fixed.iter().filter(move |fixed| rank(fixed) == Some(wanted));
    let listed: Vec<String> =
        (0..3).flat_map(of_rank).map(|(parameter, value, _)| equation(parameter, *value)).collect();
    let is_all = listed.len() == fixed.len();
    let listed = [listed, derived, start_phase(model).into_iter().collect()].concat();
    let rest = match (listed.is_empty(), is_all) {
        (_, true) => "",
        (true, _) => "all other parameters at their defaults",
        (false, _) => "; all other parameters at their defaults",
    };
    listed.join(", ") + rest
}

/// Describes the oscillators of a scene by their fixed and derived parameters.
pub fn of_scene(scene: &Scene) -> String {
    let is_fixed = |parameter: &Parameter| scene.fixed().any(|(fixed, _)| fixed.name == parameter.name);
    parameters_and(scene.base(), |parameter| !is_fixed(parameter), derived(scene).collect())
}

/// Returns all fixed and derived parameters of a scene, and its start phase if that is not 0.
pub(crate) fn all_fixed(scene: &Scene) -> String {
    let fixed = scene.fixed().map(|(parameter, value)| equation(parameter, value));
    fixed.chain(derived(scene)).chain(start_phase(scene.base())).collect::<Vec<_>>().join(", ")
}

/// Describes the start phase of a model, if it is not 0.
fn start_phase(model: &dyn Model) -> Option<String> {
    let phase = model.start_phase();
    (phase != 0.0).then(|| format!("start phase {} rad", number(phase)))
}

/// Returns the derived parameters of a scene with their expressions.
fn derived(scene: &Scene) -> impl Iterator<Item = String> {
    scene.derived().map(|(parameter, expression)| format!("{} = {expression}", symbol(&parameter.name)))
}

/// Describes the start and the length of the integration of a map's cells.
pub(crate) fn integration(scene: &Scene) -> String {
    let last = scene.axes().last().map_or(String::new(), |axis| symbol(&axis.parameter().name));
    let components = scene.base().state_names().len();
    let listed = |state: State| state.map(number)[..components].join(", ");
    let start = match scene.start() {
        Start::Rest if scene.sweeps_start() => "from its own state, the other components 0".to_owned(),
        Start::State(state) if scene.sweeps_start() => {
            format!("from its own state, the other components of ({})", listed(state))
        }
        Start::Rest => "from rest".to_owned(),
        Start::State(state) => format!("from ({})", listed(state)),
        Start::Up => format!("from the attractor at the next lower {last}"),
        Start::Down => format!("from the attractor at the next higher {last}"),
        Start::Both => format!("from the attractors at the next {last} on either side"),
    };
    let more_starts = match scene.draw() {
        Some(draw) => format!(", attractors counted with {} random states more", draw.count - 1),
        None => String::new(),
    };
    let start = match scene.sample() {
        Some(sample) => {
            let (name, states) = sample.spread.parts();
            let [first, second] = states.map(listed);
            let most = if sample.width.is_some() { "at most " } else { "" };
            match name {
                "box" => format!("from {most}{} starts between ({first}) and ({second})", sample.count),
                _ => {
                    format!("from {most}{} normal starts, mean ({first}), deviation ({second})", sample.count)
                }
            }
        }
        None => start,
    };
    let integration = scene.integration();
    let (transient, observed) = (integration.transient_periods, integration.observed_periods);
    let upper = if integration.early_stop { "at most " } else { "" };
    let more = match integration.undecided_periods {
        more if more > 0 && integration.early_stop => format!(", undecided cells up to {more} more"),
        _ => String::new(),
    };
    let confirmed = match integration.confirm_chaos {
        0 => String::new(),
        more => format!(", chaotic cells {more} more"),
    };
    let filled = match scene.refine() {
        Some(_) => "; refined at borders, the rest filled and audited",
        None => "",
    };
    let timing = if is_unforced(scene.base()) { Timing::Free } else { Timing::Forced };
    let [_, periods] = timing.names();
    format!(
        "every cell {start}{more_starts}, {upper}{transient} + {observed} {periods}{more}{confirmed}{filled}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::GearPair;

    #[test]
    fn derived_parameters_are_described_by_their_expressions() {
        let built = Scene::builder(GearPair { k: 500.0, ..GearPair::paper(0.5) });
        let scene = built.derived("k2", "2/3*k1").axis("k1", 1.0..=2.0, 2).axis("F", 1.0..=2.0, 2);
        let scene = scene.build().unwrap();
        let rest = "; all other parameters at their defaults";
        assert_eq!(of_scene(&scene), format!("e = 0.5, \u{3c9} = 5.6, k = 500, k\u{2082} = 2/3*k1{rest}"));
        assert!(all_fixed(&scene).ends_with(", k\u{2082} = 2/3*k1"), "{}", all_fixed(&scene));
    }

    #[test]
    fn all_parameters_of_a_users_model_are_described() {
        let text = crate::model_file::FileModel::built_in("bilinear").unwrap().definition().text.clone();
        let own = FileModel::parse(&text.replace("\"bilinear\"", "\"mine\""), "mine.toml").unwrap();
        let described = parameters(&own, |_| false);
        assert_eq!(described.matches(" = ").count(), own.parameters().len(), "{described}");
        assert!(!described.contains("defaults"), "{described}");
    }

    #[test]
    fn values_that_differ_from_the_defaults_are_described() {
        let pair = GearPair { k: 500.0, force: -50.0, ..GearPair::paper(0.5) };
        let rest = "; all other parameters at their defaults";
        assert_eq!(
            parameters(&pair, |_| false),
            format!("e = 0.5, \u{3c9} = 5.6, k = 500, F = \u{2212}50{rest}")
        );
        let swept = |parameter: &Parameter| ["e", "F"].contains(&&*parameter.name);
        assert_eq!(parameters(&pair, swept), format!("\u{3c9} = 5.6, k = 500{rest}"));
        let most = |parameter: &Parameter| ["e", "omega"].contains(&&*parameter.name);
        assert_eq!(parameters(&GearPair::paper(0.5), most), rest.trim_start_matches("; "));
        assert_eq!(parameters(&pair, |parameter| parameter.name != "k"), "k = 500");
    }
}
