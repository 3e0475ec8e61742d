// Newton's method on the strobe map: leads a motion that approaches a cycle to the cycle.

// Moves the lane to `to`, the fixed point of the linearised strobe map, to read the cycle from there (`begin_reading` follows). The monodromy
// matrix has been read along one candidate cycle, from the anchor to the present strobe. Returns false if the last step has not brought the
// lane closer, or if this step would leave the domain.
fn refine(to: State) -> bool {
    if search.newton_steps == 0u {
        keep_modes();
    }
    let stalls = search.newton_steps > 0u && search.return_distance < search.earlier_return_distance + SHRUNK;
    let is_over = search.newton_steps >= MOST_NEWTON_STEPS || tally.period + tally.candidate > last_period();
    if stalls || is_over || !may_place(to) {
        return false;
    }
    if !is_bounded(sum_of_sizes(to)) || !(keeps_domain(to) && distance_between(to, trail(search.strobe_count)) < Real(LONGEST_NEWTON_STEP)) {
        return false;
    }
    place(to);
    search.newton_steps += 1u;
    search.earlier_return_distance = search.return_distance;
    tally.stage = STAGE_READING;
    return true;
}

// Returns the hash of the events of the cycle that has been read. All motions on one branch of the strobe map have the same hash.
fn branch() -> u32 {
    return mix_bits(mix_bits(tally.hash_low + tally.events) + tally.recent);
}

// Stores the hash of the events if this is the first reading with the present period.
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

fn difference(a: State, b: State) -> State {
    var d: State;
    //% for k in 0..DIM
    d[$ku] = a[$ku] - b[$ku];
    //% end
    return d;
}

fn size_of(u: State) -> Real {
    return distance_between(u, State());
}

// Applies the monodromy matrix to a deviation.
fn image_of(u: State) -> State {
    var image: State;
    for (var i = 0u; i < DIM; i++) {
        var sum = motions[lane].tangents[i] * u[0u] + motions[lane].tangents[i + DIM] * u[1u];
        //% for k in 1..COORDINATES
        sum += motions[lane].tangents[i + 2u * $ku * DIM] * u[2u * $ku] + motions[lane].tangents[i + (2u * $ku + 1u) * DIM] * u[2u * $ku + 1u];
        //% end
        image[i] = sum;
    }
    return image;
}

// Moves the lane back to the state at which Newton's method started.
fn return_to_start() {
    if search.newton_steps == 0u {
        return;
    }
    restore_modes();
    place(trail(search.strobe_count));
    search.newton_steps = 0u;
}

// Returns `a + (1 - M)^-1 (P(a) - a)` for the anchor `a`, by elimination with row pivots.
fn fixed_point() -> State {
    let present = strobe_state();
    var m: array<Real, MATRIX>;
    var right = difference(present, measures.anchor);
    for (var i = 0u; i < DIM; i++) {
        for (var j = 0u; j < DIM; j++) {
            m[DIM * i + j] = select(Real(0.0), Real(1.0), i == j) - motions[lane].tangents[DIM * j + i];
        }
    }
    for (var k = 0u; k < DIM; k++) {
        var pivot = k;
        for (var i = k + 1u; i < DIM; i++) {
            pivot = select(pivot, i, abs(m[DIM * i + k]) > abs(m[DIM * pivot + k]));
        }
        for (var j = k; j < DIM; j++) {
            let swapped = m[DIM * k + j];
            m[DIM * k + j] = m[DIM * pivot + j];
            m[DIM * pivot + j] = swapped;
        }
        let swapped_right = right[k];
        right[k] = right[pivot];
        right[pivot] = swapped_right;
        let inverse = 1.0 / m[DIM * k + k];
        for (var i = 0u; i < DIM; i++) {
            if i != k {
                let factor = m[DIM * i + k] * inverse;
                for (var j = k; j < DIM; j++) {
                    m[DIM * i + j] -= factor * m[DIM * k + j];
                }
                right[i] -= factor * right[k];
            }
        }
    }
    var to = measures.anchor;
    for (var i = 0u; i < DIM; i++) {
        to[i] += right[i] / m[DIM * i + i];
    }
    return to;
}
