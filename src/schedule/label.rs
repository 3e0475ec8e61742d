//! What makes two cells the same to an adaptive map.

use crate::classify::classify;
use crate::orbit::Class;
use crate::plan::Needs;
use crate::record::{Record, valid, word_hash};

/// Class and period, and symmetry and word where they are asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Label {
    /// Hash of the word or of that of the mirror twin, whichever is smaller: twins coexist,
    /// and which one a cell shows says nothing.
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
        let knows_symmetry = needs.symmetric && record.valid & valid::SYMMETRIC != 0;
        let symmetry = if knows_symmetry { 1 + record.symmetric } else { 0 };
        let word = if needs.word { record.word_hash } else { 0 };
        let twin = record.word().filter(|_| needs.word).map(|word| word_hash(word.mirrored().symbols()));
        Label { word: twin.map_or(word, |twin| twin.min(word)), kind: 4 * class + symmetry }
    }

    pub(super) fn is_known(self) -> bool {
        self.kind != 0
    }
}
