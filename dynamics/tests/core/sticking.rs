//! Rigid walls: a pressed gap that has come to rest sticks until the load pulls it off.

use crate::common::linear::{Linear, with_wall};
use crate::common::pairs::{AsPair, OfPair};
use crate::common::{BUDGET, apart, differences, events, near};
use rattlemap_dynamics::model::{Contact, GearPair, Law, Pair, REST, Side, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{EventKind, GapEvent, Trajectory};
use rattlemap_dynamics::orbit::{Class, Settings, Status, analyse_flow, measure};
use rattlemap_dynamics::stability::UNIT;

/// Returns a ball of weight 1 on a vibrating table with the acceleration `gamma cos(omega t)`. In the frame of the
/// table, which is the right wall at 0, the ball's acceleration is `z'' = 1 + gamma cos(omega t)` towards the wall.
fn ball(gamma: f64, omega: f64) -> Pair {
    let free = Linear { gamma: 0.0, square: 0.0, force: gamma, load: 1.0, omega };
    with_wall(free.oscillator(), Side::Right, 0.0, Contact::Rigid, [0.0, 0.0])
}

/// Returns position and velocity at a phase of a ball that left the table at rest at the phase `from`.
fn thrown(gamma: f64, omega: f64, from: f64, phase: f64) -> [f64; 2] {
    let s = (phase - from) / omega;
    let v = s + gamma / omega * (phase.sin() - from.sin());
    let x = 0.5 * s * s - gamma / (omega * omega) * (phase.cos() - from.cos() + (phase - from) * from.sin());
    [x, v]
}

/// Returns the phase at which this ball lands.
fn landing_phase(gamma: f64, omega: f64, from: f64) -> f64 {
    let height = |phase: f64| -thrown(gamma, omega, from, phase)[0];
    let step = 1e-3;
    let before = (1..).map(|i| from + step * f64::from(i)).find(|&phase| height(phase + step) <= 0.0);
    let (mut lo, mut hi) = before.map(|phase| (phase, phase + step)).expect("a landing");
    for _ in 0..60 {
        let middle = 0.5 * (lo + hi);
        if height(middle) > 0.0 { lo = middle } else { hi = middle }
    }
    0.5 * (lo + hi)
}

/// The ball leaves the table at `cos(phase) = -1 / gamma`, where both have the same acceleration.
#[test]
fn a_ball_without_restitution_leaves_a_vibrating_table_and_sticks_after_landing() {
    for (gamma, omega) in [(1.05, 1.0), (1.2, 1.0), (1.2, 3.0), (2.0, 0.5), (2.8, 1.0)] {
        let flow = Flow::new(&ball(gamma, omega));
        let events = events(&flow, Law::both(0.0, 0.0), REST, 4);
        let leaves = (-1.0f64 / gamma).acos();
        let lands = landing_phase(gamma, omega, leaves);
        let speed = thrown(gamma, omega, leaves, lands)[1];
        assert!(1.0 + gamma * lands.cos() > 0.0, "gamma = {gamma}: not pressed after landing");
        assert_eq!((events[0].kind, events[0].t), (EventKind::MeshStart, 0.0));
        for (n, two) in events[1..].chunks_exact(2).enumerate() {
            let [end, start] = two else { unreachable!("chunks of two") };
            let case = format!("gamma = {gamma}, omega = {omega}, period {n}: {two:?}");
            assert_eq!((end.kind, end.symbol), (EventKind::MeshEnd, Some(b'1')), "{case}");
            assert_eq!((start.kind, start.symbol), (EventKind::MeshStart, Some(b'2')), "{case}");
            assert!(near(omega * end.t, leaves, 1e-13), "leaves at {}, not {leaves}: {case}", omega * end.t);
            let phase = (omega * start.t - leaves).rem_euclid(std::f64::consts::TAU) + leaves;
            assert!(near(phase, lands, 1e-12), "lands at {phase}, not {lands}: {case}");
            assert!(near(start.before[1], speed, 1e-12), "{speed}: {case}");
            assert_eq!((end.after, start.after), ([0.0; 4], [0.0; 4]), "{case}");
        }
        assert!(events.len() >= 8, "{events:?}");
        let orbit = analyse_flow(&flow, Law::both(0.0, 0.0), state(&[-0.3]), &Settings::default(), 8);
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok), "{orbit:?}");
        assert_eq!((orbit.word.time_order().as_str(), orbit.impacts_per_period), ("12", 0.0), "{orbit:?}");
        let flies = (lands - leaves) / std::f64::consts::TAU;
        assert!(near(orbit.mesh_fraction, 1.0 - flies, 1e-12), "{orbit:?}");
        let cell = measure(&flow, Law::both(0.0, 0.0), state(&[-0.3]), &BUDGET);
        assert_eq!((cell.period, cell.status, cell.word), (Some(1), Status::Ok, Some(orbit.word)));
        // Neighbouring motions leave the table at the same phase and in the same state.
        assert_eq!(orbit.floquet, Some(vec![[0.0; 2]; 2]));
        assert_eq!(orbit.lyapunov, f64::NEG_INFINITY);
    }
}

/// A bouncing ball comes to rest by infinitely many impacts, and leaves the table at the same phase.
#[test]
fn a_bouncing_ball_leaves_the_vibrating_table_at_the_same_phase() {
    for (gamma, e) in [(1.05, 0.3), (1.2, 0.5), (1.1, 0.8)] {
        let flow = Flow::new(&ball(gamma, 1.0));
        let events = events(&flow, Law::both(e, 0.0), state(&[-0.05]), 6);
        let leaves = (-1.0f64 / gamma).acos();
        let ends: Vec<&GapEvent> = events.iter().filter(|event| event.kind == EventKind::MeshEnd).collect();
        assert!(ends.len() >= 4, "gamma = {gamma}: {}", ends.len());
        assert!(ends.iter().all(|end| near(end.t, leaves, 1e-13)), "gamma = {gamma}: {ends:?}");
        let first = events.iter().position(|event| event.kind == EventKind::MeshEnd).expect("a release");
        let landing = &events[first + 1];
        let (exact, at) = (
            landing_phase(gamma, 1.0, leaves),
            landing.t + std::f64::consts::TAU * f64::from(u8::from(landing.t < leaves)),
        );
        assert!(near(at, exact, 1e-12) && landing.kind == EventKind::Impact, "{landing:?}: {exact}");
        let impacts = events.iter().filter(|event| event.kind == EventKind::Impact).count();
        assert!(impacts > 20, "gamma = {gamma}: {impacts}");
    }
}

#[test]
fn a_ball_stays_on_a_table_with_less_acceleration_than_gravity() {
    for gamma in [0.0, 0.5, 0.999] {
        let flow = Flow::new(&ball(gamma, 2.0));
        for (start, law) in [
            (REST, Law::both(0.5, 0.0)),
            (state(&[-0.1]), Law::both(0.6, 1e-3)),
            (state(&[0.2, 0.3]), Law::both(0.0, 0.0)),
        ] {
            let mut trajectory = Trajectory::new(&flow, law, start);
            let mut events: Vec<GapEvent> = Vec::new();
            (0..200).for_each(|_| trajectory.advance_period(&mut events).expect("an ordinary cell"));
            let last = events.last().expect("a landing");
            assert_eq!(
                (last.kind, last.after),
                (EventKind::MeshStart, [0.0; 4]),
                "gamma = {gamma}: {last:?}"
            );
            assert!(last.period < 20, "gamma = {gamma}: {last:?}");
            assert_eq!((trajectory.state(), trajectory.meshing()), (REST, Some(Side::Right)));
            assert!(!trajectory.near_grazing());
        }
    }
}

/// The first impact whose leaving speed is at or below the mesh speed brings the ball to rest.
#[test]
fn an_impact_at_the_mesh_speed_sticks() {
    let flow = Flow::new(&ball(0.0, 1.0));
    let (e, threshold, drop) = (0.6, 1e-2, 0.5);
    let events = events(&flow, Law::both(e, threshold), state(&[-drop]), 2);
    let speed = (2.0 * drop).sqrt();
    let count = (1..).find(|&n| speed * e.powi(n) <= threshold).unwrap() as usize;
    assert_eq!(events.len(), count, "{events:?}");
    assert!(events[..count - 1].iter().all(|event| event.kind == EventKind::Impact));
    let last = &events[count - 1];
    assert_eq!((last.kind, last.after[1]), (EventKind::MeshStart, 0.0));
    assert!(near(last.before[1], speed * e.powi(count as i32 - 1), 1e-13), "{last:?}");
}

fn rigid(pair: &GearPair) -> Pair {
    Pair { contacts: [Contact::Rigid; 2], ..pair.pair() }
}

/// Sticking gears obey `(m1 + m2) x2'' + (r1 + r2) x2' + (k1 + k2) x2 = F cos - k1 wall`. They part when their
/// relative acceleration vanishes.
#[test]
fn gears_that_stick_move_as_one_body() {
    let mut contacts = 0;
    for (e, omega) in [(0.0, 2.0), (0.0, 1.3), (0.3, 1.5), (0.5, 1.0)] {
        let pair = GearPair { omega, mesh_speed: 0.0, ..GearPair::paper(e) };
        let flow = Flow::new(&rigid(&pair));
        let mass = pair.m1 + pair.m2;
        let events = events(&flow, pair.law(), state(&[0.1]), 12);
        for two in events.windows(2).filter(|two| two[0].kind == EventKind::MeshStart) {
            let (start, end) = (&two[0], &two[1]);
            let case = format!("e = {e}, omega = {omega}: {two:?}");
            assert_eq!((end.kind, end.side), (EventKind::MeshEnd, start.side), "{case}");
            assert_eq!(end.symbol, Some(if start.side == Side::Right { b'1' } else { b'4' }));
            let wall = start.side.sign() * pair.b;
            let body = Linear {
                gamma: 0.5 * (pair.r1 + pair.r2) / mass,
                square: (pair.k1 + pair.k2) / mass,
                force: pair.force / mass,
                load: -pair.k1 * wall / mass,
                omega,
            };
            let tau = (end.period - start.period) as f64 * flow.period + end.t - start.t;
            let [x, v] = body.flow([start.after[2], start.after[3]], start.t, tau);
            assert!(near(x, end.before[2], 1e-12) && near(v, end.before[3], 1e-12), "{x}, {v}: {case}");
            assert_eq!(
                (end.before[..2].to_vec(), start.after[..2].to_vec()),
                (vec![wall, 0.0], vec![wall, 0.0])
            );
            let pull = |[x1, v1, x2, v2, ..]: State| {
                (pair.force * (omega * end.t).cos() - pair.r1 * v1 - pair.k1 * x1) / pair.m1
                    + (pair.r2 * v2 + pair.k2 * x2) / pair.m2
            };
            assert!(pull(flow.to_state(end.before)).abs() < 1e-11, "{case}");
            contacts += 1;
        }
    }
    assert!(contacts > 20, "{contacts}");
}

#[test]
fn tangents_are_derivatives_through_sticking() {
    for (e, mesh_speed, omega) in
        [(0.0, 0.0, 2.0), (0.0, 0.0, 1.3), (0.3, 0.0, 1.5), (0.3, 0.05, 1.5), (0.5, 0.0, 1.0)]
    {
        let pair = GearPair { omega, mesh_speed, ..GearPair::paper(e) };
        let flow = Flow::new(&rigid(&pair));
        let mut settled = Trajectory::new(&flow, pair.law(), state(&[0.1]));
        (0..20).for_each(|_| settled.advance_period(&mut ()).expect("an ordinary cell"));
        let y = settled.state();
        let strobe = |y: State| {
            let mut trajectory = settled.at(y, []);
            trajectory.advance_period(&mut ()).expect("an ordinary cell");
            trajectory.state()
        };
        let mut carrier = settled.at(y, UNIT);
        let mut events: Vec<GapEvent> = Vec::new();
        carrier.advance_period(&mut events).expect("an ordinary cell");
        assert!(events.iter().any(|event| event.kind == EventKind::MeshStart), "{events:?}");
        let tangents = carrier.tangents();
        let size = tangents.iter().flatten().fold(1.0f64, |size, x| size.max(x.abs()));
        let columns = tangents.into_iter().zip(differences(strobe, y, 1e-6));
        let off = columns.map(|(a, b)| apart(a, b)).fold(0.0, f64::max);
        assert!(off < 2e-7 * size, "e = {e}, omega = {omega}: off by {off:.1e} of {size:.1e}");
    }
}

#[test]
fn cycles_that_stick_at_the_strobe_are_found() {
    let mut stuck = 0;
    for n in 0..24 {
        let (e, omega) = (0.05 * f64::from(n % 6), 1.1 + 0.35 * f64::from(n / 6));
        let pair = GearPair { omega, mesh_speed: 0.0, ..GearPair::paper(e) };
        let flow = Flow::new(&rigid(&pair));
        let orbit = analyse_flow(&flow, pair.law(), state(&[0.1]), &Settings::default(), 8);
        if let (Some(side), Class::Periodic { period }) = (orbit.strobe_meshing, orbit.class) {
            let mut around = Trajectory::meshing_from(&flow, pair.law(), orbit.strobe, Some(side));
            (0..period).for_each(|_| around.advance_period(&mut ()).expect("an ordinary cell"));
            let off = (0..4).map(|i| (around.state()[i] - orbit.strobe[i]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-11 && around.meshing() == Some(side), "e = {e}, omega = {omega}: {off:e}");
            let zeros = orbit.floquet.expect("a cycle").iter().filter(|m| m[0].hypot(m[1]) < 1e-12).count();
            assert!(zeros >= 2, "the gap has no multipliers: {zeros}");
            stuck += 1;
        }
    }
    assert!(stuck >= 4, "{stuck}");
}

/// A closing gap has an impact, a pressed gap at rest sticks, and an opening gap leaves.
#[test]
fn a_start_behind_a_rigid_wall_is_moved_onto_the_wall() {
    let pair = rigid(&GearPair::paper(0.5));
    let flow = Flow::new(&pair);
    let law = Law::both(0.5, 0.0);
    for (w, kind) in [(2.0, Some(EventKind::Impact)), (0.0, Some(EventKind::MeshStart)), (-2.0, None)] {
        let mut trajectory = Trajectory::new(&flow, law, state(&[1.1, w, 0.2]));
        assert_eq!(trajectory.state(), state(&[0.7, w, 0.2]));
        let mut events: Vec<GapEvent> = Vec::new();
        trajectory.advance_to(1e-3, &mut events).expect("an ordinary cell");
        assert_eq!(
            events.first().map(|event| (event.kind, event.t)),
            kind.map(|kind| (kind, 0.0)),
            "w = {w}"
        );
        assert!(
            trajectory.state()[0] - trajectory.state()[2] <= 0.5 + 1e-15,
            "w = {w}: {:?}",
            trajectory.state()
        );
    }
}
