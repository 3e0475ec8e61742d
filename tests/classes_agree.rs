//! Classes, exponents, averages and words of the lanes against the analysis of the reference.

use rattlemap::engine::{self, Engine};
use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::model::{GearPair, State};
use rattlemap::orbit::{Class, Status};
use rattlemap::plan::Plan;
use rattlemap::record::{Record, valid};
use rattlemap::scene::{Purpose, Scene};
use rattlemap::validate::{Explanation, StateSource, Subject, replay, sample};
use rattlemap::word::Word;

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

/// An axis: parameter, ends, count.
type Axis<'a> = (&'a str, [f64; 2], usize);

/// A map by lanes, every cell replayed on the reference: no mismatch without an explanation,
/// and less than one cell of a hundred with one.
fn check_map(axes: [Axis<'_>; 2], sets: &[&str], precision: Precision) {
    let axis = |(name, [min, max], count): Axis<'_>| {
        format!("[[axis]]\nparameter = '{name}'\nmin = {min}\nmax = {max}\ncount = {count}\n")
    };
    let everything =
        "[outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\n";
    // As in scenes/e_omega.toml.
    let integration = "[integration]\nundecided_periods = 1584\n";
    let text = axes.map(axis).concat() + integration + everything;
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    let plan = Plan::new(&Scene::parse(&text, "plane", &sets, Purpose::Map).unwrap());
    let device = pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap();
    let mut engine = Engine::Gpu(Box::new(pollster::block_on(engine::Gpu::new(&plan, device)).unwrap()));
    let cells = plan.cells(0..plan.cell_count());
    let mut records = vec![Record::default(); plan.cell_count()];
    for (cell, record) in cells.iter().zip(pollster::block_on(engine.run(&cells)).unwrap()) {
        records[cell.id as usize] = record;
    }
    let subject = Subject { plan: &plan, records: &records, precision, is_lane: true };
    let all = sample(&plan, &records, plan.cell_count(), 1);
    let validation = replay(&subject, &all, StateSource::None(String::new()), &|_| ());
    for mismatch in &validation.mismatches {
        let [i, j] = plan.indices(mismatch.id);
        let (differences, explanation) = (&mismatch.differences, &mismatch.explanation);
        println!("{precision:?} ({i}, {j}): {differences:?}: {explanation:?}");
    }
    for explanation in Explanation::ALL {
        println!("{precision:?} {}: {}", explanation.name(), validation.explained_by(explanation));
    }
    assert_eq!(validation.unexplained(), 0, "{precision:?}");
    let (mismatches, cells) = (validation.mismatches.len(), plan.cell_count());
    assert!(mismatches * 100 < cells, "{precision:?}: {mismatches} mismatches of {cells} cells are too many");
    let symmetries = records.iter().filter(|record| record.valid & valid::SYMMETRIC != 0).count();
    assert!(symmetries * 10 > 8 * cells, "{precision:?}: symmetry known of {symmetries} cells only");
}

/// Restitution against frequency.
fn plane(side: usize) -> [Axis<'static>; 2] {
    [("e", [0.0, 1.0], side), ("omega", [1.0, 12.0], side)]
}

#[test]
fn the_plane_is_classified_as_the_reference_does() {
    Precision::ALL.into_iter().for_each(|precision| check_map(plane(48), &[], precision));
}

/// The same with 16,384 cells.
#[test]
#[ignore = "takes a minute"]
fn the_whole_plane_is_classified_as_the_reference_does() {
    Precision::ALL.into_iter().for_each(|precision| check_map(plane(128), &[], precision));
}

/// Any two parameters: flows of their own for every cell, laws of their own, or both shared.
#[test]
fn other_planes_are_classified_as_the_reference_does() {
    for precision in Precision::ALL {
        check_map([("k", [300.0, 3000.0], 23), ("omega", [2.0, 9.0], 23)], &["e=0.4"], precision);
        check_map([("mesh_speed", [0.0, 0.05], 23), ("e", [0.05, 0.5], 23)], &["omega=3"], precision);
        check_map([("b", [0.2, 0.8], 23), ("F", [20.0, 80.0], 23)], &["e=0.3"], precision);
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
