//! Impacts while other gaps rest on rigid walls, by hand.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    Contact, Forces, GapRow, Oscillator, Restitution, Side, Spring, Timing, Wall,
};

use super::motion::{Mode, Motion, What};
use super::system::{ANGLE, System};

fn wall(at: f64, e: f64) -> Wall {
    let restitution = Restitution::Constant(e);
    Wall { at, contact: Contact::Rigid, restitution, mesh_speed: 0.0, springs: vec![Spring::default()] }
}

/// Returns masses of 1 without springs under constant loads. The last one has a plastic wall at 0 on its right. The distance of
/// neighbouring masses is limited to 0 and 1, with a restitution of 0.5 at both limits.
fn row_of_masses(loads: &[f64]) -> Oscillator {
    let n = loads.len();
    let gap = |i: usize| {
        let mut row = DVector::zeros(n);
        row[i] = 1.0;
        if i + 1 == n {
            return GapRow { row, walls: [vec![wall(0.0, 0.0)], Vec::new()] };
        }
        row[i + 1] = -1.0;
        GapRow { row, walls: [vec![wall(0.0, if i == 0 { 0.5 } else { 0.0 })], vec![wall(-1.0, 0.5)]] }
    };
    let none = DMatrix::zeros(n, n);
    let forces = Forces { damping: none.clone(), stiffness: none, load: DVector::from_row_slice(loads) };
    Oscillator {
        omega: 1.0,
        mass: DMatrix::identity(n, n),
        stages: vec![forces],
        schedule: Vec::new(),
        drives: Vec::new(),
        gaps: (0..n).map(gap).collect(),
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}

fn near(found: &[f64], expected: &[f64]) -> bool {
    found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-13)
}

/// Start of a mass that falls on its wall within 0.2.
const FALL: [f64; 2] = [-1e-3, 0.0];

#[test]
fn a_mass_that_is_hit_rests_on_its_wall() {
    let system = System::new(&row_of_masses(&[0.0, 0.1]), ANGLE);
    let mut motion = Motion::new(&system, &[-0.5, 1.0, FALL[0], FALL[1]]);
    motion.run(1.0).unwrap();
    let events: Vec<_> = motion.events.iter().map(|event| (event.gap, event.what, event.side)).collect();
    assert_eq!(events, [(1, What::Begins, Side::Right), (0, What::Impact, Side::Right)]);
    assert!(near(&motion.state(), &[-0.25, -0.5, 0.0, 0.0]), "{:?}", motion.state());
    assert!((motion.events[1].t - 0.5).abs() < 1e-13);
    assert_eq!(motion.modes(), [Mode::Plain, Mode::Stuck(Side::Right)]);
}

#[test]
fn a_row_of_resting_masses_stays() {
    let system = System::new(&row_of_masses(&[0.0, 0.2, 0.1]), ANGLE);
    let mut motion = Motion::new(&system, &[-0.5, 1.0, -2e-3, 0.0, FALL[0], FALL[1]]);
    motion.run(1.0).unwrap();
    assert!(near(&motion.state(), &[-0.25, -0.5, 0.0, 0.0, 0.0, 0.0]), "{:?}", motion.state());
    assert_eq!(motion.modes(), [Mode::Plain, Mode::Stuck(Side::Right), Mode::Stuck(Side::Right)]);
    assert_eq!(motion.events.iter().filter(|event| event.gap == 0).count(), 1);
}

/// The first mass moves away and takes the second one with it at a distance of 1. The middle of both moves at -0.5.
#[test]
fn an_impact_that_pulls_releases_a_mass() {
    let system = System::new(&row_of_masses(&[0.0, 0.1]), ANGLE);
    let mut motion = Motion::new(&system, &[-0.5, -1.0, FALL[0], FALL[1]]);
    motion.run(0.75).unwrap();
    let events: Vec<_> =
        motion.events.iter().map(|event| (event.gap, event.what, event.side, event.symbol)).collect();
    let expected = [
        (1, What::Begins, Side::Right, None),
        (0, What::Impact, Side::Left, None),
        (1, What::Ends, Side::Right, Some(b'1')),
    ];
    assert_eq!(events, expected);
    let t = 0.25;
    let state = [-1.0 - 0.25 * t, -0.25, -0.75 * t + 0.05 * t * t, -0.75 + 0.1 * t];
    assert!(near(&motion.state(), &state), "{:?} but {state:?}", motion.state());
}

/// Impacts of a mass on a resting one under a load: each flight is half as long as the one before, and both masses come to rest.
#[test]
fn impacts_on_a_resting_mass_end() {
    let system = System::new(&row_of_masses(&[1.0, 0.1]), ANGLE);
    let mut motion = Motion::new(&system, &[-0.5, 0.0, FALL[0], FALL[1]]);
    motion.run(5.0).unwrap();
    assert!(near(&motion.state(), &[0.0; 4]), "{:?}", motion.state());
    assert_eq!(motion.modes(), [Mode::Stuck(Side::Right); 2]);
    // The first impact has the speed 1 at the time 1. Impacts halve the speed `u` until the rest of the series, which lasts `4 u`, is short.
    let last = motion.events.last().unwrap();
    let short = 1.6e-4 / system.machine.omega;
    let flights = (1..).find(|&i| 4.0 * 0.5f64.powi(i) < short).unwrap();
    assert_eq!((last.gap, last.what), (0, What::Begins));
    assert_eq!(motion.events.iter().filter(|event| event.gap == 0).count(), flights as usize + 1);
    assert!((last.t - 3.0).abs() < 1e-12, "{}", last.t);
}
