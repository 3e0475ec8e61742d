//! What makes two cells the same to an adaptive map.

use crate::map::plan::Needs;
use crate::record::classify::classify;
use crate::record::{Record, Spelling, valid, word_hash};
use rattlemap_dynamics::orbit::Class;

/// Class, period and whether there is contact; symmetry and word or pattern where they are asked for. In a map of basins
/// the attractor instead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Label {
    /// See [`word_of`] and [`pattern_of`].
    word: u64,
    /// What makes a border; 0 for a cell that nothing is known of.
    pub(super) kind: u32,
}

impl Label {
    pub(super) fn of(record: &Record, needs: &Needs) -> Label {
        let class = match classify(record) {
            Class::Failed => 1,
            Class::Undecided => 2,
            Class::Chaotic => 3,
            Class::Periodic { period } => 3 + period,
        };
        let free = u32::from(record.is_contact_free());
        let knows_symmetry = needs.symmetric && record.valid & valid::SYMMETRIC != 0;
        let symmetry = if knows_symmetry { 1 + record.symmetric } else { 0 };
        let word = match (needs.pattern, needs.word) {
            (true, _) => pattern_of(record),
            (false, true) => word_of(record),
            (false, false) => 0,
        };
        Label { word, kind: 8 * class + 4 * free + symmetry }
    }

    /// Of a kind, and nothing else.
    pub(super) fn of_kind(kind: u32) -> Label {
        Label { word: 0, kind }
    }

    pub(super) fn is_known(self) -> bool {
        self.kind != 0
    }
}

/// Hash of the word or of that of the symmetry-conjugate orbit, whichever is smaller: the two coexist, and
/// which one a cell shows says nothing. 0 where there is no word.
pub(super) fn word_of(record: &Record) -> u64 {
    lesser(record.word_hash, record.spelling())
}

/// The same of the pattern.
pub(super) fn pattern_of(record: &Record) -> u64 {
    lesser(record.pattern_hash, record.pattern())
}

fn lesser(hash: u64, spelling: Option<Spelling>) -> u64 {
    match spelling {
        Some(Spelling::Whole(word)) => hash.min(word_hash(word.mirrored().symbols())),
        Some(Spelling::Hashed { .. }) | None => hash,
    }
}
