//! Rounds of dispatches over the lanes under way, until few enough are running.
//!
//! Every round queues the lanes that a variant has work for, in the order of the roster, and dispatches them a
//! few times. The next round is under way while the host looks at the last one, which tells how many lanes are
//! left and how long it took: rounds are kept short enough for drivers that reset a device whose work takes
//! seconds, and long enough to cost nothing.

use web_time::{Duration, Instant};

use super::device::{COMPACT, EntryPoint, Pipelines, SWEEP, is_hardware};
use super::stage::Clock;
use super::transfer::{landing, read};
use super::{Gpu, GpuError};

/// Dispatches of one round.
const DISPATCHES: u32 = 4;

/// How long a round should take. Windows resets a device after two seconds; in software a round costs the more
/// the more lanes there are, on hardware nobody should wait for the end of one.
const ROUND_IN_SOFTWARE: Duration = Duration::from_millis(100);
const ROUND_ON_HARDWARE: Duration = Duration::from_millis(20);

/// Rounds after which lanes that have ended wait no longer for others.
const PATIENCE: u32 = 8;

/// Trips of the first round of all, and at least of any: shorter dispatches cost more than they do.
const FEWEST_TRIPS: u32 = 250;

/// Lanes of a workgroup that compacts (`BLOCK` in the shader).
const BLOCK: u32 = 256;

/// Bytes of a look: lanes left for each of two variants, two timestamps.
const LOOK: u64 = 24;
const TIMES: u64 = 8;

/// Byte offset of the trips in the shader's settings.
const TRIPS: u64 = std::mem::offset_of!(super::layout::Settings, trips) as u64;

/// What the host needs of a pool for its rounds.
pub(super) struct Rounds<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) settings: &'a wgpu::Buffer,
    pub(super) queue: &'a wgpu::Buffer,
    /// All buffers, by binding.
    pub(super) buffers: &'a [&'a wgpu::Buffer],
    /// Lanes of the roster.
    pub(super) rostered: u32,
    /// Workgroups for so many lanes.
    pub(super) grid: &'a dyn Fn(u32) -> [u32; 2],
    /// Most trips that one dispatch may spend on a lane.
    pub(super) most_trips: u32,
}

/// A variant, bound to the buffers.
struct Bound<'a> {
    sweep: (&'a wgpu::ComputePipeline, wgpu::BindGroup),
    compact: Vec<(&'a wgpu::ComputePipeline, wgpu::BindGroup)>,
}

/// A round under way.
struct Sent<'a> {
    look: &'a wgpu::Buffer,
    submission: wgpu::SubmissionIndex,
    /// Which variants it dispatched.
    ran: Vec<bool>,
    trips: u32,
}

impl Rounds<'_> {
    /// Runs lanes until no more than `until` are left, or, if that is not none, some have ended and waited for long
    /// enough; `trips` at first in a dispatch. Each variant takes over where the one before leaves off. Returns the
    /// device's own time where somebody measures.
    pub(super) async fn run(
        &self,
        variants: &[&Pipelines],
        until: u32,
        trips: &mut u32,
    ) -> Result<Option<f64>, GpuError> {
        let gpu = self.gpu;
        let clock = gpu.watcher.as_ref().and_then(|_| Clock::new(&gpu.device, &gpu.queue));
        let bound: Vec<Bound<'_>> = variants.iter().map(|pipelines| self.bound(pipelines)).collect();
        let looks = [landing(gpu, "look", LOOK), landing(gpu, "look", LOOK)];
        // Lanes that a variant may have work for, those aside that come from the ones before.
        let mut left = vec![0; variants.len()];
        left[0] = self.rostered;
        let most = self.most_trips.max(1);
        let round = if is_hardware(&gpu.info) { ROUND_ON_HARDWARE } else { ROUND_IN_SOFTWARE };
        *trips = (*trips).clamp(FEWEST_TRIPS.min(most), most);
        let mut seconds = 0.0;
        let mut before: Option<Sent<'_>> = None;
        let mut last_end = Instant::now();
        let mut looked = 0;
        for (slot, look) in (0..2).zip(&looks).cycle() {
            let sent = self.send(&bound, &left, *trips, (slot, look), clock.as_ref());
            let Some(sent) = before.replace(sent) else { continue };
            let take = |bytes: &[u8]| {
                let took = clock.as_ref().map_or(0.0, |clock| clock.seconds(&bytes[TIMES as usize..]));
                (bytemuck::pod_read_unaligned::<[u32; 2]>(&bytes[..8]), took)
            };
            let (now_left, took) = read(gpu, sent.look, LOOK, sent.submission, take).await?;
            seconds += took;
            for (left, (now, ran)) in left.iter_mut().zip(now_left.into_iter().zip(sent.ran)) {
                *left = if ran { now } else { 0 };
            }
            // A lane on its way from one variant to the next is counted in both.
            let all_left = left.iter().sum::<u32>();
            looked += 1;
            if all_left <= until || (until > 0 && looked >= PATIENCE && all_left < self.rostered) {
                break;
            }
            *trips = next_trips(sent.trips, last_end.elapsed(), round).clamp(FEWEST_TRIPS.min(most), most);
            last_end = Instant::now();
        }
        // The last round is in time, too; what comes next waits for it anyway.
        if let (Some(clock), Some(sent)) = (&clock, before) {
            let take = |bytes: &[u8]| clock.seconds(&bytes[TIMES as usize..]);
            seconds += read(gpu, sent.look, LOOK, sent.submission, take).await?;
        }
        Ok(clock.map(|_| seconds))
    }

    fn bound<'a>(&self, pipelines: &'a Pipelines) -> Bound<'a> {
        let with = |pipeline: &'a wgpu::ComputePipeline, entry_point| {
            (pipeline, bind(self.gpu, pipeline, entry_point, self.buffers))
        };
        let compact = COMPACT.into_iter().zip(&pipelines.compact);
        Bound {
            sweep: with(&pipelines.sweep, SWEEP),
            compact: compact.map(|(entry_point, pipeline)| with(pipeline, entry_point)).collect(),
        }
    }

    /// Submits a round: each variant's queue, then its dispatches.
    fn send<'a>(
        &self,
        variants: &[Bound<'_>],
        left: &[u32],
        trips: u32,
        (slot, look): (u32, &'a wgpu::Buffer),
        clock: Option<&Clock>,
    ) -> Sent<'a> {
        let gpu = self.gpu;
        gpu.queue.write_buffer(self.settings, TRIPS, bytemuck::bytes_of(&trips));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        // Lanes may come from the variants before, so that a variant has work if one of them has.
        let first = left.iter().position(|&left| left > 0).unwrap_or(0);
        let mut lanes = 0;
        for (n, variant) in variants.iter().enumerate().skip(first) {
            lanes += left[n];
            for (nth, (pipeline, bindings)) in (0..).zip(&variant.compact) {
                let writes = clock.and_then(|clock| clock.writes(slot, n == first && nth == 0, false));
                let blocks = if nth == 1 { 1 } else { self.rostered.div_ceil(BLOCK).min(65_535) };
                dispatch(&mut encoder, pipeline, bindings, [blocks, 1], writes);
            }
            encoder.copy_buffer_to_buffer(self.queue, 0, look, 4 * n as u64, 4);
            let (pipeline, bindings) = &variant.sweep;
            for nth in 1..=DISPATCHES {
                let is_last = n + 1 == variants.len() && nth == DISPATCHES;
                let writes = clock.and_then(|clock| clock.writes(slot, false, is_last));
                dispatch(&mut encoder, pipeline, bindings, (self.grid)(lanes), writes);
            }
        }
        if let Some(clock) = clock {
            clock.copy(&mut encoder, slot, look, TIMES);
        }
        let submission = gpu.queue.submit([encoder.finish()]);
        Sent { look, submission, ran: (0..variants.len()).map(|n| n >= first).collect(), trips }
    }
}

/// Trips for a round of the wanted length, from those of an earlier one and the time that it took.
/// What is done does not depend on it.
fn next_trips(trips: u32, took: Duration, round: Duration) -> u32 {
    let factor = round.as_secs_f64() / took.as_secs_f64().max(1e-6);
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
            let next = next_trips(under_way, Duration::from_micros(300) * under_way, ROUND_IN_SOFTWARE);
            (under_way, trips) = (trips, next);
        }
        assert!((300..=340).contains(&trips), "{trips}");
        assert!((300..=340).contains(&under_way), "{under_way}");
        assert_eq!(next_trips(1000, Duration::ZERO, ROUND_IN_SOFTWARE), 2000);
        assert_eq!(next_trips(1000, Duration::from_secs(100), ROUND_IN_SOFTWARE), 250);
    }
}
