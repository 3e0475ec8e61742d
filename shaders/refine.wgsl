// Newton's method on the strobe map: leads a motion that approaches a cycle to the cycle.

// Moves the lane to `to`, the fixed point of the linearised strobe map, and reads on from there. The monodromy matrix
// has been read along one candidate cycle, from the anchor to the present strobe. Returns false if the step brings
// the lane no closer or leaves the domain.
fn refine(to: array<Real, 4>) -> bool {
    if search.newton_steps == 0u {
        search.newton_start_mode = tally.mode;
        search.newton_start_origin = tally.origin;
        search.newton_start_interval = tally.interval;
    }
    let stalls = search.newton_steps > 0u && search.return_distance < search.earlier_return_distance + SHRUNK;
    let is_over = search.newton_steps >= MOST_NEWTON_STEPS || tally.period + tally.candidate > last_period();
    // In the contact onset the gap is in front of its wall.
    let leaves_onset = is_onset() && !(beyond(to) > 0.0);
    if stalls || is_over || leaves_onset || tally.order > 0u {
        return false;
    }
    if !is_bounded(sum_of_sizes(to)) || !(keeps_domain(to) && distance_between(to, trail(search.strobe_count)) < Real(LONGEST_NEWTON_STEP)) {
        return false;
    }
    motion.q = to;
    if tally.mode != MODE_FREE {
        motion.q[0] -= walls[side_of(tally.mode)];
    }
    if sticks() {
        motion.q[0] = 0.0;
        motion.q[1] = 0.0;
    }
    motion.bound = 0.0;
    search.newton_steps += 1u;
    search.earlier_return_distance = search.return_distance;
    begin_reading();
    return true;
}

// Returns the hash of the events of the cycle that has been read. It is constant along one branch of the strobe map.
fn branch() -> u32 {
    return mix_bits(mix_bits(tally.hash_low + tally.events) + tally.recent);
}

// Stores the events of the first reading with the present period.
fn store_branch() {
    if search.newton_steps == 0u || search.branch_period != tally.candidate {
        search.branch = branch();
        search.branch_period = tally.candidate;
        search.earlier_return_distance = 0u;
    }
}

// Whether the cycle lies on the branch on which the motion approaches it. A cycle beyond a fold may belong to another
// motion.
fn is_on_branch() -> bool {
    return branch() == search.branch && (tally.grazes == 0u || search.newton_steps == 0u);
}

fn difference(a: array<Real, 4>, b: array<Real, 4>) -> array<Real, 4> {
    return array<Real, 4>(a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]);
}

fn size_of(u: array<Real, 4>) -> Real {
    return distance_between(u, array<Real, 4>(0.0, 0.0, 0.0, 0.0));
}

// Applies the monodromy matrix to a deviation.
fn image_of(u: array<Real, 4>) -> array<Real, 4> {
    var image: array<Real, 4>;
    for (var i = 0u; i < 4u; i++) {
        image[i] = (motions[lane].tangents[i] * u[0] + motions[lane].tangents[i + 4u] * u[1])
            + (motions[lane].tangents[i + 8u] * u[2] + motions[lane].tangents[i + 12u] * u[3]);
    }
    return image;
}

// Whether the gap may be at `to` in the present domain, at a phase without event. The contact onset has no bounds.
fn keeps_domain(to: array<Real, 4>) -> bool {
    return tally.mode >= MODE_ONSET || beyond(to) < 0.0;
}

// Returns how far `to` lies beyond the nearest end of the present domain; negative inside.
fn beyond(to: array<Real, 4>) -> Real {
    if tally.mode == MODE_FREE {
        return max(to[0] - walls[0], walls[1] - to[0]);
    }
    let side = side_of(tally.mode);
    return sign_of(side) * (walls[side] - to[0]);
}

// Moves the lane back to where Newton's method started.
fn return_to_start() {
    if search.newton_steps == 0u {
        return;
    }
    motion.q = trail(search.strobe_count);
    tally.mode = search.newton_start_mode;
    tally.origin = search.newton_start_origin;
    if INTERVALS && tally.interval != search.newton_start_interval {
        tally.interval = search.newton_start_interval;
        cell.flow_index = present_flow();
        fetch_constants();
    }
    // Newton's method does not start on a wall.
    tally.order = 0u;
    if tally.mode != MODE_FREE {
        motion.q[0] -= walls[side_of(tally.mode)];
    }
    if sticks() {
        motion.q[0] = 0.0;
    }
    motion.bound = 0.0;
    search.newton_steps = 0u;
}

// Returns `a + (1 - M)^-1 (P(a) - a)` for the anchor `a`, by elimination with row pivots.
fn fixed_point() -> array<Real, 4> {
    let present = strobe_state();
    // Row by row, the right-hand side last.
    var m: array<Real, 20>;
    for (var i = 0u; i < 4u; i++) {
        for (var j = 0u; j < 4u; j++) {
            m[5u * i + j] = select(Real(0.0), Real(1.0), i == j) - motions[lane].tangents[4u * j + i];
        }
        m[5u * i + 4u] = present[i] - measures.anchor[i];
    }
    for (var k = 0u; k < 4u; k++) {
        var pivot = k;
        for (var i = k + 1u; i < 4u; i++) {
            pivot = select(pivot, i, abs(m[5u * i + k]) > abs(m[5u * pivot + k]));
        }
        for (var j = k; j < 5u; j++) {
            let swapped = m[5u * k + j];
            m[5u * k + j] = m[5u * pivot + j];
            m[5u * pivot + j] = swapped;
        }
        let inverse = 1.0 / m[6u * k];
        for (var i = 0u; i < 4u; i++) {
            if i != k {
                let factor = m[5u * i + k] * inverse;
                for (var j = k; j < 5u; j++) {
                    m[5u * i + j] -= factor * m[5u * k + j];
                }
            }
        }
    }
    var to = measures.anchor;
    for (var i = 0u; i < 4u; i++) {
        to[i] += m[5u * i + 4u] / m[6u * i];
    }
    return to;
}
