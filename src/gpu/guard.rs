//! Creates buffers; returns errors where wgpu would panic.

use super::{Gpu, GpuError};

/// Runs `make`, which creates and fills buffers for `count` items. `what` is their name in errors.
///
/// # Errors
/// [`GpuError::OutOfMemory`] if the device has no room for them; other errors of the device.
pub(super) async fn with_error_scopes<T>(
    gpu: &Gpu,
    what: &'static str,
    count: usize,
    make: impl FnOnce() -> T,
) -> Result<T, GpuError> {
    let out_of_memory = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    // wgpu also refuses commands on a buffer that could not be created.
    let refused = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
    let result = gpu.call(make);
    let (refused, out_of_memory) = (refused.pop(), out_of_memory.pop());
    let (refused, out_of_memory) = (refused.await, out_of_memory.await);
    if out_of_memory.is_some() {
        return Err(GpuError::OutOfMemory { what, count });
    }
    let Some(error) = refused else { return result };
    // A lost device refuses everything; polling it reports the loss.
    gpu.poll(wgpu::PollType::Poll)?;
    Err(gpu.failure(GpuError::Refused { what, message: error.to_string() }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{AdapterChoice, Precision};

    /// A texture of terabytes. wgpu limits buffers to sizes that most devices have.
    fn huge(gpu: &Gpu) -> wgpu::Texture {
        let limits = gpu.device.limits();
        let side = limits.max_texture_dimension_2d;
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("huge"),
            size: wgpu::Extent3d {
                width: side,
                height: side,
                depth_or_array_layers: limits.max_texture_array_layers,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        })
    }

    #[test]
    fn missing_memory_is_an_error() {
        let gpu = pollster::block_on(Gpu::open(Precision::F32, &AdapterChoice::default())).unwrap();
        let error = pollster::block_on(with_error_scopes(&gpu, "flows", 7, || huge(&gpu))).unwrap_err();
        assert!(matches!(error, GpuError::OutOfMemory { what: "flows", count: 7 }), "{error}");
        assert!(error.to_string().contains("no memory for 7 flows"), "{error}");
        assert_eq!(gpu.trouble.message(), None, "the error scope catches the error");
    }
}
