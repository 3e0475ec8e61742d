//! Errors that are planted in what lanes say.

use rattlemap::gpu::Precision;
use rattlemap::plan::Plan;
use rattlemap::record::Record;
use rattlemap::validate::Explanation;

use crate::short_cells::explanation;

/// Changes a record.
pub(crate) type Spoil = fn(&mut Record);

/// What a lane says of a plan's first cell.
#[derive(Clone, Copy)]
pub(crate) struct Said<'a>(pub(crate) &'a Plan, pub(crate) Precision, pub(crate) Record);

impl Said<'_> {
    /// It differs from the reference, for this reason.
    #[track_caller]
    pub(crate) fn is_explained_by(self, why: Explanation) -> Self {
        let Said(plan, precision, record) = self;
        assert_eq!(explanation(plan, record, precision), Ok(Some(why)), "{record:?}");
        self
    }

    /// With any of these errors it has no explanation.
    #[track_caller]
    pub(crate) fn but_not_with(self, planted: &[(&str, Spoil)]) {
        let Said(plan, precision, record) = self;
        for (what, spoil) in planted {
            let mut wrong = record;
            spoil(&mut wrong);
            assert_eq!(explanation(plan, wrong, precision), Ok(None), "{what}: {wrong:?}");
        }
    }
}
