//! Refinement: coarse blocks, then blocks that a border crosses, down to single cells; then an audit of the filled
//! cells ([`auditing`]).
//!
//! The integrated cells do not depend on the order of the records. A block is halved because cells are known to differ,
//! and further records cannot change that. So no block waits for others.

mod auditing;

use super::audit::Audit;
use super::basins::BasinLabels;
use super::label::Label;
use super::tiling::{Tile, Tiling};
use crate::map::plan::{Needs, Plan};
use crate::map::random::Random;
use crate::map::scene::Refine;
use crate::record::{Record, Records, RecordsMut};

/// Smallest width of a block that is halved because it touches a block with a border. In narrower blocks, the cells on
/// the common edge show whether the border continues. With classes alone, 0.24 % of the filled cells of the main map
/// are then wrong.
const NARROW: usize = 8;

/// Smallest width of such a block if symmetries are borders, which adds 0.1 % of wrong cells in thin bands, or after an
/// audit has found too many wrong cells.
const NARROWEST: usize = 4;

/// Number of levels of halving that are distinguished where blocks touch.
const LEVELS: u32 = u16::BITS;

/// The state of an adaptive map.
pub(super) struct Adaptive {
    counts: [usize; 2],
    refine: Refine,
    /// Quantities whose changes are borders.
    needs: Needs,
    /// Labels of a map of basins, whose borders are changes of the attractor.
    basins: Option<BasinLabels>,
    /// Labels by cell id; unknown if the cell was not integrated.
    labels: Vec<Label>,
    /// Whether each cell was requested.
    is_requested: Vec<bool>,
    /// Number of cells that were not requested.
    unrequested: usize,
    tiling: Tiling,
    /// State of each block.
    blocks: Vec<BlockState>,
    /// Levels of the blocks with different corners that contain a cell, one bit for each level.
    touched: Vec<u16>,
    /// Blocks to be halved.
    pending: Vec<Tile>,
    /// Largest number of halvings of a coarse block.
    deepest: u32,
    /// Smallest width of blocks that are halved because they touch others.
    narrow: usize,
    /// Cells of the current audit.
    audited: Vec<u32>,
    /// Random numbers of the samples, and the number of samples so far.
    random: Random,
    samples: usize,
    audits: Vec<Audit>,
    stage: Stage,
}

/// Knowledge about a block.
#[derive(Clone, Copy, Default)]
struct BlockState {
    /// Label of the first known cell.
    label: Label,
    /// Kind of the first known corner.
    kind: u32,
    /// Whether corners differ in more than the word.
    has_border: bool,
    /// Whether the block may be halved more often than `refine.rounds` allows.
    is_free: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Integrates the coarse grid, then halves blocks.
    Halving,
    /// Integrates the sample.
    Auditing,
    /// Halves the blocks around wrong cells after a passed audit.
    Mending,
    Done,
}

impl Adaptive {
    /// Begins an adaptive map. Adds the cells of the coarse grid to `requests`, in Morton order.
    pub(super) fn new(plan: &Plan, refine: Refine, requests: &mut Vec<u32>) -> Adaptive {
        let counts = plan.counts();
        let tiling = Tiling::new(counts, refine.minimum_grid as usize);
        let cells = plan.cell_count();
        // If patterns are computed, words make no borders: they would mark every change in the number of bounces before
        // meshing.
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

    /// Returns the number of consecutive steps: the coarse grid, halvings, samples.
    pub(super) fn rounds(&self) -> usize {
        1 + self.deepest as usize + self.samples
    }

    /// Prepares for records that are accepted next.
    pub(super) fn prepare(&mut self, records: &[(u32, Record)]) {
        if let Some(basins) = &mut self.basins {
            basins.prepare(records);
        }
    }

    /// Accepts the record of a requested cell and adds the cells that it makes necessary to `requests`.
    pub(super) fn take(&mut self, id: u32, record: &Record, requests: &mut Vec<u32>) {
        let label = match &mut self.basins {
            Some(basins) => basins.label(id, record),
            None => Label::of(record, &self.needs),
        };
        self.labels[id as usize] = label;
        if self.stage != Stage::Auditing {
            self.update(self.at(id), label);
            self.halve(requests);
        }
    }

    /// Continues after all requested cells have their records: begins an audit, or evaluates it. Adds the next cells to
    /// `requests`; none if the map is finished.
    pub(super) fn settle(&mut self, records: &(impl Records + ?Sized), requests: &mut Vec<u32>) {
        let before = requests.len();
        while requests.len() == before && self.stage != Stage::Done {
            match self.stage {
                Stage::Halving => self.begin_audit(requests),
                Stage::Auditing => self.judge_audit(records, requests),
                Stage::Mending | Stage::Done => self.stage = Stage::Done,
            }
        }
    }

    /// Passes the label of a cell to all blocks that contain it.
    fn update(&mut self, at: [usize; 2], label: Label) {
        for tile in self.tiling.covering(at) {
            self.update_block(tile, label);
            // A block may have been halved before all its corners were known.
            let with_corner = |&tile: &Tile| self.tiling.block(tile).has_corner(at);
            let corner_of: Vec<Tile> = self.tiling.lineage(tile).take_while(with_corner).collect();
            corner_of.into_iter().for_each(|tile| self.update_corner(tile, label));
        }
    }

    fn update_block(&mut self, tile: Tile, label: Label) {
        let block = &mut self.blocks[tile];
        if !block.label.is_known() {
            block.label = label;
        } else if block.label != label {
            self.pending.push(tile);
        }
    }

    fn update_corner(&mut self, tile: Tile, label: Label) {
        let block = &mut self.blocks[tile];
        if block.kind == 0 {
            block.kind = label.kind;
        } else if block.kind != label.kind && !block.has_border {
            block.has_border = true;
            self.touch(tile);
        }
    }

    /// Marks blocks of the same level that touch a block with different corners: they are halved, too.
    fn touch(&mut self, tile: Tile) {
        let (level, block) = (self.tiling.level(tile), self.tiling.block(tile));
        for at in block.cells() {
            let id = self.id(at);
            self.touched[id] |= bit(level);
        }
        let on_edge = |[i, j]: &[usize; 2]| block.i.contains(i) || block.j.contains(j);
        for at in block.cells().filter(on_edge) {
            for neighbour in self.tiling.covering(at) {
                if self.tiling.level(neighbour) == level && self.is_touched(neighbour) {
                    self.pending.push(neighbour);
                }
            }
        }
    }

    /// Whether a corner belongs to a block of the same level with different corners.
    fn is_touched(&self, tile: Tile) -> bool {
        let (level, block) = (self.tiling.level(tile), self.tiling.block(tile));
        let is_touched = |&at: &[usize; 2]| self.touched[self.id(at)] & bit(level) != 0;
        block.width() >= self.narrow && block.corners().iter().any(is_touched)
    }

    /// Halves the pending blocks, and further blocks that become pending by that.
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
                        self.update_block(part, label);
                        if block.has_corner(at) {
                            self.update_corner(part, label);
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

    /// Requests a cell unless it was requested before. Returns whether it is new.
    fn request(&mut self, id: usize, requests: &mut Vec<u32>) -> bool {
        let is_new = !std::mem::replace(&mut self.is_requested[id], true);
        if is_new {
            self.unrequested -= 1;
            requests.push(id as u32);
        }
        is_new
    }

    /// Lowers the width of blocks that are halved because they touch a border. Returns such blocks.
    fn follow_closely(&mut self) -> Vec<Tile> {
        if self.narrow <= NARROWEST {
            return Vec::new();
        }
        self.narrow = NARROWEST;
        self.tiles_to_halve(|tile| self.is_touched(tile)).collect()
    }

    /// Returns the blocks that may be halved and for which `is_selected` holds.
    fn tiles_to_halve(&self, is_selected: impl Fn(Tile) -> bool) -> impl Iterator<Item = Tile> {
        self.tiling.tiles().filter(move |&tile| self.may_halve(tile) && is_selected(tile))
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

    /// Fills all cells that were not integrated. Returns their number and, for a map of basins, the cell from which
    /// each cell was filled.
    pub(super) fn fill(&self, records: &mut (impl RecordsMut + ?Sized)) -> (usize, Vec<u32>) {
        let mut count = 0;
        let cells = if self.basins.is_some() { records.count() } else { 0 };
        let mut from: Vec<u32> = (0..cells as u32).collect();
        for tile in self.tiling.tiles().filter(|&tile| self.tiling.is_leaf(tile)) {
            let block = self.tiling.block(tile);
            let filling = self.filling(tile, records);
            for at in block.cells().filter(|&at| self.tiling.owner(at) == tile) {
                let id = self.id(at);
                if !self.is_requested[id] {
                    records.put(id, &filling.record(at));
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
