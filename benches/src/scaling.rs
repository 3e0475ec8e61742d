//! How maps scale with the number of processor cores: measured on the cores of this machine, simulated for more.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::path::Path;

use anyhow::Result;
use rattlemap::job::engine_choice::{EngineKind, EngineRequest};
use serde::Serialize;

use crate::host_cost::{self, HostCost};

/// Number of simulated cores.
pub const CORES: usize = 64;

/// Number of cells of the simulated map. The costs of a smaller measured map are repeated.
const SIMULATED_CELLS: usize = 1 << 20;

/// Rules of batches, as in the program: cells per core of the first one, target time, time after which no cell begins.
const FIRST_PER_CORE: usize = 64;
const TARGET: f64 = 1.0;
const LIMIT: f64 = 2.0;

/// Run times of a map in seconds per million cells.
#[derive(Clone, Debug, Serialize)]
pub struct Scaling {
    /// Kind of cells.
    pub map: &'static str,
    /// Number of threads of the measured runs.
    pub threads: usize,
    /// Time with one thread.
    pub one: f64,
    /// Time with all threads.
    pub all: f64,
    /// Serial part by Amdahl's law.
    pub serial: f64,
    /// Part of the time in which the simulated cores are busy, while they integrate.
    pub busy: f64,
    /// Time with the simulated cores.
    pub simulated: f64,
}

/// Measures a map of the processor with one thread and with all, and simulates it on [`CORES`].
///
/// # Errors
/// As for [`host_cost::run`], or if no thread can be started.
pub fn run(map: &'static str, counts: [u32; 2], force: f64, all: bool, out: &Path) -> Result<Scaling> {
    let engine = EngineRequest { kind: EngineKind::Cpu, precision: None, adapter: None };
    let threads = rayon::current_num_threads();
    let on = |count: usize| -> Result<HostCost> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build()?;
        pool.install(|| {
            host_cost::run(counts, force, all, engine.clone(), &out.join(format!("{map}-{count}")))
        })
    };
    let total = |cost: &HostCost| {
        cost.phases.iter().map(|phase| phase.seconds).sum::<f64>() * 1e6 / cost.cells as f64
    };
    let (one, many) = (on(1)?, on(threads)?);
    let (t1, tn, n) = (total(&one), total(&many), threads as f64);
    let serial = if threads > 1 { ((n * tn - t1) / (n - 1.0)).clamp(0.0, t1) } else { t1 };
    let integrating: f64 =
        one.phases.iter().filter(|cost| cost.phase == "integrate").map(|cost| cost.seconds).sum();
    let sum: f64 = one.periods.iter().map(|&periods| f64::from(periods)).sum();
    let costs: Vec<f64> = one.periods.iter().map(|&periods| f64::from(periods) * integrating / sum).collect();
    let repeated: Vec<f64> = costs
        .iter()
        .flat_map(|&cost| std::iter::repeat_n(cost, SIMULATED_CELLS.div_ceil(costs.len())))
        .collect();
    let busy = repeated.iter().sum::<f64>() / (CORES as f64 * makespan(&repeated, CORES));
    let simulated = serial + (t1 - serial) / CORES as f64 / busy;
    Ok(Scaling { map, threads, one: t1, all: tn, serial, busy, simulated })
}

/// Returns the time in which cores compute cells of these costs, batch after batch. A free core takes the next cell.
fn makespan(costs: &[f64], cores: usize) -> f64 {
    let (mut time, mut begun, mut size) = (0.0, 0, FIRST_PER_CORE * cores);
    while begun < costs.len() {
        // Times in nanoseconds, which have an order.
        let mut free: BinaryHeap<Reverse<u64>> = (0..cores).map(|_| Reverse(0)).collect();
        let mut last = 0;
        let batch = &costs[begun..costs.len().min(begun + size)];
        let mut count = 0;
        for cost in batch {
            let Some(Reverse(at)) = free.pop() else { break };
            if count > 0 && at as f64 >= LIMIT * 1e9 {
                break;
            }
            let end = at + (cost * 1e9).ceil() as u64;
            last = last.max(end);
            free.push(Reverse(end));
            count += 1;
        }
        begun += count;
        let took = last as f64 * 1e-9;
        time += took;
        let paced = count as f64 * (TARGET / took.max(1e-3)).clamp(0.25, 4.0);
        size = cores.max(paced as usize);
    }
    time
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_cells_keep_all_cores_busy_and_a_slow_one_does_not() {
        let equal = vec![1e-3; 64_000];
        assert!((makespan(&equal, 64) - 1.0).abs() < 1e-2);
        assert!((makespan(&[&equal[..], &[5.0]].concat(), 64) - 6.0).abs() < 0.5, "the last cell is alone");
        assert!((makespan(&[5.0; 200], 64) - 20.0).abs() < 1e-6, "no cell begins after two seconds");
        assert!((makespan(&equal[..640], 1) - 0.64).abs() < 1e-6);
    }
}
