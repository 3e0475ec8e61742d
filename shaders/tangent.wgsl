// Tangent vectors: propagation along a flight and saltation at events. Only variants with an exponent contain them.

// The one vector for the exponent. The four columns of the monodromy matrix, which are carried while a cycle is read,
// stay in the buffer.
var<private> tangent_now: array<Real, 4>;

fn tangent(i: u32) -> array<Real, 4> {
    if tally.tangent_count == 1u {
        return tangent_now;
    }
    let k = 4u * i;
    return array<Real, 4>(motions[lane].tangents[k], motions[lane].tangents[k + 1u], motions[lane].tangents[k + 2u], motions[lane].tangents[k + 3u]);
}

fn set_tangent(i: u32, u: array<Real, 4>) {
    if tally.tangent_count == 1u {
        tangent_now = u;
        return;
    }
    store_tangent(i, u);
}

fn store_tangent(i: u32, u: array<Real, 4>) {
    let k = 4u * i;
    motions[lane].tangents[k] = u[0];
    motions[lane].tangents[k + 1u] = u[1];
    motions[lane].tangents[k + 2u] = u[2];
    motions[lane].tangents[k + 3u] = u[3];
}

// Loads the tangent vector at the start of a dispatch. The first dispatch with the vector initialises it.
fn load_tangent() {
    if GROWTH {
        tally.carries_growth = 1u;
        if tally.tangent_count == 0u {
            resume_growth();
            store_tangent_now();
        }
        let t = motions[lane].tangents;
        tangent_now = array<Real, 4>(t[0], t[1], t[2], t[3]);
    }
}

// Returns a vector with a part in every direction.
fn initial_tangent() -> array<Real, 4> {
    let x = select(Real(0.0), Real(0.5), shapes[cell.flow_index].degrees > 1u);
    return array<Real, 4>(0.5, 0.5, x, x);
}

// Saves the vector while a cycle is read.
fn save_vector() {
    if tally.tangent_count == 1u {
        motions[lane].vector = tangent_now;
    }
}

// Multiplies the saved vector by the monodromy matrix of the cycle that was read along the motion. A new vector would
// first have to turn into its direction, which adds growth: where cycles are read again and again, 0.2 per period of
// motion whose exponent is zero.
fn carry_vector() {
    if search.newton_steps > 0u {
        return;
    }
    let u = motions[lane].vector;
    let m = motions[lane].tangents;
    var image: array<Real, 4>;
    for (var i = 0u; i < 4u; i++) {
        image[i] = (m[i] * u[0] + m[i + 4u] * u[1]) + (m[i + 8u] * u[2] + m[i + 12u] * u[3]);
    }
    let size = largest(image);
    if !(size > 1e-30 && size < 1e30) {
        motions[lane].vector = initial_tangent();
        return;
    }
    let length = unit(&image, size);
    motions[lane].vector = image;
    if GROWTH && tally.period - tally.candidate >= settings.exponent_from {
        count_growth(Real(log2(f32(size)) + log2(f32(length))), tally.candidate);
    }
}

// Scales a vector, whose largest entry is `size`, to unit length. Returns its former length divided by `size`.
fn unit(u: ptr<function, array<Real, 4>>, size: Real) -> Real {
    // Squares would leave the range of numbers.
    let scale = 1.0 / size;
    let v = array<Real, 4>(scale * (*u)[0], scale * (*u)[1], scale * (*u)[2], scale * (*u)[3]);
    let length = sqrt((v[0] * v[0] + v[1] * v[1]) + (v[2] * v[2] + v[3] * v[3]));
    let inverse = 1.0 / length;
    *u = array<Real, 4>(inverse * v[0], inverse * v[1], inverse * v[2], inverse * v[3]);
    return length;
}

// Continues with the saved vector.
fn resume_growth() {
    tally.tangent_count = select(0u, 1u, GROWTH);
    tangent_now = motions[lane].vector;
}

fn store_tangent_now() {
    if GROWTH && tally.tangent_count == 1u {
        store_tangent(0u, tangent_now);
    }
}

// Starts to carry the columns of the monodromy matrix. With one displacement, x has no neighbours.
fn begin_columns() {
    let x = select(Real(0.0), Real(1.0), shapes[cell.flow_index].degrees > 1u);
    motions[lane].tangents = array<Real, 16>(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, x, 0.0, 0.0, 0.0, 0.0, x);
}

// Keeps the columns of the monodromy matrix in range after an event, and measures how much perturbations grow between
// two instants of the cycle: rounding at the first one is amplified until the second.
fn check_columns() {
    let size = size_of_columns();
    if size >= OUT_OF_RANGE {
        tallies[lane].has_overflowed = 1u;
        begin_columns();
        return;
    }
    if size == 0.0 {
        // All neighbours have become the same motion. New perturbations grow from here on.
        tallies[lane].is_superstable = 1u;
        motions[lane].stretch[0] = 1.0;
        begin_columns();
        return;
    }
    if tallies[lane].is_superstable + tallies[lane].column_scalings == 0u {
        motions[lane].stretch[2] = max(motions[lane].stretch[2], size);
    }
    let smallest = min(motions[lane].stretch[0], size);
    motions[lane].stretch[0] = smallest;
    motions[lane].stretch[1] = max(motions[lane].stretch[1], size / smallest);
    if size * LARGE < 1.0 {
        iterations += 16u;
        for (var k = 0u; k < 16u; k++) {
            motions[lane].tangents[k] *= LARGE;
        }
        motions[lane].stretch[0] *= LARGE;
        tallies[lane].column_scalings += 1u;
    }
}

// Size from which a tangent vector counts as lost: its next step may leave the range of single precision.
const OUT_OF_RANGE: Real = 1e30;

// Whether a vector is below OUT_OF_RANGE. The function `max` may leave out what is not a number, and a sum does not.
fn is_in_range(u: array<Real, 4>) -> bool {
    return is_bounded((HUGE / OUT_OF_RANGE) * sum_of_sizes(u));
}

// Returns the largest entry of the columns, with rates divided by the forcing frequency; OUT_OF_RANGE if a column is lost.
fn size_of_columns() -> Real {
    let angle = flows[cell.flow_index].domains[0].angle;
    var sizes: array<Real, 4>;
    var are_in_range = true;
    for (var i = 0u; i < 4u; i++) {
        iterations += 1u;
        let u = tangent(i);
        are_in_range = are_in_range && is_in_range(u);
        sizes[i] = max(max(abs(u[0]), abs(u[2])), max(abs(u[1]), abs(u[3])) / angle);
    }
    return select(OUT_OF_RANGE, max(max(sizes[0], sizes[2]), max(sizes[1], sizes[3]) * angle), are_in_range);
}

// Returns the largest growth of a perturbation between two instants of the cycle that was read; the second may be in the
// next turn.
fn cycle_stretch() -> Real {
    let stretch = motions[lane].stretch;
    return max(stretch[1], size_of_columns() / stretch[0] * stretch[2]);
}

// Carries the columns of the monodromy matrix over full steps; each vector costs one iteration.
fn step_columns(count: u32) {
    if tally.tangent_count <= 1u {
        return;
    }
    let m = propagator();
    for (var i = 0u; i < tally.tangent_count; i++) {
        var u = tangent(i);
        u[1] *= here.share;
        u[3] *= here.share;
        for (var j = 0u; j < count; j++) {
            u = array<Real, 4>(
                u[0] + ((m[0] * u[0] + m[1] * u[1]) + (m[2] * u[2] + m[3] * u[3])),
                u[1] + ((m[7] * u[0] + m[8] * u[1]) + (m[9] * u[2] + m[10] * u[3])),
                u[2] + ((m[14] * u[0] + m[15] * u[1]) + (m[16] * u[2] + m[17] * u[3])),
                u[3] + ((m[21] * u[0] + m[22] * u[1]) + (m[23] * u[2] + m[24] * u[3])),
            );
        }
        u[1] *= here.substeps;
        u[3] *= here.substeps;
        set_tangent(i, u);
    }
}

// Changes of the tangent vectors at the end of a careful step.
struct Crossing {
    // The event, and the vector fields before and after it.
    jump: Jump,
    before: array<Real, 4>,
    after: array<Real, 4>,
    // The infinite sequence of impacts after it. `lasts`: its length, 0 if there is none. `pressing`: the
    // acceleration into the wall at its end. `late_by`: by how much a neighbour's sequence ends later, per (z, w, x,
    // v), x and v with the gap closed. `v_by`: change of the acceleration of x per w, x, v.
    lasts: Real,
    pressing: Real,
    late_by: array<Real, 4>,
    v_by: array<Real, 3>,
    // Whether state and field are continuous but for a change of the rates of gap and x per displacement of the gap
    // (`jolt`).
    is_smooth: bool,
    jolt: array<Real, 2>,
}

var<private> crossing: Crossing;

// Carries every vector over a part of a step and the event after it. A gap that was stuck has no neighbouring
// motions.
fn carry_tangents(flight_pull: Pull, tau: Real, held: bool) {
    let back = 1.0 / flight_pull.share;
    for (var i = 0u; i < tally.tangent_count; i++) {
        iterations += 1u;
        var u = tangent(i);
        if held {
            u[0] = 0.0;
            u[1] = 0.0;
        }
        u[1] *= flight_pull.share;
        u[3] *= flight_pull.share;
        u = glide(flight_pull, u, tau);
        u[1] *= back;
        u[3] *= back;
        if crossing.jump.event {
            u = saltate(u);
        }
        if crossing.lasts > 0.0 {
            u = close(u);
        }
        set_tangent(i, u);
    }
    check_range();
}

fn check_range() {
    if tally.tangent_count == 1u {
        rescale_tangent();
    } else if tally.tangent_count > 1u {
        check_columns();
    }
}

// Many events in one period may take the vector out of the range of single precision. Factors that are taken out of
// it count as growth of the present period.
const LARGE: Real = 1099511627776.0;
const LARGE_OCTAVES: Real = 40.0;

fn rescale_tangent() {
    let u = tangent_now;
    if !(largest(u) > LARGE) {
        return;
    }
    let inverse = 1.0 / LARGE;
    tangent_now = array<Real, 4>(inverse * u[0], inverse * u[1], inverse * u[2], inverse * u[3]);
    if tally.period >= settings.exponent_from {
        motion.block_growth += LARGE_OCTAVES;
    }
}

fn largest(u: array<Real, 4>) -> Real {
    return max(max(abs(u[0]), abs(u[1])), max(abs(u[2]), abs(u[3])));
}

// Carries a vector over a part `tau` of a step: the series of the unforced motion.
fn glide(flight_pull: Pull, u: array<Real, 4>, tau: Real) -> array<Real, 4> {
    let g = flight_pull.gap_row;
    let r = flight_pull.x_row;
    var z = u[0];
    var w = u[1];
    var x = u[2];
    var v = u[3];
    var sum = u;
    // (z, w, x, v): derivatives of order k and k + 1, times tau^k / k!.
    //% for k in 1..TERMS: glide
    {
        let step = tau * (1.0 / $k.0);
        let a = (g[0] * z + g[2] * x) + (g[1] * w + g[3] * v);
        let b = (r[0] * z + r[2] * x) + (r[1] * w + r[3] * v);
        z = step * w;
        x = step * v;
        w = step * a;
        v = step * b;
        sum[0] += z;
        sum[1] += w;
        sum[2] += x;
        sum[3] += v;
    }
    //% end
    return sum;
}

// Carries a vector over a short flight of free motion.
fn glide_short(u: array<Real, 4>, tau: Real) -> array<Real, 4> {
    let g = here.gap_row;
    let r = here.x_row;
    var z = u[0];
    var w = u[1];
    var x = u[2];
    var v = u[3];
    var sum = u;
    //% again glide for k in 1..SHORT_TERMS
    return sum;
}

// Returns the present vector field, per free step.
fn field() -> array<Real, 4> {
    let square = here.substeps * here.substeps;
    let d = domain_of(tally.mode);
    let a = acceleration(here.gap_row, here.share, motion.q, place_of_gap(d));
    let b = acceleration(here.x_row, here.share, motion.q, place_of_x(d));
    return array<Real, 4>(motion.q[1], square * a, motion.q[3], square * b);
}

// Applies the saltation matrix: `S u = R u + (f+ - R f-) (n . u) / (n . f-)`. R is the jump of rates by `rate_factor`
// (-e at an impact, 1 elsewhere) and `kick`.
fn saltate(u: array<Real, 4>) -> array<Real, 4> {
    if KINDS && crossing.is_smooth {
        return array<Real, 4>(u[0], u[1] + crossing.jolt[0] * u[0], u[2], u[3] + crossing.jolt[1] * u[0]);
    }
    let jump = crossing.jump;
    let before = crossing.before;
    let after = crossing.after;
    let inverse = select(1.0 / jump.rate, Real(0.0), abs(jump.rate) < NO_SPEED * speed);
    let along = inverse * ((jump.normal[0] * u[0] + jump.normal[1] * u[1]) + (jump.normal[2] * u[2] + jump.normal[3] * u[3]));
    // The first row is the quotient of the gap's rates; written as a sum it would lose digits where `e` is small.
    return array<Real, 4>(
        jump.rate_factor * u[0],
        jump.rate_factor * u[1] + (after[1] - jump.rate_factor * before[1]) * along,
        u[2] + (after[2] - before[2]) * along,
        u[3] + jump.kick * u[1] + (after[3] - before[3] - jump.kick * before[1]) * along,
    );
}

// Carries a vector through an infinite sequence of impacts. A neighbour's sequence ends `late`; until then it lacks
// the pressing acceleration. x moves as with the gap closed.
fn close(u: array<Real, 4>) -> array<Real, 4> {
    let x = u[2] + kick * u[0];
    let v = u[3] + kick * u[1];
    let by = crossing.late_by;
    let late = (by[0] * u[0] + by[1] * u[1]) + (by[2] * x + by[3] * v);
    let behind = -crossing.pressing * late;
    let gained = crossing.lasts * (crossing.v_by[1] * x + crossing.v_by[2] * v) - crossing.v_by[0] * u[0];
    return array<Real, 4>(0.0, behind, x + crossing.lasts * v, v + (gained - kick * behind));
}

// Returns the growth of the one vector since the last strobe, in octaves, and scales the vector to unit length.
fn renormalise() -> Real {
    var u = tangent(0u);
    let size = largest(u);
    if !is_in_range(u) {
        // The vector is lost: returns a large growth, and starts with a new vector.
        set_tangent(0u, initial_tangent());
        return 100.0;
    }
    if !(size > 1e-30) {
        // Superstable: returns a large loss, and starts with a new vector.
        set_tangent(0u, initial_tangent());
        return -100.0;
    }
    let length = unit(&u, size);
    set_tangent(0u, u);
    // Single precision is enough for averages, and f64 has no logarithm.
    return Real(log2(f32(size)) + log2(f32(length)));
}

fn accumulate_growth() {
    if !GROWTH {
        return;
    }
    let growth = renormalise();
    if tally.period <= settings.exponent_from {
        return;
    }
    count_growth(growth, 1u);
}

// Adds growth over a number of periods. A block that a cycle makes longer has the same weight as the others.
fn count_growth(growth: Real, periods: u32) {
    motion.block_growth += growth;
    search.block_periods += periods;
    if search.block_periods >= settings.exponent_block {
        let whole = motion.block_growth * (Real(settings.exponent_block) / Real(search.block_periods));
        // Squared deviations by Welford's update: sums of squares would cancel where blocks are nearly equal.
        let blocks = Real(search.blocks);
        let deviation = whole - measures.growth_sum / max(blocks, 1.0);
        measures.growth_squares += deviation * deviation * (blocks / (blocks + 1.0));
        measures.growth_sum += whole;
        if search.blocks == 0u {
            measures.first_block = whole;
            measures.growth_products = 0.0;
        } else {
            measures.growth_products += (measures.last_block - measures.first_block) * (whole - measures.first_block);
        }
        measures.last_block = whole;
        motion.block_growth = 0.0;
        search.block_periods = 0u;
        search.blocks += 1u;
    }
}

const LN_2: Real = 0.6931471805599453;

// Returns the mean growth of the tangent vector per period, natural logarithms, and its standard error from the means
// of blocks.
fn mean_growth() -> vec2<Real> {
    let blocks = Real(search.blocks);
    let mean = measures.growth_sum / blocks;
    let rho = block_correlation(mean);
    let variance = measures.growth_squares / (blocks * (blocks - 1.0)) * ((1.0 + rho) / (1.0 - rho));
    return (LN_2 / Real(settings.exponent_block)) * vec2<Real>(mean, sqrt(variance));
}

// Returns the correlation of neighbouring blocks. It is above zero where blocks are shorter than the correlation time.
fn block_correlation(mean: Real) -> Real {
    if search.blocks < FEWEST_BLOCKS || !(measures.growth_squares > 0.0) {
        return 0.0;
    }
    let blocks = Real(search.blocks);
    let m = mean - measures.first_block;
    let last = measures.last_block - measures.first_block;
    let products = measures.growth_products - m * (2.0 * blocks * m - last) + (blocks - 1.0) * m * m;
    // Deviations from a common mean bias the correlation downwards.
    let biased = products / measures.growth_squares;
    return clamp(biased + (1.0 + 3.0 * biased) / blocks, 0.0, 1.0 - CORRELATION_MARGIN / sqrt(blocks));
}
