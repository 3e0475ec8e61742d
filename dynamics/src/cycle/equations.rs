//! The equations of a cycle and their derivatives.

use nalgebra::{DMatrix, DVector, SVector};

use super::family::Laws;
use super::flight::{End, Equations, Flight, drift, point};
use super::{CycleError, Extra, Itinerary, Solution};
use crate::machine::{Passage, System};
use crate::model::MOST_COORDINATES;

/// Relative change of a state for derivatives of the duration of a series of impacts, which is a smooth function of it.
const DIFFERENCE: f64 = 1e-5;

/// The equations of a cycle at approximate values of the unknowns, and their derivatives. The unknowns are the state at phase 0, the times of
/// events, and free numbers.
#[derive(Clone)]
pub(super) struct Linearised {
    /// Residuals of closure, then of the conditions of events.
    pub(super) residual: DVector<f64>,
    /// Their derivatives by all unknowns.
    pub(super) matrix: DMatrix<f64>,
    /// Derivative of the map over all flights by the state at phase 0, where events follow the state.
    pub(super) monodromy: DMatrix<f64>,
    /// Rates of change of the state at phase 0, per turn.
    pub(super) rates: DVector<f64>,
    /// Rates of change, per turn, of the function of each event. They are 0 where the event is at a graze.
    pub(super) approaches: Vec<f64>,
    /// For each touch, this rate, and for each limit, its function, with their derivatives by all unknowns.
    pub(super) touches: Vec<Extra>,
    /// Derivatives of the states before each end by all unknowns, and the changes of these states that make all flights fit.
    ends: Vec<DMatrix<f64>>,
    misfits: Vec<DVector<f64>>,
    /// Derivatives of the times of all ends by all unknowns, and of events by the state at phase 0 where they follow it.
    turns: DMatrix<f64>,
    later: DMatrix<f64>,
    /// Times of all ends that are no events.
    known: Vec<f64>,
    /// Further equations that are solved with these.
    pub(super) extra: Vec<Extra>,
}

/// A state along a cycle, and the change of the state that makes all flights so far fit.
struct Carried {
    state: DVector<f64>,
    /// Derivatives by all unknowns, and by the state at phase 0 where events follow the state.
    by: DMatrix<f64>,
    misfit: DVector<f64>,
    /// Time in turns, and its derivatives.
    turns: f64,
    turns_by: DVector<f64>,
    /// Column of the first free number.
    first_free: usize,
    /// Memory that is used again.
    memory: DMatrix<f64>,
}

impl Carried {
    /// Carries the derivatives over a flight of fixed duration.
    fn fly(&mut self, end: &End) {
        self.by.ger(-1.0, &end.rates[0], &self.turns_by, 1.0);
        end.by_state.mul_to(&self.by, &mut self.memory);
        std::mem::swap(&mut self.by, &mut self.memory);
        for (j, of_free) in end.by_parameter.iter().enumerate() {
            if let Some(of_free) = of_free {
                self.by.column_mut(self.first_free + j).axpy(1.0, of_free, 1.0);
            }
        }
        self.misfit = &end.by_state * &self.misfit;
    }

    /// Applies the jumps of a passage.
    fn jump(&mut self, laws: &Laws, passage: &Passage) {
        let (system, n) = (&laws.system, self.state.len() / 2);
        let explicit: Vec<Velocities> = match system.jump(passage, 0, &self.state.as_slice()[n..]) {
            Some(_) => laws.slopes(|system| changed(system, passage, &self.state)).1,
            None => Vec::new(),
        };
        for nth in 0.. {
            let Some(jump) = system.jump(passage, nth, &self.state.as_slice()[n..]) else { break };
            let columns = self.by.as_mut_slice().chunks_exact_mut(2 * n);
            for column in columns.chain([self.misfit.as_mut_slice()]) {
                jump.add(jump.rate(&column[n..]) * jump.slope, &mut column[n..]);
            }
            jump.add(jump.change, &mut self.state.as_mut_slice()[n..]);
        }
        let columns = self.by.as_mut_slice().chunks_exact_mut(2 * n);
        for column in columns.chain([self.misfit.as_mut_slice(), self.state.as_mut_slice()]) {
            system.shift_back(passage, column);
        }
        for (j, changes) in explicit.iter().enumerate() {
            let column = self.by.column_mut(self.first_free + j);
            column.into_iter().skip(n).zip(changes).for_each(|(x, change)| *x += change);
        }
    }

    /// Returns the derivatives of a function of the present point by all unknowns, and its value.
    fn value(&self, orders: &[f64], function: &Function) -> Extra {
        let at = point(orders, &self.state, self.turns);
        let of_state = function.factors.rows(0, self.state.len());
        let mut by = self.by.tr_mul(&of_state);
        by.axpy(drift(orders, &function.factors, &at), &self.turns_by, 1.0);
        for (j, by_free) in function.by_free.iter().enumerate() {
            by[self.first_free + j] += by_free.dot(&at);
        }
        (by.transpose(), function.factors.dot(&at) + of_state.dot(&self.misfit))
    }
}

/// A linear function of points: its factors, and their derivatives by free numbers.
struct Function {
    factors: DVector<f64>,
    by_free: Vec<DVector<f64>>,
}

impl Function {
    fn of(laws: &Laws, factors: impl Fn(&System) -> DVector<f64>) -> Function {
        let (factors, by_free) = laws.slopes(factors);
        Function { factors, by_free }
    }
}

/// The laws along a cycle.
#[derive(Default)]
struct KnownLaws {
    /// The equations of flights and their derivatives by free numbers, computed once for all flights in the same modes.
    flights: Vec<(usize, Equations, Vec<Option<Equations>>)>,
    /// The functions that are 0 at events, computed once for all events of the same kind.
    conditions: Vec<(usize, Function)>,
}

impl KnownLaws {
    /// Returns the equations of the flight with this place.
    fn flight(
        &mut self,
        laws: &Laws,
        passages: &[Passage],
        place: usize,
    ) -> (&Equations, &[Option<Equations>]) {
        let has_modes = |(other, ..): &(usize, _, _)| passages[*other].has_modes_of(&passages[place]);
        let at = self.flights.iter().position(has_modes).unwrap_or_else(|| {
            let (accelerations, by_free) =
                laws.slopes(|system| system.accelerations(&passages[place]) * system.period());
            let (period, periods) = laws.slopes(|system| system.period());
            let of_slopes = |(period, accelerations): (f64, DMatrix<f64>)| {
                let depends = period != 0.0 || accelerations.iter().any(|x| *x != 0.0);
                depends.then_some(Equations { period, accelerations })
            };
            let by_free = periods.into_iter().zip(by_free).map(of_slopes).collect();
            self.flights.push((place, Equations { period, accelerations }, by_free));
            self.flights.len() - 1
        });
        let (_, of_flight, by_parameter) = &self.flights[at];
        (of_flight, by_parameter)
    }

    /// Returns the function that is 0 at the event with this place.
    fn condition(&mut self, laws: &Laws, passages: &[Passage], place: usize) -> Option<&Function> {
        passages[place].is_event().then_some(())?;
        let is_same = |(other, _): &(usize, _)| passages[*other].meets_event_of(&passages[place]);
        let at = self.conditions.iter().position(is_same).unwrap_or_else(|| {
            let function = Function::of(laws, |system| {
                system.condition(&passages[place]).expect("all systems of a model have the same events")
            });
            self.conditions.push((place, function));
            self.conditions.len() - 1
        });
        Some(&self.conditions[at].1)
    }
}

/// Velocities without an allocation.
type Velocities = SVector<f64, MOST_COORDINATES>;

/// Returns the changes of all velocities by the jumps of a passage.
fn changed(system: &System, passage: &Passage, before: &DVector<f64>) -> Velocities {
    let n = before.len() / 2;
    let old = Velocities::from_fn(|i, _| if i < n { before[n + i] } else { 0.0 });
    let mut new = old;
    for nth in 0.. {
        let Some(jump) = system.jump(passage, nth, &new.as_slice()[..n]) else { break };
        jump.add(jump.change, &mut new.as_mut_slice()[..n]);
    }
    new - old
}

/// Returns the state after the jumps of a passage.
pub(super) fn jumped(system: &System, passage: &Passage, before: &DVector<f64>) -> DVector<f64> {
    let (n, mut state) = (before.len() / 2, before.clone());
    let changes = changed(system, passage, before);
    state.iter_mut().skip(n).zip(&changes).for_each(|(x, change)| *x += change);
    system.shift_back(passage, state.as_mut_slice());
    state
}

impl Itinerary {
    /// Returns the equations and their derivatives by all unknowns: states, times, and the free numbers of the laws.
    pub(super) fn linearise(&self, laws: &Laws, at: &Solution) -> Result<Linearised, CycleError> {
        let (system, size, events, free) = (&laws.system, at.start.len(), self.events(), laws.free());
        let first_free = size + events;
        let count = first_free + free;
        let mut by = DMatrix::identity(size, count + size);
        by.columns_mut(count, size).fill_with_identity();
        let mut now = Carried {
            state: at.start.clone(),
            memory: by.clone(),
            by,
            misfit: DVector::zeros(size),
            turns: 0.0,
            turns_by: DVector::zeros(count + size),
            first_free,
        };
        let mut linearised = Linearised {
            residual: DVector::zeros(first_free),
            matrix: DMatrix::zeros(first_free, count),
            monodromy: DMatrix::zeros(size, size),
            rates: DVector::zeros(size),
            approaches: Vec::new(),
            touches: Vec::new(),
            ends: Vec::new(),
            misfits: Vec::new(),
            turns: DMatrix::zeros(self.passages.len(), count),
            later: DMatrix::zeros(events, size),
            known: Vec::new(),
            extra: Vec::new(),
        };
        let (mut equation, mut known, orders) = (size, KnownLaws::default(), system.orders());
        for (i, passage) in self.passages.iter().enumerate() {
            let (of_flight, by_parameter) = known.flight(laws, &self.passages, i);
            let mut flight = Flight {
                equations: of_flight,
                by_parameter,
                orders,
                radian: system.radian(passage) / system.period(),
                turns: [now.turns, at.turns[i]],
            };
            let mut end_by = DVector::zeros(count + size);
            if passage.is_event() {
                end_by[equation] = 1.0;
            } else if passage.is_series() {
                let duration = |system: &System, state: &DVector<f64>, turns: f64| {
                    system
                        .rest(passage, &point(orders, state, turns))
                        .map_or(f64::NAN, |time| time / system.period())
                };
                flight.turns[1] = now.turns + duration(system, &now.state, now.turns);
                end_by = series_by(laws, passage, &now, &duration);
                now.jump(laws, passage);
            } else {
                flight.turns[1] = system.known_turns(passage);
                let (_, slopes) = laws.slopes(|system| system.known_turns(passage));
                end_by.rows_mut(first_free, free).copy_from_slice(&slopes);
            }
            let end = flight.end(&now.state).ok_or(CycleError::TooStiff)?;
            let turns = flight.turns[1];
            if i == 0 {
                linearised.rates = end.rates[0].clone();
            }
            now.fly(&end);
            now.misfit += &end.state - &at.ends[i];
            let condition = known.condition(laws, &self.passages, i);
            if let Some(function) = condition {
                let point = point(orders, &at.ends[i], turns);
                let row_of_state = function.factors.rows(0, size);
                let rate = row_of_state.dot(&end.rates[1]) + drift(orders, &function.factors, &point);
                // A touch changes nothing, so its time does not matter to what follows.
                let rate = if passage.is_touch() { f64::INFINITY } else { rate };
                linearised.approaches.push(rate);
                let later = now.by.columns(count, size).tr_mul(&row_of_state) / -rate;
                linearised.later.set_row(equation - size, &later.transpose());
                end_by.rows_mut(count, size).copy_from(&later);
            }
            now.by.ger(1.0, &end.rates[1], &end_by, 1.0);
            now.state.copy_from(&at.ends[i]);
            (now.turns, now.turns_by) = (turns, end_by);
            if let Some(function) = condition {
                let (row, value) = now.value(orders, function);
                linearised.matrix.set_row(equation, &row.columns(0, count));
                linearised.residual[equation] = value;
                equation += 1;
            }
            let of_touch = || now.value(orders, &Function::of(laws, |system| system.rate(passage)));
            let of_touch = passage.is_touch().then(of_touch);
            let of_limit = passage.limit().map(|_| limit(laws, passage, &now).ok_or(CycleError::Diverges));
            if let Some((row, value)) = of_touch.or(of_limit.transpose()?) {
                linearised.touches.push((row.columns(0, count).into_owned(), value));
            }
            linearised.ends.push(now.by.columns(0, count).into_owned());
            linearised.misfits.push(now.misfit.clone());
            let of_end = now.turns_by.rows(0, count);
            linearised.turns.row_mut(i).iter_mut().zip(&of_end).for_each(|(turns, x)| *turns = *x);
            linearised.known.push(turns);
            if !passage.is_series() {
                now.jump(laws, passage);
            }
        }
        let sign = if self.mirrored { -1.0 } else { 1.0 };
        let closure = (&now.state + &now.misfit) * sign - &at.start;
        linearised.residual.rows_mut(0, size).copy_from(&closure);
        linearised.matrix.rows_mut(0, size).copy_from(&(now.by.columns(0, count) * sign));
        linearised.monodromy = now.by.columns(count, size) * sign;
        (0..size).for_each(|i| linearised.matrix[(i, i)] -= 1.0);
        Ok(linearised)
    }
}

/// Returns the derivatives of the function of an impact's limit by all unknowns, and its value; none if this impact cannot be at its limit.
fn limit(laws: &Laws, passage: &Passage, now: &Carried) -> Option<Extra> {
    let n = now.state.len() / 2;
    let of = |system: &System| system.limit(passage, &now.state.as_slice()[n..]);
    let here = of(&laws.system)?;
    let function = Function::of(laws, |system| of(system).map_or(&here.factors * 0.0, |of| of.factors));
    let (mut by, linear) = now.value(laws.system.orders(), &function);
    by += here.row.transpose() * now.by.rows(n, n) * here.slope;
    let (_, slopes) = laws.slopes(|system| of(system).map_or(0.0, |of| of.value));
    slopes.iter().enumerate().for_each(|(j, slope)| by[now.first_free + j] += slope);
    Some((by, linear + here.value + here.slope * here.row.dot(&now.misfit.rows(n, n))))
}

/// Returns the derivatives of the time at which a series of impacts ends.
fn series_by(
    laws: &Laws,
    passage: &Passage,
    now: &Carried,
    duration: &dyn Fn(&System, &DVector<f64>, f64) -> f64,
) -> DVector<f64> {
    let (system, size, turns) = (&laws.system, now.state.len(), now.turns);
    let n = size / 2;
    // A change of the leaving speed is small compared with this speed.
    let leaving = system.jump(passage, 0, &now.state.as_slice()[n..]).map_or(0.0, |jump| {
        let largest = jump.row.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        jump.change.abs() / largest
    });
    let by_entry = |i: usize| {
        let h = DIFFERENCE * if i < n { now.state.rows(0, n).amax() } else { leaving };
        let moved = |by: f64| {
            let mut state = now.state.clone();
            state[i] += by;
            duration(system, &state, turns)
        };
        if h > 0.0 { (moved(h) - moved(-h)) / (2.0 * h) } else { 0.0 }
    };
    let by_state = DVector::from_fn(size, |i, _| by_entry(i));
    let by_turns = (duration(system, &now.state, turns + DIFFERENCE)
        - duration(system, &now.state, turns - DIFFERENCE))
        / (2.0 * DIFFERENCE);
    let mut by = now.by.tr_mul(&by_state);
    by.axpy(1.0 + by_turns, &now.turns_by, 1.0);
    let (_, slopes) = laws.slopes(|system| duration(system, &now.state, turns));
    slopes.iter().enumerate().for_each(|(j, slope)| by[now.first_free + j] += slope);
    by
}

impl Linearised {
    /// Returns matrix and residuals with further equations.
    pub(super) fn with(&self, extra: &[Extra]) -> (DMatrix<f64>, DVector<f64>) {
        let (known, all) = (self.residual.len(), self.residual.len() + extra.len());
        let mut matrix = self.matrix.clone().resize_vertically(all, 0.0);
        let mut residual = self.residual.clone().resize_vertically(all, 0.0);
        for (i, (row, value)) in extra.iter().enumerate() {
            matrix.set_row(known + i, row);
            residual[known + i] = *value;
        }
        (matrix, residual)
    }

    /// Changes a solution by a step of all unknowns, and makes its flights fit.
    pub(super) fn change(&self, at: &mut Solution, itinerary: &Itinerary, step: &DVector<f64>) {
        at.ends.iter_mut().zip(&self.misfits).for_each(|(end, misfit)| *end += misfit);
        self.shift(at, itinerary, step);
    }

    /// Returns the rates of change of a solution along a direction of all unknowns.
    pub(super) fn along(&self, at: &Solution, direction: &DVector<f64>) -> Solution {
        let free = at.values.len();
        Solution {
            start: direction.rows(0, at.start.len()).into_owned(),
            ends: self.ends.iter().map(|by| by * direction).collect(),
            turns: (&self.turns * direction).iter().copied().collect(),
            values: direction.rows(direction.len() - free, free).into_owned(),
        }
    }

    /// Shifts a solution by a step of all unknowns.
    pub(super) fn shift(&self, at: &mut Solution, itinerary: &Itinerary, step: &DVector<f64>) {
        at.start += step.rows(0, at.start.len());
        let turns = &self.turns * step;
        for (i, passage) in itinerary.passages.iter().enumerate() {
            at.ends[i] += &self.ends[i] * step;
            at.turns[i] = turns[i] + if passage.is_event() { at.turns[i] } else { self.known[i] };
        }
        let free = at.values.len();
        at.values += step.rows(step.len() - free, free);
    }

    /// Returns the derivatives of the times of events by the state at phase 0.
    pub(super) fn later(&self) -> &DMatrix<f64> {
        &self.later
    }

    /// Returns the derivatives of the times of all ends by all unknowns.
    pub(super) fn turns(&self) -> &DMatrix<f64> {
        &self.turns
    }
}
