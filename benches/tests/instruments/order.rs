//! Convergence: baselines have their order down to rounding, across impacts and meshing, too. Errors of lanes do not depend on
//! their steps, which only serve to find events.

use rattlemap::gpu::Precision;
use rattlemap_bench::work_precision::cells::{Kind, Subject, subjects};
use rattlemap_bench::work_precision::fixed_step::integrate;
use rattlemap_bench::work_precision::lanes::{Device, Form};
use rattlemap_bench::work_precision::outcome::Outcome;
use rattlemap_bench::work_precision::{PERIODS, adaptive};

/// Errors below this, times the amplification of a cell, are rounding of f64.
const FLOOR: f64 = 1e-13;

/// Errors of the state and of event times; zero if there are no events.
fn errors(subject: &Subject, outcome: &Outcome) -> [f64; 2] {
    let error = outcome.error(&subject.exact, subject.oscillator.period());
    [error.state, error.event.unwrap_or(0.0)]
}

/// Returns the first variant of each cell.
fn first_variants() -> Vec<Subject> {
    let mut all = subjects(5);
    all.dedup_by_key(|subject| subject.cell);
    all
}

/// Whether the motion touches no wall.
fn is_smooth(subject: &Subject) -> bool {
    subject.kind == Kind::Grazing && subject.beyond < Some(0.0)
}

/// Returns the slopes of `ln error` against `ln steps` between doublings of the steps, without pairs at the floor.
fn slopes(errors: &[f64], floor: f64) -> Vec<f64> {
    errors.windows(2).filter(|pair| pair[1] > floor).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

/// Largest difference between the order 4 and the slope of the finest doubling above rounding.
const TOLERANCE: f64 = 0.15;

/// Checks that errors fall by order 4 with each of `count` doublings of the steps, at the end. At least three doublings
/// must lie above rounding. Returns the errors of event times.
#[track_caller]
fn check_order(subject: &Subject, first: u32, count: u32) -> Vec<f64> {
    let results = (0..count).map(|i| errors(subject, &integrate(subject, first << i)));
    let (states, events): (Vec<f64>, Vec<f64>) = results.map(|[state, event]| (state, event)).unzip();
    let slopes = slopes(&states, FLOOR * subject.amplification.max(1.0));
    let at = format!("e = {}, omega = {}", subject.pair.e, subject.pair.omega);
    assert!(slopes.len() >= 3, "{at}: too few errors above rounding: {states:?}");
    let last = slopes[slopes.len() - 1];
    assert!((last - 4.0).abs() < TOLERANCE, "{at}: order {last:.2} instead of 4: {states:?}");
    events
}

#[test]
fn runge_kutta_is_of_order_4_on_smooth_motion() {
    let smooth: Vec<_> = first_variants().into_iter().filter(is_smooth).collect();
    assert_eq!(smooth.len(), 2);
    for subject in &smooth {
        check_order(subject, 128, 5);
    }
}

#[test]
fn runge_kutta_is_of_order_4_across_impacts() {
    for subject in first_variants().iter().filter(|s| matches!(s.kind, Kind::Impacts | Kind::Chaos)) {
        check_order(subject, 64, 5);
    }
}

/// Meshing has a frequency of 39 rad per unit time. The order shows once steps are short compared to that.
#[test]
fn runge_kutta_is_of_order_4_across_meshing_and_chatter() {
    for subject in first_variants().iter().filter(|s| matches!(s.kind, Kind::Meshing | Kind::Chatter)) {
        let events = check_order(subject, 512, 6);
        assert!(events[5] < 1e-3 * events[0], "{:?}: event times do not converge: {events:?}", subject.pair);
    }
}

#[test]
fn errors_of_the_adaptive_library_fall_with_its_tolerance() {
    for subject in &subjects(5) {
        let [coarse, fine] = [1e-6, 1e-12].map(|t| errors(subject, &adaptive::integrate(subject, t))[0]);
        let scale = subject.amplification.max(1.0);
        assert!(fine < 1e-10 * scale, "{:?}: {fine:e}", subject.pair);
        assert!(coarse < 1e-3, "{:?}: {coarse:e}", subject.pair);
    }
}

fn lane_errors(precision: Precision, subjects: &[Subject], steps: u32) -> Vec<[f64; 2]> {
    let mut device = Device::open(precision, Form::Exact, subjects, 1).unwrap();
    let tables = device.load(steps).unwrap();
    let (_, outcomes) = device.run(&tables).unwrap();
    subjects.iter().zip(&outcomes).map(|(subject, outcome)| errors(subject, outcome)).collect()
}

/// Bound on errors of a lane, in units of a rounding and of the square root of the number of steps: roundings make a random
/// walk.
const WALK: f64 = 50.0;

/// At any number of steps the errors are rounding, amplified by the motion.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn errors_of_lanes_do_not_depend_on_their_steps() {
    let subjects = subjects(5);
    for (precision, unit) in [(Precision::F64, f64::EPSILON / 2.0), (Precision::F32, 6e-8)] {
        let mut medians = Vec::new();
        for steps in [16, 64, 256, 1024] {
            let errors = lane_errors(precision, &subjects, steps);
            // A lane takes at least about 32 steps per period.
            let walk = WALK * unit * f64::from(PERIODS * steps.max(32)).sqrt();
            for (subject, [state, event]) in subjects.iter().zip(&errors) {
                let bound = walk * subject.amplification.max(1.0);
                let at = format!("{precision:?}, {steps} steps, {:?}", subject.pair);
                assert!(*state < bound, "{at}: error of the state {state:.1e}");
                assert!(*event < bound, "{at}: error of event times {event:.1e}");
            }
            let mut states: Vec<f64> = errors.iter().map(|[state, _]| *state).collect();
            states.sort_by(f64::total_cmp);
            medians.push(states[states.len() / 2]);
        }
        // At order 1 the last median would be a sixty-fourth of the first.
        assert!(medians[3] > 0.5 * medians[0], "{precision:?}: medians depend on the steps: {medians:?}");
    }
}

/// Both implement the same rules. The one in WGSL uses the model of lanes.
#[test]
fn runge_kutta_in_wgsl_and_in_rust_agree() {
    let subjects = first_variants();
    for form in [Form::RungeKutta, Form::RungeKuttaPhased] {
        let mut device = Device::open(Precision::F64, form, &subjects, 1).unwrap();
        for steps in [256, 2048] {
            let tables = device.load(steps).unwrap();
            let (_, lanes) = device.run(&tables).unwrap();
            for (subject, lane) in subjects.iter().zip(&lanes) {
                let core = integrate(subject, steps);
                let difference = lane.error(&core, subject.oscillator.period());
                let bound = 1e-11 * subject.amplification.max(1.0);
                let at = format!("{form:?}, {steps} steps, {:?}", subject.pair);
                assert!(difference.state < bound, "{at}: states differ by {:.1e}", difference.state);
                assert!(
                    difference.event.unwrap_or(0.0) < bound,
                    "{at}: event times differ by {:?}",
                    difference.event
                );
            }
        }
    }
}
