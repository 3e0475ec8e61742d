//! Records: the results of one cell, in one layout for all engines.

pub mod classify;
pub mod distance;
pub mod fields;
pub mod limits;
pub mod measures;
mod numbers;
mod spelling;
mod store;

pub use numbers::Numbers;
pub use spelling::{Spelling, word_hash};
#[cfg(feature = "gpu")]
pub(crate) use spelling::{SymbolCode, joined};
pub use store::{RecordStore, Records, RecordsMut};

use measures::{FURTHER, MEASURES};
use rattlemap_dynamics::model::{STATE, State};

/// Layout version of [`Record`], stored in files that hold records.
pub const RECORD_VERSION: u32 = 3;

/// Longest word or pattern whose symbols a record holds. Of longer ones it holds hash and length.
pub const WORD_SYMBOLS: usize = 64;

/// Validity bits of a [`Record`]. Fields whose bit is not set are zero and have no meaning.
pub mod valid {
    /// `period` was searched for. A zero then means that none was confirmed.
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
    /// The cell was not computed: its record was filled in from its neighbours.
    pub const FILLED: u32 = 1 << 7;
    /// `pattern`, `pattern_length` and `pattern_hash`.
    pub const PATTERN: u32 = 1 << 8;
    // The bits from 9 on belong to the groups of [`measures`](super::measures::GROUPS).
    /// The numbers of each of several gaps.
    pub const GAPS: u32 = 1 << 21;
    /// Set by lanes, cleared by engines: two gaps reached their walls at the same time.
    pub const TIED: u32 = 1 << 27;
    /// A lane began the cell, and the reference finished it.
    pub const BY_REFERENCE: u32 = 1 << 28;
    /// Set by lanes, cleared by engines: the lane has ended before its class is decided, so that the reference continues it.
    pub const OPEN: u32 = 1 << 29;
    /// Set by lanes, cleared by engines: an event near phase 0 makes a period above 1, or an undecided lane, uncertain.
    pub const NEAR_STROBE: u32 = 1 << 30;
    /// Motion without a period is quasi-periodic.
    pub const QUASI_PERIODIC: u32 = 1 << 31;
}

/// Results of one cell, in one fixed layout for all engines, precisions and variants.
///
/// 408 bytes for models of one or two coordinates with one gap. Those of larger models have further strobe states and measured quantities
/// in memory of their own. Files contain the entries of the strobe state that the model has, but four at least: 376 bytes for one or
/// two coordinates, and 16 more for each further one; 320 bytes of measured quantities only of models with more displacements or gaps; and
/// 120 bytes of contacts of each gap only of models with several gaps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// Largest Lyapunov exponent per unit time.
    pub lyapunov: f64,
    /// Standard error of the exponent; zero for a periodic orbit.
    pub lyapunov_error: f64,
    /// Impacts per forcing period, without starts of meshing.
    pub impacts_per_period: f64,
    /// Fraction of time spent meshing.
    pub mesh_fraction: f64,
    /// Last strobe state `(x1, v1, x2, v2, ...)`.
    pub strobe: Numbers<4, { STATE - 4 }>,
    /// All symbols, the first one lowest: 21 of 3 bits to a `u64`, at most 64; or 12 of 5 bits, at most 42, if bit 63 of the first
    /// number is set, because they have letters of gaps. A longer word has no symbols here.
    pub word: [u64; 4],
    /// Rotation-invariant hash of the whole word.
    pub word_hash: u64,
    /// Number of symbols of the word.
    pub word_length: u32,
    /// Confirmed period in forcing periods; 0 if there is none.
    pub period: u32,
    /// Forcing periods integrated.
    pub periods_run: u32,
    /// Code of the [`Status`](rattlemap_dynamics::orbit::Status) with which the integration ended.
    pub status: u32,
    /// 1 if the orbit is its own mirror image.
    pub symmetric: u32,
    /// Bits of [`valid`] of the fields that have a value.
    pub valid: u32,
    /// The word's pattern: one symbol for each run of equal symbols, packed like the word.
    pub pattern: [u64; 4],
    /// Rotation-invariant hash of the whole pattern.
    pub pattern_hash: u64,
    /// Number of symbols of the pattern.
    pub pattern_length: u32,
    /// Measured quantities, at the places of [`measures::all`].
    pub measures: Numbers<FURTHER, { MEASURES - FURTHER }>,
}

/// Rounding error of a mesh fraction of 1. Lanes count whole steps, without error.
const MESH_ROUNDING: f64 = 1e-9;

impl Record {
    /// Returns the last strobe state.
    pub fn strobe(&self) -> State {
        std::array::from_fn(|place| self.strobe[place])
    }

    /// Whether the cell had neither impacts nor meshing. Both must be in the record.
    pub fn is_contact_free(&self) -> bool {
        self.is_without_impacts() && self.mesh_fraction == 0.0
    }

    /// Whether the cell meshed all the time. Impacts and mesh fraction must be in the record.
    pub fn is_always_in_contact(&self) -> bool {
        self.is_without_impacts() && self.mesh_fraction > 1.0 - MESH_ROUNDING
    }

    fn is_without_impacts(&self) -> bool {
        let contacts = valid::IMPACTS | valid::MESH;
        self.valid & contacts == contacts && self.impacts_per_period == 0.0
    }
}
