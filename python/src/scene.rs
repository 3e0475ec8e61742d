//! Scenes: texts that the library has read.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use rattlemap::job;
use rattlemap::map::scene::{Along, CompanionFile, FileText, Purpose, Scene as Read};
use rattlemap::model::Model as _;
use rattlemap::model_file::FileModel;

use crate::problem::Problem;

/// What a scene is read for, and of a line of a plane which one.
#[derive(Clone)]
pub(crate) struct For {
    purpose: Purpose,
    pub(crate) along: Option<Along>,
}

impl For {
    fn new(purpose: &str, along: Option<(String, Vec<String>)>) -> Result<For, Problem> {
        let purpose = match purpose {
            "map" => Purpose::Map,
            "bifurcation" => Purpose::Bifurcation,
            _ => return Err(Problem::scene(format!("`{purpose}` is neither map nor bifurcation"))),
        };
        Ok(For { purpose, along: along.map(|(parameter, at)| Along { parameter, at }) })
    }
}

/// A scene that has been checked whole.
#[pyclass(frozen, module = "rattlemap._native")]
pub(crate) struct Scene {
    pub(crate) scene: Arc<Read>,
    pub(crate) sets: Vec<String>,
    pub(crate) read_for: For,
}

/// Purpose and line as they are given.
type GivenFor = (String, Option<GivenAlong>);
type GivenAlong = (String, Vec<String>);

/// Text, sets, model, cells, purpose and line, as [`Scene::new`] takes them.
type Parts = (String, Vec<String>, Option<(String, String)>, Option<String>, String, Option<GivenAlong>);

#[pymethods]
impl Scene {
    /// The scene of a text that the package has written. `model` is the file of the model that the text names, with its
    /// name; `cells` the table of a list of cells.
    #[new]
    #[pyo3(signature = (text, sets=Vec::new(), model=None, cells=None, purpose="map", along=None))]
    fn new(
        text: &str,
        sets: Vec<String>,
        model: Option<(String, String)>,
        cells: Option<String>,
        purpose: &str,
        along: Option<(String, Vec<String>)>,
    ) -> Result<Scene, Problem> {
        let read_for = For::new(purpose, along)?;
        let find = |what: CompanionFile, _: &str| match (what, &model, &cells) {
            (CompanionFile::Model, Some((name, text)), _) => {
                Ok(FileText { name: name.clone(), text: text.clone() })
            }
            (CompanionFile::Cells, _, Some(text)) => {
                Ok(FileText { name: "cells".to_owned(), text: text.clone() })
            }
            _ => Err("names a file, and none was given".to_owned()),
        };
        let scene = Read::parse_generated(text, &sets, read_for.purpose, read_for.along.as_ref(), &find)?;
        Ok(Scene { scene: Arc::new(scene), sets, read_for })
    }

    /// The scene in a file.
    #[staticmethod]
    #[pyo3(signature = (path, sets=Vec::new(), purpose="map", along=None))]
    fn load(
        path: PathBuf,
        sets: Vec<String>,
        purpose: &str,
        along: Option<(String, Vec<String>)>,
    ) -> Result<Scene, Problem> {
        let read_for = For::new(purpose, along)?;
        let scene = job::scene_file::load_along(&path, &sets, read_for.purpose, read_for.along.as_ref())?;
        Ok(Scene { scene: Arc::new(scene), sets, read_for })
    }

    /// What makes the same scene again, elsewhere and without any file.
    fn __getnewargs__(&self) -> Parts {
        let own = self.scene.base().downcast_ref::<FileModel>().filter(|model| !model.is_built_in());
        let model = own.map(|model| (format!("{}.toml", model.name()), model.definition().text.clone()));
        let cells = self.scene.list().map(|list| list.to_csv());
        let (purpose, along) = self.read_for();
        (self.scene.text().to_owned(), self.sets.clone(), model, cells, purpose, along)
    }

    #[getter]
    fn text(&self) -> &str {
        self.scene.text()
    }

    #[getter]
    fn sets(&self) -> Vec<String> {
        self.sets.clone()
    }

    /// Starts of cells, which is what is counted while a map is made.
    #[getter]
    fn runs(&self) -> u64 {
        self.scene.run_count()
    }

    /// Whether an axis sweeps a component of the start.
    #[getter]
    fn is_basin(&self) -> bool {
        self.scene.is_basin()
    }
}

impl Scene {
    fn read_for(&self) -> GivenFor {
        let For { purpose, along } = &self.read_for;
        let purpose = if *purpose == Purpose::Map { "map" } else { "bifurcation" };
        (purpose.to_owned(), along.clone().map(|Along { parameter, at }| (parameter, at)))
    }
}
