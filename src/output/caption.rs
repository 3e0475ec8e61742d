//! Which oscillator a figure shows, in words.

use super::symbols::equation;
use crate::map::scene::Scene;
use rattlemap_dynamics::model::{Model, Parameter};

/// The parameter that matters wherever it does not change: without it a time has no scale.
const FREQUENCY: &str = "omega";

/// What a model is taken from, by its title.
pub fn source(model: &dyn Model) -> Option<&'static str> {
    match model.name() {
        "gear-pair" => Some("Study on the Nonlinear Dynamic Behavior of Rattling Vibration in Gear Systems"),
        _ => None,
    }
}

/// The values that tell an oscillator: of parameters without a default, the frequency, and what differs from the
/// defaults; then that the others have theirs. What `is_swept` has no one value.
pub(super) fn parameters(model: &dyn Model, is_swept: impl Fn(&Parameter) -> bool) -> String {
    let all = model.parameters().iter().enumerate().map(|(i, p)| (p, model.value(i)));
    let fixed: Vec<(&Parameter, f64)> = all.filter(|(parameter, _)| !is_swept(parameter)).collect();
    // Where each is named: chosen ones first, then the frequency.
    let place = |(parameter, value): &(&Parameter, f64)| match parameter.default {
        None => Some(0),
        Some(_) if parameter.name == FREQUENCY => Some(1),
        Some(default) if default != *value => Some(2),
        Some(_) => None,
    };
    let of = |wanted| fixed.iter().filter(move |fixed| place(fixed) == Some(wanted));
    let named: Vec<String> =
        (0..3).flat_map(of).map(|(parameter, value)| equation(&parameter.name, *value)).collect();
    let rest = match (named.is_empty(), named.len() == fixed.len()) {
        (_, true) => "",
        (true, _) => "all other parameters at their defaults",
        (false, _) => "; all other parameters at their defaults",
    };
    named.join(", ") + rest
}

/// The same of a scene, without what its axes sweep.
pub(super) fn of_scene(scene: &Scene) -> String {
    parameters(scene.base(), |parameter| scene.sweeps(parameter))
}

/// Every fixed parameter of a scene.
pub(super) fn all_fixed(scene: &Scene) -> String {
    scene.fixed().map(|(name, value)| equation(name, value)).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::GearPair;

    #[test]
    fn what_differs_from_the_defaults_is_named() {
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
