// The functions that observers call, for an oscillator with one gap. machine/machine.wgsl defines them for machines.

// Loads constants at the start of a dispatch.
fn resume_motion() {
    if STAGES {
        cell.flow_index = present_flow();
    }
    fetch_constants();
}

// Prepares the first step of a dispatch, after the tangent vector has been loaded.
fn prepare_motion() {
    sync_overtones(tally.step, motion.theta);
    if !STAGES && motion.bound == 0.0 {
        // At the start of a motion, no step has computed the bound yet.
        renew_bound();
    }
}

// At the end of a dispatch, stores the state that the motion needs.
fn suspend_motion() {}

// For machines, these functions project new columns of the monodromy matrix to the constraints, record which elements slide, and exclude
// the multipliers of elements that stick for ever. An oscillator with one gap needs none of this.
fn constrain_columns() {}

fn begin_cycle() {}

fn deflate_columns() {}

// Begins the schedule of stages at phase 0.
fn begin_schedule() {
    if STAGES {
        restart_schedule();
    }
}

// Sets the phase of the forcing to exactly 0.
fn restart_phase() {
    motion.phasor = array<Real, 2>(1.0, 0.0);
}

// Whether the energy of the transient keeps the gap off the walls from now on.
fn is_non_impacting() -> bool {
    if tally.mode != MODE_FREE || settings.max_period == 0u {
        return false;
    }
    let s = flows[cell.flow_index].steady;
    let q = motion.q;
    if shapes[cell.flow_index].must_rest == 1u && (q[2] != 0.0 || q[3] != 0.0) {
        return false;
    }
    return derivative_bound(q[0] - s[0], q[1] - s[1], q[2] - s[2], q[3] - s[3]) < flows[cell.flow_index].contact_free_size;
}

// Returns the growth of the transient of contact-free motion per period, in octaves.
fn contact_free_growth() -> Real {
    return flows[cell.flow_index].transient_growth;
}

// Returns the present state in any domain, with the gap measured from the middle between the walls.
fn strobe_state() -> State {
    var q = motion.q;
    if tally.mode != MODE_FREE {
        q[0] += flows[cell.flow_index].walls[side_of(tally.mode)];
    }
    return q;
}

// Returns the largest displacement of a strobe. Its rounding error limits the resolution of distances. In contact, the gap is the sum of
// the wall's position and the penetration, which may have opposite signs.
fn largest_position(q: State) -> Real {
    let position = largest_displacement(q);
    if tally.mode == MODE_FREE {
        return position;
    }
    return max(position, abs(flows[cell.flow_index].walls[side_of(tally.mode)]));
}

// Returns the forcing frequency in radians per unit of time of the rates.
fn unit_of_frequency() -> Real {
    return flows[cell.flow_index].domains[0].angle;
}

fn scale_of_length() -> Real {
    return flows[cell.flow_index].length;
}

fn escape_size() -> Real {
    return flows[cell.flow_index].escape;
}

// Whether stages change the forces at given phases.
fn has_stages() -> bool {
    return STAGES && shape.changes > 0u;
}

// Whether the gap may be at `to` in the present domain, at a phase without event. The contact onset has no bounds.
fn keeps_domain(to: State) -> bool {
    return tally.mode >= MODE_ONSET || beyond(to) < 0.0;
}

// Returns how far `to` lies beyond the nearest end of the present domain; negative inside.
fn beyond(to: State) -> Real {
    if tally.mode == MODE_FREE {
        return max(to[0] - walls[0], walls[1] - to[0]);
    }
    let side = side_of(tally.mode);
    return sign_of(side) * (walls[side] - to[0]);
}

// Whether Newton's method may put the lane at `to`. In the contact onset the gap is in front of its wall.
fn is_tied() -> bool {
    return false;
}

fn may_place(to: State) -> bool {
    let leaves_onset = is_onset() && !(beyond(to) > 0.0);
    return !leaves_onset && tally.order == 0u;
}

// Puts the lane at a strobe state, in its present modes. Newton's method neither starts nor ends on a wall.
fn place(to: State) {
    motion.q = to;
    if tally.mode != MODE_FREE {
        motion.q[0] -= walls[side_of(tally.mode)];
    }
    if sticks() {
        motion.q[0] = 0.0;
        motion.q[1] = 0.0;
    }
    tally.order = 0u;
    motion.bound = 0.0;
}

// Stores the modes in which Newton's method starts, and restores them.
fn keep_modes() {
    search.newton_start_mode = tally.mode;
    search.newton_start_origin = tally.origin;
}

fn restore_modes() {
    tally.mode = search.newton_start_mode;
    tally.origin = search.newton_start_origin;
}

// Error of a computed fixed point before amplification, in units of the motion's rounding error.
const MISPLACED: Real = 8.0;

// Whether a motion without events has a limit that lies beyond the wall by more than the rounding error of a period.
fn leaves_domain(to: State) -> bool {
    let unsure = MISPLACED * ULP * measures.position_scale * Real(limit_of(1.0));
    let may_leave = tally.events == 0u && tally.order == 0u && tally.mode < MODE_ONSET;
    return may_leave && beyond(to) > unsure;
}

// Whether the motion is away from all walls, so that the state may be perturbed.
fn is_free() -> bool {
    return tally.mode == MODE_FREE && tally.order == 0u;
}

// Loads the state of the motion that results need. Walls are the same in all stages.
fn conclude_motion() {}

fn mesh_fraction(periods: u32) -> Real {
    let f = cell.flow_index;
    let right = Real(tally.mesh_right) * flows[f].domains[1].share;
    let left = Real(tally.mesh_left) * flows[f].domains[2].share;
    let steps = Real(tally.mesh_whole) + ((right + left) + motion.mesh_part);
    return steps / (Real(periods) * Real(shapes[f].steps));
}

// Puts a lane at its start.
fn begin_motion() {
    tally.mode = MODE_FREE;
    tally.origin = SIDE_NONE;
    motion.q = starts[lane];
    let walls = flows[cell.flow_index].walls;
    if motion.q[0] > walls[0] {
        start_beyond(SIDE_RIGHT);
    } else if motion.q[0] < walls[1] {
        start_beyond(SIDE_LEFT);
    }
}

// A start beyond a wall is a sustained contact.
fn start_beyond(side: u32) {
    motion.q[0] -= flows[cell.flow_index].walls[side];
    tally.mode = MODE_SUSTAINED + side;
    tally.origin = side;
}

// Adds the symbol of a flight that ends on `side`. The first flight comes from no wall and has no symbol.
fn add_symbol_of_flight(side: u32) {
    var symbol: u32;
    if tally.mode != MODE_FREE {
        symbol = select(4u, 1u, side == SIDE_RIGHT);
    } else if tally.origin == SIDE_RIGHT {
        symbol = select(3u, 2u, side == SIDE_RIGHT);
    } else if tally.origin == SIDE_LEFT {
        symbol = select(6u, 5u, side == SIDE_LEFT);
    } else {
        return;
    }
    add_symbol(symbol);
}

// Follows the motion to the next stop phase. Returns false if the lane, or its iterations in this dispatch, end before. Lanes also wait for
// each other at the start of chatter.
fn fly_to_stop_phase() -> bool {
    if CHATTER {
        while tally.status == STATUS_OK && iterations < settings.iterations {
            if flight_to_chatter() {
                return true;
            }
            if chatters {
                follow_chatter(tally.origin);
            }
        }
    } else {
        return flight_to_chatter();
    }
    return false;
}

// Follows the motion to the next stop phase, or to an impact that begins a series of short flights.
fn flight_to_chatter() -> bool {
    chatters = false;
    while tally.status == STATUS_OK && !chatters && iterations < settings.iterations {
        if STAGES {
            change_stage();
            if motion.bound == 0.0 {
                renew_bound();
            }
        }
        if scan() == SCAN_BUDGET {
            break;
        }
        if careful() {
            return true;
        }
        // Each step of a measured lane counts as a pass.
        if !MEASURE && tally.passes_in_period > settings.passes_per_period {
            tally.status = STATUS_TOO_STIFF;
        }
    }
    return false;
}
