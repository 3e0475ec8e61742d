//! Transfers of bytes to and from the device.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::layout::LISTS;
use super::precision::Precision;
use super::signal::Signal;
use super::{Gpu, GpuError};

/// Converts structs of real numbers to bytes in a precision.
pub(super) fn reals<'a, T: bytemuck::Pod>(
    items: impl IntoIterator<Item = &'a T>,
    precision: Precision,
) -> Vec<u8> {
    let items = items.into_iter();
    let size = size_of::<T>() / size_of::<f64>() * precision.bytes();
    let mut bytes = Vec::with_capacity(items.size_hint().0 * size);
    for item in items {
        let from = bytes.len();
        bytes.resize(from + size, 0);
        match precision {
            Precision::F64 => bytes[from..].copy_from_slice(bytemuck::bytes_of(item)),
            Precision::F32 => {
                let numbers = bytemuck::cast_slice::<T, f64>(std::slice::from_ref(item));
                for (place, &x) in bytes[from..].chunks_exact_mut(size_of::<f32>()).zip(numbers) {
                    place.copy_from_slice(&(x as f32).to_ne_bytes());
                }
            }
        }
    }
    bytes
}

/// Converts bytes in a precision to real numbers.
pub(super) fn from_reals(bytes: &[u8], precision: Precision) -> Vec<f64> {
    let widened = |bytes: &[u8]| f64::from(bytemuck::pod_read_unaligned::<f32>(bytes));
    match precision {
        Precision::F64 => bytemuck::pod_collect_to_vec(bytes),
        Precision::F32 => bytes.par_chunks_exact(size_of::<f32>()).map(widened).collect(),
    }
}

/// Creates a storage buffer of `size` bytes.
pub(super) fn buffer(gpu: &Gpu, label: &'static str, size: usize) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: size.max(16) as u64,
        usage: wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::UNIFORM
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

/// Creates a buffer for the number of workgroups of a dispatch, which the device computes.
pub(super) fn indirect(gpu: &Gpu) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("workgroups"),
        size: (12 * LISTS) as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT,
        mapped_at_creation: false,
    })
}

/// Creates a storage buffer that holds `bytes`.
pub(super) fn upload(gpu: &Gpu, label: &'static str, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = buffer(gpu, label, bytes.len());
    gpu.write(&buffer, 0, bytes);
    buffer
}

/// Creates a buffer of `size` bytes that the host can read.
pub(super) fn readback(gpu: &Gpu, label: &'static str, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// The first bytes of a [`readback`] buffer, on their way to the host.
pub(super) struct Download<'b> {
    buffer: &'b wgpu::Buffer,
    size: u64,
    mapped: Signal<Result<(), wgpu::BufferAsyncError>>,
}

impl<'b> Download<'b> {
    /// Requests the first `size` bytes, after all work that has been submitted.
    pub(super) fn new(gpu: &Gpu, buffer: &'b wgpu::Buffer, size: u64) -> Download<'b> {
        let (mapped, send) = Signal::new();
        buffer.map_async(wgpu::MapMode::Read, ..size, send);
        gpu.traffic.add(4, size);
        Download { buffer, size, mapped }
    }

    /// Passes the bytes to `take`. Native drivers deliver them in [`Gpu::wait`].
    pub(super) async fn take<T>(self, gpu: &Gpu, take: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        // The buffer stays mapped, so no further copy into it is possible.
        let lost = |message: String| {
            gpu.trouble.note(message.clone());
            gpu.failure(GpuError::Lost { message })
        };
        self.mapped.await.map_err(|error| lost(error.to_string()))?;
        let mapped = self.buffer.get_mapped_range(..self.size).map_err(|error| lost(error.to_string()))?;
        let value = take(&mapped);
        drop(mapped);
        self.buffer.unmap();
        Ok(value)
    }
}

/// Amount of work that the host has given to a device since the device was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Dispatches of shaders.
    pub dispatches: u64,
    /// Submissions of commands.
    pub submissions: u64,
    /// Submissions whose results the host has waited for.
    pub waits: u64,
    /// Bytes written to buffers of the device.
    pub written_bytes: u64,
    /// Bytes read from buffers of the device.
    pub read_bytes: u64,
}

/// Counts the [`Traffic`] of a device.
#[derive(Debug, Default)]
pub(super) struct TrafficCounter([AtomicU64; 5]);

impl TrafficCounter {
    fn add(&self, place: usize, count: u64) {
        self.0[place].fetch_add(count, Ordering::Relaxed);
    }

    pub(super) fn add_dispatch(&self) {
        self.add(0, 1);
    }

    fn sum(&self) -> Traffic {
        let [dispatches, submissions, waits, written_bytes, read_bytes] =
            self.0.each_ref().map(|count| count.load(Ordering::Relaxed));
        Traffic { dispatches, submissions, waits, written_bytes, read_bytes }
    }
}

impl Gpu {
    /// Returns the work that the device has received since it was opened.
    pub fn traffic(&self) -> Traffic {
        self.traffic.sum()
    }

    /// Submits the commands of an encoder.
    pub(super) fn submit(&self, encoder: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        self.traffic.add(1, 1);
        self.queue.submit([encoder.finish()])
    }

    /// Waits until the work up to a submission is done.
    pub(super) fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        self.traffic.add(2, 1);
        let timeout = Some(self.policy.longest_wait);
        self.poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout })
    }

    /// Writes bytes to a buffer before the next submission.
    pub(super) fn write(&self, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
        self.traffic.add(3, bytes.len() as u64);
        self.queue.write_buffer(buffer, offset, bytes);
    }
}
