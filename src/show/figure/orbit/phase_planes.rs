//! The phase plane of each body.

use crate::show::drawing::frame::Frame;
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Canvas, DARK, MESHING, Rect, wall_color};
use crate::show::figure::orbit::plot::{ORBIT_LEFT, OrbitPlot};
use crate::show::symbols::symbol;
use rattlemap_dynamics::model::State;

/// Distance between two phase planes: room for the labels of the right one, in pixels.
const PLANE_GAP: f64 = 150.0;

impl OrbitPlot<'_> {
    pub(crate) fn draw_phase_planes(&self, canvas: &Canvas) {
        let legend = self.legend(self.motion_entries("free motion"), true);
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend) + 14.0;
        let whole = canvas.panel(ORBIT_LEFT, top);
        let count = self.bodies.len() as f64;
        let width = (whole.right - whole.left - (count - 1.0) * PLANE_GAP) / count;
        for (i, body) in self.bodies.iter().enumerate() {
            let left = ORBIT_LEFT + i as f64 * (width + PLANE_GAP);
            let (x, v) = (2 * i, 2 * i + 1);
            let displacement = match symbol(body) == self.names[x] {
                true => format!("displacement, {}", self.names[x]),
                false => format!("displacement of {body}, {}", self.names[x]),
            };
            let frame = Frame {
                rect: Rect { left, right: left + width, ..whole },
                x: self.state_axis(&displacement, &[x], 1.0),
                y: self.state_axis(&format!("velocity, {}", self.names[v]), &[v], self.oscillator.omega),
            };
            frame.draw_grid(canvas);
            self.draw_upright_walls(canvas, &frame, i);
            let at = |_: f64, state: &State| (state[x], state[v]);
            self.draw_jumps(canvas, &frame, at);
            self.draw_lines(canvas, &frame, (DARK, MESHING), at);
            self.draw_markers(canvas, &frame, true, at);
            frame.draw_axes(canvas, true);
        }
    }

    /// Draws the walls that the motion reaches, if the gap depends only on this displacement.
    fn draw_upright_walls(&self, canvas: &Canvas, frame: &Frame, displacement: usize) {
        let Rect { left, top, right, bottom } = frame.rect;
        let gap = self.oscillator.gap;
        if gap[1 - displacement] != 0.0 {
            return;
        }
        for side in self.motion.walls() {
            let x = frame.at(self.oscillator.walls[side.index()] / gap[displacement], 0.0).0;
            if (left..=right).contains(&x) {
                canvas.stroke(&[(x, top), (x, bottom)], 2.0, wall_color(side));
            }
        }
    }
}
