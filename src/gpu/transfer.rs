//! Bytes to the device and back.

use super::shader::Precision;
use super::signal::Signal;
use super::{Gpu, GpuError};

/// Numbers of structs of reals in the variant's precision.
pub(super) fn reals<T: bytemuck::Pod>(items: &[T], precision: Precision) -> Vec<u8> {
    match precision {
        Precision::F64 => bytemuck::cast_slice(items).to_vec(),
        Precision::F32 => {
            let numbers: &[f64] = bytemuck::cast_slice(items);
            let rounded: Vec<f32> = numbers.iter().map(|&x| x as f32).collect();
            bytemuck::cast_slice(&rounded).to_vec()
        }
    }
}

/// The reverse of [`reals`].
pub(super) fn from_reals<T: bytemuck::Pod>(bytes: &[u8], precision: Precision) -> Vec<T> {
    let numbers: Vec<f64> = match precision {
        Precision::F64 => return bytemuck::pod_collect_to_vec(bytes),
        Precision::F32 => {
            bytemuck::pod_collect_to_vec::<u8, f32>(bytes).iter().map(|&x| f64::from(x)).collect()
        }
    };
    bytemuck::pod_collect_to_vec(&numbers)
}

/// A storage buffer of `size` bytes.
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

/// A storage buffer that holds `bytes`.
pub(super) fn upload(gpu: &Gpu, label: &'static str, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = buffer(gpu, label, bytes.len());
    gpu.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// A buffer of `size` bytes that the host can read.
pub(super) fn readback(gpu: &Gpu, label: &'static str, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// The first `size` bytes of what a [`readback`] holds after the work up to `submission`, handed to `take`.
pub(super) async fn read<T>(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    size: u64,
    submission: wgpu::SubmissionIndex,
    take: impl FnOnce(&[u8]) -> T,
) -> Result<T, GpuError> {
    let lost = |message: String| gpu.failure(GpuError::Lost { message });
    let (mapped, send) = Signal::new();
    buffer.map_async(wgpu::MapMode::Read, ..size, send);
    gpu.poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None })?;
    mapped.await.map_err(|error| lost(error.to_string()))?;
    let taken = take(&buffer.get_mapped_range(..size).map_err(|error| lost(error.to_string()))?);
    buffer.unmap();
    Ok(taken)
}
