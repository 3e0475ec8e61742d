//! Palettes: a colour per period, shades of grey for chaos, colour ramps for numbers.

use crate::show::color::Color;

const fn hex(rgb: u32) -> Color {
    [(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8]
}

/// Period 1 without contact, symmetric, and unsymmetric.
pub(crate) const NO_CONTACT: Color = hex(0xf7f6f3);
pub(crate) const SYMMETRIC: Color = hex(0xc9e5fc);
pub(crate) const UNSYMMETRIC: Color = hex(0x8bb3f5);
/// Period 1 of unknown symmetry, because the motion converges too slowly.
pub(crate) const SYMMETRY_UNKNOWN: Color = hex(0x546f90);

/// Period 1 that never leaves contact.
pub(crate) const ALWAYS_IN_CONTACT: Color = hex(0xebaac8);

/// Colours of the items of a list, such as periods from 2 on, or words by frequency. A search chose them so that neighbours in a legend
/// differ, also for people who cannot see red or green: each of the first 11 differs from all others. A test measures the differences.
#[rustfmt::skip]
const DISTINCT: [Color; 63] = [
    hex(0xe6a700), hex(0x059d76), hex(0xe26a38), hex(0xf2ea30), hex(0x01569d), hex(0xba7db8), hex(0x8d5d31), hex(0x6fdcae),
    hex(0x2f0692), hex(0xd3e98f), hex(0xf15a76), hex(0x9e2854), hex(0x006054), hex(0x8a9c9c), hex(0xa842fc), hex(0x3c180c),
    hex(0x3b114d), hex(0x4e4866), hex(0xa2909c), hex(0x666654), hex(0x7e7efc), hex(0x002448), hex(0x664e48), hex(0x184854),
    hex(0x008af6), hex(0x606066), hex(0x485afc), hex(0x6ca89c), hex(0x486666), hex(0x3c543c), hex(0x844242), hex(0x84285a),
    hex(0x2a243c), hex(0xe41ede), hex(0x364254), hex(0x78606c), hex(0x8466cc), hex(0x5a4e3c), hex(0x603c5a), hex(0x5a0006),
    hex(0xae72f6), hex(0x002a3c), hex(0x2a72f0), hex(0xae5ac6), hex(0x4e544e), hex(0x96969c), hex(0x485a66), hex(0x066066),
    hex(0x845a54), hex(0x241e4e), hex(0x5a4e5a), hex(0x8d4e69), hex(0x6c605a), hex(0x422a4e), hex(0xb48a9c), hex(0x6c4854),
    hex(0x546654), hex(0x751455), hex(0x608af6), hex(0x9c4e5a), hex(0x303654), hex(0x0c3c5a), hex(0x540048),
];

/// Chaos in layers that do not show its exponent.
pub(crate) const CHAOTIC: Color = hex(0x2a2a2a);
/// The smallest and the largest exponent of chaos.
const CHAOS_RAMP: [Color; 2] = [hex(0x9a9a9a), hex(0x050505)];
/// Figures hatch undecided cells with the second colour.
pub(crate) const UNDECIDED: Color = hex(0xdcdce2);
pub(crate) const HATCH: Color = hex(0x707070);
/// Other exceptions have conspicuous colours.
pub(crate) const QUASI_PERIODIC: Color = hex(0x0000fa);
pub(crate) const FAILED: Color = hex(0x8d130f);
/// Cells without a value of a continuous layer.
pub(crate) const NO_VALUE: Color = hex(0x8f8f8f);

/// The colour map Viridis in nine steps.
#[rustfmt::skip]
const SEQUENTIAL: [Color; 9] = [
    hex(0x440154), hex(0x472d7b), hex(0x3b528b), hex(0x2c728e), hex(0x21918c),
    hex(0x28ae80), hex(0x5ec962), hex(0xaddc30), hex(0xfde725),
];

/// ColorBrewer's palette RdBu, with blue for negative numbers.
#[rustfmt::skip]
const DIVERGING: [Color; 11] = [
    hex(0x053061), hex(0x2166ac), hex(0x4393c3), hex(0x92c5de), hex(0xd1e5f0), hex(0xf7f7f7),
    hex(0xfddbc7), hex(0xf4a582), hex(0xd6604d), hex(0xb2182b), hex(0x67001f),
];

/// The colour map Twilight of Matplotlib, whose ends are equal.
#[rustfmt::skip]
const CYCLIC: [Color; 9] = [
    hex(0xe2d9e2), hex(0x9ebbc9), hex(0x6785be), hex(0x5e43a5), hex(0x2f1436),
    hex(0x8e2c50), hex(0xba6657), hex(0xceac94), hex(0xe2d9e2),
];

/// Returns the colour of a period of 2 or more.
pub(crate) fn period(period: u32) -> Color {
    distinct(period as usize - 1)
}

/// Returns the colour of the `n`th item of a list, counted from 1. Beyond the table, hues differ by the golden angle, in
/// three lightnesses.
pub(crate) fn distinct(n: usize) -> Color {
    if let Some(color) = n.checked_sub(1).and_then(|place| DISTINCT.get(place)) {
        return *color;
    }
    let hue = (n as f64 * 0.618_033_988_75).fract() * 6.0;
    let lightness = [0.42, 0.62, 0.78][n % 3];
    let chroma = 0.6 * (1.0 - (2.0f64 * lightness - 1.0).abs());
    [0.0, 4.0, 2.0].map(|shift| {
        let distance = ((hue + shift) % 6.0 - 3.0f64).abs() - 1.0;
        let value = lightness + chroma * (distance.clamp(0.0, 1.0) - 0.5);
        (value * 255.0).round() as u8
    })
}

/// Returns the colour of a non-negative number, given as a share (0 to 1) of the largest. The square root gives more colours
/// to small numbers, which are more frequent.
pub(crate) fn sequential(share: f64) -> Color {
    linear(share.max(0.0).sqrt())
}

/// Returns the colour at a share (0 to 1) of the scale of [`sequential`], whose colours are evenly spread.
pub(crate) fn linear(share: f64) -> Color {
    between(&SEQUENTIAL, share)
}

/// Returns the colour of a number from -1 to 1. Zero is white. The square root spreads positive numbers, because most
/// exponents of chaos are far below the largest.
pub(crate) fn diverging(value: f64) -> Color {
    let spread = if value > 0.0 { value.sqrt() } else { value };
    between(&DIVERGING, 0.5 * (spread + 1.0))
}

/// Returns the colour of a number from -1 to 1. Zero is white.
pub(crate) fn signed(value: f64) -> Color {
    between(&DIVERGING, 0.5 * (value + 1.0))
}

/// Returns the colour of an angle as a share of pi, from -1 to 1. Both ends have one colour.
pub(crate) fn cyclic(share: f64) -> Color {
    between(&CYCLIC, 0.5 * (share + 1.0))
}

/// Returns the grey of chaos whose exponent is a share (0 to 1) of the largest.
pub(crate) fn chaos(share: f64) -> Color {
    between(&CHAOS_RAMP, share.max(0.0).sqrt())
}

/// Returns the colour at a share (0 to 1) of a ramp through `anchors`.
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
    use crate::show::color_difference::least_difference;
    use crate::show::layers::classes::LISTED_PERIOD;

    #[test]
    fn periods_have_different_colours() {
        let mut colors: Vec<Color> = (2..=64).map(period).collect();
        colors.extend([
            NO_CONTACT,
            ALWAYS_IN_CONTACT,
            SYMMETRIC,
            UNSYMMETRIC,
            SYMMETRY_UNKNOWN,
            UNDECIDED,
            FAILED,
            QUASI_PERIODIC,
        ]);
        let count = colors.len();
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), count);
    }

    #[test]
    fn neighbours_in_a_legend_differ_also_for_colour_blind_people() {
        let least = |pairs: Vec<(Color, Color)>| {
            for (a, b) in pairs {
                let difference = least_difference(a, b);
                assert!(difference >= 10.0, "{a:02x?} {b:02x?}: {difference}");
            }
        };
        let kinds = [NO_CONTACT, ALWAYS_IN_CONTACT, SYMMETRIC, UNSYMMETRIC, SYMMETRY_UNKNOWN];
        let legend: Vec<Color> = kinds.into_iter().chain((2..=64).map(period)).collect();
        // A legend lists only periods that occur, so that any two of them may be neighbours. The long ones share a row.
        let listed = kinds.len() + LISTED_PERIOD - 1;
        let pairs = (0..listed).flat_map(|i| (i + 1..legend.len()).map(move |j| (i, j)));
        least(pairs.map(|(i, j)| (legend[i], legend[j])).collect());
        // Lists of words and basins have consecutive colours, and at most 20 rows.
        let near = (1..20).flat_map(|i| (i + 1..=i + 4).map(move |j| (i, j)));
        least(near.map(|(i, j)| (distinct(i), distinct(j))).collect());
        // The row of chaos has the middle colour of its ramp.
        let greys = (0..=20).map(|step| chaos(f64::from(step) / 20.0));
        let others: Vec<Color> = legend.iter().copied().chain(greys).collect();
        // One of the two colours of a hatching is enough.
        let farther = |color: Color| {
            [UNDECIDED, HATCH]
                .into_iter()
                .max_by(|a, b| least_difference(color, *a).total_cmp(&least_difference(color, *b)))
        };
        let hatched =
            others.iter().chain(&[QUASI_PERIODIC, FAILED]).map(|&color| (color, farther(color).unwrap()));
        least(hatched.collect());
        least(
            [QUASI_PERIODIC, FAILED]
                .iter()
                .flat_map(|&last| others.iter().map(move |&c| (c, last)))
                .collect(),
        );
        least(legend.iter().map(|color| (*color, chaos(0.5))).chain([(FAILED, QUASI_PERIODIC)]).collect());
    }

    #[test]
    fn ramps_begin_and_end_with_their_anchors() {
        assert_eq!([0.0, 1.0].map(chaos), CHAOS_RAMP);
        assert_eq!([-1.0, 0.0, 1.0].map(diverging), [DIVERGING[0], DIVERGING[5], DIVERGING[10]]);
        assert_eq!([0.0, 0.25, 2.0].map(sequential), [SEQUENTIAL[0], SEQUENTIAL[4], SEQUENTIAL[8]]);
    }
}
