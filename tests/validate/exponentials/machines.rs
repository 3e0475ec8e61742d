//! Compares the judge of machines with an integrator by matrix exponentials, on random machines.

use rattlemap::validate::independent::machine::Flight;
use rattlemap_dynamics::model::{STATE, Side, state};
use rattlemap_dynamics::motion::EventKind;
use rayon::prelude::*;

use super::integrators::machines::motion::{Motion, What};
use super::integrators::machines::random::{any_case, apart};
use super::integrators::machines::system::{ANGLE, System};

/// Forcing periods of a comparison.
const PERIODS: usize = 6;

/// Largest difference of states, relative to the size of the motion.
const AGREEMENT: f64 = 1e-9;

/// Rounding errors may have this multiple of the effect of known errors.
const NOISES: f64 = 20.0;

/// Motions in which known errors have a larger effect are not compared further.
const MOST_NOISE: f64 = 1e-9;

type Happening = (EventKind, Side, Option<u8>);

/// What agrees: periods, events, and changes of friction.
#[derive(Debug, Default)]
struct Compared {
    worst: f64,
    counts: [usize; 3],
}

/// Compares the first periods of a motion. The order of events at one time has no meaning for two gaps, so events are compared gap by
/// gap.
fn compare(seed: u64) -> Result<Compared, String> {
    let case = any_case(seed);
    let (machine, gaps) = (&case.machine, case.machine.gaps.len());
    let [system, other] = [ANGLE, 0.6 * ANGLE].map(|angle| System::new(machine, angle));
    let start = |system| Motion::new(system, &case.start);
    let (mut ours, mut others) = (start(&system), vec![start(&other)]);
    others.extend(ours.shaken());
    let mut judge = Flight::new(machine, &state(&case.start));
    let mut found = Compared::default();
    for period in 0..PERIODS {
        ours.events.clear();
        ours.slips.clear();
        judge.events.clear();
        judge.slips.clear();
        let Some(()) = ours.advance_period() else { break };
        let mut noise = 0.0f64;
        let Some(()) = others.iter_mut().try_for_each(|other| {
            other.events.clear();
            other.advance_period()?;
            noise = noise.max(apart(&ours.state(), &other.state(), machine.omega));
            Some(())
        }) else {
            break;
        };
        if noise.is_nan() || noise > MOST_NOISE || ours.is_crowded {
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
            || off > AGREEMENT + NOISES * noise
            || judged[2 * machine.degrees()..STATE].iter().any(|x| *x != 0.0)
        {
            return Err(format!("period {period}: off by {off:e} with noise {noise:e}"));
        }
        found.worst = found.worst.max(off);
        let counts = [1, ours.events.len(), ours.slips.len()];
        (0..3).for_each(|i| found.counts[i] += counts[i]);
    }
    Ok(found)
}

#[test]
fn the_judge_of_machines_agrees_with_matrix_exponentials() {
    let seeds = 0..200u64;
    let count = seeds.end as f64 * PERIODS as f64;
    let all: Vec<_> = seeds.into_par_iter().map(|seed| (seed, compare(seed))).collect();
    let differ: Vec<_> = all.iter().filter_map(|(seed, found)| Some((seed, found.as_ref().err()?))).collect();
    differ.iter().take(20).for_each(|(seed, why)| println!("{seed}: {why}"));
    let found: Vec<_> = all.iter().filter_map(|(_, found)| found.as_ref().ok()).collect();
    let sum = |i: usize| found.iter().map(|found| found.counts[i]).sum::<usize>();
    let worst = found.iter().map(|found| found.worst).fold(0.0, f64::max);
    println!("{} periods of {count}, {} events, {} slips, off by {worst:e}", sum(0), sum(1), sum(2));
    assert!(differ.is_empty(), "{} differ", differ.len());
    assert!(sum(0) as f64 > 0.7 * count && sum(2) > 100);
}
