//! Refinement of an adaptive map as JSON, in manifests and in the report.

use serde::Serialize;

use crate::map::schedule::{Audit, Deviation, Refined};

/// Numbers of integrated and filled cells of an adaptive map, and the audits of the filled ones.
#[derive(Serialize)]
pub(crate) struct RefinementObject {
    integrated: usize,
    filled: usize,
    rounds: usize,
    audits: Vec<AuditObject>,
}

/// An audit: a random sample of filled cells was integrated. `rate` is the share of wrong cells and `interval` its 95 %
/// interval (Wilson). `words` counts sampled cells that had been filled with a word, `wrong_words` those whose word was
/// wrong; `patterns` and `wrong_patterns` count patterns.
#[derive(Serialize)]
struct AuditObject {
    filled: usize,
    sampled: usize,
    wrong: usize,
    rate: f64,
    interval: [f64; 2],
    words: usize,
    wrong_words: usize,
    patterns: usize,
    wrong_patterns: usize,
    errors: ErrorsObject,
}

/// Absolute differences between filled and integrated values of the sampled cells; null where filled cells have no such
/// value.
#[derive(Serialize)]
struct ErrorsObject {
    lyapunov: Option<DeviationObject>,
    impacts_per_period: Option<DeviationObject>,
    mesh_fraction: Option<DeviationObject>,
}

/// Differences of one quantity. `empty` counts cells that were filled without a value; they are not `compared`.
#[derive(Serialize)]
struct DeviationObject {
    compared: usize,
    empty: usize,
    median: f64,
    p95: f64,
    worst: f64,
    #[serde(flatten)]
    off_by_one: Option<OffByOneObject>,
}

/// Cells whose impacts per period differ by 1 or more.
#[derive(Serialize)]
struct OffByOneObject {
    off_by_one: usize,
    off_by_one_rate: f64,
    off_by_one_interval: [f64; 2],
}

impl DeviationObject {
    fn of(deviation: Deviation) -> DeviationObject {
        let Deviation { compared, empty, median, p95, worst, .. } = deviation;
        DeviationObject { compared, empty, median, p95, worst, off_by_one: None }
    }

    fn of_counts(deviation: Deviation) -> DeviationObject {
        let off_by_one = OffByOneObject {
            off_by_one: deviation.off_by_one,
            off_by_one_rate: deviation.off_by_one_rate(),
            off_by_one_interval: deviation.off_by_one_interval(),
        };
        DeviationObject { off_by_one: Some(off_by_one), ..DeviationObject::of(deviation) }
    }
}

impl From<&Refined> for RefinementObject {
    fn from(refined: &Refined) -> Self {
        let audit = |audit: &Audit| AuditObject {
            filled: audit.filled,
            sampled: audit.sampled,
            wrong: audit.wrong,
            rate: audit.rate(),
            interval: audit.interval(),
            words: audit.words,
            wrong_words: audit.wrong_words,
            patterns: audit.patterns,
            wrong_patterns: audit.wrong_patterns,
            errors: ErrorsObject {
                lyapunov: audit.errors.lyapunov.map(DeviationObject::of),
                impacts_per_period: audit.errors.impacts.map(DeviationObject::of_counts),
                mesh_fraction: audit.errors.mesh.map(DeviationObject::of),
            },
        };
        let Refined { integrated, filled, rounds, ref audits, .. } = *refined;
        RefinementObject { integrated, filled, rounds, audits: audits.iter().map(audit).collect() }
    }
}
