//! The typeface of figures: widths and outlines of its glyphs, and the layout of superscripts.

use std::sync::LazyLock;

use epaint_default_fonts::UBUNTU_LIGHT;
use ttf_parser::{Face, GlyphId};

use crate::show::drawing::shapes::{Align, Point};
use crate::show::symbols::lowered;

/// Size and height of superscripts, as shares of the line's type size. In the smallest type they have 6 points.
const RAISED: (f64, f64) = (0.82, 0.34);

/// The typeface's file.
#[cfg(not(target_arch = "wasm32"))]
const FILE: &[u8] = UBUNTU_LIGHT;
#[cfg(target_arch = "wasm32")]
const FILE: &[u8] = &super::metrics::file::<{ super::metrics::size() }>();

/// A parsed typeface.
#[derive(Debug)]
pub(crate) struct Typeface {
    face: Face<'static>,
    /// Units of the typeface per em.
    units: f64,
}

/// A glyph and its position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glyph {
    pub(crate) id: u16,
    /// Character that it represents.
    pub(crate) sign: char,
    /// Distance from the beginning of the line, in pixels.
    pub(crate) along: f64,
    /// Height above the baseline.
    pub(crate) raise: f64,
    /// Type size.
    pub(crate) em: f64,
}

/// Consecutive characters that are all on the line or all superscripts.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub(crate) text: String,
    pub(crate) is_raised: bool,
}

impl Run {
    /// Returns size and height as shares of the line's type size.
    pub(crate) fn place(&self) -> (f64, f64) {
        if self.is_raised { RAISED } else { (1.0, 0.0) }
    }
}

/// Splits a text into runs. Superscripts are replaced by ordinary digits and minus, to be drawn smaller: the typeface has
/// no raised minus, and its raised digits are higher.
pub(crate) fn runs(text: &str) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for sign in text.chars() {
        let lowered = lowered(sign);
        let (sign, is_raised) = (lowered.unwrap_or(sign), lowered.is_some());
        match runs.last_mut() {
            Some(run) if run.is_raised == is_raised => run.text.push(sign),
            _ => runs.push(Run { text: sign.to_string(), is_raised }),
        }
    }
    runs
}

impl Typeface {
    /// Returns the typeface of all figures.
    pub(crate) fn of_figures() -> &'static Typeface {
        static FACE: LazyLock<Typeface> = LazyLock::new(|| {
            let face = Face::parse(FILE, 0).expect("the bytes of the typeface are compiled in");
            let units = f64::from(face.units_per_em());
            Typeface { face, units }
        });
        &FACE
    }

    /// Returns the typeface's file.
    pub(crate) fn bytes() -> &'static [u8] {
        FILE
    }

    /// Returns the parsed file.
    pub(crate) fn face(&self) -> &Face<'static> {
        &self.face
    }

    /// Returns the em of type whose lines have height `size`, from the lowest descender to the highest ascender.
    pub(crate) fn em(&self, size: f64) -> f64 {
        size * self.units / f64::from(self.face.ascender() - self.face.descender())
    }

    /// Returns the height of capitals and digits.
    pub(crate) fn cap_height(&self, em: f64) -> f64 {
        f64::from(self.face.capital_height().unwrap_or(0)) / self.units * em
    }

    /// Returns the width of a glyph in ems.
    pub(crate) fn advance(&self, id: u16) -> f64 {
        f64::from(self.face.glyph_hor_advance(GlyphId(id)).unwrap_or(0)) / self.units
    }

    /// Returns the glyphs of a text and its width.
    pub(crate) fn set(&self, text: &str, em: f64) -> (Vec<Glyph>, f64) {
        let mut glyphs = Vec::with_capacity(text.len());
        let mut along = 0.0;
        for run in runs(text) {
            let (scale, raise) = run.place();
            for sign in run.text.chars() {
                // Glyph 0 is a box; it represents unknown characters.
                let id = self.face.glyph_index(sign).map_or(0, |id| id.0);
                glyphs.push(Glyph { id, sign, along, raise: raise * em, em: scale * em });
                along += self.advance(id) * scale * em;
            }
        }
        (glyphs, along)
    }
}

/// Returns the beginning of a text of the given width, and its direction.
pub(crate) fn beginning(at: Point, width: f64, align: Align) -> (Point, Point) {
    match align {
        Align::Left => (at, (1.0, 0.0)),
        Align::Center => ((at.0 - width / 2.0, at.1), (1.0, 0.0)),
        Align::Right => ((at.0 - width, at.1), (1.0, 0.0)),
        Align::Upwards => ((at.0, at.1 + width / 2.0), (0.0, -1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn superscripts_are_ordinary_digits_in_smaller_type() {
        let run = |text: &str, is_raised| Run { text: text.to_owned(), is_raised };
        assert_eq!(
            runs("2\u{b7}10\u{207b}\u{b9}\u{2076} s"),
            [run("2\u{b7}10", false), run("\u{2212}16", true), run(" s", false)]
        );
        let face = Typeface::of_figures();
        let [(_, raised), (_, plain)] = ["10\u{b3}", "103"].map(|text| face.set(text, 10.0));
        assert!(raised < plain && raised > face.set("10", 10.0).1);
    }

    #[test]
    fn the_typeface_has_every_character_of_figures() {
        let face = Typeface::of_figures();
        let signs = "\u{3c9}\u{3bb}\u{2212}\u{b7}\u{d7}\u{b1}\u{2026}\u{2264}\u{2265}\u{2080}\u{2081}\u{2082}\u{2089}\u{207b}\u{2074}";
        assert!(face.set(signs, 10.0).0.iter().all(|glyph| glyph.id != 0), "{:?}", face.set(signs, 10.0).0);
    }
}
