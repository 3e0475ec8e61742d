//! Displacements and velocities of all bodies, and signals, against time.

use crate::show::color::Color;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{column, stacked};
use crate::show::drawing::legend::{Entry, Key, draw_head};
use crate::show::drawing::{BODIES, Canvas, wall_color};
use crate::show::figure::orbit::plot::{FREE_LINE, ORBIT_LEFT, OrbitPlot};
use crate::show::names;
use rattlemap_dynamics::model::{Side, State};

/// Default height.
const HEIGHT: f64 = 1150.0;
/// Opacity of the bands that show meshing.
const MESHING_BAND: f64 = 0.16;

impl OrbitPlot<'_> {
    pub(crate) fn draw_time_history(&self, canvas: &Canvas) {
        let colored = || self.bodies.iter().zip(BODIES).enumerate();
        let line = |(_, (body, color)): (usize, (&&str, Color))| {
            Entry::new(Key::Line { color, width: FREE_LINE }, body)
        };
        let mut motion: Vec<Entry> = colored().map(line).collect();
        let gaps = self.all_gaps();
        let meshes = |side: &Side| gaps.iter().any(|gap| self.motion.meshing_walls(*gap).contains(side));
        for side in Side::BOTH.into_iter().filter(meshes) {
            let band = Key::Patch { color: wall_color(side), opacity: MESHING_BAND };
            motion.push(Entry::new(band, &format!("{}, {} wall", self.contact_name(), names::side(side))));
        }
        let top = draw_head(canvas, &self.title, &self.subtitle, &self.legend(motion, true)) + 14.0;
        let axis = |quantity: usize, label, scale| {
            let components: Vec<usize> = (quantity..self.names.len()).step_by(2).collect();
            self.state_axis(label, &components, scale)
        };
        let axes = [axis(0, "displacement, x", 1.0), axis(1, "velocity, v", self.oscillator.omega)];
        let axes: Vec<Axis> = axes.into_iter().chain(self.signal_axes()).collect();
        let height = HEIGHT * axes.len() as f64 / 2.0;
        let panels = stacked(canvas, top, height, &vec![1.0; axes.len()]).into_iter().zip(axes).collect();
        let frames = column(canvas, panels, &self.time_axis(), ORBIT_LEFT, 0.0);
        let (of_states, of_signals) = frames.split_at(2);
        self.draw_signals(canvas, of_signals);
        for (quantity, frame) in of_states.iter().enumerate() {
            for piece in &self.motion.pieces {
                let (from, to) = piece.span();
                // Where several gaps are in contact, their bands lie upon each other.
                for side in piece.contacts.into_iter().flatten() {
                    canvas.fill(frame.column(from, to), wall_color(side), MESHING_BAND);
                }
            }
            frame.draw_grid(canvas);
            for (i, (_, color)) in colored() {
                let index = quantity + 2 * i;
                let at = |t: f64, state: &State| (t, state[index]);
                self.draw_jumps(canvas, frame, at);
                self.draw_lines(canvas, frame, &gaps, (color, color), at);
                self.draw_markers(canvas, frame, &gaps, quantity == 1, at);
            }
        }
        for (n, frame) in frames.iter().enumerate() {
            frame.draw_axes(canvas, n + 1 == frames.len());
        }
    }
}
