//! Lanes against the reference, cell by cell, with the machinery of [`crate::validate`].

use rayon::prelude::*;

use super::SETTINGS;
use super::super::cells::EngineName;
use super::super::lanes::Start;
use crate::gpu::Precision;
use crate::model::{GearPair, State};
use crate::plan::Plan;
use crate::record::Record;
use crate::scene::{Purpose, Scene};
use crate::validate::{Difference, Explanation, Pick, Sample, StateSource, Stratum, Subject, replay};

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
    /// Why, if a computation shows it.
    pub explanation: Option<Explanation>,
}

/// Every lane that differs from the reference, in the order of the cells.
pub(super) fn all(precision: Precision, cells: &[Start], records: &[Record]) -> Vec<Mismatch> {
    let one = |(&(pair, start), record): (&Start, &Record)| one(precision, pair, start, record);
    cells.par_iter().zip(records).with_max_len(1).filter_map(one).collect()
}

fn one(precision: Precision, pair: GearPair, start: State, record: &Record) -> Option<Mismatch> {
    let plan = plan(&pair, start);
    let mut records = vec![Record::default(); plan.cell_count()];
    records[0] = *record;
    let subject = Subject { plan: &plan, records: &records, precision, is_lane: true };
    let picks = vec![Pick { id: 0, stratum: Stratum::Uniform }];
    let sample = Sample { seed: 0, picks, strata: Vec::new() };
    let clock = std::time::Instant::now();
    let validation = replay(&subject, &sample, StateSource::None(String::new()), &|_| ());
    if clock.elapsed().as_secs_f64() > 2.0 { eprintln!("SLOW compare {:?} {:?} {pair:?} {start:?} {:?}", clock.elapsed(), precision, validation.mismatches); }
    let mismatch = validation.mismatches.into_iter().next()?;
    let (differences, explanation) = (mismatch.differences, mismatch.explanation);
    Some(Mismatch { engine: precision.into(), pair, start, differences, explanation })
}

/// A plan whose first cell is this one: the swept parameters have no upper bound.
fn plan(pair: &GearPair, start: State) -> Plan {
    const SWEPT: [&str; 2] = ["omega", "mesh_speed"];
    let value = |name: &str| pair.get(name).expect("a parameter of the table");
    let names = GearPair::PARAMETERS.iter().map(|parameter| parameter.name);
    let fixed: String =
        names.filter(|name| !SWEPT.contains(name)).map(|name| format!("{name} = {:?}\n", value(name))).collect();
    let axis = |name: &str| {
        let min = value(name);
        format!("[[axis]]\nparameter = '{name}'\nmin = {min:?}\nmax = {:?}\ncount = 2\n", 2.0 * min + 1.0)
    };
    let axes = SWEPT.map(axis).concat();
    let crate::orbit::Settings { transient_periods, observed_periods, max_period } = SETTINGS;
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
    use super::super::space;
    use super::*;
    use crate::random::Random;

    #[test]
    fn the_first_cell_of_the_plan_is_the_cell() {
        let mut random = Random::new(3);
        for _ in 0..200 {
            let (pair, start) = space::bounded(&mut random);
            let plan = plan(&pair, start);
            assert_eq!((plan.gear_pair(0), plan.start()), (pair, start));
        }
    }
}
