//! Does a map fit this machine? Checked before anything is written or computed.

use std::path::Path;

use crate::job::engine_choice::Who;
use crate::map::scene::Scene;
use crate::map::shard::Shard;
use crate::map::size::Size;
use crate::store::map;
pub(crate) use crate::text::size::bytes;
use anyhow::anyhow;

use crate::cli::arguments::EngineChoice;
use crate::job::error::Failure;
use crate::job::processor;

/// What there is, in bytes; none where the system does not tell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Free {
    pub(crate) memory: Option<u64>,
    /// With what is replaced.
    pub(crate) disk: Option<u64>,
}

/// What there is, for a map that fits it. Refuses one that does not fit memory or disk, with figures; what the system does
/// not tell is taken to be enough.
pub(crate) fn check(
    scene: &Scene,
    shard: Option<Shard>,
    engine: EngineChoice,
    out: &Path,
) -> Result<Free, Failure> {
    let disk = free_disk(out).map(|free| free.saturating_add(replaced(out)));
    let free = Free { memory: free_memory(), disk };
    judge(scene, shard, engine, &free).map(|()| free)
}

/// Refuses a map that is merged and does not fit this machine's memory or, where it is written to a folder, the disk.
///
/// # Errors
/// [`Failure::Usage`] with what it needs and what is free.
pub fn fits_merged(scene: &Scene, out: Option<&Path>) -> Result<(), Failure> {
    let disk = out.and_then(|out| Some(free_disk(out)?.saturating_add(replaced(out))));
    let free = Free { memory: free_memory(), disk };
    judge_size(scene, EngineChoice::Cpu, &free, Size::merged(scene), "use a machine that has as much")
}

/// Refuses a map, or a shard of it, that does not fit this machine's memory or, where it is written to a folder, the disk.
///
/// # Errors
/// [`Failure::Usage`] with what it needs and what is free.
pub fn fits(scene: &Scene, shard: Option<Shard>, engine: Who, out: Option<&Path>) -> Result<(), Failure> {
    let engine = match engine {
        Who::Auto => EngineChoice::Auto,
        Who::Gpu => EngineChoice::Gpu,
        Who::Cpu => EngineChoice::Cpu,
    };
    match out {
        Some(out) => check(scene, shard, engine, out).map(|_| ()),
        None => judge(scene, shard, engine, &Free { memory: free_memory(), disk: None }),
    }
}

/// Refuses a finished map that this machine cannot read, before anything is allocated for it. It is read by the CPU,
/// whatever made it; files are replaced one by one, and stay as they are where there is no room.
pub(crate) fn check_finished(scene: &Scene) -> Result<(), Failure> {
    let free = Free { memory: free_memory(), disk: None };
    judge_size(scene, EngineChoice::Cpu, &free, Size::of(scene), "use a machine that has as much")
}

/// Bytes of a folder's files that a map takes the place of.
fn replaced(out: &Path) -> u64 {
    map::names().filter_map(|name| out.join(name).symlink_metadata().ok()).map(|data| data.len()).sum()
}

fn judge(scene: &Scene, shard: Option<Shard>, engine: EngineChoice, free: &Free) -> Result<(), Failure> {
    let remedy = match scene.list() {
        Some(_) => "shorten the list of cells",
        None => "lower axis.0.count or axis.1.count",
    };
    judge_size(scene, engine, free, Size::of_shard(scene, shard), remedy)
}

fn judge_size(
    scene: &Scene,
    engine: EngineChoice,
    free: &Free,
    size: Size,
    remedy: &str,
) -> Result<(), Failure> {
    let threads = processor::cores() as u64;
    let (cpu, gpu) = (size.on_cpu(threads), size.on_gpu());
    let memory = match engine {
        EngineChoice::Cpu => cpu,
        EngineChoice::Gpu => gpu,
        // Either may be chosen.
        EngineChoice::Auto => cpu.max(gpu),
    };
    let counts: Vec<String> = scene.axes().iter().map(|axis| axis.count().to_string()).collect();
    let starts = if size.runs > size.cells { format!(", {} runs,", size.runs) } else { String::new() };
    let map = match scene.list() {
        Some(_) => format!("a list of {} cells{starts}", size.cells),
        None => format!("a map of {} = {} cells{starts}", counts.join(" x "), size.cells),
    };
    let refuse = |what: &str, needed: u64, available: u64| {
        Err(Failure::Usage(anyhow!(
            "{map} needs about {} of {what}, and {} are free; {remedy}{}",
            bytes(needed),
            bytes(available),
            match what {
                "disk" => ", or name another disk with --out",
                _ if cpu < available => ", or ask for --engine cpu, which needs less",
                _ => "",
            }
        )))
    };
    if !size.is_countable() {
        return Err(Failure::Usage(anyhow!(
            "{map} is too large: at most {} runs can be numbered; {remedy}",
            u32::MAX
        )));
    }
    match *free {
        Free { memory: Some(free), .. } if free < memory => refuse("memory", memory, free),
        Free { disk: Some(free), .. } if free < size.disk => refuse("disk", size.disk, free),
        _ => Ok(()),
    }
}

/// Memory that can still be had, container limits included.
fn free_memory() -> Option<u64> {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    let free = system.available_memory();
    let limited = system.cgroup_limits().map_or(free, |limits| free.min(limits.free_memory));
    (limited > 0).then_some(limited)
}

/// Room on the disk that will hold `out`, which need not exist yet.
fn free_disk(out: &Path) -> Option<u64> {
    let absolute = std::path::absolute(out).ok()?;
    let existing = absolute.ancestors().find(|folder| folder.is_dir())?;
    fs4::available_space(existing).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::scene::Purpose;

    /// Half a million steps of tables for little more than a thousand cells.
    const SLOW: &str = "[[axis]]\nparameter = 'e'\nmin = 0.1\nmax = 0.9\ncount = 2\n\
                        [[axis]]\nparameter = 'omega'\nmin = 0.002\nmax = 0.003\ncount = 8000\n";

    #[test]
    fn constants_of_lanes_count_where_lanes_may_run() {
        let scene = Scene::parse(SLOW, "s", &[], Purpose::Map).unwrap();
        let free = Free { memory: Some(2_000_000_000), disk: None };
        assert!(judge(&scene, None, EngineChoice::Cpu, &free).is_ok());
        for engine in [EngineChoice::Gpu, EngineChoice::Auto] {
            let Err(failure) = judge(&scene, None, engine, &free) else {
                panic!("{engine:?} was let through")
            };
            let text = failure.to_string();
            assert!(text.contains("GB of memory, and 2.0 GB are free"), "{text}");
            assert!(text.contains("or ask for --engine cpu"), "{text}");
        }
        assert!(judge(&scene, None, EngineChoice::Gpu, &Free { memory: None, disk: None }).is_ok());
    }

    /// Tables and figures take more room than records, and what they replace makes room.
    #[test]
    fn room_is_counted_for_all_that_is_written_and_replaced() {
        let disk = |files: &str| {
            let sets = [format!("outputs.files={files}")];
            Size::of(&Scene::parse(SLOW, "s", &sets, Purpose::Map).unwrap()).disk
        };
        let [records, all] = [disk("[\"png\"]"), disk("[\"csv\",\"npy\",\"png\",\"html\"]")];
        assert!(all > 3 * records, "{all} {records}");
        let scene = Scene::parse(SLOW, "s", &[], Purpose::Map).unwrap();
        let with = |disk| judge(&scene, None, EngineChoice::Cpu, &Free { memory: None, disk: Some(disk) });
        assert!(with(Size::of(&scene).disk).is_ok());
        let text = with(records).unwrap_err().to_string();
        assert!(text.contains("of disk, and") && text.contains("--out"), "{text}");
        let out = tempfile::tempdir().unwrap();
        for name in ["records.bin", "cells.csv", "report.html", "notes.txt"] {
            std::fs::write(out.path().join(name), [0; 1000]).unwrap();
        }
        assert_eq!(replaced(out.path()), 3000);
    }
}
