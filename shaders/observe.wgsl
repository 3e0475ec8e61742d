// What a lane is: strobes, recurrence, averages, the word.

// Distances are kept as quarter octaves below 1: 4 means half.
const OCTAVE: f32 = 4.0;
// Recurrences farther apart than 2^-6 of the motion are none.
const NEAR: u32 = 24u;
// A lane has settled once its limit is estimated to lie within 2^-14 of the motion: weak chaos
// comes within 2^-12 of a cycle by chance.
const SETTLED: f32 = 56.0;
// 2^-4 where Newton's method shows what the limit is; `REACH` judges what it finds.
const REFINABLE: f32 = 16.0;
// Slower approaches than this, per period, are not waited for, only for a recurrence as close as
// if they were as fast.
const SLOWEST: f32 = 0.008;
// Recurrences this close, 2^-12 of the motion, need not shrink, only not grow.
const SLOW: u32 = 48u;
// A distance must have shrunk by this much (a factor of 0.7) since the last window.
const SHRUNK: u32 = 2u;
// Windows over which a candidate must have contracted.
const STREAK: u32 = 2u;
// Lags of any window, at least: they are a fifth of the time that has passed, or a few cycles.
const LEAST_WINDOW: u32 = 2u;
// Windows need not be longer than so many cycles that contract.
const LAGS_PER_CYCLE: u32 = 4u;

// Phase 0: a forcing period is complete.
fn begin_period() {
    tally.step = 0u;
    motion.theta = 0.0;
    motion.phasor = array<Real, 2>(1.0, 0.0);
    tally.period += 1u;
    tally.passes_in_period = 0u;
    tally.events_in_period = 0u;
    if tally.stage == STAGE_READING {
        tally.to_read -= 1u;
        widen_scales(strobe_state());
        let read = tally.candidate - tally.to_read;
        let apart = octaves(distance_between(strobe_state(), motion.anchor));
        if tally.to_read == 0u {
            tally.apart = apart;
            tally.stage = STAGE_READ;
        } else if tally.candidate % read == 0u && apart > tally.divisor_apart {
            tally.divisor = read;
            tally.divisor_apart = apart;
        }
        return;
    }
    accumulate_growth();
    if tally.period == settings.transient_periods {
        begin_counting();
    }
    let decided = settings.max_period > 0u && recurs();
    // Reading the cycle belongs to the budget.
    let read_by = tally.period + tally.candidate;
    let is_last = read_by == settings.periods || read_by == settings.longest;
    // What contracts by chance in the midst of growth has not settled.
    let is_due = is_last && tally.streak >= STREAK && (tally.settled == 1u || !grows(DOUBT));
    let early = settings.early_stop == 1u;
    if read_by <= settings.longest && (is_due || (decided && early)) {
        begin_reading();
    } else if early && is_quiet() {
        end_quiet();
    } else if tally.period >= settings.longest || (early && is_chaos()) {
        tally.stage = STAGE_DONE;
    }
}

// Periods over which averages are taken, at least, before chaos is called early.
const LEAST_COUNTED: u32 = 32u;

// Standard errors by which the exponent must exceed zero once the budget is spent.
const CHAOS_ERRORS: Real = 3.0;
// And those that cast doubt on a cycle that has not settled.
const DOUBT: Real = 1.0;

// Growth of a tangent vector, natural logarithms, that no departure from an unstable cycle can
// have lasted through: beyond the ratio of the largest to the smallest distance.
const DEPARTURE: Real = 40.0;

// A standard error of fewer blocks is none; short budgets would be called chaos by two.
const FEWEST_BLOCKS: u32 = 6u;

// Growth that is sure, and no recurrence that contracts. Looked at when a block is complete.
fn is_chaos() -> bool {
    if tally.block_periods > 0u || tally.blocks < FEWEST_BLOCKS || tally.streak >= STREAK || tally.period < settings.chaos_from {
        return false;
    }
    // Averages that a cycle read in vain has interrupted begin anew.
    if tally.period < tally.counted_from + LEAST_COUNTED && tally.period < settings.periods {
        return false;
    }
    let errors = select(Real(settings.chaos_errors), CHAOS_ERRORS, tally.period >= settings.periods);
    return grows(errors) && outgrows(errors) && !departs(errors);
}

// Whether the exponent exceeds zero by so many standard errors.
fn grows(errors: Real) -> bool {
    if !EXPONENT || tally.blocks < 2u {
        return false;
    }
    let growth = mean_growth();
    return growth.x > errors * growth.y;
}

// Neutral motion grows, too: tangents of a free body, of a torus or of an undamped swing in
// proportion to time, at a double root to its square. Chaos has to outgrow that, and what rounding makes
// of it: a shear `1 s; d 1` with d = ULP where there should be none grows by sqrt(s ULP), s of one
// event being 1 at most.
const NEUTRAL_ORDER: f32 = 2.0;

fn outgrows(errors: Real) -> bool {
    let growth = mean_growth();
    let periods = tally.blocks * settings.exponent_block;
    let began = max(settings.exponent_from, 1u);
    let neutral = NEUTRAL_ORDER * log(f32(began + periods) / f32(began));
    let events_per_period = Real(tally.events) / Real(max(tally.period - tally.counted_from, 1u));
    let rounding = sqrt(events_per_period * events_per_period * ULP);
    return (growth.x - errors * growth.y - rounding) * Real(periods) > Real(neutral);
}

// Whether the motion lingers at some cycle and its growth may be that of leaving it.
fn departs(errors: Real) -> bool {
    // A lane that has just been sent on lingered. A single lag comes near by chance, its
    // multiples with it do not.
    var lingers = tally.known_lags == 0u;
    var rests = false;
    for (var lag = 1u; 2u * lag <= tally.known_lags && !rests; lag++) {
        var nearest = 255u;
        for (var multiple = lag; multiple <= tally.known_lags && nearest >= NEAR; multiple += lag) {
            trips += 1u;
            nearest = min(nearest, last_distance_at(multiple));
        }
        lingers = lingers || nearest >= NEAR;
        rests = nearest >= RESOLVED;
    }
    // What rests at a cycle is held there by rounding: its growth is no chaos.
    if rests {
        return true;
    }
    let growth = mean_growth();
    let periods = Real(tally.blocks * settings.exponent_block);
    return lingers && (growth.x - errors * growth.y) * periods < DEPARTURE;
}

// The energy of the transient keeps the gap off the walls for good.
fn is_quiet() -> bool {
    if tally.mode != MODE_FREE || settings.max_period == 0u {
        return false;
    }
    let s = flows[cell.flow_index].steady;
    let q = motion.q;
    return derivative_bound(q[0] - s[0], q[1] - s[1], q[2] - s[2], q[3] - s[3]) < flows[cell.flow_index].reach;
}

// Contact-free motion of period 1, with nothing left to read.
fn end_quiet() {
    begin_counting();
    tally.cycle = 1u;
    motion.cycle_growth = flows[cell.flow_index].decay;
    tally.stage = STAGE_DONE;
}

// Averages start here.
fn begin_counting() {
    tally.impacts = 0u;
    tally.events = 0u;
    tally.grazes = 0u;
    tally.on_strobe = 0u;
    tally.mesh_right = 0u;
    tally.mesh_left = 0u;
    tally.mesh_whole = 0u;
    motion.mesh_part = 0.0;
    tally.word_length = 0u;
    tally.hash_low = 0u;
    tally.hash_high = 0u;
    tally.recent = 0u;
    if WORD {
        tallies[lane].word = array<u32, 7>();
    }
    tally.counted_from = tally.period;
}

// The period is decided: one cycle is read from here on.
fn begin_reading() {
    begin_counting();
    tally.stage = STAGE_READING;
    tally.to_read = tally.candidate;
    tally.has_read = 1u;
    // A cycle of even period is never compared: it cannot be symmetric.
    tally.mirror = 0u;
    tally.divisor = 0u;
    tally.divisor_apart = 0u;
    motion.anchor = strobe_state();
    narrow_scales(motion.anchor);
    if EXPONENT {
        tally.tangent_count = 4u;
        motions[lane].tangents = array<Real, 16>(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    }
}

// The present state with the gap measured from its middle, whatever the domain.
fn strobe_state() -> array<Real, 4> {
    var q = motion.q;
    if tally.mode != MODE_FREE {
        q[0] += flows[cell.flow_index].walls[side_of(tally.mode)];
    }
    return q;
}

// Looks at a strobe; true once a period is confirmed.
fn recurs() -> bool {
    let q = strobe_state();
    widen_scales(q);
    if tally.window == 0u {
        begin_window(q, widest());
        return false;
    }
    let lag = tally.period - tally.anchor_period;
    let apart = octaves(distance_between(q, motion.anchor));
    tallies[lane].distances[(lag - 1u) / 4u] |= apart << (8u * ((lag - 1u) % 4u));
    if lag < tally.window {
        return false;
    }
    let found = contracting_lag();
    let is_fast = found > 0u && shrinks(found);
    let settled = judge_lag(found);
    tally.known_lags = tally.window;
    tallies[lane].last_distances = tallies[lane].distances;
    // The next anchor lies at the same place of the cycle: only there do distances compare. The
    // points of a cycle may be so close that a shorter lag seems to recur.
    let cycle = max(closest_lag(), 1u);
    // A short lag that contracts is seen as well in short windows.
    let enough = max(LAGS_PER_CYCLE * cycle, LEAST_WINDOW);
    let lags = select(widest(), min(enough, widest()), is_fast && tally.tries == 0u);
    begin_window(q, max(lags - lags % cycle, 1u));
    return settled;
}

// Units of distances: the largest strobe.
fn widen_scales(q: array<Real, 4>) {
    motion.position_scale = max(motion.position_scale, max(abs(q[0]), abs(q[2])));
    motion.rate_scale = max(motion.rate_scale, max(abs(q[1]), abs(q[3])));
}

// What a motion was before it came to its cycle is no unit of the cycle. A strobe may catch it at its
// turning point, or midway between two.
fn narrow_scales(q: array<Real, 4>) {
    let angle = flows[cell.flow_index].domains[0].angle;
    let position = max(abs(q[0]), abs(q[2]));
    let rate = max(abs(q[1]), abs(q[3]));
    motion.position_scale = min(motion.position_scale, max(position, rate / angle));
    motion.rate_scale = min(motion.rate_scale, max(rate, angle * position));
}

fn widest() -> u32 {
    return clamp(tally.period / 5u, LEAST_WINDOW, settings.max_period);
}

// The lag that recurs best; a longer one must be better by a factor of four.
fn closest_lag() -> u32 {
    return closest_of(tally.known_lags);
}

fn closest_of(lags: u32) -> u32 {
    var best = 0u;
    var distance = NEAR;
    for (var lag = 1u; lag <= lags; lag++) {
        trips += 1u;
        if distance_at(lag) >= distance {
            best = lag;
            distance = distance_at(lag) + 8u;
        }
    }
    return best;
}

// The distance of two strobes, relative to the motion. Where strobes catch it at its turning point, their
// rates are all rounding.
fn distance_between(a: array<Real, 4>, b: array<Real, 4>) -> Real {
    let least = flows[cell.flow_index].domains[0].angle * motion.position_scale;
    let p = max(abs(a[0] - b[0]), abs(a[2] - b[2])) / max(motion.position_scale, Real(1e-30));
    let r = max(abs(a[1] - b[1]), abs(a[3] - b[3])) / max(max(motion.rate_scale, least), Real(1e-30));
    return max(p, r);
}

fn begin_window(q: array<Real, 4>, lags: u32) {
    motion.anchor = q;
    tally.anchor_period = tally.period;
    tally.window = min(lags, settings.max_period);
    tallies[lane].distances = array<u32, 16>();
}

// A distance in quarter octaves below 1, at most 255.
fn octaves(distance: Real) -> u32 {
    let d = f32(distance);
    if d <= 1e-19 {
        return 255u;
    }
    return u32(clamp(-OCTAVE * log2(d), 0.0, 255.0));
}

fn distance_at(lag: u32) -> u32 {
    return (tallies[lane].distances[(lag - 1u) / 4u] >> (8u * ((lag - 1u) % 4u))) & 255u;
}

fn last_distance_at(lag: u32) -> u32 {
    return (tallies[lane].last_distances[(lag - 1u) / 4u] >> (8u * ((lag - 1u) % 4u))) & 255u;
}

// The smallest lag that recurs at all its multiples and contracts, or has reached rounding.
// Decaying spirals come close at longer lags first, but their lag 1 shrinks as well.
fn contracting_lag() -> u32 {
    // Points of a cycle that are close together neither shrink nor grow: a longer lag is better.
    let best = closest_of(tally.window);
    for (var lag = 1u; lag <= min(tally.window, tally.known_lags); lag++) {
        trips += 1u;
        let now = distance_at(lag);
        let before = last_distance_at(lag);
        let contracts = shrinks(lag) || (now >= SLOW && now >= before && lag == best);
        if now < NEAR || !contracts {
            continue;
        }
        var kept = true;
        for (var multiple = 2u * lag; multiple <= tally.window; multiple += lag) {
            trips += 1u;
            kept = kept && distance_at(multiple) >= NEAR;
        }
        if kept {
            return lag;
        }
    }
    return 0u;
}

// Whether the distance at a lag has shrunk since the last window, or is rounding.
fn shrinks(lag: u32) -> bool {
    let now = distance_at(lag);
    return now >= RESOLVED || now >= last_distance_at(lag) + SHRUNK;
}

// Whether the limit is near enough: strobes `d` apart that shrink by `mu` per period are
// `d / (1 - mu)` away from it. A slow approach must come closer.
fn has_settled(lag: u32) -> bool {
    let now = distance_at(lag);
    let shrunk = f32(now) - f32(last_distance_at(lag));
    if now >= RESOLVED {
        return true;
    }
    // 1 - mu from the factor since the last anchor, `known_lags` periods ago.
    let away = clamp(shrunk * QUARTER_OCTAVE / f32(tally.known_lags), 1e-6, 1.0);
    return f32(now) >= SETTLED - OCTAVE * log2(away);
}

// Whether Newton's method may show what the limit is.
fn is_refinable(lag: u32) -> bool {
    let now = f32(distance_at(lag));
    let shrunk = now - f32(last_distance_at(lag));
    let away = clamp(shrunk * QUARTER_OCTAVE / f32(tally.known_lags), SLOWEST, 1.0);
    return EXPONENT && tally.vain < VAIN && settings.early_stop == 1u && now >= REFINABLE - OCTAVE * log2(away);
}

// Natural logarithm of a quarter octave.
const QUARTER_OCTAVE: f32 = 0.1733;

// Keeps the books on the candidate; true once it is settled.
fn judge_lag(found: u32) -> bool {
    tally.settled = 0u;
    if found == 0u {
        tally.candidate = 0u;
        tally.streak = 0u;
        return false;
    }
    tally.streak = select(1u, tally.streak + 1u, found == tally.candidate);
    tally.candidate = found;
    // Weak chaos contracts by chance, the oftener it is looked at: ask for more of it.
    let windows = STREAK + tally.tries + select(0u, 2u, grows(CHAOS_ERRORS));
    let has_contracted = tally.streak >= windows;
    tally.settled = select(0u, 1u, has_contracted && has_settled(found));
    return has_contracted && (tally.settled != 0u || is_refinable(found));
}

// Half a period after the middle of a cycle of odd period: how far is the state from the mirror
// image of the cycle's start?
fn compare_mirror() {
    let a = motion.anchor;
    tally.mirror = octaves(distance_between(strobe_state(), array<Real, 4>(-a[0], -a[1], -a[2], -a[3])));
}

// A cycle this close to its mirror image, 2^-12 of the motion, is symmetric.
const MIRROR: f32 = 2.44e-4;

// One flight ends on `side`: its symbol. The first flight of all comes from no wall.
fn note_symbol(side: u32) {
    var symbol: u32;
    if tally.mode != MODE_FREE {
        symbol = select(4u, 1u, side == SIDE_RIGHT);
    } else if tally.origin == SIDE_RIGHT {
        symbol = select(3u, 2u, side == SIDE_RIGHT);
    } else if tally.origin == SIDE_LEFT {
        symbol = select(6u, 5u, side == SIDE_LEFT);
    } else {
        return;
    }
    let n = tally.word_length;
    if WORD && n < 70u {
        tallies[lane].word[n / 10u] |= symbol << (3u * (n % 10u));
    }
    tally.word_length = n + 1u;
    take_symbol(symbol);
    if n >= 7u {
        add_stretch();
    }
}

fn take_symbol(symbol: u32) {
    tally.recent = ((tally.recent << 3u) | symbol) & 0xffffffu;
}

// Stretches of eight symbols, hashed and summed: no matter where the cycle starts.
fn add_stretch() {
    tally.hash_low += mix_bits(tally.recent);
    tally.hash_high += mix_bits(tally.recent ^ 0x5bd1e995u);
}

// A bijection of 32-bit numbers that scatters them.
fn mix_bits(x: u32) -> u32 {
    var h = x;
    h = (h ^ (h >> 16u)) * 0x7feb352du;
    h = (h ^ (h >> 15u)) * 0x846ca68bu;
    return h ^ (h >> 16u);
}

// Events this close to phase 0, in turns, lie on the strobe.
fn note_strobe() {
    let turns = (Real(tally.step) + motion.theta) / Real(shapes[cell.flow_index].steps);
    if turns < ON_STROBE || 1.0 - turns < ON_STROBE {
        tally.on_strobe += 1u;
    }
}
