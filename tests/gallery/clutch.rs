//! A clutch disc with two spring stages and stops: cycles in closed form, from piece to piece of the spring's characteristic.

use crate::common::built_in;
use nalgebra::Matrix2;
use rattlemap_dynamics::model::Form;

use crate::common::apart;
use crate::common::closed_form::{Linear, first_time};
use crate::gallery::cycle::followed;
use crate::gallery::models::Cycle;
use rattlemap_dynamics::model::{Model, REST, state};

/// `x'' + 2 zeta x' + f(x) = F_m + F cos(omega t)`: f has the slope 0 up to |x| = 1, `SLOPES[1]` up to 2 and `SLOPES[2]` up to the
/// stops at 4.
const SLOPES: [f64; 3] = [0.0, 0.15, 1.0];
const ENDS: [f64; 3] = [1.0, 2.0, 4.0];
const ZETA: f64 = 0.04;
const MEAN: f64 = 0.3;
const RESTITUTION: f64 = 0.4;

/// Steps per period at which the position is compared with the ends of its piece.
const PLACES: usize = 20_000;

/// Returns the equation of motion on one piece of the characteristic: 0 is the free play, 2 the main stage. `sign` is that of x.
fn piece(omega: f64, force: f64, piece: usize, sign: f64) -> Linear {
    let k = SLOPES[piece];
    let constant: f64 = (1..=piece).map(|n| (SLOPES[n] - SLOPES[n - 1]) * ENDS[n - 1]).sum();
    Linear { m: 1.0, c: 2.0 * ZETA, k, force, omega, load: MEAN + sign * constant }
}

/// The end of a motion.
struct End {
    y: [f64; 2],
    tangent: Matrix2<f64>,
    impacts: u32,
    /// Whether the motion was in contact all the time.
    stays: bool,
}

/// Follows the motion over so many periods.
fn run(omega: f64, force: f64, start: [f64; 2], periods: u32) -> End {
    let period = std::f64::consts::TAU / omega;
    let (mut y, mut tangent, mut impacts) = (start, Matrix2::identity(), 0);
    // The piece by number and sign.
    let mut n = ENDS.iter().filter(|&&end| y[0].abs() > end).count();
    let mut sign = y[0].signum();
    let mut stays = true;
    for _ in 0..periods {
        let (mut t, h) = (0.0, period / PLACES as f64);
        loop {
            stays &= n > 0;
            let field = piece(omega, force, n, sign);
            let rest = period - t;
            // Positive within the piece.
            let inside = |tau: f64| {
                let x = sign * field.after(t, y, tau)[0];
                let inner = if n == 0 { x + ENDS[0] } else { x - ENDS[n - 1] };
                inner.min(ENDS[n] - x)
            };
            let left = first_time(h, rest, |tau| inside(tau) < 0.0);
            let flown = left.unwrap_or(rest);
            y = field.after(t, y, flown);
            t += flown;
            let [[a, b], [c, d]] = field.propagator(flown);
            tangent = Matrix2::new(a, b, c, d) * tangent;
            if left.is_none() {
                break;
            }
            let is_outwards = y[0] * y[1] > 0.0;
            if is_outwards && n == 2 {
                let before = field.acceleration(t, y);
                let speed = y[1];
                y = [sign * ENDS[2], -RESTITUTION * speed];
                let after = field.acceleration(t, y);
                let jump = (after + RESTITUTION * before) / speed;
                tangent = Matrix2::new(-RESTITUTION, 0.0, jump, -RESTITUTION) * tangent;
                impacts += 1;
            } else if is_outwards {
                sign = y[0].signum();
                n += 1;
            } else {
                n -= 1;
            }
        }
    }
    End { y, tangent, impacts, stays }
}

/// Returns stable cycles: on the idle stage alone, on both stages, and with impacts on both stops.
pub(crate) fn cycles() -> Vec<Cycle> {
    [(0.9, 0.3), (0.8, 0.25), (1.1, 0.2), (1.5, 0.5), (0.5, 1.2), (0.7, 1.3), (1.0, 2.5)]
        .into_iter()
        .map(|(omega, force)| {
            let model = built_in("clutch", &[("omega", omega), ("F", force)]);
            let (oscillator, law) = (Form::from(&model.oscillator().unwrap()), model.law());
            let [x, v, ..] = followed(&oscillator, law, REST, 1200).end;
            let closes = |&period: &u32| {
                let [a, b] = run(omega, force, [x, v], period).y;
                (x - a).hypot(v - b) < 1e-12
            };
            let period = (1..=4).find(closes).unwrap_or_else(|| panic!("no cycle at {omega}, {force}"));
            let End { y: strobe, tangent, impacts, stays } = run(omega, force, [x, v], period);
            let radius = tangent.complex_eigenvalues().iter().fold(0.0f64, |size, mu| size.max(mu.norm()));
            let what = format!("clutch, omega = {omega}, F = {force}");
            Cycle { what, oscillator, law, period, strobe, radius, impacts, stays }
        })
        .collect()
}

/// Motion from rest agrees with the closed forms over three periods.
#[test]
fn motion_from_rest_agrees_with_closed_forms() {
    for cycle in cycles() {
        let Form::Machine(machine) = &cycle.oscillator else { panic!("{}", cycle.what) };
        let omega = machine.omega;
        let found = followed(&cycle.oscillator, cycle.law, REST, 3);
        let [x, v] = run(omega, machine.drives[0].cos[0], [0.0; 2], 3).y;
        let off = apart(found.end, state(&[x, v]));
        assert!(off < 1e-12, "omega = {omega}: {off:e}");
    }
}
