//! Comparison of two maps of one grid, cell by cell. Pure.
//!
//! It shows hysteresis between maps with policies up and down, and differences between engines or versions. Cells
//! differ by class or period; cells that agree in both can still differ by pattern, by motion or by quantities. Symmetry,
//! words and exponents of cycles of one period are counted separately.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::record::classify::classify;
use crate::record::distance::apart;
use crate::record::measures::Dimension;
use crate::record::{Record, Records, Spelling, valid};
use rattlemap_dynamics::named;
use rattlemap_dynamics::orbit::Class;
use rattlemap_dynamics::word::Word;

named! {
    /// Kinds of differences between two motions.
    pub enum Kind {
        /// Different classes.
        Class = "class",
        /// Different periods.
        Period = "period",
        /// Cycles of one period with different patterns.
        Pattern = "pattern",
        /// Cycles of one period with different words, if patterns are unknown.
        Word = "word",
        /// Different cycles of one period that are not mirror images of each other.
        Motion = "motion",
        /// Cycles of one period with different quantities.
        Quantity = "quantity",
    }
}

impl Kind {
    /// Returns the difference between two classes; none if they are equal.
    pub fn of(a: Class, b: Class) -> Option<Kind> {
        match (a, b) {
            _ if a == b => None,
            (Class::Periodic { .. }, Class::Periodic { .. }) => Some(Kind::Period),
            _ => Some(Kind::Class),
        }
    }

    /// Whether class or period differ. Other kinds are counted separately.
    pub fn is_decisive(self) -> bool {
        matches!(self, Kind::Class | Kind::Period)
    }
}

/// Number of cells with a property in both maps, and number of those in which it differs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Number of cells in which the property can be compared.
    pub compared: usize,
    /// Number of cells in which it differs.
    pub differing: usize,
}

impl Tally {
    fn take(&mut self, differs: Option<bool>) {
        self.compared += usize::from(differs.is_some());
        self.differing += usize::from(differs == Some(true));
    }
}

/// Largest difference of a number of two maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Largest {
    /// The difference, 0 or more; infinite if only one number is finite.
    pub difference: f64,
    /// Id of the cell.
    pub id: usize,
}

/// Result of a comparison.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Difference in each cell, by id.
    pub kinds: Vec<Option<Kind>>,
    /// Symmetry of cycles of one period.
    pub symmetric: Tally,
    /// Words of cycles of one period. The words of an orbit and of its mirror image count as equal, because small
    /// changes of the start decide between the two.
    pub words: Tally,
    /// Patterns of cycles of one period, compared like words.
    pub patterns: Tally,
    /// Number of compared exponents: those of integrated cycles of one period, if both scenes request exponents.
    pub exponents: usize,
    /// Largest difference of exponents; none if no exponents were compared.
    pub exponent: Option<Largest>,
    /// Numbers of attractors, if both maps count them.
    pub attractors: Tally,
    /// Cycles of one period, up to mirror image.
    pub motions: Tally,
    /// Quantities that both maps have.
    pub quantities: Vec<QuantityTally>,
    /// Difference of a quantity that counts, relative to the larger value.
    pub tolerance: f64,
    /// Indices of the `quantities` that differ, for each cell in which any does.
    pub differing_quantities: BTreeMap<usize, Vec<usize>>,
}

/// A quantity that both maps have, such as an amplitude.
#[derive(Clone, Debug, PartialEq)]
pub struct QuantityTally {
    /// Name of its column in tables.
    pub name: String,
    /// Whether it is an angle in radians.
    pub is_angle: bool,
    /// Cells in which it can be compared: at least one motion is periodic, because averages of aperiodic motions have
    /// statistical errors.
    pub tally: Tally,
    /// Largest difference.
    pub largest: Option<Largest>,
}

/// A quantity to compare.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Name of its column in tables.
    pub name: String,
    /// Dimension. Numbers of one dimension are compared with the largest of them; those without dimension have their own scale. The
    /// modulus of an angle stands in front of it.
    pub dimension: Dimension,
    /// Whether the mirror image of a motion has the opposite value.
    pub is_odd: bool,
}

impl Compared {
    /// Returns a quantity without dimension that mirror images share.
    pub fn plain(name: &str) -> Compared {
        Compared { name: name.to_owned(), dimension: Dimension::None, is_odd: false }
    }
}

/// The values of quantities in the cells of two maps.
pub struct Values<'a> {
    /// The quantities.
    pub quantities: Vec<Compared>,
    /// Returns the values of a cell in A and B.
    #[allow(clippy::type_complexity, reason = "a closure with one argument")]
    pub of: &'a (dyn Fn(usize) -> [Vec<Option<f64>>; 2] + Sync),
}

/// Difference of a quantity that counts, relative to the larger of both values, unless the caller names another.
pub const TOLERANCE: f64 = 0.05;

/// Share of the tolerance, relative to the largest value of a dimension in both maps, below which differences are rounding.
const ROUNDING: f64 = 1e-3;

impl Values<'_> {
    /// Returns for each quantity the difference below which values differ by rounding.
    fn floors(&self, tolerance: f64, ids: impl ParallelIterator<Item = usize>) -> Vec<f64> {
        let larger = |mut largest: Vec<f64>, values: Vec<Option<f64>>| {
            for (largest, value) in largest.iter_mut().zip(values) {
                *largest = value.map_or(*largest, |value| largest.max(value.abs()));
            }
            largest
        };
        let none = || vec![0.0; self.quantities.len()];
        let of_cell = |largest, id| (self.of)(id).into_iter().fold(largest, larger);
        let joined = |a, b: Vec<f64>| larger(a, b.into_iter().map(Some).collect());
        let largest = ids.fold(none, of_cell).reduce(none, joined);
        let of_dimension = |(nth, quantity): (usize, &Compared)| {
            let all = self.quantities.iter().zip(&largest);
            let same = all.filter(|(other, _)| {
                quantity.dimension != Dimension::None && other.dimension == quantity.dimension
            });
            ROUNDING * tolerance * same.map(|(_, largest)| *largest).fold(largest[nth], f64::max)
        };
        self.quantities.iter().enumerate().map(of_dimension).collect()
    }

    /// Returns the difference of two values of a quantity if it exceeds the tolerance, up to mirror image, and else 0; none if one
    /// value is absent, or the modulus of the angle is as small as rounding.
    fn difference(
        &self,
        nth: usize,
        [a, b]: &[Vec<Option<f64>>; 2],
        floors: &[f64],
        tolerance: f64,
    ) -> Option<f64> {
        let (x, y) = a[nth].zip(b[nth])?;
        let Compared { dimension, is_odd, .. } = self.quantities[nth];
        let (difference, bar) = if dimension == Dimension::Angle {
            let modulus = |of: &[Option<f64>]| nth.checked_sub(1).and_then(|before| of[before]);
            if [a, b].iter().any(|of| modulus(of).is_some_and(|size| size.abs() <= floors[nth - 1])) {
                return None;
            }
            let turn = x - y;
            (turn.sin().atan2(turn.cos()).abs(), tolerance)
        } else {
            let apart = if is_odd { apart(x, y).min(apart(x, -y)) } else { apart(x, y) };
            (apart, (tolerance * x.abs().max(y.abs())).max(floors[nth]))
        };
        Some(if difference > bar { difference } else { 0.0 })
    }
}

impl QuantityTally {
    /// Takes a difference if it is larger; of equal ones that of the first cell.
    fn larger(&mut self, other: Option<Largest>) {
        let rank = |largest: &Largest| (largest.difference, std::cmp::Reverse(largest.id));
        if let Some(other) = other
            && self.largest.is_none_or(|own| rank(&other) > rank(&own))
        {
            self.largest = Some(other);
        }
    }
}

/// Quantities that were compared in some cells, and for each cell those that differ.
type Found = (Vec<QuantityTally>, Vec<(usize, Vec<usize>)>);

impl Comparison {
    /// Compares the motions of cells in which no other difference was found. `is_same` returns whether both are one cycle up to mirror
    /// image; none for other cells, or if the records do not tell.
    pub fn take_motions(&mut self, is_same: impl Fn(usize) -> Option<bool> + Sync) {
        let same = |(id, kind): (usize, &Option<Kind>)| kind.is_none().then(|| is_same(id)).flatten();
        let same: Vec<Option<bool>> = self.kinds.par_iter().enumerate().map(same).collect();
        for (kind, same) in self.kinds.iter_mut().zip(same) {
            self.motions.take(same.map(|same| !same));
            *kind = kind.or((same == Some(false)).then_some(Kind::Motion));
        }
    }

    /// Compares quantities. Numbers differ if their difference exceeds this share of the larger one, and a thousandth of this share of
    /// the largest value of their dimension in both maps; angles differ if their difference exceeds the share of a radian. `classes`
    /// returns the classes of a cell.
    pub fn take_quantities(
        &mut self,
        values: &Values<'_>,
        tolerance: f64,
        classes: impl Fn(usize) -> [Class; 2] + Sync,
    ) {
        let is_periodic = |class: &Class| matches!(class, Class::Periodic { .. });
        let ids = || (0..self.kinds.len()).into_par_iter().filter(|&id| classes(id).iter().any(is_periodic));
        let floors = values.floors(tolerance, ids());
        let new = |quantity: &Compared| QuantityTally {
            name: quantity.name.clone(),
            is_angle: quantity.dimension == Dimension::Angle,
            tally: Tally::default(),
            largest: None,
        };
        let none = || (values.quantities.iter().map(new).collect(), Vec::new());
        let take = |(mut quantities, mut cells): Found, id| {
            let (of_cell, mut differing) = ((values.of)(id), Vec::new());
            for (nth, quantity) in quantities.iter_mut().enumerate() {
                let difference = values.difference(nth, &of_cell, &floors, tolerance);
                quantity.tally.take(difference.map(|difference| difference > 0.0));
                if let Some(difference) = difference.filter(|difference| *difference > 0.0) {
                    differing.push(nth);
                    quantity.larger(Some(Largest { difference, id }));
                }
            }
            if !differing.is_empty() {
                cells.push((id, differing));
            }
            (quantities, cells)
        };
        let join = |(mut quantities, mut cells): Found, (others, further): Found| {
            for (quantity, other) in quantities.iter_mut().zip(others) {
                quantity.tally.compared += other.tally.compared;
                quantity.tally.differing += other.tally.differing;
                quantity.larger(other.largest);
            }
            cells.extend(further);
            (quantities, cells)
        };
        let (quantities, cells) = ids().fold(none, take).reduce(none, join);
        for (id, _) in &cells {
            self.kinds[*id] = self.kinds[*id].or(Some(Kind::Quantity));
        }
        (self.quantities, self.differing_quantities) = (quantities, cells.into_iter().collect());
        self.tolerance = tolerance;
    }

    /// Returns the names of the quantities that differ in a cell.
    pub fn names_of_differing(&self, id: usize) -> impl Iterator<Item = &str> {
        let indices = self.differing_quantities.get(&id).into_iter().flatten();
        indices.map(|&nth| self.quantities[nth].name.as_str())
    }

    /// Counts the cells with any kind of difference.
    pub fn listed(&self) -> usize {
        self.kinds.iter().flatten().count()
    }

    /// Counts the cells with this kind of difference.
    pub fn count(&self, kind: Kind) -> usize {
        self.kinds.iter().filter(|of| **of == Some(kind)).count()
    }

    /// Counts the cells that differ by class or period.
    pub fn differing(&self) -> usize {
        self.kinds.iter().flatten().filter(|kind| kind.is_decisive()).count()
    }
}

/// One of two maps.
#[derive(Clone, Copy, Debug)]
pub struct Side<'a> {
    /// Records by run; the first runs of all cells come first.
    pub records: &'a dyn Records,
    /// Number of attractors of each cell, if counted.
    pub attractors: Option<&'a [u8]>,
    /// Whether the scene requests exponents.
    pub has_exponents: bool,
}

/// Compares two maps of so many cells. Filled cells are compared, too, except for their exponents, which are interpolated.
///
/// # Panics
/// If a map has fewer cells.
pub fn compare(cells: usize, a: Side<'_>, b: Side<'_>) -> Comparison {
    let mut found = Comparison::default();
    let has_exponents = a.has_exponents && b.has_exponents;
    for id in 0..cells {
        let [a, b] = [a, b].map(|side| side.records.record(id));
        let classes = [classify(&a), classify(&b)];
        let mut kind = Kind::of(classes[0], classes[1]);
        if classes[0] == classes[1] && matches!(classes[0], Class::Periodic { .. }) {
            kind = found.take_cycles(&a, &b);
            if has_exponents {
                found.take_exponents(id, &a, &b);
            }
        }
        found.kinds.push(kind);
    }
    if let (Some(a), Some(b)) = (a.attractors, b.attractors) {
        a.iter().zip(b).for_each(|(a, b)| found.attractors.take(Some(a != b)));
    }
    found
}

impl Comparison {
    /// Compares symmetry, words and patterns of two cycles of one period.
    fn take_cycles(&mut self, a: &Record, b: &Record) -> Option<Kind> {
        let have = |bit| a.valid & b.valid & bit != 0;
        self.symmetric.take(have(valid::SYMMETRIC).then_some(a.symmetric != b.symmetric));
        let has_other = |a: Option<Spelling>, b: Option<Spelling>| a.zip(b).and_then(|(a, b)| differ(&a, &b));
        let [word, pattern] = [has_other(a.spelling(), b.spelling()), has_other(a.pattern(), b.pattern())];
        self.words.take(word);
        self.patterns.take(pattern);
        // Patterns come first: words also count the bounces before meshing.
        match (pattern, word) {
            (Some(differs), _) => differs.then_some(Kind::Pattern),
            (None, word) => (word == Some(true)).then_some(Kind::Word),
        }
    }

    /// Compares the exponents of two cycles of one period.
    fn take_exponents(&mut self, id: usize, a: &Record, b: &Record) {
        if a.valid & b.valid & valid::LYAPUNOV != 0 && (a.valid | b.valid) & valid::FILLED == 0 {
            // Both exponents are minus infinity if a multiplier is zero. If one map has a zero and the other a tiny multiplier,
            // the difference of the exponents means nothing.
            let difference = if a.lyapunov == b.lyapunov { 0.0 } else { apart(a.lyapunov, b.lyapunov) };
            if difference.is_infinite() {
                return;
            }
            self.exponents += 1;
            if self.exponent.is_none_or(|largest| difference > largest.difference) {
                self.exponent = Some(Largest { difference, id });
            }
        }
    }
}

/// Whether two words differ, and one is not the mirror image of the other.
pub(crate) fn words_differ(a: &Word, b: &Word) -> bool {
    a != b && *a != b.mirrored()
}

/// Whether two words of records differ; none if their hashes do not decide it.
fn differ(a: &Spelling, b: &Spelling) -> Option<bool> {
    match (a, b) {
        (Spelling::Whole(a), Spelling::Whole(b)) => Some(words_differ(a, b)),
        (Spelling::Hashed { length: a, .. }, Spelling::Hashed { length: b, .. }) if a != b => Some(true),
        (Spelling::Hashed { .. }, Spelling::Hashed { .. }) => (a == b).then_some(false),
        _ => Some(true),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycle(period: u32, lyapunov: f64, word: &[u8]) -> Record {
        let valid = valid::PERIOD | valid::LYAPUNOV | valid::SYMMETRIC;
        let mut record = Record { period, lyapunov, valid, ..Record::default() };
        record.set_word(&Word::cyclic(word));
        record
    }

    fn chaos() -> Record {
        Record {
            lyapunov: 0.2,
            lyapunov_error: 0.01,
            valid: valid::PERIOD | valid::LYAPUNOV,
            ..Record::default()
        }
    }

    fn of(a: &dyn Records, b: &dyn Records) -> Comparison {
        let cells = a.count();
        let [a, b] = [a, b].map(|records| Side { records, attractors: None, has_exponents: true });
        compare(cells, a, b)
    }

    #[test]
    fn class_is_compared_before_period_and_undecided_is_a_class() {
        let undecided = Record { valid: valid::PERIOD, ..Record::default() };
        let a = [cycle(1, -0.1, b"36"), cycle(2, -0.1, b"36"), chaos(), undecided];
        let b = [cycle(1, -0.1, b"36"), cycle(4, -0.1, b"36"), cycle(1, -0.1, b"36"), chaos()];
        let found = of(&a, &b);
        assert_eq!(found.kinds, [None, Some(Kind::Period), Some(Kind::Class), Some(Kind::Class)]);
        assert_eq!((found.differing(), Kind::ALL.map(|kind| found.count(kind))), (3, [2, 1, 0, 0, 0, 0]));
        // Only cycles of one period are compared further.
        assert_eq!((found.exponents, found.symmetric.compared, found.words.compared), (1, 1, 1));
        let filled = b.map(|record| Record { valid: record.valid | valid::FILLED, ..record });
        assert_eq!(of(&a, &filled).kinds, found.kinds, "filled cells are compared");
    }

    #[test]
    fn cycles_of_one_period_are_compared_by_common_quantities() {
        let a =
            [cycle(1, -0.1, b"1355"), cycle(1, -0.1, b"36"), cycle(1, -0.25, b"36"), cycle(1, -0.1, b"36")];
        let mut b =
            [cycle(1, -0.1, b"4622"), cycle(1, -0.1, b"25"), cycle(1, 0.25, b"36"), cycle(1, -9.0, b"36")];
        b[1].symmetric = 1;
        b[2].valid &= !(valid::WORD | valid::SYMMETRIC);
        b[3].valid |= valid::FILLED;
        let found = of(&a, &b);
        assert_eq!(found.differing(), 0);
        assert_eq!(found.words, Tally { compared: 3, differing: 1 }, "a mirror image has the same word");
        assert_eq!(found.kinds, [None, Some(Kind::Word), None, None]);
        assert_eq!(found.symmetric, Tally { compared: 3, differing: 1 });
        assert_eq!((found.exponents, found.exponent), (3, Some(Largest { difference: 0.5, id: 2 })));
        // Records contain exponents even if the scene does not request them, because classes need them.
        let [a, b] = [(&a, true), (&b, false)].map(|(records, has_exponents)| Side {
            records,
            attractors: None,
            has_exponents,
        });
        let unrequested = compare(4, a, b);
        assert_eq!((unrequested.exponents, unrequested.exponent), (0, None));
    }

    /// Words with different numbers of bounces have one pattern.
    #[test]
    fn patterns_decide_where_both_maps_have_them() {
        let with = |word: &[u8], pattern: &[u8]| {
            let mut record = cycle(1, -0.1, word);
            record.set_pattern(&Word::cyclic(pattern));
            record
        };
        let a = [with(b"1355546", b"13546"), with(b"36", b"36"), with(b"36", b"36")];
        let b = [with(b"13555546", b"13546"), with(b"14", b"14"), cycle(1, -0.1, b"14")];
        let found = of(&a, &b);
        assert_eq!(found.words, Tally { compared: 3, differing: 3 });
        assert_eq!(found.patterns, Tally { compared: 2, differing: 1 });
        let expected = [None, Some(Kind::Pattern), Some(Kind::Word)];
        assert_eq!(found.kinds, expected, "words decide without patterns");
        assert_eq!(found.differing(), 0, "class and period are the same");
    }

    #[test]
    fn long_words_are_compared_by_their_hashes() {
        let hashed = |hash, length| Spelling::Hashed { hash, length };
        assert_eq!(differ(&hashed(1, 80), &hashed(1, 80)), Some(false));
        assert_eq!(differ(&hashed(1, 80), &hashed(2, 80)), None, "it may be the mirror image");
        assert_eq!(differ(&hashed(1, 80), &hashed(1, 81)), Some(true));
        assert_eq!(differ(&hashed(1, 80), &Spelling::Whole(Word::cyclic(b"36"))), Some(true));
    }

    #[test]
    fn motions_and_quantities_of_equal_cycles_are_compared() {
        let cycles = [(); 5].map(|()| cycle(1, -0.1, b"36"));
        let mut found = of(&cycles, &cycles);
        found.take_motions(|id| [Some(true), Some(false), None, None, None].get(id).copied().flatten());
        assert_eq!(found.motions, Tally { compared: 2, differing: 1 });
        // Amplitude, phase and mean. The phase of a motion at rest means nothing; a mirror image has the opposite mean.
        let a = [[1.0, 3.1, 0.5], [1.0, 0.2, 0.5], [1.0, 0.0, 0.0], [1e-9, 1.0, 0.0], [0.0, 0.0, 0.0]];
        let b = [[1.04, -3.15, -0.5], [1.0, 0.1, 0.5], [1.06, 0.0, 0.0], [3e-9, 2.0, 0.0], [0.5, 0.0, 0.0]];
        let values = |id: usize| [a, b].map(|side| side[id].map(Some).to_vec());
        let quantity = |name: &str, dimension, is_odd| Compared { name: name.to_owned(), dimension, is_odd };
        let quantities = vec![
            quantity("amplitude_x", Dimension::Length, false),
            quantity("phase_x", Dimension::Angle, false),
            quantity("mean_x", Dimension::Length, true),
        ];
        let values = Values { quantities, of: &values };
        let classes = |id: usize| {
            [Class::Periodic { period: 1 }, [Class::Chaotic, Class::Periodic { period: 1 }][id.min(1)]]
        };
        found.take_quantities(&values, 0.05, classes);
        let tallies: Vec<Tally> = found.quantities.iter().map(|quantity| quantity.tally).collect();
        let tally = |compared, differing| Tally { compared, differing };
        assert_eq!(tallies, [tally(5, 2), tally(3, 1), tally(5, 0)]);
        assert_eq!(found.kinds, [None, Some(Kind::Motion), Some(Kind::Quantity), None, Some(Kind::Quantity)]);
        let names = |id| found.names_of_differing(id).collect::<Vec<_>>();
        assert_eq!([names(0), names(1), names(4)], [vec![], vec!["phase_x"], vec!["amplitude_x"]]);
        assert_eq!(found.quantities[0].largest, Some(Largest { difference: 0.5, id: 4 }));
        found.take_quantities(&values, 0.05, |_| [Class::Chaotic; 2]);
        assert!(found.quantities.iter().all(|quantity| quantity.tally.compared == 0), "averages of chaos");
    }

    #[test]
    fn attractors_are_compared_where_both_maps_count_them() {
        let records = [(); 3].map(|()| chaos());
        let [a, b] = [&[1u8, 2, 3], &[1u8, 1, 3]];
        let side = |attractors| Side { records: &records, attractors, has_exponents: true };
        assert_eq!(compare(3, side(Some(a)), side(Some(b))).attractors, Tally { compared: 3, differing: 1 });
        assert_eq!(compare(3, side(Some(a)), side(None)).attractors, Tally::default());
    }
}
