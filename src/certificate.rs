//! Complete event detection: is a function free of roots on a step, and if not, where is
//! its first one?
//!
//! # The argument
//!
//! Let `f > 0` be the distance from an event on a step of length `h`, `u` in `[0, 1]` the
//! fraction of the step. Value, slope and curvature at both ends are known exactly. Their
//! Hermite quintic `p` satisfies
//!
//! ```text
//! f(u) = p(u) + u^3 (1-u)^3 h^6 f^(6)(xi) / 720,
//! ```
//!
//! and `u^3 (1-u)^3 = B(u) / 20` with `B` the middle Bernstein polynomial of degree 6.
//! Write `p` with the Bernstein coefficients `c_0 .. c_6` of degree 6; then with
//! `eps = h^6 max|f^(6)| / 14400` the function lies between the polynomials that have
//! `c_3 - eps` and `c_3 + eps` in the middle. So:
//!
//! * All coefficients positive, `c_3 - eps` too: no root, the step is clear.
//! * Both bounding polynomials change sign once along their coefficients, from `+` to `-`:
//!   each has exactly one root (Descartes), and all roots of `f` lie between the two. If
//!   in addition `f' < 0` there, `f` has exactly one root: a crossing.
//! * Else, double crossings and grazing among it, the step is halved. That divides `eps`
//!   by 64, so it ends: at the latest where what remains open is below rounding.
//!
//! `f' < 0` on the bracket is shown at an approximate root `g` of `p`. With
//! `s = -p'(g)` and `K = 20 max|second differences of p's coefficients| >= max|p''|`,
//! `p' <= -s/2` within `D = s / (2K)` of `g`. There `|B| <= beta` and `|B'| <= beta'` give
//! bounding polynomials with slopes below `-(s/2 - beta' eps)`, and so their roots lie
//! within `D` of `g` if `|p(g)| + beta eps < D (s/2 - beta' eps)`. The slope of `f` itself
//! departs from `p'` by less than `1.08 eps` (the sharp constant for the quintic's first
//! derivative is `sqrt(5)/30000 h^5 max|f^(6)|`).
//!
//! A start on the wall itself is a root of order `m` at `u = 0`. Dividing `u^m` out turns
//! `c_i` into a positive multiple of `c_i` for `i >= m` and drops the rest, so the same
//! test serves: it merely starts at `i = m`.

/// Value, slope and curvature of a function at both ends of a step, in units of the step:
/// `(f, h f', h^2 f'')`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hermite {
    left: [f64; 3],
    right: [f64; 3],
    /// Difference of the two values, to its own relative accuracy.
    rise: f64,
}

impl Hermite {
    /// From values, slopes and curvatures per unit time, and the difference of the values.
    #[inline(always)]
    pub(crate) fn new(left: [f64; 3], right: [f64; 3], h: f64, rise: f64) -> Hermite {
        let scale = |[f, s, a]: [f64; 3]| [f, h * s, h * h * a];
        Hermite { left: scale(left), right: scale(right), rise }
    }
}

/// What a step holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// No root.
    Clear {
        /// Whether a step twice as long would probably be clear, too.
        roomy: bool,
    },
    /// Exactly one root after the start, a crossing outwards.
    Crossing(Bracket),
    /// Not decided at this length.
    Unclear,
}

/// Where the one root of a step lies, in fractions of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bracket {
    pub(crate) guess: f64,
    pub(crate) lo: f64,
    pub(crate) hi: f64,
}

/// Lowest and highest value that a function can take on a step, leaving out the first
/// `order` coefficients: the quick test, good for both walls at once.
///
/// A start on a wall has a root of order `order` there; without its coefficients the range
/// is that of the deflated function as far as signs go.
#[inline(always)]
pub(crate) fn range(f: &Hermite, order: usize, remainder: f64) -> [f64; 2] {
    let [f0, s0, a0] = f.left;
    let [f1, s1, a1] = f.right;
    let (b2, b3) = (f0 + 0.4 * s0 + 0.05 * a0, f1 - 0.4 * s1 + 0.05 * a1);
    let c2 = f0 + (s0 * (1.0 / 3.0) + a0 * (1.0 / 30.0));
    let c0 = if order > 0 { c2 } else { f0 };
    let c1 = if order > 1 { c2 } else { f0 + s0 * (1.0 / 6.0) };
    let c3 = 0.5 * (b2 + b3);
    let c4 = f1 - (s1 * (1.0 / 3.0) - a1 * (1.0 / 30.0));
    let c5 = f1 - s1 * (1.0 / 6.0);
    let lowest = lower(lower(lower(c0, f1), lower(c1, c2)), lower(lower(c4, c5), c3 - remainder));
    let highest = upper(upper(upper(c0, f1), upper(c1, c2)), upper(upper(c4, c5), c3 + remainder));
    let rounding = ROUNDING * (f0.abs() + f1.abs());
    [lowest - rounding, highest + rounding]
}

/// The smaller of two numbers in one instruction; `f64::min` takes four to mind NaN.
#[inline(always)]
fn lower(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger of two numbers.
#[inline(always)]
fn upper(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Rounding of a Bernstein coefficient, relative to the ends it is made of.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Judges the distance `sign * (f - level)` on a step.
///
/// `order` is the order of its root at the start, 0 where it starts inside; `remainder` is
/// `eps` of the module's argument.
#[inline(always)]
pub(crate) fn judge(f: &Hermite, level: f64, sign: f64, order: usize, remainder: f64) -> Verdict {
    let [_, s0, a0] = f.left.map(|value| sign * value);
    let [_, s1, a1] = f.right.map(|value| sign * value);
    // From the wall, coefficients are departures and carry their own rounding only: a flight
    // far shorter than an ulp of the wall's position keeps its shape.
    let (start, end, rounding) = if order > 0 {
        let size = s0.abs() + a0.abs() + s1.abs() + a1.abs();
        (0.0, sign * f.rise, ROUNDING * (f.rise.abs() + size))
    } else {
        let size = f.left[0].abs() + f.right[0].abs() + level.abs();
        (sign * (f.left[0] - level), sign * (f.right[0] - level), ROUNDING * size)
    };
    let quintic = [
        start,
        start + 0.2 * s0,
        start + 0.4 * s0 + 0.05 * a0,
        end - 0.4 * s1 + 0.05 * a1,
        end - 0.2 * s1,
        end,
    ];
    let c = [
        start,
        start + s0 * (1.0 / 6.0),
        start + s0 * (1.0 / 3.0) + a0 * (1.0 / 30.0),
        0.5 * (quintic[2] + quintic[3]),
        end - s1 * (1.0 / 3.0) + a1 * (1.0 / 30.0),
        end - s1 * (1.0 / 6.0),
        end,
    ];
    let eps = remainder + rounding;

    let right = lower(lower(c[4], c[5]), c[6]);
    let left = match order {
        0 => lower(lower(c[0], c[1]), c[2]),
        1 => lower(c[1], c[2]),
        2 => c[2],
        _ => f64::INFINITY,
    };
    if left > 0.0 && right > rounding && c[3] > eps {
        return Verdict::Clear { roomy: ROOMY * remainder < lower(lower(left, right), c[3]) };
    }
    turn(&c, order.min(3), eps)
        .and_then(|turn| bracket(&quintic, [s0, a0, s1, a1], &c, order, turn, eps))
        .map_or(Verdict::Unclear, Verdict::Crossing)
}

/// A remainder this many times smaller than the room left suits a step twice as long.
pub(crate) const ROOMY: f64 = 64.0;

/// Index of the first coefficient that is not positive, if both bounding polynomials change
/// sign exactly once.
#[inline(always)]
fn turn(c: &[f64; 7], first: usize, eps: f64) -> Option<usize> {
    let slack = |i: usize| if i == 3 { eps } else { 0.0 };
    let turn = (first..7).find(|&i| c[i] <= slack(i))?;
    if turn == first {
        return None;
    }
    let negative_from = if turn == 3 && c[3] >= -eps { 4 } else { turn };
    (negative_from..7).all(|i| c[i] < -slack(i)).then_some(turn)
}

/// A bracket that holds exactly one root, if the slope there is large enough to show it.
fn bracket(
    b: &[f64; 6],
    ends: [f64; 4],
    c: &[f64; 7],
    order: usize,
    turn: usize,
    eps: f64,
) -> Option<Bracket> {
    let [s0, a0, s1, a1] = ends;
    let (d, d1, d2) = (b[5] - b[0] - s0 - 0.5 * a0, s1 - s0 - a0, a1 - a0);
    let power = [
        b[0],
        s0,
        0.5 * a0,
        10.0 * d - 4.0 * d1 + 0.5 * d2,
        -15.0 * d + 7.0 * d1 - d2,
        6.0 * d - 3.0 * d1 + 0.5 * d2,
    ];
    let guess = quintic_root(&power, order, polygon_root(c, turn))?;
    let [p, slope] = quintic(&power, guess);
    let s = -slope;
    let bend = second_difference_bound(b);
    let reach = 0.5 * s / bend;
    let outer = lower(guess + reach, 1.0);
    let beta = lower(20.0 * outer * outer * outer, 0.3125);
    let steepness = 0.5 * s - 1.08 * eps * lower(60.0 * outer * outer, 1.0);
    (steepness > 0.0 && p.abs() + beta * eps < reach * steepness && s > 2.16 * eps).then_some(Bracket {
        guess,
        lo: upper(guess - reach, 0.0),
        hi: outer,
    })
}

/// `20 max |second differences| >= max |p''|` of a quintic in Bernstein form.
#[inline(always)]
fn second_difference_bound(b: &[f64; 6]) -> f64 {
    let second = |i: usize| ((b[i + 2] - b[i + 1]) - (b[i + 1] - b[i])).abs();
    20.0 * upper(upper(second(0), second(1)), upper(second(2), second(3)))
}

/// Where the control polygon crosses zero.
#[inline(always)]
fn polygon_root(c: &[f64; 7], turn: usize) -> f64 {
    let (above, below) = (c[turn - 1], c[turn].min(0.0));
    ((turn - 1) as f64 + above / (above - below)) * (1.0 / 6.0)
}

/// Newton on the quintic with its root at the start divided out: a few digits suffice.
#[inline(always)]
fn quintic_root(power: &[f64; 6], order: usize, start: f64) -> Option<f64> {
    let deflated: [f64; 6] = std::array::from_fn(|i| power.get(i + order).copied().unwrap_or(0.0));
    let mut u = start;
    for _ in 0..6 {
        let [p, slope] = quintic(&deflated, u);
        let step = p / slope;
        u -= step;
        if !(u > 0.0 && u < 1.0 + 1e-6) {
            return None;
        }
        if step.abs() < 1e-2 * u {
            return Some(u);
        }
    }
    None
}

/// Value and slope of a quintic, in a tree to shorten the chain.
#[inline(always)]
fn quintic(c: &[f64; 6], u: f64) -> [f64; 2] {
    let square = u * u;
    let fourth = square * square;
    let value = ((c[0] + c[1] * u) + square * (c[2] + c[3] * u)) + fourth * (c[4] + c[5] * u);
    let slope = ((c[1] + 2.0 * c[2] * u) + square * (3.0 * c[3] + 4.0 * c[4] * u)) + fourth * (5.0 * c[5]);
    [value, slope]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `f(u) = a + b u + c u^2 + d u^3` on a step of length 1.
    fn cubic([a, b, c, d]: [f64; 4]) -> Hermite {
        let at =
            |u: f64| [a + u * (b + u * (c + u * d)), b + u * (2.0 * c + 3.0 * d * u), 2.0 * c + 6.0 * d * u];
        Hermite::new(at(0.0), at(1.0), 1.0, b + c + d)
    }

    fn distance(f: [f64; 4], order: usize, remainder: f64) -> Verdict {
        judge(&cubic(f), 0.0, 1.0, order, remainder)
    }

    #[test]
    fn a_double_crossing_is_never_called_clear() {
        // Dips below zero between u = 0.45 and u = 0.55, positive at both ends.
        let dip = [0.45 * 0.55, -1.0, 1.0, 0.0];
        assert_eq!(distance(dip, 0, 0.0), Verdict::Unclear);
        // The same parabola lifted clear of zero.
        let lifted = [0.45 * 0.55 + 0.3, -1.0, 1.0, 0.0];
        assert!(matches!(distance(lifted, 0, 1e-6), Verdict::Clear { .. }));
        // A remainder as large as its clearance takes the verdict back.
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
    fn the_root_at_the_start_is_divided_out() {
        // u (0.25 - u): leaves the wall and comes back at 0.25.
        let Verdict::Crossing(b) = distance([0.0, 0.25, -1.0, 0.0], 1, 1e-9) else {
            panic!("not a crossing")
        };
        assert!((b.guess - 0.25).abs() < 1e-3);
        // u^2 (0.5 - u)
        let Verdict::Crossing(b) = distance([0.0, 0.0, 0.5, -1.0], 2, 1e-9) else { panic!("not a crossing") };
        assert!((b.guess - 0.5).abs() < 1e-3);
        // Leaves for good.
        assert!(matches!(distance([0.0, 0.25, 1.0, 0.0], 1, 1e-9), Verdict::Clear { .. }));
        // A departure far below the rounding of the wall's position.
        let near =
            judge(&Hermite::new([0.5, -1e-19, -1.0], [0.0, -1.0, -1.0], 1.0, -0.5), 0.5, -1.0, 1, 1e-9);
        assert!(matches!(near, Verdict::Clear { .. }));
    }
}
