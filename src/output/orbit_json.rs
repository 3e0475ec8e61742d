//! `orbit --json`: one object, its fields a contract.

use serde::Serialize;

use super::names;
use super::parameters::Parameters;
use crate::model::{GearPair, State};
use crate::orbit::{Event, Orbit};

/// The object; not-a-number becomes null, as JSON has no word for it.
#[derive(Serialize)]
struct OrbitObject<'a> {
    e: f64,
    omega: f64,
    parameters: Parameters,
    class: &'static str,
    period: Option<u32>,
    lyapunov: f64,
    lyapunov_error: Option<f64>,
    floquet: Option<&'a [[f64; 2]]>,
    symmetric: Option<bool>,
    word: String,
    impacts_per_period: f64,
    mesh_fraction: f64,
    status: &'static str,
    /// Forcing periods that the motion was followed for.
    periods_run: u64,
    strobe: State,
    events: Vec<EventObject>,
}

#[derive(Serialize)]
struct EventObject {
    kind: &'static str,
    side: i8,
    t: f64,
    t_mod_period: f64,
    before: State,
    after: State,
}

impl From<&Event> for EventObject {
    fn from(event: &Event) -> Self {
        EventObject {
            kind: names::kind(event.kind),
            side: names::side(event.side),
            t: event.t,
            t_mod_period: event.t_mod_period,
            before: event.before,
            after: event.after,
        }
    }
}

/// The orbit of `pair` as a JSON object of several lines; floats are shortest round-trip
/// decimals, what is absent or not finite is null.
///
/// # Errors
/// None that an [`Orbit`] can cause; serialisation is fallible by signature.
pub(super) fn to_json(pair: &GearPair, orbit: &Orbit) -> serde_json::Result<String> {
    serde_json::to_string_pretty(&OrbitObject {
        e: pair.e,
        omega: pair.omega,
        parameters: Parameters::of(pair),
        class: names::class(orbit.class),
        period: names::period(orbit.class),
        lyapunov: orbit.lyapunov,
        lyapunov_error: orbit.lyapunov_error,
        floquet: orbit.floquet.as_deref(),
        symmetric: orbit.symmetric,
        word: orbit.word.time_order(),
        impacts_per_period: orbit.impacts_per_period,
        mesh_fraction: orbit.mesh_fraction,
        status: names::status(orbit.status),
        periods_run: orbit.periods_run,
        strobe: orbit.strobe,
        events: orbit.events.iter().map(EventObject::from).collect(),
    })
}
