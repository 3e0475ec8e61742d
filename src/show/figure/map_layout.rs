//! Figures of maps and of comparisons: a map with axes, and a legend at its right, or below it in a narrow figure.

use crate::map::scene::{self, FigureStyle, Scale};
use crate::show::cells::Cells;
use crate::show::color::Color;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, below, left_margin, right_margin, x_name_of};
use crate::show::drawing::legend::{KEY, Key, draw_head, draw_key};
use crate::show::drawing::{Align, Canvas, DARK, Point, Rect, SMALL};
use crate::show::layers::Bar;
use crate::show::symbols::axis_label;

/// Least position of the map in a figure of default size.
const MAP_LEFT: f64 = 140.0;
const MAP_TOP: f64 = 162.0;
/// Distance from the head to the map.
const BELOW_HEAD: f64 = 4.0;
/// Distance from the map to the legend, from the legend to the right edge, and of a legend below the map from all edges.
const LEGEND_GAP: f64 = 36.0;
const LEGEND_MARGIN: f64 = 20.0;
const EDGE: f64 = 10.0;
/// A narrower map has its legend below it.
const LEAST_MAP: f64 = 560.0;
/// A side of up to `SIDE` cells has as many whole pixels per cell as fit into `SIDE` pixels. A longer one has one pixel per cell,
/// and beyond `LONGEST_SIDE` cells are skipped.
const SIDE: usize = 1024;
const LONGEST_SIDE: usize = 2048;

/// Height of a row of the legend.
const ROW: f64 = 33.0;
/// Width and height of a colour patch, and its distance from the text.
const PATCH: (f64, f64) = (34.0, 20.0);
const AFTER_PATCH: f64 = 14.0;
/// Least distances from a text to the number of its cells, and between two columns.
const BEFORE_CELLS: f64 = 16.0;
const BETWEEN_COLUMNS: f64 = 24.0;
/// Largest number of columns of a legend below a map.
const MOST_COLUMNS: usize = 4;

/// Size of an upright colour bar, and height of a horizontal one.
pub(crate) const BAR_WIDTH: f64 = 34.0;
pub(crate) const BAR_HEIGHT: f64 = 260.0;
const FLAT_HEIGHT: f64 = 24.0;
/// Length of the arrow at an end of the bar beyond which there are values.
pub(crate) const ARROW: f64 = 18.0;
/// Room for the bar's name, between it and the entries above, and for the labels of a horizontal bar.
const BAR_HEAD: f64 = 50.0;
const ABOVE_BAR: f64 = 26.0;
const FLAT_LABELS: f64 = 46.0;

/// The symbol of a row.
pub(crate) enum LegendKey {
    /// A colour of cells.
    Patch(Color),
    /// Several colours of cells.
    Stripes(Vec<Color>),
    /// A line or marker on the map.
    Drawn(Key),
    /// None: a heading.
    Heading,
}

/// A row of the legend.
pub(crate) struct LegendRow {
    pub(crate) key: LegendKey,
    pub(crate) text: String,
    /// Number or share of the cells.
    pub(crate) cells: String,
    /// Whether half a row is free above it.
    pub(crate) is_apart: bool,
}

/// A figure of a map.
pub(crate) struct MapFigure<'a> {
    pub(crate) cells: &'a Cells<'a>,
    pub(crate) title: &'a str,
    pub(crate) subtitle: &'a str,
    pub(crate) rows: Vec<LegendRow>,
    pub(crate) bar: Option<&'a Bar>,
    /// Width of a legend at the right of the map, and least height of map and legend in a figure of default size.
    pub(crate) legend: (f64, f64),
}

impl MapFigure<'_> {
    /// Draws the figure, given the colour of each cell by id. `overlay` draws what lies above the cells.
    pub(crate) fn draw(
        &self,
        style: &FigureStyle,
        color: impl Fn(usize) -> Color,
        overlay: impl FnOnce(&Canvas, &Frame),
    ) -> Canvas {
        let [columns, rows] = self.cells.counts();
        let [x, y] = [0, 1].map(|i| axis(&self.cells.scene().axes()[i]));
        let sides = [columns, rows].map(side);
        let has_legend = style.legend && !(self.rows.is_empty() && self.bar.is_none());
        let canvas = Canvas::new(style, 0.0);
        let left_of = |height: f64| left_margin(&canvas, MAP_LEFT, &[(&y, height)]);
        let beside = match has_legend {
            true => self.width(&canvas),
            false => right_margin(&canvas, &x, sides[0]) - LEGEND_GAP,
        };
        canvas.set_width(left_of(sides[1]) + sides[0] + LEGEND_GAP + beside);
        let width = canvas.size().0;
        let is_below = has_legend
            && !canvas.is_default()
            && width - left_of(LEAST_MAP) - LEGEND_GAP - beside < LEAST_MAP;
        let head = draw_head(&canvas, self.title, self.subtitle, &[]);
        let is_usual = canvas.is_default() && canvas.has_heading();
        let top = if is_usual { (head + BELOW_HEAD).max(MAP_TOP) } else { head + 2.0 * BELOW_HEAD };
        let right = match is_below || !has_legend {
            true => {
                let length = width - left_of(LEAST_MAP);
                let bar = self.bar.map(|bar| right_margin(&canvas, &bar.axis(), length));
                width - right_margin(&canvas, &x, length).max(bar.unwrap_or(0.0))
            }
            false => width - beside - LEGEND_GAP,
        };
        let height = |left: f64| match canvas.is_default() {
            true => sides[1],
            false => (right - left) * sides[1] / sides[0],
        };
        // The ticks of the vertical axis depend on its height, and the height on the room for their labels.
        let left = left_of(height(left_of(LEAST_MAP)));
        let map = Rect { left, top, right, bottom: top + height(left) };
        let end = map.bottom + below(&canvas, &x, [left, right]);
        canvas.set_height(match (is_below, canvas.is_default()) {
            (true, _) => self.draw_below(&canvas, map, end),
            (false, true) => end.max(top + self.height().max(self.legend.1) + end - map.bottom),
            (false, false) if has_legend => end.max(top + self.height() + EDGE),
            (false, false) => end,
        });
        let frame = Frame { rect: map, x, y };
        canvas.raster(map, [columns, rows], |[i, j]| color(j * columns + i));
        overlay(&canvas, &frame);
        frame.draw_axes(&canvas, true);
        if has_legend && !is_below {
            let margin = if canvas.is_default() { LEGEND_GAP + LEGEND_MARGIN } else { EDGE };
            let place = Rect { left: right + LEGEND_GAP, right: width - margin, ..map };
            let top = self.draw_rows(&canvas, place, &self.rows);
            let above = if self.rows.is_empty() { 0.0 } else { ABOVE_BAR };
            self.draw_bar(&canvas, (place.left, top + above));
        }
        canvas
    }

    /// Returns the width of the legend at the right and of the margin right of it.
    fn width(&self, canvas: &Canvas) -> f64 {
        if canvas.is_default() {
            return self.legend.0;
        }
        let rows = self.rows.iter().map(|row| row.width(canvas));
        let of_bar = |bar: &Bar| {
            let texts =
                [vec![upright(bar, (0.0, 0.0)).scale_name()], bar.remarks(self.cells.count())].concat();
            texts.iter().map(|text| canvas.text_width(text, SMALL)).fold(0.0, f64::max)
        };
        rows.chain(self.bar.map(of_bar)).fold(0.0, f64::max) + EDGE
    }

    /// Returns the height of the legend at the right: rows, then the bar.
    fn height(&self) -> f64 {
        let rows: f64 = self.rows.iter().map(LegendRow::height).sum();
        let below = |bar: &Bar| match bar.remarks(1).len() {
            0 => 0.0,
            lines => ARROW + ROW * lines as f64,
        };
        let above = if self.rows.is_empty() { 0.0 } else { ABOVE_BAR };
        rows + self.bar.map_or(0.0, |bar| above + BAR_HEAD + BAR_HEIGHT + below(bar))
    }

    /// Draws rows from the top of a rectangle, and returns the y coordinate below them.
    fn draw_rows(&self, canvas: &Canvas, place: Rect, rows: &[LegendRow]) -> f64 {
        let mut y = place.top;
        for row in rows {
            y += row.height();
            row.draw(canvas, place, y - ROW / 2.0);
        }
        y
    }

    /// Draws the legend below the map, then the bar. Returns the y coordinate below it.
    ///
    /// The first rows may have columns of their own, so that long names do not take the columns from the short ones below them.
    fn draw_below(&self, canvas: &Canvas, map: Rect, top: f64) -> f64 {
        let columns = |first: usize| {
            let (head, rest) = self.rows.split_at(first);
            [head, rest].map(|rows| Columns::fitting(canvas, rows))
        };
        let height = |first: &usize| {
            let lines: usize = columns(*first).iter().map(Columns::lines).sum();
            lines + usize::from(*first > 0)
        };
        let has_sections = self.rows.iter().any(|row| row.is_apart);
        let splits = if has_sections { 1 } else { self.rows.len() };
        let first = (0..splits).min_by_key(height).unwrap_or(0);
        let blocks = columns(first);
        let width = blocks.iter().map(Columns::width).fold(0.0, f64::max);
        let room = canvas.size().0 - 2.0 * EDGE;
        let start = map.left.min(EDGE + (room - width) / 2.0);
        let bottom = blocks.iter().fold(top, |top, columns| {
            let (mut left, mut bottom) = (start, top);
            for (rows, width) in &columns.0 {
                let place = Rect { left, top, right: left + width, ..map };
                bottom = self.draw_rows(canvas, place, rows).max(bottom);
                left += width + BETWEEN_COLUMNS;
            }
            bottom
        });
        self.draw_flat_bar(canvas, map, bottom) + EDGE
    }

    /// Draws the upright bar below a position.
    fn draw_bar(&self, canvas: &Canvas, (left, top): (f64, f64)) {
        let Some(bar) = self.bar else { return };
        let frame = upright(bar, (left, top + BAR_HEAD));
        let rect = frame.rect;
        canvas.raster(rect, [1, bar.colors.len()], |[_, row]| bar.colors[row]);
        canvas.outline(rect, 1.0);
        frame.draw_scale(canvas);
        canvas.text(&frame.scale_name(), (left, top + 12.0), SMALL, Align::Left, DARK);
        let middle = left + BAR_WIDTH / 2.0;
        let [below, above] = [(rect.bottom, ARROW), (rect.top, -ARROW)]
            .map(|(end, length)| [(left, end), (middle, end + length), (rect.right, end)]);
        draw_arrows(canvas, bar, [below, above]);
        for (row, text) in bar.remarks(self.cells.count()).iter().enumerate() {
            let y = rect.bottom + ARROW + ROW * (row as f64 + 0.5);
            canvas.text(text, (left, y), SMALL, Align::Left, DARK);
        }
    }

    /// Draws a horizontal bar below the map. Returns the y coordinate below it.
    fn draw_flat_bar(&self, canvas: &Canvas, map: Rect, top: f64) -> f64 {
        let Some(bar) = self.bar else { return top };
        let inset = if bar.beyond == [0, 0] { 0.0 } else { ARROW };
        let (left, right) = (map.left + inset, map.right - inset);
        let axis = bar.axis();
        let name = canvas.lines(&x_name_of(canvas, &axis, right - left), SMALL, map.right - map.left);
        let mut y = top + 0.8 * ROW;
        for line in &name.lines {
            canvas.text(line, ((left + right) / 2.0, y), name.size, Align::Center, DARK);
            y += name.pitch();
        }
        let rect = Rect { left, right, top: y - 6.0, bottom: y - 6.0 + FLAT_HEIGHT };
        canvas.raster(rect, [bar.colors.len(), 1], |[column, _]| bar.colors[column]);
        canvas.outline(rect, 1.0);
        let axis = Axis { label: String::new(), ..axis };
        Frame { rect, x: axis, y: Axis::exact("", 0.0, 1.0) }.draw_x_axis(canvas, true);
        let middle = (rect.top + rect.bottom) / 2.0;
        let [below, above] = [(left, -ARROW), (right, ARROW)]
            .map(|(end, length)| [(end, rect.top), (end + length, middle), (end, rect.bottom)]);
        draw_arrows(canvas, bar, [below, above]);
        let mut bottom = rect.bottom + FLAT_LABELS;
        for text in bar.remarks(self.cells.count()) {
            canvas.text(&text, (map.left, bottom + ROW / 2.0), SMALL, Align::Left, DARK);
            bottom += ROW;
        }
        bottom
    }
}

/// Columns of a legend: their rows and widths.
struct Columns<'a>(Vec<(&'a [LegendRow], f64)>);

impl<'a> Columns<'a> {
    /// Divides rows among as many columns as fit side by side. Rows with sections stay in one column.
    fn fitting(canvas: &Canvas, rows: &'a [LegendRow]) -> Self {
        let room = canvas.size().0 - 2.0 * EDGE;
        let has_sections = rows.iter().any(|row| row.is_apart);
        let most = if has_sections { 1 } else { rows.len().clamp(1, MOST_COLUMNS) };
        let widest = |rows: &[LegendRow]| rows.iter().map(|row| row.width(canvas)).fold(0.0, f64::max);
        let of = |count: usize| {
            let columns = rows.chunks(rows.len().div_ceil(count).max(1));
            Columns(columns.map(|rows| (rows, widest(rows).min(room))).collect())
        };
        (2..=most).rev().map(of).find(|columns| columns.width() <= room).unwrap_or_else(|| of(1))
    }

    /// Returns the number of rows of the longest column.
    fn lines(&self) -> usize {
        self.0.iter().map(|(rows, _)| rows.len()).max().unwrap_or(0)
    }

    /// Returns the width of all columns.
    fn width(&self) -> f64 {
        self.0.iter().map(|(_, width)| width + BETWEEN_COLUMNS).sum::<f64>() - BETWEEN_COLUMNS
    }
}

/// Returns the frame of an upright bar, given its top left corner.
fn upright(bar: &Bar, (left, top): Point) -> Frame {
    let rect = Rect { left, top, right: left + BAR_WIDTH, bottom: top + BAR_HEIGHT };
    Frame { rect, x: Axis::exact("", 0.0, 1.0), y: bar.axis() }
}

/// Draws an arrow at each end of a bar beyond which there are values, given the corners of both.
fn draw_arrows(canvas: &Canvas, bar: &Bar, corners: [[Point; 3]; 2]) {
    let ends = [bar.colors.first(), bar.colors.last()];
    for ((cells, color), corners) in bar.beyond.into_iter().zip(ends).zip(corners) {
        if let (Some(&color), true) = (color, cells > 0) {
            canvas.polygon(&corners, color);
            canvas.stroke(&corners, 1.0, DARK);
        }
    }
}

impl LegendRow {
    /// Returns the row of a colour.
    pub(crate) fn of_color(color: Color, text: &str, cells: String) -> LegendRow {
        LegendRow { key: LegendKey::Patch(color), text: text.to_owned(), cells, is_apart: false }
    }

    /// Returns the row of a line or marker on the map.
    pub(crate) fn drawn(key: Key, text: &str) -> LegendRow {
        LegendRow { key: LegendKey::Drawn(key), text: text.to_owned(), cells: String::new(), is_apart: false }
    }

    fn height(&self) -> f64 {
        if self.is_apart { 1.5 * ROW } else { ROW }
    }

    /// Returns the distance from the left edge to the text.
    fn text_left(&self) -> f64 {
        if matches!(self.key, LegendKey::Heading) { 0.0 } else { PATCH.0 + AFTER_PATCH }
    }

    /// Returns the width of the room for the number of cells.
    fn cells_room(&self, canvas: &Canvas) -> f64 {
        if self.cells.is_empty() { 0.0 } else { BEFORE_CELLS + canvas.text_width(&self.cells, SMALL) }
    }

    fn width(&self, canvas: &Canvas) -> f64 {
        self.text_left() + canvas.text_width(&self.text, SMALL) + self.cells_room(canvas)
    }

    /// Draws the row within a rectangle; `y` is its middle.
    fn draw(&self, canvas: &Canvas, place: Rect, y: f64) {
        let (left, right) = (place.left, place.left + PATCH.0);
        let patch = Rect { left, top: y - PATCH.1 / 2.0, right, bottom: y + PATCH.1 / 2.0 };
        match &self.key {
            LegendKey::Patch(color) => {
                canvas.fill(patch, *color, 1.0);
                canvas.outline(patch, 1.0);
            }
            LegendKey::Stripes(colors) => {
                let count = if colors.len() < 3 { 4 * colors.len() } else { colors.len() };
                canvas.raster(patch, [count, 1], |[i, _]| colors[i % colors.len()]);
                canvas.outline(patch, 1.0);
            }
            LegendKey::Drawn(key) => draw_key(canvas, *key, (left + (PATCH.0 - KEY) / 2.0, y)),
            LegendKey::Heading => {}
        }
        let text_left = left + self.text_left();
        // Rounding must not cut a text that fits.
        let room = place.right - text_left - self.cells_room(canvas) + 0.1;
        canvas.text(&canvas.fitted(&self.text, SMALL, room), (text_left, y), SMALL, Align::Left, DARK);
        canvas.text(&self.cells, (place.right, y), SMALL, Align::Right, DARK);
    }
}

/// Returns the pixels of a side of `count` cells.
fn side(count: usize) -> f64 {
    let pixels = if count <= SIDE { count * (SIDE / count) } else { count.min(LONGEST_SIDE) };
    pixels as f64
}

/// Returns an axis that extends by half a cell beyond the first and last values.
pub(crate) fn axis(axis: &scene::Axis) -> Axis {
    let (min, max, steps) = (axis.min(), axis.max(), (axis.count() - 1) as f64);
    let label = axis_label(axis.parameter());
    match axis.scale() {
        Scale::Linear => {
            let half = (max - min) / steps / 2.0;
            Axis::exact(&label, min - half, max + half)
        }
        Scale::Log => Axis::logarithmic(&label, [min, max], (max.log10() - min.log10()) / steps / 2.0),
        Scale::Values => Axis::listed(&label, axis.values()),
    }
}
