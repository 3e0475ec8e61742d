//! Bounds of a lane's work, and the stop flag of a device.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::gpu::{fresh, open, run};
use crate::common::{REST, paper};
use rattlemap::gpu::{GpuError, Lane, LaneSettings, Precision};
use rattlemap_dynamics::orbit::Status;

/// The events of all periods count together.
#[test]
fn a_lane_ends_at_its_limit_of_events() {
    let chatters = paper(0.3, 1.5);
    let settings = LaneSettings { early_stop: false, most_events: 1_000, ..LaneSettings::default() };
    for precision in Precision::ALL {
        let record = run(&mut open(precision), &[(chatters, REST)], &settings)[0];
        assert_eq!(record.status, Status::CapEvents.code(), "{precision:?}: {record:?}");
        assert!((10..200).contains(&record.periods_run), "{precision:?}: {record:?}");
    }
}

/// The lanes take far longer than the test waits.
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
    let lanes = [Lane { flow: 0, law: 0, start: REST }; 64];
    let halt = Arc::new(AtomicBool::new(false));
    gpu.stop_on(&halt);
    // Compiles the shaders first, so that the flag stops lanes.
    let tables = pollster::block_on(gpu.load(&flows, &laws, None)).unwrap();
    let mut pool = pollster::block_on(gpu.pool(&settings)).unwrap();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(300));
            halt.store(true, Ordering::Relaxed);
        });
        let begun: Vec<(u32, Lane)> = (0..).zip(lanes).collect();
        pollster::block_on(gpu.begin(&mut pool, &tables, &begun)).unwrap();
        let ended = pollster::block_on(gpu.advance(&mut pool, &tables, 0)).unwrap();
        assert!(ended.is_empty(), "{}", ended.len());
    });
    assert_eq!(pool.under_way(), lanes.len());
    let ended = pollster::block_on(gpu.run(&flows, &laws, &lanes, &settings));
    assert!(matches!(ended, Err(GpuError::Halted)), "{ended:?}");
}
