//! Structs in the buffers that host and shaders share, and other numbers that both know.
//!
//! This file declares the structs that the host writes or reads, for both sides; `shaders/layout.wgsl` declares those that only lanes use.
//! A struct holds real numbers or 32-bit numbers alone. Real numbers are f64 here and are converted one by one for the f32 variant, so both
//! precisions have the same shape.

use std::sync::LazyLock;

use bytemuck::{Pod, Zeroable};

use super::rules::TRAIL;
use rattlemap_dynamics::model::{Contact, STATE};
use rattlemap_dynamics::named;

/// Declares structs for the host, and a function that returns their declarations in WGSL. Lengths of arrays have names that the shader
/// knows, too. A field behind a semicolon exists in the shader only.
macro_rules! structs {
    (
        $(#[$of_all:meta])* fn $declarations:ident;
        $($(#[$doc:meta])* $name:ident { $($field:ident: $type:ty,)* $(; $last:ident: $more:ident,)? })*
    ) => {
        $(
            $(#[$doc])*
            #[allow(missing_docs, reason = "comments describe the fields, some of them together")]
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
            pub struct $name {
                $(pub $field: $type,)*
            }
        )*

        $(#[$of_all])*
        pub(super) fn $declarations() -> String {
            let structs = [$((
                stringify!($name),
                vec![
                    $((stringify!($field), in_wgsl(stringify!($type))),)*
                    $((stringify!($last), stringify!($more).to_owned()),)?
                ],
            )),*];
            let declared = structs.map(|(name, fields)| {
                let align = match name {
                    "Domain" | "Law" => "@align(FOUR_REALS) ",
                    "Cell" => "@align(16) ",
                    _ => "",
                };
                let fields: String = fields.iter().map(|(name, of)| format!("    {name}: {of},\n")).collect();
                format!("struct {name} {{\n    {align}{}}}\n\n", fields.trim_start())
            });
            declared.concat()
        }
    };
}

/// Returns a type in WGSL.
fn in_wgsl(of: &str) -> String {
    match of.strip_prefix('[').and_then(|list| list.strip_suffix(']')?.rsplit_once("; ")) {
        Some((of, length)) => format!("array<{}, {length}>", in_wgsl(of)),
        None if of == "f64" => "Real".to_owned(),
        None => of.to_owned(),
    }
}

structs! {
    /// Returns the declarations of the structs that both engines of motion use.
    fn shared;

    /// Flow, law and start conditions of one lane.
    Cell {
        flow_index: u32,
        law_index: u32,
        // Status (STATUS_*) of a lane that the host refuses; 0 otherwise.
        refused: u32,
        // 1 if the mirror image of a motion obeys the same equations and contact law.
        mirror: u32,
    }

    /// Settings of one dispatch.
    Settings {
        // Number of lanes for which the buffers have room.
        slots: u32,
        // Length of the active list, and the place of its first lane that has not begun.
        active_lanes: u32,
        first_new: u32,
        // Largest number of forcing periods: of any lane, of an undecided lane, and of a chaotic lane.
        periods: u32,
        decided_by: u32,
        longest: u32,
        // 1: undecided lanes end after `periods` with VALID_OPEN.
        hands_over: u32,
        // First period at which a lane may stop as chaotic.
        chaos_from: u32,
        // Number of standard errors by which the exponent of such a lane must exceed zero.
        chaos_errors: f32,
        // A dispatch ends for a lane after this number of loop iterations.
        iterations: u32,
        // Largest length of a list whose lanes get a warp each.
        few_lanes: u32,
        // Passes (scan steps and careful steps) allowed in one period.
        passes_per_period: u32,
        // Events allowed in one period, and in all periods together.
        events_per_period: u32,
        most_events: u32,
        // Invocations in one row of the dispatch grid.
        row: u32,
        // Periods before averages begin.
        transient_periods: u32,
        // Period at which lanes without a tangent vector wait for the kernel that carries it.
        growth_from: u32,
        // Periods before the exponent is accumulated, and periods per block of its average.
        exponent_from: u32,
        exponent_block: u32,
        // Longest period that is searched for; 0 searches for none.
        max_period: u32,
        // 1: lanes end once they are decided.
        early_stop: u32,
        // Periods over which aperiodic motion is measured; 0 measures nothing.
        measured_periods: u32,
    }

    /// Results of a lane: real numbers.
    Reading {
        // Exponent per period as a natural logarithm, and its standard error.
        growth: f64,
        growth_error: f64,
        mesh_fraction: f64,
        // Gap, its rate per free step, x, its rate; or displacements and rates of a machine.
        strobe: [f64; DIM],
    }

    /// What was measured on a lane, and the columns of its monodromy matrix.
    Measured {
        totals: [f64; SUMS],
        highs: [f64; EXTREMES],
        lows: [f64; EXTREMES],
        // 1 if a cycle was read; otherwise the columns have no meaning.
        has_read: f64,
        ;
        tangents: Matrix,
    }

    /// Results of a lane: whole numbers.
    Finding {
        // Bits VALID_*. A field without its bit is zero.
        valid: u32,
        // Slot of the lane.
        slot: u32,
        status: u32,
        // 0 if the motion has no period.
        period: u32,
        periods_run: u32,
        impacts: u32,
        // Periods over which impacts were counted.
        counted: u32,
        symmetric: u32,
        // Word and pattern, at the places SPELLED_*; one unused number if neither is requested.
        spelling: [u32; SPELLING],
    }
}

structs! {
    /// Returns the declarations of the constants of oscillators with one gap.
    fn of_pairs;

    /// A linear domain in units of its own step: time tau = t / h, rates per step.
    Domain {
        // Propagator of one step minus the identity. Rows: gap, its rate, x, its rate. Columns: these four, then cos,
        // sin, 1.
        step: [f64; 28],
        // Accelerations of the gap and of x: factors of gap, rate, x, rate, cos, 1, sin. Only variants with SINE read the last.
        gap_row: [f64; 7],
        x_row: [f64; 7],
        // Quadratic form in the n-th derivatives of the motion. It bounds the square of the (n+1)-th derivative of the gap. Factors of rate^2,
        // rate * x_rate, x_rate^2, gap^2, gap * x, x^2.
        energy: [f64; 6],
        // Growth of this bound per step: the part that the force adds, for n = 5, and the factor by negative damping and stiffness.
        growth: f64,
        swell: f64,
        // Forcing angle of one step; tan of half of it; sin of it.
        angle: f64,
        turn_half: f64,
        turn_sin: f64,
        // Power of the dampers as a quadratic form in the rates, in the units of measure.wgsl: factors of rate^2, rate * x_rate, x_rate^2.
        damping: [f64; 3],
        // Free steps per step of this domain: a power of two, at most 1.
        share: f64,
        // Steps of this domain per free step.
        substeps: f64,
        // Fills the struct to a multiple of four numbers.
        unused: [f64; 2],
    }

    /// Constants that lanes share if they differ only in the contact law. Each stage has such a struct.
    Flow {
        // Free motion, meshing on the right, meshing on the left. Meshing domains measure the gap from their wall.
        domains: [Domain; 3],
        // Positions of the right and of the left wall.
        walls: [f64; 2],
        // Change of the rate of x if the contact impulse reduces the gap's rate by 1.
        kick: f64,
        // Length of a free step in time units.
        h: f64,
        // Scale of length: with two first walls, half of their distance.
        length: f64,
        // Unit of speeds: the scale of length times the rate of free motion, per free step.
        speed: f64,
        // Longest duration of an infinite series of impacts that its limit replaces, in free steps.
        closing: f64,
        // Motion has escaped if the sum of the sizes of gap and x exceeds this. Negative if only the force can raise the energy.
        escape: f64,
        // Contact-free motion. `steady`: steady state at phase 0, in lane units. `contact_free_size`: if the transient is smaller than this by
        // the free domain's energy form, no contact will follow; negative if no transient is small enough. `transient_growth`: growth of the
        // transient per period, in octaves.
        steady: [f64; 4],
        contact_free_size: f64,
        transient_growth: f64,
        // Acceleration of a gap that rests on the right and on the left wall: a `gap_row` with the gap measured from that wall.
        pressing: [[f64; 7]; 2],
        // Where the motion enters an elastic wall, tangent vectors change: change of their rates of gap and x per displacement of their gap.
        damper: [[f64; 2]; 2],
        // Contact force of the right and of the left wall per displacement and per rate of the gap, in the units of
        // measure.wgsl.
        springs: [[f64; 2]; 2],
        // Both displacements of the model as factors of gap and x.
        displacements: [[f64; 2]; 2],
    }

    /// Whole numbers of a flow.
    FlowShape {
        // Free steps per forcing period.
        steps: u32,
        // Index in `pairs` of its first phasor.
        phasors: u32,
        // Number of displacements. With one displacement, x rests at 0.
        degrees: u32,
        // 1 if contact-free motion also requires that x rests at 0.
        must_rest: u32,
        // CONTACT_* of the right and of the left wall.
        contacts: [u32; 2],
        // Index in `pairs` of its harmonics beside the first (harmonics.wgsl), and their number.
        harmonics: u32,
        harmonic_count: u32,
        // Index in `pairs` of the changes of its stage (stages.wgsl), and their number; 0 if there are none.
        schedule: u32,
        changes: u32,
    }

    /// Contact law of the right and of the left wall: restitution, and the largest leaving speed at which contact lasts under a pressing load.
    Law {
        restitution: [f64; 2],
        mesh_speed: [f64; 2],
    }
}

/// Returns how many numbers a struct has that both engines of motion use, in variants whose lanes have `dim` numbers.
pub fn length_of(name: &str, dim: usize) -> usize {
    static DECLARED: LazyLock<String> =
        LazyLock::new(|| shared() + include_str!("../../shaders/layout.wgsl"));
    let (_, from) = DECLARED.split_once(&format!("struct {name} {{")).expect("the struct is declared");
    let (fields, _) = from.split_once('}').expect("a struct ends");
    let fields = fields.lines().map(str::trim).filter(|line| !line.starts_with("//"));
    let types = fields.filter_map(|field| field.strip_suffix(',')?.split_once(": "));
    let mut length = 0;
    let mut unit = 1;
    for (name, of) in types {
        if name.starts_with("@align") {
            unit = 4;
            length = usize::next_multiple_of(length, unit);
        }
        length += length_of_type(of, dim);
    }
    length.next_multiple_of(unit)
}

/// Returns how many numbers a type has.
fn length_of_type(of: &str, dim: usize) -> usize {
    match of {
        "u32" | "f32" | "Real" => 1,
        "State" => dim,
        "Matrix" => dim * dim,
        _ => match of.strip_prefix("array<").and_then(|list| list.strip_suffix('>')?.rsplit_once(", ")) {
            Some((of, length)) => length_of_type(of, dim) * entries(length, dim),
            None => length_of(of, dim),
        },
    }
}

/// Returns the length of an array.
fn entries(length: &str, dim: usize) -> usize {
    match length {
        "DIM" => dim,
        "COORDINATES + 1" => dim / 2 + 1,
        "EXTREMES" => EXTREMES,
        "SPELLING" => SPELLING,
        "SUMS" => SUMS,
        "TRAIL" => TRAIL,
        number => number.parse().expect("a length is a number or has a known name"),
    }
}

impl Measured {
    /// Splits off the columns of the monodromy matrix, which come last.
    pub(super) fn split(numbers: &[f64]) -> (&Measured, &[f64]) {
        let (fixed, columns) = numbers.split_at(size_of::<Measured>() / size_of::<f64>());
        (bytemuck::from_bytes(bytemuck::cast_slice(fixed)), columns)
    }
}

/// Largest number of entries of a lane's state. Each variant of the shader has its own.
const DIM: usize = STATE;

/// Sums and extremes that a lane measures; `shaders/pair/measure.wgsl` has their places.
pub(super) const SUMS: usize = 16;
pub(super) const EXTREMES: usize = 5;

/// Numbers for a word and a pattern in a [`Finding`].
pub(super) const SPELLING: usize = 20;

/// Places of symbols and length in a spelling, with their names in the shader. The two halves of the hash follow the length. A word or
/// pattern has a hash if it is too long to be stored.
pub(super) const SPELLED_WORD: usize = 0;
pub(super) const SPELLED_PATTERN: usize = 7;
pub(super) const SPELLED_WORD_LENGTH: usize = 14;
pub(super) const SPELLED_PATTERN_LENGTH: usize = 17;

impl Finding {
    /// Returns the size on the device, in numbers: with or without words and patterns.
    pub const fn length(is_spelled: bool) -> usize {
        size_of::<Finding>() / size_of::<u32>() - if is_spelled { 0 } else { SPELLING - 1 }
    }
}

named! {
    /// A list of lanes. Each kernel has one. `Observe` overlaps the three before it.
    pub(super) enum List {
        /// Lanes that are integrated without the exponent's tangent vector.
        Plain = "plain",
        /// Lanes that are integrated with this vector.
        Growth = "growth",
        /// Lanes that read a cycle with the columns of its monodromy matrix.
        Reading = "reading",
        /// Lanes of the lists above, which are observed at stop phases.
        Observe = "observe",
        /// Lanes that are measured.
        Measure = "measure",
        /// Lanes that have read a cycle.
        Judge = "judge",
        /// Lanes that have ended.
        Ended = "ended",
    }
}

/// Number of lists.
pub(super) const LISTS: usize = List::ALL.len();

/// Number of keys by which lanes are sorted (shaders/lists.wgsl).
pub(super) const KEYS: usize = 4 * LISTS;

/// Number of lanes of a workgroup that makes lists.
pub(super) const BLOCK: u32 = 256;

/// Number of entries of the queue in front of its slots. The first ones are the lengths of the lists; the counter of lists follows.
pub(super) const QUEUE_HEAD: usize = 2 * LISTS + 1;

/// Returns the number of symbols that one number of a word or a pattern holds.
pub(super) fn symbols_per_number(bits: usize) -> usize {
    30 / bits
}

/// Codes of the kinds of contact, with their names in the shader.
pub(super) const CONTACTS: [(&str, u32); 3] = [("IMPACT", 0), ("RIGID", 1), ("ELASTIC", 2)];

/// Returns the code of a kind of contact.
pub(super) fn contact_code(contact: Contact) -> u32 {
    let [(_, impact), (_, rigid), (_, elastic)] = CONTACTS;
    match contact {
        Contact::Impact => impact,
        Contact::Rigid => rigid,
        // No pair has a wall that only pushes.
        Contact::Elastic | Contact::Pushing => elastic,
    }
}
