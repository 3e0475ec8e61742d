//! Confidence intervals of measured shares.

/// The 97.5 % point of the normal distribution: ends of a two-sided 95 % interval.
pub(crate) const TWO_SIDED_95: f64 = 1.959964;

/// The 99.5 % point of the normal distribution: ends of a two-sided 99 % interval.
pub(crate) const TWO_SIDED_99: f64 = 2.575829;

/// Returns Wilson's score interval (J. Am. Stat. Assoc. 22, 1927) of the share `hits / sampled`. `z` is the point of
/// the normal distribution, such as [`TWO_SIDED_95`]. The interval is valid for small counts, too.
pub(crate) fn score_interval(hits: usize, sampled: usize, z: f64) -> [f64; 2] {
    let n = sampled.max(1) as f64;
    let rate = hits as f64 / n;
    let centre = rate + z * z / (2.0 * n);
    let half = z * (rate * (1.0 - rate) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z * z / n;
    [((centre - half) / scale).max(0.0), ((centre + half) / scale).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_agree_with_published_values() {
        // R: binom::binom.confint(10, 1000, methods = "wilson")
        let [low, high] = score_interval(10, 1000, TWO_SIDED_95);
        assert!((low - 0.005_441).abs() < 1e-5 && (high - 0.018_309).abs() < 1e-5, "{low} {high}");
        let [low, high] = score_interval(0, 2000, TWO_SIDED_95);
        assert!(low < 1e-12 && (high - 0.001_917).abs() < 1e-5, "{high}");
    }
}
