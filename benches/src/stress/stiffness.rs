//! Stiff meshing: the teeth's spring from soft to a million times the supports'.
//!
//! The relative mode of meshing turns at `sqrt(k (1/m1 + 1/m2))`: 39 rad per unit time at k = 1000,
//! 3900 at 10^7, against 4.5 for the supports. Methods that step in time must
//! shorten their step or lose stability; an exact propagator only takes more steps. Rounding costs
//! more in either case: an error in the gap is multiplied by `k`. Lanes measure the gap from
//! the wall that they mesh on; the reference measures it from the middle, and its own scatter grows
//! in proportion to `k`. So lanes are also compared with themselves on a grid twice as fine.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{EngineName, REST, UNFORESEEN, after, apart, bar, flow_of, paper, sensitivity};
use super::lanes::{Lanes, Start};
use super::{Part, Size, Verdict};
use rattlemap::gpu::{Constants, GpuError, LaneSettings};
use rattlemap::record::distance::{farther, is_within};
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::{Status, status_of};
use rattlemap_dynamics::reference::Trajectory;

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
    /// Distance of a lane from itself with twice the steps; none for the reference.
    pub spread: Option<f64>,
    /// What four roundings of start and parameters do to the motion: of moves by four roundings
    /// of single precision, in proportion.
    pub conditioning: f64,
    /// How far the reference itself scatters when they move by four roundings of its own.
    pub scatter: f64,
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
    for (i, cell) in cells.iter().enumerate() {
        let (status, steps) = on_reference(cell);
        rows.push(row(i, EngineName::Reference, status, steps));
    }
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &cells, &LaneSettings::only(PERIODS))?;
        let constants: Vec<Option<Constants>> = cells.iter().map(|(pair, _)| constants(pair)).collect();
        let most = constants.iter().flatten().map(|constants| constants.steps).max();
        let twice =
            LaneSettings { steps_per_period: most.map(|most| 2 * most), ..LaneSettings::only(PERIODS) };
        let finer = lanes.run(precision, &cells, &twice)?;
        for i in 0..cells.len() {
            let status = Status::from_code(records[i].status).unwrap_or(Status::NonFinite);
            let steps = constants[i].as_ref().map_or(f64::INFINITY, |constants| {
                let finest = constants.flow.domains.iter().map(|domain| domain.substeps).fold(1.0, f64::max);
                f64::from(constants.steps) * finest
            });
            let truth = truth[i].as_ref().ok().filter(|_| status == Status::Ok);
            rows.push(Row {
                error: truth.map(|truth| apart(&records[i].strobe, truth)),
                spread: truth.map(|_| apart(&records[i].strobe, &finer[i].strobe)),
                ..row(i, precision.into(), status, steps)
            });
        }
    }
    Ok(rows)
}

fn constants(pair: &GearPair) -> Option<Constants> {
    Constants::new(&pair.oscillator().expect("cells are made valid"), None)
}

/// How the reference ends, and its steps per period.
fn on_reference((pair, start): &Start) -> (Status, f64) {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), *start);
    let ended = (0..PERIODS).try_for_each(|_| trajectory.advance_period(&mut ()));
    let steps = trajectory.work().steps as f64 / f64::from(PERIODS);
    (ended.map_or_else(status_of, |()| Status::Ok), steps)
}

/// Every cell ends well; lanes agree with themselves within what rounding does, and with the
/// reference within that and its own scatter.
pub fn judge(rows: &[Row]) -> Verdict {
    let foreseen = |row: &Row| row.conditioning < UNFORESEEN;
    let rounding = |row: &Row| bar(row.conditioning, row.steps_per_period * f64::from(PERIODS));
    let within = |distance: Option<f64>, bar: f64| distance.is_none_or(|distance| is_within(distance, bar));
    let good = |row: &&Row| {
        row.status == "ok"
            && (!foreseen(row)
                || within(row.spread, rounding(row)) && within(row.error, rounding(row) + 2.0 * row.scatter))
    };
    let bad = rows.iter().filter(|row| !good(row)).count();
    let compared = rows.iter().filter(|row| row.error.is_some() && foreseen(row)).count();
    let ks = || rows.iter().map(|row| row.k);
    let (soft, stiff) = (ks().fold(f64::INFINITY, f64::min), ks().fold(0.0, f64::max));
    let largest = |engine: EngineName, of: fn(&Row) -> Option<f64>| {
        let here = rows.iter().filter(|row| row.engine == engine && foreseen(row));
        here.filter_map(of).fold(0.0, farther)
    };
    let at = |k: f64, of: fn(&Row) -> f64| {
        let here = rows.iter().filter(|row| row.engine == EngineName::Reference && row.k == k);
        here.map(of).fold(0.0, farther)
    };
    let [f32s, f64s] = [EngineName::LanesF32, EngineName::LanesF64];
    Verdict {
        part: Part::Stiffness.name(),
        holds: bad == 0 && compared > 0,
        sentence: format!(
            "k = {soft:.0e} to {stiff:.0e}: {compared} lanes, {bad} off by more than rounding; lanes against twice \
             their steps at most {:.1e} (f32) and {:.1e} (f64), against the reference {:.1e} and {:.1e}, whose own \
             scatter goes from {:.1e} to {:.1e}; its steps per period from {:.0} to {:.0}",
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
