//! Classes, exponents, averages and words of the lanes against the analysis of the reference.

use rattlemap::flow::Flow;
use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::model::{GearPair, State};
use rattlemap::orbit::{Budget, Class, Orbit, Settings, Status, analyse, measure};
use rattlemap::record::{Record, valid};
use rattlemap::reference::Trajectory;
use rattlemap::word::Word;
use rayon::prelude::*;

const REST: State = [0.0; 4];

fn run(precision: Precision, pairs: &[GearPair], settings: &LaneSettings) -> Vec<Record> {
    let mut gpu = pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap();
    let flows: Vec<_> = pairs.iter().map(|pair| pair.oscillator().unwrap()).collect();
    let laws: Vec<_> = pairs.iter().map(GearPair::law).collect();
    let lanes: Vec<_> = (0..pairs.len() as u32).map(|i| Lane { flow: i, law: i, start: REST }).collect();
    pollster::block_on(gpu.run(&flows, &laws, &lanes, settings)).unwrap()
}

/// The class that a record shows by itself.
fn class(record: &Record) -> Class {
    match record.period {
        0 if record.status >= Status::CapEvents.code() => Class::Failed,
        0 if record.lyapunov - 3.0 * record.lyapunov_error > 0.0 => Class::Chaotic,
        0 => Class::Undecided,
        period => Class::Periodic { period },
    }
}

/// How far one more cycle of `period` takes the reference from where it is `after` periods
/// after `start`.
fn unrest(pair: &GearPair, start: State, after: u32, period: u32) -> f64 {
    let flow = Flow::new(&pair.oscillator().unwrap());
    let mut trajectory = Trajectory::new(&flow, pair.law(), start);
    let mut advance = |periods: u32| {
        (0..periods).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
        trajectory.state()
    };
    let (before, then) = (advance(after), advance(period));
    before.iter().zip(then).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Periods that the lanes take to confirm a period: three windows of 64.
const CONFIRMATION: u32 = 192;

/// Whether the reference decides within the periods that a lane has; a single orbit goes on.
fn decides_in_time(pair: &GearPair) -> bool {
    let flow = Flow::new(&pair.oscillator().unwrap());
    let budget =
        Budget { settings: Settings::default(), early_stop: false, undecided_periods: 0, exponent: true };
    let measured = measure(&flow, pair.law(), REST, &budget);
    let grows = measured.lyapunov.is_some_and(|[mean, error]| mean > 3.0 * error);
    measured.period.is_some() || grows && measured.status == Status::Ok
}

/// Why a record may differ from the analysis from rest; none if nothing explains it.
fn explanation(pair: &GearPair, truth: &Orbit, record: &Record) -> Option<&'static str> {
    if truth.class == Class::Undecided {
        return Some("the reference does not decide either");
    }
    let period = std::f64::consts::TAU / pair.omega;
    if truth.lyapunov.abs() * period < 0.01 {
        return Some("a bifurcation is near");
    }
    if let Class::Periodic { period } = truth.class
        && record.period == 0
        && unrest(pair, REST, record.periods_run - CONFIRMATION, period) > 1e-4
    {
        return Some("the reference itself settled too late to be confirmed");
    }
    // A chaotic transient lasts as long as rounding has it. The lane's exponent, or where it
    // ended, shows that it was not on the cycle yet; the reference goes on to it from there.
    if let Class::Periodic { period } = truth.class
        && record.period == 0
        && (class(record) == Class::Chaotic || unrest(pair, record.strobe, 0, period) > 1e-2)
        && analyse(pair, record.strobe, &Settings::default()).class == truth.class
    {
        return Some("still on its way when its budget ended, as the reference started there shows");
    }
    if class(record) == Class::Undecided && !decides_in_time(pair) {
        return Some("the reference does not decide within the lane's budget either");
    }
    let theirs = analyse(pair, record.strobe, &Settings::default());
    if theirs.class == class(record) {
        return Some("another attractor, confirmed by the reference");
    }
    let approached = theirs.class != truth.class && class(record) == Class::Undecided;
    approached.then_some("another attractor, approached too late to be confirmed")
}

/// What must agree where the class does.
fn check_cycle(precision: Precision, truth: &Orbit, record: &Record, at: &str) {
    // Of cells near bifurcations the exponent is known as well as the cycle is.
    let (exponent_bar, average_bar) = match precision {
        Precision::F32 => (5e-3, 2e-5),
        Precision::F64 => (5e-3, 1e-5),
    };
    assert!(
        (record.lyapunov - truth.lyapunov).abs() < exponent_bar,
        "{at}: {} {}",
        record.lyapunov,
        truth.lyapunov
    );
    assert!((record.impacts_per_period - truth.impacts_per_period).abs() < 1e-9, "{at}");
    assert!(
        (record.mesh_fraction - truth.mesh_fraction).abs() < 20.0 * average_bar,
        "{at}: {}",
        record.mesh_fraction
    );
    if record.valid & valid::SYMMETRIC != 0 {
        assert_eq!(Some(record.symmetric == 1), truth.symmetric, "{at}: symmetry");
    }
    if let Some(word) = record.word() {
        assert!(word == truth.word || word.mirrored() == truth.word, "{at}: {word} {}", truth.word);
    }
}

/// A map of the whole plane: all classes agree but for cells that are explained, and those
/// are few.
#[test]
fn the_plane_is_classified_as_the_reference_does() {
    const SIDE: u32 = 40;
    let at = |i: u32, lo: f64, hi: f64| lo + (hi - lo) * f64::from(i) / f64::from(SIDE - 1);
    let pairs: Vec<_> = (0..SIDE * SIDE)
        .map(|i| GearPair { omega: at(i / SIDE, 1.0, 12.0), ..GearPair::paper(at(i % SIDE, 0.0, 1.0)) })
        .collect();
    let truth: Vec<_> = pairs.par_iter().map(|pair| analyse(pair, REST, &Settings::default())).collect();
    for precision in Precision::ALL {
        let records = run(precision, &pairs, &LaneSettings::default());
        let mut explained = 0;
        for ((pair, truth), record) in pairs.iter().zip(&truth).zip(&records) {
            let at = format!("{precision:?}, e = {}, omega = {}", pair.e, pair.omega);
            if class(record) != truth.class {
                let why = explanation(pair, truth, record);
                println!("{at}: {:?} for {:?}: {why:?}", class(record), truth.class);
                assert!(why.is_some(), "{at}: {:?} for {:?}, {record:?}", class(record), truth.class);
                explained += 1;
            } else if record.period > 0 {
                check_cycle(precision, truth, record, &at);
            }
        }
        assert!(explained * 100 < records.len(), "{precision:?}: {explained} explained cells are too many");
        let symmetries = records.iter().filter(|record| record.valid & valid::SYMMETRIC != 0).count();
        assert!(
            symmetries * 10 > 8 * records.len(),
            "{precision:?}: symmetry known of {symmetries} cells only"
        );
    }
}

/// Every row of the independent program's table.
#[test]
fn every_row_of_the_table_agrees() {
    let mut reader = csv::Reader::from_path("tests/data/cells.csv").unwrap();
    let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
    let number = |row: &csv::StringRecord, i: usize| row[i].parse::<f64>().unwrap();
    let pairs: Vec<_> = rows
        .iter()
        .map(|row| GearPair { omega: number(row, 1), ..GearPair::paper(number(row, 0)) })
        .collect();
    for precision in Precision::ALL {
        for (row, record) in rows.iter().zip(run(precision, &pairs, &LaneSettings::default())) {
            let at = format!("{precision:?}, e = {}, omega = {}", &row[0], &row[1]);
            if &row[2] == "chaotic" {
                assert_eq!(class(&record), Class::Chaotic, "{at}");
                let error = record.lyapunov_error.hypot(number(row, 5));
                assert!((record.lyapunov - number(row, 4)).abs() < 4.0 * error, "{at}: {}", record.lyapunov);
                assert!((record.impacts_per_period / number(row, 6) - 1.0).abs() < 0.05, "{at}");
                continue;
            }
            assert_eq!(class(&record), Class::Periodic { period: row[3].parse().unwrap() }, "{at}");
            assert!((record.lyapunov - number(row, 4)).abs() < 1e-4, "{at}: {}", record.lyapunov);
            assert!((record.impacts_per_period - number(row, 6)).abs() < 1e-9, "{at}");
            assert!((record.mesh_fraction - number(row, 7)).abs() < 5e-6, "{at}: {}", record.mesh_fraction);
            let word = Word::cyclic(row[12].as_bytes());
            // An empty word is one without events, unless events were too many to print.
            if !word.is_empty() || number(row, 6) == 0.0 {
                let lane = record.word().unwrap();
                assert!(lane == word || lane.mirrored() == word, "{at}: {lane} {word}");
            }
        }
    }
}
