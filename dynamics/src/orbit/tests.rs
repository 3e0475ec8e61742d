//! Tests of whole cells: the reported class must be the class of the motion that the start reaches.

use super::{Budget, Class, Measurement, Settings, Status, analyse, measure};
use crate::model::{GearPair, REST};
use crate::motion::Flow;

fn budget(early_stop: bool, transient_periods: u32) -> Budget {
    Budget {
        settings: Settings { transient_periods, ..Settings::default() },
        early_stop,
        undecided_periods: 1584,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: true,
        quantities: false,
    }
}

fn cell(pair: &GearPair, budget: &Budget) -> Measurement {
    measure(&Flow::new(&pair.oscillator().unwrap()), pair.law(), REST, budget)
}

fn paper(e: f64, omega: f64) -> GearPair {
    GearPair { omega, ..GearPair::paper(e) }
}

#[test]
fn status_codes_round_trip() {
    for (code, status) in Status::ALL.into_iter().enumerate() {
        assert_eq!(status.code(), code as u32);
        assert_eq!(Status::from_code(code as u32), Some(status));
    }
    assert_eq!(Status::from_code(Status::ALL.len() as u32), None);
}

/// In each cell the motion approaches another cycle for about twenty periods, and then leaves it because an impact
/// turns into meshing.
#[test]
fn a_cycle_that_the_motion_leaves_is_not_reported() {
    for (e, omega, period, impacts) in [
        (0.5949119373776908, 3.7984344422700587, Some(2), 8.5),
        (0.5610367892976589, 3.8959866220735786, None, 12.41),
        (0.5177257525083612, 3.6040133779264214, Some(3), 50.0 / 3.0),
        (0.03522504892367906, 6.9628180039138945, Some(1), 3.0),
        (0.4637964774951076, 1.7749510763209393, Some(15), 311.0 / 15.0),
    ] {
        for early_stop in [true, false] {
            let measured = cell(&paper(e, omega), &budget(early_stop, 400));
            assert_eq!(measured.period, period, "{e} {omega}, early stop {early_stop}");
            assert!((measured.impacts_per_period - impacts).abs() < 0.01, "{e} {omega}");
        }
    }
}

/// The strobe lies 0.0002 after a start of meshing. While strobe states lie behind the wall, the strobe map has a
/// fixed point in front of the wall, which is not a cycle.
#[test]
fn a_fixed_point_in_another_domain_is_no_cycle() {
    let pair = paper(0.22504892367906065, 3.475538160469667);
    for early_stop in [true, false] {
        let measured = cell(&pair, &budget(early_stop, 400));
        assert_eq!((measured.period, measured.symmetric), (Some(1), Some(true)), "early stop {early_stop}");
    }
}

/// Compares early stops with longer integration in a region with many thresholds of meshing.
#[test]
fn early_stops_agree_with_longer_integration() {
    let (mut compared, mut periodic) = (0, 0);
    for n in 0..1500u32 {
        // Kronecker's sequence with the plastic number: evenly distributed points.
        let [a, b] =
            [0.754_877_666_246_692_7, 0.569_840_290_998_053_2].map(|step| (f64::from(n) * step).fract());
        let pair = paper(0.3 + 0.35 * a, 3.6 + 0.3 * b);
        let early = cell(&pair, &budget(true, 400));
        let Some(period) = early.period else { continue };
        periodic += 1;
        let long = cell(&pair, &budget(false, 700));
        if let Some(reached) = long.period {
            compared += 1;
            assert_eq!(
                (period, early.symmetric, &early.word),
                (reached, long.symmetric, &long.word),
                "{pair:?}"
            );
        } else {
            assert_eq!(long.status, Status::Slow, "{pair:?} is not periodic");
        }
    }
    assert!(periodic > 1000 && compared * 100 > periodic * 99, "{compared} of {periodic}");
}

/// Gear 2 rests and is never touched. Its multipliers belong to the cycle, and the largest has modulus 1.
#[test]
fn contact_free_motion_with_one_undamped_gear_at_rest_is_periodic_and_neutral() {
    for (r2, k2) in [(0.0, 20.0), (0.6, 0.0), (0.0, 0.0)] {
        let pair = GearPair { r2, k2, ..paper(0.5, 11.0) };
        let pair = GearPair { force: 5.0, ..pair };
        let orbit = analyse(&pair, REST, &Settings::default()).unwrap();
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Neutral), "{pair:?}");
        assert!(orbit.lyapunov.abs() < 1e-12, "{}", orbit.lyapunov);
        assert_eq!(orbit.floquet.map(|list| list.len()), Some(4));
        for early_stop in [true, false] {
            let measured = cell(&pair, &budget(early_stop, 400));
            assert_eq!((measured.period, measured.status), (Some(1), Status::Neutral), "{pair:?}");
            assert!(measured.lyapunov.unwrap()[0].abs() < 1e-12, "{measured:?}");
        }
    }
}
