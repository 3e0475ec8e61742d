// Several walls on one side: each interval between neighbouring walls has a flow of its own. Free motion includes the springs of the walls
// that the gap has passed. Where the motion passes a wall, it changes to the flow of the next interval. Only the last wall of a side has a
// domain of contact. The rules are those of the reference (dynamics/src/pair/elastic.rs).
//
// `tally.interval` is 0 between the first walls, `2 n` behind the nth right wall, and `2 n + 1` behind the nth left wall. A flag is added
// in open contact with a wall that only pushes (pushing.wgsl).

// Mode in a `Jump` that means: the motion passes a wall, and continues as free motion in the next interval.
const MODE_PASSING: u32 = 7u;

// Whether the gap is behind a wall, in free motion or in contact with the next wall.
fn is_behind_wall() -> bool {
    return INTERVALS && (tally.interval & 255u) > 1u;
}

// The side of the present interval.
fn side_of_interval() -> u32 {
    return tally.interval & 1u;
}

// Returns the flow of the interval behind a wall of the present one, or NO_FLOW.
fn flow_behind(side: u32) -> u32 {
    return select(shape.behind[1], shape.behind[0], side == SIDE_RIGHT);
}

// Returns the flow of the present stage and interval.
fn present_flow() -> u32 {
    let flow = cells[lane].flow_index;
    if STAGES {
        return flow_of_interval(flow_of_stage(flow));
    }
    return flow_of_interval(flow);
}

// Returns the flow of the present interval. `between` is the flow between the first walls.
fn flow_of_interval(between: u32) -> u32 {
    var flow = between;
    if INTERVALS {
        for (var n = 0u; n < (tally.interval & 255u) / 2u; n++) {
            flow = shapes[flow].behind[side_of_interval()];
        }
        if is_open() {
            let closed = shapes[flow].behind[side_of_interval()];
            flow = shapes[closed].behind[side_of_interval()];
        }
    }
    return flow;
}

// Passes a wall of the present interval, from the inside or from the outside.
fn pass_wall(side: u32) {
    if is_bounded_by_force(side) {
        tally.interval = select(OPEN + tally.interval - 2u, tally.interval - OPEN + 2u, is_open());
        tally.origin = side;
    } else {
        let is_outwards = tally.interval == 0u || side_of_interval() == side;
        var inner = select(tally.interval - 2u, 0u, tally.interval < 4u);
        if is_open() {
            inner = select(tally.interval - OPEN, 0u, tally.interval < OPEN + 2u);
        }
        tally.interval = select(inner, max(tally.interval, side) + 2u, is_outwards);
        // The wall is now on the gap's other side.
        tally.origin = 1u - side;
    }
    cell.flow_index = flow_behind(side);
    fetch_constants();
}
