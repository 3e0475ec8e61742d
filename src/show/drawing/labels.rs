//! Labels of points: beside them, where they cover no marker, no other label and no edge.

use crate::show::drawing::{Align, Canvas, Point, RGBColor, Rect};
use crate::show::error::DrawError;

/// Room around a label.
const GAP: f64 = 3.0;
/// From a point to its label: beyond the rim of its marker.
const OFF: f64 = 13.0;
/// Where a label may go, the first that is free: directions from its point, right first.
const PLACES: [Point; 6] = [(1.0, 0.0), (-1.0, 0.0), (1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)];

/// Places labels one after another; drawn after all markers, so that none covers them.
#[derive(Debug)]
pub struct Labels {
    within: Rect,
    taken: Vec<Rect>,
    placed: Vec<(String, Rect, RGBColor)>,
    size: f64,
}

impl Labels {
    /// No labels yet, of type of `size`, to lie `within` a rectangle and beside `markers` of a radius.
    pub fn beside(markers: &[Point], radius: f64, within: Rect, size: f64) -> Labels {
        let taken = markers.iter().map(|at| around(*at, radius, radius)).collect();
        Labels { within, taken, placed: Vec::new(), size }
    }

    /// Adds the label of a point of a curve that comes from `before`: on the side away from it if
    /// there is room, to the right if there is room nowhere.
    pub fn add(
        &mut self,
        canvas: &Canvas<'_>,
        text: String,
        at: Point,
        before: Option<Point>,
        color: RGBColor,
    ) -> Result<(), DrawError> {
        let half = (
            canvas.text_width(&text, self.size)? / 2.0,
            canvas.typeface.cap_height(canvas.typeface.em(self.size)) / 2.0,
        );
        let place = |(x, y): Point| {
            let x_off = if y == 0.0 { OFF + half.0 } else { half.0 };
            around((at.0 + x * x_off, at.1 + y * (OFF + half.1)), half.0, half.1)
        };
        let mirror = if before.is_some_and(|before| before.0 > at.0) { -1.0 } else { 1.0 };
        let mut places = PLACES.iter().map(|(x, y)| place((mirror * x, *y)));
        let rect = places.find(|rect| self.is_free(*rect)).unwrap_or_else(|| place(PLACES[0]));
        self.taken.push(rect);
        self.placed.push((text, rect, color));
        Ok(())
    }

    /// Writes what was added.
    pub fn draw(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        for (text, rect, color) in &self.placed {
            let at = (rect.left, (rect.top + rect.bottom) / 2.0);
            canvas.text(text, at, self.size, Align::Left, *color)?;
        }
        Ok(())
    }

    fn is_free(&self, rect: Rect) -> bool {
        let within = self.within;
        let is_inside = rect.left - GAP > within.left
            && rect.right + GAP < within.right
            && rect.top - GAP > within.top
            && rect.bottom + GAP < within.bottom;
        is_inside && !self.taken.iter().any(|other| overlap(*other, rect))
    }
}

fn around(at: Point, half_width: f64, half_height: f64) -> Rect {
    Rect {
        left: at.0 - half_width,
        top: at.1 - half_height,
        right: at.0 + half_width,
        bottom: at.1 + half_height,
    }
}

fn overlap(a: Rect, b: Rect) -> bool {
    a.left < b.right + GAP && b.left < a.right + GAP && a.top < b.bottom + GAP && b.top < a.bottom + GAP
}
