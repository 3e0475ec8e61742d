//! Dry friction in motions by matrix exponentials: closed forms, energy and limits.

use nalgebra::{DVector, Matrix2, Vector2};
use rattlemap_dynamics::model::{Contact, Law, Oscillator, Side};
use std::f64::consts::PI;

use super::cycle::settle;
use super::motion::{Mode, Motion, What};
use super::random::{Case, apart};
use super::system::{ANGLE, Grip, System};
use crate::common::linear::Linear;
use crate::common::pairs::{Friction, Rubbing};
use crate::independent::random::{PLAIN, Shape, case};

const SHAPE: Shape = Shape { friction: true, ..PLAIN };

/// Returns a mass of 1 on a spring without a damper and on a floor with friction.
fn block(square: f64, force: f64, omega: f64, friction: f64, speed: f64) -> Rubbing {
    let friction = vec![Friction { row: [1.0, 0.0], force: friction, speed }];
    Rubbing { pair: Linear { gamma: 0.0, square, force, load: 0.0, omega }.oscillator(), friction }
}

/// Returns the system of an oscillator with plastic impacts.
fn system(o: &Rubbing) -> System {
    System::new(&o.described(Law::both(0.0, 0.0)), ANGLE)
}

/// Returns what happened at walls.
fn events(motion: &Motion) -> Vec<(What, Side)> {
    motion.events.iter().map(|event| (event.what, event.side)).collect()
}

/// Den Hartog 1931: with `r = omega / omega_n`, `a = P / k`, `f = F / k`, a turn at `x_m` and phase `phi` of the force,
///
/// ```text
/// x = -f cos(omega_n t) - f U r sin(omega_n t) + V a cos(omega t + phi) + f,   0 < omega t < pi
/// V = 1 / (1 - r^2),   U = sin(pi / r) / (r (1 + cos(pi / r))),   V a sin(phi) = -f U,   x_m = V a cos(phi)
/// ```
///
/// and the other half of the period mirrors this one. A turn multiplies changes of the velocity by the ratio of the accelerations
/// after and before it.
#[test]
fn motion_without_stops_is_that_of_den_hartog() {
    let (square, force, friction) = (2.3f64, 1.7, 0.31);
    let (own, a, f) = (square.sqrt(), force / square, friction / square);
    for r in [0.6, 0.75, 0.9, 1.1, 1.4, 2.0, 3.1] {
        let (omega, v) = (r * own, 1.0 / (1.0 - r * r));
        let u = (PI / r).sin() / (r * (1.0 + (PI / r).cos()));
        let turn = ((v * a).powi(2) - (f * u).powi(2)).sqrt();
        let phase = (-f * u / (v * a)).atan2(turn / (v * a));
        let x = |t: f64| {
            let ((s, c), (sin, cos)) = ((own * t).sin_cos(), (omega * t + phase).sin_cos());
            let x = -f * c - f * u * r * s + v * a * cos + f;
            [x, own * f * s - own * f * u * r * c - omega * v * a * sin]
        };
        assert!((1..100).all(|i| x(PI / omega * f64::from(i) / 100.0)[1] < 0.0), "r = {r} has stops");
        // The force has phase 0 at the time `-phase / omega`.
        let halves = (-phase / PI).rem_euclid(2.0);
        let sign = if halves < 1.0 { 1.0 } else { -1.0 };
        let expected = x(halves.fract() * PI / omega).map(|x| sign * x);
        let system = system(&block(square, force, omega, friction, 0.0));
        let cycle = settle(&system, &[0.5, 0.1], 1000).unwrap();
        let off = apart(&cycle.strobes[0].0, &expected, omega);
        let before = square * turn + friction - force * phase.cos();
        let (sin, cos) = (PI / r).sin_cos();
        let ratio = (before - 2.0 * friction) / before;
        let half = Matrix2::new(cos, sin, -ratio * sin, ratio * cos);
        let radius = half.complex_eigenvalues().map(|m| m.norm_sqr()).max();
        assert!(off < 1e-13, "r = {r}: off by {off:e}");
        assert!((cycle.radius - radius).abs() < 1e-12, "{} but {radius}", cycle.radius);
        assert_eq!((cycle.word.unwrap().time_order().as_str(), cycle.strobes.len()), ("00", 1));
    }
}

/// The centres of half swings are `f` away from the middle. The mass stops for ever where the spring is weaker than friction.
#[test]
fn swings_shorten_by_twice_the_friction_over_the_stiffness() {
    let (square, friction) = (4.0, 0.52);
    let f = friction / square;
    let system = system(&block(square, 0.0, 1.0, friction, 0.0));
    for (x, v) in [(1.0f64, 0.0f64), (-0.9, 0.0), (0.1, 0.0), (0.0, 3.0), (0.3, -2.0)] {
        // The first turn is at the end of an arc about the first middle.
        let middle = -f * if v == 0.0 { -x.signum() } else { v.signum() };
        let mut turn = if v == 0.0 { x } else { middle + v.signum() * (x - middle).hypot(v / square.sqrt()) };
        let (mut length, mut turns) = ((turn - x).abs(), 0u32);
        while turn.abs() > f {
            let next = 2.0 * f * turn.signum() - turn;
            length += (next - turn).abs();
            (turn, turns) = (next, turns + 1);
        }
        let reversals = (if v == 0.0 { turns.max(1) - 1 } else { turns }) as usize;
        let mut motion = Motion::new(&system, &[x, v]);
        let swing = if v == 0.0 { f64::from(turns) * PI / square.sqrt() } else { 20.0 };
        motion.run(swing + 1e-6).unwrap();
        assert_eq!((motion.grips[0], motion.symbols.len()), (Grip::Stick, reversals));
        assert!(motion.symbols.iter().all(|symbol| *symbol == b'0'));
        let [at, rate] = motion.state()[..] else { panic!() };
        assert!((at - turn).abs() < 1e-14 && rate == 0.0, "{at} but {turn}; {rate}");
        assert!((motion.slid[0] - length).abs() < 1e-13, "{} but {length}", motion.slid[0]);
        motion.run(40.0).unwrap();
        assert_eq!(motion.state()[0], at);
    }
}

#[test]
fn a_belt_carries_a_block_until_the_spring_is_stronger() {
    let (square, friction, speed) = (4.0f64, 0.6, 0.25);
    let (own, f) = (square.sqrt(), friction / square);
    let system = system(&block(square, 0.0, 0.1, friction, speed));
    let mut motion = Motion::new(&system, &[0.0, speed]);
    let slip = f / speed;
    for i in 1..40 {
        let t = 0.09 * f64::from(i);
        motion.run(t).unwrap();
        let (sin, cos) = (own * (t - slip)).sin_cos();
        let (grip, x, v) = match t < slip {
            true => (Grip::Stick, speed * t, speed),
            false => (Grip::Minus, f + speed / own * sin, speed * cos),
        };
        let [at, rate] = motion.state()[..] else { panic!() };
        assert_eq!(
            (motion.grips[0], motion.symbols.as_slice()),
            (grip, if t < slip { &b""[..] } else { b"7" })
        );
        assert!((at - x).abs() < 1e-14 && (rate - v).abs() < 1e-14, "{t}: {at}, {rate} but {x}, {v}");
    }
}

/// A rigid wall releases a gap when the force vanishes. Friction releases it when the force reaches the friction force.
#[test]
fn friction_holds_a_gap_on_a_rigid_wall() {
    let omega = 1.3;
    for (friction, slips) in [(0.4f64, true), (1.1, false)] {
        let mut o = block(1e-9, 1.0, omega, friction, 0.0);
        (o.walls[0], o.contacts[0]) = (0.0, Contact::Rigid);
        let system = system(&o);
        let mut motion = Motion::new(&system, &[-1e-3, 0.2]);
        motion.run(0.5 * PI / omega - 1e-6).unwrap();
        assert_eq!((motion.modes()[0], motion.grips[0]), (Mode::Stuck(Side::Right), Grip::Stick));
        motion.run(0.5 * PI / omega + 1e-6).unwrap();
        let rest = (Mode::Plain, Grip::Stick, vec![(What::Begins, Side::Right), (What::Ends, Side::Right)]);
        assert_eq!((motion.modes()[0], motion.grips[0], events(&motion)), rest);
        let slip = if slips { (-friction).acos() / omega } else { 1.5 * PI / omega };
        motion.run(slip - 1e-9).unwrap();
        assert_eq!((motion.grips[0], motion.symbols.as_slice()), (Grip::Stick, &b"1"[..]));
        motion.run(slip + 1e-9).unwrap();
        let slid = if slips { (Grip::Minus, &b"17"[..]) } else { (Grip::Stick, &b"1"[..]) };
        assert_eq!((motion.grips[0], motion.symbols.as_slice()), slid);
    }
}

/// A force of -0.16 does not press a gap that a wall has stopped, and friction holds it. When the force is 0.4, the wall takes over.
#[test]
fn a_wall_takes_over_from_friction() {
    for contact in [Contact::Rigid, Contact::Impact] {
        let mut o = block(1e-9, 1.0, 1.0, 0.4, 0.0);
        (o.walls[0], o.contacts[0]) = (0.0, contact);
        o.meshing[0].stiffness[0][0] = 100.0;
        let system = system(&Rubbing { pair: o.pair.at_phase(1.45 * PI), friction: o.friction.clone() });
        let mut motion = Motion::new(&system, &[-1e-3, 0.2]);
        let takeover = 0.55 * PI - 0.4f64.acos();
        motion.run(takeover - 1e-9).unwrap();
        assert_eq!((motion.modes()[0], motion.grips[0]), (Mode::Plain, Grip::Stick));
        assert_eq!((events(&motion), motion.symbols.len()), (vec![(What::Impact, Side::Right)], 0));
        motion.run(takeover + 1e-9).unwrap();
        // A gap at rest on a rigid wall has not slid.
        let expected = match contact {
            Contact::Rigid => (Mode::Stuck(Side::Right), 0, Grip::Stick, &b"2"[..]),
            _ => (Mode::Plain, 1, Grip::Plus, &b"72"[..]),
        };
        let found = (motion.modes()[0], motion.acting(0), motion.grips[0], motion.symbols.as_slice());
        assert_eq!(found, expected);
    }
}

/// Returns displacements and velocities of a state.
fn parts(y: &[f64]) -> [DVector<f64>; 2] {
    [0, 1].map(|part| DVector::from_iterator(y.len() / 2, y.iter().skip(part).step_by(2).copied()))
}

/// Returns the energy of free motion without dampers.
fn energy(o: &Oscillator, y: &[f64]) -> f64 {
    let [x, v] = parts(y);
    0.5 * (v.dot(&(&o.mass * &v)) + x.dot(&(&o.stages[0].stiffness * &x)))
}

/// Checks directions of sliding, and that the forces which hold sticking elements do not exceed friction.
fn check_grips(o: &Oscillator, motion: &Motion) {
    let (per_mass, [x, v]) = (o.mass.clone().try_inverse().unwrap(), parts(&motion.state()));
    let mut forces = -&o.stages[0].stiffness * x;
    let rows: Vec<_> = o.friction.iter().map(|friction| &friction.row).collect();
    let mut stick = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        match motion.grips[i] {
            Grip::Stick => stick.push(i),
            grip => {
                let sign = if grip == Grip::Plus { 1.0 } else { -1.0 };
                assert!(sign * row.dot(&v) > -1e-13, "{grip:?} {}", row.dot(&v));
                forces -= *row * (sign * o.friction[i].force);
            }
        }
    }
    let Some(&first) = stick.first() else { return };
    let pulls = |i: usize| rows[i].dot(&(&per_mass * &forces));
    let impulse = |i: usize, j: usize| rows[i].dot(&(&per_mass * rows[j]));
    let hold = match stick.get(1) {
        None => vec![pulls(first) / impulse(first, first)],
        Some(_) => {
            let impulses = Matrix2::new(impulse(0, 0), impulse(0, 1), impulse(1, 0), impulse(1, 1));
            let hold = impulses.try_inverse().unwrap() * Vector2::new(pulls(0), pulls(1));
            vec![hold[0], hold[1]]
        }
    };
    for (&i, hold) in stick.iter().zip(hold) {
        assert!(rows[i].dot(&v).abs() < 1e-13 && hold.abs() < o.friction[i].force * (1.0 + 1e-9), "{hold}");
    }
}

/// Multiplies all friction forces by a factor. No surface moves any more.
fn weaken(o: &mut Oscillator, factor: f64) {
    for friction in &mut o.friction {
        let force = factor * friction.force;
        (friction.force, friction.static_force, friction.speed) = (force, force, 0.0);
    }
}

#[test]
fn friction_does_the_work_that_is_lost() {
    let (mut slips, mut rests) = (0, 0);
    for seed in 0..400 {
        let Case { machine: mut o, start } = case(seed, SHAPE);
        o.gaps[0].walls = Default::default();
        o.drives.clear();
        o.stages[0].damping.fill(0.0);
        o.stages[0].load.fill(0.0);
        weaken(&mut o, 0.2);
        let (o, system) = (&o, System::new(&o, ANGLE));
        let mut motion = Motion::new(&system, &start);
        for i in 1..100 {
            motion.run(0.05 * f64::from(i)).unwrap();
            check_grips(o, &motion);
            let lost = energy(o, &start) - energy(o, &motion.state());
            let work: f64 = o.friction.iter().zip(&motion.slid).map(|(one, slid)| one.force * slid).sum();
            assert!((lost - work).abs() < 1e-12 * energy(o, &start), "{seed}: lost {lost}, work {work}");
        }
        if o.friction.len() == 2 {
            slips += motion.symbols.iter().filter(|symbol| **symbol == b'7').count();
            rests += usize::from(motion.grips == [Grip::Stick; 2]);
        }
    }
    println!("{slips} slips and {rests} rests with two elements");
    assert!(slips > 20 && rests > 5, "{slips}, {rests}");
}

/// Friction below 1e-12 of other forces is rounding for the integrator.
#[test]
fn small_friction_changes_little() {
    let mut worst = 0.0f64;
    for seed in 0..100 {
        let Case { mut machine, start } = case(seed, SHAPE);
        weaken(&mut machine, 1e-10);
        let without = Oscillator { friction: Vec::new(), ..machine.clone() };
        let omega = machine.omega;
        let ends = [machine, without].map(|machine| {
            let system = System::new(&machine, ANGLE);
            let mut motion = Motion::new(&system, &start);
            motion.advance_period().and_then(|()| motion.advance_period()).unwrap();
            (motion.state(), events(&motion))
        });
        worst = worst.max(apart(&ends[0].0, &ends[1].0, omega));
        assert_eq!(ends[0].1, ends[1].1, "{seed}");
    }
    println!("off by {worst:e}");
    assert!(worst < 3e-9, "{worst:e}");
}

/// Compares derivatives with differences of motions from neighbouring starts that slide.
#[test]
fn tangents_are_limits_of_differences() {
    let mut found = [0; 3];
    for seed in 0..300 {
        let case = case(seed, Shape { stages: seed % 2 == 0, harmonics: seed % 3 == 0, ..SHAPE });
        let system = System::new(&case.machine, ANGLE);
        let mut motion = Motion::new(&system, &case.start);
        (0..5).try_for_each(|_| motion.advance_period()).unwrap();
        let count = case.machine.friction.len();
        if motion.acting(0) != 0 || motion.is_at_rest() {
            continue;
        }
        motion.clear();
        motion.carry_tangents();
        let image = |mut motion: Motion, i: usize, h: f64| {
            let mut y = motion.state();
            y[i] += h;
            motion.set_state(&y);
            motion.advance_period().unwrap();
            (DVector::from_vec(motion.state()), motion.derivative(), motion.symbols)
        };
        let (_, exact, symbols) = image(motion.clone(), 0, 0.0);
        let size = exact.amax().max(1.0);
        for i in 0..case.start.len() {
            // A strongly curved motion needs small differences. A motion that amplifies rounding errors needs large ones.
            let off = |h: f64| {
                let [above, below] = [h, -h].map(|h| image(motion.clone(), i, h / size));
                let is_same = above.2 == symbols && below.2 == symbols;
                let change = (above.0 - below.0) * (size / (2.0 * h));
                is_same.then(|| (change - exact.column(i)).amax() / size)
            };
            let Some(off) = [1e-5, 1e-6, 1e-7].into_iter().filter_map(off).reduce(f64::min) else {
                found[2] += 1;
                continue;
            };
            assert!(off < 1e-5, "{seed}: {off:e}");
            found[0] += 1;
            found[1] += usize::from(count == 2 && symbols.contains(&b'7'));
        }
    }
    println!("{found:?}");
    assert!(found[0] > 500 && found[1] > 30 && found[2] < 10, "{found:?}");
}
