// Chatter: the load presses the gap to its wall, and impacts become slower and slower. Short flights are followed impact by impact, with a
// short series. Without a meshing speed the sequence of impacts is infinite and is replaced by its limit.

// Whether a sequence of impacts that the load presses back is infinite.
fn is_endless(side: u32) -> bool {
    return restitution(side) < 1.0 && mesh_speed(side) <= NO_THRESHOLD * speed;
}

// Replaces the rest of an infinite sequence of impacts by its limit. The rest must be so short that the terms which the formula omits are
// negligible. The gap then rests on the wall, and meshing starts.
//
// `u` is the leaving speed, G the pressing acceleration, J its rate of change while the gap stays closed, and gamma the damping of the gap.
// With `T = 2 u / (G (1 - e))` the sequence lasts `T (1 - J T / (3 G) - gamma T / 6)`, up to third order. Meanwhile x moves as it does with
// a closed gap. Tangent vectors follow these formulas up to second order.
fn close_chatter(side: u32, u: Real) {
    if !is_endless(side) {
        return;
    }
    let e = restitution(side);
    let sign = sign_of(side);
    let rate = motion.q[3] + kick * motion.q[1];
    let closed = array<Real, 4>(motion.q[0], 0.0, motion.q[2], rate);
    // The wall's force cancels the acceleration of the gap; x receives its share of that force.
    let wall_acceleration = acceleration(here.gap_row, here.share, closed, place_of_gap(0u));
    let v_rate = acceleration(here.x_row, here.share, closed, place_of_x(0u)) + kick * wall_acceleration;
    let pressing = sign * wall_acceleration;
    let whole = 2.0 * u / (pressing * (1.0 - e));
    if !(pressing > 0.0 && whole < closing) {
        return;
    }
    let row = here.gap_row;
    let sine_rate = here.angle * motion.phasor[0];
    let first = with_sine(row[2] * rate + row[3] * v_rate - row[4] * here.angle * motion.phasor[1], row[6], sine_rate);
    let change = sign * with_derivative(first, place_of_gap(0u), here.angle, 1u);
    let damping = kick * row[3] - row[1];
    let lasts = whole * (1.0 - (change / (3.0 * pressing) + damping * (1.0 / 6.0)) * whole);
    // If a stop phase would interrupt the sequence, the motion continues impact by impact until the rest fits before the next stop phase.
    if lasts <= 0.0 || lasts >= steps_to_stop(next_stop_phase()) {
        return;
    }
    let across = here.x_row;
    let v_by_x = across[2] + kick * row[2];
    let v_by_v = across[3] + kick * row[3];
    let unforced = v_by_x * rate + v_by_v * v_rate;
    let forced = with_sine(unforced - (across[4] + kick * row[4]) * here.angle * motion.phasor[1], across[6] + kick * row[6], sine_rate);
    let of_gap = kick * with_derivative(0.0, place_of_gap(0u), here.angle, 1u);
    let v_jerk = with_term(with_derivative(forced, place_of_x(0u), here.angle, 1u), of_gap);
    if VECTORS > 0u {
        // A neighbouring motion leaves the wall at another time, with another speed and pressing acceleration. Its sequence ends later by
        // `late_by`.
        let per_speed = (1.0 - 2.0 * (change / (3.0 * pressing) + damping * (1.0 / 6.0)) * whole) * whole / u;
        let per_pressing = (1.0 - (change / pressing + damping * (1.0 / 3.0)) * whole) * whole / pressing;
        crossing.lasts = lasts;
        // If the gap sticks at the end, it also sticks in all neighbouring motions.
        crossing.pressing = select(sign * (pressing + lasts * change), Real(0.0), is_rigid(side));
        crossing.late_by = array<Real, 4>(
            sign * (1.0 - per_speed * (pressing + damping * u) - per_pressing * change) / u,
            -sign * per_speed,
            -sign * per_pressing * row[2],
            -sign * per_pressing * row[3],
        );
        crossing.v_by = array<Real, 3>((across[1] + kick * row[1]) - kick * v_by_v, v_by_x, v_by_v);
    }
    let ends = array<Real, 4>(
        0.0,
        0.0,
        closed[2] + lasts * (rate + lasts * (0.5 * v_rate + lasts * (1.0 / 6.0) * v_jerk)),
        rate + lasts * (v_rate + 0.5 * lasts * v_jerk),
    );
    if MEASURE {
        // The sequence dissipates the energy with which the gap leaves the wall.
        add(SUM_LOST, u * u);
        measure_series(closed, ends, lasts);
    }
    motion.q = ends;
    advance_phase(lasts);
    turn_phasor(lasts);
    sync_overtones(tally.step, motion.theta);
    count_event(side);
    tally.mode = MODE_SUSTAINED + side;
    tally.order = 2u;
    if is_rigid(side) {
        tally.mode = MODE_STUCK + side;
        tally.order = stuck_order(side);
    }
    enter(domain_of(tally.mode));
}

// Whether the last event was an impact after which a series of short flights begins.
var<private> chatters: bool;

// Whether the parabola of the flight from wall `side` at leaving speed `u` is short, and whether two more flights follow.
fn begins_chatter(side: u32, u: Real) -> bool {
    let e = restitution(side);
    let pressing = sign_of(side) * acceleration(here.gap_row, here.share, motion.q, place_of_gap(0u));
    let is_short = u > 0.0 && 2.0 * u < SHORT * pressing;
    return mesh_speed(side) <= FOLLOWED_MESH_SPEED * speed && is_short && e * e * u > least_leaving(side, pressing);
}

// Returns the leaving speed at which a sequence ends: in meshing, or by its limit if it is infinite.
fn least_leaving(side: u32, pressing: Real) -> Real {
    // 1 % above the limit of `close_chatter`, so that the speed falls below this value first.
    return select(mesh_speed(side), 0.505 * closing * (1.0 - restitution(side)) * pressing, is_endless(side));
}

// Largest number of flights that one call follows.
const SHORT_FLIGHTS: u32 = 100u;

// Follows short flights under a pressing load, impact by impact. A short flight needs fewer terms of the series for the same accuracy, its
// end needs no search, and no other event is possible on it.
//
// Let n = SHORT_TERMS - 1 be the number of the gap's terms beyond its start, G the pressing acceleration, and B a bound on the n-th
// derivative. The derivative of order n + 1 is at most 2 B, because a step turns the fastest mode by at most a radian. At the end of a
// flight of length t, the relative error of the speed is then at most `4 (B / G) t^(n-1) / n! (1 + 2 / (n + 1))`. It is at most ULP where
// `B (t / SHORT)^(n-1) <= G`. Each flight is e times as long as the previous one. So the error of a whole sequence is at most `1 / (1 -
// e^(n-1))` times the error of its first flight.
//
// The careful step handles the last impact before meshing or the limit, and the motion once the load no longer presses.
fn follow_chatter(side: u32) {
    let sign = sign_of(side);
    let e = restitution(side);
    let row = here.gap_row;
    let damping = kick * row[3] - row[1];
    let begun = motion.phasor;
    var elapsed: Real = 0.0;
    for (var n = 0u; n < SHORT_FLIGHTS; n++) {
        expand_short();
        let t = short_flight();
        if !(t > 0.0 && elapsed + t < 1.0 && t < steps_to_stop(next_stop_phase())) {
            break;
        }
        let end = short_end(t);
        let removed = (1.0 + e) * end.rate;
        let leaving = e * sign * end.rate;
        let pressing = sign * (end.acceleration + damping * removed);
        if !(pressing > 0.0 && leaving > least_leaving(side, pressing)) {
            break;
        }
        iterations += 1u;
        elapsed += t;
        motion.q = array<Real, 4>(walls[side], -sign * leaving, end.x, end.x_rate + kick * removed);
        advance_phase(t);
        motion.phasor = begun;
        turn_phasor(elapsed);
        sync_overtones(tally.step, motion.theta);
        tally.passes_in_period += 1u;
        tally.impacts += 1u;
        count_event(side);
        if VECTORS > 0u {
            carry_over_short(t, end, removed);
        }
        if tally.status != STATUS_OK {
            break;
        }
    }
    renew_bound();
}

// Expands motion that starts on a wall, like `expand` but with fewer terms.
fn expand_short() {
    let q = motion.q;
    let g = here.gap_row;
    let r = here.x_row;
    expand_harmonics(place_of_gap(0u), place_of_x(0u));
    gap_terms[0] = q[0];
    gap_terms[1] = q[1];
    x_terms[0] = q[2];
    x_terms[1] = q[3];
    var z = q[0];
    var w = q[1];
    var x = q[2];
    var v = q[3];
    var part: Real = 1.0;
    var force = Forcing(forcing(g), forcing(r));
    var load = vec2<Real>(g[5], r[5]);
    let turn = -here.angle * here.angle;
    //% again expand for k in 0..SHORT_TERMS-2
}

// Returns the duration of the flight from the wall, in steps; 0 if the flight is not short.
fn short_flight() -> Real {
    let w = gap_terms[1];
    let half = gap_terms[2];
    // Root of the parabola, with two orders of corrections.
    let inverse = 1.0 / half;
    let first = -w * inverse;
    let cubic = first * gap_terms[3] * inverse;
    let quartic = first * first * gap_terms[4] * inverse;
    var t = first * (1.0 - cubic + (2.0 * cubic * cubic - quartic));
    var step: Real = 0.0;
    iterations += 2u;
    for (var n = 0u; n < 2u; n++) {
        var p: Real = 0.0;
        var p1: Real = 0.0;
        //% for k in 1..SHORT_TERMS down
        p1 = p1 * t + p;
        p = p * t + gap_terms[$k];
        //% end
        step = p / p1;
        t -= step;
    }
    // At least half of G presses throughout the flight. So the gap returns once, and its height is below `w^2 / G`; the other wall must be
    // farther away.
    let is_clear = w * w < abs(half) * (walls[0] - walls[1]);
    var change: Real = 0.0;
    //% for k in 3..SHORT_TERMS down
    change = change * t + ($k.0 * $(k-1).0) * abs(gap_terms[$k]);
    //% end
    let last = SHORT_TERMS - 1u;
    let bound = here.swell * (here.growth + derivative_bound(
        SHORT_FACTORIAL * gap_terms[last - 1u],
        Real(last) * SHORT_FACTORIAL * gap_terms[last],
        SHORT_FACTORIAL * x_terms[last - 1u],
        Real(last) * SHORT_FACTORIAL * x_terms[last],
    ));
    var error = bound;
    let share = t * (1.0 / SHORT);
    //% for k in 2..SHORT_TERMS
    error *= share;
    //% end
    let is_pressed = change * t <= abs(half);
    let is_exact = error <= 2.0 * abs(half) && step * step <= ULP * t * t;
    return select(Real(0.0), t, t > 0.0 && is_pressed && is_clear && is_exact);
}

// State at the end of a short flight, before the impact.
struct End {
    rate: Real,
    acceleration: Real,
    x: Real,
    x_rate: Real,
    x_acceleration: Real,
}

fn short_end(t: Real) -> End {
    var w: Real = 0.0;
    var a: Real = 0.0;
    var x: Real = 0.0;
    var v: Real = 0.0;
    var b: Real = 0.0;
    //% for k in 0..SHORT_TERMS down
    b = b * t + v;
    v = v * t + x;
    x = x * t + x_terms[$k];
    //% end
    //% for k in 1..SHORT_TERMS down
    w = w * t + $k.0 * gap_terms[$k];
    //% end
    //% for k in 2..SHORT_TERMS down
    a = a * t + ($k.0 * $(k-1).0) * gap_terms[$k];
    //% end
    return End(w, a, x, v, 2.0 * b);
}

// Carries the tangent vectors over a short flight and the impact at its end.
fn carry_over_short(t: Real, end: End, removed: Real) {
    let row = here.gap_row;
    let x_row = here.x_row;
    crossing.before = array<Real, 4>(end.rate, end.acceleration, end.x_rate, end.x_acceleration);
    crossing.after = array<Real, 4>(
        motion.q[1],
        end.acceleration + (kick * row[3] - row[1]) * removed,
        motion.q[3],
        end.x_acceleration + (kick * x_row[3] - x_row[1]) * removed,
    );
    crossing.jump.rate = end.rate;
    let f = short_exponential(fourth_power(row, x_row), t);
    for (var i = 0u; i < VECTORS; i++) {
        iterations += 1u;
        set_tangent(i, saltate(glide(row, x_row, f, tangent(i))));
    }
    check_range();
}
