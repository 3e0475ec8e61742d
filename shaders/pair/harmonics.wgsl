// Harmonics of the force beside the first. Their number, HARMONICS, is known when the shader is compiled; a flow may have fewer. Without
// harmonics these functions return their arguments unchanged.
//
// For each harmonic a flow has PAIRS_PER_HARMONIC pairs of numbers. The first pair contains the order. The other pairs are factors of
// cosine and sine: in the acceleration of a gap at rest on the right wall and on the left wall; then for each domain in the accelerations
// of the gap and of x, and in the four rows of the propagator. `place` below is the place of a pair.

const PAIRS_PER_DOMAIN: u32 = 6u;
const PLACE_OF_PRESSING: u32 = 1u;
const PLACE_OF_DOMAINS: u32 = 3u;

// Phasors of the harmonics at the present step and fraction.
var<private> overtones: array<vec2<Real>, HARMONICS + 1u>;

// Derivatives, from order 0 on, of the harmonics' part in the accelerations of gap and x.
var<private> gap_force: array<Real, TERMS>;
var<private> x_force: array<Real, TERMS>;

fn place_of_gap(domain: u32) -> u32 {
    return PLACE_OF_DOMAINS + PAIRS_PER_DOMAIN * domain;
}

fn place_of_x(domain: u32) -> u32 {
    return place_of_gap(domain) + 1u;
}

fn place_of_step(domain: u32) -> u32 {
    return place_of_gap(domain) + 2u;
}

// Returns a pair of a harmonic. The buffer begins with zeros, which stand for a harmonic that the flow does not have.
fn harmonic_pair(n: u32, place: u32) -> vec2<Real> {
    let first = select(0u, shape.harmonics + PAIRS_PER_HARMONIC * n, n < shape.harmonic_count);
    let pair = pairs[first + place];
    return vec2<Real>(pair[0], pair[1]);
}

fn order_of(n: u32) -> Real {
    return harmonic_pair(n, 0u).x;
}

// Computes the phasors of the harmonics at a step and a fraction. They depend on step and fraction alone, so they are the same wherever a
// dispatch ends.
fn sync_overtones(step: u32, theta: Real) {
    //% for k in 0..HARMONICS
    {
        let start = pairs[shape.phasors + (u32(order_of($ku)) * step) % shape.steps];
        let turn = small_turn(theta * order_of($ku) * (here.angle * here.substeps));
        overtones[$k] = vec2<Real>(
            start[0] + (turn.x * start[0] - turn.y * start[1]),
            start[1] + (turn.y * start[0] + turn.x * start[1]),
        );
    }
    //% end
}

// Returns the derivative, of an order up to 7, of a phasor that turns by `angle` per unit of time.
fn derivative_of(phasor: vec2<Real>, angle: Real, order: u32) -> vec2<Real> {
    var p = phasor;
    let square = angle * angle;
    if (order & 1u) != 0u {
        p = angle * vec2<Real>(-p.y, p.x);
    }
    if (order & 2u) != 0u {
        p = -square * p;
    }
    if (order & 4u) != 0u {
        p = (square * square) * p;
    }
    return p;
}

// Adds a derivative of the harmonics' part in a row to `rest`. The first harmonic turns by `angle` per step.
fn with_derivative(rest: Real, place: u32, angle: Real, order: u32) -> Real {
    var sum = rest;
    //% for k in 0..HARMONICS
    {
        sum += dot(harmonic_pair($ku, place), derivative_of(overtones[$k], order_of($ku) * angle, order));
    }
    //% end
    return sum;
}

// Adds the harmonics' part in a row to `rest`.
fn with_harmonics(rest: Real, place: u32) -> Real {
    return with_derivative(rest, place, 0.0, 0u);
}

// Adds the sizes of the harmonics' terms in a row to `rest`.
fn with_sizes(rest: Real, place: u32) -> Real {
    var sum = rest;
    //% for k in 0..HARMONICS
    {
        sum += dot(abs(harmonic_pair($ku, place)), abs(overtones[$k]));
    }
    //% end
    return sum;
}

// Adds a bound on a derivative, of order 5 or 6, of the harmonics' part in a row to `rest`.
fn with_bound(rest: Real, place: u32, order: u32) -> Real {
    var sum = rest;
    //% for k in 0..HARMONICS
    {
        let angle = order_of($ku) * here.angle;
        let square = angle * angle;
        let size = dot(abs(harmonic_pair($ku, place)), vec2<Real>(1.0, 1.0));
        sum += size * (square * square) * select(square, angle, order == 5u);
    }
    //% end
    return sum;
}

// Computes the derivatives of the harmonics' part in two rows.
fn expand_harmonics(gap_place: u32, x_place: u32) {
    if HARMONICS == 0u {
        return;
    }
    //% for k in 0..TERMS
    gap_force[$k] = 0.0;
    x_force[$k] = 0.0;
    //% end
    //% for k in 0..HARMONICS
    {
        expand_harmonic(overtones[$k], order_of($ku) * here.angle, harmonic_pair($ku, gap_place), harmonic_pair($ku, x_place));
    }
    //% end
}

fn expand_harmonic(phasor: vec2<Real>, angle: Real, gap: vec2<Real>, x: vec2<Real>) {
    var p = phasor;
    //% for k in 0..TERMS
    gap_force[$k] += dot(gap, p);
    x_force[$k] += dot(x, p);
    p = angle * vec2<Real>(-p.y, p.x);
    //% end
}

// Adds a derivative of the harmonics' part to `rest`.
fn with_term(rest: Real, term: Real) -> Real {
    if HARMONICS > 0u {
        return rest + term;
    }
    return rest;
}
