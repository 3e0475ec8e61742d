// The functions that observers call, for machines. pair/oscillator.wgsl defines them for oscillators with one gap.

fn begin_motion() {
    let start = starts[lane];
    for (var i = 0u; i < DIM; i++) {
        motion.q[i] = start[i];
    }
    // The host has packed the modes in the format of `pack_modes`, but for the stage.
    let origin = u32(start[DIM + 1u]);
    tally.mode = u32(start[DIM]) | ((origin >> 12u) << 19u);
    tally.origin = origin & 0xfffu;
    tally.order = u32(start[DIM + 2u]);
    // The start already includes a change of the stage at phase 0.
    tally.next_change = u32(start[DIM + 3u]);
}

fn resume_motion() {
    fetch_constants();
}

fn prepare_motion() {}

fn suspend_motion() {
    pack_modes();
}

// The last stage holds until the first change. If this change is at phase 0, the first step of the period has zero length.
fn begin_schedule() {
    tally.next_change = 0u;
}

fn restart_phase() {}

fn set_tangent(i: u32, u: State) {
    var v = u;
    for (var k = 0u; k < shape.dim; k++) {
        if GROWTH {
            tangent_now[k] = v[k];
        } else {
            motions[lane].tangents[DIM * i + k] = v[k];
        }
    }
}

// Returns a column of the monodromy matrix.
fn column(i: u32) -> State {
    var u: State;
    for (var k = 0u; k < shape.dim; k++) {
        u[k] = motions[lane].tangents[DIM * i + k];
    }
    return u;
}

// Projects a tangent vector to the constraints: what is at rest is also at rest in neighbouring motions.
fn constrained(u: State) -> State {
    var v = u;
    for (var gap = 0u; gap < GAPS; gap++) {
        if is_stuck(gap_modes[gap]) {
            v[2u * gap] = 0.0;
        }
    }
    hold(&v, 0.0);
    return v;
}

// Makes the next step constrain the columns. Drivers copy a function to each call, so only the step contains this code.
fn constrain_columns() {
    slid |= NEW_COLUMNS;
}

fn begin_cycle() {
    slid = NEW_COLUMNS;
    for (var i = 0u; i < ELEMENTS; i++) {
        slid |= select(0u, 1u << i, slips[i] != STICKS);
    }
}

// A displacement along the row of an element that sticks for ever stays constant, which gives a multiplier of exactly 1. To exclude it, the
// matrix is multiplied by the projection to deviations without this displacement.
fn deflate_columns() {
    if ELEMENTS == 0u {
        return;
    }
    var rows: array<State, ELEMENT_SLOTS>;
    for (var i = 0u; i < ELEMENTS; i++) {
        if i >= shape.elements || ((slid >> i) & 1u) == 1u {
            continue;
        }
        var f: State;
        for (var j = 0u; j < shape.coordinates; j++) {
            let is_held = j < GAPS && is_stuck(gap_modes[min(j, GAPS - 1u)]);
            f[2u * j] = select(number(AT_ELEMENTS + i * (WIDTH + 1u) + 2u * j + 1u), Real(0.0), is_held);
        }
        for (var other = 0u; other < i; other++) {
            let along = inner(rows[other], f) / max(inner(rows[other], rows[other]), Real(1e-30));
            f = difference(f, scaled(rows[other], along));
        }
        rows[i] = f;
        let square = inner(f, f);
        if !(square > 1e-20) {
            continue;
        }
        iterations += 2u * MATRIX;
        let image = image_of(f);
        for (var column = 0u; column < shape.dim; column++) {
            let share = f[column] / square;
            for (var k = 0u; k < shape.dim; k++) {
                motions[lane].tangents[DIM * column + k] -= share * image[k];
            }
        }
    }
}

fn conclude_motion() {
    flow = flows[cell.flow_index];
    shape = shapes[cell.flow_index];
}

fn fly_to_stop_phase() -> bool {
    while tally.status == STATUS_OK && (iterations < settings.iterations || leaving_gap < GAPS) {
        if step() {
            return true;
        }
        if tally.passes_in_period > settings.passes_per_period {
            tally.status = STATUS_TOO_STIFF;
        }
    }
    return false;
}

fn strobe_state() -> State {
    return motion.q;
}

fn largest_position(q: State) -> Real {
    return largest_displacement(q);
}

fn unit_of_frequency() -> Real {
    return flow.omega;
}

fn scale_of_length() -> Real {
    return flow.length;
}

fn escape_size() -> Real {
    return flow.escape;
}

fn has_stages() -> bool {
    return shape.changes > 0u;
}

// Whether the energy of the transient keeps all gaps off the walls from now on.
fn is_non_impacting() -> bool {
    if flow.contact_free_energy <= 0.0 || settings.max_period == 0u {
        return false;
    }
    for (var gap = 0u; gap < GAPS; gap++) {
        if gap_modes[gap] != BEYOND {
            return false;
        }
    }
    iterations += DIM + COORDINATES * COORDINATES;
    var transient = motion.q;
    for (var i = 0u; i < shape.dim; i++) {
        transient[i] -= flow.steady[i];
    }
    var twice_energy = Real(0.0);
    for (var i = 0u; i < shape.coordinates; i++) {
        for (var j = 0u; j < shape.coordinates; j++) {
            let place = AT_ENERGY + i * COORDINATES + j;
            twice_energy += number(place) * transient[2u * i + 1u] * transient[2u * j + 1u];
            twice_energy += number(place + COORDINATES * COORDINATES) * transient[2u * i] * transient[2u * j];
        }
    }
    return twice_energy < flow.contact_free_energy;
}

fn contact_free_growth() -> Real {
    return flow.transient_growth;
}

// Whether two gaps have reached their walls at the same time, so that their order in the model decided the motion.
fn is_tied() -> bool {
    return tally.ties == 1u;
}

// Whether the motion is away from all walls, and no force or rate is at its limit.
fn is_away_from_roots() -> bool {
    var is_away = true;
    for (var gap = 0u; gap < GAPS; gap++) {
        is_away = is_away && wall_side[gap] == SIDE_NONE && from_force[gap] == 0u;
    }
    for (var i = 0u; i < ELEMENTS; i++) {
        is_away = is_away && from_rate[i] == 0u;
    }
    return is_away;
}

fn may_place(to: State) -> bool {
    return is_away_from_roots();
}

fn place(to: State) {
    var q = to;
    for (var gap = 0u; gap < GAPS; gap++) {
        if is_stuck(gap_modes[gap]) {
            let side = contact_of(gap_modes[gap]);
            q[2u * gap] = last_wall_at(gap, side);
        }
        wall_side[gap] = SIDE_NONE;
        from_force[gap] = 0u;
    }
    for (var i = 0u; i < ELEMENTS; i++) {
        from_rate[i] = 0u;
    }
    hold(&q, 1.0);
    motion.q = q;
}

fn keep_modes() {
    pack_modes();
    search.newton_start_mode = tally.mode;
    search.newton_start_origin = tally.origin;
}

fn restore_modes() {
    tally.mode = search.newton_start_mode;
    tally.origin = search.newton_start_origin;
    tally.order = 0u;
    unpack_modes();
}

fn keeps_domain(to: State) -> bool {
    return beyond(to) < 0.0;
}

// Returns the largest distance by which a gap at `to` lies beyond a wall that ends its mode; negative if all are inside.
fn beyond(to: State) -> Real {
    var q = to;
    var most = -HUGE;
    for (var gap = 0u; gap < GAPS; gap++) {
        let mode = gap_modes[gap];
        let z = q[2u * gap];
        if mode < ONSET {
            for (var direction = 0u; direction < 2u; direction++) {
                let wall = wall_ahead(gap, direction);
                if wall.y != NO_WALL {
                    most = max(most, sign_of(direction) * (z - wall_at(gap, wall.x, wall.y)));
                }
            }
        } else if mode < STUCK {
            let side = contact_of(mode);
            let is_before = mode < PRESSED;
            most = max(most, select(Real(-1.0), Real(1.0), is_before) * sign_of(side) * (z - last_wall_at(gap, side)));
        }
    }
    return most;
}

// Error of a computed fixed point before amplification, in units of the motion's rounding error.
const MISPLACED: Real = 8.0;

fn leaves_domain(to: State) -> bool {
    let unsure = MISPLACED * ULP * measures.position_scale * Real(limit_of(1.0));
    return tally.events == 0u && is_away_from_roots() && beyond(to) > unsure;
}

fn is_free() -> bool {
    var is_free_of_contact = is_away_from_roots();
    for (var gap = 0u; gap < GAPS; gap++) {
        is_free_of_contact = is_free_of_contact && gap_modes[gap] == BEYOND;
    }
    return is_free_of_contact;
}

fn mesh_fraction(periods: u32) -> Real {
    return (Real(tally.mesh_whole) + motion.mesh_part) / (Real(periods) * Real(shape.steps));
}

// The processor measures machines (src/map/engine/finish.rs).
fn measure_period() {}

fn begin_measuring() {}
