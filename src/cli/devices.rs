//! `rattlemap devices`: what there is to compute on, and what a map would take.

use crate::cli::stdout::print;
use crate::gpu::{self, AdapterChoice, AdapterReport};
use crate::job::engine_choice::{self, Ask};
use crate::map::plan::Plan;
use crate::map::scene::{Purpose, Scene};

use crate::cli::say;
use crate::job::error::Failure;
use crate::job::processor;

/// What engines are tried on.
const MAIN_MAP: &str = include_str!("../../scenes/e_omega.toml");

/// Prints the processor, the adapters, and the choice of `--engine auto` on the main map.
pub(crate) fn run() -> Result<(), Failure> {
    print(&format!("cpu: event-driven reference on {}", processor::described()))?;
    print("  precision   f64")?;
    let adapters = pollster::block_on(gpu::adapters());
    for adapter in &adapters {
        print_adapter(adapter)?;
    }
    if adapters.is_empty() {
        let mesa = || "a software one comes with Mesa (Debian: mesa-vulkan-drivers)".to_owned();
        print(&format!(
            "no graphics adapter; {}",
            say::quoted(gpu::narrowed_by(&AdapterChoice::default()).unwrap_or_else(mesa))
        ))?;
    }
    let scene = Scene::parse(MAIN_MAP, "e_omega", &[], Purpose::Map)?;
    let plan = Plan::new(&scene);
    let chosen = pollster::block_on(engine_choice::open(&plan, &Ask::default()))?;
    let (engine, precision) = (chosen.engine.name(), chosen.engine.precision());
    print(&format!("auto takes {engine} ({precision}) for the main map: {}", say::quoted(chosen.why)))?;
    Ok(())
}

fn print_adapter(adapter: &AdapterReport) -> Result<(), Failure> {
    let AdapterReport { number, info, precisions, largest_binding, most_lanes } = adapter;
    let names: Vec<&str> = precisions.iter().map(|precision| precision.name()).collect();
    let kind = if gpu::is_hardware(info) { "hardware" } else { "software" };
    print(&format!("gpu: {}", say::quoted(gpu::describe(info))))?;
    print(&format!("  kind        {kind} ({:?})", info.device_type))?;
    print(&format!("  interface   {:?}, {}", info.backend, gpu::interface_rank(info)))?;
    print(&format!("  precision   {}", names.join(", ")))?;
    let pci = adapter.id().pci.map_or(String::new(), |pci| format!(", at PCI address {}", say::quoted(pci)));
    print(&format!("  number      {number} (--adapter {number}){pci}"))?;
    print(&format!("  binding     {:.1} GiB", *largest_binding as f64 / f64::from(1 << 30)))?;
    print(&format!("  batch       up to {most_lanes} lanes"))
}
