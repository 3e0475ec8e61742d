//! Section points against one parameter, drawn like Fig. 5 of the paper; below them the largest Lyapunov exponent.

mod exponents;
mod shown;

use std::path::Path;

use crate::map::bifurcation::{Column, Direction};
use crate::show::drawing::axes::{Axis, Frame, Scale};
use crate::show::drawing::legend::{Entry, Key, draw_head};
use crate::show::drawing::{
    Bitmap, Canvas, FAINT, GEAR_2, Marker, RGBColor, Rect, Shape, save_figure, wall_color,
};
use crate::show::error::{DrawError, FigureError};
use exponents::class_color;
use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::Class;
pub use shown::Shown;
use shown::{Panel, States};

const SIZE: (u32, u32) = (1600, 1750);
const LEFT: f64 = 130.0;
const BETWEEN: f64 = 30.0;
/// Height of the panel of exponents, as a share of another one's.
const LOWEST: f64 = 0.6;
/// Height of the strip that holds the marks of columns without an attractor.
const MARKS: f64 = 16.0;
/// Opacity of a place that a single point falls on; more points add to it.
const SINGLE: f64 = 0.6;
/// Radius of a dot: the larger where columns lie apart, the smaller where they touch.
const DOT: (f64, f64) = (0.7, 2.2);
/// Columns of at most this many points are curves: their dots are large enough to join.
const CURVE_POINTS: usize = 24;
const CURVE_DOT: f64 = 1.3;
/// The colour of states at phase 0, which belong to no wall.
const STROBE: RGBColor = GEAR_2;

/// Draws what is [`Shown`] of every section point, a panel each, and the largest Lyapunov exponent of each column, in
/// the format that the file's name tells.
///
/// One dot per point, coloured by wall; where dots pile up they darken with the
/// logarithm of their number, so that the density of a chaotic band shows. Of two passes the dots are
/// coloured by the direction instead, and grey where both have been. Columns
/// that are undecided or failed get a mark at the lower edge. No column, no point and
/// values that are not finite are all accepted. `axis` is the parameter's label and how its values lie.
///
/// # Errors
/// A file that cannot be written, by name.
pub fn write(
    path: &Path,
    [title, subtitle]: [&str; 2],
    axis: (&str, Scale),
    shown: &Shown,
    columns: &[Column],
) -> Result<(), FigureError> {
    save_figure(path, SIZE, |canvas| draw(canvas, [title, subtitle], axis, shown, columns))
}

/// What colours tell apart.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Look {
    /// The walls of one pass; its exponents by class.
    Walls,
    /// Two passes.
    Directions,
}

impl Look {
    fn of(columns: &[Column]) -> Look {
        let has_directions = columns.iter().any(|column| column.direction.is_some());
        if has_directions { Look::Directions } else { Look::Walls }
    }

    /// The passes, in the order in which they are drawn.
    fn passes(self) -> &'static [Option<Direction>] {
        match self {
            Look::Walls => &[None],
            Look::Directions => &[Some(Direction::Up), Some(Direction::Down)],
        }
    }

    /// Whether classes are told by strips, since colours tell something else.
    fn has_strips(self) -> bool {
        self == Look::Directions
    }

    /// Which of the two colours of dots a point has.
    fn place(self, column: &Column, side: Option<Side>) -> usize {
        match self {
            Look::Walls => side.map_or(0, Side::index),
            Look::Directions => usize::from(column.direction == Some(Direction::Down)),
        }
    }

    /// The two colours of dots in a panel.
    fn colors(self, panel: &Panel) -> [RGBColor; 2] {
        match (self, panel.states) {
            (Look::Walls, States::Strobes) => [STROBE; 2],
            _ => Side::BOTH.map(wall_color),
        }
    }
}

/// The two colours of dots are the walls'; mixed half and half they are grey.
fn direction_color(direction: Direction) -> RGBColor {
    match direction {
        Direction::Up => wall_color(Side::Right),
        Direction::Down => wall_color(Side::Left),
    }
}

fn draw(
    canvas: &Canvas<'_>,
    [title, subtitle]: [&str; 2],
    axis: (&str, Scale),
    shown: &Shown,
    columns: &[Column],
) -> Result<(), DrawError> {
    let left_out: Vec<f64> = columns.iter().filter(|c| is_left_out(c)).map(|c| c.value).collect();
    let look = Look::of(columns);
    let top = draw_head(canvas, title, subtitle, &legend(columns, shown, look))? + 14.0;
    let whole = canvas.panel(LEFT, top);
    let count = shown.panels.len() as f64;
    let height = (whole.bottom - top - count * BETWEEN) / (count + LOWEST);
    let x = value_axis(axis, columns);
    for (i, panel) in shown.panels.iter().enumerate() {
        let top = top + i as f64 * (height + BETWEEN);
        let bottom = top + height;
        let y = quantity_axis(panel, columns);
        let mut frame = Frame { rect: Rect { top, bottom, ..whole }, x: x.clone(), y };
        // The marks must not lie on data.
        frame.y.low -= (frame.y.high - frame.y.low) * MARKS / height;
        frame.draw_grid(canvas)?;
        draw_points(canvas, &frame, panel, columns, look)?;
        for value in left_out.iter().filter(|v| v.is_finite()) {
            let x = frame.at(*value, 0.0).0;
            canvas.stroke(&[(x, bottom - MARKS + 2.0), (x, bottom)], 1.2, FAINT)?;
        }
        frame.draw_axes(canvas, false)?;
    }
    let rect = Rect { top: top + count * (height + BETWEEN), ..whole };
    let strips = if look.has_strips() { look.passes().len() } else { 0 };
    let y = exponents::axis(columns, strips, rect.bottom - rect.top);
    let frame = Frame { rect, x, y };
    frame.draw_grid(canvas)?;
    exponents::draw(canvas, &frame, columns, look)?;
    frame.draw_axes(canvas, true)
}

fn is_left_out(column: &Column) -> bool {
    matches!(column.class, Class::Undecided | Class::Failed)
}

/// Holds all values of a panel.
fn quantity_axis(panel: &Panel, columns: &[Column]) -> Axis {
    let values = || columns.iter().flat_map(|column| panel.values(column)).map(|(value, _)| value);
    let largest = values().filter(|value| value.is_finite()).fold(0.0, |a: f64, b| a.max(b.abs()));
    // What differs by less is rounding; at rest, and where there is nothing, any scale will do.
    let least_span = if largest > 0.0 { 1e-6 * largest } else { 1.0 };
    Axis::around(&panel.label, values(), least_span)
}

fn legend(columns: &[Column], shown: &Shown, look: Look) -> Vec<Entry> {
    let dot = |color: RGBColor, text: &str| {
        let marker = Marker { shape: Shape::Circle, color, radius: 6.0, hollow: false };
        Entry::new(Key::Marker(marker), text)
    };
    let patch = |color, opacity, text| Entry::new(Key::Patch { color, opacity }, text);
    let has = |index: usize| columns.iter().any(|column| column.class.index() == index);
    let is_periodic = has(Class::Periodic { period: 1 }.index());
    let is_chaotic = has(Class::Chaotic.index());
    let periodic = class_color(Class::Periodic { period: 1 });
    let chaotic = class_color(Class::Chaotic);
    let mut entries = Vec::new();
    match look {
        Look::Walls => {
            let walls = Side::BOTH.into_iter().filter(|side| shown.walls.has(*side));
            entries.extend(walls.map(|side| dot(wall_color(side), &shown.walls.entry(side))));
            entries.extend(shown.has_strobes().then(|| dot(STROBE, "phase 0 of each period")));
            entries.extend(is_periodic.then(|| dot(periodic, "\u{3bb}: periodic")));
            entries.extend(is_chaotic.then(|| dot(chaotic, "\u{3bb}: chaotic")));
        }
        Look::Directions => {
            entries.push(dot(direction_color(Direction::Up), "followed upwards"));
            entries.push(dot(direction_color(Direction::Down), "downwards"));
            entries.push(dot(both_directions(), "both"));
            entries.extend(is_periodic.then(|| patch(periodic, 1.0, "periodic")));
            entries.extend(is_chaotic.then(|| patch(chaotic, 1.0, "chaotic")));
        }
    }
    if columns.iter().any(|column| column.lyapunov_error.is_some()) {
        entries.push(patch(chaotic, exponents::BAND, "\u{3bb}: standard error"));
    }
    if columns.iter().any(is_left_out) {
        entries.push(Entry::new(Key::Mark { color: FAINT }, "undecided or failed"));
    }
    entries
}

/// From the first column to the last, with room for their dots.
fn value_axis((label, scale): (&str, Scale), columns: &[Column]) -> Axis {
    if scale == Scale::Listed {
        let mut values: Vec<f64> =
            columns.iter().map(|c| c.value).filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        // Of two passes each has every value.
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

/// Pixels of the cloud of points to a pixel of the figure.
const FINE: f64 = 2.0;

/// Counts the dots on every pixel of the cloud, then gives each pixel its colour once.
fn draw_points(
    canvas: &Canvas<'_>,
    frame: &Frame,
    panel: &Panel,
    columns: &[Column],
    look: Look,
) -> Result<(), DrawError> {
    let Rect { left, top, right, bottom } = frame.rect;
    let [width, height] = [right - left, bottom - top].map(|side| (FINE * side).round().max(0.0) as usize);
    let mut counts = vec![[0u32; 2]; width * height];
    let [fine, joined] = [DOT.0, CURVE_DOT].map(|least| dot(frame, columns, least));
    for column in columns {
        let values = panel.values(column);
        let dot = if values.len() <= CURVE_POINTS { &joined } else { &fine };
        for (value, side) in values {
            let (x, y) = frame.at(column.value, value);
            if !(x.is_finite() && y.is_finite()) {
                continue;
            }
            let hue = look.place(column, side);
            let (x, y) = ((FINE * (x - left)).round() as i32, (FINE * (y - top)).round() as i32);
            for (dx, dy) in dot {
                let (column, row) = (x.saturating_add(*dx), y.saturating_add(*dy));
                if (0..width as i32).contains(&column) && (0..height as i32).contains(&row) {
                    counts[row as usize * width + column as usize][hue] += 1;
                }
            }
        }
    }
    let (darkest, colors) = (darkest(&counts), look.colors(panel));
    let mut cloud = Bitmap::clear([width, height]);
    for (i, [right, left_wall]) in counts.iter().enumerate().filter(|(_, sides)| **sides != [0, 0]) {
        let (count, share) = (f64::from(right + left_wall), f64::from(*right) / f64::from(right + left_wall));
        let opacity = SINGLE + (1.0 - SINGLE) * (count.ln() / darkest.ln()).min(1.0);
        cloud.set(i, mixed(colors, share), opacity);
    }
    canvas.image(frame.rect, cloud)
}

/// The cloud's pixels of one dot of radius `least` or more around its centre.
fn dot(frame: &Frame, columns: &[Column], least: f64) -> Vec<(i32, i32)> {
    let spacing = (frame.rect.right - frame.rect.left) / columns.len().max(1) as f64;
    let radius = FINE * (0.4 * spacing).clamp(least, DOT.1);
    let reach = radius.ceil() as i32;
    let all = (-reach..=reach).flat_map(|dx| (-reach..=reach).map(move |dy| (dx, dy)));
    all.filter(|(dx, dy)| f64::from(*dx).hypot(f64::from(*dy)) <= radius).collect()
}

/// The number of dots drawn at full strength: only one pixel in a hundred has more.
///
/// The few pixels that a periodic orbit falls on every time would fade all others.
fn darkest(counts: &[[u32; 2]]) -> f64 {
    let mut totals: Vec<u32> = counts.iter().map(|[a, b]| a + b).filter(|n| *n > 0).collect();
    if totals.is_empty() {
        return 2.0;
    }
    let rank = (totals.len() - 1) * 99 / 100;
    f64::from(*totals.select_nth_unstable(rank).1).max(2.0)
}

/// The colour of what both passes have.
fn both_directions() -> RGBColor {
    mixed(Side::BOTH.map(wall_color), 0.5)
}

/// Two colours, mixed where both meet: `first` is the share of the first.
fn mixed([a, b]: [RGBColor; 2], first: f64) -> RGBColor {
    let mix = |a: u8, b: u8| (first * f64::from(a) + (1.0 - first) * f64::from(b)).round() as u8;
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}
