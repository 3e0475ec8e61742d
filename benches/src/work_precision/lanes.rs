//! Runs the subjects on a graphics device, in lanes of this project or of Runge-Kutta.

use std::time::{Duration, Instant};

use super::cells::{Subject, VARIANTS};
use super::outcome::Outcome;
use super::{EVENTS, PERIODS, shaders};
use rattlemap::gpu::{
    AdapterChoice, Features, Gpu, GpuError, Lane, LaneSettings, Precision, Tables, describe, is_hardware,
};
use rattlemap::record::{Record, valid};
use rattlemap_dynamics::model::{Law, Pair};

/// The integrator of lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The exact propagator of maps.
    Exact,
    /// Classical Runge-Kutta, with events inside the loop over steps.
    RungeKutta,
    /// Classical Runge-Kutta in the two phases of lanes.
    RungeKuttaPhased,
}

/// A device that integrates subjects.
pub struct Device {
    gpu: Gpu,
    flows: Vec<Pair>,
    laws: Vec<Law>,
    lanes: Vec<Lane>,
    /// Number of copies of each subject.
    copies: usize,
}

impl Device {
    /// Opens the adapter that the environment names, else the best one, for `copies` >= 1 copies of each subject.
    ///
    /// # Errors
    /// See [`Gpu::open`].
    pub fn open(
        precision: Precision,
        form: Form,
        subjects: &[Subject],
        copies: usize,
    ) -> Result<Device, GpuError> {
        let mut gpu = pollster::block_on(Gpu::open(precision, &AdapterChoice::from_environment()))?;
        gpu.rewrite_shaders(match form {
            Form::Exact => shaders::with_event_times,
            Form::RungeKutta => shaders::runge_kutta,
            Form::RungeKuttaPhased => shaders::runge_kutta_phased,
        });
        let (mut flows, mut laws): (Vec<Pair>, Vec<Law>) = (Vec::new(), Vec::new());
        let lanes: Vec<Lane> = subjects
            .iter()
            .map(|subject| Lane {
                flow: index_of(&mut flows, subject.oscillator.clone()),
                law: index_of(&mut laws, subject.law),
                start: subject.start,
            })
            .collect();
        // Variants of a cell stay together, as neighbours in a map do on the device.
        let copied = lanes.chunks(VARIANTS as usize).flat_map(|cell| cell.repeat(copies)).collect();
        Ok(Device { gpu, flows, laws, lanes: copied, copies })
    }

    /// Returns the name of the adapter.
    pub fn adapter(&self) -> String {
        describe(self.gpu.adapter())
    }

    /// Whether the adapter is hardware, not a program on the processor.
    pub fn is_hardware(&self) -> bool {
        is_hardware(self.gpu.adapter())
    }

    /// Returns the number of lanes in one run.
    pub fn lane_count(&self) -> usize {
        self.lanes.len()
    }

    /// Computes and uploads the constants for `steps` steps per forcing period, or more if the motion needs them.
    ///
    /// # Errors
    /// See [`Gpu::load`].
    pub fn load(&self, steps: u32) -> Result<Tables, GpuError> {
        pollster::block_on(self.gpu.load(&self.flows, &self.laws, Some(steps)))
    }

    /// Integrates every copy. Returns the time, and the result of one copy of each subject.
    ///
    /// # Errors
    /// See [`Gpu::run_on`].
    pub fn run(&mut self, tables: &Tables) -> Result<(Duration, Vec<Outcome>), GpuError> {
        // Times of events replace the mesh fraction.
        let settings =
            LaneSettings { mesh: false, features: Features::default(), ..LaneSettings::only(PERIODS) };
        let clock = Instant::now();
        let records = pollster::block_on(self.gpu.run_on(tables, &self.lanes, &settings))?;
        let elapsed = clock.elapsed();
        let cell = self.copies * VARIANTS as usize;
        let outcome = |(record, lane): (&Record, &Lane)| self.outcome(record, lane, tables);
        let first_copies = records.chunks(cell).zip(self.lanes.chunks(cell));
        let outcomes = first_copies
            .flat_map(|(records, lanes)| records.iter().zip(lanes).take(VARIANTS as usize))
            .map(outcome)
            .collect();
        Ok((elapsed, outcomes))
    }

    fn outcome(&self, record: &Record, lane: &Lane, tables: &Tables) -> Outcome {
        if record.valid & valid::LYAPUNOV == 0 {
            return Outcome::lost();
        }
        let period = self.flows[lane.flow as usize].period();
        let steps = f64::from(tables.steps_per_period(lane.flow));
        let packed = (record.impacts_per_period * f64::from(record.periods_run)).round() as u32;
        // The record divides exponents by the period.
        let fractions = [record.lyapunov, record.lyapunov_error].map(|x| x * period);
        let time = |i: usize| {
            let step = (packed >> (16 * i)) & 0xffff;
            if step == 0 { f64::NAN } else { (f64::from(step - 1) + fractions[i]) / steps * period }
        };
        Outcome { state: record.strobe(), events: std::array::from_fn::<f64, EVENTS, _>(time) }
    }
}

fn index_of<T: PartialEq>(list: &mut Vec<T>, item: T) -> u32 {
    let at = list.iter().position(|other| *other == item).unwrap_or_else(|| {
        list.push(item);
        list.len() - 1
    });
    at as u32
}
