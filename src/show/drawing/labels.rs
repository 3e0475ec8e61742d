//! Labels of points, placed so that they cover no marker, no other label and no edge.

use crate::show::color::Color;
use crate::show::drawing::canvas::Canvas;
use crate::show::drawing::shapes::{Align, Point, Rect};
use crate::show::drawing::typeface::Typeface;

/// Least distance between labels.
const ROOM: f64 = 3.0;
/// Distance from a point to its label, beyond the rim of its marker.
const OFF: f64 = 13.0;
/// Directions from a point to its label, in order of preference.
const DIRECTIONS: [Point; 6] = [(1.0, 0.0), (-1.0, 0.0), (1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)];

/// Labels under construction. Draw them after all markers.
#[derive(Debug)]
pub struct Labels {
    within: Rect,
    obstacles: Vec<Rect>,
    labels: Vec<(String, Rect, Color)>,
    size: f64,
}

impl Labels {
    /// Returns an empty list of labels of type size `size`. They will lie `within` a rectangle and avoid `markers` of the
    /// given radius.
    pub fn new(markers: &[Point], radius: f64, within: Rect, size: f64) -> Labels {
        let obstacles = markers.iter().map(|at| Rect::around(*at, (radius, radius))).collect();
        Labels { within, obstacles, labels: Vec::new(), size }
    }

    /// Adds the label of a point at the end of a curve whose previous point is `before`. The label is placed on the
    /// opposite side if there is room, and to the right if there is room nowhere.
    pub fn add(&mut self, canvas: &Canvas, text: String, at: Point, before: Option<Point>, color: Color) {
        let face = Typeface::of_figures();
        let half = (canvas.text_width(&text, self.size) / 2.0, face.cap_height(face.em(self.size)) / 2.0);
        let place = |(x, y): Point| {
            let x_off = if y == 0.0 { OFF + half.0 } else { half.0 };
            Rect::around((at.0 + x * x_off, at.1 + y * (OFF + half.1)), half)
        };
        let mirror = if before.is_some_and(|before| before.0 > at.0) { -1.0 } else { 1.0 };
        let mut places = DIRECTIONS.iter().map(|(x, y)| place((mirror * x, *y)));
        let rect = places.find(|rect| self.is_free(*rect)).unwrap_or_else(|| place(DIRECTIONS[0]));
        self.obstacles.push(rect);
        self.labels.push((text, rect, color));
    }

    /// Draws the labels.
    pub fn draw(&self, canvas: &Canvas) {
        for (text, rect, color) in &self.labels {
            let at = (rect.left, (rect.top + rect.bottom) / 2.0);
            canvas.text(text, at, self.size, Align::Left, *color);
        }
    }

    fn is_free(&self, rect: Rect) -> bool {
        let within = self.within;
        let is_inside = rect.left - ROOM > within.left
            && rect.right + ROOM < within.right
            && rect.top - ROOM > within.top
            && rect.bottom + ROOM < within.bottom;
        is_inside && !self.obstacles.iter().any(|other| overlap(*other, rect))
    }
}

fn overlap(a: Rect, b: Rect) -> bool {
    a.left < b.right + ROOM && b.left < a.right + ROOM && a.top < b.bottom + ROOM && b.top < a.bottom + ROOM
}
