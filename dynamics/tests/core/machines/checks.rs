//! Checks of the integrator of machines: other steps, differences, energy, and motions that other programs compute.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{Contact, Oscillator, Side};
use rayon::prelude::*;

use super::build::{in_coordinates, side_by_side};
use super::motion::{Event, Motion, What};
use super::random::{Case, any_case, apart, bent_case};
use super::system::{ANGLE, System};
use crate::independent::random::{self as one_gap, PLAIN, Random, Shape};

/// Returns events without their times, gap by gap.
fn by_gap(events: &[Event], gaps: usize) -> Vec<Vec<(What, Side, Option<u8>)>> {
    let of = |gap| {
        events
            .iter()
            .filter(|event| event.gap == gap)
            .map(|event| (event.what, event.side, event.symbol))
            .collect()
    };
    (0..gaps).map(of).collect()
}

/// Motions are compared only if velocity errors of 1e-13 at events change the state by less than this, relative to the state.
const MOST_NOISE: f64 = 1e-11;

/// Largest difference of states with other steps or coordinates.
const STEPS_OFF: f64 = 3e-11;

/// Allowed effect of rounding errors, as a multiple of the effect of the known errors.
const NOISES: f64 = 20.0;

/// Compares motions with larger and smaller steps.
fn check_steps(seeds: std::ops::Range<u64>, case: impl Fn(u64) -> Case + Sync) {
    let run = |seed: u64| {
        let case = case(seed);
        let [system, other] = [ANGLE, 0.6 * ANGLE].map(|angle| System::new(&case.machine, angle));
        let mut motion = Motion::new(&system, &case.start);
        let mut shaken = motion.shaken();
        motion.carry_tangents();
        let mut same = Motion::new(&other, &case.start);
        same.carry_tangents();
        let rate = case.machine.omega;
        let (mut worst, mut worst_tangents, mut periods) = (0.0f64, 0.0f64, 0);
        for period in 0..4 {
            let ended = [motion.advance_period(), same.advance_period()];
            let ends = shaken.iter_mut().all(|one| one.advance_period().is_some());
            if ended[0].is_none() || !ends || motion.is_crowded {
                break;
            }
            let noise =
                shaken.iter().map(|one| apart(&one.state(), &motion.state(), rate)).fold(0.0, f64::max);
            if noise > MOST_NOISE {
                break;
            }
            let off = apart(&motion.state(), &same.state(), rate);
            let size = motion.derivative().amax().max(1e-6);
            let off_tangents = (motion.derivative() - same.derivative()).amax() / size;
            if off.is_nan() || off > STEPS_OFF + NOISES * noise || off_tangents > 1e-7 {
                return Err(format!(
                    "{seed}: off by {off:e}, tangents {off_tangents:e} of {size:e}, noise {noise:e}, period {period}\n{:?}\n{:?}",
                    motion.events, same.events
                ));
            }
            let gaps = case.machine.gaps.len();
            if by_gap(&motion.events, gaps) != by_gap(&same.events, gaps) {
                return Err(format!("{seed}: events {:?} but {:?}", motion.events, same.events));
            }
            (worst, worst_tangents, periods) =
                (worst.max(off), worst_tangents.max(off_tangents), periods + 1);
        }
        Ok((worst, worst_tangents, periods, motion.events.len(), motion.slips.len()))
    };
    let all: Vec<_> = seeds.into_par_iter().map(run).collect();
    let failures: Vec<_> = all.iter().filter_map(|one| one.as_ref().err()).collect();
    let found: Vec<_> = all.iter().filter_map(|one| one.as_ref().ok()).collect();
    let worst = found.iter().map(|one| one.0).fold(0.0, f64::max);
    let tangents = found.iter().map(|one| one.1).fold(0.0, f64::max);
    let periods: i32 = found.iter().map(|one| one.2).sum();
    let events: usize = found.iter().map(|one| one.3).sum();
    let slips: usize = found.iter().map(|one| one.4).sum();
    println!("{periods} periods, {events} events, {slips} slips, off by {worst:e}, tangents by {tangents:e}");
    for failure in &failures {
        println!("{failure}");
    }
    assert!(failures.is_empty(), "{}", failures.len());
}

/// Compares derivatives with differences of motions from neighbouring starts without contact onset, rest and sticking.
fn check_derivatives(seeds: std::ops::Range<u64>, case: impl Fn(u64) -> Case + Sync) {
    let run = |seed: u64| {
        let case = case(seed);
        let (system, n) = (System::new(&case.machine, ANGLE), case.machine.degrees());
        let mut motion = Motion::new(&system, &case.start);
        let mut found = [0; 3];
        if motion.advance_period().is_none() || motion.is_at_rest() {
            return Ok((found, 0.0));
        }
        motion.events.clear();
        motion.slips.clear();
        let image = |i: usize, h: f64| {
            let (mut moved, mut state) = (motion.clone(), motion.state());
            if h == 0.0 {
                moved.carry_tangents();
            }
            state[i] += h;
            moved.set_state(&state);
            moved.advance_period()?;
            let what = (
                by_gap(&moved.events, case.machine.gaps.len()),
                moved.slips.iter().map(|slip| slip.0).collect::<Vec<_>>(),
            );
            let derivative = (h == 0.0).then(|| moved.derivative());
            Some((DVector::from_vec(moved.state()), derivative, what))
        };
        let Some((_, Some(exact), what)) = image(0, 0.0) else { return Ok((found, 0.0)) };
        let (size, mut worst) = (exact.amax().max(1.0), 0.0f64);
        for i in 0..2 * n {
            // A strongly curved motion needs small differences. A motion that amplifies rounding errors needs large ones.
            let off = |h: f64| {
                let [above, below] = [image(i, h / size)?, image(i, -h / size)?];
                let is_same = above.2 == what && below.2 == what;
                let change = (above.0 - below.0) * (size / (2.0 * h));
                is_same.then(|| (change - exact.column(i)).amax() / size)
            };
            let mut best = None;
            for found in [1e-6, 1e-7, 3e-8, 1e-5].into_iter().filter_map(off) {
                best = Some(best.map_or(found, |best: f64| best.min(found)));
                if found < 1e-5 {
                    break;
                }
            }
            let Some(off) = best else {
                found[2] += 1;
                continue;
            };
            // In the last flights of a series of impacts, rounding of positions changes the state by up to 1e-10.
            let has_series = what.0.iter().any(|events| events.len() > 15);
            if has_series && off > 1e-5 {
                found[2] += 1;
                continue;
            }
            if off > 5e-5 {
                return Err(format!("{seed}: column {i} off by {off:e} of {size:e}: {what:?}"));
            }
            worst = worst.max(off);
            found[0] += 1;
            found[1] += usize::from(what.0.iter().flatten().count() > 0);
        }
        Ok((found, worst))
    };
    let all: Vec<_> = seeds.into_par_iter().map(run).collect();
    let failures: Vec<_> = all.iter().filter_map(|one| one.as_ref().err()).collect();
    let found: Vec<_> = all.iter().filter_map(|one| one.as_ref().ok()).collect();
    let sum = |i: usize| found.iter().map(|one| one.0[i]).sum::<usize>();
    println!("{} columns, {} with events, {} left out", sum(0), sum(1), sum(2));
    failures.iter().for_each(|failure| println!("{failure}"));
    assert!(failures.is_empty(), "{}", failures.len());
}

/// Energy of motion, of springs, and of springs behind walls in contact.
fn energy(machine: &Oscillator, motion: &Motion, state: &[f64]) -> f64 {
    let n = machine.degrees();
    let [x, v] = [0, 1].map(|at| DVector::from_fn(n, |i, _| state[2 * i + at]));
    let forces = &machine.stages[0];
    let mut energy =
        0.5 * (v.dot(&(&machine.mass * &v)) + x.dot(&(&forces.stiffness * &x))) - forces.load.dot(&x);
    for (i, gap) in machine.gaps.iter().enumerate() {
        let (z, acting) = (gap.row.dot(&x), motion.acting(i));
        let side = if acting > 0 { Side::Right } else { Side::Left };
        for wall in &gap.walls[side.index()][..usize::from(acting.unsigned_abs())] {
            let (spring, depth) = (&wall.springs[0], side.sign() * (z - wall.at));
            energy += 0.5 * spring.stiffness * depth * depth + spring.force_at_wall() * depth;
        }
    }
    energy
}

#[test]
fn energy_decreases_without_force() {
    let mut events = 0;
    for seed in 0..300 {
        let Case { mut machine, start } = any_case(seed);
        machine
            .drives
            .iter_mut()
            .for_each(|drive| (drive.cos, drive.sin) = (&drive.cos * 0.0, &drive.sin * 0.0));
        machine.schedule.clear();
        let damping = &machine.stages[0].damping;
        if (damping + damping.transpose()).symmetric_eigenvalues().min() < 0.0 {
            continue;
        }
        machine.friction.iter_mut().for_each(|friction| friction.speed = 0.0);
        for wall in machine.gaps.iter_mut().flat_map(|gap| gap.walls.iter_mut().flatten()) {
            if wall.contact == Contact::Pushing {
                wall.contact = Contact::Elastic;
            }
        }
        let system = System::new(&machine, ANGLE);
        let mut motion = Motion::new(&system, &start);
        let mut last = energy(&machine, &motion, &motion.state());
        let size = last.abs().max(1.0);
        for i in 1..60 {
            if motion.run(f64::from(i) * system.period / 20.0).is_none() {
                break;
            }
            let now = energy(&machine, &motion, &motion.state());
            assert!(now <= last + 1e-12 * size, "{seed}: energy {last} grows to {now}: {:?}", motion.events);
            last = now;
        }
        events += motion.events.len();
    }
    println!("{events} events");
    assert!(events > 500);
}

const SHAPES: [Shape; 5] = [
    PLAIN,
    Shape { harmonics: true, stages: true, ..PLAIN },
    Shape { walls: true, stages: true, pushing: true, ..PLAIN },
    Shape { friction: true, harmonics: true, ..PLAIN },
    Shape { friction: true, walls: true, stages: true, pushing: true, ..PLAIN },
];

/// The limit [`MOST_NOISE`] for machines side by side.
const MOST_PART_NOISE: f64 = 1e-9;

/// Compares the events of a gap in a joint motion, and the state of its part, with the motion of its machine alone. `noise` is the effect
/// of known errors.
fn same_as_alone(
    ours: &Motion,
    gap: usize,
    state: &[f64],
    alone: &Motion,
    noise: f64,
) -> Result<f64, String> {
    let off = apart(state, &alone.state(), alone.system.machine.omega);
    if off.is_nan() || off > 1e-10 + NOISES * noise {
        return Err(format!("off by {off:e} with noise {noise:e}"));
    }
    let of = |motion: &Motion, gap: usize| by_gap(&motion.events, gap + 1).swap_remove(gap);
    if of(ours, gap) != of(alone, 0) {
        return Err(format!("events {:?} but {:?}", of(ours, gap), alone.events));
    }
    Ok(off)
}

/// Two or three machines that do not touch each other, as one machine in other coordinates, move like each of them alone.
fn check_side_by_side(count: usize, seeds: std::ops::Range<u64>, periods: usize, share: f64) {
    let run = |seed: u64| {
        let shape = SHAPES[(seed % 5) as usize];
        let random = &mut Random(seed);
        let mut cases: Vec<Case> = (0..count as u64)
            .map(|i| one_gap::case(1000 * i + seed, Shape { stages: shape.stages && i == 0, ..shape }))
            .collect();
        let omega = cases[0].machine.omega;
        cases.iter_mut().for_each(|case| case.machine.omega = omega);
        let machines: Vec<_> = cases.iter().map(|case| case.machine.clone()).collect();
        let all = side_by_side(&machines);
        let n = all.degrees();
        let t = DMatrix::from_fn(n, n, |i, j| random.even(0.4) + if i == j { 1.0 } else { 0.0 });
        let system = System::new(&in_coordinates(&all, &t), ANGLE);
        let inverse = t.clone().try_inverse().expect("coordinates");
        let state: Vec<f64> = cases.iter().flat_map(|case| case.start.clone()).collect();
        let mut ours = Motion::new(&system, &moved(&inverse, &state));
        let systems: Vec<_> = machines.iter().map(|machine| System::new(machine, 0.6 * ANGLE)).collect();
        let mut alone: Vec<_> =
            cases.iter().zip(&systems).map(|(case, system)| Motion::new(system, &case.start)).collect();
        let mut shaken: Vec<_> = alone.iter().map(Motion::shaken).collect();
        let (mut worst, mut compared) = (0.0f64, 0);
        'periods: for period in 0..periods {
            ours.clear();
            let is_over = ours.advance_period().is_none();
            let state = moved(&t, &ours.state());
            let (mut slips, mut at) = (0, 0);
            for (i, motion) in alone.iter_mut().enumerate() {
                motion.clear();
                let Some(noise) = motion.advance_period().and_then(|()| motion.noise(&mut shaken[i])) else {
                    break 'periods;
                };
                if is_over || noise > MOST_PART_NOISE {
                    break 'periods;
                }
                let own = &state[at..at + cases[i].start.len()];
                at += own.len();
                let off = same_as_alone(&ours, i, own, motion, noise)
                    .map_err(|error| format!("{seed}: machine {i}, period {period}: {error}"))?;
                slips += motion.slips.len();
                worst = worst.max(off);
            }
            if slips != ours.slips.len() {
                return Err(format!("{seed}: {slips} slips but {:?} in period {period}", ours.slips));
            }
            compared += 1;
        }
        Ok((worst, compared))
    };
    let count = (seeds.end - seeds.start) as f64 * periods as f64;
    let all: Vec<_> = seeds.into_par_iter().map(run).collect();
    let failures: Vec<&String> = all.iter().filter_map(|one| one.as_ref().err()).collect();
    let worst = all.iter().filter_map(|one| one.as_ref().ok()).map(|one| one.0).fold(0.0, f64::max);
    let compared: usize = all.iter().filter_map(|one| one.as_ref().ok()).map(|one| one.1).sum();
    println!("{compared} of {count} periods, off by {worst:e}");
    failures.iter().for_each(|failure| println!("{failure}"));
    assert!(failures.is_empty() && compared as f64 > share * count, "{}", failures.len());
}

#[test]
fn two_machines_side_by_side_move_like_both() {
    check_side_by_side(2, 0..60, 4, 0.8);
}

#[test]
fn three_machines_side_by_side_move_like_all() {
    check_side_by_side(3, 0..30, 4, 0.7);
}

/// Applies a matrix to displacements and to velocities.
fn moved(m: &DMatrix<f64>, state: &[f64]) -> Vec<f64> {
    let of = |at: usize| m * DVector::from_fn(m.ncols(), |i, _| state[2 * i + at]);
    let (x, v) = (of(0), of(1));
    x.iter().zip(&v).flat_map(|(x, v)| [*x, *v]).collect()
}

/// The motion does not depend on the coordinates.
#[test]
fn other_coordinates_give_the_same_motion() {
    let run = |seed: u64| {
        let Case { machine, start } = any_case(seed);
        let n = machine.degrees();
        let random = &mut Random(seed);
        let t = DMatrix::from_fn(n, n, |i, j| random.even(0.8 / n as f64) + if i == j { 1.0 } else { 0.0 });
        let inverse = t.clone().try_inverse().expect("coordinates");
        let other = in_coordinates(&machine, &t);
        // Without two walls of one gap, the scale of length depends on the coordinates.
        if (machine.length_scale() - other.length_scale()).abs() > 1e-12 * machine.length_scale() {
            return Ok(0);
        }
        let systems = [&machine, &other].map(|machine| System::new(machine, ANGLE));
        let mut motion = Motion::new(&systems[0], &start);
        let mut same = Motion::new(&systems[1], &moved(&inverse, &start));
        let mut shaken = motion.shaken();
        let mut compared = 0;
        for period in 0..4 {
            let ends = shaken.iter_mut().all(|one| one.advance_period().is_some());
            if motion.advance_period().is_none() || !ends || motion.is_crowded {
                break;
            }
            let off_of = |state: &[f64]| apart(state, &motion.state(), machine.omega);
            let noise = shaken.iter().map(|one| off_of(&one.state())).fold(0.0, f64::max);
            if noise > MOST_NOISE {
                break;
            }
            if same.advance_period().is_none() {
                return Err(format!("{seed}: no end"));
            }
            let off = off_of(&moved(&t, &same.state()));
            let gaps = machine.gaps.len();
            if off.is_nan()
                || off > STEPS_OFF + NOISES * noise
                || by_gap(&motion.events, gaps) != by_gap(&same.events, gaps)
            {
                return Err(format!(
                    "{seed}: off by {off:e} with noise {noise:e} in period {period}: {:?} but {:?}",
                    motion.events, same.events
                ));
            }
            compared += 1;
        }
        Ok(compared)
    };
    let all: Vec<Result<i32, String>> = (0..200u64).into_par_iter().map(run).collect();
    let failures: Vec<_> = all.iter().filter_map(|one| one.as_ref().err()).collect();
    failures.iter().for_each(|failure| println!("{failure}"));
    let compared: i32 = all.iter().filter_map(|one| one.as_ref().ok()).sum();
    println!("{compared} periods");
    assert!(failures.is_empty() && compared > 400, "{}", failures.len());
}

#[test]
fn other_steps_give_the_same_motion() {
    check_steps(0..300, any_case);
    check_steps(0..100, bent_case);
}

#[test]
fn derivatives_are_limits_of_differences() {
    check_derivatives(0..200, any_case);
    check_derivatives(0..100, bent_case);
}

#[test]
#[ignore = "minutes"]
fn three_thousand_machines_pass_the_checks() {
    check_steps(300..3300, any_case);
    check_derivatives(200..1200, any_case);
    check_steps(100..1100, bent_case);
    check_derivatives(100..1100, bent_case);
    check_side_by_side(2, 60..360, 4, 0.8);
    check_side_by_side(3, 30..130, 4, 0.7);
}
