//! The equations of a cycle and their derivatives.

use nalgebra::{DMatrix, DVector, RowDVector};

use super::family::Laws;
use super::flight::{Equations, Flight, drift, point};
use super::{CycleError, Extra, Itinerary, Solution};
use crate::machine::{Passage, System};

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
    /// For each touch, this rate and its derivatives by all unknowns.
    pub(super) touches: Vec<Extra>,
    /// Derivatives of the states before each end by all unknowns, and the changes of these states that make all flights fit.
    ends: Vec<DMatrix<f64>>,
    misfits: Vec<DVector<f64>>,
    /// Derivatives of the times of all ends by all unknowns, and of events by the state at phase 0 where they follow it.
    turns: DMatrix<f64>,
    later: DMatrix<f64>,
    /// Times of all ends that are no events.
    known: Vec<f64>,
}

/// A state along a cycle, and the change of the state that makes all flights so far fit.
struct Carried {
    state: DVector<f64>,
    /// Derivatives by all unknowns, and by the state at phase 0 where events follow the state.
    by: DMatrix<f64>,
    misfit: DVector<f64>,
}

impl Carried {
    /// Applies the jumps of a passage. `first_free`: the column of the first free number.
    fn jump(&mut self, laws: &Laws, passage: &Passage, first_free: usize) {
        let (system, n, before) = (&laws.system, self.state.len() / 2, self.state.clone());
        let explicit = |j: usize| laws.slope(j, |system| jumped(system, passage, &before));
        let explicit: Vec<DVector<f64>> = (0..laws.free()).map(explicit).collect();
        for nth in 0.. {
            let Some(jump) = system.jump(passage, nth, &self.state.as_slice()[n..]) else { break };
            let rate_by = jump.row.transpose() * self.by.rows(n, n) * jump.slope;
            let misfit = jump.row.dot(&self.misfit.rows(n, n)) * jump.slope;
            let mut by = self.by.rows_mut(n, n);
            by += &jump.kick * rate_by;
            self.misfit.rows_mut(n, n).axpy(misfit, &jump.kick, 1.0);
            self.state.rows_mut(n, n).axpy(jump.change, &jump.kick, 1.0);
        }
        for mut column in self.by.column_iter_mut() {
            system.shift_back(passage, column.as_mut_slice());
        }
        system.shift_back(passage, self.misfit.as_mut_slice());
        system.shift_back(passage, self.state.as_mut_slice());
        explicit.iter().enumerate().for_each(|(j, x)| self.by.column_mut(first_free + j).axpy(1.0, x, 1.0));
    }
}

/// The equations of flights and their derivatives by free numbers, computed once for all flights in the same modes.
#[derive(Default)]
struct EquationsByModes(Vec<(usize, Equations, Vec<Equations>)>);

impl EquationsByModes {
    /// Returns the equations of the flight with this place.
    fn of(&mut self, laws: &Laws, passages: &[Passage], place: usize) -> (&Equations, &[Equations]) {
        let has_modes = |(other, ..): &(usize, _, _)| passages[*other].has_modes_of(&passages[place]);
        let at = self.0.iter().position(has_modes).unwrap_or_else(|| {
            let accelerations = |system: &System| system.accelerations(&passages[place]) * system.period();
            let of_flight =
                Equations { period: laws.system.period(), accelerations: accelerations(&laws.system) };
            let by_free = |j: usize| {
                let period = laws.slope(j, |system| system.period());
                Equations { period, accelerations: laws.slope(j, accelerations) }
            };
            self.0.push((place, of_flight, (0..laws.free()).map(by_free).collect()));
            self.0.len() - 1
        });
        let (_, of_flight, by_parameter) = &self.0[at];
        (of_flight, by_parameter)
    }
}

/// Returns the state after the jumps of a passage.
pub(super) fn jumped(system: &System, passage: &Passage, before: &DVector<f64>) -> DVector<f64> {
    let (n, mut state) = (before.len() / 2, before.clone());
    for nth in 0.. {
        let Some(jump) = system.jump(passage, nth, &state.as_slice()[n..]) else { break };
        state.rows_mut(n, n).axpy(jump.change, &jump.kick, 1.0);
    }
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
        let mut now = Carried { state: at.start.clone(), by, misfit: DVector::zeros(size) };
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
        };
        let (mut turns, mut turns_by, mut equation) = (0.0, RowDVector::zeros(count + size), size);
        let mut modes = EquationsByModes::default();
        for (i, passage) in self.passages.iter().enumerate() {
            let (of_flight, by_parameter) = modes.of(laws, &self.passages, i);
            let mut flight = Flight {
                equations: of_flight,
                by_parameter,
                orders: system.orders(),
                radian: system.radian(passage) / system.period(),
                turns: [turns, at.turns[i]],
            };
            let mut end_by = RowDVector::zeros(count + size);
            if passage.is_event() {
                end_by[equation] = 1.0;
            } else if passage.is_series() {
                let duration = |system: &System, state: &DVector<f64>, turns: f64| {
                    system
                        .rest(passage, &point(system.orders(), state, turns))
                        .map_or(f64::NAN, |time| time / system.period())
                };
                flight.turns[1] = turns + duration(system, &now.state, turns);
                end_by = series_by(laws, passage, &now, (turns, &turns_by), &duration, first_free);
                now.jump(laws, passage, first_free);
            } else {
                flight.turns[1] = system.known_turns(passage);
                (0..free).for_each(|j| {
                    end_by[first_free + j] = laws.slope(j, |system| system.known_turns(passage))
                });
            }
            let end = flight.end(&now.state).ok_or(CycleError::TooStiff)?;
            if i == 0 {
                linearised.rates = end.rates[0].clone();
            }
            now.by = &end.by_state * (&now.by - &end.rates[0] * &turns_by);
            for (j, of_free) in end.by_parameter.iter().enumerate() {
                now.by.column_mut(first_free + j).axpy(1.0, of_free, 1.0);
            }
            let condition = system.condition(passage);
            if let Some(row) = &condition {
                let point = point(system.orders(), &at.ends[i], flight.turns[1]);
                let row_of_state = row.rows(0, size);
                let rate = row_of_state.dot(&end.rates[1]) + drift(system.orders(), row, &point);
                // A touch changes nothing, so its time does not matter to what follows.
                let rate = if passage.touches().is_some() { f64::INFINITY } else { rate };
                linearised.approaches.push(rate);
                let later = row_of_state.transpose() * now.by.columns(count, size) / -rate;
                linearised.later.set_row(equation - size, &later);
                end_by.columns_mut(count, size).copy_from(&later);
            }
            now.by += &end.rates[1] * &end_by;
            now.misfit = &end.by_state * &now.misfit + (&end.state - &at.ends[i]);
            now.state = at.ends[i].clone();
            (turns, turns_by) = (flight.turns[1], end_by);
            if passage.is_event() {
                let (row, value) = functional(laws, &now, (turns, &turns_by), first_free, &|system| {
                    system.condition(passage)
                });
                linearised.matrix.set_row(equation, &row.columns(0, count));
                linearised.residual[equation] = value;
                equation += 1;
            }
            if passage.touches().is_some() {
                let (row, value) =
                    functional(laws, &now, (turns, &turns_by), first_free, &|system| system.rate(passage));
                linearised.touches.push((row.columns(0, count).into_owned(), value));
            }
            linearised.ends.push(now.by.columns(0, count).into_owned());
            linearised.misfits.push(now.misfit.clone());
            linearised.turns.set_row(i, &turns_by.columns(0, count));
            linearised.known.push(turns);
            if !passage.is_series() {
                now.jump(laws, passage, first_free);
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

/// Returns the derivatives of a function of the point where a flight ends by all unknowns, and its value. `row`: its factors.
fn functional(
    laws: &Laws,
    now: &Carried,
    (turns, turns_by): (f64, &RowDVector<f64>),
    first_free: usize,
    row: &dyn Fn(&System) -> Option<DVector<f64>>,
) -> Extra {
    let (orders, size) = (laws.system.orders(), now.state.len());
    let at = point(orders, &now.state, turns);
    let factors = row(&laws.system).unwrap_or_else(|| DVector::zeros(at.len()));
    let of_state = factors.rows(0, size);
    let mut by = of_state.transpose() * &now.by + turns_by * drift(orders, &factors, &at);
    let value = |system: &System| row(system).map_or(0.0, |row| row.dot(&at));
    (0..laws.free()).for_each(|j| by[first_free + j] += laws.slope(j, value));
    (by, factors.dot(&at) + of_state.dot(&now.misfit))
}

/// Returns the derivatives of the time at which a series of impacts ends.
fn series_by(
    laws: &Laws,
    passage: &Passage,
    now: &Carried,
    (turns, turns_by): (f64, &RowDVector<f64>),
    duration: &dyn Fn(&System, &DVector<f64>, f64) -> f64,
    first_free: usize,
) -> RowDVector<f64> {
    let (system, size) = (&laws.system, now.state.len());
    let n = size / 2;
    // A change of the leaving speed is small compared with this speed.
    let leaving = system
        .jump(passage, 0, &now.state.as_slice()[n..])
        .map_or(0.0, |jump| jump.change.abs() / jump.row.amax());
    let by_entry = |i: usize| {
        let h = DIFFERENCE * if i < n { now.state.rows(0, n).amax() } else { leaving };
        let moved = |by: f64| {
            let mut state = now.state.clone();
            state[i] += by;
            duration(system, &state, turns)
        };
        if h > 0.0 { (moved(h) - moved(-h)) / (2.0 * h) } else { 0.0 }
    };
    let by_state = RowDVector::from_fn(size, |_, i| by_entry(i));
    let by_turns = (duration(system, &now.state, turns + DIFFERENCE)
        - duration(system, &now.state, turns - DIFFERENCE))
        / (2.0 * DIFFERENCE);
    let mut by = by_state * &now.by + turns_by * (1.0 + by_turns);
    (0..laws.free())
        .for_each(|j| by[first_free + j] += laws.slope(j, |system| duration(system, &now.state, turns)));
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
