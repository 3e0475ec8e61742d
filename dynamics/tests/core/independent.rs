//! Compares the reference with an integrator by matrix exponentials on random models of one gap with harmonics, stages, further walls,
//! pushing walls, preloads and dry friction. Both share only the description of the oscillator.

pub(crate) mod random;

use std::time::{Duration, Instant};

use rattlemap_dynamics::model::{Form, Law, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{
    Budget, Class, EVENT_PERIODS, Measurement, Orbit, Status, analyse_flow, measure,
};
use rayon::prelude::*;

use crate::common::BUDGET;
use crate::machines::agree::{Found, ONE_GAP, compare_case};
use crate::machines::cycle::{Cycle, follow, settle};
use crate::machines::engine::program::OneGap;
use crate::machines::motion::{Mode, Motion};
use crate::machines::random::{Case, any_case, apart};
use crate::machines::system::{ANGLE, System};
use random::{PLAIN, Shape, case};

/// Allowed effect of rounding errors, as a multiple of the effect of the known errors of [`Motion::shaken`].
const NOISES: f64 = 20.0;

/// Motions in which known errors have a larger effect are not compared further.
const MOST_NOISE: f64 = 1e-6;

/// Largest difference of the strobe states of a cycle, relative to the size of the motion.
const STROBE_OFF: f64 = 1e-10;

/// Largest difference of the moduli of largest multipliers, per forcing period of the cycle.
const MULTIPLIER_OFF: f64 = 1e-7;

/// Largest difference of the share of time in contact.
const MESH_OFF: f64 = 1e-9;

/// Multipliers that are nearer to 1 than this may belong to creeping dry friction.
const CREEP: f64 = 2e-5;

/// Forcing periods after which a motion that is not near a cycle is not followed any more.
const MOST_PERIODS: usize = 200;

/// How the motions of a model agree.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Agreement {
    /// Both settle on the same cycle.
    Cycle,
    /// The reference's cycle is one, but the other motion does not settle on it: it is too slow, or chaos leads it elsewhere.
    OtherEnd,
    /// The reference finds no cycle, or rounding decides its period.
    NoCycle,
}

#[derive(Clone, Debug)]
struct Compared {
    agreement: Agreement,
    /// The first periods.
    first: Found,
    /// Differences of the cycle's states and multipliers.
    off: [f64; 2],
}

/// Compares a cycle with the reference's. Returns the differences of states and multipliers.
fn same_cycle(case: &Case, ours: &Cycle, measured: &Measurement, orbit: &Orbit) -> Result<[f64; 2], String> {
    let off = |state: &[f64]| apart(state, &orbit.strobe[..state.len()], case.machine.omega);
    let at = ours.strobes.iter().map(|(state, ..)| off(state)).fold(f64::INFINITY, f64::min);
    let radius =
        orbit.floquet.as_ref().and_then(|all| all.first()).map_or(f64::NAN, |[re, im]| re.hypot(*im));
    let radii = [radius, measured.multiplier.map_or(f64::NAN, |[modulus, _]| modulus)];
    let by = radii.map(|radius| (ours.radius - radius).abs()).into_iter().fold(0.0, f64::max);
    let period = ours.strobes.len() as u32;
    let impacts = ours.impacts as f64 / f64::from(period);
    let agree = [
        ("period", measured.period == Some(period) && orbit.class == Class::Periodic { period }),
        ("state", at < STROBE_OFF),
        (
            "multiplier",
            radii.iter().all(|radius| (ours.radius - radius).abs() < MULTIPLIER_OFF * f64::from(period)),
        ),
        ("word", measured.word == ours.word && Some(&orbit.word) == ours.word.as_ref()),
        (
            "impacts",
            [measured.impacts_per_period, orbit.impacts_per_period]
                .iter()
                .all(|n| (n - impacts).abs() < 1e-12),
        ),
        (
            "meshing",
            [measured.mesh_fraction, orbit.mesh_fraction]
                .iter()
                .all(|n| (n - ours.meshes).abs() < MESH_OFF + NOISES * ours.noise),
        ),
    ];
    match agree.iter().find(|(_, agrees)| !agrees) {
        None => Ok([at, by]),
        Some((what, _)) => Err(format!("{what}: {ours:?} at {at:e}, by {by:e}\n{measured:?}\n{orbit:?}")),
    }
}

/// Whether the reference also finds a cycle from a state of it that determines the mode.
fn confirms(case: &Case, flow: &Flow, ours: &Cycle) -> bool {
    let is_plain = |modes: &[Mode]| matches!(modes[0], Mode::Plain | Mode::Open);
    ours.strobes.iter().find(|(_, modes, _)| is_plain(modes)).is_none_or(|(strobe, ..)| {
        measure(flow, case.machine.law(), state(strobe), &BUDGET).period == Some(ours.strobes.len() as u32)
    })
}

fn compare(case: &Case) -> Result<Compared, String> {
    let (flow, law, start) = (Flow::new(&case.machine), case.machine.law(), state(&case.start));
    let system = System::new(&case.machine, ANGLE);
    let mut theirs = OneGap::new(&flow, case.machine.degrees(), law, start);
    let first = compare_case(case, ONE_GAP, &mut theirs)?;
    let found = |agreement, off: [f64; 2]| Ok(Compared { agreement, first, off });
    let measured = measure(&flow, law, start, &BUDGET);
    // Friction that creeps by ever smaller slips: rounding decides how far the multiplier is from 1.
    let creeps = |[modulus, _]: [f64; 2]| (modulus - 1.0).abs() < CREEP;
    if !case.machine.friction.is_empty() && measured.multiplier.is_some_and(creeps) {
        return found(Agreement::NoCycle, [0.0; 2]);
    }
    let ours = settle(&system, &case.start, MOST_PERIODS);
    let of_period = |period| (period, analyse_flow(&flow, law, start, &BUDGET.settings, EVENT_PERIODS));
    let theirs = measured.period.map(of_period);
    if let (Some(ours), Some((_, orbit))) = (&ours, &theirs)
        && let Ok(off) = same_cycle(case, ours, &measured, orbit)
    {
        return found(Agreement::Cycle, off);
    }
    if let Some(ours) = ours.filter(|ours| !confirms(case, &flow, ours)) {
        return Err(format!("a cycle {ours:?}\n{measured:?}\n{theirs:?}"));
    }
    let decides = |status| measured.status == Status::BelowResolution || status == Status::BelowResolution;
    let Some((period, orbit)) = theirs.filter(|(_, orbit)| !decides(orbit.status)) else {
        return found(Agreement::NoCycle, [0.0; 2]);
    };
    let start = Motion::new(&system, &orbit.strobe[..case.start.len()]);
    let followed = follow(&start, period as usize).ok_or("the reference's cycle does not end")?;
    if followed.noise > MOST_NOISE {
        return found(Agreement::NoCycle, [0.0; 2]);
    }
    if followed.off > STROBE_OFF + NOISES * followed.noise {
        return Err(format!("no cycle: {followed:?}\n{orbit:?}"));
    }
    found(Agreement::OtherEnd, same_cycle(case, &followed, &measured, &orbit)?)
}

/// Compares models. At least `share` of them must settle on the same cycle.
fn check(shape: Shape, seeds: std::ops::Range<u64>, share: f64) {
    let count = seeds.end - seeds.start;
    let all: Vec<_> = seeds.into_par_iter().map(|seed| (seed, compare(&case(seed, shape)))).collect();
    let mut failures = Vec::new();
    let (mut worst, mut by_stage, mut found) = ([0.0f64; 3], [0; 2], [0; 3]);
    for (seed, compared) in all {
        match compared {
            Ok(compared) => {
                let [at, by] = compared.off;
                let off = [compared.first.state, at, by];
                worst = std::array::from_fn(|i| worst[i].max(off[i]));
                by_stage = [0, 1].map(|i| by_stage[i] + compared.first.by_stage[i]);
                found[compared.agreement as usize] += 1;
            }
            Err(error) => failures.push(format!("{seed}: {error}\n{:?}", case(seed, shape))),
        }
    }
    println!(
        "{found:?} cycles, other ends, no cycles; off by {worst:?}; {by_stage:?} rests and onsets end by a stage"
    );
    assert!(failures.is_empty(), "{} fail:\n{}", failures.len(), failures.join("\n"));
    assert!(f64::from(found[0]) >= share * count as f64 && 20 * found[1] <= count as u32, "{found:?}");
    // Contact onsets need walls with impacts, and hardly occur with friction or in few models.
    let has_onsets = by_stage[1] > 0 || shape.pushing || shape.friction;
    assert!(by_stage[0] > 20 && has_onsets || !shape.stages || count < 200, "{by_stage:?}");
}

/// Shapes of models, and the least share of them that must settle on the same cycle.
const SHAPES: [(Shape, f64); 11] = [
    (PLAIN, 0.9),
    (Shape { harmonics: true, ..PLAIN }, 0.8),
    (Shape { stages: true, ..PLAIN }, 0.8),
    (Shape { harmonics: true, stages: true, ..PLAIN }, 0.8),
    (Shape { walls: true, ..PLAIN }, 0.8),
    (Shape { walls: true, stages: true, ..PLAIN }, 0.8),
    (Shape { pushing: true, ..PLAIN }, 0.8),
    (Shape { pushing: true, walls: true, stages: true, ..PLAIN }, 0.8),
    (Shape { friction: true, ..PLAIN }, 0.8),
    (Shape { friction: true, harmonics: true, stages: true, ..PLAIN }, 0.8),
    (Shape { friction: true, pushing: true, walls: true, stages: true, ..PLAIN }, 0.8),
];

#[test]
fn twenty_models_of_each_shape_agree_with_matrix_exponentials() {
    SHAPES.into_iter().for_each(|(shape, share)| check(shape, 0..20, share));
}

#[test]
#[ignore = "takes 70 s"]
fn two_hundred_models_of_each_shape_agree_with_matrix_exponentials() {
    SHAPES.into_iter().for_each(|(shape, share)| check(shape, 0..200, share));
}

#[test]
#[ignore = "minutes"]
fn five_thousand_models_of_each_shape_agree_with_matrix_exponentials() {
    for (harmonics, stages) in [(false, false), (true, false), (false, true), (true, true)] {
        check(Shape { harmonics, stages, ..PLAIN }, 200..5200, 0.8);
    }
    check(Shape { pushing: true, stages: true, ..PLAIN }, 200..5200, 0.8);
    check(Shape { friction: true, stages: true, ..PLAIN }, 200..5200, 0.7);
}

/// Longest time for one model on an idle processor.
const LONGEST_TIME: Duration = Duration::from_secs(2);

const WIDE: Shape = Shape { harmonics: true, stages: true, wide: true, ..PLAIN };

/// Returns a random model with wide ranges.
fn wide(shape: Shape) -> impl Fn(u64) -> (Form, Law, State) {
    move |seed| {
        let case = case(seed, shape);
        (Form::from(&case.machine), case.machine.law(), state(&case.start))
    }
}

/// Returns a random machine, which has its contact laws itself.
fn machine(seed: u64) -> (Form, Law, State) {
    let case = any_case(seed);
    (Form::Machine(case.machine), Law::both(0.0, 0.0), state(&case.start))
}

/// Measures random models. Every motion must end in time, with finite numbers.
fn check_ends(
    model: impl Fn(u64) -> (Form, Law, State) + Sync,
    seeds: std::ops::Range<u64>,
    longest: Duration,
) {
    let ends: Vec<_> = seeds
        .into_par_iter()
        .map(|seed| {
            let (oscillator, law, start) = model(seed);
            let clock = Instant::now();
            let budget = Budget { undecided_periods: 0, ..BUDGET };
            let measured = measure(&Flow::new(&oscillator), law, start, &budget);
            let numbers = [measured.impacts_per_period, measured.mesh_fraction];
            let is_finite = measured.strobe.iter().chain(&numbers).all(|x| x.is_finite())
                && measured.lyapunov.is_none_or(|[exponent, error]| !exponent.is_nan() && error.is_finite());
            (clock.elapsed(), seed, measured.status, is_finite)
        })
        .collect();
    let slowest = ends.iter().max_by_key(|end| end.0).unwrap();
    let of = |status| ends.iter().filter(|end| end.2 == status).count();
    let statuses = Status::ALL.map(|status| (status.name(), of(status)));
    println!("{statuses:?}; the slowest: {slowest:?}");
    let slow: Vec<_> = ends.iter().filter(|end| end.0 >= longest).collect();
    let wrong: Vec<_> = ends.iter().filter(|end| !end.3).collect();
    assert!(wrong.is_empty(), "not finite: {wrong:?}");
    assert!(slow.is_empty(), "{slow:?}");
    assert!(2 * of(Status::Ok) > ends.len(), "{statuses:?}");
}

#[test]
fn two_hundred_wide_models_end_with_finite_numbers() {
    check_ends(wide(WIDE), 0..200, LONGEST_TIME);
}

#[test]
#[ignore = "minutes"]
fn ten_thousand_wide_models_end_with_finite_numbers() {
    check_ends(wide(WIDE), 0..10_000, LONGEST_TIME);
}

#[test]
#[ignore = "minutes"]
fn ten_thousand_machines_end_with_finite_numbers() {
    check_ends(machine, 0..10_000, LONGEST_TIME);
}
