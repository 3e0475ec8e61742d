//! A layer of a map as a picture: axes, legend, colour bar.

use std::path::Path;

use plotters::style::RGBColor;

use super::cells::Cells;
use super::layers::{Bar, Entry, Layer};
use super::plot_style::axes::{Axis, Frame};
use super::plot_style::legend::draw_head;
use super::plot_style::{Align, BELOW, Canvas, DARK, Rect, SMALL, save_figure};
use super::{DrawError, FigureError};
use crate::map::scene::{self, Scene, Start};

const LEFT: f64 = 140.0;
const TOP: f64 = 130.0;
/// Room for the legend beside the map.
const BESIDE: f64 = 460.0;
/// Between map and legend.
const GAP: f64 = 36.0;
/// A map's side in pixels: as many whole pixels per cell as fit the first, cells left out
/// beyond the second.
const SIDE: usize = 1024;
const LONGEST_SIDE: usize = 2048;

const ROW: f64 = 33.0;
const PATCH: (f64, f64) = (34.0, 20.0);
const BAR_WIDTH: f64 = 34.0;
const BAR_HEIGHT: f64 = 260.0;
/// Room for a bar's name, and between it and the entries above.
const BAR_HEAD: f64 = 44.0;
const ABOVE_BAR: f64 = 26.0;
/// Height of a picture's inside at least.
const LOWEST: f64 = 700.0;

/// Draws a layer as a PNG.
///
/// # Errors
/// A file that cannot be written, by name.
pub(super) fn write(path: &Path, cells: &Cells<'_>, layer: &Layer) -> Result<(), FigureError> {
    let [width, height] = cells.counts().map(side);
    let inside = height.max(legend_height(layer)).max(LOWEST);
    let size = (LEFT + width + GAP + BESIDE, TOP + inside + BELOW);
    save_figure(path, (size.0 as u32, size.1 as u32), |canvas| draw(canvas, cells, layer, [width, height]))
}

/// Height of what stands beside the map: entries, then the bar.
fn legend_height(layer: &Layer) -> f64 {
    let entries = ROW * layer.entries.len() as f64;
    layer.bar.as_ref().map_or(entries, |_| bar_top(layer) + BAR_HEAD + BAR_HEIGHT)
}

/// Where the bar begins, below the legend's top.
fn bar_top(layer: &Layer) -> f64 {
    let entries = ROW * layer.entries.len() as f64;
    if layer.entries.is_empty() { 0.0 } else { entries + ABOVE_BAR }
}

/// Pixels for a number of cells.
pub(super) fn side(count: usize) -> f64 {
    let pixels = if count <= SIDE { count * (SIDE / count) } else { count.min(LONGEST_SIDE) };
    pixels as f64
}

fn draw(
    canvas: &Canvas<'_>,
    cells: &Cells<'_>,
    layer: &Layer,
    [width, height]: [f64; 2],
) -> Result<(), DrawError> {
    let scene = cells.scene();
    draw_head(canvas, scene.title(), &format!("{}; {}", layer.title, subtitle(scene)), &[])?;
    let rect = Rect { left: LEFT, top: TOP, right: LEFT + width, bottom: TOP + height };
    let [columns, _] = cells.counts();
    canvas
        .raster(rect, cells.counts(), |[i, j]| layer.palette[usize::from(layer.indices[j * columns + i])])?;
    let [x, y] = [0, 1].map(|i| axis(&scene.axes()[i]));
    Frame { rect, x, y }.draw_axes(canvas, true)?;
    let left = rect.right + GAP;
    draw_entries(canvas, layer, (left, TOP), cells)?;
    match &layer.bar {
        Some(bar) => draw_bar(canvas, bar, (left, TOP + bar_top(layer))),
        None => Ok(()),
    }
}

/// Where cells start and how long they run: what a map means depends on it.
pub(super) fn subtitle(scene: &Scene) -> String {
    let last = scene.axes().last().map_or("", |axis| &*axis.parameter().name);
    let start = match scene.start() {
        Start::Rest => "from rest".to_owned(),
        Start::State([x1, v1, x2, v2]) => format!("from ({x1}, {v1}, {x2}, {v2})"),
        Start::Up => format!("from the attractor at the next lower {last}"),
        Start::Down => format!("from the attractor at the next higher {last}"),
        Start::Both => format!("from the attractors at the next {last} on either side"),
    };
    let more_starts = match scene.draw() {
        Some(draw) => format!(", attractors counted with {} random states more", draw.count - 1),
        None => String::new(),
    };
    let integration = scene.integration();
    let (transient, observed) = (integration.transient_periods, integration.observed_periods);
    let upper = if integration.early_stop { "at most " } else { "" };
    let more = match integration.undecided_periods {
        more if more > 0 && integration.early_stop => format!(", undecided cells up to {more} more"),
        _ => String::new(),
    };
    // What was not integrated must not look as if it had been.
    let filled = match scene.refine() {
        Some(_) => "; refined at borders, the rest filled and audited",
        None => "",
    };
    format!("every cell {start}{more_starts}, {upper}{transient} + {observed} forcing periods{more}{filled}")
}

/// An axis on which cells lie at their values: it reaches half a cell further.
pub(super) fn axis(axis: &scene::Axis) -> Axis {
    let half = (axis.max() - axis.min()) / (axis.count() - 1) as f64 / 2.0;
    let label = format!("{} {}", axis.parameter().meaning, axis.parameter().name);
    Axis::exact(&label, axis.min() - half, axis.max() + half)
}

fn rgb([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

/// Draws a list of colours with their names and shares.
fn draw_entries(
    canvas: &Canvas<'_>,
    layer: &Layer,
    (left, top): (f64, f64),
    cells: &Cells<'_>,
) -> Result<(), DrawError> {
    let total: usize = cells.counts().iter().product();
    let right = left + BESIDE - GAP - 20.0;
    for (row, entry) in layer.entries.iter().enumerate() {
        let y = top + ROW * (row as f64 + 0.5);
        let patch = Rect { left, top: y - PATCH.1 / 2.0, right: left + PATCH.0, bottom: y + PATCH.1 / 2.0 };
        canvas.fill(patch, rgb(entry.color), 1.0)?;
        canvas.outline(patch, 1.0)?;
        let share = share(entry, total);
        let room = right - left - PATCH.0 - 14.0 - canvas.text_width(&share, SMALL)? - 16.0;
        let text = canvas.fitted(&entry.text, SMALL, room)?;
        canvas.text(&text, (left + PATCH.0 + 14.0, y), SMALL, Align::Left, DARK)?;
        canvas.text(&share, (right, y), SMALL, Align::Right, DARK)?;
    }
    Ok(())
}

fn share(entry: &Entry, total: usize) -> String {
    let percent = 100.0 * entry.cells as f64 / total as f64;
    match entry.cells {
        _ if percent >= 0.1 => format!("{percent:.1} %"),
        1 => "1 cell".to_owned(),
        cells => format!("{cells} cells"),
    }
}

fn draw_bar(canvas: &Canvas<'_>, bar: &Bar, (left, top): (f64, f64)) -> Result<(), DrawError> {
    canvas.text(bar.label, (left, top + 12.0), SMALL, Align::Left, DARK)?;
    let top = top + BAR_HEAD;
    let rect = Rect { left, top, right: left + BAR_WIDTH, bottom: top + BAR_HEIGHT };
    canvas.raster(rect, [1, bar.colors.len()], |[_, row]| bar.colors[row])?;
    canvas.outline(rect, 1.0)?;
    let frame = Frame { rect, x: Axis::exact("", 0.0, 1.0), y: Axis::exact("", bar.low, bar.high) };
    frame.draw_scale(canvas)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::Plan;
    use crate::map::scene::Purpose;
    use crate::record::Record;

    const LOW: [u8; 3] = [1, 2, 3];
    const HIGH: [u8; 3] = [4, 5, 6];

    /// Of a map that is lower than its legend, the whole bar is in the picture.
    #[test]
    fn long_legends_make_room_for_themselves() {
        let text = "[[axis]]\nparameter = 'e'\nmin = 0.0\nmax = 1.0\ncount = 8\n\
                    [[axis]]\nparameter = 'omega'\nmin = 1.0\nmax = 12.0\ncount = 600\n";
        let scene = Scene::parse(text, "s", &[], Purpose::Map).unwrap();
        let plan = Plan::new(&scene);
        let records = vec![Record::default(); plan.run_count()];
        let cells = Cells::new(&scene, &plan, &records);
        let dir = tempfile::tempdir().unwrap();
        for count in [0, 1, 21, 60] {
            let entry = |n: usize| Entry { color: [200; 3], text: format!("period {n}"), cells: 1 };
            let bar = Bar { label: "exponent", colors: vec![LOW, [120; 3], HIGH], low: 0.0, high: 1.0 };
            let layer = Layer {
                name: "map",
                short: "map",
                title: "a map",
                indices: vec![0; records.len()],
                palette: vec![[255; 3]],
                entries: (0..count).map(entry).collect(),
                bar: Some(bar),
            };
            let path = dir.path().join("map.png");
            write(&path, &cells, &layer).unwrap();
            let picture = image::open(&path).unwrap().to_rgb8();
            let pixels = |color: [u8; 3]| picture.pixels().filter(|pixel| pixel.0 == color).count();
            // Each of three colours has a third of the bar, less the outline.
            let least = (BAR_WIDTH - 4.0) * (BAR_HEIGHT / 3.0 - 4.0);
            for color in [LOW, HIGH] {
                assert!(pixels(color) as f64 > least, "{count} entries: {} of {least}", pixels(color));
            }
        }
    }
}
