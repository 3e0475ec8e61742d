//! Compares the reference with an integrator by matrix exponentials that shares only the description of the oscillator with it, on
//! random models with harmonics and stages.

mod cycle;
mod motion;
mod random;

use std::time::{Duration, Instant};

use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Contact, Side, State};
use rattlemap_dynamics::orbit::{
    Budget, Class, EVENT_PERIODS, Measurement, Orbit, Status, analyse_flow, measure,
};
use rattlemap_dynamics::reference::{EventKind, GapEvent, Trajectory};
use rayon::prelude::*;

use crate::common::BUDGET;
use cycle::{Cycle, distance, follow, settle};
use motion::{Mode, Motion, System, What};
use random::{Case, Shape, case};

const PLAIN: Shape = Shape { harmonics: false, stages: false, wide: false };

/// Forcing periods from the start in which states and events are compared.
const FIRST: usize = 5;

/// Largest difference after these periods, relative to the size of the motion and the growth of tangents.
const FIRST_OFF: f64 = 1e-10;

/// Largest difference of the strobe states of a cycle, relative to the size of the motion.
const STROBE_OFF: f64 = 1e-10;

/// Largest difference of the moduli of largest multipliers.
const MULTIPLIER_OFF: f64 = 1e-7;

/// Largest difference of the share of time in contact.
const MESH_OFF: f64 = 1e-9;

/// Forcing periods after which a motion that is not near a cycle is not followed any more.
const MOST_PERIODS: usize = 200;

/// How the motions of a model agree.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Agreement {
    /// Both settle on the same cycle.
    Cycle,
    /// The reference's cycle is one, but the other motion does not settle on it: it is too slow, or rounding leads to another.
    OtherEnd,
    /// The reference finds no cycle.
    NoCycle,
}

#[derive(Clone, Debug)]
struct Compared {
    agreement: Agreement,
    /// Differences in the first periods, and of the cycle's states and multipliers.
    off: [f64; 3],
    /// [`Motion::by_stage`] in the first periods.
    by_stage: [usize; 2],
}

/// Compares states and events of the first periods. Returns the difference, and [`Motion::by_stage`].
fn first_periods(case: &Case, system: &System) -> Result<(f64, [usize; 2]), String> {
    let flow = Flow::new(&case.oscillator);
    let mut theirs = Trajectory::new(&flow, case.law, case.start);
    let mut ours = Motion::new(system, case.law, case.start, Mode::Free);
    ours.carry_tangents();
    let (mut events, mut worst) = (Vec::<GapEvent>::new(), 0.0f64);
    for _ in 0..FIRST {
        theirs.advance_period(&mut events).map_err(|stop| stop.to_string())?;
        ours.advance_period().ok_or("the exponentials do not end")?;
        let growth = ours.tangents.map_or(1.0, |tangents| tangents.amax().max(1.0));
        let off = distance(ours.state(), theirs.state(), case.oscillator.omega) / growth;
        if off.is_nan() || off > FIRST_OFF {
            return Err(format!("off by {off:e} at growth {growth:e}"));
        }
        worst = worst.max(off);
    }
    let of = |event: &GapEvent| match event.kind {
        EventKind::Impact => (What::Impact, event.side),
        EventKind::MeshStart => (What::Begins, event.side),
        EventKind::MeshEnd => (What::Ends, event.side),
    };
    let theirs: Vec<_> = events.iter().map(of).collect();
    if ours.events != theirs {
        return Err(format!("events {:?} but {theirs:?}", ours.events));
    }
    Ok((worst, ours.by_stage))
}

/// Returns the mode of the reference's cycle at phase 0.
fn mode_of(case: &Case, orbit: &Orbit) -> Mode {
    let Some(side) = orbit.strobe_meshing else { return Mode::Free };
    let (o, y) = (&case.oscillator, orbit.strobe);
    let (z, wall) = (o.gap[0] * y[0] + o.gap[1] * y[2], o.walls[side.index()]);
    let is_behind = if side == Side::Right { z > wall } else { z < wall };
    match o.contacts[side.index()] {
        Contact::Rigid => Mode::Stuck(side),
        _ if is_behind => Mode::Sustained(side),
        _ => Mode::Onset(side),
    }
}

/// Compares a cycle with the reference's. Returns the differences of states and multipliers.
fn same_cycle(case: &Case, ours: &Cycle, measured: &Measurement, orbit: &Orbit) -> Result<[f64; 2], String> {
    let apart = |state: State| distance(state, orbit.strobe, case.oscillator.omega);
    let at = ours.strobes.iter().map(|(state, _)| apart(*state)).fold(f64::INFINITY, f64::min);
    let radius =
        orbit.floquet.as_ref().and_then(|all| all.first()).map_or(f64::NAN, |[re, im]| re.hypot(*im));
    let radii = [radius, measured.multiplier.map_or(f64::NAN, |[modulus, _]| modulus)];
    let by = radii.map(|radius| (ours.radius - radius).abs()).into_iter().fold(0.0, f64::max);
    let period = ours.strobes.len() as u32;
    let impacts = ours.impacts as f64 / f64::from(period);
    let agree = [
        ("period", measured.period == Some(period) && orbit.class == Class::Periodic { period }),
        ("state", at < STROBE_OFF),
        ("multiplier", radii.iter().all(|radius| (ours.radius - radius).abs() < MULTIPLIER_OFF)),
        ("word", measured.word.as_ref() == Some(&ours.word) && orbit.word == ours.word),
        (
            "impacts",
            [measured.impacts_per_period, orbit.impacts_per_period]
                .iter()
                .all(|n| (n - impacts).abs() < 1e-12),
        ),
        (
            "meshing",
            [measured.mesh_fraction, orbit.mesh_fraction].iter().all(|n| (n - ours.meshes).abs() < MESH_OFF),
        ),
    ];
    match agree.iter().find(|(_, agrees)| !agrees) {
        None => Ok([at, by]),
        Some((what, _)) => Err(format!("{what}: {ours:?} at {at:e}, by {by:e}\n{measured:?}\n{orbit:?}")),
    }
}

fn compare(case: &Case) -> Result<Compared, String> {
    let (system, flow) = (System::new(&case.oscillator), Flow::new(&case.oscillator));
    let (first, by_stage) = first_periods(case, &system)?;
    let measured = measure(&flow, case.law, case.start, &BUDGET);
    let ours = settle(&system, case.law, case.start, MOST_PERIODS);
    let Some(period) = measured.period else {
        return match ours {
            None => Ok(Compared { agreement: Agreement::NoCycle, off: [first, 0.0, 0.0], by_stage }),
            Some(ours) => Err(format!("a cycle {ours:?}\n{measured:?}")),
        };
    };
    let orbit = analyse_flow(&flow, case.law, case.start, &BUDGET.settings, EVENT_PERIODS);
    if let Some([at, by]) = ours.as_ref().and_then(|ours| same_cycle(case, ours, &measured, &orbit).ok()) {
        return Ok(Compared { agreement: Agreement::Cycle, off: [first, at, by], by_stage });
    }
    let start = Motion::new(&system, case.law, orbit.strobe, mode_of(case, &orbit));
    let followed = follow(&start, period as usize).ok_or("the reference's cycle does not end")?;
    if followed.off > STROBE_OFF {
        return Err(format!("no cycle: {followed:?}\n{orbit:?}"));
    }
    let [at, by] = same_cycle(case, &followed, &measured, &orbit)?;
    Ok(Compared { agreement: Agreement::OtherEnd, off: [first, at, by], by_stage })
}

/// Compares 200 models. At least this share settles on the same cycle.
fn check(shape: Shape, share: f64) {
    let all: Vec<_> = (0..200u64).into_par_iter().map(|seed| (seed, compare(&case(seed, shape)))).collect();
    let mut failures = Vec::new();
    let (mut worst, mut by_stage, mut count) = ([0.0f64; 3], [0; 2], [0; 3]);
    for (seed, compared) in all {
        match compared {
            Ok(compared) => {
                worst = std::array::from_fn(|i| worst[i].max(compared.off[i]));
                by_stage = [0, 1].map(|i| by_stage[i] + compared.by_stage[i]);
                count[compared.agreement as usize] += 1;
            }
            Err(error) => failures.push(format!("{seed}: {error}\n{:?}", case(seed, shape))),
        }
    }
    println!(
        "{count:?} cycles, other ends, no cycles; off by {worst:?}; {by_stage:?} rests and onsets end by a stage"
    );
    assert!(failures.is_empty(), "{} fail:\n{}", failures.len(), failures.join("\n"));
    assert!(f64::from(count[0]) >= share * 200.0 && count[1] <= 10, "{count:?}");
    assert!(by_stage[0] > 20 && by_stage[1] > 2 || !shape.stages, "{by_stage:?}");
}

#[test]
fn plain_models_agree_with_matrix_exponentials() {
    check(PLAIN, 0.9);
}

/// Longest time for one model.
const LONGEST_TIME: Duration = Duration::from_secs(2);

/// Measures models of wide ranges. Every motion must end in time, with finite numbers.
fn check_ends(seeds: std::ops::Range<u64>) {
    let shape = Shape { harmonics: true, stages: true, wide: true };
    let ends: Vec<_> = seeds
        .into_par_iter()
        .map(|seed| {
            let case = case(seed, shape);
            let clock = Instant::now();
            let budget = Budget { undecided_periods: 0, ..BUDGET };
            let measured = measure(&Flow::new(&case.oscillator), case.law, case.start, &budget);
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
    let wrong: Vec<_> = ends.iter().filter(|end| !end.3).collect();
    assert!(wrong.is_empty(), "not finite: {wrong:?}");
    assert!(slowest.0 < LONGEST_TIME, "{slowest:?}");
    assert!(2 * of(Status::Ok) > ends.len(), "{statuses:?}");
}

#[test]
fn two_hundred_wide_models_end_with_finite_numbers() {
    check_ends(0..200);
}

#[test]
#[ignore = "minutes"]
fn ten_thousand_wide_models_end_with_finite_numbers() {
    check_ends(0..10_000);
}
