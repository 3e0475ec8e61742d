//! Cycles as boundary value problems.
//!
//! A cycle is a sequence of flights in known modes. Its unknowns are the state at phase 0, and the state and time at the end of each flight.
//! Its equations are the exact flights, the jumps of impacts, one condition at each event (a gap is on its wall, a force or a rate is 0), and
//! closure. These equations stay regular where the strobe map is not: unstable cycles, however large their multipliers are, and grazing. The
//! engine of machines supplies the modes, and rows of accelerations and conditions; see [`passages`](crate::machine::Passage).
//!
//! Derivatives are exact: those of flights by the state are their propagators, those by parameters solve the variational equations. The
//! coefficients of a model at other values of a parameter give the derivatives of coefficients.

mod branch;
mod curve;
mod derivative;
mod equations;
mod family;
mod flight;
mod search;

pub use branch::{
    Branch, BranchEnd, BranchLimits, BranchPoint, CycleFunction, Special, SpecialPoint, follow, follow_on,
    switch,
};
pub use curve::{Condition, Seed, curve};
pub use derivative::{Derivatives, Kink, Numbers, Slope};
pub use family::Free;
pub use search::Cycle;

use std::f64::consts::TAU;

use equations::Linearised;
use family::{Laws, Slopes};
use nalgebra::{DMatrix, DVector, RowDVector};

use crate::machine::{Limit, MachineMotion, Passage, System, Touched};
use crate::model::{Model, ModelError, REST, State, Timing};
use crate::motion::{GapEvent, Observer, SlipEvent, States, Stop};
use crate::word::Word;

/// Largest number of Newton steps.
const MOST_STEPS: usize = 15;

/// Newton's method ends at steps below this, relative to the scales of the unknowns.
const CONVERGED: f64 = 1e-13;

/// Largest step that may be a rounding error, and the ratio of two steps above which it is one.
const STAGNANT: f64 = 1e-7;
const SHRINKS: f64 = 0.9;

/// Largest distance of the motion along a cycle from the solution of its equations, relative to the scales of the unknowns. Near a graze the
/// motion's times have the square root of rounding errors.
const NEAR: f64 = 1e-6;

/// Largest distance of a cycle from a shorter one where two branches meet, relative to the scales of the unknowns.
const SAME: f64 = 1e-4;

/// Changes of the state at phase 0, relative to the scales of the unknowns, that bring an impact from its limit to either side.
const BESIDE_LIMIT: f64 = 1e-10;

/// Time from phase 0, in turns, within which an event may pass it.
const BESIDE: f64 = 1e-3;

/// Largest step after which derivatives of further equations are not computed again, relative to the scales of the unknowns.
const SHORT: f64 = 1e-3;

/// Ratio of two steps above which the method leads elsewhere.
const GROWS: f64 = 2.0;

/// Steps longer than this, relative to the scales of the unknowns, do not lead to a cycle.
const LONGEST: f64 = 1e3;

/// Pivots and singular values below this, relative to the largest one, are 0: the cycle is one of a family.
const SINGULAR: f64 = 1e-11;

/// Largest number of sweeps of the singular value iteration.
const SVD_CAP: usize = 1000;

/// Why a cycle has no equations, or they have no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CycleError {
    /// The model does not allow the values of its parameters.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The motion cannot be continued.
    #[error("the motion along the cycle ends: {0:?}")]
    Stop(Stop),
    /// A flight needs too many steps.
    #[error("a flight of the cycle is too stiff")]
    TooStiff,
    /// Newton's method has not converged.
    #[error("Newton's method does not converge")]
    Diverges,
    /// There is no derivative, because no cycle at this distance in the parameter has the same flights.
    #[error(
        "no cycle with the same sequence of contacts was found within {0:.1e} of this value; the motion may be at a graze or at a fold"
    )]
    Changes(f64),
    /// The computation was halted.
    #[error("interrupted")]
    Halted,
}

/// The sequence of flights of a cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Itinerary {
    passages: Vec<Passage>,
    /// Whether the sequence is the first half of a cycle that is its own mirror image.
    mirrored: bool,
}

/// A solution of the equations of a cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// State `(x1 .. xn, v1 .. vn)` at phase 0.
    start: DVector<f64>,
    /// State before the end of each flight, and its time in forcing periods.
    ends: Vec<DVector<f64>>,
    turns: Vec<f64>,
    /// Values of the free numbers.
    values: DVector<f64>,
}

/// One more equation: its derivatives by all unknowns, and its residual.
type Extra = (RowDVector<f64>, f64);

/// Returns further equations at approximate values of the unknowns. The last argument: the ones of a nearby solution, or none; their
/// derivatives will do here, too.
type Extras<'a> = dyn Fn(&Laws, &Linearised, &Solution, &[Extra]) -> Result<Vec<Extra>, CycleError> + 'a;

/// What Newton's method has found.
struct Found {
    solution: Solution,
    /// Number of steps.
    steps: usize,
    /// The laws and the further equations near the solution.
    nearby: (Laws, Vec<Extra>),
}

impl Itinerary {
    /// Follows the motion from a state at phase 0 for a number of half forcing periods. If the number is odd, the cycle is its own mirror image.
    ///
    /// # Errors
    /// [`CycleError`] if the motion ends.
    pub fn of(
        model: &dyn Model,
        state: &State,
        half_periods: u32,
    ) -> Result<(Itinerary, Solution), CycleError> {
        let oscillator = model.oscillator()?;
        let system = System::new(&oscillator);
        let passages = MachineMotion::new(&system, state).passages(half_periods).map_err(CycleError::Stop)?;
        let in_blocks = |state: &State| in_blocks(state, system.degrees());
        let is_free = oscillator.timing == Timing::Cycle;
        let solution = Solution {
            start: in_blocks(state),
            ends: passages.iter().map(|passage| in_blocks(&passage.state)).collect(),
            turns: passages.iter().map(|passage| passage.turns).collect(),
            values: DVector::from_iterator(usize::from(is_free), is_free.then(|| system.period())),
        };
        Ok((Itinerary { passages, mirrored: half_periods % 2 == 1 }, solution))
    }

    /// Whether another cycle has the same flights.
    pub fn is_like(&self, other: &Itinerary) -> bool {
        let alike = |(a, b): (&Passage, &Passage)| a.is_like(b);
        self.mirrored == other.mirrored
            && self.passages.len() == other.passages.len()
            && self.passages.iter().zip(&other.passages).all(alike)
    }

    fn half_periods(&self, system: &System) -> u32 {
        (2.0 * self.passages.last().map_or(0.0, |last| system.known_turns(last))) as u32
    }

    /// Returns the word of the cycle.
    ///
    /// # Errors
    /// [`CycleError`] if the motion along the cycle ends.
    pub fn word(&self, model: &dyn Model, solution: &Solution) -> Result<Word, CycleError> {
        let free = own(model)?;
        let system = System::new(
            &placed(model, &free, &solution.values.rows(0, free.len()).into_owned()).oscillator()?,
        );
        let halves = self.half_periods(&system);
        let periods = if self.mirrored { halves } else { halves / 2 };
        // The symbol of the first flight depends on the last event of the cycle.
        let (mut before, mut symbols) = (None, Symbols(Vec::new()));
        for _ in 0..2 {
            let start = MachineMotion::new(&system, &solution.state());
            let mut motion = start.in_modes(&self.passages[0], before.as_ref());
            symbols.0.clear();
            for _ in 0..periods {
                motion.advance_period(&mut symbols).map_err(CycleError::Stop)?;
            }
            before = Some(motion);
        }
        Ok(Word::cyclic(&symbols.0))
    }

    /// Whether the motion from the state of a solution, in the modes of the first flight, has this sequence of flights. A solution for which
    /// this is not so is no cycle of the model: it passes through a wall, for example.
    pub fn is_followed(&self, model: &dyn Model, solution: &Solution) -> bool {
        let Ok(oscillator) = model.oscillator() else { return false };
        // Half a cycle shows the other half only if the laws are their own mirror image.
        if self.mirrored && !oscillator.mirror_symmetric() {
            return false;
        }
        let system = System::new(&oscillator);
        let Ok(scales) = self.scales(model, solution, &[]) else { return false };
        let is_run = |state: &State| self.is_run(&system, state, solution, &scales);
        let states = self.beside_limit(solution, &scales);
        // At a limit some nearby motions have this sequence of flights, and others have not.
        states.iter().any(is_run) && (states.len() == 1 || !states.iter().all(is_run))
    }

    /// Returns the states at phase 0 from which the motion may have this sequence of flights: where an impact is at its limit, rounding errors
    /// decide what follows, and nearby states lie on either side.
    fn beside_limit(&self, solution: &Solution, scales: &[f64]) -> Vec<State> {
        let mut states = vec![solution.state()];
        if self.passages.iter().any(|passage| passage.limit().is_some()) {
            for i in 0..solution.start.len() {
                for sign in [1.0, -1.0] {
                    let mut start = solution.start.clone();
                    start[i] += sign * BESIDE_LIMIT * scales[i];
                    states.push(in_pairs(&start));
                }
            }
        }
        states
    }

    /// Whether the motion from a state has this sequence of flights.
    fn is_run(&self, system: &System, state: &State, solution: &Solution, scales: &[f64]) -> bool {
        let half_periods = self.half_periods(system);
        let motion = MachineMotion::new(system, state).in_modes(&self.passages[0], None);
        let Ok(passages) = motion.passages(half_periods) else { return false };
        let is_near = |passage: &Passage, end: &DVector<f64>| {
            let difference = in_blocks(&passage.state, system.degrees()) - end;
            difference.iter().zip(scales).all(|(x, scale)| x.abs() <= NEAR * scale)
        };
        // At a touch the motion may have a tiny event.
        let touches = self.touches(solution);
        let last = 0.5 * f64::from(half_periods);
        let mut expected =
            self.passages.iter().zip(&solution.ends).filter(|(passage, _)| !passage.is_touch());
        let mut next = expected.next();
        for passage in &passages {
            if next.is_some_and(|(other, end)| other.is_like(passage) && is_near(passage, end)) {
                next = expected.next();
            } else if !touches.iter().any(|turns| (turns - passage.turns).abs() <= BESIDE) {
                return false;
            }
        }
        next.is_none() && touches.iter().all(|turns| (-BESIDE..=last + BESIDE).contains(turns))
    }

    /// Returns the sequence of flights, and its approximate solution, without an event at a graze: without an impact, or without the beginning
    /// and the end of a contact. `nth`: the place among all events. With `touches`, the motion touches there.
    fn without(&self, nth: usize, solution: &Solution, touches: bool) -> Option<(Itinerary, Solution)> {
        let mut places = self.passages.iter().enumerate().filter(|(_, passage)| passage.is_event());
        let (at, event) = places.nth(nth)?;
        let is_back = |count: &usize| {
            let next = self.passages.get(at + count);
            next.is_some_and(|next| next.has_modes_of(&self.passages[at]))
        };
        let left_out = at..at + (1..=2).find(is_back)?;
        let (mut shorter, mut seed) = (self.clone(), solution.clone());
        shorter.passages.drain(left_out.clone());
        seed.ends.drain(left_out.clone());
        seed.turns.drain(left_out);
        if touches {
            shorter.insert(&mut seed, &event.touching()?, (&solution.ends[at], solution.turns[at]))?;
        }
        Some((shorter, seed))
    }

    /// Inserts a touch into the flight at its time; none if this flight has other modes.
    fn insert(
        &mut self,
        solution: &mut Solution,
        touch: &Passage,
        (state, turns): (&DVector<f64>, f64),
    ) -> Option<()> {
        let length = self.passages.last()?.turns;
        let turns = if self.mirrored { turns } else { turns.rem_euclid(length) };
        let at = solution.turns.iter().position(|end| turns <= *end).unwrap_or(self.passages.len() - 1);
        let has_modes = |at: &usize| self.passages.get(*at).is_some_and(|flight| flight.has_modes_of(touch));
        let at = [at, at.wrapping_sub(1), at + 1].into_iter().find(has_modes)?;
        self.passages.insert(at, touch.at(turns));
        solution.ends.insert(at, state.clone());
        solution.turns.insert(at, turns);
        Some(())
    }

    /// Returns another sequence of flights with the touches and limits of this one.
    fn touching(&self, solution: &Solution, other: (Itinerary, Solution)) -> Option<(Itinerary, Solution)> {
        let (mut next, mut seed) = other;
        for (i, passage) in self.passages.iter().enumerate() {
            if passage.is_touch() {
                next.insert(&mut seed, passage, (&solution.ends[i], solution.turns[i]))?;
            } else if let Some(limit) = passage.limit() {
                let is_same = |at: &usize| {
                    let follows = |a: &Passage, b: &Passage| a.has_modes_of(b);
                    let after = next.passages.get(at + 1).zip(self.passages.get(i + 1));
                    next.passages[*at].is_like(passage) && after.is_none_or(|(a, b)| follows(a, b))
                };
                let length = self.passages.last()?.turns;
                // The impact may pass phase 0.
                let off = |at: &usize| {
                    let apart = next.passages[*at].turns - solution.turns[i];
                    (apart - length * (apart / length).round()).abs()
                };
                let places = (0..next.passages.len()).filter(is_same);
                let at = places.min_by(|a, b| off(a).total_cmp(&off(b))).filter(|at| off(at) <= BESIDE)?;
                next.passages[at] = next.passages[at].limited(limit)?;
            }
        }
        Some((next, seed))
    }

    /// Returns the flights of the motion along an approximate solution, and the place of the first one that is not in this sequence: among the
    /// motion's flights, and among those here.
    fn departure(&self, model: &dyn Model, solution: &Solution) -> Option<(Vec<Passage>, usize, usize)> {
        let system = System::new(&model.oscillator().ok()?);
        let motion = MachineMotion::new(&system, &solution.state()).in_modes(&self.passages[0], None);
        let mut run = motion.passages(self.half_periods(&system)).ok()?;
        // At a touch the motion may have a tiny event.
        let touches = self.touches(solution);
        run.retain(|passage| {
            !passage.is_event() || touches.iter().all(|turns| (turns - passage.turns).abs() > BESIDE)
        });
        let own = || self.passages.iter().enumerate().filter(|(_, passage)| !passage.is_touch());
        let nth = run.iter().zip(own()).position(|(a, (_, b))| !a.is_like(b))?;
        let (place, _) = own().nth(nth)?;
        Some((run, nth, place))
    }

    /// Returns what the motion along an approximate solution meets where it first leaves this sequence of flights.
    fn first_change(&self, model: &dyn Model, solution: &Solution) -> Option<Touched> {
        let (run, nth, place) = self.departure(model, solution)?;
        let touch = |a: &Passage, b: &Passage| a.touching().filter(|_| a.has_modes_of(b))?.touches();
        let (there, here) = (&run[nth], &self.passages[place]);
        let impact = if there.meets_event_of(here) { Some(place) } else { place.checked_sub(1) };
        let is_impact = impact.is_some_and(|at| self.passages[at].limited(Limit::Leaving).is_some());
        match there.meets_event_of(here) || !there.has_modes_of(here) {
            true => is_impact.then_some(Touched::Limit),
            // Of the two events the earlier one is new, or has vanished.
            false if there.turns < solution.turns[place] => touch(there, here),
            false => touch(here, there),
        }
    }

    /// Returns sequences of flights that may explain why the motion along an approximate solution has another one: the motion touches what it
    /// first meets there, or an impact is at its limit.
    fn with_next_touch(&self, model: &dyn Model, solution: &Solution) -> Option<Vec<(Itinerary, Solution)>> {
        let (run, nth, place) = self.departure(model, solution)?;
        let (there, here, mut all) = (&run[nth], &self.passages[place], Vec::new());
        if let Some(touch) = there.touching().filter(|_| there.has_modes_of(here)) {
            let (mut longer, mut start) = (self.clone(), solution.clone());
            let state = in_blocks(&there.state, start.start.len() / 2);
            all.extend(longer.insert(&mut start, &touch, (&state, there.turns)).map(|()| (longer, start)));
        }
        // The modes after an impact may differ, or its impulse.
        let impact = if there.meets_event_of(here) { Some(place) } else { place.checked_sub(1) };
        for limit in [Limit::Leaving, Limit::Pressing] {
            if let Some((at, limited)) = impact.and_then(|at| Some((at, self.passages[at].limited(limit)?))) {
                let mut other = self.clone();
                other.passages[at] = limited;
                all.push((other, solution.clone()));
            }
        }
        Some(all)
    }

    /// Returns the states after the first event and before the last one if they are so near to phase 0 that they may pass it.
    fn beside_strobe(&self, system: &System, solution: &Solution) -> Vec<State> {
        let (passages, length) = (&self.passages, self.passages.last().map_or(0.0, |last| last.turns));
        let first = passages.first().filter(|passage| passage.is_event() && solution.turns[0] < BESIDE);
        let after = first.map(|passage| equations::jumped(system, passage, &solution.ends[0]));
        let last = passages
            .iter()
            .rposition(Passage::is_event)
            .filter(|&last| length - solution.turns[last] < BESIDE);
        after
            .into_iter()
            // The second half of a cycle that is its own mirror image has the opposite sign.
            .chain(
                last.map(
                    |last| if self.mirrored { -&solution.ends[last] } else { solution.ends[last].clone() },
                ),
            )
            .map(|start| in_pairs(&start))
            .collect()
    }

    /// Returns the sequence of flights of two turns around the cycle, and their solution.
    fn doubled(&self, solution: &Solution) -> (Itinerary, Solution) {
        let (mut twice, mut both) = (self.clone(), solution.clone());
        let length = self.passages.last().map_or(0.0, |last| last.turns);
        twice.passages.extend(self.passages.iter().map(|passage| passage.later(length)));
        both.ends.extend_from_slice(&solution.ends);
        both.turns.extend(solution.turns.iter().map(|turns| turns + length));
        (twice, both)
    }

    /// Returns the half of a cycle that is a shorter one followed twice, or its own mirror image; none of another cycle.
    fn half(&self, model: &dyn Model, solution: &Solution) -> Option<(Itinerary, Solution)> {
        let (oscillator, scales) = (model.oscillator().ok()?, self.scales(model, solution, &[]).ok()?);
        let system = System::new(&oscillator);
        let motion = MachineMotion::new(&system, &solution.state()).in_modes(&self.passages[0], None);
        let halves = self.half_periods(&system);
        let passages = motion.passages(halves / 2).ok()?;
        let ends: Vec<_> =
            passages.iter().map(|passage| in_blocks(&passage.state, system.degrees())).collect();
        let mirrored = !halves.is_multiple_of(4);
        let sign = if mirrored { -1.0 } else { 1.0 };
        let apart = equations::jumped(&system, passages.last()?, ends.last()?) * sign - &solution.start;
        let is_half = !self.mirrored && apart.iter().zip(&scales).all(|(x, scale)| x.abs() <= SAME * scale);
        let turns = passages.iter().map(|passage| passage.turns).collect();
        let half = Solution { start: solution.start.clone(), ends, turns, values: solution.values.clone() };
        is_half.then_some((Itinerary { passages, mirrored }, half))
    }

    /// Returns the times at which the motion touches something without an event.
    fn touches(&self, solution: &Solution) -> Vec<f64> {
        let times = self.passages.iter().zip(&solution.turns);
        times.filter(|(passage, _)| passage.is_touch()).map(|(_, turns)| *turns).collect()
    }

    /// Returns the number of events.
    pub fn events(&self) -> usize {
        self.passages.iter().filter(|passage| passage.is_event()).count()
    }

    /// Solves the equations by Newton's method from a nearby solution. The time of a cycle without force is an unknown, too.
    ///
    /// # Errors
    /// [`CycleError`] if the method does not converge.
    pub fn solve(&self, model: &dyn Model, from: &Solution) -> Result<Solution, CycleError> {
        let free = own(model)?;
        let scales = self.scales(model, from, &free)?;
        let extra =
            |_: &Laws, linearised: &Linearised, _: &Solution, _: &[Extra]| Ok(phase(linearised, &free));
        Ok(self.newton(model, from.clone(), &free, &scales, &extra)?.solution)
    }

    /// Solves the equations together with others for as many free numbers.
    fn newton(
        &self,
        model: &dyn Model,
        mut at: Solution,
        free: &[Free],
        scales: &[f64],
        extra: &Extras<'_>,
    ) -> Result<Found, CycleError> {
        let (mut before, mut known) = (f64::INFINITY, None);
        for steps in 1.. {
            let nearby: Option<&(Laws, Vec<Extra>)> = known.as_ref().filter(|_| before <= SHORT);
            let here = placed(model, free, &at.values);
            let laws = match nearby {
                Some((laws, _)) => laws.beside(&*here)?,
                None => Laws::new(&*here, free, Slopes::Fast)?,
            };
            let linearised = self.linearise(&laws, &at)?;
            let extra = extra(&laws, &linearised, &at, nearby.map_or(&[], |(_, extra)| extra))?;
            let (matrix, residual) = linearised.with(&extra);
            let step = solve_scaled(&matrix, &-residual, scales).ok_or(CycleError::Diverges)?;
            let length =
                step.iter().zip(scales).fold(0.0, |most: f64, (x, scale)| most.max((x / scale).abs()));
            let grows = length > STAGNANT && length > GROWS * before;
            if length.is_nan() || length > LONGEST || grows {
                return Err(CycleError::Diverges);
            }
            linearised.change(&mut at, self, &step);
            // Near singular equations, steps become rounding errors earlier: they do not shrink.
            let stagnates = length <= STAGNANT && length > SHRINKS * before;
            // The next step is shorter at least by the ratio of the last two.
            let next = if steps == 1 { length } else { length * length / before };
            if length.min(next) <= CONVERGED || stagnates {
                return Ok(Found { solution: at, steps, nearby: (laws, extra) });
            }
            if steps == MOST_STEPS {
                break;
            }
            (before, known) = (length, Some((laws, extra)));
        }
        Err(CycleError::Diverges)
    }

    /// Returns the scales of the unknowns: displacements, velocities, times of events, and free numbers.
    fn scales(&self, model: &dyn Model, at: &Solution, free: &[Free]) -> Result<Vec<f64>, CycleError> {
        let oscillator = placed(model, free, &at.values).oscillator()?;
        let (n, omega) = (at.start.len() / 2, TAU / oscillator.period());
        let entries = at.start.iter().enumerate().map(|(i, x)| if i < n { x.abs() } else { x.abs() / omega });
        let length = entries.fold(oscillator.length_scale(), f64::max);
        let of_state = (0..2 * n).map(|i| if i < n { length } else { length * omega });
        let of_free = free.iter().zip(&at.values).map(|(free, value)| free.scale(model, *value));
        Ok(of_state.chain((0..self.events()).map(|_| 1.0)).chain(of_free).collect())
    }

    /// Returns the derivative of the map over the sequence of flights: of the state after it by the state at phase 0. Of a cycle that is its own
    /// mirror image, it is the derivative of the reflected map over half the cycle.
    ///
    /// # Errors
    /// [`CycleError`] if the model is not valid, or a flight is too stiff.
    pub fn monodromy(&self, model: &dyn Model, at: &Solution) -> Result<DMatrix<f64>, CycleError> {
        let free = own(model)?;
        let laws = Laws::new(&*placed(model, &free, &at.values), &[], Slopes::Fast)?;
        Ok(self.linearise(&laws, at)?.monodromy)
    }

    /// Returns the derivatives of the state at phase 0 and of the times of all ends, in forcing periods, by parameters: one column for each.
    ///
    /// # Errors
    /// [`CycleError`] if the model is not valid, or the cycle is at a fold.
    pub fn derivatives(
        &self,
        model: &dyn Model,
        at: &Solution,
        parameters: &[usize],
    ) -> Result<[DMatrix<f64>; 2], CycleError> {
        let own = own(model)?;
        let free: Vec<Free> =
            own.iter().copied().chain(parameters.iter().map(|&index| Free::Parameter(index))).collect();
        let laws = Laws::new(&*placed(model, &own, &at.values), &free, Slopes::Exact)?;
        let linearised = self.linearise(&laws, at)?;
        let (matrix, _) = linearised.with(&phase(&linearised, &own));
        let all = matrix.nrows();
        let scales = self.scales(model, at, &own)?;
        let mut unknowns = DMatrix::zeros(all + parameters.len(), parameters.len());
        for j in 0..parameters.len() {
            let right = -matrix.column(all + j);
            let change = solve_scaled(&matrix.columns(0, all).into_owned(), &right, &scales)
                .ok_or(CycleError::Diverges)?;
            unknowns.view_mut((0, j), (all, 1)).copy_from(&change);
            unknowns[(all + j, j)] = 1.0;
        }
        Ok([unknowns.rows(0, at.start.len()).into_owned(), linearised.turns() * &unknowns])
    }
}

/// The symbols of a motion in order of time.
struct Symbols(Vec<u8>);

impl Observer for Symbols {
    fn event(&mut self, event: &GapEvent, _: States<'_>) {
        self.0.extend(event.symbol);
    }

    fn slip(&mut self, event: &SlipEvent) {
        self.0.extend(event.symbol);
    }
}

/// Converts a state `(x1, v1, ...)` to `(x1 .. xn, v1 .. vn)`.
fn in_blocks(state: &State, n: usize) -> DVector<f64> {
    DVector::from_fn(2 * n, |i, _| if i < n { state[2 * i] } else { state[2 * (i - n) + 1] })
}

/// Converts a state `(x1 .. xn, v1 .. vn)` to `(x1, v1, ...)`.
fn in_pairs(blocks: &DVector<f64>) -> State {
    let (n, mut state) = (blocks.len() / 2, REST);
    (0..n).for_each(|i| (state[2 * i], state[2 * i + 1]) = (blocks[i], blocks[n + i]));
    state
}

/// Returns the free numbers of a model's cycles: the time of a cycle without force.
fn own(model: &dyn Model) -> Result<Vec<Free>, CycleError> {
    let is_free = model.oscillator()?.timing == Timing::Cycle;
    Ok(is_free.then_some(Free::CycleTime).into_iter().collect())
}

/// Returns the model with values of free numbers.
fn placed(model: &dyn Model, free: &[Free], values: &DVector<f64>) -> Box<dyn Model> {
    let mut model = model.clone_model();
    free.iter().zip(values).for_each(|(free, value)| free.place(&mut *model, *value));
    model
}

/// Returns the equation that fixes phase 0 of a cycle without force: the state moves across the flow only.
fn phase(linearised: &Linearised, free: &[Free]) -> Vec<Extra> {
    let count = linearised.matrix.ncols();
    let row = || linearised.rates.transpose().resize_horizontally(count, 0.0);
    free.contains(&Free::CycleTime).then(|| (row(), 0.0)).into_iter().collect()
}

impl Solution {
    /// Returns the state `(x1, v1, ...)` at phase 0.
    pub fn state(&self) -> State {
        in_pairs(&self.start)
    }

    /// Returns all unknowns: the state at phase 0, the times of events, and the free numbers.
    fn unknowns(&self, itinerary: &Itinerary) -> DVector<f64> {
        let events = itinerary.passages.iter().zip(&self.turns).filter(|(passage, _)| passage.is_event());
        let all: Vec<f64> =
            self.start.iter().chain(events.map(|(_, turns)| turns)).chain(&self.values).copied().collect();
        DVector::from_vec(all)
    }

    /// Returns the sum with a multiple of another one of the same sequence of flights.
    fn plus(&self, other: &Solution, factor: f64) -> Solution {
        let sum = |a: &DVector<f64>, b: &DVector<f64>| a + b * factor;
        Solution {
            start: sum(&self.start, &other.start),
            ends: self.ends.iter().zip(&other.ends).map(|(a, b)| sum(a, b)).collect(),
            turns: self.turns.iter().zip(&other.turns).map(|(a, b)| a + b * factor).collect(),
            values: sum(&self.values, &other.values),
        }
    }

    /// Returns the solution at a share of the way to another one of the same sequence of flights.
    fn between(&self, other: &Solution, share: f64) -> Solution {
        self.plus(&other.plus(self, -1.0), share)
    }

    /// Returns the times of the ends of all flights since phase 0, in forcing periods.
    pub fn turns(&self) -> &[f64] {
        &self.turns
    }

    /// Returns the values of the free numbers.
    pub fn values(&self) -> &[f64] {
        self.values.as_slice()
    }
}

/// Solves linear equations whose unknowns have given scales. Among several solutions returns the smallest one.
fn solve_scaled(matrix: &DMatrix<f64>, right: &DVector<f64>, scales: &[f64]) -> Option<DVector<f64>> {
    let (rows, columns) = matrix.shape();
    let mut scaled = DMatrix::from_fn(rows, columns, |i, j| matrix[(i, j)] * scales[j]);
    let mut right = right.clone();
    for (i, mut row) in scaled.row_iter_mut().enumerate() {
        let size = row.amax();
        if size > 0.0 {
            row /= size;
            right[i] /= size;
        }
    }
    if !scaled.iter().chain(&right).all(|x| x.is_finite()) {
        return None;
    }
    let lu = scaled.clone().full_piv_lu();
    let pivots = lu.u().diagonal().abs();
    let solved = if rows == columns && pivots.min() > SINGULAR * pivots.max() {
        lu.solve(&right)?
    } else {
        let svd = scaled.try_svd(true, true, f64::EPSILON, SVD_CAP)?;
        let cutoff = SINGULAR * svd.singular_values.max();
        svd.solve(&right, cutoff).ok()?
    };
    Some(DVector::from_fn(columns, |j, _| solved[j] * scales[j]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::GearPair;
    use crate::motion::{Flow, Trajectory};
    use crate::stability::{StrobeMap, refine};

    /// Returns a cycle by Newton's method on the strobe map.
    fn refined(model: &dyn Model, periods: u32) -> crate::stability::Cycle {
        let flow = Flow::of(model).unwrap();
        let mut motion = Trajectory::new(&flow, model.law(), REST);
        (0..60).for_each(|_| motion.advance_period(&mut ()).unwrap());
        refine(&motion, StrobeMap::Periods(periods)).unwrap()
    }

    #[test]
    fn cycles_and_multipliers_agree_with_the_strobe_map() {
        for e in [0.06, 0.3, 0.45, 0.58] {
            let pair = GearPair::paper(e);
            let cycle = refined(&pair, 1);
            let (itinerary, seed) = Itinerary::of(&pair, &cycle.state, 2).unwrap();
            let solution = itinerary.solve(&pair, &seed).unwrap();
            for (a, b) in solution.state().into_iter().zip(cycle.state) {
                assert!((a - b).abs() < 1e-12, "e = {e}: {:?}, {:?}", solution.state(), cycle.state);
            }
            let found =
                crate::stability::multipliers(&itinerary.monodromy(&pair, &solution).unwrap()).unwrap();
            for (a, b) in found.iter().zip(&cycle.multipliers) {
                assert!(
                    (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9,
                    "e = {e}: {found:?}, {:?}",
                    cycle.multipliers
                );
            }
        }
    }
}
