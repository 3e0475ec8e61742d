// Growth of tangent vectors.

// A kernel carries VECTORS tangent vectors: none, one for the exponent (GROWTH), or the columns of the monodromy matrix (COLUMNS). The
// columns stay in the buffer.
var<private> tangent_now: State;

fn tangent(i: u32) -> State {
    if GROWTH {
        return tangent_now;
    }
    return column(i);
}

// Loads the tangent vector at the start of a dispatch.
fn load_tangent() {
    if GROWTH {
        tally.carries_growth = 1u;
        tangent_now = motions[lane].vector;
    }
}

fn store_tangent_now() {
    if GROWTH {
        motions[lane].vector = tangent_now;
    }
}

// Returns a vector with a part in every direction.
fn initial_tangent() -> State {
    var u: State;
    for (var i = 0u; i < DIM; i++) {
        u[i] = select(Real(0.0), Real(0.5), i < 2u * shapes[cell.flow_index].degrees);
    }
    return u;
}

// Multiplies the vector by the monodromy matrix of the cycle that was read along the motion. A new vector would first turn into the
// direction of growth, which adds growth: 0.2 per period for motion with an exponent of zero whose cycles are read again and again.
fn carry_vector() {
    if search.newton_steps > 0u {
        return;
    }
    var image = image_of(motions[lane].vector);
    let size = largest(image);
    if !(size > 1e-30 && size < 1e30) {
        motions[lane].vector = initial_tangent();
        return;
    }
    let length = unit(&image, size);
    motions[lane].vector = image;
    if tally.carries_growth == 1u && tally.period - tally.candidate >= settings.exponent_from {
        count_growth(Real(log2(f32(size)) + log2(f32(length))), tally.candidate);
    }
}

// Scales a vector, whose largest entry is `size`, to unit length. Returns its former length divided by `size`.
fn unit(u: ptr<function, State>, size: Real) -> Real {
    // Squares of these numbers would overflow or underflow.
    let scale = 1.0 / size;
    let v = scaled(*u, scale);
    let length = sqrt(inner(v, v));
    *u = scaled(v, 1.0 / length);
    return length;
}

fn scaled(u: State, factor: Real) -> State {
    var v: State;
    //% for k in 0..DIM
    v[$ku] = factor * u[$ku];
    //% end
    return v;
}

// Sets the columns to zero. A matrix that is stored as a whole is slow to compile: some drivers write a loop over lanes for each entry.
fn clear_columns() {
    for (var k = 0u; k < MATRIX; k++) {
        motions[lane].tangents[k] = 0.0;
    }
}

// Starts to carry the columns of the monodromy matrix. With one displacement, x is always 0 and has no tangent.
fn begin_columns() {
    clear_columns();
    for (var i = 0u; i < 2u * shapes[cell.flow_index].degrees; i++) {
        motions[lane].tangents[(DIM + 1u) * i] = 1.0;
    }
    constrain_columns();
}

// Keeps the columns of the monodromy matrix in range after an event. Measures how much perturbations grow between two instants of the
// cycle, because rounding errors grow in the same way.
fn check_columns() {
    let size = size_of_columns();
    if size >= OUT_OF_RANGE {
        tallies[lane].has_overflowed = 1u;
    } else if size == 0.0 {
        // All neighbouring motions have become the same motion. From here on, only new perturbations grow.
        tallies[lane].is_superstable = 1u;
        motions[lane].stretch[0] = 1.0;
    }
    if size >= OUT_OF_RANGE || size == 0.0 {
        begin_columns();
        return;
    }
    var stretch = motions[lane].stretch;
    if tallies[lane].is_superstable + tallies[lane].column_scalings == 0u {
        stretch[2] = max(stretch[2], size);
    }
    stretch[0] = min(stretch[0], size);
    stretch[1] = max(stretch[1], size / stretch[0]);
    if size * LARGE < 1.0 {
        iterations += MATRIX;
        for (var k = 0u; k < MATRIX; k++) {
            motions[lane].tangents[k] *= LARGE;
        }
        stretch[0] *= LARGE;
        tallies[lane].column_scalings += 1u;
    }
    motions[lane].stretch = stretch;
}

// Size above which a tangent vector counts as lost, because its next step may leave the range of single precision.
const OUT_OF_RANGE: Real = 1e30;

// Whether a vector is below OUT_OF_RANGE. The function `max` may ignore NaN; a sum does not.
fn is_in_range(u: State) -> bool {
    return is_bounded((HUGE / OUT_OF_RANGE) * sum_of_sizes(u));
}

// Returns the largest entry of the columns, with rates divided by the forcing frequency; OUT_OF_RANGE if a column is lost.
fn size_of_columns() -> Real {
    let angle = unit_of_frequency();
    var most: Real = 0.0;
    var are_in_range = true;
    for (var i = 0u; i < DIM; i++) {
        iterations += 1u;
        let u = column(i);
        are_in_range = are_in_range && is_in_range(u);
        let size = max(largest_displacement(u), largest_rate(u) / angle);
        most = max(most, size * select(Real(1.0), angle, i % 2u == 1u));
    }
    return select(OUT_OF_RANGE, most, are_in_range);
}

// Returns the largest growth of a perturbation between two instants of the cycle that was read; the second may be in the
// next turn.
fn cycle_stretch() -> Real {
    let stretch = motions[lane].stretch;
    return max(stretch[1], size_of_columns() / stretch[0] * stretch[2]);
}

fn check_range() {
    if GROWTH {
        rescale_tangent();
    } else if COLUMNS {
        check_columns();
    }
}

// Many events in one period may take the vector out of the range of single precision. So the vector is scaled, and the factor counts as
// growth of the present period.
const LARGE: Real = 1099511627776.0;
const LARGE_OCTAVES: Real = 40.0;

fn rescale_tangent() {
    let u = tangent_now;
    if !(largest(u) > LARGE) {
        return;
    }
    tangent_now = scaled(u, 1.0 / LARGE);
    if tally.period >= settings.exponent_from {
        motion.block_growth += LARGE_OCTAVES;
    }
}

fn largest(u: State) -> Real {
    return max(largest_displacement(u), largest_rate(u));
}

// Returns the growth of the exponent's vector since the last strobe, in octaves, and scales the vector to unit length.
fn renormalise() -> Real {
    var u = motions[lane].vector;
    let size = largest(u);
    if !is_in_range(u) {
        // The vector is lost: returns a large growth, and starts with a new vector.
        motions[lane].vector = initial_tangent();
        return 100.0;
    }
    if !(size > 1e-30) {
        // The cycle is superstable: returns a large decrease, and starts with a new vector.
        motions[lane].vector = initial_tangent();
        return -100.0;
    }
    let length = unit(&u, size);
    motions[lane].vector = u;
    // Single precision is enough for averages, and f64 has no logarithm.
    return Real(log2(f32(size)) + log2(f32(length)));
}

fn accumulate_growth() {
    if tally.carries_growth == 0u {
        return;
    }
    let growth = renormalise();
    if tally.period <= settings.exponent_from {
        return;
    }
    count_growth(growth, 1u);
}

// Adds growth over a number of periods. A cycle can make a block longer; all blocks have the same weight.
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

// Returns the mean of the natural logarithm of the tangent vector's growth per period, and its standard error, which follows from the means
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
