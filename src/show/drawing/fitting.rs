//! Widths of texts, and texts shortened to a given width.

use crate::show::drawing::canvas::Canvas;
use crate::show::drawing::typeface::Typeface;

impl Canvas {
    /// Returns the width of a text.
    pub fn text_width(&self, text: &str, size: f64) -> f64 {
        let face = Typeface::of_figures();
        face.set(text, face.em(size)).1
    }

    /// Returns a text, cut with an ellipsis if it is wider than `room`. At least one character is kept.
    pub fn fitted(&self, text: &str, size: f64, room: f64) -> String {
        // Bisection needs few measurements, which are slow for long texts.
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        if ends.len() <= 2 || self.text_width(text, size) <= room {
            return text.to_owned();
        }
        let cut = |count: usize| format!("{}\u{2026}", &text[..ends[count]]);
        // Replacing only the last character by an ellipsis would save nothing.
        let (mut fits, mut too_long) = (1, ends.len() - 1);
        while too_long - fits > 1 {
            let middle = (fits + too_long) / 2;
            if self.text_width(&cut(middle), size) <= room {
                fits = middle;
            } else {
                too_long = middle;
            }
        }
        cut(fits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn the_longest_beginning_that_fits_is_kept() {
        let canvas = Canvas::empty((200.0, 100.0));
        let text = "Gear rattle: restitution \u{d7} excitation frequency";
        let count = text.chars().count();
        let width = |text: &str| canvas.text_width(text, 20.0);
        for room in [0.0, 10.0, 40.0, 111.0, 200.0, 300.0, width(text) - 1.0] {
            let fitted = canvas.fitted(text, 20.0, room);
            let length = fitted.chars().count() - 1;
            assert!(fitted.ends_with('\u{2026}') && length <= count - 2, "{fitted}");
            assert!(text.starts_with(fitted.trim_end_matches('\u{2026}')), "{fitted}");
            assert!(width(&fitted) <= room || length == 1, "{room}: {fitted}");
            let longer: String = text.chars().take(length + 1).chain(['\u{2026}']).collect();
            assert!(width(&longer) > room || length == count - 2, "{room}: {fitted}");
        }
        assert_eq!(canvas.fitted(text, 20.0, width(text)), text);
        assert_eq!(canvas.fitted("ab", 20.0, 0.0), "ab");
    }

    /// Removing one character after another took half a minute.
    #[test]
    fn a_text_of_10_000_characters_is_cut_within_seconds() {
        let (text, clock) = ("W".repeat(10_000), Instant::now());
        let length = Canvas::empty((200.0, 100.0)).fitted(&text, 20.0, 500.0).chars().count();
        assert!((10..100).contains(&length) && clock.elapsed().as_secs() < 5, "{:?}", clock.elapsed());
    }
}
