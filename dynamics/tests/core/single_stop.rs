//! The oscillator `x'' + 2 gamma x' + x = cos(omega t)` with one rigid stop, against closed forms: orbits with one
//! impact in `n` periods, their multipliers, folds and grazing.
//!
//! Let `p` be the steady response. After an impact of approach speed `V` at the time `t_1` the deviation from `p` is
//! `(sigma - p_1, -e V - p_1')`. Before the next impact it is `(sigma - p_1, V - p_1')`. Free motion over `n` periods
//! maps the first to the second. These two equations give `sigma - p_1 = a V` and `p_1' = b V`. So with the amplitude
//! `A` of the response
//!
//! ```text
//! (sigma - a V)^2 + (b V / omega)^2 = A^2,
//! ```
//!
//! an ellipse of stop position and impact velocity. At its ends in `sigma` two orbits meet: C. J. Budd and F. J. Dux,
//! Chattering and related behaviour in impact oscillators, Phil. Trans. R. Soc. Lond. A 347 (1994) 365.

use std::f64::consts::TAU;

use crate::common::linear::{Linear, invariants, invariants_of, product, with_wall};
use crate::common::near;
use rattlemap_dynamics::model::{Contact, Law, Side, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{EventKind, GapEvent, Trajectory};
use rattlemap_dynamics::stability::{StrobeMap, refine};

/// The orbits with one impact in `n` periods of one oscillator, at any stop position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Family {
    pub(crate) linear: Linear,
    e: f64,
    n: u32,
    /// The coefficients `a` and `b` of the module's text.
    a: f64,
    b: f64,
}

/// An orbit with one impact in `n` periods.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Impacting {
    sigma: f64,
    pub(crate) speed: f64,
    /// Time of the impact, in `[0, T)`.
    pub(crate) at: f64,
}

impl Family {
    pub(crate) fn new(gamma: f64, omega: f64, e: f64, n: u32) -> Family {
        let linear = Linear { gamma, square: 1.0, force: 1.0, load: 0.0, omega };
        let [[f11, f12], [f21, f22]] = linear.fundamental(f64::from(n) * TAU / omega);
        // (1 - f11) a + f12 b = -e f12,  -f21 a + (f22 - 1) b = -(1 + e f22)
        let determinant = (1.0 - f11) * (f22 - 1.0) + f12 * f21;
        let (right, below) = (-e * f12, -(1.0 + e * f22));
        let a = (right * (f22 - 1.0) - f12 * below) / determinant;
        let b = ((1.0 - f11) * below + f21 * right) / determinant;
        Family { linear, e, n, a, b }
    }

    fn span(&self) -> f64 {
        f64::from(self.n) * TAU / self.linear.omega
    }

    /// Returns the orbit with the largest approach speed at a stop position.
    pub(crate) fn at_stop(&self, sigma: f64) -> Impacting {
        let ([amplitude, _], c) = (self.linear.response(), self.b / self.linear.omega);
        let (square, half) = (self.a * self.a + c * c, self.a * sigma);
        let root = (half * half - square * (sigma * sigma - amplitude * amplitude)).sqrt();
        let speed = (half + root) / square;
        self.at_angle((-c * speed).atan2(sigma - self.a * speed))
    }

    /// Returns the orbit whose impact has the phase `angle` in the steady response.
    fn at_angle(&self, angle: f64) -> Impacting {
        let ([amplitude, lag], omega) = (self.linear.response(), self.linear.omega);
        let speed = -omega * amplitude * angle.sin() / self.b;
        let at = ((angle + lag) / omega).rem_euclid(TAU / omega);
        Impacting { sigma: amplitude * angle.cos() + self.a * speed, speed, at }
    }

    /// Returns the angles of the ends of the ellipse.
    fn folds(&self) -> [f64; 2] {
        let first = (-self.a * self.linear.omega).atan2(self.b);
        [first, first + TAU / 2.0]
    }

    /// Returns the least distance of the flight from the stop, without the rise at its start and the fall at its end.
    fn room(&self, orbit: &Impacting) -> f64 {
        const SAMPLES: u32 = 4000;
        let height = |i: u32| {
            let tau = self.span() * f64::from(i) / f64::from(SAMPLES);
            orbit.sigma - self.linear.flow([orbit.sigma, -self.e * orbit.speed], orbit.at, tau)[0]
        };
        let rises = (1..SAMPLES).find(|&i| height(i + 1) < height(i)).unwrap_or(SAMPLES);
        let falls = (1..SAMPLES).rev().find(|&i| height(i - 1) < height(i)).unwrap_or(0);
        (rises..falls.max(rises)).map(height).fold(height(rises), f64::min)
    }

    fn is_physical(&self, orbit: &Impacting) -> bool {
        orbit.speed > 0.0 && self.room(orbit) > 0.0
    }

    /// Returns displacement and velocity at the phase 0 that follows an impact.
    pub(crate) fn strobe(&self, orbit: &Impacting) -> [f64; 2] {
        let tau = TAU / self.linear.omega - orbit.at;
        self.linear.flow([orbit.sigma, -self.e * orbit.speed], orbit.at, tau)
    }

    /// Returns trace and determinant of the monodromy matrix, the product of free motion and the saltation matrix.
    fn invariants(&self, orbit: &Impacting) -> [f64; 2] {
        let (e, v) = (self.e, orbit.speed);
        let [after, before] = [-e * v, v].map(|v| self.linear.acceleration([orbit.sigma, v], orbit.at));
        let saltation = [[-e, 0.0], [(after + e * before) / v, -e]];
        invariants(product(self.linear.fundamental(self.span()), saltation))
    }

    fn flow(&self, sigma: f64) -> Flow {
        let walled = with_wall(self.linear.oscillator(), Side::Right, sigma, Contact::Rigid, [0.0, 0.0]);
        Flow::new(&walled)
    }

    fn law(&self) -> Law {
        Law::both(self.e, 0.0)
    }

    /// Returns events and end of `n` periods of the reference from the orbit's state at phase 0.
    fn integrate(&self, flow: &Flow, orbit: &Impacting) -> (Vec<GapEvent>, [f64; 2]) {
        let [x, v] = self.strobe(orbit);
        let mut trajectory = Trajectory::new(flow, self.law(), state(&[x, v]));
        let mut events = Vec::new();
        (0..self.n).for_each(|_| trajectory.advance_period(&mut events).expect("an ordinary cell"));
        let [x, v, ..] = trajectory.state();
        (events, [x, v])
    }
}

/// Returns angles all around the ellipse.
fn angles() -> impl Iterator<Item = f64> {
    (0..48).map(|i| TAU * (f64::from(i) + 0.37) / 48.0)
}

fn families() -> impl Iterator<Item = Family> {
    [
        (0.0, 2.6, 0.8, 1),
        (0.0, 1.6, 0.7, 1),
        (0.0, 2.8, 0.8, 2),
        (0.0, 4.3, 0.9, 3),
        (0.05, 2.2, 0.8, 1),
        (0.02, 2.9, 0.6, 2),
        (0.1, 3.5, 1.0, 2),
    ]
    .into_iter()
    .map(|(gamma, omega, e, n)| Family::new(gamma, omega, e, n))
}

/// Compares state, impact and multipliers of stable and unstable orbits.
#[test]
fn orbits_with_one_impact_in_n_periods_agree_with_the_closed_form() {
    for family in families() {
        let mut found = 0;
        for orbit in angles().map(|angle| family.at_angle(angle)) {
            if !family.is_physical(&orbit) || orbit.speed < 0.05 || family.room(&orbit) < 1e-3 {
                continue;
            }
            found += 1;
            let case = format!("{family:?} {orbit:?}");
            let flow = family.flow(orbit.sigma);
            let (events, [x, v]) = family.integrate(&flow, &orbit);
            let [impact] = &events[..] else { panic!("{case}: {events:?}") };
            assert_eq!((impact.kind, impact.side), (EventKind::Impact, Side::Right), "{case}");
            let [trace, determinant] = family.invariants(&orbit);
            // The derivative amplifies the rounding error of the start.
            let growth = 1.0 + trace.abs() + 1.0 / orbit.speed;
            let [x_start, v_start] = family.strobe(&orbit);
            assert!(near(impact.t, orbit.at, 1e-12), "{case}: {impact:?}");
            assert!(near(impact.before[1], orbit.speed, 1e-12), "{case}: {impact:?}");
            assert!(near(x, x_start, 1e-12 * growth) && near(v, v_start, 1e-12 * growth), "{case}: {x} {v}");

            let seed = Trajectory::new(&flow, family.law(), state(&[x_start, v_start]));
            let map = StrobeMap::Periods(family.n);
            let derivative = map.apply(&seed, seed.state()).expect("an ordinary cell").derivative();
            let ours =
                [derivative[(0, 0)] + derivative[(1, 1)], derivative.fixed_view::<2, 2>(0, 0).determinant()];
            assert!(near(ours[0], trace, 1e-11 * growth), "{case}: trace {} {trace}", ours[0]);
            assert!(
                near(ours[1], determinant, 1e-11 * growth),
                "{case}: determinant {} {determinant}",
                ours[1]
            );
            assert!(
                derivative.iter().enumerate().all(|(k, x)| k % 4 < 2 && k / 4 < 2 || *x == 0.0),
                "{derivative}"
            );
            // Away from the ends of the ellipse the orbit is isolated, and Newton's method finds it.
            if (1.0 - trace + determinant).abs() > 1e-3 {
                let cycle = refine(&seed, map).expect("a cycle");
                let [ours, products] = invariants_of(&cycle.multipliers);
                assert!(
                    near(ours, trace, 1e-9 * growth) && near(products, determinant, 1e-9 * growth),
                    "{case}"
                );
                assert!((cycle.state[0] - x_start).abs() < 1e-10 * growth, "{case}: {cycle:?}");
            }
        }
        assert!(found >= 5, "{family:?}: {found}");
    }
}

/// At the ends of the ellipse a multiplier is 1.
#[test]
fn the_ends_of_the_ellipse_are_folds() {
    let mut count = 0;
    for family in families() {
        for orbit in family.folds().map(|angle| family.at_angle(angle)) {
            let [trace, determinant] = family.invariants(&orbit);
            if orbit.speed.abs() > 1e-3 {
                assert!(near(1.0 - trace + determinant, 0.0, 1e-12), "{family:?}: {orbit:?}");
            }
            if !family.is_physical(&orbit) || orbit.speed < 0.05 {
                continue;
            }
            count += 1;
            let flow = family.flow(orbit.sigma);
            let [x, v] = family.strobe(&orbit);
            let seed = Trajectory::new(&flow, family.law(), state(&[x, v]));
            let image = StrobeMap::Periods(family.n).apply(&seed, seed.state()).expect("an ordinary cell");
            let derivative = image.derivative().fixed_view::<2, 2>(0, 0).into_owned();
            let ours = 1.0 - derivative.trace() + derivative.determinant();
            assert!(near(ours, 0.0, 1e-10), "{family:?}: {orbit:?}: {ours:e}");
            assert!(
                near(image.state[0], x, 1e-12) && near(image.state[1], v, 1e-12),
                "{family:?}: {orbit:?}"
            );
            // A stop slightly beyond the end has no such orbit: the speed would be complex.
            let beyond = orbit.sigma + 1e-6 * orbit.sigma.signum() * orbit.sigma.abs().max(1.0);
            let ([amplitude, _], omega) = (family.linear.response(), family.linear.omega);
            let ratio = family.b / omega;
            let reach = amplitude * (1.0 + (family.a / ratio).powi(2)).sqrt();
            assert!(
                beyond.abs() > reach && near(orbit.sigma.abs(), reach, 1e-12 * reach),
                "{family:?}: {orbit:?}"
            );
        }
    }
    assert!(count >= 3, "{count}");
}

#[test]
fn contact_free_motion_grazes_at_its_amplitude() {
    for (gamma, omega) in [(0.0, 0.6), (0.0, 2.5), (0.05, 0.9), (0.1, 1.7), (0.02, 3.0)] {
        let family = Family::new(gamma, omega, 0.8, 1);
        let [amplitude, _] = family.linear.response();
        let [x, v] = family.linear.steady(0.0);
        for beyond in [1e-3, 1e-6, 1e-9, 1e-12] {
            for (share, hits) in [(1.0 + beyond, false), (1.0 - beyond, true)] {
                let flow = family.flow(amplitude.abs() * share);
                let mut trajectory = Trajectory::new(&flow, family.law(), state(&[x, v]));
                let mut events: Vec<GapEvent> = Vec::new();
                trajectory.advance_period(&mut events).expect("an ordinary cell");
                assert_eq!(!events.is_empty(), hits, "gamma {gamma}, omega {omega}, {share}: {events:?}");
            }
        }
    }
}

/// A flight over two or more periods may graze the stop between its ends. On one side of this orbit there is one
/// impact, on the other side there are more.
#[test]
fn impacting_orbits_end_where_their_flight_grazes() {
    let mut count = 0;
    for family in families().filter(|family| family.n > 1) {
        let list: Vec<f64> = angles().collect();
        for two in list.windows(2) {
            let room = |angle: f64| family.room(&family.at_angle(angle));
            let is_fast = |angle: f64| family.at_angle(angle).speed > 0.05;
            let ends = [two[0], two[1]].map(|angle| room(angle) > 0.0);
            if ends[0] == ends[1] || !is_fast(two[0]) || !is_fast(two[1]) {
                continue;
            }
            let (mut inside, mut outside) = if ends[0] { (two[0], two[1]) } else { (two[1], two[0]) };
            for _ in 0..40 {
                let middle = 0.5 * (inside + outside);
                if room(middle) > 0.0 { inside = middle } else { outside = middle }
            }
            // The error of the samples is the square of their distance.
            let away = 1e-4 * (inside - outside).signum();
            for (angle, is_alone) in [(inside + away, true), (outside - away, false)] {
                let orbit = family.at_angle(angle);
                let (events, _) = family.integrate(&family.flow(orbit.sigma), &orbit);
                assert_eq!(events.len() == 1, is_alone, "{family:?}: {orbit:?}: {events:?}");
                count += 1;
            }
        }
    }
    assert!(count >= 4, "{count}");
}
