//! Forcing periods per second of lanes, and of two other variants of their shader. See `README.md`.

use std::time::Instant;

use rattlemap::gpu::{AdapterChoice, Features, Gpu, Lane, LaneSettings, Precision};
use rattlemap::record::Record;
use rattlemap_dynamics::model::{GearPair, Law, Oscillator, REST};

use rattlemap::cli::bench::spread::Spread;
use rattlemap_bench::shapes::{SHAPES, Shape};

/// Returns a variant of the shader.
type Rewrite = fn(String) -> String;

/// Variants that must give equal results: the shader as it is, one that searches events inside the loop over steps, and one
/// that leaves constants in storage.
const VARIANTS: [(&str, Rewrite); 3] = [("as it is", |source| source), ("naive", naive), ("stored", stored)];

/// Searches events at each step.
fn naive(source: String) -> String {
    let one_step = replace(
        &source,
        "        if iterations >= settings.iterations {\n            verdict = SCAN_BUDGET;",
        "        if step_count > 0u {\n            verdict = 2u;\n            break;\n        }\n        \
         if iterations >= settings.iterations {\n            verdict = SCAN_BUDGET;",
    );
    replace(
        &one_step,
        "        if scan() == SCAN_BUDGET {\n            break;\n        }\n",
        "        let verdict = scan();\n        if verdict == SCAN_BUDGET {\n            break;\n        }\n        \
         if verdict == 2u {\n            continue;\n        }\n",
    )
}

/// Reads constants from storage, without a copy in the lane.
fn stored(source: String) -> String {
    replace(&source, "const KEEP: bool = true;", "const KEEP: bool = false;")
}

fn replace(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the shader has no {from}");
    text.replace(from, to)
}

/// Sizes of one run.
struct Size {
    /// Number of cells along each axis.
    side: u32,
    /// Periods per cell.
    periods: u32,
    /// Number of runs of each variant. The median is printed.
    runs: usize,
    /// Measured precisions.
    precisions: &'static [Precision],
    /// Whether lanes compute exponents, for each measurement.
    exponents: &'static [bool],
    /// Shapes of oscillators.
    shapes: &'static [Shape],
}

/// Returns the full size for measurements, and a tiny one for tests.
fn size() -> Size {
    let measured = std::env::args().any(|a| a == "--bench") && !std::env::args().any(|a| a == "--test");
    match measured {
        true => {
            let (precisions, exponents) = (&Precision::ALL, &[false, true]);
            Size { side: 48, periods: 100, runs: 5, precisions, exponents, shapes: &SHAPES }
        }
        false => {
            let (precisions, exponents) = (&[Precision::F32], &[false]);
            Size { side: 3, periods: 3, runs: 1, precisions, exponents, shapes: &SHAPES[..1] }
        }
    }
}

/// Cells over restitution in `[0, 1]` and frequency in `[1, 12]`, from rest.
struct Plane {
    flows: Vec<Oscillator>,
    laws: Vec<Law>,
    lanes: Vec<Lane>,
}

impl Plane {
    fn new(side: u32) -> Plane {
        let at = |i: u32, low: f64, high: f64| low + (high - low) * f64::from(i) / f64::from(side - 1);
        let pair = |e: f64, omega: f64| GearPair { omega, ..GearPair::paper(e) };
        let flows = (0..side).map(|i| pair(0.0, at(i, 1.0, 12.0)).oscillator().expect("valid parameters"));
        let laws = (0..side).map(|i| pair(at(i, 0.0, 1.0), 1.0).law());
        // Blocks of 8 x 8 cells, so that neighbours on the device are neighbours in the plane.
        let mut places: Vec<_> = (0..side * side).map(|i| (i / side, i % side)).collect();
        places.sort_by_key(|&(flow, law)| (flow / 8, law / 8, flow, law));
        let lanes = places.into_iter().map(|(flow, law)| Lane { flow, law, start: REST }).collect();
        Plane { flows: flows.collect(), laws: laws.collect(), lanes }
    }

    /// Integrates every cell. Returns the seconds and the records.
    fn run(&self, gpu: &mut Gpu, size: &Size, exponent: bool) -> (f64, Vec<Record>) {
        let settings = LaneSettings::only(size.periods);
        let features = self.flows.iter().map(Features::of).fold(settings.features, Features::and);
        let settings = LaneSettings { exponent, features, ..settings };
        let start = Instant::now();
        let run = gpu.run(&self.flows, &self.laws, &self.lanes, &settings);
        let records = pollster::block_on(run).expect("the device runs the lanes");
        (start.elapsed().as_secs_f64(), records)
    }
}

fn open(precision: Precision, rewrite: Rewrite) -> Gpu {
    let mut gpu = pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).expect("an adapter");
    gpu.rewrite_shaders(rewrite);
    gpu
}

/// Returns the seconds of each variant. They run alternately, so that changes of the machine's speed affect all of them.
fn seconds(plane: &Plane, size: &Size, gpus: &mut [Gpu], exponent: bool) -> Vec<f64> {
    for gpu in gpus.iter_mut() {
        // Compiles the shader.
        plane.run(gpu, &Size { periods: 1, ..*size }, exponent);
    }
    let mut times = vec![Vec::new(); gpus.len()];
    for _ in 0..size.runs {
        for (times, gpu) in times.iter_mut().zip(gpus.iter_mut()) {
            times.push(plane.run(gpu, size, exponent).0);
        }
    }
    times.into_iter().map(|times| Spread::of(times).median).collect()
}

/// Times lanes by the shape of their oscillators. Shapes run by turns.
fn by_shape(plane: &Plane, size: &Size) {
    let shaped = |shape: &Shape| Plane {
        flows: plane.flows.iter().map(|flow| shape.of(flow)).collect(),
        laws: plane.laws.clone(),
        lanes: plane.lanes.clone(),
    };
    let planes: Vec<Plane> = size.shapes.iter().map(shaped).collect();
    let lane_periods = plane.lanes.len() as f64 * f64::from(size.periods);
    for &precision in size.precisions {
        println!("{precision:?}, by shape");
        let mut gpu = open(precision, |source| source);
        for plane in &planes {
            // Compiles the shader.
            plane.run(&mut gpu, &Size { periods: 1, ..*size }, false);
        }
        let mut times = vec![Vec::new(); planes.len()];
        for _ in 0..size.runs {
            for (times, plane) in times.iter_mut().zip(&planes) {
                times.push(plane.run(&mut gpu, size, false).0);
            }
        }
        let times: Vec<f64> = times.into_iter().map(|times| Spread::of(times).median).collect();
        for (time, shape) in times.iter().zip(size.shapes) {
            let (cost, ratio) = (1e6 * time / lane_periods, time / times[0]);
            println!(
                "  {:<34} {cost:8.2} us per lane-period, {ratio:.2} times the time of the first",
                shape.name()
            );
        }
    }
}

fn main() {
    let size = size();
    let plane = Plane::new(size.side);
    if std::env::args().any(|a| a == "shapes") {
        return by_shape(&plane, &size);
    }
    let lane_periods = plane.lanes.len() as f64 * f64::from(size.periods);
    println!("{0} x {0} cells, {1} periods from rest, median of {2}", size.side, size.periods, size.runs);
    for &precision in size.precisions {
        for &exponent in size.exponents {
            println!("{precision:?}, exponent {exponent}");
            let mut gpus: Vec<_> = VARIANTS.iter().map(|&(_, rewrite)| open(precision, rewrite)).collect();
            let times = seconds(&plane, &size, &mut gpus, exponent);
            for (time, (name, _)) in times.iter().zip(VARIANTS) {
                println!(
                    "  {name:<9} {:8.0} lane-periods/s, {:.2} times the time of the first",
                    lane_periods / time,
                    time / times[0],
                );
            }
            let results: Vec<_> = gpus.iter_mut().map(|gpu| plane.run(gpu, &size, exponent).1).collect();
            assert!(results.iter().all(|other| *other == results[0]), "the results of the variants differ");
        }
    }
}
