// Whether motion without a period is quasi-periodic, by the rule of the reference (dynamics/src/orbit/regularity.rs):
// weighted averages of the strobes over two successive windows agree.

// Adds the strobe that was stored last to the averages. The first windows end before the budget does, the next ones
// before that of undecided lanes. Newton's method may use up the periods that are left over.
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
    // The integral of the window from 0 to 1 is 1/630. The second window counts as negative.
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

// Keeps the distance within which the motion recurs: the largest, over the windows, of the distance to the anchor's
// nearest strobe.
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

// Whether the exponent is that of neutral motion and the section is regular.
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
