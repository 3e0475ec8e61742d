//! The head of a figure: title, subtitle and a legend in rows.

use crate::show::drawing::{Align, Canvas, DARK, LARGE, MEDIUM, Marker, Point, RGBColor, Rect, SMALL};
use crate::show::error::DrawError;

/// Width of a legend's key, and the room on either side of its text.
const KEY: f64 = 38.0;
const GAP: f64 = 10.0;
const BETWEEN: f64 = 34.0;
const ROW: f64 = 34.0;
/// Smallest type of a title that has to be squeezed.
const SMALLEST: f64 = 16.0;
const MARGIN: f64 = 40.0;

/// What stands before a legend's text.
#[derive(Clone, Copy, Debug)]
pub enum Key {
    /// A stretch of a line.
    Line {
        /// Its colour.
        color: RGBColor,
        /// Its width in pixels.
        width: f64,
    },
    /// A dashed line.
    Dashes {
        /// Its colour.
        color: RGBColor,
    },
    /// A marker.
    Marker(Marker),
    /// A filled and a hollow marker: the states before and after.
    MarkerPair(Marker),
    /// An area.
    Patch {
        /// Its colour.
        color: RGBColor,
        /// From 0 to 1.
        opacity: f64,
    },
    /// A short upright stroke.
    Mark {
        /// Its colour.
        color: RGBColor,
    },
}

/// One legend entry.
#[derive(Clone, Debug)]
pub struct Entry {
    key: Key,
    text: String,
}

impl Entry {
    /// `text` behind `key`.
    pub fn new(key: Key, text: &str) -> Entry {
        Entry { key, text: text.to_owned() }
    }
}

/// Draws title, subtitle (of several lines, or none) and legend; returns where the panels may start.
pub fn draw_head(
    canvas: &Canvas<'_>,
    title: &str,
    subtitle: &str,
    entries: &[Entry],
) -> Result<f64, DrawError> {
    let mut y = 40.0;
    draw_fitted(canvas, title, y, LARGE)?;
    for (i, line) in subtitle.lines().enumerate() {
        y += if i == 0 { 40.0 } else { 34.0 };
        draw_fitted(canvas, line, y, MEDIUM)?;
    }
    y += 44.0;
    for row in rows(canvas, entries)?.into_iter().filter(|row| !row.is_empty()) {
        let widths = row.iter().map(|e| width(canvas, e)).collect::<Result<Vec<_>, DrawError>>()?;
        let total = widths.iter().sum::<f64>() + BETWEEN * (row.len() - 1) as f64;
        let mut x = (canvas.size().0 - total) / 2.0;
        for (entry, width) in row.iter().zip(widths) {
            draw_key(canvas, entry.key, (x, y))?;
            canvas.text(&entry.text, (x + KEY + GAP, y), SMALL, Align::Left, DARK)?;
            x += width + BETWEEN;
        }
        y += ROW;
    }
    Ok(y)
}

/// A centred line, in smaller type if it is too long, and cut if that is not enough.
fn draw_fitted(canvas: &Canvas<'_>, text: &str, y: f64, size: f64) -> Result<(), DrawError> {
    let room = canvas.size().0 - 2.0 * MARGIN;
    let size = (size * room / canvas.text_width(text, size)?.max(1.0)).clamp(SMALLEST, size);
    let text = canvas.fitted(text, size, room + 1.0)?;
    canvas.text(&text, (canvas.size().0 / 2.0, y), size, Align::Center, DARK)
}

fn width(canvas: &Canvas<'_>, entry: &Entry) -> Result<f64, DrawError> {
    Ok(KEY + GAP + canvas.text_width(&entry.text, SMALL)?)
}

/// Breaks the legend into as few rows as fit, of about the same length.
fn rows<'e>(canvas: &Canvas<'_>, entries: &'e [Entry]) -> Result<Vec<&'e [Entry]>, DrawError> {
    let room = canvas.size().0 - 2.0 * MARGIN;
    let widths =
        entries.iter().map(|e| Ok(width(canvas, e)? + BETWEEN)).collect::<Result<Vec<_>, DrawError>>()?;
    let total: f64 = widths.iter().sum();
    let count = (total / room).ceil().max(1.0);
    let mut rows = Vec::new();
    let (mut start, mut used, mut before) = (0, 0.0, 0.0);
    for (i, width) in widths.iter().enumerate() {
        // An entry belongs to the row in whose share of the total its middle lies.
        let row_is_full = before + width / 2.0 > total / count * (rows.len() + 1) as f64;
        if i > start && (row_is_full || used + width - BETWEEN > room) {
            rows.push(&entries[start..i]);
            (start, used) = (i, 0.0);
        }
        used += width;
        before += width;
    }
    rows.push(&entries[start..]);
    Ok(rows)
}

fn draw_key(canvas: &Canvas<'_>, key: Key, (x, y): Point) -> Result<(), DrawError> {
    let middle = x + KEY / 2.0;
    match key {
        Key::Line { color, width } => canvas.stroke(&[(x, y), (x + KEY, y)], width, color),
        Key::Dashes { color } => canvas.dashes((x, y), (x + KEY, y), 1.5, color),
        Key::Marker(marker) => canvas.marker((middle, y), marker),
        Key::MarkerPair(marker) => {
            canvas.marker((middle - 10.0, y), marker)?;
            canvas.marker((middle + 10.0, y), Marker { hollow: true, ..marker })
        }
        Key::Patch { color, opacity } => {
            let rect = Rect { left: x, top: y - 9.0, right: x + KEY, bottom: y + 9.0 };
            canvas.fill(rect, color, opacity)
        }
        Key::Mark { color } => canvas.stroke(&[(middle, y - 8.0), (middle, y + 8.0)], 1.5, color),
    }
}
