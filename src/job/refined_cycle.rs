//! Solves the equations of a motion's cycle, or of another cycle near its start.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::show::refined_cycle::Refined;
use rattlemap_dynamics::cycle::{Cycle, CycleError};
use rattlemap_dynamics::model::{Model, State, Timing};
use rattlemap_dynamics::orbit::{Class, Orbit};
use rattlemap_dynamics::word::Word;

/// Which cycle is requested, and by which parameter its derivatives are.
#[derive(Clone, Debug, Default)]
pub struct RefineRequest {
    /// Length of the cycle, in forcing periods. Without length and word it is the cycle that the motion reaches.
    pub period: Option<u32>,
    /// Word of the cycle; its length is 1 by default.
    pub word: Option<Word>,
    /// Name of a parameter; no derivatives if none.
    pub by: Option<String>,
}

/// Why there is no such cycle.
#[derive(Debug, thiserror::Error)]
pub enum RefineError {
    /// The motion is no cycle.
    #[error("the motion is not periodic; a period or a word asks for an unstable cycle")]
    NotPeriodic,
    /// Without a force, cycles have no common period.
    #[error("only a model with a force has cycles of a given period")]
    NoForce,
    /// No cycle of this kind was found.
    #[error("no such cycle was found near the motion")]
    NotFound,
    /// The equations have no solution, or the cycle has no derivatives.
    #[error(transparent)]
    Cycle(#[from] CycleError),
}

impl RefineRequest {
    /// Finds the cycle of an orbit from a start. `model` has the time of a cycle without force. None if `halt` is raised.
    ///
    /// # Errors
    /// [`RefineError`] if there is no such cycle, or it has no derivatives.
    pub fn find(
        &self,
        model: &dyn Model,
        (orbit, start): (&Orbit, &State),
        halt: &AtomicBool,
    ) -> Result<Option<Refined>, RefineError> {
        let cycle = if self.period.is_none() && self.word.is_none() {
            let Class::Periodic { period } = orbit.class else { return Err(RefineError::NotPeriodic) };
            Cycle::near(model, &orbit.strobe, period)?
        } else {
            if model.oscillator().map_err(CycleError::from)?.timing != Timing::Forced {
                return Err(RefineError::NoForce);
            }
            let kind = (self.period.unwrap_or(1), self.word.as_ref());
            match Cycle::nearest(model, start, kind, halt)? {
                Some(cycle) => cycle,
                None if halt.load(Ordering::Relaxed) => return Ok(None),
                None => return Err(RefineError::NotFound),
            }
        };
        Ok(Some(Refined::new(model, cycle, self.by.as_deref())?))
    }
}
