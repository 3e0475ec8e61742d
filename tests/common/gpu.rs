//! Lanes on a device. No adapter is a failure: install a software driver (see `scripts/test.sh`).

use std::ops::{Deref, DerefMut};
use std::sync::Mutex;

use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::map::engine::{self, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::record::Record;
use rattlemap_dynamics::model::{GearPair, Law, Oscillator, State};

use super::REST;

/// Devices that nobody uses. To compile their shaders takes longer than to run most lanes.
static IDLE: Mutex<Vec<Gpu>> = Mutex::new(Vec::new());

/// A device for one caller at a time; the next gets it with what it has compiled, unless it was changed.
pub(crate) struct Device {
    gpu: Option<Gpu>,
    is_changed: bool,
}

impl Device {
    /// As [`Gpu::rewrite_shaders`]; nobody else gets the device afterwards.
    pub(crate) fn rewrite_shaders(&mut self, rewrite: fn(String) -> String) {
        self.is_changed = true;
        (**self).rewrite_shaders(rewrite);
    }

    /// As [`Gpu::drive_as_dedicated`]; nobody else gets the device afterwards.
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

/// A device that nobody else uses meanwhile.
pub(crate) fn open(precision: Precision) -> Device {
    let mut idle = IDLE.lock().unwrap();
    let found = idle.iter().position(|gpu| gpu.precision() == precision).map(|i| idle.swap_remove(i));
    drop(idle);
    Device { gpu: Some(found.unwrap_or_else(|| fresh(precision))), is_changed: false }
}

/// A device of its own.
pub(crate) fn fresh(precision: Precision) -> Gpu {
    pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap()
}

/// The engine of a plan's lanes.
pub(crate) fn engine(plan: &Plan, precision: Precision) -> Engine<'_> {
    Engine::Gpu(Box::new(pollster::block_on(engine::Gpu::new(plan, fresh(precision))).unwrap()))
}

/// A flow, a law and a lane for every cell and its start.
pub(crate) fn lanes(cells: &[(GearPair, State)]) -> (Vec<Oscillator>, Vec<Law>, Vec<Lane>) {
    let flows = cells.iter().map(|(pair, _)| pair.oscillator().unwrap()).collect();
    let laws = cells.iter().map(|(pair, _)| pair.law()).collect();
    let lanes = (0..).zip(cells).map(|(i, &(_, start))| Lane { flow: i, law: i, start }).collect();
    (flows, laws, lanes)
}

/// One record per cell and start.
pub(crate) fn run(gpu: &mut Gpu, cells: &[(GearPair, State)], settings: &LaneSettings) -> Vec<Record> {
    let (flows, laws, lanes) = lanes(cells);
    pollster::block_on(gpu.run(&flows, &laws, &lanes, settings)).unwrap()
}

/// One record per pair, from rest.
pub(crate) fn run_from_rest(gpu: &mut Gpu, pairs: &[GearPair], settings: &LaneSettings) -> Vec<Record> {
    let cells: Vec<_> = pairs.iter().map(|&pair| (pair, REST)).collect();
    run(gpu, &cells, settings)
}
