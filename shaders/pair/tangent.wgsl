// Tangent vectors of an oscillator with one gap: propagation along a flight, and saltation at events.

fn set_tangent(i: u32, u: State) {
    if GROWTH {
        tangent_now = u;
        return;
    }
    //% for k in 0..DIM
    motions[lane].tangents[DIM * i + $ku] = u[$ku];
    //% end
}

// Returns a column of the monodromy matrix.
fn column(i: u32) -> State {
    var u: State;
    //% for k in 0..DIM
    u[$ku] = motions[lane].tangents[DIM * i + $ku];
    //% end
    return u;
}

// Carries the columns of the monodromy matrix over full steps. Each vector counts as one iteration.
fn step_columns(count: u32) {
    let m = propagator();
    for (var i = 0u; i < VECTORS; i++) {
        var u = tangent(i);
        u[1] *= here.share;
        u[3] *= here.share;
        for (var j = 0u; j < count; j++) {
            u = array<Real, 4>(
                u[0] + ((m[0] * u[0] + m[1] * u[1]) + (m[2] * u[2] + m[3] * u[3])),
                u[1] + ((m[7] * u[0] + m[8] * u[1]) + (m[9] * u[2] + m[10] * u[3])),
                u[2] + ((m[14] * u[0] + m[15] * u[1]) + (m[16] * u[2] + m[17] * u[3])),
                u[3] + ((m[21] * u[0] + m[22] * u[1]) + (m[23] * u[2] + m[24] * u[3])),
            );
        }
        u[1] *= here.substeps;
        u[3] *= here.substeps;
        set_tangent(i, u);
    }
}

// Changes of the tangent vectors by an event.
struct Crossing {
    // The event, and the vector fields before and after it.
    jump: Jump,
    before: array<Real, 4>,
    after: array<Real, 4>,
    // An infinite sequence of impacts after the event. `lasts`: its duration, 0 without a sequence. `pressing`: the acceleration into the
    // wall at its end. `late_by`: delay of the end of a neighbour's sequence per (z, w, x, v), with x and v for a closed gap. `v_by`:
    // change of the acceleration of x per w, x, v.
    lasts: Real,
    pressing: Real,
    late_by: array<Real, 4>,
    v_by: array<Real, 3>,
    // Whether state and field are continuous, so that tangents change by `jolt` alone: a change of the rates of gap and x per displacement
    // of the gap.
    is_smooth: bool,
    jolt: array<Real, 2>,
}

var<private> crossing: Crossing;

// Carries every vector over a part of a step. A stuck gap has the same displacement and rate in all neighbouring motions.
fn glide_tangents(tau: Real, held: bool) {
    let g = here.gap_row;
    let r = here.x_row;
    let f = exponential(fourth_power(g, r), tau);
    for (var i = 0u; i < VECTORS; i++) {
        iterations += 1u;
        var u = tangent(i);
        if held {
            u[0] = 0.0;
            u[1] = 0.0;
        }
        u[1] *= here.share;
        u[3] *= here.share;
        u = glide(g, r, f, u);
        u[1] *= here.substeps;
        u[3] *= here.substeps;
        set_tangent(i, u);
    }
}

// Applies an event to every vector.
fn jump_tangents() {
    for (var i = 0u; i < VECTORS; i++) {
        var u = tangent(i);
        if crossing.jump.event {
            u = saltate(u);
        }
        if crossing.lasts > 0.0 {
            u = close(u);
        }
        set_tangent(i, u);
    }
}

// Returns the factors of `A^4 = c0 + c1 A + c2 A^2 + c3 A^3`, where A is the matrix of (z, w, x, v) in unforced motion. They follow from
// its characteristic polynomial by the theorem of Cayley and Hamilton.
fn fourth_power(g: array<Real, 7>, r: array<Real, 7>) -> vec4<Real> {
    return vec4<Real>(
        g[2] * r[0] - g[0] * r[2],
        (g[2] * r[1] - g[1] * r[2]) + (g[3] * r[0] - g[0] * r[3]),
        (g[3] * r[1] - g[1] * r[3]) + (g[0] + r[2]),
        g[1] + r[3],
    );
}

// Returns the factors of `exp(A tau) = f0 + f1 A + f2 A^2 + f3 A^3`. Each term of the exponential series adds to all four.
fn exponential(c: vec4<Real>, tau: Real) -> vec4<Real> {
    var part = tau * tau * tau * (1.0 / 6.0);
    var f = vec4<Real>(1.0, tau, 0.5 * tau * tau, part);
    // Factors of A^k.
    var power = vec4<Real>(0.0, 0.0, 0.0, 1.0);
    //% for k in 4..TERMS: exponential
    part *= tau * (1.0 / $k.0);
    power = vec4<Real>(0.0, power.x, power.y, power.z) + power.w * c;
    f += part * power;
    //% end
    return f;
}

// Like `exponential`, for a short flight.
fn short_exponential(c: vec4<Real>, tau: Real) -> vec4<Real> {
    var part = tau * tau * tau * (1.0 / 6.0);
    var f = vec4<Real>(1.0, tau, 0.5 * tau * tau, part);
    var power = vec4<Real>(0.0, 0.0, 0.0, 1.0);
    //% again exponential for k in 4..SHORT_TERMS
    return f;
}

// Multiplies a vector by `exp(A tau)`.
fn glide(g: array<Real, 7>, r: array<Real, 7>, f: vec4<Real>, u: array<Real, 4>) -> array<Real, 4> {
    // Derivatives of gap and x.
    let a = g[3] * u[3] + (g[1] * u[1] + (g[0] * u[0] + g[2] * u[2]));
    let b = r[3] * u[3] + (r[1] * u[1] + (r[0] * u[0] + r[2] * u[2]));
    let a1 = g[3] * b + (g[1] * a + (g[0] * u[1] + g[2] * u[3]));
    let b1 = r[3] * b + (r[1] * a + (r[0] * u[1] + r[2] * u[3]));
    let a2 = g[3] * b1 + (g[1] * a1 + (g[0] * a + g[2] * b));
    let b2 = r[3] * b1 + (r[1] * a1 + (r[0] * a + r[2] * b));
    return array<Real, 4>(
        f.x * u[0] + (f.y * u[1] + (f.z * a + f.w * a1)),
        f.x * u[1] + (f.y * a + (f.z * a1 + f.w * a2)),
        f.x * u[2] + (f.y * u[3] + (f.z * b + f.w * b1)),
        f.x * u[3] + (f.y * b + (f.z * b1 + f.w * b2)),
    );
}

// Returns the present vector field, per free step.
fn field() -> array<Real, 4> {
    let square = here.substeps * here.substeps;
    let d = domain_of(tally.mode);
    let a = acceleration(here.gap_row, here.share, motion.q, place_of_gap(d));
    let b = acceleration(here.x_row, here.share, motion.q, place_of_x(d));
    return array<Real, 4>(motion.q[1], square * a, motion.q[3], square * b);
}

// Applies the saltation matrix: `S u = R u + (f+ - R f-) (n . u) / (n . f-)`. R is the jump of rates by `rate_factor`
// (-e at an impact, 1 elsewhere) and `kick`.
fn saltate(u: array<Real, 4>) -> array<Real, 4> {
    if KINDS && crossing.is_smooth {
        return array<Real, 4>(u[0], u[1] + crossing.jolt[0] * u[0], u[2], u[3] + crossing.jolt[1] * u[0]);
    }
    let jump = crossing.jump;
    let before = crossing.before;
    let after = crossing.after;
    let inverse = select(1.0 / jump.rate, Real(0.0), abs(jump.rate) < NO_SPEED * speed);
    let along = inverse * ((jump.normal[0] * u[0] + jump.normal[1] * u[1]) + (jump.normal[2] * u[2] + jump.normal[3] * u[3]));
    // The first row is the quotient of the gap's rates. As a sum it would lose digits if `e` is small.
    return array<Real, 4>(
        jump.rate_factor * u[0],
        jump.rate_factor * u[1] + (after[1] - jump.rate_factor * before[1]) * along,
        u[2] + (after[2] - before[2]) * along,
        u[3] + jump.kick * u[1] + (after[3] - before[3] - jump.kick * before[1]) * along,
    );
}

// Carries a vector through an infinite sequence of impacts. A neighbour's sequence ends later by `late`. Until then, the pressing
// acceleration does not act on it. x moves as it does with a closed gap.
fn close(u: array<Real, 4>) -> array<Real, 4> {
    let x = u[2] + kick * u[0];
    let v = u[3] + kick * u[1];
    let by = crossing.late_by;
    let late = (by[0] * u[0] + by[1] * u[1]) + (by[2] * x + by[3] * v);
    let behind = -crossing.pressing * late;
    let gained = crossing.lasts * (crossing.v_by[1] * x + crossing.v_by[2] * v) - crossing.v_by[0] * u[0];
    return array<Real, 4>(0.0, behind, x + crossing.lasts * v, v + (gained - kick * behind));
}
