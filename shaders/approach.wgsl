// Does motion near a cycle move as its monodromy matrix says?
//
// A cycle that attracts need not attract the motion: between them there may be a graze, a fold of
// the strobe map, an impact that turns into meshing. But where the last deviations from the cycle
// follow one another as the matrix says, and those to come are smaller than they were, the motion
// has seen all of the map that it will see.

// Strobes on a trail, a cycle apart each; the one at which the cycle was first read follows.
const TRAIL: u32 = 4u;
// Departures from the linear map, as a share of the deviation, that are still small.
const LINEAR: Real = 0.03;
// And of the map as it is beside the cycle.
const LOOSE: Real = 0.3;
// Cycles ahead whose deviations must be smaller than those: what is not normal in the matrix may
// grow before it shrinks.
const CYCLES_AHEAD: u32 = 64u;
// A cycle may lie this far from a motion that is followed on a trail, relative to it.
const FAR_REACH: f32 = 3e-2;
// Newton's method is not asked from afar again after it has led nowhere so often.
const STRAYED: u32 = 1u;

// Notes a strobe if it lies one candidate cycle after the last. All cycles of a trail have the
// same number of events.
fn follow(q: array<Real, 4>) {
    if !EXPONENT || settings.early_stop == 0u {
        return;
    }
    let pitch = max(tally.candidate, 1u);
    if pitch != tallies[lane].trail_pitch || tallies[lane].trail_length == 0u {
        tallies[lane].trail_pitch = pitch;
        tallies[lane].trail_length = 0u;
    } else if tally.period - tallies[lane].trail_at < pitch {
        return;
    }
    let events = tally.events - tallies[lane].trail_events;
    let length = tallies[lane].trail_length;
    let branches = length > 1u && events != tallies[lane].trail_each;
    tallies[lane].trail_length = select(min(length, 2u * TRAIL), 1u, branches) + 1u;
    tallies[lane].trail_each = events;
    tallies[lane].trail_at = tally.period;
    tallies[lane].trail_events = tally.events;
    for (var k = 0u; k < 12u; k++) {
        motions[lane].trail[k] = motions[lane].trail[k + 4u];
    }
    for (var k = 0u; k < 4u; k++) {
        motions[lane].trail[12u + k] = q[k];
    }
}

// Whether there is a trail with cycles of so many periods, to the present strobe.
fn has_trail(period: u32) -> bool {
    return tallies[lane].trail_pitch == period && tallies[lane].trail_length >= TRAIL && tallies[lane].trail_at == tally.period;
}

// Strobes this far apart may lie as near to a cycle as it has to be, on either side of it.
const LOOK: u32 = 16u;
const FIRST_LOOK: u32 = 5u;

// At the end of a window, before a tangent vector is carried: whether to read the strobe map along a
// period that may be a cycle's.
fn looks() -> bool {
    if !EXPONENT || tally.candidate > 1u || tally.tangent_count > 0u || tally.period < FIRST_LOOK
        || tally.tries > 0u || tallies[lane].strayed >= STRAYED || !has_trail(1u) {
        return false;
    }
    let t = motions[lane].trail;
    let step = distance_between(array<Real, 4>(t[8], t[9], t[10], t[11]), array<Real, 4>(t[12], t[13], t[14], t[15]));
    if octaves(step) < LOOK {
        return false;
    }
    tally.candidate = 1u;
    tallies[lane].is_far = 1u;
    return true;
}

// Whether the strobe map has a cycle at `to`, as it says that has been read, and the motion has come to it on
// such a map; once Newton's method has ended, whether the lane is there, too.
fn sees_cycle(to: array<Real, 4>) -> bool {
    let first = tally.refinements == 0u;
    let is_there = first || distance_between(to, strobe_state()) < Real(ON_CYCLE);
    return is_there && distance_between(to, first_read()) < Real(FAR_REACH)
        && is_approached(to, select(LINEAR, LOOSE, first));
}

// The strobe at which the cycle was first read.
fn first_read() -> array<Real, 4> {
    if tally.refinements == 0u {
        return strobe_state();
    }
    return motion.home;
}

// There is none: the window goes on as if it had not been read.
fn look_on() {
    let apart = tally.apart;
    tally.stage = STAGE_RUNNING;
    tally.has_read = 0u;
    tallies[lane].is_far = 0u;
    begin_counting();
    forget_growth();
    if tally.candidate == 1u {
        tallies[lane].distances[0] = apart;
    } else {
        begin_window(strobe_state(), tally.window);
    }
    if tally.streak == 0u {
        tally.candidate = 0u;
    }
    follow(strobe_state());
}

// Whether the motion has moved along the trail to where the cycle was first read, and will move on, as the
// matrix of the cycle that has been read last says.
fn is_approached(cycle: array<Real, 4>, linear: Real) -> bool {
    if tallies[lane].trail_pitch != tally.candidate || tallies[lane].trail_each != tally.events {
        return false;
    }
    var before = deviation(0u, cycle);
    var size = size_of(before);
    var largest = size;
    for (var n = 1u; n <= TRAIL; n++) {
        trips += 1u;
        let after = deviation(n, cycle);
        let foretold = next_deviation(before);
        if !(distance_between(after, foretold) <= linear * size) {
            return false;
        }
        largest = max(largest, size);
        before = after;
        size = size_of(before);
    }
    for (var n = 0u; n < CYCLES_AHEAD; n++) {
        trips += 1u;
        before = next_deviation(before);
        if !(size_of(before) <= largest) {
            return false;
        }
    }
    return true;
}

// The `n`-th strobe of the trail, seen from the cycle; beyond its end that of the first reading.
fn deviation(n: u32, cycle: array<Real, 4>) -> array<Real, 4> {
    var q = first_read();
    if n < TRAIL {
        let k = 4u * n;
        q = array<Real, 4>(motions[lane].trail[k], motions[lane].trail[k + 1u], motions[lane].trail[k + 2u], motions[lane].trail[k + 3u]);
    }
    return array<Real, 4>(q[0] - cycle[0], q[1] - cycle[1], q[2] - cycle[2], q[3] - cycle[3]);
}

// `M u`, with the monodromy matrix that has been read.
fn next_deviation(u: array<Real, 4>) -> array<Real, 4> {
    var v: array<Real, 4>;
    for (var i = 0u; i < 4u; i++) {
        v[i] = (motions[lane].tangents[i] * u[0] + motions[lane].tangents[i + 4u] * u[1])
            + (motions[lane].tangents[i + 8u] * u[2] + motions[lane].tangents[i + 12u] * u[3]);
    }
    return v;
}

fn size_of(u: array<Real, 4>) -> Real {
    return distance_between(u, array<Real, 4>(0.0, 0.0, 0.0, 0.0));
}
