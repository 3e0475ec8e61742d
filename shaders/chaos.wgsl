// Chaos: growth of the tangent vector that is sure, and no escape from a cycle.

// Periods over which averages are taken, at least, before chaos is called early.
const LEAST_COUNTED: u32 = 32u;

// Standard errors that cast doubt on a cycle that has not settled.
const DOUBT: Real = 1.0;

// Growth that is sure, and no recurrence that contracts. Checked when a block is complete.
fn is_chaos() -> bool {
    if noted.block_periods > 0u || noted.blocks < FEWEST_BLOCKS || noted.streak >= STREAK || tally.period < settings.chaos_from {
        return false;
    }
    // Averages that a cycle read without success has interrupted begin anew.
    if tally.period < noted.counted_from + LEAST_COUNTED && tally.period < settings.periods {
        return false;
    }
    let errors = select(Real(settings.chaos_errors), CHAOS_ERRORS, tally.period >= settings.periods);
    return grows(errors) && outgrows(errors) && !escapes(errors);
}

// Whether the exponent exceeds zero by so many standard errors.
fn grows(errors: Real) -> bool {
    if !EXPONENT || noted.blocks < 2u {
        return false;
    }
    let growth = mean_growth();
    return growth.x > errors * growth.y;
}

// Neutral motion grows, too: tangents of a free body, of a torus or of an undamped swing in
// proportion to time, at a double root to its square. Chaos has to outgrow that, and what rounding makes
// of it: a shear `1 s; d 1` with d = ULP where there should be none grows by sqrt(s ULP), s of one
// event being 1 at most.
fn outgrows(errors: Real) -> bool {
    let growth = mean_growth();
    let periods = noted.blocks * settings.exponent_block;
    let began = max(settings.exponent_from, 1u);
    let neutral = NEUTRAL_ORDER * log(f32(began + periods) / f32(began));
    let events_per_period = Real(tally.events) / Real(max(tally.period - noted.counted_from, 1u));
    let rounding = sqrt(events_per_period * events_per_period * ULP);
    return (growth.x - errors * growth.y - rounding) * Real(periods) > Real(neutral);
}

// Whether the motion stays near some cycle and its growth may be that of leaving it.
fn escapes(errors: Real) -> bool {
    // A lane that has just been sent was near a saddle. A single lag comes near by chance, its
    // multiples with it do not.
    var is_near_saddle = noted.known_lags == 0u;
    var rests = false;
    for (var lag = 1u; 2u * lag <= noted.known_lags && !rests; lag++) {
        var nearest = 255u;
        for (var multiple = lag; multiple <= noted.known_lags && nearest >= NEAR; multiple += lag) {
            iterations += 1u;
            nearest = min(nearest, last_distance_at(multiple));
        }
        is_near_saddle = is_near_saddle || nearest >= NEAR;
        rests = nearest >= RESOLVED;
    }
    // What rests at a cycle is held there by rounding: its growth is no chaos.
    if rests {
        return true;
    }
    let growth = mean_growth();
    let periods = Real(noted.blocks * settings.exponent_block);
    return is_near_saddle && (growth.x - errors * growth.y) * periods < ESCAPE_GROWTH;
}
