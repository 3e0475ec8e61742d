//! Rectangular blocks of cells and their halving.

/// A rectangle of cells, given by the first and last index on each axis. Neighbouring blocks share their borders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) i: [usize; 2],
    pub(super) j: [usize; 2],
}

impl Block {
    /// Returns the corners in the order (low, low), (high, low), (low, high), (high, high).
    pub(super) fn corners(&self) -> [[usize; 2]; 4] {
        let ([i0, i1], [j0, j1]) = (self.i, self.j);
        [[i0, j0], [i1, j0], [i0, j1], [i1, j1]]
    }

    /// Whether the block has cells other than its corners.
    pub(super) fn has_inside(&self) -> bool {
        self.width() > 1
    }

    /// Returns the length of the longer side: its number of cells minus one.
    pub(super) fn width(&self) -> usize {
        (self.i[1] - self.i[0]).max(self.j[1] - self.j[0])
    }

    /// Returns all cells, including corners.
    pub(super) fn cells(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let ([i0, i1], [j0, j1]) = (self.i, self.j);
        (j0..=j1).flat_map(move |j| (i0..=i1).map(move |i| [i, j]))
    }

    /// Returns the relative position of a cell along the two sides, from 0 to 1.
    pub(super) fn shares(&self, [i, j]: [usize; 2]) -> [f64; 2] {
        let share = |at: usize, [from, to]: [usize; 2]| {
            if to > from { (at - from) as f64 / (to - from) as f64 } else { 0.0 }
        };
        [share(i, self.i), share(j, self.j)]
    }

    /// Returns the index of the corner nearest to a cell.
    pub(super) fn nearest(&self, at: [usize; 2]) -> usize {
        let [u, v] = self.shares(at);
        usize::from(u >= 0.5) + 2 * usize::from(v >= 0.5)
    }

    /// Returns the parts into which the lines through the middle divide the block.
    pub(super) fn halves(&self) -> Vec<Block> {
        self.cut([(self.i[0] + self.i[1]) / 2, (self.j[0] + self.j[1]) / 2])
    }

    /// Whether a cell is a corner.
    pub(super) fn has_corner(&self, [i, j]: [usize; 2]) -> bool {
        self.i.contains(&i) && self.j.contains(&j)
    }

    fn cut(&self, [i, j]: [usize; 2]) -> Vec<Block> {
        let parts = |[from, to]: [usize; 2], at: usize| {
            if from < at && at < to { vec![[from, at], [at, to]] } else { vec![[from, to]] }
        };
        let rows = parts(self.j, j);
        parts(self.i, i).into_iter().flat_map(|i| rows.iter().map(move |&j| Block { i, j })).collect()
    }
}

/// Returns every `step`-th index of an axis, and the last index.
fn lattice(count: usize, step: usize) -> Vec<usize> {
    let mut lines: Vec<usize> = (0..count).step_by(step).collect();
    if lines.last() != Some(&(count - 1)) {
        lines.push(count - 1);
    }
    lines
}

/// Returns the blocks of a grid between every `step`-th line.
pub(super) fn coarse([columns, rows]: [usize; 2], step: usize) -> Vec<Block> {
    let (i, j) = (lattice(columns, step), lattice(rows, step));
    j.windows(2).flat_map(|j| i.windows(2).map(move |i| Block { i: [i[0], i[1]], j: [j[0], j[1]] })).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_blocks_cover_the_grid_and_share_borders() {
        let mut counts = vec![0; 11 * 6];
        for block in coarse([11, 6], 4) {
            block.cells().for_each(|[i, j]| counts[j * 11 + i] += 1);
        }
        assert!(counts.iter().all(|&times| times > 0));
        assert_eq!(counts[0], 1);
        assert_eq!(counts[4 * 11 + 4], 4, "four blocks meet in a lattice point");
    }

    #[test]
    fn blocks_are_halved_down_to_single_cells() {
        let mut blocks = vec![Block { i: [0, 5], j: [2, 3] }];
        let mut corners = std::collections::BTreeSet::new();
        while let Some(block) = blocks.pop() {
            corners.extend(block.corners());
            if block.has_inside() {
                blocks.extend(block.halves());
            }
        }
        assert_eq!(corners.len(), 12);
    }
}
