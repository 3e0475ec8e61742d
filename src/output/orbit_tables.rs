//! What an orbit looks like in time and by frequency, as tables.

use std::path::Path;

use super::orbit_spectrum::{Spectrum, gap};
use super::{WriteError, names};
use rattlemap_dynamics::model::{Oscillator, Side, State};
use rattlemap_dynamics::orbit::{Event, EventKind, Orbit, Sample};

/// Writes the motion to `path`: samples, and two rows for every event among them, the state before and after.
///
/// `trace` has so many samples in a forcing period, the first at phase 0, and goes as far as the events.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write_trajectory(
    path: &Path,
    state_names: &[&str],
    oscillator: &Oscillator,
    orbit: &Orbit,
    trace: &[Sample],
    samples_per_period: usize,
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_path(path)?;
    let head = ["t", "phase", "z", "w"].into_iter().chain(state_names.iter().copied());
    table.write_record(head.chain(["domain", "event", "side", "moment"]))?;
    let mut row = |t: f64, phase: f64, state: &State, domain: Option<Side>, marks: [String; 3]| {
        let gaps = [0, 1].map(|velocity| gap(oscillator, state, velocity));
        let numbers = [t, phase].into_iter().chain(gaps).chain(state[..state_names.len()].iter().copied());
        let texts = numbers.map(|x| format!("{x:?}")).chain([domain_name(domain).to_owned()]);
        table.write_record(texts.chain(marks))
    };
    let mut events = orbit.events.iter().peekable();
    let (mut domain, mut last) = (orbit.strobe_meshing, f64::NEG_INFINITY);
    for (i, sample) in trace.iter().enumerate() {
        while let Some(event) = events.next_if(|event| event.t <= sample.t) {
            let phase = event.t_mod_period / orbit.forcing_period;
            let marks = |moment: &str| {
                [names::kind(event.kind).to_owned(), names::side(event.side).to_string(), moment.to_owned()]
            };
            row(event.t, phase, &event.before, domain, marks("before"))?;
            domain = domain_after(event);
            row(event.t, phase, &event.after, domain, marks("after"))?;
            last = event.t;
        }
        // A sample on an event says nothing new.
        if sample.t > last {
            let phase = (i % samples_per_period) as f64 / samples_per_period as f64;
            domain = sample.meshing;
            row(sample.t, phase, &sample.state, domain, Default::default())?;
        }
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
pub(super) fn write_spectrum(path: &Path, spectrum: &Spectrum) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_path(path)?;
    table.write_record(["frequency", "z", "w"])?;
    for line in &spectrum.lines {
        let [z, w] = line.amplitudes;
        table.write_record([line.frequency, z, w].map(|x| format!("{x:?}")))?;
    }
    Ok(table.flush()?)
}
