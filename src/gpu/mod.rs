//! The GPU engine: runs WGSL lanes on a graphics adapter.
//!
//! [`Gpu::open`] opens an adapter for one precision. [`Gpu::run`] integrates lanes and returns one [`Record`] per lane. It keeps up
//! to 65,536 lanes under way, in short dispatches; the lanes' state stays on the device. In a [`Pool`], lanes can begin
//! and end at any time. The engine uses no files. It uses several threads only to compile shaders.
//!
//! Lanes are independent of [`rattlemap_dynamics::motion`]: they use only the description of the model ([`rattlemap_dynamics::model`]). A
//! lane moves from event to event on a fixed grid of steps with the exact propagator; see `shaders/`.

mod adapter;
mod averaging;
pub(crate) mod constants;
mod device;
mod dispatch_policy;
mod error;
mod features;
mod guard;
pub mod layout;
mod machine;
mod measured;
mod pair;
mod panics;
mod pool;
mod precision;
mod reading;
mod rounds;
pub(crate) mod rules;
mod self_test;
mod shader;
mod signal;
mod slots;
mod stage;
mod tables;
mod transfer;
mod unroll;

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub(crate) use adapter::no_adapter;
pub use adapter::{
    AdapterChoice, AdapterId, AdapterReport, adapters, describe, interface_rank, is_hardware, narrowed_by,
};
pub use constants::Constants;
pub use error::GpuError;
pub use features::Features;
pub use machine::MachineShape;
pub use pool::Pool;
pub use precision::Precision;
pub use reading::LaneResult;
use shader::workgroup;
pub use shader::{Tangents, Variant};
pub use stage::{DeviceTimes, Stage};
pub use tables::Tables;
pub(crate) use tables::{COPIES, MOST_BYTES, MOST_FLOWS, bytes as table_bytes};
pub use transfer::Traffic;

use panics::{PanicFree, catch_panic};

use crate::record::Record;
use crate::record::limits::MOST_STEPS;
use device::{BEGIN, CONCLUDE, EntryPoint, GATHER, JUDGE, Kernel, LIST, OBSERVE, SWEEP};
use dispatch_policy::DispatchPolicy;
use rattlemap_dynamics::model::{Form, Law, Pair, State};
use rattlemap_dynamics::orbit::Budget;

/// Default limit of the number of a lane's events, so that the counter does not overflow.
const MOST_EVENTS: u32 = 1 << 31;

/// Whether lanes with this meshing speed follow chatter by short flights.
pub fn follows_chatter(pair: &Pair, mesh_speed: f64) -> bool {
    mesh_speed <= rules::FOLLOWED_MESH_SPEED * pair::speed(pair)
}

/// Initial value problem of one lane: flow, law, and the state at phase 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lane {
    /// Index of its flow in the tables.
    pub flow: u32,
    /// Index of its law in the tables.
    pub law: u32,
    /// State `(x1, v1, x2, v2)` at phase 0.
    pub start: State,
}

/// How lanes are integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneSettings {
    /// Largest number of forcing periods, without `undecided_periods`. The last periods are used to read the cycle of a periodic cell.
    pub periods: u32,
    /// Periods before averages begin; `exponent_from` if that is less and lanes stop early. Averages of periodic
    /// cells are taken over one cycle.
    pub transient_periods: u32,
    /// Longest period that is searched for, at most 64; 0 searches for none.
    pub max_period: u32,
    /// Whether lanes end once they are decided: a cycle has been confirmed and read, the motion is free of contact
    /// for good, or it is chaotic by `chaos_errors` after `chaos_from`.
    pub early_stop: bool,
    /// Further periods for lanes that are undecided after `periods`; only with early stops.
    pub undecided_periods: u32,
    /// Further periods for lanes that are still chaotic after all other periods; only with exponents.
    pub confirm_chaos: u32,
    /// Whether a lane that is undecided after `periods` ends with the bit [`valid::OPEN`](crate::record::valid::OPEN), instead of running
    /// `undecided_periods` and `confirm_chaos`.
    pub hands_over: bool,
    /// Whether records contain exponents.
    pub exponent: bool,
    /// Whether records contain words.
    pub word: bool,
    /// Whether records contain the words' patterns.
    pub pattern: bool,
    /// Whether records contain the time spent meshing.
    pub mesh: bool,
    /// Whether records contain the symmetry of cycles.
    pub symmetry: bool,
    /// Whether lanes may follow chatter by short flights. They do so if [`follows_chatter`] is true.
    pub chatter: bool,
    /// Features that flows may have.
    pub features: Features,
    /// Quantities to measure on motions whose class is decided. Lanes of machines do not measure; `measure_machines` completes their
    /// records.
    pub measures: Option<Measures>,
    /// Whether records contain the largest multiplier of cycles.
    pub multiplier: bool,
    /// Periods before the exponent of aperiodic cells is accumulated.
    pub exponent_from: u32,
    /// First period at which a lane may stop as chaotic, with early stops.
    pub chaos_from: u32,
    /// Number of standard errors by which the exponent of such a lane must exceed zero.
    pub chaos_errors: f32,
    /// Least number of free steps per period; `None` for the number that the motion needs. More steps do not improve results: rounding
    /// errors add up like a random walk, and a short flight that spans several steps loses the relative accuracy of its gap.
    pub steps_per_period: Option<u32>,
    /// Largest number of lanes under way; `None` for as many as keep a device busy (65,536 at most).
    pub batch: Option<usize>,
    /// Loop iterations that one dispatch may spend on a lane. Some drivers stop loops after 65,535 iterations.
    pub iterations: u32,
    /// Invocations per workgroup.
    pub workgroup: u32,
    /// Largest number of passes per period. A lane that needs more ends as too stiff.
    pub passes_per_period: u32,
    /// Largest number of events per period. A lane with more events ends.
    pub events_per_period: u32,
    /// Largest number of events in all periods. A lane with more events ends. The limit is checked once per period, so its sum with the
    /// limit per period must be below 2^32.
    pub most_events: u32,
}

impl LaneSettings {
    /// Whether results contain what was measured.
    pub(super) fn gathers(&self) -> bool {
        self.multiplier || self.measured_on_lanes().is_some()
    }

    /// Returns the quantities that lanes measure; `None` for machines, which the processor measures.
    pub(super) fn measured_on_lanes(&self) -> Option<Measures> {
        self.measures.filter(|_| self.features.machine.is_none())
    }
}

/// Quantities to measure on lanes whose class is decided. Impacts are always measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Measures {
    /// Forcing periods over which aperiodic motion is measured, at least 1. Periodic motion is measured over a cycle.
    pub periods: u32,
    /// Whether extremes are searched: amplitudes and the largest contact force.
    pub extremes: bool,
    /// Whether integrals are computed: means, root mean squares, harmonics, and dissipated energy.
    pub moments: bool,
}

impl Default for LaneSettings {
    fn default() -> Self {
        LaneSettings {
            periods: 528,
            transient_periods: 400,
            max_period: 64,
            early_stop: true,
            undecided_periods: 0,
            confirm_chaos: 0,
            hands_over: false,
            exponent: true,
            word: true,
            pattern: true,
            mesh: true,
            symmetry: true,
            chatter: true,
            features: Features { kinds: true, sine: true, ..Features::default() },
            measures: None,
            multiplier: false,
            exponent_from: 100,
            chaos_from: 198,
            chaos_errors: 6.0,
            steps_per_period: None,
            batch: None,
            iterations: 4000,
            workgroup: workgroup(),
            passes_per_period: MOST_STEPS,
            events_per_period: 10_000,
            most_events: MOST_EVENTS,
        }
    }
}

impl LaneSettings {
    /// Takes the lengths of integration and the rules of early stops from a budget.
    pub fn within(budget: &Budget) -> Self {
        LaneSettings {
            periods: budget.periods(),
            transient_periods: budget.settings.transient_periods,
            max_period: budget.settings.max_period,
            early_stop: budget.early_stop,
            undecided_periods: budget.undecided_periods,
            confirm_chaos: budget.confirm_chaos,
            exponent: budget.exponent,
            exponent_from: budget.exponent_from(),
            chaos_from: budget.chaos_from(),
            chaos_errors: budget.chaos_errors() as f32,
            ..LaneSettings::default()
        }
    }

    /// Integrates a number of periods and nothing else: no search for cycles, no exponent, no early end.
    pub fn only(periods: u32) -> Self {
        LaneSettings {
            periods,
            transient_periods: 0,
            max_period: 0,
            early_stop: false,
            exponent: false,
            exponent_from: 0,
            ..LaneSettings::default()
        }
    }
}

/// Longest time to wait for the work of a lost device.
const LONGEST_WAIT: Duration = Duration::from_secs(10);

impl Drop for Gpu {
    /// Waits until the driver has stopped working on a lost device, and never drops the device. The process may end afterwards, and a
    /// driver that still works would then use objects that it has destroyed. Dropping the last owner of a lost device would panic.
    fn drop(&mut self) {
        if self.trouble.message().is_some() {
            let idle = wgpu::PollType::Wait { submission_index: None, timeout: Some(LONGEST_WAIT) };
            // A driver that reports the loss here has stopped working.
            let _ = catch_panic(|| self.device.poll(idle));
            std::mem::forget((self.device.clone(), (*self.queue).clone()));
        }
    }
}

/// The kernels of a pool.
#[derive(Clone, Debug)]
struct Kernels {
    /// Variants that integrate lanes, one for each list that can have lanes.
    sweeps: Vec<Variant>,
    /// The variant of all other kernels.
    common: Variant,
    /// Whether lanes read cycles.
    judges: bool,
}

impl Kernels {
    /// Returns all entry points, those first that take longest to compile.
    fn entry_points(&self) -> impl Iterator<Item = (Variant, EntryPoint)> + '_ {
        let sweeps = self.sweeps.iter().rev().map(|&variant| (variant, SWEEP));
        let common =
            self.judges.then_some(JUDGE).into_iter().chain([OBSERVE, CONCLUDE, BEGIN, GATHER]).chain(LIST);
        sweeps.chain(common.map(|entry_point| (self.common, entry_point)))
    }
}

/// A device that integrates lanes in one precision.
pub struct Gpu {
    device: wgpu::Device,
    /// Dropping a queue waits for its work.
    queue: PanicFree<wgpu::Queue>,
    number: usize,
    info: wgpu::AdapterInfo,
    precision: Precision,
    pipelines: HashMap<Kernel, wgpu::ComputePipeline>,
    trouble: device::Trouble,
    rewrite: Option<fn(String) -> String>,
    policy: DispatchPolicy,
    traffic: transfer::TrafficCounter,
    watcher: Option<stage::Watcher>,
    halt: Arc<AtomicBool>,
}

impl Gpu {
    /// Opens an adapter for a precision.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] if no adapter fits the choice and the precision; other errors of the device.
    pub async fn open(precision: Precision, choice: &AdapterChoice) -> Result<Gpu, GpuError> {
        device::open(precision, choice).await
    }

    /// Returns the adapter in use.
    pub fn adapter(&self) -> &wgpu::AdapterInfo {
        &self.info
    }

    /// Returns the adapter's identity on this machine.
    pub fn id(&self) -> AdapterId {
        AdapterId::of(self.number, &self.info)
    }

    /// Returns the precision in use.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// After this call, `rewrite` changes the source of each shader before it is compiled. Measurements use this to count work and to
    /// compare forms of a loop.
    #[doc(hidden)]
    pub fn rewrite_shaders(&mut self, rewrite: fn(String) -> String) {
        self.rewrite = Some(rewrite);
        self.pipelines.clear();
    }

    /// Uses the dispatch policy of dedicated hardware after this call, for tests on software drivers.
    #[doc(hidden)]
    pub fn drive_as_dedicated(&mut self) {
        self.policy = dispatch_policy::DEDICATED;
    }

    /// Calls `watcher` after this call when lanes reach a stage, for measurements.
    pub fn watch(&mut self, watcher: impl Fn(Stage) + Send + Sync + 'static) {
        self.watcher = Some(Box::new(watcher));
    }

    /// Checks a flag after this call. While it is set, [`Pool::advance`] returns after the present round.
    pub fn stop_on(&mut self, halt: &Arc<AtomicBool>) {
        self.halt = Arc::clone(halt);
    }

    /// Returns the flag of [`Gpu::stop_on`].
    pub(crate) fn halt(&self) -> &Arc<AtomicBool> {
        &self.halt
    }

    pub(crate) fn is_halted(&self) -> bool {
        self.halt.load(Ordering::Relaxed)
    }

    /// Makes a call that may panic if the driver fails. On a lost device it makes no call.
    fn call<T>(&self, call: impl FnOnce() -> T) -> Result<T, GpuError> {
        self.trouble.check()?;
        catch_panic(call).map_err(|message| {
            self.trouble.note(format!("its driver failed: {message}"));
            self.failure(GpuError::Lost { message })
        })
    }

    /// Polls the device. Callbacks of native drivers run only here.
    fn poll(&self, poll: wgpu::PollType) -> Result<(), GpuError> {
        let lost = |error: wgpu::PollError| {
            let message = match error {
                wgpu::PollError::Timeout => {
                    let message = format!("it is not ready after {} s", self.policy.longest_wait.as_secs());
                    self.trouble.note(message.clone());
                    message
                }
                error => error.to_string(),
            };
            self.failure(GpuError::Lost { message })
        };
        self.call(|| self.device.poll(poll))?.map_err(lost)?;
        self.trouble.check()
    }

    fn report(&self, stage: Stage) {
        if let Some(watcher) = &self.watcher {
            watcher(stage);
        }
    }

    /// Integrates every lane and returns the records in the same order.
    ///
    /// A record depends on the lane's own flow, law and start alone: not on other lanes, dispatch length, workgroup
    /// size or neighbours.
    ///
    /// # Errors
    /// A [`GpuError`]. A lane that ends early is no error: its record has a status.
    pub async fn run<F>(
        &mut self,
        flows: &[F],
        laws: &[Law],
        lanes: &[Lane],
        settings: &LaneSettings,
    ) -> Result<Vec<Record>, GpuError>
    where
        for<'a> Form: From<&'a F>,
    {
        let constants = flows.iter().map(|flow| {
            let mut constants = Constants::new(flow, settings.steps_per_period)?;
            constants.widen(settings.features);
            Some(constants)
        });
        let tables = self.load_constants(constants.collect(), laws).await?;
        self.run_on(&tables, lanes, settings).await
    }

    /// If the device is lost, returns this loss instead of an error that it caused.
    fn failure(&self, error: GpuError) -> GpuError {
        self.trouble.message().map_or(error, |message| GpuError::Lost { message })
    }

    /// Derives the constants of flows and laws and uploads them, for any number of runs. `steps_per_period` is the least number of free
    /// steps per forcing period; `None` for the number that the motion needs.
    ///
    /// # Errors
    /// [`GpuError::TooManyFlows`] if they do not fit one buffer, [`GpuError::OutOfMemory`] if
    /// they do not fit the device.
    pub async fn load<F>(
        &self,
        flows: &[F],
        laws: &[Law],
        steps_per_period: Option<u32>,
    ) -> Result<Tables, GpuError>
    where
        for<'a> Form: From<&'a F>,
    {
        let constants = flows.iter().map(|flow| Constants::new(flow, steps_per_period)).collect();
        self.load_constants(constants, laws).await
    }

    /// Uploads constants that have already been derived; `None` for a flow that lanes cannot carry.
    ///
    /// # Errors
    /// Those of [`Gpu::load`].
    pub async fn load_constants(
        &self,
        constants: Vec<Option<Constants>>,
        laws: &[Law],
    ) -> Result<Tables, GpuError> {
        Tables::new(self, constants, laws).await
    }

    /// Integrates lanes on loaded flows and laws. The tables' `steps_per_period` replaces that of the settings.
    ///
    /// # Errors
    /// Those of [`Gpu::run`].
    pub async fn run_on(
        &mut self,
        tables: &Tables,
        lanes: &[Lane],
        settings: &LaneSettings,
    ) -> Result<Vec<Record>, GpuError> {
        let mut pool = self.pool(settings).await?;
        let mut records = vec![Record::default(); lanes.len()];
        let mut begun = 0;
        loop {
            let next = begun..(begun + pool.room()).min(lanes.len());
            begun = next.end;
            let next: Vec<(u32, Lane)> = next.map(|i| (i as u32, lanes[i])).collect();
            pool.begin(self, tables, &next).await?;
            if pool.under_way() == 0 {
                return Ok(records);
            }
            if self.is_halted() {
                return Err(GpuError::Halted);
            }
            let until = if begun < lanes.len() { pool.under_way() / 2 } else { 0 };
            for ended in pool.advance(self, tables, until).await? {
                records[ended.number() as usize] = ended.record(tables.constants());
            }
        }
    }

    /// Returns a pool without lanes. Newly compiled shaders must first compute known answers.
    ///
    /// # Errors
    /// [`GpuError::WrongAnswer`] if the device computes something else; other errors of the device.
    pub async fn pool(&mut self, settings: &LaneSettings) -> Result<Pool, GpuError> {
        let LaneSettings { workgroup, exponent, word, pattern, mesh, symmetry, .. } = *settings;
        let LaneSettings { chatter, features, .. } = *settings;
        // Lanes run without the tangent vector until they need it, if this saves time.
        let carried: &[Tangents] = match (exponent, self.policy.late_tangent) {
            (false, _) => &[Tangents::None],
            (true, true) => &[Tangents::None, Tangents::Vector],
            (true, false) => &[Tangents::Vector],
        };
        let reading = (exponent && settings.max_period > 0).then_some(Tangents::Columns);
        let precision = self.precision;
        let variant = |tangents| Variant {
            precision,
            workgroup,
            exponent,
            tangents,
            word,
            pattern,
            mesh,
            symmetry,
            chatter,
            features,
            measures: None,
        };
        let measuring = settings.measured_on_lanes().map(|measures| Variant {
            // The number of periods does not change the shader.
            measures: Some(Measures { periods: 1, ..measures }),
            exponent: false,
            word: false,
            pattern: false,
            mesh: false,
            symmetry: false,
            chatter: false,
            ..variant(Tangents::None)
        });
        let sweeps: Vec<Variant> =
            carried.iter().copied().chain(reading).map(variant).chain(measuring).collect();
        let kernels = Kernels { sweeps, common: variant(Tangents::None), judges: settings.max_period > 0 };
        let is_missing = |(variant, entry_point): &(Variant, EntryPoint)| {
            !self.pipelines.contains_key(&(*variant, entry_point.name))
        };
        let missing: Vec<_> = kernels.entry_points().filter(is_missing).collect();
        let compiled = device::pipelines(self, &missing).await?;
        self.pipelines.extend(compiled);
        if !missing.is_empty() && self.rewrite.is_none() {
            let watcher = self.watcher.take();
            let checked = self_test::check(self, kernels.clone(), settings).await;
            self.watcher = watcher;
            checked.inspect_err(|_| {
                missing
                    .iter()
                    .for_each(|(variant, entry)| drop(self.pipelines.remove(&(*variant, entry.name))));
            })?;
        }
        Ok(Pool::new(self, kernels, settings))
    }

    /// Returns a compiled entry point.
    fn pipeline(&self, variant: &Variant, entry_point: EntryPoint) -> &wgpu::ComputePipeline {
        &self.pipelines[&(*variant, entry_point.name)]
    }

    /// Returns the largest number of bytes of device memory for this number of lanes.
    pub(crate) fn bytes_of_lanes(&self, lanes: usize, settings: &LaneSettings) -> u64 {
        let most = slots::most(&self.device.limits(), self.precision, settings);
        slots::bytes(lanes.min(most), self.precision, settings)
    }
}
