//! Flows under dry friction.
//!
//! Each element slides in one of two directions or sticks. A sliding element adds a constant load. A sticking element keeps its sliding
//! rate `R` at 0 by a force along its row. In either case the motion is linear, so each combination of modes has a [`Flow`] of its
//! own:
//!
//! ```text
//! R = row . v - speed
//! M x'' + C x' + K x = forces - row F
//! slides: F = force sgn R           sticks: F = (row . a) / (row M^-1 row),   |F| <= force
//! ```
//!
//! where `a` is the acceleration without `F`. Other elements that stick, and a rigid wall on which the gap rests, are constraints, too:
//! they reduce the mobility `M^-1` to the directions that remain free.
//!
//! # Bounds
//!
//! A constraint does no work on the derivatives of a motion, because their rate along its row is 0. So the energy bounds of
//! [`crate::flow`] hold for every combination of modes, and bound the sixth derivatives of `R` and of `F`.

use nalgebra::{Matrix2, RowVector2, Vector2};

use super::energy::EnergyBound;
use super::generator::{Generator, generator};
use super::row::Row;
use super::{DomainKind, Flow, Gap, LinearFlow, Phasor, Step, displacement_matrix};
use crate::certificate::Bernstein;
use crate::model::{Contact, Domain, Friction, MOST_FRICTION, Oscillator, Side};

/// A mobility below this share of the unconstrained one is rounding: other constraints already hold the row.
const NO_MOBILITY: f64 = 1e-12;

/// Rounding error of a rate or of a force, relative to the size of its terms.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The mode of an element with dry friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Slip {
    /// The sliding rate stays 0.
    #[default]
    Stick,
    /// The sliding rate is positive.
    Forward,
    /// The sliding rate is negative.
    Backward,
}

/// The modes of all elements. Places without an element stay at [`Slip::Stick`].
pub type Slips = [Slip; MOST_FRICTION];

impl Slip {
    /// All modes, in the order in which they are tried.
    pub(crate) const ALL: [Slip; 3] = [Slip::Stick, Slip::Forward, Slip::Backward];

    /// Returns the direction of sliding, 0 for sticking.
    pub(crate) fn sign(self) -> f64 {
        match self {
            Slip::Stick => 0.0,
            Slip::Forward => 1.0,
            Slip::Backward => -1.0,
        }
    }

    /// Returns the direction of a rate that is not 0.
    pub(crate) fn of(rate: f64) -> Slip {
        if rate > 0.0 { Slip::Forward } else { Slip::Backward }
    }

    pub(crate) fn mirrored(self) -> Slip {
        match self {
            Slip::Stick => Slip::Stick,
            Slip::Forward => Slip::Backward,
            Slip::Backward => Slip::Forward,
        }
    }
}

/// An element in gap coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    /// Factors of `(w, v)` in the sliding rate.
    pub(crate) row: [f64; 2],
    pub(crate) force: f64,
    pub(crate) speed: f64,
    /// Whether a contact impulse changes the sliding rate.
    pub(crate) feels_contacts: bool,
    friction: Friction,
}

impl Element {
    fn new(oscillator: &Oscillator, friction: &Friction) -> Element {
        let back = displacement_matrix(oscillator).try_inverse().expect("the gap row is not zero");
        let [a, b] = friction.row;
        let row = (RowVector2::new(a, b) * back).into();
        let [by_gap, other] = oscillator.accelerations(oscillator.gap);
        let change = a * by_gap + b * other;
        Element {
            row,
            force: friction.force,
            speed: friction.speed,
            feels_contacts: change.abs() > NO_MOBILITY * ((a * by_gap).abs() + (b * other).abs()),
            friction: *friction,
        }
    }

    /// Returns the sliding rate.
    pub(crate) fn rate(&self, q: &Gap) -> f64 {
        self.row[0] * q[1] + self.row[1] * q[3] - self.speed
    }

    /// Whether the element holds the gap at rest while it sticks.
    fn holds_gap(&self) -> bool {
        self.row[1] == 0.0 && self.speed == 0.0
    }

    /// Sets the sliding rate to 0 by rounding errors. At rest on a wall, `w` must not change.
    pub(crate) fn put_at_rest(&self, q: &mut Gap, keeps_w: bool) {
        let [a, b] = self.row;
        if b == 0.0 && !keeps_w {
            q[1] = self.speed / a;
        } else if b != 0.0 && (keeps_w || b.abs() > a.abs()) {
            q[3] = (self.speed - a * q[1]) / b;
        } else if !keeps_w {
            q[1] = (self.speed - b * q[3]) / a;
        }
    }

    /// Projects a tangent vector like [`put_at_rest`](Self::put_at_rest).
    pub(crate) fn project(&self, u: &mut Gap, keeps_w: bool) {
        Element { speed: 0.0, ..self.clone() }.put_at_rest(u, keeps_w);
    }
}

/// The flows of all combinations of modes, in one stage and one interval between walls.
#[derive(Clone, Debug)]
pub(crate) struct FrictionFlows {
    pub(crate) elements: Vec<Element>,
    flows: Vec<Flow>,
}

fn index(slips: Slips) -> usize {
    slips.iter().rev().fold(0, |index, &slip| 3 * index + slip as usize)
}

impl FrictionFlows {
    /// Builds the flows; none if no element has a force.
    pub(super) fn new(flow: &Flow) -> Option<FrictionFlows> {
        let oscillator = &flow.oscillator;
        let with_force = oscillator.friction.iter().filter(|friction| friction.force > 0.0);
        let elements: Vec<Element> = with_force.map(|friction| Element::new(oscillator, friction)).collect();
        if elements.is_empty() {
            return None;
        }
        let count = 3usize.pow(elements.len() as u32);
        let slips = |n: usize| [Slip::ALL[n % 3], Slip::ALL[n / 3]];
        let flows = (0..count).map(|n| flow_of(flow, &elements, slips(n))).collect();
        Some(FrictionFlows { elements, flows })
    }

    pub(crate) fn flow(&self, slips: Slips) -> &Flow {
        &self.flows[index(slips)]
    }

    pub(super) fn bytes(&self) -> usize {
        self.flows.iter().map(Flow::bytes).sum()
    }
}

/// Builds the flow of one combination of modes.
fn flow_of(flow: &Flow, elements: &[Element], slips: Slips) -> Flow {
    let o = &flow.oscillator;
    let modes = || elements.iter().zip(slips);
    let loaded = |is_at_rest: bool| {
        let mut loaded = Oscillator { friction: Vec::new(), ..o.clone() };
        for (element, slip) in modes().filter(|(element, _)| !(is_at_rest && element.holds_gap())) {
            let domains = [&mut loaded.free].into_iter().chain(&mut loaded.meshing);
            domains.for_each(|domain| {
                let friction = element.friction;
                domain.load = [0, 1].map(|i| domain.load[i] - slip.sign() * friction.force * friction.row[i]);
            });
        }
        loaded
    };
    let (moving, at_rest) = (loaded(false), loaded(true));
    let sticking = |skip: Option<usize>, is_at_rest: bool| {
        let sticks = move |&(i, (element, slip)): &(usize, (&Element, Slip))| {
            slip == Slip::Stick && Some(i) != skip && !(is_at_rest && element.holds_gap())
        };
        modes().enumerate().filter(sticks).map(|(_, (element, _))| element.row).collect::<Vec<_>>()
    };
    let held = |domain: &Domain| {
        let rows = sticking(None, false);
        match rows.is_empty() {
            true => LinearFlow::new(&moving, domain),
            false => LinearFlow::held(&moving, domain, Constrained::by(&moving, domain, &rows).generator),
        }
    };
    let free = held(&moving.free);
    let is_rigid =
        |side: Side| flow.walls[side.index()].is_finite() && flow.contacts[side.index()] == Contact::Rigid;
    let behind = |side: Side| {
        let rows = sticking(None, true);
        match () {
            () if flow.walls[side.index()].is_infinite() => free.clone(),
            () if !is_rigid(side) => held(&moving.meshing[side.index()]),
            () if rows.is_empty() => LinearFlow::on_rigid_wall(&at_rest, flow.kick),
            () => {
                let mut constrained = Constrained::by(&at_rest, &at_rest.free, &rows);
                let pressing = constrained.generator.row(1);
                constrained.hold([1.0, 0.0]);
                LinearFlow::at_rest(&at_rest, constrained.generator, pressing)
            }
        }
    };
    let meshing = Side::BOTH.map(behind);
    let watches = |kind: DomainKind, linear: &LinearFlow| {
        let rest = matches!(kind, DomainKind::Meshing(side) if is_rigid(side));
        let (oscillator, domain) = match kind {
            DomainKind::Meshing(side) if !rest => (&moving, &moving.meshing[side.index()]),
            DomainKind::Meshing(_) => (&at_rest, &at_rest.free),
            DomainKind::Free => (&moving, &moving.free),
        };
        let watch = |(i, (element, slip)): (usize, (&Element, Slip))| {
            if rest && element.holds_gap() {
                return None;
            }
            if slip != Slip::Stick {
                return Some(Watch::of_rate(element, linear, oscillator, domain));
            }
            let mut others = Constrained::by(oscillator, domain, &sticking(Some(i), rest));
            if rest {
                others.hold([1.0, 0.0]);
            }
            Some(Watch::new(others.force(element.row)?, linear, oscillator, domain))
        };
        modes().enumerate().map(watch).collect::<Vec<_>>()
    };
    let exists = |side: Side| flow.walls[side.index()].is_finite();
    let of_walls = Side::BOTH.map(|side| match exists(side) {
        true => watches(DomainKind::Meshing(side), &meshing[side.index()]),
        false => Vec::new(),
    });
    let [right, left] = of_walls;
    let watches = [watches(DomainKind::Free, &free), right, left];
    // A force along the gap row moves only what the sticking elements leave free.
    let mobility = Constrained::by(&moving, &moving.free, &sticking(None, false)).mobility;
    let [on_gap, on_other] = [mobility[(0, 0)], mobility[(1, 0)]];
    let stuck = || modes().filter(|&(_, slip)| slip == Slip::Stick).map(|(element, _)| element);
    let damping = |side: Side| match flow.contacts[side.index()].is_elastic() {
        true => o.wall_stiffness_and_damping(side)[1],
        false => 0.0,
    };
    Flow {
        dampers: Side::BOTH.map(|side| [on_gap, on_other].map(|moves| damping(side) * moves)),
        preloads: Side::BOTH
            .map(|side| [on_gap, on_other].map(|moves| side.sign() * o.preload(side) * moves)),
        sticks: stuck().next().is_some(),
        holds_gap: stuck().any(Element::holds_gap)
            || mobility[(0, 0)] == 0.0 && stuck().all(|element| element.speed == 0.0),
        watches: Some(Box::new(watches)),
        friction: None,
        non_impacting: None,
        free,
        meshing,
        behind: Default::default(),
        stages: Vec::new(),
        schedule: Vec::new(),
        ..flow.clone()
    }
}

/// Motion under constraints on rates, each of which holds a row of `(w, v)` still.
struct Constrained {
    generator: Generator,
    /// Changes of `(w, v)` by unit impulses along `z` and `x`, in the directions that are still free.
    mobility: Matrix2<f64>,
    held: usize,
}

impl Constrained {
    fn by(oscillator: &Oscillator, domain: &Domain, rows: &[[f64; 2]]) -> Constrained {
        let d = displacement_matrix(oscillator);
        let mut constrained = Constrained {
            generator: generator(oscillator, domain),
            mobility: d * Matrix2::from(oscillator.inverse_mass()).transpose() * d.transpose(),
            held: 0,
        };
        rows.iter().for_each(|&row| constrained.hold(row));
        constrained
    }

    /// Returns the row of the force that would hold a row of rates still; none if it cannot move anyway.
    fn force(&self, row: [f64; 2]) -> Option<Row> {
        let along = self.mobility * Vector2::from(row);
        let mobility = along.dot(&Vector2::from(row));
        let size = self.mobility[(0, 0)] * row[0] * row[0] + self.mobility[(1, 1)] * row[1] * row[1];
        let accelerations = self.generator.row(1).scaled(row[0]).plus(row[1], &self.generator.row(3));
        (mobility > NO_MOBILITY * size).then(|| accelerations.scaled(mobility.recip()))
    }

    fn hold(&mut self, row: [f64; 2]) {
        let Some(force) = self.force(row) else { return };
        let along = self.mobility * Vector2::from(row);
        let mobility = along.dot(&Vector2::from(row));
        self.held += 1;
        let mut accelerations =
            [(1, along[0]), (3, along[1])].map(|(i, along)| self.generator.row(i).plus(-along, &force));
        // The held rate must not drift by rounding.
        let [a, b] = row;
        if self.held == 2 {
            accelerations = accelerations.map(|row| row.scaled(0.0));
        } else if a.abs() >= b.abs() {
            accelerations[0] = accelerations[1].scaled(-b / a);
        } else {
            accelerations[1] = accelerations[0].scaled(-a / b);
        }
        self.generator.set_accelerations(accelerations);
        self.mobility -= along * along.transpose() / mobility;
        // Rows of a rate that is held have no mobility at all.
        if self.held == 2 {
            self.mobility.fill(0.0);
        } else if b == 0.0 {
            self.mobility.set_row(0, &RowVector2::zeros());
            self.mobility.set_column(0, &Vector2::zeros());
        } else if a == 0.0 {
            self.mobility.set_row(1, &RowVector2::zeros());
            self.mobility.set_column(1, &Vector2::zeros());
        }
    }
}

/// The function whose root ends the mode of an element: the sliding rate, or the force that holds it.
#[derive(Clone, Debug)]
pub(crate) struct Watch {
    /// The function and its first two derivatives.
    rows: [Row; 3],
    /// Bounds on the parts of the sixth derivative that velocities and displacements contribute.
    bounds: [EnergyBound; 2],
    /// Bound on the part that the forcing contributes, scaled as the remainder of a quintic for a Taylor step.
    forced: f64,
}

impl Watch {
    fn of_rate(element: &Element, linear: &LinearFlow, oscillator: &Oscillator, domain: &Domain) -> Watch {
        let [a, b] = element.row;
        let no_waves = linear.acceleration_row().scaled(0.0);
        let base = [0.0, a, 0.0, b, 0.0, 0.0, -element.speed];
        Watch::new(Row { base, ..no_waves }, linear, oscillator, domain)
    }

    fn new(row: Row, linear: &LinearFlow, oscillator: &Oscillator, domain: &Domain) -> Watch {
        let [slope, curvature] = linear.derivatives(&row);
        let d = displacement_matrix(oscillator);
        let along = |on_gap: f64, on_other: f64| (RowVector2::new(on_gap, on_other) * d).into();
        let omega = oscillator.omega;
        let [.., cos, sin, _] = row.base;
        let waves =
            row.waves.iter().map(|&(order, [cos, sin])| cos.hypot(sin) * (omega * f64::from(order)).powi(6));
        let forced = cos.hypot(sin) * omega.powi(6) + waves.sum::<f64>();
        Watch {
            bounds: [
                linear.energy_bound(oscillator, domain, along(row.base[1], row.base[3]), 6),
                linear.energy_bound(oscillator, domain, along(row.base[0], row.base[2]), 5),
            ],
            forced: forced * linear.unit.powi(6) / 14400.0,
            rows: [row, slope, curvature],
        }
    }

    /// Returns a bound on the rounding error of the function.
    pub(crate) fn rounding(&self, q: &Gap) -> f64 {
        ROUNDING * self.rows[0].size(q)
    }

    /// Returns the derivatives of the function with respect to the gap coordinates.
    pub(crate) fn gradient(&self) -> Gap {
        let [z, w, x, v, ..] = self.rows[0].base;
        [z, w, x, v]
    }

    /// Returns the function and its first two derivatives.
    pub(crate) fn rates(&self, q: &Gap, phasor: &Phasor) -> [f64; 3] {
        self.rows.each_ref().map(|row| row.dot(q, phasor))
    }

    /// Returns the function over a step from a state, and the remainder of its quintic.
    pub(crate) fn ahead(&self, step: &Step, q: &Gap, phasor: &Phasor) -> (Bernstein, f64) {
        let (end, later) = step.end(q, phasor);
        let function = Bernstein::new(self.rates(q, phasor), self.rates(&end, &later), step.h);
        let of_state: f64 = self.bounds.iter().map(|bound| bound.remainder(q, phasor, step.u)).sum();
        (function, step.u6 * (of_state + self.forced))
    }
}

/// The functions that end the modes of all elements, in free motion and in contact with the right and the left wall. Friction along the gap
/// row is idle while the gap rests on a rigid wall, and has none.
pub(crate) type Watches = [Vec<Option<Watch>>; 3];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::tests::two_harmonics;
    use crate::model::GearPair;

    /// Returns the sixth derivative of a watched function after a time.
    fn sixth(watch: &Watch, linear: &LinearFlow, omega: f64, q: &Gap, phase: f64, tau: f64) -> f64 {
        let row = (0..6).fold(watch.rows[0].clone(), |row, _| linear.derivatives(&row)[0].clone());
        let (sin, cos) = phase.sin_cos();
        let later = linear.propagate(*q, [cos, sin], tau);
        let (sin, cos) = (phase + omega * tau).sin_cos();
        row.dot(&later, &[cos, sin])
    }

    #[test]
    fn sixth_derivatives_stay_within_their_bounds() {
        let good = GearPair::paper(0.5).oscillator().unwrap();
        let with = |damping, row: [f64; 2]| {
            let stiffness = [[30.0, 4.0], [4.0, 11.0]];
            let free = Domain { damping, stiffness, load: [1.0, -2.0], preload: 0.0 };
            let friction = vec![Friction { row, force: 3.0, speed: 0.4 }];
            Oscillator { mass: [[2.0, 0.6], [0.6, 1.0]], gap: [0.4, -1.3], free, friction, ..good.clone() }
        };
        let passive = [[2.0, -0.7], [-0.7, 0.9]];
        let rigid = Oscillator { contacts: [Contact::Rigid; 2], ..with(passive, [0.3, 0.8]) };
        let harmonics = Oscillator { harmonics: two_harmonics(), ..with(passive, [0.0, 1.0]) };
        let growing = with([[-1.0, 0.3], [0.3, 0.4]], [1.0, 0.5]);
        let mut largest = [0.0f64; 2];
        for oscillator in [with(passive, [1.0, 0.0]), rigid, harmonics, growing] {
            let flow = Flow::new(&oscillator);
            let element = &flow.friction()[0];
            for (slip, kind) in Slip::ALL
                .into_iter()
                .flat_map(|slip| [DomainKind::Free, DomainKind::Meshing(Side::Left)].map(|kind| (slip, kind)))
            {
                let modes = flow.in_modes([slip, Slip::Stick]);
                let linear = modes.domain(kind);
                let watch = modes.watches(kind)[0].as_ref().unwrap();
                for n in 0..500u32 {
                    let t = f64::from(n);
                    let size = 10f64.powf(-4.0 + 6.0 * (0.618 * t).fract());
                    let q: Gap = [2.0, 5.0, 2.0, 5.0].map(|x| x * size);
                    let mut q = std::array::from_fn(|i| q[i] * (t * (0.7 + 0.31 * i as f64)).sin());
                    let is_at_rest = kind != DomainKind::Free && oscillator.contacts[1] == Contact::Rigid;
                    if is_at_rest {
                        (q[0], q[1]) = (flow.wall(Side::Left), 0.0);
                    }
                    if slip == Slip::Stick {
                        element.put_at_rest(&mut q, is_at_rest);
                    }
                    let (sin, cos) = (0.9 * t).sin_cos();
                    for level in [linear.taylor_level, linear.taylor_level + 2] {
                        let step = linear.step(level).unwrap();
                        let bound = watch.ahead(step, &q, &[cos, sin]).1 * 14400.0;
                        for part in 0..=16 {
                            let tau = step.h * f64::from(part) / 16.0;
                            let derivative = sixth(watch, linear, oscillator.omega, &q, 0.9 * t, tau);
                            let value = derivative.abs() * step.h.powi(6);
                            // On a wall under friction nothing moves but the force.
                            let share = if value == 0.0 { 0.0 } else { value / bound };
                            assert!(share <= 1.0 + 1e-9, "{share} of the bound: {slip:?}, {kind:?}, {q:?}");
                            let is_rate = usize::from(slip != Slip::Stick);
                            largest[is_rate] = largest[is_rate].max(share);
                        }
                    }
                }
            }
        }
        assert!(largest.into_iter().all(|share| share > 0.2), "the bounds are not tight: {largest:?}");
    }
}
