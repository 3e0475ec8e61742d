//! Progress of lanes, for measurements.

/// A stage that lanes have reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stage {
    /// The device has received the lanes.
    Uploaded,
    /// All or many of the lanes have ended.
    Integrated {
        /// Times by the device's clock; `None` if the device has no clock.
        device: Option<DeviceTimes>,
    },
    /// The records of the lanes have been read.
    Read,
}

/// Times of lanes by the device's clock, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DeviceTimes {
    /// Time between the first and the last pass of each submission.
    pub busy: f64,
    /// Longest dispatch. Some drivers reset a device whose work takes seconds.
    pub longest_dispatch: f64,
    /// Time between submissions.
    pub idle: f64,
    /// Longest time between submissions.
    pub longest_gap: f64,
}

impl DeviceTimes {
    /// Returns the times of two successive measurements as one.
    pub fn and(self, other: DeviceTimes) -> DeviceTimes {
        DeviceTimes {
            busy: self.busy + other.busy,
            longest_dispatch: self.longest_dispatch.max(other.longest_dispatch),
            idle: self.idle + other.idle,
            longest_gap: self.longest_gap.max(other.longest_gap),
        }
    }
}

/// Function that is called at each stage.
pub(super) type Watcher = Box<dyn Fn(Stage) + Send + Sync>;

/// Bytes of a pair of timestamps: a beginning and an end.
const PAIR: u64 = 16;

/// Timestamps of a submission's passes: a pair for all passes, then one pair for each dispatch of lanes. Two
/// submissions are under way at a time.
pub(super) struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    seconds_per_tick: f64,
    /// Largest number of pairs of a submission.
    pairs: u32,
}

impl Clock {
    /// Returns the number of bytes that [`Clock::copy`] writes for a submission with this number of dispatches.
    pub(super) fn bytes(dispatches: u32) -> u64 {
        PAIR * u64::from(1 + dispatches)
    }

    /// Creates the clock of submissions with at most this number of dispatches; `None` if the device has no timestamps.
    pub(super) fn new(device: &wgpu::Device, queue: &wgpu::Queue, dispatches: u32) -> Option<Clock> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let pairs = 1 + dispatches;
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("clock"),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * 2 * pairs,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("clock"),
            size: 2 * stride(pairs),
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let seconds_per_tick = 1e-9 * f64::from(queue.get_timestamp_period());
        Some(Clock { queries, resolved, seconds_per_tick, pairs })
    }

    /// Returns the timestamps of a pass of submission `slot` (0 or 1). Only the first and the last pass have timestamps.
    pub(super) fn writes(
        &self,
        slot: u32,
        is_first: bool,
        is_last: bool,
    ) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let at = self.first_query(slot);
        (is_first || is_last).then(|| wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: is_first.then_some(at),
            end_of_pass_write_index: is_last.then_some(at + 1),
        })
    }

    /// Returns the timestamps of the `nth` dispatch of lanes.
    pub(super) fn dispatch_writes(&self, slot: u32, nth: u32) -> wgpu::ComputePassTimestampWrites<'_> {
        let at = self.first_query(slot) + 2 * (1 + nth);
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(at),
            end_of_pass_write_index: Some(at + 1),
        }
    }

    /// Copies the timestamps of submission `slot` with this number of dispatches to `readback`, from byte `at` on.
    pub(super) fn copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (slot, dispatches): (u32, u32),
        readback: &wgpu::Buffer,
        at: u64,
    ) {
        let (first, from) = (self.first_query(slot), stride(self.pairs) * u64::from(slot));
        let written = first..first + 2 * (1 + dispatches);
        encoder.resolve_query_set(&self.queries, written, &self.resolved, from);
        encoder.copy_buffer_to_buffer(&self.resolved, from, readback, at, Clock::bytes(dispatches));
    }

    /// Returns the times of a submission from its copied timestamps. `last_end` is the end of the previous submission; it is set to the end
    /// of this one.
    pub(super) fn times(&self, copied: &[u8], last_end: &mut Option<u64>) -> DeviceTimes {
        let tick = |at: usize| bytemuck::pod_read_unaligned::<u64>(&copied[at..at + 8]);
        let seconds = |from: u64, to: u64| to.saturating_sub(from) as f64 * self.seconds_per_tick;
        let pairs = (0..copied.len() / PAIR as usize).map(|n| n * PAIR as usize);
        let dispatch = |at: usize| seconds(tick(at), tick(at + 8));
        let (begin, end) = (tick(0), tick(8));
        let gap = last_end.replace(end).map_or(0.0, |last_end| seconds(last_end, begin));
        DeviceTimes {
            busy: seconds(begin, end),
            longest_dispatch: pairs.skip(1).map(dispatch).fold(0.0, f64::max),
            idle: gap,
            longest_gap: gap,
        }
    }

    fn first_query(&self, slot: u32) -> u32 {
        2 * self.pairs * slot
    }
}

/// Returns the number of bytes between the timestamps of the two submissions, in wgpu's alignment.
fn stride(pairs: u32) -> u64 {
    (PAIR * u64::from(pairs)).next_multiple_of(wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT)
}
