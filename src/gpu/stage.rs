//! How far lanes have come. Whoever measures is told, and keeps the clock.

/// What has just been done for lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stage {
    /// They are handed to the device.
    Uploaded,
    /// They have ended, or many of them.
    Integrated {
        /// Seconds between the first and the last pass of every submission, by the device's own
        /// clock; none if it has none.
        device_seconds: Option<f64>,
    },
    /// The records of those are here.
    Read,
}

/// Whoever is told.
pub(super) type Watcher = Box<dyn Fn(Stage) + Send + Sync>;

/// Bytes from one pair of timestamps to the next: as wgpu aligns them.
const PAIR: u64 = wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT;

/// Timestamps about the passes of a submission; two submissions are under way at a time.
pub(super) struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    seconds_per_tick: f64,
}

impl Clock {
    /// None if the device has no timestamps.
    pub(super) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Clock> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("clock"),
            ty: wgpu::QueryType::Timestamp,
            count: 4,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("clock"),
            size: 2 * PAIR,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Some(Clock { queries, resolved, seconds_per_tick: 1e-9 * f64::from(queue.get_timestamp_period()) })
    }

    /// What a pass of submission `slot` (0 or 1) writes; only the first and the last do.
    pub(super) fn writes(
        &self,
        slot: u32,
        is_first: bool,
        is_last: bool,
    ) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        (is_first || is_last).then(|| wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: is_first.then_some(2 * slot),
            end_of_pass_write_index: is_last.then_some(2 * slot + 1),
        })
    }

    /// Copies the pair of submission `slot` to `readback`, from byte `at` on.
    pub(super) fn copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        slot: u32,
        readback: &wgpu::Buffer,
        at: u64,
    ) {
        let from = PAIR * u64::from(slot);
        encoder.resolve_query_set(&self.queries, 2 * slot..2 * slot + 2, &self.resolved, from);
        encoder.copy_buffer_to_buffer(&self.resolved, from, readback, at, 16);
    }

    /// Seconds between a pair, as it was copied.
    pub(super) fn seconds(&self, pair: &[u8]) -> f64 {
        let tick = |at: usize| bytemuck::pod_read_unaligned::<u64>(&pair[at..at + 8]);
        tick(8).saturating_sub(tick(0)) as f64 * self.seconds_per_tick
    }
}
