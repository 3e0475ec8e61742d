//! The lines printed when a map is done.

use crate::cli::say::quoted;
use crate::map::engine::CardReport;
use crate::map::plan::count_classes;
use crate::map::schedule::{Deviation, Errors, Refined};
use crate::show::cells::Cells;
use crate::store;

/// What was done, how fast, and what came out.
pub(super) fn summary(
    cells: &Cells<'_>,
    run: &store::map::Run<'_>,
    lane_steps: Option<u64>,
    seconds: f64,
) -> String {
    let (count, [columns, rows]) = (cells.runs(), cells.counts());
    let unit = if count > columns * rows { "runs" } else { "cells" };
    let integrated = cells.refinement().map_or(count, |refined| refined.integrated);
    let integrating = run.elapsed.as_secs_f64().max(1e-9);
    let here = (integrated - run.resumed_cells) as f64;
    let periods = cells.periods() as f64 * here / integrated as f64;
    let [periodic, chaotic, undecided, failed] = count_classes(cells.classes());
    let resumed = match run.resumed_cells {
        0 => String::new(),
        cells => format!(", {cells} of them kept before,"),
    };
    let per_step = lane_steps.filter(|&steps| steps > 0).map_or(String::new(), |steps| {
        format!(", {} ns per step", rounded(1e9 * integrating / steps as f64))
    });
    let refined = cells.refinement().map_or(String::new(), |refined| refinement(refined, count));
    let cards = by_card(&run.cards, unit);
    format!(
        "{integrated} {unit}{resumed} in {integrating:.3} s on {} ({}): {:.0} {unit}/s, {:.0} forcing periods/s\
         {per_step}; files written in {:.3} s\n{cards}{refined}\
         {periodic} periodic, {chaotic} chaotic, {undecided} undecided, {failed} failed",
        run.made.engine,
        run.made.precision,
        here / integrating,
        periods / integrating,
        seconds - integrating,
    )
}

/// What each of several cards did, a line each.
pub(super) fn by_card(cards: &[CardReport], unit: &str) -> String {
    let line = |CardReport { adapter, cells, lost }: &CardReport| {
        let lost = lost.as_ref().map_or(String::new(), |reason| format!(", then lost: {reason}"));
        quoted(format_args!("  adapter {adapter}: {cells} {unit}{lost}")) + "\n"
    };
    cards.iter().map(line).collect()
}

/// Three significant digits.
fn rounded(x: f64) -> String {
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{x:.digits$}")
}

/// A difference in few digits.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-3..1e3).contains(&x) {
        format!("{}", (x * 1e4).round() / 1e4)
    } else {
        format!("{x:.1e}")
    }
}

/// How much an adaptive map left out, and what the audit says of it.
fn refinement(refined: &Refined, count: usize) -> String {
    let share = 100.0 * refined.integrated as f64 / count as f64;
    let audit = refined.audits.last().map_or(String::new(), |audit| {
        let [low, high] = audit.interval().map(|rate| 100.0 * rate);
        let (wrong, sampled, rate) = (audit.wrong, audit.sampled, 100.0 * audit.rate());
        let spelled = |wrong: usize, filled: usize, what: &str| match filled {
            0 => String::new(),
            _ => format!(", {wrong} of {filled} filled {what}"),
        };
        let words = spelled(audit.wrong_words, audit.words, "words")
            + &spelled(audit.wrong_patterns, audit.patterns, "patterns");
        let failed = if audit.rate() > refined.max_error {
            let allowed = 100.0 * refined.max_error;
            format!(", more than the {allowed:.2} % of refine.max_error, but refine.rounds lets no block be halved again")
        } else {
            String::new()
        };
        format!(
            "; audit: {wrong} of {sampled} filled cells wrong, {rate:.2} % (95 %: {low:.2} to {high:.2} %){words}{failed}{}",
            errors(&audit.errors)
        )
    });
    format!("{share:.1} % of {count} cells integrated, the others filled{audit}\n")
}

/// By how much filled values are off, a line for each quantity.
fn errors(errors: &Errors) -> String {
    let line = |name: &str, deviation: Option<Deviation>, share: fn(&Deviation) -> String| {
        let Some(deviation) = deviation else { return String::new() };
        let Deviation { compared, empty, median, p95, worst, .. } = deviation;
        let left = if empty > 0 { format!(", {empty} left empty") } else { String::new() };
        let share = share(&deviation);
        format!(
            "\n{name} of {compared} filled cells{left}: off by {} in the median, {} at 95 %, {} at worst{share}",
            short(median),
            short(p95),
            short(worst)
        )
    };
    let off_by_one = |impacts: &Deviation| {
        let (off, rate) = (impacts.off_by_one, 100.0 * impacts.off_by_one_rate());
        let [low, high] = impacts.off_by_one_interval().map(|rate| 100.0 * rate);
        format!("; by 1 or more in {off}, {rate:.2} % (95 %: {low:.2} to {high:.2} %)")
    };
    [
        line("exponent", errors.lyapunov, |_| String::new()),
        line("impacts per period", errors.impacts, off_by_one),
        line("mesh fraction", errors.mesh, |_| String::new()),
    ]
    .concat()
}
