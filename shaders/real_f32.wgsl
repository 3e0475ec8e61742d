// Single precision.
alias Real = f32;
// Terms of the Taylor series of one step, of at most a radian: the remainder is below rounding.
const TERMS: u32 = 12u;
// Terms of the series of a short flight, and the factorial of SHORT_TERMS - 2.
const SHORT_TERMS: u32 = 8u;
const SHORT_FACTORIAL: Real = 720.0;
// Longest short flight, in steps, whose error is at most ULP (chatter.wgsl).
const SHORT: Real = 0.198;
// Half a unit in the last place of 1.
const ULP: Real = 6e-8;
// Stretches are not halved below SHORTEST: a touch within one counts as rounding. If the bound shows that the
// motion may pass the wall there, they are halved down to SHORTEST_STEP.
const SHORTEST: Real = 0.001;
const SHORTEST_STEP: Real = 1e-6;
// Machines: rounding error of a sum, relative to the size of its terms, and of a coefficient of a polynomial, relative to the sum of all.
const ROUNDING: Real = 2e-6;
const POLYNOMIAL_ROUNDING: Real = 1e-6;
// Machines: the narrowest interval, as a share of a step, in which a root is isolated; most halvings, and most steps of the final search.
const NARROWEST: Real = 1e-6;
const MOST_HALVINGS: u32 = 48u;
const ROOT_STEPS: u32 = 30u;
// States of this size count as not finite.
const HUGE: Real = 1e15;

// Whether a size is a number below HUGE. Compares bits, because drivers' fast arithmetic ignores NaN.
fn is_bounded(size: Real) -> bool {
    return bitcast<u32>(size) < bitcast<u32>(HUGE);
}

// Recurrence distance that is rounding error, in quarter octaves below 1: a motion this near to its last strobes is
// at rest.
const AT_REST: u32 = 64u;
// A multiplier within this of 1, in octaves per period, counts as 1. A double multiplier, as of a free body, scatters
// by the square root of rounding.
const NEUTRAL: Real = 1e-3;
// Distance from the cycle, relative to the motion, at which Newton's method stops.
const NEWTON_CONVERGED: f32 = 1e-5;
// Squarings of the monodromy matrix. With more, the smaller entries of a Jordan block would underflow.
const SQUARINGS: u32 = 20u;
