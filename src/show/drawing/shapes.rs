//! Positions, rectangles and markers, in pixels of the finished picture.

use crate::show::color::Color;
use rattlemap_dynamics::orbit::EventKind;

/// A position; y points downwards.
pub type Point = (f64, f64);

/// A rectangle.
#[derive(Clone, Copy, Debug)]
pub struct Rect {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Right edge.
    pub right: f64,
    /// Lower edge.
    pub bottom: f64,
}

impl Rect {
    /// Returns the rectangle that extends by `half` from its centre `at` in each direction.
    pub(crate) fn around(at: Point, half: Point) -> Rect {
        Rect { left: at.0 - half.0, top: at.1 - half.1, right: at.0 + half.0, bottom: at.1 + half.1 }
    }

    /// Whether the rectangle has no area.
    pub(crate) fn is_empty(&self) -> bool {
        !(self.right > self.left && self.bottom > self.top)
    }
}

/// Which point of a text its position refers to. Vertically it is always the middle of the capitals.
#[derive(Clone, Copy, Debug)]
pub enum Align {
    /// The beginning.
    Left,
    /// The middle.
    Center,
    /// The end.
    Right,
    /// The middle of a text that is rotated to be read upwards.
    Upwards,
}

/// Outline of a marker, one per kind of event.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// An impact.
    Circle,
    /// A start of meshing.
    Triangle,
    /// An end of meshing.
    Square,
    /// A change of friction.
    Diamond,
}

impl Shape {
    /// Returns the outline for a kind of event.
    pub fn of(kind: EventKind) -> Shape {
        match kind {
            EventKind::Impact => Shape::Circle,
            EventKind::MeshStart => Shape::Triangle,
            EventKind::MeshEnd => Shape::Square,
        }
    }
}

/// A marker of a point.
#[derive(Clone, Copy, Debug)]
pub struct Marker {
    /// Outline.
    pub shape: Shape,
    /// Colour.
    pub color: Color,
    /// Half the extent.
    pub radius: f64,
    /// White inside: the state after an event, in figures that mark both states.
    pub hollow: bool,
}

impl Marker {
    /// Returns a filled circle.
    pub const fn dot(color: Color, radius: f64) -> Marker {
        Marker { shape: Shape::Circle, color, radius, hollow: false }
    }
}
