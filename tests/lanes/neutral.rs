//! Quasi-periodic motion and neutral cycles, on the reference and on lanes in f32 and f64.
//!
//! The lanes need an adapter; without one the tests fail (see `scripts/test.sh`).

use crate::common::built_in;
use crate::common::pairs::AsPair;
use crate::common::{BUDGET, REST, paper};
use crate::lanes::kinds::{self, Cell};
use rattlemap::gpu::{LaneSettings, Precision};
use rattlemap::map::engine::measured_record;
use rattlemap::map::plan::Needs;
use rattlemap::record::classify::{classify, status};
use rattlemap_dynamics::model::{GearPair, Model, State, Stops, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, Status, measure};

/// Returns a cell of the oscillator `x'' + x = 0.1 cos(omega t)`, which does not reach its walls.
fn undamped(omega: f64, start: State) -> Cell {
    let model = Stops { k: 1.0, force: 0.1, omega, ..Stops::with_restitution(0.5) };
    (model.pair(), model.law(), start)
}

/// Returns a cell of a model of the gallery, from rest.
fn gallery(name: &str, sets: [(&str, f64); 2]) -> Cell {
    let model = built_in(name, &sets);
    (model.pair(), model.law(), REST)
}

#[test]
fn every_engine_names_neutral_and_quasi_periodic_motion() {
    let free = GearPair { r2: 0.0, k2: 0.0, ..paper(0.8, 11.0) };
    let one = Class::Periodic { period: 1 };
    let cases = [
        ("a free body at rest", (free.pair(), free.law(), REST), one, Status::Neutral),
        ("a ball at rest", gallery("energy-sink", [("omega", 0.99), ("d", 0.5)]), one, Status::Neutral),
        ("steady motion", undamped(7f64.sqrt(), state(&[-0.1 / 6.0])), one, Status::Neutral),
        ("repeats", undamped(5.0 / 3.0, REST), Class::Periodic { period: 5 }, Status::Neutral),
        ("undamped", undamped(7f64.sqrt(), REST), Class::QuasiPeriodic, Status::Ok),
        ("undamped", undamped(3f64.sqrt(), state(&[0.1, 0.2])), Class::QuasiPeriodic, Status::Ok),
        ("a torus", gallery("two-masses", [("omega", 0.625), ("e", 1.0)]), Class::QuasiPeriodic, Status::Ok),
    ];
    let cells = cases.clone().map(|case| case.1);
    let expect = |engine: &str, records: &[rattlemap::record::Record]| {
        for ((what, _, class, expected), record) in cases.iter().zip(records) {
            let found = (classify(record), status(record));
            assert_eq!(found, (*class, *expected), "{engine}, {what}: {record:?}");
            assert!(record.lyapunov.abs() < 2e-3, "{engine}, {what}: {record:?}");
        }
    };
    let measured = |(oscillator, law, start): Cell| measure(&Flow::new(&oscillator), law, start, &BUDGET);
    expect("reference", &cells.clone().map(|cell| measured_record(&measured(cell), &Needs::EVERYTHING)));
    let settings = LaneSettings { undecided_periods: 1584, ..LaneSettings::default() };
    for precision in Precision::ALL {
        expect(&format!("{precision:?}"), &kinds::run(precision, &cells, &settings).unwrap());
    }
}
