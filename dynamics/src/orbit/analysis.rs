//! Classification of a motion with an extensible number of periods.

use std::sync::atomic::AtomicBool;

use super::approach::{BRANCH_CYCLES, HULL_CYCLES, LINEAR_TOLERANCE, stays};
use super::itinerary::Recorder;
use super::quantities::{Meter, Quantities};
use super::reading::{ON_STROBE_TURNS, Reading};
use super::recurrence::{Candidate, Metric, RECURRENCE_DISTANCE, candidates, rests};
use super::regularity::is_regular;
use super::resolution::{is_below_resolution, too_few_events};
use super::{Class, Orbit, Section, Settings, Status};
use crate::model::{Law, Model, ModelError, NonImpacting, State, Timing};
use crate::motion::Flow;
use crate::motion::{Allowance, Stop, Trajectory, share};
use crate::stability::{Cycle, Exponent, FRESH_TANGENT, Newton, StrobeMap, norm};
use crate::word::Word;

/// Default number of last periods whose events are listed for aperiodic motion.
pub const EVENT_PERIODS: u32 = 8;

/// Rounding error of the logarithm of a tangent vector's growth over a forcing period.
pub(super) const GROWTH_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Standard errors by which an exponent must exceed zero for chaos.
pub const CHAOS_ERRORS: f64 = 3.0;

/// Default number of forcing periods in the longest window. An undecided motion is observed in windows that double in length.
pub const LONGEST_WINDOW: u32 = 32_768;

/// Forcing periods of the window after which, by default, only a motion is observed further whose exponent may be positive. With the default
/// transient, other undecided motion ends after 8,764 periods.
const LAST_WINDOW: u32 = 4096;

/// Growth of a tangent vector, as a logarithm, that no escape from an unstable cycle reaches: it exceeds the ratio of the size of the
/// motion to rounding errors.
pub const ESCAPE_GROWTH: f64 = 40.0;

/// A motion counts as growing if its displacements grow faster than this share of the tangents' exponent.
pub const SHARED_GROWTH: f64 = 0.25;

/// Smallest expected growth, as a logarithm, at which a motion can be tested for growth, because largest displacements fluctuate.
pub const PLAIN_GROWTH: f64 = 0.5;

/// Periods in which a new tangent vector turns to the most expanding direction.
pub(super) const TANGENT_PERIODS: u32 = 50;

/// Largest distance of a trajectory that is on a cycle, relative to the size of the motion.
pub(super) const ON_CYCLE: f64 = 1e-8;

/// Largest ratio of the distances after and before, for a trajectory that approaches a cycle.
pub(super) const APPROACH_RATIO: f64 = 0.7;

/// Largest distance from which a trajectory is tested for approach, relative to the size of the motion.
const APPROACH_DISTANCE: f64 = 0.3;

/// Number of checks of an approach. At each check the trajectory must be closer than before.
const APPROACH_CHECKS: u32 = 4;

/// Work that one motion may take: about a minute.
pub(super) const ALLOWANCE: Allowance<'static> =
    Allowance { steps: 1_000_000_000, events: 200_000_000, ..Allowance::UNLIMITED };

/// Number of forcing periods for which a motion must be able to pay at least, unless fewer are requested.
const PLAIN_PERIODS: u32 = 528;

/// Time of a machine's step, in steps of a pair.
const MACHINE_STEP: f64 = 10.0;

/// Forcing periods between two reports of progress.
const REPORT_INTERVAL: u64 = 64;

/// Number of steps of a pair after which the window of an undecided motion is not extended.
const EXTENSION_STEPS: f64 = 1e8;

/// Number of first strobe states that show whether a motion begins on a cycle.
const FIRST_STROBES: usize = 17;

/// Largest number of cycles in a test for approach.
const APPROACH_CYCLE_CAP: f64 = 4000.0;

/// Integrates one cell from `start` at phase 0 and classifies its motion.
///
/// The motion is `periodic` if a stable cycle of at most `max_period` forcing periods is confirmed. It is `chaotic`
/// if the exponent exceeds zero by three standard errors and nearby motions have separated by a factor of `e^40` or
/// more. It is `quasi-periodic` if the exponent is zero within its error and the section is regular. If none of these
/// holds after the observed periods, windows of twice the length follow, up to 4,096 periods, or 32,768 if the exponent may be positive; after that it is undecided.
///
/// # Errors
/// [`ModelError`] if the model is not valid.
pub fn analyse(model: &dyn Model, start: State, settings: &Settings) -> Result<Orbit, ModelError> {
    Ok(analyse_flow(&Flow::of(model)?, model.law(), start, settings, EVENT_PERIODS))
}

/// Classifies a motion like [`analyse`], with windows of at most `longest_window` forcing periods after the first one, and
/// lists the events of the last `event_periods` of aperiodic motion. Calls `report` with the forcing periods so far and a
/// lower bound of their total, which grows with each window. Returns none if `halt` was raised.
///
/// # Errors
/// [`ModelError`] if the model is not valid.
pub fn analyse_until(
    model: &dyn Model,
    start: State,
    settings: &Settings,
    longest_window: u32,
    event_periods: u32,
    halt: &AtomicBool,
    report: &dyn Fn(u64, u64),
) -> Result<Option<Orbit>, ModelError> {
    let (flow, allowance) = (Flow::of(model)?, ALLOWANCE.until(halt));
    let new = Analysis::new(&flow, model.law(), settings);
    let analysis = Analysis { longest_window, event_periods, allowance, report, ..new };
    let orbit = analysis.orbit(start);
    Ok((!allowance.is_halted()).then_some(orbit))
}

/// Classifies a motion like [`analyse`], with a flow that the caller has computed, and lists the events of the last
/// `event_periods` of aperiodic motion.
pub fn analyse_flow(flow: &Flow, law: Law, start: State, settings: &Settings, event_periods: u32) -> Orbit {
    Analysis { event_periods, ..Analysis::new(flow, law, settings) }.orbit(start)
}

/// Largest error of a cycle's state, relative to the motion, within which a divisor of its period is its period.
const LARGEST_ERROR: f64 = 1e-3;

/// Distance of a cycle from one of a divisor of its period, in errors, up to which the period is not certain.
const UNCLEAR_ERRORS: f64 = 10.0;

/// Tangents that grow at most with this power of time do not show chaos. In neutral motion they grow in proportion to time (a free body, a
/// torus, an undamped oscillation), or to its square at a double root.
pub const NEUTRAL_ORDER: f64 = 2.0;

/// Returns the logarithm of the largest growth of tangents in neutral motion over `periods` after the first `from`.
pub(super) fn neutral_growth(from: u32, periods: f64) -> f64 {
    NEUTRAL_ORDER * ((f64::from(from) + periods) / f64::from(from.max(1))).ln()
}

/// Whether a motion grows because of negative damping or stiffness, or is too short to tell. Its tangents then grow without chaos.
/// `exponent` is the tangents' exponent per forcing period.
pub(super) fn is_growing(flow: &Flow, strobes: &[State], exponent: f64) -> bool {
    if !flow.escape.is_finite() {
        return false;
    }
    let (first, second) = strobes.split_at(strobes.len() / 2);
    let expected = SHARED_GROWTH * exponent * second.len() as f64;
    let largest = |part: &[State]| {
        let pairs = part.iter().flat_map(|y| y[..flow.state_len()].as_chunks::<2>().0);
        pairs.fold([0.0f64; 2], |most, pair| [0, 1].map(|i| most[i].max(pair[i].abs())))
    };
    // Between two walls only the rates can grow.
    let [before, after] = [first, second].map(largest);
    let grows = [0, 1].into_iter().any(|i| (after[i] / before[i]).ln() > expected);
    grows || expected < PLAIN_GROWTH
}

/// Returns the status of a motion that a stop has ended.
pub fn status_of(stop: Stop) -> Status {
    match stop {
        Stop::CapEvents => Status::CapEvents,
        Stop::CapRoot => Status::CapRoot,
        Stop::TooStiff => Status::TooStiff,
        Stop::NonFinite => Status::NonFinite,
        Stop::Escape => Status::Escape,
    }
}

fn failed(status: Status, strobe: State, forcing_period: f64) -> Orbit {
    Orbit {
        class: Class::Failed,
        status,
        lyapunov: f64::NAN,
        lyapunov_error: None,
        floquet: None,
        symmetric: None,
        word: Word::default(),
        impacts_per_period: f64::NAN,
        mesh_fraction: f64::NAN,
        quantities: None,
        strobe,
        strobe_meshing: None,
        events: Vec::new(),
        slips: Vec::new(),
        cycle_periods: 0,
        forcing_period,
        cycle_time: None,
        periods_run: 0,
    }
}

/// The results of one window of observation.
struct Window {
    strobes: Vec<State>,
    metric: Metric,
    lyapunov: f64,
    lyapunov_error: f64,
    impacts_per_period: f64,
    mesh_fraction: f64,
    events: u64,
}

pub(super) struct Analysis<'a> {
    pub(super) flow: &'a Flow,
    pub(super) law: Law,
    pub(super) settings: &'a Settings,
    pub(super) longest_window: u32,
    pub(super) event_periods: u32,
    pub(super) measures: bool,
    /// Whether the growth of rounding errors on cycles is computed.
    pub(super) resolves: bool,
    /// Work that the motion may take.
    pub(super) allowance: Allowance<'a>,
    /// Receives the forcing periods so far, and a lower bound of their total.
    pub(super) report: &'a dyn Fn(u64, u64),
}

impl<'a> Analysis<'a> {
    /// Prepares an analysis with default limits that computes everything except the events of aperiodic motion.
    pub(super) fn new(flow: &'a Flow, law: Law, settings: &'a Settings) -> Analysis<'a> {
        Analysis {
            flow,
            law,
            settings,
            longest_window: LONGEST_WINDOW,
            event_periods: 0,
            measures: true,
            resolves: true,
            allowance: ALLOWANCE,
            report: &|_, _| (),
        }
    }
}

impl Analysis<'_> {
    /// Classifies the motion from `start`. If an event of its cycle lies at phase 0, states are compared at another
    /// phase.
    fn orbit(&self, start: State) -> Orbit {
        let orbit = self.orbit_by_strobes(start);
        match orbit.status {
            Status::StrobeOnEvent => self.orbit_by_section(&orbit).unwrap_or(orbit),
            _ => orbit,
        }
    }

    /// Classifies the motion that continues a cycle with an event at phase 0; none if no cycle is found.
    fn orbit_by_section(&self, first: &Orbit) -> Option<Orbit> {
        let section = Section::of(self.flow, self.law, first.strobe, first.cycle_periods, self.allowance)?;
        let second = Analysis { flow: &section.flow, ..*self }.orbit_by_strobes(section.start);
        let Class::Periodic { period } = second.class else { return None };
        let (strobe, strobe_meshing) = section.strobe(self.law, second.strobe, ON_STROBE_TURNS)?;
        Some(Orbit {
            strobe,
            strobe_meshing,
            events: section.shifted(&second.events, period, |event| [&mut event.t, &mut event.t_mod_period]),
            slips: section.shifted(&second.slips, period, |slip| [&mut slip.t, &mut slip.t_mod_period]),
            quantities: second.quantities.map(|quantities| section.quantities(quantities)),
            periods_run: first.periods_run + second.periods_run,
            ..second
        })
    }

    fn orbit_by_strobes(&self, start: State) -> Orbit {
        let mut periods_run = 0;
        let run = self.run(start, &mut periods_run);
        let orbit = run.unwrap_or_else(|stop| failed(status_of(stop), start, self.flow.period));
        Orbit { periods_run, ..orbit }
    }

    /// Counts a forcing period and reports progress.
    fn count(&self, periods_run: &mut u64, total: u64) {
        *periods_run += 1;
        if periods_run.is_multiple_of(REPORT_INTERVAL) {
            (self.report)(*periods_run, total);
        }
    }

    /// Classifies the motion and counts its forcing periods in `periods_run`.
    fn run(&self, start: State, periods_run: &mut u64) -> Result<Orbit, Stop> {
        let mut trajectory = Trajectory::new(self.flow, self.law, start).allowing(self.allowance);
        let transient = self.settings.transient_periods;
        let periods = transient.saturating_add(self.settings.observed_periods).min(PLAIN_PERIODS);
        let cost = if self.flow.pair().is_some() { 1.0 } else { MACHINE_STEP };
        if cost * f64::from(periods) * self.flow.least_steps() > self.allowance.steps as f64 {
            return Err(Stop::TooStiff);
        }
        let mut first = vec![start];
        for _ in 0..transient {
            trajectory.advance_period(&mut ())?;
            self.count(periods_run, u64::from(transient) + u64::from(self.settings.observed_periods));
            if first.len() < FIRST_STROBES {
                first.push(trajectory.state());
                if first.len() == FIRST_STROBES
                    && let Some(orbit) = self.begins_on_unstable(&trajectory, &first, periods_run)?
                {
                    return Ok(orbit);
                }
            }
        }
        if let Some(orbit) = self.non_impacting(&trajectory)? {
            return Ok(orbit);
        }
        let mut length = self.settings.observed_periods.max(2);
        let last = length.max(self.longest_window);
        loop {
            let window = self.observe(&mut trajectory, length, periods_run)?;
            if self.flow.rigid_modes.accelerates {
                return self.aperiodic(trajectory, &window, Class::Undecided, Status::Accelerates);
            }
            let is_enough = last == LONGEST_WINDOW && length >= LAST_WINDOW && !self.may_be_chaotic(&window);
            let is_last = length >= last || is_enough;
            let free =
                if self.flow.timing == Timing::Free { self.free_orbit(&trajectory, length) } else { None };
            let approaches = free.as_ref().is_some_and(|free| free.approaches);
            if let Some(free) = free.filter(|free| free.is_reached(is_last)) {
                return Ok(free.orbit);
            }
            let found = candidates(&window.strobes, &window.metric, self.settings.max_period);
            for candidate in &found {
                if let Some(orbit) = self.confirm(&trajectory, &window, candidate)? {
                    return Ok(orbit);
                }
            }
            if self.is_chaotic(&window) {
                return self.aperiodic(trajectory, &window, Class::Chaotic, Status::Ok);
            }
            if !approaches && self.is_quasi_periodic(&window) {
                return self.aperiodic(trajectory, &window, Class::QuasiPeriodic, Status::Ok);
            }
            if is_last || cost * trajectory.work().steps as f64 > EXTENSION_STEPS {
                let status = self.undecided_status(&trajectory, &window.metric, &found);
                return self.aperiodic(trajectory, &window, Class::Undecided, status);
            }
            length = length.saturating_mul(2).min(last);
        }
    }

    /// Returns the orbit of motion that certainly has no further event, without waiting for its transient to decay.
    fn non_impacting(&self, trajectory: &Trajectory<'_, 0>) -> Result<Option<Orbit>, Stop> {
        let is_certain =
            |motion: &&NonImpacting| trajectory.is_free() && motion.is_certain(trajectory.state());
        let Some(motion) = self.flow.non_impacting().filter(is_certain) else { return Ok(None) };
        let steady = Trajectory::new(self.flow, self.law, motion.steady());
        let newton = &mut Newton::default();
        let cycle = self.maps(1).into_iter().find_map(|map| newton.refine(&steady, map));
        cycle.map(|cycle| self.periodic(&steady, &self.read(&steady, &cycle)?, &cycle, 0.0)).transpose()
    }

    /// Whether the motion is quasi-periodic: the largest exponent is zero, and the section is regular. On a torus, tangents do not shrink,
    /// and grow at most like those of neutral motion.
    fn is_quasi_periodic(&self, window: &Window) -> bool {
        let count = window.strobes.len() as f64;
        window.lyapunov >= -CHAOS_ERRORS * window.lyapunov_error - GROWTH_ROUNDING / self.flow.period
            && window.lyapunov.abs() * count * self.flow.period <= neutral_growth(TANGENT_PERIODS, count)
            && is_regular(&window.strobes, &window.metric, self.settings.max_period)
    }

    /// Returns the status of undecided motion: neutral if Newton's method finds a neutral cycle nearby.
    fn undecided_status(
        &self,
        trajectory: &Trajectory<'_, 0>,
        metric: &Metric,
        found: &[Candidate],
    ) -> Status {
        let mut maps = found.iter().flat_map(|candidate| self.maps(candidate.period));
        let is_neutral = maps.any(|map| {
            let cycle = Newton::default().refine(trajectory, map);
            cycle.is_some_and(|cycle| {
                cycle.is_neutral() && metric.distance(&trajectory.state(), &cycle.state) < RECURRENCE_DISTANCE
            })
        });
        if is_neutral { Status::Neutral } else { Status::Slow }
    }

    /// Whether nearby motions separate by more than in an escape from an unstable cycle, and by far more than in
    /// neutral motion, where they separate in proportion to time. Without events the motion is linear and not chaotic.
    fn is_chaotic(&self, window: &Window) -> bool {
        let grows = || is_growing(self.flow, &window.strobes, window.lyapunov * self.flow.period);
        let is_linear = window.events == 0 && self.flow.is_linear_between_events();
        if is_linear || grows() || rests(&window.strobes, &window.metric, self.settings.max_period) {
            return false;
        }
        let least = window.lyapunov - CHAOS_ERRORS * window.lyapunov_error;
        least * window.strobes.len() as f64 * self.flow.period > ESCAPE_GROWTH
    }

    /// Whether further periods may show chaos: the exponent is more than its error, and tangents grow faster than in neutral motion.
    fn may_be_chaotic(&self, window: &Window) -> bool {
        let count = window.strobes.len() as f64;
        window.lyapunov > window.lyapunov_error
            && window.lyapunov * count * self.flow.period > neutral_growth(TANGENT_PERIODS, count)
    }

    /// Integrates `length` periods and computes strobe states, exponent and averages.
    fn observe(
        &self,
        trajectory: &mut Trajectory<'_, 0>,
        length: u32,
        periods_run: &mut u64,
    ) -> Result<Window, Stop> {
        let mut carrier = trajectory.carrying([FRESH_TANGENT]);
        let mut exponent = Exponent::default();
        let turning = TANGENT_PERIODS.min(length);
        let total = *periods_run + u64::from(turning) + u64::from(length);
        for _ in 0..turning {
            carrier.advance_period(&mut ())?;
            self.count(periods_run, total);
            exponent.renormalise(&mut carrier);
        }
        exponent.reset();
        let (mesh_start, before) = (carrier.meshing_time(), carrier.work());
        let mut strobes = vec![carrier.state()];
        for _ in 0..length {
            carrier.advance_period(&mut ())?;
            self.count(periods_run, total);
            exponent.renormalise(&mut carrier);
            strobes.push(carrier.state());
        }
        let (lyapunov, lyapunov_error) = exponent.estimate(self.flow.period);
        let span = f64::from(length);
        *trajectory = carrier.carrying([]);
        Ok(Window {
            metric: Metric::of(&strobes, self.flow),
            strobes,
            lyapunov,
            lyapunov_error,
            impacts_per_period: (carrier.work().impacts - before.impacts) as f64 / span,
            events: carrier.work().events - before.events,
            mesh_fraction: share(carrier.meshing_time() - mesh_start, span * self.flow.period),
        })
    }

    /// Returns the orbit of a candidate, if Newton's method finds a stable cycle that the trajectory approaches.
    fn confirm(
        &self,
        trajectory: &Trajectory<'_, 0>,
        window: &Window,
        candidate: &Candidate,
    ) -> Result<Option<Orbit>, Stop> {
        for map in self.maps(candidate.period) {
            let newton = &mut Newton::default();
            let Some(cycle) = newton.refine(trajectory, map) else { continue };
            let Some(cycle) = self.smallest(newton, trajectory, cycle, &window.metric) else { continue };
            let now = window.metric.distance(&trajectory.state(), &cycle.state);
            let distance = match cycle.is_stable() {
                true => self.approach(trajectory, &cycle, &window.metric)?,
                false if self.stays_on_unstable(window, &cycle) => {
                    return self.on_unstable(trajectory, window, cycle).map(Some);
                }
                // Motion near a neutral cycle neither approaches nor leaves it.
                false => Some(now).filter(|&now| cycle.is_neutral() && now < ON_CYCLE),
            };
            if let Some(distance) = distance {
                let reading = self.read(trajectory, &cycle)?;
                return Ok(Some(self.periodic(trajectory, &reading, &cycle, distance)?));
            }
        }
        Ok(None)
    }

    /// Whether the motion has stayed on an unstable cycle over a window, and further windows would not lead it away: either its distance grows
    /// too slowly, or rounding errors would have led it away already, and do not grow for a reason such as a symmetry.
    fn stays_on_unstable(&self, window: &Window, cycle: &Cycle) -> bool {
        let mut strobes = window.strobes.iter().rev().step_by(cycle.period as usize);
        let growth = cycle.log_radius / f64::from(cycle.period);
        let remains = growth * 2.0 * f64::from(self.longest_window) < (RECURRENCE_DISTANCE / ON_CYCLE).ln();
        let resists = growth * window.strobes.len() as f64 > (ON_CYCLE / f64::EPSILON).ln();
        (remains || resists)
            && !cycle.is_neutral()
            && strobes.all(|y| window.metric.distance(y, &cycle.state) < ON_CYCLE)
    }

    /// Builds the orbit of a motion that stays on an unstable cycle.
    fn on_unstable(
        &self,
        trajectory: &Trajectory<'_, 0>,
        window: &Window,
        cycle: Cycle,
    ) -> Result<Orbit, Stop> {
        let orbit = self.aperiodic(trajectory.clone(), window, Class::Undecided, Status::UnstableCycle)?;
        Ok(Orbit { floquet: Some(cycle.multipliers), ..orbit })
    }

    /// Returns the orbit of a motion that begins on an unstable cycle and stays there, given its first strobe states.
    fn begins_on_unstable(
        &self,
        trajectory: &Trajectory<'_, 0>,
        strobes: &[State],
        periods_run: &mut u64,
    ) -> Result<Option<Orbit>, Stop> {
        let metric = Metric::of(strobes, self.flow);
        let returns = |period: &usize| {
            (*period..strobes.len()).all(|i| metric.distance(&strobes[i], &strobes[i - period]) < ON_CYCLE)
        };
        let Some(period) = (1..=strobes.len() / 2).find(returns) else { return Ok(None) };
        for map in self.maps(period as u32) {
            let found = Newton::default().refine(trajectory, map);
            let Some(cycle) = found.filter(|cycle| !cycle.is_stable() && !cycle.is_neutral()) else {
                continue;
            };
            let mut ahead = trajectory.clone();
            let window = self.observe(&mut ahead, strobes.len() as u32, periods_run)?;
            if self.stays_on_unstable(&window, &cycle) {
                return self.on_unstable(&ahead, &window, cycle).map(Some);
            }
        }
        Ok(None)
    }

    /// Returns the maps that may have a cycle of this period as a fixed point. Only cycles of odd period can be symmetric; for these the
    /// half-period map is tried first, because it is more reliable.
    pub(super) fn maps(&self, period: u32) -> Vec<StrobeMap> {
        let whole = StrobeMap::Periods(period);
        // `smallest` tests the symmetry of other cycles.
        if period % 2 == 1 && self.flow.is_half_symmetric(&self.law) {
            vec![StrobeMap::MirroredHalves(period), whole]
        } else {
            vec![whole]
        }
    }

    /// Returns the cycle with its smallest period, and with its symmetry tested.
    pub(super) fn smallest(
        &self,
        newton: &mut Newton,
        seed: &Trajectory<'_>,
        cycle: Cycle,
        metric: &Metric,
    ) -> Option<Cycle> {
        let mut cycle = self.with_smallest_period(newton, seed, cycle, metric)?;
        let may_be_symmetric = cycle.period % 2 == 1 && self.flow.mirror_symmetric(&self.law);
        if may_be_symmetric && !self.flow.is_half_symmetric(&self.law) {
            let mut half = seed.at(cycle.state, []);
            let middle = (0..cycle.period / 2).try_for_each(|_| half.advance_period(&mut ()));
            middle.and_then(|()| half.advance_to(0.5 * self.flow.period, &mut ())).ok()?;
            let mirrored = self.flow.rigid_modes.shifted_back(half.state().map(|value| -value));
            let distance = metric.distance(&mirrored, &self.flow.rigid_modes.shifted_back(cycle.state));
            // The map amplifies the rounding error of the fixed point.
            let image = newton.apply(StrobeMap::Periods(cycle.period), seed, cycle.state)?;
            cycle.symmetric = distance < ON_CYCLE * norm(&image.balanced()).max(1.0);
        }
        Some(cycle)
    }

    fn with_smallest_period(
        &self,
        newton: &mut Newton,
        seed: &Trajectory<'_>,
        mut cycle: Cycle,
        metric: &Metric,
    ) -> Option<Cycle> {
        let divisors = (1..=cycle.period).filter(|p| cycle.period.is_multiple_of(*p));
        for period in divisors {
            for map in self.maps(period) {
                // The cycle is already known to be a fixed point of this map.
                if period == cycle.period && (cycle.symmetric || map == StrobeMap::Periods(period)) {
                    return Some(cycle);
                }
                let image = newton.apply(map, seed, cycle.state)?;
                // The map amplifies the error of the fixed point. Beside a flip it is much larger than rounding.
                let error = cycle.error(metric.distance(&cycle.image, &cycle.state)).min(LARGEST_ERROR);
                let growth = norm(&image.balanced()).max(1.0);
                let distance = metric.distance(&image.state, &cycle.state);
                if distance > growth * ON_CYCLE.max(2.0 * UNCLEAR_ERRORS * error) {
                    continue;
                }
                let Some(shorter) = newton.refine(&seed.at(cycle.state, []), map) else { continue };
                let apart = metric.distance(&shorter.state, &cycle.state);
                // Beyond a flip, the unstable cycle lies near every cycle of twice its period.
                let replaces = apart <= error && (shorter.is_stable() || shorter.is_neutral());
                if distance < growth * ON_CYCLE || replaces {
                    return Some(shorter);
                }
                cycle.may_be_shorter |= apart <= UNCLEAR_ERRORS * error;
            }
        }
        Some(cycle)
    }

    /// Returns the last distance of the trajectory from the cycle, if it approaches the cycle.
    fn approach(
        &self,
        trajectory: &Trajectory<'_, 0>,
        cycle: &Cycle,
        metric: &Metric,
    ) -> Result<Option<f64>, Stop> {
        let before = metric.distance(&trajectory.state(), &cycle.state);
        if before < ON_CYCLE {
            return Ok(Some(before));
        }
        if before > APPROACH_DISTANCE {
            return Ok(None);
        }
        // The number of cycles in which the slowest direction decays to half.
        let cycles = (0.5f64.ln() / cycle.spectral_radius().max(0.1).ln()).ceil().min(APPROACH_CYCLE_CAP);
        let mut ahead = trajectory.clone();
        let mut last = before;
        for _ in 0..APPROACH_CHECKS {
            for _ in 0..cycle.period * (cycles / f64::from(APPROACH_CHECKS)).ceil() as u32 {
                ahead.advance_period(&mut ())?;
            }
            let now = metric.distance(&ahead.state(), &cycle.state);
            if now >= last && now > ON_CYCLE {
                return Ok(None);
            }
            last = now;
        }
        if last < ON_CYCLE {
            return Ok(Some(last));
        }
        // For a multiplier near 1, half of the predicted decrease is enough.
        let predicted = 1.0 - 0.5 * (1.0 - cycle.spectral_radius().powf(cycles));
        let is_nearer = last < APPROACH_RATIO.max(predicted) * before;
        Ok((is_nearer && self.stays(trajectory, &mut ahead, cycle, metric)?).then_some(last))
    }

    /// Whether a trajectory near a cycle stays there. A chaotic motion can come closer by chance, so the trajectory
    /// is integrated until [`stays`] holds.
    fn stays(
        &self,
        seed: &Trajectory<'_>,
        ahead: &mut Trajectory<'_>,
        cycle: &Cycle,
        metric: &Metric,
    ) -> Result<bool, Stop> {
        let Reading { itineraries, closes, .. } = self.read(seed, cycle)?;
        if !closes {
            return Ok(false);
        }
        let mut strobes = vec![ahead.state()];
        let mut are_alike = Vec::new();
        for n in 1..=HULL_CYCLES {
            let mut is_alike = true;
            for itinerary in &itineraries {
                let mut recorder = Recorder::new(self.flow);
                ahead.advance_period(&mut recorder)?;
                is_alike &= recorder.itinerary == *itinerary;
            }
            strobes.push(ahead.state());
            are_alike.push(is_alike);
            let strobe = |back: usize| n.checked_sub(back).map(|at| strobes[at]);
            let is_on_branch = |back: usize| are_alike[n - back];
            if n >= BRANCH_CYCLES && stays(cycle, strobe, is_on_branch, metric, LINEAR_TOLERANCE) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Integrates a cycle once and collects its events.
    pub(super) fn read(&self, seed: &Trajectory<'_>, cycle: &Cycle) -> Result<Reading, Stop> {
        let mut trajectory = seed.at(cycle.state, []);
        let first = trajectory.clone();
        let mut reading = Reading::take(self.flow, &mut trajectory, cycle.period, self.measures)?;
        let closes = trajectory.is_in_domain_of(&first) || reading.on_strobe;
        // The symbol of the first flight depends on the wall that `seed` came from. If the cycle comes from another
        // wall, a second turn has the right symbol.
        if !trajectory.has_mode_and_origin_of(&first) || reading.near_grazing || reading.on_strobe {
            reading = Reading::take(self.flow, &mut trajectory, cycle.period, self.measures)?;
        }
        Ok(Reading { closes, ..reading })
    }

    /// Builds the orbit of a cycle; `distance` is the motion's distance from the cycle. The growth of rounding errors is computed only if
    /// no other status comes first.
    ///
    /// # Errors
    /// A [`Stop`] if the cycle cannot be integrated.
    pub(super) fn periodic(
        &self,
        seed: &Trajectory<'_>,
        reading: &Reading,
        cycle: &Cycle,
        distance: f64,
    ) -> Result<Orbit, Stop> {
        let status = if let Some(remark) = seed.remark().max(reading.remark) {
            remark.into()
        } else if reading.near_grazing || cycle.near_grazing {
            Status::NearGrazing
        } else if reading.on_strobe {
            Status::StrobeOnEvent
        } else if cycle.is_neutral() || cycle.may_be_shorter {
            Status::Neutral
        } else if distance > ON_CYCLE {
            Status::Slow
        } else if self.resolves
            && !too_few_events(cycle.period, &reading.events)
            && is_below_resolution(seed, cycle, &reading.events, f64::EPSILON)?
        {
            Status::BelowResolution
        } else {
            Status::Ok
        };
        let moves = self.flow.timing == Timing::Forced || self.moves(seed, cycle);
        let rests = !moves && reading.events.is_empty();
        Ok(Orbit {
            class: Class::Periodic { period: cycle.period },
            status,
            lyapunov: cycle.exponent(self.flow.period),
            lyapunov_error: None,
            floquet: Some(cycle.multipliers.clone()),
            symmetric: Some(cycle.symmetric),
            word: reading.word.clone(),
            impacts_per_period: reading.impacts_per_period,
            mesh_fraction: reading.mesh_fraction,
            quantities: if rests { reading.quantities.map(Quantities::at_rest) } else { reading.quantities },
            strobe: cycle.state,
            strobe_meshing: reading.strobe_meshing,
            events: reading.events.clone(),
            slips: reading.slips.clone(),
            cycle_periods: cycle.period,
            forcing_period: self.flow.period,
            cycle_time: (moves && self.flow.timing == Timing::Cycle).then_some(self.flow.period),
            periods_run: 0,
        })
    }

    /// Whether the motion of a cycle moves, other than along rigid-body modes.
    fn moves(&self, seed: &Trajectory<'_>, cycle: &Cycle) -> bool {
        let flow = self.flow;
        let velocity = flow.rigid_modes.shifted_back(seed.at(cycle.state, []).velocity());
        let rates = velocity.as_chunks::<2>().0.iter();
        let sizes = rates.map(|[rate, acceleration]| rate.abs().max(acceleration.abs() / flow.omega));
        sizes.fold(0.0, f64::max) > ON_CYCLE * flow.omega * flow.length
    }

    /// Measures the observed periods that follow a trajectory; none if they are not requested or it cannot be
    /// continued.
    pub(super) fn quantities(&self, trajectory: &Trajectory<'_>) -> Option<Quantities> {
        let periods = self.settings.observed_periods.max(1);
        let measure = || Meter::measure_aperiodic(&mut trajectory.clone(), periods);
        self.measures.then(measure)?.ok()
    }

    /// Measures a period of contact-free motion in its steady response.
    pub(super) fn steady_quantities(&self, motion: &NonImpacting) -> Option<Quantities> {
        self.measures.then(|| Meter::measure_steady(self.flow, self.law, motion))?.ok()
    }

    /// Builds the orbit of aperiodic motion.
    fn aperiodic(
        &self,
        mut trajectory: Trajectory<'_, 0>,
        window: &Window,
        class: Class,
        status: Status,
    ) -> Result<Orbit, Stop> {
        let quantities = self.quantities(&trajectory);
        let reading = Reading::take(self.flow, &mut trajectory, self.event_periods, false)?;
        Ok(Orbit {
            class,
            status: match (status, reading.remark) {
                (Status::Ok, Some(remark)) => remark.into(),
                (Status::Ok, None) if reading.on_strobe => Status::StrobeOnEvent,
                (status, _) => status,
            },
            lyapunov: window.lyapunov,
            lyapunov_error: Some(window.lyapunov_error),
            floquet: None,
            symmetric: None,
            word: reading.word,
            impacts_per_period: window.impacts_per_period,
            mesh_fraction: window.mesh_fraction,
            quantities,
            strobe: reading.strobe,
            strobe_meshing: reading.strobe_meshing,
            events: reading.events,
            slips: reading.slips,
            cycle_periods: self.event_periods,
            forcing_period: self.flow.period,
            cycle_time: None,
            periods_run: 0,
        })
    }
}
