//! Computations on a thread of their own, while the interpreter's thread watches: for Ctrl-C, and to tell of progress.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::problem::Problem;

/// How soon a signal is heard.
const TICK: Duration = Duration::from_millis(50);

/// How soon `progress` is asked again where there is nothing new: it may want to end the computation.
const ASKS_AGAIN: Duration = Duration::from_millis(500);

/// How long a computation may take to end that was told to; then it is left to itself: a driver that compiles heeds nobody.
const ENDS_WITHIN: Duration = Duration::from_millis(700);

/// What a computation looks at and tells while it runs.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    halt: Arc<AtomicBool>,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl Watch {
    /// The flag that is raised once the computation is to end.
    pub(crate) fn halt(&self) -> &Arc<AtomicBool> {
        &self.halt
    }

    /// Whether it is to end.
    pub(crate) fn is_halted(&self) -> bool {
        self.halt.load(Ordering::Relaxed)
    }

    /// Tells how much is done, of how much.
    pub(crate) fn tell(&self, done: usize, total: usize) {
        self.total.store(total, Ordering::Relaxed);
        self.done.store(done, Ordering::Relaxed);
    }

    fn told(&self) -> (usize, usize) {
        (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed))
    }
}

/// Runs `work` without the interpreter's lock and returns what it comes to; `progress` is called with what is done and the
/// total, some times a second, with the same again where nothing is new. Work that was told to end gives nothing.
///
/// # Errors
/// KeyboardInterrupt within a second, whatever another signal's handler or `progress` raises, and the work's own.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<Option<T>, Problem> + Send + 'static,
) -> PyResult<T> {
    let watch = Arc::new(Watch::default());
    let (sender, mut receiver) = mpsc::channel();
    let worker = {
        let watch = Arc::clone(&watch);
        thread::Builder::new().name("rattlemap".to_owned()).spawn(move || {
            // Nobody listens where it was left to itself.
            let _ = sender.send(work(&watch));
        })?
    };
    let (mut told, mut asked) = ((0, 0), Instant::now());
    let mut stopped: Option<(PyErr, Instant)> = None;
    loop {
        let (back, received) = py.detach(move || {
            let received = receiver.recv_timeout(TICK);
            (receiver, received)
        });
        receiver = back;
        let is_over = !matches!(received, Err(RecvTimeoutError::Timeout));
        let now = watch.told();
        let is_due = now != told || (now.1 > 0 && asked.elapsed() >= ASKS_AGAIN);
        let progressed = match progress.filter(|_| is_due && stopped.is_none()) {
            Some(progress) => {
                asked = Instant::now();
                progress.call1(now).map(|_| ())
            }
            None => Ok(()),
        };
        told = now;
        if let (None, Err(error)) = (&stopped, py.check_signals().and(progressed)) {
            watch.halt.store(true, Ordering::Relaxed);
            stopped = Some((error, Instant::now()));
        }
        match (received, stopped) {
            (Err(RecvTimeoutError::Disconnected), _) => {
                // The thread sends whatever it comes to, unless it panics.
                let Err(panic) = worker.join() else { return Err(PyKeyboardInterrupt::new_err(())) };
                resume_unwind(panic)
            }
            (_, Some((error, since))) if is_over || since.elapsed() > ENDS_WITHIN => return Err(error),
            (Ok(Ok(Some(made))), None) => return Ok(made),
            (Ok(Ok(None)), None) => return Err(PyKeyboardInterrupt::new_err(())),
            (Ok(Err(problem)), None) => return Err(problem.into()),
            (_, still) => stopped = still,
        }
    }
}
