//! Compares lanes with the reference, cell by cell, by means of [`rattlemap::validate`].

use super::super::cells::EngineName;
use super::super::lanes::Start;
use super::{Counter, Rows, SETTINGS, budget, each, lane_settings};
use crate::stress::Watch;
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::random::Random;
use rattlemap::map::scene::{self, Integration, Quantity, Scene};
use rattlemap::record::Record;
use rattlemap::record::classify::{classify, status};
use rattlemap::validate::{Difference, Draw, Kind, Lanes, Sample, Stratum, Subject, differences, replay};
use rattlemap_dynamics::model::{GearPair, State};
use rattlemap_dynamics::orbit::{Class, Status};

/// Statuses of lanes that reached a cap.
const CAPS: [Status; 3] = [Status::CapEvents, Status::CapRoot, Status::TooStiff];

/// A lane whose record differs from the reference's.
#[derive(Clone, Debug)]
pub struct Mismatch {
    /// The engine.
    pub engine: EngineName,
    /// The cell.
    pub pair: GearPair,
    /// The cell's start.
    pub start: State,
    /// The fields that differ.
    pub differences: Vec<Difference>,
    /// The explanation.
    pub kind: Kind,
}

/// Compares every lane with the reference and adds the results to `rows`. It looks for an explanation of at most `most` of
/// the lanes that differ, which `seed` chooses.
pub(super) fn all(
    precision: Precision,
    cells: &[Start],
    judges: &[Record],
    records: &[Record],
    (seed, most): (u64, usize),
    watch: &dyn Watch,
    rows: &mut Rows,
) {
    let differs = |&i: &usize| {
        // If neither engine decides, averages over so few periods claim nothing.
        if [&records[i], &judges[i]].iter().all(|record| classify(record) == Class::Undecided) {
            return false;
        }
        let period = std::f64::consts::TAU / cells[i].0.omega;
        !differences(&records[i], &judges[i], precision, period, &budget()).is_empty()
    };
    let is_undecided = |&i: &usize| {
        let is_open =
            classify(&records[i]) == Class::Undecided && records[i].periods_run >= lane_settings().periods;
        is_open || CAPS.contains(&status(&records[i]))
    };
    let (undecided, mut different): (Vec<usize>, Vec<usize>) =
        (0..cells.len()).filter(differs).partition(is_undecided);
    rows.undecided += undecided.len();
    let examined = different.len().min(most);
    Random::new(seed).draw(&mut different, examined);
    rows.unexamined += different.split_off(examined).len();
    let counter = Counter::new(watch, "lanes examined", examined);
    let explanation = |&i: &usize| {
        let mismatch = explain(precision, cells[i], records[i]);
        if let Some(Mismatch { engine, pair, start, differences, kind: Kind::Unexplained }) = &mismatch {
            watch.found(&format!("unexplained: {} {pair:?} from {start:?}: {differences:?}", engine.name()));
        }
        counter.count(mismatch)
    };
    rows.mismatches.extend(each(&different, explanation).into_iter().flatten());
}

/// Validates a lane's record as that of the first cell of a map. Returns `None` if it is right.
fn explain(precision: Precision, (pair, start): Start, record: Record) -> Option<Mismatch> {
    let plan = plan(&pair, start);
    let mut records = vec![Record::default(); plan.cell_count()];
    records[0] = record;
    let subject = Subject { plan: &plan, records: &records, precision, is_lane: true };
    let draws = vec![Draw { stratum: Stratum::Uniform, runs: 1, ids: vec![0] }];
    let sample = Sample { seed: 0, requested: 1, draws, states: Vec::new() };
    let mismatch = replay(&subject, &sample, &Lanes::default(), &|_| ()).mismatches.into_iter().next()?;
    let (differences, kind) = (mismatch.differences, mismatch.kind);
    Some(Mismatch { engine: precision.into(), pair, start, differences, kind })
}

/// Returns a plan whose first cell is this one. The swept parameters have no upper bound.
fn plan(pair: &GearPair, start: State) -> Plan {
    use Quantity::{Class, Impacts, Lyapunov, Mesh, Symmetric, Word};
    let rattlemap_dynamics::orbit::Settings { transient_periods, observed_periods, max_period } = SETTINGS;
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
    use super::super::space;
    use super::*;
    use rattlemap_dynamics::model::Model;

    #[test]
    fn the_first_cell_of_the_plan_is_the_given_cell() {
        for (pair, start) in space::all_bounded(200, 3, &()) {
            let plan = plan(&pair, start);
            let (model, mut of_plan) = (plan.model(0), GearPair::paper(0.0));
            (0..model.parameters().len()).for_each(|index| of_plan.assign(index, model.value(index)));
            assert_eq!((of_plan, plan.start(0, &[])), (pair, start));
            assert_eq!(plan.budget(), &budget());
        }
    }
}
