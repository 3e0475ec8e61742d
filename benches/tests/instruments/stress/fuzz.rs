//! Random parameters from the whole valid space, on every engine.
//!
//! Bounded cells take fewer than 2,000 steps per forcing period. They run for 64 periods in lanes of every precision and on
//! the reference, as in the CPU engine. Each must end in a status with finite numbers. If a lane's class, period, word,
//! symmetry, exponent or averages differ from the reference's, [`rattlemap::validate`] must explain the difference by a
//! computation. Wild cells have parameters of any magnitude and run on the reference only.

mod space;

use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::Checks;
use super::cells::{REST, flow_of, run_reference};
use super::lanes::{Lanes, Start};
use rattlemap::gpu::{LaneSettings, Precision};
use rattlemap::map::engine::measured_record;
use rattlemap::map::plan::{Needs, Plan};
use rattlemap::map::scene::{self, Integration, Quantity, Scene};
use rattlemap::record::Record;
use rattlemap::record::classify::{classify, status};
use rattlemap::validate::{
    Draw, Kind, Lanes as ValidationLanes, Rate, Sample, Stratum, Subject, differences, replay,
};
use rattlemap_dynamics::model::{GearPair, State};
use rattlemap_dynamics::orbit::{Budget, Class, Settings, Status, measure as measure_cell};

/// Periods of bounded cells. One half is transient.
const SETTINGS: Settings = Settings { transient_periods: 32, observed_periods: 32, max_period: 16 };

/// Periods of wild cells.
const WILD_PERIODS: u32 = 4;

/// Longest allowed time of a wild cell.
const LONGEST: Duration = Duration::from_secs(120);

/// Statuses of lanes that reached a cap.
const CAPS: [Status; 3] = [Status::CapEvents, Status::CapRoot, Status::TooStiff];

/// Compares `count` bounded cells on every engine, and runs a tenth as many wild cells: all numbers are finite, wild cells end
/// in time, and no more differences lack an explanation than validation tolerates.
pub(super) fn check(count: usize, lanes: &mut Lanes) -> Checks {
    let mut checks = Checks::default();
    let mut cells = space::all_bounded(count);
    // Lanes with similar numbers of steps run together.
    cells.sort_by_cached_key(|(pair, _)| space::iterations(pair));
    let judges: Vec<Record> = each(&cells, on_reference);
    checks.require(judges.iter().all(is_finite), "a record of the reference is not finite");
    let (mut unexplained, mut among) = (Vec::new(), 0);
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &cells, &LaneSettings::within(&budget()));
        checks.require(records.iter().all(is_finite), format!("a record in {precision:?} is not finite"));
        let different: Vec<usize> =
            (0..count).filter(|&i| contradicts(precision, &cells[i].0, &records[i], &judges[i])).collect();
        let explained = |&i: &usize| is_explained(precision, cells[i], &records[i]);
        let explained = each(&different, explained);
        let left = different.iter().zip(explained).filter(|(_, explained)| !explained);
        unexplained.extend(left.map(|(&i, _)| (precision, cells[i])));
        among += count;
    }
    let rate = Rate::new(unexplained.len(), among);
    checks.require(!rate.is_too_many(), format!("lanes without an explanation: {unexplained:?}"));
    let wild = space::all_wild(count / 10);
    for (pair, (is_finite, time)) in wild.iter().zip(each(&wild, run_wild)) {
        checks.require(is_finite, format!("{pair:?} is not finite"));
        checks.add(time.as_secs_f64(), LONGEST.as_secs_f64(), format!("seconds of {pair:?}"));
    }
    checks
}

/// Computes `of` for each item in parallel. Costs differ a thousandfold, so each task has one item.
fn each<T: Sync, R: Send>(list: &[T], of: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
    list.par_iter().with_max_len(1).map(of).collect()
}

fn budget() -> Budget {
    Budget {
        settings: SETTINGS,
        early_stop: true,
        undecided_periods: 0,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: true,
        quantities: false,
    }
}

/// Computes a cell like the CPU engine.
fn on_reference((pair, start): &Start) -> Record {
    let measurement = measure_cell(&flow_of(pair), pair.law(), *start, &budget());
    measured_record(&measurement, &Needs::EVERYTHING)
}

/// Returns whether the state of a wild cell is finite, or it ended in a status, and its time.
fn run_wild(pair: &GearPair) -> (bool, Duration) {
    let clock = Instant::now();
    let end = run_reference(pair, REST, WILD_PERIODS).0;
    (end.is_ok_and(|state| state.iter().all(|x| x.is_finite())) || end.is_err(), clock.elapsed())
}

/// Whether all numbers are finite. Only the exponent of a superstable cycle may be minus infinity.
fn is_finite(record: &Record) -> bool {
    let numbers = [record.lyapunov_error, record.impacts_per_period, record.mesh_fraction];
    let superstable = record.lyapunov == f64::NEG_INFINITY && record.period > 0;
    (record.lyapunov.is_finite() || superstable)
        && numbers.iter().chain(&record.strobe()).all(|number| number.is_finite())
}

/// Whether a lane differs from the reference. One that is undecided or stopped by a cap claims nothing, and if neither engine
/// decides, averages over so few periods claim nothing either.
fn contradicts(precision: Precision, pair: &GearPair, lane: &Record, judge: &Record) -> bool {
    let [of_lane, of_judge] = [lane, judge].map(classify);
    let is_open = of_lane == Class::Undecided
        && (of_judge == Class::Undecided || lane.periods_run >= LaneSettings::within(&budget()).periods);
    let period = std::f64::consts::TAU / pair.omega;
    !is_open
        && !CAPS.contains(&status(lane))
        && !differences(lane, judge, precision, period, &budget()).is_empty()
}

/// Validates a lane's record as that of the first cell of a map. Returns whether it is right or its difference is explained.
fn is_explained(precision: Precision, (pair, start): Start, record: &Record) -> bool {
    let plan = plan(&pair, start);
    let mut records = vec![Record::default(); plan.cell_count()];
    records[0].clone_from(record);
    let subject = Subject { plan: &plan, records: &records, precision, is_lane: true };
    let draws = vec![Draw { stratum: Stratum::Uniform, runs: 1, ids: vec![0] }];
    let sample = Sample { seed: 0, requested: 1, draws, states: Vec::new() };
    let found = replay(&subject, &sample, &ValidationLanes::default(), &|_| ()).mismatches;
    found.iter().all(|mismatch| mismatch.kind != Kind::Unexplained)
}

/// Returns a plan whose first cell is this one. The swept parameters have no upper bound.
fn plan(pair: &GearPair, start: State) -> Plan {
    use Quantity::{Class, Impacts, Lyapunov, Mesh, Symmetric, Word};
    let Settings { transient_periods, observed_periods, max_period } = SETTINGS;
    let integration =
        Integration { transient_periods, observed_periods, max_period, ..Integration::default() };
    let scene = Scene::builder(*pair)
        .axis("omega", pair.omega..=2.0 * pair.omega + 1.0, 2)
        .axis("mesh_speed", pair.mesh_speed..=2.0 * pair.mesh_speed + 1.0, 2)
        .integration(integration)
        .start(scene::Start::State(start))
        .quantities(&[Class, Lyapunov, Impacts, Mesh, Symmetric, Word]);
    Plan::new(&scene.build().expect("a valid cell makes a valid scene"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::Model;

    #[test]
    fn the_first_cell_of_the_plan_is_the_given_cell() {
        for (pair, start) in space::all_bounded(200) {
            let plan = plan(&pair, start);
            let (model, mut of_plan) = (plan.model(0), GearPair::paper(0.0));
            (0..model.parameters().len()).for_each(|index| of_plan.assign(index, model.value(index)));
            assert_eq!((of_plan, plan.start(0, &[])), (pair, start));
            assert_eq!(plan.budget(), &budget());
        }
    }
}
