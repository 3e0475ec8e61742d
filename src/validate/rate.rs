//! Rates with confidence intervals, and the limit for unexplained cells.

/// Tolerated rate of unexplained cells.
pub const TOLERATED: f64 = 1e-4;

/// A stratum fails if its number of unexplained cells, or more, is less probable than this at the tolerated rate.
const SIGNIFICANCE: f64 = 0.01;

/// Probability that a confidence interval does not contain the true rate.
const OUTSIDE: f64 = 0.05;

/// Share of randomly drawn cells with a property, and its 95 % interval (Clopper and Pearson 1934).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    /// Number of cells with the property.
    pub count: usize,
    /// Number of drawn cells.
    pub among: usize,
    /// Ends of the interval. The interval is one-sided if `count` is 0 or `among`.
    pub interval: [f64; 2],
}

impl Rate {
    /// Computes the rate of `count` cells among `among`.
    pub fn new(count: usize, among: usize) -> Rate {
        if among == 0 {
            return Rate { count, among, interval: [0.0, 1.0] };
        }
        let (none, all) = (count == 0, count == among);
        let tail = if none || all { OUTSIDE } else { 0.5 * OUTSIDE };
        let low = if none { 0.0 } else { bisect(|p| at_least(count, among, p) < tail) };
        let high = if all { 1.0 } else { bisect(|p| at_least(count + 1, among, p) < 1.0 - tail) };
        Rate { count, among, interval: [low, high] }
    }

    /// Formats the rate as a percentage with its interval: `0.5 %, 0.06 to 1.8`, or `below 0.75 %` if `count` is 0.
    pub fn text(&self) -> String {
        self.text_within(1)
    }

    /// Formats the probability that an event of this rate happens within a number of trials.
    pub fn text_within(&self, trials: u32) -> String {
        let within = |rate: f64| match trials {
            1 => percent(100.0 * rate),
            trials => percent(-100.0 * (f64::from(trials) * (-rate).ln_1p()).exp_m1()),
        };
        let [low, high] = self.interval.map(within);
        match self.count {
            0 => format!("below {high} %"),
            count => format!("{} %, {low} to {high}", within(count as f64 / self.among.max(1) as f64)),
        }
    }

    /// Whether this number of unexplained cells exceeds one in 10,000 at 99 % confidence.
    pub fn is_too_many(&self) -> bool {
        self.count > 0 && at_least(self.count, self.among, TOLERATED) < SIGNIFICANCE
    }
}

/// Formats two significant digits below 10, and a whole number otherwise.
fn percent(value: f64) -> String {
    if value == 0.0 || value >= 9.95 {
        return format!("{value:.0}");
    }
    let decimals = (1.0 - value.log10().floor()).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Logarithm of a number that is zero in double precision.
const SMALLEST_LN: f64 = -746.0;

/// Returns the binomial probability of at least `count` successes in `among` trials of probability `p`.
fn at_least(count: usize, among: usize, p: f64) -> f64 {
    // Logarithms of the binomial terms, each computed from the one before.
    let (success, failure) = (p.ln(), (-p).ln_1p());
    let mut term = among as f64 * failure;
    let mut below = 0.0;
    for k in 0..count {
        below += term.exp();
        term += ((among - k) as f64 / (k + 1) as f64).ln() + success - failure;
    }
    // A small result would lose its digits in `1 - below`, so it is summed directly.
    if below < 0.5 {
        return 1.0 - below;
    }
    let mut above = 0.0;
    for k in count..=among {
        above += term.exp();
        // All later terms are smaller. The sum must stop early, because there may be as many trials as a map has forcing periods.
        if term < SMALLEST_LN {
            break;
        }
        if k < among {
            term += ((among - k) as f64 / (k + 1) as f64).ln() + success - failure;
        }
    }
    above
}

/// Returns the smallest probability for which `is_below` is false.
fn bisect(is_below: impl Fn(f64) -> bool) -> f64 {
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if is_below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_the_published_ones() {
        // Clopper and Pearson (1934), and the rule of three.
        for (count, among, low, high) in [
            (2, 400, 6.06e-4, 0.017943),
            (0, 400, 0.0, 0.0074612),
            (5, 10, 0.18709, 0.81291),
            (10, 10, 0.74113, 1.0),
        ] {
            let Rate { interval, .. } = Rate::new(count, among);
            assert!((interval[0] - low).abs() < 1e-5 && (interval[1] - high).abs() < 1e-5, "{interval:?}");
        }
        assert_eq!(Rate::new(2, 400).text(), "0.5 %, 0.061 to 1.8");
        assert_eq!(Rate::new(0, 400).text(), "below 0.75 %");
        assert_eq!(Rate::new(0, 0).interval, [0.0, 1.0]);
        // A map has millions of trials. For 260 events in 4 10^6 trials, the interval is that of a Poisson distribution (exact tables:
        // 229.4 and 293.6).
        let rate = Rate::new(260, 4_000_000);
        assert!((4e6 * rate.interval[0] - 229.4).abs() < 0.1 && (4e6 * rate.interval[1] - 293.6).abs() < 0.1);
        assert_eq!(rate.text_within(1000), "6.3 %, 5.6 to 7.1");
        assert_eq!(Rate::new(0, 4_000_000).text_within(1000), "below 0.075 %");
    }

    #[test]
    fn a_stratum_fails_by_what_chance_does_not_allow() {
        let fails = |count, among| Rate::new(count, among).is_too_many();
        // At a rate of 1e-4, one unexplained cell of 100 has a probability below 1 %. Of 200 cells, one may be unexplained, but not two.
        assert!(fails(1, 100) && !fails(1, 200) && fails(2, 200));
        assert!(!fails(0, 0) && !fails(4, 10_000) && fails(5, 10_000) && fails(262_144, 262_144));
    }
}
