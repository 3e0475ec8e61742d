// Classical Runge-Kutta steps of fixed length with event location, for comparison. It replaces the exact propagator of lanes
// and its bounds. Model, contact law, forcing phase, strobes and dispatches are those of lanes.
//
// Events are searched at both ends of a step and at the turning point of its cubic Hermite polynomial. Newton's method
// locates them; each iteration integrates from the start of the step. Then the rest of the step is integrated, so that
// strobes stay on the grid.

// Coefficients of the accelerations per free step: for gap, rate, x, rate, cos and 1.
var<private> gap_pull: array<Real, 6>;
var<private> x_pull: array<Real, 6>;
// Forcing angle of a free step, and cos - 1 and sin of its half.
var<private> step_angle: Real;
var<private> half_turn: vec2<Real>;

const BASELINE_ROOT_CAP: u32 = 100u;
const BASELINE_NEWTON_CAP: u32 = 20u;

fn fetch_pull() {
    let n = here.substeps;
    let g = here.gap_row;
    let r = here.x_row;
    gap_pull = array<Real, 6>(n * n * g[0], n * g[1], n * n * g[2], n * g[3], n * n * g[4], n * n * g[5]);
    x_pull = array<Real, 6>(n * n * r[0], n * r[1], n * n * r[2], n * r[3], n * n * r[4], n * n * r[5]);
    step_angle = n * here.angle;
    half_turn = small_turn(0.5 * step_angle);
}

fn pull_on_gap(q: vec4<Real>, c: Real) -> Real {
    return (gap_pull[0] * q.x + gap_pull[1] * q.y) + (gap_pull[2] * q.z + gap_pull[3] * q.w) + (gap_pull[4] * c + gap_pull[5]);
}

fn derivative(q: vec4<Real>, c: Real) -> vec4<Real> {
    let v = (x_pull[0] * q.x + x_pull[1] * q.y) + (x_pull[2] * q.z + x_pull[3] * q.w) + (x_pull[4] * c + x_pull[5]);
    return vec4<Real>(q.y, pull_on_gap(q, c), q.w, v);
}

// One step of length `part`. c0, c1, c2: cos of the phase at its start, middle and end.
fn runge_kutta(q: vec4<Real>, part: Real, c0: Real, c1: Real, c2: Real) -> vec4<Real> {
    let half = 0.5 * part;
    let k1 = derivative(q, c0);
    let k2 = derivative(q + half * k1, c1);
    let k3 = derivative(q + half * k2, c1);
    let k4 = derivative(q + part * k3, c2);
    return q + (part * (1.0 / 6.0)) * ((k1 + k4) + 2.0 * (k2 + k3));
}

fn cos_after(turn: vec2<Real>) -> Real {
    return motion.phasor[0] + (turn.x * motion.phasor[0] - turn.y * motion.phasor[1]);
}

// The state `part` of a free step later.
fn after(q: vec4<Real>, part: Real) -> vec4<Real> {
    let middle = small_turn(0.5 * part * step_angle);
    let end = small_turn(part * step_angle);
    return runge_kutta(q, part, motion.phasor[0], cos_after(middle), cos_after(end));
}

// The state after a whole step, from constants.
fn after_whole(q: vec4<Real>) -> vec4<Real> {
    let c = cos_after(half_turn);
    let s = motion.phasor[1] + (half_turn.x * motion.phasor[1] + half_turn.y * motion.phasor[0]);
    return runge_kutta(q, 1.0, motion.phasor[0], c, c + (half_turn.x * c - half_turn.y * s));
}

// The distance from an event, positive before it, and its rate. `c`: cos of the phase.
fn distance_left(q: vec4<Real>, second: bool, c: Real) -> vec2<Real> {
    if tally.mode == MODE_FREE {
        return select(vec2<Real>(walls[0] - q.x, -q.y), vec2<Real>(q.x - walls[1], q.y), second);
    }
    let sign = sign_of(side_of(tally.mode));
    if tally.mode < MODE_ONSET {
        return select(sign * q.xy, vec2<Real>(1.0, 0.0), second);
    }
    // Contact onset: the distance from the wall, or the contact force. The slope of the force is not computed, so its root
    // is bisected.
    return select(-sign * q.xy, vec2<Real>(sign * pull_on_gap(q, c), 0.0), second);
}

// The event that ends a flight within a step.
struct Ending {
    event: bool,
    second: bool,
    // Part of the step after which the distance is negative.
    within: Real,
    // First guess of its root.
    guess: Real,
}

// Checks whether a distance becomes negative within a step of length `part`.
fn find_ending(q0: vec4<Real>, q1: vec4<Real>, part: Real, second: bool, starts_there: bool) -> Ending {
    let none = Ending(false, second, part, part);
    let left = distance_left(q0, second, motion.phasor[0]);
    if !starts_there && left.x <= 0.0 {
        return Ending(true, second, 0.0, 0.0);
    }
    var right = distance_left(q1, second, 0.0);
    if second && tally.mode >= MODE_ONSET {
        right = distance_left(q1, second, cos_after(small_turn(part * step_angle)));
    }
    let s0 = part * left.y;
    let s1 = part * right.y;
    if right.x < 0.0 {
        var share = left.x / (left.x - right.x);
        if starts_there {
            // The cubic without its root at the start.
            let b = 3.0 * right.x - 2.0 * s0 - s1;
            let a = s0 + s1 - 2.0 * right.x;
            share = select(Real(0.5), 2.0 * s0 / (sqrt(max(b * b - 4.0 * a * s0, Real(0.0))) - b), s0 > 0.0);
        }
        return Ending(true, second, part, part * clamp(share, Real(0.01), Real(0.99)));
    }
    if s1 <= 0.0 || (s0 > 0.0 && !starts_there) {
        return none;
    }
    // The minimum of the cubic, in a form without cancellation.
    let start = select(left.x, Real(0.0), starts_there);
    let rise = right.x - start;
    let b = 3.0 * rise - 2.0 * s0 - s1;
    let a = s0 + s1 - 2.0 * rise;
    let root = sqrt(max(b * b - 3.0 * a * s0, Real(0.0)));
    let u = select((root - b) / (3.0 * a), -s0 / (b + root), b > 0.0);
    let least = start + u * (s0 + u * (b + u * a));
    if !(u > 0.0 && u < 1.0) || least >= 0.0 {
        return none;
    }
    // The polynomial is an approximation. The equations decide.
    let low = after(q0, u * part);
    if distance_left(low, second, 0.0).x >= 0.0 {
        return none;
    }
    return Ending(true, second, u * part, 0.5 * u * part);
}

// Locates the zero of a distance in (0, within], without the root at the start.
fn locate(q0: vec4<Real>, ending: Ending, order: u32) -> Real {
    let second = ending.second;
    let within = ending.within;
    var lo: Real = 0.0;
    var hi = within;
    var t = ending.guess;
    for (var i = 0u; i < BASELINE_ROOT_CAP; i++) {
        iterations += 1u;
        let c = cos_after(small_turn(t * step_angle));
        let q = after(q0, t);
        let f = distance_left(q, second, c);
        if f.x > 0.0 {
            lo = t;
        } else {
            hi = t;
        }
        let slope = f.y - Real(order) * f.x / t;
        if slope < 0.0 && i < BASELINE_NEWTON_CAP {
            let move_by = -f.x / slope;
            let next = t + move_by;
            // The error after a Newton step is of second order in the step.
            let newton_error = abs(pull_on_gap(q, c)) * move_by * move_by;
            if next >= 0.0 && next <= within && (newton_error <= ULP * t * abs(f.y) || abs(move_by) <= 4.0 * ULP * t) {
                return next;
            }
            if next > lo && next < hi {
                t = next;
                continue;
            }
        }
        t = 0.5 * (lo + hi);
        if hi - lo <= 4.0 * ULP * hi {
            return t;
        }
    }
    tally.status = STATUS_CAP_ROOT;
    return t;
}

// Number of steps between two reads of the table of phasors.
const SYNC: u32 = 64u;

// The scan has reached the stop phase.
const SCAN_MARK: u32 = 2u;

// Takes whole steps as long as the Bernstein coefficients of their cubics lie between the walls.
fn scan_steps() -> u32 {
    if motion.theta != 0.0 || tally.order > 1u || tally.mode >= MODE_ONSET {
        return SCAN_CAREFUL;
    }
    // In meshing the gap is measured from its wall, and there is no other wall.
    let d = domain_of(tally.mode);
    let low = select(select(Real(0.0), -HUGE, d == 2u), walls[1], d == 0u);
    let high = select(select(Real(0.0), HUGE, d == 1u), walls[0], d == 0u);
    let stop = next_stop_phase();
    var q = vec4<Real>(motion.q[0], motion.q[1], motion.q[2], motion.q[3]);
    var n = tally.step;
    var leaves = tally.order > 0u;
    var step_count = 0u;
    var verdict = SCAN_MARK;
    var going = true;
    while going {
        motion.phasor = pairs[shape.phasors + n];
        var c = motion.phasor[0];
        var s = motion.phasor[1];
        for (var i = 0u; i < SYNC; i++) {
            if n >= stop {
                going = false;
                break;
            }
            if iterations >= settings.iterations {
                verdict = SCAN_BUDGET;
                going = false;
                break;
            }
            iterations += 1u;
            let c1 = c + (half_turn.x * c - half_turn.y * s);
            let s1 = s + (half_turn.x * s + half_turn.y * c);
            let c2 = c1 + (half_turn.x * c1 - half_turn.y * s1);
            let s2 = s1 + (half_turn.x * s1 + half_turn.y * c1);
            let q1 = runge_kutta(q, 1.0, c, c1, c2);
            let b1 = q.x + q.y * (1.0 / 3.0);
            let b2 = q1.x - q1.y * (1.0 / 3.0);
            // At a start on the wall the root there is ignored.
            let b0 = select(q.x, b1, leaves);
            let top = max(max(b0, b1), max(b2, q1.x));
            let bottom = min(min(b0, b1), min(b2, q1.x));
            if !(top < high && bottom > low) {
                verdict = SCAN_CAREFUL;
                going = false;
                break;
            }
            q = q1;
            c = c2;
            s = s2;
            n += 1u;
            step_count += 1u;
            leaves = false;
        }
    }
    motion.q = array<Real, 4>(q.x, q.y, q.z, q.w);
    tally.step = n;
    tally.passes_in_period += step_count;
    tally.order = select(0u, 1u, leaves);
    return verdict;
}

// Takes one step, or the rest of a step after an event, up to the next event.
fn careful_step() {
    iterations += 1u;
    motion.phasor = pairs[shape.phasors + tally.step];
    let q0 = vec4<Real>(motion.q[0], motion.q[1], motion.q[2], motion.q[3]);
    let part = 1.0 - motion.theta;
    var q1: vec4<Real>;
    if motion.theta == 0.0 {
        q1 = after_whole(q0);
    } else {
        turn_phasor(motion.theta * here.substeps);
        q1 = after(q0, part);
    }
    let on_second = tally.mode == MODE_FREE && tally.origin == SIDE_LEFT;
    let starts = tally.order > 0u;
    var ending = find_ending(q0, q1, part, false, starts && !on_second);
    if !ending.event {
        ending = find_ending(q0, q1, part, true, starts && on_second);
    }
    tally.passes_in_period += 1u;
    if !ending.event {
        motion.q = array<Real, 4>(q1.x, q1.y, q1.z, q1.w);
        motion.theta = 0.0;
        tally.step += 1u;
        tally.order = 0u;
        return;
    }
    let at_start = starts && ending.second == on_second;
    var tau: Real = 0.0;
    if ending.within > 0.0 {
        tau = locate(q0, ending, select(0u, tally.order, at_start));
    }
    let q = after(q0, tau);
    motion.q = array<Real, 4>(q.x, q.y, q.z, q.w);
    tally.order = 0u;
    advance_phase(tau);
    turn_phasor(tau * here.substeps);
    check_finite();
    act(ending.second, tau);
    fetch_pull();
}

// Integrates to the next stop phase. Returns false if the lane or its iterations in this dispatch end before. As in lanes,
// steps and events are separate: otherwise hardware that runs lanes in lockstep pays for events at every step.
fn fly_to_stop_phase() -> bool {
    fetch_pull();
    while tally.status == STATUS_OK && iterations < settings.iterations {
        let verdict = scan_steps();
        if verdict == SCAN_BUDGET {
            break;
        }
        if verdict == SCAN_CAREFUL {
            careful_step();
        }
        if tally.step >= next_stop_phase() {
            check_finite();
            return true;
        }
        if tally.passes_in_period > settings.passes_per_period {
            tally.status = STATUS_TOO_STIFF;
        }
    }
    return false;
}
