// Single precision.
alias Real = f32;
// Terms of a Taylor expansion over one step of at most a radian: the rest is below rounding.
const TERMS: u32 = 12u;
// Terms for short flights, and the factorial of SHORT_TERMS - 2.
const SHORT_TERMS: u32 = 8u;
const SHORT_FACTORIAL: Real = 720.0;
// How long short flights are, in steps, for errors of ULP (chatter.wgsl).
const SHORT: Real = 0.198;
// Half a unit in the last place of 1.
const ULP: Real = 6e-8;
// Steps are not halved below this: what touches a wall there does so within rounding, unless it is seen
// to go through; then not below this.
const SHORTEST: Real = 0.001;
const SHORTEST_STEP: Real = 1e-6;
// States beyond this are taken for a loss of finiteness.
const HUGE: Real = 1e15;

// Whether a size is a number below HUGE. By its bits: arithmetic that drivers call fast knows no NaN.
fn is_bounded(size: Real) -> bool {
    return bitcast<u32>(size) < bitcast<u32>(HUGE);
}

// Recurrence distances, in quarter octaves below 1, that are rounding itself: a motion this near to its last strobes is at rest.
const AT_REST: u32 = 64u;
// A multiplier that is nearer to 1 than this, in octaves per period, is 1 as far as one can tell: a
// double one, as a free body has, scatters by the square root of rounding.
const NEUTRAL: Real = 1e-3;
// Newton's method has done enough this close to the cycle, relative to the motion.
const REFINED: f32 = 1e-5;
// Squarings of the monodromy matrix: more would let the smaller entries of a Jordan block underflow.
const SQUARINGS: u32 = 20u;
