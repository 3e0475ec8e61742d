// Taylor series of the motion, and linear functions of it.

// Terms of the series, one point after the other.
var<private> series: array<Real, SERIES>;
// Sums of the absolute values of the terms that were added in each number of a point.
var<private> sizes: array<Real, WIDTH>;

// Number of loop iterations over the rates. Inner loops count, because some drivers count the iterations of all loops of a dispatch and stop
// at a limit.
const TRIPS_OF_RATES: u32 = COORDINATES * (1u + WIDTH / 4u) + HARMONICS + 4u;

// Number of derivatives that are compared with zero.
const DERIVATIVES: u32 = 4u;

// A linear function of a point. It is a sum of `scale` times a row of the table, one displacement and its rate with factors, and a
// constant.
struct Line {
    scale: Real,
    row: u32,
    entry: u32,
    factor: Real,
    rate_factor: Real,
    constant: Real,
}

fn row_line(row: u32, scale: Real) -> Line {
    return Line(scale, row, 0u, 0.0, 0.0, 0.0);
}

// Distance of a gap from a position, in a direction.
fn distance_line(gap: u32, at: Real, direction: u32) -> Line {
    let sign = sign_of(direction);
    return Line(0.0, 0u, 2u * gap, -sign, 0.0, sign * at);
}

// Force of the last wall of a side.
fn force_line(gap: u32, side: u32, factor: Real) -> Line {
    let nth = wall_count(gap, side) - 1u;
    let law = spring(gap, side, nth);
    let sign = factor * sign_of(side);
    return Line(0.0, 0u, 2u * gap, sign * law[0], sign * law[1], factor * law[2] - sign * law[0] * wall_at(gap, side, nth));
}

// Sliding rate of an element.
fn rate_line(i: u32, factor: Real) -> Line {
    return row_line(AT_ELEMENTS + i * (WIDTH + 1u), factor);
}

fn element_force(i: u32) -> Real {
    return number(AT_ELEMENTS + i * (WIDTH + 1u) + WIDTH);
}

fn acceleration_row(domain: u32, i: u32) -> u32 {
    return domain + IN_DOMAIN_ACCELERATIONS + i * WIDTH;
}

// Force with which a rigid wall pushes a gap that rests on it. It is defined only if `has_push` is true.
fn push_line(domain: u32, gap: u32) -> Line {
    return row_line(domain + IN_DOMAIN_PUSHES + gap * WIDTH, 1.0);
}

fn has_push(domain: u32, gap: u32) -> bool {
    return number(domain + IN_DOMAIN_HAS_PUSH + gap) != 0.0;
}

// Force that holds a sticking element.
fn hold_row(domain: u32, i: u32) -> u32 {
    return domain + IN_DOMAIN_HOLDS + i * WIDTH;
}

fn has_hold(domain: u32, i: u32) -> bool {
    return number(domain + IN_DOMAIN_HAS_HOLD + i) != 0.0;
}

// Whether constraints keep a gap at its place.
fn is_still(domain: u32, gap: u32) -> bool {
    return number(domain + IN_DOMAIN_STILL + gap) != 0.0;
}

// Longest step of a domain: until the fastest rate has turned by a radian, or the grid step ends.
fn unit_of(domain: u32) -> Real {
    return min(number(domain), flow.h);
}

// Value of a row at term `k`.
fn product(row: u32, k: u32) -> Real {
    let t = shape.machine + row;
    let p = k * WIDTH;
    var sum: Real = 0.0;
    for (var j = 0u; j < shape.width; j += 4u) {
        sum += (table[t + j] * series[p + j] + table[t + j + 1u] * series[p + j + 1u])
            + (table[t + j + 2u] * series[p + j + 2u] + table[t + j + 3u] * series[p + j + 3u]);
    }
    return sum;
}

// Returns `product(row, k)` and the sum of the sizes of its terms. Used for events: it is slower than `product`, but compiles faster, because
// some drivers write a loop for each place that reads a table.
fn product_and_size(row: u32, k: u32) -> vec2<Real> {
    var sum = vec2<Real>();
    var pair = vec2<Real>();
    var first_pair = vec2<Real>();
    for (var j = 0u; j < shape.width; j++) {
        let factor = number(row + j);
        let term = vec2<Real>(factor * series[k * WIDTH + j], abs(factor) * sizes[j]);
        // Adds the terms in the order of `product`.
        pair = select(pair + term, term, j % 2u == 0u);
        first_pair = select(first_pair, pair, j % 4u == 1u);
        sum = select(sum, sum + (first_pair + pair), j % 4u == 3u);
    }
    return sum;
}

// Value of a line without its row at term `k`.
fn value_of_entries(line: Line, k: u32) -> Real {
    let p = k * WIDTH;
    return (line.factor * series[p + line.entry] + line.rate_factor * series[p + line.entry + 1u]) + line.constant * series[p + WIDTH - 1u];
}

fn value_of(line: Line, k: u32) -> Real {
    var value = value_of_entries(line, k);
    if line.scale != 0.0 {
        value += line.scale * product(line.row, k);
    }
    return value;
}

// Value of a line at term `k`, and the sum of the sizes of its terms. `of_row`: `product_and_size` of its row.
fn value_and_size(line: Line, k: u32, of_row: vec2<Real>) -> vec2<Real> {
    let size = (abs(line.factor) * sizes[line.entry] + abs(line.rate_factor) * sizes[line.entry + 1u]) + abs(line.constant) * sizes[WIDTH - 1u];
    let sum = vec2<Real>(value_of_entries(line, k), size);
    return select(sum, sum + vec2<Real>(line.scale, abs(line.scale)) * of_row, line.scale != 0.0);
}

// The numbers of a point at the present phase that do not depend on the state.
var<private> phase_numbers: array<Real, WIDTH>;

// Computes `phase_numbers`, after each change of the phase.
fn load_phase() {
    iterations += HARMONICS;
    for (var m = 0u; m < HARMONICS; m++) {
        let place = shape.phasors + 2u * (HARMONICS * tally.step + m);
        let c = table[place];
        let s = table[place + 1u];
        let turn = small_turn(motion.theta * Real(shape.orders[m]) * flow.omega * flow.h);
        phase_numbers[DIM + 2u * m] = c + (turn.x * c - turn.y * s);
        phase_numbers[DIM + 2u * m + 1u] = s + (turn.y * c + turn.x * s);
    }
    phase_numbers[WIDTH - 1u] = 1.0;
}

// Makes a state at the present phase the first term.
fn load_point(q: State) {
    var y = q;
    iterations += WIDTH;
    for (var i = 0u; i < shape.dim; i++) {
        series[i] = y[i];
    }
    for (var i = shape.dim; i < shape.width; i++) {
        series[i] = phase_numbers[i];
    }
}

// Loads a point, and the absolute values of its numbers.
fn load_sizes(q: State) {
    load_point(q);
    for (var i = 0u; i < shape.width; i++) {
        sizes[i] = abs(series[i]);
    }
}

// Makes a tangent vector the first term.
fn load_vector(u: State) {
    var y = u;
    for (var i = 0u; i < shape.dim; i++) {
        series[i] = y[i];
    }
    for (var i = shape.dim; i < shape.width; i++) {
        series[i] = 0.0;
    }
}

// Computes term `k + 1`: the time derivative of term `k`, times `factor`.
fn differentiate(domain: u32, k: u32, factor: Real) {
    let from_term = k * WIDTH;
    let to_term = from_term + WIDTH;
    for (var i = 0u; i < shape.coordinates; i++) {
        series[to_term + 2u * i] = factor * series[from_term + 2u * i + 1u];
        series[to_term + 2u * i + 1u] = factor * product(acceleration_row(domain, i), k);
    }
    if held_gap < GAPS {
        // The wall's force keeps the gap at rest.
        let excess = series[to_term + 2u * held_gap + 1u];
        for (var i = 0u; i < shape.coordinates; i++) {
            series[to_term + 2u * i + 1u] -= kick[i] * excess;
        }
    }
    differentiate_phase(k, factor);
    iterations += TRIPS_OF_RATES;
}

// The part of `differentiate` that does not depend on the state.
fn differentiate_phase(k: u32, factor: Real) {
    let from_term = k * WIDTH;
    let to_term = from_term + WIDTH;
    for (var m = 0u; m < HARMONICS; m++) {
        let turn = factor * Real(shape.orders[m]) * flow.omega;
        let at = DIM + 2u * m;
        series[to_term + at] = -turn * series[from_term + at + 1u];
        series[to_term + at + 1u] = turn * series[from_term + at];
    }
    for (var i = shape.dim + 2u * HARMONICS; i < shape.width; i++) {
        series[to_term + i] = 0.0;
    }
}

// Computes the terms of a step of length `h`.
fn expand(domain: u32, h: Real) {
    for (var k = 0u; k < shape.terms; k++) {
        differentiate(domain, k, h / Real(k + 1u));
    }
}

// Returns the state after a share of the step.
fn state_after(share: Real) -> State {
    var q: State;
    iterations += DIM * TERMS;
    for (var i = 0u; i < shape.dim; i++) {
        var sum: Real = 0.0;
        for (var k = shape.terms + 1u; k > 0u; k--) {
            sum = sum * share + series[(k - 1u) * WIDTH + i];
        }
        q[i] = sum;
    }
    return q;
}

// Value and order of the lowest derivative of a line that is not zero within rounding.
struct Lead {
    order: u32,
    value: Real,
}

// Returns the lowest nonzero derivative of order `least` or higher, for a state at the present phase. Only its sign has a meaning. The state
// stays loaded.
fn lead(line: Line, domain: u32, q: State, least: u32) -> Lead {
    load_sizes(q);
    let unit = unit_of(domain);
    var order = 0u;
    for (; order < least + DERIVATIVES; order++) {
        iterations += (COORDINATES + 1u) * (1u + WIDTH) + 2u * WIDTH + HARMONICS;
        let to_term = (order + 1u) * WIDTH;
        // One loop for the rows of all accelerations and that of the line, because drivers copy a function to each call.
        var found: vec2<Real>;
        for (var i = 0u; i <= shape.coordinates; i++) {
            let is_rate = i < shape.coordinates;
            found = product_and_size(select(line.row, acceleration_row(domain, i), is_rate), order);
            if is_rate {
                series[to_term + 2u * i] = unit * series[order * WIDTH + 2u * i + 1u];
                series[to_term + 2u * i + 1u] = unit * found.x;
                // Each new size depends on all old sizes, so they are stored separately.
                next_sizes[2u * i] = unit * sizes[2u * i + 1u];
                next_sizes[2u * i + 1u] = unit * found.y;
            }
        }
        let of_line = value_and_size(line, order, found);
        if order >= least && abs(of_line.x) > ROUNDING * of_line.y {
            return Lead(order, of_line.x);
        }
        differentiate_phase(order, unit);
        for (var i = 0u; i < shape.width; i++) {
            sizes[i] = select(abs(series[to_term + i]), next_sizes[min(i, DIM - 1u)], i < shape.dim);
        }
    }
    return Lead(order, 0.0);
}

var<private> next_sizes: State;
