//! Finds the bifurcation curves of a finished map.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::job::error::JobError;
use crate::job::finished::{self, LoadedMap};
use crate::job::observer::Observer;
use crate::map::curves::{self, Curves, Search};
use crate::map::scene::{Quantity, Scene};
use crate::show::cells::{Cells, Survey};
use crate::show::layers::{self, Layer};
use crate::show::words;
use crate::store::finished_map::FinishedMap;

/// A finished map whose curves can be found.
pub struct CurvesJob {
    scene: Scene,
    loaded: LoadedMap,
    survey: Survey,
}

impl CurvesJob {
    /// Reads a finished map, and checks that its cells have cycles that can be followed.
    ///
    /// # Errors
    /// [`JobError`] if the folder is not one of a finished map of this version, or its axes are not two parameters.
    pub fn open(dir: &Path, observer: &dyn Observer) -> Result<CurvesJob, JobError> {
        let map = FinishedMap::open_own(dir)?;
        let scene = finished::scene(&map)?;
        let refuse = |reason: String| Err(JobError::Usage(format!("{}: {reason}", dir.display())));
        if scene.axes().len() != 2 || scene.sweeps_start() {
            return refuse("curves need a map over two parameters".to_owned());
        }
        if !scene.outputs().quantities.contains(&Quantity::Class) {
            return refuse(
                "curves need classes; add \"class\" to outputs.quantities and make the map again".to_owned(),
            );
        }
        if let Some((derived, axis)) = scene.derived_along_axes() {
            return refuse(format!(
                "[derived] changes {derived} with {axis}, and curves change the axes alone; write the expression into the model file instead"
            ));
        }
        let mut loaded = LoadedMap::read(&map, &scene, observer)?;
        let survey = loaded.survey();
        Ok(CurvesJob { scene, loaded, survey })
    }

    /// The map's scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The map's cells.
    pub fn cells(&self) -> Cells<'_> {
        self.loaded.cells(&self.scene, &self.survey)
    }

    /// The layers of the map.
    pub fn layers(&self) -> Vec<Layer> {
        let cells = self.cells();
        layers::of(&cells, &words::read(&cells))
    }

    /// Finds the curves. `progress` gets the number of examined pairs of cells, and of all. What is found when `halt` is raised is kept.
    pub fn find(
        &self,
        search: &Search<'_>,
        progress: &(dyn Fn(usize, usize) + Sync),
        halt: &AtomicBool,
    ) -> Curves {
        curves::curves(&self.scene, &self.loaded.plan, &self.loaded.stored.records, search, progress, halt)
    }
}
