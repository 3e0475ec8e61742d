//! Dry friction: elements slide, stick and break away.
//!
//! # Tangents
//!
//! Sliding ends at a root of the sliding rate `R = n . q - speed`. There the field jumps, and `S = I + (f+ - f-) n^T / (n . f-)`. If the
//! element sticks afterwards, `n . S u = 0`: neighbouring motions stick, too. Sticking ends where the force that holds the element
//! reaches its limit; the field is continuous there, and tangents do not jump.

use super::step_verdict::{Crossing, StepVerdict, first_of};
use super::sticking::RELEASE_ORDER;
use super::{EventKind, FrictionEvent, Mode, Observer, Trajectory};
use crate::certificate::{Verdict, judge};
use crate::flow::{DomainKind, Element, Flow, Gap, LinearFlow, Phasor, Slip, Slips, Step, Watch};
use crate::model::{Contact, MOST_FRICTION, Side, State};

/// Height of a flight, relative to the scale of length, that is not followed in a series of impacts.
const LOWEST_FLIGHT: f64 = 1e-13;

impl<'f, const N: usize> Trajectory<'f, N> {
    fn elements(&self) -> &'f [Element] {
        self.stage.interval(self.interval).friction()
    }

    /// Returns the functions that end the present modes.
    fn watches(&self) -> &'f [Option<Watch>] {
        self.flow.watches(self.mode.domain())
    }

    /// Returns the function whose root ends the mode of an element, positive before, and its first two derivatives: the sliding speed, or
    /// the distance of the holding force from its limit for sliding in the direction `next`.
    pub(super) fn friction_rates(&self, i: usize, next: Option<Slip>, q: &Gap, phasor: &Phasor) -> [f64; 3] {
        let Some(watch) = &self.watches()[i] else { return [f64::INFINITY, 0.0, 0.0] };
        let rates = watch.rates(q, phasor);
        let Some(next) = next else { return rates.map(|rate| self.slips[i].sign() * rate) };
        let [force, rate, bend] = rates.map(|rate| -next.sign() * rate);
        [self.elements()[i].force + force, rate, bend]
    }

    /// Checks everything that could end the flight within one step.
    #[cold]
    #[inline(never)]
    pub(super) fn verdict_with_friction(&self, linear: &LinearFlow, step: &Step) -> StepVerdict {
        match self.mode {
            // `step_at_rest` decides.
            Mode::Stuck(_) => StepVerdict::Unclear,
            _ if self.flow.holds_gap => self.earlier_of_friction(StepVerdict::Clear { roomy: true }, step),
            _ => self.earlier_of_friction(self.at_walls(linear, step), step),
        }
    }

    /// Compares a verdict on walls with the ends of all friction modes.
    pub(super) fn earlier_of_friction(&self, at_walls: StepVerdict, step: &Step) -> StepVerdict {
        if !self.flow.has_friction() {
            return at_walls;
        }
        let (is_on_wall, at_walls) = match at_walls {
            StepVerdict::OnWall => (true, StepVerdict::Clear { roomy: false }),
            verdict => (false, verdict),
        };
        let watched = self.watches().iter().enumerate().zip(self.elements());
        let first = watched.fold(at_walls, |first, ((i, watch), element)| {
            let Some(watch) = watch else { return first };
            let (function, remainder) = watch.ahead(step, &self.q, &self.phasor);
            let verdict = |level: f64, sign: f64, order: usize, crossing: Crossing| match judge(
                &function, level, sign, order, remainder,
            ) {
                Verdict::Clear { roomy } => StepVerdict::Clear { roomy },
                Verdict::Crossing(bracket) => StepVerdict::Crossing(crossing, bracket),
                Verdict::Unclear => StepVerdict::Unclear,
            };
            let of_element = match self.slips[i] {
                Slip::Stick => {
                    let [force, rate, _] = watch.rates(&self.q, &self.phasor);
                    let limit = |next: Slip| {
                        let (level, sign) = (next.sign() * element.force, -next.sign());
                        // A force that has just touched its limit is leaving it.
                        let touches = (force - level).abs() <= watch.rounding(&self.q) && sign * rate > 0.0;
                        verdict(level, sign, usize::from(touches), Crossing::Slips(i, next))
                    };
                    first_of(limit(Slip::Forward), limit(Slip::Backward))
                }
                slip => verdict(0.0, slip.sign(), self.from_rate[i], Crossing::RateVanishes(i)),
            };
            first_of(first, of_element)
        });
        match first {
            StepVerdict::Clear { .. } if is_on_wall => StepVerdict::OnWall,
            _ if is_on_wall => StepVerdict::Unclear,
            first => first,
        }
    }

    /// Enters a combination of modes.
    fn enter_modes(&mut self, slips: Slips) {
        self.slips = slips;
        self.flow = self.stage.interval(self.interval).in_modes(slips);
        self.short_flight = false;
        let levels = |kind: DomainKind| self.flow.domain(kind).levels - 1;
        let in_contact = if self.mode == Mode::Free { self.level[1] } else { levels(self.mode.domain()) };
        self.level = [self.level[0].min(levels(DomainKind::Free)), self.level[1].min(in_contact)];
        for (has_slid, slip) in self.has_slid.iter_mut().zip(slips) {
            *has_slid |= slip != Slip::Stick;
        }
    }

    /// Enters the first consistent combination of modes in a domain at a point: each element that sticks, or has come to rest, sticks or
    /// begins to slide, and the others keep their modes.
    fn enter_from_rest(&mut self, stops: [bool; MOST_FRICTION], slips: Slips, kind: DomainKind, q: &Gap) {
        let whole = self.stage.interval(self.interval);
        let mut at_rest = stops;
        for (at_rest, slip) in at_rest.iter_mut().zip(slips).take(whole.friction().len()) {
            *at_rest |= slip == Slip::Stick;
        }
        let options = |i: usize| if at_rest[i] { &Slip::ALL[..] } else { std::slice::from_ref(&slips[i]) };
        let all = options(0).iter().flat_map(|&a| options(1).iter().map(move |&b| [a, b]));
        let is_consistent = |slips: &Slips| {
            let flow = whole.in_modes(*slips);
            let mut places = flow.watches(kind).iter().zip(whole.friction()).zip(*slips).zip(at_rest);
            places.all(|(((watch, element), slip), at_rest)| {
                let Some(watch) = watch else { return !at_rest || slip == Slip::Stick };
                let [value, rates @ ..] = watch.rates(q, &self.phasor);
                match slip {
                    _ if !at_rest => true,
                    Slip::Stick => value.abs() <= element.force + watch.rounding(q),
                    _ => rates
                        .into_iter()
                        .find(|&rate| rate != 0.0)
                        .is_some_and(|rate| slip.sign() * rate > 0.0),
                }
            })
        };
        let chosen = all.clone().find(is_consistent);
        self.near_grazing |= chosen.is_none();
        self.enter_modes(chosen.unwrap_or(slips));
        for (i, watch) in self.flow.watches(kind).iter().enumerate() {
            if let (true, Some(watch)) = (at_rest[i] && self.slips[i] != Slip::Stick, watch) {
                self.from_rate[i] = if watch.rates(q, &self.phasor)[1] == 0.0 { 2 } else { 1 };
            }
        }
    }

    /// Chooses the modes after a jump of the velocities to a point of a domain. Without a rate, an element may stick.
    pub(super) fn slide_after_jump(&mut self, kind: DomainKind, after: &Gap) {
        let (mut slips, mut at_rest) = (self.slips, [false; MOST_FRICTION]);
        for (i, element) in self.elements().iter().enumerate().filter(|(_, element)| element.feels_contacts) {
            let rate = element.rate(after);
            at_rest[i] = rate == 0.0;
            slips[i] = if rate == 0.0 { Slip::Stick } else { Slip::of(rate) };
        }
        self.enter_from_rest(at_rest, slips, kind, after);
    }

    /// Chooses the modes at the start.
    pub(super) fn start_friction(&mut self) {
        if self.flow.has_friction() {
            let rates = self.elements().iter().map(|element| element.rate(&self.q));
            let mut at_rest = [false; MOST_FRICTION];
            rates.enumerate().for_each(|(i, rate)| at_rest[i] = rate == 0.0);
            self.has_slid = [false; MOST_FRICTION];
            self.enter_from_rest(at_rest, self.slips, self.mode.domain(), &self.q.clone());
        }
    }

    /// Returns the modes that the sliding rates of a state determine, with sticking at rate 0.
    pub(super) fn modes_of(flow: &Flow, y: State) -> Slips {
        let mut slips = Slips::default();
        for (slip, element) in slips.iter_mut().zip(flow.friction()) {
            let rate = element.rate(&flow.to_gap(y));
            *slip = if rate == 0.0 { Slip::Stick } else { Slip::of(rate) };
        }
        slips
    }

    /// Takes the modes of another motion. States and tangents are projected to rest of the sticking elements.
    pub(super) fn take_modes(&mut self, slips: Slips) {
        if !self.flow.has_friction() {
            return;
        }
        self.enter_modes(slips);
        self.has_slid = slips.map(|slip| slip != Slip::Stick);
        self.from_rate = [0; MOST_FRICTION];
        self.hold_rates();
        self.hold_tangents();
    }

    /// Projects the tangents to rest of the sticking elements.
    fn hold_tangents(&mut self) {
        let keeps_w = matches!(self.mode, Mode::Stuck(_));
        for (element, _) in self.sticking() {
            self.tangents.iter_mut().for_each(|u| element.project(u, keeps_w));
        }
    }

    fn sticking(&self) -> impl Iterator<Item = (&'f Element, Slip)> + use<'f, N> {
        self.elements().iter().zip(self.slips).filter(|&(_, slip)| slip == Slip::Stick)
    }

    /// Removes rounding errors from the rates of sticking elements.
    pub(super) fn hold_rates(&mut self) {
        let keeps_w = matches!(self.mode, Mode::Stuck(_));
        for (element, _) in self.sticking() {
            element.put_at_rest(&mut self.q, keeps_w);
        }
    }

    /// Processes a sliding rate that vanishes.
    #[cold]
    #[inline(never)]
    pub(super) fn end_sliding(&mut self, i: usize, observer: &mut impl Observer) {
        let (kind, slips) = (self.mode.domain(), self.slips);
        let field = self.present_field();
        let rate = self.friction_rates(i, None, &self.q, &self.phasor)[1] * slips[i].sign();
        let stops = std::array::from_fn(|j| j == i);
        self.enter_from_rest(stops, slips, kind, &self.q.clone());
        let let_go = match self.mode {
            Mode::Stuck(side) if !self.presses(kind, side, &self.q) => Some(side),
            _ => None,
        };
        if let_go.is_some() {
            self.enter_from_rest(stops, slips, DomainKind::Free, &self.q.clone());
        }
        if self.slips[i] == slips[i] {
            // The rate only touches 0, or begins on the wrong side of it.
            let keeps_w = matches!(self.mode, Mode::Stuck(_));
            self.elements()[i].put_at_rest(&mut self.q, keeps_w);
            self.near_grazing = true;
            self.work.events += 1;
            self.events_in_period += 1;
            return;
        }
        self.hold_rates();
        self.record_changes(slips, Some(i), observer);
        if let Some(side) = let_go {
            self.record(EventKind::MeshEnd, side, self.q, observer);
            self.leave(side);
        }
        self.recheck_contact(None, observer);
        if N > 0 {
            let [a, b] = self.elements()[i].row;
            let next = self.present_field();
            self.saltate(|u| *u, &[0.0, a, 0.0, b], rate, &field, &next);
            self.hold_tangents();
        }
    }

    fn present_field(&self) -> Gap {
        self.flow.domain(self.mode.domain()).field(&self.q, &self.phasor)
    }

    /// Processes an element that breaks away in a direction.
    #[cold]
    #[inline(never)]
    pub(super) fn begin_sliding(&mut self, i: usize, next: Slip, observer: &mut impl Observer) {
        let (kind, field) = (self.mode.domain(), self.present_field());
        let force =
            self.watches()[i].as_ref().map(|watch| (watch.gradient(), watch.rates(&self.q, &self.phasor)[1]));
        let mut slips = self.slips;
        slips[i] = next;
        let sliding = self.stage.interval(self.interval).in_modes(slips);
        let lets_go = self.flow.holds_gap && !sliding.holds_gap;
        // The gap's acceleration is 0, its derivative is not.
        let jerk = sliding.domain(self.mode.domain()).acceleration_rates(&self.q, &self.phasor)[1];
        if let (true, Some((side, _)), Mode::Free) = (lets_go, self.from_wall, self.mode)
            && side.sign() * jerk > 0.0
            && self.flow.contacts[side.index()] == Contact::Rigid
        {
            // The wall holds the gap from here on.
            self.record(EventKind::MeshStart, side, self.q, observer);
            self.rest_on(side);
            return;
        }
        self.enter_modes(slips);
        self.from_rate[i] = 2;
        self.record_friction(Some(b'7'), observer);
        if let (true, Some((side, _))) = (lets_go, self.from_wall) {
            match self.mode {
                Mode::Free if side.sign() * jerk > 0.0 => {
                    self.record(EventKind::MeshStart, side, self.q, observer);
                    self.start_meshing(side, 0.0);
                }
                Mode::Sustained(_) if side.sign() * jerk < 0.0 => {
                    self.record(EventKind::MeshEnd, side, self.q, observer);
                    self.mode = Mode::Free;
                }
                _ => {}
            }
            self.from_wall = Some((side, RELEASE_ORDER));
        }
        self.recheck_contact(lets_go.then_some(jerk), observer);
        // The field is continuous, except where a contact onset ends at once.
        if let (true, Some((gradient, rate))) = (N > 0 && self.mode.domain() != kind, force) {
            let next = self.present_field();
            self.saltate(|u| *u, &gradient, rate, &field, &next);
        }
    }

    /// Whether friction has just let go of the gap in a contact onset, so that its acceleration is 0 within rounding.
    #[inline(always)]
    pub(super) fn begins_unpressed(&self) -> bool {
        self.from_rate.contains(&2) && matches!(self.mode, Mode::Onset(_))
    }

    /// Decides contacts that depend on forces anew, after a jump of a friction force. If friction has let go of the gap, its acceleration is 0
    /// within rounding, and `jerk` decides.
    fn recheck_contact(&mut self, jerk: Option<f64>, observer: &mut impl Observer) {
        match self.mode {
            Mode::Stuck(side) if !self.presses(DomainKind::Meshing(side), side, &self.q) => {
                self.record(EventKind::MeshEnd, side, self.q, observer);
                self.leave(side);
                self.recheck_sticking(None, observer);
            }
            Mode::Onset(side) if !self.flow.holds_gap => {
                let meshing = self.flow.domain(DomainKind::Meshing(side));
                let pressing = jerk.unwrap_or_else(|| meshing.acceleration(&self.q, &self.phasor));
                if side.sign() * pressing <= 0.0 {
                    self.record(EventKind::MeshEnd, side, self.q, observer);
                    self.mode = Mode::Free;
                    // The force of the spring is gone: elements without a rate begin anew.
                    let stops = self.from_rate.map(|order| order > 0);
                    let slips = self.slips;
                    self.enter_from_rest(stops, slips, DomainKind::Free, &self.q.clone());
                    if self.slips != slips {
                        self.hold_rates();
                        self.record_friction(None, observer);
                    }
                }
            }
            _ => {}
        }
    }

    /// Decides sticking elements anew, after a jump of other forces. `rate` is that of the event function, the gap, if the event was at a
    /// wall.
    #[cold]
    #[inline(never)]
    pub(super) fn recheck_sticking(&mut self, rate: Option<f64>, observer: &mut impl Observer) {
        let (kind, before, slips) = (self.mode.domain(), self.flow, self.slips);
        let mut breaks = [false; MOST_FRICTION];
        for (i, (watch, element)) in self.watches().iter().zip(self.elements()).enumerate() {
            let force = watch.as_ref().map_or(0.0, |watch| watch.rates(&self.q, &self.phasor)[0]);
            breaks[i] = slips[i] == Slip::Stick && force.abs() > element.force;
        }
        if breaks == [false; MOST_FRICTION] {
            return;
        }
        self.enter_from_rest(breaks, slips, kind, &self.q.clone());
        if let (true, Some(rate)) = (N > 0, rate) {
            let [field, next] =
                [before, self.flow].map(|flow| flow.domain(kind).field(&self.q, &self.phasor));
            self.jump_with_gap(&field, &next, rate);
        }
        self.record_slips(slips, observer);
        if let (Some((side, _)), 0.0, false) = (self.from_wall, self.q[1], self.flow.holds_gap) {
            if self.mode == Mode::Free && self.presses(DomainKind::Free, side, &self.q) {
                self.contact(side, observer);
            } else {
                self.from_wall = Some((side, self.rest_order(self.mode.domain())));
            }
        }
    }

    /// Adds to each tangent the jump of the field by friction at an event at which the gap has the given rate.
    pub(super) fn jump_with_gap(&mut self, before: &Gap, after: &Gap, rate: f64) {
        if rate.abs() >= super::NO_SPEED * self.flow.speed {
            let jump: Gap = std::array::from_fn(|i| (after[i] - before[i]) / rate);
            self.tangents = self.tangents.map(|u| std::array::from_fn(|i| u[i] + jump[i] * u[0]));
        }
    }

    /// Processes rounding errors at the start of a step: a rate of the wrong sign, or a holding force beyond its limit.
    pub(super) fn settle_friction(&mut self, observer: &mut impl Observer) -> bool {
        for (i, watch) in self.watches().iter().enumerate() {
            let Some(watch) = watch else { continue };
            let [value, rate, _] = watch.rates(&self.q, &self.phasor);
            match self.slips[i] {
                Slip::Stick if value.abs() > self.elements()[i].force && value * rate > 0.0 => {
                    self.begin_sliding(i, Slip::of(value), observer);
                    return true;
                }
                slip if slip != Slip::Stick && self.from_rate[i] == 0 && slip.sign() * value <= 0.0 => {
                    self.end_sliding(i, observer);
                    return true;
                }
                _ => {}
            }
        }
        false
    }

    /// Returns the leaving speed up to which a contact lasts, given the acceleration that presses it. A series of impacts under friction has
    /// no closed form; it ends when its flights are hardly higher than rounding errors.
    pub(super) fn lasting_speed(&self, side: Side, pressing: f64) -> f64 {
        let speed = self.law.mesh_speed[side.index()];
        if !self.flow.has_friction() {
            return speed;
        }
        speed.max((2.0 * LOWEST_FLIGHT * self.flow.length * pressing.abs()).sqrt())
    }

    /// Reports elements that have begun or ended to stick at an event at a wall, given the modes before.
    pub(super) fn record_slips(&mut self, before: Slips, observer: &mut impl Observer) {
        self.record_changes(before, None, observer);
    }

    /// Reports changes of modes, in the order of the elements. The rate of the element `stopped` vanished.
    fn record_changes(&mut self, before: Slips, stopped: Option<usize>, observer: &mut impl Observer) {
        for (i, (before, after)) in before.into_iter().zip(self.slips).enumerate() {
            match (before, after) {
                (Slip::Stick, Slip::Stick) => {}
                (Slip::Stick, _) => self.record_friction(Some(b'7'), observer),
                (_, Slip::Stick) => self.record_friction(None, observer),
                _ if stopped == Some(i) => self.record_friction(Some(b'0'), observer),
                _ => {}
            }
        }
    }

    fn record_friction(&mut self, symbol: Option<u8>, observer: &mut impl Observer) {
        self.work.events += 1;
        self.events_in_period += 1;
        observer.friction(&FrictionEvent {
            slips: self.slips,
            symbol,
            period: self.period,
            t: self.clock.time(),
            at: self.q,
        });
    }
}
