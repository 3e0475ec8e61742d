//! Estimates the memory and disk space of a map, and compares them with what the machine has free.

use std::fs;
use std::path::Path;

use crate::gpu::{self, Constants};
use crate::job::engine_choice::EngineKind;
use crate::job::error::JobError;
use crate::job::processor;
use crate::map::engine::{LARGEST_BATCH, largest_batch};
use crate::map::plan::{Cell, Parts, stores_flows};
use crate::map::scene::{Format, Quantity, Scene, Steps};
use crate::map::shard::Shard;
use crate::model_file::{several_gaps, subjects};
use crate::record::Record;
use crate::store::folder::Folder;
use crate::store::map;
use crate::text::size::bytes;

/// Memory of the program itself, in bytes.
const PROGRAM: u64 = 30_000_000;
/// Memory per run without its record, in bytes: its place in the order, and its state.
const RUN: u64 = 5;
/// Memory of the numbers that only records of larger models have, in bytes.
const FURTHER: u64 = 570;
/// Memory per cell of an adaptive map, in bytes: label, request, blocks.
const REFINED: u64 = 40;
/// Memory per cell of a list, in bytes: values, their text, flow and law.
const LIST_ROW: u64 = 200;
/// Memory per forcing period of a cell that is being computed, in bytes: strobe state, growth of a tangent vector.
const PERIOD: u64 = 136;
/// Memory per flow that the CPU engine keeps, in bytes: an upper bound for built-in models.
const FLOW: u64 = 100_000;
/// Address space that a graphics driver needs, in bytes: the software driver's, which fails without a message if it has less.
const DRIVER: u64 = 2_000_000_000;
/// Bytes of a report besides its cells, most of them its engine.
const PAGE: u64 = 950_000;
/// Pixels of the largest figure, twice, in bytes.
const FIGURE: u64 = 2 * 2048 * 2048 * 4;
/// Number of flows from which the size of all lane tables is estimated.
const SAMPLED_FLOWS: u64 = 256;

/// Estimated size of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Number of cells.
    pub cells: u64,
    /// Number of runs: cells times starts per cell.
    pub runs: u64,
    /// Memory with the CPU engine, in bytes.
    pub cpu_memory: u64,
    /// Memory of the host with the GPU engine, in bytes.
    pub gpu_memory: u64,
    /// Disk space, in bytes.
    pub disk: u64,
}

impl Size {
    /// Estimates the size of a map, or of a shard of it. A shard writes only records. Its memory holds a byte per run of
    /// the map, and all records if cells follow their neighbours.
    pub fn of(scene: &Scene, shard: Option<Shard>) -> Size {
        let (cells, runs) = (scene.cell_count(), scene.run_count());
        let is_larger = scene.coordinates() > 2 || several_gaps(scene.base()).is_some();
        let record = size_of::<(u32, Record)>() as u64 + if is_larger { FURTHER } else { 0 };
        // Cells that wait for an engine and those that it has, the records of one batch that is computed, and of one on its way
        // to the disk.
        let under_way = |runs: u64, most: usize| {
            let most = most as u64;
            runs.min(most) * 2 * size_of::<Cell>() as u64 + runs.min(2 * most) * record
        };
        let [record_on_disk, files] = disk(scene);
        let own = shard.map_or(runs, |shard| runs.div_ceil(u64::from(shard.count())));
        let memory = |most: usize| match shard {
            // Files are written when no cell is under way.
            None => runs.saturating_mul(held_run(scene, false)) + under_way(runs, most).max(drawn(scene)),
            Some(_) => {
                let kept = if scene.start().follows() { 1 + stored_run(scene, false) } else { 1 };
                runs.saturating_mul(kept) + own * RUN + under_way(own, most)
            }
        };
        let disk = match shard {
            None => runs.saturating_mul(record_on_disk) + cells * files + page(scene),
            Some(_) => own * record_on_disk,
        };
        let settings = scene.orbit_settings();
        let periods = u64::from(settings.transient_periods) + u64::from(settings.observed_periods);
        let flows = Parts::flows(scene.points());
        let memory = |most: usize| PROGRAM + memory(most) + list_rows(scene);
        let cores = processor::cores();
        // Results of lanes on their way to records.
        let results = 2 * runs.min(LARGEST_BATCH as u64) * size_of::<gpu::LaneResult>() as u64;
        Size {
            cells,
            runs,
            cpu_memory: memory(largest_batch(cores))
                + kept_flows(&flows, runs)
                + periods * PERIOD * cores as u64,
            gpu_memory: memory(LARGEST_BATCH) + lane_tables(scene, &flows, runs) + results,
            disk,
        }
    }

    /// Estimates the size of a map of which all records exist. Nothing is integrated, but `with_flows` are needed to compare cycles.
    fn computed(scene: &Scene, with_strobes: bool, with_flows: bool) -> Size {
        let whole = Size::of(scene, None);
        let flows = if with_flows { kept_flows(&Parts::flows(scene.points()), whole.runs) } else { 0 };
        let records = whole.runs.saturating_mul(held_run(scene, with_strobes));
        let memory = PROGRAM + records + list_rows(scene) + flows + drawn(scene);
        Size { cpu_memory: memory, gpu_memory: memory, ..whole }
    }

    /// Memory of the host that a kind of engine needs, in bytes; for `auto` the larger one.
    pub fn memory(&self, kind: EngineKind) -> u64 {
        match kind {
            EngineKind::Cpu => self.cpu_memory,
            EngineKind::Gpu => self.gpu_memory,
            EngineKind::Auto => self.cpu_memory.max(self.gpu_memory),
        }
    }

    /// Compares the size with the free memory and disk space. `remedy` ends the message.
    fn check(&self, scene: &Scene, kind: EngineKind, free: &Free, remedy: &str) -> Result<(), JobError> {
        let counts: Vec<String> = scene.axes().iter().map(|axis| axis.count().to_string()).collect();
        let starts = if self.runs > self.cells { format!(", {} runs,", self.runs) } else { String::new() };
        let map = match scene.list() {
            Some(_) => format!("a list of {} cells{starts}", self.cells),
            None => format!("a map of {} = {} cells{starts}", counts.join(" x "), self.cells),
        };
        if u32::try_from(self.runs).is_err() {
            let most = u32::MAX;
            return Err(JobError::TooLarge(format!(
                "{map} is too large: a map has at most {most} runs; {remedy}"
            )));
        }
        let memory = self.memory(kind);
        let (what, needed, free, other) = match *free {
            Free { memory: Some(free), .. } if free < memory => {
                let is_enough = self.cpu_memory < free;
                let other = if is_enough { ", or give --engine cpu, which needs less" } else { "" };
                let limit = if address_space().is_some() { ", or raise the limit (`ulimit -v`)" } else { "" };
                ("memory", memory, free, format!("{other}{limit}"))
            }
            Free { disk: Some(free), .. } if free < self.disk => {
                ("disk", self.disk, free, ", or give a folder on another disk with --out".to_owned())
            }
            _ => return Ok(()),
        };
        let (needed, free) = (bytes(needed), bytes(free));
        Err(JobError::TooLarge(format!(
            "{map} needs about {needed} of {what}, and {free} are free; {remedy}{other}"
        )))
    }
}

/// Free memory and disk space, in bytes. None if the system does not report it; then it counts as enough.
#[derive(Clone, Copy, Debug)]
pub struct Free {
    /// Memory, within the limits of a container and of the process (`ulimit -v`).
    pub memory: Option<u64>,
    /// Space on the disk of the output folder, including the files of an earlier map, which are replaced.
    pub disk: Option<u64>,
}

impl Free {
    /// Reads the free memory, and the free disk space if there is an output folder. The folder need not exist yet.
    pub fn for_output(out: Option<&Path>) -> Free {
        let mut system = sysinfo::System::new();
        system.refresh_memory();
        let memory = system.available_memory();
        let limited = system.cgroup_limits().map_or(memory, |limits| memory.min(limits.free_memory));
        let limited = address_space().map_or(limited, |left| limited.min(left.max(1)));
        let disk = out.and_then(|out| {
            let absolute = std::path::absolute(out).ok()?;
            let existing = absolute.ancestors().find(|folder| folder.is_dir())?;
            Some(fs4::available_space(existing).ok()?.saturating_add(replaced(out)))
        });
        Free { memory: (limited > 0).then_some(limited), disk }
    }
}

/// Address space that the limit of this process (`ulimit -v`) leaves, in bytes. None without a limit; only Linux reports it.
fn address_space() -> Option<u64> {
    let number = |file: &str, line: &str| -> Option<u64> {
        let text = fs::read_to_string(file).ok()?;
        text.lines().find_map(|found| found.strip_prefix(line))?.split_whitespace().next()?.parse().ok()
    };
    let limit = number("/proc/self/limits", "Max address space")?;
    Some(limit.saturating_sub(1024 * number("/proc/self/status", "VmSize:")?))
}

/// Size of a folder's files that a new map replaces, in bytes.
fn replaced(out: &Path) -> u64 {
    map::names().filter_map(|name| out.join(name).symlink_metadata().ok()).map(|data| data.len()).sum()
}

/// Checks that a map, or a shard of it, fits into free memory and disk space.
///
/// # Errors
/// [`JobError::TooLarge`] with the needed and the free amount.
pub fn check_map(scene: &Scene, shard: Option<Shard>, kind: EngineKind, free: &Free) -> Result<(), JobError> {
    if let (EngineKind::Gpu, Some(left @ ..DRIVER)) = (kind, address_space()) {
        return Err(JobError::TooLarge(format!(
            "graphics drivers need about {} of address space, and {} are left; raise the limit (`ulimit -v`), or give \
             --engine cpu",
            bytes(DRIVER),
            bytes(left)
        )));
    }
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
/// [`JobError`] if the folder cannot be written, or with the needed and the free amount.
pub fn check_merge(scene: &Scene, out: Option<&Path>) -> Result<(), JobError> {
    out.map_or(Ok(()), Folder::check_writable)?;
    // Where attractors are counted, cycles are compared.
    let counts_attractors = scene.run_count() > scene.cell_count() || scene.is_basin();
    let size = Size::computed(scene, false, counts_attractors);
    size.check(scene, EngineKind::Cpu, &Free::for_output(out), LARGER_MACHINE)
}

/// Checks that the records of a finished map fit this machine's memory.
///
/// # Errors
/// [`JobError::TooLarge`] with the needed and the free amount.
pub fn check_finished(scene: &Scene) -> Result<(), JobError> {
    let size = Size::computed(scene, true, true);
    size.check(scene, EngineKind::Cpu, &Free::for_output(None), LARGER_MACHINE)
}

/// Bytes on disk: per run for its record, and per cell for all other files. The constants are the largest of measured maps.
fn disk(scene: &Scene) -> [u64; 2] {
    let quantities = &scene.outputs().quantities;
    let columns = |words: u64, exponent: u64, class: u64| -> u64 {
        let column = |quantity: &Quantity| match quantity {
            Quantity::Word | Quantity::Pattern => words,
            Quantity::Lyapunov => exponent,
            Quantity::ImpactRate => 8,
            // Each of several gaps has a number of its own.
            Quantity::Impacts | Quantity::Mesh => 8 + numbers(scene, *quantity),
            Quantity::Class => class,
            Quantity::Symmetric => 1,
            Quantity::State => state_bytes(scene),
            measured => numbers(scene, *measured),
        };
        quantities.iter().map(column).sum()
    };
    let figures = |quantity: &Quantity| match quantity {
        Quantity::State => state_bytes(scene) / 8,
        other => (numbers(scene, *other) / 8).max(1),
    };
    let figures: u64 = quantities.iter().map(figures).sum();
    let file = |format: &Format| match format {
        Format::Csv => 190,
        // A word has a row of words.csv, too.
        Format::Npy => 33 + columns(12, 16, 3),
        // The starts of cells that follow their neighbours.
        Format::Html if scene.start().follows() => 68 + 4 * figures,
        Format::Html => 24 + 4 * figures,
        // One figure per number, and one of attractors.
        Format::Png | Format::Svg | Format::Pdf => 4 * (figures + 1),
    };
    // Every record has an exponent with its error: the class needs them.
    [60 + columns(16, 8, 1), scene.outputs().files.iter().map(file).sum()]
}

/// Bytes of the report, if there is one, besides its cells.
fn page(scene: &Scene) -> u64 {
    if scene.outputs().files.contains(&Format::Html) { PAGE } else { 0 }
}

/// Bytes while the files of a map are written: numbers of words, layers, and the pixels of a figure.
fn drawn(scene: &Scene) -> u64 {
    let outputs = scene.outputs();
    let is_drawn = |format: &Format| *format == Format::Html || Format::FIGURES.contains(format);
    let draws = u64::from(outputs.files.iter().any(is_drawn));
    let layer = |quantity: &Quantity| match quantity {
        Quantity::Word | Quantity::Pattern => 4 + draws,
        Quantity::Lyapunov | Quantity::Impacts | Quantity::Mesh | Quantity::ImpactRate => 5 * draws,
        Quantity::Class | Quantity::Symmetric | Quantity::State => 0,
        measured => 5 * draws * numbers(scene, *measured) / 8,
    };
    // Two layers of classes, and the numbers of the layer that is being made.
    let layers = outputs.quantities.iter().map(layer).sum::<u64>() + 10 * draws;
    scene.cell_count() * layers + draws * FIGURE
}

/// Bytes per run of a whole map: its record, its state in the schedule, and its part of the blocks of an adaptive map.
fn held_run(scene: &Scene, with_strobes: bool) -> u64 {
    let refined = if scene.refine().is_some() { REFINED } else { 0 };
    stored_run(scene, with_strobes) + RUN + refined
}

/// Bytes per run in a [`RecordStore`](crate::record::RecordStore), which has only the requested columns, and strobe states
/// on request.
fn stored_run(scene: &Scene, with_strobes: bool) -> u64 {
    let quantities = &scene.outputs().quantities;
    let column = |quantity: &Quantity| match quantity {
        // The rate is computed from the impacts per period.
        Quantity::ImpactRate if quantities.contains(&Quantity::Impacts) => 0,
        Quantity::Impacts | Quantity::Mesh | Quantity::ImpactRate => 8,
        Quantity::Word | Quantity::Pattern => 4,
        Quantity::Class | Quantity::Lyapunov | Quantity::Symmetric | Quantity::State => 0,
        measured => numbers(scene, *measured),
    };
    let is_exponent = |quantity: &Quantity| matches!(quantity, Quantity::Class | Quantity::Lyapunov);
    let exponent = if quantities.iter().any(is_exponent) || scene.is_basin() { 16 } else { 0 };
    let has_starts = scene.run_count() > scene.cell_count();
    let needs_state = quantities.contains(&Quantity::State) || scene.is_basin() || scene.start().follows();
    let state = if with_strobes || has_starts || needs_state { state_bytes(scene) } else { 0 };
    8 + exponent + state + quantities.iter().map(column).sum::<u64>()
}

/// Bytes of a strobe state.
fn state_bytes(scene: &Scene) -> u64 {
    16 * scene.coordinates().max(2) as u64
}

/// Bytes of the numbers of a measured quantity.
fn numbers(scene: &Scene, quantity: Quantity) -> u64 {
    8 * quantity.columns(&subjects(scene.base())).len() as u64
}

fn list_rows(scene: &Scene) -> u64 {
    scene.list().map_or(0, |list| list.len() as u64 * LIST_ROW)
}

/// Bytes of the flows that the CPU engine keeps.
fn kept_flows(flows: &Parts, runs: u64) -> u64 {
    let count = flows.count() as u64;
    if stores_flows(count, runs) { count * FLOW } else { 0 }
}

/// Largest size of the lanes' constants in memory, in bytes, estimated from flows spread over the map. If memory cannot
/// hold all flows, it holds neighbours, which may all be as large as the largest.
fn lane_tables(scene: &Scene, parts: &Parts, runs: u64) -> u64 {
    let flows = parts.count() as u64;
    let steps = match scene.integration().steps_per_period {
        Steps::Auto => None,
        Steps::PerPeriod(steps) => Some(steps),
    };
    let sampled = flows.min(SAMPLED_FLOWS);
    let steps_of = |nth| {
        // From the first flow to the last.
        let flow = (flows - 1) * nth / (sampled - 1).max(1);
        let model = scene.points().model(parts.cell(flow as u32));
        let oscillator = model.oscillator().ok()?;
        let steps = Constants::steps(&oscillator, steps);
        Some((steps, gpu::table_bytes(&oscillator, steps)))
    };
    let samples: Vec<(Option<u32>, [u64; 2])> = (0..sampled).filter_map(steps_of).collect();
    let steps = || samples.iter().filter_map(|&(steps, _)| steps);
    let (most, least) = (steps().max(), steps().min());
    // Flows with equal steps, which are even, share their phasors.
    let distinct = most.zip(least).map_or(0, |(most, least)| u64::from((most - least) / 2 + 1));
    let largest_of = |part: usize| samples.iter().map(|(_, bytes)| bytes[part]).max().unwrap_or(0);
    let [flow, largest] = [0, 1].map(largest_of);
    if stores_flows(flows, runs) {
        let mean = samples.iter().map(|(_, [_, phasors])| phasors).sum::<u64>() / sampled;
        flows * flow + flows.min(distinct) * mean
    } else {
        let together = flows.min(gpu::MOST_FLOWS as u64);
        let uploaded =
            (together * flow + together.min(distinct) * largest).min(gpu::MOST_BYTES.max(flow + largest));
        // Meanwhile the constants of the next upload are derived.
        uploaded + uploaded / gpu::COPIES
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::map::plan::Plan;
    use crate::map::scene::{FileText, Purpose};
    use crate::record::measures;
    use crate::record::{RecordStore, RecordsMut};
    use rattlemap_dynamics::motion::Flow;

    fn scene(second: &str, min: f64, max: f64, counts: [usize; 2], sets: &[&str]) -> Scene {
        let [columns, rows] = counts;
        let text = format!(
            "[[axis]]\nparameter = 'e'\nmin = 0.25\nmax = 0.75\ncount = {columns}\n\
             [[axis]]\nparameter = '{second}'\nmin = {min:?}\nmax = {max:?}\ncount = {rows}\n"
        );
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        Scene::parse(&text, "s", &sets, Purpose::Map).unwrap()
    }

    #[test]
    fn estimates_of_flows_and_constants_are_close_upper_bounds() {
        for (second, min, max) in
            [("omega", 1.0, 12.0), ("omega", 0.01, 0.02), ("k", 1e3, 1e7), ("r1", 0.0, 9.0)]
        {
            let scene = scene(second, min, max, [5, 400], &[]);
            let (plan, parts) = (Plan::new(&scene), Parts::flows(scene.points()));
            assert!(plan.stores_flows());
            let oscillators: Vec<_> =
                (0..plan.flow_count() as u32).map(|flow| plan.oscillator(flow)).collect();
            let flows: usize = oscillators.iter().map(|oscillator| Flow::new(oscillator).bytes()).sum();
            let ratio = kept_flows(&parts, scene.run_count()) as f64 / flows as f64;
            assert!((1.0..2.0).contains(&ratio), "{second}: {ratio}");
            let steps: Vec<u32> = oscillators.iter().filter_map(|of| Constants::steps(of, None)).collect();
            let distinct: BTreeSet<u32> = steps.iter().copied().collect();
            let phasors: u32 = distinct.iter().map(|steps| steps + 1).sum();
            let one_copy = steps.len() * size_of::<Constants>() + phasors as usize * size_of::<[f64; 2]>();
            let copies = lane_tables(&scene, &parts, scene.run_count()) as f64 / one_copy as f64;
            assert!((3.6..4.4).contains(&copies), "{second}: {copies} copies");
        }
    }

    #[test]
    fn only_flows_in_memory_at_a_time_are_counted() {
        let sizes = |scene: &Scene| {
            let (parts, runs) = (Parts::flows(scene.points()), scene.run_count());
            (lane_tables(scene, &parts, runs), kept_flows(&parts, runs))
        };
        let one = |scene: &Scene| {
            let oscillator = scene.base().oscillator().unwrap();
            gpu::table_bytes(&oscillator, Constants::steps(&oscillator, None))
        };
        // One flow: e and mesh_speed belong to the contact law.
        let single = scene("mesh_speed", 0.001, 0.01, [300, 300], &[]);
        assert_eq!(sizes(&single), (one(&single).iter().sum(), FLOW));
        let too_many = scene("k", 1e3, 1e4, [2, 100_000], &[]);
        let with_next = |bytes: u64| bytes + bytes / gpu::COPIES;
        let [flow, phasors] = one(&too_many);
        assert_eq!(sizes(&too_many), (with_next(gpu::MOST_FLOWS as u64 * flow + phasors), 0));
        assert_eq!(sizes(&scene("omega", 0.002, 0.003, [2, 10_000], &[])).0, with_next(gpu::MOST_BYTES));
    }

    #[test]
    fn a_list_needs_more_memory_than_a_grid() {
        let text = "e,omega\n".to_owned() + &"0.5,5.6\n".repeat(100);
        let find = |_, _: &str| Ok(FileText { name: "l.csv".to_owned(), text: text.clone() });
        let scene_text = "[cells]\nfile = 'l.csv'\n";
        let list = Scene::parse_with_files(scene_text, "s", &[], Purpose::Map, None, &find).unwrap();
        assert_eq!(list_rows(&list), 100 * LIST_ROW);
        assert_eq!(list_rows(&scene("omega", 1.0, 12.0, [10, 10], &[])), 0);
    }

    #[test]
    fn the_estimate_for_a_merged_map_is_the_size_of_its_store() {
        for (quantities, more, per_run) in [
            ("['class','lyapunov']", None, 24),
            ("['impacts']", None, 16),
            ("['class','lyapunov','impacts','mesh','symmetric','word','pattern']", None, 48),
            ("['class']", Some("start.count=3"), 56),
            ("['class','mesh']", Some("start.policy='up'"), 64),
            ("['state','impact_rate','harmonic','dissipated']", None, 8 + 32 + 8 + 6 * 8 + 8),
        ] {
            let quantities = format!("outputs.quantities={quantities}");
            let sets: Vec<&str> = [&*quantities].into_iter().chain(more).collect();
            let scene = scene("omega", 0.25, 0.75, [10, 10], &sets);
            let plan = Plan::new(&scene);
            let (needs, runs) = (plan.needs(), plan.run_count());
            let number = |is_needed: bool| if is_needed { 0.5 } else { 0.0 };
            let mut record = Record {
                lyapunov: number(needs.exponent),
                lyapunov_error: number(needs.exponent),
                impacts_per_period: number(needs.impacts),
                mesh_fraction: number(needs.mesh),
                strobe: [1.0; 4].into(),
                period: 1,
                periods_run: 100,
                ..Record::default()
            };
            let names = subjects(scene.base());
            for measure in measures::all().filter(|measure| measure.is_of(&names)) {
                record.measures[measure.place] = 0.5;
            }
            record.clear_measures(|group| !needs.has(group));
            if needs.word {
                let word = rattlemap_dynamics::word::Word::cyclic(b"13");
                record.set_word(&word);
                record.set_pattern(&word);
            }
            let mut store = RecordStore::new(runs, plan.reads_strobes());
            (0..runs).for_each(|id| store.put(id, &record));
            assert_eq!(
                (store.bytes(), stored_run(&scene, false)),
                (per_run * runs, per_run as u64),
                "{more:?}"
            );
        }
    }

    #[test]
    fn a_map_that_does_not_fit_is_refused_with_a_remedy() {
        // So slow a forcing that the constants of each flow have 650 kB.
        let scene =
            |files: &str| scene("omega", 0.002, 0.003, [2, 8_000], &[&format!("outputs.files=[{files}]")]);
        let [png, all] = [scene("'png'"), scene("'csv','npy','png','html'")];
        let check = |kind, memory, disk| check_map(&all, None, kind, &Free { memory, disk });
        assert!(check(EngineKind::Cpu, Some(2_000_000_000), None).is_ok());
        for kind in [EngineKind::Gpu, EngineKind::Auto] {
            let text = check(kind, Some(2_000_000_000), None).unwrap_err().to_string();
            assert!(text.contains("GB of memory, and 2.0 GB are free"), "{text}");
            assert!(text.contains("or give --engine cpu"), "{text}");
        }
        assert!(check(EngineKind::Gpu, None, None).is_ok(), "an unknown amount is enough");
        let [png, disk] = [&png, &all].map(|scene| Size::of(scene, None).disk);
        assert!(disk > 3 * png, "{disk} {png}");
        assert!(check(EngineKind::Cpu, None, Some(disk)).is_ok());
        let text = check(EngineKind::Cpu, None, Some(png)).unwrap_err().to_string();
        assert!(text.contains("of disk, and") && text.contains("--out"), "{text}");
        let out = tempfile::tempdir().unwrap();
        for name in ["records.bin", "cells.csv", "report.html", "notes.txt"] {
            std::fs::write(out.path().join(name), [0; 1000]).unwrap();
        }
        assert_eq!(replaced(out.path()), 3000);
    }
}
