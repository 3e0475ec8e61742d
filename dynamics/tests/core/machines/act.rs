//! Changes of modes, state and tangents at events of a machine.

use std::rc::Rc;

use rattlemap_dynamics::model::{Contact, Side};

use super::motion::{End, Event, Gap, Mode, Motion, Series, What, side_of, step_of};
use super::system::{Functional, Grip, Linear, Matrix, ROUNDING, Vector};

/// Height of flights, in scales of length, that are counted.
const LOWEST_FLIGHT: f64 = 1e-13;

/// Durations of the rest of a series of impacts, in radians of the fastest rate, whose impacts are not counted, and not followed.
const SHORT_REST: f64 = 1.6e-4;
const DEEPEST_REST: f64 = 3e-8;

/// After this number of simultaneous events, an impact shows that impacts of several gaps follow each other without end.
const CROWD: usize = 4;
const AT_ONCE: f64 = 1e-10;

/// Relative rounding error of a rate that an impact has made zero.
const SMALL: f64 = 1e-14;

/// Derivative of the state after an event with respect to the state before it, at a fixed time, and the functional that is constant at the
/// event.
type Saltation = (Matrix, Functional);

/// The change of velocities in a joint impact that changes the gap's rate by 1.
struct Joint {
    change: Vector,
    /// Gaps that leave their walls, with the sides of these walls.
    released: Vec<(usize, Side)>,
}

impl Motion<'_> {
    /// Ends a flight.
    pub(super) fn act(&mut self, end: End, at_start: bool) {
        for i in 0..self.gaps.len() {
            let is_own = match end {
                End::Crosses(gap, _) => gap == i,
                End::Rests(element) | End::Slips(element, _) => self.rubs(element, i),
                End::Bends(curve, _) => curve < self.grips.len() && self.rubs(curve, i),
                _ => false,
            };
            if !is_own && self.break_series(i) {
                return;
            }
        }
        if let End::Bends(i, is_next) = end {
            return self.bend(i, is_next);
        }
        let (grips, mut stuck, before) = (self.grips.clone(), self.stuck(), self.field());
        let is_still = self.linear().is_still.clone();
        let (n, system) = (self.system.degrees, self.system);
        let one = Matrix::identity(2 * n, 2 * n);
        let (mut cause, mut jumps) = (None, false);
        let saltation: Option<Saltation> = match end {
            End::Rests(i) => {
                (self.grips[i], cause) = (Grip::Stick, Some(i));
                Some((one, system.slides[i].clone()))
            }
            End::Slips(i, grip) => {
                let row = self.linear().hold[i].clone();
                let friction = &system.machine.friction[i];
                let order = if friction.static_force > friction.force { 1 } else { 2 };
                (self.grips[i], self.orders[i], cause) = (grip, order, Some(i));
                (self.passed[i], self.at_point[i]) = (1, None);
                Some((one, row))
            }
            End::Crosses(i, direction) => {
                let (events, saved) = (self.events.len(), Rc::new((self.clone(), end)));
                let reset = self.cross(i, direction, at_start);
                if self.gaps[i].is_low && self.saved[i].is_none() {
                    self.saved[i] = Some(saved);
                }
                jumps = self.events.len() > events;
                reset.map(|reset| (reset, system.z[i].clone()))
            }
            End::OnsetEnds(i, side) => {
                self.enter(i, side);
                None
            }
            End::PressingEnds(i, side) => {
                let row = self.linear().acceleration[i].clone();
                self.ends(i, side);
                Some((one, row))
            }
            // The acceleration is continuous, so tangents do not jump.
            End::PulledOff(i, side) => {
                self.ends(i, side);
                self.gaps[i].leaves = Some((side, 3));
                stuck[i] = None;
                None
            }
            End::Opens(i, side) => {
                let row = self.pushing(i).expect("the wall only pushes");
                self.ends(i, side);
                (self.gaps[i].mode, self.gaps[i].is_unloaded) = (Mode::Open, true);
                Some((one, row))
            }
            End::Closes(i, side) => {
                let row = self.pushing(i).expect("the wall only pushes");
                self.record(i, What::Begins, side);
                let gap = &mut self.gaps[i];
                (gap.mode, gap.leaves, gap.is_unloaded) = (Mode::Plain, None, true);
                Some((one, row))
            }
            End::Bends(..) => None,
        };
        self.settle(&grips, &stuck, &is_still, cause, jumps);
        if let Some((reset, row)) = saltation {
            self.jump(&reset, &row, &before);
        }
    }

    /// Passes a point of a curve, or only touches it. Forces are continuous, so tangents do not jump.
    fn bend(&mut self, i: usize, is_next: bool) {
        let (linear, sign) = (self.linear(), if is_next { 1.0 } else { -1.0 });
        let (mut row, mut order) = (&self.argument(i) * &linear.a * sign, 1);
        while order < 4 && !self.exceeds_rounding(&row) {
            (row, order) = (&row * &linear.a, order + 1);
        }
        let passes = self.of(&row) > 0.0;
        if passes {
            self.passed[i] = if is_next { self.passed[i] + 1 } else { self.passed[i] - 1 };
            self.check_range(i);
        }
        self.at_point[i] = Some((is_next != passes, order));
    }

    fn exceeds_rounding(&self, row: &Functional) -> bool {
        let size: f64 = row.iter().zip(self.y.iter()).map(|(a, b)| (a * b).abs()).sum();
        self.of(row).abs() > ROUNDING * size
    }

    /// The state and the tangents are continuous at a change of the stage.
    pub(super) fn change(&mut self, stage: usize) {
        let (grips, stuck, is_still) = (self.grips.clone(), self.stuck(), self.linear().is_still.clone());
        let before = self.modes();
        self.stage = stage;
        self.settle(&grips, &stuck, &is_still, None, true);
        for (before, _) in before.iter().zip(self.modes()).filter(|(before, after)| *before != after) {
            self.by_stage[0] += usize::from(matches!(before, Mode::Stuck(_)));
            self.by_stage[1] += usize::from(matches!(before, Mode::Onset(_)));
        }
    }

    /// Returns the sides of rigid walls that gaps are at rest on.
    fn stuck(&self) -> Vec<Option<Side>> {
        let of = |gap: &Gap| if let Mode::Stuck(side) = gap.mode { Some(side) } else { None };
        self.gaps.iter().map(of).collect()
    }

    /// Decides the modes of everything at rest, ends contacts that are not pressed, and records changes of friction. `before` has the
    /// earlier modes of friction. The element `cause` has come to rest or has begun to slip. `was_stuck` and `was_still` are the gaps that
    /// were at rest. Forces of walls that only push may have jumped.
    fn settle(
        &mut self,
        before: &[Grip],
        was_stuck: &[Option<Side>],
        was_still: &[bool],
        cause: Option<usize>,
        jumps: bool,
    ) {
        let first = self.symbols.len();
        if jumps {
            (0..self.gaps.len()).for_each(|i| self.push(i));
        }
        let undecided = (self.grips.clone(), self.stuck());
        loop {
            self.decide();
            let linear = self.linear();
            let is_unpressed = |&i: &usize| {
                let gap = &self.gaps[i];
                matches!(gap.mode, Mode::Onset(side)
                    if !gap.is_unpressed && !linear.is_still[i] && !self.presses(&linear, i, side))
            };
            let Some(i) = (0..self.gaps.len()).find(is_unpressed) else { break };
            self.grips.clone_from(&undecided.0);
            for (gap, side) in self.gaps.iter_mut().zip(&undecided.1) {
                if let &Some(side) = side {
                    (gap.mode, gap.leaves) = (Mode::Stuck(side), None);
                }
            }
            let side = self.gaps[i].contact().expect("an onset");
            self.ends(i, side);
        }
        self.loosen(before, was_still);
        for (i, side) in was_stuck.iter().enumerate() {
            if let &Some(side) = side
                && !matches!(self.gaps[i].mode, Mode::Stuck(_))
            {
                self.record_as(i, What::Ends, side, Some(contact_symbol(side)));
            }
        }
        let is_of_gap = self.symbols.len() > first;
        for (i, &before) in before.iter().enumerate() {
            let after = self.grips[i];
            if after != Grip::Stick && after != before && (before == Grip::Stick || cause == Some(i)) {
                let is_in_series = |j: &usize| self.gaps[*j].series == Series::Uncounted && self.rubs(i, *j);
                if (0..self.gaps.len()).any(|j| is_in_series(&j)) {
                    continue;
                }
                let symbol = if before == Grip::Stick { b'7' } else { b'0' };
                self.slips.push((symbol, self.time()));
                // The symbol of the cause comes before that of the gap.
                let at = if is_of_gap && cause == Some(i) { first } else { self.symbols.len() };
                self.symbols.insert(at, symbol);
            }
        }
        self.project();
    }

    /// Opens or closes the contact with a wall that only pushes, according to the sign of its force.
    fn push(&mut self, i: usize) {
        let mode = self.gaps[i].mode;
        if self.gaps[i].is_unloaded || !matches!(mode, Mode::Plain | Mode::Open) || self.pushing(i).is_none()
        {
            if mode == Mode::Open && self.pushing(i).is_none() {
                // Without preload and damper, the force behind the wall pushes.
                self.record(i, What::Begins, side_of(self.gaps[i].level));
                self.gaps[i].mode = Mode::Plain;
            }
            return;
        }
        let side = side_of(self.gaps[i].level);
        let closes = self.closes(i);
        if mode == Mode::Plain && !closes {
            let leaves = self.gaps[i].leaves;
            self.ends(i, side);
            (self.gaps[i].mode, self.gaps[i].leaves) = (Mode::Open, leaves);
        } else if mode == Mode::Open && closes {
            self.record(i, What::Begins, side);
            self.gaps[i].mode = Mode::Plain;
        }
    }

    /// Chooses the first consistent modes of everything at rest. Walls first hold, then release; friction first sticks, then slides
    /// forward, then backward. The modes of the first gap or element vary slowest.
    pub(super) fn decide(&mut self) {
        let stuck = self.stuck();
        let walls: Vec<(usize, Side)> = (0..stuck.len()).filter_map(|i| Some((i, stuck[i]?))).collect();
        let sticking: Vec<usize> = (0..self.grips.len()).filter(|&i| self.grips[i] == Grip::Stick).collect();
        if walls.is_empty() && sticking.is_empty() {
            return;
        }
        // Sliding begins in front of the second point.
        sticking.iter().for_each(|&i| (self.passed[i], self.at_point[i]) = (1, None));
        let (gaps, grips, orders) = (self.gaps.clone(), self.grips.clone(), self.orders.clone());
        let sets = 2usize.pow(walls.len() as u32) * 3usize.pow(sticking.len() as u32);
        for set in 0..sets {
            (self.gaps, self.grips, self.orders) = (gaps.clone(), grips.clone(), orders.clone());
            let mut rest = set;
            for &i in sticking.iter().rev() {
                self.grips[i] = [Grip::Stick, Grip::Plus, Grip::Minus][rest % 3];
                self.orders[i] = usize::from(!rest.is_multiple_of(3));
                rest /= 3;
            }
            for &(i, side) in walls.iter().rev() {
                if !rest.is_multiple_of(2) {
                    (self.gaps[i].mode, self.gaps[i].leaves) = (Mode::Plain, Some((side, 1)));
                }
                rest /= 2;
            }
            let linear = self.linear();
            if walls.iter().all(|&(i, side)| self.is_wall_consistent(&linear, i, side))
                && sticking.iter().all(|&i| self.is_grip_consistent(&linear, i))
            {
                for &(i, side) in &walls {
                    if self.gaps[i].mode == Mode::Plain {
                        self.leave(i, side, true);
                    }
                }
                return;
            }
        }
        (self.gaps, self.grips, self.orders) = (gaps, grips, orders);
    }

    fn is_wall_consistent(&self, linear: &Linear, i: usize, side: Side) -> bool {
        let tends = |row: &Functional| side.sign() * linear.tendency(row, &self.y);
        match self.gaps[i].mode {
            Mode::Stuck(_) => tends(&linear.pressing[i]) > 0.0,
            _ => linear.is_still[i] || tends(&linear.acceleration[i]) <= 0.0,
        }
    }

    fn is_grip_consistent(&self, linear: &Linear, i: usize) -> bool {
        match self.grips[i] {
            Grip::Stick if linear.is_idle[i] => true,
            Grip::Stick => {
                self.limits(linear, i).iter().all(|(room, _)| linear.tendency(room, &self.y) >= 0.0)
            }
            _ if linear.is_driven[i] => false,
            grip => {
                let row = &self.system.slides[i] * &linear.a;
                grip.sign() * linear.tendency(&row, &self.y) > 0.0
            }
        }
    }

    /// Whether the acceleration of a gap presses it to a wall.
    fn presses(&self, linear: &Linear, i: usize, side: Side) -> bool {
        !linear.is_still[i] && side.sign() * linear.tendency(&linear.acceleration[i], &self.y) > 0.0
    }

    /// Releases gaps that friction has held. If the wall of such a gap presses it, contact begins, and on a rigid wall the gap stays at
    /// rest.
    fn loosen(&mut self, before: &[Grip], was_still: &[bool]) {
        for i in (0..self.gaps.len()).filter(|&i| was_still[i]) {
            let linear = self.linear();
            if linear.is_still[i]
                || matches!(self.gaps[i].mode, Mode::Stuck(_))
                || self.has_rate(&self.system.w[i])
            {
                continue;
            }
            let row = &linear.acceleration[i];
            let order = if self.exceeds_rounding(row) { 2 } else { 3 };
            if let Mode::Onset(_) = self.gaps[i].mode {
                self.gaps[i].is_unpressed = order == 3;
                continue;
            }
            let Some((direction, _)) = self.gaps[i].leaves else { continue };
            self.gaps[i].leaves = Some((direction, order));
            if direction.sign() * linear.tendency(row, &self.y) <= 0.0 {
                continue;
            }
            let Some((side, nth)) = self.next_wall(i, direction).filter(|wall| wall.0 == direction) else {
                continue;
            };
            self.record(i, What::Begins, side);
            if self.system.machine.gaps[i].walls[side.index()][nth].contact == Contact::Rigid {
                (self.gaps[i].mode, self.gaps[i].leaves) = (Mode::Stuck(side), None);
                for (element, _) in before.iter().enumerate().filter(|(_, before)| **before == Grip::Stick) {
                    if !self.has_rate(&self.system.slides[element]) {
                        (self.grips[element], self.orders[element]) = (Grip::Stick, 0);
                    }
                }
                self.decide();
            } else {
                self.enter(i, side);
                self.gaps[i].leaves = Some((side.mirrored(), order));
            }
        }
    }

    /// Whether the rate along a row exceeds rounding errors.
    fn has_rate(&self, row: &Functional) -> bool {
        self.of(row).abs() > ROUNDING * self.size_of_rate(row)
    }

    /// Crosses a wall: the gap is then behind it, or in front of it again.
    fn enter(&mut self, i: usize, direction: Side) {
        let gap = &mut self.gaps[i];
        gap.level += step_of(direction);
        (gap.mode, gap.leaves) = (Mode::Plain, Some((direction.mirrored(), 1)));
    }

    /// Processes a gap that reaches a wall. Returns the change of tangents at a fixed time, if the field jumps.
    fn cross(&mut self, i: usize, direction: Side, at_start: bool) -> Option<Matrix> {
        let (side, nth) = self.next_wall(i, direction).expect("a wall");
        let closing = self.rate(i, direction);
        if closing <= 0.0 && (at_start || closing < 0.0) {
            self.gaps[i].leaves = Some((direction, 1));
            return None;
        }
        if let Mode::Onset(own) = self.gaps[i].mode {
            self.ends(i, own);
        }
        let one = Matrix::identity(2 * self.system.degrees, 2 * self.system.degrees);
        if side != direction {
            let is_open = self.gaps[i].mode == Mode::Open;
            if !is_open {
                self.record(i, What::Ends, side);
            }
            self.enter(i, direction);
            return (!is_open).then_some(one);
        }
        match self.system.machine.gaps[i].walls[side.index()][nth].contact {
            Contact::Impact | Contact::Rigid => Some(self.impact(i, side, nth, closing)),
            contact => {
                let origin = self.gaps[i].clone();
                self.enter(i, direction);
                // A curve begins with the force 0.
                self.gaps[i].is_unloaded = self.pushing(i).is_some_and(|row| !self.exceeds_rounding(&row));
                if contact == Contact::Pushing && !self.closes(i) {
                    self.gaps[i].mode = Mode::Open;
                    return None;
                }
                self.record_as(i, What::Begins, side, symbol(&origin, side));
                Some(one)
            }
        }
    }

    /// Returns the joint impact of a gap with a wall. A gap on a rigid wall stays at rest if its wall must push for this, or if it is in
    /// `keep`.
    fn joint(&self, i: usize, side: Side, keep: &[usize]) -> Joint {
        let (machine, stuck) = (&self.system.machine, self.stuck());
        let walls: Vec<(usize, Side)> = (0..stuck.len()).filter_map(|j| Some((j, stuck[j]?))).collect();
        let hit = &machine.gaps[i].row;
        for set in 0..2usize.pow(walls.len() as u32) {
            let is_released = |j: usize| set >> (walls.len() - 1 - j) & 1 == 1;
            let (released, held): (Vec<_>, Vec<_>) = (0..walls.len()).partition(|&j| is_released(j));
            let rows: Vec<&Vector> =
                held.iter().map(|&j| &machine.gaps[walls[j].0].row).chain([hit]).collect();
            let change = self.system.bonds(&rows).pop().expect("the gap").0;
            // Impulses of the walls: they change the gap's rate towards the inside and do not change the rates of held gaps.
            let all = Matrix::from_columns(&rows.iter().map(|row| (*row).clone()).collect::<Vec<_>>());
            let mobility = all.transpose() * &self.system.per_mass * &all;
            let mut rates = Vector::zeros(rows.len());
            rates[rows.len() - 1] = -side.sign();
            let impulses = mobility.try_inverse().expect("independent rows") * rates;
            let size: f64 = impulses.iter().zip(&rows).map(|(p, row)| p.abs() * row.norm()).sum();
            let pushes = held.iter().enumerate().all(|(at, &j)| {
                let is_kept = keep.contains(&walls[j].0);
                is_kept || -walls[j].1.sign() * impulses[at] * rows[at].norm() >= -ROUNDING * size
            });
            let leaves = released.iter().all(|&j| {
                let (other, own) = walls[j];
                let rate = machine.gaps[other].row.dot(&change) * -side.sign();
                !keep.contains(&other) && own.sign() * rate < 0.0
            });
            if pushes && leaves {
                return Joint { change, released: released.into_iter().map(|j| walls[j]).collect() };
            }
        }
        panic!("one set of walls pushes")
    }

    /// Processes an impact, after which contact may last. Returns the change of tangents at a fixed time.
    fn impact(&mut self, i: usize, side: Side, nth: usize, closing: f64) -> Matrix {
        let (n, system) = (self.system.degrees, self.system);
        let (gap, s) = (&system.machine.gaps[i], side.sign());
        let wall = &gap.walls[side.index()][nth];
        let [mut e, mut slope] = wall.restitution.at(closing);
        let start = self.clone();
        // The state after the impact, with this restitution and this mode of the gap.
        let after = |motion: &mut Self, joint: &Joint, e: f64, mode: Mode| {
            motion.y.clone_from(&start.y);
            motion.gaps.clone_from(&start.gaps);
            motion.grips.clone_from(&start.grips);
            motion.orders.clone_from(&start.orders);
            let mut velocities = motion.y.rows_mut(n, n);
            velocities -= &joint.change * (s * (1.0 + e) * closing);
            for &(j, side) in &joint.released {
                (motion.gaps[j].mode, motion.gaps[j].leaves) = (Mode::Plain, Some((side, 1)));
            }
            (motion.gaps[i].mode, motion.gaps[i].leaves) = (mode, Some((side, 1)));
            motion.begin_slides(&joint.change, (1.0 + e) * closing);
            motion.decide();
        };
        let acceleration = |motion: &Self, gap: usize| motion.of(&motion.linear().acceleration[gap]).abs();
        let limit = |motion: &Self, gap: usize| {
            (2.0 * LOWEST_FLIGHT * system.length * acceleration(motion, gap)).sqrt()
        };
        // The rest of a series of impacts is one flight of the same duration and momentum.
        let whole = if e * closing > wall.mesh_speed && e < 1.0 { 2.0 / (1.0 - e) } else { 1.0 };
        let (mut keep, mut joint) = (Vec::new(), self.joint(i, side, &[]));
        let (mut lasts, mut later, mut reverses);
        loop {
            lasts = false;
            after(self, &joint, e, Mode::Plain);
            later = 2.0 * e * closing / ((1.0 - e) * acceleration(self, i));
            reverses = self.reverses(&joint.change, s * e * closing);
            let is_alone =
                start.gaps[i].series != Series::Broken && joint.released.is_empty() && keep.is_empty();
            // At a reversal, the height of a flight loses digits.
            let is_deep = match reverses.contains(&true) || !is_alone {
                false => later <= DEEPEST_REST * self.linear().radian,
                true => e * closing <= limit(self, i),
            };
            if e * closing <= wall.mesh_speed || is_deep {
                if wall.contact == Contact::Rigid {
                    after(self, &joint, 0.0, Mode::Stuck(side));
                    lasts = matches!(self.gaps[i].mode, Mode::Stuck(_));
                } else if self.presses(&self.linear(), i, side) {
                    after(self, &joint, whole * e, if e > 0.0 { Mode::Onset(side) } else { Mode::Plain });
                    if e == 0.0 {
                        self.enter(i, side);
                        self.gaps[i].leaves = Some((side.mirrored(), 2));
                        self.decide();
                    }
                    lasts = self.presses(&self.linear(), i, side);
                }
                if !lasts {
                    after(self, &joint, e, Mode::Plain);
                }
            }
            // Gaps whose flight would be too low stay at rest; otherwise impacts of two gaps could alternate for ever.
            let linear = self.linear();
            let low = joint
                .released
                .iter()
                .find(|&&(j, own)| self.presses(&linear, j, own) && -self.rate(j, own) <= limit(self, j));
            let Some(&(j, _)) = low else { break };
            self.corners += 1;
            keep.push(j);
            joint = start.joint(i, side, &keep);
        }
        if lasts && wall.contact == Contact::Rigid {
            (e, slope) = (0.0, 0.0);
        } else if lasts {
            (e, slope) = (whole * e, whole * slope);
        }
        let is_slow = wall.mesh_speed < e * closing && e * closing <= limit(self, i);
        let presses = !lasts && e < 1.0 && self.presses(&self.linear(), i, side);
        if !joint.released.is_empty() || !keep.is_empty() {
            self.break_series(i);
        }
        let before = self.gaps[i].series;
        let ends = before == Series::Short || is_slow;
        // The limit under friction along the gap is tested elsewhere.
        self.is_crowded |= reverses[0] && (presses && ends || lasts && whole > 1.0);
        if before == Series::Uncounted {
            let t = self.time();
            self.gaps[i].uncounted.push(t);
        } else {
            let what = if lasts || presses && ends { What::Begins } else { What::Impact };
            self.record_as(i, what, side, symbol(&start.gaps[i], side));
            self.gaps[i].uncounted.clear();
        }
        let t = self.time() + later;
        if let Some(event) = self.events.iter_mut().rfind(|event| event.gap == i)
            && lasts
            && before == Series::Uncounted
        {
            event.t = t;
        }
        self.gaps[i].series = match before {
            _ if !presses => Series::Broken,
            Series::Broken | Series::Long if !is_slow => {
                let is_endless = slope == 0.0 && wall.mesh_speed == 0.0 && !reverses[1];
                let is_short = is_endless && later < SHORT_REST * self.linear().radian;
                if is_short { Series::Short } else { Series::Long }
            }
            _ => Series::Uncounted,
        };
        self.gaps[i].is_low = self.gaps[i].series == Series::Uncounted && is_slow;
        if self.gaps[i].series != Series::Uncounted {
            self.saved[i] = None;
        }
        if !lasts {
            self.leave(i, side, e == 0.0);
        } else if matches!(self.gaps[i].mode, Mode::Stuck(_)) {
            self.gaps[i].leaves = None;
        }
        let mut reset = Matrix::identity(2 * n, 2 * n);
        let mut velocities = reset.view_mut((n, n), (n, n));
        velocities -= &joint.change * gap.row.transpose() * (1.0 + e + slope * closing);
        reset
    }

    /// Whether an element stops and reverses in each flight of a gap's series of impacts: it has no rate when the gap has none.
    fn rubs(&self, element: usize, gap: usize) -> bool {
        let (gaps, stuck) = (&self.system.machine.gaps, self.stuck());
        let held = (0..gaps.len()).filter(|&other| other != gap && stuck[other].is_some()).chain([gap]);
        let rows: Vec<&Vector> = held.map(|i| &gaps[i].row).collect();
        let kick = self.system.bonds(&rows).pop().expect("the gap").0;
        let rate = self.of(&self.system.w[gap]);
        let velocities = self.y.rows(self.system.degrees, self.system.degrees) - &kick * rate;
        let friction = &self.system.machine.friction[element];
        let slides = (friction.row.dot(&velocities) - friction.speed).abs();
        let along = friction.row.dot(&kick).abs() > ROUNDING * friction.row.norm() * kick.norm();
        along && slides <= SMALL * self.size_of_rate(&self.system.slides[element])
    }

    /// Counts the impacts of a gap's series that have not been counted, because something else happens before their limit. If the last flights
    /// were low, the motion goes back to them, as the gap comes to rest there. Returns whether it does.
    pub(super) fn break_series(&mut self, i: usize) -> bool {
        if let Some(saved) = self.saved[i].take() {
            let end = saved.1;
            self.clone_from(&saved.0);
            self.break_series(i);
            self.act(end, false);
            return true;
        }
        let uncounted = std::mem::take(&mut self.gaps[i].uncounted);
        if self.gaps[i].series == Series::Uncounted
            && let Some(last) = self.events.iter_mut().rfind(|event| event.gap == i)
        {
            last.what = What::Impact;
            let (side, symbol) = (last.side, Some(if last.side == Side::Right { b'2' } else { b'5' }));
            for t in uncounted {
                self.record_as(i, What::Impact, side, symbol);
                self.events.last_mut().expect("the recorded event").t = t;
            }
        }
        self.gaps[i].series = Series::Broken;
        false
    }

    /// Whether an element reverses while a gap with this rate comes to rest in impacts: in each flight, or in some.
    fn reverses(&self, kick: &Vector, rate: f64) -> [bool; 2] {
        let velocities = self.y.rows(self.system.degrees, self.system.degrees) + kick * rate;
        let mut reverses = [false; 2];
        for (i, friction) in self.system.machine.friction.iter().enumerate() {
            let sticks = || {
                let mut held = self.clone();
                held.grips[i] = Grip::Stick;
                let falls = friction.static_force > friction.force;
                self.grips[i] == Grip::Stick
                    || falls && held.of(&held.linear().hold[i]).abs() <= friction.static_force
            };
            let (along, size) = (friction.row.dot(kick).abs(), friction.row.norm() * kick.norm());
            let slides = (friction.row.dot(&velocities) - friction.speed).abs();
            if along > ROUNDING * size && slides <= 2.0 * along * rate.abs() {
                reverses[usize::from(slides > SMALL * size || sticks())] = true;
            }
        }
        reverses
    }

    /// Begins to slide after an impact that has changed the rate of a gap. Gaps that friction holds on a wall may move.
    fn begin_slides(&mut self, kick: &Vector, change: f64) {
        for (i, friction) in self.system.machine.friction.iter().enumerate() {
            let along = friction.row.dot(kick);
            if along.abs() > ROUNDING * friction.row.norm() * kick.norm() {
                let size = self.size_of_rate(&self.system.slides[i]);
                self.grips[i] = self.grip(i, ROUNDING * (along * change).abs() + SMALL * size);
                self.orders[i] = 0;
                self.find_passed(i);
            }
        }
        let kicked: Vec<f64> = self.system.machine.gaps.iter().map(|gap| gap.row.dot(kick)).collect();
        for (i, kicked) in kicked.into_iter().enumerate() {
            if let Some((side, order)) = self.gaps[i].leaves
                && order > 1
                && kicked.abs() > ROUNDING * kick.norm()
            {
                self.gaps[i].leaves = Some((side, 1)).filter(|_| self.rate(i, side) < 0.0);
            }
        }
    }

    pub(super) fn field(&self) -> Vector {
        &self.linear().a * &self.y
    }

    /// Applies the derivative of an event to the tangents. The event lies where `row y` is constant; `before` is the field before it,
    /// and state and modes are those after it.
    fn jump(&mut self, reset: &Matrix, row: &Functional, before: &Vector) {
        if self.tangents.is_none() {
            return;
        }
        let size = 2 * self.system.degrees;
        let change = self.field().rows(0, size) - reset * before.rows(0, size);
        let rate = (row * before)[0];
        let saltation = reset + change * row.columns(0, size) / rate;
        // In series of impacts of two gaps, rounding errors grow without bound unless gaps at rest are held.
        self.tangents = self.tangents.take().map(|tangents| self.held(saltation * tangents));
    }

    /// Ends contact: the gap then moves without its last wall.
    fn ends(&mut self, i: usize, side: Side) {
        self.record(i, What::Ends, side);
        (self.gaps[i].mode, self.gaps[i].leaves) = (Mode::Plain, None);
    }

    fn leave(&mut self, i: usize, side: Side, is_at_rest: bool) {
        let linear = self.linear();
        let order = match is_at_rest {
            false => 1,
            true if self.exceeds_rounding(&linear.acceleration[i]) => 2,
            true => 3,
        };
        (self.gaps[i].mode, self.gaps[i].leaves) = (Mode::Plain, Some((side, order)));
    }

    fn record(&mut self, i: usize, what: What, side: Side) {
        let symbol = symbol(&self.gaps[i], side);
        self.record_as(i, what, side, symbol);
    }

    fn record_as(&mut self, i: usize, what: What, side: Side, symbol: Option<u8>) {
        self.gaps[i].origin = Some(side);
        let of_gap = if self.gaps.len() > 1 { 8 * (i as u8 + 1) } else { 0 };
        self.symbols.extend(symbol.map(|symbol| symbol + of_gap));
        let t = self.time();
        let is_crowd = |last: &[Event]| {
            what != What::Ends
                && last.len() == CROWD
                && last.iter().all(|event| t - event.t < AT_ONCE * self.system.period)
        };
        self.is_crowded |= is_crowd(&self.events[self.events.len().saturating_sub(CROWD)..]);
        self.events.push(Event { gap: i, what, side, symbol, t });
    }
}

fn contact_symbol(side: Side) -> u8 {
    if side == Side::Right { b'1' } else { b'4' }
}

/// Returns the symbol of a flight that ends at a wall.
fn symbol(gap: &Gap, side: Side) -> Option<u8> {
    if let Some(side) = gap.contact() {
        return Some(contact_symbol(side));
    }
    gap.origin.map(|from| match (from, from == side) {
        (Side::Right, true) => b'2',
        (Side::Right, false) => b'3',
        (Side::Left, true) => b'5',
        (Side::Left, false) => b'6',
    })
}
