//! What all figures share: canvas, palette, type, strokes and markers.
//!
//! Positions and sizes are in pixels of the finished picture, as `f64`. A [`Canvas`] keeps what is drawn, as few kinds of
//! item; [`save_figure`] writes them as PNG, SVG or PDF.

pub mod axes;
mod canvas;
mod fitting;
pub mod labels;
pub mod legend;
mod pdf;
mod png;
mod raster;
mod svg;
mod ticks;
mod typeface;

use std::fs;
use std::path::Path;

use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::EventKind;

pub use canvas::Canvas;
pub use raster::Bitmap;
pub(crate) use ticks::superscript;

use crate::show::error::{DrawError, FigureError};
use typeface::Typeface;

/// Red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RGBColor(pub u8, pub u8, pub u8);

/// Paper.
pub const WHITE: RGBColor = RGBColor(0xff, 0xff, 0xff);
/// Text, axes and outlines.
pub const DARK: RGBColor = RGBColor(0x26, 0x26, 0x26);
/// Lines that should not draw the eye: velocity jumps, marks without data.
pub const FAINT: RGBColor = RGBColor(0xa0, 0xa0, 0xa0);
/// Grid lines.
pub const GRID: RGBColor = RGBColor(0xe6, 0xe6, 0xe6);
/// Trajectory while the teeth mesh.
pub const MESHING: RGBColor = RGBColor(0x00, 0x9e, 0x73);
/// Gear 1 where both gears share a panel.
pub const GEAR_1: RGBColor = DARK;
/// Gear 2 where both gears share a panel.
pub const GEAR_2: RGBColor = RGBColor(0xcc, 0x79, 0xa7);

/// Size of tick labels and legends.
pub const SMALL: f64 = 23.0;
/// Size of axis labels and subtitles.
pub const MEDIUM: f64 = 26.0;
/// Size of titles.
pub const LARGE: f64 = 32.0;

/// From a figure's edges to its panels: room for the last tick label on the right, for ticks and
/// the axis' name below.
const RIGHT: f64 = 58.0;
/// The same, below.
pub const BELOW: f64 = 105.0;

/// Pixels to an inch of the printed figure: text of most figures is then of 7 points, lines are of half a point.
const PER_INCH: f64 = 200.0;
/// Length of dashes and of the gaps between them.
const DASH: f64 = 5.0;

/// The colour of a wall (Okabe and Ito's colour-blind safe set).
pub fn wall_color(side: Side) -> RGBColor {
    match side {
        Side::Right => RGBColor(0xd5, 0x5e, 0x00),
        Side::Left => RGBColor(0x00, 0x72, 0xb2),
    }
}

/// A position in pixels of the finished picture, y downwards.
pub type Point = (f64, f64);

/// A rectangle in pixels of the finished picture.
#[derive(Clone, Copy, Debug)]
pub struct Rect {
    /// Its left edge.
    pub left: f64,
    /// Its upper edge.
    pub top: f64,
    /// Its right edge.
    pub right: f64,
    /// Its lower edge.
    pub bottom: f64,
}

/// Where the anchor of a text lies; vertically it is always the middle of the capitals.
#[derive(Clone, Copy, Debug)]
pub enum Align {
    /// The text begins there.
    Left,
    /// The text's middle lies there.
    Center,
    /// The text ends there.
    Right,
    /// Centred and turned by a quarter, to be read upwards.
    Upwards,
}

/// The outline of a marker: one per kind of event.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// An impact.
    Circle,
    /// A start of meshing.
    Triangle,
    /// An end of meshing.
    Square,
}

impl Shape {
    /// That of a kind of event.
    pub fn of(kind: EventKind) -> Shape {
        match kind {
            EventKind::Impact => Shape::Circle,
            EventKind::MeshStart => Shape::Triangle,
            EventKind::MeshEnd => Shape::Square,
        }
    }
}

/// The form of a marker.
#[derive(Clone, Copy, Debug)]
pub struct Marker {
    /// Its outline.
    pub shape: Shape,
    /// Its colour.
    pub color: RGBColor,
    /// Half its extent.
    pub radius: f64,
    /// White inside: the state after the event where both are marked.
    pub hollow: bool,
}

/// Draws a picture of `size` pixels on white and saves it: as SVG or PDF if the file's name ends so, else as PNG.
///
/// # Errors
/// What `draw` returns, or that the file could not be written; both name the file.
pub fn save_figure(
    path: &Path,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Canvas<'_>) -> Result<(), DrawError>,
) -> Result<(), FigureError> {
    let canvas = Canvas::empty((width.into(), height.into()), Typeface::of_figures());
    let encoded = || {
        draw(&canvas)?;
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("svg") => Ok(svg::encoded(&canvas)?.into_bytes()),
            Some("pdf") => pdf::encoded(&canvas),
            _ => png::encoded(&canvas),
        }
    };
    let bytes = encoded().map_err(|reason| FigureError::draw(path, reason))?;
    fs::write(path, bytes).map_err(|reason| FigureError::save(path, reason))
}
