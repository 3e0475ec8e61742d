//! Shader variants. Their sources are composed of the same small files.

use super::Measures;
use super::features::Features;
use super::layout::{
    self, BLOCK, CONTACTS, EXTREMES, KEYS, LISTS, List, SPELLED_PATTERN, SPELLED_PATTERN_LENGTH,
    SPELLED_WORD, SPELLED_WORD_LENGTH, SPELLING, SUMS, symbols_per_number,
};
use super::pair::PAIRS_PER_HARMONIC;
use super::precision::Precision;
use super::rules;
use super::unroll::unroll;
use crate::record::{SymbolCode, valid};
use rattlemap_dynamics::orbit::Status;

/// Options of a compiled shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// Precision of the motion.
    pub precision: Precision,
    /// Invocations per workgroup.
    pub workgroup: u32,
    /// Whether cycles are read with their monodromy matrix.
    pub exponent: bool,
    /// Tangent vectors that lanes carry.
    pub tangents: Tangents,
    /// Whether the words of cycles are stored.
    pub word: bool,
    /// Whether the words' patterns are stored.
    pub pattern: bool,
    /// Whether the time spent meshing is counted.
    pub mesh: bool,
    /// Whether cycles are compared with their mirror image.
    pub symmetry: bool,
    /// Whether lanes may follow chatter by short flights.
    pub chatter: bool,
    /// Features that oscillators may have.
    pub features: Features,
    /// Quantities that this variant measures on lanes whose class is decided; `None` in a variant that decides classes.
    pub measures: Option<Measures>,
}

/// Tangent vectors that a kernel carries along the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Tangents {
    /// No vector.
    None,
    /// One vector, for the exponent of aperiodic motion.
    Vector,
    /// The columns of the monodromy matrix, while a cycle is read.
    Columns,
}

/// Default number of invocations per workgroup.
const WORKGROUP: u32 = 64;

/// Returns the number of invocations per workgroup: the default, or 32, 64, 128 or 256 by the environment variable
/// RATTLEMAP_WORKGROUP. `scripts/measure_gpu.sh` sets it to compare their speed; records do not depend on it.
pub(super) fn workgroup() -> u32 {
    let asked = std::env::var("RATTLEMAP_WORKGROUP").ok().and_then(|text| text.parse().ok());
    asked.filter(|size| [32, 64, 128, 256].contains(size)).unwrap_or(WORKGROUP)
}

/// Sources that both engines of motion share.
const COMMON: &str = concat!(
    include_str!("../../shaders/layout.wgsl"),
    include_str!("../../shaders/growth.wgsl"),
    include_str!("../../shaders/observe.wgsl"),
    include_str!("../../shaders/recurrence.wgsl"),
    include_str!("../../shaders/chaos.wgsl"),
    include_str!("../../shaders/regularity.wgsl"),
    include_str!("../../shaders/word.wgsl"),
    include_str!("../../shaders/cycle.wgsl"),
    include_str!("../../shaders/refine.wgsl"),
    include_str!("../../shaders/approach.wgsl"),
    include_str!("../../shaders/sweep.wgsl"),
    include_str!("../../shaders/lists.wgsl"),
    include_str!("../../shaders/begin.wgsl"),
    include_str!("../../shaders/record.wgsl"),
);

/// Sources for the motion of oscillators with one gap.
const OSCILLATOR: &str = concat!(
    include_str!("../../shaders/pair/tables.wgsl"),
    include_str!("../../shaders/pair/oscillator.wgsl"),
    include_str!("../../shaders/pair/domain.wgsl"),
    include_str!("../../shaders/pair/phase.wgsl"),
    include_str!("../../shaders/pair/harmonics.wgsl"),
    include_str!("../../shaders/pair/stages.wgsl"),
    include_str!("../../shaders/pair/contact.wgsl"),
    include_str!("../../shaders/pair/elastic.wgsl"),
    include_str!("../../shaders/pair/rigid.wgsl"),
    include_str!("../../shaders/pair/taylor.wgsl"),
    include_str!("../../shaders/pair/flight.wgsl"),
    include_str!("../../shaders/pair/events.wgsl"),
    include_str!("../../shaders/pair/chatter.wgsl"),
    include_str!("../../shaders/pair/tangent.wgsl"),
    include_str!("../../shaders/pair/measure.wgsl"),
);

/// Sources for the motion of machines.
const MACHINE: &str = concat!(
    include_str!("../../shaders/machine/layout.wgsl"),
    include_str!("../../shaders/machine/series.wgsl"),
    include_str!("../../shaders/machine/root.wgsl"),
    include_str!("../../shaders/machine/modes.wgsl"),
    include_str!("../../shaders/machine/motion.wgsl"),
    include_str!("../../shaders/machine/chatter.wgsl"),
    include_str!("../../shaders/machine/machine.wgsl"),
);

impl Variant {
    /// Returns the variant of a precision with all quantities and the default workgroup.
    pub fn of(precision: Precision) -> Variant {
        Variant {
            precision,
            workgroup: WORKGROUP,
            exponent: true,
            tangents: Tangents::Vector,
            word: true,
            pattern: true,
            mesh: true,
            symmetry: true,
            chatter: true,
            features: Features { kinds: true, sine: true, ..Features::default() },
            measures: None,
        }
    }

    /// Returns the list of the lanes that it integrates.
    pub(super) fn list(&self) -> List {
        match (self.measures, self.tangents) {
            (Some(_), _) => List::Measure,
            (None, Tangents::Vector) => List::Growth,
            (None, Tangents::Columns) => List::Reading,
            (None, Tangents::None) => List::Plain,
        }
    }

    /// Returns its WGSL source.
    pub fn source(&self) -> String {
        let real = declarations_of(self.precision);
        let machine = self.features.machine;
        let terms = count(real, "TERMS");
        let harmonics = machine.map_or(self.features.harmonics, |shape| shape.harmonics);
        let dim = self.features.dim() as u32;
        let vectors = match self.tangents {
            Tangents::None => 0,
            Tangents::Vector => 1,
            Tangents::Columns => dim,
        };
        let code = SymbolCode::of_gaps(machine.map_or(1, |shape| shape.gaps as usize));
        let mut names = vec![
            ("TERMS", terms),
            ("SHORT_TERMS", count(real, "SHORT_TERMS")),
            ("HARMONICS", harmonics),
            ("COORDINATES", dim / 2),
            ("DIM", dim),
        ];
        let mut machine_sizes = Vec::new();
        if let Some(shape) = machine {
            let width = shape.width() as u32;
            names.push(("WIDTH", width));
            machine_sizes = shape.sizes();
            machine_sizes.extend([("SERIES", (terms + 1) * width), ("COEFFICIENTS", terms + 1)]);
        }
        let (structs, motion) = match machine {
            Some(_) => (layout::shared(), MACHINE),
            None => (layout::shared() + &layout::of_pairs(), OSCILLATOR),
        };
        let body = unroll(COMMON, &names) + &unroll(motion, &names);
        let valid = VALID.map(|(name, bits)| (format!("VALID_{name}"), bits));
        let status = Status::ALL.map(|s| (format!("STATUS_{}", s.name().to_uppercase()), s.code()));
        let contacts = CONTACTS.map(|(name, code)| (format!("CONTACT_{name}"), code));
        let lists = List::ALL.map(|list| (format!("LIST_{}", list.name().to_uppercase()), list as u32));
        let sizes = [
            ("WORKGROUP", self.workgroup),
            ("BLOCK", BLOCK),
            ("LISTS", LISTS as u32),
            ("KEYS", KEYS as u32),
            ("OWN_LIST", self.list() as u32),
            ("SUMS", SUMS as u32),
            ("SPELLING", if self.word || self.pattern { SPELLING as u32 } else { 1 }),
            ("SPELLED_WORD", SPELLED_WORD as u32),
            ("SPELLED_PATTERN", SPELLED_PATTERN as u32),
            ("SPELLED_WORD_LENGTH", SPELLED_WORD_LENGTH as u32),
            ("SPELLED_WORD_HASH", SPELLED_WORD_LENGTH as u32 + 1),
            ("SPELLED_PATTERN_LENGTH", SPELLED_PATTERN_LENGTH as u32),
            ("SPELLED_PATTERN_HASH", SPELLED_PATTERN_LENGTH as u32 + 1),
            ("EXTREMES", EXTREMES as u32),
            ("HARMONICS", harmonics),
            ("DIM", dim),
            ("MATRIX", dim * dim),
            ("VECTORS", vectors),
            ("COORDINATES", dim / 2),
            ("START", self.features.start_numbers() as u32),
            ("SYMBOL_BITS", code.bits as u32),
            ("HASH_WINDOW", code.window as u32),
            ("PAIRS_PER_HARMONIC", PAIRS_PER_HARMONIC as u32),
            ("WORD_SYMBOLS", code.most as u32),
            ("SYMBOLS_PER_NUMBER", symbols_per_number(code.bits) as u32),
        ]
        .into_iter()
        .chain(machine_sizes)
        .map(|(name, value)| (name.to_owned(), value));
        let numbers = valid.into_iter().chain(status).chain(contacts).chain(lists).chain(sizes);
        let numbers: String =
            numbers.map(|(name, value)| format!("const {name}: u32 = {value}u;\n")).collect();
        let options = [
            ("EXPONENT", self.exponent),
            ("GROWTH", self.tangents == Tangents::Vector),
            ("COLUMNS", self.tangents == Tangents::Columns),
            ("WORD", self.word),
            ("PATTERN", self.pattern),
            ("MESH", self.mesh),
            ("SYMMETRY", self.symmetry),
            ("CHATTER", self.chatter),
            ("KINDS", self.features.kinds),
            ("SINE", self.features.sine),
            ("STAGES", self.features.stages),
            ("MEASURE", self.measures.is_some()),
            ("EXTREME", self.measures.is_some_and(|measures| measures.extremes)),
            ("MOMENTS", self.measures.is_some_and(|measures| measures.moments)),
        ]
        .map(|(name, value)| format!("const {name}: bool = {value};\n"))
        .concat();
        format!("{real}\n{options}{numbers}{}{structs}{body}", rules::declarations(self.precision))
    }
}

/// The records' validity bits, by their names in the shader.
const VALID: [(&str, u32); 12] = [
    ("PERIOD", valid::PERIOD),
    ("LYAPUNOV", valid::LYAPUNOV),
    ("IMPACTS", valid::IMPACTS),
    ("MESH", valid::MESH),
    ("SYMMETRIC", valid::SYMMETRIC),
    ("WORD", valid::WORD),
    ("STROBE", valid::STROBE),
    ("PATTERN", valid::PATTERN),
    ("QUASI_PERIODIC", valid::QUASI_PERIODIC),
    ("OPEN", valid::OPEN),
    ("NEAR_STROBE", valid::NEAR_STROBE),
    ("TIED", valid::TIED),
];

/// Returns the declarations of a precision.
fn declarations_of(precision: Precision) -> &'static str {
    match precision {
        Precision::F32 => include_str!("../../shaders/real_f32.wgsl"),
        Precision::F64 => include_str!("../../shaders/real_f64.wgsl"),
    }
}

/// Returns the terms of the Taylor series of a step.
pub(super) fn terms_of(precision: Precision) -> u32 {
    count(declarations_of(precision), "TERMS")
}

/// Returns a number that a precision's file declares.
fn count(real: &str, name: &str) -> u32 {
    let (_, after) = real
        .split_once(&format!("const {name}: u32 = "))
        .expect("the precision declares its numbers of terms");
    let (number, _) = after.split_once("u;").expect("they are numbers");
    number.parse().expect("they are numbers")
}
