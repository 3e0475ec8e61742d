//! Event detection with proof: shows that a function has no root on a step, or brackets its only root.
//!
//! # The argument
//!
//! Let `f > 0` be the distance from an event on a step of length `h`, and `u` in `[0, 1]` the fraction of the step.
//! Value, slope and curvature at both ends are known exactly. Their Hermite quintic `p` satisfies
//!
//! ```text
//! f(u) = p(u) + u^3 (1-u)^3 h^6 f^(6)(xi) / 720,
//! ```
//!
//! and `u^3 (1-u)^3 = B(u) / 20` with `B` the middle Bernstein polynomial of degree 6. Let `c_0 .. c_6` be the
//! Bernstein coefficients of `p` in degree 6, and `eps = h^6 max|f^(6)| / 14400`. Then `f` lies between the
//! polynomials that have `c_3 - eps` and `c_3 + eps` in place of `c_3`. So:
//!
//! * If all coefficients and `c_3 - eps` are positive, `f` has no root: the step is clear.
//! * If the coefficients of both bounding polynomials change sign once, from `+` to `-`, each has exactly one root
//!   (Descartes), and all roots of `f` lie between these two. If also `f' < 0` there, `f` has exactly one root: a
//!   crossing.
//! * Otherwise, for example near grazing, the step is halved. Each halving divides `eps` by 64. It ends at the latest
//!   when the undecided distance is below rounding.
//!
//! `f' < 0` on the bracket is shown from an approximate root `g` of `p`. With `s = -p'(g)` and
//! `K = 20 max|second differences of p's coefficients| >= max|p''|`, `p' <= -s/2` within `D = s / (2K)` of `g`. With
//! `|B| <= beta` and `|B'| <= beta'` there, the bounding polynomials have slopes below `-(s/2 - beta' eps)`, so their
//! roots lie within `D` of `g` if `|p(g)| + beta eps < D (s/2 - beta' eps)`. The slope of `f` differs from `p'` by
//! less than `1.08 eps` (the sharp constant for the quintic's first derivative is `sqrt(5)/30000 h^5 max|f^(6)|`).
//!
//! A simpler test usually suffices. If all second differences of `p`'s coefficients show `f'' < 0` on the whole step,
//! or all first differences show `f' < 0`, and `f` ends below zero, `f` has one root after the start. The curvature
//! of `f` differs from `p''` by at most `7.5 eps` (the sharp constant of the second derivative is
//! `1/1920 h^4 max|f^(6)|`).
//!
//! A start on the wall is a root of order `m` at `u = 0`. Division by `u^m` drops `c_i` for `i < m` and multiplies
//! the others by positive numbers. So the tests are the same, and start at `i = m`.

use wide::{CmpGt, CmpLt, f64x4};

use crate::fused::fma;

/// Bernstein coefficients `c_0 .. c_6` of the quintic through value, slope and curvature of a function at both ends
/// of a step. All but `c_0` are stored as differences from `c_0`. The differences keep their relative accuracy on
/// steps that change the value by far less than an ulp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bernstein {
    start: f64,
    /// `c_1 .. c_4`, minus `c_0`.
    low: f64x4,
    /// `c_5`, and three times `c_6`, minus `c_0`.
    high: f64x4,
}

impl Bernstein {
    /// Builds the quintic of a function that starts at zero from `h f'` and `h^2 f''` at the left end, the value at
    /// the right end, and `h f'` and `h^2 f''` there.
    pub(crate) fn from_zero(s0: f64, a0: f64, rise: f64, s1: f64, a1: f64) -> Bernstein {
        let (b2, b3) = (0.4 * s0 + 0.05 * a0, rise - 0.4 * s1 + 0.05 * a1);
        let c1 = s0 * (1.0 / 6.0);
        let c2 = s0 * (1.0 / 3.0) + a0 * (1.0 / 30.0);
        let c4 = rise - s1 * (1.0 / 3.0) + a1 * (1.0 / 30.0);
        let c5 = rise - s1 * (1.0 / 6.0);
        Bernstein {
            start: 0.0,
            low: f64x4::from([c1, c2, 0.5 * (b2 + b3), c4]),
            high: f64x4::from([c5, rise, rise, rise]),
        }
    }

    /// Builds the quintic from value, slope and curvature per unit time at both ends of a step `h`.
    pub(crate) fn new([f0, s0, a0]: [f64; 3], [f1, s1, a1]: [f64; 3], h: f64) -> Bernstein {
        let differences = Bernstein::from_zero(h * s0, h * h * a0, f1 - f0, h * s1, h * h * a1);
        Bernstein { start: f0, ..differences }
    }

    /// Returns the differences from `c_0`, as they are stored.
    pub(crate) fn wide(&self) -> [f64x4; 2] {
        [self.low, self.high]
    }

    /// Builds the quintic from the value at the start and the differences from it.
    #[inline(always)]
    pub(crate) fn from_wide(start: f64, [low, high]: [f64x4; 2]) -> Bernstein {
        Bernstein { start, low, high }
    }

    /// Whether the function certainly stays above `floor` and below `ceiling` on the step, without the first `order`
    /// coefficients. It is faster than [`range`](Self::range).
    #[inline(always)]
    pub(crate) fn between(&self, order: usize, remainder: f64, floor: f64, ceiling: f64) -> [bool; 2] {
        let blur = MIDDLE * f64x4::splat(remainder);
        let mut low = self.low;
        if order > 1 {
            let [_, c2, c3, c4] = low.to_array();
            low = f64x4::from([c2, c2, c3, c4]);
        }
        let rounding = COEFFICIENT_ROUNDING * (self.start.abs() + self.end().abs());
        let (least, most) = ((floor - self.start) + rounding, (ceiling - self.start) - rounding);
        let (floor, ceiling) = (f64x4::splat(least), f64x4::splat(most));
        let above = bits((low - blur).cmp_gt(floor), self.high.cmp_gt(floor));
        let below = bits((low + blur).cmp_lt(ceiling), self.high.cmp_lt(ceiling));
        let starts_on = order > 0;
        // Without branches: the processor could not predict them.
        [(above == ALL_BITS) & (starts_on | (least < 0.0)), (below == ALL_BITS) & (starts_on | (most > 0.0))]
    }

    #[inline(always)]
    pub(crate) fn end(&self) -> f64 {
        self.start + self.high.to_array()[1]
    }

    /// Returns bounds of the function on the step, without the first `order` coefficients.
    ///
    /// A start on a wall has a root of order `order` there. Without its coefficients the bounds have the signs of the function divided by
    /// `u^order`.
    #[inline(always)]
    pub(crate) fn range(&self, order: usize, remainder: f64) -> [f64; 2] {
        let blur = f64x4::from([0.0, 0.0, remainder, 0.0]);
        let mut low = self.low;
        if order > 1 {
            let [_, c2, c3, c4] = low.to_array();
            low = f64x4::from([c2, c2, c3, c4]);
        }
        let lowest = smallest((low - blur).fast_min(self.high));
        let highest = -smallest((-(low + blur)).fast_min(-self.high));
        let rounding = COEFFICIENT_ROUNDING * (self.start.abs() + self.end().abs());
        let (least, most) =
            if order > 0 { (lowest, highest) } else { (lower(lowest, 0.0), upper(highest, 0.0)) };
        [self.start + (least - rounding), self.start + (most + rounding)]
    }
}

/// Selects `c_3` of `c_1 .. c_4`.
const MIDDLE: f64x4 = f64x4::new([0.0, 0.0, 1.0, 0.0]);

#[inline(always)]
fn smallest(x: f64x4) -> f64 {
    let [a, b, c, d] = x.to_array();
    lower(lower(a, c), lower(b, d))
}

/// Returns the smaller of two numbers in one instruction; `f64::min` needs four because of NaN.
#[inline(always)]
fn lower(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn upper(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Rounding error of a Bernstein coefficient, relative to the values at the ends. The proof holds for the rounded
/// state. Near resonance, with displacements far larger than the gap, the state itself has the rounding error of the
/// displacements.
const COEFFICIENT_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The roots of a function on a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// No root.
    Clear {
        /// Whether a step twice as long would probably be clear, too.
        roomy: bool,
    },
    /// Exactly one root after the start, where the function becomes negative.
    Crossing(Bracket),
    /// Not decided on a step of this length.
    Unclear,
}

/// An interval with the only root of a step, in fractions of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bracket {
    pub(crate) guess: f64,
    pub(crate) lo: f64,
    pub(crate) hi: f64,
}

/// Finds the roots of the distance `sign * (f - level)` on a step.
///
/// `order` is the order of its root at the start, or 0 if it is positive there. `remainder` is `eps` in the text of this module.
#[inline(always)]
pub(crate) fn judge(f: &Bernstein, level: f64, sign: f64, order: usize, remainder: f64) -> Verdict {
    let wide = f64x4::splat(sign);
    // After a start on the wall, only the differences matter, and rounding is relative to them. So flights that rise
    // by far less than an ulp of the wall's position are resolved.
    let (start, size) = if order > 0 {
        let [a, b] = [f.low, f.high].map(|c| (-c).fast_max(c));
        (0.0, -SLOPE_SCALE * smallest(-a.fast_max(b)))
    } else {
        (sign * (f.start - level), f.start.abs() + (f.start + f.high.to_array()[1]).abs() + level.abs())
    };
    let rounding = COEFFICIENT_ROUNDING * size;
    let eps = remainder + rounding;
    let [low, high] = [f.low, f.high].map(|c| c.mul_add(wide, f64x4::splat(start)));
    let slack = [f64x4::from([0.0, 0.0, eps, rounding]), f64x4::splat(rounding)];
    let above = bits(low.cmp_gt(slack[0]), high.cmp_gt(slack[1]));
    let first = order.min(3);
    if above >> first.saturating_sub(1) == ALL_BITS >> first.saturating_sub(1) && (order > 0 || start > 0.0) {
        let [_, c2, c3, c4] = low.to_array();
        let mut room = smallest(low.fast_min(high));
        if order > 1 {
            room = lower(lower(if order > 2 { c3 } else { c2 }, c3), lower(c4, smallest(high)));
        }
        return Verdict::Clear { roomy: ROOMY * remainder < room };
    }
    if order == 0 && start <= 0.0 {
        return Verdict::Unclear;
    }
    let below = bits(low.cmp_lt(f64x4::from([0.0, 0.0, -eps, 0.0])), high.cmp_lt(f64x4::ZERO));
    let Some(turn) = turn(above, below, first) else { return Verdict::Unclear };
    let ([c1, c2, c3, c4], [c5, c6, ..]) = (low.to_array(), high.to_array());
    bracket(&[start, c1, c2, c3, c4, c5, c6], order, turn, eps).map_or(Verdict::Unclear, Verdict::Crossing)
}

/// Bound on the slopes and curvatures at the ends, relative to the largest coefficient.
const SLOPE_SCALE: f64 = 64.0;

/// A mask with one bit for each of `c_1 .. c_6`.
const ALL_BITS: u32 = 0b11_1111;

#[inline(always)]
fn bits(low: f64x4, high: f64x4) -> u32 {
    (low.move_mask() as u32 | (high.move_mask() as u32) << 4) & ALL_BITS
}

/// A step may be doubled if the distance exceeds the remainder by this factor, `2^6`.
pub(crate) const ROOMY: f64 = 64.0;

/// Returns the index of the first coefficient that is not positive, if both bounding polynomials change sign exactly
/// once. The bits of `above` and `below` mark the coefficients that are positive and negative; only the middle one
/// may be neither.
#[inline(always)]
fn turn(above: u32, below: u32, first: usize) -> Option<usize> {
    let begin = first.max(1);
    let turn = begin + (above >> (begin - 1)).trailing_ones() as usize;
    if turn > 6 || turn == first {
        return None;
    }
    let is_middle = turn == 3 && below & 0b100 == 0;
    let negative_from = turn + usize::from(is_middle);
    (below >> (negative_from - 1) == ALL_BITS >> (negative_from - 1)).then_some(turn)
}

/// Returns a bracket with exactly one root, if slope or curvature shows that there is only one.
#[inline(always)]
fn bracket(c: &[f64; 7], order: usize, turn: usize, eps: f64) -> Option<Bracket> {
    let b = lowered(c);
    let first: [f64; 5] = std::array::from_fn(|i| b[i + 1] - b[i]);
    let second: [f64; 4] = std::array::from_fn(|i| first[i + 1] - first[i]);
    let third: [f64; 3] = std::array::from_fn(|i| second[i + 1] - second[i]);
    let fourth = [third[1] - third[0], third[2] - third[1]];
    let power =
        [b[0], 5.0 * first[0], 10.0 * second[0], 10.0 * third[0], 5.0 * fourth[0], fourth[1] - fourth[0]];
    // The zero of the control polygon would be a better start, but takes longer to compute.
    let guess = quintic_root(&power, order, (turn as f64 - 0.5) * (1.0 / 6.0))?;
    let bend = upper(upper(second[0], second[1]), upper(second[2], second[3]));
    let slope = upper(upper(first[0], first[1]), upper(upper(first[2], first[3]), first[4]));
    if bend < -BEND_ERROR * eps || slope < -SLOPE_ERROR * eps {
        return Some(Bracket { guess, lo: 0.0, hi: 1.0 });
    }
    bracket_near(&power, &second, guess, eps)
}

/// Remainders of slope and curvature divided by `eps` and by the factors of their Bernstein forms, 5 and 20.
const SLOPE_ERROR: f64 = 1.08 / 5.0;
const BEND_ERROR: f64 = 7.5 / 20.0;

/// Returns the interval around `guess` on which the slope is certainly negative, if the root lies in it.
#[inline(never)]
fn bracket_near(power: &[f64; 6], second: &[f64; 4], guess: f64, eps: f64) -> Option<Bracket> {
    let [p, slope] = quintic(power, guess);
    let s = -slope;
    let reach = 0.5 * s / (20.0 * second.iter().fold(0.0, |most, x| upper(most, x.abs())));
    let outer = lower(guess + reach, 1.0);
    let beta = lower(20.0 * outer * outer * outer, 0.3125);
    let steepness = 0.5 * s - 1.08 * eps * lower(60.0 * outer * outer, 1.0);
    (steepness > 0.0 && p.abs() + beta * eps < reach * steepness && s > 2.16 * eps).then_some(Bracket {
        guess,
        lo: upper(guess - reach, 0.0),
        hi: outer,
    })
}

/// Converts Bernstein coefficients of degree 6 to those of degree 5.
#[inline(always)]
fn lowered(c: &[f64; 7]) -> [f64; 6] {
    [
        c[0],
        fma(1.2, c[1], -0.2 * c[0]),
        fma(1.5, c[2], fma(-0.6, c[1], 0.1 * c[0])),
        fma(1.5, c[4], fma(-0.6, c[5], 0.1 * c[6])),
        fma(1.2, c[5], -0.2 * c[6]),
        c[6],
    ]
}

/// Finds a root, to two digits, by Halley's method on the quintic divided by `u^order`.
#[inline(always)]
fn quintic_root(power: &[f64; 6], order: usize, start: f64) -> Option<f64> {
    let deflated = match order {
        0 => *power,
        1 => [power[1], power[2], power[3], power[4], power[5], 0.0],
        2 => [power[2], power[3], power[4], power[5], 0.0, 0.0],
        _ => [power[3], power[4], power[5], 0.0, 0.0, 0.0],
    };
    let [_, _, c2, c3, c4, c5] = deflated;
    let mut u = start;
    for _ in 0..6 {
        let [p, slope] = quintic(&deflated, u);
        let bend = fma(u * u, fma(10.0 * c5, u, 6.0 * c4), fma(3.0 * c3, u, c2));
        let step = p * slope / fma(slope, slope, -p * bend);
        u -= step;
        if !(u > 0.0 && u < 1.0 + 1e-6) {
            return None;
        }
        if step.abs() < 0.1 * u || step.abs() < 0.1 && u > 0.1 {
            return Some(u);
        }
    }
    None
}

/// Returns value and slope of a quintic, evaluated as a tree to shorten the chain of operations.
#[inline(always)]
fn quintic(c: &[f64; 6], u: f64) -> [f64; 2] {
    let square = u * u;
    let value = fma(square, fma(square, fma(c[5], u, c[4]), fma(c[3], u, c[2])), fma(c[1], u, c[0]));
    let tail = fma(square, 5.0 * c[5], fma(4.0 * c[4], u, 3.0 * c[3]));
    let slope = fma(square, tail, fma(2.0 * c[2], u, c[1]));
    [value, slope]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `f(u) = a + b u + c u^2 + d u^3` on a step of length 1.
    fn cubic([a, b, c, d]: [f64; 4]) -> Bernstein {
        let at =
            |u: f64| [a + u * (b + u * (c + u * d)), b + u * (2.0 * c + 3.0 * d * u), 2.0 * c + 6.0 * d * u];
        Bernstein::new(at(0.0), at(1.0), 1.0)
    }

    fn distance(f: [f64; 4], order: usize, remainder: f64) -> Verdict {
        judge(&cubic(f), 0.0, 1.0, order, remainder)
    }

    #[test]
    fn a_double_crossing_is_never_called_clear() {
        // Below zero between u = 0.45 and u = 0.55, positive at both ends.
        let crossed_twice = [0.45 * 0.55, -1.0, 1.0, 0.0];
        assert_eq!(distance(crossed_twice, 0, 0.0), Verdict::Unclear);
        // The parabola raised above zero.
        let lifted = [0.45 * 0.55 + 0.3, -1.0, 1.0, 0.0];
        assert!(matches!(distance(lifted, 0, 1e-6), Verdict::Clear { .. }));
        // A remainder as large as the distance.
        assert_eq!(distance(lifted, 0, 0.5), Verdict::Unclear);
    }

    #[test]
    fn one_crossing_is_bracketed() {
        let Verdict::Crossing(b) = distance([0.3, -1.0, 0.1, 0.0], 0, 1e-6) else { panic!("not a crossing") };
        let root = (1.0 - (1.0f64 - 0.12).sqrt()) / 0.2;
        assert!(b.lo < root && root < b.hi, "{b:?} does not hold {root}");
        assert!((b.guess - root).abs() < 1e-3);
    }

    #[test]
    fn a_root_at_the_start_is_divided_out() {
        // u (0.25 - u): leaves the wall and returns at 0.25.
        let Verdict::Crossing(b) = distance([0.0, 0.25, -1.0, 0.0], 1, 1e-9) else {
            panic!("not a crossing")
        };
        assert!((b.guess - 0.25).abs() < 1e-3);
        // u^2 (0.5 - u)
        let Verdict::Crossing(b) = distance([0.0, 0.0, 0.5, -1.0], 2, 1e-9) else { panic!("not a crossing") };
        assert!((b.guess - 0.5).abs() < 1e-3);
        // Leaves and does not return.
        assert!(matches!(distance([0.0, 0.25, 1.0, 0.0], 1, 1e-9), Verdict::Clear { .. }));
        // Leaves with a speed far below the rounding of the wall's position.
        let near = judge(&Bernstein::new([0.5, -1e-19, -1.0], [0.0, -1.0, -1.0], 1.0), 0.5, -1.0, 1, 1e-9);
        assert!(matches!(near, Verdict::Clear { .. }));
    }
}
