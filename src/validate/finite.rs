//! Check that the numbers of a record are finite.

use crate::record::{Record, measures, valid};
use rattlemap_dynamics::model::STATE;
use rattlemap_dynamics::orbit::Budget;
use rattlemap_dynamics::stability::LEAST_FOR_ERROR;

/// Names of the entries of a state in messages.
const STATE_NAMES: [&str; STATE] =
    ["x1", "v1", "x2", "v2", "x3", "v3", "x4", "v4", "x5", "v5", "x6", "v6", "x7", "v7", "x8", "v8"];

/// Returns the name and value of the first field that is not finite.
///
/// Two infinities are allowed: the exponent of a superstable cycle, and the standard error of an exponent averaged over
/// too few periods.
pub(super) fn not_finite(record: &Record, budget: &Budget) -> Option<(&'static str, f64)> {
    let is_cycle = record.period > 0;
    let averaged = record.periods_run.saturating_sub(budget.exponent_from());
    let has_no_error = !is_cycle && averaged < LEAST_FOR_ERROR;
    let fields: [(u32, &'static str, f64, Option<f64>); 4] = [
        (valid::LYAPUNOV, "lyapunov", record.lyapunov, is_cycle.then_some(f64::NEG_INFINITY)),
        (valid::LYAPUNOV, "lyapunov_error", record.lyapunov_error, has_no_error.then_some(f64::INFINITY)),
        (valid::IMPACTS, "impacts_per_period", record.impacts_per_period, None),
        (valid::MESH, "mesh_fraction", record.mesh_fraction, None),
    ];
    let strobe =
        STATE_NAMES.into_iter().zip(record.strobe()).map(|(name, value)| (valid::STROBE, name, value, None));
    let measured = measures::all()
        .map(|measure| (measure.group.bit, measure.group.name, record.measures[measure.place], None));
    let is_wrong = |&(bit, _, value, answer): &(u32, &str, f64, Option<f64>)| {
        record.valid & bit != 0 && !value.is_finite() && answer != Some(value)
    };
    fields.into_iter().chain(strobe).chain(measured).find(is_wrong).map(|(_, name, value, _)| (name, value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::orbit::Settings;

    const BUDGET: Budget = Budget {
        settings: Settings { transient_periods: 4, observed_periods: 40, max_period: 2 },
        early_stop: false,
        undecided_periods: 0,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: true,
        quantities: false,
    };

    #[test]
    fn valid_fields_are_checked_and_two_infinities_are_allowed() {
        let all = valid::PERIOD | valid::LYAPUNOV | valid::IMPACTS | valid::MESH | valid::STROBE;
        let right = Record { periods_run: 44, valid: all, ..Record::default() };
        let named = |record: Record| not_finite(&record, &BUDGET).map(|(name, _)| name);
        assert_eq!(named(right.clone()), None);
        let superstable = Record { period: 2, lyapunov: f64::NEG_INFINITY, ..right.clone() };
        assert_eq!(named(superstable.clone()), None);
        assert_eq!(named(Record { period: 0, ..superstable.clone() }), Some("lyapunov"));
        assert_eq!(named(Record { lyapunov: f64::INFINITY, ..superstable }), Some("lyapunov"));
        let unsure = Record { lyapunov_error: f64::INFINITY, periods_run: 19, ..right.clone() };
        assert_eq!(named(unsure.clone()), None);
        for wrong in [
            Record { periods_run: 20, ..unsure.clone() },
            Record { period: 1, ..unsure.clone() },
            Record { lyapunov_error: f64::NAN, ..unsure },
        ] {
            assert_eq!(named(wrong), Some("lyapunov_error"));
        }
        let unclaimed = Record { strobe: [f64::NAN; STATE].into(), ..right };
        assert_eq!(
            (named(unclaimed.clone()), named(Record { valid: valid::PERIOD, ..unclaimed })),
            (Some("x1"), None)
        );
    }
}
