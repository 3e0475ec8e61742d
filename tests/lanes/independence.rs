//! Records depend on the lane's own cell alone: properties over random cells, batches, dispatch lengths and
//! workgroups.

use std::cell::RefCell;

use crate::common::{REST, gpu, paper};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use rattlemap::gpu::{Gpu, Lane, LaneResult, LaneSettings, Precision};
use rattlemap::record::Record;
use rattlemap_dynamics::model::{GearPair, Law, Oscillator, State, state};

/// Draws a cell of the plane, stiff or soft. Its start may lie beyond a wall.
fn cell() -> impl Strategy<Value = (GearPair, State)> {
    let pair = (0.0..=1.0, 1.0..12.0, 100.0..3000.0, prop_oneof![Just(0.0), 1e-4..0.1])
        .prop_map(|(e, omega, k, mesh_speed)| GearPair { k, mesh_speed, ..paper(e, omega) });
    let start =
        prop_oneof![Just(REST), prop::array::uniform4(-0.6..0.6).prop_map(|start: [f64; 4]| state(&start))];
    (pair, start)
}

/// How the work is divided.
#[derive(Debug)]
struct Cut {
    batch: usize,
    iterations: u32,
    workgroup: u32,
    /// Rotation of the order of lanes.
    turn: usize,
}

fn cut(workgroups: &[u32]) -> impl Strategy<Value = Cut> + use<> {
    (1..40usize, 60..4000u32, prop::sample::select(workgroups.to_vec()), 0..24usize)
        .prop_map(|(batch, iterations, workgroup, turn)| Cut { batch, iterations, workgroup, turn })
}

fn records(
    device: &mut Gpu,
    (flows, laws): (&[Oscillator], &[Law]),
    lanes: &[Lane],
    settings: &LaneSettings,
) -> Vec<Record> {
    pollster::block_on(device.run(flows, laws, lanes, settings)).unwrap()
}

#[test]
fn records_do_not_depend_on_how_the_work_is_cut() {
    check_cuts(Precision::F32, &[64]);
}

/// The layout of f64 differs.
#[test]
#[ignore = "compiles a dozen shaders; scripts/test.sh --all"]
fn records_do_not_depend_on_the_workgroup() {
    Precision::ALL.into_iter().for_each(|precision| check_cuts(precision, &[32, 64]));
}

/// Compares all fields of all records, to the bit, over batch sizes, dispatch lengths, workgroup sizes and
/// neighbours.
fn check_cuts(precision: Precision, workgroups: &[u32]) {
    let mut runner = TestRunner::new(ProptestConfig { cases: 10, ..ProptestConfig::default() });
    let device = RefCell::new(gpu::open(precision));
    let cases = (prop::collection::vec(cell(), 24), cut(workgroups), any::<bool>(), any::<bool>());
    runner
        .run(&cases, |(cells, cut, early_stop, exponent)| {
            let (flows, laws, mut lanes) = gpu::lanes(&cells);
            // Long enough for chaos and for cycles that are read without success.
            let budget = LaneSettings {
                periods: 60,
                transient_periods: 20,
                undecided_periods: 200,
                chaos_from: 40,
                ..LaneSettings::default()
            };
            let settings = LaneSettings { exponent_from: 10, early_stop, exponent, ..budget };
            let device = &mut device.borrow_mut();
            let mut whole = records(device, (&flows, &laws), &lanes, &settings);
            lanes.rotate_left(cut.turn);
            whole.rotate_left(cut.turn);
            let Cut { batch, iterations, workgroup, .. } = cut;
            let settings = LaneSettings { batch: Some(batch), iterations, workgroup, ..settings };
            prop_assert_eq!(records(device, (&flows, &laws), &lanes, &settings), whole);
            Ok(())
        })
        .unwrap();
}

/// Lanes that begin while others run, in slots of lanes that have ended or in a pool that has grown, have the records
/// of lanes that run together. With the dispatch policy of a card, each of few lanes has a warp of its own, and one kernel integrates
/// all lanes that read no cycle.
#[test]
fn records_do_not_depend_on_when_lanes_begin() {
    check_begins(&[(Precision::F32, false)]);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn records_of_each_dispatch_policy_do_not_depend_on_when_lanes_begin() {
    check_begins(&[(Precision::F64, false), (Precision::F32, true)]);
}

/// Checks devices of these precisions, each with the policy of a card or of a software driver.
fn check_begins(devices: &[(Precision, bool)]) {
    let pair = |i: u32| paper(f64::from(i * 23 % 60) / 60.0, 1.0 + f64::from(i * 37 % 60) / 6.0);
    let cells: Vec<_> = (0..60).map(|i| (pair(i), REST)).collect();
    let (flows, laws, together) = gpu::lanes(&cells);
    let lanes: Vec<(u32, Lane)> = (1000..).zip(together.iter().copied()).collect();
    let settings = LaneSettings { iterations: 500, ..LaneSettings::default() };
    for &(precision, is_dedicated) in devices {
        let mut device = gpu::open(precision);
        if is_dedicated {
            device.drive_as_dedicated();
        }
        let expected = records(&mut device, (&flows, &laws), &together, &settings);
        let tables = pollster::block_on(device.load(&flows, &laws, None)).unwrap();
        let mut pool = pollster::block_on(device.pool(&settings)).unwrap();
        let mut ended = Vec::new();
        // First five lanes begin, then more than the pool has slots for, then as many as have ended.
        for (from, to, left) in [(0, 5, 3), (5, 9, 6), (9, 40, 12), (40, 48, 10), (48, 60, 1), (60, 60, 0)] {
            pollster::block_on(pool.begin(&device, &tables, &lanes[from..to])).unwrap();
            // `advance` returns after a while if some lanes have ended.
            loop {
                let some = pollster::block_on(pool.advance(&device, &tables, left)).unwrap();
                assert!(
                    pool.under_way() <= left || !some.is_empty(),
                    "{} of {left} are left",
                    pool.under_way()
                );
                ended.extend(some);
                if left > 0 || pool.under_way() == 0 {
                    break;
                }
            }
            assert_eq!(ended.len() + pool.under_way(), to);
        }
        assert!(pollster::block_on(pool.advance(&device, &tables, 0)).unwrap().is_empty());
        assert_eq!(pool.under_way(), 0);
        ended.sort_by_key(LaneResult::number);
        let numbers: Vec<u32> = ended.iter().map(LaneResult::number).collect();
        assert_eq!(numbers, (1000..1060).collect::<Vec<_>>());
        for (ended, expected) in ended.iter().zip(&expected) {
            assert_eq!(ended.record(tables.constants()), *expected, "{precision:?}, lane {}", ended.number());
        }
    }
}
