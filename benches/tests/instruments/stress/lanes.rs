//! Runs cells in lanes, in every precision that the device has.

use super::cells::oscillator_of;
use rattlemap::gpu::{AdapterChoice, Gpu, GpuError, Lane, LaneSettings, Precision};
use rattlemap::record::Record;
use rattlemap_dynamics::model::{GearPair, State};

/// Largest number of cells in one run of a device. Each has its own flow.
const CHUNK: usize = 4096;
/// Above this number of steps per period a run has fewer cells, because each cell has a phasor per step.
const STEPS_OF_CHUNK: usize = 1024;

/// A cell and its start.
pub(super) type Start = (GearPair, State);

/// Open devices, one per precision.
pub(super) struct Lanes {
    devices: Vec<Gpu>,
}

impl Lanes {
    /// Opens the adapter that `map` would use, in f32 and, if the adapter can, in f64.
    pub(super) fn open() -> Lanes {
        let open = |precision| pollster::block_on(Gpu::open(precision, &AdapterChoice::default()));
        let double = match open(Precision::F64) {
            Err(GpuError::NoAdapter { .. }) => None,
            opened => Some(opened.unwrap()),
        };
        Lanes { devices: [open(Precision::F32).unwrap()].into_iter().chain(double).collect() }
    }

    /// Returns the precisions of the adapter.
    pub(super) fn precisions(&self) -> Vec<Precision> {
        self.devices.iter().map(Gpu::precision).collect()
    }

    /// Makes the following runs use shaders that `rewrite` returns.
    pub(super) fn rewrite(&mut self, rewrite: fn(String) -> String) {
        self.devices.iter_mut().for_each(|gpu| gpu.rewrite_shaders(rewrite));
    }

    /// Returns one record per cell.
    pub(super) fn run(
        &mut self,
        precision: Precision,
        cells: &[Start],
        settings: &LaneSettings,
    ) -> Vec<Record> {
        let mut records = Vec::with_capacity(cells.len());
        let steps = settings.steps_per_period.map_or(0, |steps| steps as usize);
        let most = CHUNK * STEPS_OF_CHUNK / steps.max(STEPS_OF_CHUNK);
        for chunk in cells.chunks(most.max(1)) {
            let flows: Vec<_> = chunk.iter().map(|(pair, _)| oscillator_of(pair)).collect();
            let laws: Vec<_> = chunk.iter().map(|(pair, _)| pair.law()).collect();
            let lanes: Vec<_> =
                (0..).zip(chunk).map(|(i, &(_, start))| Lane { flow: i, law: i, start }).collect();
            let gpu = self.devices.iter_mut().find(|gpu| gpu.precision() == precision);
            let gpu = gpu.expect("the precision is one of `precisions`");
            records.extend(pollster::block_on(gpu.run(&flows, &laws, &lanes, settings)).unwrap());
        }
        records
    }
}
