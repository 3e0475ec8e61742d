//! Errors that are planted in what lanes say.

use rattlemap::gpu::Precision;
use rattlemap::plan::Plan;
use rattlemap::record::Record;

use crate::short_cells::explanation;

/// Changes a record.
pub(crate) type Spoil = fn(&mut Record);

/// None of these errors has an explanation.
#[track_caller]
pub(crate) fn stays_unexplained(
    plan: &Plan,
    record: Record,
    precision: Precision,
    planted: &[(&str, Spoil)],
) {
    for (what, spoil) in planted {
        let mut wrong = record;
        spoil(&mut wrong);
        assert_eq!(explanation(plan, wrong, precision), Ok(None), "{what}: {wrong:?}");
    }
}
