// The first root of a polynomial on a step.
//
// In Bernstein form, the number of roots in an interval is at most the number of sign changes of the coefficients, and one sign change
// means exactly one root (Descartes' rule). Intervals with more sign changes are halved, and the left half is searched first.

// Coefficients of the powers of the share of the step, and of the Bernstein form on an interval.
var<private> powers: array<Real, COEFFICIENTS>;
var<private> bernstein: array<Real, COEFFICIENTS>;

// Whether a function that does not become negative touches zero within rounding.
var<private> touches: bool;

// Stands for "no root" where a share of a step is returned.
const NO_ROOT: Real = 2.0;

// Computes the Bernstein form on `[low, high]` of the polynomial whose lowest coefficient is `powers[order]`.
fn convert(order: u32, low: Real, high: Real) {
    let degree = shape.terms - order;
    for (var i = 0u; i <= degree; i++) {
        bernstein[i] = powers[order + i];
    }
    if low > 0.0 {
        // Taylor shift to `low`.
        for (var i = 0u; i < degree; i++) {
            for (var j = degree; j > i; j--) {
                bernstein[j - 1u] += low * bernstein[j];
            }
        }
    }
    // Divides the coefficient of u^j by the binomial coefficient, and then forms sums as in Pascal's triangle.
    var factor: Real = 1.0;
    for (var j = 0u; j <= degree; j++) {
        bernstein[j] *= factor;
        factor *= (high - low) * Real(j + 1u) / Real(max(degree - j, 1u));
    }
    for (var i = 0u; i < degree; i++) {
        for (var j = degree; j > i; j--) {
            bernstein[j] += bernstein[j - 1u];
        }
    }
}

// Returns the share of the step at which a function that is positive at first becomes negative, or NO_ROOT. Its first `order` coefficients
// are zero within rounding. `size` bounds the terms that cancel in the coefficients.
fn first_fall(order: u32, size: Real) -> Real {
    touches = false;
    var rest: Real = 0.0;
    for (var k = order + 1u; k <= shape.terms; k++) {
        rest += abs(powers[k]);
    }
    let noise = POLYNOMIAL_ROUNDING * select(rest, rest + size, order == 0u);
    if powers[order] > rest + noise {
        return NO_ROOT;
    }
    if !(powers[order] > 0.0) {
        return 0.0;
    }
    let degree = shape.terms - order;
    var low: Real = 0.0;
    var high: Real = 1.0;
    for (var n = 0u; n < MOST_HALVINGS; n++) {
        convert(order, low, high);
        iterations += TERMS * (TERMS + 2u);
        var changes = 0u;
        var largest_size = abs(bernstein[0]);
        for (var i = 1u; i <= degree; i++) {
            changes += select(0u, 1u, (bernstein[i - 1u] > 0.0) != (bernstein[i] > 0.0));
            largest_size = max(largest_size, abs(bernstein[i]));
        }
        let is_single = changes == 1u && bernstein[0] > 0.0;
        let is_blurred = high - low < NARROWEST || largest_size <= noise;
        if is_single || (is_blurred && changes > 0u && bernstein[degree] < -noise) {
            return root(order, low, high);
        }
        if changes == 0u && bernstein[0] > 0.0 || is_blurred {
            touches = touches || changes > 0u || !(bernstein[0] > 0.0);
            if high >= 1.0 {
                return NO_ROOT;
            }
            low = high;
            high = 1.0;
        } else {
            high = 0.5 * (low + high);
        }
    }
    touches = true;
    return NO_ROOT;
}

// Finds the only root in an interval by Newton's method, or by bisection if a Newton step would leave the interval.
fn root(order: u32, begin_at: Real, end_at: Real) -> Real {
    var low = begin_at;
    var high = end_at;
    var u = 0.5 * (low + high);
    for (var n = 0u; n < ROOT_STEPS; n++) {
        iterations += TERMS;
        var value: Real = 0.0;
        var slope: Real = 0.0;
        for (var k = shape.terms + 1u; k > order; k--) {
            slope = slope * u + value;
            value = value * u + powers[k - 1u];
        }
        if value > 0.0 {
            low = u;
        } else {
            high = u;
        }
        let next = u - value / slope;
        if abs(next - u) <= ULP * u || high - low <= 2.0 * ULP * high {
            return clamp(next, low, high);
        }
        u = select(0.5 * (low + high), next, next > low && next < high);
    }
    return u;
}
