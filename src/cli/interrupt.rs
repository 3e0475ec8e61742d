//! Handles Ctrl-C and SIGTERM: the first signal asks the command to stop, the second one ends the process.

use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::low_level;

use crate::cli::failure::{Failure, SIGNALLED};
use crate::cli::say;

/// Polling interval of the signal's flag, on systems where a signal cannot wake a thread.
#[cfg(not(unix))]
const INTERVAL: std::time::Duration = std::time::Duration::from_millis(50);

/// Signals that the process has received.
#[derive(Clone, Default)]
pub(super) struct Interrupt {
    raised: Arc<AtomicBool>,
    signal: Arc<AtomicI32>,
    /// Event after which the command stops, if that may take a while. It completes the message `stopping as soon as ...`.
    waits_for: Arc<Mutex<Option<&'static str>>>,
    /// How the process ends. None unless it can end at once.
    ending: Arc<Mutex<Option<Ending>>>,
}

/// Message and clean-up of a process that ends at once.
struct Ending {
    /// What is stored, and how to continue.
    text: String,
    /// Removes what the command has created so far.
    clean_up: Box<dyn FnOnce() + Send>,
}

impl Interrupt {
    /// Listens to signals from now on. A second signal ends the process at once; record files stay readable. A process that listens already
    /// goes on with what it has received.
    ///
    /// # Errors
    /// If the operating system refuses.
    pub(super) fn listen(quiet: bool) -> Result<Interrupt, Failure> {
        static LISTENING: OnceLock<Interrupt> = OnceLock::new();
        if let Some(listening) = LISTENING.get() {
            listening.wait_for(None);
            return Ok(listening.clone());
        }
        let interrupt = LISTENING.get_or_init(Interrupt::default).clone();
        for signal in [SIGINT, SIGTERM] {
            // The handler itself ends the process: the thread below may be blocked by a terminal that accepts no text.
            let raised = Arc::clone(&interrupt.raised);
            signal_hook::flag::register_conditional_shutdown(signal, SIGNALLED + signal, raised)
                .context("cannot listen for signals")?;
        }
        interrupt.clone().wait_in_thread(quiet).context("cannot listen for signals")?;
        Ok(interrupt)
    }

    #[cfg(unix)]
    fn wait_in_thread(self, quiet: bool) -> std::io::Result<()> {
        let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
        let listener = move || signals.forever().for_each(|signal| self.receive(signal, quiet));
        std::thread::Builder::new().spawn(listener).map(drop)
    }

    #[cfg(not(unix))]
    fn wait_in_thread(self, quiet: bool) -> std::io::Result<()> {
        // The handlers only set the flag; a command that sees it first must still know a signal.
        self.signal.store(SIGINT, Ordering::Relaxed);
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&self.raised))?;
        }
        let listener = move || {
            while !self.is_raised() {
                std::thread::sleep(INTERVAL);
            }
            self.receive(SIGINT, quiet);
        };
        std::thread::Builder::new().spawn(listener).map(drop)
    }

    fn receive(&self, signal: i32, quiet: bool) {
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

    /// Lets a signal stop the command, after the event `what` if it is given. Returns false if a signal has already
    /// arrived.
    pub(super) fn wait_for(&self, what: Option<&'static str>) -> bool {
        *self.ending.lock().unwrap_or_else(PoisonError::into_inner) = None;
        *self.waits_for.lock().unwrap_or_else(PoisonError::into_inner) = what;
        !self.is_raised()
    }

    /// Lets a signal end the process at once, after `clean_up`. The text says what is stored and how to continue. Call it
    /// only while all computed results are stored.
    pub(super) fn ends_at_once(&self, text: String, clean_up: impl FnOnce() + Send + 'static) {
        let ending = Ending { text, clean_up: Box::new(clean_up) };
        *self.ending.lock().unwrap_or_else(PoisonError::into_inner) = Some(ending);
        // A signal that arrived earlier could not end the process.
        if self.is_raised() {
            self.end();
        }
    }

    /// Ends the process if it can end at once.
    fn end(&self) {
        let ending = self.ending.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(Ending { text, clean_up }) = ending {
            clean_up();
            say::note(format_args!("error: interrupted; {text}"));
            // Skips exit handlers, because threads of libraries may still be running.
            low_level::exit(SIGNALLED + self.signal.load(Ordering::Relaxed));
        }
    }

    /// Whether a signal has arrived.
    pub(super) fn is_raised(&self) -> bool {
        self.raised.load(Ordering::Relaxed)
    }

    /// The flag that a signal raises.
    pub(super) fn raised(&self) -> &Arc<AtomicBool> {
        &self.raised
    }

    /// Returns the error of a command that a signal stopped.
    pub(super) fn failure(&self, text: String) -> Failure {
        Failure::Interrupted { signal: self.signal.load(Ordering::Relaxed), text }
    }
}
