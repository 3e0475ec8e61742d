//! Which filled cells are audited, and what is halved for what that shows?

use std::collections::{BTreeMap, HashMap, HashSet};

use super::super::audit::Audit;
use super::super::errors::Errors;
use super::super::fill::Filling;
use super::super::label::{Label, pattern_of, word_of};
use super::super::tiling::Tile;
use super::{Adaptive, Stage};
use crate::map::scene::Continuous;
use crate::record::{Record, valid};

/// What an audit showed.
struct Verdict {
    /// Cells that were filled wrongly.
    wrong: Vec<u32>,
    /// Kinds that are wrong most often in blocks that may be halved; none if the audit is passed.
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

    /// Asks for so many of the cells that nothing is known of, at random.
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

    /// After an audit blocks with wrong cells are halved down to them. If there are too many of them,
    /// borders are followed more closely first. If that is done and there still are, all blocks are halved
    /// that are filled with what is wrong most often: mostly chaos with its
    /// windows, which the plain regions around need not pay for. If that may be chance, more cells are
    /// audited before. Where blocks have been halved as often as they may there is nothing left to do.
    pub(super) fn judge_audit(&mut self, records: &[Record], requests: &mut Vec<u32>) {
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
            self.show(self.at(id), self.labels[id as usize]);
        }
        self.halve(requests);
    }

    /// Compares what was filled into the audited cells with their records.
    fn count_wrong(&mut self, records: &[Record]) -> Verdict {
        let mut wrong = Vec::new();
        let filled = self.audits.pop().map_or(0, |audit| audit.filled);
        let mut audit = Audit { filled, sampled: self.audited.len(), ..Audit::default() };
        let mut by_kind: BTreeMap<(usize, u32), [usize; 2]> = BTreeMap::new();
        // Attractors are numbered as their records came; the order in which they are sampled does not depend on that.
        let mut sampled_kinds: Vec<u32> = Vec::new();
        let mut pairs = Vec::with_capacity(self.audited.len());
        let mut fillings: HashMap<Tile, Filling<'_>> = HashMap::new();
        for &id in &self.audited {
            let at = self.at(id);
            let tile = self.tiling.owner(at);
            let fill = fillings.entry(tile).or_insert_with(|| self.filling(tile, records)).record(at);
            let label = match self.basins {
                Some(_) => self.label(self.corner(tile, at)),
                None => Label::of(&fill, &self.needs),
            };
            let is_wrong = label != self.labels[id as usize];
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
            let [sampled, amiss] = by_kind.entry((rank, label.kind)).or_default();
            *sampled += 1;
            *amiss += usize::from(is_wrong && self.may_halve(tile));
            if fill.valid & valid::WORD != 0 {
                audit.words += 1;
                audit.wrong_words += usize::from(word_of(&fill) != word_of(&records[id as usize]));
            }
            if fill.valid & valid::PATTERN != 0 {
                audit.patterns += 1;
                audit.wrong_patterns += usize::from(pattern_of(&fill) != pattern_of(&records[id as usize]));
            }
            pairs.push((fill, &records[id as usize]));
        }
        audit.wrong = wrong.len();
        if self.refine.continuous == Continuous::Interpolated {
            audit.errors = Errors::new(&pairs, &self.needs);
        }
        self.audits.push(audit);
        Verdict { wrong, bad: worst(&by_kind, (self.refine.max_error * audit.sampled as f64) as usize) }
    }

    /// The corner that a cell of a block is filled from.
    fn corner(&self, tile: Tile, at: [usize; 2]) -> [usize; 2] {
        let block = self.tiling.block(tile);
        block.corners()[block.nearest(at)]
    }

    fn filling<'r>(&self, tile: Tile, records: &'r [Record]) -> Filling<'r> {
        let block = self.tiling.block(tile);
        Filling::new(&block, block.corners().map(|at| &records[self.id(at)]))
    }
}

/// The kinds of which the largest part is wrong, as many as it takes until no more than `allowed` wrong
/// cells are of other kinds. Equal parts go by the first number. Of every kind it is known how many cells were sampled and were wrong.
fn worst(by_kind: &BTreeMap<(usize, u32), [usize; 2]>, allowed: usize) -> HashSet<u32> {
    let mut kinds: Vec<_> = by_kind.iter().collect();
    // Compares amiss / sampled, without a division.
    kinds.sort_by(|(_, [n, a]), (_, [m, b])| (b * n).cmp(&(a * m)));
    let mut left: usize = kinds.iter().map(|(_, [_, amiss])| amiss).sum();
    let is_needed = |(_, [_, amiss]): &(&(usize, u32), &[usize; 2])| {
        let is_needed = left > allowed;
        left -= amiss;
        is_needed
    };
    kinds.into_iter().take_while(is_needed).map(|((_, kind), _)| *kind).collect()
}
