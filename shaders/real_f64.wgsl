// Double precision; needs SHADER_F64.
alias Real = f64;
// Terms of the Taylor series of one step, of at most a radian: the remainder is below rounding.
const TERMS: u32 = 20u;
// Terms of the series of a short flight, and the factorial of SHORT_TERMS - 2.
const SHORT_TERMS: u32 = 13u;
const SHORT_FACTORIAL: Real = 39916800.0;
// Longest short flight, in steps, whose error is at most ULP (chatter.wgsl).
const SHORT: Real = 0.191;
// Half a unit in the last place of 1.
const ULP: Real = 1.2e-16;
// Stretches are not halved below SHORTEST: a touch within one counts as rounding. If the bound shows that the
// motion may pass the wall there, they are halved down to SHORTEST_STEP.
const SHORTEST: Real = 1e-8;
const SHORTEST_STEP: Real = 1e-14;
// States of this size count as not finite.
const HUGE: Real = 1e150;

// Whether a size is a number below HUGE. Compares the bits of an f32, because drivers' fast arithmetic ignores NaN.
fn is_bounded(size: Real) -> bool {
    let single = 1e30f;
    return bitcast<u32>(f32(size * 1e-120)) < bitcast<u32>(single);
}

// Recurrence distance that is rounding error, in quarter octaves below 1: a motion this near to its last strobes is
// at rest.
const AT_REST: u32 = WITHIN_ROUNDING;
// A multiplier within this of 1, in octaves per period, counts as 1. A double multiplier, as of a free body, scatters
// by the square root of rounding.
const NEUTRAL: Real = 1e-7;
// Distance from the cycle, relative to the motion, at which Newton's method stops.
const NEWTON_CONVERGED: f32 = 1e-10;
// Squarings of the monodromy matrix: enough for the spectral radius to the last digits.
const SQUARINGS: u32 = 40u;
