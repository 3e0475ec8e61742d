//! One run of a map on one engine, with a clock beside it.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use super::Engine;
use crate::cli::bench::statistics::Spread;
use crate::gpu::{self, AdapterChoice, DeviceTimes, Precision, Stage};
use crate::map::engine::{self, Cpu};
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::record::Record;
use crate::record::classify::classify;
use crate::show::cells::Cells;
use crate::store::folder::Folder;
use crate::store::map;
use rattlemap_dynamics::orbit::Class;

/// Most lanes handed over at a time.
const BATCH: usize = 1 << 20;

/// Seconds that the stages of a run took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Times {
    /// Numbering cells, deriving constants and handing them to the device.
    pub prepare: f64,
    /// Making a batch's buffers and handing its lanes over.
    pub upload: f64,
    /// From there until every lane has ended.
    pub integrate: f64,
    /// From there until its records are made.
    pub read: f64,
    /// Writing the table `cells.npy`.
    pub write: f64,
    /// Integration by the device's own clock, if it has one.
    pub device: Option<DeviceTimes>,
}

impl Times {
    /// From handing lanes over to having their records.
    pub fn running(&self) -> f64 {
        self.upload + self.integrate + self.read
    }

    /// All of it.
    pub fn total(&self) -> f64 {
        self.prepare + self.running() + self.write
    }
}

/// One run.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// What it took.
    pub times: Times,
    /// Forcing periods integrated, over all lanes.
    pub periods: u64,
    /// Free steps of all lanes; none where there is no grid.
    pub lane_steps: Option<u64>,
}

impl Run {
    /// Forcing periods per second.
    pub fn rate(&self) -> f64 {
        self.periods as f64 / self.times.running()
    }

    /// Free steps per second.
    pub fn step_rate(&self) -> f64 {
        self.lane_steps.map_or(f64::NAN, |steps| steps as f64 / self.times.running())
    }
}

/// Runs of one size.
pub(super) struct Measured {
    pub(super) runs: Vec<Run>,
    pub(super) classes: Vec<Class>,
}

/// What a batch has taken so far, told by the device's stages.
struct Split {
    last: Instant,
    times: Times,
}

/// What computes.
enum Machine {
    /// A pool of threads.
    Cpu(rayon::ThreadPool),
    /// A device; none once it is lost.
    Gpu(Option<Box<gpu::Gpu>>),
}

/// An engine to be measured.
pub struct Bench<'a> {
    engine: Engine,
    machine: Machine,
    split: Arc<Mutex<Split>>,
    open_seconds: f64,
    first_seconds: f64,
    folder: &'a Folder,
    /// The map that was made last.
    last: Option<(Scene, Vec<Record>)>,
}

impl<'a> Bench<'a> {
    /// The reference on so many threads. Tables are written to `folder`.
    ///
    /// # Errors
    /// If there are no threads to be had.
    pub fn cpu(threads: usize, folder: &'a Folder) -> Result<Bench<'a>> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        Ok(Bench::new(Engine::Cpu { threads }, Machine::Cpu(pool), folder))
    }

    /// Lanes on the adapter with this number.
    ///
    /// # Errors
    /// If it cannot be opened, gives wrong answers, or does not compile the lane.
    pub fn gpu(precision: Precision, number: usize, folder: &'a Folder) -> Result<Bench<'a>> {
        let clock = Instant::now();
        let choice = AdapterChoice::numbered(number);
        let mut opened = pollster::block_on(gpu::Gpu::open(precision, &choice))?;
        let open_seconds = clock.elapsed().as_secs_f64();
        let is_hardware = gpu::is_hardware(opened.adapter());
        let device = gpu::describe(opened.adapter());
        let engine = Engine::Gpu { precision, number, device, is_hardware };
        let split = Arc::new(Mutex::new(Split { last: Instant::now(), times: Times::default() }));
        let told = Arc::clone(&split);
        opened.watch(move |stage| told.lock().unwrap_or_else(PoisonError::into_inner).take(stage));
        let machine = Machine::Gpu(Some(Box::new(opened)));
        let mut bench = Bench { split, open_seconds, ..Bench::new(engine, machine, folder) };
        let clock = Instant::now();
        let first = super::scene(2);
        bench.integrate(&Plan::new(&first)).map_err(anyhow::Error::msg).context("the first lanes")?;
        bench.first_seconds = clock.elapsed().as_secs_f64();
        Ok(bench)
    }

    fn new(engine: Engine, machine: Machine, folder: &'a Folder) -> Bench<'a> {
        let split = Arc::new(Mutex::new(Split { last: Instant::now(), times: Times::default() }));
        Bench { engine, machine, split, open_seconds: 0.0, first_seconds: 0.0, folder, last: None }
    }

    /// What is measured.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    pub(super) fn open_seconds(&self) -> f64 {
        self.open_seconds
    }

    pub(super) fn first_seconds(&self) -> f64 {
        self.first_seconds
    }

    /// The map that was made last, and the device that made it.
    pub(super) fn last(&mut self) -> Option<(&Scene, &[Record], Option<&mut gpu::Gpu>)> {
        let (scene, records) = self.last.as_ref()?;
        let device = match &mut self.machine {
            Machine::Gpu(device) => device.as_deref_mut(),
            Machine::Cpu(_) => None,
        };
        Some((scene, records, device))
    }

    /// Runs a map `runs` times, fewer if `seconds` are over before, but twice at least. The inner
    /// error says why the map could not be made.
    pub(super) fn point(
        &mut self,
        scene: &Scene,
        runs: usize,
        seconds: f64,
    ) -> Result<std::result::Result<Measured, String>> {
        let clock = Instant::now();
        let mut list: Vec<Run> = Vec::new();
        while list.len() < super::LEAST_RUNS.min(runs)
            || list.len() < runs && {
                let next = Spread::of(list.iter().map(|run| run.times.total()).collect()).median;
                clock.elapsed().as_secs_f64() + next < seconds
            }
        {
            // The last map is not needed any more, and memory may be short.
            self.last = None;
            match self.once(scene)? {
                Ok(run) => list.push(run),
                Err(why) => return Ok(Err(why)),
            }
        }
        let records = self.last.as_ref().map_or(&[][..], |(_, records)| records);
        Ok(Ok(Measured { classes: records.iter().map(classify).collect(), runs: list }))
    }

    fn once(&mut self, scene: &Scene) -> Result<std::result::Result<Run, String>> {
        let clock = Instant::now();
        let plan = Plan::new(scene);
        let planned = clock.elapsed().as_secs_f64();
        let (mut run, records) = match self.integrate(&plan) {
            Ok(integrated) => integrated,
            Err(why) => return Ok(Err(why)),
        };
        run.times.prepare += planned;
        let clock = Instant::now();
        let cells = Cells::new(scene, &plan, &records);
        let made = map::Provenance {
            engine: self.engine.name(),
            precision: self.engine.precision(),
            device: self.engine.device(),
        };
        let elapsed = Duration::from_secs_f64(run.times.running());
        let made = map::Run { elapsed, ..map::Run::new(made, &[], "") };
        map::write(self.folder, &cells, &made)?;
        run.times.write = clock.elapsed().as_secs_f64();
        map::clear(self.folder)?;
        self.last = Some((scene.clone(), records));
        Ok(Ok(run))
    }

    /// All but planning and writing.
    fn integrate(&mut self, plan: &Plan) -> std::result::Result<(Run, Vec<Record>), String> {
        let clock = Instant::now();
        let split = Arc::clone(&self.split);
        match &mut self.machine {
            Machine::Cpu(pool) => {
                let mut engine = engine::Engine::Cpu(Cpu::new(plan));
                pool.install(|| sweep(plan, &mut engine, &split, clock))
            }
            Machine::Gpu(device) => {
                let Some(opened) = device.take() else {
                    return Err("no device is left after the failure before".to_owned());
                };
                let lanes =
                    pollster::block_on(engine::Gpu::new(plan, *opened)).map_err(|error| error.to_string())?;
                let mut engine = engine::Engine::Gpu(Box::new(lanes));
                let swept = sweep(plan, &mut engine, &split, clock);
                if let engine::Engine::Gpu(lanes) = engine {
                    *device = Some(Box::new(lanes.into_device()));
                }
                swept
            }
        }
    }
}

/// Every cell of a plan through an engine that is ready since some preparation began.
fn sweep(
    plan: &Plan,
    engine: &mut engine::Engine<'_>,
    split: &Mutex<Split>,
    began: Instant,
) -> std::result::Result<(Run, Vec<Record>), String> {
    let own = || split.lock().unwrap_or_else(PoisonError::into_inner);
    let mut records = vec![Record::default(); plan.run_count()];
    *own() = Split { last: began, times: Times::default() };
    let is_lane = engine.lane_steps().is_some();
    for from in (0..records.len()).step_by(BATCH) {
        let cells = plan.cells(from..records.len().min(from + BATCH));
        own().lap(|times| &mut times.prepare);
        let computed = pollster::block_on(engine.run(&cells)).map_err(|error| error.to_string())?;
        // Lanes have told of their integration; what is left is what the host made of them.
        own().lap(|times| if is_lane { &mut times.read } else { &mut times.integrate });
        cells.iter().zip(computed).for_each(|(cell, record)| records[cell.id as usize] = record);
    }
    let periods = records.iter().map(|record| u64::from(record.periods_run)).sum();
    let times = own().times;
    Ok((Run { times, periods, lane_steps: engine.lane_steps() }, records))
}

impl Split {
    /// Adds the time since the last lap to a stage.
    fn lap(&mut self, stage: impl FnOnce(&mut Times) -> &mut f64) {
        let now = Instant::now();
        *stage(&mut self.times) += (now - self.last).as_secs_f64();
        self.last = now;
    }

    fn take(&mut self, stage: Stage) {
        match stage {
            Stage::Uploaded => self.lap(|times| &mut times.upload),
            Stage::Integrated { device } => {
                self.lap(|times| &mut times.integrate);
                if let Some(device) = device {
                    self.times.device = Some(self.times.device.unwrap_or_default().and(device));
                }
            }
            Stage::Read => self.lap(|times| &mut times.read),
        }
    }
}
