//! Nonlinear springs, walls with a force law, and friction that is not constant: energy balance, contact forces, rest at a border of two
//! pieces, and forces that only touch the limit of friction at rest.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::machine::{MachineMotion, System as Program};
use rattlemap_dynamics::model::{
    Contact, Drive, DryFriction, Forces, Form, GapRow, NonlinearSpring, Oscillator, Restitution, Side,
    Spring, Timing, Wall, state,
};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, EVENT_PERIODS, Orbit, Status, analyse_flow, place_of_displacement};
use rayon::prelude::*;

use super::random::{Case, bent_case};
use crate::common::BUDGET;

fn orbit(machine: &Oscillator, start: &[f64]) -> Orbit {
    let flow = Flow::new(Form::Machine(machine.clone()));
    analyse_flow(&flow, machine.law(), state(start), &BUDGET.settings, EVENT_PERIODS)
}

/// Returns the power of the force and the sum of all terms that take it, of a cycle with one harmonic and no belt.
fn balance(machine: &Oscillator, start: &[f64]) -> Option<([f64; 2], [bool; 4])> {
    let orbit = orbit(machine, start);
    let (Class::Periodic { .. }, Some(of)) = (orbit.class, orbit.quantities) else { return None };
    let drive = machine.drives.first()?;
    // x = size cos(omega t + phase) under the force cos cos(omega t) + sin sin(omega t).
    let power = |i: usize| {
        let [size, phase] = of.displacements[place_of_displacement(i)].harmonic;
        let (sin, cos) = phase.sin_cos();
        -0.5 * machine.omega * size * (drive.cos[i] * sin + drive.sin[i] * cos)
    };
    let power: f64 = (0..machine.degrees()).map(power).sum();
    let heat = of.friction.map_or(0.0, |friction| friction.dissipated);
    let taken = [of.dissipated, heat, of.impact_energy, of.release_energy.unwrap_or(0.0)];
    let size = taken.iter().map(|x| x.abs()).fold(power.abs(), f64::max);
    let off = (power - taken.iter().sum::<f64>()).abs();
    Some(([off, size], taken.map(|part| part.abs() > 1e-3 * size)))
}

fn check_balance(seeds: std::ops::Range<u64>) {
    let count = seeds.clone().count();
    let of = |seed: u64| {
        let Case { mut machine, start } = bent_case(seed);
        machine.drives.retain(|drive| drive.order == 1);
        machine.friction.iter_mut().for_each(|friction| friction.speed = 0.0);
        // Changes of the stage do work.
        (machine.stages.len() == 1).then(|| Some((seed, balance(&machine, &start)?))).flatten()
    };
    let all: Vec<_> = seeds.into_par_iter().filter_map(of).collect();
    let wrong: Vec<_> = all.iter().filter(|(_, ([off, size], _))| *off > 1e-9 * size + 1e-14).collect();
    let has = [0, 1, 2, 3].map(|i| all.iter().filter(|one| one.1.1[i]).count());
    println!("{} of {count} balances, with each part: {has:?}", all.len());
    assert!(wrong.is_empty(), "{wrong:?}");
    assert!(has.iter().all(|has| 40 * has > all.len()), "{has:?}");
}

#[test]
fn the_work_of_the_force_is_what_curves_take() {
    check_balance(0..60);
}

#[test]
#[ignore = "takes a minute"]
fn the_work_of_the_force_is_what_curves_of_a_thousand_machines_take() {
    check_balance(0..1_000);
}

/// Returns a unit mass under a force with the phase 0, with a damper and without a linear spring.
fn mass(damping: f64, omega: f64, force: f64, walls: [Vec<Wall>; 2]) -> Oscillator {
    let one = |x: f64| DVector::from_element(1, x);
    let square = |x: f64| DMatrix::from_element(1, 1, x);
    Oscillator {
        omega,
        mass: square(1.0),
        stages: vec![Forces { damping: square(damping), stiffness: square(1.0), load: one(0.0) }],
        schedule: Vec::new(),
        drives: vec![Drive { order: 1, cos: one(force), sin: one(0.0) }],
        gaps: vec![GapRow { row: one(1.0), walls }],
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}

fn wall(at: f64, contact: Contact, damping: f64) -> Wall {
    let springs = vec![Spring { stiffness: 0.0, damping, preload: None }];
    Wall { at, contact, restitution: Restitution::Constant(0.5), mesh_speed: 0.0, springs }
}

/// The largest contact force of a curve is that of dense samples, on either side, and a motion beyond the points says so.
#[test]
fn contact_forces_of_curves_are_those_of_samples() {
    let depths = [[0.0, 0.0], [0.02, 0.5], [0.05, 2.5], [0.2, 30.0]];
    let force = |depth: f64| {
        let i = (1..3).find(|&i| depth < depths[i][0]).unwrap_or(3);
        let [[from, low], [to, high]] = [depths[i - 1], depths[i]];
        low + (high - low) * (depth - from) / (to - from)
    };
    for (side, damping, contact, amplitude) in [
        (Side::Right, 0.0, Contact::Elastic, 0.5),
        (Side::Right, 1.5, Contact::Pushing, 0.5),
        (Side::Left, 0.7, Contact::Elastic, 0.4),
        (Side::Left, 1.5, Contact::Pushing, 9.0),
    ] {
        let at = 0.1 * side.sign();
        let mut walls = [Vec::new(), Vec::new()];
        walls[side.index()] = vec![wall(at, contact, damping)];
        let mut machine = mass(0.1, 2.1, amplitude, walls);
        machine.springs = vec![NonlinearSpring {
            row: DVector::from_element(1, side.sign()),
            points: depths.map(|[depth, force]| [0.1 + depth, force]).to_vec(),
            wall: Some((0, side)),
        }];
        let orbit = orbit(&machine, &[0.0, 0.0]);
        let (Class::Periodic { period }, Some(of)) = (orbit.class, orbit.quantities) else {
            panic!("{orbit:?}")
        };
        let (program, samples) = (Program::new(&machine), 20_000);
        let mut motion = MachineMotion::new(&program, &orbit.strobe);
        let (mut most, mut deepest, mut square, mut count) = (f64::NEG_INFINITY, 0.0f64, 0.0, 0);
        for i in 0..period as usize * samples {
            motion.advance_to(machine.period() * (i % samples) as f64 / samples as f64, &mut ()).unwrap();
            let [x, v, ..] = motion.state();
            if motion.contact(0).is_some() {
                let depth = side.sign() * (x - at);
                let push = force(depth) + damping * side.sign() * v;
                (most, deepest, square, count) =
                    (most.max(push), deepest.max(depth), square + push * push, count + 1);
            }
            if i % samples == samples - 1 {
                motion.advance_period(&mut ()).unwrap();
            }
        }
        let rms = (square / f64::from(count)).sqrt();
        let [largest, mean] = of.contact_force.expect("a compliant contact");
        println!("{side:?} {contact:?}: {largest} {most}, {mean} {rms}, depth {deepest}");
        assert!((-1e-12..1e-2 * largest).contains(&(largest - most)), "{largest} {most}");
        assert!((mean - rms).abs() < 5e-3 * rms, "{mean} {rms}");
        assert_eq!(orbit.status == Status::OutOfRange, deepest > 0.2, "{:?} {deepest}", orbit.status);
    }
}

/// A mass that comes to rest where two pieces of its spring meet has a cycle of period 1.
#[test]
fn a_mass_at_rest_at_a_border_of_pieces_is_periodic() {
    let mut machine = mass(0.4, 1.3, 0.0, [vec![wall(3.0, Contact::Impact, 0.0)], Vec::new()]);
    machine.springs = vec![NonlinearSpring {
        row: DVector::from_element(1, 1.0),
        points: vec![[-1.0, -2.0], [0.0, 0.0], [1.0, 0.7]],
        wall: None,
    }];
    let orbit = orbit(&machine, &[0.3, 0.0]);
    assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok));
}

/// A force as large as friction at rest moves nothing, but the linearisation is not valid if friction falls when sliding begins.
#[test]
fn a_force_that_touches_the_limit_of_friction_at_rest_is_near_grazing() {
    for (limit, sliding, expected) in [(0.5, 0.5, false), (0.5, 0.3, true), (0.51, 0.3, false)] {
        let mut machine = mass(0.1, 0.9, 0.5, Default::default());
        let row = DVector::from_element(1, 1.0);
        machine.friction = vec![DryFriction { static_force: limit, ..DryFriction::new(row, sliding, 0.0) }];
        let program = Program::new(&machine);
        let mut motion = MachineMotion::new(&program, &[0.0, 0.0]);
        motion.advance_period(&mut ()).unwrap();
        assert_eq!((motion.state()[..2].to_vec(), motion.near_grazing()), (vec![0.0; 2], expected));
    }
}
