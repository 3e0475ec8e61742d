//! Scenes.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use rattlemap::job::scene_file::SceneFile;
use rattlemap::map::scene::{Along, CompanionFile, FileText, Purpose, Scene as LibraryScene};
use rattlemap::model::Model as _;
use rattlemap::model_file::FileModel;

use crate::problem::Problem;

/// The purpose of a scene, and the line of a bifurcation diagram through a plane.
#[derive(Clone)]
pub(crate) struct Use {
    purpose: Purpose,
    pub(crate) along: Option<Along>,
}

impl Use {
    fn new(purpose: &str, along: Option<Line>) -> Result<Use, Problem> {
        let purpose = match purpose {
            "map" => Purpose::Map,
            "bifurcation" => Purpose::Bifurcation,
            _ => return Err(Problem::scene(format!("`{purpose}` is neither map nor bifurcation"))),
        };
        Ok(Use { purpose, along: along.map(|(parameter, at)| Along { parameter, at }) })
    }
}

/// A scene that has been checked.
#[pyclass(frozen, module = "rattlemap._native")]
pub(crate) struct Scene {
    pub(crate) scene: Arc<LibraryScene>,
    pub(crate) sets: Vec<String>,
    pub(crate) purpose: Use,
}

/// A parameter, and the values of the other axes.
type Line = (String, Vec<String>);

/// The arguments of [`Scene::new`].
type Arguments = (String, Vec<String>, Option<(String, String)>, Option<String>, String, Option<Line>);

#[pymethods]
impl Scene {
    /// Reads a text that the package has written. `model`: name and text of the model's file that the scene names. `cells`: the
    /// table of a list of cells.
    #[new]
    #[pyo3(signature = (text, sets=Vec::new(), model=None, cells=None, purpose="map", along=None))]
    fn new(
        text: &str,
        sets: Vec<String>,
        model: Option<(String, String)>,
        cells: Option<String>,
        purpose: &str,
        along: Option<Line>,
    ) -> Result<Scene, Problem> {
        let checked = Use::new(purpose, along)?;
        let find = |what: CompanionFile, _: &str| match (what, &model, &cells) {
            (CompanionFile::Model, Some((name, text)), _) => {
                Ok(FileText { name: name.clone(), text: text.clone() })
            }
            (CompanionFile::Cells, _, Some(text)) => {
                Ok(FileText { name: "cells".to_owned(), text: text.clone() })
            }
            _ => Err("names a file, but none was given".to_owned()),
        };
        let scene =
            LibraryScene::parse_generated(text, &sets, checked.purpose, checked.along.as_ref(), &find)?;
        Ok(Scene { scene: Arc::new(scene), sets, purpose: checked })
    }

    /// Reads a scene from a file.
    #[staticmethod]
    #[pyo3(signature = (path, sets=Vec::new(), purpose="map", along=None))]
    fn load(path: PathBuf, sets: Vec<String>, purpose: &str, along: Option<Line>) -> Result<Scene, Problem> {
        let checked = Use::new(purpose, along)?;
        let along = checked.along.as_ref();
        let file = SceneFile { purpose: checked.purpose, along, ..SceneFile::map(&path) };
        let scene = file.load(&sets)?;
        Ok(Scene { scene: Arc::new(scene), sets, purpose: checked })
    }

    /// Returns arguments that make the same scene in another process, without files.
    fn __getnewargs__(&self) -> Arguments {
        let own = self.scene.base().downcast_ref::<FileModel>().filter(|model| !model.is_built_in());
        let model = own.map(|model| (format!("{}.toml", model.name()), model.definition().text.clone()));
        let cells = self.scene.list().map(|list| list.to_csv());
        let Use { purpose, along } = &self.purpose;
        let purpose = if *purpose == Purpose::Map { "map" } else { "bifurcation" }.to_owned();
        let along = along.clone().map(|Along { parameter, at }| (parameter, at));
        (self.scene.text().to_owned(), self.sets.clone(), model, cells, purpose, along)
    }

    /// Number of runs: cells times starts per cell. The progress of a map counts them.
    #[getter]
    fn runs(&self) -> u64 {
        self.scene.run_count()
    }
}
