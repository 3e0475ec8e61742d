//! Models: built in, or from files.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::job;
use rattlemap::map::scene::single_cell;
use rattlemap::model::Model as _;
use rattlemap::model_file::FileModel;

use crate::problem::Problem;

/// Returns the name and a summary of every built-in model.
#[pyfunction]
pub(crate) fn models() -> Vec<(String, String)> {
    job::models::list()
}

/// A model with values of its parameters.
#[pyclass(frozen, module = "rattlemap._native")]
pub(crate) struct Model {
    pub(crate) model: FileModel,
    /// Name of its file in messages.
    file: String,
}

#[pymethods]
impl Model {
    /// Reads a model from a text. Messages name it `file`.
    #[new]
    fn new(text: &str, file: String) -> Result<Model, Problem> {
        let model = FileModel::parse(text, &file).map_err(Problem::model)?;
        Ok(Model { model, file })
    }

    /// Finds a built-in model by name, or reads the file of this name.
    #[staticmethod]
    fn find(name: String) -> Result<Model, Problem> {
        let model = job::model_choice::find(&name).map_err(Problem::model)?;
        Ok(Model { model, file: name })
    }

    /// Returns a copy with parameters set by `NAME=VALUE`.
    fn replace(&self, sets: Vec<String>) -> Result<Model, Problem> {
        let cell = single_cell(&self.model, &sets)?;
        let model = cell.downcast_ref::<FileModel>().cloned();
        let model = model.ok_or_else(|| Problem::model("the model is not read from a file"))?;
        Ok(Model { model, file: self.file.clone() })
    }

    #[getter]
    fn file(&self) -> &str {
        &self.file
    }

    #[getter]
    fn name(&self) -> &str {
        self.model.name()
    }

    #[getter]
    fn title(&self) -> &str {
        self.model.title()
    }

    #[getter]
    fn text(&self) -> &str {
        &self.model.definition().text
    }

    #[getter]
    fn is_built_in(&self) -> bool {
        self.model.is_built_in()
    }

    #[getter]
    fn state_names(&self) -> Vec<&str> {
        self.model.state_names()
    }

    #[getter]
    fn equations(&self) -> Vec<String> {
        self.model.equations()
    }

    /// Parameter values by name, in the order of the model's table.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = PyDict::new(py);
        for (index, parameter) in self.model.parameters().iter().enumerate() {
            values.set_item(&*parameter.name, self.model.value(index))?;
        }
        Ok(values)
    }

    /// Parameter values that differ from the defaults, and `start.phase` if it is not 0.
    #[getter]
    fn changed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = PyDict::new(py);
        for (index, parameter) in self.model.parameters().iter().enumerate() {
            let value = self.model.value(index);
            if parameter.default != Some(value) {
                values.set_item(&*parameter.name, value)?;
            }
        }
        if self.model.start_phase() != 0.0 {
            values.set_item("start.phase", self.model.start_phase())?;
        }
        Ok(values)
    }

    /// Name, meaning, range and default of each parameter.
    #[getter]
    fn meanings(&self) -> Vec<(String, String, String, Option<f64>)> {
        let parameters = self.model.parameters().iter();
        let meanings = parameters.map(|parameter| {
            let unit = parameter.unit.as_ref().map_or(String::new(), |unit| format!(" [{unit}]"));
            let meaning = format!("{}{unit}", parameter.meaning);
            let range = parameter.range.requirement().into_owned();
            (parameter.name.to_string(), meaning, range, parameter.default)
        });
        meanings.collect()
    }
}
