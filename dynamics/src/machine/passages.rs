//! What a motion passes on its way: flights and what ends them. They are the equations of a cycle.
//!
//! The functions here are linear in points `(x1 .. xn, v1 .. vn, cos, sin, ..., 1)` in the coordinates of the model. Unlike the coordinates of
//! the flow, these do not depend on the values of parameters.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::domain::Functional;
use super::domains::System;
use super::impact::Impact;
use super::modes::Modes;
use super::motion::SeriesModes;
use super::watch::{Moment, Roots, Watch};
use super::{Numbers, SIZE, WIDTH};
use crate::model::{Contact, MOST_GAPS, Side};

/// How an impact changes the gap's rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bounce {
    /// The gap leaves its wall by the law of restitution.
    Leaves,
    /// The gap stops on its wall.
    Stops,
    /// The rest of a series of impacts is one flight.
    Ends,
}

/// An impact of a gap, while walls hold other gaps at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Impulse {
    pub(super) gap: usize,
    pub(super) side: Side,
    pub(super) held: [bool; MOST_GAPS],
    pub(super) bounce: Bounce,
}

/// What ends a flight.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum End {
    /// The root of a watch, and the impacts there.
    Event(Watch, Vec<Impulse>),
    /// The limit of a series of infinitely many impacts. The gap is at rest on its wall during the flight.
    Series(SeriesModes),
    /// The change of the stage with this place in the schedule.
    Stage(usize),
    /// A forcing period ends.
    Period,
    /// Half a forcing period ends.
    Half,
    /// A watch touches 0 and changes nothing.
    Touch(Watch),
}

/// What a motion touches without an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Touched {
    /// A gap touches a wall from outside.
    Wall,
    /// A gap touches the wall of its contact while the contact lasts.
    Contact,
    /// The force of a contact falls to 0, or rises to 0 from below.
    Force,
    /// A sliding rate falls to 0, or a holding force rises to its limit.
    Friction,
    /// The argument of a curve reaches the end of its piece.
    Piece,
    /// An impact is at the limit of those after which contact lasts.
    Limit,
}

/// What is at its limit at an impact: beyond it, contact lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Limit {
    /// The leaving speed is that at which contact lasts.
    Leaving,
    /// The acceleration towards the wall after the impact is 0.
    Pressing,
}

/// A flight and its end.
#[derive(Clone, Debug, PartialEq)]
pub struct Passage {
    pub(super) modes: Modes,
    pub(super) end: End,
    /// Number of completed forcing periods.
    pub(super) period: u64,
    /// Time of the end since the motion's start, in forcing periods.
    pub turns: f64,
    /// State `(x1, v1, ...)` before the end.
    pub state: Numbers,
    /// What is at its limit at the impact that ends the flight; none of most.
    pub(super) limit: Option<Limit>,
}

impl Passage {
    /// Whether the time of the end is the root of a function. Otherwise the time is known.
    pub fn is_event(&self) -> bool {
        matches!(self.end, End::Event(..) | End::Touch(_))
    }

    /// Whether the motion touches something at the end of the flight, and nothing changes.
    pub fn is_touch(&self) -> bool {
        matches!(self.end, End::Touch(_))
    }

    /// Returns what the motion touches at the end of the flight, or what is at its limit there.
    pub fn touches(&self) -> Option<Touched> {
        let End::Touch(watch) = self.end else { return self.limit.map(|_| Touched::Limit) };
        Some(match watch {
            Watch::Wall(..) => Touched::Wall,
            Watch::OnsetEnds(..) | Watch::Leaves(..) => Touched::Contact,
            Watch::PressingEnds(..) | Watch::ForceEnds(..) | Watch::ForceBegins(..) | Watch::PushEnds(..) => {
                Touched::Force
            }
            Watch::RateVanishes(_) | Watch::Slips(..) => Touched::Friction,
            Watch::Border(..) => Touched::Piece,
        })
    }

    /// Returns the flight up to its event, where the event changes nothing; none if the end is no event.
    pub(crate) fn touching(&self) -> Option<Passage> {
        let End::Event(watch, _) = self.end else { return None };
        Some(Passage { end: End::Touch(watch), ..self.clone() })
    }

    /// Returns the flight up to its impact, with something at its limit there; none if the end is no single impact.
    pub(crate) fn limited(&self, limit: Limit) -> Option<Passage> {
        let is_impact = matches!(&self.end, End::Event(_, impulses) if impulses.len() == 1);
        is_impact.then(|| Passage { limit: Some(limit), ..self.clone() })
    }

    /// Returns what is at its limit at the impact that ends the flight.
    pub(crate) fn limit(&self) -> Option<Limit> {
        self.limit
    }

    /// Whether another flight of the same modes ends at the same event, with impacts or without.
    pub(crate) fn meets_event_of(&self, other: &Passage) -> bool {
        let event = |passage: &Passage| match &passage.end {
            End::Event(watch, _) | End::Touch(watch) => Some(*watch),
            _ => None,
        };
        self.modes == other.modes && event(self).is_some() && event(self) == event(other)
    }

    /// Whether the end is the limit of a series of infinitely many impacts.
    pub fn is_series(&self) -> bool {
        matches!(self.end, End::Series(_))
    }

    /// Returns the same passage a whole number of forcing periods later.
    pub(crate) fn later(&self, periods: f64) -> Passage {
        Passage { period: self.period + periods as u64, turns: self.turns + periods, ..self.clone() }
    }

    /// Returns the same event at another time.
    pub(crate) fn at(&self, turns: f64) -> Passage {
        Passage { period: turns.floor() as u64, turns, ..self.clone() }
    }

    /// Whether another flight has the same modes.
    pub(crate) fn has_modes_of(&self, other: &Passage) -> bool {
        self.modes == other.modes
    }

    /// Whether the same modes end in the same way.
    pub fn is_like(&self, other: &Passage) -> bool {
        (&self.modes, &self.end) == (&other.modes, &other.end)
    }
}

/// A function of the point before an impact that is 0 at a limit: a linear one of the point, plus one of the gap's rate.
pub(crate) struct LimitFunction {
    /// Factors of the point.
    pub(crate) factors: DVector<f64>,
    /// Factors of the velocities in the rate of the gap.
    pub(crate) row: DVector<f64>,
    /// The part that depends on the rate, and its derivative.
    pub(crate) value: f64,
    pub(crate) slope: f64,
}

/// The change of the rates by an impact: the rate of the gap is changed by `change`, which has the derivative `slope` by this rate, and all
/// other rates by multiples of this.
pub(crate) struct RateJump<'s> {
    /// Factors of the velocities in the rate of the gap.
    pub(crate) row: &'s [f64],
    /// Changes of all velocities if the gap's rate changes by 1.
    pub(crate) kick: Numbers,
    pub(crate) change: f64,
    pub(crate) slope: f64,
}

impl RateJump<'_> {
    /// Returns the rate of the gap for given velocities, or another product of the row.
    pub(crate) fn rate(&self, v: &[f64]) -> f64 {
        self.row.iter().zip(v).map(|(row, v)| row * v).sum()
    }

    /// Adds the changes of all velocities if the gap's rate changes by `change`.
    pub(crate) fn add(&self, change: f64, v: &mut [f64]) {
        v.iter_mut().zip(&self.kick).for_each(|(v, kick)| *v += kick * change);
    }
}

impl System {
    /// Returns the number of entries of a point in the model's coordinates.
    pub(crate) fn state_width(&self) -> usize {
        self.width() - 2 * (self.n - self.degrees())
    }

    /// Returns a functional in the model's coordinates.
    fn in_state(&self, row: &Functional) -> DVector<f64> {
        let (n, degrees) = (self.n, self.degrees());
        let mut entries = DVector::zeros(self.state_width());
        for j in 0..degrees {
            let sum = |from: usize| (0..n).map(|i| row.0[from + i] * self.to_flow[(i, j)]).sum();
            (entries[j], entries[degrees + j]) = (sum(0), sum(n));
        }
        entries.as_mut_slice()[2 * degrees..].copy_from_slice(&row.0[2 * n..self.width()]);
        entries
    }

    /// Returns the rows of the accelerations during a flight.
    pub(crate) fn accelerations(&self, passage: &Passage) -> DMatrix<f64> {
        let domain = self.domain(&passage.modes);
        let mut rows = DMatrix::zeros(self.n, self.state_width());
        for (i, row) in domain.accelerations.iter().enumerate() {
            rows.set_row(i, &self.in_state(row).transpose());
        }
        &self.from_flow * rows
    }

    /// Returns the row of the function that is 0 at the end of a flight; none if the end is no event.
    pub(crate) fn condition(&self, passage: &Passage) -> Option<DVector<f64>> {
        let (End::Event(watch, _) | End::Touch(watch)) = &passage.end else { return None };
        let (modes, roots, point) = (&passage.modes, &Roots::default(), &[0.0; WIDTH]);
        let moment = Moment { frame: self, domain: self.domain(modes), modes, roots, point };
        Some(self.in_state(&moment.function(*watch)))
    }

    /// Returns the row of the rate of change, per forcing period, of the function that is 0 at the end of a flight. It is 0 if the end is no event.
    pub(crate) fn rate(&self, passage: &Passage) -> DVector<f64> {
        let Some(row) = self.condition(passage) else { return DVector::zeros(self.state_width()) };
        let (degrees, period) = (self.degrees(), self.period);
        let mut rate = self.accelerations(passage).tr_mul(&row.rows(degrees, degrees)) * period;
        rate.rows_mut(degrees, degrees).axpy(period, &row.rows(0, degrees), 1.0);
        for (m, order) in self.orders.iter().enumerate() {
            let (at, turn) = (2 * degrees + 2 * m, TAU * order);
            rate[at] += turn * row[at + 1];
            rate[at + 1] -= turn * row[at];
        }
        rate
    }

    /// Returns the nth jump of the velocities at the end of a flight, if there is one; of a series, the jump at its start. `v`: the velocities
    /// before it.
    pub(crate) fn jump(&self, passage: &Passage, nth: usize, v: &[f64]) -> Option<RateJump<'_>> {
        let impulse = match &passage.end {
            End::Event(_, impulses) => *impulses.get(nth)?,
            End::Series(series) if nth == 0 => series.impulse(),
            _ => return None,
        };
        let Impulse { gap, side, held, bounce } = impulse;
        let row = self.machine.gaps[gap].row.as_slice();
        let rate: f64 = row.iter().zip(v).map(|(row, v)| row * v).sum();
        let (wall, point, approach) = (self.last_wall(gap, side), &[0.0; WIDTH], side.sign() * rate);
        let impact = Impact { system: self, modes: &passage.modes, point, gap, side, wall, approach };
        let kick = impact.kick(|other| held[other]).map_or(self.kicks[gap], |(kick, _)| kick);
        let [e, by_speed] = wall.restitution.at(approach.max(0.0));
        let (factor, by_rate) = match bounce {
            Bounce::Leaves => (1.0 + e, by_speed),
            Bounce::Stops => (1.0, 0.0),
            Bounce::Ends => (1.0 + 2.0 * e / (1.0 - e), 2.0 * by_speed / ((1.0 - e) * (1.0 - e))),
        };
        let mut of_velocities = [0.0; SIZE];
        of_velocities.iter_mut().take(self.degrees()).enumerate().for_each(|(i, of_velocity)| {
            *of_velocity = (0..self.n).map(|j| self.from_flow[(i, j)] * kick[j]).sum();
        });
        Some(RateJump {
            row,
            kick: of_velocities,
            change: -factor * rate,
            slope: -factor - by_rate * approach,
        })
    }

    /// Returns the function that is 0 where the impact at the end of a flight is at its limit; none if it cannot be. `v`: the velocities before it.
    pub(crate) fn limit(&self, passage: &Passage, v: &[f64]) -> Option<LimitFunction> {
        let End::Event(_, impulses) = &passage.end else { return None };
        let (limit, Impulse { gap, side, .. }) = (passage.limit?, *impulses.first()?);
        let row = self.machine.gaps[gap].row.clone();
        let approach = side.sign() * row.iter().zip(v).map(|(row, v)| row * v).sum::<f64>();
        match limit {
            Limit::Leaving => {
                let wall = self.last_wall(gap, side);
                let [e, by_speed] = wall.restitution.at(approach.max(0.0));
                let slope = side.sign() * (e + by_speed * approach);
                // Without a threshold, or if no impact leaves, there is no such limit.
                if wall.mesh_speed == 0.0 || slope == 0.0 {
                    return None;
                }
                let factors = DVector::zeros(self.state_width());
                Some(LimitFunction { factors, row, value: e * approach - wall.mesh_speed, slope })
            }
            Limit::Pressing => {
                let degrees = self.degrees();
                let factors = self.in_state(&self.domain(&passage.modes).accelerations[gap]) * side.sign();
                let jump = self.jump(passage, 0, v)?;
                let of_velocities = &factors.as_slice()[degrees..2 * degrees];
                let by_change = of_velocities.iter().zip(&jump.kick).map(|(x, kick)| x * kick).sum::<f64>();
                // On a rigid wall the gap would be at rest.
                let (change, slope) = match self.last_wall(gap, side).contact {
                    Contact::Rigid => (-jump.rate(v), -1.0),
                    _ => (jump.change, jump.slope),
                };
                let (value, slope) = (by_change * change, by_change * slope);
                Some(LimitFunction { factors, row, value, slope })
            }
        }
    }

    /// Returns the duration of the rest of a series of impacts, for a point in the model's coordinates where the gap has just left its wall;
    /// none if the passage is no series.
    pub(crate) fn rest(&self, passage: &Passage, y: &DVector<f64>) -> Option<f64> {
        let End::Series(series) = &passage.end else { return None };
        let (n, degrees, mut point) = (self.n, self.degrees(), [0.0; WIDTH]);
        for i in 0..n {
            let along = |from: usize| (0..degrees).map(|j| self.to_flow[(i, j)] * y[from + j]).sum();
            (point[i], point[n + i]) = (along(0), along(degrees));
        }
        point[2 * n..self.width()].copy_from_slice(&y.as_slice()[2 * degrees..]);
        Some(series.duration(self, &point))
    }

    /// Returns the time of an end that is no event, in forcing periods.
    pub(crate) fn known_turns(&self, passage: &Passage) -> f64 {
        let whole = passage.period as f64;
        match passage.end {
            // A stage that begins at phase 0 is entered at the end of the period before.
            End::Stage(change) => match self.machine.schedule[change].0 {
                0.0 => whole + 1.0,
                phase => whole + phase,
            },
            End::Half => whole + 0.5,
            End::Period => whole + 1.0,
            End::Event(..) | End::Series(_) | End::Touch(_) => passage.turns,
        }
    }

    /// Returns the time in which the fastest rate of a flight turns by one radian.
    pub(crate) fn radian(&self, passage: &Passage) -> f64 {
        self.domain(&passage.modes).radian()
    }

    /// Returns the orders of the harmonics in a point.
    pub(crate) fn orders(&self) -> &[f64] {
        &self.orders
    }

    /// Shifts a vector `(x1 .. xn, v1 .. vn)` back along rigid-body modes, as at the end of a forcing period.
    pub(crate) fn shift_back(&self, passage: &Passage, y: &mut [f64]) {
        if passage.end == End::Period {
            for mode in &self.rigid_modes.modes {
                let by = y[mode.coordinate];
                y.iter_mut().zip(&mode.direction).for_each(|(y, direction)| *y -= by * direction);
            }
        }
    }
}
