//! Lanes against the reference, cell by cell, with the machinery of [`rattlemap::validate`].

use super::super::cells::EngineName;
use super::super::lanes::Start;
use super::{SETTINGS, Told, budget, each, lane_settings};
use crate::stress::Watch;
use rattlemap::gpu::Precision;
use rattlemap::map::engine::measured_record;
use rattlemap::map::plan::{Needs, Plan};
use rattlemap::map::random::Random;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::Record;
use rattlemap::record::classify::{classify, status};
use rattlemap::validate::{Difference, Draw, Kind, Lanes, Sample, Stratum, Subject, differences, replay};
use rattlemap_dynamics::model::{GearPair, Model, State};
use rattlemap_dynamics::orbit::{Class, Measurement, Status};

/// How lanes say that they could not go on.
const CAPS: [Status; 3] = [Status::CapEvents, Status::CapRoot, Status::TooStiff];

/// A lane whose record is not what the reference says.
#[derive(Clone, Debug)]
pub struct Mismatch {
    /// Who computed it.
    pub engine: EngineName,
    /// The cell.
    pub pair: GearPair,
    /// Where it starts.
    pub start: State,
    /// What differs.
    pub differences: Vec<Difference>,
    /// Why.
    pub kind: Kind,
}

/// Lanes against the reference.
#[derive(Clone, Debug, Default)]
pub(super) struct Comparison {
    /// Lanes that decide nothing within their periods, or that a cap ended, where the reference decides: they claim
    /// nothing that could be wrong.
    pub(super) silent: usize,
    /// Lanes that say something else than the reference and were examined.
    pub(super) mismatches: Vec<Mismatch>,
    /// Those that were not, beyond the number asked for.
    pub(super) left: usize,
}

/// Compares every lane with what was measured on the reference, and examines at most so many of
/// those that differ, which `seed` chooses.
pub(super) fn all(
    precision: Precision,
    cells: &[Start],
    truth: &[Measurement],
    records: &[Record],
    (seed, most): (u64, usize),
    watch: &dyn Watch,
) -> Comparison {
    let differs = |&i: &usize| {
        // Where neither side decides anything, averages over so few periods are nobody's claim.
        let are_open = classify(&records[i]) == Class::Undecided
            && classify(&measured_record(&truth[i], &Needs::EVERYTHING)) == Class::Undecided;
        if are_open {
            return false;
        }
        let period = std::f64::consts::TAU / cells[i].0.omega;
        let judge = measured_record(&truth[i], &Needs::EVERYTHING);
        !differences(&records[i], &judge, precision, period, &budget()).is_empty()
    };
    let is_silent = |&i: &usize| {
        let is_open =
            classify(&records[i]) == Class::Undecided && records[i].periods_run >= lane_settings().periods;
        is_open || CAPS.contains(&status(&records[i]))
    };
    let (silent, mut different): (Vec<usize>, Vec<usize>) =
        (0..cells.len()).filter(differs).partition(is_silent);
    let examined = different.len().min(most);
    Random::new(seed).draw(&mut different, examined);
    let left = different.split_off(examined).len();
    let told = Told::new(watch, "lanes examined", examined);
    let examine = |&i: &usize| {
        let mismatch = Cell::new(precision, cells[i], records[i]).examine();
        if let Some(Mismatch { engine, pair, start, differences, kind: Kind::Unexplained }) = &mismatch {
            watch.found(&format!("unexplained: {} {pair:?} from {start:?}: {differences:?}", engine.name()));
        }
        told.count(mismatch)
    };
    let mismatches = each(&different, examine).into_iter().flatten().collect();
    Comparison { silent: silent.len(), mismatches, left }
}

/// A cell and its record as a map of which it is the first cell.
struct Cell {
    precision: Precision,
    pair: GearPair,
    start: State,
    plan: Plan,
    records: Vec<Record>,
}

impl Cell {
    fn new(precision: Precision, (pair, start): Start, record: Record) -> Cell {
        let plan = plan(&pair, start);
        let mut records = vec![Record::default(); plan.cell_count()];
        records[0] = record;
        Cell { precision, pair, start, plan, records }
    }

    fn subject(&self) -> Subject<'_> {
        Subject { plan: &self.plan, records: &self.records, precision: self.precision, is_lane: true }
    }

    fn examine(&self) -> Option<Mismatch> {
        let draws = vec![Draw { stratum: Stratum::Uniform, runs: 1, ids: vec![0] }];
        let sample = Sample { seed: 0, draws, states: Vec::new() };
        let validation = replay(&self.subject(), &sample, &Lanes::default(), &|_| ());
        let mismatch = validation.mismatches.into_iter().next()?;
        Some(Mismatch {
            engine: self.precision.into(),
            pair: self.pair,
            start: self.start,
            differences: mismatch.differences,
            kind: mismatch.kind,
        })
    }
}

/// A plan whose first cell is this one: the swept parameters have no upper bound.
fn plan(pair: &GearPair, start: State) -> Plan {
    const SWEPT: [&str; 2] = ["omega", "mesh_speed"];
    let value = |name: &str| pair.get(name).expect("a parameter of the table");
    let names = GearPair::PARAMETERS.iter().map(|parameter| &*parameter.name);
    let fixed: String = names
        .filter(|name| !SWEPT.contains(name))
        .map(|name| format!("{name} = {:?}\n", value(name)))
        .collect();
    let axis = |name: &str| {
        let min = value(name);
        format!("[[axis]]\nparameter = '{name}'\nmin = {min:?}\nmax = {:?}\ncount = 2\n", 2.0 * min + 1.0)
    };
    let axes = SWEPT.map(axis).concat();
    let rattlemap_dynamics::orbit::Settings { transient_periods, observed_periods, max_period } = SETTINGS;
    let text = format!(
        "[parameters]\n{fixed}{axes}[integration]\ntransient_periods = {transient_periods}\n\
         observed_periods = {observed_periods}\nmax_period = {max_period}\n\
         [start]\npolicy = 'state'\nstate = {start:?}\n\
         [outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\n"
    );
    let scene = Scene::parse(&text, "cell", &[], Purpose::Map).expect("a valid cell makes a valid scene");
    Plan::new(&scene)
}

#[cfg(test)]
mod tests {
    use super::super::{budget, space};
    use super::*;

    #[test]
    fn the_first_cell_of_the_plan_is_the_cell() {
        for (pair, start) in space::all_bounded(200, 3, &()) {
            let plan = plan(&pair, start);
            let (model, mut of_plan) = (plan.model(0), GearPair::paper(0.0));
            (0..model.parameters().len()).for_each(|index| of_plan.assign(index, model.value(index)));
            assert_eq!((of_plan, plan.start(0, &[])), (pair, start));
            assert_eq!(plan.budget(), &budget());
        }
    }
}
