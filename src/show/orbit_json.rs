//! `orbit --json`: one object. Its fields are part of the contract with scripts.

use serde::Serialize;

use crate::show::instant::Instant;
use crate::show::names;
use crate::show::parameters::Parameters;
use rattlemap_dynamics::model::{Model, State};
use rattlemap_dynamics::orbit::{Event, Orbit};

/// The object. Numbers that are not finite become null.
#[derive(Serialize)]
struct OrbitObject<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    e: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    omega: Option<f64>,
    parameters: Parameters,
    class: &'static str,
    period: Option<u32>,
    lyapunov: f64,
    lyapunov_error: Option<f64>,
    floquet: Option<&'a [[f64; 2]]>,
    symmetric: Option<bool>,
    word: String,
    pattern: String,
    impacts_per_period: f64,
    mesh_fraction: f64,
    status: &'static str,
    /// Number of integrated forcing periods.
    periods_run: u64,
    strobe: Vec<f64>,
    events: Vec<EventObject>,
    /// Requested time since the start.
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<f64>,
    /// State at that time.
    #[serde(skip_serializing_if = "Option::is_none")]
    state: Option<Vec<f64>>,
}

#[derive(Serialize)]
struct EventObject {
    kind: &'static str,
    side: i8,
    t: f64,
    t_mod_period: f64,
    before: Vec<f64>,
    after: Vec<f64>,
}

impl EventObject {
    fn new(event: &Event, components: impl Fn(State) -> Vec<f64>) -> Self {
        EventObject {
            kind: names::kind(event.kind),
            side: names::side_code(event.side),
            t: event.t,
            t_mod_period: event.t_mod_period,
            before: components(event.before),
            after: components(event.after),
        }
    }
}

/// Returns the orbit of a model as a JSON object of several lines. Numbers are the shortest decimals that read back as the
/// same number.
///
/// # Errors
/// Serialization can fail by its signature; no orbit causes it.
pub(crate) fn to_json(
    model: &dyn Model,
    orbit: &Orbit,
    instant: Option<Instant>,
) -> serde_json::Result<String> {
    let count = model.state_names().len();
    let components = |state: State| state[..count].to_vec();
    serde_json::to_string_pretty(&OrbitObject {
        e: model.get("e").ok(),
        omega: model.get("omega").ok(),
        parameters: Parameters::of(model),
        class: orbit.class.name(),
        period: names::period(orbit.class),
        lyapunov: orbit.lyapunov,
        lyapunov_error: orbit.lyapunov_error,
        floquet: orbit.floquet.as_deref(),
        symmetric: orbit.symmetric,
        word: orbit.word.time_order(),
        pattern: orbit.word.pattern().time_order(),
        impacts_per_period: orbit.impacts_per_period,
        mesh_fraction: orbit.mesh_fraction,
        status: orbit.status.name(),
        periods_run: orbit.periods_run,
        strobe: components(orbit.strobe),
        events: orbit.events.iter().map(|event| EventObject::new(event, components)).collect(),
        time: instant.map(|instant| instant.time),
        state: instant.map(|instant| components(instant.state)),
    })
}
