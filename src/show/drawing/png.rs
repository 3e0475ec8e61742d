//! Pictures as PNG.

use std::collections::HashMap;

use png::{BitDepth, ColorType, Encoder, PixelDimensions, Unit};
use tiny_skia::{
    Color as SkiaColor, FillRule, FilterQuality, IntSize, LineCap, LineJoin, Paint, Path, PathBuilder,
    Pixmap, PixmapPaint, Rect as SkiaRect, Stroke, StrokeDash, Transform,
};
use ttf_parser::{GlyphId, OutlineBuilder};

use crate::show::color::Color;
use crate::show::drawing::canvas::{Bitmap, Canvas, Item, Outline};
use crate::show::drawing::shapes::{Point, Rect};
use crate::show::drawing::style::DASH;
use crate::show::drawing::typeface::{Glyph, Typeface, beginning};
use crate::show::error::WriteError;

/// Returns the bytes of the file.
pub(crate) fn encoded(canvas: &Canvas) -> Result<Vec<u8>, WriteError> {
    let scale = canvas.dots() / canvas.per_inch;
    let [width, height] = [canvas.size().0, canvas.size().1].map(|side| (side * scale).round() as u32);
    let mut page = Pixmap::new(width, height).ok_or(WriteError::Size { width, height })?;
    page.fill(SkiaColor::WHITE);
    for item in canvas.items.borrow().iter() {
        draw(&mut page, item, Transform::from_scale(scale as f32, scale as f32));
    }
    let mut rgb = Vec::with_capacity(3 * page.pixels().len());
    page.pixels().iter().for_each(|pixel| rgb.extend([pixel.red(), pixel.green(), pixel.blue()]));
    drop(page);
    let size = [width as usize, height as usize];
    bitmap(&Bitmap { size, rgb, alpha: None, is_smooth: false }, canvas.dots())
}

/// Returns a file of these pixels alone, with a palette if they have at most 256 colours. `dots` is its resolution per inch.
pub(crate) fn bitmap(bitmap: &Bitmap, dots: f64) -> Result<Vec<u8>, WriteError> {
    let [width, height] = bitmap.size.map(|side| side as u32);
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_depth(BitDepth::Eight);
    let per_metre = (dots / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(PixelDimensions { xppu: per_metre, yppu: per_metre, unit: Unit::Meter }));
    let (color, data) = match (&bitmap.alpha, palette(&bitmap.rgb)) {
        (Some(alpha), _) => {
            let pixels = bitmap.rgb.chunks_exact(3).zip(alpha);
            (ColorType::Rgba, pixels.flat_map(|(c, &a)| [c[0], c[1], c[2], a]).collect())
        }
        (None, Some((palette, indices))) => {
            encoder.set_palette(palette);
            (ColorType::Indexed, indices)
        }
        (None, None) => (ColorType::Rgb, bitmap.rgb.clone()),
    };
    encoder.set_color(color);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&data)?;
    writer.finish()?;
    Ok(bytes)
}

/// Returns the colours in order of occurrence and each pixel's index, or none for more than 256 colours.
fn palette(rgb: &[u8]) -> Option<(Vec<u8>, Vec<u8>)> {
    let (mut places, mut palette) = (HashMap::new(), Vec::new());
    let index = |pixel: &[u8]| {
        let color = [pixel[0], pixel[1], pixel[2]];
        let next = places.len();
        let place = *places.entry(color).or_insert_with(|| {
            palette.extend(color);
            next
        });
        u8::try_from(place).ok()
    };
    let indices = rgb.chunks_exact(3).map(index).collect::<Option<Vec<u8>>>()?;
    Some((palette, indices))
}

fn paint([r, g, b]: Color, opacity: f64) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, (opacity * 255.0).round() as u8);
    paint
}

fn draw(page: &mut Pixmap, item: &Item, scale: Transform) {
    // Shapes without extent have no path.
    match item {
        Item::Area { outline, color, opacity } => {
            if let Some(path) = path_of(outline) {
                page.fill_path(&path, &paint(*color, *opacity), FillRule::Winding, scale, None);
            }
        }
        Item::Line { path, width, color, is_dashed } => {
            let dash = is_dashed.then(|| StrokeDash::new(vec![DASH as f32; 2], 0.0)).flatten();
            let stroke = Stroke {
                width: *width as f32,
                line_cap: LineCap::Round,
                line_join: LineJoin::Round,
                dash,
                ..Stroke::default()
            };
            if let Some(path) = polyline(path, false) {
                page.stroke_path(&path, &paint(*color, 1.0), &stroke, scale, None);
            }
        }
        Item::Text { text, at, em, align, color } => {
            let typeface = Typeface::of_figures();
            let (glyphs, width) = typeface.set(text, *em);
            let (origin, direction) = beginning(*at, width, *align);
            let units = f64::from(typeface.face().units_per_em());
            let mut outlines = Outlines { path: PathBuilder::new(), origin, direction, glyph: None, units };
            for glyph in glyphs {
                outlines.glyph = Some(glyph);
                // A space has no outline.
                let _ = typeface.face().outline_glyph(GlyphId(glyph.id), &mut outlines);
            }
            if let Some(path) = outlines.path.finish() {
                page.fill_path(&path, &paint(*color, 1.0), FillRule::Winding, scale, None);
            }
        }
        Item::Image { rect, bitmap } => {
            let [columns, rows] = bitmap.size;
            let pixel = [(rect.right - rect.left) / columns as f64, (rect.bottom - rect.top) / rows as f64];
            let [sx, sy, left, top] = [pixel[0], pixel[1], rect.left, rect.top].map(|v| v as f32);
            let place = Transform::from_row(sx, 0.0, 0.0, sy, left, top).post_concat(scale);
            let quality = if bitmap.is_smooth { FilterQuality::Bilinear } else { FilterQuality::Nearest };
            let paint = PixmapPaint { quality, ..PixmapPaint::default() };
            if let Some(pixels) = premultiplied(bitmap) {
                page.draw_pixmap(0, 0, pixels.as_ref(), &paint, place, None);
            }
        }
    }
}

fn premultiplied(bitmap: &Bitmap) -> Option<Pixmap> {
    let [columns, rows] = bitmap.size.map(|side| u32::try_from(side).unwrap_or(0));
    let over = |value: u8, alpha: u8| ((u32::from(value) * u32::from(alpha) + 127) / 255) as u8;
    let pixels = bitmap.rgb.chunks_exact(3).enumerate();
    let mut data = Vec::with_capacity(4 * bitmap.rgb.len() / 3);
    pixels.for_each(|(i, c)| {
        let alpha = bitmap.alpha.as_ref().map_or(0xff, |alpha| alpha[i]);
        data.extend([over(c[0], alpha), over(c[1], alpha), over(c[2], alpha), alpha]);
    });
    Pixmap::from_vec(data, IntSize::from_wh(columns, rows)?)
}

fn path_of(outline: &Outline) -> Option<Path> {
    match outline {
        Outline::Rect(Rect { left, top, right, bottom }) => {
            let [left, top, right, bottom] = [left, top, right, bottom].map(|v| *v as f32);
            Some(PathBuilder::from_rect(SkiaRect::from_ltrb(left, top, right, bottom)?))
        }
        Outline::Circle { center, radius } => {
            PathBuilder::from_circle(center.0 as f32, center.1 as f32, *radius as f32)
        }
        Outline::Polygon(corners) => polyline(corners, true),
    }
}

fn polyline(points: &[Point], is_closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    let (first, rest) = points.split_first()?;
    path.move_to(first.0 as f32, first.1 as f32);
    rest.iter().for_each(|point| path.line_to(point.0 as f32, point.1 as f32));
    if is_closed {
        path.close();
    }
    path.finish()
}

/// Builds a path of glyph outlines, moved to their positions on the canvas.
struct Outlines {
    path: PathBuilder,
    origin: Point,
    /// Direction of the text.
    direction: Point,
    glyph: Option<Glyph>,
    units: f64,
}

impl Outlines {
    fn place(&self, x: f32, y: f32) -> (f32, f32) {
        let Some(glyph) = self.glyph else { return (x, y) };
        let scale = glyph.em / self.units;
        let (along, up) = (glyph.along + f64::from(x) * scale, glyph.raise + f64::from(y) * scale);
        let (dx, dy) = self.direction;
        ((self.origin.0 + along * dx + up * dy) as f32, (self.origin.1 + along * dy - up * dx) as f32)
    }
}

impl OutlineBuilder for Outlines {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.place(x1, y1), self.place(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.place(x1, y1), self.place(x2, y2), self.place(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}
