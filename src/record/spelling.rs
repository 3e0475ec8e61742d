//! Words and patterns in records: up to 64 symbols, or hash and length.

use super::{Record, WORD_SYMBOLS, valid};
use rattlemap_dynamics::word::Word;

/// Symbols in one `u64`.
const PER_WORD: usize = 21;

/// Consecutive symbols that are hashed together.
const HASH_WINDOW: usize = 8;

/// A word or a pattern as a record stores it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Spelling {
    /// All its symbols.
    Whole(Word),
    /// Hash and length of more than 64 symbols.
    Hashed {
        /// [`word_hash`] of the symbols.
        hash: u64,
        /// Number of symbols.
        length: u32,
    },
}

impl Spelling {
    /// Returns the form in which a record stores a word.
    pub fn new(word: &Word) -> Spelling {
        Spelling::unpacked(Spelling::packed(word))
    }

    /// Returns the text for figures and JSON: the symbols in time order, or `#hash/length`; at most 64 characters.
    pub fn text(&self) -> String {
        match self {
            Spelling::Whole(word) => word.time_order(),
            Spelling::Hashed { hash, length } => format!("#{hash:016x}/{length}"),
        }
    }

    /// Returns the text for tables, which begins with `w` so that no program reads it as a number. A cycle without
    /// events is `w`.
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
        // Engines need not store the canonical rotation.
        Spelling::Whole(Word::cyclic(&(0..length as usize).map(symbol).collect::<Vec<_>>()))
    }
}

/// The three fields of a record that store a word or a pattern.
struct Packed {
    symbols: [u64; 4],
    hash: u64,
    length: u32,
}

/// Returns a hash of a cyclic word that does not depend on where the word starts.
///
/// It is the sum over all places of a mix of the eight symbols that begin there, in two halves of 32 bits. An engine
/// without 64-bit integers can compute it symbol by symbol, and closes the circle with the first seven symbols.
pub fn word_hash(symbols: &[u8]) -> u64 {
    let n = symbols.len();
    let mut halves = [0u32; 2];
    for start in 0..n {
        let code = (0..HASH_WINDOW).fold(0, |code, k| code << 3 | u32::from(symbols[(start + k) % n] - b'0'));
        halves = add_window(halves, code);
    }
    joined(halves)
}

/// Returns the hash from its low and high halves.
pub(crate) fn joined([low, high]: [u32; 2]) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

/// Adds one window of symbols, 3 bits each, to the halves of a hash, as the shader does.
fn add_window([low, high]: [u32; 2], code: u32) -> [u32; 2] {
    [low.wrapping_add(mix(code)), high.wrapping_add(mix(code ^ 0x5bd1_e995))]
}

/// Mixes bits like the shader's `mix_bits`: every input bit changes every output bit.
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

impl Record {
    /// Stores a word and marks it valid.
    pub fn set_word(&mut self, word: &Word) {
        self.valid |= valid::WORD;
        Packed { symbols: self.word, hash: self.word_hash, length: self.word_length } =
            Spelling::packed(word);
    }

    /// Stores a pattern and marks it valid.
    pub fn set_pattern(&mut self, pattern: &Word) {
        self.valid |= valid::PATTERN;
        Packed { symbols: self.pattern, hash: self.pattern_hash, length: self.pattern_length } =
            Spelling::packed(pattern);
    }

    /// Returns the word if the record has one and holds its symbols.
    pub fn word(&self) -> Option<Word> {
        match self.spelling()? {
            Spelling::Whole(word) => Some(word),
            Spelling::Hashed { .. } => None,
        }
    }

    /// Returns the word, as symbols or hash, if the record has one.
    pub fn spelling(&self) -> Option<Spelling> {
        let packed = Packed { symbols: self.word, hash: self.word_hash, length: self.word_length };
        (self.valid & valid::WORD != 0).then(|| Spelling::unpacked(packed))
    }

    /// Returns the word's pattern, as symbols or hash, if the record has one.
    pub fn pattern(&self) -> Option<Spelling> {
        let packed = Packed { symbols: self.pattern, hash: self.pattern_hash, length: self.pattern_length };
        (self.valid & valid::PATTERN != 0).then(|| Spelling::unpacked(packed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_unchanged_by_packing() {
        let long: Vec<u8> = (0..64u32).map(|i| b'0' + (i * 5 % 8) as u8).collect();
        let zeros = [b'0'; 64];
        for symbols in [
            &b""[..],
            b"36",
            b"2356",
            &long[..21],
            &long[..22],
            &long,
            b"0",
            &zeros[..21],
            &zeros[..22],
            &zeros,
            b"07",
            b"7070",
        ] {
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
    fn words_of_zeros_differ_by_their_length() {
        let stored = |length: usize| {
            let mut record = Record::default();
            record.set_word(&Word::cyclic(&vec![b'0'; length]));
            (record.word_hash, record.spelling().unwrap().text())
        };
        assert_eq!([stored(0).1, stored(1).1, stored(3).1], ["", "0", "000"]);
        let hashes: std::collections::HashSet<u64> = (0..100).map(|length| stored(length).0).collect();
        assert_eq!(hashes.len(), 100);
        assert!(stored(65).1.ends_with("/65"), "{:?}", stored(65));
    }

    #[test]
    fn hashes_do_not_depend_on_the_start_of_the_word() {
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
    fn words_in_tables_are_not_numbers() {
        for (symbols, text) in [("", "w"), ("36", "w36")] {
            assert_eq!(Spelling::Whole(Word::cyclic(symbols.as_bytes())).in_table(), text);
        }
        assert_eq!(Spelling::Hashed { hash: 7, length: 80 }.in_table(), "w#0000000000000007/80");
    }
}
