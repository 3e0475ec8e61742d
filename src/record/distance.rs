//! Distances of numbers. A value that is not finite is infinitely far from everything; `f64::max` would ignore it,
//! and a comparison would call it equal.

/// Returns the distance of two numbers; infinite if one of them is not finite.
pub fn apart(a: f64, b: f64) -> f64 {
    let distance = (a - b).abs();
    if distance.is_nan() { f64::INFINITY } else { distance }
}

/// Returns the larger of two distances; infinite if one of them is not a number.
pub fn farther(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// Whether a distance is at most `allowed`. An infinite distance never is.
pub fn is_within(distance: f64, allowed: f64) -> bool {
    distance.is_finite() && distance <= allowed
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOT_FINITE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

    #[test]
    fn values_that_are_not_finite_are_infinitely_far() {
        assert_eq!((apart(1.0, -2.5), farther(1.0, 2.0)), (3.5, 2.0));
        assert!(is_within(2.0, 2.0) && !is_within(2.0, 1.0) && !is_within(0.0, f64::NAN));
        for x in NOT_FINITE {
            for y in [0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert_eq!((apart(x, y), apart(y, x)), (f64::INFINITY, f64::INFINITY), "{x} {y}");
            }
        }
        let farthest = [0.0, f64::NAN, 1.0].into_iter().fold(0.0, farther);
        assert_eq!(farthest, f64::INFINITY);
        assert!(!is_within(farthest, f64::INFINITY));
    }
}
