use rattlemap_dynamics::model::{ModelError, OscillatorError, Stops, state};

use super::*;
use crate::map::plan::Plan;
use crate::map::scene::{Continuous, Draw, Integration, Refine, SceneBuilder};
use crate::model_file::FileModel;

fn built() -> SceneBuilder {
    Scene::builder(GearPair::paper(0.5)).axis("e", 0.0..=1.0, 4).axis("omega", 1.0..=12.0, 8)
}

fn refusal(builder: SceneBuilder) -> String {
    builder.build().unwrap_err().to_string()
}

/// A built scene is equal to the one read from its text.
#[test]
fn a_built_scene_is_the_one_that_its_text_describes() {
    let pair = GearPair { k: 900.0, ..GearPair::paper(0.5) };
    let scene = Scene::builder(pair)
        .title("A \"map\" \u{3c9}\\")
        .parameter("F", 41.0)
        .parameter("F", 40.0)
        .axis("e", 0.0..=1.0, 4)
        .axis("omega", 1.0..=12.0, 8)
        .integration(Integration { steps_per_period: Steps::PerPeriod(512), ..Integration::default() })
        .start(Start::State(state(&[0.1, -1e-7, 1e300])))
        .quantities(&[Quantity::Word, Quantity::Class])
        .files(&[Format::Npy])
        .build()
        .unwrap();
    assert_eq!(*scene.base(), GearPair { force: 40.0, omega: 1.0, e: 0.0, ..pair });
    assert_eq!(
        (scene.title(), scene.start()),
        ("A \"map\" \u{3c9}\\", Start::State(state(&[0.1, -1e-7, 1e300])))
    );
    let read = Scene::parse(scene.text(), "s.toml", &[], Purpose::Map).unwrap();
    assert_eq!(read.identity(), scene.identity());
    assert_eq!((read.title(), read.outputs()), (scene.title(), scene.outputs()));
    let refine =
        Refine { rounds: Some(3), audit: Some(9), continuous: Continuous::Empty, ..Refine::default() };
    for builder in
        [built().refine(refine), built().draw(Draw { count: 3, seed: 7 }), built().start(Start::Up), built()]
    {
        let scene = builder.build().unwrap();
        let read = Scene::parse(scene.text(), "s.toml", &[], Purpose::Map).unwrap();
        assert_eq!((read.identity(), read.refine()), (scene.identity(), scene.refine()));
    }
}

/// Axes of all kinds, derived parameters and lists can be built.
#[test]
fn all_kinds_of_axes_and_lists_can_be_built() {
    let pair = GearPair { k2: 21.0, ..GearPair::paper(0.5) };
    let scene = Scene::builder(pair)
        .derived("k2", "k1")
        .derived("k2", "0.5*k1")
        .log_axis("k1", 10.0..=1000.0, 3)
        .values_axis("F", &[1.0, 2.5, 40.0])
        .build()
        .unwrap();
    assert_eq!(*scene.cell(&[1, 2]), GearPair { k1: 100.0, k2: 50.0, force: 40.0, ..pair });
    let read = Scene::parse(scene.text(), "s.toml", &[], Purpose::Map).unwrap();
    assert_eq!(read.identity(), scene.identity());
    let scene = Scene::builder(pair).cells(["omega", "e"], &[[5.6, 0.5], [6.0, 0.25]]).build().unwrap();
    assert_eq!(*scene.cell(&[1]), GearPair { omega: 6.0, e: 0.25, ..pair });
    assert_eq!(scene.cell_count(), 2);
    let wrong = Scene::builder(pair).cells(["omega"], &[[5.6], [-6.0]]);
    assert_says(&refusal(wrong), &["cells:3:1: `omega = -6.0` is out of range"]);
}

/// Errors of built scenes are those of files, without a place in the text.
#[test]
fn errors_of_built_scenes_name_the_field() {
    for (builder, expected) in [
        (built().parameter("mass", 1.0), "scene: unknown field `parameters.mass = 1.0`"),
        (built().parameter("k", f64::NAN), "scene: `parameters.k = nan` is out of range"),
        (built().parameter("e", 0.5), "scene: `parameters.e = 0.5` does not fit: axis 0 sweeps `e`"),
        (built().axis("k", 1.0..=2.0, 2), "two tables for `map`; remove"),
        (built().quantities(&[]), "scene: `outputs.quantities = []` is out of range"),
        (
            built().integration(Integration { observed_periods: 10, ..Integration::default() }),
            "scene: `integration.max_period = 64` does not fit",
        ),
        (built().start(Start::Up).draw(Draw { count: 2, seed: 1 }), "one start each"),
        (
            Scene::builder(GearPair::paper(2.0)).axis("k", 1.0..=2.0, 2).axis("r", 1.0..=2.0, 2),
            "`parameters.e = 2.0`",
        ),
        (
            Scene::builder(GearPair::paper(0.5)).axis("k", 2.0..=1.0, 2).axis("r", 1.0..=2.0, 2),
            "`axis.0.max = 1.0`",
        ),
    ] {
        assert_says(&refusal(builder), &[expected]);
    }
    let stops =
        Scene::builder(Stops::with_restitution(0.5)).axis("F", 1.0..=2.0, 2).axis("omega", 1.0..=2.0, 2);
    assert_says(
        &refusal(stops.start(Start::State(state(&[0.0, 0.0, 1.0])))),
        &["two finite numbers, [x, v]"],
    );
}

/// Cells without motion are found before the computation: at corners by the scene, elsewhere by the plan.
#[test]
fn cells_without_motion_are_named_before_anything_is_computed() {
    let scene = |mass: &str| {
        let text = format!(
            "name = 'driven'\n[parameters]\nF = 1\nomega = 9\n[motion]\ncoordinates = ['x']\nmass = [['{mass}']]\n\
             force = ['F']\nfrequency = 'omega'\ngap = [1]\n\
             [[contact]]\nside = 'right'\nat = 1\nlaw = 'impact'\nrestitution = 0.5\n"
        );
        let model = FileModel::parse(&text, "driven.toml").unwrap();
        Scene::builder(model).axis("F", 1.0..=2.0, 3).axis("omega", 1.0..=3.0, 5).build()
    };
    let corner = scene("omega - 1.2").unwrap_err();
    assert_says(
        &corner.to_string(),
        &["scene: at F = 1, omega = 1: mass = -0.2: it must be finite and greater than 0"],
    );
    let plan = Plan::new(&scene("(omega - 1.8)*(omega - 2.2)").unwrap());
    let inside = plan.check().unwrap_err();
    assert!(matches!(inside.reason, ModelError::Oscillator(OscillatorError::OutOfRange { .. })));
    assert_says(&inside.to_string(), &["omega = 2: mass = -0.04"]);
    assert_eq!(Plan::new(&scene("omega").unwrap()).check(), Ok(()));
}
