//! Ctrl-C and SIGTERM: the first one asks a run to end, the second one ends it.

use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::low_level;

use crate::cli::say;
use crate::job::error::{Failure, SIGNALLED};

/// How soon a signal is heard where the system does not tell of it.
#[cfg(not(unix))]
const HEARS_WITHIN: std::time::Duration = std::time::Duration::from_millis(50);

/// Whether a signal has come, and which.
#[derive(Clone, Default)]
pub(super) struct Interrupt {
    raised: Arc<AtomicBool>,
    signal: Arc<AtomicI32>,
    /// What has to be over before the command can end, if that may take a while.
    waits_for: Arc<Mutex<Option<&'static str>>>,
    /// What is done and said where nothing has to be over.
    ending: Arc<Mutex<Option<Ending>>>,
}

/// How a process ends at once.
struct Ending {
    words: String,
    /// What is undone first.
    leave: Box<dyn FnOnce() + Send>,
}

impl Interrupt {
    /// Listens from now on. A second signal ends the process at once, which record files survive.
    ///
    /// # Errors
    /// If the operating system refuses.
    #[cfg(unix)]
    pub(super) fn listen(quiet: bool) -> Result<Interrupt, Failure> {
        let interrupt = Interrupt::default();
        let heard = interrupt.clone();
        for signal in [SIGINT, SIGTERM] {
            // In the handler itself: the thread below may wait for a terminal that takes no more text.
            signal_hook::flag::register_conditional_shutdown(
                signal,
                SIGNALLED + signal,
                Arc::clone(&interrupt.raised),
            )
            .context("cannot listen for signals")?;
        }
        let mut signals =
            signal_hook::iterator::Signals::new([SIGINT, SIGTERM]).context("cannot listen for signals")?;
        std::thread::spawn(move || signals.forever().for_each(|signal| heard.hear(signal, quiet)));
        Ok(interrupt)
    }

    /// Listens from now on. A second signal ends the process at once, which record files survive.
    ///
    /// # Errors
    /// If the operating system refuses.
    #[cfg(not(unix))]
    pub(super) fn listen(quiet: bool) -> Result<Interrupt, Failure> {
        let interrupt = Interrupt::default();
        interrupt.signal.store(SIGINT, Ordering::Relaxed);
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register_conditional_shutdown(
                signal,
                SIGNALLED + signal,
                Arc::clone(&interrupt.raised),
            )
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&interrupt.raised)))
            .context("cannot listen for signals")?;
        }
        let heard = interrupt.clone();
        // Nobody wakes a thread there when a signal comes.
        std::thread::spawn(move || {
            while !heard.is_raised() {
                std::thread::sleep(HEARS_WITHIN);
            }
            heard.hear(SIGINT, quiet);
        });
        Ok(interrupt)
    }

    fn hear(&self, signal: i32, quiet: bool) {
        self.signal.store(signal, Ordering::Relaxed);
        self.raised.store(true, Ordering::Relaxed);
        self.end();
        if quiet {
            return;
        }
        let once = self
            .waits_for
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .map(|what| format!(" as soon as {what}"));
        say::note(format_args!("stopping{}; Ctrl-C again ends at once", once.unwrap_or_default()));
    }

    /// Says what a signal waits for from now on: nothing that takes long, or the end of `what`. False if one has
    /// come already.
    pub(super) fn wait_for(&self, what: Option<&'static str>) -> bool {
        *self.ending.lock().unwrap_or_else(PoisonError::into_inner) = None;
        *self.waits_for.lock().unwrap_or_else(PoisonError::into_inner) = what;
        !self.is_raised()
    }

    /// From now on a signal ends the process at once: `leave` undoes what nobody needs any more, and these words tell how
    /// to go on. For as long as nothing is computed that is not kept.
    pub(super) fn ends_at_once(&self, words: String, leave: impl FnOnce() + Send + 'static) {
        let ending = Ending { words, leave: Box::new(leave) };
        *self.ending.lock().unwrap_or_else(PoisonError::into_inner) = Some(ending);
        // A signal that came before found no words.
        if self.is_raised() {
            self.end();
        }
    }

    /// Ends the process, if it may end now.
    fn end(&self) {
        let ending = self.ending.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(Ending { words, leave }) = ending {
            leave();
            say::note(format_args!("error: interrupted; {words}"));
            // Nothing of libraries is torn down: their threads may be at work.
            low_level::exit(SIGNALLED + self.signal.load(Ordering::Relaxed));
        }
    }

    /// Whether a signal has come.
    pub(super) fn is_raised(&self) -> bool {
        self.raised.load(Ordering::Relaxed)
    }

    /// The flag that is raised.
    pub(super) fn raised(&self) -> &Arc<AtomicBool> {
        &self.raised
    }

    /// A run that it ended, in words.
    pub(super) fn failure(&self, words: anyhow::Error) -> Failure {
        Failure::Interrupted { signal: self.signal.load(Ordering::Relaxed), words }
    }
}
