//! Morton order: an order of the cells of a grid in which consecutive cells are close to each other.

/// Returns the Morton key of a cell: its indices with their bits interleaved.
pub(crate) fn key([i, j]: [usize; 2]) -> u64 {
    let spread = |n: usize| (0..32).fold(0, |bits, k| bits | (n as u64 >> k & 1) << (2 * k));
    spread(i) | spread(j) << 1
}

/// Returns the indices of the cell at a place of the Morton order of a grid. `place` is below the number of cells. The
/// order is computed, because a table of 10^9 cells would take 4 GB.
pub(super) fn at(mut place: usize, counts: [usize; 2]) -> [usize; 2] {
    let mut corner = [0, 0];
    let mut side = counts[0].max(counts[1]).next_power_of_two();
    // Squares that cross the grid's edge contain fewer cells. Inside a complete square the place is the key.
    while !(0..2).all(|axis| corner[axis] + side <= counts[axis]) {
        side /= 2;
        let [i, j] = corner;
        for at in [[i, j], [i + side, j], [i, j + side], [i + side, j + side]] {
            let inside = |axis: usize| counts[axis].saturating_sub(at[axis]).min(side);
            let cells = inside(0) * inside(1);
            corner = at;
            if place < cells {
                break;
            }
            place -= cells;
        }
    }
    [corner[0] + every_other_bit(place), corner[1] + every_other_bit(place >> 1)]
}

/// Returns bits 0, 2, 4, ... as consecutive bits.
fn every_other_bit(n: usize) -> usize {
    let mut bits = n as u64 & 0x5555_5555_5555_5555;
    for (shift, mask) in [
        (1, 0x3333_3333_3333_3333),
        (2, 0x0f0f_0f0f_0f0f_0f0f),
        (4, 0x00ff_00ff_00ff_00ff),
        (8, 0x0000_ffff_0000_ffff),
        (16, 0x0000_0000_ffff_ffff),
    ] {
        bits = (bits | bits >> shift) & mask;
    }
    bits as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrants_come_one_after_the_other() {
        let order = |counts: [usize; 2]| -> Vec<usize> {
            let id = |[i, j]: [usize; 2]| j * counts[0] + i;
            (0..counts[0] * counts[1]).map(|place| id(at(place, counts))).collect()
        };
        assert_eq!(order([4, 4]), [0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15]);
        assert_eq!(order([3, 2]), [0, 1, 3, 4, 2, 5]);
        // Keys increase strictly, so every cell occurs once.
        for counts in [[1000, 3], [1, 77], [64, 64], [65, 63], [37, 100]] {
            let keys = order(counts).into_iter().map(|id| key([id % counts[0], id / counts[0]]));
            assert!(keys.is_sorted_by(|a, b| a < b), "{counts:?}");
        }
    }
}
