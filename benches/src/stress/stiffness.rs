//! Stiff meshing: the stiffness of the teeth reaches 300,000 times that of the supports.
//!
//! The relative mode of meshing has the frequency `sqrt(k (1/m1 + 1/m2))`: 39 rad per unit time at k = 1000 and 3900 at
//! k = 10^7. The supports have 4.5. Numerical integrators must shorten their step or lose stability; an exact propagator
//! only takes more steps. Rounding costs more in either case, because `k` multiplies an error of the gap. Lanes measure the
//! gap from the wall on which they mesh. The reference measures it from the middle, and its own scatter grows in proportion
//! to `k`. So lanes are also compared with lanes on a grid twice as fine.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{
    EngineName, REST, UNPREDICTABLE, bar, oscillator_of, paper, run_reference, sensitivity, state_distance,
};
use super::lanes::{Lanes, Start};
use super::{Size, Verdict};
use rattlemap::gpu::{Constants, GpuError, LaneSettings};
use rattlemap::record::classify::status;
use rattlemap::record::distance::{farther, is_within};
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::{Status, status_of};

/// Forcing periods from rest.
const PERIODS: u32 = 8;

/// Restitution and frequency of the motions. Plastic contacts mesh at once, others after chatter.
const MOTIONS: [(f64, f64); 4] = [(0.0, 5.6), (0.06, 5.6), (0.0, 2.5), (0.3, 2.5)];

/// One stiffness on one engine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Meshing stiffness.
    pub k: f64,
    /// Restitution.
    pub e: f64,
    /// Excitation frequency.
    pub omega: f64,
    /// The engine.
    pub engine: EngineName,
    /// Name of the status.
    pub status: &'static str,
    /// Distance from the reference after 8 periods; `None` for the reference.
    pub error: Option<f64>,
    /// Distance of a lane from the lane with twice the steps; `None` for the reference.
    pub spread: Option<f64>,
    /// Change of the end when start and parameters move by four roundings. It is computed with roundings of single
    /// precision and scaled.
    pub conditioning: f64,
    /// Change of the reference's end when they move by four roundings of double precision.
    pub scatter: f64,
    /// Steps per forcing period: those of the reference, or those of a lane that meshes all the time.
    pub steps_per_period: f64,
}

/// Computes every stiffness on every engine.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, lanes: &mut Lanes) -> Result<Vec<Row>, GpuError> {
    let per_decade = size.pick(1, 2, 4);
    let stiffnesses = (0..=4 * per_decade).map(|i| 10f64.powf(3.0 + f64::from(i) / f64::from(per_decade)));
    let motions = &MOTIONS[..size.pick(1, 4, 4)];
    let cells: Vec<Start> = stiffnesses
        .flat_map(|k| motions.iter().map(move |&(e, omega)| (GearPair { k, ..paper(e, omega) }, REST)))
        .collect();
    let exact: Vec<_> = cells.par_iter().map(|(pair, start)| run_reference(pair, *start, PERIODS)).collect();
    let moved = |engine: EngineName| {
        let of_cell = |(pair, start): &Start| sensitivity(pair, *start, PERIODS, engine);
        cells.par_iter().map(of_cell).collect::<Vec<f64>>()
    };
    let (coarse, scatter) = (moved(EngineName::LanesF32), moved(EngineName::Reference));
    let row = |i: usize, engine: EngineName, status: Status, steps_per_period: f64| {
        let GearPair { k, e, omega, .. } = cells[i].0;
        let share = engine.unit_roundoff() / EngineName::LanesF32.unit_roundoff();
        Row {
            k,
            e,
            omega,
            engine,
            status: status.name(),
            error: None,
            spread: None,
            conditioning: share * coarse[i],
            scatter: scatter[i],
            steps_per_period,
        }
    };
    let mut rows: Vec<Row> = Vec::new();
    for (i, (end, work)) in exact.iter().enumerate() {
        let status = end.as_ref().map_or_else(|stop| status_of(*stop), |_| Status::Ok);
        rows.push(row(i, EngineName::Reference, status, work.steps as f64 / f64::from(PERIODS)));
    }
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &cells, &LaneSettings::only(PERIODS))?;
        let constants: Vec<Option<Constants>> =
            cells.iter().map(|(pair, _)| Constants::new(&oscillator_of(pair), None)).collect();
        let most = constants.iter().flatten().map(|constants| constants.steps).max();
        let twice =
            LaneSettings { steps_per_period: most.map(|most| 2 * most), ..LaneSettings::only(PERIODS) };
        let finer = lanes.run(precision, &cells, &twice)?;
        for i in 0..cells.len() {
            let status = status(&records[i]);
            let steps = constants[i].as_ref().zip(constants[i].as_ref().and_then(Constants::pair)).map_or(
                f64::INFINITY,
                |(constants, pair)| {
                    let finest = pair.flow.domains.iter().map(|domain| domain.substeps).fold(1.0, f64::max);
                    f64::from(constants.steps) * finest
                },
            );
            let exact = exact[i].0.as_ref().ok().filter(|_| status == Status::Ok);
            rows.push(Row {
                error: exact.map(|exact| state_distance(&records[i].strobe, exact)),
                spread: exact.map(|_| state_distance(&records[i].strobe, &finer[i].strobe)),
                ..row(i, precision.into(), status, steps)
            });
        }
    }
    Ok(rows)
}

/// Requires status `ok` of every cell, that lanes agree with lanes of twice the steps within rounding, and that they agree
/// with the reference within rounding and the reference's scatter.
pub fn judge(rows: &[Row]) -> Verdict {
    let predictable = |row: &Row| row.conditioning < UNPREDICTABLE;
    let rounding = |row: &Row| bar(row.conditioning, row.steps_per_period * f64::from(PERIODS));
    let within = |distance: Option<f64>, bar: f64| distance.is_none_or(|distance| is_within(distance, bar));
    let good = |row: &&Row| {
        row.status == "ok"
            && (!predictable(row)
                || within(row.spread, rounding(row)) && within(row.error, rounding(row) + 2.0 * row.scatter))
    };
    let bad = rows.iter().filter(|row| !good(row)).count();
    let compared = rows.iter().filter(|row| row.error.is_some() && predictable(row)).count();
    let ks = || rows.iter().map(|row| row.k);
    let (soft, stiff) = (ks().fold(f64::INFINITY, f64::min), ks().fold(0.0, f64::max));
    let largest = |engine: EngineName, of: fn(&Row) -> Option<f64>| {
        let here = rows.iter().filter(|row| row.engine == engine && predictable(row));
        here.filter_map(of).fold(0.0, farther)
    };
    let at = |k: f64, of: fn(&Row) -> f64| {
        let here = rows.iter().filter(|row| row.engine == EngineName::Reference && row.k == k);
        here.map(of).fold(0.0, farther)
    };
    let [f32s, f64s] = [EngineName::LanesF32, EngineName::LanesF64];
    Verdict {
        holds: bad == 0 && compared > 0,
        sentence: format!(
            "k = {soft:.0e} to {stiff:.0e}: {compared} lanes, {bad} with errors beyond rounding; lanes differ from \
             lanes of twice the steps by at most {:.1e} (f32) and {:.1e} (f64), from the reference by {:.1e} and {:.1e}; \
             scatter of the reference {:.1e} to {:.1e}, its steps per period {:.0} to {:.0}",
            largest(f32s, |row| row.spread),
            largest(f64s, |row| row.spread),
            largest(f32s, |row| row.error),
            largest(f64s, |row| row.error),
            at(soft, |row| row.scatter),
            at(stiff, |row| row.scatter),
            at(soft, |row| row.steps_per_period),
            at(stiff, |row| row.steps_per_period),
        ),
    }
}
