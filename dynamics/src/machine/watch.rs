//! Watches: conditions that end the present modes, their functions, and the first root of all functions on a step.

use super::domain::{Functional, LinearDomain, Path, STAYS_ZERO};
use super::frame::Frame;
use super::modes::{GapMode, MOST_CURVES, Modes};
use super::polynomial::{
    Fall, MOST_REGISTERS, ORDER, Polynomial, Weights, bernstein, first_fall, stays_positive,
};
use super::{PhasePoint, ROUNDING};
use crate::model::{MOST_FRICTION, MOST_GAPS, Side, Wall};
use crate::motion::{NO_SPEED, Slip};

/// A condition that ends the present modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Watch {
    /// The gap reaches the next wall in a direction.
    Wall(usize, Side),
    /// The gap of a contact onset comes back to its wall.
    OnsetEnds(usize, Side),
    /// The force on the gap of a contact onset no longer presses it to its wall.
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
    /// The argument of a curve reaches the end of its piece, the upper one if true.
    Border(usize, bool),
}

impl Watch {
    /// Returns the gap at whose wall the watch waits; none for friction.
    pub(super) fn gap(self) -> Option<usize> {
        match self {
            Watch::Wall(gap, _)
            | Watch::OnsetEnds(gap, _)
            | Watch::PressingEnds(gap, _)
            | Watch::Leaves(gap, _)
            | Watch::ForceEnds(gap, _)
            | Watch::ForceBegins(gap, _)
            | Watch::PushEnds(gap, _) => Some(gap),
            Watch::RateVanishes(_) | Watch::Slips(..) | Watch::Border(..) => None,
        }
    }

    /// Whether the watch waits for a gap to reach a position.
    pub(super) fn is_distance(self) -> bool {
        matches!(self, Watch::Wall(..) | Watch::OnsetEnds(..) | Watch::Leaves(..))
    }
}

/// Everything that may end the present modes. It stays the same as long as they do.
#[derive(Clone, Debug, Default)]
pub(super) struct Watches {
    /// Gap, position and direction of the wall of each watch that is a distance.
    distances: Vec<(Watch, (usize, f64, Side))>,
    /// The other watches and their functions.
    rows: Vec<(Watch, Functional)>,
    is_known: bool,
}

impl Watches {
    /// Whether all watches are distances.
    pub(super) fn are_distances(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns a watch by its number.
    pub(super) fn watch(&self, number: usize) -> Watch {
        match self.distances.get(number) {
            Some((watch, _)) => *watch,
            None => self.rows[number - self.distances.len()].0,
        }
    }

    pub(super) fn forget(&mut self) {
        self.is_known = false;
    }
}

/// The first event on a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct First {
    /// Share of the step at which it happens; 1 without an event.
    pub(super) share: f64,
    /// Number of the watch that ends the modes.
    pub(super) number: Option<usize>,
    /// Whether a watch touched zero within rounding in a way that makes the linearisation unreliable.
    pub(super) touches: bool,
}

/// Largest order of a root at the start of a step that the short series of a short step may have.
const MOST_SHORT_ORDER: usize = 3;

/// Roots of watches at the present instant. They are not events: the search for the next event divides them out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Roots {
    /// For a gap on a wall: the direction of the wall from the gap, and the order of the root of the distance.
    pub(super) at_wall: [Option<(Side, usize)>; MOST_GAPS],
    /// Orders of the roots of pushing forces, and of pressing accelerations in a contact onset; 0 without a root.
    pub(super) from_force: [usize; MOST_GAPS],
    /// Orders of the roots of the sliding rates.
    pub(super) from_rate: [usize; MOST_FRICTION],
    /// For an argument of a curve at a border of its pieces: whether the border is the upper one of its piece, and the order of the root.
    pub(super) at_border: [Option<(bool, usize)>; MOST_CURVES],
}

/// The parts of a motion at an instant that watches depend on.
#[derive(Clone, Copy)]
pub(super) struct Moment<'a> {
    pub(super) frame: &'a Frame,
    pub(super) domain: &'a LinearDomain,
    pub(super) modes: &'a Modes,
    pub(super) roots: &'a Roots,
    pub(super) point: &'a PhasePoint,
}

impl<'a> Moment<'a> {
    /// Whether constraints hold a gap at its position.
    pub(super) fn is_kept(&self, gap: usize) -> bool {
        self.domain.is_still[gap] && self.point[self.frame.n + gap] == 0.0
    }

    /// Whether other elements at rest keep the sliding rate of an element at 0 whose friction is at its limit.
    pub(super) fn is_yielding(&self, i: usize) -> bool {
        let rate = || self.frame.rate_row(i).dot(self.point).abs();
        self.domain.is_driven[i]
            && self.modes.slips[i] != Slip::Stick
            && rate() <= NO_SPEED * self.frame.speed
    }

    /// Lists everything that may end the present modes, gap by gap, unless it is listed already.
    pub(super) fn list(&self, watches: &mut Watches) {
        if std::mem::replace(&mut watches.is_known, true) {
            return;
        }
        watches.distances.clear();
        watches.rows.clear();
        let Watches { distances, rows, .. } = watches;
        let mut push = |watch: Watch| match self.distance(watch) {
            Some(distance) => distances.push((watch, distance)),
            None => rows.push((watch, self.function(watch))),
        };
        for gap in 0..self.frame.gaps() {
            if let GapMode::Stuck(side) = self.modes.gaps[gap] {
                push(Watch::PushEnds(gap, side));
                continue;
            }
            if self.is_kept(gap) {
                continue;
            }
            match self.modes.gaps[gap] {
                GapMode::Beyond(_) => {
                    for side in Side::BOTH {
                        if self.frame.wall_ahead(self.modes, gap, side).is_some() {
                            push(Watch::Wall(gap, side));
                        }
                    }
                    let pushed = self.frame.pushed(self.modes, gap);
                    if let Some(side) =
                        pushed.filter(|&side| !self.frame.vanishes_at_wall(self.modes, gap, side))
                    {
                        push(Watch::ForceEnds(gap, side));
                    }
                }
                GapMode::Onset(side) => {
                    [Watch::OnsetEnds(gap, side), Watch::PressingEnds(gap, side)]
                        .into_iter()
                        .for_each(&mut push);
                    if self.behind(gap, side).is_some() {
                        push(Watch::Wall(gap, side.mirrored()));
                    }
                }
                GapMode::Pressed(side) => push(Watch::Leaves(gap, side)),
                GapMode::Open(side) => {
                    push(Watch::Leaves(gap, side));
                    if !self.frame.vanishes_at_wall(self.modes, gap, side) {
                        push(Watch::ForceBegins(gap, side));
                    }
                }
                GapMode::Stuck(_) => {}
            }
        }
        for i in 0..self.frame.elements.len() {
            match self.modes.slips[i] {
                Slip::Stick if self.domain.holds[i].is_some() => {
                    [Slip::Forward, Slip::Backward].into_iter().for_each(|slip| push(Watch::Slips(i, slip)));
                }
                Slip::Stick => {}
                _ if self.is_yielding(i) => {}
                _ => push(Watch::RateVanishes(i)),
            }
        }
        for (i, &piece) in self.modes.pieces.iter().enumerate() {
            let spring = i.checked_sub(MOST_FRICTION).and_then(|spring| self.frame.springs.get(spring));
            let wall = spring.and_then(|spring| spring.wall);
            if let Some(curve) = self.frame.curve(i, &self.modes.slips)
                && wall.is_none_or(|(gap, side)| self.frame.is_behind_last(self.modes, gap, side))
            {
                let ends = [(piece > 0, false), (usize::from(piece) < curve.borders.len(), true)];
                ends.into_iter().filter(|end| end.0).for_each(|(_, upper)| push(Watch::Border(i, upper)));
            }
        }
    }

    /// Returns side and index of the wall that a gap in contact onset may reach when it moves away from its own wall.
    fn behind(&self, gap: usize, side: Side) -> Option<(Side, usize)> {
        match self.frame.walls(gap, side).len() {
            1 => self.frame.walls(gap, side.mirrored()).first().map(|_| (side.mirrored(), 0)),
            count => Some((side, count - 2)),
        }
    }

    /// Returns the wall that a gap reaches in a direction.
    #[inline]
    fn ahead(&self, gap: usize, direction: Side) -> Option<&'a Wall> {
        let (side, number) = match self.modes.gaps[gap] {
            GapMode::Onset(side) => self.behind(gap, side),
            _ => self.frame.wall_ahead(self.modes, gap, direction),
        }?;
        Some(&self.frame.walls(gap, side)[number])
    }

    /// Returns gap, position and direction of the wall if a watch is the distance of a gap from a wall.
    #[inline]
    pub(super) fn distance(&self, watch: Watch) -> Option<(usize, f64, Side)> {
        match watch {
            Watch::Wall(gap, direction) => {
                Some((gap, self.ahead(gap, direction).expect("the watch was listed").at, direction))
            }
            Watch::OnsetEnds(gap, side) => Some((gap, self.frame.last_wall(gap, side).at, side)),
            Watch::Leaves(gap, side) => Some((gap, self.frame.last_wall(gap, side).at, side.mirrored())),
            _ => None,
        }
    }

    /// Returns the function of a watch. It is positive before the root.
    pub(super) fn function(&self, watch: Watch) -> Functional {
        let (frame, domain, width) = (self.frame, self.domain, self.frame.width());
        let force = |gap: usize, side: Side| frame.force(self.modes.stage, &self.modes.pieces, gap, side);
        match watch {
            Watch::Wall(..) | Watch::OnsetEnds(..) | Watch::Leaves(..) => {
                let (gap, at, direction) = self.distance(watch).expect("it is a distance");
                domain.unit_row(gap).scaled(-direction.sign()).plus(direction.sign() * at, width)
            }
            Watch::PressingEnds(gap, side) => domain.accelerations[gap].scaled(side.sign()),
            Watch::ForceEnds(gap, side) => force(gap, side),
            Watch::ForceBegins(gap, side) => force(gap, side).scaled(-1.0),
            Watch::PushEnds(gap, _) => {
                domain.pushes[gap].clone().unwrap_or_else(|| domain.unit_row(width - 1))
            }
            Watch::RateVanishes(i) => frame.rate_row(i).scaled(self.modes.slips[i].sign()),
            Watch::Slips(i, next) => {
                let hold = domain.holds[i].as_ref().expect("the watch was listed");
                hold.scaled(-next.sign()).plus(frame.elements[i].static_force, width)
            }
            Watch::Border(i, upper) => {
                let (slips, sign) = (&self.modes.slips, if upper { 1.0 } else { -1.0 });
                let border = usize::from(self.modes.pieces[i]) - usize::from(!upper);
                let at = frame.curve(i, slips).expect("the watch was listed").borders[border];
                frame.argument(i, slips).scaled(-sign).plus(sign * at, width)
            }
        }
    }

    /// Returns the order of the root of a watch at this instant; 0 without a root. A force that holds an element or a gap may start at its
    /// limit.
    fn order(&self, watch: Watch, row: &Functional) -> usize {
        match watch {
            Watch::PressingEnds(gap, _) | Watch::ForceEnds(gap, _) | Watch::ForceBegins(gap, _) => {
                self.roots.from_force[gap]
            }
            Watch::RateVanishes(i) => self.roots.from_rate[i],
            Watch::Border(i, upper) if self.roots.at_border[i].is_some_and(|(at, _)| at == upper) => {
                self.roots.at_border[i].map_or(0, |(_, order)| order)
            }
            _ if row.vanishes(self.point) => self.domain.first_derivative(row, self.point, 0).0,
            _ => 0,
        }
    }

    /// Returns the first event on a step.
    pub(super) fn first_event(&self, watches: &Watches, path: &mut Path) -> First {
        let has_high_order =
            |at: &Option<(Side, usize)>| at.is_some_and(|(_, order)| order > MOST_SHORT_ORDER);
        if !watches.rows.is_empty() || self.roots.at_wall.iter().any(has_high_order) {
            path.registers = MOST_REGISTERS;
        }
        self.domain.expand(path, if watches.rows.is_empty() { self.frame.gaps() } else { self.frame.n }, 1.0);
        let mut first = First { share: 1.0, number: None, touches: false };
        let mut include = |number: usize, watch: Watch, fall: Fall| match fall {
            Fall::None => {}
            Fall::Touches => first.touches |= !self.is_harmless(watch),
            Fall::At(share) if first.number.is_none() || share < first.share => {
                (first.share, first.number) = (share, Some(number));
            }
            Fall::At(_) => {}
        };
        let mut latest = (MOST_GAPS, [0.0; ORDER + 1]);
        for (number, (watch, distance)) in watches.distances.iter().enumerate() {
            if let Some(fall) = self.fall_of_distance(*distance, path, &mut latest) {
                include(number, *watch, fall);
            }
        }
        for (number, (watch, row)) in watches.rows.iter().enumerate() {
            include(watches.distances.len() + number, *watch, self.fall_of_row(*watch, row, path));
        }
        first
    }

    /// Returns where the row of a watch falls below 0 on a step.
    fn fall_of_row(&self, watch: Watch, row: &Functional, path: &Path) -> Fall {
        let [_, size] = row.value_and_size(self.point);
        let along = self.domain.along(row, path);
        let order = self.order(watch, row);
        match (watch, first_fall(&along, None, order, size, MOST_REGISTERS)) {
            (Watch::Slips(..), Fall::At(share)) => beyond_rounding(&along, share, size),
            // The force touches its limit at the start.
            (Watch::Slips(..), Fall::None) if order > 1 && order != STAYS_ZERO => Fall::Touches,
            (_, fall) => fall,
        }
    }

    /// Returns where a gap reaches a wall on a step, unless a bound shows that it does not. `latest` keeps the Bernstein coefficients of a gap
    /// for its other walls.
    fn fall_of_distance(
        &self,
        (gap, at, direction): (usize, f64, Side),
        path: &Path,
        latest: &mut (usize, Polynomial),
    ) -> Option<Fall> {
        let order = match self.roots.at_wall[gap] {
            Some((side, order)) if side == direction => order,
            _ => 0,
        };
        let (sign, change) = (direction.sign(), path.changes[gap]);
        let size = at.abs() + self.point[gap].abs();
        let start = if order == 0 { sign * (at - self.point[gap]) } else { 0.0 };
        if order == 0 && start > change + ROUNDING * (change + size) {
            return None;
        }
        let coordinate = &path.coordinates[gap];
        if latest.0 != gap {
            *latest = (gap, bernstein(coordinate, 1, path.registers));
        }
        if order == 0 && stays_positive(&latest.1, start, -sign, path.registers) {
            return None;
        }
        let (mut c, b) = (coordinate.map(|c| -sign * c), latest.1.map(|b| start - sign * b));
        c[0] = start;
        Some(first_fall(&c, Some(&b), order, size, path.registers))
    }

    /// Whether the linearisation stays valid if the watch's function touches zero within rounding. At an elastic wall without a preload it
    /// is valid with and without contact, and at the limit of sticking with and without sliding, unless the force falls then.
    fn is_harmless(&self, watch: Watch) -> bool {
        match watch {
            Watch::Wall(gap, direction) => {
                let wall = self.frame.wall_ahead(self.modes, gap, direction);
                wall.map(|(side, number)| &self.frame.walls(gap, side)[number]).is_some_and(|wall| {
                    wall.contact.is_elastic()
                        && wall.springs.iter().all(|spring| spring.force_at_wall() == 0.0)
                })
            }
            Watch::Slips(i, _) => !self.frame.elements[i].falls(),
            Watch::Border(..) => true,
            _ => false,
        }
    }
}

/// Returns where a holding force exceeds its limit, given where it reaches the limit. A force that only touches its limit exceeds it by no
/// more than rounding.
fn beyond_rounding(c: &Polynomial, share: f64, size: f64) -> Fall {
    let mut lifted = *c;
    lifted[0] = c[0].max(0.0) + ROUNDING * size;
    match first_fall(&lifted, None, 0, size, MOST_REGISTERS) {
        Fall::At(later) if Weights::<MOST_REGISTERS>::at(0.5 * (share + later)).of(c)[0] <= 0.0 => {
            Fall::At(share)
        }
        fall => fall,
    }
}
