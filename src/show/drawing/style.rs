//! Colours and type sizes that all figures share. Lengths are in units of the [drawing](super).

use crate::show::color::Color;
use rattlemap_dynamics::model::{MOST_COORDINATES, Side};

/// Background.
pub const WHITE: Color = [0xff; 3];
/// Text, axes and outlines.
pub const DARK: Color = [0x26; 3];
/// Lines of secondary importance: velocity jumps, marks of columns without data.
pub const FAINT: Color = [0xa0; 3];
/// Grid lines.
pub const GRID: Color = [0xe6; 3];
/// Trajectory while the teeth mesh.
pub const MESHING: Color = [0x00, 0x9e, 0x73];
/// Gear 2 where both gears share a panel.
pub const GEAR_2: Color = [0xcc, 0x79, 0xa7];
/// The bodies of a model where they share a panel, in order. None is a colour of a wall.
pub const BODIES: [Color; MOST_COORDINATES] = [
    DARK,
    GEAR_2,
    [0x56, 0xb4, 0xe9],
    [0xb3, 0x8f, 0x00],
    [0x7a, 0x3f, 0xa8],
    [0x8c, 0x56, 0x4b],
    [0x8a, 0x8a, 0x8a],
    [0x5e, 0x8c, 0x31],
];

/// Type size of tick labels and legends.
pub const SMALL: f64 = 23.0;
/// Type size of axis labels and subtitles.
pub const MEDIUM: f64 = 26.0;
/// Type size of titles.
pub const LARGE: f64 = 32.0;

/// Units per inch of a figure with the default type size. Small type then has 7.4 points.
pub(crate) const PER_INCH: f64 = 200.0;
/// Length of dashes and of the gaps between them.
pub(crate) const DASH: f64 = 5.0;

/// Returns the colour of a wall, from Okabe and Ito's colour-blind safe set.
pub fn wall_color(side: Side) -> Color {
    match side {
        Side::Right => [0xd5, 0x5e, 0x00],
        Side::Left => [0x00, 0x72, 0xb2],
    }
}
