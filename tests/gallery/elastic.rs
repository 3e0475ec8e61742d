//! Contact with springs, without jumps: the bilinear oscillator, the soft impact oscillator, elastic backlash with a
//! mean load. Between crossings, all motions have closed forms.

use crate::common::apart;
use crate::common::closed_form::{Linear, Wall, Walled};
use crate::gallery::cycle::{first_block, followed, off_the_judge};
use rattlemap_dynamics::model::{State, state};
use rattlemap_dynamics::motion::EventKind;

/// Builds the bilinear oscillator with stiffness 1 for negative and 4 for positive displacements.
pub(crate) fn bilinear(omega: f64, force: f64) -> Walled {
    let free = Linear { m: 1.0, c: 0.1, k: 1.0, force, omega, load: 0.0 };
    Walled { free, walls: [Some(Wall::Elastic { at: 0.0, k: 3.0, c: 0.0 }), None] }
}

/// The soft impact oscillator of Ing, Pavlovskaia, Wiercigroch and Banerjee (Phil. Trans. R. Soc. A 366 (2008)
/// 679-704): `x'' + 2 zeta x' + x + beta (x - e) H(x - e) = a omega^2 cos(omega t)`, zeta = 0.01, beta = 29, e = 1.26.
pub(crate) fn soft(omega: f64, a: f64) -> Walled {
    let free = Linear { m: 1.0, c: 0.02, k: 1.0, force: a * omega * omega, omega, load: 0.0 };
    Walled { free, walls: [Some(Wall::Elastic { at: 1.26, k: 29.0, c: 0.0 }), None] }
}

/// A gear pair with elastic backlash and a mean load, Kahraman and Singh (J. Sound Vib. 142 (1990) 49-75):
/// `z'' + 2 zeta z' + g(z) = F_m + F_a omega^2 cos(omega t)`, g = 0 within the backlash of +-1 and of slope 1 beyond.
pub(crate) fn backlash(omega: f64) -> Walled {
    let (zeta, mean, alternating) = BACKLASH;
    let free =
        Linear { m: 1.0, c: 2.0 * zeta, k: 0.0, force: alternating * omega * omega, omega, load: mean };
    let tooth = |at: f64| Some(Wall::Elastic { at, k: 1.0, c: 0.0 });
    Walled { free, walls: [tooth(1.0), tooth(-1.0)] }
}

/// Parameters zeta, F_m, F_a of the backlash model.
pub(crate) const BACKLASH: (f64, f64, f64) = (0.05, 0.1, 0.05);

fn agrees(walled: &Walled, start: [f64; 2], periods: u32, what: &str) {
    let (oscillator, law) = walled.oscillator();
    let start: State = state(&[start[0], start[1], 0.0, 0.0]);
    let (end, events) = walled.run([start[0], start[1]], periods);
    let found = followed(&oscillator, law, start, periods);
    let off = apart(found.end, state(&[end[0], end[1], 0.0, 0.0]));
    let kinds: Vec<_> = found.events.iter().map(|event| (event.kind, event.side.index())).collect();
    assert_eq!(kinds, events.iter().map(|&(_, kind, side)| (kind, side)).collect::<Vec<_>>(), "{what}");
    assert!(kinds.iter().all(|&(kind, _)| kind != EventKind::Impact), "{what}");
    // Liouville's theorem: only dampers reduce the phase volume, crossings do not.
    let [[a, b], [c, d]] = first_block(&found.monodromy);
    let mut behind = [0.0; 2];
    for (i, &(t, kind, side)) in events.iter().enumerate() {
        let next = events.get(i + 1).map_or(f64::from(periods) * walled.free.period(), |next| next.0);
        if kind == EventKind::MeshStart {
            behind[side] += next - t;
        }
    }
    if let Some(&(t, EventKind::MeshEnd, side)) = events.first() {
        behind[side] += t;
    }
    let damping = [0, 1].map(|i| match walled.walls[i] {
        Some(Wall::Elastic { c, .. }) => c,
        _ => 0.0,
    });
    let whole = walled.free.c * f64::from(periods) * walled.free.period();
    let shrinks = (-(whole + damping[0] * behind[0] + damping[1] * behind[1]) / walled.free.m).exp();
    let volume = ((a * d - b * c) / shrinks - 1.0).abs();
    let integrated = off_the_judge(&oscillator, law, start, periods);
    println!(
        "{what}: {} events, state {off:.1e}, volume {volume:.1e}, DOP853 {integrated:.1e}",
        events.len()
    );
    assert!(off < 1e-12 && volume < 1e-11 && integrated < 1e-9, "{what}");
}

#[test]
fn motions_agree_with_closed_forms() {
    agrees(&bilinear(1.7, 1.0), [-0.3, 0.4], 3, "bilinear");
    let damped = |mut walled: Walled| {
        if let Some(Wall::Elastic { c, .. }) = &mut walled.walls[0] {
            *c = 0.7;
        }
        walled
    };
    agrees(&damped(bilinear(0.7, 1.0)), [0.3, 0.4], 3, "bilinear with a damper behind the wall");
    agrees(&soft(0.85, 0.7), [0.1, 0.2], 3, "soft impacts");
    agrees(&damped(soft(0.8, 0.9)), [1.3, 0.2], 3, "soft impacts on a damper");
}

/// An undamped and unforced bilinear oscillator has the frequency `2 w1 w2 / (w1 + w2)`.
#[test]
fn a_free_bilinear_oscillator_has_the_bilinear_frequency() {
    let (slow, fast) = (1.0f64, 2.0f64);
    let natural = 2.0 * slow * fast / (slow + fast);
    let mut walled = bilinear(natural, 0.0);
    walled.free.c = 0.0;
    let (oscillator, law) = walled.oscillator();
    for start in [state(&[-0.7, 0.2]), state(&[0.3, -1.1])] {
        let found = followed(&oscillator, law, start, 1);
        assert!(apart(found.end, start) < 1e-12, "{:?}", found.end);
        let mesh = found.meshing_time / walled.free.period();
        assert!((mesh - slow / (slow + fast)).abs() < 1e-12, "{mesh}");
    }
}

/// Teeth in permanent contact are a linear oscillator about the mean deflection. They separate if its amplitude reaches
/// F_m: `F_a w^2 = F_m |1 - w^2 + 2 i zeta w|`.
#[test]
fn teeth_separate_when_the_amplitude_reaches_the_mean_load() {
    let (zeta, mean, alternating) = BACKLASH;
    // (1 - r^2) u^2 + (4 zeta^2 - 2) u + 1 = 0 in u = w^2, r = F_a / F_m.
    let (square, p) = (1.0 - (alternating / mean).powi(2), 4.0 * zeta * zeta - 2.0);
    let root = (p * p - 4.0 * square).sqrt();
    for (parting, inside) in [(0.5 * (-p - root), 1.01), (0.5 * (-p + root), 0.99)] {
        let parting = (parting / square).sqrt();
        let parts = |omega: f64| {
            let walled = backlash(omega);
            let meshing = Linear { k: 1.0, load: mean + 1.0, ..walled.free };
            let [x, v] = meshing.steady(0.0);
            let (oscillator, law) = walled.oscillator();
            !followed(&oscillator, law, state(&[x, v]), 1).events.is_empty()
        };
        let (mut outside, mut inside) = (parting * (2.0 - inside), parting * inside);
        assert!(!parts(outside) && parts(inside));
        for _ in 0..60 {
            let middle = 0.5 * (outside + inside);
            if parts(middle) { inside = middle } else { outside = middle }
        }
        println!("teeth part at {parting}, off by {:.1e}", inside - parting);
        assert!((inside - parting).abs() < 1e-12);
    }
}

/// The soft oscillator grazes the spring at the frequency with `a w^2 = e |1 - w^2 + 2 i zeta w|`.
#[test]
fn grazing_of_the_soft_stop_agrees_with_the_response() {
    let (zeta, e, a) = (0.01f64, 1.26f64, 0.7f64);
    let (square, p) = (1.0 - (a / e).powi(2), 4.0 * zeta * zeta - 2.0);
    let grazing = ((0.5 * (-p - (p * p - 4.0 * square).sqrt())) / square).sqrt();
    assert!((grazing - 0.802).abs() < 5e-4);
    let meets = |omega: f64| {
        let walled = soft(omega, a);
        let [x, v] = walled.free.steady(0.0);
        let (oscillator, law) = walled.oscillator();
        !followed(&oscillator, law, state(&[x, v]), 1).events.is_empty()
    };
    let (mut low, mut high) = (0.99 * grazing, 1.01 * grazing);
    assert!(!meets(low) && meets(high));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if meets(middle) { high = middle } else { low = middle }
    }
    println!("grazing at {grazing}, off by {:.1e}", high - grazing);
    assert!((high - grazing).abs() < 1e-12);
}

/// A point of the frequency response computed by harmonic balance (`benches/peers/harmonic_balance.py`) with 40
/// harmonics, which needs no events.
struct ResponsePoint {
    kind: String,
    omega: f64,
    state: [f64; 2],
    largest: f64,
}

fn response_points() -> Vec<ResponsePoint> {
    let text = include_str!("data/backlash.csv");
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().unwrap();
        ResponsePoint {
            kind: cells[0].to_owned(),
            omega: number(1),
            state: [number(2), number(3)],
            largest: number(4),
        }
    };
    text.lines().skip(1).map(row).collect()
}

/// Returns the cycle near a state, found by Newton's method on the reference's strobe map, and its monodromy matrix.
fn cycle_near(omega: f64, mut y: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
    let (oscillator, law) = backlash(omega).oscillator();
    for _ in 0..30 {
        let found = followed(&oscillator, law, state(&y), 1);
        let [[a, b], [c, d]] = first_block(&found.monodromy);
        let off = [found.end[0] - y[0], found.end[1] - y[1]];
        if off[0].hypot(off[1]) < 1e-13 {
            return (y, [[a, b], [c, d]]);
        }
        let det = (1.0 - a) * (1.0 - d) - b * c;
        y[0] += ((1.0 - d) * off[0] + b * off[1]) / det;
        y[1] += (c * off[0] + (1.0 - a) * off[1]) / det;
    }
    panic!("no cycle at omega = {omega}");
}

/// Returns a number that is zero at a fold, where a multiplier is 1.
fn from_fold([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
    1.0 - (a + d) + (a * d - b * c)
}

/// The branches of the frequency response and the folds at which they end agree with harmonic balance.
#[test]
fn the_frequency_response_agrees_with_harmonic_balance() {
    let points = response_points();
    let mut worst = 0.0f64;
    for point in points.iter().filter(|point| point.kind != "fold") {
        let (state, monodromy) = cycle_near(point.omega, point.state);
        worst = worst.max((state[0] - point.state[0]).abs()).max((state[1] - point.state[1]).abs());
        assert_eq!(from_fold(monodromy) > 0.0, point.kind == "stable", "omega = {}", point.omega);
    }
    let swings = |kind: &str| {
        points.iter().filter(|point| point.kind == kind).map(|point| point.largest).collect::<Vec<_>>()
    };
    assert!(swings("stable").len() > 20 && swings("unstable").len() > 2);
    println!("{} points of harmonic balance, off by {worst:.1e}", points.len());
    assert!(worst < 5e-5);
    let folds: Vec<&ResponsePoint> = points.iter().filter(|point| point.kind == "fold").collect();
    // The branch of small amplitudes ends at its largest frequency, the other at its smallest.
    for (fold, inwards) in folds.iter().zip([-1.0, 1.0]) {
        // Near the fold, the square of `from_fold` is smooth in omega. Its root follows from three points.
        let at = |share: f64| {
            let omega = fold.omega * (1.0 + inwards * share);
            let stable = points.iter().filter(|p| p.kind == "stable" && (p.omega - omega) * inwards > 0.0);
            let side = |p: &&ResponsePoint| {
                if inwards < 0.0 { p.largest < fold.largest } else { p.largest > fold.largest }
            };
            let nearest = stable
                .filter(side)
                .min_by(|a, b| (a.omega - omega).abs().total_cmp(&(b.omega - omega).abs()));
            // The cycle is continued in small steps.
            let from = nearest.unwrap();
            let (mut state, mut monodromy) = (from.state, [[0.0; 2]; 2]);
            for k in 1..=200 {
                let share = f64::from(k) / 200.0;
                let progress = 1.0 - (1.0 - share) * (1.0 - share);
                (state, monodromy) = cycle_near(from.omega + progress * (omega - from.omega), state);
            }
            [omega, from_fold(monodromy).powi(2)]
        };
        let [[x0, y0], [x1, y1], [x2, y2]] = [1e-5, 2e-5, 4e-5].map(at);
        // Inverse interpolation with Lagrange's polynomial.
        let root = x0 * y1 * y2 / ((y0 - y1) * (y0 - y2))
            + x1 * y0 * y2 / ((y1 - y0) * (y1 - y2))
            + x2 * y0 * y1 / ((y2 - y0) * (y2 - y1));
        println!("a branch ends at {root}; by harmonic balance at {}", fold.omega);
        // The tolerance is the error of 40 harmonics; with 120 harmonics the first fold is at 0.828463989.
        assert!((root - fold.omega).abs() < 5e-6, "{root} {}", fold.omega);
    }
}
