//! A panel with two axes: maps data to pixels and draws grid, ticks and labels.

use crate::show::drawing::axis::Axis;
use crate::show::drawing::canvas::Canvas;
use crate::show::drawing::fitting::Lines;
use crate::show::drawing::shapes::{Align, Point, Rect};
use crate::show::drawing::style::{DARK, GRID, MEDIUM, SMALL};
use crate::show::drawing::ticks::{Tick, Ticks, ticks};

/// Length of the marks of ticks with a label, and of those without.
const MAJOR_MARK: f64 = 7.0;
const MINOR_MARK: f64 = 4.0;
/// Margin between the edges of the picture and the ends of an axis name.
const NAME_MARGIN: f64 = 12.0;
/// Room for an axis name beyond both ends of its axis together.
const BESIDE_X: f64 = 120.0;
const BESIDE_Y: f64 = 28.0;
/// Least distance of the middle of the y axis name from the left edge of the picture.
const NAME_MIDDLE: f64 = 14.0;
/// Distance from the axis to its labels, and from the widest label to the middle of the y axis name.
const LABEL_AWAY: f64 = MAJOR_MARK + 6.0;
const NAME_AWAY: f64 = 26.0;
/// Distances from the x axis to the middles of its labels and of its name.
const X_LABEL: f64 = MAJOR_MARK + 17.0;
const X_NAME: f64 = MAJOR_MARK + 54.0;
/// Margins of a figure of default size, right of the panels and below them.
const RIGHT: f64 = 58.0;
const BELOW: f64 = 105.0;
/// Least margin of other figures.
const LEAST: f64 = 8.0;
/// Distance between panels one below the other.
const PANEL_GAP: f64 = 30.0;
/// Least distance of labels on the x axis.
const BETWEEN_LABELS: f64 = 12.0;
/// Least distances between ticks: on the x axis, on the y axis, and beside a colour bar.
const X_SPACING: f64 = 90.0;
const Y_SPACING: f64 = 60.0;
const BAR_SPACING: f64 = 45.0;

/// Returns the name of the y axis of a panel of the given height.
fn y_name(canvas: &Canvas, name: &str, height: f64) -> Lines {
    canvas.lines(name, MEDIUM, height + BESIDE_Y)
}

/// Returns the name of the x axis of a panel between two positions.
fn x_name(canvas: &Canvas, name: &str, [left, right]: [f64; 2]) -> Lines {
    let middle = (left + right) / 2.0;
    let room = 2.0 * middle.min(canvas.size().0 - middle) - 2.0 * NAME_MARGIN;
    canvas.lines(name, MEDIUM, room.min(right - left + BESIDE_X))
}

/// Returns the width of the widest label.
fn widest(canvas: &Canvas, ticks: &Ticks) -> f64 {
    ticks.list.iter().map(|tick| canvas.text_width(&tick.label, SMALL)).fold(0.0, f64::max)
}

/// Returns the ticks of an x axis of the given length. Their labels do not overlap.
fn x_ticks(canvas: &Canvas, axis: &Axis, length: f64) -> Ticks {
    let mut spacing = X_SPACING;
    loop {
        let found = ticks(axis, length, spacing);
        let labels = found.list.iter().filter(|tick| !tick.label.is_empty());
        let places: Vec<(f64, f64)> = labels
            .map(|tick| {
                let middle = (tick.at - axis.low) / (axis.high - axis.low) * length;
                (middle, canvas.text_width(&tick.label, SMALL) / 2.0)
            })
            .collect();
        let is_close = |pair: &[(f64, f64)]| pair[1].0 - pair[0].0 < pair[0].1 + pair[1].1 + BETWEEN_LABELS;
        if spacing > length || !places.windows(2).any(is_close) {
            return found;
        }
        spacing *= 1.25;
    }
}

/// Returns the name of an x axis of the given length, with the common factor of its labels.
pub(crate) fn x_name_of(canvas: &Canvas, axis: &Axis, length: f64) -> String {
    x_ticks(canvas, axis, length).name(axis)
}

/// Returns the room that a figure needs left of its panels for the labels and names of their y axes, given the height of
/// each. A figure of default size has at least `least`.
pub fn left_margin(canvas: &Canvas, least: f64, axes: &[(&Axis, f64)]) -> f64 {
    let needed = |(axis, height): &(&Axis, f64)| {
        let ticks = ticks(axis, *height, Y_SPACING);
        let name = y_name(canvas, &ticks.name(axis), *height);
        let before = match name.lines.first().is_none_or(String::is_empty) {
            true => LEAST,
            false => NAME_MIDDLE + name.more() + NAME_AWAY,
        };
        before + widest(canvas, &ticks) + LABEL_AWAY
    };
    let least = if canvas.is_default() { least } else { 0.0 };
    axes.iter().map(needed).fold(least, f64::max)
}

/// Returns the room that a figure needs right of its panels: for half of the last label of an x axis of about the given
/// length.
pub fn right_margin(canvas: &Canvas, axis: &Axis, length: f64) -> f64 {
    if canvas.is_default() {
        return RIGHT;
    }
    let ticks = x_ticks(canvas, axis, length);
    let last = ticks.list.iter().rev().find(|tick| !tick.label.is_empty());
    let beyond = last.map_or(0.0, |tick| {
        let after = (axis.high - tick.at) / (axis.high - axis.low) * length;
        canvas.text_width(&tick.label, SMALL) / 2.0 - after
    });
    beyond.max(0.0) + LEAST
}

/// Returns the room that a panel between two positions needs below it for the labels and the name of its x axis.
pub fn below(canvas: &Canvas, axis: &Axis, ends: [f64; 2]) -> f64 {
    let ticks = x_ticks(canvas, axis, ends[1] - ends[0]);
    let name = x_name(canvas, &ticks.name(axis), ends);
    let rest = if canvas.is_default() { BELOW } else { X_NAME + MEDIUM / 2.0 + LEAST };
    rest + name.more()
}

/// Returns the length of a tick's mark. Minor ticks have no label.
fn mark_length(label: &str) -> f64 {
    if label.is_empty() { MINOR_MARK } else { MAJOR_MARK }
}

/// Height of a panel in a figure of other than default size, as a share of the figure's width, and its least value.
pub(crate) const PANEL_HEIGHT: f64 = 0.36;
const LEAST_PANEL: f64 = 240.0;
/// Height of the only panel of a figure, in panels.
const SINGLE: f64 = 1.6;

/// Returns the upper and lower edges of panels one below the other, whose heights are proportional to `shares`. A figure of
/// default size has the height `default`; otherwise a share of 1 has the usual height of a panel.
pub fn stacked(canvas: &Canvas, top: f64, default: f64, shares: &[f64]) -> Vec<[f64; 2]> {
    let gaps = PANEL_GAP * (shares.len() as f64 - 1.0);
    let unit = match canvas.is_default() {
        true => (default - BELOW - top - gaps) / shares.iter().sum::<f64>(),
        false => (PANEL_HEIGHT * canvas.size().0).max(LEAST_PANEL),
    };
    let mut bottom = top - PANEL_GAP;
    let edges = shares.iter().map(|share| {
        let top = bottom + PANEL_GAP;
        bottom = top + share * unit;
        [top, bottom]
    });
    edges.collect()
}

/// Returns the frames of panels one below the other, given the edges and the vertical axis of each, and sets the height of
/// the figure. `left` is the least margin in a figure of default size. `beside` is the room that texts right of the panels
/// need, beyond half a label of the x axis.
pub fn column(
    canvas: &Canvas,
    panels: Vec<([f64; 2], Axis)>,
    x: &Axis,
    left: f64,
    beside: f64,
) -> Vec<Frame> {
    let heights: Vec<_> = panels.iter().map(|([top, bottom], axis)| (axis, bottom - top)).collect();
    let left = left_margin(canvas, left, &heights);
    let width = canvas.size().0;
    let right = width - right_margin(canvas, x, width - left) - beside;
    let bottom = panels.last().map_or(0.0, |([_, bottom], _)| *bottom);
    canvas.set_height(bottom + below(canvas, x, [left, right]));
    let frame = |([top, bottom], y): ([f64; 2], Axis)| Frame {
        rect: Rect { left, top, right, bottom },
        x: x.clone(),
        y,
    };
    panels.into_iter().map(frame).collect()
}

/// Returns the frame of a figure of one panel, given its axes, and sets the height of the figure. `default` is the height and
/// `left` the least margin of a figure of default size.
pub fn single(canvas: &Canvas, top: f64, default: f64, [x, y]: [Axis; 2], left: f64) -> Frame {
    let edges = stacked(canvas, top, default, &[SINGLE]);
    column(canvas, vec![(edges[0], y)], &x, left, 0.0).remove(0)
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
        for tick in x_ticks(canvas, &self.x, right - left).list.into_iter().filter(is_major) {
            let x = self.x_pixel(tick.at);
            canvas.stroke(&[(x, top), (x, bottom)], 1.0, GRID);
        }
        for tick in self.y_ticks(Y_SPACING).list.into_iter().filter(is_major) {
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
        let (ticks, from) = (self.y_ticks(Y_SPACING), left - LABEL_AWAY);
        let name = y_name(canvas, &ticks.name(&self.y), bottom - top);
        let x = (from - widest(canvas, &ticks) - NAME_AWAY).max(NAME_MIDDLE + name.more());
        for Tick { at, label } in ticks.list {
            let y = self.y_pixel(at);
            canvas.stroke(&[(left - mark_length(&label), y), (left, y)], 1.5, DARK);
            canvas.text(&label, (from, y), SMALL, Align::Right, DARK);
        }
        for (i, line) in name.lines.iter().rev().enumerate() {
            let at = (x - name.pitch() * i as f64, (top + bottom) / 2.0);
            canvas.text(line, at, name.size, Align::Upwards, DARK);
        }
    }

    /// Draws the lower edge with its ticks, and with `labels` their labels and the axis name.
    pub fn draw_x_axis(&self, canvas: &Canvas, labels: bool) {
        let Rect { left, right, bottom, .. } = self.rect;
        canvas.stroke(&[(left, bottom), (right, bottom)], 1.5, DARK);
        let ticks = x_ticks(canvas, &self.x, right - left);
        let name = x_name(canvas, &ticks.name(&self.x), [left, right]);
        for Tick { at, label } in ticks.list {
            let x = self.x_pixel(at);
            canvas.stroke(&[(x, bottom), (x, bottom + mark_length(&label))], 1.5, DARK);
            if labels {
                canvas.text(&label, (x, bottom + X_LABEL), SMALL, Align::Center, DARK);
            }
        }
        for (i, line) in name.lines.iter().enumerate().filter(|_| labels) {
            let at = ((left + right) / 2.0, bottom + X_NAME + name.pitch() * i as f64);
            canvas.text(line, at, name.size, Align::Center, DARK);
        }
    }

    /// Draws ticks and labels of the y axis on the right side, for a colour bar.
    pub fn draw_scale(&self, canvas: &Canvas) {
        let right = self.rect.right;
        for Tick { at, label } in self.y_ticks(BAR_SPACING).list {
            let y = self.y_pixel(at);
            canvas.stroke(&[(right, y), (right + mark_length(&label), y)], 1.5, DARK);
            canvas.text(&label, (right + MAJOR_MARK + 7.0, y), SMALL, Align::Left, DARK);
        }
    }

    /// Returns the name of a colour bar with the common factor of its labels.
    pub fn scale_name(&self) -> String {
        self.y_ticks(BAR_SPACING).name(&self.y)
    }

    fn y_ticks(&self, spacing: f64) -> Ticks {
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
