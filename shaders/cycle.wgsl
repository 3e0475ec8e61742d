// Judges the cycle that was read: whether it is stable, and whether the lane has come near it.

// Size of the perturbation that moves a lane off an unstable cycle, in units of the distance below which a lane counts as at rest.
const PERTURBATION: f32 = 8.0;

// Returns the binary logarithm of a number between about 1e-30 and 1e30, to the precision of its type. WGSL has no logarithm for f64. `ln m
// = 2 artanh((m - 1) / (m + 1))`, with m within a factor of sqrt 2 of 1.
fn octaves_of(x: Real) -> Real {
    let whole = round(log2(f32(x)));
    let m = x * Real(ldexp(1.0, -i32(whole)));
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let series = 1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * (1.0 / 11.0
        + q * (1.0 / 13.0 + q * (1.0 / 15.0 + q * (1.0 / 17.0 + q * (1.0 / 19.0 + q * (1.0 / 21.0))))))))));
    return Real(whole) + (2.0 / LN_2) * s * series;
}

// Growth in octaves that stands for a multiplier of zero: all neighbouring motions have become the same motion. This happens with one
// displacement whose gap has stuck to a wall.
const SUPERSTABLE_GROWTH: Real = -1e9;

fn largest_entry(m: Matrix) -> Real {
    var size: Real = 0.0;
    for (var k = 0u; k < MATRIX; k++) {
        size = max(size, abs(m[k]));
    }
    return size;
}

// Returns a matrix with the eigenvalues of `m / size`, by one step of the QR iteration with rotations. Entries of `m` that are larger than
// its eigenvalues move above the diagonal. Squares of `m` itself would lose the eigenvalues: for a matrix with an entry of 46 and a radius
// of 0.15, the radius in f32 was wrong by a fifth.
fn nearly_triangular(m: Matrix, inverse: Real) -> Matrix {
    var r = m;
    for (var k = 0u; k < MATRIX; k++) {
        r[k] *= inverse;
    }
    var turns: array<vec2<Real>, MATRIX>;
    for (var j = 0u; j < DIM - 1u; j++) {
        for (var i = j + 1u; i < DIM; i++) {
            let a = r[DIM * j + j];
            let b = r[DIM * j + i];
            let size = sqrt(a * a + b * b);
            let turn = select(vec2<Real>(1.0, 0.0), vec2<Real>(a, b) / max(size, Real(1e-30)), size > 1e-30);
            for (var k = 0u; k < DIM; k++) {
                let upper = r[DIM * k + j];
                let lower = r[DIM * k + i];
                r[DIM * k + j] = turn.x * upper + turn.y * lower;
                r[DIM * k + i] = turn.x * lower - turn.y * upper;
            }
            turns[DIM * j + i] = turn;
        }
    }
    for (var j = 0u; j < DIM - 1u; j++) {
        for (var i = j + 1u; i < DIM; i++) {
            let turn = turns[DIM * j + i];
            for (var k = 0u; k < DIM; k++) {
                let left = r[DIM * j + k];
                let right = r[DIM * i + k];
                r[DIM * j + k] = turn.x * left + turn.y * right;
                r[DIM * i + k] = turn.x * right - turn.y * left;
            }
        }
    }
    return r;
}

// Returns the modulus of the largest root of `x^2 - t x + d`, where t is the trace of the matrix and d the sum of the products of two
// eigenvalues. This is the spectral radius if all eigenvalues but two vanish.
fn radius_of_two(m: Matrix) -> Real {
    var trace: Real = 0.0;
    var of_square: Real = 0.0;
    for (var k = 0u; k < MATRIX; k++) {
        of_square += m[k] * m[k % DIM * DIM + k / DIM];
        trace += select(Real(0.0), m[k], k % (DIM + 1u) == 0u);
    }
    let product = 0.5 * (trace * trace - of_square);
    let rest = 0.25 * trace * trace - product;
    return select(sqrt(max(product, Real(0.0))), 0.5 * abs(trace) + sqrt(max(rest, Real(0.0))), rest > 0.0);
}

// Number of squarings before estimates by `radius_of_two` are compared.
const LEAST_SQUARINGS: u32 = 3u;

// Returns the binary logarithm of the spectral radius of the monodromy matrix. Its columns are the tangent vectors, which started as unit
// vectors. Repeated squaring leaves the two largest eigenvalues. They may be a complex pair. `radius_of_two` then gives the radius. Without a
// gap below them, `|M^n|^(1/n)` with `n = 2^SQUARINGS` is the radius up to a factor of `kappa^(1/n)`, where kappa is the condition of the
// eigenvectors.
fn spectral_growth() -> Real {
    var m: Matrix;
    for (var k = 0u; k < MATRIX; k++) {
        m[k] = motions[lane].tangents[k];
    }
    let whole = largest_entry(m);
    if tallies[lane].has_overflowed == 1u || !(whole < OUT_OF_RANGE) {
        // The matrix is too large, or contains NaN.
        return 100.0;
    }
    if tallies[lane].is_superstable == 1u || !(whole > 1e-30) {
        return SUPERSTABLE_GROWTH;
    }
    m = nearly_triangular(m, 1.0 / whole);
    var growth = octaves_of(whole);
    let unresolved = growth + octaves_of(ULP);
    var weight: Real = 1.0;
    var estimate: Real = HUGE;
    var equal = 0u;
    for (var n = 0u; n <= SQUARINGS; n++) {
        let size = largest_entry(m);
        if !(size > 1e-30) {
            return SUPERSTABLE_GROWTH;
        }
        if n >= LEAST_SQUARINGS {
            let next = growth + weight * octaves_of(max(radius_of_two(m), Real(1e-30)));
            equal = select(0u, equal + 1u, abs(next - estimate) <= 16.0 * ULP * (1.0 + abs(next)));
            estimate = next;
            if equal == 2u {
                growth = estimate;
                break;
            }
        }
        growth += weight * octaves_of(size);
        weight *= 0.5;
        let inverse = 1.0 / size;
        var square: Matrix;
        for (var k = 0u; k < MATRIX; k++) {
            let i = k % DIM;
            let j = k - i;
            var sum = m[i] * m[j] + m[i + DIM] * m[j + 1u];
            //% for k in 1..COORDINATES
            sum += m[i + 2u * $ku * DIM] * m[j + 2u * $ku] + m[i + (2u * $ku + 1u) * DIM] * m[j + 2u * $ku + 1u];
            //% end
            square[k] = (inverse * inverse) * sum;
        }
        m = square;
    }
    // A radius below the rounding errors of the matrix counts as zero.
    return select(growth - LARGE_OCTAVES * Real(tallies[lane].column_scalings), SUPERSTABLE_GROWTH, growth < unresolved);
}

// Gives the columns their true size after `spectral_growth`. They were scaled before to keep them in range.
fn restore_columns() {
    for (var n = 0u; n < tallies[lane].column_scalings + tallies[lane].is_superstable; n++) {
        let factor = select(1.0 / LARGE, Real(0.0), tallies[lane].is_superstable == 1u);
        for (var k = 0u; k < MATRIX; k++) {
            motions[lane].tangents[k] *= factor;
        }
    }
}

// Distance of 0.01, in quarter octaves below 1.
const NEAR_RETURN: u32 = 26u;

// Decides what follows when a cycle has been read. Without exponents, recurrence alone decides. The lane continues if it has periods left
// and the cycle is unstable, or its multiplier shows that the lane is still too far from it. Such motion may be chaos, which stays near
// unstable cycles and near places where a pair of cycles has just vanished.
fn judge_cycle() {
    tally.stage = STAGE_DONE;
    if !EXPONENT {
        // The motion returns as closely after the divisor as after the whole cycle, so a multiple of the period has been read.
        if search.divisor > 0u && search.divisor_distance + 8u >= search.return_distance && reads_divisor() {
            return;
        }
        search.cycle = tally.candidate;
        return;
    }
    deflate_columns();
    measures.cycle_growth = spectral_growth();
    measures.cycle_stretch = cycle_stretch();
    restore_columns();
    carry_vector();
    confirm_chaos();
    // The reference continues a lane that hands over, so its last cycle is judged as strictly as others. If the cycle is none, the next
    // period shows whether the motion is chaotic.
    let is_last = tally.period >= last_period() && settings.hands_over == 0u;
    store_branch();
    let to = fixed_point();
    search.linear_distance = octaves(distance_between(strobe_state(), to));
    search.motion_distance = select(octaves(distance_between(trail(search.strobe_count), to)), search.linear_distance, search.newton_steps == 0u);
    compare_growth();
    let is_stable = measures.cycle_growth < -NEUTRAL * Real(tally.candidate);
    search.is_neutral = select(0u, 1u, abs(measures.cycle_growth) <= NEUTRAL * Real(tally.candidate));
    // Motion on a neutral cycle neither approaches nor leaves it, so it must return within rounding.
    let returns = exp2(-f32(search.return_distance) / PARTS_PER_OCTAVE) < max(noise(), NOISE) && tally.grazes == 0u;
    if search.is_neutral == 1u && search.newton_steps == 0u && returns {
        let is_at_divisor = search.divisor > 0u && search.divisor_distance >= AT_REST;
        if is_at_divisor && reads_divisor() {
            return;
        }
        // Motion can approach a cycle slowly, on alternating sides. It then seems to have twice the true period, and nearly returns after
        // half of it.
        if is_at_divisor || search.divisor == 0u || search.divisor_distance < NEAR_RETURN {
            search.cycle = tally.candidate;
            return;
        }
    }
    // Near a graze the strobe map has no derivative that locates the cycle.
    let is_smooth = tally.grazes == 0u || search.newton_steps > 0u;
    // Amplified rounding can move the lane away from the fixed point. Newton's method is then given up, and the lane waits until the motion
    // has approached the cycle by itself.
    let helps = is_smooth && search.failed_searches < MOST_FAILED_SEARCHES;
    if is_stable && helps && settings.early_stop == 1u && !is_last && distance_to_cycle() > NEWTON_CONVERGED && refine(to) {
        return;
    }
    let is_found = is_stable && is_on_branch() && is_on_cycle(to, is_last);
    let is_cycle = is_found && (rests_on_cycle(to, is_last) || stays_near_cycle(to));
    if is_cycle && (!is_multiple() || is_rejected()) {
        search.cycle = tally.candidate;
        return;
    }
    if is_cycle && reads_divisor() {
        return;
    }
    // Newton's method has left the branch of the motion. If the lane returned to its start, it would repeat the same search.
    let is_lost = search.newton_steps > 0u && !is_on_branch();
    let is_approached = is_found && !is_cycle;
    if is_approached {
        // Newton's method has found a cycle.
        search.failed_searches = 0u;
    } else if is_stable && !is_lost && search.newton_steps > 0u {
        search.failed_searches += 1u;
    }
    return_to_start();
    if !is_last {
        search_again(is_approached || (is_stable && !is_lost));
    }
}

// Largest relative error of the exponent of a cycle whose status is ok.
const EXPONENT_ERROR: f32 = 0.02;
// Binary logarithm of the smallest multiplier for which `EXPONENT_ERROR` is checked. Smaller multipliers are below the resolution of f32.
const LEAST_GROWTH: f32 = -7.0;

// Compares the exponent with the exponent of the previous reading, which was at another distance from the cycle. The error is assumed to be
// proportional to the distance.
fn compare_growth() {
    let growth = f32(measures.cycle_growth);
    let now = distance_to_cycle();
    let change = abs(growth - f32(measures.earlier_growth));
    let error = change * now / max(f32(measures.earlier_distance) - now, now);
    let is_known = search.earlier_branch == branch() && growth > LEAST_GROWTH;
    search.is_uncertain = select(0u, 1u, is_known && error > EXPONENT_ERROR * abs(growth));
    search.earlier_branch = branch();
    measures.earlier_growth = measures.cycle_growth;
    measures.earlier_distance = Real(now);
}

// Whether the motion approaches the cycle slowly: its multiplier shows that it does not settle within the budget, or it is too far from the
// cycle for an accurate exponent.
fn is_slow() -> bool {
    if !EXPONENT {
        return !is_near_cycle();
    }
    let left = f32(settings.periods) - f32(search.strobe_count);
    let at_last = -f32(search.motion_distance) / PARTS_PER_OCTAVE + f32(measures.cycle_growth) * left / f32(search.cycle);
    return !is_near_cycle() || search.is_uncertain == 1u || at_last > log2(SETTLED_DISTANCE);
}

// Decides to read the divisor of the period (`begin_reading` follows). Returns false if too few periods are left.
fn reads_divisor() -> bool {
    if tally.period + search.divisor > last_period() {
        return false;
    }
    tally.candidate = search.divisor;
    search.checks_divisor = 1u;
    search.is_settled = 0u;
    tally.stage = STAGE_READING;
    return true;
}

// Searches for recurrences again. The average of the exponent continues. If the cycle is stable but too far away (`continues`), recurrences
// found so far still count.
fn search_again(continues: bool) {
    if continues {
        search.rejected_divisor = 0u;
    } else {
        give_up_cycle();
    }
    tally.stage = STAGE_RUNNING;
    search.has_read = 0u;
    search.checks_divisor = 0u;
    begin_counting();
    if continues {
        begin_window(strobe_state(), search.window);
        return;
    }
    search.window = 0u;
    tally.candidate = 0u;
    search.streak = 0u;
    search.known_lags = 0u;
    search.is_settled = 0u;
}

// Leaves the cycle that was read.
fn give_up_cycle() {
    // Rounding can hold a lane on an unstable cycle, so the lane is moved off it.
    let is_unstable = measures.cycle_growth > NEUTRAL * Real(tally.candidate);
    if is_unstable && search.return_distance >= AT_REST && is_free() {
        motion.q[1] += Real(PERTURBATION * exp2(-f32(AT_REST) / PARTS_PER_OCTAVE)) * measures.rate_scale;
        motion.bound = 0.0;
        search.strobe_count = 0u;
        search.average_length = 0u;
        // The growth so far belongs to the unstable cycle and says nothing about chaos.
        search.blocks = 0u;
        search.block_periods = 0u;
        motion.block_growth = 0.0;
        measures.growth_sum = 0.0;
        measures.growth_squares = 0.0;
    }
    search.failed_readings += 1u;
    // A stable divisor may still be the lane's cycle, even if the lane has not come near to it.
    let is_stable = measures.cycle_growth < -NEUTRAL * Real(tally.candidate);
    search.rejected_divisor = select(0u, tally.candidate, search.checks_divisor == 1u && !is_stable);
}

// Whether the cycle closes after a divisor of its period, within rounding and the lane's distance from the cycle.
fn is_multiple() -> bool {
    let is_closed = search.divisor_distance >= AT_REST || exp2(-f32(search.divisor_distance) / PARTS_PER_OCTAVE) < 4.0 * distance_to_cycle();
    return search.divisor > 0u && is_closed;
}

// The divisor is certainly another cycle if the cycle's points are farther apart than the lane's distance from the cycle by this factor, in
// quarter octaves.
const SEPARATION: u32 = 12u;

// Whether the divisor has been rejected: it was read, was unstable, and is certainly another cycle, read at another place. A lane can
// approach the divisor's own cycle on alternating sides. Its distance from that cycle is then half of the apparent distance between the
// points.
fn is_rejected() -> bool {
    let is_separate = search.divisor_distance + SEPARATION <= search.linear_distance;
    return search.rejected_divisor == search.divisor && search.divisor_distance < AT_REST && is_separate;
}

// Rounding error of the motion between two events, in units of ULP. dynamics/src/orbit/resolution.rs has the same value.
const ROUNDINGS: Real = 8.0;

// Whether rounding decides the period: the cycle closes earlier within rounding, or rounding scatters its states by more than the distance
// between two strobes. For a cycle with one strobe, a single rounding error must grow to the size of the motion. With a limit of eight
// errors, f32 would doubt cells of the main map whose words and exponents are right. The reference has the same rule
// (dynamics/src/orbit/resolution.rs).
fn hides_period() -> bool {
    if search.divisor > 0u && exp2(-f32(search.divisor_distance) / PARTS_PER_OCTAVE) < max(noise(), NOISE) {
        return true;
    }
    let nearest = Real(exp2(-f32(search.nearest) / PARTS_PER_OCTAVE));
    let roundings = select(Real(1.0), ROUNDINGS, search.cycle > 1u);
    return EXPONENT && roundings * ULP * measures.cycle_stretch >= nearest;
}

// Returns the largest change of the state by rounding over a cycle, relative to the motion. Every event adds a rounding error, and the
// cycle amplifies it.
fn noise() -> f32 {
    if !EXPONENT {
        return NOISE;
    }
    return f32(ULP * gain()) * f32(16u + 2u * tally.events);
}

// Returns the largest amplification by the cycle that was read, relative to the motion.
fn gain() -> Real {
    let scales = array<Real, 2>(measures.position_scale, measures.rate_scale);
    var most: Real = 1.0;
    for (var k = 0u; k < MATRIX; k++) {
        iterations += 1u;
        let unit = scales[k / DIM % 2u] / max(scales[k % 2u], Real(1e-30));
        most = max(most, abs(motions[lane].tangents[k]) * unit);
    }
    return most;
}

// Returns a bound on the lane's distance from its cycle, relative to the motion. Both recurrence and the linearised map give one, because a
// spiral comes near its last strobe before it comes near its cycle.
fn distance_to_cycle() -> f32 {
    // Rounding can stop a lane before it reaches the cycle.
    let by_recurrence = limit_of(max(exp2(-f32(search.return_distance) / PARTS_PER_OCTAVE), NOISE));
    return select(by_recurrence, max(by_recurrence, exp2(-f32(search.linear_distance) / PARTS_PER_OCTAVE)), EXPONENT);
}

// Returns a bound on the lane's distance from its cycle that includes the largest rounding error.
fn blurred_distance_to_cycle() -> f32 {
    return max(distance_to_cycle(), limit_of(noise()));
}

// Returns the distance of the strobes from their limit: `d / (1 - mu)` if their distance `d` from each other shrinks by the factor `mu` per
// cycle.
fn limit_of(d: f32) -> f32 {
    let mu = select(0.0, exp2(f32(measures.cycle_growth)), EXPONENT);
    return d / max(1.0 - mu, 1e-6);
}

// Whether the lane is so near to its cycle that the cycle's symmetry shows.
fn is_near_cycle() -> bool {
    return distance_to_cycle() < ON_CYCLE;
}

// Whether the cycle is farther from its mirror image than the lane's distance from the cycle explains. That distance counts twice for the
// state, and amplified twice for the image.
fn is_surely_unsymmetric() -> bool {
    let amplified = select(1.0, f32(gain()), EXPONENT);
    return exp2(-f32(search.mirror) / PARTS_PER_OCTAVE) > 2.0 * (1.0 + amplified) * max(blurred_distance_to_cycle(), SYMMETRIC);
}

// Whether the cycle is as near to its mirror image as rounding and the lane's distance from the cycle allow.
fn is_surely_symmetric() -> bool {
    let mirror = exp2(-f32(search.mirror) / PARTS_PER_OCTAVE);
    let is_close = mirror < max(4.0 * distance_to_cycle(), SYMMETRIC);
    return is_near_cycle() && is_close && mirror + 2.0 * distance_to_cycle() < MIRROR_DISTANCE;
}

// Whether the lane is at rest. A slow lane far from the cycle is not.
fn is_at_rest() -> bool {
    let is_there = !EXPONENT || exp2(-f32(search.linear_distance) / PARTS_PER_OCTAVE) < max(ON_CYCLE, limit_of(noise()));
    return search.return_distance >= AT_REST && is_there;
}

// Whether the lane is near its cycle, or as near as rounding allows. The fixed point must lie in the lane's domain. Near a graze the lane
// must be at rest.
fn is_on_cycle(to: State, is_last: bool) -> bool {
    // If periods are left, Newton's method shows whether the motion continues with the same events.
    let is_confirmed = !is_last || settings.early_stop == 0u || search.newton_steps > 0u || distance_to_cycle() <= NEWTON_CONVERGED;
    let is_near = is_near_cycle() && keeps_domain(to) && tally.grazes == 0u && is_confirmed;
    return is_near || moves_no_more(to, is_last);
}

// Whether the motion itself has reached its cycle, as nearly as rounding allows.
fn rests_on_cycle(to: State, is_last: bool) -> bool {
    return search.newton_steps == 0u && moves_no_more(to, is_last);
}

// Whether the lane is at rest or moves by less than rounding, and stays in its domain.
fn moves_no_more(to: State, is_last: bool) -> bool {
    let is_blurred = (search.failed_searches >= MOST_FAILED_SEARCHES || is_last) && search.is_settled != 0u && exp2(-f32(search.return_distance) / PARTS_PER_OCTAVE) < min(noise(), ON_CYCLE);
    return (is_at_rest() || is_blurred) && !leaves_domain(to);
}
