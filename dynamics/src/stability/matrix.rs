//! Products of small square matrices, in an order of operations that does not depend on the processor.

use nalgebra::DMatrix;

use crate::model::{REST, STATE, State, dot};

/// Computes the product of two square matrices, in `product`, which has their size. The product of nalgebra depends on the processor
/// if matrices have more than five rows.
pub(crate) fn multiply(a: &DMatrix<f64>, b: &DMatrix<f64>, product: &mut DMatrix<f64>) {
    let size = a.nrows();
    let (a, b, product) = (a.as_slice(), b.as_slice(), product.as_mut_slice());
    match size {
        // A known number of rows is much faster.
        4 => multiply_rows::<4>(a, b, product),
        8 => multiply_rows::<8>(a, b, product),
        STATE => multiply_rows::<STATE>(a, b, product),
        _ => {
            for (column, factors) in product.chunks_exact_mut(size).zip(b.chunks_exact(size)) {
                let mut terms = a.chunks_exact(size).zip(factors);
                let Some((first, factor)) = terms.next() else { return };
                column.iter_mut().zip(first).for_each(|(sum, x)| *sum = x * factor);
                terms.for_each(|(of_a, factor)| {
                    column.iter_mut().zip(of_a).for_each(|(sum, x)| *sum += x * factor)
                });
            }
        }
    }
}

/// Computes the product of two matrices of `N` rows, which lie in memory column by column.
#[inline]
pub(super) fn multiply_rows<const N: usize>(a: &[f64], b: &[f64], product: &mut [f64]) {
    let ((a, _), (b, _), (product, _)) =
        (a.as_chunks::<N>(), b.as_chunks::<N>(), product.as_chunks_mut::<N>());
    for (column, factors) in product.iter_mut().zip(b) {
        let mut sum: [f64; N] = std::array::from_fn(|i| a[0][i] * factors[0]);
        for (of_a, factor) in a.iter().zip(factors).skip(1) {
            (0..N).for_each(|i| sum[i] += of_a[i] * factor);
        }
        *column = sum;
    }
}

/// Returns the product of two square matrices.
pub(crate) fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(a.nrows(), a.nrows());
    multiply(a, b, &mut product);
    product
}

/// Returns the image of a vector, of which the matrix has `N` rows or fewer.
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
