// The main loop of a lane. One invocation is one lane.

var<private> cell: Cell;
// State that steps and events use.
var<private> motion: MotionNow;
var<private> tally: TallyNow;
// State that strobes use.
var<private> measures: Measures;
var<private> search: Search;
// Index of this lane.
var<private> lane: u32;
// Loop iterations spent in this dispatch.
var<private> iterations: u32;

// Returns the sum of the sizes. It is a NaN if one of them is.
fn sum_of_sizes(q: array<Real, 4>) -> Real {
    return (abs(q[0]) + abs(q[1])) + (abs(q[2]) + abs(q[3]));
}

fn check_finite() {
    let escape = flows[cell.flow_index].escape;
    let can_escape = escape > 0.0;
    let is_beyond = can_escape && abs(motion.q[0]) + abs(motion.q[2]) > escape;
    if is_beyond || !is_bounded(sum_of_sizes(motion.q)) {
        tally.status = select(STATUS_NON_FINITE, STATUS_ESCAPE, can_escape);
        motion.q = array<Real, 4>(0.0, 0.0, 0.0, 0.0);
    }
}

fn is_over() -> bool {
    return tally.status != STATUS_OK || tally.stage == STAGE_READ || tally.stage == STAGE_DONE;
}

// Whether this variant has work for the lane. The variant without the exponent's tangent vector carries a lane until
// it needs the vector, and finishes a cycle that is being read; the other variant then has the lane for good. The
// choice must not depend on where a dispatch ends, because the variants round differently.
fn has_work() -> bool {
    let measures = tally.stage == STAGE_MEASURING;
    if MEASURE || measures {
        return MEASURE && measures && tally.status == STATUS_OK;
    }
    if is_over() || !EXPONENT {
        return !is_over();
    }
    let grows = tally.carries_growth == 1u || (tally.stage == STAGE_RUNNING && tally.period >= settings.growth_from);
    return grows == GROWTH;
}

// Loads lane `i` into registers.
fn load_lane(i: u32) {
    lane = i;
    cell = cells[i];
    motion = motions[i].now;
    tally = tallies[i].now;
    iterations = 0u;
    if KEEP {
        measures = motions[i].measures;
        search = tallies[i].search;
    }
}

fn store_lane() {
    motions[lane].now = motion;
    tallies[lane].now = tally;
    if KEEP {
        motions[lane].measures = measures;
        tallies[lane].search = search;
    }
}

// Loads the state that strobes use. Between strobes, the steps need its registers.
fn load_strobe_state() {
    if !KEEP {
        measures = motions[lane].measures;
        search = tallies[lane].search;
    }
}

fn store_strobe_state() {
    if !KEEP {
        motions[lane].measures = measures;
        tallies[lane].search = search;
    }
}

// Follows the motion to the next stop phase. Returns false if the lane or its iterations in this dispatch end before.
// Lanes wait for each other where chatter begins, too.
fn fly_to_stop_phase() -> bool {
    if CHATTER {
        while has_work() && iterations < settings.iterations {
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
    while has_work() && !chatters && iterations < settings.iterations {
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
        // Each step of a lane that is measured is a pass.
        if !MEASURE && tally.passes_in_period > settings.passes_per_period {
            tally.status = STATUS_TOO_STIFF;
        }
    }
    return false;
}

@compute @workgroup_size(WORKGROUP)
fn sweep(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.y * settings.row + id.x;
    if i >= queue.count {
        return;
    }
    load_lane(selected_lane(i));
    if STAGES || INTERVALS {
        cell.flow_index = present_flow();
    }
    fetch_constants();
    load_tangent();
    sync_overtones(tally.step, motion.theta);
    if !STAGES && motion.bound == 0.0 {
        // A start: no pass has computed the bound yet.
        renew_bound();
    }
    // Scans, events and strobes are in separate loops, so that lanes do the same work at the same time.
    while has_work() && iterations < settings.iterations {
        if fly_to_stop_phase() {
            if MEASURE {
                measure_period();
                if STAGES {
                    restart_schedule();
                }
                continue;
            }
            load_strobe_state();
            if tally.step >= shape.steps {
                begin_period();
                if STAGES {
                    restart_schedule();
                }
            } else {
                compare_mirror();
            }
            store_strobe_state();
        }
    }
    if tally.stage == STAGE_READ {
        load_strobe_state();
        judge_cycle();
        store_strobe_state();
    }
    if settings.measured_periods > 0u && tally.stage == STAGE_DONE && tally.status == STATUS_OK && !MEASURE {
        begin_measuring();
    }
    store_tangent_now();
    store_lane();
}
