// Decides whether motion without a period is quasi-periodic: weighted averages of the strobes over two successive windows must agree. The
// reference uses the same rule (dynamics/src/orbit/regularity.rs).

// Adds the strobe that was stored last to the averages. The first pair of windows ends before the budget, and the next pair before the
// budget of undecided lanes. The periods that are left may be used by Newton's method.
fn add_to_averages() {
    let length = search.average_length;
    if length == 0u || (has_averages() && tally.period > settings.periods) {
        let budget = select(settings.longest, settings.periods, tally.period < settings.periods);
        if 4u * tally.period >= settings.periods && budget >= tally.period + 4u * LEAST_WINDOW_STROBES {
            search.average_length = (budget - tally.period) / 16u * 7u;
            search.average_start = search.strobe_count;
            search.recurrence = 255u;
            motions[lane].averages = array<Real, COORDINATES + 1>();
            motions[lane].average_centre = strobe_state();
        }
        return;
    }
    let n = search.strobe_count - search.average_start - 1u;
    if n >= 2u * length {
        return;
    }
    let t = (Real(n % length) + 0.5) / Real(length);
    let square = (t * (1.0 - t)) * (t * (1.0 - t));
    // The weight function has the integral 1/630 from 0 to 1. Strobes of the second window have negative weights.
    let weight = select(Real(-630.0), Real(630.0), n < length) / Real(length) * square * square;
    let u = difference(strobe_state(), motions[lane].average_centre);
    var squares: Real = 0.0;
    //% for k in 0..COORDINATES
    motions[lane].averages[$k] += weight * u[2 * $k];
    squares += u[2 * $k] * u[2 * $k];
    //% end
    motions[lane].averages[COORDINATES] += weight * squares;
}

// Whether both windows are complete.
fn has_averages() -> bool {
    return search.average_length > 0u && search.strobe_count >= search.average_start + 2u * search.average_length;
}

// Stores the distance within which the motion recurs. Each window has a distance from the anchor to its nearest strobe, and the largest of
// these distances is stored.
fn keep_recurrence() {
    if 2u * search.known_lags < settings.max_period {
        return;
    }
    var nearest = 0u;
    for (var lag = 1u; lag <= search.known_lags; lag++) {
        iterations += 1u;
        nearest = max(nearest, last_distance_at(lag));
    }
    search.recurrence = min(search.recurrence, nearest);
}

// Whether the exponent is zero, as in neutral motion, and the section is regular.
fn is_quasi_periodic() -> bool {
    if !EXPONENT || search.blocks < 2u || !has_averages() {
        return false;
    }
    var farthest = 255u;
    for (var lag = 1u; lag <= search.known_lags; lag++) {
        iterations += 1u;
        farthest = min(farthest, last_distance_at(lag));
    }
    let d = motions[lane].averages;
    let unit = 1.0 / unit_of_positions();
    let size = distance_of(farthest);
    var difference = abs(d[COORDINATES]) * unit * unit / size;
    //% for k in 0..COORDINATES
    difference = max(difference, abs(d[$k]) * unit);
    //% end
    let nearest = distance_of(search.recurrence);
    let allowed = LARGEST_DIFFERENCE * nearest;
    let rounding = ROUNDING_OF_AVERAGES * ULP;
    let growth = mean_growth();
    return nearest > LEAST_RECURRENCE * size && allowed > rounding && difference < allowed + rounding
        && growth.x >= -CHAOS_ERRORS * growth.y - 64.0 * ULP && !exceeds_neutral(abs(growth.x));
}

fn distance_of(octaves: u32) -> Real {
    return Real(exp2(-f32(octaves) / PARTS_PER_OCTAVE));
}
