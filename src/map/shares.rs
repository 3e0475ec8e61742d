//! Shares of attractors: in each cell, the part of random starts that leads to each attractor (basin stability, Menck et al. 2013).
//!
//! All cells have the same starts: eight scrambled Sobol sequences. Each is a replicate of its own, so the spread of the eight shares gives
//! the interval of their mean. Cells run blocks of starts until all are done, or all intervals are narrow enough. What a cell shows depends on
//! the cell alone. Of each start only its attractor is kept.
//!
//! Two starts have the same attractor if they reach the same cycle, which Newton's method finds. All chaos of a cell is one attractor, and so is all
//! quasi-periodic motion, because records do not distinguish them.

mod names;
mod starts;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use names::{Name, Names};

use crate::map::catalogue::{Catalogue, Outcome};
use crate::map::engine::{Engine, EngineError, Flows};
use crate::map::plan::{Cell, Plan};
use crate::map::scene::{REPLICATES, Sample, Scene};
use crate::model_file::subjects;
use crate::record::Record;
use crate::record::measures::{self, Measure};
use rattlemap_dynamics::model::State;
use starts::start;

/// Number of replicates.
const PARTS: usize = REPLICATES as usize;

/// Number of starts of a cell that run at once: eight of each replicate.
const BLOCK: u32 = 64;

/// Number of cells that run at once.
const WINDOW: usize = 64;

/// Quantile of Student's distribution for an interval of 95 % from eight replicates.
const STUDENT: f64 = 2.365;

/// Number of starts within which an attractor that none of them reached may hide, at 95 %: its share is below `3 / n` (rule of three).
const HIDDEN: f64 = 3.0;

/// Kind of an attractor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Kind {
    /// A cycle without contact.
    Free,
    /// Another cycle.
    Cycle,
    /// Chaos; all of it in a cell.
    Chaos,
    /// Quasi-periodic motion; all of it in a cell.
    Torus,
}

/// An attractor of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attractor {
    /// Its kind.
    pub kind: Kind,
    /// Period of a cycle, in forcing periods; else 0.
    pub period: u32,
    /// Word of a cycle, as in tables; empty if it is not known.
    pub word: String,
    /// Lexicographically smallest state of a cycle at phase 0; else empty.
    pub strobe: Vec<f64>,
    /// Number of starts of each replicate that lead to it.
    pub starts: [u32; PARTS],
    /// Forcing periods that all its runs took together.
    pub periods: u64,
    /// Measured quantities, as [`requested`]: of a cycle those of its first run, else means over all runs.
    pub numbers: Vec<Option<f64>>,
}

/// The attractors of a cell, the one with the largest share first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellShares {
    /// Number of the cell.
    pub cell: u32,
    /// Number of starts.
    pub count: u32,
    /// Its attractors.
    pub attractors: Vec<Attractor>,
    /// Number of starts of each replicate whose motion is undecided or failed.
    pub undecided: [u32; PARTS],
}

/// A share with its interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Mean of the replicates.
    pub mean: f64,
    /// Ends of the interval.
    pub interval: [f64; 2],
}

impl CellShares {
    /// Returns the share of starts from their numbers in each replicate.
    pub fn share(&self, starts: &[u32; PARTS]) -> Share {
        let each = f64::from(self.count) / PARTS as f64;
        let shares = starts.map(|number| f64::from(number) / each);
        let mean = shares.iter().sum::<f64>() / PARTS as f64;
        let variance = shares.iter().map(|share| (share - mean).powi(2)).sum::<f64>() / (PARTS - 1) as f64;
        let half = (STUDENT * (variance / PARTS as f64).sqrt()).max(HIDDEN / f64::from(self.count));
        Share { mean, interval: [(mean - half).max(0.0), (mean + half).min(1.0)] }
    }

    /// Returns the share of undecided and failed starts.
    pub fn undecided(&self) -> Share {
        self.share(&self.undecided)
    }

    /// Returns the mean of a number over all starts whose attractor has it, by its place among the [`requested`]; none without one.
    pub fn expected(&self, place: usize) -> Option<f64> {
        let of = |attractor: &Attractor| {
            let starts = f64::from(attractor.starts.iter().sum::<u32>());
            Some((starts * attractor.numbers[place]?, starts))
        };
        let (sum, starts) =
            self.attractors.iter().filter_map(of).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        (starts > 0.0).then(|| sum / starts)
    }

    /// Whether the intervals of all shares are at most this wide.
    fn is_known(&self, width: f64) -> bool {
        let all = self.attractors.iter().map(|attractor| &attractor.starts).chain([&self.undecided]);
        all.into_iter().all(|starts| {
            let [low, high] = self.share(starts).interval;
            high - low <= width
        })
    }
}

/// Returns the measured quantities that a scene requests, in the order of their columns.
pub fn requested(scene: &Scene) -> Vec<Measure> {
    let (names, quantities) = (subjects(scene.base()), &scene.outputs().quantities);
    let all = measures::all().chain(measures::of_gaps()).filter(|measure| measure.is_of(&names));
    all.filter(|measure| quantities.iter().any(|quantity| quantity.name() == measure.group.name)).collect()
}

/// What watches a run.
pub struct Watch<'a> {
    /// Gets cells that are done. An error ends the run.
    #[expect(clippy::type_complexity, reason = "one use")]
    pub done: &'a mut dyn FnMut(&[CellShares]) -> Result<(), Box<dyn std::error::Error + Send + Sync>>,
    /// Ends the run.
    pub halt: &'a Arc<AtomicBool>,
}

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum SharesError {
    /// The engine failed. Cells that were done remain valid.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// Cells could not be stored.
    #[error(transparent)]
    Store(Box<dyn std::error::Error + Send + Sync>),
}

/// Runs the cells of a scene with a sample, apart from those for which `is_done`. Returns whether all are done.
///
/// # Errors
/// [`SharesError`]. Cells that were given to the watch before remain valid.
///
/// # Panics
/// If the scene has no sample.
pub fn run(
    scene: &Scene,
    plan: &Plan,
    engine: &mut Engine<'_>,
    is_done: impl Fn(u32) -> bool,
    watch: Watch<'_>,
) -> Result<bool, SharesError> {
    let sample = scene.sample().expect("a scene of shares");
    engine.stop_on(watch.halt);
    let (mut flows, requested) = (Flows::new(plan), requested(scene));
    let components = scene.base().state_names().len();
    let mut waiting = plan.order().into_iter().filter(|id| !is_done(*id));
    let mut open: Vec<Running> = Vec::new();
    loop {
        open.extend(waiting.by_ref().take(WINDOW - open.len()).map(|id| {
            let cell = plan.cell(id);
            let catalogue = flows.with(cell.flow, Catalogue::of);
            let shares = CellShares { cell: id, count: 0, attractors: Vec::new(), undecided: [0; PARTS] };
            Running { cell, catalogue, of_cycle: Vec::new(), shares }
        }));
        if open.is_empty() {
            return Ok(true);
        }
        let mut runs = Vec::new();
        for running in &open {
            let first = running.shares.count;
            for nth in first..(first + BLOCK).min(sample.count) {
                // Engines find flow and law of a run by its number.
                let id = (nth - first) * plan.cell_count() as u32 + running.cell.id;
                runs.push(Cell { id, start: start(sample, components, nth), ..running.cell });
            }
        }
        let records = pollster::block_on(engine.run(&runs))?;
        flows.keep(&runs);
        if watch.halt.load(Ordering::Relaxed) {
            return Ok(false);
        }
        let mut left = &records[..];
        let blocks: Vec<&[Record]> = open
            .iter()
            .map(|running| {
                let size = BLOCK.min(sample.count - running.shares.count) as usize;
                let (block, rest) = left.split_at(size);
                left = rest;
                block
            })
            .collect();
        open.par_iter_mut().zip(blocks).for_each(|(running, block)| {
            flows.with(running.cell.flow, |flow| {
                let law = plan.law(running.cell.law);
                let found = running.catalogue.learn_all(flow, law, block.len(), |nth| block[nth].clone());
                running.take(&found, block, &requested, components);
            });
        });
        let ended: Vec<CellShares> =
            open.extract_if(.., |running| running.is_over(sample)).map(Running::finish).collect();
        (watch.done)(&ended).map_err(SharesError::Store)?;
    }
}

/// A cell under way.
struct Running {
    cell: Cell,
    catalogue: Catalogue,
    /// Place among the attractors of each cycle of the catalogue.
    of_cycle: Vec<Option<usize>>,
    shares: CellShares,
}

impl Running {
    /// Adds the motions of a block of starts.
    fn take(&mut self, found: &[Outcome], block: &[Record], requested: &[Measure], components: usize) {
        for (found, record) in found.iter().zip(block) {
            let replicate = self.shares.count as usize % PARTS;
            self.shares.count += 1;
            let kind = match found {
                Outcome::Cycle(_) => Kind::Cycle,
                Outcome::Chaos => Kind::Chaos,
                Outcome::Torus => Kind::Torus,
                Outcome::Unresolved(_) | Outcome::Undecided | Outcome::Failed => {
                    self.shares.undecided[replicate] += 1;
                    continue;
                }
            };
            let known = match found {
                Outcome::Cycle(nth) => {
                    self.of_cycle.resize(self.of_cycle.len().max(*nth as usize + 1), None);
                    self.of_cycle[*nth as usize]
                }
                _ => self.shares.attractors.iter().position(|attractor| attractor.kind == kind),
            };
            let place = known.unwrap_or_else(|| {
                self.shares.attractors.push(match found {
                    Outcome::Cycle(nth) => {
                        let place = self.shares.attractors.len();
                        self.of_cycle[*nth as usize] = Some(place);
                        self.cycle(*nth, record, components)
                    }
                    _ => Attractor {
                        kind,
                        period: 0,
                        word: String::new(),
                        strobe: Vec::new(),
                        starts: [0; PARTS],
                        periods: 0,
                        numbers: Vec::new(),
                    },
                });
                self.shares.attractors.len() - 1
            });
            let attractor = &mut self.shares.attractors[place];
            let before = f64::from(attractor.starts.iter().sum::<u32>());
            attractor.starts[replicate] += 1;
            attractor.periods += u64::from(record.periods_run);
            let numbers = requested.iter().map(|measure| measure.of(record));
            if attractor.numbers.is_empty() {
                attractor.numbers = numbers.collect();
            } else if kind != Kind::Cycle {
                // Chaos has means over all its runs.
                for (mean, number) in attractor.numbers.iter_mut().zip(numbers) {
                    *mean = mean.zip(number).map(|(mean, number)| mean + (number - mean) / (before + 1.0));
                }
            }
        }
    }

    fn cycle(&self, nth: u32, record: &Record, components: usize) -> Attractor {
        let cycle = &self.catalogue.cycles()[nth as usize].cycle;
        let points = cycle.points.iter().take(cycle.period as usize);
        let least: &State = points.min_by(|a, b| lexicographic(&a[..], &b[..])).unwrap_or(&cycle.last);
        Attractor {
            kind: if cycle.is_non_impacting { Kind::Free } else { Kind::Cycle },
            period: cycle.period,
            word: record.spelling().map(|word| word.in_table()).unwrap_or_default(),
            strobe: least[..components].to_vec(),
            starts: [0; PARTS],
            periods: 0,
            numbers: Vec::new(),
        }
    }

    fn is_over(&self, sample: &Sample) -> bool {
        self.shares.count >= sample.count || sample.width.is_some_and(|width| self.shares.is_known(width))
    }

    /// Returns the attractors in their order.
    fn finish(self) -> CellShares {
        let mut shares = self.shares;
        let number = |attractor: &Attractor| attractor.starts.iter().sum::<u32>();
        shares.attractors.sort_by(|a, b| {
            let by_kind = || (a.kind, a.period).cmp(&(b.kind, b.period));
            number(b).cmp(&number(a)).then_with(by_kind).then_with(|| lexicographic(&a.strobe, &b.strobe))
        });
        shares
    }
}

fn lexicographic(a: &[f64], b: &[f64]) -> std::cmp::Ordering {
    a.iter()
        .zip(b)
        .map(|(a, b)| a.total_cmp(b))
        .find(|order| order.is_ne())
        .unwrap_or(std::cmp::Ordering::Equal)
}
