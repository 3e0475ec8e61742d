//! A test whether a motion without a period is quasi-periodic: whether its strobe states lie on a torus.
//!
//! On a torus, averages with a smooth window converge faster than any power of the number of strobes; in chaos the error
//! shrinks as its square root (S. Das, Y. Saiki, E. Sander, J. A. Yorke, "Quantitative quasiperiodicity", Nonlinearity 30
//! (2017) 4111, arXiv 1601.06051 of 2016). So averages over two successive windows are compared (E. Sander, J. D. Meiss,
//! Physica D 411 (2020) 132569): of each displacement from the first strobe, and of the sum of their squares, which shows
//! whether a spiral shrinks. Velocities jump where an impact passes phase 0, and their averages converge slowly.

use super::recurrence::Metric;
use crate::model::{REST, State, difference};

/// Least number of strobe states in a window.
pub const LEAST_WINDOW: usize = 64;

/// Largest difference of the averages of two windows, as a share of the distance within which the motion recurs. Of 2,400
/// sequences of the logistic map, with windows of 64 to 200 strobes, none was below 0.0024 and half exceeded 0.06.
pub const LARGEST_DIFFERENCE: f64 = 1.0 / 1024.0;

/// Largest difference of the averages of a rate over two windows, relative to the size of the section. Of a motion that accelerates it is
/// about half.
const LARGEST_CHANGE_OF_RATES: f64 = 0.25;

/// Least distance within which the motion recurs, relative to the size of its section. Motion that recurs within less may approach a long
/// cycle.
pub const LEAST_RECURRENCE: f64 = 5e-3;

/// Largest rounding error of an average, in units of the machine epsilon times the displacements.
pub const ROUNDING_OF_AVERAGES: f64 = 16.0;

/// Power of `t (1 - t)` in the window, with `t` from 0 to 1. WGSL has no exponential function of f64, so the window is a polynomial; for
/// windows of up to 500 strobes it has lower side lobes than the exponential window.
const POWER: i32 = 4;

/// Whether averages over both halves of a sequence of strobe states agree.
pub(super) fn is_regular(strobes: &[State], metric: &Metric, max_period: u32) -> bool {
    let length = strobes.len() / 2;
    if length < LEAST_WINDOW {
        return false;
    }
    let centre = strobes[0];
    let [first, second] = [0, length].map(|from| averages(&strobes[from..][..length], &centre, metric));
    let changes: Vec<f64> = first.0.iter().zip(second.0).map(|(a, b)| (a - b).abs()).collect();
    let largest = |from: usize| changes[from..].iter().step_by(2).copied().fold(0.0, f64::max);
    let squares = (first.1 - second.1).abs();
    let distance = |lag: usize| {
        let squares = strobes.iter().zip(&strobes[lag..]).map(|(a, b)| metric.distance(a, b).powi(2));
        (squares.sum::<f64>() / (strobes.len() - lag) as f64).sqrt()
    };
    let nearest = (1..=length.min(max_period as usize)).map(distance).fold(f64::INFINITY, f64::min);
    let size = strobes.iter().map(|y| metric.distance(y, &centre)).fold(0.0, f64::max);
    let allowed = LARGEST_DIFFERENCE * nearest;
    let is_wide = nearest > LEAST_RECURRENCE * size && allowed > ROUNDING_OF_AVERAGES * f64::EPSILON;
    is_wide && largest(0) < allowed && squares < allowed * size && largest(1) < LARGEST_CHANGE_OF_RATES * size
}

/// Returns the weighted averages of all displacements and rates, from those of `centre`, in units of the metric, and of the sum of their
/// squares.
fn averages(strobes: &[State], centre: &State, metric: &Metric) -> (State, f64) {
    let (mut sums, mut squares, mut total) = (REST, 0.0, 0.0);
    for (n, y) in strobes.iter().enumerate() {
        let t = (n as f64 + 0.5) / strobes.len() as f64;
        let weight = (t * (1.0 - t)).powi(POWER);
        let y = metric.scaled(&difference(y, centre));
        sums.iter_mut().zip(&y).for_each(|(sum, x)| *sum += weight * x);
        squares += weight * y.iter().step_by(2).map(|x| x * x).sum::<f64>();
        total += weight;
    }
    (sums.map(|sum| sum / total), squares / total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{GearPair, state};
    use crate::motion::Flow;

    fn regular(state: impl FnMut(usize) -> State, count: usize) -> bool {
        let strobes: Vec<State> = (0..count).map(state).collect();
        let metric = Metric::of(&strobes, &Flow::new(&GearPair::paper(0.5).oscillator().unwrap()));
        is_regular(&strobes, &metric, 64)
    }

    #[test]
    fn a_rotation_is_regular_and_a_decaying_one_is_not() {
        let golden = std::f64::consts::TAU * 0.618_033_988_75;
        for size in [1.0, 1e-6] {
            let turning = |decay: f64| {
                move |n: usize| {
                    let (sin, cos) = (golden * n as f64).sin_cos();
                    let r = size * decay.powi(n as i32);
                    state(&[0.2 + cos * r, 5.6 * sin * r, 0.1 * sin * cos * r])
                }
            };
            assert!(regular(turning(1.0), 400), "size {size}");
            assert!(!regular(turning(1.0), 100), "too short");
            assert!(!regular(turning(1.0 - 1e-4), 400), "size {size}");
            assert!(!regular(turning(1.0 + 1e-4), 400), "size {size}");
        }
    }

    #[test]
    fn cycles_drift_and_chaotic_sequences_are_not_regular() {
        for period in [1, 3, 40] {
            assert!(!regular(|n| state(&[1.0 + (n % period) as f64]), 400), "period {period}");
        }
        assert!(!regular(|n| state(&[n as f64, 1.0]), 400));
        let turns = |n: usize| 3.88 * n as f64;
        assert!(regular(|n| state(&[turns(n).sin(), turns(n).cos()]), 400));
        assert!(!regular(|n| state(&[turns(n).sin(), turns(n).cos(), 0.0, n as f64]), 400), "acceleration");
        // Chaotic sequences that alternate between two narrow bands.
        for (seed, width) in (0..500).flat_map(|seed| [1.0, 0.05].map(|width| (seed, width))) {
            let mut x = 0.1 + 0.001 * f64::from(seed);
            let state = |n: usize| {
                x = 3.9 * x * (1.0 - x);
                state(&[(n % 2) as f64 + width * x])
            };
            assert!(!regular(state, 400), "seed {seed}, width {width}");
        }
    }
}
