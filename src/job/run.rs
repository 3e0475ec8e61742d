//! Computes a whole map in memory with one call.

use std::sync::Arc;

use crate::findings::attractors::{self, Basins};
use crate::findings::coexistence;
use crate::gpu::Precision;
use crate::job::engine_choice::{EngineKind, EngineRequest};
use crate::job::error::JobError;
use crate::job::map::MapJob;
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::map::schedule::Refined;
use crate::record::classify::classify;
use crate::record::{Record, RecordStore, Records};
use rattlemap_dynamics::model::Model;
use rattlemap_dynamics::orbit::Class;

/// Engine of a map in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processor {
    /// The event-driven reference on all processor cores, in f64.
    Cpu,
    /// Lanes on the best graphics device.
    Gpu(Precision),
}

/// Computes every cell of a scene, and returns when all are done.
///
/// A map of a model, without a file:
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
/// Use [`MapJob`] for progress, interruption and records that can be resumed.
///
/// # Errors
/// [`JobError`]. Errors of the scene are found before anything is computed.
pub fn run(scene: &Scene, processor: Processor) -> Result<Map, JobError> {
    let (kind, precision) = match processor {
        Processor::Cpu => (EngineKind::Cpu, None),
        Processor::Gpu(precision) => (EngineKind::Gpu, Some(precision)),
    };
    let job = MapJob::new(scene, EngineRequest { kind, precision, adapter: None });
    job.check(None)?;
    let plan = job.plan()?;
    let mut run = job.open(&plan, None, Arc::new(()))?.begin()?;
    run.integrate(&Arc::default())?;
    let (records, refined) = run.into_records();
    Ok(Map { plan, records, refined })
}

/// A computed map.
#[derive(Clone, Debug)]
pub struct Map {
    plan: Plan,
    records: RecordStore,
    refined: Option<Refined>,
}

/// A cell of a computed map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapCell {
    /// Indices along the two axes; in a list the row and 0.
    pub indices: [usize; 2],
    /// Values of the swept parameters: the axes, or the columns of a list.
    pub values: Vec<f64>,
    /// The measured quantities. The bits of its field `valid` tell which of them are present.
    pub record: Record,
    /// Class of the motion.
    pub class: Class,
}

impl Map {
    /// Number of cells along each axis; a list is one row.
    pub fn counts(&self) -> [usize; 2] {
        self.plan.counts()
    }

    /// Iterates over all cells; the index along the first axis changes fastest. A cell of several starts has the record of
    /// its first start.
    pub fn cells(&self) -> impl ExactSizeIterator<Item = MapCell> {
        (0..self.plan.cell_count() as u32).map(|id| self.cell_of(id))
    }

    /// Returns the cell with these indices.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn cell(&self, indices: [usize; 2]) -> MapCell {
        let [columns, rows] = self.counts();
        assert!(indices[0] < columns && indices[1] < rows, "a map of {columns} by {rows} cells");
        self.cell_of((indices[1] * columns + indices[0]) as u32)
    }

    fn cell_of(&self, id: u32) -> MapCell {
        let indices = self.plan.indices(id);
        let record = self.records.record(id as usize);
        let values = self.plan.points().values(id as usize);
        MapCell { indices, values, class: classify(&record), record }
    }

    /// The model with the parameters of a cell.
    pub fn model(&self, cell: &MapCell) -> Box<dyn Model> {
        self.plan.model((cell.indices[1] * self.counts()[0] + cell.indices[0]) as u32)
    }

    /// The numbered cells.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Records by run number.
    pub fn records(&self) -> &dyn Records {
        &self.records
    }

    /// Refinement of an adaptive map.
    pub fn refined(&self) -> Option<&Refined> {
        self.refined.as_ref()
    }

    /// The attractor that each start leads to. None if no axis sweeps the start.
    pub fn basins(&self) -> Option<Basins> {
        let filled_from = self.refined.as_ref().map_or(&[][..], |refined| &refined.filled_from);
        attractors::basins(&self.plan, &self.records, filled_from)
    }

    /// Number of attractors that the starts of each cell reach, by cell. None if each cell has one start.
    pub fn attractors(&self) -> Option<Vec<u8>> {
        coexistence::attractors(&self.plan, &self.records)
    }
}
