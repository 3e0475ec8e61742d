//! Friction that is larger at rest or depends on the sliding rate, nonlinear springs, and walls with a force law.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::atomic::AtomicBool;

use crate::common::built_in;
use crate::validate::fixtures::{cpu_records, validate_all};
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::Scene;
use rattlemap::model_file::FileModel;
use rattlemap::validate::independent;
use rattlemap_dynamics::model::{Model, REST, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, Orbit, Settings, Status, analyse, history, state_at};

/// Test SDND106 of Code_Aster: a force pulls the second of two masses, and the first one sticks until the spring exceeds the friction at
/// rest.
const PULLED: &str = r#"
name = "pulled"
parameters = { m = 5.0, k = 1e4, F = 3000.0, sliding = 2000.0 }
friction = [{ row = [1, 0], force = "sliding", static = 3000 }]
[motion]
coordinates = ["x1", "x2"]
mass = [["m", 0], [0, "m"]]
stiffness = [["k", "-k"], ["-k", "k"]]
load = [0, "F"]
gap = [1, -1]
"#;

fn orbit(model: &dyn Model, start: State) -> Orbit {
    analyse(model, start, &Settings::default()).unwrap()
}

fn at(model: &dyn Model, start: State, time: f64) -> State {
    let flow = Flow::of(model).unwrap();
    state_at(&flow, model.law(), start, time, &AtomicBool::new(false)).unwrap().unwrap()
}

/// The second mass swings until the spring's force reaches 3,000. Then the centre of mass has a constant acceleration, and the spring
/// swings about (3,000 + 2,000) / (2 k).
#[test]
fn friction_at_rest_holds_more_than_sliding_friction() {
    let model = FileModel::parse(PULLED, "pulled.toml").unwrap();
    let (m, k) = (5.0_f64, 1e4_f64);
    let slow = (k / m).sqrt();
    let (time, speed) = (0.15 - FRAC_PI_2 / slow, 0.3 * slow);
    let centre = 0.15 + 0.5 * speed * time + 0.5 * (1000.0 / (2.0 * m)) * time * time;
    let (sin, cos) = ((2.0 * k / m).sqrt() * time).sin_cos();
    let length = 0.25 + 0.05 * cos + speed / (2.0 * k / m).sqrt() * sin;
    let found = at(&model, REST, 0.15);
    assert!((found[0] - (centre - 0.5 * length)).abs() < 1e-12, "{found:?}");
    assert!((found[2] - (centre + 0.5 * length)).abs() < 1e-12, "{found:?}");
    // The handbook prints 1.35332 for x1.
    assert!((found[0] - 1.35332).abs() < 2e-5, "{found:?}");
}

/// With a constant sliding friction and without damper, the mass sticks for the time `2 (fs - f0) / u`, and slides along an arc about `f0`
/// for the time `pi + 2 atan(u / (fs - f0))`.
#[test]
fn stick_and_slip_on_a_belt_have_a_closed_form() {
    for (u, fs, f0) in [(0.2, 1.0, 0.8), (0.1, 0.3, 0.2), (0.5, 0.9, 0.1)] {
        let values = [("u", u), ("fs", fs), ("f0", f0), ("fd", f0), ("r", 0.0)];
        let found = orbit(&built_in("belt-oscillator", &values), state(&[0.0, u]));
        let excess: f64 = fs - f0;
        let time = 2.0 * excess / u + PI + 2.0 * (u / excess).atan();
        assert_eq!(found.class, Class::Periodic { period: 1 });
        assert!((found.cycle_time.unwrap() - time).abs() < 1e-12 * time, "{:?}, {time}", found.cycle_time);
        let amplitude = found.quantities.unwrap().displacements[0].amplitude;
        assert!((amplitude - excess.hypot(u)).abs() < 1e-12, "{amplitude}");
        assert_eq!(found.word.time_order(), "7");
    }
}

/// Integrates `x'' = force(x, v, t)` by the classical Runge-Kutta method.
fn runge_kutta(force: impl Fn(f64, f64, f64) -> f64, start: [f64; 2], time: f64, steps: u32) -> [f64; 2] {
    let h = time / f64::from(steps);
    (0..steps).fold(start, |[x, v], i| {
        let t = h * f64::from(i);
        let a = [v, force(x, v, t)];
        let b = [v + 0.5 * h * a[1], force(x + 0.5 * h * a[0], v + 0.5 * h * a[1], t + 0.5 * h)];
        let c = [v + 0.5 * h * b[1], force(x + 0.5 * h * b[0], v + 0.5 * h * b[1], t + 0.5 * h)];
        let d = [v + h * c[1], force(x + h * c[0], v + h * c[1], t + h)];
        let sum = |i: usize| h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        [x + sum(0), v + sum(1)]
    })
}

/// The cycle of Duffing's equation tends to that of a fine integration as the tolerance falls.
#[test]
fn the_duffing_oscillator_converges_with_the_tolerance() {
    let values = [("omega", 1.2), ("F", 0.3), ("r", 0.1), ("k", 1.0), ("reach", 2.0)];
    let period = TAU / 1.2;
    let force = |x: f64, v: f64, t: f64| 0.3 * (1.2 * t).cos() - 0.1 * v - x - x.powi(3);
    let exact = (0..200).fold([0.9, 0.5], |state, _| runge_kutta(force, state, period, 2000));
    let mut before = f64::INFINITY;
    for (tolerance, most) in [(1e-2, 3e-2), (3e-3, 3e-3), (1e-3, 5e-4), (3e-4, 1e-4)] {
        let model = built_in("duffing", &[&values[..], &[("tol", tolerance)]].concat());
        let found = orbit(&model, state(&[0.9, 0.5]));
        assert_eq!((found.class, found.status), (Class::Periodic { period: 1 }, Status::Ok));
        let error = (found.strobe[0] - exact[0]).hypot(found.strobe[1] - exact[1]);
        assert!(error < before.min(most), "{tolerance}: {error}");
        before = error;
    }
}

/// K. L. Johnson, Contact Mechanics, section 11.4: contact lasts `(2 d / v) times the integral of 1 / sqrt(1 - s^2.5) from 0 to 1`, where
/// `d = (5 v^2 / (4 k))^0.4` is the largest depth of a ball of mass 1.
#[test]
fn a_hertzian_bounce_lasts_as_long_as_its_closed_form() {
    // The integral: sqrt(pi) Gamma(7/5) / Gamma(9/10).
    const INTEGRAL: f64 = 1.471_637_592_162_353;
    for (speed, tolerance, most) in [(1.0, 1e-3, 1e-4), (1.0, 2e-4, 1e-5), (3.0, 1e-3, 1e-4)] {
        let depth = (5.0 * speed * speed / 4000.0_f64).powf(0.4);
        let values = [("A", 0.0), ("g", 0.0), ("c", 0.0), ("deepest", 1.2 * depth), ("tol", tolerance)];
        let model = built_in("hertz-ball", &values);
        let flow = Flow::of(&model).unwrap();
        let history = history(&flow, model.law(), state(&[-0.1, speed]), (0, 1), 1, &AtomicBool::new(false))
            .unwrap()
            .unwrap();
        let times: Vec<f64> = history.events.iter().map(|event| event.t).collect();
        let (lasts, exact) = (times[1] - times[0], 2.0 * depth / speed * INTEGRAL);
        assert!((lasts - exact).abs() < most * exact, "{speed} {tolerance}: {lasts}, {exact}");
    }
}

#[test]
fn a_spring_beyond_its_range_is_told() {
    let model = |reach: f64| built_in("duffing", &[("omega", 1.7), ("F", 1.0), ("r", 0.3), ("reach", reach)]);
    assert_eq!(orbit(&model(5.0), REST).status, Status::Ok);
    assert_eq!(orbit(&model(0.2), REST).status, Status::OutOfRange);
}

/// DOP853 finds the same classes, words and multipliers.
#[test]
fn maps_of_the_new_laws_are_judged() {
    for (name, axes) in [
        ("duffing", [("omega", 0.8..=1.8), ("F", 2.0..=8.0)]),
        ("hertz-ball", [("omega", 1.0..=3.0), ("A", 0.8..=2.0)]),
        ("belt-oscillator", [("u", 0.1..=1.0), ("fs", 0.8..=1.4)]),
    ] {
        let [(x, xs), (y, ys)] = axes;
        let scene = Scene::builder(built_in(name, &[])).axis(x, xs, 4).axis(y, ys, 3).build().unwrap();
        let plan = Plan::new(&scene);
        let records = cpu_records(&plan);
        let found = validate_all(&plan, &records, Precision::F64, false);
        assert_eq!(found.faults(), Vec::<String>::new(), "{name}: {:?}", found.mismatches);
        let of = |id: usize| independent::record(&plan, id as u32, &records).filter(|judge| judge.period > 0);
        assert!((0..records.len()).filter_map(of).count() >= 4, "{name}");
    }
}
