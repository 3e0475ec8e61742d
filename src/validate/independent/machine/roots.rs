//! Finds the first zero of a function on a step, from its values and three derivatives at both ends.

/// Number of coefficients of the polynomial of degree 7 through both ends.
const COEFFICIENTS: usize = 8;

/// Relative size below which values are rounding errors.
const ROUNDING: f64 = 1e-15;

/// Largest number of halvings of a step in which several zeros may lie.
const HALVINGS: u32 = 40;

/// Binomial coefficients of 7.
const CHOOSE: [f64; COEFFICIENTS] = [1.0, 7.0, 21.0, 35.0, 35.0, 21.0, 7.0, 1.0];

/// Returns the share of a step of length `h` at which a function first falls below 0. `ends` are its values and derivatives at both ends.
/// If `order` is above 0, the function rises from a root of this order at the start.
pub(super) fn first_fall(ends: [[f64; 4]; 2], h: f64, order: usize) -> Option<f64> {
    let mut scaled = ends;
    for end in &mut scaled {
        end.iter_mut().fold(1.0, |power, x| {
            *x *= power;
            power * h
        });
    }
    scaled[0][..order].fill(0.0);
    let mut bernstein = [0.0; COEFFICIENTS];
    for k in 0..4 {
        let [mut from_start, mut from_end] = [0.0; 2];
        let mut binomial = 1.0;
        for (j, share) in [1.0, 1.0 / 7.0, 1.0 / 42.0, 1.0 / 210.0].into_iter().enumerate().take(k + 1) {
            from_start += binomial * share * scaled[0][j];
            from_end += binomial * share * scaled[1][j] * if j % 2 == 0 { 1.0 } else { -1.0 };
            binomial *= (k - j) as f64 / (j + 1) as f64;
        }
        (bernstein[k], bernstein[COEFFICIENTS - 1 - k]) = (from_start, from_end);
    }
    // The zero at the start is divided out.
    let mut binomial = 1.0;
    let degree = COEFFICIENTS - 1 - order;
    for k in 0..=degree {
        bernstein[k] = bernstein[k + order] * CHOOSE[k + order] / binomial;
        binomial *= (degree - k) as f64 / (k + 1) as f64;
    }
    let least = ROUNDING * bernstein[..=degree].iter().fold(0.0f64, |most, x| most.max(x.abs()));
    fall_within(&bernstein[..=degree], 0.0, 1.0, least, HALVINGS)
}

/// Returns where a polynomial with these Bernstein coefficients first falls below 0 on an interval. None if all coefficients are below
/// `least`, because only rounding would decide.
fn fall_within(coefficients: &[f64], from: f64, width: f64, least: f64, halvings: u32) -> Option<f64> {
    let mut signs = coefficients.iter().filter(|x| **x != 0.0).map(|x| *x < 0.0);
    let mut is_negative = signs.next()?;
    if is_negative {
        return Some(from);
    }
    let mut changes = 0;
    for sign in signs {
        changes += usize::from(sign != is_negative);
        is_negative = sign;
    }
    let (mut left, mut right) = halves(coefficients);
    let [left, right] = [&mut left, &mut right].map(|half| &half[..coefficients.len()]);
    match changes {
        0 => None,
        1 => Some(from + width * only_root(coefficients)),
        _ if halvings == 0 || coefficients.iter().all(|x| x.abs() <= least) => None,
        _ => fall_within(left, from, 0.5 * width, least, halvings - 1)
            .or_else(|| fall_within(right, from + 0.5 * width, 0.5 * width, least, halvings - 1)),
    }
}

/// Returns the coefficients on both halves of an interval.
fn halves(coefficients: &[f64]) -> ([f64; COEFFICIENTS], [f64; COEFFICIENTS]) {
    let count = coefficients.len();
    let (mut left, mut right) = ([0.0; COEFFICIENTS], [0.0; COEFFICIENTS]);
    right[..count].copy_from_slice(coefficients);
    for (k, left) in left.iter_mut().enumerate().take(count) {
        *left = right[0];
        for i in 0..count - 1 - k {
            right[i] = 0.5 * (right[i] + right[i + 1]);
        }
    }
    (left, right)
}

/// Returns the only root in `[0, 1]`, by bisection.
fn only_root(coefficients: &[f64]) -> f64 {
    let value = |u: f64| {
        let mut c = [0.0; COEFFICIENTS];
        c[..coefficients.len()].copy_from_slice(coefficients);
        for count in (1..coefficients.len()).rev() {
            (0..count).for_each(|i| c[i] += u * (c[i + 1] - c[i]));
        }
        c[0]
    };
    let (mut low, mut high) = (0.0, 1.0);
    while high - low > 2.0 * f64::EPSILON * high {
        let middle = 0.5 * (low + high);
        if value(middle) > 0.0 { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns value and derivatives of a polynomial.
    fn jet(coefficients: &[f64], x: f64) -> [f64; 4] {
        let mut c = coefficients.to_vec();
        std::array::from_fn(|_| {
            let value = c.iter().rev().fold(0.0, |sum, c| sum * x + c);
            c = c.iter().enumerate().skip(1).map(|(k, c)| k as f64 * c).collect();
            value
        })
    }

    fn fall(coefficients: &[f64], h: f64, order: usize) -> Option<f64> {
        first_fall([0.0, h].map(|x| jet(coefficients, x)), h, order).map(|share| share * h)
    }

    #[test]
    fn the_first_fall_is_found() {
        let near = |found: Option<f64>, exact: f64| (found.unwrap() - exact).abs() < 1e-13;
        // (x - 0.2) (x - 0.21) (x - 0.8) changes its sign from + to - at 0.21; mirrored at 0.2.
        let cubic = [-0.0336, 0.37, -1.21, 1.0];
        assert!(near(fall(&cubic, 1.0, 0), 0.0), "it is negative at the start");
        assert!(near(fall(&cubic.map(|c| -c), 1.0, 0), 0.2));
        assert_eq!(fall(&cubic.map(|c| -c), 0.19, 0), None);
        // x (0.3 - x), x^2 (0.3 - x) and x^3 (0.3 - x) leave 0 and return.
        assert!(near(fall(&[0.0, 0.3, -1.0], 2.0, 1), 0.3));
        assert!(near(fall(&[0.0, 0.0, 0.3, -1.0], 0.5, 2), 0.3));
        assert!(near(fall(&[0.0, 0.0, 0.0, 0.3, -1.0], 1.0, 3), 0.3));
        // (x - 0.5)^2 + 1e-10 stays above 0; (x - 0.5)^2 - 1e-10 falls below it.
        assert_eq!(fall(&[0.25 + 1e-10, -1.0, 1.0], 1.0, 0), None);
        assert!((fall(&[0.25 - 1e-10, -1.0, 1.0], 1.0, 0).unwrap() - (0.5 - 1e-5)).abs() < 1e-9);
    }
}
