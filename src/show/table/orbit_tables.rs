//! What an orbit looks like in time and by frequency, as tables.

use std::path::Path;

use crate::show::error::WriteError;
use crate::show::names;
use crate::show::orbit_spectrum::{Spectrum, gap};
use rattlemap_dynamics::model::{Oscillator, Side, State};
use rattlemap_dynamics::orbit::{Event, EventKind, Orbit, Sample};

/// One moment of a motion: a sample, or the state before or after an event.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Time since phase 0 of the cycle.
    pub t: f64,
    /// Of the forcing, in turns.
    pub phase: f64,
    /// The gap and its velocity.
    pub gap: [f64; 2],
    /// The state, as many components as the model has.
    pub state: State,
    /// `free`, `meshing_right` or `meshing_left`.
    pub domain: &'static str,
    /// Of an event its kind, its side and whether this is `before` or `after`.
    pub event: Option<(&'static str, i8, &'static str)>,
}

/// The motion moment by moment: samples, and two moments for every event among them.
///
/// `trace` has so many samples in a forcing period, the first at phase 0, and goes as far as the events.
pub(crate) fn moments(
    oscillator: &Oscillator,
    orbit: &Orbit,
    trace: &[Sample],
    samples_per_period: usize,
) -> Vec<Moment> {
    let mut moments = Vec::with_capacity(trace.len() + 2 * orbit.events.len());
    let mut add = |t, phase, state: &State, domain, event| {
        let gap = [0, 1].map(|velocity| gap(oscillator, state, velocity));
        moments.push(Moment { t, phase, gap, state: *state, domain: domain_name(domain), event });
    };
    let mut events = orbit.events.iter().peekable();
    let (mut domain, mut last) = (orbit.strobe_meshing, f64::NEG_INFINITY);
    for (i, sample) in trace.iter().enumerate() {
        while let Some(event) = events.next_if(|event| event.t <= sample.t) {
            let phase = event.t_mod_period / orbit.forcing_period;
            let mark = |moment| Some((names::kind(event.kind), names::side(event.side), moment));
            add(event.t, phase, &event.before, domain, mark("before"));
            domain = domain_after(event);
            add(event.t, phase, &event.after, domain, mark("after"));
            last = event.t;
        }
        // A sample on an event says nothing new.
        if sample.t > last {
            let phase = (i % samples_per_period) as f64 / samples_per_period as f64;
            domain = sample.meshing;
            add(sample.t, phase, &sample.state, domain, None);
        }
    }
    moments
}

/// Writes a motion to `path`, a row for each moment.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write_trajectory(
    path: &Path,
    state_names: &[&str],
    moments: &[Moment],
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_path(path)?;
    let head = ["t", "phase", "z", "w"].into_iter().chain(state_names.iter().copied());
    table.write_record(head.chain(["domain", "event", "side", "moment"]))?;
    for Moment { t, phase, gap, state, domain, event } in moments {
        let numbers = [*t, *phase].into_iter().chain(*gap).chain(state[..state_names.len()].iter().copied());
        let texts = numbers.map(|x| format!("{x:?}")).chain([(*domain).to_owned()]);
        let marks = event.map(|(kind, side, moment)| [kind.to_owned(), side.to_string(), moment.to_owned()]);
        table.write_record(texts.chain(marks.unwrap_or_default()))?;
    }
    Ok(table.flush()?)
}

/// Where an event leads.
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

/// Writes a spectrum to `path`, a row for each line.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write_spectrum(path: &Path, spectrum: &Spectrum) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_path(path)?;
    table.write_record(["frequency", "z", "w"])?;
    for line in &spectrum.lines {
        let [z, w] = line.amplitudes;
        table.write_record([line.frequency, z, w].map(|x| format!("{x:?}")))?;
    }
    Ok(table.flush()?)
}
