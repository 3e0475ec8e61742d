//! Figure of `bench engines`: throughput against the number of lanes, a curve per engine.

use std::io::Write;

use super::measure::{BenchPoint, Run, Series, Target};
use crate::gpu::Precision;
use crate::map::scene::{FigureStyle, Format};
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, single};
use crate::show::drawing::legend::{Entry, Key, draw_head};
use crate::show::drawing::{Canvas, Color, Marker, Shape, write_figure};
use crate::show::error::WriteError;

/// Default size.
const FIGURE_WIDTH: f64 = 1700.0;
const FIGURE_HEIGHT: f64 = 1150.0;
/// Least left margin in a figure of default size.
const LEFT: f64 = 190.0;
/// Width of curves in pixels.
const WIDTH: f64 = 3.0;
/// Shortest length of an axis in decades.
const MIN_DECADES: f64 = 0.8;
/// Half the width of an error bar's end in pixels.
const BAR_END: f64 = 6.0;

/// Colours of hardware in f32 and f64, then of software drivers in f32 and f64.
const GPU_COLORS: [Color; 4] =
    [[0xd5, 0x5e, 0x00], [0x00, 0x72, 0xb2], [0xe6, 0x9f, 0x00], [0x56, 0xb4, 0xe9]];
const CPU_COLOR: Color = [0x00, 0x5a, 0x3c];

/// Draws throughput against lanes, engines sorted by their best rate.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write(
    out: impl Write,
    style: &FigureStyle,
    all: &[Series],
    processor: &str,
) -> Result<(), WriteError> {
    let rate = |point: &BenchPoint| point.spread(Run::rate).median;
    let best = |series: &Series| series.points.iter().map(rate).fold(0.0, f64::max);
    let mut sorted: Vec<&Series> = all.iter().collect();
    sorted.sort_by(|a, b| best(b).total_cmp(&best(a)));
    let canvas = Canvas::new(style, FIGURE_WIDTH);
    let entry = |series: &&Series| {
        Entry::new(Key::Line { color: color(&series.target), width: WIDTH }, &series.target.label())
    };
    let entries: Vec<Entry> = sorted.iter().map(entry).collect();
    let title = "One map on every engine, forcing periods per second: higher is better";
    let subtitle = format!(
        "restitution x frequency, integration and transfer of records; medians, bars from the slowest run to the \
         fastest; processor: {processor}"
    );
    let top = draw_head(&canvas, title, &subtitle, &entries) + 10.0;
    let frame = single(&canvas, top, FIGURE_HEIGHT, axes(&sorted), LEFT);
    frame.draw_grid(&canvas);
    for series in &sorted {
        curve(&canvas, &frame, series);
    }
    frame.draw_axes(&canvas, true);
    write_figure(out, Format::Png, &canvas)
}

fn color(target: &Target) -> Color {
    match target.adapter {
        None => CPU_COLOR,
        Some(_) => {
            let row = if target.is_hardware { 0 } else { 2 };
            GPU_COLORS[row + usize::from(target.precision == Precision::F64)]
        }
    }
}

/// Returns the horizontal and the vertical axis.
fn axes(all: &[&Series]) -> [Axis; 2] {
    let points = || all.iter().flat_map(|series| &series.points);
    let lanes = points().map(|point| point.lanes as f64);
    let rates = points().flat_map(|point| point.runs.iter().map(Run::rate));
    [
        Axis::around_logarithms("lanes", lanes, MIN_DECADES),
        Axis::around_logarithms("forcing periods per second, over all lanes", rates, MIN_DECADES),
    ]
}

fn curve(canvas: &Canvas, frame: &Frame, series: &Series) {
    let color = color(&series.target);
    let place = |point: &BenchPoint, rate: f64| frame.at(point.lanes as f64, rate);
    let medians = series.points.iter().map(|point| place(point, point.spread(Run::rate).median));
    let line: Vec<_> = medians.collect();
    canvas.stroke(&line, WIDTH, color);
    for (point, &at) in series.points.iter().zip(&line) {
        let spread = point.spread(Run::rate);
        let bar = [spread.low, spread.high].map(|rate| place(point, rate));
        canvas.stroke(&bar, 1.5, color);
        for (x, y) in bar {
            canvas.stroke(&[(x - BAR_END, y), (x + BAR_END, y)], 1.5, color);
        }
        canvas.marker(at, Marker { shape: Shape::Circle, color, radius: 7.0, hollow: false });
    }
}
