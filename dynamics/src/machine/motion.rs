//! The motion of a machine from event to event.
//!
//! Observers are trait objects, so that the program has one copy of this code.

mod act;
mod record;
mod series;
mod settle;
mod start;
mod tangents;

pub use act::TIE;
pub(super) use series::SeriesModes;
pub(crate) use start::CarriedModes;

use super::domain::{Carrier, LinearDomain, Path, STAYS_ZERO};
use super::domains::System;
use super::flight::Flight;
use super::modes::{MOST_CURVES, Modes};
use super::passages::{End, Impulse, Passage};
use super::polynomial::{LEAST_REGISTERS, REACHES, registers_for};
use super::slow::decaying_step;
use super::watch::{First, Moment, Roots, Watch, Watches};
use super::{Numbers, PhasePoint, ROUNDING};
use crate::model::{MOST_COORDINATES, MOST_FRICTION, MOST_GAPS, ON_WALL, Side};
use crate::motion::{
    Allowance, Clock, EVENTS_PER_PERIOD_CAP, HUGE, Observer, Remark, STEPS_PER_PERIOD_CAP, Slip, Slips, Stop,
    Work,
};

/// The motion of a machine, with any number of tangent vectors.
#[derive(Clone, Debug)]
pub struct MachineMotion<'s> {
    system: &'s System,
    pub(super) modes: Modes,
    /// Modes of the latest domain that was entered, and this domain.
    entered: Modes,
    domain: &'s LinearDomain,
    /// Memory that is used again in each step.
    memory: Option<Box<Memory>>,
    carrier: Carrier,
    /// Which of the steps of different lengths is tried next.
    stride: usize,
    /// State, harmonics and 1 at the present time.
    pub(super) point: PhasePoint,
    clock: Clock,
    goal: f64,
    period: u64,
    /// Index of the next change of the stage.
    change: usize,
    pub(super) roots: Roots,
    /// The side of each gap's last event.
    pub(super) origin: [Option<Side>; MOST_GAPS],
    has_slid: [bool; MOST_FRICTION],
    tangents: Vec<Numbers>,
    log_scale: f64,
    /// State before the event.
    before: Numbers,
    /// For each impact of the event, minus the derivatives of the jumps of all rates with respect to the gap's rate.
    jumps: Vec<(Impulse, Numbers)>,
    /// What the motion has passed, if it is recorded.
    passages: Option<Vec<Passage>>,
    events_in_period: u64,
    steps_in_period: u64,
    contact_time: f64,
    sticking_time: f64,
    /// Sums of all shifts along rigid-body modes.
    travelled: [f64; MOST_COORDINATES],
    near_grazing: bool,
    remark: Option<Remark>,
    work: Work,
    allowance: Allowance<'s>,
}

/// The step, and the watches since the last event. A box moves as one pointer.
#[derive(Clone, Debug, Default)]
struct Memory {
    path: Path,
    watches: Watches,
}

impl<'s> MachineMotion<'s> {
    /// Returns the present state `(x1, v1, x2, v2, ...)`.
    pub fn state(&self) -> Numbers {
        self.system.to_state(&self.point)
    }

    /// Returns the time derivative of the state.
    pub(crate) fn velocity(&self) -> Numbers {
        self.system.to_state(&self.system.domain(&self.modes).derivative(&self.point))
    }

    /// Returns the machine.
    pub fn system(&self) -> &'s System {
        self.system
    }

    /// Returns the number of completed forcing periods.
    pub fn period(&self) -> u64 {
        self.period
    }

    /// Returns the time since the last phase 0.
    pub fn time_in_period(&self) -> f64 {
        self.clock.time()
    }

    /// Returns the time during which at least one gap was in lasting contact.
    pub fn contact_time(&self) -> f64 {
        self.contact_time
    }

    /// Returns the time during which an element with dry friction stuck.
    pub fn sticking_time(&self) -> f64 {
        self.sticking_time
    }

    /// Forgets the shifts so far.
    pub(crate) fn forget_shifts(&mut self) {
        self.travelled = [0.0; MOST_COORDINATES];
    }

    /// Returns the state of a point without the shifts at earlier phases 0.
    fn unshifted(&self, point: &[f64]) -> Numbers {
        self.system.rigid_modes.shifted(self.system.to_state(point), &self.travelled)
    }

    /// Returns the sums of all shifts along rigid-body modes since the start.
    pub(crate) fn travelled(&self) -> [f64; MOST_COORDINATES] {
        self.travelled
    }

    /// Returns the side of a gap's lasting contact, if there is one.
    pub fn contact(&self, gap: usize) -> Option<Side> {
        self.system.contact(&self.modes, gap)
    }

    /// Whether no gap is in lasting contact.
    pub(crate) fn is_free(&self) -> bool {
        (0..self.system.gaps()).all(|gap| self.contact(gap).is_none())
    }

    /// Returns the modes of dry friction.
    pub fn slips(&self) -> Slips {
        self.modes.slips
    }

    /// Returns the number of elements with dry friction that have not slid since the start.
    pub fn never_slid(&self) -> usize {
        self.system.elements.iter().zip(self.has_slid).filter(|(_, has_slid)| !has_slid).count()
    }

    /// Whether an event was so near to grazing that the tangents are not reliable.
    pub fn near_grazing(&self) -> bool {
        self.near_grazing
    }

    /// Clears the flag of earlier events near to grazing.
    pub fn clear_near_grazing(&mut self) {
        self.near_grazing = false;
    }

    /// Returns what makes the motion since the start doubtful.
    pub(crate) fn remark(&self) -> Option<Remark> {
        self.remark
    }

    /// Returns the counters of work.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Sets the work that the motion may take from here on.
    pub fn allow(&mut self, allowance: Allowance<'s>) {
        self.allowance = Allowance {
            steps: allowance.steps.saturating_add(self.work.steps),
            events: allowance.events.saturating_add(self.work.events),
            ..allowance
        };
    }

    pub(crate) fn allowance(&self) -> Allowance<'s> {
        self.allowance.after(self.work)
    }

    /// Whether another motion has the same modes. Contact onset and pressed contact count as equal for a gap on its wall.
    pub(crate) fn is_in_modes_of(&self, other: &MachineMotion<'_>) -> bool {
        let is_on_wall = |gap: usize, side: Side| {
            let wall = self.system.last_wall(gap, side).at;
            (self.point[gap] - wall).abs() <= ON_WALL * wall.abs().max(self.system.length)
        };
        self.modes.slips == other.modes.slips
            && (0..self.system.gaps()).all(|gap| {
                self.modes.gaps[gap] == other.modes.gaps[gap]
                    || self.contact(gap) == other.contact(gap)
                        && self.contact(gap).is_some_and(|side| is_on_wall(gap, side))
            })
    }

    /// Whether a gap in free motion passed a wall less than `time` ago, or will reach one within `time`.
    pub(crate) fn passes_wall(&self, time: f64) -> bool {
        (0..self.system.gaps()).any(|gap| {
            let mut ahead =
                Side::BOTH.into_iter().filter_map(|side| self.system.wall_ahead(&self.modes, gap, side));
            ahead.any(|(side, number)| {
                (self.point[gap] - self.system.walls(gap, side)[number].at).abs()
                    < time * self.rate(gap).abs()
            })
        })
    }

    /// Whether two motions agree in their modes, in the walls that gaps lie on, and in the walls that gaps come from.
    pub(crate) fn is_where(&self, other: &MachineMotion<'_>) -> bool {
        self.modes == other.modes && self.origin == other.origin && self.roots.at_wall == other.roots.at_wall
    }

    /// Multiplies each entry of the state by `1 + share()`, to simulate rounding.
    pub(crate) fn perturb(&mut self, mut share: impl FnMut() -> f64) {
        self.point[..2 * self.system.n].iter_mut().for_each(|y| *y += share() * *y);
        self.system.hold(&self.modes, &mut self.point, false);
    }

    /// Integrates to the next phase 0.
    ///
    /// # Errors
    /// A [`Stop`] if the motion cannot be continued.
    pub fn advance_period(&mut self, observer: &mut dyn Observer) -> Result<(), Stop> {
        self.advance_to(self.system.period, observer)?;
        self.set_clock(0.0);
        self.change = 0;
        if self.system.schedule.first().is_some_and(|change| change.0 == 0.0) {
            self.set_clock(self.system.period);
            self.pass(End::Stage(0));
            self.enter_stage(self.system.schedule[0].1, observer);
            self.set_clock(0.0);
            self.change = 1;
        }
        self.pass(End::Period);
        self.shift_back(observer);
        if !self.system.ties.is_empty() {
            self.system.hold(&self.modes, &mut self.point, false);
            self.hold_tangents();
            self.forget_watches();
        }
        self.period += 1;
        (self.events_in_period, self.steps_in_period) = (0, 0);
        Ok(())
    }

    /// Shifts the motion back along rigid-body modes, so that its states recur, and positions lose no digits.
    fn shift_back(&mut self, observer: &mut dyn Observer) {
        let (system, n) = (self.system, self.system.n);
        for (nth, shift) in system.shifts.iter().enumerate() {
            let back = |y: &mut [f64]| {
                let by: f64 = shift.measure[..n].iter().zip(&*y).map(|(factor, y)| factor * y).sum();
                y.iter_mut().zip(&shift.direction[..n]).for_each(|(y, direction)| *y -= by * direction);
                by
            };
            let by = back(&mut self.point);
            self.tangents.iter_mut().for_each(|tangent| {
                back(tangent);
            });
            self.travelled[nth] += by;
            if let Some(sums) = observer.sums() {
                sums.drifts[nth].ahead += by - sums.drifts[nth].rate * system.period;
            }
        }
    }

    /// Integrates to a time since the last phase 0 of at most the forcing period.
    ///
    /// # Errors
    /// A [`Stop`] if the motion cannot be continued.
    pub fn advance_to(&mut self, until: f64, observer: &mut dyn Observer) -> Result<(), Stop> {
        if self.allowance.is_halted() {
            return Err(Stop::TooStiff);
        }
        loop {
            let change = self.system.schedule.get(self.change).filter(|change| change.0 <= until);
            self.goal = change.map_or(until, |change| change.0);
            while self.clock.time() < self.goal {
                self.step(observer)?;
            }
            let Some(&(_, stage)) = change else { return self.check_finite() };
            self.pass(End::Stage(self.change));
            self.change += 1;
            self.enter_stage(stage, observer);
        }
    }

    fn check_finite(&self) -> Result<(), Stop> {
        let n = self.system.n;
        if !self.point[..2 * n].iter().all(|x| x.abs() < HUGE) {
            return Err(Stop::NonFinite);
        }
        let extent: f64 = self.point[..n].iter().map(|x| x.abs()).sum();
        if extent <= self.system.escape { Ok(()) } else { Err(Stop::Escape) }
    }

    fn check_events(&self) -> Result<(), Stop> {
        let is_over =
            self.events_in_period > EVENTS_PER_PERIOD_CAP || self.work.events > self.allowance.events;
        if is_over { Err(Stop::CapEvents) } else { Ok(()) }
    }

    fn set_clock(&mut self, time: f64) {
        self.clock.set(time);
        self.system.set_phasors(&mut self.point, time);
    }

    fn moment(&self) -> Moment<'_> {
        Moment {
            frame: self.system,
            domain: self.domain,
            modes: &self.modes,
            roots: &self.roots,
            point: &self.point,
        }
    }

    /// Enters the domain of the present modes, and returns it.
    fn refresh(&mut self) -> &'s LinearDomain {
        if !self.modes.are(&self.entered, self.system.gaps()) {
            (self.entered, self.domain) = (self.modes, self.system.domain(&self.modes));
        }
        self.domain
    }

    /// Lists watches again at the next step.
    fn forget_watches(&mut self) {
        if let Some(memory) = &mut self.memory {
            memory.watches.forget();
        }
    }

    fn note_before(&mut self) {
        let size = 2 * self.system.n;
        self.before[..size].copy_from_slice(&self.point[..size]);
    }

    fn rate(&self, gap: usize) -> f64 {
        self.point[self.system.n + gap]
    }

    /// Returns the equations for the next step. While fast overdamped modes decay, also returns how long the step may be.
    fn pace(&mut self) -> (&'s LinearDomain, Option<f64>) {
        let domain = self.refresh();
        let Some(slow) = &domain.slow else { return (domain, None) };
        let tangents = self.tangents.iter().map(|tangent| slow.excitation(tangent));
        let excitation = tangents.fold(slow.excitation(&self.point), f64::max);
        if excitation > ROUNDING {
            return (domain, Some(decaying_step(excitation) * domain.unit));
        }
        slow.settle(&mut self.point);
        self.tangents.iter_mut().for_each(|tangent| slow.settle(tangent));
        (slow, None)
    }

    /// Takes one step, which ends at the first event, at the longest step or at the goal.
    fn step(&mut self, observer: &mut dyn Observer) -> Result<(), Stop> {
        self.work.steps += 1;
        self.steps_in_period += 1;
        if self.work.steps > self.allowance.steps || self.steps_in_period > STEPS_PER_PERIOD_CAP {
            return Err(Stop::TooStiff);
        }
        let (system, remaining) = (self.system, self.clock.remaining(self.goal));
        let (domain, decaying) = self.pace();
        let mut memory = self.memory.take().unwrap_or_default();
        let Memory { path, watches } = &mut *memory;
        self.moment().list(watches);
        if !watches.are_distances() {
            self.stride = REACHES.len() - 1;
        }
        let h = decaying.unwrap_or(domain.duration(self.stride)).min(remaining);
        domain.begin(&self.point, h, path);
        let First { share, number, touches } = Moment { domain, ..self.moment() }.first_event(watches, path);
        self.near_grazing |= touches;
        let time = share * h;
        if share > 0.0 {
            if let Some(sums) = observer.sums() {
                domain.expand(path, system.n, share);
                let (modes, path, start) = (&self.modes, &*path, self.clock.time());
                Flight { system, domain, modes, path, share, duration: time, start }.add_to(sums);
            }
            self.advance(domain, path, share, time);
        }
        let event = number.map(|number| watches.watch(number));
        if event.is_some() {
            watches.forget();
        }
        self.memory = Some(memory);
        self.stride = match event {
            Some(_) => registers_for(2.0 * time / domain.unit) - LEAST_REGISTERS,
            None => (self.stride + 1).min(REACHES.len() - 1),
        };
        if let Some(watch) = event {
            self.pass(End::Event(watch, Vec::new()));
            self.cross(watch, observer);
            self.end_passage();
            return self.check_events();
        }
        if h == remaining {
            self.set_clock(self.goal);
        }
        // The state is checked at every 1024th step.
        if self.steps_in_period.is_multiple_of(1024) { self.check_finite() } else { Ok(()) }
    }

    /// Advances state, tangents and clock to a share of a step.
    fn advance(&mut self, domain: &LinearDomain, path: &mut Path, share: f64, time: f64) {
        let (system, n) = (self.system, self.system.n);
        let mut before = [0.0; MOST_GAPS];
        before[..system.gaps()].copy_from_slice(&self.point[..system.gaps()]);
        if let Some(whole) = domain.whole(self.stride, time) {
            let end = whole.carry(&self.point, 2 * n);
            self.point[..2 * n].copy_from_slice(&end[..2 * n]);
        } else {
            domain.expand(path, n, share);
            domain.set_state(&mut self.point, path, share);
        }
        self.carry_tangents(domain, time);
        self.clock.advance(time);
        system.set_phasors(&mut self.point, self.clock.time());
        if !self.is_free() {
            self.contact_time += time;
        }
        if system.elements.iter().zip(self.modes.slips).any(|(_, slip)| slip == Slip::Stick) {
            self.sticking_time += time;
        }
        for (gap, before) in before.into_iter().enumerate().take(system.gaps()) {
            match self.roots.at_wall[gap] {
                // The gap stays on the wall until another element changes its modes.
                Some((_, STAYS_ZERO)) => (self.point[gap], self.point[n + gap]) = (before, 0.0),
                _ if self.moment().is_kept(gap) => {}
                _ => self.roots.at_wall[gap] = None,
            }
        }
        (self.roots.from_force, self.roots.from_rate) = ([0; MOST_GAPS], [0; MOST_FRICTION]);
        self.roots.at_border = [None; MOST_CURVES];
    }

    /// Processes the root of a watch at the present state, and lets the tangents jump.
    fn cross(&mut self, watch: Watch, observer: &mut dyn Observer) {
        self.jumps.clear();
        if let Watch::Border(i, is_upper) = watch {
            self.pass_border(i, is_upper);
            return;
        }
        let moment = self.moment();
        let (row, distance) =
            ((!self.tangents.is_empty()).then(|| moment.function(watch)), moment.distance(watch));
        if let Some((gap, at, _)) = distance {
            self.point[gap] = at;
        }
        if !self.system.ties.is_empty() {
            self.system.hold(&self.modes, &mut self.point, false);
        }
        self.note_before();
        let linearised = row.map(|row| (row, self.domain.derivative(&self.point)));
        let energy = |motion: &Self| motion.system.energy(&motion.modes, &motion.point);
        let before = observer.sums().is_some().then(|| energy(self));
        self.act(watch, observer);
        if let (Some(before), Some(sums)) = (before, observer.sums()) {
            let after = energy(self);
            if let Watch::ForceEnds(..) | Watch::ForceBegins(..) = watch {
                sums.released.add(before, after);
            } else {
                sums.lost.add(before, after);
                if let Some(gap) = watch.gap() {
                    sums.gaps[gap].lost.add(before, after);
                }
            }
        }
        if let Some((row, field)) = linearised {
            self.saltate(watch, &row, &field);
        }
        if let (Watch::Wall(gap, side), [(hit, _)]) = (watch, &self.jumps[..])
            && gap == hit.gap
            && self.modes.gaps[gap] == self.system.before_last(gap, side)
        {
            self.close_series(gap, side, observer);
        }
    }
}
