//! Deciding what a cell's motion is.

use std::sync::atomic::AtomicBool;

use super::approach::{HULL_CYCLES, LINEAR, SHOWN_CYCLES, stays};
use super::itinerary::Recorder;
use super::reading::Reading;
use super::recurrence::{Candidate, Metric, candidates};
use super::{Class, Orbit, Settings, Status};
use crate::flow::Flow;
use crate::model::{Law, Model, ModelError, NonImpacting, State};
use crate::reference::{Allowance, Stop, Trajectory};
use crate::stability::{Cycle, Exponent, FRESH_TANGENT, Newton, StrobeMap};
use crate::word::Word;

/// Forcing periods whose events are shown where the motion is not periodic.
pub const SHOWN_PERIODS: u32 = 8;

/// Standard errors by which an exponent must exceed zero to be called chaos.
pub const CHAOS_ERRORS: f64 = 3.0;

/// An undecided motion is observed again, twice as long each time, until a window has this
/// many forcing periods (or as many as were asked for, if that is more).
const LONGEST_WINDOW: u32 = 32_768;

/// Growth of a tangent vector, as a natural logarithm, that no escape from an unstable cycle lasts through: beyond the
/// ratio of the size of the motion to rounding.
pub const ESCAPE_GROWTH: f64 = 40.0;

/// Periods over which a fresh tangent vector turns to its direction.
pub(super) const TANGENT_PERIODS: u32 = 50;

/// A trajectory this close to a cycle, relative to the motion, is on it.
pub(super) const ON_CYCLE: f64 = 1e-8;

/// Share of its distance by which a trajectory must have come closer to be seen to approach.
pub(super) const APPROACH: f64 = 0.7;

/// A trajectory farther from a cycle than this, relative to the motion, is elsewhere.
const WITHIN_REACH: f64 = 0.3;

/// Checks of an approach on the way; at each the trajectory must have come nearer.
const APPROACH_CHECKS: u32 = 4;

/// Work that one motion may take: about a minute.
pub(super) const ALLOWANCE: Allowance<'static> =
    Allowance { steps: 1_000_000_000, events: 200_000_000, ..Allowance::UNLIMITED };

/// An undecided motion that has taken this many steps is not observed for longer.
const EXTENSION_STEPS: u64 = 100_000_000;

/// Most cycles that an approach is watched for.
const APPROACH_CYCLES: f64 = 4000.0;

/// Integrates one cell from `start` at phase 0 and reads its orbit.
///
/// The motion is `periodic` if a stable cycle of at most `max_period` forcing periods is
/// confirmed, `chaotic` if the exponent exceeds zero by three standard errors and nearby
/// motions have separated by `e^40` or more. Where neither holds after the observed periods,
/// windows of twice the length follow, up to 32,768 periods, before it is called undecided.
///
/// # Errors
/// [`ModelError`] if the model is not valid: it has no motion.
pub fn analyse(model: &dyn Model, start: State, settings: &Settings) -> Result<Orbit, ModelError> {
    analyse_over(model, start, settings, SHOWN_PERIODS)
}

/// [`analyse`], showing the events of the last `shown_periods` of a motion that is not
/// periodic.
///
/// # Errors
/// As [`analyse`].
pub fn analyse_over(
    model: &dyn Model,
    start: State,
    settings: &Settings,
    shown_periods: u32,
) -> Result<Orbit, ModelError> {
    Ok(analyse_flow(&Flow::of(model)?, model.law(), start, settings, shown_periods))
}

/// [`analyse_over`] until a flag is raised; none if it was by then.
///
/// # Errors
/// As [`analyse`].
pub fn analyse_until(
    model: &dyn Model,
    start: State,
    settings: &Settings,
    shown_periods: u32,
    halt: &AtomicBool,
) -> Result<Option<Orbit>, ModelError> {
    let (flow, allowance) = (Flow::of(model)?, ALLOWANCE.until(halt));
    let analysis = Analysis { flow: &flow, law: model.law(), settings, shown_periods, allowance };
    let orbit = analysis.orbit(start);
    Ok((!allowance.is_halted()).then_some(orbit))
}

/// [`analyse_over`] on a flow that is at hand: maps share one among many cells.
pub fn analyse_flow(flow: &Flow, law: Law, start: State, settings: &Settings, shown_periods: u32) -> Orbit {
    Analysis { flow, law, settings, shown_periods, allowance: ALLOWANCE }.orbit(start)
}

/// The status that a stop gives a motion.
pub fn status_of(stop: Stop) -> Status {
    match stop {
        Stop::CapEvents => Status::CapEvents,
        Stop::CapRoot => Status::CapRoot,
        Stop::TooStiff => Status::TooStiff,
        Stop::NonFinite => Status::NonFinite,
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
        strobe,
        strobe_meshing: None,
        events: Vec::new(),
        cycle_periods: 0,
        forcing_period,
        periods_run: 0,
    }
}

/// What one window of observation showed.
struct Window {
    strobes: Vec<State>,
    metric: Metric,
    lyapunov: f64,
    lyapunov_error: f64,
    impacts_per_period: f64,
    mesh_fraction: f64,
}

pub(super) struct Analysis<'a> {
    pub(super) flow: &'a Flow,
    pub(super) law: Law,
    pub(super) settings: &'a Settings,
    pub(super) shown_periods: u32,
    /// What the motion may take.
    pub(super) allowance: Allowance<'a>,
}

impl Analysis<'_> {
    fn orbit(&self, start: State) -> Orbit {
        let mut periods_run = 0;
        let run = self.run(start, &mut periods_run);
        let orbit = run.unwrap_or_else(|stop| failed(status_of(stop), start, self.flow.period));
        Orbit { periods_run, ..orbit }
    }

    /// Counts in `periods_run` how long the motion is followed.
    fn run(&self, start: State, periods_run: &mut u64) -> Result<Orbit, Stop> {
        let mut trajectory = Trajectory::new(self.flow, self.law, start).allowing(self.allowance);
        for _ in 0..self.settings.transient_periods {
            trajectory.advance_period(&mut ())?;
            *periods_run += 1;
        }
        if let Some(orbit) = self.non_impacting(&trajectory)? {
            return Ok(orbit);
        }
        let mut length = self.settings.observed_periods.max(2);
        let last = length.max(LONGEST_WINDOW);
        loop {
            let window = self.observe(&mut trajectory, length, periods_run)?;
            let found = candidates(&window.strobes, &window.metric, self.settings.max_period);
            for candidate in &found {
                if let Some(orbit) = self.confirm(&trajectory, &window, candidate)? {
                    return Ok(orbit);
                }
            }
            if self.is_chaotic(&window) {
                return self.aperiodic(trajectory, &window, Class::Chaotic, Status::Ok);
            }
            // Neither yet: a slow approach, a slow escape, or an average too short.
            if length >= last || trajectory.work().steps > EXTENSION_STEPS {
                return self.aperiodic(trajectory, &window, Class::Undecided, Status::Slow);
            }
            length = length.saturating_mul(2).min(last);
        }
    }

    /// Contact-free motion that has no event to come: its steady response, which is known, where the
    /// forcing is so fast that little of the transient is gone after a period.
    fn non_impacting(&self, trajectory: &Trajectory<'_, 0>) -> Result<Option<Orbit>, Stop> {
        let is_certain =
            |motion: &&NonImpacting| trajectory.meshing().is_none() && motion.is_certain(trajectory.state());
        let Some(motion) = self.flow.non_impacting().filter(is_certain) else { return Ok(None) };
        let steady = Trajectory::new(self.flow, self.law, motion.steady());
        let newton = &mut Newton::default();
        let cycle = self.maps(1).into_iter().find_map(|map| newton.refine(&steady, map));
        let of = |cycle: Cycle| {
            let cycle = match motion.resting() {
                Some(resting) => cycle.beside_rest(resting).unwrap_or(cycle),
                None => cycle,
            };
            Ok(self.periodic(&self.read(&steady, &cycle)?, &cycle, 0.0))
        };
        cycle.map(of).transpose()
    }

    /// Whether nearby motions separate for good: by more than an escape from an unstable
    /// cycle could last through, and by far more than the growth in proportion to time that
    /// neutral motion shows.
    fn is_chaotic(&self, window: &Window) -> bool {
        let surely = window.lyapunov - CHAOS_ERRORS * window.lyapunov_error;
        surely * window.strobes.len() as f64 * self.flow.period > ESCAPE_GROWTH
    }

    /// Watches strobe states, the exponent and the averages for `length` periods.
    fn observe(
        &self,
        trajectory: &mut Trajectory<'_, 0>,
        length: u32,
        periods_run: &mut u64,
    ) -> Result<Window, Stop> {
        let mut carrier = trajectory.carrying([FRESH_TANGENT]);
        let mut exponent = Exponent::default();
        for _ in 0..TANGENT_PERIODS.min(length) {
            carrier.advance_period(&mut ())?;
            *periods_run += 1;
            exponent.renormalise(&mut carrier);
        }
        exponent.reset();
        let (mesh_start, impacts_start) = (carrier.meshing_time(), carrier.work().impacts);
        let mut strobes = vec![carrier.state()];
        for _ in 0..length {
            carrier.advance_period(&mut ())?;
            *periods_run += 1;
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
            impacts_per_period: (carrier.work().impacts - impacts_start) as f64 / span,
            mesh_fraction: (carrier.meshing_time() - mesh_start) / (span * self.flow.period),
        })
    }

    /// The orbit of a candidate, if Newton finds a stable cycle there that the trajectory is
    /// seen to approach.
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
            if cycle.is_stable()
                && let Some(distance) = self.approach(trajectory, &cycle, &window.metric)?
            {
                let reading = self.read(trajectory, &cycle)?;
                return Ok(Some(self.periodic(&reading, &cycle, distance)));
            }
        }
        Ok(None)
    }

    /// The maps that a cycle of this period may be a fixed point of. Only cycles of odd
    /// period can be symmetric; those are found more surely by the half-period map.
    pub(super) fn maps(&self, period: u32) -> Vec<StrobeMap> {
        let whole = StrobeMap::Periods(period);
        if period % 2 == 1 && self.flow.mirror_symmetric(&self.law) {
            vec![StrobeMap::MirroredHalves(period), whole]
        } else {
            vec![whole]
        }
    }

    /// The same orbit with its smallest period, and its symmetry tested.
    pub(super) fn smallest(
        &self,
        newton: &mut Newton,
        seed: &Trajectory<'_>,
        cycle: Cycle,
        metric: &Metric,
    ) -> Option<Cycle> {
        let divisors = (1..=cycle.period).filter(|p| cycle.period.is_multiple_of(*p));
        for period in divisors {
            for map in self.maps(period) {
                // It closes after its own period, and need not be refined again.
                if period == cycle.period && (cycle.symmetric || map == StrobeMap::Periods(period)) {
                    return Some(cycle);
                }
                let image = newton.apply(map, seed, cycle.state)?;
                // What rounding leaves of the residual, the map amplifies.
                let close = ON_CYCLE * image.balanced().norm().max(1.0);
                if metric.distance(&image.state, &cycle.state) < close
                    && let Some(shorter) = newton.refine(&seed.at(cycle.state, []), map)
                {
                    return Some(shorter);
                }
            }
        }
        Some(cycle)
    }

    /// The distance at which the trajectory is seen to approach the cycle, if it is.
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
        if before > WITHIN_REACH {
            return Ok(None);
        }
        // Long enough for the slowest direction to shrink to half.
        let cycles = (0.5f64.ln() / cycle.spectral_radius().max(0.1).ln()).ceil().min(APPROACH_CYCLES);
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
        // A multiplier near 1 shrinks little; half of what it promises must be seen.
        let promised = 1.0 - 0.5 * (1.0 - cycle.spectral_radius().powf(cycles));
        let is_nearer = last < APPROACH.max(promised) * before;
        Ok((is_nearer && self.stays(trajectory, &mut ahead, cycle, metric)?).then_some(last))
    }

    /// Whether a trajectory that has come near a cycle stays there: a band of chaos beside one comes nearer by
    /// chance. It is followed until that shows.
    fn stays(
        &self,
        seed: &Trajectory<'_>,
        ahead: &mut Trajectory<'_>,
        cycle: &Cycle,
        metric: &Metric,
    ) -> Result<bool, Stop> {
        let Reading { itineraries: shown, closes, .. } = self.read(seed, cycle)?;
        if !closes {
            return Ok(false);
        }
        let mut strobes = vec![ahead.state()];
        let mut are_alike = Vec::new();
        for n in 1..=HULL_CYCLES {
            let mut is_alike = true;
            for itinerary in &shown {
                let mut recorder = Recorder::new(self.flow);
                ahead.advance_period(&mut recorder)?;
                is_alike &= recorder.itinerary == *itinerary;
            }
            strobes.push(ahead.state());
            are_alike.push(is_alike);
            let beside = |back: usize| n.checked_sub(back).map(|at| strobes[at]);
            let is_on_branch = |back: usize| are_alike[n - back];
            if n >= SHOWN_CYCLES && stays(cycle, beside, is_on_branch, metric, LINEAR) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Reads a cycle off a turn around it.
    pub(super) fn read(&self, seed: &Trajectory<'_>, cycle: &Cycle) -> Result<Reading, Stop> {
        let mut trajectory = seed.at(cycle.state, []);
        let begun = trajectory.clone();
        let mut reading = Reading::take(self.flow, &mut trajectory, cycle.period)?;
        let closes = trajectory.is_in_domain_of(&begun) || reading.on_strobe;
        // The first flight has its symbol from where `seed` came from: right if the cycle comes from there, too.
        if !trajectory.has_mode_and_origin_of(&begun) || reading.near_grazing || reading.on_strobe {
            reading = Reading::take(self.flow, &mut trajectory, cycle.period)?;
        }
        Ok(Reading { closes, ..reading })
    }

    /// The orbit of a cycle that was read, at a distance from it.
    pub(super) fn periodic(&self, reading: &Reading, cycle: &Cycle, distance: f64) -> Orbit {
        let status = if reading.near_grazing || cycle.near_grazing {
            Status::NearGrazing
        } else if reading.on_strobe {
            Status::StrobeOnEvent
        } else if distance > ON_CYCLE {
            Status::Slow
        } else {
            Status::Ok
        };
        Orbit {
            class: Class::Periodic { period: cycle.period },
            status,
            lyapunov: cycle.exponent(self.flow.period),
            lyapunov_error: None,
            floquet: Some(cycle.multipliers.clone()),
            symmetric: Some(cycle.symmetric),
            word: reading.word.clone(),
            impacts_per_period: reading.impacts_per_period,
            mesh_fraction: reading.mesh_fraction,
            strobe: cycle.state,
            strobe_meshing: reading.strobe_meshing,
            events: reading.events.clone(),
            cycle_periods: cycle.period,
            forcing_period: self.flow.period,
            periods_run: 0,
        }
    }

    fn aperiodic(
        &self,
        mut trajectory: Trajectory<'_, 0>,
        window: &Window,
        class: Class,
        status: Status,
    ) -> Result<Orbit, Stop> {
        let reading = Reading::take(self.flow, &mut trajectory, self.shown_periods)?;
        Ok(Orbit {
            class,
            status: if status == Status::Ok && reading.on_strobe { Status::StrobeOnEvent } else { status },
            lyapunov: window.lyapunov,
            lyapunov_error: Some(window.lyapunov_error),
            floquet: None,
            symmetric: None,
            word: reading.word,
            impacts_per_period: window.impacts_per_period,
            mesh_fraction: window.mesh_fraction,
            strobe: reading.strobe,
            strobe_meshing: reading.strobe_meshing,
            events: reading.events,
            cycle_periods: self.shown_periods,
            forcing_period: self.flow.period,
            periods_run: 0,
        })
    }
}
