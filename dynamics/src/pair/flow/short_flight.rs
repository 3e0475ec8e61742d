//! Short flights from a wall, whose Taylor series proves when they end.
//!
//! The distance from the wall is `z(v) = v P(v)`, `v` in Taylor steps. Up to an eighth of a Taylor step, twelve terms are exact within
//! rounding for displacements and speeds: `0.2^12 / 12! < 1e-17`. If the second coefficient outweighs all later ones, the gap is
//! accelerated towards the wall until the root of `P`. Then that root is the first return, and the contact is pressed until then.

use wide::f64x4;

use super::columns::Columns;
use super::few::Few;
use super::functional::{PairFunctional, power};
use super::{Gap, Phasor};
use crate::fused::fma;

/// Registers that hold the coefficients of one series.
const SERIES_REGISTERS: usize = 3;

/// Coefficients of one series.
type Series = [f64x4; SERIES_REGISTERS];

/// Duration of the longest short flight, in Taylor steps.
pub(crate) const LONGEST_SHORT_FLIGHT: f64 = 0.125;

/// Largest relative distance of the first guess from the root.
const GUESS_ERROR: f64 = 0.01;

/// Bound on the growth of the powers of `v` over [`GUESS_ERROR`].
const GROWTH: f64 = 1.2;

/// Largest error of the root, relative to its scale, after the last correction.
const ROOT_ERROR: f64 = 1e-17;

/// Largest number of corrections of the root; one is usually enough.
const CORRECTION_CAP: usize = 3;

/// Weights of the term `m`, counted from zero: `m`, `m (m - 1) / 2`, `m (m + 1)` and `m + 1`, with 0 for the terms
/// that are treated separately.
const SLOPE: Series = weights([[0.0, 1.0, 2.0, 3.0], [4.0, 5.0, 6.0, 7.0], [8.0, 9.0, 10.0, 11.0]]);
const BEND: Series = weights([[0.0, 0.0, 1.0, 3.0], [6.0, 10.0, 15.0, 21.0], [28.0, 36.0, 45.0, 55.0]]);
const TURNING: Series =
    weights([[0.0, 0.0, 6.0, 12.0], [20.0, 30.0, 42.0, 56.0], [72.0, 90.0, 110.0, 132.0]]);
const GAIN: Series = weights([[0.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [9.0, 10.0, 11.0, 12.0]]);

const fn weights(w: [[f64; 4]; SERIES_REGISTERS]) -> Series {
    [f64x4::new(w[0]), f64x4::new(w[1]), f64x4::new(w[2])]
}

/// The matrix that maps `a = (z, w, x, v, cos, sin, 1)` to the Taylor coefficients of the gap and of the second
/// displacement.
#[derive(Clone, Debug)]
pub(crate) struct ShortFlight {
    columns: [[f64x4; 2 * SERIES_REGISTERS]; 7],
    /// Orders of the higher harmonics, and the columns of their `cos` and `sin`.
    waves: Few<(u32, [[f64x4; 2 * SERIES_REGISTERS]; 2])>,
}

/// The changes of the gap and of the second displacement, in powers of the time in Taylor steps.
pub(crate) struct FlightSeries {
    gap: Series,
    other: Series,
}

/// Powers of a time, four at a time.
struct Powers {
    low: f64x4,
    fourth: f64x4,
}

impl Powers {
    #[inline(always)]
    fn of(v: f64) -> Powers {
        let square = v * v;
        Powers { low: f64x4::from([1.0, v, square, square * v]), fourth: f64x4::splat(square * square) }
    }

    #[inline(always)]
    fn sum(&self, c: &Series) -> f64 {
        let [a, b, c, d] = (c[2].mul_add(self.fourth, c[1]).mul_add(self.fourth, c[0]) * self.low).to_array();
        (a + c) + (b + d)
    }

    #[inline(always)]
    fn weighted(&self, c: &Series, weights: &Series) -> f64 {
        self.sum(&std::array::from_fn(|i| c[i] * weights[i]))
    }
}

impl ShortFlight {
    /// Builds the matrix from the Taylor table.
    pub(super) fn new(table: &[Columns]) -> ShortFlight {
        let rows: Vec<[PairFunctional; 2]> = table.iter().map(|term| [term.row(0), term.row(2)]).collect();
        let column = |of: &dyn Fn(&PairFunctional) -> f64| {
            std::array::from_fn(|i| {
                let quad = |n: usize| of(&rows[4 * (i % SERIES_REGISTERS) + n][i / SERIES_REGISTERS]);
                f64x4::from(std::array::from_fn::<f64, 4, _>(quad))
            })
        };
        let wave = |k: usize| {
            let order = rows[0][0].waves[k].0;
            (order, [0, 1].map(|part| column(&|row| row.waves[k].1[part])))
        };
        ShortFlight {
            columns: std::array::from_fn(|j| column(&|row| row.base[j])),
            waves: (0..rows[0][0].waves.len()).map(wave).collect(),
        }
    }

    /// Returns the series of a flight from a state.
    #[inline(always)]
    pub(crate) fn from(&self, q: &Gap, phasor: &Phasor) -> FlightSeries {
        let c = &self.columns;
        let a = [q[0], q[1], q[2], q[3], phasor[0], phasor[1]].map(f64x4::splat);
        let quad = |i: usize| {
            let state = c[0][i].mul_add(a[0], c[1][i] * a[1]) + c[2][i].mul_add(a[2], c[3][i] * a[3]);
            state + c[4][i].mul_add(a[4], c[5][i].mul_add(a[5], c[6][i]))
        };
        let mut quads = [quad(0), quad(1), quad(2), quad(3), quad(4), quad(5)];
        if !self.waves.is_empty() {
            let waves = self.waved(phasor[0], phasor[1]);
            quads = std::array::from_fn(|i| quads[i] + waves[i]);
        }
        FlightSeries { gap: [quads[0], quads[1], quads[2]], other: [quads[3], quads[4], quads[5]] }
    }

    /// Returns the part of the higher harmonics in both series.
    #[cold]
    #[inline(never)]
    fn waved(&self, cos: f64, sin: f64) -> [f64x4; 2 * SERIES_REGISTERS] {
        let phasor = [cos, sin];
        self.waves.iter().fold([f64x4::ZERO; 2 * SERIES_REGISTERS], |sum, (order, [cos, sin])| {
            let [c, s] = power(&phasor, *order).map(f64x4::splat);
            std::array::from_fn(|i| sum[i] + cos[i].mul_add(c, sin[i] * s))
        })
    }
}

impl FlightSeries {
    /// Returns the time of the gap's first return to its start, in Taylor steps. Returns none if the series does not
    /// prove that, or if the gap may go farther than `width`.
    #[inline(always)]
    pub(crate) fn first_return(&self, width: f64) -> Option<f64> {
        let [c1, c2, c3, c4] = self.gap[0].to_array();
        // Series reversion of the first four terms.
        let inverse = 1.0 / c2;
        let first = -c1 * inverse;
        let per = first * inverse;
        let (a, b) = (c3 * per, c4 * first * per);
        let guess = first * (1.0 - fma(a, fma(a, fma(5.0, a, -2.0), fma(-5.0, b, 1.0)), b));
        let powers = Powers::of(guess);
        let slope = powers.weighted(&self.gap, &SLOPE);
        let per_slope = 1.0 / slope;
        let bend = powers.weighted(&self.gap, &BEND) * per_slope;
        let step = -powers.sum(&self.gap) * per_slope;
        let step = fma(-bend * step, step, step);
        let sizes = self.gap.map(|c| (-c).fast_max(c));
        let turning = GROWTH * powers.weighted(&sizes, &TURNING);
        let is_certain = guess > 0.0
            && step.abs() < GUESS_ERROR
            && turning < 2.0 * c2.abs() * guess
            && c1.abs() * LONGEST_SHORT_FLIGHT < width;
        if !is_certain {
            return None;
        }
        let per_slope = per_slope * fma(-2.0 * bend, step, 1.0);
        let share = fma(8.0 * step, step, 1e-10);
        let mut root = fma(guess, step, guess);
        for _ in 0..CORRECTION_CAP {
            let correction = Powers::of(root).sum(&self.gap) * per_slope;
            root = fma(-guess, correction, root);
            if correction.abs() * share <= ROOT_ERROR {
                return (root <= LONGEST_SHORT_FLIGHT).then_some(root);
            }
        }
        None
    }

    /// Returns the change of `(w, x, v)` up to the time `v` in Taylor steps; `per_unit` is the number of Taylor steps
    /// in a unit of time.
    #[inline(always)]
    pub(crate) fn changes(&self, v: f64, per_unit: f64) -> [f64; 3] {
        let powers = Powers::of(v);
        [
            per_unit * powers.weighted(&self.gap, &GAIN),
            v * powers.sum(&self.other),
            per_unit * powers.weighted(&self.other, &GAIN),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{GearPair, Side};
    use crate::pair::flow::{DomainKind, PairFlow, turned};

    /// Returns starts on the right wall, of free motion and of contact onsets.
    fn starts() -> impl Iterator<Item = (DomainKind, Gap, Phasor)> {
        (0..4000u32).map(|i| {
            let t = f64::from(i);
            let kind = if i % 2 == 0 { DomainKind::Free } else { DomainKind::Meshing(Side::Right) };
            let leaving = 10f64.powf(-8.0 + 8.0 * (0.618 * t).fract());
            let q = [0.5, -leaving, 2.0 * (1.7 * t).sin(), 6.0 * (2.3 * t).cos()];
            (kind, q, [(0.9 * t).cos(), (0.9 * t).sin()])
        })
    }

    /// Compares first returns with the exact flow. The contact must be pressed until then.
    #[test]
    fn first_returns_agree_with_the_exact_flow() {
        let flow = PairFlow::new(&GearPair::paper(0.5).pair());
        let (mut found, mut not_found) = (0, 0);
        for (kind, q, phasor) in starts() {
            let linear = flow.domain(kind);
            let series = linear.short_flight.from(&q, &phasor);
            let Some(u) = series.first_return(1.0) else {
                not_found += 1;
                continue;
            };
            found += 1;
            let case = format!("{kind:?} from {q:?}, {phasor:?}");
            let [w, x, v] = series.changes(u, linear.per_unit);
            let s = u * linear.unit;
            let end = linear.propagate(q, phasor, s);
            assert!((end[0] - q[0]).abs() <= 4.0 * f64::EPSILON, "{case}: {} off the wall", end[0] - q[0]);
            for (ours, exact, size) in
                [(q[1] + w, end[1], 6.0), (q[2] + x, end[2], 2.0), (q[3] + v, end[3], 6.0)]
            {
                assert!((ours - exact).abs() <= 8.0 * f64::EPSILON * size, "{case}: {ours} for {exact}");
            }
            for part in 1..64 {
                let part = f64::from(part) / 64.0;
                let between = linear.propagate(q, phasor, part * s);
                let at = turned(&phasor, part * u * linear.turn);
                // The height of a short flight may be less than an ulp of the wall's position.
                let rounding = 4.0 * f64::EPSILON;
                assert!(between[0] < q[0] + rounding, "{case}: behind the wall before the return");
                assert!(linear.acceleration(&between, &at) > 0.0, "{case}: not pressed before the return");
            }
        }
        assert!(found > 500 && not_found > 500, "{found} found, {not_found} not found");
    }

    /// Compares very short flights with uniformly accelerated motion.
    #[test]
    fn very_short_flights_keep_their_relative_accuracy() {
        let flow = PairFlow::new(&GearPair::paper(0.5).pair());
        let linear = flow.domain(DomainKind::Free);
        let phasor = [1.0, 0.0];
        for leaving in [1e-3, 1e-6, 1e-9, 1e-12] {
            let q = [0.5, -leaving, 0.3, 0.1];
            let pressing = linear.acceleration(&[0.5, 0.0, 0.3, 0.1], &phasor);
            let series = linear.short_flight.from(&q, &phasor);
            let s = series.first_return(1.0).unwrap() * linear.unit;
            let uniform = 2.0 * leaving / pressing;
            assert!((s / uniform - 1.0).abs() < 2.0 * leaving + 1e-14, "{s} for {uniform}");
            let [w, ..] = series.changes(s * linear.per_unit, linear.per_unit);
            assert!(((w - leaving) / leaving - 1.0).abs() < 2.0 * leaving + 1e-14);
        }
    }

    #[test]
    fn long_wide_and_unpressed_flights_have_no_certain_return() {
        let flow = PairFlow::new(&GearPair::paper(0.5).pair());
        let linear = flow.domain(DomainKind::Free);
        let first_return =
            |q: Gap, cos: f64, width: f64| linear.short_flight.from(&q, &[cos, 0.0]).first_return(width);
        let away = [0.5, -0.01, -2.0, 0.0];
        assert!(linear.acceleration(&away, &[-1.0, 0.0]) < 0.0);
        assert_eq!(first_return(away, -1.0, 1.0), None);
        assert_eq!(first_return([0.5, -3.0, 0.3, 0.1], 1.0, 1.0), None);
        assert!(first_return([0.5, -0.1, 0.3, 0.1], 1.0, 1.0).is_some());
        assert_eq!(first_return([0.5, -0.1, 0.3, 0.1], 1.0, 1e-4), None);
        assert_eq!(first_return([f64::NAN; 4], 1.0, 1.0), None);
    }

    #[test]
    fn turned_phasors_are_exact_to_rounding() {
        for i in 0..=200 {
            let (from, angle) = (0.37 * f64::from(i), 0.001 * f64::from(i));
            let [cos, sin] = turned(&[from.cos(), from.sin()], angle);
            let exact = (from + angle).sin_cos();
            assert!(
                (cos - exact.1).abs() < 3e-16 + from * 1e-16 && (sin - exact.0).abs() < 3e-16 + from * 1e-16
            );
        }
    }
}
