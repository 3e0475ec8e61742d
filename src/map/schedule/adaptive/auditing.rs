//! The audit of filled cells, and the blocks that are halved after it.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::super::audit::Audit;
use super::super::errors::Errors;
use super::super::fill::Filling;
use super::super::label::{Label, pattern_of, word_of};
use super::super::tiling::Tile;
use super::{Adaptive, Stage};
use crate::map::scene::Continuous;
use crate::record::{Records, valid};

/// Result of an audit.
struct Verdict {
    /// Cells with wrong filled values.
    wrong: Vec<u32>,
    /// Kinds with the largest fraction of wrong cells in blocks that may be halved; empty if the audit is passed.
    bad: HashSet<u32>,
}

impl Adaptive {
    pub(super) fn begin_audit(&mut self, requests: &mut Vec<u32>) {
        let filled = self.unrequested;
        let sampled = self.sample(self.refine.audited(filled), requests);
        self.stage = if sampled == 0 { Stage::Done } else { Stage::Auditing };
        if sampled > 0 {
            self.audits.push(Audit { filled, sampled, ..Audit::default() });
        }
    }

    /// Requests `count` random cells that were not requested before.
    fn sample(&mut self, count: usize, requests: &mut Vec<u32>) -> usize {
        let count = count.min(self.unrequested);
        let from = requests.len();
        while requests.len() < from + count {
            let id = self.random.below(self.labels.len());
            self.request(id, requests);
        }
        self.audited.extend(&requests[from..]);
        self.samples += usize::from(count > 0);
        count
    }

    /// Evaluates an audit. Blocks with wrong cells are halved down to them. If there are too many wrong cells, borders
    /// are first followed in narrower blocks. If that was done before, all blocks are halved that are filled with the
    /// kinds that are wrong most often, usually chaos with its windows; blocks of other kinds stay. If the number of
    /// wrong cells may be due to chance, more cells are audited first. Blocks that may not be halved further remain as
    /// they are.
    pub(super) fn judge_audit(&mut self, records: &(impl Records + ?Sized), requests: &mut Vec<u32>) {
        let Verdict { wrong, bad } = self.count_wrong(records);
        let audit = *self.audits.last().unwrap_or(&Audit::default());
        let is_over = audit.rate() > self.refine.max_error;
        let closer = if is_over { self.follow_closely() } else { Vec::new() };
        let is_bad = |tile: Tile| bad.contains(&self.blocks[tile].kind);
        let worst: Vec<Tile> = self.tiles_to_halve(is_bad).collect();
        if is_over && closer.is_empty() && !worst.is_empty() {
            let more = audit.more(self.refine.audited(audit.filled), self.refine.max_error);
            if more > 0 {
                self.sample(more, requests);
                return;
            }
        }
        self.pending = if closer.is_empty() { worst } else { closer };
        self.stage = if self.pending.is_empty() { Stage::Mending } else { Stage::Halving };
        for id in wrong {
            let tile = self.tiling.owner(self.at(id));
            self.blocks[tile].is_free = true;
            self.pending.push(tile);
        }
        for id in std::mem::take(&mut self.audited) {
            self.update(self.at(id), self.labels[id as usize]);
        }
        self.halve(requests);
    }

    /// Compares the filled values of the audited cells with their records.
    fn count_wrong(&mut self, records: &(impl Records + ?Sized)) -> Verdict {
        let mut wrong = Vec::new();
        let filled = self.audits.pop().map_or(0, |audit| audit.filled);
        let mut audit = Audit { filled, sampled: self.audited.len(), ..Audit::default() };
        let mut by_kind: BTreeMap<(usize, u32), [usize; 2]> = BTreeMap::new();
        // Numbers of attractors depend on the order of the records, but their order in the sample does not.
        let mut sampled_kinds: Vec<u32> = Vec::new();
        let mut pairs = Vec::with_capacity(self.audited.len());
        let mut fillings: HashMap<Tile, Filling> = HashMap::new();
        for &id in &self.audited {
            let at = self.at(id);
            let tile = self.tiling.owner(at);
            let fill = fillings.entry(tile).or_insert_with(|| self.filling(tile, records)).record(at);
            let label = match self.basins {
                Some(_) => self.label(self.corner(tile, at)),
                None => Label::of(&fill, &self.needs),
            };
            let (own, is_wrong) = (records.record(id as usize), label != self.labels[id as usize]);
            if is_wrong {
                wrong.push(id);
            }
            let rank = match (&self.basins, sampled_kinds.iter().position(|&kind| kind == label.kind)) {
                (None, _) => 0,
                (Some(_), Some(rank)) => rank,
                (Some(_), None) => {
                    sampled_kinds.push(label.kind);
                    sampled_kinds.len() - 1
                }
            };
            let [sampled, wrong] = by_kind.entry((rank, label.kind)).or_default();
            *sampled += 1;
            *wrong += usize::from(is_wrong && self.may_halve(tile));
            if fill.valid & valid::WORD != 0 {
                audit.words += 1;
                audit.wrong_words += usize::from(word_of(&fill) != word_of(&own));
            }
            if fill.valid & valid::PATTERN != 0 {
                audit.patterns += 1;
                audit.wrong_patterns += usize::from(pattern_of(&fill) != pattern_of(&own));
            }
            pairs.push((fill, own));
        }
        audit.wrong = wrong.len();
        if self.refine.continuous == Continuous::Interpolated {
            audit.errors = Errors::new(&pairs, &self.needs);
        }
        self.audits.push(audit);
        Verdict { wrong, bad: worst(&by_kind, (self.refine.max_error * audit.sampled as f64) as usize) }
    }

    /// Returns the corner from which a cell of a block is filled.
    fn corner(&self, tile: Tile, at: [usize; 2]) -> [usize; 2] {
        let block = self.tiling.block(tile);
        block.corners()[block.nearest(at)]
    }

    pub(super) fn filling(&self, tile: Tile, records: &(impl Records + ?Sized)) -> Filling {
        let block = self.tiling.block(tile);
        Filling::new(&block, block.corners().map(|at| records.record(self.id(at))))
    }
}

/// Returns the kinds with the largest fractions of wrong cells, so many that at most `allowed` wrong cells are of other
/// kinds. Equal fractions are ordered by the first number of the key. The values are the numbers of sampled and of
/// wrong cells.
fn worst(by_kind: &BTreeMap<(usize, u32), [usize; 2]>, allowed: usize) -> HashSet<u32> {
    let mut kinds: Vec<_> = by_kind.iter().collect();
    // Compares wrong / sampled, without a division.
    kinds.sort_by(|(_, [n, a]), (_, [m, b])| (b * n).cmp(&(a * m)));
    let mut left: usize = kinds.iter().map(|(_, [_, wrong])| wrong).sum();
    let is_needed = |(_, [_, wrong]): &(&(usize, u32), &[usize; 2])| {
        let is_needed = left > allowed;
        left -= wrong;
        is_needed
    };
    kinds.into_iter().take_while(is_needed).map(|((_, kind), _)| *kind).collect()
}
