//! `orbit --json`: one object. Its fields are part of the contract with scripts.

use serde_json::{Map, Value, json};

use crate::show::event_row::{self, PlaceNames};
use crate::show::instant::Instant;
use crate::show::names;
use crate::show::orbit_quantities;
use crate::show::parameters::{self, Parameters};
use crate::show::refined_cycle::Refined;
use rattlemap_dynamics::model::{Model, State};
use rattlemap_dynamics::orbit::{Event, History, Orbit, SlipPoint};

/// Returns the orbit of a model as a JSON object of several lines. Numbers are the shortest decimals that read back as the
/// same number; numbers that are not finite become null.
pub fn to_json(
    model: &dyn Model,
    orbit: &Orbit,
    instant: Option<Instant>,
    refined: Option<&Refined>,
) -> String {
    let mut properties = json!({
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
        "quantities": orbit_quantities::object(model, orbit),
        "strobe": components(model, &orbit.strobe),
        "events": events(model, &orbit.events, &orbit.slips),
    });
    if let Some(refined) = refined {
        properties["refined"] = refined.object(model);
    }
    object(model, properties, instant)
}

/// Returns a motion from the start as a JSON object of several lines. Periods are numbered from 1.
pub fn history_to_json(
    model: &dyn Model,
    history: &History,
    (start, first, last): (&State, u64, u64),
    instant: Option<Instant>,
) -> String {
    let properties = json!({
        "start": components(model, start),
        "first_period": first,
        "last_period": last,
        "forcing_period": history.forcing_period,
        "end": history.samples.last().map(|sample| components(model, &sample.state)),
        "events": events(model, &history.events, &history.slips),
    });
    object(model, properties, instant)
}

pub(super) fn components(model: &dyn Model, state: &State) -> Vec<f64> {
    state[..model.state_names().len()].to_vec()
}

fn events(model: &dyn Model, events: &[Event], slips: &[SlipPoint]) -> Vec<Value> {
    let names = PlaceNames::of(model);
    let rows = event_row::rows(model, events, slips).into_iter().map(|row| {
        let mut object = json!({
            "kind": row.kind,
            "side": row.side_code(),
            "t": row.t,
            "t_mod_period": row.t_mod_period,
            "before": components(model, &row.before),
            "after": components(model, &row.after),
            "impulse": row.impulse(),
        });
        for (column, name) in names.columns(Some(row.place)).into_iter().filter(|(_, name)| !name.is_empty())
        {
            object[column] = name.into();
        }
        object
    });
    rows.collect()
}

/// Returns an object of the parameters, these properties, and the state at a requested time.
fn object(model: &dyn Model, properties: Value, instant: Option<Instant>) -> String {
    let mut object = Map::new();
    for name in ["e", "omega"] {
        object.extend(model.get(name).map(|value| (name.to_owned(), value.into())));
    }
    object.insert("parameters".to_owned(), json!(Parameters::of(model)));
    object.insert("start_phase".to_owned(), model.start_phase().into());
    object.extend(properties.as_object().cloned().into_iter().flatten());
    object.extend(parameters::units(model).map(|units| ("units".to_owned(), json!(units))));
    if let Some(Instant { time, state }) = instant {
        object.insert("time".to_owned(), time.into());
        object.insert("state".to_owned(), json!(components(model, &state)));
    }
    format!("{:#}", Value::Object(object))
}
