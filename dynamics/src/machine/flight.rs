//! Integrals and extremes over a flight of a machine.

use nalgebra::DVector;

use super::PhasePoint;
use super::domain::{DomainKey, Functional, LinearDomain, Path};
use super::frame::{Element, Frame};
use super::modes::{Modes, signed};
use crate::model::{MOST_FRICTION, Side, Signal};
use crate::motion::Slip;
use crate::motion::{Moments, Sums, nodes, place_of_displacement, place_of_gap, place_of_signal, root};

/// Part of a flight: one domain, at most one Taylor step.
pub(super) struct Flight<'a> {
    pub(super) system: &'a Frame,
    pub(super) domain: &'a LinearDomain,
    pub(super) modes: &'a Modes,
    pub(super) path: &'a Path,
    /// The share of the step at which the flight ends.
    pub(super) share: f64,
    /// Duration, and time of the start since phase 0.
    pub(super) duration: f64,
    pub(super) start: f64,
}

/// A linear function of the motion and of time, and its rate.
struct Measured {
    value: Functional,
    rate: Functional,
    /// Minus a drift: its value at the start of the flight, and its rate.
    drift: [f64; 2],
}

impl Measured {
    /// Returns the value at a point, which is reached after a time.
    fn at(&self, point: &PhasePoint, after: f64) -> f64 {
        self.value.dot(point) + (self.drift[0] + self.drift[1] * after)
    }

    fn rate(&self, point: &PhasePoint) -> f64 {
        self.rate.dot(point) + self.drift[1]
    }
}

impl Flight<'_> {
    /// Adds the flight to integrals and extremes.
    pub(super) fn add_to(&self, sums: &mut Sums) {
        let (displacements, forces) = (self.displacements(sums), self.contact_forces());
        let mut before: Option<(f64, PhasePoint)> = None;
        for (share, weight) in nodes().into_iter().chain([(1.0, 0.0)]) {
            let point = self.at(share);
            let (sin, cos) = (self.system.machine.omega * (self.start + share * self.duration)).sin_cos();
            let (weight, after) = (weight * self.duration, share * self.duration);
            for (place, signal) in &displacements {
                let moments = &mut sums.displacements[*place];
                moments.integrate(weight, signal.at(&point, after), [cos, sin]);
            }
            sums.dissipated += weight * self.dissipation(&point);
            sums.heat += weight * self.heat(&point);
            for (gap, signal) in &forces {
                let square = weight * signal.at(&point, after).powi(2);
                sums.force.square += square;
                sums.contact_time += weight;
                sums.gaps[*gap].force.square += square;
                sums.gaps[*gap].force_time += weight;
            }
            if self.sticks() {
                sums.sticking_time += weight;
            }
            let (start, from) = before.unwrap_or_else(|| (0.0, self.at(0.0)));
            let include = |moments: &mut Moments, signal: &Measured| {
                moments.include(signal.at(&from, start * self.duration));
                moments.include(signal.at(&point, after));
                if signal.rate(&from) * signal.rate(&point) < 0.0 {
                    let rate = |share: f64| signal.rate(&self.at(share));
                    let extreme = root(start, share, rate);
                    moments.include(signal.at(&self.at(extreme), extreme * self.duration));
                }
            };
            displacements.iter().for_each(|(place, signal)| include(&mut sums.displacements[*place], signal));
            for (gap, signal) in &forces {
                include(&mut sums.gaps[*gap].force, signal);
            }
            before = Some((share, point));
        }
        for (gap, of_gap) in sums.gaps.iter_mut().enumerate().take(self.system.gaps()) {
            if self.system.contact(self.modes, gap).is_some() {
                of_gap.contact_time += self.duration;
            }
            sums.force.high = sums.force.high.max(of_gap.force.high);
        }
    }

    /// Returns the point after a share of the flight.
    fn at(&self, share: f64) -> PhasePoint {
        self.domain.point(self.path, self.share * share)
    }

    fn signal(&self, value: Functional) -> Measured {
        Measured { rate: self.domain.rate_of(&value), value, drift: [0.0; 2] }
    }

    /// Returns all displacements, gaps and signals, by their places in [`Quantities::displacements`](crate::orbit::Quantities::displacements).
    fn displacements(&self, sums: &Sums) -> Vec<(usize, Measured)> {
        let displacements = (0..self.system.machine().degrees())
            .map(|i| (place_of_displacement(i), self.system.displacement_row(i)));
        let gaps = (0..self.system.gaps()).map(|gap| (place_of_gap(gap), self.domain.unit_row(gap)));
        let signals = self.system.machine.signals.iter().enumerate();
        let signals = signals.map(|(i, own)| (place_of_signal(i), self.system.signal_row(own, self.domain)));
        let all = displacements.chain(gaps).chain(signals);
        let mut all: Vec<_> = all.map(|(place, row)| (place, self.signal(row))).collect();
        for (mode, drift) in self.system.rigid_modes.modes.iter().zip(&sums.drifts) {
            let ahead = drift.ahead - drift.rate * self.start;
            for (place, signal) in &mut all {
                let along = mode.along(*place, &self.system.machine.signals);
                signal.drift[0] += along * ahead;
                signal.drift[1] -= along * drift.rate;
            }
        }
        all
    }

    /// Returns the gaps with compliant contact and its force, positive where it pushes.
    fn contact_forces(&self) -> Vec<(usize, Measured)> {
        let key = self.modes.key(self.system);
        let engaged = (0..self.system.gaps()).filter(|&gap| key.engaged[gap] != 0);
        engaged.map(|gap| (gap, self.signal(self.system.compliant_force(&key, gap)))).collect()
    }

    /// Returns the power that all dampers dissipate at a point.
    fn dissipation(&self, point: &PhasePoint) -> f64 {
        let n = self.system.n;
        let rates = &point[n..2 * n];
        (0..n).map(|i| rates[i] * (0..n).map(|j| self.domain.damping[(i, j)] * rates[j]).sum::<f64>()).sum()
    }

    /// Returns the power that dry friction turns into heat at a point.
    fn heat(&self, point: &PhasePoint) -> f64 {
        let elements = self.system.elements.iter().enumerate().zip(self.modes.slips);
        let power = |((i, element), slip): ((usize, &Element), Slip)| {
            let rate = slip.sign() * self.system.rate_row(i).dot(point);
            element.curve.at(rate) * rate
        };
        elements.map(power).sum()
    }

    fn sticks(&self) -> bool {
        self.system.elements.iter().zip(self.modes.slips).any(|(_, slip)| slip == Slip::Stick)
    }
}

impl Frame {
    /// Returns the row of a displacement; 0 if the machine has no such displacement.
    fn displacement_row(&self, i: usize) -> Functional {
        let mut row = Functional::zero(self.width());
        if i < self.degrees() {
            (0..self.n).for_each(|j| row.0[j] = self.from_flow[(i, j)]);
        }
        row
    }

    /// Returns the row of a signal in a domain.
    pub(super) fn signal_row(&self, signal: &Signal, domain: &LinearDomain) -> Functional {
        let (n, mut row) = (self.n, Functional::zero(self.width()));
        let factors = |own: &DVector<f64>| self.from_flow.transpose() * own;
        row.0[..n].copy_from_slice(factors(&signal.displacement).as_slice());
        row.0[n..2 * n].copy_from_slice(factors(&signal.velocity).as_slice());
        for (factor, acceleration) in factors(&signal.acceleration).iter().zip(&domain.accelerations) {
            row.0.iter_mut().zip(acceleration.0).for_each(|(row, x)| *row += factor * x);
        }
        if signal.waves != [0.0; 2] {
            // The first harmonic comes first.
            row.0[2 * n] += signal.waves[0];
            row.0[2 * n + 1] += signal.waves[1];
        }
        row.plus(signal.constant, self.width())
    }

    /// Returns the row of the force of a gap's compliant contacts, positive where it pushes.
    pub(super) fn compliant_force(&self, key: &DomainKey, gap: usize) -> Functional {
        let side = if key.engaged[gap] > 0 { Side::Right } else { Side::Left };
        let (sign, mut row) = (side.sign(), Functional::zero(self.width()));
        for wall in &self.walls(gap, side)[..usize::from(key.engaged[gap].unsigned_abs())] {
            let spring = wall.springs[key.stage];
            row.0[gap] += sign * spring.stiffness;
            row.0[self.n + gap] += sign * spring.damping;
            row = row.plus(spring.force_at_wall() - sign * spring.stiffness * wall.at, self.width());
        }
        let is_last = key.engaged[gap] == signed(side, self.walls(gap, side).len());
        if let Some(i) = self.curve_of_wall(gap, side).filter(|_| is_last) {
            let [slope, force] = self.springs[i - MOST_FRICTION].curve.pieces[usize::from(key.pieces[i])];
            row.0[gap] += sign * slope;
            row = row.plus(force, self.width());
        }
        row
    }

    /// Returns the energy that springs and preload of a wall hold in a stage, for a gap `z` behind the wall.
    pub(super) fn stored(&self, stage: usize, gap: usize, side: Side, number: usize, z: f64) -> f64 {
        let walls = self.walls(gap, side);
        let curve = self.curve_of_wall(gap, side).filter(|_| number + 1 == walls.len());
        let of_curve = curve.map_or(0.0, |i| {
            let sign = side.sign();
            self.springs[i - MOST_FRICTION].curve.integral(sign * walls[number].at, sign * z)
        });
        walls[number].stored(stage, side, z) + of_curve
    }

    /// Returns the part of the energy that events change: kinetic energy, and the energy of springs and preloads of contacts.
    pub(super) fn energy(&self, modes: &Modes, y: &[f64]) -> f64 {
        let (n, key) = (self.n, modes.key(self));
        let rates = &y[n..2 * n];
        let kinetic: f64 =
            (0..n).map(|i| rates[i] * (0..n).map(|j| self.mass[(i, j)] * rates[j]).sum::<f64>()).sum();
        let of_gap = |gap: usize| {
            let side = if key.engaged[gap] > 0 { Side::Right } else { Side::Left };
            let numbers = 0..usize::from(key.engaged[gap].unsigned_abs());
            numbers.map(|number| self.stored(modes.stage, gap, side, number, y[gap])).sum::<f64>()
        };
        0.5 * kinetic + (0..self.gaps()).map(of_gap).sum::<f64>()
    }

    pub(crate) fn has_friction(&self) -> bool {
        !self.elements.is_empty()
    }
}
