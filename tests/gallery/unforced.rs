//! Motion without force: cycles with periods of their own, and rest.

use std::f64::consts::{PI, TAU};

use crate::validate::fixtures::{cpu_records, validate_all};
use rattlemap::gpu::Precision;
use rattlemap::map::bifurcation;
use rattlemap::map::plan::Plan;
use rattlemap::map::random::Random;
use rattlemap::map::scene::{Quantity, Scene, Start};
use rattlemap::model_file::FileModel;
use rattlemap::record::classify::classify;
use rattlemap_dynamics::model::{Model, State, state};
use rattlemap_dynamics::orbit::{Class, Orbit, Settings, Status, analyse, trace};

/// Negative damping between two rigid stops.
const STOPS: &str = r#"
name = "self-excited-stops"
parameters = { c = 0.1, e = 0.5, d = 1.0 }
contact = [
    { side = "right", at = "d", law = "impact", restitution = "e" },
    { side = "left", at = "-d", law = "impact", restitution = "e" },
]
[motion]
coordinates = ["x"]
mass = [[1]]
damping = [["-c"]]
stiffness = [[1]]
gap = [1]
"#;

/// A ball above the ground.
const BALL: &str = r#"
name = "ball"
parameters = { e = 1.0, g = 9.81 }
contact = [{ side = "left", at = 0, law = "impact", restitution = "e" }]
[motion]
coordinates = ["h"]
mass = [[1]]
load = ["-g"]
gap = [1]
"#;

/// A mass on a belt, with negative damping.
const BELT: &str = r#"
name = "belt"
parameters = { f = 0.3, u = 0.5, c = 0.05 }
friction = [{ force = "f", speed = "u" }]
[motion]
coordinates = ["x"]
mass = [[1]]
damping = [["-c"]]
stiffness = [[1]]
gap = [1]
"#;

/// Two bodies that push each other along the ground.
const WALKER: &str = r#"
name = "walker"
parameters = { c = 0.1, e = 0.5, f = 0.05 }
contact = [{ side = "right", at = 1, law = "impact", restitution = "e" }]
friction = [{ force = "f", row = [1, 0] }]
[motion]
coordinates = ["x", "y"]
mass = [[1, 0], [0, 0.5]]
damping = [["-c", "c"], ["c", "-c"]]
stiffness = [[1, -1], [-1, 1]]
gap = [1, -1]
"#;

/// Two coordinates with a stop each, one of them compliant.
const TWO_GAPS: &str = r#"
name = "two-gaps"
parameters = { c = 0.12, e = 0.6, mesh = 0.0 }
contact = [
    { gap = "a", side = "right", at = 1, law = "impact", restitution = "e", mesh_speed = "mesh", stiffness = 20, damping = 0.5 },
    { gap = "b", side = "left", at = -1, law = "impact", restitution = "e" },
]
[motion]
coordinates = ["x", "y"]
mass = [[1, 0], [0, 1.3]]
damping = [["-c", 0], [0, 0.03]]
stiffness = [[1.7, -0.7], [-0.7, 1.2]]
gap = { a = [1, 0], b = [0, 1] }
"#;

/// A chain of eight masses whose first one is excited and strikes a stop.
fn chain() -> String {
    let row = |diagonal: &str, off: &str, i: usize| {
        let entry = |j: usize| match i.abs_diff(j) {
            0 => diagonal.to_owned(),
            1 => off.to_owned(),
            _ => "0".to_owned(),
        };
        format!("[{}]", (0..8).map(entry).collect::<Vec<_>>().join(", "))
    };
    let matrix = |diagonal: &str, off: &str, first: &str| {
        let rows = (0..8).map(|i| row(if i == 0 { first } else { diagonal }, off, i));
        rows.collect::<Vec<_>>().join(", ")
    };
    let names: Vec<String> = (1..9).map(|i| format!("'x{i}'")).collect();
    format!(
        "name = 'chain'\nparameters = {{ c = 0.3, e = 0.7 }}\ncontact = [{{ side = 'right', at = 0.5, law = 'impact', restitution = 'e' }}]\n\
         [motion]\ncoordinates = [{}]\nmass = [{}]\ndamping = [{}]\nstiffness = [{}]\ngap = [1, 0, 0, 0, 0, 0, 0, 0]\n",
        names.join(", "),
        matrix("1", "0", "1"),
        matrix("0.02", "-0.005", "'-c'"),
        matrix("2", "-1", "2"),
    )
}

fn model(text: &str) -> FileModel {
    FileModel::parse(text, "model.toml").unwrap()
}

fn orbit(model: &dyn Model, start: &[f64]) -> Orbit {
    analyse(model, state(start), &Settings::default()).unwrap()
}

fn near(a: f64, b: f64, bar: f64) -> bool {
    (a - b).abs() <= bar * b.abs().max(1.0)
}

/// Period, rate after an impact and multiplier follow from `x(T/2) = -x(0)` and `x'(T/2) = -x'(0)`, where the motion from -1 to 1 has the
/// rates u and u / e.
#[test]
fn a_self_excited_mass_between_stops_has_its_own_period_whatever_the_clock_and_the_start() {
    let (period, rate, multiplier) = (4.325_972_966_138_418, 0.360_397_471_8, 0.096_328_464_3);
    for clock in ["", "time_scale = 1\n", "time_scale = '37 + c'\n", "frequency = 4\n"] {
        let model = model(&(STOPS.to_owned() + clock));
        for start in [[0.0, 1.0], [-0.9, 0.0], [0.3, -0.02]] {
            let orbit = orbit(&model, &start);
            assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok), "{clock}");
            assert!(near(orbit.cycle_time.unwrap(), period, 1e-13), "{clock} {:?}", orbit.cycle_time);
            assert_eq!((orbit.word.time_order().as_str(), orbit.symmetric), ("36", Some(true)));
            let [[re, im]] = orbit.floquet.unwrap()[..] else { panic!("one multiplier") };
            assert!(near(re, multiplier, 1e-9) && im == 0.0, "{clock} {re}");
            assert!(near(orbit.lyapunov, multiplier.ln() / period, 1e-8));
            assert!(orbit.events.iter().all(|event| near(event.after[1].abs(), rate, 1e-9)));
            // Motions on one cycle have one strobe state.
            assert!(near(orbit.strobe[1], -1.128_253_076_8, 1e-9), "{clock} {:?}", &orbit.strobe[..2]);
        }
    }
}

#[test]
fn the_motion_of_a_cycle_closes_after_its_time() {
    let model = model(STOPS);
    let orbit = orbit(&model, &[0.0, 1.0]);
    let on_cycle = (&model as &dyn Model).on_cycle(orbit.cycle_time);
    let samples = trace(&*on_cycle, orbit.strobe, orbit.strobe_meshing, 1, 8).unwrap();
    assert!(near(samples[8].t, orbit.cycle_time.unwrap(), 1e-15));
    assert!((0..2).all(|i| near(samples[8].state[i], orbit.strobe[i], 1e-12)));
    // Half a cycle later the motion is mirrored.
    assert!((0..2).all(|i| near(samples[4].state[i], -orbit.strobe[i], 1e-12)));
}

/// A ball without loss has a family of cycles: `T = 2 u / g` for the speed u at the ground.
#[test]
fn cycles_without_loss_are_neutral_families() {
    let ball = model(BALL);
    for height in [0.1, 1.0, 5.0] {
        let orbit = orbit(&ball, &[height, 0.0]);
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Neutral), "{height}");
        let u = (2.0f64 * 9.81 * height).sqrt();
        assert!(near(orbit.cycle_time.unwrap(), 2.0 * u / 9.81, 1e-12), "{height} {:?}", orbit.cycle_time);
        assert_eq!(orbit.floquet.unwrap().len(), 1);
    }
    // An oscillation that touches nothing.
    let spring =
        model(&STOPS.replace("c = 0.1", "c = 0.0").replace("[[1]]\ngap", "[[4]]\ntime_scale = 1\ngap"));
    let orbit = orbit(&spring, &[0.5, 0.3]);
    assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Neutral));
    assert!(near(orbit.cycle_time.unwrap(), PI, 1e-12), "{:?}", orbit.cycle_time);
}

/// A nonlinear mode of two masses, one of them between elastic stops. Matrix exponentials give starts and times. Phase 0 and the energy
/// may be changed, so that a double multiplier is 1.
#[test]
fn a_nonlinear_mode_is_neutral_however_long_it_is_observed() {
    let text = STOPS
        .replace("parameters = { c = 0.1, e = 0.5, d = 1.0 }", "parameters = { d = 1.0 }")
        .replace("law = \"impact\", restitution = \"e\"", "law = \"elastic\", stiffness = 30")
        .replace("[\"x\"]", "[\"x\", \"y\"]")
        .replace(
            "mass = [[1]]\ndamping = [[\"-c\"]]\nstiffness = [[1]]\ngap = [1]",
            "mass = [[1, 0], [0, 1]]\nstiffness = [[2, -1], [-1, 1]]\ngap = [1, 0]",
        );
    let mode = model(&text);
    for (x, y, time) in [
        (1.02, -0.601_362_292_616_955_3, 3.834_168_8),
        (1.05, -0.552_547_600_698_900_5, 3.711_869_96),
        (1.2, -0.340_582_471_891_809_2, 3.015_544_96),
    ] {
        for (transient, observed) in [(100, 128), (400, 128), (400, 512)] {
            let settings =
                Settings { transient_periods: transient, observed_periods: observed, ..Settings::default() };
            let found = analyse(&mode, state(&[x, 0.0, y, 0.0]), &settings).unwrap();
            assert_eq!(
                (found.class, found.status),
                (Class::Periodic { period: 1 }, Status::Neutral),
                "{x} {transient} {observed}"
            );
            assert!(near(found.cycle_time.unwrap(), time, 1e-8), "{x} {:?}", found.cycle_time);
            assert!(found.floquet.unwrap().iter().all(|[re, im]| (re.hypot(*im) - 1.0).abs() < 1e-10));
        }
    }
}

#[test]
fn rest_has_period_1_and_no_cycle_time() {
    let damped = STOPS.replace("c = 0.1", "c = -0.1");
    let clutched = BELT.replace("c = 0.05", "c = -0.05");
    for text in [&damped, &BALL.replace("e = 1.0", "e = 0.7"), &clutched] {
        let orbit = orbit(&model(text), &[0.9, 0.4]);
        assert_eq!((orbit.class, orbit.cycle_time), (Class::Periodic { period: 1 }, None), "{text}");
        assert!(orbit.events.is_empty() && orbit.word.is_empty());
    }
}

/// The mass slides from the speed of the belt back to it, and then moves with the belt until the spring pulls it off at
/// `x = f + c u`.
#[test]
fn stick_slip_on_a_belt_has_its_own_period() {
    let belt = model(BELT);
    let [u, c] = ["u", "c"].map(|name| belt.get(name).unwrap());
    let orbit = orbit(&belt, &[0.0, 1.0]);
    assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok));
    // y = x - f obeys y'' - c y' + y = 0 while the mass slides. It begins at y = c u, y' = u.
    let damped = (1.0 - 0.25 * c * c).sqrt();
    let (y, v) = (c * u, u);
    let (b, grow) = ((v - 0.5 * c * y) / damped, 0.5 * c);
    let at = |t: f64| {
        let (sin, cos) = (damped * t).sin_cos();
        let x = (grow * t).exp() * (y * cos + b * sin);
        [x, grow * x + (grow * t).exp() * damped * (b * cos - y * sin)]
    };
    let (mut low, mut high) = (4.0, TAU);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if at(middle)[1] < u { low = middle } else { high = middle }
    }
    let sliding = 0.5 * (low + high);
    let sticking = (c * u - at(sliding)[0]) / u;
    assert!(sticking > 0.0);
    assert!(
        near(orbit.cycle_time.unwrap(), sliding + sticking, 1e-12),
        "{:?} {}",
        orbit.cycle_time,
        sliding + sticking
    );
    let share = orbit.quantities.unwrap().friction.unwrap().sticking;
    assert!(near(share, sticking / (sliding + sticking), 1e-11));
}

/// Bodies that nothing holds come back to another place.
#[test]
fn a_self_excited_walker_drifts() {
    let walker = model(WALKER);
    let orbit = orbit(&walker, &[0.0, 1.0, 0.1, 0.2]);
    assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok));
    let drift = orbit.quantities.as_ref().unwrap().displacements[0].drift.unwrap();
    let on_cycle = (&walker as &dyn Model).on_cycle(orbit.cycle_time);
    let samples = trace(&*on_cycle, orbit.strobe, orbit.strobe_meshing, 1, 8).unwrap();
    let steps = [0, 2].map(|i| (samples[8].state[i] - samples[0].state[i]) / orbit.cycle_time.unwrap());
    assert!(drift.abs() > 0.01 && steps.iter().all(|step| near(*step, drift, 1e-12)), "{drift} {steps:?}");
    // Four entries of the state, without the shift and the phase.
    assert_eq!(orbit.floquet.unwrap().len(), 2);
}

/// Two masses rest on a belt that moves on. The gap has no walls, so that its row does not matter.
#[test]
fn masses_rest_on_a_moving_belt() {
    let on_belt = |gap: &str| {
        format!(
            "name = 'two-on-belt'\nfriction = [{{ row = [1, 0], force = 0.3, speed = 0.2 }}, {{ row = [0, 1], force = 0.3, speed = 0.2 }}]\n\
             [motion]\ncoordinates = ['a', 'b']\nmass = [[1, 0], [0, 2]]\nstiffness = [[1, -1], [-1, 1]]\ntime_scale = 6\ngap = {gap}\n"
        )
    };
    let one = BELT
        .replace("damping = [[\"-c\"]]\nstiffness = [[1]]", "time_scale = 6")
        .replace("u = 0.5", "u = 0.2");
    for text in [on_belt("[1, 0]"), on_belt("[1, -1]"), on_belt("[0.3, 2]"), one] {
        let orbit = orbit(&model(&text), &[0.0; 4][..if text.contains("'b'") { 4 } else { 2 }]);
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok), "{text}");
        assert_eq!((orbit.cycle_time, orbit.word.time_order().as_str()), (None, ""), "{text}");
        let drift = orbit.quantities.unwrap().displacements[0].drift.unwrap();
        assert!(near(drift, 0.2, 1e-12), "{text} {drift}");
    }
}

/// A motion that moves away from its only wall does not return, however large its positions become.
#[test]
fn a_motion_that_goes_away_has_no_cycle() {
    let text = WALKER
        .replace(
            "friction = [{ force = \"f\", row = [1, 0] }]",
            "friction = [{ force = 0.3, row = [1, 0], speed = -0.2 }]",
        )
        .replace("gap = [1, -1]", "gap = [1, 0]\ntime_scale = 6")
        .replace("[\"-c\", \"c\"], [\"c\", \"-c\"]", "[0, 0], [0, 0]");
    let orbit = orbit(&model(&text), &[0.0, -0.2, 0.0, -0.2]);
    assert_eq!((orbit.class, orbit.cycle_time), (Class::Undecided, None), "{orbit:?}");
}

#[test]
fn maps_without_force_are_judged_and_have_cycle_times() {
    let of = |text: &str, c: [f64; 2], e: [f64; 2], start: &[f64]| {
        let quantities = [
            Quantity::Class,
            Quantity::Lyapunov,
            Quantity::Pattern,
            Quantity::CycleTime,
            Quantity::Amplitude,
        ];
        let scene = Scene::builder(model(text))
            .axis("c", c[0]..=c[1], 3)
            .axis(if text == BELT { "u" } else { "e" }, e[0]..=e[1], 2)
            .start(Start::State(state(start)))
            .quantities(&quantities);
        Plan::new(&scene.build().unwrap())
    };
    let chain = chain();
    let plans = [
        of(STOPS, [0.05, 0.2], [0.3, 0.8], &[0.1, 0.6]),
        of(BELT, [0.02, 0.06], [0.4, 0.6], &[0.0, 1.0]),
        of(TWO_GAPS, [0.1, 0.2], [0.4, 0.7], &[0.5, 0.3, 0.1, 0.2]),
        of(&TWO_GAPS.replace("mesh = 0.0", "mesh = 0.3"), [0.1, 0.2], [0.4, 0.7], &[0.5, 0.3, 0.1, 0.2]),
        of(&chain, [0.25, 0.35], [0.6, 0.8], &[0.3, 0.2]),
    ];
    let mut timed = 0;
    for plan in plans {
        let records = cpu_records(&plan);
        let found = validate_all(&plan, &records, Precision::F64, false);
        assert_eq!(found.faults(), Vec::<String>::new(), "{:?}", found.mismatches);
        let periodic = records.iter().filter(|record| classify(record) == Class::Periodic { period: 1 });
        timed += periodic.filter(|record| record.cycle_time().is_some()).count();
    }
    assert!(timed >= 24, "{timed} of 30 cells have cycles");
}

#[test]
fn a_diagram_without_force_shows_the_section_at_the_walls() {
    let cells: Vec<(f64, Box<dyn Model>)> = [0.3, 0.5, 0.8]
        .into_iter()
        .map(|e| {
            let mut stops = model(STOPS);
            stops.set("e", e).unwrap();
            (e, Box::new(stops) as Box<dyn Model>)
        })
        .collect();
    let never = std::sync::atomic::AtomicBool::new(false);
    let start: State = state(&[0.0, 1.0]);
    let found = bifurcation::run_until(&cells, Start::State(start), &Settings::default(), &|_| (), &never);
    for column in found.unwrap().unwrap() {
        assert_eq!(
            (column.class, column.points.len()),
            (Class::Periodic { period: 1 }, 2),
            "{}",
            column.value
        );
        let [a, b] = [0, 1].map(|i| column.points[i].before[1]);
        assert!(near(a, -b, 1e-12) && column.impact_rate > 0.3);
    }
}

/// Compares cells of a model with random parameters, from one start, with the judge. Returns the number of cells with a cycle time.
fn compare_random<const N: usize>(
    text: &str,
    names: [&str; N],
    ranges: [[f64; 2]; N],
    (start, count): (&[f64], usize),
) -> usize {
    let mut random = Random::new(count as u64);
    let rows: Vec<[f64; N]> =
        (0..count).map(|_| ranges.map(|[low, high]| low + (high - low) * random.unit())).collect();
    let scene = Scene::builder(model(text)).cells(names, &rows).start(Start::State(state(start)));
    let plan = Plan::new(&scene.build().unwrap());
    let records = cpu_records(&plan);
    let found = validate_all(&plan, &records, Precision::F64, false);
    assert_eq!(found.faults(), Vec::<String>::new(), "{text} {:?}", found.mismatches);
    records.iter().filter(|record| record.cycle_time().is_some()).count()
}

/// Compares `n` random models of each shape. Returns the share of those with cycles.
fn compare_shapes(n: usize) -> f64 {
    let two = TWO_GAPS;
    let (loss, more) = ([0.1, 0.95], [0.02, 0.25]);
    let cycles = [
        compare_random(STOPS, ["c", "e", "d"], [[-0.02, 0.3], loss, [0.2, 3.0]], (&[0.1, 0.6], n)),
        compare_random(BELT, ["c", "f", "u"], [[-0.02, 0.1], [0.05, 0.9], [0.1, 1.0]], (&[0.0, 1.0], n)),
        compare_random(two, ["c", "e", "mesh"], [more, loss, [0.0, 0.5]], (&[0.5, 0.3, 0.1, 0.2], n)),
        compare_random(WALKER, ["c", "e", "f"], [more, loss, [0.01, 0.2]], (&[0.0, 1.0, 0.1, 0.2], n)),
        compare_random(&chain(), ["c", "e"], [[0.1, 0.4], loss], (&[0.3, 0.2], n.div_ceil(10))),
    ];
    cycles.iter().sum::<usize>() as f64 / (4.1 * n as f64)
}

#[test]
fn random_models_without_force_are_as_the_judge_says() {
    assert!(compare_shapes(10) > 0.4);
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn six_hundred_random_models_without_force_are_as_the_judge_says() {
    assert!(compare_shapes(150) > 0.4);
}
