//! Colour bars: the range of numbers that a range of colours represents.

use std::borrow::Cow;

use crate::show::color::Color;
use crate::show::drawing::axis::Axis;
use crate::show::symbols::number;

/// Largest share of the values that may lie beyond an end of a bar. A few extreme values must not take the contrast from
/// the others.
pub(crate) const LARGEST_SHARE_BEYOND: f64 = 0.005;

/// A range of colours that represents a range of numbers.
#[derive(Clone, Debug)]
pub struct Bar {
    pub(crate) label: Cow<'static, str>,
    pub(crate) colors: Vec<Color>,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Whether the range belongs to the quantity: the ends of an angle have one colour.
    pub(crate) is_fixed: bool,
    /// Numbers of cells below `low` and above `high`.
    pub(crate) beyond: [usize; 2],
}

impl Bar {
    /// Returns the axis of the numbers.
    pub(crate) fn axis(&self) -> Axis {
        Axis::exact(&self.label, self.low, self.high)
    }

    /// Whether the numbers are angles: both ends have one colour.
    pub(crate) fn is_angle(&self) -> bool {
        self.colors.first() == self.colors.last()
    }

    /// Returns numbers and the indices of their colours: both ends, and zero if there are negative numbers. Between them, indices
    /// are linear.
    pub(crate) fn anchors(&self) -> Vec<(f64, f64)> {
        let last = (self.colors.len() - 1) as f64;
        let zero = (self.low < 0.0).then(|| (0.0, -self.low / (self.high - self.low) * last));
        [Some((self.low, 0.0)), zero, Some((self.high, last))].into_iter().flatten().collect()
    }

    /// Returns one sentence for each end of the bar beyond which cells lie. `total` is the number of all cells.
    pub(crate) fn remarks(&self, total: usize) -> Vec<String> {
        let [below, above] = self.beyond;
        let sides = [(above, "above", self.high), (below, "below", self.low)];
        let sides = sides.into_iter().filter(|(cells, ..)| *cells > 0);
        sides
            .map(|(cells, side, end)| format!("values {side} {}: {}", number(end), share(cells, total)))
            .collect()
    }
}

/// Formats a number of cells as a share of all, or as a number if the share is small.
pub(crate) fn share(cells: usize, total: usize) -> String {
    let percent = 100.0 * cells as f64 / total as f64;
    match cells {
        _ if percent >= 0.1 => format!("{percent:.1} %"),
        1 => "1 cell".to_owned(),
        cells => format!("{cells} cells"),
    }
}

/// Counts the values below and above the ends of a bar.
pub(crate) fn count_beyond(values: impl Iterator<Item = f64>, low: f64, high: f64) -> [usize; 2] {
    values.fold([0, 0], |[below, above], value| {
        [below + usize::from(value < low), above + usize::from(value > high)]
    })
}

/// Returns a round number that only few of the `sizes` exceed, or 1 if there is no positive size.
pub(crate) fn round_bound(sizes: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = sizes.filter(|size| size.is_finite()).collect();
    if sizes.is_empty() {
        return 1.0;
    }
    let rank = ((sizes.len() - 1) as f64 * (1.0 - LARGEST_SHARE_BEYOND)).ceil() as usize;
    let bound = *sizes.select_nth_unstable_by(rank, f64::total_cmp).1;
    if bound <= 0.0 {
        return 1.0;
    }
    // Division by 10 gives the nearest number to 0.6; multiplication by 0.1 does not.
    let exponent = bound.log10().floor();
    let (over, under) =
        if exponent < 0.0 { (1.0, 10f64.powf(-exponent)) } else { (10f64.powf(exponent), 1.0) };
    let steps = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let mut ends = steps.map(|step| step * over / under).into_iter();
    ends.find(|end| *end >= bound * (1.0 - 1e-9)).unwrap_or(10.0 * over / under)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_round_and_ignore_extremes() {
        assert_eq!(round_bound([].into_iter()), 1.0);
        assert_eq!(round_bound([0.0, 0.0].into_iter()), 1.0);
        assert_eq!(round_bound((0..100).map(f64::from)), 100.0);
        assert_eq!(round_bound([0.055, 0.55].into_iter()), 0.6);
        assert_eq!(round_bound((0..1000).map(|i| if i == 0 { 1e9 } else { 0.23 })), 0.25);
    }
}
