//! Are two averages those of the same motion, where it is on no cycle?
//!
//! Both sides average the motion over different stretches, and after some periods of chaos over different
//! motions of one kind. How far such averages scatter is measured on the reference ([`Scatter`]): standard errors
//! from block means. What a record says of its own error widens no bar beyond what the reference's is; it is
//! compared itself.

use super::answer::{Answer, Bars, Compared, Field, Value, compared};
use crate::orbit::Scatter;
use crate::record::{Record, valid};

/// Standard errors by which two averages of the same motion may differ.
const SAME_ERRORS: f64 = 5.0;

/// What two exponents may differ by beside that, per forcing period: standard errors from 16 blocks are
/// themselves uncertain, and tangents are measured in other units.
const EXPONENT_FLOOR: f64 = 0.01;

/// Standard errors of eight blocks differ by less than this factor, 99 times of 100.
pub(super) const UNSURE: f64 = 3.0;

/// What standard errors may differ by beside that, per forcing period.
const ERROR_FLOOR: f64 = 0.002;

/// The fewest forcing periods over which the record's impacts are whole, and the most that its averages may span: a
/// lane may have begun anew.
fn counted_between(record: &Record, bars: &Bars) -> [u32; 2] {
    let longest = record.periods_run.saturating_sub(bars.exponent_from).max(1);
    let is_whole = |periods: &u32| {
        let impacts = record.impacts_per_period * f64::from(*periods);
        (impacts - impacts.round()).abs() <= bars.impacts * f64::from(*periods)
    };
    let shortest = (1..=longest).find(is_whole).filter(|_| record.valid & valid::IMPACTS != 0);
    [shortest.unwrap_or(1), longest]
}

/// As many as they may span at most.
pub(super) fn counted(record: &Record, bars: &Bars) -> u32 {
    let [shortest, longest] = counted_between(record, bars);
    longest / shortest * shortest
}

/// The standard error that an exponent would have over the record's periods, from one over `periods`. A lane that was
/// sent on from a cycle which repels began anew, and does not tell when: then its own error is the best guess of how
/// many periods it means, among those over which its impacts are whole.
pub(super) fn error_over(record: &Record, bars: &Bars, error: f64, periods: u32) -> f64 {
    let [shortest, longest] = counted_between(record, bars);
    let most = f64::from(longest / shortest * shortest);
    let guess = f64::from(periods) * (error / record.lyapunov_error).powi(2);
    let multiple = (guess / f64::from(shortest)).round().max(1.0) * f64::from(shortest);
    let own = if multiple.is_finite() {
        multiple.clamp(f64::from(bars.least_counted).min(most), most)
    } else {
        most
    };
    error * (f64::from(periods.max(1)) / own).sqrt()
}

/// Whether an exponent is the record's: within standard errors of the reference's making.
pub(super) fn is_same_exponent(
    record: &Record,
    bars: &Bars,
    [theirs, error]: [f64; 2],
    periods: u32,
) -> bool {
    let likely = error_over(record, bars, error, periods);
    let own = record.lyapunov_error.min(likely);
    let bar = SAME_ERRORS * error.hypot(own) + EXPONENT_FLOOR / bars.forcing_period;
    (record.lyapunov - theirs).abs() <= bar
}

/// Whether the record's standard error may be that of the reference's motion.
pub(super) fn is_same_error(record: &Record, bars: &Bars, error: f64, periods: u32) -> bool {
    let likely = error_over(record, bars, error, periods);
    let (own, floor) = (record.lyapunov_error, ERROR_FLOOR / bars.forcing_period);
    own <= UNSURE * likely + floor && likely <= UNSURE * own + floor
}

impl Answer {
    /// Compares averages of motion that both sides say is on no cycle.
    pub(super) fn compare_averages(&self, record: &Record, bars: &Bars, list: &mut Vec<Compared>) {
        let Some(Scatter { exponent_periods, periods, errors }) = self.scatter else { return };
        let has = |bit| record.valid & bit != 0;
        if let (true, Some([theirs, error])) = (has(valid::LYAPUNOV), self.exponent)
            && error.is_finite()
        {
            let same = is_same_exponent(record, bars, [theirs, error], exponent_periods);
            list.push(compared(Field::Exponent, same, || numbers(record.lyapunov, theirs)));
            let same = is_same_error(record, bars, error, exponent_periods);
            list.push(compared(Field::ExponentError, same, || numbers(record.lyapunov_error, error)));
        }
        let averages = [
            (Field::Impacts, valid::IMPACTS, record.impacts_per_period, self.impacts_per_period),
            (Field::Mesh, valid::MESH, record.mesh_fraction, self.mesh_fraction),
        ];
        for ((field, bit, ours, theirs), error) in averages.into_iter().zip(errors) {
            if let (true, Some(theirs), true) = (has(bit), theirs, error.is_finite()) {
                let bar = SAME_ERRORS * error.hypot(error) + at_ends(field) / f64::from(periods.max(1));
                let bar = bar.min(most(field, ours.max(theirs)));
                list.push(compared(field, (ours - theirs).abs() <= bar, || numbers(ours, theirs)));
            }
        }
    }
}

/// No bar is wider, however few periods there are to measure scatter on.
fn most(field: Field, average: f64) -> f64 {
    match field {
        Field::Impacts => 0.25 * average + 0.3,
        _ => 0.1,
    }
}

/// What the ends of an averaged stretch decide on: so many impacts, and a period's meshing.
pub(super) fn at_ends(field: Field) -> f64 {
    match field {
        Field::Impacts => 2.0,
        Field::Mesh => 1.0,
        _ => 0.0,
    }
}

fn numbers(ours: f64, theirs: f64) -> (Value, Value) {
    (Value::Number(ours), Value::Number(theirs))
}

/// Whether averages of two motions of the reference, which are on no cycle, differ by more than they scatter.
pub(super) fn is_other_chaos(a: &Answer, b: &Answer) -> bool {
    let errors = |answer: &Answer| answer.scatter.map(|scatter| scatter.errors);
    let exponents = a.exponent.zip(b.exponent);
    let counts = errors(a).zip(errors(b)).map(|(ours, theirs)| [0, 1].map(|i| ours[i].hypot(theirs[i])));
    let [impacts, mesh] = counts.unwrap_or([f64::INFINITY; 2]);
    let differ = |ours: Option<f64>, theirs: Option<f64>, error: f64| {
        ours.zip(theirs).is_some_and(|(ours, theirs)| (ours - theirs).abs() > SAME_ERRORS * error)
    };
    exponents.is_some_and(|([ours, e], [theirs, f])| differ(Some(ours), Some(theirs), e.hypot(f)))
        || differ(a.impacts_per_period, b.impacts_per_period, impacts)
        || differ(a.mesh_fraction, b.mesh_fraction, mesh)
}
