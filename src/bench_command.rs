//! The instruments: which is asked for.

mod engines;
mod stability;
mod work_precision;

use crate::cli::Bench;
use crate::error::Failure;

pub(crate) fn run(ask: &Bench) -> Result<(), Failure> {
    match ask {
        Bench::WorkPrecision(ask) => work_precision::run(ask),
        Bench::Engines(ask) => engines::run(ask),
        Bench::Stability(ask) => stability::run(ask),
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Name of the processor as it gives it, which may be empty; none if there is no telling.
fn processor() -> Option<String> {
    let mut system = sysinfo::System::new();
    system.refresh_cpu_list(sysinfo::CpuRefreshKind::nothing());
    system.cpus().first().map(|cpu| cpu.brand().trim().to_owned())
}
