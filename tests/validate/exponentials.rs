//! Compares the judge with an integrator by matrix exponentials, on random models of one gap with harmonics, stages, further walls and
//! dry friction, and on random machines.

use rattlemap::validate::independent::machine::Flight;
use rattlemap_dynamics::model::{STATE, Side, state};
use rattlemap_dynamics::motion::EventKind;
use rayon::prelude::*;

use crate::reference_tests::independent::random::{self as one_gap, PLAIN, Shape};
use crate::reference_tests::machines::motion::{Motion, What};
use crate::reference_tests::machines::random::{Case, any_case, apart, bent_case, dependent_case};
use crate::reference_tests::machines::system::{ANGLE, System};

/// Largest difference of states, relative to the size of the motion.
const AGREEMENT: f64 = 1e-9;

/// What is compared.
#[derive(Clone, Copy)]
struct Limits {
    /// Forcing periods, and the share of them that must be comparable.
    periods: usize,
    share: f64,
    /// Motions in which known errors have a larger effect are not compared further.
    most_noise: f64,
    /// Errors of the judge, whose tolerance is larger than rounding, may have this multiple of that effect.
    noises: f64,
}

const ONE_GAP: Limits = Limits { periods: 3, share: 0.98, most_noise: 1e-7, noises: 100.0 };
const MACHINES: Limits = Limits { periods: 6, share: 0.7, most_noise: 1e-9, noises: 20.0 };

type Happening = (EventKind, Side, Option<u8>);

/// What agrees: periods, events, and changes of friction.
#[derive(Debug, Default)]
struct Compared {
    worst: f64,
    counts: [usize; 3],
    /// Rests on rigid walls and contact onsets that a change of the stage has ended.
    by_stage: [usize; 2],
}

/// Compares the first periods of a motion. The order of events at one time has no meaning for two gaps, so events are compared gap by gap.
fn compare(case: &Case, limits: Limits) -> Result<Compared, String> {
    let (machine, gaps) = (&case.machine, case.machine.gaps.len());
    let [system, other] = [ANGLE, 0.6 * ANGLE].map(|angle| System::new(machine, angle));
    let start = |system| Motion::new(system, &case.start);
    let (mut ours, mut others) = (start(&system), vec![start(&other)]);
    others.extend(ours.shaken());
    let mut judge = Flight::new(machine, &state(&case.start));
    let mut found = Compared::default();
    for period in 0..limits.periods {
        ours.clear();
        others.iter_mut().for_each(Motion::clear);
        judge.events.clear();
        judge.slips.clear();
        let Some(noise) = ours.advance_period().and_then(|()| ours.noise(&mut others)) else { break };
        if noise.is_nan() || noise > limits.most_noise || ours.is_crowded {
            break;
        }
        judge.advance(0.0, std::f64::consts::TAU).ok_or(format!("period {period}: it gives up"))?;
        let own = |motion: &Motion<'_>, gap: usize| -> Vec<Happening> {
            let kind = |what: What| match what {
                What::Impact => EventKind::Impact,
                What::Begins => EventKind::MeshStart,
                What::Ends => EventKind::MeshEnd,
            };
            let of_gap = motion.events.iter().filter(|event| event.gap == gap);
            of_gap.map(|event| (kind(event.what), event.side, event.symbol)).collect()
        };
        for gap in 0..gaps {
            let of_gap = judge.events.iter().filter(|event| event.gap == gap);
            let theirs: Vec<Happening> = of_gap.map(|event| (event.kind, event.side, event.symbol)).collect();
            if own(&ours, gap) != own(&others[0], gap) {
                return Ok(found);
            }
            if own(&ours, gap) != theirs {
                return Err(format!("period {period}, gap {gap}: {:?} but {theirs:?}", own(&ours, gap)));
            }
        }
        if !judge.slips.iter().filter_map(|slip| slip.symbol).eq(ours.slips.iter().map(|slip| slip.0)) {
            return Err(format!("period {period}: slips {:?} but {:?}", ours.slips, judge.slips));
        }
        let judged = judge.state();
        let off = apart(&ours.state(), &judged[..2 * machine.degrees()], machine.omega);
        if off.is_nan()
            || off > AGREEMENT + limits.noises * noise
            || judged[2 * machine.degrees()..STATE].iter().any(|x| *x != 0.0)
        {
            return Err(format!("period {period}: off by {off:e} with noise {noise:e}"));
        }
        found.worst = found.worst.max(off);
        let counts = [1, ours.events.len(), ours.slips.len()];
        (0..3).for_each(|i| found.counts[i] += counts[i]);
        found.by_stage = ours.by_stage;
    }
    Ok(found)
}

/// Compares all cases. Returns the sums of what agrees.
fn check(cases: Vec<Case>, limits: Limits) -> Compared {
    let count = (cases.len() * limits.periods) as f64;
    let all: Vec<_> = cases.par_iter().map(|case| compare(case, limits)).collect();
    let differ: Vec<_> =
        all.iter().enumerate().filter_map(|(i, one)| Some((i, one.as_ref().err()?))).collect();
    differ.iter().take(20).for_each(|(i, why)| println!("case {i}: {why}"));
    let found = all.iter().filter_map(|one| one.as_ref().ok()).fold(Compared::default(), |a, b| Compared {
        worst: a.worst.max(b.worst),
        counts: std::array::from_fn(|i| a.counts[i] + b.counts[i]),
        by_stage: std::array::from_fn(|i| a.by_stage[i] + b.by_stage[i]),
    });
    println!("{found:?} of {count} periods");
    assert!(differ.is_empty(), "{} differ", differ.len());
    assert!(found.counts[0] as f64 > limits.share * count);
    found
}

const SHAPES: [Shape; 12] = [
    Shape { harmonics: true, ..PLAIN },
    Shape { stages: true, ..PLAIN },
    Shape { harmonics: true, stages: true, ..PLAIN },
    Shape { walls: true, ..PLAIN },
    Shape { walls: true, stages: true, ..PLAIN },
    Shape { pushing: true, ..PLAIN },
    Shape { pushing: true, walls: true, stages: true, ..PLAIN },
    Shape { friction: true, ..PLAIN },
    Shape { friction: true, stages: true, ..PLAIN },
    Shape { friction: true, harmonics: true, walls: true, ..PLAIN },
    Shape { friction: true, walls: true, stages: true, ..PLAIN },
    Shape { friction: true, pushing: true, ..PLAIN },
];

fn models(seeds: std::ops::Range<u64>) -> Vec<Case> {
    seeds.map(|seed| one_gap::case(seed, SHAPES[seed as usize % SHAPES.len()])).collect()
}

#[test]
fn the_judge_agrees_with_matrix_exponentials() {
    check(models(0..60), ONE_GAP);
}

#[test]
#[ignore = "takes 15 s"]
fn the_judge_agrees_with_matrix_exponentials_on_1200_models() {
    let found = check(models(0..1200), ONE_GAP);
    // Changes of the stage release gaps at rest and end contact onsets.
    assert!(found.by_stage[0] > 10 && found.by_stage[1] > 0, "{:?}", found.by_stage);
}

#[test]
fn the_judge_agrees_with_matrix_exponentials_on_machines() {
    check((0..30).map(any_case).collect(), MACHINES);
    check((0..27).map(dependent_case).collect(), MACHINES);
}

#[test]
fn the_judge_agrees_with_matrix_exponentials_on_machines_with_curves() {
    check((0..30).map(bent_case).collect(), MACHINES);
}

#[test]
#[ignore = "takes a minute"]
fn the_judge_agrees_with_matrix_exponentials_on_600_machines_with_curves() {
    check((0..600).map(bent_case).collect(), MACHINES);
}

#[test]
#[ignore = "takes 15 s"]
fn the_judge_agrees_with_matrix_exponentials_on_200_machines() {
    let found = check((0..200).map(any_case).collect(), MACHINES);
    assert!(found.counts[2] > 100);
}
