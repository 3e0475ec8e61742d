//! A panel with two axes: maps data to pixels and draws grid, ticks and labels.

use crate::show::drawing::axis::Axis;
use crate::show::drawing::canvas::Canvas;
use crate::show::drawing::shapes::{Align, Point, Rect};
use crate::show::drawing::style::{DARK, GRID, MEDIUM, SMALL};
use crate::show::drawing::ticks::{Tick, ticks};

/// Length of the marks of ticks with a label, and of those without.
const MAJOR_MARK: f64 = 7.0;
const MINOR_MARK: f64 = 4.0;
/// Smallest type of an axis name, and the margin beyond its ends.
const SMALLEST_NAME: f64 = 16.0;
const NAME_MARGIN: f64 = 12.0;
/// Smallest type of tick labels of the y axis, and the room for the widest of them.
const SMALLEST_LABEL: f64 = 12.0;
const LABEL_ROOM: f64 = 97.0;
/// Least distance of the middle of the y axis name from the left edge of the picture.
const NAME_MIDDLE: f64 = 14.0;
/// Distance from the widest label to the middle of the y axis name.
const NAME_AWAY: f64 = 26.0;
/// Least distances between ticks: on the x axis, on the y axis, and beside a colour bar.
const X_SPACING: f64 = 90.0;
const Y_SPACING: f64 = 60.0;
const BAR_SPACING: f64 = 45.0;

/// Draws the name of an axis, in smaller type if it is too long.
fn draw_name(canvas: &Canvas, name: &str, at: Point, room: f64, align: Align) {
    let size = (MEDIUM * room / canvas.text_width(name, MEDIUM).max(1.0)).clamp(SMALLEST_NAME, MEDIUM);
    canvas.text(&canvas.fitted(name, size, room + 1.0), at, size, align, DARK);
}

/// Returns the length of a tick's mark. Minor ticks have no label.
fn mark_length(label: &str) -> f64 {
    if label.is_empty() { MINOR_MARK } else { MAJOR_MARK }
}

/// A panel: its place on the canvas and its axes.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Place on the canvas.
    pub rect: Rect,
    /// Axis to the right.
    pub x: Axis,
    /// Axis upwards.
    pub y: Axis,
}

impl Frame {
    /// Returns the pixel of a data point.
    pub fn at(&self, x: f64, y: f64) -> Point {
        (self.x_pixel(self.x.place(x)), self.y_pixel(self.y.place(y)))
    }

    fn x_pixel(&self, place: f64) -> f64 {
        let Rect { left, right, .. } = self.rect;
        left + (place - self.x.low) / (self.x.high - self.x.low) * (right - left)
    }

    fn y_pixel(&self, place: f64) -> f64 {
        let Rect { top, bottom, .. } = self.rect;
        bottom - (place - self.y.low) / (self.y.high - self.y.low) * (bottom - top)
    }

    /// Returns the part of the panel between two values of x.
    pub fn column(&self, from: f64, to: f64) -> Rect {
        let [from, to] = [from, to].map(|x| self.at(x, 0.0).0.clamp(self.rect.left, self.rect.right));
        Rect { left: from, right: to, ..self.rect }
    }

    /// Draws the grid. Call it before drawing data.
    pub fn draw_grid(&self, canvas: &Canvas) {
        let Rect { left, top, right, bottom } = self.rect;
        let is_major = |tick: &Tick| !tick.label.is_empty();
        for tick in self.x_ticks().into_iter().filter(is_major) {
            let x = self.x_pixel(tick.at);
            canvas.stroke(&[(x, top), (x, bottom)], 1.0, GRID);
        }
        for tick in self.y_ticks(Y_SPACING).into_iter().filter(is_major) {
            let y = self.y_pixel(tick.at);
            canvas.stroke(&[(left, y), (right, y)], 1.0, GRID);
        }
    }

    /// Draws border, ticks and labels. Call it after drawing data. `x_labels` is false for a panel that shares the x axis
    /// of the panel below.
    pub fn draw_axes(&self, canvas: &Canvas, x_labels: bool) {
        let Rect { left, top, bottom, .. } = self.rect;
        canvas.outline(self.rect, 1.5);
        self.draw_x_axis(canvas, x_labels);
        let (ticks, from) = (self.y_ticks(Y_SPACING), left - MAJOR_MARK - 6.0);
        let widths = ticks.iter().map(|tick| canvas.text_width(&tick.label, SMALL));
        let widest = widths.fold(0.0, f64::max);
        let room = (from - NAME_AWAY - NAME_MIDDLE).min(LABEL_ROOM);
        let size = (SMALL * room / widest.max(1.0)).clamp(SMALLEST_LABEL, SMALL);
        for Tick { at, label } in ticks {
            let y = self.y_pixel(at);
            canvas.stroke(&[(left - mark_length(&label), y), (left, y)], 1.5, DARK);
            canvas.text(&label, (from, y), size, Align::Right, DARK);
        }
        let x = (from - widest * size / SMALL - NAME_AWAY).max(NAME_MIDDLE);
        let y = (top + bottom) / 2.0;
        let room = 2.0 * y.min(canvas.size().1 - y) - 2.0 * NAME_MARGIN;
        draw_name(canvas, &self.y.label, (x, y), room, Align::Upwards);
    }

    /// Draws the lower edge with its ticks, and with `labels` their labels and the axis name.
    pub fn draw_x_axis(&self, canvas: &Canvas, labels: bool) {
        let Rect { left, right, bottom, .. } = self.rect;
        canvas.stroke(&[(left, bottom), (right, bottom)], 1.5, DARK);
        for Tick { at, label } in self.x_ticks() {
            let x = self.x_pixel(at);
            canvas.stroke(&[(x, bottom), (x, bottom + mark_length(&label))], 1.5, DARK);
            if labels {
                canvas.text(&label, (x, bottom + MAJOR_MARK + 17.0), SMALL, Align::Center, DARK);
            }
        }
        if labels {
            let middle = ((left + right) / 2.0, bottom + MAJOR_MARK + 54.0);
            let room = 2.0 * middle.0.min(canvas.size().0 - middle.0) - 2.0 * NAME_MARGIN;
            draw_name(canvas, &self.x.label, middle, room, Align::Center);
        }
    }

    /// Draws ticks and labels of the y axis on the right side, for a colour bar.
    pub fn draw_scale(&self, canvas: &Canvas) {
        let right = self.rect.right;
        for Tick { at, label } in self.y_ticks(BAR_SPACING) {
            let y = self.y_pixel(at);
            canvas.stroke(&[(right, y), (right + mark_length(&label), y)], 1.5, DARK);
            canvas.text(&label, (right + MAJOR_MARK + 7.0, y), SMALL, Align::Left, DARK);
        }
    }

    fn x_ticks(&self) -> Vec<Tick> {
        ticks(&self.x, self.rect.right - self.rect.left, X_SPACING)
    }

    fn y_ticks(&self, spacing: f64) -> Vec<Tick> {
        ticks(&self.y, self.rect.bottom - self.rect.top, spacing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithmic_axes_span_whole_decades_and_values_beyond_an_end_are_drawn_on_it() {
        let axis = Axis::decades("", [3e-7, 0.2, 0.0, f64::INFINITY, f64::NAN].into_iter());
        assert_eq!((axis.low, axis.high), (-7.0, 0.0));
        let flat = Axis::decades("", [10.0].into_iter());
        assert_eq!((flat.low, flat.high), (1.0, 2.0));
        assert!(Axis::decades("", std::iter::empty()).low < 0.0);
        let rect = Rect { left: 0.0, top: 0.0, right: 70.0, bottom: 10.0 };
        let frame = Frame { rect, x: axis, y: flat };
        assert_eq!(frame.at(1e-6, 1e9), (10.0, 0.0));
        assert_eq!(frame.at(0.0, 10.0), (0.0, 10.0));
    }
}
