//! Bounds of a lane's work, and the stop flag of a device.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::gpu::{fresh, open, run};
use crate::common::{REST, paper};
use rattlemap::gpu::{GpuError, Lane, LaneSettings, Precision, Stage};
use rattlemap_dynamics::orbit::Status;

/// The events of all periods count together.
#[test]
fn a_lane_ends_at_its_limit_of_events() {
    let chatters = paper(0.3, 1.5);
    let settings = LaneSettings { early_stop: false, most_events: 1_000, ..LaneSettings::default() };
    for precision in Precision::ALL {
        let record = &run(&mut open(precision), &[(chatters, REST)], &settings)[0];
        assert_eq!(record.status, Status::CapEvents.code(), "{precision:?}: {record:?}");
        assert!((10..200).contains(&record.periods_run), "{precision:?}: {record:?}");
    }
}

/// The flag is set when the device has the lanes, which would run for hours.
#[test]
fn a_device_stops_when_its_flag_is_set() {
    let pair = paper(0.7, 2.8);
    let mut gpu = fresh(Precision::F32);
    let settings = LaneSettings {
        periods: 100_000_000,
        transient_periods: 90_000_000,
        early_stop: false,
        ..LaneSettings::default()
    };
    let (flows, laws) = ([pair.oscillator().unwrap()], [pair.law()]);
    let lanes: Vec<_> = (0..64).map(|i| (i, Lane { flow: 0, law: 0, start: REST })).collect();
    let tables = pollster::block_on(gpu.load(&flows, &laws, None)).unwrap();
    let mut pool = pollster::block_on(gpu.pool(&settings)).unwrap();
    let halt = Arc::new(AtomicBool::new(false));
    gpu.stop_on(&halt);
    gpu.watch(move |stage| {
        halt.fetch_or(stage == Stage::Uploaded, Ordering::Relaxed);
    });
    pollster::block_on(pool.begin(&gpu, &tables, &lanes)).unwrap();
    let ended = pollster::block_on(pool.advance(&gpu, &tables, 0)).unwrap();
    assert!(ended.is_empty(), "{}", ended.len());
    assert_eq!(pool.under_way(), lanes.len());
    let ended = pollster::block_on(gpu.run(&flows, &laws, &[lanes[0].1], &settings));
    assert!(matches!(ended, Err(GpuError::Halted)), "{ended:?}");
}
