// Decides from the last strobes whether motion near a cycle ends on it. The reference uses the same rule (dynamics/src/orbit/approach.rs).
//
// Only the strobes of the motion itself count, because a stable cycle need not be the motion's limit. The rule requires that the motion has
// the events of the cycle, and that the monodromy matrix maps each deviation from the cycle to the next one. Then a deviation within the
// convex hull of earlier deviations stays in the part of the branch that the motion has visited.

// Distance from the cycle, relative to the motion, within which the error of the linear map may be as large as the deviation. Farther away
// it may be at most the share LINEAR of the deviation.
const BENT_WITHIN: Real = 5e-4;
// How far outside the hull a deviation may lie: as a share of itself, or relative to the motion.
const OUTSIDE_OF_DEVIATION: Real = 0.1;
const OUTSIDE_OF_MOTION: Real = 1e-4;
// Largest number of steps towards the nearest point of a hull.
const HULL_STEPS: u32 = 32u;

// Stores a strobe of the motion, and the events of the period before it.
fn store_strobe(itinerary: u32) {
    search.strobe_count += 1u;
    let place = search.strobe_count % TRAIL;
    motions[lane].trail[place] = strobe_state();
    tallies[lane].itineraries[place] = itinerary;
    add_to_averages();
}

fn trail(strobe: u32) -> State {
    return motions[lane].trail[strobe % TRAIL];
}

// Returns the number of cycles of the candidate's period that the trail holds.
fn cycles_on_trail() -> u32 {
    return (min(search.strobe_count, TRAIL) - 1u) / tally.candidate;
}

// Called after period `read` of the cycle has been read. Updates how many of the motion's last cycles have the same events.
fn compare_itineraries(itinerary: u32, read: u32) {
    let is_own = search.newton_steps == 0u;
    // A cycle that is read along the motion is the motion's last cycle.
    let most = min(search.matching_cycles, cycles_on_trail());
    var cycles = select(0u, 1u, is_own);
    while cycles < most {
        iterations += 1u;
        let back = (cycles + 1u) * tally.candidate;
        let strobe = select(search.strobe_count - back + read, search.strobe_count - back + tally.candidate, is_own);
        if tallies[lane].itineraries[strobe % TRAIL] != itinerary {
            break;
        }
        cycles += 1u;
    }
    search.matching_cycles = min(search.matching_cycles, cycles);
}

// Returns the cycles of a period that the motion must have completed.
fn required_cycles(period: u32) -> u32 {
    return min(REQUIRED_CYCLES, (TRAIL - 1u) / period);
}

// Whether the same events have recurred in all required cycles except the one that is still to be read.
fn repeats_itself(period: u32) -> bool {
    if !EXPONENT {
        return true;
    }
    let compared = period * (max(required_cycles(period), 2u) - 2u);
    for (var n = 0u; n < compared; n++) {
        iterations += 1u;
        let strobe = search.strobe_count - n;
        if strobe < period + 1u || tallies[lane].itineraries[strobe % TRAIL] != tallies[lane].itineraries[(strobe - period) % TRAIL] {
            return false;
        }
    }
    return true;
}

// Whether the motion stays near the cycle that has been read. The motion's present state is the last one of the trail.
fn stays_near_cycle(to: State) -> bool {
    let present = difference(trail(search.strobe_count), to);
    let bend = select(LINEAR, Real(1.0), size_of(present) < BENT_WITHIN);
    let blurred = Real(noise());
    let most = min(search.matching_cycles, cycles_on_trail());
    var after = present;
    var cycles = 0u;
    while cycles < most {
        iterations += 1u;
        let before = difference(trail(search.strobe_count - (cycles + 1u) * tally.candidate), to);
        if size_of(difference(after, image_of(before))) > bend * size_of(before) + blurred {
            break;
        }
        after = before;
        cycles += 1u;
    }
    return cycles >= required_cycles(tally.candidate) && is_in_hull(present, cycles, to);
}

// Whether a deviation lies in the convex hull of the origin and the earlier deviations, within a tolerance.
//
// E. G. Gilbert, SIAM J. Control 4 (1966) 61: each step leads from the nearest point found so far towards the corner that is farthest in
// the direction from this point to the deviation. That corner also gives a lower bound of the distance.
fn is_in_hull(point: State, corners: u32, to: State) -> bool {
    let target_point = in_units(point);
    let allowed = max(OUTSIDE_OF_DEVIATION * sqrt(inner(target_point, target_point)), OUTSIDE_OF_MOTION);
    if corners > 0u && distance_from_last(target_point, to) <= allowed {
        return true;
    }
    var nearest = difference(State(), target_point);
    for (var n = 0u; n < HULL_STEPS; n++) {
        let square = inner(nearest, nearest);
        if square <= allowed * allowed {
            return true;
        }
        var farthest = difference(State(), target_point);
        for (var back = 1u; back <= corners; back++) {
            iterations += 1u;
            let corner = difference(in_units(difference(trail(search.strobe_count - back * tally.candidate), to)), target_point);
            if inner(corner, nearest) < inner(farthest, nearest) {
                farthest = corner;
            }
        }
        let step = difference(farthest, nearest);
        let gain = -inner(nearest, step);
        if inner(farthest, nearest) > allowed * sqrt(square) || gain <= ULP * square {
            return false;
        }
        let share = min(gain / inner(step, step), Real(1.0));
        //% for k in 0..DIM
        nearest[$ku] += step[$ku] * share;
        //% end
    }
    return false;
}

// Returns the distance from the previous deviation. In slow motion this distance decides at once, where the search would need many short
// steps.
fn distance_from_last(point: State, to: State) -> Real {
    let off = difference(in_units(difference(trail(search.strobe_count - tally.candidate), to)), point);
    return sqrt(inner(off, off));
}

// Returns a deviation in units of the motion.
fn in_units(u: State) -> State {
    let rate = unit_of_rates();
    let position = unit_of_positions();
    var scaled: State;
    //% for k in 0..COORDINATES
    scaled[2u * $ku] = u[2u * $ku] / position;
    scaled[2u * $ku + 1u] = u[2u * $ku + 1u] / rate;
    //% end
    return scaled;
}

fn inner(a: State, b: State) -> Real {
    var sum = a[0u] * b[0u] + a[1u] * b[1u];
    //% for k in 1..COORDINATES
    sum += a[2u * $ku] * b[2u * $ku] + a[2u * $ku + 1u] * b[2u * $ku + 1u];
    //% end
    return sum;
}
