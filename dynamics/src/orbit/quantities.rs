//! What people measure on a motion: impacts, contact forces, amplitudes, harmonics, dissipated energy.
//!
//! A [`Meter`] receives the events of a trajectory. Between two events the motion is one flight in one linear domain,
//! and the meter evaluates the exact flow there: integrals by Gauss-Legendre quadrature of order 16 over pieces of at
//! most one Taylor step, where its error is below rounding, and extremes at the zeros of the rate.

use crate::flow::{DomainKind, Flow, Gap, LinearFlow, Phasor, Schedule};
use crate::model::{Law, MOST_COORDINATES, MOST_GAPS, NonImpacting, State};
use crate::reference::machine::{Flight, MachineEvent, Point, Signal};
use crate::reference::{Allowance, EventKind, GapEvent, Observer, Stop, Trajectory, side_of};

/// Nodes in `(0, 1)` and weights of the Gauss-Legendre quadrature on `[-1, 1]`; the other half is symmetric.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// Largest number of iterations that locate an extreme.
const EXTREME_ITERATIONS: usize = 60;

/// Largest number of displacements and gaps.
pub const DISPLACEMENTS: usize = MOST_COORDINATES + MOST_GAPS;

/// Returns the place of a displacement in [`Quantities::displacements`].
pub fn place_of_displacement(i: usize) -> usize {
    if i < 2 { i } else { i + 1 }
}

/// Returns the place of a gap in [`Quantities::displacements`].
pub fn place_of_gap(i: usize) -> usize {
    if i == 0 { 2 } else { MOST_COORDINATES + i }
}

/// Quantities of one motion over a whole number of forcing periods, in the units of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quantities {
    /// Approach speeds at the right and the left wall, and at both.
    pub approaches: [Approaches; 3],
    /// Energy lost in contacts per unit time: `(1 - e^2) w^2 / (2 g M^-1 g)` in each impact, and the energy of a contact
    /// spring that is released before it relaxes.
    pub impact_energy: f64,
    /// Largest and root mean square force of compliant contacts, positive if it presses; none without such contact.
    pub contact_force: Option<[f64; 2]>,
    /// The first two displacements, the first gap, the other displacements and the other gaps; 0 where the oscillator has no more.
    pub displacements: [Displacement; DISPLACEMENTS],
    /// Energy that all dampers take per unit time.
    pub dissipated: f64,
    /// Dry friction; none without it.
    pub friction: Option<FrictionQuantities>,
}

/// Quantities of dry friction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionQuantities {
    /// Share of the time during which an element sticks, 0 to 1.
    pub sticking: f64,
    /// Energy that friction turns into heat per unit time, `force |rate|` of all elements.
    pub dissipated: f64,
}

/// Approach speeds of the contacts to which the law of restitution applies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Approaches {
    /// Number of contacts.
    pub count: u64,
    /// Mean approach speed; 0 without contacts.
    pub mean: f64,
    /// Largest approach speed; 0 without contacts.
    pub largest: f64,
}

/// Averages and extremes of a displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Displacement {
    /// Half the difference of maximum and minimum.
    pub amplitude: f64,
    /// Average over time.
    pub mean: f64,
    /// Root mean square.
    pub rms: f64,
    /// Amplitude `a > 0` and phase `phi` in `(-pi, pi]` of the component `a cos(omega t + phi)`.
    pub harmonic: [f64; 2],
}

/// Measures the motion that continues from a strobe state: over one cycle of `period` forcing periods, or over `observed` periods if `period`
/// is 0. The motion first follows its cycle once, so that `strobe` may be rounded. Motion without further contact is measured in its steady
/// state.
///
/// Returns `None` if the motion cannot be continued.
pub fn quantities_after(
    flow: &Flow,
    law: Law,
    strobe: State,
    [period, observed]: [u32; 2],
    allowance: Allowance<'_>,
) -> Option<Quantities> {
    let mut motion = Trajectory::new(flow, law, strobe).allowing(allowance);
    let is_certain = |free: &&NonImpacting| motion.is_free() && free.is_certain(strobe);
    if let Some(free) = flow.non_impacting().filter(is_certain) {
        return Meter::measure_steady(flow, law, free).ok();
    }
    for _ in 0..period {
        motion.advance_period(&mut ()).ok()?;
    }
    Meter::measure(flow, &mut motion, if period > 0 { period } else { observed.max(1) }).ok()
}

/// Approach speeds so far.
#[derive(Clone, Copy, Debug, Default)]
struct Contacts {
    count: u64,
    sum: f64,
    largest: f64,
}

impl Contacts {
    fn and(self, other: Contacts) -> Contacts {
        Contacts {
            count: self.count + other.count,
            sum: self.sum + other.sum,
            largest: self.largest.max(other.largest),
        }
    }

    fn approaches(self) -> Approaches {
        let mean = if self.count > 0 { self.sum / self.count as f64 } else { 0.0 };
        Approaches { count: self.count, mean, largest: self.largest }
    }
}

/// Integrals and extremes of a displacement.
#[derive(Clone, Copy, Debug)]
struct Moments {
    value: f64,
    square: f64,
    cos: f64,
    sin: f64,
    low: f64,
    high: f64,
}

impl Moments {
    const NONE: Moments =
        Moments { value: 0.0, square: 0.0, cos: 0.0, sin: 0.0, low: f64::INFINITY, high: f64::NEG_INFINITY };

    fn integrate(&mut self, weight: f64, value: f64, [cos, sin]: Phasor) {
        self.value += weight * value;
        self.square += weight * value * value;
        self.cos += weight * value * cos;
        self.sin += weight * value * sin;
    }

    fn include(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    /// Returns the averages over a time; 0 of a displacement that the oscillator does not have.
    fn over(&self, time: f64) -> Displacement {
        if self.high < self.low {
            return Displacement::default();
        }
        let [cos, sin] = [self.cos, self.sin].map(|x| 2.0 * x / time);
        Displacement {
            amplitude: 0.5 * (self.high - self.low),
            mean: self.value / time,
            rms: (self.square / time).sqrt(),
            harmonic: [cos.hypot(sin), (-sin).atan2(cos)],
        }
    }
}

/// Measures a trajectory from its events.
#[derive(Clone, Debug)]
pub(super) struct Meter<'f> {
    /// The flow of the present stage and interval.
    flow: &'f Flow,
    /// The flow of the present stage, in all intervals.
    stage: &'f Flow,
    /// The present interval between walls.
    interval: i32,
    schedule: Schedule<'f>,
    /// Domain, state and time since phase 0 at the beginning of the present flight.
    kind: DomainKind,
    q: Gap,
    t: f64,
    first_period: u64,
    period: u64,
    contacts: [Contacts; 2],
    lost: f64,
    dissipated: f64,
    displacements: [Moments; DISPLACEMENTS],
    force: Moments,
    contact_time: f64,
    sticking_time: f64,
    /// Energy that friction has turned into heat.
    heat: f64,
}

impl<'f> Meter<'f> {
    /// Begins at phase 0, at the present state of a trajectory.
    pub(super) fn new(flow: &'f Flow, trajectory: &Trajectory<'_>) -> Meter<'f> {
        let (schedule, stage) = Schedule::new(flow);
        let interval = trajectory.interval();
        let flow = stage.interval(interval);
        Meter {
            flow,
            stage,
            interval,
            schedule,
            kind: trajectory.domain(),
            q: flow.to_gap(trajectory.state()),
            t: 0.0,
            first_period: trajectory.period(),
            period: trajectory.period(),
            contacts: Default::default(),
            lost: 0.0,
            dissipated: 0.0,
            displacements: [Moments::NONE; DISPLACEMENTS],
            force: Moments::NONE,
            contact_time: 0.0,
            sticking_time: 0.0,
            heat: 0.0,
        }
    }

    /// Advances a trajectory by `periods` forcing periods and measures it.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub(super) fn measure(
        flow: &'f Flow,
        trajectory: &mut Trajectory<'_>,
        periods: u32,
    ) -> Result<Quantities, Stop> {
        let mut meter = Meter::new(flow, trajectory);
        for _ in 0..periods {
            trajectory.advance_period(&mut meter)?;
        }
        Ok(meter.finish(trajectory.period()))
    }

    /// Measures a period of contact-free motion in its steady state.
    ///
    /// # Errors
    /// As for [`Meter::measure`].
    pub(super) fn measure_steady(
        flow: &'f Flow,
        law: Law,
        motion: &NonImpacting,
    ) -> Result<Quantities, Stop> {
        Meter::measure(flow, &mut Trajectory::new(flow, law, motion.steady()), 1)
    }

    /// Returns the quantities from the beginning to phase 0 of `period`.
    pub(super) fn finish(mut self, period: u64) -> Quantities {
        if self.flow.machine.is_none() {
            self.complete_periods(period);
        }
        let time = (period - self.first_period) as f64 * self.flow.period;
        let [right, left] = self.contacts;
        let has_friction = self.flow.machine.as_ref().is_some_and(|system| system.has_friction());
        Quantities {
            approaches: [right, left, right.and(left)].map(Contacts::approaches),
            impact_energy: self.lost / time,
            contact_force: (self.contact_time > 0.0)
                .then(|| [self.force.high, (self.force.square / self.contact_time).sqrt()]),
            displacements: self.displacements.map(|moments| moments.over(time)),
            dissipated: self.dissipated / time,
            friction: has_friction.then(|| FrictionQuantities {
                sticking: self.sticking_time / time,
                dissipated: self.heat / time,
            }),
        }
    }

    /// Continues the present flight to phase 0 of `period`.
    fn complete_periods(&mut self, period: u64) {
        while self.period < period {
            self.fly_to(self.flow.period);
            self.t = 0.0;
            let first = self.schedule.restart();
            self.enter_stage(first);
            self.period += 1;
        }
    }

    /// Measures the present flight up to a time since phase 0. Changes of the stage at that time are still to come.
    fn fly_to(&mut self, until: f64) {
        while let Some(change) = self.schedule.next_change().filter(|&change| change < until) {
            if change > self.t {
                self.q = self.fly(change - self.t);
                self.t = change;
            }
            let next = self.schedule.change();
            self.enter_stage(next);
        }
        if until > self.t {
            self.q = self.fly(until - self.t);
        }
        self.t = until;
    }

    fn enter_stage(&mut self, stage: &'f Flow) {
        (self.stage, self.flow) = (stage, stage.interval(self.interval));
    }

    /// Measures the present flight over a time within one stage, and returns its end.
    fn fly(&mut self, duration: f64) -> Gap {
        let (flow, kind) = (self.flow, self.kind);
        let linear = flow.domain(kind);
        let pieces = (duration * linear.per_unit).ceil().max(1.0);
        let piece = duration / pieces;
        let mut q = self.q;
        for i in 0..pieces as u64 {
            let (sin, cos) = (flow.omega * (self.t + i as f64 * piece)).sin_cos();
            q = self.fly_piece(&Piece { linear, q, phasor: [cos, sin], length: piece });
        }
        q
    }

    /// Measures a piece of at most one Taylor step, and returns its end.
    fn fly_piece(&mut self, piece: &Piece<'_>) -> Gap {
        let mut before = (0.0, piece.q, piece.phasor);
        self.include(&before.1);
        for (share, weight) in nodes() {
            let (q, phasor) = piece.at(share);
            self.integrate(weight * piece.length, &q, phasor);
            self.find_extremes(piece, &before, &(share, q, phasor));
            before = (share, q, phasor);
        }
        let (end, phasor) = piece.at(1.0);
        self.include(&end);
        self.find_extremes(piece, &before, &(1.0, end, phasor));
        end
    }

    fn integrate(&mut self, weight: f64, q: &Gap, phasor: Phasor) {
        let [x1, v1, x2, v2] = self.flow.displacements(*q);
        for (moments, value) in self.displacements.iter_mut().zip([x1, x2, q[0]]) {
            moments.integrate(weight, value, phasor);
        }
        let [[c1, c], [_, c2]] = self.flow.dissipation(self.kind);
        self.dissipated += weight * (c1 * v1 * v1 + 2.0 * c * v1 * v2 + c2 * v2 * v2);
        if let Some(force) = self.compliant_force(q) {
            self.force.square += weight * force * force;
            self.contact_time += weight;
        }
    }

    /// Includes a state in the extremes.
    fn include(&mut self, q: &Gap) {
        let [x1, _, x2, _] = self.flow.displacements(*q);
        for (moments, value) in self.displacements.iter_mut().zip([x1, x2, q[0]]) {
            moments.include(value);
        }
        if let Some(force) = self.compliant_force(q) {
            self.force.include(force);
        }
    }

    /// Includes the extremes between two instants of a piece.
    fn find_extremes(&mut self, piece: &Piece<'_>, from: &Instant, to: &Instant) {
        for which in 0..4 {
            let rate = |(_, q, phasor): &Instant| self.rate(which, piece.linear, q, phasor);
            if rate(from) * rate(to) < 0.0 {
                let extreme = piece.root(from.0, to.0, rate);
                self.include(&extreme);
            }
        }
    }

    /// Returns the rate of a displacement, of the gap, or of the contact force.
    fn rate(&self, which: usize, linear: &LinearFlow, q: &Gap, phasor: &Phasor) -> f64 {
        match which {
            0 | 1 => self.flow.displacements(*q)[2 * which + 1],
            2 => q[1],
            _ => self
                .flow
                .contact_force(self.kind)
                .map_or(0.0, |force| force.rate(q, linear.acceleration(q, phasor))),
        }
    }

    /// Returns the force of the compliant contacts, positive if it presses.
    fn compliant_force(&self, q: &Gap) -> Option<f64> {
        let side = match self.kind {
            DomainKind::Meshing(side) => side,
            DomainKind::Free => side_of(self.interval),
        };
        self.flow.contact_force(self.kind).map(|force| side.sign() * force.at(q))
    }

    /// Returns the energy of a wall's spring and preload at an event.
    fn stored(&self, event: &GapEvent) -> f64 {
        let (side, flow) = (event.side, self.flow);
        let depth = event.before[0] - flow.wall(side);
        let of_spring = 0.5 * flow.wall_force(side)[0] * depth * depth;
        match flow.oscillator.preload(side) {
            0.0 => of_spring,
            preload => of_spring + preload * depth.abs(),
        }
    }

    /// Counts the energy that a contact takes at an instant.
    fn contact(&mut self, event: &GapEvent) {
        let (side, flow) = (event.side, self.flow);
        let kinetic = |w: f64| 0.5 * w * w / flow.compliance();
        if event.kind == EventKind::MeshEnd {
            self.lost += self.stored(event);
        } else if flow.contacts[side.index()].is_elastic() {
            self.lost -= self.stored(event);
        } else {
            if event.ends_series {
                // The series has taken the energy with which the gap left the wall.
                self.lost += kinetic(self.q[1]);
                return;
            }
            let approach = side.sign() * event.before[1];
            self.lost += kinetic(approach) - kinetic(event.after[1]);
            let of_side = &mut self.contacts[side.index()];
            *of_side = of_side.and(Contacts { count: 1, sum: approach, largest: approach });
        }
    }
}

impl Observer for Meter<'_> {
    fn event(&mut self, event: &GapEvent) {
        self.complete_periods(event.period);
        let duration = event.t - self.t;
        if event.ends_series {
            // The gap stays closed during the series. The error of the midpoint rule is of third order in its short
            // duration.
            let (begin, end) = (self.q, event.after);
            let middle = [end[0], end[1], 0.5 * (begin[2] + end[2]), 0.5 * (begin[3] + end[3])];
            let (sin, cos) = (self.flow.omega * (self.t + 0.5 * duration)).sin_cos();
            self.integrate(duration, &middle, [cos, sin]);
        } else {
            self.fly_to(event.t);
        }
        if event.interval == self.interval {
            self.contact(event);
        }
        self.kind = match event.kind {
            EventKind::MeshStart if event.interval == self.interval => DomainKind::Meshing(event.side),
            _ => DomainKind::Free,
        };
        self.interval = event.interval;
        self.flow = self.stage.interval(self.interval);
        self.q = event.after;
        self.t = event.t;
        self.include(&event.after);
    }

    fn measures(&self) -> bool {
        true
    }

    fn machine_event(&mut self, event: &MachineEvent) {
        let system = self.flow.machine.as_ref();
        let has_impacts = system.is_some_and(|system| system.has_impacts(event.gap, event.side, event.wall));
        if has_impacts && event.kind != EventKind::MeshEnd {
            let approach = event.side.sign() * event.rates[0];
            let of_side = &mut self.contacts[event.side.index()];
            *of_side = of_side.and(Contacts { count: 1, sum: approach, largest: approach });
        }
    }

    fn machine_loss(&mut self, energy: f64) {
        self.lost += energy;
    }

    fn machine_flight(&mut self, flight: &Flight<'_>) {
        let (displacements, forces) = (flight.displacements(), flight.contact_forces());
        let mut before: Option<(f64, Point)> = None;
        for (share, weight) in nodes().into_iter().chain([(1.0, 0.0)]) {
            let point = flight.at(share);
            let (sin, cos) = (self.flow.omega * (flight.start + share * flight.duration)).sin_cos();
            let weight = weight * flight.duration;
            for (place, signal) in &displacements {
                let moments = &mut self.displacements[*place];
                moments.integrate(weight, signal.at(&point), [cos, sin]);
            }
            self.dissipated += weight * flight.dissipation(&point);
            self.heat += weight * flight.heat(&point);
            for signal in &forces {
                self.force.square += weight * signal.at(&point).powi(2);
                self.contact_time += weight;
            }
            if flight.sticks() {
                self.sticking_time += weight;
            }
            let (start, from) = before.unwrap_or_else(|| (0.0, flight.at(0.0)));
            let include = |moments: &mut Moments, signal: &Signal| {
                moments.include(signal.at(&from));
                moments.include(signal.at(&point));
                if signal.rate(&from) * signal.rate(&point) < 0.0 {
                    let rate = |share: f64| signal.rate(&flight.at(share));
                    moments.include(signal.at(&flight.at(root(start, share, rate))));
                }
            };
            displacements.iter().for_each(|(place, signal)| include(&mut self.displacements[*place], signal));
            for signal in &forces {
                include(&mut self.force, signal);
            }
            before = Some((share, point));
        }
    }
}

/// Returns nodes and weights of the quadrature on `[0, 1]`.
fn nodes() -> [(f64, f64); 8] {
    std::array::from_fn(|i| {
        let (node, weight) = if i < 4 { GAUSS[3 - i] } else { GAUSS[i - 4] };
        (0.5 + 0.5 * if i < 4 { -node } else { node }, 0.5 * weight)
    })
}

/// Time as a share of a piece, state and phasor.
type Instant = (f64, Gap, Phasor);

/// A part of a flight, at most one Taylor step long.
struct Piece<'f> {
    linear: &'f LinearFlow,
    q: Gap,
    phasor: Phasor,
    length: f64,
}

impl Piece<'_> {
    fn at(&self, share: f64) -> (Gap, Phasor) {
        let u = share * self.length * self.linear.per_unit;
        let expansion = self.linear.grid.expansion(&self.q, &self.phasor, u);
        let v = u - expansion.start;
        (expansion.state(v), expansion.phasor(self.linear.turn * v))
    }

    /// Returns the state at a zero of `rate` between two instants at which it has opposite signs.
    fn root(&self, a: f64, b: f64, rate: impl Fn(&Instant) -> f64) -> Gap {
        let of = |share| {
            let (q, phasor) = self.at(share);
            rate(&(share, q, phasor))
        };
        self.at(root(a, b, of)).0
    }
}

/// Returns a zero of a function between two numbers at which it has opposite signs, by the method of regula falsi with Anderson and
/// Bjorck's weights (BIT 13, 1973).
fn root(mut a: f64, mut b: f64, of: impl Fn(f64) -> f64) -> f64 {
    let (mut fa, mut fb) = (of(a), of(b));
    let mut best = a;
    for _ in 0..EXTREME_ITERATIONS {
        let c = b - fb * (b - a) / (fb - fa);
        let fc = of(c);
        best = c;
        if fc == 0.0 || (c - b).abs() <= f64::EPSILON {
            break;
        }
        if fc * fb < 0.0 {
            (a, fa) = (b, fb);
        } else {
            let weight = 1.0 - fc / fb;
            fa *= if weight > 0.0 { weight } else { 0.5 };
        }
        (b, fb) = (c, fc);
    }
    best
}
