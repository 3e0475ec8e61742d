//! The difference of two colours as perceived by people with and without colour blindness.
//!
//! Differences are CIEDE2000 (Sharma, Wu and Dalal 2005). Colour blindness is simulated by the matrices of Machado, Oliveira
//! and Fernandes (2009) at full severity, in linear light.

use crate::show::color::Color;

type Triple = [f64; 3];
type Matrix = [Triple; 3];

const PROTANOPE: Matrix = [
    [0.152_286, 1.052_583, -0.204_868],
    [0.114_503, 0.786_281, 0.099_216],
    [-0.003_882, -0.048_116, 1.051_998],
];
const DEUTERANOPE: Matrix = [
    [0.367_322, 0.860_646, -0.227_968],
    [0.280_085, 0.672_501, 0.047_413],
    [-0.011_820, 0.042_940, 0.968_881],
];
const NORMAL_VISION: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// Conversion of linear sRGB to XYZ relative to the white D65.
const XYZ: Matrix = [
    [0.412_456_4 / 0.950_47, 0.357_576_1 / 0.950_47, 0.180_437_5 / 0.950_47],
    [0.212_672_9, 0.715_152_2, 0.072_175_0],
    [0.019_333_9 / 1.088_83, 0.119_192_0 / 1.088_83, 0.950_304_1 / 1.088_83],
];

/// Returns the least difference of two colours over the three kinds of vision.
pub(crate) fn least_difference(a: Color, b: Color) -> f64 {
    let differences =
        [NORMAL_VISION, PROTANOPE, DEUTERANOPE].map(|vision| difference(lab(a, vision), lab(b, vision)));
    differences.into_iter().fold(f64::INFINITY, f64::min)
}

fn times(matrix: Matrix, v: Triple) -> Triple {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Returns a colour in CIELAB as perceived with the given kind of vision.
fn lab(color: Color, vision: Matrix) -> Triple {
    let linear = color.map(|value| {
        let value = f64::from(value) / 255.0;
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    });
    let perceived = times(vision, linear).map(|value| value.clamp(0.0, 1.0));
    let [x, y, z] = times(XYZ, perceived).map(|value| {
        if value > 216.0 / 24389.0 { value.cbrt() } else { (24389.0 / 27.0 * value + 16.0) / 116.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIEDE2000, equations (2) to (22) of Sharma, Wu and Dalal, with all weights 1.
fn difference([l1, a1, b1]: Triple, [l2, a2, b2]: Triple) -> f64 {
    let seventh = |c: f64| (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt();
    let g = 0.5 * (1.0 - seventh((a1.hypot(b1) + a2.hypot(b2)) / 2.0));
    let (a1, a2) = ((1.0 + g) * a1, (1.0 + g) * a2);
    let (c1, c2) = (a1.hypot(b1), a2.hypot(b2));
    let hue = |a: f64, b: f64| b.atan2(a).to_degrees().rem_euclid(360.0);
    let (h1, h2) = (hue(a1, b1), hue(a2, b2));
    let is_grey = c1 * c2 == 0.0;
    let turn = match h2 - h1 {
        _ if is_grey => 0.0,
        turn if turn > 180.0 => turn - 360.0,
        turn if turn < -180.0 => turn + 360.0,
        turn => turn,
    };
    let (l, c) = ((l1 + l2) / 2.0, (c1 + c2) / 2.0);
    let h = match h1 + h2 {
        sum if is_grey => sum,
        sum if (h1 - h2).abs() <= 180.0 => sum / 2.0,
        sum if sum < 360.0 => (sum + 360.0) / 2.0,
        sum => (sum - 360.0) / 2.0,
    };
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(h - 30.0) + 0.24 * cos(2.0 * h) + 0.32 * cos(3.0 * h + 6.0)
        - 0.2 * cos(4.0 * h - 63.0);
    let off = (l - 50.0).powi(2);
    let lightness = (l2 - l1) / (1.0 + 0.015 * off / (20.0 + off).sqrt());
    let chroma = (c2 - c1) / (1.0 + 0.045 * c);
    let hue = 2.0 * (c1 * c2).sqrt() * (turn / 2.0).to_radians().sin() / (1.0 + 0.015 * c * t);
    let rotation = 30.0 * (-((h - 275.0) / 25.0).powi(2)).exp();
    let mixed = -(2.0 * rotation).to_radians().sin() * 2.0 * seventh(c);
    (lightness.powi(2) + chroma.powi(2) + hue.powi(2) + mixed * chroma * hue).sqrt()
}

/// Pairs 1, 4, 7, 16, 17, 21 and 25 of the authors' test data.
#[test]
fn differences_equal_the_published_ones() {
    for (a, b, expected) in [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [50.0, 3.1736, 0.5854], 1.0),
        ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
    ] {
        let found = difference(a, b);
        assert!(
            (found - expected).abs() < 5e-5 && (difference(b, a) - found).abs() < 1e-12,
            "{found} {expected}"
        );
    }
}

#[test]
fn white_is_the_same_to_all_and_green_differs_from_amber_only_for_normal_vision() {
    let [green, amber] = [[0x20, 0xc0, 0x20], [0xd0, 0xa0, 0x00]];
    assert!(difference(lab(green, NORMAL_VISION), lab(amber, NORMAL_VISION)) > 30.0);
    for vision in [PROTANOPE, DEUTERANOPE] {
        assert!(difference(lab([255; 3], vision), lab([255; 3], NORMAL_VISION)) < 0.1);
        assert!(difference(lab(green, vision), lab(amber, vision)) < 5.0);
    }
}
