// The word: one symbol for every flight, stored and hashed. The pattern: one symbol for every run of equal symbols.

// Adds a symbol.
fn add_symbol(symbol: u32) {
    let n = tally.word_length;
    if WORD && n < 7u * SYMBOLS_PER_NUMBER {
        let place = n / SYMBOLS_PER_NUMBER;
        tallies[lane].word[place] = with_symbol(tallies[lane].word[place], n, symbol);
    }
    tally.word_length = n + 1u;
    if PATTERN && (n == 0u || symbol != (tally.recent & LATEST_SYMBOL)) {
        add_run(symbol);
    }
    push_symbol(symbol);
    if n >= HASH_WINDOW - 1u {
        add_hash_window();
    }
}

// Adds symbol `n` of a word to its number. The first symbol of a number replaces what an earlier word has left there.
fn with_symbol(number: u32, n: u32, symbol: u32) -> u32 {
    let before = n % SYMBOLS_PER_NUMBER;
    return select(number, 0u, before == 0u) | (symbol << (SYMBOL_BITS * before));
}

fn begin_pattern() {
    tallies[lane].pattern_length = 0u;
    tallies[lane].pattern_hash = array<u32, 2>();
    tallies[lane].pattern_recent = 0u;
}

// Adds a symbol to the pattern. The pattern stays in the buffer, because runs are rarer than flights.
fn add_run(symbol: u32) {
    let n = tallies[lane].pattern_length;
    if n < 7u * SYMBOLS_PER_NUMBER {
        let place = n / SYMBOLS_PER_NUMBER;
        tallies[lane].pattern[place] = with_symbol(tallies[lane].pattern[place], n, symbol);
    }
    let recent = append_symbol(tallies[lane].pattern_recent, symbol);
    tallies[lane].pattern_length = n + 1u;
    tallies[lane].pattern_recent = recent;
    if n >= HASH_WINDOW - 1u {
        let hash = hash_window(recent);
        tallies[lane].pattern_hash[0] += hash.x;
        tallies[lane].pattern_hash[1] += hash.y;
    }
}

fn push_symbol(symbol: u32) {
    tally.recent = append_symbol(tally.recent, symbol);
}

// Bit masks of the latest symbol, and of all symbols that are hashed together.
const LATEST_SYMBOL: u32 = (1u << SYMBOL_BITS) - 1u;
const LATEST_SYMBOLS: u32 = (1u << (SYMBOL_BITS * HASH_WINDOW)) - 1u;

// Appends a symbol to the latest symbols and keeps HASH_WINDOW of them.
fn append_symbol(recent: u32, symbol: u32) -> u32 {
    return ((recent << SYMBOL_BITS) | symbol) & LATEST_SYMBOLS;
}

// Adds the hash of the latest symbols. The sum over all windows does not depend on where the cycle starts.
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

// Stores the distance from phase 0, in turns, of the event that is nearest to it.
fn keep_strobe_distance() {
    let turns = (Real(tally.step) + motion.theta) / Real(shapes[cell.flow_index].steps);
    // The bits of positive floating-point numbers are ordered as the numbers are.
    tally.strobe_distance = min(tally.strobe_distance, bitcast<u32>(f32(min(turns, abs(1.0 - turns)))));
}
