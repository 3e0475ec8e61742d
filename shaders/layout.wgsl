// Everything that lies in buffers. The host's side is in src/gpu/layout.rs; a test
// compares the offsets. A struct holds either Reals or u32s alone, so that both precisions
// have the same shape. Constants that no shader declares come from src/gpu/rules.rs and shader.rs.

// One linear domain in units of its own step: time tau = t / h, velocities per step.
struct Domain {
    // The propagator of one step less the identity: rows gap, its rate, x, its rate;
    // columns the same four, cos, sin, 1.
    step: array<Real, 28>,
    // Accelerations of the gap and of x: on gap, rate, x, rate, cos, 1.
    gap_row: array<Real, 6>,
    x_row: array<Real, 6>,
    // |(n+1)-th derivative of the gap|^2 <= this form of the n-th derivatives: on rate^2,
    // rate * x_rate, x_rate^2, gap^2, gap * x, x^2.
    energy: array<Real, 6>,
    // Growth per step of that bound for n = 5.
    growth: Real,
    // Forcing angle of one step, tan of half of it and sin of it.
    angle: Real,
    turn_half: Real,
    turn_sin: Real,
    // Free steps per step of this domain: a power of two, at most 1.
    share: Real,
    // Steps of this domain per free step.
    substeps: Real,
}

// All that is common to the lanes that differ in the contact law alone.
struct Flow {
    // Free motion, meshing on the right, on the left. Meshing measures the gap from its wall.
    domains: array<Domain, 3>,
    // Right and left wall.
    walls: array<Real, 2>,
    // Change of v per unit of gap rate that the contact impulse removes.
    kick: Real,
    // Length of a free step.
    h: Real,
    // What speeds are measured by: half the walls' distance times the rate of free motion, per free step.
    speed: Real,
    // Infinite series of impacts are closed once they last less than this, in free steps.
    closing: Real,
    // Contact-free motion: its steady state at phase 0 in lane units, the size of transients
    // (by the free domain's energy form) below which no event will come, negative where there
    // is none, and its growth per period in octaves.
    steady: array<Real, 4>,
    reach: Real,
    decay: Real,
    // Acceleration of a gap that is held at the right and at the left wall, as a domain's `gap_row` measured from there.
    pressing: array<array<Real, 6>, 2>,
    // What the rates of the gap and of x change by, per displacement of the gap, where an elastic wall is reached.
    damper: array<array<Real, 2>, 2>,
}

struct FlowShape {
    // Free steps per forcing period.
    steps: u32,
    // Where its phasors start.
    phasors: u32,
    // How many displacements there are: of one, the second rests at 0.
    degrees: u32,
    // CONTACT_* of the right and of the left wall.
    contacts: array<u32, 2>,
}

// At the right and at the left wall.
struct Law {
    restitution: array<Real, 2>,
    mesh_speed: array<Real, 2>,
}

struct Cell {
    flow_index: u32,
    law_index: u32,
    // Status of a lane that is refused before it starts, else 0.
    refused: u32,
    // 1 if the mirror image of a motion is a motion.
    mirror: u32,
}

struct Settings {
    // Lanes that the buffers have room for, lanes under way, and where those of them begin that are
    // at their starts.
    slots: u32,
    active_lanes: u32,
    fresh: u32,
    // Forcing periods to integrate, and the most that undecided lanes get.
    periods: u32,
    longest: u32,
    // The first period at which chaos may be called early.
    chaos_from: u32,
    // Standard errors by which the exponent must exceed zero then.
    chaos_errors: f32,
    // Loop iterations that one dispatch may spend on a lane.
    iterations: u32,
    // Passes (scan steps and careful steps) allowed in one period.
    passes_per_period: u32,
    // Events allowed in one period, and in all.
    events_per_period: u32,
    most_events: u32,
    // Invocations along the first dimension of a dispatch.
    row: u32,
    // Periods before averages are taken.
    transient_periods: u32,
    // Lanes without a tangent vector wait here for the variant that carries it.
    growth_from: u32,
    // Periods before the exponent is accumulated, and periods per block of it.
    exponent_from: u32,
    exponent_block: u32,
    // Longest period searched for; 0 searches for none.
    max_period: u32,
    // 1: lanes end once they are decided.
    early_stop: u32,
    // 1: lanes that have ended are queued, not those that there is work for.
    ended: u32,
}

// What a lane carries between dispatches. While it runs, `now` lies in registers: every step and event takes it. What
// strobes have seen and noted is taken up at strobes alone, or it would be in the way of every step
// (sweep.wgsl). Arrays that are indexed stay in the buffer, or they would drag the rest along.

// The motion itself.
struct MotionNow {
    // Gap (from the wall while meshing), its rate, x, its rate; rates per free step.
    q: array<Real, 4>,
    // cos and sin of the forcing phase.
    phasor: array<Real, 2>,
    // Fraction of the free step that has passed.
    theta: Real,
    // Bound on the sixth derivative of the gap, in steps of the present domain.
    bound: Real,
    // Second derivative of the gap where a scan was cut.
    bend: Real,
    // Time spent meshing in parts of steps, in free steps, less the whole ones.
    mesh_part: Real,
    // Growth of the tangent vector in this block, binary logarithms.
    block_growth: Real,
}

// What strobes have seen of the motion.
struct Seen {
    // Growth of the tangent vector: the sum of the whole blocks, and of the squares of their
    // deviations from the mean.
    growth_sum: Real,
    growth_squares: Real,
    // Strobe state that later ones are compared with; where the cycle is read, its start.
    anchor: array<Real, 4>,
    // Largest position and rate at strobes: the unit of distances.
    position_scale: Real,
    rate_scale: Real,
    // Largest multiplier of the cycle that was read, binary logarithm of its modulus.
    cycle_growth: Real,
}

struct Motion {
    now: MotionNow,
    seen: Seen,
    // Tangent vectors, in lane units: one for the exponent, four for the monodromy matrix.
    tangents: array<Real, 16>,
    // The one for the exponent while the matrix takes its place.
    vector: array<Real, 4>,
    // The motion's last strobes (approach.wgsl).
    trail: array<array<Real, 4>, TRAIL>,
}

// The counting.
struct TallyNow {
    // Free steps since phase 0.
    step: u32,
    // 1 where a scan was cut by the end of a dispatch.
    cut: u32,
    // MODE_*.
    mode: u32,
    // Wall of the last event: SIDE_*.
    origin: u32,
    // Order of the root of the distance from that wall at the start; 0 away from it.
    order: u32,
    // Forcing periods completed.
    period: u32,
    // STATUS_*.
    status: u32,
    passes_in_period: u32,
    events_in_period: u32,
    impacts: u32,
    events: u32,
    // Time spent meshing: whole steps of the two domains, and whole free steps made of parts.
    mesh_right: u32,
    mesh_left: u32,
    mesh_whole: u32,
    // Events too near to grazing for the linearisation to mean much.
    grazes: u32,
    // STAGE_*.
    stage: u32,
    // The smallest lag that recurs and contracts, and periods of its cycle that are still to be read.
    candidate: u32,
    to_read: u32,
    // How many tangent vectors there are, and 1 for lanes of the variant that carries one for the exponent.
    tangent_count: u32,
    grows: u32,
    // The word: how many symbols, and a rotation-invariant hash.
    word_length: u32,
    hash_low: u32,
    hash_high: u32,
    recent: u32,
    // Events on the strobe phase.
    on_strobe: u32,
    // The events of this period, hashed.
    itinerary: u32,
}

// What strobes have noted of it.
struct Noted {
    // 1 once a cycle is being read or has been, and its period if it is stable.
    has_read: u32,
    cycle: u32,
    // Cycles that were read without success.
    tries: u32,
    // Period at which counting began.
    counted_from: u32,
    // Blocks of the exponent, and periods in the present one.
    blocks: u32,
    block_periods: u32,
    // Recurrence: when the anchor was taken, lags of this window, for how many windows the candidate
    // has contracted, and lags that the last window held.
    anchor_period: u32,
    window: u32,
    streak: u32,
    known_lags: u32,
    // 1 if the candidate's limit is near.
    settled: u32,
    // In quarter octaves below 1: distance of the cycle from its mirror image; how far the
    // cycle that was read last took the lane, and the one before a Newton step.
    mirror: u32,
    apart: u32,
    apart_before: u32,
    // Newton steps towards the cycle, and the events on it before the first.
    refinements: u32,
    branch: u32,
    // The period for which that was, and what governed the motion where Newton set out.
    branch_period: u32,
    home_mode: u32,
    home_origin: u32,
    // The divisor of its period after which it came nearest to its start, and how near.
    divisor: u32,
    divisor_apart: u32,
    // Times that Newton's method led nowhere; 1 while a divisor is read because its multiple might be it, and the divisor
    // whose cycle then was found not to attract.
    failed_searches: u32,
    asked: u32,
    rejected_divisor: u32,
    // How far its cycle is from the lane by the derivative, in quarter octaves below 1.
    off: u32,
    // Strobes of the motion so far, and for how many cycles it has had the events of the cycle that is read.
    passed: u32,
    shown: u32,
    // Events of whole periods, whatever they were counted for.
    all_events: u32,
}

struct Tally {
    now: TallyNow,
    noted: Noted,
    // Distances per lag, of this window and the last: quarter octaves below 1, in bytes.
    distances: array<u32, 16>,
    last_distances: array<u32, 16>,
    // The events of the trail's periods, hashed.
    itineraries: array<u32, TRAIL>,
    // The word's symbols, ten to a number.
    word: array<u32, 7>,
    // The pattern so far, a symbol for every run of one; hashed as the word is.
    pattern: array<u32, 7>,
    pattern_length: u32,
    pattern_hash: array<u32, 2>,
    pattern_recent: u32,
}

// What travels back of a lane: the numbers.
struct Reading {
    // Gap, its rate per free step, x, its rate.
    strobe: array<Real, 4>,
    // Exponent per period, natural logarithms, and its standard error.
    growth: Real,
    growth_error: Real,
    mesh_fraction: Real,
}

// What travels back of a lane: the counting.
struct Finding {
    // VALID_* bits; what is not valid is zero.
    valid: u32,
    // The lane's slot.
    slot: u32,
    status: u32,
    // 0 for none.
    period: u32,
    periods_run: u32,
    impacts: u32,
    // Periods over which impacts were counted.
    counted: u32,
    symmetric: u32,
    word_length: u32,
    // Hash of a word that is too long to be spelled out.
    hash_low: u32,
    hash_high: u32,
    word: array<u32, 7>,
    // The same of its pattern.
    pattern_length: u32,
    pattern_hash: array<u32, 2>,
    pattern: array<u32, 7>,
}

// Slots of lanes: first the active list, those under way in the order in which they were begun; from `slots` on those of
// them that a variant has work for, or that have ended.
struct Queue {
    // How many the latter are, and how often they have been counted: a device that stands still does not.
    count: u32,
    beat: u32,
    lanes: array<u32>,
}

const STAGE_RUNNING: u32 = 0u;
const STAGE_READING: u32 = 1u; // the period is decided, its cycle is being read
const STAGE_READ: u32 = 2u; // its cycle has been read and is to be judged
const STAGE_DONE: u32 = 3u;

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> flows: array<Flow>;
@group(0) @binding(2) var<storage, read> shapes: array<FlowShape>;
@group(0) @binding(3) var<storage, read> phasors: array<array<Real, 2>>;
@group(0) @binding(4) var<storage, read> laws: array<Law>;
@group(0) @binding(5) var<storage, read> cells: array<Cell>;
@group(0) @binding(6) var<storage, read_write> motions: array<Motion>;
@group(0) @binding(7) var<storage, read_write> tallies: array<Tally>;
@group(0) @binding(8) var<storage, read_write> queue: Queue;
@group(0) @binding(9) var<storage, read> starts: array<array<Real, 4>>;
@group(0) @binding(10) var<storage, read_write> readings: array<Reading>;
@group(0) @binding(11) var<storage, read_write> findings: array<Finding>;
@group(0) @binding(12) var<storage, read_write> starts_of_blocks: array<u32>;

const MODE_FREE: u32 = 0u;
const MODE_SUSTAINED: u32 = 1u; // + side
const MODE_ONSET: u32 = 3u; // + side
const MODE_STUCK: u32 = 5u; // + side

const SIDE_RIGHT: u32 = 0u;
const SIDE_LEFT: u32 = 1u;
const SIDE_NONE: u32 = 2u;
