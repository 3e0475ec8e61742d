//! Coarse grids: does a lane miss an event because its step is long?
//!
//! Lanes are asked for N = 1, 2, 4, ... steps per forcing period. They raise an N that is too small for their bounds. At
//! every step the bounds either exclude events or lead to them. Two tests show this: swings that reach behind a wall between
//! two steps, whose contacts are known in closed form ([`super::grazing`]), and whole motions, whose impacts are compared
//! with those of the reference.

use rayon::prelude::*;

use super::cells::{
    EngineName, REST, flow_of, oscillator_of, paper, run_reference, sensitivity, state_distance,
};
use super::grazing::{contact_speed, swing};
use super::lanes::{Lanes, Start};
use super::{Checks, SEED, readout};
use rattlemap::gpu::{Constants, LaneSettings};
use rattlemap::map::random::Random;
use rattlemap::record::classify::status;
use rattlemap::record::limits::MOST_STEPS;
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::motion::{Stop, Trajectory};
use rattlemap_dynamics::orbit::Status;

/// Distances that the swings reach behind the wall, in units of half the backlash. The first swing is there for a twelfth
/// of a period; single precision just resolves the last.
const DEPTHS: [f64; 5] = [3e-2, 1e-2, 1e-3, 1e-4, 1e-5];

/// Restitution and frequency of whole motions: impacts, meshing, chatter and chaos.
const MOTIONS: [(f64, f64); 8] =
    [(0.605, 5.6), (0.06, 5.6), (0.0, 2.0), (0.56, 1.5), (0.72, 1.5), (0.7, 5.4), (0.606, 5.6), (0.9, 11.0)];

/// Finest grid for whole motions, in steps per period. `1 - cos` of one step is a unit roundoff of single precision, so
/// adding it to a phasor would lose it at every step.
const FINEST: u32 = 18_198;

/// Number of perturbed motions. The farthest of eight is typically 1.5 standard deviations away.
const RUNS: u64 = 8;
/// Factor by which errors may exceed the distance of the farthest perturbed motion.
const SCATTER: f64 = 3.0;
/// Factor of the sensitivity to four roundings. Constants of lanes are rounded once, like parameters.
const FACTOR: f64 = 4.0;

/// Forcing periods from rest, few enough to predict chaos.
const PERIODS: u32 = 4;

/// Swings of each depth.
const SWINGS: usize = 64;

/// Compares swings and motions with every number of steps: no contact is missed, no motion differs by more than rounding at
/// every step explains, and no cell takes fewer steps than requested.
pub(super) fn check(lanes: &mut Lanes) -> Checks {
    let powers = |last: u32| (0..=last).map(|k| 1 << k);
    let mut checks = Checks::default();
    compare_swings(powers(14), lanes, &mut checks);
    compare_motions(powers(12).chain([FINEST]), lanes, &mut checks);
    checks
}

/// Returns settings for some periods of at least `steps` steps.
fn settings(steps: u32, periods: u32) -> LaneSettings {
    LaneSettings { steps_per_period: Some(steps), ..LaneSettings::only(periods) }
}

fn compare_swings(grids: impl Iterator<Item = u32> + Clone, lanes: &mut Lanes, checks: &mut Checks) {
    let mut random = Random::new(SEED);
    let starts: Vec<Start> = DEPTHS
        .iter()
        .flat_map(|&depth| (0..SWINGS).map(|_| swing(depth, &mut random)).collect::<Vec<_>>())
        .collect();
    lanes.rewrite(readout::first_contact);
    for precision in lanes.precisions() {
        for requested in grids.clone() {
            let records = lanes.run(precision, &starts, &settings(requested, 1));
            let cells = starts.iter().zip(&records);
            let missed = cells
                .filter(|(start, record)| contact_speed(start, record, Some(requested)).is_none())
                .count();
            let what = |what: &str| format!("{precision:?}, {requested} steps, {what}");
            checks.add(missed as f64, 0.0, what("missed contacts"));
            let has_steps =
                lane_steps(&starts, requested).iter().all(|steps| (requested..=MOST_STEPS).contains(steps));
            checks.require(has_steps, what("fewer than requested"));
        }
    }
    lanes.rewrite(readout::whole);
}

/// Returns the free steps per forcing period of each lane if `requested` are requested.
fn lane_steps(starts: &[Start], requested: u32) -> Vec<u32> {
    let constants = |(pair, _): &Start| Constants::new(&oscillator_of(pair), Some(requested));
    starts.iter().map(|start| constants(start).map_or(0, |constants| constants.steps)).collect()
}

fn compare_motions(grids: impl Iterator<Item = u32> + Clone, lanes: &mut Lanes, checks: &mut Checks) {
    let starts = MOTIONS.map(|(e, omega)| (paper(e, omega), REST));
    let exact = starts.map(|(pair, start)| run_reference(&pair, start, PERIODS).0.expect("an ordinary cell"));
    for precision in lanes.precisions() {
        let engine = EngineName::from(precision);
        let sensitivities = starts.map(|(pair, start)| sensitivity(&pair, start, PERIODS, engine));
        for requested in grids.clone() {
            let records = lanes.run(precision, &starts, &settings(requested, PERIODS));
            let steps = lane_steps(&starts, requested);
            let cells = starts.par_iter().zip(&steps);
            let perturbed: Vec<Perturbed> = cells
                .map(|(start, &steps)| perturbed(start, steps, engine).expect("an ordinary cell"))
                .collect();
            for (i, (GearPair { e, omega, .. }, _)) in starts.iter().enumerate() {
                let what =
                    |what: &str| format!("{engine:?}, e = {e}, omega = {omega}, {requested} steps, {what}");
                let impacts = (records[i].impacts_per_period * f64::from(PERIODS)).round() as u64;
                let [least, most] = perturbed[i].impacts;
                checks.require(status(&records[i]) == Status::Ok, what(status(&records[i]).name()));
                checks.require((least..=most).contains(&impacts), what("impacts"));
                checks.require(steps[i] >= requested, what("fewer than requested"));
                let bar = FACTOR * sensitivities[i] + SCATTER * perturbed[i].distance;
                checks.add(state_distance(&records[i].strobe(), &exact[i]), bar, what("error"));
            }
        }
    }
}

/// The effect of rounding at every step, measured on perturbed motions of the reference.
///
/// A lane rounds its state once per step. A motion of the reference whose state is moved by as much at the same times may
/// end where the lane ends. A few motions with random moves show how far rounding may separate them, and whether it may add
/// or remove an impact where chatter ends. The sensitivity to the start does not show this: a motion forgets its start, but
/// not its latest roundings.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Perturbed {
    /// Largest distance of a perturbed end from the exact one.
    distance: f64,
    /// Fewest and most impacts, including the unperturbed motion.
    impacts: [u64; 2],
}

/// Perturbs motions at each of `steps` equidistant times of a period: each component of the state moves by a uniform random
/// number of at most one unit roundoff of the engine.
fn perturbed((pair, start): &Start, steps: u32, engine: EngineName) -> Result<Perturbed, Stop> {
    let (flow, law) = (flow_of(pair), pair.law());
    let mut exact = Trajectory::new(&flow, law, *start);
    (0..PERIODS).try_for_each(|_| exact.advance_period(&mut ()))?;
    let mut found = Perturbed { distance: 0.0, impacts: [exact.work().impacts; 2] };
    let unit = engine.unit_roundoff();
    for run in 0..RUNS {
        let mut random = Random::new((run << 32) + u64::from(steps));
        let mut moved = Trajectory::new(&flow, law, *start);
        for _ in 0..PERIODS {
            for step in 1..steps {
                moved.advance_to(flow.period * (f64::from(step) / f64::from(steps)), &mut ())?;
                moved.perturb(|| unit * (2.0 * random.unit() - 1.0));
            }
            moved.advance_period(&mut ())?;
        }
        let impacts = moved.work().impacts;
        found.distance = found.distance.max(state_distance(&moved.state(), &exact.state()));
        found.impacts = [found.impacts[0].min(impacts), found.impacts[1].max(impacts)];
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of a random walk grow with the square root of its steps, and with the unit roundoff.
    #[test]
    fn perturbed_motions_scatter_like_a_random_walk() {
        let cell = (paper(0.9, 11.0), REST);
        let distance = |steps: u32, engine: EngineName| {
            let found = perturbed(&cell, steps, engine).unwrap();
            assert_eq!(found.impacts, [0, 0]);
            found.distance
        };
        let [few, many] = [64, 4096].map(|steps| distance(steps, EngineName::LanesF32));
        assert!((2.0..32.0).contains(&(many / few)), "{few:e} {many:e}");
        let double = distance(4096, EngineName::LanesF64);
        assert!((0.05..20.0).contains(&(many / double / 2f64.powi(29))), "{many:e} {double:e}");
    }
}
