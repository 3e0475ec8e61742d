//! The structs of `shaders/layout.wgsl` as the host reads and writes them, and other numbers that host and shaders share.
//!
//! `shaders/layout.wgsl` describes the fields; a test compares their names, offsets and sizes. A struct holds real numbers or 32-bit
//! numbers alone. Real numbers are f64 here and are converted one by one for the f32 variant, so both precisions have the same shape.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};

use super::rules::TRAIL;
use rattlemap_dynamics::model::{Contact, STATE};

/// Layout of one struct, for the comparison with the shader.
#[derive(Clone, Copy, Debug)]
pub struct StructLayout {
    /// Name of the struct.
    pub name: &'static str,
    /// Names and byte offsets of its fields.
    pub fields: &'static [(&'static str, usize)],
    /// Size in bytes.
    pub size: usize,
    /// Whether its numbers are real. The size of real numbers depends on the precision.
    pub is_real: bool,
}

/// Declares the structs, and lists their layouts in `STRUCTS`.
macro_rules! structs {
    ($($(#[$doc:meta])* $name:ident of $number:ident { $($field:ident: $type:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[allow(missing_docs, reason = "shaders/layout.wgsl describes the fields")]
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
            pub struct $name {
                $(pub $field: $type,)*
            }
        )*

        /// Layouts of all structs that the shader shares with the host.
        pub const STRUCTS: &[StructLayout] = &[$(StructLayout {
            name: stringify!($name),
            fields: &[$((stringify!($field), offset_of!($name, $field))),*],
            size: size_of::<$name>(),
            is_real: size_of::<$number>() == size_of::<f64>(),
        }),*];
    };
}

structs! {
    /// One linear domain in units of its own step.
    Domain of f64 {
        step: [f64; 28],
        gap_row: [f64; 7],
        x_row: [f64; 7],
        energy: [f64; 6],
        growth: f64,
        swell: f64,
        angle: f64,
        turn_half: f64,
        turn_sin: f64,
        damping: [f64; 3],
        share: f64,
        substeps: f64,
    }

    /// Constants that lanes share if they differ only in the contact law.
    Flow of f64 {
        domains: [Domain; 3],
        walls: [f64; 2],
        kick: f64,
        h: f64,
        length: f64,
        speed: f64,
        closing: f64,
        escape: f64,
        steady: [f64; 4],
        contact_free_size: f64,
        transient_growth: f64,
        pressing: [[f64; 7]; 2],
        damper: [[f64; 2]; 2],
        springs: [[f64; 2]; 2],
        displacements: [[f64; 2]; 2],
        held: [f64; 3],
        push: [f64; 3],
        preload: [[f64; 2]; 2],
    }

    /// Whole numbers of a [`Flow`].
    FlowShape of u32 {
        steps: u32,
        phasors: u32,
        degrees: u32,
        must_rest: u32,
        contacts: [u32; 2],
        harmonics: u32,
        harmonic_count: u32,
        schedule: u32,
        changes: u32,
        behind: [u32; 2],
    }

    /// Contact law of the right and of the left wall.
    Law of f64 {
        restitution: [f64; 2],
        mesh_speed: [f64; 2],
    }

    /// Flow, law and start conditions of a lane.
    Cell of u32 {
        flow_index: u32,
        law_index: u32,
        refused: u32,
        mirror: u32,
    }

    /// Settings of one dispatch.
    Settings of u32 {
        slots: u32,
        active_lanes: u32,
        first_new: u32,
        periods: u32,
        decided_by: u32,
        longest: u32,
        chaos_from: u32,
        chaos_errors: f32,
        iterations: u32,
        ended: u32,
        passes_per_period: u32,
        events_per_period: u32,
        most_events: u32,
        row: u32,
        transient_periods: u32,
        growth_from: u32,
        exponent_from: u32,
        exponent_block: u32,
        max_period: u32,
        early_stop: u32,
        measured_periods: u32,
    }

    /// Real numbers that a lane carries between dispatches.
    Motion of f64 {
        q: [f64; 4],
        phasor: [f64; 2],
        theta: f64,
        bound: f64,
        bend: f64,
        mesh_part: f64,
        block_growth: f64,
        growth_sum: f64,
        growth_squares: f64,
        growth_products: f64,
        first_block: f64,
        last_block: f64,
        anchor: [f64; 4],
        position_scale: f64,
        early_scale: f64,
        early_rate_scale: f64,
        rate_scale: f64,
        cycle_growth: f64,
        cycle_stretch: f64,
        earlier_growth: f64,
        earlier_distance: f64,
        tangents: [f64; 16],
        vector: [f64; 4],
        stretch: [f64; 3],
        trail: [[f64; 4]; TRAIL],
        averages: [f64; 3],
        average_centre: [f64; 4],
        ended: [f64; 11],
        sums: [f64; SUMS],
        totals: [f64; SUMS],
        highs: [f64; EXTREMES],
        lows: [f64; EXTREMES],
    }

    /// Counters and flags that a lane carries between dispatches.
    Tally of u32 {
        step: u32,
        is_scan_interrupted: u32,
        mode: u32,
        origin: u32,
        order: u32,
        period: u32,
        status: u32,
        passes_in_period: u32,
        events_in_period: u32,
        impacts: u32,
        events: u32,
        mesh_right: u32,
        mesh_left: u32,
        mesh_whole: u32,
        grazes: u32,
        stage: u32,
        candidate: u32,
        periods_to_read: u32,
        tangent_count: u32,
        carries_growth: u32,
        word_length: u32,
        hash_low: u32,
        hash_high: u32,
        recent: u32,
        strobe_distance: u32,
        itinerary: u32,
        next_change: u32,
        interval: u32,
        has_read: u32,
        cycle: u32,
        failed_readings: u32,
        counting_start: u32,
        blocks: u32,
        block_periods: u32,
        anchor_period: u32,
        window: u32,
        streak: u32,
        known_lags: u32,
        is_settled: u32,
        mirror: u32,
        return_distance: u32,
        earlier_return_distance: u32,
        newton_steps: u32,
        branch: u32,
        branch_period: u32,
        newton_start_mode: u32,
        newton_start_origin: u32,
        newton_start_interval: u32,
        divisor: u32,
        divisor_distance: u32,
        failed_searches: u32,
        checks_divisor: u32,
        rejected_divisor: u32,
        linear_distance: u32,
        motion_distance: u32,
        nearest: u32,
        earlier_branch: u32,
        is_uncertain: u32,
        strobe_count: u32,
        matching_cycles: u32,
        all_events: u32,
        confirms_chaos: u32,
        average_start: u32,
        average_length: u32,
        recurrence: u32,
        is_neutral: u32,
        distances: [u32; 16],
        last_distances: [u32; 16],
        itineraries: [u32; TRAIL],
        column_scalings: u32,
        is_superstable: u32,
        has_overflowed: u32,
        word: [u32; 7],
        pattern: [u32; 7],
        pattern_length: u32,
        pattern_hash: [u32; 2],
        pattern_recent: u32,
        ended: [u32; 28],
        is_measured: u32,
    }

    /// Results of a lane: real numbers.
    Reading of f64 {
        growth: f64,
        growth_error: f64,
        mesh_fraction: f64,
        strobe: [f64; MOST_NUMBERS],
    }

    /// What was measured on a lane. The columns of the monodromy matrix follow.
    Measured of f64 {
        totals: [f64; SUMS],
        highs: [f64; EXTREMES],
        lows: [f64; EXTREMES],
        has_read: f64,
    }

    /// Results of a lane: whole numbers.
    Finding of u32 {
        valid: u32,
        slot: u32,
        status: u32,
        period: u32,
        periods_run: u32,
        impacts: u32,
        counted: u32,
        symmetric: u32,
        spelling: [u32; SPELLING],
    }
}

/// Largest number of entries of a lane's state.
const MOST_NUMBERS: usize = STATE;

/// Returns the size on the host of a struct in variants whose lanes have `dim` numbers.
pub fn size_with(host: &StructLayout, dim: usize) -> usize {
    let numbers = match host.name {
        "Motion" => Motion::numbers(dim),
        "Reading" => Reading::numbers(dim),
        "Measured" => Measured::numbers(dim),
        _ => return host.size,
    };
    numbers * size_of::<f64>()
}

/// Numbers of the structs whose size depends on the number `dim` of a lane's state.
impl Motion {
    pub(super) fn numbers(dim: usize) -> usize {
        // These fields depend on `dim`: the states in `now` and `ended`, the anchor, the vector, the trail, the averages and their centre,
        // and the matrix.
        let of_dim = |dim: usize| dim * (5 + TRAIL) + dim / 2 + dim * dim;
        size_of::<Motion>() / size_of::<f64>() + of_dim(dim) - of_dim(4)
    }
}

impl Reading {
    pub(super) fn numbers(dim: usize) -> usize {
        size_of::<Reading>() / size_of::<f64>() - MOST_NUMBERS + dim
    }
}

impl Measured {
    pub(super) fn numbers(dim: usize) -> usize {
        Self::BEFORE_COLUMNS + dim * dim
    }

    const BEFORE_COLUMNS: usize = size_of::<Measured>() / size_of::<f64>();

    /// Splits off the columns of the monodromy matrix, which come last.
    pub(super) fn split(numbers: &[f64]) -> (&Measured, &[f64]) {
        let (fixed, columns) = numbers.split_at(Self::BEFORE_COLUMNS);
        (bytemuck::from_bytes(bytemuck::cast_slice(fixed)), columns)
    }
}

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

/// Number of lanes per workgroup of a compaction.
pub(super) const BLOCK: u32 = 256;

/// Number of entries of the queue in front of its slots, and the byte offsets of these two entries: the number of selected lanes, and the
/// counter of compactions.
pub(super) const QUEUE_HEAD: usize = 2;
pub(super) const COUNT_AT: u64 = 0;
pub(super) const BEAT_AT: u64 = 4;

/// Returns the number of symbols that one number of a word or a pattern holds.
pub(super) fn symbols_per_number(bits: usize) -> usize {
    30 / bits
}

/// Stands for "no interval" where the index of a flow is expected.
pub(super) const NO_FLOW: u32 = u32::MAX;

/// Codes of the kinds of contact, with their names in the shader.
pub(super) const CONTACTS: [(&str, u32); 3] = [("IMPACT", 0), ("RIGID", 1), ("ELASTIC", 2)];

/// Returns the code of a kind of contact.
pub(super) fn contact_code(contact: Contact) -> u32 {
    let [(_, impact), (_, rigid), (_, elastic)] = CONTACTS;
    match contact {
        Contact::Impact => impact,
        Contact::Rigid => rigid,
        // A wall that only pushes is described by further pages (pair/pushing.rs).
        Contact::Elastic | Contact::Pushing => elastic,
    }
}
