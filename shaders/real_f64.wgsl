// Double precision; needs SHADER_F64.
alias Real = f64;
// Terms of a Taylor expansion over one step of at most a radian: the rest is below rounding.
const TERMS: u32 = 20u;
// Terms for short flights, and the factorial of SHORT_TERMS - 2.
const SHORT_TERMS: u32 = 13u;
const SHORT_FACTORIAL: Real = 39916800.0;
// How long short flights are, in steps, for errors of ULP (chatter.wgsl).
const SHORT: Real = 0.191;
// Half a unit in the last place of 1.
const ULP: Real = 1.2e-16;
// Steps are not halved below this: what touches a wall there does so within rounding, unless it is seen
// to go through; then not below this.
const SHORTEST: Real = 1e-8;
const SHORTEST_STEP: Real = 1e-14;
// States beyond this are taken for a loss of finiteness.
const HUGE: Real = 1e150;

// Whether a size is a number below HUGE. By the bits of a single: arithmetic that drivers call fast knows no NaN.
fn is_bounded(size: Real) -> bool {
    let single = 1e30f;
    return bitcast<u32>(f32(size * 1e-120)) < bitcast<u32>(single);
}

// Recurrence distances, in quarter octaves below 1, that are rounding itself: a motion this near to its last strobes is at rest.
const AT_REST: u32 = RESOLVED;
// A multiplier that is nearer to 1 than this, in octaves per period, is 1 as far as one can tell: a
// double one, as a free body has, scatters by the square root of rounding.
const NEUTRAL: Real = 1e-7;
// Newton's method has done enough this close to the cycle, relative to the motion.
const REFINED: f32 = 1e-10;
// Squarings of the monodromy matrix: the spectral radius to the last digits.
const SQUARINGS: u32 = 40u;
