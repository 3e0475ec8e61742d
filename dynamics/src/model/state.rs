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

/// Returns the first four numbers of a state, which a pair has.
#[inline]
pub(crate) fn first_four(y: &State) -> [f64; 4] {
    [y[0], y[1], y[2], y[3]]
}

/// Returns `a - b`.
#[inline]
pub(crate) fn difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Returns `a + b factor`.
#[inline]
pub(crate) fn sum<const N: usize>(a: &[f64; N], b: &[f64; N], factor: f64) -> [f64; N] {
    std::array::from_fn(|i| a[i] + b[i] * factor)
}

/// Returns the inner product. The terms of every four entries are added in pairs. `N` is a multiple of four.
#[inline]
pub(crate) fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let four = |a: &[f64; 4], b: &[f64; 4]| (a[0] * b[0] + a[2] * b[2]) + (a[1] * b[1] + a[3] * b[3]);
    let (a, b) = (a.as_chunks::<4>().0, b.as_chunks::<4>().0);
    a.iter().zip(b).skip(1).fold(four(&a[0], &b[0]), |sum, (a, b)| sum + four(a, b))
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
        assert_eq!(dot(&state(&all), &state(&all)), 1240.0);
    }
}
