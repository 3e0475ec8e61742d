//! Cycles of a given period near a motion, stable or not.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::DVector;

use super::branch::nearest;
use super::{CycleError, Free, Itinerary, SAME, Solution, in_blocks, own, placed};
use crate::machine::{MachineMotion, System};
use crate::model::{Model, State};
use crate::stability::multipliers;
use crate::word::Word;

/// Number of forcing periods over which a motion may come close to a cycle.
const WATCHED: usize = 2000;

/// Number of its states that are tried: those that recur most closely.
const MOST_TRIALS: usize = 60;

/// Number of times that a cycle is solved again because its motion has another sequence of flights.
const MOST_SEQUENCES: usize = 4;

/// A cycle that solves its equations.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// The sequence of its flights.
    pub itinerary: Itinerary,
    /// Its states and times.
    pub solution: Solution,
    /// Its length in forcing periods.
    pub periods: u32,
    /// Its word.
    pub word: Word,
    /// Floquet multipliers `[re, im]` of the whole cycle, largest modulus first. That of a shift in time of a cycle without force is left out.
    pub multipliers: Vec<[f64; 2]>,
}

impl Cycle {
    /// Solves the equations of the cycle of this length near a state at phase 0.
    ///
    /// # Errors
    /// [`CycleError`] if Newton's method finds no cycle, or only one that the motion does not follow.
    pub fn near(model: &dyn Model, state: &State, periods: u32) -> Result<Cycle, CycleError> {
        let mut state = *state;
        for _ in 0..MOST_SEQUENCES {
            let (itinerary, seed) = Itinerary::of(model, &state, 2 * periods)?;
            let solution = itinerary.solve(model, &seed)?;
            state = solution.state();
            if let Some(cycle) = Cycle::of(model, itinerary, solution, periods)? {
                return Ok(cycle);
            }
        }
        Err(CycleError::Diverges)
    }

    /// Completes a solution to a cycle; none if the motion has other flights.
    pub(super) fn of(
        model: &dyn Model,
        itinerary: Itinerary,
        solution: Solution,
        periods: u32,
    ) -> Result<Option<Cycle>, CycleError> {
        let free = own(model)?;
        if !itinerary.is_followed(&*placed(model, &free, &solution.values), &solution) {
            return Ok(None);
        }
        let word = itinerary.word(model, &solution)?;
        let mut multipliers =
            multipliers(&itinerary.monodromy(model, &solution)?).ok_or(CycleError::Diverges)?;
        if free.contains(&Free::CycleTime) {
            nearest(&multipliers, 1.0).map(|place| multipliers.remove(place));
        }
        Ok(Some(Cycle { itinerary, solution, periods, word, multipliers }))
    }

    /// Finds the cycle of this length, and of this word if it is given, that is nearest to a start. The search begins at the start and at states to which
    /// the motion from there almost returns; motion in chaos comes near many unstable cycles. None if no such cycle is found, or `halt` is raised.
    ///
    /// # Errors
    /// [`CycleError`] if the motion ends.
    pub fn nearest(
        model: &dyn Model,
        start: &State,
        (periods, word): (u32, Option<&Word>),
        halt: &AtomicBool,
    ) -> Result<Option<Cycle>, CycleError> {
        let system = System::new(&model.oscillator()?);
        let mut motion = MachineMotion::new(&system, start);
        let mut states = vec![*start];
        for _ in 0..WATCHED.max(2 * periods as usize) {
            if halt.load(Ordering::Relaxed) {
                return Ok(None);
            }
            motion.advance_period(&mut ()).map_err(CycleError::Stop)?;
            states.push(motion.state());
        }
        let blocks: Vec<DVector<f64>> =
            states.iter().map(|state| in_blocks(state, system.degrees())).collect();
        let scales = states_scales(&blocks);
        let apart = |a: &DVector<f64>, b: &DVector<f64>| {
            a.iter().zip(b).zip(&scales).map(|((a, b), scale)| ((a - b) / scale).powi(2)).sum::<f64>()
        };
        let returns = |k: &usize| apart(&blocks[*k], &blocks[*k + periods as usize]);
        let mut order: Vec<usize> = (1..states.len() - periods as usize).collect();
        order.sort_by(|a, b| returns(a).total_cmp(&returns(b)));
        let mut found: Option<(f64, Cycle)> = None;
        for place in [0].into_iter().chain(order).take(MOST_TRIALS) {
            if halt.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let Ok(cycle) = Cycle::near(model, &states[place], periods) else { continue };
            if word.is_some_and(|word| *word != cycle.word) || cycle.is_shorter(model) {
                continue;
            }
            let off = apart(&cycle.solution.start, &blocks[0]);
            if found.as_ref().is_none_or(|(least, _)| off < *least) {
                found = Some((off, cycle));
            }
        }
        Ok(found.map(|(_, cycle)| cycle))
    }

    /// Returns the times of the events since phase 0, in forcing periods.
    pub fn event_times(&self) -> Vec<f64> {
        let ends = self.itinerary.passages.iter().zip(self.solution.turns());
        ends.filter(|(passage, _)| passage.is_event()).map(|(_, turns)| *turns).collect()
    }

    /// Whether all multipliers lie within the unit circle.
    pub fn is_stable(&self) -> bool {
        self.multipliers.iter().all(|[re, im]| re.hypot(*im) < 1.0)
    }

    /// Whether a shorter cycle is followed several times.
    fn is_shorter(&self, model: &dyn Model) -> bool {
        let shares = (2..=self.periods).filter(|share| self.periods.is_multiple_of(*share));
        let state = self.solution.state();
        shares.into_iter().any(|share| {
            let Ok((_, run)) = Itinerary::of(model, &state, 2 * self.periods / share) else { return false };
            let Ok(scales) = self.itinerary.scales(model, &self.solution, &[]) else { return false };
            let Some(end) = run.ends.last() else { return false };
            end.iter()
                .zip(&self.solution.start)
                .zip(&scales)
                .all(|((a, b), scale)| (a - b).abs() <= SAME * scale)
        })
    }
}

/// Returns the largest size of each component of states.
fn states_scales(states: &[DVector<f64>]) -> Vec<f64> {
    let largest = |i: usize| states.iter().fold(f64::MIN_POSITIVE, |most, state| most.max(state[i].abs()));
    (0..states[0].len()).map(largest).collect()
}
