//! Coarse grids: is an event ever missed because the step is long?
//!
//! Lanes are asked for N = 1, 2, 4, ... steps per forcing period. They take no fewer than their
//! certificate is laid out for, so a smaller N is raised, and says so; at every step from there on
//! the certificate either shows the step free of events or finds them. Two kinds of proof: swings
//! that reach into a wall between two steps, whose contacts are known in closed form
//! ([`super::grazing`]), and whole motions, whose impacts are counted against the reference's.
//!
//! For comparison, the contacts that the same N would miss if it checked the ends of its steps
//! alone, as fixed-step programs do.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{EngineName, REST, apart, flow_of, paper, sensitivity};
use super::grazing::{contact_speed, swing};
use super::lanes::{Lanes, Start};
use super::perturbed::{Perturbed, perturbed};
use super::{Part, Size, Verdict, Watch, readout};
use rattlemap::gpu::{Constants, GpuError, LaneSettings};
use rattlemap::map::random::Random;
use rattlemap::record::distance::is_within;
use rattlemap::record::limits::MOST_STEPS;
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::Status;
use rattlemap_dynamics::reference::Trajectory;

/// How far the swings reach beyond the wall, in units of half the backlash: from one that
/// lasts a twelfth of a period to one that single precision just resolves.
const DEPTHS: [f64; 5] = [3e-2, 1e-2, 1e-3, 1e-4, 1e-5];

/// Whole motions: impacts, meshing, chatter, chaos.
const MOTIONS: [(f64, f64); 8] =
    [(0.605, 5.6), (0.06, 5.6), (0.0, 2.0), (0.56, 1.5), (0.72, 1.5), (0.7, 5.4), (0.606, 5.6), (0.9, 11.0)];

/// Whole motions are also followed with so many steps per period that `1 - cos` of one is a unit
/// roundoff of single precision: what adds that to a phasor loses it, the same way at every step.
const FINEST: u32 = 18_198;

/// Perturbed motions: the farthest of eight is a standard deviation and a half away.
const RUNS: u64 = 8;
/// Errors may be this many times what was seen of them.
const SCATTER: f64 = 3.0;
/// Constants are rounded once, which is as if parameters were: by this many times four roundings.
const FACTOR: f64 = 4.0;

/// Forcing periods from rest: few enough for chaos to be foreseen.
const PERIODS: u32 = 4;

/// Swings at one number of steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Swings {
    /// Who computed it.
    pub engine: EngineName,
    /// Steps per forcing period that were asked for.
    pub steps_asked: u32,
    /// Fewest and most steps that were taken.
    pub steps_least: u32,
    /// See `steps_least`.
    pub steps_most: u32,
    /// How deep the swings reach into the wall, in units of half the backlash.
    pub depth: f64,
    /// Swings; each has one contact.
    pub swings: usize,
    /// Contacts that were missed.
    pub missed: usize,
    /// Contacts that `steps_asked` steps would miss if they checked their ends alone.
    pub missed_by_ends: usize,
}

/// One whole motion at one number of steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// Restitution.
    pub e: f64,
    /// Excitation frequency.
    pub omega: f64,
    /// Who computed it.
    pub engine: EngineName,
    /// Steps per forcing period that were asked for.
    pub steps_asked: u32,
    /// Steps that were taken.
    pub steps: u32,
    /// How it ended: a status's name.
    pub status: &'static str,
    /// Impacts over four forcing periods.
    pub impacts: u64,
    /// Those of the reference.
    pub impacts_of_reference: u64,
    /// Fewest and most of the reference perturbed by rounding at every step.
    pub impacts_least: u64,
    /// See `impacts_least`.
    pub impacts_most: u64,
    /// Distance from the reference after four forcing periods.
    pub error: f64,
    /// What rounding may make of it.
    pub bar: f64,
}

/// Both kinds of proof.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Swings that reach into a wall.
    pub swings: Vec<Swings>,
    /// Whole motions.
    pub motions: Vec<Motion>,
}

/// Tries every number of steps.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, seed: u64, lanes: &mut Lanes, watch: &dyn Watch) -> Result<Rows, GpuError> {
    let powers = |last: u32| (0..=last).map(|k| 1 << k);
    let asked: Vec<u32> = powers(size.pick(3, 12, 14)).collect();
    let mut rows = Rows::default();
    measure_swings(&asked, size.pick(8, 64, 1024), seed, lanes, watch, &mut rows.swings)?;
    let motions = &MOTIONS[..size.pick(2, 8, 8)];
    let asked: Vec<u32> = powers(size.pick(3, 12, 14)).chain([FINEST]).collect();
    measure_motions(&asked, motions, lanes, &mut rows.motions)?;
    Ok(rows)
}

fn at_least(steps: u32, settings: LaneSettings) -> LaneSettings {
    LaneSettings { steps_per_period: Some(steps), ..settings }
}

fn measure_swings(
    asked: &[u32],
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
    let all = asked.len() * precisions.len();
    for (nth, &precision) in precisions.iter().enumerate() {
        for (grid, &steps_asked) in asked.iter().enumerate() {
            watch.progress("grids", nth * asked.len() + grid, all);
            let records = lanes.run(precision, &starts, &at_least(steps_asked, LaneSettings::only(1)))?;
            let taken = steps_taken(&starts, steps_asked);
            for (i, &depth) in DEPTHS.iter().enumerate() {
                let here = i * per_depth..(i + 1) * per_depth;
                let met = |k: &usize| contact_speed(&starts[*k], &records[*k], Some(steps_asked)).is_some();
                let steps = || here.clone().map(|k| taken[k]);
                rows.push(Swings {
                    engine: precision.into(),
                    steps_asked,
                    steps_least: steps().min().unwrap_or(0),
                    steps_most: steps().max().unwrap_or(0),
                    depth,
                    swings: per_depth,
                    missed: here.clone().filter(|k| !met(k)).count(),
                    missed_by_ends: here
                        .filter(|&k| !is_seen_at_ends(&starts[k], depth, steps_asked))
                        .count(),
                });
            }
        }
    }
    lanes.rewrite(readout::whole);
    watch.progress("grids", all, all);
    Ok(())
}

/// Free steps per forcing period that lanes take where `asked` are asked for.
fn steps_taken(starts: &[Start], asked: u32) -> Vec<u32> {
    let taken = |(pair, _): &Start| {
        let oscillator = pair.oscillator().expect("cells are made valid");
        Constants::new(&oscillator, Some(asked)).map_or(0, |constants| constants.steps)
    };
    starts.iter().map(taken).collect()
}

/// Whether one of the ends of `steps` even steps lies beyond the wall: the swing is there while
/// `cos(omega t - phi) > 1 / (1 + depth)`.
fn is_seen_at_ends((pair, [x1, v1, ..]): &Start, depth: f64, steps: u32) -> bool {
    let phi = (v1 / pair.omega).atan2(*x1);
    let half = (depth * (2.0 + depth)).sqrt().atan2(1.0);
    let step = std::f64::consts::TAU / f64::from(steps);
    // The first end after it has gone in must come before it is out again.
    let first = ((phi - half) / step).ceil() * step;
    first < phi + half
}

fn measure_motions(
    asked: &[u32],
    motions: &[(f64, f64)],
    lanes: &mut Lanes,
    rows: &mut Vec<Motion>,
) -> Result<(), GpuError> {
    let starts: Vec<Start> = motions.iter().map(|&(e, omega)| (paper(e, omega), REST)).collect();
    let truth: Vec<_> = starts.par_iter().map(truth).collect();
    for precision in lanes.precisions() {
        let engine = EngineName::from(precision);
        let sensitivities: Vec<f64> =
            starts.par_iter().map(|(pair, start)| sensitivity(pair, *start, PERIODS, engine)).collect();
        for &steps_asked in asked {
            let records =
                lanes.run(precision, &starts, &at_least(steps_asked, LaneSettings::only(PERIODS)))?;
            let taken = steps_taken(&starts, steps_asked);
            let perturbed: Vec<Perturbed> = (0..starts.len())
                .into_par_iter()
                .map(|i| perturbed_by(engine, &starts[i], taken[i]))
                .collect();
            for (i, (GearPair { e, omega, .. }, _)) in starts.iter().enumerate() {
                let (state, impacts_of_reference) = truth[i];
                let [impacts_least, impacts_most] = perturbed[i].impacts;
                rows.push(Motion {
                    e: *e,
                    omega: *omega,
                    engine,
                    steps_asked,
                    steps: taken[i],
                    status: Status::from_code(records[i].status).unwrap_or(Status::NonFinite).name(),
                    impacts: (records[i].impacts_per_period * f64::from(PERIODS)).round() as u64,
                    impacts_of_reference,
                    impacts_least,
                    impacts_most,
                    error: apart(&records[i].strobe, &state),
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

/// State and impacts on the reference.
fn truth((pair, start): &Start) -> ([f64; 4], u64) {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), *start);
    (0..PERIODS).for_each(|_| trajectory.advance_period(&mut ()).expect("an ordinary cell"));
    (trajectory.state(), trajectory.work().impacts)
}

/// No contact is missed at any number of steps, no motion differs by more than rounding at every
/// step makes of it, and no cell takes fewer steps than were asked for.
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
    let obeyed =
        rows.swings.iter().all(|row| row.steps_least >= row.steps_asked && row.steps_most <= MOST_STEPS);
    Verdict {
        part: Part::Grid.name(),
        holds: missed == 0 && bad == 0 && obeyed && swings > 0,
        sentence: format!(
            "N = {least} to {most} steps per period: {missed} of {swings} contacts missed ({by_ends} by steps that \
             check their ends alone); {bad} of {} motions, with N up to {finest}, off the reference",
            rows.motions.len()
        ),
    }
}
