// Structs in the buffers, and the buffers' bindings. A struct holds either Reals or 32-bit numbers alone, so that it has the same shape in
// both precisions. src/gpu/layout.rs declares the structs that the host writes or reads: cells, settings and results; and the constants of
// oscillators with one gap. src/gpu/shader.rs puts them and the constants that no shader declares in front of the source.
//
// The observers, which search for cycles and chaos, serve two engines of motion: oscillators with one gap (pair/oscillator.wgsl) and
// machines (machine/machine.wgsl). Both files define the functions that the observers call.

// A state lists COORDINATES displacements, each followed by its rate. A matrix has such states as columns.
alias State = array<Real, DIM>;
alias Matrix = array<Real, MATRIX>;

// State that a lane carries between dispatches. `MotionNow` and `TallyNow` are used by every step and event; a lane keeps them in registers.
// `Measures` and `Search` are used by `observe` and `judge_cycles` alone, so that they take no registers from the steps. Arrays that are
// indexed stay in the buffer: an indexed array would move its whole struct out of registers. Structs that are loaded whole are aligned, so
// that compilers can read and write four numbers at a time.

// The motion.
struct MotionNow {
    // Displacements and rates: gap (from the wall while meshing), its rate, x, its rate; rates per free step.
    @align(FOUR_REALS) q: State,
    // cos and sin of the forcing phase.
    phasor: array<Real, 2>,
    // Fraction of the present free step that has passed; during an interrupted scan, at the scan's start.
    theta: Real,
    // Bound on the sixth derivative of the gap; time in steps of the present domain.
    bound: Real,
    // Second derivative of the gap at the instant at which the end of a dispatch interrupted a scan.
    bend: Real,
    // Time spent meshing in partial steps: the fractional part of its sum, in free steps.
    mesh_part: Real,
    // Growth of the tangent vector in the present block, in octaves.
    block_growth: Real,
}

// Averages and scales of the motion, updated at strobes.
struct Measures {
    // Growth of the tangent vector over whole blocks: its sum, and the sum of squared deviations from its mean.
    @align(FOUR_REALS) growth_sum: Real,
    growth_squares: Real,
    // Sum of the products of consecutive blocks, whose growth is taken relative to the first block; growth of the first and of the last
    // whole block.
    growth_products: Real,
    first_block: Real,
    last_block: Real,
    // Strobe state that later strobes are compared with. While a cycle is read, the cycle's start.
    anchor: State,
    // Largest position at strobes, of the whole motion and of its first part; largest rate of the first part and of the whole motion.
    // Distances are relative to those of the whole motion.
    position_scale: Real,
    early_scale: Real,
    early_rate_scale: Real,
    rate_scale: Real,
    // Binary logarithm of the modulus of the largest multiplier of the cycle that was read.
    cycle_growth: Real,
    // Largest growth of a perturbation between two instants of that cycle.
    cycle_stretch: Real,
    // `cycle_growth` and the distance from the cycle at the previous reading.
    earlier_growth: Real,
    earlier_distance: Real,
}

struct Motion {
    now: MotionNow,
    measures: Measures,
    // Columns of the monodromy matrix in lane units.
    @align(FOUR_REALS) tangents: Matrix,
    // Tangent vector of the exponent.
    @align(FOUR_REALS) vector: State,
    // Growth of perturbations on the cycle that is read (check_columns in growth.wgsl): smallest size of the columns so far, largest ratio
    // of a size to an earlier one, and largest size.
    stretch: array<Real, 3>,
    // The last strobe states of the motion (approach.wgsl).
    @align(FOUR_REALS) trail: array<State, TRAIL>,
    // Weighted averages of the displacements and of the sum of their squares, relative to a centre: first window minus second window
    // (regularity.wgsl).
    averages: array<Real, COORDINATES + 1>,
    average_centre: State,
    // The state of a lane before it was measured.
    ended: MotionNow,
    // Measured sums of the present period and of all periods; largest and smallest values (pair/measure.wgsl).
    sums: array<Real, SUMS>,
    totals: array<Real, SUMS>,
    highs: array<Real, EXTREMES>,
    lows: array<Real, EXTREMES>,
}

// Counters and flags.
struct TallyNow {
    // Free steps since phase 0; during an interrupted scan, at the scan's start.
    @align(16) step: u32,
    // Steps of a scan that the end of a dispatch interrupted.
    scanned: u32,
    // MODE_*.
    mode: u32,
    // Wall of the last event: SIDE_*.
    origin: u32,
    // If the present state is on that wall: order of the root of the distance from it; 0 otherwise.
    order: u32,
    // Forcing periods completed.
    period: u32,
    // STATUS_*.
    status: u32,
    // Passes and events of the present period.
    passes_in_period: u32,
    events_in_period: u32,
    // Impacts and events since counting began.
    impacts: u32,
    events: u32,
    // Time spent meshing: whole steps of the right and of the left meshing domain, and the whole part of the sum of partial steps, in free
    // steps.
    mesh_right: u32,
    mesh_left: u32,
    mesh_whole: u32,
    // Number of events so near to grazing that the linearisation has little meaning.
    grazes: u32,
    // STAGE_*.
    stage: u32,
    // Smallest lag that recurs and contracts, and periods of its cycle still to be read.
    candidate: u32,
    periods_to_read: u32,
    // 1 once the lane belongs to the kernel that carries a vector for the exponent.
    carries_growth: u32,
    // The word: number of symbols, halves of its rotation-invariant hash, and the eight latest symbols, three bits
    // each.
    word_length: u32,
    hash_low: u32,
    hash_high: u32,
    recent: u32,
    // Smallest distance of an event from phase 0 since counting began, in turns: the bits of an f32.
    strobe_distance: u32,
    // Hash of the present period's events.
    itinerary: u32,
    // Number of changes of the stage in the present period so far.
    next_change: u32,
    // 1 if the lane is at a stop phase and has not been observed there.
    at_stop: u32,
    // Machines: 1 once two gaps have reached their walls at the same time.
    ties: u32,
}

// Search for a cycle, updated at strobes.
struct Search {
    // `has_read`: 1 once a cycle is being read or has been read. `cycle`: period of a cycle that was read and is stable.
    @align(16) has_read: u32,
    cycle: u32,
    // Cycles that were read without success.
    failed_readings: u32,
    // Period at which counting began.
    counting_start: u32,
    // Number of whole blocks of the exponent's average, and number of periods in the present block.
    blocks: u32,
    block_periods: u32,
    // Recurrence: period of the anchor, number of lags of the present window, number of windows over which the candidate has contracted,
    // and number of lags of the last window.
    anchor_period: u32,
    window: u32,
    streak: u32,
    known_lags: u32,
    // 1 if the candidate's limit is near.
    is_settled: u32,
    // Distances in quarter octaves below 1. `mirror`: the cycle's distance from its mirror image. `return_distance`: the lane's distance
    // from the cycle's start at the end of the last reading. `earlier_return_distance`: `return_distance` before a Newton step.
    mirror: u32,
    return_distance: u32,
    earlier_return_distance: u32,
    // Number of Newton steps towards the cycle; hash of the cycle's events before the first step, and its period then.
    newton_steps: u32,
    branch: u32,
    branch_period: u32,
    // MODE_* and SIDE_* of the motion where Newton's method started.
    newton_start_mode: u32,
    newton_start_origin: u32,
    // Divisor of the cycle's period after which the motion came nearest to its start, and that distance in quarter
    // octaves below 1.
    divisor: u32,
    divisor_distance: u32,
    // Number of failed Newton searches. `checks_divisor`: 1 while a divisor is read to find out whether it is the period.
    // `rejected_divisor`: a divisor whose cycle was found to be unstable.
    failed_searches: u32,
    checks_divisor: u32,
    rejected_divisor: u32,
    // Distance of the lane from the fixed point of the linearised strobe map, in quarter octaves below 1.
    linear_distance: u32,
    // In quarter octaves below 1: `motion_distance` is the distance of the motion itself from that fixed point; `nearest` is the distance
    // of the cycle's start from its nearest other strobe.
    motion_distance: u32,
    nearest: u32,
    // Hash of the events of the previous reading. `is_uncertain`: 1 if the exponents of the last two readings differ too much.
    earlier_branch: u32,
    is_uncertain: u32,
    // Number of strobes of the motion so far, and number of its latest cycles with the same events as the cycle that is read.
    strobe_count: u32,
    matching_cycles: u32,
    // Number of events in all whole periods, and largest number in one period after half of `exponent_from`.
    all_events: u32,
    most_events: u32,
    // 1 once only the periods that confirm chaos are left.
    confirms_chaos: u32,
    // Strobe after which the windows of the averages begin, and the length of each window; a length of 0 if they have not begun.
    average_start: u32,
    average_length: u32,
    // Distance within which the motion recurs, in quarter octaves below 1.
    recurrence: u32,
    // 1 if the cycle that was read last has a multiplier of modulus 1.
    is_neutral: u32,
}

// All counters of a lane.
struct Tally {
    now: TallyNow,
    search: Search,
    // Distance at each lag of the present and of the last window, in quarter octaves below 1, one byte each.
    distances: array<u32, 16>,
    last_distances: array<u32, 16>,
    // Hashes of the events of the trail's periods.
    itineraries: array<u32, TRAIL>,
    // How often the columns of the monodromy matrix were multiplied by LARGE. `is_superstable`: 1 if an event has made the columns zero;
    // they then start again.
    column_scalings: u32,
    is_superstable: u32,
    // 1 if a column is lost (OUT_OF_RANGE in growth.wgsl), so that the cycle counts as unstable.
    has_overflowed: u32,
    // Symbols of the word, ten to a number.
    word: array<u32, 7>,
    // The pattern: one symbol for every run of equal symbols. Stored and hashed like the word.
    pattern: array<u32, 7>,
    pattern_length: u32,
    pattern_hash: array<u32, 2>,
    pattern_recent: u32,
    // The counters of a lane before it was measured. `is_measured`: 1 if the lane is being measured or was measured.
    ended: TallyNow,
    is_measured: u32,
}

// Lists of slots. The first `slots` entries are the active list: the lanes under way, in the order in which they began. The next entries
// are the lists of the kernels, one after the other (lists.wgsl).
struct Queue {
    // Number of lanes of each list, and their first places. `beat` counts how often lists were made; the host notices by it that a device
    // no longer works.
    counts: array<u32, LISTS>,
    beat: u32,
    begins: array<u32, LISTS>,
    lanes: array<u32>,
}

// Strobe distance without any event: half a turn, as the bits of an f32.
const FAR_FROM_STROBE: u32 = 0x3f000000u;

const STAGE_RUNNING: u32 = 0u;
const STAGE_READING: u32 = 1u; // a period was found, and its cycle is being read
const STAGE_READ: u32 = 2u; // the cycle has been read and must be judged
const STAGE_DONE: u32 = 3u;
const STAGE_MEASURING: u32 = 4u; // the lane is decided, and its motion is measured

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(5) var<storage, read> cells: array<Cell>;
@group(0) @binding(6) var<storage, read_write> motions: array<Motion>;
@group(0) @binding(7) var<storage, read_write> tallies: array<Tally>;
@group(0) @binding(8) var<storage, read_write> queue: Queue;
@group(0) @binding(9) var<storage, read> starts: array<array<Real, START>>;
@group(0) @binding(10) var<storage, read_write> readings: array<Reading>;
@group(0) @binding(11) var<storage, read_write> findings: array<Finding>;
@group(0) @binding(12) var<storage, read_write> block_starts: array<u32>;
@group(0) @binding(13) var<storage, read_write> measured: array<Measured>;
@group(0) @binding(14) var<storage, read_write> workgroups: array<array<u32, 3>, LISTS>;
