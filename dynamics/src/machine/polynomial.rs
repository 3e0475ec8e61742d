//! The first root of a polynomial on a step.
//!
//! In Bernstein form, the number of roots in an interval is at most the number of sign changes of the coefficients, and one sign change
//! means exactly one root (Descartes' rule). Other intervals are halved by de Casteljau's algorithm. A root of order m at the start is
//! divided out: the Bernstein coefficients of the quotient have the signs of the polynomial's coefficients from the index m on.

use wide::{CmpGt, f64x4};

/// Order of the longest Taylor polynomial of a step. The number of coefficients is a multiple of four, for SIMD registers.
pub(super) const ORDER: usize = 23;

/// Largest number of registers that hold the coefficients of a polynomial.
pub(super) const MOST_REGISTERS: usize = (ORDER + 1) / 4;

/// Smallest number of these registers.
pub(super) const LEAST_REGISTERS: usize = 3;

/// Shares of the longest step on which the first 12, 16, 20 and 24 terms of the Taylor series are exact within rounding.
pub(super) const REACHES: [f64; MOST_REGISTERS - LEAST_REGISTERS + 1] = [0.09375, 0.3125, 0.625, 1.0];

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

/// Calls a function with the number of registers as a constant.
macro_rules! with_registers {
    ($registers:expr, $function:ident :: <R> ($($argument:expr),*)) => {
        match $registers {
            3 => $function::<3>($($argument),*),
            4 => $function::<4>($($argument),*),
            5 => $function::<5>($($argument),*),
            _ => $function::<6>($($argument),*),
        }
    };
}

/// Returns the number of registers for a Taylor series on a share of the longest step.
pub(super) fn registers_for(part: f64) -> usize {
    LEAST_REGISTERS + REACHES[..REACHES.len() - 1].iter().filter(|reach| part > **reach).count()
}

/// Returns the first coefficients in registers.
#[inline(always)]
fn registers<const R: usize>(c: &Polynomial) -> [f64x4; R] {
    std::array::from_fn(|i| f64x4::new(c.as_chunks().0[i]))
}

/// Returns the polynomial whose first coefficients are in registers.
#[inline(always)]
fn from_registers<const R: usize>(registers: [f64x4; R]) -> Polynomial {
    let mut c = [0.0; ORDER + 1];
    c.as_chunks_mut().0.iter_mut().zip(registers).for_each(|(c, register)| *c = register.to_array());
    c
}

/// Returns the sum of the sizes of all coefficients but the first.
fn rest(c: &Polynomial) -> f64 {
    let later = registers::<MOST_REGISTERS>(c).map(f64x4::abs);
    let first = later[0] * f64x4::new([0.0, 1.0, 1.0, 1.0]);
    (first + later[1] + (later[2] + later[3]) + (later[4] + later[5])).reduce_add()
}

/// Computes a linear combination of the first coefficients of polynomials, on the first `part` of the step. Returns the sum of the sizes of
/// all coefficients but the first.
pub(super) fn combine(
    polynomials: &[Polynomial],
    factors: &[f64],
    part: f64,
    registers: usize,
    sum: &mut Polynomial,
) -> f64 {
    with_registers!(registers, combine_in::<R>(polynomials, factors, part, sum))
}

fn combine_in<const R: usize>(
    polynomials: &[Polynomial],
    factors: &[f64],
    part: f64,
    combined: &mut Polynomial,
) -> f64 {
    let mut sums = [f64x4::ZERO; R];
    let mut add = |polynomial: &Polynomial, factor: f64| {
        let (terms, factor) = (polynomial.as_chunks().0, f64x4::splat(factor));
        (0..R).for_each(|i| sums[i] = f64x4::new(terms[i]).mul_add(factor, sums[i]));
    };
    // Four at a time, because the loop costs as much as the sums.
    let (fours, others) = polynomials.as_chunks::<4>();
    let (factors, last) = factors.as_chunks::<4>();
    fours.iter().zip(factors).for_each(|(four, factors)| (0..4).for_each(|i| add(&four[i], factors[i])));
    others.iter().zip(last).for_each(|(other, factor)| add(other, *factor));
    if part != 1.0 {
        let (square, fourth) = (part * part, f64x4::splat((part * part) * (part * part)));
        let mut powers = f64x4::new([1.0, part, square, part * square]);
        for sum in &mut sums {
            *sum *= powers;
            powers *= fourth;
        }
    }
    let combined = combined.as_chunks_mut().0;
    (0..R).for_each(|i| combined[i] = sums[i].to_array());
    combined[R..].fill([0.0; 4]);
    let first = sums[0].abs() * f64x4::new([0.0, 1.0, 1.0, 1.0]);
    sums[1..].iter().fold(first, |size, sum| size + sum.abs()).reduce_add()
}

/// Columns of the triangular matrices that give Bernstein coefficients, for each number of registers: `b_i = sum_j C(i, j) / C(N, j) c_j`
/// with the degree N.
static BERNSTEIN: [[Polynomial; ORDER + 1]; REACHES.len()] = {
    let mut all = [[[0.0; ORDER + 1]; ORDER + 1]; REACHES.len()];
    let mut table = 0;
    while table < REACHES.len() {
        let (mut i, degree) = (0, 4 * (table + LEAST_REGISTERS) - 1);
        while i <= degree {
            let (mut j, mut entry) = (0, 1.0);
            while j <= i {
                all[table][j][i] = entry;
                entry *= (i - j) as f64 / (degree - j) as f64;
                j += 1;
            }
            i += 1;
        }
        table += 1;
    }
    all
};

/// Adds the terms of four columns to Bernstein coefficients, those of even and of odd columns apart, so that the sums run in parallel. The
/// matrix is triangular: a column begins in the register of its number.
#[inline(always)]
fn add_columns<const R: usize, const FIRST: usize>(sums: &mut [[f64x4; R]; 2], c: &Polynomial, order: usize) {
    for column in 4 * FIRST..4 * (FIRST + 1).min(R) {
        let factor = if column < order { 0.0 } else { c[column] };
        let (factor, terms) = (f64x4::splat(factor), &BERNSTEIN[R - LEAST_REGISTERS][column]);
        for (i, sum) in sums[column % 2].iter_mut().enumerate() {
            if i >= FIRST {
                *sum = f64x4::new(terms.as_chunks().0[i]).mul_add(factor, *sum);
            }
        }
    }
}

/// Returns the Bernstein coefficients of a polynomial without its first `order` terms.
pub(super) fn bernstein(c: &Polynomial, order: usize, registers: usize) -> Polynomial {
    with_registers!(registers, bernstein_in::<R>(c, order))
}

#[inline(always)]
fn bernstein_in<const R: usize>(c: &Polynomial, order: usize) -> Polynomial {
    let mut sums = [[f64x4::ZERO; R]; 2];
    add_columns::<R, 0>(&mut sums, c, order);
    add_columns::<R, 1>(&mut sums, c, order);
    add_columns::<R, 2>(&mut sums, c, order);
    add_columns::<R, 3>(&mut sums, c, order);
    add_columns::<R, 4>(&mut sums, c, order);
    add_columns::<R, 5>(&mut sums, c, order);
    from_registers::<R>(std::array::from_fn(|i| sums[0][i] + sums[1][i]))
}

/// Whether all coefficients `start + sign b` are positive.
pub(super) fn stays_positive(b: &Polynomial, start: f64, sign: f64, registers: usize) -> bool {
    with_registers!(registers, stays_positive_in::<R>(b, start, sign))
}

#[inline(always)]
fn stays_positive_in<const R: usize>(b: &Polynomial, start: f64, sign: f64) -> bool {
    let (start, sign) = (f64x4::splat(start), f64x4::splat(sign));
    let least = registers::<R>(b).into_iter().map(|b| b.mul_add(sign, start)).reduce(f64x4::fast_min);
    least.is_some_and(|least| least.cmp_gt(f64x4::ZERO).all())
}

/// Finds the first root of a polynomial after division by `u^order`. The coefficients of lower order must be zero within rounding. An
/// `order` above [`MOST_ORDER`] means that all coefficients are zero. `size` bounds the terms that cancel in the coefficients. The
/// Bernstein coefficients `b` are computed if they are not known, or if the order is above 1.
pub(super) fn first_fall(
    c: &Polynomial,
    b: Option<&Polynomial>,
    order: usize,
    size: f64,
    registers: usize,
) -> Fall {
    if order > MOST_ORDER {
        return Fall::None;
    }
    if c[order] <= 0.0 {
        return Fall::At(0.0);
    }
    with_registers!(registers, first_fall_in::<R>(c, b, order, size))
}

fn first_fall_in<const R: usize>(c: &Polynomial, b: Option<&Polynomial>, order: usize, size: f64) -> Fall {
    let own;
    let b = match b {
        Some(b) if order <= 1 => b,
        _ => {
            own = bernstein_in::<R>(c, order);
            &own
        }
    };
    let (count, degree) = (4 * R - order, 4 * R - 1 - order);
    let signs = registers::<R>(b).map(|b| b.cmp_gt(f64x4::ZERO).move_mask() as u32);
    let positive = (0..R).fold(0, |positive, i| positive | signs[i] << (4 * i)) >> order;
    let all = (1 << count) - 1;
    if positive == all {
        return Fall::None;
    }
    let noise = BERNSTEIN_ROUNDING * if order == 0 { rest(c) + size } else { rest(c) };
    // Bernstein coefficients of the quotient.
    let quotient = |i: usize| {
        (0..order).fold(b[order + i], |b, k| b * ((4 * R - 1 - k) as f64 / (order + i - k) as f64))
    };
    let mut touches = false;
    let isolated = if ((positive ^ positive >> 1) & all >> 1).count_ones() == 1 && positive & 1 == 1 {
        let i = positive.trailing_ones() as usize;
        Some(([0.0, 1.0], polygon(i, [quotient(i - 1), quotient(i)], degree)))
    } else {
        let quotients: Polynomial = std::array::from_fn(|i| if i < count { quotient(i) } else { 0.0 });
        isolate(&quotients[..count], [0.0, 1.0], noise, 0, &mut touches)
    };
    match isolated {
        Some((bracket, guess)) if order == 0 => Fall::At(root::<R>(c, bracket, guess)),
        Some((bracket, guess)) => {
            let mut divided = [0.0; ORDER + 1];
            divided[..count].copy_from_slice(&c[order..4 * R]);
            Fall::At(root::<R>(&divided, bracket, guess))
        }
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
pub(super) struct Weights<const R: usize>([[f64x4; R]; 2]);

impl<const R: usize> Weights<R> {
    #[inline(always)]
    pub(super) fn at(u: f64) -> Weights<R> {
        let (square, cube, q) = (u * u, u * u * u, (u * u) * (u * u));
        let fourths = [1.0, q, q * q, q * q * q, (q * q) * (q * q), (q * q) * (q * q) * q];
        let powers = f64x4::new([1.0, u, square, cube]);
        let values = std::array::from_fn(|i| match i {
            0 => powers * f64x4::new([0.0, 1.0, 1.0, 1.0]),
            _ => powers * fourths[i],
        });
        let slopes = std::array::from_fn(|i| {
            let k = 4.0 * i as f64;
            match i {
                0 => f64x4::new([0.0, 0.0, 2.0 * u, 3.0 * square]),
                _ => powers * (cube * fourths[i - 1]) * f64x4::new([k, k + 1.0, k + 2.0, k + 3.0]),
            }
        });
        Weights([values, slopes])
    }

    /// Returns value and slope of a polynomial. The largest term is added last.
    #[inline(always)]
    pub(super) fn of(&self, c: &Polynomial) -> [f64; 2] {
        let [value, slope] = self.later(c);
        [c[0] + value, c[1] + slope]
    }

    /// Returns value and slope without their first terms. Four sums run in parallel, each from its smallest to its largest term.
    #[inline(always)]
    pub(super) fn later(&self, c: &Polynomial) -> [f64; 2] {
        let terms = registers::<R>(c);
        self.0.each_ref().map(|weights| {
            let sums = (0..R).rev().fold(f64x4::ZERO, |sums, i| terms[i].mul_add(weights[i], sums));
            sums.reduce_add()
        })
    }
}

/// Finds the only root in an interval by Halley's method, or by bisection where that leaves the interval. Each change is about the cube of
/// the one before, so the next change is known from the last two.
fn root<const R: usize>(c: &Polynomial, [mut lo, mut hi]: [f64; 2], guess: f64) -> f64 {
    let (mut u, mut last) = (guess, 0.0);
    for _ in 0..ROOT_STEP_CAP {
        let [value, slope, curvature] = derivatives::<R>(c, u);
        if value > 0.0 {
            lo = u;
        } else {
            hi = u;
        }
        let newton = value / slope;
        let change = newton / (1.0 - 0.5 * newton * curvature / slope).max(0.5);
        let (next, least) = (u - change, 0.5 * f64::EPSILON * u);
        let later = change * (change / last).powi(3);
        if change.abs() <= least || later.abs() <= least || hi - lo <= f64::EPSILON * hi {
            return next.clamp(lo, hi);
        }
        (u, last) = if next > lo && next < hi { (next, change) } else { (0.5 * (lo + hi), 0.0) };
    }
    u
}

/// Returns value, slope and second derivative of a polynomial. It is `p . v(q)` with `p = (1, u, u^2, u^3)` and `q = u^4`.
#[inline(always)]
fn derivatives<const R: usize>(c: &Polynomial, u: f64) -> [f64; 3] {
    let (c, x) = (registers::<R>(c), f64x4::splat);
    let (square, cube) = (u * u, u * u * u);
    let q = x(square * square);
    let [mut v, mut v1, mut v2] = [c[R - 1], f64x4::ZERO, f64x4::ZERO];
    for c in c[..R - 1].iter().rev() {
        v2 = v2.mul_add(q, v1);
        v1 = v1.mul_add(q, v);
        v = v.mul_add(q, *c);
    }
    let p = f64x4::new([1.0, u, square, cube]);
    let p1 = f64x4::new([0.0, 1.0, 2.0 * u, 3.0 * square]);
    let p2 = f64x4::new([0.0, 0.0, 2.0, 6.0 * u]);
    let (dq, ddq, along) = (x(4.0 * cube), x(12.0 * square), p * v1);
    [
        (p * v).reduce_add(),
        along.mul_add(dq, p1 * v).reduce_add(),
        (p2 * v + x(2.0) * (dq * (p1 * v1) + dq * dq * (p * v2)) + ddq * along).reduce_add(),
    ]
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
        for (roots, registers) in cases.into_iter().flat_map(|roots| (3..=6).map(move |r| (roots, r))) {
            let Fall::At(found) = first_fall(&with_roots(roots), None, 0, 0.0, registers) else {
                panic!("no root of {roots:?}")
            };
            let error = (found - roots[0]).abs() / roots[0];
            let conditioned = if roots.len() == 2 { 1e-9 } else { 1e-14 };
            assert!(error < conditioned, "{roots:?}: {found}, {error:e}");
        }
        for roots in [&[1.1][..], &[2.0, 3.0], &[]] {
            for registers in 3..=6 {
                assert_eq!(first_fall(&with_roots(roots), None, 0, 0.0, registers), Fall::None);
            }
        }
    }

    #[test]
    fn a_function_that_stays_positive_by_little_has_no_root() {
        // (u - 0.4)^2 + lift
        for lift in [1e-3, 1e-9, 1e-13] {
            let mut c = with_roots(&[0.4, 0.4]);
            c[0] += lift;
            for registers in 3..=6 {
                assert_eq!(first_fall(&c, None, 0, 0.0, registers), Fall::None, "{lift:e}");
            }
        }
        assert_eq!(first_fall(&with_roots(&[0.4, 0.4]), None, 0, 0.0, MOST_REGISTERS), Fall::Touches);
    }

    #[test]
    fn a_root_at_the_start_is_divided_out() {
        let mut c = [0.0; ORDER + 1];
        (c[1], c[2]) = (1e-20, -1e-20 / 0.25);
        let Fall::At(found) = first_fall(&c, None, 1, 1.0, MOST_REGISTERS) else { panic!("no root") };
        assert!((found - 0.25).abs() < 1e-15);
        (c[1], c[2]) = (-1.0, 3.0);
        assert_eq!(first_fall(&c, None, 1, 0.0, MOST_REGISTERS), Fall::At(0.0));
    }
}
