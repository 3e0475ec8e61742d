//! Stages: parts of the forcing period in which other linear forces act, and the phase of the forcing.

use nalgebra::Complex;

use super::OscillatorError;
use super::error::require;

/// Largest distance of phases, in turns, that counts as rounding error.
const SAME_PHASE: f64 = 1e-12;

/// Largest number of stages.
pub const MOST_STAGES: usize = 64;

/// Largest number of changes of the stage in a forcing period.
pub const MOST_CHANGES: usize = 1024;

/// Whether each stage of a schedule is the mirror image of the stage half a period later, and vice versa.
pub(super) fn recurs_after_half_a_period(
    schedule: &[(f64, usize)],
    is_mirrored: impl Fn(usize, usize) -> bool,
) -> bool {
    let half = schedule.len() / 2;
    let recurs = |(&(begins, stage), &(later, mirror)): (&(f64, usize), &(f64, usize))| {
        (later - begins - 0.5).abs() < SAME_PHASE && is_mirrored(stage, mirror) && is_mirrored(mirror, stage)
    };
    match schedule.len() {
        0 => is_mirrored(0, 0),
        changes => changes % 2 == 0 && schedule.iter().zip(&schedule[half..]).all(recurs),
    }
}

/// Returns `exp(i phase)`.
pub(super) fn turn(phase: f64) -> Complex<f64> {
    // Half a turn changes the sign only: no rounding error adds a sine to the force.
    let (sin, cos) = if phase == std::f64::consts::PI { (0.0, -1.0) } else { phase.sin_cos() };
    Complex::new(cos, sin)
}

/// Returns a schedule of stages whose phase 0 is `phase`, in radians.
pub(super) fn schedule_at(schedule: &[(f64, usize)], phase: f64) -> Vec<(f64, usize)> {
    let turns = phase / std::f64::consts::TAU;
    // Rounding may give a whole turn.
    let later =
        |begins: f64| Some((begins - turns).rem_euclid(1.0)).filter(|&phase| phase < 1.0).unwrap_or(0.0);
    let mut schedule: Vec<_> = schedule.iter().map(|&(begins, stage)| (later(begins), stage)).collect();
    schedule.sort_by(|a, b| a.0.total_cmp(&b.0));
    schedule
}

/// Checks that phases at which stages begin are in `[0, 1)` and increase.
pub(super) fn check_phases(schedule: &[(f64, usize)]) -> Result<(), OscillatorError> {
    let mut before = f64::NEG_INFINITY;
    schedule.iter().try_for_each(|&(begins, stage)| {
        let is_allowed = (0.0..1.0).contains(&begins) && begins > before;
        before = begins;
        let quantity = || format!("phase at which stage {} begins", stage + 1);
        require(is_allowed, quantity, begins, "at least 0, less than 1, and greater than the phase before it")
    })
}
