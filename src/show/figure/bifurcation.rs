//! A bifurcation diagram like Fig. 5 of the paper: section points against a parameter, and below them measured quantities and
//! the largest Lyapunov exponent. Lengths are in pixels.

mod coloring;
mod exponents;
mod panels;

use crate::map::bifurcation::{Column, Direction};
use crate::map::branches::{BranchRow, Branches};
use crate::map::scene::{FigureStyle, Scale};
use crate::show::color::Color;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, column, stacked};
use crate::show::drawing::legend::{Entry, Key, draw_head};
use crate::show::drawing::{Bitmap, Canvas, DARK, FAINT, Marker, Point, Rect, wall_color};
use coloring::{Coloring, STROBE, both_directions, class_color, direction_color, mixed};
pub use panels::Panels;
use panels::{Panel, States};
use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::Class;

/// Width and least distance of the panels from the left edge in a figure of default size. Its height is that of head and foot, and of
/// panels.
const WIDTH: f64 = 1600.0;
const HEAD_AND_FOOT: f64 = 372.0;
const HEIGHT: f64 = 530.0;
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
/// Radius of a dot without another one beside it, and the distance up to which one is beside it.
const LONE_DOT: f64 = 2.4;
const BESIDE: f64 = 6.0;
/// Widths of the lines of the first and the second pass. Where both agree, the second lies within the first.
const LINES: [f64; 2] = [4.0, 1.8];
/// Branches of cycles.
const BRANCH: Color = DARK;
const BRANCH_WIDTH: f64 = 1.2;
const DIRECTIONS: [&str; 2] = ["followed upwards", "downwards"];
/// A step of a line is a jump to another branch if it has this share of the panel's height, and this multiple of the steps beside it.
const JUMP: (f64, f64) = (0.15, 4.0);

/// Draws the section points, one panel per displacement, measured quantities, and the largest Lyapunov exponent, as far as the
/// figure has these panels.
///
/// Branches of measured quantities are lines. Points are coloured by wall. Where they overlap, opacity increases with the logarithm of
/// their number and shows the density of a chaotic band. In a diagram of two passes they are coloured by direction, and grey where both passes agree. Columns that
/// are undecided or failed have a mark at the lower edge. There may be no columns and no points; values that are not finite are
/// skipped. `axis` is the label and the scale of the parameter.
pub fn draw(
    style: &FigureStyle,
    [title, subtitle]: [&str; 2],
    axis: (&str, Scale),
    panels: &Panels,
    (columns, branches): (&[Column], Option<&Branches>),
) -> Canvas {
    let drawn = Canvas::new(style, WIDTH);
    let canvas = &drawn;
    let marked: Vec<f64> = columns.iter().filter(|c| is_marked(c)).map(|c| c.value).collect();
    let coloring = Coloring::of(columns);
    let top = draw_head(canvas, title, subtitle, &legend(columns, panels, coloring, branches)) + 14.0;
    let x = value_axis(axis, columns);
    // Strips of classes need more of a low panel.
    let is_low = !canvas.is_default() && coloring.strips() > 0;
    let exponents = if is_low { 1.0 } else { EXPONENTS_HEIGHT };
    let share = |panel: &Panel| if panel.states == States::Exponents { exponents } else { 1.0 };
    let shares: Vec<f64> = panels.list.iter().map(share).collect();
    let height = HEAD_AND_FOOT + HEIGHT * shares.iter().sum::<f64>();
    let has_exponents = panels.has(&[States::Exponents]);
    let edges = stacked(canvas, top, height, &shares);
    let axis = |(panel, edges): (&Panel, [f64; 2])| {
        let height = edges[1] - edges[0];
        if panel.states == States::Exponents {
            return (edges, exponents::axis(columns, coloring.strips(), height));
        }
        let mut y = quantity_axis(panel, columns, branches);
        // Leaves room for the marks below the data.
        y.low -= (y.high - y.low) * MARKS / height;
        (edges, y)
    };
    let placed = panels.list.iter().zip(edges).map(axis).collect();
    let beside = if has_exponents { exponents::beside(canvas, coloring) } else { 0.0 };
    let frames = column(canvas, placed, &x, PANEL_LEFT, beside);
    for (i, (frame, panel)) in frames.iter().zip(&panels.list).enumerate() {
        frame.draw_grid(canvas);
        let is_last = i + 1 == frames.len();
        match panel.states {
            States::Exponents => {
                exponents::draw(canvas, frame, columns, coloring);
                frame.draw_axes(canvas, is_last);
                continue;
            }
            States::None => {
                draw_branches(canvas, frame, panel, columns, coloring);
                branches.into_iter().for_each(|branches| draw_cycles(canvas, frame, panel, branches));
            }
            _ => draw_points(canvas, frame, panel, columns, coloring),
        }
        let bottom = frame.rect.bottom;
        for value in marked.iter().filter(|v| v.is_finite()) {
            let x = frame.at(*value, 0.0).0;
            canvas.stroke(&[(x, bottom - MARKS + 2.0), (x, bottom)], 1.2, FAINT);
        }
        frame.draw_axes(canvas, is_last);
    }
    drawn
}

/// Whether a column is undecided or failed.
fn is_marked(column: &Column) -> bool {
    matches!(column.class, Class::Undecided | Class::Failed)
}

/// Returns the vertical axis of a panel.
fn quantity_axis(panel: &Panel, columns: &[Column], branches: Option<&Branches>) -> Axis {
    let of_branches = || branches.into_iter().flat_map(|branches| &branches.rows).map(|row| &row.column);
    let all = || columns.iter().chain(of_branches());
    let values = || all().flat_map(|column| panel.values(column)).map(|(value, _)| value);
    let largest = values().filter(|value| value.is_finite()).fold(0.0, |a: f64, b| a.max(b.abs()));
    // Smaller differences are rounding errors. Any span will do for zeros or without values.
    let least_span = if largest > 0.0 { 1e-6 * largest } else { 1.0 };
    Axis::around(&panel.label, values(), least_span)
}

fn legend(
    columns: &[Column],
    panels: &Panels,
    coloring: Coloring,
    branches: Option<&Branches>,
) -> Vec<Entry> {
    let dot = |color: Color, text: &str| Entry::new(Key::Marker(Marker::dot(color, 6.0)), text);
    let patch = |color, opacity, text| Entry::new(Key::Patch { color, opacity }, text);
    let has_exponents = panels.has(&[States::Exponents]);
    let has = |class: &Class| columns.iter().any(|column| column.class.index() == class.index());
    let classes = [Class::Periodic { period: 1 }, Class::Chaotic, Class::QuasiPeriodic].into_iter();
    let classes = classes.filter(|class| has_exponents && has(class));
    let mut entries = Vec::new();
    let shows_walls = panels.has(&[States::Crossings, States::Contacts]);
    match coloring {
        Coloring::Walls => {
            let walls = Side::BOTH.into_iter().filter(|side| shows_walls && panels.walls.has(*side));
            entries.extend(walls.map(|side| dot(wall_color(side), &panels.walls.entry(side))));
            entries.extend(panels.has(&[States::Strobes]).then(|| dot(STROBE, "phase 0 of each period")));
            entries.extend(classes.map(|of| dot(class_color(of), &format!("\u{3bb}: {}", of.name()))));
        }
        Coloring::Directions => {
            for ((direction, text), width) in Direction::ALL.into_iter().zip(DIRECTIONS).zip(LINES) {
                let color = direction_color(direction);
                entries.push(Entry::new(Key::Line { color, width }, text));
            }
            let both = panels.list.iter().any(|panel| panel.states != States::None);
            entries.extend(both.then(|| dot(both_directions(), "both")));
            entries.extend(classes.map(|of| patch(class_color(of), 1.0, of.name())));
        }
    }
    if has_exponents && columns.iter().any(|column| column.lyapunov_error.is_some()) {
        entries.push(patch(class_color(Class::Chaotic), exponents::ERROR_BAND, "\u{3bb}: standard error"));
    }
    if branches.is_some() && panels.has(&[States::None]) {
        entries.push(Entry::new(Key::Line { color: BRANCH, width: BRANCH_WIDTH }, "branch"));
        entries.push(Entry::new(Key::Dashes { color: BRANCH }, "unstable"));
    }
    if columns.iter().any(is_marked) && panels.list.iter().any(|panel| panel.states != States::Exponents) {
        entries.push(Entry::new(Key::Mark { color: FAINT }, "undecided or failed"));
    }
    entries
}

/// Returns the axis of the parameter, with room for the dots of the first and last columns.
fn value_axis((label, scale): (&str, Scale), columns: &[Column]) -> Axis {
    if scale == Scale::Values {
        let mut values: Vec<f64> =
            columns.iter().map(|c| c.value).filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        // Each of two passes has every value.
        values.dedup();
        return Axis::listed(label, values.into_iter());
    }
    let place = |value: f64| match scale {
        Scale::Linear | Scale::Values => value,
        Scale::Log => value.log10(),
    };
    let places = columns.iter().map(|c| place(c.value)).filter(|place| place.is_finite());
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let room = 0.006 * (high - low);
    Axis { scale, ..Axis::exact(label, low - room, high + room) }
}

/// Pixels of the image of points per unit of the figure, in each direction.
const FINE: f64 = 2.0;

/// Draws each branch of a measured quantity as a line, and a single value as a dot.
fn draw_branches(canvas: &Canvas, frame: &Frame, panel: &Panel, columns: &[Column], coloring: Coloring) {
    let height = frame.rect.bottom - frame.rect.top;
    for (&pass, width) in coloring.passes().iter().zip(LINES) {
        let of_pass = columns.iter().filter(|column| column.direction == pass);
        let point = |column: &Column| {
            let value = panel.values(column).first().map_or(f64::NAN, |(value, _)| *value);
            frame.at(column.value, value)
        };
        let points: Vec<(f64, f64)> = of_pass.map(point).collect();
        let color = pass.map_or(coloring.colors(panel)[0], direction_color);
        let steps: Vec<f64> = points.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs()).collect();
        let step = |i: Option<usize>| i.and_then(|i| steps.get(i)).copied().unwrap_or(0.0);
        let is_joined = |i: usize| {
            let beside = step(i.checked_sub(1)).max(step(Some(i + 1)));
            steps[i].is_finite() && !(steps[i] > JUMP.0 * height && steps[i] > JUMP.1 * beside)
        };
        let mut start = 0;
        for end in 1..=points.len() {
            if end < points.len() && is_joined(end - 1) {
                continue;
            }
            match &points[start..end] {
                [single] => canvas.marker(*single, Marker::dot(color, LONE_DOT)),
                branch => canvas.stroke(branch, width, color),
            }
            start = end;
        }
    }
}

/// Draws the branches of a measured quantity. Unstable parts are dashed.
fn draw_cycles(canvas: &Canvas, frame: &Frame, panel: &Panel, branches: &Branches) {
    let place = |row: &BranchRow| {
        let value = panel.values(&row.column).first().map_or(f64::NAN, |(value, _)| *value);
        frame.at(row.column.value, value)
    };
    // A part ends where the stability changes, or where another branch begins.
    for part in branches.rows.chunk_by(|a, b| a.branch == b.branch && a.stable == b.stable) {
        let path: Vec<Point> = part.iter().map(place).collect();
        match part[0].stable {
            true => canvas.stroke(&path, BRANCH_WIDTH, BRANCH),
            false => canvas.dashes(&path, BRANCH_WIDTH, BRANCH),
        }
    }
}

/// Counts the dots on every pixel of the image, then sets the colour of each pixel.
fn draw_points(canvas: &Canvas, frame: &Frame, panel: &Panel, columns: &[Column], coloring: Coloring) {
    let Rect { left, top, right, bottom } = frame.rect;
    let [width, height] = [right - left, bottom - top].map(|side| (FINE * side).round().max(0.0) as usize);
    let mut counts = vec![[0u32; 2]; width * height];
    let [fine, joined, lone] = [POINT_DOT.0, CURVE_DOT, LONE_DOT].map(|least| dot(frame, columns, least));
    let places: Vec<Vec<Point>> = columns
        .iter()
        .map(|column| panel.values(column).iter().map(|(value, _)| frame.at(column.value, *value)).collect())
        .collect();
    for (i, column) in columns.iter().enumerate() {
        let values = panel.values(column);
        let beside = || places[i.saturating_sub(1)..(i + 2).min(places.len())].concat();
        let beside = if values.len() <= CURVE_POINTS { beside() } else { Vec::new() };
        for (value, side) in values {
            let (x, y) = frame.at(column.value, value);
            if !(x.is_finite() && y.is_finite()) {
                continue;
            }
            // The point itself is one of those beside it.
            let near = beside.iter().filter(|other| (other.0 - x).hypot(other.1 - y) < BESIDE).count();
            let dot = [&fine, &lone, &joined][near.min(2)];
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
    let radius = FINE * (0.4 * spacing).clamp(least, POINT_DOT.1.max(least));
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
