//! Reading of scenes: the values of a valid scene, and every kind of error.

mod along;
mod axes;
mod built;
mod cells;
mod derived;
mod figures;
mod keys;
mod ranges;
mod sets;
mod starts;
mod texts;

use super::*;
use crate::model_file::FileModel;
use crate::text::test_cases;
use rattlemap_dynamics::model::{GearPair, state};

const GOOD: &str = r#"title = "A scene"
model = "gear-pair"

[parameters]
F = 50.0

[[axis]]
parameter = "e"
min = 0.1
max = 1
count = 4

[integration]
steps_per_period = "auto"
transient_periods = 10
observed_periods = 20
early_stop = false
max_period = 4

[start]
policy = "rest"

[outputs]
quantities = ["class", "word"]
files = ["csv"]
"#;

const SECOND_AXIS: &str = "\n[[axis]]\nparameter = \"omega\"\nmin = 1.0\nmax = 12.0\ncount = 3\n";

fn parse(text: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    Scene::parse(text, "s.toml", &sets, Purpose::Bifurcation)
}

/// Returns the message for GOOD with `old` replaced by `new`.
fn refusal(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old), "{old:?} is not in the scene");
    parse(&GOOD.replacen(old, new, 1), &[]).expect_err(new).to_string()
}

/// Splits the parts of a message that are joined by `&&`.
fn parts(expected: &str) -> Vec<&str> {
    expected.split("&&").map(str::trim).collect()
}

/// Checks the messages for changes of GOOD, from lines of the form `old | new | parts of the message, joined by &&`.
#[track_caller]
fn check_refusals(cases: &str) {
    for [old, new, expected] in test_cases(cases) {
        assert_says(&refusal(&old, &new), &[&parts(&expected)[..], &["s.toml:"]].concat());
    }
}

/// Returns the gear pair with the values of a model.
fn pair(model: &dyn Model) -> GearPair {
    let mut pair = GearPair::paper(0.0);
    model.parameters().iter().for_each(|p| pair.set(&p.name, model.get(&p.name).unwrap()).unwrap());
    pair
}

#[track_caller]
fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "expected {part:?} in: {message}");
    }
}

#[test]
fn all_fields_of_a_scene_are_read() {
    let scene = parse(GOOD, &[]).unwrap();
    assert_eq!(scene.title(), "A scene");
    assert_eq!(scene.text(), GOOD);
    assert_eq!(scene.axes()[0].parameter().name, "e");
    assert_eq!(scene.integration().steps_per_period, Steps::Auto);
    assert!(!scene.integration().early_stop);
    let expected = orbit::Settings { transient_periods: 10, observed_periods: 20, max_period: 4 };
    assert_eq!(scene.orbit_settings(), expected);
    assert_eq!(scene.start(), Start::Rest);
    assert_eq!(scene.outputs().quantities, [Quantity::Class, Quantity::Word]);
    assert_eq!(scene.outputs().files, [Format::Csv]);
    assert_eq!(scene.refine(), None);
}

#[test]
fn only_the_axis_is_required() {
    let text = "[[axis]]\nparameter = 'e'\nmin = 0\nmax = 1\ncount = 2";
    let scene = parse(text, &[]).unwrap();
    assert_eq!(pair(scene.base()), GearPair::paper(0.0));
    assert_eq!(scene.orbit_settings(), orbit::Settings::default());
    assert_eq!(scene.outputs().quantities, [Quantity::Class, Quantity::Lyapunov]);
    assert_eq!(scene.outputs().files, [Format::Csv, Format::Png]);
    assert!(scene.integration().early_stop);
    assert_eq!(scene.title(), "Gear pair: coefficient of restitution");
}

#[test]
fn axis_values_are_inclusive_and_stay_in_range() {
    let line = parse(GOOD, &[]).unwrap().line();
    let values: Vec<f64> = line.iter().map(|(value, _)| *value).collect();
    assert_eq!(values, [0.1, 0.1 + 0.9 * 1.0 / 3.0, 0.1 + 0.9 * 2.0 / 3.0, 1.0]);
    assert!(line.iter().all(|(value, model)| model.get("e") == Ok(*value) && model.oscillator().is_ok()));
    for count in ["7", "50", "1000", "999983"] {
        let scene = parse(GOOD, &[&format!("axis.0.count={count}")]).unwrap();
        assert!(scene.axes()[0].values().all(|e| (0.1..=1.0).contains(&e)), "{count}");
    }
}

#[test]
fn a_map_takes_two_axes_in_their_order() {
    let text = format!("{}{SECOND_AXIS}", GOOD.replacen("\"csv\"", "\"npy\"", 1));
    let scene = Scene::parse(&text, "s.toml", &[], Purpose::Map).unwrap();
    assert_eq!(pair(&*scene.cell(&[3, 1])), GearPair { omega: 6.5, ..GearPair::paper(1.0) });
    let message = Scene::parse(GOOD, "s.toml", &[], Purpose::Map).unwrap_err().to_string();
    assert_says(&message, &["s.toml:7:", "axis = 1 table", "two tables for `map`; add an [[axis]] table"]);
}

#[test]
fn a_map_refuses_settings_that_contradict_following() {
    let text = format!("{GOOD}{SECOND_AXIS}");
    let refused = |text: &str| Scene::parse(text, "s.toml", &[], Purpose::Map).unwrap_err().to_string();
    for policy in ["up", "down"] {
        let text = text.replace("\"rest\"", &format!("\"{policy}\""));
        assert!(Scene::parse(&text, "s.toml", &[], Purpose::Map).is_ok());
        let message = refused(&format!("{text}\n[refine]\n"));
        assert_says(
            &message,
            &["s.toml:21:10", &format!("`start.policy = \"{policy}\"`"), "remove [refine]"],
        );
        let message = refused(&text.replace("[start]", "[start]\ncount = 3"));
        assert_says(&message, &["s.toml:21:9", "`start.count = 3`", "have one start each"]);
    }
    let message = refused(&text.replace("[start]", "[refine]\n[start]\ncount = 3"));
    assert_says(&message, &["`start.count = 3`", "attractors are not counted in filled cells"]);
    let message = refused(&text.replace("[start]", "[start]\nseed = 3"));
    assert_says(&message, &["`start.seed = 3`", "a seed needs start.count above 1"]);
}

#[test]
fn the_identity_differs_for_scenes_with_other_records() {
    let scene = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        Scene::parse(&format!("{GOOD}{SECOND_AXIS}"), "s", &sets, Purpose::Map).unwrap().identity()
    };
    let original = scene(&[]);
    assert_eq!(original, scene(&["title=Other", "outputs.files=[\"png\"]", "F=50"]));
    let confirm = "integration.confirm_chaos=9";
    for set in ["F=51", "axis.1.count=4", "axis.0.max=0.9", "integration.early_stop=true", confirm] {
        let other = scene(&[set]);
        let differing: Vec<_> = original.iter().zip(&other).filter(|(a, b)| a != b).collect();
        assert_eq!(differing.len(), 1, "{set}: {differing:?}");
    }
    assert_ne!(original, scene(&["start.policy=state", "start.state=[0,0,1,0]"]));
    assert_ne!(original, scene(&["outputs.quantities=[\"class\"]"]));
}

#[test]
fn syntax_errors_show_the_line() {
    assert_says(&refusal("min = 0.1", "min = = 0.1"), &["s.toml:9:7: not valid TOML", "min = = 0.1"]);
    assert_says(&refusal("F = 50.0", "F = 1.0\nF = 2.0"), &["s.toml:6:1", "duplicate key"]);
    assert_says(&refusal("F = 50.0", "F = fifty"), &["s.toml:5:5", "F = fifty"]);
    assert_says(&refusal("\"A scene\"", "\"A scene"), &["s.toml:1:", "not valid TOML"]);
}

#[test]
fn unknown_fields_get_a_suggestion() {
    check_refusals(
        r#"
title = | titel = | s.toml:1:1: unknown field `titel = "A scene"`; did you mean `title`?
[integration] | [integraton] | s.toml:13:2: unknown field `integraton = { ... }`; did you mean
F =  | omgea =  | s.toml:5:1: unknown field `parameters.omgea = 50.0`; did you mean `omega`?
F =  | f =  | did you mean `F`? valid names: m1 (equivalent mass of gear 1), m2 (
count = | cuont = | s.toml:11:1: unknown field `axis.0.cuont = 4`; did you mean `count`?
max_period | max_periods | s.toml:18:1: unknown field `integration.max_periods = 4`
policy | begin | unknown field `start.begin = "rest"`; valid names: policy, state, phase, count, seed
files | file | s.toml:25:1: unknown field `outputs.file = ["csv"]`; did you mean `files`?
"#,
    );
}

#[test]
fn unknown_names_get_a_suggestion() {
    check_refusals(
        r#"
"gear-pair" | "gearpair" | s.toml:2:9: `model = "gearpair"` is not known; did you mean `gear-pair`?
"e" | "omgea" | s.toml:8:13: `axis.0.parameter = "omgea"` is not known; did you mean `omega`?
"rest" | "rset" | s.toml:21:10: `start.policy = "rset"` is not known; did you mean `rest`?
"word" | "wrod" | s.toml:24:24: `outputs.quantities.1 = "wrod"` is not known; did you mean `word`?
["csv"] | ["cvs"] | s.toml:25:10: `outputs.files.0 = "cvs"` is not known; did you mean `csv`?
"auto" | "atuo" | s.toml:14:20: `integration.steps_per_period = "atuo"` has the wrong type
"#,
    );
}

#[test]
fn missing_fields() {
    let axis = "[[axis]]\nparameter = \"e\"\nmin = 0.1\nmax = 1\ncount = 4\n";
    assert_says(&refusal(axis, ""), &["s.toml:1:1: `axis` is missing; write [[axis]]"]);
    check_refusals(
        r#"
parameter = "e"\n | | s.toml:7: && `axis.0.parameter` is missing; name one
max = 1\n | | s.toml:7: && `axis.0.max` is missing; give a number, between 0 and 1
count = 4\n | | s.toml:7: && `axis.0.count` is missing; say how many
"e" | "omega" | s.toml:4:2: `parameters.e` is missing; coefficient of restitution has no default
"rest" | "state" | s.toml:20:2: `start.state` is missing; policy = "state" needs
"#,
    );
    let message = parse("axis = []", &[]).unwrap_err().to_string();
    assert_says(&message, &["s.toml:1:1: `axis = 0 tables`", "one table for `bifurcation`; add"]);
    assert_says(&parse("", &[]).unwrap_err().to_string(), &["s.toml:1:1: `axis` is missing"]);
}

#[test]
fn contradicting_values_are_refused() {
    let two = format!(
        "{GOOD}{}",
        SECOND_AXIS.replacen("omega", "e", 1).replacen("12.0", "1.0", 1).replacen("1.0", "0.0", 1)
    );
    assert_says(
        &parse(&two, &[]).unwrap_err().to_string(),
        &["s.toml:28:13: `axis.1.parameter = \"e\"` does not fit: axis 0 sweeps it already"],
    );
    let two = format!("{GOOD}{SECOND_AXIS}");
    assert_says(
        &parse(&two, &[]).unwrap_err().to_string(),
        &["s.toml:27:", "`axis = 2 tables` is out of range: it must be one table for `bifurcation`"],
    );
    check_refusals(
        r#"
F = 50.0 | e = 0.5 | s.toml:5:5: `parameters.e = 0.5` does not fit: axis 0 sweeps `e`; set `axis.0.min`
d = 4 | d = 11 | s.toml:18:14: `integration.max_period = 11` does not fit: a cycle must be observed twice, so `integration.observed_periods = 20` must be at least 22
"rest" | "rest"\nstate = [0, 0, 0, 0] | s.toml:22:9: `start.state = [0, 0, 0, 0]` does not fit: it needs start.policy = "state"
[start] | [refine]\n[start] | s.toml:20:
["csv"] | ["csv", "html"] | s.toml:25:9: `outputs.files = ["csv", "html"]` does not fit: `bifurcation` writes csv, png, svg and pdf; remove "html"
"#,
    );
}

#[test]
fn starts_from_a_state() {
    let with =
        |state: &str| parse(&GOOD.replacen("\"rest\"", &format!("\"state\"\nstate = {state}"), 1), &[]);
    assert_eq!(with("[1, -0.5, 0, 2e-3]").unwrap().start(), Start::State(state(&[1.0, -0.5, 0.0, 2e-3])));
    for (state, expected) in [
        (
            "[1, 2, 3]",
            "s.toml:22:9: `start.state = [1, 2, 3]` is out of range: it must be four finite numbers",
        ),
        ("[1, 2, 3, 4, 5]", "must be four finite numbers"),
        ("[1, 2, nan, 4]", "s.toml:22:16: `start.state.2 = nan` is out of range: it must be a finite number"),
        ("[1, 2, \"x\", 4]", "s.toml:22:16: `start.state.2 = \"x\"` has the wrong type: it must be a number"),
        ("0", "`start.state = 0` has the wrong type: it must be four finite numbers"),
    ] {
        assert_says(&with(state).unwrap_err().to_string(), &[expected]);
    }
    for (policy, start) in [("up", Start::Up), ("down", Start::Down)] {
        assert_eq!(parse(GOOD, &[&format!("start.policy={policy}")]).unwrap().start(), start);
    }
}

#[test]
fn a_measured_column_with_the_name_of_a_swept_parameter_is_refused() {
    let model = FileModel::built_in("impact-oscillator").unwrap().definition().text.replace("zeta", "rms_x");
    let model = FileModel::parse(&model, "m.toml").unwrap();
    let scene = |quantity| {
        Scene::builder(model.clone())
            .axis("rms_x", 0.1..=0.2, 2)
            .axis("F", 1.0..=2.0, 2)
            .quantities(&[quantity])
            .build()
    };
    assert!(scene(Quantity::Amplitude).is_ok());
    let error = scene(Quantity::Rms).unwrap_err().to_string();
    assert!(error.contains("the column `rms_x`") && error.contains("rename the parameter"), "{error}");
}
