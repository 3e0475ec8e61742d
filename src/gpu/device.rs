//! Adapters: which there are, which one is taken, and opening it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::caught::{Dropped, caught};
use super::dispatch_policy::DispatchPolicy;
use super::layout::{Motion, Tally};
use super::{Gpu, GpuError, Precision};

/// What narrows the adapters down in the environment: the first is wgpu's own.
const BACKEND: &str = "WGPU_BACKEND";
const ADAPTER_NAME: &str = "WGPU_ADAPTER_NAME";

/// Which adapter to take.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AdapterChoice {
    /// Part of the adapter's name, or of what [`describe`] says of it, in any case of letters;
    /// none takes the best.
    pub name: Option<String>,
}

/// Storage bindings of the shader by number: flows, shapes, phasors, laws, cells, motions,
/// tallies, queue, starts, readings, findings, blocks; `true` where it writes.
const WRITES: [bool; 12] = [false, false, false, false, false, true, true, true, false, true, true, true];

/// An entry point of the shader and the storage that it touches: no more than eight buffers,
/// which every adapter has.
#[derive(Clone, Copy, Debug)]
pub(super) struct EntryPoint {
    name: &'static str,
    pub(super) storage: &'static [u32],
}

/// Puts every lane at its start.
pub(super) const BEGIN: EntryPoint = EntryPoint { name: "begin", storage: &[1, 2, 5, 6, 7, 8, 9] };
/// Integrates.
pub(super) const SWEEP: EntryPoint = EntryPoint { name: "sweep", storage: &[1, 2, 3, 4, 5, 6, 7, 8] };
/// Queues the lanes that a variant has work for, one after the other.
pub(super) const COMPACT: [EntryPoint; 3] = [
    EntryPoint { name: "count_left", storage: &[7, 8, 12] },
    EntryPoint { name: "sum_left", storage: &[8, 12] },
    EntryPoint { name: "move_left", storage: &[7, 8, 12] },
];
/// Makes records.
pub(super) const CONCLUDE: EntryPoint = EntryPoint { name: "conclude", storage: &[1, 2, 5, 6, 7, 8, 10, 11] };

/// The pipelines of one variant.
pub(super) struct Pipelines {
    pub(super) begin: wgpu::ComputePipeline,
    pub(super) sweep: wgpu::ComputePipeline,
    pub(super) compact: [wgpu::ComputePipeline; 3],
    pub(super) conclude: wgpu::ComputePipeline,
}

/// What went wrong on a device outside any error scope: its loss, or a command it refused.
/// Left alone, wgpu would panic.
pub(super) struct Trouble(Arc<Mutex<Option<String>>>);

impl AdapterChoice {
    /// Whether an adapter may be taken.
    pub fn allows(&self, info: &wgpu::AdapterInfo) -> bool {
        let name = describe(info).to_lowercase();
        self.name.as_ref().is_none_or(|wanted| name.contains(&wanted.to_lowercase()))
    }

    /// The adapter that the environment names by `WGPU_ADAPTER_NAME`, else the best.
    pub fn from_environment() -> AdapterChoice {
        AdapterChoice { name: std::env::var(ADAPTER_NAME).ok().filter(|name| !name.is_empty()) }
    }
}

impl Trouble {
    fn watch(device: &wgpu::Device) -> Trouble {
        let first = Arc::new(Mutex::new(None));
        let sink = || Trouble(Arc::clone(&first));
        let (refused, lost) = (sink(), sink());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| refused.note(error.to_string())));
        device.set_device_lost_callback(move |reason, message| lost.note(told(reason, &message)));
        Trouble(first)
    }

    /// Takes down what went wrong; what follows from it says less.
    pub(super) fn note(&self, message: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
    }

    /// # Errors
    /// [`GpuError::Lost`] once something has gone wrong.
    pub(super) fn check(&self) -> Result<(), GpuError> {
        self.message().map_or(Ok(()), |message| Err(GpuError::Lost { message }))
    }

    /// The first thing that went wrong, if anything has.
    pub(super) fn message(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Why a device was lost.
fn told(reason: wgpu::DeviceLostReason, message: &str) -> String {
    match (reason, message) {
        (wgpu::DeviceLostReason::Unknown, "") => "its driver gives no reason".to_owned(),
        (wgpu::DeviceLostReason::Unknown, message) => format!("its driver says: {message}"),
        (wgpu::DeviceLostReason::Destroyed, _) => "it was destroyed".to_owned(),
    }
}

fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env())
}

/// What an adapter offers.
#[derive(Clone, Debug)]
pub struct AdapterReport {
    /// Name, kind, driver.
    pub info: wgpu::AdapterInfo,
    /// Precisions that lanes can have on it.
    pub precisions: Vec<Precision>,
    /// Largest storage buffer that a shader sees, in bytes.
    pub largest_binding: u64,
    /// Lanes that may be under way at a time.
    pub most_lanes: usize,
}

/// All adapters of this machine, the best first.
pub async fn adapters() -> Vec<AdapterReport> {
    let report = |adapter: &wgpu::Adapter| AdapterReport {
        info: adapter.get_info(),
        precisions: Precision::ALL.into_iter().filter(|&p| has(adapter, p)).collect(),
        largest_binding: adapter.limits().max_storage_buffer_binding_size,
        most_lanes: most_slots(&adapter.limits()),
    };
    all_adapters().await.unwrap_or_default().iter().map(report).collect()
}

async fn all_adapters() -> Result<Vec<wgpu::Adapter>, GpuError> {
    let list = caught(|| instance().enumerate_adapters(wgpu::Backends::all()));
    let mut all = list.map_err(|message| GpuError::Refused { what: "to list its adapters", message })?.await;
    all.sort_by_key(|adapter| rank(&adapter.get_info()));
    Ok(all)
}

/// An adapter in words: name, interface and driver, as manifests have it.
pub fn describe(info: &wgpu::AdapterInfo) -> String {
    let driver = [info.driver.as_str(), info.driver_info.as_str()].join(" ");
    format!("{} ({:?}; {})", info.name, info.backend, driver.trim())
}

/// Whether an adapter is more than a program on the processor.
pub fn is_hardware(info: &wgpu::AdapterInfo) -> bool {
    info.device_type != wgpu::DeviceType::Cpu
}

fn has(adapter: &wgpu::Adapter, precision: Precision) -> bool {
    adapter.features().contains(features(precision))
}

fn features(precision: Precision) -> wgpu::Features {
    match precision {
        Precision::F32 => wgpu::Features::empty(),
        Precision::F64 => wgpu::Features::SHADER_F64,
    }
}

/// Hardware before software, dedicated before integrated; of the interfaces to one adapter the
/// one that offers most.
fn rank(info: &wgpu::AdapterInfo) -> (u32, u32) {
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::VirtualGpu => 1,
        wgpu::DeviceType::IntegratedGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    let interface = match info.backend {
        wgpu::Backend::Vulkan => 0,
        wgpu::Backend::Metal => 1,
        wgpu::Backend::Dx12 => 2,
        wgpu::Backend::Gl => 3,
        wgpu::Backend::BrowserWebGpu | wgpu::Backend::Noop => 4,
    };
    (kind, interface)
}

/// Why an adapter comes before or after itself by another interface.
pub fn interface_rank(info: &wgpu::AdapterInfo) -> &'static str {
    match info.backend {
        wgpu::Backend::Vulkan => "first choice: the only interface with f64",
        wgpu::Backend::Metal => "second to Vulkan: no f64",
        wgpu::Backend::Dx12 => "second to Vulkan: no f64 here",
        wgpu::Backend::Gl => "last choice: no f64, smaller buffers, no clock of its own",
        wgpu::Backend::BrowserWebGpu | wgpu::Backend::Noop => "last choice",
    }
}

/// Slots that a pool has at most: below 1 GB on the device.
const MOST_SLOTS: usize = 1 << 19;

/// Slots that an adapter's limits allow.
pub(super) fn most_slots(limits: &wgpu::Limits) -> usize {
    let largest = size_of::<Motion>().max(size_of::<Tally>()) as u64;
    let by_binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / largest;
    let by_grid = u64::from(limits.max_compute_workgroups_per_dimension).pow(2);
    by_binding.min(by_grid).clamp(1, MOST_SLOTS as u64) as usize
}

pub(super) async fn open(precision: Precision, choice: &AdapterChoice) -> Result<Gpu, GpuError> {
    let all = all_adapters().await?;
    let fits = |adapter: &wgpu::Adapter| choice.allows(&adapter.get_info()) && has(adapter, precision);
    let Some(adapter) = all.iter().find(|adapter| fits(adapter)) else {
        return Err(no_adapter(precision, choice, &all));
    };
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("rattlemap"),
        required_features: features(precision) | (adapter.features() & wgpu::Features::TIMESTAMP_QUERY),
        required_limits: adapter.limits(),
        ..Default::default()
    };
    let info = adapter.get_info();
    let no_device = |reason: String| GpuError::NoDevice { adapter: info.name.clone(), reason };
    let asked = caught(|| adapter.request_device(&descriptor))
        .map_err(|why| no_device(format!("the driver fails while it is opened ({why})")))?;
    let (device, queue) = asked.await.map_err(|error| no_device(error.to_string()))?;
    let trouble = Trouble::watch(&device);
    let pipelines = HashMap::new();
    let (queue, policy) = (Dropped::new(queue), DispatchPolicy::of(info.device_type));
    Ok(Gpu {
        device,
        queue,
        info,
        precision,
        pipelines,
        trouble,
        rewrite: None,
        policy,
        watcher: None,
        halt: Arc::default(),
    })
}

/// What in the environment narrows the adapters down, as far as `choice` heeds it, and what to do about it; none
/// if nothing does.
pub fn narrowed_by(choice: &AdapterChoice) -> Option<String> {
    let value = |name| std::env::var(name).ok().filter(|value| !value.is_empty());
    let backend = value(BACKEND).map(|value| (BACKEND, value, "give vulkan, metal or dx12"));
    let named = choice.name.clone().filter(|name| value(ADAPTER_NAME).as_ref() == Some(name));
    let named =
        named.map(|value| (ADAPTER_NAME, value, "give part of a name that `rattlemap devices` lists"));
    let sentence =
        |(name, value, remedy)| format!("the environment has {name}={value}: unset it, or {remedy}");
    let list: Vec<String> = backend.into_iter().chain(named).map(sentence).collect();
    (!list.is_empty()).then(|| list.join("; "))
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
            let doubles = if has(adapter, Precision::F64) { "f32, f64" } else { "f32" };
            format!("{} ({doubles})", adapter.get_info().name)
        })
        .collect();
    let found = if list.is_empty() { String::from("none") } else { list.join(", ") };
    let remedy = narrowed_by(choice)
        .unwrap_or_else(|| String::from("install a Vulkan driver (Debian: mesa-vulkan-drivers)"));
    GpuError::NoAdapter { wanted, remedy, found }
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

/// Compiles a variant.
pub(super) async fn pipelines(gpu: &Gpu, variant: super::Variant) -> Result<Pipelines, GpuError> {
    // What a driver's own compiler refuses is internal, or memory.
    let filters =
        [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::Validation];
    let scopes = filters.map(|filter| gpu.device.push_error_scope(filter));
    let source = gpu.rewrite.map_or_else(|| variant.source(), |rewrite| rewrite(variant.source()));
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("lane"),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipelines = gpu.call(|| Pipelines {
        begin: pipeline(gpu, &module, BEGIN),
        sweep: pipeline(gpu, &module, SWEEP),
        compact: COMPACT.map(|entry_point| pipeline(gpu, &module, entry_point)),
        conclude: pipeline(gpu, &module, CONCLUDE),
    });
    let mut refused = None;
    for scope in scopes.into_iter().rev() {
        refused = refused.or(scope.pop().await);
    }
    match refused {
        None => pipelines,
        Some(error) => Err(gpu.failure(GpuError::Refused { what: "a shader", message: error.to_string() })),
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_adapter_by_two_interfaces_is_taken_by_the_better() {
        let adapters = pollster::block_on(adapters());
        let seen = &adapters.first().expect("tests need an adapter").info;
        let with = |device_type, backend| wgpu::AdapterInfo { device_type, backend, ..seen.clone() };
        let (dedicated, software) = (wgpu::DeviceType::DiscreteGpu, wgpu::DeviceType::Cpu);
        let in_order = [
            with(dedicated, wgpu::Backend::Vulkan),
            with(dedicated, wgpu::Backend::Dx12),
            with(dedicated, wgpu::Backend::Gl),
            with(software, wgpu::Backend::Vulkan),
            with(software, wgpu::Backend::Gl),
        ];
        let ranks = in_order.each_ref().map(rank);
        assert!(ranks.is_sorted_by(|a, b| a < b), "{ranks:?}");
    }
}
