//! Colours of a diagram: by wall for one pass, by direction for two passes.

use crate::map::bifurcation::{Column, Direction};
use crate::show::color::Color;
use crate::show::drawing::{DARK, FAINT, GEAR_2, MESHING, wall_color};
use crate::show::figure::bifurcation::panels::{Panel, States};
use crate::show::layers::colors::QUASI_PERIODIC;
use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::Class;

/// Colour of states at phase 0, which have no wall.
pub(crate) const STROBE: Color = GEAR_2;

/// Meaning of the colours of dots.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coloring {
    /// Walls, in a diagram of one pass. Exponents have the colours of classes.
    Walls,
    /// Directions, in a diagram of two passes. Classes are shown by strips.
    Directions,
}

impl Coloring {
    pub(crate) fn of(columns: &[Column]) -> Coloring {
        let has_directions = columns.iter().any(|column| column.direction.is_some());
        if has_directions { Coloring::Directions } else { Coloring::Walls }
    }

    /// Returns the passes in the order in which they are drawn.
    pub(crate) fn passes(self) -> &'static [Option<Direction>] {
        match self {
            Coloring::Walls => &[None],
            Coloring::Directions => &[Some(Direction::Up), Some(Direction::Down)],
        }
    }

    /// Returns the number of strips of classes.
    pub(crate) fn strips(self) -> usize {
        match self {
            Coloring::Walls => 0,
            Coloring::Directions => self.passes().len(),
        }
    }

    /// Returns the index of a point's colour.
    pub(crate) fn index(self, column: &Column, side: Option<Side>) -> usize {
        match self {
            Coloring::Walls => side.map_or(0, Side::index),
            Coloring::Directions => usize::from(column.direction == Some(Direction::Down)),
        }
    }

    /// Returns the two colours of a panel.
    pub(crate) fn colors(self, panel: &Panel) -> [Color; 2] {
        match (self, panel.states) {
            (Coloring::Walls, States::Strobes) => [STROBE; 2],
            (Coloring::Walls, States::None) => [DARK; 2],
            _ => Side::BOTH.map(wall_color),
        }
    }
}

/// Returns the colour of a direction. The two colours mixed in equal parts are grey.
pub(crate) fn direction_color(direction: Direction) -> Color {
    match direction {
        Direction::Up => wall_color(Side::Right),
        Direction::Down => wall_color(Side::Left),
    }
}

/// Returns the colour of points of both passes.
pub(crate) fn both_directions() -> Color {
    mixed(Side::BOTH.map(wall_color), 0.5)
}

/// Mixes two colours, with a share `first` of the first one.
pub(crate) fn mixed([a, b]: [Color; 2], first: f64) -> Color {
    let mix = |a: u8, b: u8| (first * f64::from(a) + (1.0 - first) * f64::from(b)).round() as u8;
    [mix(a[0], b[0]), mix(a[1], b[1]), mix(a[2], b[2])]
}

/// Returns the colour of a class.
pub(crate) fn class_color(class: Class) -> Color {
    match class {
        Class::Periodic { .. } => MESHING,
        Class::Chaotic => DARK,
        Class::QuasiPeriodic => QUASI_PERIODIC,
        Class::Undecided | Class::Failed => FAINT,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::show::color_difference::least_difference;

    #[test]
    fn classes_differ_also_for_colour_blind_people() {
        let classes = [Class::Periodic { period: 1 }, Class::Chaotic, Class::Undecided, Class::QuasiPeriodic];
        let colors = classes.map(class_color);
        for (i, j) in (0..colors.len()).flat_map(|j| (0..j).map(move |i| (i, j))) {
            let [a, b] = [colors[i], colors[j]];
            assert!(least_difference(a, b) >= 10.0, "{a:?} {b:?}: {}", least_difference(a, b));
        }
    }
}
