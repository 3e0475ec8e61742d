//! Round ends for scales.

/// Share of the values that may lie beyond the end of a scale: a few extremes should not
/// take all contrast from the rest.
const BEYOND: f64 = 0.005;

/// A round number that few of the `sizes` exceed; 1 if there is nothing to show.
pub(crate) fn nice_bound(sizes: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = sizes.filter(|size| size.is_finite()).collect();
    if sizes.is_empty() {
        return 1.0;
    }
    let rank = ((sizes.len() - 1) as f64 * (1.0 - BEYOND)).ceil() as usize;
    let bound = *sizes.select_nth_unstable_by(rank, f64::total_cmp).1;
    if bound <= 0.0 {
        return 1.0;
    }
    // Tenths as quotients: 6 * 0.1 is no 0.6.
    let exponent = bound.log10().floor();
    let (over, under) =
        if exponent < 0.0 { (1.0, 10f64.powf(-exponent)) } else { (10f64.powf(exponent), 1.0) };
    let steps = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    steps
        .map(|step| step * over / under)
        .into_iter()
        .find(|end| *end >= bound * (1.0 - 1e-9))
        .unwrap_or(10.0 * over / under)
}

#[cfg(test)]
mod tests {
    use crate::show::layers::scale::nice_bound;

    #[test]
    fn bounds_are_round_and_ignore_extremes() {
        assert_eq!(nice_bound([].into_iter()), 1.0);
        assert_eq!(nice_bound([0.0, 0.0].into_iter()), 1.0);
        assert_eq!(nice_bound((0..100).map(f64::from)), 100.0);
        assert_eq!(nice_bound([0.055, 0.55].into_iter()), 0.6);
        assert_eq!(nice_bound((0..1000).map(|i| if i == 0 { 1e9 } else { 0.23 })), 0.25);
    }
}
