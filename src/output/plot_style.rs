//! What all figures share: canvas, palette, type, strokes and markers.
//!
//! Positions and sizes are in pixels of the finished picture, as `f64`. A [`Canvas`] is
//! drawn at twice that resolution and averaged down, because plotters rounds glyphs and
//! outlines to whole pixels. Lines are rasterised here: plotters fills a thick polyline
//! as one polygon, which leaves holes wherever a trajectory crosses itself.

pub mod axes;
mod fitting;
pub mod labels;
pub mod legend;
mod raster;
mod ticks;

use std::path::Path;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;
use plotters::style::text_anchor::{HPos, Pos, VPos};

pub(super) use ticks::superscript;

use super::{DrawError, FigureError};
use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::EventKind;

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

/// Canvas pixels per pixel of the finished picture, along each direction.
const FINE: u32 = 2;
const FONT: &str = "figure";
/// Height of capitals and digits over font size, as plotters scales Ubuntu Light.
const CAP_HEIGHT: f64 = 0.62;

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

/// A picture being drawn.
pub struct Canvas<'a> {
    area: DrawingArea<BitMapBackend<'a>, Shift>,
    size: (f64, f64),
}

/// Draws a picture of `size` pixels on white and saves it as PNG.
///
/// # Errors
/// What `draw` returns, or that the file could not be written; both name the file.
pub fn save_figure(
    path: &Path,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Canvas<'_>) -> Result<(), DrawError>,
) -> Result<(), FigureError> {
    register_fonts();
    let fine = (width * FINE, height * FINE);
    let mut pixels = vec![0xff; 3 * (fine.0 * fine.1) as usize];
    {
        let area = BitMapBackend::with_buffer(&mut pixels, fine).into_drawing_area();
        let canvas = Canvas { area, size: (width.into(), height.into()) };
        draw(&canvas).map_err(|reason| FigureError::draw(path, reason))?;
    }
    let pixels = averaged(&pixels, (width, height));
    let mut file = BitMapBackend::new(path, (width, height));
    file.blit_bitmap((0, 0), (width, height), &pixels)
        .and_then(|()| file.present())
        .map_err(|reason| FigureError::save(path, reason))
}

fn register_fonts() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Cannot fail: the bytes are compiled in and a test draws with them.
        let _ = register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
    });
}

/// The mean over each block of `FINE` by `FINE` pixels.
fn averaged(fine: &[u8], (width, height): (u32, u32)) -> Vec<u8> {
    let (w, n) = (width as usize, FINE as usize);
    let mut coarse = Vec::with_capacity(3 * w * height as usize);
    for block in fine.chunks_exact(3 * w * n * n) {
        for x in 0..w {
            for channel in 0..3 {
                let at = |i: usize, j: usize| u32::from(block[3 * (i * w * n + x * n + j) + channel]);
                let sum: u32 = (0..n * n).map(|k| at(k / n, k % n)).sum();
                coarse.push(((sum + FINE * FINE / 2) / (FINE * FINE)) as u8);
            }
        }
    }
    coarse
}

/// The nearest canvas pixel.
fn fine(at: Point) -> (i32, i32) {
    let scale = f64::from(FINE);
    ((at.0 * scale).round() as i32, (at.1 * scale).round() as i32)
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

    /// Fills a rectangle.
    pub fn fill(&self, rect: Rect, color: RGBColor, opacity: f64) -> Result<(), DrawError> {
        let corners = [fine((rect.left, rect.top)), fine((rect.right, rect.bottom))];
        self.area.draw(&Rectangle::new(corners, color.mix(opacity).filled()))
    }

    /// Writes one line of text.
    pub fn text(
        &self,
        text: &str,
        at: Point,
        size: f64,
        align: Align,
        color: RGBColor,
    ) -> Result<(), DrawError> {
        let size = size * f64::from(FINE);
        // Plotters puts the baseline half a size below the top of its box; going back from
        // there by half the height of a capital centres digits and capitals on the anchor.
        let shift = ((CAP_HEIGHT - 1.0) / 2.0 * size).round() as i32;
        let (x, y) = fine(at);
        let font = FontDesc::new(FontFamily::Name(FONT), size, FontStyle::Normal);
        let (font, h_pos, at) = match align {
            Align::Left => (font, HPos::Left, (x, y + shift)),
            Align::Center => (font, HPos::Center, (x, y + shift)),
            Align::Right => (font, HPos::Right, (x, y + shift)),
            Align::Upwards => (font.transform(FontTransform::Rotate270), HPos::Center, (x + shift, y)),
        };
        let style = font.color(&color).pos(Pos::new(h_pos, VPos::Top));
        self.area.draw_text(text, &style, at)
    }

    /// Draws an event marker, with a thin white rim that sets it off from the line.
    pub fn marker(&self, at: Point, marker: Marker) -> Result<(), DrawError> {
        let Marker { shape, color, radius, hollow } = marker;
        // Small markers are many, and the rim of one would wipe out its neighbour.
        if radius > 4.0 {
            self.shape(at, shape, radius + 1.0, WHITE)?;
        }
        self.shape(at, shape, radius, color)?;
        if hollow { self.shape(at, shape, 0.6 * radius, WHITE) } else { Ok(()) }
    }

    fn shape(&self, at: Point, shape: Shape, radius: f64, color: RGBColor) -> Result<(), DrawError> {
        let corner = |dx: f64, dy: f64| fine((at.0 + dx * radius, at.1 + dy * radius));
        match shape {
            Shape::Circle => {
                let radius = radius * f64::from(FINE);
                self.area.draw(&Circle::new(fine(at), radius.round() as i32, color.filled()))?;
            }
            Shape::Square => {
                let corners = [corner(-0.85, -0.85), corner(0.85, 0.85)];
                self.area.draw(&Rectangle::new(corners, color.filled()))?;
            }
            Shape::Triangle => {
                let corners = vec![corner(0.0, -1.25), corner(1.1, 0.75), corner(-1.1, 0.75)];
                self.area.draw(&Polygon::new(corners, color.filled()))?;
            }
        }
        Ok(())
    }

    /// Draws a polyline with round joints and ends.
    pub fn stroke(&self, path: &[Point], width: f64, color: RGBColor) -> Result<(), DrawError> {
        let scale = f64::from(FINE);
        let path: Vec<Point> = path.iter().map(|p| (p.0 * scale, p.1 * scale)).collect();
        let Some(mut coverage) = Coverage::of(&path, width * scale, self.area.dim_in_pixel()) else {
            return Ok(());
        };
        if let [dot] = path[..] {
            coverage.add(dot, dot);
        }
        for ends in path.windows(2) {
            coverage.add(ends[0], ends[1]);
        }
        for (at, share) in coverage.pixels() {
            self.area.draw_pixel(at, &color.mix(share.into()))?;
        }
        Ok(())
    }

    /// Draws the border of a rectangle.
    pub fn outline(&self, rect: Rect, width: f64) -> Result<(), DrawError> {
        let Rect { left, top, right, bottom } = rect;
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        self.stroke(&corners, width, DARK)
    }

    /// Draws a dashed straight line.
    pub fn dashes(&self, from: Point, to: Point, width: f64, color: RGBColor) -> Result<(), DrawError> {
        const DASH: f64 = 5.0;
        let length = (to.0 - from.0).hypot(to.1 - from.1);
        if length == 0.0 || !length.is_finite() {
            return Ok(());
        }
        let at = |s: f64| {
            let share = (s / length).min(1.0);
            (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1))
        };
        for i in 0..(length / (2.0 * DASH)).ceil() as u32 {
            let start = 2.0 * DASH * f64::from(i);
            self.stroke(&[at(start), at(start + DASH)], width, color)?;
        }
        Ok(())
    }

    /// The canvas pixels inside a rectangle: `(left, top, width, height)`.
    pub fn fine_rect(rect: Rect) -> (i32, i32, usize, usize) {
        let (left, top) = fine((rect.left, rect.top));
        let (right, bottom) = fine((rect.right, rect.bottom));
        (left, top, (right - left).max(0) as usize, (bottom - top).max(0) as usize)
    }

    /// The canvas pixel at a position.
    pub fn fine_pixel(at: Point) -> (i32, i32) {
        fine(at)
    }

    /// A length in canvas pixels.
    pub fn fine_length(length: f64) -> f64 {
        length * f64::from(FINE)
    }

    /// Blends one canvas pixel.
    pub fn blend(&self, at: (i32, i32), color: RGBColor, opacity: f64) -> Result<(), DrawError> {
        self.area.draw_pixel(at, &color.mix(opacity))
    }
}

/// How much of each canvas pixel a stroke covers.
///
/// Collected before it is blended, so that short segments do not darken one another's rims.
struct Coverage {
    left: i32,
    top: i32,
    width: usize,
    share: Vec<f32>,
    reach: f64,
}

impl Coverage {
    /// Nothing covered yet; none if the path has no point on the canvas.
    fn of(path: &[Point], stroke_width: f64, (width, height): (u32, u32)) -> Option<Coverage> {
        let reach = stroke_width / 2.0 + 0.5;
        let bounds = |values: &mut dyn Iterator<Item = f64>, size: u32| {
            let (low, high) = values.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
            let low = (low - reach).floor().clamp(0.0, size.into()) as i32;
            (low, (high + reach).ceil().clamp(low.into(), size.into()) as i32)
        };
        let (left, right) = bounds(&mut path.iter().map(|p| p.0), width);
        let (top, bottom) = bounds(&mut path.iter().map(|p| p.1), height);
        let (width, height) = ((right - left) as usize, (bottom - top) as usize);
        (width * height > 0).then(|| Coverage { left, top, width, share: vec![0.0; width * height], reach })
    }

    /// Covers the pixels near the segment from `a` to `b`.
    fn add(&mut self, a: Point, b: Point) {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let length2 = dx * dx + dy * dy;
        let first = ((a.1.min(b.1) - self.reach).floor() as i32).max(self.top);
        let height = (self.share.len() / self.width) as i32;
        let last = ((a.1.max(b.1) + self.reach).ceil() as i32).min(self.top + height - 1);
        for y in first..=last {
            // Pixel centres lie at halves.
            let py = f64::from(y) + 0.5;
            let along = if dy == 0.0 {
                (0.0, 1.0)
            } else {
                ((py - self.reach - a.1) / dy, (py + self.reach - a.1) / dy)
            };
            let at = |s: f64| a.0 + s.clamp(0.0, 1.0) * dx;
            let ends = (at(along.0), at(along.1));
            let from = ((ends.0.min(ends.1) - self.reach).floor() as i32).max(self.left);
            let to = ((ends.0.max(ends.1) + self.reach).ceil() as i32).min(self.left + self.width as i32 - 1);
            let row = (y - self.top) as usize * self.width;
            for x in from..=to {
                let (qx, qy) = (f64::from(x) + 0.5 - a.0, py - a.1);
                let foot = if length2 > 0.0 { ((qx * dx + qy * dy) / length2).clamp(0.0, 1.0) } else { 0.0 };
                let share = (self.reach - (qx - foot * dx).hypot(qy - foot * dy)).clamp(0.0, 1.0) as f32;
                let cell = &mut self.share[row + (x - self.left) as usize];
                *cell = cell.max(share);
            }
        }
    }

    fn pixels(&self) -> impl Iterator<Item = ((i32, i32), f32)> {
        let covered = self.share.iter().enumerate().filter(|(_, share)| **share > 0.0);
        covered.map(|(i, &share)| {
            ((self.left + (i % self.width) as i32, self.top + (i / self.width) as i32), share)
        })
    }
}
