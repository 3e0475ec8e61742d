//! Walls of every kind, on random oscillators.

pub(super) mod draw;

use crate::common::apart;
use crate::common::gpu::open;
use draw::random_cell;
use nalgebra::Matrix4;
use rattlemap::gpu::{Features, GpuError, Lane, LaneSettings, Precision};
use rattlemap::map::engine::measured_record;
use rattlemap::map::plan::Needs;
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap_dynamics::model::{Contact, Domain, Law, Pair, State, state};
use rattlemap_dynamics::motion::{Flow, Trajectory};
use rattlemap_dynamics::orbit::{Budget, Class, Settings, Status, measure};
use rayon::prelude::*;

const SEEDS: u64 = 64;

pub(super) type Cell = (Pair, Law, State);

fn cells() -> Vec<Cell> {
    (0..SEEDS).map(random_cell).collect()
}

/// Returns half of the cells, with forces that have a sine, too. With two coordinates their phases differ.
fn cells_with_sine() -> Vec<Cell> {
    let with_sine = |(oscillator, law, start): Cell| {
        let size = oscillator.force[0];
        let second = if oscillator.degrees == 1 { 0.0 } else { -0.5 * size };
        (Pair { force_sin: [0.8 * size, second], ..oscillator.clone() }, law, start)
    };
    cells().into_iter().step_by(2).map(with_sine).collect()
}

/// Returns the records of oscillators, each with its own law and start.
pub(super) fn run(
    precision: Precision,
    cells: &[Cell],
    settings: &LaneSettings,
) -> Result<Vec<Record>, GpuError> {
    let flows: Vec<_> = cells.iter().map(|cell| cell.0.clone()).collect();
    let laws: Vec<_> = cells.iter().map(|cell| cell.1).collect();
    let lanes: Vec<_> = (0..).zip(cells).map(|(i, cell)| Lane { flow: i, law: i, start: cell.2 }).collect();
    pollster::block_on(open(precision).run(&flows, &laws, &lanes, settings))
}

/// Motion of the reference.
struct Followed {
    end: State,
    impacts: u64,
    /// Time in contact.
    contact: f64,
}

fn followed((oscillator, law, _): &Cell, start: State, periods: u32) -> Followed {
    let flow = Flow::new(oscillator);
    let mut motion = Trajectory::<0>::new(&flow, *law, start);
    (0..periods).for_each(|_| motion.advance_period(&mut ()).expect("an ordinary motion"));
    Followed { end: motion.state(), impacts: motion.work().impacts, contact: motion.meshing_time() }
}

/// Whether infinitely many impacts may occur in finite time.
fn may_chatter((oscillator, law, _): &Cell) -> bool {
    (0..2).any(|side| oscillator.contacts[side] == Contact::Rigid && law.mesh_speed[side] == 0.0)
}

#[test]
fn motion_agrees_with_the_reference() {
    check_motion(&cells(), [500, 10]);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn motion_under_forces_with_a_sine_agrees_with_the_reference() {
    check_motion(&cells_with_sine(), [250, 5]);
}

/// After 20 periods the state, the impacts and the time in contact agree with those of the reference. There must be more
/// impacts and more contacts at rest than `least`.
fn check_motion(cells: &[Cell], least: [u64; 2]) {
    const HORIZON: u32 = 20;
    let expected: Vec<_> = cells.par_iter().map(|cell| followed(cell, cell.2, HORIZON)).collect();
    // Measured: medians 1.7e-13 and 2.0e-7; worst without chaos 1.1e-11 and 5.8e-6.
    for (precision, median_bar, bar, rounding) in
        [(Precision::F64, 1e-12, 1e-10, 1e-13), (Precision::F32, 1e-6, 3e-5, 1e-7)]
    {
        let records = run(precision, cells, &LaneSettings::only(HORIZON)).unwrap();
        let mut errors = Vec::new();
        let (mut chaotic, mut impacts, mut rests) = (0, 0, 0);
        for (seed, ((record, cell), expected)) in records.iter().zip(cells).zip(&expected).enumerate() {
            let at = format!("{precision:?}, seed {seed}, {cell:?}");
            assert_eq!(record.status, Status::Ok.code(), "{at}");
            let error = apart(record.strobe(), expected.end);
            errors.push(error);
            if error > bar {
                // Chaos: a rounding error of the start must change the reference as much.
                let moved = followed(cell, cell.2.map(|x| x * (1.0 + rounding)), HORIZON).end;
                assert!(apart(moved, expected.end) > 0.1 * error, "{at}: off by {error:.1e}");
                chaotic += 1;
                continue;
            }
            let time = f64::from(HORIZON) * cell.0.period();
            assert!((record.mesh_fraction - expected.contact / time).abs() < bar + 1e-8, "{at}: contact");
            let counted = (record.impacts_per_period * f64::from(HORIZON)).round() as u64;
            if !may_chatter(cell) {
                assert_eq!(counted, expected.impacts, "{at}: impacts");
                impacts += counted;
            }
            rests += u64::from(may_chatter(cell) && expected.contact > 0.0);
        }
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        println!("{precision:?}: median {median:.1e}, {:?}, {chaotic} chaotic", &errors[errors.len() - 4..]);
        assert!(median < median_bar, "{precision:?}: {median:e}");
        assert!(chaotic < 4 && impacts > least[0] && rests > least[1], "{chaotic} {impacts} {rests}");
    }
}

/// The largest multiplier of every cycle agrees with finite differences of the reference. A fifth of the forces have a
/// sine.
#[test]
fn multipliers_agree_with_finite_differences() {
    let cells: Vec<_> = cells().into_iter().chain(cells_with_sine().into_iter().step_by(2)).collect();
    let records = run(Precision::F64, &cells, &LaneSettings::default()).unwrap();
    let of = |(seed, (record, cell)): (usize, (&Record, &Cell))| {
        let Class::Periodic { period, .. } = classify(record) else { return None };
        let is_clear = (0..2).all(|side| {
            let [x1, _, x2, _, ..] = record.strobe();
            (cell.0.gap[0] * x1 + cell.0.gap[1] * x2 - cell.0.walls[side]).abs() > 1e-3
        });
        // Neighbours of a cycle that is on a rigid wall at the strobe follow another motion.
        if !is_clear {
            return None;
        }
        const STEP: f64 = 1e-6;
        let displacements = 2 * cell.0.degrees;
        let columns: Vec<[f64; 4]> = (0..displacements)
            .map(|i| {
                let end = |by: f64| {
                    let mut start = record.strobe();
                    start[i] += by;
                    followed(cell, start, period).end
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
        // Finite differences are accurate to their step; near a double multiplier, to its square root.
        let off = (radius - multiplier).abs();
        assert!(off < 1e-4, "seed {seed}: {radius} {multiplier} {:?}", cells[seed]);
        for side in 0..2 {
            let met = cell.0.walls[side].is_finite() && !records[seed].is_contact_free();
            kinds[cell.0.contacts[side] as usize] += u32::from(met);
        }
    }
    assert!(kinds.iter().all(|&count| count >= 8), "{kinds:?} walls of each kind");
}

/// Shaders that were compiled without elastic and rigid walls, or without sines, refuse flows that have them.
#[test]
fn excluded_walls_and_sines_are_refused() {
    let rigid = cells().into_iter().find(may_chatter).unwrap();
    let with = |features| LaneSettings { features, ..LaneSettings::only(1) };
    let settings = with(Features { sine: true, ..Features::default() });
    let error = run(Precision::F32, &[rigid], &settings).unwrap_err();
    assert!(matches!(error, GpuError::NotCompiled { flow: 0, setting: "kinds", .. }), "{error}");
    let settings = with(Features { kinds: true, ..Features::default() });
    let error = run(Precision::F32, &cells_with_sine()[..1], &settings).unwrap_err();
    assert!(matches!(error, GpuError::NotCompiled { flow: 0, setting: "sine", .. }), "{error}");
}
/// Class, word, exponent, impacts and time in contact agree with the reference.
#[test]
fn records_agree_with_the_reference() {
    let cells = cells();
    let budget = Budget {
        settings: Settings::default(),
        early_stop: true,
        // Lanes name quasi-periodic motion later: they average over fewer strobes.
        undecided_periods: 1584,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: true,
        quantities: false,
    };
    let measured = |(oscillator, law, start): &Cell| measure(&Flow::new(oscillator), *law, *start, &budget);
    let expected: Vec<_> =
        cells.par_iter().map(|cell| measured_record(&measured(cell), &Needs::EVERYTHING)).collect();
    // Measured: 2.3e-12 per unit time and 6.0e-6; time in contact 8e-14 and 6.3e-8.
    for (precision, exponent_bar, contact_bar) in
        [(Precision::F64, 1e-10, 1e-10), (Precision::F32, 5e-5, 1e-6)]
    {
        let settings =
            LaneSettings { undecided_periods: budget.undecided_periods, ..LaneSettings::default() };
        let records = run(precision, &cells, &settings).unwrap();
        let (mut cycles, mut superstable, mut symbols) = (0, 0, 0);
        for (seed, (record, expected)) in records.iter().zip(&expected).enumerate() {
            let at = format!("{precision:?}, seed {seed}, {:?}", cells[seed]);
            assert_eq!(classify(record), classify(expected), "{at}");
            assert_eq!(record.spelling(), expected.spelling(), "{at}");
            assert_eq!(record.pattern(), expected.pattern(), "{at}");
            if !matches!(classify(expected), Class::Periodic { .. }) {
                continue;
            }
            assert_eq!(record.impacts_per_period, expected.impacts_per_period, "{at}");
            let contact = (record.mesh_fraction - expected.mesh_fraction).abs();
            assert!(contact < contact_bar, "{at}: {} {}", record.mesh_fraction, expected.mesh_fraction);
            let off = (record.lyapunov - expected.lyapunov).abs();
            let is_superstable = expected.lyapunov == f64::NEG_INFINITY;
            assert!(
                if is_superstable { record.lyapunov == expected.lyapunov } else { off < exponent_bar },
                "{at}: {} {}",
                record.lyapunov,
                expected.lyapunov
            );
            cycles += 1;
            superstable += u32::from(is_superstable);
            symbols += expected.word_length;
        }
        assert!(cycles >= 60 && superstable >= 3 && symbols > 150, "{cycles} {superstable} {symbols}");
    }
}

/// Returns the motion in other units: lengths times `2^length`, times times `2^time`.
pub(super) fn in_units((oscillator, law, start): &Cell, length: i32, time: i32) -> Cell {
    let (size, rate) = (2f64.powi(length), 2f64.powi(-time));
    let scaled = |m: [[f64; 2]; 2], by: f64| m.map(|row| row.map(|entry| entry * by));
    let domain = |domain: &Domain| Domain {
        damping: scaled(domain.damping, rate),
        stiffness: scaled(domain.stiffness, rate * rate),
        load: domain.load.map(|load| load * size * rate * rate),
    };
    let other = Pair {
        walls: oscillator.walls.map(|wall| wall * size),
        omega: oscillator.omega * rate,
        force: oscillator.force.map(|force| force * size * rate * rate),
        force_sin: oscillator.force_sin.map(|force| force * size * rate * rate),
        free: domain(&oscillator.free),
        meshing: oscillator.meshing.each_ref().map(domain),
        ..oscillator.clone()
    };
    let law = Law { mesh_speed: law.mesh_speed.map(|speed| speed * size * rate), ..*law };
    let [x1, v1, x2, v2, ..] = *start;
    (other, law, state(&[x1 * size, v1 * size * rate, x2 * size, v2 * size * rate]))
}

/// Thresholds are relative to the motion: units that differ by powers of two change no bit.
#[test]
fn units_change_no_bit() {
    let cells = cells();
    let (length, time) = (12, -5);
    let others: Vec<_> = cells.iter().map(|cell| in_units(cell, length, time)).collect();
    let settings = LaneSettings::only(5);
    for precision in Precision::ALL {
        let [records, others] = [&cells, &others].map(|cells| run(precision, cells, &settings).unwrap());
        for (seed, (record, other)) in records.iter().zip(&others).enumerate() {
            let (size, rate) = (2f64.powi(length), 2f64.powi(-time));
            let [x1, v1, x2, v2, ..] = record.strobe();
            let strobe = state(&[x1 * size, v1 * size * rate, x2 * size, v2 * size * rate]);
            assert_eq!(other.strobe(), strobe, "{precision:?}, seed {seed}");
            assert_eq!(other.impacts_per_period, record.impacts_per_period, "{precision:?}, seed {seed}");
            assert_eq!(other.mesh_fraction, record.mesh_fraction, "{precision:?}, seed {seed}");
        }
    }
}
