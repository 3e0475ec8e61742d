//! Time since the last phase 0, summed over many steps without loss.

/// A sum of steps that keeps what rounding takes from it.
///
/// A stiff oscillator takes thousands of steps in a period; added up plainly, each would lose
/// half a unit in the last place of the sum, and the strobe would fall that far from its phase.
///
/// W. Kahan, Further remarks on reducing truncation errors, Commun. ACM 8 (1965) 40.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    time: f64,
    /// What `time` is short of, at most half a unit in its last place.
    short: f64,
}

impl Clock {
    /// The time, to rounding.
    #[inline(always)]
    pub(super) fn time(&self) -> f64 {
        self.time
    }

    /// Exactly `time`.
    #[inline(always)]
    pub(super) fn set(&mut self, time: f64) {
        *self = Self { time, short: 0.0 };
    }

    /// A step later.
    #[inline(always)]
    pub(super) fn advance(&mut self, step: f64) {
        let step = step + self.short;
        let later = self.time + step;
        self.short = step - (later - self.time);
        self.time = later;
    }

    /// From now to `until`.
    #[inline(always)]
    pub(super) fn remaining(&self, until: f64) -> f64 {
        (until - self.time) - self.short
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_steps_end_within_a_rounding() {
        let mut clock = Clock::default();
        let (step, steps) = (0.1_f64, 1_000_000);
        let plain = (0..steps).fold(0.0, |sum, _| {
            clock.advance(step);
            sum + step
        });
        // 0.1 as a double, times a million, to the nearest double.
        let exact = step * f64::from(steps);
        assert!((clock.time() - exact).abs() <= f64::EPSILON * exact, "{} of {exact}", clock.time());
        assert!((plain - exact).abs() > 1e4 * f64::EPSILON, "plain sums have no need of this");
        assert!((clock.remaining(2.0 * exact) - exact).abs() <= f64::EPSILON * exact);
    }
}
