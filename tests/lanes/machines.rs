//! Machines on lanes and on the reference.
//!
//! The lanes need an adapter; without one the tests fail (see `scripts/test.sh`).

use crate::common::apart;
use crate::common::gpu::open;
use rattlemap::gpu::{Features, Lane, LaneSettings, Precision};
use rattlemap::model_file::FileModel;
use rattlemap_dynamics::model::{Law, Model, Oscillator, State, state};
use rattlemap_dynamics::reference::machine::{Motion, System};

fn built_in(name: &str, values: &[(&str, f64)]) -> Oscillator {
    let mut model = FileModel::built_in(name).unwrap();
    for (parameter, value) in values {
        model.set(parameter, *value).unwrap();
    }
    model.oscillator().unwrap()
}

/// Returns the largest difference of the states after some periods, for each oscillator.
fn errors(precision: Precision, oscillators: &[Oscillator], start: State, periods: u32) -> Vec<(u32, f64)> {
    let features = oscillators.iter().map(Features::of).reduce(Features::and).unwrap();
    let clock = std::time::Instant::now();
    let settings = LaneSettings { features, ..LaneSettings::only(periods) };
    let lanes: Vec<_> = (0..oscillators.len() as u32).map(|i| Lane { flow: i, law: 0, start }).collect();
    let mut gpu = open(precision);
    let records = pollster::block_on(gpu.run(oscillators, &[Law::both(0.5, 0.0)], &lanes, &settings)).unwrap();
    println!("{:?} {:?}", clock.elapsed(), gpu.precision());
    let exact = oscillators.iter().map(|oscillator| {
        let system = System::new(oscillator.machine.as_ref().unwrap());
        let mut motion = Motion::new(&system, &start);
        (0..periods).try_for_each(|_| motion.advance_period(&mut ())).unwrap();
        motion.state()
    });
    records
        .iter()
        .zip(exact)
        .map(|(record, exact)| (record.status, apart(record.strobe, exact)))
        .collect()
}

#[test]
fn two_loose_gears_move_as_on_the_reference() {
    let omegas = (0..8).map(|i| 1.0 + 0.3 * f64::from(i));
    let oscillators: Vec<_> = omegas.map(|omega| built_in("two-loose-gears", &[("omega", omega)])).collect();
    for precision in Precision::ALL {
        println!("{precision:?} {:?}", errors(precision, &oscillators, state(&[0.1]), 1));
        println!("{precision:?} {:?}", errors(precision, &oscillators, state(&[0.1]), 8));
    }
}
