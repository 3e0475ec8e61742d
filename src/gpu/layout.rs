//! The host's side of the structs in `shaders/layout.wgsl`.
//!
//! Structs of reals are written once, in f64, and rounded number by number for the f32
//! variant: they hold nothing else, so both precisions have the same shape.

use bytemuck::{Pod, Zeroable};

use super::rules::TRAIL;

/// One linear domain in units of its own step; see the shader for the meaning of each field.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Domain {
    /// Propagator of one step less the identity, row by row.
    pub step: [f64; 28],
    /// Acceleration of the gap.
    pub gap_row: [f64; 6],
    /// Acceleration of the second displacement.
    pub x_row: [f64; 6],
    /// Quadratic form that bounds the gap's derivatives.
    pub energy: [f64; 6],
    /// Growth of that bound per step.
    pub growth: f64,
    /// Forcing angle per step.
    pub angle: f64,
    /// `tan` of half of it.
    pub turn_half: f64,
    /// `sin` of it.
    pub turn_sin: f64,
    /// Free steps per step of this domain.
    pub share: f64,
    /// Steps of this domain per free step.
    pub substeps: f64,
}

/// All that is common to lanes that differ in the contact law alone.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Flow {
    /// Free motion, meshing on the right, meshing on the left.
    pub domains: [Domain; 3],
    /// Right and left wall.
    pub walls: [f64; 2],
    /// Share of the contact impulse that the second displacement takes.
    pub kick: f64,
    /// Length of a free step.
    pub h: f64,
    /// Half the walls' distance times the rate of free motion, per free step: what speeds are measured by.
    pub speed: f64,
    /// Longest series of impacts that is closed in one jump, in free steps.
    pub closing: f64,
    /// Steady state of contact-free motion at phase 0, in lane units.
    pub steady: [f64; 4],
    /// Size of its transients below which no event will come; negative where there is none.
    pub reach: f64,
    /// Its growth per period, in octaves.
    pub decay: f64,
    /// Acceleration of a gap that is held at the right and at the left wall, as [`Domain::gap_row`] from there.
    pub pressing: [[f64; 6]; 2],
    /// What the rates of the gap and of the second displacement change by, per displacement of the gap, where
    /// the right and the left wall are reached that are elastic.
    pub damper: [[f64; 2]; 2],
}

/// Whole numbers that belong to a [`Flow`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct FlowShape {
    /// Free steps per forcing period.
    pub steps: u32,
    /// Index of its first phasor.
    pub phasors: u32,
    /// How many displacements there are.
    pub degrees: u32,
    /// Code of the right and of the left wall's kind of contact.
    pub contacts: [u32; 2],
}

/// The contact law of a cell.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Law {
    /// Coefficient of restitution of the right and of the left wall.
    pub restitution: [f64; 2],
    /// Leaving speed up to which a pressed contact lasts there.
    pub mesh_speed: [f64; 2],
}

/// What a lane integrates.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Cell {
    /// Index of its flow.
    pub flow_index: u32,
    /// Index of its law.
    pub law_index: u32,
    /// Status code of a lane that is refused before it starts, else 0.
    pub refused: u32,
    /// 1 if the mirror image of a motion is a motion.
    pub mirror: u32,
}

/// Settings of one dispatch.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Settings {
    /// Lanes that the buffers have room for.
    pub slots: u32,
    /// Lanes under way: the active list is as long.
    pub active_lanes: u32,
    /// Where those in it begin that are at their starts.
    pub fresh: u32,
    /// Forcing periods to integrate.
    pub periods: u32,
    /// The most that undecided lanes get.
    pub longest: u32,
    /// The first period at which chaos may be called early.
    pub chaos_from: u32,
    /// Standard errors by which the exponent must exceed zero then.
    pub chaos_errors: f32,
    /// Loop iterations that one dispatch may spend on a lane.
    pub iterations: u32,
    /// Passes allowed in one period.
    pub passes_per_period: u32,
    /// Events allowed in one period.
    pub events_per_period: u32,
    /// Events allowed in all.
    pub most_events: u32,
    /// Invocations along the first dimension of a dispatch.
    pub row: u32,
    /// Periods before averages are taken.
    pub transient_periods: u32,
    /// Periods before the tangent vector is carried.
    pub growth_from: u32,
    /// Periods before the exponent is accumulated.
    pub exponent_from: u32,
    /// Periods per block of the exponent.
    pub exponent_block: u32,
    /// Longest period searched for; 0 searches for none.
    pub max_period: u32,
    /// 1: lanes end once they are decided.
    pub early_stop: u32,
    /// 1: lanes that have ended are queued, not those that there is work for.
    pub ended: u32,
}

/// The motion of a lane between dispatches.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Motion {
    /// Gap (from the wall while meshing), its rate, second displacement, its rate; rates
    /// per free step.
    pub q: [f64; 4],
    /// Forcing phasor.
    pub phasor: [f64; 2],
    /// Fraction of the free step that has passed.
    pub theta: f64,
    /// Bound on the sixth derivative of the gap.
    pub bound: f64,
    /// Second derivative of the gap where a scan was cut.
    pub bend: f64,
    /// Time spent meshing in parts of steps, in free steps, less the whole ones.
    pub mesh_part: f64,
    /// Growth of the present block, in octaves.
    pub block_growth: f64,
    /// Sum of the whole blocks' growth.
    pub growth_sum: f64,
    /// Sum of the squares of their deviations from the mean.
    pub growth_squares: f64,
    /// Strobe state that later ones are compared with.
    pub anchor: [f64; 4],
    /// Largest position at strobes.
    pub position_scale: f64,
    /// Largest rate at strobes.
    pub rate_scale: f64,
    /// Largest multiplier of the cycle that was read, binary logarithm of its modulus.
    pub cycle_growth: f64,
    /// Tangent vectors in lane units.
    pub tangents: [f64; 16],
    /// The one for the exponent while the monodromy matrix takes their place.
    pub vector: [f64; 4],
    /// The last strobes.
    pub trail: [[f64; 4]; TRAIL],
}

/// The counting of a lane between dispatches.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Tally {
    /// Free steps since phase 0.
    pub step: u32,
    /// 1 where a scan was cut by the end of a dispatch.
    pub cut: u32,
    /// What governs the motion.
    pub mode: u32,
    /// Wall of the last event.
    pub origin: u32,
    /// Order of the root of the distance from that wall at the start.
    pub order: u32,
    /// Forcing periods completed.
    pub period: u32,
    /// Status code.
    pub status: u32,
    /// Steps taken in this period.
    pub passes_in_period: u32,
    /// Events in this period.
    pub events_in_period: u32,
    /// Impacts so far.
    pub impacts: u32,
    /// Events so far.
    pub events: u32,
    /// Whole steps of the right meshing domain.
    pub mesh_right: u32,
    /// Whole steps of the left meshing domain.
    pub mesh_left: u32,
    /// Whole free steps of meshing, made of parts of steps.
    pub mesh_whole: u32,
    /// Events too near to grazing.
    pub grazes: u32,
    /// Running, reading the cycle, having read it, done.
    pub stage: u32,
    /// Smallest lag that recurs and contracts.
    pub candidate: u32,
    /// Periods of the cycle still to be read.
    pub to_read: u32,
    /// Tangent vectors carried.
    pub tangent_count: u32,
    /// 1 once a lane is of the variant that carries one for the exponent.
    pub grows: u32,
    /// Symbols of the cycle.
    pub word_length: u32,
    /// Hash of the stretches of symbols so far, low half.
    pub hash_low: u32,
    /// High half.
    pub hash_high: u32,
    /// The latest symbols, three bits each.
    pub recent: u32,
    /// Events on the strobe phase.
    pub on_strobe: u32,
    /// The events of this period, hashed.
    pub itinerary: u32,
    /// 1 once a cycle is being read or has been.
    pub has_read: u32,
    /// Period of the cycle that was read, if it is stable.
    pub cycle: u32,
    /// Cycles that were read without success.
    pub tries: u32,
    /// Period at which counting began.
    pub counted_from: u32,
    /// Whole blocks of the exponent.
    pub blocks: u32,
    /// Periods in the present block.
    pub block_periods: u32,
    /// When the anchor was taken.
    pub anchor_period: u32,
    /// Lags of the present window.
    pub window: u32,
    /// Windows for which it has.
    pub streak: u32,
    /// Lags that the last window held.
    pub known_lags: u32,
    /// 1 if the candidate's limit is near.
    pub settled: u32,
    /// Distance of the cycle from its mirror image, in quarter octaves below 1.
    pub mirror: u32,
    /// How far the cycle that was read last took the lane, likewise.
    pub apart: u32,
    /// The same before a Newton step.
    pub apart_before: u32,
    /// Newton steps towards the cycle.
    pub refinements: u32,
    /// The events on it before the first, hashed.
    pub branch: u32,
    /// The period for which that was.
    pub branch_period: u32,
    /// What governed the motion where Newton's method set out.
    pub home_mode: u32,
    /// Wall of the last event there.
    pub home_origin: u32,
    /// Divisor of its period after which it came nearest to its start.
    pub divisor: u32,
    /// How near, in quarter octaves below 1.
    pub divisor_apart: u32,
    /// Times that Newton's method led nowhere.
    pub failed_searches: u32,
    /// 1 while a divisor is read because its multiple might be it.
    pub asked: u32,
    /// The divisor whose cycle then was found unstable.
    pub rejected_divisor: u32,
    /// How far its cycle is from the lane by the derivative, in quarter octaves below 1.
    pub off: u32,
    /// Strobes of the motion so far.
    pub passed: u32,
    /// Cycles for which it has had the events of the cycle that is read.
    pub shown: u32,
    /// Events of whole periods, whatever they were counted for.
    pub all_events: u32,
    /// Distances per lag, in bytes.
    pub distances: [u32; 16],
    /// The same of the last window.
    pub last_distances: [u32; 16],
    /// The events of the trail's periods, hashed.
    pub itineraries: [u32; TRAIL],
    /// Symbols of the cycle, ten to a number.
    pub word: [u32; 7],
    /// Its pattern so far: a symbol for every run of one.
    pub pattern: [u32; 7],
    /// Symbols of the pattern.
    pub pattern_length: u32,
    /// Hash of the stretches of its symbols so far, low and high half.
    pub pattern_hash: [u32; 2],
    /// The latest symbols, three bits each.
    pub pattern_recent: u32,
}

/// What travels back of a lane: the numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Reading {
    /// Gap, its rate per free step, second displacement, its rate.
    pub strobe: [f64; 4],
    /// Exponent per period, natural logarithms.
    pub growth: f64,
    /// Its standard error.
    pub growth_error: f64,
    /// Fraction of the time spent meshing.
    pub mesh_fraction: f64,
}

/// What travels back of a lane: the counting.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Finding {
    /// Bits of [`valid`](crate::record::valid); what is not valid is zero.
    pub valid: u32,
    /// The lane's slot.
    pub slot: u32,
    /// Status code.
    pub status: u32,
    /// Period; 0 for none.
    pub period: u32,
    /// Forcing periods integrated.
    pub periods_run: u32,
    /// Impacts while they were counted.
    pub impacts: u32,
    /// Periods over which they were.
    pub counted: u32,
    /// 1 if the cycle is its own mirror image.
    pub symmetric: u32,
    /// Symbols of the cycle.
    pub word_length: u32,
    /// Hash of a word that is too long to be spelled out, low half.
    pub hash_low: u32,
    /// High half.
    pub hash_high: u32,
    /// Symbols of the cycle, ten to a number.
    pub word: [u32; 7],
    /// Symbols of its pattern.
    pub pattern_length: u32,
    /// Hash of a pattern that is too long to be spelled out, low and high half.
    pub pattern_hash: [u32; 2],
    /// Symbols of the pattern, ten to a number.
    pub pattern: [u32; 7],
}
