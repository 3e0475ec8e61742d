//! Every row of the independent program's table.

use std::f64::consts::TAU;

use rattlemap::flow::Flow;
use rattlemap::model::{GearPair, State};
use rattlemap::orbit::{Class, Orbit, Settings, analyse};
use rattlemap::reference::Trajectory;
use rattlemap::stability::StrobeMap;
use rattlemap::word::Word;
use rayon::prelude::*;

/// One row; fields that the table leaves out are absent.
struct Row {
    pair: GearPair,
    class: String,
    period: Option<u32>,
    lyapunov: f64,
    lyapunov_error: Option<f64>,
    impacts_per_period: f64,
    mesh_fraction: f64,
    strobe: Option<State>,
    word: Option<Word>,
}

fn rows() -> Vec<Row> {
    let mut reader = csv::Reader::from_path("tests/data/cells.csv").unwrap();
    reader
        .records()
        .map(|record| {
            let record = record.unwrap();
            let number = |i: usize| record[i].parse::<f64>().ok();
            let mut pair = GearPair::paper(number(0).unwrap());
            pair.omega = number(1).unwrap();
            let class = record[2].to_owned();
            Row {
                pair,
                period: record[3].parse().ok(),
                lyapunov: number(4).unwrap(),
                lyapunov_error: number(5),
                impacts_per_period: number(6).unwrap(),
                mesh_fraction: number(7).unwrap(),
                strobe: number(8)
                    .map(|x1| [x1, number(9).unwrap(), number(10).unwrap(), number(11).unwrap()]),
                // An empty word is one without events, unless events were too many to print.
                word: (class == "periodic" && (!record[12].is_empty() || number(6) == Some(0.0)))
                    .then(|| Word::cyclic(record[12].as_bytes())),
                class,
            }
        })
        .collect()
}

fn analysed(row: &Row) -> Orbit {
    let observed_periods = if row.class == "chaotic" { 20_000 } else { 128 };
    analyse(&row.pair, [0.0; 4], &Settings { transient_periods: 3000, observed_periods, max_period: 64 })
}

fn apart(a: &State, b: &State) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Distance of the table's strobe from the orbit or its mirror twin, whichever is nearer.
fn strobe_error(orbit: &Orbit, pair: &GearPair, strobe: &State) -> f64 {
    let flow = Flow::new(&pair.oscillator().unwrap());
    let seed = Trajectory::new(&flow, pair.law(), orbit.strobe);
    let mut nearest = f64::INFINITY;
    let mut y = orbit.strobe;
    let mut twin = StrobeMap::MirroredHalves(1).apply(&seed, y).unwrap().state;
    for _ in 0..orbit.cycle_periods {
        nearest = nearest.min(apart(&y, strobe)).min(apart(&twin, strobe));
        y = StrobeMap::Periods(1).apply(&seed, y).unwrap().state;
        twin = StrobeMap::Periods(1).apply(&seed, twin).unwrap().state;
    }
    nearest
}

fn check_periodic(row: &Row, orbit: &Orbit, at: &str) {
    assert_eq!(orbit.class, Class::Periodic { period: row.period.unwrap() }, "{at}");
    assert!((orbit.lyapunov - row.lyapunov).abs() < 1e-4, "{at}: {} {}", orbit.lyapunov, row.lyapunov);
    assert!((orbit.impacts_per_period - row.impacts_per_period).abs() < 1e-5, "{at}");
    assert!((orbit.mesh_fraction - row.mesh_fraction).abs() < 1e-5, "{at}: {}", orbit.mesh_fraction);
    let error = strobe_error(orbit, &row.pair, &row.strobe.unwrap());
    assert!(error < 1e-6, "{at}: strobe off by {error}");
    if let Some(word) = &row.word {
        assert!(orbit.word == *word || orbit.word.mirrored() == *word, "{at}: {} {word}", orbit.word);
    }
}

fn check_chaotic(row: &Row, orbit: &Orbit, at: &str) {
    assert_eq!(orbit.class, Class::Chaotic, "{at}");
    let error = row.lyapunov_error.unwrap().hypot(orbit.lyapunov_error.unwrap());
    assert!((orbit.lyapunov - row.lyapunov).abs() < 4.0 * error, "{at}: {} +- {error}", orbit.lyapunov);
    assert!((orbit.impacts_per_period / row.impacts_per_period - 1.0).abs() < 0.01, "{at}");
    assert!((orbit.mesh_fraction - row.mesh_fraction).abs() <= 0.01 * row.mesh_fraction, "{at}");
}

#[test]
fn every_row_agrees() {
    let rows = rows();
    assert_eq!(rows.len(), 40);
    rows.par_iter().for_each(|row| {
        let at = format!("e = {}, omega = {}, T = {:.4}", row.pair.e, row.pair.omega, TAU / row.pair.omega);
        let orbit = analysed(row);
        match row.class.as_str() {
            "periodic" => check_periodic(row, &orbit, &at),
            "chaotic" => check_chaotic(row, &orbit, &at),
            other => panic!("{at}: unknown class {other}"),
        }
    });
}
