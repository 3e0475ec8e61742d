//! Lanes on a graphics device, as an engine.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::panic;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rayon::prelude::*;
use web_time::Instant;

use super::finish::{Completion, Ended, Finishing, is_unfinished};
use super::{EngineError, Preparation, Properties, drop_unrequested};
use crate::gpu::{
    self, AdapterId, Constants, Features, GpuError, Lane, LaneResult, LaneSettings, Measures, Pool, Tables,
    Traffic,
};
use crate::map::plan::{Cell, Plan};
use crate::map::scene::{Quantity, Steps};
use crate::record::Record;
use rattlemap_dynamics::model::{Form, Pair, Side};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Budget, Settings, measure};

/// Smallest batch on a hardware device: enough to keep it busy.
const LEAST_ON_HARDWARE: usize = 1 << 16;
/// Smallest batch on a software device: about a second of work.
const LEAST_IN_SOFTWARE: usize = 256;

/// Largest number of cells with distinct flows per batch on a software device: some seconds of work.
const FLOWS_IN_SOFTWARE: usize = 8_192;

/// Cells of a trial that are neighbours, and forcing periods of each.
const TRIAL_BLOCK: usize = 64;
const TRIAL_PERIODS: u32 = 32;

/// The engine of a plan's lanes on one device, in one precision.
pub struct Gpu<'p> {
    plan: Cow<'p, Plan>,
    device: gpu::Gpu,
    settings: LaneSettings,
    /// All flows and laws; none if they are too many to be stored.
    tables: Option<Tables>,
    /// Number of free steps so far.
    steps: u64,
    /// Least and most free steps per forcing period, over all flows that lanes can carry.
    steps_per_period: Option<[u32; 2]>,
    /// Cells under way, if all tables are stored.
    pool: Option<Pool>,
    /// Cells under way, if tables are loaded for each batch.
    waiting: Vec<Cell>,
    /// The next such batch, while its constants are derived.
    next: Option<Chunk>,
    /// Largest number of cells of such a batch.
    most_waiting: usize,
    /// Memory for the constants of such a batch, used again: touching fresh memory takes more than half of the time of
    /// deriving them.
    constants: Vec<Option<Constants>>,
    /// Cells that the reference finishes beside the lanes.
    finishing: Finishing,
    preparation: Preparation,
}

/// What lanes need to know of a plan. It can be derived while a device opens.
pub struct Prepared<'p> {
    plan: Cow<'p, Plan>,
    /// Constants by flow. None if the flows are too many to be stored.
    constants: Option<Vec<Option<Constants>>>,
    survey: Survey,
    /// Time that it took.
    took: Duration,
}

impl<'p> Prepared<'p> {
    /// Derives the constants of a plan.
    pub fn new(plan: &'p Plan) -> Prepared<'p> {
        let clock = Instant::now();
        // Each oscillator is derived once: if the flows are stored, together with its constants.
        let (constants, survey) = if plan.stores_flows() {
            let derived = survey_flows(plan, |form: &Form, steps| Constants::new(form, steps));
            let (constants, surveys): (Vec<_>, Vec<_>) = derived.unzip();
            (Some(constants), surveys.into_iter().fold(Survey::default(), Survey::and))
        } else {
            (None, survey(plan))
        };
        Prepared { plan: Cow::Borrowed(plan), constants, survey, took: clock.elapsed() }
    }

    /// Copies the plan, for a device that moves to another thread.
    pub fn into_owned(self) -> Prepared<'static> {
        Prepared { plan: Cow::Owned(self.plan.into_owned()), ..self }
    }
}

impl<'p> Gpu<'p> {
    /// Builds an engine for the cells of a plan on an open device.
    ///
    /// # Errors
    /// [`EngineError`] if the device cannot store the constants.
    pub async fn new(plan: &'p Plan, device: gpu::Gpu) -> Result<Gpu<'p>, EngineError> {
        Gpu::prepared(Prepared::new(plan), device).await
    }

    /// Builds an engine from what has been derived of a plan.
    ///
    /// # Errors
    /// As for [`Gpu::new`].
    pub async fn prepared(prepared: Prepared<'p>, device: gpu::Gpu) -> Result<Gpu<'p>, EngineError> {
        let mut clock = Instant::now();
        let Prepared { plan, constants, survey, took } = prepared;
        if let Some(feature) = survey.features.needing_reference() {
            return Err(EngineError::NotOnLanes { feature });
        }
        let hands_over = Completion::hands_over(plan.budget());
        let settings = LaneSettings { hands_over, ..settings_after(&plan, &survey) };
        let completion = Completion::of(&plan, plan.budget().early_stop, &Arc::default());
        let mut engine = Gpu {
            plan,
            device,
            settings,
            tables: None,
            steps: 0,
            steps_per_period: survey.steps,
            pool: None,
            waiting: Vec::new(),
            next: None,
            most_waiting: gpu::MOST_FLOWS,
            constants: Vec::new(),
            finishing: Finishing::new(completion),
            preparation: Preparation::default(),
        };
        if !engine.is_hardware() {
            engine.most_waiting = FLOWS_IN_SOFTWARE;
        }
        if let Some(constants) = constants {
            let laws: Vec<u32> = (0..engine.plan.law_count() as u32).collect();
            engine.tables = match engine.load(constants, &laws).await {
                // The tables of single batches may fit.
                Err(GpuError::TooManyFlows { .. } | GpuError::OutOfMemory { .. }) => None,
                other => Some(other.map_err(|error| engine.error(error, engine.plan.cell_count()))?),
            };
        }
        engine.preparation.flows = took + clock.elapsed();
        clock = Instant::now();
        // The shader is compiled now, so that the first batch does not wait for it.
        let pool = engine.device.pool(&settings).await.map_err(|error| engine.error(error, 0))?;
        engine.pool = engine.plan.stores_flows().then_some(pool);
        engine.preparation.compile = clock.elapsed();
        Ok(engine)
    }

    /// Returns the work that the device has received since it was opened.
    pub fn traffic(&self) -> Traffic {
        self.device.traffic()
    }

    /// Measures how many times as fast as the reference the lanes integrate some cells of the plan. Their results are thrown away.
    ///
    /// # Errors
    /// [`EngineError`] if the device fails.
    pub async fn speed(&mut self) -> Result<f64, EngineError> {
        let runs = self.plan.run_count();
        let cells_of = |count: usize| -> Vec<Cell> {
            // Neighbours share flows, so blocks of them are spread over the map.
            let blocks = count.div_ceil(TRIAL_BLOCK);
            let begins = (0..blocks).map(|nth| runs / blocks * nth);
            begins.flat_map(|at| self.plan.cells(at..(at + TRIAL_BLOCK).min(runs))).collect()
        };
        let settings = LaneSettings {
            periods: TRIAL_PERIODS,
            transient_periods: 0,
            early_stop: false,
            hands_over: false,
            confirm_chaos: 0,
            measures: None,
            multiplier: false,
            ..self.settings
        };
        let few = cells_of(TRIAL_BLOCK * rayon::current_num_threads());
        let most = if self.tables.is_some() { LEAST_ON_HARDWARE } else { gpu::MOST_FLOWS };
        let (flows, laws, lanes) = renumbered(&cells_of(most.min(runs)));
        let constants =
            flows.par_iter().map(|&flow| Constants::new(self.plan.form(flow), settings.steps_per_period));
        let tables = self.load(constants.collect(), &laws).await.map_err(|error| self.error(error, runs))?;
        let mut clock = Instant::now();
        for _ in 0..2 {
            // The first run makes buffers.
            clock = Instant::now();
            let ran = self.device.run_on(&tables, &lanes, &settings).await;
            ran.map_err(|error| self.error(error, lanes.len()))?;
        }
        let of_lanes = lanes.len() as f64 / clock.elapsed().as_secs_f64();
        clock = Instant::now();
        let lengths =
            Settings { transient_periods: 0, observed_periods: TRIAL_PERIODS, ..self.plan.budget().settings };
        let budget = Budget {
            settings: lengths,
            early_stop: false,
            confirm_chaos: 0,
            quantities: false,
            ..*self.plan.budget()
        };
        few.par_iter().with_max_len(1).for_each(|cell| {
            measure(&Flow::new(self.plan.form(cell.flow)), self.plan.law(cell.law), cell.start, &budget);
        });
        let of_reference = few.len() as f64 / clock.elapsed().as_secs_f64();
        Ok(of_lanes / of_reference)
    }

    /// Returns the device for another plan.
    pub fn into_device(self) -> gpu::Gpu {
        self.device
    }

    fn is_hardware(&self) -> bool {
        gpu::is_hardware(self.device.adapter())
    }

    pub(super) async fn begin(&mut self, cells: &[Cell]) -> Result<(), EngineError> {
        let (Some(tables), Some(pool)) = (&self.tables, &mut self.pool) else {
            self.waiting.extend(cells);
            return Ok(());
        };
        let count = pool.under_way() + cells.len();
        let lanes: Vec<_> = cells.iter().map(|cell| (cell.id, lane(cell, cell.flow, cell.law))).collect();
        pool.begin(&self.device, tables, &lanes).await.map_err(|error| self.error(error, count))
    }

    pub(super) async fn advance(&mut self, until: usize) -> Result<Vec<(u32, Record)>, EngineError> {
        loop {
            let lanes = self.pool.as_ref().map_or(0, Pool::under_way) + self.waiting.len();
            let is_on_device = lanes > 0 || self.next.is_some();
            let mut ended = Vec::new();
            if is_on_device {
                ended = self.advance_lanes(until.saturating_sub(self.finishing.pending())).await?;
            }
            ended.extend(self.finishing.take(!is_on_device));
            let is_over = !is_on_device && self.finishing.pending() == 0;
            if !ended.is_empty() || is_over || self.device.is_halted() {
                return Ok(ended);
            }
        }
    }

    /// Returns the records of lanes that have ended, and lets the reference finish some.
    async fn advance_lanes(&mut self, until: usize) -> Result<Vec<(u32, Record)>, EngineError> {
        let ended = match (&self.tables, &mut self.pool) {
            (Some(tables), Some(pool)) => match pool.advance(&self.device, tables, until).await {
                Ok(ended) => {
                    let constants = tables.constants();
                    let record = |ended: &LaneResult| (ended.number(), ended.record(constants));
                    let records: Vec<_> = ended.par_iter().map(record).collect();
                    let steps = ended.iter().map(|ended| tables.steps_per_period(ended.flow()));
                    self.steps += steps_of(records.iter().map(|(_, record)| record).zip(steps));
                    Ok(records)
                }
                Err(error) => {
                    pool.clear();
                    Err(error)
                }
            },
            _ => self.run_waiting().await,
        };
        let ended = ended.map_err(|error| {
            self.finishing.discard();
            self.error(error, self.waiting.len())
        })?;
        let needs = self.plan.needs();
        let is_measured_here = self.settings.features.machine.is_some() && needs.measures_motion();
        let (unfinished, mut ended): (Vec<_>, Vec<_>) =
            ended.into_iter().partition(|(_, record)| is_measured_here || is_unfinished(record));
        ended.par_iter_mut().for_each(|(_, record)| drop_unrequested(record, needs));
        for (id, record) in unfinished {
            let (flow, law) = self.plan.parts(id);
            let (form, law) = (self.plan.form(flow), self.plan.law(law));
            self.finishing.begin(id, Ended { record, form, law });
        }
        Ok(ended)
    }

    /// Computes some of the waiting cells with tables of their own; fewer if they do not fit into the memory. Meanwhile
    /// the processor derives the constants of the next ones.
    async fn run_waiting(&mut self) -> Result<Vec<(u32, Record)>, GpuError> {
        while let Some(chunk) = self.next.take().or_else(|| self.chunk()) {
            let Chunk { cells, laws, lanes, constants } = chunk;
            let constants = constants.take();
            self.next = self.chunk();
            let error = match self.run_lanes(constants, &laws, &lanes).await {
                Ok(records) => return Ok(cells.iter().rev().map(|cell| cell.id).zip(records).collect()),
                Err(error) => error,
            };
            self.waiting.extend(self.next.take().into_iter().flat_map(|chunk| chunk.cells));
            self.waiting.extend(&cells);
            match error {
                GpuError::TooManyFlows { .. } | GpuError::OutOfMemory { .. } if cells.len() > 1 => {
                    self.most_waiting = cells.len() / 2;
                }
                GpuError::Halted => return Ok(Vec::new()),
                error => return Err(error),
            }
        }
        Ok(Vec::new())
    }

    /// Takes the last cells from those that wait, as many as have tables that fit into the memory.
    fn chunk(&mut self) -> Option<Chunk> {
        let steps = self.settings.steps_per_period;
        let candidates = &self.waiting[self.waiting.len().saturating_sub(self.most_waiting)..];
        let (flows, laws, mut lanes) = renumbered(candidates);
        let plan: &Plan = &self.plan;
        let mut forms: Vec<_> = flows.into_par_iter().map(|flow| plan.form(flow)).collect();
        let mut known = HashSet::new();
        let bytes = |lane: &Lane| {
            let form = &forms[lane.flow as usize];
            let steps = Constants::steps(form, steps);
            let [flow, phasors] = gpu::table_bytes(form, steps);
            if known.insert(steps) { flow + phasors } else { flow }
        };
        lanes.truncate(fitting(lanes.iter().map(bytes), self.most_waiting));
        forms.truncate(lanes.iter().map(|lane| lane.flow as usize + 1).max()?);
        let cells = self.waiting.split_off(self.waiting.len() - lanes.len());
        let mut memory = std::mem::take(&mut self.constants);
        let constants = Task::new(move || {
            forms.par_iter().map(|flow| Constants::new(flow, steps)).collect_into_vec(&mut memory);
            memory
        });
        Some(Chunk { cells, laws, lanes, constants })
    }

    /// Runs lanes with tables of their own.
    async fn run_lanes(
        &mut self,
        constants: Vec<Option<Constants>>,
        laws: &[u32],
        lanes: &[Lane],
    ) -> Result<Vec<Record>, GpuError> {
        let tables = self.load(constants, laws).await?;
        let records = self.device.run_on(&tables, lanes, &self.settings).await?;
        let steps = lanes.iter().map(|lane| tables.steps_per_period(lane.flow));
        self.steps += steps_of(records.iter().zip(steps));
        self.constants = tables.into_constants();
        Ok(records)
    }

    async fn load(&self, constants: Vec<Option<Constants>>, laws: &[u32]) -> Result<Tables, GpuError> {
        let laws: Vec<_> = laws.iter().map(|&law| self.plan.law(law)).collect();
        let mut constants = constants;
        constants.iter_mut().flatten().for_each(|constants| constants.widen(self.settings.features));
        self.device.load_constants(constants, &laws).await
    }

    fn error(&self, error: GpuError, cells: usize) -> EngineError {
        let device = self.device();
        match error {
            GpuError::OutOfMemory { .. } | GpuError::TooManyFlows { .. } => {
                EngineError::OutOfMemory { device, cells }
            }
            GpuError::Lost { message } => EngineError::Lost { device, reason: message },
            other => EngineError::Refused { device, reason: other.to_string() },
        }
    }
}

impl Properties for Gpu<'_> {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn stop_on(&mut self, halt: &Arc<AtomicBool>) {
        self.finishing.stop_on(halt);
        self.device.stop_on(halt);
    }

    fn precision(&self) -> &'static str {
        self.device.precision().name()
    }

    fn device(&self) -> String {
        gpu::describe(self.device.adapter())
    }

    fn adapter(&self) -> Option<AdapterId> {
        Some(self.device.id())
    }

    fn least_batch(&self) -> usize {
        if self.is_hardware() { LEAST_ON_HARDWARE } else { LEAST_IN_SOFTWARE }
    }

    fn device_bytes(&self) -> Option<u64> {
        let constants = self.tables.as_ref().map_or(gpu::MOST_BYTES, Tables::bytes);
        Some(self.device.bytes_of_lanes(self.plan.run_count(), &self.settings) + constants)
    }

    fn lane_steps(&self) -> Option<u64> {
        Some(self.steps)
    }

    fn steps_per_period(&self) -> Option<[u32; 2]> {
        self.steps_per_period
    }

    fn preparation(&self) -> Preparation {
        self.preparation
    }

    fn room(&self) -> usize {
        self.tables.as_ref().and(self.pool.as_ref()).map_or(usize::MAX, Pool::room)
    }
}

/// Cells with tables of their own.
struct Chunk {
    cells: Vec<Cell>,
    laws: Vec<u32>,
    /// Lanes of the cells, the last one first.
    lanes: Vec<Lane>,
    constants: Task<Vec<Option<Constants>>>,
}

/// Work of another thread beside the device.
enum Task<T> {
    Thread(JoinHandle<T>),
    Done(T),
}

impl<T: Send + 'static> Task<T> {
    /// Starts a thread. Where none can be started, as in a browser, the work is done at once.
    fn new(work: impl FnOnce() -> T + Send + 'static) -> Task<T> {
        fn run<T>(work: &Mutex<Option<impl FnOnce() -> T>>) -> T {
            let work = work.lock().unwrap_or_else(PoisonError::into_inner).take();
            work.map(|work| work()).expect("the work is done once")
        }
        let work = Arc::new(Mutex::new(Some(work)));
        // A worker of the pool that waited for the thread might be the one that the thread waits for.
        if rayon::current_thread_index().is_some() {
            return Task::Done(run(&work));
        }
        let own = Arc::clone(&work);
        thread::Builder::new().spawn(move || run(&own)).map_or_else(|_| Task::Done(run(&work)), Task::Thread)
    }

    /// Waits for the result.
    fn take(self) -> T {
        match self {
            Task::Thread(thread) => thread.join().unwrap_or_else(|panic| panic::resume_unwind(panic)),
            Task::Done(result) => result,
        }
    }
}

/// Returns the number of free steps of lanes, given their records and steps per period.
fn steps_of<'r>(lanes: impl Iterator<Item = (&'r Record, u32)>) -> u64 {
    lanes.map(|(record, steps)| u64::from(record.periods_run) * u64::from(steps)).sum()
}

/// Returns how many tables of these sizes fit into [`gpu::MOST_BYTES`], between 1 and `most`.
fn fitting(bytes: impl Iterator<Item = u64>, most: usize) -> usize {
    let total = bytes.take(most).scan(0, |total, bytes| {
        *total += bytes;
        Some(*total)
    });
    total.take_while(|&total| total <= gpu::MOST_BYTES).count().max(1)
}

/// Returns the flows and laws of some cells, and their lanes with indices into these lists, the last lane first.
pub(crate) fn renumbered(cells: &[Cell]) -> (Vec<u32>, Vec<u32>, Vec<Lane>) {
    let (mut flows, mut laws) = (Numbering::default(), Numbering::default());
    let lanes =
        cells.iter().rev().map(|cell| lane(cell, flows.place(cell.flow), laws.place(cell.law))).collect();
    (flows.list, laws.list, lanes)
}

fn lane(cell: &Cell, flow: u32, law: u32) -> Lane {
    Lane { flow, law, start: cell.start }
}

/// Numbers things in the order of their first occurrence.
#[derive(Default)]
struct Numbering {
    list: Vec<u32>,
    places: HashMap<u32, u32>,
}

impl Numbering {
    fn place(&mut self, number: u32) -> u32 {
        *self.places.entry(number).or_insert_with(|| {
            self.list.push(number);
            self.list.len() as u32 - 1
        })
    }
}

/// Returns the settings of a plan's lanes.
pub(crate) fn lane_settings(plan: &Plan) -> LaneSettings {
    settings_after(plan, &survey(plan))
}

fn settings_after(plan: &Plan, survey: &Survey) -> LaneSettings {
    let budget = plan.budget();
    let default = LaneSettings::within(budget);
    LaneSettings {
        word: plan.needs().word,
        pattern: plan.needs().pattern,
        mesh: plan.needs().mesh,
        symmetry: plan.needs().symmetric,
        multiplier: plan.needs().has_any(&[Quantity::Multiplier]),
        measures: measures(plan),
        chatter: survey.chatter,
        features: survey.features,
        most_events: budget.allowance().events.min(u64::from(default.most_events)) as u32,
        steps_per_period: requested_steps(plan),
        ..default
    }
}

/// Returns what lanes measure for the requested quantities.
fn measures(plan: &Plan) -> Option<Measures> {
    let has_any = |quantities: &[Quantity]| plan.needs().has_any(quantities);
    plan.needs().measures_motion().then(|| Measures {
        periods: plan.budget().settings.observed_periods,
        extremes: has_any(&[Quantity::Amplitude, Quantity::ContactForceMax]),
        moments: has_any(&[
            Quantity::Amplitude,
            Quantity::Rms,
            Quantity::Harmonic,
            Quantity::Dissipated,
            Quantity::ContactForceMax,
            Quantity::ContactForceRms,
        ]),
    })
}

fn requested_steps(plan: &Plan) -> Option<u32> {
    match plan.steps_per_period() {
        Steps::Auto => None,
        Steps::PerPeriod(steps) => Some(steps),
    }
}

/// Properties of flows that decide which shaders a plan needs.
#[derive(Clone, Copy, Default)]
struct Survey {
    /// Whether any cell may follow chatter by short flights.
    chatter: bool,
    /// Features of all flows.
    features: Features,
    /// Least and most free steps per forcing period, of flows that lanes can carry.
    steps: Option<[u32; 2]>,
}

impl Survey {
    /// Returns the properties of both.
    fn and(self, other: Survey) -> Survey {
        let steps = self.steps.into_iter().chain(other.steps);
        Survey {
            chatter: self.chatter || other.chatter,
            features: self.features.and(other.features),
            steps: steps.reduce(|[least, most], [low, high]| [least.min(low), most.max(high)]),
        }
    }
}

fn survey(plan: &Plan) -> Survey {
    survey_flows(plan, |_, _| ()).map(|((), survey)| survey).reduce(Survey::default, Survey::and)
}

/// Derives each oscillator of a plan, and returns the result of `of` with its survey. `of` also gets the requested
/// free steps per forcing period.
fn survey_flows<T: Send>(
    plan: &Plan,
    of: impl Fn(&Form, Option<u32>) -> T + Sync + Send,
) -> impl IndexedParallelIterator<Item = (T, Survey)> {
    let laws = (0..plan.law_count() as u32).map(|law| plan.law(law).mesh_speed);
    let least =
        laws.fold([f64::INFINITY; 2], |least, speeds| [0, 1].map(|side| speeds[side].min(least[side])));
    let steps = requested_steps(plan);
    (0..plan.flow_count() as u32).into_par_iter().map(move |flow| {
        let form = plan.form(flow);
        let follows_chatter = |pair: &Pair, side: Side| {
            let bounces = pair.walls[side.index()].is_finite() && !pair.contacts[side.index()].is_elastic();
            bounces && gpu::follows_chatter(pair, least[side.index()])
        };
        let chatter = match &form {
            Form::Pair(pair) => Side::BOTH.into_iter().any(|side| follows_chatter(pair, side)),
            Form::Machine(_) => false,
        };
        let steps_used = Constants::steps(&form, steps).map(|n| [n; 2]);
        let survey = Survey { chatter, features: Features::of(&form), steps: steps_used };
        (of(&form, steps), survey)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_fit_the_memory() {
        let third = gpu::MOST_BYTES / 3;
        assert_eq!(fitting([third; 10].into_iter(), 8), 3);
        assert_eq!(fitting([1; 10].into_iter(), 8), 8);
        assert_eq!(fitting([1; 10].into_iter(), 80), 10);
        assert_eq!(fitting([4 * third; 2].into_iter(), 8), 1);
    }
}
