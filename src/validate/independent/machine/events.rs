//! Processes the events of a machine.

use nalgebra::{DMatrix, DVector};

use super::system::{
    CURVES, Constraints, Domain, Key, Numbers, PhasePoint, ROUNDING, Slide, affine, dot, size,
};
use super::{Ending, Event, Flight, Gap, Mode, Series, Slip, side_of, signed};
use rattlemap_dynamics::model::{Contact, MOST_FRICTION, MOST_GAPS, Side, Wall};
use rattlemap_dynamics::motion::EventKind;
use rattlemap_dynamics::word;

/// Heights of flights, in scales of length, that are counted and followed in a series of impacts.
const LOWEST_FLIGHT: f64 = 1e-13;
const DEEPEST_FLIGHT: f64 = 1e-16;

/// Duration of the rest of a series of impacts, in radians of the fastest rate, whose impacts are not counted.
const SHORT_REST: f64 = 1.6e-4;

/// A start that is nearer to a wall than this counts as on the wall. The distance is relative to the terms of the gap.
const GAP_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Largest number of decisions on gaps and elements at rest after one event.
const MOST_DECISIONS: usize = 16;

/// Order of the root when a gap leaves its wall with an acceleration of 0.
const RELEASE_ORDER: usize = 3;

/// Gaps and elements that an event has just decided, and that are not decided again.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Exempt {
    gaps: [bool; MOST_GAPS],
    elements: [bool; MOST_FRICTION],
}

/// Gaps and elements whose modes a decision may change: gaps at rest on rigid walls on these sides, and elements without a sliding rate.
#[derive(Clone, Copy, Debug)]
struct AtRest {
    gaps: [Option<Side>; MOST_GAPS],
    elements: [bool; MOST_FRICTION],
}

/// The change of all rates by an impact that changes the gap's rate by 1, and the gaps at rest that it releases.
struct Kick {
    change: DVector<f64>,
    /// Twice the kinetic energy of these rates.
    energy: f64,
    released: [bool; MOST_GAPS],
}

/// Modes and coordinates after an impact.
struct Outcome {
    key: Key,
    y: Numbers,
    /// Mode of a contact that lasts; none if the gap leaves the wall.
    lasting: Option<Lasting>,
    /// Acceleration towards the wall without contact, and the time in which the fastest rate turns by one radian.
    pressing: f64,
    radian: f64,
    /// The duration of the rest of a series of impacts, as a multiple of the leaving speed over the acceleration.
    longer: f64,
    /// Whether friction reverses only in some flights.
    varies: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Lasting {
    Rests,
    Begins,
    Presses,
}

impl Flight {
    /// Determines the modes of the start.
    pub(super) fn begin(&mut self) {
        let system = self.system.clone();
        for gap in 0..system.gaps() {
            for side in Side::BOTH {
                for (nth, wall) in system.walls(gap, side).iter().enumerate() {
                    let beyond = side.sign() * (self.y[gap] - wall.at);
                    let is_on_wall = beyond.abs() <= GAP_ROUNDING * (self.size_of_gap(gap) + wall.at.abs());
                    if is_on_wall || beyond > 0.0 && wall.contact == Contact::Rigid {
                        self.y[gap] = wall.at;
                        self.gaps[gap].on_wall = Some((side, 1));
                    }
                    if is_on_wall || beyond <= 0.0 || wall.contact == Contact::Rigid {
                        break;
                    }
                    self.gaps[gap].level = signed(side, nth + 1);
                }
            }
        }
        let mut at_rest = AtRest { gaps: [None; MOST_GAPS], elements: [false; MOST_FRICTION] };
        let point = self.domain().point(&self.y, 0.0);
        for i in 0..system.elements.len() {
            self.slides[i] = self.slide_at(i, &point);
            at_rest.elements[i] = self.slides[i] == Slide::Sticks;
        }
        self.pieces = system.pieces(&self.slides, &point);
        for gap in 0..system.gaps() {
            if let Some(force) = self.force(gap)
                && self.domain().tendency(&force, &point, 0).1 <= 0.0
            {
                self.gaps[gap].mode = Mode::Open;
            }
        }
        if let Some(chosen) = self.consistent(self.key(), &at_rest, &point) {
            (self.slides, self.pieces) = (chosen.slides, chosen.pieces);
        }
        self.hold();
        for i in (0..system.elements.len()).filter(|&i| at_rest.elements[i]) {
            self.from_rate[i] = self.order_of_rate(i, 0.0);
        }
        for gap in 0..system.gaps() {
            let Some((side, _)) = self.gaps[gap].on_wall else { continue };
            let closing = side.sign() * self.rate(gap);
            if closing > 0.0 || closing == 0.0 && self.heads(gap, side, 0.0) {
                self.gaps[gap].on_wall = None;
            } else {
                self.leave(gap, side, 0.0);
            }
        }
    }

    /// Returns the size of the terms from which a gap is computed.
    fn size_of_gap(&self, gap: usize) -> f64 {
        let row = &self.system.machine.gaps[gap].row;
        let state = self.state();
        row.iter().enumerate().map(|(i, x)| (x * state[2 * i]).abs()).sum::<f64>() / self.system.units[0]
    }

    /// Ends the present modes. `t` is the time since phase 0.
    pub(super) fn act(&mut self, ending: Ending, t: f64) {
        let mut exempt = Exempt::default();
        match ending {
            Ending::Reaches(gap, direction) => {
                if let Mode::Onset(side) = self.gaps[gap].mode {
                    self.end_contact(gap, side, t);
                }
                self.reach(gap, direction, t);
            }
            Ending::OnsetEnds(gap, side) => {
                self.put_on_wall(gap, side);
                self.cross(gap, side);
                self.gaps[gap].on_wall = Some((side.mirrored(), 1));
                return;
            }
            Ending::PressingEnds(gap, side) => {
                self.end_contact(gap, side, t);
                self.gaps[gap].on_wall = None;
            }
            Ending::PulledOff(gap, side) => {
                self.end_contact(gap, side, t);
                self.gaps[gap].on_wall = Some((side, RELEASE_ORDER));
                exempt.gaps[gap] = true;
            }
            Ending::Opens(gap, side) => {
                self.end_contact(gap, side, t);
                (self.gaps[gap].mode, self.gaps[gap].from_force) = (Mode::Open, 1);
            }
            Ending::Closes(gap, side) => {
                self.record(gap, EventKind::MeshStart, side, t);
                (self.gaps[gap].mode, self.gaps[gap].from_force) = (Mode::Plain, 1);
            }
            Ending::Bends(i, is_upper) => return self.bend(i, is_upper, t),
            Ending::RateVanishes(i) => self.end_sliding(i, t),
            Ending::Slips(i, next) => {
                self.begin_sliding(i, next, t);
                exempt.elements[i] = true;
            }
        }
        self.settle(&exempt, t, t);
    }

    /// Enters the next piece of a curve if the argument passes the end of its piece.
    fn bend(&mut self, i: usize, is_upper: bool, t: f64) {
        let domain = self.domain();
        let point = self.point(&domain, t);
        let Some((_, row)) = self.system.bent(i, &self.slides) else { return };
        let (order, outwards) = domain.tendency(&row, &point, 1);
        let passes = outwards != 0.0 && (outwards > 0.0) == is_upper;
        if passes {
            self.pieces[i] = if is_upper { self.pieces[i] + 1 } else { self.pieces[i] - 1 };
        }
        self.at_end[i] = Some((is_upper != passes, order));
    }

    fn point(&self, domain: &Domain, t: f64) -> PhasePoint {
        domain.point(&self.y, t)
    }

    /// Puts a gap exactly on the next wall in a direction.
    fn put_on_wall(&mut self, gap: usize, direction: Side) {
        if let Some((side, nth)) = self.next_wall(gap, direction) {
            self.y[gap] = self.system.walls(gap, side)[nth].at;
        }
    }

    /// Crosses the next wall in a direction.
    fn cross(&mut self, gap: usize, direction: Side) {
        self.gaps[gap].level += signed(direction, 1);
        self.gaps[gap].mode = Mode::Plain;
    }

    fn end_contact(&mut self, gap: usize, side: Side, t: f64) {
        self.record(gap, EventKind::MeshEnd, side, t);
        self.gaps[gap].mode = Mode::Plain;
    }

    /// Returns order and value of the first nonzero derivative of a gap, from the acceleration on.
    fn tendency(&self, gap: usize, t: f64) -> (usize, f64) {
        let domain = self.domain();
        domain.tendency(&domain.unit(gap), &self.point(&domain, t), 2)
    }

    /// Whether a gap at rest begins to move in a direction.
    fn heads(&self, gap: usize, direction: Side, t: f64) -> bool {
        direction.sign() * self.tendency(gap, t).1 > 0.0
    }

    /// Records that a gap lies on a wall and does not cross it.
    fn leave(&mut self, gap: usize, direction: Side, t: f64) {
        let order = if self.rate(gap) != 0.0 { 1 } else { self.tendency(gap, t).0.min(RELEASE_ORDER) };
        self.gaps[gap].on_wall = Some((direction, order));
    }

    /// Processes a gap that reaches the next wall in a direction.
    fn reach(&mut self, gap: usize, direction: Side, t: f64) {
        let Some((side, nth)) = self.next_wall(gap, direction) else { return };
        self.put_on_wall(gap, direction);
        let closing = direction.sign() * self.rate(gap);
        if closing < 0.0 || closing == 0.0 && !self.heads(gap, direction, t) {
            return self.leave(gap, direction, t);
        }
        let system = self.system.clone();
        let wall = &system.walls(gap, side)[nth];
        if side != direction {
            if self.gaps[gap].mode != Mode::Open {
                self.record(gap, EventKind::MeshEnd, side, t);
            }
            self.cross(gap, direction);
            return self.leave(gap, side, t);
        }
        if !wall.contact.is_elastic() {
            return self.impact(gap, side, wall, t);
        }
        let before = self.gaps[gap];
        self.cross(gap, direction);
        self.leave(gap, side.mirrored(), t);
        if let Some(force) = self.force(gap) {
            let after = std::mem::replace(&mut self.gaps[gap].mode, Mode::Open);
            let domain = self.domain();
            let (order, value) = domain.tendency(&force, &self.point(&domain, t), 0);
            self.gaps[gap].from_force = order;
            if value <= 0.0 {
                return;
            }
            self.gaps[gap].mode = after;
        }
        let after = std::mem::replace(&mut self.gaps[gap], before);
        self.record(gap, EventKind::MeshStart, side, t);
        self.gaps[gap] = Gap { origin: self.gaps[gap].origin, ..after };
    }

    /// Returns the effect of an impact on all rates. Gaps at rest on rigid walls stay there if their walls have to push; gaps in `kept`
    /// stay in any case.
    fn kick(&self, gap: usize, side: Side, kept: [bool; MOST_GAPS]) -> Kick {
        let (system, held) = (&self.system, self.key().held);
        let resting: Vec<(usize, Side)> =
            (0..system.gaps()).filter_map(|other| Some((other, held[other]?))).collect();
        let attempt = |set: usize| {
            let is_released = |at: usize| set >> at & 1 == 1;
            let holding: Vec<(usize, Side)> =
                (0..resting.len()).filter(|&at| !is_released(at)).map(|at| resting[at]).collect();
            // Impulses along the gaps, of the walls on which gaps rest and of the wall that is hit. A gap that others hold needs no impulse.
            let is_held = |i: usize| holding.iter().any(|&(other, _)| other == i);
            let rows: Vec<_> = holding.iter().map(|&(other, _)| system.gap_row(other)).collect();
            let independent = Constraints::new(&system.mobility, &rows).kept;
            let holding: Vec<(usize, Side)> = independent.into_iter().map(|at| holding[at]).collect();
            let gaps: Vec<usize> = holding.iter().map(|&(other, _)| other).chain([gap]).collect();
            let among = DMatrix::from_fn(gaps.len(), gaps.len(), |i, j| system.mobility[(gaps[i], gaps[j])]);
            let mut rates = DVector::zeros(gaps.len());
            rates[gaps.len() - 1] = 1.0;
            let impulses = among.try_inverse().expect("independent rows") * rates;
            let change = DVector::from_fn(system.n, |i, _| match is_held(i) {
                true => 0.0,
                false => gaps
                    .iter()
                    .zip(&impulses)
                    .map(|(&j, impulse)| system.mobility[(i, j)] * impulse)
                    .sum::<f64>(),
            });
            let scale = |i: usize| system.mobility[(i, i)].sqrt();
            let hit = impulses[holding.len()] * scale(gap);
            let push = holding.iter().zip(&impulses).all(|(&(other, own), impulse)| {
                kept[other] || side.sign() * own.sign() * impulse * scale(other) >= -ROUNDING * hit
            });
            let leave = (0..resting.len()).filter(|&at| is_released(at)).all(|at| {
                let (other, own) = resting[at];
                !kept[other] && -side.sign() * own.sign() * change[other] <= 0.0
            });
            let mut released = [false; MOST_GAPS];
            (0..resting.len()).for_each(|at| released[resting[at].0] = is_released(at));
            (push && leave, Kick { change, energy: impulses[holding.len()], released })
        };
        let found = (0..1 << resting.len()).map(attempt).find(|(fits, _)| *fits);
        found.unwrap_or_else(|| attempt(0)).1
    }

    /// Applies the law of impact, and decides whether contact lasts.
    fn impact(&mut self, gap: usize, side: Side, wall: &Wall, t: f64) {
        let system = self.system.clone();
        let approach = side.sign() * self.rate(gap);
        let [e, slope] = wall.restitution.at(approach);
        let mut kept = [false; MOST_GAPS];
        let outcome = loop {
            let kick = self.kick(gap, side, kept);
            let outcome = self.outcome(gap, side, wall, e, &kick, t);
            // Gaps whose flight would be too low stay at rest. Otherwise impacts in a corner would go on for ever.
            let domain = system.domain(outcome.key);
            let point = domain.point(&outcome.y, t);
            let low = (0..system.gaps()).filter(|&other| kick.released[other]).find(|&other| {
                let Mode::Stuck(own) = self.gaps[other].mode else { return false };
                let presses = own.sign() * domain.tendency(&domain.unit(other), &point, 2).1 > 0.0;
                let leaving = -own.sign() * outcome.y[system.n + other];
                presses && leaving <= limit(dot(&domain.accelerations[other], &point), LOWEST_FLIGHT)
            });
            match low {
                Some(other) => kept[other] = true,
                None => break outcome,
            }
        };
        let (leaving, before, lasts) = (e * approach, self.gaps[gap].series, outcome.lasting.is_some());
        let is_slow = wall.mesh_speed < leaving && leaving <= limit(outcome.pressing, LOWEST_FLIGHT);
        let later = outcome.longer * leaving / outcome.pressing;
        let presses = !lasts && e < 1.0 && outcome.pressing > 0.0;
        self.y = outcome.y;
        if before != Series::Uncounted {
            let begins = lasts || presses && (is_slow || before == Series::Short);
            self.record(gap, if begins { EventKind::MeshStart } else { EventKind::Impact }, side, t);
        }
        if let Some(event) = self.events.iter_mut().rfind(|event| event.gap == gap)
            && lasts
            && before == Series::Uncounted
        {
            event.t = t + later;
        }
        let is_endless = slope == 0.0 && wall.mesh_speed == 0.0 && !outcome.varies;
        let is_short = 2.0 * leaving < SHORT_REST * outcome.radian * (1.0 - e) * outcome.pressing;
        self.gaps[gap].series = match before {
            _ if !presses => Series::Long,
            Series::Long if !is_slow => [Series::Long, Series::Short][usize::from(is_endless && is_short)],
            _ => Series::Uncounted,
        };
        match outcome.lasting {
            None => {}
            Some(Lasting::Rests) => self.gaps[gap].mode = Mode::Stuck(side),
            Some(Lasting::Begins) => self.gaps[gap].mode = Mode::Onset(side),
            Some(Lasting::Presses) => self.cross(gap, side),
        }
        self.change(&outcome.key, None, t);
        match outcome.lasting {
            Some(Lasting::Rests) => self.gaps[gap].on_wall = None,
            Some(Lasting::Presses) => self.leave(gap, side.mirrored(), t),
            _ => self.leave(gap, side, t),
        }
    }

    fn outcome(&self, gap: usize, side: Side, wall: &Wall, e: f64, kick: &Kick, t: f64) -> Outcome {
        let (n, s) = (self.system.n, side.sign());
        let approach = s * self.rate(gap);
        let after = |e: f64| {
            let mut y = self.y;
            (0..n).for_each(|i| y[n + i] -= kick.change[i] * s * (1.0 + e) * approach);
            y[n + gap] = -s * e * approach;
            y
        };
        let mut key = self.key();
        (0..MOST_GAPS).filter(|&other| kick.released[other]).for_each(|other| key.held[other] = None);
        let bounced = after(e);
        let free = self.slide_after(key, kick, &bounced, None, t).unwrap_or(key);
        let domain = self.system.domain(free);
        let point = domain.point(&bounced, t);
        let pressing = s * domain.tendency(&domain.unit(gap), &point, 2).1;
        let presses = |domain: &Domain| s * domain.tendency(&domain.unit(gap), &point, 2).1 > 0.0;
        let (back, varies) = self.reversed(free, &kick.change, &bounced, gap, t);
        // At a reversal of friction, the height of a flight loses digits.
        let deepest = if back == free { DEEPEST_FLIGHT } else { LOWEST_FLIGHT };
        let comes_back = s * dot(&self.system.domain(back).accelerations[gap], &point);
        let ratio = if back == free || varies { 1.0 } else { (comes_back / pressing).sqrt() };
        let longer = (1.0 + 1.0 / ratio) / (1.0 - e * ratio);
        let result = |key: Key, y: Numbers, lasting: Option<Lasting>| Outcome {
            key,
            y,
            lasting,
            pressing,
            radian: domain.radian,
            longer,
            varies,
        };
        if e * approach <= wall.mesh_speed.max(limit(pressing, deepest)) {
            if wall.contact == Contact::Rigid {
                let stopped = after(0.0);
                key.held[gap] = Some(side);
                if let Some(key) = self.slide_after(key, kick, &stopped, Some((gap, side)), t)
                    && key.held[gap].is_some()
                {
                    return result(key, stopped, Some(Lasting::Rests));
                }
            } else if presses(&domain) {
                let mut meshing = free;
                meshing.acting[gap] += signed(side, 1);
                if presses(&self.system.domain(meshing)) {
                    let lasting = if e * approach > 0.0 { Lasting::Begins } else { Lasting::Presses };
                    // The rest of a series of impacts is one flight of the same duration and momentum.
                    let is_series = e * approach > wall.mesh_speed && e < 1.0;
                    let y = if is_series && longer.is_finite() { after(longer * e) } else { bounced };
                    return result(meshing, y, Some(lasting));
                }
            }
        }
        result(free, bounced, None)
    }

    /// Chooses the modes of elements and gaps at rest after an impact, which may have `stopped` a gap.
    fn slide_after(
        &self,
        mut key: Key,
        kick: &Kick,
        y: &Numbers,
        stopped: Option<(usize, Side)>,
        t: f64,
    ) -> Option<Key> {
        let mut at_rest = AtRest { gaps: key.held, elements: [false; MOST_FRICTION] };
        if let Some((gap, side)) = stopped {
            at_rest.gaps[gap] = Some(side);
        }
        let point = self.domain().point(y, t);
        for (i, element) in self.system.elements.iter().enumerate() {
            let moves = element.row.dot(&kick.change).abs();
            let most = (kick.energy * element.row.dot(&(&self.system.mobility * &element.row))).sqrt();
            if *y != self.y && moves > ROUNDING * most {
                key.slides[i] = self.slide_at(i, &point);
            }
            // An element that has only just begun to slide also counts as at rest.
            at_rest.elements[i] = key.slides[i] == Slide::Sticks || self.slide_at(i, &point) == Slide::Sticks;
        }
        key.pieces = self.system.pieces(&key.slides, &point);
        self.consistent(key, &at_rest, &point)
    }

    /// Returns the modes of friction in the second half of a flight, and whether some elements reverse only in some flights, while a gap with
    /// this rate comes to rest in impacts.
    fn reversed(&self, mut key: Key, kick: &DVector<f64>, y: &Numbers, gap: usize, t: f64) -> (Key, bool) {
        let (n, rate, mut stopped, mut varies) = (self.system.n, y[self.system.n + gap], *y, false);
        (0..n).for_each(|i| stopped[n + i] -= kick[i] * rate);
        let point = self.domain().point(&stopped, t);
        for (i, element) in self.system.elements.iter().enumerate() {
            let (along, row) = (element.row.dot(kick).abs(), self.system.sliding_rate(i));
            let slides = dot(&row, &point).abs();
            if along <= ROUNDING * element.row.amax() * kick.amax() || slides > 2.0 * along * rate.abs() {
                continue;
            }
            varies |= slides > ROUNDING * size(&row, &point);
            key.slides[i] = match key.slides[i] {
                Slide::Forwards => Slide::Backwards,
                Slide::Backwards => Slide::Forwards,
                Slide::Sticks => Slide::Sticks,
            };
        }
        (key, varies)
    }

    /// Returns how an element slides at a point.
    fn slide_at(&self, i: usize, point: &PhasePoint) -> Slide {
        let row = self.system.sliding_rate(i);
        match dot(&row, point) {
            rate if rate.abs() <= 0.1 * ROUNDING * size(&row, point) => Slide::Sticks,
            rate if rate > 0.0 => Slide::Forwards,
            _ => Slide::Backwards,
        }
    }

    /// Whether modes are consistent with the forces on gaps and elements at rest.
    fn is_consistent(&self, key: Key, at_rest: &AtRest, point: &PhasePoint) -> bool {
        let domain = self.system.domain(key);
        let gaps = (0..self.system.gaps()).all(|gap| match (at_rest.gaps[gap], domain.pushes[gap]) {
            (None, _) => true,
            (_, Some(push)) => domain.tendency(&push, point, 0).1 > 0.0,
            (Some(side), None) => side.sign() * domain.tendency(&domain.unit(gap), point, 2).1 <= 0.0,
        });
        let elements = || (0..self.system.elements.len()).filter(|&i| at_rest.elements[i]);
        gaps && elements().all(|i| match key.slides[i] {
            Slide::Sticks => domain.holds[i].is_none_or(|hold| {
                [-1.0, 1.0].into_iter().all(|sign| {
                    let room = affine(&hold, sign, self.system.elements[i].static_force, domain.width);
                    domain.tendency(&room, point, 0).1 >= 0.0
                })
            }),
            slide => slide.sign() * domain.tendency(&self.system.sliding_rate(i), point, 1).1 > 0.0,
        })
    }

    /// Returns the first consistent modes: walls hold or do not hold as now before they release or take over, elements stick before they
    /// slide.
    fn consistent(&self, key: Key, at_rest: &AtRest, point: &PhasePoint) -> Option<Key> {
        let gaps: Vec<usize> = (0..MOST_GAPS).filter(|&gap| at_rest.gaps[gap].is_some()).collect();
        let elements: Vec<usize> = (0..MOST_FRICTION).filter(|&i| at_rest.elements[i]).collect();
        let slides = 3usize.pow(elements.len() as u32);
        let sets = (0..1usize << gaps.len()).flat_map(|set| (0..slides).map(move |slide| (set, slide)));
        sets.map(|(set, mut slide)| {
            let mut tried = key;
            for (at, &gap) in gaps.iter().enumerate() {
                let stays = set >> at & 1 == 0;
                tried.held[gap] = at_rest.gaps[gap].filter(|_| stays == key.held[gap].is_some());
            }
            for &i in elements.iter().rev() {
                (tried.slides[i], tried.pieces[i]) = (Slide::ALL[slide % 3], 0);
                slide /= 3;
            }
            tried
        })
        .find(|&tried| self.is_consistent(tried, at_rest, point))
    }

    /// Returns the gaps and elements at rest.
    fn at_rest(&self, exempt: &Exempt) -> AtRest {
        let domain = self.domain();
        let gap = |gap: usize| match (self.gaps[gap].mode, self.gaps[gap].on_wall) {
            _ if exempt.gaps[gap] => None,
            (Mode::Stuck(side), _) => Some(side),
            // Friction, not the wall, holds this gap.
            (Mode::Plain, Some((side, _))) if self.is_kept(&domain, gap) => {
                let ahead = self.next_wall(gap, side).filter(|&(own, _)| own == side);
                let is_rigid =
                    |(own, nth): &(Side, usize)| self.system.walls(gap, *own)[*nth].contact == Contact::Rigid;
                ahead.filter(is_rigid).map(|(own, _)| own)
            }
            _ => None,
        };
        let sticks = self.sticks();
        AtRest {
            gaps: std::array::from_fn(gap),
            elements: std::array::from_fn(|i| sticks[i] && !exempt.elements[i]),
        }
    }

    /// Decides all modes again that depend on forces. Forces are taken at the time `at`; events get the time `t`.
    pub(super) fn settle(&mut self, exempt: &Exempt, at: f64, t: f64) {
        for _ in 0..MOST_DECISIONS {
            if self.settle_contacts(at, t) {
                continue;
            }
            let (at_rest, domain) = (self.at_rest(exempt), self.domain());
            let point = self.point(&domain, at);
            if self.is_consistent(self.key(), &at_rest, &point) {
                break;
            }
            let Some(chosen) = self.consistent(self.key(), &at_rest, &point) else { break };
            self.change(&chosen, None, t);
        }
        for gap in 0..self.system.gaps() {
            if let Some((side, order)) = self.gaps[gap].on_wall
                && (order < RELEASE_ORDER || self.rate(gap) != 0.0 || *exempt == Exempt::default())
            {
                self.leave(gap, side, at);
            }
        }
    }

    /// Decides again the modes of contact onsets and of walls that only push. Returns whether a mode has changed.
    fn settle_contacts(&mut self, at: f64, t: f64) -> bool {
        let domain = self.domain();
        let point = self.point(&domain, at);
        for gap in 0..self.system.gaps() {
            if self.gaps[gap].from_force > 0 || self.is_kept(&domain, gap) {
                continue;
            }
            match (self.gaps[gap].mode, self.force(gap)) {
                (Mode::Onset(side), _) if !self.heads(gap, side, at) => {
                    self.end_contact(gap, side, t);
                    self.gaps[gap].on_wall = self.gaps[gap].on_wall.map(|_| (side, 1));
                    return true;
                }
                (Mode::Open, Some(force)) => {
                    let (order, value) = domain.tendency(&force, &point, 0);
                    if value > 0.0 {
                        self.record(gap, EventKind::MeshStart, side_of(self.gaps[gap].level), t);
                        (self.gaps[gap].mode, self.gaps[gap].from_force) = (Mode::Plain, order);
                        return true;
                    }
                }
                (Mode::Plain, Some(force)) => {
                    let (order, value) = domain.tendency(&force, &point, 0);
                    if value < 0.0 {
                        self.end_contact(gap, side_of(self.gaps[gap].level), t);
                        (self.gaps[gap].mode, self.gaps[gap].from_force) = (Mode::Open, order);
                        return true;
                    }
                }
                _ => {}
            }
        }
        false
    }

    /// Enters new modes of gaps and elements at rest, and records the changes. Changes of friction come first if the rate of the element
    /// `stopped` has vanished.
    fn change(&mut self, next: &Key, stopped: Option<usize>, t: f64) {
        if stopped.is_some() {
            self.change_slides(next, stopped, t);
        }
        for gap in 0..self.system.gaps() {
            match (self.gaps[gap].mode, next.held[gap]) {
                (Mode::Stuck(side), None) => {
                    self.end_contact(gap, side, t);
                    self.gaps[gap].on_wall = Some((side, 1));
                }
                (Mode::Plain, Some(side)) => {
                    self.record(gap, EventKind::MeshStart, side, t);
                    self.gaps[gap].mode = Mode::Stuck(side);
                    self.gaps[gap].on_wall = None;
                }
                _ => {}
            }
        }
        if stopped.is_none() {
            self.change_slides(next, None, t);
        }
        self.hold();
        for gap in 0..self.system.gaps() {
            if let Some((side, 1)) = self.gaps[gap].on_wall {
                self.leave(gap, side, t);
            }
        }
        for i in 0..self.system.elements.len() {
            if self.from_rate[i] > 0 {
                self.from_rate[i] = self.order_of_rate(i, t);
            }
        }
    }

    fn change_slides(&mut self, key: &Key, stopped: Option<usize>, t: f64) {
        let (before, next) = (std::mem::replace(&mut self.slides, key.slides), key.slides);
        (self.pieces, self.at_end) = (key.pieces, [None; CURVES]);
        let point = self.domain().point(&self.y, t);
        for i in (0..self.system.elements.len()).filter(|&i| before[i] != next[i]) {
            let is_at_rest = self.slide_at(i, &point) == Slide::Sticks || stopped == Some(i);
            self.from_rate[i] = usize::from(next[i] != Slide::Sticks && is_at_rest);
            let symbol = match (before[i], next[i]) {
                (Slide::Sticks, _) => Some(b'7'),
                (_, Slide::Sticks) => None,
                _ => (stopped == Some(i)).then_some(b'0'),
            };
            self.record_slip(i, symbol, t);
        }
    }

    /// Returns the order of the root of a sliding rate that is 0 at this instant.
    fn order_of_rate(&self, i: usize, t: f64) -> usize {
        let domain = self.domain();
        let point = self.point(&domain, t);
        if self.slides[i] == Slide::Sticks {
            return 0;
        }
        domain.tendency(&self.system.sliding_rate(i), &point, 1).0.min(RELEASE_ORDER)
    }

    /// Removes rounding errors from the rates of gaps and elements at rest.
    fn hold(&mut self) {
        let (system, key) = (self.system.clone(), self.key());
        let n = system.n;
        let held = (0..system.gaps()).filter(|&gap| key.held[gap].is_some());
        let sticks = self.sticks();
        let sticking = || system.elements.iter().zip(sticks).filter(|(_, sticks)| *sticks);
        let (mut rows, mut speeds): (Vec<_>, Vec<_>) = held.map(|gap| (system.gap_row(gap), 0.0)).unzip();
        rows.extend(sticking().map(|(element, _)| element.row.clone()));
        speeds.extend(sticking().map(|(element, _)| element.speed));
        if rows.is_empty() {
            return self.tie();
        }
        let mut w = DVector::from_column_slice(&self.y[n..2 * n]);
        let constraints = Constraints::new(&system.mobility, &rows);
        let largest = w.amax().max(speeds.iter().fold(0.0, |most: f64, speed| most.max(speed.abs())));
        constraints.project(&system.mobility, &mut w, &speeds);
        let domain = self.domain();
        for i in 0..n {
            // A gap at rest gets a rate of exactly 0, so that it does not hit its wall.
            let had_none = i < system.gaps() && self.y[n + i] == 0.0;
            let is_zero = (domain.is_still[i] || had_none) && w[i].abs() <= ROUNDING * largest;
            self.y[n + i] = if is_zero { 0.0 } else { w[i] };
        }
        self.tie();
    }

    /// Processes a sliding rate that has become 0.
    fn end_sliding(&mut self, i: usize, t: f64) {
        let mut at_rest = self.at_rest(&Exempt::default());
        at_rest.elements[i] = true;
        let point = self.domain().point(&self.y, t);
        let next = self.consistent(self.key(), &at_rest, &point).unwrap_or(self.key());
        if next.slides[i] == self.slides[i] {
            // The rate only touches 0.
            self.from_rate[i] = self.order_of_rate(i, t);
        } else {
            self.change(&next, Some(i), t);
        }
    }

    /// Processes a holding force of an element that has reached its limit.
    fn begin_sliding(&mut self, i: usize, next: Slide, t: f64) {
        let before = self.domain();
        let kept: Vec<usize> = (0..self.system.gaps()).filter(|&gap| self.is_kept(&before, gap)).collect();
        (self.slides[i], self.pieces[i]) = (next, 0);
        let domain = self.domain();
        // The accelerations jump if friction is larger at rest than while sliding.
        let element = &self.system.elements[i];
        let jumps = element.static_force > element.force.at(0.0);
        let release = if jumps { RELEASE_ORDER - 1 } else { RELEASE_ORDER };
        let point = self.point(&domain, t);
        let freed: Vec<usize> = kept.into_iter().filter(|&gap| !domain.is_still[gap]).collect();
        for &gap in &freed {
            if let (Mode::Plain, Some((side, _))) = (self.gaps[gap].mode, self.gaps[gap].on_wall)
                && let Some((own, nth)) = self.next_wall(gap, side)
                && own == side
                && self.system.walls(gap, side)[nth].contact == Contact::Rigid
                && side.sign() * domain.tendency(&domain.unit(gap), &point, release).1 > 0.0
            {
                // From here on, the wall holds the gap.
                self.slides[i] = Slide::Sticks;
                self.record(gap, EventKind::MeshStart, side, t);
                (self.gaps[gap].mode, self.gaps[gap].on_wall) = (Mode::Stuck(side), None);
                return;
            }
        }
        self.from_rate[i] = if jumps { 1 } else { 2 };
        self.record_slip(i, Some(b'7'), t);
        for gap in freed {
            self.gaps[gap].on_wall = self.gaps[gap].on_wall.map(|(side, _)| (side, release));
            if let Mode::Onset(_) = self.gaps[gap].mode {
                self.gaps[gap].from_force = release - 2;
            }
        }
    }

    /// Records an event at a wall. It must be called before the modes change.
    fn record(&mut self, gap: usize, kind: EventKind, side: Side, t: f64) {
        let Gap { origin, .. } = self.gaps[gap];
        let symbol = match (self.gaps[gap].contact(), origin) {
            (Some(Side::Right), _) => Some(b'1'),
            (Some(Side::Left), _) => Some(b'4'),
            (None, None) => None,
            (None, Some(Side::Right)) => Some(if side == Side::Right { b'2' } else { b'3' }),
            (None, Some(Side::Left)) => Some(if side == Side::Left { b'5' } else { b'6' }),
        };
        self.gaps[gap].origin = Some(side);
        self.events.push(Event { gap, kind, side, symbol, t });
        let has_several = self.system.gaps() > 1;
        let written = symbol.map(|symbol| if has_several { word::of_gap(symbol, gap) } else { symbol });
        self.tally.impacts += usize::from(kind == EventKind::Impact);
        self.tally.symbols.extend(written);
        self.tally.phases.push((t / std::f64::consts::TAU).fract());
    }

    fn record_slip(&mut self, i: usize, symbol: Option<u8>, t: f64) {
        if self.gaps.iter().any(|gap| gap.series == Series::Uncounted) {
            return;
        }
        self.slips.push(Slip { t, element: i, symbol, after: self.events.len() });
        self.tally.symbols.extend(symbol);
        self.tally.phases.push((t / std::f64::consts::TAU).fract());
        self.tally.slipped[i] = true;
    }
}

/// Returns the leaving speed of a flight of a height under an acceleration towards the wall.
fn limit(pressing: f64, height: f64) -> f64 {
    (2.0 * height * pressing.abs()).sqrt()
}
