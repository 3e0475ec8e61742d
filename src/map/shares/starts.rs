//! Starts of a sample: points of scrambled Sobol sequences (Burley 2020), one sequence for each replicate.

use sobol_burley::sample;

use crate::map::scene::{REPLICATES, Sample, Spread};
use rattlemap_dynamics::model::{REST, State};

/// Returns the start `nth` of a sample for a model with `components` components of the state. Consecutive starts belong to different
/// replicates.
pub(super) fn start(of: &Sample, components: usize, nth: u32) -> State {
    let seed = of.seed.wrapping_mul(REPLICATES).wrapping_add(nth % REPLICATES);
    let mut state = REST;
    for (i, component) in state.iter_mut().enumerate().take(components) {
        let share = f64::from(sample(nth / REPLICATES, i as u32, seed));
        *component = match &of.spread {
            Spread::Box([low, high]) => low[i] + share * (high[i] - low[i]),
            Spread::Normal([mean, deviation]) => mean[i] + deviation[i] * normal(share),
        };
    }
    state
}

/// Returns the quantile of the standard normal distribution, within `1e-8` (Newton's method on its distribution function).
fn normal(share: f64) -> f64 {
    // The smallest share of the sequence is 0, and single-precision numbers end at 2^-24.
    let share = share.clamp(0.5 * f64::from(f32::EPSILON), 1.0 - 0.5 * f64::from(f32::EPSILON));
    let below = |x: f64| 0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
    let density = |x: f64| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
    let (mut low, mut high) = (-6.0, 6.0);
    let mut x: f64 = 0.0;
    for _ in 0..60 {
        let off = below(x) - share;
        if off > 0.0 {
            high = x
        } else {
            low = x
        }
        let next = x - off / density(x);
        let next = if (low..=high).contains(&next) { next } else { 0.5 * (low + high) };
        let moved = (next - x).abs();
        x = next;
        if moved < 1e-9 {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::state;

    #[test]
    fn starts_fill_their_distribution_evenly() {
        let count = 2048;
        let of = |spread| Sample { spread, count, seed: 3, width: None };
        let (low, high) = (state(&[-1.0, 2.0]), state(&[3.0, 2.5]));
        let boxed = of(Spread::Box([low, high]));
        let mean = |at: &dyn Fn(&State) -> f64, of: &Sample| {
            (0..count).map(|nth| at(&start(of, 2, nth))).sum::<f64>() / f64::from(count)
        };
        assert!((mean(&|y| y[0], &boxed) - 1.0).abs() < 2e-3);
        assert!((mean(&|y| y[1], &boxed) - 2.25).abs() < 5e-4);
        // A quarter lies in each quarter of the box.
        assert!((mean(&|y| f64::from(u8::from(y[0] < 1.0 && y[1] < 2.25)), &boxed) - 0.25).abs() < 2e-3);
        assert_eq!(start(&boxed, 2, 5)[2..], REST[2..]);
        let normal = of(Spread::Normal([state(&[1.0, 0.0]), state(&[2.0, 0.5])]));
        assert!((mean(&|y| y[0], &normal) - 1.0).abs() < 1e-2);
        assert!((mean(&|y| (y[0] - 1.0).powi(2), &normal).sqrt() - 2.0).abs() < 2e-2);
        // 68.27 % lie within one standard deviation.
        assert!((mean(&|y| f64::from(u8::from(y[1].abs() < 0.5)), &normal) - 0.6827).abs() < 5e-3);
    }

    #[test]
    fn replicates_and_seeds_have_different_starts() {
        let of = |seed| Sample {
            spread: Spread::Box([state(&[0.0, 0.0]), state(&[1.0, 1.0])]),
            count: 64,
            seed,
            width: None,
        };
        let all: Vec<State> = (0..64)
            .map(|nth| start(&of(1), 2, nth))
            .chain((0..64).map(|nth| start(&of(2), 2, nth)))
            .collect();
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b), "{i}");
        }
    }
}
