//! Dry friction: sliding adds a constant load, and sticking a constraint to the accelerations.

use nalgebra::{Matrix2, RowVector2, Vector2};

use super::super::field::{Coordinates, Equations};
use super::{Ending, Flight, Mode};
use rattlemap_dynamics::flow::Gap;
use rattlemap_dynamics::model::{Contact, Friction, MOST_FRICTION, Oscillator, Side};
use rattlemap_dynamics::reference::EventKind;

/// Relative rounding error of rows.
const ROW_ROUNDING: f64 = 1e-12;

/// How the surfaces of an element move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sliding {
    /// The sliding rate stays 0.
    Sticks,
    /// The sliding rate is positive.
    Forwards,
    /// The sliding rate is negative.
    Backwards,
}

/// The modes of all elements. Places without an element stick.
pub(super) type Slidings = [Sliding; MOST_FRICTION];

impl Sliding {
    /// All modes, in the order in which they are tried.
    const ALL: [Sliding; 3] = [Sliding::Sticks, Sliding::Forwards, Sliding::Backwards];

    fn sign(self) -> f64 {
        match self {
            Sliding::Sticks => 0.0,
            Sliding::Forwards => 1.0,
            Sliding::Backwards => -1.0,
        }
    }

    fn of(rate: f64) -> Sliding {
        match rate {
            0.0 => Sliding::Sticks,
            _ if rate > 0.0 => Sliding::Forwards,
            _ => Sliding::Backwards,
        }
    }
}

/// A change of the mode of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    /// Time since phase 0.
    pub t: f64,
    /// The element, among those with a force.
    pub element: usize,
    /// Symbol of the change, if it has one.
    pub symbol: Option<u8>,
    /// Number of listed events at walls before it.
    pub after: usize,
}

/// An element in gap coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    /// Factors of `(w, v)` in the sliding rate.
    row: RowVector2<f64>,
    /// Changes of `(w, v)` by a unit impulse along the row.
    along: Vector2<f64>,
    pub(super) force: f64,
    speed: f64,
    /// Whether impacts change the sliding rate.
    is_kicked: bool,
}

impl Element {
    fn new(oscillator: &Oscillator, coordinates: &Coordinates, friction: &Friction) -> Element {
        let row = RowVector2::from(coordinates.rate_row(friction.row));
        let along = coordinates.per_force(oscillator) * Vector2::from(friction.row);
        let [by_gap, by_other] = [row[0], row[1] * coordinates.kick()];
        let is_kicked = (by_gap + by_other).abs() > ROW_ROUNDING * (by_gap.abs() + by_other.abs());
        Element { row, along, force: friction.force, speed: friction.speed, is_kicked }
    }

    /// Whether the row is parallel to that of the gap.
    fn is_of_gap(&self) -> bool {
        self.row[1] == 0.0
    }

    fn rate(&self, q: &Gap) -> f64 {
        self.row[0] * q[1] + self.row[1] * q[3] - self.speed
    }

    fn mobility(&self) -> f64 {
        (self.row * self.along)[0]
    }

    /// Returns the change of the sliding rate per time by the friction force.
    pub(super) fn friction_rate(&self) -> f64 {
        self.force * self.mobility()
    }
}

/// Returns the elements of an oscillator that have a force.
pub(super) fn elements(oscillator: &Oscillator, coordinates: &Coordinates) -> Vec<Element> {
    let with_force = oscillator.friction.iter().filter(|friction| friction.force > 0.0);
    with_force.map(|friction| Element::new(oscillator, coordinates, friction)).collect()
}

/// The equations of motion of one interval, stage and combination of modes. Fields are those of free motion, and of lasting contact
/// with the right and the left wall.
#[derive(Clone, Debug)]
pub(super) struct Domains {
    pub(super) fields: [Equations; 3],
    /// The gap's acceleration without the rigid wall on which it rests, with the friction forces of rest.
    pub(super) push: Equations,
    /// The forces that hold the elements.
    holds: [Equations; 3],
    /// Projections of velocities to those that the constraints leave free.
    admitted: [Matrix2<f64>; 3],
}

fn index(slidings: Slidings) -> usize {
    slidings.iter().rev().fold(0, |index, &sliding| 3 * index + sliding as usize)
}

/// Builds the equations of all combinations of modes. The wall is rigid where `behind` has no equations.
pub(super) fn domains(
    free: &Equations,
    behind: [Option<Equations>; 2],
    coordinates: &Coordinates,
    elements: &[Element],
) -> Vec<Domains> {
    let of_modes = |n: usize| {
        let slidings = [Sliding::ALL[n % 3], Sliding::ALL[n / 3]];
        let loaded = |field: &Equations, is_rigid: bool| {
            let is_idle = |element: &Element| is_rigid && element.is_of_gap() && element.speed == 0.0;
            let forces = elements.iter().zip(slidings).filter(|(element, _)| !is_idle(element));
            field.loaded(forces.map(|(e, sliding)| -sliding.sign() * e.force * e.along).sum())
        };
        let at_rest = Constraint::on_rigid_wall(elements, slidings, coordinates.kick());
        let moving = Constraint::between_walls(elements, slidings);
        let [right, left] = &behind;
        let of = |field: &Option<Equations>| match field {
            Some(field) => (loaded(field, false), &moving),
            None => (loaded(free, true), &at_rest),
        };
        let bare = [(loaded(free, false), &moving), of(right), of(left)];
        let friction: Matrix2<f64> = (0..elements.len())
            .map(|i| elements[i].along * at_rest.forces.row(i))
            .fold(Matrix2::zeros(), |sum, part| sum + part);
        Domains {
            push: loaded(free, true).times(&(Matrix2::identity() - friction)),
            holds: bare.each_ref().map(|(field, constraint)| field.times(&constraint.forces)),
            admitted: bare.each_ref().map(|(_, constraint)| constraint.admitted),
            fields: bare.map(|(field, constraint)| field.times(&constraint.admitted)),
        }
    };
    (0..3usize.pow(elements.len() as u32)).map(of_modes).collect()
}

/// Effect of constraints on given accelerations of gap and displacement.
struct Constraint {
    /// Rows of the forces that hold the elements.
    forces: Matrix2<f64>,
    /// The accelerations that remain.
    admitted: Matrix2<f64>,
}

impl Constraint {
    fn between_walls(elements: &[Element], slidings: Slidings) -> Constraint {
        let sticking: Vec<_> = (0..elements.len()).filter(|&i| slidings[i] == Sliding::Sticks).collect();
        let (mut forces, mut admitted) = (Matrix2::zeros(), Matrix2::identity());
        match sticking[..] {
            [] => {}
            [i] => {
                let Element { row, along, .. } = elements[i];
                let force = row / (row * along)[0];
                forces.set_row(i, &force);
                admitted -= along * force;
                if elements[i].is_of_gap() {
                    // The gap's rate must not drift by rounding.
                    admitted.set_row(0, &RowVector2::zeros());
                }
            }
            _ => {
                let along = Matrix2::from_columns(&[elements[0].along, elements[1].along]);
                forces = along.try_inverse().expect("rows of friction are independent");
                admitted.fill(0.0);
            }
        }
        Constraint { forces, admitted }
    }

    /// A wall holds the gap, and an element that sticks holds everything if its row is not that of the gap. Oscillators with a rigid wall
    /// have one element at most.
    fn on_rigid_wall(elements: &[Element], slidings: Slidings, kick: f64) -> Constraint {
        let on_wall = RowVector2::new(-kick, 1.0);
        let wall_alone = Matrix2::from_rows(&[RowVector2::zeros(), on_wall]);
        match elements {
            [element, ..] if slidings[0] == Sliding::Sticks && !element.is_of_gap() => {
                let force = on_wall / (on_wall * element.along)[0];
                let forces = Matrix2::from_rows(&[force, RowVector2::zeros()]);
                Constraint { forces, admitted: Matrix2::zeros() }
            }
            _ => Constraint { forces: Matrix2::zeros(), admitted: wall_alone },
        }
    }
}

impl Flight {
    pub(super) fn domains_in(&self, slidings: Slidings) -> &Domains {
        &self.intervals[self.interval].domains[self.stage][index(slidings)]
    }

    /// Whether friction holds the gap at rest.
    #[inline]
    pub(super) fn holds_gap(&self) -> bool {
        let still = |i: usize| self.slidings[i] == Sliding::Sticks && self.elements[i].speed == 0.0;
        match self.elements.len() {
            0 => false,
            _ if self.is_stuck() => false,
            2 if still(0) && still(1) => true,
            count => (0..count).any(|i| still(i) && self.elements[i].is_of_gap()),
        }
    }

    /// Lists the endings of the modes of all elements.
    pub(super) fn endings_of_friction(&self) -> impl Iterator<Item = Ending> + '_ {
        let of = |i: usize| match self.slidings[i] {
            Sliding::Sticks => [Sliding::Forwards, Sliding::Backwards].map(|next| Ending::Slips(i, next)),
            _ => [Ending::RateVanishes(i); 2],
        };
        (0..self.elements.len()).flat_map(of)
    }

    /// Returns the sliding speed of an element and its rate.
    pub(super) fn sliding_speed(&self, i: usize, q: &Gap, t: f64) -> (f64, f64) {
        let (sign, element) = (self.slidings[i].sign(), &self.elements[i]);
        let accelerations = Vector2::from(self.field().accelerations(q, self.phasor(t)));
        (sign * element.rate(q), sign * (element.row * accelerations)[0])
    }

    /// Returns how far the force that holds an element is from the limit beyond which it slides, and its rate.
    pub(super) fn holding(&self, i: usize, next: Sliding, q: &Gap, t: f64) -> (f64, f64) {
        let (holds, phasor) = (&self.domains().holds[self.domain()], self.phasor(t));
        let [rates, _] = holds.rates(self.field(), q, phasor, self.omega);
        let force = holds.accelerations(q, phasor)[i];
        (self.elements[i].force - next.sign() * force, -next.sign() * rates[i])
    }

    /// Returns the rounding error of a sliding speed.
    pub(super) fn rate_rounding(&self, i: usize, q: &Gap) -> f64 {
        let Element { row, speed, .. } = self.elements[i];
        super::ROUNDING * ((row[0] * q[1]).abs() + (row[1] * q[3]).abs() + speed.abs())
    }

    /// Returns by how much force an element obeys Coulomb's law in a combination of modes, if its rate is 0; negative if it does not.
    fn margin(&self, i: usize, slidings: Slidings, domain: usize, q: &Gap, t: f64) -> f64 {
        let (domains, phasor, element) = (self.domains_in(slidings), self.phasor(t), &self.elements[i]);
        let (field, holds) = (&domains.fields[domain], &domains.holds[domain]);
        let sign = slidings[i].sign();
        let accelerations = |pair: [f64; 2]| sign * (element.row * Vector2::from(pair))[0];
        let hold = holds.accelerations(q, phasor)[i];
        let (margin, rates) = match slidings[i] {
            Sliding::Sticks => {
                let rates = || holds.rates(field, q, phasor, self.omega).map(|pair| -hold.signum() * pair[i]);
                let margin = element.force - hold.abs();
                (margin, if margin == 0.0 { rates() } else { [0.0; 2] })
            }
            _ => {
                let rates = || field.rates(field, q, phasor, self.omega).map(accelerations);
                let margin = accelerations(field.accelerations(q, phasor)) / element.mobility();
                (margin, if margin == 0.0 { rates() } else { [0.0; 2] })
            }
        };
        // A derivative decides about a margin of 0.
        match rates.into_iter().find(|&rate| rate != 0.0) {
            None if margin == 0.0 && sign != 0.0 => -f64::MIN_POSITIVE,
            Some(rate) if rate < 0.0 => -f64::MIN_POSITIVE,
            _ => margin,
        }
    }

    /// Returns the first consistent combination of modes in a domain at a point, where only elements at rest change their mode.
    /// If rounding leaves none, the best one is returned.
    fn consistent(
        &self,
        at_rest: [bool; MOST_FRICTION],
        slidings: Slidings,
        domain: usize,
        q: &Gap,
        t: f64,
    ) -> Slidings {
        let options =
            |i: usize| if at_rest[i] { &Sliding::ALL[..] } else { std::slice::from_ref(&slidings[i]) };
        let mut best = (f64::NEG_INFINITY, slidings);
        for &first in options(0) {
            for &second in options(1) {
                let chosen = [first, second];
                let margins = (0..MOST_FRICTION).filter(|&i| at_rest[i]);
                let margin =
                    margins.map(|i| self.margin(i, chosen, domain, q, t)).fold(f64::INFINITY, f64::min);
                if margin >= 0.0 {
                    return chosen;
                }
                if margin > best.0 {
                    best = (margin, chosen);
                }
            }
        }
        best.1
    }

    /// Returns the modes in a domain after the velocities have jumped to a point.
    pub(super) fn after_jump(&self, domain: usize, q: &Gap, t: f64) -> Slidings {
        let (mut slidings, mut at_rest) = (self.slidings, self.sticks());
        let jumps = q[1] != self.q[1];
        for (i, element) in self.elements.iter().enumerate() {
            if jumps && element.is_kicked {
                slidings[i] = Sliding::of(element.rate(q));
                at_rest[i] = slidings[i] == Sliding::Sticks;
            } else {
                at_rest[i] |= element.rate(q).abs() <= self.rate_rounding(i, q);
            }
        }
        self.consistent(at_rest, slidings, domain, q, t)
    }

    /// Chooses the modes at the start. A rigid wall holds a gap at rest before friction does.
    pub(super) fn start_friction(&mut self) {
        let mut at_rest = [false; MOST_FRICTION];
        for (i, element) in self.elements.iter().enumerate() {
            self.slidings[i] = Sliding::of(element.rate(&self.q));
            at_rest[i] = self.slidings[i] == Sliding::Sticks;
        }
        self.slidings = self.consistent(at_rest, self.slidings, self.domain(), &self.q, 0.0);
        self.starts = at_rest.map(u32::from);
        let on_rigid = |side: &Side| self.is_rigid(*side) && self.q[0] == self.wall(*side);
        if let Some(side) = Side::BOTH.into_iter().find(on_rigid).filter(|_| self.holds_gap()) {
            let at_rest = self.domains_in(self.after_jump(super::domain_behind(side), &self.q, 0.0));
            if self.presses(&at_rest.push, side, &self.q, 0.0) {
                self.contact(side, 0.0, false);
            }
        }
    }

    /// Changes the modes of elements at rest, and lists the changes.
    pub(super) fn enter(&mut self, slidings: Slidings, t: f64, by_impact: bool) {
        let before = std::mem::replace(&mut self.slidings, slidings);
        for i in (0..self.elements.len()).filter(|&i| before[i] != slidings[i]) {
            let symbol = match (before[i], slidings[i]) {
                (_, Sliding::Sticks) => None,
                (Sliding::Sticks, _) => Some(b'7'),
                _ => (!by_impact).then_some(b'0'),
            };
            self.slips.push(Slip { t, element: i, symbol, after: self.events.len() });
        }
        for (i, element) in self.elements.iter().enumerate() {
            self.starts[i] = u32::from(element.rate(&self.q).abs() <= self.rate_rounding(i, &self.q));
        }
        self.bring_to_rest();
    }

    /// Removes rounding errors from the rates of sticking elements.
    fn bring_to_rest(&mut self) {
        let sticking: Vec<Element> = (0..self.elements.len())
            .filter(|&i| self.slidings[i] == Sliding::Sticks)
            .map(|i| self.elements[i])
            .collect();
        let [_, w, _, v] = &mut self.q;
        match sticking[..] {
            _ if matches!(self.mode, Mode::Stuck(_)) => {
                if let Some(element) = sticking.iter().find(|element| !element.is_of_gap()) {
                    *v = element.speed / element.row[1];
                }
            }
            // A gap at rest stays at rest.
            [element] if *w == 0.0 && !element.is_of_gap() => *v = element.speed / element.row[1],
            [element] => {
                let off = (element.row[0] * *w + element.row[1] * *v - element.speed) / element.mobility();
                *w -= off * element.along[0];
                *v -= off * element.along[1];
                if element.is_of_gap() {
                    *w = element.speed / element.row[0];
                }
            }
            [a, b] => {
                let rows = Matrix2::from_rows(&[a.row, b.row]);
                let inverse = rows.try_inverse().expect("rows of friction are independent");
                let velocities = inverse * Vector2::new(a.speed, b.speed);
                (*w, *v) = (velocities[0], velocities[1]);
            }
            _ => {}
        }
    }

    /// Chooses the modes of an element whose rate vanishes, and of those that stick.
    pub(super) fn end_sliding(&mut self, i: usize, t: f64) {
        let mut at_rest = self.sticks();
        at_rest[i] = true;
        self.choose(at_rest, Some(i), t, t);
        self.starts[i] = self.starts[i].max(1);
    }

    /// Chooses the modes of elements at rest again, at a time `at` of the forcing. The rate of `cause` has vanished.
    fn choose(&mut self, at_rest: [bool; MOST_FRICTION], cause: Option<usize>, at: f64, t: f64) {
        let (before, held) = (self.slidings, self.holds_gap());
        let mut slidings = self.consistent(at_rest, before, self.domain(), &self.q, at);
        if let Some(side) = self.contact_ended_by(slidings, at) {
            let was_stuck = self.is_stuck();
            (self.mode, self.from) = (Mode::Free, None);
            slidings = self.consistent(at_rest, before, 0, &self.q, at);
            if let Some(i) = cause {
                let mut first = before;
                first[i] = slidings[i];
                self.enter(first, t, false);
            }
            self.record(t, EventKind::MeshEnd, side);
            self.enter(slidings, t, false);
            if was_stuck {
                self.leave(side, at);
            }
        } else if slidings != before {
            self.enter(slidings, t, false);
        }
        if held && !self.holds_gap() {
            self.leave_rest(at, false);
            self.check_rest(at, t);
        }
    }

    /// Returns the wall of a contact that other modes would end at once.
    fn contact_ended_by(&mut self, slidings: Slidings, at: f64) -> Option<Side> {
        let before = std::mem::replace(&mut self.slidings, slidings);
        let ended = match self.mode {
            Mode::Stuck(side) => (!self.presses(&self.domains().push, side, &self.q, at)).then_some(side),
            Mode::Onset(side) if !self.holds_gap() => {
                (self.pressing(self.field(), side, &self.q, at) <= 0.0).then_some(side)
            }
            _ => None,
        };
        self.slidings = before;
        ended
    }

    /// Chooses the modes of elements at rest again, after a jump of other forces.
    pub(super) fn check_rest(&mut self, at: f64, t: f64) {
        let sticks = self.sticks();
        let at_rest = std::array::from_fn(|i| sticks[i] || self.starts[i] > 0);
        if at_rest != [false; MOST_FRICTION] {
            self.choose(at_rest, None, at, t);
        }
    }

    /// Processes a holding force that reaches its limit.
    pub(super) fn slip(&mut self, i: usize, next: Sliding, t: f64) {
        let held = self.holds_gap();
        let mut slidings = self.slidings;
        slidings[i] = next;
        let field = &self.domains_in(slidings).fields[self.domain()];
        let jerk = field.gap_rates(field, &self.q, self.phasor(t), self.omega)[0];
        let meets = |side: &Side| self.q[0] == self.wall(*side) && side.sign() * jerk > 0.0;
        if let Some(side) = Side::BOTH.into_iter().find(meets)
            && held
            && self.mode == Mode::Free
            && self.is_rigid(side)
        {
            // The wall holds the gap from here on.
            (self.mode, self.from) = (Mode::Stuck(side), None);
            self.record(t, EventKind::MeshStart, side);
            return;
        }
        self.enter(slidings, t, false);
        self.starts[i] = 2;
        if held && !self.holds_gap() {
            self.leave_rest(t, true);
        }
    }

    /// Friction lets go of a gap at rest. With `gently`, its acceleration is still 0.
    fn leave_rest(&mut self, t: f64, gently: bool) {
        let field = self.field();
        let [rate, _] = field.gap_rates(field, &self.q, self.phasor(t), self.omega);
        let [acceleration, _] = field.accelerations(&self.q, self.phasor(t));
        let gently = gently || acceleration == 0.0;
        let (towards, order) = if gently { (rate, 3) } else { (acceleration, 2) };
        let is_on = |side: Side| self.q[0] == self.wall(side);
        let is_into = |side: Side| side.sign() * towards > 0.0;
        match self.mode {
            Mode::Free => match Side::BOTH.into_iter().find(|&side| is_on(side)) {
                Some(side) if is_into(side) && gently && self.contact_type(side) == Contact::Impact => {
                    (self.mode, self.from) = (Mode::Sustained(side), Some((Ending::MeshEnds(side), order)));
                    self.record(t, EventKind::MeshStart, side);
                }
                Some(side) if is_into(side) => self.contact(side, t, false),
                side => self.from = side.map(|side| (Ending::Contact(side), order)),
            },
            Mode::Sustained(side) if is_on(side) && !is_into(side) => {
                (self.mode, self.from) = (Mode::Free, Some((Ending::Contact(side), order)));
                self.record(t, EventKind::MeshEnd, side);
            }
            Mode::Sustained(side) if is_on(side) => self.from = Some((Ending::MeshEnds(side), order)),
            Mode::Open(side) if is_on(side) && !is_into(side) => {
                (self.mode, self.from) = (Mode::Free, Some((Ending::Contact(side), order)));
            }
            Mode::Open(side) if is_on(side) => self.from = Some((Ending::Returns(side), order)),
            Mode::Onset(side) if is_into(side) => {
                self.from = gently.then_some((Ending::PressingEnds(side), 1));
            }
            Mode::Onset(side) => self.act(Ending::PressingEnds(side), t, true),
            _ => {}
        }
    }

    /// Projects a displacement to what the constraints leave free. Elements that stick `for_good` stay where they are.
    pub(super) fn project(&self, by: &mut Gap, for_good: [bool; MOST_FRICTION]) {
        let mut lasting = [Sliding::Sticks; MOST_FRICTION];
        for i in (0..self.elements.len()).filter(|&i| !for_good[i]) {
            lasting[i] = Sliding::Forwards;
        }
        let domain = self.domain();
        let positions = self.domains_in(lasting).admitted[domain] * Vector2::new(by[0], by[2]);
        let velocities = self.domains().admitted[domain] * Vector2::new(by[1], by[3]);
        *by = [positions[0], velocities[0], positions[1], velocities[1]];
    }
}
