//! Rigid walls: what comes to rest on them pressed sticks until the load pulls it off.

use crate::common::linear::{Linear, with_wall};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Contact, GearPair, Law, Oscillator, Side, State};
use rattlemap_dynamics::orbit::{Budget, Class, Settings, Status, analyse_flow, measure};
use rattlemap_dynamics::reference::{EventKind, GapEvent, Trajectory};

/// What a cell of a map may take.
const BUDGET: Budget = Budget {
    settings: Settings { transient_periods: 400, observed_periods: 128, max_period: 64 },
    early_stop: true,
    undecided_periods: 1024,
    exponent: true,
    shows_exponent: true,
};

/// A ball of weight 1 on a table shaken so that its acceleration is `gamma cos(omega t)` times the weight, seen
/// from the table, which is the right wall at 0: `z'' = 1 + gamma cos(omega t)` points into it.
fn ball(gamma: f64, omega: f64) -> Oscillator {
    let free = Linear { gamma: 0.0, square: 0.0, force: gamma, load: 1.0, omega };
    with_wall(free.oscillator(), Side::Right, 0.0, Contact::Rigid, [0.0, 0.0])
}

/// Height and speed of a ball that left the table at rest at phase `from`, at another.
fn thrown(gamma: f64, omega: f64, from: f64, phase: f64) -> [f64; 2] {
    let s = (phase - from) / omega;
    let v = s + gamma / omega * (phase.sin() - from.sin());
    let x = 0.5 * s * s - gamma / (omega * omega) * (phase.cos() - from.cos() + (phase - from) * from.sin());
    [x, v]
}

/// The phase at which it comes down: its height is one function of time, and it rises first.
fn lands(gamma: f64, omega: f64, from: f64) -> f64 {
    let height = |phase: f64| -thrown(gamma, omega, from, phase)[0];
    let step = 1e-3;
    let before = (1..).map(|i| from + step * f64::from(i)).find(|&phase| height(phase + step) <= 0.0);
    let (mut lo, mut hi) = before.map(|phase| (phase, phase + step)).expect("it falls");
    for _ in 0..60 {
        let middle = 0.5 * (lo + hi);
        if height(middle) > 0.0 { lo = middle } else { hi = middle }
    }
    0.5 * (lo + hi)
}

fn events(flow: &Flow, law: Law, start: State, periods: u32) -> Vec<GapEvent> {
    let mut trajectory = Trajectory::new(flow, law, start);
    let mut events = Vec::new();
    (0..periods).for_each(|_| trajectory.advance_period(&mut events).expect("an ordinary cell"));
    events
}

fn near(a: f64, b: f64, within: f64) -> bool {
    (a - b).abs() <= within
}

/// It leaves where the table falls as fast as the ball, at `cos(phase) = -1 / gamma`, flies, lands, and sticks.
#[test]
fn a_ball_that_does_not_bounce_leaves_a_shaken_table_and_sticks_to_it() {
    for (gamma, omega) in [(1.05, 1.0), (1.2, 1.0), (1.2, 3.0), (2.0, 0.5), (2.8, 1.0)] {
        let flow = Flow::new(&ball(gamma, omega));
        let events = events(&flow, Law::both(0.0, 0.0), [0.0; 4], 4);
        let leaves = (-1.0f64 / gamma).acos();
        let lands = lands(gamma, omega, leaves);
        let speed = thrown(gamma, omega, leaves, lands)[1];
        assert!(1.0 + gamma * lands.cos() > 0.0, "gamma = {gamma}: it is pressed where it lands");
        // From the start it lies there.
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
        let orbit = analyse_flow(&flow, Law::both(0.0, 0.0), [-0.3, 0.0, 0.0, 0.0], &Settings::default(), 8);
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok), "{orbit:?}");
        assert_eq!((orbit.word.time_order().as_str(), orbit.impacts_per_period), ("12", 0.0), "{orbit:?}");
        let flies = (lands - leaves) / std::f64::consts::TAU;
        assert!(near(orbit.mesh_fraction, 1.0 - flies, 1e-12), "{orbit:?}");
        let cell = measure(&flow, Law::both(0.0, 0.0), [-0.3, 0.0, 0.0, 0.0], &BUDGET);
        assert_eq!((cell.period, cell.status, cell.word), (Some(1), Status::Ok, Some(orbit.word)));
        // Whatever a neighbour does, it leaves with the table: all is forgotten.
        assert_eq!(orbit.floquet, Some(vec![[0.0; 2]; 2]));
        assert_eq!(orbit.lyapunov, f64::NEG_INFINITY);
    }
}

/// A ball that bounces comes to rest by infinitely many impacts, and leaves at the same phase.
#[test]
fn a_bouncing_ball_forgets_its_impacts_on_the_table() {
    for (gamma, e) in [(1.05, 0.3), (1.2, 0.5), (1.1, 0.8)] {
        let flow = Flow::new(&ball(gamma, 1.0));
        let events = events(&flow, Law::both(e, 0.0), [-0.05, 0.0, 0.0, 0.0], 6);
        let leaves = (-1.0f64 / gamma).acos();
        let ends: Vec<&GapEvent> = events.iter().filter(|event| event.kind == EventKind::MeshEnd).collect();
        assert!(ends.len() >= 4, "gamma = {gamma}: {}", ends.len());
        assert!(ends.iter().all(|end| near(end.t, leaves, 1e-13)), "gamma = {gamma}: {ends:?}");
        let first = events.iter().position(|event| event.kind == EventKind::MeshEnd).expect("it leaves");
        let landing = &events[first + 1];
        let (exact, at) = (
            lands(gamma, 1.0, leaves),
            landing.t + std::f64::consts::TAU * f64::from(u8::from(landing.t < leaves)),
        );
        assert!(near(at, exact, 1e-12) && landing.kind == EventKind::Impact, "{landing:?}: {exact}");
        let impacts = events.iter().filter(|event| event.kind == EventKind::Impact).count();
        assert!(impacts > 20, "gamma = {gamma}: {impacts}");
    }
}

/// A table that never falls faster than the ball keeps it for ever, without an event.
#[test]
fn a_ball_stays_on_a_table_shaken_gently() {
    for gamma in [0.0, 0.5, 0.999] {
        let flow = Flow::new(&ball(gamma, 2.0));
        for (start, law) in [
            ([0.0; 4], Law::both(0.5, 0.0)),
            ([-0.1, 0.0, 0.0, 0.0], Law::both(0.6, 1e-3)),
            ([0.2, 0.3, 0.0, 0.0], Law::both(0.0, 0.0)),
        ] {
            let mut trajectory = Trajectory::new(&flow, law, start);
            let mut events: Vec<GapEvent> = Vec::new();
            (0..200).for_each(|_| trajectory.advance_period(&mut events).expect("an ordinary cell"));
            let last = events.last().expect("it lands");
            assert_eq!(
                (last.kind, last.after),
                (EventKind::MeshStart, [0.0; 4]),
                "gamma = {gamma}: {last:?}"
            );
            assert!(last.period < 20, "gamma = {gamma}: {last:?}");
            assert_eq!((trajectory.state(), trajectory.meshing()), ([0.0; 4], Some(Side::Right)));
            assert!(!trajectory.near_grazing());
        }
    }
}

/// With a threshold the last impact is the first whose leaving speed is not above it; the rest of its impulse
/// brings the ball to rest.
#[test]
fn a_slow_impact_sticks_at_the_threshold() {
    let flow = Flow::new(&ball(0.0, 1.0));
    let (e, threshold, drop) = (0.6, 1e-2, 0.5);
    let events = events(&flow, Law::both(e, threshold), [-drop, 0.0, 0.0, 0.0], 2);
    let speed = (2.0 * drop).sqrt();
    let count = (1..).find(|&n| speed * e.powi(n) <= threshold).expect("it slows down") as usize;
    assert_eq!(events.len(), count, "{events:?}");
    assert!(events[..count - 1].iter().all(|event| event.kind == EventKind::Impact));
    let last = &events[count - 1];
    assert_eq!((last.kind, last.after[1]), (EventKind::MeshStart, 0.0));
    assert!(near(last.before[1], speed * e.powi(count as i32 - 1), 1e-13), "{last:?}");
}

/// The gear pair between rigid walls.
fn rigid(pair: &GearPair) -> Oscillator {
    Oscillator { contacts: [Contact::Rigid; 2], ..pair.oscillator().expect("valid") }
}

/// Two gears held together are one body: `(m1 + m2) x2'' + (r1 + r2) x2' + (k1 + k2) x2 = F cos - k1 wall` leads
/// from each start of sticking to its end, where the wall has nothing left to take up.
#[test]
fn gears_that_stick_move_as_one_body() {
    let mut stretches = 0;
    for (e, omega) in [(0.0, 2.0), (0.0, 1.3), (0.3, 1.5), (0.5, 1.0)] {
        let pair = GearPair { omega, mesh_speed: 0.0, ..GearPair::paper(e) };
        let flow = Flow::new(&rigid(&pair));
        let mass = pair.m1 + pair.m2;
        let events = events(&flow, pair.law(), [0.1, 0.0, 0.0, 0.0], 12);
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
            let pull = |[x1, v1, x2, v2]: State| {
                (pair.force * (omega * end.t).cos() - pair.r1 * v1 - pair.k1 * x1) / pair.m1
                    + (pair.r2 * v2 + pair.k2 * x2) / pair.m2
            };
            assert!(pull(flow.to_state(end.before)).abs() < 1e-11, "{case}");
            stretches += 1;
        }
    }
    assert!(stretches > 20, "{stretches}");
}

/// Sticking takes the gap from neighbours and hands on the rest: against central differences.
#[test]
fn tangents_are_derivatives_through_sticking() {
    for (e, mesh_speed, omega) in
        [(0.0, 0.0, 2.0), (0.0, 0.0, 1.3), (0.3, 0.0, 1.5), (0.3, 0.05, 1.5), (0.5, 0.0, 1.0)]
    {
        let pair = GearPair { omega, mesh_speed, ..GearPair::paper(e) };
        let flow = Flow::new(&rigid(&pair));
        let mut settled = Trajectory::new(&flow, pair.law(), [0.1, 0.0, 0.0, 0.0]);
        (0..20).for_each(|_| settled.advance_period(&mut ()).expect("an ordinary cell"));
        let y = settled.state();
        let end = |y: State| {
            let mut trajectory = settled.at(y, []);
            trajectory.advance_period(&mut ()).expect("an ordinary cell");
            trajectory.state()
        };
        let unit = |j: usize| std::array::from_fn(|i| f64::from(u8::from(i == j)));
        let mut carrier = settled.at::<4>(y, [0, 1, 2, 3].map(unit));
        let mut events: Vec<GapEvent> = Vec::new();
        carrier.advance_period(&mut events).expect("an ordinary cell");
        assert!(events.iter().any(|event| event.kind == EventKind::MeshStart), "{events:?}");
        let (mut off, mut size) = (0.0f64, 0.0f64);
        for (j, tangent) in carrier.tangents().into_iter().enumerate() {
            let moved = |h: f64| end(std::array::from_fn(|i| y[i] + h * unit(j)[i]));
            let central = |h: f64| -> State {
                let (a, b) = (moved(h), moved(-h));
                std::array::from_fn(|i| (a[i] - b[i]) / (2.0 * h))
            };
            let (near, far) = (central(1e-6), central(2e-6));
            for i in 0..4 {
                off = off.max(((4.0 * near[i] - far[i]) / 3.0 - tangent[i]).abs());
                size = size.max(tangent[i].abs());
            }
        }
        println!("e = {e}, threshold {mesh_speed}, omega = {omega}: off by {off:.1e} of {size:.1e}");
        assert!(off < 2e-7 * size.max(1.0), "e = {e}, omega = {omega}: off by {off:.1e}");
    }
}

/// A motion that sticks at the strobe is found by Newton's method, and both ways to reach it agree.
#[test]
fn cycles_that_stick_at_the_strobe_are_found() {
    let mut stuck = 0;
    for n in 0..24 {
        let (e, omega) = (0.05 * f64::from(n % 6), 1.1 + 0.35 * f64::from(n / 6));
        let pair = GearPair { omega, mesh_speed: 0.0, ..GearPair::paper(e) };
        let flow = Flow::new(&rigid(&pair));
        let orbit = analyse_flow(&flow, pair.law(), [0.1, 0.0, 0.0, 0.0], &Settings::default(), 8);
        if let (Some(side), Class::Periodic { period }) = (orbit.strobe_meshing, orbit.class) {
            let mut around = Trajectory::meshing_from(&flow, pair.law(), orbit.strobe, Some(side));
            (0..period).for_each(|_| around.advance_period(&mut ()).expect("an ordinary cell"));
            let off = (0..4).map(|i| (around.state()[i] - orbit.strobe[i]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-11 && around.meshing() == Some(side), "e = {e}, omega = {omega}: {off:e}");
            let zeros = orbit.floquet.expect("a cycle").iter().filter(|m| m[0].hypot(m[1]) < 1e-12).count();
            assert!(zeros >= 2, "the gap is forgotten: {zeros}");
            stuck += 1;
        }
    }
    assert!(stuck >= 4, "{stuck}");
}

/// A start beyond a rigid wall begins on it, the other displacement where it was: a contact if it closes, pressed
/// it sticks, and else it leaves.
#[test]
fn nothing_begins_behind_a_rigid_wall() {
    let pair = rigid(&GearPair::paper(0.5));
    let flow = Flow::new(&pair);
    let law = Law::both(0.5, 0.0);
    for (w, kind) in [(2.0, Some(EventKind::Impact)), (0.0, Some(EventKind::MeshStart)), (-2.0, None)] {
        let mut trajectory = Trajectory::new(&flow, law, [1.1, w, 0.2, 0.0]);
        assert_eq!(trajectory.state(), [0.7, w, 0.2, 0.0]);
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
