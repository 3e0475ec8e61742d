//! Coarse grids: does a lane miss an event because its step is long?
//!
//! Lanes are asked for N = 1, 2, 4, ... steps per forcing period. They raise an N that is too small for their bounds. At
//! every step the bounds either exclude events or lead to them. Two tests show this: swings that reach behind a wall between
//! two steps, whose contacts are known in closed form ([`super::grazing`]), and whole motions, whose impacts are compared
//! with those of the reference.
//!
//! For comparison, the table also counts the contacts that N steps would miss if only their ends were checked, as
//! fixed-step programs do.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{
    EngineName, REST, flow_of, oscillator_of, paper, run_reference, sensitivity, state_distance,
};
use super::grazing::{contact_speed, swing};
use super::lanes::{Lanes, Start};
use super::perturbed::{Perturbed, perturbed};
use super::{Size, Verdict, Watch, readout};
use rattlemap::gpu::{Constants, GpuError, LaneSettings};
use rattlemap::map::random::Random;
use rattlemap::record::classify::status;
use rattlemap::record::distance::is_within;
use rattlemap::record::limits::MOST_STEPS;
use rattlemap_dynamics::model::GearPair;

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

/// Swings of one depth at one number of steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Swings {
    /// The engine.
    pub engine: EngineName,
    /// Requested steps per forcing period.
    pub steps_asked: u32,
    /// Fewest steps of a swing.
    pub steps_least: u32,
    /// Most steps of a swing.
    pub steps_most: u32,
    /// Distance that the swings reach behind the wall, in units of half the backlash.
    pub depth: f64,
    /// Number of swings. Each has one contact.
    pub swings: usize,
    /// Number of missed contacts.
    pub missed: usize,
    /// Number of contacts that `steps_asked` steps would miss if only their ends were checked.
    pub missed_by_ends: usize,
}

/// One whole motion at one number of steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// Restitution.
    pub e: f64,
    /// Excitation frequency.
    pub omega: f64,
    /// The engine.
    pub engine: EngineName,
    /// Requested steps per forcing period.
    pub steps_asked: u32,
    /// Steps per forcing period.
    pub steps: u32,
    /// Name of the status.
    pub status: &'static str,
    /// Impacts over four forcing periods.
    pub impacts: u64,
    /// Impacts of the reference.
    pub impacts_of_reference: u64,
    /// Fewest impacts of the reference with perturbations at every step.
    pub impacts_least: u64,
    /// Most impacts of the reference with perturbations at every step.
    pub impacts_most: u64,
    /// Distance from the reference after four forcing periods.
    pub error: f64,
    /// Largest error that rounding explains.
    pub bar: f64,
}

/// Results of both tests.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Swings that reach behind a wall.
    pub swings: Vec<Swings>,
    /// Whole motions.
    pub motions: Vec<Motion>,
}

/// Computes swings and motions with every number of steps.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, seed: u64, lanes: &mut Lanes, watch: &dyn Watch) -> Result<Rows, GpuError> {
    let powers = |last: u32| (0..=last).map(|k| 1 << k);
    let mut grids: Vec<u32> = powers(size.pick(3, 12, 14)).collect();
    let mut rows = Rows::default();
    measure_swings(&grids, size.pick(8, 64, 1024), seed, lanes, watch, &mut rows.swings)?;
    grids.push(FINEST);
    measure_motions(&grids, &MOTIONS[..size.pick(2, 8, 8)], lanes, &mut rows.motions)?;
    Ok(rows)
}

/// Returns settings for some periods of at least `steps` steps.
fn settings(steps: u32, periods: u32) -> LaneSettings {
    LaneSettings { steps_per_period: Some(steps), ..LaneSettings::only(periods) }
}

fn measure_swings(
    grids: &[u32],
    per_depth: usize,
    seed: u64,
    lanes: &mut Lanes,
    watch: &dyn Watch,
    rows: &mut Vec<Swings>,
) -> Result<(), GpuError> {
    let mut random = Random::new(seed);
    let starts: Vec<Start> = DEPTHS
        .iter()
        .flat_map(|&depth| (0..per_depth).map(|_| swing(depth, &mut random)).collect::<Vec<_>>())
        .collect();
    lanes.rewrite(readout::first_contact);
    let precisions = lanes.precisions();
    let all = grids.len() * precisions.len();
    for (nth, &precision) in precisions.iter().enumerate() {
        for (grid, &steps_asked) in grids.iter().enumerate() {
            watch.progress("grids", nth * grids.len() + grid, all);
            let records = lanes.run(precision, &starts, &settings(steps_asked, 1))?;
            let steps_of = lane_steps(&starts, steps_asked);
            for (i, &depth) in DEPTHS.iter().enumerate() {
                let here = i * per_depth..(i + 1) * per_depth;
                let is_missed =
                    |k: &usize| contact_speed(&starts[*k], &records[*k], Some(steps_asked)).is_none();
                let steps = || steps_of[here.clone()].iter().copied();
                rows.push(Swings {
                    engine: precision.into(),
                    steps_asked,
                    steps_least: steps().min().unwrap_or(0),
                    steps_most: steps().max().unwrap_or(0),
                    depth,
                    swings: per_depth,
                    missed: here.clone().filter(is_missed).count(),
                    missed_by_ends: here
                        .filter(|&k| !is_found_at_ends(&starts[k], depth, steps_asked))
                        .count(),
                });
            }
        }
    }
    lanes.rewrite(readout::whole);
    watch.progress("grids", all, all);
    Ok(())
}

/// Returns the free steps per forcing period of each lane if `requested` are requested.
fn lane_steps(starts: &[Start], requested: u32) -> Vec<u32> {
    let constants = |(pair, _): &Start| Constants::new(&oscillator_of(pair), Some(requested));
    starts.iter().map(|start| constants(start).map_or(0, |constants| constants.steps)).collect()
}

/// Whether one of the ends of `steps` equal steps is behind the wall. The swing is there while
/// `cos(omega t - phi) > 1 / (1 + depth)`.
fn is_found_at_ends((pair, [x1, v1, ..]): &Start, depth: f64, steps: u32) -> bool {
    let phi = (v1 / pair.omega).atan2(*x1);
    let half = (depth * (2.0 + depth)).sqrt().atan2(1.0);
    let step = std::f64::consts::TAU / f64::from(steps);
    // The first end after the swing passes the wall must precede its return.
    let first = ((phi - half) / step).ceil() * step;
    first < phi + half
}

fn measure_motions(
    grids: &[u32],
    motions: &[(f64, f64)],
    lanes: &mut Lanes,
    rows: &mut Vec<Motion>,
) -> Result<(), GpuError> {
    let starts: Vec<Start> = motions.iter().map(|&(e, omega)| (paper(e, omega), REST)).collect();
    let exact: Vec<_> = starts.par_iter().map(|(pair, start)| run_reference(pair, *start, PERIODS)).collect();
    for precision in lanes.precisions() {
        let engine = EngineName::from(precision);
        let sensitivities: Vec<f64> =
            starts.par_iter().map(|(pair, start)| sensitivity(pair, *start, PERIODS, engine)).collect();
        for &steps_asked in grids {
            let records = lanes.run(precision, &starts, &settings(steps_asked, PERIODS))?;
            let steps = lane_steps(&starts, steps_asked);
            let perturbed: Vec<Perturbed> = (0..starts.len())
                .into_par_iter()
                .map(|i| perturbed_by(engine, &starts[i], steps[i]))
                .collect();
            for (i, (GearPair { e, omega, .. }, _)) in starts.iter().enumerate() {
                let (state, work) = &exact[i];
                let [impacts_least, impacts_most] = perturbed[i].impacts;
                rows.push(Motion {
                    e: *e,
                    omega: *omega,
                    engine,
                    steps_asked,
                    steps: steps[i],
                    status: status(&records[i]).name(),
                    impacts: (records[i].impacts_per_period * f64::from(PERIODS)).round() as u64,
                    impacts_of_reference: work.impacts,
                    impacts_least,
                    impacts_most,
                    error: state_distance(&records[i].strobe, state.as_ref().expect("an ordinary cell")),
                    bar: FACTOR * sensitivities[i] + SCATTER * perturbed[i].distance,
                });
            }
        }
    }
    Ok(())
}

fn perturbed_by(engine: EngineName, start: &Start, steps: u32) -> Perturbed {
    perturbed(&flow_of(&start.0), start, PERIODS, steps, engine, RUNS).expect("an ordinary cell")
}

/// Requires that no contact is missed at any number of steps, that no motion differs by more than rounding at every step
/// explains, and that no cell takes fewer steps than requested.
pub fn judge(rows: &Rows) -> Verdict {
    let missed: usize = rows.swings.iter().map(|row| row.missed).sum();
    let by_ends: usize = rows.swings.iter().map(|row| row.missed_by_ends).sum();
    let swings: usize = rows.swings.iter().map(|row| row.swings).sum();
    let good = |row: &&Motion| {
        row.status == "ok"
            && (row.impacts_least..=row.impacts_most).contains(&row.impacts)
            && is_within(row.error, row.bar)
            && row.steps >= row.steps_asked
    };
    let bad = rows.motions.iter().filter(|row| !good(row)).count();
    let steps = || rows.swings.iter().map(|row| row.steps_asked);
    let finest = rows.motions.iter().map(|row| row.steps_asked).max().unwrap_or(0);
    let (least, most) = (steps().min().unwrap_or(0), steps().max().unwrap_or(0));
    let has_steps =
        rows.swings.iter().all(|row| row.steps_least >= row.steps_asked && row.steps_most <= MOST_STEPS);
    Verdict {
        holds: missed == 0 && bad == 0 && has_steps && swings > 0,
        sentence: format!(
            "N = {least} to {most} steps per period: {missed} of {swings} contacts missed ({by_ends} if only \
             ends of steps were checked); {bad} of {} motions, with N up to {finest}, differ from the reference",
            rows.motions.len()
        ),
    }
}
