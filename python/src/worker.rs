//! Runs computations on their own thread, while the interpreter's thread handles Ctrl-C and reports progress.

use std::panic::resume_unwind;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use rattlemap::job::observer::Observer;
use rattlemap::job::processor;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::problem::Problem;

/// Interval at which the waiting thread checks signals and progress.
pub(crate) const TICK: Duration = Duration::from_millis(50);

/// Longest interval between calls of `progress`: it may raise an exception to end the computation.
const CALL_INTERVAL: Duration = Duration::from_millis(500);

/// Time limit for a halted computation to end. Then it is abandoned, because a driver that compiles cannot be halted.
const GRACE: Duration = Duration::from_millis(700);

/// Connects a computation with the thread that waits for it.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    halt: Arc<AtomicBool>,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl Watch {
    /// The flag that is raised when the computation should end.
    pub(crate) fn halt(&self) -> &Arc<AtomicBool> {
        &self.halt
    }

    /// Whether the computation should end.
    pub(crate) fn is_halted(&self) -> bool {
        self.halt.load(Ordering::Relaxed)
    }

    /// Stores the progress.
    pub(crate) fn set_progress(&self, done: usize, total: usize) {
        self.total.store(total, Ordering::Relaxed);
        self.done.store(done, Ordering::Relaxed);
    }

    fn progress(&self) -> (usize, usize) {
        (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed))
    }
}

/// Collects notes and warnings, and passes progress on.
pub(crate) struct Collector {
    watch: Arc<Watch>,
    lines: Mutex<Vec<String>>,
}

impl Collector {
    pub(crate) fn new(watch: &Arc<Watch>) -> Collector {
        Collector { watch: Arc::clone(watch), lines: Mutex::default() }
    }

    /// Removes and returns the collected lines.
    pub(crate) fn lines(&self) -> Vec<String> {
        std::mem::take(&mut *self.lines.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Observer for Collector {
    fn note(&self, text: &str) {
        self.warn(text);
    }

    fn warn(&self, text: &str) {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner).push(text.to_owned());
    }

    fn progress(&self, done: usize, expected: usize) {
        self.watch.set_progress(done, expected);
    }
}

/// Number of abandoned computations of this process that are still running.
static ABANDONED: AtomicUsize = AtomicUsize::new(0);

/// Whether abandoned computations are running. They lock their folders until they end.
pub(crate) fn has_abandoned_work() -> bool {
    ABANDONED.load(Ordering::SeqCst) > 0
}

/// End of a computation. The computation drops one value at its end, and the waiting thread drops another if it abandons the
/// computation. The second drop reduces the count.
struct End(Arc<AtomicBool>);

impl Drop for End {
    fn drop(&mut self) {
        if self.0.swap(true, Ordering::SeqCst) {
            ABANDONED.fetch_sub(1, Ordering::SeqCst);
        }
    }
}

/// Id of the process that loaded the module.
static FIRST_PROCESS: OnceLock<u32> = OnceLock::new();

/// Stores the id of the process that loads the module.
pub(crate) fn store_process() {
    let _ = FIRST_PROCESS.set(process::id());
}

/// Returns a thread pool for a process that was forked after it had loaded the module, and none for other processes. A
/// forked process has none of the threads of rayon's global pool, and would wait for them forever.
fn own_threads() -> Result<Option<&'static ThreadPool>, Problem> {
    static OWN: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);
    let this = process::id();
    if FIRST_PROCESS.get() == Some(&this) {
        return processor::start_threads().map(|()| None).map_err(Problem::engine);
    }
    let mut own = OWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, pool)) = own.filter(|(process, _)| *process == this) {
        return Ok(Some(pool));
    }
    let pool = ThreadPoolBuilder::new().build();
    let pool = pool.map_err(|error| Problem::engine(format!("cannot start threads: {error}")))?;
    // The pool is never dropped: the threads of a parent process's pool do not exist here.
    let pool: &'static ThreadPool = Box::leak(Box::new(pool));
    *own = Some((this, pool));
    Ok(Some(pool))
}

/// Runs `work` without the interpreter's lock and returns its result. Calls `progress` several times a second with the number
/// of finished units and the total. `work` returns none if it was halted.
///
/// # Errors
/// KeyboardInterrupt within a second of the signal, any exception of a signal handler or of `progress`, and errors of `work`.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Arc<Watch>) -> Result<Option<T>, Problem> + Send + 'static,
) -> PyResult<T> {
    let threads = own_threads()?;
    let watch = Arc::new(Watch::default());
    let is_abandoned = Arc::new(AtomicBool::new(false));
    let (sender, mut receiver) = mpsc::channel();
    let worker = {
        let (watch, is_abandoned) = (Arc::clone(&watch), Arc::clone(&is_abandoned));
        thread::Builder::new().name("rattlemap".to_owned()).spawn(move || {
            let _end = End(is_abandoned);
            // An abandoned computation has no receiver.
            let _ = sender.send(match threads {
                Some(threads) => threads.install(|| work(&watch)),
                None => work(&watch),
            });
        })?
    };
    let (mut last, mut called) = ((0, 0), Instant::now());
    let mut stopped: Option<(PyErr, Instant)> = None;
    loop {
        let (back, received) = py.detach(move || {
            let received = receiver.recv_timeout(TICK);
            (receiver, received)
        });
        receiver = back;
        let is_end = !matches!(received, Err(RecvTimeoutError::Timeout));
        let now = watch.progress();
        let is_due = now != last || (now.1 > 0 && called.elapsed() >= CALL_INTERVAL);
        let progressed = match progress.filter(|_| is_due && stopped.is_none()) {
            Some(progress) => {
                called = Instant::now();
                progress.call1(now).map(|_| ())
            }
            None => Ok(()),
        };
        last = now;
        if let (None, Err(error)) = (&stopped, py.check_signals().and(progressed)) {
            watch.halt.store(true, Ordering::Relaxed);
            stopped = Some((error, Instant::now()));
        }
        match (received, stopped) {
            (Err(RecvTimeoutError::Disconnected), _) => {
                // The thread has sent its result, unless it panicked.
                let Err(panic) = worker.join() else { return Err(PyKeyboardInterrupt::new_err(())) };
                resume_unwind(panic)
            }
            (_, Some((error, _))) if is_end => return Err(error),
            (_, Some((error, since))) if since.elapsed() > GRACE => {
                ABANDONED.fetch_add(1, Ordering::SeqCst);
                drop(End(is_abandoned));
                return Err(error);
            }
            (Ok(Ok(Some(result))), None) => return Ok(result),
            (Ok(Ok(None)), None) => return Err(PyKeyboardInterrupt::new_err(())),
            (Ok(Err(problem)), None) => return Err(problem.into()),
            (_, still) => stopped = still,
        }
    }
}
