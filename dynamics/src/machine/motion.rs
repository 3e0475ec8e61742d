//! The motion of a machine from event to event.
//!
//! Observers are trait objects, so that the program has one copy of this code.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::domain::{Constraint, Constraints, Domain, DomainKey, Path, Row};
use super::flight::Flight;
use super::modes::{AtRest, GapMode, Modes, ROUNDING, STAYS_ZERO, first_derivative};
use super::polynomial::{Fall, first_fall};
use super::system::{Phasors, System};
use super::{Numbers, Point, SIZE};
use crate::model::{Contact, MOST_FRICTION, MOST_GAPS, Side, Wall};
use crate::motion::{
    Allowance, Clock, EVENTS_PER_PERIOD_CAP, EventKind, GRAZING_SPEED, GapEvent, HUGE, NO_SPEED, Observer,
    STEPS_PER_PERIOD_CAP, Slip, SlipEvent, Slips, Stop, Work,
};
use crate::word;

/// Height of a flight, relative to the scale of length, that is not followed in a series of impacts.
pub const LOWEST_FLIGHT: f64 = 1e-13;

/// Order of the root of the distance when the gap leaves a rigid wall: its acceleration is zero, the derivative is not.
const RELEASE_ORDER: usize = 3;

/// Tangents larger than this or smaller than its inverse are rescaled.
const LARGEST_TANGENT: f64 = 1e100;

/// Decisions on elements at rest after one event.
const MOST_DECISIONS: usize = 16;

/// Rounding error of a gap that lies on a wall, relative to the terms of the gap and the wall's position.
const ON_WALL: f64 = 4.0 * f64::EPSILON;

/// What ends the present modes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Watch {
    /// The gap reaches the next wall in a direction.
    Wall(usize, Side),
    /// The gap of a contact onset comes back to its wall.
    OnsetEnds(usize, Side),
    /// The gap of a contact onset is not pressed to its wall any more.
    PressingEnds(usize, Side),
    /// The gap comes back from behind its wall.
    Leaves(usize, Side),
    /// A wall that only pushes would begin to pull.
    ForceEnds(usize, Side),
    /// A wall that only pushes begins to push.
    ForceBegins(usize, Side),
    /// A rigid wall would have to pull.
    PushEnds(usize, Side),
    /// A sliding rate vanishes.
    RateVanishes(usize),
    /// A holding force reaches its limit for sliding in a direction.
    Slips(usize, Slip),
}

/// What an impact leads to.
struct Outcome {
    /// Modes and state if the gap leaves the wall.
    free: Modes,
    bounced: Numbers,
    /// Modes and state if contact lasts.
    lasting: Option<(Modes, Numbers)>,
    /// Acceleration towards the wall, in free motion after the impact, or its first derivative that is not 0.
    pressing: f64,
}

/// The motion of a machine, with any number of tangent vectors.
#[derive(Clone, Debug)]
pub struct Motion<'s> {
    system: &'s System,
    modes: Modes,
    key: DomainKey,
    domain: Arc<Domain>,
    /// Memory for a step, and for what may end the present modes.
    path: Option<Box<Path>>,
    watches: Vec<Watch>,
    y: Numbers,
    clock: Clock,
    /// The harmonics at the present time.
    phasors: Phasors,
    goal: f64,
    period: u64,
    /// Index of the next change of the stage.
    change: usize,
    /// For a gap on a wall: the direction of the wall from the gap, and the order of the root of the distance.
    at_wall: [Option<(Side, usize)>; MOST_GAPS],
    /// Orders of the roots of pushing forces, and of pressing accelerations in a contact onset; 0 without a root.
    from_force: [usize; MOST_GAPS],
    /// Orders of the roots of the sliding rates.
    from_rate: [usize; MOST_FRICTION],
    /// The side of each gap's last event.
    origin: [Option<Side>; MOST_GAPS],
    has_slid: [bool; MOST_FRICTION],
    tangents: Vec<Numbers>,
    log_scale: f64,
    /// State before the event, and derivative of the velocities' jump.
    before: Numbers,
    reset: Option<DMatrix<f64>>,
    events_in_period: u64,
    steps_in_period: u64,
    contact_time: f64,
    sticking_time: f64,
    near_grazing: bool,
    work: Work,
    allowance: Allowance<'s>,
}

impl<'s> Motion<'s> {
    /// Starts at phase 0 in the state `(x1, v1, x2, v2, ...)`.
    ///
    /// A gap behind a wall with a force is in contact. A gap behind a rigid wall is moved by
    /// [`put_on_walls`](crate::model::Oscillator::put_on_walls).
    pub fn new(system: &'s System, state: &[f64]) -> Motion<'s> {
        let stage = system.machine.first_stage();
        let modes = Modes { stage, gaps: [GapMode::Beyond(0); MOST_GAPS], slips: Slips::default() };
        let begins_now = system.schedule.first().is_some_and(|change| change.0 == 0.0);
        let mut motion = Motion {
            system,
            modes,
            key: modes.key(system),
            domain: system.domain(modes.key(system)),
            path: None,
            watches: Vec::new(),
            y: system.to_flow(&system.machine.put_on_walls(state)),
            clock: Clock::default(),
            phasors: system.phasors(0.0),
            goal: 0.0,
            period: 0,
            change: usize::from(begins_now),
            at_wall: [None; MOST_GAPS],
            from_force: [0; MOST_GAPS],
            from_rate: [0; MOST_FRICTION],
            origin: [None; MOST_GAPS],
            has_slid: [false; MOST_FRICTION],
            tangents: Vec::new(),
            log_scale: 0.0,
            before: [0.0; SIZE],
            reset: None,
            events_in_period: 0,
            steps_in_period: 0,
            contact_time: 0.0,
            sticking_time: 0.0,
            near_grazing: false,
            work: Work::default(),
            allowance: Allowance::UNLIMITED,
        };
        motion.enter();
        motion
    }

    /// Starts from another state at phase 0, in the modes of this motion and with its remaining allowance. The state alone does not determine
    /// the modes: a gap just in front of a wall may be free or in a contact onset.
    pub fn at(&self, state: &[f64], tangents: Vec<Numbers>) -> Motion<'s> {
        let mut started = Motion::new(self.system, state);
        started.allowance = self.allowance();
        started.origin = self.origin;
        for gap in 0..self.system.gaps() {
            match self.modes.gaps[gap] {
                GapMode::Stuck(side) => {
                    started.y[gap] = self.last_wall(gap, side).at;
                    started.modes.gaps[gap] = GapMode::Stuck(side);
                    started.at_wall[gap] = None;
                }
                GapMode::Onset(side) if started.modes.gaps[gap] == self.before_last(gap, side) => {
                    started.modes.gaps[gap] = GapMode::Onset(side);
                    started.at_wall[gap] = None;
                }
                _ => {}
            }
        }
        started.modes.slips = self.modes.slips;
        started.has_slid = self.modes.slips.map(|slip| slip != Slip::Stick);
        started.from_rate = [0; MOST_FRICTION];
        self.system.hold(&started.modes, &mut started.y, false);
        started.refresh();
        started.set_tangents(tangents);
        started
    }

    /// Replaces the tangent vectors, which are in the coordinates `(x1, v1, x2, v2, ...)`.
    pub fn set_tangents(&mut self, tangents: Vec<Numbers>) {
        self.log_scale = 0.0;
        self.tangents = tangents.iter().map(|tangent| self.system.to_flow(tangent)).collect();
        self.hold_tangents();
    }

    /// Returns the unit vectors of a state.
    pub fn unit_tangents(system: &System) -> Vec<Numbers> {
        (0..2 * system.n).map(|i| std::array::from_fn(|j| f64::from(u8::from(i == j)))).collect()
    }

    /// Returns the tangent vectors, divided by the exponential of [`log_scale`](Self::log_scale).
    pub fn tangents(&self) -> Vec<Numbers> {
        self.tangents.iter().map(|tangent| self.system.to_state(tangent)).collect()
    }

    /// Returns the logarithm of the common factor of all tangent vectors.
    pub fn log_scale(&self) -> f64 {
        self.log_scale
    }

    /// Returns the matrix whose columns are the tangent vectors.
    pub fn derivative(&self) -> DMatrix<f64> {
        let columns = self.tangents();
        DMatrix::from_fn(2 * self.system.n, columns.len(), |i, j| columns[j][i] * self.log_scale.exp())
    }

    /// Returns the present state `(x1, v1, x2, v2, ...)`.
    pub fn state(&self) -> Numbers {
        self.system.to_state(&self.y)
    }

    /// Returns the machine.
    pub fn system(&self) -> &'s System {
        self.system
    }

    /// Returns the present modes.
    pub(super) fn modes(&self) -> Modes {
        self.modes
    }

    /// Returns the walls that gaps lie on: the direction, and the order of the root of the distance.
    pub(super) fn walls_at(&self) -> [Option<(Side, usize)>; MOST_GAPS] {
        self.at_wall
    }

    /// Returns the side of each gap's last event.
    pub(super) fn origins(&self) -> [Option<Side>; MOST_GAPS] {
        self.origin
    }

    /// Returns the orders of the roots of pushing forces and of sliding rates.
    pub(super) fn root_orders(&self) -> ([usize; MOST_GAPS], [usize; MOST_FRICTION]) {
        (self.from_force, self.from_rate)
    }

    /// Returns the present state in the coordinates of the flow.
    pub(super) fn flow_state(&self) -> &Numbers {
        &self.y
    }

    /// Returns the number of completed forcing periods.
    pub fn period(&self) -> u64 {
        self.period
    }

    /// Returns the time since the last phase 0.
    pub fn time_in_period(&self) -> f64 {
        self.clock.time()
    }

    /// Returns the time during which at least one gap was in lasting contact.
    pub fn contact_time(&self) -> f64 {
        self.contact_time
    }

    /// Returns the time during which an element with dry friction stuck.
    pub fn sticking_time(&self) -> f64 {
        self.sticking_time
    }

    /// Returns the side of the contact of a gap that lasts.
    pub fn contact(&self, gap: usize) -> Option<Side> {
        match self.modes.gaps[gap] {
            GapMode::Open(side) => self.before_last(gap, side).contact(),
            mode => mode.contact(),
        }
    }

    /// Whether no contact lasts.
    pub(crate) fn is_free(&self) -> bool {
        (0..self.system.gaps()).all(|gap| self.contact(gap).is_none())
    }

    /// Returns the modes of dry friction.
    pub fn slips(&self) -> Slips {
        self.modes.slips
    }

    /// Returns the number of elements with dry friction that have not slid since the start.
    pub fn never_slid(&self) -> usize {
        self.system.elements.iter().zip(self.has_slid).filter(|(_, has_slid)| !has_slid).count()
    }

    /// Whether an event was so near to grazing that the tangents are not reliable.
    pub fn near_grazing(&self) -> bool {
        self.near_grazing
    }

    /// Clears the flag of earlier events near to grazing.
    pub fn clear_near_grazing(&mut self) {
        self.near_grazing = false;
    }

    /// Returns the counters of work.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Sets the work that the motion may take from here on.
    pub fn allow(&mut self, allowance: Allowance<'s>) {
        self.allowance = Allowance {
            steps: allowance.steps.saturating_add(self.work.steps),
            events: allowance.events.saturating_add(self.work.events),
            ..allowance
        };
    }

    pub(crate) fn allowance(&self) -> Allowance<'s> {
        self.allowance.after(self.work)
    }

    /// Whether another motion is in the same modes. Contact onset and pressed contact count as equal for a gap on its wall.
    pub(crate) fn is_in_modes_of(&self, other: &Motion<'_>) -> bool {
        let is_on_wall = |gap: usize, side: Side| {
            let wall = self.last_wall(gap, side).at;
            (self.y[gap] - wall).abs() <= 1e-9 * wall.abs().max(self.system.length)
        };
        self.modes.slips == other.modes.slips
            && (0..self.system.gaps()).all(|gap| {
                self.modes.gaps[gap] == other.modes.gaps[gap]
                    || self.contact(gap) == other.contact(gap)
                        && self.contact(gap).is_some_and(|side| is_on_wall(gap, side))
            })
    }

    /// Whether a gap in free motion reaches the next wall within a time, or has passed it within that time.
    pub(crate) fn passes_wall(&self, time: f64) -> bool {
        (0..self.system.gaps()).any(|gap| {
            let mut ahead = Side::BOTH.into_iter().filter_map(|side| self.wall_ahead(gap, side));
            ahead.any(|(side, number)| {
                (self.y[gap] - self.system.walls(gap, side)[number].at).abs() < time * self.rate(gap).abs()
            })
        })
    }

    /// Whether another motion is in the same modes, with gaps on the same walls and from the same walls.
    pub(crate) fn is_where(&self, other: &Motion<'_>) -> bool {
        self.modes == other.modes && self.origin == other.origin && self.at_wall == other.at_wall
    }

    /// Multiplies each entry of the state by 1 and a share, to simulate rounding.
    pub(crate) fn perturb(&mut self, mut share: impl FnMut() -> f64) {
        let n = self.system.n;
        self.y[..2 * n].iter_mut().for_each(|y| *y += share() * *y);
        self.system.hold(&self.modes, &mut self.y, false);
    }

    /// Integrates to the next phase 0.
    ///
    /// # Errors
    /// A [`Stop`] if the motion cannot be continued.
    pub fn advance_period(&mut self, observer: &mut dyn Observer) -> Result<(), Stop> {
        self.advance_to(self.system.period, observer)?;
        self.set_clock(0.0);
        self.change = 0;
        if self.system.schedule.first().is_some_and(|change| change.0 == 0.0) {
            self.set_clock(self.system.period);
            self.enter_stage(self.system.schedule[0].1, observer);
            self.set_clock(0.0);
            self.change = 1;
        }
        self.period += 1;
        (self.events_in_period, self.steps_in_period) = (0, 0);
        Ok(())
    }

    /// Integrates to a time since the last phase 0 of at most the forcing period.
    ///
    /// # Errors
    /// A [`Stop`] if the motion cannot be continued.
    pub fn advance_to(&mut self, until: f64, observer: &mut dyn Observer) -> Result<(), Stop> {
        if self.allowance.is_halted() {
            return Err(Stop::TooStiff);
        }
        loop {
            let change = self.system.schedule.get(self.change).filter(|change| change.0 <= until);
            self.goal = change.map_or(until, |change| change.0);
            while self.clock.time() < self.goal {
                self.step(observer)?;
            }
            let Some(&(_, stage)) = change else { return self.check_finite() };
            self.change += 1;
            self.enter_stage(stage, observer);
        }
    }

    fn check_finite(&self) -> Result<(), Stop> {
        let n = self.system.n;
        if !self.y.iter().all(|x| x.abs() < HUGE) {
            return Err(Stop::NonFinite);
        }
        let extent: f64 = self.y[..n].iter().map(|x| x.abs()).sum();
        if extent <= self.system.escape { Ok(()) } else { Err(Stop::Escape) }
    }

    fn check_events(&self) -> Result<(), Stop> {
        let is_over =
            self.events_in_period > EVENTS_PER_PERIOD_CAP || self.work.events > self.allowance.events;
        if is_over { Err(Stop::CapEvents) } else { Ok(()) }
    }

    fn set_clock(&mut self, time: f64) {
        self.clock.set(time);
        self.phasors = self.system.phasors(time);
    }

    fn point(&self) -> Point {
        self.system.point(&self.y, &self.phasors)
    }

    /// Enters the domain of the present modes.
    fn refresh(&mut self) {
        let key = self.modes.key(self.system);
        if key != self.key {
            (self.key, self.domain) = (key, self.system.domain(key));
        }
    }

    fn rate(&self, gap: usize) -> f64 {
        self.y[self.system.n + gap]
    }

    fn last_wall(&self, gap: usize, side: Side) -> &'s Wall {
        self.system.walls(gap, side).last().expect("there is a wall on this side")
    }

    /// Returns the mode of a gap in front of the last wall of a side.
    fn before_last(&self, gap: usize, side: Side) -> GapMode {
        GapMode::Beyond(signed(side, self.system.walls(gap, side).len() - 1))
    }

    /// Returns side and number of the wall that lies in a direction from the gap.
    fn wall_ahead(&self, gap: usize, direction: Side) -> Option<(Side, usize)> {
        let GapMode::Beyond(passed) = self.modes.gaps[gap] else { return None };
        let number = usize::from(passed.unsigned_abs());
        if passed == 0 || (passed > 0) == (direction == Side::Right) {
            (number < self.system.walls(gap, direction).len()).then_some((direction, number))
        } else {
            Some((direction.mirrored(), number - 1))
        }
    }

    /// Whether constraints keep a gap where it is.
    fn is_kept(&self, gap: usize) -> bool {
        self.domain.is_still[gap] && self.rate(gap) == 0.0
    }

    /// Lists everything that may end the present modes.
    fn watches(&self, watches: &mut Vec<Watch>) {
        for gap in 0..self.system.gaps() {
            if let GapMode::Stuck(side) = self.modes.gaps[gap] {
                watches.push(Watch::PushEnds(gap, side));
                continue;
            }
            if self.is_kept(gap) {
                continue;
            }
            match self.modes.gaps[gap] {
                GapMode::Beyond(passed) => {
                    let ahead = |&direction: &Side| self.wall_ahead(gap, direction).is_some();
                    watches.extend(Side::BOTH.into_iter().filter(ahead).map(|side| Watch::Wall(gap, side)));
                    let side = if passed > 0 { Side::Right } else { Side::Left };
                    let is_last = self.system.walls(gap, side).len() == usize::from(passed.unsigned_abs());
                    if passed != 0 && is_last && self.system.pushing(gap, side).is_some() {
                        watches.push(Watch::ForceEnds(gap, side));
                    }
                }
                GapMode::Onset(side) => {
                    watches.extend([Watch::OnsetEnds(gap, side), Watch::PressingEnds(gap, side)]);
                    if self.behind(gap, side).is_some() {
                        watches.push(Watch::Wall(gap, side.mirrored()));
                    }
                }
                GapMode::Pressed(side) => watches.push(Watch::Leaves(gap, side)),
                GapMode::Open(side) => {
                    watches.extend([Watch::Leaves(gap, side), Watch::ForceBegins(gap, side)]);
                }
                GapMode::Stuck(_) => {}
            }
        }
        for i in 0..self.system.elements.len() {
            match self.modes.slips[i] {
                Slip::Stick if self.domain.holds[i].is_some() => {
                    watches.extend([Watch::Slips(i, Slip::Forward), Watch::Slips(i, Slip::Backward)]);
                }
                Slip::Stick => {}
                _ => watches.push(Watch::RateVanishes(i)),
            }
        }
    }

    /// Returns side and number of the wall that a contact onset may reach backwards.
    fn behind(&self, gap: usize, side: Side) -> Option<(Side, usize)> {
        match self.system.walls(gap, side).len() {
            1 => self.system.walls(gap, side.mirrored()).first().map(|_| (side.mirrored(), 0)),
            count => Some((side, count - 2)),
        }
    }

    /// Returns the function whose root a watch is, positive before, and the order of its root at this instant.
    fn function(&self, watch: Watch) -> (Row, usize) {
        let (system, domain, width) = (self.system, &self.domain, self.system.width());
        if let Some((gap, at, direction)) = self.distance(watch) {
            let sign = direction.sign();
            return (
                domain.unit_row(gap).scaled(-sign).plus(sign * at, width),
                self.order_at_wall(gap, direction),
            );
        }
        match watch {
            Watch::PressingEnds(gap, side) => {
                (domain.accelerations[gap].scaled(side.sign()), self.from_force[gap])
            }
            Watch::ForceEnds(gap, side) => (self.force(gap, side), self.from_force[gap]),
            Watch::ForceBegins(gap, side) => (self.force(gap, side).scaled(-1.0), self.from_force[gap]),
            Watch::PushEnds(gap, _) => {
                (domain.pushes[gap].clone().unwrap_or_else(|| domain.unit_row(width - 1)), 0)
            }
            Watch::RateVanishes(i) => {
                (system.rate_row(i, domain).scaled(self.modes.slips[i].sign()), self.from_rate[i])
            }
            Watch::Slips(i, next) => {
                let hold = domain.holds[i].as_ref().expect("the watch was listed");
                (hold.scaled(-next.sign()).plus(system.elements[i].force, width), 0)
            }
            Watch::Wall(..) | Watch::OnsetEnds(..) | Watch::Leaves(..) => unreachable!("these are distances"),
        }
    }

    /// Returns the row of the force of a wall that only pushes.
    fn force(&self, gap: usize, side: Side) -> Row {
        let wall = self.last_wall(gap, side);
        let spring = wall.springs[self.modes.stage];
        let sign = side.sign();
        let mut row = self.domain.unit_row(gap).scaled(sign * spring.stiffness);
        row.0[self.system.n + gap] = sign * spring.damping;
        row.plus(spring.preload - sign * spring.stiffness * wall.at, self.system.width())
    }

    /// Takes one step: to the first event, or as far as the series or the goal allow.
    fn step(&mut self, observer: &mut dyn Observer) -> Result<(), Stop> {
        self.work.steps += 1;
        self.steps_in_period += 1;
        if self.work.steps > self.allowance.steps {
            return Err(Stop::TooStiff);
        }
        if self.steps_in_period > STEPS_PER_PERIOD_CAP {
            return Err(Stop::TooStiff);
        }
        let remaining = self.clock.remaining(self.goal);
        let h = self.domain.unit.min(remaining);
        let point = self.point();
        let mut path = self.path.take().unwrap_or_default();
        self.domain.follow(&point, h, &mut path);
        let first = self.first_event(&point, &path);
        let (share, time) = first.map_or((1.0, h), |(share, _)| (share, share * h));
        if share > 0.0 {
            if let Some(sums) = observer.sums() {
                let (system, start) = (self.system, self.clock.time());
                let (domain, modes, path) = (&*self.domain, &self.modes, &*path);
                Flight { system, domain, modes, path, share, duration: time, start }.add_to(sums);
            }
            self.advance(&path, share, time);
        }
        self.path = Some(path);
        if let Some((_, watch)) = first {
            self.cross(watch, observer);
            return self.check_events();
        }
        if h == remaining {
            self.set_clock(self.goal);
        }
        self.check_size()
    }

    /// Returns the share of the step at which the first watch ends the modes.
    fn first_event(&mut self, point: &Point, path: &Path) -> Option<(f64, Watch)> {
        let mut first: Option<(f64, Watch)> = None;
        let mut watches = std::mem::take(&mut self.watches);
        watches.clear();
        self.watches(&mut watches);
        for &watch in &watches {
            match self.fall(watch, point, path) {
                Fall::None => {}
                Fall::Touches => self.note_touch(watch),
                Fall::At(share) if first.is_none_or(|(earliest, _)| share < earliest) => {
                    first = Some((share, watch));
                }
                Fall::At(_) => {}
            }
        }
        self.watches = watches;
        first
    }

    /// Returns where a watch ends the modes on a step.
    fn fall(&self, watch: Watch, point: &Point, path: &Path) -> Fall {
        if let Some((gap, at, direction)) = self.distance(watch) {
            let (order, sign) = (self.order_at_wall(gap, direction), direction.sign());
            let (size, change) = (at.abs() + point[gap].abs(), path.changes[gap]);
            if order == 0 && sign * (at - point[gap]) > change + ROUNDING * (change + size) {
                return Fall::None;
            }
            let mut distance = path.coordinates[gap].map(|c| -sign * c);
            distance[0] += sign * at;
            return first_fall(&distance, order, size);
        }
        let (row, order) = self.function(watch);
        let order = self.order_at_limit(watch, &row, point).unwrap_or(order);
        first_fall(&self.domain.along(&row, path), order, row.size(point))
    }

    /// Returns gap, position and direction of the wall whose distance a watch is.
    fn distance(&self, watch: Watch) -> Option<(usize, f64, Side)> {
        match watch {
            Watch::Wall(gap, direction) => {
                let ahead = match self.modes.gaps[gap] {
                    GapMode::Onset(side) => self.behind(gap, side),
                    _ => self.wall_ahead(gap, direction),
                };
                let (side, number) = ahead.expect("the watch was listed");
                Some((gap, self.system.walls(gap, side)[number].at, direction))
            }
            Watch::OnsetEnds(gap, side) => Some((gap, self.last_wall(gap, side).at, side)),
            Watch::Leaves(gap, side) => Some((gap, self.last_wall(gap, side).at, side.mirrored())),
            _ => None,
        }
    }

    /// Returns the order of the root of the distance from a wall at this instant.
    fn order_at_wall(&self, gap: usize, direction: Side) -> usize {
        self.at_wall[gap].map_or(0, |(side, order)| if side == direction { order } else { 0 })
    }

    /// Checks the state at every 1024th step.
    fn check_size(&self) -> Result<(), Stop> {
        if self.steps_in_period.is_multiple_of(1024) { self.check_finite() } else { Ok(()) }
    }

    /// Returns the order of the root of a force that holds an element or a gap, if it is at its limit now.
    fn order_at_limit(&self, watch: Watch, row: &Row, point: &Point) -> Option<usize> {
        let is_at_limit = matches!(watch, Watch::Slips(..) | Watch::PushEnds(..))
            && row.dot(point).abs() <= ROUNDING * row.size(point);
        is_at_limit.then(|| first_derivative(&self.domain, row, point, 0).0)
    }

    /// Moves everything to a share of a step.
    fn advance(&mut self, path: &Path, share: f64, time: f64) {
        let before = std::mem::replace(&mut self.y, self.domain.state(path, share));
        if !self.tangents.is_empty() {
            let (carrier, size) = (self.domain.carrier(time), 2 * self.system.n);
            self.tangents.iter_mut().for_each(|tangent| *tangent = carrier.carry(tangent, size));
            self.rescale_tangents();
        }
        self.clock.advance(time);
        self.phasors = self.system.phasors(self.clock.time());
        if !self.is_free() {
            self.contact_time += time;
        }
        if self.system.elements.iter().zip(self.modes.slips).any(|(_, slip)| slip == Slip::Stick) {
            self.sticking_time += time;
        }
        for (gap, before) in before.into_iter().enumerate().take(self.system.gaps()) {
            match self.at_wall[gap] {
                // The gap stays on the wall until another element changes its modes.
                Some((_, STAYS_ZERO)) => (self.y[gap], self.y[self.system.n + gap]) = (before, 0.0),
                _ if self.is_kept(gap) => {}
                _ => self.at_wall[gap] = None,
            }
        }
        (self.from_force, self.from_rate) = ([0; MOST_GAPS], [0; MOST_FRICTION]);
    }

    fn rescale_tangents(&mut self) {
        let size = self.tangents.iter().flatten().fold(0.0f64, |size, x| size.max(x.abs()));
        if size > 0.0 && size.is_finite() && !(1.0 / LARGEST_TANGENT..LARGEST_TANGENT).contains(&size) {
            self.log_scale += size.ln();
            self.tangents.iter_mut().flatten().for_each(|x| *x /= size);
        }
    }

    /// Notes a function that touches zero within rounding. At an elastic wall without a preload the linearisation is valid with and without
    /// contact.
    fn note_touch(&mut self, watch: Watch) {
        let is_harmless = match watch {
            Watch::Wall(gap, direction) => self.wall_ahead(gap, direction).is_some_and(|(side, number)| {
                let wall = &self.system.walls(gap, side)[number];
                wall.contact.is_elastic() && wall.springs.iter().all(|spring| spring.preload == 0.0)
            }),
            Watch::Slips(..) => true,
            _ => false,
        };
        self.near_grazing |= !is_harmless;
    }

    /// Processes the root of a watch at the present state, and lets the tangents jump.
    fn cross(&mut self, watch: Watch, observer: &mut dyn Observer) {
        let (row, _) = self.function(watch);
        if let Watch::Wall(gap, _) | Watch::OnsetEnds(gap, _) | Watch::Leaves(gap, _) = watch {
            self.put_on_wall(gap, &row);
        }
        (self.before, self.reset) = (self.y, None);
        let field = self.domain.derivative(&self.point());
        let energy = self.system.energy(&self.modes, &self.y);
        self.act(watch, observer);
        if let Some(sums) = observer.sums() {
            sums.lost += energy - self.system.energy(&self.modes, &self.y);
        }
        self.refresh();
        if !self.tangents.is_empty() {
            self.saltate(watch, &row, &field);
        }
    }

    /// Puts a gap exactly on the wall of a distance function.
    fn put_on_wall(&mut self, gap: usize, distance: &Row) {
        self.y[gap] = -distance.0[self.system.width() - 1] / distance.0[gap];
    }

    /// Applies `S u = R u + (f+ - R f-) (n . u) / (n . f-)` to every tangent vector.
    fn saltate(&mut self, watch: Watch, row: &Row, field: &Point) {
        let n = self.system.n;
        let reset = self.reset.take();
        let jump = |u: &[f64]| {
            let mut after = [0.0; SIZE];
            after[..2 * n].copy_from_slice(&u[..2 * n]);
            if let Some(reset) = &reset {
                (0..n).for_each(|i| after[n + i] = (0..n).map(|j| reset[(i, j)] * u[n + j]).sum());
            }
            after
        };
        let rate = row.dot(field);
        let least = match watch {
            Watch::Wall(..) | Watch::OnsetEnds(..) | Watch::Leaves(..) => NO_SPEED * self.system.speed,
            _ => 0.0,
        };
        let next = self.domain.derivative(&self.point());
        let carried = jump(field);
        let mut change: Numbers = std::array::from_fn(|i| if i < 2 * n { next[i] - carried[i] } else { 0.0 });
        if rate.abs() <= least {
            self.near_grazing |= reset.is_some() || !matches!(watch, Watch::Wall(..) | Watch::Leaves(..));
            change = [0.0; SIZE];
        } else {
            change.iter_mut().for_each(|x| *x /= rate);
        }
        for tangent in &mut self.tangents {
            let along: f64 = (0..2 * n).map(|i| row.0[i] * tangent[i]).sum();
            *tangent = jump(tangent);
            (0..2 * n).for_each(|i| tangent[i] += change[i] * along);
        }
        self.hold_tangents();
    }

    /// Projects the tangents to the constraints: neighbouring motions rest, too.
    fn hold_tangents(&mut self) {
        for tangent in &mut self.tangents {
            for (entry, mode) in tangent.iter_mut().zip(self.modes.gaps).take(self.system.gaps()) {
                if let GapMode::Stuck(_) = mode {
                    *entry = 0.0;
                }
            }
            self.system.hold(&self.modes, tangent, true);
        }
    }

    fn act(&mut self, watch: Watch, observer: &mut dyn Observer) {
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
                self.at_wall[gap] = Some((side.mirrored(), 1));
                return;
            }
            Watch::PressingEnds(gap, side) => {
                self.end_contact(gap, side, observer);
                self.at_wall[gap] = None;
            }
            Watch::Leaves(gap, side) if self.modes.gaps[gap] == GapMode::Open(side) => {
                if side.sign() * self.rate(gap) < 0.0 {
                    self.modes.gaps[gap] = self.before_last(gap, side);
                    self.leave(gap, side);
                } else {
                    self.modes.gaps[gap] = self.before_last(gap, side);
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
                self.note_root_of_force(gap, side);
            }
            Watch::ForceBegins(gap, side) => {
                self.begin_force(gap, side, observer);
            }
            Watch::PushEnds(gap, side) => {
                self.end_contact(gap, side, observer);
                self.at_wall[gap] = Some((side, RELEASE_ORDER));
                exempt.gaps[gap] = Some(side);
            }
            Watch::RateVanishes(i) => self.end_sliding(i, observer),
            Watch::Slips(i, next) => {
                self.begin_sliding(i, next, observer);
                exempt.elements[i] = true;
            }
        }
        self.settle(&exempt, observer);
        for gap in 0..self.system.gaps() {
            if let Some((side, STAYS_ZERO)) = self.at_wall[gap] {
                self.leave(gap, side);
            }
        }
    }

    /// Begins contact with a wall that only pushes.
    fn begin_force(&mut self, gap: usize, side: Side, observer: &mut dyn Observer) {
        let count = self.system.walls(gap, side).len();
        self.record(gap, EventKind::MeshStart, side, count - 1, Some(side), observer);
        self.modes.gaps[gap] = GapMode::Beyond(signed(side, count));
        self.note_root_of_force(gap, side);
    }

    /// Notes the order of the root of a pushing wall's force, which is 0 now.
    fn note_root_of_force(&mut self, gap: usize, side: Side) {
        self.refresh();
        self.from_force[gap] = first_derivative(&self.domain, &self.force(gap, side), &self.point(), 1).0;
    }

    /// Ends a lasting contact with the last wall of a side.
    fn end_contact(&mut self, gap: usize, side: Side, observer: &mut dyn Observer) {
        let next = self.before_last(gap, side);
        let last = self.system.walls(gap, side).len() - 1;
        self.record(gap, EventKind::MeshEnd, side, last, next.contact(), observer);
        self.modes.gaps[gap] = next;
    }

    /// Notes that a gap lies on the wall in a direction, and does not pass it.
    fn leave(&mut self, gap: usize, direction: Side) {
        self.at_wall[gap] = Some((direction, self.order(gap)));
    }

    /// Returns the order of the root of a gap's distance from the wall on which it lies.
    fn order(&mut self, gap: usize) -> usize {
        if self.rate(gap) != 0.0 {
            return 1;
        }
        self.refresh();
        first_derivative(&self.domain, &self.domain.unit_row(gap), &self.point(), 2).0
    }

    /// Whether the acceleration of a gap points in a direction.
    fn is_pressed(&mut self, gap: usize, direction: Side) -> bool {
        self.refresh();
        direction.sign() * self.domain.accelerations[gap].dot(&self.point()) > 0.0
    }

    /// Whether a gap at rest begins to move in a direction.
    fn heads(&mut self, gap: usize, direction: Side) -> bool {
        self.refresh();
        let row = self.domain.unit_row(gap);
        direction.sign() * first_derivative(&self.domain, &row, &self.point(), 2).1 > 0.0
    }

    /// Processes a gap that reaches a wall in a direction.
    fn reach(&mut self, gap: usize, direction: Side, observer: &mut dyn Observer) {
        let Some((side, number)) = self.wall_ahead(gap, direction) else { return };
        let wall = &self.system.walls(gap, side)[number];
        self.y[gap] = wall.at;
        let closing = direction.sign() * self.rate(gap);
        if closing < 0.0 || closing == 0.0 && !self.heads(gap, direction) {
            self.leave(gap, direction);
            return;
        }
        let is_tiny = 0.0 < closing && closing < NO_SPEED * self.system.speed;
        if is_tiny && !wall.contact.is_elastic() && !self.is_pressed(gap, direction) {
            // Impacts of two gaps in turn end here: both leave their walls from rest.
            self.y[self.system.n + gap] = 0.0;
            self.near_grazing = true;
            self.work.events += 1;
            self.events_in_period += 1;
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
            if is_last && self.system.pushing(gap, side).is_some() && !self.closes(gap, side) {
                self.modes.gaps[gap] = GapMode::Open(side);
                self.leave(gap, side.mirrored());
                self.start_from_force(gap, side);
                return;
            }
            self.record(gap, EventKind::MeshStart, side, number, Some(side), observer);
            self.modes.gaps[gap] = GapMode::Beyond(passed + step);
            let spring = wall.springs[self.modes.stage];
            if closing == 0.0 && spring.preload != 0.0 && !self.heads(gap, side) {
                // Rest on the wall under a load below the preload is an infinite series of contacts.
                self.events_in_period = EVENTS_PER_PERIOD_CAP;
            }
            self.near_grazing |= spring.preload != 0.0 && closing < GRAZING_SPEED * self.system.speed;
            self.leave(gap, side.mirrored());
            self.start_from_force(gap, side);
        } else {
            self.impact(gap, side, wall, observer);
        }
    }

    /// Whether a wall that only pushes has a force for a gap on it or behind it.
    fn closes(&mut self, gap: usize, side: Side) -> bool {
        self.refresh();
        first_derivative(&self.domain, &self.force(gap, side), &self.point(), 0).1 > 0.0
    }

    /// Notes the order of the root of a force at a flight's start.
    fn start_from_force(&mut self, gap: usize, side: Side) {
        if self.system.pushing(gap, side).is_some() {
            self.refresh();
            self.from_force[gap] = first_derivative(&self.domain, &self.force(gap, side), &self.point(), 0).0;
        }
    }

    /// Processes an impact, after which the gap leaves the wall, or a lasting contact begins.
    fn impact(&mut self, gap: usize, side: Side, wall: &Wall, observer: &mut dyn Observer) {
        let (system, n) = (self.system, self.system.n);
        let (approach, number) = (side.sign() * self.rate(gap), system.walls(gap, side).len() - 1);
        let [e, slope] = wall.restitution.at(approach);
        let mut kept = [false; MOST_GAPS];
        let (kick, Outcome { free, bounced, lasting, pressing }) = loop {
            let (kick, let_go) = self.joint_impact(gap, side, kept);
            let outcome = self.outcome(gap, side, wall, e, &kick, let_go);
            // Gaps with too low a flight stay at rest. Otherwise the impacts of two gaps might alternate for ever.
            let (modes, y) = outcome.lasting.unwrap_or((outcome.free, outcome.bounced));
            let (domain, point) = (system.domain(modes.key(system)), system.point(&y, &self.phasors));
            let low = (0..system.gaps()).find(|&other| {
                let GapMode::Stuck(side) = self.modes.gaps[other] else { return false };
                let (row, leaving) = (domain.unit_row(other), -side.sign() * y[n + other]);
                let presses = side.sign() * first_derivative(&domain, &row, &point, 2).1 > 0.0;
                let_go[other] && presses && leaving <= self.lowest_speed(&domain, other, &point)
            });
            match low {
                Some(other) => kept[other] = true,
                None => break (kick, outcome),
            }
        };
        if lasting.is_none() && pressing <= 0.0 && approach < GRAZING_SPEED * system.speed {
            self.near_grazing = true;
        }
        let stops = lasting.is_some() && wall.contact == Contact::Rigid;
        let factor = if stops { 1.0 } else { 1.0 + e + slope * approach };
        let mut reset = DMatrix::identity(n, n);
        (0..n).for_each(|i| reset[(i, gap)] -= kick[i] * factor);
        self.reset = Some(match self.reset.take() {
            Some(earlier) => reset * earlier,
            None => reset,
        });
        let kind = if lasting.is_some() { EventKind::MeshStart } else { EventKind::Impact };
        let (next, y) = lasting.unwrap_or((free, bounced));
        self.y = y;
        let is_meshing = kind == EventKind::MeshStart;
        let lasts = if is_meshing { Some(side) } else { self.before_last(gap, side).contact() };
        self.record(gap, kind, side, number, lasts, observer);
        if !is_meshing {
            self.work.impacts += 1;
        }
        self.modes.gaps[gap] = next.gaps[gap];
        self.change_modes(&next, None, observer);
        match next.gaps[gap] {
            GapMode::Stuck(_) => self.at_wall[gap] = None,
            GapMode::Pressed(_) => self.leave(gap, side.mirrored()),
            _ => self.leave(gap, side),
        }
        self.before = self.y;
    }

    /// Returns the leaving speed of a flight that is not followed in a series of impacts.
    fn lowest_speed(&self, domain: &Domain, gap: usize, point: &Point) -> f64 {
        let pressing = domain.accelerations[gap].dot(point).abs();
        (2.0 * LOWEST_FLIGHT * self.system.length * pressing).sqrt()
    }

    /// Returns what an impact leads to, given its coefficient of restitution, the changes of all rates, and which gaps at rest it lets go.
    fn outcome(
        &self,
        gap: usize,
        side: Side,
        wall: &Wall,
        e: f64,
        kick: &[f64],
        let_go: [bool; MOST_GAPS],
    ) -> Outcome {
        let (system, n) = (self.system, self.system.n);
        let approach = side.sign() * self.rate(gap);
        let leaving = e * approach;
        let after = |change: f64| {
            let mut y = self.y;
            (0..n).for_each(|i| y[n + i] += kick[i] * change);
            y
        };
        let mut modes = self.modes;
        for other in (0..system.gaps()).filter(|&other| let_go[other]) {
            let GapMode::Stuck(side) = modes.gaps[other] else { continue };
            modes.gaps[other] = self.before_last(other, side);
        }
        let mut bounced = after(-side.sign() * (1.0 + e) * approach);
        bounced[n + gap] = -side.sign() * leaving;
        let (free, _) = self.slide_after_jump(&modes, kick, &mut bounced, None);
        let point = system.point(&bounced, &self.phasors);
        let domain = system.domain(free.key(system));
        let row = domain.unit_row(gap);
        let pressing = side.sign() * first_derivative(&domain, &row, &point, 2).1;
        let mesh_speed = wall.mesh_speed;
        let is_slow = leaving <= mesh_speed.max(self.lowest_speed(&domain, gap, &point));
        let mut lasting = None;
        if is_slow && wall.contact == Contact::Rigid {
            let mut stopped = after(-side.sign() * approach);
            stopped[n + gap] = 0.0;
            let mut held = modes;
            held.gaps[gap] = GapMode::Stuck(side);
            let (held, fits) = self.slide_after_jump(&held, kick, &mut stopped, Some((gap, side)));
            if fits && held.gaps[gap] == GapMode::Stuck(side) {
                lasting = Some((held, stopped));
            }
        } else if is_slow && pressing > 0.0 {
            let mut meshing = free;
            meshing.gaps[gap] = if leaving > 0.0 { GapMode::Onset(side) } else { GapMode::Pressed(side) };
            let domain = system.domain(meshing.key(system));
            if side.sign() * first_derivative(&domain, &row, &point, 2).1 > 0.0 {
                lasting = Some((meshing, bounced));
            }
        }
        Outcome { free, bounced, lasting, pressing }
    }

    /// Returns the changes of all rates by an impulse that changes the gap's rate by 1, and which gaps at rest leave their rigid walls. The
    /// others stay at rest, because their walls push. The gaps in `kept`
    /// stay at rest in any case.
    fn joint_impact(&self, gap: usize, side: Side, kept: [bool; MOST_GAPS]) -> (Vec<f64>, [bool; MOST_GAPS]) {
        let (system, n) = (self.system, self.system.n);
        let resting: Vec<(usize, Side)> = (0..system.gaps())
            .filter_map(|other| match self.modes.gaps[other] {
                GapMode::Stuck(side) if other != gap => Some((other, side)),
                _ => None,
            })
            .collect();
        if resting.is_empty() {
            let own = system.mobility[(gap, gap)];
            return ((0..n).map(|i| system.mobility[(i, gap)] / own).collect(), [false; MOST_GAPS]);
        }
        let solve = |released: usize| {
            let held = resting.iter().enumerate().filter(|(bit, _)| released >> bit & 1 == 0);
            let held: Vec<(usize, Side)> = held.map(|(_, &pair)| pair).collect();
            let rows = held.iter().map(|&(other, side)| {
                let mut row = nalgebra::DVector::zeros(n);
                row[other] = 1.0;
                (Constraint::Wall(other, side), row)
            });
            let left = Constraints::of(&system.mobility, rows).mobility;
            let own = left[(gap, gap)];
            let kick: Vec<f64> = (0..n).map(|i| left[(i, gap)] / own).collect();
            // The wall pushes the gap away: all rates change by -side kick, and the impulse is -side / own.
            let size = held.len();
            let among = DMatrix::from_fn(size, size, |i, j| system.mobility[(held[i].0, held[j].0)]);
            let impulse = nalgebra::DVector::from_fn(size, |i, _| {
                side.sign() * system.mobility[(held[i].0, gap)] / own
            });
            let impulses = among.try_inverse().map_or(impulse.clone(), |inverse| inverse * &impulse);
            let push = held.iter().zip(impulses.iter()).all(|((other, side), impulse)| {
                kept[*other]
                    || -side.sign() * impulse
                        >= -ROUNDING
                            * (system.mobility[(gap, gap)] / system.mobility[(*other, *other)]).sqrt()
                            / own
            });
            let leave = resting.iter().enumerate().filter(|(bit, _)| released >> bit & 1 == 1);
            let leave = { leave }
                .all(|(_, &(other, at))| !kept[other] && -side.sign() * kick[other] * at.sign() <= 0.0);
            (kick, push && leave)
        };
        for released in 0..1 << resting.len() {
            let (kick, fits) = solve(released);
            if fits {
                let mut let_go = [false; MOST_GAPS];
                resting
                    .iter()
                    .enumerate()
                    .for_each(|(bit, &(other, _))| let_go[other] = released >> bit & 1 == 1);
                return (kick, let_go);
            }
        }
        (solve(0).0, [false; MOST_GAPS])
    }

    /// Chooses modes of friction, and of other gaps at rest, after a jump of the rates. Returns whether there is a consistent choice.
    fn slide_after_jump(
        &self,
        modes: &Modes,
        kick: &[f64],
        y: &mut Numbers,
        stopped: Option<(usize, Side)>,
    ) -> (Modes, bool) {
        let (system, n) = (self.system, self.system.n);
        let mut modes = *modes;
        let jumps = *y != self.y;
        let mut at_rest = AtRest::default();
        for gap in 0..system.gaps() {
            if let GapMode::Stuck(side) = modes.gaps[gap] {
                at_rest.gaps[gap] = Some(side);
            }
        }
        if let Some((gap, side)) = stopped {
            at_rest.gaps[gap] = Some(side);
        }
        for (i, element) in system.elements.iter().enumerate() {
            let moved: f64 = (0..n).map(|j| element.row[j] * kick[j]).sum();
            let size: f64 = (0..n).map(|j| (element.row[j] * kick[j]).abs()).sum();
            if jumps && moved.abs() > 1e-12 * size {
                let terms = (0..n).map(|j| element.row[j] * y[n + j]);
                let (rate, size) = terms
                    .fold((-element.speed, element.speed.abs()), |(sum, size), x| (sum + x, size + x.abs()));
                at_rest.elements[i] = rate.abs() <= ROUNDING * size;
                modes.slips[i] = if at_rest.elements[i] { Slip::Stick } else { Slip::of(rate) };
            } else {
                at_rest.elements[i] = modes.slips[i] == Slip::Stick;
            }
        }
        let point = system.point(y, &self.phasors);
        match system.consistent(&modes, &at_rest, &point) {
            Some(chosen) => (chosen, true),
            None => (modes, false),
        }
    }

    /// Processes a sliding rate that vanishes.
    fn end_sliding(&mut self, i: usize, observer: &mut dyn Observer) {
        let mut at_rest = self.at_rest();
        at_rest.elements[i] = true;
        let before = self.modes.slips[i];
        let chosen = self.system.consistent(&self.modes, &at_rest, &self.point());
        let next = chosen.unwrap_or(self.modes);
        if next.slips[i] == before {
            // The rate only touches 0, or begins on the wrong side of it.
            self.near_grazing = true;
            self.work.events += 1;
            self.events_in_period += 1;
            self.from_rate[i] = self.slide_order(i);
            return;
        }
        self.change_modes(&next, Some(i), observer);
    }

    /// Returns the order of the root of a sliding rate.
    fn slide_order(&mut self, i: usize) -> usize {
        self.refresh();
        let row = self.system.rate_row(i, &self.domain);
        first_derivative(&self.domain, &row, &self.point(), 1).0
    }

    /// Processes an element that breaks away.
    fn begin_sliding(&mut self, i: usize, next: Slip, observer: &mut dyn Observer) {
        let kept: Vec<usize> = (0..self.system.gaps()).filter(|&gap| self.is_kept(gap)).collect();
        let before = self.modes;
        self.modes.slips[i] = next;
        self.refresh();
        let domain = Arc::clone(&self.domain);
        let freed = || kept.iter().copied().filter(|&gap| !domain.is_still[gap]);
        let point = self.point();
        let jerk = |gap: usize| first_derivative(&domain, &domain.unit_row(gap), &point, 3).1;
        for gap in freed() {
            if let (Some((side, _)), GapMode::Beyond(_)) = (self.at_wall[gap], self.modes.gaps[gap])
                && let Some((own, number)) = self.wall_ahead(gap, side)
                && own == side
                && self.system.walls(gap, side)[number].contact == Contact::Rigid
                && side.sign() * jerk(gap) > 0.0
            {
                // The wall holds the gap from here on.
                self.modes = before;
                self.record(gap, EventKind::MeshStart, side, number, Some(side), observer);
                self.modes.gaps[gap] = GapMode::Stuck(side);
                self.at_wall[gap] = None;
                return;
            }
        }
        self.from_rate[i] = 2;
        self.has_slid[i] = true;
        self.record_slip(Some(b'7'), observer);
        for gap in freed() {
            self.at_wall[gap] = self.at_wall[gap].map(|(side, _)| (side, RELEASE_ORDER));
            if let GapMode::Onset(_) = self.modes.gaps[gap] {
                self.from_force[gap] = 1;
            }
        }
    }

    /// Returns all elements at rest: gaps on rigid walls, and elements that stick.
    fn at_rest(&self) -> AtRest {
        let mut at_rest = AtRest::default();
        for gap in 0..self.system.gaps() {
            at_rest.gaps[gap] = match (self.modes.gaps[gap], self.at_wall[gap]) {
                (GapMode::Stuck(side), _) => Some(side),
                (GapMode::Beyond(_), Some((side, _))) if self.rate(gap) == 0.0 && self.is_kept(gap) => {
                    let ahead = self.wall_ahead(gap, side).filter(|&(own, _)| own == side);
                    let is_rigid =
                        |number: usize| self.system.walls(gap, side)[number].contact == Contact::Rigid;
                    ahead.filter(|&(_, number)| is_rigid(number)).map(|(side, _)| side)
                }
                _ => None,
            };
        }
        for i in 0..self.system.elements.len() {
            at_rest.elements[i] = self.modes.slips[i] == Slip::Stick;
        }
        at_rest
    }

    /// Decides all modes anew that depend on forces, after a jump of forces or rates. `exempt` has just been decided.
    fn settle(&mut self, exempt: &AtRest, observer: &mut dyn Observer) {
        for _ in 0..MOST_DECISIONS {
            self.refresh();
            let point = self.point();
            if self.settle_pushing(&point, observer) {
                continue;
            }
            let mut at_rest = self.at_rest();
            for gap in 0..MOST_GAPS {
                at_rest.gaps[gap] = at_rest.gaps[gap].filter(|_| exempt.gaps[gap].is_none());
            }
            for i in 0..MOST_FRICTION {
                at_rest.elements[i] &= !exempt.elements[i];
            }
            if self.system.is_consistent(&self.modes, &at_rest, &point) {
                break;
            }
            match self.system.consistent(&self.modes, &at_rest, &point) {
                Some(chosen) => self.change_modes(&chosen, None, observer),
                None => {
                    self.near_grazing = true;
                    break;
                }
            }
        }
        // A gap on its wall may have got another rate or acceleration.
        for gap in 0..self.system.gaps() {
            if let Some((side, order)) = self.at_wall[gap]
                && (order < RELEASE_ORDER || self.rate(gap) != 0.0)
            {
                self.leave(gap, side);
            }
        }
    }

    /// Decides contact onsets and walls that only push anew. Returns whether a mode has changed.
    fn settle_pushing(&mut self, point: &Point, observer: &mut dyn Observer) -> bool {
        for gap in 0..self.system.gaps() {
            if self.from_force[gap] > 0 {
                continue;
            }
            match self.modes.gaps[gap] {
                GapMode::Onset(side) if !self.is_kept(gap) => {
                    let row = self.domain.unit_row(gap);
                    if side.sign() * first_derivative(&self.domain, &row, point, 2).1 <= 0.0 {
                        self.end_contact(gap, side, observer);
                        self.at_wall[gap] = self.at_wall[gap].map(|_| (side, 1));
                        return true;
                    }
                }
                GapMode::Open(side)
                    if first_derivative(&self.domain, &self.force(gap, side), point, 0).1 > 0.0 =>
                {
                    self.begin_force(gap, side, observer);
                    self.start_from_force(gap, side);
                    return true;
                }
                GapMode::Beyond(passed) if passed != 0 => {
                    let side = if passed > 0 { Side::Right } else { Side::Left };
                    let is_last = self.system.walls(gap, side).len() == usize::from(passed.unsigned_abs());
                    if is_last
                        && self.system.pushing(gap, side).is_some()
                        && first_derivative(&self.domain, &self.force(gap, side), point, 0).1 < 0.0
                    {
                        self.end_contact(gap, side, observer);
                        self.modes.gaps[gap] = GapMode::Open(side);
                        self.start_from_force(gap, side);
                        return true;
                    }
                }
                _ => {}
            }
        }
        false
    }

    /// Enters other modes of elements at rest, and reports the changes: of friction first, if the rate of the element `stopped` vanished.
    fn change_modes(&mut self, next: &Modes, stopped: Option<usize>, observer: &mut dyn Observer) {
        if stopped.is_some() {
            self.change_slips(next, stopped, observer);
        }
        for gap in 0..self.system.gaps() {
            match (self.modes.gaps[gap], next.gaps[gap]) {
                (GapMode::Stuck(side), GapMode::Beyond(_)) => {
                    self.end_contact(gap, side, observer);
                    self.at_wall[gap] = Some((side, 1));
                }
                (GapMode::Beyond(_), GapMode::Stuck(side)) => {
                    let last = self.system.walls(gap, side).len() - 1;
                    self.record(gap, EventKind::MeshStart, side, last, Some(side), observer);
                    self.at_wall[gap] = None;
                }
                _ => {}
            }
            self.modes.gaps[gap] = next.gaps[gap];
        }
        if stopped.is_none() {
            self.change_slips(next, stopped, observer);
        }
        self.refresh();
        self.system.hold(&self.modes, &mut self.y, false);
        for gap in 0..self.system.gaps() {
            if let Some((side, 1)) = self.at_wall[gap] {
                self.leave(gap, side);
            }
        }
        for i in 0..self.system.elements.len() {
            if self.from_rate[i] > 0 {
                self.from_rate[i] = self.slide_order(i);
            }
        }
    }

    /// Enters other modes of friction, and reports the changes.
    fn change_slips(&mut self, next: &Modes, stopped: Option<usize>, observer: &mut dyn Observer) {
        let before = std::mem::replace(&mut self.modes.slips, next.slips);
        for (i, (before, after)) in
            before.into_iter().zip(next.slips).enumerate().take(self.system.elements.len())
        {
            if after == before {
                continue;
            }
            self.has_slid[i] |= after != Slip::Stick;
            let reverses = before != Slip::Stick && after != Slip::Stick;
            let row = self.system.rate_row(i, &self.domain);
            let point = self.point();
            // An element that has just stopped has a small rate, because its time has a rounding error.
            let is_at_rest = stopped == Some(i) || row.dot(&point).abs() <= ROUNDING * row.size(&point);
            self.from_rate[i] = usize::from(after != Slip::Stick && is_at_rest);
            match before {
                Slip::Stick => self.record_slip(Some(b'7'), observer),
                _ if !reverses => self.record_slip(None, observer),
                _ if stopped == Some(i) => self.record_slip(Some(b'0'), observer),
                _ => {}
            }
        }
    }

    /// Enters a stage: what depends on forces is decided anew.
    fn enter_stage(&mut self, stage: usize, observer: &mut dyn Observer) {
        self.modes.stage = stage;
        self.before = self.y;
        self.refresh();
        self.settle(&AtRest::default(), observer);
        for gap in 0..self.system.gaps() {
            if let (Some((side, _)), true) = (self.at_wall[gap], self.rate(gap) == 0.0) {
                self.leave(gap, side);
            }
        }
        self.refresh();
    }

    /// Counts and reports an event at a wall. The modes are those before it.
    fn record(
        &mut self,
        gap: usize,
        kind: EventKind,
        side: Side,
        wall: usize,
        meshing: Option<Side>,
        observer: &mut dyn Observer,
    ) {
        let of_contact = |side: Side| if side == Side::Right { b'1' } else { b'4' };
        let mode = match self.modes.gaps[gap] {
            GapMode::Open(side) => self.before_last(gap, side),
            mode => mode,
        };
        let symbol = match (mode.contact(), self.origin[gap]) {
            (Some(side), _) => Some(of_contact(side)),
            (None, None) => None,
            (None, Some(Side::Right)) => Some(if side == Side::Right { b'2' } else { b'3' }),
            (None, Some(Side::Left)) => Some(if side == Side::Left { b'5' } else { b'6' }),
        };
        // With several gaps, a symbol tells its gap.
        let several = self.system.gaps() > 1;
        let symbol = symbol.map(|symbol| if several { word::of_gap(symbol, gap) } else { symbol });
        self.origin[gap] = Some(side);
        self.work.events += 1;
        self.events_in_period += 1;
        let n = self.system.n;
        let number = &self.system.walls(gap, side)[wall];
        let is_on_wall = self.before[gap] == number.at;
        let of_wall = 1 + u64::from(side == Side::Right) + 2 * u64::from(is_on_wall);
        let event = GapEvent {
            gap,
            kind,
            side,
            symbol,
            period: self.period,
            t: self.clock.time(),
            before: [self.before[gap], self.before[n + gap], 0.0, 0.0],
            after: [self.y[gap], self.y[n + gap], 0.0, 0.0],
            meshing,
            has_impact: !number.contact.is_elastic() && kind != EventKind::MeshEnd,
            code: of_wall + 4 * kind as u64 + 256 * (gap + 4 * wall) as u64,
            interval: 0,
            ends_series: false,
        };
        observer.event(&event, &|| [self.system.to_state(&self.before), self.state()]);
    }

    fn record_slip(&mut self, symbol: Option<u8>, observer: &mut dyn Observer) {
        self.work.events += 1;
        self.events_in_period += 1;
        observer.slip(&SlipEvent {
            slips: self.modes.slips,
            symbol,
            period: self.period,
            t: self.clock.time(),
            at: self.state(),
        });
    }

    /// Determines the modes of the start.
    fn enter(&mut self) {
        let (system, n) = (self.system, self.system.n);
        for gap in 0..system.gaps() {
            let row = &system.machine.gaps[gap].row;
            let state = self.state();
            let size: f64 = (0..n).map(|i| (row[i] * state[2 * i]).abs()).sum();
            for side in Side::BOTH {
                for (number, wall) in system.walls(gap, side).iter().enumerate() {
                    let is_on_wall = (self.y[gap] - wall.at).abs() <= ON_WALL * (size + wall.at.abs());
                    let beyond = side.sign() * (self.y[gap] - wall.at);
                    if is_on_wall || beyond > 0.0 && wall.contact == Contact::Rigid {
                        self.y[gap] = wall.at;
                        self.origin[gap] = Some(side);
                        self.at_wall[gap] = Some((side, 1));
                        break;
                    }
                    if beyond < 0.0 {
                        break;
                    }
                    self.origin[gap] = Some(side);
                    self.modes.gaps[gap] = match wall.contact {
                        Contact::Impact => GapMode::Pressed(side),
                        _ => GapMode::Beyond(signed(side, number + 1)),
                    };
                }
            }
        }
        let mut at_rest = AtRest::default();
        for (i, element) in system.elements.iter().enumerate() {
            let terms = (0..n).map(|j| element.row[j] * self.y[n + j]);
            let (rate, size) =
                terms.fold((-element.speed, element.speed.abs()), |(sum, size), x| (sum + x, size + x.abs()));
            at_rest.elements[i] = rate.abs() <= ON_WALL * size;
            self.modes.slips[i] = if at_rest.elements[i] { Slip::Stick } else { Slip::of(rate) };
            self.has_slid[i] = !at_rest.elements[i];
        }
        self.refresh();
        let point = self.point();
        for gap in 0..system.gaps() {
            let GapMode::Beyond(passed) = self.modes.gaps[gap] else { continue };
            let side = if passed > 0 { Side::Right } else { Side::Left };
            let is_last = passed != 0 && system.walls(gap, side).len() == usize::from(passed.unsigned_abs());
            if is_last && system.pushing(gap, side).is_some() {
                if first_derivative(&self.domain, &self.force(gap, side), &point, 0).1 <= 0.0 {
                    self.modes.gaps[gap] = GapMode::Open(side);
                }
                self.start_from_force(gap, side);
            }
        }
        if let Some(chosen) = system.consistent(&self.modes, &at_rest, &self.point()) {
            self.modes.slips = chosen.slips;
        }
        self.refresh();
        for i in 0..system.elements.len() {
            if at_rest.elements[i] && self.modes.slips[i] != Slip::Stick {
                self.has_slid[i] = true;
                self.from_rate[i] = self.slide_order(i);
            }
        }
        for gap in 0..system.gaps() {
            let Some((side, _)) = self.at_wall[gap] else { continue };
            let closing = side.sign() * self.rate(gap);
            if closing > 0.0 || closing == 0.0 && self.heads(gap, side) {
                // A contact, at once.
                self.at_wall[gap] = None;
            } else {
                self.leave(gap, side);
            }
        }
        self.refresh();
    }
}

/// Returns the number of passed walls with the sign of their side.
fn signed(side: Side, count: usize) -> i8 {
    if side == Side::Right { count as i8 } else { -(count as i8) }
}
