//! Cycles of the main plane that lanes once did not find.
//!
//! The lanes need an adapter; none is a failure: see `scripts/test.sh`.

use rattlemap::classify::classify;
use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::model::GearPair;
use rattlemap::orbit::Class;
use rattlemap::record::Record;

/// What lanes that start from rest say of pairs.
fn lanes(precision: Precision, pairs: &[GearPair]) -> Vec<Record> {
    let mut gpu = pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap();
    let flows: Vec<_> = pairs.iter().map(|pair| pair.oscillator().unwrap()).collect();
    let laws: Vec<_> = pairs.iter().map(GearPair::law).collect();
    let lanes: Vec<_> = (0..pairs.len() as u32).map(|i| Lane { flow: i, law: i, start: [0.0; 4] }).collect();
    pollster::block_on(gpu.run(&flows, &laws, &lanes, &LaneSettings::default())).unwrap()
}

/// Seven points within a thousandth of the motion: shorter lags recur, and Newton's method leaves the motion's
/// branch from there. Lanes that set out from the same point again, as if nothing had happened, did so for ever.
#[test]
fn a_cycle_of_close_points_is_found_where_newton_leads_elsewhere() {
    let of = |e, omega| GearPair { omega, ..GearPair::paper(e) };
    let pairs = [of(5.0 / 9.0, 17.0 / 9.0), of(238.0 / 511.0, 1.0 + 11.0 * 44.0 / 511.0)];
    for (precision, pairs) in [(Precision::F64, &pairs[..]), (Precision::F32, &pairs[..1])] {
        for record in lanes(precision, pairs) {
            assert_eq!(classify(&record), Class::Periodic { period: 7 }, "{precision:?}: {record:?}");
        }
    }
}
