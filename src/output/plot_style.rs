//! What all figures share: canvas, palette, type, strokes and markers.
//!
//! Positions and sizes are in pixels of the finished picture, as `f64`. A [`Canvas`] keeps what is drawn, as few kinds of
//! [`Item`]; [`save_figure`] writes them as PNG, SVG or PDF.

pub mod axes;
mod fitting;
pub mod labels;
pub mod legend;
mod pdf;
mod png;
mod raster;
mod svg;
mod ticks;
mod typeface;

use std::cell::RefCell;
use std::fs;
use std::path::Path;

use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::EventKind;

pub use raster::Bitmap;
pub(super) use ticks::superscript;

use super::{DrawError, FigureError};
use typeface::Typeface;

/// Red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RGBColor(pub u8, pub u8, pub u8);

/// Paper.
pub const WHITE: RGBColor = RGBColor(0xff, 0xff, 0xff);
/// Text, axes and outlines.
pub const DARK: RGBColor = RGBColor(0x26, 0x26, 0x26);
/// Lines that should not draw the eye: velocity jumps, marks without data.
pub const FAINT: RGBColor = RGBColor(0x96, 0x96, 0x96);
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
/// Points of a line closer to the one before than this many pixels are left out.
const THIN: f64 = 0.1;
/// Nothing is drawn further away than this, in pixels.
const FAR: f64 = 1e5;
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

/// A shape that is filled.
#[derive(Debug)]
enum Shaped {
    Rect(Rect),
    Circle { center: Point, radius: f64 },
    Polygon(Vec<Point>),
}

/// What a picture consists of, in the order in which it is drawn.
#[derive(Debug)]
enum Item {
    Area {
        shape: Shaped,
        color: RGBColor,
        opacity: f64,
    },
    /// With round joints and ends; two points at least.
    Line {
        path: Vec<Point>,
        width: f64,
        color: RGBColor,
        is_dashed: bool,
    },
    /// `at` lies on the baseline: where it begins, its middle or its end. `em` is the size of the type.
    Text {
        text: String,
        at: Point,
        em: f64,
        align: Align,
        color: RGBColor,
    },
    Image {
        rect: Rect,
        bitmap: Bitmap,
    },
}

/// A picture being drawn.
#[derive(Debug)]
pub struct Canvas<'a> {
    items: RefCell<Vec<Item>>,
    size: (f64, f64),
    typeface: &'a Typeface,
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
    let canvas = Canvas {
        items: RefCell::default(),
        size: (width.into(), height.into()),
        typeface: Typeface::of_figures(),
    };
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

impl Canvas<'_> {
    /// Width and height.
    pub fn size(&self) -> (f64, f64) {
        self.size
    }

    /// What is left for panels of the picture below `top`, `left` pixels from its left edge.
    pub fn panel(&self, left: f64, top: f64) -> Rect {
        Rect { left, top, right: self.size.0 - RIGHT, bottom: self.size.1 - BELOW }
    }

    fn add(&self, item: Item) {
        self.items.borrow_mut().push(item);
    }

    fn area(&self, shape: Shaped, color: RGBColor, opacity: f64) {
        self.add(Item::Area { shape, color, opacity });
    }

    /// Fills a rectangle.
    pub fn fill(&self, rect: Rect, color: RGBColor, opacity: f64) -> Result<(), DrawError> {
        if rect.right > rect.left && rect.bottom > rect.top {
            self.area(Shaped::Rect(rect), color, opacity);
        }
        Ok(())
    }

    /// Fills a polygon.
    pub fn polygon(&self, corners: &[Point], color: RGBColor) -> Result<(), DrawError> {
        self.area(Shaped::Polygon(corners.to_vec()), color, 1.0);
        Ok(())
    }

    /// Writes one line of text. Raised digits and minus are those of Unicode.
    pub fn text(
        &self,
        text: &str,
        at: Point,
        size: f64,
        align: Align,
        color: RGBColor,
    ) -> Result<(), DrawError> {
        let em = self.typeface.em(size);
        let half = self.typeface.cap_height(em) / 2.0;
        let at = match align {
            Align::Upwards => (at.0 + half, at.1),
            _ => (at.0, at.1 + half),
        };
        if !text.is_empty() {
            self.add(Item::Text { text: text.to_owned(), at, em, align, color });
        }
        Ok(())
    }

    /// Draws an event marker, with a thin white rim that sets it off from the line.
    pub fn marker(&self, at: Point, marker: Marker) -> Result<(), DrawError> {
        let Marker { shape, color, radius, hollow } = marker;
        if !(at.0.abs() < FAR && at.1.abs() < FAR) {
            return Ok(());
        }
        // Small markers are many, and the rim of one would wipe out its neighbour.
        if radius > 4.0 {
            self.shape(at, shape, radius + 1.0, WHITE);
        }
        self.shape(at, shape, radius, color);
        if hollow {
            self.shape(at, shape, 0.6 * radius, WHITE);
        }
        Ok(())
    }

    fn shape(&self, at: Point, shape: Shape, radius: f64, color: RGBColor) {
        let corner = |dx: f64, dy: f64| (at.0 + dx * radius, at.1 + dy * radius);
        let shaped = match shape {
            Shape::Circle => Shaped::Circle { center: at, radius },
            Shape::Square => {
                let ((left, top), (right, bottom)) = (corner(-0.85, -0.85), corner(0.85, 0.85));
                Shaped::Rect(Rect { left, top, right, bottom })
            }
            Shape::Triangle => {
                Shaped::Polygon(vec![corner(0.0, -1.25), corner(1.1, 0.75), corner(-1.1, 0.75)])
            }
        };
        self.area(shaped, color, 1.0);
    }

    /// Draws a polyline with round joints and ends; points that are not finite are left out.
    pub fn stroke(&self, path: &[Point], width: f64, color: RGBColor) -> Result<(), DrawError> {
        self.line(path, width, color, false);
        Ok(())
    }

    fn line(&self, path: &[Point], width: f64, color: RGBColor, is_dashed: bool) {
        match thinned(path) {
            path if path.is_empty() => {}
            path if path.len() == 1 => {
                self.area(Shaped::Circle { center: path[0], radius: width / 2.0 }, color, 1.0);
            }
            path => self.add(Item::Line { path, width, color, is_dashed }),
        }
    }

    /// Draws the border of a rectangle.
    pub fn outline(&self, rect: Rect, width: f64) -> Result<(), DrawError> {
        let Rect { left, top, right, bottom } = rect;
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        self.stroke(&corners, width, DARK)
    }

    /// Draws a dashed straight line.
    pub fn dashes(&self, from: Point, to: Point, width: f64, color: RGBColor) -> Result<(), DrawError> {
        self.line(&[from, to], width, color, true);
        Ok(())
    }
}

/// A path without points that are not finite or too close to the one before; its end is kept.
fn thinned(path: &[Point]) -> Vec<Point> {
    let near = |v: f64| v.clamp(-FAR, FAR);
    let finite = path.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
    let mut points: Vec<Point> = Vec::with_capacity(path.len());
    let mut skipped = None;
    for at in finite.map(|p| (near(p.0), near(p.1))) {
        if points.last().is_some_and(|last| (at.0 - last.0).hypot(at.1 - last.1) < THIN) {
            skipped = Some(at);
        } else {
            points.push(at);
            skipped = None;
        }
    }
    if points.len() > 1 {
        points.extend(skipped);
    }
    points
}
