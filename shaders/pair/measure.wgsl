// Measures a lane whose class is decided: over one cycle, or over further periods of aperiodic motion. The variant MEASURE takes careful
// steps only. On each step it integrates the Taylor series by Gauss-Legendre quadrature, with an error below 1e-12 for a step of at most a
// radian. It searches for extremes where a rate changes its sign.
//
// Time is in free steps, and rates are per free step. Energies are multiplied by `2 g M^-1 g h^2`, so that a rate w of the gap has the
// energy w^2. Forces are multiplied by `g M^-1 g h^2`.

const NODES: u32 = 6u;
// Largest number of iterations that locate an extreme. The error of the extreme is quadratic in the error of its time.
const EXTREME_ITERATIONS: u32 = 6u;

// Places in `sums`. Integrals: gap and x; squares of both displacements and of the gap; gap and x times the phasor; power of the dampers;
// square of the contact force; contact time. Sums over events: approach speeds, lost energy, number of contacts. Last: number of measured periods.
const SUM_Z: u32 = 0u;
const SUM_X: u32 = 1u;
const SUM_SQUARES: u32 = 2u;
const SUM_ZC: u32 = 5u;
const SUM_ZS: u32 = 6u;
const SUM_XC: u32 = 7u;
const SUM_XS: u32 = 8u;
const SUM_DISSIPATED: u32 = 9u;
const SUM_FORCE: u32 = 10u;
const SUM_CONTACT: u32 = 11u;
const SUM_APPROACH: u32 = 12u;
const SUM_LOST: u32 = 13u;
const SUM_COUNT: u32 = 14u;
const SUM_PERIODS: u32 = 15u;
// Places in `highs` and `lows`: both displacements, the gap, the contact force; and the largest approach speed.
const FORCE: u32 = 3u;
const APPROACH: u32 = 4u;

// Begins to measure a lane that has ended. The lane's last state is stored, because the results contain it.
fn begin_measuring() {
    motions[lane].ended = motion;
    tallies[lane].ended = tally;
    tallies[lane].is_measured = 1u;
    motions[lane].sums = array<Real, SUMS>();
    motions[lane].totals = array<Real, SUMS>();
    motions[lane].highs = array<Real, EXTREMES>(-HUGE, -HUGE, -HUGE, -HUGE, 0.0);
    motions[lane].lows = array<Real, EXTREMES>(HUGE, HUGE, HUGE, HUGE, 0.0);
    tally.stage = STAGE_MEASURING;
    tally.periods_to_read = select(settings.measured_periods, search.cycle, search.cycle > 0u);
    if search.cycle > 0u && search.has_read == 0u {
        // Contact-free motion is measured in its steady state.
        motion.q = flows[cell.flow_index].steady;
        motion.bound = 0.0;
        tally.order = 0u;
    }
}

// Completes a measured period. Each period has its own sums, so that rounding errors do not grow with the number of steps.
fn measure_period() {
    tally.step = 0u;
    motion.theta = 0.0;
    restart_phase();
    tally.passes_in_period = 0u;
    tally.events_in_period = 0u;
    for (var k = 0u; k < SUMS; k++) {
        motions[lane].totals[k] += motions[lane].sums[k];
    }
    motions[lane].sums = array<Real, SUMS>();
    motions[lane].totals[SUM_PERIODS] += 1.0;
    tally.periods_to_read -= 1u;
    if tally.periods_to_read == 0u {
        tally.stage = STAGE_DONE;
    }
}

fn add(place: u32, value: Real) {
    motions[lane].sums[place] += value;
}

// Whether a wall with a spring is in contact.
fn is_compliant() -> bool {
    return tally.mode != MODE_FREE && !sticks();
}

// Returns the state at `tau` of the expansion.
fn measured_state(tau: Real) -> array<Real, 4> {
    var q = state_at(tau, here.substeps);
    if sticks() {
        q[0] = 0.0;
        q[1] = 0.0;
    }
    return q;
}

// Returns the force of the wall's spring and damper, positive if it presses. `q` is in the coordinates of the present domain.
fn contact_force(q: array<Real, 4>) -> Real {
    let side = side_of(tally.mode);
    let wall = flows[cell.flow_index].springs[side];
    return sign_of(side) * (wall[0] * q[0] + wall[1] * q[1]);
}

fn include_one(place: u32, value: Real) {
    motions[lane].highs[place] = max(motions[lane].highs[place], value);
    motions[lane].lows[place] = min(motions[lane].lows[place], value);
}

// Returns both displacements and the gap.
fn displaced(q: array<Real, 4>) -> array<Real, 3> {
    var z = q[0];
    if tally.mode != MODE_FREE {
        z += walls[side_of(tally.mode)];
    }
    let rows = flows[cell.flow_index].displacements;
    return array<Real, 3>(rows[0][0] * z + rows[0][1] * q[2], rows[1][0] * z + rows[1][1] * q[2], z);
}

// Includes a state of the present flight in the extremes.
fn include(q: array<Real, 4>) {
    let values = displaced(q);
    for (var i = 0u; i < 3u; i++) {
        include_one(i, values[i]);
    }
    if is_compliant() {
        include_one(FORCE, contact_force(q));
    }
}

// Returns the rates of both displacements, of the gap and of the contact force at `tau`.
fn measured_rates(tau: Real) -> array<Real, 4> {
    let q = measured_state(tau);
    let rows = flows[cell.flow_index].displacements;
    var force: Real = 0.0;
    if is_compliant() {
        let acceleration = here.substeps * here.substeps * gap_jet(tau).z;
        let wall = flows[cell.flow_index].springs[side_of(tally.mode)];
        force = wall[0] * q[1] + wall[1] * acceleration;
    }
    return array<Real, 4>(rows[0][0] * q[1] + rows[0][1] * q[3], rows[1][0] * q[1] + rows[1][1] * q[3], q[1], force);
}

// Locates the extreme between two instants at which the rate has opposite signs, by regula falsi in the Illinois form.
fn find_extreme(place: u32, begin_at: Real, end_at: Real, rate_at_begin: Real, rate_at_end: Real) {
    var a = begin_at;
    var b = end_at;
    var fa = rate_at_begin;
    var fb = rate_at_end;
    for (var n = 0u; n < EXTREME_ITERATIONS && fb != 0.0; n++) {
        iterations += 1u;
        let c = b - fb * (b - a) / (fb - fa);
        let fc = measured_rates(c)[place];
        if fc * fb < 0.0 {
            a = b;
            fa = fb;
        } else {
            fa *= 0.5;
        }
        b = c;
        fb = fc;
    }
    include(measured_state(b));
}

// Adds a state that lasts for `weight` steps to the integrals. The phasor is that of the state.
fn integrate(weight: Real, q: array<Real, 4>) {
    let values = displaced(q);
    let z = weight * values[2];
    let x = weight * q[2];
    integrals[SUM_Z] += z;
    integrals[SUM_X] += x;
    for (var i = 0u; i < 3u; i++) {
        integrals[SUM_SQUARES + i] += weight * values[i] * values[i];
    }
    integrals[SUM_ZC] += z * motion.phasor[0];
    integrals[SUM_ZS] += z * motion.phasor[1];
    integrals[SUM_XC] += x * motion.phasor[0];
    integrals[SUM_XS] += x * motion.phasor[1];
    let damping = flows[cell.flow_index].domains[domain_of(tally.mode)].damping;
    integrals[SUM_DISSIPATED] += weight * ((damping[0] * q[1] * q[1] + damping[1] * q[1] * q[3]) + damping[2] * q[3] * q[3]);
    if is_compliant() {
        let force = contact_force(q);
        integrals[SUM_FORCE] += weight * force * force;
        integrals[SUM_CONTACT] += weight;
    }
}

// Integrals over the present flight.
var<private> integrals: array<Real, SUMS>;

// Adds the integrals over the present flight to the sums.
fn add_integrals() {
    for (var k = 0u; k <= SUM_CONTACT; k++) {
        add(k, integrals[k]);
    }
    integrals = array<Real, SUMS>();
}

// Measures the flight over the first `tau` steps of the expansion. The phasor is that of the expansion point.
fn measure_flight(tau: Real) {
    if EXTREME {
        include(measured_state(0.0));
        include(measured_state(tau));
    }
    if !(tau > 0.0) {
        return;
    }
    var nodes = array<Real, NODES>(-0.9324695142031521, -0.6612093864662645, -0.2386191860831969,
        0.2386191860831969, 0.6612093864662645, 0.9324695142031521);
    if EXTREME {
        var rates = measured_rates(0.0);
        var before: Real = 0.0;
        for (var k = 0u; k <= NODES; k++) {
            iterations += 1u;
            var t = tau;
            if k < NODES {
                t = 0.5 * (1.0 + nodes[k]) * tau;
            }
            let next = measured_rates(t);
            for (var place = 0u; place <= FORCE; place++) {
                if rates[place] * next[place] < 0.0 {
                    find_extreme(place, before, t, rates[place], next[place]);
                }
            }
            rates = next;
            before = t;
        }
    }
    if MOMENTS {
        var weights = array<Real, NODES>(0.17132449237917036, 0.3607615730481386, 0.46791393457269104,
            0.46791393457269104, 0.3607615730481386, 0.17132449237917036);
        let begun = motion.phasor;
        for (var k = 0u; k < NODES; k++) {
            iterations += 1u;
            let t = 0.5 * (1.0 + nodes[k]) * tau;
            motion.phasor = begun;
            turn_phasor(t);
            integrate(0.5 * weights[k] * tau * here.share, measured_state(t));
        }
        motion.phasor = begun;
        add_integrals();
    }
}

// Measures an infinite series of impacts between the states `begins` and `ends`. The limit that replaces the series has a closed gap. The
// phasor is that at the start. The midpoint rule has an error of third order in the short duration of the series.
fn measure_series(begins: array<Real, 4>, ends: array<Real, 4>, lasts: Real) {
    if MOMENTS {
        let begun = motion.phasor;
        turn_phasor(0.5 * lasts);
        integrate(lasts, array<Real, 4>(begins[0], 0.0, 0.5 * (begins[2] + ends[2]), 0.5 * (begins[3] + ends[3])));
        motion.phasor = begun;
        add_integrals();
    }
}

// Measures a contact to which the law of restitution applies.
fn measure_contact(approach: Real, leaving: Real) {
    add(SUM_APPROACH, approach);
    add(SUM_LOST, approach * approach - leaving * leaving);
    add(SUM_COUNT, 1.0);
    include_one(APPROACH, approach);
}

// Measures the energy in a contact spring that is not relaxed when contact ends. The gap is measured from the wall.
fn measure_release(side: u32) {
    add(SUM_LOST, flows[cell.flow_index].springs[side][0] * motion.q[0] * motion.q[0]);
}
