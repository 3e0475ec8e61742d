//! States of oscillators, and arithmetic with them.

use super::MOST_COORDINATES;

/// Number of entries of a [`State`]: two for each coordinate.
pub const STATE: usize = 2 * MOST_COORDINATES;

/// State of an oscillator: displacement and velocity of each coordinate, `(x1, v1, x2, v2, ...)`, dimensionless. Entries beyond
/// the oscillator's coordinates are 0.
pub type State = [f64; STATE];

/// The state at rest.
pub const REST: State = [0.0; STATE];

/// Returns the state that begins with these values.
///
/// # Panics
/// If there are more than [`STATE`].
pub const fn state(values: &[f64]) -> State {
    let mut state = REST;
    let mut i = 0;
    while i < values.len() {
        state[i] = values[i];
        i += 1;
    }
    state
}

/// Returns `a - b`.
pub(crate) fn difference(a: &State, b: &State) -> State {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Returns `a + b factor`.
pub(crate) fn sum(a: &State, b: &State, factor: f64) -> State {
    std::array::from_fn(|i| a[i] + b[i] * factor)
}

/// Returns the inner product. The terms of every four entries are added in pairs.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let four = |a: &[f64], b: &[f64]| {
        let term = |i: usize| if i < a.len() { a[i] * b[i] } else { 0.0 };
        (term(0) + term(2)) + (term(1) + term(3))
    };
    a.chunks(4).zip(b.chunks(4)).map(|(a, b)| four(a, b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_begins_with_its_values() {
        const TWO: State = state(&[1.0, 2.0]);
        assert_eq!(TWO[..3], [1.0, 2.0, 0.0]);
        let all: Vec<f64> = (0..STATE).map(|i| i as f64).collect();
        assert_eq!(state(&all).to_vec(), all);
        assert_eq!(dot(&all[..7], &all[..7]), 91.0);
    }
}
