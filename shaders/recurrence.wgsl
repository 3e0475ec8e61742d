// Recurrence: checks whether the lane returns to earlier strobe states, and comes nearer each time.

// A lane has settled once its limit is estimated to lie within 2^-14 of the motion. Weak chaos comes within 2^-12 of
// a cycle by chance.
const SETTLED: f32 = 56.0;
// Newton's method may search the limit once its distance is below 2^-4 of the motion. `LONGEST_NEWTON_STEP` limits the step.
const REFINABLE: f32 = 16.0;
// Least approach per period in `is_refinable`. A slower motion is treated as if it approached at this rate.
const SLOWEST: f32 = 0.008;
// Recurrences within 2^-12 of the motion need not shrink, but must not grow.
const SLOW: u32 = 48u;
// Least shrinkage since the last window, in quarter octaves: a factor of 0.7.
const SHRUNK: u32 = 2u;
// Number of windows over which a candidate must have contracted.
const STREAK: u32 = 2u;
// Smallest number of lags of a window.
const LEAST_WINDOW: u32 = 2u;
// Number of contracting cycles after which a window ends, even if it could be longer.
const LAGS_PER_CYCLE: u32 = 4u;

// Checks a strobe. Returns true once a period is confirmed.
fn recurs() -> bool {
    let q = strobe_state();
    widen_scales(q);
    var lags = widest();
    var settled = false;
    if search.window > 0u {
        let lag = tally.period - search.anchor_period;
        let distance = octaves(distance_between(q, measures.anchor));
        let place = (lag - 1u) / 4u;
        let before = (lag - 1u) % 4u;
        // The first distance of a number replaces those of an earlier window.
        tallies[lane].distances[place] = select(tallies[lane].distances[place], 0u, before == 0u) | (distance << (8u * before));
        if lag < search.window {
            return false;
        }
        let found = contracting_lag();
        let is_fast = found > 0u && shrinks(found);
        settled = judge_lag(found);
        search.known_lags = search.window;
        tallies[lane].last_distances = tallies[lane].distances;
        keep_recurrence();
        // The next anchor lies at the same point of the cycle, because distances at other points are not comparable. The points of a cycle
        // may be so close together that a lag shorter than its period seems to recur.
        let cycle = max(closest_lag(), 1u);
        // Short windows suffice to find a short lag that contracts.
        let enough = max(LAGS_PER_CYCLE * cycle, LEAST_WINDOW);
        lags = select(lags, min(enough, lags), is_fast && search.failed_readings == 0u);
        lags = max(lags - lags % cycle, 1u);
    }
    begin_window(q, lags);
    return settled;
}

// Raises the units of distances to the largest strobe.
fn widen_scales(q: State) {
    measures.position_scale = max(measures.position_scale, largest_position(q));
    measures.rate_scale = max(measures.rate_scale, largest_rate(q));
}

// Lowers the units of distances when a cycle is read, so that earlier motion does not count. A strobe may lie at a turning point, where
// rates vanish, or midway between two, where the displacement vanishes.
fn narrow_scales(q: State) {
    let angle = unit_of_frequency();
    let position = largest_position(q);
    let rate = largest_rate(q);
    measures.position_scale = min(measures.position_scale, max(position, rate / angle));
    measures.rate_scale = min(measures.rate_scale, max(rate, angle * position));
}

fn largest_displacement(q: State) -> Real {
    var size: Real = 0.0;
    //% for k in 0..COORDINATES
    size = max(size, abs(q[2u * $ku]));
    //% end
    return size;
}

fn largest_rate(q: State) -> Real {
    var size: Real = 0.0;
    //% for k in 0..COORDINATES
    size = max(size, abs(q[2u * $ku + 1u]));
    //% end
    return size;
}

fn widest() -> u32 {
    return clamp(tally.period / WINDOW_SHARE, LEAST_WINDOW, settings.max_period);
}

// Returns the lag that recurs best. A longer lag must be better by a factor of four.
fn closest_lag() -> u32 {
    return closest_of(search.known_lags);
}

fn closest_of(lags: u32) -> u32 {
    var best = 0u;
    var distance = RECURRENCE_LIMIT;
    for (var lag = 1u; lag <= lags; lag++) {
        iterations += 1u;
        if distance_at(lag) >= distance {
            best = lag;
            distance = distance_at(lag) + 8u;
        }
    }
    return best;
}

// Returns the distance of two strobe states, relative to the motion. The unit of rates has a lower bound, because rates at a turning point
// are rounding errors.
fn distance_between(a: State, b: State) -> Real {
    let d = difference(a, b);
    return max(largest_displacement(d) / unit_of_positions(), largest_rate(d) / unit_of_rates());
}

// Returns the unit of positions: the size of the motion. With stages it is at least the scale of length. Motion that decays to rest would
// otherwise never come near to rest, because its size decays with it. Without stages such motion is recognised by its energy
// (is_non_impacting).
fn unit_of_positions() -> Real {
    var least: Real = 1e-30;
    if has_stages() {
        least = scale_of_length();
    }
    return max(measures.position_scale, least);
}

fn unit_of_rates() -> Real {
    let least = unit_of_frequency() * unit_of_positions();
    return max(max(measures.rate_scale, least), Real(1e-30));
}

fn begin_window(q: State, lags: u32) {
    measures.anchor = q;
    search.anchor_period = tally.period;
    search.window = min(lags, settings.max_period);
}

// Returns a distance in quarter octaves below 1, at most 255.
fn octaves(distance: Real) -> u32 {
    let d = f32(distance);
    if d <= 1e-19 {
        return 255u;
    }
    return u32(clamp(-PARTS_PER_OCTAVE * log2(d), 0.0, 255.0));
}

fn distance_at(lag: u32) -> u32 {
    return (tallies[lane].distances[(lag - 1u) / 4u] >> (8u * ((lag - 1u) % 4u))) & 255u;
}

fn last_distance_at(lag: u32) -> u32 {
    return (tallies[lane].last_distances[(lag - 1u) / 4u] >> (8u * ((lag - 1u) % 4u))) & 255u;
}

// Returns the smallest lag that recurs at all its multiples, and whose distance contracts or has reached rounding; 0 without such a lag.
// Decaying spirals come close at longer lags first, but their lag 1 shrinks as well.
fn contracting_lag() -> u32 {
    // If points of a cycle are close together, their distances neither shrink nor grow. A longer lag then recurs better.
    let best = closest_of(search.window);
    for (var lag = 1u; lag <= min(search.window, search.known_lags); lag++) {
        iterations += 1u;
        let now = distance_at(lag);
        let before = last_distance_at(lag);
        let contracts = shrinks(lag) || (now >= SLOW && now >= before && lag == best);
        if now < RECURRENCE_LIMIT || !contracts {
            continue;
        }
        var recurs_always = true;
        for (var multiple = 2u * lag; multiple <= search.window; multiple += lag) {
            iterations += 1u;
            recurs_always = recurs_always && distance_at(multiple) >= RECURRENCE_LIMIT;
        }
        if recurs_always {
            return lag;
        }
    }
    return 0u;
}

// Whether the distance at a lag has shrunk since the last window, or is a rounding error.
fn shrinks(lag: u32) -> bool {
    let now = distance_at(lag);
    return now >= WITHIN_ROUNDING || now >= last_distance_at(lag) + SHRUNK;
}

// Whether the limit of the strobes is near enough. If the distance `d` between strobes shrinks by the factor `mu` per period, the limit is
// `d / (1 - mu)` away. So strobes that approach slowly must be closer together.
fn has_settled(lag: u32) -> bool {
    let now = distance_at(lag);
    let shrunk = f32(now) - f32(last_distance_at(lag));
    if now >= WITHIN_ROUNDING {
        return true;
    }
    // 1 - mu, from the change of the distance since the last anchor, `known_lags` periods ago.
    let away = clamp(shrunk * QUARTER_OCTAVE / f32(search.known_lags), 1e-6, 1.0);
    return f32(now) >= SETTLED - PARTS_PER_OCTAVE * log2(away);
}

// Whether Newton's method may search the limit.
fn is_refinable(lag: u32) -> bool {
    if !EXPONENT || settings.early_stop == 0u || search.failed_searches >= MOST_FAILED_SEARCHES {
        return false;
    }
    let now = f32(distance_at(lag));
    let shrunk = now - f32(last_distance_at(lag));
    let away = clamp(shrunk * QUARTER_OCTAVE / f32(search.known_lags), SLOWEST, 1.0);
    return now >= REFINABLE - PARTS_PER_OCTAVE * log2(away) && repeats_itself(lag);
}

// Natural logarithm of a quarter octave.
const QUARTER_OCTAVE: f32 = 0.1733;

// Updates the candidate. Returns true once it has settled.
fn judge_lag(found: u32) -> bool {
    search.is_settled = 0u;
    if found == 0u {
        tally.candidate = 0u;
        search.streak = 0u;
        return false;
    }
    search.streak = select(1u, search.streak + 1u, found == tally.candidate);
    tally.candidate = found;
    // Strobes of weak chaos may contract by chance, and more checks find more such cases. So each failed reading raises the number of
    // windows that must contract by one.
    let windows = STREAK + search.failed_readings + select(0u, 2u, grows(CHAOS_ERRORS));
    let has_contracted = search.streak >= windows;
    search.is_settled = select(0u, 1u, has_contracted && has_settled(found));
    return has_contracted && (search.is_settled != 0u || is_refinable(found));
}

// Compares the cycle's start with the mirror image of the present state. The lane is half-way through a cycle of odd period.
fn compare_mirror() {
    search.mirror = octaves(distance_between(strobe_state(), difference(State(), measures.anchor)));
}
