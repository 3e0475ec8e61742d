//! Adapters: a list of them, their order, and their names.

use std::fmt;

use super::layout::length_of;
use super::panics::catch_panic;
use super::{GpuError, Precision};

/// Environment variables that select adapters. wgpu reads the first of them.
const BACKEND: &str = "WGPU_BACKEND";
const ADAPTER_NAME: &str = "WGPU_ADAPTER_NAME";

/// The caller's choice of an adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AdapterChoice {
    /// Part of the adapter's name or of its description ([`describe`]), in upper or lower case; `None` selects the
    /// best adapter.
    pub name: Option<String>,
    /// Number of the adapter ([`AdapterReport::number`]).
    pub number: Option<usize>,
}

impl AdapterChoice {
    /// Selects the adapter with this number.
    pub fn numbered(number: usize) -> AdapterChoice {
        AdapterChoice { number: Some(number), name: None }
    }

    /// Selects the best adapter with this text in its name or its description ([`describe`]).
    pub fn named(name: impl Into<String>) -> AdapterChoice {
        AdapterChoice { name: Some(name.into()), number: None }
    }

    /// Whether the choice admits an adapter.
    pub fn allows(&self, adapter: &AdapterReport) -> bool {
        let AdapterReport { number, info, .. } = adapter;
        let name = describe(info).to_lowercase();
        self.number.is_none_or(|wanted| wanted == *number)
            && self.name.as_ref().is_none_or(|wanted| name.contains(&wanted.to_lowercase()))
    }

    /// Selects the adapter that the environment variable `WGPU_ADAPTER_NAME` names, else the best.
    pub fn from_environment() -> AdapterChoice {
        AdapterChoice { name: std::env::var(ADAPTER_NAME).ok().filter(|name| !name.is_empty()), number: None }
    }
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    // With this validation, wgpu would insert a further dispatch before each indirect dispatch.
    descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    wgpu::Instance::new(descriptor)
}

/// Properties of an adapter.
#[derive(Clone, Debug)]
pub struct AdapterReport {
    /// Place in [`adapters`], from 0. It is the same in every run on one machine with the same `WGPU_BACKEND`, until
    /// an adapter is added or removed.
    pub number: usize,
    /// Name, kind and driver.
    pub info: wgpu::AdapterInfo,
    /// Precisions in which it can run lanes.
    pub precisions: Vec<Precision>,
    /// Largest storage buffer that a shader can bind, in bytes.
    pub largest_binding: u64,
    /// Largest number of lanes under way at a time.
    pub most_lanes: usize,
}

impl AdapterReport {
    fn of(number: usize, adapter: &wgpu::Adapter) -> AdapterReport {
        AdapterReport {
            number,
            info: adapter.get_info(),
            precisions: Precision::ALL.into_iter().filter(|&p| has(adapter, p)).collect(),
            largest_binding: adapter.limits().max_storage_buffer_binding_size,
            most_lanes: most_slots(&adapter.limits()).min(MOST_UNDER_WAY),
        }
    }

    /// Returns its identity on this machine.
    pub fn id(&self) -> AdapterId {
        AdapterId::of(self.number, &self.info)
    }
}

/// Identity that distinguishes an adapter from others with the same name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterId {
    /// Number of the adapter ([`AdapterReport::number`]).
    pub number: usize,
    /// Name from its driver.
    pub name: String,
    /// Place on the bus (`domain:bus:device.function`); `None` if the driver does not report it.
    pub pci: Option<String>,
}

impl AdapterId {
    pub(super) fn of(number: usize, info: &wgpu::AdapterInfo) -> AdapterId {
        let pci = Some(info.device_pci_bus_id.clone()).filter(|pci| !pci.is_empty());
        AdapterId { number, name: info.name.clone(), pci }
    }
}

impl fmt::Display for AdapterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let AdapterId { number, name, pci } = self;
        write!(f, "{number} ({name}{})", pci.as_ref().map_or(String::new(), |pci| format!(", PCI {pci}")))
    }
}

/// Lists all adapters of this machine, the best first: by kind, then by interface, then by PCI address, which
/// distinguishes equal cards. Adapters without an address are in the driver's order.
pub async fn adapters() -> Vec<AdapterReport> {
    listed().await.unwrap_or_default().into_iter().map(|(report, _)| report).collect()
}

/// Lists all adapters with the handles that open them.
pub(super) async fn listed() -> Result<Vec<(AdapterReport, wgpu::Adapter)>, GpuError> {
    let list = catch_panic(|| instance().enumerate_adapters(wgpu::Backends::all()));
    let mut all = list.map_err(|message| GpuError::Refused { what: "to list its adapters", message })?.await;
    all.sort_by_cached_key(|adapter| place(&adapter.get_info()));
    Ok(all.into_iter().enumerate().map(|(n, adapter)| (AdapterReport::of(n, &adapter), adapter)).collect())
}

fn place(info: &wgpu::AdapterInfo) -> ((u32, u32), String) {
    (rank(info), info.device_pci_bus_id.clone())
}

/// Describes an adapter by name, interface and driver, as in manifests.
pub fn describe(info: &wgpu::AdapterInfo) -> String {
    let driver = [info.driver.as_str(), info.driver_info.as_str()].join(" ");
    format!("{} ({:?}; {})", info.name, info.backend, driver.trim())
}

/// Whether an adapter is hardware, not a program on the processor.
pub fn is_hardware(info: &wgpu::AdapterInfo) -> bool {
    info.device_type != wgpu::DeviceType::Cpu
}

/// Largest number of lanes under way, unless settings ask for more.
pub(super) const MOST_UNDER_WAY: usize = 1 << 16;

/// Largest number of slots of a pool. They take about 2 GB on the device in f32, 3 GB in f64.
const MOST_SLOTS: usize = 1 << 20;

/// Returns the largest number of slots that an adapter's limits allow.
pub(super) fn most_slots(limits: &wgpu::Limits) -> usize {
    let motion = length_of("Motion", 4) * size_of::<f64>();
    let largest = motion.max(length_of("Tally", 4) * size_of::<u32>()) as u64;
    let by_binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / largest;
    let by_grid = u64::from(limits.max_compute_workgroups_per_dimension).pow(2);
    by_binding.min(by_grid).clamp(1, MOST_SLOTS as u64) as usize
}

fn has(adapter: &wgpu::Adapter, precision: Precision) -> bool {
    adapter.features().contains(features(precision))
}

pub(super) fn features(precision: Precision) -> wgpu::Features {
    match precision {
        Precision::F32 => wgpu::Features::empty(),
        Precision::F64 => wgpu::Features::SHADER_F64,
    }
}

/// Returns an adapter's rank: hardware before software, dedicated before integrated. An adapter may have several interfaces; the most
/// capable interface comes first.
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

/// Explains the rank of an adapter's interface.
pub fn interface_rank(info: &wgpu::AdapterInfo) -> &'static str {
    match info.backend {
        wgpu::Backend::Vulkan => "first choice: the only interface with f64",
        wgpu::Backend::Metal => "second to Vulkan: no f64",
        wgpu::Backend::Dx12 => "second to Vulkan: no f64 here",
        wgpu::Backend::Gl => "last choice: no f64, smaller buffers, no clock of its own",
        wgpu::Backend::BrowserWebGpu | wgpu::Backend::Noop => "last choice",
    }
}

/// Describes the environment variables that restrict the adapters of `choice`, with a remedy; `None` if there are
/// none.
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

/// Builds the error of an adapter that was not found.
pub(crate) fn no_adapter(precision: Precision, choice: &AdapterChoice, all: &[AdapterReport]) -> GpuError {
    let mut wanted = match precision {
        Precision::F32 => String::from("at all"),
        Precision::F64 => String::from("with double precision (SHADER_F64)"),
    };
    if let Some(name) = &choice.name {
        wanted = format!("called {name} {wanted}");
    }
    if let Some(number) = choice.number {
        wanted = format!("with number {number} {wanted}");
    }
    let list: Vec<String> = all
        .iter()
        .map(|adapter| {
            let names: Vec<&str> = adapter.precisions.iter().map(|precision| precision.name()).collect();
            format!("{} ({})", adapter.info.name, names.join(", "))
        })
        .collect();
    let found = if list.is_empty() { String::from("none") } else { list.join(", ") };
    let remedy = narrowed_by(choice)
        .unwrap_or_else(|| String::from("install a Vulkan driver (Debian: mesa-vulkan-drivers)"));
    GpuError::NoAdapter { wanted, remedy, found }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_better_interface_to_an_adapter_comes_first() {
        let with = wgpu::AdapterInfo::new;
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
    #[test]
    fn equal_cards_are_ordered_by_pci_address() {
        let at = |pci: &str, device_type| wgpu::AdapterInfo {
            device_pci_bus_id: pci.to_owned(),
            ..wgpu::AdapterInfo::new(device_type, wgpu::Backend::Vulkan)
        };
        let dedicated = wgpu::DeviceType::DiscreteGpu;
        let mut all = [
            at("", wgpu::DeviceType::Cpu),
            at("0000:65:00.0", dedicated),
            at("0000:00:02.0", wgpu::DeviceType::IntegratedGpu),
            at("0000:17:00.0", dedicated),
        ];
        all.sort_by_cached_key(place);
        let addresses = all.each_ref().map(|info| info.device_pci_bus_id.as_str());
        assert_eq!(addresses, ["0000:17:00.0", "0000:65:00.0", "0000:00:02.0", ""]);
        let names = [&all[1], &all[3]].map(|info| AdapterId::of(1, info).to_string());
        assert_eq!(names, ["1 (, PCI 0000:65:00.0)", "1 ()"]);
    }
}
