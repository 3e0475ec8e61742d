//! Words and patterns in records: up to 64 symbols, or 42 with letters of gaps, or 40 with letters after `c`, or else hash and length.

use std::str::FromStr;

use super::{Record, WORD_SYMBOLS, valid};
use rattlemap_dynamics::word::{Word, WordError};

/// How the symbols of a word are packed into numbers.
pub(crate) struct SymbolCode {
    /// Bits of a symbol.
    pub(crate) bits: usize,
    /// Largest number of symbols that a record stores.
    pub(crate) most: usize,
    /// Consecutive symbols that are hashed together.
    pub(crate) window: usize,
}

/// Symbols of a model with one gap.
const PLAIN: SymbolCode = SymbolCode { bits: 3, most: WORD_SYMBOLS, window: 8 };

/// Symbols with the letters of the first three gaps, and of all gaps.
const LETTERED: SymbolCode = SymbolCode { bits: 5, most: 42, window: 6 };
const WIDE: SymbolCode = SymbolCode { bits: 6, most: 40, window: 5 };

/// Bit of the first number that tells [`LETTERED`] and [`WIDE`] symbols, which take no more than 60 bits, and bit of the latter.
const HAS_LETTERS: u64 = 1 << 63;
const IS_WIDE: u64 = 1 << 62;

impl SymbolCode {
    fn of(symbols: &[u8]) -> &'static SymbolCode {
        match symbols.iter().max() {
            Some(80..) => &WIDE,
            Some(56..) => &LETTERED,
            _ => &PLAIN,
        }
    }

    /// Returns the code of a model with a number of gaps, at most three.
    pub(crate) fn of_gaps(gaps: usize) -> &'static SymbolCode {
        if gaps > 1 { &LETTERED } else { &PLAIN }
    }

    /// Returns the number and the bit at which a symbol begins.
    fn place(&self, i: usize) -> (usize, usize) {
        let per_number = 63 / self.bits;
        (i / per_number, self.bits * (i % per_number))
    }
}

/// A word or a pattern as a record stores it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Spelling {
    /// All its symbols.
    Whole(Word),
    /// Hash and length of a longer word.
    Hashed {
        /// [`word_hash`] of the symbols.
        hash: u64,
        /// Number of symbols.
        length: u32,
    },
}

impl FromStr for Spelling {
    type Err = WordError;

    /// Reads a word, or `w#hash/length` from a table.
    fn from_str(text: &str) -> Result<Spelling, WordError> {
        let hashed = || {
            let (hash, length) = text.strip_prefix("w#")?.split_once('/')?;
            let hash = u64::from_str_radix(hash, 16).ok()?;
            Some(Spelling::Hashed { hash, length: length.parse().ok()? })
        };
        hashed().map_or_else(|| text.parse().map(|word| Spelling::new(&word)), Ok)
    }
}

impl Spelling {
    /// Returns the form in which a record stores a word.
    pub fn new(word: &Word) -> Spelling {
        Spelling::unpacked(Spelling::packed(word))
    }

    /// Returns the text for figures and JSON: the symbols in time order, or `#hash/length`; at most 84 characters.
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
        let code = SymbolCode::of(symbols);
        let mut packed = Packed { symbols: [0; 4], hash: word_hash(symbols), length: symbols.len() as u32 };
        packed.symbols[0] = match code.bits {
            5 => HAS_LETTERS,
            6 => HAS_LETTERS | IS_WIDE,
            _ => 0,
        };
        if symbols.len() <= code.most {
            for (i, symbol) in symbols.iter().enumerate() {
                let (number, bit) = code.place(i);
                packed.symbols[number] |= u64::from(symbol - b'0') << bit;
            }
        }
        packed
    }

    fn unpacked(Packed { symbols, hash, length }: Packed) -> Spelling {
        let code = match symbols[0] >> 62 {
            0 | 1 => PLAIN,
            2 => LETTERED,
            _ => WIDE,
        };
        if length as usize > code.most {
            return Spelling::Hashed { hash, length };
        }
        let symbol = |i: usize| {
            let (number, bit) = code.place(i);
            (symbols[number] >> bit) as u8 % (1 << code.bits) + b'0'
        };
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
/// It is the sum over all places of a mix of the eight symbols that begin there (six or five if they have letters of gaps), in two halves
/// of 32 bits. An engine without 64-bit integers can compute it symbol by symbol, and closes the circle with the first symbols.
pub fn word_hash(symbols: &[u8]) -> u64 {
    let (n, code) = (symbols.len(), SymbolCode::of(symbols));
    let mut halves = [0u32; 2];
    for start in 0..n {
        let symbol = |k: usize| u32::from(symbols[(start + k) % n] - b'0');
        let window = (0..code.window).fold(0, |window, k| window << code.bits | symbol(k));
        halves = add_window(halves, window);
    }
    joined(halves)
}

/// Returns the hash from its low and high halves.
pub(crate) fn joined([low, high]: [u32; 2]) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

/// Adds one window of symbols to the halves of a hash, as the shader does.
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
            b"8",
            b"9AI:A",
            &[b'H'; 42],
            b"9P^g",
            &[b'g'; 40],
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
        assert!(text.starts_with('#') && text.ends_with("/100"), "{text}");
        record.set_word(&Word::cyclic(&[b'9'; 43]));
        assert!(record.spelling().unwrap().text().ends_with("/43"));
        record.set_word(&Word::cyclic(&[b'P'; 41]));
        assert!(record.spelling().unwrap().text().ends_with("/41"));
        let mut lettered: Vec<u8> = (0..60u32).map(|i| b'8' + (i * i % 24) as u8).collect();
        let hash = word_hash(&lettered);
        lettered.rotate_left(11);
        assert_eq!(word_hash(&lettered), hash);
    }

    #[test]
    fn words_in_tables_are_not_numbers() {
        for (symbols, text) in [("", "w"), ("36", "w36")] {
            assert_eq!(Spelling::Whole(Word::cyclic(symbols.as_bytes())).in_table(), text);
        }
        assert_eq!(Spelling::Hashed { hash: 7, length: 80 }.in_table(), "w#0000000000000007/80");
    }
}
