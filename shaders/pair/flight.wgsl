// Scanning: the motion moves by full steps of the exact propagator while a bound shows that no event occurs.

// Returns the margin by which a function certainly stays in [low, high] over a step; negative if the bound cannot show this. Value, slope
// and curvature at both ends are in units of the step. Quintic Hermite interpolation in Bernstein form of degree 6; the remainder is at
// most `eps` times the middle basis polynomial. If the step starts on the wall (`leaves`), that root is divided out, and its coefficient is
// dropped.
fn clearance(leaves: bool, f0: Real, s0: Real, a0: Real, f1: Real, s1: Real, a1: Real, eps: Real, low: Real, high: Real) -> Real {
    let c1 = f0 + s0 * (1.0 / 6.0);
    let c2 = f0 + s0 * (1.0 / 3.0) + a0 * (1.0 / 30.0);
    let c3 = 0.5 * (f0 + f1) + 0.2 * (s0 - s1) + 0.025 * (a0 + a1);
    let c4 = f1 - s1 * (1.0 / 3.0) + a1 * (1.0 / 30.0);
    let c5 = f1 - s1 * (1.0 / 6.0);
    let c0 = select(f0, c1, leaves);
    let top = max(max(max(c0, f1), max(c1, c5)), max(max(c2, c4), c3 + eps));
    let bottom = min(min(min(c0, f1), min(c1, c5)), min(min(c2, c4), c3 - eps));
    return min(high - top, bottom - low) - 8.0 * ULP * (abs(f0) + abs(f1));
}

// Reasons for the end of a scan.
const SCAN_CAREFUL: u32 = 0u; // the next step needs a careful pass
const SCAN_BUDGET: u32 = 1u; // the iterations of this dispatch are used up

// Returns how many steps of the domain end before a phase. `step` and `theta` are whole free steps and a fraction. The number of steps per
// free step is a power of two, so rounding never adds a step.
fn steps_before(step: u32, theta: Real) -> u32 {
    let ended = (step - tally.step) * u32(here.substeps) - u32(i32(floor((motion.theta - theta) * here.substeps)));
    return max(ended, 1u) - 1u;
}

fn scan() -> u32 {
    // Every step is a careful one from rest on a wall, in the contact onset, and while the motion is measured.
    if MEASURE || tally.order > 1u || tally.mode >= MODE_ONSET {
        return SCAN_CAREFUL;
    }
    let d = domain_of(tally.mode);
    let m = propagator();
    let row = here.gap_row;
    let growth = here.growth;
    let swell = here.swell;
    let half = here.turn_half;
    let sine = here.turn_sin;
    let share = here.share;
    let substeps = here.substeps;
    // The scan must not step over the stop phase or over a change of the stage.
    var most = steps_before(next_stop_phase(), 0.0);
    if STAGES && change_step != NO_STEP {
        most = min(most, steps_before(change_step, change_theta));
    }
    let price = select(1u, 5u, COLUMNS);
    // Steps of this scan that an earlier dispatch has made.
    let made = tally.scanned;
    let allowed = made + (settings.iterations - iterations + price - 1u) / price;
    most = min(most, allowed);
    // While meshing, the gap is measured from its wall, and only this wall bounds the motion.
    var low = walls[1];
    var high = walls[0];
    if d == 1u {
        low = 0.0;
        high = HUGE;
    } else if d == 2u {
        low = -HUGE;
        high = 0.0;
    }
    var z = motion.q[0];
    var w = motion.q[1] * share;
    var x = motion.q[2];
    var v = motion.q[3] * share;
    var c = motion.phasor[0];
    var s = motion.phasor[1];
    var bound = motion.bound;
    var a = row[3] * v + (row[1] * w + (row[0] * z + (row[2] * x + with_harmonics(row[4] * c + with_sine(row[5], row[6], s), place_of_gap(d)))));
    if made > 0u {
        if HARMONICS > 0u {
            let reached = phase_after(made);
            sync_overtones(reached.step, reached.theta);
        }
        a = motion.bend;
    }
    var count = made;
    var leaves = tally.order > 0u;
    // The exponent's tangent vector is carried here; `step_columns` carries the columns of a cycle that is read.
    var tz = tangent_now[0];
    var tw = tangent_now[1] * share;
    var tx = tangent_now[2];
    var tv = tangent_now[3] * share;
    while count < most {
        let z1 = z + (m[3] * v + (m[1] * w + (m[0] * z + (m[2] * x + (m[4] * c + (m[5] * s + with_harmonics(m[6], place_of_step(d))))))));
        let w1 = w + (m[10] * v + (m[8] * w + (m[7] * z + (m[9] * x + (m[11] * c + (m[12] * s + with_harmonics(m[13], place_of_step(d) + 1u)))))));
        let x1 = x + (m[17] * v + (m[15] * w + (m[14] * z + (m[16] * x + (m[18] * c + (m[19] * s + with_harmonics(m[20], place_of_step(d) + 2u)))))));
        let v1 = v + (m[24] * v + (m[22] * w + (m[21] * z + (m[23] * x + (m[25] * c + (m[26] * s + with_harmonics(m[27], place_of_step(d) + 3u)))))));
        // The phasor turns by three shears. Drivers reorder the usual form `c + ((cos - 1) c - sin s)`. Then `c + (cos - 1) c` loses small
        // digits, in the same direction at every step.
        let sheared = c - half * s;
        let s1 = s + sine * sheared;
        let c1 = sheared - half * s1;
        if HARMONICS > 0u {
            let next = phase_after(count + 1u);
            sync_overtones(next.step, next.theta);
        }
        let a1 = row[3] * v1 + (row[1] * w1 + (row[0] * z1 + (row[2] * x1
            + with_harmonics(row[4] * c1 + with_sine(row[5], row[6], s1), place_of_gap(d)))));
        let bound1 = swell * (bound + growth);
        if !(clearance(leaves, z, w, a, z1, w1, a1, bound1 * (1.0 / 14400.0), low, high) > 0.0) {
            break;
        }
        if GROWTH {
            let tz1 = tz + (m[3] * tv + (m[1] * tw + (m[0] * tz + m[2] * tx)));
            let tw1 = tw + (m[10] * tv + (m[8] * tw + (m[7] * tz + m[9] * tx)));
            let tx1 = tx + (m[17] * tv + (m[15] * tw + (m[14] * tz + m[16] * tx)));
            let tv1 = tv + (m[24] * tv + (m[22] * tw + (m[21] * tz + m[23] * tx)));
            tz = tz1;
            tw = tw1;
            tx = tx1;
            tv = tv1;
        }
        leaves = false;
        z = z1;
        w = w1;
        x = x1;
        v = v1;
        c = c1;
        s = s1;
        a = a1;
        bound = bound1;
        count += 1u;
    }
    motion.q[0] = z;
    motion.q[1] = w * substeps;
    motion.q[2] = x;
    motion.q[3] = v * substeps;
    motion.phasor[0] = c;
    motion.phasor[1] = s;
    motion.bound = bound;
    // This value is stored, because a value that the next dispatch computed again might round differently. The bits must not depend on
    // where a dispatch ends.
    motion.bend = a;
    let is_interrupted = count == allowed;
    if is_interrupted {
        // Step and fraction stay those of the scan's start until it ends. So they are rounded once, wherever dispatches end.
        tally.scanned = count;
    } else {
        let reached = phase_after(count);
        tally.step = reached.step;
        motion.theta = reached.theta;
        tally.scanned = 0u;
    }
    count -= made;
    iterations += count * price;
    tally.passes_in_period += count;
    tally.order = select(0u, 1u, leaves);
    if GROWTH {
        tangent_now = array<Real, 4>(tz, tw * substeps, tx, tv * substeps);
    }
    if COLUMNS {
        step_columns(count);
    }
    // Whole steps are counted as whole numbers, whose sum does not depend on where a dispatch ends.
    if MESH {
        tally.mesh_right += select(0u, count, d == 1u);
        tally.mesh_left += select(0u, count, d == 2u);
    }
    return select(SCAN_CAREFUL, SCAN_BUDGET, is_interrupted);
}
