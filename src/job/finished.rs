//! Loads finished maps from their folders, and names damaged files.

use std::path::Path;

use crate::job::error::JobError;
use crate::job::observer::Observer;
use crate::job::size;
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::show::cells::{Cells, Survey};
use crate::store::finished_map::{FinishedMap, FinishedMapError, StoredRecords};
use crate::store::inventory::Finding;
use crate::text::shell::quoted;

/// Returns the scene of a finished map, if the map fits this machine.
///
/// # Errors
/// [`JobError`] if the scene is wrong or its map too large.
pub(crate) fn scene(map: &FinishedMap) -> Result<Scene, JobError> {
    let scene = map.scene()?;
    size::check_finished(&scene)?;
    Ok(scene)
}

/// The cells and records of a finished map.
pub(crate) struct LoadedMap {
    pub(crate) plan: Plan,
    pub(crate) stored: StoredRecords,
    /// Name of the engine that computed the records.
    engine: String,
}

impl LoadedMap {
    /// Reads all records. Damage that affects no record is reported to the observer.
    ///
    /// # Errors
    /// [`JobError`] if records are missing, damaged, or of another map.
    pub(crate) fn read(
        map: &FinishedMap,
        scene: &Scene,
        observer: &dyn Observer,
    ) -> Result<LoadedMap, JobError> {
        let plan = Plan::new(scene);
        plan.check()?;
        let stored = map.records(scene, &plan)?;
        if let Some(warning) = &stored.warning {
            observer.warn(warning);
        }
        Ok(LoadedMap { plan, stored, engine: map.manifest().engine.clone() })
    }

    /// Analyses all records together.
    pub(crate) fn survey(&mut self) -> Survey {
        Survey::of(&self.plan, &self.stored.records, self.stored.refined.take())
    }

    /// The cells, for tables and figures.
    pub(crate) fn cells<'a>(&'a self, scene: &'a Scene, survey: &'a Survey) -> Cells<'a> {
        Cells::new(scene, &self.plan, &self.stored.records).surveyed(survey).computed_by(&self.engine)
    }
}

/// Checks that a path is a folder, before its lock is taken.
///
/// # Errors
/// [`FinishedMapError::NoFolder`].
pub(crate) fn require_folder(dir: &Path) -> Result<(), FinishedMapError> {
    if dir.is_dir() { Ok(()) } else { Err(FinishedMapError::NoFolder { folder: dir.to_owned() }) }
}

/// Lists the damaged and missing files of a folder.
pub(crate) fn damage<'f>(dir: &Path, lost: impl IntoIterator<Item = &'f Finding>) -> String {
    let names: Vec<String> =
        lost.into_iter().map(|finding| finding.name.escape_debug().to_string()).collect();
    format!("{}: damaged or missing: {}", dir.display(), names.join(", "))
}

/// Returns the command that repairs a folder.
pub(crate) fn repair_command(dir: &Path) -> String {
    format!("rattlemap check {} --repair", quoted(&dir.display().to_string()))
}
