//! Which oscillator a figure shows, in words.

use crate::map::scene::Scene;
use crate::show::symbols::{equation, symbol};
use rattlemap_dynamics::model::{Model, Parameter};

/// The values that tell an oscillator: of parameters without a default, the frequency, and what differs from the
/// defaults; then that the others have theirs. What `is_swept` has no one value.
pub(crate) fn parameters(model: &dyn Model, is_swept: impl Fn(&Parameter) -> bool) -> String {
    parameters_and(model, is_swept, Vec::new())
}

/// The same, with what else is to be named.
fn parameters_and(model: &dyn Model, is_swept: impl Fn(&Parameter) -> bool, derived: Vec<String>) -> String {
    let scales = model.frequency();
    let all = model.parameters().iter().enumerate().map(|(i, p)| (p, model.value(i), scales.contains(&i)));
    let fixed: Vec<(&Parameter, f64, bool)> = all.filter(|(parameter, ..)| !is_swept(parameter)).collect();
    // Where each is named: chosen ones first, then the frequency, without which a time has no scale.
    let place = |(parameter, value, scales): &(&Parameter, f64, bool)| match parameter.default {
        None => Some(0),
        Some(_) if *scales => Some(1),
        Some(default) if default != *value => Some(2),
        Some(_) => None,
    };
    let of = |wanted| fixed.iter().filter(move |fixed| place(fixed) == Some(wanted));
    let named: Vec<String> =
        (0..3).flat_map(of).map(|(parameter, value, _)| equation(&parameter.name, *value)).collect();
    let is_all = named.len() == fixed.len();
    let named = [named, derived].concat();
    let rest = match (named.is_empty(), is_all) {
        (_, true) => "",
        (true, _) => "all other parameters at their defaults",
        (false, _) => "; all other parameters at their defaults",
    };
    named.join(", ") + rest
}

/// The same of a scene, without what its axes sweep, and with what follows others.
pub(crate) fn of_scene(scene: &Scene) -> String {
    let is_fixed = |parameter: &Parameter| scene.fixed().any(|(name, _)| name == parameter.name);
    parameters_and(scene.base(), |parameter| !is_fixed(parameter), derived(scene).collect())
}

/// Every parameter of a scene that is fixed or follows others.
pub(crate) fn all_fixed(scene: &Scene) -> String {
    let fixed = scene.fixed().map(|(name, value)| equation(name, value));
    fixed.chain(derived(scene)).collect::<Vec<_>>().join(", ")
}

/// Parameters that follow others, each with its expression as it was written.
fn derived(scene: &Scene) -> impl Iterator<Item = String> {
    scene.derived().map(|(parameter, expression)| format!("{} = {expression}", symbol(&parameter.name)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::GearPair;

    #[test]
    fn what_follows_others_is_named_by_its_expression() {
        let built = Scene::builder(GearPair { k: 500.0, ..GearPair::paper(0.5) });
        let scene = built.derived("k2", "2/3*k1").axis("k1", 1.0..=2.0, 2).axis("F", 1.0..=2.0, 2);
        let scene = scene.build().unwrap();
        let rest = "; all other parameters at their defaults";
        assert_eq!(of_scene(&scene), format!("e = 0.5, \u{3c9} = 5.6, k = 500, k\u{2082} = 2/3*k1{rest}"));
        assert!(all_fixed(&scene).ends_with(", k\u{2082} = 2/3*k1"), "{}", all_fixed(&scene));
    }

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
