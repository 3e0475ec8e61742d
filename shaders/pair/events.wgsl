// The careful step: finds the first event on the next step and acts on it.

// Verdicts on a distance over a part of a step: it stays positive, it falls through zero once, or neither is certain.
const CLEAR: u32 = 0u;
const CROSSING: u32 = 1u;
const UNCLEAR: u32 = 2u;

// Returns the Bernstein coefficients of a distance (positive inside) over a time `dt`, from value, slope and curvature at both ends.
fn coefficients(left: vec3<Real>, right: vec3<Real>, dt: Real) -> array<Real, 7> {
    let square = dt * dt;
    let s0 = dt * left.y;
    let a0 = square * left.z;
    let s1 = dt * right.y;
    let a1 = square * right.z;
    return array<Real, 7>(
        left.x,
        left.x + s0 * (1.0 / 6.0),
        left.x + s0 * (1.0 / 3.0) + a0 * (1.0 / 30.0),
        0.5 * (left.x + right.x) + 0.2 * (s0 - s1) + 0.025 * (a0 + a1),
        right.x - s1 * (1.0 / 3.0) + a1 * (1.0 / 30.0),
        right.x - s1 * (1.0 / 6.0),
        right.x,
    );
}

// Judges a distance by its coefficients. `order` is the order of its root at the start. This root is divided out, which drops `order`
// coefficients. `eps` bounds the remainder.
fn judge(c: array<Real, 7>, order: u32, eps: Real) -> u32 {
    let first = min(select(c[6], c[0], order < 1u), min(select(c[6], c[1], order < 2u), select(c[6], c[2], order < 3u)));
    if min(min(first, c[3] - eps), min(min(c[4], c[5]), c[6])) > 0.0 {
        return CLEAR;
    }
    var plus = select(0u, 1u, c[0] > 0.0);
    plus |= select(0u, 2u, c[1] > 0.0);
    plus |= select(0u, 4u, c[2] > 0.0);
    plus |= select(0u, 16u, c[4] > 0.0);
    plus |= select(0u, 32u, c[5] > 0.0);
    plus |= select(0u, 64u, c[6] > 0.0);
    // Signs of the two polynomials that enclose the function. Positive coefficients followed by negative ones mean one change of sign in
    // each polynomial.
    let lower = (plus | select(0u, 8u, c[3] > eps)) >> order;
    let upper = (plus | select(0u, 8u, c[3] > -eps)) >> order;
    let single = (lower & (lower + 1u)) == 0u && (upper & (upper + 1u)) == 0u && lower > 0u;
    return select(UNCLEAR, CROSSING, single && upper != (127u >> order));
}

// A flight ends where one of two distances vanishes. In free motion these are the distances from the right and the left wall. In contact
// there is the depth alone, and the second distance is HUGE. In the contact onset, the second distance is the pressing acceleration.

// Distances at the start of the careful step, and their derivatives with respect to the gap's displacement.
var<private> offsets: vec2<Real>;
var<private> slopes: vec2<Real>;

// Returns a distance at `tau` with slope and curvature. `z` is the displacement of the gap with slope and curvature.
fn event_distance(second: bool, z: vec3<Real>, tau: Real) -> vec3<Real> {
    if second && is_onset() {
        return sign_of(side_of(tally.mode)) * pressing_jet(tau);
    }
    let offset = select(offsets.x, offsets.y, second);
    let slope = select(slopes.x, slopes.y, second);
    return vec3<Real>(offset + slope * z.x, slope * z.y, slope * z.z);
}

// Returns a bound on the remainder of a distance's middle coefficient. `rest` is the sixth power of the time, divided by 14,400.
fn remainder(second: bool, growth: Real, rest: Real) -> Real {
    // The pressing acceleration has derivatives of two more orders.
    return (select(motion.bound, pressing_bound, second) + growth) * rest + 8.0 * ULP * abs(select(offsets.x, offsets.y, second));
}

fn set_offsets() {
    let z = motion.q[0];
    let sign = sign_of(side_of(tally.mode));
    if tally.mode == MODE_FREE {
        offsets = vec2<Real>(walls[0] - z, z - walls[1]);
        slopes = vec2<Real>(-1.0, 1.0);
    } else if sticks() {
        offsets = vec2<Real>(sign * gap_terms[0], HUGE);
        slopes = vec2<Real>(sign, 0.0);
    } else if tally.mode >= MODE_ONSET {
        offsets = vec2<Real>(-sign * z, 0.0);
        slopes = vec2<Real>(-sign, 0.0);
    } else {
        offsets = vec2<Real>(sign * z, HUGE);
        slopes = vec2<Real>(sign, 0.0);
    }
}

// A crossing is certain if its slope exceeds the remainder by this factor. The derivative of a step's remainder is at most 1.08 times the
// remainder.
const STEEP: Real = 4.0;

// Largest number of Halley steps of the root search, and of all its steps. Later steps are bisections.
const HALLEY_CAP: u32 = 10u;
const ROOT_CAP: u32 = 120u;
// Largest number of parts into which one careful step may be divided.
const CHECK_CAP: u32 = 200u;

// Returns the root in (a, b] at which a distance on the exact flow falls from + to -, and the slope there. A root at the start is divided
// out. `left` and `right` are the distance at a and b with slope and curvature.
//
// The search uses Halley's method. f1, f2 and f3 are derivatives, r is f2 / f1, and s is a step. The error after the step is about
// `|s|^3 (r^2 / 4 + |f3 / f1| / 6)`. The curvatures at the ends give an estimate of f3.
fn root(second: bool, a: Real, b: Real, left: vec3<Real>, right: vec3<Real>, order: u32) -> vec2<Real> {
    let third = abs(right.z - left.z) / (b - a) + abs(right.z);
    var lo = a;
    var hi = b;
    var t = root_guess(a, b, left, right, order);
    for (var i = 0u; i < ROOT_CAP; i++) {
        iterations += 1u;
        let f = event_distance(second, gap_jet(t), t);
        let per_time = select(1.0 / t, Real(0.0), order == 0u);
        let m = Real(order) * per_time;
        let inverse = 1.0 / (f.y - m * f.x);
        let ratio = (f.z - m * (2.0 * f.y - (m + per_time) * f.x)) * inverse;
        let newton = f.x * inverse;
        let step = newton / (1.0 - 0.5 * newton * ratio);
        var next = t - step;
        let size = abs(step);
        let converged = size * size * size * (ratio * ratio + third * abs(inverse)) <= 4.0 * ULP * t || size <= 4.0 * ULP * t;
        if converged && next >= a && next <= b {
            return vec2<Real>(next, f.y - step * f.z);
        }
        if f.x > 0.0 {
            lo = t;
        } else {
            hi = t;
        }
        if i >= HALLEY_CAP || !(next > lo && next < hi) {
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

// Returns an estimate of the root in (a, b]: the inverse of the function is interpolated by Hermite's cubic polynomial.
fn root_guess(a: Real, b: Real, left: vec3<Real>, right: vec3<Real>, order: u32) -> Real {
    var y = vec2<Real>(left.x, right.x);
    var slope = vec2<Real>(left.y, right.y);
    if order > 0u {
        // The root at the start is divided out.
        y = vec2<Real>(left.y, right.x / b);
        slope = vec2<Real>(0.5 * left.z, (right.y - y.y) / b);
    }
    let fall = y.x - y.y;
    let u = clamp(y.x / fall, Real(0.01), Real(0.99));
    let rest = 1.0 - u;
    let cubic = a + (b - a) * (u * u * (1.0 + 2.0 * rest)) - fall * (u * rest) * (rest / slope.x - u / slope.y);
    let fits = slope.x < 0.0 && slope.y < 0.0 && cubic > a && cubic < b;
    return select(a + u * (b - a), cubic, fits);
}

// Result of a careful step.
struct Find {
    // Whether there is an event, and which of the two distances vanishes.
    event: bool,
    second: bool,
    // Its time; the end of the step if there is no event.
    tau: Real,
}

// Whether the search begins with the second distance. It begins with the distance that has a root at the start, otherwise with the smaller
// one. Rounding of the sum of both is then small compared with the other distance.
fn begins_second() -> bool {
    return tally.mode == MODE_FREE && select((offsets.y < offsets.x), tally.origin == SIDE_LEFT, (tally.order > 0u));
}

// Returns the first event within `len` of the present step. The search begins with the distance `begun`, which has a root of the order
// `begun_order` at the start.
fn first_event(len: Real, growth: Real, begun: bool, begun_order: u32) -> Find {
    // In free motion the sum of both distances is constant. In contact the second one is HUGE, and so is the sum.
    let is_mirrored = !is_onset();
    let reach = offsets.x + offsets.y;
    let start = vec3<Real>(0.0, gap_terms[1], 2.0 * gap_terms[2]);
    var order = begun_order;
    var a: Real = 0.0;
    var width = len;
    var left = event_distance(begun, start, 0.0);
    var checks = 0u;
    // Rounding has put the start on the boundary or beyond it.
    if order == 0u && left.x <= 0.0 {
        return Find(true, begun, 0.0);
    }
    var other_start = reach - left.x;
    if !is_mirrored {
        other_start = event_distance(!begun, start, 0.0).x;
    }
    if other_start <= 0.0 {
        return Find(true, !begun, 0.0);
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
        let z = gap_jet(b);
        let right = event_distance(begun, z, b);
        let cube = dt * dt * dt;
        let rest = cube * cube * (here.swell * (1.0 / 14400.0));
        let eps = remainder(begun, growth, rest);
        let other_eps = remainder(!begun, growth, rest);
        let c = coefficients(vec3<Real>(select(left.x, Real(0.0), order > 0u), left.y, left.z), right, dt);
        let verdict = judge(c, order, eps);
        let top = max(max(max(c[0], c[1]), max(c[2], c[4])), max(max(c[5], c[6]), c[3] + other_eps));
        var other = CLEAR;
        var other_left = vec3<Real>(reach - left.x, -left.y, -left.z);
        var other_right = vec3<Real>(reach - right.x, -right.y, -right.z);
        if !(is_mirrored && top < reach) {
            if !is_mirrored {
                other_left = event_distance(!begun, gap_jet(a), a);
                other_right = event_distance(!begun, z, b);
            }
            other = judge(coefficients(other_left, other_right, dt), 0u, other_eps);
        }
        if verdict == CLEAR && other == CLEAR {
            if b == len {
                break;
            }
            a = b;
            left = right;
            order = 0u;
            width = 2.0 * dt;
            continue;
        }
        let is_single = verdict + other == CROSSING;
        let is_other = verdict == CLEAR;
        var found = vec2<Real>(0.0, 0.0);
        if is_single {
            let f0 = select(left, other_left, is_other);
            let f1 = select(right, other_right, is_other);
            found = root(begun != is_other, a, b, f0, f1, select(order, 0u, is_other));
            // If the slope is below the remainder, there may be three roots instead of one.
            if dt * abs(found.y) > STEEP * select(eps, other_eps, is_other) {
                return Find(true, begun != is_other, found.x);
            }
        }
        // Between the ends, the distance may be smaller by an eighth of its bend. While the bend exceeds the remainder, a crossing is
        // possible even in a very short time.
        var is_shortest = dt <= SHORTEST;
        if is_shortest && dt > SHORTEST_STEP {
            let bend = dt * dt * vec2<Real>(max(abs(left.z), abs(right.z)), max(abs(other_left.z), abs(other_right.z)));
            is_shortest = !((verdict != CLEAR && bend.x > 8.0 * eps) || (other != CLEAR && bend.y > 8.0 * other_eps));
        }
        if !is_shortest {
            width = 0.5 * dt;
            continue;
        }
        if is_single {
            return Find(true, begun != is_other, found.x);
        }
        if verdict == CROSSING && other == CROSSING && order == 0u {
            // Both distances vanish within the shortest time that is resolved. Linear estimates decide which one is earlier.
            let share = left.x / (left.x - right.x);
            let other_share = other_left.x / (other_left.x - other_right.x);
            return Find(true, begun != (other_share < share), a + min(share, other_share) * dt);
        }
        // The shortest part is still unclear, so the gap touches the wall within rounding. At elastic walls this has no effect.
        let touched = select(side_of(tally.mode), select(SIDE_RIGHT, SIDE_LEFT, begun != is_other), tally.mode == MODE_FREE);
        if !is_elastic(touched) {
            tally.grazes += 1u;
        }
        if right.x <= 0.0 {
            return Find(true, begun, b);
        }
        if other_right.x <= 0.0 {
            return Find(true, !begun, b);
        }
        if b == len {
            break;
        }
        a = b;
        left = right;
        order = 0u;
        width = dt;
    }
    return Find(false, false, len);
}

// If the gap began this step at rest and its acceleration was set to zero: a bound on the true acceleration; 0 otherwise.
var<private> balanced: Real;

// Bound on the eighth derivative of the gap, which the contact onset needs.
var<private> pressing_bound: Real;

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
        let depth = event_distance(false, gap_jet(middle), middle);
        if depth.x >= backlash {
            return true;
        }
        if depth.y > 0.0 {
            early = middle;
        } else {
            late = middle;
        }
    }
    return event_distance(false, gap_jet(tau), tau).x >= backlash;
}

// Moves to the first event of the next step, or to its end, and acts on the event. Returns true at a stop phase.
fn careful() -> bool {
    let d = domain_of(tally.mode);
    let substeps = here.substeps;
    let share = here.share;
    sync_overtones(tally.step, motion.theta);
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
    pressing_bound = motion.bound;
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
    let found = first_event(len, here.growth, begins_second(), tally.order);
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
    tally.order = 0u;
    if MESH && d > 0u {
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
    sync_phasor();
    if VECTORS > 0u {
        glide_tangents(found.tau, held);
    }
    if found.event {
        act(found.second, found.tau);
        if VECTORS > 0u {
            jump_tangents();
        }
    }
    check_range();
    renew_bound();
    return tally.step >= stop;
}

// Acts on the event that ends the flight at the present state, `tau` after the expansion point.
fn act(second: bool, tau: Real) {
    let settling = tau == 0.0;
    let mode = tally.mode;
    var side = side_of(mode);
    var jump: Jump;
    crossing = Crossing();
    if mode == MODE_FREE {
        side = select(SIDE_RIGHT, SIDE_LEFT, second);
        motion.q[0] = walls[side];
    } else if !second {
        motion.q[0] = 0.0;
    }
    if VECTORS > 0u {
        crossing.before = field();
    }
    if mode == MODE_FREE {
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
    if jump.mode != mode {
        tally.mode = jump.mode;
        enter(domain_of(jump.mode));
    }
    if sticks() {
        tally.order = stuck_order(side);
    }
    if VECTORS > 0u && jump.event {
        crossing.jump = jump;
        crossing.after = field();
    }
    if jump.pressed_back > 0.0 {
        close_chatter(side, jump.pressed_back);
    }
    if CHATTER {
        chatters = tally.mode == MODE_FREE && begins_chatter(side, jump.pressed_back);
    }
}
