//! Motion while a parameter changes from period to period.

use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    Contact, Drive, Forces, GapRow, GearPair, Law, Oscillator, REST, Restitution, Signal, Spring, State,
    Timing, Wall, state,
};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{EventKind, History, history, run_up};

const ZETA: f64 = 0.02;

/// Returns `x'' + 2 ZETA x' + x = cos omega t + load` with a rigid floor, as a pair or as a machine.
pub(crate) fn above(floor: f64, omega: f64, load: f64, is_machine: bool) -> Oscillator {
    let (matrix, vector) = (|x| DMatrix::from_element(1, 1, x), |x| DVector::from_element(1, x));
    let wall = Wall {
        at: floor,
        contact: Contact::Rigid,
        restitution: Restitution::Constant(0.0),
        mesh_speed: 0.0,
        springs: vec![Spring::default()],
    };
    let signal = Signal {
        displacement: vector(1.0),
        velocity: vector(0.0),
        acceleration: vector(0.0),
        constant: 0.0,
        waves: [0.0; 2],
    };
    let oscillator = Oscillator {
        omega,
        mass: matrix(1.0),
        stages: vec![Forces { damping: matrix(2.0 * ZETA), stiffness: matrix(1.0), load: vector(load) }],
        schedule: Vec::new(),
        drives: vec![Drive { order: 1, cos: vector(1.0), sin: vector(0.0) }],
        gaps: vec![GapRow { row: vector(1.0), walls: [Vec::new(), vec![wall]] }],
        friction: Vec::new(),
        springs: Vec::new(),
        signals: if is_machine { vec![signal] } else { Vec::new() },
        timing: Timing::Forced,
    };
    oscillator.validate().unwrap();
    oscillator
}

fn run(oscillators: &[Oscillator], law: Law, start: State) -> Vec<History> {
    let segments = oscillators.iter().map(|oscillator| (Flow::new(oscillator), law, 1));
    run_up(start, segments, 16, &AtomicBool::new(false), &mut |_| ()).unwrap().unwrap()
}

const INELASTIC: Law = Law { restitution: [0.0; 2], mesh_speed: [0.0; 2] };

/// Returns the state of the oscillator without contact a time `t` after phase 0, in closed form.
fn exact([x, v]: [f64; 2], omega: f64, t: f64) -> [f64; 2] {
    let (stiff, drag) = (1.0 - omega * omega, 2.0 * ZETA * omega);
    let size = stiff * stiff + drag * drag;
    let [a, b] = [stiff / size, drag / size];
    let turning = (1.0 - ZETA * ZETA).sqrt();
    let [p, q] = [x - a, (v - omega * b + ZETA * (x - a)) / turning];
    let ((sin, cos), decay) = ((turning * t).sin_cos(), (-ZETA * t).exp());
    let free = [p * cos + q * sin, (q * turning - ZETA * p) * cos - (p * turning + ZETA * q) * sin];
    let (s, c) = (omega * t).sin_cos();
    [a * c + b * s + decay * free[0], omega * (b * c - a * s) + decay * free[1]]
}

/// A slow run through resonance, against the closed form of each period.
#[test]
fn a_run_through_resonance_is_that_of_the_closed_form() {
    for (is_machine, ends) in [(false, [0.6, 1.4]), (true, [0.6, 1.4]), (false, [1.4, 0.6])] {
        let omegas: Vec<f64> =
            (0..200).map(|n| ends[0] + (ends[1] - ends[0]) * f64::from(n) / 199.0).collect();
        let all: Vec<_> = omegas.iter().map(|&omega| above(-1e3, omega, 0.0, is_machine)).collect();
        let histories = run(&all, INELASTIC, state(&[0.3, -0.2]));
        let (mut at, mut begins, mut largest) = ([0.3, -0.2], 0.0, 0.0_f64);
        for (history, &omega) in histories.iter().zip(&omegas) {
            assert_eq!((history.samples.len(), history.forcing_period), (17, TAU / omega));
            for (i, sample) in history.samples.iter().enumerate() {
                let t = TAU / omega * i as f64 / 16.0;
                let [x, v] = exact(at, omega, t);
                assert!((sample.t - begins - t).abs() < 1e-12 * (1.0 + sample.t), "{}", sample.t);
                assert!(
                    (sample.state[0] - x).abs() < 1e-10 && (sample.state[1] - v).abs() < 1e-10,
                    "{omega}"
                );
                largest = largest.max(x.abs());
            }
            at = exact(at, omega, TAU / omega);
            begins += TAU / omega;
        }
        // The resonance has the amplitude 25 and is not reached quite.
        assert!((10.0..25.0).contains(&largest), "{largest}");
    }
}

fn assert_near(ours: &History, theirs: &[&History], tolerance: f64) {
    let samples: Vec<_> =
        theirs.iter().flat_map(|history| &history.samples[..history.samples_per_period]).collect();
    for (a, b) in ours.samples.iter().zip(&samples) {
        let apart = (0..4).map(|i| (a.state[i] - b.state[i]).abs()).fold((a.t - b.t).abs(), f64::max);
        assert!(apart <= tolerance && a.meshing == b.meshing, "{a:?} {b:?}");
    }
    let events: Vec<_> = theirs.iter().flat_map(|history| &history.events).collect();
    assert_eq!(ours.events.len(), events.len());
    for (a, b) in ours.events.iter().zip(events) {
        assert!(a.kind == b.kind && (a.t - b.t).abs() <= tolerance, "{a:?} {b:?}");
    }
}

/// A run whose parameters do not change is the plain motion: to the bit as one segment, and to rounding if each period begins anew. From some
/// phases the cycle meshes at phase 0, so that contact goes on from one period to the next.
#[test]
fn a_run_between_equal_ends_is_the_plain_motion() {
    let pair = GearPair::paper(0.06);
    let halt = AtomicBool::new(false);
    let mut machine = pair.oscillator().unwrap();
    let zero = DVector::zeros(2);
    let row = DVector::from_vec(vec![1.0, 0.0]);
    let waves = [0.0; 2];
    machine.signals.push(Signal {
        displacement: row,
        velocity: zero.clone(),
        acceleration: zero,
        constant: 0.0,
        waves,
    });
    let engines = [Flow::of(&pair).unwrap(), Flow::new(&machine)];
    let phases = [0.0, 0.2, 0.21, 0.71];
    let mut in_contact = 0;
    for flow in engines.iter().flat_map(|flow| phases.map(|phase| flow.at_phase(phase))) {
        let plain = history(&flow, pair.law(), REST, (0, 60), 16, &halt).unwrap().unwrap();
        let whole = [(flow.clone(), pair.law(), 60)];
        let whole = run_up(REST, whole, 16, &halt, &mut |_| ()).unwrap().unwrap();
        assert_eq!(whole[0].samples, plain.samples);
        assert_eq!(whole[0].events, plain.events);
        let anew = run_up(REST, (0..60).map(|_| (flow.clone(), pair.law(), 1)), 16, &halt, &mut |_| ());
        let anew = anew.unwrap().unwrap();
        assert_near(&plain, &anew.iter().collect::<Vec<_>>(), 1e-10);
        in_contact += anew.iter().filter(|history| history.meshing.is_some()).count();
    }
    assert!(in_contact > 100, "{in_contact}");
}

/// A gap at rest follows its wall, and leaves it at phase 0 if the new load lifts it.
#[test]
fn a_gap_at_rest_follows_its_wall_until_the_load_lifts_it() {
    for is_machine in [false, true] {
        let floors = [0.0, 0.1, -0.2].map(|floor| above(floor, 2.0, -5.0, is_machine));
        let all = [&floors[..], &[above(-0.2, 2.0, 5.0, is_machine)]].concat();
        let histories = run(&all, INELASTIC, state(&[0.0]));
        for (history, floor) in histories.iter().zip([0.0, 0.1, -0.2]) {
            assert!(history.samples.iter().all(|sample| sample.state[0] == floor && sample.state[1] == 0.0));
        }
        let last = &histories[3];
        assert!(
            histories[..3]
                .iter()
                .all(|history| history.events.iter().all(|event| event.kind != EventKind::MeshEnd))
        );
        let first = last.events.first().unwrap();
        assert_eq!((first.kind, first.t, first.t_mod_period), (EventKind::MeshEnd, last.samples[0].t, 0.0));
        assert!(last.samples[1].state[0] > -0.2 && last.samples[0].state[..2] == [-0.2, 0.0]);
    }
}
