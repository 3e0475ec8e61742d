// Series of impacts: a load presses the gap to its wall, infinitely many impacts happen in a finite time, and their rest is replaced by its
// limit, by the rules of the reference (dynamics/src/machine/motion/series.rs). Meanwhile everything else moves as if the gap were at rest
// on the wall.

// The gap that has just left its wall, and the wall's side; GAPS if nothing has left a wall. A dispatch does not end in between.
var<private> leaving_gap: u32 = GAPS;
var<private> leaving_side: u32;
// Mask of the gaps that rested on rigid walls during the impact. UNSURE if another gap was kept at rest without a push.
var<private> held_gaps: u32;
const UNSURE: u32 = 255u;
// The gap during the rest of its series; GAPS otherwise.
var<private> held_gap: u32 = GAPS;
// Mask of the elements with friction whose sliding reverses in each flight.
var<private> rubs: u32;
// The rest of the series. `change`: rate of change of the pressing acceleration. `per_speed`, `per_pressing`: derivatives of its duration.
struct Rest {
    speed: Real,
    change: Real,
    per_speed: Real,
    per_pressing: Real,
}
var<private> rest: Rest;
// Time derivatives of the state when the gap leaves its wall, and when it is at rest instead.
var<private> leaves: State;
var<private> rests: State;
// For each tangent vector, how much later the series of the neighbouring motion ends.
var<private> late: State;

// Mask of the gaps that rest on rigid walls.
fn resting_gaps() -> u32 {
    var mask = 0u;
    for (var gap = 0u; gap < GAPS; gap++) {
        mask |= select(0u, 1u << gap, is_stuck(gap_modes[gap]));
    }
    return mask;
}

fn reversed(slip: u32) -> u32 {
    return select(FORWARD + BACKWARD - slip, STICKS, slip == STICKS);
}

// Stops the gap, and returns the duration of the rest. Returns 0 and changes nothing if the series is not endless, or if its rest is too
// long.
fn begin_rest(domain: u32, to_stop: Real) -> Real {
    let gap = leaving_gap;
    let sign = sign_of(leaving_side);
    let law = laws[cell.law_index][2u * gap + leaving_side];
    let rate = rate_of_gap(gap);
    let speed = -sign * rate;
    let is_endless = law[1] == 0.0 && law[3] <= NO_THRESHOLD * flow.speed;
    load_point(motion.q);
    let lowest = lowest_speed(domain, gap);
    if !(speed > 0.0) || (law[3] >= lowest && !is_endless) {
        return 0.0;
    }
    var stopped = motion.q;
    for (var i = 0u; i < shape.coordinates; i++) {
        stopped[2u * i + 1u] -= kick[i] * rate;
    }
    stopped[2u * gap + 1u] = 0.0;
    var back = slips;
    rubs = 0u;
    for (var i = 0u; i < ELEMENTS; i++) {
        if i >= shape.elements {
            continue;
        }
        let row = AT_ELEMENTS + i * (WIDTH + 1u);
        var along: Real = 0.0;
        var widest: Real = 0.0;
        var slide = number(row + WIDTH - 1u);
        var size = abs(slide);
        for (var j = 0u; j < shape.coordinates; j++) {
            let factor = number(row + 2u * j + 1u);
            along += factor * kick[j];
            widest = max(widest, abs(factor));
            slide += factor * stopped[2u * j + 1u];
            size += abs(factor * stopped[2u * j + 1u]);
        }
        if abs(slide) <= ROUNDING * size && slips[i] != STICKS {
            rubs |= 1u << i;
            back[i] = reversed(slips[i]);
        } else if abs(along) > ROUNDING * widest && abs(slide) <= 2.0 * abs(along) * speed {
            return 0.0;
        }
    }
    load_point(stopped);
    // Accelerations towards the wall of a gap that leaves it, and of one that comes back.
    let outward = sign * product(acceleration_row(domain, gap), 0u);
    let inward = sign * product(acceleration_row(domain_of(gap_modes, back), gap), 0u);
    if !(outward > 0.0 && inward > 0.0) {
        return 0.0;
    }
    held_gap = gap;
    differentiate(domain, 0u, 1.0);
    rest.speed = speed;
    rest.change = sign * product(acceleration_row(domain, gap), 1u);
    var damping: Real = 0.0;
    for (var i = 0u; i < shape.coordinates; i++) {
        damping -= number(acceleration_row(domain, gap) + 2u * i + 1u) * kick[i];
    }
    // With tangents, the last four durations are those for changed speeds and accelerations.
    var times: array<Real, 5>;
    for (var n = 0u; n < select(1u, 5u, VECTORS > 0u); n++) {
        let step = select(DIFFERENCE, -DIFFERENCE, n % 2u == 0u);
        var u = speed * (1.0 + select(Real(0.0), step, n == 1u || n == 2u));
        let more = select(Real(0.0), step * inward, n > 2u);
        var up = outward + more;
        var down = inward + more;
        var last: Real = 0.0;
        for (var flight = 0u; flight <= MOST_FLIGHTS; flight++) {
            iterations += 1u + select(0u, TERMS, law[1] != 0.0);
            var rise = u / up;
            let height = 0.5 * u * rise * (1.0 - rise * (rest.change / up + 2.0 * damping) * (1.0 / 3.0));
            rise *= 1.0 - 0.5 * rise * (rest.change / up + damping);
            let force = down + rest.change * rise;
            let fall = sqrt(2.0 * height / force);
            let approach = force * fall * (1.0 + fall * (rest.change / force - damping) * (1.0 / 3.0));
            let time = rise + fall * (1.0 - fall * (rest.change / force - damping) * (1.0 / 6.0));
            let bounce = restitution(gap, leaving_side, approach);
            let e = bounce[0];
            if n == 0u && flight == 0u {
                let is_last = e * approach <= lowest && law[3] < e * approach;
                let is_short = 2.0 * speed < CLOSING_ANGLE * min(number(domain), flow.radian) * outward * (1.0 - e);
                if !(e < 1.0 && (is_last || (is_endless && is_short))) {
                    held_gap = GAPS;
                    return 0.0;
                }
            }
            if flight == MOST_FLIGHTS {
                let loss = 1.0 - e * approach / u;
                let power = -bounce[1] * approach / loss;
                // With a constant restitution, durations are a sum of powers of e and of e^2. Otherwise the logarithm of the loss is almost
                // linear in that of the speed.
                let constant = (time + e * e * (time - e * last) / (1.0 - e * e)) / (1.0 - e);
                times[n] += select(time * (1.0 / (loss * (1.0 - power)) - power * (0.5 + loss * (1.0 / 6.0))), constant, law[1] == 0.0);
                break;
            }
            times[n] += time;
            last = time;
            up += rest.change * time;
            down += rest.change * time;
            u = e * approach;
            if u <= 0.1 * ULP * speed {
                break;
            }
        }
    }
    rest.per_speed = (times[1] - times[2]) / (2.0 * DIFFERENCE * speed);
    rest.per_pressing = (times[3] - times[4]) / (2.0 * DIFFERENCE * inward);
    // The rest ends before the next stop. Rounding must not put its end beyond it.
    if !(times[0] < unit_of(domain) && times[0] < (to_stop - 4.0 * ULP) * flow.h) {
        held_gap = GAPS;
        return 0.0;
    }
    for (var i = 0u; i < shape.dim; i++) {
        rests[i] = series[WIDTH + i];
    }
    motion.q = stopped;
    return times[0];
}

// Continues a series impact by impact, because something else happens before its limit.
fn continue_series() {
    let rate = -sign_of(leaving_side) * rest.speed;
    for (var i = 0u; i < shape.coordinates; i++) {
        motion.q[2u * i + 1u] += kick[i] * rate;
    }
    held_gap = GAPS;
}

// Carries tangent vector `n` from the last impact to the motion of the gap at rest.
fn stopped_tangent(n: u32, domain: u32) -> State {
    var u = tangent(n);
    let sign = sign_of(leaving_side);
    let later = sign * u[2u * held_gap] / rest.speed;
    for (var i = 0u; i < shape.dim; i++) {
        u[i] += leaves[i] * later;
    }
    let change = u[2u * held_gap + 1u];
    for (var i = 0u; i < shape.coordinates; i++) {
        u[2u * i + 1u] -= kick[i] * change;
    }
    u[2u * held_gap] = 0.0;
    u[2u * held_gap + 1u] = 0.0;
    var along: Real = 0.0;
    for (var i = 0u; i < shape.dim; i++) {
        u[i] -= rests[i] * later;
        along += number(acceleration_row(domain, held_gap) + i) * u[i];
    }
    late[n] = later - sign * rest.per_speed * change + rest.per_pressing * (sign * along + rest.change * later);
    return u;
}

// Begins contact at the limit of a series.
fn end_series(gap: u32, side: u32) {
    motion.q[2u * gap] = last_wall_at(gap, side);
    motion.q[2u * gap + 1u] = 0.0;
    let is_rigid = last_kind(gap, side) == LAST_RIGID;
    tried_gaps = gap_modes;
    tried_gaps[gap] = select(PRESSED, STUCK, is_rigid) + side;
    // The sliding that reversed in each flight ends, or reverses once more.
    for (var i = 0u; i < ELEMENTS; i++) {
        if ((rubs >> i) & 1u) == 1u {
            slips[i] = reversed(slips[i]);
            count_slip(SLIDING_REVERSES);
        }
    }
    count_event(gap, side);
    tried_slips = slips;
    for (var i = 0u; i < ELEMENTS; i++) {
        if ((rubs >> i) & 1u) == 1u && is_rigid {
            tried_slips[i] = STICKS;
        } else if ((rubs >> i) & 1u) == 1u {
            count_slip(SLIDING_REVERSES);
            from_rate[i] = UNKNOWN_ORDER;
        }
    }
}
