//! A bifurcation diagram like Fig. 5 of the paper: section points against a parameter, and below them measured quantities and
//! the largest Lyapunov exponent. Lengths are in pixels.

mod coloring;
mod exponents;
mod panels;

use crate::map::bifurcation::{Column, Direction};
use crate::map::scene::FigureStyle;
use crate::show::color::Color;
use crate::show::drawing::axis::{Axis, Scale};
use crate::show::drawing::frame::{Frame, column, stacked};
use crate::show::drawing::legend::{Entry, Key, draw_head};
use crate::show::drawing::{Bitmap, Canvas, FAINT, Marker, Rect, wall_color};
use coloring::{Coloring, STROBE, both_directions, class_color, direction_color, mixed};
use panels::Panel;
pub use panels::Panels;
use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::Class;

/// Default size, and least distance of the panels from the left edge.
const WIDTH: f64 = 1600.0;
const HEIGHT: f64 = 1750.0;
/// Most panels of states in a figure of default size.
const STATE_PANELS: usize = 3;
/// Height that a further panel of states or of a measured quantity adds.
const FURTHER_HEIGHT: f64 = 420.0;
const PANEL_LEFT: f64 = 130.0;
/// Height of the panel of exponents, as a share of the height of another panel.
const EXPONENTS_HEIGHT: f64 = 0.6;
/// Height of the marks of columns that are undecided or failed.
const MARKS: f64 = 16.0;
/// Opacity of a pixel with one point. It increases with the number of points.
const SINGLE: f64 = 0.6;
/// Least and largest radius of a dot. Dots are larger where columns are farther apart.
const POINT_DOT: (f64, f64) = (0.7, 2.2);
/// Columns of at most `CURVE_POINTS` points form curves. Their dots have at least radius `CURVE_DOT`, so that they join.
const CURVE_POINTS: usize = 24;
const CURVE_DOT: f64 = 1.3;

/// Draws the section points, one panel per displacement, measured quantities, and the largest Lyapunov exponent.
///
/// Points are coloured by wall. Where they overlap, opacity increases with the logarithm of their number and shows the density
/// of a chaotic band. In a diagram of two passes they are coloured by direction, and grey where both passes agree. Columns that
/// are undecided or failed have a mark at the lower edge. There may be no columns and no points; values that are not finite are
/// skipped. `axis` is the label and the scale of the parameter.
pub fn draw(
    style: &FigureStyle,
    [title, subtitle]: [&str; 2],
    axis: (&str, Scale),
    panels: &Panels,
    columns: &[Column],
) -> Canvas {
    let drawn = Canvas::new(style, WIDTH);
    let canvas = &drawn;
    let marked: Vec<f64> = columns.iter().filter(|c| is_marked(c)).map(|c| c.value).collect();
    let coloring = Coloring::of(columns);
    let top = draw_head(canvas, title, subtitle, &legend(columns, panels, coloring)) + 14.0;
    let x = value_axis(axis, columns);
    // Strips of classes need more of a low panel.
    let is_low = !canvas.is_default() && coloring.strips() > 0;
    let exponents = if is_low { 1.0 } else { EXPONENTS_HEIGHT };
    let shares = [vec![1.0; panels.list.len()], vec![exponents]].concat();
    let of_states = panels.list.len() - panels.measured();
    let further = panels.measured() + of_states.saturating_sub(STATE_PANELS);
    let height = HEIGHT + FURTHER_HEIGHT * further as f64;
    let edges = stacked(canvas, top, height, &shares);
    let axis = |(i, edges): (usize, [f64; 2])| {
        let height = edges[1] - edges[0];
        let Some(panel) = panels.list.get(i) else {
            return (edges, exponents::axis(columns, coloring.strips(), height));
        };
        let mut y = quantity_axis(panel, columns);
        // Leaves room for the marks below the data.
        y.low -= (y.high - y.low) * MARKS / height;
        (edges, y)
    };
    let placed = edges.into_iter().enumerate().map(axis).collect();
    let beside = exponents::beside(canvas, coloring);
    let mut frames = column(canvas, placed, &x, PANEL_LEFT, beside);
    let last = frames.pop();
    for (frame, panel) in frames.iter().zip(&panels.list) {
        frame.draw_grid(canvas);
        draw_points(canvas, frame, panel, columns, coloring);
        let bottom = frame.rect.bottom;
        for value in marked.iter().filter(|v| v.is_finite()) {
            let x = frame.at(*value, 0.0).0;
            canvas.stroke(&[(x, bottom - MARKS + 2.0), (x, bottom)], 1.2, FAINT);
        }
        frame.draw_axes(canvas, false);
    }
    if let Some(frame) = last {
        frame.draw_grid(canvas);
        exponents::draw(canvas, &frame, columns, coloring);
        frame.draw_axes(canvas, true);
    }
    drawn
}

/// Whether a column is undecided or failed.
fn is_marked(column: &Column) -> bool {
    matches!(column.class, Class::Undecided | Class::Failed)
}

/// Returns the vertical axis of a panel.
fn quantity_axis(panel: &Panel, columns: &[Column]) -> Axis {
    let values = || columns.iter().flat_map(|column| panel.values(column)).map(|(value, _)| value);
    let largest = values().filter(|value| value.is_finite()).fold(0.0, |a: f64, b| a.max(b.abs()));
    // Smaller differences are rounding errors. Any span will do for zeros or without values.
    let least_span = if largest > 0.0 { 1e-6 * largest } else { 1.0 };
    Axis::around(&panel.label, values(), least_span)
}

fn legend(columns: &[Column], panels: &Panels, coloring: Coloring) -> Vec<Entry> {
    let dot = |color: Color, text: &str| Entry::new(Key::Marker(Marker::dot(color, 6.0)), text);
    let patch = |color, opacity, text| Entry::new(Key::Patch { color, opacity }, text);
    let has = |index: usize| columns.iter().any(|column| column.class.index() == index);
    let is_periodic = has(Class::Periodic { period: 1 }.index());
    let is_chaotic = has(Class::Chaotic.index());
    let has_tori = has(Class::QuasiPeriodic.index());
    let torus = class_color(Class::QuasiPeriodic);
    let periodic = class_color(Class::Periodic { period: 1 });
    let chaotic = class_color(Class::Chaotic);
    let mut entries = Vec::new();
    match coloring {
        Coloring::Walls => {
            let walls = Side::BOTH.into_iter().filter(|side| panels.walls.has(*side));
            entries.extend(walls.map(|side| dot(wall_color(side), &panels.walls.entry(side))));
            entries.extend(panels.has_strobes().then(|| dot(STROBE, "phase 0 of each period")));
            entries.extend(is_periodic.then(|| dot(periodic, "\u{3bb}: periodic")));
            entries.extend(is_chaotic.then(|| dot(chaotic, "\u{3bb}: chaotic")));
            entries.extend(has_tori.then(|| dot(torus, "\u{3bb}: quasi-periodic")));
        }
        Coloring::Directions => {
            entries.push(dot(direction_color(Direction::Up), "followed upwards"));
            entries.push(dot(direction_color(Direction::Down), "downwards"));
            entries.push(dot(both_directions(), "both"));
            entries.extend(is_periodic.then(|| patch(periodic, 1.0, "periodic")));
            entries.extend(is_chaotic.then(|| patch(chaotic, 1.0, "chaotic")));
            entries.extend(has_tori.then(|| patch(torus, 1.0, "quasi-periodic")));
        }
    }
    if columns.iter().any(|column| column.lyapunov_error.is_some()) {
        entries.push(patch(chaotic, exponents::ERROR_BAND, "\u{3bb}: standard error"));
    }
    if columns.iter().any(is_marked) {
        entries.push(Entry::new(Key::Mark { color: FAINT }, "undecided or failed"));
    }
    entries
}

/// Returns the axis of the parameter, with room for the dots of the first and last columns.
fn value_axis((label, scale): (&str, Scale), columns: &[Column]) -> Axis {
    if scale == Scale::Listed {
        let mut values: Vec<f64> =
            columns.iter().map(|c| c.value).filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        // Each of two passes has every value.
        values.dedup();
        return Axis::listed(label, values.into_iter());
    }
    let place = |value: f64| match scale {
        Scale::Linear | Scale::Listed => value,
        Scale::Logarithmic => value.log10(),
    };
    let places = columns.iter().map(|c| place(c.value)).filter(|place| place.is_finite());
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let room = 0.006 * (high - low);
    Axis { scale, ..Axis::exact(label, low - room, high + room) }
}

/// Pixels of the image of points per unit of the figure, in each direction.
const FINE: f64 = 2.0;

/// Counts the dots on every pixel of the image, then sets the colour of each pixel.
fn draw_points(canvas: &Canvas, frame: &Frame, panel: &Panel, columns: &[Column], coloring: Coloring) {
    let Rect { left, top, right, bottom } = frame.rect;
    let [width, height] = [right - left, bottom - top].map(|side| (FINE * side).round().max(0.0) as usize);
    let mut counts = vec![[0u32; 2]; width * height];
    let [fine, joined] = [POINT_DOT.0, CURVE_DOT].map(|least| dot(frame, columns, least));
    for column in columns {
        let values = panel.values(column);
        let dot = if values.len() <= CURVE_POINTS { &joined } else { &fine };
        for (value, side) in values {
            let (x, y) = frame.at(column.value, value);
            if !(x.is_finite() && y.is_finite()) {
                continue;
            }
            let hue = coloring.index(column, side);
            let (x, y) = ((FINE * (x - left)).round() as i32, (FINE * (y - top)).round() as i32);
            for (dx, dy) in dot {
                let (column, row) = (x.saturating_add(*dx), y.saturating_add(*dy));
                if (0..width as i32).contains(&column) && (0..height as i32).contains(&row) {
                    counts[row as usize * width + column as usize][hue] += 1;
                }
            }
        }
    }
    let (darkest, colors) = (darkest(&counts), coloring.colors(panel));
    let mut image = Bitmap::clear([width, height]);
    for (i, [right, left_wall]) in counts.iter().enumerate().filter(|(_, sides)| **sides != [0, 0]) {
        let (count, share) = (f64::from(right + left_wall), f64::from(*right) / f64::from(right + left_wall));
        let opacity = SINGLE + (1.0 - SINGLE) * (count.ln() / darkest.ln()).min(1.0);
        image.set(i, mixed(colors, share), opacity);
    }
    canvas.image(frame.rect, image);
}

/// Returns the pixels of a dot relative to its centre. Its radius is at least `least`.
fn dot(frame: &Frame, columns: &[Column], least: f64) -> Vec<(i32, i32)> {
    let spacing = (frame.rect.right - frame.rect.left) / columns.len().max(1) as f64;
    let radius = FINE * (0.4 * spacing).clamp(least, POINT_DOT.1);
    let reach = radius.ceil() as i32;
    let all = (-reach..=reach).flat_map(|dx| (-reach..=reach).map(move |dy| (dx, dy)));
    all.filter(|(dx, dy)| f64::from(*dx).hypot(f64::from(*dy)) <= radius).collect()
}

/// Returns the number of dots on an opaque pixel: the 99th percentile of all pixels with dots.
///
/// With the maximum, the few pixels of a periodic orbit would make all others pale.
fn darkest(counts: &[[u32; 2]]) -> f64 {
    let mut totals: Vec<u32> = counts.iter().map(|[a, b]| a + b).filter(|n| *n > 0).collect();
    if totals.is_empty() {
        return 2.0;
    }
    let rank = (totals.len() - 1) * 99 / 100;
    f64::from(*totals.select_nth_unstable(rank).1).max(2.0)
}
