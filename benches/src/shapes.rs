//! Oscillators of different shapes for the same motion, to compare their costs.

use rattlemap_dynamics::model::{Contact, Harmonic, Oscillator, OuterWall, Side, Stage};

/// Numbers of harmonics, stages and walls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Harmonics beside the first.
    pub harmonics: usize,
    /// Stages; 1 without changes.
    pub stages: usize,
    /// Walls on each side.
    pub walls: usize,
}

/// The shapes that are compared; the first one is plain.
pub const SHAPES: [Shape; 7] = [
    Shape { harmonics: 0, stages: 1, walls: 1 },
    Shape { harmonics: 1, stages: 1, walls: 1 },
    Shape { harmonics: 3, stages: 1, walls: 1 },
    Shape { harmonics: 0, stages: 2, walls: 1 },
    Shape { harmonics: 3, stages: 2, walls: 1 },
    Shape { harmonics: 0, stages: 1, walls: 3 },
    Shape { harmonics: 3, stages: 2, walls: 3 },
];

impl Shape {
    /// Returns its name, such as `4 harmonics, 2 stages, 3 walls`.
    pub fn name(self) -> String {
        let counted = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        [(1 + self.harmonics, "harmonic"), (self.stages, "stage"), (self.walls, "wall")]
            .map(|(n, what)| counted(n, what))
            .join(", ")
    }

    /// Adds tiny harmonics, equal stages and walls without force to an oscillator, so that its motion stays nearly the same.
    pub fn of(self, plain: &Oscillator) -> Oscillator {
        let tiny = plain.force.map(|force| 1e-9 * force);
        let harmonic = |n: usize| Harmonic { order: n as u32 + 2, cos: tiny, sin: tiny };
        let further = self.stages - 1;
        let change = |stage: usize| (stage as f64 / self.stages as f64, stage);
        let mut shaped = Oscillator {
            harmonics: (0..self.harmonics).map(harmonic).collect(),
            stages: vec![Stage { free: plain.free, meshing: plain.meshing }; further],
            schedule: if further > 0 { (0..self.stages).map(change).collect() } else { Vec::new() },
            ..plain.clone()
        };
        if self.walls > 1 {
            Side::BOTH.into_iter().for_each(|side| self.add_walls(&mut shaped, side.index()));
        }
        shaped
    }

    /// Puts elastic walls of stiffness 0 in front of a wall, at equal distances.
    fn add_walls(self, oscillator: &mut Oscillator, side: usize) {
        let (last, contact) = (oscillator.walls[side], oscillator.contacts[side]);
        let behind_last = vec![oscillator.meshing[side]; self.stages];
        let at = |nth: usize| last * nth as f64 / self.walls as f64;
        oscillator.walls[side] = at(1);
        oscillator.contacts[side] = Contact::Elastic;
        oscillator.meshing[side] = oscillator.free;
        oscillator.stages.iter_mut().for_each(|stage| stage.meshing[side] = stage.free);
        let inner = (2..self.walls).map(|nth| OuterWall {
            at: at(nth),
            contact: Contact::Elastic,
            meshing: vec![oscillator.free; self.stages],
        });
        let outer = inner.chain([OuterWall { at: last, contact, meshing: behind_last }]).collect();
        oscillator.outer_walls[side] = outer;
    }
}
