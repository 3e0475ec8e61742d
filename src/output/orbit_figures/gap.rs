//! The gap against time between its walls, the word's symbols on it, and how deep the teeth press.

use super::motion::Piece;
use super::{Align, DARK, LEFT, LINE, MEDIUM, MESHING, Rect, SMALL, Scene, name, symbols, wall_color};
use crate::output::DrawError;
use crate::output::plot_style::Canvas;
use crate::output::plot_style::axes::{Axis, Frame};
use crate::output::plot_style::legend::{Entry, Key, draw_head};
use rattlemap_dynamics::model::{Side, State};

/// Room for the walls' names beside the gap.
const WALL_NAMES: f64 = 97.0;
/// Between a symbol of the word and its flight.
const SYMBOL_AWAY: f64 = 30.0;

impl Scene<'_> {
    pub(super) fn draw_gap(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let mut legend = vec![Entry::new(Key::Line { color: DARK, width: LINE }, "gap in free motion")];
        legend.extend(self.meshing_entry());
        legend.extend(self.event_entries(false));
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend)? + 14.0;
        let panel = canvas.panel(LEFT, top);
        let panel = Rect { right: panel.right - WALL_NAMES, ..panel };
        let bottom = panel.bottom;
        let split = if self.motion.meshes() { top + 0.64 * (bottom - top) } else { bottom };
        let room = 0.25 * self.length;
        let walls = Side::BOTH
            .into_iter()
            .filter_map(|side| self.walls.position(side).map(|at| at + side.sign() * room));
        let gaps = self.motion.points().map(|(_, state)| self.gap(state));
        let frame = Frame {
            rect: Rect { bottom: split, ..panel },
            x: self.time_axis(),
            y: Axis::around(&format!("gap, z = {}", self.gap_in_words()), gaps.chain(walls), self.length),
        };
        self.draw_walls(canvas, &frame)?;
        let at = |t: f64, state: &State| (t, self.gap(state));
        self.draw_lines(canvas, &frame, (DARK, MESHING), at)?;
        self.draw_markers(canvas, &frame, false, at)?;
        self.draw_symbols(canvas, &frame)?;
        frame.draw_axes(canvas, split == bottom)?;
        if split < bottom {
            self.draw_penetration(canvas, Rect { top: split + 30.0, ..panel })?;
        }
        Ok(())
    }

    /// The word, symbol by symbol: behind its wall where a flight returns to it, else beside the flight.
    fn draw_symbols(&self, canvas: &Canvas<'_>, frame: &Frame) -> Result<(), DrawError> {
        let rect = frame.rect;
        // Of a wall that there is not the edge stands for its place.
        let [upper, lower] = self.edges(frame).map(|y| y.clamp(rect.top, rect.bottom));
        for (t, symbol) in symbols::symbols(&self.motion.events, self.cycle) {
            let nearest = self.motion.points().min_by(|a, b| (a.0 - t).abs().total_cmp(&(b.0 - t).abs()));
            let Some((_, state)) = nearest else { continue };
            let (x, y) = frame.at(t, self.gap(state));
            let at = match symbol {
                '1' | '2' => (x, upper - SYMBOL_AWAY),
                '4' | '5' => (x, lower + SYMBOL_AWAY),
                '3' => (x + SYMBOL_AWAY, y - 0.5 * SYMBOL_AWAY),
                _ => (x - SYMBOL_AWAY, y - 0.5 * SYMBOL_AWAY),
            };
            canvas.text(&symbol.to_string(), at, MEDIUM, Align::Center, DARK)?;
        }
        Ok(())
    }

    /// The walls of the gap, and what lies behind them.
    fn draw_walls(&self, canvas: &Canvas<'_>, frame: &Frame) -> Result<(), DrawError> {
        let rect = frame.rect;
        let edges = self.edges(frame);
        let [upper, lower] = edges;
        canvas.fill(Rect { bottom: upper.max(rect.top), ..rect }, DARK, 0.08)?;
        canvas.fill(Rect { top: lower.min(rect.bottom), ..rect }, DARK, 0.08)?;
        frame.draw_grid(canvas)?;
        for (side, y) in Side::BOTH.into_iter().zip(edges) {
            let Some(text) = self.walls.place(side) else { continue };
            let color = wall_color(side);
            canvas.stroke(&[(rect.left, y), (rect.right, y)], 2.0, color)?;
            let x = rect.right + 14.0;
            canvas.text(&format!("{} wall", name(side)), (x, y - 14.0), SMALL, Align::Left, color)?;
            canvas.text(&text, (x, y + 14.0), SMALL, Align::Left, color)?;
        }
        Ok(())
    }

    /// Where the right and the left wall are in the figure; beyond it where there is none.
    fn edges(&self, frame: &Frame) -> [f64; 2] {
        let edge = |side| self.walls.position(side).map(|at| frame.at(0.0, at).1);
        [edge(Side::Right).unwrap_or(f64::NEG_INFINITY), edge(Side::Left).unwrap_or(f64::INFINITY)]
    }

    /// How deep the teeth press into the wall: too little to be seen in the gap itself.
    fn draw_penetration(&self, canvas: &Canvas<'_>, rect: Rect) -> Result<(), DrawError> {
        let depth = |piece: &Piece, state: &State| {
            piece
                .meshing
                .map_or(0.0, |side| side.sign() * (self.gap(state) - self.oscillator.walls[side as usize]))
        };
        let depths = self.motion.pieces.iter().flat_map(|p| p.points.iter().map(move |(_, s)| depth(p, s)));
        let frame = Frame {
            rect,
            x: self.time_axis(),
            y: Axis::around(self.walls.depth(), depths, 1e-6 * self.length),
        };
        frame.draw_grid(canvas)?;
        let y = frame.at(0.0, 0.0).1;
        canvas.stroke(&[(rect.left, y), (rect.right, y)], 2.0, DARK)?;
        canvas.text("wall", (rect.right + 14.0, y), SMALL, Align::Left, DARK)?;
        for piece in &self.motion.pieces {
            if let Some(side) = piece.meshing {
                let path: Vec<_> =
                    piece.points.iter().map(|(t, state)| frame.at(*t, depth(piece, state))).collect();
                canvas.stroke(&path, LINE + 0.6, wall_color(side))?;
            }
        }
        frame.draw_axes(canvas, true)
    }

    fn gap(&self, state: &State) -> f64 {
        let [g1, g2] = self.oscillator.gap;
        g1 * state[0] + g2 * state[2]
    }

    /// The gap in terms of the displacements.
    fn gap_in_words(&self) -> String {
        let mut words = String::new();
        let terms = self.oscillator.gap.into_iter().zip(self.names.iter().step_by(2));
        for (factor, name) in terms.filter(|(factor, _)| *factor != 0.0) {
            words += match (words.is_empty(), factor < 0.0) {
                (true, true) => "\u{2212}",
                (true, false) => "",
                (false, true) => " \u{2212} ",
                (false, false) => " + ",
            };
            match factor.abs() {
                1.0 => words += name,
                size => words += &format!("{size} {name}"),
            }
        }
        words
    }
}
