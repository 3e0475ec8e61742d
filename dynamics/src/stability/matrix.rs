//! Products of small square matrices, in an order of operations that does not depend on the processor.

use nalgebra::DMatrix;

use crate::model::{REST, State, dot};

/// Returns the product of two matrices of `N` rows, given by columns.
#[inline]
pub(crate) fn times<const N: usize>(a: &[[f64; N]; N], b: &[[f64; N]; N]) -> [[f64; N]; N] {
    b.map(|factors| {
        let mut sum: [f64; N] = std::array::from_fn(|i| a[0][i] * factors[0]);
        for k in 1..N {
            (0..N).for_each(|i| sum[i] += a[k][i] * factors[k]);
        }
        sum
    })
}

/// Returns the product of two square matrices. nalgebra's product depends on the processor if matrices have more than five rows.
pub(crate) fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let size = a.nrows();
    // Code for a known number of rows is much faster.
    if size == 4 {
        let [a, b] = [a, b].map(|m| std::array::from_fn(|j| std::array::from_fn(|i| m[(i, j)])));
        return DMatrix::from_column_slice(4, 4, times::<4>(&a, &b).as_flattened());
    }
    let mut product = DMatrix::zeros(size, size);
    let columns = product.as_mut_slice().chunks_exact_mut(size);
    for (column, factors) in columns.zip(b.as_slice().chunks_exact(size)) {
        let mut terms = a.as_slice().chunks_exact(size).zip(factors);
        let Some((first, factor)) = terms.next() else { break };
        column.iter_mut().zip(first).for_each(|(sum, x)| *sum = x * factor);
        terms.for_each(|(of_a, factor)| {
            column.iter_mut().zip(of_a).for_each(|(sum, x)| *sum += x * factor);
        });
    }
    product
}

/// Returns the product of a matrix of at most `N` rows and a vector.
pub(crate) fn image_of<const N: usize>(matrix: &DMatrix<f64>, vector: &[f64; N]) -> [f64; N] {
    let mut image = [0.0; N];
    for (column, factor) in matrix.as_slice().chunks_exact(matrix.nrows()).zip(vector) {
        image.iter_mut().zip(column).for_each(|(sum, x)| *sum += x * factor);
    }
    image
}

/// Returns the square root of the sum of the squares of all entries.
pub(crate) fn norm(matrix: &DMatrix<f64>) -> f64 {
    let columns = matrix.as_slice().chunks_exact(matrix.nrows());
    columns.map(|column| dot(&padded(column), &padded(column))).sum::<f64>().sqrt()
}

fn padded(column: &[f64]) -> State {
    let mut all = REST;
    all[..column.len()].copy_from_slice(column);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::state;

    #[test]
    fn products_agree_with_those_of_nalgebra() {
        for size in [2, 4, 6, 8, 10, 16] {
            let entry = |i: usize, j: usize, more: f64| (1.7 * i as f64 + 0.9 * (j * j) as f64 + more).sin();
            let [a, b] = [0.0, 0.4].map(|more| DMatrix::from_fn(size, size, |i, j| entry(i, j, more)));
            let (ours, theirs) = (product(&a, &b), &a * &b);
            match size {
                2 | 4 => assert_eq!(ours, theirs, "to the bit"),
                _ => assert!((&ours - theirs).amax() < 1e-14, "{size}"),
            }
            let column: State = state(b.column(1).as_slice());
            assert_eq!(image_of(&a, &column)[..size], *ours.column(1).as_slice(), "{size}");
            assert!((norm(&a) - a.norm()).abs() < 1e-14, "{size}");
        }
    }
}
