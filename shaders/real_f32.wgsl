// Single precision.
alias Real = f32;
// Size of four numbers in bytes.
const FOUR_REALS: u32 = 16u;
// Number of terms of the Taylor series of one step. A step turns by at most a radian, so the remainder is below rounding.
const TERMS: u32 = 12u;
// Number of terms of the series of a short flight, and the factorial of SHORT_TERMS - 2.
const SHORT_TERMS: u32 = 8u;
const SHORT_FACTORIAL: Real = 720.0;
// Longest short flight, in steps, whose error is at most ULP (chatter.wgsl).
const SHORT: Real = 0.198;
// Half a unit in the last place of 1.
const ULP: Real = 6e-8;
// Shortest parts of a step that are searched for an event, in steps. Within SHORTEST, a touch of the wall counts as rounding. If a bound
// shows that the motion may pass the wall there, parts are halved down to SHORTEST_STEP.
const SHORTEST: Real = 0.001;
const SHORTEST_STEP: Real = 1e-6;
// Machines: rounding error of a sum, relative to the sum of the sizes of its terms; and of a polynomial's coefficient, relative to the sum
// of the sizes of all coefficients.
const ROUNDING: Real = 2e-6;
const POLYNOMIAL_ROUNDING: Real = 1e-6;
// Machines: width of the narrowest interval in which a root is isolated, as a share of a step; largest number of halvings, and of steps of
// the final search.
const NARROWEST: Real = 1e-6;
const MOST_HALVINGS: u32 = 48u;
const ROOT_STEPS: u32 = 30u;
// Machines: relative change of speeds and accelerations for derivatives of a duration, and largest number of flights that are added one by
// one (machine/chatter.wgsl).
const DIFFERENCE: Real = 3e-3;
const MOST_FLIGHTS: u32 = 16u;
// States of this size count as not finite.
const HUGE: Real = 1e15;

// Whether a size is a number below HUGE. Compares bits, because drivers' fast arithmetic ignores NaN.
fn is_bounded(size: Real) -> bool {
    return bitcast<u32>(size) < bitcast<u32>(HUGE);
}

// Recurrence distance that is rounding error, in quarter octaves below 1: a motion that is this near to its last strobes counts as at rest.
const AT_REST: u32 = 64u;
// A multiplier counts as 1 if its binary logarithm per period is at most this large. Rounding changes a double multiplier, such as that of
// a free body, by the square root of a rounding error.
const NEUTRAL: Real = 1e-3;
// Distance from the cycle, relative to the motion, at which Newton's method stops.
const NEWTON_CONVERGED: f32 = 1e-5;
// Number of squarings of the monodromy matrix. With more squarings, the smaller entries of a Jordan block would underflow.
const SQUARINGS: u32 = 20u;

// Returns cos - 1 and sin of an angle of up to about a radian.
fn small_turn(angle: Real) -> vec2<Real> {
    let s = angle * angle;
    let c = -1.0 / 2.0 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s * (1.0 / 40320.0 + s * (-1.0 / 3628800.0 + s * (1.0 / 479001600.0)))));
    let sine = 1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s * (1.0 / 362880.0 - s * (1.0 / 39916800.0)))));
    return vec2<Real>(s * c, angle * sine);
}
