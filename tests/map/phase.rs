//! The phase of the force: sines in models, and `start.phase` in scenes.

use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use crate::common::gpu;
use rattlemap::gpu::Precision;
use rattlemap::job;
use rattlemap::job::Processor;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Quantity, Scene, SceneBuilder};
use rattlemap::model_file::FileModel;
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap_dynamics::model::{Model as _, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{self, Class, Settings};

/// Rattling wheel of de Souza and Caldas (2001). The published force is `-0.048 cos t + 0.48 sin t`.
const SOUZA: &str = r#"
name = "rattle-2001"
parameters = { alpha = 0.48, beta = 0.1, gamma = 0.1, r = 0.9 }
motion.coordinates = ["s"]
motion.mass = [[1]]
motion.damping = [["beta"]]
motion.force = ["-alpha*beta"]
motion.force_sin = ["alpha"]
motion.load = ["gamma"]
motion.frequency = 1
motion.gap = [1]
contact = [
    { side = "right", at = 0, law = "impact", restitution = "r" },
    { side = "left", at = -1, law = "impact", restitution = "r" },
]
"#;

/// Rattling gear of Mason, Piiroinen, Wilson and Homer (2009). The published force is
/// `-4 pi^2 eps cos(2 pi t) - 2 pi eps delta sin(2 pi t)`.
const MASON: &str = r#"
name = "rattle-2009"
parameters = { delta = 0.6, eps = 0.1, beta = 0.6, kappa = 100.0 }
motion.coordinates = ["theta"]
motion.mass = [[1]]
motion.damping = [["delta"]]
motion.force = ["-4*pi^2*eps"]
motion.force_sin = ["-2*pi*eps*delta"]
motion.load = ["4*pi*delta"]
motion.frequency = "2*pi"
motion.gap = [1]
contact = [
    { side = "right", at = "beta", law = "elastic", stiffness = "2*kappa" },
    { side = "left", at = "-beta", law = "elastic", stiffness = "2*kappa" },
]
"#;

fn model(text: &str) -> FileModel {
    FileModel::parse(text, "model.toml").unwrap()
}

/// Returns the same motion under a cosine alone, and the phase at which it is the published one at t = 0.
fn under_cosine(text: &str) -> (FileModel, f64) {
    let published = model(text).oscillator().unwrap();
    let (a, b) = (published.drives[0].cos[0], published.drives[0].sin[0]);
    let is_force = |line: &&str| line.starts_with("motion.force");
    let rest: Vec<&str> = text.lines().filter(|line| !is_force(line)).collect();
    let cosine = model(
        &rest.join("\n").replace("motion.gap", &format!("motion.force = [{:?}]\nmotion.gap", a.hypot(b))),
    );
    (cosine, (-b).atan2(a).rem_euclid(TAU))
}

fn off(a: State, b: State) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn plane(model: FileModel, side: u32) -> SceneBuilder {
    Scene::builder(model)
        .start_axis("s", -0.99..=-0.02, side)
        .start_axis("v", -1.0..=1.0, side)
        .quantities(&[Quantity::Class, Quantity::Lyapunov, Quantity::Impacts])
}

/// Cycles of the section at the cosine's phase 0, by an independent program, are those of the published section after the
/// time between both sections.
#[test]
fn cycles_of_the_cosine_are_carried_to_the_published_section() {
    let souza: &[State] = &[state(&[-0.457665, 0.550574]), state(&[-0.260199, -0.148216])];
    let mason: &[State] = &[
        state(&[-0.070067, 0.857929]),
        state(&[0.662391, 0.003644]),
        state(&[0.710003, -0.503838]),
        state(&[0.343343, 5.109192]),
    ];
    for (text, cycles) in [(SOUZA, souza), (MASON, mason)] {
        let (published, (cosine, phase)) = (model(text), under_cosine(text));
        let mut turned = cosine.clone();
        assert!(turned.set_start_phase(phase));
        let [force, other] = [&published, &turned].map(|model| model.oscillator().unwrap().drives.remove(0));
        assert!((force.cos[0] - other.cos[0]).abs() < 1e-14 && (force.sin[0] - other.sin[0]).abs() < 1e-14);
        let flow = Flow::of(&cosine).unwrap();
        for &known in cycles {
            let there = orbit::analyse(&cosine, known, &Settings::default()).unwrap();
            assert_eq!(there.class, Class::Periodic { period: 1 }, "{known:?}");
            // The independent program gives the fast fourth cycle to five decimals.
            assert!(off(there.strobe, known) < 1e-5, "{:?} {known:?}", there.strobe);
            let halt = AtomicBool::new(false);
            let carried = orbit::state_at(&flow, cosine.law(), there.strobe, phase / flow.omega, &halt);
            let carried = carried.unwrap().unwrap();
            for model in [&published, &turned] {
                let here = orbit::analyse(model, carried, &Settings::default()).unwrap();
                assert!(off(here.strobe, carried) < 1e-12, "{:?} {carried:?}", here.strobe);
                assert_eq!(here.word, there.word);
                assert!((here.lyapunov - there.lyapunov).abs() < 1e-9);
            }
        }
    }
}

/// De Souza and Caldas publish basins of 63.4 % and 36.6 %. At the cosine's phase 0 the shares are similar, but other
/// starts lead to each cycle.
#[test]
fn the_published_basins_have_the_published_shares() {
    const SIDE: u32 = 48;
    let found = |builder: SceneBuilder| {
        let basins = job::run(&builder.build().unwrap(), Processor::Cpu).unwrap().basins().unwrap();
        let [ref first, ref second] = basins.attractors()[..] else { panic!("{:?}", basins.attractors()) };
        assert_eq!(first.cells + second.cells, (SIDE * SIDE) as usize);
        (basins.labels().to_vec(), first.cells as f64 / f64::from(SIDE * SIDE), first.strobe.unwrap())
    };
    let (cosine, phase) = under_cosine(SOUZA);
    let (published, share, strobe) = found(plane(model(SOUZA), SIDE));
    let (turned, _, other) = found(plane(cosine.clone(), SIDE).start_phase(phase));
    let (unturned, ..) = found(plane(cosine, SIDE));
    // The standard error of so many starts is 0.01.
    assert!((share - 0.634).abs() < 0.02, "{share}");
    assert!(off(strobe, other) < 1e-12, "{strobe:?} {other:?}");
    let parted = |other: &[u16]| {
        let differing = published.iter().zip(other).filter(|(a, b)| a != b).count();
        differing as f64 / f64::from(SIDE * SIDE)
    };
    // Long transients part by rounding: a change of alpha by an ulp moves 2.7 % of the starts to the other cycle.
    assert!(parted(&turned) < 0.05 && parted(&unturned) > 0.4, "{} {}", parted(&turned), parted(&unturned));
}

/// A force with a sine and a cosine at another start phase give the same cycles on every engine.
#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn engines_agree_on_a_sine_and_on_a_start_phase() {
    const SIDE: u32 = 16;
    let (cosine, phase) = under_cosine(SOUZA);
    let sine = plane(model(SOUZA), SIDE).build().unwrap();
    let turned = plane(cosine, SIDE).start_phase(phase).build().unwrap();
    let plans = [Plan::new(&sine), Plan::new(&turned)];
    let cpu = |scene: &Scene| -> Vec<Record> {
        job::run(scene, Processor::Cpu).unwrap().cells().map(|cell| cell.record).collect()
    };
    let reference = cpu(&sine);
    // Long transients part by rounding, as above: in single precision 11 % of them.
    let compare = |records: &[Record], bar: f64, most_parted: f64| {
        let mut parted = 0;
        for (record, expected) in records.iter().zip(&reference) {
            assert!(matches!(classify(record), Class::Periodic { period: 1 }), "{record:?}");
            let is_same = record.impacts_per_period == expected.impacts_per_period;
            parted += usize::from(!is_same);
            assert!(!is_same || off(record.strobe(), expected.strobe()) < bar, "{record:?} {expected:?}");
        }
        assert!(parted as f64 <= most_parted * reference.len() as f64, "{parted} starts part");
    };
    compare(&cpu(&turned), 1e-12, 0.05);
    for (precision, bar, most_parted) in [(Precision::F64, 1e-9, 0.08), (Precision::F32, 1e-4, 0.2)] {
        for plan in &plans {
            compare(&gpu::map(plan, &mut gpu::open(precision)), bar, most_parted);
        }
    }
}
