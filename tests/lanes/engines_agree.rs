//! Compares cells on the reference with lanes in both precisions.
//!
//! Without an adapter the tests fail: install a software driver (see `scripts/test.sh`).

use crate::common::gpu::{open, run};
use crate::common::pairs::AsPair;
use crate::common::table::{Row, rows};
use crate::common::{REST, apart, flow_of, paper as pair};
use rattlemap::gpu::{Lane, LaneSettings, Precision};
use rattlemap::record::distance::{farther, is_within};
use rattlemap_dynamics::model::{GearPair, Law, Pair, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::States;
use rattlemap_dynamics::motion::{EventKind, GapEvent, Observer, Trajectory};
use rattlemap_dynamics::orbit::{Class, Settings, Status, analyse};
use rayon::prelude::*;

/// Returns the strobe states of the reference after `periods` and after one more.
fn reference(pair: &GearPair, start: State, periods: u32) -> [State; 2] {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), start);
    for _ in 0..periods {
        trajectory.advance_period(&mut ()).unwrap();
    }
    let at = trajectory.state();
    trajectory.advance_period(&mut ()).unwrap();
    [at, trajectory.state()]
}

/// Factor for other devices, drivers and processors than the measured one: llvmpipe with AVX2.
const ROOM: f64 = 5.0;

/// Returns the allowed error, from the errors measured in f32 and in f64.
fn bar(measured: [f64; 2], precision: Precision) -> f64 {
    let [f32, f64] = measured;
    ROOM * match precision {
        Precision::F32 => f32,
        Precision::F64 => f64,
    }
}

/// Returns the change of the reference's final state if its start moves by about the rounding of a precision. It is
/// large where a chaotic transient chooses between attractors.
fn sensitivity(pair: &GearPair, horizon: u32, precision: Precision) -> f64 {
    let perturbation = match precision {
        Precision::F32 => 1e-6,
        Precision::F64 => 1e-14,
    };
    let centre = reference(pair, REST, horizon)[0];
    let ends = (0..8).map(|i| {
        let mut start = REST;
        start[i % 4] = if i < 4 { perturbation } else { -perturbation };
        apart(reference(pair, start, horizon)[0], centre)
    });
    ends.fold(0.0, farther)
}

/// Compares cells after `horizon` periods. `measured`: largest errors, relative to the reference, in f32 and in f64.
fn check(cells: &[(GearPair, State)], horizon: u32, measured: [f64; 2]) {
    let expected: Vec<_> =
        cells.par_iter().map(|(pair, start)| reference(pair, *start, horizon)[0]).collect();
    for precision in Precision::ALL {
        let records = run(&mut open(precision), cells, &LaneSettings::only(horizon));
        let mut worst = 0.0f64;
        for ((record, expected), (pair, start)) in records.iter().zip(&expected).zip(cells) {
            let at = format!("{precision:?}, e = {}, omega = {} from {start:?}", pair.e, pair.omega);
            assert_eq!(record.status, Status::Ok.code(), "{at}");
            assert_eq!(record.periods_run, horizon, "{at}");
            let error = apart(record.strobe(), *expected);
            let bar = bar(measured, precision);
            assert!(error < bar, "{at}: off by {error:.2e}: {:?} {expected:?}", record.strobe());
            worst = worst.max(error);
        }
        println!("{precision:?}: {} cells after {horizon} periods, worst {worst:.2e}", cells.len());
    }
}

/// Strobe states of stable cells of period 1 over the plane.
#[test]
fn stable_cells_of_the_plane_agree() {
    const HORIZON: u32 = 200;
    const SIDE: u32 = 27;
    let step = |i: u32, lo: f64, hi: f64| lo + (hi - lo) * f64::from(i) / f64::from(SIDE - 1);
    let all: Vec<_> =
        (0..SIDE * SIDE).map(|i| (pair(step(i % SIDE, 0.0, 1.0), step(i / SIDE, 1.0, 12.0)), REST)).collect();
    let (cells, expected): (Vec<_>, Vec<State>) = all
        .into_par_iter()
        .filter_map(|cell| {
            let [at, next] = reference(&cell.0, cell.1, HORIZON);
            (apart(at, next) < 1e-10).then_some((cell, at))
        })
        .unzip();
    // The reference finds 484.
    assert!(cells.len() >= 470, "{} stable cells are too few", cells.len());
    // Measured in f64: median 4.0e-15, 99 % 9.4e-14, worst 1.6e-12; in f32: median 8.6e-7, 99 % 2.3e-5, and the worst
    // is a transient that ends on another attractor. The bars are five times these values, and twice the median in
    // f32.
    for (precision, median_bar, bar_99, worst_bar) in
        [(Precision::F64, 2e-14, 5e-13, 8e-12), (Precision::F32, 2e-6, 1.2e-4, 1e-3)]
    {
        let records = run(&mut open(precision), &cells, &LaneSettings::only(HORIZON));
        let mut errors: Vec<_> = records
            .iter()
            .zip(&expected)
            .zip(&cells)
            .map(|((record, expected), (pair, _))| (apart(record.strobe(), *expected), pair.e, pair.omega))
            .collect();
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |share: usize| errors[(errors.len() - 1) * share / 100];
        println!(
            "{precision:?}: {} cells, median {:?}, 99 % {:?}, worst {:?}",
            errors.len(),
            at(50),
            at(99),
            at(100)
        );
        assert!(at(50).0 < median_bar, "{precision:?}: median {:?}", at(50));
        assert!(at(99).0 < bar_99, "{precision:?}: 99 % {:?}", at(99));
        for &(error, e, omega) in errors.iter().filter(|(error, ..)| !is_within(*error, worst_bar)) {
            let own = sensitivity(&pair(e, omega), HORIZON, precision);
            assert!(
                own > 0.1 * error,
                "{precision:?}, e = {e}, omega = {omega}: off by {error:.2e}, sensitive to {own:.2e}"
            );
        }
    }
}

/// Every kind of motion, over a horizon short enough for chaos.
#[test]
fn every_kind_of_motion_agrees() {
    let on_wall = |w: f64| state(&[0.25, 0.5 + w, -0.25, 0.5]);
    let cells = [
        (pair(0.5, 11.5), REST),                    // no contact
        (pair(0.605, 5.6), REST),                   // impacts on both walls
        (pair(0.06, 5.6), REST),                    // meshing on both sides
        (pair(0.0, 2.0), REST),                     // meshing without restitution
        (pair(0.56, 1.5), REST),                    // chatter into meshing
        (pair(0.72, 1.5), REST),                    // long chatter
        (pair(0.7, 5.4), REST),                     // chaos
        (pair(0.606, 5.6), REST),                   // grazing chaos
        (pair(0.5, 5.6), on_wall(1.0)),             // starts on the wall, closing
        (pair(0.5, 5.6), on_wall(-1.0)),            // starts on the wall, leaving
        (pair(0.5, 5.6), on_wall(0.0)),             // starts at rest on the wall
        (pair(0.3, 4.0), state(&[0.4, 0.0, -0.2])), // starts meshing on the right
        (pair(0.3, 4.0), state(&[-0.4, 0.0, 0.2])), // starts meshing on the left
    ];
    check(&cells, 6, [5.0e-6, 1.3e-14]);
    // No loss at the walls: errors grow by a factor of twenty in a period.
    check(&[(pair(1.0, 3.0), REST)], 2, [1.9e-5, 1.2e-13]);
}

/// Counts the impacts of the reference.
struct Impacts(u32);

impl Observer for Impacts {
    fn event(&mut self, happening: &GapEvent, _: States<'_>) {
        self.0 += u32::from(happening.kind == EventKind::Impact);
    }
}

/// Without a meshing speed, infinite sequences of impacts are closed by their limit. Lanes then have the reference's
/// states, and its impacts before the limit.
#[test]
fn closed_chatter_agrees_with_the_reference() {
    const HORIZON: u32 = 4;
    let endless = |e: f64, omega: f64| GearPair { mesh_speed: 0.0, ..pair(e, omega) };
    let rows = [0.05, 0.2, 0.4, 0.6, 0.75].map(|e| [0.3, 1.0, 1.7, 2.5, 5.6].map(|omega| endless(e, omega)));
    let cells: Vec<_> = rows.into_iter().flatten().map(|pair| (pair, REST)).collect();
    check(&cells, HORIZON, [1.4e-4, 8.6e-14]);
    let expected: Vec<u32> = cells
        .iter()
        .map(|(pair, start)| {
            let flow = flow_of(pair);
            let mut trajectory = Trajectory::new(&flow, pair.law(), *start);
            let mut impacts = Impacts(0);
            (0..HORIZON).for_each(|_| trajectory.advance_period(&mut impacts).unwrap());
            impacts.0
        })
        .collect();
    let meshing = run(&mut open(Precision::F64), &cells, &LaneSettings::only(HORIZON));
    assert!(meshing.iter().filter(|record| record.mesh_fraction > 0.0).count() > 10, "too little chatter");
    for precision in Precision::ALL {
        let records = run(&mut open(precision), &cells, &LaneSettings::only(HORIZON));
        for ((record, &impacts), (pair, _)) in records.iter().zip(&expected).zip(&cells) {
            let counted = record.impacts_per_period * f64::from(HORIZON);
            let at = format!("{precision:?}, e = {}, omega = {}", pair.e, pair.omega);
            assert!((counted - f64::from(impacts)).abs() < 0.5, "{at}: {counted} impacts, {impacts}");
        }
    }
}

/// Exponents of cycles that mesh after infinite sequences of impacts: tangent vectors pass the limit.
#[test]
fn exponents_through_closed_chatter_agree_with_the_reference() {
    let cells: Vec<_> = [(0.3, 1.3), (0.2, 2.0), (0.1, 5.6), (0.5, 1.0)]
        .map(|(e, omega)| (GearPair { mesh_speed: 0.0, ..pair(e, omega) }, REST))
        .into();
    for precision in Precision::ALL {
        let records = run(&mut open(precision), &cells, &LaneSettings::default());
        for (record, (pair, start)) in records.iter().zip(&cells) {
            let expected = analyse(pair, *start, &Settings::default()).unwrap();
            let at = format!("{precision:?}, e = {}, omega = {}", pair.e, pair.omega);
            println!("{at}: {} {} {:?}", record.lyapunov, expected.lyapunov, expected.class);
            assert_eq!(Class::Periodic { period: record.period }, expected.class, "{at}");
            assert!((record.impacts_per_period - expected.impacts_per_period).abs() < 1e-9, "{at}");
            assert_eq!(record.word().as_ref(), Some(&expected.word), "{at}");
            let error = (record.lyapunov - expected.lyapunov).abs();
            assert!(error < bar([1.3e-7, 3.4e-13], precision), "{at}: {error:.2e}");
        }
    }
}

/// `z = A cos(omega t)`, with the amplitude slightly below or above the wall: a free flight that misses the wall by
/// less than a grid would show, and one that touches it.
#[test]
fn grazing_contacts_are_found_exactly() {
    let e = 0.8;
    for hair in [1e-3, 1e-5] {
        for sign in [-1.0, 1.0] {
            let omega = 10.5;
            let stiff = GearPair { k1: 30.0, r1: 0.0, r2: 0.0, ..pair(e, omega) };
            // Steady response of gear 1 alone; gear 2 is at rest.
            let unit = 1.0 / (stiff.k1 - stiff.m1 * omega * omega);
            let amplitude = -(stiff.b + sign * hair);
            let grazing = GearPair { force: amplitude / unit, ..stiff };
            let start = state(&[amplitude]);
            // Where the amplitude exceeds the wall, the motion starts at rest.
            let start = if sign > 0.0 { REST } else { start };
            let expected = reference(&grazing, start, 2)[0];
            for precision in Precision::ALL {
                let record = &run(&mut open(precision), &[(grazing, start)], &LaneSettings::only(2))[0];
                let error = apart(record.strobe(), expected);
                assert!(
                    error < bar([1.7e-6, 2.7e-15], precision),
                    "{precision:?}, {hair} {sign}: {error:.2e}"
                );
                if sign < 0.0 {
                    assert_eq!(record.impacts_per_period, 0.0, "{precision:?}: a false impact");
                }
            }
        }
    }
}

/// Every row of the independent program's table: from rest over a short horizon; the periodic rows also after a long
/// transient.
#[test]
fn every_row_of_the_table_agrees() {
    let from_rest = |row: &Row| (row.pair(), REST);
    let rows = rows();
    check(&rows.iter().map(from_rest).collect::<Vec<_>>(), 4, [1.3e-4, 1.2e-13]);
    let periodic: Vec<_> = rows.iter().filter(|row| !row.is_chaotic()).map(from_rest).collect();
    check(&periodic, 300, [2.9e-5, 1.3e-13]);
}

/// Lanes with impossible parameters end in a status and do not change their neighbours.
#[test]
fn impossible_parameters_end_in_a_status() {
    let ordinary: Vec<_> = (0..9).map(|i| (pair(0.1 * f64::from(i), 5.6), REST)).collect();
    let hostile = [
        (GearPair { k: 1e13, ..pair(0.2, 1.0) }, REST, Status::TooStiff),
        (GearPair { omega: 1e-6, ..pair(0.2, 1.0) }, REST, Status::TooStiff),
        (GearPair { mesh_speed: 0.0, ..pair(0.9999, 0.1) }, REST, Status::CapEvents),
        (GearPair { force: 1e300, ..pair(0.5, 5.6) }, REST, Status::NonFinite),
        (pair(0.5, 5.6), state(&[f64::NAN]), Status::NonFinite),
    ];
    let mut mixed = Vec::new();
    for (i, cell) in ordinary.iter().enumerate() {
        mixed.push(*cell);
        if let Some(&(pair, start, _)) = hostile.get(i) {
            mixed.push((pair, start));
        }
    }
    for precision in Precision::ALL {
        let mut gpu = open(precision);
        let alone = run(&mut gpu, &ordinary, &LaneSettings::only(5));
        let together = run(&mut gpu, &mixed, &LaneSettings::only(5));
        for (i, record) in alone.iter().enumerate() {
            let at = if i <= hostile.len() { 2 * i } else { i + hostile.len() };
            assert!(*record == together[at], "{precision:?}: ordinary lane {i} was disturbed");
        }
        for (i, (pair, _, status)) in hostile.iter().enumerate() {
            let record = &together[2 * i + 1];
            assert_eq!(record.status, status.code(), "{precision:?}: {pair:?}");
            assert!(record.strobe().iter().all(|x| x.is_finite()), "{precision:?}: {pair:?}");
        }
    }
}

/// The right wall alone, with a gap that the forcing drives into it.
#[test]
fn one_wall_agrees_with_the_reference() {
    let pairs: Vec<GearPair> = [(0.2, 2.2), (0.5, 3.1), (0.3, 4.4), (0.6, 5.2), (0.0, 6.1), (0.4, 7.3)]
        .map(|(e, omega)| pair(e, omega))
        .to_vec();
    let oscillators: Vec<Pair> = pairs
        .iter()
        .map(|pair| {
            let pair = pair.pair();
            Pair { walls: [pair.walls[0], f64::NEG_INFINITY], ..pair.clone() }
        })
        .collect();
    let laws: Vec<Law> = pairs.iter().map(GearPair::law).collect();
    let lanes: Vec<Lane> = (0..pairs.len() as u32).map(|i| Lane { flow: i, law: i, start: REST }).collect();
    let horizon = 40;
    for precision in Precision::ALL {
        let mut gpu = open(precision);
        let settings = LaneSettings::only(horizon);
        let records = pollster::block_on(gpu.run(&oscillators, &laws, &lanes, &settings)).unwrap();
        let mut impacts = 0;
        for ((oscillator, law), record) in oscillators.iter().zip(&laws).zip(records) {
            let flow = Flow::new(oscillator);
            let mut trajectory = Trajectory::<0>::new(&flow, *law, REST);
            (0..horizon).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
            impacts += trajectory.work().impacts;
            let off = apart(record.strobe(), trajectory.state());
            println!(
                "{}: omega = {}, e = {}: {off:.1e}",
                precision.name(),
                oscillator.omega,
                law.restitution[0]
            );
            assert_eq!(record.status, Status::Ok.code());
            assert!(off < bar([5.3e-6, 2.0e-14], precision), "{off:e}");
        }
        assert!(impacts > 100, "{impacts}");
    }
}
