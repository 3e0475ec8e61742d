//! What one lane measured: the only thing that travels from an engine to the host's tables.

use bytemuck::{Pod, Zeroable};

use crate::word::Word;

/// Layout version of [`Record`]; files that hold records carry it.
pub const RECORD_VERSION: u32 = 1;

/// Longest word that a record spells out; longer ones are kept as hash and length.
pub const WORD_SYMBOLS: usize = 64;

/// Validity bits of a [`Record`]: fields whose bit is not set are zero and mean nothing.
pub mod valid {
    /// `period` was looked for; zero then says that none was confirmed.
    pub const PERIOD: u32 = 1;
    /// `lyapunov` and `lyapunov_error`.
    pub const LYAPUNOV: u32 = 1 << 1;
    /// `impacts_per_period`.
    pub const IMPACTS: u32 = 1 << 2;
    /// `mesh_fraction`.
    pub const MESH: u32 = 1 << 3;
    /// `symmetric`.
    pub const SYMMETRIC: u32 = 1 << 4;
    /// `word`, `word_length` and `word_hash`.
    pub const WORD: u32 = 1 << 5;
    /// `strobe`.
    pub const STROBE: u32 = 1 << 6;
}

/// What one cell measured, in one fixed layout for all engines, precisions and variants.
///
/// 160 bytes, no padding, little-endian in files.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Record {
    /// Largest Lyapunov exponent per unit time.
    pub lyapunov: f64,
    /// Its standard error; zero where the exponent is that of a periodic orbit.
    pub lyapunov_error: f64,
    /// Impacts per forcing period, starts of meshing not counted.
    pub impacts_per_period: f64,
    /// Fraction of time spent meshing.
    pub mesh_fraction: f64,
    /// Last strobe state `(x1, v1, x2, v2)`.
    pub strobe: [f64; 4],
    /// The first 64 symbols, 3 bits each (values 1 to 6), 21 to a word, first symbol lowest;
    /// zero where the word is longer.
    pub word: [u64; 4],
    /// Rotation-invariant hash of the whole word.
    pub word_hash: u64,
    /// Symbols in the word.
    pub word_length: u32,
    /// Confirmed period in forcing periods, 0 if none.
    pub period: u32,
    /// Forcing periods integrated.
    pub periods_run: u32,
    /// How the integration ended: [`Status`](crate::orbit::Status) by its code.
    pub status: u32,
    /// 1 if the orbit is its own mirror image.
    pub symmetric: u32,
    /// Which fields are valid: bits of [`valid`].
    pub valid: u32,
    /// Reserved; zero.
    pub reserved: [u32; 8],
}

/// Symbols in one number of [`Record::word`].
const SYMBOLS_PER_NUMBER: usize = 21;

impl Record {
    /// Writes the symbols 1 to 6 of a word of at most [`WORD_SYMBOLS`], in canonical rotation.
    pub fn spell(&mut self, symbols: &[u8]) {
        let digits: Vec<u8> = symbols.iter().map(|symbol| b'0' + symbol).collect();
        self.word = [0; 4];
        for (i, digit) in Word::cyclic(&digits).symbols().iter().enumerate() {
            self.word[i / SYMBOLS_PER_NUMBER] |= u64::from(digit - b'0') << (3 * (i % SYMBOLS_PER_NUMBER));
        }
    }

    /// The word, if it is valid and spelled out.
    pub fn word(&self) -> Option<Word> {
        let length = self.word_length as usize;
        if self.valid & valid::WORD == 0 || length > WORD_SYMBOLS {
            return None;
        }
        let number = |i: usize| self.word[i / SYMBOLS_PER_NUMBER] >> (3 * (i % SYMBOLS_PER_NUMBER));
        let digits: Vec<u8> = (0..length).map(|i| b'0' + (number(i) & 7) as u8).collect();
        Some(Word::cyclic(&digits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_read_as_it_was_spelled() {
        for length in [0, 1, 21, 22, 63, 64] {
            let symbols: Vec<u8> = (0..length).map(|i| 1 + ((i * 5 + i / 7) % 6) as u8).collect();
            let mut record = Record { word_length: length, valid: valid::WORD, ..Record::default() };
            record.spell(&symbols);
            let digits: Vec<u8> = symbols.iter().map(|s| b'0' + s).collect();
            assert_eq!(record.word(), Some(Word::cyclic(&digits)));
        }
    }
}
