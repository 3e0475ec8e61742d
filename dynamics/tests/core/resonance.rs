//! An undamped oscillator that is forced at its own frequency, against a wall: its impacts lie at phase 0.
//!
//! With the wall at `sigma`, `x = sigma cos t - e V sin t + (t / 2) sin t` leaves the wall at phase 0 with the speed `e V`
//! and meets it again after exactly one period with the speed `pi - e V`. So `V = pi / (1 + e)`. An impact that is late by a
//! small time is followed by one that is early by `e` times this time: both multipliers are `-e`.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::AtomicBool;

use crate::common::linear::{Linear, with_wall};
use crate::common::{BUDGET, near};
use rattlemap_dynamics::model::{Contact, Law, REST, Side, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Budget, Class, Settings, Status, analyse_flow, measure, state_at};

fn flow(sigma: f64) -> Flow {
    let linear = Linear { gamma: 0.0, square: 1.0, force: 1.0, load: 0.0, omega: 1.0 };
    Flow::new(&with_wall(linear.oscillator(), Side::Right, sigma, Contact::Impact, [0.0; 2]))
}

/// Whether the cycle keeps off the wall between its impacts.
fn exists(sigma: f64, e: f64) -> bool {
    let x = |t: f64| sigma * t.cos() + (0.5 * t - e * PI / (1.0 + e)) * t.sin();
    (1..400).all(|i| x(f64::from(i) * TAU / 400.0) < sigma)
}

fn cases() -> impl Iterator<Item = (f64, f64)> {
    let walls = [0.05, 0.3, 0.5, 1.0, 40.0];
    let cases = walls.into_iter().flat_map(|sigma| [0.1, 0.3, 0.6, 0.8, 0.9].map(|e| (sigma, e)));
    cases.filter(|&(sigma, e)| exists(sigma, e))
}

#[test]
fn an_impact_at_phase_0_does_not_change_the_orbit() {
    assert!(cases().count() > 15);
    let mut shown = 0;
    for (sigma, e) in cases() {
        let (flow, law, speed) = (flow(sigma), Law::both(e, 0.0), PI / (1.0 + e));
        let size = 1e-12 * sigma.max(1.0);
        for start in [REST, state(&[sigma - 0.02, -e * speed + 0.01])] {
            let orbit = analyse_flow(&flow, law, start, &Settings::default(), 8);
            let found = (orbit.class, orbit.status, orbit.word.to_string());
            if found.2 != "2" {
                // Another orbit, whose impacts lie away from phase 0.
                let phases = orbit.events.iter().map(|event| event.t_mod_period / flow.period);
                let is_away = phases.clone().all(|turns| (1e-3..0.999).contains(&turns));
                assert!(is_away && phases.count() > 0, "{sigma} {e}: {orbit:?}");
                continue;
            }
            shown += 1;
            assert_eq!((found.0, found.1), (Class::Periodic { period: 1 }, Status::Ok), "{sigma} {e}");
            assert_eq!(orbit.impacts_per_period, 1.0, "{sigma} {e}");
            let moduli = orbit.floquet.unwrap();
            assert!(moduli.iter().all(|m| near(m[0].hypot(m[1]), e, 1e-7)), "{sigma} {e}: {moduli:?}");
            // The strobe is the state after the impact, and the impact ends the cycle.
            let [x, v, ..] = orbit.strobe;
            assert!(near(x, sigma, size) && near(v, -e * speed, size), "{sigma} {e}: {x} {v}");
            let [impact] = &orbit.events[..] else { panic!("{sigma} {e}: {:?}", orbit.events) };
            assert_eq!((impact.t, impact.t_mod_period), (flow.period, 0.0), "{sigma} {e}");
            assert!(near(impact.before[1], speed, size), "{sigma} {e}: {impact:?}");
        }
    }
    assert!(shown > 3 * cases().count() / 2, "{shown} of {}", 2 * cases().count());
}

#[test]
fn an_impact_at_phase_0_does_not_change_the_cell_of_a_map() {
    let mut shown = 0;
    for (sigma, e) in cases() {
        for early_stop in [true, false] {
            let budget = Budget { early_stop, quantities: true, ..BUDGET };
            let cell = measure(&flow(sigma), Law::both(e, 0.0), REST, &budget);
            let found = (cell.period, cell.status, cell.word.unwrap().to_string(), cell.impacts_per_period);
            if found.2 != "2" {
                // Another orbit, which is not at the wall at phase 0.
                assert!((cell.strobe[0] - sigma).abs() > 1e-3, "{sigma} {e}: {:?}", cell.strobe);
                continue;
            }
            shown += 1;
            assert_eq!((found.0, found.1), (Some(1), Status::Ok), "{sigma} {e}");
            assert_eq!(found.3, 1.0, "{sigma} {e}");
            assert!(near(cell.lyapunov.unwrap()[0], e.ln() / TAU, 1e-7), "{sigma} {e}: {:?}", cell.lyapunov);
            assert!(near(cell.strobe[1], -e * PI / (1.0 + e), 1e-6), "{sigma} {e}: {:?}", cell.strobe);
            // First harmonic of the closed form, by an average over many samples.
            let (mut cos, mut sin) = (0.0, 0.0);
            for i in 0..4096 {
                let t = (f64::from(i) + 0.5) * TAU / 4096.0;
                let x = sigma * t.cos() + (0.5 * t - e * PI / (1.0 + e)) * t.sin();
                (cos, sin) = (cos + x * t.cos() / 2048.0, sin + x * t.sin() / 2048.0);
            }
            let [amplitude, phase] = cell.quantities.unwrap().displacements[0].harmonic;
            let (ours, other) = ((amplitude * phase.cos(), -amplitude * phase.sin()), (cos, sin));
            let within = 1e-5 * sigma.max(1.0);
            assert!(near(ours.0, other.0, within) && near(ours.1, other.1, within), "{ours:?} {other:?}");
        }
    }
    assert!(shown > 3 * cases().count() / 2, "{shown} of {}", 2 * cases().count());
}

#[test]
fn a_slow_approach_from_both_sides_of_phase_0_ends_in_the_orbit() {
    let (flow, law, budget) = (flow(0.5), Law::both(0.97, 0.0), Budget { undecided_periods: 0, ..BUDGET });
    let start = state_at(&flow, law, REST, 3.0 * flow.period, &AtomicBool::new(false)).unwrap().unwrap();
    let cell = measure(&flow, law, start, &budget);
    assert_eq!(cell.period, Some(1), "{cell:?}");
}
