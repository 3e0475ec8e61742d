//! Timed runs of the main map on one engine.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use anyhow::{Context, Result, anyhow};

use super::spread::Spread;
use crate::gpu::{self, AdapterChoice, AdapterReport, DeviceTimes, Precision, Stage};
use crate::map::engine::{Cpu, Engine, Gpu};
use crate::map::plan::{Plan, count_classes};
use crate::map::scene::{Purpose, Scene};
use crate::record::Record;
use crate::record::classify::classify;
use crate::validate::{self, Kind, Lanes, Subject, Validation};
use rattlemap_dynamics::orbit::Class;

/// Text of the scene that is measured. Only its number of cells changes.
pub(super) const SCENE: &str = include_str!("../../../scenes/e_omega.toml");

/// Largest number of cells in one call of an engine.
const BATCH: usize = 1 << 20;

/// Seed of the sample of cells that the reference recomputes.
const SEED: u64 = 1;

/// Target of a measurement: an engine, its precision and its device.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Target {
    /// Description of the device, as in manifests.
    pub(super) device: String,
    pub(super) precision: Precision,
    /// Index of the adapter; none for the processor.
    pub(super) adapter: Option<usize>,
    pub(super) is_hardware: bool,
}

impl Target {
    /// Builds the target of the reference on all processor cores.
    pub(super) fn cpu() -> Target {
        let device = "event-driven reference".to_owned();
        Target { device, precision: Precision::F64, adapter: None, is_hardware: false }
    }

    /// Builds the target of lanes on an adapter.
    pub(super) fn gpu(adapter: &AdapterReport, precision: Precision) -> Target {
        let (device, is_hardware) = (gpu::describe(&adapter.info), gpu::is_hardware(&adapter.info));
        Target { device, precision, adapter: Some(adapter.number), is_hardware }
    }

    /// Returns `cpu` or `gpu`.
    pub(super) fn engine(&self) -> &'static str {
        if self.adapter.is_some() { "gpu" } else { "cpu" }
    }

    /// Returns a short name for legends and progress lines.
    pub(super) fn label(&self) -> String {
        let name =
            if self.adapter.is_some() { self.device.split(" (").next().unwrap_or_default() } else { "CPU" };
        format!("{name}, {}", self.precision.name())
    }
}

/// One timed run of a map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// Seconds to number the cells, derive constants and upload them.
    pub(super) prepare: f64,
    /// Seconds from the first call of the engine until all records are on the host.
    pub(super) integrate: f64,
    /// Forcing periods integrated, over all cells.
    pub(super) periods: u64,
    /// Times that the device's clock measured; none for the processor and for devices without timestamps.
    pub(super) device: Option<DeviceTimes>,
}

impl Run {
    /// Returns forcing periods per second.
    pub(super) fn rate(&self) -> f64 {
        self.periods as f64 / self.integrate
    }

    /// Returns the share of the integration during which the device worked; NaN if the device has no clock.
    pub(super) fn device_share(&self) -> f64 {
        self.device.map_or(f64::NAN, |device| device.busy / self.integrate)
    }
}

/// Repeated runs of one map on one engine.
#[derive(Clone, Debug)]
pub(super) struct BenchPoint {
    pub(super) lanes: usize,
    pub(super) runs: Vec<Run>,
    pub(super) classes: Vec<Class>,
    /// Number of cells whose class differs from the first engine's; none if the first engine has no map of this size.
    pub(super) differing: Option<usize>,
}

impl BenchPoint {
    /// Computes the spread of a quantity over the runs.
    pub(super) fn spread(&self, of: impl Fn(&Run) -> f64) -> Spread {
        Spread::of(self.runs.iter().map(of).collect())
    }

    /// Counts cells by class.
    pub(super) fn counts(&self) -> [usize; Class::NAMES.len()] {
        count_classes(self.classes.iter().copied())
    }
}

/// Comparison of a sample of the largest map with the reference.
#[derive(Clone, Debug)]
pub(super) struct SampleCheck {
    pub(super) validation: Validation,
    /// Restitution and frequency of cells that differ without an explanation.
    pub(super) unexplained: Vec<[f64; 2]>,
}

/// All measurements of one engine.
#[derive(Clone, Debug)]
pub(super) struct Series {
    pub(super) target: Target,
    /// Seconds to open the device, compile the lane and compute the first four cells.
    pub(super) open_seconds: f64,
    pub(super) points: Vec<BenchPoint>,
    /// Smallest number of cells that was not measured, with the reason.
    pub(super) skipped: Option<(usize, String)>,
    pub(super) check: Option<SampleCheck>,
}

/// Builds the scene with `side` x `side` cells.
pub(super) fn scene(side: u32) -> Scene {
    let sets = [format!("axis.0.count={side}"), format!("axis.1.count={side}")];
    let scene = Scene::parse(SCENE, "scenes/e_omega.toml", &sets, Purpose::Map);
    scene.unwrap_or_else(|error| unreachable!("a scene of the repository: {error}"))
}

/// An engine that is ready to be measured.
pub(super) struct OpenEngine {
    /// None for the processor. The engine takes the device and returns it after each run.
    device: Option<Box<gpu::Gpu>>,
    /// Times that the device's clock has counted since the last reading.
    device_times: Arc<Mutex<Option<DeviceTimes>>>,
    pub(super) open_seconds: f64,
}

impl OpenEngine {
    /// Opens the engine and computes the first four cells, so that shaders are compiled.
    ///
    /// # Errors
    /// If the device cannot be opened, fails its self test or does not compile the lane.
    pub(super) fn open(target: &Target) -> Result<OpenEngine> {
        let clock = Instant::now();
        let device_times = Arc::new(Mutex::new(None));
        let mut bench =
            OpenEngine { device: None, device_times: Arc::clone(&device_times), open_seconds: 0.0 };
        if let Some(number) = target.adapter {
            let choice = AdapterChoice::numbered(number);
            let mut device = pollster::block_on(gpu::Gpu::open(target.precision, &choice))?;
            device.watch(move |stage| {
                if let Stage::Integrated { device: Some(new) } = stage {
                    let mut sum = device_times.lock().unwrap_or_else(PoisonError::into_inner);
                    *sum = Some(sum.unwrap_or_default().and(new));
                }
            });
            bench.device = Some(Box::new(device));
            bench.run(&scene(2)).context("cannot compute the first lanes")?;
        }
        bench.open_seconds = clock.elapsed().as_secs_f64();
        Ok(bench)
    }

    /// Computes the map of a scene once.
    ///
    /// # Errors
    /// If the engine fails.
    pub(super) fn run(&mut self, scene: &Scene) -> Result<(Run, Vec<Record>)> {
        let clock = Instant::now();
        let plan = Plan::new(scene);
        let mut engine = match self.device.take() {
            Some(device) => Engine::Gpu(Box::new(pollster::block_on(Gpu::new(&plan, *device))?)),
            None => Engine::Cpu(Cpu::new(&plan)),
        };
        let prepare = clock.elapsed().as_secs_f64();
        self.take_device_times();
        let clock = Instant::now();
        let mut records = Vec::with_capacity(plan.run_count());
        for from in (0..plan.run_count()).step_by(BATCH) {
            let cells = plan.cells(from..plan.run_count().min(from + BATCH));
            let computed = pollster::block_on(engine.run(&cells))?;
            records.extend(cells.iter().map(|cell| cell.id).zip(computed));
        }
        let integrate = clock.elapsed().as_secs_f64();
        if let Engine::Gpu(lanes) = engine {
            self.device = Some(Box::new(lanes.into_device()));
        }
        records.sort_unstable_by_key(|(id, _)| *id);
        let records: Vec<Record> = records.into_iter().map(|(_, record)| record).collect();
        let periods = records.iter().map(|record| u64::from(record.periods_run)).sum();
        Ok((Run { prepare, integrate, periods, device: self.take_device_times() }, records))
    }

    fn take_device_times(&self) -> Option<DeviceTimes> {
        self.device_times.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Computes the map of a scene `runs` times, fewer if `seconds` run out, but at least twice.
    ///
    /// # Errors
    /// If the engine fails.
    pub(super) fn point(
        &mut self,
        scene: &Scene,
        runs: usize,
        seconds: f64,
    ) -> Result<(BenchPoint, Vec<Record>)> {
        let clock = Instant::now();
        let (first, mut records) = self.run(scene)?;
        let mut list = vec![first];
        while list.len() < 2 || list.len() < runs && clock.elapsed().as_secs_f64() + first.integrate < seconds
        {
            let (run, again) = self.run(scene)?;
            list.push(run);
            records = again;
        }
        let classes = records.iter().map(classify).collect();
        Ok((BenchPoint { lanes: records.len(), runs: list, classes, differing: None }, records))
    }

    /// Recomputes `samples` cells of a map on the reference and compares them.
    ///
    /// # Errors
    /// If the device fails while it computes the sample's lanes again.
    pub(super) fn check(&mut self, scene: &Scene, records: &[Record], samples: usize) -> Result<SampleCheck> {
        let plan = Plan::new(scene);
        let device = self.device.as_deref_mut();
        let precision = device.as_ref().map_or(Precision::F64, |device| device.precision());
        let subject = Subject { plan: &plan, records: &records, precision, is_lane: device.is_some() };
        let sample = validate::sample(&plan, &records, samples, SEED);
        let lanes = match device {
            Some(device) => pollster::block_on(Lanes::run(&subject, &sample, Some(device), None, &|_| ()))
                .map_err(|error| anyhow!("cannot compute the sample's lanes again: {error}"))?,
            None => Lanes::default(),
        };
        let validation = validate::replay(&subject, &sample, &lanes, &|_| {});
        let unexplained = validation.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained);
        let unexplained = unexplained.map(|mismatch| {
            let [i, j] = plan.indices(mismatch.id);
            [plan.axes()[0].value(i), plan.axes()[1].value(j)]
        });
        Ok(SampleCheck { unexplained: unexplained.collect(), validation })
    }
}
