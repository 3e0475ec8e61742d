//! The same scene on every engine: same answers, and where the time goes.
//!
//! The scene is `scenes/e_omega.toml`, which asks for everything; only its number of cells
//! changes. A run goes through the stages of [`Times`]. Sizes are taken in order until the next
//! one would not fit the time or the memory that is left; what was left out is said.
//!
//! Throughput is forcing periods integrated, over all lanes, by the time from handing lanes over
//! to having their records.

pub mod check;
mod figure;
mod instructions;
mod iterations;
pub mod output;
pub mod peak;
mod run;
pub mod work;

use std::time::Instant;

pub use instructions::{Instructions, instructions};
pub use iterations::{LOOPS, counting};
pub use run::{Bench, Run, Times};

use super::statistics::Spread;
use crate::gpu::Precision;
use crate::map::scene::{Purpose, Scene};
use check::Check;
use rattlemap_dynamics::orbit::Class;
use work::Work;

/// The scene's text.
pub const SCENE: &str = include_str!("../../../scenes/e_omega.toml");

/// Sides of the maps: 10^3 to 10^7 lanes, two to a decade.
pub const SIDES: [u32; 9] = [32, 56, 100, 178, 316, 562, 1000, 1778, 3162];

/// Sides that only show that everything works.
pub const QUICK_SIDES: [u32; 2] = [6, 9];

/// Runs of a point, if time allows; [`LEAST_RUNS`] of them in any case.
pub const RUNS: usize = 5;
const FEW_RUNS: usize = 3;

/// A single number says nothing of its spread.
pub const LEAST_RUNS: usize = 2;

/// Points whose runs take longer than this, in seconds, get fewer of them.
const LONG: f64 = 2.0;

/// What a series is measured on.
#[derive(Clone, Debug, PartialEq)]
pub enum Engine {
    /// The reference on so many threads.
    Cpu {
        /// Threads.
        threads: usize,
    },
    /// Lanes on an adapter.
    Gpu {
        /// Their precision.
        precision: Precision,
        /// Its number among the adapters.
        number: usize,
        /// The adapter, as manifests have it.
        device: String,
        /// Whether it is more than a program on the processor.
        is_hardware: bool,
    },
}

impl Engine {
    /// `cpu` or `gpu`.
    pub fn name(&self) -> &'static str {
        match self {
            Engine::Cpu { .. } => "cpu",
            Engine::Gpu { .. } => "gpu",
        }
    }

    /// The precision's name.
    pub fn precision(&self) -> &'static str {
        match self {
            Engine::Cpu { .. } => "f64",
            Engine::Gpu { precision, .. } => precision.name(),
        }
    }

    /// What it runs on, in words.
    pub fn device(&self) -> &str {
        match self {
            Engine::Cpu { .. } => "event-driven reference",
            Engine::Gpu { device, .. } => device,
        }
    }

    /// Threads of the CPU engine.
    pub fn threads(&self) -> Option<usize> {
        match self {
            Engine::Cpu { threads } => Some(*threads),
            Engine::Gpu { .. } => None,
        }
    }

    /// A short name: for legends and progress.
    pub fn label(&self) -> String {
        match self {
            Engine::Cpu { threads: 1 } => "CPU f64, 1 thread".to_owned(),
            Engine::Cpu { threads } => format!("CPU f64, {threads} threads"),
            Engine::Gpu { precision, device, .. } => {
                let name = device.split(" (").next().unwrap_or(device);
                format!("{name}, {}", precision.name())
            }
        }
    }
}

/// Repeated runs of one size.
#[derive(Clone, Debug)]
pub struct Point {
    /// Lanes.
    pub lanes: usize,
    /// Its runs, in order; at least two.
    pub runs: Vec<Run>,
    /// Cells by class: periodic, chaotic, undecided, failed.
    pub classes: [usize; 4],
    /// Cells whose class or period is not that of the series that others are compared with, if
    /// it has this size.
    pub differing: Option<usize>,
}

impl Point {
    /// A number of every run.
    pub fn spread(&self, of: impl Fn(&Run) -> f64) -> Spread {
        Spread::of(self.runs.iter().map(of).collect())
    }
}

/// All sizes on one engine.
#[derive(Clone, Debug)]
pub struct Series {
    /// The engine.
    pub engine: Engine,
    /// Seconds to open the device, compile the lane and ask it for known answers; zero on the CPU.
    pub open_seconds: f64,
    /// Seconds until the first four lanes of the map are back.
    pub first_seconds: f64,
    /// Sizes in order.
    pub points: Vec<Point>,
    /// Sizes left out, and why.
    pub skipped: Vec<(usize, String)>,
    /// How right the largest map is.
    pub check: Option<Check>,
    /// Counted operations per lane-period.
    pub work: Option<Work>,
}

/// The scene with `side` x `side` cells, its table alone to be written.
pub fn scene(side: u32) -> Scene {
    let sets = [
        format!("axis.0.count={side}"),
        format!("axis.1.count={side}"),
        "outputs.files=[\"npy\"]".to_owned(),
    ];
    match Scene::parse(SCENE, "scenes/e_omega.toml", &sets, Purpose::Map) {
        Ok(scene) => scene,
        Err(error) => unreachable!("a scene of the repository: {error}"),
    }
}

/// Sizes and time of a measurement.
pub struct Extent<'a> {
    /// Sides of the maps, from small to large.
    pub sides: &'a [u32],
    /// Runs of a point, if time allows.
    pub runs: usize,
    /// Seconds that the series may take.
    pub seconds: f64,
    /// Says why a map does not fit this machine, if it does not.
    pub misfit: &'a dyn Fn(&Scene) -> Option<String>,
}

/// Classes of the series that others are compared with, by size.
pub type Answers = Vec<(usize, Vec<Class>)>;

impl Series {
    /// Measures every size that fits; `report` is told of each point. Where `answers` is empty
    /// the series' own are put there, else it is compared with them.
    ///
    /// # Errors
    /// If a run fails for another reason than memory, or its table cannot be written.
    pub fn measure(
        bench: &mut Bench<'_>,
        extent: &Extent<'_>,
        answers: &mut Answers,
        report: &mut dyn FnMut(&Engine, &Point),
    ) -> anyhow::Result<Series> {
        let clock = Instant::now();
        let is_first = answers.is_empty();
        let mut series = Series {
            engine: bench.engine().clone(),
            open_seconds: bench.open_seconds(),
            first_seconds: bench.first_seconds(),
            points: Vec::new(),
            skipped: Vec::new(),
            check: None,
            work: None,
        };
        let mut last: Option<(usize, f64)> = None;
        for &side in extent.sides {
            let (scene, lanes) = (scene(side), (side * side) as usize);
            let left = extent.seconds - clock.elapsed().as_secs_f64();
            let foreseen = last.map_or(0.0, |(before, took)| took * lanes as f64 / before as f64);
            let runs = if foreseen > LONG { extent.runs.min(FEW_RUNS) } else { extent.runs };
            if let Some(why) = misfit(extent, &scene, foreseen, left) {
                series.skipped.push((lanes, why));
                continue;
            }
            let measured = match bench.point(&scene, runs, left)? {
                Ok(measured) => measured,
                Err(why) => {
                    series.skipped.push((lanes, why));
                    continue;
                }
            };
            let run::Measured { runs, classes } = measured;
            let of_others = answers.iter().find(|(size, _)| *size == lanes && !is_first);
            let differing = of_others.map(|(_, theirs)| {
                classes.iter().zip(theirs).filter(|(ours, theirs)| ours != theirs).count()
            });
            let counts = crate::map::plan::count_classes(classes.iter().copied());
            let point = Point { lanes, runs, classes: counts, differing };
            last = Some((lanes, point.spread(|run| run.times.total()).median));
            report(&series.engine, &point);
            series.points.push(point);
            if is_first {
                answers.push((lanes, classes));
            }
        }
        Ok(series)
    }

    /// The largest size measured.
    pub fn largest(&self) -> Option<&Point> {
        self.points.last()
    }
}

/// Why a size is left out, if it is.
fn misfit(extent: &Extent<'_>, scene: &Scene, foreseen: f64, left: f64) -> Option<String> {
    let needed = foreseen * LEAST_RUNS as f64;
    if needed > left.max(0.0) {
        return Some(format!("would take about {needed:.0} s, {:.0} s are left", left.max(0.0)));
    }
    (extent.misfit)(scene)
}
