//! A run-up: a motion during which one parameter changes from period to period, and its orders.

use std::sync::atomic::AtomicBool;

use rattlemap_dynamics::model::{Model, ModelError, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{History, Stopped, run_up};
use thiserror::Error;

use crate::model_file::{gap_columns, subjects};
use crate::show::orbit_spectrum::{amplitudes, hann};
use crate::show::symbols::{symbol, with_unit};
use crate::show::table::orbit_tables::Moment;
use crate::show::wall_labels::WallLabels;

/// Largest number of forcing periods of a run-up.
pub const MOST_PERIODS: u32 = 10_000;

/// Samples in a forcing period.
const SAMPLES: usize = 64;

/// Highest order of spectra. Twice as many orders have no aliases.
pub(crate) const HIGHEST_ORDER: usize = 16;

/// Forcing periods of the window of a spectrum: half orders have lines of their own.
const WINDOW: usize = 8;

/// Largest number of windows.
const MOST_WINDOWS: usize = 400;

/// A parameter that changes linearly with time.
#[derive(Clone, Debug, PartialEq)]
pub struct Ramp {
    /// Name of the parameter.
    pub name: String,
    /// Value at the start.
    pub from: f64,
    /// Value at the end.
    pub to: f64,
    /// Time from start to end.
    pub time: f64,
}

/// Forcing periods with the same value of the parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Value of the parameter.
    pub value: f64,
    /// Number of periods.
    pub periods: u32,
}

/// Why a run-up cannot begin.
#[derive(Debug, Error)]
pub enum RampError {
    /// The model has no motion for a value.
    #[error("at {name} = {value:?}: {error}")]
    Value {
        /// Name of the parameter.
        name: String,
        /// Value.
        value: f64,
        /// The reason.
        error: ModelError,
    },
    /// It takes too long.
    #[error("it takes more than {MOST_PERIODS} forcing periods; give a --time of at most {most}")]
    TooLong {
        /// Time of the largest number of periods.
        most: f64,
    },
}

/// A computed run-up.
pub struct RunUp {
    /// The change of the parameter.
    pub ramp: Ramp,
    /// The segments, each with its motion.
    pub parts: Vec<(Segment, History)>,
}

impl Ramp {
    /// Returns the model with a value of the parameter.
    pub(crate) fn model(&self, model: &dyn Model, value: f64) -> Result<Box<dyn Model>, ModelError> {
        let mut model = model.clone_model();
        model.set(&self.name, value)?;
        Ok(model)
    }

    /// Divides the time into forcing periods, each with the value at its start. Checks the model for all values.
    ///
    /// # Errors
    /// [`RampError`] if the model has no motion for a value, or if there are too many periods.
    pub fn segments(&self, model: &dyn Model) -> Result<Vec<Segment>, RampError> {
        let period_at = |value| self.model(model, value).and_then(|model| model.oscillator());
        let mut segments: Vec<Segment> = Vec::new();
        let (mut t, mut period) = (0.0, 0.0);
        for _ in 0..MOST_PERIODS {
            let value = self.from + (self.to - self.from) * (t / self.time);
            match segments.last_mut() {
                Some(last) if last.value == value => last.periods += 1,
                _ => {
                    let failed = |error| RampError::Value { name: self.name.clone(), value, error };
                    period = period_at(value).map_err(failed)?.period();
                    segments.push(Segment { value, periods: 1 });
                }
            }
            t += period;
            if t >= self.time {
                return Ok(segments);
            }
        }
        Err(RampError::TooLong { most: t })
    }

    /// Computes the motion from a state, or none if `halt` was raised. `report` is called with the number of periods that are done.
    ///
    /// # Errors
    /// [`Stopped`] if the motion cannot be continued.
    pub fn run(
        self,
        model: &dyn Model,
        segments: Vec<Segment>,
        start: State,
        halt: &AtomicBool,
        report: &mut dyn FnMut(u64),
    ) -> Result<Option<RunUp>, Stopped> {
        let prepared = segments.iter().map_while(|segment| {
            let model = self.model(model, segment.value).ok()?;
            Some((Flow::of(&*model).ok()?, model.law(), segment.periods))
        });
        let histories = run_up(start, prepared, SAMPLES, halt, report)?;
        Ok(histories
            .map(|histories| RunUp { ramp: self, parts: segments.into_iter().zip(histories).collect() }))
    }
}

/// A displacement, a gap or a signal during a run-up.
pub(crate) struct Quantity {
    /// Name of its column.
    pub(crate) name: String,
    /// Label of its axis.
    pub(crate) label: String,
    /// The gap, if it is one.
    pub(crate) gap: Option<usize>,
    /// Whether a gap is the same.
    pub(crate) is_repeated: bool,
    /// Values at the samples.
    pub(crate) values: Vec<f64>,
}

/// Samples of all displacements, gaps and signals.
pub(crate) struct Series {
    /// Time and value of the parameter at each sample.
    pub(crate) at: Vec<[f64; 2]>,
    pub(crate) quantities: Vec<Quantity>,
}

impl Series {
    pub(crate) fn of(model: &dyn Model) -> Result<Series, ModelError> {
        let (oscillator, units, names) = (model.oscillator()?, model.units(), model.state_names());
        let quantity = |name: String, label: String, gap| Quantity {
            name,
            label,
            gap,
            is_repeated: false,
            values: Vec::new(),
        };
        let is_gap = |i: usize| {
            let mut rows = oscillator.gaps.iter().map(|gap| &gap.row);
            rows.any(|row| row.iter().enumerate().all(|(k, factor)| *factor == f64::from(u8::from(i == k))))
        };
        let displacements = names.iter().step_by(2).enumerate().map(|(i, name)| {
            let label = with_unit(&symbol(name), units.component(2 * i).as_deref());
            Quantity { is_repeated: is_gap(i), ..quantity((*name).to_owned(), label, None) }
        });
        let gaps = gap_columns(model).into_iter().enumerate().map(|(gap, [name, _])| {
            let label = with_unit(WallLabels::of(model, gap).gap(), units.gap.as_deref());
            quantity(name, label, Some(gap))
        });
        let signals = subjects(model).signals.into_iter().zip(&units.signals).map(|(name, unit)| {
            let label = with_unit(&symbol(&name), unit.as_deref());
            quantity(name, label, None)
        });
        Ok(Series { at: Vec::new(), quantities: displacements.chain(gaps).chain(signals).collect() })
    }

    /// Adds the samples of a segment, without the last one, which belongs to the next segment. `moments` are those of its table.
    pub(crate) fn add(&mut self, value: f64, history: &History, moments: &[Moment]) {
        let mut next = 0;
        for sample in history.samples.iter().take(history.samples.len().saturating_sub(1)) {
            next += moments[next..].iter().take_while(|moment| moment.t <= sample.t).count();
            let Some(moment) = next.checked_sub(1).map(|last| &moments[last]) else { continue };
            self.at.push([sample.t, value]);
            let displacements = moment
                .state
                .iter()
                .step_by(2)
                .take(self.quantities.len() - moment.gaps.len() - moment.outputs.signals.len());
            let gaps = moment.gaps.iter().map(|[gap, _]| gap);
            let values = displacements.chain(gaps).chain(&moment.outputs.signals);
            self.quantities.iter_mut().zip(values).for_each(|(quantity, value)| quantity.values.push(*value));
        }
    }

    /// Returns the amplitudes of the orders in windows of [`WINDOW`] periods; nothing for a shorter motion.
    pub(crate) fn orders(&self) -> Orders {
        let (length, periods) = (WINDOW * SAMPLES, self.at.len() / SAMPLES);
        let hop = SAMPLES * periods.div_ceil(MOST_WINDOWS).max(1);
        let starts = (0..).map(|nth| nth * hop).take_while(|start| start + length <= self.at.len());
        let window = |start: usize| {
            let of = |quantity: &Quantity| {
                let part = &quantity.values[start..start + length];
                let mean = part.iter().sum::<f64>() / length as f64;
                let swings: Vec<f64> = part.iter().map(|value| value - mean).collect();
                let mut lines = amplitudes(&[&swings], hann);
                lines.truncate(HIGHEST_ORDER * WINDOW + 1);
                lines[0] = mean.abs();
                lines
            };
            (self.at[start + length / 2], self.quantities.iter().map(of).collect())
        };
        Orders { windows: starts.map(window).collect() }
    }
}

/// Spectra by order along a run-up.
pub(crate) struct Orders {
    /// Time and value of the parameter in the middle of each window, and the amplitudes of each quantity by the number of the line.
    pub(crate) windows: Vec<([f64; 2], Vec<Vec<f64>>)>,
}

impl Orders {
    /// Returns the order of a line.
    pub(crate) fn order(line: usize) -> f64 {
        line as f64 / WINDOW as f64
    }
}
