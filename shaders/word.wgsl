// The word: a symbol for every flight, spelled and hashed.

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
