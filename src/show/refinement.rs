//! Refinement of an adaptive map as JSON, in manifests and in the report.

use serde_json::{Value, json};

use crate::map::schedule::{Audit, Deviation, Refined};
use crate::record::measures;
use crate::show::cells::Cells;

/// Returns the numbers of integrated and filled cells of an adaptive map, and the audits of the filled ones; none for other maps.
pub fn object(cells: &Cells<'_>) -> Option<Value> {
    let state_names = &cells.scene().base().state_names();
    let Refined { integrated, filled, rounds, ref audits, .. } = *cells.refinement()?;
    let audits: Vec<Value> = audits.iter().map(|one| audit(one, state_names)).collect();
    Some(json!({ "integrated": integrated, "filled": filled, "rounds": rounds, "audits": audits }))
}

/// Returns an audit: a random sample of filled cells was integrated. `rate` is the share of wrong cells and `interval` its 95 %
/// interval (Wilson). `words` counts sampled cells that had been filled with a word, `wrong_words` those whose word was wrong;
/// `patterns` and `wrong_patterns` count patterns. `errors` are null where filled cells have no such value; measured quantities
/// have an entry if the scene requests them.
fn audit(audit: &Audit, state_names: &[&str]) -> Value {
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
    for measure in measures::all().filter(|measure| measure.is_of(state_names)) {
        if let Some(deviation) = audit.errors.measures[measure.place] {
            object["errors"][measure.name(state_names)] = deviations(deviation, false);
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
