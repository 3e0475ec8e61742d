//! Events at a wall: impact, start and end of meshing, grazing.

use super::sticking::RELEASE_ORDER;
use super::{Crossing, Mode, PairMotion};
use crate::model::{Contact, Side};
use crate::motion::{EventKind, GRAZING_SPEED, GapEvent, Observer};
use crate::pair::flow::{DomainKind, Gap, LinearFlow};

/// The gradient of the gap in gap coordinates.
const ALONG_GAP: Gap = [1.0, 0.0, 0.0, 0.0];

impl<const N: usize> PairMotion<'_, N> {
    /// Determines the mode of the start.
    pub(super) fn enter(&mut self) {
        for side in Side::BOTH {
            let mut beyond = side.sign() * (self.q[0] - self.flow.wall(side));
            if beyond > 0.0 && self.flow.contacts[side.index()] == Contact::Rigid {
                self.q[0] = self.flow.wall(side);
                beyond = 0.0;
            }
            if beyond > 0.0 {
                self.mode = Mode::Sustained(side);
                self.origin = Some(side);
            } else if beyond == 0.0 {
                self.origin = Some(side);
                let closing = side.sign() * self.q[1];
                let is_rigid = self.flow.contacts[side.index()] == Contact::Rigid;
                let kind = if is_rigid { DomainKind::Meshing(side) } else { DomainKind::Free };
                let into = closing > 0.0 || closing == 0.0 && self.presses(kind, side, &self.q);
                if into {
                    self.pending = Some(side);
                } else {
                    self.leave(side);
                }
            }
        }
    }

    /// Processes a crossing at the present state.
    #[inline(always)]
    pub(super) fn act(&mut self, crossing: Crossing, observer: &mut impl Observer) {
        match crossing {
            Crossing::Contact(side) => self.contact(side, observer),
            Crossing::OnsetEnds(side) => {
                self.q[0] = self.flow.wall(side);
                self.mode = Mode::Sustained(side);
                self.from_wall = Some((side, 1));
            }
            Crossing::MeshEnds(side) if self.flow.contacts[side.index()].is_elastic() => {
                self.come_out(side, observer);
            }
            Crossing::MeshEnds(side) => {
                self.q[0] = self.flow.wall(side);
                let rate = self.q[1];
                self.end_meshing(side, &ALONG_GAP, rate, observer);
                self.leave(side);
            }
            Crossing::Through(side) => {
                self.q[0] = self.flow.wall(side.mirrored());
                let rate = self.q[1];
                self.end_meshing(side, &ALONG_GAP, rate, observer);
                self.contact(side.mirrored(), observer);
            }
            Crossing::PressingEnds(side) if self.mode == Mode::Stuck(side) => self.release(side, observer),
            Crossing::PressingEnds(side) => {
                let linear = self.flow.domain(DomainKind::Meshing(side));
                let row = &linear.acceleration_row().base;
                let normal = [row[0], row[1], row[2], row[3]];
                let rate = linear.acceleration_rates(&self.q, &self.phasor)[1];
                self.end_meshing(side, &normal, rate, observer);
                self.from_wall = None;
            }
        }
    }

    /// Processes a contact: free motion has reached a wall.
    #[inline(always)]
    pub(super) fn contact(&mut self, side: Side, observer: &mut impl Observer) {
        let contact = self.flow.contacts[side.index()];
        if contact == Contact::Impact || !self.continues_without_impact(contact, side, observer) {
            self.impact(side, observer);
        }
    }

    /// Processes a contact without an impact: motion behind an elastic wall, or rest on a rigid one. Returns false if
    /// there is an impact.
    #[inline(never)]
    fn continues_without_impact(
        &mut self,
        contact: Contact,
        side: Side,
        observer: &mut impl Observer,
    ) -> bool {
        match contact {
            Contact::Rigid => {
                if !self.sticks(side) {
                    return false;
                }
                self.stick(side, observer);
            }
            Contact::Impact => return false,
            _ => self.go_behind(side, observer),
        }
        true
    }

    /// Applies the impact law, and decides whether meshing follows (22), (37).
    #[inline(always)]
    fn impact(&mut self, side: Side, observer: &mut impl Observer) {
        let e = self.law.restitution[side.index()];
        self.q[0] = self.flow.wall(side);
        let before = self.q;
        let approach = side.sign() * before[1];
        let leaving = e * approach.abs();
        let kick = self.flow.kick;
        let reset = move |u: &Gap| [u[0], -e * u[1], u[2], u[3] + kick * (1.0 + e) * u[1]];
        let after = reset(&before);
        let free = self.flow.domain(DomainKind::Free);
        let pressing = side.sign() * free.acceleration(&after, &self.phasor);
        let pressed = pressing > 0.0 || pressing == 0.0 && self.presses(DomainKind::Free, side, &after);
        let meshes = leaving <= self.law.mesh_speed[side.index()]
            && pressed
            && self.flow.contacts[side.index()] == Contact::Impact
            && self.presses(DomainKind::Meshing(side), side, &after);
        if approach < GRAZING_SPEED * self.flow.speed && !pressed {
            self.near_grazing = true;
        }
        let (kind, next) = if meshes {
            (EventKind::MeshStart, DomainKind::Meshing(side))
        } else {
            (EventKind::Impact, DomainKind::Free)
        };
        if N > 0 {
            let field_before = self.flow.domain(DomainKind::Free).field(&before, &self.phasor);
            let field_after = self.flow.domain(next).field(&after, &self.phasor);
            self.saltate(reset, &ALONG_GAP, before[1], &field_before, &field_after);
        }
        self.q = after;
        self.record(kind, side, before, observer);
        if meshes {
            self.start_meshing(side, leaving);
            let meshing = self.flow.domain(DomainKind::Meshing(side));
            let pressing = side.sign() * meshing.acceleration(&after, &self.phasor);
            self.short_flight = self.expects_short_flight(meshing, leaving, pressing);
        } else {
            self.work.impacts += 1;
            self.leave(side);
            self.short_flight = self.expects_short_flight(free, leaving, pressing);
            if pressed {
                self.close_chatter(side, leaving, observer);
            }
        }
    }

    pub(super) fn start_meshing(&mut self, side: Side, leaving: f64) {
        // Contacts with both walls share one index of the step length, but may have different numbers of step lengths.
        self.level[1] = self.level[1].min(self.flow.domain(DomainKind::Meshing(side)).levels - 1);
        if leaving > 0.0 {
            self.mode = Mode::Onset(side);
            self.from_wall = Some((side, 1));
        } else {
            self.mode = Mode::Sustained(side);
            self.from_wall = Some((side, self.rest_order(DomainKind::Meshing(side))));
        }
    }

    fn end_meshing(&mut self, side: Side, normal: &Gap, rate: f64, observer: &mut impl Observer) {
        if N > 0 {
            let before = self.flow.domain(DomainKind::Meshing(side)).field(&self.q, &self.phasor);
            let after = self.flow.domain(DomainKind::Free).field(&self.q, &self.phasor);
            self.saltate(|u| *u, normal, rate, &before, &after);
        }
        self.record(EventKind::MeshEnd, side, self.q, observer);
        self.mode = Mode::Free;
    }

    /// Starts free motion on a wall.
    pub(super) fn leave(&mut self, side: Side) {
        self.mode = Mode::Free;
        let order = if self.q[1] == 0.0 { self.rest_order(DomainKind::Free) } else { 1 };
        self.from_wall = Some((side, order));
    }

    /// Returns the order of the root of the distance for a gap at rest on the wall.
    pub(super) fn rest_order(&self, kind: DomainKind) -> usize {
        if self.flow.domain(kind).acceleration(&self.q, &self.phasor) == 0.0 { 3 } else { 2 }
    }

    /// Whether the relative acceleration points into the wall. If the acceleration is zero, its first nonzero derivative decides.
    pub(super) fn presses(&self, kind: DomainKind, side: Side, q: &Gap) -> bool {
        let linear = self.flow.domain(kind);
        let a = linear.acceleration(q, &self.phasor);
        if a != 0.0 {
            return side.sign() * a > 0.0;
        }
        let rates = linear.acceleration_rates(q, &self.phasor);
        rates.iter().find(|&&rate| rate != 0.0).is_some_and(|rate| side.sign() * rate > 0.0)
    }

    /// Counts and reports an event. The first flight comes from no wall, so it has no symbol.
    pub(super) fn record(&mut self, kind: EventKind, side: Side, before: Gap, observer: &mut impl Observer) {
        self.record_event(kind, side, before, false, observer);
    }

    /// Like [`record`](Self::record); `ends_series` tells whether the event replaces an infinite series of impacts.
    pub(super) fn record_event(
        &mut self,
        kind: EventKind,
        side: Side,
        before: Gap,
        ends_series: bool,
        observer: &mut impl Observer,
    ) {
        let contact = |side: Side| Some(if side == Side::Right { b'1' } else { b'4' });
        let symbol = match (self.mode, self.origin) {
            (Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side), _) => contact(side),
            (Mode::Free, Some(Side::Right)) => Some(if side == Side::Right { b'2' } else { b'3' }),
            (Mode::Free, Some(Side::Left)) => Some(if side == Side::Left { b'5' } else { b'6' }),
            (Mode::Free, None) => None,
        };
        self.origin = Some(side);
        self.work.events += 1;
        self.events_in_period += 1;
        let whole = self.schedule.whole;
        // The strobe map has another branch if meshing ends before the gap reaches the wall.
        let is_on_wall = before[0] == whole.wall(side);
        let event = GapEvent {
            gap: 0,
            kind,
            side,
            symbol,
            period: self.period,
            t: self.clock.time(),
            before,
            after: self.q,
            meshing: (kind == EventKind::MeshStart).then_some(side),
            has_impact: kind != EventKind::MeshEnd
                && !self.flow.contacts[side.index()].is_elastic()
                && !ends_series,
            code: 1 + u64::from(side == Side::Right) + 2 * u64::from(is_on_wall) + 4 * kind as u64,
            ends_series,
        };
        let after = self.q;
        observer.event(&event, &|| [before, after].map(|q| self.unshifted(q)));
    }

    /// Corrects a start of a step that rounding has put on or beyond its boundary, as when an event lies within
    /// rounding of the strobe. Returns whether there was anything to correct.
    pub(super) fn settle_start(&mut self, observer: &mut impl Observer) -> bool {
        if self.from_wall.is_some() {
            return false;
        }
        match self.mode {
            Mode::Free => {
                let beyond = |side: Side| side.sign() * (self.q[0] - self.flow.wall(side)) >= 0.0;
                let Some(side) = Side::BOTH.into_iter().find(|&side| beyond(side)) else { return false };
                self.touch(side, observer);
            }
            Mode::Sustained(side) => {
                if side.sign() * (self.q[0] - self.flow.wall(side)) > 0.0 {
                    return false;
                }
                if side.sign() * self.q[1] > 0.0 {
                    self.act(Crossing::OnsetEnds(side), observer);
                } else {
                    self.act(Crossing::MeshEnds(side), observer);
                }
            }
            Mode::Onset(side) => {
                let onset_over = side.sign() * (self.q[0] - self.flow.wall(side)) >= 0.0;
                let linear = self.flow.domain(DomainKind::Meshing(side));
                let pulls = side.sign() * linear.acceleration(&self.q, &self.phasor) <= 0.0;
                let through = side.sign() * (self.q[0] - self.flow.wall(side.mirrored())) <= 0.0;
                if through && side.sign() * self.q[1] < 0.0 {
                    self.act(Crossing::Through(side), observer);
                    return true;
                }
                match (onset_over, pulls) {
                    (true, _) => self.act(Crossing::OnsetEnds(side), observer),
                    (false, true) => self.act(Crossing::PressingEnds(side), observer),
                    (false, false) => return false,
                }
            }
            Mode::Stuck(side) => {
                if self.presses(DomainKind::Meshing(side), side, &self.q) {
                    return false;
                }
                self.release(side, observer);
            }
        }
        true
    }

    /// Processes a gap that is on a wall, or beyond it by rounding: a contact if the gap closes, otherwise a start
    /// from the wall.
    fn touch(&mut self, side: Side, observer: &mut impl Observer) {
        self.q[0] = self.flow.wall(side);
        let closing = side.sign() * self.q[1];
        let stays = self.flow.contacts[side.index()] != Contact::Impact
            && closing == 0.0
            && self.presses(DomainKind::Free, side, &self.q);
        if closing > 0.0 || stays {
            self.contact(side, observer);
        } else {
            self.origin = Some(side);
            self.leave(side);
        }
    }

    /// Sets the near-grazing flag for a gap that touches a wall within rounding. There are two exceptions: an elastic
    /// wall, where the linearisation is valid with and without contact, and a gap that has just left a rigid wall,
    /// which moves very slowly at first.
    #[cold]
    pub(super) fn note_grazing(&mut self) {
        let [right, left] = self.flow.walls.map(|wall| (self.q[0] - wall).abs());
        let nearer = if right <= left { Side::Right } else { Side::Left };
        let is_let_go = self.from_wall == Some((nearer, RELEASE_ORDER));
        self.near_grazing |= !self.flow.contacts[nearer.index()].is_elastic() && !is_let_go;
    }

    /// Takes the shortest step although it is undecided: a contact on it is within rounding of grazing. If the step
    /// ends beyond a wall there is a contact, otherwise no event.
    pub(super) fn settle_graze(
        &mut self,
        linear: &LinearFlow,
        h: f64,
        until: f64,
        observer: &mut impl Observer,
    ) {
        self.note_grazing();
        let remaining = self.clock.remaining(until);
        let s = h.min(remaining);
        self.move_within(linear, s);
        if s < remaining {
            self.clock.advance(s);
        } else {
            self.clock.set(until);
        }
        self.depart();
        self.settle_start(observer);
    }
}

#[cfg(test)]
mod tests {
    use crate::model::{GearPair, REST, Side};
    use crate::motion::{EventKind, Flow, GapEvent, Trajectory};

    /// With a very small backlash, a contact onset may reach the opposite wall. A contact there must follow.
    #[test]
    fn a_contact_onset_stops_at_the_opposite_wall() {
        let mut reached = 0;
        for (b, mesh_speed) in [(1e-6, 0.01), (1e-5, 0.01), (1e-4, 0.05), (3e-4, 0.05)] {
            for (e, omega) in [(0.3, 5.6), (0.6, 3.2), (0.8, 2.0)] {
                let pair = GearPair { b, mesh_speed, omega, ..GearPair::paper(e) };
                let flow = Flow::new(&pair.pair());
                let mut trajectory = Trajectory::<0>::new(&flow, pair.law(), REST);
                let mut events: Vec<GapEvent> = Vec::new();
                for _ in 0..20 {
                    trajectory.advance_period(&mut events).unwrap();
                }
                for pair in events.windows(2) {
                    let [end, contact] = [&pair[0], &pair[1]];
                    let wall = |side: Side| flow.pair().unwrap().wall(side);
                    let short = end.side.sign() * (end.before[0] - wall(end.side.mirrored()));
                    if end.kind == EventKind::MeshEnd {
                        assert!(short >= 0.0, "through the opposite wall by {short:e} at {end:?}");
                        if short == 0.0 {
                            assert_eq!((contact.side, contact.t), (end.side.mirrored(), end.t));
                            reached += 1;
                        }
                    }
                }
            }
        }
        assert!(reached > 10, "{reached} contacts with the opposite wall");
    }
}
