//! Deciding what a cell's motion is.

use super::approach::{LINEAR_CYCLES, is_linear};
use super::reading::Reading;
use super::recurrence::{Candidate, Metric, candidates};
use super::{Class, Orbit, Settings, Status};
use crate::flow::Flow;
use crate::model::{GearPair, Law, Quiet, State};
use crate::reference::{Stop, Trajectory};
use crate::stability::{Cycle, Exponent, FRESH_TANGENT, Newton, StrobeMap};
use crate::word::Word;

/// Forcing periods whose events are shown where the motion is not periodic.
const SHOWN_PERIODS: u32 = 8;

/// Standard errors by which an exponent must exceed zero to be called chaos.
pub const CHAOS_ERRORS: f64 = 3.0;

/// An undecided motion is observed again, twice as long each time, until a window has this
/// many forcing periods (or as many as were asked for, if that is more).
const LONGEST_WINDOW: u32 = 32_768;

/// Growth, as a logarithm, that takes a departure from rounding to the size of the motion.
pub(super) const DEPARTURE: f64 = 40.0;

/// Periods over which a fresh tangent vector turns to its direction.
pub(super) const TANGENT_PERIODS: u32 = 50;

/// A trajectory this close to a cycle, relative to the motion, is on it.
pub(super) const ON_CYCLE: f64 = 1e-8;

/// Share of its distance by which a trajectory must have come closer to be seen to approach.
pub(super) const APPROACH: f64 = 0.7;

/// A trajectory farther from a cycle than this, relative to the motion, is elsewhere.
const WITHIN_REACH: f64 = 0.3;

/// Looks at an approach on the way; at each the trajectory must have come nearer.
const APPROACH_LOOKS: u32 = 4;

/// Steps that one cell may take before it ends as too stiff: about a minute.
const STEPS_CAP: u64 = 1_000_000_000;

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
pub fn analyse(pair: &GearPair, start: State, settings: &Settings) -> Orbit {
    analyse_over(pair, start, settings, SHOWN_PERIODS)
}

/// [`analyse`], showing the events of the last `shown_periods` of a motion that is not
/// periodic.
pub fn analyse_over(pair: &GearPair, start: State, settings: &Settings, shown_periods: u32) -> Orbit {
    // A pair that was built by hand may be invalid: it has no motion.
    let Ok(oscillator) = pair.oscillator() else { return failed(Status::NonFinite, start, f64::NAN) };
    analyse_flow(&Flow::new(&oscillator), pair.law(), start, settings, shown_periods)
}

/// [`analyse_over`] on a flow that is at hand: maps share one among many cells.
pub fn analyse_flow(flow: &Flow, law: Law, start: State, settings: &Settings, shown_periods: u32) -> Orbit {
    let analysis = Analysis { flow, law, settings, shown_periods };
    let mut periods_run = 0;
    let run = analysis.run(start, &mut periods_run);
    Orbit { periods_run, ..run.unwrap_or_else(|stop| failed(status_of(stop), start, flow.period)) }
}

pub(crate) fn status_of(stop: Stop) -> Status {
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
}

impl Analysis<'_> {
    /// Counts in `periods_run` how long the motion is followed.
    fn run(&self, start: State, periods_run: &mut u64) -> Result<Orbit, Stop> {
        let mut trajectory = Trajectory::new(self.flow, self.law, start);
        for _ in 0..self.settings.transient_periods {
            self.advance(&mut trajectory)?;
            *periods_run += 1;
        }
        if let Some(orbit) = self.quiet(&trajectory)? {
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
            // Neither yet: a slow approach, a slow departure, or an average too short.
            if length >= last || trajectory.work().steps > EXTENSION_STEPS {
                return self.aperiodic(trajectory, &window, Class::Undecided, Status::Slow);
            }
            length = length.saturating_mul(2).min(last);
        }
    }

    /// Contact-free motion that has no event to come: its steady response, which is known, where the
    /// forcing is so fast that little of the transient is gone after a period.
    fn quiet(&self, trajectory: &Trajectory<'_, 0>) -> Result<Option<Orbit>, Stop> {
        let is_certain =
            |quiet: &&Quiet| trajectory.meshing().is_none() && quiet.is_certain(trajectory.state());
        let Some(quiet) = self.flow.quiet().filter(is_certain) else { return Ok(None) };
        let steady = Trajectory::new(self.flow, self.law, quiet.steady());
        let newton = &mut Newton::default();
        let cycle = self.maps(1).into_iter().find_map(|map| newton.refine(&steady, map));
        cycle.map(|cycle| self.periodic(&steady, &cycle, 0.0)).transpose()
    }

    /// Whether nearby motions separate for good: by more than a departure from an unstable
    /// cycle could last through, and by far more than the growth in proportion to time that
    /// neutral motion shows.
    fn is_chaotic(&self, window: &Window) -> bool {
        let surely = window.lyapunov - CHAOS_ERRORS * window.lyapunov_error;
        surely * window.strobes.len() as f64 * self.flow.period > DEPARTURE
    }

    /// One forcing period, within the cell's cap.
    fn advance<const N: usize>(&self, trajectory: &mut Trajectory<'_, N>) -> Result<(), Stop> {
        if trajectory.work().steps > STEPS_CAP {
            return Err(Stop::TooStiff);
        }
        trajectory.advance_period(&mut ())
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
            self.advance(&mut carrier)?;
            *periods_run += 1;
            exponent.renormalise(&mut carrier);
        }
        exponent.forget();
        let (mesh_start, impacts_start) = (carrier.meshing_time(), carrier.work().impacts);
        let mut strobes = vec![carrier.state()];
        for _ in 0..length {
            self.advance(&mut carrier)?;
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
            if cycle.attracts()
                && let Some(distance) = self.approach(trajectory, &cycle, &window.metric)?
            {
                return self.periodic(trajectory, &cycle, distance).map(Some);
            }
        }
        Ok(None)
    }

    /// The maps that a cycle of this period may be a fixed point of. Only cycles of odd
    /// period can be symmetric; those are found more surely by the half-period map.
    pub(super) fn maps(&self, period: u32) -> Vec<StrobeMap> {
        let whole = StrobeMap::Periods(period);
        if period % 2 == 1 && self.flow.mirror_symmetric() {
            vec![StrobeMap::MirroredHalves(period), whole]
        } else {
            vec![whole]
        }
    }

    /// The same orbit with its smallest period, and its symmetry looked at.
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
                let close = ON_CYCLE * image.derivative().norm().max(1.0);
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
        for _ in 0..APPROACH_LOOKS {
            for _ in 0..cycle.period * (cycles / f64::from(APPROACH_LOOKS)).ceil() as u32 {
                self.advance(&mut ahead)?;
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
        // A band of chaos beside a cycle comes nearer to it by chance.
        let mut strobes = vec![ahead.state()];
        for _ in 0..LINEAR_CYCLES {
            for _ in 0..cycle.period {
                self.advance(&mut ahead)?;
            }
            strobes.push(ahead.state());
        }
        // A multiplier near 1 shrinks little; half of what it promises must be seen.
        let promised = 1.0 - 0.5 * (1.0 - cycle.spectral_radius().powf(cycles));
        let is_seen = last < APPROACH.max(promised) * before
            && is_linear(cycle, |n| strobes[LINEAR_CYCLES - n], metric);
        Ok(is_seen.then_some(last))
    }

    pub(super) fn periodic(
        &self,
        seed: &Trajectory<'_>,
        cycle: &Cycle,
        distance: f64,
    ) -> Result<Orbit, Stop> {
        let mut trajectory = seed.at(cycle.state, []);
        let begun = trajectory.clone();
        let mut reading = Reading::take(self.flow, &mut trajectory, cycle.period)?;
        // The first flight has its symbol from where `seed` came from: right if the cycle comes from there, too.
        if !trajectory.stands_as(&begun) || reading.near_grazing || reading.on_strobe {
            reading = Reading::take(self.flow, &mut trajectory, cycle.period)?;
        }
        let status = if reading.near_grazing || cycle.near_grazing {
            Status::NearGrazing
        } else if reading.on_strobe {
            Status::StrobeOnEvent
        } else if distance > ON_CYCLE {
            Status::Slow
        } else {
            Status::Ok
        };
        Ok(Orbit {
            class: Class::Periodic { period: cycle.period },
            status,
            lyapunov: cycle.exponent(self.flow.period),
            lyapunov_error: None,
            floquet: Some(cycle.multipliers.clone()),
            symmetric: Some(cycle.symmetric),
            word: reading.word,
            impacts_per_period: reading.impacts_per_period,
            mesh_fraction: reading.mesh_fraction,
            strobe: cycle.state,
            strobe_meshing: reading.strobe_meshing,
            events: reading.events,
            cycle_periods: cycle.period,
            forcing_period: self.flow.period,
            periods_run: 0,
        })
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
