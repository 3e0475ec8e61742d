//! Finds the bifurcation curves of a finished map.

use std::path::Path;

use serde_json::Value;

use crate::job::error::JobError;
use crate::job::finished::{self, LoadedMap};
use crate::job::observer::Observer;
use crate::map::curves::{self, Curves, Search, Watch};
use crate::map::scene::{Quantity, Scene};
use crate::model_file::subjects;
use crate::record::measures::{self, Measure};
use crate::show::cells::{Cells, Survey};
use crate::show::layers::{self, Layer};
use crate::show::{report, words};
use crate::store::finished_map::FinishedMap;

/// A finished map whose curves can be found.
pub struct CurvesJob {
    map: FinishedMap,
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
        CurvesJob::require(&scene, dir)?;
        let mut loaded = LoadedMap::read(&map, &scene, observer)?;
        let survey = loaded.survey();
        Ok(CurvesJob { map, scene, loaded, survey })
    }

    /// Checks that the map of a scene can have curves. `source`: where the scene is from.
    ///
    /// # Errors
    /// [`JobError`] as for [`open`](Self::open).
    pub fn require(scene: &Scene, source: &Path) -> Result<(), JobError> {
        let refuse = |reason: String| Err(JobError::Usage(format!("{}: {reason}", source.display())));
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
        Ok(())
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

    /// What the page of the map shows, with curves.
    pub fn page(&self, layers: &[Layer], found: &Curves) -> Value {
        let cells = self.cells();
        let made = self.map.manifest().provenance();
        let mut data = report::sketched(&cells, &made, layers, &words::read(&cells), None);
        report::add_curves(&mut data, &self.scene, found);
        data
    }

    /// Reads values of both axes of a scene from a text `NAME=VALUE,NAME=VALUE`.
    ///
    /// # Errors
    /// [`JobError`] if an axis has no value, or none within its range.
    pub fn place(scene: &Scene, text: &str) -> Result<[f64; 2], JobError> {
        let mut values = [None; 2];
        for (axis, value) in on_axes(scene, "--from", text)? {
            values[axis] = Some(value);
        }
        match values {
            [Some(x), Some(y)] => Ok([x, y]),
            _ => Err(JobError::Usage(format!("--from {text}: both axes need a value"))),
        }
    }

    /// Reads the values `NAME=VALUE,...` of axes at which points of curves are located: axes and values.
    ///
    /// # Errors
    /// [`JobError`] if a value is not in the range of an axis.
    pub fn through(scene: &Scene, text: &str) -> Result<Vec<(usize, f64)>, JobError> {
        on_axes(scene, "--through", text)
    }

    /// Reads a condition `QUANTITY=VALUE`.
    ///
    /// # Errors
    /// [`JobError`] if the map has no such quantity.
    pub fn condition(scene: &Scene, text: &str) -> Result<(Measure, f64), JobError> {
        let refuse = |reason: String| JobError::Usage(format!("--condition {text}: {reason}"));
        let parts =
            text.split_once('=').and_then(|(name, value)| Some((name.trim(), value.trim().parse().ok()?)));
        let (name, value): (&str, f64) = parts
            .filter(|(_, value): &(_, f64)| value.is_finite())
            .ok_or_else(|| refuse("it is not QUANTITY=VALUE".to_owned()))?;
        let names = subjects(scene.base());
        let quantities = &scene.outputs().quantities;
        let is_there =
            |measure: &Measure| quantities.iter().any(|quantity| quantity.name() == measure.group.name);
        let known: Vec<Measure> =
            measures::all().chain(measures::of_gaps()).filter(|measure| measure.is_of(&names)).collect();
        let Some(measure) = known.iter().find(|measure| measure.name(&names) == name) else {
            let list: Vec<String> = known.iter().map(|measure| measure.name(&names)).collect();
            return Err(refuse(format!("there is no quantity `{name}`; the model has {}", list.join(", "))));
        };
        if measure.group.name == "multiplier" {
            return Err(refuse(
                "a multiplier is no condition; a fold or a flip has the multiplier 1 or -1".to_owned(),
            ));
        }
        if !is_there(measure) {
            let quantity = measure.group.name;
            return Err(refuse(format!(
                "the map has no {name}; add \"{quantity}\" to outputs.quantities and make the map again"
            )));
        }
        Ok((*measure, value))
    }

    /// Finds the curves. What is found when `halt` is raised is kept. `known`: what an interrupted search has found.
    pub fn find(&self, search: &Search<'_>, known: Curves, watch: &Watch<'_>) -> Curves {
        curves::curves(&self.scene, &self.loaded.plan, &self.loaded.stored.records, search, known, watch)
    }
}

/// Reads values of axes of a scene from a text `NAME=VALUE,...`. `option` begins messages.
fn on_axes(scene: &Scene, option: &str, text: &str) -> Result<Vec<(usize, f64)>, JobError> {
    let refuse = |reason: String| JobError::Usage(format!("{option} {text}: {reason}"));
    let read = |part: &str| {
        let (name, value) =
            part.split_once('=').ok_or_else(|| refuse(format!("`{part}` is not NAME=VALUE")))?;
        let axes = scene.axes();
        let at = axes.iter().position(|axis| axis.parameter().name == name.trim());
        let at = at.ok_or_else(|| refuse(format!("the map has no axis `{}`", name.trim())))?;
        let (value, axis) = (value.trim().parse::<f64>().ok(), &axes[at]);
        let inside = value.filter(|value| (axis.min()..=axis.max()).contains(value));
        let range = || format!("{} needs a number from {} to {}", name.trim(), axis.min(), axis.max());
        Ok((at, inside.ok_or_else(|| refuse(range()))?))
    };
    text.split(',').map(read).collect()
}
