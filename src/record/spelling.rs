//! Words and patterns inside records: 64 symbols spelled out, longer ones as hash and length.

use super::{Record, WORD_SYMBOLS, valid};
use rattlemap_dynamics::word::Word;

/// Symbols that one `u64` holds.
const PER_WORD: usize = 21;

/// Consecutive symbols that the hash takes together.
const HASH_WINDOW: usize = 8;

/// A word or a pattern as a record keeps it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Spelling {
    /// All its symbols.
    Whole(Word),
    /// More than 64 symbols: their hash and number.
    Hashed {
        /// [`word_hash`] of the symbols.
        hash: u64,
        /// How many there are.
        length: u32,
    },
}

impl Spelling {
    /// As a record would keep it.
    pub fn new(word: &Word) -> Spelling {
        Spelling::unpacked(Spelling::packed(word))
    }

    /// What figures and JSON show: the symbols in time order, or `#hash/length`. Never more than 64
    /// characters.
    pub fn text(&self) -> String {
        match self {
            Spelling::Whole(word) => word.time_order(),
            Spelling::Hashed { hash, length } => format!("#{hash:016x}/{length}"),
        }
    }

    /// What tables show: the text behind a `w`, lest a reader take it for a number. A cycle without events is `w`.
    pub fn in_table(&self) -> String {
        format!("w{}", self.text())
    }

    fn packed(word: &Word) -> Packed {
        let symbols = word.symbols();
        let mut packed = Packed { symbols: [0; 4], hash: word_hash(symbols), length: symbols.len() as u32 };
        if symbols.len() <= WORD_SYMBOLS {
            for (i, symbol) in symbols.iter().enumerate() {
                packed.symbols[i / PER_WORD] |= u64::from(symbol - b'0') << (3 * (i % PER_WORD));
            }
        }
        packed
    }

    fn unpacked(Packed { symbols, hash, length }: Packed) -> Spelling {
        if length as usize > WORD_SYMBOLS {
            return Spelling::Hashed { hash, length };
        }
        let symbol = |i: usize| (symbols[i / PER_WORD] >> (3 * (i % PER_WORD)) & 7) as u8 + b'0';
        // An engine need not know the canonical rotation; tables do.
        Spelling::Whole(Word::cyclic(&(0..length as usize).map(symbol).collect::<Vec<_>>()))
    }
}

/// Three fields of a record.
struct Packed {
    symbols: [u64; 4],
    hash: u64,
    length: u32,
}

/// A hash of a cyclic word that does not depend on where it starts.
///
/// The sum over all places of a mix of the eight symbols that begin there, in two halves of
/// 32 bits: an engine without 64-bit integers can build it symbol by symbol, closing the
/// circle with the first seven.
pub fn word_hash(symbols: &[u8]) -> u64 {
    let n = symbols.len();
    let mut halves = [0u32; 2];
    for start in 0..n {
        let code = (0..HASH_WINDOW).fold(0, |code, k| code << 3 | u32::from(symbols[(start + k) % n] - b'0'));
        halves = add_window(halves, code);
    }
    joined(halves)
}

/// The hash from its two halves, low and high.
pub(crate) fn joined([low, high]: [u32; 2]) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

/// Adds one window of symbols, 3 bits each, to the halves of a hash; the shader does the same.
fn add_window([low, high]: [u32; 2], code: u32) -> [u32; 2] {
    [low.wrapping_add(mix(code)), high.wrapping_add(mix(code ^ 0x5bd1_e995))]
}

/// The shader's `mix_bits`: every input bit moves every output bit.
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

impl Record {
    /// Packs a word and marks it valid.
    pub fn set_word(&mut self, word: &Word) {
        self.valid |= valid::WORD;
        Packed { symbols: self.word, hash: self.word_hash, length: self.word_length } =
            Spelling::packed(word);
    }

    /// Packs a pattern and marks it valid.
    pub fn set_pattern(&mut self, pattern: &Word) {
        self.valid |= valid::PATTERN;
        Packed { symbols: self.pattern, hash: self.pattern_hash, length: self.pattern_length } =
            Spelling::packed(pattern);
    }

    /// The word, if the record has one and spells it out.
    pub fn word(&self) -> Option<Word> {
        match self.spelling()? {
            Spelling::Whole(word) => Some(word),
            Spelling::Hashed { .. } => None,
        }
    }

    /// The word, spelled out or hashed, if the record has one.
    pub fn spelling(&self) -> Option<Spelling> {
        let packed = Packed { symbols: self.word, hash: self.word_hash, length: self.word_length };
        (self.valid & valid::WORD != 0).then(|| Spelling::unpacked(packed))
    }

    /// The word's pattern, spelled out or hashed, if the record has it.
    pub fn pattern(&self) -> Option<Spelling> {
        let packed = Packed { symbols: self.pattern, hash: self.pattern_hash, length: self.pattern_length };
        (self.valid & valid::PATTERN != 0).then(|| Spelling::unpacked(packed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_packing() {
        let long: Vec<u8> = (0..64u32).map(|i| b'1' + (i * 5 % 6) as u8).collect();
        for symbols in [&b""[..], b"36", b"2356", &long[..21], &long[..22], &long] {
            let word = Word::cyclic(symbols);
            let mut record = Record::default();
            record.set_word(&word);
            assert_eq!((record.spelling(), record.pattern()), (Some(Spelling::Whole(word.clone())), None));
            record.set_pattern(&word.mirrored());
            assert_eq!(record.pattern(), Some(Spelling::Whole(word.mirrored())));
            assert_eq!(record.spelling(), Some(Spelling::Whole(word)));
        }
        assert_eq!(Record::default().spelling(), None);
    }

    #[test]
    fn longer_words_are_hashed_whatever_their_start() {
        let mut symbols: Vec<u8> = (0..100u32).map(|i| b'1' + (i * i % 6) as u8).collect();
        let hash = word_hash(&symbols);
        symbols.rotate_left(37);
        assert_eq!(word_hash(&symbols), hash);
        symbols.swap(3, 4);
        assert_ne!(word_hash(&symbols), hash);
        let mut record = Record::default();
        record.set_word(&Word::cyclic(&symbols));
        let text = record.spelling().unwrap().text();
        assert!(text.starts_with('#') && text.ends_with("/100") && text.len() <= 64, "{text}");
    }

    #[test]
    fn no_table_has_a_word_that_is_a_number() {
        for (symbols, text) in [("", "w"), ("36", "w36")] {
            assert_eq!(Spelling::Whole(Word::cyclic(symbols.as_bytes())).in_table(), text);
        }
        assert_eq!(Spelling::Hashed { hash: 7, length: 80 }.in_table(), "w#0000000000000007/80");
    }
}
