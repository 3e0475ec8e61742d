//! The work that a motion may take.

use std::sync::atomic::{AtomicBool, Ordering};

use super::{Stop, Work};

/// Upper limits of the work of a motion, and a flag that stops it.
///
/// Work is counted, not timed, so that a motion ends at the same place on every machine. A caller that raises the
/// flag must discard the result.
#[derive(Clone, Copy, Debug)]
pub struct Allowance<'a> {
    /// Steps, including those that are halved.
    pub steps: u64,
    /// Events.
    pub events: u64,
    /// The stop flag, read once in a forcing period.
    pub halt: Option<&'a AtomicBool>,
}

impl<'a> Allowance<'a> {
    /// No limits.
    pub const UNLIMITED: Allowance<'static> = Allowance { steps: u64::MAX, events: u64::MAX, halt: None };

    /// Adds a stop flag.
    pub fn until(self, halt: &'a AtomicBool) -> Allowance<'a> {
        Allowance { halt: Some(halt), ..self }
    }

    pub(crate) fn after(self, work: Work) -> Allowance<'a> {
        Allowance {
            steps: self.steps.saturating_sub(work.steps),
            events: self.events.saturating_sub(work.events),
            ..self
        }
    }

    pub(crate) fn is_halted(&self) -> bool {
        self.halt.is_some_and(|halt| halt.load(Ordering::Relaxed))
    }

    /// Checks that work is within the limits.
    ///
    /// # Errors
    /// The [`Stop`] of the exceeded limit.
    pub(crate) fn covers(&self, work: Work) -> Result<(), Stop> {
        if work.steps > self.steps || self.is_halted() {
            Err(Stop::TooStiff)
        } else if work.events > self.events {
            Err(Stop::CapEvents)
        } else {
            Ok(())
        }
    }
}
