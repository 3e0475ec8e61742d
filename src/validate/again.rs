//! Does the reference compute a map of its own once more as it was?
//!
//! A record of the CPU engine depends on its cell and start alone, to the bit, on one kind of processor. Where most
//! records of a sample come out the same to the bit, arithmetic is the same, and any other difference is a
//! fault: nothing explains it. Otherwise the map is from a processor that rounds differently. Then every
//! field is compared within bars, statuses and periods exactly; and a difference needs a start or a parameter, moved
//! by no more than rounding, that gives the whole record. What the record itself says is no evidence: it was
//! computed from the cell's start, not from its own end.

use super::answer::{Answer, Compared, Difference, Field, Value, compared};
use super::case::{Case, rounding};
use super::explanation::Explanation;
use crate::classify::classify;
use crate::engine::measured_record;
use crate::flow::Flow;
use crate::orbit::{Class, Measured, measure};
use crate::plan::Needs;
use crate::record::{Record, valid};

/// A state may lie so many times as far off as one that is moved within rounding.
const STATE_SHARE: f64 = 2.0;

/// Starts within rounding, beside those along coordinates.
const SCATTERED_STARTS: usize = 64;

/// What the engine makes of the replay.
pub(super) fn own_record(case: &Case<'_>, needs: &Needs) -> Record {
    measured_record(&case.measured, needs)
}

/// Every field, and whether two records have the same bits there.
pub(super) fn bit_by_bit(ours: &Record, theirs: &Record) -> Vec<Compared> {
    let count = |a: u32, b: u32| (Value::Count(a), Value::Count(b));
    let number = |a: f64, b: f64| (Value::Number(a), Value::Number(b));
    let word = |record: &Record| Value::Text(record.spelling().map_or_else(String::new, |word| word.text()));
    let [own, other] = [ours, theirs].map(classify);
    let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
    let is_same_word =
        (ours.word, ours.word_hash, ours.word_length) == (theirs.word, theirs.word_hash, theirs.word_length);
    let state = ours.strobe.iter().zip(&theirs.strobe).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let is_same_state = ours.strobe.iter().zip(theirs.strobe).all(|(&a, b)| same(a, b));
    let is_kept = (ours.valid, ours.reserved) == (theirs.valid, theirs.reserved);
    vec![
        compared(Field::Class, own.index() == other.index(), || {
            (Value::Text(own.name().into()), Value::Text(other.name().into()))
        }),
        compared(Field::Period, ours.period == theirs.period, || count(ours.period, theirs.period)),
        compared(Field::Word, is_same_word, || (word(ours), word(theirs))),
        compared(Field::Symmetric, ours.symmetric == theirs.symmetric, || {
            (Value::Flag(ours.symmetric != 0), Value::Flag(theirs.symmetric != 0))
        }),
        compared(Field::Exponent, same(ours.lyapunov, theirs.lyapunov), || {
            number(ours.lyapunov, theirs.lyapunov)
        }),
        compared(Field::ExponentError, same(ours.lyapunov_error, theirs.lyapunov_error), || {
            number(ours.lyapunov_error, theirs.lyapunov_error)
        }),
        compared(Field::Impacts, same(ours.impacts_per_period, theirs.impacts_per_period), || {
            number(ours.impacts_per_period, theirs.impacts_per_period)
        }),
        compared(Field::Mesh, same(ours.mesh_fraction, theirs.mesh_fraction), || {
            number(ours.mesh_fraction, theirs.mesh_fraction)
        }),
        compared(Field::Status, ours.status == theirs.status, || count(ours.status, theirs.status)),
        compared(Field::Periods, ours.periods_run == theirs.periods_run, || {
            count(ours.periods_run, theirs.periods_run)
        }),
        compared(Field::Kept, is_kept, || count(ours.valid, theirs.valid)),
        compared(Field::State, is_same_state, || number(state, 0.0)),
    ]
}

/// The same within what another processor may round.
pub(super) fn within_bars(case: &Case<'_>, needs: &Needs) -> Vec<Compared> {
    let (ours, theirs) = (case.record, own_record(case, needs));
    let mut list = case.truth.compare(ours, &case.bars);
    let exact = bit_by_bit(ours, &theirs);
    list.extend(
        exact.into_iter().filter(|(field, _)| [Field::Status, Field::Periods, Field::Kept].contains(field)),
    );
    if ours.valid & valid::STROBE != 0 {
        let apart = case.apart(&theirs.strobe, &ours.strobe);
        let least = rounding(case.precision);
        // Most are that close; what rounding moves farther is more work to tell.
        let bar = if apart <= least { least } else { least.max(STATE_SHARE * moved_state(case)) };
        list.push(compared(Field::State, apart <= bar, || (Value::Number(apart), Value::Number(bar))));
    }
    list
}

/// How far the last state moves, relative to the motion, with starts and parameters that are moved within rounding.
fn moved_state(case: &Case<'_>) -> f64 {
    let is_alike = |measured: &Measured| {
        measured.period == case.measured.period && measured.periods_run == case.measured.periods_run
    };
    let states =
        moved(case, 0).filter(is_alike).map(|measured| case.apart(&case.measured.strobe, &measured.strobe));
    states.fold(0.0, f64::max)
}

/// What the reference measures of starts and parameters that are moved within rounding.
fn moved<'c>(case: &'c Case<'_>, scattered: usize) -> impl Iterator<Item = Measured> + 'c {
    let nudged = (0..8).map(|k| case.nudged_start(k)).chain(case.scattered_starts(scattered));
    let starts = nudged.map(|start| measure(&case.flow, case.law, start, &case.budget));
    let parameters = case.nudged_pairs(rounding(case.precision)).filter_map(|pair| {
        let flow = Box::new(Flow::new(&pair.oscillator().ok()?));
        Some(measure(&flow, pair.law(), case.start, &case.budget))
    });
    starts.chain(parameters)
}

/// A start or a parameter that is the same within rounding gives the whole record.
pub(super) fn explain(case: &Case<'_>, differences: &[Difference], needs: &Needs) -> Option<Explanation> {
    // Nothing moves the strobe alone.
    if differences.iter().all(|difference| [Field::State, Field::Kept].contains(&difference.field)) {
        return None;
    }
    let is_the_record = |measured: &Measured| {
        let other = measured_record(measured, needs);
        let is_near = || match classify(case.record) {
            // A state of chaos is any of many.
            Class::Periodic { .. } => {
                case.apart(&other.strobe, &case.record.strobe) <= (STATE_SHARE * moved_state(case)).max(1e-9)
            }
            _ => true,
        };
        case.is_the_records(&Answer::from(measured))
            && (other.status, other.periods_run, other.valid)
                == (case.record.status, case.record.periods_run, case.record.valid)
            && is_near()
    };
    let chaotic = [classify(case.record), case.truth.class].contains(&Class::Chaotic);
    let because = if chaotic { Explanation::Chaos } else { Explanation::Border };
    moved(case, SCATTERED_STARTS).any(|measured| is_the_record(&measured)).then_some(because)
}
