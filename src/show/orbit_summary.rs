//! The text that `orbit` prints: properties of the motion, then a table of its events.

use std::fmt::Write;

use crate::model_file::{self, several_gaps};
use crate::show::event_row::{self, EventRow, Place, PlaceNames};
use crate::show::instant::Instant;
use crate::show::names;
use crate::show::orbit_quantities;
use crate::show::run_up::{Ramp, RunUp};
use crate::show::symbols::with_unit;
use rattlemap_dynamics::model::{Model, Parameter, State, Timing};
use rattlemap_dynamics::number::significant;
use rattlemap_dynamics::orbit::{Class, Event, EventKind, History, Orbit, SlipPoint, Status};

/// Largest number of events in the table, and number of events before those that are left out. The summary above the table
/// stays on the screen.
const MOST_ROWS: usize = 16;
const FIRST_ROWS: usize = 10;

/// Returns a summary of the orbit of a model in lines of aligned text.
pub fn summary(model: &dyn Model, orbit: &Orbit, instant: Option<Instant>) -> String {
    let mut text = String::new();
    let instant = instant.map(|instant| ("state".to_owned(), state(model, instant)));
    let measured = orbit_quantities::facts(model, orbit);
    for (label, value) in facts(model, orbit).into_iter().chain(measured).chain(instant) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{label:<21} {value}");
    }
    if orbit.class == Class::Failed {
        return text;
    }
    let [one, several] = timing(model).names();
    let span = match orbit.cycle_periods {
        1 => format!("1 {one}"),
        periods => format!("{periods} {several}"),
    };
    let units = model.units();
    let _ = writeln!(
        text,
        "\nevents over {span} (T = {})",
        with_unit(&significant(orbit.forcing_period), units.time.as_deref())
    );
    let has_one_gap = several_gaps(model).is_none();
    text.push_str(&match orbit.strobe_meshing {
        Some(side) if has_one_gap && orbit.events.is_empty() && orbit.slips.is_empty() => {
            format!("none: always in contact with the {} wall\n", names::side(side))
        }
        meshing => events(model, &orbit.events, &orbit.slips, meshing.is_some() || orbit.mesh_fraction > 0.0),
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
        (timing(model).names()[1], {
            let period = with_unit(&significant(history.forcing_period), model.units().time.as_deref());
            format!("{first} to {last} (T = {period})")
        }),
    ];
    let end = history.samples.last().map(|sample| Instant { time: sample.t, state: sample.state });
    facts.extend(end.map(|end| ("end", state(model, end))));
    facts.extend(instant.map(|instant| ("state", state(model, instant))));
    let mut text: String = facts.iter().map(|(label, value)| format!("{label:<21} {value}\n")).collect();
    let has_one_gap = several_gaps(model).is_none();
    text += &match history.meshing {
        Some(side) if has_one_gap && history.events.is_empty() && history.slips.is_empty() => {
            format!("\nno events: always in contact with the {} wall\n", names::side(side))
        }
        meshing => format!(
            "\nevents\n{}",
            events(model, &history.events, &history.slips, meshing.is_some() || !has_one_gap)
        ),
    };
    text
}

/// Describes a run-up from a start.
pub fn run_up_summary(model: &dyn Model, run: &RunUp, start: &State) -> String {
    let Ramp { name, from, to, time } = &run.ramp;
    let time = with_unit(&significant(*time), model.units().time.as_deref());
    let periods: u32 = run.parts.iter().map(|(segment, _)| segment.periods).sum();
    let events = || run.parts.iter().flat_map(|(_, history)| &history.events);
    let count = |kind: EventKind| events().filter(|event| event.kind == kind).count();
    let mut facts = vec![
        ("parameters", parameters(model)),
        ("start", state(model, Instant { time: 0.0, state: *start })),
        ("run-up", format!("{name} from {from:?} to {to:?} in the time {time}")),
        (timing(model).names()[1], periods.to_string()),
        ("impacts", count(EventKind::Impact).to_string()),
        ("contacts begun", count(EventKind::MeshStart).to_string()),
    ];
    let end = run.parts.last().and_then(|(_, history)| history.samples.last());
    facts.extend(end.map(|end| ("end", state(model, Instant { time: end.t, state: end.state }))));
    facts.iter().map(|(label, value)| format!("{label:<21} {value}\n")).collect()
}

/// Formats a requested state with all digits.
fn state(model: &dyn Model, instant: Instant) -> String {
    let values = model.state_names().into_iter().zip(instant.state);
    let values: Vec<String> = values.map(|(name, value)| format!("{name}={value:?}")).collect();
    format!("{} at t = {:?}", values.join(" "), instant.time)
}

/// Returns what the period of a model is.
pub fn timing(model: &dyn Model) -> Timing {
    model.oscillator().map_or(Timing::Forced, |oscillator| oscillator.timing)
}

/// Names the multipliers that a list leaves out.
pub(super) fn without_shifts(model: &dyn Model) -> String {
    let in_place = model.oscillator().is_ok_and(|oscillator| !oscillator.rigid_modes().modes.is_empty());
    let shifts = [(in_place, "in place"), (timing(model) == Timing::Cycle, "in time")];
    let left_out: Vec<&str> = shifts.into_iter().filter_map(|(is_so, what)| is_so.then_some(what)).collect();
    if left_out.is_empty() {
        String::new()
    } else {
        format!("; without that of a shift {}", left_out.join(" and "))
    }
}

/// Returns labels and values of the lines before the events.
fn facts(model: &dyn Model, orbit: &Orbit) -> Vec<(String, String)> {
    let mut facts = Vec::new();
    let mut add = |label: &str, value: String| facts.push((label.to_owned(), value));
    add("parameters", parameters(model));
    if model.start_phase() != 0.0 {
        add("start phase", format!("{:?} rad", model.start_phase()));
    }
    let rests = timing(model) == Timing::Free && matches!(orbit.class, Class::Periodic { .. });
    add("class", class(orbit, timing(model).names()[1]) + if rests { ": it comes to rest" } else { "" });
    let text = match orbit.class {
        Class::Undecided if orbit.status == Status::Slow => "slow: more periods may decide the class",
        _ => status(orbit.status),
    };
    add("status", text.to_owned());
    if orbit.class == Class::Failed {
        return facts;
    }
    match (orbit.class, orbit.strobe_meshing) {
        (Class::Periodic { .. }, _) if !orbit.word.is_empty() => {
            add("word, in time", orbit.word.time_order());
            add("word, as printed", orbit.word.paper_notation());
            let pattern = orbit.word.pattern();
            if pattern != orbit.word {
                add("pattern", pattern.time_order());
            }
            if let Some(letters) = model_file::letters(model) {
                add("letters of gaps", letters);
            }
        }
        (Class::Periodic { .. }, None) => add("word", "none: no contact".to_owned()),
        (Class::Periodic { .. }, Some(_)) => add("word", "none: always in contact".to_owned()),
        (Class::Undecided, _) => add("word", "none: the class is undecided".to_owned()),
        _ => add("word", "none: the motion is not periodic".to_owned()),
    }
    add("Lyapunov exponent", exponent(orbit));
    if let Some(multipliers) = &orbit.floquet {
        let listed: Vec<String> = multipliers.iter().copied().map(complex).collect();
        add("Floquet multipliers", listed.join(", ") + &without_shifts(model));
    }
    if let Some(symmetric) = orbit.symmetric {
        let text = match (symmetric, has_mirror_images(model)) {
            (true, _) => "yes",
            (false, true) => "no, a symmetry-conjugate orbit coexists",
            (false, false) => "no; the model itself is not symmetric",
        };
        add("symmetric", text.to_owned());
    }
    add("impacts per period", significant(orbit.impacts_per_period));
    add("fraction meshing", significant(orbit.mesh_fraction));
    let names = model.state_names();
    add(&format!("strobe {}", names.join(" ")), state_in_units(model, orbit.strobe));
    facts
}

/// Whether the mirror image of every motion, shifted by half a forcing period, is a motion of the same model.
pub(crate) fn has_mirror_images(model: &dyn Model) -> bool {
    model.oscillator().is_ok_and(|oscillator| oscillator.mirror_symmetric())
}

fn parameters(model: &dyn Model) -> String {
    let all = model.parameters().iter().enumerate();
    let text = |(i, p): (usize, &Parameter)| {
        with_unit(&format!("{}={:?}", p.name, model.value(i)), p.unit.as_deref())
    };
    all.map(text).collect::<Vec<_>>().join(" ")
}

fn class(orbit: &Orbit, periods: &str) -> String {
    match orbit.class {
        Class::Periodic { period } => format!("periodic, period {period}"),
        Class::Undecided => {
            format!("undecided: neither periodic nor chaotic within {} {periods}", orbit.periods_run)
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
            "below_resolution: rounding decides the period; points of the cycle cannot be told apart"
        }
        Status::Neutral => "neutral: a multiplier has modulus 1; perturbations neither decay nor grow",
        Status::Escape => "escape: the motion grows without bound",
        Status::UnstableCycle => {
            "unstable_cycle: the motion stays on an unstable cycle; any perturbation leads it away"
        }
        Status::Simultaneous => {
            "simultaneous: two gaps reached their walls together; their order in the model decides"
        }
        Status::OutOfRange => "out_of_range: a nonlinear spring or wall was deformed beyond its range",
        Status::Accelerates => {
            "accelerates: a load accelerates the motion for ever; no damper and too little friction oppose it"
        }
    }
}

fn exponent(orbit: &Orbit) -> String {
    match orbit.lyapunov_error {
        _ if orbit.lyapunov.is_nan() => "-".to_owned(),
        Some(error) if error.is_finite() => {
            format!("{} +- {}", significant(orbit.lyapunov), significant(error))
        }
        Some(_) => format!("{}, with unknown error", significant(orbit.lyapunov)),
        None => significant(orbit.lyapunov),
    }
}

pub(super) fn complex([re, im]: [f64; 2]) -> String {
    let [sign, size] = if im < 0.0 { ["-", &significant(-im)] } else { ["+", &significant(im)] };
    if im == 0.0 { significant(re) } else { format!("{}{sign}{size}i", significant(re)) }
}

/// Formats a state with the units of its components.
fn state_in_units(model: &dyn Model, state: State) -> String {
    let (units, count) = (model.units(), model.state_names().len());
    let values = state[..count].iter().enumerate();
    let texts = values.map(|(i, x)| with_unit(&significant(*x), units.component(i).as_deref()));
    texts.collect::<Vec<_>>().join(" ")
}

fn events(model: &dyn Model, events: &[Event], slips: &[SlipPoint], is_in_contact: bool) -> String {
    let rows = event_row::rows(model, events, slips);
    if rows.is_empty() {
        return match is_in_contact {
            true => "none: contact neither begins nor ends\n".to_owned(),
            false => "none: the motion does not reach a wall\n".to_owned(),
        };
    }
    let (names, units) = (model.state_names(), model.units());
    let (count, time) = (names.len(), units.time.as_deref());
    let components = |moment: &str| {
        let names = names.iter().enumerate();
        names.map(|(i, name)| with_unit(name, units.component(i).as_deref()) + moment).collect::<Vec<_>>()
    };
    let head = [
        "kind".to_owned(),
        "side".to_owned(),
        with_unit("t", time),
        with_unit("t mod T", time),
        "impulse".to_owned(),
    ];
    let head = head.into_iter().chain(components(" before")).chain(components(" after")).collect();
    let places = PlaceNames::of(model);
    let row = |row: &EventRow| -> Vec<String> {
        let side = match row.place {
            Place::Wall { side, .. } => names::side(side),
            Place::Element { .. } => "",
        };
        let place = places.columns(Some(row.place)).into_iter().map(|(_, name)| name);
        let place = place.chain([side]).filter(|text| !text.is_empty()).collect::<Vec<_>>().join(" ");
        let times = [row.t, row.t_mod_period].map(significant);
        let impulse = row.impulse().map_or("-".to_owned(), significant);
        let states = row.before[..count].iter().chain(&row.after[..count]).copied();
        let head = [row.kind.to_owned(), place].into_iter().chain(times);
        head.chain([impulse]).chain(states.map(significant)).collect()
    };
    let hidden = rows.len().saturating_sub(MOST_ROWS);
    let first = if hidden > 0 { FIRST_ROWS } else { rows.len() };
    let shown = rows[..first].iter().chain(&rows[first + hidden..]);
    let mut lines = aligned(&[head].into_iter().chain(shown.map(row)).collect::<Vec<_>>());
    if hidden > 0 {
        lines.insert(1 + first, format!("... {hidden} more events; --json and --out list all of them"));
    }
    lines.join("\n") + "\n"
}

/// Returns the lines of a table. The first two columns, which are texts, are aligned at the left, numbers at the right.
fn aligned(rows: &[Vec<String>]) -> Vec<String> {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or_default();
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, &width))| match i < 2 {
            true => format!("{cell:<width$}"),
            false => format!("{cell:>width$}"),
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}
