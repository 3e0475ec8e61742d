// Taylor series of the exact flow over a part of a step, in units of the domain's step.
//
// Loops over terms are marked with //% and unrolled before compilation (src/gpu/unroll.rs). Otherwise drivers do not keep the terms in
// registers.

var<private> gap_terms: array<Real, TERMS>;
var<private> x_terms: array<Real, TERMS>;

// Expands the motion about the present state and phase.
fn expand() {
    let q = motion.q;
    let g = here.gap_row;
    let r = here.x_row;
    let share = here.share;
    let angle = here.angle;
    var c = motion.phasor[0];
    var s = motion.phasor[1];
    let d = domain_of(tally.mode);
    expand_harmonics(place_of_gap(d), place_of_x(d));
    gap_terms[0] = q[0];
    gap_terms[1] = share * q[1];
    x_terms[0] = q[2];
    x_terms[1] = share * q[3];
    var load_gap = g[5];
    var load_x = r[5];
    //% for k in 0..TERMS-2: expand
    {
        let z = gap_terms[$k];
        let w = $(k+1).0 * gap_terms[$(k+1)];
        let x = x_terms[$k];
        let v = $(k+1).0 * x_terms[$(k+1)];
        let next: Real = 1.0 / ($(k+1).0 * $(k+2).0);
        gap_terms[$(k+2)] = next * (((g[0] * z + g[2] * x) + (g[1] * w + g[3] * v)) + with_term(g[4] * c + with_sine(load_gap, g[6], s), gap_force[$k]));
        x_terms[$(k+2)] = next * (((r[0] * z + r[2] * x) + (r[1] * w + r[3] * v)) + with_term(r[4] * c + with_sine(load_x, r[6], s), x_force[$k]));
        load_gap = 0.0;
        load_x = 0.0;
        let turn = angle * (1.0 / $(k+1).0);
        let turned = -turn * s;
        s = turn * c;
        c = turned;
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
    // Derivatives of order k and k + 1 of the motion, and of order k of the forcing.
    var z = motion.q[0];
    var w = here.share * motion.q[1];
    var x = motion.q[2];
    var v = here.share * motion.q[3];
    var c = motion.phasor[0];
    var s = motion.phasor[1];
    var load_gap = g[5];
    var load_x = r[5];
    //% for k in 0..5
    {
        let a = ((g[0] * z + g[2] * x) + (g[1] * w + g[3] * v))
            + with_derivative(g[4] * c + with_sine(load_gap, g[6], s), place_of_gap(d), here.angle, $ku);
        let b = ((r[0] * z + r[2] * x) + (r[1] * w + r[3] * v))
            + with_derivative(r[4] * c + with_sine(load_x, r[6], s), place_of_x(d), here.angle, $ku);
        z = w;
        w = a;
        x = v;
        v = b;
        load_gap = 0.0;
        load_x = 0.0;
        let turned = -here.angle * s;
        s = here.angle * c;
        c = turned;
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
