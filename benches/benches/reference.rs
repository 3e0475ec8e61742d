//! Time of the reference per forcing period, per event, per period of a map and per flow. See `README.md`.

#![allow(missing_docs, reason = "criterion's macros generate undocumented functions")]

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use rattlemap_bench::shapes::CHAINS;
use rattlemap_dynamics::machine::{MachineMotion, System};
use rattlemap_dynamics::model::{GearPair, REST, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::orbit::{Budget, Settings, measure};

/// Sizes of one run.
#[derive(Clone, Copy)]
struct Size {
    /// Number of cells along each axis.
    side: usize,
    /// Periods before the measurement.
    transient: u64,
    /// Timed periods per cell and iteration.
    periods: u64,
}

/// Returns the full size for measurements, and a tiny one for tests.
fn size() -> Size {
    if std::env::args().any(|argument| argument == "--test") || !std::env::args().any(|a| a == "--bench") {
        Size { side: 2, transient: 5, periods: 2 }
    } else {
        Size { side: 10, transient: 200, periods: 200 }
    }
}

struct Cell {
    pair: GearPair,
    flow: Flow,
}

/// Returns cells over restitution in `[0, 1]` and a range of frequencies.
fn grid(side: usize, [low, high]: [f64; 2]) -> Vec<Cell> {
    let at = |i: usize, low: f64, high: f64| low + (high - low) * i as f64 / (side - 1) as f64;
    (0..side * side)
        .map(|i| {
            let pair = GearPair { omega: at(i / side, low, high), ..GearPair::paper(at(i % side, 0.0, 1.0)) };
            Cell { pair, flow: Flow::new(&pair.oscillator().expect("valid parameters")) }
        })
        .collect()
}

/// Returns trajectories of all cells after the transient.
fn trajectories_of<const N: usize>(
    cells: &[Cell],
    transient: u64,
    tangents: [State; N],
) -> Vec<Trajectory<'_, N>> {
    let settle = |cell: &'_ Cell| -> State {
        let mut trajectory = Trajectory::new(&cell.flow, cell.pair.law(), REST);
        advance(&mut trajectory, transient);
        trajectory.state()
    };
    cells
        .iter()
        .map(|cell| Trajectory::with_tangents(&cell.flow, cell.pair.law(), settle(cell), tangents))
        .collect()
}

fn advance<const N: usize>(trajectory: &mut Trajectory<'_, N>, periods: u64) {
    for _ in 0..periods {
        trajectory.advance_period(&mut ()).expect("an ordinary cell");
    }
}

/// Times the periods of all cells.
fn run<const N: usize>(
    c: &mut Criterion,
    group: &str,
    band: [f64; 2],
    tangents: [State; N],
    per_event: bool,
) {
    let size = size();
    let cells = grid(size.side, band);
    let start = trajectories_of(&cells, size.transient, tangents);
    let work = |trajectories: &mut Vec<Trajectory<'_, N>>| {
        for trajectory in trajectories {
            advance(trajectory, size.periods);
            black_box(trajectory.state());
        }
    };
    let mut first = start.clone();
    work(&mut first);
    let events: u64 = first.iter().map(|trajectory| trajectory.work().events).sum();
    let periods = cells.len() as u64 * size.periods;
    println!("{group}: {} cells, {periods} periods, {events} events", cells.len());
    let mut group = c.benchmark_group(group);
    group.throughput(Throughput::Elements(if per_event { events.max(1) } else { periods }));
    group.sample_size(10);
    group.bench_function(format!("{} cells", cells.len()), |b| {
        b.iter_batched_ref(|| start.clone(), work, BatchSize::LargeInput);
    });
    group.finish();
}

fn per_period(c: &mut Criterion) {
    run(c, "per period", [4.5, 12.0], [], false);
}

fn per_period_with_tangent(c: &mut Criterion) {
    run(c, "per period, one tangent vector", [4.5, 12.0], [state(&[1.0])], false);
}

fn per_event(c: &mut Criterion) {
    run(c, "per event", [1.0, 4.5], [], true);
}

/// Times cells of a map of classes, from rest until they are decided.
fn per_period_of_a_map(c: &mut Criterion) {
    let cells = grid(size().side, [1.0, 12.0]);
    let budget = Budget {
        settings: Settings::default(),
        early_stop: true,
        undecided_periods: 0,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: false,
        quantities: false,
    };
    let work = || -> u64 {
        let periods = |cell: &Cell| measure(&cell.flow, cell.pair.law(), REST, &budget).periods_run;
        cells.iter().map(|cell| u64::from(periods(cell))).sum()
    };
    let periods = work();
    println!("per period of a map: {} cells, {periods} periods", cells.len());
    let mut group = c.benchmark_group("per period of a map");
    group.throughput(Throughput::Elements(periods));
    group.sample_size(10);
    group.bench_function(format!("{} cells", cells.len()), |b| b.iter(|| black_box(work())));
    group.finish();
}

/// Times chains of masses on the engine of machines.
fn per_period_of_machines(c: &mut Criterion) {
    let size = size();
    // Machines take longer than oscillators of two coordinates.
    let (side, periods) = (size.side.div_ceil(2), size.periods / 10 + 1);
    let mut group = c.benchmark_group("per period of machines");
    group.throughput(Throughput::Elements((side * side) as u64 * periods));
    group.sample_size(10);
    for chain in CHAINS {
        let systems: Vec<_> = chain.cells(side).iter().map(System::new).collect();
        let work = |motions: &mut Vec<MachineMotion<'_>>, periods: u64| {
            for motion in motions {
                (0..periods).for_each(|_| motion.advance_period(&mut ()).expect("an ordinary cell"));
            }
        };
        let mut start: Vec<_> = systems.iter().map(|system| MachineMotion::new(system, &REST)).collect();
        work(&mut start, size.transient / 4);
        group.bench_function(chain.name(), |b| {
            b.iter_batched_ref(|| start.clone(), |motions| work(motions, periods), BatchSize::LargeInput)
        });
    }
    group.finish();
}

fn flow(c: &mut Criterion) {
    let oscillator = GearPair::paper(0.5).oscillator().expect("valid parameters");
    c.bench_function("flow of one frequency", |b| b.iter(|| Flow::new(black_box(&oscillator))));
}

criterion_group! {
    name = benches;
    // Plots would need fonts of the system.
    config = Criterion::default().without_plots();
    targets = per_period, per_period_with_tangent, per_event, per_period_of_a_map,
        per_period_of_machines, flow
}
criterion_main!(benches);
