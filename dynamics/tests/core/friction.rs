//! Dry friction: closed forms, limits and balances.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use crate::common::linear::unforced;
use crate::common::pairs::{AsPair, Friction, Rubbing};
use crate::common::{BUDGET, REST, apart, near, paper};
use rattlemap_dynamics::model::{
    Contact, Domain, Drive, DryFriction, Forces, Form, GapRow, Law, Oscillator, Pair, Timing, state,
};
use rattlemap_dynamics::motion::{Flow, GapEvent, Observer, SlipEvent, States, Trajectory};
use rattlemap_dynamics::orbit::{Class, Orbit, Settings, Status, analyse_flow, measure};

/// A single mass on a spring without walls, with `m = k = 1`.
fn block(omega: f64, drive: f64, friction: f64) -> Rubbing {
    let first = |value: f64| [[value, 0.0], [0.0, 0.0]];
    let free = Domain { damping: first(0.0), stiffness: first(1.0), load: [0.0; 2] };
    let pair = Pair { contacts: [Contact::Elastic; 2], omega, force: [drive, 0.0], ..unforced(1, free) };
    Rubbing { pair, friction: vec![Friction { row: [1.0, 0.0], force: friction, speed: 0.0 }] }
}

const LAW: Law = Law { restitution: [0.0; 2], mesh_speed: [0.0; 2] };

/// Symbols of friction, with the times of all changes.
#[derive(Default)]
struct Slides(Vec<(Option<u8>, f64)>);

impl Observer for Slides {
    fn event(&mut self, _: &GapEvent, _: States<'_>) {}

    fn slip(&mut self, event: &SlipEvent) {
        self.0.push((event.symbol, event.t));
    }
}

/// Each half swing is shorter by `2 f / k`, until the spring cannot move the block at a turn.
#[test]
fn half_swings_become_shorter_until_the_block_stops() {
    // The period is ten half swings long.
    let flow = Flow::new(block(0.1, 0.0, 0.15).form(LAW));
    let mut slides = Slides::default();
    let mut motion = Trajectory::new(&flow, LAW, state(&[1.0]));
    motion.advance_period(&mut slides).unwrap();
    // Turns at -0.7, 0.4 and -0.1, where the spring's force is below 0.15.
    let turns: Vec<f64> = slides.0.iter().map(|&(_, t)| t / PI).collect();
    assert_eq!(
        slides.0.iter().map(|&(symbol, _)| symbol).collect::<Vec<_>>(),
        [Some(b'0'), Some(b'0'), None]
    );
    for (turn, expected) in turns.into_iter().zip([1.0, 2.0, 3.0]) {
        assert!((turn - expected).abs() < 1e-14, "turn at {turn} pi");
    }
    let [x, v, ..] = motion.state();
    assert!((x + 0.1).abs() < 1e-14 && v == 0.0, "stops at {x} with {v}");
    for _ in 0..100 {
        motion.advance_period(&mut slides).unwrap();
    }
    assert_eq!((slides.0.len(), motion.state()), (3, state(&[x])));
}

/// Load and force together reach the friction force at phase 0, but never exceed it.
#[test]
fn friction_as_large_as_the_force_holds_a_chain_of_masses() {
    let along = |x: f64| DVector::from_fn(3, |i, _| if i == 0 { x } else { 0.0 });
    let springs = |i: usize, j: usize| [2.0, -1.0, 0.0][i.abs_diff(j)];
    let stage = Forces {
        damping: DMatrix::identity(3, 3) * 0.1,
        stiffness: DMatrix::from_fn(3, 3, springs),
        load: along(0.6),
    };
    for omega in [0.5, 0.6, 0.8, 1.3] {
        let chain = Oscillator {
            omega,
            timing: Timing::Forced,
            mass: DMatrix::identity(3, 3),
            stages: vec![stage.clone()],
            schedule: Vec::new(),
            drives: vec![Drive { order: 1, cos: along(0.4), sin: along(0.0) }],
            gaps: vec![GapRow { row: along(1.0), walls: Default::default() }],
            friction: vec![DryFriction::new(along(1.0), 1.0, 0.0)],
            springs: Vec::new(),
            signals: Vec::new(),
        };
        let (flow, mut slides) = (Flow::new(Form::Machine(chain)), Slides::default());
        let mut motion = Trajectory::new(&flow, LAW, REST);
        (0..50).for_each(|_| motion.advance_period(&mut slides).unwrap());
        assert_eq!((slides.0.len(), motion.state()), (0, REST), "omega = {omega}");
    }
}

/// Without damping only the two reversals of a period change areas of the phase plane: each multiplies them by the ratio of the
/// accelerations after and before it. A slow oscillation about the cycle starts some periods in the other direction of sliding.
#[test]
fn the_exponent_of_sliding_follows_from_its_reversals() {
    for omega in [1.24, 1.6, 1.62] {
        let flow = Flow::new(block(omega, 1.0, 0.02).form(LAW));
        let orbit = analyse_flow(&flow, LAW, REST, &Settings::default(), 8);
        let at = &orbit.slips[0];
        let push = ((omega * at.t).cos() - at.state[0]).abs();
        let exact = ((push - 0.02) / (push + 0.02)).ln() / flow.period;
        let cell = measure(&flow, LAW, REST, &BUDGET);
        assert_eq!(cell.period, Some(1), "{omega}: {cell:?}");
        for ours in [orbit.lyapunov, cell.lyapunov.unwrap()[0]] {
            assert!(near(ours, exact, 1e-9), "{omega}: {ours} but {exact}");
        }
    }
}

/// J. P. den Hartog, Forced vibrations with combined Coulomb and viscous friction, Trans. ASME 53 (1931) 107: motion without stops. With
/// `r = omega`, its amplitude is
///
/// ```text
/// sqrt(V^2 P^2 - U^2 f^2),   V = 1 / (1 - r^2),   U = sin(pi / r) / (r (1 + cos(pi / r)))
/// ```
#[test]
fn the_amplitude_of_forced_sliding_is_that_of_den_hartog() {
    for (omega, friction) in [(0.8, 0.1), (0.8, 0.4), (1.26067, 0.45441), (1.3, 0.3), (1.7, 0.2), (2.3, 0.1)]
    {
        let flow = Flow::new(block(omega, 1.0, friction).form(LAW));
        let orbit = analyse_flow(&flow, LAW, state(&[0.3]), &Settings::default(), 8);
        let angle = PI / omega;
        let (v, u) = (1.0 / (1.0 - omega * omega), angle.sin() / (omega * (1.0 + angle.cos())));
        let expected = (v * v - u * u * friction * friction).sqrt();
        let found = (orbit.class, orbit.status);
        assert_eq!(found, (Class::Periodic { period: 1 }, Status::Ok), "omega = {omega}, f = {friction}");
        let amplitude = orbit.quantities.unwrap().displacements[0].amplitude;
        assert!((amplitude - expected).abs() < 1e-12, "omega = {omega}: {amplitude} and {expected}");
        assert_eq!(orbit.word.time_order(), "00", "omega = {omega}");
    }
}

/// A force below friction never moves the block: each displacement in the dead zone is a cycle, and its multiplier 1 is left out.
#[test]
fn a_block_that_sticks_for_ever_is_periodic() {
    let flow = Flow::new(block(0.7, 0.1, 0.3).form(LAW));
    let orbit = analyse_flow(&flow, LAW, state(&[0.15]), &Settings::default(), 8);
    assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{:?}", orbit.status);
    assert_eq!(orbit.strobe, state(&[0.15]));
    assert_eq!(orbit.floquet, Some(vec![[0.0, 0.0]]));
    let of = orbit.quantities.unwrap().friction.unwrap();
    assert!(near(of.sticking, 1.0, 1e-14) && of.dissipated == 0.0, "{of:?}");
}

/// Rounding errors do not lead beyond the ranges of a share and of an energy: in the first motion the block always sticks, in the
/// second one it loses nothing in impacts.
#[test]
fn sticking_takes_at_most_the_whole_time_and_impacts_never_add_energy() {
    for omega in [0.1, 0.7] {
        let of = |rubbing: Rubbing, law| {
            let flow = Flow::new(rubbing.form(law));
            analyse_flow(&flow, law, state(&[0.15]), &Settings::default(), 8).quantities.unwrap()
        };
        let sticking = of(block(omega, 0.1, 0.3), LAW).friction.unwrap().sticking;
        assert!(sticking <= 1.0, "omega = {omega}: {}", sticking - 1.0);
        let pair = paper(1.0, omega).pair();
        let law = Law { restitution: [1.0; 2], ..LAW };
        let energy = of(Rubbing { pair, ..block(omega, 0.0, 1e-3) }, law).impact_energy;
        assert!(energy >= 0.0, "omega = {omega}: {energy}");
    }
}

/// On a belt of speed `s` the block sticks until the spring pulls with `f`. It then swings about `f`, meets the speed of the belt
/// again at the mirrored time, and sticks. With equal friction in sticking and sliding, it stays at `x = f` after that.
#[test]
fn a_block_on_a_belt_comes_to_slide_at_the_limit_of_friction() {
    let (friction, speed) = (0.4, 0.3);
    let mut belt = block(0.05, 0.0, friction);
    belt.friction[0].speed = speed;
    let flow = Flow::new(belt.form(LAW));
    let mut slides = Slides::default();
    // At the start the block moves with the belt.
    let mut motion = Trajectory::new(&flow, LAW, state(&[0.0, speed]));
    motion.advance_to(friction / speed, &mut slides).unwrap();
    let [x, v, ..] = motion.state();
    assert!(near(x, friction, 1e-14) && v == speed, "{x}, {v}");
    motion.advance_period(&mut slides).unwrap();
    // Sliding slower than the belt, it swings about x = f with the amplitude s: the belt's speed is the largest.
    let expected = (motion.time_in_period(), 0.0);
    assert_eq!(expected.0, 0.0);
    let since = flow.period - friction / speed;
    let [x, v, ..] = motion.state();
    assert!(near(x, friction + speed * since.sin(), 1e-12), "{x}");
    assert!(near(v, speed * since.cos(), 1e-12), "{v}");
}

/// Rows of friction on a gear pair: on one gear, between the gears, and on both.
fn rows() -> [Vec<Friction>; 4] {
    let on = |row: [f64; 2], force: f64| Friction { row, force, speed: 0.0 };
    [
        vec![on([1.0, 0.0], 4.0)],
        vec![on([1.0, -1.0], 2.0)],
        vec![on([0.0, 1.0], 6.0), on([1.0, 0.0], 3.0)],
        vec![on([0.6, 0.8], 5.0)],
    ]
}

#[test]
fn friction_takes_its_share_of_the_work_of_the_force() {
    let (mut cycles, mut sticking) = (0, 0);
    for friction in rows() {
        for (e, omega) in
            [(0.06, 5.6), (0.605, 5.6), (0.72, 1.5), (0.3, 3.0), (0.8, 4.4), (0.5, 11.5), (0.3, 7.5)]
        {
            for contact in [Contact::Impact, Contact::Rigid, Contact::Elastic] {
                let pair = paper(e, omega);
                let changed = Pair { contacts: [contact; 2], ..pair.pair() };
                let oscillator = Rubbing { pair: changed, friction: friction.clone() }.described(pair.law());
                if oscillator.validate().is_err() {
                    // Two elements and rigid walls.
                    continue;
                }
                let flow = Flow::new(&oscillator);
                let orbit = analyse_flow(&flow, pair.law(), REST, &Settings::default(), 8);
                let case =
                    format!("{e} {omega} {contact:?} {friction:?}: {:?} {:?}", orbit.class, orbit.status);
                assert_ne!(orbit.class, Class::Failed, "{case}");
                if !matches!(orbit.class, Class::Periodic { .. }) {
                    continue;
                }
                let of = orbit.quantities.unwrap();
                let of_friction = of.friction.unwrap();
                let [size, phase] = of.displacements[0].harmonic;
                let work = -0.5 * pair.force * omega * size * phase.sin();
                let taken = of.dissipated + of.impact_energy + of_friction.dissipated;
                assert!(near(work, taken, 1e-10 * work.abs()), "{work} and {taken}: {case}");
                cycles += 1;
                sticking += usize::from(of_friction.sticking > 0.0);
            }
        }
    }
    assert!(cycles > 50 && sticking > 15, "{cycles} cycles, {sticking} with sticking");
}

#[test]
fn without_force_friction_changes_nothing() {
    for (e, omega) in [(0.06, 5.6), (0.72, 1.5), (0.3, 3.0), (0.5, 11.5)] {
        let pair = paper(e, omega);
        let plain = pair.pair();
        let orbit = |force: f64| {
            let friction = vec![Friction { row: [1.0, -1.0], force, speed: 0.0 }];
            let flow = Flow::new(Rubbing { pair: plain.clone(), friction }.form(pair.law()));
            analyse_flow(&flow, pair.law(), REST, &Settings::default(), 8)
        };
        let [none, zero, small] = [
            analyse_flow(&Flow::new(&plain), pair.law(), REST, &Settings::default(), 8),
            orbit(0.0),
            orbit(1e-9),
        ];
        assert_eq!((none.class, &none.word), (zero.class, &zero.word), "{e}, {omega}");
        assert_eq!(none.class, small.class, "{e}, {omega}");
        if matches!(none.class, Class::Periodic { .. }) {
            let off = |other: &Orbit| apart(none.strobe, other.strobe);
            assert!(off(&zero) < 1e-10 && off(&small) < 1e-7, "{e}, {omega}: {} {}", off(&zero), off(&small));
        }
    }
}

/// A valve between rigid stops, whose friction makes each series of impacts end at rest.
#[test]
fn series_of_impacts_under_friction_end_at_rest() {
    let mut valve = block(0.4545, 0.8, 0.15);
    valve.walls = [0.5, 0.0];
    valve.contacts = [Contact::Rigid; 2];
    valve.free.damping[0][0] = 0.1;
    valve.meshing = [valve.free; 2];
    let law = Law { restitution: [0.6, 0.4], mesh_speed: [0.0; 2] };
    let flow = Flow::new(valve.form(law));
    let mut motion = Trajectory::new(&flow, law, REST);
    for _ in 0..20 {
        let before = motion.work().events;
        motion.advance_period(&mut ()).unwrap();
        let events = motion.work().events - before;
        assert!((10..200).contains(&events), "{events} events in a period");
    }
    let orbit = analyse_flow(&flow, law, REST, &Settings::default(), 8);
    assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{:?}", orbit.status);
}
