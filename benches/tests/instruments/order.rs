//! Convergence: baselines by their orders down to rounding, across impacts and meshing too;
//! lanes not at all, since their steps only have to see events.

use rattlemap::gpu::Precision;
use rattlemap_bench::work_precision::cells::{Kind, Subject, subjects};
use rattlemap_bench::work_precision::fixed_step::{Scheme, integrate};
use rattlemap_bench::work_precision::lanes::{Device, Form};
use rattlemap_bench::work_precision::outcome::Outcome;
use rattlemap_bench::work_precision::{PERIODS, adaptive};

/// Errors below this, times what a cell amplifies, are rounding of f64.
const FLOOR: f64 = 1e-13;

fn state_error(subject: &Subject, outcome: &Outcome) -> f64 {
    outcome.error(&subject.truth, subject.oscillator.period()).state
}

fn event_error(subject: &Subject, outcome: &Outcome) -> f64 {
    outcome.error(&subject.truth, subject.oscillator.period()).event.expect("a cell with events")
}

/// The cells at the restitution that the table states.
fn first_variants() -> Vec<Subject> {
    let mut all = subjects(5);
    all.dedup_by_key(|subject| subject.cell);
    all
}

fn of(kind: Kind) -> impl Fn(&Subject) -> bool {
    move |subject| subject.kind == kind
}

/// Never touches a wall in its horizon.
fn is_smooth(subject: &Subject) -> bool {
    subject.kind == Kind::Grazing && subject.beyond < Some(0.0)
}

/// Slopes of `ln error` against `ln steps` between doublings of the steps; pairs at the floor
/// are left out.
fn slopes(errors: &[f64], floor: f64) -> Vec<f64> {
    errors.windows(2).filter(|pair| pair[1] > floor).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

/// How far the slope of the finest doubling above rounding may be off the order.
const TOLERANCE: f64 = 0.15;

/// Errors with doubling steps fall by the order in the end; three doublings at least must lie
/// above rounding.
#[track_caller]
fn assert_order(name: &str, subject: &Subject, order: f64, errors: &[f64]) {
    let slopes = slopes(errors, FLOOR * subject.amplification.max(1.0));
    let at = format!("{name} at e = {}, omega = {}", subject.pair.e, subject.pair.omega);
    println!("{at}: errors {errors:?}, slopes {slopes:.2?}");
    assert!(slopes.len() >= 3, "{at}: too few errors above rounding: {errors:?}");
    let last = slopes[slopes.len() - 1];
    assert!((last - order).abs() < TOLERANCE, "{at}: order {last:.2} instead of {order}: {errors:?}");
}

fn doublings(from: u32, count: u32) -> impl Iterator<Item = u32> {
    (0..count).map(move |i| from << i)
}

#[test]
fn runge_kutta_is_of_order_4_on_smooth_motion() {
    let smooth: Vec<_> = first_variants().into_iter().filter(is_smooth).collect();
    assert_eq!(smooth.len(), 2);
    for subject in &smooth {
        let errors: Vec<_> = doublings(128, 5)
            .map(|n| state_error(subject, &integrate(Scheme::RungeKutta, subject, n)))
            .collect();
        assert_order("smooth", subject, 4.0, &errors);
    }
}

#[test]
fn runge_kutta_is_of_order_4_across_impacts() {
    for subject in first_variants().iter().filter(|s| of(Kind::Impacts)(s) || of(Kind::Chaos)(s)) {
        let outcomes: Vec<_> = doublings(64, 5).map(|n| integrate(Scheme::RungeKutta, subject, n)).collect();
        let states: Vec<_> = outcomes.iter().map(|outcome| state_error(subject, outcome)).collect();
        assert_order("impacts", subject, 4.0, &states);
    }
}

/// Meshing turns at 39 rad per unit time: the order shows once steps are short against that.
#[test]
fn runge_kutta_is_of_order_4_across_meshing_and_chatter() {
    for subject in first_variants().iter().filter(|s| of(Kind::Meshing)(s) || of(Kind::Chatter)(s)) {
        let outcomes: Vec<_> = doublings(512, 6).map(|n| integrate(Scheme::RungeKutta, subject, n)).collect();
        let states: Vec<_> = outcomes.iter().map(|outcome| state_error(subject, outcome)).collect();
        assert_order("meshing", subject, 4.0, &states);
        let events: Vec<_> = outcomes.iter().map(|outcome| event_error(subject, outcome)).collect();
        assert!(events[5] < 1e-3 * events[0], "{:?}: event times do not converge: {events:?}", subject.pair);
    }
}

#[test]
fn semi_implicit_euler_is_of_order_1() {
    for subject in first_variants().iter().filter(|s| is_smooth(s) && s.beyond < Some(-1e-4)) {
        let errors: Vec<_> = doublings(2048, 5)
            .map(|n| state_error(subject, &integrate(Scheme::SemiImplicitEuler, subject, n)))
            .collect();
        assert_order("Euler, smooth", subject, 1.0, &errors);
    }
    for subject in first_variants().iter().filter(|s| of(Kind::Impacts)(s)) {
        let errors: Vec<_> = doublings(4096, 5)
            .map(|n| state_error(subject, &integrate(Scheme::SemiImplicitEuler, subject, n)))
            .collect();
        assert_order("Euler, impacts", subject, 1.0, &errors);
    }
}

#[test]
fn an_adaptive_library_gets_there_by_its_tolerance() {
    for subject in &subjects(5) {
        let [coarse, fine] = [1e-6, 1e-12].map(|t| state_error(subject, &adaptive::integrate(subject, t)));
        let scale = subject.amplification.max(1.0);
        assert!(fine < 1e-10 * scale, "{:?}: {fine:e}", subject.pair);
        assert!(coarse < 1e-3, "{:?}: {coarse:e}", subject.pair);
    }
}

fn lane_errors(precision: Precision, form: Form, subjects: &[Subject], steps: u32) -> Vec<[f64; 2]> {
    let mut device = Device::open(precision, form, subjects, 1).unwrap();
    let tables = device.load(steps).unwrap();
    let (_, outcomes) = device.run(&tables).unwrap();
    let both = |(subject, outcome): (&Subject, &Outcome)| {
        let error = outcome.error(&subject.truth, subject.oscillator.period());
        [error.state, error.event.unwrap_or(0.0)]
    };
    subjects.iter().zip(&outcomes).map(both).collect()
}

/// Roundings of a lane make a random walk: the bound on its errors, in units of a rounding and
/// of the root of the number of steps.
const WALK: f64 = 50.0;

/// Whatever the steps, what is left is rounding, times what the motion makes of it.
#[test]
fn errors_of_lanes_do_not_depend_on_their_steps() {
    let subjects = subjects(5);
    for (precision, unit) in [(Precision::F64, f64::EPSILON / 2.0), (Precision::F32, 6e-8)] {
        let mut medians = Vec::new();
        for steps in [16, 64, 256, 1024] {
            let errors = lane_errors(precision, Form::Exact, &subjects, steps);
            // A lane takes at least about 32 per period.
            let walk = WALK * unit * f64::from(PERIODS * steps.max(32)).sqrt();
            for (subject, [state, event]) in subjects.iter().zip(&errors) {
                let bound = walk * subject.amplification.max(1.0);
                let at = format!("{precision:?}, {steps} steps, {:?}", subject.pair);
                assert!(*state < bound, "{at}: state off by {state:.1e}");
                assert!(*event < bound, "{at}: events off by {event:.1e}");
            }
            let mut states: Vec<f64> = errors.iter().map(|[state, _]| *state).collect();
            states.sort_by(f64::total_cmp);
            medians.push(states[states.len() / 2]);
        }
        println!("{precision:?}: medians {medians:?}");
        // At order 1 they would fall to a sixty-fourth; they do not fall at all.
        assert!(medians[3] > 0.5 * medians[0], "{precision:?}: medians depend on the steps: {medians:?}");
    }
}

/// Both were written from the same rules, one in WGSL on the lane's model, one on its own.
#[test]
fn runge_kutta_in_wgsl_and_in_rust_agree() {
    let subjects = first_variants();
    for form in [Form::RungeKutta, Form::RungeKuttaPhased] {
        let mut device = Device::open(Precision::F64, form, &subjects, 1).unwrap();
        for steps in [256, 2048] {
            let tables = device.load(steps).unwrap();
            let (_, lanes) = device.run(&tables).unwrap();
            for (subject, lane) in subjects.iter().zip(&lanes) {
                let core = integrate(Scheme::RungeKutta, subject, steps);
                let apart = lane.error(&core, subject.oscillator.period());
                let bound = 1e-11 * subject.amplification.max(1.0);
                let at = format!("{form:?}, {steps} steps, {:?}", subject.pair);
                assert!(apart.state < bound, "{at}: states apart by {:.1e}", apart.state);
                assert!(apart.event.unwrap_or(0.0) < bound, "{at}: events apart by {:?}", apart.event);
            }
        }
    }
}
