// The contact law: domains, impacts, and the conditions of meshing.

fn domain_of(mode: u32) -> u32 {
    if mode == MODE_FREE {
        return 0u;
    }
    return 1u + ((mode - 1u) & 1u);
}

fn side_of(mode: u32) -> u32 {
    return (mode - 1u) & 1u;
}

fn sign_of(side: u32) -> Real {
    return select(Real(-1.0), Real(1.0), side == SIDE_RIGHT);
}

// Adds the force's sine term `factor * s`. Variants whose forces have no sine leave it out.
fn with_sine(rest: Real, factor: Real, s: Real) -> Real {
    if SINE {
        return rest + factor * s;
    }
    return rest;
}

// Returns the acceleration that a row describes, in units of the domain's step. `q` is in lane units; `place` is the place of the
// harmonics' part.
fn acceleration(row: array<Real, 7>, share: Real, q: array<Real, 4>, place: u32) -> Real {
    return (row[0] * q[0] + row[2] * q[2]) + share * (row[1] * q[1] + row[3] * q[3])
        + with_harmonics(row[4] * motion.phasor[0] + with_sine(row[5], row[6], motion.phasor[1]), place);
}

// Whether the gap is pressed into the wall: its first nonzero derivative, from the second on, points into the wall.
fn presses(pull: Pull, side: u32, q: array<Real, 4>) -> bool {
    var first = acceleration(pull.gap_row, pull.share, q, pull.gap_place);
    if first == 0.0 || (q[1] == 0.0 && abs(first) <= balance(pull.gap_row, pull.share, q, pull.gap_place)) {
        first = later_derivative(pull, q);
    }
    return sign_of(side) * first > 0.0;
}

// Returns the size up to which the acceleration of a gap at rest counts as zero. If its terms cancel, its sign is a rounding error that
// depends on the order of summation and on the domain. If two domains gave different signs, the gap would leave its wall and be pressed
// back for ever.
fn balance(row: array<Real, 7>, share: Real, q: array<Real, 4>, place: u32) -> Real {
    return 4.0 * ULP * ((abs(row[0] * q[0]) + abs(row[2] * q[2])) + share * abs(row[3] * q[3])
        + with_sizes(abs(row[4] * motion.phasor[0]) + with_sine(abs(row[5]), abs(row[6]), abs(motion.phasor[1])), place));
}

// Returns the first nonzero derivative of the gap from the third to the fifth.
fn later_derivative(pull: Pull, q: array<Real, 4>) -> Real {
    let g = pull.gap_row;
    let r = pull.x_row;
    var first: Real = 0.0;
    // Derivatives of order k and k + 1. The gap's derivative of order 2 is zero.
    var z = pull.share * q[1];
    var w: Real = 0.0;
    var x = pull.share * q[3];
    var v = acceleration(r, pull.share, q, pull.x_place);
    var c = -pull.angle * motion.phasor[1];
    var s = pull.angle * motion.phasor[0];
    //% for k in 3..6
    {
        let a = ((g[0] * z + g[2] * x) + (g[1] * w + g[3] * v)) + with_derivative(with_sine(g[4] * c, g[6], s), pull.gap_place, pull.angle, $ku - 2u);
        let b = ((r[0] * z + r[2] * x) + (r[1] * w + r[3] * v)) + with_derivative(with_sine(r[4] * c, r[6], s), pull.x_place, pull.angle, $ku - 2u);
        first = select(first, a, first == 0.0);
        z = w;
        w = a;
        x = v;
        v = b;
        let turned = -pull.angle * s;
        s = pull.angle * c;
        c = turned;
    }
    //% end
    return first;
}

// The effect of an event on the motion.
struct Jump {
    // Whether an event happens, and the mode after it.
    event: bool,
    mode: u32,
    // Gradient and rate of the event function, per free step.
    normal: array<Real, 4>,
    rate: Real,
    // Factor by which the gap's rate changes, and change of the rate of x per unit of the gap's rate.
    rate_factor: Real,
    kick: Real,
    // Leaving speed if the load presses the gap back after an impact.
    pressed_back: Real,
}

// The gradient of the gap.
const ALONG_GAP = array<Real, 4>(1.0, 0.0, 0.0, 0.0);

// Applies the contact law where free motion has reached a wall: an impact, or the start of meshing.
fn contact(side: u32, settling: bool) -> Jump {
    if is_elastic(side) {
        return enter_elastic(side);
    }
    let sign = sign_of(side);
    let e = restitution(side);
    let closing = sign * motion.q[1];
    let approach = max(closing, Real(0.0));
    let leaving = e * approach;
    var after = motion.q;
    after[1] = -sign * leaving;
    after[3] += kick * (sign * (1.0 + e) * approach);
    let pressed = presses(present_pull(), side, after);
    var jump = Jump(false, MODE_FREE, ALONG_GAP, motion.q[1], -e, kick * (1.0 + e), 0.0);
    // A start on the wall, or beyond it by rounding, is a contact only if the gap closes.
    if settling && (closing < 0.0 || (closing == 0.0 && !pressed)) {
        return jump;
    }
    if is_rigid(side) && leaving <= mesh_speed(side) {
        let at_rest = stick(side);
        if at_rest.event {
            if MEASURE {
                measure_contact(approach, 0.0);
            }
            return at_rest;
        }
    }
    jump.event = true;
    if MEASURE {
        measure_contact(approach, leaving);
    }
    if !pressed && approach < GRAZING_SPEED * speed {
        tally.grazes += 1u;
    }
    motion.q = after;
    if pressed && leaving <= mesh_speed(side) && !is_rigid(side) {
        after[0] = 0.0;
        if presses(meshing_pull(side), side, after) {
            jump.mode = select(MODE_SUSTAINED, MODE_ONSET, leaving > 0.0) + side;
            motion.q = after;
            return jump;
        }
    }
    tally.impacts += 1u;
    jump.pressed_back = select(Real(0.0), leaving, pressed);
    return jump;
}

// Ends sustained contact: the gap falls back through the wall, `tau` after the expansion point.
fn end_meshing(side: u32, settling: bool, tau: Real) -> Jump {
    let sign = sign_of(side);
    var jump = Jump(false, tally.mode, ALONG_GAP, motion.q[1], 1.0, 0.0, 0.0);
    if settling && sign * motion.q[1] > 0.0 {
        return jump;
    }
    if is_elastic(side) {
        if stays_behind(side) {
            motion.q[1] = 0.0;
            return jump;
        }
        pass_damper(side, -1.0);
    }
    jump.event = true;
    jump.mode = MODE_FREE;
    motion.q[0] = walls[side];
    // A gap that was at rest under a balanced load leaves at rest. Its computed rate is a rounding error and is set to zero. With this
    // rate, an acceleration that is also a rounding error could press the gap back.
    let leaving = max(-sign * motion.q[1], Real(0.0));
    motion.q[1] = select(-sign * leaving, Real(0.0), leaving <= here.substeps * balanced * tau);
    return jump;
}

// Ends the contact onset because the load no longer presses, `tau` after the expansion point. The acceleration is the event function.
fn end_onset(side: u32, tau: Real) -> Jump {
    if MEASURE {
        measure_release(side);
    }
    let row = here.gap_row;
    let normal = array<Real, 4>(row[0], here.share * row[1], row[2], here.share * row[3]);
    motion.q[0] += walls[side];
    return Jump(true, MODE_FREE, normal, here.substeps * pressing_jet(tau).y, 1.0, 0.0, 0.0);
}

// Ends the contact onset where sustained contact begins. This does not count as an event.
fn onset_ends(side: u32) -> Jump {
    let sign = sign_of(side);
    motion.q[1] = sign * max(sign * motion.q[1], Real(0.0));
    return Jump(false, MODE_SUSTAINED + side, ALONG_GAP, 0.0, 1.0, 0.0, 0.0);
}

fn count_event(side: u32) {
    add_symbol_of_flight(side);
    keep_strobe_distance();
    // Meshing may also end before the gap reaches its wall. Such motion lies on another branch of the strobe map, because its modes differ.
    tally.itinerary = mix_bits(tally.itinerary + (2u * tally.mode + side + 1u));
    tally.origin = side;
    tally.events += 1u;
    tally.events_in_period += 1u;
    if tally.events_in_period > settings.events_per_period {
        tally.status = STATUS_CAP_EVENTS;
    }
}
