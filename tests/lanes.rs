//! Cycles of the main plane that lanes once did not find.
//!
//! The lanes need an adapter; none is a failure: see `scripts/test.sh`.

use rattlemap::classify::classify;
use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::model::GearPair;
use rattlemap::orbit::Class;
use rattlemap::record::Record;

fn pair(e: f64, omega: f64) -> GearPair {
    GearPair { omega, ..GearPair::paper(e) }
}

/// What lanes that start from rest say of pairs.
fn lanes(precision: Precision, pairs: &[GearPair], settings: &LaneSettings) -> Vec<Record> {
    let mut gpu = pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap();
    let flows: Vec<_> = pairs.iter().map(|pair| pair.oscillator().unwrap()).collect();
    let laws: Vec<_> = pairs.iter().map(GearPair::law).collect();
    let lanes: Vec<_> = (0..pairs.len() as u32).map(|i| Lane { flow: i, law: i, start: [0.0; 4] }).collect();
    pollster::block_on(gpu.run(&flows, &laws, &lanes, settings)).unwrap()
}

/// Seven points within a thousandth of the motion: shorter lags recur, and Newton's method leaves the motion's
/// branch from there. Lanes that set out from the same point again, as if nothing had happened, did so for ever.
#[test]
fn a_cycle_of_close_points_is_found_where_newton_leads_elsewhere() {
    let pairs = [pair(5.0 / 9.0, 17.0 / 9.0), pair(238.0 / 511.0, 1.0 + 11.0 * 44.0 / 511.0)];
    for (precision, pairs) in [(Precision::F64, &pairs[..]), (Precision::F32, &pairs[..1])] {
        for record in lanes(precision, pairs, &LaneSettings::default()) {
            assert_eq!(classify(&record), Class::Periodic { period: 7 }, "{precision:?}: {record:?}");
        }
    }
}

/// Motion that takes thousands of periods to its cycle recurs, and the cycle is read again and again on the way. With a
/// fresh tangent vector after each reading the exponent was 0.17, by 25 standard errors, and the motion chaos.
#[test]
fn cycles_read_on_the_way_leave_the_exponent_alone() {
    let slow = [pair(441.0 / 511.0, 1.0 + 11.0 * 155.0 / 511.0)];
    for precision in Precision::ALL {
        let with =
            |early_stop| LaneSettings { early_stop, undecided_periods: 1584, ..LaneSettings::default() };
        let [on_the_way, undisturbed] = [true, false].map(|stop| lanes(precision, &slow, &with(stop))[0]);
        assert_eq!(classify(&on_the_way), Class::Undecided, "{precision:?}: {on_the_way:?}");
        // Both decrease with time: 2,112 periods and 528.
        for (record, least) in [(on_the_way, -0.0007), (undisturbed, -0.0011)] {
            assert!((least..-0.0005).contains(&record.lyapunov), "{precision:?}: {record:?}");
            assert!(record.lyapunov_error < 1e-4, "{precision:?}: {record:?}");
        }
    }
}
