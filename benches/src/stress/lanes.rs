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
pub struct Lanes {
    devices: Vec<Gpu>,
}

impl Lanes {
    /// Opens the adapter that `map` would use, in f32 and, if the adapter can, in f64.
    ///
    /// # Errors
    /// [`GpuError`] if there is no adapter, or if it computes wrong results.
    pub async fn open(choice: &AdapterChoice) -> Result<Lanes, GpuError> {
        let mut devices = vec![Gpu::open(Precision::F32, choice).await?];
        match Gpu::open(Precision::F64, choice).await {
            Ok(device) => devices.push(device),
            Err(GpuError::NoAdapter { .. }) => {}
            Err(error) => return Err(error),
        }
        Ok(Lanes { devices })
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
    ///
    /// # Errors
    /// [`GpuError`].
    pub(super) fn run(
        &mut self,
        precision: Precision,
        cells: &[Start],
        settings: &LaneSettings,
    ) -> Result<Vec<Record>, GpuError> {
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
            records.extend(pollster::block_on(gpu.run(&flows, &laws, &lanes, settings))?);
        }
        Ok(records)
    }
}
