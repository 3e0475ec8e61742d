//! The panel of exponents: the largest Lyapunov exponent of each column, with its standard error.

use crate::map::bifurcation::{Column, Direction};
use crate::show::color::Color;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::Frame;
use crate::show::drawing::{Align, Canvas, DARK, Marker, Rect, SMALL};
use crate::show::figure::bifurcation::coloring::{Coloring, both_directions, class_color, direction_color};

/// Height of the strip of classes of one pass, with room for its name beside it; distance from the strip to its name.
const STRIP: f64 = 24.0;
const STRIP_NAME: f64 = 10.0;
/// Radius of the dot that replaces the name in a narrow figure.
const STRIP_DOT: f64 = 6.0;
/// Opacity of the band of the standard error.
pub(crate) const ERROR_BAND: f64 = 0.28;
/// Least and largest radius of a dot. Dots are larger where columns are farther apart.
const EXPONENT_DOT: (f64, f64) = (1.3, 3.5);
/// Exponents of two passes that are closer than this many pixels are drawn as one dot.
const SAME_EXPONENT: f64 = 1.5;
/// The panel extends below zero by `DEPTH` times the largest positive exponent, and at least by `LEAST_DEPTH`. Smaller exponents
/// are drawn at the lower edge.
const DEPTH: f64 = 4.0;
const LEAST_DEPTH: f64 = 0.5;

/// Returns the name of the strip of a pass.
fn strip_name(direction: Direction) -> &'static str {
    match direction {
        Direction::Up => "upward",
        Direction::Down => "downward",
    }
}

/// Returns the room for the names of strips right of the panel. In a narrow figure each strip has a dot in the colour of its
/// direction instead, which the legend explains.
pub(crate) fn beside(canvas: &Canvas, coloring: Coloring) -> f64 {
    let passes = coloring.passes().iter().take(coloring.strips()).flatten();
    let width = |direction: &Direction| match canvas.is_default() {
        true => canvas.text_width(strip_name(*direction), SMALL),
        false => 2.0 * STRIP_DOT,
    };
    let widest = passes.map(width).fold(0.0, f64::max);
    if widest > 0.0 { widest + STRIP_NAME } else { 0.0 }
}

/// Returns the vertical axis.
pub(crate) fn axis(columns: &[Column], strips: usize, height: f64) -> Axis {
    let ends = columns.iter().flat_map(|column| {
        let error = column.lyapunov_error.unwrap_or(0.0);
        [column.lyapunov - error, column.lyapunov + error]
    });
    let finite: Vec<f64> = ends.filter(|x| x.is_finite()).collect();
    let high = finite.iter().copied().fold(0.0, f64::max);
    let floor = -(DEPTH * high).max(LEAST_DEPTH);
    let is_clipped = finite.iter().any(|&x| x < floor);
    let label = if is_clipped { "exponent \u{3bb}, cut below" } else { "largest exponent \u{3bb}" };
    let mut axis = Axis::around(label, finite.iter().map(|x| x.max(floor)).chain([0.0]), 1e-3);
    // Leaves room for the strips below the data.
    let share = STRIP * strips as f64 / height;
    axis.low -= (axis.high - axis.low) * share / (1.0 - share);
    axis
}

/// Draws the zero line, error bands and exponents, then the strips, one per pass.
pub(crate) fn draw(canvas: &Canvas, frame: &Frame, columns: &[Column], coloring: Coloring) {
    let Rect { left, right, .. } = frame.rect;
    let zero = frame.at(0.0, 0.0).1;
    canvas.stroke(&[(left, zero), (right, zero)], 1.2, DARK);
    let of = |pass: Option<Direction>| columns.iter().filter(move |column| column.direction == pass);
    for &pass in coloring.passes() {
        let other = pass.map(|direction| match direction {
            Direction::Up => Direction::Down,
            Direction::Down => Direction::Up,
        });
        let others = of(other).map(|column| column.lyapunov);
        let pass: Vec<(&Column, Color)> = of(pass)
            .zip(others)
            .map(|(column, other)| {
                let apart = (frame.at(0.0, column.lyapunov).1 - frame.at(0.0, other).1).abs();
                let color = match column.direction {
                    None => class_color(column.class),
                    Some(_) if apart < SAME_EXPONENT => both_directions(),
                    Some(direction) => direction_color(direction),
                };
                (column, color)
            })
            .collect();
        draw_pass(canvas, frame, &pass);
    }
    for (row, &pass) in coloring.passes().iter().rev().enumerate().take(coloring.strips()) {
        let columns: Vec<&Column> = of(pass).collect();
        let bottom = frame.rect.bottom - STRIP * row as f64;
        let spans = spans(frame, &columns);
        let colored: Vec<_> =
            columns.iter().zip(spans).map(|(c, span)| (class_color(c.class), span)).collect();
        // One rectangle for neighbours of one class: seams between rectangles would look like stripes.
        for run in colored.chunk_by(|a, b| a.0 == b.0) {
            let (from, to) = (run[0].1[0], run[run.len() - 1].1[1]);
            let rect = Rect { left: from, right: to, top: bottom - STRIP + 2.0, bottom };
            canvas.fill(rect, run[0].0, 1.0);
        }
        let Some(direction) = pass else { continue };
        let (left, middle) = (right + STRIP_NAME, bottom - STRIP / 2.0 + 1.0);
        if canvas.is_default() {
            canvas.text(strip_name(direction), (left, middle), SMALL, Align::Left, DARK);
        } else {
            canvas.marker((left + STRIP_DOT, middle), Marker::dot(direction_color(direction), STRIP_DOT));
        }
    }
}

fn draw_pass(canvas: &Canvas, frame: &Frame, pass: &[(&Column, Color)]) {
    let Rect { left, top, right, bottom } = frame.rect;
    let height = |value: f64| frame.at(0.0, value).1.clamp(top, bottom);
    let columns: Vec<&Column> = pass.iter().map(|(column, _)| *column).collect();
    for ((column, color), [from, to]) in pass.iter().zip(spans(frame, &columns)) {
        let Some(error) = column.lyapunov_error.filter(|_| column.lyapunov.is_finite()) else { continue };
        let [high, low] = [1.0, -1.0].map(|sign| height(column.lyapunov + sign * error));
        canvas.fill(Rect { left: from, right: to, top: high, bottom: low }, *color, ERROR_BAND);
    }
    let spacing = (right - left) / pass.len().max(1) as f64;
    let radius = (0.4 * spacing).clamp(EXPONENT_DOT.0, EXPONENT_DOT.1);
    let is_drawn = |column: &Column| column.value.is_finite() && !column.lyapunov.is_nan();
    for (column, color) in pass.iter().filter(|(column, _)| is_drawn(column)) {
        let at = (frame.at(column.value, 0.0).0, height(column.lyapunov));
        canvas.marker(at, Marker::dot(*color, radius));
    }
}

/// Returns the left and right edges of each column: the middles between it and its neighbours.
fn spans(frame: &Frame, pass: &[&Column]) -> Vec<[f64; 2]> {
    let Rect { left, right, .. } = frame.rect;
    let at: Vec<f64> = pass.iter().map(|column| frame.at(column.value, 0.0).0).collect();
    let middle = |i: usize| (at[i] + at[i + 1]) / 2.0;
    let span = |i: usize| {
        let from = if i > 0 { middle(i - 1) } else { at[i] };
        let to = if i + 1 < at.len() { middle(i) } else { at[i] };
        [from, to].map(|x| if x.is_finite() { x.clamp(left, right) } else { left })
    };
    (0..at.len()).map(span).collect()
}
