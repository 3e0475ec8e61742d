//! Several walls on a side of the gap.

use crate::common::linear::{Linear, with_wall};
use crate::common::near;
use crate::common::pairs::described;
use crate::independent::random::{PLAIN, Shape, case};
use rattlemap_dynamics::model::{Contact, Law, Oscillator, OscillatorError, Side, Spring, Wall, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{EventKind, GapEvent, Trajectory};
use rattlemap_dynamics::orbit::{Class, EVENT_PERIODS, Settings, Status, analyse_flow};

/// Adds an elastic wall behind the outermost one of a side.
fn add(o: &mut Oscillator, side: Side, at: f64, stiffness: f64) {
    let walls = &mut o.gaps[0].walls[side.index()];
    let springs = vec![Spring { stiffness, damping: 0.0, preload: None }];
    walls.push(Wall { at, springs, ..walls[0].clone() });
}

/// A unit mass that moves freely between springs of stiffness 4 at 1 and -1.
fn one_stage(omega: f64) -> Oscillator {
    let free = Linear { gamma: 0.0, square: 0.0, force: 0.0, load: 0.0, omega }.oscillator();
    let wall = |o, side: Side| with_wall(o, side, side.sign(), Contact::Elastic, [4.0, 0.0]);
    described(&Side::BOTH.into_iter().fold(free, wall), Law::both(0.0, 0.0))
}

/// With more springs of 12 at 2 and -2.
fn two_stages(omega: f64) -> Oscillator {
    let mut o = one_stage(omega);
    Side::BOTH.into_iter().for_each(|side| add(&mut o, side, 2.0 * side.sign(), 12.0));
    o
}

/// From the middle with the speed `v`: straight to 1 in the time `1 / v`; to 2 on an arc of the frequency 2 around 1; to the
/// turning point on an arc of the frequency 4 around 1.75, where both springs balance.
#[test]
fn free_vibration_of_a_two_stage_spring_has_its_closed_form() {
    let v = 5.0f64;
    let second = (v * v - 4.0).sqrt();
    let quarter = 1.0 / v + (2.0 / v).asin() / 2.0 + (second / 4.0).atan2(0.25) / 4.0;
    let peak = 1.75 + 0.25f64.hypot(second / 4.0);
    let o = two_stages(std::f64::consts::TAU / (4.0 * quarter));
    let (flow, law) = (Flow::new(&o), Law::both(1.0, 0.0));
    let start = state(&[0.0, v]);
    let mut trajectory = Trajectory::<0>::new(&flow, law, start);
    let mut events: Vec<GapEvent> = Vec::new();
    for _ in 0..10 {
        trajectory.advance_period(&mut events).unwrap();
        let [x, w, ..] = trajectory.state();
        assert!(near(x, 0.0, 1e-13) && near(w, v, 1e-13), "{x} {w}");
    }
    assert_eq!(events.len(), 80);
    let sides = events[..8].iter().map(|event| (event.kind, event.side, event.before[0]));
    let expected = [Side::Right, Side::Left].into_iter().flat_map(|side| {
        [
            (EventKind::MeshStart, 1.0),
            (EventKind::MeshStart, 2.0),
            (EventKind::MeshEnd, 2.0),
            (EventKind::MeshEnd, 1.0),
        ]
        .map(|(kind, at)| (kind, side, side.sign() * at))
    });
    assert!(sides.eq(expected), "{events:?}");
    let in_contact = 1.0 - 1.0 / v / quarter;
    assert!(near(trajectory.meshing_time(), 40.0 * quarter * in_contact, 1e-12));
    let symbols: Vec<u8> = events[1..9].iter().filter_map(|event| event.symbol).collect();
    assert_eq!(symbols, b"11134446".map(|symbol| symbol));
    let orbit = analyse_flow(&flow, law, start, &Settings::default(), EVENT_PERIODS);
    let of = orbit.quantities.unwrap();
    assert!(near(of.displacements[0].amplitude, peak, 1e-12), "{of:?}");
    let force = 4.0 * (peak - 1.0) + 12.0 * (peak - 2.0);
    assert!(near(of.contact_force.unwrap()[0], force, 1e-11), "{of:?}");
}

/// In a cycle the force does as much work as dampers and impacts take.
#[test]
fn energy_balances_with_several_walls() {
    let shape = Shape { walls: true, ..PLAIN };
    let mut cycles = 0;
    for seed in 300..400 {
        let case = case(seed, shape);
        let (o, flow) = (&case.machine, Flow::new(&case.machine));
        let orbit = analyse_flow(&flow, o.law(), state(&case.start), &Settings::default(), EVENT_PERIODS);
        let (Class::Periodic { .. }, Status::Ok) = (orbit.class, orbit.status) else { continue };
        let of = orbit.quantities.unwrap();
        let power = |i: usize| {
            let [size, phase] = of.displacements[i].harmonic;
            let factors = [&o.drives[0].cos, &o.drives[0].sin].map(|force| 0.5 * o.omega * size * force[i]);
            [-factors[0] * phase.sin() - factors[1] * phase.cos(), factors[0].abs() + factors[1].abs()]
        };
        // Harmonics of small motion have the rounding error of the mean displacement.
        let [work, terms] = [0, 1].map(|part| (0..o.degrees()).map(|i| power(i)[part]).sum::<f64>());
        let taken = of.dissipated + of.impact_energy;
        assert!(near(work, taken, 1e-10 * taken + 1e-12 * terms), "{seed}: {work} {taken} {terms}");
        cycles += usize::from(o.needs_machine().is_some());
    }
    assert!(cycles > 60, "{cycles}");
}

/// A wall with a spring of stiffness 0 adds events but does not change the motion.
#[test]
fn a_wall_without_a_spring_changes_no_motion() {
    for at in [1.2, 1.7, 2.5] {
        let mut o = one_stage(2.0);
        o.drives[0].cos[0] = 6.0;
        o.stages[0].damping[(0, 0)] = 0.3;
        let plain = Flow::new(&o);
        add(&mut o, Side::Right, at, 0.0);
        let more = Flow::new(&o);
        let start = state(&[0.2]);
        let [mut a, mut b] =
            [&plain, &more].map(|flow| Trajectory::<0>::new(flow, Law::both(0.0, 0.0), start));
        let mut events = [Vec::<GapEvent>::new(), Vec::new()];
        for _ in 0..20 {
            a.advance_period(&mut events[0]).unwrap();
            b.advance_period(&mut events[1]).unwrap();
        }
        assert!(
            a.state().iter().zip(b.state()).all(|(a, b)| near(*a, b, 1e-12)),
            "{:?} {:?}",
            a.state(),
            b.state()
        );
        assert!(near(a.meshing_time(), b.meshing_time(), 1e-12));
        assert!(events[1].len() > events[0].len(), "the motion does not reach {at}");
    }
}

#[test]
fn walls_in_a_wrong_order_are_refused() {
    let message = |change: &dyn Fn(&mut [Vec<Wall>; 2])| {
        let mut o = two_stages(1.0);
        change(&mut o.gaps[0].walls);
        o.validate().err().as_ref().map(OscillatorError::to_string).unwrap_or_default()
    };
    assert_eq!(message(&|_| ()), "");
    let near = message(&|walls| walls[0][1].at = 0.5);
    assert!(near.starts_with("position of right wall 2 = 0.5: it must be farther out"), "{near}");
    let rigid = message(&|walls| walls[1][0].contact = Contact::Rigid);
    assert!(rigid.starts_with("left wall 1 = -1: it must be elastic"), "{rigid}");
    let many = message(&|walls| {
        (3..6).for_each(|at| walls[0].push(Wall { at: f64::from(at), ..walls[0][1].clone() }));
    });
    assert!(many.contains("at most 4"), "{many}");
}
