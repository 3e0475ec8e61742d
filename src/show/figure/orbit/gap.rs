//! The gap against time between its walls, with the symbols of the word, and the depth of penetration. Lengths are in pixels.

use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, column, stacked};
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Align, Canvas, DARK, MEDIUM, MESHING, Point, Rect, SMALL, wall_color};
use crate::show::figure::orbit::flights;
use crate::show::figure::orbit::motion::Piece;
use crate::show::figure::orbit::plot::{FREE_LINE, ORBIT_LEFT, OrbitPlot};
use crate::show::names;
use crate::show::symbols::{number, with_unit};
use rattlemap_dynamics::model::{Contact, Side, State};

/// Default height, and shares of the panels of gap and depth.
const HEIGHT: f64 = 1050.0;
const SHARES: [f64; 2] = [1.4, 0.75];
/// Room for the walls' names right of the panel in a figure of default size, and the room for their text, which includes the
/// margin.
const WALL_NAMES: f64 = 97.0;
const WALL_TEXT: f64 = 135.0;
/// Distance from the panel to the walls' names.
const WALL_AWAY: f64 = 14.0;
/// Default height of a figure of a motion from the start: without displacements, and of each.
const HISTORY_HEIGHT: [f64; 2] = [760.0, 380.0];
/// Distance between a symbol of the word and its flight.
const SYMBOL_AWAY: f64 = 30.0;
/// Width of a symbol.
const SYMBOL_WIDTH: f64 = 13.0;
/// Least distance of the middle of a symbol from the edges of the panel.
const SYMBOL_HALF: f64 = 14.0;
/// A single wall is shown if its distance from the motion is less than this many times the motion's extent.
const FAR_WALL: f64 = 2.0;
/// Margin beyond the motion's ends, as a share of its extent, unless two walls bound it.
const MOTION_MARGIN: f64 = 0.15;

fn wall_name(side: Side) -> String {
    format!("{} wall", names::side(side))
}

impl OrbitPlot<'_> {
    pub(crate) fn draw_gap(&self, canvas: &Canvas) {
        let free = if self.gap_coordinate().is_some() { "free motion" } else { "gap in free motion" };
        let legend = self.legend(self.motion_entries(free), false);
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend) + 14.0;
        let shares = if self.has_depth() { &SHARES[..] } else { &SHARES[..1] };
        let axes = [self.gap_axis(&self.gap_label()), self.depth_axis()];
        let panels = stacked(canvas, top, HEIGHT, shares).into_iter().zip(axes).collect();
        let frames = column(canvas, panels, &self.time_axis(), ORBIT_LEFT, self.wall_names(canvas));
        let frame = &frames[0];
        self.draw_gap_panel(canvas, frame);
        self.draw_symbols(canvas, frame);
        frame.draw_axes(canvas, frames.len() == 1);
        if let Some(frame) = frames.get(1) {
            self.draw_penetration(canvas, frame);
        }
    }

    /// Draws the gap and the displacements of a motion from the start, one below the other.
    pub(crate) fn draw_history(&self, canvas: &Canvas) {
        let legend = self.legend(self.motion_entries("free motion"), false);
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend) + 14.0;
        let displacements = self.other_displacements();
        let label = |index: &usize| format!("displacement, {}", self.names[*index]);
        let others = displacements.iter().map(|index| self.state_axis(&label(index), &[*index], 1.0));
        let axes: Vec<Axis> = [self.gap_axis(&self.gap_label())].into_iter().chain(others).collect();
        let height = HISTORY_HEIGHT[0] + HISTORY_HEIGHT[1] * displacements.len() as f64;
        let panels = stacked(canvas, top, height, &vec![1.0; axes.len()]).into_iter().zip(axes).collect();
        let frames = column(canvas, panels, &self.time_axis(), ORBIT_LEFT, self.wall_names(canvas));
        self.draw_gap_panel(canvas, &frames[0]);
        for (frame, &index) in frames[1..].iter().zip(&displacements) {
            frame.draw_grid(canvas);
            self.draw_motion(canvas, frame, |t, state| (t, state[index]));
        }
        for (n, frame) in frames.iter().enumerate() {
            frame.draw_axes(canvas, n + 1 == frames.len());
        }
    }

    /// Returns the indices of the displacements in the state, without the one that is the gap.
    fn other_displacements(&self) -> Vec<usize> {
        (0..self.names.len()).step_by(2).filter(|index| self.gap_coordinate() != Some(*index)).collect()
    }

    /// Returns the index in the state of the displacement that is the gap.
    fn gap_coordinate(&self) -> Option<usize> {
        self.names.iter().position(|name| name == self.walls.gap())
    }

    fn gap_label(&self) -> String {
        let label = match self.gap_coordinate() {
            Some(_) => format!("displacement, {}", self.walls.gap()),
            None => format!("gap, {} = {}", self.walls.gap(), self.gap_expression()),
        };
        with_unit(&label, self.units.gap.as_deref())
    }

    /// Draws the gap between its walls.
    fn draw_gap_panel(&self, canvas: &Canvas, frame: &Frame) {
        self.draw_walls(canvas, frame);
        self.draw_motion(canvas, frame, |t, state| (t, self.gap(state)));
    }

    fn draw_motion(&self, canvas: &Canvas, frame: &Frame, at: impl Fn(f64, &State) -> Point + Copy) {
        self.draw_lines(canvas, frame, (DARK, MESHING), at);
        self.draw_markers(canvas, frame, false, at);
    }

    /// Returns the room for the walls' names right of the panels, beyond half a label.
    fn wall_names(&self, canvas: &Canvas) -> f64 {
        if canvas.is_default() {
            return WALL_NAMES;
        }
        let walls = Side::BOTH.into_iter().filter(|side| self.contact(*side).is_some());
        let texts = walls.flat_map(|side| [Some(wall_name(side)), self.position(canvas, side)]).flatten();
        WALL_AWAY + texts.map(|text| canvas.text_width(&text, SMALL)).fold(0.0, f64::max)
    }

    /// Whether the motion meshes with a wall of impacts, so that a panel shows the depth, which is too small to be visible in the
    /// gap. Behind an elastic wall the depth is visible; on a rigid wall it is zero.
    fn has_depth(&self) -> bool {
        let meshing = self.motion.pieces.iter().filter_map(|piece| piece.meshing);
        meshing.into_iter().any(|side| self.contact(side) == Some(Contact::Impact))
    }

    /// Returns an axis that holds the motion and both walls, or a single wall if it is near.
    fn gap_axis(&self, label: &str) -> Axis {
        let length = self.oscillator.length_scale();
        let gaps = || self.motion.points().map(|(_, state)| self.gap(state));
        let (low, high) = gaps().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
        let extent = (high - low).max(self.decayed());
        let [right, left] = self.oscillator.walls;
        let are_two = right.is_finite() && left.is_finite();
        let mut ends: Vec<f64> = Vec::new();
        if are_two {
            ends.extend([right + 0.25 * length, left - 0.25 * length]);
        }
        let is_elastic = Side::BOTH.iter().any(|side| self.contact(*side).is_some_and(Contact::is_elastic));
        if !are_two || is_elastic {
            ends.extend([high + MOTION_MARGIN * extent, low - MOTION_MARGIN * extent]);
            let near = [(right, right - high, 1.0), (left, low - left, -1.0)];
            let near =
                near.into_iter().filter(|(wall, away, _)| wall.is_finite() && *away < FAR_WALL * extent);
            ends.extend(near.map(|(wall, _, sign)| wall + sign * MOTION_MARGIN * extent));
        }
        let least_span = if are_two { length } else { self.decayed() };
        Axis::around(label, gaps().chain(ends), least_span)
    }

    /// Draws the symbols of the word: behind the wall of a flight that returns to it, else beside the flight. Symbols that
    /// would overlap an earlier one are left out.
    fn draw_symbols(&self, canvas: &Canvas, frame: &Frame) {
        let walls = self.oscillator.walls.map(|wall| frame.at(0.0, wall).1);
        let is_elastic = |side: Side| self.contact(side).is_some_and(Contact::is_elastic);
        let mut drawn: Vec<Point> = Vec::new();
        for (t, symbol) in flights::symbols(&self.motion.events, self.cycle) {
            let nearest = self.motion.points().min_by(|a, b| (a.0 - t).abs().total_cmp(&(b.0 - t).abs()));
            let Some((_, state)) = nearest else { continue };
            let (x, y) = frame.at(t, self.gap(state));
            let [mut upper, mut lower] = walls;
            // The symbol of contact with an elastic wall is drawn behind the motion.
            if symbol == '1' && is_elastic(Side::Right) {
                upper = y.min(upper);
            }
            if symbol == '4' && is_elastic(Side::Left) {
                lower = y.max(lower);
            }
            let at = match symbol {
                '1' | '2' => (x, upper - SYMBOL_AWAY),
                '4' | '5' => (x, lower + SYMBOL_AWAY),
                '3' => (x + SYMBOL_AWAY, y - 0.5 * SYMBOL_AWAY),
                _ => (x - SYMBOL_AWAY, y - 0.5 * SYMBOL_AWAY),
            };
            let Rect { top, bottom, .. } = frame.rect;
            let at = (at.0, at.1.max(top + SYMBOL_HALF).min(bottom - SYMBOL_HALF));
            let is_close =
                |(x, y): &Point| (x - at.0).abs() < SYMBOL_WIDTH && (y - at.1).abs() < SYMBOL_WIDTH;
            if drawn.iter().any(is_close) {
                continue;
            }
            drawn.push(at);
            canvas.text(&symbol.to_string(), at, MEDIUM, Align::Center, DARK);
        }
    }

    /// Draws the walls and the areas behind them.
    fn draw_walls(&self, canvas: &Canvas, frame: &Frame) {
        let rect = frame.rect;
        let walls = || Side::BOTH.into_iter().filter(|side| self.contact(*side).is_some());
        let height = |side: Side| frame.at(0.0, self.oscillator.walls[side.index()]).1;
        let is_visible = |side: Side| (rect.top..=rect.bottom).contains(&height(side));
        for side in walls().filter(|side| is_visible(*side)) {
            let behind = match side {
                Side::Right => Rect { bottom: height(side), ..rect },
                Side::Left => Rect { top: height(side), ..rect },
            };
            canvas.fill(behind, DARK, 0.08);
        }
        frame.draw_grid(canvas);
        for side in Side::BOTH {
            for (at, width) in self.wall_lines(side).skip(1) {
                let y = frame.at(0.0, at).1;
                if (rect.top..=rect.bottom).contains(&y) {
                    canvas.stroke(&[(rect.left, y), (rect.right, y)], width, wall_color(side));
                }
            }
        }
        let x = rect.right + WALL_AWAY;
        for side in walls() {
            let color = wall_color(side);
            let (y, beyond) = match (is_visible(side), side) {
                (true, _) => (height(side), None),
                (false, Side::Right) => (rect.top + 28.0, Some("(above)")),
                (false, Side::Left) => (rect.bottom - 56.0, Some("(below)")),
            };
            if is_visible(side) {
                canvas.stroke(&[(rect.left, y), (rect.right, y)], 2.0, color);
            }
            let lines = [Some(wall_name(side)), self.position(canvas, side)];
            let lines = lines.into_iter().flatten().chain(beyond.map(str::to_owned));
            for (line, text) in lines.enumerate() {
                canvas.text(&text, (x, y - 14.0 + 28.0 * line as f64), SMALL, Align::Left, color);
            }
        }
    }

    /// Returns the position of a wall: the model's expression, or its value if the expression is too long.
    fn position(&self, canvas: &Canvas, side: Side) -> Option<String> {
        let expression = self.walls.position(side);
        let value = format!("{} = {}", self.walls.gap(), number(self.oscillator.walls[side.index()]));
        expression.into_iter().chain([value]).find(|text| canvas.text_width(text, SMALL) <= WALL_TEXT)
    }

    /// Returns the depth of penetration into a wall.
    fn depth(&self, piece: &Piece, state: &State) -> f64 {
        piece
            .meshing
            .map_or(0.0, |side| side.sign() * (self.gap(state) - self.oscillator.walls[side.index()]))
    }

    fn depth_axis(&self) -> Axis {
        let pieces = self.motion.pieces.iter();
        let depths = pieces.flat_map(|p| p.points.iter().map(move |(_, s)| self.depth(p, s)));
        let label = match self.walls.half() {
            Some(half) => format!("depth, |{}| \u{2212} {half}", self.walls.gap()),
            None => "depth behind the wall".to_owned(),
        };
        let label = with_unit(&label, self.units.gap.as_deref());
        Axis::around(&label, depths, 1e-6 * self.oscillator.length_scale())
    }

    /// Draws the depth of penetration into the walls.
    fn draw_penetration(&self, canvas: &Canvas, frame: &Frame) {
        let rect = frame.rect;
        frame.draw_grid(canvas);
        let y = frame.at(0.0, 0.0).1;
        canvas.stroke(&[(rect.left, y), (rect.right, y)], 2.0, DARK);
        canvas.text("wall", (rect.right + WALL_AWAY, y), SMALL, Align::Left, DARK);
        for piece in &self.motion.pieces {
            if let Some(side) = piece.meshing {
                let path: Vec<_> =
                    piece.points.iter().map(|(t, state)| frame.at(*t, self.depth(piece, state))).collect();
                canvas.stroke(&path, FREE_LINE + 0.6, wall_color(side));
            }
        }
        frame.draw_axes(canvas, true);
    }

    fn gap(&self, state: &State) -> f64 {
        self.oscillator.gap_value(0, state, 0)
    }

    /// Returns the gap as an expression of the displacements.
    fn gap_expression(&self) -> String {
        let mut text = String::new();
        let terms = self.oscillator.gap_row(0).into_iter().zip(self.names.iter().step_by(2));
        for (factor, name) in terms.filter(|(factor, _)| *factor != 0.0) {
            text += match (text.is_empty(), factor < 0.0) {
                (true, true) => "\u{2212}",
                (true, false) => "",
                (false, true) => " \u{2212} ",
                (false, false) => " + ",
            };
            match factor.abs() {
                1.0 => text += name,
                size => text += &format!("{size} {name}"),
            }
        }
        text
    }
}
