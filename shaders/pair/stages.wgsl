// Stages: the domains change at given phases of the forcing period. Each stage has its own flow, and the lane changes its flow there. The
// rules are those of the reference (dynamics/src/pair/stages.rs).
//
// Two pairs of numbers describe a change. The first pair has the whole free steps since phase 0 and the fraction of the next step; the
// second pair has the flow that begins. The stage that begins last holds until the first change of the next period.

// Position of the next change: whole free steps and the fraction; NO_STEP if no change is left in this period.
const NO_STEP: u32 = 0xffffffffu;
var<private> change_step: u32;
var<private> change_theta: Real;

// Returns the flow of the present stage.
fn present_flow() -> u32 {
    let flow = cells[lane].flow_index;
    let count = shapes[flow].changes;
    if count == 0u {
        return flow;
    }
    let last = select(tally.next_change, count, tally.next_change == 0u) - 1u;
    return u32(pairs[shapes[flow].schedule + 2u * last + 1u][0]);
}

// Loads the position of the next change.
fn load_change() {
    change_step = NO_STEP;
    if tally.next_change < shape.changes {
        let place = pairs[shape.schedule + 2u * tally.next_change];
        change_step = u32(place[0]);
        change_theta = place[1];
    }
}

// Whether a step and a fraction are at the next change or beyond it.
fn is_at_change(step: u32, theta: Real) -> bool {
    return step > change_step || (step == change_step && theta >= change_theta);
}

// Returns the free steps to the next change; 1 stands for "one or more".
fn steps_to_change() -> Real {
    if tally.step == change_step {
        return change_theta - motion.theta;
    }
    if tally.step + 1u == change_step {
        return change_theta + (1.0 - motion.theta);
    }
    return 1.0;
}

// Enters the stages that begin at the present phase. Rounding may put several changes at the same position.
fn change_stage() {
    while is_at_change(tally.step, motion.theta) {
        iterations += 1u;
        tally.step = change_step;
        motion.theta = change_theta;
        tally.next_change += 1u;
        enter_stage();
    }
}

// Returns to the start of the schedule at phase 0. The last stage holds until the first change, which may be at phase 0.
fn restart_schedule() {
    tally.next_change = 0u;
    load_change();
}

// Enters a stage. State and tangent vectors are continuous. Contacts that depend on a force are decided again: a gap at rest on a rigid
// wall, and a contact onset.
fn enter_stage() {
    let side = side_of(tally.mode);
    let spring = flows[cell.flow_index].springs[side][0];
    cell.flow_index = present_flow();
    fetch_constants();
    if sticks() {
        if !presses(stuck_pull(side), side, motion.q) {
            leave_contact(side);
            motion.q[1] = 0.0;
            tally.order = 2u;
        }
    } else if is_onset() && !(sign_of(side) * acceleration(here.gap_row, here.share, motion.q, place_of_gap(1u + side)) > 0.0) {
        if MEASURE {
            add(SUM_LOST, spring * motion.q[0] * motion.q[0]);
        }
        leave_contact(side);
    }
    if sticks() {
        tally.order = stuck_order(side);
    } else if tally.order > 0u {
        // An event has put the gap on a wall at this instant. If the gap is at rest, the new acceleration decides.
        tally.order = select(1u, 2u, motion.q[1] == 0.0);
    }
    motion.bound = 0.0;
}

// Ends a contact.
fn leave_contact(side: u32) {
    count_event(side);
    motion.q[0] += walls[side];
    tally.mode = MODE_FREE;
    enter(0u);
}
