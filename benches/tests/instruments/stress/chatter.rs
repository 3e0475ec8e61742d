//! Chatter as restitution goes to one: infinitely many impacts in finite time.
//!
//! A pair starts on the right wall, to which the force `G = F / m1` presses it, and leaves at `u = T0 G (1 - e) / 2`. Each
//! impact is `e` times slower than the last, so the series takes about `T0` for every `e`, and the number of impacts down
//! to any speed grows like `1 / (1 - e)`. If the meshing speed is zero, engines replace the series by its limit. The
//! correct answer is then that of the reference with a meshing speed of `1e-9`, which computes each impact; for other rows
//! it is that of the reference itself.

use rayon::prelude::*;

use super::Checks;
use super::cells::{
    EngineName, UNPREDICTABLE, paper, run_reference, sensitivity, sensitivity_to, state_after, state_distance,
};
use super::lanes::{Lanes, Start};
use rattlemap::gpu::LaneSettings;
use rattlemap::record::classify::status;
use rattlemap_dynamics::model::{GearPair, State, state};
use rattlemap_dynamics::motion::{EVENTS_PER_PERIOD_CAP, Stop};
use rattlemap_dynamics::orbit::{Status, status_of};

/// One minus the restitutions.
const BELOW_ONE: [f64; 6] = [0.5, 0.1, 1e-2, 1e-3, 1e-4, 0.0];

/// Duration of the series. The force presses for five units of time.
const DURATION: f64 = 0.2;

/// Excitation frequency, so low that the force hardly changes during the series.
const OMEGA: f64 = 0.3;

/// Meshing speed that is practically zero but still makes the reference compute each impact. Its result is as uncertain as
/// a relative change of this size makes it.
const TINY: f64 = 1e-9;

/// Factor by which errors may exceed the effect of rounding of starts and parameters.
const FACTOR: f64 = 8.0;

struct Case {
    start: Start,
    /// Final state of the correct answer, or why the reference stopped.
    expected: Result<State, Stop>,
    impacts: u64,
}

/// How a series ended on one engine.
struct End<'c> {
    case: &'c Case,
    engine: EngineName,
    status: Status,
    /// Difference from the correct answer, and its bound.
    error: Option<(f64, f64)>,
}

/// Compares every restitution on every engine: a series ends in meshing, with an error within rounding, or in `cap_events` if
/// it has more impacts than the engine's cap.
pub(super) fn check(lanes: &mut Lanes) -> Checks {
    let mut checks = Checks::default();
    let starts: Vec<Start> =
        BELOW_ONE.iter().flat_map(|&less| [0.01, 0.0].map(|mesh_speed| cell(less, mesh_speed))).collect();
    let cases: Vec<Case> = starts.par_iter().map(|&start| case(start)).collect();
    let mut ends: Vec<End<'_>> = cases.par_iter().map(on_reference).collect();
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &starts, &LaneSettings::only(1));
        let lane = |(case, record): (_, &_)| {
            let state = (status(record) == Status::Ok).then_some(record.strobe());
            end(case, precision.into(), status(record), state)
        };
        ends.par_extend(cases.par_iter().zip(&records).map(lane));
    }
    let mut comparable = 0;
    for End { case, engine, status, error } in &ends {
        let GearPair { e, mesh_speed, .. } = case.start.0;
        let what = format!("{engine:?}, e = {e}, mesh_speed = {mesh_speed}, {}", status.name());
        match (status, error) {
            (Status::Ok, &Some((error, bar))) => {
                comparable += usize::from(bar <= UNPREDICTABLE);
                checks.add(error, if bar > UNPREDICTABLE { f64::INFINITY } else { bar }, what);
            }
            // The reference reaches its cap when it computes each impact. This engine replaced the series by its limit.
            (Status::Ok, None) => checks.require(mesh_speed < TINY, what),
            (Status::CapEvents, _) => {
                let cap = match engine {
                    EngineName::Reference => EVENTS_PER_PERIOD_CAP,
                    _ => u64::from(LaneSettings::default().events_per_period),
                };
                checks.require(case.impacts > cap, what);
            }
            _ => checks.require(false, what),
        }
    }
    checks.require(comparable > ends.len() / 3, "a third of the series can be compared");
    checks
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

fn on_reference(case: &Case) -> End<'_> {
    let (pair, start) = case.start;
    match state_after(&pair, start, 1) {
        Ok(state) => end(case, EngineName::Reference, Status::Ok, Some(state)),
        Err(stop) => end(case, EngineName::Reference, status_of(stop), None),
    }
}

fn end(case: &Case, engine: EngineName, status: Status, state: Option<State>) -> End<'_> {
    let (pair, start) = case.start;
    let error = state.zip(case.expected.ok()).map(|(state, expected)| {
        let tiny = if pair.mesh_speed < TINY { sensitivity_to(TINY, &pair, start, 1) } else { 0.0 };
        let bar = FACTOR * sensitivity(&pair, start, 1, engine).max(tiny);
        (state_distance(&state, &expected), bar)
    });
    End { case, engine, status, error }
}
