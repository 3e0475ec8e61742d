//! Measures the motion of a pair from its events. Between two events there is one flight in one linear domain, and the exact flow gives its
//! states.

use super::{DomainKind, Gap, LinearFlow, PairFlow, PairMotion, Phasor, Schedule};
use crate::model::Side;
use crate::motion::{EventKind, GapEvent, Sums, nodes, root};

/// The present flight of a motion that is measured.
#[derive(Clone, Debug)]
pub(crate) struct PairMeter<'f> {
    /// The flow of the present stage.
    flow: &'f PairFlow,
    schedule: Schedule<'f>,
    /// Domain, state and time since phase 0 at the beginning of the present flight.
    kind: DomainKind,
    q: Gap,
    t: f64,
    period: u64,
}

impl<'f> PairMeter<'f> {
    /// Begins at phase 0, at the present state of a motion.
    pub(crate) fn new<const N: usize>(motion: &PairMotion<'f, N>) -> PairMeter<'f> {
        let (schedule, flow) = Schedule::new(motion.schedule.whole);
        PairMeter {
            flow,
            schedule,
            kind: motion.domain(),
            q: flow.to_gap(motion.state()),
            t: 0.0,
            period: motion.period(),
        }
    }

    /// Continues the present flight to phase 0 of `period`.
    pub(crate) fn complete_periods(&mut self, period: u64, sums: &mut Sums) {
        while self.period < period {
            self.fly_to(self.flow.period, sums);
            if self.schedule.whole.rigid_mode.is_some() {
                sums.drifts[0].ahead += self.q[2] - sums.drifts[0].rate * self.flow.period;
                self.q[2] = 0.0;
            }
            self.t = 0.0;
            self.flow = self.schedule.restart();
            self.period += 1;
        }
    }

    /// Measures the present flight up to a time since phase 0. A change of the stage at that time is not included.
    fn fly_to(&mut self, until: f64, sums: &mut Sums) {
        while let Some(change) = self.schedule.next_change().filter(|&change| change < until) {
            if change > self.t {
                self.q = self.fly(change - self.t, sums);
                self.t = change;
            }
            self.flow = self.schedule.change();
        }
        if until > self.t {
            self.q = self.fly(until - self.t, sums);
        }
        self.t = until;
    }

    /// Measures the present flight over a time within one stage, and returns its end.
    fn fly(&self, duration: f64, sums: &mut Sums) -> Gap {
        let (flow, kind) = (self.flow, self.kind);
        let linear = flow.domain(kind);
        let pieces = (duration * linear.per_unit).ceil().max(1.0);
        let piece = duration / pieces;
        let mut q = self.q;
        for i in 0..pieces as u64 {
            let (sin, cos) = (flow.omega * (self.t + i as f64 * piece)).sin_cos();
            let start = self.t + i as f64 * piece;
            q = self.fly_piece(&Piece { linear, q, phasor: [cos, sin], length: piece, start }, sums);
        }
        q
    }

    /// Measures a piece of at most one Taylor step, and returns its end.
    fn fly_piece(&self, piece: &Piece<'_>, sums: &mut Sums) -> Gap {
        let mut before = (0.0, piece.q, piece.phasor);
        self.include(&before.1, piece.start, sums);
        for (share, weight) in nodes() {
            let (q, phasor) = piece.at(share);
            self.integrate(weight * piece.length, &q, phasor, piece.time(share), sums);
            self.find_extremes(piece, &before, &(share, q, phasor), sums);
            before = (share, q, phasor);
        }
        let (end, phasor) = piece.at(1.0);
        self.include(&end, piece.time(1.0), sums);
        self.find_extremes(piece, &before, &(1.0, end, phasor), sums);
        end
    }

    /// Subtracts the drift along the rigid-body mode from displacements at a time since phase 0.
    fn without_drift(&self, [x1, x2]: [f64; 2], t: f64, sums: &Sums) -> [f64; 2] {
        let Some([first, second]) = self.schedule.whole.rigid_mode else { return [x1, x2] };
        let ahead = sums.drifts[0].ahead - sums.drifts[0].rate * t;
        [x1 + first * ahead, x2 + second * ahead]
    }

    fn integrate(&self, weight: f64, q: &Gap, phasor: Phasor, t: f64, sums: &mut Sums) {
        let [x1, v1, x2, v2] = self.flow.displacements(*q);
        let [x1, x2] = self.without_drift([x1, x2], t, sums);
        for (moments, value) in sums.displacements.iter_mut().zip([x1, x2, q[0]]) {
            moments.integrate(weight, value, phasor);
        }
        let [[c1, c], [_, c2]] = self.flow.dissipation(self.kind);
        sums.dissipated += weight * (c1 * v1 * v1 + 2.0 * c * v1 * v2 + c2 * v2 * v2);
        if let Some(force) = self.compliant_force(q) {
            sums.force.square += weight * force * force;
            sums.contact_time += weight;
        }
    }

    /// Includes a state in the extremes.
    fn include(&self, q: &Gap, t: f64, sums: &mut Sums) {
        let [x1, _, x2, _] = self.flow.displacements(*q);
        let [x1, x2] = self.without_drift([x1, x2], t, sums);
        for (moments, value) in sums.displacements.iter_mut().zip([x1, x2, q[0]]) {
            moments.include(value);
        }
        if let Some(force) = self.compliant_force(q) {
            sums.force.include(force);
        }
    }

    /// Includes the extremes between two instants of a piece.
    fn find_extremes(&self, piece: &Piece<'_>, from: &Instant, to: &Instant, sums: &mut Sums) {
        for which in 0..4 {
            let drift = match (which, self.schedule.whole.rigid_mode) {
                (0 | 1, Some(mode)) => mode[which] * sums.drifts[0].rate,
                _ => 0.0,
            };
            let rate = |(_, q, phasor): &Instant| self.rate(which, piece.linear, q, phasor) - drift;
            if rate(from) * rate(to) < 0.0 {
                let (share, extreme) = piece.root(from.0, to.0, rate);
                self.include(&extreme, piece.time(share), sums);
            }
        }
    }

    /// Returns the rate of a displacement, of the gap, or of the contact force.
    fn rate(&self, which: usize, linear: &LinearFlow, q: &Gap, phasor: &Phasor) -> f64 {
        match which {
            0 | 1 => self.flow.displacements(*q)[2 * which + 1],
            2 => q[1],
            _ => self.compliant_side().map_or(0.0, |side| {
                let [stiffness, damping] = self.flow.wall_force(side);
                stiffness * q[1] + damping * linear.acceleration(q, phasor)
            }),
        }
    }

    /// Returns the side of the present contact if it is compliant.
    fn compliant_side(&self) -> Option<Side> {
        match self.kind {
            DomainKind::Meshing(side) if self.flow.is_compliant(side) => Some(side),
            _ => None,
        }
    }

    /// Returns the force of a compliant contact, positive if it presses.
    fn compliant_force(&self, q: &Gap) -> Option<f64> {
        let side = self.compliant_side()?;
        let [stiffness, damping] = self.flow.wall_force(side);
        Some(side.sign() * (stiffness * (q[0] - self.flow.wall(side)) + damping * q[1]))
    }

    /// Adds the energy that a contact dissipates at an instant.
    fn contact(&self, event: &GapEvent, sums: &mut Sums) {
        let (side, flow) = (event.side, self.flow);
        let kinetic = |w: f64| 0.5 * w * w / flow.compliance();
        if event.kind == EventKind::MeshEnd {
            let depth = event.before[0] - flow.wall(side);
            sums.lost.add(0.5 * flow.wall_force(side)[0] * depth * depth, 0.0);
        } else if event.ends_series {
            // The series of impacts dissipates the energy with which the gap left the wall.
            sums.lost.add(kinetic(self.q[1]), 0.0);
        } else if event.has_impact {
            let approach = side.sign() * event.before[1];
            sums.lost.add(kinetic(approach), kinetic(event.after[1]));
            sums.approach(side, approach);
        }
    }

    /// Receives an event.
    pub(crate) fn event(&mut self, event: &GapEvent, sums: &mut Sums) {
        self.complete_periods(event.period, sums);
        let duration = event.t - self.t;
        if event.ends_series {
            // The gap stays closed during the series. The error of the midpoint rule is of third order in its short
            // duration.
            let (begin, end) = (self.q, event.after);
            let middle = [end[0], end[1], 0.5 * (begin[2] + end[2]), 0.5 * (begin[3] + end[3])];
            let (sin, cos) = (self.flow.omega * (self.t + 0.5 * duration)).sin_cos();
            self.integrate(duration, &middle, [cos, sin], self.t + 0.5 * duration, sums);
        } else {
            self.fly_to(event.t, sums);
        }
        self.contact(event, sums);
        self.kind = match event.kind {
            EventKind::MeshStart => DomainKind::Meshing(event.side),
            _ => DomainKind::Free,
        };
        self.q = event.after;
        self.t = event.t;
        self.include(&event.after, event.t, sums);
    }
}

/// Time as a share of a piece, state and phasor.
type Instant = (f64, Gap, Phasor);

/// A part of a flight, at most one Taylor step long.
struct Piece<'f> {
    linear: &'f LinearFlow,
    q: Gap,
    phasor: Phasor,
    length: f64,
    /// Time of its start since phase 0.
    start: f64,
}

impl Piece<'_> {
    fn at(&self, share: f64) -> (Gap, Phasor) {
        let u = share * self.length * self.linear.per_unit;
        let expansion = self.linear.grid.expansion(&self.q, &self.phasor, u);
        let v = u - expansion.start;
        (expansion.state(v), expansion.phasor(self.linear.turn * v))
    }

    /// Returns the time since phase 0 at a share of the piece.
    fn time(&self, share: f64) -> f64 {
        self.start + share * self.length
    }

    /// Returns share and state at a zero of `rate` between two instants at which it has opposite signs.
    fn root(&self, a: f64, b: f64, rate: impl Fn(&Instant) -> f64) -> (f64, Gap) {
        let of = |share| {
            let (q, phasor) = self.at(share);
            rate(&(share, q, phasor))
        };
        let share = root(a, b, of);
        (share, self.at(share).0)
    }
}
