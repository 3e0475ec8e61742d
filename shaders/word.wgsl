// The word: a symbol for every flight, spelled and hashed. Its pattern: a symbol for every run of one.

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
    if WORD && n < 7u * SYMBOLS_PER_NUMBER {
        tallies[lane].word[n / SYMBOLS_PER_NUMBER] |= symbol << (3u * (n % SYMBOLS_PER_NUMBER));
    }
    tally.word_length = n + 1u;
    // Before the first symbol there is none.
    if PATTERN && symbol != (tally.recent & 7u) {
        note_run(symbol);
    }
    take_symbol(symbol);
    if n >= 7u {
        add_stretch();
    }
}

fn begin_pattern() {
    tallies[lane].pattern = array<u32, 7>();
    tallies[lane].pattern_length = 0u;
    tallies[lane].pattern_hash = array<u32, 2>();
    tallies[lane].pattern_recent = 0u;
}

// Runs are fewer than flights: what they take stays in the buffer.
fn note_run(symbol: u32) {
    let n = tallies[lane].pattern_length;
    if n < 7u * SYMBOLS_PER_NUMBER {
        tallies[lane].pattern[n / SYMBOLS_PER_NUMBER] |= symbol << (3u * (n % SYMBOLS_PER_NUMBER));
    }
    let recent = followed_by(tallies[lane].pattern_recent, symbol);
    tallies[lane].pattern_length = n + 1u;
    tallies[lane].pattern_recent = recent;
    if n >= 7u {
        let hash = stretch(recent);
        tallies[lane].pattern_hash[0] += hash.x;
        tallies[lane].pattern_hash[1] += hash.y;
    }
}

fn take_symbol(symbol: u32) {
    tally.recent = followed_by(tally.recent, symbol);
}

// The eight latest symbols, and one more.
fn followed_by(recent: u32, symbol: u32) -> u32 {
    return ((recent << 3u) | symbol) & 0xffffffu;
}

// Stretches of eight symbols, hashed and summed: no matter where the cycle starts.
fn add_stretch() {
    let hash = stretch(tally.recent);
    tally.hash_low += hash.x;
    tally.hash_high += hash.y;
}

fn stretch(recent: u32) -> vec2<u32> {
    return vec2<u32>(mix_bits(recent), mix_bits(recent ^ 0x5bd1e995u));
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
