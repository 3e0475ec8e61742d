// Double precision; needs SHADER_F64. The constants have the meaning that real_f32.wgsl describes.
alias Real = f64;
// Size of four numbers in bytes.
const FOUR_REALS: u32 = 32u;
const TERMS: u32 = 20u;
const SHORT_TERMS: u32 = 13u;
const SHORT_FACTORIAL: Real = 39916800.0;
const SHORT: Real = 0.191;
const ULP: Real = 1.2e-16;
const SHORTEST: Real = 1e-8;
const SHORTEST_STEP: Real = 1e-14;
const ROUNDING: Real = 4e-15;
const POLYNOMIAL_ROUNDING: Real = 2e-15;
const NARROWEST: Real = 1e-14;
const MOST_HALVINGS: u32 = 96u;
const ROOT_STEPS: u32 = 60u;
const DIFFERENCE: Real = 1e-4;
const MOST_FLIGHTS: u32 = 128u;
const HUGE: Real = 1e150;

// Compares the bits of an f32, because drivers' fast arithmetic ignores NaN.
fn is_bounded(size: Real) -> bool {
    let single = 1e30f;
    return bitcast<u32>(f32(size * 1e-120)) < bitcast<u32>(single);
}

const AT_REST: u32 = WITHIN_ROUNDING;
const NEUTRAL: Real = 1e-7;
const NEWTON_CONVERGED: f32 = 1e-10;
// This number of squarings gives the spectral radius to the last digits.
const SQUARINGS: u32 = 40u;

// Returns cos - 1 and sin of an angle of up to about a radian.
fn small_turn(angle: Real) -> vec2<Real> {
    let s = angle * angle;
    let c = -1.0 / 2.0 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s * (1.0 / 40320.0 + s * (-1.0 / 3628800.0 + s * (1.0 / 479001600.0
        + s * (-1.0 / 87178291200.0 + s * (1.0 / 20922789888000.0 - s * (1.0 / 6402373705728000.0))))))));
    let sine = 1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s * (1.0 / 362880.0 + s * (-1.0 / 39916800.0
        + s * (1.0 / 6227020800.0 + s * (-1.0 / 1307674368000.0 + s * (1.0 / 355687428096000.0))))))));
    return vec2<Real>(s * c, angle * sine);
}
