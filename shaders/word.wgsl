// The word: one symbol for every flight, stored and hashed. The pattern: one symbol for every run of equal symbols.

// Adds the symbol of a flight that ends on `side`. The first flight comes from no wall and has no symbol.
fn add_symbol(side: u32) {
    var symbol: u32;
    if tally.mode != MODE_FREE {
        symbol = select(4u, 1u, side == SIDE_RIGHT);
    } else if is_behind_wall() {
        symbol = select(4u, 1u, side_of_interval() == SIDE_RIGHT);
    } else if tally.origin == SIDE_RIGHT {
        symbol = select(3u, 2u, side == SIDE_RIGHT);
    } else if tally.origin == SIDE_LEFT {
        symbol = select(6u, 5u, side == SIDE_LEFT);
    } else {
        return;
    }
    let n = tally.word_length;
    if WORD && n < 7u * SYMBOLS_PER_NUMBER {
        tallies[lane].word[n / SYMBOLS_PER_NUMBER] |= symbol << (3u * (n % SYMBOLS_PER_NUMBER));
    }
    tally.word_length = n + 1u;
    // Before the first symbol, `recent` is zero.
    if PATTERN && symbol != (tally.recent & 7u) {
        add_run(symbol);
    }
    push_symbol(symbol);
    if n >= 7u {
        add_hash_window();
    }
}

fn begin_pattern() {
    tallies[lane].pattern = array<u32, 7>();
    tallies[lane].pattern_length = 0u;
    tallies[lane].pattern_hash = array<u32, 2>();
    tallies[lane].pattern_recent = 0u;
}

// Adds a symbol to the pattern. Runs are rarer than flights, so that the pattern stays in the buffer.
fn add_run(symbol: u32) {
    let n = tallies[lane].pattern_length;
    if n < 7u * SYMBOLS_PER_NUMBER {
        tallies[lane].pattern[n / SYMBOLS_PER_NUMBER] |= symbol << (3u * (n % SYMBOLS_PER_NUMBER));
    }
    let recent = append_symbol(tallies[lane].pattern_recent, symbol);
    tallies[lane].pattern_length = n + 1u;
    tallies[lane].pattern_recent = recent;
    if n >= 7u {
        let hash = hash_window(recent);
        tallies[lane].pattern_hash[0] += hash.x;
        tallies[lane].pattern_hash[1] += hash.y;
    }
}

fn push_symbol(symbol: u32) {
    tally.recent = append_symbol(tally.recent, symbol);
}

// Appends a symbol to the latest ones and keeps eight.
fn append_symbol(recent: u32, symbol: u32) -> u32 {
    return ((recent << 3u) | symbol) & 0xffffffu;
}

// Adds the hash of the eight latest symbols. The sum over all windows does not depend on where the cycle starts.
fn add_hash_window() {
    let hash = hash_window(tally.recent);
    tally.hash_low += hash.x;
    tally.hash_high += hash.y;
}

fn hash_window(recent: u32) -> vec2<u32> {
    return vec2<u32>(mix_bits(recent), mix_bits(recent ^ 0x5bd1e995u));
}

// Mixes the bits of a number: a bijection of 32-bit numbers.
fn mix_bits(x: u32) -> u32 {
    var h = x;
    h = (h ^ (h >> 16u)) * 0x7feb352du;
    h = (h ^ (h >> 15u)) * 0x846ca68bu;
    return h ^ (h >> 16u);
}

// Keeps the distance of the event that is nearest to phase 0, in turns.
fn keep_strobe_distance() {
    let turns = (Real(tally.step) + motion.theta) / Real(shapes[cell.flow_index].steps);
    // Positive numbers have the order of their bits.
    tally.strobe_distance = min(tally.strobe_distance, bitcast<u32>(f32(min(turns, abs(1.0 - turns)))));
}
