// Decides whether motion is chaotic: the tangent vector certainly grows, and an escape from a cycle does not explain the growth.

// Smallest number of averaged periods after which a lane may stop as chaotic.
const LEAST_COUNTED: u32 = 32u;

// A lane that has not settled on its cycle is doubted if growth exceeds zero by this number of standard errors.
const DOUBT: Real = 1.0;

// Whether growth is certain and no recurrence contracts. Checked when a block is complete, and at the end of the budget.
fn is_chaos() -> bool {
    let is_last = tally.period >= last_period();
    if (search.block_periods > 0u && !is_last) || search.blocks < FEWEST_BLOCKS || search.streak >= STREAK || tally.period < settings.chaos_from {
        return false;
    }
    // A cycle that was read without success has interrupted the averages.
    if tally.period < search.counting_start + LEAST_COUNTED && tally.period < settings.periods {
        return false;
    }
    if tally.period < settings.periods && nears_rest() {
        return false;
    }
    return is_chaotic(select(Real(settings.chaos_errors), CHAOS_ERRORS, tally.period >= settings.periods));
}

// Whether the motion may soon rest on a wall and forget its past, which ends chaos: in a rare period it has a long series of impacts.
fn nears_rest() -> bool {
    let most = Real(search.most_events);
    let is_series = most >= LEAST_SERIES && most * Real(tally.period) > RARE_SERIES * Real(search.all_events);
    return is_series && tally.impacts > 0u && shapes[cell.flow_index].degrees == 1u;
}

fn is_chaotic(errors: Real) -> bool {
    return grows(errors) && outgrows(errors) && !escapes(errors);
}

// Whether the exponent exceeds zero by a number of standard errors.
fn grows(errors: Real) -> bool {
    if !EXPONENT || search.blocks < 2u {
        return false;
    }
    let growth = mean_growth();
    return growth.x > errors * growth.y;
}

// Whether growth exceeds that of neutral motion and of rounding. Tangents of a free body, a torus or an undamped oscillation grow in
// proportion to time; at a double root they grow with its square. Rounding can replace the zero in a shear `1 s; 0 1` by ULP, which gives a
// growth of sqrt(s ULP). One event has an s of at most 1. Without events the motion is linear, and growth by negative damping is not chaos.
fn outgrows(errors: Real) -> bool {
    let growth = mean_growth();
    return tally.events > 0u && !is_growing(growth.x) && exceeds_neutral(growth.x - errors * growth.y);
}

// Returns the number of periods of the first part of the motion. Later displacements and rates are compared with those of this part.
fn early_periods() -> u32 {
    return max(settings.transient_periods, settings.periods / 2u);
}

// Whether negative damping or stiffness makes the motion itself grow, at a certain share of its tangents' growth per period. Also true if
// the motion is too short to know.
fn is_growing(growth: Real) -> bool {
    if escape_size() < 0.0 {
        return false;
    }
    let expected = SHARED_GROWTH * growth * (Real(tally.period) - Real(early_periods()));
    // Between two walls only the rates can grow.
    let growth_of_scales = max(measures.position_scale / measures.early_scale, measures.rate_scale / measures.early_rate_scale);
    return expected < PLAIN_GROWTH || log(f32(growth_of_scales)) > f32(expected);
}

fn exceeds_neutral(growth: Real) -> bool {
    let periods = search.blocks * settings.exponent_block;
    let began = max(settings.exponent_from, 1u);
    let neutral = NEUTRAL_ORDER * log(f32(began + periods) / f32(began));
    let events_per_period = Real(tally.events) / Real(max(tally.period - search.counting_start, 1u));
    let rounding = sqrt(events_per_period * events_per_period * ULP);
    return (growth - rounding) * Real(periods) > Real(neutral);
}

// Whether the motion stays near a cycle, so that its tangents may grow because it leaves the cycle.
fn escapes(errors: Real) -> bool {
    // A lane that has just been moved off a cycle was near a saddle. Motion can recur by chance at one lag, but not at all multiples of the
    // lag.
    var is_near_saddle = search.known_lags == 0u;
    var rests = false;
    for (var lag = 1u; 2u * lag <= search.known_lags && !rests; lag++) {
        var nearest = 255u;
        for (var multiple = lag; multiple <= search.known_lags && nearest >= RECURRENCE_LIMIT; multiple += lag) {
            iterations += 1u;
            nearest = min(nearest, last_distance_at(multiple));
        }
        is_near_saddle = is_near_saddle || nearest >= RECURRENCE_LIMIT;
        rests = nearest >= WITHIN_ROUNDING;
    }
    // Rounding can hold a motion on an unstable cycle. Its growth is then not chaos.
    if rests {
        return true;
    }
    let growth = mean_growth();
    let periods = Real(search.blocks * settings.exponent_block);
    return is_near_saddle && (growth.x - errors * growth.y) * periods < ESCAPE_GROWTH;
}
