// The kernels that continue lanes. One invocation has at most one lane. A dispatch of `sweep` takes lanes to their next stop phase, and a
// dispatch of `observe` follows.

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

// Loads lane `i` into registers.
fn load_lane(i: u32) {
    lane = i;
    cell = cells[i];
    motion = motions[i].now;
    tally = tallies[i].now;
    iterations = 0u;
}

fn store_lane() {
    motions[lane].now = motion;
    tallies[lane].now = tally;
}

fn load_strobe_state() {
    measures = motions[lane].measures;
    search = tallies[lane].search;
}

fn store_strobe_state() {
    motions[lane].measures = measures;
    tallies[lane].search = search;
}

// Returns the step at which the lane must stop. This is phase 0; half-way through a cycle of odd period that may be its own mirror image,
// it is half a period.
fn next_stop_phase() -> u32 {
    let steps = shape.steps;
    let halfway = SYMMETRY && tally.stage == STAGE_READING && 2u * tally.periods_to_read == tally.candidate + 1u;
    return select(steps, steps / 2u, halfway && tally.step < steps / 2u);
}

// Integrates lanes to their next stop phase. A lane with very many events may need several dispatches.
@compute @workgroup_size(WORKGROUP)
fn sweep(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = place_in_list(OWN_LIST, id);
    if i == queue.counts[OWN_LIST] {
        return;
    }
    load_lane(listed_lane(OWN_LIST, i));
    // An earlier dispatch may have moved the lane to another list since the lists were made.
    if list_of_lane() != OWN_LIST || tally.at_stop == 1u {
        return;
    }
    resume_motion();
    load_tangent();
    prepare_motion();
    if fly_to_stop_phase() {
        if MEASURE {
            measure_period();
            begin_schedule();
        } else {
            tally.at_stop = 1u;
        }
    }
    store_tangent_now();
    suspend_motion();
    store_lane();
}

// Observes lanes that are at their stop phase.
@compute @workgroup_size(WORKGROUP)
fn observe(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = place_in_list(LIST_OBSERVE, id);
    if i == queue.counts[LIST_OBSERVE] {
        return;
    }
    load_lane(listed_lane(LIST_OBSERVE, i));
    if tally.at_stop == 0u {
        return;
    }
    tally.at_stop = 0u;
    resume_motion();
    load_strobe_state();
    if tally.step >= shape.steps {
        begin_period();
        begin_schedule();
    } else {
        compare_mirror();
    }
    finish_observing();
}

// Decides what follows for the lanes that have read a cycle.
@compute @workgroup_size(WORKGROUP)
fn judge_cycles(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = place_in_list(LIST_JUDGE, id);
    if i == queue.counts[LIST_JUDGE] {
        return;
    }
    load_lane(listed_lane(LIST_JUDGE, i));
    resume_motion();
    load_strobe_state();
    judge_cycle();
    if tally.stage == STAGE_READING {
        begin_reading();
    }
    finish_observing();
}

// Stores a lane after an observation. Begins to measure its motion if its class is decided and the settings ask for it.
fn finish_observing() {
    if settings.measured_periods > 0u && tally.stage == STAGE_DONE && tally.status == STATUS_OK && !is_handed_over() {
        begin_measuring();
    }
    store_strobe_state();
    suspend_motion();
    store_lane();
}
