//! Stiff meshing: the teeth's spring from soft to a million times the supports'.
//!
//! The relative mode of meshing turns at `sqrt(k (1/m1 + 1/m2))`: 39 rad per unit time at k = 1000,
//! 3900 at 10^7, against 4.5 for the supports. Methods that step in time pay for that with their
//! step or lose stability; an exact propagator pays with the number of steps alone.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{EngineName, REST, UNFORESEEN, after, apart, bar, flow_of, paper, sensitivity};
use super::lanes::{Lanes, Start, periods};
use super::{Size, Verdict};
use crate::gpu::{Constants, GpuError};
use crate::model::GearPair;
use crate::orbit::{Status, status_of};
use crate::reference::Trajectory;

/// Forcing periods from rest.
const PERIODS: u32 = 8;

/// Restitutions and frequencies: plastic contacts mesh at once, others after chatter.
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
    /// Who computed it.
    pub engine: EngineName,
    /// How it ended: a status's name.
    pub status: &'static str,
    /// Distance from the reference after 8 periods; none for the reference.
    pub error: Option<f64>,
    /// How far rounding of start and parameters moves the reference.
    pub sensitivity: f64,
    /// Steps per forcing period: those taken on the reference, those of a lane that meshes all
    /// the time.
    pub steps_per_period: f64,
}

/// Runs every stiffness on every engine.
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
    let truth: Vec<_> = cells.par_iter().map(|(pair, start)| after(pair, *start, PERIODS)).collect();
    let mut rows: Vec<Row> = cells.par_iter().map(on_reference).collect();
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &cells, &periods(PERIODS))?;
        let engine = EngineName::from(precision);
        let of_lane = |(((pair, start), record), truth): ((&Start, _), &Result<_, _>)| {
            let record: &crate::record::Record = record;
            let status = Status::from_code(record.status).unwrap_or(Status::NonFinite);
            let compared = truth.as_ref().ok().filter(|_| status == Status::Ok);
            let constants = Constants::new(&pair.oscillator().expect("cells are made valid"), None);
            let steps = constants.map_or(f64::INFINITY, |constants| {
                let finest = constants.flow.domains.iter().map(|domain| domain.substeps).fold(1.0, f64::max);
                f64::from(constants.steps) * finest
            });
            Row {
                k: pair.k,
                e: pair.e,
                omega: pair.omega,
                engine,
                status: status.name(),
                error: compared.map(|truth| apart(&record.strobe, truth)),
                sensitivity: sensitivity(pair, *start, PERIODS, engine),
                steps_per_period: steps,
            }
        };
        rows.extend(cells.par_iter().zip(&records).zip(&truth).map(of_lane).collect::<Vec<_>>());
    }
    Ok(rows)
}

fn on_reference((pair, start): &Start) -> Row {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), *start);
    let ended = (0..PERIODS).try_for_each(|_| trajectory.advance_period(&mut ()));
    Row {
        k: pair.k,
        e: pair.e,
        omega: pair.omega,
        engine: EngineName::Reference,
        status: ended.map_or_else(status_of, |()| Status::Ok).name(),
        error: None,
        sensitivity: sensitivity(pair, *start, PERIODS, EngineName::Reference),
        steps_per_period: trajectory.work().steps as f64 / f64::from(PERIODS),
    }
}

/// Every cell ends well, within what rounding does, and the reference's steps stay few.
pub fn judge(rows: &[Row]) -> Verdict {
    let foreseen = |row: &Row| row.sensitivity < UNFORESEEN;
    let bar = |row: &Row| bar(row.sensitivity, row.steps_per_period * f64::from(PERIODS));
    let good = |row: &&Row| {
        row.status == "ok" && row.error.is_none_or(|error| !foreseen(row) || error <= bar(row))
    };
    let bad = rows.iter().filter(|row| !good(row)).count();
    let compared = rows.iter().filter(|row| row.error.is_some() && foreseen(row)).count();
    let largest = |engine: EngineName| {
        let of_engine = rows.iter().filter(|row| row.engine == engine && foreseen(row));
        of_engine.filter_map(|row| row.error).fold(0.0, f64::max)
    };
    let steps = |k: f64| {
        let here = rows.iter().filter(|row| row.engine == EngineName::Reference && row.k == k);
        here.map(|row| row.steps_per_period).fold(0.0, f64::max)
    };
    let ks = || rows.iter().map(|row| row.k);
    let (soft, stiff) = (ks().fold(f64::INFINITY, f64::min), ks().fold(0.0, f64::max));
    Verdict {
        part: "stiffness",
        holds: bad == 0 && compared > 0,
        sentence: format!(
            "k = {soft:.0e} to {stiff:.0e}: {compared} lanes off the reference by at most {:.1e} (f32), {:.1e} \
             (f64), {bad} by more than rounding explains; steps of the reference per period at most {:.0} at the \
             softest, {:.0} at the stiffest",
            largest(EngineName::LanesF32),
            largest(EngineName::LanesF64),
            steps(soft),
            steps(stiff),
        ),
    }
}
