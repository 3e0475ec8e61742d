//! The GPU engine: WGSL lanes on whatever adapter there is.
//!
//! [`Gpu::open`] takes an adapter and compiles the lane for one precision; [`Gpu::run`]
//! integrates lanes, as many at a time as the adapter's limits allow, by short dispatches over
//! state that stays on the device, and hands back one [`Record`] per lane; in a [`Pool`] lanes are begun and
//! end at any time. The engine knows no files, threads or blocking waits of its own.
//!
//! The lane is independent of [`rattlemap_dynamics::reference`]: it takes the model's description
//! ([`rattlemap_dynamics::model`]) and nothing else. A fixed grid of steps with the exact propagator
//! carries it from event to event; see `shaders/`.

mod adapter;
mod averaging;
mod caught;
pub(crate) mod constants;
mod coordinates;
mod device;
mod dispatch_policy;
mod error;
mod guard;
pub mod layout;
mod pool;
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

pub(crate) use adapter::no_adapter;
pub use adapter::{
    AdapterChoice, AdapterId, AdapterReport, adapters, describe, interface_rank, is_hardware, narrowed_by,
};
pub use constants::{Constants, STEP_ANGLE};
pub use error::GpuError;
pub use pool::Pool;
pub use reading::Ended;
pub use shader::{Precision, Variant, WORKGROUP};
pub use stage::{DeviceTimes, Stage};
pub use tables::Tables;
pub(crate) use tables::{MOST_BYTES, MOST_FLOWS, bytes as table_bytes};

use caught::{Dropped, caught};

use crate::record::Record;
use crate::record::limits::MOST_STEPS;
use dispatch_policy::DispatchPolicy;
use rattlemap_dynamics::model::{Law, Oscillator, State};
use rattlemap_dynamics::orbit::Budget;

/// Largest meshing speed with which lanes follow chatter by short flights, relative to half the walls' distance times
/// the rate of free motion: above it too few of them are left to pay for.
const FOLLOWED_MESH_SPEED: f64 = 4e-4;

/// Events of all lanes at most, so that their count does not overflow.
const MOST_EVENTS: u32 = 1 << 31;

/// Whether an oscillator has a wall that is elastic or rigid.
pub fn has_elastic_or_rigid_wall(oscillator: &Oscillator) -> bool {
    constants::has_elastic_or_rigid_wall(oscillator.contacts, oscillator.walls)
}

/// Whether lanes of such a meshing speed follow chatter by short flights.
pub fn follows_chatter(oscillator: &Oscillator, mesh_speed: f64) -> bool {
    mesh_speed <= FOLLOWED_MESH_SPEED * constants::speed(oscillator)
}

/// One lane: which flow, which law, and where it starts at phase 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lane {
    /// Index into the flows.
    pub flow: u32,
    /// Index into the laws.
    pub law: u32,
    /// State `(x1, v1, x2, v2)` at phase 0.
    pub start: State,
}

/// How lanes are integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneSettings {
    /// Forcing periods to integrate at most, `undecided_periods` aside; the last of them read the cycle of a
    /// periodic cell.
    pub periods: u32,
    /// Periods before averages are taken, or `exponent_from` if that is less and lanes stop
    /// early. Those of periodic cells are taken over one cycle.
    pub transient_periods: u32,
    /// Longest period searched for, at most 64; 0 searches for none.
    pub max_period: u32,
    /// Whether lanes end once they are decided: a cycle confirmed and read, contact-free for
    /// good, or chaotic by `chaos_errors` from `chaos_from` on.
    pub early_stop: bool,
    /// Periods beyond the budget for lanes that are undecided by then; with early stops alone.
    pub undecided_periods: u32,
    /// Whether exponents are asked for.
    pub exponent: bool,
    /// Whether words, their patterns, time spent meshing and symmetry are asked for.
    pub word: bool,
    /// See `word`.
    pub pattern: bool,
    /// See `word`.
    pub mesh: bool,
    /// See `word`.
    pub symmetry: bool,
    /// Whether chatter may be followed by short flights; lanes do so where [`follows_chatter`] says.
    pub chatter: bool,
    /// Whether walls may be elastic or rigid.
    pub kinds: bool,
    /// Periods before the exponent of aperiodic cells is accumulated.
    pub exponent_from: u32,
    /// The first period at which chaos may be called, with early stops.
    pub chaos_from: u32,
    /// Standard errors by which the exponent must exceed zero then.
    pub chaos_errors: f32,
    /// Free steps per period at least; none for as many as the motion needs. More gain nothing:
    /// roundings add up like a random walk, and a short flight between impacts that spans
    /// several steps is known to the rounding of the gap, no longer to its own.
    pub steps_per_period: Option<u32>,
    /// Lanes under way at most; none for what the adapter's limits allow.
    pub batch: Option<usize>,
    /// Loop iterations that one dispatch may spend on a lane. Some drivers stop loops after
    /// 65,535 iterations in all.
    pub iterations: u32,
    /// Invocations per workgroup.
    pub workgroup: u32,
    /// Passes per period beyond which a cell is refused as too stiff.
    pub passes_per_period: u32,
    /// Events per period beyond which a cell ends.
    pub events_per_period: u32,
    /// Events in all beyond which a cell ends: looked at once a period, less than 2^32 by those of one.
    pub most_events: u32,
}

impl Default for LaneSettings {
    fn default() -> Self {
        LaneSettings {
            periods: 528,
            transient_periods: 400,
            max_period: 64,
            early_stop: true,
            undecided_periods: 0,
            exponent: true,
            word: true,
            pattern: true,
            mesh: true,
            symmetry: true,
            chatter: true,
            kinds: true,
            exponent_from: 100,
            chaos_from: 198,
            chaos_errors: 6.0,
            steps_per_period: None,
            batch: None,
            iterations: 4000,
            workgroup: WORKGROUP,
            passes_per_period: MOST_STEPS,
            events_per_period: 10_000,
            most_events: MOST_EVENTS,
        }
    }
}

impl LaneSettings {
    /// What a budget says of how long lanes are integrated, and when they may stop.
    pub fn within(budget: &Budget) -> Self {
        LaneSettings {
            periods: budget.periods(),
            transient_periods: budget.settings.transient_periods,
            max_period: budget.settings.max_period,
            early_stop: budget.early_stop,
            undecided_periods: budget.undecided_periods,
            exponent: budget.exponent,
            exponent_from: budget.exponent_from(),
            chaos_from: budget.chaos_from(),
            chaos_errors: budget.chaos_errors() as f32,
            ..LaneSettings::default()
        }
    }

    /// So many periods from the start and nothing else: no cycle is searched for, no exponent
    /// taken, and no lane ends early.
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

impl Drop for Gpu {
    /// A lost device is left to the driver: what still holds on to it would be the last to let go, and panic.
    fn drop(&mut self) {
        if self.trouble.message().is_some() {
            std::mem::forget((self.device.clone(), (*self.queue).clone()));
        }
    }
}

/// A device that integrates lanes in one precision.
pub struct Gpu {
    device: wgpu::Device,
    /// Dropped, it is waited for.
    queue: Dropped<wgpu::Queue>,
    number: usize,
    info: wgpu::AdapterInfo,
    precision: Precision,
    pipelines: HashMap<Variant, device::Pipelines>,
    trouble: device::Trouble,
    rewrite: Option<fn(String) -> String>,
    policy: DispatchPolicy,
    watcher: Option<stage::Watcher>,
    halt: Arc<AtomicBool>,
}

impl Gpu {
    /// Opens an adapter for a precision.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] if there is none with that precision, and what the device refuses.
    pub async fn open(precision: Precision, choice: &AdapterChoice) -> Result<Gpu, GpuError> {
        device::open(precision, choice).await
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &wgpu::AdapterInfo {
        &self.info
    }

    /// Which of the machine's adapters it is.
    pub fn id(&self) -> AdapterId {
        AdapterId::of(self.number, &self.info)
    }

    /// The precision in use.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Compiles shaders from here on as `rewrite` turns them, whatever they compute: measurements count work and
    /// compare forms of a loop in this way.
    #[doc(hidden)]
    pub fn rewrite_shaders(&mut self, rewrite: fn(String) -> String) {
        self.rewrite = Some(rewrite);
        self.pipelines.clear();
    }

    /// Drives lanes from here on as on hardware of their own: for tests where there is none.
    #[doc(hidden)]
    pub fn drive_as_dedicated(&mut self) {
        self.policy = DispatchPolicy::of(wgpu::DeviceType::DiscreteGpu);
    }

    /// Tells `watcher` from here on how far lanes have come: for measurements.
    pub fn watch(&mut self, watcher: impl Fn(Stage) + Send + Sync + 'static) {
        self.watcher = Some(Box::new(watcher));
    }

    /// Looks at a flag from here on: while it is raised, [`Gpu::advance`] returns after the present round.
    pub fn heed(&mut self, halt: &Arc<AtomicBool>) {
        self.halt = Arc::clone(halt);
    }

    fn is_halted(&self) -> bool {
        self.halt.load(Ordering::Relaxed)
    }

    /// Asks something of the device in a way that may panic where its driver fails; nothing is asked of a lost one.
    fn call<T>(&self, call: impl FnOnce() -> T) -> Result<T, GpuError> {
        self.trouble.check()?;
        caught(call).map_err(|message| {
            self.trouble.note(format!("its driver fails: {message}"));
            self.failure(GpuError::Lost { message })
        })
    }

    /// What the device has to say: callbacks come while it is polled, native ones then alone.
    fn poll(&self, poll: wgpu::PollType) -> Result<(), GpuError> {
        let lost = |error: wgpu::PollError| self.failure(GpuError::Lost { message: error.to_string() });
        self.call(|| self.device.poll(poll))?.map_err(lost)?;
        self.trouble.check()
    }

    fn tell(&self, stage: Stage) {
        if let Some(watcher) = &self.watcher {
            watcher(stage);
        }
    }

    /// Integrates every lane and returns its record, in the same order.
    ///
    /// What a lane gives depends on its own flow, law and start alone: not on what else is
    /// under way, dispatch length, workgroup size or neighbours.
    ///
    /// # Errors
    /// A [`GpuError`]; a lane that ends early is no error but a status in its record.
    pub async fn run(
        &mut self,
        flows: &[Oscillator],
        laws: &[Law],
        lanes: &[Lane],
        settings: &LaneSettings,
    ) -> Result<Vec<Record>, GpuError> {
        let tables = self.load(flows, laws, settings.steps_per_period).await?;
        self.run_on(&tables, lanes, settings).await
    }

    /// A device that is lost tells so once; what follows from it says less.
    fn failure(&self, error: GpuError) -> GpuError {
        self.trouble.message().map_or(error, |message| GpuError::Lost { message })
    }

    /// Derives the constants of flows and laws and uploads them, for any number of runs.
    /// `steps_per_period` is the least number of free steps per forcing period; none for as
    /// many as the motion needs.
    ///
    /// # Errors
    /// [`GpuError::TooManyFlows`] if they do not fit one buffer, [`GpuError::OutOfMemory`] if
    /// they do not fit the device.
    pub async fn load(
        &self,
        flows: &[Oscillator],
        laws: &[Law],
        steps_per_period: Option<u32>,
    ) -> Result<Tables, GpuError> {
        let constants = flows.iter().map(|flow| Constants::new(flow, steps_per_period)).collect();
        self.load_derived(constants, laws).await
    }

    /// [`Gpu::load`] of constants that have been derived already, none for a flow that lanes cannot carry.
    ///
    /// # Errors
    /// As [`Gpu::load`].
    pub async fn load_derived(
        &self,
        constants: Vec<Option<Constants>>,
        laws: &[Law],
    ) -> Result<Tables, GpuError> {
        Tables::new(self, constants, laws).await
    }

    /// [`Gpu::run`] on flows and laws that are loaded; the settings' `steps_per_period` is
    /// that of the tables.
    ///
    /// # Errors
    /// As [`Gpu::run`].
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
            self.begin(&mut pool, tables, &next).await?;
            if pool.under_way() == 0 {
                return Ok(records);
            }
            if self.is_halted() {
                return Err(GpuError::Halted);
            }
            let until = if begun < lanes.len() { pool.under_way() / 2 } else { 0 };
            for ended in self.advance(&mut pool, tables, until).await? {
                records[ended.number() as usize] = ended.record(tables.constants());
            }
        }
    }

    /// A pool without lanes. What has to be compiled for it is asked for known answers.
    ///
    /// # Errors
    /// [`GpuError::WrongAnswer`] if the device computes something else, and what it refuses.
    pub async fn pool(&mut self, settings: &LaneSettings) -> Result<Pool, GpuError> {
        let LaneSettings { workgroup, exponent, word, pattern, mesh, symmetry, chatter, kinds, .. } =
            *settings;
        let keep = self.policy.keep;
        // Until they need it, lanes go on without the tangent vector where that pays.
        let growths: &[bool] = match (exponent, self.policy.late_tangent) {
            (false, _) => &[false],
            (true, true) => &[false, true],
            (true, false) => &[true],
        };
        let precision = self.precision;
        let variant = |growth| Variant {
            precision,
            workgroup,
            exponent,
            growth,
            word,
            pattern,
            mesh,
            symmetry,
            chatter,
            kinds,
            keep,
        };
        let variants: Vec<Variant> = growths.iter().map(|&growth| variant(growth)).collect();
        let missing: Vec<Variant> =
            variants.iter().copied().filter(|variant| !self.pipelines.contains_key(variant)).collect();
        for &variant in &missing {
            let pipelines = device::pipelines(self, variant).await?;
            self.pipelines.insert(variant, pipelines);
        }
        if !missing.is_empty() && self.rewrite.is_none() {
            let watcher = self.watcher.take();
            let checked = self_test::check(self, variants.clone(), settings).await;
            self.watcher = watcher;
            checked
                .inspect_err(|_| missing.iter().for_each(|variant| drop(self.pipelines.remove(variant))))?;
        }
        Ok(Pool::new(self, variants, settings))
    }

    /// Puts lanes at their starts, in a pool all of whose lanes are on these tables. Each has a number by which its
    /// record is known.
    ///
    /// # Errors
    /// [`GpuError::NoSuchCell`], [`GpuError::OutOfMemory`] if there are more than [`Pool::room`] or than
    /// the device has memory for, or what the device refuses. None of them is begun then.
    pub async fn begin(
        &self,
        pool: &mut Pool,
        tables: &Tables,
        lanes: &[(u32, Lane)],
    ) -> Result<(), GpuError> {
        pool.begin(self, tables, lanes).await
    }

    /// Bytes of its memory that so many lanes take at most.
    pub(crate) fn bytes_of_lanes(&self, lanes: usize) -> u64 {
        slots::bytes(lanes.min(adapter::most_slots(&self.device.limits())), self.precision)
    }

    /// Integrates until no more than `until` lanes are left; returns those that have ended. Only where a flag is
    /// raised it may be that none has.
    ///
    /// # Errors
    /// What the device refuses; the pool is of no use then.
    pub async fn advance(
        &self,
        pool: &mut Pool,
        tables: &Tables,
        until: usize,
    ) -> Result<Vec<Ended>, GpuError> {
        pool.advance(self, tables, until).await
    }
}
