//! Chatter on lanes: short flights are followed with short series, impact by impact. The results differ by rounding
//! alone, within the bound that `shaders/pair/chatter.wgsl` states.

use crate::common::gpu::{open, run_from_rest as run};
use crate::common::pairs::AsPair;
use crate::common::{REST, apart, flow_of, paper};
use crate::lanes::counting::counting;
use rattlemap::gpu::{LaneSettings, Precision, follows_chatter};
use rattlemap::record::classify::classify;
use rattlemap::record::{Record, Spelling, WORD_SYMBOLS};
use rattlemap_dynamics::model::{GearPair, Model, State};
use rattlemap_dynamics::motion::{Stop, Trajectory};
use rattlemap_dynamics::orbit::{Class, Settings, Status, analyse};
use rayon::prelude::*;

/// Forcing periods from rest, so few that chaos has not yet amplified rounding.
const HORIZON: u32 = 3;

const MESH_SPEEDS: [f64; 6] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0];

/// Returns cells in which impacts accumulate: restitution by frequency by meshing speed.
fn cells() -> Vec<GearPair> {
    let plane = [0.3, 0.5, 0.7, 0.9].map(|e| [1.0, 1.5, 2.7].map(|omega| paper(e, omega)));
    let at = |pair: GearPair| MESH_SPEEDS.map(|mesh_speed| GearPair { mesh_speed, ..pair });
    plane.into_iter().flatten().flat_map(at).collect()
}

/// Returns the state of the reference after the horizon, and its impacts.
fn reference(pair: &GearPair) -> Result<(State, u64), Stop> {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
    for _ in 0..HORIZON {
        trajectory.advance_period(&mut ())?;
    }
    Ok((trajectory.state(), trajectory.work().impacts))
}

/// Returns the change of the reference's final state if restitution, force, a stiffness or the walls change by a
/// share; at least that share.
fn sensitivity(pair: &GearPair, share: f64) -> f64 {
    let (end, _) = reference(pair).unwrap();
    let moved = |name: &str, by: f64| {
        let mut moved = *pair;
        moved.set(name, pair.get(name).unwrap() * (1.0 + by)).unwrap();
        apart(reference(&moved).unwrap().0, end)
    };
    let names = ["e", "F", "k1", "k2", "b"];
    names.iter().flat_map(|name| [moved(name, share), moved(name, -share)]).fold(share, f64::max)
}

/// Half a unit in the last place of 1.
fn ulp(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 6e-8,
        Precision::F64 => 1.2e-16,
    }
}

/// Rounding errors, at every constant and impact, that may add up. Without short flights lanes have 20 of them.
const ROUNDINGS: f64 = 32.0;

/// Returns the largest error by rounding.
fn bar(pair: &GearPair, precision: Precision) -> f64 {
    // The reference is accurate to about 1e-13.
    sensitivity(pair, (ROUNDINGS * ulp(precision)).max(1e-13))
}

/// Lanes have the reference's impacts, and states within rounding: as accurate as without short flights.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn chatter_agrees_with_the_reference() {
    let cells = cells();
    let expected: Vec<_> = cells.par_iter().map(|pair| reference(pair).unwrap()).collect();
    for precision in Precision::ALL {
        let mut gpu = open(precision);
        let records = run(&mut gpu, &cells, &LaneSettings::only(HORIZON));
        let ordinary = run(&mut gpu, &cells, &LaneSettings { chatter: false, ..LaneSettings::only(HORIZON) });
        gpu.rewrite_shaders(counting("follow_chatter"));
        let followed = run(&mut gpu, &cells, &LaneSettings::only(HORIZON));
        let bars: Vec<_> = cells.par_iter().map(|pair| bar(pair, precision)).collect();
        let (mut short, mut all) = ([0.0; MESH_SPEEDS.len()], [0.0; MESH_SPEEDS.len()]);
        let mut errors = [Vec::new(), Vec::new()];
        for (i, pair) in cells.iter().enumerate() {
            let (e, omega, mesh_speed) = (pair.e, pair.omega, pair.mesh_speed);
            let at = format!("{precision:?}, e = {e}, omega = {omega}, mesh_speed = {mesh_speed}");
            let (record, (end, impacts)) = (&records[i], expected[i]);
            assert_eq!(record.status, Status::Ok.code(), "{at}");
            let counted = (record.impacts_per_period * f64::from(HORIZON)).round() as u64;
            assert_eq!(counted, impacts, "{at}: impacts");
            let error = apart(record.strobe(), end);
            assert!(error <= bars[i], "{at}: off by {error:.2e}, rounding may make {:.2e}", bars[i]);
            if follows_chatter(&pair.pair(), mesh_speed) {
                errors[0].push(error / bars[i]);
                errors[1].push(apart(ordinary[i].strobe(), end) / bars[i]);
            }
            short[i % MESH_SPEEDS.len()] += (followed[i].impacts_per_period * f64::from(HORIZON)).round();
            all[i % MESH_SPEEDS.len()] += impacts as f64;
        }
        let [with, without] = errors.map(median);
        println!("{precision:?}: {short:?} short flights of {all:?} impacts, by meshing speed");
        println!(
            "{precision:?}: median error {with:.3} of what rounding may make, {without:.3} without them"
        );
        assert!(with < 1.5 * without, "{precision:?}: {with} {without}");
        assert_eq!(short[0], 0.0, "{precision:?}: too few to pay at the model's own meshing speed");
        for (short, all) in short.iter().zip(&all).skip(1) {
            assert!(*short > 0.4 * all, "{precision:?}: {short} short flights of {all} impacts");
        }
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Cells that chatter: class, word, impacts and exponent. Tangent vectors pass every short flight.
#[test]
fn chattering_cells_agree_with_the_reference() {
    check_chatter(&[Precision::F32]);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn chattering_cells_in_f64_agree_with_the_reference() {
    check_chatter(&[Precision::F64]);
}

fn check_chatter(precisions: &[Precision]) {
    let plane = [(0.3, 1.3), (0.5, 1.0), (0.56, 1.5), (0.72, 1.5), (0.2, 2.0), (0.5, 2.4), (0.8, 1.2)];
    let cells: Vec<_> = plane
        .into_iter()
        .flat_map(|(e, omega)| [1e-3, 1e-4, 1e-6, 0.0].map(|mesh_speed| (e, omega, mesh_speed)))
        .collect();
    let pairs: Vec<_> =
        cells.iter().map(|&(e, omega, mesh_speed)| GearPair { mesh_speed, ..paper(e, omega) }).collect();
    let expected: Vec<_> =
        pairs.par_iter().map(|pair| analyse(pair, REST, &Settings::default()).unwrap()).collect();
    let periodic = expected.iter().filter(|orbit| matches!(orbit.class, Class::Periodic { .. })).count();
    assert!(periodic >= 20 && periodic < cells.len(), "{periodic} cycles, and chaos");
    for &precision in precisions {
        let exponent_bar = match precision {
            Precision::F32 => 1e-5,
            Precision::F64 => 1e-9,
        };
        let records = run(&mut open(precision), &pairs, &LaneSettings::default());
        let mut collapsed = 0;
        for ((record, orbit), cell) in records.iter().zip(&expected).zip(&cells) {
            let at = format!("{precision:?}, e, omega, mesh_speed = {cell:?}");
            assert_eq!(classify(record), orbit.class, "{at}");
            let apart = (record.lyapunov - orbit.lyapunov).abs();
            if orbit.class == Class::Chaotic {
                let errors = record.lyapunov_error.hypot(orbit.lyapunov_error.unwrap());
                println!("{at}: {} {} +- {errors}", record.lyapunov, orbit.lyapunov);
                assert!(apart < 5.0 * errors, "{at}: {} {} +- {errors}", record.lyapunov, orbit.lyapunov);
                continue;
            }
            assert!(apart < exponent_bar, "{at}: {} {}", record.lyapunov, orbit.lyapunov);
            assert!((record.impacts_per_period - orbit.impacts_per_period).abs() < 1e-9, "{at}");
            let mut spelled = Record::default();
            spelled.set_word(&orbit.word);
            spelled.set_pattern(&orbit.word.pattern());
            assert_eq!(record.spelling(), spelled.spelling(), "{at}");
            assert_eq!(record.pattern(), spelled.pattern(), "{at}");
            let is_long = |spelling: Option<Spelling>| matches!(spelling, Some(Spelling::Hashed { .. }));
            collapsed += usize::from(is_long(record.spelling()) && !is_long(record.pattern()));
        }
        assert!(
            collapsed > 3,
            "{precision:?}: {collapsed} words too long to be spelled, with patterns that are not"
        );
    }
}

/// Patterns of more symbols than a record stores: the lane's hash is the reference's, wherever phase 0 divides the
/// cycle, within a run or between two.
#[test]
fn hashes_of_long_patterns_agree() {
    check_long_patterns(&[Precision::F32]);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn hashes_of_long_patterns_in_f64_agree() {
    check_long_patterns(&[Precision::F64]);
}

fn check_long_patterns(precisions: &[Precision]) {
    let plane = [(114, 3), (94, 6), (109, 8), (45, 9), (111, 15), (72, 20), (101, 23), (77, 44), (52, 65)];
    let on = |(i, j): (u32, u32)| paper(0.6 + 0.2 * f64::from(i) / 119.0, 1.0 + 0.4 * f64::from(j) / 79.0);
    let pairs = plane.map(on).to_vec();
    let expected: Vec<_> =
        pairs.par_iter().map(|pair| analyse(pair, REST, &Settings::default()).unwrap()).collect();
    for &precision in precisions {
        let records = run(&mut open(precision), &pairs, &LaneSettings::default());
        let mut alike = 0;
        for ((record, orbit), place) in records.iter().zip(&expected).zip(plane) {
            let pattern = orbit.word.pattern();
            assert!(pattern.len() > WORD_SYMBOLS && pattern.len() < orbit.word.len() / 3, "{place:?}");
            // In single precision a few motions end elsewhere.
            if record.spelling() == Some(Spelling::new(&orbit.word)) {
                assert_eq!(record.pattern(), Some(Spelling::new(&pattern)), "{precision:?}, {place:?}");
                alike += 1;
            }
        }
        assert!(alike >= 6, "{precision:?}: {alike} of {} cells have the reference's word", plane.len());
    }
}

/// Returns the shader with another length of short flights.
fn short_to(source: &str, short: f64) -> String {
    let (before, rest) = source.split_once("const SHORT: Real = ").expect("the shader says what is short");
    let (_, after) = rest.split_once(';').expect("a declaration ends");
    format!("{before}const SHORT: Real = {short};{after}")
}

/// Follows flights of up to 0.8 steps.
fn too_long(source: String) -> String {
    short_to(&source, 0.8)
}

/// If flights are followed that are longer than the precision allows, errors stay below the bound that the shader
/// states.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn errors_stay_below_the_stated_bound() {
    let cells: Vec<_> = cells().into_iter().filter(|pair| pair.mesh_speed == 1e-3).collect();
    // At the length `short` the omitted terms are ULP. They grow with this power of the length.
    for (precision, short, power) in [(Precision::F32, 0.198, 6), (Precision::F64, 0.191, 11)] {
        let mut gpu = open(precision);
        let shipped = run(&mut gpu, &cells, &LaneSettings::only(HORIZON));
        gpu.rewrite_shaders(too_long);
        let records = run(&mut gpu, &cells, &LaneSettings::only(HORIZON));
        let left_out = ulp(precision) * f64::powi(0.8 / short, power);
        let mut beyond = 0;
        for ((record, shipped), pair) in records.iter().zip(&shipped).zip(&cells) {
            let end = reference(pair).unwrap().0;
            let [error, usual] = [record, shipped].map(|record| apart(record.strobe(), end));
            let share = left_out / (1.0 - pair.e.powi(power));
            let bound = sensitivity(pair, share) + bar(pair, precision);
            let at = format!("{precision:?}, e = {}, omega = {}", pair.e, pair.omega);
            println!("{at}: {error:.2e}, else {usual:.2e}, bound {bound:.2e}");
            assert!(error < bound, "{at}: off by {error:.2e}, bound {bound:.2e}");
            beyond += u32::from(error > 10.0 * usual);
        }
        assert!(beyond > 0, "{precision:?}: all errors are rounding errors");
    }
}

/// Returns the shader with `TERMS` terms for short flights of up to `HUNDREDTHS / 100` of a step.
fn cut<const TERMS: usize, const HUNDREDTHS: u32>(source: String) -> String {
    let call = "        expand_short();\n";
    assert!(source.contains(call), "short flights are expanded");
    let dropped: String = (TERMS..13)
        .map(|k| format!("        gap_terms[{k}] = 0.0;\n        x_terms[{k}] = 0.0;\n"))
        .collect();
    short_to(&source.replace(call, &format!("{call}{dropped}")), f64::from(HUNDREDTHS) / 100.0)
}

/// With fewer terms than rounding needs, errors fall with the length of flights by the order of the series: n terms
/// beyond the start omit a share `t^(n-1)` of a speed that is proportional to t. With e = 0.5, half the length
/// excludes exactly the longest flight.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn errors_fall_by_the_order_of_the_series() {
    errors_fall_by(5.0, [cut::<6, 16>, cut::<6, 4>]);
}

/// With fewer terms the order is lower.
#[test]
#[ignore = "compiles two shaders more; scripts/test.sh --all"]
fn errors_fall_by_a_lower_order_of_the_series() {
    errors_fall_by(3.0, [cut::<4, 16>, cut::<4, 4>]);
}

/// Compares flights of up to 16 and up to 4 hundredths of a step.
fn errors_fall_by(order: f64, forms: [fn(String) -> String; 2]) {
    let cells = [1.0, 1.2, 1.4, 1.6, 1.8].map(|omega| GearPair { mesh_speed: 1e-3, ..paper(0.5, omega) });
    let expected: Vec<_> = cells.par_iter().map(|pair| reference(pair).unwrap().0).collect();
    let mut gpu = open(Precision::F64);
    let errors = forms.map(|form| {
        gpu.rewrite_shaders(form);
        let records = run(&mut gpu, &cells, &LaneSettings::only(HORIZON));
        records.iter().zip(&expected).map(|(r, expected)| apart(r.strobe(), *expected)).collect::<Vec<_>>()
    });
    let slopes: Vec<f64> =
        errors[0].iter().zip(&errors[1]).map(|(long, short)| 0.5 * (long / short).log2()).collect();
    println!("order {order}: errors {errors:?}, slopes {slopes:.2?}");
    let slope = median(slopes);
    assert!((slope - order).abs() < 0.3, "order {slope:.2} instead of {order}");
}
