//! Figures of `bench engines`: throughput against lanes, and where the time goes.

use std::path::Path;

use anyhow::Result;
use plotters::style::RGBColor;

use super::plot_style::axes::{Axis, Frame};
use super::plot_style::legend::{Entry, Key, draw_head};
use super::plot_style::{Align, Canvas, DARK, GRID, MEDIUM, Marker, Rect, SMALL, Shape, save_figure};
use crate::bench::engines::{Engine, Point, Run, Series, Times};
use crate::gpu::Precision;

const SIZE: (u32, u32) = (1700, 1150);
const LEFT: f64 = 190.0;
const RIGHT: f64 = 60.0;
const BELOW: f64 = 110.0;
const TICK: f64 = 7.0;
const WIDTH: f64 = 3.0;
const RADIUS: f64 = 7.0;
/// Axes span this many decades at least, and name all their ticks below the other number.
const LEAST_DECADES: f64 = 0.8;
const SHORT: f64 = 2.5;
/// Half the width of the bars' ends.
const END: f64 = 6.0;

/// Hardware in f32 and f64, then software.
const ON_DEVICE: [RGBColor; 4] = [
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
];
/// Processor threads, from few to many.
const ON_CPU: [RGBColor; 2] = [RGBColor(0xb8, 0xdc, 0xc8), RGBColor(0x00, 0x5a, 0x3c)];

/// A stage: its name, its colour and its time.
type StageOf = (&'static str, RGBColor, fn(&Times) -> f64);

/// Stages in their order.
const STAGES: [StageOf; 5] = [
    ("set-up", RGBColor(0x96, 0x96, 0x96), |times| times.prepare),
    ("upload", RGBColor(0xe6, 0x9f, 0x00), |times| times.upload),
    ("integration", RGBColor(0x00, 0x72, 0xb2), |times| times.integrate),
    ("read-back", RGBColor(0xcc, 0x79, 0xa7), |times| times.read),
    ("writing the table", RGBColor(0x00, 0x9e, 0x73), |times| times.write),
];

/// Draws throughput against lanes, a curve per engine.
///
/// # Errors
/// A file that cannot be written, by name.
pub(super) fn write_rates(path: &Path, all: &[Series], processor: &str) -> Result<()> {
    let all = fastest_first(all);
    save_figure(path, SIZE, |canvas| {
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
        let top = draw_head(canvas, title, &subtitle, &entries)? + 10.0;
        let frame = frame(canvas, top, &all);
        grid(canvas, &frame)?;
        for (&series, &color) in all.iter().zip(&colors) {
            curve(canvas, &frame, series, color)?;
        }
        axes(canvas, &frame)
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

fn colors(all: &[&Series]) -> Vec<RGBColor> {
    let most = all.iter().filter_map(|series| series.engine.threads()).max().unwrap_or(1);
    let color = |series: &&Series| match series.engine {
        Engine::Gpu { precision, is_hardware, .. } => {
            ON_DEVICE[usize::from(precision == Precision::F64) + if is_hardware { 0 } else { 2 }]
        }
        Engine::Cpu { threads } => {
            let share = if most > 1 { (threads as f64).ln() / (most as f64).ln() } else { 1.0 };
            let mix = |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
            let [RGBColor(a, b, c), RGBColor(d, e, f)] = ON_CPU;
            RGBColor(mix(a, d), mix(b, e), mix(c, f))
        }
    };
    all.iter().map(color).collect()
}

/// All points with some room; coordinates are decimal logarithms.
fn frame(canvas: &Canvas<'_>, top: f64, all: &[&Series]) -> Frame {
    let (width, height) = canvas.size();
    let rect = Rect { left: LEFT, top, right: width - RIGHT, bottom: height - BELOW };
    let points = || all.iter().flat_map(|series| &series.points);
    let lanes = points().map(|point| (point.lanes as f64).log10());
    let rates = points().flat_map(|point| {
        let spread = point.spread(Run::rate);
        [spread.low, spread.high].map(f64::log10)
    });
    Frame {
        rect,
        x: Axis::around("lanes", lanes, LEAST_DECADES),
        y: Axis::around("forcing periods per second, over all lanes", rates, LEAST_DECADES),
    }
}

/// One, two and five times powers of ten on an axis of logarithms, and which of them are named:
/// all of them on a short axis, else the powers alone.
fn ticks(axis: &Axis) -> impl Iterator<Item = (f64, bool, String)> + use<> {
    let Axis { low, high, .. } = *axis;
    let names_all = high - low < SHORT;
    (low.floor() as i32..=high.ceil() as i32)
        .flat_map(|decade| [1, 2, 5].map(|part| (decade, part)))
        .map(move |(decade, part)| {
            let at = f64::from(decade) + f64::from(part).log10();
            (at, part == 1 || names_all, named(part, decade))
        })
        .filter(move |(at, ..)| (low..=high).contains(at))
}

fn grid(canvas: &Canvas<'_>, frame: &Frame) -> Result<()> {
    let Rect { left, top, right, bottom } = frame.rect;
    let width = |is_named| if is_named { 1.5 } else { 0.7 };
    for (at, is_named, _) in ticks(&frame.x) {
        let x = frame.at(at, 0.0).0;
        canvas.stroke(&[(x, top), (x, bottom)], width(is_named), GRID)?;
    }
    for (at, is_named, _) in ticks(&frame.y) {
        let y = frame.at(0.0, at).1;
        canvas.stroke(&[(left, y), (right, y)], width(is_named), GRID)?;
    }
    Ok(())
}

fn axes(canvas: &Canvas<'_>, frame: &Frame) -> Result<()> {
    let Rect { left, top, right, bottom } = frame.rect;
    canvas.stroke(
        &[(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)],
        1.5,
        DARK,
    )?;
    for (at, _, name) in ticks(&frame.x).filter(|(_, is_named, _)| *is_named) {
        let x = frame.at(at, 0.0).0;
        canvas.stroke(&[(x, bottom), (x, bottom + TICK)], 1.5, DARK)?;
        canvas.text(&name, (x, bottom + TICK + 17.0), SMALL, Align::Center, DARK)?;
    }
    for (at, _, name) in ticks(&frame.y).filter(|(_, is_named, _)| *is_named) {
        let y = frame.at(0.0, at).1;
        canvas.stroke(&[(left - TICK, y), (left, y)], 1.5, DARK)?;
        canvas.text(&name, (left - TICK - 6.0, y), SMALL, Align::Right, DARK)?;
    }
    let middle = ((left + right) / 2.0, bottom + TICK + 56.0);
    canvas.text(&frame.x.label, middle, MEDIUM, Align::Center, DARK)?;
    canvas.text(&frame.y.label, (left - 145.0, (top + bottom) / 2.0), MEDIUM, Align::Upwards, DARK)
}

/// `part` times a power of ten as people say it.
fn named(part: u32, decade: i32) -> String {
    match decade {
        0..=2 => (part * 10u32.pow(decade as u32)).to_string(),
        3..=5 => format!("{} 000", part * 10u32.pow(decade as u32 - 3)),
        6..=8 => format!("{} million", part * 10u32.pow(decade as u32 - 6)),
        9..=11 => format!("{} billion", part * 10u32.pow(decade as u32 - 9)),
        _ => format!("{part}e{decade}"),
    }
}

fn curve(canvas: &Canvas<'_>, frame: &Frame, series: &Series, color: RGBColor) -> Result<()> {
    let place = |point: &Point, rate: f64| frame.at((point.lanes as f64).log10(), rate.log10());
    let line: Vec<_> =
        series.points.iter().map(|point| place(point, point.spread(Run::rate).median)).collect();
    canvas.stroke(&line, WIDTH, color)?;
    for (point, &at) in series.points.iter().zip(&line) {
        let spread = point.spread(Run::rate);
        let (low, high) = (place(point, spread.low), place(point, spread.high));
        canvas.stroke(&[low, high], 1.5, color)?;
        for end in [low, high] {
            canvas.stroke(&[(end.0 - END, end.1), (end.0 + END, end.1)], 1.5, color)?;
        }
        let marker = Marker { shape: Shape::Circle, color, radius: RADIUS, hollow: false };
        canvas.marker(at, marker)?;
    }
    Ok(())
}

const BAR: f64 = 44.0;
const ROW: f64 = 96.0;

/// Draws, for the largest map of every engine, how its time is shared among the stages.
///
/// # Errors
/// A file that cannot be written, by name.
pub(super) fn write_stages(path: &Path, all: &[Series]) -> Result<()> {
    let rows: Vec<(&Series, &Point)> =
        fastest_first(all).into_iter().filter_map(|series| Some((series, series.largest()?))).collect();
    let height = 320.0 + ROW * rows.len() as f64;
    save_figure(path, (SIZE.0, height as u32), |canvas| {
        let entries: Vec<Entry> = STAGES
            .iter()
            .map(|&(name, color, _)| Entry::new(Key::Patch { color, opacity: 1.0 }, name))
            .collect();
        let title = "Where the time goes: the more of it is integration, the better";
        let subtitle = "the largest map of every engine; medians";
        let top = draw_head(canvas, title, subtitle, &entries)? + 10.0;
        let rect = Rect { left: LEFT - 110.0, top, right: canvas.size().0 - RIGHT, bottom: height - BELOW };
        let x = Axis::exact("share of the time, %", 0.0, 100.0);
        let frame = Frame { rect, x, y: Axis::exact("", 0.0, 1.0) };
        for (nth, (series, point)) in rows.iter().enumerate() {
            stages(canvas, &frame, top + ROW * nth as f64, series, point)?;
        }
        let Rect { left, right, bottom, .. } = rect;
        canvas.stroke(&[(left, bottom), (right, bottom)], 1.5, DARK)?;
        for percent in (0..=100).step_by(20) {
            let x = frame.at(percent.into(), 0.0).0;
            canvas.stroke(&[(x, bottom), (x, bottom + TICK)], 1.5, DARK)?;
            canvas.text(&percent.to_string(), (x, bottom + TICK + 17.0), SMALL, Align::Center, DARK)?;
        }
        let middle = ((left + right) / 2.0, bottom + TICK + 56.0);
        canvas.text(&frame.x.label, middle, MEDIUM, Align::Center, DARK)
    })
}

fn stages(canvas: &Canvas<'_>, frame: &Frame, top: f64, series: &Series, point: &Point) -> Result<()> {
    let medians = STAGES.map(|(_, _, of)| point.spread(|run| of(&run.times)).median);
    let total: f64 = medians.iter().sum();
    let text = format!("{}: {} lanes, {} s", series.engine.label(), grouped(point.lanes), seconds(total));
    canvas.text(&text, (frame.rect.left, top + 20.0), SMALL, Align::Left, DARK)?;
    let mut from = 0.0;
    for ((_, color, _), time) in STAGES.iter().zip(medians) {
        let to = from + 100.0 * time / total;
        let column = frame.column(from, to);
        canvas.fill(Rect { top: top + 38.0, bottom: top + 38.0 + BAR, ..column }, *color, 1.0)?;
        from = to;
    }
    Ok(())
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
    fn ticks_are_powers_of_ten_and_on_short_axes_their_parts() {
        let names = |low: f64, high: f64| -> Vec<String> {
            let named = ticks(&Axis::exact("", low, high)).filter(|(_, is_named, _)| *is_named);
            named.map(|(_, _, name)| name).collect()
        };
        assert_eq!(names(2.9, 7.1), ["1 000", "10 000", "100 000", "1 million", "10 million"]);
        assert_eq!(names(4.8, 6.5), ["100 000", "200 000", "500 000", "1 million", "2 million"]);
        assert_eq!(grouped(9_998_244), "9 998 244");
        assert_eq!([2.516, 31.77, 0.00123].map(seconds), ["2.52", "31.8", "0.00123"]);
    }
}
