//! Compares both engines on oscillators of two coordinates, and tests mirror images of machines.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::machine::{MachineMotion, System};
use rattlemap_dynamics::model::{
    Contact, Drive, DryFriction, Forces, Form, GapRow, Law, Oscillator, REST, Restitution, Spring, Timing,
    Wall, state,
};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::orbit::{
    Class, EVENT_PERIODS, Orbit, Quantities, Settings, Status, analyse_flow, measure,
};
use rattlemap_dynamics::stability::UNIT;
use rayon::prelude::*;

use crate::common::BUDGET;
use crate::independent::random::{PLAIN, Shape, case};

/// Whether all measured quantities agree.
fn same_quantities(a: &Orbit, b: &Orbit) -> bool {
    let (Some(a), Some(b)) = (a.quantities, b.quantities) else { return false };
    let list = |q: &Quantities| {
        let approaches = q.approaches.iter().flat_map(|a| [a.count as f64, a.mean, a.largest]);
        let displacements = q.displacements.iter().flat_map(|d| [d.amplitude, d.mean, d.rms, d.harmonic[0]]);
        let friction = q.friction.map_or([0.0; 2], |friction| [friction.sticking, friction.dissipated]);
        let others = [q.impact_energy, q.dissipated].into_iter().chain(q.contact_force.unwrap_or_default());
        approaches.chain(displacements).chain(friction).chain(others).collect::<Vec<f64>>()
    };
    list(&a).iter().zip(list(&b)).all(|(a, b)| (a - b).abs() <= 1e-9 * (1.0 + a.abs()))
}

/// Both engines must give the same analysis of an oscillator.
#[test]
fn machines_have_the_classes_of_their_oscillators() {
    let of = |seed: u64| {
        let shape = Shape { stages: seed % 2 == 1, friction: seed.is_multiple_of(3), ..PLAIN };
        let case = case(seed, shape);
        let (law, start) = (case.machine.law(), state(&case.start));
        let [flow, whole] = [Form::from(&case.machine), Form::Machine(case.machine)].map(Flow::new);
        let settings = Settings { transient_periods: 200, observed_periods: 64, max_period: 16 };
        let [expected, found] =
            [&flow, &whole].map(|flow| analyse_flow(flow, law, start, &settings, EVENT_PERIODS));
        let measured = measure(&whole, law, start, &BUDGET);
        let Class::Periodic { period } = expected.class else {
            return (
                expected.class == found.class,
                format!("{seed}: {:?} {:?}", expected.class, found.class),
            );
        };
        if expected.status != Status::Ok || expected.lyapunov > -0.02 {
            return (true, format!("{seed}: {:?} {:?}", expected.status, found.status));
        }
        let radius = |orbit: &Orbit| {
            orbit.floquet.as_ref().map_or(f64::NAN, |all| all.first().map_or(0.0, |m| m[0].hypot(m[1])))
        };
        let agrees = found.class == expected.class
            && found.word == expected.word
            && measured.period == Some(period)
            && measured.word.as_ref() == Some(&expected.word)
            && found.symmetric == expected.symmetric
            && (radius(&found) - radius(&expected)).abs() < 1e-7
            && same_quantities(&found, &expected)
            && (found.mesh_fraction - expected.mesh_fraction).abs() < 1e-9
            && (found.impacts_per_period - expected.impacts_per_period).abs() < 1e-9;
        (agrees, format!("{seed}: {expected:?}\n{found:?}\n{measured:?}"))
    };
    let all: Vec<_> = (0..120).into_par_iter().map(of).collect();
    let others: Vec<_> = all.iter().filter(|(agrees, _)| !agrees).map(|(_, what)| what).collect();
    others.iter().take(5).for_each(|what| println!("{what}"));
    // With several attractors or slow transients, the engines may reach different attractors.
    assert!(others.len() <= 2, "{} of {} differ", others.len(), all.len());
}

/// The gear pair as a machine, with a stage that begins at phase 0.1 and recurs, mirrored, after half a period.
fn mirrored_pair(e: f64) -> Oscillator {
    let pair = crate::common::paper(e, 5.6);
    let mut machine = pair.oscillator().unwrap();
    let mut other = machine.stages[0].clone();
    machine.stages[0].load[0] = 0.1;
    other.load[0] = -0.1;
    machine.stages.push(other);
    machine.schedule = vec![(0.1, 1), (0.6, 0)];
    machine.gaps[0].walls.iter_mut().flatten().for_each(|wall| wall.springs.push(wall.springs[0]));
    machine.validate().unwrap();
    machine
}

/// A change of a machine.
type Change = fn(&mut Oscillator);

/// Changes that break the mirror symmetry.
const UNSYMMETRIC: [Change; 7] = [
    |machine| machine.stages[0].load[1] = 0.05,
    |machine| machine.stages[1].stiffness[(0, 0)] *= 1.1,
    |machine| machine.schedule[1].0 = 0.65,
    |machine| machine.gaps[0].walls[0][0].at *= 1.1,
    |machine| machine.gaps[0].walls[1][0].restitution = Restitution::Constant(0.7),
    |machine| {
        let second = Drive { order: 2, ..machine.drives[0].clone() };
        machine.drives.push(second);
    },
    |machine| {
        let row = DVector::from_vec(vec![1.0, 0.0]);
        machine.friction.push(DryFriction::new(row, 0.1, 0.2));
    },
];

#[test]
fn the_mirror_image_of_a_motion_is_a_motion_of_a_symmetric_machine() {
    let off = |machine: &Oscillator| {
        let [system, later] = [machine, &machine.at_phase(std::f64::consts::PI)].map(System::new);
        let y = [0.3, 1.0, 0.1, -2.0];
        let mut motion = MachineMotion::new(&system, &y);
        let mut image = MachineMotion::new(&later, &y.map(|x| -x));
        for motion in [&mut motion, &mut image] {
            motion.advance_period(&mut ()).unwrap();
        }
        assert!(motion.work().impacts > 0);
        motion.state().iter().zip(image.state()).map(|(a, b)| (a + b).abs()).fold(0.0, f64::max)
    };
    let machine = mirrored_pair(0.5);
    assert!(machine.mirror_symmetric() && off(&machine) < 1e-12, "{:e}", off(&machine));
    for (i, change) in UNSYMMETRIC.into_iter().enumerate() {
        let mut changed = machine.clone();
        change(&mut changed);
        assert!(!changed.mirror_symmetric() && off(&changed) > 1e-4, "{i}: {:e}", off(&changed));
    }
}

/// Cycles of the gear pair lose their symmetry in the pitchfork at e = 0.5419.
#[test]
fn a_cycle_of_a_machine_is_symmetric_up_to_the_pitchfork() {
    for (e, change, symmetric) in
        [(0.3, None, true), (0.541, None, true), (0.543, None, false), (0.3, Some(UNSYMMETRIC[4]), false)]
    {
        let pair = crate::common::paper(e, 5.6);
        let mut machine = pair.oscillator().unwrap();
        if let Some(change) = change {
            change(&mut machine);
        }
        let flow = Flow::new(Form::Machine(machine));
        let law = Law::both(0.0, 0.0);
        let orbit = analyse_flow(&flow, law, REST, &Settings::default(), EVENT_PERIODS);
        let measured = measure(&flow, law, REST, &BUDGET);
        assert_eq!((orbit.class, measured.period), (Class::Periodic { period: 1 }, Some(1)), "{e}");
        assert_eq!((orbit.symmetric, measured.symmetric), (Some(symmetric), Some(symmetric)), "{e}");
    }
}

/// Prints how much longer a period of the gear pair takes with the engine of machines.
#[test]
#[ignore = "a measurement: --release"]
fn time_of_a_period_as_a_machine() {
    for (e, omega) in [(0.06, 5.6), (0.605, 5.6), (0.72, 1.5), (0.9, 3.0)] {
        let pair = crate::common::paper(e, omega);
        let (oscillator, law) = (pair.oscillator().unwrap(), pair.law());
        let (flow, system) = (Flow::new(&oscillator), System::new(&oscillator));
        let mut times = [[f64::INFINITY; 2]; 2];
        for _ in 0..5 {
            for tangents in [false, true] {
                let mut theirs = MachineMotion::new(&system, &REST);
                if tangents {
                    theirs.set_tangents(MachineMotion::unit_tangents(&system)[..1].to_vec());
                }
                let begin = std::time::Instant::now();
                (0..2000).for_each(|_| theirs.advance_period(&mut ()).unwrap());
                let machine = begin.elapsed().as_secs_f64();
                let begin = std::time::Instant::now();
                if tangents {
                    let mut ours = Trajectory::with_tangents(&flow, law, REST, [UNIT[0]]);
                    (0..2000).for_each(|_| ours.advance_period(&mut ()).unwrap());
                } else {
                    let mut ours = Trajectory::<0>::new(&flow, law, REST);
                    (0..2000).for_each(|_| ours.advance_period(&mut ()).unwrap());
                }
                let tuned = begin.elapsed().as_secs_f64();
                let of = &mut times[usize::from(tangents)];
                (of[0], of[1]) = (of[0].min(machine), of[1].min(tuned));
            }
        }
        let [plain, tangent] = times.map(|[machine, tuned]| machine / tuned);
        let micros = times.map(|of| of.map(|seconds| seconds / 2000.0 * 1e6));
        println!(
            "{e} {omega}: {plain:.1} times, with a tangent {tangent:.1} times; microseconds {micros:.1?}"
        );
    }
}

/// Returns a bar of mass 1 on two shaken supports at the distance 1 from its middle.
fn bar(inertia: f64) -> Oscillator {
    let (vector, none) = (DVector::from_row_slice, DMatrix::zeros(2, 2));
    let support = || Wall {
        at: 0.0,
        contact: Contact::Rigid,
        restitution: Restitution::Constant(0.7),
        mesh_speed: 0.0,
        springs: vec![Spring::default()],
    };
    let end = |side: f64| GapRow { row: vector(&[1.0, side]), walls: [Vec::new(), vec![support()]] };
    Oscillator {
        omega: 20.0,
        timing: Timing::Forced,
        mass: DMatrix::from_diagonal(&vector(&[1.0, inertia])),
        stages: vec![Forces { damping: none.clone(), stiffness: none, load: vector(&[-9.81, 0.0]) }],
        schedule: Vec::new(),
        drives: vec![Drive { order: 1, cos: vector(&[2.0, 0.0]), sin: vector(&[0.0, 0.0]) }],
        gaps: [-1.0, 1.0].map(end).into(),
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
    }
}

/// A bar that falls flat has two impacts at once, and the order of its gaps decides which end rises. With an inertia of 1, an impact at one
/// end does not move the other end, and both orders give the same motion.
#[test]
fn a_bar_that_falls_flat_on_two_supports_says_so() {
    let law = Law::both(0.7, 0.0);
    let settings = Settings { observed_periods: 64, ..Settings::default() };
    for (inertia, tilt, tied) in [(1.0 / 3.0, 0.0, true), (1.0 / 3.0, 0.01, false), (1.0, 0.0, false)] {
        let (flow, start) = (Flow::new(Form::Machine(bar(inertia))), state(&[0.1, 0.0, tilt]));
        let orbit = analyse_flow(&flow, law, start, &settings, EVENT_PERIODS);
        let cell = measure(&flow, law, start, &BUDGET);
        let found = [orbit.status, cell.status].map(|status| status == Status::Simultaneous);
        assert_eq!(found, [tied; 2], "{inertia} {tilt}: {:?} {:?}", orbit.status, cell.status);
    }
}

/// A mass that a force drives against a light plate. Spring and damper connect the plate with another one, which dry friction holds.
fn plates(mass: f64) -> Oscillator {
    let vector = |entries: [f64; 3]| DVector::from_row_slice(&entries);
    let between = |x: f64| DMatrix::from_row_slice(3, 3, &[0.0, 0.0, 0.0, 0.0, x, -x, 0.0, -x, x]);
    let wall = Wall {
        at: 0.0,
        contact: Contact::Rigid,
        restitution: Restitution::Constant(0.0),
        mesh_speed: 0.0,
        springs: vec![Spring::default()],
    };
    Oscillator {
        omega: 1.0,
        mass: DMatrix::from_diagonal(&vector([1.0, mass, mass])),
        stages: vec![Forces {
            damping: between(0.2),
            stiffness: between(1.0),
            load: vector([0.2, 0.0, 0.0]),
        }],
        drives: vec![Drive { order: 1, cos: vector([0.3, 0.0, 0.0]), sin: vector([0.0; 3]) }],
        gaps: vec![GapRow { row: vector([1.0, -1.0, 0.0]), walls: [vec![wall], vec![]] }],
        friction: vec![DryFriction::new(vector([0.0, 0.0, 1.0]), 1.0, 0.0)],
        ..bar(1.0)
    }
}

/// The motion of light plates tends to a limit, with errors proportional to their mass. They take no more steps than heavy ones.
#[test]
fn light_bodies_take_no_more_steps() {
    let run = |mass: f64| {
        let system = System::new(&plates(mass));
        let mut motion = MachineMotion::new(&system, &REST);
        motion.set_tangents(MachineMotion::unit_tangents(&system)[..2].to_vec());
        (0..100).for_each(|_| motion.advance_period(&mut ()).unwrap());
        (motion.state(), motion.derivative(), motion.work().steps)
    };
    let [(a, of_a, steps), (b, of_b, more), (c, of_c, most)] = [1e-4, 1e-5, 1e-6].map(run);
    println!("steps {steps}, {more}, {most}");
    assert!(steps < 6_000 && more <= steps && most <= more, "{steps}, {more}, {most}");
    for i in [1, 2, 4] {
        let ratio = (a[i] - b[i]) / (b[i] - c[i]);
        assert!((ratio - 10.0).abs() < 0.1, "{ratio}");
    }
    let size = of_c.amax();
    assert!((of_b.clone() - &of_c).amax() < 0.11 * (of_a - of_b).amax() + 1e-9 * size);
}
