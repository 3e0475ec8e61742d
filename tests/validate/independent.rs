//! Compares the reference with a Runge-Kutta code that shares nothing with it. The equations of motion (11) to (13) are
//! written again here and integrated by DOP853, which also judges maps.
//!
//! Orbits are compared leg by leg: from the state after an event (or at a strobe) to the state before the next. So chaos
//! does not amplify differences of rounding.

use crate::common::pairs::OfPair;
use crate::common::{Leg, REST, departure, flow_of, legs, paper, sign};
use rattlemap::validate::independent::dop853::Integration;
use rattlemap_dynamics::model::{GearPair, State};
use rattlemap_dynamics::motion::{EventKind, GapEvent};
use rattlemap_dynamics::pair::DomainKind;

/// Relative and absolute tolerance of DOP853. At `1e-13` its error estimate is mere rounding and the step collapses, so a
/// cap on the step provides the last digits.
const TOLERANCE: f64 = 1e-12;

/// Longest step, times the fastest rate. At order 8 its error `0.1^9` is negligible.
const LONGEST_STEP: f64 = 0.1;

/// Largest difference at the end of a leg, relative to the larger of 1 and the largest entry. Rounding in the hundreds of
/// steps of DOP853 limits it: the worst leg is off by `3.1e-13`.
const AGREEMENT: f64 = 1e-12;

/// Distance behind a wall that a sampled solution may have: the accuracy of the dense output.
const STRAY: f64 = 1e-9;

/// Number of samples of the solution on one leg.
const SAMPLES: usize = 100;

/// Cells of every kind: restitution, frequency and the motion.
const CELLS: &[(f64, f64, &str)] = &[
    (0.0, 1.5, "meshing on both sides"),
    (0.2, 1.5, "chatter into meshing"),
    (0.56, 1.5, "long chatter into meshing"),
    (0.72, 1.5, "very long chatter into short meshing"),
    (0.0, 1.0, "meshing, slow forcing"),
    (0.5, 1.0, "chatter, slow forcing"),
    (0.9, 1.0, "impacts, slow forcing"),
    (0.99, 1.0, "impacts that hardly lose energy"),
    (0.2, 2.5, "chatter into meshing"),
    (0.56, 3.4, "impacts"),
    (0.0, 4.2, "meshing and free flights, near resonance"),
    (0.72, 4.2, "chaos near resonance"),
    (0.0, 5.6, "meshing on both sides"),
    (0.06, 5.6, "impacts and meshing"),
    (0.56, 5.6, "one impact per side"),
    (0.72, 5.6, "chaos"),
    (1.0, 5.6, "elastic impacts"),
    (0.2, 9.2, "impacts; a contact-free motion also exists"),
    (0.56, 11.0, "contact-free"),
];

/// The equations of motion of one domain, starting at a forcing phase.
#[derive(Clone, Copy)]
struct Motion {
    pair: GearPair,
    /// Wall on which the teeth mesh, `+1` or `-1`; `None` in free motion.
    wall: Option<f64>,
    phase: f64,
}

impl Motion {
    /// Returns the accelerations of both gears, (11) or (12) and (13).
    fn accelerations(&self, t: f64, [x1, v1, x2, v2]: [f64; 4]) -> [f64; 2] {
        let p = &self.pair;
        let contact = self.wall.map_or(0.0, |s| p.r * (v1 - v2) + p.k * (x1 - x2 - s * p.b));
        let drive = p.force * (p.omega * t + self.phase).cos();
        [(drive - p.r1 * v1 - p.k1 * x1 - contact) / p.m1, (contact - p.r2 * v2 - p.k2 * x2) / p.m2]
    }

    /// Returns the fastest rate of the undamped oscillators and of the forcing.
    fn fastest_rate(&self) -> f64 {
        let p = &self.pair;
        let supports = (p.k1 / p.m1).max(p.k2 / p.m2);
        let mesh = if self.wall.is_some() { p.k * (1.0 / p.m1 + 1.0 / p.m2) } else { 0.0 };
        (supports + mesh).sqrt().max(p.omega)
    }

    fn relative_acceleration(&self, t: f64, y: [f64; 4]) -> f64 {
        let [a1, a2] = self.accelerations(t, y);
        a1 - a2
    }
}

fn motion(pair: &GearPair, leg: &Leg) -> Motion {
    let wall = match leg.domain {
        DomainKind::Free => None,
        DomainKind::Meshing(side) => Some(sign(side)),
    };
    Motion { pair: *pair, wall, phase: pair.omega * leg.t }
}

/// Returns both displacements and their velocities.
fn first(y: State) -> [f64; 4] {
    std::array::from_fn(|i| y[i])
}

/// Returns the solution on a leg, at samples or at both ends.
fn integrate(motion: Motion, leg: &Leg, is_sampled: bool) -> Vec<(f64, [f64; 4])> {
    // There is no sample near the end, because the solver would extrapolate to it from an earlier step.
    let samples = is_sampled.then_some(leg.duration / (SAMPLES as f64 - 0.5));
    let integration =
        Integration { tolerance: TOLERANCE, longest: LONGEST_STEP / motion.fastest_rate(), samples };
    let [x1, v1, x2, v2] = first(leg.start);
    let rates = |&[x1, v1, x2, v2, t]: &[f64; 5]| {
        let [a1, a2] = motion.accelerations(t, [x1, v1, x2, v2]);
        [v1, a1, v2, a2, 1.0]
    };
    let solution = integration.run([x1, v1, x2, v2, 0.0], leg.duration, rates, |_, _| false);
    let samples = solution.expect("an ordinary leg").into_iter();
    samples.map(|(t, [x1, v1, x2, v2, _])| (t, [x1, v1, x2, v2])).collect()
}

/// Returns the end of a leg by DOP853.
fn end_of(motion: Motion, leg: &Leg) -> [f64; 4] {
    integrate(motion, leg, false).last().expect("at least the start").1
}

/// Returns pairs with parameters far from those of Table 1.
fn unusual_pairs() -> Vec<(GearPair, &'static str)> {
    let p = paper(0.3, 5.6);
    vec![
        (GearPair { m1: 10.0, m2: 0.1, ..p }, "heavy against light"),
        (GearPair { m1: 0.1, m2: 10.0, e: 0.0, ..p }, "light against heavy"),
        (GearPair { k: 1e5, e: 0.0, ..p }, "stiff mesh"),
        (GearPair { r: 20.0, e: 0.0, ..p }, "damped mesh"),
        (GearPair { r1: 0.0, r2: 0.0, r: 0.0, ..p }, "nothing damped"),
        (GearPair { k1: 0.0, r1: 2.0, ..p }, "one gear without a spring"),
        (GearPair { b: 1e-3, e: 0.8, ..p }, "narrow backlash"),
        (GearPair { mesh_speed: 1.0, omega: 2.0, ..p }, "long contact onsets"),
        (GearPair { force: 1e3, e: 0.9, ..p }, "strong force"),
    ]
}

/// Checks the legs of every cell from rest, in the first periods and after a transient.
fn every_leg(mut check: impl FnMut(&GearPair, &Leg, &str)) {
    let cells = CELLS.iter().map(|&(e, omega, what)| (paper(e, omega), what));
    for (pair, what) in cells.chain(unusual_pairs()) {
        let flow = flow_of(&pair);
        let (e, omega) = (pair.e, pair.omega);
        for skip in [0, 20] {
            let legs = legs(&flow, &pair, REST, skip, 4);
            for (i, leg) in legs.iter().enumerate() {
                check(&pair, leg, &format!("{what}: e = {e}, omega = {omega}, leg {i} after {skip} periods"));
            }
        }
    }
}

#[test]
fn every_leg_ends_where_dop853_does() {
    let (mut worst, mut count) = (0.0f64, 0);
    every_leg(|pair, leg, what| {
        let off = departure(end_of(motion(pair, leg), leg), first(leg.end));
        worst = worst.max(off);
        count += 1;
        assert!(off < AGREEMENT, "{what}: off by {off:.2e} in {leg:#?}");
    });
    println!("{count} legs, worst departure {worst:.2e}");
    // There are 2,824 legs. In chaos, rounding may change this number.
    assert!(count > 2700, "only {count} legs");
}

#[test]
fn no_event_is_missed() {
    every_leg(|pair, leg, what| {
        if leg.duration < 1e-9 {
            return;
        }
        let motion = motion(pair, leg);
        let mut onset_over = false;
        for (t, y) in integrate(motion, leg, true) {
            let z = y[0] - y[2];
            let Some(s) = motion.wall else {
                assert!(z.abs() <= pair.b + STRAY, "{what}: free gap {z} at {t} of {leg:#?}");
                continue;
            };
            let depth = s * z - pair.b;
            onset_over |= depth > STRAY;
            if onset_over {
                assert!(depth >= -STRAY, "{what}: meshing fell through its wall at {t} of {leg:#?}");
            } else if depth < -STRAY {
                let pressing = s * motion.relative_acceleration(t, y);
                assert!(
                    pressing > -STRAY,
                    "{what}: a change of sign of the contact force was missed at {t} of {leg:#?}"
                );
            }
        }
    });
}

#[test]
fn contact_onsets_are_as_short_as_the_leaving_speed_allows() {
    every_leg(|pair, leg, what| {
        let Some(begin) = leg.begins.filter(|event| event.kind == EventKind::MeshStart) else { return };
        if leg.duration < 1e-9 {
            return;
        }
        let motion = motion(pair, leg);
        let s = motion.wall.expect("meshing");
        // The gap opens by at most `w^2 / (2 a)` with the least closing acceleration on the way, which need not be the first.
        let mut least = f64::INFINITY;
        for (t, y) in integrate(motion, leg, true) {
            let leaving = s * (y[1] - y[3]) < 0.0;
            if !leaving {
                break;
            }
            least = least.min(s * motion.relative_acceleration(t, y));
            let (depth, bound) = (pair.b - s * (y[0] - y[2]), begin.after[1].powi(2) / (2.0 * least));
            assert!(depth <= bound + STRAY, "{what}: opens by {depth:.3e} > {bound:.3e} at {t} of {leg:#?}");
        }
    });
}

/// Applies the impact law (5), (6), (22) as the paper prints it.
fn impact_law(pair: &GearPair, [x1, v1, x2, v2]: [f64; 4]) -> [f64; 4] {
    let GearPair { m1, m2, e, .. } = *pair;
    let total = m1 + m2;
    [
        x1,
        ((m1 - m2 * e) * v1 + (1.0 + e) * m2 * v2) / total,
        x2,
        ((m2 - m1 * e) * v2 + (1.0 + e) * m1 * v1) / total,
    ]
}

#[test]
fn events_obey_the_laws_of_contact() {
    let mut counts = [0usize; 3];
    every_leg(|pair, leg, what| {
        let Some(event) = leg.ends else { return };
        let s = sign(event.side);
        let flow = flow_of(pair);
        let (before, after) = (first(flow.to_state(event.before)), first(flow.to_state(event.after)));
        let phase = pair.omega * event.t;
        let free = Motion { pair: *pair, wall: None, phase };
        let meshing = Motion { pair: *pair, wall: Some(s), phase };
        let rounding = 4.0 * f64::EPSILON * before.iter().fold(1.0f64, |m, x| m.max(x.abs()));
        let on_the_wall = (s * (before[0] - before[2]) - pair.b).abs() <= rounding;
        counts[event.kind as usize] += 1;
        if event.kind == EventKind::MeshEnd {
            assert_eq!(event.before, event.after, "{what}: {event:?}");
            if on_the_wall {
                assert!(s * event.before[1] <= 0.0, "{what}: {event:?}");
            } else {
                // The contact force changed sign during the contact onset.
                let pressing = meshing.relative_acceleration(0.0, before);
                assert!(s * event.before[0] < pair.b && pressing.abs() < 1e-9, "{what}: {event:?}");
            }
            return;
        }
        assert!(on_the_wall, "{what}: {event:?}");
        assert_eq!(event.before[0], s * pair.b, "{what}: the gap is not exactly on the wall");
        assert!(s * event.before[1] >= 0.0, "{what}: not closing, {event:?}");
        let law = departure(impact_law(pair, before), after);
        assert!(law < 4.0 * f64::EPSILON, "{what}: off the impact law by {law:.2e}, {event:?}");

        // Rule (37), with a tolerance for rounding on both sides.
        let leaving = pair.e * event.before[1].abs();
        let pressing = [free, meshing]
            .map(|m| s * m.relative_acceleration(0.0, after))
            .into_iter()
            .fold(f64::MAX, f64::min);
        if event.kind == EventKind::MeshStart {
            assert!(leaving <= pair.mesh_speed && pressing > -1e-10, "{what}: should not mesh, {event:?}");
        } else {
            assert!(leaving > pair.mesh_speed || pressing < 1e-10, "{what}: should mesh, {event:?}");
        }
    });
    assert!(counts.iter().all(|&count| count > 50), "too few events of some kind: {counts:?}");
}

#[test]
fn flights_are_named_after_their_walls() {
    let name = |from: &GapEvent, to: &GapEvent| match (from.kind, sign(from.side), sign(to.side)) {
        (EventKind::MeshStart, 1.0, _) => b'1',
        (EventKind::MeshStart, ..) => b'4',
        (_, 1.0, 1.0) => b'2',
        (_, 1.0, _) => b'3',
        (_, _, 1.0) => b'6',
        _ => b'5',
    };
    for &(e, omega, what) in CELLS {
        let pair = paper(e, omega);
        let flow = flow_of(&pair);
        let events: Vec<GapEvent> =
            legs(&flow, &pair, REST, 0, 10).into_iter().filter_map(|leg| leg.ends).collect();
        assert!(events.first().is_none_or(|event| event.symbol.is_none()), "{what}");
        for pair in events.windows(2) {
            assert_eq!(pair[1].symbol, Some(name(&pair[0], &pair[1])), "{what}: {pair:#?}");
        }
    }
}
