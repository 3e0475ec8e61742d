//! Estimates the memory and disk space of a map, and compares them with what the machine has free.

use std::path::Path;

use crate::gpu;
use crate::job::engine_choice::EngineKind;
use crate::job::error::JobError;
use crate::job::processor;
use crate::map::plan::{Parts, keeps_flows};
use crate::map::scene::{Format, Quantity, Scene, Steps};
use crate::map::shard::Shard;
use crate::record::Record;
use crate::store::map;
use crate::text::size::bytes;

// Memory in bytes.
/// Per run beside its record: its place in the order, and the rows of tables and figures.
const RUN: u64 = 64;
/// Per run of the whole map in a shard: a flag.
const FLAG: u64 = 1;
/// Per run of a merged map: the fixed part of a [`RecordStore`](crate::record::RecordStore), its last state, the number of
/// its word.
const STORED_RUN: u64 = 8;
const STORED_STATE: u64 = 32;
const STORED_WORD: u64 = 4;
/// Per cell of a list: values, their text, flow and law.
const LIST_ROW: u64 = 200;
/// Per forcing period of a cell that is being computed: strobe state, growth of a tangent vector.
const PERIOD: u64 = 40;
/// Per flow that the CPU engine keeps.
const FLOW: u64 = 100_000;

// Disk in bytes: upper ends of measured maps. Chaotic cells hardly compress.
/// Per run: the columns that every record has, with exponent and error.
const RECORD: u64 = 60;
const NUMBER: u64 = 8;
const WORD: u64 = 16;
/// Per cell: a row of `cells.csv`, a row of `cells.npy` without its quantities, a word's row with its share of `words.csv`,
/// `report.html`, one figure, and the starts that the report lists where cells follow their neighbours.
const CSV: u64 = 190;
const NPY: u64 = 33;
const NPY_WORD: u64 = 12;
const HTML: u64 = 24;
const FIGURE: u64 = 4;
const HTML_START: u64 = 44;

/// Number of flows from which the size of all lane tables is estimated.
const SAMPLED_FLOWS: u64 = 256;

/// Estimated size of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Number of cells.
    pub cells: u64,
    /// Number of runs: cells times starts per cell.
    pub runs: u64,
    /// Memory for records and outputs, in bytes.
    pub memory: u64,
    /// Additional memory per thread of the CPU engine, in bytes.
    pub memory_per_thread: u64,
    /// Additional memory for the flows of the CPU engine, in bytes.
    pub flows: u64,
    /// Additional memory for the constants of the GPU engine's lanes, in bytes.
    pub lane_tables: u64,
    /// Disk space for records and outputs, in bytes.
    pub disk: u64,
}

impl Size {
    /// Estimates the size of a map, or of a shard of it. A shard writes records alone, and keeps them in memory only where
    /// cells follow their neighbours.
    pub fn of(scene: &Scene, shard: Option<Shard>) -> Size {
        let (cells, runs) = (scene.cell_count(), scene.run_count());
        let rows = scene.list().map_or(0, |list| list.len() as u64) * LIST_ROW;
        let settings = scene.orbit_settings();
        let periods = u64::from(settings.transient_periods) + u64::from(settings.observed_periods);
        let parts = Parts::flows(scene.points());
        let flow_count = parts.count() as u64;
        let record = size_of::<Record>() as u64;
        let (memory, disk) = match shard {
            None => {
                let files: u64 = scene.outputs().files.iter().map(|format| file(scene, *format)).sum();
                let records = runs.saturating_mul(record_on_disk(scene));
                (runs.saturating_mul(record + RUN), records.saturating_add(cells.saturating_mul(files)))
            }
            Some(shard) => {
                let own = runs.div_ceil(u64::from(shard.count()));
                let records = if scene.start().follows() { runs.saturating_mul(record) } else { 0 };
                let memory = (runs * FLAG).saturating_add(records).saturating_add(own * RUN);
                (memory, own.saturating_mul(record_on_disk(scene)))
            }
        };
        Size {
            cells,
            runs,
            memory: memory.saturating_add(rows),
            memory_per_thread: periods * PERIOD,
            flows: if keeps_flows(flow_count, runs) { flow_count * FLOW } else { 0 },
            lane_tables: lane_tables(scene, &parts, runs),
            disk,
        }
    }

    /// Estimates the size of a map that is merged from shards: nothing is integrated. Cycles are computed again where
    /// attractors are counted.
    pub fn merged(scene: &Scene) -> Size {
        let whole = Size::of(scene, None);
        let has_attractors = whole.runs > whole.cells || scene.is_basin();
        let rows = scene.list().map_or(0, |list| list.len() as u64) * LIST_ROW;
        Size {
            memory: whole.runs.saturating_mul(stored_run(scene) + RUN).saturating_add(rows),
            memory_per_thread: 0,
            flows: if has_attractors { whole.flows } else { 0 },
            lane_tables: 0,
            ..whole
        }
    }

    /// Memory of the host that a kind of engine needs, in bytes; of `auto` the larger one.
    pub fn host_memory(&self, kind: EngineKind) -> u64 {
        let threads = self.memory_per_thread.saturating_mul(processor::cores() as u64);
        let cpu = self.memory.saturating_add(self.flows).saturating_add(threads);
        let gpu = self.memory.saturating_add(self.lane_tables);
        match kind {
            EngineKind::Cpu => cpu,
            EngineKind::Gpu => gpu,
            EngineKind::Auto => cpu.max(gpu),
        }
    }

    /// Compares the size with what is free; `remedy` ends the message.
    fn check(&self, scene: &Scene, kind: EngineKind, free: &Free, remedy: &str) -> Result<(), JobError> {
        let counts: Vec<String> = scene.axes().iter().map(|axis| axis.count().to_string()).collect();
        let starts = if self.runs > self.cells { format!(", {} runs,", self.runs) } else { String::new() };
        let map = match scene.list() {
            Some(_) => format!("a list of {} cells{starts}", self.cells),
            None => format!("a map of {} = {} cells{starts}", counts.join(" x "), self.cells),
        };
        let refuse = |what: &str, needed: u64, free: u64, other: &str| {
            Err(JobError::TooLarge(format!(
                "{map} needs about {} of {what}, and {} are free; {remedy}{other}",
                bytes(needed),
                bytes(free)
            )))
        };
        if u32::try_from(self.runs).is_err() {
            let most = u32::MAX;
            return Err(JobError::TooLarge(format!(
                "{map} is too large: a map has at most {most} runs; {remedy}"
            )));
        }
        let memory = self.host_memory(kind);
        match *free {
            Free { memory: Some(free), .. } if free < memory => {
                let is_enough = self.host_memory(EngineKind::Cpu) < free;
                let other = if is_enough { ", or give --engine cpu, which needs less" } else { "" };
                refuse("memory", memory, free, other)
            }
            Free { disk: Some(free), .. } if free < self.disk => {
                refuse("disk", self.disk, free, ", or give a folder on another disk with --out")
            }
            _ => Ok(()),
        }
    }
}

/// Free memory and disk space of the machine, in bytes. None where the system does not report it.
#[derive(Clone, Copy, Debug)]
pub struct Free {
    /// Memory, within the limits of a container.
    pub memory: Option<u64>,
    /// Space on the disk of the output folder, including the files of an earlier map, which are replaced.
    pub disk: Option<u64>,
}

impl Free {
    /// Asks the system; for disk space only if there is an output folder, which need not exist yet.
    pub fn for_output(out: Option<&Path>) -> Free {
        let mut system = sysinfo::System::new();
        system.refresh_memory();
        let memory = system.available_memory();
        let limited = system.cgroup_limits().map_or(memory, |limits| memory.min(limits.free_memory));
        let disk = out.and_then(|out| {
            let absolute = std::path::absolute(out).ok()?;
            let existing = absolute.ancestors().find(|folder| folder.is_dir())?;
            Some(fs4::available_space(existing).ok()?.saturating_add(replaced(out)))
        });
        Free { memory: (limited > 0).then_some(limited), disk }
    }
}

/// Size of a folder's files that a new map replaces, in bytes.
fn replaced(out: &Path) -> u64 {
    map::names().filter_map(|name| out.join(name).symlink_metadata().ok()).map(|data| data.len()).sum()
}

/// Checks that a map, or a shard of it, fits this machine. Returns what is free.
///
/// # Errors
/// [`JobError::TooLarge`] with what the map needs and what is free.
pub fn check_map(
    scene: &Scene,
    shard: Option<Shard>,
    kind: EngineKind,
    out: Option<&Path>,
) -> Result<Free, JobError> {
    let free = Free::for_output(out);
    check_free(scene, shard, kind, &free).map(|()| free)
}

fn check_free(scene: &Scene, shard: Option<Shard>, kind: EngineKind, free: &Free) -> Result<(), JobError> {
    let remedy = match scene.list() {
        Some(_) => "shorten the list of cells",
        None => "lower axis.0.count or axis.1.count",
    };
    Size::of(scene, shard).check(scene, kind, free, remedy)
}

/// Remedy for a map that exists already.
const LARGER_MACHINE: &str = "use a larger machine";

/// Checks that a map that is merged from shards fits this machine.
///
/// # Errors
/// [`JobError::TooLarge`] with what the map needs and what is free.
pub fn check_merge(scene: &Scene, out: Option<&Path>) -> Result<(), JobError> {
    Size::merged(scene).check(scene, EngineKind::Cpu, &Free::for_output(out), LARGER_MACHINE)
}

/// Checks that the records of a finished map fit this machine's memory.
///
/// # Errors
/// [`JobError::TooLarge`] with what the map needs and what is free.
pub fn check_finished(scene: &Scene) -> Result<(), JobError> {
    Size::of(scene, None).check(scene, EngineKind::Cpu, &Free::for_output(None), LARGER_MACHINE)
}

/// Bytes per cell of an output file.
fn file(scene: &Scene, format: Format) -> u64 {
    let quantities = &scene.outputs().quantities;
    let in_array = |quantity: &Quantity| match quantity {
        Quantity::Class => 3,
        Quantity::Lyapunov => 2 * NUMBER,
        Quantity::Impacts | Quantity::Mesh => NUMBER,
        Quantity::Symmetric => 1,
        Quantity::Word | Quantity::Pattern => NPY_WORD,
    };
    match format {
        Format::Csv => CSV,
        Format::Npy => NPY + quantities.iter().map(in_array).sum::<u64>(),
        Format::Html if scene.start().follows() => HTML + HTML_START,
        Format::Html => HTML,
        // One figure per quantity, and one of attractors.
        Format::Png | Format::Svg | Format::Pdf => FIGURE * (quantities.len() as u64 + 1),
    }
}

/// Bytes per run of a record on disk.
fn record_on_disk(scene: &Scene) -> u64 {
    let quantity = |quantity: &Quantity| match quantity {
        Quantity::Word | Quantity::Pattern => WORD,
        Quantity::Lyapunov | Quantity::Impacts | Quantity::Mesh => NUMBER,
        Quantity::Class | Quantity::Symmetric => 1,
    };
    RECORD + scene.outputs().quantities.iter().map(quantity).sum::<u64>()
}

/// Bytes per run of a record in a [`RecordStore`](crate::record::RecordStore), which has the requested columns alone.
fn stored_run(scene: &Scene) -> u64 {
    let quantities = &scene.outputs().quantities;
    let column = |quantity: &Quantity| match quantity {
        Quantity::Impacts | Quantity::Mesh => NUMBER,
        Quantity::Word | Quantity::Pattern => STORED_WORD,
        Quantity::Class | Quantity::Lyapunov | Quantity::Symmetric => 0,
    };
    let needs_exponent =
        quantities.iter().any(|quantity| matches!(quantity, Quantity::Class | Quantity::Lyapunov));
    let exponent = if needs_exponent || scene.is_basin() { 2 * NUMBER } else { 0 };
    let has_starts = scene.run_count() > scene.cell_count();
    let state = if has_starts || scene.is_basin() || scene.start().follows() { STORED_STATE } else { 0 };
    STORED_RUN + exponent + state + quantities.iter().map(column).sum::<u64>()
}

/// Bytes of the constants that are in memory for lanes at a time, estimated from flows spread over the map. If the flows
/// are too many to be kept, those in memory are neighbours, and all of them may be as large as the largest.
fn lane_tables(scene: &Scene, parts: &Parts, runs: u64) -> u64 {
    let flows = parts.count() as u64;
    let steps = match scene.integration().steps_per_period {
        Steps::Auto => None,
        Steps::PerPeriod(steps) => Some(steps),
    };
    let sampled = flows.min(SAMPLED_FLOWS);
    let bytes = |nth: u64| {
        // From the first flow to the last.
        let flow = (flows - 1) * nth / (sampled - 1).max(1);
        let model = scene.points().model(parts.cell(flow as u32));
        model.oscillator().map_or(0, |oscillator| gpu::table_bytes(&oscillator, steps))
    };
    if keeps_flows(flows, runs) {
        let sum: u64 = (0..sampled).map(bytes).sum();
        (sum as f64 / sampled as f64 * flows as f64) as u64
    } else {
        let largest = (0..sampled).map(bytes).max().unwrap_or(0);
        (flows.min(gpu::MOST_FLOWS as u64) * largest).min(gpu::MOST_BYTES.max(largest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Constants;
    use crate::map::plan::Plan;
    use crate::map::scene::{FileText, Purpose};
    use crate::record::RecordStore;
    use rattlemap_dynamics::flow::Flow;

    fn scene(second: &str, min: f64, max: f64, counts: [usize; 2], sets: &[&str]) -> Scene {
        let [columns, rows] = counts;
        let text = format!(
            "[[axis]]\nparameter = 'e'\nmin = 0.25\nmax = 0.75\ncount = {columns}\n\
             [[axis]]\nparameter = '{second}'\nmin = {min:?}\nmax = {max:?}\ncount = {rows}\n"
        );
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        Scene::parse(&text, "s", &sets, Purpose::Map).unwrap()
    }

    /// So slow a forcing that the constants of each flow have 650 kB.
    fn slow(rows: usize) -> Scene {
        scene("omega", 0.002, 0.003, [2, rows], &[])
    }

    #[test]
    fn estimates_of_flows_and_constants_are_close_upper_bounds() {
        for (second, min, max) in
            [("omega", 1.0, 12.0), ("omega", 0.01, 0.02), ("k", 1e3, 1e7), ("r1", 0.0, 9.0)]
        {
            let scene = scene(second, min, max, [5, 400], &[]);
            let (size, plan) = (Size::of(&scene, None), Plan::new(&scene));
            assert!(plan.keeps_flows());
            let oscillators: Vec<_> =
                (0..plan.flow_count() as u32).map(|flow| plan.oscillator(flow)).collect();
            let flows: usize = oscillators.iter().map(|oscillator| Flow::new(oscillator).bytes()).sum();
            let ratio = size.flows as f64 / flows as f64;
            assert!((1.0..2.0).contains(&ratio), "{second}: {} estimated, {flows} used", size.flows);
            let of = |constants: Constants| {
                size_of::<Constants>() + size_of::<[f64; 2]>() * constants.phasors.capacity()
            };
            let one_copy: usize =
                oscillators.iter().filter_map(|oscillator| Constants::new(oscillator, None)).map(of).sum();
            let copies = size.lane_tables as f64 / one_copy as f64;
            assert!((4.5..5.5).contains(&copies), "{second}: {copies} copies");
        }
    }

    #[test]
    fn only_flows_in_memory_at_a_time_are_counted() {
        let one = |scene: &Scene| gpu::table_bytes(&scene.base().oscillator().unwrap(), None);
        let size = |scene: &Scene| Size::of(scene, None);
        // One flow: e and mesh_speed belong to the contact law.
        let single = scene("mesh_speed", 0.001, 0.01, [300, 300], &[]);
        assert_eq!((size(&single).lane_tables, size(&single).flows), (one(&single), FLOW));
        // Too many flows to be kept.
        let many = scene("k", 1e3, 1e4, [2, 100_000], &[]);
        assert_eq!((size(&many).lane_tables, size(&many).flows), (gpu::MOST_FLOWS as u64 * one(&many), 0));
        assert_eq!(size(&slow(10_000)).lane_tables, gpu::MOST_BYTES);
        assert!(size(&slow(8_000)).host_memory(EngineKind::Gpu) > 650_000 * 8_000);
    }

    #[test]
    fn rows_of_a_list_need_memory() {
        let text = "e,omega\n".to_owned() + &"0.5,5.6\n".repeat(100);
        let find = |_, _: &str| Ok(FileText { name: "l.csv".to_owned(), text: text.clone() });
        let list = Scene::parse_beside("[cells]\nfile = 'l.csv'\n", "s", &[], Purpose::Map, &find).unwrap();
        let memory = |scene: Scene| Size::of(&scene, None).memory;
        assert_eq!(memory(list) - memory(scene("omega", 1.0, 12.0, [10, 10], &[])), 100 * LIST_ROW);
    }

    #[test]
    fn the_estimate_for_a_merged_map_is_the_size_of_its_store() {
        for (quantities, more, per_run) in [
            ("['class','lyapunov']", None, 24),
            ("['impacts']", None, 16),
            ("['class','lyapunov','impacts','mesh','symmetric','word','pattern']", None, 48),
            ("['class']", Some("start.count=3"), 56),
            ("['class','mesh']", Some("start.policy='up'"), 64),
        ] {
            let quantities = format!("outputs.quantities={quantities}");
            let sets: Vec<&str> = [&*quantities].into_iter().chain(more).collect();
            let scene = scene("omega", 0.25, 0.75, [10, 10], &sets);
            let plan = Plan::new(&scene);
            let (needs, runs) = (plan.needs(), plan.run_count());
            let number = |is_needed: bool, value: f64| if is_needed { value } else { 0.0 };
            let mut record = Record {
                lyapunov: number(needs.exponent, 0.1),
                lyapunov_error: number(needs.exponent, 0.01),
                impacts_per_period: number(needs.impacts, 1.0),
                mesh_fraction: number(needs.mesh, 0.5),
                strobe: [1.0; 4],
                period: 1,
                periods_run: 100,
                ..Record::default()
            };
            let word = rattlemap_dynamics::word::Word::cyclic(b"13");
            if needs.word {
                record.set_word(&word);
                record.set_pattern(&word);
            }
            let mut store = RecordStore::new(runs, plan.reads_strobes());
            (0..runs).for_each(|id| store.put(id, &record));
            assert_eq!(store.bytes(), per_run * runs, "{quantities} {more:?}");
            assert_eq!(Size::merged(&scene).memory, (per_run as u64 + RUN) * runs as u64);
            assert!(Size::merged(&scene).memory < Size::of(&scene, None).memory);
        }
    }

    #[test]
    fn a_map_that_does_not_fit_is_refused_with_a_remedy() {
        let scene = slow(8_000);
        let check = |kind, memory, disk| check_free(&scene, None, kind, &Free { memory, disk });
        assert!(check(EngineKind::Cpu, Some(2_000_000_000), None).is_ok());
        for kind in [EngineKind::Gpu, EngineKind::Auto] {
            let text = check(kind, Some(2_000_000_000), None).unwrap_err().to_string();
            assert!(text.contains("GB of memory, and 2.0 GB are free"), "{text}");
            assert!(text.contains("or give --engine cpu"), "{text}");
        }
        assert!(check(EngineKind::Gpu, None, None).is_ok(), "an unknown amount is enough");
        let disk = |files: &str| {
            let set = format!("outputs.files={files}");
            Size::of(&self::scene("omega", 1.0, 2.0, [2, 8_000], &[&set]), None).disk
        };
        let [png, all] = [disk("['png']"), disk("['csv','npy','png','html']")];
        assert!(all > 3 * png, "{all} {png}");
        assert!(check(EngineKind::Cpu, None, Some(Size::of(&scene, None).disk)).is_ok());
        let text = check(EngineKind::Cpu, None, Some(png)).unwrap_err().to_string();
        assert!(text.contains("of disk, and") && text.contains("--out"), "{text}");
    }

    #[test]
    fn files_that_a_map_replaces_count_as_free() {
        let out = tempfile::tempdir().unwrap();
        for name in ["records.bin", "cells.csv", "report.html", "notes.txt"] {
            std::fs::write(out.path().join(name), [0; 1000]).unwrap();
        }
        assert_eq!(replaced(out.path()), 3000);
    }
}
