//! The text that `orbit` prints: properties of the motion, then a table of its events.

use std::fmt::Write;

use crate::show::instant::Instant;
use crate::show::names;
use rattlemap_dynamics::model::{Model, State};
use rattlemap_dynamics::orbit::{Class, Event, History, Orbit, Status};

/// Number of decimals: one more than in the tables of the paper.
const DECIMALS: usize = 5;

/// Largest number of events in the table, and number of events before those that are left out. The summary above the table
/// stays on the screen.
const MOST_ROWS: usize = 24;
const FIRST_ROWS: usize = 16;

/// Returns a summary of the orbit of a model in lines of aligned text.
pub fn summary(model: &dyn Model, orbit: &Orbit, instant: Option<Instant>) -> String {
    let mut text = String::new();
    let instant = instant.map(|instant| ("state".to_owned(), state(model, instant)));
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
            format!("none: always in contact with the {} wall\n", names::side(side))
        }
        _ => events(model, &orbit.events),
    });
    text
}

/// Returns a summary of a motion from the start: its first state, its last one and its events. Periods are numbered from 1.
pub fn history_summary(
    model: &dyn Model,
    history: &History,
    (start, first, last): (&State, u64, u64),
    instant: Option<Instant>,
) -> String {
    let mut facts = vec![
        ("parameters", parameters(model)),
        ("start", state(model, Instant { time: 0.0, state: *start })),
        ("forcing periods", format!("{first} to {last} (T = {:.DECIMALS$})", history.forcing_period)),
    ];
    let end = history.samples.last().map(|sample| Instant { time: sample.t, state: sample.state });
    facts.extend(end.map(|end| ("end", state(model, end))));
    facts.extend(instant.map(|instant| ("state", state(model, instant))));
    let mut text: String = facts.iter().map(|(label, value)| format!("{label:<22}{value}\n")).collect();
    text += &match history.meshing {
        Some(side) if history.events.is_empty() => {
            format!("\nno events: always in contact with the {} wall\n", names::side(side))
        }
        _ => format!("\nevents\n{}", events(model, &history.events)),
    };
    text
}

/// Formats a requested state with all digits.
fn state(model: &dyn Model, instant: Instant) -> String {
    let values = model.state_names().into_iter().zip(instant.state);
    let values: Vec<String> = values.map(|(name, value)| format!("{name}={value:?}")).collect();
    format!("{} at t = {:?}", values.join(" "), instant.time)
}

/// Returns labels and values of the lines before the events.
fn facts(model: &dyn Model, orbit: &Orbit) -> Vec<(String, String)> {
    let mut facts = Vec::new();
    let mut add = |label: &str, value: String| facts.push((label.to_owned(), value));
    add("parameters", parameters(model));
    add("class", class(orbit));
    let text = match orbit.class {
        Class::Undecided if orbit.status == Status::Slow => "slow: more periods may decide the class",
        _ => status(orbit.status),
    };
    add("status", text.to_owned());
    if orbit.class == Class::Failed {
        return facts;
    }
    match (orbit.class, orbit.strobe_meshing) {
        (Class::Periodic { .. }, _) if !orbit.events.is_empty() => {
            add("word, in time", orbit.word.time_order());
            add("word, as printed", orbit.word.paper_notation());
            let pattern = orbit.word.pattern();
            if pattern != orbit.word {
                add("pattern", pattern.time_order());
            }
        }
        (Class::Periodic { .. }, None) => add("word", "none: no contact".to_owned()),
        (Class::Periodic { .. }, Some(_)) => add("word", "none: always in contact".to_owned()),
        _ => add("word", "none: the motion is not periodic".to_owned()),
    }
    add("Lyapunov exponent", exponent(orbit));
    if let Some(multipliers) = &orbit.floquet {
        let listed: Vec<String> = multipliers.iter().copied().map(complex).collect();
        add("Floquet multipliers", listed.join(", "));
    }
    if let Some(symmetric) = orbit.symmetric {
        let text = match (symmetric, has_mirror_images(model)) {
            (true, _) => "yes",
            (false, true) => "no, a symmetry-conjugate orbit coexists",
            (false, false) => "no; the model itself is not symmetric",
        };
        add("symmetric", text.to_owned());
    }
    add("impacts per period", format!("{:.DECIMALS$}", orbit.impacts_per_period));
    add("fraction meshing", format!("{:.DECIMALS$}", orbit.mesh_fraction));
    let names = model.state_names();
    let strobe = numbers(&orbit.strobe[..names.len()]).trim_start().to_owned();
    add(&format!("strobe {}", names.join(" ")), strobe);
    facts
}

/// Whether the mirror image of every motion, shifted by half a forcing period, is a motion of the same model.
pub(crate) fn has_mirror_images(model: &dyn Model) -> bool {
    model.law().is_symmetric() && model.oscillator().is_ok_and(|oscillator| oscillator.mirror_symmetric())
}

fn parameters(model: &dyn Model) -> String {
    let all = model.parameters().iter().enumerate();
    all.map(|(i, p)| format!("{}={:?}", p.name, model.value(i))).collect::<Vec<_>>().join(" ")
}

fn class(orbit: &Orbit) -> String {
    match orbit.class {
        Class::Periodic { period } => format!("periodic, period {period}"),
        Class::Undecided => {
            format!("undecided: neither periodic nor chaotic within {} forcing periods", orbit.periods_run)
        }
        other => other.name().to_owned(),
    }
}

fn status(status: Status) -> &'static str {
    match status {
        Status::Ok => "ok",
        Status::Slow => "slow: the motion converges slowly; the class rests on Newton's method",
        Status::NearGrazing => {
            "near_grazing: an event is close to grazing; exponent and multipliers are inaccurate"
        }
        Status::StrobeOnEvent => "strobe_on_event: an event lies on phase 0",
        Status::CapEvents => "cap_events: one period has more events than the limit",
        Status::CapRoot => "cap_root: locating an event needed more iterations than the limit",
        Status::TooStiff => "too_stiff: too stiff for this engine",
        Status::NonFinite => "non_finite: the state became infinite or undefined",
        Status::BelowResolution => {
            "below_resolution: points of the cycle are closer together than the numerical resolution"
        }
    }
}

fn exponent(orbit: &Orbit) -> String {
    match orbit.lyapunov_error {
        _ if orbit.lyapunov.is_nan() => "-".to_owned(),
        Some(error) if error.is_finite() => format!("{:.DECIMALS$} +- {error:.DECIMALS$}", orbit.lyapunov),
        Some(_) => format!("{:.DECIMALS$}, with unknown error", orbit.lyapunov),
        None => format!("{:.DECIMALS$}", orbit.lyapunov),
    }
}

fn complex([re, im]: [f64; 2]) -> String {
    if im == 0.0 { format!("{re:.DECIMALS$}") } else { format!("{re:.DECIMALS$}{im:+.DECIMALS$}i") }
}

fn numbers(state: &[f64]) -> String {
    state.iter().map(|x| format!(" {x:>9.DECIMALS$}")).collect()
}

fn events(model: &dyn Model, events: &[Event]) -> String {
    if events.is_empty() {
        return "none: the motion does not reach a wall\n".to_owned();
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
    let hidden =
        if events.len() > MOST_ROWS { FIRST_ROWS..FIRST_ROWS + events.len() - MOST_ROWS } else { 0..0 };
    for (nth, event) in events.iter().enumerate() {
        if hidden.contains(&nth) {
            if nth == hidden.start {
                let count = hidden.len();
                let _ = writeln!(text, "... {count} more events; --json and --out list all of them");
            }
            continue;
        }
        let side = names::side(event.side);
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
