//! Compares motions of the program with the integrator by matrix exponentials, on random machines and models of one gap.

use rattlemap_dynamics::model::Restitution;
use rattlemap_dynamics::model::{Oscillator, Side};
use rayon::prelude::*;

use super::engine::{Follower, Period};
use super::motion::{Event, Motion, What};
use super::random::{Case, any_case, apart, bent_case, dependent_case, light_case};
use super::system::{ANGLE, System};
use crate::independent::random::{self as one_gap, PLAIN, Shape};

/// Forcing periods that are compared.
const PERIODS: usize = 6;

/// Largest difference of states, relative to the size of the motion.
const STATE_OFF: f64 = 1e-10;

/// Largest difference of derivatives, relative to their largest entry.
const DERIVATIVE_OFF: f64 = 1e-7;

/// Largest difference of times, in forcing periods.
const TIME_OFF: f64 = 1e-9;

/// Allowed effect of rounding errors, as a multiple of the effect of the known errors.
const NOISES: f64 = 20.0;

/// Limits of a comparison.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Least size that errors of derivatives are relative to. When everything rests, derivatives are only rounding errors.
    least_derivative: f64,
    /// Motions in which known errors have a larger effect are not compared further.
    most_noise: f64,
}

const MACHINES: Limits = Limits { least_derivative: 1e-6, most_noise: 1e-9 };
pub(crate) const ONE_GAP: Limits = Limits { least_derivative: 1.0, most_noise: 1e-7 };

/// The integrator with two lengths of steps, and with known errors.
struct Ours<'a> {
    limits: Limits,
    motion: Motion<'a>,
    /// With other steps.
    other: Motion<'a>,
    shaken: Vec<Motion<'a>>,
}

impl Follower for Motion<'_> {
    fn advance(&mut self) -> Result<Period, String> {
        self.events.clear();
        self.slips.clear();
        self.advance_period().ok_or("too many events, or far away")?;
        Ok(Period {
            events: self.events.clone(),
            slips: self.slips.clone(),
            state: self.state(),
            derivative: self.derivative(),
        })
    }
}

/// Largest differences, and numbers of compared periods and events.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Found {
    pub(crate) state: f64,
    derivative: f64,
    time: f64,
    periods: usize,
    events: usize,
    slips: usize,
    /// Rests on rigid walls and contact onsets that a change of the stage has ended.
    pub(crate) by_stage: [usize; 2],
}

type Happening = (What, Side, Option<u8>);

/// Returns kinds and times of the events of a gap, as the order of events at one time has no meaning for two gaps.
fn of_gap(events: &[Event], gap: usize) -> (Vec<Happening>, Vec<f64>) {
    let own = events.iter().filter(|event| event.gap == gap);
    own.map(|event| ((event.what, event.side, event.symbol), event.t)).unzip()
}

impl Ours<'_> {
    fn size(&self, period: &Period) -> f64 {
        period.derivative.amax().max(self.limits.least_derivative)
    }

    /// Advances by a period. Returns the period, the same period with other steps, and the effects of errors on state and derivative; none
    /// if these are too large.
    fn advance(&mut self, omega: f64) -> Option<(Period, Period, [f64; 2])> {
        let (ours, other) =
            (Follower::advance(&mut self.motion).ok()?, Follower::advance(&mut self.other).ok()?);
        let mut noise = apart(&ours.state, &other.state, omega);
        for shaken in &mut self.shaken {
            shaken.advance_period()?;
            noise = noise.max(apart(&ours.state, &shaken.state(), omega));
        }
        let size = self.size(&ours);
        let of_derivative = (&ours.derivative - &other.derivative).amax() / size;
        let most = self.limits.most_noise;
        // A comparison also ends if derivatives let errors of 1e-13 grow to this effect.
        (noise <= most && size <= most / 1e-13 && !self.motion.is_crowded).then_some((
            ours,
            other,
            [noise, of_derivative],
        ))
    }
}

fn compare(machine: &Oscillator, mut ours: Ours, theirs: &mut dyn Follower) -> Result<Found, String> {
    let mut found = Found::default();
    for period in 0..PERIODS {
        let Some((own, other, [noise, of_derivative])) = ours.advance(machine.omega) else { break };
        let period_of = |error: String| format!("period {period}: {error}");
        let their = theirs.advance().map_err(period_of)?;
        for gap in 0..machine.gaps.len() {
            let [(a, times), (b, their_times), (c, other_times)] =
                [&own, &their, &other].map(|one| of_gap(&one.events, gap));
            if a != c {
                return Ok(found);
            }
            if a != b {
                return Err(period_of(format!("gap {gap}: {a:?} at {times:?} but {b:?} at {their_times:?}")));
            }
            for ((t, their), other) in times.iter().zip(&their_times).zip(&other_times) {
                let off = (t - their).abs() / machine.period();
                if off > TIME_OFF + NOISES * (noise + (t - other).abs() / machine.period()) {
                    return Err(period_of(format!("gap {gap}: an event at {t} but {their}")));
                }
                found.time = found.time.max(off);
            }
        }
        let symbols = |of: &Period| of.slips.iter().map(|slip| slip.0).collect::<Vec<_>>();
        if symbols(&own) != symbols(&their) {
            return Err(period_of(format!("slips {:?} but {:?}", own.slips, their.slips)));
        }
        let off = apart(&own.state, &their.state, machine.omega);
        if off.is_nan() || off > STATE_OFF + NOISES * noise {
            return Err(period_of(format!("state off by {off:e} with noise {noise:e}")));
        }
        let size = ours.size(&own);
        let of = (&own.derivative - &their.derivative).amax() / size;
        // At rest on a wall, the known derivative is not a number.
        if !of_derivative.is_nan() && (of.is_nan() || of > DERIVATIVE_OFF + NOISES * of_derivative) {
            return Err(period_of(format!(
                "derivative off by {of:e} of {size:e} with noise {of_derivative:e}"
            )));
        }
        found.state = found.state.max(off);
        found.derivative = found.derivative.max(of);
        found.periods += 1;
        found.events += own.events.len();
        found.slips += own.slips.len();
        found.by_stage = ours.motion.by_stage;
    }
    Ok(found)
}

/// Compares motions from a start.
pub(crate) fn compare_case(case: &Case, limits: Limits, theirs: &mut dyn Follower) -> Result<Found, String> {
    let [system, other] = [ANGLE, 0.6 * ANGLE].map(|angle| System::new(&case.machine, angle));
    let start = |system| Motion::new(system, &case.start);
    let (mut motion, mut other) = (start(&system), start(&other));
    let shaken = motion.shaken();
    motion.carry_tangents();
    other.carry_tangents();
    compare(&case.machine, Ours { limits, motion, other, shaken }, theirs)
}

/// Compares all cases, and prints the first that differ.
fn check(
    seeds: std::ops::Range<u64>,
    share: f64,
    case: impl Fn(u64) -> Case + Sync,
    compare: impl Fn(&Case) -> Result<Found, String> + Sync,
) {
    let count = (seeds.end - seeds.start) as f64 * PERIODS as f64;
    let all: Vec<_> = seeds.into_par_iter().map(|seed| (seed, compare(&case(seed)))).collect();
    let failures: Vec<_> = all.iter().filter_map(|(seed, one)| Some((seed, one.as_ref().err()?))).collect();
    let found = all.iter().filter_map(|one| one.1.as_ref().ok()).fold(Found::default(), |a, b| Found {
        state: a.state.max(b.state),
        derivative: a.derivative.max(b.derivative),
        time: a.time.max(b.time),
        periods: a.periods + b.periods,
        events: a.events + b.events,
        slips: a.slips + b.slips,
        by_stage: [0, 1].map(|i| a.by_stage[i] + b.by_stage[i]),
    });
    println!("{found:?} of {count} periods");
    failures.iter().take(5).for_each(|(seed, error)| println!("seed {seed}: {error}"));
    if let Some((seed, error)) = failures.first() {
        panic!("{} fail, first seed {seed}: {error}\n{:?}", failures.len(), case(**seed));
    }
    assert!(found.periods as f64 > share * count, "too few periods");
}

/// The comparison accepts the integrator itself with other steps.
#[test]
fn the_comparison_accepts_other_steps() {
    check(0..60, 0.7, any_case, |case| {
        let system = System::new(&case.machine, 0.35 * ANGLE);
        let mut theirs = Motion::new(&system, &case.start);
        theirs.carry_tangents();
        compare_case(case, MACHINES, &mut theirs)
    });
}

/// The comparison finds small errors of a coefficient of restitution.
#[test]
fn the_comparison_finds_errors() {
    let mut differ = 0;
    for seed in 0..60 {
        let case = any_case(seed);
        let mut machine = case.machine.clone();
        for wall in machine.gaps.iter_mut().flat_map(|gap| gap.walls.iter_mut().flatten()) {
            let (Restitution::Constant(e) | Restitution::BySpeed { constant: e, .. }) = &mut wall.restitution;
            *e += 1e-7;
        }
        let system = System::new(&machine, ANGLE);
        let mut theirs = Motion::new(&system, &case.start);
        theirs.carry_tangents();
        differ += usize::from(compare_case(&case, MACHINES, &mut theirs).is_err());
    }
    println!("{differ} differ");
    assert!(differ > 30, "{differ}");
}

mod program {
    use rattlemap_dynamics::machine::System as Program;

    use super::super::engine::program::Engine;
    use super::*;

    fn check_program(seeds: std::ops::Range<u64>, limits: Limits, case: impl Fn(u64) -> Case + Sync) {
        check(seeds, 0.7, case, |case| {
            let program = Program::new(&case.machine);
            compare_case(case, limits, &mut Engine::new(&program, &case.machine, &case.start))
        });
    }

    #[test]
    fn machines_agree_with_matrix_exponentials() {
        check_program(0..40, MACHINES, any_case);
    }

    #[test]
    fn machines_with_dependent_gaps_agree_with_matrix_exponentials() {
        check_program(0..40, MACHINES, dependent_case);
    }

    #[test]
    fn machines_with_light_bodies_agree_with_matrix_exponentials() {
        check_program(0..40, MACHINES, light_case);
    }

    #[test]
    #[ignore = "minutes"]
    fn ten_thousand_machines_agree_with_matrix_exponentials() {
        check_program(300..10_300, MACHINES, any_case);
    }

    #[test]
    fn machines_with_curves_agree_with_matrix_exponentials() {
        check_program(0..40, MACHINES, bent_case);
    }

    #[test]
    #[ignore = "minutes"]
    fn two_thousand_machines_with_curves_agree_with_matrix_exponentials() {
        check_program(0..2_000, MACHINES, bent_case);
    }

    /// A curve whose force at 0 had a rounding error, a tangent at a contact from rest, two sticking elements that share coordinates, and a
    /// wall that took over from friction.
    #[test]
    fn machines_that_once_differed_agree_with_matrix_exponentials() {
        for seed in [425, 447, 435, 416] {
            let case = bent_case(seed);
            let program = Program::new(&case.machine);
            let mut theirs = Engine::new(&program, &case.machine, &case.start);
            let found = compare_case(&case, MACHINES, &mut theirs).unwrap();
            assert!(found.periods > 0, "{seed}");
        }
    }

    const SHAPES: [Shape; 6] = [
        PLAIN,
        Shape { harmonics: true, stages: true, ..PLAIN },
        Shape { walls: true, stages: true, ..PLAIN },
        Shape { pushing: true, walls: true, stages: true, ..PLAIN },
        Shape { friction: true, ..PLAIN },
        Shape { friction: true, pushing: true, walls: true, stages: true, harmonics: true, ..PLAIN },
    ];

    fn check_one_gap(seeds: std::ops::Range<u64>) {
        let limits = Limits { most_noise: MACHINES.most_noise, ..ONE_GAP };
        for shape in SHAPES {
            check_program(seeds.clone(), limits, |seed| one_gap::case(seed, shape));
        }
    }

    #[test]
    fn machines_with_one_gap_agree_with_matrix_exponentials() {
        check_one_gap(0..30);
    }

    #[test]
    #[ignore = "takes 15 s"]
    fn three_hundred_machines_of_each_shape_with_one_gap_agree_with_matrix_exponentials() {
        check_one_gap(0..300);
    }
}
