//! What one lane measured: the only thing that travels from an engine to the host's tables.

pub mod classify;
pub mod distance;
pub mod limits;
mod spelling;
mod store;

#[cfg(feature = "gpu")]
pub(crate) use spelling::joined;
pub use spelling::{Spelling, word_hash};
pub use store::{RecordStore, Records};

use bytemuck::{Pod, Zeroable};

/// Layout version of [`Record`]; files that hold records carry it.
pub const RECORD_VERSION: u32 = 2;

/// Longest word or pattern that a record spells out; longer ones are kept as hash and length.
pub const WORD_SYMBOLS: usize = 64;

/// Validity bits of a [`Record`]: fields whose bit is not set are zero and mean nothing.
pub mod valid {
    /// `period` was searched for; zero then says that none was confirmed.
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
    /// Nothing was measured: the record was filled from its neighbours.
    pub const FILLED: u32 = 1 << 7;
    /// `pattern`, `pattern_length` and `pattern_hash`.
    pub const PATTERN: u32 = 1 << 8;
}

/// What one cell measured, in one fixed layout for all engines, precisions and variants.
///
/// 176 bytes, no padding, little-endian in files.
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
    /// How the integration ended: [`Status`](rattlemap_dynamics::orbit::Status) by its code.
    pub status: u32,
    /// 1 if the orbit is its own mirror image.
    pub symmetric: u32,
    /// Which fields are valid: bits of [`valid`].
    pub valid: u32,
    /// The word's pattern, each run of one symbol once, packed as the word is.
    pub pattern: [u64; 4],
    /// Rotation-invariant hash of the whole pattern.
    pub pattern_hash: u64,
    /// Symbols in the pattern.
    pub pattern_length: u32,
    /// Reserved; zero.
    pub reserved: u32,
}

impl Record {
    /// Whether it was seen to have neither impacts nor meshing; both must have been asked for.
    pub fn is_contact_free(&self) -> bool {
        let seen = valid::IMPACTS | valid::MESH;
        self.valid & seen == seen && self.impacts_per_period == 0.0 && self.mesh_fraction == 0.0
    }
}
