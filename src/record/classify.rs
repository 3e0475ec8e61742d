//! Classes of cells, from their records. The same record always has the same class.
//!
//! A motion is
//!
//! - `failed` if the integration could not continue (`cap_events`, `cap_root`, `too_stiff`, `non_finite`,
//!   `escape`);
//! - `periodic` if the engine confirmed a period. Recurrence of strobe states is not enough: the orbit must be
//!   stable;
//! - `chaotic` if there is no period, the exponent exceeds zero by [`CHAOS_ERRORS`] standard errors, and the motion
//!   did not stay near a cycle (status `slow` or `neutral`);
//! - `quasi-periodic` if the engine found an exponent of zero and a regular section;
//! - `undecided` otherwise: near bifurcations, in long transients, on cycles longer than `max_period`, if the
//!   exponent is clearly negative, and near cycles with a multiplier of modulus 1 (status `neutral`).
//!
//! Two motions are wrongly called chaotic: transient chaos that outlasts the budget (`confirm_chaos` extends it), and motion that grows without
//! bound, as of undamped elastic pairs.

use crate::record::{Record, valid};
pub use rattlemap_dynamics::orbit::CHAOS_ERRORS;
use rattlemap_dynamics::orbit::{Class, Status};

/// Returns the class of a record.
pub fn classify(record: &Record) -> Class {
    match status(record) {
        status if status.is_failure() => Class::Failed,
        _ if record.valid & valid::PERIOD != 0 && record.period > 0 => {
            Class::Periodic { period: record.period }
        }
        _ if record.valid & valid::QUASI_PERIODIC != 0 => Class::QuasiPeriodic,
        Status::Slow | Status::Neutral | Status::Accelerates | Status::UnstableCycle => Class::Undecided,
        _ if grows(record) => Class::Chaotic,
        _ => Class::Undecided,
    }
}

/// Returns how the integration of a record ended. An unknown code can only come from a damaged record and counts as
/// not finite.
pub fn status(record: &Record) -> Status {
    Status::from_code(record.status).unwrap_or(Status::NonFinite)
}

/// Gives the status `simultaneous` to a record of a motion in which two gaps reached their walls at the same time, unless a status of higher
/// rank says why the motion is undecided.
pub(crate) fn mark_tied(record: &mut Record) {
    let is_decided = record.period > 0 || record.valid & valid::QUASI_PERIODIC != 0;
    let status = status(record);
    if !status.is_failure() && (is_decided || matches!(status, Status::Ok | Status::StrobeOnEvent)) {
        record.status = Status::Simultaneous.code();
    }
}

fn grows(record: &Record) -> bool {
    record.valid & valid::LYAPUNOV != 0 && record.lyapunov > CHAOS_ERRORS * record.lyapunov_error
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(status: Status, period: u32, lyapunov: f64, lyapunov_error: f64) -> Record {
        let valid = valid::PERIOD | valid::LYAPUNOV;
        Record { status: status.code(), period, lyapunov, lyapunov_error, valid, ..Record::default() }
    }

    #[test]
    fn every_class_has_its_records() {
        let regular = |status, period| {
            let valid = valid::PERIOD | valid::QUASI_PERIODIC;
            Record { valid, ..record(status, period, 0.0, 0.01) }
        };
        let cases = [
            (record(Status::Ok, 3, -0.1, 0.0), Class::Periodic { period: 3 }),
            (record(Status::Slow, 2, -0.1, 0.0), Class::Periodic { period: 2 }),
            (record(Status::StrobeOnEvent, 0, 0.2, 0.01), Class::Chaotic),
            (record(Status::Ok, 0, 0.02, 0.01), Class::Undecided),
            (record(Status::Ok, 0, 0.2, f64::INFINITY), Class::Undecided),
            (record(Status::Ok, 0, f64::NAN, 0.0), Class::Undecided),
            (record(Status::Slow, 0, 0.2, 0.01), Class::Undecided),
            (record(Status::Neutral, 0, 0.2, 0.01), Class::Undecided),
            (record(Status::Neutral, 1, 0.0, 0.0), Class::Periodic { period: 1 }),
            (regular(Status::Ok, 0), Class::QuasiPeriodic),
            (regular(Status::Ok, 2), Class::Periodic { period: 2 }),
            (regular(Status::TooStiff, 0), Class::Failed),
        ];
        for (record, class) in cases {
            assert_eq!(classify(&record), class, "{record:?}");
        }
        let unmeasured = Record { valid: valid::PERIOD, ..record(Status::Ok, 0, 0.2, 0.01) };
        assert_eq!(classify(&unmeasured), Class::Undecided);
    }

    #[test]
    fn a_tie_is_reported_unless_a_motion_is_undecided_for_another_reason() {
        let marked = |status, period| {
            let mut record = record(status, period, 0.2, 0.01);
            mark_tied(&mut record);
            Status::from_code(record.status).unwrap()
        };
        for status in [Status::Ok, Status::StrobeOnEvent] {
            assert_eq!([0, 2].map(|period| marked(status, period)), [Status::Simultaneous; 2]);
        }
        for status in [Status::Slow, Status::Neutral] {
            assert_eq!([0, 2].map(|period| marked(status, period)), [status, Status::Simultaneous]);
        }
        assert_eq!(marked(Status::Escape, 0), Status::Escape);
    }

    #[test]
    fn exactly_five_statuses_are_failures() {
        let failures =
            [Status::CapEvents, Status::CapRoot, Status::TooStiff, Status::NonFinite, Status::Escape];
        for status in Status::ALL {
            let failed = classify(&record(status, 1, 0.2, 0.01)) == Class::Failed;
            assert_eq!(failed, failures.contains(&status), "{status:?}");
        }
        assert_eq!(classify(&Record { status: 99, ..Record::default() }), Class::Failed);
    }
}
