//! Shader variants: one source, put together from small files.

use super::reading::SYMBOLS_PER_NUMBER;
use super::rounds::BLOCK;
use super::tables::CONTACTS;
use super::unroll::unroll;
use super::{FOLLOWED_MESH_SPEED, rules};
use crate::record::{WORD_SYMBOLS, valid};
use rattlemap_dynamics::orbit::Status;

/// Precision of a variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Single precision, on every adapter.
    F32,
    /// Double precision, where the adapter has `SHADER_F64`.
    F64,
}

impl Precision {
    /// Both precisions.
    pub const ALL: [Precision; 2] = [Precision::F32, Precision::F64];

    /// The name in manifests and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        }
    }

    /// Bytes of a real number.
    pub fn bytes(self) -> usize {
        match self {
            Precision::F32 => 4,
            Precision::F64 => 8,
        }
    }
}

/// What is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// Precision of the motion.
    pub precision: Precision,
    /// Invocations per workgroup.
    pub workgroup: u32,
    /// Whether cycles are read with their monodromy matrix.
    pub exponent: bool,
    /// Whether a tangent vector is carried for the exponent of motion at no cycle.
    pub growth: bool,
    /// Whether cycles get their word spelled out.
    pub word: bool,
    /// Whether they get their word's pattern.
    pub pattern: bool,
    /// Whether the time spent meshing is counted.
    pub mesh: bool,
    /// Whether cycles are compared with their mirror image.
    pub symmetry: bool,
    /// Whether chatter may be followed by short flights.
    pub chatter: bool,
    /// Whether walls may be elastic or rigid.
    pub kinds: bool,
    /// Whether lanes keep copies of all their constants, and of what strobes alone take: for software drivers.
    pub keep: bool,
}

/// Invocations per workgroup where nothing else is asked for.
pub const WORKGROUP: u32 = 64;

/// All but the precision.
const BODY: &str = concat!(
    include_str!("../../shaders/layout.wgsl"),
    include_str!("../../shaders/domain.wgsl"),
    include_str!("../../shaders/phase.wgsl"),
    include_str!("../../shaders/contact.wgsl"),
    include_str!("../../shaders/elastic.wgsl"),
    include_str!("../../shaders/rigid.wgsl"),
    include_str!("../../shaders/taylor.wgsl"),
    include_str!("../../shaders/flight.wgsl"),
    include_str!("../../shaders/events.wgsl"),
    include_str!("../../shaders/chatter.wgsl"),
    include_str!("../../shaders/tangent.wgsl"),
    include_str!("../../shaders/observe.wgsl"),
    include_str!("../../shaders/recurrence.wgsl"),
    include_str!("../../shaders/chaos.wgsl"),
    include_str!("../../shaders/word.wgsl"),
    include_str!("../../shaders/cycle.wgsl"),
    include_str!("../../shaders/refine.wgsl"),
    include_str!("../../shaders/approach.wgsl"),
    include_str!("../../shaders/sweep.wgsl"),
    include_str!("../../shaders/compact.wgsl"),
    include_str!("../../shaders/begin.wgsl"),
    include_str!("../../shaders/record.wgsl"),
);

impl Variant {
    /// The variant of a precision with the usual workgroup.
    pub fn of(precision: Precision) -> Variant {
        Variant {
            precision,
            workgroup: WORKGROUP,
            exponent: true,
            growth: true,
            word: true,
            pattern: true,
            mesh: true,
            symmetry: true,
            chatter: true,
            kinds: true,
            keep: false,
        }
    }

    /// Its WGSL source.
    pub fn source(&self) -> String {
        let real = match self.precision {
            Precision::F32 => include_str!("../../shaders/real_f32.wgsl"),
            Precision::F64 => include_str!("../../shaders/real_f64.wgsl"),
        };
        let Variant {
            workgroup, exponent, growth, word, pattern, mesh, symmetry, chatter, kinds, keep, ..
        } = self;
        let names = ["TERMS", "SHORT_TERMS"].map(|name| (name, count(real, name)));
        let body = unroll(BODY, &names);
        let valid = VALID.map(|(name, bits)| ("VALID", name.to_owned(), bits));
        let status = Status::ALL.map(|status| ("STATUS", status.name().to_uppercase(), status.code()));
        let contacts = CONTACTS.map(|(name, code)| ("CONTACT", name.to_owned(), code));
        let numbered = valid.into_iter().chain(status).chain(contacts);
        let codes: String =
            numbered.map(|(kind, name, code)| format!("const {kind}_{name}: u32 = {code}u;\n")).collect();
        let rules = rules::declarations(self.precision);
        format!(
            "{real}\nconst WORKGROUP: u32 = {workgroup}u;\nconst EXPONENT: bool = {exponent};\n\
             const GROWTH: bool = {growth};\n\
             const WORD: bool = {word};\nconst PATTERN: bool = {pattern};\nconst MESH: bool = {mesh};\nconst SYMMETRY: bool = {symmetry};\n\
             const CHATTER: bool = {chatter};\nconst KINDS: bool = {kinds};\nconst FOLLOWED_MESH_SPEED: Real = {FOLLOWED_MESH_SPEED};\n\
             const KEEP: bool = {keep};\nconst WORD_SYMBOLS: u32 = {WORD_SYMBOLS}u;\n\
             const SYMBOLS_PER_NUMBER: u32 = {SYMBOLS_PER_NUMBER}u;\nconst BLOCK: u32 = {BLOCK}u;\n{codes}{rules}{body}"
        )
    }
}

/// The records' validity bits under their names in the shader.
const VALID: [(&str, u32); 8] = [
    ("PERIOD", valid::PERIOD),
    ("LYAPUNOV", valid::LYAPUNOV),
    ("IMPACTS", valid::IMPACTS),
    ("MESH", valid::MESH),
    ("SYMMETRIC", valid::SYMMETRIC),
    ("WORD", valid::WORD),
    ("STROBE", valid::STROBE),
    ("PATTERN", valid::PATTERN),
];

/// A number that a precision's file declares.
fn count(real: &str, name: &str) -> u32 {
    let (_, after) = real
        .split_once(&format!("const {name}: u32 = "))
        .expect("the precision declares its numbers of terms");
    let (number, _) = after.split_once("u;").expect("they are numbers");
    number.parse().expect("they are numbers")
}
