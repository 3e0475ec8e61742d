//! Events at roots of watches: contacts, impacts, and their reports to observers.

use super::MachineMotion;
use crate::machine::ROUNDING;
use crate::machine::domain::STAYS_ZERO;
use crate::machine::frame::SpringElement;
use crate::machine::impact::{Impact, Outcome};
use crate::machine::modes::{AtRest, GapMode, signed};
use crate::machine::watch::Watch;
use crate::model::{MOST_FRICTION, Side, Wall};
use crate::motion::{
    EVENTS_PER_PERIOD_CAP, EventKind, GRAZING_SPEED, GapEvent, NO_SPEED, Observer, Remark, SlipEvent,
    SlipKind, Slips,
};
use crate::word;

/// Order of the root of the distance when the gap leaves a rigid wall: its acceleration is zero, the derivative is not.
pub(super) const RELEASE_ORDER: usize = 3;

/// Time between two impacts, in forcing periods, within which their order is not known.
pub const TIE: f64 = 1e-12;

impl MachineMotion<'_> {
    /// Processes the root of a watch.
    pub(super) fn act(&mut self, watch: Watch, observer: &mut dyn Observer) {
        let mut exempt = AtRest::default();
        match watch {
            Watch::Wall(gap, direction) => {
                if let GapMode::Onset(side) = self.modes.gaps[gap] {
                    self.end_contact(gap, side, observer);
                }
                self.reach(gap, direction, observer);
            }
            Watch::OnsetEnds(gap, side) => {
                self.modes.gaps[gap] = GapMode::Pressed(side);
                self.roots.at_wall[gap] = Some((side.mirrored(), 1));
                return;
            }
            Watch::PressingEnds(gap, side) => {
                self.end_contact(gap, side, observer);
                self.roots.at_wall[gap] = None;
            }
            Watch::Leaves(gap, side) if self.modes.gaps[gap] == GapMode::Open(side) => {
                self.modes.gaps[gap] = self.system.before_last(gap, side);
                if side.sign() * self.rate(gap) < 0.0 {
                    self.leave(gap, side);
                } else {
                    self.reach(gap, side, observer);
                }
            }
            Watch::Leaves(gap, side) => {
                self.end_contact(gap, side, observer);
                self.leave(gap, side);
            }
            Watch::ForceEnds(gap, side) => {
                self.end_contact(gap, side, observer);
                self.modes.gaps[gap] = GapMode::Open(side);
                self.roots.from_force[gap] = self.derivative_of_force(gap, side, 1).0;
            }
            Watch::ForceBegins(gap, side) => self.begin_force(gap, side, observer),
            Watch::PushEnds(gap, side) => {
                self.end_contact(gap, side, observer);
                self.roots.at_wall[gap] = Some((side, RELEASE_ORDER));
                exempt.gaps[gap] = Some(side);
            }
            Watch::Border(i, is_upper) => return self.pass_border(i, is_upper),
            Watch::RateVanishes(i) => self.end_sliding(i, observer),
            Watch::Slips(i, next) => {
                self.begin_sliding(i, next, observer);
                exempt.elements[i] = true;
            }
        }
        self.settle(&exempt, observer);
        for gap in 0..self.system.gaps() {
            if let Some((side, STAYS_ZERO)) = self.roots.at_wall[gap] {
                self.leave(gap, side);
            }
        }
    }

    /// Enters the next piece of a curve at a border. Its force is continuous, so that this is no event.
    pub(super) fn pass_border(&mut self, i: usize, is_upper: bool) {
        let inside = self.moment().function(Watch::Border(i, is_upper));
        let (order, value) = self.domain.first_derivative(&inside, &self.point, 1);
        if value < 0.0 {
            let piece = &mut self.modes.pieces[i];
            *piece = if is_upper { *piece + 1 } else { *piece - 1 };
            self.roots.at_border[i] = Some((!is_upper, order));
            self.check_range(i);
            self.refresh();
        } else {
            self.roots.at_border[i] = Some((is_upper, order));
        }
    }

    /// Notes it if a nonlinear spring is beyond its points.
    pub(super) fn check_range(&mut self, i: usize) {
        let spring = i.checked_sub(MOST_FRICTION).map(|spring| &self.system.springs[spring]);
        let piece = usize::from(self.modes.pieces[i]);
        let is_below = |own: &SpringElement| piece == 0 && own.wall.is_none();
        if spring.is_some_and(|own| is_below(own) || piece + 1 == own.curve.pieces.len()) {
            self.remark = self.remark.max(Some(Remark::OutOfRange));
        }
    }

    /// Begins contact with a wall that only pushes, whose force is 0 now.
    pub(super) fn begin_force(&mut self, gap: usize, side: Side, observer: &mut dyn Observer) {
        let count = self.system.walls(gap, side).len();
        self.record(gap, EventKind::MeshStart, side, count - 1, Some(side), observer);
        self.modes.gaps[gap] = GapMode::Beyond(signed(side, count));
        self.roots.from_force[gap] = self.derivative_of_force(gap, side, 1).0;
    }

    /// Returns order and value of the first nonzero derivative of a pushing wall's force, like `LinearDomain::first_derivative`.
    pub(super) fn derivative_of_force(&mut self, gap: usize, side: Side, first: usize) -> (usize, f64) {
        let force = self.system.force(self.modes.stage, &self.modes.pieces, gap, side);
        self.refresh().first_derivative(&force, &self.point, first)
    }

    /// Ends a lasting contact with the last wall of a side.
    pub(super) fn end_contact(&mut self, gap: usize, side: Side, observer: &mut dyn Observer) {
        let next = self.system.before_last(gap, side);
        let last = self.system.walls(gap, side).len() - 1;
        self.record(gap, EventKind::MeshEnd, side, last, next.contact(), observer);
        self.modes.gaps[gap] = next;
    }

    /// Records that a gap lies on the wall in a direction, and does not pass it.
    pub(super) fn leave(&mut self, gap: usize, direction: Side) {
        let order = if self.rate(gap) != 0.0 { 1 } else { self.refresh().departure(gap, &self.point).0 };
        self.roots.at_wall[gap] = Some((direction, order));
    }

    /// Whether a gap at rest begins to move in a direction.
    pub(super) fn heads(&mut self, gap: usize, direction: Side) -> bool {
        direction.sign() * self.refresh().departure(gap, &self.point).1 > 0.0
    }

    /// Processes a gap that reaches a wall in a direction.
    fn reach(&mut self, gap: usize, direction: Side, observer: &mut dyn Observer) {
        let Some((side, number)) = self.system.wall_ahead(&self.modes, gap, direction) else { return };
        let wall = &self.system.walls(gap, side)[number];
        self.point[gap] = wall.at;
        let closing = direction.sign() * self.rate(gap);
        if closing < 0.0 || closing == 0.0 && !self.heads(gap, direction) {
            self.leave(gap, direction);
            return;
        }
        let is_tiny = 0.0 < closing && closing < NO_SPEED * self.system.speed;
        let pressing =
            |motion: &mut Self| direction.sign() * motion.refresh().accelerations[gap].dot(&motion.point);
        if is_tiny && !wall.contact.is_elastic() && pressing(self) <= 0.0 {
            // A series of alternating impacts of two gaps ends here: both leave their walls from rest.
            self.point[self.system.n + gap] = 0.0;
            self.near_grazing = true;
            self.count_event();
            self.leave(gap, direction);
            return;
        }
        let GapMode::Beyond(passed) = self.modes.gaps[gap] else { return };
        let step = if direction == Side::Right { 1 } else { -1 };
        if side != direction {
            let next = GapMode::Beyond(passed + step);
            self.record(gap, EventKind::MeshEnd, side, number, next.contact(), observer);
            self.modes.gaps[gap] = next;
            self.leave(gap, side);
        } else if wall.contact.is_elastic() {
            let is_last = number + 1 == self.system.walls(gap, side).len();
            if is_last
                && self.system.pushing(gap, side).is_some()
                && self.derivative_of_force(gap, side, 0).1 <= 0.0
            {
                self.modes.gaps[gap] = GapMode::Open(side);
                self.leave(gap, side.mirrored());
                self.start_from_force(gap, side);
                return;
            }
            self.record(gap, EventKind::MeshStart, side, number, Some(side), observer);
            self.modes.gaps[gap] = GapMode::Beyond(passed + step);
            let spring = wall.springs[self.modes.stage];
            if closing == 0.0 && spring.force_at_wall() != 0.0 && !self.heads(gap, side) {
                // Rest on the wall under a load below the preload is an infinite series of contacts.
                self.events_in_period = EVENTS_PER_PERIOD_CAP;
            }
            self.near_grazing |= spring.force_at_wall() != 0.0 && closing < GRAZING_SPEED * self.system.speed;
            self.leave(gap, side.mirrored());
            self.start_from_force(gap, side);
        } else {
            self.impact(gap, side, wall, observer);
        }
    }

    /// Records the order of the root of a force at a flight's start.
    pub(super) fn start_from_force(&mut self, gap: usize, side: Side) {
        if self.system.pushing(gap, side).is_some() {
            self.roots.from_force[gap] = self.derivative_of_force(gap, side, 0).0;
        }
    }

    /// Processes an impact, after which the gap leaves the wall, or a lasting contact begins.
    fn impact(&mut self, gap: usize, side: Side, wall: &Wall, observer: &mut dyn Observer) {
        let (system, approach) = (self.system, side.sign() * self.rate(gap));
        if (0..system.gaps()).any(|other| other != gap && self.arrives_with(gap, other)) {
            self.remark = Some(Remark::Tie);
        }
        let (modes, point) = (&self.modes, &self.point);
        let impact = Impact { system, modes, point, gap, side, wall, approach };
        let Outcome { modes: next, rates, lasts, pressing, jump, impulse } = impact.outcome();
        if !lasts && pressing <= 0.0 && approach < GRAZING_SPEED * system.speed {
            self.near_grazing = true;
        }
        // A gap that begins to press its wall from rest does so in neighbouring motions, too.
        if approach > 0.0 {
            self.jumps.push((impulse, jump));
        }
        self.point[system.n..2 * system.n].copy_from_slice(&rates[..system.n]);
        let (kind, meshing) = if lasts {
            (EventKind::MeshStart, Some(side))
        } else {
            self.work.impacts += 1;
            (EventKind::Impact, system.before_last(gap, side).contact())
        };
        self.record(gap, kind, side, system.walls(gap, side).len() - 1, meshing, observer);
        self.modes.gaps[gap] = next.gaps[gap];
        self.change_modes(&next, None, observer);
        match next.gaps[gap] {
            GapMode::Stuck(_) => self.roots.at_wall[gap] = None,
            GapMode::Pressed(_) => self.leave(gap, side.mirrored()),
            _ => self.leave(gap, side),
        }
        self.note_before();
    }

    /// Whether another gap is about to have an impact, too, and the impact of the first gap changes its rate.
    fn arrives_with(&self, gap: usize, other: usize) -> bool {
        let (system, rate) = (self.system, self.rate(other));
        let side = if rate > 0.0 { Side::Right } else { Side::Left };
        let m = |i, j| system.mobility[(i, j)];
        let is_coupled = || m(gap, other).abs() > ROUNDING * (m(gap, gap) * m(other, other)).sqrt();
        rate != 0.0
            && system.wall_ahead(&self.modes, other, side).is_some_and(|(own, number)| {
                let wall = &system.walls(other, own)[number];
                let left = (wall.at - self.point[other]).abs();
                own == side && !wall.contact.is_elastic() && left <= TIE * system.period * rate.abs()
            })
            && is_coupled()
    }

    pub(super) fn count_event(&mut self) {
        self.work.events += 1;
        self.events_in_period += 1;
    }

    /// Counts and reports an event at a wall. The modes are those before it.
    pub(super) fn record(
        &mut self,
        gap: usize,
        kind: EventKind,
        side: Side,
        wall: usize,
        meshing: Option<Side>,
        observer: &mut dyn Observer,
    ) {
        let origin = self.origin[gap].replace(side);
        self.count_event();
        if !observer.sees_events() {
            return;
        }
        let of_contact = |side: Side| if side == Side::Right { b'1' } else { b'4' };
        let mode = match self.modes.gaps[gap] {
            GapMode::Open(side) => self.system.before_last(gap, side),
            mode => mode,
        };
        let symbol = match (mode.contact(), origin) {
            (Some(side), _) => Some(of_contact(side)),
            (None, None) => None,
            (None, Some(Side::Right)) => Some(if side == Side::Right { b'2' } else { b'3' }),
            (None, Some(Side::Left)) => Some(if side == Side::Left { b'5' } else { b'6' }),
        };
        // With several gaps, a symbol includes its gap.
        let several = self.system.gaps() > 1;
        let symbol = symbol.map(|symbol| if several { word::of_gap(symbol, gap) } else { symbol });
        let n = self.system.n;
        let place = &self.system.walls(gap, side)[wall];
        let is_on_wall = self.before[gap] == place.at;
        let of_wall = 1 + u64::from(side == Side::Right) + 2 * u64::from(is_on_wall);
        let event = GapEvent {
            gap,
            kind,
            side,
            symbol,
            period: self.period,
            t: self.clock.time(),
            before: [self.before[gap], self.before[n + gap], 0.0, 0.0],
            after: [self.point[gap], self.point[n + gap], 0.0, 0.0],
            meshing,
            has_impact: !place.contact.is_elastic() && kind != EventKind::MeshEnd && !self.jumps.is_empty(),
            code: of_wall + 4 * kind as u64 + 256 * (gap + 8 * wall) as u64,
            ends_series: false,
        };
        observer.event(&event, &|| [&self.before[..], &self.point].map(|point| self.unshifted(point)));
    }

    /// Counts and reports a change of friction modes.
    pub(super) fn record_slip(&mut self, element: usize, kind: SlipKind, observer: &mut dyn Observer) {
        self.count_event();
        let symbol = match kind {
            SlipKind::Stick => None,
            SlipKind::Slip => Some(b'7'),
            SlipKind::Reversal => Some(b'0'),
        };
        let mut slips = Slips::default();
        let elements = &self.system.elements;
        elements.iter().zip(self.modes.slips).for_each(|(element, slip)| slips[element.index] = slip);
        observer.slip(&SlipEvent {
            element: elements[element].index,
            kind,
            slips,
            symbol,
            period: self.period,
            t: self.clock.time(),
            at: self.unshifted(&self.point),
        });
    }
}
