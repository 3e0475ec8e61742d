//! Series of impacts: a load presses the gap to its wall, infinitely many impacts happen in a finite time, and their rest is replaced by its
//! limit.

use super::{MachineMotion, Memory};
use crate::machine::domain::LinearDomain;
use crate::machine::flight::Flight;
use crate::machine::impact::Impact;
use crate::machine::modes::{AtRest, GapMode, Modes};
use crate::machine::passages::{Bounce, End, Impulse};
use crate::machine::{Numbers, PhasePoint, ROUNDING, System};
use crate::model::{Contact, MOST_FRICTION, MOST_GAPS, Restitution, Side};
use crate::motion::{CLOSING_ANGLE, EventKind, NO_THRESHOLD, Observer, Slip, SlipKind, Slips};

/// Largest number of flights that are added one by one.
const MOST_FLIGHTS: usize = 1024;

/// Speed of a flight, relative to the first one, below which flights do not change the sum.
const LEAST_SPEED: f64 = 1e-17;

/// Relative changes of speeds and accelerations for derivatives of a duration. It is almost a power of them.
const DIFFERENCE: f64 = 1e-4;

/// The modes of a series of impacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::machine) struct SeriesModes {
    gap: usize,
    side: Side,
    /// Modes of the gap that leaves its wall, and of the gap at rest on it.
    free: Modes,
    pub(in crate::machine) held: Modes,
    /// Friction while the gap comes back.
    back: Slips,
}

impl SeriesModes {
    /// Returns the rest of the series for the point of the stopped gap and the changes of all rates by an impulse on it.
    fn rest<'a>(&self, system: &'a System, kick: &Numbers, stopped: &PhasePoint) -> Rest<'a> {
        let (n, s, free) = (system.n, self.side.sign(), system.domain(&self.free));
        let back = match self.back == self.free.slips {
            true => free,
            false => system.domain(&Modes { slips: self.back, ..self.free }),
        };
        let row = &free.accelerations[self.gap];
        Rest {
            pressing: [free, back].map(|domain| s * domain.accelerations[self.gap].dot(stopped)),
            change: s * system.domain(&self.held).rate_of(row).dot(stopped),
            damping: -(0..n).map(|i| row.0[n + i] * kick[i]).sum::<f64>(),
            restitution: &system.last_wall(self.gap, self.side).restitution,
        }
    }

    /// Returns the impact that stops the gap. Other gaps at rest stay there.
    pub(in crate::machine) fn impulse(&self) -> Impulse {
        let held = std::array::from_fn(|other| self.free.gaps[other].rest().is_some());
        Impulse { gap: self.gap, side: self.side, held, bounce: Bounce::Stops }
    }

    /// Returns the duration of the rest, for a point where the gap has just left its wall.
    pub(in crate::machine) fn duration(&self, system: &System, point: &PhasePoint) -> f64 {
        let (wall, mut stopped) = (system.last_wall(self.gap, self.side), *point);
        let (gap, side, modes) = (self.gap, self.side, &self.free);
        let impact = Impact { system, modes, point, gap, side, wall, approach: 0.0 };
        let kick = impact.kick(|other| modes.gaps[other].rest().is_some());
        let kick = kick.map_or(system.kicks[gap], |(kick, _)| kick);
        let rate = stop(&mut stopped, &kick, system.n, gap);
        self.rest(system, &kick, &stopped).duration(-side.sign() * rate, 0.0)
    }
}

/// Stops a gap by an impulse, and returns its rate before.
fn stop(y: &mut [f64], kick: &Numbers, n: usize, gap: usize) -> f64 {
    let rate = y[n + gap];
    (0..n).for_each(|i| y[n + i] -= kick[i] * rate);
    y[n + gap] = 0.0;
    rate
}

/// The rest of a series of impacts.
struct Rest<'a> {
    /// Accelerations towards the wall of a gap that leaves it, and of one that comes back; they differ by friction along the gap.
    pressing: [f64; 2],
    /// Their rate of change while the gap is at rest on the wall.
    change: f64,
    /// Damping of the gap's motion.
    damping: f64,
    restitution: &'a Restitution,
}

impl Rest<'_> {
    /// Returns the duration for a leaving speed, with `more` acceleration. The error of each flight is of third order.
    fn duration(&self, speed: f64, more: f64) -> f64 {
        let (mut u, mut sum, [mut up, mut down]) =
            (speed, 0.0, self.pressing.map(|pressing| pressing + more));
        let (change, damping) = (self.change, self.damping);
        for flight in 0.. {
            let rise = u / up;
            let height = 0.5 * u * rise * (1.0 - rise * (change / up + 2.0 * damping) / 3.0);
            let rise = rise * (1.0 - 0.5 * rise * (change / up + damping));
            let back = down + change * rise;
            let fall = (2.0 * height / back).sqrt();
            let approach = back * fall * (1.0 + fall * (change / back - damping) / 3.0);
            let time = rise + fall * (1.0 - fall * (change / back - damping) / 6.0);
            let [e, slope] = self.restitution.at(approach);
            let loss = 1.0 - e * approach / u;
            if flight == MOST_FLIGHTS {
                // The logarithm of the loss is almost linear in that of the speed.
                let power = -slope * approach / loss;
                return sum + time * (1.0 / (loss * (1.0 - power)) - power * (0.5 + loss / 6.0));
            }
            sum += time;
            (up, down) = (up + change * time, down + change * time);
            u = e * approach;
            if u <= LEAST_SPEED * speed {
                break;
            }
        }
        sum
    }
}

/// A series of impacts whose rest is short.
struct Series<'s> {
    modes: SeriesModes,
    /// Changes of all rates by an impulse that changes the gap's rate by 1.
    kick: Numbers,
    /// Leaving speed, and duration of the rest.
    speed: f64,
    time: f64,
    rest: Rest<'s>,
    /// The domains of the gap that leaves its wall, and of the gap at rest.
    free: &'s LinearDomain,
    at_rest: &'s LinearDomain,
}

impl<'s> MachineMotion<'s> {
    /// Returns the series of impacts of a gap that has just left its wall, if its rest is short.
    fn series(&mut self, gap: usize, side: Side) -> Option<Series<'s>> {
        let (system, n, s, modes) = (self.system, self.system.n, side.sign(), self.modes);
        let (wall, free, point) = (system.last_wall(gap, side), self.refresh(), self.point);
        let speed = -s * self.rate(gap);
        let impact = Impact { system, modes: &modes, point: &point, gap, side, wall, approach: speed };
        let (lowest, [e, _]) = (impact.lowest_speed(free, gap, &point), wall.restitution.at(speed));
        let is_endless = wall.restitution.terms()[1] == 0.0 && wall.mesh_speed <= NO_THRESHOLD * system.speed;
        if speed <= 0.0 || e >= 1.0 || wall.mesh_speed >= lowest && !is_endless {
            return None;
        }
        let (kick, let_go) = impact.joint_impact([false; MOST_GAPS]);
        let closes = |pressing: [f64; 2]| {
            let is_short = 2.0 * speed < CLOSING_ANGLE * free.radian() * pressing[0] * (1.0 - e);
            let approach = speed * (pressing[1] / pressing[0]).sqrt();
            let leaving = wall.restitution.at(approach)[0] * approach;
            // The next impact would be the last one, see `Impact::outcome`.
            let is_last = leaving <= lowest && wall.mesh_speed < leaving;
            let_go == [false; MOST_GAPS] && pressing[1] > 0.0 && (is_last || is_endless && is_short)
        };
        let row = &free.accelerations[gap];
        let damping = -(0..n).map(|i| row.0[n + i] * kick[i]).sum::<f64>();
        // Without friction, the acceleration of the stopped gap is the same on the way back.
        if system.elements.is_empty() && !closes([s * row.dot(&point) - speed * damping; 2]) {
            return None;
        }
        let mut held = modes;
        held.gaps[gap] = GapMode::Stuck(side);
        let mut series = SeriesModes { gap, side, free: modes, held, back: modes.slips };
        let mut stopped = point;
        stop(&mut stopped, &kick, n, gap);
        for (i, element) in system.elements.iter().enumerate() {
            let along: f64 = element.row.iter().zip(&kick).map(|(row, kick)| row * kick).sum();
            let [rate, size] = element.rate_and_size(&stopped[n..]);
            if rate.abs() <= ROUNDING * size && modes.slips[i] != Slip::Stick {
                if self.sticks_in_flight(i, &stopped) {
                    return None;
                }
                (series.held.slips[i], series.back[i]) = (Slip::Stick, modes.slips[i].reversed());
            } else if along.abs() > ROUNDING * element.row.amax() && rate.abs() <= 2.0 * along.abs() * speed {
                return None;
            }
        }
        let rest = series.rest(system, &kick, &stopped);
        if !closes(rest.pressing) {
            return None;
        }
        let (at_rest, time) = (system.domain(&series.held), rest.duration(speed, 0.0));
        let is_short = time < self.clock.remaining(self.goal).min(at_rest.unit);
        is_short.then_some(Series { modes: series, kick, speed, time, rest, free, at_rest })
    }

    /// Whether an element that slides along the gap of a series sticks where its rate vanishes, because it is larger at rest than sliding.
    fn sticks_in_flight(&self, i: usize, stopped: &PhasePoint) -> bool {
        let (element, mut modes) = (&self.system.elements[i], self.modes);
        modes.slips[i] = Slip::Stick;
        let holds = &self.system.domain(&modes).holds[i];
        element.falls() && holds.as_ref().is_some_and(|hold| hold.dot(stopped).abs() <= element.static_force)
    }

    /// Replaces the rest of a series of impacts by its limit if the rest is short. The gap has just left its wall. Meanwhile everything
    /// else moves as if the gap were at rest on the wall.
    pub(super) fn close_series(&mut self, gap: usize, side: Side, observer: &mut dyn Observer) {
        let Some(series) = self.series(gap, side) else { return };
        let (system, n, modes, start) = (self.system, self.system.n, self.modes, self.point);
        let mut memory = self.memory.take().unwrap_or_default();
        let Memory { path, watches } = &mut *memory;
        self.modes = series.modes.held;
        self.refresh();
        stop(&mut self.point, &series.kick, n, gap);
        series.at_rest.begin(&self.point, series.time, path);
        let moment = self.moment();
        watches.forget();
        moment.list(watches);
        let first = moment.first_event(watches, path);
        if first.number.is_none() && !first.touches {
            self.end_passage();
            series.at_rest.expand(path, n, 1.0);
            if let Some(sums) = observer.sums() {
                let [before, after] = [start, self.point].map(|point| system.energy(&modes, &point));
                sums.lost.add(before, after);
                sums.gaps[gap].lost.add(before, after);
                let (domain, duration, start) = (series.at_rest, series.time, self.clock.time());
                Flight { system, domain, modes: &modes, path, share: 1.0, duration, start }.add_to(sums);
            }
            let (late, scale) = (self.begin_rest(gap, side, &series, &start), self.log_scale);
            let times = (self.contact_time, self.sticking_time);
            self.advance(series.at_rest, path, 1.0, series.time);
            (self.contact_time, self.sticking_time) = times;
            self.pass(End::Series(series.modes));
            self.modes = modes;
            let ends = series.at_rest.derivative(&self.point);
            self.end_series(gap, side, &series, observer);
            let next = self.refresh().derivative(&self.point);
            let factor = (scale - self.log_scale).exp();
            for (tangent, late) in self.tangents.iter_mut().zip(late) {
                (0..2 * n).for_each(|i| tangent[i] += (ends[i] - next[i]) * late * factor);
            }
            self.hold_tangents();
        } else {
            (self.modes, self.point) = (modes, start);
        }
        watches.forget();
        self.memory = Some(memory);
    }

    /// Carries the tangents from the last impact to the motion of a gap at rest. For each, returns how much later the series of the
    /// neighbouring motion ends: it leaves the wall later, at another speed and under another acceleration.
    fn begin_rest(&mut self, gap: usize, side: Side, series: &Series<'_>, start: &PhasePoint) -> Vec<f64> {
        if self.tangents.is_empty() {
            return Vec::new();
        }
        let (n, s, Series { speed, rest, .. }) = (self.system.n, side.sign(), series);
        let slope = |of: &dyn Fn(f64) -> f64, h: f64| (of(h) - of(-h)) / (2.0 * h);
        let per_speed = slope(&|more| rest.duration(speed + more, 0.0), DIFFERENCE * speed);
        let per_pressing = slope(&|more| rest.duration(*speed, more), DIFFERENCE * rest.pressing[1]);
        let [leaves, rests] = [series.free.derivative(start), series.at_rest.derivative(&self.point)];
        let late = |tangent: &mut Numbers| {
            let later = s * tangent[gap] / speed;
            (0..2 * n).for_each(|i| tangent[i] += leaves[i] * later);
            let faster = -s * tangent[n + gap];
            stop(tangent, &series.kick, n, gap);
            tangent[gap] = 0.0;
            (0..2 * n).for_each(|i| tangent[i] -= rests[i] * later);
            let row = &series.free.accelerations[gap].0[..2 * n];
            let along: f64 = row.iter().zip(&*tangent).map(|(row, x)| row * x).sum();
            later + per_speed * faster + per_pressing * (s * along + rest.change * later)
        };
        self.tangents.iter_mut().map(late).collect()
    }

    /// Begins contact at the limit of a series.
    fn end_series(&mut self, gap: usize, side: Side, series: &Series<'_>, observer: &mut dyn Observer) {
        let (system, mut next, back) = (self.system, series.modes.held, series.modes.back);
        let rubs: Vec<usize> = (0..MOST_FRICTION).filter(|&i| back[i] != self.modes.slips[i]).collect();
        let is_rigid = system.last_wall(gap, side).contact == Contact::Rigid;
        let last = system.walls(gap, side).len() - 1;
        // The sliding that reversed in each flight ends, or reverses once more.
        self.modes.slips = back;
        rubs.iter().for_each(|&i| self.record_slip(i, SlipKind::Reversal, observer));
        self.note_before();
        self.jumps.clear();
        self.record(gap, EventKind::MeshStart, side, last, Some(side), observer);
        if !is_rigid {
            rubs.iter().for_each(|&i| self.record_slip(i, SlipKind::Reversal, observer));
            (next.gaps[gap], next.slips) = (GapMode::Pressed(side), back);
            rubs.iter().for_each(|&i| self.roots.from_rate[i] = 2);
        }
        self.modes.gaps[gap] = next.gaps[gap];
        self.change_modes(&next, None, observer);
        if is_rigid {
            self.roots.at_wall[gap] = None;
        } else {
            self.leave(gap, side.mirrored());
        }
        self.settle(&AtRest::default(), observer);
    }
}
