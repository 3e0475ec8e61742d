//! What figures call the walls.

use super::symbols::number;
use rattlemap_dynamics::model::{Model, Oscillator, Side};

/// The walls of a model.
#[derive(Clone, Copy, Debug)]
pub struct Walls {
    /// Right and left; infinite where there is none.
    at: [f64; 2],
    /// Whether they are at `+b` and `-b`, where `b` is a parameter.
    are_b: bool,
}

impl Walls {
    /// Of an oscillator that the model makes.
    pub fn of(model: &dyn Model, oscillator: &Oscillator) -> Walls {
        let at = oscillator.walls;
        Walls { at, are_b: model.get("b").is_ok_and(|b| at == [b, -b]) }
    }

    /// Where a wall is; none where there is no wall.
    pub(super) fn position(&self, side: Side) -> Option<f64> {
        Some(self.at[side.index()]).filter(|at| at.is_finite())
    }

    /// The same in words.
    pub(super) fn place(&self, side: Side) -> Option<String> {
        let at = self.position(side)?;
        Some(match (self.are_b, side) {
            (true, Side::Right) => "z = +b".to_owned(),
            (true, Side::Left) => "z = \u{2212}b".to_owned(),
            (false, _) => format!("z = {}", number(at)),
        })
    }

    /// The wall's name, with its place where that is a parameter: values may change along an axis.
    pub(super) fn name(&self, side: Side) -> Option<String> {
        let name = if side == Side::Right { "right wall" } else { "left wall" };
        let place = self.place(side)?;
        Some(if self.are_b { format!("{name}, {place}") } else { name.to_owned() })
    }

    /// What the distance behind a wall is called.
    pub(super) fn depth(&self) -> &'static str {
        if self.are_b { "depth, |z| \u{2212} b" } else { "depth behind the wall" }
    }

    /// What the section of a bifurcation diagram is called.
    pub(super) fn section(&self) -> &'static str {
        if self.are_b { "at |z| = b" } else { "at a wall" }
    }
}
