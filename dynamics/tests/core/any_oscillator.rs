//! What must hold for every oscillator: any masses, any gap row, any walls with any contacts and laws.

use crate::common::linear::with_wall;
use proptest::prelude::*;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Contact, Domain, Law, Oscillator, Side, State};
use rattlemap_dynamics::reference::{EventKind, GapEvent, Stop, Trajectory};

type Matrix = [[f64; 2]; 2];

/// An oscillator, its law and a start.
#[derive(Clone, Copy, Debug)]
struct Case {
    oscillator: Oscillator,
    law: Law,
    start: State,
    /// Stiffness and damping behind the right and the left wall.
    behind: [[f64; 2]; 2],
}

/// Motions whose tangents grow by more are left out where two computations of one are compared.
const GROWTH: f64 = 1e4;

/// Above this many events in the time compared, rounding may have passed through an instability that was damped before.
const COMPARED: usize = 12;

const UNITS: [State; 4] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// Now and then nothing at all, which is a case of its own.
fn or_none(values: impl Strategy<Value = f64> + 'static) -> impl Strategy<Value = f64> {
    prop_oneof![3 => values.boxed(), 1 => Just(0.0).boxed()]
}

fn logarithmic(low: f64, high: f64) -> impl Strategy<Value = f64> {
    (low.ln()..high.ln()).prop_map(f64::exp)
}

/// `a L L^T` of a lower triangle: semidefinite of any rank.
fn semidefinite(largest: f64) -> impl Strategy<Value = Matrix> {
    (or_none(0.0..1.0), or_none(-1.0..1.0), or_none(0.0..1.0)).prop_map(move |(a, b, c)| {
        let a = if a == 0.0 { b.abs() } else { a };
        [[largest * a * a, largest * a * b], [largest * a * b, largest * (b * b + c * c)]]
    })
}

fn masses() -> impl Strategy<Value = Matrix> {
    (logarithmic(0.4, 3.0), or_none(-0.8..0.8), logarithmic(0.4, 3.0))
        .prop_map(|(a, b, c)| [[a * a, a * b], [a * b, b * b + c * c]])
}

fn gap_rows() -> impl Strategy<Value = [f64; 2]> {
    prop_oneof![
        Just([1.0, -1.0]),
        Just([0.0, 1.0]),
        (0.3..2.0, -2.0..2.0f64).prop_map(|(a, b)| [a, b]),
        (-2.0..2.0, -2.0..-0.3f64).prop_map(|(a, b)| [a, b]),
    ]
}

fn contacts() -> impl Strategy<Value = Contact> {
    prop_oneof![Just(Contact::Impact), Just(Contact::Rigid), Just(Contact::Elastic)]
}

/// Right, left or both, at least a tenth apart.
fn walls() -> impl Strategy<Value = [f64; 2]> {
    (0..4u32, -0.5..1.5f64, 0.1..2.0f64).prop_map(|(which, right, apart)| match which {
        0 => [right, f64::NEG_INFINITY],
        1 => [f64::INFINITY, -right],
        _ => [right, right - apart],
    })
}

fn laws() -> impl Strategy<Value = Law> {
    let restitution = || or_none(prop_oneof![4 => 0.0..1.0, 1 => Just(1.0)]);
    let mesh_speed = || or_none(0.0..0.1);
    ([restitution(), restitution()], [mesh_speed(), mesh_speed()])
        .prop_map(|(restitution, mesh_speed)| Law { restitution, mesh_speed })
}

fn cases() -> impl Strategy<Value = Case> {
    let motion = (masses(), semidefinite(3.0), semidefinite(40.0), gap_rows());
    let forcing =
        ([or_none(-20.0..20.0), or_none(-20.0..20.0)], [or_none(-5.0..5.0), or_none(-5.0..5.0)], 0.6..8.0);
    let behind = || (logarithmic(10.0, 3e3), or_none(0.0..5.0)).prop_map(|(k, c)| [k, c]);
    let walls = (walls(), [contacts(), contacts()], [behind(), behind()]);
    let start = prop::array::uniform4(-1.0..1.0f64);
    (prop::bool::weighted(0.25), motion, forcing, walls, laws(), start).prop_map(
        |(
            is_single,
            (mass, damping, stiffness, gap),
            (force, load, omega),
            (at, contacts, behind),
            law,
            y,
        )| {
            let free = Domain { damping, stiffness, load };
            let mut oscillator = Oscillator {
                degrees: 2,
                mass,
                gap,
                walls: [f64::INFINITY, f64::NEG_INFINITY],
                contacts,
                omega,
                force,
                free,
                meshing: [free; 2],
            };
            let mut start = [y[0], 3.0 * y[1], y[2], 3.0 * y[3]];
            if is_single {
                let first = |m: Matrix| [[m[0][0], 0.0], [0.0, 0.0]];
                let free =
                    Domain { damping: first(damping), stiffness: first(stiffness), load: [load[0], 0.0] };
                oscillator = Oscillator {
                    degrees: 1,
                    mass: [[mass[0][0], 0.0], [0.0, 1.0]],
                    gap: [if gap[0] == 0.0 { -1.0 } else { gap[0] }, 0.0],
                    force: [force[0], 0.0],
                    free,
                    meshing: [free; 2],
                    ..oscillator
                };
                start = [y[0], 3.0 * y[1], 0.0, 0.0];
            }
            Case { oscillator: walled(oscillator, at, contacts, behind), law, start, behind }
        },
    )
}

fn walled(plain: Oscillator, at: [f64; 2], contacts: [Contact; 2], behind: [[f64; 2]; 2]) -> Oscillator {
    Side::BOTH.into_iter().fold(plain, |oscillator, side| {
        let i = side.index();
        if at[i].is_finite() {
            with_wall(oscillator, side, at[i], contacts[i], behind[i])
        } else {
            oscillator
        }
    })
}

/// What the motion may differ by from another computation of it: rounding, times the growth of tangents.
fn growth<const N: usize>(trajectory: &Trajectory<'_, N>) -> f64 {
    let largest = trajectory.tangents().iter().flatten().fold(0.0f64, |most, x| most.max(x.abs()));
    (largest * trajectory.log_scale().exp()).max(1.0)
}

fn apart(a: State, b: State) -> f64 {
    let size = a.iter().chain(&b).fold(1.0f64, |m, x| m.max(x.abs()));
    a.iter().zip(&b).map(|(x, y)| (x - y).abs()).fold(0.0, |m, d| if d.is_nan() || d > m { d } else { m })
        / size
}

fn size(y: State) -> f64 {
    y.iter().fold(1.0, |m, x| m.max(x.abs()))
}

fn flow_of(case: &Case) -> Flow {
    case.oscillator.validate().unwrap_or_else(|error| panic!("{error}: {case:?}"));
    Flow::new(&case.oscillator)
}

/// Whether some event decides by a threshold that it passes narrowly.
fn is_narrow(case: &Case, events: &[GapEvent]) -> bool {
    events.iter().any(|event| {
        let i = event.side.index();
        let leaving = case.law.restitution[i] * event.before[1].abs();
        let is_impact = case.oscillator.contacts[i] != Contact::Elastic && event.kind != EventKind::MeshEnd;
        is_impact && case.law.mesh_speed[i] > 0.0 && (leaving - case.law.mesh_speed[i]).abs() < 1e-6
    })
}

/// Which events there are, and at which walls.
fn kinds(events: &[GapEvent]) -> Vec<(EventKind, Side)> {
    events.iter().map(|event| (event.kind, event.side)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, max_global_rejects: 40_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Free, the gap lies between the walls; stuck, on its wall to the bit; behind an elastic wall, behind it.
    #[test]
    fn the_gap_is_where_its_mode_says(case in cases()) {
        let flow = flow_of(&case);
        let mut trajectory = Trajectory::new(&flow, case.law, case.start);
        for _ in 0..3 {
            for part in 1..=40 {
                let until = flow.period * f64::from(part) / 40.0;
                let advanced = if part == 40 { trajectory.advance_period(&mut ()) } else { trajectory.advance_to(until, &mut ()) };
                prop_assume!(advanced != Err(Stop::CapEvents));
                prop_assert_eq!(advanced, Ok(()));
                let y = trajectory.state();
                let gap = flow.to_gap(y);
                let rounding = 1e-12 * size(y);
                match trajectory.meshing() {
                    None => {
                        prop_assert!(gap[0] <= flow.wall(Side::Right) + rounding, "{gap:?}");
                        prop_assert!(gap[0] >= flow.wall(Side::Left) - rounding, "{gap:?}");
                    }
                    Some(side) => {
                        let beyond = side.sign() * (gap[0] - flow.wall(side));
                        match case.oscillator.contacts[side.index()] {
                            Contact::Rigid => prop_assert!(beyond.abs() <= rounding && gap[1].abs() <= rounding, "{gap:?}"),
                            Contact::Elastic => prop_assert!(beyond >= -rounding, "{gap:?}"),
                            Contact::Impact => {}
                        }
                    }
                }
                if case.oscillator.degrees == 1 {
                    prop_assert_eq!([y[2], y[3]], [0.0; 2]);
                }
            }
        }
    }

    /// Contacts that last end before anything else; symbols name the flight between two walls; the law holds.
    #[test]
    fn words_and_laws_are_those_of_the_events(case in cases()) {
        let flow = flow_of(&case);
        let mut trajectory = Trajectory::new(&flow, case.law, case.start);
        let mut events: Vec<GapEvent> = Vec::new();
        let mut meshing = trajectory.meshing();
        let mut origin = meshing;
        for _ in 0..4 {
            prop_assume!(trajectory.advance_period(&mut events) != Err(Stop::CapEvents));
        }
        let inverse = case.oscillator.mobility(case.oscillator.gap);
        for event in events.iter().take(300) {
            let side = event.side;
            let i = side.index();
            let right = side == Side::Right;
            let expected = match (meshing, origin) {
                (Some(side), _) => Some(if side == Side::Right { b'1' } else { b'4' }),
                (None, Some(Side::Right)) => Some(if right { b'2' } else { b'3' }),
                (None, Some(Side::Left)) => Some(if right { b'6' } else { b'5' }),
                (None, None) => None,
            };
            // Where a start on a wall comes from is told by no event.
            if meshing.is_some() || origin.is_some() {
                prop_assert_eq!(event.symbol, expected, "{:?}", event);
            }
            prop_assert_eq!(event.kind == EventKind::MeshEnd, meshing.is_some(), "{:?}", event);
            let (w, contact) = (event.before[1], case.oscillator.contacts[i]);
            let kept = match (event.kind, contact) {
                (EventKind::MeshEnd, _) => {
                    prop_assert_eq!(Some(side), meshing);
                    -1.0
                }
                (EventKind::Impact, _) => {
                    prop_assert!(contact != Contact::Elastic);
                    case.law.restitution[i]
                }
                (EventKind::MeshStart, Contact::Impact) => case.law.restitution[i],
                (EventKind::MeshStart, Contact::Rigid) => 0.0,
                (EventKind::MeshStart, Contact::Elastic) => -1.0,
            };
            prop_assert!((event.after[1] + kept * w).abs() <= 1e-15 * w.abs(), "{event:?}");
            let (before, after) = (flow.to_state(event.before), flow.to_state(event.after));
            let carried = 1e-13 * size(before).max(size(after)) * case.oscillator.mass.as_flattened().iter().fold(1.0, |m: f64, x| m.max(x.abs())) * 8.0;
            prop_assert!((flow.momentum(after) - flow.momentum(before)).abs() <= carried, "{event:?}");
            let lost = flow.kinetic_energy(before) - flow.kinetic_energy(after);
            let exact = 0.5 * w * w * (1.0 - kept * kept) / inverse;
            prop_assert!((lost - exact).abs() <= carried * size(before).max(size(after)), "lost {lost:e}, {exact:e}: {event:?}");
            meshing = (event.kind == EventKind::MeshStart).then_some(side);
            origin = Some(side);
        }
    }

    /// Carried along, tangents are the derivative of the strobe map, by central differences of fourth order.
    #[test]
    fn tangents_are_derivatives(case in cases()) {
        let flow = flow_of(&case);
        // Off what a start may lie on, and into a domain.
        let mut settled = Trajectory::new(&flow, case.law, case.start);
        prop_assume!(settled.advance_period(&mut ()) != Err(Stop::CapEvents));
        let y = settled.state();
        // A neighbour that begins behind a wall is put on it: so near to one there is a derivative on one side alone.
        let gap = flow.to_gap(y)[0];
        let is_beside = |side: Side| (gap - flow.wall(side)).abs() < 1e-4 * size(y);
        let sticks = settled.meshing().is_some_and(|side| case.oscillator.contacts[side.index()] == Contact::Rigid);
        prop_assume!(sticks || !Side::BOTH.into_iter().any(is_beside));
        let mut carrier = settled.at(y, UNITS);
        let mut events: Vec<GapEvent> = Vec::new();
        prop_assume!(carrier.advance_period(&mut events) != Err(Stop::CapEvents));
        prop_assume!(!carrier.near_grazing() && growth(&carrier) < GROWTH && events.len() <= 3 * COMPARED);
        // Closed series of impacts are as good as the square of their length.
        let is_closed = |event: &GapEvent| event.kind == EventKind::MeshStart && event.before[1] == 0.0;
        prop_assume!(!events.iter().any(is_closed) && !is_narrow(&case, &events));
        // Slow crossings bend the map within the width of the differences.
        let is_slow = |event: &GapEvent| event.kind != EventKind::MeshEnd && event.before[1].abs() < 0.05;
        prop_assume!(!events.iter().any(is_slow));
        const H: f64 = 1e-6;
        let tangents = carrier.tangents().map(|u| u.map(|x| x * carrier.log_scale().exp()));
        let degrees = case.oscillator.degrees;
        for (j, tangent) in tangents.into_iter().enumerate().take(2 * degrees) {
            let mut ends = [[0.0; 4]; 4];
            for (end, h) in ends.iter_mut().zip([H, -H, 2.0 * H, -2.0 * H]) {
                let moved = std::array::from_fn(|i| y[i] + if i == j { h } else { 0.0 });
                let mut neighbour = settled.at::<0>(moved, []);
                let mut met: Vec<GapEvent> = Vec::new();
                prop_assume!(neighbour.advance_period(&mut met) != Err(Stop::CapEvents));
                // Another branch of the map.
                prop_assume!(kinds(&met) == kinds(&events));
                *end = neighbour.state();
            }
            for i in 0..4 {
                let central = |k: usize, h: f64| (ends[k][i] - ends[k + 1][i]) / (2.0 * h);
                let (near, far) = (central(0, H), central(2, 2.0 * H));
                let difference = (4.0 * near - far) / 3.0;
                // Where the two disagree the map bends too much to tell.
                prop_assume!((near - far).abs() < 1e-4 * growth(&carrier));
                let off = (difference - tangent[i]).abs();
                prop_assert!(off < 1e-6 * growth(&carrier) * size(y), "column {j}, {i}: {difference} for {}", tangent[i]);
            }
        }
    }

    /// Begun anew at a phase 0, from state and contact, it goes on as it would.
    #[test]
    fn a_restart_at_phase_0_goes_on(case in cases(), after in 1..4u32) {
        let flow = flow_of(&case);
        let mut whole = Trajectory::new(&flow, case.law, case.start);
        for _ in 0..after {
            prop_assume!(whole.advance_period(&mut ()) != Err(Stop::CapEvents));
        }
        // A gap just behind its wall may be on its way there or back: state and contact do not tell.
        let is_onset = whole.meshing().is_some_and(|side| {
            let short = side.sign() * (flow.to_gap(whole.state())[0] - flow.wall(side));
            case.oscillator.contacts[side.index()] == Contact::Impact && short < 1e-9
        });
        prop_assume!(!is_onset);
        let mut anew = Trajectory::meshing_from(&flow, case.law, whole.state(), whole.meshing());
        let mut carrier = whole.carrying(UNITS);
        carrier.clear_near_grazing();
        let (mut first, mut second): (Vec<GapEvent>, Vec<GapEvent>) = (Vec::new(), Vec::new());
        prop_assume!(carrier.advance_period(&mut first) != Err(Stop::CapEvents));
        prop_assume!(anew.advance_period(&mut second) != Err(Stop::CapEvents));
        prop_assume!(!carrier.near_grazing() && growth(&carrier) < GROWTH && !is_narrow(&case, &first));
        prop_assume!(first.len() <= COMPARED);
        prop_assert_eq!(kinds(&first), kinds(&second));
        prop_assert_eq!(carrier.meshing(), anew.meshing());
        let off = apart(carrier.state(), anew.state());
        prop_assert!(off < 1e-11 * growth(&carrier) * size(carrier.state()), "off by {off:e}");
    }

    /// Powers of two as units of length and time change no bit of any event.
    #[test]
    fn units_change_no_bit(case in cases(), length in -20..=20i32, time in -8..=8i32) {
        let (length, rate) = (2f64.powi(length), 2f64.powi(time));
        let force = length * rate * rate;
        let domain = |d: &Domain| Domain {
            damping: d.damping.map(|row| row.map(|c| rate * c)),
            stiffness: d.stiffness.map(|row| row.map(|k| rate * rate * k)),
            load: d.load.map(|f| force * f),
        };
        let o = &case.oscillator;
        let scaled = Oscillator {
            walls: o.walls.map(|wall| length * wall),
            omega: rate * o.omega,
            force: o.force.map(|f| force * f),
            free: domain(&o.free),
            meshing: [domain(&o.meshing[0]), domain(&o.meshing[1])],
            ..*o
        };
        prop_assert_eq!(scaled.length_scale(), length * o.length_scale());
        let unit = [length, length * rate, length, length * rate];
        let times = |y: State, unit: State| std::array::from_fn::<f64, 4, _>(|i| y[i] * unit[i]);
        let law = Law { mesh_speed: case.law.mesh_speed.map(|speed| length * rate * speed), ..case.law };
        let run = |oscillator: &Oscillator, law: Law, start: State| {
            let flow = Flow::new(oscillator);
            let mut trajectory = Trajectory::new(&flow, law, start);
            let mut events: Vec<GapEvent> = Vec::new();
            for _ in 0..3 {
                let advanced = trajectory.advance_period(&mut events);
                assert!(matches!(advanced, Ok(()) | Err(Stop::CapEvents)), "{advanced:?}");
            }
            (trajectory.state(), events)
        };
        let (ours, events) = run(o, case.law, case.start);
        let (theirs, images) = run(&scaled, law, times(case.start, unit));
        prop_assert_eq!(theirs, times(ours, unit));
        prop_assert_eq!(kinds(&images), kinds(&events));
        for (image, event) in images.iter().zip(&events) {
            prop_assert_eq!(image.before, times(event.before, unit));
            prop_assert_eq!(image.t * rate, event.t);
        }
    }

    /// In other coordinates, `x = A u`, it is the same motion: full mass matrices and any gap row.
    #[test]
    fn coordinates_do_not_matter(case in cases(), a in prop::array::uniform4(-1.0..1.0f64)) {
        prop_assume!(case.oscillator.degrees == 2);
        // Where a start behind a rigid wall begins is a matter of coordinates.
        let begins_on = |side: Side| {
            let [g0, g1] = case.oscillator.gap;
            let beyond = side.sign() * (g0 * case.start[0] + g1 * case.start[2] - case.oscillator.walls[side.index()]);
            case.oscillator.contacts[side.index()] == Contact::Rigid && beyond > 0.0
        };
        prop_assume!(!Side::BOTH.into_iter().any(begins_on));
        let a: Matrix = [[1.5 + a[0], a[1]], [a[2], 1.5 + a[3]]];
        let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
        prop_assume!(determinant.abs() > 0.2);
        let row = |f: [f64; 2]| [f[0] * a[0][0] + f[1] * a[1][0], f[0] * a[0][1] + f[1] * a[1][1]];
        let congruent = |m: Matrix| -> Matrix {
            let half = m.map(row);
            let whole: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| a[0][i] * half[0][j] + a[1][i] * half[1][j]));
            // Symmetric to the bit.
            [[whole[0][0], whole[0][1]], [whole[0][1], whole[1][1]]]
        };
        let o = &case.oscillator;
        let free = Domain { damping: congruent(o.free.damping), stiffness: congruent(o.free.stiffness), load: row(o.free.load) };
        let plain = Oscillator {
            mass: congruent(o.mass),
            gap: row(o.gap),
            walls: [f64::INFINITY, f64::NEG_INFINITY],
            force: row(o.force),
            free,
            meshing: [free; 2],
            ..*o
        };
        let other = walled(plain, o.walls, o.contacts, case.behind);
        // Rounding may make a singular matrix indefinite.
        prop_assume!(other.validate().is_ok());
        let back = |x: [f64; 2]| [
            (a[1][1] * x[0] - a[0][1] * x[1]) / determinant,
            (a[0][0] * x[1] - a[1][0] * x[0]) / determinant,
        ];
        let forth = |u: [f64; 2]| [a[0][0] * u[0] + a[0][1] * u[1], a[1][0] * u[0] + a[1][1] * u[1]];
        let each = |map: &dyn Fn([f64; 2]) -> [f64; 2], y: State| {
            let (x, v) = (map([y[0], y[2]]), map([y[1], y[3]]));
            [x[0], v[0], x[1], v[1]]
        };
        let (flow, other_flow) = (Flow::new(o), Flow::new(&other));
        let mut ours = Trajectory::with_tangents(&flow, case.law, case.start, UNITS);
        let mut theirs = Trajectory::new(&other_flow, case.law, each(&back, case.start));
        let (mut events, mut images): (Vec<GapEvent>, Vec<GapEvent>) = (Vec::new(), Vec::new());
        prop_assume!(ours.advance_period(&mut events) != Err(Stop::CapEvents));
        prop_assume!(theirs.advance_period(&mut images) != Err(Stop::CapEvents));
        prop_assume!(!ours.near_grazing() && growth(&ours) < GROWTH && !is_narrow(&case, &events));
        prop_assume!(events.len() <= COMPARED);
        prop_assert_eq!(kinds(&events), kinds(&images));
        let off = apart(each(&forth, theirs.state()), ours.state());
        prop_assert!(off < 1e-10 * growth(&ours) * size(ours.state()), "off by {off:e}");
    }

    /// Nothing dissipates, nothing drives, and what the springs behind elastic walls take they give back.
    #[test]
    fn energy_is_kept_where_nothing_takes_it(case in cases()) {
        let o = &case.oscillator;
        let none = [[0.0; 2]; 2];
        let free = Domain { damping: none, ..o.free };
        let contacts = o.contacts.map(|contact| if contact == Contact::Elastic { contact } else { Contact::Impact });
        let plain = Oscillator { walls: [f64::INFINITY, f64::NEG_INFINITY], force: [0.0; 2], free, meshing: [free; 2], ..*o };
        let behind = case.behind.map(|[k, _]| [k, 0.0]);
        let conservative = walled(plain, o.walls, contacts, behind);
        let flow = Flow::new(&conservative);
        let energy = |y: State| {
            let x = [y[0], y[2]];
            let k = free.stiffness;
            let potential = 0.5 * (x[0] * (k[0][0] * x[0] + k[0][1] * x[1]) + x[1] * (k[1][0] * x[0] + k[1][1] * x[1]));
            let load = free.load[0] * x[0] + free.load[1] * x[1];
            let gap = flow.to_gap(y)[0];
            let spring = |side: Side| {
                let depth = (side.sign() * (gap - flow.wall(side))).max(0.0);
                if depth.is_finite() { 0.5 * behind[side.index()][0] * depth * depth } else { 0.0 }
            };
            flow.kinetic_energy(y) + potential - load + spring(Side::Right) + spring(Side::Left)
        };
        // A lasting contact is elastic, or compliant; both have springs, and none begins on an impact wall.
        let law = Law::both(1.0, 0.0);
        let mut trajectory = Trajectory::new(&flow, law, case.start);
        let mut events: Vec<GapEvent> = Vec::new();
        let before = energy(trajectory.state());
        for _ in 0..3 {
            prop_assume!(trajectory.advance_period(&mut events).is_ok());
        }
        let y = trajectory.state();
        let scale = flow.kinetic_energy(y) + energy(y).abs() + before.abs() + size(y).powi(2) * 50.0;
        let steps = 1.0 + events.len() as f64;
        prop_assert!((energy(y) - before).abs() < 1e-13 * steps * scale * 10.0, "{before} to {} over {} events", energy(y), events.len());
    }
}
