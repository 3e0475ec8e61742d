//! A ball on a shaking table, in the table's frame: `z'' = -1 + G cos(omega t)`, `z >= 0`, with G the table's
//! acceleration in units of gravity (Luck and Mehta, Phys. Rev. E 48 (1993) 3988-3997; Tufillaro, ibid. 50 (1994)
//! 4509).
//!
//! The orbit of one bounce per period leaves the table with `w+ = T e/(1 + e)` at a phase with `-G sin(phi) = pi (1 -
//! e)/(1 + e)`. Its multipliers have the product `e^2` and the sum `-2 e - (1 + e)^2 (G cos(phi) - 1)`. It begins in a
//! fold at `G = pi (1 - e)/(1 + e)`, and its period doubles at `G^2 = (pi (1 - e)/(1 + e))^2 + (2 (1 + e^2)/(1 +
//! e)^2)^2`.

use crate::common::apart;
use crate::common::closed_form::{Linear, Wall, Walled};
use crate::gallery::cycle::{first_block, followed, multipliers_apart, off_the_judge};
use rattlemap_dynamics::model::{REST, State, state};
use rattlemap_dynamics::motion::EventKind;

const T: f64 = std::f64::consts::TAU;

pub(crate) fn ball(shaking: f64, e: f64) -> Walled {
    let free = Linear { m: 1.0, c: 0.0, k: 0.0, force: shaking, omega: 1.0, load: -1.0 };
    Walled { free, walls: [None, Some(Wall::Rigid { at: 0.0, e })] }
}

/// Returns the accelerations of the fold and of the period doubling of period 1.
pub(crate) fn window(e: f64) -> [f64; 2] {
    let fold = std::f64::consts::PI * (1.0 - e) / (1.0 + e);
    [fold, fold.hypot(2.0 * (1.0 + e * e) / (1.0 + e).powi(2))]
}

/// Returns the state at phase 0 of the orbit of one bounce per period, and a matrix with its multipliers.
pub(crate) fn bounce(shaking: f64, e: f64) -> (State, [[f64; 2]; 2]) {
    let sin = -window(e)[0] / shaking;
    let phase = (-(-sin).asin()).rem_euclid(T);
    let leaving = T * e / (1.0 + e);
    let [z, w] = ball(shaking, e).free.after(phase, [0.0, leaving], T - phase);
    let shear = -(1.0 + e).powi(2) * (shaking * phase.cos() - 1.0) / T;
    (state(&[z, w]), [[-e, -e * T], [shear, shear * T - e]])
}

#[test]
fn the_orbit_of_one_bounce_agrees_with_the_closed_form() {
    for e in [0.3, 0.5, 0.8] {
        let [fold, doubles] = window(e);
        for share in [0.1, 0.5, 0.9] {
            let shaking = fold + share * (doubles - fold);
            let (start, theirs) = bounce(shaking, e);
            let (oscillator, law) = ball(shaking, e).oscillator();
            let found = followed(&oscillator, law, start, 1);
            let off = apart(found.end, start);
            let multipliers = multipliers_apart(first_block(&found.monodromy), theirs);
            let integrated = off_the_judge(&oscillator, law, start, 1);
            println!(
                "e = {e}, G = {shaking:.4}: state {off:.1e}, multipliers {multipliers:.1e}, DOP853 {integrated:.1e}"
            );
            assert_eq!(found.events.len(), 1);
            assert!(off < 1e-12 && multipliers < 1e-12 && integrated < 1e-10);
        }
        let at = |shaking: f64| {
            let (oscillator, law) = ball(shaking, e).oscillator();
            let [[a, b], [c, d]] =
                first_block(&followed(&oscillator, law, bounce(shaking, e).0, 1).monodromy);
            [a + d, a * d - b * c]
        };
        let [trace, det] = at(doubles);
        assert!((1.0 + trace + det).abs() < 1e-12, "a multiplier of -1: {trace} {det}");
        let [trace, det] = at(fold * (1.0 + 1e-12));
        assert!((1.0 - trace + det).abs() < 1e-5, "a multiplier of 1: {trace} {det}");
    }
}

/// Bouncing on a table at rest ends after the time `2 w/(1 - e)`.
#[test]
fn infinitely_many_bounces_end_at_the_computed_time() {
    for (e, w) in [(0.3, 1.4), (0.6, 0.9), (0.9, 0.2)] {
        let (oscillator, law) = ball(0.0, e).oscillator();
        let found = followed(&oscillator, law, state(&[0.0, w]), 1);
        let last = found.events.last().unwrap();
        let off = (last.t - 2.0 * w / (1.0 - e)).abs();
        println!("e = {e}: at rest after {}, off by {off:.1e}", last.t);
        assert!(last.kind == EventKind::MeshStart && off < 1e-12, "{last:?}");
        assert_eq!(found.end, REST);
    }
}
