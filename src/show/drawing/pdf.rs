//! Pictures as PDF: one page, text in an embedded typeface, maps as images with one pixel per cell.
//!
//! The file contains no date and no host: the same picture gives the same bytes.

use std::collections::BTreeMap;
use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect as PdfRect, Ref, Str, TextStr};
use subsetter::GlyphRemapper;

use crate::show::color::Color;
use crate::show::drawing::canvas::{Bitmap, Canvas, Item, Outline};
use crate::show::drawing::shapes::{Point, Rect};
use crate::show::drawing::style::DASH;
use crate::show::drawing::typeface::{Glyph, Typeface, beginning};
use crate::show::error::WriteError;

const FONT: Name<'static> = Name(b"F");
/// Offset of the control points of a quarter circle's Bezier curve, over the radius.
const HANDLE: f64 = 0.552_284_75;
const IDENTITY: SystemInfo<'static> =
    SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

/// Returns the bytes of the file.
pub(crate) fn encoded(canvas: &Canvas) -> Result<Vec<u8>, WriteError> {
    let mut page = Page {
        content: Content::new(),
        glyphs: GlyphRemapper::new(),
        signs: BTreeMap::new(),
        opacities: BTreeMap::new(),
        images: Vec::new(),
    };
    // Coordinates are units from the upper left corner.
    let points = 72.0 / canvas.per_inch;
    let (heading, above) = canvas.heading.get();
    let (scale, size) =
        (points as f32, [canvas.size().0, canvas.size().1 - above].map(|side| (side * points) as f32));
    page.content.transform([scale, 0.0, 0.0, -scale, 0.0, size[1] + (above * points) as f32]);
    page.content.set_line_cap(LineCapStyle::RoundCap).set_line_join(LineJoinStyle::RoundJoin);
    let items = canvas.items.borrow();
    items.iter().skip(heading).for_each(|item| page.draw(item));
    page.finish(size)
}

/// A page under construction and the resources that it uses.
struct Page<'c> {
    content: Content,
    /// Glyphs that occur, with new numbers.
    glyphs: GlyphRemapper,
    /// Characters and widths (thousandths of an em) of the glyphs, by new number.
    signs: BTreeMap<u16, (char, f32)>,
    /// Objects of the opacities, by thousandths.
    opacities: BTreeMap<u32, Ref>,
    images: Vec<&'c Bitmap>,
}

impl<'c> Page<'c> {
    fn draw(&mut self, item: &'c Item) {
        match item {
            Item::Area { outline, color, opacity } => {
                let thousandths = (opacity * 1000.0).round() as u32;
                self.fill_color(*color);
                if thousandths < 1000 {
                    self.opacities.insert(thousandths, Ref::new(1));
                    self.content.save_state().set_parameters(Name(&opacity_name(thousandths)));
                }
                self.outline(outline);
                self.content.fill_nonzero();
                if thousandths < 1000 {
                    self.content.restore_state();
                }
            }
            Item::Line { path, width, color, is_dashed } => {
                let [r, g, b] = shares(*color);
                self.content.set_stroke_rgb(r, g, b).set_line_width(*width as f32);
                let dashes: &[f32] = if *is_dashed { &[DASH as f32] } else { &[] };
                self.content.set_dash_pattern(dashes.iter().copied(), 0.0);
                self.path(path);
                self.content.stroke();
            }
            Item::Text { text, at, em, align, color } => {
                self.fill_color(*color);
                let (glyphs, width) = Typeface::of_figures().set(text, *em);
                let (origin, direction) = beginning(*at, width, *align);
                self.content.begin_text();
                for run in glyphs.chunk_by(|a, b| a.em == b.em && a.raise == b.raise) {
                    self.text(run, origin, direction);
                }
                self.content.end_text();
            }
            Item::Image { rect: Rect { left, top, right, bottom }, bitmap } => {
                let [left, width, bottom, height] =
                    [*left, right - left, *bottom, bottom - top].map(|v| v as f32);
                let name = image_name(self.images.len());
                self.content.save_state();
                self.content.transform([width, 0.0, 0.0, -height, left, bottom]).x_object(Name(&name));
                self.content.restore_state();
                self.images.push(bitmap);
            }
        }
    }

    fn fill_color(&mut self, color: Color) {
        let [r, g, b] = shares(color);
        self.content.set_fill_rgb(r, g, b);
    }

    fn path(&mut self, points: &[Point]) {
        for (i, (x, y)) in points.iter().enumerate() {
            let [x, y] = [*x, *y].map(hundredths);
            if i == 0 {
                self.content.move_to(x, y)
            } else {
                self.content.line_to(x, y)
            };
        }
    }

    fn outline(&mut self, outline: &Outline) {
        match outline {
            Outline::Rect(Rect { left, top, right, bottom }) => {
                let [x, y, width, height] = [*left, *top, right - left, bottom - top].map(hundredths);
                self.content.rect(x, y, width, height);
            }
            Outline::Circle { center, radius } => {
                let at = |dx: f64, dy: f64| [center.0 + dx * radius, center.1 + dy * radius].map(hundredths);
                let [x, y] = at(1.0, 0.0);
                self.content.move_to(x, y);
                for (x, y) in [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)] {
                    // The quarter from (x, y) to (-y, x).
                    let [x1, y1] = at(x - HANDLE * y, y + HANDLE * x);
                    let [x2, y2] = at(-y + HANDLE * x, x + HANDLE * y);
                    let [x3, y3] = at(-y, x);
                    self.content.cubic_to(x1, y1, x2, y2, x3, y3);
                }
                self.content.close_path();
            }
            Outline::Polygon(corners) => {
                self.path(corners);
                self.content.close_path();
            }
        }
    }

    /// Adds glyphs of one size on one line.
    fn text(&mut self, run: &[Glyph], origin: Point, (dx, dy): Point) {
        let Some(first) = run.first() else { return };
        let (x, y) =
            (origin.0 + first.along * dx + first.raise * dy, origin.1 + first.along * dy - first.raise * dx);
        // The page's y axis points downwards, the text's upwards.
        let [a, b, c, d] = [dx, dy, dy, -dx].map(|v| v as f32);
        let mut numbers = Vec::with_capacity(2 * run.len());
        for glyph in run {
            let new = self.glyphs.remap(glyph.id);
            self.signs.insert(new, (glyph.sign, (1000.0 * Typeface::of_figures().advance(glyph.id)) as f32));
            numbers.extend(new.to_be_bytes());
        }
        self.content.set_font(FONT, hundredths(first.em));
        self.content.set_text_matrix([a, b, c, d, hundredths(x), hundredths(y)]).show(Str(&numbers));
    }

    fn finish(self, [width, height]: [f32; 2]) -> Result<Vec<u8>, WriteError> {
        let mut pdf = Pdf::new();
        let mut last = 0;
        let mut next = || {
            last += 1;
            Ref::new(last)
        };
        let (catalog, pages, page, content, font) = (next(), next(), next(), next(), next());
        let mut opacities = self.opacities;
        opacities.values_mut().for_each(|id| *id = next());
        let images: Vec<[Ref; 2]> = self.images.iter().map(|_| [next(), next()]).collect();
        pdf.catalog(catalog).pages(pages);
        pdf.pages(pages).kids([page]).count(1);
        let mut sheet = pdf.page(page);
        sheet.media_box(PdfRect::new(0.0, 0.0, width, height)).parent(pages).contents(content);
        let mut resources = sheet.resources();
        resources.fonts().pair(FONT, font);
        let mut states = resources.ext_g_states();
        for (thousandths, id) in &opacities {
            states.pair(Name(&opacity_name(*thousandths)), id);
        }
        states.finish();
        let mut objects = resources.x_objects();
        for (i, [id, _]) in images.iter().enumerate() {
            objects.pair(Name(&image_name(i)), id);
        }
        objects.finish();
        resources.finish();
        sheet.finish();
        for (thousandths, id) in &opacities {
            pdf.ext_graphics(*id).non_stroking_alpha(*thousandths as f32 / 1000.0);
        }
        for (bitmap, ids) in self.images.iter().zip(images) {
            write_image(&mut pdf, ids, bitmap);
        }
        let data = compressed(&self.content.finish());
        pdf.stream(content, &data).filter(Filter::FlateDecode);
        let ids = [font, next(), next(), next(), next()];
        write_font(&mut pdf, ids, &self.glyphs, &self.signs)?;
        pdf.document_info(next()).producer(TextStr("rattlemap"));
        Ok(pdf.finish())
    }
}

fn write_image(pdf: &mut Pdf, [id, mask]: [Ref; 2], bitmap: &Bitmap) {
    let [columns, rows] = bitmap.size.map(|side| side as i32);
    for (id, samples) in [(id, Some(&bitmap.rgb)), (mask, bitmap.alpha.as_ref())] {
        let Some(samples) = samples.map(|samples| compressed(samples)) else { continue };
        let mut image = pdf.image_xobject(id, &samples);
        image.filter(Filter::FlateDecode);
        image.width(columns).height(rows).bits_per_component(8).interpolate(bitmap.is_smooth);
        if id == mask {
            image.color_space().device_gray();
            continue;
        }
        image.color_space().device_rgb();
        if bitmap.alpha.is_some() {
            image.s_mask(mask);
        }
    }
}

/// Embeds the glyphs that occur and the table of the characters that they represent.
fn write_font(
    pdf: &mut Pdf,
    [font, descendant, descriptor, file, unicode]: [Ref; 5],
    glyphs: &GlyphRemapper,
    signs: &BTreeMap<u16, (char, f32)>,
) -> Result<(), WriteError> {
    let subset = subsetter::subset(Typeface::bytes(), 0, glyphs)?;
    // Different subsets of a typeface need different names.
    let mut hash = crc32fast::hash(&subset);
    let tag = std::iter::from_fn(|| {
        let letter = char::from(b'A' + (hash % 26) as u8);
        hash /= 26;
        Some(letter)
    });
    let name = format!("{}+Ubuntu-Light", tag.take(6).collect::<String>());
    let name = Name(name.as_bytes());
    pdf.type0_font(font)
        .base_font(name)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(descendant)
        .to_unicode(unicode);
    let mut cid = pdf.cid_font(descendant);
    cid.subtype(CidFontType::Type2).base_font(name).system_info(IDENTITY).font_descriptor(descriptor);
    cid.cid_to_gid_map_predefined(Name(b"Identity")).default_width(0.0);
    let mut widths = cid.widths();
    for (glyph, (_, width)) in signs {
        widths.consecutive(*glyph, [*width]);
    }
    widths.finish();
    cid.finish();
    let face = Typeface::of_figures().face();
    let thousandths = |units: i16| 1000.0 * f32::from(units) / f32::from(face.units_per_em());
    let bounds = face.global_bounding_box();
    let [left, bottom, right, top] =
        [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(thousandths);
    pdf.font_descriptor(descriptor)
        .name(name)
        .flags(FontFlags::NON_SYMBOLIC)
        .bbox(PdfRect::new(left, bottom, right, top))
        .italic_angle(0.0)
        .ascent(thousandths(face.ascender()))
        .descent(thousandths(face.descender()))
        .cap_height(thousandths(face.capital_height().unwrap_or(0)))
        .stem_v(60.0)
        .font_file2(file);
    let data = compressed(&subset);
    pdf.stream(file, &data).filter(Filter::FlateDecode);
    let mut map = UnicodeCmap::new(Name(b"Characters"), IDENTITY);
    // Glyph 0 represents all characters that the typeface lacks, so it has no character of its own.
    signs.iter().filter(|(glyph, _)| **glyph != 0).for_each(|(glyph, (sign, _))| map.pair(*glyph, *sign));
    let data = compressed(&map.finish());
    pdf.cmap(unicode, &data).filter(Filter::FlateDecode);
    Ok(())
}

fn opacity_name(thousandths: u32) -> Vec<u8> {
    format!("O{thousandths}").into_bytes()
}

fn image_name(nth: usize) -> Vec<u8> {
    format!("I{nth}").into_bytes()
}

fn shares(color: Color) -> [f32; 3] {
    color.map(|value| f32::from(value) / 255.0)
}

/// Rounds to hundredths. More digits would only make the file longer.
fn hundredths(value: f64) -> f32 {
    ((value * 100.0).round() / 100.0) as f32
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to memory cannot fail.
    encoder.write_all(bytes).and_then(|()| encoder.finish()).unwrap_or_default()
}
