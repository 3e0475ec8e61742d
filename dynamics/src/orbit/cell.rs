//! Classification of a cell of a map within a fixed number of forcing periods.
//!
//! Unlike [`analyse`](super::analyse), a cell of a map cannot be integrated until its class is known. The number of
//! periods is limited by its [`Budget`], and an approach to a cycle is searched in the strobe states so far.

use std::cell::{Cell, OnceCell};
use std::sync::atomic::AtomicBool;

use super::CHAOS_ERRORS;
use super::analysis::{
    APPROACH_RATIO, Analysis, ESCAPE_GROWTH, GROWTH_ROUNDING, ON_CYCLE, is_growing, neutral_growth, status_of,
};
use super::approach::{CLOSE_TOLERANCE, LINEAR_TOLERANCE, stays};
use super::itinerary::{Itinerary, Recorder};
use super::quantities::Quantities;
use super::reading::{ON_STROBE_TURNS, Reading};
use super::recurrence::{Metric, RECURRENCE_DISTANCE, candidates, near_saddle, rests};
use super::regularity::is_regular;
use super::resolution::too_few_events;
use super::search_filter::{SearchHistory, contraction, escapes, exceeds_stretch};
use super::{Budget, Class, Orbit, Section, Status};
use crate::model::{Law, State, Timing};
use crate::motion::Flow;
use crate::motion::{Allowance, Remark, Stop, Trajectory, share};
use crate::stability::{Cycle, Exponent, FRESH_TANGENT, Newton};
use crate::word::Word;

/// Period of the first check for an early stop.
const FIRST_CHECK: u32 = 16;

/// Divisor of the interval between checks: the next check is a sixth of the periods so far later.
const CHECK_DIVISOR: u32 = 6;

/// Largest distance from a cycle, relative to the size of the motion, at which a cell stops early without the test of
/// [`LINEAR_TOLERANCE`]. The region in which the multipliers predict the motion is small if a leaving speed is near
/// `mesh_speed`: with 2e-3, one cell of 4,000 over restitution and frequency got a period that it then left.
const EARLY_STOP_DISTANCE: f64 = 5e-4;

/// The test for regularity leaves out the first strobes, which may be transient: their number divided by this.
const TRANSIENT_SHARE: usize = 4;

/// Least number of cycles of an approach.
const LEAST_APPROACH_CYCLES: usize = 4;

/// Least number of events in a period with a long series of impacts, after which the motion may come to rest. With 3, the gallery takes 10 %
/// more periods instead of 8 %.
pub const LEAST_SERIES: f64 = 4.0;

/// A period with such a series has more events than this multiple of their mean number.
pub const RARE_SERIES: f64 = 2.0;

/// Largest distance of the states in a Newton search, in units of [`RECURRENCE_DISTANCE`].
const SEARCH_DISTANCE: f64 = 3.0;

/// The results of one cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// Confirmed period, in forcing periods.
    pub period: Option<u32>,
    /// Whether the motion is quasi-periodic.
    pub is_quasi_periodic: bool,
    /// How the integration ended. `Slow` without a period means that the motion stays near some cycle, or that the exponent does not exceed
    /// zero by three standard errors. With `Slow` or `Neutral` and without a period, the cell is undecided.
    pub status: Status,
    /// Largest Lyapunov exponent per unit time, and its standard error, which is zero for a cycle.
    pub lyapunov: Option<[f64; 2]>,
    /// Impacts per forcing period, over the cycle or the observed periods.
    pub impacts_per_period: f64,
    /// Fraction of time spent meshing, over the cycle or the observed periods.
    pub mesh_fraction: f64,
    /// Whether the cycle is its own mirror image.
    pub symmetric: Option<bool>,
    /// Word of the cycle.
    pub word: Option<Word>,
    /// Time of a cycle without force; none if the motion is at rest.
    pub cycle_time: Option<f64>,
    /// Modulus and argument of the largest multiplier of the cycle.
    pub multiplier: Option<[f64; 2]>,
    /// Quantities over the cycle, or over the observed periods that follow aperiodic motion, if requested.
    pub quantities: Option<Quantities>,
    /// The last strobe state; a state of the cycle if the cell stopped early.
    pub strobe: State,
    /// Forcing periods of the motion itself.
    pub periods_run: u32,
    /// Forcing periods integrated by Newton's method with four tangent vectors, by readings of cycles, and by the comparison at another
    /// phase.
    pub search_periods: u32,
}

impl Measurement {
    /// Whether aperiodic motion is certainly chaotic or quasi-periodic.
    fn is_decided(&self) -> bool {
        matches!(self.status, Status::Ok | Status::Simultaneous | Status::OutOfRange)
            && self.lyapunov.is_some()
    }

    /// Whether aperiodic motion is certainly chaotic.
    fn is_chaotic(&self) -> bool {
        self.is_decided() && !self.is_quasi_periodic
    }
}

/// Integrates one cell from `start` at phase 0 within its budget.
pub fn measure(flow: &Flow, law: Law, start: State, budget: &Budget) -> Measurement {
    measure_within(flow, law, start, budget, budget.allowance())
}

/// Integrates one cell like [`measure`]; returns none if `halt` was raised.
pub fn measure_until(
    flow: &Flow,
    law: Law,
    start: State,
    budget: &Budget,
    halt: &AtomicBool,
) -> Option<Measurement> {
    let allowance = budget.allowance().until(halt);
    let measured = measure_within(flow, law, start, budget, allowance);
    (!allowance.is_halted()).then_some(measured)
}

/// Integrates one cell. If an event of its cycle lies at phase 0, states are compared at another phase, within a second
/// budget.
fn measure_within(
    flow: &Flow,
    law: Law,
    start: State,
    budget: &Budget,
    allowance: Allowance<'_>,
) -> Measurement {
    let (first, is_on_strobe) = measure_by_strobes(flow, law, start, budget, allowance);
    if !is_on_strobe {
        return first;
    }
    let by_section = || {
        let second = measure_at_section(flow, law, first.strobe, first.period, budget, allowance)?;
        let search_periods = first.search_periods + second.periods_run + second.search_periods;
        Some(Measurement { periods_run: first.periods_run, search_periods, ..second })
    };
    by_section().unwrap_or(first)
}

/// Continues a motion with an event at phase 0 from its state `strobe` there, and compares its states at another phase. `period` is the
/// period that the comparison at phase 0 has found, if any. Returns none if this comparison finds none, or if the motion cannot be
/// continued within the allowance.
pub fn measure_at_section(
    flow: &Flow,
    law: Law,
    strobe: State,
    period: Option<u32>,
    budget: &Budget,
    allowance: Allowance<'_>,
) -> Option<Measurement> {
    let section = Section::of(flow, law, strobe, period.unwrap_or(2), allowance)?;
    let (measured, _) = measure_by_strobes(&section.flow, law, section.start, budget, allowance);
    measured.period?;
    Some(Measurement {
        quantities: measured.quantities.map(|quantities| section.quantities(quantities)),
        strobe: section.strobe(law, measured.strobe, ON_STROBE_TURNS)?.0,
        ..measured
    })
}

/// Integrates one cell and compares its states at phase 0. Also returns whether an event at phase 0 makes that
/// comparison uncertain.
fn measure_by_strobes(
    flow: &Flow,
    law: Law,
    start: State,
    budget: &Budget,
    allowance: Allowance<'_>,
) -> (Measurement, bool) {
    let analysis = Analysis {
        measures: budget.quantities,
        // Without exponents, recurrence alone decides, as in lanes.
        resolves: budget.exponent,
        allowance,
        ..Analysis::new(flow, law, &budget.settings)
    };
    let mut run = CellRun {
        analysis: &analysis,
        budget,
        allowance,
        strobes: vec![start],
        exponent: Exponent::default(),
        cycle: None,
        approaches: false,
        approaches_free: false,
        is_neutral: false,
        is_on_unstable: false,
        remark: None,
        counts: vec![[0.0; 3]],
        itineraries: Vec::new(),
        rests: Vec::new(),
        near_strobe: 0,
        history: SearchHistory::default(),
        newton: Newton::default(),
        reading_periods: Cell::new(0),
    };
    let measured = run.run(start).unwrap_or_else(|stop| run.without_results(status_of(stop)));
    let is_on_strobe = match measured.status {
        Status::StrobeOnEvent => true,
        Status::Slow | Status::Neutral | Status::Accelerates => {
            measured.period.is_none() && run.has_events_at_strobes()
        }
        _ => false,
    };
    (measured, is_on_strobe)
}

/// Returns modulus and argument of a complex number.
fn polar([re, im]: [f64; 2]) -> [f64; 2] {
    [re.hypot(im), im.atan2(re)]
}

/// A cycle that Newton's method has found.
struct FoundCycle<'a> {
    cycle: Cycle,
    /// The trajectory at that strobe, which determines the domain.
    seed: Trajectory<'a>,
    /// Index of the strobe at which the cycle was found.
    at: usize,
    /// Distance of the motion from the cycle at that strobe.
    distance: f64,
    reading: OnceCell<Reading>,
}

/// The state of the computation of one cell.
struct CellRun<'a> {
    analysis: &'a Analysis<'a>,
    budget: &'a Budget,
    /// Work that the motion and Newton's searches may take together.
    allowance: Allowance<'a>,
    /// Strobe states; entry `n` is the state after `n` periods.
    strobes: Vec<State>,
    exponent: Exponent,
    cycle: Option<FoundCycle<'a>>,
    /// Whether the last check found `cycle`, or the motion was closer to it than when it was found.
    approaches: bool,
    /// Whether the last check found a cycle without force that the motion approaches.
    approaches_free: bool,
    /// Whether the last check found a neutral cycle nearby.
    is_neutral: bool,
    /// Whether the motion lies on an unstable cycle when its budget ends.
    is_on_unstable: bool,
    /// Whether the order of two gaps has decided the motion.
    remark: Option<Remark>,
    /// Impacts and meshing time up to each strobe.
    counts: Vec<[f64; 3]>,
    /// Itinerary of each period.
    itineraries: Vec<Itinerary>,
    /// Strobes before which a rest has made the tangent vector vanish.
    rests: Vec<usize>,
    /// One bit for each of the last periods: whether it has an event near phase 0.
    near_strobe: u16,
    history: SearchHistory,
    newton: Newton,
    /// Periods of the readings of cycles.
    reading_periods: Cell<u32>,
}

impl<'a> CellRun<'a> {
    fn run(&mut self, start: State) -> Result<Measurement, Stop> {
        let budget = self.budget.periods();
        let last = self.budget.longest();
        // With early stops, few motions are decided in less than the observed periods.
        let least = if self.budget.early_stop { self.budget.settings.observed_periods } else { budget };
        if f64::from(least) * self.analysis.flow.least_steps() > self.allowance.steps as f64 {
            return Err(Stop::TooStiff);
        }
        let exponent_from = self.budget.exponent_from();
        let turning_from = if self.budget.exponent { self.budget.tangent_from() } else { last };
        let decided_by = self.budget.decided_by();
        let mut next_check = if self.budget.early_stop { FIRST_CHECK.min(budget) } else { decided_by };
        let mut bare = Trajectory::new(self.analysis.flow, self.analysis.law, start).allowing(self.allowance);
        while bare.period() < u64::from(turning_from) {
            if let Some(measured) = self.period(&mut bare, &mut next_check, last)? {
                return Ok(*measured);
            }
        }
        let mut carrier = bare.carrying([FRESH_TANGENT]);
        while carrier.period() < u64::from(last) {
            if carrier.period() == u64::from(exponent_from) {
                self.exponent.reset();
            }
            if let Some(measured) = self.period(&mut carrier, &mut next_check, last)? {
                return Ok(*measured);
            }
        }
        unreachable!("the last period is checked")
    }

    /// Integrates one forcing period. Checks the class if a check is due, and returns the results if it is decided. They are boxed, because
    /// most periods have none.
    fn period<const N: usize>(
        &mut self,
        trajectory: &mut Trajectory<'a, N>,
        next_check: &mut u32,
        last: u32,
    ) -> Result<Option<Box<Measurement>>, Stop> {
        let mut recorder = Recorder::new(self.analysis.flow);
        trajectory.advance_period(&mut recorder)?;
        self.itineraries.push(recorder.itinerary);
        self.near_strobe = self.near_strobe << 1 | u16::from(recorder.is_near_strobe);
        self.exponent.renormalise(trajectory);
        self.remark = trajectory.remark();
        self.strobes.push(trajectory.state());
        let now = self.strobes.len() as u32 - 1;
        if self.exponent.vanished() {
            self.rests.push(now as usize);
        }
        let work = trajectory.work();
        self.counts.push([work.impacts as f64, trajectory.meshing_time(), work.events as f64]);
        if self.budget.early_stop && self.is_non_impacting(trajectory) {
            return Ok(Some(Box::new(self.non_impacting())));
        }
        if now < *next_check {
            return Ok(None);
        }
        let (budget, chaos_from) = (self.budget.periods(), self.budget.chaos_from());
        let decided_by = self.budget.decided_by();
        let next = now + now.div_ceil(CHECK_DIVISOR);
        let stages = [chaos_from, budget, decided_by, last];
        let stages = stages.into_iter().filter(|&stage| now < stage && stage <= last);
        *next_check = next.min(stages.min().unwrap_or(last));
        let is_last = [budget, decided_by, last].contains(&now);
        if let Some(orbit) = self.confirmed_orbit(&trajectory.carrying([]), is_last)? {
            let is_own = is_last && orbit.cycle_time.is_none();
            let strobe = if is_own { trajectory.state() } else { orbit.strobe };
            return Ok(Some(Box::new(self.periodic(orbit, strobe))));
        }
        let mut work = trajectory.work();
        work += self.newton.work();
        self.allowance.covers(work)?;
        Ok(match now {
            // Newton's method does not find this cycle if the degree of freedom at rest is undamped.
            _ if now >= decided_by && self.is_non_impacting(trajectory) => Some(self.non_impacting()),
            _ if now == last => Some(self.aperiodic(CHAOS_ERRORS)),
            // Only chaotic cells continue until the last period.
            _ if now == decided_by => Some(self.aperiodic(CHAOS_ERRORS)).filter(|cell| !cell.is_chaotic()),
            _ if now >= chaos_from && self.has_long_superstable_cycle() => Some(self.aperiodic(CHAOS_ERRORS)),
            _ if now >= budget => Some(self.aperiodic(CHAOS_ERRORS))
                .filter(|cell| cell.is_quasi_periodic || decided_by == last && cell.is_chaotic()),
            _ if decided_by < last => None,
            _ if now >= chaos_from && !self.approaches && !self.nears_rest() => {
                Some(self.aperiodic(self.budget.chaos_errors())).filter(Measurement::is_decided)
            }
            _ => None,
        }
        .map(|measured| match measured.period {
            Some(_) => measured,
            None => {
                Measurement { quantities: self.analysis.quantities(&trajectory.carrying([])), ..measured }
            }
        })
        .map(Box::new))
    }

    /// Whether the motion has rested in the same state twice, more than `max_period` periods apart, and has not rested for as many periods
    /// since. A rest decides what follows, so the motion repeats, and its period is too long to be confirmed.
    fn has_long_superstable_cycle(&self) -> bool {
        let Some((&last, earlier)) = self.rests.split_last() else { return false };
        let metric = Metric::of(&self.strobes, self.analysis.flow);
        let is_same = |n: &&usize| metric.distance(&self.strobes[**n], &self.strobes[last]) < ON_CYCLE;
        let exceeds = |periods| periods > self.budget.settings.max_period as usize;
        exceeds(self.strobes.len() - 1 - last)
            && earlier.iter().rev().find(is_same).is_some_and(|before| exceeds(last - before))
    }

    /// Whether the motion may soon rest on a wall and forget its past, which ends chaos: in a rare period it has a long series of impacts.
    /// With one degree of freedom, a rest leaves no direction in which tangents could grow.
    fn nears_rest(&self) -> bool {
        let counts = &self.counts[self.budget.exponent_from() as usize / 2..];
        let [first, last] = [counts[0], counts[counts.len() - 1]];
        let busiest = counts.windows(2).map(|pair| pair[1][2] - pair[0][2]).fold(0.0, f64::max);
        let mean = (last[2] - first[2]) / (counts.len() - 1) as f64;
        self.analysis.flow.degrees == 1
            && last[0] > first[0]
            && busiest >= LEAST_SERIES
            && busiest > RARE_SERIES * mean
    }

    /// Whether an event stays near phase 0. It may alternate between the sides of the strobe; then every second period has no such event.
    fn has_events_at_strobes(&self) -> bool {
        self.near_strobe.count_ones() >= u16::BITS / 2
    }

    /// Whether the motion certainly has no further event.
    fn is_non_impacting<const N: usize>(&self, trajectory: &Trajectory<'a, N>) -> bool {
        let free = self.analysis.flow.non_impacting();
        trajectory.is_free() && free.is_some_and(|free| free.is_certain(trajectory.state()))
    }

    /// Builds the results of contact-free motion, which converges to its steady response.
    fn non_impacting(&self) -> Measurement {
        let flow = self.analysis.flow;
        Measurement {
            period: Some(1),
            lyapunov: flow.non_impacting().map(|motion| [motion.exponent(), 0.0]),
            symmetric: flow.mirror_symmetric(&self.analysis.law).then_some(true),
            word: Some(Word::default()),
            multiplier: flow.non_impacting().map(|motion| polar(motion.multiplier(flow.period))),
            quantities: flow.non_impacting().and_then(|motion| self.analysis.steady_quantities(motion)),
            ..self.without_results(match flow.non_impacting() {
                Some(motion) if motion.is_neutral() => Status::Neutral,
                _ => Status::Ok,
            })
        }
    }

    /// Returns the orbit of a cycle that the strobe states approach.
    fn confirmed_orbit(&mut self, seed: &Trajectory<'a>, is_last: bool) -> Result<Option<Orbit>, Stop> {
        if self.analysis.flow.timing == Timing::Free {
            let now = self.strobes.len() as u32 - 1;
            let periods = if is_last { self.budget.settings.observed_periods } else { now / CHECK_DIVISOR };
            let free = self.analysis.free_orbit(seed, periods.max(FIRST_CHECK));
            self.approaches_free = free.as_ref().is_some_and(|free| free.approaches);
            if let Some(free) = free.filter(|free| free.is_reached(is_last)) {
                if let Class::Periodic { .. } = free.orbit.class {
                    return Ok(Some(free.orbit));
                }
                self.is_on_unstable = true;
            }
        }
        let max_period = self.budget.settings.max_period;
        let window = &self.strobes[self.strobes.len().saturating_sub(2 * max_period as usize + 1)..];
        let metric = Metric::of(window, self.analysis.flow);
        let near = if is_last { RECURRENCE_DISTANCE } else { EARLY_STOP_DISTANCE };
        if is_last {
            // The last check ignores the others, so that a cell which uses its whole budget has the same class with
            // and without early stops.
            self.cycle = None;
        }
        if let Some(orbit) = self.orbit_of_last_cycle(&metric, near)? {
            return Ok(Some(orbit));
        }
        // While the motion approaches a cycle, no other cycle is searched.
        self.approaches =
            self.cycle.as_ref().is_some_and(|found| self.distance_now(found, &metric) < found.distance);
        if !is_last && self.approaches {
            return Ok(None);
        }
        for candidate in candidates(window, &metric, max_period) {
            let state = self.strobes[self.strobes.len() - 1];
            if escapes(&self.exponent, candidate.period, is_last) {
                continue;
            }
            let contracting = contraction(window, candidate.period as usize, &metric);
            for map in self.analysis.maps(candidate.period) {
                let is_explained = |distance| self.history.explains(map, &state, distance, &metric);
                if !is_last && contracting.is_none_or(is_explained) {
                    continue;
                }
                let is_near = |y: &State| metric.distance(&state, y) < SEARCH_DISTANCE * RECURRENCE_DISTANCE;
                let newton = &mut self.newton;
                let found =
                    if is_last { newton.refine(seed, map) } else { newton.refine_nearby(seed, map, is_near) };
                let Some(cycle) = found else {
                    self.history.add_failure(map, state);
                    continue;
                };
                if cycle.is_neutral() && metric.distance(&state, &cycle.state) < RECURRENCE_DISTANCE {
                    // Motion near a neutral cycle neither approaches nor leaves it.
                    self.is_neutral = is_last;
                    if metric.distance(&state, &cycle.state) < ON_CYCLE {
                        let cycle = self.analysis.smallest(newton, seed, cycle, &metric);
                        let of = |cycle| {
                            self.analysis.periodic(seed, &self.analysis.read(seed, &cycle)?, &cycle, 0.0)
                        };
                        return cycle.map(of).transpose();
                    }
                }
                // An unstable cycle is unstable at its smallest period, too.
                if !cycle.is_stable() {
                    self.is_on_unstable |= is_last && metric.distance(&state, &cycle.state) < ON_CYCLE;
                    self.history.add_unstable(map, &cycle);
                    continue;
                }
                let Some(cycle) = self.analysis.smallest(newton, seed, cycle, &metric) else { continue };
                let distance = metric.distance(&state, &cycle.state);
                if cycle.is_stable() && distance < RECURRENCE_DISTANCE {
                    let at = self.strobes.len() - 1;
                    let found =
                        FoundCycle { cycle, seed: seed.clone(), at, distance, reading: OnceCell::new() };
                    // A fixed point in another domain than the motion is no cycle.
                    if !is_last && !self.reading(&found).is_ok_and(|reading| reading.closes) {
                        continue;
                    }
                    // The next check shows whether the motion approaches it.
                    self.approaches = true;
                    self.cycle = Some(found);
                    let orbit = self.orbit_of_last_cycle(&metric, near)?;
                    if orbit.is_some() || !is_last {
                        return Ok(orbit);
                    }
                }
            }
        }
        Ok(None)
    }

    /// Returns the orbit of the last cycle that was found, if the strobe states approach it and [`stays`] holds.
    /// Within the distance `near` a larger tolerance applies.
    fn orbit_of_last_cycle(&self, metric: &Metric, near: f64) -> Result<Option<Orbit>, Stop> {
        let Some(found) = &self.cycle else { return Ok(None) };
        let (cycle, period, now) = (&found.cycle, found.cycle.period as usize, self.last_strobe_of(found));
        let distance = |back: usize| metric.distance(&self.strobes[now - back * period], &cycle.state);
        let present = distance(0);
        let is_confirming = self.strobes.len() as u32 - 1 > self.budget.decided_by();
        let end = if is_confirming { self.budget.longest() } else { self.budget.periods() };
        let left = f64::from(end) - (self.strobes.len() - 1) as f64;
        // The predicted distance at the end of the budget gives the same status with and without early stops.
        let radius = cycle.spectral_radius();
        let at_last = present * radius.powf(left / f64::from(cycle.period));
        if present < ON_CYCLE {
            return Ok(Some(self.accepted(found, at_last)?));
        }
        let halving = (0.5f64.ln() / radius.max(0.1).ln()).ceil();
        let back = (halving.min(1e6) as usize).max(LEAST_APPROACH_CYCLES).min(now / 2 / period);
        if back < 2 || present > RECURRENCE_DISTANCE {
            return Ok(None);
        }
        // For a multiplier near 1, half of the predicted decrease is enough.
        let predicted = 1.0 - 0.5 * (1.0 - radius.powf(back as f64));
        let before = distance(back);
        let nearer = present < APPROACH_RATIO.max(predicted) * before;
        let steady = (1..back).all(|k| distance(k) < 2.0 * before);
        if !(nearer && steady) {
            return Ok(None);
        }
        let reading = self.reading(found)?;
        let stays = |tolerance| reading.closes && self.stays(found, &reading.itineraries, metric, tolerance);
        let stays = stays(LINEAR_TOLERANCE)
            || present < near && stays(CLOSE_TOLERANCE) && !self.tangent_grows_near(found, metric);
        stays.then(|| self.accepted(found, at_last)).transpose()
    }

    /// Builds the orbit of a cycle that the motion approaches; `at_last` is its distance at the end of the budget.
    fn accepted(&self, found: &FoundCycle, at_last: f64) -> Result<Orbit, Stop> {
        let orbit = self.analysis.periodic(&found.seed, self.reading(found)?, &found.cycle, at_last)?;
        let is_resolved = matches!(orbit.status, Status::Ok | Status::BelowResolution);
        if is_resolved && self.analysis.resolves && !too_few_events(found.cycle.period, &orbit.events) {
            // The cycle was integrated once more for the growth of rounding errors.
            self.reading_periods.set(self.reading_periods.get() + found.cycle.period);
        }
        Ok(orbit)
    }

    /// Returns the reading of a cycle, which is integrated on the first call.
    fn reading<'f>(&self, found: &'f FoundCycle) -> Result<&'f Reading, Stop> {
        if let Some(reading) = found.reading.get() {
            return Ok(reading);
        }
        let reading = self.analysis.read(&found.seed, &found.cycle)?;
        self.reading_periods.set(self.reading_periods.get() + found.cycle.period);
        Ok(found.reading.get_or_init(|| reading))
    }

    /// Whether the motion stays near a cycle that has these itineraries.
    fn stays(&self, found: &FoundCycle, itineraries: &[Itinerary], metric: &Metric, tolerance: f64) -> bool {
        let (period, now) = (found.cycle.period as usize, self.last_strobe_of(found));
        let strobe = |back: usize| now.checked_sub(back * period).map(|at| self.strobes[at]);
        let is_on_branch = |back: usize| self.itineraries[now - back * period..][..period] == *itineraries;
        stays(&found.cycle, strobe, is_on_branch, metric, tolerance)
    }

    /// Whether a tangent vector has grown by more than is possible near a stable cycle, while the motion was near the
    /// cycle. Then the motion is chaotic and came closer to the cycle by chance.
    fn tangent_grows_near(&self, found: &FoundCycle, metric: &Metric) -> bool {
        let (period, now) = (found.cycle.period as usize, self.last_strobe_of(found));
        let is_near = |n: &usize| {
            metric.distance(&self.strobes[now - n * period], &found.cycle.state) < RECURRENCE_DISTANCE
        };
        let cycles = (0..=now / period).take_while(is_near).count();
        exceeds_stretch(self.exponent.recent_growth((cycles * period).min(self.exponent.periods())))
    }

    /// Returns the index of the last strobe that corresponds to the cycle's state, and not to another point of the
    /// cycle.
    fn last_strobe_of(&self, found: &FoundCycle) -> usize {
        let period = found.cycle.period as usize;
        found.at + (self.strobes.len() - 1 - found.at) / period * period
    }

    /// Returns the distance of the motion from a cycle.
    fn distance_now(&self, found: &FoundCycle, metric: &Metric) -> f64 {
        metric.distance(&self.strobes[self.last_strobe_of(found)], &found.cycle.state)
    }

    /// Builds the results of motion on a cycle.
    fn periodic(&self, orbit: Orbit, strobe: State) -> Measurement {
        Measurement {
            period: Some(orbit.cycle_periods),
            lyapunov: Some([orbit.lyapunov, 0.0]),
            impacts_per_period: orbit.impacts_per_period,
            mesh_fraction: orbit.mesh_fraction,
            symmetric: orbit.symmetric,
            word: Some(orbit.word),
            cycle_time: orbit.cycle_time,
            multiplier: orbit.floquet.and_then(|multipliers| multipliers.first().copied()).map(polar),
            quantities: orbit.quantities,
            strobe,
            ..self.without_results(orbit.status)
        }
    }

    /// Builds the results of aperiodic motion over the last observed periods. For chaos the exponent must exceed zero
    /// by `errors` standard errors.
    fn aperiodic(&self, errors: f64) -> Measurement {
        let settings = &self.budget.settings;
        let from = self.strobes.len() - 1 - settings.observed_periods as usize;
        let (window, max_period) = (&self.strobes[from..], settings.max_period);
        let period = self.analysis.flow.period;
        let span = f64::from(settings.observed_periods);
        let [impacts, meshing_time] =
            [0, 1].map(|i| self.counts[self.counts.len() - 1][i] - self.counts[from][i]);
        let lyapunov = self.budget.exponent.then(|| self.exponent.estimate(period));
        let least = lyapunov.map(|(mean, error)| mean - errors * error);
        // Chaos in narrow bands may stay near a cycle for ever. An escape from a cycle ends before tangents grow as much.
        let averaged = &self.strobes[self.budget.exponent_from() as usize..];
        let near_saddle_periods = near_saddle(averaged, &Metric::of(window, self.analysis.flow), max_period);
        let is_escape = |rate: f64| rate * near_saddle_periods as f64 * period < ESCAPE_GROWTH;
        let periods = averaged.len().saturating_sub(1) as f64;
        let is_neutral =
            |rate: f64| rate * periods * period <= neutral_growth(self.budget.exponent_from(), periods);
        // Without events the motion is linear: growth by negative damping is not chaos.
        let events_at = |n: usize| self.counts.get(n).map(|counts| counts[2]);
        let is_linear = events_at(self.counts.len() - 1) == events_at(self.budget.exponent_from() as usize)
            && self.analysis.flow.is_linear_between_events();
        let slow = is_linear
            || rests(window, &Metric::of(window, self.analysis.flow), max_period)
            || lyapunov.is_some_and(|(mean, _)| is_growing(self.analysis.flow, &self.strobes, mean * period))
            || least.is_some_and(is_neutral)
            || 2.0 * near_saddle_periods as f64 >= span && least.is_none_or(is_escape);
        let late = &self.strobes[self.strobes.len() / TRANSIENT_SHARE..];
        let accelerates = self.analysis.flow.rigid_modes.accelerates;
        let is_quasi_periodic = !accelerates
            && !self.approaches_free
            && self.strobes.len() > self.budget.periods() as usize
            && lyapunov.is_some_and(|(mean, error)| {
                mean >= -errors * error - GROWTH_ROUNDING / period && is_neutral(mean.abs())
            })
            && is_regular(late, &Metric::of(late, self.analysis.flow), max_period);
        let status = match slow {
            _ if accelerates => Status::Accelerates,
            true if self.is_on_unstable => Status::UnstableCycle,
            true if self.is_neutral => Status::Neutral,
            true => Status::Slow,
            false => self.remark.map_or(Status::Ok, Status::from),
        };
        Measurement {
            is_quasi_periodic,
            lyapunov: lyapunov.map(|(mean, error)| [mean, error]),
            impacts_per_period: impacts / span,
            mesh_fraction: share(meshing_time, span * period),
            ..self.without_results(match is_quasi_periodic {
                true => self.remark.map_or(Status::Ok, Status::from),
                false => status,
            })
        }
    }

    /// Builds a measurement with the last strobe state and the numbers of periods only.
    fn without_results(&self, status: Status) -> Measurement {
        Measurement {
            period: None,
            is_quasi_periodic: false,
            status,
            lyapunov: None,
            impacts_per_period: 0.0,
            mesh_fraction: 0.0,
            symmetric: None,
            word: None,
            cycle_time: None,
            multiplier: None,
            quantities: None,
            strobe: self.strobes[self.strobes.len() - 1],
            periods_run: self.strobes.len() as u32 - 1,
            search_periods: self.newton.periods() + self.reading_periods.get(),
        }
    }
}
