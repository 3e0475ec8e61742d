//! Classification of motions that are difficult to classify.

use nalgebra::{DMatrix, DVector};

use crate::common::linear::{unforced, with_wall};
use crate::common::{BUDGET, REST, flow_of, paper as cell};
use rattlemap_dynamics::model::{
    Contact, Domain, Drive, DryFriction, Forces, Form, GapRow, GearPair, Law, Model, Oscillator, Pair, Side,
    State, Stops, Timing, state,
};
use rattlemap_dynamics::motion::{Flow, Trajectory};
use rattlemap_dynamics::orbit::{
    Class, EVENT_PERIODS, LONGEST_WINDOW, Orbit, Settings, Status, analyse, analyse_flow, analyse_until,
    measure,
};

fn orbit(pair: &GearPair) -> Orbit {
    analyse(pair, REST, &Settings::default()).unwrap()
}

/// Returns a state of the symmetry-conjugate orbit at phase 0: the mirror image of the state half a period later.
fn conjugate(pair: &GearPair, strobe: State) -> State {
    let flow = flow_of(pair);
    let mut half = Trajectory::new(&flow, pair.law(), strobe);
    half.advance_to(0.5 * flow.period, &mut ()).unwrap();
    half.state().map(|value| -value)
}

#[test]
fn an_orbit_with_its_strobe_in_a_contact_onset_is_periodic() {
    // At phase 0 the teeth mesh although the gap is still 1e-6 in front of the wall, as in free motion.
    for (e, omega) in [(0.44, 2.05875), (0.27, 3.14375), (0.02, 3.96625)] {
        let pair = cell(e, omega);
        let orbit = orbit(&pair);
        let gap = (orbit.strobe[0] - orbit.strobe[2]).abs();
        assert!(gap < pair.b && pair.b - gap < 1e-5, "the strobe is not in a contact onset: {gap}");
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{e} {omega}");
        assert_eq!(orbit.status, Status::Ok, "{e} {omega}");
    }
}

#[test]
fn symmetry_conjugate_orbits_differ_only_in_the_side() {
    let pair = cell(0.56, 5.6);
    let one = orbit(&pair);
    let other = analyse(&pair, conjugate(&pair, one.strobe), &Settings::default()).unwrap();
    assert_eq!((one.class, other.class), (Class::Periodic { period: 1 }, Class::Periodic { period: 1 }));
    assert_eq!((one.symmetric, other.symmetric), (Some(false), Some(false)));
    assert!((one.strobe[0] - other.strobe[0]).abs() > 1e-3, "both orbits are the same");
    assert!((one.lyapunov - other.lyapunov).abs() < 1e-9);
    assert_eq!(one.word.mirrored(), other.word);
    // A symmetric orbit is its own conjugate.
    let alone = orbit(&cell(0.2, 5.6));
    let mirrored = conjugate(&cell(0.2, 5.6), alone.strobe);
    assert!((0..4).all(|i| (mirrored[i] - alone.strobe[i]).abs() < 1e-12), "{mirrored:?}");
}

#[test]
fn banded_chaos_after_a_grazing_bifurcation_is_chaotic() {
    // The motion always stays near a period-10 cycle, but nearby motions separate.
    for e in [0.6054, 0.6058] {
        let orbit = orbit(&GearPair::paper(e));
        assert_eq!((orbit.class, orbit.status), (Class::Chaotic, Status::Ok), "{e}");
        assert!(orbit.lyapunov > 3.0 * orbit.lyapunov_error.unwrap(), "{e}");
    }
}

/// A chaotic band with a width of 1 % of the motion lies near a stable cycle. From one check to the next, the motion
/// may come closer to the cycle by chance.
#[test]
fn a_chaotic_band_near_a_stable_cycle_is_chaotic() {
    let narrow = GearPair {
        m1: 1.5100944943278496,
        m2: 2.2228992243566275,
        r1: 1.166979760399095,
        r2: 0.4475983236152271,
        k1: 48.95640243390158,
        k2: 81.18240655778291,
        r: 0.0,
        k: 4.550185120183626,
        force: 8.916912390336938,
        b: 0.01034097498992998,
        mesh_speed: 0.00020785654785843188,
        ..cell(0.28434052631578943, 0.89809)
    };
    for pair in [cell(0.698037, 5.960782), narrow] {
        for transient_periods in [400, 700, 701] {
            let settings = Settings { transient_periods, ..Settings::default() };
            assert_eq!(
                analyse(&pair, REST, &settings).unwrap().class,
                Class::Chaotic,
                "after {transient_periods}"
            );
        }
    }
    for pair in [cell(0.6980392156862745, 5.96078431372549), narrow] {
        assert_eq!(measure(&flow_of(&pair), pair.law(), REST, &BUDGET).period, None);
    }
}

/// With a multiplier of 0.99995 the distance hardly shrinks from one check to the next.
#[test]
fn a_slow_approach_is_recognised_after_any_transient() {
    for transient_periods in [5000, 20_000] {
        let settings = Settings { transient_periods, ..Settings::default() };
        let orbit = analyse(&cell(0.7941176470588235, 3.3294117647058825), REST, &settings).unwrap();
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "after {transient_periods}");
    }
}

#[test]
fn an_escape_from_an_unstable_cycle_is_not_chaos() {
    // The motion starts on the symmetric orbit, which is unstable here. Nearby motions separate for hundreds of
    // periods until the unsymmetric orbit is reached.
    let below = orbit(&GearPair::paper(0.541));
    let pair = GearPair::paper(0.545);
    let symmetric = below.strobe;
    let orbit = analyse(&pair, symmetric, &Settings { transient_periods: 1, ..Settings::default() }).unwrap();
    assert_eq!(orbit.class, Class::Periodic { period: 1 });
    assert_eq!(orbit.symmetric, Some(false));
}

/// The oscillator `x'' + x = 0.1 cos(omega t)`, which does not reach its walls.
fn undamped(omega: f64) -> Stops {
    Stops { k: 1.0, force: 0.1, omega, ..Stops::with_restitution(0.5) }
}

#[test]
fn undamped_motion_is_quasi_periodic() {
    let pair = GearPair { r1: 0.0, r2: 0.0, force: 1e-3, ..cell(0.5, 11.0) };
    let settings = Settings { transient_periods: 10, ..Settings::default() };
    for model in [&pair as &dyn Model, &undamped(7f64.sqrt())] {
        let orbit = analyse(model, REST, &settings).unwrap();
        assert_eq!((orbit.class, orbit.status), (Class::QuasiPeriodic, Status::Ok));
        assert!(orbit.periods_run < 3000, "{} periods", orbit.periods_run);
    }
}

/// The exponent is -0.0009, and after 48 periods the motion is within 2e-4: the averages of its long cycle are regular.
#[test]
fn the_end_of_a_period_doubling_cascade_is_not_quasi_periodic() {
    let pair = cell(0.9789473684210527, 5.747368421052632);
    let measured = measure(&flow_of(&pair), pair.law(), REST, &BUDGET);
    assert!(!measured.is_quasi_periodic, "{measured:?}");
    assert_ne!(orbit(&pair).class, Class::QuasiPeriodic);
}

/// The multipliers are `exp(+-2 pi i / omega)`, and after 5 periods of 3/5 the free frequency every motion repeats.
#[test]
fn the_steady_motion_of_an_undamped_oscillator_is_neutral() {
    let omega = 7f64.sqrt();
    let steady = state(&[0.1 / (1.0 - omega * omega)]);
    let orbit = analyse(&undamped(omega), steady, &Settings::default()).unwrap();
    assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Neutral));
    let (sin, cos) = (std::f64::consts::TAU / omega).sin_cos();
    let multipliers = orbit.floquet.unwrap();
    assert_eq!(multipliers.len(), 2);
    for ([re, im], exact) in multipliers.into_iter().zip([sin.abs(), -sin.abs()]) {
        assert!((re - cos).abs() < 1e-13 && (im - exact).abs() < 1e-13, "{re} {im}");
    }
    assert!(orbit.lyapunov.abs() < 1e-13, "{}", orbit.lyapunov);
    let repeating = analyse(&undamped(5.0 / 3.0), REST, &Settings::default()).unwrap();
    assert_eq!((repeating.class, repeating.status), (Class::Periodic { period: 5 }, Status::Neutral));
    // A motion nearby stays nearby.
    let nearby =
        analyse(&undamped(omega), state(&[1.01 * steady[0], 0.0, 0.0, 0.0]), &Settings::default()).unwrap();
    assert!(nearby.class == Class::QuasiPeriodic || nearby.status == Status::Neutral, "{nearby:?}");
}

/// Gear 2 has no support, so its multipliers are 1 and 1 while it stays at rest. Those of gear 1 are
/// `exp((-0.15 +- i sqrt(15 - 0.15^2)) T)`.
#[test]
fn a_free_body_at_rest_is_neutral_and_has_all_multipliers() {
    let pair = GearPair { r2: 0.0, k2: 0.0, ..cell(0.8, 11.0) };
    let orbit = orbit(&pair);
    assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Neutral));
    let period = std::f64::consts::TAU / 11.0;
    let (radius, angle) = ((-0.15 * period).exp(), (15.0f64 - 0.15 * 0.15).sqrt() * period);
    let [re, im] = [radius * angle.cos(), radius * angle.sin()];
    let exact = [[1.0, 0.0], [1.0, 0.0], [re, im], [re, -im]];
    for (ours, exact) in orbit.floquet.unwrap().into_iter().zip(exact) {
        assert!((0..2).all(|i| (ours[i] - exact[i]).abs() < 1e-13), "{ours:?}, not {exact:?}");
    }
    let measured = measure(&flow_of(&pair), pair.law(), REST, &BUDGET);
    assert_eq!((measured.period, measured.status), (Some(1), Status::Neutral));
    assert_eq!((measured.lyapunov, measured.multiplier), (Some([0.0, 0.0]), Some([1.0, 0.0])));
    // If gear 2 has damping but no support, one of its multipliers is 1.
    let damped = measure(&flow_of(&GearPair { k2: 0.0, ..pair }), pair.law(), REST, &BUDGET);
    assert_eq!((damped.status, damped.lyapunov), (Status::Neutral, Some([0.0, 0.0])));
}

#[test]
fn progress_reports_grow_and_end_with_the_analysis() {
    let reports = std::cell::RefCell::new(Vec::new());
    let (pair, halt) = (cell(0.7222, 2.8172), false.into());
    let report = |done, total| reports.borrow_mut().push((done, total));
    let settings = Settings::default();
    let orbit = analyse_until(&pair, REST, &settings, LONGEST_WINDOW, EVENT_PERIODS, &halt, &report);
    let periods = orbit.unwrap().unwrap().periods_run;
    let reports = reports.into_inner();
    assert!(reports.len() as u64 == periods / 64 && periods > 500, "{} of {periods}", reports.len());
    assert!(reports.windows(2).all(|two| two[0].0 < two[1].0 && two[0].1 <= two[1].1), "{reports:?}");
    assert!(reports.iter().all(|(done, total)| done <= total), "{reports:?}");
}

#[test]
fn motion_with_too_many_events_has_failed() {
    let pair = GearPair { b: 1e-9, ..cell(1.0, 5.6) };
    let orbit = orbit(&pair);
    assert_eq!((orbit.class, orbit.status), (Class::Failed, Status::CapEvents));
    assert!(orbit.events.is_empty());
}

#[test]
fn without_force_the_motion_stays_at_rest() {
    let orbit = orbit(&GearPair { force: 0.0, ..cell(0.5, 5.6) });
    assert_eq!(orbit.class, Class::Periodic { period: 1 });
    assert_eq!(orbit.strobe, REST);
    assert!(orbit.word.is_empty());
    assert!((orbit.lyapunov + 0.15).abs() < 1e-9, "{}", orbit.lyapunov);
}

#[test]
fn a_quasi_static_orbit_with_zero_velocity_at_the_strobe_is_periodic() {
    // The velocities at phase 0 are rounding errors.
    let orbit = orbit(&cell(0.5, 0.001));
    assert_eq!((orbit.class, orbit.symmetric), (Class::Periodic { period: 1 }, Some(true)));
    assert_eq!(orbit.word.time_order(), "121213454546");
}

#[test]
fn neutral_motion_is_not_chaos() {
    // Gears without supports and damping that never meet: nearby motions separate in proportion to time.
    let pair = GearPair { k1: 0.0, k2: 0.0, r1: 0.0, r2: 0.0, b: 5.0, ..cell(0.605, 5.6) };
    assert_ne!(orbit(&pair).class, Class::Chaotic);
}

/// Without supports, the common translation of both gears is not coupled to their relative motion. A tangent vector
/// along it would not show chaos.
#[test]
fn chaos_of_a_pair_without_supports_is_recognised() {
    let pair = GearPair {
        m1: 16.0,
        m2: 0.26,
        r1: 0.0,
        r2: 0.0,
        k1: 0.0,
        k2: 0.0,
        force: -730.0,
        b: 0.0155,
        mesh_speed: 0.0,
        ..cell(1.0, 7.3)
    };
    let clattering = GearPair { k1: 0.0, k2: 0.0, r1: 0.0, r2: 0.0, ..cell(0.605, 5.6) };
    let settings = Settings { transient_periods: 20, observed_periods: 200, max_period: 64 };
    for pair in [pair, clattering] {
        let orbit = analyse(&pair, REST, &settings).unwrap();
        assert_eq!(orbit.class, Class::Chaotic, "{pair:?}");
        // The gaps of two nearby motions separate.
        let flow = flow_of(&pair);
        let gap = |speed: f64| {
            let mut trajectory = Trajectory::new(&flow, pair.law(), state(&[0.0, speed]));
            (0..200).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
            let [x1, _, x2, _, ..] = trajectory.state();
            x1 - x2
        };
        assert!((gap(1e-10) - gap(0.0)).abs() > 1e-3 * pair.b, "{pair:?}");
    }
}

#[test]
fn exponents_are_right_if_tangents_leave_the_range_of_f64_in_one_period() {
    // Without contact the largest exponent is the exponent of the slower support, -0.15, for every period.
    for omega in [1.0, 0.01, 0.001] {
        let orbit = orbit(&GearPair { b: 1e6, ..cell(0.5, omega) });
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{omega}");
        assert!((orbit.lyapunov + 0.15).abs() < 1e-9, "{omega}: {}", orbit.lyapunov);
    }
}

/// A symmetric cycle of period 5 whose strobes lie partly in meshing and partly in free motion.
#[test]
fn a_symmetric_cycle_with_strobes_in_different_domains_is_found() {
    let pair = GearPair {
        m1: 0.19829369296457494,
        m2: 0.16481503350571672,
        r1: 0.7128113202276247,
        r2: 0.04627789270791416,
        k1: 0.1954662279504476,
        k2: 4.405273555023123,
        r: 0.006787690015440622,
        k: 0.0,
        force: -22.829526459853465,
        omega: 0.7616376809036782,
        b: 3.9759925668661555,
        e: 0.9422111622332906,
        mesh_speed: 60.746353712543986,
    };
    let orbit = analyse(&pair, REST, &Settings::default()).unwrap();
    assert_eq!((orbit.class, orbit.symmetric), (Class::Periodic { period: 5 }, Some(true)));
    assert_eq!(orbit.word, orbit.word.mirrored());
}

/// Two equal pendulums, one of which is driven off its resonance, collide for ever.
#[test]
fn an_undecided_motion_ends_within_10_000_periods() {
    let free = Domain { damping: [[0.0; 2]; 2], stiffness: [[1.0, 0.0], [0.0, 1.0]], load: [0.0; 2] };
    let pendulums = Pair { gap: [1.0, -1.0], omega: 0.7, force: [0.1, 0.0], ..unforced(2, free) };
    let flow = Flow::new(&with_wall(pendulums, Side::Right, 0.0, Contact::Rigid, [0.0; 2]));
    let orbit = analyse_flow(&flow, Law::both(0.3, 0.0), state(&[1.0]), &Settings::default(), 8);
    assert_eq!(orbit.class, Class::Undecided);
    assert!((8_000..=10_000).contains(&orbit.periods_run), "{}", orbit.periods_run);
}

/// The least mass of the Hilbert matrix is 1e-10.
#[test]
fn a_machine_that_is_too_stiff_says_so_at_once() {
    let mass = DMatrix::from_fn(8, 8, |i, j| 1.0 / (i + j + 1) as f64);
    let unit = || DVector::from_fn(8, |i, _| if i == 0 { 1.0 } else { 0.0 });
    let stiffness = DMatrix::identity(8, 8);
    let machine = Oscillator {
        omega: 0.8,
        timing: Timing::Forced,
        mass,
        stages: vec![Forces { damping: DMatrix::zeros(8, 8), stiffness, load: DVector::zeros(8) }],
        schedule: Vec::new(),
        drives: vec![Drive { order: 1, cos: unit(), sin: DVector::zeros(8) }],
        gaps: vec![GapRow { row: unit(), walls: Default::default() }],
        friction: vec![DryFriction::new(unit(), 0.1, 0.0)],
        springs: Vec::new(),
        signals: Vec::new(),
    };
    let (flow, law) = (Flow::new(Form::Machine(machine)), Law::both(0.0, 0.0));
    let orbit = analyse_flow(&flow, law, REST, &Settings::default(), 8);
    let cell = measure(&flow, law, REST, &BUDGET);
    assert_eq!((orbit.status, orbit.periods_run), (Status::TooStiff, 0));
    assert_eq!((cell.status, cell.periods_run), (Status::TooStiff, 0));
}
