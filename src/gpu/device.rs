//! Opens adapters and compiles shaders.

use std::collections::HashMap;
use std::future::Future;
use std::sync::{Arc, Mutex, PoisonError};

use super::adapter::{AdapterChoice, AdapterReport, features, listed, no_adapter};
use super::dispatch_policy::DispatchPolicy;
use super::panics::{PanicFree, catch_panic};
use super::{Gpu, GpuError, Precision, Variant};

/// Whether the shader writes to each storage binding, from 1 on: flows, shapes, pairs, laws, cells, motions,
/// tallies, queue, starts, readings, findings, blocks, measured, workgroups.
const WRITES: [bool; 14] =
    [false, false, false, false, false, true, true, true, false, true, true, true, true, true];

/// An entry point of the shader and its storage bindings. There are at most eight, because every adapter supports eight.
#[derive(Clone, Copy, Debug)]
pub(super) struct EntryPoint {
    pub(super) name: &'static str,
    pub(super) storage: &'static [u32],
}

/// Puts lanes at their starts.
pub(super) const BEGIN: EntryPoint = EntryPoint { name: "begin", storage: &[1, 2, 5, 6, 7, 8, 9] };
/// Integrates lanes to their next stop phase.
pub(super) const SWEEP: EntryPoint = EntryPoint { name: "sweep", storage: &[1, 2, 3, 4, 5, 6, 7, 8] };
/// Observes lanes at their stop phase.
pub(super) const OBSERVE: EntryPoint = EntryPoint { name: "observe", storage: &[1, 2, 3, 4, 5, 6, 7, 8] };
/// Decides what follows for lanes that have read a cycle.
pub(super) const JUDGE: EntryPoint = EntryPoint { name: "judge_cycles", storage: &[1, 2, 3, 4, 5, 6, 7, 8] };
/// Makes the lists of lanes, in three passes.
pub(super) const LIST: [EntryPoint; 3] = [
    EntryPoint { name: "count_lanes", storage: &[7, 8, 12] },
    EntryPoint { name: "sum_lanes", storage: &[8, 12, 14] },
    EntryPoint { name: "place_lanes", storage: &[7, 8, 12] },
];
/// Writes the results of lanes.
pub(super) const CONCLUDE: EntryPoint = EntryPoint { name: "conclude", storage: &[1, 2, 5, 6, 7, 8, 10, 11] };

/// Copies what was measured on lanes.
pub(super) const GATHER: EntryPoint = EntryPoint { name: "gather", storage: &[6, 7, 8, 13] };

/// An entry point of a variant.
pub(super) type Kernel = (Variant, &'static str);

/// First failure of a device outside any error scope: its loss, or a refused command. It is stored by callbacks, without which wgpu would
/// panic.
pub(super) struct Trouble(Arc<Mutex<Option<String>>>);

impl Trouble {
    fn watch(device: &wgpu::Device) -> Trouble {
        let first = Arc::new(Mutex::new(None));
        let sink = || Trouble(Arc::clone(&first));
        let (refused, lost) = (sink(), sink());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| refused.note(error.to_string())));
        device.set_device_lost_callback(move |reason, message| lost.note(loss_reason(reason, &message)));
        Trouble(first)
    }

    /// Stores the first failure. Later failures are only its consequences.
    pub(super) fn note(&self, message: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
    }

    /// # Errors [`GpuError::Lost`] if a failure is stored.
    pub(super) fn check(&self) -> Result<(), GpuError> {
        self.message().map_or(Ok(()), |message| Err(GpuError::Lost { message }))
    }

    /// Returns the first failure.
    pub(super) fn message(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Describes why a device was lost.
fn loss_reason(reason: wgpu::DeviceLostReason, message: &str) -> String {
    match (reason, message) {
        (wgpu::DeviceLostReason::Unknown, "") => "its driver gives no reason".to_owned(),
        (wgpu::DeviceLostReason::Unknown, message) => format!("its driver says: {message}"),
        (wgpu::DeviceLostReason::Destroyed, _) => "it was destroyed".to_owned(),
    }
}

pub(super) async fn open(precision: Precision, choice: &AdapterChoice) -> Result<Gpu, GpuError> {
    let all = listed().await?;
    let fits = |report: &AdapterReport| choice.allows(report) && report.precisions.contains(&precision);
    let Some((AdapterReport { number, info, .. }, adapter)) = all.iter().find(|(report, _)| fits(report))
    else {
        let reports: Vec<AdapterReport> = all.into_iter().map(|(report, _)| report).collect();
        return Err(no_adapter(precision, choice, &reports));
    };
    let (number, info) = (*number, info.clone());
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("rattlemap"),
        required_features: features(precision) | (adapter.features() & wgpu::Features::TIMESTAMP_QUERY),
        required_limits: adapter.limits(),
        ..Default::default()
    };
    let no_device = |reason: String| GpuError::NoDevice { adapter: info.name.clone(), reason };
    let requested = catch_panic(|| adapter.request_device(&descriptor))
        .map_err(|why| no_device(format!("the driver failed while opening it ({why})")))?;
    let (device, queue) = requested.await.map_err(|error| no_device(error.to_string()))?;
    let trouble = Trouble::watch(&device);
    let pipelines = HashMap::new();
    let (queue, policy) = (PanicFree::new(queue), DispatchPolicy::of(&info));
    Ok(Gpu {
        device,
        queue,
        number,
        info,
        precision,
        pipelines,
        trouble,
        rewrite: None,
        policy,
        traffic: Default::default(),
        watcher: None,
        halt: Arc::default(),
    })
}

fn bind_group_layout(device: &wgpu::Device, entry_point: EntryPoint) -> wgpu::BindGroupLayout {
    let entry = |binding: u32, ty: wgpu::BufferBindingType| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let storage = |&binding: &u32| {
        let read_only = !WRITES[binding as usize - 1];
        entry(binding, wgpu::BufferBindingType::Storage { read_only })
    };
    let uniform = entry(0, wgpu::BufferBindingType::Uniform);
    let entries: Vec<_> = std::iter::once(uniform).chain(entry_point.storage.iter().map(storage)).collect();
    let label = Some(entry_point.name);
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries })
}

/// Compiles entry points of variants.
///
/// # Errors
/// [`GpuError::Refused`] if the driver does not compile one of them.
pub(super) async fn pipelines(
    gpu: &Gpu,
    kernels: &[(Variant, EntryPoint)],
) -> Result<Vec<(Kernel, wgpu::ComputePipeline)>, GpuError> {
    let mut modules = HashMap::new();
    for (variant, _) in kernels {
        if modules.contains_key(variant) {
            continue;
        }
        let source = gpu.rewrite.map_or_else(|| variant.source(), |rewrite| rewrite(variant.source()));
        let descriptor = || wgpu::ShaderModuleDescriptor {
            label: Some("lane"),
            source: wgpu::ShaderSource::Wgsl(source.as_str().into()),
        };
        modules.insert(*variant, compiling(gpu, &|| gpu.device.create_shader_module(descriptor())).await?);
    }
    let compiled = side_by_side(kernels, |(variant, entry_point)| {
        compiling(gpu, &|| pipeline(gpu, &modules[variant], *entry_point))
    });
    let mut made = Vec::with_capacity(kernels.len());
    for ((variant, entry_point), pipeline) in kernels.iter().zip(compiled) {
        made.push(((*variant, entry_point.name), pipeline.await?));
    }
    Ok(made)
}

/// Creates a part of a shader's program immediately, not when the future is polled. The future returns this part or the driver's error.
fn compiling<'g, T>(
    gpu: &'g Gpu,
    make: &dyn Fn() -> T,
) -> impl Future<Output = Result<T, GpuError>> + use<'g, T> {
    // wgpu reports errors of the driver's compiler as internal errors or as lack of memory.
    let filters =
        [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::Validation];
    let scopes = filters.map(|filter| gpu.device.push_error_scope(filter));
    let made = gpu.call(make);
    let errors: Vec<_> = scopes.into_iter().rev().map(wgpu::ErrorScopeGuard::pop).collect();
    async move {
        let mut refused = None;
        for error in errors {
            refused = refused.or(error.await);
        }
        match refused {
            None => made,
            Some(error) => {
                Err(gpu.failure(GpuError::Refused { what: "a shader", message: error.to_string() }))
            }
        }
    }
}

/// Applies `function` to all items, on all cores.
#[cfg(not(target_arch = "wasm32"))]
fn side_by_side<T: Sync, R: Send>(items: &[T], function: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
    use rayon::prelude::*;
    items.par_iter().with_max_len(1).map(function).collect()
}

/// Applies `function` to all items. A browser's device belongs to one thread.
#[cfg(target_arch = "wasm32")]
fn side_by_side<T, R>(items: &[T], function: impl Fn(&T) -> R) -> Vec<R> {
    items.iter().map(function).collect()
}

fn pipeline(gpu: &Gpu, module: &wgpu::ShaderModule, entry_point: EntryPoint) -> wgpu::ComputePipeline {
    let layout = bind_group_layout(&gpu.device, entry_point);
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(entry_point.name),
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry_point.name),
        layout: Some(&layout),
        module,
        entry_point: Some(entry_point.name),
        compilation_options: Default::default(),
        cache: None,
    })
}
