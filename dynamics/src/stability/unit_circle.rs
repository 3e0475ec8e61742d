//! A test whether all eigenvalues lie within the unit circle, without computing them.
//!
//! It uses the characteristic polynomial (Faddeev and LeVerrier) and the criterion of Schur and Cohn, about a hundred
//! multiplications for a matrix of four rows.

use super::times;
use crate::model::STATE;

/// Whether the modulus of every eigenvalue is below 1; none if the matrix is not finite. `entry` returns the entries of a matrix with
/// `size` rows.
///
/// If an eigenvalue lies within rounding of the circle, either answer is possible.
pub(super) fn lies_within_unit_circle(size: usize, entry: impl Fn(usize, usize) -> f64) -> Option<bool> {
    let mut polynomial = match size {
        0..=4 => characteristic::<4>(size, entry),
        5..=8 => characteristic::<8>(size, entry),
        _ => characteristic::<STATE>(size, entry),
    };
    if !polynomial.iter().all(|c| c.is_finite()) {
        return None;
    }
    // All roots of a polynomial of degree n lie inside the circle if its last coefficient is smaller than its first, and if all roots of
    // another polynomial lie inside: the one of degree n - 1 that remains after elimination with the reversed polynomial.
    for degree in (1..=size).rev() {
        let (first, last) = (polynomial[0], polynomial[degree]);
        // NaN is a sign of overflow.
        if last.abs() >= first.abs() || last.is_nan() || first.is_nan() {
            return Some(false);
        }
        let reverse = polynomial;
        for n in 0..degree {
            polynomial[n] = reverse[n] - last / first * reverse[degree - n];
        }
    }
    Some(true)
}

/// Returns the coefficients of `det(z - A)`, highest power first, followed by zeros. The matrix has `N` rows or fewer.
fn characteristic<const N: usize>(size: usize, entry: impl Fn(usize, usize) -> f64) -> [f64; STATE + 1] {
    let column = |j| std::array::from_fn(|i| if i.max(j) < size { entry(i, j) } else { 0.0 });
    let matrix: [[f64; N]; N] = std::array::from_fn(column);
    let mut power = matrix;
    let mut coefficients = [0.0; STATE + 1];
    coefficients[0] = 1.0;
    for (n, place) in coefficients.iter_mut().enumerate().take(size + 1).skip(1) {
        let trace = (0..size).fold(0.0, |sum, i| sum + power[i][i]);
        let coefficient = -trace / n as f64;
        *place = coefficient;
        (0..size).for_each(|i| power[i][i] += coefficient);
        power = times(&matrix, &power);
    }
    coefficients
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    use super::*;
    use crate::stability::multipliers;

    #[test]
    fn the_characteristic_polynomial_has_the_eigenvalues_as_roots() {
        // (z - 1)(z - 2)(z + 3)(z - 4)
        let diagonal = |i: usize, j: usize| if i == j { [1.0, 2.0, -3.0, 4.0][i] } else { 0.0 };
        assert_eq!(characteristic::<4>(4, diagonal)[..5], [1.0, -4.0, -7.0, 34.0, -24.0]);
        assert_eq!(characteristic::<STATE>(4, diagonal)[..5], [1.0, -4.0, -7.0, 34.0, -24.0]);
    }

    #[test]
    fn nan_zero_and_identity_matrices() {
        assert_eq!(lies_within_unit_circle(4, |_, _| f64::NAN), None);
        assert_eq!(lies_within_unit_circle(4, |_, _| 0.0), Some(true));
        assert_eq!(lies_within_unit_circle(4, |i, j| f64::from(u8::from(i == j))), Some(false));
    }

    proptest! {
        #[test]
        fn the_criterion_agrees_with_the_eigenvalues(
            entries in prop::collection::vec(-1.0..1.0f64, STATE * STATE), size in 1..=STATE, scale in 0.1..3.0f64,
        ) {
            let matrix = DMatrix::from_column_slice(size, size, &entries[..size * size]) * scale;
            let [re, im] = multipliers(&matrix).unwrap()[0];
            let radius = re.hypot(im);
            prop_assume!((radius - 1.0).abs() > 1e-6);
            prop_assert_eq!(lies_within_unit_circle(size, |i, j| matrix[(i, j)]), Some(radius < 1.0), "radius {}", radius);
        }
    }
}
