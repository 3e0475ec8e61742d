//! The head of a figure: title, subtitle and a legend in rows.

use crate::show::color::Color;
use crate::show::drawing::canvas::Canvas;
use crate::show::drawing::shapes::{Align, Marker, Point, Rect};
use crate::show::drawing::style::{DARK, LARGE, MEDIUM, SMALL};
use crate::show::symbols::in_title;

/// Width of a legend key.
pub(crate) const KEY: f64 = 38.0;
/// Room between a key and its text, between entries, and from one row to the next.
const AFTER_KEY: f64 = 10.0;
const BETWEEN: f64 = 34.0;
const LEGEND_ROW: f64 = 34.0;
/// Margin at the sides of title and legend: in a figure of default size, and in others.
const SIDE_MARGIN: f64 = 40.0;
const NARROW_MARGIN: f64 = 10.0;
/// Height of the middle of the first line, if it is not that of the title in a figure of default size.
const FIRST_ROW: f64 = 24.0;
/// Height that is left out without a legend.
const NO_ROW: f64 = 20.0;

/// The symbol of a legend entry.
#[derive(Clone, Copy, Debug)]
pub enum Key {
    /// A solid line.
    Line {
        /// Colour.
        color: Color,
        /// Width in pixels.
        width: f64,
    },
    /// A dashed line.
    Dashes {
        /// Colour.
        color: Color,
    },
    /// A marker.
    Marker(Marker),
    /// A filled and a hollow marker: the states before and after an event.
    MarkerPair(Marker),
    /// A filled rectangle.
    Patch {
        /// Colour.
        color: Color,
        /// Opacity from 0 to 1.
        opacity: f64,
    },
    /// A short upright stroke.
    Mark {
        /// Colour.
        color: Color,
    },
}

/// One legend entry.
#[derive(Clone, Debug)]
pub struct Entry {
    key: Key,
    text: String,
}

impl Entry {
    /// Returns the entry with symbol `key` and a text.
    pub fn new(key: Key, text: &str) -> Entry {
        Entry { key, text: text.to_owned() }
    }
}

/// Draws title, subtitle (any number of lines) and legend, as far as the figure's style has them. Returns the y coordinate
/// below them.
pub fn draw_head(canvas: &Canvas, title: &str, subtitle: &str, entries: &[Entry]) -> f64 {
    let entries = if canvas.style.legend { entries } else { &[] };
    let title = canvas.style.title.clone().unwrap_or_else(|| in_title(title));
    let is_usual = canvas.is_default() && canvas.has_heading();
    let mut y = if is_usual { 40.0 } else { FIRST_ROW };
    if canvas.has_heading() {
        y = draw_lines(canvas, &title, y, LARGE);
        for (i, line) in subtitle.lines().enumerate() {
            y += if i == 0 { 40.0 } else { 34.0 };
            y = draw_lines(canvas, line, y, if canvas.is_default() { MEDIUM } else { SMALL });
        }
        y += 44.0;
        if canvas.style.title.is_none() {
            canvas.heading.set((canvas.items.borrow().len(), y - FIRST_ROW));
        }
    }
    if entries.is_empty() && !is_usual {
        y -= NO_ROW;
    }
    for row in rows(canvas, entries).into_iter().filter(|row| !row.is_empty()) {
        let widths: Vec<f64> = row.iter().map(|e| width(canvas, e)).collect();
        let total = widths.iter().sum::<f64>() + BETWEEN * (row.len() - 1) as f64;
        let mut x = (canvas.size().0 - total) / 2.0;
        for (entry, width) in row.iter().zip(widths) {
            draw_key(canvas, entry.key, (x, y));
            let text = canvas.fitted(&entry.text, SMALL, width + 1.0 - KEY - AFTER_KEY);
            canvas.text(&text, (x + KEY + AFTER_KEY, y), SMALL, Align::Left, DARK);
            x += width + BETWEEN;
        }
        y += LEGEND_ROW;
    }
    y
}

/// Returns the width between the side margins.
fn room(canvas: &Canvas) -> f64 {
    let margin = if canvas.is_default() { SIDE_MARGIN } else { NARROW_MARGIN };
    canvas.size().0 - 2.0 * margin
}

/// Draws a centred text, in smaller type or in several lines if it is too long. Returns the y coordinate of the last line.
fn draw_lines(canvas: &Canvas, text: &str, y: f64, size: f64) -> f64 {
    let fitted = canvas.lines(text, size, room(canvas));
    for (i, line) in fitted.lines.iter().enumerate() {
        let y = y + fitted.pitch() * i as f64;
        canvas.text(line, (canvas.size().0 / 2.0, y), fitted.size, Align::Center, DARK);
    }
    y + fitted.more()
}

fn width(canvas: &Canvas, entry: &Entry) -> f64 {
    (KEY + AFTER_KEY + canvas.text_width(&entry.text, SMALL)).min(room(canvas))
}

/// Splits the legend into the smallest number of rows, of about equal length.
fn rows<'e>(canvas: &Canvas, entries: &'e [Entry]) -> Vec<&'e [Entry]> {
    let room = room(canvas);
    let widths: Vec<f64> = entries.iter().map(|e| width(canvas, e) + BETWEEN).collect();
    let total: f64 = widths.iter().sum();
    let count = (total / room).ceil().max(1.0);
    let mut rows = Vec::new();
    let (mut start, mut used, mut before) = (0, 0.0, 0.0);
    for (i, width) in widths.iter().enumerate() {
        // The row of an entry is the one whose share of the total contains the entry's middle.
        let row_is_full = before + width / 2.0 > total / count * (rows.len() + 1) as f64;
        if i > start && (row_is_full || used + width - BETWEEN > room) {
            rows.push(&entries[start..i]);
            (start, used) = (i, 0.0);
        }
        used += width;
        before += width;
    }
    rows.push(&entries[start..]);
    rows
}

/// Draws the symbol of an entry, whose left end and middle height are given.
pub(crate) fn draw_key(canvas: &Canvas, key: Key, (x, y): Point) {
    let middle = x + KEY / 2.0;
    match key {
        Key::Line { color, width } => canvas.stroke(&[(x, y), (x + KEY, y)], width, color),
        Key::Dashes { color } => canvas.dashes(&[(x, y), (x + KEY, y)], 1.5, color),
        Key::Marker(marker) => canvas.marker((middle, y), marker),
        Key::MarkerPair(marker) => {
            canvas.marker((middle - 10.0, y), marker);
            canvas.marker((middle + 10.0, y), Marker { hollow: true, ..marker })
        }
        Key::Patch { color, opacity } => {
            let rect = Rect { left: x, top: y - 9.0, right: x + KEY, bottom: y + 9.0 };
            canvas.fill(rect, color, opacity)
        }
        Key::Mark { color } => canvas.stroke(&[(middle, y - 8.0), (middle, y + 8.0)], 1.5, color),
    }
}
