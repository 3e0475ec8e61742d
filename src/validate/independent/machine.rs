//! The motion of a machine, integrated in time steps.
//!
//! DOP853 integrates the motion between events. Very short flights use the first terms of the solution's Taylor series instead, because the
//! relative error of their duration must be small. Functions end the present modes where they fall below 0. A polynomial through the values
//! and derivatives at both ends of a step shows whether such a function does so in the step. The integrator then locates the root to the
//! last digits.

mod events;
mod roots;
mod system;

use std::rc::Rc;

use nalgebra::DVector;

use super::Tally;
use super::dop853::Integration;
use rattlemap_dynamics::model::{MOST_FRICTION, MOST_GAPS, Oscillator, REST, RigidMode, Side, State};
use rattlemap_dynamics::motion::EventKind;

use system::{
    CURVES, Constraints, Domain, Functional, Key, Numbers, PhasePoint, Pieces, Slide, System, affine, dot,
    size,
};

/// Relative and absolute tolerance of one step.
const TOLERANCE: f64 = 1e-12;

/// Longest step that cannot miss an ending, in radians of the fastest rate.
const LONGEST: f64 = 0.7;

/// Longest flight that a Taylor series of [`TERMS`] terms describes, in radians of the fastest rate.
const SHORT: f64 = 0.05;
const TERMS: usize = 10;

/// Largest number of endings in one interval.
const ENDINGS: u32 = 10_000;

/// Largest number of Newton steps, and size of the last one in radians of the fastest rate.
const NEWTON_CAP: u32 = 6;
const NEWTON_ENDS: f64 = 1e-7;

/// A motion is followed while its coordinates are at most this large, in scales of length.
const ESCAPE: f64 = 1e12;

/// A possible end of the present modes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ending {
    /// A gap reaches the next wall in a direction.
    Reaches(usize, Side),
    /// The gap of a contact onset comes back to its wall. This does not count as an event.
    OnsetEnds(usize, Side),
    /// In a contact onset, the load no longer presses the gap to its wall.
    PressingEnds(usize, Side),
    /// The load pulls a gap off the rigid wall on which it rests.
    PulledOff(usize, Side),
    /// Behind a wall that only pushes, the force falls to 0.
    Opens(usize, Side),
    /// Behind a wall that only pushes, the force rises from 0.
    Closes(usize, Side),
    /// A sliding rate vanishes.
    RateVanishes(usize),
    /// The force that holds an element reaches its limit.
    Slips(usize, Slide),
    /// The argument of a curve reaches the upper or the lower end of its piece. This does not count as an event.
    Bends(usize, bool),
}

/// A function that falls below 0 at an ending.
struct Watch {
    ending: Ending,
    row: Functional,
    /// Order of the function's root at the start of the flight; 0 without a root.
    order: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// The springs of all crossed walls act.
    Plain,
    /// Contact with the next wall has lasted since an impact after which the gap still had a speed. The gap is in front of this wall.
    Onset(Side),
    /// The gap is at rest on the next wall, which is rigid.
    Stuck(Side),
    /// The gap has crossed a wall that only pushes, and no force of this wall acts.
    Open,
}

/// The place of a gap between its walls.
#[derive(Clone, Copy, Debug)]
struct Gap {
    /// Number of walls that the gap has crossed, negative on the left.
    level: i8,
    mode: Mode,
    /// If the gap is on a wall: the wall's direction, and the order of the root of the distance.
    on_wall: Option<(Side, usize)>,
    /// Order of the root of the pushing force, or of the pressing acceleration of a contact onset; 0 without a root.
    from_force: usize,
    /// Side of the wall of the gap's last event.
    origin: Option<Side>,
    series: Series,
}

/// The stage of a series of impacts. Impacts are counted until the rest is short. Then they are followed to the limit, which counts as one
/// event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Series {
    Long,
    /// The next impact is not counted.
    Short,
    Uncounted,
}

/// Returns a number of walls with the sign of the side.
fn signed(side: Side, count: usize) -> i8 {
    if side == Side::Right { count as i8 } else { -(count as i8) }
}

fn side_of(level: i8) -> Side {
    if level > 0 { Side::Right } else { Side::Left }
}

impl Gap {
    /// Returns the number of walls whose springs act, negative on the left.
    fn acting(&self) -> i8 {
        match self.mode {
            Mode::Plain | Mode::Stuck(_) => self.level,
            Mode::Onset(side) => self.level + signed(side, 1),
            Mode::Open => self.level - self.level.signum(),
        }
    }

    /// Returns the side of a lasting contact.
    fn contact(&self) -> Option<Side> {
        match self.mode {
            Mode::Onset(side) | Mode::Stuck(side) => Some(side),
            _ => Some(self.acting()).filter(|acting| *acting != 0).map(side_of),
        }
    }
}

/// An event at a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Index of the gap.
    pub gap: usize,
    /// Kind of the event.
    pub kind: EventKind,
    /// Side of the wall.
    pub side: Side,
    /// Symbol `b'1'..=b'6'` of the flight that ends; none for the first flight.
    pub symbol: Option<u8>,
    /// Time since phase 0, in radians.
    pub t: f64,
}

/// A change of the mode of an element with dry friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    /// Time since phase 0, in radians.
    pub t: f64,
    /// The element, among those with a force.
    pub element: usize,
    /// Symbol `b'7'` if sticking ends, `b'0'` if sliding reverses without an impact.
    pub symbol: Option<u8>,
    /// Number of events at walls that are listed before this change.
    pub after: usize,
}

/// A motion of a machine.
#[derive(Clone, Debug)]
pub struct Flight {
    system: Rc<System>,
    stage: usize,
    gaps: [Gap; MOST_GAPS],
    slides: [Slide; MOST_FRICTION],
    /// Orders of the roots of sliding rates at the start of the flight; 0 without a root.
    from_rate: [usize; MOST_FRICTION],
    pieces: Pieces,
    /// Ends of pieces at which arguments of curves lie, and the orders of the roots.
    at_end: [Option<(bool, usize)>; CURVES],
    y: Numbers,
    /// Tally of the time since the caller last took it.
    pub(super) tally: Tally,
    /// Events at walls since the caller last took them.
    pub events: Vec<Event>,
    /// Changes of friction since the caller last took them.
    pub slips: Vec<Slip>,
}

impl Flight {
    /// Builds a motion that starts at phase 0. A gap beyond a rigid wall is moved to this wall.
    pub fn new(machine: &Oscillator, start: &State) -> Flight {
        let system = Rc::new(System::new(machine, start));
        let gap = Gap {
            level: 0,
            mode: Mode::Plain,
            on_wall: None,
            from_force: 0,
            origin: None,
            series: Series::Long,
        };
        let mut flight = Flight {
            stage: machine.first_stage(),
            gaps: [gap; MOST_GAPS],
            slides: [Slide::Sticks; MOST_FRICTION],
            from_rate: [0; MOST_FRICTION],
            pieces: Pieces::default(),
            at_end: [None; CURVES],
            y: system.to_coordinates(&machine.put_on_walls(start)),
            tally: Tally::default(),
            events: Vec::new(),
            slips: Vec::new(),
            system,
        };
        flight.begin();
        flight
    }

    /// Returns the state `(x1, v1, x2, v2, ...)`.
    pub fn state(&self) -> State {
        self.system.to_state(&self.y)
    }

    /// Returns the side of a gap's lasting contact.
    pub fn contact(&self, gap: usize) -> Option<Side> {
        self.gaps[gap].contact()
    }

    /// Returns the independent ones of the dimensionless coordinates, and their rates, `(d1, w1, d2, w2, ...)`.
    pub(super) fn coordinates(&self) -> Vec<f64> {
        let leading = self.system.leading.iter();
        leading.flat_map(|&i| [self.y[i], self.y[self.system.n + i]]).collect()
    }

    /// Computes dependent gaps again from the others, except those on their walls.
    fn tie(&mut self) {
        let (n, system) = (self.system.n, self.system.clone());
        for gap in (0..system.gaps()).filter(|gap| !system.leading.contains(gap)) {
            let lies = matches!(self.gaps[gap].mode, Mode::Stuck(_)) || self.gaps[gap].on_wall.is_some();
            let row = system.gap_row(gap);
            if !lies {
                self.y[gap] = dot(row.as_slice(), &self.y[..n]);
            }
            if !lies || self.rate(gap) != 0.0 {
                self.y[n + gap] = dot(row.as_slice(), &self.y[n..2 * n]);
            }
        }
    }

    /// Shifts all displacements along a rigid-body mode. Gaps that it does not change keep their digits.
    pub(super) fn shift(&mut self, mode: &RigidMode, by: f64) {
        let mut state = REST;
        mode.direction.iter().enumerate().for_each(|(i, direction)| state[2 * i] = by * direction);
        let shift = self.system.to_coordinates(&state);
        let is_changed = |i: &usize| mode.gaps.get(*i).is_none_or(|change| *change != 0.0);
        (0..self.system.n).filter(is_changed).for_each(|i| self.y[i] += shift[i]);
    }

    /// Returns the phases in turns at which the stage changes.
    pub(super) fn change_phases(&self) -> Vec<f64> {
        self.system.machine.schedule.iter().map(|&(phase, _)| phase).collect()
    }

    /// Returns the elements that stick.
    pub(super) fn sticks(&self) -> [bool; MOST_FRICTION] {
        std::array::from_fn(|i| i < self.system.elements.len() && self.slides[i] == Slide::Sticks)
    }

    /// Returns a motion displaced by `by` in [`coordinates`](Self::coordinates). Gaps and elements at rest stay at rest. Elements that
    /// stick `for_good` are not displaced along their rows.
    pub(super) fn displaced(&self, by: &[f64], for_good: [bool; MOST_FRICTION]) -> Flight {
        let (n, system, domain) = (self.system.n, &self.system, self.domain());
        let is_at_rest =
            |gap: &usize| matches!(self.gaps[*gap].mode, Mode::Stuck(_)) || self.is_kept(&domain, *gap);
        let gaps = || (0..system.gaps()).filter(is_at_rest).map(|gap| system.gap_row(gap));
        let elements = |of: [bool; MOST_FRICTION]| {
            (0..system.elements.len()).filter(move |&i| of[i]).map(|i| system.elements[i].row.clone())
        };
        let projected = |kind: usize, of: [bool; MOST_FRICTION]| {
            let rows: Vec<DVector<f64>> = gaps().chain(elements(of)).collect();
            let of_leading = DVector::from_fn(system.leading.len(), |i, _| by[2 * i + kind]);
            let mut part = &system.spread * of_leading;
            let speeds = vec![0.0; rows.len()];
            Constraints::new(&system.mobility, &rows).project(&system.mobility, &mut part, &speeds);
            part
        };
        let mut other = self.clone();
        let [d, w] = [projected(0, for_good), projected(1, self.sticks())];
        (0..n).for_each(|i| (other.y[i], other.y[n + i]) = (self.y[i] + d[i], self.y[n + i] + w[i]));
        for gap in (0..system.gaps()).filter(is_at_rest) {
            (other.y[gap], other.y[n + gap]) = (self.y[gap], self.y[n + gap]);
        }
        other.pieces = system.pieces(&self.slides, &domain.point(&other.y, 0.0));
        other
    }

    fn key(&self) -> Key {
        Key {
            stage: self.stage,
            acting: self.gaps.map(|gap| gap.acting()),
            held: self.gaps.map(|gap| match gap.mode {
                Mode::Stuck(side) => Some(side),
                _ => None,
            }),
            slides: self.slides,
            pieces: self.pieces,
        }
    }

    fn domain(&self) -> Rc<Domain> {
        self.system.domain(self.key())
    }

    fn rate(&self, gap: usize) -> f64 {
        self.y[self.system.n + gap]
    }

    /// Whether constraints keep a gap at its place.
    fn is_kept(&self, domain: &Domain, gap: usize) -> bool {
        domain.is_still[gap] && self.rate(gap) == 0.0
    }

    /// Returns side and number of the next wall in a direction. This wall is in front of the gap, or the gap is behind it.
    fn next_wall(&self, gap: usize, direction: Side) -> Option<(Side, usize)> {
        let level = self.gaps[gap].level;
        let (side, nth) = match level * signed(direction, 1) {
            0.. => (direction, usize::from(level.unsigned_abs())),
            _ => (direction.mirrored(), usize::from(level.unsigned_abs()) - 1),
        };
        (nth < self.system.walls(gap, side).len()).then_some((side, nth))
    }

    /// Returns the force of the wall that the gap is behind, if this wall only pushes.
    fn force(&self, gap: usize) -> Option<Functional> {
        let level = self.gaps[gap].level;
        let side = side_of(level);
        let is_last = level != 0 && usize::from(level.unsigned_abs()) == self.system.walls(gap, side).len();
        if is_last { self.system.pushing(gap, side, self.stage, &self.pieces) } else { None }
    }

    /// Lists the functions that may end the present modes.
    fn watches(&self, domain: &Domain, point: &PhasePoint) -> Vec<Watch> {
        let mut watches = Vec::new();
        let mut add = |ending: Ending, row: Functional, order: usize| {
            // A force that has just risen from 0 may be negative by rounding.
            let is_force = !matches!(ending, Ending::Reaches(..) | Ending::OnsetEnds(..));
            let rises = || {
                dot(&row, point).abs() <= system::ROUNDING * size(&row, point)
                    && dot(&row, &domain.derivative(point)) > 0.0
            };
            let order = if order == 0 && is_force && rises() { 1 } else { order };
            watches.push(Watch { ending, row, order });
        };
        let (system, width) = (&self.system, domain.width);
        for gap in 0..system.gaps() {
            let Gap { mode, level, on_wall, from_force, .. } = self.gaps[gap];
            if let Mode::Stuck(side) = mode {
                // Without a push, other walls hold the gap.
                domain.pushes[gap].into_iter().for_each(|push| add(Ending::PulledOff(gap, side), push, 0));
            }
            if matches!(mode, Mode::Stuck(_)) || self.is_kept(domain, gap) {
                continue;
            }
            for direction in Side::BOTH {
                let Some((side, nth)) = self.next_wall(gap, direction) else { continue };
                let (sign, at) = (direction.sign(), system.walls(gap, side)[nth].at);
                let row = affine(&domain.unit(gap), -sign, sign * at, width);
                let order = on_wall.map_or(0, |(wall, order)| if wall == direction { order } else { 0 });
                let ending = match mode {
                    Mode::Onset(own) if own == direction => Ending::OnsetEnds(gap, own),
                    _ => Ending::Reaches(gap, direction),
                };
                add(ending, row, order);
            }
            if let Mode::Onset(side) = mode {
                let row = affine(&domain.accelerations[gap], side.sign(), 0.0, width);
                add(Ending::PressingEnds(gap, side), row, from_force);
            } else if let Some(force) = self.force(gap)
                && !system.is_zero_at_wall(gap, side_of(level), self.stage, &self.pieces)
            {
                let side = side_of(level);
                match mode {
                    Mode::Open => {
                        add(Ending::Closes(gap, side), affine(&force, -1.0, 0.0, width), from_force);
                    }
                    _ => add(Ending::Opens(gap, side), force, from_force),
                }
            }
        }
        for (i, element) in system.elements.iter().enumerate() {
            match (self.slides[i], &domain.holds[i]) {
                (Slide::Sticks, Some(hold)) => {
                    for next in [Slide::Forwards, Slide::Backwards] {
                        let room = affine(hold, -next.sign(), element.static_force, width);
                        add(Ending::Slips(i, next), room, 0);
                    }
                }
                (Slide::Sticks, None) => {}
                (slide, _) => {
                    let rate = affine(&system.sliding_rate(i), slide.sign(), 0.0, width);
                    add(Ending::RateVanishes(i), rate, self.from_rate[i]);
                }
            }
        }
        for i in 0..CURVES {
            let Some((force, row)) = system.bent(i, &self.slides) else { continue };
            let piece = usize::from(self.pieces[i]);
            for (is_upper, border) in [(false, piece.wrapping_sub(1)), (true, piece)] {
                let Some(at) = force.borders.get(border) else { continue };
                let sign = if is_upper { -1.0 } else { 1.0 };
                let order = self.at_end[i].filter(|end| end.0 == is_upper).map_or(0, |end| end.1);
                add(Ending::Bends(i, is_upper), affine(&row, sign, -sign * at, width), order);
            }
        }
        watches
    }

    /// Integrates from one time since phase 0 to another, in radians. None if the integration fails. A change of the stage at `until` takes
    /// place; a change at `from` has taken place before.
    pub fn advance(&mut self, from: f64, until: f64) -> Option<()> {
        let period = std::f64::consts::TAU;
        let periods = (from / period).floor().max(0.0);
        let of_period = |n: f64| {
            let schedule = self.system.machine.schedule.iter();
            schedule.map(move |&(phase, stage)| ((periods + n + phase) * period, stage))
        };
        let changes: Vec<(f64, usize)> = [0.0, 1.0]
            .into_iter()
            .flat_map(of_period)
            .filter(|(at, _)| (from..=until).contains(at) && *at != from)
            .collect();
        let mut t = from;
        for (change, stage) in changes {
            self.advance_in_stage(t, change)?;
            self.stage = stage;
            // At the end of a period, the phase is exactly 0.
            self.settle(&events::Exempt::default(), change % period, change);
            t = change;
        }
        self.advance_in_stage(t, until)
    }

    fn advance_in_stage(&mut self, from: f64, until: f64) -> Option<()> {
        let mut t = from;
        for _ in 0..ENDINGS {
            if t >= until {
                return self.y.iter().all(|x| x.abs() < ESCAPE).then_some(());
            }
            let domain = self.domain();
            let point = domain.point(&self.y, t);
            let watches = self.watches(&domain, &point);
            let mut last = (0.0, self.y, domain.jet(&point));
            let mut found = None;
            let mut step = |x: f64, y: &Numbers| {
                if x <= last.0 {
                    return false;
                }
                let jet = domain.jet(&domain.point(y, t + x));
                let (begun, start, before) = std::mem::replace(&mut last, (x, *y, jet));
                let fall = |watch: &Watch| {
                    let order = if begun == 0.0 { watch.order } else { 0 };
                    let ends = [before, jet].map(|jet| jet.map(|point| dot(&watch.row, &point)));
                    roots::first_fall(ends, x - begun, order)
                };
                let falls = watches.iter().enumerate().filter_map(|(i, watch)| Some((fall(watch)?, i)));
                let first = falls.min_by(|a, b| a.0.total_cmp(&b.0));
                found = first.map(|(share, i)| (i, begun, start, share * (x - begun)));
                found.is_some()
            };
            let rest = until - t;
            let end = match rest <= SHORT * domain.radian {
                true => {
                    let end = taylor(&domain, &point, rest);
                    step(rest, &end);
                    end
                }
                false => run(&domain, &self.y, t, rest, &mut step)?,
            };
            let Some((i, begun, start, guess)) = found else {
                self.y = end;
                self.leave_walls(&domain, rest);
                self.tie();
                t = until;
                continue;
            };
            let watch = &watches[i];
            let order = if begun == 0.0 { watch.order } else { 0 };
            let (tau, y) = match guess > 0.0 {
                true => locate(&domain, watch, order, &start, t + begun, guess)?,
                false => (0.0, start),
            };
            let elapsed = begun + tau;
            if elapsed > 0.0 {
                self.y = y;
                self.leave_walls(&domain, elapsed);
            }
            t += elapsed;
            self.act(watch.ending, t);
        }
        None
    }

    /// Adds a time without events to the tally. Afterwards gaps are off their walls, and the flight has no roots at its start.
    fn leave_walls(&mut self, domain: &Domain, time: f64) {
        if self.gaps.iter().take(self.system.gaps()).any(|gap| gap.contact().is_some()) {
            self.tally.meshing_time += time;
        }
        for gap in 0..self.system.gaps() {
            if !self.is_kept(domain, gap) {
                self.gaps[gap].on_wall = None;
            }
            self.gaps[gap].from_force = 0;
        }
        self.from_rate = [0; MOST_FRICTION];
        self.at_end = [None; CURVES];
    }
}

/// Returns the state after a short time.
fn taylor(domain: &Domain, point: &PhasePoint, time: f64) -> Numbers {
    let jet: [PhasePoint; TERMS] = domain.jet(point);
    let of = |i: usize| {
        jet.iter().enumerate().rev().fold(0.0, |sum, (k, term)| term[i] + sum * time / (k + 1) as f64)
    };
    std::array::from_fn(|i| if i < 2 * domain.accelerations.len() { of(i) } else { 0.0 })
}

/// Integrates in a domain by DOP853. `step` receives the end of each step and may stop there.
fn run(
    domain: &Domain,
    y: &Numbers,
    t: f64,
    duration: f64,
    step: &mut dyn FnMut(f64, &Numbers) -> bool,
) -> Option<Numbers> {
    match domain.accelerations.len() {
        1..=2 => run_in::<5>(domain, y, t, duration, step),
        3..=4 => run_in::<9>(domain, y, t, duration, step),
        5..=6 => run_in::<13>(domain, y, t, duration, step),
        _ => run_in::<17>(domain, y, t, duration, step),
    }
}

/// Integrates states of `N` numbers, of which the last one is the time.
fn run_in<const N: usize>(
    domain: &Domain,
    y: &Numbers,
    t: f64,
    duration: f64,
    step: &mut dyn FnMut(f64, &Numbers) -> bool,
) -> Option<Numbers> {
    let n = domain.accelerations.len();
    let numbers = |y: &[f64; N]| -> Numbers { std::array::from_fn(|i| if i < 2 * n { y[i] } else { 0.0 }) };
    let field = |y: &[f64; N]| {
        let point = domain.point(y, y[N - 1]);
        let mut rate = [0.0; N];
        for i in 0..n {
            rate[i] = y[n + i];
            rate[n + i] = dot(&domain.accelerations[i][..domain.width], &point[..domain.width]);
        }
        rate[N - 1] = 1.0;
        rate
    };
    let start = std::array::from_fn(|i| if i + 1 == N { t } else { y[i] });
    let settings = Integration { tolerance: TOLERANCE, longest: LONGEST * domain.radian, samples: None };
    let watch = |x: f64, y: &[f64; N]| step(x, &numbers(y));
    settings.run(start, duration, field, watch)?.last().map(|(_, y)| numbers(y))
}

/// Locates the root of a function near `guess`, a time since `t`, and returns it with the state there.
fn locate(
    domain: &Domain,
    watch: &Watch,
    order: usize,
    start: &Numbers,
    t: f64,
    guess: f64,
) -> Option<(f64, Numbers)> {
    let mut tau = guess;
    if tau <= SHORT * domain.radian {
        let point = domain.point(start, t);
        let mut terms = domain.jet::<TERMS>(&point).map(|point| dot(&watch.row, &point));
        terms.iter_mut().enumerate().fold(1.0, |factorial, (k, term)| {
            *term /= factorial;
            factorial * (k + 1) as f64
        });
        for _ in 0..NEWTON_CAP {
            let [mut value, mut rate] = [0.0; 2];
            for term in terms[order..].iter().rev() {
                (value, rate) = (value * tau + term, rate * tau + value);
            }
            let next = tau - value / rate;
            if !(0.5 * tau..2.0 * tau).contains(&next) {
                break;
            }
            tau = next;
        }
        return Some((tau, taylor(domain, &point, tau)));
    }
    for _ in 0..NEWTON_CAP {
        let y = run(domain, start, t, tau, &mut |_, _| false)?;
        let point = domain.point(&y, t + tau);
        let step = -dot(&watch.row, &point) / dot(&watch.row, &domain.derivative(&point));
        if step.abs() <= NEWTON_ENDS * domain.radian {
            return Some((tau + step, taylor(domain, &point, step)));
        }
        // Near a double root, the root of the polynomial is accurate enough.
        if step.is_nan() || step.abs() >= 0.1 * tau {
            return Some((tau, y));
        }
        tau += step;
    }
    Some((tau, run(domain, start, t, tau, &mut |_, _| false)?))
}
