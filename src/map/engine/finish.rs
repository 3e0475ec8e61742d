//! Completes the records of lanes on the processor, with the reference.
//!
//! The reference continues two kinds of lanes, each from its own last state. If a lane has an event at phase 0, the reference compares its
//! states at another phase. If a lane is still undecided after the transient and the observed periods, the reference runs the further
//! periods: such lanes are few and take long, and a core of the processor is faster than one lane. The reference also measures the motions
//! of machines, because lanes of machines measure nothing.

use std::panic::{self, AssertUnwindSafe};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use super::{drop_unrequested, measured_record};
use crate::map::plan::{Needs, Plan};
use crate::record::classify::{mark_tied, status};
use crate::record::{Record, valid};
use rattlemap_dynamics::model::{Form, Law};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Budget, Status, measure_at_section, measure_until, quantities_after};

/// A lane that has ended, with its oscillator and law.
pub(crate) struct Ended {
    pub(crate) record: Record,
    pub(crate) form: Form,
    pub(crate) law: Law,
}

/// Completes the records of a plan's lanes.
#[derive(Clone, Debug)]
pub(crate) struct Completion {
    needs: Needs,
    /// The budget of the lanes.
    budget: Budget,
    /// While this flag is raised, no record is completed.
    halt: Arc<AtomicBool>,
}

impl Completion {
    /// Completes the records of lanes of this plan with or without early stops.
    pub(crate) fn of(plan: &Plan, early_stop: bool, halt: &Arc<AtomicBool>) -> Completion {
        let budget = Budget { early_stop, ..*plan.budget() };
        Completion { needs: *plan.needs(), budget, halt: Arc::clone(halt) }
    }

    /// Whether lanes end after the transient and the observed periods, and the reference continues those that are undecided. A shorter
    /// continuation would decide by less than the lane knows, so lanes run it themselves.
    pub(crate) fn hands_over(budget: &Budget) -> bool {
        budget.early_stop && budget.undecided_periods >= budget.periods()
    }

    /// Returns the completed record; none if the flag was raised.
    pub(crate) fn completed(&self, ended: Ended) -> Option<Record> {
        let Ended { mut record, form, law } = ended;
        let is_handed_over = record.valid & valid::OPEN != 0;
        let is_measured_here = is_handed_over || matches!(form, Form::Machine(_));
        if is_unfinished(&record) || is_measured_here && self.needs.measures_motion() {
            let flow = Flow::new(&form);
            self.finish(&mut record, &flow, law);
            let is_from_lane = record.valid & valid::BY_REFERENCE == 0 && !status(&record).is_failure();
            if is_measured_here && is_from_lane && self.needs.measures_motion() {
                let periods = [record.period, self.budget.settings.observed_periods];
                let allowance = self.budget.allowance().until(&self.halt);
                let quantities = record
                    .state()
                    .and_then(|strobe| quantities_after(&flow, law, strobe, periods, allowance));
                record.set_quantities(quantities.as_ref());
            }
        }
        drop_unrequested(&mut record, &self.needs);
        (!self.halt.load(Ordering::Relaxed)).then_some(record)
    }

    fn finish(&self, record: &mut Record, flow: &Flow, law: Law) {
        let (strobe, bits, periods_run) = (record.strobe(), record.valid, record.periods_run);
        record.valid &= !(valid::OPEN | valid::NEAR_STROBE | valid::TIED);
        let second = if bits & valid::OPEN != 0 {
            let rest = self.budget.after(periods_run);
            let measured = measure_until(flow, law, flow.in_front(strobe), &rest, &self.halt);
            // If the continuation fails, the rounding of the lane's state is the cause.
            measured
                .map(|measured| measured_record(&measured, &self.needs))
                .filter(|second| !status(second).is_failure())
                .map(|second| Record { periods_run: periods_run + second.periods_run, ..second })
        } else if is_on_strobe(record) || bits & valid::NEAR_STROBE != 0 {
            let allowance = self.budget.allowance().until(&self.halt);
            let period = Some(record.period).filter(|&period| period > 0);
            measure_at_section(flow, law, strobe, period, &self.budget, allowance)
                .map(|measured| measured_record(&measured, &self.needs))
                .filter(|second| replaces(second, record))
                .map(|second| Record { periods_run, ..second })
        } else {
            None
        };
        if let Some(second) = second {
            *record = Record { valid: second.valid | valid::BY_REFERENCE, ..second };
            if bits & valid::TIED != 0 {
                mark_tied(record);
            }
        }
    }
}

/// Whether the reference must finish the record of a lane.
pub(crate) fn is_unfinished(record: &Record) -> bool {
    is_on_strobe(record) || record.valid & (valid::OPEN | valid::NEAR_STROBE) != 0
}

fn is_on_strobe(record: &Record) -> bool {
    status(record) == Status::StrobeOnEvent && record.period > 0
}

/// Whether a second record with a cycle replaces the first. A first one that only has `NEAR_STROBE` may be right.
fn replaces(second: &Record, first: &Record) -> bool {
    let is_shorter = first.period > second.period && first.period.is_multiple_of(second.period);
    first.period == 0 || is_shorter || status(first) == Status::StrobeOnEvent
}

/// Number of a cell and its record; none if the halt flag was raised. An error is a panic.
type Completed = thread::Result<(u32, Option<Record>)>;

/// Cells whose records are completed beside the lanes.
pub(crate) struct Finishing {
    completion: Completion,
    /// Threads that only complete records. The host's work for the device would wait behind them on threads that it shares. None where
    /// threads cannot be started, as in a browser.
    threads: Option<rayon::ThreadPool>,
    to: Sender<Completed>,
    from: Receiver<Completed>,
    /// Number of cells whose records have not been taken.
    pending: usize,
}

impl Finishing {
    pub(crate) fn new(completion: Completion) -> Finishing {
        let (to, from) = channel();
        Finishing { completion, threads: None, to, from, pending: 0 }
    }

    /// Sets the flag that stops the completion of further cells.
    pub(crate) fn stop_on(&mut self, halt: &Arc<AtomicBool>) {
        self.completion.halt = Arc::clone(halt);
    }

    /// Forgets all cells.
    pub(crate) fn discard(&mut self) {
        *self = Finishing::new(self.completion.clone());
    }

    /// Returns the number of cells whose records have not been taken.
    pub(crate) fn pending(&self) -> usize {
        self.pending
    }

    /// Begins to complete the record of a cell.
    pub(crate) fn begin(&mut self, id: u32, ended: Ended) {
        if self.pending == 0 && self.threads.is_none() && !cfg!(target_arch = "wasm32") {
            self.threads = rayon::ThreadPoolBuilder::new().build().ok();
        }
        self.pending += 1;
        let (completion, to) = (self.completion.clone(), self.to.clone());
        let complete = move || {
            let completed = panic::catch_unwind(AssertUnwindSafe(|| completion.completed(ended)));
            // Nobody listens any more if the engine was dropped.
            let _ = to.send(completed.map(|record| (id, record)));
        };
        match &self.threads {
            Some(threads) => threads.spawn_fifo(complete),
            None => complete(),
        }
    }

    /// Returns the completed records. Waits for at least one if `waits`, or for all if the halt flag is raised.
    pub(crate) fn take(&mut self, waits: bool) -> Vec<(u32, Record)> {
        let mut taken = Vec::new();
        while self.pending > 0 {
            let must_wait = waits && taken.is_empty() || self.completion.halt.load(Ordering::Relaxed);
            let next = if must_wait { self.from.recv().ok() } else { self.from.try_recv().ok() };
            let Some(completed) = next else { break };
            self.pending -= 1;
            let (id, record) = completed.unwrap_or_else(|panic| panic::resume_unwind(panic));
            taken.extend(record.map(|record| (id, record)));
        }
        taken
    }
}
