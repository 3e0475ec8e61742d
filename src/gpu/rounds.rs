//! Rounds of dispatches over the lanes under way, until few enough are left.
//!
//! The device makes the lists of lanes (shaders/lists.wgsl) and computes how many workgroups each kernel needs. Then the lanes run for
//! some forcing periods. In each period, every integrating kernel is dispatched once, and then `observe`. At its end, a round counts the
//! lanes of each list. The next round runs while the host checks the last one, and while it reads results. Rounds are short, because some
//! drivers reset a device whose work takes seconds, and long enough that their overhead is small.

use web_time::{Duration, Instant};

use super::device::{EntryPoint, JUDGE, LIST, OBSERVE, SWEEP};
use super::dispatch_policy::DEDICATED;
use super::layout::{BLOCK, LISTS, List, Settings};
use super::stage::{Clock, DeviceTimes};
use super::transfer::{Download, readback};
use super::{Gpu, GpuError, Kernels, Precision, Variant};

/// Least number of iterations that a dispatch allows a lane, unless it has very many lanes.
const FEWEST_ITERATIONS: u32 = 250;

/// Number of lanes for which a round of [`FEWEST_ITERATIONS`] is short on every device. With many more lanes less is allowed, because the
/// duration of the first round is unknown and must not be longer.
const FEWEST_AT_ONCE: u32 = 1 << 14;

/// Largest number of periods between two makings of lists. A lane that has read a cycle waits for the end.
const MOST_PERIODS: u32 = 8;

// A round of four kernels has a pair of timestamps for each dispatch, two rounds are under way, and wgpu allows 4,096 timestamps.
const _: () = assert!(4 * (1 + DEDICATED.dispatches * (1 + 4 * MOST_PERIODS)) <= 4096);

/// Desired longest duration of a dispatch. The allowed number of iterations grows while dispatches are shorter.
const LONGEST_DISPATCH: Duration = Duration::from_millis(250);

/// Largest assumed ratio of the times of f64 and f32 on hardware.
const SLOWER_IN_F64: u32 = 16;

/// Longest time for which results are held back until the last lanes end.
const LONGEST_HOLD: Duration = Duration::from_millis(500);

/// Byte offsets in a check, which begins as the queue does: with the length of each list. The counter of lists and the timestamps follow.
const BEAT: u64 = 4 * LISTS as u64;
const TIMES: u64 = BEAT + 4;

/// Byte offset of the largest number of iterations in the shader's settings.
const LENGTH: u64 = std::mem::offset_of!(Settings, iterations) as u64;

/// Number of forcing periods between two makings of lists. For a lane with very many events, a dispatch ends after a number of loop
/// iterations instead of a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Length {
    periods: u32,
    iterations: u32,
}

impl Length {
    /// Returns the length for a number of lanes of which this length is for a share.
    pub(super) fn scaled(self, share: f64) -> Length {
        let scaled = |number: u32| (f64::from(number) * share) as u32;
        Length { periods: scaled(self.periods), iterations: scaled(self.iterations) }
    }

    /// Returns the length for rounds that should take `round`, after a round of this length and number of dispatches that `took` a time.
    /// Lengths do not affect results.
    fn next(self, took: Duration, round: Duration, dispatches: u32) -> Length {
        let scaled = |number: u32, target: Duration| {
            let factor = target.as_secs_f64() / took.as_secs_f64().max(1e-6);
            (f64::from(number) * factor.clamp(0.25, 8.0)) as u32
        };
        Length {
            periods: scaled(self.periods, round),
            iterations: scaled(self.iterations, LONGEST_DISPATCH * dispatches),
        }
    }

    fn within(self, least: Length, most_iterations: u32) -> Length {
        let fewest = least.iterations.min(most_iterations);
        Length {
            periods: self.periods.clamp(least.periods, MOST_PERIODS),
            iterations: self.iterations.clamp(fewest, most_iterations),
        }
    }

    /// Returns the duration of a dispatch on a simulated device.
    fn simulated(self, iteration: Duration) -> Duration {
        /// Iterations of a gear pair per forcing period.
        const PER_PERIOD: u32 = 80;
        iteration * self.periods * self.iterations.min(PER_PERIOD)
    }
}

/// Parts of a pool that its rounds use.
pub(super) struct Rounds<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) settings: &'a wgpu::Buffer,
    pub(super) queue: &'a wgpu::Buffer,
    /// All buffers, by binding.
    pub(super) buffers: &'a [&'a wgpu::Buffer],
    /// Length of the active list.
    pub(super) active_lanes: u32,
    /// Workgroups of dispatches over the lists, which the device has computed.
    pub(super) workgroups: &'a wgpu::Buffer,
    /// Largest number of iterations that one dispatch may spend on a lane.
    pub(super) most_iterations: u32,
}

/// The kernels of a pool with their buffers.
struct BoundKernels<'a> {
    lists: [(Bound<'a>, Workgroups<'static>); 3],
    /// The kernels of a forcing period, with their lists: those that integrate, and the one that observes.
    period: Vec<(Bound<'a>, List)>,
    judge: Option<Bound<'a>>,
}

/// A round that has been submitted.
struct Round<'a> {
    check: &'a wgpu::Buffer,
    submission: wgpu::SubmissionIndex,
    length: Length,
    /// Number of bytes of its check.
    bytes: u64,
}

impl Rounds<'_> {
    /// Runs lanes until at most `until` are left. Also stops if some lanes have ended and the policy's number of rounds has passed since
    /// the call; if `until` is zero, [`LONGEST_HOLD`] replaces this number. Then calls `conclude`, which submits the copies of results, and
    /// submits a further round that runs while the host reads them. `length` is that of the first dispatches; on return, of the last ones.
    /// `is_ahead` says whether the last call has sent such a further round. Returns the result of `conclude`, and the device's times if a
    /// watcher measures.
    pub(super) async fn run<C>(
        &self,
        kernels: &Kernels,
        until: u32,
        length: &mut Length,
        is_ahead: &mut bool,
        conclude: impl FnOnce() -> Result<C, GpuError>,
    ) -> Result<(C, Option<DeviceTimes>), GpuError> {
        let gpu = self.gpu;
        let (clock, bound, checks) = gpu.call(|| {
            let bound = self.bound(kernels);
            let dispatches = gpu.policy.dispatches * (1 + MOST_PERIODS * bound.period.len() as u32);
            let clock = gpu.watcher.as_ref().and_then(|_| Clock::new(&gpu.device, &gpu.queue, dispatches));
            let checks = [(); 2].map(|()| readback(gpu, "check", TIMES + Clock::bytes(dispatches)));
            (clock, bound, checks)
        })?;
        let most = self.most_iterations.max(1);
        let least = least_length(self.active_lanes, at_once(gpu), gpu.policy.first_periods);
        *length = length.within(least, most);
        let (mut device, mut device_end) = (DeviceTimes::default(), None);
        let mut last_beat = 0;
        let mut before: Option<Round<'_>> = None;
        let mut last_end = Instant::now();
        let mut elapsed = Duration::ZERO;
        let mut checked = 0;
        let mut left = self.active_lanes;
        for (slot, check) in (0..2).zip(&checks).cycle() {
            let sent = gpu.call(|| self.send(&bound, *length, Some((slot, check)), clock.as_ref()))?;
            let Some(sent) = sent.and_then(|sent| before.replace(sent)) else { continue };
            let take = |bytes: &[u8]| {
                if let Some(clock) = &clock {
                    device = device.and(clock.times(&bytes[TIMES as usize..], &mut device_end));
                }
                bytemuck::pod_read_unaligned::<[u32; LISTS + 1]>(&bytes[..TIMES as usize])
            };
            let [counts @ .., beat] = sent.check(gpu, take).await?;
            if beat <= last_beat {
                return Err(gpu.failure(GpuError::Lost { message: "it executes no commands".into() }));
            }
            last_beat = beat;
            left = self.active_lanes.saturating_sub(counts[List::Ended as usize]);
            checked += 1;
            let took = match gpu.policy.simulated {
                Some(iteration) => sent.length.simulated(iteration) * gpu.policy.dispatches,
                None => last_end.elapsed(),
            };
            last_end = Instant::now();
            elapsed += took;
            let has_waited = match until {
                0 => elapsed >= LONGEST_HOLD,
                _ => checked >= gpu.policy.patience,
            };
            if left <= until || gpu.is_halted() || has_waited && left < self.active_lanes {
                break;
            }
            // The round that was sent ahead belongs to the first measured time.
            if checked > 1 || !*is_ahead {
                *length = sent.length.next(took, gpu.policy.round, gpu.policy.dispatches).within(least, most);
            }
        }
        // The measured time includes the last round. All later work waits for this round anyway.
        if let (Some(clock), Some(sent)) = (&clock, before) {
            let take = |bytes: &[u8]| clock.times(&bytes[TIMES as usize..], &mut device_end);
            device = device.and(sent.check(gpu, take).await?);
        }
        let concluding = conclude()?;
        // While times are measured, no work may follow the last measured round.
        *is_ahead = gpu.watcher.is_none() && !gpu.is_halted() && left > 0;
        if *is_ahead {
            gpu.call(|| self.send(&bound, *length, None, None))?;
        }
        Ok((concluding, clock.map(|_| device)))
    }

    fn bound<'a>(&'a self, kernels: &Kernels) -> BoundKernels<'a> {
        let sweep = |variant: &Variant| (bind(self.gpu, variant, SWEEP, self.buffers), variant.list());
        let common = |entry_point| bind(self.gpu, &kernels.common, entry_point, self.buffers);
        let observe = (common(OBSERVE), List::Observe);
        BoundKernels {
            lists: making_lists(self.gpu, &kernels.common, self.buffers, self.active_lanes),
            period: kernels.sweeps.iter().map(sweep).chain([observe]).collect(),
            judge: kernels.judges.then(|| common(JUDGE)),
        }
    }

    /// Submits a round. With a check, the lengths of the lists follow.
    fn send<'a>(
        &self,
        kernels: &BoundKernels<'_>,
        length: Length,
        check: Option<(u32, &'a wgpu::Buffer)>,
        clock: Option<&Clock>,
    ) -> Option<Round<'a>> {
        let gpu = self.gpu;
        // Lanes with very many events must not make a round longer than its other lanes do.
        let iterations = (length.iterations / length.periods).max(FEWEST_ITERATIONS.min(length.iterations));
        gpu.write(self.settings, LENGTH, bytemuck::bytes_of(&iterations));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let slot = check.map_or(0, |(slot, _)| slot);
        let mut dispatches = 0;
        for _ in 0..gpu.policy.dispatches {
            let periods =
                (0..length.periods).flat_map(|_| &kernels.period).map(|(kernel, list)| (kernel, *list));
            // The judge has lists of its own: otherwise a lane would wait for it during the next periods.
            let judge = kernels.judge.iter().map(|judge| (judge, List::Judge));
            for (nth, (kernel, list)) in periods.chain(judge).enumerate() {
                let renews = nth == 0 || list == List::Judge;
                for (pass, (kernel, groups)) in kernels.lists.iter().enumerate().filter(|_| renews) {
                    let is_first = dispatches == 0 && pass == 0;
                    let writes = clock.and_then(|clock| clock.writes(slot, is_first, false));
                    dispatch(gpu, &mut encoder, kernel, *groups, writes);
                }
                let writes = clock.map(|clock| clock.dispatch_writes(slot, dispatches));
                dispatch(gpu, &mut encoder, kernel, Listed(self.workgroups, list), writes);
                dispatches += 1;
            }
        }
        let Some((_, check)) = check else {
            gpu.submit(encoder);
            return None;
        };
        for (pass, (kernel, groups)) in kernels.lists.iter().take(COUNTED).enumerate() {
            let writes = clock.and_then(|clock| clock.writes(slot, false, pass + 1 == COUNTED));
            dispatch(gpu, &mut encoder, kernel, *groups, writes);
        }
        encoder.copy_buffer_to_buffer(self.queue, 0, check, 0, TIMES);
        let mut bytes = TIMES;
        if let Some(clock) = clock {
            clock.copy(&mut encoder, (slot, dispatches), check, TIMES);
            bytes += Clock::bytes(dispatches);
        }
        let submission = gpu.submit(encoder);
        Some(Round { check, submission, length, bytes })
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

/// Number of passes after which the lengths of the lists are known.
const COUNTED: usize = 2;

/// Returns the passes that make the lists of this number of lanes, and their workgroups.
pub(super) fn making_lists<'g>(
    gpu: &'g Gpu,
    common: &Variant,
    buffers: &[&wgpu::Buffer],
    active_lanes: u32,
) -> [(Bound<'g>, Workgroups<'static>); 3] {
    let blocks = active_lanes.div_ceil(BLOCK).min(65_535);
    let [count, sum, place] = LIST.map(|entry_point| bind(gpu, common, entry_point, buffers));
    [(count, Counted([blocks, 1])), (sum, Counted([1, 1])), (place, Counted([blocks, 1]))]
}

/// Returns the byte offset of the length of a list in the queue.
pub(super) const fn count_at(list: List) -> u64 {
    4 * list as u64
}

/// Returns the largest number of lanes that a device integrates with [`FEWEST_ITERATIONS`] in a short round.
fn at_once(gpu: &Gpu) -> u32 {
    match gpu.precision {
        Precision::F32 => gpu.policy.at_once,
        Precision::F64 => (gpu.policy.at_once / SLOWER_IN_F64).max(FEWEST_AT_ONCE),
    }
}

/// Returns the least length of dispatches of this number of lanes, which the first round uses.
fn least_length(lanes: u32, at_once: u32, first_periods: u32) -> Length {
    let share = f64::from(at_once) / f64::from(lanes.max(1));
    let scaled = |most: u32| ((f64::from(most) * share) as u32).clamp(1, most);
    Length { periods: scaled(first_periods), iterations: scaled(FEWEST_ITERATIONS) }
}

/// Returns the number of workgroups in a row of the grid for this number of lanes.
pub(super) fn row(gpu: &Gpu, lanes: usize, workgroup: u32) -> u32 {
    let groups = (lanes as u32).div_ceil(workgroup).max(1);
    let widest = gpu.device.limits().max_compute_workgroups_per_dimension;
    groups.div_ceil(groups.div_ceil(widest))
}

/// A kernel with its buffers.
pub(super) struct Bound<'g> {
    pipeline: &'g wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
}

/// Binds the buffers of a kernel.
pub(super) fn bind<'g>(
    gpu: &'g Gpu,
    variant: &Variant,
    entry_point: EntryPoint,
    buffers: &[&wgpu::Buffer],
) -> Bound<'g> {
    let pipeline = gpu.pipeline(variant, entry_point);
    let entry = |&binding: &u32| wgpu::BindGroupEntry {
        binding,
        resource: buffers[binding as usize].as_entire_binding(),
    };
    let entries: Vec<_> = [0].iter().chain(entry_point.storage).map(entry).collect();
    let layout = &pipeline.get_bind_group_layout(0);
    let descriptor = wgpu::BindGroupDescriptor { label: None, layout, entries: &entries };
    Bound { pipeline, bindings: gpu.device.create_bind_group(&descriptor) }
}

/// Size of a dispatch.
#[derive(Clone, Copy)]
pub(super) enum Workgroups<'a> {
    /// Columns and rows of workgroups.
    Counted([u32; 2]),
    /// The workgroups that the lanes of a list need. The device has computed their number.
    Listed(&'a wgpu::Buffer, List),
}

pub(super) use Workgroups::{Counted, Listed};

pub(super) fn dispatch(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    kernel: &Bound<'_>,
    workgroups: Workgroups<'_>,
    timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
) {
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
    pass.set_pipeline(kernel.pipeline);
    pass.set_bind_group(0, &kernel.bindings, &[]);
    match workgroups {
        Counted([columns, rows]) => pass.dispatch_workgroups(columns, rows, 1),
        Listed(count, list) => pass.dispatch_workgroups_indirect(count, 12 * list as u64),
    }
    gpu.traffic.add_dispatch();
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROUND: Duration = Duration::from_millis(100);

    #[test]
    fn rounds_approach_their_desired_duration() {
        // 3 ms per period and dispatch. The duration of a round becomes known while the next round runs.
        let least = Length { periods: 1, iterations: 250 };
        let first = Length { periods: 16, iterations: 250 };
        let (mut under_way, mut length) = (first, first);
        for _ in 0..20 {
            let took = Duration::from_millis(3) * under_way.periods * 4;
            (under_way, length) = (length, under_way.next(took, ROUND, 4).within(least, 4000));
        }
        assert!((7..=9).contains(&length.periods), "{length:?}");
        assert_eq!(length.iterations, 4000);
        let long = Length { periods: 10, iterations: 1000 };
        let longest = Length { periods: 8, iterations: 4000 };
        assert_eq!(long.next(Duration::ZERO, ROUND, 4).within(least, 4000), longest);
        let slow = long.next(Duration::from_secs(100), ROUND, 4).within(least, 4000);
        assert_eq!(slow, Length { periods: 2, iterations: 250 });
        assert_eq!(long.scaled(0.01).within(least, 200), Length { periods: 1, iterations: 200 });
        let numbers = |lanes| {
            let Length { periods, iterations } = least_length(lanes, 1 << 14, 16);
            [periods, iterations]
        };
        let expected = [[16, 250], [16, 250], [8, 125], [1, 3]];
        assert_eq!([1, 1 << 14, 1 << 15, 1 << 20].map(numbers), expected);
    }
}
