// The main loop of a lane. One invocation is one lane.

var<private> cell: Cell;
// State that steps and events use, in registers.
var<private> motion: MotionNow;
var<private> tally: TallyNow;
// State that strobes use.
var<private> measures: Measures;
var<private> search: Search;
// Index of this lane.
var<private> lane: u32;
// Loop iterations spent in this dispatch.
var<private> iterations: u32;

// Returns the sum of the sizes of the numbers; NaN if one of them is NaN.
fn sum_of_sizes(q: State) -> Real {
    var sum = abs(q[0u]) + abs(q[1u]);
    //% for k in 1..COORDINATES
    sum += abs(q[2u * $ku]) + abs(q[2u * $ku + 1u]);
    //% end
    return sum;
}

// Returns the sum of the sizes of the displacements.
fn sum_of_displacements(q: State) -> Real {
    var sum = abs(q[0u]);
    //% for k in 1..COORDINATES
    sum += abs(q[2u * $ku]);
    //% end
    return sum;
}

fn check_finite() {
    let escape = escape_size();
    let can_escape = escape > 0.0;
    let is_beyond = can_escape && sum_of_displacements(motion.q) > escape;
    if is_beyond || !is_bounded(sum_of_sizes(motion.q)) {
        tally.status = select(STATUS_NON_FINITE, STATUS_ESCAPE, can_escape);
        motion.q = State();
    }
}

fn is_over() -> bool {
    return tally.status != STATUS_OK || tally.stage == STAGE_READ || tally.stage == STAGE_DONE;
}

// Whether this variant has work for the lane. The variant without the exponent's tangent vector moves a lane until it needs the vector; a
// reading in progress is finished first. From then on the lane belongs to the other variant. The choice must not depend on where a dispatch
// ends, because the variants round differently.
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

// Loads the state that strobes use. It stays in memory between strobes, because the steps need the registers.
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

// Returns the step at which the lane must stop. This is phase 0; half-way through a cycle of odd period that may be its own mirror image,
// it is half a period.
fn next_stop_phase() -> u32 {
    let steps = shape.steps;
    let halfway = SYMMETRY && tally.stage == STAGE_READING && 2u * tally.periods_to_read == tally.candidate + 1u;
    return select(steps, steps / 2u, halfway && tally.step < steps / 2u);
}

@compute @workgroup_size(WORKGROUP)
fn sweep(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.y * settings.row + id.x;
    if i >= queue.count {
        return;
    }
    load_lane(selected_lane(i));
    resume_motion();
    load_tangent();
    prepare_motion();
    // Scans, events and strobes have separate loops, so that lanes do the same work at the same time.
    while has_work() && iterations < settings.iterations {
        if fly_to_stop_phase() {
            if MEASURE {
                measure_period();
                begin_schedule();
                continue;
            }
            load_strobe_state();
            if tally.step >= shape.steps {
                begin_period();
                begin_schedule();
            } else {
                compare_mirror();
            }
            store_strobe_state();
        }
    }
    if tally.stage == STAGE_READ {
        load_strobe_state();
        judge_cycle();
        if tally.stage == STAGE_READING {
            begin_reading();
        }
        store_strobe_state();
    }
    if settings.measured_periods > 0u && tally.stage == STAGE_DONE && tally.status == STATUS_OK && !MEASURE {
        begin_measuring();
    }
    store_tangent_now();
    suspend_motion();
    store_lane();
}
