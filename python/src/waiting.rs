//! Computations on a thread of their own, while the interpreter's thread watches: for Ctrl-C, and to tell of progress.

use std::panic::resume_unwind;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::problem::Problem;

/// How soon a signal is heard.
pub(crate) const TICK: Duration = Duration::from_millis(50);

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

/// Computations of this process that did not end in time and were left to themselves.
static LEFT: AtomicUsize = AtomicUsize::new(0);

/// Whether there are any: they have their folders until they end.
pub(crate) fn is_anything_left() -> bool {
    LEFT.load(Ordering::SeqCst) > 0
}

/// Ends with a computation: whoever of it and of those who wait comes second takes it from the count.
struct Over(Arc<AtomicBool>);

impl Drop for Over {
    fn drop(&mut self) {
        if self.0.swap(true, Ordering::SeqCst) {
            LEFT.fetch_sub(1, Ordering::SeqCst);
        }
    }
}

/// The process that loaded the module.
static LOADED_BY: OnceLock<u32> = OnceLock::new();

/// Takes down which process loads the module.
pub(crate) fn loaded() {
    let _ = LOADED_BY.set(process::id());
}

/// Threads for a process that was forked from the one that loaded the module: a fork leaves those of rayon's own pool
/// behind, and whoever waits for them waits for ever. They are made once, and none for the process itself.
fn own_threads() -> Result<Option<&'static ThreadPool>, Problem> {
    static OWN: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);
    let this = process::id();
    if LOADED_BY.get() == Some(&this) {
        return Ok(None);
    }
    let mut own = OWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, pool)) = own.filter(|(process, _)| *process == this) {
        return Ok(Some(pool));
    }
    let pool = ThreadPoolBuilder::new().build();
    let pool = pool.map_err(|error| Problem::engine(format!("no threads to compute with: {error}")))?;
    // Kept for good: a pool of the process before has no threads that could end.
    let pool: &'static ThreadPool = Box::leak(Box::new(pool));
    *own = Some((this, pool));
    Ok(Some(pool))
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
    let threads = own_threads()?;
    let watch = Arc::new(Watch::default());
    let is_left = Arc::new(AtomicBool::new(false));
    let (sender, mut receiver) = mpsc::channel();
    let worker = {
        let (watch, is_left) = (Arc::clone(&watch), Arc::clone(&is_left));
        thread::Builder::new().name("rattlemap".to_owned()).spawn(move || {
            let _over = Over(is_left);
            // Nobody listens where it was left to itself.
            let _ = sender.send(match threads {
                Some(threads) => threads.install(|| work(&watch)),
                None => work(&watch),
            });
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
            (_, Some((error, _))) if is_over => return Err(error),
            (_, Some((error, since))) if since.elapsed() > ENDS_WITHIN => {
                LEFT.fetch_add(1, Ordering::SeqCst);
                drop(Over(is_left));
                return Err(error);
            }
            (Ok(Ok(Some(made))), None) => return Ok(made),
            (Ok(Ok(None)), None) => return Err(PyKeyboardInterrupt::new_err(())),
            (Ok(Err(problem)), None) => return Err(problem.into()),
            (_, still) => stopped = still,
        }
    }
}
