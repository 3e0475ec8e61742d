//! Results of methods and their errors.

use super::EVENTS;
use rattlemap::record::distance::{apart, farther};
use rattlemap_dynamics::model::{State, state};

/// The result of a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// The last strobe state.
    pub state: State,
    /// Times of the last events since phase 0, the latest first; NaN if there was none or the method does not report it.
    pub events: [f64; EVENTS],
}

/// Errors of a result; infinite if the lane failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Error {
    /// Largest difference of a component of the state.
    pub state: f64,
    /// Largest difference of event times; `None` if the cell has no events.
    pub event: Option<f64>,
}

impl Outcome {
    /// Returns the result of a lane that failed.
    pub fn lost() -> Outcome {
        Outcome { state: state(&[f64::NAN; 4]), events: [f64::NAN; EVENTS] }
    }

    /// Returns the difference from the `exact` result, with forcing period `period`.
    pub fn error(&self, exact: &Outcome, period: f64) -> Error {
        let differences = self.state.iter().zip(&exact.state).map(|(&a, &b)| apart(a, b));
        let state = differences.fold(0.0, farther);
        let times = self.events.iter().zip(&exact.events).filter(|(_, exact)| !exact.is_nan());
        // An event at phase 0 may belong to either period.
        let either = |(&a, &b): (&f64, &f64)| {
            let d = apart(a, b);
            d.min(apart(period, d))
        };
        Error { state, event: times.map(either).reduce(farther) }
    }
}

/// Returns the median and the largest error; zero for an empty list. No error may be NaN.
pub fn median_and_worst(mut errors: Vec<f64>) -> [f64; 2] {
    errors.sort_by(f64::total_cmp);
    let last = errors.len().saturating_sub(1);
    [last / 2, last].map(|i| errors.get(i).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_the_largest_difference() {
        let exact = Outcome { state: state(&[1.0, 2.0, 3.0, 4.0]), events: [0.1, f64::NAN] };
        let near = Outcome { state: state(&[1.0, 2.5, 3.0, 4.25]), events: [0.9, 0.3] };
        assert_eq!(near.error(&exact, 1.0).state, 0.5);
        assert!((near.error(&exact, 1.0).event.unwrap() - 0.2).abs() < 1e-15, "across phase 0");
        let lost = Outcome::lost().error(&exact, 1.0);
        assert_eq!((lost.state, lost.event), (f64::INFINITY, Some(f64::INFINITY)));
        assert_eq!(exact.error(&exact, 1.0), Error { state: 0.0, event: Some(0.0) });
        assert_eq!(median_and_worst(vec![3.0, 1.0, 2.0]), [2.0, 3.0]);
    }
}
