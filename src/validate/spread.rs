//! Both sides say the same of motion that is on no cycle, but for its averages: do these scatter as much on the
//! reference itself?
//!
//! A record's average has to be one of those of motions that are the cell's own within rounding, over the
//! reference's periods or over the lane's: within five standard deviations of their mean, or between the least and
//! the greatest of very many. Where more cells are compared than motions are tried, some averages are rarer than one
//! in so many, and the tail of what was met is continued. To let each of many motions claim what lies within
//! standard errors of its own would find one for any record.

use super::answer::{Answer, Field};
use super::averages::{at_ends, error_over};
use super::case::Case;
use super::explanation::Explanation;
use super::lane_growth::AsLane;
use super::on_the_way::has_averages_on_the_way;
use crate::classify::classify;
use crate::orbit::Class;
use crate::record::valid;

/// Starts and parameters within rounding that are tried: of a map's many averages some are rare.
const CELLS: usize = 16_384;

/// And where what is rarer than that may do, and the tail of what was met is not known well enough to tell.
const MOST_CELLS: usize = 65_536;

/// So many give a mean and a standard deviation.
const FIRST_CELLS: usize = 128;

/// After so many, only what lies nearer to those that were met than this share of what they span can still lie
/// between them: impacts of a long chatter are rare, and many.
const NEARLY: [(usize, f64); 3] = [(FIRST_CELLS, 6.0), (1024, 2.0), (4096, 1.0)];

/// The tail of what was met: one of so many. The length in which it falls comes of 65 of 16,384 and is uncertain by an
/// eighth of itself, which at ten lengths is a factor of three.
const TAIL: usize = 250;

/// Of fewer it is not continued: the record's class is rare among these motions.
const LEAST_TAIL: usize = 4;

/// Standard errors of that length within which more cells are tried.
const LENGTH_ERRORS: f64 = 2.0;

/// An average may be as rare as is expected in one of so many maps alike; each cell has four averages, with two tails.
const RARE: f64 = 0.01;

/// Standard deviations by which one average may differ from their mean, as averages may from each other.
const DEVIATIONS: f64 = 5.0;

/// Why averages differ; none where the sides are not of one class, or on a cycle.
pub(super) fn spread(case: &Case<'_>) -> Option<Explanation> {
    let because = match case.truth.class {
        Class::Chaotic => Explanation::Chaos,
        _ => Explanation::UndecidedInBudget,
    };
    let compared = case.truth.compare(case.record, &case.bars);
    let open: Vec<Field> =
        compared.iter().filter(|(_, differs)| differs.is_some()).map(|&(field, _)| field).collect();
    // Stretches of one motion that decides nothing differ, too, and a lane may have averaged a few periods only.
    let are_counts = open.iter().all(|field| [Field::Impacts, Field::Mesh].contains(field));
    if case.truth.class == Class::Undecided && are_counts && has_averages_on_the_way(case) {
        return Some(because);
    }
    let mut spread = Spread::about(case, &open);
    let as_lane = AsLane::new(case).filter(|_| case.is_lane);
    for (tried, cell) in case.scattered_cells(MOST_CELLS).enumerate() {
        // Many of the reference's own tell no more of a lane.
        let is_first = tried <= FIRST_CELLS || as_lane.is_none();
        let measured = is_first.then(|| Answer::from(&cell.measured(&case.budget)));
        let averaged = as_lane.as_ref().and_then(|lane| lane.answer_of(&cell.flow, cell.law, cell.start));
        for answer in [measured, averaged].into_iter().flatten() {
            if answer.class.index() == case.truth.class.index() {
                spread.meets(case, &answer);
            }
        }
        if let Some(is_met) = spread.verdict(tried) {
            return is_met.then_some(because);
        }
    }
    spread.is_in_tails(0.0).then_some(because)
}

/// The averages of the record that differ, and how rare one of them may be.
struct Spread {
    ranges: Vec<(Field, Range)>,
    rare: f64,
}

impl Spread {
    fn about(case: &Case<'_>, open: &[Field]) -> Spread {
        let ranges = open.iter().map(|&field| (field, Range::about(case, field))).collect();
        Spread { ranges, rare: RARE / case.among as f64 }
    }

    fn meets(&mut self, case: &Case<'_>, answer: &Answer) {
        self.ranges.iter_mut().for_each(|(field, range)| range.meets(theirs(case, answer, *field)));
    }

    fn all(&self, holds: impl Fn(&Range) -> bool) -> bool {
        self.ranges.iter().all(|(_, range)| holds(range))
    }

    /// Whether they are averages of such motions, as soon as the motions `tried` tell.
    fn verdict(&mut self, tried: usize) -> Option<bool> {
        let gate = NEARLY.iter().find(|(after, _)| *after == tried);
        if self.all(Range::holds)
            || (tried == FIRST_CELLS && self.all(|range| range.holds() || range.is_likely()))
        {
            return Some(true);
        }
        if gate.is_some_and(|&(_, share)| !self.all(|range| range.is_near(share))) {
            return Some(false);
        }
        if tried != CELLS {
            return None;
        }
        // More cells show what is no rarer than one of them; this is about tails. Either answer has to be sure.
        let errors = if self.rare * (MOST_CELLS as f64) < 1.0 { LENGTH_ERRORS } else { 0.0 };
        let is_met = self.is_in_tails(-errors);
        (is_met || !self.is_in_tails(errors)).then_some(is_met)
    }

    /// Whether all lie among those that were met or in their tails, where these may fall in a length that is more by
    /// so many of its standard errors.
    fn is_in_tails(&mut self, errors: f64) -> bool {
        let rare = self.rare;
        self.ranges.iter_mut().all(|(_, range)| range.holds() || range.is_in_a_tail(rare, errors))
    }
}

/// Whether only averages can differ.
pub(super) fn are_of_one_class(case: &Case<'_>) -> bool {
    let classes = [classify(case.record), case.truth.class];
    [Class::Chaotic, Class::Undecided].iter().any(|class| classes == [*class; 2])
}

fn ours(case: &Case<'_>, field: Field) -> f64 {
    match field {
        Field::Exponent => case.record.lyapunov,
        Field::ExponentError => case.record.lyapunov_error,
        Field::Impacts => case.record.impacts_per_period,
        _ => case.record.mesh_fraction,
    }
}

fn theirs(case: &Case<'_>, answer: &Answer, field: Field) -> Option<f64> {
    let exponent = answer.exponent.filter(|_| case.record.valid & valid::LYAPUNOV != 0);
    match field {
        Field::Exponent => exponent.map(|[value, _]| value),
        Field::ExponentError => {
            let periods = answer.scatter?.exponent_periods;
            exponent.map(|[_, error]| error_over(case.record, &case.bars, error, periods))
        }
        Field::Impacts => answer.impacts_per_period,
        _ => answer.mesh_fraction,
    }
}

/// Where an average begins and ends is chance.
fn margin(case: &Case<'_>, field: Field) -> f64 {
    let periods = case.truth.scatter.map_or(1, |scatter| scatter.periods);
    at_ends(field) / f64::from(periods.max(1))
}

/// An average of the record, and those that were met.
struct Range {
    ours: f64,
    margin: f64,
    met: Vec<f64>,
    /// The least and the greatest of them.
    ends: [f64; 2],
    /// Standard errors scatter by factors.
    is_factor: bool,
}

impl Range {
    fn about(case: &Case<'_>, field: Field) -> Range {
        let is_factor = field == Field::ExponentError;
        let ends = [f64::INFINITY, f64::NEG_INFINITY];
        Range { ours: ours(case, field), margin: margin(case, field), met: Vec::new(), ends, is_factor }
    }

    fn meets(&mut self, theirs: Option<f64>) {
        let Some(theirs) = theirs.filter(|theirs| theirs.is_finite()) else { return };
        self.met.push(theirs);
        self.ends = [self.ends[0].min(theirs), self.ends[1].max(theirs)];
    }

    fn holds(&self) -> bool {
        let [least, most] = self.ends;
        least - self.margin <= self.ours && self.ours <= most + self.margin
    }

    /// The scale on which it scatters evenly.
    fn scale(&self, x: f64) -> f64 {
        if self.is_factor { x.max(f64::MIN_POSITIVE).ln() } else { x }
    }

    fn is_near(&self, share: f64) -> bool {
        let [least, most] = self.ends.map(|end| self.scale(end));
        let reach = self.margin + share * (most - least);
        least - reach <= self.scale(self.ours) && self.scale(self.ours) <= most + reach
    }

    /// Whether it lies in a tail, if that falls exponentially, where no smaller share than `rare` is as far out.
    fn is_in_a_tail(&mut self, rare: f64, errors: f64) -> bool {
        let tail = self.met.len() / TAIL;
        if tail < LEAST_TAIL {
            return false;
        }
        self.met.sort_by(f64::total_cmp);
        let scaled: Vec<f64> = self.met.iter().map(|&x| self.scale(x)).collect();
        let (below, above) = (&scaled[..=tail], &scaled[scaled.len() - 1 - tail..]);
        let [low, high] = [below[tail], above[0]];
        // The mean of an exponential distribution is the length in which it falls by e.
        let length =
            |list: &[f64], from: f64| list.iter().map(|x| (x - from).abs()).sum::<f64>() / tail as f64;
        let longer = 1.0 + errors / (tail as f64).sqrt();
        let lengths = longer * (tail as f64 / scaled.len() as f64 / rare).ln().max(0.0);
        let ours = self.scale(self.ours);
        low - lengths * length(below, low) <= ours && ours <= high + lengths * length(above, high)
    }

    fn is_likely(&self) -> bool {
        let count = self.met.len() as f64;
        let mean = self.met.iter().map(|&x| self.scale(x)).sum::<f64>() / count;
        let variance = self.met.iter().map(|&x| (self.scale(x) - mean).powi(2)).sum::<f64>() / (count - 1.0);
        // Of a few there is no deviation to speak of.
        2 * self.met.len() > FIRST_CELLS
            && (self.scale(self.ours) - mean).abs() <= DEVIATIONS * variance.sqrt() + self.margin
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Averages that fall exponentially, by e in a length of 1, and a record's beyond nearly all of them.
    fn verdict(ours: f64, rare: f64) -> Option<bool> {
        let met: Vec<f64> = (0..CELLS).map(|k| -((k as f64 + 0.5) / CELLS as f64).ln()).collect();
        let ends = [met[CELLS - 1], met[0]];
        let range = Range { ours, margin: 0.0, met, ends, is_factor: false };
        Spread { ranges: vec![(Field::Impacts, range)], rare }.verdict(CELLS)
    }

    #[test]
    fn the_length_of_a_tail_decides_where_it_is_sure() {
        // One of 250 is beyond 5.5; from there to one in 50,000 are 5.3 lengths, to one in 10^7 10.6.
        assert_eq!(verdict(10.7, 2e-5), Some(true));
        assert_eq!(verdict(11.1, 2e-5), Some(false));
        // A quarter of these more or less are two standard errors of the length.
        assert_eq!(verdict(13.0, 1e-7), Some(true));
        assert_eq!(verdict(14.5, 1e-7), None);
        assert_eq!(verdict(18.0, 1e-7), None);
        assert_eq!(verdict(19.5, 1e-7), Some(false));
    }

    #[test]
    fn what_was_met_is_nobodys_tail() {
        let most = -(0.5 / CELLS as f64).ln();
        assert_eq!(verdict(most, 0.5), Some(true));
        assert_eq!(verdict(most + 1.0, 0.01), Some(false));
    }
}
