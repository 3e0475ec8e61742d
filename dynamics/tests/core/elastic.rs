//! Elastic walls: the motion continues behind them, and the state is continuous.

use crate::common::linear::{Linear, invariants, invariants_of, product, with_wall};
use crate::common::{BUDGET, REST, near};
use rattlemap_dynamics::model::{Contact, Domain, Law, Pair, Side, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{GapEvent, Trajectory};
use rattlemap_dynamics::orbit::{Class, EventKind, Settings, Status, analyse_flow, measure};

/// Any law: elastic walls ignore it.
const LAW: Law = Law { restitution: [0.5; 2], mesh_speed: [0.01; 2] };

/// The unit tangents of one degree of freedom.
const UNITS: [State; 2] = [state(&[1.0]), state(&[0.0, 1.0])];

/// A bilinear oscillator: free motion, and motion behind an elastic wall on the right.
struct Bilinear {
    free: Linear,
    behind: Linear,
    oscillator: Pair,
}

fn bilinear(free: Linear, at: f64, stiffness: f64, damping: f64) -> Bilinear {
    let behind = Linear {
        gamma: free.gamma + 0.5 * damping,
        square: free.square + stiffness,
        load: free.load + stiffness * at,
        ..free
    };
    let oscillator = with_wall(free.oscillator(), Side::Right, at, Contact::Elastic, [stiffness, damping]);
    Bilinear { free, behind, oscillator }
}

/// Compares both flights between the two crossings of the wall with their closed forms. The monodromy matrix is the
/// product of both fundamental matrices and of the dampers' saltation matrices.
#[test]
fn a_bilinear_oscillator_agrees_with_two_linear_flights() {
    let mut damped = 0;
    for (gamma, square, omega, load, at, stiffness, damping) in [
        (0.05, 1.0, 0.8, 0.0, 0.0, 8.0, 0.0),
        (0.05, 1.0, 1.5, 0.0, 0.2, 8.0, 0.0),
        (0.05, 1.0, 2.1, 0.1, 0.0, 24.0, 1.5),
        (0.1, 1.0, 1.2, 0.0, -0.5, 3.0, 0.4),
        (0.02, 1.0, 1.3, -0.2, 0.5, 100.0, 6.0),
        // Negative damping, which the damper behind the wall outweighs; and a hill.
        (-0.02, 1.0, 1.5, 0.0, 0.2, 8.0, 1.5),
        (0.1, -0.3, 1.2, 1.0, 0.2, 8.0, 1.0),
        (-0.02, -0.3, 1.2, 1.0, 0.2, 8.0, 2.0),
    ] {
        let free = Linear { gamma, square, force: 1.0, load, omega };
        let Bilinear { free, behind, oscillator } = bilinear(free, at, stiffness, damping);
        let flow = Flow::new(&oscillator);
        let orbit = analyse_flow(&flow, LAW, REST, &Settings::default(), 8);
        let case = format!("gamma {gamma}, square {square}, omega {omega}: {orbit:?}");
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok), "{case}");
        assert_eq!((orbit.word.time_order().as_str(), orbit.impacts_per_period), ("12", 0.0), "{case}");
        let start =
            orbit.events.iter().find(|event| event.kind == EventKind::MeshStart).expect("goes behind");
        let end = orbit.events.iter().find(|event| event.kind == EventKind::MeshEnd).expect("comes back");
        assert_eq!((start.before, end.before), (start.after, end.after), "{case}");
        let period = flow.period;
        let behind_for = (end.t - start.t).rem_euclid(period);
        let flights = [(&behind, start, end, behind_for), (&free, end, start, period - behind_for)];
        for (linear, from, to, tau) in flights {
            let [x, v] = linear.flow([from.after[0], from.after[1]], from.t, tau);
            assert!(near(x, at, 1e-12) && near(v, to.before[1], 1e-12), "{x}, {v}: {case}");
        }
        assert!(near(orbit.mesh_fraction, behind_for / period, 1e-12), "{case}");
        let saltation = |sign: f64| [[1.0, 0.0], [sign * damping, 1.0]];
        let out = product(free.fundamental(period - behind_for), saltation(1.0));
        let monodromy = product(out, product(behind.fundamental(behind_for), saltation(-1.0)));
        let (ours, exact) =
            (invariants_of(orbit.floquet.as_deref().expect("a cycle")), invariants(monodromy));
        assert!((0..2).all(|i| near(ours[i], exact[i], 1e-11)), "{ours:?}, {exact:?}: {case}");
        damped += u32::from(damping > 0.0);
    }
    assert_eq!(damped, 6);
}

/// Returns the tangents, the state and the events of one period.
fn strobe(flow: &Flow, start: [f64; 2]) -> ([[f64; 2]; 2], [f64; 2], Vec<GapEvent>) {
    let mut trajectory = Trajectory::with_tangents(flow, LAW, state(&[start[0], start[1], 0.0, 0.0]), UNITS);
    let mut events = Vec::new();
    trajectory.advance_period(&mut events).expect("an ordinary cell");
    assert!(!trajectory.near_grazing(), "a crossing of an elastic wall is near grazing: {start:?}");
    let [a, b] = trajectory.tangents();
    let [x, v, ..] = trajectory.state();
    ([[a[0], b[0]], [a[1], b[1]]], [x, v], events)
}

fn apart(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Returns the derivative of the strobe map by central differences.
fn differences(flow: &Flow, [x, v]: [f64; 2], h: f64) -> [[f64; 2]; 2] {
    let column = |along: [f64; 2]| {
        let at = |h: f64| strobe(flow, [x + h * along[0], v + h * along[1]]).1;
        let (right, left) = (at(h), at(-h));
        [0, 1].map(|i| (right[i] - left[i]) / (2.0 * h))
    };
    let (a, b) = (column([1.0, 0.0]), column([0.0, 1.0]));
    [[a[0], b[0]], [a[1], b[1]]]
}

/// Without a damper the strobe map is continuously differentiable where the motion grazes the wall. Its derivative at grazing equals the
/// derivative of free motion, and nearby it differs by the root of the distance.
#[test]
fn the_strobe_map_is_smooth_at_grazing_a_spring() {
    let free = Linear { gamma: 0.05, square: 1.0, force: 1.0, load: 0.0, omega: 1.5 };
    let [amplitude, _] = free.response();
    let Bilinear { oscillator, .. } = bilinear(free, amplitude, 20.0, 0.0);
    let flow = Flow::new(&oscillator);
    let exact = free.fundamental(flow.period);
    let grazing = free.steady(0.0);
    let (at_grazing, ..) = strobe(&flow, grazing);
    assert!(apart(at_grazing, exact) < 1e-6, "{at_grazing:?}, {exact:?}");
    let (mut contacts, mut misses) = (0, 0);
    for power in 2..=10 {
        let h = 10f64.powi(-power);
        let root = 60.0 * h.sqrt();
        if power < 7 {
            let off = apart(differences(&flow, grazing, h), exact);
            assert!(off < root, "differences over {h:e}: {off:e}");
        }
        for sign in [1.0, -1.0] {
            let (tangents, _, events) = strobe(&flow, [grazing[0] + sign * h, grazing[1]]);
            let off = apart(tangents, exact);
            assert!(off < root, "{h:e} to the side: {off:e}");
            if events.is_empty() { misses += 1 } else { contacts += 1 }
        }
    }
    assert!(contacts >= 8 && misses >= 8, "{contacts} contacts, {misses} misses");
}

/// From rest on the wall, the gap follows the acceleration or its first nonzero derivative.
#[test]
fn a_start_at_rest_on_the_wall_follows_the_load() {
    for (load, force, behind) in [(0.5, 0.0, true), (-0.5, 0.0, false), (-1.0, 1.0, false), (1.0, -1.0, true)]
    {
        let free = Linear { gamma: 0.1, square: 1.0, force, load, omega: 1.0 };
        let Bilinear { oscillator, .. } = bilinear(free, 0.0, 50.0, 2.0);
        let flow = Flow::new(&oscillator);
        let mut trajectory = Trajectory::new(&flow, LAW, REST);
        let mut events: Vec<GapEvent> = Vec::new();
        trajectory.advance_to(0.1, &mut events).expect("an ordinary cell");
        assert_eq!(trajectory.meshing(), behind.then_some(Side::Right), "load {load}, force {force}");
        assert_eq!(trajectory.state()[0] > 0.0, behind);
        assert_eq!(events.len(), usize::from(behind), "{events:?}");
        assert!(!trajectory.near_grazing());
    }
}

fn linear(gamma: f64, square: f64) -> Linear {
    Linear { gamma, square, force: 0.0, load: 0.0, omega: 1.0 }
}

fn check_not_chaotic(oscillator: &Pair, law: Law, start: State) {
    let flow = Flow::new(oscillator);
    let found = measure(&flow, law, start, &BUDGET);
    let is_chaotic = found.period.is_none() && !found.is_quasi_periodic && found.status == Status::Ok;
    assert!(!is_chaotic, "{found:?}: {oscillator:?}");
    let orbit = analyse_flow(&flow, law, start, &Settings::default(), 4);
    assert!(!matches!(orbit.class, Class::Chaotic), "{orbit:?}");
}

/// Growth of rates between two walls is not chaos: impacts without loss, while negative damping supplies energy.
#[test]
#[ignore = "takes 20 s; scripts/test.sh --all"]
fn growth_of_rates_between_walls_is_not_chaos() {
    let mut driven = linear(-0.001, 1.0).oscillator();
    driven.walls = [1.0, -1.0];
    check_not_chaotic(&driven, Law::both(1.0, 0.0), state(&[0.3, 2.0]));
}

/// Growth without contact along one coordinate is not chaos; nor is rest on an unstable cycle.
#[test]
fn growth_that_contacts_do_not_share_is_not_chaos() {
    // A bouncing mass beside an uncoupled one that rests on the top of a hill.
    let mut pair = linear(0.05, 1.0).oscillator();
    (pair.degrees, pair.walls, pair.force) = (2, [0.5, -0.5], [2.0, 0.0]);
    pair.free.stiffness[1][1] = -0.2;
    let beside_a_hill = (pair, Law::both(0.7, 0.0), REST);
    // Rest behind a wall, where the hill is steeper than the contact's spring.
    let hill = Linear { load: -1.0, ..linear(0.0, -2.0) };
    let behind = with_wall(hill.oscillator(), Side::Right, 0.0, Contact::Elastic, [1.0, 0.0]);
    let at_rest = (behind, Law::both(0.0, 0.0), state(&[1.0]));
    for (oscillator, law, start) in [beside_a_hill, at_rest] {
        check_not_chaotic(&oscillator, law, start);
    }
}

/// The scale of an escape is not the distance of the walls, if that is much smaller than the motion.
#[test]
fn a_narrow_clearance_is_no_escape() {
    for clearance in [1e-4, 1e-10] {
        let mut pair = Linear { gamma: 0.05, square: 1.0, force: 1.0, load: 0.0, omega: 1.3 }.oscillator();
        (pair.degrees, pair.walls, pair.contacts) = (2, [clearance, -clearance], [Contact::Elastic; 2]);
        pair.gap = [1.0, -1.0];
        pair.free = Domain {
            damping: [[0.1, -0.06], [-0.06, 0.03]],
            stiffness: [[1.0, 0.0], [0.0, 1.0]],
            load: [0.0; 2],
        };
        let behind = |sign: f64| Domain {
            stiffness: [[31.0, -30.0], [-30.0, 31.0]],
            load: [sign * 30.0 * clearance, -sign * 30.0 * clearance],
            ..pair.free
        };
        pair.meshing = [behind(1.0), behind(-1.0)];
        let found = measure(&Flow::new(&pair), Law::both(0.0, 0.0), REST, &BUDGET);
        assert!(found.status != Status::Escape && found.period == Some(1), "{clearance}: {found:?}");
    }
}
