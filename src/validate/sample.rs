//! The sample of cells to validate: uniform cells, and two strata of rare cells that are counted separately.

use crate::map::plan::Plan;
use crate::map::random::Random;
use crate::record::classify::{classify, status};
use crate::record::{Records, valid};
use rattlemap_dynamics::named;
use rattlemap_dynamics::orbit::{Class, Status};

/// Number of lanes whose states are compared, per cell of the sample. Each lane takes only a few periods.
const STATES_PER_CELL: usize = 10;

named! {
    /// The set from which a cell was drawn.
    pub enum Stratum {
        /// All integrated runs. Only this stratum gives rates of the map.
        Uniform = "uniform",
        /// Runs with a neighbour of another class or period.
        Border = "border",
        /// Runs whose status is not `ok`.
        Status = "status",
    }
}

impl Stratum {
    /// Describes the cells of the stratum. `counted` is the noun for the counted objects.
    pub fn describe(self, counted: &str) -> String {
        match self {
            Stratum::Uniform => format!("random {counted}"),
            Stratum::Border => format!("{counted} next to another class or period"),
            Stratum::Status => format!("{counted} with a status other than ok"),
        }
    }
}

/// Cells of one stratum, drawn independently of the other strata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draw {
    /// The stratum.
    pub stratum: Stratum,
    /// Number of integrated runs of the map in the stratum.
    pub runs: usize,
    /// Ids of the drawn runs, ascending.
    pub ids: Vec<u32>,
}

/// Cells to validate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of requested cells.
    pub requested: usize,
    /// Cells by stratum. A cell may be in several.
    pub draws: Vec<Draw>,
    /// Runs whose states are compared after a few periods, drawn from all integrated runs.
    pub states: Vec<u32>,
}

impl Sample {
    /// Returns the ids of all cells without repetition, ascending.
    pub fn ids(&self) -> Vec<u32> {
        let mut ids: Vec<u32> = self.draws.iter().flat_map(|draw| &draw.ids).copied().collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

/// Draws `size` runs: half from all integrated runs, a quarter at borders of classes, and a quarter with a status other than `ok`. If a
/// stratum has too few runs, the missing ones are drawn from all integrated runs. A map with no more than `size` runs is validated
/// completely. Equal maps, sizes and seeds give equal samples.
pub fn sample(plan: &Plan, records: &dyn Records, size: usize, seed: u64) -> Sample {
    // Filled cells are not sampled, because the audit of an adaptive map checks them.
    let is_own = |id: &u32| records.record(*id as usize).valid & valid::FILLED == 0;
    let all: Vec<u32> = (0..records.count() as u32).filter(is_own).collect();
    let rare: [Vec<u32>; 2] = if size >= all.len() {
        [Vec::new(), Vec::new()]
    } else {
        let remarked = |id: &u32| status(&records.record(*id as usize)) != Status::Ok;
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
    Sample { seed, requested: size, draws: draws.collect(), states }
}

/// Lists runs with a neighbour of another class or period, left, right, above or below. A list of cells has no neighbours.
fn border(plan: &Plan, records: &dyn Records) -> Vec<u32> {
    if plan.is_list() {
        return Vec::new();
    }
    let classes: Vec<Class> = records.iter().map(|record| classify(&record)).collect();
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
    (0..records.count()).filter(|&id| differs(id)).map(|id| id as u32).collect()
}
