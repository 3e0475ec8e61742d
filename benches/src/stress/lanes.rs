//! Lanes in every precision that the device has.

use rattlemap::gpu::{self, AdapterChoice, Gpu, GpuError, Lane, LaneSettings, Precision};
use rattlemap::record::Record;
use rattlemap_dynamics::model::{GearPair, State};

/// Cells are handed to a device so many at a time: every one has its own flow,
pub(super) const CHUNK: usize = 4096;
/// and its own phasors, one per step: fewer cells where there are more steps than this.
const STEPS_OF_CHUNK: usize = 1024;

/// A cell and where it starts.
pub(super) type Start = (GearPair, State);

/// Open devices, one per precision.
pub struct Lanes {
    devices: Vec<Gpu>,
}

impl Lanes {
    /// Opens the adapter that `map` would take, in f32 and, where it can, in f64.
    ///
    /// # Errors
    /// [`GpuError`] if there is no adapter, or it computes wrongly.
    pub async fn open(choice: &AdapterChoice) -> Result<Lanes, GpuError> {
        let mut devices = vec![Gpu::open(Precision::F32, choice).await?];
        match Gpu::open(Precision::F64, choice).await {
            Ok(device) => devices.push(device),
            // Not every device has double precision.
            Err(GpuError::NoAdapter { .. }) => {}
            Err(error) => return Err(error),
        }
        Ok(Lanes { devices })
    }

    /// The precisions there are.
    pub fn precisions(&self) -> Vec<Precision> {
        self.devices.iter().map(Gpu::precision).collect()
    }

    /// What the lanes run on, in words.
    pub fn device(&self) -> String {
        gpu::describe(self.devices[0].adapter())
    }

    /// Compiles shaders from here on as `rewrite` turns them.
    pub(super) fn rewrite(&mut self, rewrite: fn(String) -> String) {
        self.devices.iter_mut().for_each(|gpu| gpu.rewrite_shaders(rewrite));
    }

    /// One record per cell.
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
            let flows: Vec<_> =
                chunk.iter().map(|(pair, _)| pair.oscillator().expect("cells are made valid")).collect();
            let laws: Vec<_> = chunk.iter().map(|(pair, _)| pair.law()).collect();
            let lanes: Vec<_> =
                (0..).zip(chunk).map(|(i, &(_, start))| Lane { flow: i, law: i, start }).collect();
            let gpu = self.device_mut(precision);
            records.extend(pollster::block_on(gpu.run(&flows, &laws, &lanes, settings))?);
        }
        Ok(records)
    }

    fn device_mut(&mut self, precision: Precision) -> &mut Gpu {
        let found = self.devices.iter_mut().find(|gpu| gpu.precision() == precision);
        found.expect("the precision is one of `precisions`")
    }
}
