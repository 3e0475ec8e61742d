// Puts a lane at its start, before its first dispatch.

@compute @workgroup_size(WORKGROUP)
fn begin(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = settings.first_new + id.y * settings.row + id.x;
    if i >= settings.active_lanes {
        return;
    }
    lane = active_lane(i);
    cell = cells[lane];
    tally.status = cell.refused;
    tally.mode = MODE_FREE;
    tally.origin = SIDE_NONE;
    tally.strobe_distance = FAR_FROM_STROBE;
    motion.q = starts[lane];
    motion.phasor = array<Real, 2>(1.0, 0.0);
    let walls = flows[cell.flow_index].walls;
    if motion.q[0] > walls[0] {
        start_beyond(SIDE_RIGHT);
    } else if motion.q[0] < walls[1] {
        start_beyond(SIDE_LEFT);
    }
    // The trail needs no initial value: `strobe_count` is its length.
    motions[lane].now = motion;
    motions[lane].measures = measures;
    motions[lane].tangents = array<Real, 16>();
    motions[lane].vector = initial_tangent();
    tallies[lane].now = tally;
    tallies[lane].search = search;
    tallies[lane].distances = array<u32, 16>();
    tallies[lane].last_distances = array<u32, 16>();
    tallies[lane].word = array<u32, 7>();
    tallies[lane].is_measured = 0u;
    begin_pattern();
}

// A start beyond the last wall of a side is a sustained contact.
fn start_beyond(side: u32) {
    if INTERVALS {
        while sign_of(side) * (motion.q[0] - flows[cell.flow_index].walls[side]) > 0.0 && shapes[cell.flow_index].behind[side] != NO_FLOW {
            cell.flow_index = shapes[cell.flow_index].behind[side];
            tally.interval = max(tally.interval, side) + 2u;
        }
        if watches_force() && force_inside(motion.q) < 0.0 {
            cell.flow_index = shapes[cell.flow_index].behind[side];
            tally.interval += OPEN - 2u;
            tally.origin = side;
        }
        if sign_of(side) * (motion.q[0] - flows[cell.flow_index].walls[side]) <= 0.0 {
            return;
        }
    }
    motion.q[0] -= flows[cell.flow_index].walls[side];
    tally.mode = MODE_SUSTAINED + side;
    tally.origin = side;
}
