//! One cell of a map: the same decisions within a fixed number of forcing periods.
//!
//! [`analyse`](super::analyse) goes on until it knows; a map cannot. Here a cell has
//! `transient_periods + observed_periods` and no more, and an approach is searched in the
//! strobe states that have passed, so that nothing is integrated ahead of the budget.

use std::cell::{Cell, OnceCell};
use std::sync::atomic::AtomicBool;

use super::CHAOS_ERRORS;
use super::analysis::{APPROACH, Analysis, ESCAPE_GROWTH, ON_CYCLE, status_of};
use super::approach::{BENT, LINEAR, stays};
use super::itinerary::{Itinerary, Recorder};
use super::prospects::{Searched, contraction, escapes, swings};
use super::reading::Reading;
use super::recurrence::{Metric, NEAR, candidates, near_saddle};
use super::{Budget, Orbit, Status};
use crate::flow::Flow;
use crate::model::{Law, State};
use crate::reference::{Allowance, Stop, Trajectory};
use crate::stability::{Cycle, Exponent, FRESH_TANGENT, Newton};
use crate::word::Word;

/// Periods after which an early stop is first considered; then every sixth as many more.
const FIRST_CHECK: u32 = 16;
const CHECKS: u32 = 6;

/// A cell stops early only inside the region where the multipliers tell what happens next: this
/// close to its cycle, relative to the motion, or within `NEAR` where it is seen to move as they
/// say. A leaving speed near `mesh_speed` makes that region small: unseen, at 2e-3 one cell of
/// 4,000 over restitution and frequency was taken for a period that it then left.
const SETTLED: f64 = 5e-4;

/// The power of time that chaos has to outgrow, since tangents of neutral motion grow, too: those of a free body, of a
/// torus or of an undamped swing in proportion to time, at a double root to its square.
pub const NEUTRAL_ORDER: f64 = 2.0;

/// Cycles, at least, over which an approach must have been seen.
const APPROACH_CYCLES: usize = 4;

/// Newton's method searches for a cycle this many times as far off as it may lie.
const AIM: f64 = 3.0;

/// What one cell showed.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Confirmed period, in forcing periods.
    pub period: Option<u32>,
    /// How the integration ended; `Slow` without a period says that the motion stays near
    /// some cycle, or grows by less than three standard errors: no chaos.
    pub status: Status,
    /// Largest Lyapunov exponent per unit time and its standard error, zero for a cycle.
    pub lyapunov: Option<[f64; 2]>,
    /// Impacts per forcing period, over the cycle or the observed periods.
    pub impacts_per_period: f64,
    /// Fraction of time spent meshing, over the same.
    pub mesh_fraction: f64,
    /// Whether the cycle is its own mirror image.
    pub symmetric: Option<bool>,
    /// The cycle's word.
    pub word: Option<Word>,
    /// The last strobe state; one of the cycle's where the cell stopped early on the way to it.
    pub strobe: State,
    /// Forcing periods integrated.
    pub periods_run: u32,
    /// Forcing periods integrated beside them: by Newton's method, with four tangent vectors, and
    /// to read the cycle that it found.
    pub periods_beside: u32,
}

impl Measured {
    /// Whether motion that is at no cycle surely is chaos.
    fn is_decided(&self) -> bool {
        self.status != Status::Slow && self.lyapunov.is_some()
    }
}

/// Integrates one cell from `start` at phase 0 within its budget.
pub fn measure(flow: &Flow, law: Law, start: State, budget: &Budget) -> Measured {
    measure_within(flow, law, start, budget, budget.allowance())
}

/// [`measure`] until a flag is raised; none if it was by then.
pub fn measure_until(
    flow: &Flow,
    law: Law,
    start: State,
    budget: &Budget,
    halt: &AtomicBool,
) -> Option<Measured> {
    let allowance = budget.allowance().until(halt);
    let measured = measure_within(flow, law, start, budget, allowance);
    (!allowance.is_halted()).then_some(measured)
}

fn measure_within(
    flow: &Flow,
    law: Law,
    start: State,
    budget: &Budget,
    allowance: Allowance<'_>,
) -> Measured {
    let settings = &budget.settings;
    let analysis = Analysis { flow, law, settings, shown_periods: 0, allowance };
    let mut watch = Watch {
        analysis: &analysis,
        budget,
        allowance,
        strobes: vec![start],
        exponent: Exponent::default(),
        cycle: None,
        approaches: false,
        counts: vec![[0.0; 2]],
        itineraries: Vec::new(),
        searched: Searched::default(),
        newton: Newton::default(),
        read: Cell::new(0),
    };
    watch.run(start).unwrap_or_else(|stop| watch.stopped(stop))
}

/// A cycle that Newton found, and the strobe at which it was found.
struct Found<'a> {
    cycle: Cycle,
    /// The trajectory there: a state alone does not tell its domain.
    seed: Trajectory<'a>,
    at: usize,
    distance: f64,
    reading: OnceCell<Reading>,
}

struct Watch<'a> {
    analysis: &'a Analysis<'a>,
    budget: &'a Budget,
    /// What the motion and Newton's searches may take together.
    allowance: Allowance<'a>,
    /// Strobe states from the start on; entry `n` after `n` periods.
    strobes: Vec<State>,
    exponent: Exponent,
    cycle: Option<Found<'a>>,
    /// Whether the last check found it, or saw the motion nearer to it than then.
    approaches: bool,
    /// Impacts and meshing time so far at every strobe.
    counts: Vec<[f64; 2]>,
    /// What happened in each period.
    itineraries: Vec<Itinerary>,
    searched: Searched,
    newton: Newton,
    /// Periods that were integrated to read cycles.
    read: Cell<u32>,
}

impl<'a> Watch<'a> {
    fn run(&mut self, start: State) -> Result<Measured, Stop> {
        let budget = self.budget.periods();
        let last = self.budget.longest();
        let exponent_from = self.budget.exponent_from();
        let turning_from = if self.budget.exponent { self.budget.tangent_from() } else { last };
        let mut next_check = if self.budget.early_stop { FIRST_CHECK.min(budget) } else { last };
        let mut bare = Trajectory::new(self.analysis.flow, self.analysis.law, start).allowing(self.allowance);
        while bare.period() < u64::from(turning_from) {
            if let Some(measured) = self.period(&mut bare, &mut next_check, last)? {
                return Ok(measured);
            }
        }
        let mut carrier = bare.carrying([FRESH_TANGENT]);
        while carrier.period() < u64::from(last) {
            if carrier.period() == u64::from(exponent_from) {
                self.exponent.reset();
            }
            if let Some(measured) = self.period(&mut carrier, &mut next_check, last)? {
                return Ok(measured);
            }
        }
        unreachable!("the last period is checked")
    }

    /// One forcing period, and a check of what has passed where one is due.
    fn period<const N: usize>(
        &mut self,
        trajectory: &mut Trajectory<'a, N>,
        next_check: &mut u32,
        last: u32,
    ) -> Result<Option<Measured>, Stop> {
        let mut recorder = Recorder::new(self.analysis.flow);
        trajectory.advance_period(&mut recorder)?;
        self.itineraries.push(recorder.itinerary);
        self.exponent.renormalise(trajectory);
        self.strobes.push(trajectory.state());
        let now = self.strobes.len() as u32 - 1;
        self.counts.push([trajectory.work().impacts as f64, trajectory.meshing_time()]);
        if self.budget.early_stop && self.is_non_impacting(trajectory) {
            return Ok(Some(self.non_impacting()));
        }
        if now < *next_check {
            return Ok(None);
        }
        let (budget, chaos_from) = (self.budget.periods(), self.budget.chaos_from());
        let next = now + now.div_ceil(CHECKS);
        let stages = [chaos_from, budget, last].into_iter().filter(|&stage| now < stage && stage <= last);
        *next_check = next.min(stages.min().unwrap_or(last));
        let is_last = now == budget || now == last;
        if let Some(orbit) = self.settled(&trajectory.carrying([]), is_last)? {
            let strobe = if is_last { trajectory.state() } else { orbit.strobe };
            return Ok(Some(self.periodic(orbit, strobe)));
        }
        let mut work = trajectory.work();
        work += self.newton.work();
        self.allowance.covers(work)?;
        Ok(match now {
            // Its search fails where a degree of freedom at rest would not decay.
            _ if now == last && self.is_non_impacting(trajectory) => Some(self.non_impacting()),
            _ if now == last => Some(self.aperiodic(CHAOS_ERRORS)),
            _ if now >= budget => Some(self.aperiodic(CHAOS_ERRORS)).filter(Measured::is_decided),
            _ if now >= chaos_from && !self.approaches => {
                Some(self.aperiodic(self.budget.chaos_errors())).filter(Measured::is_decided)
            }
            _ => None,
        })
    }

    /// Whether the motion certainly has no event to come.
    fn is_non_impacting<const N: usize>(&self, trajectory: &Trajectory<'a, N>) -> bool {
        let free = self.analysis.flow.non_impacting();
        trajectory.meshing().is_none() && free.is_some_and(|free| free.is_certain(trajectory.state()))
    }

    /// Contact-free motion: the steady response attracts it, and has no event.
    fn non_impacting(&self) -> Measured {
        let flow = self.analysis.flow;
        Measured {
            period: Some(1),
            status: Status::Ok,
            lyapunov: flow.non_impacting().map(|motion| [motion.exponent(), 0.0]),
            impacts_per_period: 0.0,
            mesh_fraction: 0.0,
            symmetric: flow.mirror_symmetric(&self.analysis.law).then_some(true),
            word: Some(Word::default()),
            strobe: self.strobes[self.strobes.len() - 1],
            periods_run: self.strobes.len() as u32 - 1,
            periods_beside: self.periods_beside(),
        }
    }

    /// The orbit of a cycle that the strobe states are seen to approach.
    fn settled(&mut self, seed: &Trajectory<'a>, is_last: bool) -> Result<Option<Orbit>, Stop> {
        let max_period = self.budget.settings.max_period;
        let window = &self.strobes[self.strobes.len().saturating_sub(2 * max_period as usize + 1)..];
        let metric = Metric::of(window, self.analysis.flow);
        let near = if is_last { NEAR } else { SETTLED };
        if is_last {
            // Judged as if it were the only next_check: a cell that runs its whole budget has the
            // same class with and without early stops.
            self.cycle = None;
        }
        if let Some(orbit) = self.approached(&metric, near)? {
            return Ok(Some(orbit));
        }
        // One that is being approached needs no second check.
        self.approaches =
            self.cycle.as_ref().is_some_and(|found| self.present(found, &metric) < found.distance);
        if !is_last && self.approaches {
            return Ok(None);
        }
        for candidate in candidates(window, &metric, max_period) {
            let state = self.strobes[self.strobes.len() - 1];
            if escapes(&self.exponent, candidate.period, is_last) {
                continue;
            }
            let apart = contraction(window, candidate.period as usize, &metric);
            for map in self.analysis.maps(candidate.period) {
                let passes = |apart| self.searched.account_for(map, &state, apart, &metric);
                if !is_last && apart.is_none_or(passes) {
                    continue;
                }
                let is_near = |y: &State| metric.distance(&state, y) < AIM * NEAR;
                let newton = &mut self.newton;
                let found =
                    if is_last { newton.refine(seed, map) } else { newton.refine_nearby(seed, map, is_near) };
                let Some(cycle) = found else {
                    self.searched.note_failed(map, state);
                    continue;
                };
                // An unstable one is so at any of its periods.
                if !cycle.is_stable() {
                    self.searched.note(map, &cycle);
                    continue;
                }
                let Some(cycle) = self.analysis.smallest(newton, seed, cycle, &metric) else { continue };
                let distance = metric.distance(&state, &cycle.state);
                if cycle.is_stable() && distance < NEAR {
                    let at = self.strobes.len() - 1;
                    let found = Found { cycle, seed: seed.clone(), at, distance, reading: OnceCell::new() };
                    // A fixed point that lies in another domain than the motion now is no cycle.
                    if !is_last && !self.reading(&found).is_ok_and(|reading| reading.closes) {
                        continue;
                    }
                    // The next check will tell whether it is being approached.
                    self.approaches = true;
                    self.cycle = Some(found);
                    let orbit = self.approached(&metric, near)?;
                    // One find is enough for now.
                    if orbit.is_some() || !is_last {
                        return Ok(orbit);
                    }
                }
            }
        }
        Ok(None)
    }

    /// The orbit of the cycle found last, if the strobe states have come within `near` of it
    /// and nearer all the time.
    fn approached(&self, metric: &Metric, near: f64) -> Result<Option<Orbit>, Stop> {
        let Some(found) = &self.cycle else { return Ok(None) };
        let (cycle, period, now) = (&found.cycle, found.cycle.period as usize, self.last_beside(found));
        let distance = |back: usize| metric.distance(&self.strobes[now - back * period], &cycle.state);
        let present = distance(0);
        let left = f64::from(self.budget.periods()) - (self.strobes.len() - 1) as f64;
        // Where it would stand at the end of the budget: the same status for early stops.
        let radius = cycle.spectral_radius();
        let at_last = present * radius.powf(left / f64::from(cycle.period));
        if present < ON_CYCLE {
            return Ok(Some(self.analysis.periodic(self.reading(found)?, cycle, at_last)));
        }
        let halving = (0.5f64.ln() / radius.max(0.1).ln()).ceil();
        let back = (halving.min(1e6) as usize).max(APPROACH_CYCLES).min(now / 2 / period);
        if back < 2 || present > NEAR {
            return Ok(None);
        }
        // A multiplier near 1 shrinks little; half of what it promises must be seen.
        let promised = 1.0 - 0.5 * (1.0 - radius.powf(back as f64));
        let before = distance(back);
        let nearer = present < APPROACH.max(promised) * before;
        let steady = (1..back).all(|k| distance(k) < 2.0 * before);
        if !(nearer && steady) {
            return Ok(None);
        }
        let reading = self.reading(found)?;
        let stays = |bend| reading.closes && self.stays(found, &reading.itineraries, metric, bend);
        let stays = stays(LINEAR) || present < near && stays(BENT) && !self.grows_beside(found, metric);
        Ok(stays.then(|| self.analysis.periodic(reading, cycle, at_last)))
    }

    /// The cycle, read once.
    fn reading<'f>(&self, found: &'f Found) -> Result<&'f Reading, Stop> {
        if let Some(reading) = found.reading.get() {
            return Ok(reading);
        }
        self.read.set(self.read.get() + found.cycle.period);
        let reading = self.analysis.read(&found.seed, &found.cycle)?;
        Ok(found.reading.get_or_init(|| reading))
    }

    /// Whether the motion stays by a cycle that has these itineraries.
    fn stays(&self, found: &Found, shown: &[Itinerary], metric: &Metric, bend: f64) -> bool {
        let (period, now) = (found.cycle.period as usize, self.last_beside(found));
        let beside = |back: usize| now.checked_sub(back * period).map(|at| self.strobes[at]);
        let is_on_branch = |back: usize| self.itineraries[now - back * period..][..period] == *shown;
        stays(&found.cycle, beside, is_on_branch, metric, bend)
    }

    /// Whether a tangent vector has grown, while the motion was near the cycle, by more than it would about one
    /// that the motion tends to: a band of chaos may lie beside a cycle, and come nearer to it by chance.
    fn grows_beside(&self, found: &Found, metric: &Metric) -> bool {
        let (period, now) = (found.cycle.period as usize, self.last_beside(found));
        let is_near = |n: &usize| metric.distance(&self.strobes[now - n * period], &found.cycle.state) < NEAR;
        let cycles = (0..=now / period).take_while(is_near).count();
        swings(self.exponent.recent_growth((cycles * period).min(self.exponent.periods())))
    }

    /// The last strobe that the cycle's state belongs to: the others, unless the period is 1,
    /// are other points of the cycle.
    fn last_beside(&self, found: &Found) -> usize {
        let period = found.cycle.period as usize;
        found.at + (self.strobes.len() - 1 - found.at) / period * period
    }

    fn periods_beside(&self) -> u32 {
        self.newton.periods() + self.read.get()
    }

    /// How far the motion is from a cycle.
    fn present(&self, found: &Found, metric: &Metric) -> f64 {
        metric.distance(&self.strobes[self.last_beside(found)], &found.cycle.state)
    }

    fn periodic(&self, orbit: Orbit, strobe: State) -> Measured {
        Measured {
            period: Some(orbit.cycle_periods),
            status: orbit.status,
            lyapunov: Some([orbit.lyapunov, 0.0]),
            impacts_per_period: orbit.impacts_per_period,
            mesh_fraction: orbit.mesh_fraction,
            symmetric: orbit.symmetric,
            word: Some(orbit.word),
            strobe,
            periods_run: self.strobes.len() as u32 - 1,
            periods_beside: self.periods_beside(),
        }
    }

    /// What there is to say of motion that is at no cycle, over the last observed periods.
    fn aperiodic(&self, errors: f64) -> Measured {
        let settings = &self.budget.settings;
        let from = self.strobes.len() - 1 - settings.observed_periods as usize;
        let (window, max_period) = (&self.strobes[from..], settings.max_period);
        let period = self.analysis.flow.period;
        let span = f64::from(settings.observed_periods);
        let [impacts, meshing_time] =
            [0, 1].map(|i| self.counts[self.counts.len() - 1][i] - self.counts[from][i]);
        let lyapunov = self.budget.exponent.then(|| self.exponent.estimate(period));
        let surely = lyapunov.map(|(mean, error)| mean - errors * error);
        // Banded chaos stays near a cycle for ever, but no escape lasts through such growth.
        let averaged = &self.strobes[self.budget.exponent_from() as usize..];
        let near_saddle_periods = near_saddle(averaged, &Metric::of(window, self.analysis.flow), max_period);
        let is_escape = |rate: f64| rate * near_saddle_periods as f64 * period < ESCAPE_GROWTH;
        let is_neutral =
            |rate: f64| rate * averaged.len().saturating_sub(1) as f64 * period <= self.neutral_growth();
        let slow = surely.is_some_and(is_neutral)
            || 2.0 * near_saddle_periods as f64 >= span && surely.is_none_or(is_escape);
        Measured {
            period: None,
            status: if slow { Status::Slow } else { Status::Ok },
            lyapunov: lyapunov.map(|(mean, error)| [mean, error]),
            impacts_per_period: impacts / span,
            mesh_fraction: meshing_time / (span * period),
            symmetric: None,
            word: None,
            strobe: self.strobes[self.strobes.len() - 1],
            periods_run: self.strobes.len() as u32 - 1,
            periods_beside: self.periods_beside(),
        }
    }

    /// What tangents of neutral motion may grow by, as a logarithm: those of a free body, of a
    /// torus or of an undamped swing in proportion to time, at a double root to its square.
    fn neutral_growth(&self) -> f64 {
        let from = f64::from(self.budget.exponent_from().max(1));
        NEUTRAL_ORDER * ((self.strobes.len() - 1) as f64 / from).ln()
    }

    /// A cell that could not be continued: nothing was measured but how far it came.
    fn stopped(&self, stop: Stop) -> Measured {
        Measured {
            period: None,
            status: status_of(stop),
            lyapunov: None,
            impacts_per_period: 0.0,
            mesh_fraction: 0.0,
            symmetric: None,
            word: None,
            strobe: self.strobes[self.strobes.len() - 1],
            periods_run: self.strobes.len() as u32 - 1,
            periods_beside: self.periods_beside(),
        }
    }
}
