//! `rattlemap devices`: lists the processor, the graphics adapters, and the engine that `auto` chooses.

use crate::cli::failure::Failure;
use crate::cli::say::quoted;
use crate::cli::stdout::print;
use crate::gpu::{self, AdapterReport};
use crate::job::devices;

/// Prints the processor, the adapters, and the engine that `--engine auto` chooses.
pub(crate) fn run() -> Result<(), Failure> {
    let devices = devices::devices()?;
    print(&format!("cpu: event-driven reference on {}", devices.processor))?;
    print("  precision   f64")?;
    devices.adapters.iter().try_for_each(print_adapter)?;
    if devices.adapters.is_empty() {
        let mesa = "a software driver comes with Mesa (Debian: mesa-vulkan-drivers)".to_owned();
        print(&format!("no graphics adapter; {}", quoted(devices.narrowed_by.unwrap_or(mesa))))?;
    }
    print(&format!("auto chooses {} ({}): {}", devices.engine, devices.precision, quoted(devices.reason)))
}

fn print_adapter(adapter: &AdapterReport) -> Result<(), Failure> {
    let AdapterReport { number, info, precisions, largest_binding, most_lanes } = adapter;
    let names: Vec<&str> = precisions.iter().map(|precision| precision.name()).collect();
    let kind = if gpu::is_hardware(info) { "hardware" } else { "software" };
    let pci = adapter.id().pci.map_or(String::new(), |pci| format!(", at PCI address {}", quoted(pci)));
    print(&format!("gpu: {}", quoted(gpu::describe(info))))?;
    print(&format!("  kind        {kind} ({:?})", info.device_type))?;
    print(&format!("  interface   {:?}, {}", info.backend, gpu::interface_rank(info)))?;
    print(&format!("  precision   {}", names.join(", ")))?;
    print(&format!("  number      {number} (--adapter {number}){pci}"))?;
    print(&format!("  binding     {:.1} GiB", *largest_binding as f64 / f64::from(1 << 30)))?;
    print(&format!("  batch       up to {most_lanes} lanes"))
}
