//! What the reference says of a cell, and where a record says something else.

use serde::Serialize;

use crate::classify::classify;
use crate::engine::measured_record;
use crate::gpu::{Averaging, Precision};
use crate::orbit::{Budget, Class, Measured, Orbit, Scatter, Status};
use crate::plan::Needs;
use crate::record::{Record, Spelling, valid, word_hash};
use crate::word::Word;

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Field {
    /// Periodic, chaotic, undecided or failed.
    Class,
    /// The period, where both are periodic.
    Period,
    /// The word, up to mirror image, where the period agrees.
    Word,
    /// Whether the cycle is its own mirror image, where the period agrees.
    Symmetric,
    /// The exponent: by the largest multiplier of cycles, within standard errors otherwise.
    Exponent,
    /// The exponent's standard error, where both sides are on no cycle.
    ExponentError,
    /// Impacts per forcing period.
    Impacts,
    /// Fraction of time spent meshing.
    Mesh,
    /// How the integration ended.
    Status,
    /// Forcing periods integrated.
    Periods,
    /// Which fields the record has.
    Kept,
    /// The state: after a few periods, in units of the error budget, or at the end.
    State,
}

impl Field {
    /// Every field, in the order in which they are told.
    pub const ALL: [Field; 12] = [
        Field::Class,
        Field::Period,
        Field::Word,
        Field::Symmetric,
        Field::Exponent,
        Field::ExponentError,
        Field::Impacts,
        Field::Mesh,
        Field::Status,
        Field::Periods,
        Field::Kept,
        Field::State,
    ];

    /// Its name in files, that of the record's field where there is one.
    pub fn name(self) -> &'static str {
        match self {
            Field::Class => "class",
            Field::Period => "period",
            Field::Word => "word",
            Field::Symmetric => "symmetric",
            Field::Exponent => "lyapunov",
            Field::ExponentError => "lyapunov_error",
            Field::Impacts => "impacts_per_period",
            Field::Mesh => "mesh_fraction",
            Field::Status => "status",
            Field::Periods => "periods_run",
            Field::Kept => "valid",
            Field::State => "state",
        }
    }
}

/// A value of one side.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A class or a word.
    Text(String),
    /// An exponent, an average, an error.
    Number(f64),
    /// A period.
    Count(u32),
    /// A symmetry.
    Flag(bool),
}

/// One field in which a record and the reference differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Which.
    pub field: Field,
    /// What the record says.
    pub record: Value,
    /// What the reference says.
    pub reference: Value,
}

/// How far numbers may differ and still count as the same.
///
/// Lanes read a cycle where they have come near it, not on it, and carry tangents in their own
/// precision. Of cycles over the plane 99 % are within 3e-4 (f32) and 4e-6 (f64) of the
/// reference's multiplier, all but those whose multiplier is close to 1 or which had not
/// settled within 6e-3 and 3e-3; their meshing within 2e-6 and 3e-8.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bars {
    /// Natural logarithm of the largest multiplier, per forcing period and at least per five:
    /// every period of a cycle adds its own error.
    multiplier: f64,
    /// Multipliers below this are rounding of the monodromy matrix: as good as zero.
    no_multiplier: f64,
    pub(super) mesh: f64,
    pub(super) impacts: f64,
    /// The forcing period.
    pub(super) forcing_period: f64,
    /// The period from which exponents accumulate.
    pub(super) exponent_from: u32,
    /// Forcing periods that an exponent with a standard error is averaged over at least.
    pub(super) least_counted: u32,
}

impl Bars {
    pub(super) fn new(precision: Precision, forcing_period: f64, budget: &Budget) -> Bars {
        let (multiplier, no_multiplier, mesh) = match precision {
            Precision::F32 => (4e-3, 1e-2, 2e-5),
            Precision::F64 => (1e-3, 1e-5, 1e-6),
        };
        let exponent_from = budget.exponent_from();
        let least_counted = Averaging::new(budget.periods(), exponent_from).fewest_periods();
        Bars { multiplier, no_multiplier, mesh, impacts: 1e-9, forcing_period, exponent_from, least_counted }
    }

    /// Whether two exponents of a cycle over so many forcing periods are those of the same multiplier.
    pub(super) fn is_same_multiplier(&self, ours: f64, theirs: f64, period: f64) -> bool {
        let [ours, theirs] = [ours, theirs].map(|exponent| exponent * period * self.forcing_period);
        (ours - theirs).abs() <= self.multiplier * period.max(5.0)
            || ours.max(theirs) <= self.no_multiplier.ln()
    }
}

/// What some computation on the reference says of a cell. Absent fields are not compared.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Answer {
    pub(super) class: Class,
    pub(super) status: Status,
    /// Exponent and standard error, zero for a cycle.
    pub(super) exponent: Option<[f64; 2]>,
    pub(super) impacts_per_period: Option<f64>,
    pub(super) mesh_fraction: Option<f64>,
    /// What averages are uncertain by; averages without it are those of a cycle, or not compared.
    pub(super) scatter: Option<Scatter>,
    pub(super) symmetric: Option<bool>,
    pub(super) word: Option<Word>,
}

impl From<&Measured> for Answer {
    fn from(measured: &Measured) -> Answer {
        Answer {
            class: classify(&measured_record(measured, &Needs::EVERYTHING)),
            status: measured.status,
            exponent: measured.lyapunov,
            impacts_per_period: Some(measured.impacts_per_period),
            mesh_fraction: Some(measured.mesh_fraction),
            scatter: measured.scatter,
            symmetric: measured.symmetric,
            word: measured.word.clone(),
        }
    }
}

impl From<&Orbit> for Answer {
    fn from(orbit: &Orbit) -> Answer {
        let is_cycle = matches!(orbit.class, Class::Periodic { .. });
        Answer {
            class: orbit.class,
            status: orbit.status,
            exponent: Some([orbit.lyapunov, orbit.lyapunov_error.unwrap_or(0.0)]),
            impacts_per_period: Some(orbit.impacts_per_period),
            mesh_fraction: Some(orbit.mesh_fraction),
            scatter: None,
            symmetric: orbit.symmetric,
            word: is_cycle.then(|| orbit.word.clone()),
        }
    }
}

/// A field that was compared, and what differs in it if anything does.
pub(super) type Compared = (Field, Option<Difference>);

impl Answer {
    /// Compares a record with this answer, field by field as far as both have them.
    pub(super) fn compare(&self, record: &Record, bars: &Bars) -> Vec<Compared> {
        let class = classify(record);
        let mut list = vec![compared(Field::Class, class.index() == self.class.index(), || {
            (Value::Text(class.name().into()), Value::Text(self.class.name().into()))
        })];
        match (class, self.class) {
            (Class::Periodic { period: ours }, Class::Periodic { period: theirs }) => {
                list.push(compared(Field::Period, ours == theirs, || {
                    (Value::Count(ours), Value::Count(theirs))
                }));
                if ours == theirs {
                    self.compare_cycle(record, f64::from(ours), bars, &mut list);
                }
            }
            (Class::Chaotic, Class::Chaotic) | (Class::Undecided, Class::Undecided) => {
                self.compare_averages(record, bars, &mut list);
            }
            _ => {}
        }
        list
    }

    /// Whether a record says the same in every field.
    pub(super) fn agrees(&self, record: &Record, bars: &Bars) -> bool {
        self.compare(record, bars).iter().all(|(_, differs)| differs.is_none())
    }

    fn compare_cycle(&self, record: &Record, period: f64, bars: &Bars, list: &mut Vec<Compared>) {
        let has = |bit| record.valid & bit != 0;
        if let (Some(spelling), Some(word)) = (record.spelling(), &self.word) {
            let same = spells(&spelling, word) || spells(&spelling, &word.mirrored());
            list.push(compared(Field::Word, same, || {
                (Value::Text(spelling.text()), Value::Text(spelled(word).text()))
            }));
        }
        if let (true, Some(symmetric)) = (has(valid::SYMMETRIC), self.symmetric) {
            let ours = record.symmetric != 0;
            let shown = || (Value::Flag(ours), Value::Flag(symmetric));
            list.push(compared(Field::Symmetric, ours == symmetric, shown));
        }
        if let (true, Some([theirs, _])) = (has(valid::LYAPUNOV), self.exponent) {
            let same = bars.is_same_multiplier(record.lyapunov, theirs, period);
            list.push(compared(Field::Exponent, same, || {
                (Value::Number(record.lyapunov), Value::Number(theirs))
            }));
        }
        let averages = [
            (
                Field::Impacts,
                valid::IMPACTS,
                record.impacts_per_period,
                self.impacts_per_period,
                bars.impacts,
            ),
            (Field::Mesh, valid::MESH, record.mesh_fraction, self.mesh_fraction, bars.mesh),
        ];
        for (field, bit, ours, theirs, bar) in averages {
            if let (true, Some(theirs)) = (has(bit), theirs) {
                let shown = || (Value::Number(ours), Value::Number(theirs));
                list.push(compared(field, (ours - theirs).abs() <= bar, shown));
            }
        }
    }
}

pub(super) fn compared(field: Field, same: bool, shown: impl FnOnce() -> (Value, Value)) -> Compared {
    let differs = (!same).then(|| {
        let (record, reference) = shown();
        Difference { field, record, reference }
    });
    (field, differs)
}

/// A word as a record would keep it.
fn spelled(word: &Word) -> Spelling {
    let mut record = Record::default();
    record.set_word(word);
    record.spelling().unwrap_or_else(|| Spelling::Whole(word.clone()))
}

fn spells(spelling: &Spelling, word: &Word) -> bool {
    match spelling {
        Spelling::Whole(whole) => whole == word,
        Spelling::Hashed { hash, length } => {
            *length as usize == word.len() && *hash == word_hash(word.symbols())
        }
    }
}
