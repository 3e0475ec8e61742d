//! The time since the last phase 0, as a compensated sum over many steps.

/// A compensated sum of steps.
///
/// A stiff oscillator takes thousands of steps in a period. Simple addition would lose up to half a unit in the last
/// place in each step, and the strobe would not be at phase 0.
///
/// W. Kahan, Further remarks on reducing truncation errors, Commun. ACM 8 (1965) 40.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Clock {
    time: f64,
    /// Rounding error of `time`, at most half a unit in its last place.
    error: f64,
}

impl Clock {
    /// Returns the time, rounded.
    #[inline(always)]
    pub(crate) fn time(&self) -> f64 {
        self.time
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, time: f64) {
        *self = Self { time, error: 0.0 };
    }

    #[inline(always)]
    pub(crate) fn advance(&mut self, step: f64) {
        let step = step + self.error;
        let later = self.time + step;
        self.error = step - (later - self.time);
        self.time = later;
    }

    /// Returns the time from now to `until`.
    #[inline(always)]
    pub(crate) fn remaining(&self, until: f64) -> f64 {
        (until - self.time) - self.error
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
        let exact = step * f64::from(steps);
        assert!((clock.time() - exact).abs() <= f64::EPSILON * exact, "{} of {exact}", clock.time());
        assert!((plain - exact).abs() > 1e4 * f64::EPSILON, "a simple sum is as accurate: {plain}");
        assert!((clock.remaining(2.0 * exact) - exact).abs() <= f64::EPSILON * exact);
    }
}
