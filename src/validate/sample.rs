//! Which cells are replayed: a uniform sample, and two of rare kinds that are counted apart.

use crate::map::plan::Plan;
use crate::map::random::Random;
use crate::record::classify::{classify, status};
use crate::record::{Record, valid};
use rattlemap_dynamics::orbit::{Class, Status};

/// Lanes whose states are looked at beside, per cell of the sample: a few periods each.
const STATES_PER_CELL: usize = 10;

/// What a cell was drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stratum {
    /// All runs that were integrated: rates of the map come from these alone.
    Uniform,
    /// Runs with a neighbour of another class or period.
    Border,
    /// Runs whose status is not `ok`.
    Status,
}

impl Stratum {
    /// Every stratum, the uniform one first.
    pub const ALL: [Stratum; 3] = [Stratum::Uniform, Stratum::Border, Stratum::Status];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Stratum::Uniform => "uniform",
            Stratum::Border => "border",
            Stratum::Status => "status",
        }
    }
}

/// Cells of one stratum, drawn without regard to the other strata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draw {
    /// Which.
    pub stratum: Stratum,
    /// Integrated runs of the map that belong to it.
    pub runs: usize,
    /// Those that were drawn, by id, ascending.
    pub ids: Vec<u32>,
}

/// Cells to replay.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sample {
    /// What decided the draw.
    pub seed: u64,
    /// The cells by stratum; one may be in several.
    pub draws: Vec<Draw>,
    /// Cells whose states are compared after a few periods, drawn from all.
    pub states: Vec<u32>,
}

impl Sample {
    /// The cells, each once, ascending.
    pub fn ids(&self) -> Vec<u32> {
        let mut ids: Vec<u32> = self.draws.iter().flat_map(|draw| &draw.ids).copied().collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

/// Draws `size` runs: half of them from all that were integrated, a quarter at borders of classes, a quarter by
/// status. What a stratum is short of is drawn from all; a map that has no more runs is replayed whole. The same map,
/// size and seed give the same sample.
pub fn sample(plan: &Plan, records: &[Record], size: usize, seed: u64) -> Sample {
    // Filled cells were never integrated: the audit of an adaptive map looks after them.
    let is_own = |id: &u32| records[*id as usize].valid & valid::FILLED == 0;
    let all: Vec<u32> = (0..records.len() as u32).filter(is_own).collect();
    let rare: [Vec<u32>; 2] = if size >= all.len() {
        [Vec::new(), Vec::new()]
    } else {
        let remarked = |id: &u32| status(&records[*id as usize]) != Status::Ok;
        [
            border(plan, records).into_iter().filter(is_own).collect(),
            all.iter().copied().filter(remarked).collect(),
        ]
    };
    let shares = [0, 1].map(|i| rare[i].len().min(size / 4));
    let mut random = Random::new(seed);
    let mut drawn = |mut list: Vec<u32>, count: usize| {
        let count = count.min(list.len());
        random.draw(&mut list, count);
        list.truncate(count);
        list.sort_unstable();
        list
    };
    let states = drawn(all.clone(), size.saturating_mul(STATES_PER_CELL));
    let runs = [all.len(), rare[0].len(), rare[1].len()];
    let counts = [size.saturating_sub(shares[0] + shares[1]), shares[0], shares[1]];
    let lists = std::iter::once(all).chain(rare);
    let draws = Stratum::ALL.into_iter().zip(lists).zip(runs.into_iter().zip(counts));
    let draws = draws.map(|((stratum, list), (runs, count))| Draw { stratum, runs, ids: drawn(list, count) });
    Sample { seed, draws: draws.collect(), states }
}

/// Runs with a neighbour to the side, above or below of another class or period; in a list there are no neighbours.
fn border(plan: &Plan, records: &[Record]) -> Vec<u32> {
    if plan.is_list() {
        return Vec::new();
    }
    let classes: Vec<Class> = records.iter().map(classify).collect();
    let [columns, rows] = plan.counts();
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
