// Turns of phasors by small angles.

// Returns cos - 1 and sin of an angle of up to about a radian.
fn small_turn(angle: Real) -> vec2<Real> {
    let s = angle * angle;
    let c = s * (-1.0 / 2.0 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s * (1.0 / 40320.0
        + s * (-1.0 / 3628800.0 + s * (1.0 / 479001600.0 + s * (-1.0 / 87178291200.0 + s * (1.0 / 20922789888000.0 - s * (1.0 / 6402373705728000.0)))))))));
    let sine = 1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s * (1.0 / 362880.0
        + s * (-1.0 / 39916800.0 + s * (1.0 / 6227020800.0 + s * (-1.0 / 1307674368000.0 + s * (1.0 / 355687428096000.0))))))));
    return vec2<Real>(c, angle * sine);
}
