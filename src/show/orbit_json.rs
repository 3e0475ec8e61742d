//! `orbit --json`: one object, its fields a contract.

use serde::Serialize;

use crate::show::names;
use crate::show::parameters::Parameters;
use crate::store::orbit::Instant;
use rattlemap_dynamics::model::{Model, State};
use rattlemap_dynamics::orbit::{Event, Orbit};

/// The object; not-a-number becomes null, as JSON has no word for it.
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
    /// Forcing periods that the motion was followed for.
    periods_run: u64,
    strobe: Vec<f64>,
    events: Vec<EventObject>,
    /// Since the start, as asked for, and the state then.
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<f64>,
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
    fn new(event: &Event, shown: impl Fn(State) -> Vec<f64>) -> Self {
        EventObject {
            kind: names::kind(event.kind),
            side: names::side(event.side),
            t: event.t,
            t_mod_period: event.t_mod_period,
            before: shown(event.before),
            after: shown(event.after),
        }
    }
}

/// The orbit of a model as a JSON object of several lines; floats are shortest round-trip
/// decimals, what is absent or not finite is null.
///
/// # Errors
/// None that an [`Orbit`] can cause; serialisation is fallible by signature.
pub(crate) fn to_json(
    model: &dyn Model,
    orbit: &Orbit,
    instant: Option<Instant>,
) -> serde_json::Result<String> {
    let components = model.state_names().len();
    let shown = |state: State| state[..components].to_vec();
    serde_json::to_string_pretty(&OrbitObject {
        e: model.get("e").ok(),
        omega: model.get("omega").ok(),
        parameters: Parameters::of(model),
        class: names::class(orbit.class),
        period: names::period(orbit.class),
        lyapunov: orbit.lyapunov,
        lyapunov_error: orbit.lyapunov_error,
        floquet: orbit.floquet.as_deref(),
        symmetric: orbit.symmetric,
        word: orbit.word.time_order(),
        pattern: orbit.word.pattern().time_order(),
        impacts_per_period: orbit.impacts_per_period,
        mesh_fraction: orbit.mesh_fraction,
        status: names::status(orbit.status),
        periods_run: orbit.periods_run,
        strobe: shown(orbit.strobe),
        events: orbit.events.iter().map(|event| EventObject::new(event, shown)).collect(),
        time: instant.map(|instant| instant.time),
        state: instant.map(|instant| shown(instant.state)),
    })
}
