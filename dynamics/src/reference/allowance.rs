//! How much a motion may still take.

use std::sync::atomic::{AtomicBool, Ordering};

use super::{Stop, Work};

/// Work that a motion may take in all, and a flag that ends it before.
///
/// Work is counted, not timed: a motion ends at the same place on every machine. Whoever raises the flag throws the
/// answer away, which may be that of a motion cut short.
#[derive(Clone, Copy, Debug)]
pub struct Allowance<'a> {
    /// Steps, halved ones included.
    pub steps: u64,
    /// Events.
    pub events: u64,
    /// Looked at once a forcing period.
    pub halt: Option<&'a AtomicBool>,
}

impl<'a> Allowance<'a> {
    /// As much as it takes.
    pub const UNLIMITED: Allowance<'static> = Allowance { steps: u64::MAX, events: u64::MAX, halt: None };

    /// The same until a flag is raised.
    pub fn until(self, halt: &'a AtomicBool) -> Allowance<'a> {
        Allowance { halt: Some(halt), ..self }
    }

    /// What is left of it after some work.
    pub(crate) fn after(self, work: Work) -> Allowance<'a> {
        Allowance {
            steps: self.steps.saturating_sub(work.steps),
            events: self.events.saturating_sub(work.events),
            ..self
        }
    }

    /// Whether its flag is raised.
    pub(crate) fn is_halted(&self) -> bool {
        self.halt.is_some_and(|halt| halt.load(Ordering::Relaxed))
    }

    /// Whether some work is within it.
    ///
    /// # Errors
    /// The [`Stop`] of a motion that took as much.
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
