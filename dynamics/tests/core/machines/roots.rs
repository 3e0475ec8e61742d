//! Roots of polynomials in the first unit, between the extrema.

fn value(c: &[f64], u: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * u + c)
}

/// Returns the points in (0, 1) at which a polynomial changes its sign. They lie between the extrema, one at most in each interval.
fn roots(c: &[f64]) -> Vec<f64> {
    if c.len() < 2 || c[0].abs() > c[1..].iter().map(|c| c.abs()).sum() {
        return Vec::new();
    }
    let slope: Vec<f64> = (1..c.len()).map(|k| k as f64 * c[k]).collect();
    let mut found = Vec::new();
    let mut from = 0.0;
    for to in roots(&slope).into_iter().chain([1.0]) {
        let (mut lo, mut hi) = (from, to);
        let sign = value(c, lo);
        if sign * value(c, hi) < 0.0 {
            while hi - lo > f64::EPSILON * hi {
                let middle = 0.5 * (lo + hi);
                if middle <= lo || middle >= hi {
                    break;
                }
                if sign * value(c, middle) > 0.0 { lo = middle } else { hi = middle }
            }
            found.push(hi);
        }
        from = to;
    }
    found
}

/// Returns where a polynomial falls below zero in [0, 1]: at 0 if it starts there. `is_divided` means that roots at 0 were divided out.
pub(crate) fn first_fall(c: &[f64], is_divided: bool) -> Option<f64> {
    let starts_below = c[0] < 0.0 || c[0] == 0.0 && !is_divided;
    if starts_below { Some(0.0) } else { roots(c).first().copied() }
}
