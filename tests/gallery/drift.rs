//! Motion that is periodic but for a drift along a rigid-body mode: nothing holds the model to the ground in that direction.

use crate::validate::fixtures::{cpu_records, validate_all};
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::Scene;
use rattlemap::model_file::{FileModel, subjects};
use rattlemap::record::measures;
use rattlemap::validate::independent;
use rattlemap_dynamics::model::{Model, REST, State, state};
use rattlemap_dynamics::motion::{Flow, Trajectory};
use rattlemap_dynamics::orbit::{
    Class, Displacement, Orbit, Settings, Status, analyse, place_of_displacement,
};

/// A driven mass in a capsule that slides on the ground, after Liu, Wiercigroch and Pavlovskaia (2013).
const CAPSULE: &str = r#"
name = "capsule"
parameters = { omega = 1.1, a = 0.9, gamma = 2.5, beta = 10.0, xi = 0.02, d = 0.02 }
friction = [{ row = [0, 1], force = 1 }]
contact = [{ side = "right", at = "d", law = "elastic", stiffness = "beta" }]
[motion]
coordinates = ["x1", "x2"]
mass = [[1, 0], [0, "gamma"]]
damping = [["2*xi", "-2*xi"], ["-2*xi", "2*xi"]]
stiffness = [[1, -1], [-1, 1]]
force = ["a", 0]
frequency = "omega"
gap = [1, -1]
"#;

/// Three inertias on shafts, driven by a mean torque against damping. The last shaft has a backlash.
const DRIVELINE: &str = r#"
name = "driveline"
parameters = { omega = 2.0, k = 4.0, c = 0.1, T = 0.5, F = 0.3 }
contact = [
    { side = "right", at = 0.1, law = "elastic", stiffness = 30, damping = 0.2 },
    { side = "left", at = -0.1, law = "elastic", stiffness = 30, damping = 0.2 },
]
[motion]
coordinates = ["p1", "p2", "p3"]
mass = [[2, 0, 0], [0, 1, 0], [0, 0, 0.5]]
damping = [["0.3 + c", "-c", 0], ["-c", "0.2 + c", 0], [0, 0, 0.1]]
stiffness = [["k", "-k", 0], ["-k", "k", 0], [0, 0, 0]]
load = ["T", 0, 0]
force = ["F", 0, 0]
frequency = "omega"
gap = [0, 1, -1]
"#;

/// Two bodies that nothing holds: their common momentum is conserved.
const FREE: &str = r#"
name = "free-bodies"
parameters = { omega = 1.7, k = 2.0, load = 0.0 }
contact = [{ side = "right", at = 0.3, law = "impact", restitution = 0.6, mesh_speed = 0.001, stiffness = 50, damping = 0.5 }]
[motion]
coordinates = ["x", "y"]
mass = [[1, 0], [0, 3]]
damping = [[0.3, -0.3], [-0.3, 0.3]]
stiffness = [["k", "-k"], ["-k", "k"]]
load = ["load", 0]
force = [1, 0]
frequency = "omega"
gap = [1, -1]
"#;

fn model(text: &str) -> FileModel {
    FileModel::parse(text, "model.toml").unwrap()
}

fn orbit(model: &dyn Model, start: State) -> Orbit {
    analyse(model, start, &Settings::default()).unwrap()
}

fn displacement(orbit: &Orbit, i: usize) -> Displacement {
    orbit.quantities.as_ref().unwrap().displacements[place_of_displacement(i)]
}

/// Checks drift, amplitude and root mean square against samples of the continuous motion.
fn check_samples(model: &dyn Model, orbit: &Orbit) {
    let flow = Flow::of(model).unwrap();
    let (periods, samples) = (orbit.cycle_periods, 20_000);
    let mut trajectory = Trajectory::<0>::new(&flow, model.law(), orbit.strobe);
    let mut points = vec![trajectory.unshifted_state()];
    for _ in 0..periods {
        for i in 1..samples {
            trajectory.advance_to(flow.period * f64::from(i) / f64::from(samples), &mut ()).unwrap();
            points.push(trajectory.unshifted_state());
        }
        trajectory.advance_period(&mut ()).unwrap();
        points.push(trajectory.unshifted_state());
    }
    let time = f64::from(periods) * flow.period;
    for i in 0..flow.state_len() / 2 {
        let of = displacement(orbit, i);
        let drift = (points[points.len() - 1][2 * i] - points[0][2 * i]) / time;
        assert!((of.drift.unwrap() - drift).abs() < 1e-12 * (1.0 + drift.abs()), "{of:?} {drift}");
        let step = time / (points.len() - 1) as f64;
        let rest: Vec<f64> =
            (0..).zip(&points).map(|(n, y)| y[2 * i] - drift * step * f64::from(n)).collect();
        let mean = rest.iter().sum::<f64>() / rest.len() as f64;
        let rms = (rest.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / rest.len() as f64).sqrt();
        let [low, high] =
            rest.iter().fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(*x), high.max(*x)]);
        let amplitude = 0.5 * (high - low);
        assert!((of.amplitude - amplitude).abs() < 2e-4 * amplitude, "{of:?} {amplitude}");
        assert!((of.rms - rms).abs() < 1e-3 * rms, "{of:?} {rms}");
    }
}

#[test]
fn a_capsule_moves_on_and_has_a_cycle() {
    let capsule = model(CAPSULE);
    let orbit = orbit(&capsule, REST);
    assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 2 }, Status::Ok));
    // Another program has followed 60 periods.
    let [x1, v1, x2, v2, ..] = orbit.strobe;
    for (found, right) in [(x1 - x2, 0.187018), (v1, -0.276442), (v2, 0.373916)] {
        assert!((found - right).abs() < 1e-6, "{:?}", orbit.strobe);
    }
    assert_eq!(orbit.floquet.as_ref().map(Vec::len), Some(3), "the multiplier of the shift is left out");
    check_samples(&capsule, &orbit);
    let names = subjects(&capsule);
    let names_of_amplitude: Vec<String> = measures::all()
        .filter(|m| m.group.name == "amplitude" && m.is_of(&names))
        .map(|m| m.name(&names))
        .collect();
    assert_eq!(
        names_of_amplitude.join(" "),
        "amplitude_x1 amplitude_x2 amplitude_gap mean_gap drift_x1 drift_x2 drift_error_x1 drift_error_x2"
    );
}

/// The mean torque is that of the dampers to the ground at the mean speed.
#[test]
fn a_driveline_turns_at_the_speed_of_its_mean_torque() {
    let driveline = model(DRIVELINE);
    let orbit = orbit(&driveline, REST);
    assert!(matches!(orbit.class, Class::Periodic { .. }) && orbit.status == Status::Ok, "{orbit:?}");
    let speed = displacement(&orbit, 0).drift.unwrap();
    assert!((speed - 0.5 / (0.3 + 0.2 + 0.1)).abs() < 1e-10, "{speed}");
    check_samples(&driveline, &orbit);
}

/// Without supports and their dampers, the gear pair keeps its momentum. Both engines find the same cycle.
#[test]
fn both_engines_agree_on_a_gear_pair_without_supports() {
    let text = FileModel::built_in("gear-pair").unwrap().definition().text.clone();
    for damping in [0.6, 0.0] {
        let of = |signal: &str| {
            let mut model = model(&(text.clone() + signal));
            for (name, value) in [("k1", 0.0), ("k2", 0.0), ("r1", damping), ("r2", damping), ("e", 0.3)] {
                model.set(name, value).unwrap();
            }
            let orbit = orbit(&model, state(&[0.0, 0.2, 0.0, 0.2]));
            assert!(matches!(orbit.class, Class::Periodic { .. }), "{damping}: {orbit:?}");
            check_samples(&model, &orbit);
            orbit
        };
        let [pair, machine] = ["", "\n[[signal]]\nname = 'rate'\nvelocity = [1, 0]\n"].map(of);
        assert_eq!(pair.class, machine.class);
        let left_out = if damping > 0.0 { 1 } else { 2 };
        assert_eq!(pair.floquet.as_ref().map(Vec::len), Some(4 - left_out));
        assert_eq!(machine.floquet.as_ref().map(Vec::len), Some(4 - left_out));
        let [a, b] = [&pair, &machine].map(|orbit| displacement(orbit, 1));
        assert!((a.amplitude - b.amplitude).abs() < 1e-9 * a.amplitude, "{damping}: {a:?} {b:?}");
        assert!((a.drift.unwrap() - b.drift.unwrap()).abs() < 1e-9, "{damping}: {a:?} {b:?}");
    }
}

#[test]
fn a_conserved_momentum_decides_the_mean_speed_and_a_load_accelerates() {
    let mut bodies = model(FREE);
    for speed in [0.0, 1.5] {
        let start = state(&[0.0, speed, 0.0, speed]);
        let found = orbit(&bodies, start);
        assert!(matches!(found.class, Class::Periodic { .. }), "{found:?}");
        assert!(
            (displacement(&found, 1).drift.unwrap() - speed).abs() < 1e-9,
            "{:?}",
            displacement(&found, 1)
        );
    }
    bodies.set("load", 0.1).unwrap();
    let found = orbit(&bodies, REST);
    assert_eq!((found.class, found.status), (Class::Undecided, Status::Accelerates));
}

/// The judge shifts states back like the engines, and leaves out the same multipliers.
#[test]
fn maps_that_drift_are_judged() {
    let mut judged = 0;
    for (text, axes) in [
        (CAPSULE, [("omega", 0.9..=1.3), ("a", 0.7..=1.1)]),
        (DRIVELINE, [("omega", 1.5..=2.5), ("T", 0.3..=0.6)]),
        (FREE, [("omega", 1.4..=2.0), ("k", 1.5..=2.5)]),
    ] {
        let [(x, xs), (y, ys)] = axes;
        let scene = Scene::builder(model(text)).axis(x, xs, 3).axis(y, ys, 2).build().unwrap();
        let plan = Plan::new(&scene);
        let records = cpu_records(&plan);
        let found = validate_all(&plan, &records, Precision::F64, false);
        assert_eq!(found.faults(), Vec::<String>::new(), "{:?}", found.mismatches);
        let of = |id: usize| independent::record(&plan, id as u32, &records).filter(|judge| judge.period > 0);
        judged += (0..records.len()).filter_map(of).count();
    }
    assert!(judged >= 9, "{judged} of 18 cells have a period for the judge");
}

#[test]
fn the_drift_of_chaos_has_its_standard_error() {
    let mut errors = Vec::new();
    let mut capsule = model(CAPSULE);
    for (name, value) in [("beta", 100.0), ("d", 0.1)] {
        capsule.set(name, value).unwrap();
    }
    for (omega, a) in (0..12).flat_map(|i| [1.8, 2.5].map(|a| (1.12 + 0.01 * f64::from(i), a))) {
        capsule.set("omega", omega).unwrap();
        capsule.set("a", a).unwrap();
        let found = orbit(&capsule, REST);
        let of = displacement(&found, 0);
        if found.class != Class::Chaotic {
            assert_eq!(of.drift_error, None, "{omega} {a}: {found:?}");
            continue;
        }
        let flow = Flow::of(&capsule).unwrap();
        let mut motion = Trajectory::<0>::new(&flow, capsule.law(), found.strobe);
        let start = motion.unshifted_state()[0];
        (0..4000).for_each(|_| motion.advance_period(&mut ()).unwrap());
        let long = (motion.unshifted_state()[0] - start) / (4000.0 * flow.period);
        errors.push((of.drift.unwrap() - long) / of.drift_error.unwrap());
    }
    assert!(errors.len() >= 12, "{errors:?}");
    assert!(errors.iter().all(|error| error.abs() < 4.0), "{errors:?}");
    let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
    assert!((0.3..2.5).contains(&mean_square), "{mean_square}: {errors:?}");
}
