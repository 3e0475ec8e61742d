//! Rules by which lanes judge their motion. Validation needs them, too, to tell what a lane would have said. They are
//! written once, here; the shaders are compiled with them.

use super::Precision;
use rattlemap_dynamics::orbit::{
    BRANCH_CYCLES, CHAOS_ERRORS, ESCAPE_GROWTH, LINEAR_TOLERANCE, NEUTRAL_ORDER, ON_STROBE_TURNS,
};
use rattlemap_dynamics::reference::{GRAZING_SPEED, NO_SPEED, NO_THRESHOLD};

/// Chaos is called early by this many blocks of growth at least: a standard error of fewer is none.
pub(crate) const FEWEST_BLOCKS: u32 = 6;

/// Distances are kept in so many parts of an octave below the size of the motion: 4 means half.
pub(crate) const OCTAVE: u32 = 4;

/// Recurrences farther apart than this are none, in parts of an octave: 2^-6 of the motion.
pub(crate) const NEAR: u32 = 24;

/// A window of recurrence is so much of the time that has passed.
pub(crate) const WINDOW_SHARE: u32 = 5;

/// Steps of Newton's method that a lane takes to one cycle.
pub(crate) const REFINEMENTS: u32 = 5;

/// None of which is longer than this, relative to the motion: what contracts from farther off may still have a fold
/// of the strobe map before it.
pub(crate) const REACH: f64 = 3e-2;

/// Strobes that a lane looks back at, to see whether it approaches a cycle.
pub(crate) const TRAIL: usize = 32;

/// Failed Newton searches after which a lane asks it no more.
pub(crate) const MOST_FAILED_SEARCHES: u32 = 2;

/// A cycle this close to its mirror image, 2^-12 of the motion, is symmetric; states this close are the same.
pub(crate) const MIRROR: f64 = 2.44e-4;

/// A lane has settled once it is this close to its cycle, relative to the motion.
pub(crate) const ON_CYCLE: f64 = 1e-4;

/// [`NEAR`] as a distance.
pub(crate) fn near() -> f64 {
    (-f64::from(NEAR) / f64::from(OCTAVE)).exp2()
}

/// Events this close to phase 0, in turns, lie on the strobe.
pub(crate) const fn on_strobe(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e-6,
        Precision::F64 => ON_STROBE_TURNS,
    }
}

/// What strobes of a settled lane scatter by, relative to the motion, if nothing amplifies it.
pub(crate) const fn noise(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 4e-6,
        Precision::F64 => 1e-14,
    }
}

/// Recurrences within rounding, in parts of an octave: they need not shrink.
pub(crate) const fn resolved(precision: Precision) -> u32 {
    match precision {
        Precision::F32 => 60,
        Precision::F64 => 160,
    }
}

/// The rules as the shaders' constants.
pub(super) fn declarations(precision: Precision) -> String {
    let (resolved, noise, on_strobe) = (resolved(precision), noise(precision), on_strobe(precision));
    format!(
        "const FEWEST_BLOCKS: u32 = {FEWEST_BLOCKS}u;\nconst NEUTRAL_ORDER: f32 = {NEUTRAL_ORDER:?};\n\
         const CHAOS_ERRORS: Real = {CHAOS_ERRORS:?};\nconst ESCAPE_GROWTH: Real = {ESCAPE_GROWTH:?};\n\
         const OCTAVE: f32 = f32({OCTAVE}u);\nconst NEAR: u32 = {NEAR}u;\nconst RESOLVED: u32 = {resolved}u;\n\
         const REFINEMENTS: u32 = {REFINEMENTS}u;\nconst REACH: f32 = {REACH:?};\nconst MOST_FAILED_SEARCHES: u32 = {MOST_FAILED_SEARCHES}u;\n\
         const GRAZING_SPEED: Real = {GRAZING_SPEED:?};\nconst NO_SPEED: Real = {NO_SPEED:?};\nconst NO_THRESHOLD: Real = {NO_THRESHOLD:?};\n\
         const TRAIL: u32 = {TRAIL}u;\nconst LINEAR: Real = {LINEAR_TOLERANCE:?};\nconst SHOWN_CYCLES: u32 = {BRANCH_CYCLES}u;\n\
         const WINDOW_SHARE: u32 = {WINDOW_SHARE}u;\nconst MIRROR: f32 = {MIRROR:?};\nconst NOISE: f32 = {noise:?};\n\
         const ON_CYCLE: f32 = {ON_CYCLE:?};\nconst ON_STROBE: Real = {on_strobe:?};\n"
    )
}
