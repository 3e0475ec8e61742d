//! Walls of every kind, on oscillators of every shape that a model may have.

mod draw;
mod march;

use crate::common::apart;
use crate::common::gpu::open;
use draw::drawn;
use march::March;
use nalgebra::Matrix4;
use rattlemap::gpu::{GpuError, Lane, LaneSettings, Precision};
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap_dynamics::model::{Contact, Law, Oscillator, State};
use rattlemap_dynamics::orbit::{Class, Status};
use rayon::prelude::*;

const SEEDS: u64 = 64;

type Cell = (Oscillator, Law, State);

fn cells() -> Vec<Cell> {
    (0..SEEDS).map(drawn).collect()
}

/// Records of oscillators, each with its own law and start.
fn run(precision: Precision, cells: &[Cell], settings: &LaneSettings) -> Result<Vec<Record>, GpuError> {
    let flows: Vec<_> = cells.iter().map(|cell| cell.0).collect();
    let laws: Vec<_> = cells.iter().map(|cell| cell.1).collect();
    let lanes: Vec<_> = (0..).zip(cells).map(|(i, cell)| Lane { flow: i, law: i, start: cell.2 }).collect();
    pollster::block_on(open(precision).run(&flows, &laws, &lanes, settings))
}

fn march((oscillator, law, _): &Cell, start: State, periods: u32) -> (State, March) {
    let mut march = March::new(oscillator, *law, start);
    let end = (0..periods).map(|_| march.period()).last().unwrap();
    (end, march)
}

/// Whether a wall may be struck infinitely often in finite time.
fn may_chatter((oscillator, law, _): &Cell) -> bool {
    (0..2).any(|side| oscillator.contacts[side] == Contact::Rigid && law.mesh_speed[side] == 0.0)
}

/// After 20 periods every state, the impacts so far and the time in contact are those of an integrator that has nothing in
/// common with lanes.
#[test]
fn motion_is_that_of_plain_steps() {
    const HORIZON: u32 = 20;
    let cells = cells();
    let truth: Vec<_> = cells.par_iter().map(|cell| march(cell, cell.2, HORIZON)).collect();
    // Measured: medians 1.7e-13 and 2.0e-7, the worst that is no chaos 1.1e-11 and 5.8e-6.
    for (precision, median_bar, bar, rounding) in
        [(Precision::F64, 1e-12, 1e-10, 1e-13), (Precision::F32, 1e-6, 3e-5, 1e-7)]
    {
        let records = run(precision, &cells, &LaneSettings::only(HORIZON)).unwrap();
        let mut errors = Vec::new();
        let (mut chaotic, mut impacts, mut rests) = (0, 0, 0);
        for (seed, ((record, cell), (end, march))) in records.iter().zip(&cells).zip(&truth).enumerate() {
            let at = format!("{precision:?}, seed {seed}, {cell:?}");
            assert_eq!(record.status, Status::Ok.code(), "{at}");
            let error = apart(record.strobe, *end);
            errors.push(error);
            if error > bar {
                // Chaos: as far as rounding of the start takes plain steps.
                let moved = self::march(cell, cell.2.map(|x| x * (1.0 + rounding)), HORIZON).0;
                assert!(apart(moved, *end) > 0.1 * error, "{at}: off by {error:.1e}");
                chaotic += 1;
                continue;
            }
            let time = f64::from(HORIZON) * cell.0.period();
            // Plain steps end infinite chatter at 1e-9 of a speed.
            assert!((record.mesh_fraction - march.contact / time).abs() < bar + 1e-8, "{at}: contact");
            let counted = (record.impacts_per_period * f64::from(HORIZON)).round() as u32;
            if !may_chatter(cell) {
                assert_eq!(counted, march.impacts, "{at}: impacts");
                impacts += counted;
            }
            rests += u32::from(may_chatter(cell) && march.contact > 0.0);
        }
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        println!(
            "{precision:?}: median {median:.1e}, {:?}, {chaotic} chaotic",
            &errors[SEEDS as usize - 4..]
        );
        assert!(median < median_bar, "{precision:?}: {median:e}");
        assert!(chaotic < 4 && impacts > 500 && rests > 10, "{chaotic} {impacts} {rests}");
    }
}

/// The largest multiplier of every cycle is that of differences of neighbours, by plain steps.
#[test]
fn multipliers_are_those_of_differences() {
    let cells = cells();
    let records = run(Precision::F64, &cells, &LaneSettings::default()).unwrap();
    let of = |(seed, (record, cell)): (usize, (&Record, &Cell))| {
        let Class::Periodic { period, .. } = classify(record) else { return None };
        let is_clear = (0..2).all(|side| {
            let [x1, _, x2, _] = record.strobe;
            (cell.0.gap[0] * x1 + cell.0.gap[1] * x2 - cell.0.walls[side]).abs() > 1e-3
        });
        // Rigid walls of neighbours of a cycle that is on one are another motion's.
        if !is_clear {
            return None;
        }
        const STEP: f64 = 1e-6;
        let displacements = 2 * cell.0.degrees;
        let columns: Vec<[f64; 4]> = (0..displacements)
            .map(|i| {
                let end = |by: f64| {
                    let mut start = record.strobe;
                    start[i] += by;
                    march(cell, start, period).0
                };
                let (after, before) = (end(STEP), end(-STEP));
                std::array::from_fn(|j| (after[j] - before[j]) / (2.0 * STEP))
            })
            .collect();
        let monodromy = Matrix4::from_fn(|i, j| columns.get(j).map_or(0.0, |column| column[i]));
        let radius = monodromy.complex_eigenvalues().iter().map(|mu| mu.norm()).fold(0.0, f64::max);
        let time = f64::from(period) * cell.0.period();
        Some((seed, radius, (record.lyapunov * time).exp()))
    };
    let found: Vec<_> =
        records.par_iter().zip(&cells).enumerate().filter_map(|(i, pair)| of((i, pair))).collect();
    let mut kinds = [0; 3];
    for (seed, radius, multiplier) in found {
        let cell = &cells[seed];
        println!("seed {seed}: {radius:.6} {multiplier:.6} {:?}", cell.0.contacts);
        // Differences know a multiplier to their step, and where it is nearly double, to the root of that.
        let off = (radius - multiplier).abs();
        assert!(off < 1e-4, "seed {seed}: {radius} {multiplier} {:?}", cells[seed]);
        for side in 0..2 {
            let met = cell.0.walls[side].is_finite() && !records[seed].is_contact_free();
            kinds[cell.0.contacts[side] as usize] += u32::from(met);
        }
    }
    assert!(kinds.iter().all(|&count| count >= 8), "{kinds:?} walls of each kind");
}

/// What was compiled without elastic and rigid walls takes none.
#[test]
fn walls_that_are_left_out_are_refused() {
    let rigid = cells().into_iter().find(|cell| may_chatter(cell)).unwrap();
    let settings = LaneSettings { kinds: false, ..LaneSettings::only(1) };
    let error = run(Precision::F32, &[rigid], &settings).unwrap_err();
    assert!(matches!(error, GpuError::NotCompiled { flow: 0 }), "{error}");
}
