//! Mathieu's equation, whose stiffness is a cosine of the phase: an integrator of fourth order, and published borders of stability.

use crate::common::built_in;
use nalgebra::Matrix2;
use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use rattlemap::model_file::FileModel;
use rattlemap_dynamics::model::{Model, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, Settings, analyse, state_at};

/// Returns the matrix of `x'' + 2 zeta x' + (delta + epsilon cos t) x = 0` over a period, by the classical method of Runge and Kutta.
fn truth(delta: f64, epsilon: f64, zeta: f64) -> Matrix2<f64> {
    const STEPS: u32 = 4000;
    let step = TAU / f64::from(STEPS);
    let rate =
        |t: f64, y: Matrix2<f64>| Matrix2::new(0.0, 1.0, -(delta + epsilon * t.cos()), -2.0 * zeta) * y;
    (0..STEPS).fold(Matrix2::identity(), |y, n| {
        let t = step * f64::from(n);
        let first = rate(t, y);
        let second = rate(t + 0.5 * step, y + 0.5 * step * first);
        let third = rate(t + 0.5 * step, y + 0.5 * step * second);
        let last = rate(t + step, y + step * third);
        y + step / 6.0 * (first + 2.0 * (second + third) + last)
    })
}

/// Returns the matrix of the model over a period. Starts are so small that they reach no stop.
fn computed(model: &FileModel) -> Matrix2<f64> {
    const SMALL: f64 = 1e-6;
    let flow = Flow::of(model).unwrap();
    let column = |start: [f64; 2]| {
        let end = state_at(&flow, model.law(), state(&start), TAU, &AtomicBool::new(false)).unwrap().unwrap();
        [end[0] / SMALL, end[1] / SMALL]
    };
    let [first, second] = [column([SMALL, 0.0]), column([0.0, SMALL])];
    Matrix2::new(first[0], second[0], first[1], second[1])
}

fn with_tolerance(tolerance: f64, values: &[(&str, f64)]) -> FileModel {
    let text = built_in("mathieu", &[]).definition().text.replace("= 0.001", &format!("= {tolerance}"));
    let mut model = FileModel::parse(&text, "mathieu.toml").unwrap();
    values.iter().for_each(|(name, value)| model.set(name, *value).unwrap());
    model
}

/// The published characteristic values of Mathieu's equation `y'' + (a - 2 q cos 2 t) y = 0` for q = 5: Abramowitz and Stegun, Handbook
/// of Mathematical Functions, table 20.1.
const BORDERS: [(f64, f64); 5] = [
    (-5.800_046_02, 2.0),
    (-5.790_080_60, -2.0),
    (1.858_187_54, -2.0),
    (2.099_460_45, 2.0),
    (7.449_109_74, 2.0),
];

/// The trace over a period is 2 or -2 on a border, and the error of the stages falls with the square of their number.
#[test]
fn the_error_falls_with_the_square_of_the_number_of_stages() {
    for (a, trace) in BORDERS {
        let (delta, epsilon) = (a / 4.0, 2.5);
        assert!((truth(delta, epsilon, 0.0).trace() - trace).abs() < 1e-6, "{a}");
    }
    for (delta, epsilon, zeta) in
        [(0.7, 0.5, 0.01), (1.3, 0.8, 0.1), (2.1, 1.0, 0.0), (BORDERS[3].0 / 4.0, 2.5, 0.0)]
    {
        let values = [("delta", delta), ("epsilon", epsilon), ("zeta", zeta)];
        let expected = truth(delta, epsilon, zeta);
        let mut counts = Vec::new();
        for tolerance in [0.03, 0.008, 0.002, 0.0008] {
            let model = with_tolerance(tolerance, &values);
            let count = model.oscillator().unwrap().stages.len();
            let error = (computed(&model) - expected).amax() / expected.amax();
            assert!(error < 8.0 * tolerance, "{values:?}, {count} stages: {error:e}");
            counts.push((count as f64, error));
        }
        let [_, (few, large), _, (many, small)] = counts[..] else { unreachable!("there are four") };
        let order = (large / small).ln() / (many / few).ln();
        assert!(many >= 2.5 * few && (1.8..2.2).contains(&order), "{values:?}: {counts:?}, order {order}");
    }
}

/// A small motion meets the stops where rest is unstable, and nowhere else.
#[test]
fn small_motion_meets_the_stops_where_rest_is_unstable() {
    let all = (0..13).flat_map(|i| (0..5).map(move |j| (0.25 * f64::from(i) - 0.27, 0.26 * f64::from(j))));
    let mut counts = [0, 0];
    for (delta, epsilon) in all {
        let matrix = truth(delta, epsilon, 0.01);
        let margin = 1.0 + matrix.determinant() - matrix.trace().abs();
        if margin.abs() < 0.05 {
            continue;
        }
        let model = built_in("mathieu", &[("delta", delta), ("epsilon", epsilon)]);
        let orbit = analyse(&model, state(&[0.01]), &Settings::default()).unwrap();
        let rests = orbit.class == Class::Periodic { period: 1 } && orbit.mesh_fraction == 0.0;
        let stays = rests && orbit.events.is_empty();
        assert_eq!(stays, margin > 0.0, "delta = {delta}, epsilon = {epsilon}: {margin}, {orbit:?}");
        counts[usize::from(stays)] += 1;
    }
    assert!(counts[0] > 5 && counts[1] > 20, "{counts:?}");
}
