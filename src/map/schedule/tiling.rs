//! The tiling of a map by blocks: which block covers a cell, and from which block it was halved.

use std::ops::Range;

use super::blocks::{Block, coarse};

/// Index of a block in the tiling.
pub(super) type Tile = usize;

/// Blocks that cover a map without gaps, and the larger blocks from which they were halved.
pub(super) struct Tiling {
    counts: [usize; 2],
    tiles: Vec<Entry>,
    /// Leaf that covers each square between four neighbouring cells, row by row.
    owners: Vec<u32>,
}

struct Entry {
    block: Block,
    parent: Option<u32>,
    level: u32,
    is_leaf: bool,
}

impl Tiling {
    /// Builds the tiling by blocks between every `step`-th line.
    pub(super) fn new(counts: [usize; 2], step: usize) -> Tiling {
        let owners = vec![0; (counts[0] - 1) * (counts[1] - 1)];
        let mut tiling = Tiling { counts, tiles: Vec::new(), owners };
        for block in coarse(counts, step) {
            tiling.add(block, None, 0);
        }
        tiling
    }

    fn add(&mut self, block: Block, parent: Option<u32>, level: u32) {
        let tile = self.tiles.len() as u32;
        for j in block.j[0]..block.j[1] {
            let row = j * (self.counts[0] - 1);
            self.owners[row + block.i[0]..row + block.i[1]].fill(tile);
        }
        self.tiles.push(Entry { block, parent, level, is_leaf: true });
    }

    /// Returns all blocks, including halved ones.
    pub(super) fn tiles(&self) -> Range<Tile> {
        0..self.tiles.len()
    }

    pub(super) fn block(&self, tile: Tile) -> Block {
        self.tiles[tile].block
    }

    /// Returns the number of halvings that led to a block.
    pub(super) fn level(&self, tile: Tile) -> u32 {
        self.tiles[tile].level
    }

    /// Whether the block has not been halved.
    pub(super) fn is_leaf(&self, tile: Tile) -> bool {
        self.tiles[tile].is_leaf
    }

    /// Returns the block and the blocks from which it was halved, the smallest first.
    pub(super) fn lineage(&self, tile: Tile) -> impl Iterator<Item = Tile> + '_ {
        std::iter::successors(Some(tile), |&tile| self.tiles[tile].parent.map(|parent| parent as Tile))
    }

    /// Halves a leaf and returns its parts.
    pub(super) fn halve(&mut self, tile: Tile) -> Range<Tile> {
        let Entry { block, level, ref mut is_leaf, .. } = self.tiles[tile];
        *is_leaf = false;
        let from = self.tiles.len();
        for part in block.halves() {
            self.add(part, Some(tile as u32), level + 1);
        }
        from..self.tiles.len()
    }

    /// Returns the leaves that contain a cell, up to four.
    pub(super) fn covering(&self, [i, j]: [usize; 2]) -> impl Iterator<Item = Tile> + use<> {
        let [columns, rows] = self.counts.map(|count| count - 1);
        let mut found = [usize::MAX; 4];
        let mut count = 0;
        for j in j.saturating_sub(1)..(j + 1).min(rows) {
            for i in i.saturating_sub(1)..(i + 1).min(columns) {
                let tile = self.owners[j * columns + i] as Tile;
                if !found[..count].contains(&tile) {
                    found[count] = tile;
                    count += 1;
                }
            }
        }
        found.into_iter().take(count)
    }

    /// Returns the leaf that fills a cell: the one above and to the right of it, if there is one.
    pub(super) fn owner(&self, [i, j]: [usize; 2]) -> Tile {
        let [columns, rows] = self.counts.map(|count| count - 1);
        self.owners[j.min(rows - 1) * columns + i.min(columns - 1)] as Tile
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_one_owner_among_the_leaves_that_cover_it() {
        let mut tiling = Tiling::new([21, 11], 8);
        for _ in 0..3 {
            let first = tiling.tiles().find(|&tile| tiling.is_leaf(tile)).unwrap();
            let parts = tiling.halve(first);
            assert!(parts.clone().all(|part| tiling.lineage(part).nth(1) == Some(first)));
        }
        for (i, j) in (0..11).flat_map(|j| (0..21).map(move |i| (i, j))) {
            let covers = |&tile: &Tile| {
                let Block { i: [i0, i1], j: [j0, j1] } = tiling.block(tile);
                tiling.is_leaf(tile) && (i0..=i1).contains(&i) && (j0..=j1).contains(&j)
            };
            let mut covering: Vec<Tile> = tiling.covering([i, j]).collect();
            covering.sort_unstable();
            assert_eq!(covering, tiling.tiles().filter(covers).collect::<Vec<_>>(), "{i}, {j}");
            assert!(covering.contains(&tiling.owner([i, j])));
        }
    }
}
