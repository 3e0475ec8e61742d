// Tangent vectors of an oscillator with one gap: propagation along a flight, and saltation at events.

// Carries the columns of the monodromy matrix over full steps. Each vector counts as one iteration.
fn step_columns(count: u32) {
    if tally.tangent_count <= 1u {
        return;
    }
    let m = propagator();
    for (var i = 0u; i < tally.tangent_count; i++) {
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

// Changes of the tangent vectors at the end of a careful step.
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

// Carries every vector over a part of a step and the event after it. A stuck gap has the same displacement and rate in all neighbouring
// motions.
fn carry_tangents(flight_pull: Pull, tau: Real, held: bool) {
    let back = 1.0 / flight_pull.share;
    for (var i = 0u; i < tally.tangent_count; i++) {
        iterations += 1u;
        var u = tangent(i);
        if held {
            u[0] = 0.0;
            u[1] = 0.0;
        }
        u[1] *= flight_pull.share;
        u[3] *= flight_pull.share;
        u = glide(flight_pull, u, tau);
        u[1] *= back;
        u[3] *= back;
        if crossing.jump.event {
            u = saltate(u);
        }
        if crossing.lasts > 0.0 {
            u = close(u);
        }
        set_tangent(i, u);
    }
    check_range();
}

// Carries a vector over a part `tau` of a step: the series of the unforced motion.
fn glide(flight_pull: Pull, u: array<Real, 4>, tau: Real) -> array<Real, 4> {
    let g = flight_pull.gap_row;
    let r = flight_pull.x_row;
    var z = u[0];
    var w = u[1];
    var x = u[2];
    var v = u[3];
    var sum = u;
    // (z, w, x, v): derivatives of order k and k + 1, times tau^k / k!.
    //% for k in 1..TERMS: glide
    {
        let step = tau * (1.0 / $k.0);
        let a = (g[0] * z + g[2] * x) + (g[1] * w + g[3] * v);
        let b = (r[0] * z + r[2] * x) + (r[1] * w + r[3] * v);
        z = step * w;
        x = step * v;
        w = step * a;
        v = step * b;
        sum[0] += z;
        sum[1] += w;
        sum[2] += x;
        sum[3] += v;
    }
    //% end
    return sum;
}

// Carries a vector over a short flight of free motion.
fn glide_short(u: array<Real, 4>, tau: Real) -> array<Real, 4> {
    let g = here.gap_row;
    let r = here.x_row;
    var z = u[0];
    var w = u[1];
    var x = u[2];
    var v = u[3];
    var sum = u;
    //% again glide for k in 1..SHORT_TERMS
    return sum;
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
