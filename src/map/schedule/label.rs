//! Labels of cells: an adaptive map treats cells with equal labels as equal.

use crate::map::plan::Needs;
use crate::record::classify::classify;
use crate::record::{Record, Spelling, valid, word_hash};
use rattlemap_dynamics::orbit::Class;

/// Class, period and whether there is no contact, contact all the time, or both; symmetry and word or pattern if their changes are borders. In a map of
/// basins the attractor instead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Label {
    /// Hash of the word or pattern, from [`word_of`] or [`pattern_of`].
    word: u64,
    /// Number of the kind of motion; 0 for an unknown cell.
    pub(super) kind: u32,
}

impl Label {
    pub(super) fn of(record: &Record, needs: &Needs) -> Label {
        let class = match classify(record) {
            Class::Failed => 1,
            Class::Undecided => 2,
            Class::Chaotic => 3,
            Class::QuasiPeriodic => 4,
            Class::Periodic { period } => 4 + period,
        };
        let contact = match (record.is_contact_free(), record.is_always_in_contact()) {
            (true, _) => 1,
            (_, true) => 2,
            _ => 0,
        };
        let knows_symmetry = needs.symmetric && record.valid & valid::SYMMETRIC != 0;
        let symmetry = if knows_symmetry { 1 + record.symmetric } else { 0 };
        let word = match (needs.pattern, needs.word) {
            (true, _) => pattern_of(record),
            (false, true) => word_of(record),
            (false, false) => 0,
        };
        Label { word, kind: 16 * class + 4 * contact + symmetry }
    }

    /// Builds a label from a kind alone.
    pub(super) fn of_kind(kind: u32) -> Label {
        Label { word: 0, kind }
    }

    pub(super) fn is_known(self) -> bool {
        self.kind != 0
    }
}

/// Returns the smaller of the hashes of the word and of the word of the symmetry-conjugate orbit. The two orbits
/// coexist, so both must have one label. Returns 0 without a word.
pub(super) fn word_of(record: &Record) -> u64 {
    lesser(record.word_hash, record.spelling())
}

/// Returns the smaller of the hashes of the pattern and of its mirror image; 0 without a pattern.
pub(super) fn pattern_of(record: &Record) -> u64 {
    lesser(record.pattern_hash, record.pattern())
}

fn lesser(hash: u64, spelling: Option<Spelling>) -> u64 {
    match spelling {
        Some(Spelling::Whole(word)) => hash.min(word_hash(word.mirrored().symbols())),
        Some(Spelling::Hashed { .. }) | None => hash,
    }
}

#[test]
fn motion_with_some_contact_without_any_and_always_in_contact_has_different_labels() {
    let label = |impacts_per_period: f64, mesh_fraction: f64| {
        let valid = valid::PERIOD | valid::IMPACTS | valid::MESH;
        let record = Record { period: 1, valid, impacts_per_period, mesh_fraction, ..Record::default() };
        Label::of(&record, &Needs::EVERYTHING).kind
    };
    let contact = label(0.0, 0.5);
    assert_eq!([label(1.0, 0.0), label(1.0, 1.0), label(0.0, 1.0 - 1e-6)], [contact; 3]);
    let [none, always] = [0.0, 1.0].map(|mesh| label(0.0, mesh));
    assert!(none != contact && always != contact && none != always);
    assert_eq!(label(0.0, 1.0 - 1e-12), always);
}
