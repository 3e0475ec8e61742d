//! Which cells are replayed: a sample in strata, so that rare kinds are seen, too.

use crate::classify::{classify, status};
use crate::orbit::{Class, Status};
use crate::plan::Plan;
use crate::random::Random;
use crate::record::{Record, valid};

/// Why a cell is in the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stratum {
    /// Drawn from all runs that were integrated.
    Uniform,
    /// One of its four neighbours has another class or period.
    Border,
    /// Its status is this one, and not `ok`.
    Status(Status),
}

/// A cell of the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pick {
    /// The run, as in [`Plan::cell`].
    pub id: u32,
    /// What it was drawn for; it may belong to other strata, too.
    pub stratum: Stratum,
}

/// How large a stratum is, and how many cells were drawn for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StratumCount {
    /// Which.
    pub stratum: Stratum,
    /// Integrated runs of the map that belong to it.
    pub runs: usize,
    /// Runs drawn for it.
    pub sampled: usize,
}

/// Cells to replay.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sample {
    /// What decided the draw.
    pub seed: u64,
    /// The cells, each once.
    pub picks: Vec<Pick>,
    /// The same by stratum.
    pub strata: Vec<StratumCount>,
    /// Cells among which these are compared: of many, averages may be as rare as one in so many.
    pub among: usize,
}

/// Draws `size` runs, or all if there are fewer: half of them from all that were integrated, a
/// quarter at class borders, the rest shared equally among the statuses other than `ok`. What a
/// stratum is short of is drawn from all. The same map, size and seed give the same sample.
pub fn sample(plan: &Plan, records: &[Record], size: usize, seed: u64) -> Sample {
    let mut draw = Draw { random: Random::new(seed), taken: vec![false; records.len()], picks: Vec::new() };
    // Filled cells were never integrated: the audit of an adaptive map looks after them.
    let is_own = |id: &u32| records[*id as usize].valid & valid::FILLED == 0;
    let all: Vec<u32> = (0..records.len() as u32).filter(is_own).collect();
    let size = size.min(all.len());
    let mut counts = Vec::new();
    draw.from(&all, size - size / 2, Stratum::Uniform);

    let border: Vec<u32> = border(plan, records).into_iter().filter(is_own).collect();
    counts.push((Stratum::Border, border.len()));
    draw.from(&border, size / 4, Stratum::Border);

    let of = |wanted: Status| all.iter().copied().filter(move |&id| status(&records[id as usize]) == wanted);
    let kinds = || Status::ALL.into_iter().filter(|&kind| kind != Status::Ok && of(kind).next().is_some());
    let share = (size / 2 - size / 4) / kinds().count().max(1);
    for kind in kinds() {
        let cells: Vec<u32> = of(kind).collect();
        counts.push((Stratum::Status(kind), cells.len()));
        draw.from(&cells, share, Stratum::Status(kind));
    }
    let missing = size - draw.picks.len();
    draw.from(&all, missing, Stratum::Uniform);
    counts.insert(0, (Stratum::Uniform, all.len()));

    let sampled = |stratum| draw.picks.iter().filter(|pick| pick.stratum == stratum).count();
    let strata =
        counts.into_iter().map(|(stratum, runs)| StratumCount { stratum, runs, sampled: sampled(stratum) });
    Sample { seed, strata: strata.collect(), among: draw.picks.len(), picks: draw.picks }
}

struct Draw {
    random: Random,
    taken: Vec<bool>,
    picks: Vec<Pick>,
}

impl Draw {
    /// Draws up to `count` cells of the list that were not drawn before.
    fn from(&mut self, list: &[u32], count: usize, stratum: Stratum) {
        let mut left: Vec<u32> = list.iter().copied().filter(|&id| !self.taken[id as usize]).collect();
        let count = count.min(left.len());
        self.random.draw(&mut left, count);
        for &id in &left[..count] {
            self.taken[id as usize] = true;
            self.picks.push(Pick { id, stratum });
        }
    }
}

/// Runs with a neighbour to the side, above or below of another class or period.
fn border(plan: &Plan, records: &[Record]) -> Vec<u32> {
    let classes: Vec<Class> = records.iter().map(classify).collect();
    let [columns, rows] = plan.axes().map(|axis| axis.count());
    let differs = |id: usize| {
        let [i, j] = plan.indices(id as u32);
        let neighbours = [
            (i > 0).then(|| id - 1),
            (i + 1 < columns).then(|| id + 1),
            (j > 0).then(|| id - columns),
            (j + 1 < rows).then(|| id + columns),
        ];
        neighbours.into_iter().flatten().any(|other| classes[other] != classes[id])
    };
    (0..records.len()).filter(|&id| differs(id)).map(|id| id as u32).collect()
}
