//! Tables of an orbit: its motion in time, its events and its spectrum.

use std::io::Write;

use crate::model_file::gap_names;
use crate::show::error::WriteError;
use crate::show::names;
use crate::show::orbit_quantities;
use crate::show::orbit_spectrum::Spectrum;
use rattlemap_dynamics::model::{Model, Oscillator, Side, State};
use rattlemap_dynamics::orbit::{Event, EventKind, History, is_reached};

/// A row of the motion: a sample, or the state before or after an event.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Time since phase 0 of the first period.
    pub t: f64,
    /// Phase of the forcing in turns.
    pub phase: f64,
    /// Gap and its velocity.
    pub gap: [f64; 2],
    /// State. Only the components of the model are used.
    pub state: State,
    /// `free`, `meshing_right` or `meshing_left`.
    pub domain: &'static str,
    /// Kind and side of the event, and `before` or `after`.
    pub event: Option<(&'static str, i8, &'static str)>,
}

/// Merges samples with the states before and after every event. A sample at the time of an event would repeat it.
pub fn moments(oscillator: &Oscillator, history: &History) -> Vec<Moment> {
    let History { samples, events, samples_per_period, forcing_period, .. } = history;
    let mut moments = Vec::with_capacity(samples.len() + 2 * events.len());
    let mut add = |t, phase, state: &State, domain, event| {
        let gap = [0, 1].map(|velocity| oscillator.gap_value(0, state, velocity));
        moments.push(Moment { t, phase, gap, state: *state, domain: domain_name(domain), event });
    };
    let mut events = events.iter().peekable();
    let (mut domain, mut last) = (history.meshing, f64::NEG_INFINITY);
    for (i, sample) in samples.iter().enumerate() {
        while let Some(event) = events.next_if(|event| is_reached(event.t, sample.t)) {
            let phase = event.t_mod_period / forcing_period;
            let mark = |moment| Some((names::kind(event.kind), names::side_code(event.side), moment));
            add(event.t, phase, &event.before, domain, mark("before"));
            domain = domain_after(event);
            add(event.t, phase, &event.after, domain, mark("after"));
            last = event.t;
        }
        if sample.t > last {
            let phase = (i % samples_per_period) as f64 / *samples_per_period as f64;
            domain = sample.meshing;
            add(sample.t, phase, &sample.state, domain, None);
        }
    }
    moments
}

/// Writes `events.csv`, one row per event, with the fields of the events in `orbit --json`. With several gaps, the last column is the name of
/// the gap.
pub fn write_events(out: impl Write, model: &dyn Model, events: &[Event]) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let names = model.state_names();
    let states = ["before", "after"].into_iter();
    let states = states.flat_map(|moment| names.iter().map(move |name| format!("{moment}_{name}")));
    let head = ["kind", "side", "t", "t_mod_period"].map(str::to_owned).into_iter().chain(states);
    let gaps = orbit_quantities::gaps(model);
    let of_gap = gaps.as_ref().map(|_| "gap".to_owned());
    table.write_record(head.chain(["impulse".to_owned()]).chain(of_gap))?;
    for (event, impulse) in events.iter().zip(orbit_quantities::impulses(model, events)) {
        let texts = [names::kind(event.kind).to_owned(), names::side_code(event.side).to_string()];
        let states = [&event.before, &event.after].into_iter().flat_map(|state| &state[..names.len()]);
        let numbers = [event.t, event.t_mod_period].into_iter().chain(states.copied());
        let texts = texts.into_iter().chain(numbers.map(|x| format!("{x:?}")));
        let impulse = impulse.map_or(String::new(), |x| format!("{x:?}"));
        table.write_record(texts.chain([impulse]).chain(gaps.as_ref().map(|gaps| gaps[event.gap].clone())))?;
    }
    Ok(table.flush()?)
}

/// Writes `trajectory.csv`, one row per moment.
pub fn write_trajectory(out: impl Write, model: &dyn Model, moments: &[Moment]) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let (state_names, gap_names) = (model.state_names(), gap_names(model));
    let head = ["t", "phase"].into_iter().chain(gap_names).chain(state_names.iter().copied());
    table.write_record(head.chain(["domain", "event", "side", "moment"]))?;
    for Moment { t, phase, gap, state, domain, event } in moments {
        let numbers = [*t, *phase].into_iter().chain(*gap).chain(state[..state_names.len()].iter().copied());
        let texts = numbers.map(|x| format!("{x:?}")).chain([(*domain).to_owned()]);
        let marks = event.map(|(kind, side, moment)| [kind.to_owned(), side.to_string(), moment.to_owned()]);
        table.write_record(texts.chain(marks.unwrap_or_default()))?;
    }
    Ok(table.flush()?)
}

/// Returns the wall that the teeth mesh on after an event.
fn domain_after(event: &Event) -> Option<Side> {
    (event.kind == EventKind::MeshStart).then_some(event.side)
}

fn domain_name(meshing: Option<Side>) -> &'static str {
    match meshing {
        None => "free",
        Some(Side::Right) => "meshing_right",
        Some(Side::Left) => "meshing_left",
    }
}

/// Writes `spectrum.csv`, one row per line of the spectrum.
pub fn write_spectrum(out: impl Write, model: &dyn Model, spectrum: &Spectrum) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record(["frequency"].into_iter().chain(gap_names(model)))?;
    for line in &spectrum.lines {
        let [z, w] = line.amplitudes;
        table.write_record([line.frequency, z, w].map(|x| format!("{x:?}")))?;
    }
    Ok(table.flush()?)
}
