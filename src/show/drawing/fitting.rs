//! Widths of texts, and texts shortened or broken into lines to fit a given width.

use crate::show::drawing::canvas::Canvas;
use crate::show::drawing::style::SMALL;
use crate::show::drawing::typeface::Typeface;

/// Smallest type of a heading or an axis name in a figure of default width and type size.
const SMALLEST: f64 = 16.0;
/// Separators at which lines are broken, the best ones first. Words at a separator are no reason to break an equation.
const SEPARATORS: [&[&str]; 3] = [&["; ", ": ", "  \u{b7}  "], &[", "], &[" "]];

/// Lines of a text and their type size.
pub(crate) struct Lines {
    pub(crate) lines: Vec<String>,
    pub(crate) size: f64,
}

impl Lines {
    /// Returns the distance from one line to the next.
    pub(crate) fn pitch(&self) -> f64 {
        1.25 * self.size
    }

    /// Returns the height that the lines after the first one need.
    pub(crate) fn more(&self) -> f64 {
        self.pitch() * self.lines.len().saturating_sub(1) as f64
    }
}

impl Canvas {
    /// Returns a text in type of at most `size` that fits the width `room`: in smaller type if the figure may have it, and
    /// in several lines if that is not enough.
    pub(crate) fn lines(&self, text: &str, size: f64, room: f64) -> Lines {
        let smallest = if self.is_default() { SMALLEST } else { SMALL };
        let size = (size * room / self.text_width(text, size).max(1.0)).clamp(smallest, size);
        // Rounding must not break a line that fits.
        Lines { lines: self.broken(text, size, room + 1.0, &SEPARATORS), size }
    }

    fn broken(&self, text: &str, size: f64, room: f64, separators: &[&[&str]]) -> Vec<String> {
        let fits = |text: &str| self.text_width(text.trim_end(), size) <= room;
        let Some((first, rest)) = separators.split_first().filter(|_| !fits(text)) else {
            return vec![self.fitted(text.trim_end(), size, room)];
        };
        let mut lines: Vec<String> = Vec::new();
        let mut line = String::new();
        for part in parts(text, first) {
            if fits(&format!("{line}{part}")) {
                line += part;
                continue;
            }
            if !line.is_empty() {
                // A separator at the end of a line is superfluous.
                lines.push(std::mem::take(&mut line).trim_end_matches([' ', '\u{b7}']).to_owned());
            }
            let mut broken = self.broken(part, size, room, rest);
            line = broken.pop().unwrap_or_default();
            if part.ends_with(' ') {
                line.push(' ');
            }
            lines.extend(broken);
        }
        lines.push(line.trim_end().to_owned());
        lines
    }

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

/// Splits a text after each of the separators.
fn parts<'t>(text: &'t str, separators: &[&str]) -> Vec<&'t str> {
    let mut parts = vec![text];
    for separator in separators {
        parts = parts.into_iter().flat_map(|part| part.split_inclusive(separator)).collect();
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::scene::FigureStyle;
    use std::time::Instant;

    #[test]
    fn long_texts_are_broken_between_parts_and_lose_nothing() {
        let canvas = Canvas::new(&FigureStyle { width: Some(240.0), ..FigureStyle::default() }, 0.0);
        let text = "omega = 5.6, k = 900, r = 0.5; every cell from rest, at most 400 + 128 forcing periods";
        for room in [250.0, 400.0, 700.0] {
            let Lines { lines, size } = canvas.lines(text, 26.0, room);
            assert_eq!(lines.join(" "), text);
            assert!(size >= SMALL && lines.len() > 1, "{lines:?}");
            assert!(lines.iter().all(|line| canvas.text_width(line, size) <= room + 1.0), "{lines:?}");
            assert!(!lines.iter().any(|line| line.ends_with('=')), "{lines:?}");
        }
        assert_eq!(canvas.lines("short", 26.0, 250.0).lines, ["short"]);
    }

    #[test]
    fn the_longest_beginning_that_fits_is_kept() {
        let canvas = Canvas::new(&FigureStyle::default(), 200.0);
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
        let length = Canvas::new(&FigureStyle::default(), 200.0).fitted(&text, 20.0, 500.0).chars().count();
        assert!((10..100).contains(&length) && clock.elapsed().as_secs() < 5, "{:?}", clock.elapsed());
    }
}
