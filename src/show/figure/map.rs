//! A layer of a map as a picture: cells, axes, legend, colour bar. Lengths are in pixels.

use std::io::Write;

use crate::map::scene::Format;
use crate::show::caption;
use crate::show::cells::Cells;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::Frame;
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Align, Canvas, DARK, Rect, SMALL, write_figure};
use crate::show::error::WriteError;
use crate::show::figure::map_layout::{MapLayout, ROW};
use crate::show::layers::{Bar, Layer, share};

/// Width of the legend.
const LEGEND_WIDTH: f64 = 460.0;
/// Least height of map and legend.
const LEAST_HEIGHT: f64 = 700.0;
/// Size of the colour bar.
const BAR_WIDTH: f64 = 34.0;
const BAR_HEIGHT: f64 = 260.0;
/// Length of the arrow at an end of the bar beyond which there are values.
const ARROW: f64 = 18.0;
/// Room for the bar's name, and between it and the entries above.
const BAR_HEAD: f64 = 50.0;
const ABOVE_BAR: f64 = 26.0;

/// Draws a layer and writes it.
pub fn write(out: impl Write, format: Format, cells: &Cells<'_>, layer: &Layer) -> Result<(), WriteError> {
    let layout = MapLayout::new(cells, LEGEND_WIDTH, legend_height(layer).max(LEAST_HEIGHT));
    write_figure(out, format, layout.size, |canvas| draw(canvas, cells, layer, &layout))
}

/// Returns the height of the legend: entries, then the bar.
fn legend_height(layer: &Layer) -> f64 {
    let entries = ROW * layer.entries.len() as f64;
    let below = |bar: &Bar| match bar.remarks(1).len() {
        0 => 0.0,
        lines => ARROW + ROW * lines as f64,
    };
    layer.bar.as_ref().map_or(entries, |bar| bar_top(layer) + BAR_HEAD + BAR_HEIGHT + below(bar))
}

/// Returns the distance of the bar from the top of the legend.
fn bar_top(layer: &Layer) -> f64 {
    let entries = ROW * layer.entries.len() as f64;
    if layer.entries.is_empty() { 0.0 } else { entries + ABOVE_BAR }
}

fn draw(canvas: &Canvas, cells: &Cells<'_>, layer: &Layer, layout: &MapLayout) {
    let scene = cells.scene();
    let subtitle = format!("{}; {}\n{}", layer.title, caption::integration(scene), caption::of_scene(scene));
    draw_head(canvas, scene.title(), &subtitle, &[]);
    layout.draw_map(canvas, cells, |id| layer.palette[usize::from(layer.indices[id])]);
    for (row, entry) in layer.entries.iter().enumerate() {
        let share = share(entry.cells, cells.count());
        let text = canvas.fitted(&entry.text, SMALL, layout.text_room(canvas, &share));
        let y = layout.top + ROW * (row as f64 + 0.5);
        layout.draw_entry(canvas, y, entry.color, &text, &share);
    }
    if let Some(bar) = &layer.bar {
        draw_bar(canvas, bar, (layout.left, layout.top + bar_top(layer)), cells.count());
    }
}

fn draw_bar(canvas: &Canvas, bar: &Bar, (left, top): (f64, f64), total: usize) {
    canvas.text(&bar.label, (left, top + 12.0), SMALL, Align::Left, DARK);
    let top = top + BAR_HEAD;
    let rect = Rect { left, top, right: left + BAR_WIDTH, bottom: top + BAR_HEIGHT };
    canvas.raster(rect, [1, bar.colors.len()], |[_, row]| bar.colors[row]);
    canvas.outline(rect, 1.0);
    let frame = Frame { rect, x: Axis::exact("", 0.0, 1.0), y: Axis::exact("", bar.low, bar.high) };
    frame.draw_scale(canvas);
    let [below, above] = bar.beyond;
    let arrows =
        [(below, bar.colors.first(), rect.bottom, ARROW), (above, bar.colors.last(), rect.top, -ARROW)];
    for (cells, color, end, length) in arrows {
        if let (Some(&color), true) = (color, cells > 0) {
            let corners = [(left, end), (left + BAR_WIDTH / 2.0, end + length), (rect.right, end)];
            canvas.polygon(&corners, color);
            canvas.stroke(&corners, 1.0, DARK);
        }
    }
    for (row, text) in bar.remarks(total).iter().enumerate() {
        let y = rect.bottom + ARROW + ROW * (row as f64 + 0.5);
        canvas.text(text, (left, y), SMALL, Align::Left, DARK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::Plan;
    use crate::map::scene::{Purpose, Scene};
    use crate::record::Record;
    use crate::show::layers::NamedColor;

    const LOW: [u8; 3] = [1, 2, 3];
    const HIGH: [u8; 3] = [4, 5, 6];

    const TEXT: &str = "[parameters]\nk = 900.0\n[[axis]]\nparameter = 'e'\nmin = 0.0\nmax = 1.0\ncount = 8\n\
                        [[axis]]\nparameter = 'omega'\nmin = 1.0\nmax = 12.0\ncount = 600\n";
    const CELLS: usize = 8 * 600;

    /// Returns the bytes of a figure.
    fn figure(format: Format, layer: &Layer) -> Vec<u8> {
        let scene = Scene::parse(TEXT, "s", &[], Purpose::Map).unwrap();
        let plan = Plan::new(&scene);
        let records = vec![Record::default(); plan.run_count()];
        let cells = Cells::new(&scene, &plan, &records);
        let mut bytes = Vec::new();
        write(&mut bytes, format, &cells, layer).unwrap();
        bytes
    }

    fn layer(entries: usize, beyond: [usize; 2]) -> Layer {
        let entry = |n: usize| NamedColor { color: [200; 3], text: format!("period {n}"), cells: 1 };
        let colors = vec![LOW, [120; 3], HIGH];
        Layer {
            name: "map".into(),
            short: "map".into(),
            title: "a map".into(),
            indices: (0..CELLS).map(|id| u8::from(id % 7 == 3)).collect(),
            palette: vec![[255, 254, 250], [9, 99, 199]],
            entries: (0..entries).map(entry).collect(),
            bar: Some(Bar { label: "exponent".into(), colors, low: -0.4, high: 1.0, beyond }),
        }
    }

    fn count(png: &[u8], color: [u8; 3]) -> f64 {
        let picture = image::load_from_memory(png).unwrap().to_rgb8();
        picture.pixels().filter(|pixel| pixel.0 == color).count() as f64
    }

    #[test]
    fn a_figure_is_as_high_as_its_legend() {
        for entries in [0, 1, 21, 60] {
            let picture = figure(Format::Png, &layer(entries, [0, 0]));
            // Each of the three colours fills a third of the bar, except for the outline.
            let least = (BAR_WIDTH - 4.0) * (BAR_HEIGHT / 3.0 - 4.0);
            for color in [LOW, HIGH] {
                assert!(count(&picture, color) > least, "{entries} entries: {}", count(&picture, color));
            }
        }
    }

    #[test]
    fn values_beyond_the_ends_of_a_bar_have_an_arrow_and_a_remark() {
        let [plain, clipped] = [[0, 0], [3, 600]].map(|beyond| figure(Format::Png, &layer(60, beyond)));
        let arrow = 0.5 * BAR_WIDTH * ARROW;
        for color in [LOW, HIGH] {
            let more = count(&clipped, color) - count(&plain, color);
            assert!(more > 0.6 * arrow && more < 1.1 * arrow, "{more} of {arrow}");
        }
        let svg = String::from_utf8(figure(Format::Svg, &layer(2, [3, 600]))).unwrap();
        assert!(
            svg.contains(">values above 1: 12.5 %<") && svg.contains(">values below \u{2212}0.4: 3 cells<")
        );
        assert!(!String::from_utf8(figure(Format::Svg, &layer(2, [0, 0]))).unwrap().contains("values "));
    }

    #[test]
    fn a_map_in_svg_has_one_pixel_per_cell_and_texts_with_mathematical_symbols() {
        use base64::Engine;
        let layer = layer(1, [0, 0]);
        let svg = String::from_utf8(figure(Format::Svg, &layer)).unwrap();
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
        assert_eq!(figure(Format::Pdf, &layer), figure(Format::Pdf, &layer), "the same bytes again");
    }
}
