//! `--set`: changes of the scene, and messages that name the argument.

use super::*;
use crate::model_file::FileModel;
use rattlemap_dynamics::model::state;

#[test]
fn arguments_override_the_text() {
    let sets =
        ["F=40", "parameters.omega=.7", "axis.0.count=8", "integration.max_period=2", "title=Set", "F=41"];
    let scene = parse(GOOD, &sets).unwrap();
    assert_eq!((scene.base().get("F"), scene.base().get("omega")), (Ok(41.0), Ok(0.7)));
    assert_eq!((scene.axes()[0].count(), scene.title()), (8, "Set"));
    assert_eq!(scene.integration().max_period, 2);
    let scene = parse(GOOD, &["start.policy=state", "start.state=[1,2,3,4]", "axis.0.max = 0.5"]).unwrap();
    assert_eq!((scene.start(), scene.axes()[0].max()), (Start::State(state(&[1.0, 2.0, 3.0, 4.0])), 0.5));
}

#[test]
fn errors_of_arguments_name_the_argument() {
    for [set, expected] in test_cases(
        r#"
axis.0.count=1 | --set axis.0.count=1: `axis.0.count = 1` is out of range
F=fifty | --set F=fifty: `parameters.F = fifty` has the wrong type: it must be a number
e=0.5 | --set e=0.5: `parameters.e = 0.5` does not fit: axis 0 sweeps `e`; set `axis.0.min`
omgea=1 | --set omgea=1: unknown field `parameters.omgea = 1`; did you mean `omega`?
integraton.x=1 | --set integraton.x=1: unknown field `integraton = { ... }`; did you mean `integration`?
axis.1.count=4 | --set axis.1.count=4: unknown field `axis.1.count = 4`; `1` must be a number below 1
axis.x=4 | `x` must be a number below 1
title.x=4 | --set title.x=4: unknown field `title.x = 4`; `"A scene"` has no fields; remove `.x`
start.state=[1,2,nan,4] | --set start.state=[1,2,nan,4]: `start.state = [1,2,nan,4]` does not fit
integration=3 | --set integration=3: `integration = 3` has the wrong type: it must be a table, [integration]
e | --set e: expected NAME=VALUE
=3 | --set =3: expected NAME=VALUE
F= | --set F=: expected NAME=VALUE
axis..count=3 | --set axis..count=3: expected NAME=VALUE
"#,
    ) {
        assert_says(&parse(GOOD, &[&set]).expect_err(&set).to_string(), &[&expected]);
    }
}

#[test]
fn a_single_cell_is_set_by_arguments() {
    let model = FileModel::built_in("gear-pair").unwrap();
    let sets = |sets: &[&str]| single_cell(&model, &sets.iter().map(ToString::to_string).collect::<Vec<_>>());
    assert_eq!(pair(&*sets(&[]).unwrap()), GearPair::paper(0.605));
    let other = GearPair { k: 900.0, ..GearPair::paper(0.06) };
    assert_eq!(pair(&*sets(&["e=0.06", "parameters.k=900"]).unwrap()), other);
    assert_says(
        &sets(&["e=1.5"]).unwrap_err().to_string(),
        &["--set e=1.5: `parameters.e = 1.5` is out of range"],
    );
    assert_says(
        &sets(&["start.policy=up"]).unwrap_err().to_string(),
        &["--set start.policy=up: unknown field"],
    );
    let phase = sets(&["start.phase=pi/2"]).unwrap();
    assert_eq!(phase.start_phase(), std::f64::consts::FRAC_PI_2);
    assert_ne!(*phase, *sets(&[]).unwrap());
    // A later change keeps it.
    assert_eq!(single_cell(&*phase, &["e=0.1".to_owned()]).unwrap().start_phase(), phase.start_phase());
}

#[test]
fn the_start_phase_turns_the_force_of_every_cell() {
    let (plain, turned) = (parse(GOOD, &[]).unwrap(), parse(GOOD, &["start.phase=0.5*pi"]).unwrap());
    for i in 0..4 {
        let [plain, turned] = [&plain, &turned].map(|scene| scene.cell(&[i]).oscillator().unwrap());
        let [plain, turned] = [&plain.drives[0], &turned.drives[0]];
        assert!(turned.cos[0].abs() < 1e-14 && (turned.sin[0] + plain.cos[0]).abs() < 1e-14);
    }
    let more: Vec<_> =
        turned.identity().into_iter().filter(|entry| !plain.identity().contains(entry)).collect();
    assert_eq!(more, [("start.phase".to_owned(), "1.5707963267948966".to_owned())]);
    assert_eq!(parse(GOOD, &["start.phase=0"]).unwrap().identity(), plain.identity());
    for (set, expected) in [
        ("start.phase=1e999", "start.phase"),
        ("start.phase=inf", "unknown name, `inf`: valid names: a number of radians"),
        (
            "start.phase=2*e",
            "unknown name, `e`: valid names: a number of radians, or an expression of numbers and pi",
        ),
        ("start.phase=[1]", "has the wrong type"),
    ] {
        assert_says(&parse(GOOD, &[set]).expect_err(set).to_string(), &[expected]);
    }
    let builder = || Scene::builder(FileModel::built_in("gear-pair").unwrap()).start_phase(1.0);
    let built = builder().axis("e", 0.1..=0.9, 2).axis("omega", 1.0..=2.0, 2).build().unwrap();
    assert_eq!(built.base().start_phase(), 1.0);
    let gears = Scene::builder(GearPair::paper(0.5)).start_phase(1.0);
    let error = gears.axis("e", 0.1..=0.9, 2).axis("omega", 1.0..=2.0, 2).build().unwrap_err();
    assert_says(&error.to_string(), &["`start.phase = 1.0` does not fit: a model in Rust starts at phase 0"]);
}

/// An axis whose parameter is named by an argument overrides the value of the parameter in the text.
#[test]
fn an_axis_named_by_an_argument_overrides_the_text() {
    let sets = ["e=0.5", "axis.0.parameter=F", "axis.0.min=40", "axis.0.max=60"];
    let scene = parse(GOOD, &sets).unwrap();
    assert_eq!(scene.axes()[0].parameter().name, "F");
    assert_eq!((scene.base().get("F"), scene.base().get("e")), (Ok(40.0), Ok(0.5)));
    let both = [&sets[..], &["F=50"]].concat();
    assert_says(
        &parse(GOOD, &both).unwrap_err().to_string(),
        &["--set F=50: `parameters.F = 50` does not fit: axis 0 sweeps `F`"],
    );
    // The parameter of the replaced axis has no value.
    assert_says(&parse(GOOD, &sets[1..]).unwrap_err().to_string(), &["restitution", "no default"]);
    // If both are in the text it is an error, even if an argument changes the axis' range.
    let text = GOOD.replace("\"e\"", "\"F\"");
    assert_says(
        &parse(&text, &["e=0.5", "axis.0.max=60"]).unwrap_err().to_string(),
        &["s.toml:5:5: `parameters.F = 50.0` does not fit: axis 0 sweeps `F`"],
    );
}
