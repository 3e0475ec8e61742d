//! Maps computed through the library: comparison with single orbits, independence of batches and threads, failures.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::common::gpu;
use crate::map::{Swept, computed, swept};
use rattlemap::gpu::Precision;
use rattlemap::map::engine::{Cpu, Engine, EngineError, Fake};
use rattlemap::map::plan::{Cell, Plan};
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::map::schedule::Schedule;
use rattlemap::map::sweep::{self, SweepError};
use rattlemap::record::classify::classify;
use rattlemap::record::{Record, RecordStore, Records, valid};
use rattlemap_dynamics::model::{GearPair, REST};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::orbit::{Class, Orbit, Settings, analyse};
use rayon::prelude::*;

/// Those for which tests of validation compile shaders, too.
const QUANTITIES: &str =
    "outputs.quantities=[\"class\",\"lyapunov\",\"impacts\",\"mesh\",\"symmetric\",\"word\",\"pattern\"]";

/// Reads a map over restitution and frequency with `count` cells along each axis.
fn scene(count: usize, sets: &[&str]) -> Scene {
    let axis = |name, min, max| {
        format!("[[axis]]\nparameter = '{name}'\nmin = {min}\nmax = {max}\ncount = {count}\n")
    };
    let text = axis("e", 0.0, 1.0) + &axis("omega", 1.0, 12.0);
    let sets: Vec<String> = [QUANTITIES].iter().chain(sets).map(ToString::to_string).collect();
    Scene::parse(&text, "test", &sets, Purpose::Map).unwrap()
}

/// Every cell has its own flow, and there are more of them than a software device gets at a time (8,192).
#[test]
fn flows_of_later_uploads_belong_to_their_cells() {
    let axis =
        |name, min, max| format!("[[axis]]\nparameter = '{name}'\nmin = {min}\nmax = {max}\ncount = 96\n");
    // Without contact a cell takes one or two periods.
    let text = axis("k1", 500.0, 1500.0) + &axis("omega", 1.0, 12.0) + "[parameters]\ne = 0.5\nF = 0.001\n";
    let sets = ["outputs.quantities=['class','state']".to_owned()];
    let scene = Scene::parse(&text, "test", &sets, Purpose::Map).unwrap();
    let plan = Plan::new(&scene);
    assert_eq!(plan.flow_count(), 9_216);
    let mut engine = gpu::engine(&plan, Precision::F32);
    let records = gpu::all_records(&plan, &mut engine);
    let cells = plan.cells(0..plan.cell_count());
    for some in cells.chunks(16).step_by(115) {
        let alone = pollster::block_on(engine.run(some)).unwrap();
        for (cell, alone) in some.iter().zip(alone) {
            assert_eq!(records[cell.id as usize], alone, "cell {}", cell.id);
        }
    }
    let strobes: BTreeSet<_> = records.iter().map(|record| record.strobe().map(f64::to_bits)).collect();
    assert!(strobes.len() > records.len() * 9 / 10, "cells have states of their own");
}

/// The reference finishes lanes that are undecided after all other periods, by a rule of the cell alone. Its answer is that of the reference
/// from the lane's state, and it is the motion that the reference follows from the start.
#[test]
fn the_reference_finishes_lanes_that_are_undecided() {
    let budget = ["integration.transient_periods=24", "integration.observed_periods=16"];
    let of = |periods: u32| {
        let undecided = format!("integration.undecided_periods={periods}");
        Plan::new(&scene(12, &[&budget[..], &[&undecided]].concat()))
    };
    let is_finished = |record: &Record| record.valid & valid::BY_REFERENCE != 0;
    let (plan, brief) = (of(600), of(0));
    let mut device = gpu::open(Precision::F32);
    let [records, ended] = [&plan, &brief].map(|plan| gpu::map(plan, &mut device));
    assert!(!ended.iter().any(is_finished), "without undecided periods nothing is handed over");
    let finished: Vec<usize> = (0..records.len()).filter(|&id| is_finished(&records[id])).collect();
    assert!((8..100).contains(&finished.len()), "{} cells", finished.len());
    let (mut decided, mut differing) = (0, 0);
    for (id, (record, ended)) in records.iter().zip(&ended).enumerate() {
        if !is_finished(record) {
            assert_eq!(record, ended, "cell {id}");
            continue;
        }
        assert!(record.periods_run > 40 && record.periods_run <= 640, "{record:?}");
        let class = classify(record);
        decided += usize::from(class != Class::Undecided);
        let from_start = Cpu::new(&plan).compute(&[plan.cell(id as u32)]);
        differing += usize::from(classify(&from_start[0]) != class);
    }
    assert!(10 * decided > 9 * finished.len() && 10 * differing <= finished.len(), "{decided} {differing}");
    // The rule does not depend on other cells.
    let mut engine = gpu::engine(&plan, Precision::F32);
    for &id in finished.iter().step_by(4) {
        let alone = pollster::block_on(engine.run(&[plan.cell(id as u32)])).unwrap();
        assert_eq!(alone[0], records[id], "cell {id}");
    }
    // In maps whose cells depend on others, few lanes wait for cells that the reference finishes.
    for more in ["start.policy=\"up\"", "refine.minimum_grid=4"] {
        let sets = [&budget[..], &["integration.undecided_periods=600", more]].concat();
        let plan = Plan::new(&scene(12, &sets));
        let map = swept(&plan, &mut gpu::engine(&plan, Precision::F32), &[]);
        assert!(matches!(map.end, Ok(true)), "{more}: {:?}", map.end);
        assert!(map.schedule.is_finished() && map.records.iter().any(is_finished), "{more}");
    }
}

fn on_cpu(scene: &Scene) -> Vec<Record> {
    let plan = Plan::new(scene);
    computed(&plan, &mut Engine::Cpu(Cpu::new(&plan)), 64)
}

/// Whether the motion from rest is still far from `orbit` after `periods`.
fn is_elsewhere(pair: &GearPair, orbit: &Orbit, periods: u32) -> bool {
    let flow = Flow::new(&pair.oscillator().unwrap());
    let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
    for _ in 0..periods {
        trajectory.advance_period(&mut ()).unwrap();
    }
    let end = trajectory.state();
    let mut cycle = Trajectory::new(&flow, pair.law(), orbit.strobe);
    (0..orbit.cycle_periods).all(|_| {
        let y = cycle.state();
        cycle.advance_period(&mut ()).unwrap();
        (0..4).any(|i| (y[i] - end[i]).abs() > 1e-3)
    })
}

#[test]
fn cells_agree_with_single_orbits() {
    let scene = scene(24, &[]);
    let plan = Plan::new(&scene);
    let records = on_cpu(&scene);
    let settings = Settings::default();
    let differing: Vec<String> = (0..plan.cell_count() as u32)
        .into_par_iter()
        .filter_map(|id| {
            let (record, pair) = (&records[id as usize], crate::common::pair_at(&plan, id));
            let class = classify(record);
            // A map's cell has a limited budget, a single orbit has not.
            if class == Class::Undecided {
                return None;
            }
            let orbit = analyse(&pair, REST, &settings).unwrap();
            let at = format!("e = {}, omega = {}: {class:?}, {:?}", pair.e, pair.omega, orbit.class);
            if orbit.class != class {
                // Transient chaos may last longer than the cell's budget.
                let transient = class == Class::Chaotic && is_elsewhere(&pair, &orbit, record.periods_run);
                return (!transient).then_some(at);
            }
            if let Class::Periodic { .. } = class {
                let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * (1.0 + b.abs()) || a == b;
                assert!(
                    near(record.lyapunov, orbit.lyapunov),
                    "{at}: {} {}",
                    record.lyapunov,
                    orbit.lyapunov
                );
                assert!(near(record.mesh_fraction, orbit.mesh_fraction), "{at}");
                assert_eq!(record.impacts_per_period, orbit.impacts_per_period, "{at}");
                assert_eq!(record.symmetric == 1, orbit.symmetric.unwrap(), "{at}");
            }
            None
        })
        .collect();
    assert!(differing.is_empty(), "{differing:#?}");
    let undecided = records.iter().filter(|record| classify(record) == Class::Undecided).count();
    assert!(undecided <= 6, "{undecided} of 576 cells undecided");
}

#[test]
fn without_early_stops_every_cell_runs_its_whole_budget() {
    let full = on_cpu(&scene(12, &["integration.early_stop=false"]));
    assert!(full.iter().all(|record| record.periods_run == 528));
    let early = on_cpu(&scene(12, &[]));
    let same = full.iter().zip(&early).filter(|(full, early)| {
        classify(full) == classify(early) && (full.period == 0 || full.word == early.word)
    });
    // tests/lanes/early_stops.rs examines the differing cells.
    assert!(same.count() >= 142);
    assert!(early.iter().filter(|record| record.periods_run < 300).count() > 130);
}

#[test]
fn records_do_not_depend_on_batches_or_threads() {
    let scene = scene(10, &[]);
    let plan = Plan::new(&scene);
    let with = |threads: usize, size: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| computed(&plan, &mut Engine::Cpu(Cpu::new(&plan)), size))
    };
    let one = with(1, 1);
    for (threads, size) in [(1, 100), (2, 7), (5, 33)] {
        assert_eq!(with(threads, size), one, "{threads} threads, batches of {size}");
    }
    let rule = |size| computed(&plan, &mut Engine::Fake(Fake::new(by_id)), size);
    assert_eq!(rule(1), rule(64));
}

#[test]
fn only_requested_quantities_are_recorded() {
    let only = |quantities: &str| on_cpu(&scene(4, &[&format!("outputs.quantities=[{quantities}]")]));
    let bits = valid::STROBE | valid::PERIOD;
    for record in only("\"mesh\"") {
        assert_eq!(record.valid, bits | valid::MESH);
        assert_eq!((record.lyapunov, record.impacts_per_period, record.word), (0.0, 0.0, [0; 4]));
    }
    // The class needs the exponent.
    assert!(only("\"class\"").iter().all(|record| record.valid == bits | valid::LYAPUNOV));
}

/// Computes a record with the cell's number, to detect misplaced records.
fn by_id(cell: &Cell) -> Record {
    Record { period: cell.id + 1, valid: valid::PERIOD, periods_run: 1, ..Record::default() }
}

/// Continues a map after the records of the cells `before` with a fake engine. Returns the result and the stored cells.
fn sweep_fake(plan: &Plan, fake: Fake, before: &[u32]) -> (Result<bool, SweepError>, Vec<u32>) {
    let done: Vec<_> = before.iter().map(|&id| (id, by_id(&plan.cell(id)))).collect();
    let Swept { end, records, stored, .. } = swept(plan, &mut Engine::Fake(fake), &done);
    assert!(stored.iter().all(|&id| records[id as usize].period == id + 1));
    (end, stored)
}

#[test]
fn another_engine_continues_after_a_lost_engine() {
    let scene = scene(20, &[]);
    let plan = Plan::new(&scene);
    let (end, stored) = sweep_fake(&plan, Fake::lost_after(2, by_id), &[]);
    assert!(matches!(end, Err(SweepError::Engine(EngineError::Lost { .. }))), "{end:?}");
    assert!(!stored.is_empty() && stored.len() < plan.cell_count());
    let (end, rest) = sweep_fake(&plan, Fake::new(by_id), &stored);
    assert!(end.unwrap());
    assert_eq!([stored, rest].concat(), plan.order());
}

#[test]
fn batches_shrink_to_the_available_memory() {
    let scene = scene(20, &[]);
    let plan = Plan::new(&scene);
    let (end, stored) = sweep_fake(&plan, Fake::with_memory(3, by_id), &[]);
    assert!(end.unwrap());
    assert_eq!(stored, plan.order());
    let (end, stored) = sweep_fake(&plan, Fake::with_memory(0, by_id), &[]);
    assert!(matches!(end, Err(SweepError::Engine(EngineError::OutOfMemory { cells: 1, .. }))), "{end:?}");
    assert!(stored.is_empty());
}

#[test]
fn records_without_a_request_are_refused() {
    let plan = Plan::new(&scene(41, &["refine.minimum_grid=8"]));
    let replay = |ids: &[u32]| {
        let mut records = vec![Record::default(); plan.cell_count()];
        let stored: Vec<_> = ids.iter().map(|&id| (id, Record::default())).collect();
        sweep::replay(&mut Schedule::new(&plan), &mut records, &stored)
    };
    assert!(replay(&[0, 8, 16]));
    for wrong in [&[0, 8, 8][..], &[1], &[41 * 41], &[u32::MAX]] {
        assert!(!replay(wrong), "{wrong:?}");
    }
}

/// The second sweep continues after half of the records of the first one.
#[test]
fn a_compact_store_holds_the_records_that_a_schedule_reads() {
    let adaptive = ["refine.minimum_grid=8", "refine.max_error=0.02"];
    for sets in [&adaptive[..], &["start.policy=up"]] {
        let scene = scene(33, sets);
        let plan = Plan::new(&scene);
        let mut engine = Engine::Cpu(Cpu::new(&plan));
        let Swept { schedule, mut records, stored, .. } = swept(&plan, &mut engine, &[]);
        let half: Vec<(u32, Record)> =
            stored[..stored.len() / 2].iter().map(|&id| (id, records[id as usize].clone())).collect();
        let (mut again, mut store) = (Schedule::new(&plan), RecordStore::new(plan.run_count(), true));
        assert!(sweep::replay(&mut again, &mut store, &half));
        let ignore = |_: Vec<(u32, Record)>, _: usize| Ok(());
        let halt = Arc::default();
        let run = sweep::run(&plan, &mut again, &mut engine, &mut store, &halt, ignore);
        assert!(pollster::block_on(run).unwrap());
        assert_eq!(schedule.finish(&mut records), again.finish(&mut store));
        assert!(records.iter().enumerate().all(|(id, record)| store.record(id) == *record));
    }
}

/// Cells that take a hundred times as long delay only cells that depend on them, and the map is equal.
#[test]
fn slow_cells_do_not_delay_other_cells() {
    let adaptive = ["refine.minimum_grid=8", "refine.max_error=0.05", "refine.audit=50"];
    for sets in [&[][..], &adaptive] {
        let scene = scene(41, sets);
        let plan = Plan::new(&scene);
        let disc = |cell: &Cell| {
            let [i, j] = [cell.id % 41, cell.id / 41];
            let period = 1 + u32::from(i * i + j * j < 400);
            Record { period, valid: valid::PERIOD, periods_run: 1, ..Record::default() }
        };
        let run = |fake: Fake| {
            let Swept { end, schedule, mut records, stored } = swept(&plan, &mut Engine::Fake(fake), &[]);
            assert!(end.unwrap());
            let refined = schedule.finish(&mut records);
            (stored, records, refined)
        };
        let (mut stored, records, refined) = run(Fake::new(disc));
        let is_slow = |id: u32| id % 7 == 3;
        let fake = Fake::slow(|cell| if cell.id % 7 == 3 { 100 } else { 1 + cell.id % 2 }, disc);
        let (mut late, same_records, same_refined) = run(fake);
        // Slow cells of the coarse grid end after cells that their neighbours made necessary.
        let first_slow = late.iter().position(|&id| is_slow(id)).unwrap();
        assert!(refined.is_none() || first_slow > 36, "{first_slow}");
        assert_eq!(refined, same_refined);
        assert!(records == same_records);
        stored.sort_unstable();
        late.sort_unstable();
        assert_eq!(stored, late);
    }
}

/// End and id of the cells under way.
type Ends = BTreeSet<(u32, u32)>;

/// Compares the time, in periods, until an adaptive map ends, on a device that computes all cells under way in
/// parallel. Records are accepted one by one, after half of the cells under way has ended (as the sweep does), or after
/// all have ended. The last variant is that of hardware: the device is checked every 64 periods while the next 64 run,
/// and records are accepted after at most four checks.
#[test]
fn refinement_waits_less_for_slow_cells_than_rounds_would() {
    let sets = ["refine.minimum_grid=8", "refine.max_error=0.02", "integration.undecided_periods=1584"];
    let plan = Plan::new(&scene(256, &sets));
    let Swept { end, schedule, records: measured, .. } = swept(&plan, &mut Engine::Cpu(Cpu::new(&plan)), &[]);
    assert!(end.unwrap());
    let mut integrated = schedule.sequence().to_vec();
    integrated.sort_unstable();
    let slowest = integrated.iter().map(|&id| measured[id as usize].periods_run).max().unwrap();
    // `wait` returns the time at which records are accepted next, from the ends of the cells under way.
    let periods = |wait: &dyn Fn(u32, &Ends) -> u32| {
        let mut schedule = Schedule::new(&plan);
        let mut records = vec![Record::default(); plan.cell_count()];
        let (mut now, mut under_way) = (0, BTreeSet::new());
        while !schedule.is_finished() {
            let next = schedule.next(&plan, usize::MAX);
            under_way.extend(next.iter().map(|cell| (now + measured[cell.id as usize].periods_run, cell.id)));
            now = wait(now, &under_way);
            let left = under_way.split_off(&(now + 1, 0));
            for (_, id) in std::mem::replace(&mut under_way, left) {
                records[id as usize] = measured[id as usize].clone();
                schedule.take(id, &records);
            }
        }
        let mut requested = schedule.sequence().to_vec();
        requested.sort_unstable();
        assert_eq!(requested, integrated);
        now
    };
    let end = |under_way: &Ends, n: usize| under_way.iter().nth(n).unwrap().0;
    let singly = periods(&|_, under_way| end(under_way, 0));
    let by_halves = periods(&|_, under_way| end(under_way, (under_way.len() - 1) / 2));
    let in_rounds = periods(&|_, under_way| end(under_way, under_way.len() - 1));
    let by_checks = periods(&|now, under_way| {
        let enough = |check: u32| {
            let ended = under_way.range(..(now + 64 * check + 1, 0)).count();
            2 * ended >= under_way.len() || check >= 4 && ended > 0
        };
        now + 64 * (1 + (1..).find(|&check| enough(check)).unwrap())
    });
    println!(
        "slowest cell {slowest} periods; all cells {singly}, by halves {by_halves}, in rounds {in_rounds}, by checks \
         {by_checks}"
    );
    let figures = (slowest, singly, by_halves, in_rounds, by_checks);
    assert!(singly < 4 * slowest && 2 * singly < in_rounds, "{figures:?}");
    assert!(by_halves < 5 * slowest && 3 * by_halves < 2 * in_rounds, "{figures:?}");
    assert!(5 * by_checks < 6 * singly, "{figures:?}");
}
