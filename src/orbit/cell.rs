//! One cell of a map: the same decisions within a fixed number of forcing periods.
//!
//! [`analyse`](super::analyse) goes on until it knows; a map cannot. Here a cell has
//! `transient_periods + observed_periods` and no more, and an approach is looked for in the
//! strobe states that have passed, so that nothing is integrated ahead of the budget.

use super::CHAOS_ERRORS;
use super::analysis::{APPROACH, Analysis, DEPARTURE, ON_CYCLE, status_of};
use super::approach::{LINEAR_CYCLES, is_linear};
use super::prospects::{Searched, contraction, departs, swings};
use super::recurrence::{Metric, NEAR, candidates, lingering};
use super::scatter::Scatter;
use super::{Budget, Orbit, Status};
use crate::flow::Flow;
use crate::model::{Law, State};
use crate::reference::{Stop, Trajectory};
use crate::stability::{Cycle, Exponent, FRESH_TANGENT, Newton};
use crate::word::Word;

/// Periods after which an early stop is first considered; then every sixth as many more.
const FIRST_LOOK: u32 = 16;
const LOOKS: u32 = 6;

/// A cell stops early only inside the region where the multipliers tell what happens next: this
/// close to its cycle, relative to the motion, or within `NEAR` where it is seen to move as they
/// say. A leaving speed near `mesh_speed` makes that region small: unseen, at 2e-3 one cell of
/// 4,000 over restitution and frequency was taken for a period that it then left.
const SETTLED: f64 = 5e-4;

/// Chaos has to outgrow this power of time.
const NEUTRAL_ORDER: f64 = 2.0;

/// Cycles, at least, over which an approach must have been seen.
const APPROACH_CYCLES: usize = 4;

/// Newton's method looks for a cycle this many times as far off as it may lie.
const AIM: f64 = 3.0;

/// What one cell showed.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Confirmed period, in forcing periods.
    pub period: Option<u32>,
    /// How the integration ended; `Slow` without a period says that the motion lingers at
    /// some cycle, or grows by less than three standard errors: no chaos.
    pub status: Status,
    /// Largest Lyapunov exponent per unit time and its standard error, zero for a cycle.
    pub lyapunov: Option<[f64; 2]>,
    /// Impacts per forcing period, over the cycle or the observed periods.
    pub impacts_per_period: f64,
    /// Fraction of time spent meshing, over the same.
    pub mesh_fraction: f64,
    /// What these averages are uncertain by; none for a cycle.
    pub scatter: Option<Scatter>,
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
    let settings = &budget.settings;
    let analysis = Analysis { flow, law, settings, shown_periods: 0 };
    let mut watch = Watch {
        analysis: &analysis,
        budget,
        strobes: vec![start],
        exponent: Exponent::default(),
        cycle: None,
        approaches: false,
        counts: vec![[0.0; 2]],
        searched: Searched::default(),
        newton: Newton::default(),
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
}

struct Watch<'a> {
    analysis: &'a Analysis<'a>,
    budget: &'a Budget,
    /// Strobe states from the start on; entry `n` after `n` periods.
    strobes: Vec<State>,
    exponent: Exponent,
    cycle: Option<Found<'a>>,
    /// Whether the last look found it, or saw the motion nearer to it than then.
    approaches: bool,
    /// Impacts and meshing time so far at every strobe.
    counts: Vec<[f64; 2]>,
    searched: Searched,
    newton: Newton,
}

impl<'a> Watch<'a> {
    fn run(&mut self, start: State) -> Result<Measured, Stop> {
        let budget = self.budget.periods();
        let last = self.budget.longest();
        let exponent_from = self.budget.exponent_from();
        let turning_from = if self.budget.exponent { self.budget.tangent_from() } else { last };
        let mut look = if self.budget.early_stop { FIRST_LOOK.min(budget) } else { last };
        let mut bare = Trajectory::new(self.analysis.flow, self.analysis.law, start);
        while bare.period() < u64::from(turning_from) {
            if let Some(measured) = self.period(&mut bare, &mut look, last)? {
                return Ok(measured);
            }
        }
        let mut carrier = bare.carrying([FRESH_TANGENT]);
        while carrier.period() < u64::from(last) {
            if carrier.period() == u64::from(exponent_from) {
                self.exponent.forget();
            }
            if let Some(measured) = self.period(&mut carrier, &mut look, last)? {
                return Ok(measured);
            }
        }
        unreachable!("the last period is looked at")
    }

    /// One forcing period, and a look at what has passed where one is due.
    fn period<const N: usize>(
        &mut self,
        trajectory: &mut Trajectory<'a, N>,
        look: &mut u32,
        last: u32,
    ) -> Result<Option<Measured>, Stop> {
        trajectory.advance_period(&mut ())?;
        self.exponent.renormalise(trajectory);
        self.strobes.push(trajectory.state());
        let now = self.strobes.len() as u32 - 1;
        self.counts.push([trajectory.work().impacts as f64, trajectory.meshing_time()]);
        if self.budget.early_stop && self.is_quiet(trajectory) {
            return Ok(Some(self.quiet()));
        }
        if now < *look {
            return Ok(None);
        }
        let (budget, chaos_from) = (self.budget.periods(), self.budget.chaos_from());
        let next = now + now.div_ceil(LOOKS);
        let stages = [chaos_from, budget, last].into_iter().filter(|&stage| now < stage && stage <= last);
        *look = next.min(stages.min().unwrap_or(last));
        let is_last = now == budget || now == last;
        if let Some(orbit) = self.settled(&trajectory.carrying([]), is_last)?
            && (is_last || self.is_own(&orbit))
        {
            let strobe = if is_last { trajectory.state() } else { orbit.strobe };
            return Ok(Some(self.periodic(orbit, strobe)));
        }
        Ok(match now {
            _ if now == last => Some(self.aperiodic(CHAOS_ERRORS)),
            _ if now >= budget => Some(self.aperiodic(CHAOS_ERRORS)).filter(Measured::is_decided),
            _ if now >= chaos_from && !self.approaches => {
                Some(self.aperiodic(self.budget.chaos_errors())).filter(Measured::is_decided)
            }
            _ => None,
        })
    }

    /// Whether the motion certainly has no event to come.
    fn is_quiet<const N: usize>(&self, trajectory: &Trajectory<'a, N>) -> bool {
        let quiet = self.analysis.flow.quiet();
        trajectory.meshing().is_none() && quiet.is_some_and(|quiet| quiet.is_certain(trajectory.state()))
    }

    /// Contact-free motion: the steady response attracts it, and has no event.
    fn quiet(&self) -> Measured {
        let flow = self.analysis.flow;
        Measured {
            period: Some(1),
            status: Status::Ok,
            lyapunov: flow.quiet().map(|quiet| [quiet.exponent(), 0.0]),
            impacts_per_period: 0.0,
            mesh_fraction: 0.0,
            scatter: None,
            symmetric: flow.mirror_symmetric().then_some(true),
            word: Some(Word::default()),
            strobe: self.strobes[self.strobes.len() - 1],
            periods_run: self.strobes.len() as u32 - 1,
            periods_beside: self.newton.periods(),
        }
    }

    /// The orbit of a cycle that the strobe states are seen to approach.
    fn settled(&mut self, seed: &Trajectory<'a>, is_last: bool) -> Result<Option<Orbit>, Stop> {
        let max_period = self.budget.settings.max_period;
        let window = &self.strobes[self.strobes.len().saturating_sub(2 * max_period as usize + 1)..];
        let metric = Metric::of(window, self.analysis.flow);
        let near = if is_last { NEAR } else { SETTLED };
        if is_last {
            // Judged as if it were the only look: a cell that runs its whole budget has the
            // same class with and without early stops.
            self.cycle = None;
        }
        if let Some(orbit) = self.approached(&metric, near)? {
            return Ok(Some(orbit));
        }
        // One that is being approached needs no second look.
        self.approaches =
            self.cycle.as_ref().is_some_and(|found| self.present(found, &metric) < found.distance);
        if !is_last && self.approaches {
            return Ok(None);
        }
        for candidate in candidates(window, &metric, max_period) {
            let state = self.strobes[self.strobes.len() - 1];
            if departs(&self.exponent, candidate.period, is_last) {
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
                    self.searched.note_vain(map, state);
                    continue;
                };
                // One that repels does so at any of its periods.
                if !cycle.attracts() {
                    self.searched.note(map, &cycle);
                    continue;
                }
                let Some(cycle) = self.analysis.smallest(newton, seed, cycle, &metric) else { continue };
                let distance = metric.distance(&state, &cycle.state);
                if cycle.attracts() && distance < NEAR {
                    // The next look will tell whether it is being approached.
                    self.approaches = true;
                    let at = self.strobes.len() - 1;
                    self.cycle = Some(Found { cycle, seed: seed.clone(), at, distance });
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
            return self.analysis.periodic(&found.seed, cycle, at_last).map(Some);
        }
        let halving = (0.5f64.ln() / radius.max(0.1).ln()).ceil();
        let back = (halving.min(1e6) as usize).max(APPROACH_CYCLES).min(now / 2 / period);
        let beside = |n: usize| self.strobes[now - n * period];
        let is_seen = || now > LINEAR_CYCLES * period && is_linear(cycle, beside, metric);
        if back < 2 || present > NEAR || (present > near && !is_seen()) {
            return Ok(None);
        }
        // A multiplier near 1 shrinks little; half of what it promises must be seen.
        let promised = 1.0 - 0.5 * (1.0 - radius.powf(back as f64));
        let before = distance(back);
        let nearer = present < APPROACH.max(promised) * before;
        let steady = (1..back).all(|k| distance(k) < 2.0 * before);
        if nearer && steady && (is_seen() || !self.grows_beside(found, metric)) {
            self.analysis.periodic(&found.seed, cycle, at_last).map(Some)
        } else {
            Ok(None)
        }
    }

    /// Whether a tangent vector has grown, while the motion was near the cycle, by more than it would about one
    /// that attracts the motion: a band of chaos may lie beside a cycle, and come nearer to it by chance.
    fn grows_beside(&self, found: &Found, metric: &Metric) -> bool {
        let (period, now) = (found.cycle.period as usize, self.last_beside(found));
        let is_near = |n: &usize| metric.distance(&self.strobes[now - n * period], &found.cycle.state) < NEAR;
        let cycles = (0..=now / period).take_while(is_near).count();
        swings(self.exponent.lately((cycles * period).min(self.exponent.periods())))
    }

    /// Whether the last cycles had the cycle's impacts: beyond a fold of the strobe map there may be
    /// another cycle, as close as the motion's own.
    fn is_own(&self, orbit: &Orbit) -> bool {
        let (now, cycle) = (self.counts.len() - 1, orbit.cycle_periods as usize);
        let each = (orbit.impacts_per_period * cycle as f64).round();
        let impacts = |end: usize| self.counts[end][0] - self.counts[end - cycle][0];
        now >= LINEAR_CYCLES * cycle && (0..LINEAR_CYCLES).all(|n| impacts(now - n * cycle) == each)
    }

    /// The last strobe that the cycle's state belongs to: the others, unless the period is 1,
    /// are other points of the cycle.
    fn last_beside(&self, found: &Found) -> usize {
        let period = found.cycle.period as usize;
        found.at + (self.strobes.len() - 1 - found.at) / period * period
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
            scatter: None,
            symmetric: orbit.symmetric,
            word: Some(orbit.word),
            strobe,
            periods_run: self.strobes.len() as u32 - 1,
            periods_beside: self.newton.periods() + orbit.cycle_periods,
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
        // Banded chaos lingers at a cycle for ever, but no departure lasts through such growth.
        let averaged = &self.strobes[self.budget.exponent_from() as usize..];
        let lingered = lingering(averaged, &Metric::of(window, self.analysis.flow), max_period);
        let averaged_counts = &self.counts[self.budget.exponent_from() as usize..];
        let is_departure = |rate: f64| rate * lingered as f64 * period < DEPARTURE;
        let is_neutral =
            |rate: f64| rate * averaged.len().saturating_sub(1) as f64 * period <= self.neutral_growth();
        let slow = surely.is_some_and(is_neutral)
            || 2.0 * lingered as f64 >= span && surely.is_none_or(is_departure);
        Measured {
            period: None,
            status: if slow { Status::Slow } else { Status::Ok },
            lyapunov: lyapunov.map(|(mean, error)| [mean, error]),
            impacts_per_period: impacts / span,
            mesh_fraction: meshing_time / (span * period),
            scatter: Some(Scatter::of(averaged_counts, settings.observed_periods, period)),
            symmetric: None,
            word: None,
            strobe: self.strobes[self.strobes.len() - 1],
            periods_run: self.strobes.len() as u32 - 1,
            periods_beside: self.newton.periods(),
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
            scatter: None,
            symmetric: None,
            word: None,
            strobe: self.strobes[self.strobes.len() - 1],
            periods_run: self.strobes.len() as u32 - 1,
            periods_beside: self.newton.periods(),
        }
    }
}
