//! Stiff meshing: the stiffness of the teeth reaches 300,000 times that of the supports.
//!
//! The relative mode of meshing has the frequency `sqrt(k (1/m1 + 1/m2))`: 39 rad per unit time at k = 1000 and 3900 at
//! k = 10^7. The supports have 4.5. Numerical integrators must shorten their step or lose stability; an exact propagator
//! only takes more steps. Rounding costs more in either case, because `k` multiplies an error of the gap. Lanes measure the
//! gap from the wall on which they mesh. The reference measures it from the middle, and its own scatter grows in proportion
//! to `k`. So lanes are also compared with lanes on a grid twice as fine.

use rayon::prelude::*;

use super::Checks;
use super::cells::{
    EngineName, REST, UNPREDICTABLE, bar, oscillator_of, paper, run_reference, sensitivity, state_distance,
};
use super::lanes::{Lanes, Start};
use rattlemap::gpu::{Constants, LaneSettings};
use rattlemap::record::classify::status;
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::Status;

/// Forcing periods from rest.
const PERIODS: u32 = 8;

/// Restitution and frequency of the motions. Plastic contacts mesh at once, others after chatter.
const MOTIONS: [(f64, f64); 4] = [(0.0, 5.6), (0.06, 5.6), (0.0, 2.5), (0.3, 2.5)];

/// Compares every stiffness on every engine: all cells have the status `ok`, lanes agree with lanes of twice the steps within
/// rounding, and with the reference within rounding and the reference's scatter.
pub(super) fn check(lanes: &mut Lanes) -> Checks {
    let mut checks = Checks::default();
    let stiffnesses = (0..=8).map(|i| 10f64.powf(3.0 + 0.5 * f64::from(i)));
    let cells: Vec<Start> = stiffnesses
        .flat_map(|k| MOTIONS.map(|(e, omega)| (GearPair { k, ..paper(e, omega) }, REST)))
        .collect();
    let exact: Vec<_> =
        cells.par_iter().map(|(pair, start)| run_reference(pair, *start, PERIODS).0.ok()).collect();
    checks.require(exact.iter().all(Option::is_some), "the reference stops");
    let moved = |engine: EngineName| {
        let of_cell = |(pair, start): &Start| sensitivity(pair, *start, PERIODS, engine);
        cells.par_iter().map(of_cell).collect::<Vec<f64>>()
    };
    let (coarse, scatter) = (moved(EngineName::LanesF32), moved(EngineName::Reference));
    let mut compared = 0;
    for precision in lanes.precisions() {
        let engine = EngineName::from(precision);
        let records = lanes.run(precision, &cells, &LaneSettings::only(PERIODS));
        let constants: Vec<Constants> = cells
            .iter()
            .map(|(pair, _)| Constants::new(&oscillator_of(pair), None).expect("lanes compute every cell"))
            .collect();
        let most = constants.iter().map(|constants| constants.steps).max();
        let twice =
            LaneSettings { steps_per_period: most.map(|most| 2 * most), ..LaneSettings::only(PERIODS) };
        let finer = lanes.run(precision, &cells, &twice);
        for (i, (GearPair { k, e, omega, .. }, _)) in cells.iter().enumerate() {
            let what = |what: &str| format!("{engine:?}, k = {k:e}, e = {e}, omega = {omega}, {what}");
            checks.require(status(&records[i]) == Status::Ok, what(status(&records[i]).name()));
            // Rounding of start and parameters moves the end so far. It is computed in single precision and scaled.
            let conditioning = coarse[i] * engine.unit_roundoff() / EngineName::LanesF32.unit_roundoff();
            let Some(exact) = exact[i].filter(|_| conditioning < UNPREDICTABLE) else { continue };
            // Steps of a lane that meshes all the time.
            let domains = &constants[i].pair().expect("a pair").flow.domains;
            let finest = domains.iter().map(|domain| domain.substeps).fold(1.0, f64::max);
            let steps = f64::from(constants[i].steps) * finest * f64::from(PERIODS);
            let rounding = bar(conditioning, steps);
            let distance = |from: &_| state_distance(&records[i].strobe(), from);
            checks.add(distance(&finer[i].strobe()), rounding, what("twice the steps"));
            checks.add(distance(&exact), rounding + 2.0 * scatter[i], what("the reference"));
            compared += 1;
        }
    }
    checks.require(compared > 0, "no lane can be compared");
    checks
}
