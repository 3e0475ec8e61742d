//! The fast engine, for pairs: an event-driven f64 integrator on the exact flow.
//!
//! A `PairMotion` is the motion of one pair. Between events it takes the longest steps that [`certificate`] can prove to be free of
//! events. A step with an event ends at the event, which is located to rounding on the exact flow.
//!
//! # Cost
//!
//! A clear step costs four 4 x 7 products: for its end, its bound and its certificate. An event adds ten, a root
//! search on one short polynomial, and the contact law. A short flight from a wall and back (`short_flight.rs`) costs
//! six in total, and its series is its certificate.

pub mod certificate;
mod chatter;
mod contact;
mod elastic;
pub mod flow;
mod localisation;
mod meter;
mod short_flight;
mod stages;
mod start;
mod step_verdict;
mod sticking;
mod tangent;

pub(crate) use flow::Schedule;
pub use flow::{DomainKind, Gap, LinearFlow, PairFlow, Phasor};
use flow::{Expansion, Step};
pub(crate) use meter::PairMeter;
use step_verdict::{Crossing, StepVerdict};

use crate::model::{Law, Side, State, state};
use crate::motion::{
    Allowance, Clock, EVENTS_PER_PERIOD_CAP, HUGE, Observer, STEPS_PER_PERIOD_CAP, Stop, Work,
};

/// A state `(x1, v1, x2, v2)`. One coordinate has zeros in the second half.
pub type PairState = [f64; 4];

/// Number of steps between checks of the tangents' size. One step changes it by a factor of less than `e^13`.
const RESCALE_STEPS: u64 = 16;

/// Number of steps after which motion in a long period is tested for escape: a large displacement makes all steps short.
const ESCAPE_STEPS: u64 = 1024;

/// The present phase of the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Free,
    /// Contact onset: meshing has begun with a leaving speed, and the gap is still in front of the wall.
    Onset(Side),
    /// Sustained contact: meshing with the gap behind the wall; also motion behind an elastic wall.
    Sustained(Side),
    /// At rest on a rigid wall and pressed against it.
    Stuck(Side),
}

impl Mode {
    #[inline]
    fn domain(self) -> DomainKind {
        match self {
            Mode::Free => DomainKind::Free,
            Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side) => DomainKind::Meshing(side),
        }
    }

    fn mirrored(self) -> Mode {
        match self {
            Mode::Free => Mode::Free,
            Mode::Onset(side) => Mode::Onset(side.mirrored()),
            Mode::Sustained(side) => Mode::Sustained(side.mirrored()),
            Mode::Stuck(side) => Mode::Stuck(side.mirrored()),
        }
    }
}

/// The motion of one pair, with `N` tangent vectors: 0, 1 for a Lyapunov exponent, or 4 for a monodromy matrix.
#[derive(Clone, Debug)]
pub(crate) struct PairMotion<'f, const N: usize = 0> {
    /// The flow of the present stage.
    flow: &'f PairFlow,
    schedule: Schedule<'f>,
    law: Law,
    mode: Mode,
    /// The wall of the last event, which determines the next symbol together with the wall of the next event.
    origin: Option<Side>,
    /// If the gap is just leaving a wall: the wall, and the order of the root of the distance at this instant.
    from_wall: Option<(Side, usize)>,
    /// Whether the flight that begins here may be a short flight.
    short_flight: bool,
    /// A contact that must be processed first: the motion starts on this wall.
    pending: Option<Side>,
    q: Gap,
    phasor: Phasor,
    clock: Clock,
    /// Time since the last phase 0 at which the present call ends.
    goal: f64,
    period: u64,
    /// Index of the next step's length: in free motion, and in contact.
    level: [usize; 2],
    tangents: [Gap; N],
    /// Logarithm of the factor that the tangents were divided by to keep them in range.
    log_scale: f64,
    events_in_period: u64,
    steps_in_period: u64,
    /// Sum of all shifts along the rigid-body mode.
    travelled: f64,
    meshing_time: f64,
    near_grazing: bool,
    work: Work,
    allowance: Allowance<'f>,
}

impl<'f, const N: usize> PairMotion<'f, N> {
    /// Multiplies each of the gap coordinates by `1 + share()`, to simulate the rounding of a less precise engine. While meshing, the first
    /// coordinate is the distance from the wall. A gap that is just leaving a wall does not change.
    pub(crate) fn perturb(&mut self, mut share: impl FnMut() -> f64) {
        let shares: [f64; 4] = std::array::from_fn(|_| share());
        let wall = match self.mode {
            Mode::Free => 0.0,
            Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side) => self.flow.wall(side),
        };
        if self.from_wall.is_none() {
            self.q[0] += shares[0] * (self.q[0] - wall);
        }
        (1..4).for_each(|i| self.q[i] += shares[i] * self.q[i]);
    }

    /// Returns the present state.
    pub(crate) fn state(&self) -> PairState {
        self.flow.to_state(self.q)
    }

    /// Returns the tangent vectors in the coordinates of the state, divided by the exponential of
    /// [`log_scale`](Self::log_scale).
    pub(crate) fn tangents(&self) -> [PairState; N] {
        self.tangents.map(|u| self.flow.to_state(u))
    }

    /// Returns the logarithm of the common factor of all tangent vectors, which keeps them in the range of f64.
    pub(crate) fn log_scale(&self) -> f64 {
        self.log_scale
    }

    /// Replaces the tangent vectors.
    pub(crate) fn set_tangents(&mut self, tangents: [PairState; N]) {
        self.log_scale = 0.0;
        self.tangents = tangents.map(|u| self.flow.tangent_to_gap(u));
    }

    /// Returns the wall of the lasting contact, if there is one.
    pub(crate) fn meshing(&self) -> Option<Side> {
        match self.mode {
            Mode::Free => None,
            Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side) => Some(side),
        }
    }

    /// Returns the present domain.
    pub(crate) fn domain(&self) -> DomainKind {
        self.mode.domain()
    }

    /// Whether the gap in free motion passed a wall less than `time` ago, or will reach one within `time`.
    pub(crate) fn passes_wall(&self, time: f64) -> bool {
        // The gap is computed from the state, as at the start of a trajectory.
        let q = self.flow.to_gap(self.state());
        let reach = time * q[1].abs();
        self.domain() == DomainKind::Free && self.flow.walls.iter().any(|wall| (q[0] - wall).abs() < reach)
    }

    /// Returns the number of completed forcing periods.
    pub(crate) fn period(&self) -> u64 {
        self.period
    }

    /// Returns the time since the last phase 0.
    pub(crate) fn time_in_period(&self) -> f64 {
        self.clock.time()
    }

    /// Returns the total time spent meshing.
    pub(crate) fn meshing_time(&self) -> f64 {
        self.meshing_time
    }

    /// Whether any event was so near to grazing that the linearisation is not reliable.
    pub(crate) fn near_grazing(&self) -> bool {
        self.near_grazing
    }

    /// Clears the flag of earlier near-grazing events.
    pub(crate) fn clear_near_grazing(&mut self) {
        self.near_grazing = false;
    }

    /// Returns the counters of work.
    pub(crate) fn work(&self) -> Work {
        self.work
    }

    /// Sets the work that the trajectory may take from here on.
    pub(crate) fn allow(&mut self, allowance: Allowance<'f>) {
        self.allowance = Allowance {
            steps: allowance.steps.saturating_add(self.work.steps),
            events: allowance.events.saturating_add(self.work.events),
            ..allowance
        };
    }

    pub(crate) fn allowance(&self) -> Allowance<'f> {
        self.allowance.after(self.work)
    }

    /// Integrates to the next phase 0.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub(crate) fn advance_period(&mut self, observer: &mut impl Observer) -> Result<(), Stop> {
        let period = self.flow.period;
        self.advance_to(period, observer)?;
        self.phasor = [1.0, 0.0];
        let first = self.schedule.restart();
        if !std::ptr::eq(self.flow, first) {
            // A contact that this change ends belongs to the period before phase 0.
            self.enter_stage(first, observer);
        }
        self.clock.set(0.0);
        if self.schedule.whole.rigid_mode.is_some() {
            // States recur, and positions lose no digits.
            self.travelled += self.q[2];
            self.q[2] = 0.0;
            self.tangents.iter_mut().for_each(|tangent| tangent[2] = 0.0);
        }
        self.period += 1;
        self.events_in_period = 0;
        self.steps_in_period = 0;
        Ok(())
    }

    /// Forgets the shifts so far.
    pub(crate) fn forget_shifts(&mut self) {
        self.travelled = 0.0;
    }

    /// Returns a state without the shifts at earlier phases 0.
    pub(crate) fn unshifted(&self, q: Gap) -> State {
        let mut y = state(&self.schedule.whole.to_state(q));
        if let Some([first, second]) = self.schedule.whole.rigid_mode {
            y[0] += first * self.travelled;
            y[2] += second * self.travelled;
        }
        y
    }

    /// Returns the sum of all shifts along the rigid-body mode since the start.
    pub(crate) fn travelled(&self) -> f64 {
        self.travelled
    }

    /// Integrates to the time `until`, which is measured from the last phase 0 and at most the forcing period.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub(crate) fn advance_to(&mut self, until: f64, observer: &mut impl Observer) -> Result<(), Stop> {
        if self.allowance.is_halted() {
            return Err(Stop::TooStiff);
        }
        loop {
            let change = self.schedule.next_change().filter(|&time| time <= until);
            let goal = change.unwrap_or(until);
            self.goal = goal;
            if let Some(side) = self.pending.take() {
                self.contact(side, observer);
                self.check_events()?;
            }
            while self.clock.time() < goal {
                self.step(goal, observer)?;
            }
            if change.is_none() {
                return self.check_finite();
            }
            let flow = self.schedule.change();
            self.enter_stage(flow, observer);
        }
    }

    fn check_finite(&self) -> Result<(), Stop> {
        let is_finite = self.q.iter().all(|x| x.abs() < HUGE);
        let stays = self.q[0].abs() + self.q[2].abs() <= self.flow.escape;
        match is_finite && stays {
            true => Ok(()),
            false if self.flow.escape.is_finite() => Err(Stop::Escape),
            false => Err(Stop::NonFinite),
        }
    }

    fn check_events(&self) -> Result<(), Stop> {
        let is_over =
            self.events_in_period > EVENTS_PER_PERIOD_CAP || self.work.events > self.allowance.events;
        if is_over { Err(Stop::CapEvents) } else { Ok(()) }
    }

    /// Fails if the bound on a step overflows, as it does for extreme rates.
    fn check_bounds(&self, linear: &LinearFlow) -> Result<(), Stop> {
        let bound = match self.mode {
            Mode::Free | Mode::Sustained(_) => &linear.gap_bound,
            Mode::Onset(_) | Mode::Stuck(_) => &linear.pressing_bound,
        };
        let finite = bound.remainder(&self.q, &self.phasor, 1.0).is_finite();
        if finite { Ok(()) } else { Err(Stop::NonFinite) }
    }

    /// Takes one step: a clear step, or up to an event, or up to `until`.
    #[inline(always)]
    fn step(&mut self, until: f64, observer: &mut impl Observer) -> Result<(), Stop> {
        let flow = self.flow;
        let linear = flow.domain(self.mode.domain());
        if std::mem::take(&mut self.short_flight) && self.fly_back(linear, until, observer)? {
            return Ok(());
        }
        let slot = usize::from(self.mode.domain() != DomainKind::Free);
        let mut level = self.level[slot];
        loop {
            self.work.steps += 1;
            self.steps_in_period += 1;
            if self.steps_in_period > STEPS_PER_PERIOD_CAP || self.work.steps > self.allowance.steps {
                return Err(self.too_many_steps());
            }
            if self.steps_in_period.is_multiple_of(ESCAPE_STEPS) {
                self.check_finite()?;
            }
            let computed;
            let step = match linear.step(level) {
                Some(step) => step,
                None => {
                    computed = linear.new_step(level);
                    &computed
                }
            };
            match self.step_verdict(linear, step) {
                StepVerdict::Clear { roomy } => {
                    self.level[slot] = level;
                    if roomy && level > 0 {
                        self.lengthen(slot);
                    }
                    self.clear_step(linear, step, until);
                    return Ok(());
                }
                StepVerdict::OnWall | StepVerdict::Unclear if matches!(self.mode, Mode::Stuck(_)) => {
                    return self.step_at_rest(until, observer);
                }
                StepVerdict::OnWall => {
                    self.note_grazing();
                    self.clear_step(linear, step, until);
                    return Ok(());
                }
                StepVerdict::Crossing(crossing, bracket) => {
                    self.level[slot] = level;
                    return self.cross(linear, step.u, crossing, bracket, until, observer);
                }
                StepVerdict::Unclear if self.settle_start(observer) => return self.check_events(),
                StepVerdict::Unclear if level + 1 == linear.levels => {
                    // A step with NaN is never clear.
                    self.check_finite()?;
                    self.check_bounds(linear)?;
                    self.settle_graze(linear, step.h, until, observer);
                    return self.check_events();
                }
                StepVerdict::Unclear => {
                    self.work.halvings += 1;
                    level += 1;
                }
            }
        }
    }

    #[cold]
    #[inline(never)]
    fn too_many_steps(&self) -> Stop {
        if self.work.steps > self.allowance.steps { Stop::TooStiff } else { Stop::CapRoot }
    }

    /// Doubles the next step. Out of line, so that the next step does not wait for this one's certificate.
    #[cold]
    #[inline(never)]
    fn lengthen(&mut self, slot: usize) {
        self.level[slot] -= 1;
    }

    /// Takes a clear step, up to `until` at most.
    #[inline(always)]
    fn clear_step(&mut self, linear: &LinearFlow, step: &Step, until: f64) {
        let remaining = self.clock.remaining(until);
        self.depart();
        if step.h < remaining {
            (self.q, self.phasor) = step.end(&self.q, &self.phasor);
            self.clock.advance(step.h);
            if N > 0 {
                self.tangents = self.tangents.map(|u| step.propagator.carry_tangent(&u));
                if self.steps_in_period.is_multiple_of(RESCALE_STEPS) {
                    self.rescale_tangents();
                }
            }
            self.count_meshing(step.h);
        } else {
            self.move_to(linear, remaining, until);
        }
    }

    /// Records that the last event is no longer at the present instant.
    #[inline(always)]
    fn depart(&mut self) {
        self.from_wall = None;
    }

    /// Advances the motion to `until`, a time `s` away, within a clear step.
    #[inline(always)]
    fn move_to(&mut self, linear: &LinearFlow, s: f64, until: f64) {
        self.move_within(linear, s);
        self.depart();
        self.clock.set(until);
    }

    /// Advances the motion by a time `s` of at most the longest step.
    #[inline(always)]
    fn move_within(&mut self, linear: &LinearFlow, s: f64) {
        let u = s * linear.per_unit;
        let expansion = linear.grid.expansion(&self.q, &self.phasor, u);
        self.move_along(linear, &expansion, u);
        self.count_meshing(s);
    }

    /// Advances the motion by `u` Taylor steps, near the grid point of the expansion.
    #[inline(always)]
    fn move_along(&mut self, linear: &LinearFlow, expansion: &Expansion, u: f64) {
        let v = u - expansion.start;
        self.q = expansion.state(v);
        self.phasor = expansion.phasor(linear.turn * v);
        if N > 0 {
            self.tangents = linear.grid.carry(u, self.tangents);
        }
    }

    #[inline(always)]
    fn count_meshing(&mut self, s: f64) {
        if self.mode.domain() != DomainKind::Free {
            self.meshing_time += s;
        }
    }
}
