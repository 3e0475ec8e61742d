//! The first root of a polynomial on a step.
//!
//! In Bernstein form, the number of roots in an interval is at most the number of sign changes of the coefficients, and one sign change
//! means exactly one root (Descartes' rule). Other intervals are halved by de Casteljau's algorithm. A root of order m at the start is
//! divided out: the Bernstein coefficients of the quotient have the signs of the polynomial's coefficients from the index m on.

use wide::{CmpGt, f64x4};

/// Order of the Taylor polynomial of a step. The number of coefficients is a multiple of four, for SIMD registers.
pub(super) const ORDER: usize = 23;

/// Number of registers that hold the coefficients of a polynomial.
const REGISTERS: usize = (ORDER + 1) / 4;

/// Coefficients of a polynomial in powers of the share of the step.
pub(super) type Polynomial = [f64; ORDER + 1];

/// Largest number of halvings. A function that is still undecided then counts as touching zero within rounding.
const MOST_HALVINGS: u32 = 48;

/// Largest number of steps of the final root search.
const ROOT_STEP_CAP: u32 = 200;

/// Largest order of a root at the start of a step.
const MOST_ORDER: usize = 18;

/// Rounding error of a coefficient, relative to the sum of all.
const BERNSTEIN_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Where a function that is positive at first becomes negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fall {
    /// Nowhere on the step.
    None,
    /// Nowhere, but it comes so near to zero that rounding decides.
    Touches,
    /// At this share of the step, in `[0, 1]`.
    At(f64),
}

/// Returns the coefficients in registers.
fn registers(c: &Polynomial) -> [f64x4; REGISTERS] {
    std::array::from_fn(|i| f64x4::new(c.as_chunks().0[i]))
}

fn from_registers(registers: [f64x4; REGISTERS]) -> Polynomial {
    let mut c = [0.0; ORDER + 1];
    c.as_chunks_mut().0.iter_mut().zip(registers).for_each(|(c, register)| *c = register.to_array());
    c
}

/// Returns the sum of the sizes of all coefficients but the first.
pub(super) fn rest(c: &Polynomial) -> f64 {
    let later = registers(c).map(f64x4::abs);
    let first = later[0] * f64x4::new([0.0, 1.0, 1.0, 1.0]);
    (first + later[1] + (later[2] + later[3]) + (later[4] + later[5])).reduce_add()
}

/// Returns a linear combination of polynomials.
pub(super) fn combine(polynomials: &[Polynomial], factors: &[f64]) -> Polynomial {
    let mut sums = [f64x4::ZERO; REGISTERS];
    for (polynomial, &factor) in polynomials.iter().zip(factors) {
        let (terms, factor) = (polynomial.as_chunks().0, f64x4::splat(factor));
        (0..REGISTERS).for_each(|i| sums[i] = f64x4::new(terms[i]).mul_add(factor, sums[i]));
    }
    from_registers(sums)
}

/// Changes the variable of a polynomial from the share of a step to the share of the first `part` of this step.
pub(super) fn stretched(c: &Polynomial, part: f64) -> Polynomial {
    let (square, fourth) = (part * part, f64x4::splat((part * part) * (part * part)));
    let mut powers = f64x4::new([1.0, part, square, part * square]);
    from_registers(registers(c).map(|c| {
        let stretched = c * powers;
        powers *= fourth;
        stretched
    }))
}

/// Columns of the triangular matrix that gives Bernstein coefficients: `b_i = sum_j C(i, j) / C(ORDER, j) c_j`.
static BERNSTEIN: [Polynomial; ORDER + 1] = {
    let mut columns = [[0.0; ORDER + 1]; ORDER + 1];
    let mut i = 0;
    while i <= ORDER {
        let (mut j, mut entry) = (0, 1.0);
        while j <= i {
            columns[j][i] = entry;
            entry *= (i - j) as f64 / (ORDER - j) as f64;
            j += 1;
        }
        i += 1;
    }
    columns
};

/// Adds the terms of four columns to Bernstein coefficients. The matrix is triangular: a column begins in the register of its number.
#[inline(always)]
fn add_columns<const FIRST: usize>(sums: &mut [f64x4; REGISTERS], c: &Polynomial) {
    for column in 4 * FIRST..4 * FIRST + 4 {
        let factor = f64x4::splat(c[column]);
        for (i, sum) in sums.iter_mut().enumerate() {
            if i >= FIRST {
                *sum = f64x4::new(BERNSTEIN[column].as_chunks().0[i]).mul_add(factor, *sum);
            }
        }
    }
}

/// Returns the Bernstein coefficients of a polynomial without its first `order` terms.
pub(super) fn bernstein(c: &Polynomial, order: usize) -> Polynomial {
    let (mut later, mut sums) = (*c, [f64x4::ZERO; REGISTERS]);
    later[..order].fill(0.0);
    add_columns::<0>(&mut sums, &later);
    add_columns::<1>(&mut sums, &later);
    add_columns::<2>(&mut sums, &later);
    add_columns::<3>(&mut sums, &later);
    add_columns::<4>(&mut sums, &later);
    add_columns::<5>(&mut sums, &later);
    from_registers(sums)
}

/// Finds the first root of a polynomial after division by `u^order`. The coefficients of lower order must be zero within rounding. An
/// `order` above [`MOST_ORDER`] means that all coefficients are zero. `size` bounds the terms that cancel in the coefficients. The
/// Bernstein coefficients `b` are computed if they are not known, or if the order is above 1.
pub(super) fn first_fall(c: &Polynomial, b: Option<Polynomial>, order: usize, size: f64) -> Fall {
    if order > MOST_ORDER {
        return Fall::None;
    }
    if c[order] <= 0.0 {
        return Fall::At(0.0);
    }
    let b = b.filter(|_| order <= 1).unwrap_or_else(|| bernstein(c, order));
    let (count, degree) = (ORDER + 1 - order, ORDER - order);
    let signs = registers(&b).map(|b| b.cmp_gt(f64x4::ZERO).move_mask() as u32);
    let positive = (0..REGISTERS).fold(0, |positive, i| positive | signs[i] << (4 * i)) >> order;
    let all = (1 << count) - 1;
    if positive == all {
        return Fall::None;
    }
    let noise = BERNSTEIN_ROUNDING * if order == 0 { rest(c) + size } else { rest(c) };
    // Bernstein coefficients of the quotient.
    let quotient =
        |i: usize| (0..order).fold(b[order + i], |b, k| b * ((ORDER - k) as f64 / (order + i - k) as f64));
    let mut touches = false;
    let isolated = if ((positive ^ positive >> 1) & all >> 1).count_ones() == 1 && positive & 1 == 1 {
        let i = positive.trailing_ones() as usize;
        Some(([0.0, 1.0], polygon(i, [quotient(i - 1), quotient(i)], degree)))
    } else {
        let quotients: Polynomial = std::array::from_fn(|i| if i < count { quotient(i) } else { 0.0 });
        isolate(&quotients[..count], [0.0, 1.0], noise, 0, &mut touches)
    };
    match isolated {
        Some((bracket, guess)) => Fall::At(root(&c[order..], bracket, guess)),
        None if touches => Fall::Touches,
        None => Fall::None,
    }
}

/// Estimates the root: returns where the control polygon of the Bernstein coefficients crosses zero before the coefficient `i`.
fn polygon(i: usize, [before, after]: [f64; 2], degree: usize) -> f64 {
    (i as f64 - after / (after - before)) / degree as f64
}

/// Returns an interval with the first root only, and a guess of the root.
fn isolate(
    b: &[f64],
    [lo, hi]: [f64; 2],
    noise: f64,
    depth: u32,
    touches: &mut bool,
) -> Option<([f64; 2], f64)> {
    let degree = b.len() - 1;
    if b.iter().all(|&b| b > 0.0) {
        return None;
    }
    let changes = b.windows(2).filter(|pair| (pair[0] > 0.0) != (pair[1] > 0.0)).count();
    if changes == 1 && b[0] > 0.0 {
        let i = b.iter().position(|&b| b <= 0.0).unwrap_or(degree);
        return Some(([lo, hi], lo + (hi - lo) * polygon(i, [b[i - 1], b[i]], degree)));
    }
    let size = b.iter().fold(0.0f64, |size, b| size.max(b.abs()));
    if depth == MOST_HALVINGS || size <= noise {
        *touches = true;
        return (b[degree] < -noise).then_some(([lo, hi], 0.5 * (lo + hi)));
    }
    let [left, right] = halves(b);
    let middle = 0.5 * (lo + hi);
    isolate(&left[..=degree], [lo, middle], noise, depth + 1, touches)
        .or_else(|| isolate(&right[..=degree], [middle, hi], noise, depth + 1, touches))
}

/// Returns the coefficients on both halves of the interval.
fn halves(b: &[f64]) -> [Polynomial; 2] {
    let degree = b.len() - 1;
    let [mut row, mut left, mut right] = [[0.0; ORDER + 1]; 3];
    row[..=degree].copy_from_slice(b);
    for i in 0..=degree {
        (left[i], right[degree - i]) = (row[0], row[degree - i]);
        for j in 0..degree - i {
            row[j] = 0.5 * (row[j] + row[j + 1]);
        }
    }
    [left, right]
}

/// Powers of a share and their derivatives, to evaluate several polynomials at this share. The power 0 is left out.
pub(super) struct Weights([[f64x4; REGISTERS]; 2]);

impl Weights {
    pub(super) fn at(u: f64) -> Weights {
        let (square, fourth) = (u * u, f64x4::splat((u * u) * (u * u)));
        let powers = f64x4::new([1.0, u, square, u * square]);
        let (mut values, mut slopes) = ([powers; REGISTERS], [f64x4::ZERO; REGISTERS]);
        values[0] = powers * f64x4::new([0.0, 1.0, 1.0, 1.0]);
        slopes[0] = f64x4::new([0.0, 0.0, 2.0 * u, 3.0 * square]);
        let (mut value, mut slope) = (powers, powers * (u * square));
        for i in 1..REGISTERS {
            let k = 4.0 * i as f64;
            value *= fourth;
            values[i] = value;
            slopes[i] = slope * f64x4::new([k, k + 1.0, k + 2.0, k + 3.0]);
            slope *= fourth;
        }
        Weights([values, slopes])
    }

    /// Returns value and slope of a polynomial. The largest term is added last.
    pub(super) fn of(&self, c: &Polynomial) -> [f64; 2] {
        let [value, slope] = self.later(c);
        [c[0] + value, c[1] + slope]
    }

    /// Returns value and slope without their first terms. Four sums run in parallel, each from its smallest to its largest term.
    pub(super) fn later(&self, c: &Polynomial) -> [f64; 2] {
        let terms = registers(c);
        self.0.each_ref().map(|weights| {
            let sums = (0..REGISTERS).rev().fold(f64x4::ZERO, |sums, i| terms[i].mul_add(weights[i], sums));
            sums.reduce_add()
        })
    }
}

/// Finds the only root in an interval by Newton's method, or by bisection where that leaves the interval.
fn root(c: &[f64], [mut lo, mut hi]: [f64; 2], guess: f64) -> f64 {
    let (mut padded, mut u) = ([0.0; ORDER + 1], guess);
    padded[..c.len()].copy_from_slice(c);
    for _ in 0..ROOT_STEP_CAP {
        let [value, slope] = Weights::at(u).of(&padded);
        if value > 0.0 {
            lo = u;
        } else {
            hi = u;
        }
        let next = u - value / slope;
        if (next - u).abs() <= 0.5 * f64::EPSILON * u || hi - lo <= f64::EPSILON * hi {
            return next.clamp(lo, hi);
        }
        u = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
    }
    u
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns `(u - a)(u - b)...`, with the sign that makes it positive at 0.
    fn with_roots(roots: &[f64]) -> Polynomial {
        let mut c = [0.0; ORDER + 1];
        c[0] = 1.0;
        for (n, root) in roots.iter().enumerate() {
            for k in (0..=n + 1).rev() {
                c[k] = c[k] * root - if k > 0 { c[k - 1] } else { 0.0 };
            }
        }
        c
    }

    #[test]
    fn the_first_root_is_found_at_any_distance() {
        let cases: [&[f64]; 5] =
            [&[0.3], &[1e-9, 0.5], &[0.5, 0.5 + 1e-6], &[0.2, 0.3, 0.4, 0.9], &[0.999_999]];
        for roots in cases {
            let Fall::At(found) = first_fall(&with_roots(roots), None, 0, 0.0) else {
                panic!("no root of {roots:?}")
            };
            let error = (found - roots[0]).abs() / roots[0];
            let conditioned = if roots.len() == 2 { 1e-9 } else { 1e-14 };
            assert!(error < conditioned, "{roots:?}: {found}, {error:e}");
        }
        for roots in [&[1.1][..], &[2.0, 3.0], &[]] {
            assert_eq!(first_fall(&with_roots(roots), None, 0, 0.0), Fall::None);
        }
    }

    #[test]
    fn a_function_that_stays_positive_by_little_has_no_root() {
        // (u - 0.4)^2 + lift
        for lift in [1e-3, 1e-9, 1e-13] {
            let mut c = with_roots(&[0.4, 0.4]);
            c[0] += lift;
            assert_eq!(first_fall(&c, None, 0, 0.0), Fall::None, "{lift:e}");
        }
        assert_eq!(first_fall(&with_roots(&[0.4, 0.4]), None, 0, 0.0), Fall::Touches);
    }

    #[test]
    fn a_root_at_the_start_is_divided_out() {
        let mut c = [0.0; ORDER + 1];
        (c[1], c[2]) = (1e-20, -1e-20 / 0.25);
        let Fall::At(found) = first_fall(&c, None, 1, 1.0) else { panic!("no root") };
        assert!((found - 0.25).abs() < 1e-15);
        (c[1], c[2]) = (-1.0, 3.0);
        assert_eq!(first_fall(&c, None, 1, 0.0), Fall::At(0.0));
    }
}
