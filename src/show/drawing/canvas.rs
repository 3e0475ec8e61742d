//! What a picture consists of, and how it is put there.

use std::cell::RefCell;

use crate::show::drawing::raster::Bitmap;
use crate::show::drawing::typeface::Typeface;
use crate::show::drawing::{Align, BELOW, DARK, Marker, Point, RGBColor, RIGHT, Rect, Shape, WHITE};
use crate::show::error::DrawError;

/// Points of a line closer to the one before than this many pixels are left out.
const THIN: f64 = 0.1;
/// Nothing is drawn further away than this, in pixels.
const FAR: f64 = 1e5;

/// A shape that is filled.
#[derive(Debug)]
pub(crate) enum Shaped {
    Rect(Rect),
    Circle { center: Point, radius: f64 },
    Polygon(Vec<Point>),
}

/// What a picture consists of, in the order in which it is drawn.
#[derive(Debug)]
pub(crate) enum Item {
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
    pub(crate) items: RefCell<Vec<Item>>,
    pub(crate) size: (f64, f64),
    pub(crate) typeface: &'a Typeface,
}

impl<'a> Canvas<'a> {
    pub(crate) fn empty(size: (f64, f64), typeface: &'a Typeface) -> Canvas<'a> {
        Canvas { items: RefCell::default(), size, typeface }
    }

    /// Width and height.
    pub fn size(&self) -> (f64, f64) {
        self.size
    }

    /// What is left for panels of the picture below `top`, `left` pixels from its left edge.
    pub fn panel(&self, left: f64, top: f64) -> Rect {
        Rect { left, top, right: self.size.0 - RIGHT, bottom: self.size.1 - BELOW }
    }

    pub(crate) fn add(&self, item: Item) {
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
