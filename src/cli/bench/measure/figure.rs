//! Figures of `bench engines`: throughput against lanes, and where the time goes.

use std::io::Write;

use super::{Engine, Point, Run, Series, Times};
use crate::gpu::Precision;
use crate::map::scene::Format;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::Frame;
use crate::show::drawing::legend::{Entry, Key, draw_head};
use crate::show::drawing::{Align, Canvas, Color, DARK, Marker, Rect, SMALL, Shape, write_figure};
use crate::show::error::WriteError;

const SIZE: (u32, u32) = (1700, 1150);
const LEFT: f64 = 190.0;
const WIDTH: f64 = 3.0;
const RADIUS: f64 = 7.0;
/// Axes span this many decades at least.
const LEAST_DECADES: f64 = 0.8;
/// Half the width of the bars' ends.
const END: f64 = 6.0;

/// Hardware in f32 and f64, then software.
const ON_DEVICE: [Color; 4] =
    [[0xd5, 0x5e, 0x00], [0x00, 0x72, 0xb2], [0xe6, 0x9f, 0x00], [0x56, 0xb4, 0xe9]];
/// Processor threads, from few to many.
const ON_CPU: [Color; 2] = [[0xb8, 0xdc, 0xc8], [0x00, 0x5a, 0x3c]];

/// A stage: its name, its colour and its time.
type StageOf = (&'static str, Color, fn(&Times) -> f64);

/// Stages in their order.
const STAGES: [StageOf; 5] = [
    ("set-up", [0x96, 0x96, 0x96], |times| times.prepare),
    ("upload", [0xe6, 0x9f, 0x00], |times| times.upload),
    ("integration", [0x00, 0x72, 0xb2], |times| times.integrate),
    ("read-back", [0xcc, 0x79, 0xa7], |times| times.read),
    ("writing the table", [0x00, 0x9e, 0x73], |times| times.write),
];

/// Draws throughput against lanes, a curve per engine.
///
/// # Errors
/// If the figure cannot be written.
pub(super) fn write_rates(out: impl Write, all: &[Series], processor: &str) -> Result<(), WriteError> {
    let all = fastest_first(all);
    write_figure(out, Format::Png, SIZE, |canvas| {
        let colors = colors(&all);
        let entries: Vec<Entry> = all
            .iter()
            .zip(&colors)
            .map(|(series, &color)| Entry::new(Key::Line { color, width: WIDTH }, &series.engine.label()))
            .collect();
        let title = "One map on every engine, forcing periods per second: higher is better";
        let subtitle = format!(
            "restitution x frequency, from lanes handed over to records read; medians, bars from the slowest run to \
             the fastest; processor: {processor}"
        );
        let top = draw_head(canvas, title, &subtitle, &entries) + 10.0;
        let frame = frame(canvas, top, &all);
        frame.draw_grid(canvas);
        for (&series, &color) in all.iter().zip(&colors) {
            curve(canvas, &frame, series, color);
        }
        frame.draw_axes(canvas, true);
    })
}

/// By the best median of any size.
fn fastest_first(all: &[Series]) -> Vec<&Series> {
    let best = |series: &Series| {
        series.points.iter().map(|point| point.spread(Run::rate).median).fold(0.0, f64::max)
    };
    let mut sorted: Vec<&Series> = all.iter().collect();
    sorted.sort_by(|a, b| best(b).total_cmp(&best(a)));
    sorted
}

fn colors(all: &[&Series]) -> Vec<Color> {
    let most = all.iter().filter_map(|series| series.engine.threads()).max().unwrap_or(1);
    let color = |series: &&Series| match series.engine {
        Engine::Gpu { precision, is_hardware, .. } => {
            ON_DEVICE[usize::from(precision == Precision::F64) + if is_hardware { 0 } else { 2 }]
        }
        Engine::Cpu { threads } => {
            let share = if most > 1 { (threads as f64).ln() / (most as f64).ln() } else { 1.0 };
            let mix = |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
            let [[a, b, c], [d, e, f]] = ON_CPU;
            [mix(a, d), mix(b, e), mix(c, f)]
        }
    };
    all.iter().map(color).collect()
}

/// All points with some room.
fn frame(canvas: &Canvas, top: f64, all: &[&Series]) -> Frame {
    let points = || all.iter().flat_map(|series| &series.points);
    let lanes = points().map(|point| point.lanes as f64);
    let rates = points().flat_map(|point| {
        let spread = point.spread(Run::rate);
        [spread.low, spread.high]
    });
    Frame {
        rect: canvas.panel(LEFT, top),
        x: Axis::around_logarithms("lanes", lanes, LEAST_DECADES),
        y: Axis::around_logarithms("forcing periods per second, over all lanes", rates, LEAST_DECADES),
    }
}

fn curve(canvas: &Canvas, frame: &Frame, series: &Series, color: Color) {
    let place = |point: &Point, rate: f64| frame.at(point.lanes as f64, rate);
    let line: Vec<_> =
        series.points.iter().map(|point| place(point, point.spread(Run::rate).median)).collect();
    canvas.stroke(&line, WIDTH, color);
    for (point, &at) in series.points.iter().zip(&line) {
        let spread = point.spread(Run::rate);
        let (low, high) = (place(point, spread.low), place(point, spread.high));
        canvas.stroke(&[low, high], 1.5, color);
        for end in [low, high] {
            canvas.stroke(&[(end.0 - END, end.1), (end.0 + END, end.1)], 1.5, color);
        }
        let marker = Marker { shape: Shape::Circle, color, radius: RADIUS, hollow: false };
        canvas.marker(at, marker);
    }
}

const LEFT_OF_STAGES: f64 = 80.0;
const BAR: f64 = 44.0;
const ROW: f64 = 96.0;

/// Draws, for the largest map of every engine, how its time is shared among the stages.
///
/// # Errors
/// If the figure cannot be written.
pub(super) fn write_stages(out: impl Write, all: &[Series]) -> Result<(), WriteError> {
    let rows: Vec<(&Series, &Point)> =
        fastest_first(all).into_iter().filter_map(|series| Some((series, series.largest()?))).collect();
    let height = 320.0 + ROW * rows.len() as f64;
    write_figure(out, Format::Png, (SIZE.0, height as u32), |canvas| {
        let entries: Vec<Entry> = STAGES
            .iter()
            .map(|&(name, color, _)| Entry::new(Key::Patch { color, opacity: 1.0 }, name))
            .collect();
        let title = "Where the time goes: the more of it is integration, the better";
        let subtitle = "the largest map of every engine; medians";
        let top = draw_head(canvas, title, subtitle, &entries) + 10.0;
        let x = Axis::exact("share of the time, %", 0.0, 100.0);
        let frame = Frame { rect: canvas.panel(LEFT_OF_STAGES, top), x, y: Axis::exact("", 0.0, 1.0) };
        for (nth, (series, point)) in rows.iter().enumerate() {
            stages(canvas, &frame, top + ROW * nth as f64, series, point);
        }
        frame.draw_x_axis(canvas, true);
    })
}

fn stages(canvas: &Canvas, frame: &Frame, top: f64, series: &Series, point: &Point) {
    let medians = STAGES.map(|(_, _, of)| point.spread(|run| of(&run.times)).median);
    let total: f64 = medians.iter().sum();
    let text = format!("{}: {} lanes, {} s", series.engine.label(), grouped(point.lanes), seconds(total));
    canvas.text(&text, (frame.rect.left, top + 20.0), SMALL, Align::Left, DARK);
    let mut from = 0.0;
    for ((_, color, _), time) in STAGES.iter().zip(medians) {
        let to = from + 100.0 * time / total;
        let column = frame.column(from, to);
        canvas.fill(Rect { top: top + 38.0, bottom: top + 38.0 + BAR, ..column }, *color, 1.0);
        from = to;
    }
}

/// Three significant digits.
fn seconds(x: f64) -> String {
    let digits = (2.0 - x.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{x:.digits$}")
}

/// Digits in groups of three.
fn grouped(n: usize) -> String {
    let digits = n.to_string();
    let groups: Vec<&str> = digits
        .as_bytes()
        .rchunks(3)
        .rev()
        .map(|group| std::str::from_utf8(group).unwrap_or_default())
        .collect();
    groups.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_for_the_eye() {
        assert_eq!(grouped(9_998_244), "9 998 244");
        assert_eq!([2.516, 31.77, 0.00123].map(seconds), ["2.52", "31.8", "0.00123"]);
    }
}
