//! One axis of a panel: its range, its scale and its label.

use crate::map::scene::Scale;

/// Margin between the data and each end of an axis, as a share of the data's span.
const PADDING: f64 = 0.06;
/// Values whose relative spread is at most `CONSTANT` count as one value. Their axis spans `CONSTANT_SPAN` of it.
const CONSTANT: f64 = 1e-9;
const CONSTANT_SPAN: f64 = 0.2;

/// An axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Text beside the axis.
    pub label: String,
    /// Lower end on the scale: a decimal logarithm on a logarithmic axis.
    pub low: f64,
    /// Upper end on the scale.
    pub high: f64,
    /// How values are placed: in proportion, by decimal logarithms, or in the order of a list, at 0, 1, 2 ...
    pub scale: Scale,
    /// Ascending values of a listed axis; empty for other scales.
    pub listed: Vec<f64>,
}

impl Axis {
    /// Returns a linear axis from `low` to `high`. It is widened if that range is empty or not finite.
    pub fn exact(label: &str, low: f64, high: f64) -> Axis {
        let (low, high) = if low.is_finite() && high.is_finite() { (low, high) } else { (0.0, 0.0) };
        let least = 1e-9 * low.abs().max(high.abs()).max(1e-6);
        let (low, high) = if high - low > least { (low, high) } else { (low - 0.5, low + 0.5) };
        Axis { label: label.to_owned(), low, high, scale: Scale::Linear, listed: Vec::new() }
    }

    /// Returns an axis of ascending values at equal distances, with half a distance beyond both ends.
    pub fn listed(label: &str, values: impl Iterator<Item = f64>) -> Axis {
        let listed: Vec<f64> = values.collect();
        let high = listed.len() as f64 - 0.5;
        Axis { listed, scale: Scale::Values, ..Axis::exact(label, -0.5, high) }
    }

    /// Returns a logarithmic axis that extends by `beyond` from the logarithms of two positive values.
    pub(crate) fn logarithmic(label: &str, [low, high]: [f64; 2], beyond: f64) -> Axis {
        let axis = Axis::exact(label, low.log10() - beyond, high.log10() + beyond);
        Axis { scale: Scale::Log, ..axis }
    }

    /// Returns a linear axis that holds all finite `values` with a margin.
    ///
    /// It spans at least `least_span`, so that rounding errors of a decayed motion do not fill a panel. An axis of
    /// constant values is wide enough for round tick labels.
    pub fn around(label: &str, values: impl Iterator<Item = f64>, least_span: f64) -> Axis {
        let Some((low, high)) = ends(values) else {
            return Axis::exact(label, -least_span / 2.0, least_span / 2.0);
        };
        let size = low.abs().max(high.abs());
        let is_constant = high - low <= CONSTANT * size;
        let least_span = if is_constant { least_span.max(CONSTANT_SPAN * size) } else { least_span };
        let room = PADDING * (high - low) + (least_span - (high - low)).max(0.0) / 2.0;
        Axis::exact(label, low - room, high + room)
    }

    /// Returns a logarithmic axis that holds all positive `values` with a margin and spans at least `least_decades`.
    pub fn around_logarithms(label: &str, values: impl Iterator<Item = f64>, least_decades: f64) -> Axis {
        let axis = Axis::around(label, values.filter(|v| *v > 0.0).map(f64::log10), least_decades);
        Axis { scale: Scale::Log, ..axis }
    }

    /// Returns a logarithmic axis of whole decades, at least one, that holds all positive `values`.
    pub fn decades(label: &str, values: impl Iterator<Item = f64>) -> Axis {
        let logarithms = values.filter(|v| *v > 0.0).map(f64::log10);
        let (low, high) = ends(logarithms).unwrap_or((-1.0, 1.0));
        let axis = Axis::exact(label, low.floor(), high.ceil().max(low.floor() + 1.0));
        Axis { scale: Scale::Log, ..axis }
    }

    /// Returns the value at a position on the scale. Between two listed values it is interpolated.
    pub(crate) fn value(&self, place: f64) -> f64 {
        match self.scale {
            Scale::Linear => place,
            Scale::Log => 10f64.powf(place),
            Scale::Values => {
                let last = self.listed.len() - 1;
                let place = place.clamp(0.0, last as f64);
                let before = place as usize;
                let [from, to] = [before, last.min(before + 1)].map(|i| self.listed[i]);
                from + (place - before as f64) * (to - from)
            }
        }
    }

    /// Returns the position of a value on the scale. Values beyond an end of a logarithmic axis are moved to that end.
    /// Values between two listed ones are moved to the upper one.
    pub(crate) fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Log => value.log10().clamp(self.low, self.high),
            Scale::Values => self.listed.partition_point(|listed| *listed < value) as f64,
        }
    }
}

/// Returns the smallest and the largest finite value.
fn ends(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) = finite.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
    (low <= high).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_constant_and_extreme_data_give_an_axis_of_positive_length() {
        let cases: [&[f64]; 5] = [&[], &[0.0, 0.0], &[f64::NAN], &[1e300, -1e300], &[1e-12, 1.1e-12]];
        for values in cases {
            let axis = Axis::around("", values.iter().copied(), 0.01);
            assert!(axis.high > axis.low, "{values:?}");
            let axis = Axis::around_logarithms("", values.iter().copied(), 0.8);
            assert!(axis.high - axis.low > 0.79, "{values:?}");
        }
    }

    #[test]
    fn the_axis_of_a_constant_spans_a_fifth_of_it() {
        for value in [0.2, -3.0, 1e-7, 4e8] {
            let axis = Axis::around("", [value, value * (1.0 + 1e-15)].into_iter(), 1e-6 * value.abs());
            let span = axis.high - axis.low;
            assert!((0.19..0.21).contains(&(span / value.abs())), "{value}: {span}");
        }
        let varied = Axis::around("", [1.0, 1.000_1].into_iter(), 1e-6);
        assert!(varied.high - varied.low < 2e-4, "{varied:?}");
    }
}
