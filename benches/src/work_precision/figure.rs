//! Figure of run time against error, with one curve per method.

use std::io::Write;

use super::points::Point;
use rattlemap::map::scene::{FigureStyle, Format};
use rattlemap::show::drawing::axis::Axis;
use rattlemap::show::drawing::frame::single;
use rattlemap::show::drawing::labels::Labels;
use rattlemap::show::drawing::legend::{Entry, Key, draw_head};
use rattlemap::show::drawing::{Canvas, Color, DARK, FAINT, Marker, Shape, write_figure};
use rattlemap::show::error::WriteError;

const WIDTH: f64 = 1500.0;
const HEIGHT: f64 = 1280.0;
const LEFT: f64 = 160.0;
/// Size of the text at the end of a curve.
const SMALLEST: f64 = 18.0;
const RADIUS: f64 = 7.0;
/// Range of errors. Figures show errors outside at its ends.
const ERRORS: (f64, f64) = (1e-16, 10.0);

/// Label and marker of a method.
struct Style {
    method: &'static str,
    label: &'static str,
    color: Color,
    shape: Shape,
}

const fn style(method: &'static str, label: &'static str, color: Color, shape: Shape) -> Style {
    Style { method, label, color, shape }
}

/// Methods in the order of the legend. Those of this project have circles.
const STYLES: [Style; 11] = [
    style("lane-f32", "lane, f32", [0xd5, 0x5e, 0x00], Shape::Circle),
    style("lane-f64", "lane, f64", [0x00, 0x72, 0xb2], Shape::Circle),
    style(MEASURE, "reference (error zero by definition)", [0x26, 0x26, 0x26], Shape::Circle),
    style("rk4-wgsl-f32", "RK4 in WGSL, one loop, f32", [0xe6, 0x9f, 0x00], Shape::Triangle),
    style("rk4-wgsl-f64", "RK4 in WGSL, one loop, f64", [0x56, 0xb4, 0xe9], Shape::Triangle),
    style("rk4-phased-f32", "RK4 in WGSL, two phases, f32", [0x9a, 0x6a, 0x00], Shape::Triangle),
    style("rk4-phased-f64", "RK4 in WGSL, two phases, f64", [0x1b, 0x6f, 0x8f], Shape::Triangle),
    style("rk4-core", "RK4 in Rust", [0x60, 0x60, 0x60], Shape::Triangle),
    style("rk4-numba", "RK4 in numba", [0xcc, 0x79, 0xa7], Shape::Triangle),
    style("dop853-core", "DOP853 (ode_solvers)", [0x00, 0x9e, 0x73], Shape::Square),
    style("heyoka", "heyoka", [0x6a, 0x3d, 0x9a], Shape::Square),
];

/// Title, axis label and error of a figure.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) title: &'static str,
    pub(super) axis: &'static str,
    pub(super) error: fn(&Point) -> f64,
}

/// Draws the points as a PNG. `subtitle` names the hardware.
///
/// # Errors
/// If the figure cannot be written.
pub(super) fn write(out: impl Write, subtitle: &str, view: View, points: &[Point]) -> Result<(), WriteError> {
    let canvas = Canvas::new(&FigureStyle::default(), WIDTH);
    draw(&canvas, subtitle, view, points);
    write_figure(out, Format::Png, &canvas)
}

fn draw(canvas: &Canvas, subtitle: &str, view: View, points: &[Point]) {
    let present: Vec<(&Style, Vec<&Point>)> = STYLES
        .iter()
        .map(|style| (style, points.iter().filter(|point| point.method == style.method).collect()))
        .filter(|(_, points): &(_, Vec<&Point>)| !points.is_empty())
        .collect();
    let mut entries: Vec<Entry> = present.iter().map(|(style, _)| entry(style)).collect();
    if let Some((style, _)) =
        present.iter().find(|(_, points)| points.iter().any(|point| is_lost(view, point)))
    {
        let marker = Marker { hollow: true, ..marker(style) };
        entries.push(Entry::new(Key::Marker(marker), "hollow: a lane failed"));
    }
    entries.push(Entry::new(
        Key::Mark { color: FAINT },
        "number: finest setting (steps per period, or tolerance)",
    ));
    let top = draw_head(canvas, view.title, subtitle, &entries) + 10.0;
    let error = |point: &Point| (view.error)(point).clamp(ERRORS.0, ERRORS.1);
    let points =
        || present.iter().flat_map(|(style, points)| points.iter().map(move |point| (style, *point)));
    let x = Axis::decades(
        "microseconds per lane and forcing period (processor: times cores; graphics card: as a whole)",
        points().map(|(_, point)| microseconds(point)),
    );
    let y = Axis::decades(
        view.axis,
        points().filter(|(style, _)| style.method != MEASURE).map(|(_, point)| error(point)),
    );
    let frame = single(canvas, top, HEIGHT, [x, y], LEFT);
    frame.draw_grid(canvas);
    let place = |point: &Point| frame.at(microseconds(point), error(point));
    let markers: Vec<_> =
        points().filter(|(style, _)| style.method != MEASURE).map(|(_, point)| place(point)).collect();
    let mut labels = Labels::new(&markers, RADIUS, frame.rect, SMALLEST);
    for (style, points) in &present {
        if style.method == MEASURE {
            let x = frame.at(microseconds(points[0]), 1.0).0;
            canvas.dashes(&[(x, frame.rect.top), (x, frame.rect.bottom)], 2.0, style.color);
            continue;
        }
        let path: Vec<_> = points.iter().map(|point| place(point)).collect();
        canvas.stroke(&path, 2.0, style.color);
        for (point, at) in points.iter().zip(&path) {
            canvas.marker(*at, Marker { hollow: is_lost(view, point), ..marker(style) });
        }
        if let (Some(point), Some(at)) = (points.last(), path.last()) {
            let before = path.iter().rev().nth(1).copied();
            labels.add(canvas, setting(point), *at, before, style.color);
        }
    }
    labels.draw(canvas);
    frame.draw_axes(canvas, true);
}

/// Returns the steps per period or the tolerance of a point.
fn setting(point: &Point) -> String {
    match (point.steps, point.tolerance) {
        (Some(steps), _) => steps.to_string(),
        (None, Some(tolerance)) => format!("{tolerance:e}").replace('-', "\u{2212}"),
        (None, None) => String::new(),
    }
}

/// Whether a lane failed or its error is as large as if it had.
fn is_lost(view: View, point: &Point) -> bool {
    (view.error)(point) > ERRORS.1
}

/// The method that is a vertical line, because its error is zero by definition.
const MEASURE: &str = "reference";

fn entry(style: &Style) -> Entry {
    let key = if style.method == MEASURE { Key::Dashes { color: DARK } } else { Key::Marker(marker(style)) };
    Entry::new(key, style.label)
}

fn marker(style: &Style) -> Marker {
    Marker { shape: style.shape, color: style.color, radius: RADIUS, hollow: false }
}

fn microseconds(point: &Point) -> f64 {
    1e6 * point.cost()
}
