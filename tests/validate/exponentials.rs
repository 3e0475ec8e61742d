//! Compares the judge with an integrator by matrix exponentials, on random models with harmonics, stages, further walls and dry friction.

mod integrators;
mod machines;

use std::f64::consts::TAU;

use rayon::prelude::*;

use integrators::independent::motion::{ANGLE, Mode, Motion, System, What};
use integrators::independent::random::{Shape, case};
use rattlemap::validate::independent::machine::Flight;
use rattlemap_dynamics::motion::EventKind;

/// Forcing periods of a comparison.
const PERIODS: usize = 3;

/// Largest difference of states, relative to the size of the motion and the growth of tangents.
const AGREEMENT: f64 = 1e-9;

#[test]
fn the_judge_agrees_with_matrix_exponentials() {
    let plain =
        Shape { harmonics: false, stages: false, walls: false, pushing: false, friction: false, wide: false };
    let shapes = [
        Shape { harmonics: true, ..plain },
        Shape { stages: true, ..plain },
        Shape { harmonics: true, stages: true, ..plain },
        Shape { walls: true, ..plain },
        Shape { walls: true, stages: true, ..plain },
    ];
    let pushing =
        [Shape { pushing: true, ..plain }, Shape { pushing: true, walls: true, stages: true, ..plain }];
    let rough = Shape { friction: true, ..plain };
    let rough = [
        rough,
        Shape { stages: true, ..rough },
        Shape { harmonics: true, walls: true, ..rough },
        Shape { walls: true, stages: true, ..rough },
        Shape { pushing: true, ..rough },
    ];
    let plain = (0..500u64).map(|seed| (seed, shapes[seed as usize % shapes.len()]));
    let cases = plain
        .chain((500..700).map(|seed| (seed, pushing[seed as usize % pushing.len()])))
        .chain((700..1200).map(|seed| (seed, rough[seed as usize % rough.len()])));
    let off: Vec<(u64, f64, bool, [usize; 2])> = cases
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(|(seed, shape)| {
            let case = case(seed, shape);
            let (oscillator, system) = (&case.oscillator, System::new(&case.oscillator, ANGLE));
            let mut ours = Motion::new(&system, case.law, case.start, Mode::Free);
            let mut judge = Flight::new(&oscillator.described(case.law), &case.start);
            ours.carry_tangents();
            for _ in 0..PERIODS {
                ours.advance_period()?;
                judge.advance(0.0, TAU)?;
            }
            let theirs = judge.events.iter().map(|event| match event.kind {
                EventKind::Impact => (What::Impact, event.side),
                EventKind::MeshStart => (What::Begins, event.side),
                EventKind::MeshEnd => (What::Ends, event.side),
            });
            let of_friction = ours.symbols.iter().copied().filter(|symbol| matches!(symbol, b'0' | b'7'));
            let same = theirs.eq(ours.events.iter().copied())
                && judge.slips.iter().filter_map(|slip| slip.symbol).eq(of_friction);
            let (a, b) = (ours.state(), judge.state());
            let size = a.iter().fold(0.0f64, |size, x| size.max(x.abs()));
            let off = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size;
            // Rounding errors grow as tangents do.
            let growth = ours.tangents?.amax().max(1.0);
            Some((seed, off / growth, same, ours.by_stage))
        })
        .collect();
    let differ: Vec<_> = off.iter().filter(|(_, off, same, _)| !same || *off >= AGREEMENT).collect();
    // Changes of the stage release gaps at rest and end contact onsets.
    let by_stage = [0, 1].map(|i| off.iter().map(|(.., by_stage)| by_stage[i]).sum::<usize>());
    assert!(by_stage[0] > 10 && by_stage[1] > 0, "{by_stage:?}");
    assert!(off.len() > 1180 && differ.is_empty(), "{} {differ:?}", off.len());
}
