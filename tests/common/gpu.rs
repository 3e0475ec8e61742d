//! Lanes on a device. Without an adapter the tests fail: install a software driver (see `scripts/test.sh`).

use std::ops::{Deref, DerefMut};
use std::sync::Mutex;

use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::map::engine::{self, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::record::Record;
use rattlemap_dynamics::model::{GearPair, Law, Oscillator, State};

use super::REST;

/// Devices that no test uses at present. Compiling their shaders takes longer than running most lanes.
static IDLE: Mutex<Vec<Gpu>> = Mutex::new(Vec::new());

/// A device for one test at a time. The next test gets it with its compiled shaders, unless it was modified.
pub(crate) struct Device {
    gpu: Option<Gpu>,
    is_changed: bool,
}

impl Device {
    /// Calls [`Gpu::rewrite_shaders`]; no other test gets the device afterwards.
    pub(crate) fn rewrite_shaders(&mut self, rewrite: fn(String) -> String) {
        self.is_changed = true;
        (**self).rewrite_shaders(rewrite);
    }

    /// Calls [`Gpu::drive_as_dedicated`]; no other test gets the device afterwards.
    pub(crate) fn drive_as_dedicated(&mut self) {
        self.is_changed = true;
        (**self).drive_as_dedicated();
    }
}

impl Deref for Device {
    type Target = Gpu;

    fn deref(&self) -> &Gpu {
        self.gpu.as_ref().expect("a device until it is dropped")
    }
}

impl DerefMut for Device {
    fn deref_mut(&mut self) -> &mut Gpu {
        self.gpu.as_mut().expect("a device until it is dropped")
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if !self.is_changed && !std::thread::panicking() {
            IDLE.lock().unwrap().extend(self.gpu.take());
        }
    }
}

/// Returns a device that no other test uses at the same time.
pub(crate) fn open(precision: Precision) -> Device {
    let mut idle = IDLE.lock().unwrap();
    let found = idle.iter().position(|gpu| gpu.precision() == precision).map(|i| idle.swap_remove(i));
    drop(idle);
    Device { gpu: Some(found.unwrap_or_else(|| fresh(precision))), is_changed: false }
}

/// Opens a new device.
pub(crate) fn fresh(precision: Precision) -> Gpu {
    pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap()
}

/// Returns the records of a plan, by cell, and leaves the device as it was.
pub(crate) fn map(plan: &Plan, device: &mut Device) -> Vec<Record> {
    let gpu = device.gpu.take().expect("a device until it is dropped");
    let mut engine = Engine::Gpu(Box::new(pollster::block_on(engine::Gpu::new(plan, gpu)).unwrap()));
    let records = all_records(plan, &mut engine);
    let Engine::Gpu(engine) = engine else { unreachable!("the engine has lanes") };
    device.gpu = Some(engine.into_device());
    records
}

/// Runs an engine over all cells of a plan. Returns the records by cell.
pub(crate) fn all_records(plan: &Plan, engine: &mut Engine<'_>) -> Vec<Record> {
    let cells = plan.cells(0..plan.cell_count());
    let mut records = vec![Record::default(); plan.cell_count()];
    for (cell, record) in cells.iter().zip(pollster::block_on(engine.run(&cells)).unwrap()) {
        records[cell.id as usize] = record;
    }
    records
}

/// Returns the engine of a plan's lanes.
pub(crate) fn engine(plan: &Plan, precision: Precision) -> Engine<'_> {
    Engine::Gpu(Box::new(pollster::block_on(engine::Gpu::new(plan, fresh(precision))).unwrap()))
}

/// Returns a flow, a law and a lane for each cell and its start.
pub(crate) fn lanes(cells: &[(GearPair, State)]) -> (Vec<Oscillator>, Vec<Law>, Vec<Lane>) {
    let flows = cells.iter().map(|(pair, _)| pair.oscillator().unwrap()).collect();
    let laws = cells.iter().map(|(pair, _)| pair.law()).collect();
    let lanes = (0..).zip(cells).map(|(i, &(_, start))| Lane { flow: i, law: i, start }).collect();
    (flows, laws, lanes)
}

/// Returns one record for each cell and start.
pub(crate) fn run(gpu: &mut Gpu, cells: &[(GearPair, State)], settings: &LaneSettings) -> Vec<Record> {
    let (flows, laws, lanes) = lanes(cells);
    pollster::block_on(gpu.run(&flows, &laws, &lanes, settings)).unwrap()
}

/// Returns one record for each pair, from rest.
pub(crate) fn run_from_rest(gpu: &mut Gpu, pairs: &[GearPair], settings: &LaneSettings) -> Vec<Record> {
    let cells: Vec<_> = pairs.iter().map(|&pair| (pair, REST)).collect();
    run(gpu, &cells, settings)
}
