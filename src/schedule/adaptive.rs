//! Refinement: coarse blocks first, then only those that a border crosses, down to single cells;
//! then an audit of what was not integrated.

use std::cell::LazyCell;
use std::collections::{BTreeMap, HashSet};

use super::audit::{Audit, sample};
use super::blocks::{Block, coarse};
use super::fill::Filling;
use super::label::{Label, word_of};
use crate::plan::{Needs, Plan};
use crate::record::{Record, valid};
use crate::scene::Refine;

/// Blocks narrower than this are not halved for touching one that a border crosses: the cells on
/// their common edge show whether it goes on here.
const NARROW: usize = 4;

/// Most rounds in which nothing is done but to follow borders: those that need more are few, and a round
/// takes as long as its slowest cell.
const FOLLOWED: u32 = 16;

/// The state of an adaptive map between rounds.
pub(super) struct Adaptive {
    counts: [usize; 2],
    refine: Refine,
    /// What makes borders: what the scene asks for, words only where they are to.
    needs: Needs,
    /// By cell id; unknown where nothing was integrated.
    labels: Vec<Label>,
    /// Blocks whose corners are known or are being integrated, still to be judged.
    open: Vec<Block>,
    /// Blocks that are filled.
    closed: Vec<Block>,
    /// How often blocks have been halved since the coarse grid.
    halvings: u32,
    /// Halvings that take a coarse block down to single cells.
    levels: u32,
    /// Rounds since the last audit in which nothing was done but to follow borders.
    followed: u32,
    /// Cells of the audit under way.
    audited: Vec<u32>,
    /// Samples drawn so far, each by a seed of its own.
    samples: u64,
    audits: Vec<Audit>,
    stage: Stage,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The coarse grid, then halving blocks.
    Halving,
    /// The sample is being integrated.
    Auditing,
    /// The audit is passed; blocks around wrong cells are cut down.
    Mending,
    Done,
}

/// What an audit showed.
struct Verdict {
    /// Whether a cell was filled wrongly, by id.
    wrong: Vec<bool>,
    /// Kinds that are wrong most often; none if the audit is passed.
    bad: HashSet<u32>,
}

impl Adaptive {
    pub(super) fn new(plan: &Plan, refine: Refine) -> Adaptive {
        let counts = plan.axes().each_ref().map(|axis| axis.count());
        Adaptive {
            counts,
            refine,
            needs: Needs { word: plan.needs().word && refine.word, ..*plan.needs() },
            labels: vec![Label::default(); plan.cell_count()],
            open: coarse(counts, refine.minimum_grid as usize),
            closed: Vec::new(),
            halvings: 0,
            followed: 0,
            levels: refine.minimum_grid.next_power_of_two().ilog2(),
            audited: Vec::new(),
            samples: 0,
            audits: Vec::new(),
            stage: Stage::Halving,
        }
    }

    pub(super) fn audits(&self) -> &[Audit] {
        &self.audits
    }

    /// The cells of the coarse grid.
    pub(super) fn first(&self) -> Vec<u32> {
        self.unknown_corners()
    }

    /// The next cells to integrate, now that those of the last call have their records; none
    /// if the map is finished.
    pub(super) fn next(&mut self, last: &[u32], records: &[Record]) -> Vec<u32> {
        for &id in last {
            self.labels[id as usize] = Label::of(&records[id as usize], &self.needs);
        }
        while self.stage != Stage::Done {
            let cells = match self.stage {
                Stage::Auditing => self.judge_audit(records),
                _ => {
                    self.reopen();
                    if self.open.is_empty() {
                        self.leave_stage()
                    } else {
                        self.halve();
                        self.unknown_corners()
                    }
                }
            };
            if !cells.is_empty() {
                return cells;
            }
        }
        Vec::new()
    }

    /// No block is open any more: audits once, and again after every audit that is failed.
    fn leave_stage(&mut self) -> Vec<u32> {
        if self.stage == Stage::Mending {
            self.stage = Stage::Done;
            return Vec::new();
        }
        let filled = self.labels.iter().filter(|label| !label.is_known()).count();
        self.audited = self.sample(self.refine.audited(filled));
        self.stage = if self.audited.is_empty() { Stage::Done } else { Stage::Auditing };
        if !self.audited.is_empty() {
            self.audits.push(Audit { filled, sampled: self.audited.len(), ..Audit::default() });
        }
        self.audited.clone()
    }

    /// Some of the cells that nothing is known of, at random.
    fn sample(&mut self, count: usize) -> Vec<u32> {
        let unknown = (0..).zip(&self.labels).filter(|(_, label)| !label.is_known());
        self.samples += 1;
        sample(unknown.map(|(id, _)| id).collect(), count, self.samples)
    }

    /// Whether blocks have been halved as often as the scene allows.
    fn is_spent(&self) -> bool {
        self.refine.rounds.is_some_and(|most| self.halvings >= most)
    }

    /// Opens closed blocks again in which a neighbour's halving has found a border.
    fn reopen(&mut self) {
        self.followed += u32::from(!self.open.iter().any(Block::has_inside));
        if !self.is_spent() && self.followed <= FOLLOWED {
            let closed = std::mem::take(&mut self.closed);
            let (crossed, closed) = closed.into_iter().partition(|block| self.is_crossed(block));
            self.closed = closed;
            self.open.extend::<Vec<_>>(crossed);
        }
    }

    /// Blocks that a border crosses, or that touch one, are halved; others are closed.
    fn halve(&mut self) {
        let open = std::mem::take(&mut self.open);
        let is_spent = self.stage == Stage::Halving && self.is_spent();
        self.halvings += 1;
        let mut touched = vec![false; if is_spent { 0 } else { self.labels.len() }];
        if !is_spent {
            for block in open.iter().filter(|block| self.has_border(block)) {
                block.cells().for_each(|at| touched[self.id(at)] = true);
            }
        }
        // Every block has become cells by now, but for those along a border that is followed: it
        // would take one round for each.
        let follows = self.halvings > self.levels;
        for block in open.into_iter().filter(Block::has_inside) {
            let is_touched = || block.corners().iter().any(|&at| touched[self.id(at)]);
            if is_spent || !(self.is_crossed(&block) || (block.width() >= NARROW && is_touched())) {
                self.closed.push(block);
            } else if follows {
                self.open.extend(block.single_cells());
            } else {
                self.open.extend(block.halves());
            }
        }
    }

    /// After an audit blocks with wrong cells are cut right there. If there are too many of them,
    /// all blocks are halved that are filled with what is wrong most often: mostly chaos with its
    /// windows, which the plain regions around need not pay for. If that may be chance, more cells are
    /// audited first. Returns the cells to integrate next.
    fn judge_audit(&mut self, records: &[Record]) -> Vec<u32> {
        let Verdict { wrong, bad } = self.count_wrong(records);
        let asks = |audit: &Audit| audit.more(self.refine.audited(audit.filled), self.refine.max_error);
        let more = self.audits.last().map_or(0, asks);
        if more > 0 && !self.is_spent() {
            let cells = self.sample(more);
            self.audited.extend(&cells);
            return cells;
        }
        self.followed = 0;
        self.audited.clear();
        let closed = std::mem::take(&mut self.closed);
        for block in closed {
            let first_wrong = block.cells().find(|&at| wrong[self.id(at)]);
            let is_bad =
                !self.is_spent() && block.has_inside() && bad.contains(&self.corner_labels(&block)[0].kind);
            match first_wrong {
                Some(at) => self.open.extend(block.cut(at)),
                None if is_bad => self.open.extend(block.halves()),
                None => self.closed.push(block),
            }
        }
        self.stage = if bad.is_empty() || self.is_spent() { Stage::Mending } else { Stage::Halving };
        self.unknown_corners()
    }

    /// Compares what was filled into the audited cells with their records.
    fn count_wrong(&mut self, records: &[Record]) -> Verdict {
        let mut wrong = vec![false; self.labels.len()];
        let mut is_audited = vec![false; self.labels.len()];
        self.audited.iter().for_each(|&id| is_audited[id as usize] = true);
        let filled = self.audits.pop().map_or(0, |audit| audit.filled);
        let mut audit = Audit { filled, sampled: self.audited.len(), ..Audit::default() };
        let mut by_kind: BTreeMap<u32, [usize; 2]> = BTreeMap::new();
        for block in &self.closed {
            let filling =
                LazyCell::new(|| Filling::new(block, block.corners().map(|at| &records[self.id(at)])));
            for at in block.cells() {
                let id = self.id(at);
                // A cell on a common border is judged once.
                if !std::mem::take(&mut is_audited[id]) {
                    continue;
                }
                let fill = filling.record(at);
                let label = Label::of(&fill, &self.needs);
                wrong[id] = label != self.labels[id];
                audit.wrong += usize::from(wrong[id]);
                let [sampled, amiss] = by_kind.entry(label.kind).or_default();
                *sampled += 1;
                *amiss += usize::from(wrong[id]);
                if fill.valid & valid::WORD != 0 {
                    audit.words += 1;
                    audit.wrong_words += usize::from(word_of(&fill) != word_of(&records[id]));
                }
            }
        }
        self.audits.push(audit);
        Verdict { wrong, bad: worst(&by_kind, (self.refine.max_error * audit.sampled as f64) as usize) }
    }

    fn id(&self, [i, j]: [usize; 2]) -> usize {
        j * self.counts[0] + i
    }

    fn label(&self, at: [usize; 2]) -> Label {
        self.labels[self.id(at)]
    }

    fn corner_labels(&self, block: &Block) -> [Label; 4] {
        block.corners().map(|at| self.label(at))
    }

    /// Whether any two cells of a block are known to differ.
    fn is_crossed(&self, block: &Block) -> bool {
        let first = self.label(block.corners()[0]);
        block.cells().map(|at| self.label(at)).any(|label| label.is_known() && label != first)
    }

    /// Whether the corners of a block differ in more than the word.
    fn has_border(&self, block: &Block) -> bool {
        let labels = self.corner_labels(block);
        labels.iter().any(|label| label.kind != labels[0].kind)
    }

    /// Corners of open blocks that nothing is known of, neighbours one after the other.
    fn unknown_corners(&self) -> Vec<u32> {
        let corners =
            self.open.iter().flat_map(|block| block.corners()).filter(|&at| !self.label(at).is_known());
        let mut cells: Vec<[usize; 2]> = corners.collect();
        cells.sort_by_cached_key(|&at| crate::plan::morton_key(at));
        cells.dedup();
        cells.into_iter().map(|at| self.id(at) as u32).collect()
    }

    /// Fills every cell that was not integrated; returns how many.
    pub(super) fn fill(&self, records: &mut [Record]) -> usize {
        let mut count = 0;
        for block in &self.closed {
            let corners = block.corners().map(|at| records[self.id(at)]);
            let filling = Filling::new(block, corners.each_ref());
            for at in block.cells() {
                let id = self.id(at);
                // A cell on a common border is filled by the first of its blocks.
                if !self.labels[id].is_known() && records[id] == Record::default() {
                    records[id] = filling.record(at);
                    count += 1;
                }
            }
        }
        count
    }
}

/// The kinds of which the largest part is wrong, as many as it takes until no more than `allowed` wrong
/// cells are of other kinds. Of every kind it is known how many cells were sampled and were wrong.
fn worst(by_kind: &BTreeMap<u32, [usize; 2]>, allowed: usize) -> HashSet<u32> {
    let mut kinds: Vec<_> = by_kind.iter().collect();
    // Compares amiss / sampled, without a division.
    kinds.sort_by(|(_, [n, a]), (_, [m, b])| (b * n).cmp(&(a * m)));
    let mut left: usize = kinds.iter().map(|(_, [_, amiss])| amiss).sum();
    let is_needed = |(_, [_, amiss]): &(&u32, &[usize; 2])| {
        let is_needed = left > allowed;
        left -= amiss;
        is_needed
    };
    kinds.into_iter().take_while(is_needed).map(|(kind, _)| *kind).collect()
}
