//! Makes a page that computes a map on demand.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::job::engine_choice::{EngineKind, EngineRequest};
use crate::job::error::JobError;
use crate::job::forecast;
use crate::job::map::MapJob;
use crate::job::observer::Observer;
use crate::job::scene_file::FILES;
use crate::map::scene::{CompanionFile, FileText, Purpose, Scale, Scene, SceneError};
use crate::model_file::FileModel;
use crate::show::{layers, report, words};

/// Largest number of cells along an axis of the map in the page; the page computes finer ones.
const COARSE: usize = 65;

/// Returns the scene with at most 65 cells along each axis, so that its map takes seconds. `sets` are the arguments that the scene was loaded with.
fn coarse(scene: &Scene, sets: &[String]) -> Result<Scene, SceneError> {
    let axes = scene.axes().iter().enumerate();
    let fine = axes.filter(|(_, axis)| axis.scale() != Scale::Values && axis.count() > COARSE);
    let counts = fine.map(|(nth, _)| format!("axis.{nth}.count={COARSE}"));
    let sets: Vec<String> =
        sets.iter().cloned().chain(counts).chain([format!("{FILES}[\"html\"]")]).collect();
    let find = |_: CompanionFile, name: &str| {
        let model = scene.base().downcast_ref::<FileModel>().ok_or("has no file")?;
        Ok(FileText { name: name.to_owned(), text: model.definition().text.clone() })
    };
    Scene::parse_generated(scene.text(), &sets, Purpose::Map, None, &find)
}

/// Computes the map of a scene with at most 65 x 65 cells on the processor, and returns its page; none if `halt` was raised
/// before the end. `sets` are the arguments that the scene was loaded with.
///
/// # Errors
/// [`JobError`] if the scene is not a map's, or the map does not fit this machine.
pub fn page(
    scene: &Scene,
    sets: &[String],
    observer: Arc<dyn Observer>,
    halt: &Arc<AtomicBool>,
) -> Result<Option<Vec<u8>>, JobError> {
    if scene.list().is_some() || scene.start().follows() {
        return Err(JobError::Usage(
            "a page cannot compute parts of a list of cells, or of a map whose cells start from the final states of their \
             neighbours; `rattlemap map` writes a report.html that shows the map and the motion of single cells"
                .to_owned(),
        ));
    }
    let scene = &coarse(scene, sets)?;
    let engine = EngineRequest { kind: EngineKind::Cpu, precision: None, adapter: None };
    let job = MapJob { sets, ..MapJob::new(scene, engine) };
    job.check(None)?;
    let plan = job.plan()?;
    if let Some(warning) = forecast::long_cells(&plan) {
        observer.warn(&warning);
    }
    let mut run = job.open(&plan, None, observer)?.begin()?;
    if !run.integrate(halt)? {
        return Ok(None);
    }
    let map = run.finish();
    let (cells, words) = (map.cells(), words::read(&map.cells()));
    let mut data =
        report::sketched(&cells, &map.description().made, &layers::of(&cells, &words), &words, None);
    data["live"]["at_once"] = true.into();
    let mut page = Vec::new();
    report::write(&mut page, &data).map_err(|error| JobError::Failed(error.to_string()))?;
    Ok(Some(page))
}
