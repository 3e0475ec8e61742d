//! Single orbits.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::job;
use rattlemap::model::{Model as _, REST};
use rattlemap::model_file::FileModel;
use rattlemap::orbit::{self as analysis, Class, Settings};
use rattlemap::store;

use crate::arrays::array;
use crate::model::Model;
use crate::problem::Problem;
use crate::worker;

/// An orbit and its model.
#[pyclass(frozen, module = "rattlemap._native")]
pub(crate) struct Orbit {
    model: Arc<FileModel>,
    orbit: Arc<analysis::Orbit>,
}

#[pymethods]
impl Orbit {
    /// The JSON object that `orbit --json` prints.
    fn json(&self) -> String {
        store::orbit::json(&*self.model, &self.orbit, None)
    }

    /// Number of forcing periods that the events span.
    #[getter]
    fn cycle_periods(&self) -> u32 {
        self.orbit.cycle_periods
    }

    #[getter]
    fn forcing_period(&self) -> f64 {
        self.orbit.forcing_period
    }

    #[getter]
    fn state_names(&self) -> Vec<&str> {
        self.model.state_names()
    }

    /// Columns of `trajectory.csv`, with this number of samples per forcing period.
    fn moments<'py>(&self, py: Python<'py>, samples_per_period: usize) -> PyResult<Bound<'py, PyDict>> {
        let (model, orbit) = (Arc::clone(&self.model), Arc::clone(&self.orbit));
        let moments = worker::run(py, None, move |_| {
            if orbit.class == Class::Failed {
                return Ok(Some(Vec::new()));
            }
            Ok(Some(store::orbit::moments(&*model, &orbit, samples_per_period)?))
        })?;
        let columns = PyDict::new(py);
        let numbers =
            |of: &dyn Fn(&store::orbit::Moment) -> f64| -> Vec<f64> { moments.iter().map(of).collect() };
        columns.set_item("t", array(py, numbers(&|moment| moment.t)))?;
        columns.set_item("phase", array(py, numbers(&|moment| moment.phase)))?;
        columns.set_item("z", array(py, numbers(&|moment| moment.gap[0])))?;
        columns.set_item("w", array(py, numbers(&|moment| moment.gap[1])))?;
        for (i, name) in self.model.state_names().into_iter().enumerate() {
            columns.set_item(name, array(py, numbers(&|moment| moment.state[i])))?;
        }
        let texts = |of: &dyn Fn(&store::orbit::Moment) -> &'static str| -> Vec<&'static str> {
            moments.iter().map(of).collect()
        };
        columns.set_item("domain", texts(&|moment| moment.domain))?;
        columns.set_item("event", texts(&|moment| moment.event.map_or("", |(kind, ..)| kind)))?;
        let sides = moments.iter().map(|moment| moment.event.map_or(0, |(_, side, _)| side)).collect();
        columns.set_item("side", array::<i8>(py, sides))?;
        columns.set_item("moment", texts(&|moment| moment.event.map_or("", |(.., moment)| moment)))?;
        Ok(columns)
    }
}

/// Computes the orbit of a model with parameters set by `NAME=VALUE`, from a state at phase 0, by default from rest.
#[pyfunction]
#[pyo3(signature = (model, sets, transient, periods, start=None))]
pub(crate) fn orbit(
    py: Python<'_>,
    model: &Model,
    sets: Vec<String>,
    transient: u32,
    periods: u32,
    start: Option<Vec<f64>>,
) -> PyResult<Orbit> {
    let model = Arc::new(model.with(&sets)?);
    let mut state = REST;
    if let Some(start) = start {
        job::model_choice::check_components(&*model, start.len()).map_err(Problem::from)?;
        state[..start.len()].copy_from_slice(&start);
    }
    let settings = Settings {
        transient_periods: transient,
        observed_periods: periods,
        max_period: Settings::default().max_period.min(periods / 2),
    };
    let own = Arc::clone(&model);
    let orbit = worker::run(py, None, move |watch| {
        Ok(analysis::analyse_until(&*own, state, &settings, analysis::EVENT_PERIODS, watch.halt())?)
    })?;
    Ok(Orbit { model, orbit: Arc::new(orbit) })
}
