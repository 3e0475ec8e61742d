//! Median and range of repeated measurements.

/// Median, minimum and maximum of a list of measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The middle value, or the mean of the two middle values.
    pub median: f64,
    /// The smallest value.
    pub low: f64,
    /// The largest value.
    pub high: f64,
}

impl Spread {
    /// Computes the spread of a list; all NaN if the list is empty.
    pub fn of(mut list: Vec<f64>) -> Spread {
        list.sort_by(f64::total_cmp);
        let Some((&low, &high)) = list.first().zip(list.last()) else {
            return Spread { median: f64::NAN, low: f64::NAN, high: f64::NAN };
        };
        let (below, above) = (list[(list.len() - 1) / 2], list[list.len() / 2]);
        Spread { median: 0.5 * (below + above), low, high }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_and_even_numbers() {
        assert_eq!(Spread::of(vec![3.0, 1.0, 2.0]), Spread { median: 2.0, low: 1.0, high: 3.0 });
        assert_eq!(Spread::of(vec![4.0, 1.0, 2.0, 3.0]), Spread { median: 2.5, low: 1.0, high: 4.0 });
        assert!(Spread::of(Vec::new()).median.is_nan());
    }
}
