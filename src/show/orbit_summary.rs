//! `orbit` for the eye: what the motion is, then its events as a table.

use std::fmt::Write;

use crate::show::names;
use crate::store::orbit::Instant;
use rattlemap_dynamics::model::{Model, Side};
use rattlemap_dynamics::orbit::{Class, Event, Orbit, Status};

/// Numbers as the paper prints them, one digit more.
const DECIMALS: usize = 5;

/// A summary of the orbit of a model in lines of aligned text.
pub(crate) fn summary(model: &dyn Model, orbit: &Orbit, instant: Option<Instant>) -> String {
    let mut text = String::new();
    let instant = instant.map(|instant| ("state".to_owned(), at(model, instant)));
    for (label, value) in facts(model, orbit).into_iter().chain(instant) {
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
    text.push_str(&match orbit.strobe_meshing {
        Some(side) if orbit.events.is_empty() => {
            format!("none: always in contact with the {} wall\n", side_name(side))
        }
        _ => events(model, &orbit.events),
    });
    text
}

/// In all digits, since it was asked for by itself.
fn at(model: &dyn Model, instant: Instant) -> String {
    let values = model.state_names().into_iter().zip(instant.state);
    let values: Vec<String> = values.map(|(name, value)| format!("{name}={value:?}")).collect();
    format!("{} at t = {:?}", values.join(" "), instant.time)
}

fn facts(model: &dyn Model, orbit: &Orbit) -> Vec<(String, String)> {
    let mut facts = vec![
        ("parameters", parameters(model)),
        ("class", class(orbit)),
        ("status", status(orbit.status).to_owned()),
    ];
    if orbit.class == Class::Failed {
        return labelled(facts);
    }
    let names = model.state_names();
    facts.extend([
        ("word, in time", or_dash(orbit.word.time_order())),
        ("word, as printed", or_dash(orbit.word.paper_notation())),
    ]);
    let pattern = orbit.word.pattern();
    if pattern != orbit.word {
        facts.push(("pattern", pattern.time_order()));
    }
    facts.push(("Lyapunov exponent", exponent(orbit)));
    if let Some(multipliers) = &orbit.floquet {
        let listed: Vec<String> = multipliers.iter().copied().map(complex).collect();
        facts.push(("Floquet multipliers", listed.join(", ")));
    }
    if let Some(symmetric) = orbit.symmetric {
        facts.push((
            "symmetric",
            match (symmetric, has_mirror_images(model)) {
                (true, _) => "yes",
                (false, true) => "no, a symmetry-conjugate orbit coexists",
                (false, false) => "no, as the model",
            }
            .to_owned(),
        ));
    }
    facts.extend([
        ("impacts per period", format!("{:.DECIMALS$}", orbit.impacts_per_period)),
        ("fraction meshing", format!("{:.DECIMALS$}", orbit.mesh_fraction)),
    ]);
    let mut facts = labelled(facts);
    let strobe = numbers(&orbit.strobe[..names.len()]).trim_start().to_owned();
    facts.push((format!("strobe {}", names.join(" ")), strobe));
    facts
}

/// Whether the mirror image of a motion, half a forcing period later, is one of the same model.
pub(crate) fn has_mirror_images(model: &dyn Model) -> bool {
    model.law().is_symmetric() && model.oscillator().is_ok_and(|oscillator| oscillator.mirror_symmetric())
}

fn labelled(facts: Vec<(&str, String)>) -> Vec<(String, String)> {
    facts.into_iter().map(|(label, value)| (label.to_owned(), value)).collect()
}

fn parameters(model: &dyn Model) -> String {
    let all = model.parameters().iter().enumerate();
    all.map(|(i, p)| format!("{}={:?}", p.name, model.value(i))).collect::<Vec<_>>().join(" ")
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
        Status::BelowResolution => {
            "below_resolution: points of the cycle closer together than can be told apart"
        }
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

fn numbers(state: &[f64]) -> String {
    state.iter().map(|x| format!(" {x:>9.DECIMALS$}")).collect()
}

fn side_name(side: Side) -> &'static str {
    if side == Side::Right { "right" } else { "left" }
}

fn events(model: &dyn Model, events: &[Event]) -> String {
    if events.is_empty() {
        return "none: the walls are not reached\n".to_owned();
    }
    let names = model.state_names();
    let (count, listed) = (names.len(), names.join(", "));
    let mut text = format!(
        "{:<11}{:<6} {:>10} {:>10}  {:<width$}   after ({listed})\n",
        "kind",
        "side",
        "t",
        "t mod T",
        format!(" before ({listed})"),
        width = 10 * count
    );
    for event in events {
        let side = side_name(event.side);
        let _ = writeln!(
            text,
            "{:<11}{side:<6} {:>10.DECIMALS$} {:>10.DECIMALS$}  {}  {}",
            names::kind(event.kind),
            event.t,
            event.t_mod_period,
            numbers(&event.before[..count]),
            numbers(&event.after[..count])
        );
    }
    text
}
