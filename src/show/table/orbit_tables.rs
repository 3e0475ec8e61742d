//! Tables of an orbit: its motion in time, its events and its spectrum.

use std::io::Write;

use crate::model_file::{gap_columns, several_gaps, subjects};
use crate::record::measures::Subjects;
use crate::show::error::WriteError;
use crate::show::event_row::{self, EventRow, Place, PlaceNames};
use crate::show::figure::orbit::gaps::{PlotGap, contacts_at_start};
use crate::show::names::optional;
use crate::show::orbit_spectrum::Spectrum;
use crate::show::run_up::{Orders, Series};
use rattlemap_dynamics::machine::{Outputs, Situation, System};
use rattlemap_dynamics::model::{DryFriction, Model, ModelError, Oscillator, Side, State};
use rattlemap_dynamics::motion::{Slip, SlipKind, Slips};
use rattlemap_dynamics::orbit::{Event, History, Orbit, Sample, SlipPoint, is_reached};

/// A row of the motion: a sample, or the state before or after an event.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Time since phase 0 of the first period.
    pub t: f64,
    /// Phase of the forcing in turns.
    pub phase: f64,
    /// Each gap and its velocity.
    pub gaps: Vec<[f64; 2]>,
    /// State. Only the components of the model are used.
    pub state: State,
    /// For each gap `free`, `meshing_right` or `meshing_left`.
    pub domains: Vec<&'static str>,
    /// Forces and signals.
    pub(crate) outputs: Outputs,
    /// The event, and `before` or `after`.
    event: Option<(EventRow, &'static str)>,
}

impl Moment {
    /// Whether it is a sample.
    pub(crate) fn is_sample(&self) -> bool {
        self.event.is_none()
    }
}

/// Returns the motion of an orbit as it was sampled from phase 0 on.
pub(crate) fn sampled(orbit: &Orbit, samples: Vec<Sample>, samples_per_period: usize) -> History {
    History {
        meshing: orbit.strobe_meshing,
        samples,
        events: orbit.events.clone(),
        slips: orbit.slips.clone(),
        samples_per_period,
        forcing_period: orbit.forcing_period,
    }
}

/// Merges samples with the states before and after every event. A sample at the time of an event would repeat it.
///
/// # Errors
/// [`ModelError`] if the model is not valid.
pub fn moments(model: &dyn Model, history: &History) -> Result<Vec<Moment>, ModelError> {
    let History { samples, events, slips, samples_per_period, forcing_period, .. } = history;
    let oscillator = model.oscillator()?;
    let mut moments = Vec::with_capacity(samples.len() + 2 * events.len());
    let gaps = PlotGap::all(model, &oscillator);
    let mut contacts = contacts_at_start(&gaps, &oscillator, events, samples);
    let starts_in_contact = oscillator.tells_contact_at_start();
    if starts_in_contact {
        contacts[0] = history.meshing;
    }
    let system = System::new(&oscillator);
    let mut modes = modes_at_start(&oscillator, samples, slips);
    let mut add = |t, phase, state: &State, (contacts, slips): (&[Option<Side>], Slips), event| {
        let gap = |gap| [0, 1].map(|velocity| oscillator.gap_value(gap, state, velocity));
        let time = phase * forcing_period;
        let is_after = !matches!(event, Some((_, "before")));
        let outputs = system.outputs(state, &Situation { time, contacts, slips, is_after });
        moments.push(Moment {
            t,
            phase,
            gaps: (0..gaps.len()).map(gap).collect(),
            state: *state,
            domains: contacts[..gaps.len()].iter().copied().map(domain_name).collect(),
            outputs,
            event,
        });
    };
    let mut events = event_row::rows(model, events, slips).into_iter().peekable();
    let mut last = f64::NEG_INFINITY;
    for (i, sample) in samples.iter().enumerate() {
        while let Some(event) = events.next_if(|event| is_reached(event.t, sample.t)) {
            let phase = event.t_mod_period / forcing_period;
            last = event.t;
            add(last, phase, &event.before, (&contacts, modes), Some((event.clone(), "before")));
            match event.place {
                Place::Wall { gap, meshing, .. } => {
                    contacts[gap] = meshing;
                    // An impact can reverse the direction of sliding.
                    for (mode, element) in modes.iter_mut().zip(&oscillator.friction) {
                        *mode = rate(element, &event.after).map_or(*mode, Slip::of);
                    }
                }
                Place::Element { slips, .. } => modes = slips,
            }
            let after = event.after;
            add(last, phase, &after, (&contacts, modes), Some((event, "after")));
        }
        if sample.t > last {
            let phase = (i % samples_per_period) as f64 / *samples_per_period as f64;
            // Samples tell the contact of the first gap.
            if i > 0 || starts_in_contact {
                contacts[0] = sample.meshing;
            }
            add(sample.t, phase, &sample.state, (&contacts, modes), None);
        }
    }
    Ok(moments)
}

/// Returns the modes of dry friction at the start of a motion. The first event of an element tells whether it sticks, and its first rate that
/// is not a rounding error tells the direction.
fn modes_at_start(oscillator: &Oscillator, samples: &[Sample], slips: &[SlipPoint]) -> Slips {
    let mode = |i: usize| {
        let Some(element) = oscillator.friction.get(i) else { return Slip::Stick };
        let first = slips.iter().find(|slip| slip.element == i);
        let before_first = samples.iter().take_while(|sample| first.is_none_or(|first| sample.t < first.t));
        let rate = before_first.filter_map(|sample| rate(element, &sample.state)).next();
        match (first.map(|first| (first.kind, first.slips[i])), rate) {
            (Some((SlipKind::Slip, _)), _) | (None, None) => Slip::Stick,
            (Some((SlipKind::Reversal, after)), _) => after.reversed(),
            (_, Some(rate)) => Slip::of(rate),
            (Some(_), None) => Slip::Stick,
        }
    };
    std::array::from_fn(mode)
}

/// Returns the sliding rate of an element with dry friction, unless it is a rounding error.
fn rate(element: &DryFriction, state: &State) -> Option<f64> {
    let terms = element.row.iter().zip(state.iter().skip(1).step_by(2)).map(|(row, velocity)| row * velocity);
    let add = |[sum, size]: [f64; 2], term: f64| [sum + term, size + term.abs()];
    let [rate, size] = terms.fold([-element.speed, element.speed.abs()], add);
    (rate.abs() > RATE_ROUNDING * size).then_some(rate)
}

/// Rounding error of a sliding rate, relative to the sum of the moduli of its terms.
const RATE_ROUNDING: f64 = 1e-9;

/// Writes `events.csv`, one row per event, with the fields of the events in `orbit --json`. The last columns are the name of the gap, if
/// there are several, and that of the friction element, if the model has friction. An event of friction has no side.
pub fn write_events(
    out: impl Write,
    model: &dyn Model,
    events: &[Event],
    slips: &[SlipPoint],
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    write_event_head(&mut table, model, None)?;
    write_event_rows(&mut table, model, (events, slips), None)?;
    Ok(table.flush()?)
}

/// Writes the names of the columns of `events.csv`. `last` is the name of a further column.
pub(crate) fn write_event_head(
    table: &mut csv::Writer<impl Write>,
    model: &dyn Model,
    last: Option<&str>,
) -> Result<(), WriteError> {
    let (names, places) = (model.state_names(), PlaceNames::of(model));
    let states = ["before", "after"].into_iter();
    let states = states.flat_map(|moment| names.iter().map(move |name| format!("{moment}_{name}")));
    let head = ["kind", "side", "t", "t_mod_period"].map(str::to_owned).into_iter().chain(states);
    let places = places.columns(None).into_iter().map(|(column, _)| column.to_owned());
    let last = last.map(str::to_owned);
    Ok(table.write_record(head.chain(["impulse".to_owned()]).chain(places).chain(last))?)
}

/// Writes rows of `events.csv`. `last` is the number of a further column.
pub(crate) fn write_event_rows(
    table: &mut csv::Writer<impl Write>,
    model: &dyn Model,
    (events, slips): (&[Event], &[SlipPoint]),
    last: Option<f64>,
) -> Result<(), WriteError> {
    let (names, places) = (model.state_names(), PlaceNames::of(model));
    for row in event_row::rows(model, events, slips) {
        let states = [&row.before, &row.after].into_iter().flat_map(|state| &state[..names.len()]);
        let numbers = [row.t, row.t_mod_period].into_iter().chain(states.copied());
        let texts = [row.kind.to_owned(), optional(row.side_code())].into_iter();
        let texts = texts.chain(numbers.map(|x| format!("{x:?}")));
        let impulse = row.impulse().map_or(String::new(), |x| format!("{x:?}"));
        let places = places.columns(Some(row.place)).into_iter().map(|(_, name)| name.to_owned());
        let last = last.map(|x| format!("{x:?}"));
        table.write_record(texts.chain([impulse]).chain(places).chain(last))?;
    }
    Ok(())
}

/// Writes `trajectory.csv`, one row per moment. With several gaps, each has a column `domain_` with its name. The columns of `events.csv`
/// follow, then the force of the contacts of each gap, the force of each friction element, and the signals.
pub fn write_trajectory(out: impl Write, model: &dyn Model, moments: &[Moment]) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    write_trajectory_head(&mut table, model, None)?;
    write_trajectory_rows(&mut table, model, moments, None)?;
    Ok(table.flush()?)
}

/// Writes the names of the columns of `trajectory.csv`. `further` is the name of a further column.
pub(crate) fn write_trajectory_head(
    table: &mut csv::Writer<impl Write>,
    model: &dyn Model,
    further: Option<&str>,
) -> Result<(), WriteError> {
    let (state_names, several, places) = (model.state_names(), several_gaps(model), PlaceNames::of(model));
    let own = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let domains = match &several {
        Some(gaps) => gaps.iter().map(|gap| format!("domain_{gap}")).collect(),
        None => own(&["domain"]),
    };
    let gaps = gap_columns(model).concat();
    let names_of =
        |place| places.columns(place).into_iter().map(|(column, name)| [column, name].map(str::to_owned));
    let last = names_of(None).map(|[column, _]| column).collect();
    let marks = own(&["event", "side", "moment"]);
    let head = [own(&["t", "phase"]), gaps, own(&state_names), domains, marks, last, output_columns(model)];
    let further = further.map(str::to_owned);
    Ok(table.write_record(head.concat().into_iter().chain(further))?)
}

/// Writes rows of `trajectory.csv`. `further` is the number of a further column.
pub(crate) fn write_trajectory_rows(
    table: &mut csv::Writer<impl Write>,
    model: &dyn Model,
    moments: &[Moment],
    further: Option<f64>,
) -> Result<(), WriteError> {
    let (count, places) = (model.state_names().len(), PlaceNames::of(model));
    let own = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let names_of =
        |place| places.columns(place).into_iter().map(|(column, name)| [column, name].map(str::to_owned));
    for Moment { t, phase, gaps, state, domains, outputs, event } in moments {
        let numbers = [*t, *phase].into_iter().chain(gaps.concat());
        let numbers = numbers.chain(state[..count].iter().copied());
        let texts = numbers.map(|x| format!("{x:?}")).chain(own(domains));
        let mark = |(row, moment): &(EventRow, &str)| {
            [row.kind.to_owned(), optional(row.side_code()), (*moment).to_owned()]
        };
        let marks = event.as_ref().map(mark).unwrap_or_default();
        let place = event.as_ref().map(|(row, _)| row.place);
        let texts = texts.chain(marks).chain(names_of(place).map(|[_, name]| name));
        let Outputs { contacts, friction, signals } = outputs;
        let outputs =
            contacts.iter().chain(friction).chain(signals).chain(&further).map(|x| format!("{x:?}"));
        table.write_record(texts.chain(outputs))?;
    }
    Ok(())
}

/// Writes `orders.csv`, one row per window and order, with the amplitude of each displacement, gap and signal.
pub(crate) fn write_orders(
    out: impl Write,
    parameter: &str,
    series: &Series,
    orders: &Orders,
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let names = series.quantities.iter().map(|quantity| quantity.name.as_str());
    table.write_record(["t", parameter, "order"].into_iter().chain(names))?;
    for ([t, value], amplitudes) in &orders.windows {
        for line in 0..amplitudes[0].len() {
            let numbers = [*t, *value, Orders::order(line)].into_iter();
            let numbers = numbers.chain(amplitudes.iter().map(|of| of[line]));
            table.write_record(numbers.map(|x| format!("{x:?}")))?;
        }
    }
    Ok(table.flush()?)
}

/// Returns the names of the columns of forces and signals.
fn output_columns(model: &dyn Model) -> Vec<String> {
    let Subjects { gaps, signals, .. } = subjects(model);
    let elements = PlaceNames::of(model).elements.unwrap_or_default();
    let contacts = match &gaps[..] {
        [] => vec!["contact_force".to_owned()],
        gaps => gaps.iter().map(|gap| format!("contact_force_{gap}")).collect(),
    };
    let forces = elements.iter().map(|element| element.replace("friction", "friction_force"));
    contacts.into_iter().chain(forces).chain(signals).collect()
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
    table.write_record(["frequency".to_owned()].into_iter().chain(gap_columns(model).concat()))?;
    for line in &spectrum.lines {
        let numbers = [line.frequency].into_iter().chain(line.amplitudes.concat());
        table.write_record(numbers.map(|x| format!("{x:?}")))?;
    }
    Ok(table.flush()?)
}
