//! Measures every method at every setting, alternately.

use std::rc::Rc;
use std::time::{Duration, Instant};

use super::cells::{Subject, by_reference};
use super::lanes::{Device, Form};
use super::outcome::{Error, Outcome, median_and_worst};
use super::points::Point;
use super::{PERIODS, adaptive, fixed_step};
use rattlemap::cli::bench::spread::Spread;
use rattlemap::gpu::{GpuError, Precision, Tables};
use rattlemap_dynamics::model::Law;
use rattlemap_dynamics::motion::Flow;

/// An integrator and its precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Lanes of a graphics device.
    Lanes(Form, Precision),
    /// Classical Runge-Kutta on one core.
    FixedStep,
    /// DOP853 on one core.
    Dop853,
    /// The event-driven reference on one core.
    Reference,
}

/// The setting that decides the accuracy of a method. Each method has at most one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setting {
    /// Steps per forcing period.
    pub steps: Option<u32>,
    /// Relative and absolute tolerance.
    pub tolerance: Option<f64>,
}

impl Setting {
    fn steps(self) -> u32 {
        self.steps.expect("a method with a grid")
    }
}

impl Method {
    /// All methods with their names in tables.
    pub const ALL: [(Method, &'static str); 9] = [
        (Method::Lanes(Form::Exact, Precision::F32), "lane-f32"),
        (Method::Lanes(Form::Exact, Precision::F64), "lane-f64"),
        (Method::Lanes(Form::RungeKutta, Precision::F32), "rk4-wgsl-f32"),
        (Method::Lanes(Form::RungeKutta, Precision::F64), "rk4-wgsl-f64"),
        (Method::Lanes(Form::RungeKuttaPhased, Precision::F32), "rk4-phased-f32"),
        (Method::Lanes(Form::RungeKuttaPhased, Precision::F64), "rk4-phased-f64"),
        (Method::FixedStep, "rk4-core"),
        (Method::Dop853, "dop853-core"),
        (Method::Reference, "reference"),
    ];

    /// Returns the name in tables.
    pub fn name(self) -> &'static str {
        let found = Method::ALL.iter().find(|(method, _)| *method == self);
        found.expect("`ALL` has every method").1
    }

    /// Returns the measured settings. `quick` selects the first and the third.
    pub fn settings(self, quick: bool) -> Vec<Setting> {
        let doubled = |from: u32, to: u32| {
            std::iter::successors(Some(from), |n| Some(2 * n))
                .take_while(move |&n| n <= to)
                .map(|steps| Setting { steps: Some(steps), tolerance: None })
        };
        let all: Vec<Setting> = match self {
            Method::Lanes(Form::Exact, _) => doubled(16, 1024).collect(),
            Method::Lanes(..) | Method::FixedStep => doubled(64, 8192).collect(),
            Method::Dop853 => [1e-4, 1e-6, 1e-8, 1e-10, 1e-12]
                .map(|tolerance| Setting { steps: None, tolerance: Some(tolerance) })
                .to_vec(),
            Method::Reference => vec![Setting::default()],
        };
        if quick { all.into_iter().step_by(2).take(2).collect() } else { all }
    }

    fn precision(self) -> Precision {
        match self {
            Method::Lanes(_, precision) => precision,
            _ => Precision::F64,
        }
    }
}

/// Extent of a measurement.
#[derive(Clone, Copy, Debug)]
pub struct Thoroughness {
    /// Number of timed runs of every method and setting.
    pub rounds: usize,
    /// Number of copies of each subject on a device; `None` for as many as fill it.
    pub copies: Option<usize>,
    /// Whether only two settings of each method are measured.
    pub quick: bool,
    /// Shortest time, in seconds, that a method on a core runs in one round.
    pub least_seconds: f64,
}

/// Results of one method and setting.
#[derive(Clone, Debug)]
pub struct Curve {
    /// The row of the table.
    pub point: Point,
    /// Errors of each subject.
    pub errors: Vec<Error>,
}

/// Measures the methods. After each run, `report` gets the numbers of finished and of all runs.
///
/// # Errors
/// If a device fails. Methods in f64 are omitted if the device has no f64.
pub fn measure(
    subjects: &[Subject],
    methods: &[Method],
    how: Thoroughness,
    report: &dyn Fn(usize, usize),
) -> Result<Vec<Curve>, GpuError> {
    let mut runners = Vec::new();
    for &method in methods {
        match Runner::open(method, subjects, how) {
            Ok(runner) => runners.push(runner),
            Err(GpuError::NoAdapter { .. }) if method.precision() == Precision::F64 => {}
            Err(error) => return Err(error),
        }
    }
    let all: usize = runners.iter().map(|runner| runner.settings.len()).sum::<usize>() * (how.rounds + 1);
    let mut done = 0;
    // The first round is not timed. Its results give the errors.
    for round in 0..=how.rounds {
        for runner in &mut runners {
            for i in 0..runner.settings.len() {
                let least = if round == 0 { 0.0 } else { how.least_seconds };
                let (seconds, outcomes) = runner.run(i, subjects, least)?;
                if round == 0 {
                    runner.outcomes.push(outcomes);
                } else {
                    runner.times[i].push(seconds);
                }
                done += 1;
                report(done, all);
            }
        }
    }
    Ok(runners.iter().flat_map(|runner| runner.curves(subjects)).collect())
}

/// Returns the flow and law of each subject. Neighbours with equal oscillators share a flow.
fn flows(subjects: &[Subject]) -> Vec<(Rc<Flow>, Law)> {
    let mut flows: Vec<(Rc<Flow>, Law)> = Vec::new();
    for (n, subject) in subjects.iter().enumerate() {
        let flow = match flows.last() {
            Some((flow, _)) if subjects[n - 1].oscillator == subject.oscillator => Rc::clone(flow),
            _ => Rc::new(Flow::new(&subject.oscillator)),
        };
        flows.push((flow, subject.law));
    }
    flows
}

/// A method, its settings and its results.
struct Runner {
    method: Method,
    settings: Vec<Setting>,
    device: Option<(Device, Vec<Tables>)>,
    /// Flows of the reference. As in a map, cells with equal oscillators share one, and its computation is not timed.
    flows: Vec<(Rc<Flow>, Law)>,
    outcomes: Vec<Vec<Outcome>>,
    times: Vec<Vec<f64>>,
}

/// Device of methods that run on the processor, in tables.
pub const ONE_CORE: &str = "one core";

/// Number of copies of each subject that fill a device.
const HARDWARE_COPIES: usize = 1024;
const SOFTWARE_COPIES: usize = 16;

impl Runner {
    fn open(method: Method, subjects: &[Subject], how: Thoroughness) -> Result<Runner, GpuError> {
        let settings = method.settings(how.quick);
        let mut device = None;
        if let Method::Lanes(form, precision) = method {
            let open = |copies| Device::open(precision, form, subjects, copies);
            let mut opened = open(how.copies.unwrap_or(SOFTWARE_COPIES))?;
            if how.copies.is_none() && opened.is_hardware() {
                opened = open(HARDWARE_COPIES)?;
            }
            let tables = settings.iter().map(|setting| opened.load(setting.steps()));
            let tables = tables.collect::<Result<_, _>>()?;
            device = Some((opened, tables));
        }
        let flows = match method {
            Method::Reference => flows(subjects),
            _ => Vec::new(),
        };
        let times = vec![Vec::new(); settings.len()];
        Ok(Runner { method, settings, device, flows, outcomes: Vec::new(), times })
    }

    /// Returns the seconds per lane-period, and the result of each subject.
    fn run(&mut self, i: usize, subjects: &[Subject], least: f64) -> Result<(f64, Vec<Outcome>), GpuError> {
        if let Some((device, tables)) = &mut self.device {
            let (elapsed, outcomes) = device.run(&tables[i])?;
            let lane_periods = device.lane_count() as f64 * f64::from(PERIODS);
            return Ok((elapsed.as_secs_f64() / lane_periods, outcomes));
        }
        let clock = Instant::now();
        let mut runs = 0;
        loop {
            let outcomes: Vec<Outcome> = (0..subjects.len()).map(|n| self.one(i, subjects, n)).collect();
            runs += 1;
            let elapsed: Duration = clock.elapsed();
            if elapsed.as_secs_f64() >= least {
                let lane_periods = (runs * subjects.len()) as f64 * f64::from(PERIODS);
                return Ok((elapsed.as_secs_f64() / lane_periods, outcomes));
            }
        }
    }

    fn one(&self, i: usize, subjects: &[Subject], n: usize) -> Outcome {
        let subject = &subjects[n];
        let setting = self.settings[i];
        match self.method {
            Method::FixedStep => fixed_step::integrate(subject, setting.steps()),
            Method::Dop853 => adaptive::integrate(subject, setting.tolerance.expect("a tolerance")),
            Method::Reference => {
                let (flow, law) = &self.flows[n];
                by_reference(flow, *law, subject.start)
            }
            Method::Lanes(..) => unreachable!("devices run lanes"),
        }
    }

    fn curves(&self, subjects: &[Subject]) -> Vec<Curve> {
        (0..self.settings.len()).map(|i| self.curve(i, subjects)).collect()
    }

    fn curve(&self, i: usize, subjects: &[Subject]) -> Curve {
        let errors: Vec<Error> = subjects
            .iter()
            .zip(&self.outcomes[i])
            .map(|(subject, outcome)| outcome.error(&subject.exact, subject.oscillator.period()))
            .collect();
        let [state_median, state_worst] = median_and_worst(errors.iter().map(|e| e.state).collect());
        let [event_median, event_worst] = median_and_worst(errors.iter().filter_map(|e| e.event).collect());
        let Spread { median, low, high } = Spread::of(self.times[i].clone());
        let (device, cores, lanes) = match &self.device {
            Some((device, _)) => {
                let cores = (!device.is_hardware()).then(cores);
                (device.adapter(), cores, device.lane_count())
            }
            None => (ONE_CORE.to_owned(), Some(1), subjects.len()),
        };
        let point = Point {
            method: self.method.name().to_owned(),
            device,
            precision: self.method.precision().name().to_owned(),
            steps: self.settings[i].steps,
            tolerance: self.settings[i].tolerance,
            cores,
            lanes,
            periods: PERIODS,
            rounds: self.times[i].len(),
            seconds_per_lane_period: median,
            fastest: low,
            slowest: high,
            state_error_median: state_median,
            state_error_worst: state_worst,
            event_error_median: event_median,
            event_error_worst: event_worst,
            lost: errors.iter().filter(|e| e.state.is_infinite()).count(),
        };
        Curve { point, errors }
    }
}

fn cores() -> u32 {
    std::thread::available_parallelism().map_or(1, |n| n.get() as u32)
}
