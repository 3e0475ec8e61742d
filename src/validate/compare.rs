//! Comparison of two records of one cell.

use std::cmp::Ordering;

use serde::Serialize;

use super::cell::ROUNDING_FACTOR;
use super::finite::not_finite;
use crate::findings::attractors::{Basins, NONE};
use crate::gpu::Precision;
use crate::record::classify::{classify, status};
use crate::record::distance::{apart, is_within};
use crate::record::measures::{GROUPS, Group, SMALL};
use crate::record::{Record, Spelling, valid};
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::orbit::{Budget, Class, Status};
use rattlemap_dynamics::word::Word;

/// A compared field, by its name in files. This is the record's field name if there is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field(&'static str);

impl Field {
    /// The class: periodic, chaotic, undecided or failed.
    pub const CLASS: Field = Field("class");
    /// The period, if both are periodic.
    pub const PERIOD: Field = Field("period");
    /// The word up to mirror image, if the periods agree.
    pub const WORD: Field = Field("word");
    /// The pattern up to mirror image, if the periods agree.
    pub const PATTERN: Field = Field("pattern");
    /// Whether the cycle is its own mirror image, if the periods agree.
    pub const SYMMETRIC: Field = Field("symmetric");
    /// The exponent. For cycles the largest multiplier is compared instead. Otherwise the exponent is compared with wide tolerances.
    pub const EXPONENT: Field = Field("lyapunov");
    /// The attractor of the start in a map of basins, if both are periodic.
    pub const ATTRACTOR: Field = Field("attractor");
    /// Impacts per forcing period.
    pub const IMPACTS: Field = Field("impacts_per_period");
    /// Fraction of the time spent meshing.
    pub const MESH: Field = Field("mesh_fraction");
    /// How the integration ended.
    pub const STATUS: Field = Field("status");
    /// Number of integrated forcing periods, which the plan limits.
    pub const PERIODS: Field = Field("periods_run");
    /// Whether all numbers of the record are finite.
    pub const FINITE: Field = Field("finite");
    /// Whether the same engine reproduces the record to the bit.
    pub const AGAIN: Field = Field("again");

    /// Returns all fields, in the order in which they are reported. A measured quantity has the name of its group.
    pub fn all() -> impl Iterator<Item = Field> {
        let motion = [Field::CLASS, Field::PERIOD, Field::WORD, Field::PATTERN, Field::SYMMETRIC];
        let averages = [Field::EXPONENT, Field::ATTRACTOR, Field::IMPACTS, Field::MESH];
        let measured = GROUPS.iter().map(|group| Field(group.name));
        let record = [Field::STATUS, Field::PERIODS, Field::FINITE, Field::AGAIN];
        motion.into_iter().chain(averages).chain(measured).chain(record)
    }

    /// Returns the name in files.
    pub fn name(self) -> &'static str {
        self.0
    }

    /// Whether it is a measured quantity.
    pub(super) fn is_measured(self) -> bool {
        Group::named(self.0).is_some()
    }
}

/// A value in a difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A class, a status or a word.
    Text(String),
    /// An exponent or an average.
    Number(f64),
    /// A number of periods.
    Count(u32),
    /// A symmetry.
    Flag(bool),
}

/// A field in which a record and its judge differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The field.
    pub field: Field,
    /// Value in the record.
    pub record: Value,
    /// Value of the judge.
    pub judge: Value,
}

/// A compared field, and its difference if the two sides differ.
pub(super) type Compared = (Field, Option<Difference>);

/// Result of a computation of a cell.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    pub(super) record: Record,
    word: Either,
    pattern: Either,
}

/// A word or pattern with its mirror image.
#[derive(Clone, Debug)]
struct Either {
    own: Option<Spelling>,
    /// None for a long word, of which only the hash is known.
    mirrored: Option<Spelling>,
}

impl Either {
    /// Builds the pair from the record's text and, if known, the word.
    fn new(own: Option<Spelling>, word: Option<&Word>) -> Either {
        let mirrored = match (word, &own) {
            (Some(word), _) | (None, Some(Spelling::Whole(word))) => Some(Spelling::new(&word.mirrored())),
            (None, _) => None,
        };
        Either { own, mirrored }
    }

    /// Whether a text spells the word or its mirror image.
    fn is(&self, ours: &Spelling) -> bool {
        let length = |spelling: &Spelling| match spelling {
            Spelling::Whole(word) => word.len() as u32,
            Spelling::Hashed { length, .. } => *length,
        };
        match (&self.own, &self.mirrored) {
            (Some(own), Some(mirrored)) => ours == own || ours == mirrored,
            (Some(own), None) => length(ours) == length(own),
            (None, _) => true,
        }
    }

    /// Compares with another text. None if one side has no text.
    fn compare(&self, field: Field, ours: Option<&Spelling>) -> Option<Compared> {
        let (ours, theirs) = (ours?, self.own.as_ref()?);
        let shown = || (Value::Text(ours.text()), Value::Text(theirs.text()));
        Some(compared(field, self.is(ours), shown))
    }
}

impl Answer {
    pub(super) fn new(record: Record, word: Option<&Word>) -> Answer {
        let pattern = Either::new(record.pattern(), word.map(Word::pattern).as_ref());
        Answer { word: Either::new(record.spelling(), word), pattern, record }
    }

    /// Whether another result has the same word up to mirror image, and whether it has the same pattern up to mirror image.
    pub(super) fn is_spelled_as(&self, other: &Answer) -> [bool; 2] {
        let is = |own: &Either, other: &Either| own.own.as_ref().is_none_or(|own| other.is(own));
        [is(&self.word, &other.word), is(&self.pattern, &other.pattern)]
    }
}

/// Tolerances of the comparison of numbers.
///
/// Lanes compute the multipliers of a cycle at a state near it, in their own precision. Over the plane, multipliers of 99 % of the cycles
/// agree with the reference within 3e-4 (f32) and 4e-6 (f64). All multipliers agree within 6e-3 (f32) and 3e-3 (f64), unless a multiplier
/// is close to 1 or the motion has not settled. Fractions of meshing agree within 2e-6 and 3e-8.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bars<'a> {
    /// Tolerance of the natural logarithm of the largest multiplier, per forcing period. Cycles of fewer than five
    /// periods get five times this value.
    multiplier: f64,
    /// Smallest multiplier that the monodromy matrix resolves; smaller ones count as zero.
    no_multiplier: f64,
    mesh: f64,
    /// Tolerance of measured quantities of a cycle, in the measure of [`Group::distance`].
    measured: f64,
    /// Tolerance of averages, relative to the motion, for a record that was computed near the cycle; 0 if it was computed on the cycle.
    off_cycle: f64,
    forcing_period: f64,
    budget: Budget,
    pub(super) labels: Option<Labels<'a>>,
}

/// For one cell of a map of basins: the known attractors, and the state that identifies the cell's own record.
#[derive(Clone, Copy, Debug)]
pub(super) struct Labels<'a> {
    pub(super) basins: &'a Basins,
    pub(super) id: usize,
    /// The strobe state of the map's own record.
    pub(super) own: State,
}

impl Labels<'_> {
    /// Returns the attractor of a record: the map's label for the map's own record, else the known attractor that the
    /// record's state belongs to.
    fn of(&self, record: &Record) -> Option<u16> {
        match record.strobe() == self.own {
            true => Some(self.basins.labels()[self.id]).filter(|&label| label != NONE),
            false => self.basins.label(self.id, record),
        }
    }
}

/// Logarithm of the ratio between the size of the motion and a rounding error. A motion that grows or decays less over its budget cannot be
/// distinguished from a neutral one.
const DECISIVE_GROWTH: f64 = 40.0;

/// Name of the quantity that only cycles have.
const MULTIPLIER: &str = "multiplier";

/// Orders pairs of numbers by their distance.
fn farther_apart(a: &[f64; 2], b: &[f64; 2]) -> Ordering {
    apart(a[0], a[1]).total_cmp(&apart(b[0], b[1]))
}

/// Largest error of an average that the distance from a cycle can explain.
const FARTHEST_OFF_CYCLE: f64 = 1e-4;

/// Tolerance of impacts per period of a cycle. Impacts are counted, so only the division rounds.
const IMPACTS_BAR: f64 = 1e-9;

/// Tolerance of averages of one chaotic cell, in standard errors of both sides. It finds gross errors only; the test over
/// the class ([`super::chaos`]) finds systematic ones.
const ERRORS: f64 = 8.0;
/// Additional tolerances of chaotic averages: exponent per forcing period, relative impacts, fraction of time.
const CHAOS_BARS: [f64; 3] = [0.1, 0.5, 0.25];

impl Bars<'_> {
    pub(super) fn new(precision: Precision, forcing_period: f64, budget: &Budget) -> Self {
        let (multiplier, no_multiplier, mesh, measured) = match precision {
            Precision::F32 => (4e-3, 1e-2, 2e-5, 2e-3),
            Precision::F64 => (1e-3, 1e-5, 1e-6, 1e-4),
        };
        Bars {
            multiplier,
            no_multiplier,
            mesh,
            measured,
            off_cycle: 0.0,
            forcing_period,
            budget: *budget,
            labels: None,
        }
    }

    /// Returns the tolerances of a record whose averages were computed at this distance from its cycle, relative to the motion. The error
    /// of the averages may be proportional to this distance.
    pub(super) fn off_cycle(&self, distance: f64) -> Self {
        let off_cycle = (ROUNDING_FACTOR * distance).min(FARTHEST_OFF_CYCLE);
        Bars { off_cycle, mesh: self.mesh.max(off_cycle), ..*self }
    }

    /// Compares a record with the judge's record in all fields that both have.
    pub(super) fn compare(&self, record: &Record, answer: &Answer) -> Vec<Compared> {
        let judge = &answer.record;
        let [ours, theirs] = [record, judge].map(classify);
        let longest = self.budget.longest();
        let mut list = vec![
            compared(Field::CLASS, ours.index() == theirs.index(), || texts(ours.name(), theirs.name())),
            compared(Field::PERIODS, record.periods_run <= longest, || {
                (Value::Count(record.periods_run), Value::Count(longest))
            }),
            self.finite(record),
        ];
        if ours.index() == theirs.index() {
            let statuses = [record, judge].map(status);
            list.push(compared(Field::STATUS, self.is_same_status(ours, statuses, judge), || {
                texts(statuses[0].name(), statuses[1].name())
            }));
        }
        match (ours, theirs) {
            (Class::Periodic { period: ours }, Class::Periodic { period: theirs }) => {
                let counts = || (Value::Count(ours), Value::Count(theirs));
                list.push(compared(Field::PERIOD, ours == theirs, counts));
                list.extend(self.compare_labels(record, judge));
                if ours == theirs {
                    self.compare_cycle(record, answer, f64::from(ours), &mut list);
                }
            }
            (Class::Chaotic, Class::Chaotic)
            | (Class::QuasiPeriodic, Class::QuasiPeriodic)
            | (Class::Undecided, Class::Undecided) => {
                self.compare_averages(record, judge, &mut list);
            }
            _ => {}
        }
        list
    }

    /// Compares the attractors of two cycles in a map of basins.
    fn compare_labels(&self, record: &Record, judge: &Record) -> Option<Compared> {
        let labels = self.labels?;
        let [ours, theirs] = [record, judge].map(|record| labels.of(record));
        let shown = |label: Option<u16>| Value::Text(label.map_or("none of them".into(), |n| n.to_string()));
        Some(compared(Field::ATTRACTOR, ours == theirs, || (shown(ours), shown(theirs))))
    }

    /// Whether two statuses of one class agree. Lanes in f32 report `slow` at distances above 1e-4 from the cycle, and other engines above
    /// 1e-8. In f32 a multiplier of 1 also has a larger error. So `ok`, `slow` and `neutral` agree for motion that settles slowly.
    fn is_same_status(&self, class: Class, statuses: [Status; 2], judge: &Record) -> bool {
        match class {
            // For these classes the status gives no further information.
            Class::Chaotic | Class::QuasiPeriodic | Class::Undecided => true,
            _ => {
                let graded = [Status::Ok, Status::Slow, Status::Neutral];
                let is_grade = statuses.iter().all(|status| graded.contains(status));
                // The limit of contact-free motion is known, so an early stop need not wait until it is reached.
                let counted = valid::IMPACTS | valid::MESH;
                let is_free = judge.valid & counted == counted
                    && judge.impacts_per_period == 0.0
                    && judge.mesh_fraction == 0.0;
                // Not every engine notices that two gaps reach their walls together.
                let is_tied = statuses.contains(&Status::Simultaneous);
                statuses[0] == statuses[1] || is_tied || is_grade && (is_free || !self.is_decisive(judge))
            }
        }
    }

    /// Whether motion settles or separates enough within the budget to be distinguished from neutral motion.
    pub(super) fn is_decisive(&self, judge: &Record) -> bool {
        let has = judge.valid & valid::LYAPUNOV != 0;
        has && judge.lyapunov.abs() * self.forcing_period * f64::from(self.budget.periods())
            >= DECISIVE_GROWTH
    }

    /// Checks that every number of a record is finite.
    pub(super) fn finite(&self, record: &Record) -> Compared {
        let found = not_finite(record, &self.budget);
        let shown = || {
            let (name, value) = found.unwrap_or_default();
            (Value::Text(format!("{name} = {value}")), Value::Text("a finite number".into()))
        };
        compared(Field::FINITE, found.is_none(), shown)
    }

    /// Whether a record agrees in all fields.
    pub(super) fn agree(&self, record: &Record, answer: &Answer) -> bool {
        self.compare(record, answer).iter().all(|(_, differs)| differs.is_none())
    }

    fn compare_cycle(&self, record: &Record, answer: &Answer, period: f64, list: &mut Vec<Compared>) {
        let judge = &answer.record;
        let both = record.valid & judge.valid;
        list.extend(answer.word.compare(Field::WORD, record.spelling().as_ref()));
        list.extend(answer.pattern.compare(Field::PATTERN, record.pattern().as_ref()));
        if both & valid::SYMMETRIC != 0 {
            let flags = [record, judge].map(|side| side.symmetric != 0);
            let shown = || (Value::Flag(flags[0]), Value::Flag(flags[1]));
            list.push(compared(Field::SYMMETRIC, flags[0] == flags[1], shown));
        }
        let logs = [record, judge].map(|side| side.lyapunov * period * self.forcing_period);
        let is_same = self.is_same_multiplier(logs[0], logs[1], period);
        self.push(
            list,
            (Field::EXPONENT, valid::LYAPUNOV),
            [record, judge].map(|r| r.lyapunov),
            both,
            is_same,
        );
        self.push_averages(list, record, judge, [IMPACTS_BAR, self.mesh]);
        self.push_measured(list, record, judge, |group| match group.name == MULTIPLIER {
            true => self.is_same_complex(group, record, judge, period),
            false => {
                is_within(group.distance(record, judge, SMALL), self.measured)
                    || is_within(group.distance(record, judge, 1.0), self.off_cycle)
            }
        });
    }

    /// Whether two logarithms of the largest multiplier of a cycle agree.
    pub(super) fn is_same_multiplier(&self, ours: f64, theirs: f64, period: f64) -> bool {
        let is_none = [ours, theirs].iter().all(|log| *log <= self.none());
        is_none || is_within(apart(ours, theirs), self.multiplier * period.max(5.0))
    }

    /// Returns the logarithm of the smallest multiplier that is resolved.
    pub(super) fn none(&self) -> f64 {
        self.no_multiplier.ln()
    }

    fn compare_averages(&self, record: &Record, judge: &Record, list: &mut Vec<Compared>) {
        let exponents = [record, judge].map(|side| side.lyapunov);
        // Only the judge's error widens the tolerance, so that a record cannot widen its own tolerance.
        let own = if judge.lyapunov_error.is_finite() { judge.lyapunov_error } else { 0.0 };
        let bar = ERRORS * std::f64::consts::SQRT_2 * own + CHAOS_BARS[0] / self.forcing_period;
        let is_same = is_within(apart(exponents[0], exponents[1]), bar);
        let both = record.valid & judge.valid;
        self.push(list, (Field::EXPONENT, valid::LYAPUNOV), exponents, both, is_same);
        let impacts = CHAOS_BARS[1] * judge.impacts_per_period + 1.0;
        self.push_averages(list, record, judge, [impacts, CHAOS_BARS[2]]);
        self.push_measured(list, record, judge, |group| {
            group.name == MULTIPLIER || is_within(group.distance(record, judge, 1.0), CHAOS_BARS[1])
        });
    }

    fn push_averages(&self, list: &mut Vec<Compared>, record: &Record, judge: &Record, bars: [f64; 2]) {
        let both = record.valid & judge.valid;
        let of = [
            ((Field::IMPACTS, valid::IMPACTS), [record, judge].map(|side| side.impacts_per_period)),
            ((Field::MESH, valid::MESH), [record, judge].map(|side| side.mesh_fraction)),
        ];
        for ((field, values), bar) in of.into_iter().zip(bars) {
            self.push(list, field, values, both, is_within(apart(values[0], values[1]), bar));
        }
    }

    /// Whether the largest multipliers of a cycle agree up to complex conjugation. Near a double multiplier the argument
    /// changes like the square root of the errors.
    fn is_same_complex(&self, group: &Group, record: &Record, judge: &Record, period: f64) -> bool {
        let mut measures =
            group.measures().map(|measure| [record, judge].map(|side| side.measures[measure.place]));
        let (Some(moduli), Some(arguments)) = (measures.next(), measures.next()) else { return false };
        let logs = moduli.map(f64::ln);
        let bar = (self.multiplier * period.max(5.0)).sqrt();
        let is_same_argument = is_within(apart(arguments[0].abs(), arguments[1].abs()), bar);
        let is_none = logs.iter().all(|log| *log <= self.none());
        self.is_same_multiplier(logs[0], logs[1], period) && (is_same_argument || is_none)
    }

    /// Adds the comparison of each measured quantity that both sides have. A difference contains the number that differs most.
    fn push_measured(
        &self,
        list: &mut Vec<Compared>,
        record: &Record,
        judge: &Record,
        is_same: impl Fn(&Group) -> bool,
    ) {
        let both = record.valid & judge.valid;
        for group in GROUPS.iter().filter(|group| both & group.bit != 0) {
            let values = || {
                let pairs = group.measures().map(|m| [record, judge].map(|side| side.measures[m.place]));
                let [ours, theirs] = pairs.max_by(farther_apart).unwrap_or_default();
                (Value::Number(ours), Value::Number(theirs))
            };
            list.push(compared(Field(group.name), is_same(group), values));
        }
    }

    /// Adds the comparison of a number if both sides have it.
    fn push(
        &self,
        list: &mut Vec<Compared>,
        (field, bit): (Field, u32),
        [record, judge]: [f64; 2],
        both: u32,
        is_same: bool,
    ) {
        if both & bit != 0 {
            list.push(compared(field, is_same, || (Value::Number(record), Value::Number(judge))));
        }
    }
}

/// Returns a record without its exponent and multipliers.
pub(super) fn without_multipliers(record: Record) -> Record {
    let bits = GROUPS.iter().filter(|group| group.name == MULTIPLIER).fold(valid::LYAPUNOV, |b, g| b | g.bit);
    Record { valid: record.valid & !bits, ..record }
}

/// Builds the comparison of a field. `values` returns the record's value and the judge's.
pub(super) fn compared(field: Field, same: bool, values: impl FnOnce() -> (Value, Value)) -> Compared {
    let differs = (!same).then(|| {
        let (record, judge) = values();
        Difference { field, record, judge }
    });
    (field, differs)
}

fn texts(record: &str, judge: &str) -> (Value, Value) {
    (Value::Text(record.into()), Value::Text(judge.into()))
}
