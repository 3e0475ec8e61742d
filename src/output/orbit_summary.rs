//! `orbit` for the eye: what the motion is, then its events as a table.

use std::fmt::Write;

use super::names;
use crate::model::{GearPair, Side, State};
use crate::orbit::{Class, Event, Orbit, Status};

/// Numbers as the paper prints them, one digit more.
const DECIMALS: usize = 5;

/// A summary of the orbit of `pair` in lines of aligned text.
pub(super) fn summary(pair: &GearPair, orbit: &Orbit) -> String {
    let mut text = String::new();
    for (label, value) in facts(pair, orbit) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{label:<22}{value}");
    }
    if orbit.class == Class::Failed {
        return text;
    }
    let span = match orbit.cycle_periods {
        1 => "1 forcing period".to_owned(),
        periods => format!("{periods} forcing periods"),
    };
    let _ = writeln!(text, "\nevents over {span} (T = {:.DECIMALS$})", orbit.forcing_period);
    text.push_str(&events(&orbit.events));
    text
}

fn facts(pair: &GearPair, orbit: &Orbit) -> Vec<(&'static str, String)> {
    let mut facts = vec![
        ("parameters", parameters(pair)),
        ("class", class(orbit)),
        ("status", status(orbit.status).to_owned()),
    ];
    if orbit.class == Class::Failed {
        return facts;
    }
    facts.extend([
        ("word, in time", or_dash(orbit.word.time_order())),
        ("word, as printed", or_dash(orbit.word.paper_notation())),
        ("Lyapunov exponent", exponent(orbit)),
    ]);
    if let Some(multipliers) = &orbit.floquet {
        let listed: Vec<String> = multipliers.iter().copied().map(complex).collect();
        facts.push(("Floquet multipliers", listed.join(", ")));
    }
    if let Some(symmetric) = orbit.symmetric {
        facts.push(("symmetric", if symmetric { "yes" } else { "no, a mirror twin coexists" }.to_owned()));
    }
    facts.extend([
        ("impacts per period", format!("{:.DECIMALS$}", orbit.impacts_per_period)),
        ("fraction meshing", format!("{:.DECIMALS$}", orbit.mesh_fraction)),
        ("strobe x1 v1 x2 v2", numbers(orbit.strobe).trim_start().to_owned()),
    ]);
    facts
}

fn parameters(pair: &GearPair) -> String {
    let named = GearPair::PARAMETERS.iter();
    let listed = named.filter_map(|p| Some(format!("{}={:?}", p.name, pair.get(p.name).ok()?)));
    listed.collect::<Vec<_>>().join(" ")
}

fn class(orbit: &Orbit) -> String {
    match orbit.class {
        Class::Periodic { period } => format!("periodic, period {period}"),
        other => names::class(other).to_owned(),
    }
}

fn status(status: Status) -> &'static str {
    match status {
        Status::Ok => "ok",
        Status::Slow => "slow: convergence too slow to rest the class on recurrence alone",
        Status::NearGrazing => {
            "near_grazing: an event close to grazing, so distrust exponent and multipliers"
        }
        Status::StrobeOnEvent => "strobe_on_event: an event lies on phase 0",
        Status::CapEvents => "cap_events: more events in one period than the cap allows",
        Status::CapRoot => "cap_root: more root iterations than the cap allows",
        Status::TooStiff => "too_stiff: too stiff for this engine",
        Status::NonFinite => "non_finite: the state left the range of finite numbers",
    }
}

fn exponent(orbit: &Orbit) -> String {
    match orbit.lyapunov_error {
        _ if orbit.lyapunov.is_nan() => "-".to_owned(),
        Some(error) => format!("{:.DECIMALS$} +- {error:.DECIMALS$}", orbit.lyapunov),
        None => format!("{:.DECIMALS$}", orbit.lyapunov),
    }
}

fn complex([re, im]: [f64; 2]) -> String {
    if im == 0.0 { format!("{re:.DECIMALS$}") } else { format!("{re:.DECIMALS$}{im:+.DECIMALS$}i") }
}

fn or_dash(text: String) -> String {
    if text.is_empty() { "-".to_owned() } else { text }
}

fn numbers(state: State) -> String {
    state.map(|x| format!(" {x:>9.DECIMALS$}")).concat()
}

fn events(events: &[Event]) -> String {
    if events.is_empty() {
        return "none: the walls are not reached\n".to_owned();
    }
    let mut text = format!(
        "{:<11}{:<6} {:>10} {:>10}  {:<40}  {}\n",
        "kind", "side", "t", "t mod T", " before (x1, v1, x2, v2)", " after (x1, v1, x2, v2)"
    );
    for event in events {
        let side = if event.side == Side::Right { "right" } else { "left" };
        let _ = writeln!(
            text,
            "{:<11}{side:<6} {:>10.DECIMALS$} {:>10.DECIMALS$}  {}  {}",
            names::kind(event.kind),
            event.t,
            event.t_mod_period,
            numbers(event.before),
            numbers(event.after)
        );
    }
    text
}
