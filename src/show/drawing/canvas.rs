//! The picture under construction: a list of areas, lines, texts and images.

use std::cell::{Cell, RefCell};

use crate::map::scene::FigureStyle;
use crate::show::color::Color;
use crate::show::drawing::shapes::{Align, Marker, Point, Rect, Shape};
use crate::show::drawing::style::{DARK, PER_INCH, SMALL, WHITE};
use crate::show::drawing::typeface::Typeface;

/// Points of a line that are closer to the previous one than this many pixels are skipped.
const THIN: f64 = 0.1;
/// Coordinates are clamped to this many pixels from the origin.
const FAR: f64 = 1e5;
/// Dots per inch of a PNG file whose width or type size is given.
const STYLED_DOTS: f64 = 600.0;

/// The shape of an area.
#[derive(Debug)]
pub(crate) enum Outline {
    Rect(Rect),
    Circle { center: Point, radius: f64 },
    Polygon(Vec<Point>),
}

/// An element of the picture.
#[derive(Debug)]
pub(crate) enum Item {
    Area {
        outline: Outline,
        color: Color,
        opacity: f64,
    },
    /// A line with round joints and ends, of at least two points.
    Line {
        path: Vec<Point>,
        width: f64,
        color: Color,
        is_dashed: bool,
    },
    /// `at` lies on the baseline: at the beginning, middle or end of the text. `em` is the type size.
    Text {
        text: String,
        at: Point,
        em: f64,
        align: Align,
        color: Color,
    },
    Image {
        rect: Rect,
        bitmap: Bitmap,
    },
}

/// Pixels, row by row from the top.
#[derive(Clone, Debug)]
pub struct Bitmap {
    /// Numbers of columns and rows.
    pub size: [usize; 2],
    /// Three bytes per pixel.
    pub rgb: Vec<u8>,
    /// Opacity of each pixel from 0 to 255. Without it all pixels are opaque.
    pub alpha: Option<Vec<u8>>,
    /// Whether scaling blends neighbouring pixels.
    pub is_smooth: bool,
}

impl Bitmap {
    /// Returns transparent pixels.
    pub fn clear(size: [usize; 2]) -> Bitmap {
        let count = size[0] * size[1];
        Bitmap { size, rgb: vec![0xff; 3 * count], alpha: Some(vec![0; count]), is_smooth: true }
    }

    /// Sets colour and opacity of a pixel, counted row by row.
    pub fn set(&mut self, pixel: usize, color: Color, opacity: f64) {
        self.rgb[3 * pixel..3 * pixel + 3].copy_from_slice(&color);
        if let Some(alpha) = &mut self.alpha {
            alpha[pixel] = (opacity * 255.0).round() as u8;
        }
    }
}

/// A picture under construction.
#[derive(Debug)]
pub struct Canvas {
    pub(crate) items: RefCell<Vec<Item>>,
    size: Cell<(f64, f64)>,
    /// Number of items of the heading, and its height. PDF files lack it: what it says belongs in the caption.
    pub(crate) heading: Cell<(usize, f64)>,
    pub(crate) style: FigureStyle,
    /// Units per inch of the printed figure.
    pub(crate) per_inch: f64,
}

impl Canvas {
    /// Returns a white picture. `width` is its width in units if the style has none. Its height is 0 until
    /// [`Canvas::set_height`].
    pub fn new(style: &FigureStyle, width: f64) -> Canvas {
        let default = Typeface::of_figures().em(SMALL) / PER_INCH * 72.0;
        let per_inch = PER_INCH * default / style.font_size.unwrap_or(default);
        let canvas = Canvas {
            items: RefCell::default(),
            size: Cell::default(),
            heading: Cell::default(),
            style: style.clone(),
            per_inch,
        };
        canvas.set_width(width);
        canvas
    }

    /// Changes the width in units that the picture has if its style has none.
    pub(crate) fn set_width(&self, width: f64) {
        let width = match self.style.width {
            Some(points) => points / 72.0 * self.per_inch,
            None => width * (self.per_inch / PER_INCH),
        };
        self.size.set((width, self.size.get().1));
    }

    /// Returns width and height.
    pub fn size(&self) -> (f64, f64) {
        self.size.get()
    }

    /// Sets the height.
    pub fn set_height(&self, height: f64) {
        self.size.set((self.size.get().0, height));
    }

    /// Whether there is a title.
    pub(crate) fn has_heading(&self) -> bool {
        self.style.title.as_deref() != Some("")
    }

    /// Whether the figure has its default width and type size. Then it also has its default height and margins; otherwise
    /// they follow from its content.
    pub fn is_default(&self) -> bool {
        self.style.width.is_none() && self.style.font_size.is_none()
    }

    /// Returns dots per inch of a PNG file.
    pub(crate) fn dots(&self) -> f64 {
        if self.is_default() { PER_INCH } else { STYLED_DOTS }
    }

    fn add(&self, item: Item) {
        self.items.borrow_mut().push(item);
    }

    fn area(&self, outline: Outline, color: Color, opacity: f64) {
        self.add(Item::Area { outline, color, opacity });
    }

    /// Fills a rectangle.
    pub fn fill(&self, rect: Rect, color: Color, opacity: f64) {
        if !rect.is_empty() {
            self.area(Outline::Rect(rect), color, opacity);
        }
    }

    /// Fills a polygon.
    pub fn polygon(&self, corners: &[Point], color: Color) {
        self.area(Outline::Polygon(corners.to_vec()), color, 1.0);
    }

    /// Writes one line of text. Superscripts are Unicode's raised digits and minus.
    pub fn text(&self, text: &str, at: Point, size: f64, align: Align, color: Color) {
        let em = Typeface::of_figures().em(size);
        let half = Typeface::of_figures().cap_height(em) / 2.0;
        let at = match align {
            Align::Upwards => (at.0 + half, at.1),
            _ => (at.0, at.1 + half),
        };
        if !text.is_empty() {
            self.add(Item::Text { text: text.to_owned(), at, em, align, color });
        }
    }

    /// Draws a marker. A thin white rim separates large markers from the line below them.
    pub fn marker(&self, at: Point, marker: Marker) {
        let Marker { shape, color, radius, hollow } = marker;
        if !(at.0.abs() < FAR && at.1.abs() < FAR) {
            return;
        }
        // The rims of many small markers would cover their neighbours.
        if radius > 4.0 {
            self.shape(at, shape, radius + 1.0, WHITE);
        }
        self.shape(at, shape, radius, color);
        if hollow {
            self.shape(at, shape, 0.6 * radius, WHITE);
        }
    }

    fn shape(&self, at: Point, shape: Shape, radius: f64, color: Color) {
        let corner = |dx: f64, dy: f64| (at.0 + dx * radius, at.1 + dy * radius);
        let outline = match shape {
            Shape::Circle => Outline::Circle { center: at, radius },
            Shape::Square => {
                let ((left, top), (right, bottom)) = (corner(-0.85, -0.85), corner(0.85, 0.85));
                Outline::Rect(Rect { left, top, right, bottom })
            }
            Shape::Diamond => {
                let corners = [(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)];
                Outline::Polygon(corners.map(|(dx, dy)| corner(dx, dy)).to_vec())
            }
            Shape::Triangle => {
                Outline::Polygon(vec![corner(0.0, -1.25), corner(1.1, 0.75), corner(-1.1, 0.75)])
            }
        };
        self.area(outline, color, 1.0);
    }

    /// Draws a polyline with round joints and ends. Points that are not finite are skipped.
    pub fn stroke(&self, path: &[Point], width: f64, color: Color) {
        self.line(path, width, color, false);
    }

    /// Draws a dashed polyline.
    pub fn dashes(&self, path: &[Point], width: f64, color: Color) {
        self.line(path, width, color, true);
    }

    fn line(&self, path: &[Point], width: f64, color: Color, is_dashed: bool) {
        match thinned(path) {
            path if path.is_empty() => {}
            path if path.len() == 1 => {
                self.area(Outline::Circle { center: path[0], radius: width / 2.0 }, color, 1.0);
            }
            path => self.add(Item::Line { path, width, color, is_dashed }),
        }
    }

    /// Draws the border of a rectangle.
    pub fn outline(&self, rect: Rect, width: f64) {
        let Rect { left, top, right, bottom } = rect;
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        self.stroke(&corners, width, DARK);
    }

    /// Fills a rectangle with a grid of colours, `[column, row]` counted from its lower left corner.
    pub fn raster(&self, rect: Rect, [columns, rows]: [usize; 2], color: impl Fn([usize; 2]) -> Color) {
        let cells = (0..rows).rev().flat_map(|row| (0..columns).map(move |column| [column, row]));
        let mut rgb = Vec::with_capacity(3 * columns * rows);
        cells.for_each(|cell| rgb.extend(color(cell)));
        self.image(rect, Bitmap { size: [columns, rows], rgb, alpha: None, is_smooth: false });
    }

    /// Draws pixels into a rectangle.
    pub fn image(&self, rect: Rect, bitmap: Bitmap) {
        if !rect.is_empty() && !bitmap.rgb.is_empty() {
            self.add(Item::Image { rect, bitmap });
        }
    }
}

/// The geometry of the items, for tests.
#[cfg(test)]
impl Canvas {
    /// Returns every text with its place and type size. The place spans from the baseline to the height of capitals.
    pub(crate) fn texts(&self) -> Vec<(String, Rect, f64)> {
        let face = Typeface::of_figures();
        let text = |item: &Item| match item {
            Item::Text { text, at, em, align, .. } => {
                let (width, height) = (face.set(text, *em).1, face.cap_height(*em));
                let ((x, y), (dx, dy)) = crate::show::drawing::typeface::beginning(*at, width, *align);
                let end = (x + width * dx + height * dy, y + width * dy - height * dx);
                let place =
                    Rect { left: x.min(end.0), top: y.min(end.1), right: x.max(end.0), bottom: y.max(end.1) };
                Some((text.clone(), place, *em))
            }
            _ => None,
        };
        self.items.borrow().iter().filter_map(text).collect()
    }

    /// Returns the outlined rectangles: panels, colour bars, patches of legends.
    pub(crate) fn outlines(&self) -> Vec<Rect> {
        let outline = |item: &Item| match item {
            Item::Line { path, .. } if path.len() == 5 && path[0] == path[4] && path[0].0 == path[3].0 => {
                Some(extent(path))
            }
            _ => None,
        };
        self.items.borrow().iter().filter_map(outline).collect()
    }

    /// Returns the rectangles around all items except texts.
    pub(crate) fn extents(&self) -> Vec<Rect> {
        let around = |item: &Item| match item {
            Item::Area { outline: Outline::Rect(rect), .. } | Item::Image { rect, .. } => Some(*rect),
            Item::Area { outline: Outline::Circle { center, radius }, .. } => {
                Some(Rect::around(*center, (*radius, *radius)))
            }
            Item::Area { outline: Outline::Polygon(path), .. } | Item::Line { path, .. } => {
                Some(extent(path))
            }
            Item::Text { .. } => None,
        };
        self.items.borrow().iter().filter_map(around).collect()
    }
}

#[cfg(test)]
fn extent(path: &[Point]) -> Rect {
    let ends = |coordinate: fn(&Point) -> f64| {
        path.iter().map(coordinate).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)))
    };
    let ((left, right), (top, bottom)) = (ends(|p| p.0), ends(|p| p.1));
    Rect { left, top, right, bottom }
}

/// Returns a path without points that are not finite or too close to the previous one. Its last point is always kept.
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
