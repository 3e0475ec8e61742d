//! Chatter as restitution goes to one: infinitely many impacts in finite time.
//!
//! A pair starts on the right wall, to which the force `G = F / m1` presses it, and leaves at `u = T0 G (1 - e) / 2`. Each
//! impact is `e` times slower than the last, so the series takes about `T0` for every `e`, and the number of impacts down
//! to any speed grows like `1 / (1 - e)`. If the meshing speed is zero, engines replace the series by its limit. The
//! correct answer is then that of the reference with a meshing speed of `1e-9`, which computes each impact; for other rows
//! it is that of the reference itself.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{
    EngineName, UNPREDICTABLE, paper, run_reference, sensitivity, sensitivity_to, state_after, state_distance,
};
use super::lanes::{Lanes, Start};
use super::{Size, Verdict};
use rattlemap::gpu::{GpuError, LaneSettings};
use rattlemap::record::classify::status;
use rattlemap_dynamics::model::{GearPair, State, state};
use rattlemap_dynamics::motion::Stop;
use rattlemap_dynamics::orbit::{Status, status_of};

/// Duration of the series. The force presses for five units of time.
const DURATION: f64 = 0.2;

/// Excitation frequency, so low that the force hardly changes during the series.
const OMEGA: f64 = 0.3;

/// Meshing speed that is practically zero but still makes the reference compute each impact. Its result is as uncertain as
/// a relative change of this size makes it.
const TINY: f64 = 1e-9;

/// Factor by which errors may exceed the effect of rounding of starts and parameters.
const FACTOR: f64 = 8.0;

/// One restitution on one engine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Restitution.
    pub e: f64,
    /// Leaving speed at which meshing starts.
    pub mesh_speed: f64,
    /// The engine.
    pub engine: EngineName,
    /// Name of the status.
    pub status: &'static str,
    /// Number of impacts in the forcing period when the reference computes each.
    pub impacts: u64,
    /// Largest difference of the state's components after the forcing period.
    pub error: Option<f64>,
    /// Largest allowed error. Above 0.1 any error is allowed.
    pub bar: Option<f64>,
}

struct Case {
    start: Start,
    /// Final state of the correct answer, or why the reference stopped.
    expected: Result<State, Stop>,
    impacts: u64,
}

/// Computes every restitution on every engine.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, lanes: &mut Lanes) -> Result<Vec<Row>, GpuError> {
    let below_one: &[f64] = size.pick(
        &[0.1, 1e-2],
        &[0.5, 0.1, 1e-2, 1e-3, 1e-4, 0.0],
        &[0.5, 0.3, 0.1, 0.03, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6, 1e-9, 0.0],
    );
    let cells = below_one.iter().flat_map(|&less| [0.01, 0.0].map(|mesh_speed| cell(less, mesh_speed)));
    let starts: Vec<Start> = cells.collect();
    let cases: Vec<Case> = starts.par_iter().map(|&start| case(start)).collect();
    let mut rows: Vec<Row> = cases.par_iter().map(on_reference).collect();
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &starts, &LaneSettings::only(1))?;
        rows.extend(
            cases
                .par_iter()
                .zip(records)
                .map(|(case, record)| {
                    let state = (status(&record) == Status::Ok).then_some(record.strobe);
                    row(case, precision.into(), status(&record), state)
                })
                .collect::<Vec<_>>(),
        );
    }
    Ok(rows)
}

/// Returns the cell with restitution `1 - less`.
fn cell(less: f64, mesh_speed: f64) -> Start {
    let pair = GearPair { mesh_speed, ..paper(1.0 - less, OMEGA) };
    // An elastic series never slows down, so any speed will do.
    let share = if less > 0.0 { less } else { 1e-2 };
    let leaving = 0.5 * DURATION * (pair.force / pair.m1) * share;
    (pair, state(&[pair.b, -leaving]))
}

fn case((pair, start): Start) -> Case {
    let one_by_one = GearPair { mesh_speed: pair.mesh_speed.max(TINY), ..pair };
    let (expected, work) = run_reference(&one_by_one, start, 1);
    Case { start: (pair, start), expected, impacts: work.impacts }
}

fn on_reference(case: &Case) -> Row {
    let (pair, start) = case.start;
    match state_after(&pair, start, 1) {
        Ok(state) => row(case, EngineName::Reference, Status::Ok, Some(state)),
        Err(stop) => row(case, EngineName::Reference, status_of(stop), None),
    }
}

fn row(case: &Case, engine: EngineName, status: Status, state: Option<State>) -> Row {
    let (pair, start) = case.start;
    let error = state.zip(case.expected.ok()).map(|(state, expected)| state_distance(&state, &expected));
    let bar = || {
        let tiny = if pair.mesh_speed < TINY { sensitivity_to(TINY, &pair, start, 1) } else { 0.0 };
        FACTOR * sensitivity(&pair, start, 1, engine).max(tiny)
    };
    Row {
        e: pair.e,
        mesh_speed: pair.mesh_speed,
        engine,
        status: status.name(),
        impacts: case.impacts,
        error,
        bar: error.map(|_| bar()),
    }
}

/// Requires that every series ends in meshing, with an error within rounding, or in `cap_events` if it has more impacts
/// than the engine's cap.
pub fn judge(rows: &[Row]) -> Verdict {
    let cap = |engine: EngineName| match engine {
        EngineName::Reference => rattlemap_dynamics::motion::EVENTS_PER_PERIOD_CAP,
        EngineName::LanesF32 | EngineName::LanesF64 => u64::from(LaneSettings::default().events_per_period),
    };
    let good = |row: &&Row| match (row.status, row.error) {
        ("ok", Some(error)) => {
            error.is_finite() && row.bar.is_none_or(|bar| bar > UNPREDICTABLE || error <= bar)
        }
        // The reference reaches its cap when it computes each impact. This engine replaced the series by its limit.
        ("ok", None) => row.mesh_speed < TINY,
        ("cap_events", _) => row.impacts > cap(row.engine),
        _ => false,
    };
    let bad = rows.iter().filter(|row| !good(row)).count();
    let ok = rows.iter().filter(|row| row.status == "ok").count();
    let comparable = rows.iter().filter(|row| row.bar.is_some_and(|bar| bar <= UNPREDICTABLE)).count();
    let nearest = |engine: EngineName| {
        let of_engine = rows.iter().filter(|row| row.engine == engine);
        of_engine.filter(|row| row.status == "ok" && row.e < 1.0).map(|row| row.e).reduce(f64::max)
    };
    let by_engine: Vec<String> = EngineName::ALL
        .into_iter()
        .filter_map(|engine| Some((engine, nearest(engine)?)))
        .map(|(engine, e)| format!("{} up to 1 - e = {:.0e}", engine.name(), 1.0 - e))
        .collect();
    Verdict {
        holds: bad == 0 && comparable > rows.len() / 3,
        sentence: format!(
            "{} series of impacts, {ok} computed to their ends ({}), the others stopped by cap_events; {comparable} \
             could be compared, {bad} are wrong",
            rows.len(),
            by_engine.join(", ")
        ),
    }
}
