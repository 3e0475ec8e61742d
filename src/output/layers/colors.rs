//! Colours: one per period, greys for chaos, ramps for numbers.

/// Red, green and blue.
pub(in crate::output) type Color = [u8; 3];

const fn hex(rgb: u32) -> Color {
    [(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8]
}

/// Period 1 without any contact, its own mirror image, and one of a pair of mirror images.
pub(super) const NO_CONTACT: Color = hex(0xeef2f6);
pub(super) const SYMMETRIC: Color = hex(0xc0d9ee);
pub(super) const UNSYMMETRIC: Color = hex(0x7fb0da);
/// Period 1 that is too slow an approach to tell.
pub(super) const SYMMETRY_UNKNOWN: Color = hex(0x5b6f8c);

/// Periods 2 to 12: Okabe and Ito's colour-blind safe set first, then colours that stand
/// apart from it and from each other in lightness, too.
const PERIODS: [Color; 11] = [
    hex(0xe69f00),
    hex(0x009e73),
    hex(0xd55e00),
    hex(0xf0e442),
    hex(0x0072b2),
    hex(0xcc79a7),
    hex(0x8c510a),
    hex(0x35d0c0),
    hex(0x6a3d9a),
    hex(0xa6d854),
    hex(0xffb3c8),
];

/// The least and the largest exponent of chaos.
const CHAOS: [Color; 2] = [hex(0x9a9a9a), hex(0x050505)];
/// Meant to catch the eye: they are exceptions.
pub(super) const UNDECIDED: Color = hex(0xff00d4);
pub(super) const FAILED: Color = hex(0xff1010);
/// Cells without a value of a continuous layer.
pub(super) const NO_VALUE: Color = hex(0x8f8f8f);

/// Viridis in nine steps.
const SEQUENTIAL: [Color; 9] = [
    hex(0x440154),
    hex(0x472d7b),
    hex(0x3b528b),
    hex(0x2c728e),
    hex(0x21918c),
    hex(0x28ae80),
    hex(0x5ec962),
    hex(0xaddc30),
    hex(0xfde725),
];

/// ColorBrewer's RdBu, blue below zero.
const DIVERGING: [Color; 11] = [
    hex(0x053061),
    hex(0x2166ac),
    hex(0x4393c3),
    hex(0x92c5de),
    hex(0xd1e5f0),
    hex(0xf7f7f7),
    hex(0xfddbc7),
    hex(0xf4a582),
    hex(0xd6604d),
    hex(0xb2182b),
    hex(0x67001f),
];

/// The colour of a period of 2 or more.
pub(super) fn period(period: u32) -> Color {
    match PERIODS.get(period as usize - 2) {
        Some(color) => *color,
        None => distinct(period as usize),
    }
}

/// A colour for the `n`th of many things: hues a golden angle apart, in three lightnesses.
pub(super) fn distinct(n: usize) -> Color {
    let hue = (n as f64 * 0.618_033_988_75).fract() * 6.0;
    let lightness = [0.42, 0.62, 0.78][n % 3];
    let chroma = 0.6 * (1.0 - (2.0f64 * lightness - 1.0).abs());
    [0.0, 4.0, 2.0].map(|shift| {
        let distance = ((hue + shift) % 6.0 - 3.0f64).abs() - 1.0;
        let value = lightness + chroma * (distance.clamp(0.0, 1.0) - 0.5);
        (value * 255.0).round() as u8
    })
}

/// The colour of a share, 0 to 1, of what is counted from zero. The root leaves more colours
/// to small numbers, which are the most.
pub(super) fn sequential(share: f64) -> Color {
    between(&SEQUENTIAL, share.max(0.0).sqrt())
}

/// The colour of a number from -1 to 1; zero is white. Positive ones are spread by the root,
/// for most exponents of chaos are far below the largest.
pub(super) fn diverging(value: f64) -> Color {
    let spread = if value > 0.0 { value.sqrt() } else { value };
    between(&DIVERGING, 0.5 * (spread + 1.0))
}

/// The grey of chaos with a share, 0 to 1, of the largest exponent.
pub(super) fn chaos(share: f64) -> Color {
    between(&CHAOS, share.max(0.0).sqrt())
}

/// The colour at a share, 0 to 1, of the way along a chain of anchors.
fn between(anchors: &[Color], share: f64) -> Color {
    let place = share.clamp(0.0, 1.0) * (anchors.len() - 1) as f64;
    let first = (place as usize).min(anchors.len() - 2);
    let share = place - first as f64;
    let mix = |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
    let ([a, b, c], [d, e, f]) = (anchors[first], anchors[first + 1]);
    [mix(a, d), mix(b, e), mix(c, f)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_have_colours_of_their_own() {
        let mut colors: Vec<Color> = (2..=64).map(period).collect();
        colors.extend([NO_CONTACT, SYMMETRIC, UNSYMMETRIC, SYMMETRY_UNKNOWN, UNDECIDED, FAILED]);
        let count = colors.len();
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), count);
    }

    #[test]
    fn ramps_begin_and_end_with_their_anchors() {
        assert_eq!([0.0, 1.0].map(chaos), CHAOS);
        assert_eq!([-1.0, 0.0, 1.0].map(diverging), [DIVERGING[0], DIVERGING[5], DIVERGING[10]]);
        assert_eq!([0.0, 0.25, 2.0].map(sequential), [SEQUENTIAL[0], SEQUENTIAL[4], SEQUENTIAL[8]]);
    }
}
