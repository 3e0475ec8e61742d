//! Ctrl-C: the first one asks a run to end, the second one ends it.

use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;

use crate::cli::error::Failure;
use crate::cli::say;

/// Exit code after a second Ctrl-C, as shells count it.
const KILLED: i32 = 130;

/// Whether there was a Ctrl-C.
#[derive(Clone, Default)]
pub(super) struct Interrupt {
    raised: Arc<AtomicBool>,
    /// Whether cells are under way by now.
    integrating: Arc<AtomicBool>,
}

impl Interrupt {
    /// Listens from now on. A second Ctrl-C ends the process at once, which record files survive.
    pub(super) fn listen(quiet: bool) -> Result<Interrupt, Failure> {
        let interrupt = Interrupt::default();
        let Interrupt { raised, integrating } = interrupt.clone();
        ctrlc::set_handler(move || {
            if raised.swap(true, Ordering::Relaxed) {
                process::exit(KILLED);
            }
            let once = match integrating.load(Ordering::Relaxed) {
                true => "some cells have ended",
                false => "the engine is open",
            };
            if !quiet {
                say::note(format_args!("stopping as soon as {once}; Ctrl-C again ends at once"));
            }
        })
        .context("cannot listen for Ctrl-C")?;
        Ok(interrupt)
    }

    /// Says that cells are under way; false if nobody wants them any more.
    pub(super) fn begin(&self) -> bool {
        self.integrating.store(true, Ordering::Relaxed);
        !self.is_raised()
    }

    pub(super) fn is_raised(&self) -> bool {
        self.raised.load(Ordering::Relaxed)
    }
}
