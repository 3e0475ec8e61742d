//! Layout that figures of maps and of comparisons share: the map on the left, a legend on the right. Lengths are in pixels.

use crate::map::scene::{self, Scale};
use crate::show::cells::Cells;
use crate::show::color::Color;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::Frame;
use crate::show::drawing::{Align, BELOW, Canvas, DARK, Rect, SMALL};
use crate::show::symbols::axis_label;

/// Position of the map.
const MAP_LEFT: f64 = 140.0;
const MAP_TOP: f64 = 162.0;
/// Distance from the map to the legend, and from the legend to the right edge.
const LEGEND_GAP: f64 = 36.0;
const LEGEND_MARGIN: f64 = 20.0;
/// A side of up to `SIDE` cells has as many whole pixels per cell as fit into `SIDE` pixels. A longer one has one pixel per cell,
/// and beyond `LONGEST_SIDE` cells are skipped.
const SIDE: usize = 1024;
const LONGEST_SIDE: usize = 2048;

/// Height of a row of the legend.
pub(crate) const ROW: f64 = 33.0;
/// Width and height of a colour patch, and its distance from the text.
const PATCH: (f64, f64) = (34.0, 20.0);
const AFTER_PATCH: f64 = 14.0;

/// Positions in a figure.
pub(crate) struct MapLayout {
    /// Size of the figure.
    pub(crate) size: (u32, u32),
    map: Rect,
    /// Top left corner of the legend.
    pub(crate) left: f64,
    pub(crate) top: f64,
    /// Right edge of the legend.
    pub(crate) right: f64,
}

impl MapLayout {
    /// Computes the positions for a map with a legend of width `legend_width`. Map and legend are at least `least_height` high.
    pub(crate) fn new(cells: &Cells<'_>, legend_width: f64, least_height: f64) -> MapLayout {
        let [width, height] = cells.counts().map(side);
        let map = Rect { left: MAP_LEFT, top: MAP_TOP, right: MAP_LEFT + width, bottom: MAP_TOP + height };
        let left = map.right + LEGEND_GAP;
        let size = (left + legend_width, MAP_TOP + height.max(least_height) + BELOW);
        let right = left + legend_width - LEGEND_GAP - LEGEND_MARGIN;
        MapLayout { size: (size.0 as u32, size.1 as u32), map, left, top: MAP_TOP, right }
    }

    /// Draws the cells, given the colour of each by id, and the axes.
    pub(crate) fn draw_map(&self, canvas: &Canvas, cells: &Cells<'_>, color: impl Fn(usize) -> Color) {
        let [columns, rows] = cells.counts();
        canvas.raster(self.map, [columns, rows], |[i, j]| color(j * columns + i));
        let [x, y] = [0, 1].map(|i| axis(&cells.scene().axes()[i]));
        Frame { rect: self.map, x, y }.draw_axes(canvas, true);
    }

    /// Draws an entry of the legend whose middle is at `y`: a colour, its text, and the number of its cells.
    pub(crate) fn draw_entry(&self, canvas: &Canvas, y: f64, color: Color, text: &str, cells: &str) {
        let (left, right) = (self.left, self.left + PATCH.0);
        let patch = Rect { left, top: y - PATCH.1 / 2.0, right, bottom: y + PATCH.1 / 2.0 };
        canvas.fill(patch, color, 1.0);
        canvas.outline(patch, 1.0);
        canvas.text(text, (right + AFTER_PATCH, y), SMALL, Align::Left, DARK);
        canvas.text(cells, (self.right, y), SMALL, Align::Right, DARK);
    }

    /// Returns the room for the text of an entry with the given number of cells.
    pub(crate) fn text_room(&self, canvas: &Canvas, cells: &str) -> f64 {
        self.right - self.left - PATCH.0 - AFTER_PATCH - canvas.text_width(cells, SMALL) - 16.0
    }
}

/// Returns the pixels of a side of `count` cells.
fn side(count: usize) -> f64 {
    let pixels = if count <= SIDE { count * (SIDE / count) } else { count.min(LONGEST_SIDE) };
    pixels as f64
}

/// Returns an axis that extends by half a cell beyond the first and last values.
fn axis(axis: &scene::Axis) -> Axis {
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
