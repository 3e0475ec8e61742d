//! Chatter as restitution goes to one: infinitely many impacts in finite time.
//!
//! A pair starts on the right wall, pressed by the force `G = F / m1` and leaving at
//! `u = T0 G (1 - e) / 2`, so that its series of impacts, each `e` times slower than the last, takes
//! about `T0` whatever `e` is; the number of impacts down to any speed grows like `1 / (1 - e)`.
//! Without a meshing speed the series is closed by its limit. The truth for that is the reference
//! with a meshing speed of `1e-9`, which takes impact after impact; for other rows it is the
//! reference itself.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{EngineName, UNFORESEEN, after, apart, flow_of, paper, sensitivity, sensitivity_to};
use super::lanes::{Lanes, Start};
use super::{Part, Size, Verdict};
use rattlemap::gpu::{GpuError, LaneSettings};
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::{Status, status_of};
use rattlemap_dynamics::reference::{Stop, Trajectory};

/// Duration of the series; the force presses for five units of time.
const DURATION: f64 = 0.2;

/// Frequency: the force hardly changes meanwhile.
const OMEGA: f64 = 0.3;

/// A meshing speed this small is as good as none, and yet met by impacts one by one. That truth
/// itself is known to no more than what a share of this size does to the motion.
const TINY: f64 = 1e-9;

/// Errors may be this many times what rounding of starts and parameters does.
const FACTOR: f64 = 8.0;

/// One restitution on one engine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Restitution.
    pub e: f64,
    /// Leaving speed at which meshing starts.
    pub mesh_speed: f64,
    /// Who computed it.
    pub engine: EngineName,
    /// How it ended: a status's name.
    pub status: &'static str,
    /// Impacts in the forcing period, taken one by one on the reference.
    pub impacts: u64,
    /// Largest difference of the state's entries after the forcing period.
    pub error: Option<f64>,
    /// What it may be; beyond 0.1 anything.
    pub bar: Option<f64>,
}

struct Case {
    start: Start,
    /// How the truth ends, and its impacts.
    truth: Result<[f64; 4], Stop>,
    impacts: u64,
}

/// Runs every restitution on every engine.
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
                    let status = Status::from_code(record.status).unwrap_or(Status::NonFinite);
                    let state = (status == Status::Ok).then_some(record.strobe);
                    row(case, precision.into(), status, state)
                })
                .collect::<Vec<_>>(),
        );
    }
    Ok(rows)
}

/// `1 - e` is `less`.
fn cell(less: f64, mesh_speed: f64) -> Start {
    let pair = GearPair { mesh_speed, ..paper(1.0 - less, OMEGA) };
    // An elastic series never slows down: any speed does.
    let share = if less > 0.0 { less } else { 1e-2 };
    let leaving = 0.5 * DURATION * (pair.force / pair.m1) * share;
    (pair, [pair.b, -leaving, 0.0, 0.0])
}

fn case((pair, start): Start) -> Case {
    let one_by_one = GearPair { mesh_speed: pair.mesh_speed.max(TINY), ..pair };
    let flow = flow_of(&one_by_one);
    let mut trajectory = Trajectory::new(&flow, one_by_one.law(), start);
    let ended = trajectory.advance_period(&mut ());
    let truth = ended.map(|()| trajectory.state());
    Case { start: (pair, start), truth, impacts: trajectory.work().impacts }
}

fn on_reference(case: &Case) -> Row {
    let (pair, start) = case.start;
    match after(&pair, start, 1) {
        Ok(state) => row(case, EngineName::Reference, Status::Ok, Some(state)),
        Err(stop) => row(case, EngineName::Reference, status_of(stop), None),
    }
}

fn row(case: &Case, engine: EngineName, status: Status, state: Option<[f64; 4]>) -> Row {
    let (pair, start) = case.start;
    let error = state.zip(case.truth.ok()).map(|(state, truth)| apart(&state, &truth));
    let bar = || {
        let truth = if pair.mesh_speed < TINY { sensitivity_to(TINY, &pair, start, 1) } else { 0.0 };
        FACTOR * sensitivity(&pair, start, 1, engine).max(truth)
    };
    Row {
        e: pair.e,
        mesh_speed: pair.mesh_speed,
        engine,
        status: status.name(),
        impacts: case.impacts,
        error,
        // Where nothing ended, nothing is compared.
        bar: error.map(|_| bar()),
    }
}

/// Every series ends: on its meshing, within what rounding does, or in `cap_events` where there
/// are more impacts than the engine's cap.
pub fn judge(rows: &[Row]) -> Verdict {
    let cap = |engine: EngineName| match engine {
        EngineName::Reference => rattlemap_dynamics::reference::EVENTS_PER_PERIOD_CAP,
        EngineName::LanesF32 | EngineName::LanesF64 => u64::from(LaneSettings::default().events_per_period),
    };
    let good = |row: &&Row| match (row.status, row.error) {
        ("ok", Some(error)) => {
            error.is_finite() && row.bar.is_none_or(|bar| bar > UNFORESEEN || error <= bar)
        }
        // The truth itself has no end below its cap, but this series was closed.
        ("ok", None) => row.mesh_speed < TINY,
        ("cap_events", _) => row.impacts > cap(row.engine),
        _ => false,
    };
    let bad = rows.iter().filter(|row| !good(row)).count();
    let ok = rows.iter().filter(|row| row.status == "ok").count();
    let foreseen = rows.iter().filter(|row| row.bar.is_some_and(|bar| bar <= UNFORESEEN)).count();
    let nearest = |rows: &mut dyn Iterator<Item = &Row>| {
        rows.filter(|row| row.status == "ok" && row.e < 1.0).map(|row| row.e).fold(0.0, f64::max)
    };
    let told: Vec<String> = EngineName::ALL
        .into_iter()
        .filter(|&engine| rows.iter().any(|row| row.engine == engine))
        .map(|engine| {
            let e = nearest(&mut rows.iter().filter(|row| row.engine == engine));
            format!("{} up to 1 - e = {:.0e}", engine.name(), 1.0 - e)
        })
        .collect();
    Verdict {
        part: Part::Chatter.name(),
        holds: bad == 0 && foreseen > rows.len() / 3,
        sentence: format!(
            "{} series of impacts, {ok} followed to their ends ({}), the others ended by cap_events; {foreseen} \
             could be compared, {bad} are wrong",
            rows.len(),
            told.join(", ")
        ),
    }
}
