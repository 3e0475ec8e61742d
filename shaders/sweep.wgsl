// One invocation is one lane.

var<private> cell: Cell;
// What steps and events take.
var<private> motion: MotionNow;
var<private> tally: TallyNow;
// What strobes take.
var<private> seen: Seen;
var<private> noted: Noted;
// Index of this lane.
var<private> lane: u32;
// Loop iterations of this dispatch.
var<private> iterations: u32;

// The sum of sizes: a NaN among them makes it one.
fn sum_of_sizes(q: array<Real, 4>) -> Real {
    return (abs(q[0]) + abs(q[1])) + (abs(q[2]) + abs(q[3]));
}

fn check_finite() {
    if !is_bounded(sum_of_sizes(motion.q)) {
        tally.status = STATUS_NON_FINITE;
        motion.q = array<Real, 4>(0.0, 0.0, 0.0, 0.0);
    }
}

fn is_over() -> bool {
    return tally.status != STATUS_OK || tally.stage >= STAGE_READ;
}

// Whether there is work for this variant. Without the tangent vector for the exponent lanes go
// on until they need it, and who reads a cycle reads it to its end; then they are the other variant's for good.
// Which one has a lane must not depend on when a dispatch ends: they round differently.
fn running() -> bool {
    if is_over() || !EXPONENT {
        return !is_over();
    }
    let grows = tally.grows == 1u || (tally.stage == STAGE_RUNNING && tally.period >= settings.growth_from);
    return grows == GROWTH;
}

// Takes lane `i` into registers.
fn take_up(i: u32) {
    lane = i;
    cell = cells[i];
    motion = motions[i].now;
    tally = tallies[i].now;
    iterations = 0u;
    if KEEP {
        seen = motions[i].seen;
        noted = tallies[i].noted;
    }
}

fn put_down() {
    motions[lane].now = motion;
    tallies[lane].now = tally;
    if KEEP {
        motions[lane].seen = seen;
        tallies[lane].noted = noted;
    }
}

// Before a strobe is checked, and after: from one to the next, registers are for steps.
fn recall() {
    if !KEEP {
        seen = motions[lane].seen;
        noted = tallies[lane].noted;
    }
}

fn remember() {
    if !KEEP {
        motions[lane].seen = seen;
        tallies[lane].noted = noted;
    }
}

// From event to event to the next stop phase; false if the lane or its share of this dispatch ends
// before. Lanes wait for each other where chatter begins, too.
fn fly_to_stop_phase() -> bool {
    if CHATTER {
        while running() && iterations < settings.iterations {
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

// From event to event to the next stop phase, or to an impact from which chatter is to be followed.
fn flight_to_chatter() -> bool {
    chatters = false;
    while running() && !chatters && iterations < settings.iterations {
        if scan() == SCAN_BUDGET {
            break;
        }
        if careful() {
            return true;
        }
        if tally.passes_in_period > settings.passes_per_period {
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
    take_up(queued(i));
    fetch_constants();
    fetch_tangent();
    if motion.bound == 0.0 {
        // A start: no pass has bounded it yet.
        renew_bound();
    }
    // Scanning, acting and checking strobes are separate, so that lanes scan together, act
    // together and check together.
    while running() && iterations < settings.iterations {
        if fly_to_stop_phase() {
            recall();
            if tally.step >= shape.steps {
                begin_period();
            } else {
                compare_mirror();
            }
            remember();
        }
    }
    if tally.stage == STAGE_READ {
        recall();
        judge_cycle();
        remember();
    }
    keep_tangent();
    put_down();
}
