// Taylor series of the exact flow over a part of a step, in units of the domain's step.
//
// Loops over terms are marked with //% and unrolled before compilation (src/gpu/unroll.rs). Otherwise drivers do not keep the terms in
// registers.

var<private> gap_terms: array<Real, TERMS>;
var<private> x_terms: array<Real, TERMS>;

// Derivatives of order k and k + 1 of the forcing in the accelerations of gap and x, without its constant part. The derivative of order
// k + 2 is that of order k times minus the square of the forcing's angle per step.
struct Forcing {
    gap: vec2<Real>,
    x: vec2<Real>,
}

// Returns value and first derivative of a row's forcing.
fn forcing(row: array<Real, 7>) -> vec2<Real> {
    let c = motion.phasor[0];
    let s = motion.phasor[1];
    return vec2<Real>(with_sine(row[4] * c, row[6], s), here.angle * with_sine(-row[4] * s, row[6], c));
}

// Expands the motion about the present state and phase.
fn expand() {
    let g = here.gap_row;
    let r = here.x_row;
    let d = domain_of(tally.mode);
    expand_harmonics(place_of_gap(d), place_of_x(d));
    gap_terms[0] = motion.q[0];
    gap_terms[1] = here.share * motion.q[1];
    x_terms[0] = motion.q[2];
    x_terms[1] = here.share * motion.q[3];
    // Derivatives of order k and k + 1, and the reciprocal of (k + 2)!.
    var z = gap_terms[0];
    var w = gap_terms[1];
    var x = x_terms[0];
    var v = x_terms[1];
    var part: Real = 1.0;
    var force = Forcing(forcing(g), forcing(r));
    var load = vec2<Real>(g[5], r[5]);
    let turn = -here.angle * here.angle;
    //% for k in 0..TERMS-2: expand
    {
        let a = g[3] * v + (g[1] * w + (g[0] * z + (g[2] * x + with_term(force.gap.x + load.x, gap_force[$k]))));
        let b = r[3] * v + (r[1] * w + (r[0] * z + (r[2] * x + with_term(force.x.x + load.y, x_force[$k]))));
        part *= 1.0 / $(k+2).0;
        gap_terms[$(k+2)] = part * a;
        x_terms[$(k+2)] = part * b;
        z = w;
        w = a;
        x = v;
        v = b;
        load = vec2<Real>(0.0, 0.0);
        force = Forcing(vec2<Real>(force.gap.y, turn * force.gap.x), vec2<Real>(force.x.y, turn * force.x.x));
    }
    //% end
}

// Returns a bound on the gap's derivative of order n + 1, from the derivatives of order n and n + 1 of gap and x. The bound is the energy
// of the differentiated motion.
fn derivative_bound(z: Real, w: Real, x: Real, v: Real) -> Real {
    let e = here.energy;
    let square = (e[0] * w * w + e[1] * w * v + e[2] * v * v) + (e[3] * z * z + e[4] * z * x + e[5] * x * x);
    return 1.0001 * sqrt(max(square, Real(0.0)));
}

// Bounds the sixth derivative of the gap at the present state, from five derivatives.
fn renew_bound() {
    let d = domain_of(tally.mode);
    let g = here.gap_row;
    let r = here.x_row;
    // Derivatives of order k and k + 1 of the motion.
    var z = motion.q[0];
    var w = here.share * motion.q[1];
    var x = motion.q[2];
    var v = here.share * motion.q[3];
    var force = Forcing(forcing(g), forcing(r));
    var load = vec2<Real>(g[5], r[5]);
    let turn = -here.angle * here.angle;
    //% for k in 0..5
    {
        let a = g[3] * v + (g[1] * w + (g[0] * z + (g[2] * x
            + with_derivative(force.gap.x + load.x, place_of_gap(d), here.angle, $ku))));
        let b = r[3] * v + (r[1] * w + (r[0] * z + (r[2] * x
            + with_derivative(force.x.x + load.y, place_of_x(d), here.angle, $ku))));
        z = w;
        w = a;
        x = v;
        v = b;
        load = vec2<Real>(0.0, 0.0);
        force = Forcing(vec2<Real>(force.gap.y, turn * force.gap.x), vec2<Real>(force.x.y, turn * force.x.x));
    }
    //% end
    motion.bound = derivative_bound(z, w, x, v);
}

// Returns the displacement of the gap from the expansion point at `tau`, its slope and its curvature.
fn gap_jet(tau: Real) -> vec3<Real> {
    var p = gap_terms[TERMS - 1u];
    var p1: Real = 0.0;
    var p2: Real = 0.0;
    //% for k in 1..TERMS-1 down
    p2 = p2 * tau + p1;
    p1 = p1 * tau + p;
    p = p * tau + gap_terms[$k];
    //% end
    // The sum omits the constant term, so that a flight from the wall keeps its relative accuracy.
    p2 = p2 * tau + p1;
    p1 = p1 * tau + p;
    return vec3<Real>(p * tau, p1, 2.0 * p2);
}

// Returns the acceleration of the gap at `tau`, its slope and its curvature.
fn pressing_jet(tau: Real) -> vec3<Real> {
    var p: Real = 0.0;
    var p1: Real = 0.0;
    var p2: Real = 0.0;
    //% for k in 2..TERMS down
    p2 = p2 * tau + p1;
    p1 = p1 * tau + p;
    p = p * tau + ($k.0 * $(k-1).0) * gap_terms[$k];
    //% end
    return vec3<Real>(p, p1, 2.0 * p2);
}

// Returns the state at `tau` of the expansion in lane units: gap, rate, x, rate.
fn state_at(tau: Real, substeps: Real) -> array<Real, 4> {
    var z = gap_terms[TERMS - 1u];
    var w: Real = 0.0;
    var x = x_terms[TERMS - 1u];
    var v: Real = 0.0;
    //% for k in 0..TERMS-1 down
    w = w * tau + z;
    z = z * tau + gap_terms[$k];
    v = v * tau + x;
    x = x * tau + x_terms[$k];
    //% end
    return array<Real, 4>(z, substeps * w, x, substeps * v);
}
