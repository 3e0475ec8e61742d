//! Rounds of dispatches over one batch, until no lane is running.
//!
//! Every round compacts the queue of running lanes and dispatches them a few times. The next
//! round is under way while the host looks at the last one, which tells how many lanes are left
//! and how long it took: rounds are kept short enough for drivers that reset a device whose work
//! takes seconds, and long enough to cost nothing.

use web_time::{Duration, Instant};

use super::device::{COMPACT, EntryPoint, Pipelines, SWEEP};
use super::stage::Clock;
use super::transfer::{landing, read};
use super::{Gpu, GpuError};

/// Dispatches of one round.
const DISPATCHES: u32 = 4;

/// How long a round should take. Windows resets a device after two seconds.
const ROUND: Duration = Duration::from_millis(100);

/// Trips of the first round of all, and at least of any: shorter dispatches cost more than they do.
const FEWEST_TRIPS: u32 = 250;

/// Lanes of a workgroup that compacts (`BLOCK` in the shader).
const BLOCK: u32 = 256;

/// Bytes of a look: lanes left, room, two timestamps.
const LOOK: u64 = 24;
const TIMES: u64 = 8;

/// Byte offset of the trips in the shader's settings.
const TRIPS: u64 = std::mem::offset_of!(super::layout::Settings, trips) as u64;

/// What the host needs of a batch for its rounds.
pub(super) struct Rounds<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) settings: &'a wgpu::Buffer,
    pub(super) queue: &'a wgpu::Buffer,
    /// All buffers, by binding.
    pub(super) buffers: &'a [&'a wgpu::Buffer],
    pub(super) lanes: u32,
    pub(super) workgroup: u32,
    /// Most trips that one dispatch may spend on a lane.
    pub(super) most_trips: u32,
    /// Workgroups in a row of the grid.
    pub(super) row: u32,
}

impl Rounds<'_> {
    /// Runs every variant to its end, one after the other. Returns the device's own time where
    /// somebody measures.
    pub(super) async fn run(&self, variants: &[&Pipelines]) -> Result<Option<f64>, GpuError> {
        let clock = self.gpu.watcher.as_ref().and_then(|_| Clock::new(&self.gpu.device, &self.gpu.queue));
        let mut seconds = 0.0;
        for pipelines in variants {
            seconds += self.run_variant(pipelines, clock.as_ref()).await?;
        }
        Ok(clock.map(|_| seconds))
    }

    async fn run_variant(&self, pipelines: &Pipelines, clock: Option<&Clock>) -> Result<f64, GpuError> {
        let gpu = self.gpu;
        // All lanes are looked at anew: those that waited for this variant are left.
        let everyone: Vec<u32> = [self.lanes, 0, self.lanes].into_iter().chain(0..self.lanes).collect();
        gpu.queue.write_buffer(self.queue, 0, bytemuck::cast_slice(&everyone));
        let looks = [landing(gpu, "look", LOOK), landing(gpu, "look", LOOK)];
        let sweep = bind(gpu, &pipelines.sweep, SWEEP, self.buffers);
        let compact: Vec<_> = COMPACT
            .into_iter()
            .zip(&pipelines.compact)
            .map(|(entry_point, pipeline)| (pipeline, bind(gpu, pipeline, entry_point, self.buffers)))
            .collect();
        let (mut left, mut seconds) = (self.lanes, 0.0);
        let most = self.most_trips.max(1);
        let mut trips = FEWEST_TRIPS.min(most);
        let mut before: Option<(&wgpu::Buffer, wgpu::SubmissionIndex, u32)> = None;
        let mut last_end = Instant::now();
        for (slot, look) in (0..2).zip(&looks).cycle() {
            gpu.queue.write_buffer(self.settings, TRIPS, bytemuck::bytes_of(&trips));
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            for (nth, (pipeline, bindings)) in (0..).zip(&compact) {
                let writes = clock.and_then(|clock| clock.writes(slot, nth == 0, false));
                let blocks = self.lanes.div_ceil(BLOCK).min(65_535);
                let groups = if nth == 1 || nth == 3 { 1 } else { blocks };
                dispatch(&mut encoder, pipeline, bindings, [groups, 1], writes);
            }
            encoder.copy_buffer_to_buffer(self.queue, 0, look, 0, 4);
            let groups = self.grid(left);
            for nth in 1..=DISPATCHES {
                let writes = clock.and_then(|clock| clock.writes(slot, false, nth == DISPATCHES));
                dispatch(&mut encoder, &pipelines.sweep, &sweep, groups, writes);
            }
            if let Some(clock) = clock {
                clock.copy(&mut encoder, slot, look, TIMES);
            }
            let submission = gpu.queue.submit([encoder.finish()]);
            let Some((look, submission, its_trips)) = before.replace((look, submission, trips)) else {
                continue;
            };
            let take = |bytes: &[u8]| {
                let took = clock.map_or(0.0, |clock| clock.seconds(&bytes[TIMES as usize..]));
                (bytemuck::pod_read_unaligned::<u32>(&bytes[..4]), took)
            };
            let (now_left, took) = read(gpu, look, submission, take).await?;
            seconds += took;
            left = now_left;
            if left == 0 {
                break;
            }
            trips = next_trips(its_trips, last_end.elapsed()).clamp(FEWEST_TRIPS.min(most), most);
            last_end = Instant::now();
        }
        Ok(seconds)
    }

    /// Workgroups for so many lanes.
    pub(super) fn grid(&self, lanes: u32) -> [u32; 2] {
        let groups = lanes.div_ceil(self.workgroup).max(1);
        [groups.min(self.row), groups.div_ceil(self.row)]
    }
}

/// Trips for a round of the wanted length, from those of an earlier one and the time that it took.
/// What is done does not depend on it.
fn next_trips(trips: u32, took: Duration) -> u32 {
    let factor = ROUND.as_secs_f64() / took.as_secs_f64().max(1e-6);
    (f64::from(trips) * factor.clamp(0.25, 2.0)) as u32
}

/// Workgroups in a row of the grid for so many lanes.
pub(super) fn row(gpu: &Gpu, lanes: usize, workgroup: u32) -> u32 {
    let groups = (lanes as u32).div_ceil(workgroup).max(1);
    let widest = gpu.device.limits().max_compute_workgroups_per_dimension;
    groups.div_ceil(groups.div_ceil(widest))
}

/// The buffers of an entry point.
pub(super) fn bind(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    entry_point: EntryPoint,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entry = |&binding: &u32| wgpu::BindGroupEntry {
        binding,
        resource: buffers[binding as usize].as_entire_binding(),
    };
    let entries: Vec<_> = [0].iter().chain(entry_point.storage).map(entry).collect();
    let layout = &pipeline.get_bind_group_layout(0);
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

pub(super) fn dispatch(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    bindings: &wgpu::BindGroup,
    groups: [u32; 2],
    timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
) {
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, bindings, &[]);
    pass.dispatch_workgroups(groups[0], groups[1], 1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_tend_to_their_length() {
        // 0.3 ms per trip; what a round took is known when the next one is already under way.
        let (mut under_way, mut trips) = (1000, 1000);
        for _ in 0..20 {
            let next = next_trips(under_way, Duration::from_micros(300) * under_way);
            (under_way, trips) = (trips, next);
        }
        assert!((300..=340).contains(&trips), "{trips}");
        assert!((300..=340).contains(&under_way), "{under_way}");
        assert_eq!(next_trips(1000, Duration::ZERO), 2000);
        assert_eq!(next_trips(1000, Duration::from_secs(100)), 250);
    }
}
