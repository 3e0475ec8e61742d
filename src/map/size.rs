//! How large a map is, estimated before anything is allocated.

use crate::gpu;
use crate::map::plan::{Parts, stores_flows};
use crate::map::scene::{Format, Quantity, Scene, Steps};
use crate::map::shard::Shard;
use crate::record::Record;

/// Bytes per cell in memory beside its record: its place in the order, and what the outputs
/// make of it.
const MEMORY_BESIDE: u64 = 64;

/// What a shard has for each run of the map: whether it has come.
const OF_ALL: u64 = 1;

/// Bytes of a run in a [`RecordStore`](crate::record::RecordStore) beside its numbers.
const IN_STORE: u64 = 8;
/// Of its last state, and of a word's number.
const STROBE: u64 = 32;
const WORD_NUMBER: u64 = 4;

/// The same of a cell of a list: its values, their text, and which flow and law it has.
const LIST_ROW: u64 = 200;

/// Bytes per period of one cell under way: strobe state and growth of a tangent vector.
const PER_PERIOD: u64 = 40;

/// Bytes per flow that the reference keeps.
const FLOW: u64 = 100_000;

/// Flows that are sampled to estimate the constants of all.
const FLOWS_LOOKED_AT: usize = 256;

/// Bytes per run on disk of what a record always has, and of what is asked for, where it does not compress: chaos.
const RECORD: u64 = 44;
const NUMBER: u64 = 8;
const WORD: u64 = 16;

/// Bytes per cell on disk of each output.
const CSV: u64 = 190;
/// Less its quantities.
const NPY: u64 = 33;
/// Of a word or a pattern, with its share of `words.csv`.
const NPY_ROW: u64 = 12;
const HTML: u64 = 24;
/// Of one figure.
const PNG: u64 = 4;
/// Starts of cells that follow their neighbours, in the report.
const HTML_START: u64 = 44;

/// The size of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Number of cells.
    pub cells: u64,
    /// Number of runs: cells times starts per cell.
    pub runs: u64,
    /// Bytes of memory that records and outputs need, about.
    pub memory: u64,
    /// Bytes of memory for every thread of the reference.
    pub memory_per_thread: u64,
    /// Bytes of memory for the flows that the reference keeps.
    pub flows: u64,
    /// Bytes of memory for the constants that lanes read, while they are handed to the device.
    pub lane_tables: u64,
    /// Bytes on disk of records and outputs, about.
    pub disk: u64,
}

impl Size {
    /// The size of a part of a scene's map, or of all of it: a part keeps its records on disk alone, unless cells follow
    /// their neighbours, and makes neither tables nor figures. All of the map are its cells and runs, and the flows
    /// that lanes read.
    pub fn of_shard(scene: &Scene, shard: Option<Shard>) -> Size {
        let whole = Size::of(scene);
        let Some(shard) = shard else { return whole };
        let own = whole.runs.div_ceil(u64::from(shard.count()));
        let records = if scene.start().follows() { whole.runs } else { 0 };
        let rows = scene.list().map_or(0, |list| list.len() as u64);
        let memory = (whole.runs * OF_ALL).saturating_add(records * size_of::<Record>() as u64);
        Size {
            memory: memory.saturating_add(own * MEMORY_BESIDE).saturating_add(rows * LIST_ROW),
            disk: own.saturating_mul(record_on_disk(scene)),
            ..whole
        }
    }

    /// The size of a scene's map that is merged of shards: records are kept by column, and nothing is integrated.
    pub fn merged(scene: &Scene) -> Size {
        let whole = Size::of(scene);
        let compares = whole.runs > whole.cells || scene.is_basin();
        let rows = scene.list().map_or(0, |list| list.len() as u64);
        let per_run = in_store(scene).saturating_add(MEMORY_BESIDE);
        Size {
            memory: whole.runs.saturating_mul(per_run).saturating_add(rows * LIST_ROW),
            memory_per_thread: 0,
            // Cycles are looked for where attractors are told apart.
            flows: if compares { whole.flows } else { 0 },
            lane_tables: 0,
            ..whole
        }
    }

    /// The size of a scene's map.
    pub fn of(scene: &Scene) -> Size {
        let (cells, runs) = (scene.cell_count(), scene.run_count());
        let record = size_of::<Record>() as u64;
        let per_file = |format: &Format| match format {
            Format::Csv => CSV,
            Format::Npy => NPY + scene.outputs().quantities.iter().map(in_array).sum::<u64>(),
            Format::Html if scene.start().follows() => HTML + HTML_START,
            Format::Html => HTML,
            // One of each quantity, one of attractors.
            Format::Png | Format::Svg | Format::Pdf => PNG * (scene.outputs().quantities.len() as u64 + 1),
        };
        let per_files: u64 = scene.outputs().files.iter().map(per_file).sum();
        let settings = scene.orbit_settings();
        let periods = u64::from(settings.transient_periods) + u64::from(settings.observed_periods);
        let one_cell = periods * PER_PERIOD;
        let parts = Parts::flows(scene.points());
        let flow_count = parts.count() as u64;
        let rows = scene.list().map_or(0, |list| list.len() as u64);
        Size {
            cells,
            runs,
            memory: runs.saturating_mul(record + MEMORY_BESIDE).saturating_add(rows * LIST_ROW),
            memory_per_thread: one_cell,
            flows: if stores_flows(flow_count, runs) { flow_count * FLOW } else { 0 },
            lane_tables: lane_tables(scene, &parts, runs),
            disk: runs.saturating_mul(record_on_disk(scene)).saturating_add(cells.saturating_mul(per_files)),
        }
    }

    /// Bytes of memory that a run on the CPU needs, about.
    pub fn on_cpu(&self, threads: u64) -> u64 {
        self.memory.saturating_add(self.flows).saturating_add(self.memory_per_thread.saturating_mul(threads))
    }

    /// Bytes of the host's memory that a run on a graphics device needs, about.
    pub fn on_gpu(&self) -> u64 {
        self.memory.saturating_add(self.lane_tables)
    }

    /// Whether a `u32` can number the runs.
    pub fn is_countable(&self) -> bool {
        self.runs <= u64::from(u32::MAX)
    }
}

/// Bytes per cell of a quantity's columns in `cells.npy`.
fn in_array(quantity: &Quantity) -> u64 {
    match quantity {
        Quantity::Class => 3,
        Quantity::Lyapunov => 2 * NUMBER,
        Quantity::Impacts | Quantity::Mesh => NUMBER,
        Quantity::Symmetric => 1,
        Quantity::Word | Quantity::Pattern => NPY_ROW,
    }
}

/// Bytes of a run's record by column, as far as the scene asks for it.
fn in_store(scene: &Scene) -> u64 {
    let quantities = &scene.outputs().quantities;
    let asks = |quantity| quantities.contains(&quantity);
    let number = |quantity: &Quantity| match quantity {
        Quantity::Impacts | Quantity::Mesh => NUMBER,
        Quantity::Word | Quantity::Pattern => WORD_NUMBER,
        Quantity::Class | Quantity::Lyapunov | Quantity::Symmetric => 0,
    };
    let has_exponent = asks(Quantity::Class) || asks(Quantity::Lyapunov) || scene.is_basin();
    let exponent = if has_exponent { 2 * NUMBER } else { 0 };
    let goes_on = scene.run_count() > scene.cell_count() || scene.is_basin() || scene.start().follows();
    let strobe = if goes_on { STROBE } else { 0 };
    IN_STORE + exponent + strobe + quantities.iter().map(number).sum::<u64>()
}

fn record_on_disk(scene: &Scene) -> u64 {
    let quantity = |quantity: &Quantity| match quantity {
        Quantity::Word | Quantity::Pattern => WORD,
        Quantity::Lyapunov | Quantity::Impacts | Quantity::Mesh => NUMBER,
        Quantity::Class | Quantity::Symmetric => 1,
    };
    // The class needs an exponent, too, with its error.
    RECORD + 2 * NUMBER + scene.outputs().quantities.iter().map(quantity).sum::<u64>()
}

/// Bytes of the constants that lanes read at a time, from flows spread over the map. Where there
/// are too many to be kept, those at hand are neighbours, and may all be as large as the largest.
fn lane_tables(scene: &Scene, parts: &Parts, runs: u64) -> u64 {
    let flows = parts.count() as u64;
    let steps = match scene.integration().steps_per_period {
        Steps::Auto => None,
        Steps::PerPeriod(steps) => Some(steps),
    };
    let looked_at = flows.min(FLOWS_LOOKED_AT as u64);
    let bytes = |nth: u64| {
        // Both ends are among them.
        let flow = (flows - 1) * nth / (looked_at - 1).max(1);
        let model = scene.points().model(parts.cell(flow as u32));
        model.oscillator().map_or(0, |oscillator| gpu::table_bytes(&oscillator, steps))
    };
    if stores_flows(flows, runs) {
        let sum: u64 = (0..looked_at).map(bytes).sum();
        (sum as f64 / looked_at as f64 * flows as f64) as u64
    } else {
        let largest = (0..looked_at).map(bytes).max().unwrap_or(0);
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
    use rattlemap_dynamics::word::Word;

    fn scene(second: &str, min: f64, max: f64, counts: [usize; 2]) -> Scene {
        let [columns, rows] = counts;
        let text = format!(
            "[[axis]]\nparameter = 'e'\nmin = 0.25\nmax = 0.75\ncount = {columns}\n\
             [[axis]]\nparameter = '{second}'\nmin = {min:?}\nmax = {max:?}\ncount = {rows}\n"
        );
        Scene::parse(&text, "s", &[], Purpose::Map).unwrap()
    }

    /// What the flows of a map take in truth, against what is said of them before.
    #[test]
    fn flows_and_constants_take_no_more_than_was_said() {
        for (second, min, max) in
            [("omega", 1.0, 12.0), ("omega", 0.01, 0.02), ("k", 1e3, 1e7), ("r1", 0.0, 9.0)]
        {
            let scene = scene(second, min, max, [5, 400]);
            let (size, plan) = (Size::of(&scene), Plan::new(&scene));
            assert!(plan.stores_flows());
            let oscillators: Vec<_> =
                (0..plan.flow_count() as u32).map(|flow| plan.oscillator(flow)).collect();
            let flows: usize = oscillators.iter().map(|oscillator| Flow::new(oscillator).bytes()).sum();
            let ratio = size.flows as f64 / flows as f64;
            assert!((1.0..2.0).contains(&ratio), "{second}: {} said, {flows} taken", size.flows);
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
    fn rows_of_a_list_take_room_beside_their_records() {
        let text = "e,omega\n".to_owned() + &"0.5,5.6\n".repeat(100);
        let find = |_, _: &str| Ok(FileText { name: "l.csv".to_owned(), text: text.clone() });
        let list = Scene::parse_with_files("[cells]\nfile = 'l.csv'\n", "s", &[], Purpose::Map, None, &find)
            .unwrap();
        let [list, grid] = [list, scene("omega", 1.0, 12.0, [10, 10])].map(|scene| Size::of(&scene).memory);
        assert_eq!(list - grid, 100 * LIST_ROW);
    }

    /// What is foreseen of a merge is what its store takes, with what outputs make of a cell.
    #[test]
    fn a_merged_map_takes_the_memory_of_what_it_asks_for() {
        let full = Record {
            lyapunov: 0.1,
            lyapunov_error: 0.01,
            impacts_per_period: 1.0,
            mesh_fraction: 0.5,
            strobe: [1.0; 4],
            period: 1,
            periods_run: 100,
            ..Record::default()
        };
        for (quantities, more, per_run) in [
            ("'class', 'lyapunov'", "", 24),
            ("'impacts'", "", 16),
            ("'class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word', 'pattern'", "", 48),
            ("'class'", "[start]\ncount = 3\n", 56),
            ("'class', 'mesh'", "[start]\npolicy = 'up'\n", 64),
        ] {
            let axis = |name| format!("[[axis]]\nparameter = '{name}'\nmin = 0.25\nmax = 0.75\ncount = 10\n");
            let outputs = format!("[outputs]\nquantities = [{quantities}]\n");
            let text = axis("e") + &axis("omega") + &outputs + more;
            let scene = Scene::parse(&text, "s", &[], Purpose::Map).unwrap();
            let plan = Plan::new(&scene);
            let needs = plan.needs();
            let number = |is_asked: bool, value: f64| if is_asked { value } else { 0.0 };
            let mut record = Record {
                lyapunov: number(needs.exponent, full.lyapunov),
                lyapunov_error: number(needs.exponent, full.lyapunov_error),
                impacts_per_period: number(needs.impacts, full.impacts_per_period),
                mesh_fraction: number(needs.mesh, full.mesh_fraction),
                ..full
            };
            if needs.word {
                record.set_word(&Word::cyclic(b"13"));
                record.set_pattern(&Word::cyclic(b"13"));
            }
            let runs = plan.run_count();
            let mut store = RecordStore::new(runs, plan.reads_strobes());
            (0..runs).for_each(|id| store.put(id, &record));
            assert_eq!(store.bytes(), per_run * runs, "{quantities} {more}");
            assert_eq!(Size::merged(&scene).memory, (per_run as u64 + MEMORY_BESIDE) * runs as u64);
            assert!(Size::merged(&scene).memory < Size::of(&scene).memory);
        }
    }

    #[test]
    fn only_what_is_at_hand_at_a_time_is_counted() {
        let one = |scene: &Scene| gpu::table_bytes(&scene.base().oscillator().unwrap(), None);
        // A single flow; e and mesh_speed are laws.
        let single = scene("mesh_speed", 0.001, 0.01, [300, 300]);
        assert_eq!(Size::of(&single).lane_tables, one(&single));
        assert_eq!(Size::of(&single).flows, FLOW);
        // Too many to be kept: the reference solves them one by one, lanes get some at a time.
        let many = scene("k", 1e3, 1e4, [2, 100_000]);
        assert_eq!(Size::of(&many).lane_tables, gpu::MOST_FLOWS as u64 * one(&many));
        let large = scene("omega", 0.002, 0.003, [2, 10_000]);
        assert_eq!(Size::of(&large).lane_tables, gpu::MOST_BYTES);
        assert_eq!(Size::of(&many).flows, 0);
        // As slow a forcing as lanes can follow, times every cell, is not forgotten.
        let flows = 8_000;
        let slow = scene("omega", 0.002, 0.003, [2, flows]);
        assert!(Size::of(&slow).on_gpu() > 650_000 * flows as u64, "{:?}", Size::of(&slow));
        assert!(Size::of(&slow).on_cpu(2) < 1_000_000_000, "{:?}", Size::of(&slow));
    }
}
