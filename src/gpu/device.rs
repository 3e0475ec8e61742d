//! Adapters: which there are, which one is taken, and opening it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::{Gpu, GpuError, Precision};

/// Which adapter to take.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AdapterChoice {
    /// Part of the adapter's name, in any case of letters; none takes the best.
    pub name: Option<String>,
}

/// Storage bindings of the shader, in order: flows, shapes, phasors, laws, cells, motions,
/// tallies, live; `true` where it writes.
const STORAGE: [bool; 8] = [false, false, false, false, false, true, true, true];

/// What went wrong on a device outside any error scope: its loss, or a command it refused.
/// Left alone, wgpu would panic.
pub(super) struct Trouble(Arc<Mutex<Option<String>>>);

impl Trouble {
    fn watch(device: &wgpu::Device) -> Trouble {
        let first = Arc::new(Mutex::new(None));
        let sink = || {
            let first = Arc::clone(&first);
            move |message: String| {
                first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
            }
        };
        let (refused, lost) = (sink(), sink());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| refused(error.to_string())));
        device.set_device_lost_callback(move |reason, message| lost(format!("{reason:?}: {message}")));
        Trouble(first)
    }

    /// The first thing that went wrong, if anything has.
    pub(super) fn message(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env())
}

/// All adapters of this machine and whether they have double precision, the best first.
pub async fn adapters() -> Vec<(wgpu::AdapterInfo, bool)> {
    let mut all: Vec<_> = instance()
        .enumerate_adapters(wgpu::Backends::all())
        .await
        .iter()
        .map(|adapter| (adapter.get_info(), has_doubles(adapter)))
        .collect();
    all.sort_by_key(|(info, _)| rank(info));
    all
}

fn has_doubles(adapter: &wgpu::Adapter) -> bool {
    adapter.features().contains(wgpu::Features::SHADER_F64)
}

/// Hardware before software, dedicated before integrated.
fn rank(info: &wgpu::AdapterInfo) -> u32 {
    match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::VirtualGpu => 1,
        wgpu::DeviceType::IntegratedGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

pub(super) async fn open(precision: Precision, choice: &AdapterChoice) -> Result<Gpu, GpuError> {
    let mut all = instance().enumerate_adapters(wgpu::Backends::all()).await;
    all.sort_by_key(|adapter| rank(&adapter.get_info()));
    let named = |adapter: &wgpu::Adapter| {
        let name = adapter.get_info().name.to_lowercase();
        choice.name.as_ref().is_none_or(|wanted| name.contains(&wanted.to_lowercase()))
    };
    let fits =
        |adapter: &wgpu::Adapter| named(adapter) && (precision == Precision::F32 || has_doubles(adapter));
    let Some(adapter) = all.iter().find(|adapter| fits(adapter)) else {
        return Err(no_adapter(precision, choice, &all));
    };
    let features = match precision {
        Precision::F32 => wgpu::Features::empty(),
        Precision::F64 => wgpu::Features::SHADER_F64,
    };
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("rattlemap"),
        required_features: features,
        required_limits: adapter.limits(),
        ..Default::default()
    };
    let info = adapter.get_info();
    let (device, queue) = adapter
        .request_device(&descriptor)
        .await
        .map_err(|source| GpuError::NoDevice { adapter: info.name.clone(), source })?;
    let layout = bind_group_layout(&device);
    let trouble = Trouble::watch(&device);
    Ok(Gpu {
        device,
        queue,
        info,
        precision,
        layout,
        pipelines: HashMap::new(),
        trouble,
        rewrite: |source| source,
    })
}

fn no_adapter(precision: Precision, choice: &AdapterChoice, all: &[wgpu::Adapter]) -> GpuError {
    let mut wanted = match precision {
        Precision::F32 => String::from("at all"),
        Precision::F64 => String::from("with double precision (SHADER_F64)"),
    };
    if let Some(name) = &choice.name {
        wanted = format!("called {name} {wanted}");
    }
    let list: Vec<String> = all
        .iter()
        .map(|adapter| {
            let doubles = if has_doubles(adapter) { "f32, f64" } else { "f32" };
            format!("{} ({doubles})", adapter.get_info().name)
        })
        .collect();
    let found = if list.is_empty() { String::from("none") } else { list.join(", ") };
    GpuError::NoAdapter { wanted, found }
}

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding: usize, ty: wgpu::BufferBindingType| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let storage = STORAGE
        .iter()
        .enumerate()
        .map(|(i, &writes)| entry(i + 1, wgpu::BufferBindingType::Storage { read_only: !writes }));
    let entries: Vec<_> =
        std::iter::once(entry(0, wgpu::BufferBindingType::Uniform)).chain(storage).collect();
    device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("lane"), entries: &entries })
}

/// Compiles a variant.
pub(super) async fn pipeline(gpu: &Gpu, variant: super::Variant) -> Result<wgpu::ComputePipeline, GpuError> {
    let device = &gpu.device;
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("lane"),
        source: wgpu::ShaderSource::Wgsl((gpu.rewrite)(variant.source()).into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("lane"),
        bind_group_layouts: &[Some(&gpu.layout)],
        immediate_size: 0,
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("lane"),
        layout: Some(&layout),
        module: &module,
        entry_point: Some("sweep"),
        compilation_options: Default::default(),
        cache: None,
    });
    match scope.pop().await {
        None => Ok(pipeline),
        Some(error) => Err(GpuError::Refused { what: "a shader", message: error.to_string() }),
    }
}
