//! Solves the equations of a motion's cycle, or of another cycle near its start.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::show::refined_cycle::Refined;
use rattlemap_dynamics::cycle::{Cycle, CycleError};
use rattlemap_dynamics::model::{Model, State, Timing};
use rattlemap_dynamics::orbit::{Class, Orbit};
use rattlemap_dynamics::word::Word;

/// Largest difference of the multiplier of a motion from that of its equations.
const SAME_MULTIPLIER: f64 = 1e-3;

/// Which cycle is requested, and the parameter of its derivatives.
#[derive(Clone, Debug, Default)]
pub struct RefineRequest {
    /// Length of the cycle, in forcing periods: 1 if only a word is given. Without both, the cycle that the motion reaches is refined.
    pub period: Option<u32>,
    /// Word of the cycle; none allows any.
    pub word: Option<Word>,
    /// Name of the parameter; without it no derivatives are computed.
    pub by: Option<String>,
}

/// Why there is no such cycle.
#[derive(Debug, thiserror::Error)]
pub enum RefineError {
    /// The motion is no cycle.
    #[error(
        "the motion is not periodic; give a period or a word to find the nearest cycle, stable or unstable"
    )]
    NotPeriodic,
    /// Without a force, cycles have no common period.
    #[error("only a model with a force has cycles of a given period")]
    NoForce,
    /// The equations contradict the motion.
    #[error(
        "the multipliers of the cycle are lost to rounding: it has series of impacts within series of impacts"
    )]
    Inaccurate,
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
            let cycle = Cycle::near(model, &orbit.strobe, period)?;
            let largest = |all: &[[f64; 2]]| all.iter().map(|[re, im]| re.hypot(*im)).fold(0.0, f64::max);
            let (own, other) = (orbit.floquet.as_deref().map(largest), largest(&cycle.multipliers));
            if own.is_some_and(|own| (own - other).abs() > SAME_MULTIPLIER * (1.0 + own)) {
                return Err(RefineError::Inaccurate);
            }
            cycle
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
