// The careful step: finds the first event on the next step and acts on it.

// Verdicts on a distance over a part of a step: it stays positive, it falls through zero once, or neither is certain.
const CLEAR: u32 = 0u;
const CROSSING: u32 = 1u;
const UNCLEAR: u32 = 2u;

// Judges a distance (positive inside) over a time `dt`, from value, slope and curvature at both ends. `order` is the order of its root at
// the start. This root is divided out, which drops `order` Bernstein coefficients. `eps` bounds the remainder.
fn judge(left: vec3<Real>, right: vec3<Real>, dt: Real, order: u32, eps: Real) -> u32 {
    let f0 = select(left.x, Real(0.0), order > 0u);
    let s0 = dt * left.y;
    let a0 = dt * dt * left.z;
    let f1 = right.x;
    let s1 = dt * right.y;
    let a1 = dt * dt * right.z;
    let c3 = 0.5 * ((f0 + 0.4 * s0 + 0.05 * a0) + (f1 - 0.4 * s1 + 0.05 * a1));
    var plus = 0u;
    plus |= select(0u, 1u, f0 > 0.0);
    plus |= select(0u, 2u, f0 + s0 * (1.0 / 6.0) > 0.0);
    plus |= select(0u, 4u, f0 + (s0 * (1.0 / 3.0) + a0 * (1.0 / 30.0)) > 0.0);
    plus |= select(0u, 16u, f1 - (s1 * (1.0 / 3.0) - a1 * (1.0 / 30.0)) > 0.0);
    plus |= select(0u, 32u, f1 - s1 * (1.0 / 6.0) > 0.0);
    plus |= select(0u, 64u, f1 > 0.0);
    // Signs of the two polynomials that enclose the function.
    let lower = (plus | select(0u, 8u, c3 > eps)) >> order;
    let upper = (plus | select(0u, 8u, c3 > -eps)) >> order;
    if lower == (127u >> order) {
        return CLEAR;
    }
    // Positive coefficients followed by negative ones mean one change of sign in each polynomial.
    let single = (lower & (lower + 1u)) == 0u && (upper & (upper + 1u)) == 0u && lower > 0u;
    if single && upper != (127u >> order) {
        return CROSSING;
    }
    return UNCLEAR;
}

// The two distances whose zeros may end a flight, each with slope and curvature.
struct Watch {
    first: vec3<Real>,
    second: vec3<Real>,
}

// Distances at the start of the careful step.
var<private> offsets: vec2<Real>;

fn watch(tau: Real) -> Watch {
    let z = gap_jet(tau);
    if tally.mode == MODE_FREE {
        var both = Watch(
            vec3<Real>(offsets.x - z.x, -z.y, -z.z),
            vec3<Real>(offsets.y + z.x, z.y, z.z),
        );
        if is_bounded_by_force(SIDE_RIGHT) {
            both.first = force_jet(offsets.x, z, tau);
        } else if is_bounded_by_force(SIDE_LEFT) {
            both.second = force_jet(offsets.y, z, tau);
        }
        return both;
    }
    let sign = sign_of(side_of(tally.mode));
    if tally.mode < MODE_ONSET || sticks() {
        return Watch(vec3<Real>(offsets.x + sign * z.x, sign * z.y, sign * z.z), vec3<Real>(HUGE, 0.0, 0.0));
    }
    return Watch(vec3<Real>(offsets.x - sign * z.x, -sign * z.y, -sign * z.z), sign * pressing_jet(tau));
}

fn set_offsets() {
    let z = motion.q[0];
    if tally.mode == MODE_FREE {
        offsets = vec2<Real>(walls[0] - z, z - walls[1]);
        if watches_force() {
            // A flight that begins where the force is 0 has a root at its start.
            let begins = tally.order > 0u && tally.origin == side_of_interval();
            let start = select(force_inside(motion.q), Real(0.0), begins);
            offsets = select(vec2<Real>(offsets.x, start), vec2<Real>(start, offsets.y), side_of_interval() == SIDE_RIGHT);
        }
    } else if sticks() {
        offsets = vec2<Real>(sign_of(side_of(tally.mode)) * gap_terms[0], 0.0);
    } else {
        let sign = sign_of(side_of(tally.mode));
        offsets = vec2<Real>(select(sign, -sign, tally.mode >= MODE_ONSET) * z, 0.0);
    }
}

// A crossing is certain if its slope exceeds the remainder by this factor. The derivative of a step's remainder is at most 1.08 times the
// remainder.
const STEEP: Real = 4.0;

// Largest number of Newton steps of the root search, and of all its steps. The steps after Newton's are bisections.
const NEWTON_CAP: u32 = 10u;
const ROOT_CAP: u32 = 120u;
// Largest number of parts into which one careful step may be divided.
const CHECK_CAP: u32 = 200u;

// Returns the root in (lo, hi] at which a distance on the exact flow falls from + to -, and the slope there. A root at the start is divided
// out.
fn root(second: bool, start: Real, end: Real, order: u32, guess: Real) -> vec2<Real> {
    var lo = start;
    var hi = end;
    var t = guess;
    for (var i = 0u; i < ROOT_CAP; i++) {
        iterations += 1u;
        let at = watch(t);
        let f = select(at.first, at.second, second);
        if f.x > 0.0 {
            lo = t;
        } else {
            hi = t;
        }
        // The error after a Newton step is of second order in the step.
        let step = f.x / (f.y - Real(order) * f.x / t);
        var next = t - step;
        let converged = abs(f.z) * (step * step) <= ULP * t * abs(f.y) || abs(step) <= 4.0 * ULP * t;
        if converged && next >= start && next <= end {
            return vec2<Real>(next, f.y);
        }
        if i >= NEWTON_CAP || !(next > lo && next < hi) {
            next = 0.5 * (lo + hi);
            if hi - lo <= 4.0 * ULP * hi {
                return vec2<Real>(next, f.y);
            }
        }
        t = next;
    }
    tally.status = STATUS_CAP_ROOT;
    return vec2<Real>(t, 0.0);
}

// Result of a careful step.
struct Find {
    // Whether there is an event, and which of the two distances vanishes.
    event: bool,
    second: bool,
    // Its time; the end of the step if there is no event.
    tau: Real,
}

// Returns the first event within `len` of the present step.
fn first_event(len: Real, growth: Real, order: vec2<u32>) -> Find {
    var orders = order;
    var a: Real = 0.0;
    var width = len;
    var left = watch(0.0);
    var checks = 0u;
    // Rounding has put the start on the boundary or beyond it.
    if orders.x == 0u && left.first.x <= 0.0 {
        return Find(true, false, 0.0);
    }
    if orders.y == 0u && left.second.x <= 0.0 {
        return Find(true, true, 0.0);
    }
    loop {
        checks += 1u;
        if checks > CHECK_CAP {
            tally.status = STATUS_CAP_ROOT;
            break;
        }
        iterations += 1u;
        var b = a + width;
        if b >= len - 0.5 * min(width, SHORTEST) {
            b = len;
        }
        let dt = b - a;
        let right = watch(b);
        let cube = dt * dt * dt;
        let rest = cube * cube * (1.0 / 14400.0);
        // In the contact onset the second distance is an acceleration, so its remainder has derivatives of two more orders.
        var eps = vec2<Real>((motion.bound + growth) * rest, (pressing_bound + growth) * rest) * here.swell
            + 8.0 * ULP * abs(offsets);
        if watches_force() {
            let of_force = force_bound(motion.bound + growth, rate_bound + growth) * rest * here.swell
                + 8.0 * ULP * size_of_force(motion.q);
            eps = select(vec2<Real>(eps.x, of_force), vec2<Real>(of_force, eps.y), side_of_interval() == SIDE_RIGHT);
        }
        let first = judge(left.first, right.first, dt, orders.x, eps.x);
        let second = judge(left.second, right.second, dt, orders.y, eps.y);
        if first == CLEAR && second == CLEAR {
            if b == len {
                break;
            }
            a = b;
            left = right;
            orders = vec2<u32>(0u, 0u);
            width = 2.0 * dt;
            continue;
        }
        // Between the ends, the distance may be smaller by an eighth of its bend. While the bend exceeds the remainder, a crossing is
        // possible even in a very short time.
        var is_shortest = dt <= SHORTEST;
        if is_shortest && dt > SHORTEST_STEP {
            let bend = dt * dt * vec2<Real>(
                max(abs(left.first.z), abs(right.first.z)),
                max(abs(left.second.z), abs(right.second.z)),
            );
            is_shortest = !((first != CLEAR && bend.x > 8.0 * eps.x) || (second != CLEAR && bend.y > 8.0 * eps.y));
        }
        // Both distances vanish within the shortest time that is resolved. Linear estimates decide which one is earlier.
        let both = first == CROSSING && second == CROSSING && is_shortest && orders.x + orders.y == 0u;
        if first + second == CROSSING || both {
            let falls = vec2<Real>(left.first.x - right.first.x, left.second.x - right.second.x);
            let is_earlier = left.second.x * falls.x < left.first.x * falls.y;
            let which = second == CROSSING && (is_earlier || !both);
            let at_start = select(left.first.x, left.second.x, which);
            let at_end = select(right.first.x, right.second.x, which);
            let order = select(orders.x, orders.y, which);
            var guess = a + clamp(at_start / (at_start - at_end), Real(0.01), Real(0.99)) * dt;
            if order > 0u {
                // The gap leaves a wall and is pressed back: the parabola of a short flight.
                let leaving = select(left.first, left.second, which);
                let short = -2.0 * leaving.y / leaving.z;
                guess = select(Real(0.5) * b, short, short > 0.0 && short < 0.5 * b);
            }
            let found = root(which, a, b, order, guess);
            // If the slope is below the remainder, there may be three roots instead of one.
            if dt * abs(found.y) > STEEP * select(eps.x, eps.y, which) || is_shortest {
                return Find(true, which, found.x);
            }
            width = 0.5 * dt;
            continue;
        }
        if !is_shortest {
            width = 0.5 * dt;
            continue;
        }
        // The shortest part is still unclear, so the gap touches the wall within rounding. At elastic walls this has no effect.
        let touched = select(side_of(tally.mode), select(SIDE_LEFT, SIDE_RIGHT, first != CLEAR), tally.mode == MODE_FREE);
        if !is_elastic(touched) || has_preload(touched) {
            tally.grazes += 1u;
        }
        if right.first.x <= 0.0 {
            return Find(true, false, b);
        }
        if right.second.x <= 0.0 {
            return Find(true, true, b);
        }
        if b == len {
            break;
        }
        a = b;
        left = right;
        orders = vec2<u32>(0u, 0u);
        width = dt;
    }
    return Find(false, false, len);
}

// If the gap began this step at rest and its acceleration was set to zero: a bound on the true acceleration; 0 otherwise.
var<private> balanced: Real;

// Bound on the eighth derivative of the gap, which the contact onset needs.
var<private> pressing_bound: Real;

// Bound on the seventh derivative of the gap, which the force of a wall that only pushes needs.
var<private> rate_bound: Real;

// Largest number of bisections for the time at which the contact onset is deepest.
const DEEPEST_CAP: u32 = 30u;

// Whether the gap meets the other wall in the contact onset, at most `tau` after the expansion point. The model has no rule for this case.
// The depth is concave while the spring presses, so its tangent at the start is a bound. If this bound does not exclude the wall, the
// deepest point is searched.
fn crosses_backlash(tau: Real) -> bool {
    let backlash = walls[0] - walls[1];
    let rate = abs(gap_terms[1]);
    if offsets.x + rate * tau < backlash {
        return false;
    }
    var early: Real = 0.0;
    var late = tau;
    for (var i = 0u; i < DEEPEST_CAP; i++) {
        iterations += 1u;
        let middle = 0.5 * (early + late);
        let depth = watch(middle).first;
        if depth.x >= backlash {
            return true;
        }
        if depth.y > 0.0 {
            early = middle;
        } else {
            late = middle;
        }
    }
    return watch(tau).first.x >= backlash;
}

// Moves to the first event of the next step, or to its end, and acts on the event. Returns true at a stop phase.
fn careful() -> bool {
    let d = domain_of(tally.mode);
    let substeps = here.substeps;
    let share = here.share;
    sync_phasor();
    iterations += 1u;
    expand();
    if sticks() {
        expand_stuck();
    }
    if KINDS && tally.order == 3u {
        // The gap has just been released.
        gap_terms[2] = 0.0;
    }
    set_offsets();
    motion.bound =
        derivative_bound(120.0 * gap_terms[5], 720.0 * gap_terms[6], 120.0 * x_terms[5], 720.0 * x_terms[6]);
    pressing_bound = motion.bound;
    if watches_force() {
        rate_bound =
            derivative_bound(720.0 * gap_terms[6], 5040.0 * gap_terms[7], 720.0 * x_terms[6], 5040.0 * x_terms[7]);
    }
    if sticks() {
        motion.bound = stuck_bound();
    }
    if is_onset() {
        pressing_bound =
            derivative_bound(5040.0 * gap_terms[7], 40320.0 * gap_terms[8], 5040.0 * x_terms[7], 40320.0 * x_terms[8]);
    }
    balanced = 0.0;
    if tally.order == 2u {
        let most = balance(here.gap_row, share, motion.q, place_of_gap(d));
        if abs(gap_terms[2]) <= 0.5 * most {
            gap_terms[2] = 0.0;
            tally.order = 3u;
            balanced = most;
        }
    }
    let stop = next_stop_phase();
    let part = steps_to_stop_phase(stop) * substeps;
    let lands = part <= 1.0 && tally.step + 1u == stop;
    var len = min(part, Real(1.0));
    var changes = false;
    if STAGES {
        let to_change = steps_to_change() * substeps;
        changes = to_change <= len && (tally.step == change_step || tally.step + 1u == change_step);
        len = select(len, to_change, changes);
    }
    let on_second = tally.mode == MODE_FREE && tally.origin == SIDE_LEFT;
    let order = select(vec2<u32>(tally.order, 0u), vec2<u32>(0u, tally.order), on_second);
    let found = first_event(len, here.growth, order);
    if is_onset() && crosses_backlash(found.tau) {
        tally.status = STATUS_TOO_STIFF;
    }
    tally.passes_in_period += 1u;
    if MEASURE {
        measure_flight(found.tau);
    }
    motion.q = state_at(found.tau, substeps);
    let held = sticks();
    if held {
        motion.q[0] = 0.0;
        motion.q[1] = 0.0;
    }
    motion.bound = here.swell * (motion.bound + here.growth);
    tally.order = 0u;
    if MESH && (d > 0u || is_behind_wall()) {
        count_meshing(found.tau * share);
    }
    advance_phase(found.tau * share);
    if changes && !found.event {
        tally.step = change_step;
        motion.theta = change_theta;
    } else if lands && !found.event {
        tally.step = stop;
        motion.theta = 0.0;
    }
    check_finite();
    turn_phasor(found.tau);
    sync_overtones(tally.step, motion.theta);
    crossing = Crossing();
    let flight_pull = present_pull();
    if found.event {
        act(found.second, found.tau);
    }
    if EXPONENT {
        carry_tangents(flight_pull, found.tau, held);
    }
    return tally.step >= stop;
}

// Acts on the event that ends the flight at the present state, `tau` after the expansion point.
fn act(second: bool, tau: Real) {
    let settling = tau == 0.0;
    let mode = tally.mode;
    var side = side_of(mode);
    var is_force = false;
    var jump: Jump;
    if mode == MODE_FREE {
        side = select(SIDE_RIGHT, SIDE_LEFT, second);
        is_force = is_bounded_by_force(side);
        if !is_force {
            motion.q[0] = walls[side];
        }
    } else if !second {
        motion.q[0] = 0.0;
    }
    if EXPONENT {
        crossing.before = field();
    }
    if is_force {
        jump = change_force();
    } else if mode == MODE_FREE {
        jump = contact(side, settling);
    } else if sticks() {
        jump = let_go(side);
    } else if mode < MODE_ONSET {
        jump = end_meshing(side, settling, tau);
    } else if second {
        jump = end_onset(side, tau);
    } else {
        jump = onset_ends(side);
    }
    if jump.event {
        count_event(side);
    }
    tally.origin = side;
    // If pressing has ceased inside the contact onset, the gap is off the wall.
    if !(mode >= MODE_ONSET && second) {
        tally.order = select(1u, 2u, motion.q[1] == 0.0);
    }
    if sticks() {
        tally.order = 3u;
    }
    if INTERVALS && jump.mode == MODE_PASSING {
        pass_wall(side);
        if is_force {
            tally.order = 1u;
        } else if PUSHING && motion.q[1] == 0.0 && has_preload(1u - side) && !presses(present_pull(), side, motion.q) {
            // A load below the preload holds the gap on the wall by an infinite series of contacts.
            tally.status = STATUS_CAP_EVENTS;
        }
    } else if jump.mode != mode {
        tally.mode = jump.mode;
        enter(domain_of(jump.mode));
    }
    if sticks() {
        tally.order = stuck_order(side);
    }
    if EXPONENT && jump.event {
        crossing.jump = jump;
        crossing.after = field();
    }
    if jump.pressed_back > 0.0 {
        close_chatter(side, jump.pressed_back);
    }
    if CHATTER {
        chatters = tally.mode == MODE_FREE && begins_chatter(side, jump.pressed_back);
    }
    renew_bound();
}
