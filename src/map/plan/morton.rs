//! Morton order: a walk through a grid that stays among neighbours.

/// The place of a cell in Morton order: its indices with their bits interlaced.
pub(crate) fn key([i, j]: [usize; 2]) -> u64 {
    let spread = |n: usize| (0..32).fold(0, |bits, k| bits | (n as u64 >> k & 1) << (2 * k));
    spread(i) | spread(j) << 1
}

/// The ids `j * columns + i` of a grid, in Morton order.
pub(super) fn order(columns: usize, rows: usize) -> Vec<u32> {
    let mut ids = Vec::with_capacity(columns * rows);
    let side = columns.max(rows).next_power_of_two();
    visit([0, 0], side, [columns, rows], &mut ids);
    ids
}

/// Visits the square at `[i, j]` as far as it lies in the grid.
fn visit([i, j]: [usize; 2], side: usize, counts: [usize; 2], ids: &mut Vec<u32>) {
    if i >= counts[0] || j >= counts[1] {
        return;
    }
    if side == 1 {
        ids.push((j * counts[0] + i) as u32);
        return;
    }
    let half = side / 2;
    for at in [[i, j], [i + half, j], [i, j + half], [i + half, j + half]] {
        visit(at, half, counts, ids);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrants_come_one_after_the_other() {
        assert_eq!(order(4, 4), [0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15]);
        assert_eq!(order(3, 2), [0, 1, 3, 4, 2, 5]);
        let mut long = order(1000, 3);
        long.sort_unstable();
        assert!(long.into_iter().eq(0..3000));
    }
}
