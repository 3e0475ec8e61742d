//! A layer of a map as a picture: axes, legend, colour bar.

use std::path::Path;

use crate::map::scene::{self, Scale, Scene, Start};
use crate::show::caption;
use crate::show::cells::Cells;
use crate::show::drawing::axes::{self, Axis, Frame};
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Align, BELOW, Canvas, DARK, RGBColor, Rect, SMALL, save_figure};
use crate::show::error::{DrawError, FigureError};
use crate::show::layers::{Bar, Layer, share};
use crate::show::symbols::{axis_label, number, symbol};

const LEFT: f64 = 140.0;
const TOP: f64 = 162.0;
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
/// Length of the arrow at an end beyond which there are values.
const ARROW: f64 = 18.0;
/// Room for a bar's name, and between it and the entries above.
const BAR_HEAD: f64 = 50.0;
const ABOVE_BAR: f64 = 26.0;
/// Height of a picture's inside at least.
const LOWEST: f64 = 700.0;

/// Draws a layer, in the format that the file's name tells.
///
/// # Errors
/// A file that cannot be written, by name.
pub(crate) fn write(path: &Path, cells: &Cells<'_>, layer: &Layer) -> Result<(), FigureError> {
    let [width, height] = cells.counts().map(side);
    let inside = height.max(legend_height(layer)).max(LOWEST);
    let size = (LEFT + width + GAP + BESIDE, TOP + inside + BELOW);
    save_figure(path, (size.0 as u32, size.1 as u32), |canvas| draw(canvas, cells, layer, [width, height]))
}

/// Height of what stands beside the map: entries, then the bar.
fn legend_height(layer: &Layer) -> f64 {
    let entries = ROW * layer.entries.len() as f64;
    let below = |bar: &Bar| match bar.left_out(1).len() {
        0 => 0.0,
        lines => ARROW + ROW * lines as f64,
    };
    layer.bar.as_ref().map_or(entries, |bar| bar_top(layer) + BAR_HEAD + BAR_HEIGHT + below(bar))
}

/// Where the bar begins, below the legend's top.
fn bar_top(layer: &Layer) -> f64 {
    let entries = ROW * layer.entries.len() as f64;
    if layer.entries.is_empty() { 0.0 } else { entries + ABOVE_BAR }
}

/// Pixels for a number of cells.
pub(crate) fn side(count: usize) -> f64 {
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
    let subtitle = format!("{}; {}\n{}", layer.title, subtitle(scene), caption::of_scene(scene));
    draw_head(canvas, scene.title(), &subtitle, &[])?;
    let rect = Rect { left: LEFT, top: TOP, right: LEFT + width, bottom: TOP + height };
    let [columns, _] = cells.counts();
    canvas
        .raster(rect, cells.counts(), |[i, j]| layer.palette[usize::from(layer.indices[j * columns + i])])?;
    let [x, y] = [0, 1].map(|i| axis(&scene.axes()[i]));
    Frame { rect, x, y }.draw_axes(canvas, true)?;
    let left = rect.right + GAP;
    draw_entries(canvas, layer, (left, TOP), cells)?;
    match &layer.bar {
        Some(bar) => draw_bar(canvas, bar, (left, TOP + bar_top(layer)), cells.counts().iter().product()),
        None => Ok(()),
    }
}

/// Where cells start and how long they run: what a map means depends on it.
pub(crate) fn subtitle(scene: &Scene) -> String {
    let last = scene.axes().last().map_or(String::new(), |axis| symbol(&axis.parameter().name));
    let start = match scene.start() {
        Start::Rest if scene.sweeps_start() => "from its own state, the other components 0".to_owned(),
        Start::State(state) if scene.sweeps_start() => {
            format!("from its own state, the other components of ({})", state.map(number).join(", "))
        }
        Start::Rest => "from rest".to_owned(),
        Start::State(state) => format!("from ({})", state.map(number).join(", ")),
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

/// An axis on which cells lie at their values, or in the order of these where they are listed: it reaches half a cell
/// further.
pub(crate) fn axis(axis: &scene::Axis) -> Axis {
    let (min, max, steps) = (axis.min(), axis.max(), (axis.count() - 1) as f64);
    let label = axis_label(axis.parameter());
    match axis.scale() {
        Scale::Linear => {
            let half = (max - min) / steps / 2.0;
            Axis::exact(&label, min - half, max + half)
        }
        Scale::Log => {
            let half = (max.log10() - min.log10()) / steps / 2.0;
            let ends = Axis::exact(&label, min.log10() - half, max.log10() + half);
            Axis { scale: axes::Scale::Logarithmic, ..ends }
        }
        Scale::Values => Axis::listed(&label, axis.values()),
    }
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
        let share = share(entry.cells, total);
        let room = right - left - PATCH.0 - 14.0 - canvas.text_width(&share, SMALL)? - 16.0;
        let text = canvas.fitted(&entry.text, SMALL, room)?;
        canvas.text(&text, (left + PATCH.0 + 14.0, y), SMALL, Align::Left, DARK)?;
        canvas.text(&share, (right, y), SMALL, Align::Right, DARK)?;
    }
    Ok(())
}

fn draw_bar(canvas: &Canvas<'_>, bar: &Bar, (left, top): (f64, f64), total: usize) -> Result<(), DrawError> {
    canvas.text(bar.label, (left, top + 12.0), SMALL, Align::Left, DARK)?;
    let top = top + BAR_HEAD;
    let rect = Rect { left, top, right: left + BAR_WIDTH, bottom: top + BAR_HEIGHT };
    canvas.raster(rect, [1, bar.colors.len()], |[_, row]| bar.colors[row])?;
    canvas.outline(rect, 1.0)?;
    let frame = Frame { rect, x: Axis::exact("", 0.0, 1.0), y: Axis::exact("", bar.low, bar.high) };
    frame.draw_scale(canvas)?;
    // What lies beyond an end has its colour.
    let [below, above] = bar.beyond;
    let arrows =
        [(below, bar.colors.first(), rect.bottom, ARROW), (above, bar.colors.last(), rect.top, -ARROW)];
    for (cells, color, end, length) in arrows {
        if let (Some(&color), true) = (color, cells > 0) {
            let corners = [(left, end), (left + BAR_WIDTH / 2.0, end + length), (rect.right, end)];
            canvas.polygon(&corners, rgb(color))?;
            canvas.stroke(&corners, 1.0, DARK)?;
        }
    }
    for (row, text) in bar.left_out(total).iter().enumerate() {
        let y = rect.bottom + ARROW + ROW * (row as f64 + 0.5);
        canvas.text(text, (left, y), SMALL, Align::Left, DARK)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::Plan;
    use crate::map::scene::Purpose;
    use crate::record::Record;
    use crate::show::layers::Entry;

    const LOW: [u8; 3] = [1, 2, 3];
    const HIGH: [u8; 3] = [4, 5, 6];

    const TEXT: &str = "[parameters]\nk = 900.0\n[[axis]]\nparameter = 'e'\nmin = 0.0\nmax = 1.0\ncount = 8\n\
                        [[axis]]\nparameter = 'omega'\nmin = 1.0\nmax = 12.0\ncount = 600\n";
    const CELLS: usize = 8 * 600;

    /// Draws a layer to `name` in a folder of its own; the file's bytes.
    fn drawn(name: &str, layer: &Layer) -> Vec<u8> {
        let scene = Scene::parse(TEXT, "s", &[], Purpose::Map).unwrap();
        let plan = Plan::new(&scene);
        let records = vec![Record::default(); plan.run_count()];
        let cells = Cells::new(&scene, &plan, &records);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        write(&path, &cells, layer).unwrap();
        std::fs::read(path).unwrap()
    }

    fn layer(entries: usize, beyond: [usize; 2]) -> Layer {
        let entry = |n: usize| Entry { color: [200; 3], text: format!("period {n}"), cells: 1 };
        let colors = vec![LOW, [120; 3], HIGH];
        Layer {
            name: "map",
            short: "map",
            title: "a map",
            // One cell in seven.
            indices: (0..CELLS).map(|id| u8::from(id % 7 == 3)).collect(),
            palette: vec![[255, 254, 250], [9, 99, 199]],
            entries: (0..entries).map(entry).collect(),
            bar: Some(Bar { label: "exponent", colors, low: -0.4, high: 1.0, beyond }),
        }
    }

    fn count(png: &[u8], color: [u8; 3]) -> f64 {
        let picture = image::load_from_memory(png).unwrap().to_rgb8();
        picture.pixels().filter(|pixel| pixel.0 == color).count() as f64
    }

    /// Of a map that is lower than its legend, the whole bar is in the picture.
    #[test]
    fn long_legends_make_room_for_themselves() {
        for entries in [0, 1, 21, 60] {
            let picture = drawn("map.png", &layer(entries, [0, 0]));
            // Each of three colours has a third of the bar, less the outline.
            let least = (BAR_WIDTH - 4.0) * (BAR_HEIGHT / 3.0 - 4.0);
            for color in [LOW, HIGH] {
                assert!(count(&picture, color) > least, "{entries} entries: {}", count(&picture, color));
            }
        }
    }

    #[test]
    fn a_bar_says_what_lies_beyond_its_ends() {
        let [plain, clipped] = [[0, 0], [3, 600]].map(|beyond| drawn("map.png", &layer(60, beyond)));
        let arrow = 0.5 * BAR_WIDTH * ARROW;
        for color in [LOW, HIGH] {
            let more = count(&clipped, color) - count(&plain, color);
            assert!(more > 0.6 * arrow && more < 1.1 * arrow, "{more} of {arrow}");
        }
        let svg = String::from_utf8(drawn("map.svg", &layer(2, [3, 600]))).unwrap();
        assert!(
            svg.contains(">values above 1: 12.5 %<") && svg.contains(">values below \u{2212}0.4: 3 cells<")
        );
        assert!(!String::from_utf8(drawn("map.svg", &layer(2, [0, 0]))).unwrap().contains("values "));
    }

    /// One pixel per cell, and text as text with the symbols of the field.
    #[test]
    fn a_map_in_svg_has_its_cells_as_pixels_and_its_words_as_text() {
        use base64::Engine;
        let layer = layer(1, [0, 0]);
        let svg = String::from_utf8(drawn("map.svg", &layer)).unwrap();
        let data = svg.split("base64,").nth(1).unwrap().split('"').next().unwrap();
        let png = base64::engine::general_purpose::STANDARD.decode(data).unwrap();
        let picture = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (8, 600));
        for (id, index) in layer.indices.iter().enumerate() {
            let pixel = picture.get_pixel(id as u32 % 8, 599 - id as u32 / 8);
            assert_eq!(pixel.0, layer.palette[usize::from(*index)], "cell {id}");
        }
        for text in [
            "coefficient of restitution, e",
            "excitation frequency, \u{3c9}",
            "k = 900; all other parameters at their defaults",
        ] {
            assert!(svg.contains(&format!(">{text}</text>")), "{text}");
        }
        assert!(!svg.contains("omega") && svg.matches("<text").count() > 15);
        assert_eq!(svg.matches("image-rendering:pixelated").count(), 2);
        assert_eq!(drawn("map.pdf", &layer), drawn("map.pdf", &layer), "the same bytes again");
    }
}
