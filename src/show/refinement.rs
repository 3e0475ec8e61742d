//! Refinement of an adaptive map: as JSON for manifests, and as text.

use std::iter;

use serde_json::{Value, json};

use crate::map::schedule::{Audit, Deviation, Errors, Refined};
use crate::model_file::subjects;
use crate::record::measures::{self, Subjects};
use crate::show::cells::Cells;

/// Returns the numbers of integrated and filled cells of an adaptive map, and the audits of the filled ones; none for other maps.
pub fn object(cells: &Cells<'_>) -> Option<Value> {
    let names = subjects(cells.scene().base());
    let Refined { integrated, filled, rounds, ref audits, .. } = *cells.refinement()?;
    let audits: Vec<Value> = audits.iter().map(|one| audit(one, &names)).collect();
    Some(json!({ "integrated": integrated, "filled": filled, "rounds": rounds, "audits": audits }))
}

/// Returns an audit: a random sample of filled cells was integrated. `rate` is the share of wrong cells and `interval` its 95 %
/// interval (Wilson). `words` counts sampled cells that had been filled with a word, `wrong_words` those whose word was wrong;
/// `patterns` and `wrong_patterns` count patterns. `errors` are null where filled cells have no such value; measured quantities
/// have an entry if the scene requests them.
fn audit(audit: &Audit, names: &Subjects) -> Value {
    let mut object = json!({
        "filled": audit.filled,
        "sampled": audit.sampled,
        "wrong": audit.wrong,
        "rate": audit.rate(),
        "interval": audit.interval(),
        "words": audit.words,
        "wrong_words": audit.wrong_words,
        "patterns": audit.patterns,
        "wrong_patterns": audit.wrong_patterns,
        "errors": {
            "lyapunov": audit.errors.lyapunov.map(|deviation| deviations(deviation, false)),
            "impacts_per_period": audit.errors.impacts.map(|deviation| deviations(deviation, true)),
            "mesh_fraction": audit.errors.mesh.map(|deviation| deviations(deviation, false)),
        },
    });
    for measure in measures::all().filter(|measure| measure.is_of(names)) {
        if let Some(deviation) = audit.errors.measures[measure.place] {
            object["errors"][measure.name(names)] = deviations(deviation, false);
        }
    }
    object
}

/// Returns absolute differences between filled and integrated values. `empty` counts cells that were filled without a value;
/// they are not `compared`. For counts, `off_by_one` is the number of differences of 1 or more.
fn deviations(deviation: Deviation, are_counts: bool) -> Value {
    let Deviation { compared, empty, median, p95, worst, .. } = deviation;
    let mut object =
        json!({ "compared": compared, "empty": empty, "median": median, "p95": p95, "worst": worst });
    if are_counts {
        object["off_by_one"] = deviation.off_by_one.into();
        object["off_by_one_rate"] = deviation.off_by_one_rate().into();
        object["off_by_one_interval"] = json!(deviation.off_by_one_interval());
    }
    object
}

/// Formats a difference with few digits.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-3..1e3).contains(&x) {
        format!("{}", (x * 1e4).round() / 1e4)
    } else {
        format!("{x:.1e}")
    }
}

/// Returns what an adaptive map reports: the share of integrated cells and the result of the last audit, then one line per
/// quantity; nothing for other maps.
pub fn lines(cells: &Cells<'_>) -> Vec<String> {
    let Some(refined) = cells.refinement() else { return Vec::new() };
    let count = cells.runs();
    let share = 100.0 * refined.integrated as f64 / count as f64;
    let audit = refined.audits.last().map_or(String::new(), |audit| {
        let [low, high] = audit.interval().map(|rate| 100.0 * rate);
        let (wrong, sampled, rate) = (audit.wrong, audit.sampled, 100.0 * audit.rate());
        let words = |wrong: usize, filled: usize, what: &str| match filled {
            0 => String::new(),
            _ => format!(", {wrong} of {filled} filled {what}"),
        };
        let words = words(audit.wrong_words, audit.words, "words")
            + &words(audit.wrong_patterns, audit.patterns, "patterns");
        let exceeds = if audit.rate() > refined.max_error {
            let allowed = 100.0 * refined.max_error;
            format!(
                ", more than refine.max_error allows ({allowed:.2} %): refine.rounds is too small"
            )
        } else {
            String::new()
        };
        format!(
            "; audit: {wrong} of {sampled} filled cells wrong, {rate:.2} % (95 %: {low:.2} to {high:.2} %){words}{exceeds}"
        )
    });
    let first = format!("{share:.1} % of {count} cells integrated, the others filled{audit}");
    let names = subjects(cells.scene().base());
    let errors = refined.audits.last().into_iter().flat_map(|audit| errors(&audit.errors, &names));
    iter::once(first).chain(errors).collect()
}

/// One line per quantity: how far filled values differ from integrated ones.
fn errors(errors: &Errors, names: &Subjects) -> Vec<String> {
    let line = |name: &str, deviation: Option<Deviation>, share: fn(&Deviation) -> String| {
        let deviation = deviation?;
        let Deviation { compared, empty, median, p95, worst, .. } = deviation;
        let empty = if empty > 0 { format!(", {empty} left empty") } else { String::new() };
        let share = share(&deviation);
        Some(format!(
            "{name} of {compared} filled cells{empty}: the error is {} in the median, {} at 95 %, {} at most{share}",
            short(median),
            short(p95),
            short(worst)
        ))
    };
    let off_by_one = |impacts: &Deviation| {
        let (off, rate) = (impacts.off_by_one, 100.0 * impacts.off_by_one_rate());
        let [low, high] = impacts.off_by_one_interval().map(|rate| 100.0 * rate);
        format!("; 1 or more in {off} cells, {rate:.2} % (95 %: {low:.2} to {high:.2} %)")
    };
    let first = [
        line("exponent", errors.lyapunov, |_| String::new()),
        line("impacts per period", errors.impacts, off_by_one),
        line("mesh fraction", errors.mesh, |_| String::new()),
    ];
    let measures = measures::all().filter(|measure| measure.is_of(names));
    let measured =
        measures.map(|measure| line(&measure.name(names), errors.measures[measure.place], |_| String::new()));
    first.into_iter().chain(measured).flatten().collect()
}
