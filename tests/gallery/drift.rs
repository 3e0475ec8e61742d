//! Motion that is periodic but for a drift along a rigid-body mode: nothing holds the model to the ground in that direction.

use nalgebra::DVector;

use crate::validate::fixtures::{cpu_records, validate_all};
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::Scene;
use rattlemap::model_file::{FileModel, subjects};
use rattlemap::record::measures;
use rattlemap::validate::independent;
use rattlemap_dynamics::model::{Model, REST, State, state};
use rattlemap_dynamics::motion::{Flow, Trajectory, place_of_displacement, place_of_gap, place_of_signal};
use rattlemap_dynamics::orbit::{Class, Displacement, Orbit, Settings, Status, analyse};

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

/// A mass that a load and a force push over the ground. The gap has no walls.
const SLIDER: &str = r#"
name = "slider"
parameters = { c = 0.5, load = 0.3, f = 0.2 }
friction = [{ force = "f" }]
[motion]
coordinates = ["x"]
mass = [[1]]
damping = [["c"]]
load = ["load"]
force = [1]
frequency = 1
gap = [1]
"#;

/// Two bodies on a spring, which a load pushes against friction.
const PUSHED: &str = r#"
name = "pushed"
parameters = { load = 2.0, other = 0.0, f = 1.0, g = 0.0 }
friction = [{ row = [0, 1], force = "f" }, { row = [1, 1], force = "g" }]
[motion]
coordinates = ["a", "b"]
mass = [[1, 0], [0, 1]]
damping = [[0.1, -0.1], [-0.1, 0.1]]
stiffness = [[1, -1], [-1, 1]]
load = ["load", "other"]
time_scale = 5
gap = [1, -1]
"#;

fn model(text: &str) -> FileModel {
    FileModel::parse(text, "model.toml").unwrap()
}

fn set<const N: usize>(model: &mut FileModel, values: [(&str, f64); N]) {
    values.iter().for_each(|(name, value)| model.set(name, *value).unwrap());
}

fn orbit(model: &dyn Model, start: State) -> Orbit {
    analyse(model, start, &Settings::default()).unwrap()
}

fn displacement(orbit: &Orbit, i: usize) -> Displacement {
    orbit.quantities.as_ref().unwrap().displacements[place_of_displacement(i)]
}

/// Checks numbers of all displacements, gaps and signals of displacements against samples of the continuous motion.
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
    let step = time / (points.len() - 1) as f64;
    let oscillator = model.oscillator().unwrap();
    let unit = |i: usize| DVector::from_fn(oscillator.degrees(), |j, _| f64::from(u8::from(i == j)));
    let coordinates = (0..oscillator.degrees()).map(|i| (place_of_displacement(i), unit(i)));
    let gaps = oscillator.gaps.iter().enumerate().map(|(i, gap)| (place_of_gap(i), gap.row.clone()));
    let signals = oscillator.signals.iter().enumerate();
    let signals = signals.map(|(i, signal)| (place_of_signal(i), signal.displacement.clone()));
    for (place, row) in coordinates.chain(gaps).chain(signals) {
        let of = orbit.quantities.as_ref().unwrap().displacements[place];
        let values: Vec<f64> =
            points.iter().map(|y| (0..row.len()).map(|j| row[j] * y[2 * j]).sum()).collect();
        let drift = (values[values.len() - 1] - values[0]) / time;
        let is_moved =
            oscillator.rigid_modes().modes.iter().any(|mode| row.dot(&mode.direction).abs() > 1e-9);
        assert_eq!(of.drift.is_some(), is_moved, "{place} {row}");
        assert!((of.drift.unwrap_or(0.0) - drift).abs() < 1e-12 * (1.0 + drift.abs()), "{of:?} {drift}");
        let rest: Vec<f64> = (0..).zip(&values).map(|(n, x)| x - drift * step * f64::from(n)).collect();
        let mean = rest.iter().sum::<f64>() / rest.len() as f64;
        // The position of a displacement that a mode moves is arbitrary, so its mean is left out.
        let [mean, centre] = if is_moved { [0.0, mean] } else { [mean, 0.0] };
        let rms = (rest.iter().map(|x| (x - centre).powi(2)).sum::<f64>() / rest.len() as f64).sqrt();
        let [low, high] =
            rest.iter().fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(*x), high.max(*x)]);
        let amplitude = 0.5 * (high - low);
        assert!((of.amplitude - amplitude).abs() <= 2e-4 * amplitude, "{of:?} {amplitude}");
        assert!((of.rms - rms).abs() <= 1e-3 * rms, "{of:?} {rms}");
        assert!((of.mean - mean).abs() <= 1e-3 * rms, "{of:?} {mean}");
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
            set(&mut model, [("k1", 0.0), ("k2", 0.0), ("r1", damping), ("r2", damping), ("e", 0.3)]);
            let orbit = orbit(&model, state(&[0.0, 0.2, 0.0, 0.2]));
            assert!(matches!(orbit.class, Class::Periodic { .. }), "{damping}: {orbit:?}");
            check_samples(&model, &orbit);
            orbit
        };
        let [pair, machine] = ["", "\n[[signal]]\nname = 'both'\ndisplacement = [2, 1]\n"].map(of);
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

/// Where dampers do not act, a load beyond all friction accelerates the motion, and a smaller one does not.
#[test]
fn a_load_beyond_friction_accelerates() {
    let mut slider = model(SLIDER);
    for (damping, load, accelerates) in
        [(0.0, 0.3, true), (0.0, -0.3, true), (0.0, 0.1, false), (0.5, 0.3, false)]
    {
        set(&mut slider, [("c", damping), ("load", load)]);
        let found = orbit(&slider, REST);
        assert_eq!(found.status == Status::Accelerates, accelerates, "{damping} {load}: {found:?}");
        assert_eq!(found.class == Class::Undecided, accelerates, "{damping} {load}: {found:?}");
    }
    let mut pushed = model(PUSHED);
    let found = orbit(&pushed, REST);
    assert_eq!((found.class, found.status), (Class::Undecided, Status::Accelerates));
    // Only the sum of the loads counts, and friction opposes it with f + 2 g.
    for (load, g, accelerates) in [(2.0, 0.4, true), (2.0, 0.6, false), (0.9, 0.0, false)] {
        set(&mut pushed, [("load", load), ("g", g)]);
        assert_eq!(pushed.oscillator().unwrap().rigid_modes().accelerates, accelerates, "{load} {g}");
    }
    // Friction that falls holds the load at rest, but not a fast motion.
    let text = SLIDER
        .replace("force = \"f\"", "force_at_speed = [[0, 0.4], [0.5, 0.2]]")
        .replace("force = [1]", "time_scale = 6")
        .replace("frequency = 1\n", "");
    let mut falling = model(&text);
    falling.set("c", 0.0).unwrap();
    for (speed, class) in [(0.1, Class::Periodic { period: 1 }), (2.0, Class::Undecided)] {
        let found = orbit(&falling, state(&[0.0, speed]));
        assert_eq!(found.class, class, "{speed}: {found:?}");
    }
    // Without the spring, friction holds the loads where |other - load| <= 1 and |load| <= 1.
    let loose = PUSHED
        .replace("stiffness = [[1, -1], [-1, 1]]\n", "")
        .replace("[[0.1, -0.1], [-0.1, 0.1]]", "[[0, 0], [0, 0]]");
    let mut loose = model(&loose);
    loose.set("g", 1.0).unwrap();
    for (load, other, accelerates) in
        [(0.95, 1.9, false), (0.5, 1.9, true), (1.2, 0.5, true), (-0.9, 0.2, true)]
    {
        set(&mut loose, [("load", load), ("other", other)]);
        assert_eq!(loose.oscillator().unwrap().rigid_modes().accelerates, accelerates, "{load} {other}");
    }
}

/// A gap without walls hits nothing, so it may move with its mode.
#[test]
fn a_gap_without_walls_may_drift() {
    let second = [
        ("\"x\"]", "\"x\", \"dummy\"]"),
        ("[[1]]", "[[1, 0], [0, 1]]"),
        ("damping = [[\"c\"]]", "damping = [[\"c\", 0], [0, 1]]\nstiffness = [[0, 0], [0, 1]]"),
        ("[\"load\"]", "[\"load\", 0]"),
        ("force = [1]", "force = [1, 0]"),
        ("gap = [1]", "gap = [0, 1]"),
        ("force = \"f\"", "row = [1, 0], force = \"f\""),
    ];
    let with_second = second.iter().fold(SLIDER.to_owned(), |text, (from, to)| text.replace(from, to));
    for gap in ["[0, 1]", "[1, 0]", "[-2, 0.7]"] {
        let slider = model(&with_second.replace("gap = [0, 1]", &format!("gap = {gap}")));
        check_slider(&slider);
    }
    check_slider(&model(SLIDER));
}

/// Another program has followed the closed forms of sliding from event to event.
fn check_slider(slider: &FileModel) {
    let orbit = orbit(slider, REST);
    assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok));
    let drift = displacement(&orbit, 0).drift.unwrap();
    assert!((drift - 0.444_517_437_348).abs() < 1e-11, "{drift}");
    check_samples(slider, &orbit);
}

/// The judge shifts states back like the engines, and leaves out the same multipliers.
#[test]
fn maps_that_drift_are_judged() {
    let judged = [
        (CAPSULE, [("omega", 0.9..=1.3), ("a", 0.7..=1.1)]),
        (DRIVELINE, [("omega", 1.5..=2.5), ("T", 0.3..=0.6)]),
        (FREE, [("omega", 1.4..=2.0), ("k", 1.5..=2.5)]),
        (SLIDER, [("c", 0.4..=0.8), ("load", 0.2..=0.4)]),
    ]
    .map(|(text, [(x, xs), (y, ys)])| {
        let scene = Scene::builder(model(text)).axis(x, xs, 3).axis(y, ys, 2).build().unwrap();
        let plan = Plan::new(&scene);
        let records = cpu_records(&plan);
        let found = validate_all(&plan, &records, Precision::F64, false);
        assert_eq!(found.faults(), Vec::<String>::new(), "{:?}", found.mismatches);
        let of = |id: usize| independent::record(&plan, id as u32, &records).filter(|judge| judge.period > 0);
        (0..records.len()).filter_map(of).count()
    });
    // The number of cells, of 6 in each map, that have a period for the judge.
    let [capsule, driveline, free, slider] = judged;
    assert!(capsule + driveline + free >= 9 && slider == 6, "{judged:?}");
}

#[test]
fn the_drift_of_chaos_has_its_standard_error() {
    let mut errors = Vec::new();
    let mut capsule = model(CAPSULE);
    set(&mut capsule, [("beta", 100.0), ("d", 0.1)]);
    for (omega, a) in (0..12).flat_map(|i| [1.8, 2.5].map(|a| (1.12 + 0.01 * f64::from(i), a))) {
        set(&mut capsule, [("omega", omega), ("a", a)]);
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
