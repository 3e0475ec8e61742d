//! Measured quantities: energy balance, closed forms, and dense samples of the same motion.

use crate::common::linear::{Linear, with_law, with_wall};
use crate::common::pairs::{OfPair, described};
use crate::common::{BUDGET, REST, near, paper};
use rattlemap_dynamics::model::{Contact, GearPair, Law, Pair, Side, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{
    Budget, Class, EventKind, Orbit, Quantities, Settings, analyse, analyse_flow, measure, trace,
};

fn quantities(orbit: &Orbit) -> Quantities {
    orbit.quantities.expect("the motion is measured")
}

/// Returns the power of the force `amplitude cos(omega t)` on one displacement.
fn power(amplitude: f64, omega: f64, [size, phase]: [f64; 2]) -> f64 {
    -0.5 * amplitude * omega * size * phase.sin()
}

/// Meshing, impacts, chatter, period 1 to 3, with two displacements.
#[test]
fn the_work_of_the_force_is_what_dampers_and_contacts_take() {
    let mut impacts = 0;
    for (e, omega) in [(0.06, 5.6), (0.605, 5.6), (0.72, 1.5), (0.3, 3.0), (0.8, 4.4), (0.5, 11.5)] {
        let pair = paper(e, omega);
        let orbit = analyse(&pair, REST, &Settings::default()).unwrap();
        let of = quantities(&orbit);
        let case = format!("{e} {omega} {:?}: {of:?}", orbit.class);
        let work = power(pair.force, omega, of.displacements[0].harmonic);
        if matches!(orbit.class, Class::Periodic { .. }) {
            assert!(near(work, of.dissipated + of.impact_energy, 1e-10 * work), "{work} {case}");
            let hits = |side: Option<Side>| {
                let at = |s: Side| side.is_none_or(|side| side == s);
                let hits =
                    orbit.events.iter().filter(|event| event.kind != EventKind::MeshEnd && at(event.side));
                hits.count() as u64
            };
            let expected = [Some(Side::Right), Some(Side::Left), None].map(hits);
            assert_eq!(of.approaches.map(|approaches| approaches.count), expected, "{case}");
            impacts += of.approaches[2].count;
        }
        let cell =
            measure(&Flow::of(&pair).unwrap(), pair.law(), REST, &Budget { quantities: true, ..BUDGET });
        if let (Class::Periodic { period }, Some(also)) = (orbit.class, cell.quantities) {
            assert_eq!(cell.period, Some(period), "{case}");
            assert!(near(also.impact_energy, of.impact_energy, 1e-8 * work), "{also:?} {case}");
            let [first, ..] = orbit.floquet.unwrap()[..] else { unreachable!("there are four") };
            let [modulus, argument] = cell.multiplier.unwrap();
            assert!(near(modulus, first[0].hypot(first[1]), 1e-6), "{modulus} {case}");
            assert!(near(argument.abs(), first[1].atan2(first[0]).abs(), 1e-4), "{argument} {case}");
        }
    }
    assert!(impacts > 10, "{impacts}");
}

#[test]
fn quantities_are_those_of_dense_samples() {
    let pair = GearPair { r2: 0.5, ..paper(0.06, 5.6) };
    let orbit = analyse(&pair, REST, &Settings::default()).unwrap();
    let Class::Periodic { period } = orbit.class else { panic!("{orbit:?}") };
    let samples = trace(&pair, orbit.strobe, orbit.strobe_meshing, period, 200_000).unwrap();
    let count = (samples.len() - 1) as f64;
    let of = quantities(&orbit);
    for (i, displacement) in of.displacements.iter().take(3).enumerate() {
        let value = |y: &State| [y[0], y[2], y[0] - y[2]][i];
        let values = || samples[1..].iter().map(|sample| value(&sample.state));
        let mean = values().sum::<f64>() / count;
        let rms = (values().map(|x| x * x).sum::<f64>() / count).sqrt();
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        let low = values().fold(f64::INFINITY, f64::min);
        let sum = |phase: fn(f64) -> f64| {
            let parts = samples[1..].iter().map(|sample| value(&sample.state) * phase(pair.omega * sample.t));
            2.0 * parts.sum::<f64>() / count
        };
        let (cos, sin) = (sum(f64::cos), sum(f64::sin));
        let case = format!("{i}: {displacement:?}");
        assert!(near(displacement.mean, mean, 1e-7), "{mean} {case}");
        assert!(near(displacement.rms, rms, 1e-7), "{rms} {case}");
        let excess = displacement.amplitude - 0.5 * (high - low);
        assert!((-1e-15..1e-5).contains(&excess), "{excess} {case}");
        assert!(near(displacement.harmonic[0] * displacement.harmonic[1].cos(), cos, 1e-6), "{cos} {case}");
        assert!(near(-displacement.harmonic[0] * displacement.harmonic[1].sin(), sin, 1e-6), "{sin} {case}");
    }
}

/// Linear motion without contact, `x = a cos(omega t + phi) + load / k`.
#[test]
fn amplitudes_of_linear_motion_are_exact() {
    let linear = Linear { gamma: 0.05, square: 1.0, force: 0.4, load: 0.3, omega: 1.7 };
    let oscillator = with_wall(linear.oscillator(), Side::Right, 5.0, Contact::Impact, [10.0, 0.1]);
    let law = Law::both(0.5, 0.0);
    let flow = Flow::new(&oscillator);
    let dynamic: [f64; 2] = [1.0 - 1.7 * 1.7, 2.0 * 0.05 * 1.7];
    let size = 0.4 / dynamic[0].hypot(dynamic[1]);
    let orbit = analyse_flow(&flow, law, REST, &Settings::default(), 8);
    let cell = measure(&flow, law, REST, &Budget { quantities: true, ..BUDGET });
    for of in [quantities(&orbit), cell.quantities.unwrap()] {
        for displacement in [of.displacements[0], of.displacements[2]] {
            assert!(near(displacement.amplitude, size, 1e-13), "{displacement:?}");
            assert!(near(displacement.mean, 0.3, 1e-14), "{displacement:?}");
            assert!(near(displacement.rms, 0.3f64.hypot(size / 2f64.sqrt()), 1e-13), "{displacement:?}");
            assert!(near(displacement.harmonic[0], size, 1e-13), "{displacement:?}");
            assert!(near(displacement.harmonic[1], -dynamic[1].atan2(dynamic[0]), 1e-13), "{displacement:?}");
        }
        assert_eq!((of.approaches[2].count, of.contact_force), (0, None));
        // The mean of the damper's power is c v^2, with v = a omega / sqrt 2.
        assert!(near(of.dissipated, 2.0 * 0.05 * 0.5 * (size * 1.7).powi(2), 1e-13), "{of:?}");
    }
}

/// A ball on a table that vibrates with the acceleration `gamma cos(omega t)`, in the frame of the table. On a cycle of
/// period 1 with one impact, the impulse balances the weight: `(1 + e) w = g T`.
#[test]
fn a_bouncing_ball_has_the_impulses_of_its_cycle() {
    let (e, omega, gamma) = (0.5, 1.0, 1.2);
    let free = Linear { gamma: 0.0, square: 0.0, force: gamma, load: 1.0, omega };
    let oscillator = with_wall(free.oscillator(), Side::Right, 0.3, Contact::Rigid, [0.0, 0.0]);
    let flow = Flow::new(&oscillator);
    // The phase of the impact: gamma / omega sin(phase) = T (1 - e) / (2 (1 + e)). The ball is followed to phase 0.
    let sine = std::f64::consts::PI * (1.0 - e) / (1.0 + e) / gamma;
    let phase = std::f64::consts::PI - sine.asin();
    let (time, leaving) = (std::f64::consts::TAU - phase, -e * std::f64::consts::TAU / (1.0 + e));
    let v = leaving + time - gamma * phase.sin();
    let x = leaving * time + 0.5 * time * time + gamma * (phase.cos() - 1.0 - time * phase.sin());
    let orbit = analyse_flow(&flow, Law::both(e, 0.0), state(&[x, v]), &Settings::default(), 8);
    assert_eq!(orbit.word.time_order(), "2", "{orbit:?}");
    let speed = std::f64::consts::TAU / (1.0 + e);
    let of = quantities(&orbit);
    for found in [of.approaches[0].mean, of.approaches[0].largest, of.approaches[2].mean] {
        assert!(near(found, speed, 1e-12), "{found} {speed}");
    }
    let lost = (1.0 - e * e) * speed * speed / 2.0 / flow.period;
    assert!(near(of.impact_energy, lost, 1e-13), "{} {lost}", of.impact_energy);
    let work = power(gamma, omega, of.displacements[0].harmonic);
    assert!(near(work, lost, 1e-12), "{work} {lost}");
    assert!(near(flow.compliance(), 1.0, 0.0));
}

/// Elastic and rigid walls.
#[test]
fn compliant_and_rigid_contacts_close_the_balance() {
    let free = Linear { gamma: 0.05, square: 1.0, force: 1.0, load: 0.0, omega: 2.1 };
    let elastic = with_wall(free.oscillator(), Side::Right, 0.1, Contact::Elastic, [24.0, 1.5]);
    let of = |pair: &Pair, contact: Contact, preload: Option<f64>| {
        with_law(described(pair, Law::both(0.5, 0.0)), Side::Right, contact, preload)
    };
    let table = Linear { gamma: 0.0, square: 0.0, force: 1.2, load: 1.0, omega: 1.0 };
    let rigid = with_wall(table.oscillator(), Side::Right, 0.0, Contact::Rigid, [0.0, 0.0]);
    let mut released = Vec::new();
    for oscillator in [
        of(&elastic, Contact::Elastic, None),
        of(&elastic, Contact::Elastic, Some(0.1)),
        of(&elastic, Contact::Pushing, None),
        of(&elastic, Contact::Pushing, Some(-0.2)),
        of(&elastic, Contact::Pushing, Some(0.1)),
        of(&elastic, Contact::Pushing, Some(-2.0)),
        described(&rigid, Law::both(0.0, 0.0)),
        described(&rigid, Law::both(0.4, 0.0)),
    ] {
        let (flow, law) = (Flow::new(&oscillator), oscillator.law());
        let orbit = analyse_flow(&flow, law, REST, &Settings::default(), 8);
        let of = quantities(&orbit);
        assert!(matches!(orbit.class, Class::Periodic { .. }), "{orbit:?}");
        let work = power(oscillator.drives[0].cos[0], oscillator.omega, of.displacements[0].harmonic);
        let lost = of.dissipated + of.impact_energy + of.release_energy.unwrap_or(0.0);
        assert!(near(work, lost, 1e-10 * work.abs()), "{work} {of:?}");
        released.extend(of.release_energy);
        let wall = &oscillator.gaps[0].walls[0][0];
        assert_eq!(of.contact_force.is_some(), wall.contact.is_elastic(), "{of:?}");
        if let Some([largest, rms]) = of.contact_force {
            let samples = 100_000;
            let orbit_samples = {
                let mut trajectory =
                    rattlemap_dynamics::motion::Trajectory::<0>::new(&flow, law, orbit.strobe);
                (1..=samples)
                    .filter_map(|i| {
                        trajectory
                            .advance_to(flow.period * f64::from(i) / f64::from(samples), &mut ())
                            .unwrap();
                        let [x, v, ..] = trajectory.state();
                        trajectory
                            .meshing()
                            .map(|_| 24.0 * (x - 0.1) + 1.5 * v + wall.springs[0].force_at_wall())
                    })
                    .collect::<Vec<f64>>()
            };
            let most = orbit_samples.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let square = orbit_samples.iter().map(|f| f * f).sum::<f64>() / orbit_samples.len() as f64;
            assert!(
                (0.0..1e-3).contains(&(largest - most)) && near(rms, square.sqrt(), 1e-3),
                "{most} {of:?}"
            );
        }
    }
    assert!(
        released.iter().any(|energy| *energy < 0.0) && released.iter().any(|energy| *energy > 0.0),
        "{released:?}"
    );
}
