//! Refinement: coarse blocks first, then only those that a border crosses, down to single cells;
//! then an audit of what was not integrated ([`auditing`]).
//!
//! Which cells are integrated does not depend on the order in which records come: a block is halved for what is
//! known to differ, and that stays so, whatever else will be known. So no block waits for the others.

mod auditing;

use super::audit::Audit;
use super::basins::BasinLabels;
use super::fill::Filling;
use super::label::Label;
use super::tiling::{Tile, Tiling};
use crate::map::plan::{Needs, Plan};
use crate::map::random::Random;
use crate::map::scene::Refine;
use crate::record::Record;

/// Blocks narrower than this are not halved for touching one that a border crosses: the cells on
/// their common edge show whether it goes on here. On the main plane 0.24 % of what is filled is wrong then, with
/// classes alone. Symmetries add 0.1 %, thin bands that none of these rules finds, and leave no room for that.
const NARROW: usize = 8;

/// The same with symmetries, and where an audit has shown too many wrong cells.
const NARROWEST: usize = 4;

/// Levels that are told apart where blocks touch.
const LEVELS: u32 = u16::BITS;

/// The state of an adaptive map.
pub(super) struct Adaptive {
    counts: [usize; 2],
    refine: Refine,
    /// What makes borders: what the scene requests for, words only where they are to.
    needs: Needs,
    /// What makes borders in a map of basins.
    basins: Option<BasinLabels>,
    /// By cell id; unknown where nothing was integrated.
    labels: Vec<Label>,
    /// By cell id.
    is_requested: Vec<bool>,
    /// Cells that were not asked for.
    unrequested: usize,
    tiling: Tiling,
    /// What is known of each block.
    blocks: Vec<BlockState>,
    /// Levels of blocks with differing corners that a cell belongs to, a bit for each.
    touched: Vec<u16>,
    /// Blocks that are to be halved.
    pending: Vec<Tile>,
    /// The most that a coarse block has been halved.
    deepest: u32,
    /// Blocks narrower than this are not halved for touching others.
    narrow: usize,
    /// Cells of the audit under way.
    audited: Vec<u32>,
    /// Where samples are drawn from, and how many have been.
    random: Random,
    samples: usize,
    audits: Vec<Audit>,
    stage: Stage,
}

/// What is known of a block.
#[derive(Clone, Copy, Default)]
struct BlockState {
    /// Of the first cell that was known.
    label: Label,
    /// Of the first corner that was known.
    kind: u32,
    /// Whether corners are known to differ in more than the word.
    has_border: bool,
    /// Whether it is halved however often its coarse block has been.
    is_free: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The coarse grid, then halving blocks.
    Halving,
    /// The sample is being integrated.
    Auditing,
    /// The audit is passed; blocks around wrong cells are halved.
    Mending,
    Done,
}

impl Adaptive {
    /// Nothing is known; `requests` gets the cells of the coarse grid, neighbours one after the other.
    pub(super) fn new(plan: &Plan, refine: Refine, requests: &mut Vec<u32>) -> Adaptive {
        let counts = plan.counts();
        let tiling = Tiling::new(counts, refine.minimum_grid as usize);
        let cells = plan.cell_count();
        // Borders of words and none of patterns would be those of bounces before meshing.
        let (word, pattern) = (plan.needs().word, plan.needs().pattern);
        let needs =
            Needs { word: refine.word && word && !pattern, pattern: refine.word && pattern, ..*plan.needs() };
        let mut adaptive = Adaptive {
            counts,
            refine,
            narrow: if needs.symmetric { NARROWEST } else { NARROW },
            needs,
            basins: BasinLabels::of(plan),
            labels: vec![Label::default(); cells],
            is_requested: vec![false; cells],
            unrequested: cells,
            blocks: vec![BlockState::default(); tiling.tiles().len()],
            tiling,
            touched: vec![0; cells],
            pending: Vec::new(),
            deepest: 0,
            audited: Vec::new(),
            random: Random::new(1),
            samples: 0,
            audits: Vec::new(),
            stage: Stage::Halving,
        };
        for tile in adaptive.tiling.tiles() {
            adaptive.request_corners(tile, requests);
        }
        requests.sort_by_cached_key(|&id| crate::map::plan::morton_key(adaptive.at(id)));
        adaptive
    }

    pub(super) fn audits(&self) -> &[Audit] {
        &self.audits
    }

    pub(super) fn max_error(&self) -> f64 {
        self.refine.max_error
    }

    /// Steps that had to follow each other: the coarse grid, halvings, samples.
    pub(super) fn rounds(&self) -> usize {
        1 + self.deepest as usize + self.samples
    }

    /// Looks at records that are taken up next.
    pub(super) fn prepare(&mut self, records: &[(u32, Record)]) {
        if let Some(basins) = &mut self.basins {
            basins.prepare(records);
        }
    }

    /// Takes up the record of a cell that was asked for; `requests` gets the cells that are needed for that.
    pub(super) fn take(&mut self, id: u32, record: &Record, requests: &mut Vec<u32>) {
        let label = match &mut self.basins {
            Some(basins) => basins.label(id, record),
            None => Label::of(record, &self.needs),
        };
        self.labels[id as usize] = label;
        if self.stage != Stage::Auditing {
            self.show(self.at(id), label);
            self.halve(requests);
        }
    }

    /// Goes on once every cell that was asked for has been taken up: audits once, and again after every audit
    /// that is failed. `requests` gets the next cells, none if the map is finished.
    pub(super) fn settle(&mut self, records: &[Record], requests: &mut Vec<u32>) {
        let before = requests.len();
        while requests.len() == before && self.stage != Stage::Done {
            match self.stage {
                Stage::Halving => self.begin_audit(requests),
                Stage::Auditing => self.judge_audit(records, requests),
                Stage::Mending | Stage::Done => self.stage = Stage::Done,
            }
        }
    }

    /// Tells all blocks that a cell belongs to what it is.
    fn show(&mut self, at: [usize; 2], label: Label) {
        for tile in self.tiling.covering(at) {
            self.show_to(tile, label);
            // A block may have been halved before all of its corners were known.
            let with_corner = |&tile: &Tile| self.tiling.block(tile).has_corner(at);
            let corner_of: Vec<Tile> = self.tiling.lineage(tile).take_while(with_corner).collect();
            corner_of.into_iter().for_each(|tile| self.show_corner(tile, label));
        }
    }

    fn show_to(&mut self, tile: Tile, label: Label) {
        let sight = &mut self.blocks[tile];
        if !sight.label.is_known() {
            sight.label = label;
        } else if sight.label != label {
            self.pending.push(tile);
        }
    }

    fn show_corner(&mut self, tile: Tile, label: Label) {
        let sight = &mut self.blocks[tile];
        if sight.kind == 0 {
            sight.kind = label.kind;
        } else if sight.kind != label.kind && !sight.has_border {
            sight.has_border = true;
            self.touch(tile);
        }
    }

    /// Blocks of the same level that touch one with differing corners are halved with it.
    fn touch(&mut self, tile: Tile) {
        let (level, block) = (self.tiling.level(tile), self.tiling.block(tile));
        for at in block.cells() {
            let id = self.id(at);
            self.touched[id] |= bit(level);
        }
        let on_edge = |[i, j]: &[usize; 2]| block.i.contains(i) || block.j.contains(j);
        for at in block.cells().filter(on_edge) {
            for beside in self.tiling.covering(at) {
                if self.tiling.level(beside) == level && self.is_touched(beside) {
                    self.pending.push(beside);
                }
            }
        }
    }

    /// Whether a corner belongs to a block of the same level with differing corners.
    fn is_touched(&self, tile: Tile) -> bool {
        let (level, block) = (self.tiling.level(tile), self.tiling.block(tile));
        let is_touched = |&at: &[usize; 2]| self.touched[self.id(at)] & bit(level) != 0;
        block.width() >= self.narrow && block.corners().iter().any(is_touched)
    }

    /// Halves what is to be halved, and what that shows.
    fn halve(&mut self, requests: &mut Vec<u32>) {
        while let Some(tile) = self.pending.pop() {
            if !self.may_halve(tile) {
                continue;
            }
            let is_free = self.blocks[tile].is_free;
            let parts = self.tiling.halve(tile);
            self.deepest = self.deepest.max(self.tiling.level(parts.start));
            for part in parts {
                self.blocks.push(BlockState { is_free, ..BlockState::default() });
                self.request_corners(part, requests);
                let block = self.tiling.block(part);
                for at in block.cells() {
                    let label = self.label(at);
                    if label.is_known() {
                        self.show_to(part, label);
                        if block.has_corner(at) {
                            self.show_corner(part, label);
                        }
                    }
                }
                if self.is_touched(part) {
                    self.pending.push(part);
                }
            }
        }
    }

    fn may_halve(&self, tile: Tile) -> bool {
        let is_allowed = || {
            let level = self.tiling.level(tile);
            self.blocks[tile].is_free || self.refine.rounds.is_none_or(|most| level < most)
        };
        self.tiling.is_leaf(tile) && self.tiling.block(tile).has_inside() && is_allowed()
    }

    fn request_corners(&mut self, tile: Tile, requests: &mut Vec<u32>) {
        for at in self.tiling.block(tile).corners() {
            let id = self.id(at);
            self.request(id, requests);
        }
    }

    /// Asks for a cell, once; whether it was the first time.
    fn request(&mut self, id: usize, requests: &mut Vec<u32>) -> bool {
        let is_new = !std::mem::replace(&mut self.is_requested[id], true);
        if is_new {
            self.unrequested -= 1;
            requests.push(id as u32);
        }
        is_new
    }

    /// From now on narrower blocks are halved, too, for touching one that a border crosses: those that there are.
    fn follow_closely(&mut self) -> Vec<Tile> {
        if self.narrow <= NARROWEST {
            return Vec::new();
        }
        self.narrow = NARROWEST;
        self.tiles_to_halve(|tile| self.is_touched(tile)).collect()
    }

    /// Blocks that may be halved, and are `wanted`.
    fn tiles_to_halve(&self, wanted: impl Fn(Tile) -> bool) -> impl Iterator<Item = Tile> {
        self.tiling.tiles().filter(move |&tile| self.may_halve(tile) && wanted(tile))
    }

    fn id(&self, [i, j]: [usize; 2]) -> usize {
        j * self.counts[0] + i
    }

    fn at(&self, id: u32) -> [usize; 2] {
        [id as usize % self.counts[0], id as usize / self.counts[0]]
    }

    fn label(&self, at: [usize; 2]) -> Label {
        self.labels[self.id(at)]
    }

    /// Fills every cell that was not integrated; returns how many, and in a map of basins from which cell each was.
    pub(super) fn fill(&self, records: &mut [Record]) -> (usize, Vec<u32>) {
        let mut count = 0;
        let cells = if self.basins.is_some() { records.len() } else { 0 };
        let mut from: Vec<u32> = (0..cells as u32).collect();
        for tile in self.tiling.tiles().filter(|&tile| self.tiling.is_leaf(tile)) {
            let block = self.tiling.block(tile);
            let corners = block.corners().map(|at| records[self.id(at)]);
            let filling = Filling::new(&block, corners.each_ref());
            for at in block.cells().filter(|&at| self.tiling.owner(at) == tile) {
                let id = self.id(at);
                if !self.is_requested[id] {
                    records[id] = filling.record(at);
                    if let Some(from) = from.get_mut(id) {
                        *from = self.id(block.corners()[block.nearest(at)]) as u32;
                    }
                    count += 1;
                }
            }
        }
        (count, from)
    }
}

fn bit(level: u32) -> u16 {
    1 << level.min(LEVELS - 1)
}
