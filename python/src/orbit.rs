//! Single orbits.

use std::sync::Arc;

use pyo3::prelude::*;
use rattlemap::job;
use rattlemap::job::refined_cycle::RefineRequest;
use rattlemap::model::{Model as _, REST, State};
use rattlemap::model_file::FileModel;
use rattlemap::motion::Flow;
use rattlemap::orbit::{self as analysis, Settings};
use rattlemap::show::orbit_json::to_json;
use rattlemap::store::in_memory;
use rattlemap::store::orbit::HistoryRequest;

use crate::model::Model;
use crate::problem::Problem;
use crate::worker;

/// An orbit and its model.
#[pyclass(frozen, module = "rattlemap._native")]
pub(crate) struct Orbit {
    model: Arc<FileModel>,
    orbit: Arc<analysis::Orbit>,
    start: State,
}

impl Orbit {
    /// Returns the model with the period of a cycle without force.
    fn on_cycle(&self) -> Box<dyn rattlemap::model::Model> {
        let model: &dyn rattlemap::model::Model = &*self.model;
        model.on_cycle(self.orbit.cycle_time)
    }
}

#[pymethods]
impl Orbit {
    /// Returns the JSON object that `orbit --json` prints.
    fn json(&self) -> String {
        to_json(&*self.on_cycle(), &self.orbit, None, None)
    }

    /// Largest Lyapunov exponent. JSON cannot tell that of a superstable cycle, which is minus infinity.
    #[getter]
    fn lyapunov(&self) -> f64 {
        self.orbit.lyapunov
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
        let (model, orbit) = (self.on_cycle(), Arc::clone(&self.orbit));
        worker::run(py, None, move |_| Ok(Some(in_memory::trajectory(&*model, &orbit, samples_per_period)?)))
    }

    /// Returns `spectrum.csv`; none if the motion cannot be followed for the required time.
    fn spectrum(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let (model, orbit) = (self.on_cycle(), Arc::clone(&self.orbit));
        worker::run(py, None, move |_| Ok(Some(in_memory::spectrum(&*model, &orbit)?)))
    }

    /// Returns the object `refined` of `orbit --json`: the cycle that solves its equations, and its derivatives by a parameter.
    #[pyo3(signature = (period=None, word=None, by=None))]
    fn refined(
        &self,
        py: Python<'_>,
        period: Option<u32>,
        word: Option<&str>,
        by: Option<String>,
    ) -> PyResult<String> {
        let word = word.map(|text| text.parse().map_err(Problem::scene)).transpose()?;
        let (model, orbit, start) = (self.on_cycle(), Arc::clone(&self.orbit), self.start);
        by.as_deref().map(|name| model.index(name)).transpose().map_err(Problem::scene)?;
        worker::run(py, None, move |watch| {
            let request = RefineRequest { period, word, by };
            let found = request.find(&*model, (&orbit, &start), watch.halt()).map_err(Problem::engine)?;
            Ok(found.map(|found| found.object(&*model).to_string()))
        })
    }

    /// Returns `trajectory.csv` of the motion from its start: `periods` forcing periods after the first `skipped`, with at least
    /// this number of samples.
    fn history(&self, py: Python<'_>, skipped: u64, periods: u32, samples: usize) -> PyResult<String> {
        let (model, start) = (Arc::clone(&self.model), self.start);
        worker::run(py, None, move |watch| {
            let request = HistoryRequest { start, skipped, periods, samples };
            let history = request.compute(&*model, &Flow::of(&*model)?, watch.halt());
            let history = history.map_err(Problem::engine)?;
            history.map(|history| Ok(in_memory::history(&*model, &history)?)).transpose()
        })
    }
}

/// Computes the orbit of a model from a state at phase 0, by default from rest. `periods` limits the analysis, as `--periods` of
/// the program does.
#[pyfunction]
#[pyo3(signature = (model, transient, periods=None, start=None))]
pub(crate) fn orbit(
    py: Python<'_>,
    model: &Model,
    transient: u32,
    periods: Option<u32>,
    start: Option<Vec<f64>>,
) -> PyResult<Orbit> {
    let model = Arc::new(model.model.clone());
    let mut state = REST;
    if let Some(start) = start {
        job::model_choice::check_components(&*model, start.len()).map_err(Problem::from)?;
        state[..start.len()].copy_from_slice(&start);
    }
    let Settings { observed_periods, max_period, .. } = Settings::default();
    let observed_periods = periods.unwrap_or(observed_periods);
    let max_period = max_period.min(observed_periods / 2);
    let settings = Settings { transient_periods: transient, observed_periods, max_period };
    let longest = periods.unwrap_or(analysis::LONGEST_WINDOW);
    let own = Arc::clone(&model);
    let orbit = worker::run(py, None, move |watch| {
        let shown = analysis::EVENT_PERIODS;
        Ok(analysis::analyse_until(&*own, state, &settings, longest, shown, watch.halt(), &|_, _| ())?)
    })?;
    Ok(Orbit { model, orbit: Arc::new(orbit), start: state })
}
