//! A whole map at once, for who needs neither files nor progress.

use std::sync::Arc;

use thiserror::Error;

use crate::findings::attractors::{self, Basins};
use crate::findings::coexistence;
#[cfg(feature = "gpu")]
use crate::gpu::Precision;
#[cfg(feature = "gpu")]
use crate::job::engine_choice::{self, Ask, ChoiceError, Who};
use crate::map::engine::{Cpu, Engine};
use crate::map::plan::{NoMotion, Plan};
use crate::map::scene::Scene;
use crate::map::schedule::{Refined, Schedule};
use crate::map::sweep::{self, SweepError};
use crate::record::Record;
use crate::record::classify::classify;
use rattlemap_dynamics::model::Model;
use rattlemap_dynamics::orbit::Class;

/// Who computes a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processor {
    /// The event-driven reference on all processor cores, in f64.
    Cpu,
    /// Lanes on the best graphics device that there is.
    #[cfg(feature = "gpu")]
    Gpu(Precision),
}

/// Why there is no map.
#[derive(Debug, Error)]
pub enum MapError {
    /// The scene is not one of a map.
    #[error("a map has two axes or a list of cells, and this scene has {axes} axes")]
    Axes {
        /// How many the scene has.
        axes: usize,
    },
    /// More runs than can be numbered.
    #[error("{runs} runs are more than the {} that can be numbered; lower the axes' counts", u32::MAX)]
    TooLarge {
        /// Cells times starts per cell.
        runs: u64,
    },
    /// The model has no motion somewhere.
    #[error(transparent)]
    NoMotion(#[from] NoMotion),
    /// There is no such engine.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Choice(#[from] ChoiceError),
    /// The engine failed on the way.
    #[error(transparent)]
    Sweep(#[from] SweepError),
}

/// Computes every cell of a scene, and comes back once that is done.
///
/// A map of any model, without a file:
///
/// ```
/// use rattlemap::map::scene::{Quantity, Scene};
/// use rattlemap::job::{self, Processor};
/// use rattlemap::model::Stops;
///
/// let model = Stops { r: 0.1, k: 1.0, ..Stops::with_restitution(0.8) };
/// let scene = Scene::builder(model)
///     .axis("F", 0.2..=2.0, 6)
///     .axis("omega", 0.5..=1.5, 6)
///     .quantities(&[Quantity::Class, Quantity::Impacts])
///     .build()?;
/// let map = job::run(&scene, Processor::Cpu)?;
/// for cell in map.cells() {
///     let (force, omega) = (cell.values[0], cell.values[1]);
///     println!("{force} {omega}: {:?}, {} impacts", cell.class, cell.record.impacts_per_period);
/// }
/// # use rattlemap::orbit::Class;
/// # assert_eq!(map.cells().len(), 36);
/// # assert!(map.cells().all(|cell| cell.class != Class::Failed));
/// # assert!(map.cell([5, 2]).record.impacts_per_period > 0.5, "{:?}", map.cell([5, 2]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// What wants to be told of progress, to stop on the way or to go on later drives
/// [`sweep::run`] itself.
///
/// # Errors
/// [`MapError`]: those of the scene before anything is computed.
pub fn run(scene: &Scene, on: Processor) -> Result<Map, MapError> {
    if scene.axes().len() != 2 && scene.list().is_none() {
        return Err(MapError::Axes { axes: scene.axes().len() });
    }
    let runs = scene.run_count();
    if u32::try_from(runs).is_err() {
        return Err(MapError::TooLarge { runs });
    }
    let plan = Plan::new(scene);
    plan.check()?;
    let mut schedule = Schedule::new(&plan);
    let mut records = vec![Record::default(); plan.run_count()];
    let mut engine = open(&plan, on)?;
    let (halt, keep) = (Arc::default(), |_: &[(u32, Record)], _| Ok(()));
    pollster::block_on(sweep::run(&plan, &mut schedule, &mut engine, &mut records, &halt, keep))?;
    drop(engine);
    let refined = schedule.finish(&mut records);
    Ok(Map { plan, records, refined })
}

fn open(plan: &Plan, on: Processor) -> Result<Engine<'_>, MapError> {
    match on {
        Processor::Cpu => Ok(Engine::Cpu(Cpu::new(plan))),
        #[cfg(feature = "gpu")]
        Processor::Gpu(precision) => {
            let ask = Ask { engine: Who::Gpu, precision: Some(precision), adapter: None };
            Ok(pollster::block_on(engine_choice::open(plan, &ask))?.engine)
        }
    }
}

/// A finished map.
#[derive(Clone, Debug)]
pub struct Map {
    plan: Plan,
    records: Vec<Record>,
    refined: Option<Refined>,
}

/// One cell of a finished map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapCell<'m> {
    /// Places on the two axes; in a list its place, and 0.
    pub indices: [usize; 2],
    /// Of the axes' parameters; in a list of its columns.
    pub values: Vec<f64>,
    /// What was measured; its bits in `valid` say what of it there is.
    pub record: &'m Record,
    /// What the motion is.
    pub class: Class,
}

impl Map {
    /// How many cells lie along each axis; a list is one row.
    pub fn counts(&self) -> [usize; 2] {
        self.plan.counts()
    }

    /// Every cell, the first axis the fastest. Of several starts each has the first.
    pub fn cells(&self) -> impl ExactSizeIterator<Item = MapCell<'_>> {
        (0..self.plan.cell_count() as u32).map(|id| self.cell_of(id))
    }

    /// The cell at these places on the axes.
    ///
    /// # Panics
    /// If there is none.
    pub fn cell(&self, indices: [usize; 2]) -> MapCell<'_> {
        let [columns, rows] = self.counts();
        assert!(indices[0] < columns && indices[1] < rows, "a map of {columns} by {rows} cells");
        self.cell_of((indices[1] * columns + indices[0]) as u32)
    }

    fn cell_of(&self, id: u32) -> MapCell<'_> {
        let indices = self.plan.indices(id);
        let record = &self.records[id as usize];
        let values = self.plan.points().values(id as usize);
        MapCell { indices, values, record, class: classify(record) }
    }

    /// The model in a cell.
    pub fn model(&self, cell: &MapCell<'_>) -> Box<dyn Model> {
        self.plan.model((cell.indices[1] * self.counts()[0] + cell.indices[0]) as u32)
    }

    /// The map as numbered cells.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// One record per run, by its number in the plan.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// What became of an adaptive map.
    pub fn refined(&self) -> Option<&Refined> {
        self.refined.as_ref()
    }

    /// To which attractor each start leads; none where no axis sweeps the start.
    pub fn basins(&self) -> Option<Basins> {
        let filled_from = self.refined.as_ref().map_or(&[][..], |refined| &refined.filled_from);
        attractors::basins(&self.plan, &self.records, filled_from)
    }

    /// On how many attractors the starts of each cell end, by id; none where each has one start.
    pub fn attractors(&self) -> Option<Vec<u8>> {
        coexistence::attractors(&self.plan, &self.records)
    }
}
