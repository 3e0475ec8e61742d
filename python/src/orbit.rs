//! Single orbits.

use std::sync::Arc;

use pyo3::prelude::*;
use rattlemap::job;
use rattlemap::model::{Model as _, REST};
use rattlemap::model_file::FileModel;
use rattlemap::orbit::{self as analysis, Settings};
use rattlemap::store;
use rattlemap::store::in_memory;

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
    /// Returns the JSON object that `orbit --json` prints.
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

    /// Returns `trajectory.csv` with this number of samples per forcing period.
    fn trajectory(&self, py: Python<'_>, samples_per_period: usize) -> PyResult<String> {
        let (model, orbit) = (Arc::clone(&self.model), Arc::clone(&self.orbit));
        worker::run(py, None, move |_| Ok(Some(in_memory::trajectory(&*model, &orbit, samples_per_period)?)))
    }
}

/// Computes the orbit of a model from a state at phase 0, by default from rest.
#[pyfunction]
#[pyo3(signature = (model, transient, periods, start=None))]
pub(crate) fn orbit(
    py: Python<'_>,
    model: &Model,
    transient: u32,
    periods: u32,
    start: Option<Vec<f64>>,
) -> PyResult<Orbit> {
    let model = Arc::new(model.model.clone());
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
        let [longest, shown] = [analysis::LONGEST_WINDOW, analysis::EVENT_PERIODS];
        Ok(analysis::analyse_until(&*own, state, &settings, longest, shown, watch.halt())?)
    })?;
    Ok(Orbit { model, orbit: Arc::new(orbit) })
}
