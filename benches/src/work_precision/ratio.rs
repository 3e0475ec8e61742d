//! Ratios of run time at equal error.

use super::points::Point;

/// A statistic of the errors of states over the subjects.
type Statistic = fn(&Point) -> f64;

const WORST: Statistic = |point| point.state_error_worst;
const MEDIAN: Statistic = |point| point.state_error_median;

/// Returns the cost of a method with at most this error, in seconds per lane-period ([`Point::cost`]); `None` if its error is
/// larger at every setting. Between two settings the logarithm of the cost is interpolated. The cost is never less than that
/// of the cheapest setting.
fn cost_at(points: &[&Point], statistic: Statistic, error: f64) -> Option<f64> {
    let mut sorted: Vec<&&Point> = points.iter().collect();
    sorted.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
    let good = sorted.iter().position(|point| statistic(point) <= error)?;
    let here = sorted[good];
    let Some(before) = good.checked_sub(1).map(|i| sorted[i]) else { return Some(here.cost()) };
    let (from, to) = (statistic(before), statistic(here));
    if !from.is_finite() || to <= 0.0 {
        return Some(here.cost());
    }
    let share = (from / error).ln() / (from / to).ln();
    Some(before.cost() * (here.cost() / before.cost()).powf(share))
}

/// Returns the smallest error of a method at any setting.
fn best_error(points: &[&Point], statistic: Statistic) -> f64 {
    points.iter().map(|point| statistic(point)).fold(f64::INFINITY, f64::min)
}

/// The error at which methods are compared.
const EQUAL_ERROR: f64 = 1e-5;

/// Methods that are compared at [`EQUAL_ERROR`]: ours, the other one, and a description of the other one.
const PAIRS: [(&str, &str, &str); 7] = [
    ("lane-f32", "rk4-wgsl-f32", "RK4 in WGSL, f32"),
    ("lane-f64", "rk4-wgsl-f64", "RK4 in WGSL, f64"),
    ("lane-f32", "rk4-phased-f32", "RK4 in WGSL in two phases, f32"),
    ("lane-f64", "rk4-phased-f64", "RK4 in WGSL in two phases, f64"),
    ("reference", "rk4-core", "RK4 in Rust on one core"),
    ("reference", "dop853-core", "DOP853 on one core"),
    (REFERENCE_WITH_PEERS, "rk4-numba", "RK4 in numba on one core"),
];

/// The reference, timed alternately with peers.
const REFERENCE_WITH_PEERS: &str = "reference-beside-peers";

/// Returns sentences with the ratios of a table of points.
pub fn sentences(points: &[Point]) -> Vec<String> {
    let curve = |name: &str| points.iter().filter(|point| point.method == name).collect::<Vec<_>>();
    let mut all = Vec::new();
    for (ours, theirs, words) in PAIRS {
        let (own, other) = (curve(ours), curve(theirs));
        if own.is_empty() || other.is_empty() {
            continue;
        }
        for (statistic, of) in [(WORST, "worst"), (MEDIAN, "median")] {
            all.push(
                match (cost_at(&own, statistic, EQUAL_ERROR), cost_at(&other, statistic, EQUAL_ERROR)) {
                    (Some(a), Some(b)) => format!(
                        "{ours}: {} {words} at a {of} error of {EQUAL_ERROR:e} ({:.3} against {:.3} us)",
                        comparison(a, b),
                        1e6 * a,
                        1e6 * b
                    ),
                    (Some(_), None) => {
                        let best = best_error(&other, statistic);
                        format!("{words} reaches no {of} error below {best:.1e}; {ours} does")
                    }
                    (None, _) => {
                        let best = best_error(&own, statistic);
                        format!("{ours} reaches no {of} error below {best:.1e}")
                    }
                },
            );
        }
    }
    let (lane, rk4) = (curve("lane-f64"), curve("rk4-wgsl-f64"));
    if !lane.is_empty() && !rk4.is_empty() {
        let [[a, b], [c, d]] = [WORST, MEDIAN].map(|of| [&lane, &rk4].map(|curve| best_error(curve, of)));
        all.push(format!(
            "smallest error at any setting in f64, lane against RK4 in WGSL: worst {a:.1e} against {b:.1e}, median \
             {c:.1e} against {d:.1e}"
        ));
    }
    if let [reference] = curve(REFERENCE_WITH_PEERS)[..] {
        for heyoka in curve("heyoka") {
            all.push(format!(
                "reference: {:.1} times less time than heyoka at tolerance {:e} with a worst error of {:.1e}, median \
                 {:.1e} ({:.3} against {:.3} us on one core)",
                heyoka.cost() / reference.cost(),
                heyoka.tolerance.unwrap_or(f64::NAN),
                heyoka.state_error_worst,
                heyoka.state_error_median,
                1e6 * reference.cost(),
                1e6 * heyoka.cost()
            ));
        }
    }
    all
}

/// Compares two times in words.
fn comparison(ours: f64, theirs: f64) -> String {
    if ours <= theirs {
        format!("{:.1} times less time than", theirs / ours)
    } else {
        format!("{:.1} times as much time as", ours / theirs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, error: f64, cores: Option<u32>) -> Point {
        Point {
            method: String::new(),
            device: String::new(),
            precision: String::new(),
            steps: None,
            tolerance: None,
            cores,
            lanes: 1,
            periods: 1,
            rounds: 1,
            seconds_per_lane_period: seconds,
            fastest: seconds,
            slowest: seconds,
            state_error_median: error,
            state_error_worst: 10.0 * error,
            event_error_median: 0.0,
            event_error_worst: 0.0,
            lost: 0,
        }
    }

    #[test]
    fn costs_are_interpolated_between_settings() {
        let (coarse, fine) = (point(1.0, 1e-4, Some(2)), point(2.0, 1e-6, Some(2)));
        let curve = [&fine, &coarse];
        let cost = |error| cost_at(&curve, MEDIAN, error);
        assert!(
            (cost(1e-5).unwrap() - 2.0 * 2f64.sqrt()).abs() < 1e-12,
            "the middle of the line, on two cores"
        );
        assert_eq!(cost(1e-3), Some(2.0), "never below the cheapest setting");
        assert_eq!(cost(1e-7), None);
        assert_eq!(cost_at(&curve, WORST, 1e-3), Some(2.0));
        assert!((best_error(&curve, WORST) - 1e-5).abs() < 1e-18);
        let lost = point(0.5, f64::INFINITY, Some(2));
        assert_eq!(cost_at(&[&lost, &coarse], MEDIAN, 1e-3), Some(2.0), "no interpolation from a lost lane");
    }
}
