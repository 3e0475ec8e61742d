//! Each gap against time between its walls, with the symbols of the word, and the depth of penetration. Lengths are in pixels.

use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, column, stacked};
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Align, Canvas, DARK, MEDIUM, MESHING, Point, Rect, SMALL, wall_color};
use crate::show::figure::orbit::flights;
use crate::show::figure::orbit::gaps::PlotGap;
use crate::show::figure::orbit::motion::Piece;
use crate::show::figure::orbit::plot::{FREE_LINE, ORBIT_LEFT, OrbitPlot};
use crate::show::names;
use crate::show::symbols::{number, with_unit};
use rattlemap_dynamics::model::{Contact, Side, State};
use rattlemap_dynamics::orbit::Event;

/// Default height with one gap, and shares of the panels of gap and depth.
const HEIGHT: f64 = 1050.0;
const SHARES: [f64; 2] = [1.4, 0.75];
/// Height that the panels of each further gap add, per share.
const FURTHER: f64 = 320.0;
/// Room for the walls' names right of the panel in a figure of default size, and the room for their text, which includes the
/// margin.
const WALL_NAMES: f64 = 97.0;
const WALL_TEXT: f64 = 135.0;
/// Distance from the panel to the walls' names.
const WALL_AWAY: f64 = 14.0;
/// Default height of a figure of a motion from the start: with one gap, and of each further gap and displacement.
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

/// Returns the position of a wall: the model's expression, or its value if the expression is too long.
fn position(canvas: &Canvas, gap: &PlotGap, side: Side) -> Option<String> {
    let expression = gap.labels.position(side);
    let value = format!("{} = {}", gap.labels.gap(), number(gap.wall(side)));
    expression.into_iter().chain([value]).find(|text| canvas.text_width(text, SMALL) <= WALL_TEXT)
}

impl OrbitPlot<'_> {
    pub(crate) fn draw_gap(&self, canvas: &Canvas) {
        let are_coordinates = self.gaps.iter().all(|gap| self.gap_coordinate(gap).is_some());
        let free = if are_coordinates { "free motion" } else { "gap in free motion" };
        let legend = self.legend(self.motion_entries(free), false);
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend) + 14.0;
        // The depth behind the walls of a gap is shown below it.
        let panels_of = |gap: &PlotGap| if self.has_depth(gap) { &SHARES[..] } else { &SHARES[..1] };
        let shares: Vec<f64> = self.gaps.iter().flat_map(panels_of).copied().collect();
        let further: f64 = self.gaps[1..].iter().flat_map(panels_of).sum();
        let axes = self.gaps.iter().flat_map(|gap| {
            let depth = self.has_depth(gap).then(|| self.depth_axis(gap));
            [self.gap_axis(gap)].into_iter().chain(depth)
        });
        let panels =
            stacked(canvas, top, HEIGHT + FURTHER * further, &shares).into_iter().zip(axes).collect();
        let frames = column(canvas, panels, &self.time_axis(), ORBIT_LEFT, self.wall_names(canvas));
        let mut rest = &frames[..];
        for gap in &self.gaps {
            let (of_gap, below) = rest.split_at(panels_of(gap).len());
            self.draw_gap_panel(canvas, &of_gap[0], gap);
            self.draw_symbols(canvas, &of_gap[0], gap);
            of_gap[0].draw_axes(canvas, of_gap.len() == 1 && below.is_empty());
            if let Some(frame) = of_gap.get(1) {
                self.draw_penetration(canvas, frame, gap);
                frame.draw_axes(canvas, below.is_empty());
            }
            rest = below;
        }
    }

    /// Draws the gaps and the displacements of a motion from the start, one below the other.
    pub(crate) fn draw_history(&self, canvas: &Canvas) {
        let legend = self.legend(self.motion_entries("free motion"), false);
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend) + 14.0;
        let displacements = self.other_displacements();
        let label = |index: &usize| format!("displacement, {}", self.names[*index]);
        let others = displacements.iter().map(|index| self.state_axis(&label(index), &[*index], 1.0));
        let axes: Vec<Axis> =
            self.gaps.iter().map(|gap| self.gap_axis(gap)).chain(others).chain(self.signal_axes()).collect();
        let height = HISTORY_HEIGHT[0] + HISTORY_HEIGHT[1] * (axes.len() - 1) as f64;
        let panels = stacked(canvas, top, height, &vec![1.0; axes.len()]).into_iter().zip(axes).collect();
        let frames = column(canvas, panels, &self.time_axis(), ORBIT_LEFT, self.wall_names(canvas));
        let (of_gaps, others) = frames.split_at(self.gaps.len());
        let (of_displacements, of_signals) = others.split_at(displacements.len());
        self.draw_signals(canvas, of_signals);
        for (frame, gap) in of_gaps.iter().zip(&self.gaps) {
            self.draw_gap_panel(canvas, frame, gap);
        }
        for (frame, &index) in of_displacements.iter().zip(&displacements) {
            frame.draw_grid(canvas);
            let gaps = [self.gaps_of(index / 2), self.all_gaps()];
            self.draw_motion(canvas, frame, gaps.each_ref().map(|gaps| &gaps[..]), |t, state| {
                (t, state[index])
            });
        }
        for (n, frame) in frames.iter().enumerate() {
            frame.draw_axes(canvas, n + 1 == frames.len());
        }
    }

    /// Returns the indices of the displacements in the state, without those that are gaps.
    fn other_displacements(&self) -> Vec<usize> {
        let is_gap = |index: &usize| self.gaps.iter().any(|gap| self.gap_coordinate(gap) == Some(*index));
        (0..self.names.len()).step_by(2).filter(|index| !is_gap(index)).collect()
    }

    /// Returns the index in the state of the displacement that is the gap.
    fn gap_coordinate(&self, gap: &PlotGap) -> Option<usize> {
        self.names.iter().position(|name| name == gap.labels.gap())
    }

    fn gap_label(&self, gap: &PlotGap) -> String {
        let name = gap.labels.gap();
        let label = match self.gap_coordinate(gap) {
            Some(_) => format!("displacement, {name}"),
            None => format!("gap, {name} = {}", self.gap_expression(gap)),
        };
        with_unit(&label, self.units.gap.as_deref())
    }

    /// Draws a gap between its walls, with its own contacts and events.
    fn draw_gap_panel(&self, canvas: &Canvas, frame: &Frame, gap: &PlotGap) {
        self.draw_walls(canvas, frame, gap);
        self.draw_motion(canvas, frame, [&[gap.index]; 2], |t, state| (t, self.gap(gap, state)));
    }

    /// Draws the motion in a panel. `colored` are the gaps whose contact colours it, `marked` those whose events have markers.
    fn draw_motion(
        &self,
        canvas: &Canvas,
        frame: &Frame,
        [colored, marked]: [&[usize]; 2],
        at: impl Fn(f64, &State) -> Point + Copy,
    ) {
        self.draw_lines(canvas, frame, colored, (DARK, MESHING), at);
        self.draw_markers(canvas, frame, marked, false, at);
    }

    /// Returns the room for the walls' names right of the panels, beyond half a label.
    fn wall_names(&self, canvas: &Canvas) -> f64 {
        if canvas.is_default() {
            return WALL_NAMES;
        }
        let walls = self.gaps.iter().flat_map(|gap| {
            let has = |side: &Side| gap.contact(*side).is_some();
            Side::BOTH.into_iter().filter(has).map(move |side| (gap, side))
        });
        let texts =
            walls.flat_map(|(gap, side)| [Some(wall_name(side)), position(canvas, gap, side)]).flatten();
        WALL_AWAY + texts.map(|text| canvas.text_width(&text, SMALL)).fold(0.0, f64::max)
    }

    /// Whether a gap meshes with a wall of impacts, so that a panel shows the depth, which is too small to be visible in the
    /// gap. Behind an elastic wall the depth is visible; on a rigid wall it is zero.
    fn has_depth(&self, gap: &PlotGap) -> bool {
        let walls = self.motion.meshing_walls(gap.index);
        walls.into_iter().any(|side| gap.contact(side) == Some(Contact::Impact))
    }

    /// Returns an axis that holds the motion and both walls, or a single wall if it is near.
    fn gap_axis(&self, gap: &PlotGap) -> Axis {
        let gaps = || self.motion.points().map(|(_, state)| self.gap(gap, state));
        let (low, high) = gaps().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
        let extent = (high - low).max(gap.decayed());
        let [right, left] = Side::BOTH.map(|side| gap.wall(side));
        let are_two = gap.has_two_walls();
        let mut ends: Vec<f64> = Vec::new();
        if are_two {
            ends.extend([right + 0.25 * gap.length, left - 0.25 * gap.length]);
        }
        let is_elastic = Side::BOTH.iter().any(|side| gap.is_elastic(*side));
        if !are_two || is_elastic {
            ends.extend([high + MOTION_MARGIN * extent, low - MOTION_MARGIN * extent]);
            let near = [(right, right - high, 1.0), (left, low - left, -1.0)];
            let near =
                near.into_iter().filter(|(wall, away, _)| wall.is_finite() && *away < FAR_WALL * extent);
            ends.extend(near.map(|(wall, _, sign)| wall + sign * MOTION_MARGIN * extent));
        }
        let least_span = if are_two { gap.length } else { gap.decayed() };
        Axis::around(&self.gap_label(gap), gaps().chain(ends), least_span)
    }

    /// Draws the symbols of the word: behind the wall of a flight that returns to it, else beside the flight. Symbols that
    /// would overlap an earlier one are left out.
    fn draw_symbols(&self, canvas: &Canvas, frame: &Frame, gap: &PlotGap) {
        let walls = Side::BOTH.map(|side| frame.at(0.0, gap.wall(side)).1);
        let of_gap = |(_, event): &&(f64, Event)| event.gap == gap.index;
        let events: Vec<(f64, Event)> = self.motion.events.iter().filter(of_gap).copied().collect();
        let mut drawn: Vec<Point> = Vec::new();
        for (t, symbol) in flights::symbols(&events, self.cycle) {
            let nearest = self.motion.points().min_by(|a, b| (a.0 - t).abs().total_cmp(&(b.0 - t).abs()));
            let Some((_, state)) = nearest else { continue };
            let (x, y) = frame.at(t, self.gap(gap, state));
            let [mut upper, mut lower] = walls;
            // The symbol of contact with an elastic wall is drawn behind the motion.
            if symbol == '1' && gap.is_elastic(Side::Right) {
                upper = y.min(upper);
            }
            if symbol == '4' && gap.is_elastic(Side::Left) {
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
    fn draw_walls(&self, canvas: &Canvas, frame: &Frame, gap: &PlotGap) {
        let rect = frame.rect;
        let walls = || Side::BOTH.into_iter().filter(|side| gap.contact(*side).is_some());
        let height = |side: Side| frame.at(0.0, gap.wall(side)).1;
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
            for (at, width) in gap.wall_lines(side).skip(1) {
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
            let lines = [Some(wall_name(side)), position(canvas, gap, side)];
            let lines = lines.into_iter().flatten().chain(beyond.map(str::to_owned));
            for (line, text) in lines.enumerate() {
                canvas.text(&text, (x, y - 14.0 + 28.0 * line as f64), SMALL, Align::Left, color);
            }
        }
    }

    /// Returns the depth of penetration into a wall.
    fn depth(&self, gap: &PlotGap, piece: &Piece, state: &State) -> f64 {
        let side = piece.contacts[gap.index];
        side.map_or(0.0, |side| side.sign() * (self.gap(gap, state) - gap.wall(side)))
    }

    fn depth_axis(&self, gap: &PlotGap) -> Axis {
        let pieces = self.motion.pieces.iter();
        let depths = pieces.flat_map(|p| p.points.iter().map(move |(_, s)| self.depth(gap, p, s)));
        let label = match gap.labels.half() {
            Some(half) => format!("depth, |{}| \u{2212} {half}", gap.labels.gap()),
            None if self.gaps.len() > 1 => format!("depth of {} behind the wall", gap.labels.gap()),
            None => "depth behind the wall".to_owned(),
        };
        let label = with_unit(&label, self.units.gap.as_deref());
        Axis::around(&label, depths, 1e-6 * gap.length)
    }

    /// Draws the depth of penetration into the walls, without the axes.
    fn draw_penetration(&self, canvas: &Canvas, frame: &Frame, gap: &PlotGap) {
        let rect = frame.rect;
        frame.draw_grid(canvas);
        let y = frame.at(0.0, 0.0).1;
        canvas.stroke(&[(rect.left, y), (rect.right, y)], 2.0, DARK);
        canvas.text("wall", (rect.right + WALL_AWAY, y), SMALL, Align::Left, DARK);
        for piece in &self.motion.pieces {
            if let Some(side) = piece.contacts[gap.index] {
                let path: Vec<_> = piece
                    .points
                    .iter()
                    .map(|(t, state)| frame.at(*t, self.depth(gap, piece, state)))
                    .collect();
                canvas.stroke(&path, FREE_LINE + 0.6, wall_color(side));
            }
        }
    }

    fn gap(&self, gap: &PlotGap, state: &State) -> f64 {
        self.oscillator.gap_value(gap.index, state, 0)
    }

    /// Returns the gap as an expression of the displacements.
    fn gap_expression(&self, gap: &PlotGap) -> String {
        let mut text = String::new();
        let terms = self.oscillator.gap_row(gap.index).into_iter().zip(self.names.iter().step_by(2));
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
