//! Rounds of dispatches over the lanes under way, until few enough are left.
//!
//! Each part of a round lists the lanes for which a variant has work, in the order of the active list, and dispatches them a few times. The
//! device computes how many workgroups they need. At its end the round counts the lanes that are left. The next round runs while the host
//! checks the last one, and while it reads results. Rounds are short, because some drivers reset a device whose work takes seconds, and
//! long enough that their overhead is small.

use web_time::{Duration, Instant};

use super::device::{COMPACT, EntryPoint, Pipelines, SWEEP};
use super::layout::{BEAT_AT, BLOCK, COUNT_AT, Settings};
use super::stage::{Clock, DeviceTimes};
use super::transfer::{Download, readback};
use super::{Gpu, GpuError, Precision};

/// Least number of iterations of a dispatch, which the first round uses. The overhead of a shorter dispatch would exceed its work.
pub(super) const FEWEST_ITERATIONS: u32 = 250;

/// Number of lanes for which a round of [`FEWEST_ITERATIONS`] is short on every device. With many more lanes fewer iterations are allowed,
/// because the duration of the first round is unknown and must not be longer.
const FEWEST_AT_ONCE: u32 = 1 << 14;

/// Largest assumed ratio of the times of f64 and f32 on hardware.
const SLOWER_IN_F64: u32 = 16;

/// Longest time for which results are held back until the last lanes end.
const LONGEST_HOLD: Duration = Duration::from_millis(500);

/// Largest number of variants of a pool.
const VARIANTS: usize = 3;

/// Byte offsets in a check. A check begins with the number of lanes left for each variant; the counter of compactions and the timestamps
/// follow.
const BEAT: u64 = 4 * VARIANTS as u64;
const TIMES: u64 = 16;

/// Byte offset of the iterations in the shader's settings; `ended` follows.
const ITERATIONS: u64 = std::mem::offset_of!(Settings, iterations) as u64;

/// Parts of a pool that its rounds use.
pub(super) struct Rounds<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) settings: &'a wgpu::Buffer,
    pub(super) queue: &'a wgpu::Buffer,
    /// All buffers, by binding.
    pub(super) buffers: &'a [&'a wgpu::Buffer],
    /// Length of the active list.
    pub(super) active_lanes: u32,
    /// Workgroups of a dispatch over the selected lanes, which the device has computed.
    pub(super) workgroups: &'a wgpu::Buffer,
    /// Largest number of iterations that one dispatch may spend on a lane.
    pub(super) most_iterations: u32,
}

/// A variant with its buffers.
struct BoundVariant<'a> {
    sweep: (&'a wgpu::ComputePipeline, wgpu::BindGroup),
    compact: Vec<(&'a wgpu::ComputePipeline, wgpu::BindGroup)>,
}

/// A round that has been submitted.
struct Round<'a> {
    check: &'a wgpu::Buffer,
    submission: wgpu::SubmissionIndex,
    /// The variants that it dispatched.
    ran: Vec<bool>,
    iterations: u32,
    /// Number of bytes of its check.
    bytes: u64,
}

impl Rounds<'_> {
    /// Runs lanes until at most `until` are left. Also stops if some lanes have ended and the policy's number of rounds has passed since
    /// the call; if `until` is zero, [`LONGEST_HOLD`] replaces this number. Then calls `conclude`, which submits the copies of results, and
    /// submits a further round that runs while the host reads them. `iterations` is the number for the first dispatch; on return, for the
    /// last one. `is_ahead` says whether the last call has sent such a further round. Each variant continues the lanes that the previous
    /// variant leaves. Returns the result of `conclude`, and the device's times if a watcher measures.
    pub(super) async fn run<C>(
        &self,
        variants: &[&Pipelines],
        until: u32,
        iterations: &mut u32,
        is_ahead: &mut bool,
        conclude: impl FnOnce() -> Result<C, GpuError>,
    ) -> Result<(C, Option<DeviceTimes>), GpuError> {
        let gpu = self.gpu;
        let dispatches = gpu.policy.parts * gpu.policy.dispatches * variants.len() as u32;
        let (clock, bound, checks) = gpu.call(|| {
            let clock = gpu.watcher.as_ref().and_then(|_| Clock::new(&gpu.device, &gpu.queue, dispatches));
            let bound: Vec<BoundVariant<'_>> =
                variants.iter().map(|pipelines| self.bound(pipelines)).collect();
            let checks = [(); 2].map(|()| readback(gpu, "check", TIMES + Clock::bytes(dispatches)));
            (clock, bound, checks)
        })?;
        // Number of lanes for which each variant may have work, without those that earlier variants pass on.
        let mut left = vec![0; variants.len()];
        left[0] = self.active_lanes;
        let most = self.most_iterations.max(1);
        let fewest = fewest_iterations(self.active_lanes, at_once(gpu)).min(most);
        *iterations = (*iterations).clamp(fewest, most);
        let (mut device, mut device_end) = (DeviceTimes::default(), None);
        let mut last_beat = 0;
        let mut before: Option<Round<'_>> = None;
        let mut last_end = Instant::now();
        let mut elapsed = Duration::ZERO;
        let mut checked = 0;
        for (slot, check) in (0..2).zip(&checks).cycle() {
            let sent =
                gpu.call(|| self.send(&bound, &left, *iterations, Some((slot, check)), clock.as_ref()))?;
            let Some(sent) = sent.and_then(|sent| before.replace(sent)) else { continue };
            let take = |bytes: &[u8]| {
                if let Some(clock) = &clock {
                    device = device.and(clock.times(&bytes[TIMES as usize..], &mut device_end));
                }
                bytemuck::pod_read_unaligned::<[u32; VARIANTS + 1]>(&bytes[..TIMES as usize])
            };
            let [counts @ .., beat] = sent.check(gpu, take).await?;
            if beat <= last_beat {
                return Err(gpu.failure(GpuError::Lost { message: "it executes no commands".into() }));
            }
            last_beat = beat;
            for (left, (now, ran)) in left.iter_mut().zip(counts.into_iter().zip(sent.ran)) {
                *left = if ran { now } else { 0 };
            }
            let all_left = left.iter().sum::<u32>();
            checked += 1;
            let took = match gpu.policy.simulated {
                Some(iteration) => iteration * (sent.iterations * dispatches),
                None => last_end.elapsed(),
            };
            last_end = Instant::now();
            elapsed += took;
            let has_waited = match until {
                0 => elapsed >= LONGEST_HOLD,
                _ => checked >= gpu.policy.patience,
            };
            if all_left <= until || gpu.is_halted() || has_waited && all_left < self.active_lanes {
                break;
            }
            // The round that was sent ahead belongs to the first measured time.
            if checked > 1 || !*is_ahead {
                *iterations = next_iterations(sent.iterations, took, gpu.policy.round).clamp(fewest, most);
            }
        }
        // The measured time includes the last round. All later work waits for this round anyway.
        if let (Some(clock), Some(sent)) = (&clock, before) {
            let take = |bytes: &[u8]| clock.times(&bytes[TIMES as usize..], &mut device_end);
            device = device.and(sent.check(gpu, take).await?);
        }
        let concluding = conclude()?;
        // While times are measured, no work may follow the last measured round.
        *is_ahead = gpu.watcher.is_none() && !gpu.is_halted() && left.iter().any(|&left| left > 0);
        if *is_ahead {
            gpu.call(|| self.send(&bound, &left, *iterations, None, None))?;
        }
        Ok((concluding, clock.map(|_| device)))
    }

    fn bound<'a>(&self, pipelines: &'a Pipelines) -> BoundVariant<'a> {
        let with = |pipeline: &'a wgpu::ComputePipeline, entry_point| {
            (pipeline, bind(self.gpu, pipeline, entry_point, self.buffers))
        };
        let compact = COMPACT.into_iter().zip(&pipelines.compact);
        BoundVariant {
            sweep: with(&pipelines.sweep, SWEEP),
            compact: compact.map(|(entry_point, pipeline)| with(pipeline, entry_point)).collect(),
        }
    }

    /// Submits a round: for each variant, the list of its lanes and its dispatches. With a check, a count of the lanes that each variant
    /// has left follows.
    fn send<'a>(
        &self,
        variants: &[BoundVariant<'_>],
        left: &[u32],
        iterations: u32,
        check: Option<(u32, &'a wgpu::Buffer)>,
        clock: Option<&Clock>,
    ) -> Option<Round<'a>> {
        let gpu = self.gpu;
        gpu.write(self.settings, ITERATIONS, bytemuck::cast_slice(&[iterations, 0]));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        // If a variant has work, all later variants may receive lanes from it.
        let first = left.iter().position(|&left| left > 0).unwrap_or(0);
        let slot = check.map_or(0, |(slot, _)| slot);
        let mut dispatches = 0;
        for part in 0..gpu.policy.parts {
            for (n, variant) in variants.iter().enumerate().skip(first) {
                for (nth, (pipeline, bindings)) in variant.compact.iter().enumerate() {
                    let is_first = part == 0 && n == first && nth == 0;
                    let writes = clock.and_then(|clock| clock.writes(slot, is_first, false));
                    let groups = compacting(nth, self.active_lanes);
                    dispatch(gpu, &mut encoder, pipeline, bindings, groups, writes);
                }
                let (pipeline, bindings) = &variant.sweep;
                for _ in 0..gpu.policy.dispatches {
                    let writes = clock.map(|clock| clock.dispatch_writes(slot, dispatches));
                    dispatch(gpu, &mut encoder, pipeline, bindings, Selected(self.workgroups), writes);
                    dispatches += 1;
                }
            }
        }
        let Some((_, check)) = check else {
            gpu.submit(encoder);
            return None;
        };
        for (n, variant) in variants.iter().enumerate().skip(first) {
            for (nth, (pipeline, bindings)) in variant.compact.iter().enumerate().take(COUNTED) {
                let is_last = n + 1 == variants.len() && nth + 1 == COUNTED;
                let writes = clock.and_then(|clock| clock.writes(slot, false, is_last));
                dispatch(gpu, &mut encoder, pipeline, bindings, compacting(nth, self.active_lanes), writes);
            }
            encoder.copy_buffer_to_buffer(self.queue, COUNT_AT, check, 4 * n as u64, 4);
        }
        encoder.copy_buffer_to_buffer(self.queue, BEAT_AT, check, BEAT, 4);
        let mut bytes = TIMES;
        if let Some(clock) = clock {
            clock.copy(&mut encoder, (slot, dispatches), check, TIMES);
            bytes += Clock::bytes(dispatches);
        }
        let submission = gpu.submit(encoder);
        let ran = (0..variants.len()).map(|n| n >= first).collect();
        Some(Round { check, submission, ran, iterations, bytes })
    }
}

impl Round<'_> {
    /// Waits for the round and passes its check to `take`.
    async fn check<T>(&self, gpu: &Gpu, take: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        let check = Download::new(gpu, self.check, self.bytes);
        gpu.wait(self.submission.clone())?;
        check.take(gpu, take).await
    }
}

/// Number of passes of the compaction after which the number of selected lanes is known.
const COUNTED: usize = 2;

/// Returns the workgroups of a pass of the compaction.
pub(super) fn compacting(pass: usize, active_lanes: u32) -> Workgroups<'static> {
    Counted([if pass == 1 { 1 } else { active_lanes.div_ceil(BLOCK).min(65_535) }, 1])
}

/// Returns the largest number of lanes that a device integrates with [`FEWEST_ITERATIONS`] in a short round.
fn at_once(gpu: &Gpu) -> u32 {
    match gpu.precision {
        Precision::F32 => gpu.policy.at_once,
        Precision::F64 => (gpu.policy.at_once / SLOWER_IN_F64).max(FEWEST_AT_ONCE),
    }
}

/// Returns the least number of iterations of a round with this number of lanes.
fn fewest_iterations(lanes: u32, at_once: u32) -> u32 {
    (FEWEST_ITERATIONS * at_once / lanes.max(1)).clamp(1, FEWEST_ITERATIONS)
}

/// Returns the number of iterations of a round that should take `round`, from an earlier round's iterations and duration. The number does
/// not affect results.
fn next_iterations(iterations: u32, took: Duration, round: Duration) -> u32 {
    let factor = round.as_secs_f64() / took.as_secs_f64().max(1e-6);
    (f64::from(iterations) * factor.clamp(0.25, 8.0)) as u32
}

/// Returns the number of workgroups in a row of the grid for this number of lanes.
pub(super) fn row(gpu: &Gpu, lanes: usize, workgroup: u32) -> u32 {
    let groups = (lanes as u32).div_ceil(workgroup).max(1);
    let widest = gpu.device.limits().max_compute_workgroups_per_dimension;
    groups.div_ceil(groups.div_ceil(widest))
}

/// Binds the buffers of an entry point.
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

/// Size of a dispatch.
pub(super) enum Workgroups<'a> {
    /// Columns and rows of workgroups.
    Counted([u32; 2]),
    /// The workgroups that the selected lanes need. The device has computed their number.
    Selected(&'a wgpu::Buffer),
}

pub(super) use Workgroups::{Counted, Selected};

pub(super) fn dispatch(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    bindings: &wgpu::BindGroup,
    workgroups: Workgroups<'_>,
    timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
) {
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, bindings, &[]);
    match workgroups {
        Counted([columns, rows]) => pass.dispatch_workgroups(columns, rows, 1),
        Selected(count) => pass.dispatch_workgroups_indirect(count, 0),
    }
    gpu.traffic.add_dispatch();
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROUND: Duration = Duration::from_millis(100);

    #[test]
    fn rounds_approach_their_desired_duration() {
        // 0.3 ms per iteration. The duration of a round becomes known while the next round runs.
        let (mut under_way, mut iterations) = (1000, 1000);
        for _ in 0..20 {
            let next = next_iterations(under_way, Duration::from_micros(300) * under_way, ROUND);
            (under_way, iterations) = (iterations, next);
        }
        assert!((300..=340).contains(&iterations), "{iterations}");
        assert!((300..=340).contains(&under_way), "{under_way}");
        assert_eq!(next_iterations(1000, Duration::ZERO, ROUND), 8000);
        assert_eq!(next_iterations(1000, Duration::from_secs(100), ROUND), 250);
        let fewest = |lanes| fewest_iterations(lanes, 1 << 14);
        assert_eq!([1, 1 << 14, 1 << 15, 1 << 20].map(fewest), [250, 250, 125, 3]);
    }
}
