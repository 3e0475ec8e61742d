//! The phase plane of each body.

use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, below, column, left_margin, right_margin, stacked};
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Canvas, DARK, MESHING, Rect, wall_color};
use crate::show::figure::orbit::plot::{ORBIT_LEFT, OrbitPlot};
use crate::show::symbols::symbol;
use rattlemap_dynamics::model::State;

/// Default height.
const HEIGHT: f64 = 980.0;
/// Least distance between two planes in a figure of default size: room for the labels of the right one.
const PLANE_GAP: f64 = 150.0;
/// In other figures: least width of the figure per plane for planes side by side, additional room between planes, and height
/// of a plane in panels.
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
            self.draw_lines(canvas, frame, (DARK, MESHING), at);
            self.draw_markers(canvas, frame, true, at);
            frame.draw_axes(canvas, true);
        }
    }

    /// Returns the frames of the planes: side by side, or one below the other in a narrow figure.
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
        let (count, size) = (axes.len() as f64, canvas.size().0);
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
        let edges = stacked(canvas, top, HEIGHT, &[if count > 1.0 { 1.0 } else { SHARE }])[0];
        let height = edges[1] - edges[0];
        let room = |nth: usize, y: &Axis| {
            let before = left_margin(canvas, if nth == 0 { ORBIT_LEFT } else { PLANE_GAP }, &[(y, height)]);
            before + if nth == 0 || canvas.is_default() { 0.0 } else { BETWEEN }
        };
        let rooms: Vec<f64> = axes.iter().enumerate().map(|(nth, [_, y])| room(nth, y)).collect();
        let after = right_margin(canvas, &axes[axes.len() - 1][0], size / count);
        let width = (size - rooms.iter().sum::<f64>() - after) / count;
        let mut right = 0.0;
        let frame = |([x, y], room): ([Axis; 2], f64)| {
            let left = right + room;
            right = left + width;
            below_last = edges[1] + below(canvas, &x, [left, right]).max(below_last - edges[1]);
            Frame { rect: Rect { left, right, top: edges[0], bottom: edges[1] }, x, y }
        };
        let frames = axes.into_iter().zip(rooms).map(frame).collect();
        canvas.set_height(below_last);
        frames
    }

    /// Draws the walls that the motion reaches, if the gap depends only on this displacement.
    fn draw_upright_walls(&self, canvas: &Canvas, frame: &Frame, displacement: usize) {
        let Rect { left, top, right, bottom } = frame.rect;
        let gap = self.oscillator.gap_row(0);
        if gap.iter().enumerate().any(|(i, factor)| i != displacement && *factor != 0.0) {
            return;
        }
        for side in self.motion.walls() {
            for (at, width) in self.wall_lines(side) {
                let x = frame.at(at / gap[displacement], 0.0).0;
                if (left..=right).contains(&x) {
                    canvas.stroke(&[(x, top), (x, bottom)], width, wall_color(side));
                }
            }
        }
    }
}
