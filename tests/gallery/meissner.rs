//! Meissner's equation: the borders of stability in closed form.
//!
//! E. Meissner, Schweizerische Bauzeitung 72 (1918) 95: rest is stable if the modulus of the trace of the matrix of one period is
//! less than 1 plus its determinant.

use crate::common::built_in;
use nalgebra::{Complex, Matrix2};

use rattlemap::model_file::FileModel;
use rattlemap_dynamics::model::state;
use rattlemap_dynamics::orbit::{Class, Settings, analyse};

const ZETA: f64 = 0.01;

/// Returns the matrix of `x'' + 2 ZETA x' + k x = 0` over half a period.
fn half(k: f64) -> Matrix2<f64> {
    let t = std::f64::consts::PI;
    let s = Complex::from(k - ZETA * ZETA).sqrt();
    let (cos, sin) = ((s * t).cos().re, ((s * t).sin() / s).re);
    Matrix2::new(cos + ZETA * sin, sin, -k * sin, cos - ZETA * sin) * (-ZETA * t).exp()
}

/// A point of the plane of mean stiffness and change.
pub(crate) struct Point {
    pub(crate) what: String,
    pub(crate) model: FileModel,
    pub(crate) is_stable: bool,
}

/// Returns points that are not near a border, where motion takes long to grow or to decay.
pub(crate) fn points() -> Vec<Point> {
    let all = (0..31).flat_map(|i| (0..9).map(move |j| (0.1 * f64::from(i) - 0.27, 0.13 * f64::from(j))));
    let point = |(delta, epsilon): (f64, f64)| {
        let matrix = half(delta - epsilon) * half(delta + epsilon);
        let margin = 1.0 + matrix.determinant() - matrix.trace().abs();
        let model = built_in("meissner", &[("delta", delta), ("epsilon", epsilon), ("zeta", ZETA)]);
        let what = format!("delta = {delta}, epsilon = {epsilon}, {margin}");
        (margin.abs() >= 0.05).then_some(Point { what, model, is_stable: margin > 0.0 })
    };
    all.filter_map(point).collect()
}

/// A small motion meets the stops where rest is unstable, and nowhere else.
#[test]
fn small_motion_meets_the_stops_where_rest_is_unstable() {
    let points = points();
    for Point { what, model, is_stable } in &points {
        let orbit = analyse(model, state(&[0.01]), &Settings::default()).unwrap();
        let stays = orbit.class == Class::Periodic { period: 1 }
            && orbit.events.is_empty()
            && orbit.mesh_fraction == 0.0;
        assert_eq!(stays, *is_stable, "{what}: {orbit:?}");
    }
    let stable = points.iter().filter(|point| point.is_stable).count();
    assert!(stable > 80 && points.len() - stable > 40, "{stable} of {} are stable", points.len());
}
