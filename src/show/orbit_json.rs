//! `orbit --json`: one object. Its fields are part of the contract with scripts.

use serde_json::{Map, Value, json};

use crate::show::instant::Instant;
use crate::show::names;
use crate::show::orbit_quantities;
use crate::show::parameters::{self, Parameters};
use rattlemap_dynamics::model::{Model, State};
use rattlemap_dynamics::orbit::{Event, Orbit};

/// Returns the orbit of a model as a JSON object of several lines. Numbers are the shortest decimals that read back as the
/// same number; numbers that are not finite become null.
pub fn to_json(model: &dyn Model, orbit: &Orbit, instant: Option<Instant>) -> String {
    let count = model.state_names().len();
    let components = |state: State| state[..count].to_vec();
    let event = |(event, impulse): (&Event, Option<f64>)| {
        json!({
            "kind": names::kind(event.kind),
            "side": names::side_code(event.side),
            "t": event.t,
            "t_mod_period": event.t_mod_period,
            "before": components(event.before),
            "after": components(event.after),
            "impulse": impulse,
        })
    };
    let impulses = orbit_quantities::impulses(model, &orbit.events);
    let mut object = Map::new();
    for name in ["e", "omega"] {
        object.extend(model.get(name).map(|value| (name.to_owned(), value.into())));
    }
    let properties = json!({
        "parameters": Parameters::of(model),
        "start_phase": model.start_phase(),
        "class": orbit.class.name(),
        "period": names::period(orbit.class),
        "lyapunov": orbit.lyapunov,
        "lyapunov_error": orbit.lyapunov_error,
        "floquet": orbit.floquet,
        "symmetric": orbit.symmetric,
        "word": orbit.word.time_order(),
        "pattern": orbit.word.pattern().time_order(),
        "impacts_per_period": orbit.impacts_per_period,
        "mesh_fraction": orbit.mesh_fraction,
        "status": orbit.status.name(),
        "periods_run": orbit.periods_run,
        "strobe": components(orbit.strobe),
        "quantities": orbit_quantities::object(model, orbit),
        "events": orbit.events.iter().zip(impulses).map(event).collect::<Vec<Value>>(),
    });
    object.extend(properties.as_object().cloned().into_iter().flatten());
    object.extend(parameters::units(model).map(|units| ("units".to_owned(), json!(units))));
    if let Some(Instant { time, state }) = instant {
        object.insert("time".to_owned(), time.into());
        object.insert("state".to_owned(), json!(components(state)));
    }
    format!("{:#}", Value::Object(object))
}
