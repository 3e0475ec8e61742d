//! A layer of a map as a picture: cells, lines, attractors, legend, colour bar.

use std::cmp::Reverse;
use std::f64::consts::PI;

use crate::map::curves::{Curve, CurvePoint, Curves, Kind};
use crate::map::scene::{Axis, Target, place};
use crate::show::caption;
use crate::show::cells::Cells;
use crate::show::drawing::frame::Frame;
use crate::show::drawing::legend::Key;
use crate::show::drawing::{Align, Canvas, Color, DARK, Marker, Point, Rect, SMALL, WHITE, wall_color};
use crate::show::figure::map_layout::{LegendKey, LegendRow, MapFigure};
use crate::show::figure::map_lines;
use crate::show::layers::colors::{FAILED, HATCH, QUASI_PERIODIC, UNDECIDED};
use crate::show::layers::{CLASS, Layer, NamedColor, share};
use crate::show::symbols::number;
use rattlemap_dynamics::model::{Side, State};

/// Width of the legend, and least height of map and legend.
const LEGEND: (f64, f64) = (460.0, 700.0);
/// Most rows of colours, and most stripes of a row of several.
const ROWS: usize = 10;
const STRIPES: usize = 5;
/// Colours of lines, repeated for more lines; width of a line and of its white rim.
const LINE_COLORS: [fn() -> Color; 3] = [|| DARK, || wall_color(Side::Right), || wall_color(Side::Left)];
const LINE: f64 = 3.0;
const RIM: f64 = 7.0;
/// Width of a bifurcation curve and of its rim.
const CURVE: f64 = 2.0;
const CURVE_RIM: f64 = 3.5;
/// Marker of a strobe state of an attractor.
const ATTRACTOR: Marker = Marker { hollow: true, ..Marker::dot(DARK, 8.0) };
/// Largest distance of an attractor from the plane of the starts, relative to its size.
const IN_PLANE: f64 = 1e-9;

/// Draws one of the layers of a map.
pub fn draw(cells: &Cells<'_>, layers: &[Layer], layer: &Layer) -> Canvas {
    draw_with(cells, layers, layer, None)
}

/// Draws one of the layers of a map, with its bifurcation curves.
pub fn draw_with(cells: &Cells<'_>, layers: &[Layer], layer: &Layer, curves: Option<&Curves>) -> Canvas {
    let scene = cells.scene();
    let subtitle = format!("{}; {}\n{}", layer.title, caption::integration(scene), caption::of_scene(scene));
    let mut rows = rows(layer, cells.count());
    let color = |nth: usize| LINE_COLORS[nth % LINE_COLORS.len()]();
    rows.extend(
        scene
            .lines()
            .iter()
            .enumerate()
            .map(|(nth, line)| LegendRow::drawn(Key::Line { color: color(nth), width: LINE }, &line.name)),
    );
    let contours = contours(cells, layers, layer);
    for (nth, contour) in contours.iter().enumerate() {
        let key = Key::Line { color: color(scene.lines().len() + nth), width: LINE };
        let values: Vec<String> = contour.lines.iter().map(|(value, _)| number(*value)).collect();
        rows.push(LegendRow::drawn(key, &format!("{}: {}", contour.name, values.join(", "))));
    }
    for (kind, _) in curves_by_kind(curves) {
        let key = Key::Line { color: curve_color(kind), width: CURVE };
        rows.push(LegendRow::drawn(key, &kind.name().replace('_', " ")));
    }
    let attractors = attractors(cells);
    if !attractors.is_empty() {
        rows.push(LegendRow::drawn(Key::Marker(ATTRACTOR), "attractor, at phase 0"));
    }
    let figure = MapFigure {
        cells,
        title: scene.title(),
        subtitle: &subtitle,
        rows,
        bar: layer.bar.as_ref(),
        legend: LEGEND,
    };
    figure.draw(
        scene.figure_style(),
        |id| {
            let color = layer.palette[usize::from(layer.indices[id])];
            let columns = cells.counts()[0];
            let is_hatched = color == UNDECIDED && (id % columns + id / columns).is_multiple_of(4);
            if is_hatched { HATCH } else { color }
        },
        |canvas, frame| {
            for (nth, line) in scene.lines().iter().enumerate() {
                let zeros = map_lines::zeros([&frame.x, &frame.y], line.function(scene.points()));
                let at = |part: &Vec<Point>| part.iter().map(|(x, y)| frame.at(*x, *y)).collect();
                draw_line(canvas, &zeros.iter().map(at).collect::<Vec<_>>(), color(nth));
            }
            draw_contours(canvas, cells.counts(), frame.rect, &contours, |nth| {
                color(scene.lines().len() + nth)
            });
            for (kind, curves) in curves_by_kind(curves) {
                for curve in curves {
                    draw_curve(canvas, frame, curve, curve_color(kind));
                }
            }
            attractors.iter().for_each(|(x, y)| canvas.marker(frame.at(*x, *y), ATTRACTOR));
        },
    )
}

/// Returns the rows of the colours of a layer. Rare periods share a row, and so do the smallest entries beyond [`ROWS`].
fn rows(layer: &Layer, total: usize) -> Vec<LegendRow> {
    let is_alone = |entry: &NamedColor| [UNDECIDED, FAILED, QUASI_PERIODIC].contains(&entry.color);
    let is_rare = |entry: &NamedColor| entry.text.starts_with("period") && entry.cells * 1000 < total;
    let mut entries: Vec<&NamedColor> = layer.entries.iter().collect();
    entries.sort_by_key(|entry| (!is_alone(entry), is_rare(entry), Reverse(entry.cells)));
    let frequent = entries.iter().filter(|entry| is_alone(entry) || !is_rare(entry)).count();
    let is_short = entries.len() <= ROWS && entries.len() <= frequent + 1;
    let (kept, merged) = entries.split_at(if is_short { entries.len() } else { frequent.min(ROWS - 1) });
    let row = |entry: &NamedColor| {
        let row = LegendRow::of_color(entry.color, &entry.text, share(entry.cells, total));
        let is_hatched = entry.color == UNDECIDED;
        if is_hatched { LegendRow { key: LegendKey::Stripes(vec![UNDECIDED, HATCH]), ..row } } else { row }
    };
    let kept = layer.entries.iter().filter(|entry| kept.iter().any(|kept| std::ptr::eq(*kept, *entry)));
    let mut rows: Vec<LegendRow> = kept.map(row).collect();
    if let Some(first) = merged.first() {
        let cells = merged.iter().map(|entry| entry.cells).sum();
        let row = LegendRow::of_color(first.color, "others, a colour each", share(cells, total));
        let colors = merged.iter().take(STRIPES).map(|entry| entry.color).collect();
        rows.push(LegendRow { key: LegendKey::Stripes(colors), ..row });
    }
    rows
}

/// Draws a line with a white rim, which separates it from cells of its own colour.
fn draw_line(canvas: &Canvas, parts: &[Vec<Point>], color: Color) {
    for (width, color) in [(RIM, WHITE), (LINE, color)] {
        parts.iter().for_each(|part| canvas.stroke(part, width, color));
    }
}

/// Returns the curves of each kind that there is.
fn curves_by_kind(curves: Option<&Curves>) -> Vec<(Kind, Vec<&Curve>)> {
    let all = || curves.iter().flat_map(|found| &found.curves);
    let of = |kind: Kind| (kind, all().filter(|curve| curve.kind == kind).collect::<Vec<_>>());
    Kind::ALL.map(of).into_iter().filter(|(_, curves)| !curves.is_empty()).collect()
}

/// Returns the colour of curves of a kind.
pub fn curve_color(kind: Kind) -> Color {
    match kind {
        Kind::Fold => [0xd5, 0x1f, 0x1f],
        Kind::Flip => [0x10, 0x6b, 0x2c],
        Kind::Pitchfork => [0x7a, 0x1f, 0xa2],
        Kind::Grazing => [0xf2, 0x8e, 0x00],
        Kind::MeshingGrazing => [0xb1, 0x7a, 0x00],
        Kind::MeshingBorder => [0x00, 0x8c, 0x95],
        Kind::ContactEnd => DARK,
        Kind::Sticking => [0x8a, 0x4b, 0x2a],
        Kind::Condition => [0x1f, 0x4f, 0xd1],
    }
}

/// Draws a curve with a white rim. Parts of unstable cycles are dashed.
fn draw_curve(canvas: &Canvas, frame: &Frame, curve: &Curve, color: Color) {
    let path = |points: &[CurvePoint]| -> Vec<Point> {
        let ways = points.windows(2).flat_map(|pair| pair[0].way_to(&pair[1]));
        points
            .first()
            .map(|point| point.values)
            .into_iter()
            .chain(ways)
            .map(|[x, y]| frame.at(x, y))
            .collect()
    };
    canvas.stroke(&path(&curve.points), CURVE_RIM, WHITE);
    let mut start = 0;
    for part in curve.points.chunk_by(|a, b| a.stable == b.stable) {
        let end = start + part.len();
        let path = path(&curve.points[start.max(1) - 1..end]);
        match part[0].stable {
            true => canvas.stroke(&path, CURVE, color),
            false => canvas.dashes(&path, CURVE, color),
        }
        start = end;
    }
}

/// Contours of a quantity.
struct Contours<'a> {
    name: &'a str,
    /// Values and their lines, in columns and rows of cells.
    lines: Vec<(f64, Vec<Vec<Point>>)>,
}

/// Returns the contours that a layer shows: its own, or all of them if its colours are classes.
fn contours<'a>(cells: &Cells<'_>, layers: &'a [Layer], layer: &Layer) -> Vec<Contours<'a>> {
    let scene = cells.scene();
    let is_shown = |name: &str| layer.name == name || ["map", CLASS].contains(&&*layer.name);
    let of = |(name, values): &(String, Vec<f64>)| {
        let source = layers.iter().find(|layer| layer.name == *name && is_shown(name))?;
        let (numbers, bar) = (source.numbers.as_ref()?, source.bar.as_ref()?);
        let jump = if bar.is_angle() { PI } else { f64::INFINITY };
        let at = |value: f64| place(scene.layer_scale(name).0, value);
        let line = |&value: &f64| (value, map_lines::contours(cells.counts(), numbers, at(value), jump));
        Some(Contours { name: &source.short, lines: values.iter().map(line).collect() })
    };
    scene.contours().iter().filter_map(of).collect()
}

/// Draws contours, and each value at its longest line on which no other value stands.
fn draw_contours(
    canvas: &Canvas,
    counts: [usize; 2],
    map: Rect,
    contours: &[Contours<'_>],
    color: impl Fn(usize) -> Color,
) {
    let unit = [(map.right - map.left) / counts[0] as f64, (map.bottom - map.top) / counts[1] as f64];
    let at = |&(x, y): &Point| (map.left + (x + 0.5) * unit[0], map.bottom - (y + 0.5) * unit[1]);
    let mut texts: Vec<(Rect, String)> = Vec::new();
    for (nth, (value, parts)) in
        contours.iter().enumerate().flat_map(|(nth, of)| of.lines.iter().map(move |line| (nth, line)))
    {
        let mut parts: Vec<Vec<Point>> = parts.iter().map(|part| part.iter().map(at).collect()).collect();
        draw_line(canvas, &parts, color(nth));
        parts.sort_by_key(|part| Reverse(part.len()));
        let text = number(*value);
        let half = (0.5 * canvas.text_width(&text, SMALL) + 4.0, 14.0);
        let around = |&(x, y): &Point| {
            let x = x.clamp(map.left + half.0, map.right - half.0);
            Rect::around((x, y.clamp(map.top + half.1, map.bottom - half.1)), half)
        };
        let is_free = |place: &Rect| {
            let apart = |[a, b]: [f64; 2], [c, d]: [f64; 2]| b <= c || d <= a;
            texts.iter().all(|(other, _)| {
                apart([place.left, place.right], [other.left, other.right])
                    || apart([place.top, place.bottom], [other.top, other.bottom])
            })
        };
        let from_middle = |part: &Vec<Point>| {
            let (before, after) = part.split_at(part.len() / 2);
            after.iter().chain(before.iter().rev()).map(around).find(is_free)
        };
        let place = parts.iter().find_map(from_middle);
        texts.extend(place.map(|place| (place, text)));
    }
    for (place, text) in texts {
        canvas.fill(place, WHITE, 0.85);
        let middle = (0.5 * (place.left + place.right), 0.5 * (place.top + place.bottom));
        canvas.text(&text, middle, SMALL, Align::Center, DARK);
    }
}

/// Returns the strobe states of all attractors that lie on a map whose axes are both components of the start.
pub(crate) fn attractors(cells: &Cells<'_>) -> Vec<Point> {
    let targets: Vec<Target> = cells.scene().axes().iter().map(|axis| axis.target()).collect();
    let (Some(basins), &[Target::Start(x), Target::Start(y)]) = (cells.basins(), &targets[..]) else {
        return Vec::new();
    };
    let plane = cells.start(0);
    let lies_in_plane = |state: &&State| {
        let size = state.iter().map(|component| component.abs()).fold(0.0, f64::max);
        let is_near = |i: usize| (state[i] - plane[i]).abs() <= IN_PLANE * size;
        (0..state.len()).filter(|i| ![x, y].contains(i)).all(is_near)
    };
    let is_on_axis =
        |axis: &Axis, value: f64| (axis.value(0)..=axis.value(axis.values().len() - 1)).contains(&value);
    let [horizontal, vertical] = [0, 1].map(|i| &cells.scene().axes()[i]);
    basins
        .strobes()
        .filter(lies_in_plane)
        .map(|state| (state[x], state[y]))
        .filter(|&(x, y)| is_on_axis(horizontal, x) && is_on_axis(vertical, y))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::Plan;
    use crate::map::scene::{Format, Purpose, Scene};
    use crate::record::Record;
    use crate::show::drawing::write_figure;
    use crate::show::figure::map_layout::{ARROW, BAR_HEIGHT, BAR_WIDTH};
    use crate::show::layers::Bar;

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
        write_figure(&mut bytes, format, &draw(&cells, &[], layer)).unwrap();
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
            numbers: None,
            entries: (0..entries).map(entry).collect(),
            bar: Some(Bar {
                label: "exponent".into(),
                colors,
                low: -0.4,
                high: 1.0,
                is_fixed: false,
                beyond,
            }),
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
    fn a_legend_has_at_most_ten_rows_with_all_cells() {
        let mut layer = layer(30, [0, 0]);
        layer.entries[29] = NamedColor { color: UNDECIDED, text: "undecided".into(), cells: 1 };
        layer.entries.iter_mut().take(12).for_each(|entry| entry.cells = 300);
        let found: Vec<String> =
            rows(&layer, CELLS).into_iter().map(|row| row.text + " " + &row.cells).collect();
        assert_eq!(found.len(), ROWS);
        assert_eq!(found[8..], ["undecided 1 cell", "others, a colour each 25.4 %"]);
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
