//! The phase plane of each body.

use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, below, column, left_margin, right_margin, stacked};
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Canvas, DARK, MESHING, Rect, wall_color};
use crate::show::figure::orbit::plot::{ORBIT_LEFT, OrbitPlot};
use crate::show::symbols::symbol;
use rattlemap_dynamics::model::State;

/// Most planes beside each other.
const MOST_BESIDE: usize = 3;
/// Default height of a figure of one row, and of the planes of a figure of several rows.
const HEIGHT: f64 = 980.0;
const ROW_HEIGHT: f64 = 430.0;
/// Least distance between two planes in a figure of default size: room for the labels of the right one.
const PLANE_GAP: f64 = 150.0;
/// In other figures: least width of the figure per plane for planes side by side, additional room between planes, and height
/// in panels of planes one below the other.
const LEAST_BESIDE: f64 = 520.0;
const BETWEEN: f64 = 12.0;
const SHARE: f64 = 1.5;

impl OrbitPlot<'_> {
    pub(crate) fn draw_phase_planes(&self, canvas: &Canvas) {
        let legend = self.legend(self.motion_entries("free motion"), true);
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend) + 14.0;
        let frames = self.planes(canvas, top);
        for (i, frame) in frames.iter().enumerate() {
            let (x, v) = (2 * i, 2 * i + 1);
            frame.draw_grid(canvas);
            self.draw_upright_walls(canvas, frame, i);
            let at = |_: f64, state: &State| (state[x], state[v]);
            self.draw_jumps(canvas, frame, at);
            self.draw_lines(canvas, frame, &self.gaps_of(i), (DARK, MESHING), at);
            self.draw_markers(canvas, frame, &self.all_gaps(), true, at);
            frame.draw_axes(canvas, true);
        }
    }

    /// Returns the frames of the planes: in rows of equal length, or one below the other in a narrow figure.
    fn planes(&self, canvas: &Canvas, top: f64) -> Vec<Frame> {
        let axes = self.bodies.iter().enumerate().map(|(i, body)| {
            let (x, v) = (2 * i, 2 * i + 1);
            let displacement = match symbol(body) == self.names[x] {
                true => format!("displacement, {}", self.names[x]),
                false => format!("displacement of {body}, {}", self.names[x]),
            };
            let velocity = format!("velocity, {}", self.names[v]);
            [
                self.state_axis(&displacement, &[x], 1.0),
                self.state_axis(&velocity, &[v], self.oscillator.omega),
            ]
        });
        let axes: Vec<[Axis; 2]> = axes.collect();
        let size = canvas.size().0;
        let columns = axes.len().div_ceil(axes.len().div_ceil(MOST_BESIDE));
        let count = columns as f64;
        let mut below_last = top;
        if axes.len() > 1 && !canvas.is_default() && size < LEAST_BESIDE * count {
            let plane = |[x, y]: [Axis; 2]| {
                let edges = stacked(canvas, below_last, HEIGHT, &[SHARE])[0];
                let frames = column(canvas, vec![(edges, y)], &x, ORBIT_LEFT, 0.0);
                below_last = canvas.size().1 + BETWEEN;
                frames
            };
            return axes.into_iter().flat_map(plane).collect();
        }
        let share = if axes.len() > 1 { 1.0 } else { SHARE };
        let is_single = axes.len() == columns;
        let edges = |top: f64| match is_single || !canvas.is_default() {
            true => stacked(canvas, top, HEIGHT, &[share])[0],
            false => [top, top + ROW_HEIGHT],
        };
        let height = edges(top)[1] - edges(top)[0];
        // Planes below each other have the same edges.
        let rows = || axes.chunks(columns);
        let room = |nth: usize| {
            let labels: Vec<_> = rows().filter_map(|row| row.get(nth)).map(|[_, y]| (y, height)).collect();
            let before = left_margin(canvas, if nth == 0 { ORBIT_LEFT } else { PLANE_GAP }, &labels);
            before + if nth == 0 || canvas.is_default() { 0.0 } else { BETWEEN }
        };
        let rooms: Vec<f64> = (0..columns).map(room).collect();
        let last = rows().filter_map(|row| row.get(columns - 1));
        let after = last.map(|[x, _]| right_margin(canvas, x, size / count)).fold(0.0, f64::max);
        let width = (size - rooms.iter().sum::<f64>() - after) / count;
        let mut frames = Vec::new();
        for row in rows() {
            let [top, bottom] = edges(below_last);
            let mut right = 0.0;
            for ([x, y], room) in row.iter().cloned().zip(&rooms) {
                let left = right + room;
                right = left + width;
                below_last = below_last.max(bottom + below(canvas, &x, [left, right]));
                frames.push(Frame { rect: Rect { left, right, top, bottom }, x, y });
            }
            if frames.len() < axes.len() {
                below_last += BETWEEN;
            }
        }
        canvas.set_height(below_last);
        frames
    }

    /// Draws the walls that the motion reaches, of gaps that depend only on this displacement.
    fn draw_upright_walls(&self, canvas: &Canvas, frame: &Frame, displacement: usize) {
        let Rect { left, top, right, bottom } = frame.rect;
        for gap in &self.gaps {
            let row = self.oscillator.gap_row(gap.index);
            if row.iter().enumerate().any(|(i, factor)| i != displacement && *factor != 0.0) {
                continue;
            }
            for side in self.motion.walls(gap.index) {
                for (at, width) in gap.wall_lines(side) {
                    let x = frame.at(at / row[displacement], 0.0).0;
                    if (left..=right).contains(&x) {
                        canvas.stroke(&[(x, top), (x, bottom)], width, wall_color(side));
                    }
                }
            }
        }
    }
}
