//! Rules by which lanes judge their motion. Shaders are compiled with these numbers; validation also uses them.

use super::precision::Precision;
use rattlemap_dynamics::machine::{LOWEST_FLIGHT, TIE};
use rattlemap_dynamics::motion::{CLOSING_ANGLE, GRAZING_SPEED, NO_SPEED, NO_THRESHOLD};
use rattlemap_dynamics::orbit::{
    BRANCH_CYCLES, CHAOS_ERRORS, ESCAPE_GROWTH, LARGEST_DIFFERENCE, LEAST_RECURRENCE, LEAST_SERIES,
    LEAST_WINDOW, LINEAR_TOLERANCE, NEAR_STROBE_TURNS, NEUTRAL_ORDER, ON_STROBE_TURNS, PLAIN_GROWTH,
    RARE_SERIES, ROUNDING_OF_AVERAGES, SHARED_GROWTH,
};
use rattlemap_dynamics::stability::CORRELATION_MARGIN;

/// Largest meshing speed at which lanes follow chatter by short flights, relative to half the walls' distance times
/// the rate of free motion. At higher speeds short flights are too few to save time.
pub(crate) const FOLLOWED_MESH_SPEED: f64 = 4e-4;

/// Fewest blocks of growth after which a lane may stop as chaotic. Fewer blocks give no standard error.
pub(crate) const FEWEST_BLOCKS: u32 = 6;

/// Parts per octave in which recurrence distances are stored. A distance of 4 parts means half of the size of the motion.
pub(crate) const PARTS_PER_OCTAVE: u32 = 4;

/// Largest distance of a recurrence, in parts of an octave: 2^-6 of the motion.
pub(crate) const RECURRENCE_LIMIT: u32 = 24;

/// A recurrence window lasts this fraction (one fifth) of the elapsed time.
pub(crate) const WINDOW_SHARE: u32 = 5;

/// Largest number of steps of Newton's method towards one cycle.
pub(crate) const MOST_NEWTON_STEPS: u32 = 5;

/// Longest Newton step, relative to the motion. On a longer way to the cycle, the strobe map may have a fold.
pub(crate) const LONGEST_NEWTON_STEP: f64 = 3e-2;

/// Number of last strobes by which a lane judges whether it approaches a cycle.
pub(crate) const TRAIL: usize = 32;

/// Number of failed Newton searches after which a lane makes no further ones.
pub(crate) const MOST_FAILED_SEARCHES: u32 = 2;

/// Largest distance of a symmetric cycle from its mirror image, and of equal states: 2^-12 of the motion.
pub(crate) const MIRROR_DISTANCE: f64 = 2.44e-4;

/// Largest distance of a settled lane from its cycle, relative to the motion.
pub(crate) const ON_CYCLE: f64 = 1e-4;

/// Returns the largest distance from its cycle, relative to the motion, at which a motion counts as settled at the end of its budget. In
/// f64 it is the value of the reference.
pub(crate) const fn settled_distance(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => ON_CYCLE,
        Precision::F64 => 1e-8,
    }
}

/// Returns the distance of a symmetric cycle from its mirror image, relative to the motion, that rounding explains.
pub(crate) const fn symmetric(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 3e-5,
        Precision::F64 => 1e-8,
    }
}

/// Returns [`RECURRENCE_LIMIT`] as a distance relative to the motion.
pub(crate) fn recurrence_distance() -> f64 {
    (-f64::from(RECURRENCE_LIMIT) / f64::from(PARTS_PER_OCTAVE)).exp2()
}

/// Returns the distance from phase 0, in turns, within which events lie on the strobe.
pub(crate) const fn on_strobe(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e-6,
        Precision::F64 => ON_STROBE_TURNS,
    }
}

/// Returns the time between two impacts, in forcing periods, within which their order is not known.
const fn tie(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e-6,
        Precision::F64 => TIE,
    }
}

/// Returns the scatter of a settled lane's strobes by rounding, relative to the motion, without amplification.
pub(crate) const fn noise(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 4e-6,
        Precision::F64 => 1e-14,
    }
}

/// Returns the recurrence distance, in parts of an octave, below which distances are rounding errors and need not shrink.
pub(crate) const fn within_rounding(precision: Precision) -> u32 {
    match precision {
        Precision::F32 => 60,
        Precision::F64 => 160,
    }
}

/// Returns the rules as declarations of the shaders' constants.
pub(super) fn declarations(precision: Precision) -> String {
    let (rounding, noise, on_strobe) = (within_rounding(precision), noise(precision), on_strobe(precision));
    let counts = [
        ("FEWEST_BLOCKS", FEWEST_BLOCKS),
        ("RECURRENCE_LIMIT", RECURRENCE_LIMIT),
        ("WITHIN_ROUNDING", rounding),
        ("MOST_NEWTON_STEPS", MOST_NEWTON_STEPS),
        ("MOST_FAILED_SEARCHES", MOST_FAILED_SEARCHES),
        ("TRAIL", TRAIL as u32),
        ("REQUIRED_CYCLES", BRANCH_CYCLES as u32),
        ("LEAST_WINDOW_STROBES", LEAST_WINDOW as u32),
        ("WINDOW_SHARE", WINDOW_SHARE),
    ];
    let singles = [
        ("NEUTRAL_ORDER", NEUTRAL_ORDER),
        ("PARTS_PER_OCTAVE", f64::from(PARTS_PER_OCTAVE)),
        ("LONGEST_NEWTON_STEP", LONGEST_NEWTON_STEP),
        ("MIRROR_DISTANCE", MIRROR_DISTANCE),
        ("NOISE", noise),
        ("ON_CYCLE", ON_CYCLE),
        ("SETTLED_DISTANCE", settled_distance(precision)),
        ("SYMMETRIC", symmetric(precision)),
    ];
    let reals = [
        ("CHAOS_ERRORS", CHAOS_ERRORS),
        ("CLOSING_ANGLE", CLOSING_ANGLE),
        ("CORRELATION_MARGIN", CORRELATION_MARGIN),
        ("ESCAPE_GROWTH", ESCAPE_GROWTH),
        ("FOLLOWED_MESH_SPEED", FOLLOWED_MESH_SPEED),
        ("GRAZING_SPEED", GRAZING_SPEED),
        ("LOWEST_FLIGHT", LOWEST_FLIGHT),
        ("NO_SPEED", NO_SPEED),
        ("NO_THRESHOLD", NO_THRESHOLD),
        ("LARGEST_DIFFERENCE", LARGEST_DIFFERENCE),
        ("PLAIN_GROWTH", PLAIN_GROWTH),
        ("LEAST_RECURRENCE", LEAST_RECURRENCE),
        ("LEAST_SERIES", LEAST_SERIES),
        ("RARE_SERIES", RARE_SERIES),
        ("ROUNDING_OF_AVERAGES", ROUNDING_OF_AVERAGES),
        ("SHARED_GROWTH", SHARED_GROWTH),
        ("LINEAR", LINEAR_TOLERANCE),
        ("ON_STROBE", on_strobe),
        ("NEAR_STROBE", NEAR_STROBE_TURNS),
        ("TIE", tie(precision)),
    ];
    let count = |(name, value): (&str, u32)| format!("const {name}: u32 = {value}u;\n");
    let number =
        |ty: &'static str| move |(name, value): (&str, f64)| format!("const {name}: {ty} = {value:?};\n");
    counts.map(count).concat() + &singles.map(number("f32")).concat() + &reals.map(number("Real")).concat()
}
