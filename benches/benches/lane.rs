//! Forcing periods per second of lanes. See `README.md`.

use std::time::Instant;

use cpu_time::ProcessTime;
use rattlemap::gpu::{AdapterChoice, Features, Gpu, Lane, LaneSettings, Precision, is_hardware};
use rattlemap_dynamics::machine::{MachineMotion, System};
use rattlemap_dynamics::model::{Form, GearPair, Law, REST};

use rattlemap::cli::bench::spread::Spread;
use rattlemap_bench::shapes::{CHAINS, Chain};

/// Sizes of one run.
struct Size {
    /// Number of cells along each axis.
    side: u32,
    /// Periods per cell.
    periods: u32,
    /// Number of runs. The median is printed.
    runs: usize,
    /// Measured precisions.
    precisions: &'static [Precision],
    /// Whether lanes compute exponents, for each measurement.
    exponents: &'static [bool],
    /// Shapes of machines.
    chains: &'static [Chain],
}

/// Returns the full size for measurements, and a tiny one for tests.
fn size() -> Size {
    let measured = std::env::args().any(|a| a == "--bench") && !std::env::args().any(|a| a == "--test");
    match measured {
        true => {
            let (precisions, exponents) = (&Precision::ALL, &[false, true]);
            Size { side: 48, periods: 100, runs: 5, precisions, exponents, chains: &CHAINS }
        }
        false => {
            let (precisions, exponents) = (&[Precision::F32], &[false]);
            Size { side: 3, periods: 3, runs: 1, precisions, exponents, chains: &CHAINS[..1] }
        }
    }
}

/// Cells over restitution in `[0, 1]` and frequency in `[1, 12]`, from rest.
struct Plane {
    flows: Vec<Form>,
    laws: Vec<Law>,
    lanes: Vec<Lane>,
}

impl Plane {
    fn new(side: u32) -> Plane {
        let at = |i: u32, low: f64, high: f64| low + (high - low) * f64::from(i) / f64::from(side - 1);
        let pair = |e: f64, omega: f64| GearPair { omega, ..GearPair::paper(e) };
        let flows = (0..side)
            .map(|i| Form::from(&pair(0.0, at(i, 1.0, 12.0)).oscillator().expect("valid parameters")));
        let laws = (0..side).map(|i| pair(at(i, 0.0, 1.0), 1.0).law());
        // Blocks of 8 x 8 cells, so that neighbours on the device are neighbours in the plane.
        let mut places: Vec<_> = (0..side * side).map(|i| (i / side, i % side)).collect();
        places.sort_by_key(|&(flow, law)| (flow / 8, law / 8, flow, law));
        let lanes = places.into_iter().map(|(flow, law)| Lane { flow, law, start: REST }).collect();
        Plane { flows: flows.collect(), laws: laws.collect(), lanes }
    }

    /// Integrates every cell. Returns the seconds.
    fn run(&self, gpu: &mut Gpu, size: &Size, exponent: bool) -> f64 {
        let settings = LaneSettings::only(size.periods);
        let features = self.flows.iter().map(Features::of).fold(settings.features, Features::and);
        let settings = LaneSettings { exponent, features, ..settings };
        let start = Instant::now();
        let run = gpu.run(&self.flows, &self.laws, &self.lanes, &settings);
        pollster::block_on(run).expect("the device runs the lanes");
        start.elapsed().as_secs_f64()
    }
}

fn open(precision: Precision) -> Gpu {
    pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).expect("an adapter")
}

/// Returns the processor time of all threads for some work, in seconds. It is less noisy than elapsed time.
fn processor_seconds(work: impl FnOnce()) -> f64 {
    let start = ProcessTime::now();
    work();
    start.elapsed().as_secs_f64()
}

/// Integrates machines from rest. Returns the number of events.
fn on_reference(systems: &[System], periods: u32) -> u64 {
    let events = |system| {
        let mut motion = MachineMotion::new(system, &REST);
        (0..periods).for_each(|_| motion.advance_period(&mut ()).expect("an ordinary cell"));
        motion.work().events
    };
    systems.iter().map(events).sum()
}

/// Prints a table of the times of machines by shape, on the reference and on lanes. Both compute the same cells by turns.
fn of_machines(size: &Size, on_lanes: bool) {
    let precisions = if on_lanes { size.precisions } else { &[] };
    let mut gpus: Vec<_> = precisions.iter().map(|&precision| open(precision)).collect();
    println!(
        "{0} x {0} cells, {1} periods from rest, median of {2} runs",
        size.side, size.periods, size.runs
    );
    println!(
        "us per forcing period of a cell, and per event: of processor time, or of elapsed time on a graphics card"
    );
    let names: String = precisions.iter().map(|precision| format!(" lanes, {precision:?} |")).collect();
    println!("| coordinates | gaps | harmonics | stages | events per period | reference |{names}");
    for chain in size.chains {
        let machines = chain.cells(size.side as usize);
        let systems: Vec<_> = machines.iter().map(System::new).collect();
        let lanes = (0..machines.len() as u32).map(|flow| Lane { flow, law: 0, start: REST }).collect();
        let flows = machines.into_iter().map(Form::Machine).collect();
        let plane = Plane { flows, laws: vec![Law::both(0.0, 0.0)], lanes };
        for gpu in &mut gpus {
            // Compiles the shader.
            plane.run(gpu, &Size { periods: 1, ..*size }, false);
        }
        let mut events = 0;
        let mut times = vec![Vec::new(); 1 + gpus.len()];
        for _ in 0..size.runs {
            times[0].push(processor_seconds(|| events = on_reference(&systems, size.periods)));
            for (times, gpu) in times[1..].iter_mut().zip(&mut gpus) {
                let mut elapsed = 0.0;
                let of_processor = processor_seconds(|| elapsed = plane.run(gpu, size, false));
                times.push(if is_hardware(gpu.adapter()) { elapsed } else { of_processor });
            }
        }
        let (periods, events) = (systems.len() as f64 * f64::from(size.periods), events as f64);
        let of = |times| {
            let micros = 1e6 * Spread::of(times).median;
            format!(" {:.0}, {:.0} |", micros / periods, micros / events)
        };
        let columns: String = times.into_iter().map(of).collect();
        let Chain { coordinates, gaps, harmonics, stages } = chain;
        println!("| {coordinates} | {gaps} | {harmonics} | {stages} | {:.1} |{columns}", events / periods);
    }
}

fn main() {
    let size = size();
    let is_given = |name: &str| std::env::args().any(|argument| argument == name);
    if is_given("machines") {
        let (side, periods) = (size.side.min(8), size.periods.min(20));
        return of_machines(&Size { side, periods, ..size }, !is_given("reference"));
    }
    let plane = Plane::new(size.side);
    let lane_periods = plane.lanes.len() as f64 * f64::from(size.periods);
    println!("{0} x {0} cells, {1} periods from rest, median of {2}", size.side, size.periods, size.runs);
    for &precision in size.precisions {
        let mut gpu = open(precision);
        for &exponent in size.exponents {
            // Compiles the shader.
            plane.run(&mut gpu, &Size { periods: 1, ..size }, exponent);
            let times = (0..size.runs).map(|_| plane.run(&mut gpu, &size, exponent)).collect();
            let rate = lane_periods / Spread::of(times).median;
            println!("{precision:?}, exponent {exponent}: {rate:8.0} lane-periods/s");
        }
    }
}
