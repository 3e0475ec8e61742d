//! The first root of a polynomial on a step.
//!
//! In Bernstein form, the number of roots in an interval is at most the number of sign changes of the coefficients, and one sign change
//! means exactly one root (Descartes' rule). Other intervals are halved by de Casteljau's algorithm.

/// Order of the Taylor polynomial of a step. There are four times a whole number of coefficients, for products of registers.
pub(super) const ORDER: usize = 23;

/// Coefficients of a polynomial in powers of the share of the step.
pub(super) type Polynomial = [f64; ORDER + 1];

/// Halvings after which a function that is not decided touches zero within rounding.
const MOST_HALVINGS: u32 = 48;

/// Largest number of steps of the final root search.
const ROOT_CAP: u32 = 200;

/// Rounding error of a coefficient, relative to the sum of all.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

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

/// Returns the sum of the sizes of all coefficients but the first.
pub(super) fn rest(c: &Polynomial) -> f64 {
    let mut sums = [0.0; 4];
    for c in c.chunks_exact(4) {
        (0..4).for_each(|i| sums[i] += c[i].abs());
    }
    sums[0] - c[0].abs() + sums[1] + (sums[2] + sums[3])
}

/// Finds the first root of a polynomial, divided by `u^order`; the coefficients below are zero but for rounding. An `order`
/// above [`MOST_ORDER`] means that all coefficients are zero. `size` bounds the terms that cancel in the coefficients.
pub(super) fn first_fall(polynomial: &Polynomial, order: usize, size: f64) -> Fall {
    if order > MOST_ORDER {
        return Fall::None;
    }
    let c = &polynomial[order..];
    let rest: f64 = c[1..].iter().map(|c| c.abs()).sum();
    let noise = ROUNDING * if order == 0 { rest + size } else { rest };
    if c[0] > rest + noise {
        return Fall::None;
    }
    if c[0] <= 0.0 {
        return Fall::At(0.0);
    }
    let mut touches = false;
    let b = combine(&BERNSTEIN[order], c);
    match isolate(&b[..c.len()], [0.0, 1.0], noise, 0, &mut touches) {
        Some((bracket, guess)) => Fall::At(root(c, bracket, guess)),
        None if touches => Fall::Touches,
        None => Fall::None,
    }
}

/// Largest order of a root at the start of a step.
const MOST_ORDER: usize = 18;

/// Columns of the matrices that give the Bernstein coefficients of a polynomial without its first `order` terms:
/// `b_i = sum_j C(i, j) / C(degree, j) c_j`.
static BERNSTEIN: [[Polynomial; ORDER + 1]; MOST_ORDER + 1] = {
    let mut all = [[[0.0; ORDER + 1]; ORDER + 1]; MOST_ORDER + 1];
    let mut order = 0;
    while order <= MOST_ORDER {
        let degree = ORDER - order;
        let mut i = 0;
        while i <= degree {
            let (mut j, mut entry) = (0, 1.0);
            while j <= i {
                all[order][j][i] = entry;
                entry *= (i - j) as f64 / (degree - j) as f64;
                j += 1;
            }
            i += 1;
        }
        order += 1;
    }
    all
};

/// Returns the sum of polynomials with given factors.
pub(super) fn combine(polynomials: &[Polynomial], factors: &[f64]) -> Polynomial {
    const PART: usize = 8;
    let mut sum = [0.0; ORDER + 1];
    // The sums of one part stay in registers.
    for part in 0..(ORDER + 1) / PART {
        let mut sums = [0.0; PART];
        for (polynomial, factor) in polynomials.iter().zip(factors) {
            let terms = &polynomial[part * PART..][..PART];
            (0..PART).for_each(|i| sums[i] += factor * terms[i]);
        }
        sum[part * PART..][..PART].copy_from_slice(&sums);
    }
    sum
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
        // Where the polygon of the coefficients, which is near the function, meets zero.
        let i = b.iter().position(|&b| b <= 0.0).unwrap_or(degree);
        let place = (i as f64 - b[i] / (b[i] - b[i - 1])) / degree as f64;
        return Some(([lo, hi], lo + (hi - lo) * place));
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

/// Powers of a share, and their derivatives, to evaluate several polynomials there. The first one of each is left out.
pub(super) struct Weights([Polynomial; 2]);

impl Weights {
    pub(super) fn at(share: f64) -> Weights {
        let mut weights = [[0.0; ORDER + 1]; 2];
        let [values, slopes] = &mut weights;
        let mut power = 1.0;
        for (k, (value, slope)) in values.iter_mut().zip(slopes).enumerate().skip(1) {
            *slope = if k == 1 { 0.0 } else { k as f64 * power };
            power *= share;
            *value = power;
        }
        Weights(weights)
    }

    /// Returns value and slope. Four sums run side by side, each from its smallest term on, and the largest term comes last.
    pub(super) fn of(&self, c: &Polynomial) -> [f64; 2] {
        let later = self.0.each_ref().map(|weights| {
            let mut sums = [0.0; 4];
            for (c, weights) in c.chunks_exact(4).zip(weights.chunks_exact(4)).rev() {
                (0..4).for_each(|i| sums[i] += c[i] * weights[i]);
            }
            sums[3] + sums[2] + sums[0] + sums[1]
        });
        [c[0] + later[0], c[1] + later[1]]
    }
}

/// Returns value and slope.
fn value(c: &[f64], u: f64) -> [f64; 2] {
    c.iter().rev().fold([0.0, 0.0], |[value, slope], c| [value * u + c, slope * u + value])
}

/// Finds the only root in an interval by Newton's method, or by bisection where that leaves the interval.
fn root(c: &[f64], [mut lo, mut hi]: [f64; 2], guess: f64) -> f64 {
    let mut u = guess;
    for _ in 0..ROOT_CAP {
        let [value, slope] = value(c, u);
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
            let Fall::At(found) = first_fall(&with_roots(roots), 0, 0.0) else {
                panic!("no root of {roots:?}")
            };
            let error = (found - roots[0]).abs() / roots[0];
            let conditioned = if roots.len() == 2 { 1e-9 } else { 1e-14 };
            assert!(error < conditioned, "{roots:?}: {found}, {error:e}");
        }
        for roots in [&[1.1][..], &[2.0, 3.0], &[]] {
            assert_eq!(first_fall(&with_roots(roots), 0, 0.0), Fall::None);
        }
    }

    #[test]
    fn a_function_that_stays_positive_by_little_has_no_root() {
        // (u - 0.4)^2 + lift
        for lift in [1e-3, 1e-9, 1e-13] {
            let mut c = with_roots(&[0.4, 0.4]);
            c[0] += lift;
            assert_eq!(first_fall(&c, 0, 0.0), Fall::None, "{lift:e}");
        }
        assert_eq!(first_fall(&with_roots(&[0.4, 0.4]), 0, 0.0), Fall::Touches);
    }

    #[test]
    fn a_root_at_the_start_is_divided_out() {
        let mut c = [0.0; ORDER + 1];
        (c[1], c[2]) = (1e-20, -1e-20 / 0.25);
        let Fall::At(found) = first_fall(&c, 1, 1.0) else { panic!("no root") };
        assert!((found - 0.25).abs() < 1e-15);
        (c[1], c[2]) = (-1.0, 3.0);
        assert_eq!(first_fall(&c, 1, 0.0), Fall::At(0.0));
    }
}
