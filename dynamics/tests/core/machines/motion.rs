//! The motion of a machine by matrix exponentials, written from the description of the machine alone.
//!
//! A step is a product with a stored exponential. The Taylor series of each step are searched for roots between the extrema.

use std::rc::Rc;

use nalgebra::DVector;
use rattlemap_dynamics::model::{Contact, Side, Wall};

use super::random::apart;
use super::roots::first_fall;
use super::system::{
    Curve, Functional, Grip, Key, Linear, Matrix, ROUNDING, System, Vector, exponential, product, value,
};

/// Known relative errors of velocities. They are larger than rounding errors and show their growth.
const SHAKEN: f64 = 1e-13;

/// Largest number of events in a part of a period.
const MOST_EVENTS: u32 = 20_000;

/// Displacement from which a motion is not followed further.
const ESCAPE: f64 = 1e9;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    /// Springs act behind all walls that the gap has crossed.
    Plain,
    /// Contact with the next wall has begun with a leaving speed, and the gap is in front of it.
    Onset(Side),
    /// The gap is at rest on the next wall, a rigid one.
    Stuck(Side),
    /// The last wall that the gap has crossed only pushes, and its force is 0.
    Open,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum What {
    Impact,
    Begins,
    Ends,
}

/// An event of a gap. The symbol belongs to the flight that ends here, if this flight began with an event or is a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Event {
    pub(crate) gap: usize,
    pub(crate) what: What,
    pub(crate) side: Side,
    pub(crate) symbol: Option<u8>,
    pub(crate) t: f64,
}

/// The place of a gap between its walls.
#[derive(Clone, Debug)]
pub(super) struct Gap {
    /// Number of walls that the gap has crossed: on the right if positive, on the left if negative.
    pub(super) level: i8,
    pub(super) mode: Mode,
    /// The direction of the wall that the gap is just leaving or at rest on, and the order of this root.
    pub(super) leaves: Option<(Side, usize)>,
    /// Whether the force of a wall that only pushes is zero now.
    pub(super) is_unloaded: bool,
    /// Whether a contact onset has no acceleration now.
    pub(super) is_unpressed: bool,
    /// The wall of the last event.
    pub(super) origin: Option<Side>,
    /// The stage of a series of impacts, times of the impacts that it has not counted, and whether flights are so low that the gap would rest
    /// if the series were interrupted.
    pub(super) series: Series,
    pub(super) uncounted: Vec<f64>,
    pub(super) is_low: bool,
}

/// Impacts are counted until the rest of their series is short. Then they are followed to the limit, which counts as one event. If something
/// else happens before the limit, the rest is no series of its own, and its impacts are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Series {
    /// Something else has happened since the last impact.
    Broken,
    Long,
    /// The next impact is not counted.
    Short,
    Uncounted,
}

/// The end of a flight.
#[derive(Clone, Copy, Debug)]
pub(super) enum End {
    /// An element stops sliding.
    Rests(usize),
    /// An element stops sticking.
    Slips(usize, Grip),
    /// A gap reaches the next wall in a direction, from the front or from behind.
    Crosses(usize, Side),
    OnsetEnds(usize, Side),
    PressingEnds(usize, Side),
    PulledOff(usize, Side),
    Opens(usize, Side),
    Closes(usize, Side),
    /// The argument of a curve reaches the next point, or the one before it.
    Bends(usize, bool),
}

/// A motion, with the derivative of its state with respect to the start.
#[derive(Clone)]
pub(crate) struct Motion<'a> {
    pub(super) system: &'a System,
    pub(super) stage: usize,
    pub(super) gaps: Vec<Gap>,
    pub(super) grips: Vec<Grip>,
    /// Orders of roots of the sliding rates now.
    pub(super) orders: Vec<usize>,
    /// Numbers of points that the arguments of curves have passed.
    pub(super) passed: Vec<usize>,
    /// For the argument of a curve at a point now: whether this is the next point, and the order of the root.
    pub(super) at_point: Vec<Option<(bool, usize)>>,
    /// Whether a nonlinear spring has been beyond its points.
    pub(crate) is_out_of_range: bool,
    pub(super) y: Vector,
    /// Forcing periods before this one, and time in this one.
    periods: u32,
    pub(super) t: f64,
    /// Derivative of `(x, v)`.
    pub(super) tangents: Option<Matrix>,
    /// Events of gaps in order, which the caller may clear.
    pub(crate) events: Vec<Event>,
    /// Ends of sticking, `7`, and reversals, `0`, with their times, which the caller may clear.
    pub(crate) slips: Vec<(u8, f64)>,
    /// Symbols of flights and of slips in order, with the gap's letter if there are several gaps. The caller may clear them.
    pub(crate) symbols: Vec<u8>,
    /// Time in which a gap has been in contact, which the caller may clear.
    pub(crate) meshing_time: f64,
    /// Sum of all shifts back at the ends of periods, which the caller may clear.
    pub(crate) travelled: Vector,
    /// Distances that the elements have slid, which the caller may clear.
    pub(crate) slid: Vec<f64>,
    /// Elements that never slide, so that neighbouring motions keep their distance along them.
    pub(crate) for_good: Vec<bool>,
    /// Rests on rigid walls and contact onsets that a change of the stage has ended.
    pub(crate) by_stage: [usize; 2],
    /// Whether impacts of several gaps were simultaneous within rounding. Their number then depends on rounding.
    pub(crate) is_crowded: bool,
    /// Number of flights that impacts of other gaps would have begun, but that were too low.
    pub(crate) corners: usize,
    /// For each gap, the motion before the impact after which flights are low.
    pub(super) saved: Vec<Option<Rc<(Motion<'a>, End)>>>,
    /// Relative errors that are added to the velocities at events, one after the other.
    shaken: [f64; 4],
}

pub(super) fn step_of(side: Side) -> i8 {
    if side == Side::Right { 1 } else { -1 }
}

/// Returns the side of the walls that a gap has crossed.
pub(super) fn side_of(level: i8) -> Side {
    if level > 0 { Side::Right } else { Side::Left }
}

impl Gap {
    /// Returns the number of walls whose springs act, with the sign of their side.
    pub(super) fn acting(&self) -> i8 {
        match self.mode {
            Mode::Plain | Mode::Stuck(_) => self.level,
            Mode::Onset(side) => self.level + step_of(side),
            Mode::Open => self.level - self.level.signum(),
        }
    }

    /// Returns the side of the wall that the gap is in contact with.
    pub(super) fn contact(&self) -> Option<Side> {
        match self.mode {
            Mode::Onset(side) | Mode::Stuck(side) => Some(side),
            _ => Some(self.acting()).filter(|acting| *acting != 0).map(side_of),
        }
    }
}

impl<'a> Motion<'a> {
    /// Starts at phase 0 with a state `(x1, v1, x2, v2, ...)`.
    pub(crate) fn new(system: &'a System, start: &[f64]) -> Motion<'a> {
        let machine = &system.machine;
        let gap = Gap {
            level: 0,
            mode: Mode::Plain,
            leaves: None,
            is_unloaded: false,
            is_unpressed: false,
            origin: None,
            series: Series::Broken,
            uncounted: Vec::new(),
            is_low: false,
        };
        let mut motion = Motion {
            system,
            stage: machine.first_stage(),
            gaps: vec![gap; machine.gaps.len()],
            grips: vec![Grip::Stick; machine.friction.len()],
            orders: vec![0; machine.friction.len()],
            passed: vec![0; system.curves.len()],
            at_point: vec![None; system.curves.len()],
            is_out_of_range: false,
            y: DVector::zeros(system.size()),
            periods: 0,
            t: 0.0,
            tangents: None,
            events: Vec::new(),
            slips: Vec::new(),
            symbols: Vec::new(),
            meshing_time: 0.0,
            travelled: DVector::zeros(machine.degrees()),
            slid: vec![0.0; machine.friction.len()],
            for_good: vec![false; machine.friction.len()],
            by_stage: [0; 2],
            corners: 0,
            is_crowded: false,
            saved: vec![None; machine.gaps.len()],
            shaken: [0.0; 4],
        };
        motion.put(start);
        motion.begin_period();
        (0..system.curves.len()).for_each(|i| motion.find_passed(i));
        for i in 0..machine.gaps.len() {
            motion.find_level(i);
        }
        motion.begin_grips();
        motion
    }

    fn put(&mut self, state: &[f64]) {
        let n = self.system.degrees;
        for i in 0..n {
            (self.y[i], self.y[n + i]) = (state[2 * i], state[2 * i + 1]);
        }
    }

    /// Returns `(x1, v1, x2, v2, ...)`.
    pub(crate) fn state(&self) -> Vec<f64> {
        let n = self.system.degrees;
        (0..2 * n).map(|i| self.y[i / 2 + n * (i % 2)]).collect()
    }

    /// Replaces the state and removes the rates of everything at rest. Modes do not change.
    pub(crate) fn set_state(&mut self, state: &[f64]) {
        self.put(state);
        self.project();
    }

    /// Returns the derivative of `(x1, v1, x2, v2, ...)` with respect to the start.
    pub(crate) fn derivative(&self) -> Matrix {
        let n = self.system.degrees;
        let tangents = self.tangents.as_ref().expect("tangents");
        let of = |i: usize| i / 2 + n * (i % 2);
        Matrix::from_fn(2 * n, 2 * n, |i, j| tangents[(of(i), of(j))])
    }

    /// Clears all records that the caller reads period by period.
    pub(crate) fn clear(&mut self) {
        (self.events, self.slips, self.symbols) = Default::default();
        self.meshing_time = 0.0;
        self.travelled.fill(0.0);
        self.slid.fill(0.0);
    }

    /// Begins to carry unit tangents.
    pub(crate) fn carry_tangents(&mut self) {
        let size = 2 * self.system.degrees;
        self.tangents = Some(self.held(Matrix::identity(size, size)));
    }

    /// Projects tangents: a gap at rest on a wall has no neighbours off the wall, and elements that stick have none with a rate; those that
    /// stick for good have none in another place.
    pub(super) fn held(&self, mut tangents: Matrix) -> Matrix {
        let n = self.system.degrees;
        for (row, (change, _), element) in self.at_rest() {
            let one = Matrix::identity(n, n) - change * row.transpose();
            let mut all = Matrix::identity(2 * n, 2 * n);
            all.view_mut((n, n), (n, n)).copy_from(&one);
            if element.is_none_or(|i| self.for_good[i]) {
                all.view_mut((0, 0), (n, n)).copy_from(&one);
            }
            tangents = all * tangents;
        }
        tangents
    }

    /// Returns two copies of the motion with known errors of velocities at each event: errors of one sign and of both signs, because errors
    /// can cancel.
    pub(crate) fn shaken(&self) -> Vec<Motion<'a>> {
        let with = |signs: [f64; 4]| Motion { shaken: signs.map(|sign| SHAKEN * sign), ..self.clone() };
        vec![with([1.0; 4]), with([1.0, 1.0, -1.0, -1.0])]
    }

    /// Returns the motion with the steps of another system of the same machine.
    pub(crate) fn in_system<'b>(&self, system: &'b System) -> Motion<'b>
    where
        'a: 'b,
    {
        Motion { system, ..self.clone() }
    }

    /// Advances the shaken motions. Returns their largest distance from this one.
    pub(crate) fn noise(&self, shaken: &mut [Motion<'a>]) -> Option<f64> {
        shaken.iter_mut().try_for_each(Motion::advance_period)?;
        let off = |other: &Motion| apart(&self.state(), &other.state(), self.system.machine.omega);
        Some(shaken.iter().map(off).fold(0.0, f64::max))
    }

    /// Whether a gap is in contact, or an element sticks.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.gaps.iter().any(|gap| gap.mode != Mode::Plain) || self.grips.contains(&Grip::Stick)
    }

    /// Returns the number of walls of a gap whose springs act, negative on the left.
    pub(crate) fn acting(&self, gap: usize) -> i8 {
        self.gaps[gap].acting()
    }

    pub(crate) fn modes(&self) -> Vec<Mode> {
        self.gaps.iter().map(|gap| gap.mode).collect()
    }

    pub(super) fn time(&self) -> f64 {
        f64::from(self.periods) * self.system.period + self.t
    }

    pub(super) fn key(&self) -> Key {
        let mut passed = self.passed.clone();
        let sticks = self.grips.iter().map(|grip| *grip == Grip::Stick);
        passed.iter_mut().zip(sticks).filter(|(_, sticks)| *sticks).for_each(|(passed, _)| *passed = 0);
        Key {
            passed,
            stage: self.stage,
            acting: self.gaps.iter().map(Gap::acting).collect(),
            held: self.gaps.iter().map(|gap| matches!(gap.mode, Mode::Stuck(_))).collect(),
            grips: self.grips.clone(),
        }
    }

    pub(super) fn linear(&self) -> Rc<Linear> {
        self.system.domain(&self.key())
    }

    pub(super) fn of(&self, row: &Functional) -> f64 {
        value(row, &self.y)
    }

    /// Returns the rate of a gap in a direction.
    pub(super) fn rate(&self, gap: usize, direction: Side) -> f64 {
        direction.sign() * self.of(&self.system.w[gap])
    }

    /// Returns side and number of the next wall in a direction: in front of the gap, or a wall that it is behind.
    pub(super) fn next_wall(&self, gap: usize, direction: Side) -> Option<(Side, usize)> {
        let level = self.gaps[gap].level;
        let (side, nth) = match level * step_of(direction) {
            0.. => (direction, usize::from(level.unsigned_abs())),
            _ => (direction.mirrored(), usize::from(level.unsigned_abs()) - 1),
        };
        (nth < self.system.machine.gaps[gap].walls[side.index()].len()).then_some((side, nth))
    }

    /// Returns the row of the force of a wall that the gap is behind and that only pushes.
    pub(super) fn pushing(&self, gap: usize) -> Option<Functional> {
        let level = self.gaps[gap].level;
        let nth = usize::from(level.unsigned_abs()).checked_sub(1)?;
        self.system.pushing(gap, side_of(level), nth, self.stage, &self.passed)
    }

    /// Whether the last wall that the gap has crossed is in contact, by the sign of its force without contact.
    pub(super) fn closes(&mut self, gap: usize) -> bool {
        let Some(row) = self.pushing(gap) else { return true };
        let mode = std::mem::replace(&mut self.gaps[gap].mode, Mode::Open);
        let closes = self.linear().tendency(&row, &self.y) > 0.0;
        self.gaps[gap].mode = mode;
        closes
    }

    /// Returns the row of the argument of a curve.
    pub(super) fn argument(&self, i: usize) -> Functional {
        let curve = &self.system.curves[i];
        self.grips.get(i).map_or_else(|| curve.argument.clone(), |grip| &curve.argument * grip.sign())
    }

    /// Finds the points that the argument of a curve has passed.
    pub(super) fn find_passed(&mut self, i: usize) {
        self.passed[i] = self.system.curves[i].passed(self.of(&self.argument(i)));
        self.at_point[i] = None;
        self.check_range(i);
    }

    /// Notes it if a nonlinear spring is beyond its points.
    pub(super) fn check_range(&mut self, i: usize) {
        let ends = [0, self.system.curves[i].points.len()];
        self.is_out_of_range |= i >= self.grips.len() && ends.contains(&self.passed[i]);
    }

    /// Finds the walls that a gap is behind.
    fn find_level(&mut self, gap: usize) {
        let z = self.of(&self.system.z[gap]);
        for side in Side::BOTH {
            let walls = &self.system.machine.gaps[gap].walls[side.index()];
            let is_behind =
                |wall: &&Wall| wall.contact != Contact::Rigid && side.sign() * (z - wall.at) > 0.0;
            let count = walls.iter().take_while(is_behind).count();
            if count > 0 {
                self.gaps[gap].level = step_of(side) * count as i8;
            }
        }
        if !self.closes(gap) {
            self.gaps[gap].mode = Mode::Open;
        }
    }

    /// Determines the modes of friction at the start: elements without a sliding rate stick.
    fn begin_grips(&mut self) {
        for i in 0..self.grips.len() {
            self.grips[i] = self.grip(i, ROUNDING * self.size_of_rate(&self.system.slides[i]));
            self.find_passed(i);
        }
        self.decide();
        self.project();
        let is_still = self.linear().is_still.clone();
        for i in (0..self.gaps.len()).filter(|&i| is_still[i]) {
            let z = self.of(&self.system.z[i]);
            let is_on = |direction: &Side| {
                self.next_wall(i, *direction).is_some_and(|(side, nth)| {
                    (self.system.machine.gaps[i].walls[side.index()][nth].at - z).abs() < ROUNDING
                })
            };
            self.gaps[i].leaves = Side::BOTH.into_iter().find(is_on).map(|side| (side, 3));
        }
    }

    /// Returns the size of the terms of a rate, which rounding errors are relative to.
    pub(super) fn size_of_rate(&self, row: &Functional) -> f64 {
        let n = self.system.degrees;
        let rates = row.columns(n, n).abs().sum() * self.system.machine.omega * self.y.rows(0, n).amax();
        rates + row.iter().zip(self.y.iter()).map(|(a, b)| (a * b).abs()).sum::<f64>()
    }

    /// Returns the direction of an element's sliding rate.
    pub(super) fn grip(&self, i: usize, zero: f64) -> Grip {
        match self.of(&self.system.slides[i]) {
            rate if rate.abs() <= zero => Grip::Stick,
            rate if rate > 0.0 => Grip::Plus,
            _ => Grip::Minus,
        }
    }

    /// Returns everything at rest: its row, its bond while earlier rows are held, and the element, or none for a gap.
    fn at_rest(&self) -> Vec<(Vector, super::system::Bond, Option<usize>)> {
        let machine = &self.system.machine;
        let walls = (0..self.gaps.len()).filter(|&i| matches!(self.gaps[i].mode, Mode::Stuck(_)));
        let sticking = (0..self.grips.len()).filter(|&i| self.grips[i] == Grip::Stick);
        let rows: Vec<(&Vector, Option<usize>)> = walls
            .map(|i| (&machine.gaps[i].row, None))
            .chain(sticking.map(|i| (&machine.friction[i].row, Some(i))))
            .collect();
        let bonds = self.system.bonds(&rows.iter().map(|row| row.0).collect::<Vec<_>>());
        rows.into_iter().zip(bonds).map(|((row, element), bond)| (row.clone(), bond, element)).collect()
    }

    /// Removes the rates of everything at rest.
    pub(super) fn project(&mut self) {
        let (n, machine) = (self.system.degrees, &self.system.machine);
        for (row, (change, _), element) in self.at_rest() {
            let rate = row.dot(&self.y.rows(n, n)) - element.map_or(0.0, |i| machine.friction[i].speed);
            let mut velocities = self.y.rows_mut(n, n);
            velocities -= change * rate;
        }
    }

    /// Begins a period, after a shift back along directions in which nothing holds the machine.
    fn begin_period(&mut self) {
        self.t = 0.0;
        let n = self.system.degrees;
        for along in &self.system.shifts {
            let by = along.dot(&self.y.rows(0, n));
            self.y.rows_mut(0, n).axpy(-by, along, 1.0);
            self.travelled.axpy(by, along, 1.0);
            self.tangents.iter_mut().for_each(|tangents| {
                let change = along * (along.transpose() * tangents.rows(0, n));
                let mut of_x = tangents.rows_mut(0, n);
                of_x -= change;
            });
        }
        let one = 2 * self.system.degrees;
        self.y[one] = 1.0;
        for i in 0..self.system.machine.drives.len() {
            (self.y[one + 1 + 2 * i], self.y[one + 2 + 2 * i]) = (1.0, 0.0);
        }
    }

    /// Advances to the next phase 0. Returns none after too many events.
    pub(crate) fn advance_period(&mut self) -> Option<()> {
        let system = self.system;
        let mut at_end = None;
        for &(phase, stage) in &system.machine.schedule {
            if phase == 0.0 {
                at_end = Some(stage);
            } else {
                self.run(phase * system.period)?;
                self.change(stage);
            }
        }
        self.run(system.period)?;
        self.periods += 1;
        self.begin_period();
        if let Some(stage) = at_end {
            self.change(stage);
        }
        self.y.iter().all(|x| x.abs() < ESCAPE).then_some(())
    }

    /// Integrates to a time within the present stage.
    pub(crate) fn run(&mut self, until: f64) -> Option<()> {
        let (system, n) = (self.system, self.system.degrees);
        let mut events = 0u32;
        let (mut linear, mut flown) = (self.linear(), 0.0);
        loop {
            if self.t >= until {
                self.move_tangents(&linear, std::mem::take(&mut flown));
                if !(0..self.gaps.len()).any(|i| self.break_series(i)) {
                    return Some(());
                }
                linear = self.linear();
                continue;
            }
            let (h, is_whole) = match until - self.t {
                rest if rest <= linear.step.0 => (rest, false),
                _ => (linear.step.0, true),
            };
            let series = linear.series(&self.y, h);
            let found = self.first_end(&linear, &series);
            let share = found.map_or(1.0, |(share, _)| share);
            let at = |share: f64| {
                series.iter().rev().fold(Vector::zeros(self.y.len()), |sum, term| sum * share + term)
            };
            flown += share * h;
            if self.gaps.iter().any(|gap| gap.contact().is_some()) {
                self.meshing_time += share * h;
            }
            if share > 0.0 {
                let to = if is_whole && found.is_none() { &linear.step.1 * &self.y } else { at(share) };
                let moved = to.rows(0, n) - self.y.rows(0, n);
                for (i, friction) in system.machine.friction.iter().enumerate() {
                    let slid = friction.row.dot(&moved) - friction.speed * share * h;
                    self.slid[i] += self.grips[i].sign() * slid;
                }
                self.y = to;
                self.orders.fill(0);
                self.at_point.fill(None);
                for (gap, is_still) in self.gaps.iter_mut().zip(&linear.is_still) {
                    gap.is_unloaded = false;
                    if !is_still {
                        (gap.leaves, gap.is_unpressed) = (None, false);
                    }
                }
            }
            let Some((_, end)) = found else {
                self.t = if is_whole { self.t + h } else { until };
                continue;
            };
            self.t += share * h;
            self.move_tangents(&linear, std::mem::take(&mut flown));
            self.act(end, share == 0.0);
            if self.shaken[0] != 0.0 {
                let error = self.shaken[events as usize % 4];
                let mut velocities = self.y.rows_mut(n, n);
                velocities *= 1.0 + error;
                self.project();
            }
            linear = self.linear();
            events += 1;
            if events > MOST_EVENTS {
                return None;
            }
        }
    }

    /// Advances the tangents by a time in a domain.
    fn move_tangents(&mut self, linear: &Linear, time: f64) {
        let size = 2 * self.system.degrees;
        if let Some(tangents) = &mut self.tangents {
            let moved = exponential(&(linear.a.view((0, 0), (size, size)) * time));
            *tangents = product(&moved, tangents);
        }
    }

    /// Returns the share of a step after which a flight ends, and the kind of its end.
    fn first_end(&self, linear: &Linear, series: &[Vector]) -> Option<(f64, End)> {
        let mut ends = Vec::new();
        let of = |row: &Functional, factor: f64| -> Vec<f64> {
            series.iter().map(|term| factor * value(row, term)).collect()
        };
        let mut fall = |c: &[f64], order: usize, end: End| {
            ends.extend(first_fall(&c[order..], order > 0).map(|share| (share, end)));
        };
        for (i, gap) in self.gaps.iter().enumerate() {
            if let Mode::Stuck(side) = gap.mode {
                fall(&of(&linear.pressing[i], side.sign()), 0, End::PulledOff(i, side));
            }
            if linear.is_still[i] || matches!(gap.mode, Mode::Stuck(_)) {
                continue;
            }
            for direction in Side::BOTH {
                let Some((side, nth)) = self.next_wall(i, direction) else { continue };
                let wall = &self.system.machine.gaps[i].walls[side.index()][nth];
                let mut c = of(&self.system.z[i], -direction.sign());
                c[0] += direction.sign() * wall.at;
                let order = gap.leaves.filter(|leaves| leaves.0 == direction).map_or(0, |leaves| leaves.1);
                let end = match gap.mode {
                    Mode::Onset(own) if own == direction => End::OnsetEnds(i, own),
                    _ => End::Crosses(i, direction),
                };
                fall(&c, order, end);
            }
            if let Mode::Onset(side) = gap.mode {
                let c = of(&linear.acceleration[i], side.sign());
                // Pressing may begin at zero.
                let zeros = c.iter().take_while(|c| **c == 0.0).count().min(c.len() - 1);
                fall(&c, zeros.max(usize::from(gap.is_unpressed)), End::PressingEnds(i, side));
            }
            // A force without damper and preload vanishes at the wall in front of the second point of its curve.
            let of_wall = |curve: &Curve| curve.wall == Some((i, side_of(gap.level)));
            let curve = self.system.curves.iter().position(of_wall);
            let vanishes_at_wall = |wall: &Wall| {
                let spring = wall.springs[self.stage];
                let is_first = curve.is_none_or(|curve| self.passed[curve] == 1);
                is_first && spring.damping == 0.0 && spring.force_at_wall() == 0.0
            };
            let walls = &self.system.machine.gaps[i].walls[side_of(gap.level).index()];
            if let (Mode::Plain | Mode::Open, Some(row)) = (gap.mode, self.pushing(i))
                && !walls.last().is_some_and(vanishes_at_wall)
            {
                let (sign, side) = (if gap.mode == Mode::Open { -1.0 } else { 1.0 }, side_of(gap.level));
                let end = if gap.mode == Mode::Open { End::Closes(i, side) } else { End::Opens(i, side) };
                fall(&of(&row, sign), usize::from(gap.is_unloaded), end);
            }
        }
        for (i, &grip) in self.grips.iter().enumerate() {
            match grip {
                Grip::Stick if linear.is_idle[i] => {}
                Grip::Stick => {
                    for (room, grip) in self.limits(linear, i) {
                        fall(&of(&room, 1.0), 0, End::Slips(i, grip));
                    }
                }
                _ => fall(&of(&self.system.slides[i], grip.sign()), self.orders[i], End::Rests(i)),
            }
        }
        for (i, curve) in self.system.curves.iter().enumerate() {
            let is_off = curve.wall.is_some_and(|(gap, side)| {
                let count = self.system.machine.gaps[gap].walls[side.index()].len();
                self.gaps[gap].level != step_of(side) * count as i8
            });
            if is_off || self.grips.get(i) == Some(&Grip::Stick) {
                continue;
            }
            let (row, passed) = (self.argument(i), self.passed[i]);
            let next = (passed < curve.points.len()).then_some((true, passed));
            let before = (passed > curve.least).then(|| (false, passed - 1));
            for (is_next, point) in next.into_iter().chain(before) {
                let sign = if is_next { -1.0 } else { 1.0 };
                let mut c = of(&row, sign);
                c[0] -= sign * curve.points[point][0];
                let order = self.at_point[i].filter(|at| at.0 == is_next).map_or(0, |at| at.1);
                fall(&c, order, End::Bends(i, is_next));
            }
        }
        ends.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Returns the distances of an element's sticking force from its two limits, as functionals, and the mode that follows at each limit.
    pub(super) fn limits(&self, linear: &Linear, i: usize) -> [(Functional, Grip); 2] {
        [Grip::Plus, Grip::Minus].map(|grip| {
            let mut room = &linear.hold[i] * -grip.sign();
            room[2 * self.system.degrees] += self.system.machine.friction[i].static_force;
            (room, grip)
        })
    }
}
