// Tangent vectors: the propagator once per flight, saltation at events. Only in variants
// that are asked for an exponent.

fn tangent(i: u32) -> array<Real, 4> {
    let k = 4u * i;
    return array<Real, 4>(motions[lane].tangents[k], motions[lane].tangents[k + 1u], motions[lane].tangents[k + 2u], motions[lane].tangents[k + 3u]);
}

fn set_tangent(i: u32, u: array<Real, 4>) {
    for (var j = 0u; j < 4u; j++) {
        motions[lane].tangents[4u * i + j] = u[j];
    }
}

// Carries every vector over the pending full steps of domain `d` and a part of another.
fn carry_tangents(d: u32, tau: Real) {
    if !EXPONENT {
        return;
    }
    let share = flows[cell.flow_index].domains[d].share;
    let substeps = flows[cell.flow_index].domains[d].substeps;
    for (var i = 0u; i < tally.tangent_count; i++) {
        var u = tangent(i);
        u[1] *= share;
        u[3] *= share;
        var pending = tally.pending;
        for (var j = 8u; j > 0u; j--) {
            while pending >= (1u << (j - 1u)) {
                u = leap(d, j - 1u, u);
                pending -= 1u << (j - 1u);
                trips += 1u;
            }
        }
        u = glide(d, u, tau);
        u[1] *= substeps;
        u[3] *= substeps;
        set_tangent(i, u);
    }
    tally.pending = 0u;
}

// `2^j` steps of domain `d`.
fn leap(d: u32, j: u32, u: array<Real, 4>) -> array<Real, 4> {
    var next = u;
    for (var i = 0u; i < 4u; i++) {
        let k = 16u * j + 4u * i;
        next[i] += (flows[cell.flow_index].domains[d].powers[k] * u[0]
            + flows[cell.flow_index].domains[d].powers[k + 1u] * u[1])
            + (flows[cell.flow_index].domains[d].powers[k + 2u] * u[2]
            + flows[cell.flow_index].domains[d].powers[k + 3u] * u[3]);
    }
    return next;
}

// A part `tau` of a step: the series of the unforced motion.
fn glide(d: u32, u: array<Real, 4>, tau: Real) -> array<Real, 4> {
    let g = flows[cell.flow_index].domains[d].gap_row;
    let r = flows[cell.flow_index].domains[d].x_row;
    var z = u[0];
    var w = u[1];
    var x = u[2];
    var v = u[3];
    var sum = u;
    // (z, w, x, v) are the derivatives of order k, k + 1 times tau^k / k!.
    //% for k in 1..TERMS
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

// The vector field of domain `d` at `q`, per free step.
fn field(d: u32, q: array<Real, 4>) -> array<Real, 4> {
    let row = flows[cell.flow_index].domains[d].x_row;
    let share = flows[cell.flow_index].domains[d].share;
    let substeps = flows[cell.flow_index].domains[d].substeps;
    let square = substeps * substeps;
    let b = (row[0] * q[0] + row[2] * q[2]) + share * (row[1] * q[1] + row[3] * q[3])
        + (row[4] * motion.phasor[0] + row[5]);
    return array<Real, 4>(q[1], square * gap_acceleration(d, q), q[3], square * b);
}

// `S u = R u + (f+ - R f-) (n . u) / (n . f-)`, with R the jump of rates by `kept` (-e at a
// contact, 1 elsewhere) and `kick`.
fn saltate(before: array<Real, 4>, after: array<Real, 4>, normal: array<Real, 4>, rate: Real, kept: Real, kick: Real) {
    let jump = array<Real, 4>(
        after[0] - before[0],
        after[1] - kept * before[1],
        after[2] - before[2],
        after[3] - before[3] - kick * before[1],
    );
    let inverse = select(1.0 / rate, Real(0.0), abs(rate) < NO_RATE);
    for (var i = 0u; i < tally.tangent_count; i++) {
        let u = tangent(i);
        let along = inverse * ((normal[0] * u[0] + normal[1] * u[1]) + (normal[2] * u[2] + normal[3] * u[3]));
        set_tangent(i, array<Real, 4>(
            u[0] + jump[0] * along,
            kept * u[1] + jump[1] * along,
            u[2] + jump[2] * along,
            u[3] + kick * u[1] + jump[3] * along,
        ));
    }
}

// Rates below this at an event leave the linearisation without meaning.
const NO_RATE: Real = 1e-14;

// Growth of the one vector since the last strobe, in octaves; it is given unit length.
fn renormalise() -> Real {
    let u = tangent(0u);
    let length = sqrt((u[0] * u[0] + u[1] * u[1]) + (u[2] * u[2] + u[3] * u[3]));
    if !(length > 1e-30) {
        // Superstable: as large a loss as can be told. Start anew.
        set_tangent(0u, array<Real, 4>(0.5, 0.5, 0.5, 0.5));
        return -100.0;
    }
    let inverse = 1.0 / length;
    set_tangent(0u, array<Real, 4>(inverse * u[0], inverse * u[1], inverse * u[2], inverse * u[3]));
    // Averages alone are made of it: single precision will do, and f64 has no logarithm.
    return Real(log2(f32(length)));
}

fn accumulate_growth() {
    if !EXPONENT {
        return;
    }
    let growth = renormalise();
    if tally.period <= settings.exponent_from {
        return;
    }
    motion.block_growth += growth;
    tally.block_periods += 1u;
    if tally.block_periods == settings.exponent_block {
        motion.growth_sum += motion.block_growth;
        motion.growth_squares += motion.block_growth * motion.block_growth;
        motion.block_growth = 0.0;
        tally.block_periods = 0u;
        tally.blocks += 1u;
    }
}
