//! Motions in which a function of time is exactly zero for a while, or has a root of high order.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::machine::{MachineMotion, System};
use rattlemap_dynamics::model::{
    Contact, Drive, DryFriction, Forces, GapRow, Oscillator, Restitution, Spring, Timing, Wall,
    state as state_of,
};

fn wall(at: f64, contact: Contact, e: f64) -> Wall {
    let spring = Spring { stiffness: 10.0, damping: 0.0, preload: None };
    Wall { at, contact, restitution: Restitution::Constant(e), mesh_speed: 0.0, springs: vec![spring] }
}

/// Returns a machine of unit masses with a force on the first one.
fn machine(
    stiffness: DMatrix<f64>,
    omega: f64,
    force: [f64; 2],
    gap: &[f64],
    walls: [Vec<Wall>; 2],
) -> Oscillator {
    let n = stiffness.nrows();
    let at_first = |f: f64| DVector::from_fn(n, |i, _| if i == 0 { f } else { 0.0 });
    let [cos, sin] = force.map(at_first);
    Oscillator {
        omega,
        mass: DMatrix::identity(n, n),
        stages: vec![Forces { damping: DMatrix::zeros(n, n), stiffness, load: DVector::zeros(n) }],
        schedule: Vec::new(),
        drives: vec![Drive { order: 1, cos, sin }],
        gaps: vec![GapRow { row: DVector::from_row_slice(gap), walls }],
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}

fn after_a_period(machine: &Oscillator, start: &[f64]) -> Vec<f64> {
    let system = System::new(machine);
    let mut motion = MachineMotion::new(&system, start);
    motion.advance_period(&mut ()).expect("it can be continued");
    assert!(motion.work().events < 20 && motion.work().steps < 2_000, "{:?}", motion.work());
    motion.state()[..start.len()].to_vec()
}

fn chain(n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => 2.0,
        1 => -1.0,
        _ => 0.0,
    })
}

/// Two pendulums that collide without rebound move on together, with no force between them; a third one is elsewhere.
#[test]
fn pendulums_that_collide_without_rebound_move_on_together() {
    let omega = 1.37;
    let walls = [Vec::new(), vec![wall(0.0, Contact::Impact, 0.0)]];
    let machine = machine(DMatrix::identity(3, 3), omega, [0.0; 2], &[-1.0, 1.0, 0.0], walls);
    let state = after_a_period(&machine, &[-0.5, 1.0, 0.0, 0.0, 0.3, 0.0]);
    // The first pendulum hits the resting second one at x = 0 with its largest speed. Then both move at half this speed.
    let (speed, t) = (1.25f64.sqrt() / 2.0, std::f64::consts::TAU / omega - 0.5f64.atan());
    for (i, expected) in [speed * t.sin(), speed * t.cos()].into_iter().enumerate() {
        for body in [0, 1] {
            assert!((state[2 * body + i] - expected).abs() < 1e-13, "{state:?}, {expected}");
        }
    }
}

/// A force on one end of a chain reaches the other end through a derivative of high order: it lifts this end off its wall or presses it to
/// the wall.
#[test]
fn a_chain_at_rest_on_a_wall_starts_like_one_a_little_off_the_wall() {
    for n in 2..=8 {
        for contact in [Contact::Elastic, Contact::Impact, Contact::Rigid] {
            for side in [0, 1] {
                let row: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i + 1 == n))).collect();
                let mut after = [0.0, 1e-9].map(|off| {
                    let at = if side == 0 { off } else { -off };
                    let mut walls = [Vec::new(), Vec::new()];
                    walls[side] = vec![wall(at, contact, 0.5)];
                    let one = machine(chain(n), 1.1, [1.0, 0.0], &row, walls);
                    after_a_period(&one, &vec![0.0; 2 * n]).into_iter()
                });
                let off =
                    after[0].clone().zip(after[1].clone()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                after[0].next();
                assert!(off < 1e-6, "{n} masses, {contact:?}, side {side}: {off:e}");
            }
        }
    }
}

/// A force that begins at 0 holds a mass on a rigid wall until it changes its sign.
#[test]
fn a_force_that_begins_at_zero_holds_a_mass_on_its_wall() {
    let omega = 0.8;
    let walls = [vec![wall(0.0, Contact::Rigid, 0.5)], Vec::new()];
    let machine = machine(DMatrix::identity(1, 1), omega, [0.0, 1.0], &[1.0], walls);
    let state = after_a_period(&machine, &[0.0, 0.0]);
    // x'' + x = sin(0.8 t) from rest at t = pi / 0.8.
    let (s, factor) = (std::f64::consts::PI / omega, 1.0 / (1.0 - omega * omega));
    let exact =
        [factor * (-(omega * s).sin() + omega * s.sin()), factor * omega * (s.cos() - (omega * s).cos())];
    assert!(
        (state[0] - exact[0]).abs() < 1e-12 && (state[1] - exact[1]).abs() < 1e-12,
        "{state:?}, {exact:?}"
    );
}

/// A force that only reaches the limit of dry friction moves nothing.
#[test]
fn friction_holds_a_force_at_its_limit() {
    for ([force, load], limit) in
        [([1.0, 0.0], 1.0), ([0.0, 0.3], 0.3), ([0.2, 0.1], 0.3), ([0.3, -0.4], 0.7)]
    {
        let mut one = machine(DMatrix::identity(1, 1), 0.7, [force, 0.0], &[1.0], [Vec::new(), Vec::new()]);
        one.stages[0].load[0] = load;
        one.friction = vec![DryFriction::new(DVector::from_element(1, 1.0), limit, 0.0)];
        let state = after_a_period(&one, &[0.0, 0.0]);
        assert!(
            state.iter().all(|x| x.abs() < 1e-12),
            "force {force}, load {load}, limit {limit}: {state:?}"
        );
    }
}

/// Two motions must not count as escaped, although stages could do work: one that is much larger than a narrow clearance, and decay towards
/// a wall at 0.
#[test]
fn bounded_motion_with_stages_does_not_escape() {
    let with_stages = |mut machine: Oscillator| {
        let mut second = machine.stages[0].clone();
        second.stiffness *= 1.1;
        machine.stages.push(second);
        machine.schedule = vec![(0.0, 0), (0.5, 1)];
        for wall in machine.gaps.iter_mut().flat_map(|gap| gap.walls.iter_mut().flatten()) {
            wall.springs = vec![wall.springs[0]; 2];
        }
        machine
    };
    let narrow = [vec![wall(1e-7, Contact::Elastic, 0.0)], vec![wall(-1e-7, Contact::Elastic, 0.0)]];
    let state =
        after_a_period(&with_stages(machine(chain(3), 0.8, [1.0, 0.0], &[0.0, 0.0, 1.0], narrow)), &[0.0; 6]);
    assert!(state.iter().all(|x| x.abs() < 10.0), "{state:?}");
    let at_zero = [vec![wall(0.0, Contact::Rigid, 0.5)], Vec::new()];
    let mut decay = machine(DMatrix::identity(1, 1), 0.8, [0.0; 2], &[1.0], at_zero);
    decay.stages[0].damping[(0, 0)] = 0.1;
    let state = after_a_period(&with_stages(decay), &[-1.0, 0.0]);
    assert!(state[0].abs() < 1.0, "{state:?}");
}

/// A body falls on a body that rests on the floor. The impulse equals that of an impact with a fixed wall, and the floor pushes with the
/// same impulse.
#[test]
fn a_wall_on_which_another_gap_rests_takes_part_in_an_impact() {
    let walls = || [Vec::new(), vec![wall(0.0, Contact::Rigid, 0.5)]];
    let mut bodies = machine(DMatrix::zeros(2, 2), 1.0, [0.0; 2], &[1.0, 0.0], walls());
    bodies.stages[0].load = DVector::from_element(2, -1.0);
    bodies.gaps.push(GapRow { row: DVector::from_row_slice(&[-1.0, 1.0]), walls: walls() });
    let system = System::new(&bodies);
    let mut motion = MachineMotion::new(&system, &[0.0, 0.0, 0.5, 0.0]);
    let (before, after) = (0.999, 1.001);
    motion.advance_to(before, &mut ()).unwrap();
    assert!((motion.state()[3] + before).abs() < 1e-13, "{:?}", motion.state());
    motion.advance_to(after, &mut ()).unwrap();
    let state = motion.state();
    assert!(state[1] == 0.0 && (state[3] - (0.5 - (after - 1.0))).abs() < 1e-13, "{state:?}");
    let oscillator = bodies;
    let impulse = |gap, speeds: [f64; 2]| {
        oscillator.gap_impulse(
            gap,
            [&state_of(&[0.0, 0.0, 0.0, speeds[0]]), &state_of(&[0.0, 0.0, 0.0, speeds[1]])],
        )
    };
    for gap in [0, 1] {
        assert!((impulse(gap, [-1.0, 0.5]) - 1.5).abs() < 1e-13, "gap {gap}");
    }
}
